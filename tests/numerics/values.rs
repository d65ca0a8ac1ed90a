//! Functions of one number or a few, at the ends of their ranges.

use crate::common::{Bench, bench_with, try_bench};
use abbe::film::Window;
use abbe::film::accumulate::Film;
use abbe::math::sampler::{Sampler, Set};
use abbe::math::statistics::Moments;
use abbe::optics::microfacet::{Distribution, Microfacets};
use abbe::optics::phase::Phase;
use abbe::scene::FogFalloff;
use abbe::spectrum::{ColourSpace, RANDOM, Spectrum, WavelengthDistribution, observer, upsample};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Case O24: visible normals seen at cos 1e-4, of widths from 1e-4 to 1, by χ² in slopes over the width. With q = s/(1 + s) of a
/// slope s, s ds = q dq / (1 − q)³, and a solid angle about the facet is m_z³ α² times the area in slopes; the density
/// in (q, φ) is smooth but for where facets turn away. 16 × 16 cells, 2e5 samples, z < 5 by Wilson and Hilferty.
#[test]
fn visible_normals_have_the_stated_density_at_grazing() {
    const N: usize = 16;
    const FINE: usize = 32;
    const SAMPLES: u32 = 200_000;
    for alpha in [1e-4, 1e-2, 0.3, 1.0] {
        for cos in [1e-4, 0.05, 0.9] {
            let facets = Microfacets::isotropic(Distribution::Ggx, alpha);
            let wo = DVec3::new((1.0f64 - cos * cos).sqrt(), 0.0, cos);
            let mut counts = [0u32; N * N];
            for i in 0..SAMPLES {
                let set = Sampler::new(5, [i, 0], 0, 0).set(Set::Camera);
                let m = facets.sample(wo, DVec2::new(set[0], set[1]));
                let s2 = (m.x * m.x + m.y * m.y) / (m.z * m.z * alpha * alpha);
                let s = s2.sqrt();
                let (q, turn) = (s / (1.0 + s), (m.y.atan2(m.x) / TAU).rem_euclid(1.0));
                counts[((q * N as f64) as usize).min(N - 1) * N + ((turn * N as f64) as usize).min(N - 1)] += 1;
            }
            let mut cells = [0.0; N * N];
            let side = N * FINE;
            for i in 0..side {
                let q = (i as f64 + 0.5) / side as f64;
                let s = q / (1.0 - q) * alpha;
                for j in 0..side {
                    let (sin, cos) = (TAU * (j as f64 + 0.5) / side as f64).sin_cos();
                    let m = DVec3::new(s * cos, s * sin, 1.0).normalize();
                    let pdf = if wo.dot(m) > 0.0 { facets.pdf(wo, m) } else { 0.0 };
                    let density = pdf * m.z.powi(3) * alpha * alpha * q / (1.0 - q).powi(3);
                    cells[i / FINE * N + j / FINE] += density * TAU / (side * side) as f64;
                }
            }
            let total: f64 = cells.iter().sum();
            assert!((total - 1.0).abs() < 2e-3, "alpha {alpha} cos {cos}: the density integrates to {total}");
            let (mut chi2, mut freedom) = (0.0, -1.0);
            for (cell, count) in cells.iter().zip(counts) {
                let expected = cell * f64::from(SAMPLES);
                if expected >= 20.0 {
                    chi2 += (f64::from(count) - expected).powi(2) / (expected + (2e-3 * expected).powi(2));
                    freedom += 1.0;
                }
            }
            let spread = 2.0 / (9.0 * freedom);
            let z = ((chi2 / freedom).powf(1.0 / 3.0) - (1.0 - spread)) / spread.sqrt();
            assert!(z < 5.0, "alpha {alpha} cos {cos}: chi2 {chi2} of {freedom}, z {z}");
        }
    }
}

/// Case O25: ∫ 2π p d(cos θ) = 1 for Henyey and Greenstein's function down to a peak of a millionth of a radian, and for g
/// near 0. The integral runs over log(1 − cos), each decade by 200 midpoints; cos is known to 1e-16, 2e-4 of the peak's
/// width, which averages out.
#[test]
fn henyey_and_greenstein_integrates_to_one() {
    for g in [0.0f64, 1e-9, 1e-4, 0.5, 0.99, 0.999_999] {
        for g in [g, -g] {
            let phase = Phase::HenyeyGreenstein(g);
            let mut sum = 0.0;
            let (low, steps) = (-22.0, 4500);
            let width = (2f64.log10() - low) / f64::from(steps);
            for i in 0..steps {
                let x = 10f64.powf(low + (f64::from(i) + 0.5) * width);
                // About the peak: forward, or backward.
                let cos = (1.0 - x) * if g < 0.0 { -1.0 } else { 1.0 };
                let sin = (x * (2.0 - x)).max(0.0).sqrt();
                let p = phase.eval(DVec3::Z, DVec3::new(sin, 0.0, -cos));
                assert!(p.is_finite() && p > 0.0, "{g} {x}");
                sum += TAU * p * x * width * std::f64::consts::LN_10;
            }
            assert!((sum - 1.0).abs() < 1e-5, "{g}: {sum}");
        }
    }
}

