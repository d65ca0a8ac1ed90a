//! Bodies that overlap: the one of higher priority has the place.

use super::common::{CAMERA, SPREAD_NM, assert_close, bench, bench_with, ray, try_bench, v, wavelengths};
use super::pictures::{assert_agree, render_with};
use super::{LAMP, across_the_unit_sphere, assert_invisible_in_every_sample, in_even_light};
use abbe::batch::frame::Frame;
use abbe::film::filter::Filter;
use abbe::math::Ray;
use abbe::math::sampler::Sampler;
use glam::DVec3;

/// Clear bodies in even light are invisible, whatever overlaps with whatever, as in `glass`: in every pixel.
#[test]
fn clear_bodies_that_overlap_are_invisible_in_even_light() {
    let bodies = [
        // Three that share a place, in one another and beside each other.
        "[{sphere: {center: [-0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: 1.5, priority: 2}}}}, \
          {sphere: {center: [0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: 1.33, priority: 1}}}}, \
          {cube: {center: [0, 0.4, 0], size: 0.8, material: {dielectric: {ior: 2.4, priority: 3}}}}]",
        // Of one priority, of one index, and both.
        "[{sphere: {center: [-0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: 1.5, priority: 0}}}}, \
          {sphere: {center: [0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: 1.33, priority: 0}}}}, \
          {sphere: {center: [0, 0.5, 0], radius: 0.5, material: {dielectric: {ior: 1.5, priority: 0}}}}, \
          {sphere: {center: [0, -0.5, 0], radius: 0.5, material: {dielectric: {ior: 1.5, priority: -3}}}}]",
        // A hollow in glass is a body of index 1.
        "[{sphere: {radius: 1, material: {dielectric: {ior: 1.5, priority: 1}}}}, \
          {sphere: {center: [0.2, 0, 0], radius: 0.7, material: {dielectric: {ior: 1, priority: 2}}}}]",
        // The sea, half of a ball, and ice.
        "[{plane: {point: [0, -0.2, 0], normal: [0, 1, 0], material: {dielectric: {ior: 1.33, priority: 1}}}}, \
          {cube: {size: 1.1, material: {dielectric: {ior: 1.31, priority: 2}}, \
                  transform: [{rotate: {axis: [1, 2, 3], deg: 30}}]}}]",
    ];
    for body in bodies {
        let scene = in_even_light(body).grey();
        // Below the sea it is dark but for what comes from above.
        if !body.contains("plane") {
            scene.picture().assert_all(1.0, 2e-5);
        }
        assert!(scene.prepared.plan.nested);
    }
}

/// The same for indices that depend on wavelength, in every sample, as in `glass`.
#[test]
fn dispersive_bodies_that_overlap_are_invisible_in_even_light() {
    assert_invisible_in_every_sample(
        "[{sphere: {center: [-0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: {glass: N-SF11}, priority: 2}}}}, \
          {sphere: {center: [0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: {glass: water}, priority: 1}}}}]",
    );
}

/// A camera in a place that two bodies share is in the stronger. Radiance is n² times that outside, as 1/n² is paid on
/// the way in.
#[test]
fn a_camera_may_begin_where_bodies_overlap() {
    for (water, glass, n) in [(1, 2, 1.5f64), (2, 1, 1.33)] {
        let bodies = format!(
            "[{{sphere: {{center: [0.3, 0.5, 4.5], radius: 1, material: {{dielectric: {{ior: 1.33, priority: {water}}}}}}}}}, \
             {{cube: {{center: [0.3, 0.5, 5.5], size: 2, material: {{dielectric: {{ior: 1.5, priority: {glass}}}}}}}}}]"
        );
        in_even_light(&bodies).grey().picture().assert_all(n * n, 4e-5);
    }
    // Below the surface of a sea without end.
    let sea = "[{plane: {point: [0, 9, 0], normal: [0, 1, 0], material: {dielectric: {ior: 1.33, priority: 1}}}}]";
    let below = in_even_light(sea);
    assert_close(below.look(v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0)), 1.33f64.powi(2), 1e-5);
}

/// The six faces of a cube of half the side `r`, wound to face outward or inward, from vertex `first`.
fn cube(r: f64, first: usize, outward: bool) -> String {
    let mut text = String::new();
    for i in 0..8 {
        let side = |bit: i32| if i & bit == 0 { -r } else { r };
        text += &format!("v {} {} {}\n", side(1), side(2), side(4));
    }
    for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        let order = if outward { [0, 1, 2, 3] } else { [3, 2, 1, 0] };
        text += &format!("f {}\n", order.map(|k| (first + face[k]).to_string()).join(" "));
    }
    text
}

