//! Several shadow rays from the first vertex of a path change the noise, never the mean.

use super::common::{Bench, bench_with, grey_png, room};
use super::reuse::{assert_layers_add_up, assert_same_light, over_seeds};

const LAMPS: &str = "- rectangle: {corner: [-0.6, 0.9, -0.6], edge_u: [1.2, 0, 0], edge_v: [0, 0, 1.2], emission: 3}\n\
                     - sphere: {center: [-0.7, 0.2, -0.6], radius: 0.15, emission: {rgb: [8, 3, 1]}}\n";

/// Lamps among `shapes`, seen from within a room.
fn lit(shadow_rays: u32, shapes: &str, before: &str, techniques: &str) -> Bench {
    let yaml = format!(
        "camera: {{origin: [0, 0, 0.95], target: [0, -0.1, -1], fov_deg: 80}}\nimage: {{width: 20, height: 16}}\n\
         materials: {{chalk: {{diffuse: {{reflectance: 0.7}}}}}}\nintegrator: {{path: {{max_depth: 3}}}}\nrender: {{samples: 16, \
         techniques: {{shadow_rays: {shadow_rays}, light_tracing: off, glints: off, {techniques}}}}}\n{before}{shapes}{LAMPS}"
    );
    bench_with(&yaml, &[("sky.png", &grey_png(16, 8, |x, y| (100 + x * 9 + y) as u8))])
}

#[test]
fn several_shadow_rays_bring_the_light_of_one() {
    let walls = room("material: {diffuse: {reflectance: 0.7}}");
    let ball = |x: f64, material: &str| {
        format!("- sphere: {{center: [{x}, -0.6, -0.3], radius: 0.4, material: {material}}}\n")
    };
    let solids =
        walls.clone() + &ball(-0.5, "{plastic: {}}") + &ball(0.5, "{conductor: {metal: gold, roughness: 0.2}}");
    let under_a_sky = "shapes:\n- plane: {point: [0, -1, 0], normal: [0, 1, 0], material: chalk}\n".to_owned()
        + &ball(0.0, "{dielectric: {ior: 1.5, roughness: 0.3}}");
    let sky = "lights: [{environment: {file: sky.png}}, {point: {position: [0, 0.5, 0], intensity: 1}}]\n";
    let fog = "media: {fog: {homogeneous: {scattering: {rgb: [0.2, 0.5, 0.3]}, absorption: 0.1}}}\nmedium: fog\n";
    let pane = "- rectangle: {corner: [-0.9, -0.9, 0.1], edge_u: [1, 0, 0], edge_v: [0, 1, 0], material: ";
    let open = walls.clone()
        + pane
        + "{thin_dielectric: {ior: 1.5}}}\n"
        + &ball(0.5, "{mask: {opacity: 0.5, material: chalk}}");
    let behind = walls + &ball(-0.5, "{dielectric: {ior: {glass: N-SF11}}}") + &ball(0.5, "{mirror: {}}");
    for (name, before, shapes, techniques) in [
        ("solids", "", &solids, "reuse: off"),
        ("solids that share paths", "", &solids, "reuse: on"),
        ("a sky, a point and rough glass", sky, &under_a_sky, "reuse: off"),
        ("fog", fog, &solids, "reuse: off"),
        ("a pane and a mask", "", &open, "reuse: off"),
        ("behind glass and a mirror", "", &behind, "reuse: off, packets: on"),
        ("behind glass and a mirror, lane by lane", "", &behind, "reuse: off, packets: off"),
    ] {
        let one = over_seeds(lit(1, shapes, before, techniques), 0..24);
        for (rays, first) in [(3, 100), (8, 200)] {
            let bench = lit(rays, shapes, before, techniques);
            assert_eq!(bench.prepared.plan.shadow_rays, rays, "{name}");
            let several = over_seeds(bench, first..first + 24);
            let ratio = assert_same_light(&format!("{name}, {rays}"), &one, &several);
            // In fog little of the noise is that of first vertices on surfaces.
            assert!(name == "fog" || ratio < 0.95, "{name}, {rays}: {ratio}");
        }
    }
}

