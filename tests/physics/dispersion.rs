//! Each wavelength bends by its own index: a prism against Snell's law by hand.

use super::LAMP;
use super::common::{Bench, bench, wavelengths};
use abbe::math::Ray;
use abbe::math::sampler::Sampler;
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
