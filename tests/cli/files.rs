//! What is left on the disk: whole files or none, also where none can be written.

use super::{BALL, Place, SMALL, batch};
use std::process::Command;

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

/// What the scene names is not there, and not looked for; nor is a directory made for what comes to nothing.
#[test]
fn an_unwritable_place_is_told_before_the_scene_is_made_ready() {
    let place = Place::with(&[
        ("scene.yaml", &format!("{SMALL}shapes: [mesh: {{file: none.obj}}]\n")),
        ("taken", "a regular file"),
    ]);
    let ran = place.run(&["render", "scene.yaml", "-q", "-o", "taken/deep"]);
    let told = "error: scene: taken/deep/scene.exr: cannot write: taken/deep is not a directory\n";
    assert_eq!((&*ran.err, ran.code), (told, 1));
    let ran = place.run(&["render", "scene.yaml", "-q", "-o", "new/deep"]);
    assert!(ran.err.contains("none.obj") && ran.code == 3, "{}", ran.err);
    assert!(!place.path("new").exists());
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

/// A link to the standard output, as `/dev/stdout` is one: what is written goes there, and after what was said before.
#[cfg(target_os = "linux")]
#[test]
fn the_standard_output_may_be_written_to_by_name() {
    let place = batch();
    std::os::unix::fs::symlink("/proc/self/fd/1", place.path("stdout")).unwrap();
    let printed = place.run(&["import", "scenes/good.yaml"]);
    let written = place.run(&["import", "scenes/good.yaml", "-o", "stdout"]);
    assert_eq!((written.out, written.err, written.code), (printed.out, String::new(), 0));
    assert!(place.path("stdout").is_symlink());
    let log = std::fs::File::create(place.path("log")).unwrap();
    let mut render = place.command(&["render", "scenes/good.yaml", "-o", "out", "--report", "stdout"]);
    assert!(render.stdout(log).status().unwrap().success());
    let log = std::fs::read_to_string(place.path("log")).unwrap();
    assert!(log.starts_with("{\n") && log.contains("effects in force:"), "{log}");
}

/// What is read is worth more than what would be written over it.
#[test]
fn no_output_takes_the_place_of_what_is_read() {
    let place = batch();
    let words = "expected a place to write to, found a file that is read";
    let lit = format!("{SMALL}render: {{samples: 4}}\nlights: [{{environment: {{file: out/sky.exr}}}}]\n");
    std::fs::write(place.path("sky.yaml"), lit).unwrap();
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "out/sky.exr"]).code, 0);
    assert_eq!(place.run(&["export", "scenes/good.yaml", "-o", "me.xml"]).code, 0);
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "parts", "--tile", "0/2"]).code, 0);
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "parts", "--tile", "1/2"]).code, 0);
    let part = &format!("parts/{}", place.names("parts").into_iter().find(|name| name.ends_with(".exr")).unwrap());
    let mesh = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    std::fs::write(place.path("c.shape0.ply"), mesh).unwrap();
    let shapes = "shapes: [{mesh: {file: c.shape0.ply}}, {cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 1}}]\n";
    std::fs::write(place.path("cone.yaml"), format!("{SMALL}{shapes}")).unwrap();
    assert_eq!(place.run(&["export", "cone.yaml", "-o", "d.xml"]).code, 0);
    let deep = "scenes/../scenes/good.yaml";
    let exr = "./out/sky.exr";
    for (arguments, file, before) in [
        (vec!["export", "scenes/good.yaml", "-o", deep], deep, ""),
        (vec!["import", "me.xml", "-o", "me.xml"], "me.xml", ""),
        (vec!["import", "d.xml", "-o", "c.shape0.ply"], "c.shape0.ply", ""),
        (vec!["export", "cone.yaml", "-o", "c.shape0.ply"], "c.shape0.ply", ""),
        (vec!["export", "cone.yaml", "-o", "c.xml"], "./c.shape0.ply", ""),
        (vec!["render", "sky.yaml", "-q", "-o", "out"], "out/sky.exr", "sky: "),
        (vec!["render", "sky.yaml", "-q", "-o", "pictures", "--report", exr], exr, ""),
        (vec!["render", "sky.yaml", "-q", "--report", "sky.yaml"], "sky.yaml", ""),
        (vec!["render", "batch.yaml", "-q", "--report", "scenes/bad.yaml"], "scenes/bad.yaml", ""),
        (vec!["merge", "parts", "-o", part], part, ""),
        (vec!["merge", "parts", "-o", "all.exr", "--report", part], part, ""),
        (vec!["compare", exr, exr, "--json", "out/sky.exr"], "out/sky.exr", ""),
    ] {
        let bytes = std::fs::read(place.path(file)).unwrap();
        let ran = place.run(&arguments);
        assert_eq!((ran.err, ran.code), (format!("error: {before}{file}: {words}\n"), 2), "{arguments:?}");
        assert!(std::fs::read(place.path(file)).unwrap() == bytes, "{arguments:?}");
    }
    assert_eq!(place.names("pictures"), Vec::<String>::new());
    // What a render leaves in its midst goes when it is done, and would take what is read with it.
    std::fs::copy(place.path("out/sky.png"), place.path("room.snapshot.png")).unwrap();
    std::fs::write(place.path("room.exr.checkpoint"), "0, 40\n1, 50\n").unwrap();
    let texture = "textures: {t: {image: {file: room.snapshot.png}}}\n";
    let keyed = SMALL.replace("fov_deg: 40", "fov_deg: {keys: {file: room.exr.checkpoint}}");
    for (text, file) in [(format!("{SMALL}{texture}"), "room.snapshot.png"), (keyed, "room.exr.checkpoint")] {
        assert!(text.contains(file), "{text}");
        std::fs::write(place.path("room.yaml"), text).unwrap();
        // A part has both of them, too.
        for part in [&[][..], &["--tile", "0/2"]] {
            let ran = place.run(&[&["render", "room.yaml", "-q", "-o", "room.exr", "--frames", "0"], part].concat());
            assert!(ran.code == 2 && ran.err.ends_with(&format!(" {file}: {words}\n")), "{part:?}: {}", ran.err);
        }
        assert!(place.path(file).is_file());
    }
    // A later scene may read what an earlier one has made.
    let two = "output: {dir: out}\nscenes: [{file: scenes/good.yaml, name: sky}, {file: sky.yaml, name: room}]\n";
    std::fs::write(place.path("two.yaml"), two).unwrap();
    assert_eq!(place.run(&["render", "two.yaml", "-q"]).code, 0);
}

