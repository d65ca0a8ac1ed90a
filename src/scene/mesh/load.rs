//! Mesh files by their extension.

use super::{MeshSource, obj, ply, serialized};
use crate::error::{Error, Result};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Reads a Wavefront OBJ (`.obj`), a PLY (`.ply`; text or binary of either byte order) or mesh `index` of
/// a `.serialized` file. Polygons become fans of triangles about their first corner, concave ones other triangles where that
/// does not fit.
///
/// # Errors
/// [`Error::Input`] with what is wrong: missing or truncated file, unknown extension, no
/// triangles, index out of range, number that is not finite.
pub fn load(path: &Path, index: u32) -> Result<MeshSource> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    if index > 0 && extension != "serialized" {
        return Err(Error::input(path, format!("expected index 0 for a file of one mesh, found {index}")));
    }
    let read = |bytes: &[u8]| match extension.as_str() {
        "obj" => obj::read(bytes),
        "ply" => ply::read(bytes),
        "serialized" => serialized::read(bytes, index),
        other => Err(format!("expected a mesh (.obj, .ply or .serialized), found extension \"{other}\"")),
    };
    let bytes = match extension.as_str() {
        // Unknown kinds are not even opened.
        "obj" | "ply" | "serialized" => {
            crate::input::read(path).map_err(|e| Error::input(path, format!("cannot read: {e}")))?
        }
        _ => Vec::new(),
    };
    let source = read(&bytes).map_err(|message| Error::input(path, message))?;
    source.check().map_err(|message| Error::input(path, message))?;
    Ok(source)
}

/// Mesh files that are read once, however often a scene names them.
#[derive(Debug, Default)]
pub struct Sources {
    read: HashMap<(PathBuf, u32), Arc<MeshSource>>,
}

