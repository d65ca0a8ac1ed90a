//! Options of `render`, and from where it runs.

use super::{BALL, SMALL, batch};
use crate::common::place::{Place, Ran};
use serde_json::Value;
use std::process::Command;

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
    // Open Job Description hears of what fails before the first picture, too.
    let ran = place.run(&["render", "scenes/none.yaml", "--progress", "openjd"]);
    assert!(ran.out.starts_with("openjd_fail: ") && ran.out.contains("none.yaml"), "{}", ran.out);
    assert_eq!((ran.out.lines().count(), ran.code), (1, 3));
}

#[test]
fn settings_of_the_command_line_reach_the_scene_and_are_checked() {
    let place = batch();
    let seed = |arguments: &[&str]| -> u64 {
        let mut all = vec!["render", "scenes/good.yaml", "-q", "-o", "set"];
        all.extend(arguments);
        let ran = place.run(&all);
        assert_eq!(ran.code, 0);
        // Which of two wins is told.
        let told = "note: --set render.seed=7 is passed over, for --seed says 9\n";
        assert_eq!(ran.err, if arguments.len() > 2 { told } else { "" });
        let report: Value = serde_json::from_slice(&std::fs::read(place.path("set/report.json")).unwrap()).unwrap();
        report["scenes"][0]["seed"].as_u64().unwrap()
    };
    assert_eq!(seed(&["--set", "render.seed=7"]), 7);
    assert_eq!(seed(&["--set", "render.seed=7", "--seed", "9"]), 9);
    let ran = place.run(&["plan", "scenes/good.yaml", "--set", "render.stop.error=0.5", "--error", "20%"]);
    assert_eq!(ran.err, "note: --set render.stop.error=0.5 is passed over, for --error says 0.2\n");
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
    // What many programs take for the standard output made a directory of that name.
    let ran = place.run(&["render", "scenes/good.yaml", "-o", "-"]);
    let expected = "error: -o -: expected a directory or a file name, for a picture is several files; found the standard \
                    output (a directory of this name is ./-)\n";
    assert_eq!((ran.code, ran.err.as_str(), place.path("-").exists()), (2, expected, false));
    let ran = place.run(&["export", "scenes/good.yaml", "-o", "-"]);
    let expected = "error: -o -: expected the name of a file; without -o the scene is printed\n";
    assert_eq!((ran.code, ran.err.as_str(), place.path("-").exists()), (2, expected, false));
    // A name that ends in a slash is a directory, whatever else it ends in.
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "new.exr/"]).code, 0);
    assert_eq!(place.names("new.exr"), ["good.exr", "good.png", "report.json"]);
    let ran = place.run(&["render", "scenes/good.yaml", "--time", "0s"]);
    assert!(ran.code == 2 && ran.err.contains("--time") && ran.err.contains("expected a time above 0"), "{}", ran.err);
}

#[test]
fn a_word_in_braces_that_stands_for_nothing_is_refused() {
    let place = batch();
    let expected = "expected {scene}, {frame}, {frame:04}, %04d or #### in a pattern, found {name}";
    let ran = place.run(&["render", "batch.yaml", "-o", "sub/{name}.{scene}.exr"]);
    assert_eq!((ran.code, ran.err), (2, format!("error: -o sub/{{name}}.{{scene}}.exr: {expected}\n")));
    let ran = place.run(&["render", "batch.yaml", "--scene", "other", "-q", "--set", "output.dir=sub/{name}"]);
    let at = "error: other: --set output.dir=sub/{name}: output.dir: ";
    assert_eq!((ran.code, ran.err), (2, format!("{at}{expected}\n")));
    assert!(!place.path("sub").exists());
    // Those for frames stay where there are none.
    assert_eq!(place.run(&["render", "batch.yaml", "--scene", "other", "-q", "-o", "sub/{scene}.####.exr"]).code, 0);
    assert!(place.path("sub/other.####.exr").exists());
}

