//! Batches: what goes on after a failure, what the report tells, what scenes share.

use super::{BALL, SMALL, batch};
use crate::common::place::Place;
use serde_json::Value;

#[test]
fn a_batch_goes_on_after_a_scene_that_fails_and_says_so_at_the_end() {
    let place = batch();
    let ran = place.run(&["render", "batch.yaml"]);
    assert_eq!(ran.code, 2);
    assert_eq!(
        place.names("out"),
        ["contact-sheet.html", "contact-sheet.png", "good.exr", "good.png", "other.exr", "other.png", "report.json"]
    );
    let last: Vec<&str> = ran.err.lines().rev().take(2).collect();
    assert_eq!(
        last,
        [
            "error: 1 of 3 scenes failed; the others are written",
            "error: bad: scenes/bad.yaml:3:28: shapes[0].sphere.radius: expected a number greater than 0, found -1",
        ]
    );
    // The table shows what was made.
    assert!(ran.out.contains("4 files in out/") && ran.out.lines().any(|l| l.starts_with("other ")), "{}", ran.out);
}

#[test]
fn plan_and_render_end_alike_where_several_things_are_wrong() {
    let place = batch();
    for files in [["scenes/bad.yaml", "none.yaml"], ["none.yaml", "scenes/bad.yaml"]] {
        let [a, b] = files;
        std::fs::write(place.path("two.yaml"), format!("scenes: [{{file: {a}}}, {{file: {b}}}]")).unwrap();
        assert_eq!(["plan", "render"].map(|verb| place.run(&[verb, "two.yaml"]).code), [2, 2], "{files:?}");
    }
}

/// Programs that read what is said look for the word at the beginning of a line.
#[test]
fn each_fault_is_a_line_of_its_own_by_every_verb() {
    let place = Place::with(&[(
        "s.yaml",
        "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nshapes: [sphere: {radius: -1}, sphere: {radius: -2}]\n",
    )]);
    let message = |i: usize, column: usize| {
        let radius = -1 - i as i32;
        format!("s.yaml:2:{column}: shapes[{i}].sphere.radius: expected a number greater than 0, found {radius}")
    };
    for (verb, before) in [(&["plan"][..], ""), (&["render", "-q"], "s: "), (&["accuracy", "-q", "-o", "acc"], "s: ")] {
        let ran = place.run(&[verb, &["s.yaml"]].concat());
        let lines = [message(0, 27), message(1, 49)].map(|message| format!("error: {before}{message}\n"));
        assert_eq!((ran.code, ran.err), (2, lines.concat()), "{verb:?}");
    }
}