/// JSON in the place of a picture would be found by nobody before the picture is looked at.
#[test]
fn no_report_takes_the_place_of_what_is_written_beside_it() {
    let place = batch();
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "parts", "--tile", "0/1"]).code, 0);
    std::fs::create_dir(place.path("o")).unwrap();
    let words =
        |file: &str, by: &str| format!("error: --report {file}: expected a place of its own, found that of {by}\n");
    let good = "a file of the picture good";
    for (arguments, file, by) in [
        (&["render", "scenes/good.yaml", "-o", "o/a.exr"][..], "o/a.exr", good),
        (&["render", "scenes/good.yaml", "-o", "o/a.exr"], "o/../o/a.png", good),
        (&["render", "scenes/good.yaml", "-o", "o/a.exr"], "o/a.spectral.exr", good),
        (&["render", "scenes/good.yaml", "-o", "o/a.exr"], "o/a.exr.checkpoint", good),
        (&["render", "scenes/good.yaml", "-o", "o/a.exr"], "o/a.snapshot.png", good),
        (&["render", "scenes/good.yaml", "-o", "o/a.exr", "--tile", "0/2"], "o/a.exr", good),
        (&["render", "scenes/good.yaml", "-o", "o/####.exr", "--frames", "1-9"], "o/0007.exr", &format!("{good}.0007")),
        (&["render", "batch.yaml", "-o", "o"], "o/other.png", "a file of the picture other"),
        (&["render", "batch.yaml", "-o", "o"], "o/contact-sheet.html", "the contact sheet"),
        (&["merge", "parts", "-o", "o/m.exr"], "o/m.exr", good),
        (&["merge", "parts", "-o", "o"], "o/good.png", good),
    ] {
        let ran = place.run(&[arguments, &["-q", "--report", file]].concat());
        assert_eq!((ran.err, ran.code), (words(file, by), 2), "{arguments:?}");
        assert_eq!(place.names("o"), Vec::<String>::new(), "{arguments:?}");
    }
    // The report that is written in any case may be named.
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "o", "--report", "o/report.json"]).code, 0);
}

