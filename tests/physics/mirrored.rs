//! Lamps that glass and the coats of plastics mirror: seen at every vertex, with the brightness that they are met with by chance.

use super::common::{Bench, SPREAD_NM, assert_close, bench_with, grey_png, ray, room, v, wavelengths};
use super::reuse::{assert_layers_add_up, assert_same_light, over_seeds};
use abbe::math::sampler::Sampler;
use abbe::optics::fresnel::{self, Model};

const LAMPS: &str = "- rectangle: {corner: [-0.6, 0.9, -0.6], edge_u: [1.2, 0, 0], edge_v: [0, 0, 1.2], emission: 3}\n\
                     - sphere: {center: [0.6, 0.3, -0.6], radius: 0.3, emission: {rgb: [8, 3, 1]}}\n";

/// Light from the camera's paths alone.
const ALONE: &str = "light_tracing: off";

fn seen(shapes: &str, before: &str, samples: u32, path: &str, techniques: &str) -> Bench {
    let yaml = format!(
        "camera: {{origin: [0, 0, 0.95], target: [0, -0.2, -1], fov_deg: 80}}\nimage: {{width: 20, height: 16}}\n\
         materials: {{chalk: {{diffuse: {{reflectance: 0.7}}}}}}\nintegrator: {{path: {{max_depth: 6, {path}}}}}\n\
         render: {{samples: {samples}, techniques: {{reuse: off, shadow_rays: 1, {techniques}}}}}\n\
         {before}{shapes}"
    );
    bench_with(&yaml, &[("sky.png", &grey_png(32, 16, |x, y| if (x, y) == (9, 4) { 255 } else { 1 }))])
}

/// A path without shadow rays does not look, and meets all lamps by chance.
#[test]
fn lamps_that_coats_and_glass_mirror_are_as_bright_as_by_chance() {
    let walls = room("material: {diffuse: {reflectance: 0.7}}");
    let ball = |x: f64, material: &str| {
        format!("- sphere: {{center: [{x}, -0.6, -0.3], radius: 0.4, material: {material}}}\n")
    };
    let coats = walls.clone()
        + &ball(-0.5, "{plastic: {reflectance: 0.3}}")
        + "- rectangle: {corner: [0.1, -0.9, -0.7], edge_u: [0, 0, 0.8], edge_v: [0.8, 0, 0], material: \
           {plastic: {ior: {glass: N-SF11}, reflectance: {rgb: [0.6, 0.2, 0.1]}}}}\n"
        + LAMPS;
    let glass = walls.clone()
        + &ball(-0.5, "{dielectric: {ior: {glass: N-SF11}}}")
        + &ball(0.5, "{dielectric: {ior: 1.5, film: {ior: 1.38, thickness_nm: 200}}}")
        + LAMPS;
    let behind = walls.clone()
        + &ball(-0.5, "{plastic: {reflectance: 0.3}}")
        + &ball(0.5, "{blend: {weight: 0.5, first: {dielectric: {ior: 1.5}}, second: chalk}}")
        + "- rectangle: {corner: [-0.9, 0, -0.9], edge_u: [1.8, 0, 0], edge_v: [0, 0, 1.8], material: \
           {thin_dielectric: {ior: 1.5}}}\n"
        + LAMPS;
    let bodies = walls.clone()
        + "- sphere: {center: [-0.5, -0.6, -0.3], radius: 0.4, material: {dielectric: {ior: 1.5, priority: 2}}}\n\
           - cube: {center: [0, -0.8, 0], size: [1.6, 0.4, 1.6], material: {dielectric: {ior: 1.33, priority: 1}}}\n"
        + LAMPS;
    // Lamps behind glass that is behind glass, through amber and by total reflection.
    let amber = walls.clone()
        + "- cube: {center: [-0.45, -0.55, -0.3], size: 0.7, material: {dielectric: {ior: 1.5}}, inside: amber, \
           transform: [{translate: [0.45, 0.55, 0.3]}, {rotate: {axis: [0.2, 1, 0.1], deg: 30}}, {translate: [-0.45, -0.55, -0.3]}]}\n"
        + &ball(0.5, "{dielectric: {ior: {glass: N-SF11}}}")
        + LAMPS;
    let open = "shapes:\n- plane: {point: [0, -1, 0], normal: [0, 1, 0], material: chalk}\n".to_owned()
        + &ball(-0.5, "{plastic: {reflectance: 0.3}}")
        + &ball(0.5, "{dielectric: {ior: 1.5}}");
    let sun = "lights: [{sky: {sun: {elevation_deg: 40, azimuth_deg: 20}, sun_angle_deg: 8}}]\n";
    let peak = "lights: [{environment: {file: sky.png, scale: 30}}]\n";
    let fog = "media: {fog: {homogeneous: {scattering: {rgb: [0.2, 0.5, 0.3]}, absorption: 0.1}}}\nmedium: fog\n";
    for (name, before, shapes, techniques, samples) in [
        ("coats", "", &coats, ALONE, [16, 64]),
        ("glass, packets", "", &glass, "light_tracing: off, packets: on", [16, 64]),
        ("glass, lane by lane", "", &glass, "light_tracing: off, packets: off", [64, 256]),
        ("a pane and a blend", "", &behind, ALONE, [16, 64]),
        ("bodies with a priority", "", &bodies, ALONE, [16, 64]),
        ("amber", "media: {amber: {homogeneous: {absorption: {rgb: [0.2, 0.6, 2]}}}}\n", &amber, ALONE, [16, 64]),
        ("fog", fog, &coats, ALONE, [64, 256]),
        ("a wide sun", sun, &open, ALONE, [64, 1024]),
        ("a bright texel", peak, &open, ALONE, [64, 1024]),
    ] {
        let looks = over_seeds(seen(shapes, before, samples[0], "", techniques), 0..24);
        let met = over_seeds(seen(shapes, before, samples[1], "light_samples: 0", techniques), 100..124);
        assert_same_light(name, &looks, &met);
    }
}

