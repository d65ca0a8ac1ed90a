//! Integrators besides `path`, and the further channels of a picture.

use super::common::{Bench, SPREAD_NM, assert_close, bench_with, grey_png, wavelengths};
use abbe::batch::frame::{self, Frame, FrameJob};
use abbe::film::accumulate::{Film, REPLICATES};
use abbe::film::filter::{Filter, FilterSampler};
use abbe::film::resolve::Image;
use abbe::math::statistics::Moments;
use abbe::spectrum::{ColourSpace, Lanes, observer};
use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

/// A camera of parallel rays that looks along −z at 2 m × 2 m about the origin, from five metres.
const PARALLEL: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], orthographic_height: 2}\n";

pub(super) fn job<'a>(bench: &'a Bench, filter: &'a FilterSampler, tile: u32) -> FrameJob<'a> {
    FrameJob { tile, ..bench.prepared.job(filter) }
}

pub(super) fn render_with(bench: &Bench, filter: Filter, tile: u32) -> Frame {
    let filter = FilterSampler::new(filter).unwrap();
    frame::render(&job(bench, &filter, tile), &|_| {}, &AtomicBool::new(false)).unwrap()
}

/// What the paths of the camera and of the lights add up to on `threads` threads with tiles of `tile` pixels, and how many
/// the latter are.
pub(super) fn sums(bench: &Bench, threads: usize, tile: u32) -> (Film, Film, [u64; REPLICATES]) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let frame = pool.install(|| render_with(bench, Filter::Gaussian { stddev: 0.5 }, tile));
    let splats = frame.splats.unwrap();
    (frame.film, splats.film, splats.paths)
}

pub fn render(yaml: &str) -> Frame {
    render_with(&bench_with(yaml, &[]), Filter::Box, 32)
}

/// Mean luminance of a picture with its standard error.
fn luminance(frame: &Frame) -> (f64, f64) {
    let Image { rgb, standard_error, .. } = frame.resolve(&ColourSpace::Xyz.matrix_from_xyz());
    let n = rgb[1].len() as f64;
    let mean = rgb[1].iter().map(|y| f64::from(*y)).sum::<f64>() / n;
    (mean, standard_error[1].iter().map(|e| f64::from(*e).powi(2)).sum::<f64>().sqrt() / n)
}

pub(super) fn assert_agree(what: &str, a: &Frame, b: &Frame) {
    let ((a, ea), (b, eb)) = (luminance(a), luminance(b));
    let z = (a - b) / ea.hypot(eb);
    assert!(z.abs() < 3.0 && ea < 0.02 * a, "{what}: {a} ± {ea} against {b} ± {eb}, z = {z:.1}");
}

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

/// The same light lies in other pixels' filters, but none is lost: shares add up to one, for the last in the mean.
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

/// The sky is seen behind 256 surfaces in a row that hide nothing, and behind more there is none, whatever their number.
#[test]
fn light_goes_straight_through_256_surfaces_at_the_most() {
    let row = |integrator: &str, material: &str, count: u32| {
        let mut scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {integrator}\n\
             lights: [{{constant: {{radiance: 1}}}}]\nmaterials: {{open: {material}}}\nshapes:\n"
        );
        for i in 0..count {
            let z = -1e-3 * f64::from(i);
            scene += &format!(
                "- rectangle: {{corner: [-2, -2, {z}], edge_u: [4, 0, 0], edge_v: [0, 4, 0], material: open}}\n"
            );
        }
        let sample = bench_with(&scene, &[]).sample([0, 0], 0);
        (sample.radiance.to_array()[0], sample.alpha)
    };
    for integrator in ["path", "{whitted: {}}"] {
        for material in ["{mask: {opacity: 0, material: {diffuse: {}}}}", "{boundary: {}}"] {
            for (count, sky) in [(256, 1.0), (257, 0.0), (5000, 0.0)] {
                assert_eq!(row(integrator, material, count), (sky, 0.0), "{integrator} {material} {count}");
            }
        }
    }
}