/// Water in a closed box of glass with walls of 0.1: once with surfaces that touch, where each says what is on its other
/// side, once with water that reaches halfway into the walls. The same picture of a chequered wall behind.
#[test]
fn water_that_reaches_into_glass_looks_like_water_that_touches_it() {
    let shell = cube(0.6, 1, true) + &cube(0.5, 9, false);
    let turn = "transform: [{rotate: {axis: [1, 2, 0.5], deg: 25}}]";
    let scene = |shapes: &str| {
        let text = format!(
            "{CAMERA}image: {{width: 6, height: 6}}\nrender: {{samples: 64, techniques: {{light_tracing: off}}}}\n\
             textures: {{board: {{checkerboard: {{a: 0.2, b: 0.9, scale: [5, 5]}}}}}}\nshapes:\n\
             - rectangle: {{corner: [-3, -3, -3], edge_u: [6, 0, 0], edge_v: [0, 6, 0], emission: {{texture: board}}, \
             material: {{diffuse: {{reflectance: 0}}}}}}\n{shapes}"
        )
        .replacen("image: {width: 8, height: 8}\n", "", 1)
        .replacen("fov_deg: 40", "fov_deg: 14", 1);
        bench_with(&text, &[("shell.obj", shell.as_bytes())]).grey().picture()
    };
    let touching = scene(&format!(
        "- cube: {{size: 1.2, material: {{dielectric: {{ior: 1.5}}}}, {turn}}}\n\
         - cube: {{size: 1, material: {{dielectric: {{ior: 1.33, exterior_ior: 1.5}}}}, {turn}}}\n"
    ));
    let overlapping = scene(&format!(
        "- mesh: {{file: shell.obj, normals: face, material: {{dielectric: {{ior: 1.5, priority: 2}}}}, {turn}}}\n\
         - cube: {{size: 1.1, material: {{dielectric: {{ior: 1.33, priority: 1}}}}, {turn}}}\n"
    ));
    // The same numbers choose at the same surfaces, so that paths differ by rounding alone.
    for (a, b) in touching.y.iter().zip(&overlapping.y) {
        assert_close(*a, *b, 1e-4);
    }
    // It would not look so with water that ends before the glass.
    let apart = scene(&format!(
        "- mesh: {{file: shell.obj, normals: face, material: {{dielectric: {{ior: 1.5}}}}, {turn}}}\n\
         - cube: {{size: 0.9, material: {{dielectric: {{ior: 1.33}}}}, {turn}}}\n"
    ));
    let off = touching.y.iter().zip(&apart.y).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off > 0.05, "{off}");
}

/// Two panes a hundredth of a millimetre thick that share a face are clear, so even light of 1 is 1 in every pixel, wherever they
/// are: to be put apart they need 2⁻⁴² of 30 m, 7e-12 m, and of 3000 m, 7e-10 m. Held together they showed 1.3. Each sample is 1,
/// but for the roulette of what is reflected many times.
#[test]
fn touching_panes_that_are_thin_beside_their_place_are_invisible_in_even_light() {
    for x in [30, 3000] {
        let panes = bench_with(
            &format!(
                "camera: {{origin: [{x}, 2, 0.5], target: [{x}, 0, 0], fov_deg: 40}}\nimage: {{width: 8, height: 8}}\n\
             render: {{samples: 64}}\nlights: [{{constant: {{radiance: 1}}}}]\nshapes:\n\
             - cube: {{center: [{x}, 0, 0], size: [2, 1e-5, 2], material: {{dielectric: {{ior: 1.5}}}}}}\n\
             - cube: {{center: [{x}, 1e-5, 0], size: [2, 1e-5, 2], material: {{dielectric: {{ior: 1.6}}}}}}\n"
            ),
            &[],
        );
        let notes = &panes.prepared.scene.notes;
        assert!(notes.iter().any(|note| note.contains("it is put off by")), "{x} m: {notes:?}");
        let mean = panes.grey().picture().mean().mean;
        assert!((mean - 1.0).abs() < 1e-2, "{x} m: {mean}");
    }
}

