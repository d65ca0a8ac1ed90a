//! The command as a person meets it: what it says about bad input, how it ends, what it leaves behind.

mod common;

use common::place::Place;
use serde_json::Value;
use std::process::Command;

/// The smallest picture; two lines.
const SMALL: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n\
                     image: {width: 4, height: 4}\n";

/// A lit ball, on lines 3 to 5.
const BALL: &str = "render: {samples: 4}\nlights: [{constant: {radiance: 1}}]\nshapes: [{sphere: {radius: 1}}]\n";

/// Renders the scene of [`SMALL`] and, from line 3, `text`, as `s.yaml`: the error lines and the exit code.
fn faults(text: &str) -> (Vec<String>, i32) {
    let place =
        Place::with(&[("s.yaml", &format!("{SMALL}{text}\n")), ("no_picture.png", "words"), ("odd.ply", "ply\nno")]);
    let ran = place.run(&["render", "s.yaml", "-o", "out"]);
    assert_eq!(ran.out, "", "nothing was made");
    assert!(place.names("out").iter().all(|n| n == "report.json"), "{:?}", place.names("out"));
    let errors =
        ran.err.lines().filter_map(|l| l.strip_prefix("error: ")).map(|l| l.trim_start_matches("s: ").to_owned());
    (errors.collect(), ran.code)
}

/// Each kind of bad input: the text from line 3, the whole message, the exit code.
#[test]
fn each_fault_is_told_with_its_place_its_field_and_what_was_expected() {
    let cases = [
        (
            "materials: {m: {diffuse: {reflectence: 0.3}}}",
            "s.yaml:3:27: materials.m.diffuse.reflectence: expected one of reflectance, highlight, two_sided, \
             found \"reflectence\"; did you mean \"reflectance\"?",
            2,
        ),
        (
            "shapes: [{sphere: {radius: big}}]",
            "s.yaml:3:28: shapes[0].sphere.radius: expected a number, found the text \"big\"",
            2,
        ),
        (
            "shapes: [{sphere: {radius: .nan}}]",
            "s.yaml:3:28: shapes[0].sphere.radius: expected a finite number, found NaN",
            2,
        ),
        (
            "shapes: [{sphere: {radius: .inf}}]",
            "s.yaml:3:28: shapes[0].sphere.radius: expected a finite number, found inf",
            2,
        ),
        (
            "shapes: [{sphere: {radius: -1}}]",
            "s.yaml:3:28: shapes[0].sphere.radius: expected a number greater than 0, found -1",
            2,
        ),
        (
            "materials: {flint: {mirror: {}}}\nshapes: [{sphere: {radius: 1, material: flnt}}]",
            "s.yaml:4:41: shapes[0].sphere.material: unknown material \"flnt\"; did you mean \"flint\"?",
            2,
        ),
        (
            "materials: {m: {diffuse: {reflectance: {texture: erth}}}}\ntextures: {earth: {checkerboard: {a: 0, b: 1}}}",
            "s.yaml:3:50: materials.m.diffuse.reflectance.texture: unknown texture \"erth\"; did you mean \"earth\"?",
            2,
        ),
        (
            "materials: {m: {conductor: {metal: golf}}}",
            "s.yaml:3:36: materials.m.conductor.metal: unknown metal \"golf\"; did you mean \"gold\"?",
            2,
        ),
        (
            "shapes: [{cube: {size: 1, transform: [{matrix: [[1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]}}]",
            "s.yaml:3:48: shapes[0].cube.transform[0].matrix: expected a matrix that can be inverted, \
             found one with determinant 0",
            2,
        ),
        (
            "fog: {colour: 1, density: 1}\nfog: {colour: 2, density: 1}",
            "s.yaml:4:1: fog: expected each key once, found \"fog\" again; it is first at line 3, column 1",
            2,
        ),
        (
            "lights: [{directional: {direction: [0, 0, 0], irradiance: 1}}]",
            "s.yaml:3:36: lights[0].directional.direction: expected a vector with a direction, found [0, 0, 0]",
            2,
        ),
        (
            "materials: {m: {dielectric: {ior: {sellmeier: {b: [1, 2], c: [1, 2, 3]}}}}}",
            "s.yaml:3:51: materials.m.dielectric.ior.sellmeier.b: expected 3 values, found 2",
            2,
        ),
        (
            "shapes: [{sphere: {radius: 1}",
            "s.yaml:3:10: shapes[0]: expected YAML, found a fault of syntax: unclosed bracket '{'",
            2,
        ),
        (
            "textures: {t: {image: {file: none.png}}}",
            "none.png: expected a file, found none; it is named at s.yaml:3:30: textures.t.image.file",
            3,
        ),
        (
            "lights: [{environment: {file: none.hdr}}]",
            "none.hdr: expected a file, found none; it is named at s.yaml:3:31: lights[0].environment.file",
            3,
        ),
        (
            "shapes: [{mesh: {file: none.obj}}]",
            "none.obj: cannot read: No such file or directory (os error 2); it is named at \
             s.yaml:3:24: shapes[0].mesh.file",
            3,
        ),
    ];
    for (text, message, code) in cases {
        let (errors, found) = faults(text);
        assert_eq!((errors.iter().map(String::as_str).collect::<Vec<_>>(), found), (vec![message], code), "{text}");
    }
}

