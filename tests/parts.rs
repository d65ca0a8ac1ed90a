//! Parts of a picture add up to it, bit for bit, however it is cut; and what does not add up is refused.

mod common;

use abbe::batch::{self, Overrides, Portion, Samples, merge, part_file};
use abbe::error::Error;
use abbe::film::exr::{ExrFile, read_exr};
use abbe::math::sampler::mix64;
use common::place::Place;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A picture of 20 × 14 pixels, 12 samples each.
const FRAME: &str = "camera: {origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}\n\
                     image: {width: 20, height: 14}\n\
                     output: {exr: {precision: float, stderr: true}}\n";

/// A ball of flint under a small lamp, behind a pane of glass.
const CAUSTIC: &str = "shapes:\n\
                       - plane: {normal: [0, 1, 0]}\n\
                       - sphere: {center: [0, 1, 0], radius: 1, material: {dielectric: {ior: {glass: N-SF11}}}}\n\
                       - sphere: {center: [1, 3, 1], radius: 0.2, emission: 20}\n";

/// What is rendered, by name, and whether light comes from the lights.
fn scenes() -> Vec<(&'static str, String)> {
    let render = |text: &str| format!("render: {{samples: 12{text}}}\n");
    let caustics = |merging: &str| render(&format!(", techniques: {{light_tracing: on, merging: {merging}}}"));
    let layers = "layers:\n- {name: n, surface: shading_normal}\n- {name: a, squares: true}\n";
    let cropped = CAUSTIC.replace("shapes:", "lights: [{constant: {radiance: 0.3}}]\nshapes:");
    vec![
        ("path", render("") + "lights: [{constant: {radiance: 0.3}}]\n" + CAUSTIC),
        ("caustics", caustics("off") + CAUSTIC),
        ("merging", caustics("on") + CAUSTIC),
        ("light tracer", render("") + "integrator: light_tracer\n" + CAUSTIC),
        ("whitted", render("") + "integrator: {whitted: {grid: 3}}\n" + &cropped),
        ("layers", render("") + layers + &cropped),
        ("bands", caustics("on") + CAUSTIC),
        ("dealt", caustics("off") + "layers: [direct, caustic, Z]\n" + CAUSTIC),
        (
            "ways",
            caustics("on") + "layers: [direct, caustic, light_groups, Z, P, sampleCount, crypto_object]\n" + CAUSTIC,
        ),
    ]
}

/// The scene of [`scenes`] with this name.
fn yaml(name: &str, text: &str) -> String {
    let bands = "height: 14, bands: [{name: red, response: {table: [[600, 1], [700, 1]]}}, {name: all, response: 2}]";
    let frame = match name {
        "bands" => FRAME.replace("height: 14", bands),
        "dealt" => FRAME.replace("height: 14", "height: 14, filter: {gaussian: {stddev: 0.6}}"),
        _ => FRAME.to_owned(),
    };
    frame + text
}

