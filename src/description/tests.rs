use super::testing::{faults, parse, reference, scene};
use super::*;

#[test]
fn the_reference_scene_is_a_scene() {
    let scene = parse(&reference("scene")).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(scene.shapes.len(), 11);
    assert_eq!(scene.lights.len(), 7);
    assert_eq!(scene.materials.len(), Material::KINDS.len());
    // What the page calls a default is one.
    let bare = testing::scene("");
    assert_eq!(scene.render, bare.render);
    assert_eq!(scene.output, bare.output);
    assert_eq!(scene.integrator, bare.integrator);
    assert_eq!(Image { crop: None, ..scene.image }, bare.image);
}

#[test]
fn the_page_names_what_an_included_file_may_hold() {
    let page = reference("scene");
    let include = page.lines().find(|line| line.starts_with("include: ")).unwrap();
    assert!(edit::SHARED.iter().all(|kind| include.contains(kind)), "{include}");
}

#[test]
fn the_reference_spectra_are_spectra() {
    for line in reference("spectra").lines().skip(1) {
        let spectrum = line.strip_prefix("- ").unwrap();
        scene(&format!("lights:\n- constant:\n    radiance: {spectrum}\n"));
    }
}

#[test]
fn the_reference_frames_are_values() {
    let written = reference("frames");
    let lines: Vec<&str> = written.lines().skip(1).map(|line| line.strip_prefix("- ").unwrap()).collect();
    for (line, radius) in lines.iter().zip([1.75, 3.0, 1.75]) {
        let scene = scene(&format!("render: {{frames: 24}}\nshapes:\n- sphere:\n    radius: {line}\n"));
        let Geometry::Sphere(sphere) = &scene.shapes[0].geometry else { panic!("a sphere") };
        assert_eq!((sphere.radius, scene.frame, scene.render.seed), (radius, Some(24), 24));
    }
}

#[test]
fn the_reference_indices_are_indices() {
    for line in reference("indices").lines().skip(1) {
        let index = line.strip_prefix("- ").unwrap();
        scene(&format!("materials:\n  glass:\n    dielectric:\n      ior: {index}\n"));
    }
}

/// The ends of each are taken, and what is one beyond them is refused; a radius of 0 is, too.
#[test]
fn the_bounds_of_the_page_are_those_of_its_fields() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("s.yaml");
    let fault = |field: &str, number: f64| {
        let kind = field.split('.').nth(2).unwrap_or("");
        let material = match (kind, field.ends_with(".eta")) {
            ("conductor", true) => "{conductor: {eta: 1, k: 1}}",
            ("conductor", false) => "{conductor: {metal: gold, film: {ior: 2, thickness_nm: 1}}}",
            ("principled", _) => "{principled: {}}",
            _ => "{hair: {}}",
        };
        let light = if field.contains("directional") {
            "directional: {direction: [0, -1, 0], irradiance: 1}"
        } else if field.ends_with("elevation_deg") {
            "sky: {sun: {elevation_deg: 0}}"
        } else {
            "sky: {sun: {latitude_deg: 0, longitude_deg: 0}}"
        };
        let camera = testing::CAMERA.replace("fov_deg", "shutter: {open: -0.25, close: 0.25}, fov_deg");
        std::fs::write(
            &file,
            format!("{camera}output: {{spectral: {{bands: 3}}}}\nmaterials: {{a: {material}}}\nlights: [{light}]\n"),
        )
        .unwrap();
        let set = [(field.to_owned(), number.to_string())];
        load(&file).unwrap().entries()[0].scene(&set).err().map(|error| error.to_string())
    };
    for line in reference("bounds").lines().skip(1) {
        let (field, range) = line.split('#').next().unwrap().trim().split_once(": ").unwrap();
        let ends: Vec<f64> = range.trim_matches(['[', ']']).split(", ").map(|number| number.parse().unwrap()).collect();
        for number in [ends[0], ends[1]].into_iter().filter(|number| *number > 0.0 || !field.ends_with("radius")) {
            assert_eq!(fault(field, number), None, "{line}: {number}");
        }
        for number in [ends[0] - 1.0, ends[1] + 1.0] {
            assert!(fault(field, number).is_some(), "{line}: {number}");
        }
    }
}

#[test]
fn a_field_of_the_batch_in_a_scene_is_pointed_out() {
    assert_eq!(
        parse("scens: []").unwrap_err().to_string(),
        "dir/s.yaml:1:1: scens: expected one of include, camera, image, integrator, layers, render, output, textures, \
         volumes, materials, media, groups, shapes, lights, light_groups, assets, medium, fog, \
         scenes, found \"scens\"; did you mean \"scenes\"?"
    );
    assert_eq!(faults("scens: []").matches("scenes").count(), 0);
}
