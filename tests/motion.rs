//! Motion blur: the mean of a scene over the time for which the shutter is open.

mod common;

use common::place::{Place, pixels};
use serde_json::Value;

/// A camera that looks down on 16 × 4 pixels of 1 m at frame 4.
const FRAME: &str = "image: {width: 16, height: 4}\n\
                     output: {exr: {precision: float, channels: luminance}}\n\
                     render: {samples: 1024, frames: 4}\n";

/// Looks along −z from `x`, which may be keyed; the right of the picture is +x.
fn ortho(x: &str, shutter: &str) -> String {
    let to_world = format!("[[1, 0, 0, {x}], [0, 1, 0, 0], [0, 0, -1, 5], [0, 0, 0, 1]]");
    format!("camera: {{to_world: {to_world}, orthographic_height: 4, shutter: {shutter}}}\n")
}

/// Renders a scene, and gives the luminance of its pixels, with the report.
fn render(scene: &str, further: &[&str]) -> (Vec<f64>, Value) {
    let place = Place::with(&[("scene.yaml", scene), ("sky.pgm", "P2 2 1 255\n0 255\n")]);
    let ran = place.run(&[&["render", "scene.yaml", "-q", "-o", "out.exr", "--report", "r.json"], further].concat());
    assert_eq!(ran.code, 0, "{}\n{scene}", ran.err);
    let channels = pixels(&place.path("out.exr"));
    let (_, luminance) = channels.into_iter().find(|(name, _)| name == "Y").unwrap();
    let luminance = luminance.into_iter().map(|bits| f64::from(f32::from_bits(bits))).collect();
    (luminance, place.json("r.json")["scenes"][0].clone())
}

fn effect(report: &Value) -> String {
    let effects = report["effects"].as_array().unwrap();
    let blur = effects.iter().find(|e| e["name"] == "motion blur").unwrap();
    format!("{} {}", blur["on"], blur["reason"].as_str().unwrap())
}

/// A lit half-plane, x < 0, before a camera that goes four pixels to the right while the shutter is open, from −2 to 2. At
/// 16 moments it stands at x = −1.875, −1.625, … 1.875, and a pixel from a to a + 1 sees the share of it that is lit, min(1, max(0,
/// −(a + x))). Of a sample, lit or not, the variance is at most 1/4: of 1024 the deviation is below 1/64, were they not
/// even spread. Four of those for 64 pixels.
#[test]
fn an_edge_is_blurred_into_a_ramp() {
    let half_plane =
        "shapes: [{rectangle: {corner: [-100, -100, 0], edge_u: [100, 0, 0], edge_v: [0, 200, 0], emission: 1}}]\n";
    for (what, scene) in [
        ("camera", ortho("{0: -16, 8: 16}", "{open: -0.5, close: 0.5, moments: 16}") + half_plane),
        (
            "shape",
            ortho("0", "{open: -0.5, close: 0.5, moments: 16}")
                + &half_plane.replace("emission: 1", "emission: 1, transform: [{translate: [{0: 16, 8: -16}, 0, 0]}]"),
        ),
    ] {
        let (found, report) = render(&(scene + FRAME + "integrator: {path: {max_depth: 1}}\n"), &[]);
        assert_eq!(effect(&report), "true camera.shutter, 1 of a frame at 16 moments: as the scene says");
        for (i, found) in found.iter().enumerate() {
            let left = (i % 16) as f64 - 8.0;
            let moments = (0..16).map(|k| -1.875 + 0.25 * f64::from(k));
            let expected = moments.map(|x| (-(left + x)).clamp(0.0, 1.0)).sum::<f64>() / 16.0;
            assert!((found - expected).abs() < 4.0 / 64.0, "{what}, pixel {i}: expected {expected}, found {found}");
        }
        let mean = found.iter().sum::<f64>() / 64.0;
        // Even spread of 65,536 samples; half of the picture is lit.
        assert!((mean - 0.5).abs() < 0.005, "{what}: {mean}");
    }
}

