//! Small pictures of lamps, whose light is looked for by itself: the same light with less noise, and in closed form where chance meets
//! nothing.

use super::common::{Bench, bench_with};
use super::reuse::{assert_layers_add_up, assert_same_light, over_seeds};
use abbe::math::statistics::Moments;
use std::f64::consts::PI;

const CAMERA: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n";

fn seen(glints: &str, side: u32, before: &str, shapes: &str) -> Bench {
    seen_by("box", glints, side, before, shapes)
}

fn seen_by(filter: &str, glints: &str, side: u32, before: &str, shapes: &str) -> Bench {
    let yaml = format!(
        "{CAMERA}image: {{width: {side}, height: {side}, filter: {filter}}}\nrender: {{samples: 128, techniques: {{{glints}}}}}\n\
         {before}shapes:\n{shapes}"
    );
    bench_with(&yaml, &[])
}

fn said(bench: &Bench) -> Option<(bool, String)> {
    let all = &bench.prepared.plan.techniques;
    all.iter().find(|said| said.name == "small pictures of lamps").map(|said| (said.on, said.reason.clone()))
}

/// Pixels that a distance of 1 at a distance of 1 along the axis covers.
fn pixels_a_unit(side: u32) -> f64 {
    0.5 * f64::from(side) / 20f64.to_radians().tan()
}

/// A ball of radius r at distance d on the axis is seen as a disc of radius tan asin(r / d), whatever part of a pixel that is: of 10⁻⁶
/// pixels no path would meet it. A plane mirror shows it as far behind, and a disc at infinity of half angle α has the radius tan α. Where four
/// pixels meet each has a quarter. To 2 %: lamps fill 0.6 of the squares about them, so that of eight renders of 128 samples with two paths for
/// each of four pixels √(0.4 / 0.6 / 8192) = 0.9 % is left where they are drawn without order, and half of that with.
#[test]
fn a_lamp_that_is_less_than_a_pixel_has_the_light_of_its_picture() {
    let side = 8;
    let unit = pixels_a_unit(side);
    let radiance = 1e4;
    let disc = |tangent: f64| radiance * PI * (unit * tangent).powi(2);
    let sphere = |r: f64, d: f64| disc((r / d).asin().tan());
    let wall = "- plane: {point: [0, 0, -30], normal: [0, 0, 1], material: {diffuse: {reflectance: 0}}}\n";
    let mirror = "- plane: {normal: [0, 0, 1], material: {mirror: {reflectance: 1}}}\n";
    let ball = |z: f64, r: f64| format!("- sphere: {{center: [0, 0, {z}], radius: {r}, emission: {radiance}}}\n");
    // Irradiance of a disc of radiance L: L π sin² α.
    let (degrees, half) = (0.02, 0.01f64.to_radians());
    let sun = format!(
        "lights: [{{directional: {{direction: [0, 0, 1], angle_deg: {degrees}, irradiance: {}}}}}]\n",
        radiance * PI * half.sin().powi(2)
    );
    for (name, before, shapes, expected) in [
        ("straight", String::new(), ball(-5.0, 2e-2) + wall, sphere(2e-2, 10.0)),
        ("of 1e-6 pixels", String::new(), ball(-5.0, 2e-3) + wall, sphere(2e-3, 10.0)),
        ("in a mirror", String::new(), ball(12.0, 2e-2) + mirror, sphere(2e-2, 17.0)),
        ("a sun", sun.clone(), ball(40.0, 1.0), disc(half.tan())),
    ] {
        let bench = seen("glints: on", side, &before, &shapes);
        assert!(bench.prepared.plan.glints.is_some(), "{name}: {:?}", said(&bench));
        let alpha = bench.picture().alpha;
        assert!(alpha.iter().all(|alpha| *alpha == 1.0 || name == "a sun"), "{name}");
        let window = bench.window();
        let (pixels, _) = over_seeds(bench, 0..8);
        let sum: f64 = pixels.iter().map(|moments| moments.mean).sum();
        println!("{name}: {sum} of {expected}");
        assert!((sum / expected - 1.0).abs() < 0.02, "{name}: {sum}, expected {expected}");
        for pixel in [[3, 3], [4, 3], [3, 4], [4, 4]] {
            let (found, quarter) = (pixels[window.index(pixel).unwrap()].mean, 0.25 * expected);
            assert!((found / quarter - 1.0).abs() < 0.05, "{name} {pixel:?}: {found}");
        }
    }
}

fn lit(glints: &str, before: &str, shapes: &str) -> Bench {
    lit_by("box", glints, before, shapes)
}

