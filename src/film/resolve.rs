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
//!
//! Where samples were shared out by noise, replicates 0 and 1 of a pixel may have other counts than 2 and 3. The value is
//! then the mean of the means of the two halves, its variance Σᵣ (mᵣ − m)² / (R(R − 1)): unbiased whatever the counts.
//!
//! Where a sample goes to several pixels, by weights with an expected sum of n for n samples, what it adds up to in a pixel is W.
//! The usual S/W has a bias of order 1/n. Here a replicate has mᵣ = (Sᵣ + c (nᵣ − Wᵣ))/nᵣ, with c = ΣS/ΣW of the others:
//! they know nothing of Wᵣ, so that there is none, and light that is alike everywhere comes out as it is, as by S/W. So it is
//! with samples of filters with negative lobes, some of which count against their pixel. There ΣW may be about zero by chance: where
//! its magnitude is less than 1/64 of the samples Σn of the others, c is 4096 ΣS ΣW/(Σn)², which is the same there and has no pole.

use crate::film::Window;
use crate::film::accumulate::{Cell, Film, PixelCells, REPLICATES, Sum};
use crate::film::layers::LayerSums;
use rayon::prelude::*;
use rayon::slice::ChunksMut;
use std::borrow::Cow;
use std::ops::Range;

/// Light that was splatted from photons: sums that are divided by the photons emitted, not by the
/// samples that arrived.
#[derive(Clone, Copy, Debug)]
pub struct Splats<'a> {
    /// The sums; same window as the camera's film.
    pub film: &'a Film,
    /// Photons emitted in each replicate.
    pub photons: [u64; REPLICATES],
}

impl Splats<'_> {
    /// The variances of what was splatted, in the scene's units, pixel by pixel.
    pub(super) fn variances(&self, rgb_from_xyz: &[[f64; 3]; 3]) -> impl Iterator<Item = [f64; 3]> {
        let unit = 2f64.powi(2 * self.film.exponent());
        (0..self.film.cells().len()).map(move |i| self.sums(i).mean(rgb_from_xyz).variance.map(|v| v * unit))
    }

    /// As [`replicates_of_layer`], of what was splatted alone.
    pub(super) fn replicates_of_layer(&self, index: usize, channel: usize) -> Option<[f64; REPLICATES]> {
        self.film.layers.replicates(index, channel, Some(self.photons))
    }

    /// As [`replicate_light`], of what was splatted alone.
    #[must_use]
    pub fn replicates(&self, index: usize, rgb_from_xyz: &[[f64; 3]; 3]) -> Option<[[f64; 3]; REPLICATES]> {
        let unit = 2f64.powi(self.film.exponent());
        let light = self.sums(index).means(rgb_from_xyz)?;
        Some(light.map(|light| light.map(|x| x * unit)))
    }

    fn sums(&self, index: usize) -> Sums<'_> {
        Sums { cells: &self.film.cells()[index], divisors: self.photons, weights: None }
    }
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
    /// Coverage. A filter with negative lobes may leave it a little outside [0, 1] where it is not the same in the whole pixel.
    pub alpha: Vec<f32>,
    /// Standard error of each value of `rgb`; NaN where fewer than two replicates have samples.
    pub standard_error: [Vec<f32>; 3],
}