/// A sky that brightens evenly from 0 to 2 has the mean 1, a floor below it of albedo 1/2 that of 1/2; and the moments,
/// being in the middles of equal times, have just that mean.
#[test]
fn lights_and_materials_are_blurred_too() {
    let sky = "{3: 0, 5: 2}";
    let scene = |of: &str| ortho("0", "2") + FRAME + of;
    let (found, report) = render(&scene(&format!("lights: [{{constant: {{radiance: {sky}}}}}]\n")), &[]);
    assert_eq!(effect(&report), "true camera.shutter, 2 of a frame at 16 moments: what moves travels 0 pixels");
    let mean = |found: &[f64]| found.iter().sum::<f64>() / found.len() as f64;
    // One sample: uniform over 0 to 2, variance 1/3; of 65,536, five deviations.
    assert!((mean(&found) - 1.0).abs() < 5.0 * (1.0 / 3.0 / 65_536f64).sqrt(), "{}", mean(&found));
    let floor = "shapes: [{rectangle: {corner: [-50, -50, 0], edge_u: [100, 0, 0], edge_v: [0, 100, 0], material: {diffuse: {reflectance: {3: 0, 5: 1}}}}}]\n";
    let (found, _) = render(&scene(&format!("{floor}lights: [{{constant: {{radiance: 1}}}}]\n")), &[]);
    assert!((mean(&found) - 0.5).abs() < 5.0 * (1.0 / 12.0 / 65_536f64).sqrt(), "{}", mean(&found));
}

/// What does not change while the shutter is open is the very picture without one.
#[test]
fn a_shutter_before_what_stands_still_changes_nothing() {
    let scene = |shutter: &str| {
        ortho("{0: 0, 3: 1, 5: 1, 6: 0}", shutter)
            + FRAME
            + "shapes: [{sphere: {radius: 1.5}}]\nlights: [{constant: {radiance: 1}}]\n"
    };
    let (_, still) = render(&scene("null"), &["--spp", "16"]);
    let (_, open) = render(&scene("1.5"), &["--spp", "16"]);
    assert_eq!(open["pixel_hash"], still["pixel_hash"]);
    assert_eq!(effect(&open), "false nothing changes while the shutter is open");
    assert!(!still["effects"].to_string().contains("motion blur"));
    let (_, longer) = render(&scene("3"), &["--spp", "16"]);
    assert!(longer["pixel_hash"] != still["pixel_hash"] && effect(&longer).starts_with("true"));
    // The scene at its frame is the same, and the picture is not: what it is on the way counts.
    let (_, faster) = render(&scene("3").replace("6: 0", "6: 9"), &["--spp", "16"]);
    assert!(faster["scene_hash"] != longer["scene_hash"]);
    let (_, whitted) = render(&scene("3"), &["--set", "integrator=whitted"]);
    assert_eq!(effect(&whitted), "false whitted draws no times");
}

/// As many moments as the fastest thing travels pixels, 16 to 64.
#[test]
fn moments_are_as_many_as_pixels_that_are_travelled() {
    let scene = |way: u32| {
        ortho("0", "1")
            + FRAME
            + "lights: [{constant: {radiance: 1}}]\nimage: {width: 160, height: 40}\n"
            + &format!("shapes: [{{sphere: {{radius: 1, center: [{{3: 0, 4: {way}}}, 0, 0]}}}}]\n")
    };
    for (way, said) in [(1, "16 moments: what moves travels 5 pixels"), (8, "40 moments: what moves travels 40 pixels")]
    {
        let scene = scene(way).replacen("image: {width: 16, height: 4}\n", "", 1);
        let (_, report) = render(&scene, &["--spp", "1"]);
        assert!(effect(&report).ends_with(said), "{}", effect(&report));
    }
}

