//! Which light is traced from the lights, and what the plan says of it.

use super::caustics::{AREA, BALL, Case, GLASS, LAMP, PANE, POINT, assert_agree, render};
use super::common::{Bench, bench_with, grey_png};

/// Whether light is traced, whether photons are merged, and why.
pub(super) fn techniques(bench: &Bench) -> (bool, bool, String) {
    let of = |name| bench.prepared.plan.techniques.iter().find(|t| t.name == name);
    let tracing = of("light tracing").expect("the plan speaks of light tracing");
    (tracing.on, of("photon merging").is_some_and(|t| t.on), tracing.reason.clone())
}

/// A sky with a white disc, rows 10 and 11 of 32 and columns 20 and 21 of 64, and all else of the code value `rest`.
fn disc_in_sky(rest: u8) -> Vec<u8> {
    grey_png(64, 32, |x, y| if (20..22).contains(&x) && (10..12).contains(&y) { 255 } else { rest })
}

/// A hidden lamp stands between the camera and a caustic. Where there is no pane nothing changes if panes count for the length of paths:
/// the lamp is none.
#[test]
fn hidden_lamps_on_the_way_to_the_camera_are_no_panes() {
    let light = |counted: bool| {
        bench_with(
            &format!(
                "camera: {{origin: [0, 5, 0.01], target: [0, 0, 0], up: [0, 0, -1], fov_deg: 40}}\nimage: {{width: 16, height: 16}}\n\
                 integrator: {{path: {{max_depth: 4, hide_emitters: true, count_crossings: {counted}}}}}\n\
                 render: {{samples: 16, techniques: {{light_tracing: on, merging: off, glints: off}}}}\nshapes:\n\
                 - rectangle: {{corner: [-3, 0, 3], edge_u: [6, 0, 0], edge_v: [0, 0, -6], material: {{diffuse: {{reflectance: 0.8}}}}}}\n\
                 - sphere: {{center: [0, 0.9, 0], radius: 0.4, material: {{dielectric: {{ior: 1.5}}}}}}\n\
                 - sphere: {{center: [0, 4, 0], radius: 0.25, emission: 100}}\n"
            ),
            &[],
        )
        .picture()
        .y
    };
    let plain = light(false);
    assert!(plain.iter().sum::<f64>() > 0.0);
    assert_eq!(light(true), plain);
}

/// A black sky with a white disc of a thousandth of the sphere throws its light through a ball as a parallel light of
/// the same irradiance does, to the width of the disc; an even sky and a lamp as large as the scene leave it to the camera.
#[test]
fn a_sun_in_an_environment_is_traced_and_an_even_sky_is_not() {
    let scene = |tracing: &str, samples: u32| {
        let light = "lights: [{environment: {file: sky.png, scale: 100}}]\n";
        Case { what: "sun", light, ..AREA }.scene("path", tracing, "auto", samples)
    };
    let sun = |tracing: &str, samples| bench_with(&scene(tracing, samples), &[("sky.png", &disc_in_sky(0))]);
    let on = sun("auto", 512);
    let (tracing, _, reason) = techniques(&on);
    assert!(tracing, "{reason}");
    assert_agree("sun", &render(&on), &render(&sun("off", 4096)));

    let even = bench_with(&scene("auto", 64), &[("sky.png", &disc_in_sky(255))]);
    let (tracing, _, reason) = techniques(&even);
    assert!(!tracing && reason == "no light is small or has a sun", "{reason}");
    let large = "- sphere: {center: [-1.5, 2, 1], radius: 1.9, emission: 1}\n";
    let (tracing, _, reason) = techniques(&Case { what: "large", light: large, ..AREA }.bench("auto", "auto", 64));
    assert!(!tracing && reason == "no light is small or has a sun", "{reason}");
}

