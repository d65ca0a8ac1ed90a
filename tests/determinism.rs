//! The same scene and seed give the same bits, however the work is cut; and `effects: all` proves that
//! what the plan leaves out changes nothing.

mod common;

use abbe::batch::frame::FrameJob;
use abbe::batch::part::render_part;
use abbe::batch::{self, Overrides};
use abbe::film::Window;
use abbe::film::accumulate::Film;
use abbe::film::exr::{ExrFile, read_exr};
use common::{Bench, bench_with, grey_png, on_threads, write};
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A picture of 20 × 14 pixels, which no tile size below divides.
const FRAME: &str = "camera: {origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}\nimage: {width: 20, height: 14}\n";

/// Scenes that between them have each effect; the names of those they have.
fn scenes() -> Vec<(&'static str, String)> {
    let base = "shapes:\n- plane: {normal: [0, 1, 0]}\n";
    let sun = "lights: [{directional: {direction: [0.3, -1, -0.5], irradiance: 3}}]\n";
    let sky = "lights: [{constant: {radiance: 0.7}}]\n";
    let lamp = "- sphere: {center: [1, 3, 1], radius: 0.4, emission: 2}\n";
    let glass = |index: &str| {
        format!(
            "{sky}{base}- sphere: {{center: [0, 1, 0], radius: 1, material: {{dielectric: {{ior: {index}}}}}}}\n{lamp}"
        )
    };
    vec![
        ("diffuse", format!("{sun}{base}- cube: {{center: [0, 0.5, 0], size: 1}}\n")),
        ("glass of one index", glass("1.5")),
        ("glass and a bubble", {
            glass("1.5")
                + "- sphere: {center: [0, 1, 0], radius: 0.5, material: {dielectric: {ior: 1, exterior_ior: 1.5}}}\n"
        }),
        ("glass of many indices", glass("{glass: N-SF11}")),
        ("a film", glass("1.5, film: {ior: 1.33, thickness_nm: 400}")),
        ("a film on rough glass", glass("1.5, roughness: 0.2, film: {ior: 1.33, thickness_nm: 400}")),
        (
            "rough glass",
            format!(
                "{sky}{base}- sphere: {{center: [0, 1, 0], radius: 1, material: {{dielectric: {{ior: 1.5, roughness: 0.2}}}}}}\n"
            ),
        ),
        (
            "schlick glass and a pane",
            format!(
                "{sky}{base}- sphere: {{center: [0, 1, 0], radius: 1, material: {{dielectric: {{ior: 1.5, fresnel: schlick}}}}}}\n\
                 - disk: {{center: [0, 1, 2], normal: [0, 0, 1], radius: 1, material: {{thin_dielectric: {{ior: 1.5}}}}}}\n"
            ),
        ),
        (
            "metal and mirror",
            format!(
                "{sky}{base}- sphere: {{center: [-1, 1, 0], radius: 1, material: {{conductor: {{metal: gold, roughness: 0.2}}}}}}\n\
                 - sphere: {{center: [1, 1, 0], radius: 1, material: {{mirror: {{}}}}}}\n"
            ),
        ),
        (
            "texture and plastic",
            format!(
                "{sun}textures: {{map: {{image: {{file: map.png}}}}}}\n{base}\
                 - sphere: {{center: [0, 1, 0], radius: 1, material: {{plastic: {{reflectance: {{texture: map}}}}}}}}\n"
            ),
        ),
        (
            "smoke",
            format!(
                "media: {{smoke: {{homogeneous: {{scattering: 1, absorption: 0.2}}}}}}\n{sky}{base}\
                 - sphere: {{center: [0, 1, 0], radius: 1, material: {{boundary: {{}}}}, inside: smoke}}\n{lamp}"
            ),
        ),
        (
            "coloured smoke",
            format!(
                "media: {{smoke: {{homogeneous: {{scattering: {{rgb: [0.2, 0.5, 1]}}, phase: {{hg: 0.5}}}}}}}}\n{sky}{base}\
                 - sphere: {{center: [0, 1, 0], radius: 1, material: {{boundary: {{}}}}, inside: smoke}}\n{lamp}"
            ),
        ),
        ("depth fog", format!("fog: {{colour: 0.5, density: 0.1}}\n{sun}{base}{lamp}")),
    ]
}

fn scene(text: &str, integrator: &str, render: &str) -> Bench {
    let map = grey_png(16, 8, |x, y| (x * 15 + y * 2) as u8);
    let frame = FRAME.replace("width", &format!("{}width", image(integrator)));
    let text = format!("{frame}{}{text}", settings(integrator, render));
    bench_with(&text, &[("map.png", &map)])
}

