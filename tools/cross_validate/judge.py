"""Whether two noisy pictures show the same light.

Three questions, each of every colour channel; R, G and B are correlated and never pooled.

1. The mean of the picture: ratio within `ALLOWANCE`, or difference within three standard errors.
2. The means of blocks of 8 x 8 pixels: no block's difference exceeds the allowance by more than noise
   explains. One defect in one place is found here.
3. The pixels, as Mitsuba's own tests do (src/render/tests/test_renders.py): variances of a sample of
   at least 1e-4, significance 0.01 with Sidak's correction for the number of pixels, and at least
   99.75 % of the values accepted.

Variances are estimated from few replicates, so differences are measured against Student's t with the
degrees of freedom of Welch and Satterthwaite rather than against the normal distribution, whose tails
would call a good pixel bad: with 3 degrees of freedom one in 50 would fall.
"""

from dataclasses import asdict, dataclass

import numpy as np
from scipy.special import stdtr

from conventions import ALLOWANCE

BLOCK = 8
ALPHA = 0.01
ACCEPTED = 0.9975
STANDARD_ERRORS = 3.0
# A channel whose mean is below this part of the brightest one's is measured against that part.
DARK = 0.05
# More noise than this part of the mean, and agreement would say nothing.
MOST_NOISE = 0.005
# Mitsuba's floor for the variance of one sample.
SAMPLE_VARIANCE_FLOOR = 1e-4


@dataclass
class Estimate:
    """Means with the variance of each mean and its degrees of freedom; any shape, channels last."""

    mean: np.ndarray
    variance: np.ndarray
    freedom: np.ndarray

    @staticmethod
    def of_replicates(replicates: np.ndarray) -> "Estimate":
        """From independent pictures, first axis."""
        n = len(replicates)
        mean = replicates.mean(0)
        return Estimate(mean, replicates.var(0, ddof=1) / n, np.full(mean.shape, n - 1.0))

    @staticmethod
    def of_standard_errors(mean: np.ndarray, error: np.ndarray, freedom: float) -> "Estimate":
        """From a picture that states its error."""
        return Estimate(mean, error**2, np.full(mean.shape, freedom))

    def pooled(self, axes: tuple) -> "Estimate":
        """Means over independent pixels along `axes`."""
        n = np.prod([self.mean.shape[a] for a in axes])
        total = self.variance.sum(axes)
        spread = (self.variance**2 / self.freedom).sum(axes)
        freedom = np.divide(total**2, spread, out=np.ones_like(total), where=spread > 0)
        return Estimate(self.mean.mean(axes), total / n**2, np.maximum(freedom, 1.0))


@dataclass
class Picture:
    """One renderer's answer at three scales."""

    pixels: Estimate
    blocks: Estimate
    whole: Estimate
    samples: int
    finite: bool