/// What coats, blends and mirrors throw of a disc in the sky, of 440 times its mean, on a floor: traced from the sky by that disc alone,
/// and by chance. The rest of the sky, and what a floor without end throws, is found by chance in both.
#[test]
fn a_sun_that_coats_throw_is_as_bright_as_by_chance() {
    const COAT: &str = "{plastic: {ior: 2.5, reflectance: 0.2}}";
    const BLEND: &str =
        "{blend: {weight: 0.5, first: {mirror: {reflectance: 0.9}}, second: {diffuse: {reflectance: 0.5}}}}";
    const SKY: &str = "lights: [{environment: {file: sky.png, scale: 100}}]\n";
    const MIRROR: &str = "- rectangle: {corner: [-2, -1, -2], edge_u: [0, 2.5, 0], edge_v: [2, 0, -1], material: {mirror: {reflectance: 0.8}}}\n\
        lights: [{environment: {file: sky.png, scale: 100}}]\n";
    let coat = Case { what: "coat", material: COAT, light: SKY, ..AREA };
    for (case, mirrors) in [
        (coat, false),
        (Case { what: "blend", material: BLEND, ..coat }, false),
        (Case { what: "coated floor", floor: COAT, ..coat }, false),
        (Case { what: "depth 3", depth: "3", ..coat }, false),
        (Case { what: "beside a mirror", light: MIRROR, ..coat }, true),
    ] {
        let bench = |tracing: &str, samples| {
            bench_with(&case.scene("path", tracing, "auto", samples), &[("sky.png", &disc_in_sky(1))])
        };
        let on = bench("on", 256);
        let caustics = on.prepared.plan.caustics.as_ref().expect(case.what);
        assert!(caustics.traced == [true] && caustics.in_part.contains(&true), "{}", case.what);
        assert_eq!(mirrors, caustics.casts.contains(&true), "{}", case.what);
        assert_agree(case.what, &render(&on), &render(&bench("off", 4096)));
    }
}

/// Paths from the camera meet the dome of a sky through glass often, its sun hardly ever: that they have met the light of the sky
/// says nothing of the sun's, which is traced, and merged where it is seen in glass, whatever the seed.
#[test]
fn the_sun_of_a_sky_is_traced_for_every_seed() {
    for (seed, ior) in (0..4).flat_map(|seed| [(seed, "1.5"), (seed, "{glass: SF11}")]) {
        let scene = format!(
            "camera: {{origin: [1, 3, 4], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 160, height: 120}}\n\
             integrator: path\nrender: {{samples: 256, seed: {seed}}}\nshapes:\n\
             - plane: {{normal: [0, 1, 0]}}\n\
             - sphere: {{center: [0, 0.5, 0], radius: 0.5, material: {{dielectric: {{ior: {ior}}}}}}}\n\
             lights: [sky: {{sun: {{elevation_deg: 30, azimuth_deg: 20}}, albedo: 0.4}}]\n"
        );
        let (tracing, merging, why) = techniques(&bench_with(&scene, &[]));
        assert!(tracing && merging, "{seed}, {ior}, merging {merging}: {why}");
    }
}

/// A plate that is ground so finely that it is all but clear: shadow rays to the lamp behind it bring a little from every place, and most
/// from a spot that no path happens on. Of 4096 tried paths hundreds met that little, and the light was left to chance.
#[test]
fn light_through_finely_ground_glass_is_traced_for_every_seed() {
    let lamps = [
        "lights: [point: {position: [0, 2, 0], intensity: 10}]\n",
        "- sphere: {center: [0, 2, 0], radius: 0.01, emission: 30000}\n",
    ];
    for (seed, roughness, lamp) in
        (0..3).flat_map(|seed| [(seed, 0.005, lamps[0]), (seed, 0.001, lamps[0]), (seed, 0.005, lamps[1])])
    {
        let scene = format!(
            "camera: {{origin: [0, 0.3, 3], target: [0, 0, 0], fov_deg: 30}}\nimage: {{width: 24, height: 24}}\n\
             integrator: path\nrender: {{samples: 256, seed: {seed}}}\nshapes:\n\
             - disk: {{radius: 1.5, normal: [0, 1, 0]}}\n\
             - cube: {{center: [0, 1, 0], size: [4, 0.2, 4], material: {{dielectric: {{ior: 1.5, roughness: {roughness}}}}}}}\n\
             {lamp}"
        );
        let (tracing, _, why) = techniques(&bench_with(&scene, &[]));
        assert!(tracing, "{seed}, {roughness}, {lamp}: {why}");
    }
}