/// The bits of all sums of a film, and of the weights of its layers.
fn sums(film: &Film) -> Vec<([i128; 3], i64, u32, u32)> {
    let weights = film.layers.weight_units().iter().map(|units| ([0; 3], *units, 0, 0));
    common::sums(film).into_iter().chain(weights).collect()
}

/// What computes the light; [`SHARED`] has paths share what they find wherever they can, and send several shadow rays, [`DEALT`]
/// has samples count for all pixels that a wide filter reaches.
const INTEGRATORS: [&str; 4] = ["path", SHARED, DEALT, "{whitted: {grid: 3, ambient: 0.1}}"];

const SHARED: &str = "{path: {}}";

const DEALT: &str = "{path: {hide_emitters: false}}";

/// What is said of the picture besides its size.
fn image(integrator: &str) -> &str {
    if integrator == DEALT { "filter: {gaussian: {stddev: 0.6}}, " } else { "" }
}

fn settings(integrator: &str, render: &str) -> String {
    let (reuse, rays) = if integrator == SHARED { ("on", 3) } else { ("off", 1) };
    let techniques = format!("{{reuse: {reuse}, shadow_rays: {rays}}}");
    format!("integrator: {integrator}\nrender: {{samples: 8, techniques: {techniques}, {render}}}\n")
}

#[test]
fn threads_and_tiles_do_not_change_a_bit() {
    for integrator in INTEGRATORS {
        for (name, text) in scenes() {
            let reference = sums(&on_threads(1, || scene(&text, integrator, "tile: 32").film()));
            for (threads, tile) in [(2, 32), (1, 8), (2, 8), (2, 5), (1, 1)] {
                let film = on_threads(threads, || scene(&text, integrator, &format!("tile: {tile}")).film());
                assert!(sums(&film) == reference, "{name}, {integrator}: {threads} threads, tiles of {tile}");
            }
        }
    }
}

/// Renders `ranges` of samples in their order, each into a film of its own, and merges the films.
fn in_parts(bench: &Bench, ranges: &[Range<u32>], side: u32) -> Film {
    let filter = bench.prepared.sampler().unwrap();
    let job = FrameJob { tile: side, ..bench.prepared.job(&filter) };
    let frame = job.scene.camera.resolution;
    let mut whole = Film::new(frame, job.window).unwrap().with_layers(job.plan.layers.layout());
    for range in ranges {
        let (part, _) = render_part(&job, range.clone()).unwrap();
        whole.merge(&part).unwrap();
    }
    whole
}

#[test]
fn merged_sample_ranges_equal_one_run_in_any_order() {
    for integrator in INTEGRATORS {
        for (name, text) in scenes() {
            let bench = scene(&text, integrator, "tile: 32");
            let n = bench.prepared.samples;
            let reference = sums(&bench.film());
            for ranges in [vec![5..n, 0..2, 2..5], vec![3..7, 7..n, 0..3], (0..n).rev().map(|i| i..i + 1).collect()] {
                assert!(sums(&in_parts(&bench, &ranges, 7)) == reference, "{name}, {integrator}: {ranges:?}");
            }
        }
    }
}

#[test]
fn a_crop_shows_the_very_pixels_of_the_frame() {
    for integrator in INTEGRATORS {
        for (name, text) in scenes() {
            let whole = scene(&text, integrator, "tile: 8").film();
            let crop = Window { x: 3, y: 5, width: 9, height: 7 };
            let more = image(integrator);
            let size = "width: 20, height: 14, crop: {x: 3, y: 5, width: 9, height: 7}";
            let cropped = format!("{text}image: {{{more}{size}}}\n");
            let map = grey_png(16, 8, |x, y| (x * 15 + y * 2) as u8);
            let camera = FRAME.lines().next().unwrap();
            let yaml = format!("{camera}\n{}{cropped}", settings(integrator, "tile: 8"));
            let part = bench_with(&yaml, &[("map.png", &map)]).film();
            assert_eq!(part.window(), crop);
            for y in crop.y..crop.y + crop.height as i32 {
                for x in crop.x..crop.x + crop.width as i32 {
                    let a = &whole.cells()[whole.window().index([x, y]).unwrap()];
                    let b = &part.cells()[crop.index([x, y]).unwrap()];
                    assert!(a == b, "{name}, {integrator}: pixel ({x}, {y})");
                    let weights = |film: &Film| film.layers.weights(film.window().index([x, y]).unwrap());
                    assert!(weights(&whole) == weights(&part), "{name}, {integrator}: pixel ({x}, {y})");
                }
            }
        }
    }
}