impl Image {
    /// What a person is shown: no pixels of overscan, which lie beyond the frame.
    #[must_use]
    pub fn shown(&self) -> Cow<'_, Image> {
        let window = self.window.shown(self.frame);
        if window == self.window {
            return Cow::Borrowed(self);
        }
        let (aside, width) = ((window.x - self.window.x) as usize, window.width as usize);
        let rows = self.window.width as usize;
        let cut = |plane: &Vec<f32>| -> Vec<f32> {
            let own = plane.chunks(rows).skip((window.y - self.window.y) as usize).take(window.height as usize);
            own.flat_map(|row| &row[aside..aside + width]).copied().collect()
        };
        Cow::Owned(Image {
            frame: self.frame,
            window,
            rgb: self.rgb.each_ref().map(cut),
            alpha: cut(&self.alpha),
            standard_error: self.standard_error.each_ref().map(cut),
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
    let unit = 2f64.powi(film.exponent());
    let plane = || vec![0.0f32; pixels];
    let [mut rgb, mut standard_error] = [[plane(), plane(), plane()], [plane(), plane(), plane()]];
    let mut alphas = plane();
    fn cut(plane: &mut [f32]) -> ChunksMut<'_, f32> {
        plane.par_chunks_mut(PIXELS_AT_ONCE)
    }
    let [red, green, blue] = rgb.each_mut().map(|plane| cut(plane));
    let [of_red, of_green, of_blue] = standard_error.each_mut().map(|plane| cut(plane));
    (red, green, blue, of_red, of_green, of_blue, cut(&mut alphas)).into_par_iter().enumerate().for_each(
        |(chunk, (red, green, blue, of_red, of_green, of_blue, alphas))| {
            for (i, covered) in alphas.iter_mut().enumerate() {
                let index = chunk * PIXELS_AT_ONCE + i;
                let sums = Sums::of(film, index);
                let mut pixel = match in_halves(sums.cells) {
                    true => sums.mean_of_halves(rgb_from_xyz),
                    false => sums.mean(rgb_from_xyz),
                };
                if let Some(splats) = &splats {
                    // Two independent estimates of two parts of the light: means and variances add.
                    let light = splats.sums(index).mean(rgb_from_xyz);
                    for c in 0..3 {
                        pixel.rgb[c] += light.rgb[c];
                        pixel.variance[c] += light.variance[c];
                    }
                }
                [red[i], green[i], blue[i]] = pixel.rgb.map(|x| (x * unit) as f32);
                [of_red[i], of_green[i], of_blue[i]] = pixel.variance.map(|v| (v.sqrt() * unit) as f32);
                *covered = alpha(sums.cells, sums.weights) as f32;
            }
        },
    );
    Image { frame: film.frame(), window: film.window(), rgb, alpha: alphas, standard_error }
}

/// So many pixels a thread resolves at a time.
const PIXELS_AT_ONCE: usize = 1024;

struct PixelMean {
    rgb: [f64; 3],
    /// Of the mean; NaN where fewer than two replicates have samples.
    variance: [f64; 3],
}

/// Replicates of a half.
pub(super) const HALF: usize = REPLICATES / 2;

/// Whether one half of the replicates had other samples than the other: replicates in turn differ by one.
pub(super) fn in_halves(cells: &PixelCells) -> bool {
    let of = |cells: &[Cell]| cells.iter().map(|cell| u64::from(cell.count) + u64::from(cell.dropped)).sum::<u64>();
    of(&cells[..HALF]).abs_diff(of(&cells[HALF..])) > HALF as u64
}

/// Coverage of a pixel whose samples count by `weights`, or each for one.
fn alpha(cells: &PixelCells, weights: Option<Weights>) -> f64 {
    if let Some(weights) = weights {
        let counts = counts(cells);
        let own = |r: usize| if counts[r] == 0 { 0.0 } else { cells[r].alpha_sum() / counts[r] as f64 };
        let mut means = std::array::from_fn(|r| [own(r)]);
        even(&mut means, counts, weights);
        let [alpha] = mean_of_replicates(&means, counts, in_halves(cells));
        return alpha;
    }
    match in_halves(cells) {
        true => 0.5 * (mean_alpha(&cells[..HALF]) + mean_alpha(&cells[HALF..])),
        false => mean_alpha(cells),
    }
}

/// What the samples of each replicate count for together.
type Weights = [f64; REPLICATES];

/// Makes up for what the `weights` of replicates lack: see above. `means` are their sums over `counts`. What has no others is
/// divided by its own weight.
pub(super) fn even<const N: usize>(
    means: &mut [[f64; N]; REPLICATES],
    counts: [u64; REPLICATES],
    weights: [f64; REPLICATES],
) {
    even_among(REPLICATES, means, counts, weights);
}

/// The same from others of its own group of so many alone.
fn even_among<const N: usize>(
    group: usize,
    means: &mut [[f64; N]; REPLICATES],
    counts: [u64; REPLICATES],
    weights: [f64; REPLICATES],
) {
    let sums: [[f64; N]; REPLICATES] = std::array::from_fn(|r| means[r].map(|mean| mean * counts[r] as f64));
    for (r, mean) in means.iter_mut().enumerate().filter(|(r, _)| counts[*r] > 0) {
        let others = || (0..REPLICATES).filter(|&s| s / group == r / group && s != r && counts[s] > 0);
        let all: f64 = others().map(|s| weights[s]).sum();
        let samples: u64 = others().map(|s| counts[s]).sum();
        let least = samples as f64 / 64.0;
        let share = if all.abs() >= least { 1.0 / all } else { all / (least * least) };
        let lack = 1.0 - weights[r] / counts[r] as f64;
        for (channel, mean) in mean.iter_mut().enumerate() {
            if samples > 0 {
                *mean += others().map(|s| sums[s][channel]).sum::<f64>() * share * lack;
            } else if weights[r] != 0.0 {
                *mean = sums[r][channel] / weights[r];
            }
        }
    }
}

/// The mean of all samples, given the `means` of the replicates, or where `halves` weigh alike that of theirs.
pub(super) fn mean_of_replicates<const N: usize>(
    means: &[[f64; N]; REPLICATES],
    counts: [u64; REPLICATES],
    halves: bool,
) -> [f64; N] {
    let mean = |of: Range<usize>, channel: usize| {
        let total: u64 = counts[of.clone()].iter().sum();
        let sum: f64 = of.map(|r| counts[r] as f64 * means[r][channel]).sum();
        sum / total.max(1) as f64
    };
    std::array::from_fn(|channel| match halves {
        true => 0.5 * (mean(0..HALF, channel) + mean(HALF..REPLICATES, channel)),
        false => mean(0..REPLICATES, channel),
    })
}

fn samples(cells: &[Cell]) -> u64 {
    cells.iter().map(|cell| u64::from(cell.count)).sum()
}

fn mean_alpha(cells: &[Cell]) -> f64 {
    let samples = samples(cells);
    let alpha: f64 = cells.iter().map(Cell::alpha_sum).sum();
    if samples == 0 { 0.0 } else { alpha / samples as f64 }
}

/// How much coverage a pixel has over what its samples have in the mean: one but where the halves weigh alike. Of N samples with n
/// and N − n in the halves a sample weighs N/(2n) or N/(2(N − n)), and coverage no more and no less. Only where no sample counts
/// against its pixel: of what a filter with negative lobes makes of alpha the halves tell its noise.
pub(super) fn coverage_of_halves(cells: &PixelCells) -> f64 {
    let mean = mean_alpha(cells);
    if !in_halves(cells) || mean <= 0.0 {
        return 1.0;
    }
    let weight = |half: &[Cell]| 0.5 * samples(cells) as f64 / samples(half) as f64;
    let (a, b) = (weight(&cells[..HALF]), weight(&cells[HALF..]));
    (alpha(cells, None) / mean).clamp(a.min(b), a.max(b))
}

/// The sums of a pixel and what becomes of them.
struct Sums<'a> {
    cells: &'a PixelCells,
    /// What the sums of each replicate are divided by.
    divisors: [u64; REPLICATES],
    /// Where samples do not count for one each.
    weights: Option<Weights>,
}

