//! Smooth glass: what it splits, bends and traps.

use super::common::{Bench, SPREAD_NM, assert_close, bench, bench_with, ray, v, wavelengths};
use super::pictures::{PARALLEL, render};
use super::{LAMP, across_the_unit_sphere, assert_invisible_in_every_sample, in_even_light};
use abbe::math::Ray;
use abbe::math::sampler::Sampler;
use abbe::math::statistics::Moments;
use abbe::optics::fresnel::{self, Model};
use glam::DVec3;

/// Radiance is conserved along rays but for 1/η², which is paid on the way in and returned on the way
/// out: clear bodies in even light are invisible, in every pixel and sample, whatever their shape.
#[test]
fn clear_bodies_in_even_light_are_invisible_in_every_pixel() {
    let bodies = [
        "[{sphere: {radius: 1, material: {dielectric: {ior: 1.5}}}}]",
        "[{sphere: {radius: 1, material: {dielectric: {ior: 2.4}}}}]",
        "[{cube: {size: 1.2, material: {dielectric: {ior: 1.5}}, transform: [{rotate: {axis: [1, 2, 3], deg: 40}}]}}]",
        "[{cube: {size: 1.2, material: {dielectric: {ior: 2.4}}, transform: [{rotate: {axis: [1, 2, 3], deg: 40}}]}}]",
        // A bubble of air in glass, and one that its index leaves no room for light at its rim.
        "[{sphere: {radius: 1, material: {dielectric: {ior: 1.5}}}}, \
          {sphere: {radius: 0.7, material: {dielectric: {ior: 1, exterior_ior: 1.5}}}}]",
        "[{sphere: {radius: 1, material: {dielectric: {ior: 0.5}}}}]",
        "[{cylinder: {base: [0, -0.6, 0], top: [0, 0.6, 0], radius: 0.6, material: {dielectric: {ior: 1.5}}}}]",
        "[{cone: {base: [0, -0.6, 0], apex: [0, 0.8, 0], radius: 0.6, material: {dielectric: {ior: 1.5}}}}]",
        "[{sphere: {radius: 1, material: {thin_dielectric: {ior: 1.5}}}}]",
        "[{sphere: {radius: 1, material: {dielectric: {ior: 1.5, fresnel: schlick}}}}]",
        // Glass in water in air.
        "[{sphere: {radius: 1, material: {dielectric: {ior: 1.33}}}}, \
          {cube: {size: 0.8, material: {dielectric: {ior: 1.5, exterior_ior: 1.33}}}}]",
    ];
    for body in bodies {
        in_even_light(body).grey().picture().assert_all(1.0, 2e-5);
    }
}

/// The same for glass whose index depends on wavelength: the lanes part, and what they carry is divided
/// by the sum of the densities with which each could have led, so Σ over lanes stays 8 in every sample.
#[test]
fn dispersive_bodies_in_even_light_are_invisible_in_every_sample() {
    for body in [
        "[{sphere: {radius: 1, material: {dielectric: {ior: {glass: N-SF11}}}}}]",
        "[{cube: {size: 1.2, material: {dielectric: {ior: {glass: diamond}}}}}]",
    ] {
        assert_invisible_in_every_sample(body);
    }
}

/// The recursive tracer follows all branches, so its energy is whole up to the branches it gives up:
/// those with a share below 2⁻¹⁶, and those deeper than `max_depth`.
#[test]
fn whitted_conserves_energy_in_glass_up_to_what_it_gives_up() {
    let scene = bench(
        "shapes: [{sphere: {radius: 1, material: {dielectric: {ior: 1.5}}}}]\n\
         lights: [{constant: {radiance: 1}}]\nintegrator: {whitted: {max_depth: 64}}\n",
    );
    for (from, to) in across_the_unit_sphere() {
        // Each level gives up one branch of at most 2⁻¹⁶.
        let lost = 1.0 - scene.look(from, to);
        assert!((-1e-5..65.0 / 65536.0).contains(&lost), "at {to}: lost {lost}");
    }
}

/// A chequered wall behind a body that bends nothing.
fn before_a_wall(integrator: &str, body: &str) -> Bench {
    let text = format!(
        "integrator: {integrator}\ntextures: {{board: {{checkerboard: {{a: 0.2, b: 0.9, scale: [7, 7]}}}}}}\n\
         shapes:\n- rectangle: {{corner: [-2, -2, -2], edge_u: [4, 0, 0], edge_v: [0, 4, 0], \
         emission: {{texture: board}}, material: {{diffuse: {{reflectance: 0}}}}}}\n{body}\n"
    );
    bench(&text)
}