/// Renders into `out`, with further settings; all, or a part.
fn render(place: &Place, out: &str, portion: Portion, set: &[(&str, &str)]) -> PathBuf {
    let set = set.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let output = place.path(out);
    let overrides = Overrides { output: Some(output.clone()), portion, set, ..Overrides::default() };
    let yaml = place.path("scene.yaml");
    let report = batch::render_batch(&yaml, &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
    output
}

fn part(tile: [u32; 2], samples: [u32; 2]) -> Portion {
    Portion { tile: Some(tile), samples: Some(Samples::Range(samples)) }
}

/// Numbers that follow from a seed.
struct Draws(u64);

impl Draws {
    /// A number below `n`.
    fn below(&mut self, n: u32) -> u32 {
        self.0 = mix64(self.0.wrapping_add(0x9e37_79b9_7f4a_7c15));
        (self.0 % u64::from(n)) as u32
    }

    /// 0 to n − 1 in ranges, the last included.
    fn ranges(&mut self, n: u32) -> Vec<[u32; 2]> {
        let mut all = Vec::new();
        let mut start = 0;
        while start < n {
            let end = (start + 1 + self.below(n)).min(n);
            all.push([start, end - 1]);
            start = end;
        }
        all
    }

    /// Parts that make up a picture of `samples`: tiles of each range of samples, or ranges of each tile.
    fn parts(&mut self, samples: u32) -> Vec<Portion> {
        let mut all = Vec::new();
        if self.below(2) == 0 {
            for range in self.ranges(samples) {
                let tiles = 1 + self.below(4);
                all.extend((0..tiles).map(|tile| part([tile, tiles], range)));
            }
        } else {
            let tiles = 1 + self.below(4);
            for tile in 0..tiles {
                all.extend(self.ranges(samples).into_iter().map(|range| part([tile, tiles], range)));
            }
        }
        for i in (1..all.len()).rev() {
            all.swap(i, self.below(i as u32 + 1) as usize);
        }
        all
    }
}

/// Pixels by their bits, and what the header says but for the clock.
fn content(file: &ExrFile) -> Vec<(String, Vec<u32>)> {
    let part = &file.parts[0];
    part.channels.iter().map(|(name, v)| (name.clone(), v.iter().map(|x| x.to_bits()).collect())).collect()
}

fn same(whole: &Path, merged: &Path, what: &str) {
    let (a, b) = (read_exr(whole).unwrap(), read_exr(merged).unwrap());
    assert!(content(&a) == content(&b), "{what}: the pixels differ");
    assert_eq!(a.parts[0].texts, b.parts[0].texts, "{what}");
    let png = |path: &Path| std::fs::read(path.with_extension("png")).unwrap();
    assert!(png(whole) == png(merged), "{what}: the PNG files differ");
}

/// A report without what a clock says, how the error fell on the way, and names of files.
fn timeless(mut report: Value) -> Value {
    for field in ["seconds", "threads", "peak_memory"] {
        report[field] = Value::Null;
    }
    for field in ["seconds", "msamples_per_second", "halving_seconds", "convergence", "files"] {
        report["scenes"][0][field] = Value::Null;
    }
    report
}

#[test]
fn any_parts_add_up_to_the_picture_bit_for_bit() {
    let seed: u64 = std::env::var("ABBE_SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(1);
    let draws_of_each = if std::env::var_os("ABBE_NIGHTLY").is_some() { 40 } else { 4 };
    for (n, (name, text)) in scenes().into_iter().enumerate() {
        let place = Place::of(&yaml(name, &text));
        let whole = render(&place, "whole/scene.exr", Portion::default(), &[]);
        let samples = if name == "whitted" { 9 } else { 12 };
        for draw in 0..draws_of_each {
            let mut draws = Draws(mix64(seed ^ (n as u64) << 32 ^ draw));
            let parts = draws.parts(samples);
            let what = format!("{name}, seed {seed}, draw {draw}: {parts:?}");
            let paths: Vec<PathBuf> = parts
                .into_iter()
                .enumerate()
                .map(|(i, portion)| render(&place, &format!("{draw}/{i}.exr"), portion, &[("render.tile", "32")]))
                .collect();
            let merged = place.path(&format!("merged{draw}/scene.exr"));
            let (_, written) = merge::merge(&paths, &merged, None).unwrap_or_else(|e| panic!("{what}: {e}"));
            written.unwrap();
            same(&whole, &merged, &what);
            let (a, b) = (place.json("whole/report.json"), place.json(&format!("merged{draw}/report.scene.json")));
            assert_eq!(timeless(a), timeless(b), "{what}");
        }
    }
}

/// Places and views beyond f32, 3.4e38, which matrices in a header are made of.
#[test]
fn parts_of_a_camera_beyond_what_a_header_can_hold_are_read() {
    let place = Place::of(
        "camera: {origin: [0, 1, 6], target: [0, 1, 0], fov_deg: 40}\nimage: {width: 8, height: 8}\n\
         render: {samples: 4}\nlights: [constant: {radiance: 1}]\nshapes: [sphere: {radius: 1}]\n",
    );
    for (i, set) in [
        "camera.origin=[0, 1, 1e39]",
        "camera.principal_point=[1e60, 0]",
        "camera.fov_deg=1e-60",
        "camera={origin: [0, 1, 6], target: [0, 1, 0], orthographic_height: 1e-60}",
    ]
    .iter()
    .enumerate()
    {
        let run = |arguments: &[&str]| {
            let ran = place.run(arguments);
            assert_eq!(ran.code, 0, "{set}: {}", ran.err);
        };
        let [parts, merged, whole] = ["parts", "merged", "whole"].map(|name| format!("{i}/{name}"));
        let common = ["render", "scene.yaml", "-q", "--set", set, "-o"];
        for tile in ["0/2", "1/2"] {
            run(&[&common[..], &[&parts, "--tile", tile]].concat());
        }
        run(&["merge", &parts, "-q", "-o", &merged]);
        run(&[&common[..], &[&whole]].concat());
        same(&place.path(&whole).join("scene.exr"), &place.path(&merged).join("scene.exr"), set);
    }
}

#[test]
fn light_from_the_lights_is_in_the_scenes_of_this_file() {
    let light = |name: &str| {
        let (_, text) = scenes().into_iter().find(|(n, _)| *n == name).unwrap();
        let bench = common::bench_with(&yaml(name, &text), &[]);
        (bench.frame().splats.is_some(), bench.prepared.plan.caustics.as_ref().is_some_and(|c| c.merging.is_some()))
    };
    assert_eq!(["caustics", "merging", "light tracer"].map(light), [(true, false), (true, true), (true, false)]);
    assert_eq!(light("bands"), (true, true));
}

/// The second merge took the picture of the first for a part.
#[test]
fn parts_may_be_merged_where_they_lie_as_often_as_one_likes() {
    let place = Place::of(&format!("{FRAME}render: {{samples: 4}}\nlights: [{{constant: {{radiance: 1}}}}]\n"));
    for tile in ["0/2", "1/2"] {
        let bands = ["--set", "output.spectral={bands: 4}"];
        let ran = place.run(&[&["render", "scene.yaml", "-q", "-o", "parts", "--tile", tile][..], &bands].concat());
        assert_eq!((ran.code, ran.err), (0, String::new()));
    }
    for _ in 0..2 {
        let ran = place.run(&["merge", "parts", "-q", "-o", "parts"]);
        assert_eq!((ran.code, ran.err), (0, String::new()));
        assert!(place.path("parts/scene.spectral.exr").exists());
    }
    // By its own name it is no part.
    let ran = place.run(&["merge", "parts", "parts/scene.exr", "-q", "-o", "parts"]);
    assert!(ran.code == 3 && ran.err.contains("parts/scene.exr: expected a part"), "{}", ran.err);
}

/// The message of a merge that must fail with exit code 3 and write nothing.
fn refusal(place: &Place, paths: &[PathBuf]) -> String {
    let out = place.path("refused/scene.exr");
    let error = merge::merge(paths, &out, None).unwrap_err();
    assert!(matches!(error, Error::Input { .. }) && error.exit_code() == 3, "{error}");
    assert!(!out.exists() && !out.with_extension("png").exists());
    error.to_string()
}

#[test]
fn parts_that_do_not_make_up_one_picture_are_refused() {
    let (_, text) = scenes().swap_remove(1);
    let place = Place::of(&format!("{FRAME}{text}"));
    let one = |name: &str, portion, set: &[(&str, &str)]| render(&place, name, portion, set);
    let (a, b) = (one("a.exr", part([0, 2], [0, 11]), &[]), one("b.exr", part([1, 2], [0, 11]), &[]));
    let name = |path: &Path| path.display().to_string();

    let e = refusal(&place, std::slice::from_ref(&a));
    assert!(
        e.contains("cannot be merged from 1 parts: samples 0-11 of row 7 are missing: expected samples 0-11"),
        "{e}"
    );
    let e = refusal(&place, &[a.clone(), b.clone(), a.clone()]);
    assert!(e.contains(&name(&a)) && e.contains("overlap") && e.contains("samples 0-11"), "{e}");
    let late = one("late.exr", part([1, 2], [4, 11]), &[]);
    let e = refusal(&place, &[a.clone(), late.clone()]);
    assert!(e.contains("samples 0-3 of row 7 are missing"), "{e}");
    let e = refusal(&place, &[a.clone(), b.clone(), late]);
    assert!(e.contains("overlap") && e.contains("samples 4-11"), "{e}");

    for (key, value, field) in [
        ("render.seed", "5", "seed: expected 0, found 5"),
        ("render.samples", "16", "samples: expected 12, found 16"),
        ("output.colour", "acescg", "output.colour: expected \"rec709\", found \"acescg\""),
        ("image.sensitivity", "2", "sensitivity: expected 1.0, found 2.0"),
        ("shapes[1].sphere.radius", "0.9", "scene with the hash: expected "),
    ] {
        let other = one("other.exr", part([1, 2], [0, 11]), &[(key, value)]);
        let e = refusal(&place, &[a.clone(), other.clone()]);
        assert!(e.contains(&name(&other)) && e.contains(field), "{key}: {e}");
    }

    let picture = one("picture.exr", Portion::default(), &[]);
    let e = refusal(&place, &[a.clone(), picture]);
    assert!(e.contains("picture.exr") && e.contains("found another OpenEXR file"), "{e}");
    let e = refusal(&place, &[a.clone(), place.path("none.exr")]);
    assert!(e.contains("none.exr: there is no such file"), "{e}");
    let e = refusal(&place, &[a.clone(), place.path("scene.yaml")]);
    assert!(e.contains("found no OpenEXR file"), "{e}");

    // A byte among the last rows, half a file, and another version.
    let whole = std::fs::read(&b).unwrap();
    let mut bytes = whole.clone();
    let last = bytes.len() - 9;
    bytes[last] ^= 4;
    let bad = place.path("bad.exr");
    std::fs::write(&bad, &bytes).unwrap();
    let e = refusal(&place, &[a.clone(), bad.clone()]);
    assert!(e.contains("bad.exr: the part is damaged"), "{e}");
    std::fs::write(&bad, &whole[..whole.len() / 2]).unwrap();
    let e = refusal(&place, &[a.clone(), bad.clone()]);
    assert!(e.contains("bad.exr: the part is damaged: it ends early"), "{e}");
    let version = concat!("Abbe ", env!("CARGO_PKG_VERSION"));
    let place_of =
        |bytes: &[u8]| bytes.windows(9 + version.len()).position(|w| w == format!("\"build\":\"{version}").as_bytes());
    let at = place_of(&whole).unwrap() + 9 + 5;
    bytes.copy_from_slice(&whole);
    bytes[at] = b'9';
    std::fs::write(&bad, &bytes).unwrap();
    let e = refusal(&place, &[a, bad]);
    assert!(e.contains(&format!("expected a part by {version}")) && e.contains("found one by Abbe 9"), "{e}");
}

/// Of the numbers of a header one is changed to what no part has: tiles, samples, rows, seconds. There is no tile of none.
#[test]
fn a_header_that_makes_no_sense_is_told_by_info_as_by_merge() {
    let place = Place::of(&format!("{FRAME}{}", scenes()[0].1));
    let whole = std::fs::read(render(&place, "a.exr", part([0, 2], [0, 8]), &[])).unwrap();
    for (from, to) in [
        ("\"tile\":[0,2]", "\"tile\":[0,0]"),
        ("\"tile\":[0,2]", "\"tile\":[2,2]"),
        ("\"samples\":[0,9]", "\"samples\":[9,9]"),
        ("\"width\":20,\"height\":14", "\"width\":20,\"height\": 0"),
    ] {
        let at = whole.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let mut bytes = whole.clone();
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        std::fs::write(place.path("bad.exr"), bytes).unwrap();
        for verb in [&["info", "bad.exr"][..], &["merge", "bad.exr", "-o", "out"]] {
            let ran = place.run(verb);
            let told =
                ran.err.starts_with("error: bad.exr: ") && ran.err.contains("damaged") && ran.err.lines().count() == 1;
            assert!(ran.code == 3 && told, "{verb:?} of {to}: {} {}", ran.code, ran.err);
        }
    }
}

/// Settings of files are one field of a header, longer than a message.
#[test]
fn where_parts_of_other_settings_differ_is_told() {
    let place = Place::of(&yaml("whitted", &scenes()[0].1));
    let a = render(&place, "a.exr", part([0, 2], [0, 8]), &[]);
    let b = render(&place, "b.exr", part([1, 2], [0, 8]), &[("output.png.tonemap", "agx")]);
    let message = refusal(&place, &[a, b]);
    assert!(
        message.ends_with("it is of another picture: output.png.tonemap: expected \"aces\", found \"agx\""),
        "{message}"
    );
}

/// Headers are compared before any sum is read: here they say other things than the files were rendered with. Nothing else
/// of the pictures differs.
#[test]
fn parts_of_other_plans_and_paths_from_the_lights_are_refused() {
    let (_, text) = scenes().swap_remove(1);
    let place = Place::of(&format!("{FRAME}{text}"));
    let [a, b] = [0, 1].map(|i| render(&place, &format!("{i}.exr"), part([i, 2], [0, 11]), &[]));
    let header = part_file::open(&b).unwrap().header;
    let paths = header.paths.unwrap();
    let half = header.claims.lights[0].0.start;
    assert_eq!(header.claims.lights, [(half..paths, 0..12)]);
    // Blanks fill what a shorter text leaves.
    let edited = |file: &Path, from: &str, to: &str| {
        let mut bytes = std::fs::read(file).unwrap();
        let places: Vec<usize> = (0..bytes.len()).filter(|at| bytes[*at..].starts_with(from.as_bytes())).collect();
        assert_eq!(places.len(), 1, "{from}");
        bytes[places[0]..places[0] + from.len()].copy_from_slice(format!("{to:<0$}", from.len()).as_bytes());
        let path = place.path("edited.exr");
        std::fs::write(&path, bytes).unwrap();
        path
    };

    let other = header.plan_hash.replace(|c: char| c != '0', "0");
    let plan = edited(&b, &format!("\"plan_hash\":\"{}\"", header.plan_hash), &format!("\"plan_hash\":\"{other}\""));
    let e = refusal(&place, &[a.clone(), plan]);
    assert!(e.contains(&format!("plan with the hash: expected {}, found {other}", header.plan_hash)), "{e}");
    let exponent = edited(&b, "\"exponent\":0", "\"exponent\":1");
    let e = refusal(&place, &[a.clone(), exponent]);
    assert!(e.contains("it is of another picture: plan"), "{e}");
    let fewer = edited(&a, &format!("\"paths\":{paths},"), &format!("\"paths\":{},", paths - 1));
    let e = refusal(&place, &[fewer, b.clone()]);
    assert!(e.contains("it is of another picture: plan"), "{e}");

    let lights = |from: u64, to: u64, sample: u32| format!("\"lights\":[[{from},{to},{sample},12]]");
    let own = lights(half, paths, 0);
    let e = refusal(&place, &[a.clone(), edited(&b, &own, &lights(half, paths, 1))]);
    assert!(e.contains(&format!("sample 0 of the paths {half}-{} from the lights are missing", paths - 1)), "{e}");
    let e = refusal(&place, &[a.clone(), edited(&b, &own, &lights(half, paths - 1, 0))]);
    assert!(e.contains(&format!("samples 0-11 of the paths {0}-{0} from the lights are missing", paths - 1)), "{e}");
    let e = refusal(&place, &[a.clone(), edited(&b, &own, &lights(half - 1, paths, 0))]);
    assert!(e.contains("overlap") && e.contains("samples 0-11"), "{e}");
    // As they were, they make up the picture.
    merge::merge(&[a, b], &place.path("both/scene.exr"), None).unwrap().1.unwrap();
}

#[test]
fn a_tile_or_samples_that_the_picture_lacks_are_a_fault_of_usage() {
    let place = Place::of(&format!("{FRAME}render: {{samples: 12}}\nlights: [{{constant: {{radiance: 1}}}}]\n"));
    let failure = |portion| {
        let overrides = Overrides { output: Some(place.path("a.exr")), portion, ..Overrides::default() };
        let report = batch::render_batch(&place.path("scene.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 2);
        format!("{:?}", report.scenes[0].status)
    };
    for tile in [[2, 2], [0, 15], [0, 0]] {
        assert!(failure(Portion { tile: Some(tile), samples: None }).contains("n at most 14"), "{tile:?}");
    }
    for samples in [[0, 12], [5, 4], [12, 12]] {
        let e = failure(Portion { tile: None, samples: Some(Samples::Range(samples)) });
        assert!(e.contains("from 0-0 to 11-11: the scene has 12 samples"), "{e}");
    }
    assert!(!place.path("a.exr").exists());
}
