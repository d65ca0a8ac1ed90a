//! Outside stays outside, and media stay where they are.

use super::{common, exported_with};

/// A tetrahedron whose corners are counterclockwise from outside, with normals of this length, or none.
pub(super) fn tetrahedron(length: &str) -> String {
    let mut text = String::new();
    for [x, y, z] in [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]] {
        text.push_str(&format!("v {} {} {}\n", 0.5 * x, 0.5 * y, 0.5 * z));
        if let Ok(length) = length.parse::<f64>() {
            text.push_str(&format!("vn {} {} {}\n", length * x, length * y, length * z));
        }
    }
    for [a, b, c] in [[1, 2, 3], [1, 4, 2], [1, 3, 4], [2, 4, 3]] {
        let corner = |i: i32| if length.is_empty() { i.to_string() } else { format!("{i}//{i}") };
        text.push_str(&format!("f {} {} {}\n", corner(a), corner(b), corner(c)));
    }
    text
}

/// Outside a body whose outside is not written is what the camera is in; for Mitsuba it would be empty.
#[test]
fn bodies_in_the_fog_of_the_camera_keep_it_around_them() {
    let fog = "media: {fog: {homogeneous: {absorption: 0.4}}, ink: {homogeneous: {absorption: 0.1}}}\nmedium: fog\n\
               lights: [point: {position: [0, 3, 2], intensity: 5}]\n";
    for (more, interior, exterior) in
        [("inside: ink", "ink", "fog"), ("outside: ink, flip_normals: true", "fog", "ink")]
    {
        let ball = format!("sphere: {{center: [0, 0.5, 0], radius: 0.5, material: {{boundary: {{}}}}, {more}}}");
        let (told, xml) = exported_with(fog, &ball);
        assert_eq!(told, [""; 0], "{more}");
        for side in [format!("name=\"interior\" id=\"{interior}\""), format!("name=\"exterior\" id=\"{exterior}\"")] {
            assert!(xml.contains(&side), "{more}: {side} in {xml}");
        }
    }
}

/// What reaches the sides of its grid bounds nothing: it has the same medium on both sides. Of the ball of radius 0.4 in the unit
/// cube one of 0.6 does so.
#[test]
fn an_open_grid_of_distances_keeps_the_fog_of_the_camera_on_both_sides() {
    let directory = tempfile::tempdir().unwrap();
    let fog = "media: {fog: {homogeneous: {absorption: 0.4}}}\nmedium: fog\n\
               lights: [point: {position: [0, 3, 2], intensity: 5}]\n";
    for (name, grown, open) in [("closed.vol", 0.0, false), ("open.vol", 0.2, true)] {
        let mut bytes = common::ball_of_distances();
        for number in bytes[48..].chunks_exact_mut(4) {
            let distance = f32::from_le_bytes([number[0], number[1], number[2], number[3]]) - grown;
            number.copy_from_slice(&distance.to_le_bytes());
        }
        let file = directory.path().join(name);
        common::write(&file, &bytes);
        let grid = format!("sdf_grid: {{file: {}, material: {{boundary: {{}}}}}}", file.display());
        let (_, xml) = exported_with(fog, &grid);
        assert!(xml.contains("name=\"exterior\" id=\"fog\""), "{name}: {xml}");
        assert_eq!(xml.contains("name=\"interior\" id=\"fog\""), open, "{name}: {xml}");
    }
}

/// For Mitsuba the outside of a mesh is where the normals of its file point, if it has any, else where its corners are
/// counterclockwise in the world.
#[test]
fn the_outside_of_a_mesh_is_turned_round_only_where_mitsuba_has_it_on_the_other_side() {
    for (file, how, plain, mirrored) in [
        ("outward.obj", "normals: file", false, false),
        ("outward.obj", "normals: vertex", false, false),
        ("outward.obj", "normals: vertex, winding: world", false, false),
        ("outward.obj", "normals: face", false, true),
        ("outward.obj", "normals: smooth, winding: world", false, true),
        ("inward.obj", "normals: vertex", true, true),
        ("inward.obj", "normals: face", false, true),
        ("inward.obj", "normals: smooth, winding: world", true, false),
        ("bare.obj", "normals: vertex", false, true),
        ("bare.obj", "normals: vertex, winding: world", false, false),
    ] {
        for (x, flipped) in [(1, plain), (-1, mirrored)] {
            let place = format!("transform: [scale: [{x}, 1, 1]]");
            let (_, xml) = exported_with("", &format!("mesh: {{file: {file}, {how}, {place}, emission: 1}}"));
            assert_eq!(xml.contains("name=\"flip_normals\""), flipped, "{file}, {how}, {place}: {xml}");
        }
    }
}

/// What is inside a mesh Mitsuba tells by the order of its corners, whatever its normals say: where that is turned by a mirror, it
/// gets the media the other way round.
#[test]
fn media_stay_inside_of_mirrored_meshes() {
    let ink = "media: {ink: {homogeneous: {absorption: 0.7}}}\n";
    for (file, normals, x, side) in [
        ("outward.obj", "vertex", 1, "interior"),
        ("outward.obj", "vertex", -1, "exterior"),
        ("bare.obj", "vertex", -1, "interior"),
        ("inward.obj", "vertex", 1, "exterior"),
        ("inward.obj", "vertex", -1, "interior"),
    ] {
        let mesh = format!(
            "mesh: {{file: {file}, normals: {normals}, transform: [scale: [{x}, 1, 1]], material: {{boundary: {{}}}}, inside: ink}}"
        );
        let (told, xml) = exported_with(ink, &mesh);
        assert_eq!(told, [""; 0]);
        assert!(xml.contains(&format!("<ref name=\"{side}\" id=\"ink\"/>")), "{mesh}: {xml}");
    }
}
