//! Paths from the camera and paths from the lights are estimators of one integral, and so is each way to find a light.

use super::common::{bench_with, grey_png};
use super::pictures::{PARALLEL, assert_agree, luminance, render, render_with, sums};
use abbe::film::filter::Filter;

/// A corner of two diffuse walls with a ball.
const CORNER: &str = "\
camera: {origin: [0, 0.5, 5], target: [0, 0, 0], fov_deg: 40, CAMERA}
image: {width: 16, height: 12}
render: {samples: 128}
integrator: {INTEGRATOR: {max_depth: 4}}
shapes:
- rectangle: {corner: [-2, -1, -2], edge_u: [0, 0, 4], edge_v: [4, 0, 0], material: {diffuse: {reflectance: 0.6}}}
- rectangle: {corner: [-2, -1, -2], edge_u: [4, 0, 0], edge_v: [0, 3, 0], material: {diffuse: {reflectance: 0.4}}}
- sphere: {center: [0.3, -0.4, 0], radius: 0.6, material: MATERIAL}
";

fn corner(integrator: &str, camera: &str, material: &str, light: &str) -> String {
    let scene = CORNER.replace("INTEGRATOR", integrator).replace(", CAMERA", camera).replace("MATERIAL", material);
    scene + light
}

/// Two estimators of one integral: paths from the camera and paths from the lights, for each light, each camera and
/// materials that scatter into an angle; within three standard errors of the difference.
#[test]
fn paths_from_the_lights_and_from_the_camera_agree() {
    let clay = "{diffuse: {reflectance: 0.5}}";
    let area = "- disk: {center: [0.5, 2, 0.5], normal: [0, -1, 0], radius: 0.3, emission: 10}\n";
    let fog = format!("{area}media: {{fog: {{homogeneous: {{scattering: 0.2, absorption: 0.05}}}}}}\nmedium: fog\n");
    let cases = [
        ("area", "", clay, area),
        ("point", "", clay, "lights: [{point: {position: [0.5, 2, 1], intensity: 5}}]\n"),
        (
            "spot",
            "",
            clay,
            "lights: [{spot: {position: [0.5, 2, 1], target: [0, -1, 0], cutoff_deg: 40, intensity: 9}}]\n",
        ),
        ("directional", "", clay, "lights: [{directional: {direction: [0.2, -1, -0.5], irradiance: 3}}]\n"),
        ("constant", "", clay, "lights: [{constant: {radiance: 0.5}}]\n"),
        ("lens", ", lens: {radius: 0.3, focus_distance: 4}", clay, area),
        ("fog", "", clay, &fog),
        ("off the axis", ", principal_point: [0.1, -0.1]", clay, area),
        ("rough glass", "", "{dielectric: {ior: 1.5, roughness: 0.3}}", area),
        ("rough metal", "", "{conductor: {metal: gold, roughness: 0.3}}", area),
    ];
    for (what, camera, material, light) in cases {
        let by = |integrator| render(&corner(integrator, camera, material, light));
        assert_agree(what, &by("path"), &by("light_tracer"));
    }
}

/// A square that faces the camera in an even sky of radiance 1, of which a plane, farther out than everything else, hides
/// half: all directions with x < 0. Of what comes from there it lets a share s through. The irradiance is π (1 + s) / 2, and
/// back comes ρ (1 + s) / 2.
#[test]
fn light_from_infinity_comes_through_planes_that_stand_far_out() {
    let materials = [
        ("{diffuse: {reflectance: 0}}", 0.0),
        ("{mask: {opacity: 0.75, material: {diffuse: {reflectance: 0}}}}", 0.25),
        ("{boundary: {}}", 1.0),
    ];
    for (material, share) in materials {
        for integrator in ["path", "light_tracer"] {
            let frame = render(&format!(
                "{PARALLEL}image: {{width: 4, height: 4}}\nrender: {{samples: 16384}}\n\
                 integrator: {{{integrator}: {{max_depth: 2}}}}\nlights: [{{constant: {{radiance: 1}}}}]\nshapes:\n\
                 - plane: {{point: [-3, 0, 0], normal: [1, 0, 0], material: {material}}}\n\
                 - rectangle: {{corner: [-1.2, -1.2, 0], edge_u: [2.4, 0, 0], edge_v: [0, 2.4, 0]}}\n"
            ));
            let ((mean, error), expected) = (luminance(&frame), 0.5 * (1.0 + share) / 2.0);
            // Of six one in 2600 is beyond four of these errors.
            let z = (mean - expected) / error;
            assert!(z.abs() < 4.0 && error < 0.02 * expected, "{integrator} {material}: {mean} ± {error}, z = {z:.1}");
        }
    }
}