fn lit_by(filter: &str, glints: &str, before: &str, shapes: &str) -> Bench {
    let lamps = "- sphere: {center: [1.5, 2.5, 2], radius: 0.2, emission: 20}\n\
                 - sphere: {center: [-2, 1.5, 3], radius: 0.25, emission: {rgb: [20, 12, 4]}}\n\
                 - plane: {point: [0, -1, 0], normal: [0, 1, 0], material: {diffuse: {reflectance: 0.6}}}\n";
    // Lest the light of the lamps be all that there is.
    let even = if before.contains("lights") { "" } else { "lights: [{constant: {radiance: 0.2}}]\n" };
    seen_by(filter, &format!("glints: {glints}"), 16, &format!("{even}{before}"), &format!("{lamps}{shapes}"))
}

/// The same light, and where lamps are looked for by themselves at most this part of its noise.
fn assert_less_noise(name: &str, off: Bench, on: Bench, most: f64) {
    assert_eq!(off.prepared.plan.glints, None);
    let glints = on.prepared.plan.glints.clone().unwrap_or_else(|| panic!("{name}: {:?}", said(&on)));
    let pixels: Vec<[i32; 2]> = on.window().iter().collect();
    let (off, on) = (over_seeds(off, 0..24), over_seeds(on, 100..124));
    assert_same_light(name, &off, &on);
    let noise = |moments: &[Moments]| -> f64 {
        let there = moments.iter().zip(&pixels).filter(|(_, pixel)| glints.of(**pixel).is_some());
        there.map(|(moments, _)| moments.variance()).sum()
    };
    let ratio = noise(&on.0) / noise(&off.0);
    println!("{name}: variance {ratio:.3} there");
    assert!(ratio < most, "{name}: {ratio}");
}

#[test]
fn light_is_the_same_where_lamps_are_looked_for_by_themselves() {
    let ball = |x: f64, y: f64, material: &str| {
        format!("- sphere: {{center: [{x}, {y}, 0], radius: 0.6, material: {material}}}\n")
    };
    let mirrors = ball(-0.8, -0.4, "{mirror: {reflectance: 0.9}}") + &ball(0.8, -0.4, "{conductor: {metal: Au}}");
    let coats = ball(-0.8, -0.4, "{plastic: {reflectance: 0.3}}")
        + &ball(0.8, -0.4, "{plastic: {ior: {glass: N-SF11}, reflectance: 0.1}}");
    let glass = ball(-0.8, -0.4, "{dielectric: {ior: {glass: N-SF11}}}") + &ball(0.8, -0.4, "{dielectric: {ior: 1.5}}");
    let films = ball(-0.8, -0.4, "{dielectric: {ior: 1.5, film: {ior: 1.38, thickness_nm: 300}}}")
        + "- rectangle: {corner: [0, -1, 1], edge_u: [1.4, 0, 0], edge_v: [0, 2, 0], material: {thin_dielectric: {ior: 1.5}}}\n"
        + &ball(0.8, -0.4, "{mirror: {}}");
    let bodies = ball(-0.3, -0.4, "{dielectric: {ior: 1.5, priority: 2}}")
        + &ball(0.3, -0.4, "{dielectric: {ior: 1.33, priority: 1}}");
    let gloss = ball(-0.8, -0.4, "{conductor: {metal: Ag, roughness: 0.15}}") + &ball(0.8, -0.4, "{mirror: {}}");
    let gloss = gloss
        + "- sphere: {center: [0, -0.7, 1], radius: 0.3, material: {blend: {weight: 0.5, first: {mirror: {}}, second: {diffuse: {}}}}}\n";
    let sun = "lights: [{sky: {sun: {elevation_deg: 40, azimuth_deg: 20}, sun_angle_deg: 4}}]\n";
    let fog = "fog: {colour: 0.3, density: 0.1}\n";
    let air = "media: {air: {homogeneous: {scattering: 0.02, absorption: 0.02}}}\nmedium: air\n";
    let several = "integrator: {path: {light_samples: 2, scatter_samples: 2}}\n";
    let hidden = "integrator: {path: {hide_emitters: true}}\n";
    for (name, before, shapes, most) in [
        ("mirrors", "", &mirrors, 0.5),
        ("coats", "", &coats, 0.5),
        ("glass", "", &glass, 0.5),
        ("films and a pane", "", &films, 0.5),
        // Of these chance meets some rows too rarely to tell their variance by.
        ("bodies that overlap", "", &bodies, f64::INFINITY),
        ("gloss and a blend", "", &gloss, 0.5),
        ("a sun in glass", sun, &glass, 0.5),
        ("a sun in coats", sun, &coats, 0.5),
        ("fog by depth", fog, &coats, 0.5),
        ("air", air, &mirrors, 0.5),
        ("several paths", several, &glass, 0.5),
        ("lamps that are not seen", hidden, &mirrors, 0.5),
    ] {
        assert_less_noise(name, lit("off", before, shapes), lit("on", before, shapes), most);
    }
}