impl Sums<'_> {
    /// Those of the pixel of `film` at `index`.
    fn of(film: &Film, index: usize) -> Sums<'_> {
        let cells = &film.cells()[index];
        Sums { cells, divisors: counts(cells), weights: film.layers.weights(index) }
    }

    /// The mean of each replicate, zero where it has none.
    fn means_or_zero(&self, rgb_from_xyz: &[[f64; 3]; 3]) -> [[f64; 3]; REPLICATES] {
        self.means_among(REPLICATES, rgb_from_xyz)
    }

    /// The same, evened within groups of so many.
    fn means_among(&self, group: usize, rgb_from_xyz: &[[f64; 3]; 3]) -> [[f64; 3]; REPLICATES] {
        let Sums { cells, divisors, weights } = *self;
        let mut means = [[0.0; 3]; REPLICATES];
        for (r, mean) in means.iter_mut().enumerate().filter(|(r, _)| divisors[*r] > 0) {
            *mean = colours(&cells[r..=r], divisors[r], rgb_from_xyz);
        }
        if let Some(weights) = weights {
            even_among(group, &mut means, divisors, weights);
        }
        means
    }

    /// The mean of each replicate; `None` where one has none.
    fn means(&self, rgb_from_xyz: &[[f64; 3]; 3]) -> Option<[[f64; 3]; REPLICATES]> {
        (!self.divisors.contains(&0)).then(|| self.means_or_zero(rgb_from_xyz))
    }

    /// Mean and variance of the mean.
    fn mean(&self, rgb_from_xyz: &[[f64; 3]; 3]) -> PixelMean {
        let Sums { cells, divisors, weights } = *self;
        let total: u64 = divisors.iter().sum();
        let replicates = divisors.iter().filter(|&&n| n > 0).count();
        if total == 0 {
            return PixelMean { rgb: [0.0; 3], variance: [f64::NAN; 3] };
        }
        let means = self.means_or_zero(rgb_from_xyz);
        let rgb = match weights {
            Some(_) => mean_of_replicates(&means, divisors, false),
            None => colours(cells, total, rgb_from_xyz),
        };
        let mut variance = [0.0; 3];
        for (own, &n) in means.iter().zip(&divisors) {
            for c in 0..3 {
                variance[c] += n as f64 * (own[c] - rgb[c]) * (own[c] - rgb[c]);
            }
        }
        let variance = variance
            .map(|squares| if replicates < 2 { f64::NAN } else { squares / ((replicates - 1) as f64 * total as f64) });
        PixelMean { rgb, variance }
    }

    /// As [`Sums::mean`], where the halves weigh alike: how far one went on was for the other to say, so that it is no measure
    /// of how much it should count.
    fn mean_of_halves(&self, rgb_from_xyz: &[[f64; 3]; 3]) -> PixelMean {
        let Sums { cells, divisors, weights } = *self;
        let Some(means) = self.means(rgb_from_xyz) else { return self.mean(rgb_from_xyz) };
        let half = |of: Range<usize>| colours(&cells[of.clone()], divisors[of].iter().sum(), rgb_from_xyz);
        let rgb = if weights.is_some() {
            mean_of_replicates(&means, divisors, true)
        } else {
            let (a, b) = (half(0..HALF), half(HALF..REPLICATES));
            [0, 1, 2].map(|c| 0.5 * (a[c] + b[c]))
        };
        let mut variance = [0.0; 3];
        for own in means {
            for c in 0..3 {
                variance[c] += (own[c] - rgb[c]) * (own[c] - rgb[c]) / (REPLICATES * (REPLICATES - 1)) as f64;
            }
        }
        PixelMean { rgb, variance }
    }
}

