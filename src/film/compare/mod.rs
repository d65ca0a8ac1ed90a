//! Whether two pictures show the same scene: figures for people, tests for the verdict.
//!
//! Figures (error measures) hardly move for a bias of a per cent that hides in noise. Tests ask whether
//! the difference is more than the noise explains:
//!
//! - **global**: per channel, the sum of all differences over its standard error, by Student's t with Welch's degrees
//!   of freedom; the smallest p times the number of channels (Bonferroni), since the channels of a picture share
//!   their paths. Sees a bias of 1 % that the next test misses.
//! - **per pixel**: the test of Mitsuba 3 (`src/render/tests/test_renders.py`): each pixel at a level that the Šidák
//!   correction derives from [`PIXEL_ALPHA`], passed by [`ACCEPT_FRACTION`] of all. Sees local faults. Variances by
//!   standard errors are no less here than the mean of those of the 5 × 5 pixels around, as four replicates may agree by chance.
//!   In small pictures that share is less than one value: as many pixels may fail there as do by chance, and one.
//!
//! The noise is known from `stderr.*` channels (standard errors of the means, from four replicates: three degrees of
//! freedom a pixel, or one less than the samples), from a file of variances per sample (as Mitsuba's references come
//! with), or else from the differences themselves: where both pictures are right, E(Σd²) = Σvar(d), so Σd/√Σd² is a
//! standard score. That form tests the mean only, and has the say where single pixels lack a standard error, or all of a
//! picture do, which has one sample of each. A picture in half floats carries the variance of its rounding besides.
//!
//! Both tests want pixels that are independent: a box filter, or filters by importance sampling. Light that is dealt to all
//! pixels which a filter covers is not; a file says by how much more the sum of its pixels varies ([`crate::film::exr::SHARED_ERRORS`]).

mod channels;
mod noise;
mod table;

use crate::film::exr::{ExrFile, Samples};
use crate::math::statistics::normal_two_sided_p;
use channels::{are_colours, not_compared, pairs};
use noise::Pair;
use std::collections::BTreeSet;

/// The global test calls a picture different below this p: one comparison of equals in a thousand.
pub const GLOBAL_ALPHA: f64 = 1e-3;
/// The family level of the per-pixel test.
pub const PIXEL_ALPHA: f64 = 0.01;
/// The share of pixel values that must pass the per-pixel test.
pub const ACCEPT_FRACTION: f64 = 0.9975;
/// Mitsuba's floor for the variance of a sample.
pub const VARIANCE_FLOOR: f64 = 1e-4;

/// What is known besides the two pictures.
#[derive(Clone, Copy, Debug, Default)]
pub struct CompareOptions<'a> {
    /// Variances of one sample of each value, in the channels of the pictures, and the samples a pixel of A. B is then
    /// the reference and taken as exact, and the per-pixel test is Mitsuba's own: in XYZ, with its floor.
    pub sample_variance: Option<(&'a ExrFile, u32)>,
    /// A relative difference of the means that is no fault: 0.004 where a reference has noise of its own that
    /// nobody wrote down, else 0.
    pub mean_tolerance: f64,
    /// What to do where the windows have one size and different places.
    pub origin: Origin,
}

/// Whether the place of a window matters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Origin {
    /// Windows must agree.
    #[default]
    MustAgree,
    /// Only their sizes must: Mitsuba writes crops without their offset.
    Ignore,
}

/// What the comparison comes to; the exit code of `abbe compare` is 0, 1, 2 in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No test sees a difference.
    Same,
    /// A test does, or there are values that are not finite.
    Different,
    /// The pictures are of different things, or of too few pixels to tell.
    CannotCompare,
}

impl Verdict {
    /// 0, 1 or 2.
    #[must_use]
    pub fn exit_code(self) -> i32 {
        match self {
            Verdict::Same => 0,
            Verdict::Different => 1,
            Verdict::CannotCompare => 2,
        }
    }
}

/// Where the noise is known from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseSource {
    /// `stderr.*` channels of both pictures.
    StandardErrors,
    /// `stderr.*` channels of one picture; the other is taken as exact.
    OneStandardError,
    /// A file of variances per sample.
    SampleVariance,
    /// The differences themselves.
    Differences,
}

