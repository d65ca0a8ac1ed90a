//! Whether two pictures show the same scene: figures for people, tests for the verdict.
//!
//! Figures (error measures) hardly move for a bias of a per cent that hides in noise. Tests ask whether
//! the difference is more than the noise explains:
//!
//! - **global**: per channel, the sum of all differences over its standard error, by Student's t with Welch's degrees
//!   of freedom; the smallest p times the number of channels (Bonferroni), since the channels of a picture share
//!   their paths. Sees a bias of 1 % that the next test misses.
//! - **per pixel**: the test of Mitsuba 3 (`src/render/tests/test_renders.py`): each pixel at a level that the Šidák
//!   correction derives from [`PIXEL_ALPHA`], passed by [`ACCEPT_FRACTION`] of all. Sees local faults. Variances of fewer than
//!   16 samples are no less here than the mean of those of the 5 × 5 pixels around. In small pictures that share is less than one
//!   value: as many pixels may fail there as do by chance, and one.
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

use crate::film::exr::{ExrFile, Samples};
use channels::{not_compared, pairs};
use noise::Pair;
use std::collections::BTreeSet;
use std::fmt::Write as _;

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
    /// The pictures are of different things.
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

impl NoiseSource {
    /// The source in words.
    fn words(self) -> &'static str {
        match self {
            NoiseSource::StandardErrors => "the standard errors of both",
            NoiseSource::OneStandardError => "the standard errors of one; the other is taken as exact",
            NoiseSource::SampleVariance => "the variance file; B is taken as exact",
            NoiseSource::Differences => "the differences themselves",
        }
    }
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
/// channels without alpha and what tells of samples, such as `stderr.*`; in whichever parts they are that have the window of the
/// first. These must be the same in both files.
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
    let are_colours = pairs.iter().all(|pair| ["R", "G", "B", "X", "Y", "Z"].contains(&pair.name.as_str()));
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
    let biased = c.channels.iter().find(|channel| {
        // A ratio that is not a number (reference black) is beyond any tolerance.
        let within = (channel.mean_ratio - 1.0).abs() <= options.mean_tolerance;
        channel.global_p < level && !within
    });
    if let Some(channel) = biased {
        let reason = format!(
            "the mean of {} differs: ratio {:.5} ± {:.5}, {:.1} standard errors",
            channel.name, channel.mean_ratio, channel.mean_ratio_error, channel.global_z
        );
        return (Verdict::Different, reason);
    }
    match &c.pixel_test {
        Some(test) if test.accepted < ACCEPT_FRACTION && test.pixels_rejected > test.pixels_allowed => {
            let share = 100.0 * test.accepted;
            (Verdict::Different, format!("only {share:.2} % of the pixel values agree within their noise"))
        }
        Some(_) => {
            let untested = match c.pixels_without_error {
                0 => String::new(),
                n => format!(" ({n} pixels without a standard error: not tested singly)"),
            };
            (Verdict::Same, format!("means and pixels agree within their noise{untested}"))
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

impl Comparison {
    /// The comparison as a table for people.
    #[must_use]
    pub fn table(&self) -> String {
        let mut out = String::new();
        // Writing to a string cannot fail.
        let mut line = |text: String| {
            let _ = writeln!(out, "{}", text.trim_end());
        };
        if !self.channels.is_empty() {
            line(format!(
                "{:<14}{:>10} ± {:<9}{:>9}{:>10}{:>11}{:>11}{:>11}{:>11}",
                "channel", "ratio", "s.e.", "z", "p", "RMSE", "relMSE", "SMAPE", "max |d|"
            ));
            for c in &self.channels {
                line(format!(
                    "{:<14}{:>10.6} ± {:<9.6}{:>9.2}{:>10.2e}{:>11.3e}{:>11.3e}{:>11.3e}{:>11.3e}",
                    c.name,
                    c.mean_ratio,
                    c.mean_ratio_error,
                    c.global_z,
                    c.global_p,
                    c.rmse,
                    c.rel_mse,
                    c.smape,
                    c.max_difference
                ));
            }
            line(format!("global p, all channels   {:.3e} (different below {GLOBAL_ALPHA:.0e})", self.global_p));
            if let Some(test) = &self.pixel_test {
                line(format!(
                    "pixel values that agree  {:.3} % (different below {} %), {} pixels rejected at {:.1e} (different above {})",
                    100.0 * test.accepted,
                    100.0 * ACCEPT_FRACTION,
                    test.pixels_rejected,
                    test.alpha,
                    test.pixels_allowed
                ));
                let (mean, deviation) = (test.score_mean, test.score_deviation);
                line(format!("pixel scores             mean {mean:.3}, deviation {deviation:.3}"));
            }
            let sum = |f: fn(&ChannelFigures) -> usize| self.channels.iter().map(f).sum::<usize>();
            line(format!(
                "not finite               A: {} NaN, {} inf; B: {} NaN, {} inf",
                sum(|c| c.nan_a),
                sum(|c| c.infinite_a),
                sum(|c| c.nan_b),
                sum(|c| c.infinite_b)
            ));
            if self.pixels_without_error > 0 {
                let n = self.pixels_without_error;
                line(format!("without a standard error {n} pixels: judged together, by their differences"));
            }
            if !self.not_compared.is_empty() {
                let layer =
                    |name: &String| name.rsplit_once('.').map_or(name.clone(), |(layer, _)| format!("{layer}.*"));
                let mut layers: Vec<String> = self.not_compared.iter().map(layer).collect();
                layers.dedup();
                line(format!("not compared             {}", layers.join(", ")));
            }
            line(format!("noise known from         {}", self.sources()));
        }
        let verdict = match self.verdict {
            Verdict::Same => "same",
            Verdict::Different => "different",
            Verdict::CannotCompare => "cannot compare",
        };
        line(format!("verdict: {verdict}: {}", self.reason));
        out
    }

    /// Where the noise is known from, with the names of the channels where these differ in that.
    fn sources(&self) -> String {
        if let Some(source) = self.noise {
            return source.words().to_owned();
        }
        let mut all: Vec<(NoiseSource, Vec<&str>)> = Vec::new();
        for ChannelFigures { noise, name, .. } in &self.channels {
            match all.iter_mut().find(|(source, _)| source == noise) {
                Some((_, names)) => names.push(name.as_str()),
                None => all.push((*noise, vec![name.as_str()])),
            }
        }
        let words = |(source, names): &(NoiseSource, Vec<&str>)| format!("{}: {}", names.join(", "), source.words());
        all.iter().map(words).collect::<Vec<_>>().join("; ")
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::film::Window;
    use crate::film::exr::{Attribute, ChannelData, Compression, ExrImage, ExrPart, Layout, read_exr, write_exr};
    use crate::math::sampler::mix64;
    use crate::math::statistics::Moments;
    use std::collections::BTreeSet;

    const SIDE: u32 = 64;
    pub(in crate::film::compare) const PIXELS: usize = 64 * 64;

    /// Standard normal numbers by the sum of twelve uniforms less six (kurtosis −0.1: no heavy tails).
    fn normal(seed: u64, i: usize) -> f64 {
        let uniform = |k: u64| (mix64(mix64(seed) ^ mix64(i as u64 * 16 + k)) >> 11) as f64 / 9_007_199_254_740_992.0;
        (0..12).map(uniform).sum::<f64>() - 6.0
    }

    pub(in crate::film::compare) fn file(channels: Vec<(String, Vec<f32>)>) -> ExrFile {
        let window = Window::full(SIDE, SIDE);
        ExrFile {
            display: window,
            chromaticities: None,
            parts: vec![ExrPart { name: None, window, channels, integers: Vec::new(), texts: Vec::new() }],
        }
    }

    /// A picture of R, G, B near `mean`·(1 … 2), as four replicates of deviation `sigma` would make it, times `gain`.
    pub(in crate::film::compare) fn render(seed: u64, mean: f64, sigma: f64, gain: f64) -> ExrFile {
        render_of(4, seed, mean, sigma, gain)
    }

    /// The same of up to four replicates.
    fn render_of(count: usize, seed: u64, mean: f64, sigma: f64, gain: f64) -> ExrFile {
        let mut channels = Vec::new();
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            let (mut values, mut errors) = (Vec::new(), Vec::new());
            for i in 0..PIXELS {
                let truth = mean * (1.0 + i as f64 / PIXELS as f64);
                let replicates: Moments =
                    (0..count).map(|r| gain * (truth + sigma * normal(seed, (i * 3 + c) * 4 + r))).collect();
                values.push(replicates.mean as f32);
                errors.push(replicates.standard_error() as f32);
            }
            channels.push((name.to_string(), values));
            channels.push((format!("stderr.{name}"), errors));
        }
        file(channels)
    }

    pub(in crate::film::compare) fn without_errors(mut file: ExrFile) -> ExrFile {
        file.parts[0].channels.retain(|(name, _)| !name.starts_with("stderr."));
        file
    }

    /// Four samples of light that one in twenty finds: where none did they agree, and yet are no nearer to the truth. Beside a picture of
    /// many samples, which is right, that is noise; a tenth more light is not.
    #[test]
    fn few_samples_that_agree_by_chance_are_no_fault() {
        let found = |seed: u64, samples: u32, gain: f64| {
            let (mut values, mut errors) = (Vec::new(), Vec::new());
            for i in 0..PIXELS {
                let uniform =
                    |k: u32| (mix64(mix64(seed) ^ mix64(i as u64) ^ u64::from(k)) >> 11) as f64 / 2f64.powi(53);
                let sample =
                    |k: u32| gain * (1.0 + 0.01 * uniform(k) + if uniform(k + 0x1000) < 0.05 { 4.0 } else { 0.0 });
                let of = |r: u32| (0..samples / 4).map(|k| sample(4 * k + r)).sum::<f64>() / f64::from(samples / 4);
                let replicates: Moments = (0..4).map(of).collect();
                values.push(replicates.mean as f32);
                errors.push(replicates.standard_error() as f32);
            }
            let mut file = file(vec![("Y".into(), values), ("stderr.Y".into(), errors)]);
            file.parts[0].texts.push(("abbe/samples".into(), samples.to_string()));
            file
        };
        let many = found(1, 1024, 1.0);
        for seed in 2..6 {
            let c = compare(&found(seed, 4, 1.0), &many, &CompareOptions::default());
            assert_eq!(c.verdict, Verdict::Same, "{seed}: {}", c.reason);
            let mut untold = found(seed, 4, 1.0);
            untold.parts[0].texts.clear();
            assert_eq!(compare(&untold, &many, &CompareOptions::default()).verdict, Verdict::Different, "{seed}");
            let brighter = compare(&found(seed, 4, 1.1), &many, &CompareOptions::default());
            assert_eq!(brighter.verdict, Verdict::Different, "{seed}");
        }
        // And a hundredth of the pixels that differ by half of their light.
        let mut spots = found(7, 4, 1.0);
        spots.parts[0].channels[0].1.iter_mut().step_by(97).for_each(|value| *value += 10.0);
        assert_eq!(compare(&spots, &many, &CompareOptions::default()).verdict, Verdict::Different);
    }

    /// Each run of equals is called different with probability 1e-3 (Bonferroni keeps it at that or below); of
    /// 20 runs none at these seeds, which happens with probability 0.98.
    #[test]
    fn two_seeds_of_one_scene_are_the_same() {
        for seed in 0..20 {
            let (a, b) = (render(2 * seed, 1.0, 0.3, 1.0), render(2 * seed + 1, 1.0, 0.3, 1.0));
            let c = compare(&a, &b, &CompareOptions::default());
            assert_eq!(c.verdict, Verdict::Same, "{}", c.table());
            assert_eq!(c.noise, Some(NoiseSource::StandardErrors));
            // Σ over 4096 pixels of two images with 3 dof each: Welch's dof is near 2·3·4096/(1 + 2/3) = 14746.
            assert!((c.channels[0].global_dof / 14_746.0 - 1.0).abs() < 0.1, "{}", c.channels[0].global_dof);
            let plain = compare(&without_errors(a), &without_errors(b), &CompareOptions::default());
            assert_eq!((plain.verdict, plain.noise), (Verdict::Same, Some(NoiseSource::Differences)));
        }
    }

    /// A picture 1 % brighter: the mean 1.5 differs by 0.015; its standard error is 0.15·√2/64 = 0.0033, so z = 4.5 a
    /// channel, p = 2e-5 after Bonferroni. One pixel's difference is 0.07 standard errors: the per-pixel test is blind.
    #[test]
    fn one_per_cent_of_bias_is_seen_by_the_global_test_alone() {
        let (a, b) = (render(1, 1.0, 0.3, 1.01), render(2, 1.0, 0.3, 1.0));
        for (a, b) in [(a.clone(), b.clone()), (without_errors(a), without_errors(b))] {
            let c = compare(&a, &b, &CompareOptions::default());
            assert_eq!(c.verdict, Verdict::Different, "{}", c.table());
            assert!(c.reason.contains("the mean of"), "{}", c.reason);
            assert!(c.pixel_test.is_none_or(|test| test.accepted >= ACCEPT_FRACTION));
            // Four standard errors of the ratio about 1.01.
            let r = &c.channels[0];
            assert!((r.mean_ratio - 1.01).abs() < 4.0 * r.mean_ratio_error, "{}", c.table());
            let tolerant = compare(&a, &b, &CompareOptions { mean_tolerance: 0.03, ..CompareOptions::default() });
            assert_eq!(tolerant.verdict, Verdict::Same);
        }
    }

    /// The ratio's standard error against theory: √2 · 0.15/64 / 1.5 = 0.0022 (B as noisy as A).
    #[test]
    fn the_error_of_the_ratio_is_that_of_the_noise() {
        let (a, b) = (render(3, 1.0, 0.3, 1.0), render(4, 1.0, 0.3, 1.0));
        let expected = 2f64.sqrt() * 0.15 / 64.0 / 1.5;
        for (a, b) in [(a.clone(), b.clone()), (without_errors(a), without_errors(b))] {
            for c in compare(&a, &b, &CompareOptions::default()).channels {
                // 4 · √(2/14746)/2 for the standard error; the differences have 4096 dof: 4·√(2/4096)/2 = 4.4 %.
                assert!((c.mean_ratio_error / expected - 1.0).abs() < 0.045, "{} {}", c.name, c.mean_ratio_error);
            }
        }
    }

    /// A variance per sample of 0.25 and 4 samples: A is off by N(0, 0.25/4). 40 wrong pixels of 4096 (1 %) by 10 standard
    /// errors each, in pairs of opposite sign: means agree, yet only 99.0 % of the pixels do.
    #[test]
    fn mitsubas_test_sees_local_faults_that_cancel_in_the_mean() {
        let flat = |value: f32| file(["R", "G", "B"].map(|n| (n.to_string(), vec![value; PIXELS])).to_vec());
        let (reference, variance) = (flat(1.0), flat(0.25));
        let mut a = flat(1.0);
        for (c, (_, values)) in a.parts[0].channels.iter_mut().enumerate() {
            for (i, v) in values.iter_mut().enumerate() {
                *v += (0.25 * normal(9, 3 * i + c)) as f32;
            }
        }
        let options = CompareOptions { sample_variance: Some((&variance, 4)), ..CompareOptions::default() };
        let good = compare(&a, &reference, &options);
        assert_eq!(good.verdict, Verdict::Same, "{}", good.table());
        let test = good.pixel_test.unwrap();
        // Šidák: 1 − 0.99^(1/4096) = 2.4537e-6.
        assert!((test.alpha - 2.4537e-6).abs() < 1e-10, "{}", test.alpha);
        // The three noises are independent, so in XYZ (rows of positive numbers below one) var Σ(m·d) = Σm²v is less than
        // Mitsuba's Σmv: the scores deviate by less than one.
        assert!(test.score_deviation < 1.0 && test.accepted == 1.0);
        for (_, values) in &mut a.parts[0].channels {
            for (k, v) in values.iter_mut().step_by(100).take(40).enumerate() {
                *v = if k % 2 == 0 { 1.0 + 2.5 } else { 1.0 - 2.5 };
            }
        }
        let bad = compare(&a, &reference, &options);
        assert_eq!(bad.verdict, Verdict::Different);
        assert!(bad.reason.contains("pixel values agree"), "{}", bad.table());
        assert_eq!(bad.pixel_test.unwrap().pixels_rejected, 40);
    }

    /// Errors of one picture alone, whose pixels err alike: a mean of 25 times the variance has five times the deviation, which the
    /// file says of itself, whichever of the two it is.
    #[test]
    fn what_the_one_noisy_picture_says_of_its_errors_holds_in_either_order() {
        let mut noisy = render(3, 1.0, 0.3, 1.0);
        let reference = without_errors(render(4, 1.0, 0.003, 1.0));
        let alone = compare(&noisy, &reference, &CompareOptions::default()).channels[0].global_z;
        noisy.parts[0].texts.push(("abbe/sharedErrors".into(), "25".into()));
        noisy.parts[0].texts.push(("abbe/samples".into(), "4".into()));
        let one = compare(&noisy, &reference, &CompareOptions::default());
        let other = compare(&reference, &noisy, &CompareOptions::default());
        assert_eq!(one.noise, Some(NoiseSource::OneStandardError));
        assert!((one.channels[0].global_z - alone / 5.0).abs() < 1e-9, "{} {alone}", one.channels[0].global_z);
        for (a, b) in one.channels.iter().zip(&other.channels) {
            assert!((a.global_z + b.global_z).abs() < 1e-9, "{}: {} {}", a.name, a.global_z, b.global_z);
            assert_eq!(a.global_dof, b.global_dof);
        }
        assert_eq!(one.pixel_test.map(|test| test.accepted), other.pixel_test.map(|test| test.accepted));
    }

    /// One sample a pixel, whose standard errors are NaN, beside a picture that knows its own well: those a hundred times smaller would
    /// have the first exact, and its noise a difference. By Σd/√Σd² the two are the same, and a tenth more light is not: 0.1 · 1.5 is
    /// some half of the standard deviation of a pixel, and some 30 of that of the mean of 4096.
    #[test]
    fn a_picture_that_cannot_tell_its_noise_is_not_taken_as_exact() {
        let reference = render(4, 1.0, 0.003, 1.0);
        let found = |gain: f64| {
            let one = render_of(1, 3, 1.0, 0.3, gain);
            assert!(one.parts[0].channel("stderr.R").unwrap().iter().all(|e| e.is_nan()));
            [
                compare(&one, &reference, &CompareOptions::default()),
                compare(&reference, &one, &CompareOptions::default()),
            ]
        };
        for (gain, verdict) in [(1.0, Verdict::Same), (1.1, Verdict::Different)] {
            for c in found(gain) {
                assert_eq!((c.verdict, c.noise), (verdict, Some(NoiseSource::Differences)), "{}", c.table());
            }
        }
    }

    #[test]
    fn a_picture_is_the_same_as_itself_and_as_its_half() {
        let a = render(5, 1.0, 0.3, 1.0);
        let same = compare(&a, &a, &CompareOptions::default());
        assert!(same.identical && same.verdict == Verdict::Same && same.global_p == 1.0);
        let mut black = a.clone();
        black.parts[0].channels.iter_mut().for_each(|(_, values)| values.fill(0.0));
        let c = compare(&black, &black, &CompareOptions::default());
        assert!(
            c.verdict == Verdict::Same && c.channels.iter().all(|c| (c.mean_ratio, c.mean_ratio_error) == (1.0, 0.0))
        );
        assert_eq!(compare(&a, &black, &CompareOptions::default()).verdict, Verdict::Different);
        // Without noise, rounding to half is all that differs: known, so still the same.
        let mut exact = a.clone();
        for (name, values) in &mut exact.parts[0].channels {
            if name.starts_with("stderr.") {
                values.fill(0.0);
            }
        }
        let mut half = exact.clone();
        for (_, values) in &mut half.parts[0].channels {
            values.iter_mut().for_each(|v| *v = half::f16::from_f32(*v).to_f32());
        }
        let c = compare(&half, &exact, &CompareOptions::default());
        assert!(!c.identical && c.verdict == Verdict::Same, "{}", c.table());
        // And a pixel that is off by more than rounding is not.
        half.parts[0].channels[0].1[77] *= 1.25;
        let c = compare(&half, &exact, &CompareOptions::default());
        assert_eq!(c.verdict, Verdict::Different, "{}", c.table());
    }

    /// 0.3 is off by 4.9e-5 as a half float, everywhere alike: taken for rounding of its own in each pixel that were 44 standard errors
    /// over 4096 of them.
    #[test]
    fn an_even_picture_is_the_same_as_its_half() {
        let flat = |value: f32, error: Option<f32>| {
            let plane = |name: &str, value| (name.to_string(), vec![value; PIXELS]);
            file([plane("Y", value)].into_iter().chain(error.map(|error| plane("stderr.Y", error))).collect())
        };
        let half = half::f16::from_f32(0.3).to_f32();
        for error in [None, Some(0.0)] {
            let (exact, rounded) = (flat(0.3, error), flat(half, error));
            for (a, b) in [(&exact, &rounded), (&rounded, &exact)] {
                let c = compare(a, b, &CompareOptions::default());
                assert!(c.verdict == Verdict::Same && !c.identical, "{}", c.table());
                assert!(c.channels[0].max_difference > 4e-5, "{}", c.table());
            }
            let brighter = compare(&flat(0.303, error), &rounded, &CompareOptions::default());
            assert_eq!(brighter.verdict, Verdict::Different, "{}", brighter.table());
        }
    }

    /// 8 x 8 pixels that are ten standard errors off, or not at all: a pixel is rejected in three comparisons of equals in a hundred, two in one
    /// of two thousand, by Student's tails; of the sum of all pixels ten are little more than one standard error.
    #[test]
    fn a_single_pixel_makes_no_small_picture_different() {
        let flat = |changes: &[(usize, usize, f32)]| {
            let window = Window::full(8, 8);
            let mut file = file(Vec::new());
            (file.display, file.parts[0].window) = (window, window);
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let mut plane = vec![1.0; window.pixels()];
                changes.iter().filter(|change| change.0 == c).for_each(|(_, i, by)| plane[*i] += by);
                file.parts[0].channels.push((name.to_string(), plane));
                file.parts[0].channels.push((format!("stderr.{name}"), vec![0.1; window.pixels()]));
            }
            file
        };
        let with = |changes: &[(usize, usize, f32)]| compare(&flat(changes), &flat(&[]), &CompareOptions::default());
        let one = with(&[(0, 5, 1.4), (1, 5, 1.4)]);
        assert_eq!(one.verdict, Verdict::Same, "{}", one.table());
        let two = with(&[(0, 5, 1.4), (0, 6, -1.4)]);
        assert_eq!(two.verdict, Verdict::Different, "{}", two.table());
        assert!(two.reason.contains("of the pixel values agree"), "{}", two.reason);
        let tests = [one, two].map(|c| c.pixel_test.unwrap());
        assert_eq!(tests.map(|test| (test.pixels_rejected, test.pixels_allowed)), [(1, 1), (2, 1)]);
    }

    #[test]
    fn values_that_are_not_finite_are_counted_and_make_a_difference() {
        let b = render(6, 1.0, 0.3, 1.0);
        let mut a = b.clone();
        a.parts[0].channels[0].1[3] = f32::NAN;
        a.parts[0].channels[2].1[3] = f32::INFINITY;
        let c = compare(&a, &b, &CompareOptions::default());
        assert_eq!((c.verdict, c.pixels), (Verdict::Different, PIXELS - 1));
        assert_eq!(c.reason, "1 of 4096 pixels hold values that are not finite");
        assert_eq!((c.channels[0].nan_a, c.channels[1].infinite_a, c.channels[0].nan_b), (1, 1, 0));
        // Even against itself.
        assert_eq!(compare(&a, &a, &CompareOptions::default()).verdict, Verdict::Different);
    }

    /// What a reader finds in a file of these channels in 32-bit floats that was rendered with `samples` a pixel.
    fn written(file: &ExrFile, samples: i32) -> ExrFile {
        let part = &file.parts[0];
        let channels = part.channels.iter().map(|(name, plane)| (name.clone(), ChannelData::F32(plane.clone())));
        read_back(channels.collect(), vec![("abbe/samples".into(), Attribute::Int(samples))])
    }

    fn read_back(channels: Vec<(String, ChannelData)>, attributes: Vec<(String, Attribute)>) -> ExrFile {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let image = ExrImage {
            frame: [SIDE; 2],
            window: Window::full(SIDE, SIDE),
            channels,
            colour: None,
            attributes,
            data: BTreeSet::new(),
            compression: Compression::None,
            layout: Layout::Single,
        };
        write_exr(&path, &image).unwrap();
        read_exr(&path).unwrap()
    }

    /// Two samples make replicates of one each and an error of one degree of freedom, three make one of two. Against what
    /// is exact a pixel of two is a Student's t of one: beyond 144, the level of a pixel by three, in 2/(144 π) = 0.44 % of all.
    #[test]
    fn errors_of_two_and_three_samples_are_as_uncertain_as_they_are() {
        let exact = without_errors(render(0, 1.0, 0.0, 1.0));
        for samples in [2, 3] {
            for pair in 0..3 {
                let [a, b] = [2 * pair, 2 * pair + 1].map(|seed| render_of(samples, seed, 1.0, 0.3, 1.0));
                let [a, b] = [a, b].map(|file| written(&file, samples as i32));
                for b in [&b, &exact] {
                    let c = compare(&a, b, &CompareOptions::default());
                    assert_eq!(c.verdict, Verdict::Same, "{samples}: {}", c.table());
                }
            }
        }
        let untold = compare(&render_of(2, 0, 1.0, 0.3, 1.0), &exact, &CompareOptions::default());
        assert_eq!(untold.verdict, Verdict::Different, "taken for three degrees of freedom: {}", untold.table());
        // A picture that is off is still told from its like.
        let [a, b] = [(1, 1.05), (2, 1.0)].map(|(seed, gain)| written(&render_of(2, seed, 1.0, 0.3, gain), 2));
        assert_eq!(compare(&a, &b, &CompareOptions::default()).verdict, Verdict::Different);
    }

    /// Of such pixels only the differences are known, as of pictures without any standard error: Σd/√Σd² of the 2048 whose
    /// difference is their value, some 1.5, is about √2048 = 45.
    #[test]
    fn pixels_without_a_standard_error_have_a_say() {
        let unknown = |mut f: ExrFile, gain: f32| {
            for (name, plane) in &mut f.parts[0].channels {
                let is_error = name.starts_with("stderr.");
                plane.iter_mut().step_by(2).for_each(|x| *x = if is_error { f32::NAN } else { *x * gain });
            }
            f
        };
        let pair = |gain| (unknown(render(21, 1.0, 0.3, 1.0), gain), unknown(render(22, 1.0, 0.3, 1.0), 1.0));
        let compared = |(a, b): (ExrFile, ExrFile)| compare(&a, &b, &CompareOptions::default());
        let c = compared(pair(1.0));
        assert_eq!(c.verdict, Verdict::Same, "{}", c.table());
        assert!(c.table().contains("without a standard error 2048 pixels"), "{}", c.table());
        let c = compared(pair(2.0));
        assert_eq!(c.verdict, Verdict::Different, "{}", c.table());
        assert!((30.0..60.0).contains(&c.channels[0].global_z), "{}", c.table());
    }

    /// Near 4291595995 floats of 32 bits are 256 apart.
    #[test]
    fn whole_numbers_are_compared_to_the_last_bit() {
        let ids = |last: u32| {
            let mut ids = vec![7; PIXELS];
            ids[9] = last;
            read_back(vec![("id".into(), ChannelData::U32(ids))], Vec::new())
        };
        let (a, b) = (ids(4_291_595_995), ids(4_291_595_996));
        assert!(compare(&a, &a, &CompareOptions::default()).identical);
        let c = compare(&a, &b, &CompareOptions::default());
        assert!(!c.identical && c.channels[0].max_difference == 1.0, "{}", c.table());
    }

    /// Figures by hand: a = (1, 3), b = (1, 2) in one channel, twice; m = 1.5.
    #[test]
    fn figures_equal_their_definitions() {
        let y = |pair: [f32; 2]| file(vec![("Y".into(), pair.repeat(PIXELS / 2))]);
        let c = compare(&y([1.0, 3.0]), &y([1.0, 2.0]), &CompareOptions::default());
        let f = &c.channels[0];
        assert_eq!((f.mean_a, f.mean_b, f.max_difference), (2.0, 1.5, 1.0));
        let close = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
        close(f.rmse, 0.5f64.sqrt());
        close(f.rel_mse, 0.5 / (4.0 + 0.0225));
        close(f.smape, 0.5 / (5.0 + 0.015));
        // Σd/√Σd² with 2048 differences of 1.
        close(f.global_z, 2048f64.sqrt());
    }

    /// A depth of 1e10 beside bands of 470 and 0.5 nm, which have standard errors: b is (1, 3) against (1, 2), n a thousandth of
    /// that. Each is divided by its own light, so that both have the figures of b alone.
    #[test]
    fn channels_of_other_units_have_figures_and_noise_of_their_own() {
        let bands = |pair: [f32; 2]| {
            let plane = |name: &str, by: f32| (name.to_string(), pair.map(|x| by * x).repeat(PIXELS / 2));
            let errors = ["b", "n"].map(|name| (format!("stderr.{name}"), vec![1.0; PIXELS]));
            let planes = [("Z".to_string(), vec![1e10; PIXELS]), plane("b", 1.0), plane("n", 1.0 / 1024.0)];
            file(planes.into_iter().chain(errors).collect())
        };
        let c = compare(&bands([1.0, 3.0]), &bands([1.0, 2.0]), &CompareOptions::default());
        let close = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
        for band in &c.channels[1..] {
            close(band.rel_mse, 0.5 / (4.0 + 0.0225));
            close(band.smape, 0.5 / (5.0 + 0.015));
        }
        assert_eq!(c.noise, None);
        let told = "known from         Z: the differences themselves; b, n: the standard errors of both\n";
        assert!(c.table().contains(told), "{}", c.table());
    }

    #[test]
    fn the_report_is_json() {
        let c = compare(&render(1, 1.0, 0.3, 1.0), &render(2, 1.0, 0.3, 1.0), &CompareOptions::default());
        let json = serde_json::to_value(&c).unwrap();
        assert_eq!(json["verdict"], "same");
        assert_eq!(json["noise"], "standard_errors");
        assert!(json["channels"][2]["global_p"].is_number());
    }
}