/// Filters whose samples count for all pixels that they reach, each for its own alone, and with gaps between them; cut where the picture
/// ends or not.
#[test]
fn light_is_the_same_by_all_filters() {
    let shapes = "- sphere: {center: [-0.8, -0.4, 0], radius: 0.6, material: {dielectric: {ior: {glass: N-SF11}}}}\n\
                  - sphere: {center: [0.8, -0.4, 0], radius: 0.6, material: {plastic: {}}}\n\
                  - sphere: {center: [0, 1.7, 0], radius: 0.5, material: {mirror: {}}}\n";
    for (filter, techniques) in [
        ("{gaussian: {stddev: 0.5}}", ""),
        ("{gaussian: {stddev: 0.5}}, sample_border: false", ""),
        ("{tent: {radius: 0.75}}", ", splatting: off"),
        ("{tent: {radius: 1}}", ", reuse: on"),
        ("{tent: {radius: 1}}", ", adaptive: on"),
        ("{tent: {radius: 0.3}}", ""),
    ] {
        let [off, on] = ["off", "on"].map(|glints| lit_by(filter, &format!("{glints}{techniques}"), "", shapes));
        assert_less_noise(&format!("{filter}{techniques}"), off, on, 0.5);
    }
}

/// What configs/scenes/crystal.yaml shows at the edge of its ball: a lamp after five reflections within, in red light alone.
#[test]
fn what_red_light_alone_shows_is_found() {
    let yaml = "camera: {origin: [1.6, 2.9, 4.2], target: [0.55, 0.75, 0], fov_deg: 44}\n\
                image: {width: 160, height: 112}\n\
                render: {samples: 64, techniques: {glints: on, light_tracing: off}}\n\
                shapes:\n\
                - plane: {normal: [0, 1, 0], material: {diffuse: {reflectance: 0.7}}}\n\
                - sphere: {center: [0, 1, 0], radius: 1, material: {dielectric: {ior: {glass: SF11}}}}\n\
                - sphere: {center: [-3.6, 3.1, 0.4], radius: 0.06, emission: {illuminant: {name: D65, scale: 2600}}}\n\
                lights: [{constant: {radiance: 0.14}}]\n";
    let bench = bench_with(yaml, &[]);
    let glints = bench.prepared.plan.glints.clone().unwrap_or_else(|| panic!("{:?}", said(&bench)));
    for (pixel, seen) in [([21, 23], true), ([27, 26], true), ([28, 26], true), ([60, 30], false)] {
        assert_eq!(glints.of(pixel).is_some(), seen, "{pixel:?}");
    }
}

/// A cube of water in one of glass: a lamp behind them is seen where light between the two bends by the ratio of their indices.
#[test]
fn what_bodies_within_others_show_is_found() {
    let cube = |size: f64, material: &str| {
        let turned = "transform: [{rotate: {axis: [0, 1, 0], deg: 35}}]";
        format!("- cube: {{size: {size}, {turned}, material: {{dielectric: {{{material}}}}}}}\n")
    };
    let shapes = "- sphere: {center: [0.1, 0.2, -5], radius: 0.06, emission: 20}\n".to_owned()
        + &cube(2.0, "ior: 1.5, priority: 1")
        + &cube(1.6, "ior: 1.33, priority: 2");
    let [off, on] = ["off", "on"]
        .map(|glints| seen(&format!("glints: {glints}"), 16, "lights: [{constant: {radiance: 0.2}}]\n", &shapes));
    let glints = on.prepared.plan.glints.clone().unwrap_or_else(|| panic!("{:?}", said(&on)));
    assert!(glints.of([9, 7]).is_some());
    assert_less_noise("a cube in a cube", off, on, 0.1);
}

#[test]
fn light_is_the_same_beside_other_techniques() {
    let glass = "- sphere: {center: [-0.8, -0.4, 0], radius: 0.6, material: {dielectric: {ior: {glass: N-SF11}}}}\n\
                 - sphere: {center: [0.8, -0.4, 0], radius: 0.6, material: {plastic: {}}}\n";
    for (name, techniques) in [
        ("packets", "packets: on"),
        ("paths that pixels share", "reuse: on"),
        ("shadow rays", "shadow_rays: 4"),
        ("adaptive", "adaptive: on"),
    ] {
        let [off, on] = ["off", "on"].map(|glints| lit(&format!("{glints}, {techniques}"), "", glass));
        assert_less_noise(name, off, on, 0.5);
    }
}