/// An effect that the scene lacks is left out; forced on, it changes no bit. This holds for dispersion too:
/// glass of one index, computed as eight indices that happen to be equal.
#[test]
fn all_effects_give_the_bits_of_those_the_scene_calls_for() {
    for integrator in INTEGRATORS {
        for (name, text) in scenes() {
            let auto = scene(&text, integrator, "effects: auto");
            let all = scene(&text, integrator, "effects: all");
            assert!(all.prepared.plan.effects.iter().all(|e| e.on || integrator.contains("whitted")));
            assert!(auto.prepared.plan.effects.iter().any(|e| !e.on), "{name} lacks something");
            let (auto, all) = (auto.film(), all.film());
            let differ = sums(&auto).iter().zip(sums(&all)).filter(|(a, b)| **a != *b).count();
            assert!(differ == 0, "{name}, {integrator}: {differ} of {} sums differ", sums(&all).len());
        }
    }
}

/// Paths that go side by side send their shadow rays later than one alone does. What comes by them is added to light of photons in
/// the same order either way.
#[test]
fn all_effects_give_the_bits_of_merged_light() {
    let picture = |effects: &str| {
        let yaml = format!(
            "camera: {{origin: [0.2, 0.7, 2.5], target: [0.1, 1.1, -0.2], fov_deg: 60}}\nimage: {{width: 32, height: 24}}\n\
             render: {{samples: 32, seed: 2, effects: {effects}, \
             techniques: {{light_tracing: on, merging: on, reuse: on, shadow_rays: 4}}}}\nshapes:\n\
             - rectangle: {{corner: [-4, 0, 4], edge_u: [8, 0, 0], edge_v: [0, 0, -8], material: {{diffuse: {{reflectance: 0.8}}}}}}\n\
             - sphere: {{center: [0, 0.7, 0.2], radius: 0.4, material: {{dielectric: {{ior: 1.33}}}}}}\n\
             - rectangle: {{corner: [1, 2.6, -0.7], edge_u: [0.6, 0, 0], edge_v: [0, 0, 0.5], emission: 1}}\n"
        );
        let bench = bench_with(&yaml, &[]);
        let plan = &bench.prepared.plan;
        assert!(plan.reuse && plan.caustics.as_ref().is_some_and(|caustics| caustics.merging.is_some()));
        sums(&bench.film())
    };
    let (auto, all) = (picture("auto"), picture("all"));
    let differ = auto.iter().zip(&all).filter(|(a, b)| a != b).count();
    assert!(differ == 0, "{differ} of {} sums differ", auto.len());
}

/// A medium that is declared and fills nothing is none to light that comes from the lamps through dispersive glass, whose
/// wavelengths go together as long as it is known what they are in.
#[test]
fn a_medium_that_nothing_holds_changes_nothing() {
    let picture = |media: &str, effects: &str| {
        let place = tempfile::TempDir::new().unwrap();
        let path = |name: &str| place.path().join(name);
        let yaml = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 42}}\nimage: {{width: 16, height: 16}}\n{media}\
             render: {{samples: 64, seed: 1, effects: {effects}}}\n\
             output: {{exr: {{precision: float}}}}\nshapes:\n\
             - plane: {{point: [0, -1, 0], normal: [0, 1, 0]}}\n\
             - cube: {{center: [-1.4, 0.3, 0.8], size: 0.8, material: {{dielectric: {{ior: {{glass: N-SF11}}}}}}}}\n\
             - sphere: {{center: [-2.5, -0.5, -2], radius: 0.3, emission: 5}}\n"
        );
        write(&path("s.yaml"), yaml.as_bytes());
        let overrides = Overrides { output: Some(path("s.exr")), ..Overrides::default() };
        let report = batch::render_batch(&path("s.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
        report.scenes[0].pixel_hash.clone()
    };
    let unused = "media: {unused: {homogeneous: {absorption: 0.3}}}\n";
    let plain = picture("", "auto");
    assert!(!plain.is_empty());
    for (media, effects) in [("", "all"), (unused, "auto"), (unused, "all")] {
        assert_eq!(picture(media, effects), plain, "{media} {effects}");
    }
}

