//! Each wavelength bends by its own index: a prism against Snell's law by hand.

use super::LAMP;
use super::channels::render;
use super::common::{Bench, bench, wavelengths};
use abbe::math::Ray;
use abbe::math::sampler::Sampler;
use abbe::math::statistics::Moments;
use abbe::spectrum::{RefractiveIndex, catalogue};
use glam::DVec3;

/// N-BK7 by the three terms that Schott publishes, λ in µm.
fn bk7(nm: f64) -> f64 {
    let l2 = (nm * 1e-3).powi(2);
    let terms = [(1.039_612_12, 0.006_000_698_67), (0.231_792_344, 0.020_017_914_4), (1.010_469_45, 103.560_653)];
    (1.0 + terms.iter().map(|(b, c)| b * l2 / (l2 - c)).sum::<f64>()).sqrt()
}

/// Open case O28: the lines h, d and r of the data sheet, computed with 30 digits.
#[test]
fn the_catalogue_has_n_bk7_at_the_lines_of_its_data_sheet() {
    let glass = catalogue::glass("N-BK7").unwrap();
    for (nm, n) in [(404.6561, 1.530_239_986), (587.5618, 1.516_800_035), (706.5188, 1.512_892_522)] {
        assert!((glass.at(nm) - n).abs() < 1e-9, "{nm} nm: {}", glass.at(nm));
        assert!((bk7(nm) - n).abs() < 1e-9);
    }
    assert!(matches!(glass, RefractiveIndex::Sellmeier { .. }));
}

/// A prism of 60° with its edge at the origin pointing up; light meets its left face at 50°, one metre
/// below the edge. Where it leaves, and how steeply.
struct Passage {
    point: [f64; 2],
    /// Angle of the leaving ray above the horizon, radians.
    angle: f64,
    /// Product of the two transmittances.
    transmitted: f64,
}

fn through_the_prism(n: f64, incidence: f64) -> Passage {
    let transmittance = |i: f64, t: f64| {
        // Fresnel by sines and tangents: 1 − R.
        let (s, p) = ((i - t).sin() / (i + t).sin(), (i - t).tan() / (i + t).tan());
        1.0 - 0.5 * (s * s + p * p)
    };
    let apex = 60f64.to_radians();
    let first = (incidence.sin() / n).asin();
    let second = apex - first;
    let leaving = (n * second.sin()).asin();
    // Law of sines in the triangle edge, entry, exit.
    let side = first.cos() / second.cos();
    let half = 0.5 * apex;
    Passage {
        point: [side * half.sin(), -side * half.cos()],
        // The right face's normal stands 30° above the horizon.
        angle: half - leaving,
        transmitted: transmittance(incidence, first) * transmittance(second, leaving),
    }
}

/// The prism and a lamp 20 metres away whose upper edge is where light leaving at `angle` + `turn` goes.
fn prism(passage: &Passage, turn: f64, integrator: &str) -> Bench {
    let (half, far) = (30f64.to_radians(), 20.0);
    let edge = passage.point[1] + (passage.angle + turn).tan() * (far - passage.point[0]);
    let (x, y) = (2.0 * half.sin(), 2.0 * half.cos());
    bench(&format!(
        "integrator: {integrator}\nmaterials: {{glass: {{dielectric: {{ior: {{glass: N-BK7}}}}}}}}\nshapes:\n\
         - rectangle: {{corner: [0, 0, 1], edge_u: [0, 0, -2], edge_v: [-{x}, -{y}, 0], material: glass}}\n\
         - rectangle: {{corner: [0, 0, -1], edge_u: [0, 0, 2], edge_v: [{x}, -{y}, 0], material: glass}}\n\
         - rectangle: {{corner: [{far}, {edge}, -1], edge_u: [0, -2, 0], edge_v: [0, 0, 2], {LAMP}}}\n"
    ))
}

/// Light that meets the left face one metre below the edge, `incidence` from its normal, which points
/// 30° above the horizon, leftward.
fn entering(incidence: f64) -> Ray {
    let half = 30f64.to_radians();
    let (upward, entry) = (incidence - half, DVec3::new(-half.sin(), -half.cos(), 0.0));
    let direction = DVec3::new(upward.cos(), upward.sin(), 0.0);
    Ray::new(entry - direction, direction)
}