/// What has no end is passed as well. A camera of parallel rays goes 4 m along a wall while the shutter is open, at ten
/// pixels a metre. One whose picture is 64 pixels and 1° wide turns toward a place 1 m before it, which goes from t/2 to t to
/// the right: at the tangent of half a degree over 32 pixels t/2 is 40 of them, and more than the picture is wide.
#[test]
fn moments_are_as_many_as_pixels_of_planes_and_skies_that_are_passed() {
    let wall = ortho("{3: 0, 4: 8}", "1") + "image: {width: 160, height: 40}\nshapes: [{plane: {normal: [0, 0, 1]}}]\n";
    let t = 2.0 * 40.0 * 0.5f64.to_radians().tan() / 32.0;
    let sky = format!(
        "camera: {{origin: [0, 0, 0], target: {{3: [0, 0, -1], 4: [{t}, 0, -1]}}, fov_deg: 1, shutter: 1}}\n\
         image: {{width: 64, height: 8}}\nlights: [environment: {{file: sky.pgm}}]\n"
    );
    for scene in [wall, sky] {
        let (_, report) = render(&(scene + &FRAME.replacen("image: {width: 16, height: 4}\n", "", 1)), &["--spp", "1"]);
        assert!(effect(&report).ends_with("40 moments: what moves travels 40 pixels"), "{}", effect(&report));
    }
}

/// What comes back to where it was has been on its way: a ball that goes once around at 1.6 m, eight pixels a metre, the outermost corner of
/// whose box goes 84 of them; the blades of a fan, a quarter of a turn of 1 m at 29 pixels a metre, 46.
/// Of what light and pictures do nobody knows how far it goes.
#[test]
fn moments_are_as_many_as_pixels_of_ways_that_are_not_straight() {
    let camera = |height: f64| {
        format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], orthographic_height: {height}, shutter: 1}}\n\
             image: {{width: 64, height: 64}}\nrender: {{samples: 1, frames: 0}}\n\
             output: {{exr: {{precision: float, channels: luminance}}}}\n"
        )
    };
    let turn =
        |degrees: u32| format!("transform: [{{rotate: {{axis: [0, 0, 1], deg: {{-1: -{degrees}, 1: {degrees}}}}}}}]");
    let orbit = format!("shapes: [{{sphere: {{radius: 0.08, center: [1.6, 0, 0], emission: 1, {}}}}}]\n", turn(360));
    let fan = format!(
        "groups: {{fan: [rectangle: {{corner: [-1, -0.01, 0], edge_u: [2, 0, 0], edge_v: [0, 0.02, 0]}}]}}\n\
         shapes: [{{instance: {{group: fan, {}}}}}]\nlights: [{{constant: {{radiance: 1}}}}]\n",
        turn(90)
    );
    let wall = "shapes: [{plane: {normal: [0, 0, 1]}}]\n";
    let sweep = format!(
        "{wall}lights: [{{spot: {{position: [0, 0, 4], target: {{-1: [-4, 0, 0], 1: [4, 0, 0]}}, cutoff_deg: 1, intensity: 30}}}}]\n"
    );
    let slide = format!(
        "textures: {{b: {{image: {{file: sky.pgm, offset: {{-1: [0.8, 0], 1: [-0.8, 0]}}}}}}}}\n\
         {wall}materials: {{m: {{diffuse: {{reflectance: {{texture: b}}}}}}}}\nlights: [{{constant: {{radiance: 1}}}}]\n"
    )
    .replace("normal: [0, 0, 1]", "normal: [0, 0, 1], material: m");
    // Legs of an eighth of the way are straight: 8 sin(π/8) / π of a whole turn, which is 82 pixels.
    for (height, scene, said) in [
        (8.0, &orbit, "64 moments: what moves travels 82 pixels"),
        (2.2, &fan, "46 moments: what moves travels 46 pixels"),
        (4.0, &sweep, "64 moments: lamps or textures move"),
        (4.0, &slide, "64 moments: lamps or textures move"),
    ] {
        let (_, report) = render(&(camera(height) + scene), &[]);
        assert!(effect(&report).ends_with(said), "{}", effect(&report));
    }
}