/// Bodies that share a face with what they stand on, or with each other, look as they do a nanometre apart, whichever of the two
/// was written first and however they are turned. On the very face rounding decides which of the two a ray meets, and the
/// step off the one leads over the other: a floor let light through from beneath, smoke ended at the first of two blocks.
#[test]
fn bodies_that_share_faces_look_as_with_a_gap_between() {
    let table = "v -2 0 -2\nv -2 0 2\nv 2 0 2\nv 2 0 -2\nf 1 2 3 4\n";
    let block = cube(0.3, 1, true);
    let picture = |floor: &str, body: &str, turn: &str, floor_first: bool| {
        let (floor, body) = (floor.replace("TURN", turn), body.replace("TURN", turn));
        let shapes = if floor_first { format!("{floor}\n{body}") } else { format!("{body}\n{floor}") };
        let text = format!(
            "camera: {{origin: [1.5, 2, 3], target: [0, 0.2, 0], fov_deg: 20}}\nimage: {{width: 8, height: 8}}\n\
             render: {{samples: 64}}\nlights: [{{constant: {{radiance: 1}}}}]\nmedia: {{smoke: {{homogeneous: {{absorption: 2}}}}}}\n\
             materials:\n  dark: {{diffuse: {{reflectance: 0.2}}}}\n  glass: {{dielectric: {{ior: 1.5}}}}\n  \
             water: {{dielectric: {{ior: 1.33, priority: 1}}}}\nshapes:\n{shapes}\n"
        );
        bench_with(&text, &[("table.obj", table.as_bytes()), ("block.obj", block.as_bytes())]).grey().picture().y
    };
    let floors = [
        "- rectangle: {corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: dark, TURN}",
        "- plane: {normal: [0, 1, 0], material: dark, TURN}",
        "- mesh: {file: table.obj, material: dark, TURN}",
        "- cube: {center: [0, -0.5, 0], size: [4, 1, 4], material: dark, TURN}",
        // Another body of the same kind.
        "- cube: {center: [0, -0.3, 0], size: 0.6, material: {boundary: {}}, inside: smoke, outside: vacuum, TURN}",
        "- cube: {center: [0, -0.3, 0], size: 0.6, material: glass, TURN}",
    ];
    let bodies = [
        "- cube: {center: [0, 0.3, 0], size: 0.6, material: glass, TURN}",
        "- cube: {center: [0, 0.3, 0], size: 0.6, material: {boundary: {}}, inside: smoke, outside: vacuum, TURN}",
        "- cube: {center: [0, 0.3, 0], size: 0.6, material: {mask: {opacity: 0, material: dark}}, TURN}",
        "- cube: {center: [0, 0.3, 0], size: 0.6, material: water, TURN}",
        "- cylinder: {base: [0, 0, 0], top: [0, 0.6, 0], radius: 0.3, material: glass, TURN}",
        "- cone: {base: [0, 0, 0], apex: [0, 0.6, 0], radius: 0.3, material: glass, TURN}",
        "- mesh: {file: block.obj, normals: face, material: glass, transform: [{translate: [0, 0.3, 0]}]}",
    ];
    let turns = ["", "{rotate: {axis: [3, 1, 2], deg: 11}}, {translate: [0.13, 0.07, -0.11]}"];
    for (floor, body) in floors.iter().flat_map(|floor| bodies.map(|body| (floor, body))) {
        for turn in turns {
            // What f32 rounds does not share a face with what is turned.
            if !turn.is_empty() && (floor.contains("mesh") || body.contains("mesh")) {
                continue;
            }
            let turned = |raised: &str| format!("transform: [{raised}{turn}]").replace("][", "], [");
            let raised = body.replace("transform: [", "transform: [{translate: [0, 1e-9, 0]}, ");
            let [there, up] = ["", "{translate: [0, 1e-9, 0]}, "].map(&turned);
            let apart = picture(&floor.replace("TURN", &there), &raised.replace("TURN", &up), "", true);
            for first in [true, false] {
                let found = picture(&floor.replace("TURN", &there), &body.replace("TURN", &there), "", first);
                let off = found.iter().zip(&apart).map(|(a, b)| (a - b).abs()).sum::<f64>();
                let all = apart.iter().sum::<f64>();
                // A nanometre changes where paths go by as much; one in thousands goes another way.
                assert!(off < 2e-3 * all, "{floor}, {body}, {turn}, {first}: {off} of {all}");
            }
        }
    }
}