/// The wall through which a shadow ray enters a lamp that shines inward stands in its way, half open or not, whether or not
/// there is smoke somewhere.
#[test]
fn lamps_that_shine_inward_stand_in_their_own_way_with_and_without_media() {
    let base = "shapes:\n- plane: {normal: [0, 1, 0]}\n";
    let lamps = [
        "sphere: {center: [0, 2, 0], radius: 0.8, ",
        "cylinder: {base: [-1, 2, 0], top: [1, 2.2, 0], radius: 0.5, ",
        "cone: {base: [-1, 2, 0], apex: [1, 2.2, 0], radius: 0.5, ",
    ];
    let paint = "{diffuse: {reflectance: 0}}";
    let smoke = "- sphere: {center: [100, 50, 100], radius: 1, material: {boundary: {}}, inside: smoke}\n";
    let media = "media: {smoke: {homogeneous: {absorption: 0.3}}}\n";
    for lamp in lamps {
        let half = format!(
            "{base}- {lamp}flip_normals: true, emission: 1, material: {{mask: {{opacity: 0.5, material: {paint}}}}}}}\n"
        );
        let [auto, all] =
            ["auto", "all"].map(|effects| sums(&scene(&half, "path", &format!("effects: {effects}")).film()));
        assert!(auto == all, "{lamp}");
        let with_smoke = sums(&scene(&format!("{media}{half}{smoke}"), "path", "effects: auto").film());
        assert!(auto == with_smoke, "{lamp}");
        let opaque = format!("{media}{base}- {lamp}flip_normals: true, emission: 1, material: {paint}}}\n{smoke}");
        let film = scene(&opaque, "{path: {max_depth: 2}}", "effects: auto").film();
        // The open ends of a tube would let light out; these have none.
        assert!(sums(&film).iter().all(|sum| sum.0 == [0; 3]), "{lamp}");
    }
}

/// How much light is traced from the lamps is told by the rays that it takes, of which effects that are forced on take none: not
/// for wavelengths that leave the glass for the sky either.
#[test]
fn all_effects_trace_as_many_paths_from_the_lights() {
    let text = "camera: {origin: [0, 2, 6], target: [0, 0.8, 0], fov_deg: 40}\nimage: {width: 64, height: 64}\n\
        lights: [{constant: {radiance: 0.3}}]\nshapes:\n- plane: {normal: [0, 1, 0]}\n\
        - sphere: {center: [-0.8, 0.8, 0], radius: 0.8, material: {dielectric: {ior: {glass: N-SF11}}}}\n\
        - rectangle: {corner: [-1, 4, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], emission: 6}\n";
    let [auto, all] = ["auto", "all"].map(|effects| {
        let bench = bench_with(&format!("{text}render: {{samples: 16, effects: {effects}}}\n"), &[]);
        bench.prepared.plan.caustics.as_ref().map(|caustics| caustics.ratio)
    });
    assert!(auto.is_some() && auto == all, "{auto:?} {all:?}");
}

#[test]
fn another_seed_gives_another_picture() {
    for (name, text) in scenes() {
        let a = sums(&scene(&text, "path", "seed: 1").film());
        let b = sums(&scene(&text, "path", "seed: 2").film());
        // Only black may be alike: wavelengths are drawn even where nothing else is.
        let black = |sum: &([i128; 3], i64, u32, u32)| sum.0 == [0; 3];
        let alike = a.iter().zip(&b).filter(|(a, b)| a == b && !black(a)).count();
        assert!(alike * 50 < a.len(), "{name}: {alike} of {} sums are alike", a.len());
        // The recursive tracer draws nothing.
        let whitted = |seed| sums(&scene(&text, "{whitted: {}}", seed).film());
        assert!(whitted("seed: 1") == whitted("seed: 2"), "{name}");
    }
}

/// A whole scene moved to another place of the frame's memory, with its materials and lights in another order
/// of definition, is the same scene: names are sorted, not hashed.
#[test]
fn the_order_of_definitions_does_not_change_a_bit() {
    let shapes = "shapes:\n- plane: {normal: [0, 1, 0], material: b}\n- sphere: {center: [0, 1, 0], radius: 1, material: a}\n\
                  lights: [{constant: {radiance: 1}}]\n";
    let one = format!(
        "materials:\n  a: {{mirror: {{}}}}\n  b: {{diffuse: {{reflectance: 0.4}}}}\n  c: {{mirror: {{}}}}\n{shapes}"
    );
    let two = format!("{shapes}materials:\n  b: {{diffuse: {{reflectance: 0.4}}}}\n  a: {{mirror: {{}}}}\n");
    assert!(sums(&scene(&one, "path", "").film()) == sums(&scene(&two, "path", "").film()));
}

