//! Scenes that change over frames: each frame is the picture of a scene that stands still, and has a name of its own.

mod common;

use abbe::batch::merge;
use common::place::{Place, pixels};
use serde_json::Value;

/// A picture of a few milliseconds, without what moves.
const STILL: &str = "image: {width: 20, height: 14}\n\
                     output: {exr: {precision: float}}\n\
                     lights: [{constant: {radiance: 0.3}}]\n";

/// A camera that travels, a ball that rolls, swells and takes colour, a cube that turns, and a lamp that fades.
const MOVING: &str = "camera: {origin: {0: [0, 1, 6], 8: [2, 1, 6]}, target: [0, 0.5, 0], fov_deg: {4: 40, 12: 56}}\n\
                      shapes:\n\
                      - plane: {normal: [0, 1, 0]}\n\
                      - sphere:\n\
                      \x20   radius: {keys: [[0, 0.25], [8, 0.75]]}\n\
                      \x20   center: {0: [-1, 0.5, 0], 8: [1, 1.5, 0], 16: [5, 0, 0], interpolation: step}\n\
                      \x20   material: {diffuse: {reflectance: {rgb: {0: [0.25, 0.5, 0.5], 8: [0.75, 0, 0.5], interpolation: smooth}}}}\n\
                      - cube: {size: 1, transform: [{rotate: {axis: [0, 1, 0], deg: {0: 0, 8: 90}}}, {translate: [2, 0.5, 0]}]}\n\
                      - sphere: {center: [0, 4, 2], radius: 0.5, emission: {0: 8, 16: 0}}\n";

/// [`MOVING`] at frame 4, by hand: halves, and at the middle between two keys with slope 0 the smooth value is their mean.
const AT_4: &str = "camera: {origin: [1, 1, 6], target: [0, 0.5, 0], fov_deg: 40}\n\
                    shapes:\n\
                    - plane: {normal: [0, 1, 0]}\n\
                    - sphere:\n\
                    \x20   radius: 0.5\n\
                    \x20   center: [-1, 0.5, 0]\n\
                    \x20   material: {diffuse: {reflectance: {rgb: [0.5, 0.25, 0.5]}}}\n\
                    - cube: {size: 1, transform: [{rotate: {axis: [0, 1, 0], deg: 45}}, {translate: [2, 0.5, 0]}]}\n\
                    - sphere: {center: [0, 4, 2], radius: 0.5, emission: 6}\n";

/// Renders, and reads the report.
fn render(place: &Place, arguments: &[&str]) -> Value {
    let ran = place.run(&[&["render", "-q", "--report", "r.json"], arguments].concat());
    assert_eq!(ran.code, 0, "{arguments:?}: {}", ran.err);
    place.json("r.json")
}

/// Files of scenes, each a name and what it says.
fn with(files: &[(&str, String)]) -> Place {
    Place::with(&files.iter().map(|(name, text)| (*name, text.as_str())).collect::<Vec<_>>())
}

fn hashes(report: &Value) -> Vec<(String, String)> {
    let text = |scene: &Value, key: &str| scene[key].as_str().unwrap().to_owned();
    report["scenes"].as_array().unwrap().iter().map(|s| (text(s, "pixel_hash"), text(s, "scene_hash"))).collect()
}

#[test]
fn a_frame_is_the_picture_of_a_scene_with_its_values_written_in() {
    let settings = "render: {samples: 8, seed: 100, frames: '0-8:4'}\n";
    let still = "render: {samples: 8, seed: 104}\n";
    let files = [("a.yaml", format!("{settings}{STILL}{MOVING}")), ("b.yaml", format!("{still}{STILL}{AT_4}"))];
    let place = with(&files);
    let moving = render(&place, &["a.yaml"]);
    let frames: Vec<i64> = moving["scenes"].as_array().unwrap().iter().map(|s| s["frame"].as_i64().unwrap()).collect();
    assert_eq!(frames, [0, 4, 8]);
    let moving = hashes(&moving);
    assert_eq!(moving[1], hashes(&render(&place, &["b.yaml"]))[0]);
    assert!(moving[0].0 != moving[1].0 && moving[1].0 != moving[2].0);
    assert!(place.path("out/a.0004.exr").is_file() && place.path("out/a.0008.png").is_file());
    // In any company.
    assert_eq!(hashes(&render(&place, &["a.yaml", "--frames", "4"]))[0], moving[1]);
}