/// Three slabs that overlap, in whatever order they are written: of 1.5 (strongest), 1.33, 2.4 (weakest), from z = 0.
/// 1.5 has 0 to 1, 1.33 the rest up to 1.9, 2.4 the rest up to 2.8. By Snell's law a ray at 40° is shifted by
/// Σ d tan θ, sin θ = sin 40°/n: a lamp 10⁻⁹ to either side of there is seen or not.
#[test]
fn a_stack_of_slabs_shifts_a_ray_by_snells_law_in_any_order() {
    let slab = |from: f64, to: f64, ior: f64, priority: i32| {
        let (middle, depth) = (-0.5 * (from + to), to - from);
        format!(
            "- cube: {{center: [0, 0, {middle}], size: [50, 50, {depth}], \
             material: {{dielectric: {{ior: {ior}, priority: {priority}}}}}}}\n"
        )
    };
    let slabs = [slab(0.0, 1.0, 1.5, 30), slab(0.9, 1.9, 1.33, 20), slab(1.8, 2.8, 2.4, 10)];
    let sin = 40f64.to_radians().sin();
    let tan = |n: f64| (sin / n) / (1.0 - (sin / n) * (sin / n)).sqrt();
    let shift = tan(1.5) + 0.9 * tan(1.33) + 0.9 * tan(2.4);
    for order in [[0, 1, 2], [2, 0, 1], [1, 2, 0], [2, 1, 0]] {
        let bodies: String = order.iter().map(|&i| slabs[i].as_str()).collect();
        for (low, seen) in [(shift - 1e-9, true), (shift + 1e-9, false), (shift - 3e-9, false)] {
            let scene = bench(&format!(
                "shapes:\n{bodies}- rectangle: {{corner: [{low}, -1, -2.8], edge_u: [2.0e-9, 0, 0], edge_v: [0, 2, 0], {LAMP}, \
                 transform: [{{translate: [0, 0, -1.0e-12]}}]}}\n"
            ));
            let ray =
                Ray::new(DVec3::ZERO - v(sin, 0.0, -(1.0 - sin * sin).sqrt()), v(sin, 0.0, -(1.0 - sin * sin).sqrt()));
            let found = (0..64).any(|index| {
                let sampler = Sampler::new(1, [0, 0], 0, index);
                scene.incoming(&ray, &wavelengths(SPREAD_NM), &sampler).radiance.to_array()[0] > 0.0
            });
            assert_eq!(found, seen, "{order:?} {low}");
        }
    }
}

/// Which body has a place does not depend on the order in which bodies are written: the same light to the last bit. No two
/// surfaces are met at the same distance, where the first that is written counts: no ray passes through the circle that two
/// balls have in common.
#[test]
fn the_order_of_bodies_does_not_matter() {
    let bodies = [
        "{sphere: {center: [-0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: 1.5, priority: 2}}, inside: red}}",
        "{sphere: {center: [0.32, 0.01, 0.03], radius: 0.7, material: {dielectric: {ior: {glass: water}, priority: 1}}, inside: blue}}",
        "{cube: {center: [0.03, 0.38, 0.02], size: 0.8, material: {dielectric: {ior: 1.9, priority: 3}}}}",
    ];
    let scene = |order: [usize; 3]| {
        let list = order.map(|i| bodies[i]).join(", ");
        bench(&format!(
            "shapes: [{list}]\nlights: [{{constant: {{radiance: 1}}}}]\n\
             media: {{red: {{homogeneous: {{absorption: 2}}}}, blue: {{homogeneous: {{absorption: {{rgb: [0.1, 0.5, 1]}}}}}}}}\n"
        ))
    };
    let (one, other) = (scene([0, 1, 2]), scene([2, 1, 0]));
    for (from, to) in across_the_unit_sphere() {
        for index in 0..16 {
            let sampler = Sampler::new(3, [0, 0], 0, index);
            let light =
                |scene: &super::Bench| scene.incoming(&ray(from, to), &wavelengths(SPREAD_NM), &sampler).radiance;
            assert_eq!(light(&one).to_array(), light(&other).to_array(), "{to} {index}");
        }
    }
}