/// Case O30: a colour becomes a spectrum and, under D65, itself again to 1e-3; black, 1e-9 and the corners of the gamut
/// are finite at every wavelength. (The corners are on its border and a little within: the sigmoid does not reach 0 or 1.)
#[test]
fn colours_come_back_from_their_spectra() {
    let white = Spectrum::illuminant("D65").unwrap();
    let y = observer::tristimulus(&white)[1];
    let matrix = ColourSpace::Rec709.matrix_from_xyz();
    let levels = [0.0, 1e-9, 1e-4, 0.02, 0.5, 0.9, 1.0];
    for r in levels {
        for g in levels {
            for b in levels {
                let spectrum = upsample::reflectance([r, g, b]).unwrap();
                for nm in 360..=830 {
                    let x = spectrum.at(f64::from(nm));
                    assert!((0.0..=1.0).contains(&x), "{r} {g} {b} at {nm}: {x}");
                }
                let xyz = observer::tristimulus(&white.times(&spectrum)).map(|x| x / y);
                let found: [f64; 3] = std::array::from_fn(|i| (0..3).map(|k| matrix[i][k] * xyz[k]).sum());
                for (found, expected) in found.iter().zip([r, g, b]) {
                    assert!((found - expected).abs() < 1e-3, "{r} {g} {b}: {found:?}");
                }
            }
        }
    }
}

/// Case O29: for every density of wavelengths, also one that a line a nanometre wide at either end of the band calls for,
/// the first and last u give wavelengths within the band, with finite weights.
#[test]
fn wavelengths_stay_in_the_band_and_have_weights() {
    let line = |nm: f64| Spectrum::lines(&[(nm, 1.0, 1.0)]).unwrap();
    let mut all = vec![WavelengthDistribution::uniform(), WavelengthDistribution::visible()];
    for nm in [361.0, 555.0, 829.0] {
        all.push(WavelengthDistribution::for_scene(&[(1.0, line(nm))], &[], RANDOM));
        all.push(WavelengthDistribution::for_bands(&[&line(nm)], &[], 0.1, RANDOM));
    }
    for distribution in all {
        for u in [0.0, f64::MIN_POSITIVE, 2f64.powi(-32), 0.5, 1.0 - 2f64.powi(-32), 1.0f64.next_down()] {
            let sampled = distribution.sample(u);
            for nm in sampled.nm.to_array() {
                assert!((360.0..=830.0).contains(&nm), "{} {u}: {nm}", distribution.describe());
                assert!(observer::matching(f64::from(nm)).iter().all(|x| x.is_finite() && *x >= 0.0));
            }
            let xyz = observer::xyz(abbe::spectrum::Lanes::ONE, &sampled);
            assert!(xyz.iter().all(|x| x.is_finite()), "{} {u}: {xyz:?}", distribution.describe());
        }
    }
    assert_eq!([359.9, 830.1].map(observer::matching), [[0.0; 3]; 2]);
}

/// A sky of one line: its picture has the luminance that the observer gives the line, wherever in the band it is. The
/// density of wavelengths follows the line, so that a few samples find it.
#[test]
fn a_sky_of_one_line_has_the_lines_luminance() {
    for (nm, width) in [(361.0, 1.0), (404.7, 0.5), (555.0, 0.1), (589.3, 1.0), (780.0, 2.0), (829.0, 1.0)] {
        let power = 1e3;
        let scene = bench_with(
            &format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 16, height: 16}}\n\
                 render: {{samples: 64}}\nlights: [{{constant: {{radiance: {{lines: [{{nm: {nm}, power: {power}, width_nm: {width}}}]}}}}}}]\n"
            ),
            &[],
        );
        let expected = observer::tristimulus(&Spectrum::lines(&[(nm, power, width)]).unwrap())[1];
        let found = scene.picture().mean();
        let off = (found.mean - expected).abs();
        assert!(off <= 4.5 * found.error + 1e-3 * expected, "{nm}: expected {expected}, found {found:?}");
        assert!(found.error < 0.02 * expected, "{nm}: {found:?}, expected {expected}");
    }
}

