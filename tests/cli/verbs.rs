//! What the verbs say: help, `plan`, `compare`; and to whom.

use super::{BALL, SMALL, batch};
use crate::common::place::{Place, Ran};
use abbe::batch::accuracy::{self, Settings};
use abbe::batch::{self, Overrides};
use serde_json::Value;
use std::sync::atomic::AtomicBool;

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

/// What ends a render decides how it is made.
#[test]
fn plan_takes_the_ends_that_render_takes() {
    let place = batch();
    let adaptive = |end: &[&str]| {
        let plan = place.run(&[&["plan", "scenes/good.yaml"], end].concat());
        assert_eq!((plan.err.as_str(), plan.code), ("", 0));
        plan.out.lines().find(|line| line.contains("adaptive sampling")).unwrap().trim().to_owned()
    };
    let told = adaptive(&["--error", "0.1%"]);
    assert_ne!(told, adaptive(&[]));
    for same in [&["--set", "render.stop.error=0.001"], &["--time", "60s"]] {
        assert_eq!(adaptive(same), told);
    }
    let ran = place.run(&["plan", "scenes/good.yaml", "--error", "200%"]);
    assert_eq!((ran.out.as_str(), ran.code), ("", 2), "{}", ran.err);
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

/// What goes to the standard output is all that some verbs are for; a script must not take nothing for it.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_the_standard_output_is_a_fault() {
    let place = batch();
    let full = || std::fs::File::create("/dev/full").unwrap();
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "out"]).code, 0);
    assert_eq!(place.run(&["export", "scenes/good.yaml", "-o", "good.xml"]).code, 0);
    for arguments in [
        &["plan", "scenes/good.yaml", "--format", "json"][..],
        &["export", "scenes/good.yaml"],
        &["import", "good.xml"],
        &["info", "out/good.exr", "--json"],
        &["compare", "out/good.exr", "out/good.exr"],
        &["compare", "out/good.exr", "out/good.exr", "--json", "/dev/full"],
        &["render", "scenes/good.yaml", "-o", "other"],
        &["--help"],
    ] {
        // By 1 `compare` says that pictures differ.
        let code = if arguments[0] == "compare" { 2 } else { 1 };
        let ran = Ran::of(place.command(arguments).stdout(full()).output().unwrap());
        let words = "error: the standard output: cannot write: No space left on device";
        assert!(ran.code == code && ran.err.lines().last().unwrap().starts_with(words), "{arguments:?}: {}", ran.err);
    }
    // The picture is written all the same.
    assert!(place.path("other/good.exr").is_file());
    // Another fault counts more.
    let ran = Ran::of(place.command(&["info", "out/good.exr", "none.exr"]).stdout(full()).output().unwrap());
    assert_eq!(ran.code, 3, "{}", ran.err);
}

/// Adaptive sampling has no ranges of samples, and files lie where the command line says: the other build did not hear of
/// it, and what it could not do cost the whole sheet.
#[test]
fn a_build_beside_has_a_row_wherever_files_lie_and_costs_no_more() {
    let scene = format!("{SMALL}{BALL}")
        .replace("samples: 4", "samples: 16, techniques: {adaptive: on}")
        .replace("4, height: 4", "16, height: 16");
    let texture = "textures: {t: {image: {file: /old/t.png}}, u: {image: {file: none.png}}}\n";
    let place = Place::with(&[("scenes/a.yaml", &format!("{scene}{texture}")), ("tex/x", "")]);
    image::GrayImage::new(2, 2).save(place.path("tex/t.png")).unwrap();
    let own = env!("CARGO_BIN_EXE_abbe");
    let sheet = |beside: &str, out: &str| {
        let file = ["accuracy", "scenes/a.yaml", "--path-map", "/old=tex", "-q", "-o", out, "--rounds", "1"];
        let set =
            ["--set", "textures.u.image.file=t.png", "--set-from", "tex", "--knob", "effects", "--beside", beside];
        place.run(&[&file[..], &set].concat())
    };
    let ran = sheet(own, "all");
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
    let rows = |out: &str| place.json(&format!("{out}/accuracy.json"))[0]["rows"].as_array().unwrap().clone();
    assert!(rows("all").iter().any(|row| row["knob"] == "build"), "{:?}", rows("all"));
    // One that says what it is, and renders nothing.
    let other = place.path("other");
    std::fs::write(&other, "#!/bin/sh\n[ $1 = --version ] && echo abbe 0 && exit\necho no light >&2; exit 4\n")
        .unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(&other, std::fs::Permissions::from_mode(0o755)).unwrap();
        let ran = sheet(other.to_str().unwrap(), "less");
        assert_eq!(ran.code, 4, "{}", ran.err);
        assert!(ran.err.starts_with("error: a: ") && ran.err.ends_with("other: no light\n"), "{}", ran.err);
        assert!(!rows("less").is_empty() && rows("less").iter().all(|row| row["knob"] != "build"));
    }
}

/// It ended with 4, which says that the picture is written.
#[test]
fn a_sheet_that_is_stopped_is_none() {
    let place = batch();
    let overrides = Overrides::default();
    let entry = batch::entries(&place.path("scenes/good.yaml"), &overrides).unwrap().remove(0);
    let [target, truth] = [None; 2];
    let settings = Settings { pixels: 64, samples: 16, rounds: 1, target, time: None, truth, knobs: &[], beside: None };
    let stopped = accuracy::sheet(&entry, &overrides, &settings, &|_, _, _| {}, &AtomicBool::new(true));
    assert_eq!(stopped.unwrap_err().exit_code(), 75);
}