/// Messages that end in another package's words, or list near misses.
#[test]
fn faults_with_words_of_others_begin_with_ours() {
    let cases = [
        (
            "materials: {m: {dielectric: {ior: {glass: N-BK8}}}}",
            "s.yaml:3:35: materials.m.dielectric.ior: unknown glass \"N-BK8\"; did you mean \"N-BK7\"",
            2,
        ),
        (
            "textures: {t: {image: {file: no_picture.png}}}",
            "no_picture.png: expected a PNG, JPEG, HDR or EXR picture: ",
            3,
        ),
        (
            "shapes: [{mesh: {file: no_picture.png}}]",
            "no_picture.png: expected a mesh (.obj, .ply or .serialized), found extension \"png\"",
            3,
        ),
        ("shapes: [{mesh: {file: odd.ply}}]", "odd.ply: ", 3),
        (
            "lights: [{environment: {file: no_picture.png}}]",
            "no_picture.png: expected a PNG, JPEG, HDR or EXR picture: ",
            3,
        ),
    ];
    for (text, beginning, code) in cases {
        let (errors, found) = faults(text);
        assert!(errors.len() == 1 && errors[0].starts_with(beginning) && found == code, "{text}: {errors:?}, {found}");
    }
}

#[test]
fn all_faults_of_a_scene_come_at_once() {
    let (errors, code) = faults(
        "shapes: [{sphere: {radius: -1}}, {sphere: {radius: 1, material: clay}}]\n\
         lights: [{point: {position: [0, 0, 0], intensity: -3}}]",
    );
    assert_eq!(errors.len(), 3, "{errors:?}");
    assert_eq!(code, 2);
}

/// The camera and the picture themselves: these are lines 1 and 2.
#[test]
fn a_camera_that_sees_nothing_is_refused() {
    let cases = [
        (
            "camera: {origin: [0, 5, 0], target: [0, 0, 0], fov_deg: 40}",
            "s.yaml:1:9: camera.up: expected a direction across the line of sight, found [0.0, 1.0, 0.0], which is parallel to it",
        ),
        ("camera: {origin: [0, 5, 0], target: [0, 5, 0], fov_deg: 40}", "s.yaml:1:37: camera.target: "),
        ("camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 180}", "s.yaml:1:57: camera.fov_deg: "),
        (
            "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 0, height: 10}",
            "s.yaml:2:16: image.width: expected a whole number from 1 to 65536, found 0",
        ),
        (
            "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 8, height: 8, crop: {x: 4, y: 0, width: 5, height: 8}}",
            "s.yaml:2:",
        ),
        ("image: {width: 8, height: 8}", "s.yaml:1:1: expected the field \"camera\", found none"),
        ("", "s.yaml:1:1: "),
    ];
    for (text, beginning) in cases {
        let place = Place::with(&[("s.yaml", text)]);
        let ran = place.run(&["render", "s.yaml"]);
        let said = ran.err.lines().filter_map(|l| l.strip_prefix("error: ")).next().unwrap().trim_start_matches("s: ");
        assert!(said.starts_with(beginning) && ran.code == 2, "{text}: {said}, {}", ran.code);
        assert!(place.names("out").is_empty());
    }
}