/// The leaving ray's angle agrees with Snell's law by hand to a millionth of a radian, at eight
/// wavelengths: a lamp whose edge is that much above the ray is seen, one that much below is not.
#[test]
fn a_prism_turns_each_wavelength_by_snells_law() {
    let incidence = 50f64.to_radians();
    let ray = entering(incidence);
    for nm in [380.0, 404.6561, 486.1327, 546.074, 587.5618, 656.2725, 706.5188, 820.0] {
        let passage = through_the_prism(bk7(nm), incidence);
        for (turn, expected) in [(1e-6, passage.transmitted), (-1e-6, 0.0)] {
            let prism = prism(&passage, turn, "{whitted: {}}");
            let light = prism.incoming(&ray, &wavelengths([nm; 8]), &Sampler::new(0, [0, 0], 0, 0)).radiance;
            let found = f64::from(light.to_array()[0]);
            assert!((found - expected).abs() < 1e-6, "{nm} nm, {turn}: expected {expected}, found {found}");
        }
    }
}

/// Eight wavelengths at once, and a lamp that only those bent least can see: each lane is lit or dark by
/// its own index. The path tracer's lanes follow their hero; its mean over lanes and heroes is the same.
#[test]
fn wavelengths_of_one_path_part_in_a_prism() {
    let incidence = 50f64.to_radians();
    let nm = [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0];
    let ray = entering(incidence);

    // Long wavelengths are bent less and pass higher: the edge lies at the angle of 575 nm.
    let edge = through_the_prism(bk7(575.0), incidence);
    let expected = nm.map(|nm| if nm < 575.0 { through_the_prism(bk7(nm), incidence).transmitted } else { 0.0 });
    let whitted = prism(&edge, 0.0, "{whitted: {}}");
    let light = whitted.incoming(&ray, &wavelengths(nm), &Sampler::new(0, [0, 0], 0, 0)).radiance.to_array();
    for k in 0..8 {
        assert!((f64::from(light[k]) - expected[k]).abs() < 1e-6, "{} nm: {light:?}, {expected:?}", nm[k]);
    }

    // The path tracer, each wavelength leading in turn: the sum over heroes of what each wavelength brings,
    // whichever lane it stood in.
    let path = prism(&edge, 0.0, "path");
    assert!(path.prepared.plan.chromatic);
    let n = 512;
    let mut sums = [0.0; 8];
    for hero in 0..8 {
        let rotated: [f64; 8] = std::array::from_fn(|k| nm[(k + hero) % 8]);
        for index in 0..n {
            let sampler = Sampler::new(5, [0, 0], hero as u32, index);
            let light = path.incoming(&ray, &wavelengths(rotated), &sampler).radiance.to_array();
            for k in 0..8 {
                sums[(k + hero) % 8] += f64::from(light[k]) / f64::from(n) / 8.0;
            }
        }
    }
    for k in 0..8 {
        // A wavelength comes through with p = 0.89 or not at all in each of the 512 paths it leads:
        // 4 √(0.89 · 0.11 / 512) = 0.055; one that misses the lamp never sees it.
        let tolerance = if expected[k] > 0.0 { 0.055 } else { 0.0 };
        assert!((sums[k] - expected[k]).abs() <= tolerance, "{} nm: expected {expected:?}, found {sums:?}", nm[k]);
    }
}