/// What a scene is read from is found before the first one is rendered; what it names besides only in its turn. Then all
/// pictures are made, and the report is the one in their directory.
#[test]
fn a_report_in_the_place_of_what_a_later_scene_reads_costs_no_picture() {
    let place = batch();
    let words = "expected a place to write to, found a file that is read\n";
    let lit = format!("{SMALL}render: {{samples: 4}}\nlights: [{{environment: {{file: sky.exr}}}}]\n");
    std::fs::write(place.path("lit.yaml"), lit).unwrap();
    std::fs::write(place.path("two.yaml"), "scenes: [{file: scenes/good.yaml}, {file: lit.yaml}]\n").unwrap();
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "sky.exr"]).code, 0);
    let render = |report: &str| place.run(&["render", "two.yaml", "-q", "-o", "o", "--report", report]);
    let ran = render("lit.yaml");
    assert_eq!((ran.err, ran.code), (format!("error: lit.yaml: {words}"), 2));
    assert_eq!(place.names("o"), Vec::<String>::new());
    let sky = std::fs::read(place.path("sky.exr")).unwrap();
    let ran = render("sky.exr");
    assert_eq!((ran.err, ran.code), (format!("error: sky.exr: {words}"), 2));
    assert!(std::fs::read(place.path("sky.exr")).unwrap() == sky);
    assert!(["good.exr", "lit.exr", "report.json"].iter().all(|name| place.path("o").join(name).is_file()));
}

/// The report and the contact sheet lie in the directory of the pictures, under names of their own.
#[test]
fn neither_report_nor_contact_sheet_nor_sheet_of_accuracy_is_written_over_what_is_read() {
    let place = batch();
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "sky.exr"]).code, 0);
    let json = r#"{"camera": {"origin": [0, 0, 5], "target": [0, 0, 0], "fov_deg": 40}, "image": {"width": 4, "height": 4},
        "render": {"samples": 4}, "lights": [{"constant": {"radiance": 1}}]}"#;
    std::fs::create_dir(place.path("in")).unwrap();
    for name in ["in/report.json", "in/report.x.json", "in/accuracy.json"] {
        std::fs::write(place.path(name), json).unwrap();
    }
    std::fs::copy(place.path("sky.png"), place.path("in/contact-sheet.png")).unwrap();
    let textured =
        "textures: {t: {image: {file: contact-sheet.png}}}\nmaterials: {m: {diffuse: {reflectance: {texture: t}}}}\n";
    std::fs::write(place.path("in/textured.yaml"), format!("{SMALL}{BALL}{textured}")).unwrap();
    let moving = format!("{SMALL}{BALL}{textured}").replace("samples: 4", "samples: 4, frames: 1-2");
    std::fs::write(place.path("in/moving.yaml"), moving).unwrap();
    let two = |name: &str| format!("scenes: [{{file: ../scenes/good.yaml}}, {{file: {name}}}]\n");
    std::fs::write(place.path("in/one.yaml"), two("report.json")).unwrap();
    std::fs::write(place.path("in/two.yaml"), two("textured.yaml")).unwrap();
    std::fs::write(place.path("in/x.yaml"), "scenes: [{file: report.x.json, name: x}]\n").unwrap();
    let before = place.names("in");
    for (arguments, file, label) in [
        ("render in/report.json -o in", "in/report.json", "report: "),
        ("render in/one.yaml -o in", "in/report.json", ""),
        ("render in/x.yaml -o in --scene x", "in/report.x.json", "x: "),
        ("render in/two.yaml -o in", "in/contact-sheet.png", ""),
        ("render in/moving.yaml -o in", "in/contact-sheet.png", "moving.0001: "),
        ("accuracy in/accuracy.json -o in", "in/accuracy.json", ""),
    ] {
        let bytes = std::fs::read(place.path(file)).unwrap();
        let ran = place.run(&[&arguments.split(' ').collect::<Vec<_>>()[..], &["-q"]].concat());
        let words = format!("error: {label}{file}: expected a place to write to, found a file that is read");
        assert_eq!((ran.err.lines().next(), ran.code), (Some(&*words), 2), "{arguments}");
        assert!(std::fs::read(place.path(file)).unwrap() == bytes, "{arguments}");
        assert_eq!(place.names("in"), before, "{arguments}");
    }
    // One picture has no contact sheet.
    assert_eq!(place.run(&["render", "in/textured.yaml", "-q", "-o", "in"]).code, 0);
}