/// Lamps without power change no pixel, but what is said of lamps holds of them: `hide_emitters` hides one, and a sky covers.
#[test]
fn lights_without_power_are_left_out() {
    let day = [&b"PF\n2 1\n-1\n"[..], &1f32.to_le_bytes().repeat(6)].concat();
    let bench = |integrator: &str, emission: &str, dark: &str| {
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {integrator}\nshapes:\n\
             - rectangle: {{corner: [-9, -9, 0], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {{diffuse: {{}}}}}}\n\
             - sphere: {{name: lamp, center: [3, 0, 3], radius: 1, material: {{diffuse: {{}}}}{emission}}}\n\
             lights:\n- point: {{name: bulb, position: [0, 3, 3], intensity: 3}}\n{dark}"
        );
        bench_with(&scene, &[("day.pfm", &day)])
    };
    let dark = "- constant: {radiance: {table: [[360, 0], [830, 0]]}}\n- directional: {direction: [0, 0, -1], irradiance: 0}\n\
                - point: {name: out, position: [1, 2, 3], intensity: 0}\n\
                - spot: {position: [1, 2, 3], target: [0, 0, 0], cutoff_deg: 30, intensity: 0}\n\
                - spot: {position: [1, 2, 3], target: [0, 0, 0], texture: black, intensity: 1}\n\
                - projector: {name: slide, origin: [1, 2, 3], target: [0, 0, 0], fov_deg: 30, scale: 0}\n\
                - projector: {name: board, origin: [1, 2, 3], target: [0, 0, 0], fov_deg: 30, irradiance: {texture: black}}\n\
                - environment: {name: night, file: day.pfm, scale: 0}\n\
                textures: {black: {checkerboard: {a: 0, b: 0}}}\n\
                light_groups: {a: [out], b: [bulb]}\n";
    for integrator in ["path", "{whitted: {}}", "light_tracer"] {
        let [with, without] =
            [(", emission: 0", dark), ("", "")].map(|(emission, dark)| bench(integrator, emission, dark));
        for i in 0..64 {
            let [a, b] = [&with, &without].map(|bench| bench.sample([0, 0], i));
            assert_eq!((a.radiance, a.alpha), (b.radiance, b.alpha), "{integrator}");
        }
        assert_eq!((with.prepared.scene.lights.len(), &with.prepared.scene.light_groups.of[..]), (1, &[2][..]));
        let dark = ["lamp", "constant1", "directional2", "out", "spot4", "spot5", "slide", "board", "night"];
        assert_eq!(with.prepared.scene.dark, dark.map(str::to_owned));
    }
    let front =
        ", emission: 0}\n- rectangle: {corner: [-9, -9, 2], edge_u: [18, 0, 0], edge_v: [0, 18, 0], emission: 0";
    for (setting, alpha) in [("hide_emitters", 0.0), ("opaque_sky", 1.0)] {
        let lamp = if setting == "hide_emitters" { front } else { "" };
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {{path: {{{setting}: true}}}}\nshapes:\n\
             - sphere: {{center: [99, 0, 0], radius: 1{lamp}}}\nlights: [{{constant: {{radiance: 0}}}}]\n"
        );
        assert_eq!(bench_with(&scene, &[]).sample([0, 0], 0).alpha, alpha, "{setting}");
    }
    // Behind panes, too, where a bound to depth ends the path before it gets there.
    let panes: String = (0..4)
        .map(|z| format!("- rectangle: {{corner: [-9, -9, {z}], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {{boundary: {{}}}}}}\n"))
        .collect();
    let scene = format!(
        "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {{path: {{opaque_sky: true, max_depth: 2, count_crossings: true}}}}\n\
         lights: [{{constant: {{radiance: 1}}}}]\nshapes:\n{panes}"
    );
    let scene = bench_with(&scene, &[]);
    assert_eq!(scene.sample([0, 0], 0).alpha, 1.0);
    assert_eq!(scene.picture().alpha, [1.0]);
}

