//! Each wavelength bends by its own index: a prism against Snell's law by hand.

use super::LAMP;
use super::common::{Bench, Estimate, bench, bench_with, wavelengths};
use super::pictures::{render, render_with};
use super::reuse::over_seeds;
use abbe::film::accumulate::REPLICATES;
use abbe::film::filter::Filter;
use abbe::film::resolve::{self, Splats};
use abbe::math::Ray;
use abbe::math::sampler::Sampler;
use abbe::math::statistics::Moments;
use abbe::spectrum::{ColourSpace, RefractiveIndex, WavelengthDistribution, catalogue};
use glam::DVec3;
use std::ops::Range;

/// N-BK7 by the three terms that Schott publishes, λ in µm.
fn bk7(nm: f64) -> f64 {
    let l2 = (nm * 1e-3).powi(2);
    let terms = [(1.039_612_12, 0.006_000_698_67), (0.231_792_344, 0.020_017_914_4), (1.010_469_45, 103.560_653)];
    (1.0 + terms.iter().map(|(b, c)| b * l2 / (l2 - c)).sum::<f64>()).sqrt()
}

/// Photons of a lamp of one narrow line, of wavelengths near the shared one, in and beside the line: what they bring is the light of a
/// glass that has the index of the line for all. Six pictures of each tell their means to some 0.4 %.
#[test]
fn photons_of_a_narrow_line_keep_its_light() {
    let scene = |ior: &str| {
        format!(
            "camera: {{origin: [2.2, 1.1, 0], target: [3, 0.75, 0], fov_deg: 40}}\nimage: {{width: 24, height: 24}}\n\
             integrator: {{path: {{max_depth: 6}}}}\nrender: {{samples: 32, techniques: {{merging: on}}}}\nshapes:\n\
             - rectangle: {{corner: [-1.5, 0, 1.5], edge_u: [3, 0, 0], edge_v: [0, 0, -3], material: {{diffuse: {{reflectance: 0.8}}}}}}\n\
             - sphere: {{center: [0, 0.7, 0], radius: 0.4, material: {{dielectric: {{ior: {ior}}}}}}}\n\
             - rectangle: {{corner: [3, 0.1, 1], edge_u: [0, 0, -2], edge_v: [0, 1.4, 0], material: {{two_sided: {{front: {{mirror: {{reflectance: 1}}}}}}}}}}\n\
             - sphere: {{center: [0, 4, 0], radius: 0.3, emission: {{lines: [{{nm: 589, power: 1000, width_nm: 1}}]}}}}\n"
        )
    };
    let n = catalogue::glass("N-SF11").unwrap().at(589.0);
    let [flint, one] = ["{glass: N-SF11}", &n.to_string()].map(|ior| over_seeds(bench_with(&scene(ior), &[]), 0..6).1);
    assert!((flint.mean / one.mean - 1.0).abs() < 0.02, "{flint:?} for {one:?}");
}

/// Behind a pane that parts wavelengths a ground plate shows the floor on which a ground ball of flint throws a lamp: one wavelength goes
/// on for all, and merges with photons of all. Four pictures of each tell their means to some 4 %.
#[test]
fn one_wavelength_that_goes_on_merges_for_all() {
    let scene = |packets: &str| {
        format!(
            "camera: {{origin: [0.8, 0.8, 2.9], target: [0, 0, 1.2], fov_deg: 6}}\nimage: {{width: 12, height: 12}}\n\
             render: {{samples: 32, techniques: {{light_tracing: on, merging: on, packets: {packets}}}}}\nshapes:\n\
             - cube: {{center: [0.73, 0.73, 2.75], size: [0.1, 0.1, 0.02], material: {{dielectric: {{ior: {{abbe: {{nd: 1.6, vd: 20}}}}}}}}}}\n\
             - rectangle: {{corner: [-3, 0, 4], edge_u: [6, 0, 0], edge_v: [0, 0, -4.5], material: {{diffuse: {{reflectance: 0.9}}}}}}\n\
             - sphere: {{center: [0, 0.5, 1.2], radius: 0.3, material: {{dielectric: {{ior: {{abbe: {{nd: 1.8, vd: 12}}}}, roughness: 0.005}}}}}}\n\
             - sphere: {{center: [0, 3, 1.2], radius: 0.4, emission: 5, material: {{diffuse: {{reflectance: 0}}}}}}\n\
             - cube: {{center: [0.6, 0.6, 2.45], size: [0.3, 0.3, 0.02], material: {{dielectric: {{ior: 1.5, roughness: 0.01}}}}}}\n"
        )
    };
    let [apart, packets] = ["off", "on"].map(|packets| over_seeds(bench_with(&scene(packets), &[]), 0..4).1);
    assert!((packets.mean / apart.mean - 1.0).abs() < 0.15, "{packets:?} for {apart:?}");
}

