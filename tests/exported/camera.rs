//! The camera, its film, and what is taken with it.

use super::{Folder, exported, told};
use abbe::batch::{self, Overrides};
use abbe::description::{Exported, Integrator, SceneDescription};
use std::path::Path;

/// A ball under an even sky, and `more`.
fn ball(more: &str) -> String {
    let camera =
        if more.contains("camera: ") { "" } else { "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n" };
    format!(
        "{camera}integrator: {{path: {{opaque_sky: true}}}}\nshapes: [sphere: {{radius: 1}}]\n\
         lights: [constant: {{radiance: 0.5}}]\n{more}\n"
    )
}

/// The scene of a file, whose parameters have these values.
fn scene_of(file: &Path, define: &[(&str, &str)]) -> SceneDescription {
    let define = define.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    let overrides = Overrides { define, ..Overrides::default() };
    let entry = batch::entries(file, &overrides).unwrap_or_else(|error| panic!("{error}")).remove(0);
    entry.scene(&overrides.set).unwrap_or_else(|error| panic!("{error}"))
}

/// A scene, its export, and what is read of that with these values of its parameters.
fn there_and_back(scene: &str, define: &[(&str, &str)]) -> (SceneDescription, Exported, SceneDescription) {
    let folder = Folder::new();
    folder.write(scene);
    let ours = scene_of(&folder.yaml, &[]);
    let xml = folder.directory.path().join("s.xml");
    let exported = exported(&ours, &xml);
    std::fs::write(&xml, &exported.xml).unwrap();
    let theirs = scene_of(&xml, define);
    (ours, exported, theirs)
}

/// `spp` is a parameter of the file for both; all else of `render` comes back beside it.
#[test]
fn the_parameter_of_the_file_says_how_many_samples_are_taken() {
    for (render, samples) in [
        ("", 64),
        ("render: {seed: 3, samples: 16, tile: 16}", 16),
        ("render: {samples: 16, stop: {samples: 5}}", 5),
        ("render: {samples: 16, stop: {samples: 5, error: 0.1}}", 5),
    ] {
        let scene = ball(render);
        let (ours, exported, theirs) = there_and_back(&scene, &[]);
        assert_eq!(ours.render.most_samples(), samples);
        assert_eq!(theirs.render.most_samples(), samples, "{}", exported.xml);
        assert_eq!((ours.render.seed, ours.render.tile), (theirs.render.seed, theirs.render.tile));
        assert_eq!(ours.render.stop.error, theirs.render.stop.error);
        let (_, exported, other) = there_and_back(&scene, &[("spp", "3")]);
        assert_eq!(other.render.samples, 3, "{}", exported.xml);
        if ours.render.stop.error.is_none() {
            assert_eq!(other.render.most_samples(), 3, "{}", exported.xml);
        }
    }
}

/// Mitsuba wants a near plane above 0, a far one beyond it, and of both what 32-bit floats hold; with 1e-4 scenes of a tenth of a
/// millimetre are cut, and with 1e8 those of the size of planets.
#[test]
fn a_camera_sees_there_from_where_to_where_it_sees_here() {
    for (clip, near, far, is_exact) in [
        ("", "0.000000000001", "1000000000000000000000000000000", false),
        ("{near: 0, far: 1}", "0.000000000001", "1", false),
        ("{near: 0, far: 2e-11}", "0.00000000000002", "0.00000000002", false),
        ("{near: 0.25}", "0.25", "1000000000000000000000000000000", false),
        ("{near: 1, far: 1e9}", "1", "1000000000", true),
        ("{near: 1, far: 1e50}", "1", "1000000000000000000000000000000", false),
    ] {
        let clip = if clip.is_empty() { String::new() } else { format!(", clip: {clip}") };
        for more in ["fov_deg: 40", "orthographic_height: 2"] {
            let camera = format!("camera: {{origin: [0, 0, 5], target: [0, 0, 0], {more}{clip}}}");
            let (ours, exported, theirs) = there_and_back(&ball(&camera), &[]);
            assert_eq!(ours.camera.clip, theirs.camera.clip, "{}", exported.xml);
            for (name, value) in [("near_clip", near), ("far_clip", far)] {
                let said = format!("<float name=\"{name}\" value=\"{value}\"/>");
                assert!(exported.xml.contains(&said), "{said}: {}", exported.xml);
            }
            assert_eq!(exported.xml.contains("set camera.clip"), !is_exact, "{}", exported.xml);
        }
    }
}