/// Paths in a scene start from its file, outputs from where the command runs. One letter was taken for the directory wherever
/// it stood before a slash, and the place of a file that a batch sets for that of the command.
#[test]
fn a_scene_is_the_same_from_any_directory() {
    let textured = |file: &str| format!("{SMALL}{BALL}textures: {{t: {{image: {{file: {file}}}}}}}\n");
    let set = "set: {textures.t.image.file: s/maps/t.png}";
    let place = Place::with(&[
        ("s/s.yaml", &textured("maps/t.png")),
        ("moved/far/s.yaml", &textured("/old/t.png")),
        ("b.yaml", &format!("scenes: [{{file: s/s.yaml, {set}}}]\n")),
        ("elsewhere/x", ""),
    ]);
    std::fs::create_dir_all(place.path("s/maps")).unwrap();
    image::GrayImage::new(2, 2).save(place.path("s/maps/t.png")).unwrap();
    image::GrayImage::new(3, 2).save(place.path("s/maps/other.png")).unwrap();
    let hash = |directory: &str, arguments: &[&str]| {
        let all = [&["plan", "--format", "json"], arguments].concat();
        let output = place.command(&all).current_dir(place.path(directory)).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
        plan[0]["scene_hash"].as_str().unwrap().to_owned()
    };
    let here = hash("s", &["s.yaml"]);
    let absolute = place.path("s/s.yaml");
    for (directory, arguments) in [
        (".", &["s/s.yaml"][..]),
        ("elsewhere", &["../s/s.yaml"]),
        ("elsewhere", &[absolute.to_str().unwrap()]),
        (".", &["b.yaml"]),
        ("s", &["../b.yaml"]),
        ("s", &["s.yaml", "--set", "textures.t.image.file=maps/t.png"]),
        (".", &["s/s.yaml", "--set", "textures.t.image.file=t.png", "--set-from", "s/maps"]),
        (".", &["moved/far/s.yaml", "--path-map", "/old=s/maps"]),
        ("s", &["../moved/far/s.yaml", "--path-map", "/old=maps"]),
    ] {
        assert_eq!(hash(directory, arguments), here, "{arguments:?} in {directory}");
    }
    assert_ne!(hash("s", &["s.yaml", "--set", "textures.t.image.file=maps/other.png"]), here);
    image::GrayImage::new(2, 3).save(place.path("s/maps/t.png")).unwrap();
    assert_ne!(hash("s", &["s.yaml"]), here);
}

/// No verb needs more threads than a process may be bound to processors.
#[test]
fn more_threads_than_processors_can_be_are_refused() {
    let place = batch();
    let ran = place.run(&["render", "scenes/good.yaml", "--threads", "1025"]);
    assert!(ran.err.contains("'1025' for '--threads <N>': 1025 is not in 0..=1024"), "{}", ran.err);
    assert_eq!(ran.code, 2);
    let granted = |verb: &str| {
        Ran::of(place.command(&[verb, "scenes/good.yaml"]).env("OMP_NUM_THREADS", "5000").output().unwrap())
    };
    let ran = granted("render");
    assert_eq!(ran.err, "error: OMP_NUM_THREADS: expected at most 1024 threads, found 5000\n");
    assert_eq!(ran.code, 2);
    // What renders nothing asks for none.
    assert_eq!(granted("plan").code, 0);
    let render = |threads: &str| {
        let arguments = ["render", "scenes/good.yaml", "--spp", "4", "-o", "threads"];
        Ran::of(place.command(&arguments).env("OMP_NUM_THREADS", threads).output().unwrap())
    };
    let ran = render("many");
    assert_eq!(
        (ran.err.as_str(), ran.code),
        ("error: OMP_NUM_THREADS: expected a number of threads, found \"many\"\n", 2)
    );
    // OpenMP's list, of which the first is for what begins.
    for list in ["1,2", " 1 "] {
        assert!(render(list).out.contains(" on 1 threads,"), "{list}: {}", render(list).out);
    }
    for verb in ["render", "merge", "accuracy"] {
        let help = place.run(&[verb, "--help"]).out.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(help.contains("SLURM_CPUS_PER_TASK, CUE_THREADS or OMP_NUM_THREADS"), "{help}");
    }
}