#[test]
fn a_scene_that_does_not_change_is_the_same_with_frames_but_for_its_seed() {
    let place = with(&[("a.yaml", format!("{STILL}{AT_4}"))]);
    let still = hashes(&render(&place, &["a.yaml", "--spp", "4", "--seed", "7"]));
    assert_eq!(hashes(&render(&place, &["a.yaml", "--spp", "4", "--frames", "7"])), still);
    let held = ["a.yaml", "--spp", "4", "--seed", "7", "--frames", "-3,12", "--set", "render.seed_per_frame=false"];
    assert_eq!(hashes(&render(&place, &held)), [still[0].clone(), still[0].clone()]);
    assert_eq!(
        place.names("out").iter().filter(|f| f.ends_with("exr")).collect::<Vec<_>>(),
        ["a.-003.exr", "a.0007.exr", "a.0012.exr", "a.exr"]
    );
}

#[test]
fn names_follow_the_pattern() {
    let batch = "render: {samples: 1, frames: 3-4}\nscenes: [{file: a.yaml}, {file: a.yaml, name: b}]\n";
    let place = with(&[("a.yaml", format!("{STILL}{MOVING}")), ("batch.yaml", batch.to_owned())]);
    let one = ["batch.yaml", "--scene", "b", "-o"];
    for (output, directory, first) in [
        ("p", "p", "b.0003.exr"),
        ("q/x.###.exr", "q", "x.003.exr"),
        ("r/%02d_{scene}.exr", "r", "03_b.exr"),
        ("{scene}/{frame:06}.exr", "b", "000003.exr"),
        ("s-{frame}", "s-3", "b.0003.exr"),
    ] {
        render(&place, &[&one[..], &[output]].concat());
        assert!(place.path(directory).join(first).is_file(), "{output}: {:?}", place.names(directory));
    }
    render(&place, &["batch.yaml", "-o", "all/{scene}.####.exr"]);
    let exr: Vec<String> = place.names("all").into_iter().filter(|name| name.ends_with("exr")).collect();
    assert_eq!(exr, ["a.0003.exr", "a.0004.exr", "b.0003.exr", "b.0004.exr"]);
}

#[test]
fn what_is_there_of_an_animation_is_left_alone() {
    let place = with(&[("a.yaml", format!("{STILL}{MOVING}"))]);
    let common = ["a.yaml", "--spp", "2", "--skip-existing", "--frames"];
    render(&place, &[&common[..], &["1-2"]].concat());
    let report = render(&place, &[&common[..], &["1-3"]].concat());
    let status: Vec<&str> =
        report["scenes"].as_array().unwrap().iter().map(|s| s["status"].as_str().unwrap()).collect();
    assert_eq!(status, ["skipped", "skipped", "done"]);
    // Frame 2 under the name of frame 1 is not frame 1.
    std::fs::rename(place.path("out/a.0002.exr"), place.path("out/a.0001.exr")).unwrap();
    let report = render(&place, &[&common[..], &["1"]].concat());
    assert_eq!(report["scenes"][0]["status"], "done");
}