/// Ten aliases of ten aliases, nine deep: a billion numbers if written out. Refused within a moment.
#[test]
fn a_yaml_bomb_does_not_go_off() {
    let mut text = String::from("a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n");
    for pair in ["ab", "bc", "cd", "de", "ef", "fg", "gh", "hi", "ij"] {
        let (from, to) = pair.split_at(1);
        text += &format!("{to}: &{to} [{}]\n", vec![format!("*{from}"); 10].join(", "));
    }
    let place = Place::with(&[("bomb.yaml", &text)]);
    let start = std::time::Instant::now();
    let ran = place.run(&["render", "bomb.yaml"]);
    assert_eq!(ran.code, 2);
    assert!(ran.err.contains("expected at most 4000000 values in all, found more"), "{}", ran.err);
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn a_missing_scene_file_and_a_missing_argument_are_told_apart() {
    let place = Place::with(&[]);
    let ran = place.run(&["render", "none.yaml"]);
    assert_eq!(ran.err, "error: none.yaml: cannot be read: No such file or directory (os error 2)\n");
    assert_eq!(ran.code, 3);
    assert_eq!(place.run(&["render"]).code, 2);
    let ran = place.run(&["rendr", "none.yaml"]);
    assert!(ran.err.contains("a similar subcommand exists: 'render'") && ran.code == 2, "{}", ran.err);
    assert_eq!(place.run(&["render", "s.yaml", "--spp", "0"]).code, 2);
    assert_eq!(place.run(&["render", "s.yaml", "--set", "fog"]).code, 2);
}

fn batch() -> Place {
    Place::with(&[
        (
            "batch.yaml",
            "output: {dir: out}\nscenes:\n- file: scenes/good.yaml\n- file: scenes/bad.yaml\n- {file: scenes/good.yaml, name: other, set: {render.seed: 3}}\n",
        ),
        ("scenes/good.yaml", &format!("{SMALL}{BALL}")),
        ("scenes/bad.yaml", &format!("{SMALL}shapes: [{{sphere: {{radius: -1}}}}]\n")),
    ])
}

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
    assert!(ran.out.contains("4 pictures in out/") && ran.out.lines().any(|l| l.starts_with("other ")), "{}", ran.out);
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

#[test]
fn quiet_prints_nothing_but_errors() {
    let place = batch();
    let ran = place.run(&["render", "scenes/good.yaml", "-q", "-o", "out"]);
    assert_eq!((ran.out.as_str(), ran.err.as_str(), ran.code), ("", "", 0));
    let ran = place.run(&["render", "batch.yaml", "-q"]);
    assert_eq!(ran.out, "");
    assert!(ran.err.lines().all(|l| l.starts_with("error: ")) && ran.code == 2, "{}", ran.err);
}

#[test]
fn progress_is_lines_json_or_nothing() {
    let place = batch();
    let run = |style: &str| place.run(&["render", "scenes/good.yaml", "-o", "out", "--progress", style]);
    let plain = run("plain");
    assert!(plain.err.starts_with("[1/1] good\n  done in "), "{}", plain.err);
    // No terminal, no bars: automatic is plain.
    assert!(run("auto").err.starts_with("[1/1] good\n"), "no escape codes in a log");
    let events: Vec<Value> = run("json").out.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(events[0], serde_json::json!({"event": "scene", "scene": "good", "index": 0, "count": 1}));
    assert_eq!(events.last().unwrap()["event"], "done");
    assert_eq!(run("none").err, "");
}

#[test]
fn help_of_every_verb_shows_an_example() {
    let place = Place::with(&[]);
    let general = place.run(&["--help"]);
    assert_eq!(general.code, 0);
    let verbs = general.out.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    let verbs: Vec<String> = verbs.map(|l| l.split_whitespace().next().unwrap().to_owned()).collect();
    assert!(["render", "plan", "compare"].iter().all(|v| verbs.iter().any(|w| w == v)), "{verbs:?}");
    for verb in verbs.iter().filter(|v| *v != "help") {
        for flag in ["--help", "-h"] {
            let ran = place.run(&[verb, flag]);
            let example = format!("\n  abbe {verb} ");
            assert!(
                ran.out.contains("Example") && ran.out.contains(&example) && ran.code == 0,
                "{verb} {flag}: {}",
                ran.out
            );
        }
    }
    assert_eq!(place.run(&["--version"]).out, concat!("abbe ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn plan_says_what_is_simulated_and_why_and_renders_nothing() {
    let prism = format!("{SMALL}{BALL}")
        .replace("radius: 1", "radius: 1, name: prism, material: {dielectric: {ior: {glass: N-SF11}}}");
    let place = Place::with(&[("prism.yaml", &prism)]);
    let text = place.run(&["plan", "prism.yaml"]);
    assert_eq!((text.err.as_str(), text.code), ("", 0));
    assert!(text.out.starts_with("prism\n"), "{}", text.out);
    let line = |name: &str| text.out.lines().find(|l| l.contains(name)).unwrap().trim().to_owned();
    assert!(line("dispersion").starts_with("on ") && line("dispersion").contains("prism"), "the culprit is named");
    assert!(line("depth fog").starts_with("off ") && line("depth fog").ends_with("the scene has none"));
    let json = place.run(&["plan", "prism.yaml", "--format", "json", "--spp", "9"]);
    let plan: Value = serde_json::from_str(&json.out).unwrap();
    assert_eq!((&plan[0]["scene"], &plan[0]["samples"]), (&Value::from("prism"), &Value::from(9)));
    let effects = plan[0]["effects"].as_array().unwrap();
    assert!(effects.iter().any(|e| e["name"] == "dispersion" && e["on"] == true));
    assert!(plan[0]["wavelengths"].as_str().unwrap().contains("colour noise"));
    assert_eq!(place.names("."), ["prism.yaml"]);
}

#[test]
fn settings_of_the_command_line_reach_the_scene_and_are_checked() {
    let place = batch();
    let seed = |arguments: &[&str]| -> u64 {
        let mut all = vec!["render", "scenes/good.yaml", "-q", "-o", "set"];
        all.extend(arguments);
        assert_eq!(place.run(&all).code, 0);
        let report: Value = serde_json::from_slice(&std::fs::read(place.path("set/report.json")).unwrap()).unwrap();
        report["scenes"][0]["seed"].as_u64().unwrap()
    };
    assert_eq!(seed(&["--set", "render.seed=7"]), 7);
    assert_eq!(seed(&["--set", "render.seed=7", "--seed", "9"]), 9);
    let ran = place.run(&["render", "scenes/good.yaml", "--set", "camera.fov_dg=3"]);
    assert!(
        ran.err.contains("--set camera.fov_dg=3: camera.fov_dg: expected one of ")
            && ran.err.contains("did you mean \"fov_deg\"?"),
        "{}",
        ran.err
    );
    assert_eq!(ran.code, 2);
}

#[test]
fn scenes_are_chosen_by_name() {
    let place = batch();
    let ran = place.run(&["render", "batch.yaml", "--scene", "othr"]);
    assert_eq!(ran.err, "error: batch.yaml: no scene is named \"othr\"; did you mean \"other\"?\n");
    assert_eq!(ran.code, 2);
    assert_eq!(place.run(&["render", "batch.yaml", "--scene", "other"]).code, 0);
    assert_eq!(place.names("out"), ["other.exr", "other.png", "report.other.json"]);
    let ran = place.run(&["render", "batch.yaml", "-o", "one.exr"]);
    assert_eq!(
        ran.err,
        "error: -o one.exr: expected a directory for 3 scenes, or a pattern with {scene}, found the name of one file\n"
    );
    assert_eq!(place.run(&["render", "batch.yaml", "--scene", "other", "-o", "sub/one.exr", "-q"]).code, 0);
    let ran = place.run(&["render", "scenes/good.yaml", "-o", "one.PNG"]);
    let expected =
        "error: -o one.PNG: expected a directory or a file name that ends in .exr, beside which the PNG is written\n";
    assert_eq!((ran.code, ran.err.as_str()), (2, expected));
    assert_eq!(place.names("sub"), ["one.exr", "one.png", "report.other.json"]);
}

#[test]
fn compare_ends_with_its_verdict() {
    let place = batch();
    for (name, seed, extra) in [
        ("a", "1", "shapes[0].sphere.radius=1"),
        ("b", "2", "shapes[0].sphere.radius=1"),
        ("c", "1", "shapes[0].sphere.material={diffuse: {reflectance: 0.9}}"),
    ] {
        let file = format!("{name}.exr");
        let ran = place.run(&[
            "render",
            "scenes/good.yaml",
            "-q",
            "-o",
            &file,
            "--seed",
            seed,
            "--spp",
            "64",
            "--set",
            extra,
            "--set",
            "output.exr.stderr=true",
        ]);
        assert_eq!(ran.code, 0, "{}", ran.err);
    }
    let size = ["render", "scenes/good.yaml", "-q", "-o", "large.exr", "--set", "image.width=5"];
    assert_eq!(place.run(&size).code, 0);
    let compare = |a: &str, b: &str| place.run(&["compare", a, b, "--json", "figures.json"]);
    let figures = || -> Value { serde_json::from_slice(&std::fs::read(place.path("figures.json")).unwrap()).unwrap() };
    let same = compare("a.exr", "a.exr");
    assert!(same.code == 0 && same.out.contains("verdict: same: all compared values are identical"), "{}", same.out);
    assert_eq!(figures()["identical"], true);
    // Another seed: another noise, the same picture.
    let noise = compare("a.exr", "b.exr");
    assert_eq!(noise.code, 0, "{}", noise.out);
    assert_eq!(figures()["identical"], false);
    let different = compare("a.exr", "c.exr");
    assert!(different.code == 1 && different.out.contains("verdict: different"), "{}", different.out);
    let sizes = compare("a.exr", "large.exr");
    assert!(sizes.code == 2 && sizes.out.contains("verdict: cannot compare"), "{} {}", sizes.code, sizes.out);
    // No file, or no EXR: bad input, code 3.
    let missing = compare("a.exr", "none.exr");
    assert_eq!((missing.err.as_str(), missing.code), ("error: none.exr: there is no such file\n", 3));
    assert_eq!(compare("a.exr", "scenes/good.yaml").code, 3);
}

/// A place that cannot be written to is told at once: the scene would take minutes.
#[test]
fn an_unwritable_place_is_told_before_the_work() {
    let place = batch();
    std::fs::create_dir_all(place.path("taken/good.exr")).unwrap();
    std::fs::create_dir_all(place.path("taken_too/good.png")).unwrap();
    let slow = ["--spp", "1000000", "--set", "image.width=2000", "--set", "image.height=2000"];
    for (more, message) in [
        // Below a regular file: even root cannot.
        (
            ["-o", "batch.yaml/deep"],
            "error: good: batch.yaml/deep/good.exr: cannot write: batch.yaml/deep is not a directory",
        ),
        (["-o", "batch.yaml"], "error: good: batch.yaml/good.exr: cannot write: batch.yaml is not a directory"),
        (["-o", "taken"], "error: good: taken/good.exr: cannot write: it is a directory"),
        (["-o", "taken_too"], "error: good: taken_too/good.png: cannot write: it is a directory"),
        (["--report", "batch.yaml/r.json"], "error: batch.yaml/r.json: cannot write: batch.yaml is not a directory"),
    ] {
        let start = std::time::Instant::now();
        let mut all = vec!["render", "scenes/good.yaml", "-q"];
        all.extend(slow);
        all.extend(more);
        let ran = place.run(&all);
        assert_eq!((ran.err.lines().collect::<Vec<_>>(), ran.code), (vec![message], 1), "{more:?}");
        assert!(start.elapsed().as_secs() < 20, "{more:?}: {:?}", start.elapsed());
    }
    assert_eq!(place.names("taken"), ["good.exr", "report.json"]);
    assert_eq!(place.names("out"), Vec::<String>::new());
}

/// Permissions do not bind root, who is told so and let off.
#[test]
fn a_directory_without_permission_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let place = batch();
    std::fs::create_dir(place.path("locked")).unwrap();
    std::fs::set_permissions(place.path("locked"), std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(place.path("locked/probe"), "").is_ok() {
        eprintln!("skipped: this user may write anywhere");
        return;
    }
    let ran = place.run(&["render", "scenes/good.yaml", "-q", "-o", "locked"]);
    assert!(ran.err.contains("no permission to write in locked") && ran.code == 1, "{}", ran.err);
}

/// A disk of 16 KiB, mounted where only this command sees it; skipped where that is not allowed.
#[test]
fn a_full_disk_is_named_and_leaves_no_half_file() {
    let place = batch();
    std::fs::create_dir(place.path("disk")).unwrap();
    let script = "mount -t tmpfs -o size=16k tmpfs disk || exit 99\n\
                  \"$0\" render scenes/good.yaml -q -o disk --set image.width=100 --set image.height=100\n\
                  code=$?\nls -A disk >&2\nexit $code";
    let unshare = Command::new("unshare")
        .args(["-m", "sh", "-c", script, env!("CARGO_BIN_EXE_abbe")])
        .current_dir(place.directory.path())
        .output();
    let Ok(output) = unshare else {
        eprintln!("skipped: there is no unshare");
        return;
    };
    let said = String::from_utf8(output.stderr).unwrap();
    if output.status.code() == Some(99) || said.contains("unshare") {
        eprintln!("skipped: no disk may be mounted here: {said}");
        return;
    }
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.starts_with("error: good: disk/good.exr: cannot write: the disk that holds disk is full\n"), "{said}");
    assert!(!said.lines().any(|l| l.starts_with("good") || l.starts_with('.')), "half a file is left: {said}");
}

/// A picture that stood there stays as it was when a later render fails.
#[test]
fn a_failed_render_leaves_the_old_picture_alone() {
    let place = batch();
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "out"]).code, 0);
    let before = std::fs::read(place.path("out/good.exr")).unwrap();
    let ran = place.run(&["render", "scenes/good.yaml", "-q", "-o", "out", "--set", "shapes[0].sphere.radius=-1"]);
    assert_eq!(ran.code, 2);
    assert_eq!(std::fs::read(place.path("out/good.exr")).unwrap(), before);
    assert_eq!(place.names("out"), ["good.exr", "good.png", "report.json"]);
}

