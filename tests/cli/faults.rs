//! Bad input: each fault with its place, its field and what was expected.

use super::SMALL;
use crate::common::place::Place;

/// Renders the scene of [`SMALL`] and, from line 3, `text`, as `s.yaml`: the error lines and the exit code.
fn faults(text: &str) -> (Vec<String>, i32) {
    let place = Place::with(&[
        ("s.yaml", &format!("{SMALL}{text}\n")),
        ("no_picture.png", "words"),
        ("odd.ply", "ply\nno"),
        ("odd.csv", "wl,n\n0.3,abc\n"),
        ("um.csv", "0.4,0.1\n0.7,0.9\n"),
    ]);
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
            "shapes: [{sphere: {radius: -1e308}}]",
            "s.yaml:3:28: shapes[0].sphere.radius: expected a number greater than 0, found -1e308",
            2,
        ),
        (
            "shapes: [{plane: {normal: [1e308, 0, 2.5]}}]",
            "s.yaml:3:18: shapes[0].plane: normal: expected three numbers up to 1e60, found [1e308, 0, 2.5]",
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
            "textures: {t: {checkerboard: {a: 0, b: 1, uv: [[1e200, 0, 0], [0, 1, 0]], scale: [1e200, 1]}}}",
            "s.yaml:3:30: textures.t.checkerboard: expected a uv, scale and offset that stay within the range of numbers, \
             found a product beyond it",
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
        (
            "shapes: [{sphere: {radius: 1, material: {dielectric: {ior: {file: odd.csv}}}}}]",
            "odd.csv: line 2, column 1: expected 2 numbers, found \"0.3,abc\"; it is named at s.yaml:3:67: \
             shapes[0].sphere.material.dielectric.ior.file",
            3,
        ),
        (
            "lights: [{constant: {radiance: {table: [[0.4, 1], [0.7, 1]]}}}]",
            "s.yaml:3:32: lights[0].constant.radiance: expected wavelengths within 360 to 830 nm, found 0.4 to 0.7 nm \
             (are they in µm?)",
            2,
        ),
        (
            "materials: {m: {mirror: {reflectance: {zero_outside: {table: [[1000, 1], [2000, 1]]}}}}}",
            "s.yaml:3:54: materials.m.mirror.reflectance.zero_outside: expected wavelengths within 360 to 830 nm, found \
             1000 to 2000 nm",
            2,
        ),
        (
            "lights: [{constant: {radiance: {file: um.csv}}}]",
            "um.csv: expected wavelengths within 360 to 830 nm, found 0.4 to 0.7 nm (are they in µm?); it is named at \
             s.yaml:3:32: lights[0].constant.radiance",
            3,
        ),
        (
            "shapes: [{sphere: {radius: 1, material: {two_sided: {front: {dielectric: {ior: 1.5}}}}}}]",
            "s.yaml:3:61: shapes[0].sphere.material.two_sided.front: expected a material that bends no light, found one \
             that does: neither side would be its inside",
            2,
        ),
        (
            "shapes: [{sphere: {radius: 1, material: {two_sided: {front: {thin_dielectric: {ior: 1.5}}, \
             back: {mask: {material: {principled: {spec_trans: 1}}}}}}}}]",
            "s.yaml:3:98: shapes[0].sphere.material.two_sided.back: expected a material that bends no light, found one \
             that does: neither side would be its inside",
            2,
        ),
        (
            "shapes: [{disk: {center: [0, 0, 0], normal: [0, 1, 0], radius: 1, material: {two_sided: {front: {principled_thin: {diff_trans: 1}}, back: {mirror: {}}}}}}]",
            "s.yaml:3:97: shapes[0].disk.material.two_sided.front: expected a material that scatters no light to its other \
             side, found one that does: it has to be the front of both sides, without `back`",
            2,
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
            "no_picture.png: expected a PNG, JPEG, BMP, TGA, PNM, PFM, HDR or EXR picture: ",
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
            "no_picture.png: expected a PNG, JPEG, BMP, TGA, PNM, PFM, HDR or EXR picture: ",
            3,
        ),
    ];
    for (text, beginning, code) in cases {
        let (errors, found) = faults(text);
        assert!(errors.len() == 1 && errors[0].starts_with(beginning) && found == code, "{text}: {errors:?}, {found}");
    }
}