/// For how long the shutter is open, and at how many moments, is said for the frame.
#[test]
fn a_keyed_shutter_is_that_of_its_frame() {
    let moments = |shutter: &str, x: &str| {
        let scene =
            ortho(x, shutter) + FRAME + "lights: [{constant: {radiance: 1}}]\nshapes: [{sphere: {radius: 1}}]\n";
        effect(&render(&scene, &["--spp", "1"]).1)
    };
    assert_eq!(moments("{0: 0.25, 8: 0.75}", "0"), "false nothing changes while the shutter is open");
    let said = moments("{open: -0.5, close: 0.5, moments: {0: 16, 8: 32}}", "{0: 0, 8: 1}");
    assert_eq!(said, "true camera.shutter, 1 of a frame at 24 moments: as the scene says");
}

/// The channels of a scene, by name.
fn planes(scene: &str) -> std::collections::BTreeMap<String, Vec<f32>> {
    let place = Place::with(&[("scene.yaml", scene), ("sky.pgm", "P2 2 1 255\n0 255\n")]);
    let ran = place.run(&["render", "scene.yaml", "-q", "-o", "out.exr"]);
    assert_eq!(ran.code, 0, "{}\n{scene}", ran.err);
    let floats = |bits: Vec<u32>| bits.into_iter().map(f32::from_bits).collect();
    pixels(&place.path("out.exr")).into_iter().map(|(name, bits)| (name, floats(bits))).collect()
}

/// A lamp of no group that is dark at the frame and flashes while the shutter is open has its layer there, and what the groups have is the
/// picture, to roundings of f32.
#[test]
fn lamps_that_are_dark_at_the_frame_have_their_layer() {
    let scene = |shutter: &str| {
        format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 30, shutter: {shutter}}}\n\
             image: {{width: 8, height: 8}}\nrender: {{frames: 0, samples: 16}}\noutput: {{exr: {{precision: float}}}}\n\
             light_groups: {{key: [k]}}\nlayers: [light_groups]\nshapes: [{{sphere: {{radius: 1}}}}]\nlights:\n\
             - point: {{name: k, position: [3, 3, 3], intensity: 3}}\n\
             - point: {{name: flash, position: [-3, 3, 3], intensity: {{0: 0, 0.5: 20}}}}\n"
        )
    };
    let (blurred, still) = (planes(&scene("1")), planes(&scene("null")));
    assert!(blurred.keys().eq(still.keys()), "{:?}", still.keys());
    for (i, all) in blurred["G"].iter().enumerate() {
        let parts = blurred["light_key.G"][i] + blurred["light_default.G"][i];
        assert!((parts - all).abs() <= 1e-6 * all, "{parts} {all}");
    }
    assert!(blurred["light_default.G"].iter().any(|g| *g > 0.0) && still["light_default.G"].iter().all(|g| *g == 0.0));
}

/// A ball of metal that is smooth at the frame and rough at all moments of the shutter throws no caustic.
#[test]
fn what_is_sharp_is_told_at_each_moment() {
    let caustic = |rough: &str| {
        let found = planes(&format!(
            "camera: {{origin: [0, 2, 5], target: [0, 0, 0], fov_deg: 40, shutter: {{open: 0, close: 4, moments: 4}}}}\n\
             image: {{width: 8, height: 8}}\nrender: {{frames: 0, samples: 16}}\noutput: {{exr: {{precision: float}}}}\n\
             layers: [caustic]\nlights: [{{constant: {{radiance: 1}}}}]\nshapes:\n- plane: {{point: [0, -1, 0], normal: [0, 1, 0]}}\n\
             - sphere: {{radius: 1, material: {{conductor: {{metal: Au, roughness: {rough}}}}}}}\n"
        ));
        found["caustic.G"].iter().sum::<f32>()
    };
    assert_eq!(caustic("{0: 0, 0.25: 0.5}"), 0.0);
    assert!(caustic("{0: 0.5, 0.25: 0}") > 0.0);
}