#[test]
fn the_report_tells_what_was_made_and_what_it_cost() {
    let place = batch();
    place.run(&["render", "batch.yaml", "--threads", "2", "--report", "figures/r.json"]);
    let read = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(place.path(name)).unwrap()).unwrap() };
    let report = read("out/report.json");
    assert_eq!(report, read("figures/r.json"));
    assert_eq!(report["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(report["source"], "batch.yaml");
    assert_eq!(report["threads"], 2);
    assert!(report["seconds"].as_f64().unwrap() > 0.0);
    let [good, bad, other] = report["scenes"].as_array().unwrap().as_slice() else { panic!("{report:#}") };
    assert_eq!(good["name"], "good");
    assert_eq!(good["status"], "done");
    assert_eq!(good["integrator"], "path");
    assert_eq!(good["resolution"], serde_json::json!([4, 4]));
    assert_eq!((good["samples"].as_u64(), good["seed"].as_u64(), other["seed"].as_u64()), (Some(4), Some(0), Some(3)));
    assert_eq!(good["scene_hash"].as_str().unwrap().len(), 32);
    assert_ne!(good["scene_hash"], other["scene_hash"]);
    for clock in ["loading", "rendering", "writing"] {
        assert!(good["seconds"][clock].as_f64().unwrap() > 0.0, "{clock}");
    }
    assert!(good["msamples_per_second"].as_f64().unwrap() > 0.0);
    for figure in ["rel_rmse", "low", "high"] {
        assert!(good["error"][figure].as_f64().unwrap() >= 0.0, "{figure}");
    }
    assert_eq!(good["convergence"][0]["samples"], 4);
    for cause in ["nan", "infinite", "negative", "overflow"] {
        assert_eq!(good["invalid"][cause], 0, "{cause}");
    }
    let effects = good["effects"].as_array().unwrap();
    let effect = |name: &str| effects.iter().find(|e| e["name"] == name).unwrap();
    assert_eq!(
        (effect("environment")["on"].as_bool(), effect("dispersion")["on"].as_bool()),
        (Some(true), Some(false))
    );
    assert!(effects.iter().all(|e| !e["reason"].as_str().unwrap().is_empty()));
    assert_eq!(good["files"], serde_json::json!(["out/good.exr", "out/good.png"]));
    assert_eq!(bad["status"]["failed"]["exit_code"], 2);
    assert!(bad["status"]["failed"]["message"].as_str().unwrap().contains("scenes/bad.yaml:3:28"));
}

/// Scenes of a batch that name the same files get the pictures that each gets by itself, also where one file changes its
/// use, and the second turns the mesh and the sky.
#[test]
fn what_scenes_of_a_batch_share_is_the_same_for_each() {
    let png = |r: u8| {
        let image = image::RgbImage::from_fn(8, 4, |x, y| image::Rgb([r, 20 * x as u8, 60 * y as u8]));
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let scene = |turn: u32, raw: bool| {
        format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 8, height: 8}}\n\
             render: {{samples: 4}}\ntextures: {{map: {{image: {{file: map.png, raw: {raw}}}}}}}\n\
             shapes:\n- mesh: {{file: t.obj, material: {{diffuse: {{reflectance: {{texture: map}}}}}}, \
             transform: [{{rotate: {{axis: [0, 0, 1], deg: {turn}}}}}]}}\n\
             - sphere: {{radius: 0.5, material: {{conductor: {{metal: gold, roughness: {{texture: map}}}}}}}}\n\
             lights: [environment: {{file: map.png, rotate_deg: {turn}}}]\n"
        )
    };
    let batch = "scenes: [{file: a.yaml}, {file: b.yaml}, {file: a.yaml, name: c}]\n";
    let place = Place::with(&[
        ("a.yaml", &scene(0, false)),
        ("b.yaml", &scene(40, true)),
        ("batch.yaml", batch),
        ("t.obj", "v -2 -2 -1\nv 2 -2 -1\nv 0 2 -1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"),
    ]);
    std::fs::write(place.path("map.png"), png(200)).unwrap();
    let hashes = |file: &str| -> Vec<String> {
        let ran = place.run(&["render", file, "-q", "-o", "out", "--report", "r.json"]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        let report: Value = serde_json::from_slice(&std::fs::read(place.path("r.json")).unwrap()).unwrap();
        report["scenes"].as_array().unwrap().iter().map(|s| s["pixel_hash"].as_str().unwrap().to_owned()).collect()
    };
    let (a, b) = (hashes("a.yaml").remove(0), hashes("b.yaml").remove(0));
    assert_ne!(a, b);
    assert_eq!(hashes("batch.yaml"), [a.clone(), b, a]);
}