/// Things before a sky: chalk, coats, rough metal and glass, a mask, a pane, fog, a lamp and a point.
fn under_a_sky(render: &str, path: &str, lights: &str, rest: &str) -> Bench {
    let yaml = format!(
        "camera: {{origin: [0, 0.6, 3], target: [0, 0, 0], fov_deg: 50}}\nimage: {{width: 20, height: 16}}\n\
         integrator: {{path: {{max_depth: 4, {path}}}}}\nrender: {{{render}}}\n\
         lights: [{lights}{{point: {{position: [1, 2, 1], intensity: 1}}}}]\n\
         {rest}shapes:\n- plane: {{point: [0, -0.5, 0], normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.7}}}}}}\n\
         - sphere: {{center: [-1, 0, 0], radius: 0.5, material: {{plastic: {{roughness: 0.1}}}}}}\n\
         - sphere: {{center: [0, 0, 0], radius: 0.5, material: {{conductor: {{metal: gold, roughness: 0.3}}}}}}\n\
         - sphere: {{center: [1, 0, 0], radius: 0.5, material: {{dielectric: {{ior: 1.5, roughness: 0.3}}}}}}\n\
         - sphere: {{center: [-0.5, -0.2, 0.8], radius: 0.3, material: {{mask: {{opacity: 0.5, material: {{diffuse: {{}}}}}}}}}}\n\
         - rectangle: {{corner: [0.1, -0.5, 1], edge_u: [0.8, 0, 0], edge_v: [0, 0.8, 0], material: {{thin_dielectric: {{ior: 1.5}}}}}}\n\
         - sphere: {{center: [0, 1.2, -1], radius: 0.2, emission: 3}}\n"
    );
    bench_with(
        &yaml,
        &[("sky.png", &grey_png(16, 8, |x, y| if (x, y) == (5, 2) { 255 } else { (20 + x * 9 + y) as u8 }))],
    )
}

const FOG: &str = "media: {fog: {homogeneous: {scattering: {rgb: [0.2, 0.5, 0.3]}, absorption: 0.1}}}\nmedium: fog\n";

/// Light that is even over all directions is found by what scatters alone as it is with shadow rays.
#[test]
fn an_even_sky_is_as_bright_without_shadow_rays() {
    for (name, samples, techniques, rest) in [
        ("one ray", 16, "shadow_rays: 1, reuse: off", ""),
        ("four rays", 16, "shadow_rays: 4, reuse: off", ""),
        ("shared", 16, "shadow_rays: 1, reuse: on", ""),
        ("fog", 128, "shadow_rays: 1, reuse: off", FOG),
    ] {
        let lit = |sky: &str| {
            let render =
                format!("samples: {samples}, techniques: {{even_sky: {sky}, {techniques}, light_tracing: off}}");
            let bench = under_a_sky(&render, "", "{constant: {radiance: {rgb: [0.5, 0.7, 1]}}}, ", rest);
            assert_eq!(bench.prepared.plan.asks_even_sky, sky == "on");
            bench
        };
        let (asked, met) = (over_seeds(lit("on"), 0..24), over_seeds(lit("off"), 100..124));
        assert_same_light(name, &asked, &met);
    }
}

/// Shadow rays look for what is brighter than the mean of a sky where what scatters finds the rest, and for all of it where it does not.
#[test]
fn a_sky_is_as_bright_by_shadow_rays_alone() {
    for (name, rest, samples) in [("clear", "", 16), ("fog", FOG, 256)] {
        for mapping in ["texels", "mitsuba"] {
            let lit = |path: &str| {
                let sky = format!("{{environment: {{file: sky.png, mapping: {mapping}}}}}, ");
                let render = format!("samples: {samples}, techniques: {{reuse: off, light_tracing: off}}");
                under_a_sky(&render, path, &sky, rest)
            };
            let (both, alone) = (over_seeds(lit(""), 0..24), over_seeds(lit("scatter_samples: 0"), 100..124));
            assert_same_light(&format!("{name}, {mapping}"), &both, &alone);
        }
    }
}

