//! Wavefront OBJ, as far as triangles need it: `v`, `vt`, `vn`, `f`.
//!
//! Groups and materials are passed over: a file is one mesh. Numbers are read as f64. Three
//! numbers follow `v`; the weight or the colour that may come after them is not used.

use super::MeshSource;
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// Position, texture coordinate and normal of a corner of a face, counted from 0.
type Corner = [Option<usize>; 3];

pub(super) fn read(bytes: &[u8]) -> Result<MeshSource, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut positions: Vec<DVec3> = Vec::new();
    let mut uvs: Vec<DVec2> = Vec::new();
    let mut normals: Vec<DVec3> = Vec::new();
    let mut faces: Vec<(usize, Vec<Corner>)> = Vec::new();
    let mut carried = String::new();
    for (number, line) in text.lines().enumerate() {
        let number = number + 1;
        // A backslash at the end joins the next line.
        if let Some(head) = line.trim_end().strip_suffix('\\') {
            carried.push_str(head);
            carried.push(' ');
            continue;
        }
        let joined = std::mem::take(&mut carried) + line;
        let mut words = joined.split('#').next().unwrap_or("").split_whitespace();
        match words.next() {
            Some("v") => positions.push(DVec3::from(numbers::<3>(words, number)?)),
            Some("vt") => uvs.push(texture_coordinates(words, number)?),
            Some("vn") => normals.push(DVec3::from(numbers::<3>(words, number)?)),
            Some("f") => {
                let counts = [positions.len(), uvs.len(), normals.len()];
                let face = words.map(|w| corner(w, counts, number)).collect::<Result<Vec<Corner>, String>>()?;
                if face.len() < 3 {
                    return Err(format!("line {number}: expected a face of 3 or more corners, found {}", face.len()));
                }
                faces.push((number, face));
            }
            _ => {}
        }
    }

    // Each distinct corner becomes a vertex. Positions that several share stay equal bit for bit.
    let mut out = MeshSource::default();
    let has = |k: usize| faces.iter().flat_map(|f| &f.1).any(|c| c[k].is_some());
    let (has_uvs, has_normals) = (has(1), has(2));
    let mut vertex_of: HashMap<Corner, u32> = HashMap::new();
    let mut vertices = Vec::new();
    for (number, face) in &faces {
        vertices.clear();
        for &c in face {
            for (k, (what, count)) in
                [("vertex", positions.len()), ("texture coordinate", uvs.len()), ("normal", normals.len())]
                    .into_iter()
                    .enumerate()
            {
                if let Some(i) = c[k].filter(|&i| i >= count) {
                    return Err(format!(
                        "line {number}: face names {what} {}, but the file has {count}",
                        i.saturating_add(1)
                    ));
                }
            }
            let next = u32::try_from(vertex_of.len()).map_err(|_| "more than 2^32 vertices".to_string())?;
            let vertex = *vertex_of.entry(c).or_insert_with(|| {
                out.positions.push(c[0].map_or(DVec3::ZERO, |i| positions[i]));
                if has_uvs {
                    out.uvs.push(c[1].map_or(DVec2::ZERO, |i| uvs[i]));
                }
                if has_normals {
                    out.normals.push(c[2].map_or(DVec3::ZERO, |i| normals[i]));
                }
                next
            });
            vertices.push(vertex);
        }
        out.triangles.extend((2..vertices.len()).map(|k| [vertices[0], vertices[k - 1], vertices[k]]));
    }
    Ok(out)
}

fn number(word: &str, line: usize) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("line {line}: expected a finite number, found \"{word}\"")),
    }
}

fn numbers<'a, const N: usize>(mut words: impl Iterator<Item = &'a str>, line: usize) -> Result<[f64; N], String> {
    let mut out = [0.0; N];
    for (k, x) in out.iter_mut().enumerate() {
        let word = words.next().ok_or_else(|| format!("line {line}: expected {N} numbers, found {k}"))?;
        *x = number(word, line)?;
    }
    Ok(out)
}

/// The second of two is optional and zero by default.
fn texture_coordinates<'a>(mut words: impl Iterator<Item = &'a str>, line: usize) -> Result<DVec2, String> {
    let u = words.next().ok_or_else(|| format!("line {line}: expected 2 numbers, found 0"))?;
    let v = words.next().map_or(Ok(0.0), |w| number(w, line))?;
    Ok(DVec2::new(number(u, line)?, v))
}

/// `v`, `v/t`, `v//n` or `v/t/n`; negative numbers count back from the last one read.
fn corner(word: &str, counts: [usize; 3], line: usize) -> Result<Corner, String> {
    let fault = || format!("line {line}: expected a corner like 1, 1/2, 1//3 or 1/2/3, found \"{word}\"");
    let mut out = [None; 3];
    for (k, part) in word.split('/').enumerate() {
        if k > 2 {
            return Err(fault());
        }
        if part.is_empty() && k > 0 {
            continue;
        }
        let i: i64 = part.parse().map_err(|_| fault())?;
        let from_zero =
            if i > 0 { Some(i - 1) } else { (counts[k] as i64).checked_add(i).filter(|&j| i < 0 && j >= 0) };
        out[k] = Some(usize::try_from(from_zero.ok_or_else(fault)?).map_err(|_| fault())?);
    }
    Ok(out)
}
