//! Mitsuba's `.serialized`: several meshes in one file, each a zlib stream, and a table of where they start.
//!
//! All numbers are little endian. A mesh starts with the u16 0x041C and a u16 version, 3 or 4; then, in a
//! zlib stream: u32 flags; in version 4 a name that ends with a zero byte; u64 counts of vertices and
//! triangles; positions; normals, u v and colours where the flags say so, all f32 or f64; triangles as three
//! u32. The file ends with the starts of all meshes, u64 in version 4 and u32 in version 3, and a u32 count.
//! The format is described in the documentation of Mitsuba 3, plugin `serialized`.

use super::MeshSource;
use flate2::read::ZlibDecoder;
use glam::{DVec2, DVec3};
use std::io::Read;

const MAGIC: u16 = 0x041c;
const HAS_NORMALS: u32 = 0x1;
const HAS_UVS: u32 = 0x2;
const HAS_COLOURS: u32 = 0x8;
const DOUBLE: u32 = 0x2000;
/// A zlib stream gives at most 1032 bytes for each of its own (RFC 1951: 258 bytes by a code of two bits).
const MOST_INFLATED: u64 = 1032;
/// Of the name of a mesh, in bytes; it is read one by one.
const LONGEST_NAME: usize = 1 << 16;

/// Reads mesh number `index`, counted from 0.
pub(super) fn read(bytes: &[u8], index: u32) -> Result<MeshSource, String> {
    let version = version(bytes)?;
    let start = if index == 0 { 0 } else { start(bytes, version, index)? };
    let stream = bytes.get(start..).ok_or("the table of meshes points beyond the file")?;
    let version = if start == 0 { version } else { self::version(stream)? };
    let mut stream = Stream { inner: ZlibDecoder::new(&stream[4..]), left: stream.len() as u64 * MOST_INFLATED };

    let flags = u32::from_le_bytes(stream.array()?);
    if version == 4 {
        // The name of the mesh.
        let mut length = 0;
        while stream.array::<1>()? != [0] {
            length += 1;
            if length > LONGEST_NAME {
                return Err(format!(
                    "expected a name of at most {LONGEST_NAME} bytes that ends with a zero, found more"
                ));
            }
        }
    }
    let vertices = u64::from_le_bytes(stream.array()?);
    let triangles = u64::from_le_bytes(stream.array()?);
    let double = flags & DOUBLE != 0;
    let positions = stream.vectors::<3>(vertices, double)?.map(DVec3::from).collect();
    let mut out = MeshSource { positions, ..MeshSource::default() };
    if flags & HAS_NORMALS != 0 {
        out.normals = stream.vectors::<3>(vertices, double)?.map(DVec3::from).collect();
    }
    if flags & HAS_UVS != 0 {
        out.uvs = stream.vectors::<2>(vertices, double)?.map(DVec2::from).collect();
    }
    if flags & HAS_COLOURS != 0 {
        stream.bytes(vertices, if double { 24 } else { 12 })?;
    }
    let corners = stream.bytes(triangles, 12)?;
    out.triangles = corners
        .chunks_exact(12)
        .map(|t| std::array::from_fn(|k| u32::from_le_bytes([t[4 * k], t[4 * k + 1], t[4 * k + 2], t[4 * k + 3]])))
        .collect();
    Ok(out)
}

fn version(bytes: &[u8]) -> Result<u16, String> {
    let word = |at: usize| Some(u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]));
    if word(0) != Some(MAGIC) {
        return Err("not a .serialized mesh: expected it to start with 1c 04".into());
    }
    match word(2) {
        Some(version @ (3 | 4)) => Ok(version),
        Some(other) => Err(format!("expected version 3 or 4 of a .serialized mesh, found {other}")),
        None => Err("truncated".into()),
    }
}