/// Case O28: an index that has no value somewhere in the band, because a resonance lies there or n² falls below zero, is
/// refused when the scene is read, with its place.
#[test]
fn an_index_with_a_pole_in_the_band_is_refused_with_its_place() {
    for index in [
        "{sellmeier: {b: [1, 0.2, 1], c: [0.25, 0.02, 103]}}",
        "{sellmeier: {b: [-3, 0.2, 1], c: [0.006, 0.02, 103]}}",
        "{cauchy: [-1.5, 0.004]}",
        "{table: [[400, 1.5], [700, 1.5]]}",
    ] {
        let yaml = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
             shapes: [{{sphere: {{radius: 1, material: {{dielectric: {{ior: {index}}}}}}}}}]\n"
        );
        let fault = try_bench(&yaml, &[]).err().unwrap_or_else(|| panic!("{index} is taken"));
        assert!(fault.contains("scene.yaml:2:") && fault.contains("ior"), "{index}: {fault}");
    }
}

/// Case O32: fog whose start is its end is refused; the three laws in the picture of a wall at depth 4 are the closed
/// forms 1 − (1 − a) of a wall of ½ and fog of 1, a = (z − s)/(e − s), 1 − exp(−ρz), 1 − exp(−(ρz)²).
#[test]
fn fog_is_its_closed_form_in_the_picture() {
    let scene = |fog: &str| {
        format!(
            "camera: {{origin: [0, 0, 4], target: [0, 0, 0], fov_deg: 1}}\nimage: {{width: 4, height: 4}}\nfog: {fog}\n\
             render: {{samples: 16}}\nshapes: [{{plane: {{normal: [0, 0, 1]}}}}]\nlights: [{{constant: {{radiance: 1}}}}]\n"
        )
    };
    assert!(try_bench(&scene("{colour: 1, start: 5, end: 5}"), &[]).is_err());
    for (fog, amount) in [
        ("{colour: 1, start: 2, end: 10}", 0.25),
        ("{colour: 1, start: 1, end: 1.000001}", 1.0),
        ("{colour: 1, density: 0.1}", 1.0 - (-0.4f64).exp()),
        ("{colour: 1, density: 1e-9}", 4e-9),
        ("{colour: 1, density: 0.1, falloff: exp2}", 1.0 - (-0.16f64).exp()),
    ] {
        bench_with(&scene(fog), &[]).grey().picture().assert_all(0.5 + 0.5 * amount, 2e-6);
    }
    let start = FogFalloff::Linear { start: 0.0, end: 1.0 };
    assert_eq!([-1.0, 0.0, 1.0].map(|z| start.amount(z)), [0.0, 0.0, 1.0]);
}

/// Case O35: the sampler's numbers are below one, and stay so as f32 after `1 − u` is asked for a logarithm.
#[test]
fn random_numbers_are_below_one() {
    let mut largest = 0.0f64;
    for pixel in 0..2000 {
        for index in 0..64 {
            let sampler = Sampler::new(9, [pixel, 3], pixel % 4, index);
            for set in [Set::Camera, Set::Scatter(1), Set::Choice(2)] {
                for u in sampler.set(set) {
                    assert!((0.0..1.0).contains(&u) && (1.0 - u).ln().is_finite());
                    largest = largest.max(u);
                }
            }
        }
    }
    // A million and a half of them reach up to where f32 has no number below one.
    assert!(largest > 1.0 - 2f64.powi(-18), "{largest}");
}

/// Case O36: filters without negative lobes keep a constant scene constant to the last digits of f32, also on a picture of
/// one pixel and at its borders.
#[test]
fn filters_keep_a_constant_scene_constant() {
    for filter in
        ["box", "{tent: {radius: 1}}", "{tent: {radius: 3.7}}", "{gaussian: {stddev: 0.5}}", "{gaussian: {stddev: 2}}"]
    {
        for (width, height) in [(1, 1), (1, 7), (16, 3)] {
            let scene: Bench = bench_with(
                &format!(
                    "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                     image: {{width: {width}, height: {height}, filter: {filter}}}\n\
                     render: {{samples: 16}}\nlights: [{{constant: {{radiance: 0.7}}}}]\n"
                ),
                &[],
            );
            scene.grey().picture().assert_all(0.7, 1e-6);
        }
    }
}