/// A square in a group with a plane behind it, which hides none of the even sky before it: ρ.
#[test]
fn what_is_copied_with_a_plane_has_light_from_infinity() {
    for integrator in ["path", "light_tracer"] {
        let frame = render(&format!(
            "{PARALLEL}image: {{width: 4, height: 4}}\nrender: {{samples: 16384}}\n\
             integrator: {{{integrator}: {{max_depth: 2}}}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             groups: {{both: [{{plane: {{point: [0, 0, -2], normal: [0, 0, 1]}}}}, \
             {{rectangle: {{corner: [-1.2, -1.2, 0], edge_u: [2.4, 0, 0], edge_v: [0, 2.4, 0]}}}}]}}\n\
             shapes: [{{instance: {{group: both}}}}]\n"
        ));
        let (mean, error) = luminance(&frame);
        assert!((mean - 0.5).abs() < 4.0 * error && error < 0.01, "{integrator}: {mean} ± {error}");
    }
}

/// A camera is in a ball of mist with nothing around it. Lamps outside shine away from it: nothing scatters their light.
#[test]
fn light_that_meets_nothing_is_not_in_what_the_camera_is_in() {
    let unchanged = "inside: unchanged, outside: unchanged";
    let lamps = [
        "lights: [{spot: {position: [0, 4, 0], target: [0, 5, 0], cutoff_deg: 30, intensity: 20}}]".to_owned(),
        "- disk: {center: [0, 4, 0], normal: [0, 1, 0], radius: 0.5, emission: 10, outside: vacuum}".to_owned(),
        format!("- disk: {{center: [0, 4, 0], normal: [0, 1, 0], radius: 0.5, emission: 10, {unchanged}}}"),
    ];
    for lamp in lamps {
        let frame = render(&format!(
            "camera: {{origin: [0, 0, 1.8], target: [0, 0, 0], fov_deg: 90}}\nimage: {{width: 16, height: 12}}\n\
             render: {{samples: 64}}\nintegrator: {{light_tracer: {{}}}}\n\
             media: {{mist: {{homogeneous: {{scattering: 0.2}}}}}}\nmedium: mist\nshapes:\n\
             - sphere: {{radius: 2, material: {{boundary: {{}}}}, inside: mist, outside: vacuum}}\n\
             - disk: {{center: [0, 2.5, 0], normal: [0, 1, 0], radius: 9, {unchanged}}}\n{lamp}\n"
        ));
        assert_eq!(luminance(&frame).0, 0.0, "{lamp}");
    }
}

/// Which normal a surface has depends on who sees it: the true one stands in where the interpolated one would be seen from
/// behind, and a relief turns toward its viewer. The normals of a floor lean away from the camera, or from a wall that it
/// lights, and toward the lamp. Paths from the lights, which come from there, have the normals of those they go to.
#[test]
fn normals_that_lean_away_from_the_viewer_are_the_same_from_both_ends() {
    const SCENE: &str = "\
camera: {origin: CAMERA, fov_deg: 20}
image: {width: 16, height: 16}
render: {samples: SAMPLES, techniques: {light_tracing: TRACING}}
integrator: {INTEGRATOR: {max_depth: 4}}
textures: {lean: {image: {file: lean.png, raw: true}}}
shapes:
- FLOOR
- rectangle: {corner: [-2, 0, -1], edge_u: [0, 0, 2], edge_v: [0, 2, 0], flip_normals: true, material: {diffuse: {}}}
- rectangle: {corner: [2, 0, -1], edge_u: [0, 0, 2], edge_v: [0, 2, 0], material: {diffuse: {}}}
- sphere: {center: LAMP, radius: 0.5, emission: 10}
";
    const MESH: &str = "mesh: {file: lean.obj, material: MATERIAL}";
    const RELIEF: &str = "rectangle: {corner: [-2, 0, 1], edge_u: [2, 0, 2], edge_v: [2, 0, -2], \
        material: {normal_map: {normals: {texture: lean}, material: MATERIAL}}}";
    let obj = "v -2 0 1\nv 2 0 1\nv 2 0 -1\nv -2 0 -1\nvn 0.8 0.6 0\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n";
    // (1, 1, 1) / √3, which leans along u + v = x.
    let white = grey_png(1, 1, |_, _| 255);
    // The floor itself, the wall that it leans away from, and the other.
    let [floor_seen, wall_seen] = ["[-1.9, 0.6, 0], target: [-0.9, 0, 0]", "[1, 1.5, 2], target: [-2, 1, 0]"];
    let other_seen = "[-1, 1.5, 2], target: [2, 1, 0]";
    // Where mirrors throw the light of each onto the wall.
    for (what, floor, lamp) in [("mesh", MESH, "[1, 1, 0]"), ("relief", RELIEF, "[-0.5, 1.6, 0]")] {
        let by = |camera: &str, material: &str, integrator: &str, tracing: &str, samples: u32| {
            let scene = SCENE.replace("CAMERA", camera).replace("FLOOR", floor).replace("MATERIAL", material);
            let scene =
                scene.replace("SAMPLES", &samples.to_string()).replace("INTEGRATOR", integrator).replace("LAMP", lamp);
            let files = [("lean.obj", obj.as_bytes()), ("lean.png", &white)];
            render_with(&bench_with(&scene.replace("TRACING", tracing), &files), Filter::Box, 32)
        };
        for (seen, camera) in [("floor", floor_seen), ("wall", wall_seen), ("other wall", other_seen)] {
            let [path, light] = ["path", "light_tracer"]
                .map(|integrator| by(camera, "{conductor: {metal: gold, roughness: 0.4}}", integrator, "off", 1024));
            assert_agree(&format!("{seen}, {what}"), &path, &light);
        }
        let [chance, traced] = [("off", 1024), ("on", 256)]
            .map(|(tracing, samples)| by(wall_seen, "{mirror: {}}", "path", tracing, samples));
        assert!(traced.splats.is_some());
        assert_agree(&format!("mirror, {what}"), &chance, &traced);
    }
}

