//! Wavefront OBJ, as far as triangles need it: `v`, `vt`, `vn`, `f`.
//!
//! Groups and materials are passed over: a file is one mesh. Numbers are read as f64. Three
//! numbers follow `v`; the weight or the colour that may come after them is not used.

use super::MeshSource;
use glam::{DVec2, DVec3};

/// Position, texture coordinate and normal of a corner of a face, counted from 1; 0 where there is none.
type Corner = [u32; 3];

/// What the three numbers of a corner name.
const LISTS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Faces as they are read: all corners, and for each face its line and the end of its corners.
#[derive(Default)]
struct Faces {
    corners: Vec<Corner>,
    ends: Vec<(u32, usize)>,
}

pub(super) fn read(bytes: &[u8]) -> Result<MeshSource, String> {
    let mut positions: Vec<DVec3> = Vec::new();
    let mut uvs: Vec<DVec2> = Vec::new();
    let mut normals: Vec<DVec3> = Vec::new();
    let mut faces = Faces::default();
    let mut carried: Vec<u8> = Vec::new();
    for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let number = i + 1;
        // A backslash at the end joins the next line.
        if let Some(head) = line.trim_ascii_end().strip_suffix(b"\\") {
            carried.extend(head);
            carried.push(b' ');
            continue;
        }
        let joined;
        let line = if carried.is_empty() {
            line
        } else {
            carried.extend(line);
            joined = std::mem::take(&mut carried);
            &joined
        };
        let line = line.split(|&b| b == b'#').next().unwrap_or(line);
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v") => positions.push(DVec3::from(numbers::<3>(words, number)?)),
            Some(b"vt") => uvs.push(texture_coordinates(words, number)?),
            Some(b"vn") => normals.push(DVec3::from(numbers::<3>(words, number)?)),
            Some(b"f") => {
                let counts = [positions.len(), uvs.len(), normals.len()];
                let start = faces.corners.len();
                for word in words {
                    faces.corners.push(corner(word, counts, number)?);
                }
                let found = faces.corners.len() - start;
                if found < 3 {
                    return Err(format!("line {number}: expected a face of 3 or more corners, found {found}"));
                }
                faces.ends.push((u32::try_from(number).unwrap_or(u32::MAX), faces.corners.len()));
            }
            _ => {}
        }
    }
    weld(&positions, &uvs, &normals, &faces)
}

/// Each distinct corner becomes a vertex. Positions that several share stay equal bit for bit.
fn weld(positions: &[DVec3], uvs: &[DVec2], normals: &[DVec3], faces: &Faces) -> Result<MeshSource, String> {
    let mut out = MeshSource::default();
    let counts = [positions.len(), uvs.len(), normals.len()];
    let has = |k: usize| faces.corners.iter().any(|c| c[k] != 0);
    let (has_uvs, has_normals) = (has(1), has(2));
    // The vertices at a position form a chain: the first of each, and after each vertex the next.
    const END: u32 = u32::MAX;
    let mut first = vec![END; positions.len()];
    let mut next: Vec<u32> = Vec::new();
    let mut of_vertex: Vec<Corner> = Vec::new();
    let mut vertices = Vec::new();
    let mut start = 0;
    for &(line, end) in &faces.ends {
        vertices.clear();
        for &c in &faces.corners[start..end] {
            for ((&i, what), count) in c.iter().zip(LISTS).zip(counts) {
                if i as usize > count {
                    return Err(format!("line {line}: face names {what} {i}, but the file has {count}"));
                }
            }
            let place = c[0] as usize - 1;
            let mut vertex = first[place];
            while vertex != END && of_vertex[vertex as usize] != c {
                vertex = next[vertex as usize];
            }
            if vertex == END {
                vertex = u32::try_from(of_vertex.len()).ok().filter(|&v| v != END).ok_or("more than 2^32 vertices")?;
                next.push(std::mem::replace(&mut first[place], vertex));
                of_vertex.push(c);
                out.positions.push(positions[place]);
                if has_uvs {
                    out.uvs.push(if c[1] == 0 { DVec2::ZERO } else { uvs[c[1] as usize - 1] });
                }
                if has_normals {
                    out.normals.push(if c[2] == 0 { DVec3::ZERO } else { normals[c[2] as usize - 1] });
                }
            }
            vertices.push(vertex);
        }
        start = end;
        out.triangles.extend((2..vertices.len()).map(|k| [vertices[0], vertices[k - 1], vertices[k]]));
    }
    Ok(out)
}

fn number(word: &[u8], line: usize) -> Result<f64, String> {
    match std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok()) {
        Some(x) if x.is_finite() => Ok(x),
        _ => Err(format!("line {line}: expected a finite number, found \"{}\"", String::from_utf8_lossy(word))),
    }
}

fn numbers<'a, const N: usize>(mut words: impl Iterator<Item = &'a [u8]>, line: usize) -> Result<[f64; N], String> {
    let mut out = [0.0; N];
    for (k, x) in out.iter_mut().enumerate() {
        let word = words.next().ok_or_else(|| format!("line {line}: expected {N} numbers, found {k}"))?;
        *x = number(word, line)?;
    }
    Ok(out)
}

/// The second of two is optional and zero by default.
fn texture_coordinates<'a>(mut words: impl Iterator<Item = &'a [u8]>, line: usize) -> Result<DVec2, String> {
    let u = words.next().ok_or_else(|| format!("line {line}: expected 2 numbers, found 0"))?;
    let v = words.next().map_or(Ok(0.0), |w| number(w, line))?;
    Ok(DVec2::new(number(u, line)?, v))
}

/// `v`, `v/t`, `v//n` or `v/t/n`; negative numbers count back from the last one read.
fn corner(word: &[u8], counts: [usize; 3], line: usize) -> Result<Corner, String> {
    let fault = || {
        let word = String::from_utf8_lossy(word);
        format!("line {line}: expected a corner like 1, 1/2, 1//3 or 1/2/3, found \"{word}\"")
    };
    let mut out = [0; 3];
    for (k, part) in word.split(|&b| b == b'/').enumerate() {
        if k > 2 {
            return Err(fault());
        }
        if part.is_empty() && k > 0 {
            continue;
        }
        let i: i64 = std::str::from_utf8(part).ok().and_then(|p| p.parse().ok()).ok_or_else(fault)?;
        let from_one = if i > 0 { Some(i) } else { (counts[k] as i64 + 1).checked_add(i).filter(|&j| i < 0 && j > 0) };
        out[k] = from_one.and_then(|i| u32::try_from(i).ok()).ok_or_else(fault)?;
    }
    Ok(out)
}