/// The sky turns by 9° to the next frame, whether another light from everywhere is dark there or not.
#[test]
fn the_motion_of_a_sky_is_its_own() {
    let motion = |end: &str| {
        let found = planes(&format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 8, height: 8}}\nintegrator: none\n\
             layers: [motion]\nrender: {{frames: 0, samples: 1}}\noutput: {{exr: {{precision: float}}}}\nlights:\n\
             - constant: {{radiance: {{0: 0.1, 1: {end}}}}}\n- environment: {{file: sky.pgm, rotate_deg: {{0: 0, 10: 90}}}}\n"
        ));
        found["motion.X"].clone()
    };
    let found = motion("0");
    assert!(found == motion("0.05") && found.iter().all(|x| x.abs() > 1.0), "{found:?}");
}

/// A point lamp, a ball of glass and a floor, with whatever else.
fn caustic(eye: &str, lamp: &str, ball: &str, further: &str) -> String {
    format!(
        "image: {{width: 16, height: 16}}\n\
         output: {{exr: {{precision: float, channels: luminance, stderr: true}}}}\n\
         render: {{frames: 0, samples: 256}}\n\
         camera: {{origin: {eye}, target: [0, 0.5, 0], fov_deg: 40, {further}}}\n\
         lights: [point: {{position: {lamp}, intensity: 10}}]\n\
         shapes:\n\
         - rectangle: {{corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: {{diffuse: {{reflectance: 0.5}}}}}}\n\
         - sphere: {{center: {ball}, radius: 0.5, material: {{dielectric: {{ior: 1.5}}}}}}\n"
    )
}

/// The mean luminance of a picture, its standard error from those of the pixels, and the report.
fn mean(scene: &str, further: &[&str]) -> (f64, f64, Value) {
    let place = Place::with(&[("scene.yaml", scene), ("sky.pgm", "P2 2 1 255\n0 255\n")]);
    let ran = place.run(&[&["render", "scene.yaml", "-q", "-o", "out.exr", "--report", "r.json"], further].concat());
    assert_eq!(ran.code, 0, "{}\n{scene}", ran.err);
    let channels = pixels(&place.path("out.exr"));
    let of = |name: &str| -> Vec<f64> {
        let (_, bits) = channels.iter().find(|(n, _)| n == name).unwrap();
        bits.iter().map(|bits| f64::from(f32::from_bits(*bits))).collect()
    };
    let (light, errors) = (of("Y"), of("stderr.Y"));
    let n = light.len() as f64;
    let error = errors.iter().map(|e| e * e).sum::<f64>().sqrt() / n;
    (light.iter().sum::<f64>() / n, error, place.json("r.json")["scenes"][0].clone())
}

fn technique(report: &Value, name: &str) -> String {
    let all = report["techniques"].as_array().unwrap();
    let found = all.iter().find(|e| e["name"] == name).unwrap();
    format!("{} {}", found["on"], found["reason"].as_str().unwrap())
}

/// A ball that moves behind the camera changes no light. Five standard errors of the difference.
#[test]
fn light_that_glass_throws_is_there_while_other_things_move() {
    let (eye, lamp, ball) = ("[0, 1, 3.5]", "[0.5, 2, 0]", "[0.2, 0.7, 0]");
    let moving = caustic(eye, lamp, ball, "shutter: {open: 0, close: 1}")
        + "- sphere: {center: {0: [0, 1, 20], 1: [0, 1, 21]}, radius: 0.1}\n";
    for merging in ["on", "off"] {
        let set = ["--set", &format!("render.techniques.merging={merging}")];
        let (still, error, _) = mean(&caustic(eye, lamp, ball, ""), &set);
        let (found, error_found, report) = mean(&moving, &set);
        assert!(effect(&report).starts_with("true") && technique(&report, "light tracing").starts_with("true"));
        assert!(technique(&report, "photon merging").starts_with(if merging == "on" { "true" } else { "false" }));
        let allowed = 5.0 * error.hypot(error_found);
        assert!((found - still).abs() < allowed, "{merging}: expected {still}, found {found} ± {error_found}");
    }
}

