//! Long batches, and batches that several processes share.

mod common;

use common::place::Place;
use serde_json::Value;

/// A picture of a few milliseconds.
const SCENE: &str = "camera: {origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}\n\
                     image: {width: 16, height: 12}\n\
                     render: {samples: 4}\n\
                     lights: [{constant: {radiance: 0.3}}]\n\
                     shapes: [{sphere: {center: [0, 1, 0], radius: 1}}]\n";

/// Kilobytes that a process holds.
#[cfg(target_os = "linux")]
fn resident(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

/// What is kept of a scene: 0.7 kB of a report, three to eight strings and paths of 16 to 112 bytes, 0.5 kB of the entry of
/// the batch. 2 kB are enough, and 5 kB leave room for the allocator's own. Scenes whose bulk stayed would be 65 kB each.
#[cfg(target_os = "linux")]
#[test]
fn a_batch_holds_little_of_each_scene_that_is_done() {
    use std::io::{BufRead, BufReader};
    let entries: String = (0..900).map(|i| format!("- {{file: scene.yaml, name: s{i:03}}}\n")).collect();
    let batch = format!("output: {{contact_sheet: false}}\nscenes:\n{entries}");
    let place = Place::with(&[("scene.yaml", SCENE), ("batch.yaml", &batch)]);
    let mut command = place.command(&["render", "batch.yaml", "-o", "out", "--progress", "json", "--threads", "2"]);
    let mut child = command.stderr(std::process::Stdio::null()).spawn().unwrap();
    // The most that is held while a hundred scenes are rendered.
    let (mut early, mut late) = (0, 0);
    for line in BufReader::new(child.stdout.take().unwrap()).lines() {
        let event: Value = serde_json::from_str(&line.unwrap()).unwrap();
        if event["event"] == "scene" {
            match event["index"].as_u64().unwrap() {
                200..300 => early = resident(child.id()).max(early),
                800..900 => late = resident(child.id()).max(late),
                _ => {}
            }
        }
    }
    assert!(child.wait().unwrap().success());
    assert!(early > 0 && late < early + 600 * 5, "{early} kB after 200 to 300 scenes, {late} kB after 800 to 900");
}

/// Six tasks and two merges in one directory, whose reports tell of all that was done.
#[test]
fn tasks_that_share_a_directory_keep_a_report_each() {
    let batch = "scenes: [{file: scene.yaml, name: a}, {file: scene.yaml, name: b}]\n";
    let place = Place::with(&[("scene.yaml", SCENE), ("batch.yaml", batch)]);
    let render = |what: &[&str]| {
        let ran = place.run(&[&["render", "batch.yaml", "-q"], what].concat());
        assert_eq!(ran.code, 0, "{what:?}: {}", ran.err);
    };
    for frames in ["1-2", "3"] {
        render(&["--frames", frames, "-o", "out"]);
    }
    for tile in ["0/2", "1/2"] {
        for scene in ["a", "b"] {
            render(&["--scene", scene, "--frames", "7", "--tile", tile, "-o", &format!("out/{scene}")]);
        }
    }
    for scene in ["a", "b"] {
        assert_eq!(place.run(&["merge", &format!("out/{scene}"), "-o", "out", "-q"]).code, 0);
    }
    let tells = |file: &str| -> Vec<String> {
        let scenes = place.json(file)["scenes"].take();
        let label = |s: &Value| format!("{} {}", s["name"].as_str().unwrap(), s["frame"]);
        scenes.as_array().unwrap().iter().map(label).collect()
    };
    let named = |stem: &str, directory: &str| -> Vec<String> {
        place.names(directory).into_iter().filter(|name| name.starts_with(stem)).collect()
    };
    let reports = |directory: &str| named("report", directory);
    let sheets = ["1-2.html", "1-2.png", "3.html", "3.png"].map(|end| format!("contact-sheet.{end}"));
    assert_eq!(named("contact", "out"), sheets);
    assert_eq!(reports("out"), ["report.1-2.json", "report.3.json", "report.a.0007.json", "report.b.0007.json"]);
    assert_eq!(tells("out/report.1-2.json"), ["a 1", "a 2", "b 1", "b 2"]);
    assert_eq!(tells("out/report.3.json"), ["a 3", "b 3"]);
    for scene in ["a", "b"] {
        let told = [format!("{scene} 7")];
        assert_eq!(tells(&format!("out/report.{scene}.0007.json")), told);
        let tiles = ["tile0of2", "tile1of2"].map(|tile| format!("report.{scene}.7.{tile}.json"));
        assert_eq!(reports(&format!("out/{scene}")), tiles);
        for tile in tiles {
            assert_eq!(tells(&format!("out/{scene}/{tile}")), told);
        }
    }
}