/// Each batch, what is asked of it, and the file that two would write.
/// The report and the contact sheet of all scenes lay in the directory of the first.
#[test]
fn what_is_said_of_a_batch_lies_above_the_directories_of_its_scenes() {
    let batch = "scenes: [{file: s.yaml, name: a}, {file: s.yaml, name: b}]\n";
    let place = Place::with(&[("batch.yaml", batch), ("s.yaml", &format!("{SMALL}{BALL}"))]);
    let all = ["contact-sheet.html", "contact-sheet.png", "report.json"];
    for (pattern, above) in [("p/{scene}/x.exr", "p"), ("q/{scene}", "q"), ("r/s/{scene}.exr", "r/s")] {
        let ran = place.run(&["render", "batch.yaml", "-q", "-o", pattern]);
        assert_eq!((ran.code, ran.err.as_str()), (0, ""));
        let names = place.names(above);
        assert!(all.iter().all(|name| names.iter().any(|n| n == name)), "{pattern}: {names:?}");
        assert!(!place.path(above).join("a/report.json").exists());
    }
    let page = std::fs::read_to_string(place.path("p/contact-sheet.html")).unwrap();
    assert!(page.contains("a/x.png") && page.contains("b/x.png"));
    let message = "error: --report p/contact-sheet.html: ";
    let ran = place.run(&["render", "batch.yaml", "-q", "-o", "p/{scene}/x.exr", "--report", "p/contact-sheet.html"]);
    assert!(ran.code == 2 && ran.err.starts_with(message), "{} {}", ran.code, ran.err);
}

#[test]
fn two_pictures_of_one_file_are_refused_before_the_work() {
    let entry = |name: &str, set: &str| format!("- {{file: s.yaml, name: {name}, set: {{{set}}}}}\n");
    let bands = "output.spectral: {bands: 3}";
    let cases: [([String; 2], &[&str], &str); 7] = [
        (
            [entry("x.0001", ""), entry("x", "render.frames: 1-2")],
            &["-o", "out"],
            "out/x.0001.exr would be that of scene \"x.0001\" and of frame 1 of scene \"x\"",
        ),
        (
            [entry("x.spectral", ""), entry("x", bands)],
            &["-o", "out"],
            "out/x.spectral.exr would be that of scene \"x.spectral\" and of scene \"x\"",
        ),
        (
            [entry("x.spectral", "output.dir: out"), entry("x", "output: {dir: ./out, spectral: {bands: 3}}")],
            &[],
            "out/x.spectral.exr would be that of scene \"x.spectral\" and of scene \"x\"",
        ),
        (
            [entry("x.snapshot", ""), entry("x", "")],
            &["-o", "out"],
            "out/x.snapshot.png would be that of scene \"x.snapshot\" and of scene \"x\"",
        ),
        (
            [entry("y", ""), entry("contact-sheet", "")],
            &["-o", "out"],
            "out/contact-sheet.png is the contact sheet of the batch",
        ),
        // Where `y` cannot be rendered the sheet lies beside the other.
        (
            [entry("y", "output.dir: q"), entry("contact-sheet", "output.dir: out")],
            &[],
            "out/contact-sheet.png may be the contact sheet of the batch",
        ),
        (
            [entry("a", ""), entry("a1", "")],
            &["-o", "out/{scene}{frame}.exr", "--frames", "1,11"],
            "out/a11.exr would be that of frame 11 of scene \"a\" and of frame 1 of scene \"a1\"",
        ),
    ];
    for ([one, two], output, expected) in cases {
        let place = Place::with(&[("b.yaml", &format!("scenes:\n{one}{two}")), ("s.yaml", &format!("{SMALL}{BALL}"))]);
        let ran = place.run(&[["render", "b.yaml", "-q"].as_slice(), output].concat());
        assert_eq!(ran.code, 2, "{expected}");
        assert!(ran.err.starts_with("error: b.yaml:3:10: scene ") && ran.err.contains(expected), "{}", ran.err);
        assert!(place.names("out").is_empty());
    }
    // Scenes whose names end in numbers, and one that is not on the sheet, are none of these.
    let (one, two) = (entry("s1", bands), entry("s11", bands));
    let place = Place::with(&[("b.yaml", &format!("scenes:\n{one}{two}")), ("s.yaml", &format!("{SMALL}{BALL}"))]);
    assert_eq!(place.run(&["render", "b.yaml", "-q", "-o", "out", "--frames", "1,11"]).code, 0);
    assert_eq!(place.names("out").iter().filter(|name| name.ends_with("exr")).count(), 8);
}
