//! PLY: elements `vertex` and `face`, as text or binary of either byte order (Turk 1994, "The PLY Polygon
//! File Format").
//!
//! Other elements are passed over. Properties beyond position, normal and texture coordinates become
//! attributes, see [`super::attribute`]. Faces may have a list `texcoord`, u and v of each corner, as MeshLab writes it.

use super::MeshSource;
use super::anew::has_direction;
use super::attribute::{Attribute, Channel, Column, Element, named_columns};
use super::polygon::unfold;
use glam::{DVec2, DVec3};
use std::collections::{BTreeSet, HashMap};

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl Type {
    fn named(name: &str) -> Option<Type> {
        Some(match name {
            "char" | "int8" => Type::I8,
            "uchar" | "uint8" => Type::U8,
            "short" | "int16" => Type::I16,
            "ushort" | "uint16" => Type::U16,
            "int" | "int32" => Type::I32,
            "uint" | "uint32" => Type::U32,
            "long" | "int64" => Type::I64,
            "ulong" | "uint64" => Type::U64,
            "half" | "float16" => Type::F16,
            "float" | "float32" => Type::F32,
            "double" | "float64" => Type::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Type::I8 | Type::U8 => 1,
            Type::I16 | Type::U16 | Type::F16 => 2,
            Type::I32 | Type::U32 | Type::F32 => 4,
            Type::I64 | Type::U64 | Type::F64 => 8,
        }
    }

    /// One over the greatest number of a type of whole numbers; one for others.
    fn unit(self) -> f32 {
        match self {
            Type::I8 => 1.0 / 127.0,
            Type::U8 => 1.0 / 255.0,
            Type::I16 => 1.0 / 32_767.0,
            Type::U16 => 1.0 / 65_535.0,
            Type::I32 => 1.0 / i32::MAX as f32,
            Type::U32 => 1.0 / u32::MAX as f32,
            Type::I64 => 1.0 / i64::MAX as f32,
            Type::U64 => 1.0 / u64::MAX as f32,
            Type::F16 | Type::F32 | Type::F64 => 1.0,
        }
    }

    /// The number that lies in `bytes`.
    fn read(self, bytes: &[u8], big: bool) -> f64 {
        fn raw<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
            let mut out = [0; N];
            out.copy_from_slice(&bytes[..N]);
            if big {
                out.reverse();
            }
            out
        }
        match self {
            Type::I8 => f64::from(bytes[0] as i8),
            Type::U8 => f64::from(bytes[0]),
            Type::I16 => f64::from(i16::from_le_bytes(raw(bytes, big))),
            Type::U16 => f64::from(u16::from_le_bytes(raw(bytes, big))),
            Type::I32 => f64::from(i32::from_le_bytes(raw(bytes, big))),
            Type::U32 => f64::from(u32::from_le_bytes(raw(bytes, big))),
            Type::I64 => i64::from_le_bytes(raw(bytes, big)) as f64,
            Type::U64 => u64::from_le_bytes(raw(bytes, big)) as f64,
            Type::F16 => half::f16::from_le_bytes(raw(bytes, big)).to_f64(),
            Type::F32 => f64::from(f32::from_le_bytes(raw(bytes, big))),
            Type::F64 => f64::from_le_bytes(raw(bytes, big)),
        }
    }

    /// The number that a word of text is, rounded as the type says.
    fn parse(self, word: &str) -> Option<f64> {
        let x: f64 = word.parse().ok()?;
        Some(match self {
            Type::F32 => f64::from(x as f32),
            Type::F16 => half::f16::from_f64(x).to_f64(),
            _ => x,
        })
    }
}

#[derive(Clone, Debug)]
struct Property {
    name: String,
    kind: Type,
    /// The type of the count, for lists.
    list: Option<Type>,
}

struct Header {
    /// None for text.
    big: Option<bool>,
    elements: Vec<(String, usize, Vec<Property>)>,
}

