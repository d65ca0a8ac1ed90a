//! How far a picture is from the truth, told from its own replicates.
//!
//! The error of a picture x of truth μ is √relMSE, with
//!
//! ```text
//! relMSE = mean over pixels and channels of (x − μ)² / (μ² + f),   f = 0.01 · (mean of all values)²
//! ```
//!
//! so that a factor on all light changes nothing, and black pixels count by a tenth of the mean instead of by nothing.
//!
//! **Its size.** The variance v of a pixel comes from the spread of R = 4 replicates. Dividing it by x² + f instead of
//! μ² + f is biased, as x is noisy and moves with v. With g(x) = 1 / (x² + f) and to second order
//!
//! ```text
//! E[v g(x)] = σ² g(μ) + ½ g″(μ) σ⁴ + g′(μ) κ₃
//! ```
//!
//! where κ₃ is the third cumulant of x; both further terms are taken off, with σ⁴ and κ₃ from the replicates.
//!
//! **Its interval** is of the error of this very picture, not of the mean over all pictures that might have been. With
//! e = x − μ of covariance Σ over a block of pixels and their channels, W the weights g, and S the covariance from the
//! replicates,
//!
//! ```text
//! Var(tr WS − eᵀWe) = (2 / (R − 1) + 2) tr(WΣ)² = 8/3 tr(WΣ)²
//! ```
//!
//! for any distribution of the samples: fourth cumulants enter both terms and their covariance alike, and cancel. The
//! trace is that of single pixels, from S as for normal noise, A = tr(WS)² and B = (tr WS)², (A − B/3) · 9/10, which heavier
//! tails make larger; times the square of what the second order makes of the size of the pixel, since W is of the noisy
//! mean: bright is noisy, and weighs little, so that S and W together tell too little. And what neighbours share (one path
//! from a light touches several pixels, collected photons many): two differences of replicates that have nothing in common, u = x₁ − x₂ and
//! v = x₃ − x₄, have E (uᵀWv)² = 4R² tr(WΣ)², so that (Σ uᵀWv)² − Σ (uᵀWv)² over the pixels of a block, in the mean over the
//! three ways to pair four, is that of different pixels. Of light that is dealt to all pixels under a filter it is known what they
//! share, and pairs of them may lie in two blocks: it is that at the least. The next order of the size, about four times the square of
//! what the second takes off, is allowed for. Where all pixels of a sample share their wavelengths, two blocks share as well: the pairs
//! of the whole picture are then looked at besides, and it is the more of both.
//!
//! The ends are where the logarithm of tr WS / eᵀWe has them. That is as F of 3k and k degrees of freedom, k = (tr WΣ)² / tr(WΣ)²
//! (Satterthwaite 1946), so its variance is 8/3k (1 + 5/6k + …); and (tr WS)² is 2/3 tr(WΣ)² more than (tr WΣ)² in the mean,
//! so that 1/k is 1 + 2/3k times what they say: 1 + 3/2k in all. The quantile is Student's, for that variance is told by
//! blocks: what each adds to the logarithm of tr(WΣ)² / (tr WS)² is ψ, its variance is Σ ψ² at the most, and one of ν
//! degrees of freedom has 2/ν. Of a few cells that share all they find these are few.
//!
//! **Where it is unknown.** What is taken off can be more than there is, where light is so rare that its pixels have it in
//! half of the replicates: the sum then says nothing of the error, least of all that there is none. And single wavelengths outside the
//! gamut have channels of either sign, of which sums may leave next to nothing to divide their noise by; of light that is nowhere less
//! than nothing a pixel has q between -1/6, by (X, X, 0, 0), and 3, by (X, 0, 0, 0). Where pixels below nothing or above that make more
//! than all others have, the sum is unknown, too; but where they are few, one in a hundred at the most, and make or take more than half
//! of it, they are left out, and the picture has not converged. Replicates that agree everywhere show that there is no noise only
//! where they agree on light: a black pixel may be one whose light nobody has met.

mod sums;
mod values;

pub use values::Values;

use super::accumulate::Film;
use super::resolve::{HALF, Image, Splats, counts, in_halves};
use crate::math::statistics::student_t_half_width;
use rayon::prelude::*;
use std::fmt;
use std::sync::LazyLock;
use sums::{Sums, Told};
use values::Measured;