/// A block that does not part wavelengths lies on flint that does, and mirrors a lamp in that: the flint parts what comes back. Where wavelengths go
/// on from there side by side each meets the lamp at another place; at its edge it was counted for those that missed it, and met by
/// the others: 1.36 times the light, and 1.08 beside it.
#[test]
fn a_lamp_in_flint_that_other_glass_mirrors_is_counted_once() {
    let scene = |techniques: &str, samples: u32| {
        bench_with(
            &format!(
                "camera: {{origin: [0, 0.5, 0], target: [0.2887, 1, 0], fov_deg: 3, up: [0, 0, 1]}}\nimage: {{width: 16, height: 4}}\n\
                 integrator: {{path: {{max_depth: 4}}}}\nrender: {{samples: {samples}, techniques: {{{techniques}}}}}\nshapes:\n\
                 - cube: {{center: [0, 0.5, 0], size: [8, 1, 8], material: {{dielectric: {{ior: 1.5, priority: 2}}}}}}\n\
                 - cube: {{center: [0, -1, 0], size: [6, 3, 6], \
                   material: {{dielectric: {{ior: {{glass: N-SF11}}, priority: 1}}}}}}\n\
                 - rectangle: {{corner: [1.086, -0.5, 1], edge_u: [2, 0, 0], edge_v: [0, 0, -2], emission: 10, \
                   material: {{diffuse: {{reflectance: 0}}}}}}\n"
            ),
            &[],
        )
    };
    let packets = over_seeds(scene("light_tracing: off, packets: on", 256), 0..24);
    let alone = over_seeds(scene("light_tracing: off, packets: off", 256), 100..124);
    assert_same_light("flint under a block", &packets, &alone);
}

/// Between two planes of air in flint a lamp is seen by two reflections, totally by some of the eight wavelengths and by chance by others:
/// it had 1.02 times its light, 1.16 times where that differs most. And within glass a lamp lies before where some wavelengths go out
/// to another lamp, as the face is seen near the critical angle of the shortest: it had 0.92 times its light. By chance as by a path
/// without shadow rays.
#[test]
fn a_lamp_that_some_wavelengths_meet_without_chance_is_as_bright_as_by_chance() {
    let plane = |y: i32| {
        format!(
            "- plane: {{point: [0, {y}, 0], normal: [0, {}, 0], material: {{dielectric: {{ior: 1, exterior_ior: {{glass: N-SF11}}}}}}}}\n",
            if y > 0 { -1 } else { 1 }
        )
    };
    let lamp = |corner: &str, x: u32, z: u32| {
        format!(
            "- rectangle: {{corner: {corner}, edge_u: [{x}, 0, 0], edge_v: [0, 0, -{z}], emission: 1, \
             material: {{diffuse: {{reflectance: 0}}}}}}\n"
        )
    };
    let between = plane(0) + &plane(3) + &lamp("[3.2, 1, 4]", 3, 8);
    // In the middle indices from 1.8 on lead out to the lower lamp, at 65° to the normal and more.
    let within = "- cube: {center: [0, -1, 0], size: [40, 4, 40], \
                  material: {dielectric: {ior: {table: [[360, 1.9], [830, 1.5]]}}}}\n"
        .to_owned()
        + &lamp("[0, -1, 2]", 4, 4)
        + &lamp("[7.3, -5, 20]", 40, 40);
    for (name, camera, shapes) in [
        ("between", "origin: [0, 1, 0], target: [0.68, 0, 0], fov_deg: 4", &between),
        ("within", "origin: [0, 0, 0], target: [0.583, 1, 0], fov_deg: 2", &within),
    ] {
        let scene = |path: &str| {
            bench_with(
                &format!(
                    "camera: {{{camera}, up: [0, 0, 1]}}\nimage: {{width: 16, height: 2}}\nintegrator: {{path: {{{path}}}}}\n\
                     render: {{samples: 256, techniques: {{light_tracing: off, packets: off, glints: off}}}}\nshapes:\n{shapes}"
                ),
                &[],
            )
        };
        let looks = over_seeds(scene(""), 0..24);
        let met = over_seeds(scene("light_samples: 0"), 100..124);
        assert_same_light(name, &looks, &met);
    }
}

