//! What is known of a setting after some rounds: noise, bias and light against a reference.
//!
//! With w = 1 / (μ² + f), μ the reference and f as in [`crate::film::error`], so that a noisy value is never divided by itself:
//!
//! * **noise**² is the mean over pixels, channels and rounds of w v, v the variance of a pixel's mean by its four replicates;
//!   its interval comes from how that differs between rounds, block by block of pixels;
//! * **bias**² is the mean of w times what the differences Yᵢ of the R = 4 replicates to those of the reference, which are
//!   independent, have in common: the mean over i ≠ j of YᵢYⱼ, whose expectation is the square of the difference of the
//!   means, whatever the distribution, so that no variance need be known and taken off. It is 4|Ȳ|²/s² − 1 times s²/4, s² = tr WS
//!   what the four tell of the variance tr WΣ of one, Σ the covariance of a Y over pixels and channels. Where there is no bias that
//!   ratio is as F of k and 3k degrees of freedom, k = (tr WΣ)² / tr(WΣ)² (Satterthwaite 1946), which is skewed where k is small: paths
//!   and samples are shared in cells, of which small pictures have few. The error is a third of what F passes as rarely as a
//!   normal number three of its own; of large k it is s²/√6k. With A = tr(WS)² and B = (tr WS)² of the pixels of a block, within
//!   which they may share light, tr(WΣ)² is (A − B/3) · 9/10, as in [`crate::film::error`], or that of all together if that is more:
//!   where photons are merged all pixels of a sample share their wavelengths. B is 2/3 tr(WΣ)² more than (tr WΣ)² in the mean, so that
//!   1/k is 1 + 2/3k times what they say;
//! * **light** is the mean of red, green and blue over the reference's.

use super::desk::{self, Outcome, Pass};
use super::{Figure, Point};
use crate::batch::adaptive::SIDE;
use crate::film::Window;
use crate::film::accumulate::REPLICATES;
use crate::film::error;
use crate::film::resolve::Image;
use crate::math::statistics::{Moments, f_upper_quantile, normal_two_sided_p, student_t_half_width};
use crate::spectrum::{ColourSpace, Spectrum, observer};

/// Blocks along the longer side.
const BLOCKS: u32 = 8;

/// Blocks of noise are whole cells, in which paths and dealt samples are shared, where that leaves as many. Those of bias always are: few
/// of them make its error wider.
const FEWEST_BLOCKS: u32 = 16;

/// What stands out by less is taken for chance: of forty settings one in ten scenes or so stands out by chance, in more where a few
/// pixels have most of the noise.
pub const SIGNIFICANT: f64 = 3.0;

/// Red, green and blue of the replicates of a pixel.
pub type Replicates = [[f64; 3]; REPLICATES];

/// Of more degrees of freedom, which replicates that are equally far from their mean in all directions seem to have, the skewness of
/// χ², √(8/k), is below three hundredths of a per cent.
const MOST_DEGREES: f64 = 1e8;

/// What a picture is held against.
#[derive(Debug)]
pub struct Reference {
    replicates: Vec<Option<Replicates>>,
    /// w of each value over the number of them; zero where there is nothing.
    weights: Vec<[f64; 3]>,
    window: Window,
    /// √relMSE of its own noise.
    pub noise: f64,
}

/// What the rounds of a setting add up to.
#[derive(Debug, Default)]
pub struct Tally {
    /// Over the rounds.
    replicates: Vec<Option<Replicates>>,
    /// Those of each round.
    passes: Vec<Vec<Pass>>,
    /// Mean light of each replicate of each round.
    light: Vec<[f64; 3]>,
}

impl Reference {
    /// Of a picture and its replicates.
    #[must_use]
    pub fn new(image: &Image, replicates: Vec<Option<Replicates>>) -> Reference {
        let floor = error::floor(image);
        let values = 3.0 * replicates.iter().flatten().count().max(1) as f64;
        let weight = |i: usize| {
            image.rgb.each_ref().map(|plane| {
                let size = f64::from(plane[i]) * f64::from(plane[i]) + floor;
                if replicates[i].is_some() && size > 0.0 { 1.0 / (size * values) } else { 0.0 }
            })
        };
        let weights: Vec<[f64; 3]> = (0..image.window.pixels()).map(weight).collect();
        let mut reference = Reference { replicates, weights, window: image.window, noise: 0.0 };
        let noise: f64 = reference.noise_of(&reference.replicates).iter().sum();
        reference.noise = noise.sqrt();
        reference
    }