/// The error of a whole picture with its interval.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ErrorEstimate {
    /// √relMSE.
    pub rel_rmse: f64,
    /// Lower end of the 95 % interval of the picture's own √relMSE.
    pub low: f64,
    /// Upper end of the 95 % interval of the picture's own √relMSE.
    pub high: f64,
    /// Pixels that took part: those with all replicates.
    pub pixels: u64,
    /// Whether the interval can be believed; where it is false the picture has not converged. False where so few pixels
    /// carry the error that fewer than [`EFFECTIVE_PIXELS`] equally noisy ones would scatter as much, or where most of
    /// it comes from single replicates ([`HEAVY_SHARE`]): rare paths that carry much light, of which others are yet to come; or
    /// where pixels are so noisy that what they are divided by is not known ([`FURTHER_SHARE`], [`FURTHER_OF_PIXELS`],
    /// [`CROSSED_SHARE`]). False as well of 5 to 7 samples a pixel, of which some replicates have two and some one: evenly
    /// spread ones differ by more than twice then.
    pub valid: bool,
}

impl ErrorEstimate {
    /// Of a picture of so many pixels that is right for sure.
    #[must_use]
    pub fn none(pixels: u64) -> ErrorEstimate {
        ErrorEstimate { rel_rmse: 0.0, low: 0.0, high: 0.0, pixels, valid: true }
    }

    /// The variance of ln relMSE as an estimate of what is to be expected. A quarter of that which the interval allows for: the
    /// rest is how far this picture's own error is from there.
    #[must_use]
    pub fn log_variance(&self) -> f64 {
        let half = 2.0 * libm::log(self.high / self.rel_rmse);
        (0.5 * half / *FEW_HALF_WIDTH).powi(2)
    }
}

/// See [`ErrorEstimate::valid`]: 30 is where the central limit is commonly trusted.
pub const EFFECTIVE_PIXELS: f64 = 30.0;

/// Half the width of an interval told by [`EFFECTIVE_PIXELS`] degrees of freedom: it takes as long as the sums of a thousand pixels.
static FEW_HALF_WIDTH: LazyLock<f64> = LazyLock::new(|| student_t_half_width(0.95, EFFECTIVE_PIXELS));

/// See [`ErrorEstimate::valid`]: half of the error in pixels of which one replicate has more than [`ONE_REPLICATE`] of the
/// spread. Of normal noise 14 % is; of events that come 0.1 times a replicate 82 %, 0.3 times 56 %, once 23 %.
pub const HEAVY_SHARE: f64 = 0.5;

/// See [`HEAVY_SHARE`]. One outlier among four has 3/4.
pub const ONE_REPLICATE: f64 = 0.7;

/// See [`ErrorEstimate::valid`]: what the second order takes off or adds, at most, for the series to be believed.
pub const FURTHER_SHARE: f64 = 0.1;

/// See [`ErrorEstimate::valid`]: the same, of either sign in every pixel, all of them added up.
pub const FURTHER_OF_PIXELS: f64 = 0.25;

/// See [`ErrorEstimate::valid`]: how far the size may be from what it is with variances divided by values of other
/// replicates. A bright path makes a pixel brighter and noisier at once, so that it looks like little by its own value; by
/// those of the replicates without it it does not.
pub const CROSSED_SHARE: f64 = 0.1;

/// The next order in units of the square of what the second takes off, which is what the interval allows for.
const NEXT_ORDER: f64 = 4.0;

/// The most that an end of the interval may be away, as a logarithm, so that both are numbers whatever is taken off.
const WIDEST: f64 = 100.0;

/// About as many blocks are looked at for what neighbours share.
const BLOCKS: usize = 64;

/// Why there is no error estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum NoEstimate {
    /// No pixel has samples in all replicates.
    FewReplicates,
    /// Fewer than two pixels have an estimate, so it has no interval.
    OnePixel,
    /// Every pixel is black: a relative error has nothing to relate to.
    Black,
    /// Pixels are so noisy that what they are divided by takes off more than there is.
    Noisy,
    /// Values are more than 32-bit floats hold.
    Overflow,
    /// Nothing differs between replicates, and some pixels are black: without noise, or of light that was not met.
    Unmet,
}

impl fmt::Display for NoEstimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NoEstimate::FewReplicates => "no pixel has four samples, one of each replicate",
            NoEstimate::OnePixel => "fewer than two pixels have samples",
            NoEstimate::Black => "the picture is black",
            NoEstimate::Noisy => "too many pixels are too noisy to tell how bright they are",
            NoEstimate::Overflow => "values are more than 32-bit floats hold",
            NoEstimate::Unmet => "no pixel is noisy, but those that are black may have light that was not met",
        })
    }
}

/// The three ways to make two pairs of four.
pub const PAIRINGS: [[usize; 4]; 3] = [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2]];

/// What is added to the square of a value that an error is divided by: f, a hundredth of the square of the mean of all.
#[must_use]
pub fn floor(image: &Image) -> f64 {
    floor_of(image.rgb.iter().flatten().copied(), 3 * image.window.pixels())
}

