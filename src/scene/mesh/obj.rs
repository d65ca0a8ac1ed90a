//! Wavefront OBJ, as far as triangles need it: `v`, `vt`, `vn`, `f`.
//!
//! Groups and materials are passed over: a file is one mesh. Numbers are read as f64. Three
//! numbers follow `v`; the weight or the colour that may come after them is not used.

use super::MeshSource;
use super::anew::{has_direction, is_fan};
use super::polygon::unfold;
use glam::{DVec2, DVec3};
use std::collections::HashMap;

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
    let mut rest = crate::input::without_mark(bytes);
    for number in 1.. {
        if rest.is_empty() {
            break;
        }
        let end = newline(rest);
        let line = &rest[..end];
        rest = &rest[(end + 1).min(rest.len())..];
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
        let mut words = Words { rest: line };
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
    // The vertices at a position form a chain: the first of each, and after each vertex the next. As a rule they are few; what
    // exceeds the longest chain is looked up.
    const END: u32 = u32::MAX;
    const LONGEST: usize = 16;
    let mut crowd: HashMap<Corner, u32> = HashMap::new();
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
            let (mut vertex, mut passed) = (first[place], 0);
            while vertex != END && of_vertex[vertex as usize] != c {
                (vertex, passed) = (next[vertex as usize], passed + 1);
            }
            if passed == LONGEST {
                vertex = crowd.get(&c).copied().unwrap_or(END);
            }
            if vertex == END {
                vertex = u32::try_from(of_vertex.len()).ok().filter(|&v| v != END).ok_or("more than 2^32 vertices")?;
                if passed < LONGEST {
                    next.push(std::mem::replace(&mut first[place], vertex));
                } else {
                    next.push(END);
                    crowd.insert(c, vertex);
                }
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
        let fan = out.triangles.len();
        out.triangles.extend((2..vertices.len()).map(|k| [vertices[0], vertices[k - 1], vertices[k]]));
        unfold(&out.positions, &mut out.triangles[fan..]);
    }
    Ok(out)
}

/// Where the first line of `text` ends.
fn newline(text: &[u8]) -> usize {
    const ONES: u64 = 0x0101_0101_0101_0101;
    let mut at = 0;
    for eight in text.as_chunks::<8>().0 {
        // A byte of `x` is zero where there is a newline; borrows reach only bytes after the first of them.
        let x = u64::from_le_bytes(*eight) ^ (ONES * u64::from(b'\n'));
        let zero = x.wrapping_sub(ONES) & !x & (ONES << 7);
        if zero != 0 {
            return at + zero.trailing_zeros() as usize / 8;
        }
        at += 8;
    }
    at + text[at..].iter().position(|&b| b == b'\n').unwrap_or(text.len() - at)
}

/// The words of a line, up to one that begins with `#`.
struct Words<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        // As a rule words are one blank apart.
        let start = self.rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let rest = &self.rest[start..];
        if rest[0] == b'#' {
            self.rest = &[];
            return None;
        }
        // A `#` within a word is no comment: Windows once wrote infinity as `1.#INF`.
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.rest = &rest[end..];
        Some(&rest[..end])
    }
}

/// Powers of ten that f64 holds exactly.
const TENS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// The number that a word of digits with or without a point and a sign is, where one rounding makes it: at most 2⁵³
/// over a power of ten that f64 holds exactly (Clinger 1990). `None` for all others.
#[inline]
fn short_decimal(word: &[u8]) -> Option<f64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    // 19 digits are below 2⁶⁴; a point makes one byte more.
    if digits.is_empty() || digits.len() > 20 {
        return None;
    }
    let (mut whole, mut places, mut points, mut count) = (0u64, 0usize, 0usize, 0usize);
    for &b in digits {
        let digit = b.wrapping_sub(b'0');
        if digit < 10 {
            whole = whole.wrapping_mul(10).wrapping_add(u64::from(digit));
            places += points;
            count += 1;
        } else if b == b'.' && points == 0 {
            points = 1;
        } else {
            return None;
        }
    }
    if count == 0 || count > 19 || whole > 1 << 53 {
        return None;
    }
    let x = whole as f64 / TENS[places];
    Some(if negative { -x } else { x })
}

fn number(word: &[u8], line: usize) -> Result<f64, String> {
    if let Some(x) = short_decimal(word) {
        return Ok(x);
    }
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

/// The whole number that a word of at most nine digits is; `None` for all others.
#[inline]
fn short_whole(word: &[u8]) -> Option<i64> {
    if word.is_empty() || word.len() > 9 {
        return None;
    }
    word.iter().try_fold(0, |sum, &b| {
        let digit = b.wrapping_sub(b'0');
        (digit < 10).then_some(10 * sum + i64::from(digit))
    })
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
        let i: i64 = match short_whole(part) {
            Some(i) => i,
            None => std::str::from_utf8(part).ok().and_then(|p| p.parse().ok()).ok_or_else(fault)?,
        };
        let from_one = if i > 0 { Some(i) } else { (counts[k] as i64 + 1).checked_add(i).filter(|&j| i < 0 && j > 0) };
        out[k] = from_one.and_then(|i| u32::try_from(i).ok()).ok_or_else(fault)?;
    }
    Ok(out)
}