/// What paths from the camera met of a sky in mirrors and glass is the sky's light: what a ball of flint throws of the sun onto another
/// beside it, and is seen through itself, is an eighth of what is there, of which a stated error would not know.
#[test]
fn what_glass_shows_of_a_sun_that_it_throws_is_merged() {
    for seed in 0..3 {
        let scene = format!(
            "camera: {{origin: [3.2, 1.3, 6], target: [0, 0.95, 0], fov_deg: 40}}\nimage: {{width: 172, height: 108}}\n\
             integrator: path\nrender: {{samples: 64, seed: {seed}}}\nshapes:\n\
             - plane: {{normal: [0, 1, 0]}}\n\
             - sphere: {{center: [0, 0.6, 0.2], radius: 0.6, material: {{dielectric: {{ior: {{glass: N-SF11}}}}}}}}\n\
             - sphere: {{center: [-1, 0.5, -0.3], radius: 0.5, material: {{plastic: {{reflectance: 0.4}}}}}}\n\
             lights: [sky: {{sun: {{elevation_deg: 25, azimuth_deg: 115}}, albedo: 0.4}}]\n"
        );
        let (tracing, merging, why) = techniques(&bench_with(&scene, &[]));
        assert!(tracing && merging, "{seed}, merging {merging}: {why}");
    }
}

/// A lamp in the middle of a globe of glass, as in a bulb, is met through the globe alone: seldom from what stands around.
#[test]
fn light_of_a_lamp_in_the_middle_of_a_globe_is_traced() {
    let caster = "sphere: {center: [-1.5, 2, 1], radius: 0.4, material: glass}";
    let light = "- sphere: {center: [-1.5, 2, 1], radius: 0.2, emission: 50}\n";
    let globe = Case { what: "globe", caster, light, ..AREA };
    let (tracing, _, reason) = techniques(&globe.bench("auto", "auto", 64));
    assert!(tracing, "{reason}");
    assert_agree("globe", &render(&globe.bench("on", "auto", 256)), &render(&globe.bench("off", "auto", 4096)));
}

/// No path begins at a lamp that is never looked for: what glass throws of its light stays with paths from the camera, which meet
/// it by chance.
#[test]
fn light_of_a_lamp_of_no_weight_is_not_left_to_paths_from_it() {
    let light = "- sphere: {center: [-1.5, 2, 1], radius: 0.2, emission: 30, sampling_weight: 0}\n";
    let (tracing, _, reason) = techniques(&Case { what: "no weight", light, ..AREA }.bench("on", "auto", 64));
    assert!(!tracing && reason == "no light is small or has a sun", "{reason}");
}

/// Where panes count for the length of a path, as in scenes read from Mitsuba's XML, paths from the lights cannot tell what
/// they may still meet. Without a pane there is nothing to count: the picture is the same, traced or not.
#[test]
fn light_is_traced_where_panes_would_count_and_there_are_none() {
    let counted = Case { what: "counted", depth: "5, count_crossings: true", ..AREA };
    let (tracing, _, reason) = techniques(&counted.bench("on", "auto", 96));
    assert!(tracing, "{reason}");
    assert_agree(counted.what, &render(&counted.bench("on", "auto", 96)), &render(&counted.bench("off", "auto", 1536)));

    let paned = Case { light: PANE, ..counted }.bench("on", "auto", 64);
    let (tracing, _, reason) = techniques(&paned);
    assert!(!tracing && reason == "panes count for the length of paths", "{reason}");
    let endless = Case { light: PANE, depth: "null, count_crossings: true", ..counted }.bench("on", "auto", 64);
    assert!(techniques(&endless).0, "{}", techniques(&endless).2);
}