/// Case O28: the lines h, d and r of the data sheet, computed with 30 digits.
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

/// Bars of light behind a ball of flint: what comes of them in the ball's dark parts is rare and bright, and a good part of the noise.
/// That packets are worth it seldom depends on how much of it a trial happens to meet.
#[test]
fn packets_are_used_where_rare_light_makes_the_noise() {
    let bar = "edge_u: [0.06, 0, 0], edge_v: [0, 3.2, 0], emission: 2.2";
    let bars: String = (0..13)
        .map(|i| format!("- rectangle: {{corner: [{}, 0.3, -3], {bar}}}\n", -3.63 + 0.6 * f64::from(i)))
        .collect();
    let used = |seed: &u32| {
        let scene = format!(
            "camera: {{origin: [0, 1.6, 7], target: [0, 1.12, 0], fov_deg: 28}}\nimage: {{width: 360, height: 270}}\n\
             render: {{samples: 64, seed: {seed}, techniques: {{light_tracing: off}}}}\n\
             lights: [constant: {{radiance: 0.018}}]\nmaterials:\n  flint: {{dielectric: {{ior: {{glass: N-SF11}}}}}}\n  \
             dark: {{plastic: {{reflectance: 0.03, ior: 1.5}}}}\nshapes:\n\
             - plane: {{normal: [0, 1, 0], material: dark}}\n\
             - sphere: {{center: [0, 1.2, 0], radius: 1.2, material: flint}}\n{bars}"
        );
        bench_with(&scene, &[]).prepared.plan.packets
    };
    assert!((1..=4).filter(used).count() >= 3);
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
        for seed in 0..6 {
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

/// A parallel beam through the prism onto a wall, in sixteen bands of 20 nm: each band lies where Snell's law puts it and
/// nowhere else, with the power that Fresnel's equations leave it.
///
/// Light of wavelength λ that enters s metres below the edge comes to the height y = s p_y + tan α (x − s p_x) on the wall at x,
/// with p and α of [`through_the_prism`]; s runs over a beam of width w by w / cos i, evenly, so that the middle of its light is
/// y at s = 1. A band has power Σ T(λ) over its wavelengths, and its middle is the mean of y with the weights T.
#[test]
fn each_band_behind_a_prism_lies_where_snells_law_puts_it() {
    const BANDS: usize = 16;
    const ROWS: usize = 256;
    const COLUMNS: usize = 4;
    let (incidence, wall, beam, depth) = (50f64.to_radians(), 3.0, 0.004, 0.001);
    let ends = |k: usize| [400.0 + 20.0 * k as f64, 420.0 + 20.0 * k as f64];
    let height = |nm: f64, s: f64| {
        let passage = through_the_prism(bk7(nm), incidence);
        s * passage.point[1] + passage.angle.tan() * (wall - s * passage.point[0])
    };
    let half = 30f64.to_radians();
    let (x, y) = (2.0 * half.sin(), 2.0 * half.cos());
    let Ray { origin, direction, .. } = entering(incidence);
    // Across the beam, in the plane of the prism: the lamp's edges are this way and along z.
    let across = DVec3::new(-direction.y, direction.x, 0.0);
    let corner = origin - across * (0.5 * beam) - DVec3::Z * (0.5 * depth);
    let (low, high) = (height(ends(0)[0], 1.0), height(ends(BANDS - 1)[1], 1.0));
    let (middle, tall) = (0.5 * (low + high), 1.2 * (high - low));
    let responses: String = (0..BANDS)
        .map(|k| {
            let [a, b] = ends(k);
            format!("  - {{name: b{k}, response: {{table: [[{a}, 1], [{b}, 1]]}}}}\n")
        })
        .collect();
    let scene = |seed: u32| {
        bench_with(
            &format!(
                "camera: {{origin: [2.9, {middle}, 0], target: [3, {middle}, 0], orthographic_height: {tall}}}\n\
                 image:\n  width: {COLUMNS}\n  height: {ROWS}\n  bands:\n{responses}\
                 render: {{samples: 8, seed: {seed}, techniques: {{light_tracing: on}}}}\n\
                 materials: {{glass: {{dielectric: {{ior: {{glass: N-BK7}}, exterior_ior: 1}}}}}}\nshapes:\n\
                 - rectangle: {{corner: [0, 0, 1], edge_u: [0, 0, -2], edge_v: [-{x}, -{y}, 0], material: glass}}\n\
                 - rectangle: {{corner: [0, 0, -1], edge_u: [0, 0, 2], edge_v: [{x}, -{y}, 0], material: glass}}\n\
                 - rectangle: {{corner: [{wall}, -3, -1], edge_u: [0, 0, 2], edge_v: [0, 6, 0],\n   \
                     material: {{diffuse: {{reflectance: 0.5}}}}}}\n\
                 - rectangle: {{corner: [{}, {}, {}], edge_u: [{}, {}, 0], edge_v: [0, 0, {depth}], emission: 1,\n   \
                     emission_direction: normal, material: {{diffuse: {{reflectance: 0}}}}}}\n",
                corner.x,
                corner.y,
                corner.z,
                beam * across.x,
                beam * across.y,
            ),
            &[],
        )
    };
    let mut power: [Moments; BANDS] = std::array::from_fn(|_| Moments::default());
    let mut place: [Moments; BANDS] = std::array::from_fn(|_| Moments::default());
    let pixel = tall / ROWS as f64;
    for seed in 0..6 {
        let bench = scene(seed);
        assert!(bench.prepared.plan.caustics.is_some(), "light is traced");
        let frame = render_with(&bench, Filter::Box, 32);
        for k in 0..BANDS {
            let plane = frame.layer(k);
            let [a, b] = ends(k).map(|nm| height(nm, 1.0));
            let spread = 0.5 * beam / incidence.cos();
            let reach = [height(ends(k)[0], 1.0 + spread), height(ends(k)[1], 1.0 - spread)];
            assert!(reach[0] < a && a < b && b < reach[1]);
            let (mut sum, mut moment) = (0.0, 0.0);
            for (row, pixels) in plane.chunks(COLUMNS).enumerate() {
                let light: f64 = pixels.iter().map(|x| f64::from(*x)).sum();
                let y = middle + (0.5 * ROWS as f64 - 0.5 - row as f64) * pixel;
                // A row that the beam does not touch, by a hundredth of its height for the camera's rounding, is black.
                if y + 0.51 * pixel < reach[0] || y - 0.51 * pixel > reach[1] {
                    assert_eq!(light, 0.0, "band {k}, row {row}");
                }
                sum += light;
                moment += light * y;
            }
            power[k].push(sum * pixel * pixel);
            place[k].push(moment / sum);
        }
    }
    for k in 0..BANDS {
        let [a, b] = ends(k);
        let (mut weight, mut moment) = (0.0, 0.0);
        for i in 0..200 {
            let nm = a + (b - a) * (f64::from(i) + 0.5) / 200.0;
            let t = through_the_prism(bk7(nm), incidence).transmitted;
            weight += t / 200.0;
            moment += t / 200.0 * height(nm, 1.0);
        }
        // Radiance of a white wall of 0.5 under the beam, over all of its area: ρ / π · emission · area · Δλ · T.
        let expected = 0.5 / std::f64::consts::PI * beam * depth * (b - a) * weight;
        let (found, error) = (power[k].mean, power[k].standard_error());
        assert!(
            (found - expected).abs() < 4.0 * error && error < 5e-3 * expected,
            "band {k}: {found} ± {error}, {expected}"
        );
        // Within a row light is spread evenly but for the slopes at the band's ends: a twentieth of a row.
        let (found, error, expected) = (place[k].mean, place[k].standard_error(), moment / weight);
        let off = (found - expected).abs();
        assert!(
            off < 4.0 * error + 0.05 * pixel && error < 0.05 * pixel,
            "band {k}: {found} ± {error}, {expected}, row {pixel}"
        );
    }
}

/// How many wavelengths go together changes the noise, never the mean: a ball of flint before a lamp and a diffuse floor under
/// it, from the camera with and without packets, with light traced from the lamp, and with merged photons. Red and blue by
/// themselves: a lane that counts too much shows there first. Merging blurs alike, whatever the wavelengths.
#[test]
fn any_number_of_wavelengths_a_path_finds_the_same_light() {
    let scene = |techniques: &str, seed: u64| {
        format!(
            "camera: {{origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}}\nimage: {{width: 8, height: 8}}\n\
             render: {{samples: 256, seed: {seed}, techniques: {{{techniques}}}}}\nshapes:\n\
             - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: {{rgb: [0.7, 0.5, 0.2]}}}}}}}}\n\
             - sphere: {{center: [0, 1, 0], radius: 1, material: {{dielectric: {{ior: {{glass: N-SF11}}}}}}}}\n\
             - sphere: {{center: [1, 3, -1], radius: 0.7, emission: {{illuminant: D65}}}}\n"
        )
    };
    let light = |techniques: &str, change: &dyn Fn(&WavelengthDistribution) -> WavelengthDistribution| {
        let [red, _, blue] = rgb_over_seeds(0..6, |seed| {
            let mut bench = bench_with(&scene(techniques, seed), &[]);
            bench.prepared.scene.wavelengths = change(&bench.prepared.scene.wavelengths);
            bench
        });
        [red, blue]
    };
    for techniques in [
        "packets: off, light_tracing: off",
        "packets: on, light_tracing: off",
        "packets: on, light_tracing: on, merging: off",
        "packets: off, light_tracing: on, merging: on",
    ] {
        let eight = light(techniques, &|w| w.clone());
        let one = light(techniques, &|w| w.with_count(1));
        let four = light(techniques, &|w| w.with_count(4));
        let turned = light(techniques, &|w| w.half_a_step_on());
        for (c, eight) in eight.iter().enumerate() {
            one[c].assert_agrees(eight, 0.035);
            four[c].assert_agrees(eight, 0.035);
            turned[c].assert_agrees(eight, 0.035);
        }
    }
}

/// Red, green and blue of the mean pixel, by the replicates of all `seeds`.
fn rgb_over_seeds(seeds: Range<u64>, bench: impl Fn(u64) -> Bench) -> [Estimate; 3] {
    let mut all = [Moments::default(); 3];
    for seed in seeds {
        let frame = bench(seed).frame();
        assert_eq!(frame.film.invalid.total(), 0, "seed {seed}");
        let splats = frame.splats.as_ref().map(|s| Splats { film: &s.film, photons: s.paths });
        let pixels = resolve::replicates(&frame.film, splats, &ColourSpace::Rec709.matrix_from_xyz());
        for replicate in 0..REPLICATES {
            for (c, sum) in all.iter_mut().enumerate() {
                sum.push(pixels.iter().flatten().map(|p| p[replicate][c]).sum::<f64>() / pixels.len() as f64);
            }
        }
    }
    all.map(|m| Estimate { mean: m.mean, error: m.standard_error() })
}

/// The same of a scene without settings, by four seeds.
fn light(scene: &str, techniques: &str, samples: u32) -> [Estimate; 3] {
    rgb_over_seeds(0..4, |seed| {
        let render = format!("render: {{samples: {samples}, seed: {seed}, techniques: {{{techniques}}}}}\n");
        bench_with(&format!("{render}{scene}"), &[])
    })
}

/// Before wavelengths part at smooth glass one of them has led, and others might have with other densities: through coloured smoke, and
/// where ground glass parts colours. What each carries on from there counts that, as does whichever goes on for all, and all that are
/// reflected alike. In smoke that only scatters light is even everywhere. With ground and smooth glass that overlap, and where
/// wavelengths that parted meet again before they are ground and part once more, packets find what single wavelengths find: 1.5 times the
/// blue, light without bound and 2.5 times as much came before.
#[test]
fn what_has_led_to_where_wavelengths_part_counts_beyond() {
    let even = "camera: {origin: [0, 0, 3], target: [0, 0, 0], fov_deg: 12}\nimage: {width: 8, height: 8}\n\
                lights: [constant: {radiance: 1}]\n";
    let smoke = format!(
        "{even}medium: smoke\n\
         media: {{smoke: {{homogeneous: {{scattering: {{table: [[400, 0.05], [500, 0.3], [600, 1.5], [700, 3]]}}}}}}}}\n\
         shapes:\n\
         - sphere: {{radius: 4, material: {{boundary: {{}}}}, inside: smoke, outside: vacuum}}\n\
         - sphere: {{radius: 0.5, material: {{dielectric: {{ior: {{glass: N-SF11}}}}}}, inside: vacuum, outside: smoke}}\n"
    );
    let overlapping = "camera: {origin: [0, 1.6, 3.8], target: [0, 0.5, 0], fov_deg: 30}\nimage: {width: 12, height: 12}\n\
         lights: [directional: {direction: [0.2, -1, -0.1], irradiance: 1, angle_deg: 15}]\nshapes:\n\
         - rectangle: {corner: [-4, 0, 4], edge_u: [8, 0, 0], edge_v: [0, 0, -8]}\n\
         - sphere: {center: [0.2, 0.6, 0], radius: 0.3, \
           material: {dielectric: {ior: {abbe: {nd: 1.83, vd: 50}}, priority: 4}}}\n\
         - sphere: {center: [-0.2, 0.6, 0], radius: 0.3, \
           material: {dielectric: {ior: 1.6449, roughness: 0.0094, priority: 5}}}\n";
    let white = "material: {diffuse: {reflectance: 1}}";
    let flint = "ior: {abbe: {nd: 1.8, vd: 12}}";
    let tray = format!(
        "camera: {{origin: [0, 2.2, 1.4], target: [0, 3, 0], fov_deg: 70}}\nimage: {{width: 8, height: 8}}\n\
         integrator: {{path: {{max_depth: null}}}}\n\
         lights: [spot: {{position: [1.2, 2.2, 0], direction: [-1.1, -0.7, 0], cutoff_deg: 15, intensity: 10}}]\nshapes:\n\
         - disk: {{center: [0, 0, 0], normal: [0, 1, 0], radius: 1.5, {white}}}\n\
         - disk: {{center: [0, 3, 0], normal: [0, -1, 0], radius: 1.5, {white}}}\n\
         - cube: {{center: [0, 1.5, 0], size: [4, 0.2, 4], material: {{dielectric: {{{flint}, roughness: 0.005}}}}}}\n\
         - cube: {{center: [0, 1.0, 0], size: [4, 0.2, 4], material: {{dielectric: {{{flint}}}}}}}\n\
         - rectangle: {{corner: [-1.2, 0, -1.2], edge_u: [2.4, 0, 0], edge_v: [0, 0.9, 0], {white}}}\n\
         - rectangle: {{corner: [1.2, 0, 1.2], edge_u: [-2.4, 0, 0], edge_v: [0, 0.9, 0], {white}}}\n\
         - rectangle: {{corner: [-1.2, 0, 1.2], edge_u: [0, 0, -2.4], edge_v: [0, 0.9, 0], {white}}}\n\
         - rectangle: {{corner: [1.2, 0, -1.2], edge_u: [0, 0, 2.4], edge_v: [0, 0.9, 0], {white}}}\n"
    );
    for (scene, techniques, samples, other, of_other, error) in [
        (smoke.as_str(), "packets: on", 512, even, "packets: on", 0.03),
        (overlapping, "packets: on, merging: off", 128, overlapping, "packets: off, merging: off", 0.02),
        (
            &tray,
            "packets: on, light_tracing: on, merging: off",
            512,
            &tray,
            "packets: off, light_tracing: on, merging: off",
            0.2,
        ),
    ] {
        let [found, expected] = [light(scene, techniques, samples), light(other, of_other, samples)];
        for (found, expected) in found.iter().zip(&expected) {
            found.assert_agrees(expected, error);
        }
    }
}

/// Depth fog fades what is seen through a pane as it fades the pane, in packets, too: the floor under a ball of flint, where its caustic
/// is, was faded as far as the floor itself is: 0.82 of the light of this picture.
#[test]
fn depth_fog_fades_packets_behind_a_pane_as_the_pane() {
    let scene = "camera: {origin: [0, 2.2, 4], target: [0, 0, 0.4], fov_deg: 12}\nimage: {width: 8, height: 8}\n\
         fog: {colour: 0, density: 0.5, falloff: exp}\n\
         lights: [directional: {direction: [0.2, -1, -0.1], irradiance: 3, angle_deg: 20}]\nshapes:\n\
         - rectangle: {corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: {diffuse: {reflectance: 0.8}}}\n\
         - sphere: {center: [0, 1, 0.4], radius: 0.45, material: {dielectric: {ior: {abbe: {nd: 1.7, vd: 15}}}}}\n\
         - rectangle: {corner: [-3, 0.5, 3], edge_u: [6, 0, 0], edge_v: [0, 3, 0], material: {thin_dielectric: {ior: 1.5}}}\n";
    let packets = light(scene, "packets: on, light_tracing: on, merging: off", 128);
    let alone = light(scene, "packets: off, light_tracing: on, merging: off", 128);
    for (packets, alone) in packets.iter().zip(&alone) {
        packets.assert_agrees(alone, 0.02);
    }
}

/// A near-mirror shows a surface that throws half of its light and scatters the rest, and mirrors a panel before a sun. That the surface would
/// have thrown the sun takes no light from what the panel gets of the sky by shadow rays: 0.9 of it was there.
#[test]
fn what_hides_a_sun_in_a_coat_is_as_bright_as_without_light_tracing() {
    let scene = "camera: {origin: [0, 1.26, -1.5], target: [0, 1.26, 1.06], fov_deg: 8}\nimage: {width: 8, height: 8}\n\
         lights: [sky: {sun: {elevation_deg: 45}, sun_angle_deg: 12}]\nshapes:\n\
         - rectangle: {corner: [-0.3, 1.537, 0.945], edge_u: [0.6, 0, 0], edge_v: [0, -0.5544, 0.2298], \
           material: {principled: {base_color: 0.9, metallic: 1, roughness: 0.1}}}\n\
         - cube: {center: [0, 0.1, 0], size: [2, 0.2, 2], \
           material: {blend: {weight: 0.5, first: {mirror: {}}, second: {diffuse: {reflectance: 0.2}}}}}\n\
         - rectangle: {corner: [-5, 0.42, -3.32], edge_u: [10, 0, 0], edge_v: [0, 4, 4], material: {diffuse: {reflectance: 0.9}}}\n";
    let traced = light(scene, "light_tracing: on, merging: off", 256);
    let alone = light(scene, "light_tracing: off", 256);
    for (traced, alone) in traced.iter().zip(&alone) {
        traced.assert_agrees(alone, 0.015);
    }
}