/// Through the middle of a ball of one medium in a slab of another, which overlaps with a third: Beer and Lambert along
/// what each has of the way, for each wavelength. With all indices 1 nothing else happens.
#[test]
fn bodies_absorb_along_the_way_that_they_have() {
    let sigma = [[0.5, 2.0], [1.5, 0.3], [0.7, 0.9]];
    let medium = |k: usize| {
        let [a, b] = sigma[k];
        format!("m{k}: {{homogeneous: {{absorption: {{table: [[360, {a}], [830, {b}]]}}}}}}")
    };
    let media = [0, 1, 2].map(medium).join(", ");
    // Along −z: the slab m0 from 1 to −1, the ball m1 from 0.5 to −0.5, m2 from −0.8 to −2.
    let body = |ior: f64| {
        format!(
            "shapes:\n\
             - cube: {{size: 2, material: {{dielectric: {{ior: {ior}, priority: 1}}}}, inside: m0}}\n\
             - sphere: {{radius: 0.5, material: {{dielectric: {{ior: {ior}, priority: 2}}}}, inside: m1}}\n\
             - cube: {{center: [0, 0, -1.4], size: [2, 2, 1.2], material: {{dielectric: {{ior: {ior}, priority: 0}}}}, inside: m2}}\n\
             media: {{{media}}}\nlights: [{{constant: {{radiance: 1}}}}]\n"
        )
    };
    for ior in [1.0, 1.4] {
        let scene = bench(&body(ior));
        let beam = ray(v(0.0, 0.0, 5.0), v(0.0, 0.0, 0.0));
        // The brightest of some samples came straight through.
        let best = (0..64).map(|index| {
            let sampler = Sampler::new(1, [0, 0], 0, index);
            scene.incoming(&beam, &wavelengths(SPREAD_NM), &sampler).radiance.to_array().map(f64::from)
        });
        let through: [f64; 8] =
            best.filter(|l| l[0] < 0.9).fold([0.0; 8], |a, b| std::array::from_fn(|k| a[k].max(b[k])));
        for (k, nm) in SPREAD_NM.into_iter().enumerate() {
            let at = |[a, b]: [f64; 2]| a + (b - a) * (nm - 360.0) / 470.0;
            let depth = at(sigma[0]) * 1.0 + at(sigma[1]) * 1.0 + at(sigma[2]) * 1.0;
            assert_close(through[k], (-depth).exp(), 1e-5);
        }
    }
}

/// The picture of `scene` by the integrator in place of INTEGRATOR.
fn by(scene: &str, integrator: &str) -> Frame {
    let text = scene.replace("INTEGRATOR", integrator);
    render_with(&bench_with(&text, &[]), Filter::Box, 32)
}

/// A lamp and a white ball in water, under glass that dips into it: light found by shadow rays, by scattering alone and
/// from the lamp. Surfaces that are not there neither hide the lamp nor count.
#[test]
fn lamps_under_water_are_found_by_all_techniques() {
    let scene = format!(
        "camera: {{origin: [0, 1, 4], target: [0, -0.4, 0], fov_deg: 25}}\nimage: {{width: 8, height: 8}}\n\
         integrator: INTEGRATOR\nrender: {{samples: 512, techniques: {{light_tracing: off}}}}\nshapes:\n\
         - sphere: {{radius: 8, material: {{dielectric: {{ior: 1.33, priority: 5}}}}, inside: tea}}\n\
         - cube: {{center: [0, 0.2, 0], size: [3, 0.4, 3], material: {{dielectric: {{ior: 1.5, priority: 1}}}}, \
           transform: [{{rotate: {{axis: [1, 0, 0.3], deg: 20}}}}]}}\n\
         - sphere: {{center: [0, 1.5, 0], radius: 0.5, {LAMP}}}\n\
         - sphere: {{center: [0, -1, 0], radius: 0.7, material: {{diffuse: {{reflectance: 0.8}}}}}}\n\
         media: {{tea: {{homogeneous: {{absorption: 0.2}}}}}}\n"
    );
    let both = by(&scene, "{path: {max_depth: 4, hide_emitters: true}}");
    let scattering = by(&scene, "{path: {max_depth: 4, hide_emitters: true, light_samples: 0}}");
    assert_agree("scattering", &both, &scattering);
    assert_agree("from the lamp", &both, &by(&scene, "{light_tracer: {max_depth: 4, hide_emitters: true}}"));
}