/// A channel of Mitsuba's `specfilm` is a parameter of it, and `W` its weights: it refuses a second one. What has no name is `_arg_0`.
#[test]
fn bands_that_are_called_as_what_the_film_has_are_called_otherwise_there() {
    let names = ["height", "W", "band W", "_arg_0", "sample_border", "compensate", "size", "R"];
    let there =
        ["band height", "band band W", "band W", "band _arg_0", "band sample_border", "band compensate", "size", "R"];
    let bands = names.map(|name| format!("{{name: {name}, response: {{table: [[400, 1], [500, 0.5]]}}}}")).join(", ");
    let (ours, exported, theirs) = there_and_back(&ball(&format!("image: {{bands: [{bands}]}}")), &[]);
    let called = |scene: &SceneDescription| scene.image.bands.iter().map(|band| band.name.clone()).collect::<Vec<_>>();
    assert_eq!(called(&ours), names);
    assert_eq!(called(&theirs), names, "{}", exported.xml);
    let mut losses = Vec::new();
    for (i, (name, there)) in names.iter().zip(there).enumerate() {
        assert!(
            exported.xml.contains(&format!("<spectrum name=\"{there}\" value=\"400:1, 500:0.5\"/>")),
            "{}",
            exported.xml
        );
        if *name != there {
            losses.push(format!("image.bands[{i}].name: {there:?}: Mitsuba's film has another use for this name"));
        }
    }
    assert_eq!(told(&exported), losses);
}

/// The words are the same; to read them back is to read the instruction.
#[test]
fn pixels_hold_there_what_they_hold_here() {
    for channels in ["rgba", "rgb", "xyza", "xyz", "luminance_alpha", "luminance"] {
        let (ours, exported, theirs) =
            there_and_back(&ball(&format!("output: {{exr: {{channels: {channels}}}}}")), &[]);
        assert!(
            exported.xml.contains(&format!("<string name=\"pixel_format\" value=\"{channels}\"/>")),
            "{}",
            exported.xml
        );
        assert_eq!(ours.output, theirs.output);
        assert_eq!(exported.losses, []);
    }
}

/// Its numbers are linear Rec. 709, where ours are of another space: that of a red wall is 0.46 for the 0.47 of ACEScg. What is no red,
/// green and blue has no such space.
#[test]
fn colours_of_another_space_are_told() {
    let told_of = |output: &str| {
        let (ours, exported, theirs) = there_and_back(&ball(&format!("output: {{{output}}}")), &[]);
        assert_eq!(ours.output, theirs.output);
        told(&exported)
    };
    let lost = ["output.colour: rec709: Mitsuba's film has no other red, green and blue"];
    for colour in ["acescg", "aces2065-1", "rec2020", "p3", "xyz"] {
        assert_eq!(told_of(&format!("colour: {colour}")), lost);
    }
    assert_eq!(told_of("colour: acescg, exr: {channels: rgb}"), lost);
    assert_eq!(told_of("colour: rec709"), [""; 0]);
    assert_eq!(told_of("colour: rec2020, exr: {channels: luminance}"), [""; 0]);
}

/// Mitsuba 3.9.1's `volpath` without depth has an empty picture, but alpha 1 where lamps that are not hidden are around it. Layers are
/// told.
#[test]
fn a_picture_of_nothing_is_one_there() {
    for more in ["", "media: {smoke: {homogeneous: {scattering: 1}}}\n"] {
        let scene = ball(more).replace("{path: {opaque_sky: true}}", "none");
        let (ours, exported, theirs) = there_and_back(&scene, &[]);
        assert!(matches!(ours.integrator, Integrator::None(_)));
        assert_eq!(ours.integrator, theirs.integrator, "{}", exported.xml);
        assert_eq!(exported.losses, []);
        for said in ["type=\"volpath\"", "name=\"max_depth\" value=\"0\"", "name=\"hide_emitters\" value=\"true\""] {
            assert!(exported.xml.contains(said), "{said}: {}", exported.xml);
        }
    }
    let layers = "layers: [{name: nn, surface: shading_normal}, {name: d, light: {path: {max_depth: 2}}}]";
    let (ours, exported, theirs) = there_and_back(&ball(layers), &[]);
    assert_eq!(told(&exported), ["layers: the picture alone: layers are not written for Mitsuba"]);
    assert_eq!(ours.layers, theirs.layers);
}