/// Camera, lamp and ball move: at two moments, a quarter and three quarters of the way, the picture is the mean of those with
/// the places written in. Five standard errors of the difference.
#[test]
fn light_that_moving_glass_throws_is_the_mean_of_its_moments() {
    let path = |from: [f64; 3], to: [f64; 3]| {
        let at = |t: f64| format!("{:?}", [0, 1, 2].map(|k| from[k] + t * (to[k] - from[k])));
        [format!("{{0: {from:?}, 1: {to:?}}}"), at(0.25), at(0.75)]
    };
    let eye = path([0.0, 1.0, 3.5], [0.5, 1.5, 3.5]);
    let lamp = path([0.5, 2.0, 0.0], [-0.5, 2.5, 0.5]);
    let ball = path([0.7, 0.7, 0.0], [-0.6, 0.9, 0.3]);
    for merging in ["on", "off"] {
        let set = ["--set", &format!("render.techniques.merging={merging}")];
        let stills = [1, 2].map(|k| mean(&caustic(&eye[k], &lamp[k], &ball[k], ""), &set));
        let shutter = "shutter: {open: 0, close: 1, moments: 2}";
        let (found, error, report) = mean(&caustic(&eye[0], &lamp[0], &ball[0], shutter), &set);
        assert!(technique(&report, "light tracing").starts_with("true"));
        let expected = 0.5 * (stills[0].0 + stills[1].0);
        let allowed = 5.0 * error.hypot(0.5 * stills[0].1.hypot(stills[1].1));
        assert!((found - expected).abs() < allowed, "{merging}: expected {expected}, found {found} ± {error}");
        assert!((stills[0].0 - stills[1].0).abs() > allowed, "the two differ");
    }
}

/// A lamp of 1 W·sr⁻¹·nm⁻¹ goes 2 m to the right, 1 m before a wall of albedo 1/2, of which 1 m² about the middle of its way is seen: the
/// wall shows ρ/π · cos/d² = ρ/π · (1 + x² + y²)^(−3/2) from beneath it, in the mean over the moments and over the wall, by midpoints, of
/// which a finer grid changes less than 1e-3. The scene at the frame is 1.29 times as bright. Five standard errors.
#[test]
fn light_from_a_lamp_that_moves_is_the_mean_of_its_moments_by_paths_from_either_end() {
    let scene = ortho("0", "1").replace("orthographic_height: 4", "orthographic_height: 1")
        + "image: {width: 8, height: 8}\nrender: {samples: 4096, frames: 4}\n\
           output: {exr: {precision: float, channels: luminance, stderr: true}}\n\
           lights: [point: {position: {3: [-2, 0, 1], 5: [2, 0, 1]}, intensity: 1}]\n\
           shapes: [{plane: {normal: [0, 0, 1], material: {diffuse: {reflectance: 0.5}}}}]\n";
    let middles =
        |n: u32, from: f64, to: f64| (0..n).map(move |i| from + (to - from) * (f64::from(i) + 0.5) / f64::from(n));
    let at = |lamp: f64, x: f64, y: f64| (1.0 + (x - lamp).powi(2) + y * y).powf(-1.5);
    let over_wall = |lamp: f64| -> f64 {
        let row = |x: f64| middles(32, -0.5, 0.5).map(|y| at(lamp, x, y)).sum::<f64>();
        middles(32, -0.5, 0.5).map(row).sum::<f64>() / 1024.0
    };
    let share = 0.5 / std::f64::consts::PI;
    let expected = share * middles(64, -1.0, 1.0).map(over_wall).sum::<f64>() / 64.0;
    assert!(expected < 0.85 * share * over_wall(0.0));
    for integrator in ["path", "light_tracer"] {
        let (found, error, report) = mean(&scene, &["--set", &format!("integrator={integrator}")]);
        assert_eq!(effect(&report), "true camera.shutter, 1 of a frame at 64 moments: lamps or textures move");
        let off = (found - expected).abs();
        assert!(off < 5.0 * error + 1e-3 * expected, "{integrator}: expected {expected}, found {found} ± {error}");
        assert!(error < 0.02 * expected, "{integrator}: too noisy to tell, {error}");
    }
}

