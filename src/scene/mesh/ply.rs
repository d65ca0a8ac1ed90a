//! PLY: elements `vertex` and `face`; the only file that names the PLY crate.

use super::MeshSource;
use glam::{DVec2, DVec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

/// The properties that a vertex may have.
#[derive(Default)]
struct Vertex {
    position: DVec3,
    normal: DVec3,
    uv: DVec2,
}

impl Vertex {
    fn set(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        match name {
            "x" => self.position.x = value,
            "y" => self.position.y = value,
            "z" => self.position.z = value,
            "nx" => self.normal.x = value,
            "ny" => self.normal.y = value,
            "nz" => self.normal.z = value,
            _ if U_NAMES.contains(&name) => self.uv.x = value,
            _ if V_NAMES.contains(&name) => self.uv.y = value,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// What writers call texture coordinates.
const U_NAMES: [&str; 4] = ["u", "s", "texture_u", "texture_s"];
const V_NAMES: [&str; 4] = ["v", "t", "texture_v", "texture_t"];

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Vertex::default()
    }

    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }

    fn set_double(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        self.set(name, value)
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        match value {
            Property::Char(x) => self.set(name, f64::from(x)),
            Property::UChar(x) => self.set(name, f64::from(x)),
            Property::Short(x) => self.set(name, f64::from(x)),
            Property::UShort(x) => self.set(name, f64::from(x)),
            Property::Int(x) => self.set(name, f64::from(x)),
            Property::UInt(x) => self.set(name, f64::from(x)),
            _ => PropertyAccessResult::Ignored,
        }
    }
}

/// The corners of a face; None where the list has something else than counts.
#[derive(Default)]
struct Face {
    corners: Option<Vec<u32>>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Face::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if name != "vertex_indices" && name != "vertex_index" {
            return PropertyAccessResult::Ignored;
        }
        self.corners = match value {
            // An index that is negative becomes one that no file has vertices for.
            Property::ListInt(list) => Some(list.iter().map(|&i| u32::try_from(i).unwrap_or(u32::MAX)).collect()),
            other => other.to_u32_list(),
        };
        if self.corners.is_some() { PropertyAccessResult::Set } else { PropertyAccessResult::UnsupportedType }
    }
}

/// Any other element.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Other
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<MeshSource, String> {
    let mut reader = Reader::new(bytes);
    let parser = Parser::<Vertex>::new();
    let header = parser.read_header(&mut reader).map_err(|e| fault(&e))?;
    let mut out = MeshSource::default();
    for (name, element) in &header.elements {
        // Every element takes at least a byte: a count beyond that is a fault, not a long wait.
        if element.count > bytes.len() {
            return Err(format!("truncated: expected {} of element {name} in {} bytes", element.count, bytes.len()));
        }
        match name.as_str() {
            "vertex" => {
                let has = |names: &[&str]| names.iter().any(|n| element.properties.contains_key(*n));
                if !["x", "y", "z"].iter().all(|n| has(&[n])) {
                    return Err("expected vertices with x, y and z".into());
                }
                let vertices = parser.read_payload_for_element(&mut reader, element, &header).map_err(|e| fault(&e))?;
                out.positions = vertices.iter().map(|v| v.position).collect();
                if ["nx", "ny", "nz"].iter().all(|n| has(&[n])) {
                    out.normals = vertices.iter().map(|v| v.normal).collect();
                }
                if has(&U_NAMES) && has(&V_NAMES) {
                    out.uvs = vertices.iter().map(|v| v.uv).collect();
                }
            }
            "face" => {
                let faces = Parser::<Face>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| fault(&e))?;
                for (i, face) in faces.iter().enumerate() {
                    let corners = face.corners.as_deref().unwrap_or(&[]);
                    if corners.len() < 3 {
                        return Err(format!("face {i}: expected 3 or more vertices, found {}", corners.len()));
                    }
                    out.triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
                }
            }
            _ => {
                Parser::<Other>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| fault(&e))?;
            }
        }
    }
    Ok(out)
}

/// The parser's message on one line.
fn fault(error: &ParseError) -> String {
    format!("not a valid PLY file: {}", error.to_string().split_whitespace().collect::<Vec<_>>().join(" "))
}
