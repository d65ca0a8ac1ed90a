//! Mesh files for Mitsuba, which reads fewer than are read here.
//!
//! What it refuses (3.9.1): of PLY polygons, lists beside the corners of faces, `obj_info` and what follows the last element; of
//! OBJ numbers that count back, corners before what they name, lines of 1024 bytes, lone texture coordinates and normals of length zero.
//! It reads another mesh from lines of OBJ that go on after a backslash, from concave faces, where a part of the corners has
//! coordinates or normals, and from whole numbers as positions in PLY. A PLY of triangles says all of this. Where a surface is
//! of colours or other numbers of a PLY, it refuses those beside an alpha and takes whole ones for others.

use super::attribute::Element;
use super::{MeshSource, load, obj, ply};
use glam::DVec3;
use std::collections::BTreeSet;
use std::path::Path;

/// A PLY that Mitsuba reads, of mesh `index` of a file that it refuses or takes for another mesh; `None` of files that it reads as
/// they are read here, and of those that cannot be read. Of attributes those that are `asked` for matter.
pub(super) fn for_mitsuba(path: &Path, index: u32, asked: &BTreeSet<&str>) -> Option<Vec<u8>> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    if !["obj", "ply"].contains(&extension.as_str()) {
        return None;
    }
    let source = load(path, index).ok()?;
    let bytes = crate::input::read(path).ok()?;
    let is_plain =
        if extension == "obj" { obj::is_plain(&bytes, &source) } else { ply::is_plain(&bytes, &source, asked) };
    (!is_plain).then(|| binary(&source))
}

/// Whether Mitsuba can make it one of length 1, in f32.
pub(super) fn has_direction(normal: DVec3) -> bool {
    let square = normal.as_vec3().length_squared();
    square.is_normal()
}

/// Whether triangles are a fan about their first corner.
pub(super) fn is_fan(triangles: &[[u32; 3]]) -> bool {
    triangles.windows(2).all(|pair| pair[0][0] == pair[1][0] && pair[0][2] == pair[1][1])
}