/// Rough glass under a relief that does not turn toward its viewer, seen from behind its normal: by lamps that are asked, by scattering
/// and from the lamps. And two sides within two sides, of which that below lets light through: by the first two.
#[test]
fn sides_are_the_same_to_all_techniques() {
    const LEANING: &str = "\
camera: {origin: [-4, 1.2, 0], target: [0, 0, 0], fov_deg: 20}
image: {width: 16, height: 16}
render: {samples: 256, techniques: {light_tracing: off}}
integrator: {INTEGRATOR: {max_depth: 2, SAMPLES}}
textures: {lean: {image: {file: lean.ppm, raw: true}}}
shapes:
- rectangle: {corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: {normal_map: {normals: {texture: lean},
    shadowing: false, turn: false, material: {dielectric: {ior: 1.5, roughness: 0.4}}}}}
- sphere: {center: [2, 3, 2], radius: 1, emission: 5}
- sphere: {center: [-1, -3, -1], radius: 1, emission: 5}
";
    const SHEET: &str = "\
camera: {origin: [0, 0.5, 3], target: [0, 0, 0], fov_deg: 30}
image: {width: 16, height: 16}
render: {samples: 256, techniques: {light_tracing: off}}
integrator: {INTEGRATOR: {max_depth: 2, SAMPLES}}
shapes:
- rectangle: {corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: {diffuse: {reflectance: 0.8}}}
- rectangle: {corner: [-9, 1, 9], edge_u: [18, 0, 0], edge_v: [0, 0, -18], material: {two_sided: {front: {diffuse: {}},
    back: {two_sided: {front: {mask: {opacity: 0.1, material: {diffuse: {}}}}, back: {diffuse: {}}}}}}}
- sphere: {center: [0, 3, 0], radius: 1, emission: 5}
";
    // (0.89, 0, 0.45) as a colour: it leans away from the camera.
    let lean = [&b"P6\n1 1\n255\n"[..], &[242, 128, 185]].concat();
    for (what, scene) in [("leaning", LEANING), ("sheet", SHEET)] {
        let by = |integrator: &str, samples: &str| {
            let scene = scene.replace("INTEGRATOR", integrator).replace(", SAMPLES", samples);
            render_with(&bench_with(&scene, &[("lean.ppm", &lean)]), Filter::Box, 32)
        };
        let path = by("path", "");
        assert!(luminance(&path).0 > 0.01, "{what}");
        assert_agree(&format!("{what}, scattering"), &path, &by("path", ", light_samples: 0"));
        assert_agree(&format!("{what}, lamps"), &path, &by("path", ", scatter_samples: 0"));
        // The front stops what comes from the lamp; seen from below there is the back.
        if what != "sheet" {
            assert_agree(&format!("{what}, from the lamps"), &path, &by("light_tracer", ""));
        }
    }
}

/// Segments that end at the boundary of nothing count for neither or for both.
#[test]
fn crossings_count_from_both_ends() {
    let light = "- disk: {center: [0.5, 2, 0.5], normal: [0, -1, 0], radius: 0.3, emission: 10}\n";
    for depth in ["2", "3", "4", "5"] {
        let by = |integrator, counts| {
            let scene = corner(integrator, "", "{boundary: {}}", light);
            render(&scene.replace("max_depth: 4", &format!("max_depth: {depth}, count_crossings: {counts}")))
        };
        let [all, counted] = [false, true].map(|counts| {
            let light_tracer = by("light_tracer", counts);
            assert_agree(&format!("{depth}, {counts}"), &by("path", counts), &light_tracer);
            luminance(&light_tracer).0
        });
        assert!(counted < 0.99 * all, "{depth}: {counted} of {all}");
    }
}