#[test]
fn parts_of_a_frame_make_it_up_and_those_of_two_are_refused() {
    let place = with(&[("a.yaml", format!("{STILL}{MOVING}")), ("still.yaml", format!("{STILL}{AT_4}"))]);
    let common = ["a.yaml", "--spp", "8", "--frames", "3-4"];
    render(&place, &common);
    for tile in ["0/2", "1/2"] {
        render(&place, &[&common[..], &["--tile", tile, "-o", "parts/{frame}"]].concat());
    }
    assert_eq!(place.names("parts/4")[..2], ["a.0004.tile0of2.exr", "a.0004.tile1of2.exr"]);
    for frame in ["3", "4"] {
        let ran = place.run(&["merge", &format!("parts/{frame}"), "-o", "merged", "-q"]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        let name = format!("a.000{frame}.exr");
        assert!(pixels(&place.path("merged").join(&name)) == pixels(&place.path("out").join(&name)));
    }
    let mixed = [place.path("parts/3/a.0003.tile0of2.exr"), place.path("parts/4/a.0004.tile1of2.exr")];
    let error = merge::merge(&mixed, &place.path("x.exr"), None).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    let message = error.to_string();
    assert!(message.ends_with("it is of another picture: frame_number: expected 3, found 4"), "{message}");
    // Even where nothing changes, and with a picture that has no frame.
    let still = |out: &str, further: &[&str]| {
        let common = ["still.yaml", "--spp", "2", "--tile", "0/1", "--set", "render.seed_per_frame=false", "-o", out];
        render(&place, &[&common[..], further].concat());
        place.path(out)
    };
    let parts = [still("one.exr", &["--frames", "1"]), still("none.exr", &[])];
    for (a, b) in [(0, 1), (1, 0)] {
        let message =
            merge::merge(&[parts[a].clone(), parts[b].clone()], &place.path("x.exr"), None).unwrap_err().to_string();
        let [expected, found] = [["1", "none"][a], ["1", "none"][b]];
        assert!(message.ends_with(&format!("frame_number: expected {expected}, found {found}")), "{message}");
    }
}

#[test]
fn a_frame_is_exported_as_it_stands() {
    let still = format!("render: {{samples: 2, seed: 4}}\n{STILL}{AT_4}");
    let place = with(&[("a.yaml", format!("{STILL}{MOVING}")), ("b.yaml", still)]);
    let exported = |arguments: &[&str]| {
        let ran = place.run(&[&["export"], arguments].concat());
        assert_eq!(ran.code, 0, "{}", ran.err);
        let several = "note: a.yaml: frame 4 of 6 is written; --frames N picks another";
        assert_eq!(ran.err.contains(several), arguments.contains(&"4-9"), "{}", ran.err);
        let text = ran.out;
        // One scene writes `render` first, the other last.
        let (render, rest) = text.lines().partition::<Vec<&str>, _>(|line| line.contains("<?abbe set"));
        (
            render.iter().copied().collect::<std::collections::BTreeSet<_>>().len(),
            rest.join("\n"),
            text.contains("<?abbe set render.seed: 4?>") && text.contains("name=\"spp\" value=\"2\""),
        )
    };
    let frame = exported(&["a.yaml", "--frames", "4-9", "--spp", "2"]);
    assert!(frame.2);
    assert_eq!(frame, exported(&["b.yaml"]));
}

#[test]
fn what_is_wrong_with_frames_is_said_once() {
    let place = with(&[
        ("a.yaml", format!("{STILL}{MOVING}")),
        (
            "bad.yaml",
            "render: {frames: 1-100}\ncamera: {origin: [0, 1, 6], target: [0, 0, 0], fov_deg: {1: 40, 9: 200}}\n"
                .to_owned(),
        ),
        ("batch.yaml", "scenes: [{file: a.yaml}, {file: a.yaml, name: b}]\n".to_owned()),
    ]);
    let says = |arguments: &[&str], code: i32| {
        let ran = place.run(&[&["render", "-q"], arguments].concat());
        assert_eq!(ran.code, code, "{arguments:?}: {}", ran.err);
        ran.err
    };
    let message = says(&["a.yaml"], 2);
    assert!(message.starts_with("error: a: a.yaml:4:18: camera.origin: expected render.frames or --frames, since this changes over frames, found none\n"), "{message}");
    let message = says(&["a.yaml", "--frames", "10-1"], 2);
    assert!(
        message.contains("expected ranges from a frame to a later one in steps of 1 or more, found \"10-1\""),
        "{message}"
    );
    let message = says(&["a.yaml", "--frames", "1-9y3"], 2);
    assert!(message.contains("y, which leaves frames out, is not known"), "{message}");
    let message = says(&["a.yaml", "--frames", "1-3", "-o", "x.exr"], 2);
    assert!(message.contains("-o x.exr: expected a directory for 3 frames, or a pattern as a.####.exr"), "{message}");
    let message = says(&["batch.yaml", "--frames", "1-3", "-o", "x.####.exr"], 2);
    assert!(
        message.contains("-o x.####.exr: expected a directory for 2 scenes, or a pattern with {scene}"),
        "{message}"
    );
    // The first frames are well, and from the eighth on it is always the same, but for the number.
    let message = says(&["bad.yaml", "--spp", "4", "--set", "image.width=8", "--frames", "1,9-100"], 2);
    let line = "bad.yaml:2:68: camera.fov_deg: expected an angle between 0 and 180 degrees, found 200";
    let message = message.lines().filter(|line| line.starts_with("error")).collect::<Vec<_>>().join("\n");
    assert_eq!(message, format!("error: bad.0009: {line}\nerror: 92 of 93 pictures failed; the others are written"));
    assert!(place.path("out/bad.0001.exr").is_file());
}