/// A camera, a ball and a lamp that is in view move: the same light by paths from either end, and other light than at the frame. Five
/// standard errors of the difference.
#[test]
fn all_that_moves_is_blurred_alike_by_paths_from_either_end() {
    let scene = "camera: {origin: {3: [0, 1, 6], 5: [0, 1, 2]}, target: [0, 0.5, 0], fov_deg: 40, shutter: 1}\n\
         image: {width: 16, height: 16}\nrender: {samples: 1024, frames: 4}\n\
         output: {exr: {precision: float, channels: luminance, stderr: true}}\n\
         shapes:\n\
         - plane: {normal: [0, 1, 0], material: {diffuse: {reflectance: 0.5}}}\n\
         - sphere: {center: {3: [-2, 0.5, 0], 5: [2, 0.5, 0]}, radius: 0.5, material: {diffuse: {reflectance: 0.5}}}\n\
         - sphere: {center: {3: [6, 1.4, 0], 5: [-6, 1.4, 0]}, radius: 0.3, emission: 5, material: {diffuse: {reflectance: 0}}}\n";
    let of = |integrator: &str, shutter: &str| {
        let set = ["--set", &format!("integrator={integrator}"), "--set", &format!("camera.shutter={shutter}")];
        mean(scene, &set)
    };
    let (expected, error, _) = of("path", "1");
    let (found, error_found, report) = of("light_tracer", "1");
    assert!(effect(&report).starts_with("true camera.shutter"), "{}", effect(&report));
    let allowed = 5.0 * error.hypot(error_found);
    assert!((found - expected).abs() < allowed, "expected {expected} ± {error}, found {found} ± {error_found}");
    let (still, ..) = of("light_tracer", "null");
    assert!((still - expected).abs() > allowed, "the two differ: {still}, {expected}, {allowed}");
}

