//! Renders that are killed, stopped and resumed: the same pixels as in one go, and never half a file.
#![cfg(unix)]

mod common;

use abbe::film::exr::read_exr;
use abbe::math::sampler::mix64;
use common::place::{Place, Ran, pixels};
use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Part of a second of light from the camera, and of merged photons.
fn scene(merging: &str) -> String {
    format!(
        "camera: {{origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}}\n\
         image: {{width: 64, height: 48}}\n\
         render: {{samples: 64, techniques: {{light_tracing: {merging}, merging: {merging}}}}}\n\
         output: {{exr: {{precision: float}}}}\n\
         shapes:\n\
         - plane: {{normal: [0, 1, 0]}}\n\
         - sphere: {{center: [0, 1, 0], radius: 1, material: {{dielectric: {{ior: {{glass: N-SF11}}}}}}}}\n\
         - sphere: {{center: [1, 3, 1], radius: 0.2, emission: 20}}\n"
    )
}

fn command(place: &Place, out: &str, further: &[&str]) -> Command {
    let mut command = place.command(&["render", "scene.yaml", "-q", "-o", out]);
    command.args(further);
    command
}

fn run(place: &Place, out: &str, further: &[&str]) -> Ran {
    place.run(&[&["render", "scene.yaml", "-q", "-o", out], further].concat())
}