def split(x: np.ndarray) -> np.ndarray:
    """Pixels (..., h, w, c) as (..., h/8, 8, w/8, 8, c); edges that fill no block are left out."""
    h, w, c = x.shape[-3:]
    h, w = h // BLOCK * BLOCK, w // BLOCK * BLOCK
    x = x[..., :h, :w, :]
    return x.reshape(*x.shape[:-3], h // BLOCK, BLOCK, w // BLOCK, BLOCK, c)


def picture_of_errors(mean: np.ndarray, error: np.ndarray, freedom: float, samples: int) -> Picture:
    """A picture with the standard error of each pixel; pixels are independent."""
    pixels = Estimate.of_standard_errors(mean, error, freedom)
    parts = Estimate(split(mean), split(error**2), np.full(split(mean).shape, freedom))
    finite = bool(np.isfinite(mean).all() and np.isfinite(error).all())
    return Picture(pixels, parts.pooled((1, 3)), pixels.pooled((0, 1)), samples, finite)


def picture_of_replicates(replicates: np.ndarray, samples: int, independent_pixels: bool) -> Picture:
    """A picture from independent renders. A filter wider than a pixel correlates its pixels; blocks and
    the whole are then compared between renders, which costs degrees of freedom."""
    pixels = Estimate.of_replicates(replicates)
    finite = bool(np.isfinite(replicates).all())
    if independent_pixels:
        parts = Estimate.of_replicates(split(replicates))
        return Picture(pixels, parts.pooled((1, 3)), pixels.pooled((0, 1)), samples, finite)
    blocks = Estimate.of_replicates(split(replicates).mean((2, 4)))
    whole = Estimate.of_replicates(replicates.mean((1, 2)))
    return Picture(pixels, blocks, whole, samples, finite)


def p_values(a: Estimate, b: Estimate, floor: float, allowance: np.ndarray) -> np.ndarray:
    """Two-sided p that means which differ by no more than `allowance` come out as far apart as these."""
    va, vb = a.variance + 1e-30, b.variance + 1e-30
    freedom = (va + vb) ** 2 / (va**2 / a.freedom + vb**2 / b.freedom)
    error = np.sqrt(np.maximum(va + vb, floor))
    excess = np.maximum(np.abs(a.mean - b.mean) - allowance, 0.0)
    return 2.0 * stdtr(freedom, -excess / error)


@dataclass
class Verdict:
    """What the comparison found; ready for JSON."""

    passed: bool
    reason: str
    mean_abbe: list
    mean_mitsuba: list
    ratio: list
    standard_error: list
    z: list
    blocks: int
    blocks_rejected: int
    pixels_accepted: float
    samples_abbe: int
    samples_mitsuba: int
    # Whether nothing speaks against the pictures but noise, or that Mitsuba's is none.
    undecided: bool
    # What `abbe compare` says of the same pictures; none where pixels are not independent.
    abbe_compare: str | None = None

    def as_dict(self) -> dict:
        """For JSON."""
        return asdict(self)


def judge(a: Picture, b: Picture, allowance: float = ALLOWANCE) -> Verdict:
    """Compares Abbe's picture with Mitsuba's."""
    faults = []
    if not a.finite:
        faults.append("a pixel is not a finite number")
    if not b.finite:
        faults.append("a pixel of Mitsuba's is not a finite number")

    # 1. The whole. Errors are relative to a channel's mean.
    scale = np.maximum(np.abs(b.whole.mean), max(DARK * np.abs(b.whole.mean).max(), np.finfo(float).tiny))
    difference = (a.whole.mean - b.whole.mean) / scale
    error = np.sqrt(a.whole.variance + b.whole.variance) / scale
    if (np.abs(difference) > np.maximum(allowance, STANDARD_ERRORS * error)).any():
        faults.append("means differ")
    noisy = (error > MOST_NOISE).any()
    if noisy:
        faults.append("too noisy to judge")

    # 2. The blocks.
    block_floor = SAMPLE_VARIANCE_FLOOR / BLOCK**2 * (1 / a.samples + 1 / b.samples)
    p = p_values(a.blocks, b.blocks, block_floor, allowance * np.abs(b.blocks.mean))
    count = p.shape[0] * p.shape[1]
    rejected = int((p <= 1 - (1 - ALPHA) ** (1 / p.size)).any(-1).sum())
    if rejected:
        faults.append(f"{rejected} of {count} blocks differ")

    # 3. The pixels.
    floor = SAMPLE_VARIANCE_FLOOR * (1 / a.samples + 1 / b.samples)
    p = p_values(a.pixels, b.pixels, floor, allowance * np.abs(b.pixels.mean))
    accepted = float((p > 1 - (1 - ALPHA) ** (1 / (p.shape[0] * p.shape[1]))).mean())
    if not accepted >= ACCEPTED:
        faults.append("pixels differ")

    return Verdict(
        passed=not faults,
        reason=", ".join(faults),
        mean_abbe=a.whole.mean.tolist(),
        mean_mitsuba=b.whole.mean.tolist(),
        ratio=(1 + difference).tolist(),
        standard_error=error.tolist(),
        z=(difference / np.maximum(error, 1e-12)).tolist(),
        blocks=count,
        blocks_rejected=rejected,
        pixels_accepted=accepted,
        samples_abbe=a.samples,
        samples_mitsuba=b.samples,
        undecided=bool(noisy and len(faults) == 1 or a.finite and not b.finite),
    )