/// η = 1 reflects nothing and bends nothing, whatever the shape, alone or in its own medium.
#[test]
fn a_body_of_the_index_around_it_is_invisible() {
    let bodies = [
        "- sphere: {radius: 1, material: {dielectric: {ior: 1}}}",
        "- sphere: {radius: 1, material: {dielectric: {ior: 1.33, exterior_ior: 1.33}}}",
        "- cube: {size: 1, material: {dielectric: {ior: 1, roughness: 0.5}}}",
        "- cone: {base: [0, -1, 0], apex: [0, 1, 0], radius: 1, material: {thin_dielectric: {ior: 1}}}",
    ];
    for integrator in ["path", "{whitted: {}}"] {
        let bare = before_a_wall(integrator, "");
        for body in bodies {
            let veiled = before_a_wall(integrator, body);
            for (from, to) in across_the_unit_sphere() {
                let from = from + v(0.01, 0.13, 0.0);
                assert_eq!(bare.lanes(&ray(from, to)), veiled.lanes(&ray(from, to)), "{integrator} {body} {to}");
            }
        }
    }
}

/// Glass in a bowl of water: at its edge only η = 1.5 / 1.33 counts. A ray at 45° from water bends to
/// asin(1.33 sin 45° / 1.5) = 38.827°; where it then goes is told by a lamp whose edge lies there.
#[test]
fn glass_in_water_bends_by_the_ratio_of_both_indices() {
    let inside = (1.33 * 45f64.to_radians().sin() / 1.5).asin();
    assert_close(inside.to_degrees(), 38.826_78, 1e-6);
    let split = fresnel::dielectric(Model::Exact, 45f64.to_radians().cos(), 1.5 / 1.33);
    for (side, lit) in [(1e-6, true), (-1e-6, false)] {
        // The face is y = 0, glass below; the lamp lies at y = −1 and reaches up to x = tan θ' ± 1e-6.
        let x = inside.tan() + side;
        let scene = bench(&format!(
            "integrator: {{whitted: {{}}}}\nshapes:\n\
             - rectangle: {{corner: [-9, 0, 9], edge_u: [18, 0, 0], edge_v: [0, 0, -18], \
               material: {{dielectric: {{ior: 1.5, exterior_ior: 1.33}}}}}}\n\
             - rectangle: {{corner: [{}, -1, 1], edge_u: [0.5, 0, 0], edge_v: [0, 0, -2], {LAMP}}}\n",
            x - 0.5
        ));
        let found = scene.look(v(-1.0, 1.0, 0.0), v(0.0, 0.0, 0.0));
        let expected = if lit { split.transmitted / (1.5f64 / 1.33).powi(2) } else { 0.0 };
        assert!((found - expected).abs() < 1e-6, "{side}: expected {expected}, found {found}");
    }
}

/// Case O15: a lamp of radius 1 in a shell of glass 4e-5 thick. The lamp lies in glass; of its light 96 %
/// come out at the middle, spread over n² times the solid angle: (1 − 0.04) L / 1.5².
#[test]
fn a_lamp_in_a_skin_of_glass_shows_what_the_skin_lets_through() {
    for integrator in ["path", "{whitted: {}}"] {
        let scene = bench(&format!(
            "integrator: {integrator}\nshapes:\n- sphere: {{radius: 1, {LAMP}}}\n\
             - sphere: {{radius: 1.00004, material: {{dielectric: {{ior: 1.5}}}}}}\n"
        ));
        let expected = (1.0 - 0.04) / 2.25;
        if integrator == "path" {
            scene.estimate(&ray(v(0.0, 0.0, 5.0), v(0.0, 0.0, 0.0)), 4096).assert_is(expected, 1e-2);
        } else {
            assert_close(scene.look(v(0.0, 0.0, 5.0), v(0.0, 0.0, 0.0)), expected, 1e-6);
        }
    }
}