/// Where mesh `index` starts, by the table at the end.
fn start(bytes: &[u8], version: u16, index: u32) -> Result<usize, String> {
    let damaged = || "truncated: the table of meshes at the end is incomplete".to_owned();
    let (body, count) = bytes.split_last_chunk::<4>().ok_or_else(damaged)?;
    let count = u32::from_le_bytes(*count);
    if count == 0 {
        return Err("expected meshes, found a table of none at the end".into());
    }
    if index >= count {
        return Err(format!("expected a mesh from 0 to {}, found {index}", count - 1));
    }
    let size: usize = if version == 4 { 8 } else { 4 };
    let table = usize::try_from(count).ok().and_then(|n| body.len().checked_sub(n.checked_mul(size)?));
    let at = table.ok_or_else(damaged)? + index as usize * size;
    let start = body[at..at + size].iter().rev().fold(0u64, |x, &b| x << 8 | u64::from(b));
    usize::try_from(start).map_err(|_| damaged())
}

/// An inflating stream that knows how much it may still give.
struct Stream<'a> {
    inner: ZlibDecoder<&'a [u8]>,
    left: u64,
}

impl Stream<'_> {
    fn fault(error: &std::io::Error) -> String {
        format!("not a valid .serialized mesh: {error}")
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut out = [0; N];
        self.inner.read_exact(&mut out).map_err(|e| Stream::fault(&e))?;
        Ok(out)
    }

    /// `count` items of `size` bytes. A count that the file cannot hold is refused before any memory is
    /// taken.
    fn bytes(&mut self, count: u64, size: u64) -> Result<Vec<u8>, String> {
        let total = count
            .checked_mul(size)
            .filter(|&total| total <= self.left)
            .ok_or_else(|| format!("truncated: expected {count} items of {size} bytes, more than the file can hold"))?;
        self.left -= total;
        let mut out = Vec::new();
        self.inner.by_ref().take(total).read_to_end(&mut out).map_err(|e| Stream::fault(&e))?;
        if (out.len() as u64) < total { Err("truncated".into()) } else { Ok(out) }
    }

    /// `count` vectors of N numbers.
    fn vectors<const N: usize>(
        &mut self,
        count: u64,
        double: bool,
    ) -> Result<impl Iterator<Item = [f64; N]> + use<N>, String> {
        let size = if double { 8 } else { 4 };
        let bytes = self.bytes(count, (size * N) as u64)?;
        let numbers: Vec<f64> = if double {
            bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect()
        } else {
            bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
        };
        Ok((0..numbers.len() / N).map(move |i| std::array::from_fn(|k| numbers[i * N + k])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use std::io::Write;

    /// A mesh of one triangle, `shift` along x, in the given version and precision.
    fn one(version: u16, flags: u32, shift: f64) -> Vec<u8> {
        let mut body = flags.to_le_bytes().to_vec();
        if version == 4 {
            body.extend(b"name\0");
        }
        body.extend(3u64.to_le_bytes());
        body.extend(1u64.to_le_bytes());
        let mut put = |numbers: &[f64]| {
            for &x in numbers {
                if flags & DOUBLE != 0 { body.extend(x.to_le_bytes()) } else { body.extend((x as f32).to_le_bytes()) }
            }
        };
        put(&[shift, 0.0, 0.0, 1.0 + shift, 0.0, 0.0, shift, 1.0, 0.0]);
        if flags & HAS_NORMALS != 0 {
            put(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.8]);
        }
        if flags & HAS_UVS != 0 {
            put(&[0.0, 0.0, 1.0, 0.0, 0.25, 0.5]);
        }
        if flags & HAS_COLOURS != 0 {
            put(&[0.5; 9]);
        }
        (0..3u32).for_each(|i| body.extend(i.to_le_bytes()));
        let mut out = MAGIC.to_le_bytes().to_vec();
        out.extend(version.to_le_bytes());
        let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
        zlib.write_all(&body).unwrap();
        out.extend(zlib.finish().unwrap());
        out
    }

    fn file(version: u16, meshes: &[Vec<u8>]) -> Vec<u8> {
        let (mut out, mut starts) = (Vec::new(), Vec::new());
        for mesh in meshes {
            starts.push(out.len());
            out.extend(mesh);
        }
        for start in starts {
            if version == 4 {
                out.extend((start as u64).to_le_bytes())
            } else {
                out.extend((start as u32).to_le_bytes())
            }
        }
        out.extend((meshes.len() as u32).to_le_bytes());
        out
    }

    #[test]
    fn every_mesh_of_a_file_is_read_in_both_versions_and_precisions() {
        for version in [3, 4] {
            for flags in [0, HAS_NORMALS | HAS_UVS, DOUBLE | HAS_NORMALS | HAS_UVS | HAS_COLOURS] {
                let bytes =
                    file(version, &[one(version, flags, 0.0), one(version, flags, 2.0), one(version, flags, 7.0)]);
                for (i, shift) in [0.0, 2.0, 7.0].into_iter().enumerate() {
                    let mesh = read(&bytes, i as u32).unwrap();
                    assert_eq!(mesh.check(), Ok(()));
                    assert_eq!(mesh.positions[1], DVec3::new(1.0 + shift, 0.0, 0.0));
                    assert_eq!(mesh.triangles, [[0, 1, 2]]);
                    let with = flags & HAS_NORMALS != 0;
                    assert_eq!((mesh.normals.len(), mesh.uvs.len()), if with { (3, 3) } else { (0, 0) });
                    assert!(!with || mesh.uvs[2] == DVec2::new(0.25, 0.5));
                }
                assert_eq!(read(&bytes, 3).unwrap_err(), "expected a mesh from 0 to 2, found 3");
                let none = [&bytes[..bytes.len() - 4], &[0; 4]].concat();
                assert_eq!(read(&none, 3).unwrap_err(), "expected meshes, found a table of none at the end");
            }
        }
    }

    /// After it come no vertices and no triangles.
    #[test]
    fn a_name_has_an_end() {
        let named = |length: usize| {
            let mut body = 0u32.to_le_bytes().to_vec();
            body.resize(4 + length, b'a');
            body.push(0);
            body.extend([0; 16]);
            let mut zlib = ZlibEncoder::new(Vec::new(), Compression::fast());
            zlib.write_all(&body).unwrap();
            [&MAGIC.to_le_bytes()[..], &4u16.to_le_bytes(), &zlib.finish().unwrap()].concat()
        };
        assert!(read(&named(65_536), 0).is_ok());
        let expected = "expected a name of at most 65536 bytes that ends with a zero, found more";
        assert_eq!(read(&named(65_537), 0).unwrap_err(), expected);
    }

    #[test]
    fn every_truncation_and_damage_is_told_or_read() {
        let whole = file(4, &[one(4, HAS_UVS, 0.0), one(4, HAS_UVS, 1.0)]);
        let first = one(4, HAS_UVS, 0.0).len();
        for len in 0..whole.len() {
            // The checksum and the end of the last block of a stream are not asked for.
            assert!(len >= first - 8 || read(&whole[..len], 0).is_err(), "{len}");
            // A cut table may name any start; what is read there is a mesh or a fault.
            assert!(read(&whole[..len], 1).is_ok_and(|mesh| mesh.check().is_ok()) || read(&whole[..len], 1).is_err());
        }
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut damaged = whole.clone();
                damaged[at] ^= 1 << bit;
                for index in 0..2 {
                    if let Ok(mesh) = read(&damaged, index) {
                        let _ = mesh.check();
                    }
                }
            }
        }
    }

    #[test]
    fn a_count_that_the_file_cannot_hold_takes_no_memory() {
        let mut body = 0u32.to_le_bytes().to_vec();
        body.push(0);
        body.extend((1u64 << 60).to_le_bytes());
        body.extend(1u64.to_le_bytes());
        let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
        zlib.write_all(&body).unwrap();
        let mut bytes = MAGIC.to_le_bytes().to_vec();
        bytes.extend(4u16.to_le_bytes());
        bytes.extend(zlib.finish().unwrap());
        let message = read(&bytes, 0).unwrap_err();
        assert!(message.contains("more than the file can hold"), "{message}");
        assert!(read(b"\x1c\x04\x05\x00", 0).unwrap_err().contains("version 3 or 4"));
        assert!(read(b"ply\n", 0).unwrap_err().contains("1c 04"));
    }
}