/// Case O37: a million samples of 0.7 and noise, summed as the film does, against f64: the mean agrees to 1e-9, for each
/// sample is rounded to a unit of 2⁻³² or less and sums are exact.
#[test]
fn a_film_of_a_million_samples_is_the_mean() {
    let mut film = Film::new([1, 1], Window { x: 0, y: 0, width: 1, height: 1 }).unwrap();
    let mut sum = Moments::default();
    for i in 0..1_000_000u32 {
        let u = Sampler::new(1, [i, 0], 0, 0).set(Set::Camera)[0];
        let x = (0.7 + 0.4 * (u - 0.5)) as f32;
        film.add([0, 0], (i % 4) as usize, [x; 3], 1.0);
        sum.push(f64::from(x));
    }
    let cells = film.cells()[0].each_ref();
    let total: f64 = cells.iter().map(|c| c.xyz[1].value()).sum();
    assert!((total / 1e6 - sum.mean).abs() < 1e-9, "{} {}", total / 1e6, sum.mean);
}

/// Case O20, pbrt's spheres: within a sphere of albedo ½ a lamp in the middle of intensity π, or walls that shine with ½,
/// make L = 1: ρ/π · π · (1 + ρ + …) = 1; ½ (1 + ½ + …) = 1. To 1e-3 of the mean.
#[test]
fn light_in_pbrts_spheres_is_one() {
    let camera = "camera: {origin: [0, 0, 0.3], target: [0, 0, -1], fov_deg: 60}\nimage: {width: 24, height: 24}\nrender: {samples: 256}\n";
    let grey = "material: {diffuse: {reflectance: 0.5}}";
    for rest in [
        format!(
            "shapes: [{{sphere: {{radius: 1, {grey}}}}}]\nlights: [{{point: {{position: [0, 0, 0], intensity: {PI}}}}}]\n"
        ),
        format!("shapes: [{{sphere: {{radius: 1, {grey}, emission: 0.5, flip_normals: true}}}}]\n"),
    ] {
        let mean = bench_with(&format!("{camera}{rest}"), &[]).grey().picture().mean();
        assert!((mean.mean - 1.0).abs() < 1e-3 + 4.5 * mean.error && mean.error < 1e-3, "{mean:?}");
    }
}

/// Case O40: numbers that are none, lengths that are negative, matrices that flatten, a view along up and keys that stand
/// twice are refused with file, line and field.
#[test]
fn what_is_no_length_matrix_or_key_is_refused_with_its_place() {
    let camera = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n";
    for (rest, line, field) in [
        ("shapes: [{sphere: {radius: .nan}}]", 2, "radius"),
        ("shapes: [{sphere: {radius: 1, center: [.inf, 0, 0]}}]", 2, "center"),
        ("shapes: [{sphere: {radius: -1}}]", 2, "radius"),
        ("shapes: [{sphere: {radius: 0}}]", 2, "radius"),
        ("shapes: [{sphere: {radius: 1e70}}]", 2, "radius"),
        ("shapes: [{cube: {size: 1, transform: [{scale: [1, 0, 1]}]}}]", 2, "transform"),
        (
            "groups: {g: [{sphere: {radius: 1}}]}\nshapes: [{instance: {group: g, transform: [{scale: [1, 0, 1]}]}}]",
            3,
            "transform",
        ),
        ("shapes: [{rectangle: {corner: [0, 0, 0], edge_u: [1, 0, 0], edge_v: [2, 0, 0]}}]", 2, "edge"),
        ("shapes: [{cylinder: {base: [1, 1, 1], top: [1, 1, 1], radius: 1}}]", 2, "cylinder"),
        ("shapes: [{sphere: {radius: 1, radius: 2}}]", 2, "radius"),
        ("lights: [{spot: {position: [0, 0, 0], direction: [0, 0, 0], intensity: 1}}]", 2, "direction"),
        ("media: {m: {homogeneous: {scattering: -1}}}", 2, "scattering"),
        ("media: {m: {homogeneous: {scattering: 1, phase: {hg: 1}}}}", 2, "hg"),
    ] {
        let fault = try_bench(&format!("{camera}{rest}\n"), &[]).err().unwrap_or_else(|| panic!("{rest} is taken"));
        assert!(fault.contains(&format!("scene.yaml:{line}:")) && fault.contains(field), "{rest}: {fault}");
    }
    let up = "camera: {origin: [0, 5, 0], target: [0, 0, 0], up: [0, 1, 0], fov_deg: 40}\n";
    let fault = try_bench(up, &[]).err().unwrap();
    assert!(fault.contains("scene.yaml:1:") && fault.contains("up"), "{fault}");
}