/// Light from a lamp through a ball of glass in a block of water onto the floor beside: from the camera and from the
/// lamp, and divided between the two.
#[test]
fn light_through_bodies_is_the_same_from_both_ends() {
    let scene = "camera: {origin: [0, 3, 5], target: [0, -1, 2.2], fov_deg: 20}\nimage: {width: 8, height: 8}\n\
         integrator: INTEGRATOR\nrender: {samples: 4096, techniques: {light_tracing: off}}\nshapes:\n\
         - rectangle: {corner: [-3, -1, 4], edge_u: [6, 0, 0], edge_v: [0, 0, -6], material: {diffuse: {reflectance: 0.7}}}\n\
         - cube: {center: [0, 0, 0.2], size: [1.4, 1, 1.4], material: {dielectric: {ior: 1.33, priority: 1}}, inside: tea}\n\
         - sphere: {center: [0.2, 0.4, 0], radius: 0.6, material: {dielectric: {ior: {glass: SF11}, priority: 2}}}\n\
         - disk: {center: [0, 2.5, 0.5], normal: [0, -1, 0], radius: 0.5, emission: 10, material: {diffuse: {reflectance: 0}}}\n\
         media: {tea: {homogeneous: {absorption: 0.5}}}\n";
    let path = by(scene, "path");
    assert_agree("from the lamp", &by(scene, "light_tracer"), &path);
    let divided = by(&scene.replace("light_tracing: off", "light_tracing: on"), "path");
    assert!(divided.splats.is_some());
    assert_agree("divided", &divided, &path);
}

/// A ball that shines and is a body itself sends its light into what is around it, wherever on its surface that begins: the weaker
/// ball of glass beside it is there for all of it.
#[test]
fn lamps_that_are_bodies_shine_outward() {
    let scene = "camera: {origin: [0, 3, 5], target: [0, -1, 2.6], fov_deg: 20}\nimage: {width: 8, height: 8}\n\
         integrator: INTEGRATOR\nrender: {samples: 4096, techniques: {light_tracing: off}}\nshapes:\n\
         - rectangle: {corner: [-3, -1, 4], edge_u: [6, 0, 0], edge_v: [0, 0, -6], material: {diffuse: {reflectance: 0.7}}}\n\
         - sphere: {center: [0, 0.3, 0.8], radius: 0.8, material: {dielectric: {ior: 1.5, priority: 1}}}\n\
         - sphere: {center: [0, 1.6, -1.2], radius: 0.4, emission: 10, material: {dielectric: {ior: 1.33, priority: 2}}}\n";
    let path = by(scene, "path");
    assert_agree("from the lamp", &by(scene, "light_tracer"), &path);
    let divided = by(&scene.replace("light_tracing: off", "light_tracing: on"), "path");
    assert!(divided.splats.is_some());
    assert_agree("divided", &divided, &path);
}

/// The recursive tracer knows the same bodies: in even light they are invisible but for what it gives up.
#[test]
fn whitted_knows_bodies_that_overlap() {
    let scene = bench(
        "shapes: [{sphere: {center: [-0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: 1.5, priority: 2}}}}, \
          {sphere: {center: [0.3, 0, 0], radius: 0.7, material: {dielectric: {ior: 1.33, priority: 1}}}}]\n\
         lights: [{constant: {radiance: 1}}]\nintegrator: {whitted: {max_depth: 48}}\n",
    );
    for (from, to) in across_the_unit_sphere().step_by(8) {
        let lost = 1.0 - scene.look(from, to);
        assert!((-1e-5..2e-3).contains(&lost), "at {to}: lost {lost}");
    }
}

/// A lamp in a ball of glass shines whatever its surface bounds: also of the index of the ball, and within the ball, which is stronger.
/// Where the indices are as near as 1.49 and 1.5 the same light comes to 1e-4.
#[test]
fn whitted_shows_lamps_whose_surface_is_not_there() {
    let light = |ior: f64, priority: u32| {
        bench(&format!(
            "integrator: whitted\nshapes: [{{sphere: {{radius: 0.9, material: {{dielectric: {{ior: 1.5, priority: 5}}}}}}}}, \
             {{sphere: {{radius: 0.4, emission: 1, material: {{dielectric: {{ior: {ior}, priority: {priority}}}}}}}}}]\n"
        ))
        .look(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0))
    };
    let expected = light(1.49, 9);
    assert!(expected > 0.4, "{expected}");
    for (ior, priority) in [(1.5, 9), (1.49, 1), (1.5, 1)] {
        let found = light(ior, priority);
        assert!((found / expected - 1.0).abs() < 1e-3, "{ior} {priority}: {found} for {expected}");
    }
}

