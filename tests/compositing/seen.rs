//! What layers say of what is seen, in closed form: where it moves, which surface it is, in which colours.

use super::common::ball_of_distances;
use super::{FRAME, common, plane, render};
use abbe::batch::{self, Overrides};
use abbe::film::cryptomatte::id_of;
use abbe::film::exr::header::read_headers;
use abbe::film::exr::{ExrPart, read_exr};
use abbe::spectrum::catalogue;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

/// Pixels a metre at 1 m from a camera of 40° across 64 pixels.
const SCALE: f64 = 32.0 / 0.363_970_234_266_202_4;

/// Frame 1 of two, 64 × 48 pixels, with `files` beside it.
fn first_of_two(yaml: &str, files: &[(&str, Vec<u8>)]) -> ExrPart {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    for (name, bytes) in files {
        common::write(&path(name), bytes);
    }
    let text = format!(
        "image: {{width: 64, height: 48}}\nrender: {{samples: 1, frames: '1-2'}}\noutput: {{exr: {{precision: float}}}}\n\
         layers: [motion, Z, P]\n{yaml}"
    );
    common::write(&path("scene.yaml"), text.as_bytes());
    let overrides = Overrides { output: Some(path("out")), ..Overrides::default() };
    let report = batch::render_batch(&path("scene.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
    read_exr(&path("out/scene.0001.exr")).unwrap().parts.remove(0)
}

/// Under a camera that stands still nothing moves on the picture, whatever its projection and where it begins to see; where it
/// pans by an angle a, the sky above its middle moves by tan a.
#[test]
fn the_sky_moves_with_the_camera_alone() {
    let scene = |camera: &str| {
        let sky = "lights: [{constant: {radiance: {1: 1, 2: 0.9}}}]\nshapes: [{sphere: {radius: 1}}]\n";
        first_of_two(&format!("camera: {{origin: [0, 0, 6], {camera}}}\n{sky}"), &[])
    };
    for view in
        ["fov_deg: 40", "fov_deg: 40, clip: {near: 2}", "fov_deg: 40, clip: {far: 5.5}", "orthographic_height: 4"]
    {
        let part = scene(&format!("target: [0, 0, 0], {view}"));
        for (i, z) in plane(&part, "Z").iter().enumerate() {
            let [x, y] = ["motion.X", "motion.Y"].map(|name| plane(&part, name)[i]);
            // f32 of what is exact to some roundings of f64 times 64 pixels.
            assert!(x.abs().max(y.abs()) < 1e-9, "{view}: {x} {y} at {i}, depth {z}");
        }
    }
    for clip in ["", ", clip: {near: 2}"] {
        let part = scene(&format!("target: {{1: [0, 0, 0], 2: [0.36, 0, 0]}}, fov_deg: 40{clip}"));
        let sky = f64::from(plane(&part, "motion.X")[2 * 64 + 32]);
        // Half a pixel beside the middle, b = 1/2 SCALE, it is tan(a + b) - b: 4e-4 more than tan a.
        let expected = -SCALE * 0.06;
        assert!((sky / expected - 1.0).abs() < 1e-3, "{sky} {expected}");
    }
}

/// The picture of a sky that turns by 5° about y, by which +x turns toward -z: what is seen at tan a beside the middle is at
/// tan(a - 5°) a frame later, whatever its height. Where an even sky shines, too, the picture is what moves.
#[test]
fn a_sky_that_turns_moves() {
    let mut sky = b"PF\n2 1\n-1.0\n".to_vec();
    sky.extend([1f32, 1.0, 1.0, 2.0, 1.0, 1.0].iter().flat_map(|x| x.to_le_bytes()));
    for even in ["", "constant: {radiance: 1}}, {"] {
        let part = first_of_two(
            &format!(
                "camera: {{origin: [0, 0, 0], target: [0, 0, -1], fov_deg: 40}}\n\
                 lights: [{{{even}environment: {{file: sky.pfm, rotate_deg: {{1: 0, 2: 5}}}}}}]\n"
            ),
            &[("sky.pfm", sky.clone())],
        );
        for (i, found) in plane(&part, "motion.X").iter().enumerate() {
            let place = ((i % 64) as f64 + 0.5 - 32.0) / SCALE;
            let expected = SCALE * ((place.atan() - 5f64.to_radians()).tan() - place);
            // f32 of some pixels.
            assert!((f64::from(*found) - expected).abs() < 1e-5, "{even}: {found}, not {expected}, at {i}");
        }
    }
}

/// Curves and grids of distances that turn by 10° about the line of sight and are moved: each point they show is carried
/// along. P is written in 32 bits, 2⁻²⁴ of some metres, which are seen at 30 pixels a metre.
#[test]
fn curves_and_grids_carry_their_points_along() {
    let hair = b"-1 0 0 0.3\n1 0 0 0.3\n".to_vec();
    let bend = b"-2 -0.5 0 0.2\n-0.7 0.2 0 0.3\n0.7 0.2 0.3 0.3\n2 -0.5 0 0.2\n2.5 -1 0 0.2\n".to_vec();
    let files = [("hair.txt", hair), ("bend.txt", bend), ("ball.vol", ball_of_distances())];
    let turn =
        "transform: [{rotate: {axis: [0, 0, 1], deg: {1: 0, 2: 10}}}, {translate: {1: [0, 0, 0], 2: [0.3, 0.1, 0.2]}}]";
    for shape in [
        format!("curves: {{file: hair.txt, {turn}}}"),
        format!("curves: {{file: bend.txt, basis: bspline, {turn}}}"),
        format!("sdf_grid: {{file: ball.vol, {turn}}}"),
    ] {
        let part = first_of_two(
            &format!(
                "camera: {{origin: [0, 0, 6], target: [0, 0, 0], fov_deg: 40}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
                 shapes: [{{{shape}}}]\n"
            ),
            &files,
        );
        let mut seen = 0;
        for (i, z) in plane(&part, "Z").iter().enumerate().filter(|(_, z)| **z < 1e9) {
            let [x, y, height] = ["P.X", "P.Y", "P.Z"].map(|name| f64::from(plane(&part, name)[i]));
            let (sin, cos) = 10f64.to_radians().sin_cos();
            let to = [x * cos - y * sin + 0.3, x * sin + y * cos + 0.1, height + 0.2];
            let on = |p: [f64; 3]| [p[0], p[1]].map(|c| SCALE * c / (6.0 - p[2]));
            let (before, after) = (on([x, y, height]), on(to));
            let motion = ["motion.X", "motion.Y"].map(|name| f64::from(plane(&part, name)[i]));
            let off = (0..2).map(|k| (motion[k] - (after[k] - before[k])).abs()).fold(0.0, f64::max);
            assert!(off < 1e-4, "{shape}: off by {off} at {i}, depth {z}");
            seen += 1;
        }
        assert!(seen > 40, "{shape}: {seen}");
    }
}

/// A camera whose own coordinates are scaled still measures depth in metres.
#[test]
fn depth_is_in_metres_whatever_the_scale_of_the_camera() {
    let part = render(
        "camera: {to_world: [[-2, 0, 0, 0], [0, 2, 0, 0], [0, 0, -2, 6], [0, 0, 0, 1]], orthographic_height: 4}\n\
         image: {width: 8, height: 8}\nrender: {samples: 1}\noutput: {exr: {precision: float}}\n\
         layers: [Z, {name: d, surface: depth}]\nlights: [{constant: {radiance: 1}}]\n\
         shapes: [{plane: {normal: [0, 0, 1]}}]\n",
    );
    assert!(plane(&part, "Z").iter().chain(plane(&part, "d.T")).all(|z| (z - 6.0).abs() < 1e-5));
}

/// Normal and albedo are those of what the camera sees: through the box of a medium, through a lamp that is hidden, through the
/// holes of a card, be they a mask's or parts of a blend, in which a pixel is a mean; with the relief of a material that is within
/// another. In daylight grey is grey, whatever the sensitivity of the film.
#[test]
fn normal_and_albedo_are_of_what_is_seen() {
    let scene = |front: &str| {
        render(&format!(
            "camera: {{origin: [0, 0, 6], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 8, height: 8, sensitivity: 50}}\n\
             integrator: {{path: {{hide_emitters: true}}}}\nrender: {{samples: 1024}}\noutput: {{exr: {{precision: float}}}}\n\
             media: {{haze: {{homogeneous: {{extinction: 0.01, albedo: 0.8}}}}}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             layers: [normal, albedo]\nshapes:\n\
             - plane: {{normal: [0.6, 0, 0.8], material: {{diffuse: {{reflectance: 0.5}}}}}}\n{front}"
        ))
    };
    let lamp = "- rectangle: {corner: [-5, -5, 3], edge_u: [10, 0, 0], edge_v: [0, 10, 0], emission: 1}\n";
    let card = "- rectangle: {corner: [-5, -5, 3], edge_u: [10, 0, 0], edge_v: [0, 10, 0], material: {mask: {opacity: 0.25, \
                material: {diffuse: {reflectance: 0.9}}}}}\n";
    let blend = "- rectangle: {corner: [-5, -5, 3], edge_u: [10, 0, 0], edge_v: [0, 10, 0], material: {blend: {weight: 0.25, \
                 first: {boundary: {}}, second: {diffuse: {reflectance: 0.9}}}}}\n";
    let haze = "- cube: {center: [0, 0, 3], size: 2, inside: haze, material: {boundary: {}}}\n";
    for (front, share) in [("", 0.0), (haze, 0.0), (lamp, 0.0), (card, 0.25), (blend, 0.25)] {
        let part = scene(front);
        let mean = |name: &str| f64::from(plane(&part, name).iter().sum::<f32>()) / 64.0;
        // 1024 evenly spread samples decide on the card: a pixel is off by few of them, the mean of 64 pixels by less than one.
        for (name, wall, front) in [("normal.X", 0.6, 0.0), ("normal.Z", 0.8, 1.0)] {
            let expected = wall + (front - wall) * share;
            assert!((mean(name) - expected).abs() < 1e-3, "{front}: {name} {}", mean(name));
        }
        // Wavelengths are evenly spread, too: 64 · 1024 sets of eight.
        for name in ["albedo.R", "albedo.G", "albedo.B"] {
            let expected = 0.5 + (0.9 - 0.5) * share;
            assert!((mean(name) - expected).abs() < 2e-3, "{front}: {name} {}", mean(name));
        }
    }
}

/// What has nothing diffuse has a colour as well, whatever its roughness: metal and mirrors what they reflect along the normal,
/// clear things what they reflect and let through. A diffuse ball of that reflectance has the same albedo, by the same
/// wavelengths; that of metal is written at whole nanometres, between which it is off by an eighth of its second difference, 1e-4
/// at most.
#[test]
fn albedo_is_a_colour_whatever_the_roughness() {
    let ball = |material: &str| {
        render(&format!(
            "camera: {{origin: [0, 0, 6], target: [0, 0, 0], fov_deg: 10}}\nimage: {{width: 8, height: 8}}\n\
             render: {{samples: 8, wavelengths: visible}}\noutput: {{exr: {{precision: float}}}}\nlayers: [albedo]\n\
             lights: [{{constant: {{radiance: 1}}}}]\nshapes: [{{sphere: {{radius: 1, material: {{{material}}}}}}}]\n"
        ))
    };
    let (eta, k) = catalogue::metal("gold").unwrap();
    let reflectance = |nm: f64| {
        let (n, k) = (eta.at(nm), k.at(nm));
        ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)
    };
    let gold: Vec<String> = (360..=830).map(|nm| format!("[{nm}, {}]", reflectance(f64::from(nm)))).collect();
    let gold = format!("{{table: [{}]}}", gold.join(", "));
    let tints = "reflection_tint: 0.5, transmission_tint: 0.5";
    for (reflectance, materials) in [
        (
            gold.as_str(),
            [
                "conductor: {metal: gold}",
                "conductor: {metal: gold, roughness: 0.1}",
                "conductor: {metal: gold, roughness: {u: 0.1, v: 0.5}}",
                &format!("mirror: {{reflectance: {gold}}}"),
            ],
        ),
        (
            "1",
            [
                "dielectric: {ior: {glass: SF11}}",
                "dielectric: {ior: 1.5, roughness: 0.2, film: {ior: 2, thickness_nm: 300}}",
                "thin_dielectric: {ior: 1.5}",
                "thin_dielectric: {ior: 1.33, thickness_nm: 400}",
            ],
        ),
        (
            "0.5",
            [
                &format!("dielectric: {{ior: 1.5, {tints}}}"),
                &format!("thin_dielectric: {{ior: 1.5, {tints}}}"),
                "principled: {base_color: 0.5, metallic: 1, roughness: 0.1}",
                "principled: {base_color: 0.5, spec_trans: 1}",
            ],
        ),
    ] {
        let matte = ball(&format!("diffuse: {{reflectance: {reflectance}}}"));
        for material in materials {
            let part = ball(material);
            for name in ["albedo.R", "albedo.G", "albedo.B"] {
                for (found, expected) in plane(&part, name).iter().zip(plane(&matte, name)) {
                    assert!((found - expected).abs() < 1e-4, "{material}: {name} {expected}, found {found}");
                }
            }
        }
    }
}

/// In a file of X, Y, Z, or of Y, the parts of the light are X, Y and Z, and add up to it.
#[test]
fn light_by_its_ways_is_in_the_terms_of_the_picture() {
    for channels in ["xyza", "luminance"] {
        let part = render(&format!(
            "{}layers: [emission, direct, indirect, caustic, variance]\nlights: [{{constant: {{radiance: 0.2}}}}]\n\
             shapes: [{{plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: {{rgb: [0.8, 0.1, 0.1]}}}}}}}}}}]\n",
            FRAME.replace("float", &format!("float, stderr: true, channels: {channels}"))
        ));
        let names: &[&str] = if channels == "xyza" { &["X", "Y", "Z"] } else { &["Y"] };
        for c in names {
            for (i, whole) in plane(&part, c).iter().enumerate() {
                let of = |layer: &str| plane(&part, &format!("{layer}.{c}"))[i];
                let sum: f32 = ["emission", "direct", "indirect", "caustic"].map(of).iter().sum();
                assert!((sum - whole).abs() <= 16.0 * whole.abs() * f32::EPSILON, "{c} of {channels}: {sum} {whole}");
                let error = plane(&part, &format!("stderr.{c}"))[i];
                assert_eq!(plane(&part, &format!("variance.{c}"))[i], error * error);
            }
        }
    }
}

/// Lamps that are in no group are in `default`, whether others are put into it or not, and a layer may name it.
#[test]
fn lamps_in_no_group_are_in_the_group_default() {
    let picture = |groups: &str| {
        render(&format!(
            "{FRAME}light_groups: {groups}\nlayers: [light_groups, {{name: rest, light_group: default}}]\n\
             lights: [{{constant: {{name: sky, radiance: 0.2}}}}, {{point: {{position: [0, 3, 0], intensity: 3}}}}]\n\
             shapes: [{{plane: {{normal: [0, 1, 0]}}}}, {{sphere: {{name: lamp, center: [1, 2, 0], radius: 0.3, emission: 9}}}}]\n"
        ))
    };
    let (left, named) = (picture("{key: [lamp]}"), picture("{key: [lamp], default: [sky]}"));
    let channel = |(name, _): &(String, _)| name.clone();
    assert!(named.channels.iter().map(channel).eq(left.channels.iter().map(channel)));
    for layer in ["light_default", "light_key", "rest"] {
        for colour in ["R", "G", "B"] {
            let of = |part, layer| plane(part, &format!("{layer}.{colour}")).to_vec();
            assert_eq!(of(&named, layer), of(&left, layer), "{layer}.{colour}");
            assert!(layer != "rest" || of(&named, layer) == of(&named, "light_default"));
        }
    }
}

/// Depth fog is of no lamp: it is in a group of its own where each lamp has one.
#[test]
fn depth_fog_is_light_of_no_lamp() {
    let part = render(&format!(
        "{FRAME}fog: {{colour: 0.3, density: 0.1}}\nlight_groups: {{key: [sky]}}\nlayers: [light_groups]\n\
         lights: [{{constant: {{name: sky, radiance: 0.2}}}}]\nshapes: [{{plane: {{normal: [0, 1, 0]}}}}]\n"
    ));
    for (i, whole) in plane(&part, "G").iter().enumerate() {
        let sum = plane(&part, "light_key.G")[i] + plane(&part, "light_default.G")[i];
        assert!((sum - whole).abs() <= 16.0 * whole * f32::EPSILON, "{sum} {whole}");
    }
}

/// A layer of light by another integrator is what the picture would be by that. A floor of 0.5 under a sky of 0.2, 6 m away in fog
/// of 0.3 that takes 1 - e^-0.6 = 0.4512 there: 0.1 · 0.5488 + 0.3 · 0.4512 = 0.1902. The distance stays 6, and nothing black. Light
/// is as noisy as its wavelengths: far less than a hundredth in 4096 samples.
#[test]
fn light_by_any_integrator_is_behind_depth_fog_and_distances_are_not() {
    let lit = 0.1 * (-0.6f64).exp() + 0.3 * (1.0 - (-0.6f64).exp());
    for (integrator, expected) in [("path", lit), ("{path: {max_depth: 9}}", lit), ("depth", 6.0), ("none", 0.0)] {
        let part = render(&format!(
            "camera: {{origin: [0, 0, 6], target: [0, 0, 0], orthographic_height: 4}}\nimage: {{width: 4, height: 4}}\n\
             render: {{samples: 256}}\noutput: {{exr: {{precision: float, channels: xyz}}}}\nintegrator: {integrator}\n\
             fog: {{colour: 0.3, density: 0.1}}\nlights: [{{constant: {{radiance: 0.2}}}}]\n\
             shapes: [{{plane: {{normal: [0, 0, 1]}}}}]\nlayers:\n- {{name: deep, light: {{path: {{max_depth: 60}}}}, form: xyz}}\n\
             - {{name: far, light: depth, form: xyz}}\n- {{name: nothing, light: none, form: xyz}}\n"
        ));
        for (name, expected) in [("Y", expected), ("deep.Y", lit), ("far.Y", 6.0), ("nothing.Y", 0.0)] {
            let mean = f64::from(plane(&part, name).iter().sum::<f32>()) / 16.0;
            assert!((mean - expected).abs() <= 0.01 * expected, "{integrator}: {name} {mean}, not {expected}");
        }
    }
}

/// A floor 6 m away is as far in the darkest and in the brightest light. Wavelengths are told to a hundredth in 4096 samples.
#[test]
fn distances_are_the_same_in_any_light() {
    for sky in [1e-30, 1.0, 1e30] {
        let part = render(&format!(
            "camera: {{origin: [0, 0, 6], target: [0, 0, 0], orthographic_height: 4}}\nimage: {{width: 4, height: 4}}\n\
             render: {{samples: 256}}\noutput: {{exr: {{precision: float, channels: xyz}}}}\nintegrator: depth\n\
             lights: [{{constant: {{radiance: {sky:e}}}}}]\nshapes: [{{plane: {{normal: [0, 0, 1]}}}}]\n"
        ));
        let mean = f64::from(plane(&part, "Y").iter().sum::<f32>()) / 16.0;
        assert!((mean / 6.0 - 1.0).abs() <= 0.01, "{sky:e}: {mean}");
    }
}

/// A floor of 0.5 under a sky of L shows L/2: in the picture, in layers, whose squares have a mean of (L/2)² or more, in a band of
/// response 1 over the 470 nm of all light, and as the mean radiance of a spectral file, however dark or bright that is. It is 6 m
/// away in any light. Light is as noisy as its wavelengths: far less than a hundredth in 4096 samples.
#[test]
fn layers_and_bands_hold_what_the_picture_holds() {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    for (integrator, sky) in [
        ("path", 1e-30),
        ("path", 1e-18),
        ("path", 1.0),
        ("path", 1e13),
        ("path", 1e30),
        ("depth", 1e-30),
        ("depth", 1e30),
    ] {
        let parts = |image: &str| {
            let text = format!(
                "camera: {{origin: [0, 0, 6], target: [0, 0, 0], orthographic_height: 4}}\n\
                 image: {{width: 4, height: 4{image}}}\nrender: {{samples: 256}}\nintegrator: {integrator}\n\
                 output: {{exr: {{precision: float, channels: xyz, stderr: true}}, spectral: {{bands: 1}}}}\n\
                 lights: [{{constant: {{radiance: {sky:e}}}}}]\nshapes: [{{plane: {{normal: [0, 0, 1]}}}}]\nlayers:\n\
                 - {{name: own, light: {{path: {{max_depth: 60}}}}, form: xyz, squares: true}}\n\
                 - {{name: far, light: depth, form: xyz, squares: true}}\n- {{name: both, squares: true}}\n"
            );
            common::write(&path("s.yaml"), text.as_bytes());
            let overrides = Overrides { output: Some(path("out.exr")), ..Overrides::default() };
            let report = batch::render_batch(&path("s.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
            assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
            // Distances have no luminance.
            let header = read_headers(&path("out.exr")).unwrap();
            let told = header.parts[0].number("whiteLuminance").is_some();
            assert_eq!(told, integrator == "path" && image.is_empty());
            ["out.exr", "out.spectral.exr"].map(|name| read_exr(&path(name)).unwrap().parts.remove(0))
        };
        let ([picture, spectral], [bands, _]) = (parts(""), parts(", bands: [{name: all, response: 1}]"));
        let mean = |part: &ExrPart, name: &str| plane(part, name).iter().map(|x| f64::from(*x)).sum::<f64>() / 16.0;
        let shown = if integrator == "depth" { 6.0 } else { 0.5 * sky };
        for (part, name, expected) in [
            (&picture, "Y", shown),
            (&picture, "own.Y", 0.5 * sky),
            (&picture, "far.Y", 6.0),
            (&bands, "all", 470.0 * shown),
            (&spectral, "S0.550,000000nm", shown),
        ] {
            let found = mean(part, name);
            assert!(
                (found / expected - 1.0).abs() <= 0.01,
                "{integrator}, {sky:e}: {name} {found:e}, not {expected:e}"
            );
        }
        // A hundredth of light is more than its noise, and less than a thousandth of a millionth is none.
        let error = mean(&spectral, "stderr.S0.550,000000nm") / shown;
        assert!((1e-9..1e-2).contains(&error), "{integrator}, {sky:e}: {error:e}");
        // The floor covers all, and coverage is no light.
        assert_eq!(["both.A", "m2_both.A"].map(|name| mean(&picture, name)), [1.0, 1.0], "{integrator}, {sky:e}");
        let square = mean(&picture, "m2_far.Y") / 36.0;
        assert!((1.0..10.0).contains(&square), "{integrator}, {sky:e}: {square}");
        // 32-bit floats hold the squares of 1e-18 to 1e18.
        if (1e-18..1e18).contains(&sky) {
            let square = mean(&picture, "m2_own.Y") / (0.25 * sky * sky);
            assert!((1.0..10.0).contains(&square), "{integrator}, {sky:e}: {square}");
        }
    }
}

/// A sky of L and a film of the sensitivity s show s L, and the mean of its squares stands to the square of the mean as in any
/// other light: the same samples, times a number. Each is rounded to f32 some dozen times, and counts twice in its square: 32
/// roundings of 2⁻²⁴ cover that. A floor 6e5 m away is as far in all samples. Where floats do not hold the squares, that is told.
#[test]
fn squares_are_those_of_any_light_and_length() {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    let picture = |sky: f64, sensitivity: f64, rest: &str| {
        let text = format!(
            "camera: {{origin: [0, 0, 6e5], target: [0, 0, 0], orthographic_height: 4}}\n\
             image: {{width: 4, height: 4, sensitivity: {sensitivity:e}}}\nrender: {{samples: 16}}\n\
             output: {{exr: {{precision: float}}}}\nlights: [{{constant: {{radiance: {sky:e}}}}}]\n{rest}"
        );
        common::write(&path("s.yaml"), text.as_bytes());
        let overrides = Overrides { output: Some(path("out.exr")), ..Overrides::default() };
        let report = batch::render_batch(&path("s.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
        let told = report.scenes[0].notes.iter().find(|note| note.contains("layer m2_own")).cloned();
        (read_exr(&path("out.exr")).unwrap().parts.remove(0), told)
    };
    let near = |x: f32, y: f32| (x / y - 1.0).abs() <= 32.0 * 2f32.powi(-24);
    let mut first = None;
    for (sky, sensitivity) in [
        (1.0, 1.0),
        (20.0, 1.0),
        (5e5, 1.0),
        (1e6, 1.0),
        (1e18, 1.0),
        (1.0, 1e-16),
        (1e-16, 1e16),
        (3e-30, 3e30),
        (3e30, 3e-30),
    ] {
        let (part, told) = picture(sky, sensitivity, "layers: [{name: own, light: path, squares: true}]\n");
        assert_eq!(told, None, "{sky:e}, {sensitivity:e}");
        let of = |name: &str| -> Vec<f32> {
            let planes = ["R", "G", "B"].map(|colour| plane(&part, &format!("{name}{colour}")));
            planes.concat()
        };
        let (shown, own, squares) = (of(""), of("own."), of("m2_own."));
        assert!(shown.iter().zip(&own).all(|(x, y)| near(*x, *y)), "{sky:e}, {sensitivity:e}: {shown:?} {own:?}");
        let found: Vec<f32> = squares.iter().zip(&own).map(|(square, mean)| square / mean / mean).collect();
        let first = first.get_or_insert_with(|| found.clone());
        let alike = found.iter().zip(&*first).all(|(x, y)| near(*x, *y));
        assert!(alike && found[0] >= 1.0, "{sky:e}, {sensitivity:e}: {found:?}, not {first:?}");
    }
    let (_, told) = picture(1e20, 1.0, "layers: [{name: own, light: path, squares: true}]\n");
    let beyond = "layer m2_own: 48 values are more than 32-bit floats hold: they are written as infinite";
    assert_eq!(told.as_deref(), Some(beyond));
    let (_, told) = picture(1e-20, 1.0, "layers: [{name: own, light: path, squares: true}]\n");
    let below = "layer m2_own: all values are less than 32-bit floats hold with all digits (1.2e-38)";
    assert_eq!(told.as_deref(), Some(below));
    let far = "layers: [{name: far, surface: depth, squares: true}]\nshapes: [{plane: {normal: [0, 0, 1]}}]\n";
    let (part, _) = picture(1.0, 1.0, far);
    assert!(plane(&part, "m2_far.T").iter().all(|square| near(*square, 3.6e11)), "{:?}", plane(&part, "m2_far.T"));
}

/// Nearly smooth glass throws a caustic, whether paths from the lights or from the camera find it: what is not caustic has the
/// same mean, 0.0084, with both. It has little noise: 1 % at 256 samples of 384 pixels is ten standard errors.
#[test]
fn techniques_do_not_decide_what_is_a_caustic() {
    let indirect = |light_tracing: &str| {
        let part = render(&format!(
            "camera: {{origin: [0, 3, 6], target: [0, 0.3, 0], fov_deg: 30}}\nimage: {{width: 24, height: 16}}\n\
             render: {{samples: 256, techniques: {{light_tracing: {light_tracing}, merging: off}}}}\n\
             output: {{exr: {{precision: float}}}}\nlayers: [caustic, direct, indirect]\nshapes:\n\
             - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.5}}}}}}\n\
             - sphere: {{center: [-2, 3, 0], radius: 0.1, emission: 320}}\n\
             - sphere: {{center: [0, 0.6, 0], radius: 0.6, material: {{dielectric: {{ior: 1.5, roughness: 0.03}}}}}}\n"
        ));
        let mean = |name: &str| f64::from(plane(&part, name).iter().sum::<f32>()) / 384.0;
        (mean("indirect.G"), mean("caustic.G"))
    };
    let ((on, thrown), (off, found)) = (indirect("on"), indirect("off"));
    assert!((on / off - 1.0).abs() < 0.01, "{on} {off}");
    assert!(thrown > 0.005 && found > 0.0, "{thrown} {found}");
}

/// What `whitted` and `depth` see adds up to alpha: the one parts its rays at a half-open card, and n samples tell a share to
/// 1/2n; the other knows no materials.
#[test]
fn mattes_of_other_integrators_add_up_to_alpha() {
    for (integrator, opacity, bound) in
        [("{whitted: {grid: 4}}", 0.3, 1.0 / 32.0), ("{whitted: {grid: 2}}", 0.5, 0.0), ("depth", 0.5, 0.0)]
    {
        let part = render(&format!(
            "{FRAME}integrator: {integrator}\nlayers: [crypto_object]\nlights: [{{constant: {{radiance: 0.2}}}}]\nshapes:\n\
             - rectangle: {{corner: [-9, -9, 0], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {{mask: {{opacity: {opacity}, \
             material: {{diffuse: {{reflectance: 0.9}}}}}}}}}}\n"
        ));
        for (i, alpha) in plane(&part, "A").iter().enumerate() {
            let covered: f32 = ["CryptoObject00.G", "CryptoObject00.A"].map(|name| plane(&part, name)[i]).iter().sum();
            assert!((covered - alpha).abs() <= bound + 1e-6, "{integrator}: {covered} of {alpha}");
        }
    }
}

/// How much of each pixel is covered by what is called `name`.
fn coverage(part: &ExrPart, name: &str) -> Vec<f32> {
    let id = id_of(name);
    let mut all = vec![0.0; part.window.pixels()];
    for layer in 0..3 {
        for [ids, shares] in [["R", "G"], ["B", "A"]] {
            let [ids, shares] = [ids, shares].map(|c| plane(part, &format!("CryptoObject{layer:02}.{c}")));
            for (sum, (found, share)) in all.iter_mut().zip(ids.iter().zip(shares)) {
                *sum += if *found == id { *share } else { 0.0 };
            }
        }
    }
    all
}

/// The samples of `whitted` behind the hole of a card decide as evenly at the next. n of them, of numbers k/n + 1/2n in any
/// order, tell a share o of all to 1/2n, and what is between two such shares to 1/n.
#[test]
fn cards_behind_cards_cover_their_share_in_whitted() {
    let scene = |grid: u32, shapes: &str| {
        render(&format!(
            "camera: {{origin: [0, 0, 6], target: [0, 0, 0], orthographic_height: 4}}\nimage: {{width: 4, height: 4}}\n\
             integrator: {{whitted: {{grid: {grid}}}}}\noutput: {{exr: {{precision: float}}}}\n\
             layers: [crypto_object, normal]\nlights: [{{constant: {{radiance: 1}}}}]\nshapes:\n{shapes}"
        ))
    };
    let mask = |opacity: f64| format!("material: {{mask: {{opacity: {opacity}, material: {{diffuse: {{}}}}}}}}");
    let card = |name: &str, z: i32, low: f64, normal: &str, material: &str| {
        format!("- rectangle: {{name: {name}, corner: [-9, {low}, {z}], edge_u: [18, 0, 0], {normal}, {material}}}\n")
    };
    let facing = "edge_v: [0, 18, 0]";
    for (grid, opacity, bound) in [(4, 0.5, 0.0), (8, 0.5, 0.0), (5, 0.3, 0.04)] {
        let stack = [("front", 2), ("middle", 1), ("back", 0)].map(|(name, z)| {
            card(name, z, -9.0, facing, &if z > 0 { mask(opacity) } else { "material: {diffuse: {}}".into() })
        });
        let part = scene(grid, &stack.concat());
        let open = 1.0 - opacity;
        for (name, expected) in [("front", opacity), ("middle", open * opacity), ("back", open * open)] {
            for found in coverage(&part, name) {
                let off = (f64::from(found) - expected).abs();
                assert!(off <= bound + 1e-6, "{grid}: {name} covers {found}, not {expected}");
            }
        }
    }
    // A ball of two walls: what it covers is one share, 1 - 0.4². The wall that is seen from within is its own back.
    let ball = format!("- sphere: {{name: ball, radius: 9, center: [0, 0, -12], {}}}\n", mask(0.6));
    let part = scene(16, &ball);
    for (found, alpha) in coverage(&part, "ball").iter().zip(plane(&part, "A")) {
        assert!((alpha - 0.84).abs() < 1e-6 && (found - alpha).abs() <= 1.0 / 512.0 + 1e-6, "{found} of {alpha}");
    }
    // A card to the middle of a pixel covers a half of its half, to a sample of 64: those there decide as evenly as all.
    let part = scene(8, &card("half", 0, 0.5, facing, &mask(0.5)));
    let alpha = plane(&part, "A");
    assert_eq!(alpha[4], 0.25);
    for (found, alpha) in coverage(&part, "half").iter().zip(alpha) {
        assert!((found - alpha).abs() <= 1.0 / 64.0 + 1e-6, "{found} of {alpha}");
    }
}

/// A disk of radius k seen from 4 k: all lengths go with k, in layers as by the integrator `depth`, to some roundings of f32. Where
/// nothing is seen Z is 1e10, or the power of ten beyond the scene, which ends at (4 + √2) k at the most.
#[test]
fn lengths_are_right_at_any_scale() {
    const LAYERS: [&str; 8] = ["Z", "P.X", "P.Y", "P.Z", "d.T", "p.X", "p.Y", "p.Z"];
    let seen = |k: f64, integrator: &str| {
        render(&format!(
            "camera: {{origin: [0, 0, {:e}], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 8, height: 6}}\n\
             integrator: {integrator}\nrender: {{samples: 16}}\noutput: {{exr: {{precision: float}}}}\n\
             layers: [Z, P, {{name: d, surface: depth}}, {{name: p, surface: position}}]\n\
             lights: [{{constant: {{radiance: 1}}}}]\nshapes: [disk: {{radius: {k:e}, normal: [0, 0, 1]}}]\n",
            4.0 * k
        ))
    };
    let one = ["path", "depth"].map(|integrator| seen(1.0, integrator));
    for power in [-100, -70, -40, 0, 25, 38, 60, 100] {
        let k = 2f64.powi(power);
        for (integrator, one) in ["path", "depth"].into_iter().zip(&one) {
            let part = seen(k, integrator);
            let colours: &[&str] = if integrator == "depth" { &["R", "G", "B"] } else { &[] };
            for name in LAYERS.iter().chain(colours) {
                for (i, (found, expected)) in plane(&part, name).iter().zip(plane(one, name)).enumerate() {
                    let (found, expected) = (f64::from(*found) / k, f64::from(*expected));
                    match *name {
                        "Z" if expected == 1e10 => {
                            let beyond = 10f64.powi(((4.0 + 2f64.sqrt()) * k).log10().ceil().max(10.0) as i32);
                            assert_eq!((found * k) as f32, beyond as f32);
                        }
                        _ => assert!(
                            (found - expected).abs() < 1e-5,
                            "{name}: {found}, not {expected}, at {i}, 2^{power}"
                        ),
                    }
                }
            }
        }
    }
}

/// Seen from within a body that has the place, the ball of a weaker one is not there, nor is one of its own kind: what is seen is the
/// wall around, 3 m away.
#[test]
fn what_has_not_the_place_is_not_seen_from_within() {
    for integrator in ["path", "{whitted: {}}"] {
        for other in ["ior: 1.33, priority: 1", "ior: 1.5, priority: 2"] {
            let part = render(&format!(
                "camera: {{origin: [0, 0, 0], target: [0, 0, -1], fov_deg: 10}}\nimage: {{width: 4, height: 4}}\n\
                 integrator: {integrator}\nrender: {{samples: 4}}\nlayers: [Z, crypto_object]\n\
                 lights: [{{constant: {{radiance: 1}}}}]\nshapes:\n\
                 - sphere: {{name: ball, center: [0, 0, -2], radius: 0.5, material: {{dielectric: {{{other}}}}}}}\n\
                 - sphere: {{name: around, radius: 3, material: {{dielectric: {{ior: 1.5, priority: 2}}}}}}\n"
            ));
            assert!(coverage(&part, "around").iter().all(|share| *share == 1.0), "{integrator}: {other}");
            // The middle of a corner's pixel is 3/4 √2 tan 5° = tan 5.3° beside that of the picture: 3 cos 5.3° = 2.987.
            assert!(plane(&part, "Z").iter().all(|z| (2.986..3.0).contains(z)), "{integrator}: {other}");
        }
    }
}

/// A name that a material and a shape have, or an asset and a shape, is that of one matte.
#[test]
fn names_of_two_things_in_one_matte_are_told() {
    let notes = |more: &str| {
        let place = TempDir::new().unwrap();
        let text = format!(
            "camera: {{origin: [0, 0, 8], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 3, height: 1}}\n\
             render: {{samples: 1}}\nlayers: [crypto_object, crypto_material, crypto_asset]\n\
             materials: {{gold: {{diffuse: {{reflectance: 0.2}}}}}}\nlights: [{{constant: {{radiance: 0.5}}}}]\n{more}"
        );
        common::write(&place.path().join("scene.yaml"), text.as_bytes());
        let overrides = Overrides { output: Some(place.path().join("out")), ..Overrides::default() };
        let path = place.path().join("scene.yaml");
        let report = batch::render_batch(&path, &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
        report.scenes[0].notes.iter().filter(|note| note.contains("matte")).cloned().collect::<Vec<_>>()
    };
    let left = "- sphere: {name: left, center: [-2, 0, 0], radius: 0.5, material: gold}\n";
    let own = "material: {diffuse: {}}";
    let told = "CryptoMaterial: the name `gold` is that of a material and of a shape: they are one matte";
    assert_eq!(notes(&format!("shapes:\n{left}- sphere: {{name: gold, radius: 0.5, {own}}}\n")), [told]);
    // The shape has that very material; or the one that is called like another has no shape.
    assert!(notes(&format!("shapes:\n{left}- sphere: {{name: gold, radius: 0.5, material: gold}}\n")).is_empty());
    assert!(notes(&format!("shapes:\n- sphere: {{name: gold, radius: 0.5, {own}}}\n")).is_empty());
    let asset =
        format!("assets: {{toy: [left]}}\nshapes:\n{left}- sphere: {{name: toy, radius: 0.5, material: gold}}\n");
    let told = "CryptoAsset: the name `toy` is that of a shape and of an asset: they are one matte";
    assert_eq!(notes(&asset), [told]);
    let groups = format!(
        "groups: {{oak: [sphere: {{name: leaf, radius: 0.2, {own}}}], fir: [sphere: {{name: leaf, radius: 0.1, {own}}}]}}\n\
         shapes:\n- instance: {{name: a, group: oak}}\n- instance: {{name: fir, group: fir}}\n- sphere: {{name: oak, radius: 0.1, {own}}}\n"
    );
    let told = [
        "CryptoMaterial: the name `leaf` is that of a shape of the group `fir` and of a shape of the group `oak`: they are one matte",
        "CryptoAsset: the name `oak` is that of a group and of a shape: they are one matte",
    ];
    assert_eq!(notes(&groups), told);
    // The MurmurHash3 of both is 04ff3211.
    let one = "shapes:\n- sphere: {name: n0197954, radius: 0.5, material: gold}\n";
    let two = format!("{one}- sphere: {{name: n0136817, center: [2, 0, 0], radius: 0.5, material: gold}}\n");
    let told = ["CryptoObject", "CryptoAsset"]
        .map(|layer| format!("{layer}: the names `n0136817` and `n0197954` have one id, 04ff3211: they are one matte"));
    assert_eq!(notes(&two), told);
    assert!(notes(one).is_empty());
}