/// Light of a lamp through a ball of ground flint and from it: what all eight wavelengths carry along the paths of one,
/// with the densities of each, is band by band what a glass of that band's index sends. Bands of 20 nm, over which the
/// index runs by ±0.3 % at 450 nm and less above: far below the noise of a picture's mean.
#[test]
fn ground_flint_is_in_each_band_the_glass_of_its_index() {
    const BANDS: [f64; 4] = [450.0, 520.0, 590.0, 680.0];
    let means = |ior: &str| -> Vec<Moments> {
        let mut all = vec![Vec::new(); BANDS.len()];
        for seed in 0..8 {
            let bands: String = (0..)
                .zip(BANDS)
                .map(|(i, nm)| {
                    let (low, high) = (nm - 10.0, nm + 10.0);
                    format!("  - {{name: b{i}, response: {{table: [[{low}, 1], [{high}, 1]]}}}}\n")
                })
                .collect();
            let frame = render(&format!(
                "camera: {{origin: [0, 0, 4], target: [0, 0, 0], fov_deg: 32}}\n\
                 render: {{samples: 256, seed: {seed}, techniques: {{light_tracing: off}}}}\n\
                 image:\n  width: 12\n  height: 12\n  bands:\n{bands}\
                 shapes:\n\
                 - sphere: {{center: [0, 0, 0], radius: 1, material: {{dielectric: {{ior: {ior}, roughness: 0.2}}}}}}\n\
                 - rectangle: {{corner: [0, -1, -3], edge_u: [2, 0, 0], edge_v: [0, 2, 0], emission: 1}}\n"
            ));
            for (channel, means) in all.iter_mut().enumerate() {
                let pixels = frame.layer(channel);
                means.push(pixels.iter().map(|x| f64::from(*x)).sum::<f64>() / pixels.len() as f64);
            }
        }
        all.into_iter().map(|means| means.into_iter().collect()).collect()
    };
    let flint = catalogue::glass("SF11").unwrap();
    let together = means("{glass: SF11}");
    for (channel, nm) in BANDS.into_iter().enumerate() {
        let alone = &means(&flint.at(nm).to_string())[channel];
        let (a, b) = (&together[channel], alone);
        let error = a.standard_error().hypot(b.standard_error());
        // 8 seeds a side: |t| < 4 with 14 degrees of freedom is an α of 1.3e-3 a band.
        assert!((a.mean - b.mean).abs() < 4.0 * error, "{nm} nm: {} against {}, ± {error}", a.mean, b.mean);
        assert!(error < 0.02 * b.mean, "{nm} nm: {} ± {error}", b.mean);
    }
}

/// Where one wavelength leads, reflection at a smooth dispersive interface takes all eight along, each with its own
/// reflectance: by
/// Fresnel at 45°, with n = 1.5 to 1.9. Under an even sky, of paths of two segments only the reflected ones see light.
#[test]
fn a_reflection_keeps_all_eight_wavelengths() {
    let yaml = "integrator: {path: {max_depth: 2}}\n\
                render: {techniques: {light_tracing: off, packets: off}}\n\
                shapes:\n\
                - cube: {center: [0, -5, 0], size: 10, material: {dielectric: {ior: {table: [[360, 1.9], [830, 1.5]]}}}}\n\
                lights: [{constant: {radiance: 1}}]\n";
    let bench = bench(yaml);
    let nm = [390.0, 440.0, 490.0, 540.0, 590.0, 640.0, 690.0, 740.0];
    let ray = Ray::new(DVec3::new(0.0, 2.0, 2.0), DVec3::new(0.0, -1.0, -1.0).normalize());
    let n = 4096;
    let (mut sums, mut reflected) = ([0.0; 8], 0);
    for hero in 0..8 {
        let rotated: [f64; 8] = std::array::from_fn(|k| nm[(k + hero) % 8]);
        for index in 0..n {
            let light = bench.incoming(&ray, &wavelengths(rotated), &Sampler::new(5, [0, 0], hero as u32, index));
            let light = light.radiance.to_array();
            assert!(light.iter().all(|x| *x > 0.0) || light == [0.0; 8], "{light:?}");
            reflected += u32::from(light[0] > 0.0);
            for k in 0..8 {
                sums[(k + hero) % 8] += f64::from(light[k]) / f64::from(8 * n);
            }
        }
    }
    // Some 10 % of 32768 paths reflect, and each counts for every wavelength: √(0.9 / 3300) = 1.7 % standard error.
    assert!(reflected > 2000, "{reflected}");
    for k in 0..8 {
        let eta = 1.9 - 0.4 * (nm[k] - 360.0) / 470.0;
        let cos = 0.5f64.sqrt();
        let cos_t = (1.0 - 0.5 / (eta * eta)).sqrt();
        let (s, p) = ((cos - eta * cos_t) / (cos + eta * cos_t), (eta * cos - cos_t) / (eta * cos + cos_t));
        let expected = 0.5 * (s * s + p * p);
        assert!((sums[k] / expected - 1.0).abs() < 4.0 * 0.017, "{} nm: {} against {expected}", nm[k], sums[k]);
    }
}