/// Light of a bare boundary is added to what lies behind it, and covers nothing: 2 over a sky of 3.
#[test]
fn a_boundary_that_shines_adds_to_what_is_behind_it() {
    for integrator in ["path", "{whitted: {}}"] {
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {integrator}\nlights: [{{constant: {{radiance: 3}}}}]\n\
             shapes:\n- rectangle: {{corner: [-9, -9, 0], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {{boundary: {{}}}}, \
             emission: 2}}\n"
        );
        let sample = bench_with(&scene, &[]).sample([0, 0], 0);
        assert_eq!((sample.radiance.to_array()[0], sample.alpha), (5.0, 0.0), "{integrator}");
    }
}

/// Between perfect mirrors nothing ends the recursion but its bound, whatever the mirrors are made of.
#[test]
fn light_goes_from_mirror_to_mirror_to_the_bound() {
    let mirror = "{mask: {opacity: 1, material: {two_sided: {front: {mirror: {reflectance: 1}}}}}}";
    let wall = |z: f64| {
        format!("- rectangle: {{corner: [-9, -9, {z}], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {mirror}}}\n")
    };
    let scene = format!(
        "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {{whitted: {{max_depth: 256}}}}\nshapes:\n{}{}",
        wall(0.0),
        wall(9.0)
    );
    let sample = bench_with(&scene, &[]).sample([0, 0], 0);
    assert_eq!((sample.radiance.to_array()[0], sample.alpha), (0.0, 1.0));
}

/// A lamp over a hundred open masks lights the floor below as if there were none.
#[test]
fn shadow_rays_of_whitted_go_straight_through_as_camera_rays_do() {
    let floor = |count: u32| {
        let mut scene = "camera: {origin: [3, 3, 0], target: [0, 0, 0], fov_deg: 10}\nimage: {width: 1, height: 1}\n\
             integrator: {whitted: {}}\nlights: [{point: {position: [0, 9, 0], intensity: 30}}]\n\
             materials: {open: {mask: {opacity: 0, material: {diffuse: {}}}}}\n\
             shapes:\n- plane: {normal: [0, 1, 0]}\n"
            .to_owned();
        for i in 0..count {
            let y = 5.0 + 1e-3 * f64::from(i);
            scene += &format!(
                "- rectangle: {{corner: [-1, {y}, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], material: open}}\n"
            );
        }
        bench_with(&scene, &[]).sample([0, 0], 0).radiance.to_array()[0]
    };
    let (bare, behind) = (floor(0), floor(100));
    assert!(bare > 0.0 && (behind / bare - 1.0).abs() < 1e-6, "{bare} {behind}");
}

/// A mask covers as much as its opacity, and fog is that of the depth of what covers anything. The ambient light of 1 shows
/// the white mask, and the sky behind it has 3.
#[test]
fn open_masks_cover_nothing() {
    let bench = |integrator: &str, fog: &str, shapes: &str| {
        let lights = "lights: [{constant: {radiance: 3}}]";
        let picture = "image: {width: 1, height: 1}";
        bench_with(&format!("{PARALLEL}{picture}\nintegrator: {integrator}\n{fog}{lights}\nshapes: [{shapes}]\n"), &[])
    };
    let rectangle = |z: f64, material: &str| {
        let sides = "edge_u: [18, 0, 0], edge_v: [0, 18, 0]";
        format!("{{rectangle: {{corner: [-9, -9, {z}], {sides}, material: {material}}}}}")
    };
    let mask = |opacity: f64| {
        rectangle(2.0, &format!("{{mask: {{opacity: {opacity}, material: {{diffuse: {{reflectance: 1}}}}}}}}"))
    };
    let whitted = |fog: &str, shapes: &str| {
        let sample = bench("{whitted: {grid: 1, ambient: 1}}", fog, shapes).sample([0, 0], 0);
        (sample.radiance.to_array()[0], sample.alpha)
    };
    for opacity in [0.0, 0.25, 1.0] {
        let expected = (opacity + 3.0 * (1.0 - opacity), opacity);
        assert_eq!(whitted("", &mask(f64::from(opacity))), expected, "{opacity}");
        // The standard error of 4096 samples is 0.0068: z = 4.
        let path = bench("path", "", &mask(f64::from(opacity)));
        let alpha = (0..4096).map(|i| path.sample([0, 0], i).alpha).sum::<f32>() / 4096.0;
        assert!((alpha - opacity).abs() < 0.028, "{opacity}: {alpha}");
    }
    let wall = rectangle(0.0, "{diffuse: {reflectance: 0.5}}");
    let fog = "fog: {colour: 0.3, density: 0.1}\n";
    assert_eq!(whitted(fog, &format!("{}, {wall}", mask(0.0))), whitted(fog, &wall));
}