/// A mesh as a binary PLY.
fn binary(source: &MeshSource) -> Vec<u8> {
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    let properties = |kind: &str, names: &[&str]| -> String {
        names.iter().map(|name| format!("property {kind} {name}\n")).collect()
    };
    let of = |element: Element| source.attributes.iter().filter(move |attribute| attribute.element == element);
    let named = |element: Element| -> String {
        of(element)
            .flat_map(|attribute| columns(&attribute.name, attribute.channels))
            .map(|name| format!("property float {name}\n"))
            .collect()
    };
    let normals = normals(source);
    header += &format!("element vertex {}\n{}", source.positions.len(), properties("double", &["x", "y", "z"]));
    if !normals.is_empty() {
        header += &properties("double", &["nx", "ny", "nz"]);
    }
    if !source.uvs.is_empty() {
        header += &properties("double", &["u", "v"]);
    }
    header += &named(Element::Vertex);
    header += &format!("element face {}\nproperty list uchar uint vertex_indices\n", source.triangles.len());
    header += &named(Element::Face);
    header += "end_header\n";

    let mut bytes = header.into_bytes();
    let values = |element: Element, i: usize| {
        of(element).flat_map(move |attribute| &attribute.values[i * attribute.channels..][..attribute.channels])
    };
    for (i, position) in source.positions.iter().enumerate() {
        let normal = normals.get(i).map(DVec3::to_array);
        let uv = source.uvs.get(i).map(|uv| uv.to_array());
        let numbers =
            position.to_array().into_iter().chain(normal.into_iter().flatten()).chain(uv.into_iter().flatten());
        numbers.for_each(|number| bytes.extend(number.to_le_bytes()));
        values(Element::Vertex, i).for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    for (i, triangle) in source.triangles.iter().enumerate() {
        bytes.push(3);
        triangle.iter().for_each(|corner| bytes.extend(corner.to_le_bytes()));
        values(Element::Face, i).for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    bytes
}

/// The normals of a file; where a vertex has none, the mean of those of the triangles that it is a corner of, by their areas.
fn normals(source: &MeshSource) -> Vec<DVec3> {
    let mut normals = source.normals.clone();
    let without: Vec<bool> = normals.iter().map(|normal| !has_direction(*normal)).collect();
    if without.contains(&true) {
        for triangle in &source.triangles {
            let [a, b, c] = triangle.map(|v| source.positions[v as usize]);
            for v in triangle.map(|v| v as usize).into_iter().filter(|v| without[*v]) {
                normals[v] += (b - a).cross(c - a);
            }
        }
    }
    normals.into_iter().map(|normal| normal.try_normalize().unwrap_or(DVec3::Z)).collect()
}

/// The properties that an attribute consists of: see [`super::attribute`].
fn columns(name: &str, channels: usize) -> Vec<String> {
    let plain = name.strip_prefix("vertex_").or_else(|| name.strip_prefix("face_")).unwrap_or(name);
    let letters = |stem: &str, letters: [&str; 3]| letters[..channels].iter().map(|l| format!("{stem}{l}")).collect();
    match plain.strip_suffix("_color") {
        None if plain == "color" && channels == 3 => letters("", ["r", "g", "b"]),
        None => letters(&format!("{plain}_"), ["0", "1", "2"]),
        Some(stem) => letters(&format!("{stem}_"), ["r", "g", "b"]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is written in place of a file, and what the file itself holds.
    fn written(name: &str, text: &str) -> (Option<MeshSource>, MeshSource) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let asked = BTreeSet::from(["vertex_color", "vertex_heat"]);
        let bytes = for_mitsuba(&path, 0, &asked);
        if let Some(bytes) = &bytes {
            assert!(ply::is_plain(bytes, &ply::read(bytes).unwrap(), &asked), "{name}: {text}");
        }
        (bytes.map(|bytes| ply::read(&bytes).unwrap()), load(&path, 0).unwrap())
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    /// Mitsuba 3.9.1 refuses the first six, and shows nothing, a filled-in face or what lay in memory of the others.
    #[test]
    fn what_mitsuba_reads_otherwise_of_obj_is_written_anew() {
        let tails = [
            "f -4 -3 -2 -1\n",
            "vt 0.5\nf 1/1 2/1 3/1\n",
            "f 1 2 3 5\nv 0.5 0.5 1\n",
            "vn 0 0 0\nf 1//1 2//1 3//1\n",
            &format!("#{}\nf 1 2 3\n", "x".repeat(1023)),
            "vt 0 1\nf 1/-1 2/-1 3/-1\n",
            "f 1 2 \\\n3 4\n",
            "v 0.8 0.8 0\nf 2 3 4 5\n",
            "vt 0 1\nf 1/1 2/1 3/1\nf 1 3 4\n",
            "vn 0 0 1\nf 1 2 3\n",
        ];
        for tail in tails {
            let (written, read) = written("a.obj", &format!("{SQUARE}{tail}"));
            let written = written.unwrap_or_else(|| panic!("{tail}"));
            assert_eq!((&written.positions, &written.uvs), (&read.positions, &read.uvs), "{tail}");
            assert_eq!(written.triangles, read.triangles, "{tail}");
        }
        assert!(written("a.obj", &format!("\u{feff}{SQUARE}f 1 2 3\n")).0.is_some());
        // Across z; in place of nothing.
        let (square, _) = written("a.obj", &format!("{SQUARE}vn 0 0 0\nf 1//1 2//1 3//1\n"));
        assert_eq!(square.unwrap().normals, [DVec3::Z; 3]);
        let plain = ["f 1 2 3 4\n", "vt 0 1\nvn 0 0 2\nf 1/1/1 2/1/1 3/1/1 # all\n", "o a\ns off\nf 1// 2// 3//\n"];
        for tail in plain {
            assert_eq!(written("a.obj", &format!("{SQUARE}{tail}")).0, None, "{tail}");
        }
    }

    /// Mitsuba 3.9.1 takes byte 128 for 128 and a `ushort` of 30000 for 0.177, and refuses colours of four numbers.
    #[test]
    fn colours_in_bytes_and_beside_an_alpha_are_written_anew_where_they_are_asked_for() {
        let ply = |properties: &str, row: &str| {
            format!(
                "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{properties}\
                 element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0 {row}\n1 0 0 {row}\n0 1 0 {row}\n\
                 3 0 1 2\n"
            )
        };
        let colours = |kind: &str, names: [&str; 3]| names.map(|name| format!("property {kind} {name}\n")).concat();
        let rgb = ["red", "green", "blue"];
        for (properties, row) in [
            (colours("uchar", rgb), "255 128 0"),
            (colours("float", rgb) + "property float alpha\n", "1 0.5 0 1"),
            (colours("float", ["r", "g", "b"]) + "property uchar a\n", "1 0.5 0 255"),
            ("property ushort heat_0\n".to_owned(), "30000"),
        ] {
            let (written, read) = written("a.ply", &ply(&properties, row));
            assert_eq!(written.unwrap_or_else(|| panic!("{properties}")), read, "{properties}");
        }
        for (properties, row) in [
            (colours("float", rgb), "1 0.5 0"),
            (colours("double", rgb) + "property uchar flags\n", "1 0.5 0 7"),
            (colours("uchar", ["mark_r", "mark_g", "mark_b"]) + "property float alpha\n", "255 128 0 1"),
        ] {
            assert_eq!(written("a.ply", &ply(&properties, row)).0, None, "{properties}");
        }
    }

    /// The same of PLY. What more a file says of its vertices and faces is kept under its names.
    #[test]
    fn what_mitsuba_reads_otherwise_of_ply_is_written_anew() {
        let ply = |more: &str, kind: &str, faces: &str, rows: &str| {
            format!(
                "ply\nformat ascii 1.0\n{more}element vertex 4\nproperty {kind} x\nproperty {kind} y\nproperty float z\n\
                 property float r\nproperty float g\nproperty float b\nproperty float heat_0\nelement face {}\n\
                 property list uchar int vertex_index\n{faces}end_header\n0 0 0 1 0 0 4\n1 0 0 1 0 0 3\n1 1 0 1 0 0 2\n\
                 0 1 0 1 0 0 1\n{rows}\n",
                rows.lines().filter(|row| !row.starts_with(' ')).count()
            )
        };
        let paint = "property float paint_r\nproperty float paint_g\nproperty float paint_b\n";
        let (written_anew, read) = written("a.ply", &ply("", "float", paint, "4 0 1 2 3 0.5 0.25 1"));
        assert_eq!(written_anew.unwrap(), read);
        let lists = "property list uchar float texcoord\n";
        for text in [
            ply("", "float", "", "3 0 1 2\n4 0 1 2 3"),
            ply("", "float", lists, "3 0 1 2 6 0 0 1 0 1 1"),
            ply("obj_info by hand\n", "float", "", "3 0 1 2"),
            ply("", "int", "", "3 0 1 2"),
            ply("", "float", "", "3 0 1 2\n 7"),
        ] {
            let (written, read) = written("a.ply", &text);
            assert_eq!(written.unwrap_or_else(|| panic!("{text}")), read, "{text}");
        }
        for text in
            [ply("comment by hand\n", "float", paint, "3 0 1 2 0 0 1"), ply("", "double", "", "3 0 1 2\n3 0 2 3")]
        {
            assert_eq!(written("a.ply", &text).0, None, "{text}");
        }
    }
}