/// The same light lies in other pixels' filters, but none is lost: shares add up to one in the mean over places.
#[test]
fn splats_keep_their_light_under_every_filter() {
    let scene =
        corner("light_tracer", "", "{diffuse: {}}", "lights: [{point: {position: [0.5, 2, 1], intensity: 5}}]\n");
    let path = bench_with(&scene.replace("light_tracer", "path"), &[]);
    let light = bench_with(&scene, &[]);
    let narrow = Filter::Tent { radius: 0.3 };
    for filter in [Filter::Gaussian { stddev: 0.5 }, Filter::CatmullRom, Filter::Lanczos { radius: 3.0 }, narrow] {
        assert_agree(&format!("{filter:?}"), &render_with(&path, filter, 32), &render_with(&light, filter, 32));
    }
}

/// Sums are integers and random numbers are addressed: no bit depends on tiles, units of work or threads.
#[test]
fn splats_do_not_depend_on_tiles_or_threads() {
    let light = "- disk: {center: [0.5, 2, 0.5], normal: [0, -1, 0], radius: 0.3, emission: 10}\n";
    let scene = corner("light_tracer", "", "{dielectric: {ior: 1.5}}", light).replace("128", "20");
    let bench = bench_with(&scene, &[]);
    let expected = sums(&bench, 1, 32);
    assert_eq!(expected.2, [960; 4]);
    assert!(expected == sums(&bench, 3, 5), "the sums differ");
}

/// The sky along two techniques: by directions of the light, by directions of the surface, by both.
#[test]
fn each_technique_alone_has_the_same_mean() {
    let light = "lights: [{constant: {radiance: 0.5}}]\n";
    let both = corner("path", "", "{diffuse: {}}", light);
    let one = |samples: &str| render(&both.replace("max_depth: 4", &format!("max_depth: 4, {samples}")));
    let both = render(&both);
    assert_agree("lamps", &one("scatter_samples: 0"), &both);
    assert_agree("surfaces", &one("light_samples: 0"), &both);
    assert_agree("three of each", &one("light_samples: 3, scatter_samples: 3"), &both);
}

/// The camera sees a lamp, or a sky of radiance 1 with nothing before it, without a technique. Behind an open sheet that counts as
/// a vertex only what scatters there meets it; where such sheets do not count it is seen as before.
#[test]
fn shadow_rays_alone_show_no_light_behind_what_counts() {
    let seen = |sheet: &str, behind: &str, settings: &str| {
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {{path: {{max_depth: 2, {settings}}}}}\nshapes:\n\
             - rectangle: {{corner: [-2, -2, 0], edge_u: [4, 0, 0], edge_v: [0, 4, 0], material: {sheet}}}\n{behind}"
        );
        bench_with(&scene, &[]).sample([0, 0], 0).radiance.to_array()[0]
    };
    let sky = "lights: [{constant: {radiance: 1}}]\n";
    let lamp = "- rectangle: {corner: [-2, -2, -1], edge_u: [4, 0, 0], edge_v: [0, 4, 0], emission: 1}\n";
    for sheet in ["{boundary: {}}", "{mask: {opacity: 0, material: {diffuse: {}}}}", "{thin_dielectric: {ior: 1}}"] {
        for behind in [sky, lamp] {
            let by = |scatter: &str, counts: bool| {
                seen(sheet, behind, &format!("scatter_samples: {scatter}, count_crossings: {counts}"))
            };
            let all = [by("1", true), by("1", false), by("0", false), by("0", true)];
            assert_eq!(all, [1.0, 1.0, 1.0, 0.0], "{sheet} {behind}");
        }
    }
}

/// The greater of the two counts is that of the paths: which of them it is makes no difference.
#[test]
fn counts_of_shadow_and_scattered_rays_are_counts_of_paths() {
    let light = "lights: [{constant: {radiance: 0.5}}]\n";
    let scene = corner("path", "", "{diffuse: {}}", light).replace("samples: 128", "samples: 4");
    let with = |samples: &str| render(&scene.replace("max_depth: 4", &format!("max_depth: 4, {samples}"))).film;
    let both = with("light_samples: 3, scatter_samples: 3");
    assert!(with("light_samples: 3") == both && with("scatter_samples: 3") == both);
    assert!(with("light_samples: 1") != both);
}