/// Nobody writes to the FIFOs: whoever opened one would wait for ever.
#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_refused() {
    let place = Place::with(&[]);
    let names = ["f.png", "f.exr", "f.obj", "f.vol", "f.txt", "f.csv", "f.yaml", "f.yml", "f.xml"];
    let fifos = names.iter().map(|name| place.path(name));
    assert!(std::process::Command::new("mkfifo").args(fifos).status().unwrap().success());
    std::fs::create_dir(place.path("d.obj")).unwrap();
    let lit = "lights: [{constant: {radiance: 1}}]\n";
    for (text, file, found) in [
        ("textures: {t: {image: {file: f.png}}}", "f.png", "a FIFO"),
        ("lights: [{environment: {file: f.exr}}]", "f.exr", "a FIFO"),
        ("shapes: [{mesh: {file: f.obj}}]", "f.obj", "a FIFO"),
        ("shapes: [{mesh: {file: d.obj}}]", "d.obj", "a directory"),
        ("volumes: {v: {grid: {file: f.vol}}}", "f.vol", "a FIFO"),
        ("shapes: [{curves: {file: f.txt}}]", "f.txt", "a FIFO"),
        ("lights: [{constant: {radiance: {file: f.csv}}}]", "f.csv", "a FIFO"),
        ("include: [f.yaml]", "f.yaml", "a FIFO"),
        ("materials: {m: {dielectric: {ior: {file: f.yml}}}}", "f.yml", "a FIFO"),
    ] {
        let lit = if text.starts_with("lights") { "" } else { lit };
        std::fs::write(place.path("s.yaml"), format!("{SMALL}{lit}{text}\n")).unwrap();
        let ran = place.run(&["render", "s.yaml", "-q", "-o", "out"]);
        let message = format!("expected a regular file, found {found}");
        assert!(ran.err.contains(file) && ran.err.contains(&message), "{text}: {}", ran.err);
        assert_eq!((ran.err.lines().count(), ran.code == 0), (1, false), "{text}: {}", ran.err);
    }
    std::fs::write(place.path("b.yaml"), "scenes: [{file: f.yaml}]").unwrap();
    for arguments in [
        &["render", "f.yaml"][..],
        &["render", "f.xml", "-q"],
        &["render", "b.yaml", "-q"],
        &["compare", "f.exr", "f.exr"],
        &["merge", "f.exr", "-o", "x.exr"],
        &["info", "f.png"],
    ] {
        let ran = place.run(arguments);
        assert!(ran.err.contains("expected a regular file, found a FIFO"), "{arguments:?}: {}", ran.err);
        assert_eq!((ran.err.lines().count(), ran.code), (1, 3), "{arguments:?}: {}", ran.err);
    }
}

/// What another process writes can be read once: a batch, or a scene, which was read again. Tasks of a farm cannot read it at all.
#[cfg(unix)]
#[test]
fn a_batch_or_a_scene_may_come_by_the_standard_input() {
    use crate::common::place::{Ran, pixels};
    let scene = format!("{SMALL}lights: [{{constant: {{radiance: 1}}}}]\n");
    let place = Place::with(&[("s.yaml", &scene)]);
    let piped = |text: &str, arguments: &str| {
        let mut command = std::process::Command::new("sh");
        command.args(["-c", &format!("{text} | \"$0\" {arguments}"), env!("CARGO_BIN_EXE_abbe")]);
        Ran::of(command.current_dir(place.directory.path()).output().unwrap())
    };
    let batch = "echo \"scenes: [{file: $PWD/s.yaml}]\"";
    assert_eq!(piped(batch, "render /dev/stdin -q -o out").code, 0);
    assert_eq!(place.names("out"), ["report.json", "s.exr", "s.png"]);
    let ran = piped("cat s.yaml", "render /dev/stdin -q -o alone");
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
    assert_eq!(place.names("alone"), ["report.json", "stdin.exr", "stdin.png"]);
    assert!(pixels(&place.path("alone/stdin.exr")) == pixels(&place.path("out/s.exr")));
    let ran = piped(batch, "farm /dev/stdin --format slurm -o job");
    assert!(ran.code == 3 && ran.err.contains("expected a file that tasks can read"), "{}", ran.err);
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
            "s.yaml:1:9: camera.up: expected a direction across the line of sight, found [0, 1, 0], which is parallel to it",
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
    let ran = place.run(&["render", "s.yaml", "--spp", "4000000000"]);
    let expected = "invalid value '4000000000' for '--spp <N>': 4000000000 is not in 1..=134217728";
    assert!(ran.err.contains(expected) && ran.code == 2, "{}", ran.err);
    assert_eq!(place.run(&["render", "s.yaml", "--set", "fog"]).code, 2);
}