/// A picture that no shutter has blurred has none in its header.
#[test]
fn only_pictures_that_know_of_the_shutter_name_it() {
    let scene = ortho("{0: -16, 8: 16}", "0.5") + FRAME + "lights: [{constant: {radiance: 1}}]\n";
    let place = Place::of(&scene);
    for (integrator, named) in [("path", true), ("light_tracer", true), ("whitted", false)] {
        let set = format!("integrator={integrator}");
        let file = format!("{integrator}.exr");
        let ran = place.run(&["render", "scene.yaml", "-q", "-o", &file, "--set", &set]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        let told = place.run(&["info", &file]);
        assert_eq!(told.out.contains("shutterAngle"), named, "{integrator}: {}", told.out);
    }
}

/// A lamp that is out at some moments has no number there by which its paths could be told.
#[test]
fn a_lamp_that_goes_on_is_told() {
    let scene = caustic("[0, 1, 3.5]", "[0.5, 2, 0]", "[0.2, 0.7, 0]", "shutter: {open: 0, close: 1, moments: 4}")
        .replace("intensity: 10", "intensity: {keys: [[0, 0], [0.5, 10]], interpolation: step}");
    let (_, _, report) = mean(&scene, &["--spp", "4"]);
    let said = technique(&report, "light tracing");
    assert!(said.starts_with("false a lamp goes on or off") && said.ends_with("is missing"), "{said}");
}

#[test]
fn parts_of_a_blurred_picture_make_it_up() {
    let scene = ortho("{0: -16, 8: 16}", "0.5")
        + FRAME
        + "shapes: [{sphere: {radius: 1.5, material: {dielectric: {ior: 1.5}}}}]\nlights: [{constant: {radiance: 1}}]\n";
    let place = Place::of(&scene);
    let run = |arguments: &[&str]| {
        let ran = place.run(arguments);
        assert_eq!(ran.code, 0, "{}", ran.err);
    };
    let common = ["render", "scene.yaml", "-q", "--spp", "12", "-o"];
    run(&[&common[..], &["whole.exr", "--threads", "1"]].concat());
    for (i, samples) in ["0-4", "5-11"].iter().enumerate() {
        for tile in ["0/2", "1/2"] {
            let name = format!("parts/{i}-{}.exr", &tile[..1]);
            run(&[&common[..], &[&name, "--tile", tile, "--samples", samples, "--threads", "2"]].concat());
        }
    }
    run(&["merge", "parts", "-q", "-o", "merged.exr"]);
    assert!(pixels(&place.path("merged.exr")) == pixels(&place.path("whole.exr")));
}

#[test]
fn a_shutter_that_cannot_be_is_refused() {
    let says = |shutter: &str| {
        let place = Place::of(&format!("{}lights: []\n", ortho("0", shutter)));
        let ran = place.run(&["render", "scene.yaml", "-q"]);
        assert_eq!(ran.code, 2, "{}", ran.err);
        ran.err
    };
    assert!(says("0").contains("camera.shutter: expected a number greater than 0, found 0"));
    assert!(
        says("180").contains("camera.shutter: expected at most 8 frames (a shutter of 180° is 0.5), or when it opens")
    );
    assert!(says("180").contains(", found 180"), "{}", says("180"));
    let far = says("{open: -8e307, close: 8e307}");
    assert!(far.contains("camera.shutter.open: expected a number of frames from -1e9 to 1e9, found -8e307"), "{far}");
    assert!(says("{open: 1, close: 0}").contains("camera.shutter: expected open before close, found 1 and 0"));
    assert!(
        says("{open: 0, close: 1, moments: 1}")
            .contains("camera.shutter.moments: expected a whole number from 2 to 256, found 1")
    );
    assert!(says("half").contains("camera.shutter: expected"), "{}", says("half"));
}

/// Lamps in fog that shine only for a part of the time: distances are drawn toward those that do, at each moment. The mean of the
/// picture is that of flights alone, to five standard errors as the pictures tell them.
#[test]
fn lamps_in_fog_may_go_on_and_off_while_the_shutter_is_open() {
    let scene = "camera: {origin: [0, 0.2, 4], target: [0, 0, 0], fov_deg: 40, shutter: 4}\nimage: {width: 16, height: 12}\n\
         output: {exr: {precision: float, channels: luminance}}\nrender: {samples: 512, frames: 1}\n\
         media: {fog: {homogeneous: {scattering: 0.2, absorption: 0.02}}}\nmedium: fog\n\
         shapes:\n- plane: {point: [0, -1.2, 0], normal: [0, 1, 0], material: {diffuse: {reflectance: 0.6}}}\n\
         - sphere: {center: [0.4, 1.9, 0.3], radius: 0.1, emission: {0: 0, 1: 40, 2: 0}}\n\
         - sphere: {center: [-0.6, 1.9, 0.3], radius: 0.1, emission: 30}\n\
         lights:\n- point: {position: [0, 2, 0], intensity: {0: 0, 1: 3, 2: 0}}\n";
    let with = |value: &str| {
        let (luminance, report) = render(scene, &["--set", &format!("render.techniques.equiangular={value}")]);
        let pixels = luminance.len() as f64;
        let error = report["error"]["rel_rmse"].as_f64().unwrap() / pixels.sqrt();
        (luminance.iter().sum::<f64>() / pixels, error)
    };
    let ((on, error_on), (off, error_off)) = (with("on"), with("off"));
    let error = (error_on * error_on + error_off * error_off).sqrt();
    assert!((on / off - 1.0).abs() < 5.0 * error && error < 0.01, "{on} {off} {error}");
}
