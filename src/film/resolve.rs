//! From sums to a picture with its standard error.
//!
//! The value of a pixel is the mean over all samples, Σ/n. Its variance comes from the spread of the
//! replicates, which are independent whatever the correlation of samples inside one (a low-discrepancy
//! sequence has no meaningful sample variance): with means mᵣ of nᵣ samples, N = Σnᵣ, m = Σnᵣmᵣ/N and R replicates,
//!
//! ```text
//! var(m) = Σᵣ nᵣ (mᵣ − m)² / ((R − 1) N)
//! ```
//!
//! unbiased where var(mᵣ) is proportional to 1/nᵣ, and for equal nᵣ in any case. It has R − 1 = 3 degrees of freedom:
//! coarse in one pixel, sharp in the sum over many.

use crate::film::Window;
use crate::film::accumulate::{Cell, Film, PixelCells, REPLICATES};
use crate::math::statistics::{Moments, student_t_half_width};
use rayon::prelude::*;
use std::fmt;

/// Light that was splatted from photons: sums that are divided by the photons emitted, not by the
/// samples that arrived.
#[derive(Clone, Copy, Debug)]
pub struct Splats<'a> {
    /// The sums; same window as the camera's film.
    pub film: &'a Film,
    /// Photons emitted in each replicate.
    pub photons: [u64; REPLICATES],
}

/// A linear picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width and height of the full frame.
    pub frame: [u32; 2],
    /// The pixels that the planes hold, in raster order.
    pub window: Window,
    /// Red, green and blue (or X, Y, Z: what the matrix made), premultiplied by alpha; 0 where there is no sample.
    pub rgb: [Vec<f32>; 3],
    /// Coverage. A filter with negative lobes may leave it a little outside [0, 1].
    pub alpha: Vec<f32>,
    /// Standard error of each value of `rgb`; NaN where fewer than two replicates have samples.
    pub standard_error: [Vec<f32>; 3],
}

/// The error of a whole picture: relative root mean square error with its interval.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ErrorEstimate {
    /// √relMSE.
    pub rel_rmse: f64,
    /// Lower end of the 95 % interval of `rel_rmse`.
    pub low: f64,
    /// Upper end of the 95 % interval of `rel_rmse`.
    pub high: f64,
    /// Pixels that took part: those with at least two replicates.
    pub pixels: u64,
    /// Whether the interval can be believed. False where so few pixels carry the error (fireflies, a tiny picture) that
    /// the mean over pixels is not yet normal: fewer than [`EFFECTIVE_PIXELS`] equally noisy pixels would scatter as much.
    pub valid: bool,
}

/// See [`ErrorEstimate::valid`]: 30 is where the central limit is commonly trusted; the mean over pixels then has a
/// relative standard error of 18 %.
pub const EFFECTIVE_PIXELS: f64 = 30.0;

/// Why there is no error estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoEstimate {
    /// No pixel has samples in two replicates, so there is no spread to look at.
    OneReplicate,
    /// Fewer than two pixels have an estimate, so it has no interval.
    OnePixel,
    /// Every pixel is black: a relative error has nothing to relate to.
    Black,
}

impl fmt::Display for NoEstimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NoEstimate::OneReplicate => "no pixel has samples in at least two replicates",
            NoEstimate::OnePixel => "fewer than two pixels have samples",
            NoEstimate::Black => "the picture is black",
        })
    }
}