    /// Of the closed form of a picture the size of `image`: each pixel has this radiance at all wavelengths.
    #[must_use]
    pub fn known(image: &Image, radiance: f64) -> Reference {
        let rgb = ColourSpace::Rec709.matrix_from_xyz().map(|row| {
            let white = observer::tristimulus(&Spectrum::constant(1.0));
            radiance * (row[0] * white[0] + row[1] * white[1] + row[2] * white[2])
        });
        let pixels = image.window.pixels();
        let truth = Image { rgb: rgb.map(|x| vec![x as f32; pixels]), ..image.clone() };
        Reference::new(&truth, vec![Some([rgb; REPLICATES]); pixels])
    }

    /// Whether there is no light in it.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.weights.iter().flatten().all(|weight| *weight == 0.0)
    }

    /// The block of each pixel, and how many there are; whole cells where they are no fewer than `fewest`.
    fn blocks(&self, fewest: u32) -> (impl Fn(usize) -> usize, usize) {
        let Window { x, y, width, height } = self.window;
        // Cells are aligned to the frame.
        let before = |side: u32| [x, y].map(|at| at.rem_euclid(side as i32) as u32);
        let of_side = |side: u32| [(before(side)[0] + width).div_ceil(side), (before(side)[1] + height).div_ceil(side)];
        let fine = width.max(height).div_ceil(BLOCKS).max(1);
        let whole = fine.next_multiple_of(SIDE);
        let side = if of_side(whole).iter().product::<u32>() >= fewest { whole } else { fine };
        let ([left, above], [columns, rows]) = (before(side), of_side(side));
        let block = move |i: usize| {
            let (column, row) = ((left + i as u32 % width) / side, (above + i as u32 / width) / side);
            (row * columns + column) as usize
        };
        (block, (columns * rows) as usize)
    }

    /// noise² of each block.
    #[must_use]
    pub fn noise_of(&self, replicates: &[Option<Replicates>]) -> Vec<f64> {
        let (block, count) = self.blocks(FEWEST_BLOCKS);
        let mut sums = vec![0.0; count];
        for (i, pixel) in replicates.iter().enumerate() {
            let Some(pixel) = pixel else { continue };
            for c in 0..3 {
                let mean = pixel.iter().map(|x| x[c]).sum::<f64>() / REPLICATES as f64;
                let squares: f64 = pixel.iter().map(|x| (x[c] - mean) * (x[c] - mean)).sum();
                sums[block(i)] += self.weights[i][c] * squares / (REPLICATES * (REPLICATES - 1)) as f64;
            }
        }
        sums
    }
}

impl Tally {
    /// Adds a round.
    pub fn add(&mut self, outcome: Outcome) {
        self.light.extend(means(&outcome.replicates));
        self.passes.push(outcome.passes);
        self.replicates = match self.passes.len() {
            1 => outcome.replicates,
            _ => desk::sum(std::mem::take(&mut self.replicates), &outcome.replicates),
        };
    }

    /// noise² of one picture after `pass`. Blocks may share what they find where photons are merged: the error is that by how the
    /// whole differs between rounds if that is more. Of a single round the blocks tell it, which is then too large by how they
    /// differ.
    fn noise_after(&self, pass: usize) -> Figure {
        let all: Vec<&[f64]> = self.passes.iter().map(|round| round[pass].noise.as_slice()).collect();
        let rounds = all.len() as f64;
        let value = all.iter().copied().flatten().sum::<f64>() / rounds;
        let blocks = all[0].len();
        let variance = if all.len() > 1 {
            let of = |block: usize| all.iter().map(|round| round[block]).collect::<Moments>();
            let apart = (0..blocks).map(|block| of(block).variance()).sum::<f64>();
            let together = all.iter().map(|round| round.iter().sum::<f64>()).collect::<Moments>().variance();
            apart.max(together) / rounds
        } else {
            all[0].iter().copied().collect::<Moments>().variance() * blocks as f64
        };
        Figure { value, error: variance.sqrt() }
    }