/// f of `count` values.
fn floor_of(values: impl Iterator<Item = f32>, count: usize) -> f64 {
    floor_about(values.map(f64::from).sum::<f64>() / count.max(1) as f64)
}

/// f where the mean of all values is `mean`.
#[must_use]
pub fn floor_about(mean: f64) -> f64 {
    0.01 * mean * mean
}

/// How noisy the picture is that `film` and `splats` hold, in `values`; on the current rayon pool. What is splatted has
/// `overlap` ([`Filter::overlap`](super::filter::Filter::overlap)) with its neighbours; pixels of each cell of so many on a side,
/// aligned to the frame, may share what they find, or each with every other where there are no cells.
///
/// # Errors
/// Why there is nothing to say.
pub fn relative_error(
    film: &Film,
    splats: Option<Splats>,
    values: Values,
    overlap: f64,
    cell: Option<u32>,
) -> Result<ErrorEstimate, NoEstimate> {
    let measured = Measured::new(film, splats, values, overlap > 1.0);
    let everywhere = cell.is_none();
    let told = blocks(&measured, cell.unwrap_or(1));
    let mut whole = Told::default();
    told.iter().for_each(|block| whole.join(block));
    let spoiled = whole.is_spoiled_by_few();
    let all = whole.sums(spoiled);
    let blocks: Vec<Sums> = told.iter().map(|block| block.sums(spoiled)).collect();
    // tr(WΣ)² of different pixels, by their pairs and by what the filter shares.
    let by_pairs =
        |sums: &Sums| (sums.pairs.iter().map(|pair| pair * pair).sum::<f64>() - sums.pair_squares) / (3.0 * 64.0);
    let by_filter = |sums: &Sums| (overlap - 1.0) * sums.splatted;
    let in_blocks = blocks.iter().map(by_pairs).sum::<f64>();
    match all.pixels {
        0 => return Err(NoEstimate::FewReplicates),
        n if n == all.black => return Err(NoEstimate::Black),
        _ if all.error.is_nan() => return Err(NoEstimate::Overflow),
        1 => return Err(NoEstimate::OnePixel),
        _ if all.noisy == 0 && all.black > 0 => return Err(NoEstimate::Unmet),
        _ if all.noisy > 0 && all.error <= 0.0 => return Err(NoEstimate::Noisy),
        _ if !spoiled && whole.is_implausible() => return Err(NoEstimate::Noisy),
        _ => {}
    }
    let n = all.pixels as f64;
    let rel_mse = all.error / n;
    let traces = |sums: &Sums| sums.own + if in_blocks > by_filter(&all) { by_pairs(sums) } else { by_filter(sums) };
    let of_blocks = all.own + in_blocks.max(by_filter(&all));
    let trace = if everywhere { of_blocks.max(all.own + by_pairs(&all)) } else { of_blocks };
    let adds = |block: &Sums| traces(block) / of_blocks - 2.0 * block.error / all.error;
    let dof = 2.0 / blocks.iter().map(|block| adds(block).powi(2)).sum::<f64>();
    let share = if all.error == 0.0 { 0.0 } else { all.further / all.error };
    let next = NEXT_ORDER * share * share * all.error;
    let variance = 8.0 / 3.0 * trace * (1.0 + 1.5 * trace / (all.error * all.error));
    // Without noise there are no degrees: 0/0.
    let half_width = if dof < EFFECTIVE_PIXELS { student_t_half_width(0.95, dof) } else { *FEW_HALF_WIDTH };
    let half = half_width * libm::hypot(variance.sqrt(), next) / n;
    // Of a sum of squares: symmetric in its logarithm, for few squares make it more skewed than a normal number.
    let stretch = if rel_mse > 0.0 { libm::exp((0.5 * half / rel_mse).min(WIDEST)) } else { 1.0 };
    let effective = if all.squares > 0.0 { all.error * all.error / all.squares } else { n };
    Ok(ErrorEstimate {
        rel_rmse: rel_mse.sqrt(),
        low: rel_mse.sqrt() / stretch,
        high: rel_mse.sqrt() * stretch,
        pixels: all.pixels,
        valid: all.error == 0.0
            || (!spoiled
                && 2 * all.uneven <= all.pixels
                && effective >= EFFECTIVE_PIXELS
                && all.heavy <= HEAVY_SHARE * all.error
                && share.abs() <= FURTHER_SHARE
                && all.further_of_pixels <= FURTHER_OF_PIXELS * all.error
                && (all.crossed - all.error).abs() <= CROSSED_SHARE * all.error),
    })
}