/// Killed in the middle of its work, the command leaves no file under the final name.
#[test]
fn a_killed_render_leaves_nothing_behind() {
    let place = batch();
    let mut child = place
        .command(&[
            "render",
            "scenes/good.yaml",
            "-q",
            "-o",
            "out",
            "--spp",
            "1000000",
            "--set",
            "image.width=500",
            "--set",
            "image.height=500",
        ])
        .spawn()
        .unwrap();
    while !place.path("out").is_dir() {
        std::thread::sleep(std::time::Duration::from_millis(5));
        assert!(child.try_wait().unwrap().is_none(), "it should be at work");
    }
    std::thread::sleep(std::time::Duration::from_millis(50));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(place.names("out").iter().all(|n| n.starts_with('.')), "{:?}", place.names("out"));
}

/// A ball of radius 1, 10⁵ away, in the middle of 4 × 4 pixels. In single precision b² and 4ac of its quadratic are
/// 4·10¹⁰ with steps of 4096, and they differ by at most 4: rounding decides whether it is found. Asked for or not, the
/// picture is the same.
#[test]
fn what_robust_arithmetic_was_needed_for_is_counted() {
    let scene = "camera: {origin: [3.0e+4, 4.0e+4, 8.6602540378e+4], target: [0, 0, 0], fov_deg: 0.0015}\n\
                 image: {width: 4, height: 4}\nrender: {samples: 64}\nlights: [{constant: {radiance: 1}}]\n\
                 shapes: [{sphere: {radius: 1}}]\n";
    let place = Place::with(&[("s.yaml", scene)]);
    let report = |arguments: &[&str]| -> Value {
        let ran = place.run(&[&["render", "s.yaml", "-o", "s.exr", "--report", "r.json"], arguments].concat());
        assert_eq!(ran.code, 0, "{}", ran.err);
        assert_eq!(ran.out.contains("textbook f32 misses"), arguments.contains(&"--check-numerics"), "{}", ran.out);
        let report: Value = serde_json::from_slice(&std::fs::read(place.path("r.json")).unwrap()).unwrap();
        report["scenes"][0].clone()
    };
    let off = report(&[]);
    let names = || {
        let bytes = std::fs::read(place.path("s.exr")).unwrap();
        let names = ["numerics.surfaces", "numerics.robust", "numerics.selfHits", "numerics.nan"];
        names.map(|name| bytes.windows(name.len()).any(|w| w == name.as_bytes()))
    };
    assert_eq!((names(), &off["numerics"]), ([false; 4], &Value::Null));
    let on = report(&["--check-numerics"]);
    assert_eq!((names(), &on["pixel_hash"]), ([true; 4], &off["pixel_hash"]));
    let count = |name: &str| on["numerics"][name].as_u64().unwrap();
    assert!(count("surfaces") > 400 && (10..400).contains(&count("robust")), "{on}");
    assert!(count("rays") > 400 && count("self_hits") <= count("rays"), "{on}");

    let taken =
        place.run(&["render", "s.yaml", "--check-numerics", "--set", "layers=[{name: numerics, surface: depth}]"]);
    assert!(taken.code == 2 && taken.err.contains("give yours another"), "{}", taken.err);
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

/// Light beyond what f32 holds: samples are dropped, counted by cause, and the exit code says so. The
/// picture is written all the same, and every pixel of it is finite.
#[test]
fn invalid_samples_are_counted_and_end_with_code_4() {
    let place = batch();
    let hot = |radiance: &str| {
        let set = format!("lights[0].constant.radiance={radiance}");
        let ran = place.run(&["render", "scenes/good.yaml", "-q", "-o", "hot", "--set", &set]);
        (ran, abbe::film::exr::read_exr(&place.path("hot/good.exr")).unwrap())
    };
    let (ran, file) = hot("1e39");
    assert_eq!(ran.code, 4);
    assert!(ran.err.contains("64 of 64 samples were invalid") && ran.err.contains("64 infinite"), "{}", ran.err);
    assert!(file.parts[0].channels.iter().all(|(_, c)| c.iter().all(|x| x.is_finite())));
    assert_eq!(file.parts[0].text("abbe/invalidSamples"), Some("64"));
    // What f32 holds the film holds.
    let (ran, file) = hot("1e30");
    assert_eq!((ran.code, file.parts[0].text("abbe/invalidSamples")), (0, Some("0")), "{}", ran.err);
    let green = file.parts[0].channel("G").unwrap();
    assert!(green.iter().all(|x| (1e28..1e31).contains(x)), "{green:?}");
}

/// `abbe plan … | true`: the reader is gone before the first word.
#[test]
fn a_reader_that_goes_away_is_no_fault() {
    let place = batch();
    let picture = ["render", "scenes/good.yaml", "-q", "-o", "out"];
    assert_eq!(place.run(&picture).code, 0);
    for arguments in [
        &["plan", "scenes/good.yaml"][..],
        &["plan", "scenes/good.yaml", "--format", "json"],
        &["compare", "out/good.exr", "out/good.exr"],
        &["render", "scenes/good.yaml", "-o", "out"],
        &["render", "scenes/good.yaml", "-o", "out", "--progress", "json"],
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        let (reader_too, writer_too) = std::io::pipe().unwrap();
        drop((reader, reader_too));
        let mut child = place.command(arguments).stdout(writer).stderr(writer_too).spawn().unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{arguments:?}");
    }
}

/// Paths in a scene start from its file, outputs from where the command runs.
#[test]
fn a_scene_is_the_same_from_any_directory() {
    let place = Place::with(&[
        ("deep/s.yaml", &format!("{SMALL}{BALL}textures: {{t: {{image: {{file: maps/t.png}}}}}}\n")),
        ("elsewhere/x", ""),
    ]);
    let mut png = std::io::Cursor::new(Vec::new());
    image::GrayImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    std::fs::create_dir_all(place.path("deep/maps")).unwrap();
    std::fs::write(place.path("deep/maps/t.png"), png.into_inner()).unwrap();
    let hash = |directory: &str, file: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_abbe"))
            .current_dir(place.path(directory))
            .args(["plan", file, "--format", "json"])
            .output()
            .unwrap();
        let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
        plan[0]["scene_hash"].as_str().unwrap().to_owned()
    };
    let here = hash("deep", "s.yaml");
    assert_eq!(here, hash(".", "deep/s.yaml"));
    assert_eq!(here, hash("elsewhere", "../deep/s.yaml"));
    let absolute = place.path("deep/s.yaml");
    assert_eq!(here, hash("elsewhere", absolute.to_str().unwrap()));
}