/// With `delta_caustics: false`, as in scenes read from Mitsuba's XML, a point light is left to the camera, which never meets it
/// behind glass; a lamp beside it is traced alone.
#[test]
fn light_of_points_behind_glass_is_left_out_where_it_is_not_wanted() {
    let unwanted = Case { what: "unwanted", depth: "5, delta_caustics: false", light: POINT, ..AREA };
    let (tracing, _, reason) = techniques(&unwanted.bench("on", "auto", 64));
    assert!(!tracing && reason.starts_with("no light that a path from the camera can meet"), "{reason}");

    const BOTH: &str = "\
- sphere: {center: [-1.5, 2, 1], radius: 0.5, emission: {illuminant: {name: D65, scale: 10}}}
lights: [{point: {position: [-1.5, 2, 1], intensity: 9}}]
";
    let (tracing, _, reason) = techniques(&Case { light: BOTH, ..unwanted }.bench("on", "auto", 64));
    assert!(tracing && reason.starts_with("of 1 of 2 lights"), "{reason}");
    let (tracing, _, reason) = techniques(&Case { light: BOTH, depth: "5", ..unwanted }.bench("on", "auto", 64));
    assert!(tracing && reason.starts_with("of 2 lights"), "{reason}");
}

/// Rays meet curves from outside only: what refracts into a fibre of glass leaves it unseen, and a path from the lamp would
/// enter it on the other side. Such light is left to the camera, of the ball too, whose light may go through the fibre. A fibre
/// that light only bounces off, or goes straight through, changes nothing.
#[test]
fn no_light_is_traced_through_fibres_of_glass() {
    let fibre = |material: &str| {
        let curve = format!("- curves: {{name: fibre, file: fibre.txt, basis: linear, material: {material}}}\n{LAMP}");
        let scene = AREA.scene("path", "on", "auto", 64).replace(LAMP, &curve);
        techniques(&bench_with(&scene, &[("fibre.txt", b"0.5 0 0.9 0.05\n1.5 0.5 0.9 0.05\n")]))
    };
    for material in ["glass", "{mask: {opacity: 0.5, material: glass}}", "{hair: {}}"] {
        let (tracing, _, reason) = fibre(material);
        assert!(!tracing && reason.starts_with("light leaves fibre, a curve, unseen"), "{material}: {reason}");
    }
    for material in ["{diffuse: {}}", "{mask: {opacity: 0.5, material: {diffuse: {}}}}", "{mirror: {}}"] {
        let (tracing, _, reason) = fibre(material);
        assert!(tracing, "{material}: {reason}");
    }
}

/// A path from the camera meets no point, so that what the ball throws of its light is found from the lamp alone: where nothing is
/// traced the plan says that it is missing. Of a lamp with an extent chance finds it.
#[test]
fn that_light_of_points_is_missing_where_none_is_traced_is_said() {
    let layers = "layers: [{name: two, light: {path: {max_depth: 2}}}]\n";
    let fibre = "- curves: {name: fibre, file: fibre.txt, basis: linear, material: glass}\n";
    let pane =
        "- disk: {center: [0, 1, -1], normal: [0, 1, 0], radius: 0.5, material: {thin_dielectric: {ior: 1.5}}}\n";
    let endless = "- plane: {point: [0, -5, 0], normal: [0, 1, 0], material: {mirror: {}}}\n";
    let sun = "lights: [directional: {direction: [0.3, -1, -0.2], irradiance: 1}]\n";
    let clay = BALL.replace("glass", "floor");
    let counted = "9, count_crossings: true";
    let hidden = "null, count_crossings: true, hide_emitters: true";
    for (what, caster, depth, more, light) in [
        ("layers of light are measured", BALL, "null", layers, POINT),
        ("light leaves fibre", BALL, "null", fibre, POINT),
        ("panes count", BALL, counted, pane, POINT),
        ("lamps are hidden", BALL, hidden, pane, POINT),
        ("light from infinity cannot be aimed", clay.as_str(), "null", endless, sun),
    ] {
        let said = |light: &str| {
            // Shapes come before what begins a field of its own.
            let more = if more.starts_with('-') { format!("{more}{light}") } else { format!("{light}{more}") };
            let text = Case { what, light: "", depth, ..AREA }.scene("path", "auto", "auto", 64) + &more;
            let curve = ("fibre.txt", b"0.5 0 0.9 0.05\n1.5 0.5 0.9 0.05\n".as_slice());
            techniques(&bench_with(&text.replace(BALL, caster), &[curve]))
        };
        let missing = "what mirrors and glass throw of lamps without extent is missing";
        let (tracing, _, reason) = said(light);
        assert!(!tracing && reason.starts_with(what) && reason.ends_with(missing), "{what}: {reason}");
        let (_, _, reason) = said(LAMP);
        assert!(!reason.contains(missing), "{what}: {reason}");
    }
}