/// What Mitsuba takes for a line is shorter, in bytes.
const LINE: usize = 1024;

/// Whether Mitsuba reads the same mesh from `bytes` as `source`: see [`super::anew`].
pub(super) fn is_plain(bytes: &[u8], source: &MeshSource) -> bool {
    if crate::input::without_mark(bytes).len() != bytes.len() {
        return false;
    }
    // How many there are, and how many corners name one.
    let (mut counts, mut named) = ([0; 3], [0; 3]);
    let mut triangles = source.triangles.as_slice();
    for line in bytes.split(|&b| b == b'\n') {
        if line.len() >= LINE || line.trim_ascii_end().ends_with(b"\\") {
            return false;
        }
        let mut words = Words { rest: line };
        match words.next() {
            Some(b"v") => counts[0] += 1,
            Some(b"vt") => {
                counts[1] += 1;
                if words.count() < 2 {
                    return false;
                }
            }
            Some(b"vn") => {
                counts[2] += 1;
                if !numbers::<3>(words, 0).map(DVec3::from).is_ok_and(has_direction) {
                    return false;
                }
            }
            Some(b"f") => {
                let mut corners = 0usize;
                for word in words {
                    corners += 1;
                    for (k, part) in word.split(|&b| b == b'/').enumerate().filter(|(_, part)| !part.is_empty()) {
                        if !short_whole(part).is_some_and(|i| (1..=counts[k]).contains(&i)) {
                            return false;
                        }
                        named[k] += 1;
                    }
                }
                let fan = corners.checked_sub(2).and_then(|count| triangles.split_off(..count));
                if !fan.is_some_and(is_fan) {
                    return false;
                }
            }
            _ => {}
        }
    }
    (1..3).all(|k| counts[k] == 0 || named[k] == named[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The short way gives the nearest f64, as the long way does, or nothing.
    #[test]
    fn short_numbers_are_rounded_as_long_ones_are() {
        let mut state = 7u64;
        for n in 0..200_000usize {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let digits = (state >> 11).to_string();
            let (head, tail) = digits.split_at(n % (digits.len() + 1));
            let word = format!("{}{head}.{}", ["", "-", "+"][n % 3], &tail[..tail.len().min(n % 17)]);
            match short_decimal(word.as_bytes()) {
                Some(x) => assert_eq!(x.to_bits(), word.parse::<f64>().unwrap().to_bits(), "{word}"),
                None => assert!(word.parse::<f64>().is_err() || word.len() > 16, "{word}"),
            }
        }
        for word in ["", "-", ".", "+.", "1e3", "nan", "1.2.3", "12345678901234567890", "0.00000000000000000001"] {
            let long = word.parse::<f64>().ok();
            assert!(short_decimal(word.as_bytes()).is_none_or(|x| long == Some(x)), "{word}");
        }
        assert_eq!(short_decimal(b"-0").map(f64::to_bits), Some((-0.0f64).to_bits()));
    }

    /// A corner that two hundred triangles have, each with a texture coordinate of its own, which the next shares.
    #[test]
    fn a_corner_of_many_faces_is_a_vertex_for_each_that_differs() {
        let n = 200;
        let mut text = String::from("v 0 0 0\n");
        (0..=n).for_each(|i| text += &format!("v 1 {i} 0\nvt {i} 0.5\n"));
        for i in 0..n {
            let (a, b) = (i / 2 + 1, i + 2);
            text += &format!("f 1/{a} {b}/{b} {}/{}\n", b + 1, (b + 1).min(n + 1));
        }
        let mesh = read(text.as_bytes()).unwrap();
        let middles = mesh.positions.iter().filter(|p| **p == DVec3::ZERO).count();
        assert_eq!((mesh.triangles.len(), middles), (n, n / 2));
        for (i, triangle) in mesh.triangles.iter().enumerate() {
            let middle = triangle[0] as usize;
            assert_eq!((mesh.positions[middle], mesh.uvs[middle]), (DVec3::ZERO, DVec2::new((i / 2) as f64, 0.5)));
        }
    }

    #[test]
    fn lines_end_at_the_first_newline() {
        for length in 0..40 {
            for at in 0..length {
                let mut text = vec![b'x'; length];
                text[at..].iter_mut().step_by(3).for_each(|b| *b = b'\n');
                assert_eq!(newline(&text), at);
            }
            assert_eq!(newline(&vec![0x8a; length]), length);
        }
    }
}