/// Case O39: a scene scaled by a power of two, with light that does not fall off with distance, has the
/// same pixels to the last bit.
#[test]
fn a_scene_scaled_by_a_power_of_two_has_the_same_bits() {
    let scaled = |k: i32| {
        let s = 2f64.powi(k);
        let text = format!(
            "camera: {{origin: [0, {}, {}], target: [0, {}, 0], fov_deg: 40}}\nimage: {{width: 20, height: 14}}\n\
             render: {{samples: 8}}\nlights: [{{constant: {{radiance: 0.3}}}}]\nshapes:\n\
             - plane: {{normal: [0, 1, 0]}}\n\
             - sphere: {{center: [0, {s}, 0], radius: {s}, material: {{dielectric: {{ior: 1.5, priority: 2}}}}}}\n\
             - sphere: {{center: [0, {}, 0], radius: {s}, material: {{dielectric: {{ior: 1.33, priority: 1}}}}}}\n\
             - cone: {{base: [{s}, 0, {s}], apex: [{s}, {s}, {s}], radius: {}}}\n\
             - cylinder: {{base: [-{s}, 0, {s}], top: [-{s}, {s}, {s}], radius: {}, material: {{conductor: {{metal: gold, roughness: 0.3}}}}}}\n\
             - cube: {{center: [0, {}, 0], size: {}}}\n\
             - sphere: {{center: [{s}, {}, {s}], radius: {}, emission: 2}}\n",
            1.5 * s,
            6.0 * s,
            0.75 * s,
            1.5 * s,
            0.5 * s,
            0.25 * s,
            2.5 * s,
            0.5 * s,
            3.0 * s,
            0.5 * s
        );
        sums(&bench_with(&text, &[]).film())
    };
    let reference = scaled(0);
    for k in [-20, -1, 1, 20] {
        let differ = scaled(k).iter().zip(&reference).filter(|(a, b)| a != b).count();
        assert!(differ == 0, "2^{k}: {differ} of {} sums differ", reference.len());
    }
}

fn render_to(yaml: &Path, out: &Path) -> ExrFile {
    let overrides = Overrides { output: Some(out.to_path_buf()), ..Overrides::default() };
    let report = batch::render_batch(yaml, &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
    read_exr(&out.join("scene.exr")).unwrap()
}

/// Two runs write the same file but for what a clock says: the seconds in the header.
#[test]
fn two_runs_write_the_same_file_but_for_the_clock() {
    for integrator in INTEGRATORS {
        for (name, text) in scenes() {
            let bench = scene(&text, integrator, "tile: 8");
            let yaml = bench.directory.path().join("scene.yaml");
            let (a, b) = (bench.directory.path().join("a"), bench.directory.path().join("b"));
            let (one, two) = (render_to(&yaml, &a), render_to(&yaml, &b));
            assert_eq!(one.display, two.display);
            assert_eq!(one.chromaticities, two.chromaticities);
            for (p, q) in one.parts.iter().zip(&two.parts) {
                assert_eq!(p.texts, q.texts, "{name}");
                for ((n, x), (m, y)) in p.channels.iter().zip(&q.channels) {
                    let bits = |v: &[f32]| v.iter().map(|f| f.to_bits()).collect::<Vec<_>>();
                    assert!(n == m && bits(x) == bits(y), "{name}, {integrator}: channel {n}");
                }
            }
            let read = |dir: &Path, file: &str| std::fs::read(dir.join(file)).unwrap();
            assert!(read(&a, "scene.png") == read(&b, "scene.png"), "{name}: PNG");
            let clockless = |dir: &Path| without_seconds(&read(dir, "scene.exr"));
            assert!(clockless(&a) == clockless(&b), "{name}, {integrator}: the bytes of the files differ");
        }
    }
}

/// The bytes of an EXR file with the values of attributes whose name has "econds" set to zero. An attribute
/// is its name, its type, both ended by 0, its size in four bytes, its value.
fn without_seconds(bytes: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let mut at = 0;
    while let Some(found) = bytes[at..].windows(6).position(|w| w == b"econds") {
        let name = at + found;
        let end_of_name = name + bytes[name..].iter().position(|b| *b == 0).unwrap();
        let kind = end_of_name + 1;
        let end_of_kind = kind + bytes[kind..].iter().position(|b| *b == 0).unwrap();
        let value = end_of_kind + 5;
        if &bytes[kind..end_of_kind] == b"double" {
            out[value..value + 8].fill(0);
        }
        at = value;
    }
    out
}