/// Over nothing glass sends back F L of a lamp that it mirrors, in every sample; by chance it was L or nothing.
#[test]
fn glass_over_nothing_mirrors_a_lamp_without_noise() {
    for eta in [1.33, 1.5, 2.4] {
        let bench = bench_with(
            &format!(
                "camera: {{origin: [0, 1, 3], target: [0, 0, 0], fov_deg: 5}}\nrender: {{techniques: {{light_tracing: off}}}}\n\
                 shapes:\n- rectangle: {{corner: [-5, 0, -5], edge_u: [0, 0, 10], edge_v: [10, 0, 0], material: {{dielectric: {{ior: {eta}}}}}}}\n\
                 - sphere: {{center: [0, 4, -12], radius: 3, emission: 2}}\n"
            ),
            &[],
        );
        let lamp = bench.lanes(&ray(v(0.0, 1.0, 3.0), v(0.0, 4.0, -12.0)));
        for i in 0..32 {
            let toward = ray(v(0.0, 1.0, 3.0), v(0.02 * f64::from(i) - 0.3, 0.0, 0.0));
            let reflected = fresnel::dielectric(Model::Exact, -toward.direction.y, eta).reflected;
            for index in 0..16 {
                let sampler = Sampler::new(3, [0, 0], 0, index);
                let light = bench.incoming(&toward, &wavelengths(SPREAD_NM), &sampler).radiance;
                for (found, lamp) in light.to_array().into_iter().zip(lamp) {
                    // Two roundings to f32.
                    assert_close(f64::from(found), reflected * lamp, 2.0 * f64::from(f32::EPSILON) * lamp);
                }
            }
        }
    }
}

/// A slab sends back F + T² F + T² F³ + … = 2 F / (1 + F) of a lamp: once F as it is, the rest out of the glass that mirrors it.
#[test]
fn a_slab_mirrors_a_lamp_as_the_series_of_its_reflections_says() {
    for (glass, eta) in [("1.5", 1.5), ("2.4", 2.4), ("{table: [[360, 1.8], [830, 1.8]]}", 1.8)] {
        let bench = bench_with(
            &format!(
                "camera: {{origin: [0, 1, 3], target: [0, 0, 0], fov_deg: 5}}\nrender: {{techniques: {{light_tracing: off}}}}\n\
                 shapes:\n- cube: {{center: [0, -0.05, 0], size: [20, 0.1, 20], material: {{dielectric: {{ior: {glass}}}}}}}\n\
                 - sphere: {{center: [0, 4, -12], radius: 3, emission: 2}}\n"
            ),
            &[],
        );
        let toward = ray(v(0.0, 1.0, 3.0), v(0.0, 0.0, 0.0));
        let reflected = fresnel::dielectric(Model::Exact, -toward.direction.y, eta).reflected;
        let lamp = bench.estimate(&ray(v(0.0, 1.0, 3.0), v(0.0, 4.0, -12.0)), 16).mean;
        bench.estimate(&toward, 1 << 16).assert_is(lamp * 2.0 * reflected / (1.0 + reflected), 1e-3);
    }
}

/// Layers of light change no bit of the picture, and add up to it.
#[test]
fn layers_of_mirrored_lamps_add_up_to_the_picture_that_they_leave_as_it_is() {
    let things = room("material: {diffuse: {reflectance: 0.7}}")
        + "- sphere: {center: [-0.4, -0.6, -0.3], radius: 0.4, material: {plastic: {}}, name: ball}\n\
           - sphere: {center: [0.5, -0.6, -0.3], radius: 0.4, material: {dielectric: {ior: 1.5}}}\n"
        + LAMPS;
    for techniques in [ALONE, "light_tracing: on"] {
        let parted = "layers: [emission, direct, indirect, caustic]\n";
        let of = |before: &str| seen(&things, before, 16, "", techniques);
        assert_layers_add_up(&of(""), &of(parted));
    }
}