/// Every task of the job would have begun by a word that is none.
#[test]
fn a_job_of_no_program_is_refused() {
    let place = batch();
    for format in ["slurm", "openjd"] {
        let ran = place.run(&["farm", "scenes/good.yaml", "--format", format, "--program", "", "-o", "job"]);
        let told = "error: a value is required for '--program <PATH>' but none was supplied";
        assert!(ran.code == 2 && ran.err.starts_with(told), "{}", ran.err);
        assert!(!place.path("job").exists());
    }
}

/// They are values of their options, with words on what was expected, and no other options.
#[test]
fn numbers_below_zero_are_told_as_values() {
    let place = batch();
    for (verb, option, value, words) in [
        ("render", "--seed", "-1", "'-1' for '--seed <N>': expected a whole number from 0 to 18446744073709551615"),
        ("render", "--spp", "-1", "'-1' for '--spp <N>': -1 is not in 1..="),
        ("render", "--threads", "-1", "'-1' for '--threads <N>': expected a whole number from 0 to 1024"),
        ("render", "--tile", "-1/4", "'-1/4' for '--tile <i/n>': expected i/n"),
        ("render", "--samples", "-1-4", "'-1-4' for '--samples <a-b|i/n>': expected a-b"),
        ("render", "--time", "-1s", "'-1s' for '--time <TIME>': expected a time"),
        ("farm", "--tiles", "-2", "'-2' for '--tiles <N>': -2 is not in 1..=1024"),
        ("accuracy", "--time", "0", "'0' for '--time <TIME>': expected a time above 0"),
        ("accuracy", "--truth", "0", "'0' for '--truth <L>': expected a number from 1e-37 to 1e38"),
        ("accuracy", "--truth", "1e39", "'1e39' for '--truth <L>': expected a number from 1e-37 to 1e38"),
        ("accuracy", "--truth", "1e-46", "'1e-46' for '--truth <L>': expected a number from 1e-37 to 1e38"),
    ] {
        let ran = place.run(&[verb, "scenes/good.yaml", option, value]);
        assert!(ran.code == 2 && ran.err.contains(words), "{option} {value}: {}", ran.err);
        assert!(!ran.err.contains("-- -"), "{option} {value}: {}", ran.err);
    }
}

/// The user may have one thread. That does not bind root, who becomes another user for this.
#[cfg(target_os = "linux")]
#[test]
fn threads_that_cannot_be_had_are_told_by_every_verb() {
    use std::os::unix::fs::MetadataExt;
    let place = batch();
    let is_root = std::fs::metadata(place.directory.path()).unwrap().uid() == 0;
    let nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "bash"];
    let bash = if is_root { &nobody[..] } else { &nobody[4..] };
    for verb in [
        "render scenes/good.yaml",
        "merge none.exr -o all.exr",
        "plan scenes/good.yaml",
        "farm scenes/good.yaml --format slurm",
        "accuracy scenes/good.yaml",
        "import scenes/good.yaml",
        "export scenes/good.yaml",
        "compare a.exr b.exr",
        "info a.exr",
    ] {
        let script = format!("ulimit -u 1; exec \"$0\" {verb}");
        let mut command = Command::new(bash[0]);
        command.args(&bash[1..]).args(["-c", &script, env!("CARGO_BIN_EXE_abbe")]).current_dir("/");
        let output = command.env("SLURM_CPUS_PER_TASK", "3").output();
        let Some(output) = output.ok().filter(|output| ![Some(126), Some(127)].contains(&output.status.code())) else {
            eprintln!("skipped: there is no other user who may run the command");
            return;
        };
        let ran = Ran::of(output);
        // What renders nothing is not granted three, and asks for as many as there are processors.
        let granted = ["render", "merge", "accuracy"].iter().any(|renders| verb.starts_with(renders));
        let start = if granted { "error: cannot start 3 threads: " } else { "error: cannot start " };
        assert!(ran.err.starts_with(start) && ran.err.lines().count() == 1, "{}", ran.err);
        // By 1 `compare` says that pictures differ.
        assert_eq!(ran.code, if verb.starts_with("compare") { 2 } else { 1 }, "{verb}");
    }
}