/// The figures of one channel; B is the reference. Figures are of the pixels that are finite in both pictures.
/// In JSON a figure that is not finite becomes `null`.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ChannelFigures {
    /// Its name.
    pub name: String,
    /// Where its noise is known from.
    pub noise: NoiseSource,
    /// Mean of A.
    pub mean_a: f64,
    /// Mean of B.
    pub mean_b: f64,
    /// Mean of A over mean of B.
    pub mean_ratio: f64,
    /// Standard error of the ratio (first order).
    pub mean_ratio_error: f64,
    /// Σ(a − b) in standard errors.
    pub global_z: f64,
    /// Degrees of freedom of that standard error; infinite where its source is taken as exact.
    pub global_dof: f64,
    /// Two-sided p of it.
    pub global_p: f64,
    /// √ mean (a − b)².
    pub rmse: f64,
    /// Mean of (a − b)² / (b² + 0.01·m²), m the mean of B over the colours, of any other channel over it alone.
    pub rel_mse: f64,
    /// Mean of |a − b| / (|a| + |b| + 0.01·|m|).
    pub smape: f64,
    /// Largest |a − b|.
    pub max_difference: f64,
    /// Values of A that are NaN.
    pub nan_a: usize,
    /// Values of A that are infinite.
    pub infinite_a: usize,
    /// Values of B that are NaN.
    pub nan_b: usize,
    /// Values of B that are infinite.
    pub infinite_b: usize,
}

/// The per-pixel test.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PixelTest {
    /// Level of one pixel.
    pub alpha: f64,
    /// Share of values that pass.
    pub accepted: f64,
    /// Pixels in which a value fails.
    pub pixels_rejected: usize,
    /// Pixels that may, whatever their share: more do by chance in one comparison of equals in a thousand.
    pub pixels_allowed: usize,
    /// Mean of the scores: near 0 if nothing is biased.
    pub score_mean: f64,
    /// Standard deviation of the scores: 1 for normal ones; with 3 + 3 degrees of freedom about √(6/4) = 1.2.
    pub score_deviation: f64,
}

/// All that is known about the difference of two pictures.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// The outcome.
    pub verdict: Verdict,
    /// One sentence that says why.
    pub reason: String,
    /// Whether all compared values are equal bit for bit.
    pub identical: bool,
    /// Where the noise is known from; none where nothing could be compared, or channels differ in that.
    pub noise: Option<NoiseSource>,
    /// The figures of each compared channel.
    pub channels: Vec<ChannelFigures>,
    /// The smallest global p times the number of channels, at most 1.
    pub global_p: f64,
    /// The per-pixel test, where variances are known.
    pub pixel_test: Option<PixelTest>,
    /// Pixels that were compared: those finite in every channel of both pictures.
    pub pixels: usize,
    /// Of these, pixels that lack a standard error where others have one.
    pub pixels_without_error: usize,
    /// Channels of either file that were not looked at.
    pub not_compared: Vec<String>,
}

/// Compares two files; `b` is the reference.
///
/// Compared are the spectral bands (`S0.…nm`, `T.…nm`) of a file that has any, else R, G, B, else X, Y, Z, else Y, else all
/// channels without alpha and what tells of samples, such as `stderr.*`; of data, and where bands stand in place of colours, all
/// channels without the latter, whatever they are called; in whichever parts they are that have the window of the first. These
/// must be the same in both files.
#[must_use]
pub fn compare(a: &ExrFile, b: &ExrFile, options: &CompareOptions) -> Comparison {
    let pairs = match pairs(a, b, options) {
        Ok(pairs) => pairs,
        Err(reason) => return cannot_compare(reason),
    };
    let count = a.parts[0].window.pixels();
    let finite: Vec<bool> = (0..count).map(|i| pairs.iter().all(|pair| pair.is_finite(i))).collect();
    let pixels = finite.iter().filter(|&&f| f).count();
    // Colours have one unit. Bands of other widths and a depth beside them have nothing to do with each other's.
    let is_colour = |pair: &Pair| ["R", "G", "B", "X", "Y", "Z"].contains(&pair.name.as_str());
    let are_colours = are_colours([a, b]) && pairs.iter().all(is_colour);
    let mean_of = |pair: &Pair| kept(pair.b, &finite).sum::<f64>() / pixels.max(1) as f64;
    let mean_of_all = pairs.iter().map(mean_of).sum::<f64>() / pairs.len() as f64;
    let figures = |pair: &Pair| pair.figures(&finite, if are_colours { mean_of_all } else { mean_of(pair) });
    let channels: Vec<ChannelFigures> = pairs.iter().map(figures).collect();
    let smallest = channels.iter().map(|c| c.global_p).fold(1.0, f64::min);
    let global_p = (smallest * channels.len() as f64).min(1.0);
    let source = channels[0].noise;
    let pixel_test = noise::pixel_test(&pairs, &finite);
    let identical = pairs.iter().all(|pair| pair.is_identical());
    let lacks_error = |&i: &usize| finite[i] && pairs.iter().any(|pair| pair.lacks_error(i));
    let names: Vec<&str> = pairs.iter().map(|pair| pair.name.as_str()).collect();

    let mut comparison = Comparison {
        verdict: Verdict::Same,
        reason: String::new(),
        identical,
        noise: channels.iter().all(|channel| channel.noise == source).then_some(source),
        channels,
        global_p,
        pixel_test,
        pixels,
        pixels_without_error: (0..count).filter(lacks_error).count(),
        not_compared: BTreeSet::from_iter(not_compared(a, &names).chain(not_compared(b, &names))).into_iter().collect(),
    };
    (comparison.verdict, comparison.reason) = judge(&comparison, count, options);
    comparison
}