/// A block of glass (1.5) and inside it a lamp. A ray from the middle meets the face x = 1 with
/// `sin` of its angle, and comes back to the lamp if it is reflected.
fn block(sin: f64, integrator: &str) -> (Bench, Ray) {
    let cos = (1.0 - sin * sin).sqrt();
    let direction = DVec3::new(cos, sin, 0.0);
    // To the face and as far back again: x = 0, at twice the height.
    let height = 2.0 * sin / cos;
    let scene = bench(&format!(
        "integrator: {integrator}\nshapes:\n- cube: {{size: [2, 20, 2], material: {{dielectric: {{ior: 1.5}}}}}}\n\
         - sphere: {{center: [0, {height}, 0], radius: 0.1, {LAMP}}}\n"
    ));
    (scene, Ray::new(DVec3::ZERO, direction))
}

/// Beyond the critical angle, sin θ = 1/1.5, all light is reflected: every sample sees the lamp in full.
#[test]
fn total_internal_reflection_is_total() {
    for sin in [(1.0 + 1e-8) / 1.5, 0.7, 0.9] {
        let (scene, inside) = block(sin, "path");
        for index in 0..256 {
            let light = scene.incoming(&inside, &wavelengths(SPREAD_NM), &Sampler::new(0, [1, 1], 0, index));
            assert_eq!(light.radiance.to_array(), [1.0; 8], "sin {sin}, sample {index}");
        }
    }
}

/// A hair below it, some 10⁻³ of the light leaves: R by the formula in which nothing cancels, checked
/// against 1 − T.
#[test]
fn a_hair_below_the_critical_angle_some_light_leaves() {
    let sin: f64 = (1.0 - 1e-8) / 1.5;
    let split = fresnel::dielectric(Model::Exact, (1.0 - sin * sin).sqrt(), 1.0 / 1.5);
    assert!(split.transmitted > 1e-4 && (split.reflected + split.transmitted - 1.0).abs() < 1e-12, "{split:?}");
    let (scene, inside) = block(sin, "{whitted: {}}");
    let found = scene.look(inside.origin, inside.at(1.0));
    assert_close(found, split.reflected, 1e-6);
}

/// Schlick's formula and Fresnel's equations at 0°, 45°, 80° and 90°, for n = 1.5, through a material.
/// Exact, by hand from tan and sin of θ ∓ θ': 0.04, 0.050240, 0.387673, 1. Schlick: 0.04 + 0.96 (1 − cos θ)⁵.
#[test]
fn schlick_and_fresnel_differ_as_their_formulas_do() {
    let angles: [f64; 4] = [0.0, 45.0, 80.0, 90.0];
    let by_hand = |deg: f64| {
        let (i, t) = (deg.to_radians(), (deg.to_radians().sin() / 1.5).asin());
        if deg == 0.0 {
            return 0.04;
        }
        let (s, p) = ((i - t).sin() / (i + t).sin(), (i - t).tan() / (i + t).tan());
        0.5 * (s * s + p * p)
    };
    let schlick = |deg: f64| 0.04 + 0.96 * (1.0 - deg.to_radians().cos()).powi(5);
    assert_close(by_hand(45.0), 0.050_240, 1e-4);
    assert_close(by_hand(80.0), 0.387_673, 1e-4);
    for deg in angles {
        for (model, expected) in [("exact", by_hand(deg)), ("schlick", schlick(deg))] {
            // A pane facing +z under even light, and behind it a dark wall: only what is mirrored is seen.
            let scene = bench_with(
                &format!(
                    "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nintegrator: {{whitted: {{}}}}\n\
                     shapes:\n- rectangle: {{corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], \
                       material: {{dielectric: {{ior: 1.5, fresnel: {model}}}}}}}\n\
                     - rectangle: {{corner: [-99, -99, -0.5], edge_u: [198, 0, 0], edge_v: [0, 198, 0], \
                       material: {{diffuse: {{reflectance: 0}}}}}}\n\
                     lights: [{{constant: {{radiance: 1}}}}]\n"
                ),
                &[],
            );
            // At 90° exactly a ray misses the pane; a millionth of a degree before it R = 1 to 1e-7.
            let angle = deg.min(90.0 - 1e-6).to_radians();
            let from = 0.5 * v(angle.sin(), 0.0, angle.cos());
            let found = scene.look(from, v(0.0, 0.0, 0.0));
            assert!((found - expected).abs() < 2e-6, "{model} at {deg}°: expected {expected}, found {found}");
        }
    }
}