/// Half of a pixel is the least radius of a filter without gaps; below it light from the lights would be little but noise.
#[test]
fn light_is_traced_for_filters_without_gaps() {
    let point = Case { light: POINT, ..AREA };
    for (case, radius, traced) in [(AREA, 0.5, true), (AREA, 0.49, false), (point, 0.49, true)] {
        let filter = format!("height: 24, filter: {{tent: {{radius: {radius}}}}}");
        let scene = case.scene("path", "auto", "auto", 64).replace("height: 24", &filter);
        let (on, _, why) = techniques(&bench_with(&scene, &[]));
        assert!(on == traced && why.contains("gaps") != traced, "{radius}: {why}");
    }
}

/// What no path from the camera can find is traced whatever the seed, be the same thing lit by a panel that they find, or
/// a ball of ground metal beside it, which throws the same lamp's light so that they find it.
#[test]
fn light_that_nothing_else_finds_is_traced_for_every_seed() {
    let mirror = "{mirror: {reflectance: 0.9}}";
    let panel = format!("{LAMP}{POINT}");
    let ground =
        "- sphere: {center: [-1.2, -0.5, 0.3], radius: 0.5, material: {conductor: {metal: silver, roughness: 0.04}}}\n";
    let ground = format!("{ground}{POINT}");
    for (what, light) in [("panel", &panel), ("ground metal", &ground)] {
        for seed in 0..8 {
            let seeded = format!("samples: 256, seed: {seed}");
            let scene = AREA.scene("path", "auto", "auto", 256).replace(GLASS, mirror).replace(LAMP, light);
            let (on, _, why) = techniques(&bench_with(&scene.replace("samples: 256", &seeded), &[]));
            assert!(on, "{what}, {seed}: {why}");
        }
    }
    // A patch of 20 cm of what a mirror of 4 m lights: one path in 20,000 comes there. A ball of 1 mm that is 1.5 m before the mirror
    // takes 1 − √(1 − (r / d)²) = 2e-7 of a hemisphere there: of 65,536 paths from the camera one in seventy renders meets it.
    let ball = "shapes:\n- sphere: {center: [0.5, 2.5, 0], radius: 0.001, emission: 3.2e6}";
    for (seed, is_ball) in (0..12).flat_map(|seed| [(seed, false), (seed, true)]) {
        let close = format!(
            "camera: {{origin: [0, 2, 0], target: [0, 0, 0], up: [0, 0, 1], orthographic_height: 0.2}}\n\
             image: {{width: 32, height: 32}}\nrender: {{samples: 64, seed: {seed}}}\nshapes:\n\
             - rectangle: {{corner: [-4, 0, 4], edge_u: [8, 0, 0], edge_v: [0, 0, -8]}}\n\
             - rectangle: {{corner: [2, 0, 2], edge_u: [0, 4, 0], edge_v: [0, 0, -4], material: {mirror}}}\n\
             lights: [point: {{position: [0.5, 2.5, 0], intensity: 10}}]\n"
        );
        let with_ball = close.replace("shapes:", ball).replace("lights: [point", "lights: [] # [point");
        let close = if is_ball { with_ball } else { close };
        for filter in ["box", "{tent: {radius: 0.3}}"] {
            let filtered = close.replace("height: 32", &format!("height: 32, filter: {filter}"));
            let (on, _, why) = techniques(&bench_with(&filtered, &[]));
            assert!(on, "{seed}, ball: {is_ball}, {filter}: {why}");
        }
    }
}