/// The sums of each block of whole cells of so many pixels on a side; on the current rayon pool.
fn blocks(measured: &Measured, cell: u32) -> Vec<Told> {
    let window = measured.film.window();
    // No cell lies in two blocks.
    let side = ((window.pixels() as f64 / BLOCKS as f64).sqrt() as u32 / cell * cell).max(cell);
    let before = [window.x, window.y].map(|x| x.rem_euclid(cell as i32) as u32);
    let rows = (before[1] + window.height).div_ceil(side);
    let columns = (before[0] + window.width).div_ceil(side);
    (0..rows * columns)
        .into_par_iter()
        .map(|block| {
            let mut told = Told::default();
            let mut values = Vec::new();
            let span =
                |i: u32, before: u32, size: u32| (i * side).saturating_sub(before)..((i + 1) * side - before).min(size);
            for y in span(block / columns, before[1], window.height) {
                for x in span(block % columns, before[0], window.width) {
                    let index = y as usize * window.width as usize + x as usize;
                    if measured.read(index, &mut values) {
                        let cells = &measured.film.cells()[index];
                        let counts = counts(cells);
                        let uneven = |of: &[u64]| of.iter().any(|most| of.iter().any(|least| *most >= 2 * least));
                        // Halves that were told how many samples they take weigh alike, whatever these are.
                        let is_uneven = match in_halves(cells) {
                            true => counts.chunks(HALF).any(uneven),
                            false => uneven(&counts),
                        };
                        told.add(&values, &measured.floors, measured.counted, is_uneven);
                    }
                }
            }
            told
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;
    use crate::film::accumulate::{REPLICATES, TileBuffer};
    use crate::film::resolve::resolve;
    use crate::math::sampler::uniform;
    use crate::math::statistics::Moments;

    const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// A film of `side` × `side` pixels whose samples are what `sample` makes of a pixel's number and a uniform number, the
    /// same in all channels; `count` of them in each replicate.
    fn film(seed: u64, side: u32, count: u64, sample: impl Fn(usize, f64) -> f64) -> Film {
        let window = Window::full(side, side);
        let mut tile = TileBuffer::new(window);
        let mut i = 0;
        for pixel in 0..window.pixels() {
            let place = [(pixel % side as usize) as i32, (pixel / side as usize) as i32];
            for replicate in 0..REPLICATES {
                for _ in 0..count {
                    i += 1;
                    tile.add(place, replicate, [sample(pixel, uniform(seed, i)) as f32; 3], 1.0);
                }
            }
        }
        let mut film = Film::new([side, side], window).unwrap();
        film.merge_tile(&tile);
        film
    }

    fn estimate(film: &Film) -> Result<(Image, ErrorEstimate), NoEstimate> {
        let image = resolve(film, None, &IDENTITY);
        let error = relative_error(film, None, Values::Colours(&IDENTITY, &image), 1.0, Some(1))?;
        Ok((image, error))
    }

    /// The relMSE that `image` has where the truth is `truth`.
    fn own(image: &Image, truth: impl Fn(usize) -> f64) -> f64 {
        let n = image.window.pixels();
        let mean = (0..n).map(&truth).sum::<f64>() / n as f64;
        let of = |i: usize| (f64::from(image.rgb[0][i]) - truth(i)).powi(2) / (truth(i).powi(2) + 0.01 * mean * mean);
        (0..n).map(of).sum::<f64>() / n as f64
    }

    /// Pictures of 16 × 16 pixels whose brightness and noise differ, with samples that are evenly spread, or a light
    /// that is found one time in four (skewed: a pixel that looks dark looks even, too). 400 intervals hold the error of
    /// the picture that they belong to 95 % of the time: binomial standard deviation 1.1 %, three of them. The mean of the
    /// estimates is that of the errors within four standard errors of their difference.
    #[test]
    fn the_interval_holds_the_error_of_its_own_picture_95_times_of_100() {
        let truth = |pixel: usize| 0.2 + (pixel % 16) as f64;
        let even = |pixel: usize, u: f64| truth(pixel) * (1.0 + 0.6 * (2.0 * u - 1.0));
        let skewed = |pixel: usize, u: f64| if u < 0.25 { 4.0 * truth(pixel) } else { 0.0 };
        for (name, count, skew) in [("even", 4, false), ("skewed", 64, true)] {
            let (mut covered, mut excess) = (0, Moments::default());
            for run in 0..400 {
                let seed = 1000 + run;
                let film = if skew { film(seed, 16, count, skewed) } else { film(seed, 16, count, even) };
                let (image, e) = estimate(&film).unwrap();
                let own = own(&image, truth);
                assert!(e.valid && e.pixels == 256);
                covered += u64::from(e.low <= own.sqrt() && own.sqrt() <= e.high);
                excess.push(e.rel_rmse * e.rel_rmse / own - 1.0);
            }
            let coverage = covered as f64 / 400.0;
            assert!((coverage - 0.95).abs() < 3.0 * 0.011, "{name}: coverage {coverage}");
            assert!(excess.mean.abs() < 4.0 * excess.standard_error(), "{name}: {excess:?}");
        }
    }

    /// Twice the light, twice the values and errors: the relative error has the same bits, as a factor of 2 is exact.
    #[test]
    fn the_relative_error_does_not_change_with_the_scale_of_the_light() {
        let noisy = |scale: f64| film(5, 8, 2, move |_, u| scale * (0.5 + u));
        assert_eq!(estimate(&noisy(1.0)).unwrap().1, estimate(&noisy(1024.0)).unwrap().1);
    }

    #[test]
    fn without_all_replicates_there_is_no_estimate() {
        let mut one = Film::new([8, 8], Window::full(8, 8)).unwrap();
        one.add([3, 3], 0, [1.0; 3], 1.0);
        assert_eq!(estimate(&one).unwrap_err(), NoEstimate::FewReplicates);
        assert_eq!(estimate(&film(5, 8, 2, |_, _| 0.0)).unwrap_err(), NoEstimate::Black);
        assert_eq!(estimate(&film(5, 1, 2, |_, u| u)).unwrap_err(), NoEstimate::OnePixel);
    }

    /// A film of 8 × 8 pixels with one sample in each replicate.
    fn film_of(light: impl Fn(usize, usize) -> f32) -> Film {
        let window = Window::full(8, 8);
        let mut tile = TileBuffer::new(window);
        for pixel in 0..window.pixels() {
            for replicate in 0..REPLICATES {
                tile.add([(pixel % 8) as i32, (pixel / 8) as i32], replicate, [light(pixel, replicate); 3], 1.0);
            }
        }
        let mut film = Film::new([8, 8], window).unwrap();
        film.merge_tile(&tile);
        film
    }

    /// Each pixel has light X in two of four replicates: x = X/2, v = X²/12, σ⁴ by the pairs that differ 2/3 X⁴/64 = X⁴/96 and
    /// κ₃ = 0; with f = 0.01 x² it is v g = 0.330, and ½ g″ σ⁴ = 0.483 is taken off: less than nothing is left.
    #[test]
    fn an_estimate_below_nothing_is_unknown() {
        let rare = film_of(|pixel, replicate| if (pixel + replicate) % 4 < 2 { 3.0 } else { 0.0 });
        assert_eq!(estimate(&rare).unwrap_err(), NoEstimate::Noisy);
    }

    /// Of 1024 pixels of 1 with noise of 0.1 in each replicate one has 20, -20, 1 and 1: far more is taken off it than all others have.
    /// Or it has 20, -20, 0.5 and -0.5: of these nothing is left, and their noise is divided by f alone. It is left out, and the
    /// others have 0.1² / 4 / 1.01 each, told by three degrees of freedom. One of 64 is not few.
    #[test]
    fn few_pixels_do_not_make_an_estimate_unknown() {
        let spoiled = |side: u32, values: [f64; REPLICATES]| {
            let window = Window::full(side, side);
            let mut tile = TileBuffer::new(window);
            for pixel in 0..window.pixels() {
                let place = [pixel % side as usize, pixel / side as usize].map(|x| x as i32);
                for (replicate, bright) in values.into_iter().enumerate() {
                    let noise = 12f64.sqrt() * 0.1 * (uniform(7, (4 * pixel + replicate) as u64) - 0.5);
                    let light = if pixel == 0 { bright } else { 1.0 + noise };
                    tile.add(place, replicate, [light as f32; 3], 1.0);
                }
            }
            let mut film = Film::new([side; 2], window).unwrap();
            film.merge_tile(&tile);
            estimate(&film).map(|(_, error)| error)
        };
        let expected = (0.0025 / 1.01_f64).sqrt();
        // Four standard errors of the root of a mean of 1023.
        let allowed = 4.0 * 0.5 * (2.0 / 3.0 / 1023.0_f64).sqrt();
        let (lost, cancelled) = ([20.0, -20.0, 1.0, 1.0], [20.0, -20.0, 0.5, -0.5]);
        for values in [lost, cancelled] {
            let told = spoiled(32, values).unwrap();
            assert!((told.rel_rmse / expected - 1.0).abs() < allowed, "{told:?} for {expected}");
            assert!(
                !told.valid && told.low < told.rel_rmse && told.rel_rmse < told.high && told.high < 0.1,
                "{told:?}"
            );
        }
        for values in [lost, cancelled] {
            assert_eq!(spoiled(8, values).unwrap_err(), NoEstimate::Noisy);
        }
    }

    /// The same with some light in the dark replicates, too: X/300 in place of 0 moves x by 0.3 % and v g by 1 %, and less than nothing
    /// is still left. Each sample has light, as under a filter with negative lobes: what is said must not be that light is rare.
    #[test]
    fn an_unknown_estimate_is_not_put_down_to_rare_light() {
        let lit = film_of(|pixel, replicate| if (pixel + replicate) % 4 < 2 { 3.0 } else { 0.01 });
        let said = estimate(&lit).unwrap_err();
        assert_eq!((said, said.to_string().contains("rare")), (NoEstimate::Noisy, false));
    }

    /// One value of a picture is infinite, and so is the mean that errors are relative to.
    #[test]
    fn the_error_of_what_floats_do_not_hold_is_unknown() {
        let film = film(5, 8, 2, |_, u| 0.5 + u);
        let mut image = resolve(&film, None, &IDENTITY);
        image.rgb[0][5] = f32::INFINITY;
        let error = relative_error(&film, None, Values::Colours(&IDENTITY, &image), 1.0, Some(1));
        assert_eq!(error.unwrap_err(), NoEstimate::Overflow);
    }

    /// Half of the pixels as above, the others noisy by just as much as leaves something: the interval ends at numbers, which
    /// JSON can hold.
    #[test]
    fn an_estimate_near_nothing_has_a_finite_interval() {
        let mixed = |noise: f32| {
            let light = move |pixel: usize, replicate: usize| match pixel < 32 {
                true if (pixel + replicate) % 4 < 2 => 3.0,
                true => 0.0,
                false => 1.0 + noise * replicate as f32,
            };
            estimate(&film_of(light)).map(|(_, e)| e)
        };
        let (mut none, mut some) = (0.0, 8.0);
        for _ in 0..60 {
            let middle = 0.5 * (none + some);
            *(if mixed(middle).is_ok() { &mut some } else { &mut none }) = middle;
        }
        let e = mixed(some).unwrap();
        assert!(!e.valid && e.rel_rmse < 1e-2 && e.low > 0.0 && e.high > 1e30 && e.high.is_finite(), "{e:?}");
    }

    /// Light that is the same in all replicates is without noise; if a part is black, its light may be yet to come. One
    /// pixel that differs is noise that can be told.
    #[test]
    fn no_noise_is_told_only_of_light_that_was_met() {
        let (_, even) = estimate(&film_of(|pixel, _| 1.0 + pixel as f32)).unwrap();
        assert!(even.valid && [even.rel_rmse, even.low, even.high] == [0.0; 3], "{even:?}");
        let half = film_of(|pixel, _| if pixel < 32 { 1.0 } else { 0.0 });
        assert_eq!(estimate(&half).unwrap_err(), NoEstimate::Unmet);
        let noisy = film_of(|pixel, replicate| if pixel == 5 { 1.0 + replicate as f32 } else { 1.0 });
        assert!(estimate(&noisy).unwrap().1.rel_rmse > 0.0);
    }

    /// 4, 5, 6, 7, 8 and 9 samples of each pixel.
    #[test]
    fn replicates_of_one_and_of_two_samples_tell_no_interval() {
        let valid = |samples: usize| {
            let window = Window::full(16, 16);
            let mut tile = TileBuffer::new(window);
            for (pixel, i) in (0..window.pixels()).flat_map(|pixel| (0..samples).map(move |i| (pixel, i))) {
                let x = 1.0 + 0.1 * uniform(7, (pixel * samples + i) as u64) as f32;
                tile.add([(pixel % 16) as i32, (pixel / 16) as i32], i % REPLICATES, [x; 3], 1.0);
            }
            let mut film = Film::new([16, 16], window).unwrap();
            film.merge_tile(&tile);
            estimate(&film).unwrap().1.valid
        };
        assert_eq!([4, 5, 6, 7, 8, 9].map(valid), [true, false, false, false, true, true]);
    }

    /// Halves of 8 and 16 samples a replicate weigh alike, and tell their error; replicates of one half do not.
    #[test]
    fn halves_of_other_numbers_tell_an_interval() {
        let valid = |counts: [u64; REPLICATES]| {
            let mut tile = TileBuffer::new(Window::full(16, 16));
            for (pixel, replicate) in (0..256u64).flat_map(|pixel| (0..REPLICATES).map(move |r| (pixel, r))) {
                for i in 0..counts[replicate] {
                    let x = 1.0 + 0.1 * uniform(7, (pixel * 4 + replicate as u64) * 64 + i) as f32;
                    tile.add([(pixel % 16) as i32, (pixel / 16) as i32], replicate, [x; 3], 1.0);
                }
            }
            let mut film = Film::new([16, 16], Window::full(16, 16)).unwrap();
            film.merge_tile(&tile);
            estimate(&film).unwrap().1.valid
        };
        assert!(valid([8, 8, 16, 16]) && valid([8; 4]));
        assert!(!valid([8, 16, 32, 32]) && !valid([8, 16, 8, 16]));
    }

    /// One pixel of 256 carries all of the error; or every pixel has light that comes once in 200 samples, of which it has
    /// 16: in both the picture is told to have not converged. Without noise there is nothing to doubt.
    #[test]
    fn rare_light_makes_the_interval_invalid() {
        let mut firefly = film(3, 16, 1, |_, _| 1.0);
        assert!(estimate(&firefly).unwrap().1.valid);
        firefly.add([3, 3], 2, [1e4; 3], 1.0);
        assert!(!estimate(&firefly).unwrap().1.valid);
        let rare = film(3, 32, 4, |_, u| if u < 0.005 { 200.0 } else { 1.0 });
        assert!(!estimate(&rare).unwrap().1.valid);
    }

    /// Half of the pixels have the first four values in their replicates, half the others. What the noise of divisors takes off is
    /// 6 % in the sum of the second picture, but 34 % from pixel to pixel; of the third 0.1 % and 8 %, but by values of other
    /// replicates the size is 0.64 of what it is by their own (all worked out apart).
    #[test]
    fn bright_paths_make_the_interval_invalid() {
        let valid = |levels: [[f32; REPLICATES]; 2]| {
            let light = move |pixel: usize, replicate: usize| levels[pixel % 2][(pixel / 2 + replicate) % REPLICATES];
            estimate(&film_of(light)).unwrap().1.valid
        };
        assert!(valid([[1.2, 1.2, 1.0, 1.0], [1.2, 1.0, 1.0, 0.9]]));
        assert!(!valid([[3.0, 3.0, 1.0, 1.0], [4.0, 2.0, 1.0, 1.0]]));
        assert!(!valid([[2.0, 2.0, 1.0, 1.0], [2.0, 1.0, 1.0, 0.25]]));
    }

    /// Of 64 pixels some are off by δ in one replicate, which has 3/4 of the spread, the others by ±√(3/8) δ in two, which have half
    /// of it each: δ²/16 is the variance of all, so that they share the error alike, and what the noise of divisors takes off is a
    /// thousandth of it. Where those of the first kind are more than half, the picture is told to have not converged.
    #[test]
    fn light_that_single_replicates_bring_makes_the_interval_invalid() {
        let valid = |uneven: usize| {
            let delta = 1.0f32 / 64.0;
            let even = delta * 0.375f32.sqrt();
            let light = move |pixel: usize, replicate: usize| {
                let levels = if pixel < uneven { [delta, 0.0, 0.0, 0.0] } else { [even, -even, 0.0, 0.0] };
                1.0 + levels[(pixel + replicate) % REPLICATES]
            };
            estimate(&film_of(light)).unwrap().1.valid
        };
        assert_eq!([0, 30, 34, 64].map(valid), [true, true, false, false]);
    }

    /// All 64 pixels are off by δ, δ, −δ, −δ in their four replicates. Of one the trace is (4δ²g)²/240 = δ⁴g²/15, the pairs are 0, 4δ²g and
    /// 4δ²g, and pairs of different pixels have 63 · 32 δ⁴g²/192 = 10.5 δ⁴g² a pixel: 157.5 times as much, none of it in blocks of a pixel.
    /// The logarithm of the interval goes as the root of the sum times 1 + 3/2k. A pixel's error is δ²g/3, so that k is 64 · 15/9 of
    /// pixels apart, and of all together that over 158.5.
    #[test]
    fn what_all_pixels_share_widens_the_interval() {
        let film = film_of(|_, replicate| 1.0 + if replicate < 2 { 1.0 / 64.0 } else { -1.0 / 64.0 });
        let image = resolve(&film, None, &IDENTITY);
        let of = |cell| relative_error(&film, None, Values::Colours(&IDENTITY, &image), 1.0, cell).unwrap();
        let (apart, together) = (of(Some(1)), of(None));
        assert_eq!(apart.rel_rmse, together.rel_rmse);
        let width = |e: ErrorEstimate| libm::log(e.high / e.rel_rmse);
        let ratio = (width(together) / width(apart)).powi(2);
        let k = 64.0 * 15.0 / 9.0;
        let expected = 158.5 * (1.0 + 1.5 * 158.5 / k) / (1.0 + 1.5 / k);
        assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio} for {expected}");
    }

    /// Four, nine and sixteen cells of 2 × 2 pixels that share all of their noise, which is normal but for what a sum of twelve lacks:
    /// the intervals of 2000 pictures hold their errors 95 times of 100, within three binomial standard deviations, though so few
    /// cells hardly tell how wide they should be.
    #[test]
    fn the_interval_of_a_few_cells_holds_the_error_95_times_of_100() {
        const RUNS: u64 = 2000;
        for cells in [2, 3, 4] {
            let side = 2 * cells;
            let mut held = 0;
            for run in 0..RUNS {
                let window = Window::full(side, side);
                let mut tile = TileBuffer::new(window);
                for pixel in window.iter() {
                    let [x, y] = pixel.map(|x| x as u64 / 2);
                    for replicate in 0..REPLICATES {
                        let first = 12 * ((y * u64::from(cells) + x) * REPLICATES as u64 + replicate as u64);
                        let normal = (first..first + 12).map(|i| uniform(run, i)).sum::<f64>() - 6.0;
                        tile.add(pixel, replicate, [(1.0 + 0.01 * normal) as f32; 3], 1.0);
                    }
                }
                let mut film = Film::new([side, side], window).unwrap();
                film.merge_tile(&tile);
                let image = resolve(&film, None, &IDENTITY);
                let e = relative_error(&film, None, Values::Colours(&IDENTITY, &image), 1.0, Some(2)).unwrap();
                let own = own(&image, |_| 1.0).sqrt();
                held += u64::from(e.low <= own && own <= e.high);
            }
            let share = held as f64 / RUNS as f64;
            assert!((share - 0.95).abs() < 3.0 * (0.95_f64 * 0.05 / RUNS as f64).sqrt(), "{cells}: {share}");
        }
    }

    /// Photons dealt to 7 × 7 pixels by a Gaussian of 0.8 pixels, in a picture that goes on where it ends, so that every pixel is 1 in
    /// the mean: with what the filter shares the interval holds the error of 200 pictures 95 times of 100, as above; with what
    /// blocks of 2 × 2 pixels show of it, less often.
    #[test]
    fn what_a_filter_shares_widens_the_interval() {
        const SIDE: i32 = 16;
        const PHOTONS: u64 = 500;
        let filter = crate::film::filter::Filter::Gaussian { stddev: 0.8 };
        let window = Window::full(SIDE as u32, SIDE as u32);
        let mut dark = Film::new([SIDE as u32; 2], window).unwrap();
        for pixel in 0..window.pixels() as i32 {
            (0..REPLICATES).for_each(|r| dark.add([pixel % SIDE, pixel / SIDE], r, [0.0; 3], 1.0));
        }
        let (mut held, mut alone) = (0, 0);
        for run in 0..200 {
            let mut film = Film::new([SIDE as u32; 2], window).unwrap();
            for i in 0..PHOTONS * REPLICATES as u64 {
                let at = [0, 1].map(|axis| f64::from(SIDE) * uniform(run, 2 * i + axis));
                let weights =
                    at.map(|x| [-3, -2, -1, 0, 1, 2, 3].map(|k| filter.eval(x.floor() + f64::from(k) + 0.5 - x)));
                let sum: f64 = weights.map(|w| w.iter().sum::<f64>()).iter().product();
                for (pixel, k) in (0..49).map(|k| ([k % 7, k / 7], k as usize)) {
                    let place = [0, 1].map(|axis| (at[axis].floor() as i32 + pixel[axis] - 3).rem_euclid(SIDE));
                    let light = f64::from(SIDE * SIDE) * weights[0][k % 7] * weights[1][k / 7] / sum;
                    film.add(place, (i % 4) as usize, [light as f32; 3], 1.0);
                }
            }
            let splats = Splats { film: &film, photons: [PHOTONS; REPLICATES] };
            let image = resolve(&dark, Some(splats), &IDENTITY);
            let own = own(&image, |_| 1.0).sqrt();
            let holds = |overlap| {
                let e =
                    relative_error(&dark, Some(splats), Values::Colours(&IDENTITY, &image), overlap, Some(1)).unwrap();
                u64::from(e.low <= own && own <= e.high)
            };
            held += holds(filter.overlap());
            alone += holds(1.0);
        }
        let scatter = 3.0 * (0.95_f64 * 0.05 / 200.0).sqrt();
        assert!((held as f64 / 200.0 - 0.95).abs() < scatter, "{held} of 200");
        assert!((alone as f64) < 200.0 * (0.95 - scatter), "{alone} of 200");
    }
}