/// The sum of `cells`, which is exact and rounded once, over `divisor`.
#[inline]
fn colours(cells: &[Cell], divisor: u64, rgb_from_xyz: &[[f64; 3]; 3]) -> [f64; 3] {
    let [mut x, mut y, mut z] = [Sum::default(); 3];
    for cell in cells {
        x += cell.xyz[0];
        y += cell.xyz[1];
        z += cell.xyz[2];
    }
    // Written out: `map` of an array may be compiled as calls.
    let [x, y, z] = [x.value() / divisor as f64, y.value() / divisor as f64, z.value() / divisor as f64];
    let [r, g, b] = rgb_from_xyz;
    [r[0] * x + r[1] * y + r[2] * z, g[0] * x + g[1] * y + g[2] * z, b[0] * x + b[1] * y + b[2] * z]
}

/// Samples of each replicate of a pixel.
#[must_use]
pub fn counts(cells: &PixelCells) -> [u64; REPLICATES] {
    cells.each_ref().map(|cell| u64::from(cell.count))
}

/// The mean of each replicate of a pixel of `film`, in its units; `None` where one has no sample. What one half of the replicates tells
/// is its own: what a weight lacks is made up for by the other of its half.
#[must_use]
pub fn means_of_halves(film: &Film, index: usize, rgb_from_xyz: &[[f64; 3]; 3]) -> Option<[[f64; 3]; REPLICATES]> {
    let sums = Sums::of(film, index);
    (!sums.divisors.contains(&0)).then(|| sums.means_among(HALF, rgb_from_xyz))
}

/// The light of each replicate of a pixel of `film` and `splats`, in the scene's units; `None` where one has none.
#[must_use]
pub fn replicate_light(
    film: &Film,
    splats: Option<&Splats>,
    index: usize,
    rgb_from_xyz: &[[f64; 3]; 3],
) -> Option<[[f64; 3]; REPLICATES]> {
    let has_all =
        !counts(&film.cells()[index]).contains(&0) && splats.is_none_or(|splats| !splats.photons.contains(&0));
    has_all.then(|| light_or_zero(film, splats, index, rgb_from_xyz))
}

/// The same, zero of replicates without samples.
pub(super) fn light_or_zero(
    film: &Film,
    splats: Option<&Splats>,
    index: usize,
    rgb_from_xyz: &[[f64; 3]; 3],
) -> [[f64; 3]; REPLICATES] {
    let mut means = Sums::of(film, index).means_or_zero(rgb_from_xyz);
    let unit = 2f64.powi(film.exponent());
    means.iter_mut().flatten().for_each(|x| *x *= unit);
    if let Some(splats) = splats {
        let light = splats.sums(index).means_or_zero(rgb_from_xyz);
        for (mean, light) in means.iter_mut().flatten().zip(light.iter().flatten()) {
            *mean += light * unit;
        }
    }
    means
}