/// Copies of a group are bodies too, and those of one thing that overlap are one.
#[test]
fn copies_that_overlap_are_one_body() {
    let scene = bench(
        "groups: {drop: [{sphere: {radius: 0.5, material: {dielectric: {ior: 1.33, priority: 1}}}}]}\n\
         shapes: [{instance: {group: drop, transform: [{translate: [-0.2, 0, 0]}]}}, \
         {instance: {group: drop, transform: [{translate: [0.2, 0, 0]}]}}, \
         {cube: {center: [0, -0.6, 0], size: 1, material: {dielectric: {ior: 1.33, priority: 0}}}}]\n\
         lights: [{constant: {radiance: 1}}]\n",
    )
    .grey();
    scene.picture().assert_all(1.0, 2e-5);
}

/// A path keeps eight bodies: in eight hollows, one in another, it forgets the glass that they are in. Where it then meets the
/// far side of the glass from within and is reflected, it knows again: a ball of the same glass on the way back is not there,
/// and changes no sample but by rounding. By Snell's law it comes back to a lamp that it would miss if the ball bent it.
#[test]
fn a_path_that_is_reflected_within_a_body_knows_that_it_is_inside() {
    let light = |ball: &str| -> Vec<f64> {
        let hollow = |k: i32| {
            let (side, priority) = (0.4 + 0.02 * f64::from(k), k + 1);
            format!(
                "- cube: {{center: [0.5, 0, 1.2], size: {side}, material: {{dielectric: {{ior: 1, priority: {priority}}}}}}}\n"
            )
        };
        let hollows: String = (0..8).map(hollow).collect();
        let scene = bench(&format!(
            "integrator: {{path: {{max_depth: 6}}}}\nshapes:\n\
             - rectangle: {{corner: [-1.3, 0.3, 6], edge_u: [0.5, 0, 0], edge_v: [0, -0.6, 0], {LAMP}}}\n\
             - sphere: {{radius: 2, material: {{dielectric: {{ior: 1.5, priority: 0}}}}}}\n{hollows}{ball}"
        ));
        let sample = |index| {
            let sampler = Sampler::new(1, [0, 0], 0, index);
            let way = ray(v(0.6, 0.0, 5.0), v(0.6, 0.0, 0.0));
            f64::from(scene.incoming(&way, &wavelengths(SPREAD_NM), &sampler).radiance.reduce_add())
        };
        (0..1024).map(sample).collect()
    };
    let without = light("");
    assert!(without.iter().filter(|l| **l > 0.0).count() > 10, "the lamp is not met");
    let ball = "- sphere: {center: [-0.27, 0, -0.8], radius: 0.15, material: {dielectric: {ior: 1.5, priority: 9}}}\n";
    for (with, without) in light(ball).into_iter().zip(without) {
        assert_close(with, without, 1e-5);
    }
}

#[test]
fn what_cannot_be_a_body_is_told() {
    let fault = |shapes: &str| {
        let text = format!("{CAMERA}shapes:\n{shapes}");
        try_bench(&text, &[]).err().unwrap_or_default().replace("DIR/scene.yaml:", "")
    };
    assert_eq!(
        fault("- sphere: {radius: 1, material: {dielectric: {ior: 1.5, exterior_ior: 1.3, priority: 1}}}\n"),
        "4:71: shapes[0].sphere.material.dielectric.exterior_ior: expected none beside priority: the index outside is \
         that of the body around, found one"
    );
    assert_eq!(
        fault("- disk: {radius: 1, normal: [0, 1, 0], material: {dielectric: {ior: 1.5, priority: 1}}}\n"),
        "4:50: shapes[0].disk.material: expected a closed shape or a plane for a material with a priority, found an \
         open disk"
    );
    assert_eq!(
        fault("- sphere: {radius: 1, flip_normals: true, material: {dielectric: {ior: 1.5, priority: 1}}}\n"),
        "4:53: shapes[0].sphere.material: expected normals that point out of a body with a priority, found flip_normals"
    );
    assert_eq!(
        fault(
            "- sphere: {radius: 1, material: {blend: {first: {dielectric: {ior: 1.5, priority: 1}}, \
             second: {dielectric: {ior: 1.5, priority: 2}}}}}\n"
        ),
        "4:33: shapes[0].sphere.material: expected one priority and one index all over a body, found several"
    );
    assert!(
        fault("- sphere: {radius: 1, material: {dielectric: {ior: 1.5, priority: high}}}\n")
            .contains("priority: expected")
    );
}