    /// noise² of one picture.
    #[must_use]
    pub fn noise_squared(&self) -> Figure {
        self.noise_after(self.passes[0].len() - 1)
    }

    /// Its root with the interval of 95 %, even in its logarithm.
    #[must_use]
    pub fn noise(&self) -> [f64; 3] {
        self.interval(self.noise_squared())
    }

    fn interval(&self, Figure { value, error }: Figure) -> [f64; 3] {
        let degrees = (self.passes.len().max(2) - 1) * self.passes[0][0].noise.len();
        let half = student_t_half_width(0.95, degrees.max(2) as f64) * error;
        let stretch = if value > 0.0 { libm::exp(0.5 * half / value) } else { 1.0 };
        [value.sqrt(), value.sqrt() / stretch, value.sqrt() * stretch]
    }

    /// Whether no light was met.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.replicates.iter().flatten().flatten().flatten().all(|x| *x == 0.0)
    }

    /// How many rounds there are.
    #[must_use]
    pub fn rounds(&self) -> usize {
        self.passes.len()
    }

    /// Seconds of a render, the least of the rounds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.all_seconds().fold(f64::INFINITY, f64::min)
    }

    /// The most of the rounds.
    #[must_use]
    pub fn most_seconds(&self) -> f64 {
        self.all_seconds().fold(0.0, f64::max)
    }

    fn all_seconds(&self) -> impl Iterator<Item = f64> {
        self.passes.iter().filter_map(|round| Some(round.last()?.seconds))
    }

    /// How noise fell with time.
    #[must_use]
    pub fn curve(&self) -> Vec<Point> {
        let point = |pass: usize| {
            let seconds = self.passes.iter().map(|round| round[pass].seconds).fold(f64::INFINITY, f64::min);
            let (samples, noise) = (self.passes[0][pass].samples, self.interval(self.noise_after(pass)));
            // Rounds that happened to miss rare bright paths look alike.
            let converged = self.passes.iter().all(|round| round[pass].converged);
            Point { samples, seconds, noise, converged }
        };
        (0..self.passes[0].len()).map(point).collect()
    }

    /// bias².
    #[must_use]
    pub fn bias_squared(&self, reference: &Reference) -> Figure {
        let rounds = self.passes.len() as f64;
        let (block, count) = reference.blocks(1);
        let mut value = 0.0;
        let mut blocks = vec![Gram::default(); count];
        for (i, (pixel, truth)) in self.replicates.iter().zip(&reference.replicates).enumerate() {
            let (Some(pixel), Some(truth)) = (pixel, truth) else { continue };
            for c in 0..3 {
                let y: [f64; REPLICATES] = std::array::from_fn(|r| pixel[r][c] / rounds - truth[r][c]);
                let (sum, squares) = y.iter().fold((0.0, 0.0), |(a, b), y| (a + y, b + y * y));
                let weight = reference.weights[i][c];
                value += weight * (sum * sum - squares) / (REPLICATES * (REPLICATES - 1)) as f64;
                blocks[block(i)].add(y.map(|y| y - sum / REPLICATES as f64), weight);
            }
        }
        let mut all = Gram::default();
        blocks.iter().for_each(|block| all.join(block));
        let apart: f64 = blocks.iter().map(Gram::trace_of_square).sum();
        Figure { value, error: error_without_bias(all.trace(), apart.max(all.trace_of_square())) }
    }

    /// Red, green and blue over those of the reference. Of colours outside of Rec. 709 one is below zero: there a ratio above one is of
    /// less light, so that it is taken as far to the other side of one.
    #[must_use]
    pub fn light(&self, reference: &Reference) -> [Figure; 3] {
        let truth = means(&reference.replicates);
        std::array::from_fn(|c| {
            let [own, truth] = [self.light.as_slice(), &truth].map(|all| all.iter().map(|m| m[c]).collect::<Moments>());
            let ratio = own.mean / truth.mean;
            let value = if truth.mean < 0.0 { 2.0 - ratio } else { ratio };
            Figure { value, error: libm::hypot(wide(&own), ratio * wide(&truth)) / truth.mean.abs() }
        })
    }
}