/// The same of further channel `channel`, where that is summed by replicate.
pub(super) fn replicates_of_layer(
    film: &Film,
    splats: Option<&Splats>,
    index: usize,
    channel: usize,
) -> Option<[f64; REPLICATES]> {
    of_layers(film, splats, |layers, divisors| layers.replicates(index, channel, divisors))
}

/// The same, zero of replicates without samples; `None` where it is not summed by replicate.
pub(super) fn layer_or_zero(
    film: &Film,
    splats: Option<&Splats>,
    index: usize,
    channel: usize,
) -> Option<[f64; REPLICATES]> {
    of_layers(film, splats, |layers, divisors| layers.replicates_or_zero(index, channel, divisors))
}

/// What `means` says of the sums of the camera and of what is splatted, which are divided by photons, together.
fn of_layers(
    film: &Film,
    splats: Option<&Splats>,
    means: impl Fn(&LayerSums, Option<[u64; REPLICATES]>) -> Option<[f64; REPLICATES]>,
) -> Option<[f64; REPLICATES]> {
    let mut all = means(&film.layers, None)?;
    if let Some(splats) = splats {
        let light = means(&splats.film.layers, Some(splats.photons))?;
        all.iter_mut().zip(light).for_each(|(mean, light)| *mean += light);
    }
    Some(all)
}

/// A further channel of `film`, its mean over samples, with `splats` added.
#[must_use]
pub fn layer(film: &Film, splats: Option<&Splats>, channel: usize) -> Vec<f32> {
    let mut plane = film.layers.plane(channel);
    if let Some(splats) = splats.filter(|splats| channel < splats.film.layers.channels()) {
        let photons = splats.photons.iter().sum::<u64>().max(1) as f64;
        for (x, sum) in plane.iter_mut().zip(splats.film.layers.sums_of(channel)) {
            *x += (sum / photons) as f32;
        }
    }
    plane
}