/// An index below 1 is that of a bubble, and is accepted; so is a high one.
#[test]
fn indices_below_one_and_far_above_are_accepted() {
    for ior in [0.9, 0.3, 5.0, 1.000_001] {
        let scene = in_even_light(&format!("[{{sphere: {{radius: 1, material: {{dielectric: {{ior: {ior}}}}}}}}}]"));
        scene.grey().picture().assert_all(1.0, 2e-5);
    }
}

/// A tetrahedron with the origin at a corner: (0, 0, 0), x, y and z.
#[test]
fn meshes_that_are_open_or_inside_out_are_told() {
    let outward = [[1, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 4]];
    let obj = |faces: &[[u32; 3]]| {
        let faces: String = faces.iter().map(|[a, b, c]| format!("f {a} {b} {c}\n")).collect();
        format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n{faces}")
    };
    let inward = outward.map(|[a, b, c]| [a, c, b]);
    let said = |faces: &[[u32; 3]], more: &str, what: &str| {
        let yaml = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 4, height: 4}}\n\
             media: {{mist: {{homogeneous: {{extinction: 1, albedo: 0.5}}}}}}\nshapes:\n- mesh: {{file: t.obj, {more}}}\n"
        );
        let notes = bench_with(&yaml, &[("t.obj", obj(faces).as_bytes())]).prepared.scene.notes.clone();
        notes.iter().filter(|note| note.contains(&format!("5:9: shapes[0].mesh: {what}"))).count()
    };
    let told = |faces: &[[u32; 3]], more: &str| said(faces, more, "it is closed, and its normals point inwards");
    let glass = "material: {dielectric: {ior: 1.5}}";
    assert_eq!((told(&inward, glass), told(&outward, glass)), (1, 0));
    assert_eq!(told(&inward, "material: {boundary: {}}, inside: mist"), 1);
    for more in [
        "material: {boundary: {}}",
        "material: {diffuse: {}}",
        "flip_normals: true, material: {dielectric: {ior: 1.5}}",
    ] {
        assert_eq!(told(&inward, more), 0, "{more}");
    }
    // Open, so that it has no inside; and one triangle that is wound the other way.
    assert_eq!(told(&inward[..3], glass), 0);
    for (faces, more, edges, times) in [
        (&outward[..3], glass, 3, 1),
        (&inward[..3], glass, 3, 1),
        (&[[1, 2, 3], [1, 2, 4], [1, 4, 3], [2, 3, 4]][..], glass, 6, 1),
        (&outward[..3], "material: {boundary: {}}, inside: mist", 3, 1),
        (&outward[..3], "material: {diffuse: {}}", 3, 0),
        (&outward[..], glass, 0, 0),
    ] {
        let what = format!("{edges} of its edges have no second triangle, wound the same way, on their other side");
        assert_eq!(said(faces, more, &what), times, "{faces:?} {more}");
    }
}

/// Ground glass in what has its own index leaves a sky as it is, but for what facets of roughness 0.1 hide from each other: 0.4 %
/// at each of two surfaces at the most (0.35 % of both at a ratio of 1 ± 1e-12). It was black. A tint of 0.9 lets 0.81 through.
#[test]
fn ground_glass_of_equal_indices_is_invisible() {
    let glass = "ior: {glass: N-BK7}, exterior_ior: {glass: N-BK7}";
    for (indices, expected) in [
        (glass, 1.0),
        ("ior: {table: [[350, 1.5], [850, 1.5]]}, exterior_ior: 1.5", 1.0),
        ("ior: 1.5, exterior_ior: 1.5, transmission_tint: 0.9", 0.81),
        ("ior: 1.5, exterior_ior: 1.5, film: {ior: 1.5, thickness_nm: 100}", 1.0),
        ("ior: 1.5, exterior_ior: 1.500000000000001", 1.0),
    ] {
        let frame = render(&format!(
            "{PARALLEL}render: {{samples: 64}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             image: {{width: 8, height: 8, bands: [{{name: all, response: 1}}]}}\n\
             shapes: [{{sphere: {{radius: 3, material: {{dielectric: {{{indices}, roughness: 0.1}}}}}}}}]\n"
        ));
        let found: Moments = frame.layer(0).iter().map(|x| f64::from(*x) / 470.0 / expected).collect();
        let (mean, error) = (found.mean, found.standard_error());
        let within = 0.992 - 4.0 * error..1.0 + 4.0 * error;
        assert!(within.contains(&mean) && error < 0.005, "{indices}: {mean} ± {error}");
    }
}