/// Of the replicates' deviations d in some values: Σ w dₐ dᵇ.
#[derive(Clone, Copy, Default)]
struct Gram([[f64; REPLICATES]; REPLICATES]);

impl Gram {
    fn add(&mut self, deviations: [f64; REPLICATES], weight: f64) {
        for (row, a) in self.0.iter_mut().zip(deviations) {
            row.iter_mut().zip(deviations).for_each(|(sum, b)| *sum += weight * a * b);
        }
    }

    fn join(&mut self, other: &Gram) {
        self.0.iter_mut().flatten().zip(other.0.iter().flatten()).for_each(|(sum, x)| *sum += x);
    }

    /// tr WS.
    fn trace(&self) -> f64 {
        (0..REPLICATES).map(|r| self.0[r][r]).sum::<f64>() / (REPLICATES - 1) as f64
    }

    /// tr(WΣ)², as normal noise has it.
    fn trace_of_square(&self) -> f64 {
        let squares = self.0.iter().flatten().map(|x| x * x).sum::<f64>();
        let own = squares / ((REPLICATES - 1) * (REPLICATES - 1)) as f64 - self.trace() * self.trace() / 3.0;
        0.9 * own.max(0.0)
    }
}

/// That of bias² where there is none, made wider for few degrees of freedom: [`SIGNIFICANT`] of it are passed by chance as rarely as of
/// a normal number. `trace` is tr WS, `of_square` tr(WΣ)².
fn error_without_bias(trace: f64, of_square: f64) -> f64 {
    if trace == 0.0 {
        return 0.0;
    }
    let told = trace * trace / of_square;
    let k = (told / (1.0 + 2.0 / (3.0 * told))).clamp(1.0, MOST_DEGREES);
    let passed = f_upper_quantile(0.5 * normal_two_sided_p(SIGNIFICANT), [k, (REPLICATES - 1) as f64 * k]);
    0.25 * trace * (passed - 1.0) / SIGNIFICANT
}

/// Mean light of each replicate.
fn means(pixels: &[Option<Replicates>]) -> [[f64; 3]; REPLICATES] {
    let mut sums = [[0.0; 3]; REPLICATES];
    for pixel in pixels.iter().flatten() {
        for (sum, x) in sums.iter_mut().flatten().zip(pixel.iter().flatten()) {
            *sum += x;
        }
    }
    sums.map(|sum| sum.map(|x| x / pixels.len().max(1) as f64))
}