impl Sources {
    /// What was read before.
    #[must_use]
    pub fn from_known<'a>(known: impl Iterator<Item = (&'a Path, u32, Arc<MeshSource>)>) -> Sources {
        Sources { read: known.map(|(path, index, source)| ((path.to_path_buf(), index), source)).collect() }
    }

    /// These and all others of `wanted` that can be read, read on the current rayon pool.
    #[must_use]
    pub fn and<'a>(mut self, wanted: impl Iterator<Item = (&'a Path, u32)>) -> Sources {
        let distinct: BTreeSet<(&Path, u32)> =
            wanted.filter(|&(path, index)| self.known(path, index).is_none()).collect();
        let distinct: Vec<(&Path, u32)> = distinct.into_iter().collect();
        let read = distinct.into_par_iter();
        let read: Vec<_> = read
            .filter_map(|(path, index)| Some(((path.to_path_buf(), index), Arc::new(load(path, index).ok()?))))
            .collect();
        self.read.extend(read);
        self
    }

    /// Shows each file and index with what was read.
    pub fn each(&self, mut show: impl FnMut(&Path, u32, &Arc<MeshSource>)) {
        self.read.iter().for_each(|((path, index), source)| show(path, *index, source));
    }

    /// What was read from mesh `index` of `path`, if it was.
    #[must_use]
    pub fn known(&self, path: &Path, index: u32) -> Option<&MeshSource> {
        self.read.get(&(path.to_path_buf(), index)).map(|source| &**source)
    }

    /// [`load`], or what it gave before.
    ///
    /// # Errors
    /// As [`load`].
    pub fn load(&mut self, path: &Path, index: u32) -> Result<Arc<MeshSource>> {
        let key = (path.to_path_buf(), index);
        if let Some(known) = self.read.get(&key) {
            return Ok(known.clone());
        }
        let source = Arc::new(load(path, index)?);
        self.read.insert(key, source.clone());
        Ok(source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};

    fn read(name: &str, bytes: &[u8]) -> Result<MeshSource> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        load(&path, 0)
    }

    /// The message, without the path that stands before it.
    fn fault(name: &str, bytes: &[u8]) -> String {
        match read(name, bytes) {
            Err(Error::Input { message, .. }) => message,
            other => panic!("expected an input error, found {other:?}"),
        }
    }

    const QUAD_OBJ: &str = "# a quad and a triangle\nmtllib none.mtl\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1e-3 0.1\n\
        vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 2\no thing\nusemtl any\nf 1/1/1 2/2/1 \\\n 3/3/1 4/1/1\ns off\nf -4//1 -3//1 -2//1\n";

    /// The corners 1/1, 2/2, 3/3, 4/1 and, without texture coordinates, 1, 2, 3: seven vertices.
    #[test]
    fn obj_quads_relative_indices_and_separate_lists_are_read() {
        let mesh = read("a.OBJ", QUAD_OBJ.as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
        assert_eq!(mesh.positions[3], DVec3::new(0.0, 1e-3, 0.1));
        assert_eq!(mesh.positions[5], DVec3::X);
        assert_eq!(mesh.uvs[..4], [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::ZERO]);
        assert_eq!(mesh.normals, [2.0 * DVec3::Z; 7]);
    }

    /// A U of eight corners, 2.08 m², and an arrowhead of four, 0.4 m², by both readers.
    #[test]
    fn concave_faces_are_not_filled_in() {
        let u =
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [0.6, 1.0], [0.6, -0.6], [-0.6, -0.6], [-0.6, 1.0], [-1.0, 1.0]];
        let arrow = [[-1.0, -1.0], [0.0, 0.6], [1.0, -1.0], [0.0, 1.0]];
        for (corners, expected) in [(&u[..], 2.08), (&arrow, 0.4)] {
            let n = corners.len();
            let point = |start: &str, [x, y]: &[f64; 2]| format!("{start}{x} {y} 0\n");
            let list = |first: usize| (first..first + n).map(|i| i.to_string()).collect::<Vec<_>>().join(" ");
            let obj: String = corners.iter().map(|c| point("v ", c)).collect();
            let ply: String = corners.iter().map(|c| point("", c)).collect();
            let header = format!(
                "ply\nformat ascii 1.0\nelement vertex {n}\nproperty double x\nproperty double y\nproperty double z\n\
                 element face 1\nproperty list uchar int vertex_indices\nend_header\n"
            );
            for (name, text) in
                [("a.obj", format!("{obj}f {}\n", list(1))), ("a.ply", format!("{header}{ply}{n} {}\n", list(0)))]
            {
                let mesh = read(name, text.as_bytes()).unwrap();
                let area = |t: &[u32; 3]| {
                    let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                    0.5 * (b - a).cross(c - a).length()
                };
                let found: f64 = mesh.triangles.iter().map(area).sum();
                assert!((found - expected).abs() < 1e-14 && mesh.triangles.len() == n - 2, "{name}: {found}");
            }
        }
    }

    #[test]
    fn obj_faults_name_the_line() {
        let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for (tail, expected) in [
            ("f 1 2 4\n", "line 4: face names vertex 4, but the file has 3"),
            ("f 1 2 0\n", "line 4: expected a corner like 1, 1/2, 1//3 or 1/2/3, found \"0\""),
            ("f 1 2 -4\n", "line 4: expected a corner like 1, 1/2, 1//3 or 1/2/3, found \"-4\""),
            ("f 1/1 2/1 3/1\n", "line 4: face names texture coordinate 1, but the file has 0"),
            ("f 1 2\n", "line 4: expected a face of 3 or more corners, found 2"),
            ("v 1.#INF 0 0\n", "line 4: expected a finite number, found \"1.#INF\""),
            ("f 1 2 x\n", "line 4: expected a corner like 1, 1/2, 1//3 or 1/2/3, found \"x\""),
            (
                "f 1 2 99999999999999999999\n",
                "line 4: expected a corner like 1, 1/2, 1//3 or 1/2/3, found \"99999999999999999999\"",
            ),
            ("v nan 0 0\n", "line 4: expected a finite number, found \"nan\""),
            ("v 1 2\n", "line 4: expected 3 numbers, found 2"),
            ("", "the mesh has no triangles"),
        ] {
            assert_eq!(fault("a.obj", format!("{vertices}{tail}").as_bytes()), expected);
        }
    }

    const HEADER: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty double s\n\
        property uchar t\nelement edge 1\nproperty int a\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";

    /// The same quad in the three encodings.
    fn quad(format: &str) -> Vec<u8> {
        let mut out = format!("ply\nformat {format} 1.0\ncomment a quad\n{HEADER}").into_bytes();
        if format == "ascii" {
            out.extend(b"0 0 0 0.1 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0.5 0 1\n7\n4 0 1 2 3\n");
            return out;
        }
        let big = format == "binary_big_endian";
        let mut put = |bytes: &[u8]| if big { out.extend(bytes) } else { out.extend(bytes.iter().rev()) };
        for (p, s, t) in [
            ([0f32, 0.0, 0.0], 0.1, 0u8),
            ([1.0, 0.0, 0.0], 1.0, 0),
            ([1.0, 1.0, 0.0], 1.0, 1),
            ([0.0, 1.0, 0.5], 0.0, 1),
        ] {
            p.iter().for_each(|x| put(&x.to_be_bytes()));
            put(&f64::to_be_bytes(s));
            put(&[t]);
        }
        put(&7i32.to_be_bytes());
        put(&[4]);
        (0..4i32).for_each(|i| put(&i.to_be_bytes()));
        out
    }

    #[test]
    fn ply_is_read_in_all_three_encodings() {
        let expected = MeshSource {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, 1.0, 0.5)],
            normals: Vec::new(),
            uvs: vec![DVec2::new(0.1, 0.0), DVec2::X, DVec2::ONE, DVec2::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            attributes: Vec::new(),
        };
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            assert_eq!(read("a.ply", &quad(format)).unwrap(), expected, "{format}");
        }
    }

    /// A quad whose vertices and faces carry numbers; the quad's colour goes to both of its triangles.
    #[test]
    fn ply_attributes_are_kept() {
        let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            property float heat_0\nproperty float u\nproperty float v\nelement face 1\n\
            property list uchar int vertex_index\nproperty uchar r\nproperty uchar g\nproperty uchar b\nend_header\n\
            0 0 0 1.5 0 0\n1 0 0 2 1 0\n1 1 0 3 1 1\n0 1 0 4 0 1\n4 0 1 2 3 255 0 255\n";
        let mesh = read("a.ply", text.as_bytes()).unwrap();
        let named: Vec<(&str, usize, &[f32])> =
            mesh.attributes.iter().map(|a| (a.name.as_str(), a.channels, a.values.as_slice())).collect();
        assert_eq!(
            named,
            [
                ("vertex_heat", 1, [1.5, 2.0, 3.0, 4.0].as_slice()),
                ("face_color", 3, [1.0, 0.0, 1.0, 1.0, 0.0, 1.0].as_slice()),
            ]
        );
        assert_eq!(mesh.uvs[2], DVec2::ONE);
        let message = fault("a.ply", text.replace("1.5", "nan").as_bytes());
        assert!(message.contains("attribute vertex_heat of number 0 is NaN"), "{message}");
    }

    /// A colour in whole numbers is a share of the greatest that their type holds, to the rounding of f32.
    #[test]
    fn ply_colours_are_shares_of_their_type() {
        for (kind, most) in [
            ("char", "127"),
            ("uchar", "255"),
            ("short", "32767"),
            ("ushort", "65535"),
            ("int", "2147483647"),
            ("uint", "4294967295"),
            ("long", "9223372036854775807"),
            ("ulong", "18446744073709551615"),
            ("float", "1"),
            ("double", "1"),
        ] {
            let text = format!(
                "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                 element face 1\nproperty list uchar int vertex_index\nproperty {kind} r\nproperty {kind} g\n\
                 property {kind} b\nend_header\n0 0 0\n1 0 0\n1 1 0\n3 0 1 2 {most} 0 {most}\n"
            );
            let colours = read("a.ply", text.as_bytes()).unwrap().attributes.remove(0).values;
            assert!(colours.len() == 3 && colours[1] == 0.0, "{kind}: {colours:?}");
            assert!([colours[0], colours[2]].iter().all(|c| (c - 1.0).abs() <= f32::EPSILON), "{kind}: {colours:?}");
        }
    }

    /// Two triangles of a quad with coordinates at their corners, which agree at vertex 0 alone: vertex 2 becomes two, with all that
    /// it has. A face may have none.
    #[test]
    fn ply_corners_may_have_coordinates_of_their_own() {
        let head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            property float heat_0\nelement face 2\nproperty list uchar int vertex_index\nproperty list uchar float texcoord\n\
            end_header\n0 0 0 1.5\n1 0 0 2\n1 1 0 3\n0 1 0 4\n";
        let of = |faces: &str| format!("{head}{faces}");
        let faces = "3 0 1 2 6 0.5 0 1 0 1 1\n3 0 2 3 6 0.5 0 0.25 0.75 0 1\n";
        let mesh = read("a.ply", of(faces).as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 4, 3]]);
        assert_eq!(mesh.positions[4], mesh.positions[2]);
        assert_eq!(mesh.uvs, [[0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.25, 0.75]].map(DVec2::from_array));
        assert_eq!(mesh.attributes[0].values, [1.5, 2.0, 3.0, 4.0, 3.0]);
        let mesh = read("a.ply", of("3 0 1 2 6 0.5 0 1 0 1 1\n3 0 2 3 0\n").as_bytes()).unwrap();
        assert_eq!(
            (mesh.triangles[1], mesh.uvs[4], mesh.uvs[5], mesh.uvs[3]),
            ([4, 5, 3], DVec2::ZERO, DVec2::ZERO, DVec2::ZERO)
        );
        let says = |faces: &str| fault("a.ply", of(faces).as_bytes());
        let message = says("3 0 1 2 4 0.5 0 1 0\n3 0 2 3 0\n");
        assert!(
            message.contains("face 0: expected u and v of each corner, found 3 corners and 4 numbers"),
            "{message}"
        );
        let message = says("3 0 1 2 6 0.5 0 1 0 1 nan\n3 0 2 3 0\n");
        assert!(message.contains("face 0: texcoord: expected finite numbers, found NaN"), "{message}");
        assert!(says("3 0 1 9 6 0.5 0 1 0 1 1\n3 0 2 3 0\n").contains("names vertex 9"));
    }

    #[test]
    fn every_truncation_of_a_ply_is_an_error() {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let whole = quad(format);
            // The last byte of the text is a line break, which may be absent.
            for len in 0..whole.len() - 1 {
                let message = fault("a.ply", &whole[..len]);
                assert!(!message.contains('\n'), "{message}");
            }
        }
    }

    #[test]
    fn ply_faults_are_told() {
        let text = String::from_utf8(quad("ascii")).unwrap();
        for (from, to, expected) in [
            ("4 0 1 2 3", "4 0 1 2 9", "triangle 1 names vertex 9, but there are only 4 (counted from 0)"),
            ("4 0 1 2 3", "4 0 1 2 -1", "face 0: expected the number of a vertex, from 0, found -1"),
            ("4 0 1 2 3", "4 0 1 1.5 3", "face 0: expected the number of a vertex, from 0, found 1.5"),
            ("4 0 1 2 3", "4 0 nan 2 3", "face 0: expected the number of a vertex, from 0, found NaN"),
            ("4 0 1 2 3", "4 4294967297 1 2 3", "face 0: expected the number of a vertex, from 0, found 4294967297"),
            ("4 0 1 2 3", "2 0 1", "face 0: expected 3 or more vertices, found 2"),
            ("1 1 0 1 1", "1 1e99 0 1 1", "vertex 2 is at [1, inf, 0]: expected finite numbers"),
            ("float x", "float q", "expected vertices with x, y and z"),
            ("edge 1", "edge 9999999999999", "truncated: expected 9999999999999 of element edge"),
            ("ply\n", "plx\n", "not a valid PLY file"),
            ("face 1", "face 0", "the mesh has no triangles"),
        ] {
            let message = fault("a.ply", text.replacen(from, to, 1).as_bytes());
            assert!(message.contains(expected), "expected \"{expected}\", found \"{message}\"");
        }
    }

    /// Twenty thousand elements of a million rows each, as many as the file has bytes: 2·10¹⁰ rows of nothing.
    #[test]
    fn ply_rows_without_properties_take_no_time() {
        let nothing = "element nothing 1000000\n".repeat(20_000);
        let padding = "comment padding\n".repeat(40_000);
        let text = String::from_utf8(quad("ascii")).unwrap();
        let text = text.replacen("element vertex", &format!("{nothing}{padding}element vertex"), 1);
        let start = std::time::Instant::now();
        assert_eq!(read("a.ply", text.as_bytes()).unwrap(), read("a.ply", &quad("ascii")).unwrap());
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    }

    #[test]
    fn missing_files_and_other_formats_are_told() {
        let missing = load(Path::new("no/such.obj"), 0).unwrap_err();
        assert_eq!(missing.exit_code(), 3);
        assert!(missing.to_string().starts_with("no/such.obj: cannot read: "), "{missing}");
        assert_eq!(fault("a.stl", b""), "expected a mesh (.obj, .ply or .serialized), found extension \"stl\"");
    }
}