/// What nobody has is no matter of what Mitsuba can express: stand-ins were written, and called that.
#[test]
fn what_cannot_be_rendered_is_not_exported() {
    for (shape, code) in [
        ("sphere: {radius: 1, material: {dielectric: {ior: {glass: N-SF99}}}}", 2),
        ("sphere: {radius: 1, material: {conductor: {metal: Goldd}}}", 2),
        ("mesh: {file: none.ply}", 3),
    ] {
        let place = Place::with(&[("s.yaml", &format!("{SMALL}shapes: [{shape}]\n"))]);
        let [plan, export] =
            [&["plan", "s.yaml"][..], &["export", "s.yaml", "-o", "s.xml"]].map(|args| place.run(args));
        assert_eq!(export.code, code, "{shape}: {}", export.err);
        assert_eq!(export.err, plan.err, "{shape}");
        assert_eq!(place.names("."), ["s.yaml"], "{shape}");
    }
}

/// A lamp without a name is called by its kind and number; a group would take it in with one that is given that name.
#[test]
fn no_lamp_is_called_as_one_without_a_name_is() {
    let lamp = |name: &str| format!("- point: {{position: [0, 5, 0], intensity: 1{name}}}\n");
    let lights = format!("lights:\n{}{}", lamp(", name: point1"), lamp(""));
    let (found, code) = faults(&format!("{lights}light_groups: {{key: [point1]}}\n"));
    let expected = "lights[0].point.name: expected a name of its own, found \"point1\", which lights[1] has, since it has no other";
    assert!(code == 2 && found.len() == 1 && found[0].contains(expected), "{found:?}");
    let apart = format!("{SMALL}{lights}light_groups: {{key: [point1]}}\n").replace("name: point1", "name: point0");
    assert_eq!(Place::of(&apart).run(&["plan", "scene.yaml"]).code, 0);
}

/// What the file of a picture cannot hold is told before the render, as a fault of the description.
#[test]
fn channels_that_clash_are_refused_before_the_work() {
    let lamp = "shapes: [{sphere: {radius: 1, name: lamp, emission: 1}}]\n";
    let group = format!("{lamp}light_groups: {{key: [lamp]}}\n");
    let cases = [
        (group + "layers: [{name: light_key, surface: albedo}, light_groups]\n", "`light_key.B` is there"),
        (
            "output: {exr: {stderr: true}}\nlayers: [{name: stderr, surface: albedo}]\n".into(),
            "`stderr.B` is there twice",
        ),
        (
            "layers: [{name: CryptoObject07, light: path, form: rgba}, crypto_object]\n".into(),
            "`CryptoObject07` has a name of the mattes",
        ),
        ("layers: [{name: x, light: path, squares: true, squares_name: x}]\n".into(), "`x.A` is there twice"),
        ("layers: [{name: x, light: path, squares: true}, {name: m2_x, light: path}]\n".into(), "`m2_x.A` is there"),
    ];
    for (text, expected) in cases {
        let place = Place::of(&format!("{SMALL}{text}"));
        let ran = place.run(&["render", "scene.yaml", "-q"]);
        assert_eq!(ran.code, 2, "{expected}");
        assert!(ran.err.contains("layers: expected a file that can be written: "), "{}", ran.err);
        assert!(ran.err.contains(expected) && ran.err.contains("scene.yaml:"), "{}", ran.err);
        assert!(place.names("out").iter().all(|name| name == "report.json"));
    }
    let (found, code) = faults("output: {exr: {attributes: {\"a\\0b\": 1}}}\n");
    assert!(code == 2 && found[0].contains("expected a name without a zero byte"), "{found:?}");
}

#[test]
fn a_band_outside_of_what_is_rendered_is_told_once() {
    let bands = |table: &str| format!("height: 4, bands: [{{name: b, response: {{table: {table}}}}}]");
    for (table, told) in [
        ("[[0.4, 1], [0.7, 1]]", "expected wavelengths within 360 to 830 nm, found 0.4 to 0.7 nm (are they in µm?)"),
        ("[[400, 0], [700, 0]]", "expected a response within 360 to 830 nm, found none"),
    ] {
        let place = Place::of(&SMALL.replace("height: 4", &bands(table)));
        let ran = place.run(&["render", "scene.yaml", "-q"]);
        assert!(ran.err.contains(&format!("image.bands[0].response: {told}")), "{}", ran.err);
        assert_eq!((ran.err.lines().count(), ran.code), (1, 2), "{}", ran.err);
    }
}