/// Reads the header; what is left of `bytes` is the payload.
fn header(bytes: &mut &[u8]) -> Result<Header, String> {
    let mut out = Header { big: None, elements: Vec::new() };
    let mut format = None;
    for number in 1.. {
        let end = bytes.iter().position(|&b| b == b'\n').ok_or("truncated: the header does not end")?;
        // Comments are in whatever encoding their writer had.
        let line = String::from_utf8_lossy(&bytes[..end]);
        *bytes = &bytes[end + 1..];
        let words: Vec<&str> = line.split_whitespace().collect();
        let unknown = |word: &str| format!("line {number}: unknown type \"{word}\"");
        let of = |word: &str| Type::named(word).ok_or_else(|| unknown(word));
        match (number, words.as_slice()) {
            (1, ["ply"]) => {}
            (1, _) => return Err("expected \"ply\" in the first line".into()),
            (_, [] | ["comment" | "obj_info", ..]) => {}
            (_, ["format", name, "1.0"]) => {
                out.big = match *name {
                    "ascii" => None,
                    "binary_little_endian" => Some(false),
                    "binary_big_endian" => Some(true),
                    _ => return Err(format!("line {number}: unknown format \"{name}\"")),
                };
                format = Some(());
            }
            (_, ["element", name, count]) => {
                let count = count.parse().map_err(|_| format!("line {number}: expected a count, found \"{count}\""))?;
                out.elements.push(((*name).to_owned(), count, Vec::new()));
            }
            (_, ["property", rest @ ..]) => {
                let Some((_, _, properties)) = out.elements.last_mut() else {
                    return Err(format!("line {number}: property without element"));
                };
                properties.push(match rest {
                    ["list", count, kind, name] => {
                        Property { name: (*name).to_owned(), kind: of(kind)?, list: Some(of(count)?) }
                    }
                    [kind, name] => Property { name: (*name).to_owned(), kind: of(kind)?, list: None },
                    _ => return Err(format!("line {number}: expected a type and a name")),
                });
            }
            (_, ["end_header"]) if format.is_some() => return Ok(out),
            (_, ["end_header"]) => return Err("the header names no format".into()),
            _ => return Err(format!("line {number}: expected a line of a header, found \"{}\"", words.join(" "))),
        }
    }
    unreachable!("lines are counted without end")
}

/// The payload, number by number.
enum Payload<'a> {
    Text(std::str::SplitAsciiWhitespace<'a>),
    Binary { bytes: &'a [u8], big: bool },
}

impl Payload<'_> {
    fn next(&mut self, kind: Type) -> Result<f64, String> {
        match self {
            Payload::Text(words) => {
                let word = words.next().ok_or("truncated")?;
                kind.parse(word).ok_or_else(|| format!("expected a number, found \"{word}\""))
            }
            Payload::Binary { bytes, big } => {
                let size = kind.size();
                if bytes.len() < size {
                    return Err("truncated".into());
                }
                let x = kind.read(bytes, *big);
                *bytes = &bytes[size..];
                Ok(x)
            }
        }
    }

    /// Reads the numbers of one row: those of properties that are no lists to `scalars`, in order, and each list of `chosen` to
    /// that of `lists` in its place.
    fn row<const N: usize>(
        &mut self,
        properties: &[Property],
        scalars: &mut Vec<f64>,
        chosen: [Option<usize>; N],
        lists: &mut [Vec<f64>; N],
    ) -> Result<(), String> {
        scalars.clear();
        lists.iter_mut().for_each(Vec::clear);
        for (i, property) in properties.iter().enumerate() {
            let Some(count) = property.list else {
                scalars.push(self.next(property.kind)?);
                continue;
            };
            let count = self.next(count)?;
            if !(0.0..=f64::from(u32::MAX)).contains(&count) || count.fract() != 0.0 {
                return Err(format!("expected the length of a list, found {count}"));
            }
            let list = chosen.iter().position(|chosen| *chosen == Some(i));
            for _ in 0..count as u64 {
                let x = self.next(property.kind)?;
                if let Some(list) = list {
                    lists[list].push(x);
                }
            }
        }
        Ok(())
    }
}

/// Names of texture coordinates, by precedence.
const UV_NAMES: [[&str; 2]; 4] = [["u", "v"], ["texture_u", "texture_v"], ["s", "t"], ["texture_s", "texture_t"]];

