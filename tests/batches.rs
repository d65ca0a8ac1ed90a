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

/// What is kept of a scene: 0.7 kB of a report with three to eight strings and paths of 16 to 112 bytes, 0.5 kB of the
/// entry of the batch; so that 2 kB are enough, and 5 kB leave room for the allocator's own. Scenes whose bulk stayed
/// would be 65 kB each.
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