/// In light of radiance one from everywhere a band holds ∫ response dλ: 25 for a box of 25 nm, 940 for twice the
/// whole band of 470 nm, 50 for a triangle 100 nm wide. Pixels are independent.
#[test]
fn bands_are_integrals_over_the_wavelength() {
    let frame = render(&format!(
        "{PARALLEL}render: {{samples: 64}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
         image:\n  width: 16\n  height: 16\n  bands:\n\
         \x20 - {{name: box, response: {{table: [[380, 1], [405, 1]]}}}}\n\
         \x20 - {{name: all, response: 2}}\n\
         \x20 - {{name: triangle, response: {{table: [[500, 0], [550, 1], [600, 0]]}}}}\n"
    ));
    for (channel, expected) in [25.0, 940.0, 50.0].into_iter().enumerate() {
        let found: Moments = frame.layer(channel).iter().map(|x| f64::from(*x)).collect();
        let (mean, error) = (found.mean, found.standard_error());
        assert!((mean - expected).abs() < 4.0 * error && error < 0.01 * expected, "{expected}: {mean} ± {error}");
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

/// A rectangle of 2 × 4 across parallel rays: u and v run from 0 to 1 over its edges. A sphere of radius r seen at its
/// middle, where the camera looks at longitude zero of the equator: 2πr a turn of u, πr from pole to pole.
#[test]
fn layers_of_surfaces_are_their_closed_forms() {
    let layers = "layers:\n- {name: d, surface: depth}\n- {name: p, surface: position}\n- {name: n, surface: geometric_normal}\n\
                  - {name: t, surface: uv}\n- {name: u, surface: dp_du}\n- {name: v, surface: dp_dv}\n- {name: x, surface: duv_dx}\n\
                  - {name: i, surface: shape}\n- {name: a, surface: albedo}\n";
    let scene = |shape: &str, size: u32| {
        let camera = PARALLEL.replace("height: 2", "height: 2, clip: {near: 1.5, far: 20}");
        let text = format!(
            "{camera}image: {{width: {size}, height: {size}}}\nrender: {{samples: 16}}\nintegrator: none\n{layers}shapes:\n- {shape}\n"
        );
        let frame = render_with(&bench_with(&text, &[]).grey(), Filter::Box, 32);
        move |channel: usize, pixel: usize| f64::from(frame.layer(channel)[pixel])
    };
    let of = scene(
        "rectangle: {corner: [-1, -2, 0], edge_u: [2, 0, 0], edge_v: [0, 4, 0], material: {diffuse: {reflectance: 0.25}}}",
        2,
    );
    // The middle of the upper left pixel is (−½, ½): stratified samples average to it within a quarter of their share.
    let expected = [3.5, -0.5, 0.5, 0.0, 0.0, 0.0, 1.0, 0.25, 0.625, 2.0, 0.0, 0.0, 0.0, 4.0, 0.0];
    for (channel, expected) in expected.into_iter().enumerate() {
        let tolerance = if (1..3).contains(&channel) || (7..9).contains(&channel) { 0.05 } else { 1e-6 };
        assert!((of(channel, 0) - expected).abs() < tolerance, "{channel}: {} {expected}", of(channel, 0));
    }
    // A pixel is one metre and samples stand a quarter of it apart: Δu = ¼ / 2.
    assert!((of(15, 0) - 0.125).abs() < 1e-6 && of(16, 0).abs() < 1e-6);
    assert_eq!(of(17, 0), 1.0);
    // Light on a reflectance of ¼ is as much as a radiance of ¼ in the quadrature of eight wavelengths; some thirty f32
    // operations.
    let [x, y, z] = observer::xyz(Lanes::ONE, &wavelengths(SPREAD_NM)).map(f64::from);
    let green = ColourSpace::Rec709.matrix_from_xyz()[1];
    assert_close(of(19, 0), 0.25 * (green[0] * x + green[1] * y + green[2] * z), 30.0 * f64::from(f32::EPSILON));

    let of = scene("sphere: {radius: 1.5}", 1);
    let length = |from: usize| (0..3).map(|c| of(from + c, 0).powi(2)).sum::<f64>().sqrt();
    // Over the one pixel of 2 m the directions of the partials turn; seen from near the axis only.
    assert!(length(9) < 2.0 * PI * 1.5 + 1e-6 && length(12) < PI * 1.5 + 1e-6);
    let narrow = render(&format!(
        "{}image: {{width: 1, height: 1}}\nrender: {{samples: 4}}\n{layers}shapes:\n- sphere: {{radius: 1.5}}\n",
        PARALLEL.replace("height: 2", "height: 1e-5")
    ));
    let length = |from: usize| (0..3).map(|c| f64::from(narrow.layer(from + c)[0]).powi(2)).sum::<f64>().sqrt();
    assert!((length(9) - 2.0 * PI * 1.5).abs() < 1e-4, "{}", length(9));
    assert!((length(12) - PI * 1.5).abs() < 1e-4, "{}", length(12));
}

/// Texture coordinates on a line tell no points apart: of them follow the axes of the surface, of length one, however the triangle
/// is turned. A number that no sum can hold (∂p/∂u of 1e13 m) takes none of the others with it.
#[test]
fn triangles_without_a_plane_of_texture_coordinates_have_layers() {
    let scene = format!(
        "{PARALLEL}image: {{width: 2, height: 2}}\nrender: {{samples: 16}}\nintegrator: none\n\
         layers:\n- {{name: d, surface: depth}}\n- {{name: u, surface: dp_du}}\n- {{name: v, surface: dp_dv}}\n\
         shapes:\n- mesh: {{file: a.obj, transform: [{{rotate: {{axis: [1, 2, 30], deg: 37}}}}]}}\n"
    );
    let of = |third: &str| {
        let corners = "v -9 -9 0\nv 9 -9 0\nv 0 9 0\n";
        let mesh = format!("{corners}vt 0 0\nvt 0.3 0.7\nvt {third}\nf 1/1 2/2 3/3\n");
        let frame = render_with(&bench_with(&scene, &[("a.obj", mesh.as_bytes())]).grey(), Filter::Box, 32);
        let length = |from: usize| (0..3).map(|c| f64::from(frame.layer(from + c)[0]).powi(2)).sum::<f64>().sqrt();
        (f64::from(frame.layer(0)[0]), [length(1), length(4)], frame.film.layers.invalid.total())
    };
    let (depth, along, dropped) = of("0.3 0.7");
    assert_eq!(dropped, 0);
    assert!(along.iter().all(|length| (length - 1.0).abs() < 1e-6), "{along:?}");
    let (plain, along, dropped) = of("1 0");
    assert!(along.iter().all(|length| *length > 2.0 && *length < 100.0) && dropped == 0, "{along:?} {dropped}");
    let (same, _, dropped) = of("-1e-13 1e-13");
    assert!(dropped > 0);
    assert_eq!([plain, same], [depth; 2]);
}

/// A number that is 0 or 1 is its own square: the mean of the squares of the coverage is the coverage. A radiance c
/// without noise has the mean square c².
#[test]
fn squares_are_second_moments() {
    let scene = format!(
        "{PARALLEL}image: {{width: 8, height: 8}}\nrender: {{samples: 64}}\n\
         layers:\n- {{name: a, squares: true}}\n- {{name: b, form: xyz, squares: true, light: {{path: {{hide_emitters: true}}}}}}\n\
         shapes:\n- disk: {{normal: [0, 0, 1], radius: 0.8, emission: 3, material: {{diffuse: {{reflectance: 0}}}}}}\n"
    );
    let frame = render_with(&bench_with(&scene, &[]).grey(), Filter::Box, 32);
    let plane = |channel| frame.layer(channel);
    assert_eq!(plane(3), plane(7));
    assert!(plane(3).iter().any(|a| *a > 0.2 && *a < 0.8));
    // The middle pixels see the lamp alone; the hidden lamp is black.
    let (mean, square) = (plane(0)[27], plane(4)[27]);
    assert!(mean > 2.0 && (square / (mean * mean) - 1.0).abs() < 1e-6, "{mean} {square}");
    assert!((8..14).all(|channel| plane(channel).iter().all(|x| *x == 0.0)));
}

/// Before the sky stands a lamp: neither is seen, and neither covers anything; the wall behind is lit by both.
#[test]
fn hidden_lights_shine_and_are_not_seen() {
    let scene = |walls: &str| {
        render(&format!(
            "{PARALLEL}image: {{width: 4, height: 4}}\nrender: {{samples: 256}}\n\
             integrator: {{path: {{hide_emitters: true}}}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             shapes:\n- sphere: {{radius: 0.5, emission: 4, material: {{diffuse: {{reflectance: 0}}}}}}\n{walls}"
        ))
        .resolve(&ColourSpace::Xyz.matrix_from_xyz())
    };
    let empty = scene("");
    assert!(empty.rgb.iter().flatten().chain(&empty.alpha).all(|x| *x == 0.0));
    // A black wall close behind it.
    let wall = "- rectangle: {corner: [-9, -9, -0.6], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {diffuse: {reflectance: RHO}}}\n";
    let black = scene(&wall.replace("RHO", "0"));
    assert!(black.rgb.iter().flatten().all(|x| *x == 0.0) && black.alpha.iter().all(|a| *a == 1.0));
    // A sphere that stands wholly above a wall fills r²d/D³ of its cosine-weighted sky, where D² = d² + x² + y², d = 0.6 and
    // r = 0.5, so that the wall's radiance is 1 + (4 − 1) r²d/D³. Over a pixel next to the axis, a = 0.5 wide, ∫∫ d/D³ is the
    // solid angle of the pixel, atan(a² / (d √(d² + 2a²))): the mean of the share is that times r²/a² = 1.
    let white = scene(&wall.replace("RHO", "1"));
    let solid_angle = (0.25f64 / (0.6 * (0.36f64 + 0.5).sqrt())).atan();
    let middle = [5, 6, 9, 10];
    let mean = middle.iter().map(|i| f64::from(white.rgb[1][*i])).sum::<f64>() / 4.0;
    let error = middle.iter().map(|i| f64::from(white.standard_error[1][*i]).powi(2)).sum::<f64>().sqrt() / 4.0;
    // Of four pixels with three degrees of freedom each, one in 600 is beyond four of these errors.
    assert!((mean - 1.0 - 3.0 * solid_angle).abs() < 4.0 * error && error < 0.01 * mean, "{mean} ± {error}");
}

/// A boundary before a hidden sky: where the first hit covers, there is alpha, and so is the light that comes through; where it covers
/// nothing, nothing is seen. Beside it there is neither.
#[test]
fn a_hidden_sky_is_seen_where_what_is_before_it_covers() {
    for (coverage, x, expected) in
        [("first_hit", 0, (1.0, 1.0)), ("scattering", 0, (0.0, 0.0)), ("first_hit", 9, (0.0, 0.0))]
    {
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             integrator: {{path: {{max_depth: 2, count_crossings: true, hide_emitters: true, coverage: {coverage}}}}}\nshapes:\n\
             - rectangle: {{corner: [{}, -2, 0], edge_u: [4, 0, 0], edge_v: [0, 4, 0], material: {{boundary: {{}}}}}}\n",
            x - 2
        );
        let sample = bench_with(&scene, &[]).sample([0, 0], 0);
        assert_eq!((sample.radiance.to_array()[0], sample.alpha), expected, "{coverage} {x}");
    }
}

/// Between clipping planes at 4 and 6 m from a camera at 5 m there is the unit sphere's middle part: the near cap is
/// open, and what the camera sees is the inside.
#[test]
fn the_camera_sees_between_its_clipping_planes_only() {
    let see = |pose: &str, integrator: &str, clip: &str| {
        let camera = format!("camera: {{{pose}, clip: {{{clip}}}}}\n");
        let frame = render(&format!(
            "{camera}image: {{width: 1, height: 1}}\nrender: {{samples: 4}}\nintegrator: {integrator}\n\
             lights: [{{constant: {{radiance: 1}}}}]\nlayers: [{{name: d, surface: depth}}]\n\
             shapes: [{{sphere: {{radius: 1, material: {{diffuse: {{reflectance: 0}}}}}}}}]\n"
        ));
        let Image { rgb, alpha, .. } = frame.resolve(&ColourSpace::Xyz.matrix_from_xyz());
        (f64::from(frame.layer(0)[0]), rgb[1][0], alpha[0])
    };
    const PLAIN: &str = "origin: [0, 0, 5], target: [0, 0, 0], orthographic_height: 0.01";
    // The same camera with another unit, which the planes do not follow.
    const LARGE: &str =
        "to_world: [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, -2, 5], [0, 0, 0, 1]], orthographic_height: 0.005";
    for (pose, integrator) in [(PLAIN, "path"), (PLAIN, "{whitted: {}}"), (LARGE, "path"), (LARGE, "{whitted: {}}")] {
        // Half the picture is 5 mm wide: the sphere is at most 2.5e-5 m off there.
        for (clip, expected) in [("near: 0", 4.0), ("near: 3.5", 0.5), ("near: 4.5", 1.5), ("near: 4.5, far: 5.5", 0.0)]
        {
            let (depth, light, alpha) = see(pose, integrator, clip);
            assert!((depth - expected).abs() < 3e-5, "{integrator} {clip}: {depth}");
            // The sphere is black, and the sky behind it is not.
            assert_eq!(
                (light > 0.0, alpha),
                if expected > 0.0 { (false, 1.0) } else { (true, 0.0) },
                "{integrator} {clip}"
            );
        }
    }
}

/// What a camera looks at through something open is no nearer: a floor, 8 m away behind a mask without a covering, seen by paths from
/// either end; and through a camera that a matrix makes larger.
#[test]
fn the_far_clipping_plane_stays_where_it_is_behind_what_is_open() {
    let light = |camera: &str, integrator: &str, far: f64| {
        let frame = render(&format!(
            "camera: {{{camera}, clip: {{far: {far}}}}}\nimage: {{width: 8, height: 8}}\nrender: {{samples: 16}}\n\
             integrator: {integrator}\nmaterials: {{white: {{diffuse: {{}}}}, hole: {{mask: {{opacity: 0, material: white}}}}}}\n\
             shapes:\n- rectangle: {{corner: [-20, -20, -3], edge_u: [40, 0, 0], edge_v: [0, 40, 0], material: white}}\n\
             - rectangle: {{corner: [-20, -20, 2], edge_u: [40, 0, 0], edge_v: [0, 40, 0], material: hole}}\n\
             lights: [{{point: {{position: [0, 0, 0], intensity: 10}}}}]\n"
        ));
        let Image { rgb, alpha, .. } = frame.resolve(&ColourSpace::Xyz.matrix_from_xyz());
        let seen = alpha.iter().filter(|alpha| **alpha > 0.0).count();
        (rgb[1].iter().sum::<f32>() / rgb[1].len() as f32, seen)
    };
    let scaled = "to_world: [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, -2, 5], [0, 0, 0, 1]], orthographic_height: 2";
    for camera in ["origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 30", scaled] {
        let expected = light(camera, "path", 9.0);
        assert!(expected.0 > 0.05, "{camera}: {expected:?}");
        for integrator in ["path", "{whitted: {}}", "light_tracer"] {
            assert_eq!(light(camera, integrator, 6.0), (0.0, 0), "{camera} {integrator}");
            let found = light(camera, integrator, 9.0).0;
            assert!((found / expected.0 - 1.0).abs() < 0.2, "{camera} {integrator}: {found} for {expected:?}");
        }
    }
}