/// The standard error, made wider for few numbers: [`SIGNIFICANT`] of it are passed by chance as rarely as of a normal number.
fn wide(m: &Moments) -> f64 {
    let confidence = 1.0 - normal_two_sided_p(SIGNIFICANT);
    m.standard_error() * student_t_half_width(confidence, m.count as f64 - 1.0) / SIGNIFICANT
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::mix64;

    const SIDE: u32 = 24;

    /// Sum of three uniform numbers on [−1, 1): mean 0, variance 1.
    fn noise(seed: u64, i: u64) -> f64 {
        let u = |k: u64| (mix64(mix64(seed) ^ mix64(i * 3 + k)) >> 11) as f64 / (1u64 << 53) as f64;
        2.0 * (u(0) + u(1) + u(2)) - 3.0
    }

    /// Replicates of light `light` with noise of standard deviation `sigma`.
    fn outcome(seed: u64, light: impl Fn(usize) -> f64, sigma: f64) -> Outcome {
        let of = |i: usize| -> Replicates {
            std::array::from_fn(|r| {
                std::array::from_fn(|c| light(i) + sigma * noise(seed, (i * 12 + r * 3 + c) as u64))
            })
        };
        let window = Window::full(SIDE, SIDE);
        let replicates = (0..window.pixels()).map(|i| Some(of(i))).collect();
        Outcome { replicates, passes: Vec::new(), image: flat(1.0) }
    }

    fn flat(value: f32) -> Image {
        let window = Window::full(SIDE, SIDE);
        let plane = vec![value; window.pixels()];
        Image {
            frame: [SIDE; 2],
            window,
            rgb: [0; 3].map(|_| plane.clone()),
            alpha: plane.clone(),
            standard_error: [0; 3].map(|_| plane.clone()),
        }
    }

    fn tally(reference: &Reference, rounds: u64, seed: u64, light: impl Fn(usize) -> f64 + Copy, sigma: f64) -> Tally {
        let mut tally = Tally::default();
        for round in 0..rounds {
            let outcome = outcome(seed * 100 + round, light, sigma);
            let noise = reference.noise_of(&outcome.replicates);
            tally.add(Outcome { passes: vec![Pass { samples: 4, seconds: 1.0, noise, converged: true }], ..outcome });
        }
        tally
    }

    /// Of two numbers, 0 and 2, the standard error is 1 and has one degree of freedom: Student's t is Cauchy's, whose two sides beyond
    /// x have the probability 1 − 2 atan(x)/π. Here that is the one of a normal number beyond three: x = cot(p π/2).
    #[test]
    fn an_error_told_by_two_numbers_is_as_wide_as_cauchys() {
        let two: Moments = [0.0, 2.0].into_iter().collect();
        let expected = 1.0 / (libm::tan(0.5 * std::f64::consts::PI * normal_two_sided_p(SIGNIFICANT)) * SIGNIFICANT);
        assert!((wide(&two) / expected - 1.0).abs() < 1e-9, "{} for {expected}", wide(&two));
    }

    /// Light of 1, w = 1/1.01, replicates of variance 0.04: noise² of a picture is 0.01/1.01. Over 200 tallies the interval
    /// holds it 95 % of the time: binomial standard deviation 1.5 %, four of them.
    #[test]
    fn noise_is_that_of_one_picture_and_lies_in_its_interval() {
        let reference = Reference::new(&flat(1.0), outcome(1, |_| 1.0, 0.01).replicates);
        let truth = (0.01f64 / 1.01).sqrt();
        let held = (0..200).filter(|&seed| {
            let [_, low, high] = tally(&reference, 3, seed + 7, |_| 1.0, 0.2).noise();
            (low..=high).contains(&truth)
        });
        let held = held.count();
        assert!((178..=200).contains(&held), "{held}");
    }

    /// Without bias the figure over its error is about 0 with a standard deviation of one, or less, as the larger of two
    /// estimates of the error is taken. A fifth more light in a block of 9 pixels of 576 adds 0.04/1.01/64 (all weights are those of a light of 1).
    #[test]
    fn bias_is_found_where_it_is_and_nowhere_else() {
        let reference = Reference::new(&flat(1.0), outcome(1, |_| 1.0, 0.05).replicates);
        let of =
            |seed: u64, light: &dyn Fn(usize) -> f64| tally(&reference, 2, seed, light, 0.2).bias_squared(&reference);
        let scores: Moments = (0..300).map(|s| of(s, &|_| 1.0)).map(|f| f.value / f.error).collect();
        // The reference is the same for all: its own noise, a sixteenth of theirs here, shows in all alike.
        assert!(scores.mean.abs() < 0.5, "{scores:?}");
        assert!((0.6..1.1).contains(&scores.variance().sqrt()), "{scores:?}");
        let block = |i: usize| if i / 24 < 3 && i % 24 < 3 { 1.2 } else { 1.0 };
        let found: Moments = (0..100).map(|s| of(s, &block).value).collect();
        let expected = 0.04 / 1.01 / 64.0;
        assert!((found.mean - expected).abs() < 4.0 * found.standard_error() + 0.1 * expected, "{found:?} {expected}");
    }

    /// Noise that all pixels share, that those of each cell do, or none: without bias three standard errors are passed as rarely as of a
    /// normal number, 1.35 times in 1000, and at most three times as often, since four replicates tell how much is shared. Of 3000 that
    /// is 12, with a standard deviation of √12; with errors as of normal numbers it was 435, 161 and 5.
    #[test]
    fn a_bias_that_is_none_seldom_stands_out_however_much_is_shared() {
        const RUNS: u64 = 3000;
        let pixel = |cell: u64, seed: u64| -> Replicates {
            std::array::from_fn(|r| [1.0 + 0.1 * noise(seed, cell * REPLICATES as u64 + r as u64); 3])
        };
        let reference = Reference::new(&flat(1.0), vec![Some([[1.0; 3]; REPLICATES]); (SIDE * SIDE) as usize]);
        for side in [24, 8, 1] {
            let passed = (0..RUNS).filter(|&seed| {
                let cell = |i: u64| i / 24 / side * 24 + i % 24 / side;
                let replicates = (0..u64::from(SIDE * SIDE)).map(|i| Some(pixel(cell(i), seed))).collect();
                let tally = Tally { replicates, passes: vec![Vec::new()], ..Tally::default() };
                let Figure { value, error } = tally.bias_squared(&reference);
                value > SIGNIFICANT * error
            });
            let passed = passed.count();
            assert!(passed <= 12 + 3 * 3, "{passed} where {side} x {side} pixels share");
        }
    }

    /// Two rounds of which one has twice the noise in all four blocks, 4 and 8 in all: their mean varies by 8/2, by blocks alone by 4 · ½/2.
    #[test]
    fn what_blocks_share_counts_for_the_error_of_the_noise() {
        let round = |noise: f64| vec![Pass { samples: 4, seconds: 1.0, noise: vec![noise; 4], converged: true }];
        let tally = Tally { passes: vec![round(1.0), round(2.0)], ..Tally::default() };
        let Figure { value, error } = tally.noise_squared();
        assert_eq!((value, error), (6.0, 2.0));
    }

    #[test]
    fn no_cell_lies_in_two_blocks_where_blocks_are_many() {
        let of = |window: Window| {
            let pixels = window.pixels();
            let plane = || vec![1.0; pixels];
            let image = Image {
                window,
                rgb: [plane(), plane(), plane()],
                standard_error: [plane(), plane(), plane()],
                ..flat(1.0)
            };
            Reference::new(&image, vec![None; pixels])
        };
        for window in [Window::full(48, 48), Window { x: -4, y: -3, width: 56, height: 54 }] {
            let reference = of(window);
            let (block, count) = reference.blocks(FEWEST_BLOCKS);
            assert!(count >= 16, "{count}");
            let mut cells = std::collections::BTreeMap::new();
            for (i, [x, y]) in window.iter().enumerate() {
                assert!(block(i) < count);
                assert_eq!(*cells.entry([x.div_euclid(8), y.div_euclid(8)]).or_insert(block(i)), block(i));
            }
        }
        // 3 x 3 cells: too few to tell how they differ.
        assert_eq!(of(Window::full(24, 24)).blocks(FEWEST_BLOCKS).1, 64);
    }

    #[test]
    fn light_is_a_ratio_with_both_errors() {
        let reference = Reference::new(&flat(1.0), outcome(1, |_| 1.0, 0.05).replicates);
        let [red, ..] = tally(&reference, 2, 5, |_| 1.5, 0.2).light(&reference);
        assert!((red.value - 1.5).abs() < 4.0 * red.error && red.error < 0.02, "{red:?}");
    }

    /// -1/2 is half as much again above -1 as -3/2 is below it.
    #[test]
    fn more_than_what_is_below_zero_is_above_one() {
        let reference = Reference::new(&flat(1.0), outcome(1, |_| -1.0, 0.05).replicates);
        for (own, expected) in [(-0.5, 1.5), (-1.5, 0.5), (0.0, 2.0)] {
            let [.., blue] = tally(&reference, 2, 5, |_| own, 0.2).light(&reference);
            assert!((blue.value - expected).abs() < 4.0 * blue.error && (0.0..0.02).contains(&blue.error), "{blue:?}");
        }
    }
}