/// The decoder divided by its width. The other scene of the batch is rendered.
#[test]
fn a_picture_without_pixels_is_refused() {
    let place = batch();
    for size in ["-Y 8 +X 0", "-Y 0 +X 8"] {
        std::fs::write(place.path("scenes/none.hdr"), format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n"))
            .unwrap();
        let lit =
            "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nlights: [{environment: {file: none.hdr}}]\n";
        std::fs::write(place.path("scenes/lit.yaml"), lit).unwrap();
        std::fs::write(place.path("two.yaml"), "scenes: [{file: scenes/lit.yaml}, {file: scenes/good.yaml}]\n")
            .unwrap();
        let ran = place.run(&["render", "two.yaml", "-q", "-o", "two"]);
        assert!(ran.err.contains("none.hdr: expected a picture of one pixel or more, found"), "{}", ran.err);
        assert_eq!(ran.code, 3);
        assert!(place.path("two/good.exr").is_file());
    }
}

/// The pictures were there, and the report, which is JSON, never was.
#[cfg(target_os = "linux")]
#[test]
fn a_scene_whose_name_is_no_text_has_a_report() {
    use std::os::unix::ffi::OsStrExt;
    let place = batch();
    let name = std::ffi::OsStr::from_bytes(b"bad\xff.yaml");
    std::fs::copy(place.path("scenes/good.yaml"), place.path(".").join(name)).unwrap();
    for further in [&[][..], &["--skip-existing"], &["--tile", "0/2"]] {
        let mut command = place.command(&["render", "-q", "-o", "out"]);
        let done = command.arg(name).args(further).output().unwrap();
        assert!(done.status.success(), "{further:?}: {}", String::from_utf8_lossy(&done.stderr));
    }
    let source = place.json("out/report.json")["source"].to_string();
    assert!(source.contains("bad\u{fffd}.yaml"), "{source}");
}

/// The command stands on the page, at whose end it was a panic after all of the work. A job is text, in which such a path was
/// another one.
#[cfg(target_os = "linux")]
#[test]
fn arguments_that_are_no_text_are_shown_or_refused() {
    use std::os::unix::ffi::OsStrExt;
    let place = batch();
    let name = std::ffi::OsStr::from_bytes(b"bad\xff.yaml");
    std::fs::copy(place.path("scenes/good.yaml"), place.path(".").join(name)).unwrap();
    let run = |words: &str| {
        let words: Vec<&str> = words.split(' ').collect();
        let ran = place.command(&words[..1]).arg(name).args(&words[1..]).output().unwrap();
        (String::from_utf8(ran.stderr).unwrap(), ran.status.code())
    };
    let (said, code) = run("accuracy -q -o sheet --set integrator=whitted --set camera.target=[0,0,0]");
    assert_eq!(code, Some(0), "{said}");
    let page = std::fs::read_to_string(place.path("sheet/accuracy.html")).unwrap();
    // As a shell takes it.
    let shown =
        "abbe accuracy 'bad\u{fffd}.yaml' -q -o sheet --set integrator=whitted --set 'camera.target=[0,0,0]'</code>";
    assert!(page.contains(shown), "{page}");
    for format in ["slurm", "openjd"] {
        let (said, code) = run(&format!("farm -q -o job --format {format}"));
        assert!(said.ends_with("bad\u{fffd}.yaml: expected a path in UTF-8, found other bytes\n"), "{said}");
        assert_eq!((said.lines().count(), code), (1, Some(2)), "{said}");
        assert_eq!(place.names("job"), Vec::<String>::new());
    }
}

/// It made a directory of that name.
#[test]
fn merge_refuses_names_of_other_pictures_as_render_does() {
    let place = batch();
    assert_eq!(place.run(&["render", "scenes/good.yaml", "-q", "-o", "parts", "--tile", "0/1"]).code, 0);
    let message =
        "error: -o pic.png: expected a directory or a file name that ends in .exr, beside which the PNG is written\n";
    for verb in [["render", "scenes/good.yaml"], ["merge", "parts"]] {
        let ran = place.run(&[verb[0], verb[1], "-q", "-o", "pic.png"]);
        assert_eq!((ran.err.as_str(), ran.code), (message, 2));
        assert!(!place.path("pic.png").exists());
    }
}

/// What keeps the report from being written does not hide what keeps a scene from being rendered, which is graver.
#[cfg(target_os = "linux")]
#[test]
fn a_report_that_cannot_be_written_hides_nothing() {
    let place = Place::of("scenes: [{file: none.yaml}]\n");
    let ran = place.run(&["render", "scene.yaml", "-q", "--report", "/dev/full"]);
    assert_eq!(ran.code, 3, "{}", ran.err);
    assert!(ran.err.contains("none.yaml") && ran.err.contains("/dev/full"), "{}", ran.err);
}

/// Tiles of more pixels than a thread takes samples of before it looks up: of such a one a step had no sample.
#[test]
fn tiles_may_be_large() {
    let place = Place::of(&format!("{SMALL}{BALL}"));
    let wide = ["image.width=8224", "image.height=257", "render.tile=257", "integrator=none", "render.samples=1"];
    let set: Vec<&str> = wide.iter().flat_map(|setting| ["--set", setting]).collect();
    let ran = place.run(&[&["render", "scene.yaml", "-q", "--threads", "1"], &set[..]].concat());
    assert_eq!(ran.code, 0, "{}", ran.err);
}

/// Pictures whose file says that their colours are others than those that they are taken for are told; numbers are not colours.
#[test]
fn pictures_in_other_colours_are_told() {
    let place = Place::with(&[("a.yaml", &format!("{SMALL}{BALL}"))]);
    assert_eq!(place.run(&["render", "a.yaml", "-q", "-o", "p3.exr", "--set", "output.png.space=display_p3"]).code, 0);
    let told = "textures.t.image.file: p3.png says that its colours are Display P3 (cICP); they are taken for sRGB";
    let said = |raw: &str| {
        let texture = format!("textures={{t: {{image: {{file: p3.png, raw: {raw}}}}}}}");
        let material = "materials={m: {diffuse: {reflectance: {texture: t}}}}";
        let shapes = "shapes=[{sphere: {radius: 1, material: m}}]";
        let ran = place
            .run(&["render", "a.yaml", "-q", "-o", "b.exr", "--set", &texture, "--set", material, "--set", shapes]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        ran.err
    };
    let (colours, numbers) = (said("false"), said("true"));
    assert!(colours.starts_with("note: a: ") && colours.contains(told), "{colours}");
    assert!(!numbers.contains("taken for"), "{numbers}");
}