/// The picture that `film` holds, in the colour space of `rgb_from_xyz`, with `splats` added; on the current rayon pool.
///
/// # Panics
/// If the windows or units of film and splats differ.
#[must_use]
pub fn resolve(film: &Film, splats: Option<Splats>, rgb_from_xyz: &[[f64; 3]; 3]) -> Image {
    let pixels = film.window().pixels();
    if let Some(splats) = &splats {
        assert_eq!(splats.film.window(), film.window(), "splats cover the window of the film");
        assert_eq!(splats.film.exponent(), film.exponent(), "splats count light as the film does");
    }
    let resolved: Vec<Resolved> = (0..pixels)
        .into_par_iter()
        .with_min_len(1024)
        .map(|index| {
            let cells = &film.cells()[index];
            let counts = cells.map(|cell| u64::from(cell.count));
            let mut pixel = mean_of(cells, counts, rgb_from_xyz);
            if let Some(splats) = &splats {
                // Two independent estimates of two parts of the light: means and variances add.
                let light = mean_of(&splats.film.cells()[index], splats.photons, rgb_from_xyz);
                for c in 0..3 {
                    pixel.rgb[c] += light.rgb[c];
                    pixel.variance[c] += light.variance[c];
                }
            }
            let unit = 2f64.powi(film.exponent());
            let samples: u64 = counts.iter().sum();
            let alpha: f64 = cells.iter().map(Cell::alpha_sum).sum();
            Resolved {
                rgb: pixel.rgb.map(|x| (x * unit) as f32),
                standard_error: pixel.variance.map(|v| (v.sqrt() * unit) as f32),
                alpha: if samples == 0 { 0.0 } else { (alpha / samples as f64) as f32 },
            }
        })
        .collect();
    let planes = |of: fn(&Resolved) -> [f32; 3]| {
        [0, 1, 2].map(|c| resolved.iter().map(|pixel| of(pixel)[c]).collect::<Vec<f32>>())
    };
    Image {
        frame: film.frame(),
        window: film.window(),
        rgb: planes(|pixel| pixel.rgb),
        alpha: resolved.iter().map(|pixel| pixel.alpha).collect(),
        standard_error: planes(|pixel| pixel.standard_error),
    }
}

/// A pixel of an [`Image`].
struct Resolved {
    rgb: [f32; 3],
    standard_error: [f32; 3],
    alpha: f32,
}

struct PixelMean {
    rgb: [f64; 3],
    /// Of the mean; NaN where fewer than two replicates have samples.
    variance: [f64; 3],
}

/// Mean and variance of the mean of a pixel whose replicates are divided by `divisors`.
fn mean_of(cells: &PixelCells, divisors: [u64; REPLICATES], rgb_from_xyz: &[[f64; 3]; 3]) -> PixelMean {
    let total: u64 = divisors.iter().sum();
    let replicates = divisors.iter().filter(|&&n| n > 0).count();
    if total == 0 {
        return PixelMean { rgb: [0.0; 3], variance: [f64::NAN; 3] };
    }
    let to_rgb = |xyz: [f64; 3]| rgb_from_xyz.map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]);
    // The sum over replicates is exact; it is rounded once.
    let mut sums = [crate::film::accumulate::Sum::default(); 3];
    for cell in cells {
        for (sum, &part) in sums.iter_mut().zip(&cell.xyz) {
            *sum += part;
        }
    }
    let rgb = to_rgb(sums.map(|sum| sum.value() / total as f64));
    let mut variance = [0.0; 3];
    for (cell, &n) in cells.iter().zip(&divisors) {
        if n > 0 {
            let own = to_rgb(cell.xyz.map(|sum| sum.value() / n as f64));
            for c in 0..3 {
                variance[c] += n as f64 * (own[c] - rgb[c]) * (own[c] - rgb[c]);
            }
        }
    }
    let variance = variance
        .map(|squares| if replicates < 2 { f64::NAN } else { squares / ((replicates - 1) as f64 * total as f64) });
    PixelMean { rgb, variance }
}

impl Image {
    /// Mean of each channel over the pixels, and of the three together.
    fn mean(&self) -> f64 {
        let values: usize = self.rgb.iter().map(Vec::len).sum();
        self.rgb.iter().flatten().map(|&v| f64::from(v)).sum::<f64>() / values.max(1) as f64
    }