/// Among other lights under an open sky shadow rays to it do not pay; in a room with a small window they do.
#[test]
fn a_trial_leaves_an_even_sky_to_what_scatters_where_that_pays() {
    let asks = |lights: &str, shapes: &str| {
        let yaml = format!(
            "camera: {{origin: [0, 0, 0.9], target: [0, -0.3, -1], fov_deg: 80}}\nimage: {{width: 64, height: 64}}\n\
             render: {{samples: 256, techniques: {{light_tracing: off}}}}\nlights: [{{constant: {{radiance: 1}}}}{lights}]\n{shapes}"
        );
        bench_with(&yaml, &[]).prepared.plan.asks_even_sky
    };
    let open =
        "shapes:\n- plane: {point: [0, -1, 0], normal: [0, 1, 0]}\n- cube: {center: [0, -0.8, -0.5], size: 0.4}\n";
    assert!(!asks(", {point: {position: [0.5, 1, 0.5], intensity: 3}}", open));
    // Walls of a box with a window of a fifth of its width in the ceiling.
    let wall =
        |corner: &str, u: &str, v: &str| format!("- rectangle: {{corner: {corner}, edge_u: {u}, edge_v: {v}}}\n");
    let room = "shapes:\n".to_owned()
        + &wall("[-1, -1, -1]", "[2, 0, 0]", "[0, 0, 2]")
        + &wall("[-1, -1, -1]", "[2, 0, 0]", "[0, 2, 0]")
        + &wall("[-1, -1, 1]", "[2, 0, 0]", "[0, 2, 0]")
        + &wall("[-1, -1, -1]", "[0, 0, 2]", "[0, 2, 0]")
        + &wall("[1, -1, -1]", "[0, 0, 2]", "[0, 2, 0]")
        + &wall("[-1, 1, -1]", "[0.8, 0, 0]", "[0, 0, 2]")
        + &wall("[0.2, 1, -1]", "[0.8, 0, 0]", "[0, 0, 2]")
        + &wall("[-0.2, 1, -1]", "[0.4, 0, 0]", "[0, 0, 0.8]")
        + &wall("[-0.2, 1, 0.2]", "[0.4, 0, 0]", "[0, 0, 0.8]");
    assert!(asks("", &room));
}

/// L = 1 + ½ L everywhere in a room whose walls shine with 1 and reflect ½; and smoke that takes nothing away is as bright as the
/// sky that it stands before.
#[test]
fn a_furnace_of_several_shadow_rays_is_as_bright_as_it_has_to_be() {
    let walls = room("emission: 1, material: {diffuse: {reflectance: 0.5}}");
    let smoke = "media: {smoke: {homogeneous: {scattering: 2, phase: {hg: 0.5}}}}\nlights: [{constant: {radiance: 1}}]\nshapes:\n\
                 - sphere: {center: [0, 0, -2], radius: 1.5, material: {boundary: {}}, inside: smoke}\n";
    for (scene, expected) in [(walls.as_str(), 2.0), (smoke, 1.0)] {
        let yaml = format!(
            "camera: {{origin: [0.1, 0.2, 0.3], target: [0, 0, -1], fov_deg: 100}}\nimage: {{width: 16, height: 16}}\n\
             render: {{samples: 64, techniques: {{shadow_rays: 8}}}}\n{scene}"
        );
        bench_with(&yaml, &[]).grey().picture().mean().assert_is(expected, 3e-3);
    }
}

/// Layers of light change no bit of the picture, and add up to it: each sum of them is rounded to an f32 once a sample, and
/// a pixel has 16.
#[test]
fn layers_of_several_shadow_rays_add_up_to_the_picture_that_they_leave_as_it_is() {
    let things = room("material: {diffuse: {reflectance: 0.7}}")
        + "- sphere: {center: [-0.4, -0.6, -0.3], radius: 0.4, material: {plastic: {}}, name: ball}\n";
    let plain = lit(4, &things, "", "reuse: off");
    let parted = lit(4, &things, "layers: [emission, direct, indirect, caustic]\n", "reuse: off");
    assert_layers_add_up(&plain, &parted);
}

/// A lamp that fills the sky has more light to tell of than one ray brings; a point has not.
#[test]
fn a_trial_sends_several_rays_where_they_pay() {
    let with = |light: &str, rest: &str| {
        let yaml = format!(
            "camera: {{origin: [0, 2, 4], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 64, height: 64}}\n\
             integrator: {{path: {{max_depth: 2}}}}\nrender: {{samples: 16}}\n{light}shapes:\n- plane: {{normal: [0, 1, 0]}}\n\
             - cube: {{center: [0, 0.5, 0], size: 1}}\n{rest}"
        );
        bench_with(&yaml, &[]).prepared.plan.shadow_rays
    };
    let lamp = "- rectangle: {corner: [-1, 3, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], emission: 3}\n";
    assert!(with("", lamp) > 1);
    assert_eq!(with("lights: [{point: {position: [1, 3, 1], intensity: 9}}]\n", ""), 1);
    assert_eq!(with("lights: [{constant: {radiance: 0}}]\n", ""), 1);
}