fn nightly() -> bool {
    std::env::var_os("ABBE_NIGHTLY").is_some()
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// Waits for a file; false if the process ended before.
fn appears(child: &mut Child, file: &Path) -> bool {
    let end = Instant::now() + Duration::from_secs(60);
    while !file.exists() {
        if child.try_wait().unwrap().is_some() || Instant::now() > end {
            return file.exists();
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    true
}

/// Every file under its final name is whole: the picture, or the checkpoint, which `abbe merge` reads to its end before
/// it says that samples are missing.
fn nothing_is_half(place: &Place, out: &str) {
    let picture = place.path(out);
    if picture.exists() {
        pixels(&picture);
    }
    let checkpoint = place.path(&format!("{out}.checkpoint"));
    if checkpoint.exists() {
        let part = abbe::batch::part_file::open(&checkpoint).unwrap();
        part.verify().unwrap();
    }
}

#[test]
fn killed_at_any_moment_and_resumed_the_pixels_are_those_of_one_go() {
    let seed: u64 = std::env::var("ABBE_SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(1);
    for merging in ["off", "on"] {
        let place = Place::of(&scene(merging));
        let start = Instant::now();
        assert_eq!(run(&place, "whole.exr", &[]).code, 0);
        let span = start.elapsed();
        let kills = if nightly() { 50 } else { 3 };
        let mut resumed = 0;
        for kill in 0..kills {
            let out = format!("{kill}.exr");
            // Kills until the render is through; each at a moment of its own.
            for attempt in 0.. {
                assert!(attempt < 200, "it does not come to an end");
                let threads = ["1", "2", "3"][attempt % 3];
                let further = ["--resume", "--checkpoint-interval", "0.02s", "--threads", threads];
                let mut child = command(&place, &out, &further).spawn().unwrap();
                let draw = mix64(seed ^ mix64(kill << 16 | attempt as u64)) % 1000;
                std::thread::sleep(span.mul_f64(0.1 + draw as f64 * 0.9e-3));
                let _ = child.kill();
                let done = child.wait_with_output().unwrap();
                nothing_is_half(&place, &out);
                resumed += u32::from(place.path(&format!("{out}.checkpoint")).exists());
                if done.status.success() {
                    break;
                }
            }
            assert!(pixels(&place.path("whole.exr")) == pixels(&place.path(&out)), "merging {merging}, {kill}");
            assert!(!place.path(&format!("{out}.checkpoint")).exists());
        }
        assert!(resumed > 0, "no checkpoint was ever there");
    }
}

/// A process may be killed after it has written the picture and before it has removed the checkpoint: the next one does.
#[test]
fn a_checkpoint_of_a_picture_that_is_there_is_removed() {
    let place = Place::of(&scene("off"));
    let checkpoint = place.path("a.exr.checkpoint");
    let mut child = command(&place, "a.exr", &["--spp", "512", "--checkpoint-interval", "0.02s"]).spawn().unwrap();
    assert!(appears(&mut child, &checkpoint));
    let left = std::fs::read(&checkpoint).unwrap();
    assert!(child.wait().unwrap().success() && !checkpoint.exists());
    std::fs::write(&checkpoint, &left).unwrap();
    assert_eq!(run(&place, "a.exr", &["--spp", "512", "--resume"]).code, 0);
    assert!(!checkpoint.exists());
    // One of another picture is nobody else's to remove, and told of where it is not gone on from.
    assert_eq!(run(&place, "a.exr", &["--spp", "8"]).code, 0);
    std::fs::write(&checkpoint, &left).unwrap();
    assert_eq!(run(&place, "a.exr", &["--spp", "8", "--skip-existing"]).code, 0);
    assert!(checkpoint.exists());
    let told =
        "a.exr.checkpoint: it is of another picture: samples: expected 8, found 512; --resume does not go on from it";
    let quick = run(&place, "a.exr", &["--spp", "8"]);
    assert!(quick.code == 0 && quick.err.matches(told).count() == 1 && checkpoint.exists(), "{}", quick.err);
    // The picture that it would become is there.
    let told = "a.exr.checkpoint of an earlier render is there; --resume goes on from it";
    let whole = run(&place, "a.exr", &["--spp", "512"]);
    assert!(whole.code == 0 && whole.err.matches(told).count() == 1 && !checkpoint.exists(), "{}", whole.err);
}

/// Whether whoever started this process has it ignore a hang-up, as `nohup` does, and so what it starts.
fn ignores_a_hang_up() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

/// As under `nohup`.
#[test]
fn a_hang_up_that_is_ignored_stops_nothing() {
    let place = Place::of(&scene("off"));
    let mut shell = Command::new("sh");
    shell.current_dir(place.path(".")).args(["-c", "trap '' HUP; exec \"$@\"", "sh"]);
    let render = command(&place, "a.exr", &["--spp", "512", "--checkpoint-interval", "0.02s"]);
    let mut child = shell.arg(render.get_program()).args(render.get_args()).spawn().unwrap();
    assert!(appears(&mut child, &place.path("a.exr.checkpoint")));
    signal(&child, "HUP");
    assert!(child.wait().unwrap().success() && place.path("a.exr").exists());
}

#[test]
fn stopped_it_ends_with_75_and_goes_on_where_it_was() {
    let place = Place::of(&scene("on"));
    assert_eq!(run(&place, "whole.exr", &[]).code, 0);
    let checkpoint = place.path("a.exr.checkpoint");
    let signals = if ignores_a_hang_up() { ["TERM", "INT"] } else { ["HUP", "TERM"] };
    let mut stops = 0;
    loop {
        let mut child = command(&place, "a.exr", &["--resume", "--checkpoint-interval", "0.02s"]).spawn().unwrap();
        let before = std::fs::metadata(&checkpoint).ok().and_then(|m| m.modified().ok());
        if before.is_none() {
            appears(&mut child, &checkpoint);
        } else {
            std::thread::sleep(Duration::from_millis(150));
        }
        signal(&child, signals[stops % 2]);
        let done = Ran::of(child.wait_with_output().unwrap());
        if done.code == 0 {
            break;
        }
        assert_eq!(done.code, 75, "{}", done.err);
        let at_samples = done.err.contains("stopped at ") && done.err.contains("a.exr.checkpoint; --resume");
        assert!(at_samples || stops > 0 && done.err.contains("stopped while it was prepared"), "{}", done.err);
        assert!(!place.path("a.exr").exists());
        stops += 1;
        assert!(stops < 200);
        if stops == 3 {
            let done = run(&place, "a.exr", &["--resume", "--report", "r.json"]);
            assert_eq!(done.code, 0, "{}", done.err);
            assert!(std::fs::read_to_string(place.path("r.json")).unwrap().contains("resumed at "));
            break;
        }
    }
    assert!(stops > 0);
    assert!(pixels(&place.path("whole.exr")) == pixels(&place.path("a.exr")));
    assert!(!checkpoint.exists());
}

/// The sums of a million pixels take 256 MiB, all else some 100: not twice the sums, where a checkpoint is read.
#[test]
fn a_picture_goes_on_in_the_memory_that_it_began_in() {
    let place = Place::of(
        "camera: {origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}\n\
         image: {width: 1024, height: 1024}\n\
         shapes: [plane: {normal: [0, 1, 0]}]\n\
         lights: [constant: {radiance: 1}]\n",
    );
    let further = ["--resume", "--spp", "4096", "--checkpoint-interval", "0.2s", "--memory-limit", "430M"];
    let checkpoint = place.path("a.exr.checkpoint");
    for _ in 0..2 {
        let mut child = command(&place, "a.exr", &further).spawn().unwrap();
        match checkpoint.exists() {
            // Reading takes a part of a second.
            true => std::thread::sleep(Duration::from_secs(3)),
            false => assert!(appears(&mut child, &checkpoint)),
        }
        signal(&child, "TERM");
        let done = Ran::of(child.wait_with_output().unwrap());
        assert_eq!(done.code, 75, "{}", done.err);
    }
}

/// What a mirror throws of a lamp that stands in a closed box is looked for, in vain, by an eighth of the rays of the picture: half an
/// hour of so many samples.
#[test]
fn a_search_for_light_is_told_and_stopped() {
    let place = Place::of(
        "camera: {origin: [0, 1.6, 6], target: [0, 0.9, 0], fov_deg: 40}\n\
         image: {width: 640, height: 480}\n\
         render: {samples: 65536}\n\
         shapes:\n\
         - plane: {normal: [0, 1, 0]}\n\
         - sphere: {center: [0, 1, 0], radius: 1, material: {mirror: {}}}\n\
         - cube: {center: [5, 5, 5], size: 1}\n\
         lights: [point: {position: [5, 5, 5], intensity: 1}, constant: {radiance: 0.3}]\n",
    );
    let mut child = place.command(&["render", "scene.yaml", "-o", "a.exr", "--progress", "plain"]).spawn().unwrap();
    let mut plan = place.command(&["plan", "scene.yaml"]).spawn().unwrap();
    std::thread::sleep(Duration::from_secs(8));
    signal(&child, "TERM");
    plan.kill().unwrap();
    let end = Instant::now() + Duration::from_secs(60);
    while child.try_wait().unwrap().is_none() {
        if Instant::now() > end {
            child.kill().unwrap();
            panic!("it goes on looking");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let done = Ran::of(child.wait_with_output().unwrap());
    assert_eq!(done.code, 75, "{}", done.err);
    assert!(done.err.contains("stopped while it was prepared; --resume goes on"), "{}", done.err);
    let told = "Progress: 0.0%  scene: looking for light that mirrors or glass throw, at most about ";
    assert!(done.err.contains(told), "{}", done.err);
    assert!(!place.path("a.exr").exists());
    let planned = String::from_utf8(plan.wait_with_output().unwrap().stderr).unwrap();
    assert!(planned.contains(told.trim_start_matches("Progress: 0.0%  ")), "{planned}");
}

/// The second of three scenes is stopped, or about to begin; the third is not begun. None of them has failed.
#[test]
fn a_batch_that_is_stopped_says_what_is_written_and_calls_nothing_failed() {
    let place = Place::of(&scene("off"));
    let batch = "scenes:\n- file: scene.yaml\n- {file: scene.yaml, name: b, set: {render.samples: 65536}}\n\
                 - {file: scene.yaml, name: c}\n";
    std::fs::write(place.path("batch.yaml"), batch).unwrap();
    let mut child = place.command(&["render", "batch.yaml", "-q", "-o", "out"]).spawn().unwrap();
    assert!(appears(&mut child, &place.path("out/scene.exr")));
    signal(&child, "TERM");
    let done = Ran::of(child.wait_with_output().unwrap());
    assert_eq!(done.code, 75, "{}", done.err);
    let last = "error: stopped: scenes written so far: 1; --resume goes on with the others";
    assert_eq!(done.err.lines().last(), Some(last), "{}", done.err);
    assert!(!done.err.contains("failed"), "{}", done.err);
}

#[test]
fn a_part_is_stopped_and_resumed_like_a_picture() {
    let place = Place::of(&scene("on"));
    let portion = ["--tile", "1/2", "--samples", "5-60"];
    assert_eq!(run(&place, "whole.exr", &portion).code, 0);
    let resumed = [&portion[..], &["--resume", "--checkpoint-interval", "0.02s"]].concat();
    let mut child = command(&place, "a.exr", &resumed).spawn().unwrap();
    assert!(appears(&mut child, &place.path("a.exr.checkpoint")));
    signal(&child, "TERM");
    assert_eq!(child.wait().unwrap().code(), Some(75));
    // Another part does not take it for its own.
    let other = run(&place, "a.exr", &["--tile", "0/2", "--samples", "5-60", "--resume"]);
    assert_eq!(other.code, 3);
    assert!(
        other.err.contains("expected a checkpoint of tile 0/2, samples 5-60, found one of tile 1/2"),
        "{}",
        other.err
    );
    assert_eq!(run(&place, "a.exr", &resumed).code, 0);
    assert!(pixels(&place.path("whole.exr")) == pixels(&place.path("a.exr")));
    // And a finished one is done at once.
    let written = std::fs::metadata(place.path("a.exr")).unwrap().modified().unwrap();
    assert_eq!(run(&place, "a.exr", &resumed).code, 0);
    assert_eq!(std::fs::metadata(place.path("a.exr")).unwrap().modified().unwrap(), written);
}

#[test]
fn a_checkpoint_of_another_scene_or_a_damaged_one_is_refused_and_left() {
    let place = Place::of(&scene("off"));
    let mut child = command(&place, "a.exr", &["--checkpoint-interval", "0.02s"]).spawn().unwrap();
    let checkpoint = place.path("a.exr.checkpoint");
    assert!(appears(&mut child, &checkpoint));
    child.kill().unwrap();
    child.wait().unwrap();
    let bytes = std::fs::read(&checkpoint).unwrap();
    for (set, words) in
        [("render.seed=9", "seed: expected 9, found 0"), ("shapes[2].sphere.emission=3", "scene with the hash")]
    {
        let done = run(&place, "a.exr", &["--resume", "--set", set]);
        assert_eq!(done.code, 3, "{}", done.err);
        assert!(
            done.err.contains("a.exr.checkpoint: it is of another picture") && done.err.contains(words),
            "{}",
            done.err
        );
    }
    std::fs::write(&checkpoint, &bytes[..bytes.len() - 1]).unwrap();
    let done = run(&place, "a.exr", &["--resume"]);
    assert_eq!(done.code, 3, "{}", done.err);
    assert!(done.err.contains("a.exr.checkpoint: the part is damaged: it ends early"), "{}", done.err);
    assert!(!place.path("a.exr").exists() && checkpoint.exists());
}

/// What is there of a render to an error nobody can reach are the first samples of one to another error, however many those are: more,
/// or fewer, so that what was begun is ended and no more. The picture is that of as many samples in one go. Fewer samples than are
/// there at the most are another picture's, and so are those of a render that ends by samples alone.
#[test]
fn a_checkpoint_goes_on_to_another_error() {
    for merging in ["off", "on"] {
        // Techniques are planned for one sample, so that no bound is below that. Glass would be a matter of chance without its photons.
        let scene = scene(merging).replace("samples: 64", "samples: 1");
        let matte = scene.replace("{dielectric: {ior: {glass: N-SF11}}}", "{diffuse: {}}");
        let place = Place::of(if merging == "on" { &scene } else { &matte });
        let begin = ["--error", "1e-9", "--checkpoint-interval", "0.02s"];
        let mut child = command(&place, "a.exr", &begin).spawn().unwrap();
        let checkpoint = place.path("a.exr.checkpoint");
        assert!(appears(&mut child, &checkpoint));
        std::thread::sleep(Duration::from_millis(300));
        child.kill().unwrap();
        child.wait().unwrap();
        let bytes = std::fs::read(&checkpoint).unwrap();
        let fewer = vec!["--error", "1e-9", "--set", "render.stop.samples=1"];
        for (other, expected, found) in [
            (fewer, "expected a checkpoint of tile 0/1, samples 0-0", "found one of tile 0/1, samples 0-"),
            (vec!["--spp", "64"], "samples: expected 64", "found 65536"),
        ] {
            let done = run(&place, "a.exr", &[&["--resume"], &other[..]].concat());
            assert!(done.code == 3 && done.err.contains(expected) && done.err.contains(found), "{}", done.err);
            assert!(std::fs::read(&checkpoint).unwrap() == bytes);
        }
        for error in ["90%", "25%"] {
            std::fs::write(&checkpoint, &bytes).unwrap();
            let done = run(&place, "a.exr", &["--resume", "--error", error]);
            assert_eq!(done.code, 0, "{}", done.err);
            assert!(done.err.contains("resumed at") && !checkpoint.exists(), "{}", done.err);
            let samples = place.json("report.json")["scenes"][0]["samples"].to_string();
            let most = format!("render.stop.samples={samples}");
            assert_eq!(run(&place, "b.exr", &["--error", "1e-9", "--set", &most]).code, 0);
            assert!(pixels(&place.path("a.exr")) == pixels(&place.path("b.exr")), "{merging}, {error}: {samples}");
            // To another error it is another picture.
            let kept = |error: &str| {
                let before = std::fs::metadata(place.path("a.exr")).unwrap().modified().unwrap();
                assert_eq!(run(&place, "a.exr", &["--skip-existing", "--error", error]).code, 0);
                std::fs::metadata(place.path("a.exr")).unwrap().modified().unwrap() == before
            };
            assert!(kept(error) && !kept("20%"));
        }
    }
}

#[test]
fn what_is_there_is_skipped_only_if_it_holds() {
    let place = Place::of(&scene("off"));
    let skip = ["--skip-existing", "--spp", "8"];
    let modified = || std::fs::metadata(place.path("a.exr")).unwrap().modified().unwrap();
    let runs = |further: &[&str]| {
        let before = modified();
        let done = run(&place, "a.exr", further);
        assert_eq!(done.code, 0, "{}", done.err);
        modified() != before
    };
    assert_eq!(run(&place, "a.exr", &skip).code, 0);
    assert!(!runs(&skip) && !runs(&["--resume", "--spp", "8"]));
    assert!(runs(&["--skip-existing", "--spp", "12"]), "other samples");
    assert!(runs(&skip), "samples of before");
    assert!(runs(&[&skip[..], &["--set", "output.colour=acescg"]].concat()), "other colours");
    assert!(runs(&skip), "colours of before");
    // Chunks of the PNG that decoders pass over.
    for chunk in ["sRGB", "tEXt"] {
        let mut bytes = std::fs::read(place.path("a.png")).unwrap();
        let at = bytes.windows(4).position(|w| w == chunk.as_bytes()).unwrap();
        bytes[at] ^= 16;
        std::fs::write(place.path("a.png"), bytes).unwrap();
        assert!(runs(&skip) && !runs(&skip), "{chunk}");
    }
    // The length of the last row of the EXR: one byte more is past the end of the file, of which zlib asks nothing; OpenEXR does.
    let mut bytes = std::fs::read(place.path("a.exr")).unwrap();
    let height = read_exr(&place.path("a.exr")).unwrap().parts[0].window.height;
    let row = (height - 1).to_le_bytes();
    let is_last = |at: &usize| {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        bytes[*at..].starts_with(&row) && at + 8 + word(at + 4) as usize == bytes.len()
    };
    let at = (0..bytes.len() - 8).rev().find(is_last).unwrap() + 4;
    bytes[at] += 1;
    std::fs::write(place.path("a.exr"), bytes).unwrap();
    assert!(runs(&skip) && !runs(&skip), "the length of a row");
    // Damage in the middle of either file, half a file, none.
    for name in ["a.exr", "a.png"] {
        let whole = std::fs::read(place.path(name)).unwrap();
        let mut bytes = whole.clone();
        bytes[whole.len() * 3 / 4] ^= 16;
        std::fs::write(place.path(name), &bytes).unwrap();
        assert!(runs(&skip), "{name} damaged");
        std::fs::write(place.path(name), &whole[..whole.len() / 2]).unwrap();
        assert!(runs(&skip), "half of {name}");
        std::fs::remove_file(place.path(name)).unwrap();
        assert_eq!(run(&place, "a.exr", &skip).code, 0);
        assert!(std::fs::read(place.path("a.png")).unwrap().len() > 100 && !runs(&skip));
    }
}

/// The samples that an error took, the error and the pixels are those of the render, whose report is long gone.
#[test]
fn the_report_of_what_was_there_already_says_what_its_header_says() {
    let place = Place::of(&scene("off"));
    let report = || -> serde_json::Value {
        let done =
            run(&place, "out/a.exr", &["--error", "20%", "--skip-existing", "--set", "output.spectral={bands: 2}"]);
        assert_eq!(done.code, 0, "{}", done.err);
        let text = std::fs::read_to_string(place.path("out/report.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["scenes"][0].take()
    };
    let (first, second) = (report(), report());
    assert_eq!((&first["status"], &second["status"]), (&"done".into(), &"skipped".into()));
    for field in ["samples", "pixel_hash", "halving_seconds", "files"] {
        assert!(!first[field].is_null() && first[field] == second[field], "{field}: {first} {second}");
    }
    let number = |scene: &serde_json::Value, field: &str| scene["error"][field].as_f64().unwrap();
    for (field, off) in [("rel_rmse", 0.0), ("low", 1e-3), ("high", 1e-3), ("pixels", 0.0)] {
        let (a, b) = (number(&first, field), number(&second, field));
        // Ends are written with four figures.
        assert!((a / b - 1.0).abs() <= off, "{field}: {a} {b}");
    }
    assert_eq!(first["error"]["valid"], second["error"]["valid"]);
}

/// The EXR is written first: where the process dies before the PNG, that of an earlier render lies beside it. It is of the
/// same size and undamaged, but of another scene, seed or exposure.
#[test]
fn a_png_of_another_picture_is_made_again() {
    let place = Place::of(&scene("off"));
    let render = |out: &str, further: &[&str]| {
        let done = run(&place, out, &[&["--spp", "8"], further].concat());
        assert_eq!(done.code, 0, "{}", done.err);
    };
    let png = |name: &str| std::fs::read(place.path(name)).unwrap();
    for other in ["shapes[2].sphere.emission=3", "render.seed=9", "output.png.exposure=1"] {
        for keep in ["--resume", "--skip-existing"] {
            render("a.exr", &["--set", other]);
            render("b.exr", &[]);
            std::fs::copy(place.path("b.exr"), place.path("a.exr")).unwrap();
            assert!(png("a.png") != png("b.png"), "{other}");
            render("a.exr", &[keep]);
            assert!(png("a.png") == png("b.png"), "{other} {keep}");
        }
    }
    let says = place.run(&["info", "a.png"]);
    assert!(says.code == 0 && says.out.contains("\n  pixelHash   "), "{}", says.out);
}

#[test]
fn usr1_writes_a_picture_of_what_is_done_and_the_render_goes_on() {
    let place = Place::of(&scene("off"));
    let mut child = command(&place, "a.exr", &["--spp", "512", "--checkpoint-interval", "0.02s"]).spawn().unwrap();
    assert!(appears(&mut child, &place.path("a.exr.checkpoint")));
    signal(&child, "USR1");
    assert!(appears(&mut child, &place.path("a.snapshot.png")));
    signal(&child, "TERM");
    assert_eq!(child.wait().unwrap().code(), Some(75));
}

/// Renders the scene of `place` where its picture is not there yet; whether it was.
fn was_there(place: &Place) -> bool {
    let ran = place.run(&["render", "scene.yaml", "-o", "out", "--skip-existing", "--progress", "plain"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    ran.out.contains("1 of 1 were there already")
}

/// Missing, cut off, or a copy of the picture: then the render is made again.
#[test]
fn a_file_of_bands_that_does_not_hold_is_made_again() {
    let scene = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 8, height: 8}\n\
                 render: {samples: 4}\noutput: {spectral: {bands: 4}}\nshapes: [{sphere: {radius: 1}}]\n\
                 lights: [{constant: {radiance: 1}}]\n";
    let place = Place::of(scene);
    let render = || was_there(&place);
    let (main, bands) = (place.path("out/scene.exr"), place.path("out/scene.spectral.exr"));
    assert!(!render() && render());
    std::fs::remove_file(&bands).unwrap();
    assert!(!render() && render());
    let whole = std::fs::read(&bands).unwrap();
    std::fs::write(&bands, &whole[..whole.len() - 40]).unwrap();
    assert!(!render() && render());
    for (from, to) in [(&main, &bands), (&bands, &main)] {
        std::fs::copy(from, to).unwrap();
        assert!(!render() && render());
    }
}

/// As one writes beside bands of one's own, so that readers of spectral files know them.
#[test]
fn a_picture_that_names_the_layout_of_spectral_files_is_not_rendered_again() {
    let place = Place::of(
        "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 8, height: 8}\nrender: {samples: 4}\n\
         output: {exr: {attributes: {spectralLayoutVersion: '1.0', emissiveUnits: 'W.m^-2.sr^-1'}}}\n\
         lights: [{constant: {radiance: 1}}]\n",
    );
    assert!(!was_there(&place) && was_there(&place));
}

/// A picture of several parts is there once it is, with all its layers.
#[test]
fn a_picture_of_several_parts_is_not_rendered_again() {
    let scene = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 8, height: 8}\n\
                 render: {samples: 4}\noutput: {exr: {layout: multipart}}\nlayers: [normal, crypto_object]\n\
                 shapes: [{sphere: {radius: 1}}]\nlights: [{constant: {radiance: 1}}]\n";
    let place = Place::of(scene);
    let render = || was_there(&place);
    assert!(!render() && render());
    let file = place.path("out/scene.exr");
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() - 40]).unwrap();
    assert!(!render() && render());
}

/// DWA changes numbers as it packs them: what was written is what is read. Damage still shows.
#[test]
fn a_picture_that_is_packed_with_loss_is_not_rendered_again() {
    let scene = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 40, height: 40}\n\
                 render: {samples: 4}\noutput: {exr: {compression: dwaa, layout: multipart}}\nlayers: [normal, direct]\n\
                 shapes: [{sphere: {radius: 1}}]\nlights: [{point: {position: [2, 3, 4], intensity: 9}}]\n";
    let place = Place::of(scene);
    let render = || was_there(&place);
    assert!(!render() && render());
    let said = place.run(&["info", "out/scene.exr"]).out;
    assert!(said.contains("as they were written"), "{said}");
    let file = place.path("out/scene.exr");
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() - 40]).unwrap();
    assert!(!render() && render());
}

/// `timeout` signals the process, and then the group that it is in: two signals at once are one wish. One that comes later ends the
/// process at once, whatever it writes.
#[test]
fn signals_that_come_together_are_one() {
    let place = Place::of(&scene("off").replace("samples: 64", "samples: 1000000"));
    for name in ["TERM", "INT"] {
        let out = format!("{name}.exr");
        let mut child = command(&place, &out, &["--checkpoint-interval", "1s"]).spawn().unwrap();
        // It hears signals before it writes.
        assert!(appears(&mut child, &place.path(&format!("{out}.checkpoint"))));
        signal(&child, name);
        signal(&child, name);
        assert_eq!(child.wait().unwrap().code(), Some(75), "{name}");
    }
}

/// Where nothing can be written any more, what is there is still there.
#[test]
fn a_finished_picture_needs_no_room_to_be_found() {
    let place = Place::of(&scene("off").replace("samples: 64", "samples: 4"));
    assert_eq!(run(&place, "o/a.exr", &[]).code, 0);
    let rendered = place.json("o/report.json")["scenes"][0].take();
    // As long as this stands there no checkpoint can be written.
    std::fs::create_dir(place.path("o/a.exr.checkpoint")).unwrap();
    let ran = run(&place, "o/a.exr", &[]);
    assert!(ran.code == 1 && ran.err.contains("a.exr.checkpoint"), "{} {}", ran.code, ran.err);
    assert_eq!(run(&place, "o/a.exr", &["--skip-existing"]).code, 0);
    let skipped = place.json("o/report.json")["scenes"][0].take();
    assert_eq!(skipped["status"], "skipped");
    // Its header says all of it.
    for (group, figure) in [("seconds", "rendering"), ("error", "rel_rmse"), ("error", "low"), ("error", "high")] {
        assert_eq!(rendered[group][figure], skipped[group][figure], "{group}.{figure}");
    }
    let [rate, again] = [&rendered, &skipped].map(|scene| scene["msamples_per_second"].as_f64().unwrap());
    assert!(rate > 0.0 && (again / rate - 1.0).abs() < 1e-6, "{rate} {again}");
}