#[test]
fn a_picture_larger_than_memory_is_refused_at_its_field() {
    let place = Place::of(&SMALL.replace("width: 4, height: 4", "width: 65536, height: 65536"));
    let ran = place.run(&["render", "scene.yaml", "-q"]);
    assert!(ran.err.contains("scene.yaml:2:16: image.width: expected a picture that fits into memory"), "{}", ran.err);
    assert_eq!(ran.code, 2);
    let ran = place.run(&["render", "scene.yaml", "-q", "--memory-limit", "1G"]);
    assert!(ran.err.contains("more than --memory-limit, 1024 MiB"), "{}", ran.err);
    assert_eq!(ran.code, 33);
    let ran = place.run(&["render", "scene.yaml", "-q", "--set", "image={width: 9, height: 9, overscan: 16384}"]);
    assert!(ran.err.contains("image.overscan: expected a picture that fits into memory"), "{}", ran.err);
}

/// What the scene names is not there: it is not even looked for. Lamps in mirrors were searched, for a minute, in what has no room.
#[test]
fn a_picture_larger_than_memory_is_refused_before_the_scene_is_made_ready() {
    let large = SMALL.replace("width: 4, height: 4", "width: 65536, height: 65536");
    let place = Place::of(&format!("{large}shapes: [mesh: {{file: none.obj}}]\n"));
    for (more, told, code) in [
        (&[][..], "image.width: expected a picture that fits into memory", 2),
        (&["--tile", "1/2"], "image.width: expected a picture that fits into memory", 2),
        (&["--memory-limit", "1G"], "more than --memory-limit, 1024 MiB", 33),
        (&["--set", "image={width: 4, height: 4}"], "none.obj", 3),
    ] {
        let ran = place.run(&[&["render", "scene.yaml", "-q", "-o", "out"], more].concat());
        assert!(ran.err.contains(told) && ran.code == code, "{}", ran.err);
    }
    assert!(!place.path("out").exists());
}

/// A name that is too long for a file, or for what stands beside it on the way, is told before the work.
#[cfg(unix)]
#[test]
fn a_name_too_long_for_a_file_is_refused_before_the_work() {
    let place = Place::of(SMALL);
    for (letters, code) in [(228, 0), (248, 1), (300, 1)] {
        let name = format!("out/{}.exr", "n".repeat(letters));
        let ran = place.run(&["render", "scene.yaml", "-q", "-o", &name, "--spp", "4"]);
        assert_eq!(ran.code, code, "{}", ran.err);
        assert!(code == 0 || ran.err.contains("the name is too long"), "{}", ran.err);
    }
}

/// Radiance of 5 in a picture is shown where it is light, by itself or in a board, and refused where it is to reflect. The
/// luminance of a path is no more uncertain than it is large: four deviations of 16 × 16 samples.
#[test]
fn a_picture_above_one_is_light_and_no_reflectance() {
    let place = Place::with(&[]);
    exr::prelude::write_rgb_file(place.path("lamp.exr"), 4, 2, |_, _| (5.0f32, 5.0f32, 5.0f32)).unwrap();
    let scene = |of: &str| {
        let textures =
            "{lamp: {image: {file: lamp.exr}}, board: {checkerboard: {a: {texture: lamp}, b: {texture: lamp}}}}";
        let text = format!(
            "{SMALL}textures: {textures}\n\
             output: {{exr: {{precision: float, channels: luminance}}}}\nrender: {{samples: 16}}\n\
             shapes: [{{rectangle: {{corner: [-9, -9, 0], edge_u: [18, 0, 0], edge_v: [0, 18, 0], {of}}}}}]\n"
        );
        std::fs::write(place.path("s.yaml"), text).unwrap();
        place.run(&["render", "s.yaml", "-q", "-o", "out.exr"])
    };
    for name in ["lamp", "board"] {
        let ran = scene(&format!("emission: {{texture: {name}}}"));
        assert_eq!(ran.code, 0, "{}", ran.err);
        let (_, light) = crate::common::place::pixels(&place.path("out.exr")).swap_remove(0);
        let mean = light.iter().map(|bits| f64::from(f32::from_bits(*bits))).sum::<f64>() / light.len() as f64;
        assert!((mean - 5.0).abs() < 4.0 * 5.0 / 16.0, "{name}: {mean}");
        let ran = scene(&format!(
            "emission: {{texture: {name}}}, material: {{diffuse: {{reflectance: {{texture: {name}}}}}}}"
        ));
        let told = "lamp.exr: expected reflectances from 0 to 1, found 5 at (0, 0); it is named at s.yaml:6:";
        assert!(ran.code == 3 && ran.err.contains(told), "{name}: {}", ran.err);
    }
}