#[test]
fn layers_add_up_where_lamps_are_looked_for_by_themselves() {
    let glass = "- sphere: {center: [-0.8, -0.4, 0], radius: 0.6, material: {dielectric: {ior: {glass: N-SF11}}}}\n\
                 - sphere: {center: [0.8, -0.4, 0], radius: 0.6, material: {plastic: {}}}\n";
    let fog = "fog: {colour: 0.3, density: 0.1}\n";
    for (filter, before) in [("box", ""), ("box", fog), ("{gaussian: {stddev: 0.5}}", fog)] {
        let layers = format!("{before}layers: [emission, direct, indirect, caustic]\n");
        let (plain, layered) = (lit_by(filter, "on", before, glass), lit_by(filter, "on", &layers, glass));
        assert!(plain.prepared.plan.glints.is_some() && plain.prepared.plan.glints == layered.prepared.plan.glints);
        assert_layers_add_up(&plain, &layered);
    }
}

/// Neither coverage nor what else a picture has changes, and a part of it has the pixels of the whole, to the bit.
#[test]
fn parts_have_the_pixels_of_the_whole() {
    let shapes = "- sphere: {center: [0.1, -0.4, 0], radius: 0.6, material: {plastic: {}}}\n";
    for filter in ["box", "{gaussian: {stddev: 0.5}}"] {
        let all = lit_by(filter, "on", "layers: [albedo]\n", shapes);
        assert_eq!(all.picture().alpha, lit_by(filter, "off", "", shapes).picture().alpha);
        assert_parts_have_the_pixels_of_the_whole(filter, shapes);
    }
}

fn assert_parts_have_the_pixels_of_the_whole(filter: &str, shapes: &str) {
    let yaml = |crop: &str| {
        format!(
            "{CAMERA}image: {{width: 16, height: 16, filter: {filter}{crop}}}\nrender: {{samples: 64, techniques: {{light_tracing: off, glints: on, reuse: off, shadow_rays: 1}}}}\n\
             shapes:\n- sphere: {{center: [1.5, 2.5, 2], radius: 0.12, emission: 60}}\n{shapes}"
        )
    };
    let whole = bench_with(&yaml(""), &[]).picture();
    let part = bench_with(&yaml(", crop: {x: 5, y: 6, width: 6, height: 4}"), &[]).picture();
    let of_none =
        bench_with(&yaml(", crop: {x: 5, y: 6, width: 6, height: 4}").replace("glints: on", "glints: off"), &[])
            .picture();
    assert!(part.y.iter().zip(&of_none.y).any(|(a, b)| a != b));
    for (pixel, y) in part.window.iter().zip(&part.y) {
        assert_eq!(*y, whole.at(pixel[0], pixel[1]), "{pixel:?}");
    }
}

#[test]
fn it_is_said_why_none_are_looked_for() {
    let ball = "- sphere: {center: [0, 0, 0], radius: 0.6, material: {mirror: {}}}\n";
    let why = |glints: &str, before: &str, shapes: &str| {
        let bench = lit(glints, before, shapes);
        let (on, reason) = said(&bench).expect("lamps can be met");
        assert_eq!(on, bench.prepared.plan.glints.is_some());
        (!on).then_some(reason)
    };
    assert_eq!(why("auto", "", ball), None);
    assert_eq!(why("off", "", ball).as_deref(), Some("the scene says so"));
    assert_eq!(
        why("on", "", &"- sphere: {center: [0, 9, 0], radius: 0.1, emission: 1}\n".repeat(15)).as_deref(),
        Some("there are more than 16 lamps")
    );
    assert_eq!(why("on", "", "").as_deref(), Some("none is seen in mirrors or glass"));
    for (filter, reason) in [
        ("mitchell", "the filter has negative lobes"),
        ("{gaussian: {stddev: 2.5}}", "the filter reaches farther than 8 pixels"),
    ] {
        assert_eq!(said(&lit_by(filter, "on", "", ball)), Some((false, reason.to_owned())));
    }
    let large = "- sphere: {center: [0, 0, 0], radius: 1.5, emission: 1}\n- sphere: {center: [0, -0.9, 1.9], radius: 0.2, material: {diffuse: {}}}\n";
    assert_eq!(said(&seen("glints: on", 8, "", large)).map(|(on, _)| on), Some(false));
    assert_eq!(said(&seen("glints: on", 8, "lights: [{constant: {radiance: 1}}]\n", ball)), None);
}