/// [`replicate_light`] of every pixel.
#[must_use]
pub fn replicates(
    film: &Film,
    splats: Option<Splats>,
    rgb_from_xyz: &[[f64; 3]; 3],
) -> Vec<Option<[[f64; 3]; REPLICATES]>> {
    (0..film.window().pixels()).map(|index| replicate_light(film, splats.as_ref(), index, rgb_from_xyz)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::accumulate::TileBuffer;
    use crate::math::sampler::uniform;
    use crate::math::statistics::Moments;

    const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

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

    #[test]
    fn one_replicate_has_no_standard_error_and_no_samples_are_black() {
        let one = resolve(&noisy(5, 8, 1.0, 0.5, [9, 0, 0, 0]), None, &IDENTITY);
        assert!(one.standard_error[0][0].is_nan() && one.rgb[0][0] > 0.0);
        let empty = resolve(&noisy(5, 8, 1.0, 0.5, [0; 4]), None, &IDENTITY);
        assert_eq!((empty.rgb[0][0], empty.alpha[0]), (0.0, 0.0));
    }

    /// Two replicates of 2 samples around 1 and 3, two of 8 around 6 and 10: the mean of 2 and 8, not that of all
    /// samples, and the squares 16, 4, 1 and 25 of what is around it over 12. Where halves have as many, all samples count alike.
    #[test]
    fn halves_that_went_on_for_longer_count_no_more() {
        let film = |counts: [usize; 4]| {
            let mut film = Film::new([1, 1], Window::full(1, 1)).unwrap();
            for (replicate, (x, n)) in [1.0, 3.0, 6.0, 10.0].into_iter().zip(counts).enumerate() {
                (0..n).for_each(|_| film.add([0, 0], replicate, [x; 3], x / 10.0));
            }
            resolve(&film, None, &IDENTITY)
        };
        let image = film([2, 2, 8, 8]);
        assert_eq!((image.rgb[1][0], image.alpha[0]), (5.0, 0.5));
        assert!((f64::from(image.standard_error[1][0]) - (46.0f64 / 12.0).sqrt()).abs() < 1e-6);
        let image = film([2, 3, 3, 3]);
        assert!((f64::from(image.rgb[1][0]) - 59.0 / 11.0).abs() < 1e-6);
    }

    /// Sums of two samples each with weights of 1, 3, 2 and 2 in all: where light is 5 everywhere each replicate has 5. Where it is
    /// 4, 8, 0 and 0 in all, the first lacks 1 of 2 times 8/7 of the others, the second has 1 too many of 4/5, the others none.
    /// Alone, a replicate is divided by its own weight.
    #[test]
    fn what_weights_lack_is_made_up_for_by_the_others() {
        let evened = |sums: [f64; 4], counts: [u64; 4]| {
            let mut means = std::array::from_fn(|r| [sums[r] / counts[r].max(1) as f64]);
            even(&mut means, counts, [1.0, 3.0, 2.0, 2.0]);
            means.map(|[x]| x)
        };
        assert_eq!(evened([5.0, 15.0, 10.0, 10.0], [2; 4]), [5.0; 4]);
        let expected = [2.0 + 0.5 * 8.0 / 7.0, 4.0 - 0.5 * 4.0 / 5.0, 0.0, 0.0];
        let found = evened([4.0, 8.0, 0.0, 0.0], [2; 4]);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
        assert_eq!(evened([0.0, 6.0, 0.0, 0.0], [0, 2, 0, 0]), [0.0, 2.0, 0.0, 0.0]);
        // Light of 5 of two samples each, whose weights are 3, -1, -1 and 0.5 in all: what the others weigh is -1.5, 2.5, 2.5 and 1, of six.
        let weights = [3.0, -1.0, -1.0, 0.5];
        let mut means = weights.map(|weight| [5.0 * weight / 2.0]);
        even(&mut means, [2; 4], weights);
        assert!(means.iter().all(|[mean]| (mean - 5.0).abs() < 1e-14), "{means:?}");
        // Where the others come to about nothing little is made up for: a quarter at half of 6/64.
        let weights = [1.0, 1.0, -1.0, 3.0 / 64.0];
        let mut means = weights.map(|weight| [5.0 * weight / 2.0]);
        even(&mut means, [2; 4], weights);
        let others = [3.0 / 64.0, 3.0 / 64.0, 2.0 + 3.0 / 64.0, 1.0];
        let share = |other: f64| if other < 6.0 / 64.0 { (other * 64.0 / 6.0).powi(2) } else { 1.0 };
        let expected: [f64; 4] =
            std::array::from_fn(|r| 2.5 * weights[r] + 5.0 * share(others[r]) * (1.0 - weights[r] / 2.0));
        assert!(means.iter().zip(expected).all(|([a], b)| (a - b).abs() < 1e-14), "{means:?}");
        // Within halves the first lacks 1 of 2 times 8/3, the second has 1 too many of 4/1, and the other half is as dark as it is.
        let mut means = [[2.0], [4.0], [0.0], [0.0]];
        even_among(HALF, &mut means, [2; 4], [1.0, 3.0, 2.0, 2.0]);
        let expected = [2.0 + 0.5 * 8.0 / 3.0, 4.0 - 0.5 * 4.0, 0.0, 0.0];
        assert!(means.iter().zip(expected).all(|([a], b)| (a - b).abs() < 1e-15), "{means:?}");
    }

    /// Camera light 2 ± s₁ and splats of total 12 over 4·3 photons: 1 ± s₂. Means add, variances add; all in units of 2³.
    #[test]
    fn splats_are_divided_by_photons_and_their_variance_adds() {
        let window = Window::full(1, 1);
        let mut camera = Film::new([1, 1], window).unwrap().with_exponent(3);
        let mut photons = Film::new([1, 1], window).unwrap().with_exponent(3);
        for r in 0..4 {
            let (wobble, other) = (if r % 2 == 0 { 0.5 } else { -0.5 }, if r < 2 { 0.75 } else { -0.75 });
            camera.add([0, 0], r, [2.0 + wobble; 3], 1.0);
            photons.add([0, 0], r, [1.5 + wobble; 3], 0.0);
            photons.add([0, 0], r, [1.5 - wobble + other; 3], 0.0);
        }
        photons.add([4, 4], 0, [9.0; 3], 0.0); // misses the window
        let image = resolve(&camera, Some(Splats { film: &photons, photons: [3; 4] }), &IDENTITY);
        assert_eq!(image.rgb[1][0], 24.0);
        assert_eq!(image.alpha[0], 1.0);
        // Replicate means 2 ± ½ and 1 ± ¼: Σ(m_r − m)²/(3·4) = 1/12 and 1/48. Some roundings in f64, then one to f32.
        let expected = 8.0 * (5.0f64 / 48.0).sqrt();
        assert!((f64::from(image.standard_error[2][0]) / expected - 1.0).abs() < f64::from(f32::EPSILON));
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