    /// How noisy the picture is, judged from its own standard errors.
    ///
    /// relMSE is the mean, over pixels and the three channels, of var / (value² + 0.01·mean²) with the
    /// mean of all values of the picture: a factor on all light changes nothing, and black pixels count
    /// by a tenth of the mean instead of by nothing. The interval is Student's for the mean over pixels, whose errors
    /// are independent since a sample touches one pixel; a pixel counts once, as its channels are not.
    ///
    /// # Errors
    /// Why there is nothing to say.
    pub fn relative_error(&self) -> Result<ErrorEstimate, NoEstimate> {
        let mean = self.mean();
        let floor = 0.01 * mean * mean;
        let mut over_pixels = Moments::default();
        for i in 0..self.window.pixels() {
            if self.standard_error.iter().any(|plane| plane[i].is_nan()) {
                continue;
            }
            let of_pixel: f64 = (0..3)
                .map(|c| {
                    let error = f64::from(self.standard_error[c][i]);
                    let value = f64::from(self.rgb[c][i]);
                    if error == 0.0 { 0.0 } else { error * error / (value * value + floor) }
                })
                .sum();
            over_pixels.push(of_pixel / 3.0);
        }
        match over_pixels.count {
            0 => return Err(NoEstimate::OneReplicate),
            1 => return Err(NoEstimate::OnePixel),
            _ => {}
        }
        if self.rgb.iter().flatten().all(|&v| v == 0.0) {
            return Err(NoEstimate::Black);
        }
        let n = over_pixels.count as f64;
        let half = student_t_half_width(0.95, n - 1.0) * over_pixels.standard_error();
        // (Σt)²/Σt²: as many pixels of equal error would scatter as much.
        let squares = over_pixels.squares + n * over_pixels.mean * over_pixels.mean;
        let effective = n * n * over_pixels.mean * over_pixels.mean / squares;
        Ok(ErrorEstimate {
            rel_rmse: over_pixels.mean.sqrt(),
            low: (over_pixels.mean - half).max(0.0).sqrt(),
            high: (over_pixels.mean + half).sqrt(),
            pixels: over_pixels.count,
            valid: over_pixels.mean == 0.0 || effective >= EFFECTIVE_PIXELS,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::accumulate::TileBuffer;
    use crate::math::sampler::mix64;

    const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// Uniform on [0, 1).
    fn uniform(seed: u64, i: u64) -> f64 {
        (mix64(seed ^ mix64(i)) >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// A film whose samples are mean·(1 + a·U), U uniform on [−1, 1], with `counts` samples a replicate.
    fn noisy(seed: u64, side: u32, mean: f64, a: f64, counts: [u64; 4]) -> Film {
        let window = Window::full(side, side);
        let mut tile = TileBuffer::new(window);
        let mut i = 0;
        for pixel in 0..window.pixels() {
            let place = [(pixel % side as usize) as i32, (pixel / side as usize) as i32];
            for (replicate, &count) in counts.iter().enumerate() {
                for _ in 0..count {
                    let mut draw = || {
                        i += 1;
                        (mean * (1.0 + a * (2.0 * uniform(seed, i) - 1.0))) as f32
                    };
                    let xyz = [draw(), draw(), draw()];
                    tile.add(place, replicate, xyz, 1.0);
                }
            }
        }
        let mut film = Film::new([side, side], window).unwrap();
        film.merge_tile(&tile);
        film
    }

    /// One sample has variance (a·mean)²/3, the mean of N samples (a·mean)²/3N. The mean of the estimates over
    /// P pixels × 3 channels of ν = 3 degrees of freedom scatters by √(2/(3·3P)) of it (a little less for uniform
    /// noise); 4 standard errors at P = 4096 are 3 %. Counts are unequal, and once one replicate is empty (ν = 2).
    #[test]
    fn variance_of_the_mean_is_unbiased_for_unequal_counts() {
        for (counts, dof) in [([4, 4, 4, 4], 3.0), ([2, 8, 5, 3], 3.0), ([3, 0, 6, 4], 2.0)] {
            let image = resolve(&noisy(7, 64, 2.0, 0.9, counts), None, &IDENTITY);
            let n: u64 = counts.iter().sum();
            let expected = (0.9f64 * 2.0).powi(2) / 3.0 / n as f64;
            let found: Moments = image.standard_error.iter().flatten().map(|&e| f64::from(e) * f64::from(e)).collect();
            let tolerance = 4.0 * (2.0 / dof / (3.0 * 4096.0f64)).sqrt() * expected;
            assert!((found.mean - expected).abs() < tolerance, "{counts:?}: expected {expected}, found {}", found.mean);
        }
    }

    /// True relMSE of a picture of constant mean m: v / (m² + 0.01 m²). The estimate divides by the noisy value²
    /// instead, E[1/x²] ≈ (1 + 3v/m²)/m²: at v/m² = 0.01/3/16 = 2e-4 that shifts relMSE by 6e-4 of itself and the root by
    /// 3e-4, against a half width of 3 % here. 400 intervals should hold the truth 95 % of the time: binomial standard
    /// deviation 1.1 %, plus at most 1.5 % for the skew of t at P = 256; the bounds are 3 of the former and the latter.
    #[test]
    fn the_interval_covers_the_true_error_in_95_of_100_pictures() {
        let (runs, a) = (400, 0.1);
        let truth = (a * a / 3.0 / 16.0 / 1.01f64).sqrt();
        let mut covered = 0;
        let mut ratio = Moments::default();
        for run in 0..runs {
            let image = resolve(&noisy(1000 + run, 16, 3.0, a, [4; 4]), None, &IDENTITY);
            let e = image.relative_error().unwrap();
            assert!(e.valid && e.pixels == 256);
            covered += u64::from(e.low <= truth && truth <= e.high);
            ratio.push((e.rel_rmse / truth).powi(2));
        }
        let coverage = covered as f64 / runs as f64;
        assert!((coverage - 0.95).abs() < 3.0 * 0.011 + 0.015, "coverage {coverage}");
        // Unbiased up to 6e-4: within 4 standard errors of that.
        assert!((ratio.mean - 1.0).abs() < 6e-4 + 4.0 * ratio.standard_error(), "{ratio:?}");
    }

    /// Twice the light, twice the values and errors: the relative error has the same bits, as a factor of 2 is exact.
    #[test]
    fn the_relative_error_does_not_change_with_the_scale_of_the_light() {
        let image = |mean| resolve(&noisy(5, 8, mean, 0.5, [2; 4]), None, &IDENTITY).relative_error().unwrap();
        assert_eq!(image(1.0), image(1024.0));
    }

    #[test]
    fn without_two_replicates_there_is_no_estimate() {
        let one = resolve(&noisy(5, 8, 1.0, 0.5, [9, 0, 0, 0]), None, &IDENTITY);
        assert!(one.standard_error[0][0].is_nan() && one.rgb[0][0] > 0.0);
        assert_eq!(one.relative_error(), Err(NoEstimate::OneReplicate));
        assert_eq!(one.relative_error().unwrap_err().to_string(), "no pixel has samples in at least two replicates");
        let black = resolve(&noisy(5, 8, 0.0, 0.5, [2; 4]), None, &IDENTITY);
        assert_eq!(black.relative_error(), Err(NoEstimate::Black));
        let empty = resolve(&noisy(5, 8, 1.0, 0.5, [0; 4]), None, &IDENTITY);
        assert_eq!((empty.rgb[0][0], empty.alpha[0]), (0.0, 0.0));
    }

    /// One pixel of 256 carries all of the variance: the interval says that it is not to be believed.
    #[test]
    fn a_firefly_makes_the_interval_invalid() {
        let mut film = noisy(3, 16, 1.0, 0.0, [1; 4]);
        film.add([3, 3], 2, [1e4; 3], 1.0);
        assert!(!resolve(&film, None, &IDENTITY).relative_error().unwrap().valid);
    }

    /// Camera light 2 ± s₁ and splats of total 12 over 4·3 photons: 1 ± s₂. Means add, variances add.
    #[test]
    fn splats_are_divided_by_photons_and_their_variance_adds() {
        let window = Window::full(1, 1);
        let mut camera = Film::new([1, 1], window).unwrap();
        let mut photons = Film::new([1, 1], window).unwrap();
        for r in 0..4 {
            let wobble = if r % 2 == 0 { 0.5 } else { -0.5 };
            camera.add([0, 0], r, [2.0 + wobble; 3], 1.0);
            photons.add([0, 0], r, [1.5 + wobble; 3], 0.0);
            photons.add([0, 0], r, [1.5 - wobble; 3], 0.0);
        }
        photons.add([4, 4], 0, [9.0; 3], 0.0); // misses the window
        let image = resolve(&camera, Some(Splats { film: &photons, photons: [3; 4] }), &IDENTITY);
        assert_eq!(image.rgb[1][0], 3.0);
        assert_eq!(image.alpha[0], 1.0);
        // Replicate means 2 ± ½: Σ(m_r − m)²/(3·4) = 1/12; the photons' replicates are all alike.
        assert_eq!(image.standard_error[2][0], (1.0f64 / 12.0).sqrt() as f32);
    }

    /// The matrix acts on each replicate before the spread is taken: X and Y that differ only by sign cancel in X + Y.
    #[test]
    fn variances_are_those_of_the_channels_after_the_matrix() {
        let mut film = Film::new([1, 1], Window::full(1, 1)).unwrap();
        for r in 0..4 {
            let wobble = r as f32;
            film.add([0, 0], r, [wobble, 5.0 - wobble, 1.0], 1.0);
        }
        let image = resolve(&film, None, &[[1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]);
        assert_eq!(image.rgb.clone().map(|plane| plane[0]), [5.0, 1.5, 2.0]);
        // Σ(r − 1.5)² = 5 over 3·4.
        assert_eq!(image.standard_error.map(|plane| plane[0]), [0.0, (5.0f64 / 12.0).sqrt() as f32, 0.0]);
    }
}