pub(super) fn read(bytes: &[u8]) -> Result<MeshSource, String> {
    let total = bytes.len();
    let mut rest = bytes;
    let header = header(&mut rest).map_err(|e| format!("not a valid PLY file: {e}"))?;
    let mut payload = match header.big {
        Some(big) => Payload::Binary { bytes: rest, big },
        None => {
            let text = std::str::from_utf8(rest).map_err(|_| "not a valid PLY file: expected text".to_owned())?;
            Payload::Text(text.split_ascii_whitespace())
        }
    };
    let mut out = MeshSource::default();
    // Triangles of faces of more than three corners: where these are is known when all is read.
    let mut fans = Vec::new();
    // Of the corners of triangles, where faces have coordinates.
    let mut corner_uvs: Vec<[DVec2; 3]> = Vec::new();
    for (name, count, properties) in &header.elements {
        // Every row with properties takes at least a byte: a count beyond that is a fault, not a long wait.
        if *count > total {
            return Err(format!("truncated: expected {count} of element {name} in {total} bytes"));
        }
        let row_fault = |i: usize, e: String| format!("not a valid PLY file: {name} {i}: {e}");
        // Scalars of a row come without the lists.
        let scalar_names: Vec<&str> = properties.iter().filter(|p| p.list.is_none()).map(|p| p.name.as_str()).collect();
        let column = |name: &str| scalar_names.iter().position(|n| *n == name);
        let mut scalars = Vec::new();
        match name.as_str() {
            "vertex" => {
                let all = |names: [&str; 3]| Some([column(names[0])?, column(names[1])?, column(names[2])?]);
                let position = all(["x", "y", "z"]).ok_or("expected vertices with x, y and z")?;
                let normal = all(["nx", "ny", "nz"]);
                let uv_names = UV_NAMES.into_iter().find(|n| n.iter().all(|n| column(n).is_some()));
                let uv = uv_names.and_then(|[u, v]| Some([column(u)?, column(v)?]));
                let taken = [["x", "y", "z"], ["nx", "ny", "nz"]];
                let mut free = columns(properties, |n| taken.iter().flatten().any(|t| *t == n));
                free.iter_mut().for_each(|c| c.taken |= uv_names.is_some_and(|names| names.contains(&c.name.as_str())));
                let mut attributes = named_columns(Element::Vertex, &free);
                for i in 0..*count {
                    payload.row(properties, &mut scalars, [], &mut []).map_err(|e| row_fault(i, e))?;
                    let vector = |at: [usize; 3]| DVec3::from(at.map(|k| scalars[k]));
                    out.positions.push(vector(position));
                    out.normals.extend(normal.map(vector));
                    out.uvs.extend(uv.map(|at| DVec2::from(at.map(|k| scalars[k]))));
                    attributes.iter_mut().for_each(|(attribute, from)| push(attribute, from, &scalars));
                }
                out.attributes.extend(attributes.into_iter().map(|(attribute, _)| attribute));
            }
            "face" => {
                let list = |name: &str| properties.iter().position(|p| p.list.is_some() && p.name == name);
                let corners = list("vertex_index").or_else(|| list("vertex_indices"));
                let corners = corners.ok_or("expected faces with vertex_index or vertex_indices")?;
                let (chosen, mut lists) = ([Some(corners), list("texcoord")], [Vec::new(), Vec::new()]);
                let mut attributes = named_columns(Element::Face, &columns(properties, |_| false));
                for i in 0..*count {
                    payload.row(properties, &mut scalars, chosen, &mut lists).map_err(|e| row_fault(i, e))?;
                    let [list, uvs] = &lists;
                    if list.len() < 3 {
                        return Err(format!("face {i}: expected 3 or more vertices, found {}", list.len()));
                    }
                    // A face may have none.
                    if ![0, 2 * list.len()].contains(&uvs.len()) {
                        let found = format!("{} corners and {} numbers of texcoord", list.len(), uvs.len());
                        return Err(format!("face {i}: expected u and v of each corner, found {found}"));
                    }
                    if let Some(x) = uvs.iter().find(|x| !x.is_finite()) {
                        return Err(format!("face {i}: texcoord: expected finite numbers, found {x}"));
                    }
                    // Text and types with a sign or fractions can say what is no number of a vertex.
                    let is_number = |x: &f64| x.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(x);
                    if let Some(x) = list.iter().find(|x| !is_number(x)) {
                        return Err(format!("face {i}: expected the number of a vertex, from 0, found {x}"));
                    }
                    let uv = |k: usize| uvs.get(2 * k..2 * k + 2).map_or(DVec2::ZERO, DVec2::from_slice);
                    let corner = |k: usize| list[k] as u32;
                    if list.len() > 3 {
                        fans.push(out.triangles.len()..out.triangles.len() + list.len() - 2);
                    }
                    for k in 2..list.len() {
                        out.triangles.push([corner(0), corner(k - 1), corner(k)]);
                        if chosen[1].is_some() {
                            corner_uvs.push([uv(0), uv(k - 1), uv(k)]);
                        }
                        attributes.iter_mut().for_each(|(attribute, from)| push(attribute, from, &scalars));
                    }
                }
                out.attributes.extend(attributes.into_iter().map(|(attribute, _)| attribute));
            }
            // Of rows that hold nothing there may be any number, in each of any number of elements.
            _ if properties.is_empty() => {}
            _ => {
                for i in 0..*count {
                    payload.row(properties, &mut scalars, [], &mut []).map_err(|e| row_fault(i, e))?;
                }
            }
        }
    }
    part_at_seams(&mut out, &corner_uvs);
    fans.into_iter().for_each(|fan| unfold(&out.positions, &mut out.triangles[fan]));
    Ok(out)
}

