use super::*;
use crate::film::Window;
use crate::film::exr::{
    Attribute, ChannelData, ColourEncoding, Compression, ExrImage, ExrPart, Layout, read_exr, write_exr,
};
use crate::math::sampler::mix64;
use crate::math::statistics::Moments;
use crate::spectrum::ColourSpace;
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
            let uniform = |k: u32| (mix64(mix64(seed) ^ mix64(i as u64) ^ u64::from(k)) >> 11) as f64 / 2f64.powi(53);
            let sample = |k: u32| gain * (1.0 + 0.01 * uniform(k) + if uniform(k + 0x1000) < 0.05 { 4.0 } else { 0.0 });
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
        let brighter = compare(&found(seed, 4, 1.1), &many, &CompareOptions::default());
        assert_eq!(brighter.verdict, Verdict::Different, "{seed}");
    }
    // And a hundredth of the pixels that differ by half of their light.
    let mut spots = found(7, 4, 1.0);
    spots.parts[0].channels[0].1.iter_mut().step_by(97).for_each(|value| *value += 10.0);
    assert_eq!(compare(&spots, &many, &CompareOptions::default()).verdict, Verdict::Different);
}

/// Of 16 stratified samples of a replicate six or seven meet a hole of 0.4: in one pixel of eight all four replicates count the
/// same, and their standard error is none, though the other picture may have counted another number.
#[test]
fn strata_that_agree_by_chance_are_no_fault() {
    let found = |seed: u64, hole: f64| {
        let (mut values, mut errors) = (Vec::new(), Vec::new());
        for i in 0..PIXELS {
            let uniform = |k: u64| (mix64(mix64(seed) ^ mix64(4 * i as u64 + k)) >> 11) as f64 / 2f64.powi(53);
            let replicates: Moments = (0..4).map(|r| (16.0 * hole + uniform(r)).floor() / 16.0).collect();
            values.push(replicates.mean as f32);
            errors.push(replicates.standard_error() as f32);
        }
        file(vec![("Y".into(), values), ("stderr.Y".into(), errors)])
    };
    for seed in 0..6 {
        let c = compare(&found(2 * seed, 0.4), &found(2 * seed + 1, 0.4), &CompareOptions::default());
        assert_eq!(c.verdict, Verdict::Same, "{seed}: {}", c.reason);
        // A hole larger by a hundredth is 0.004 of light, where the mean of 4096 pixels is known to 0.0004.
        let c = compare(&found(2 * seed, 0.4), &found(2 * seed + 1, 0.404), &CompareOptions::default());
        assert_eq!(c.verdict, Verdict::Different, "{seed}: {}", c.reason);
    }
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

/// By differences alone n pixels have a score of √n at the most, whatever they hold: 12 have p = 5.3e-4 and 13 have 3.1e-4, and
/// of three channels each is judged at 3.3e-4. Fewer are not called the same for that.
#[test]
fn a_few_pixels_without_standard_errors_are_not_judged() {
    let flat = |width: u32, value: f32, error: Option<f32>| {
        let window = Window::full(width, 1);
        let plane = |value: f32| vec![value; window.pixels()];
        let errors = error.iter().flat_map(|e| ["R", "G", "B"].map(|n| (format!("stderr.{n}"), plane(*e))));
        let channels = ["R", "G", "B"].map(|n| (n.to_string(), plane(value))).into_iter().chain(errors).collect();
        ExrFile {
            display: window,
            chromaticities: None,
            parts: vec![ExrPart { name: None, window, channels, integers: Vec::new(), texts: Vec::new() }],
        }
    };
    let verdict = |width: u32, value: f32, error: Option<f32>, mean_tolerance: f64| {
        let options = CompareOptions { mean_tolerance, ..CompareOptions::default() };
        compare(&flat(width, value, error), &flat(width, 1.0, error), &options).verdict
    };
    for width in [1, 12] {
        assert_eq!(verdict(width, 100.0, None, 0.0), Verdict::CannotCompare, "{width}");
        assert_eq!(verdict(width, 1.0, None, 0.0), Verdict::Same, "{width}");
        assert_eq!(verdict(width, 1.01, None, 0.02), Verdict::Same, "{width}");
        assert_eq!(verdict(width, 100.0, Some(0.01), 0.0), Verdict::Different, "{width}");
    }
    assert_eq!(verdict(13, 100.0, None, 0.0), Verdict::Different);
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
        [compare(&one, &reference, &CompareOptions::default()), compare(&reference, &one, &CompareOptions::default())]
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
    assert!(c.verdict == Verdict::Same && c.channels.iter().all(|c| (c.mean_ratio, c.mean_ratio_error) == (1.0, 0.0)));
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
        colour: Some(ColourEncoding::of(ColourSpace::Rec709)),
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
    // Taken for four replicates each variance would have three degrees of freedom in place of one.
    let untold = render_of(2, 0, 1.0, 0.3, 1.0);
    let freedom = |file: &ExrFile| compare(file, &exact, &CompareOptions::default()).channels[0].global_dof;
    assert!((freedom(&untold) / freedom(&written(&untold, 2)) - 3.0).abs() < 1e-9);
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
    // Nothing is no part of something, and all of nothing.
    let ratio = |pair: [f32; 2], of| compare(&y(pair), &y(of), &CompareOptions::default()).channels[0].mean_ratio;
    assert_eq!(ratio([0.0; 2], [1.0, 3.0]), 0.0);
    assert_eq!(ratio([0.0; 2], [0.0; 2]), 1.0);
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