fn judge(c: &Comparison, count: usize, options: &CompareOptions) -> (Verdict, String) {
    if c.pixels < count {
        let bad = count - c.pixels;
        return (Verdict::Different, format!("{bad} of {count} pixels hold values that are not finite"));
    }
    if c.identical {
        return (Verdict::Same, "all compared values are identical".to_string());
    }
    let level = GLOBAL_ALPHA / c.channels.len() as f64;
    // A ratio that is not a number (reference black) is beyond any tolerance.
    let is_within = |channel: &ChannelFigures| {
        channel.max_difference == 0.0 || (channel.mean_ratio - 1.0).abs() <= options.mean_tolerance
    };
    let biased = c.channels.iter().find(|channel| channel.global_p < level && !is_within(channel));
    if let Some(channel) = biased {
        let reason = format!(
            "the mean of {} differs: ratio {:.5} ± {:.5}, z {:.1}",
            channel.name, channel.mean_ratio, channel.mean_ratio_error, channel.global_z
        );
        return (Verdict::Different, reason);
    }
    match &c.pixel_test {
        Some(test) if test.accepted < ACCEPT_FRACTION && test.pixels_rejected > test.pixels_allowed => {
            let share = 100.0 * test.accepted;
            (Verdict::Different, format!("only {share:.2} % of the pixel values agree within their noise"))
        }
        Some(test) => {
            let untested = match c.pixels_without_error {
                0 => String::new(),
                n => format!(" ({n} pixels without a standard error: not tested singly)"),
            };
            let beyond = match test.pixels_rejected {
                n if n <= test.pixels_allowed => String::new(),
                n => format!(
                    " but for {n} pixels: {:.2} % of the values may differ by more",
                    100.0 * (1.0 - ACCEPT_FRACTION)
                ),
            };
            (Verdict::Same, format!("means and pixels agree within their noise{beyond}{untested}"))
        }
        // Of n differences Σd/√Σd² is √n at the most, whatever they are.
        None if normal_two_sided_p((c.pixels as f64).sqrt()) >= level && !c.channels.iter().all(is_within) => {
            let few = format!("{} pixels are too few to judge by their differences alone", c.pixels);
            (Verdict::CannotCompare, few + "; output.exr.stderr writes standard errors")
        }
        None => (Verdict::Same, "means agree within the noise (no variances: single pixels not tested)".to_string()),
    }
}

fn cannot_compare(reason: String) -> Comparison {
    Comparison {
        verdict: Verdict::CannotCompare,
        reason,
        identical: false,
        noise: None,
        channels: Vec::new(),
        global_p: f64::NAN,
        pixel_test: None,
        pixels: 0,
        pixels_without_error: 0,
        not_compared: Vec::new(),
    }
}

/// The values of the pixels that are kept.
fn kept<'a>(samples: Samples<'a>, finite: &'a [bool]) -> impl Iterator<Item = f64> + 'a {
    samples.iter().zip(finite).filter(|(_, keep)| **keep).map(|(v, _)| v)
}

#[cfg(test)]
pub(super) mod tests;