/// Whether Mitsuba reads the same mesh from `bytes` as `source`, with the attributes that are `asked` for: see [`super::anew`].
pub(super) fn is_plain(bytes: &[u8], source: &MeshSource, asked: &BTreeSet<&str>) -> bool {
    let mut rest = bytes;
    let Ok(header) = header(&mut rest) else { return false };
    let head = &bytes[..bytes.len() - rest.len()];
    if head.split(|&b| b == b'\n').any(|line| line.trim_ascii_start().starts_with(b"obj_info")) {
        return false;
    }
    // Where all faces are triangles, each row is as long as the next.
    let mut length = 0;
    for (name, count, properties) in &header.elements {
        let lists: Vec<&Property> = properties.iter().filter(|property| property.list.is_some()).collect();
        let is_known = match (name.as_str(), &lists[..]) {
            ("vertex", []) => {
                let placed = ["x", "y", "z", "nx", "ny", "nz", "u", "v", "texture_u", "texture_v", "s", "t"];
                let mut placed = properties.iter().filter(|property| placed.contains(&property.name.as_str()));
                let has = |name: &str| properties.iter().any(|property| property.name == name);
                // It does not know the last pair.
                let [others @ .., _] = UV_NAMES;
                placed.all(|property| property.kind.unit() == 1.0)
                    && (source.uvs.is_empty() || others.iter().any(|[u, v]| has(u) && has(v)))
            }
            ("face", [_]) => *count == source.triangles.len(),
            (_, lists) => lists.is_empty(),
        };
        let element = match name.as_str() {
            "vertex" => Some(Element::Vertex),
            "face" => Some(Element::Face),
            _ => None,
        };
        if !is_known || element.is_some_and(|element| !are_plain(element, properties, asked)) {
            return false;
        }
        let row = properties.iter().map(|property| match (property.list, header.big) {
            (None, None) => 1,
            (None, Some(_)) => property.kind.size(),
            (Some(_), None) => 4,
            (Some(count), Some(_)) => count.size() + 3 * property.kind.size(),
        });
        length += count * row.sum::<usize>();
    }
    let found = match header.big {
        Some(_) => rest.len(),
        None => rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).count(),
    };
    found == length && source.normals.iter().all(|normal| has_direction(*normal))
}

/// Whether Mitsuba reads the same attributes that are `asked` for from the properties of an element: numbers with fractions, and
/// colours without an alpha.
fn are_plain(element: Element, properties: &[Property], asked: &BTreeSet<&str>) -> bool {
    let columns = columns(properties, |_| false);
    let is_alone = columns.iter().all(|column| !["a", "alpha"].contains(&column.name.as_str()));
    let named = named_columns(element, &columns);
    let mut asked = named.iter().filter(|(attribute, _)| asked.contains(attribute.name.as_str()));
    asked.all(|(attribute, from)| {
        let is_colour = ["vertex_color", "face_color"].contains(&attribute.name.as_str());
        (is_alone || !is_colour) && from.iter().all(|(k, _)| columns[*k].unit == 1.0)
    })
}

/// Gives the corners of all triangles the coordinates `uvs`; nothing where there are none. A vertex whose corners have several becomes as
/// many vertices, at the same place.
fn part_at_seams(mesh: &mut MeshSource, uvs: &[[DVec2; 3]]) {
    if uvs.is_empty() {
        return;
    }
    let there = mesh.positions.len();
    mesh.uvs = vec![DVec2::NAN; there];
    let mut further: HashMap<(u32, [u64; 2]), u32> = HashMap::new();
    for (triangle, uvs) in mesh.triangles.iter_mut().zip(uvs) {
        for (vertex, &uv) in triangle.iter_mut().zip(uvs) {
            let from = *vertex as usize;
            // What is not there is a fault that is told later.
            if from >= there || mesh.uvs[from] == uv {
                continue;
            }
            if mesh.uvs[from].is_nan() {
                mesh.uvs[from] = uv;
                continue;
            }
            *vertex = *further.entry((*vertex, [uv.x, uv.y].map(f64::to_bits))).or_insert_with(|| {
                mesh.positions.push(mesh.positions[from]);
                mesh.uvs.push(uv);
                mesh.normals.extend(mesh.normals.get(from).copied());
                for attribute in mesh.attributes.iter_mut().filter(|a| a.element == Element::Vertex) {
                    let value = from * attribute.channels..(from + 1) * attribute.channels;
                    attribute.values.extend_from_within(value);
                }
                mesh.positions.len() as u32 - 1
            });
        }
    }
    // No face has the others.
    mesh.uvs.iter_mut().filter(|uv| uv.is_nan()).for_each(|uv| *uv = DVec2::ZERO);
}

/// The properties of an element that are no lists.
fn columns(properties: &[Property], taken: impl Fn(&str) -> bool) -> Vec<Column> {
    let scalars = properties.iter().filter(|p| p.list.is_none());
    scalars.map(|p| Column { name: p.name.clone(), taken: taken(&p.name), unit: p.kind.unit() }).collect()
}

fn push(attribute: &mut Attribute, from: &[Channel], scalars: &[f64]) {
    attribute.values.extend(from.iter().map(|&(k, factor)| scalars[k] as f32 * factor));
}
