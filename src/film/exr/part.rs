//! Exact sums as a legal EXR file, so that parts of a picture can be kept, moved, looked at and added up.
//!
//! A *plane* holds a whole number for each pixel: a sum of the film in its units, or a count. Its numbers are written as
//! signed integers in words of 32 bits, each word a `UINT` channel; what no number of the plane needs is left out. The
//! attribute `abbe/part`, a JSON object, lists all planes as `{"name": "camera0.X", "shift": 17, "words": 2}`:
//!
//! ```text
//! number = signed(camera0.X.w0 + camera0.X.w1 · 2³²) · 2^shift        signed: two's complement of 32 · words bits
//! ```
//!
//! With no words all numbers are 0 and there is no channel. Sums and counts of two parts are added as they are. In Python:
//!
//! ```text
//! import json, OpenEXR
//! with OpenEXR.File("a.exr", separate_channels=True) as file:
//!     channels, part = file.channels(), json.loads(file.header()["abbe/part"])
//!     for plane in part["planes"]:
//!         n = 32 * plane["words"]
//!         total = sum(channels[f"{plane['name']}.w{w}"].pixels.astype(object) << 32 * w for w in range(plane["words"]))
//!         number = (total - (total >> n - 1 << n)) << plane["shift"] if n else 0
//! ```
//!
//! Rows are packed as PXR24 has it, which loses nothing of integers: differences of neighbours, their bytes in four
//! planes, deflated, sixteen rows together. Planes that are zero or even take almost nothing. `abbe/partHash` is 128
//! bits of BLAKE3 over the JSON and all packed rows: a part that was damaged is known by it. Files are read row by row.

use super::Attribute;
use super::pack::pack;
use super::write::{check_name, header_of};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::output::write_atomically;
use flate2::read::ZlibDecoder;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// A plane of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// Its name.
    pub name: String,
    /// The power of two that divides all numbers.
    pub shift: u32,
    /// Channels.
    pub words: u32,
}

impl Plane {
    fn channels(&self) -> impl Iterator<Item = String> {
        (0..self.words).map(|word| format!("{}.w{word}", self.name))
    }
}

/// Where the description of a part stands.
pub const JSON: &str = "abbe/part";
/// Where its checksum stands.
const HASH: &str = "abbe/partHash";
/// Rows of a chunk.
const ROWS: usize = 16;
/// PXR24 in the list of compressions.
const PXR24: u8 = 5;
/// A header of more bytes than this is none of ours.
const HEADER_LIMIT: usize = 1 << 28;

/// The numbers of a window, plane by plane.
pub trait Numbers: Sync {
    /// Names of the planes.
    fn names(&self) -> Vec<String>;
    /// Writes row `y` of the plane into `row`, which is filled with zeros.
    fn fill(&self, plane: usize, y: i32, row: &mut [i128]);
}

/// What the planes of `numbers` need.
fn planes(window: Window, numbers: &dyn Numbers) -> Vec<Plane> {
    let names = numbers.names();
    let count = names.len();
    // Of each plane: all bits that are set anywhere, and the most bits that a number needs.
    let row = |y: i32| -> Vec<(i128, u32)> {
        let mut row = vec![0i128; window.width as usize];
        (0..count)
            .map(|plane| {
                row.fill(0);
                numbers.fill(plane, y, &mut row);
                row.iter().fold((0, 0), |(set, bits), &x| {
                    let sign = if x < 0 { x.leading_ones() } else { x.leading_zeros() };
                    (set | x, bits.max(if x == 0 { 0 } else { 129 - sign }))
                })
            })
            .collect()
    };
    let both = |a: Vec<(i128, u32)>, b: Vec<(i128, u32)>| {
        a.iter().zip(&b).map(|(a, b)| (a.0 | b.0, a.1.max(b.1))).collect::<Vec<_>>()
    };
    let rows = window.y..window.y + window.height as i32;
    let all = rows.into_par_iter().map(row).reduce(|| vec![(0, 0); count], both);
    let plane = |(name, (set, bits)): (String, (i128, u32))| {
        let shift = if set == 0 { 0 } else { set.trailing_zeros() };
        Plane { name, shift, words: (bits - shift).div_ceil(32) }
    };
    let mut planes: Vec<Plane> = names.into_iter().zip(all).map(plane).collect();
    // A file without channels would be none.
    let empty = planes.iter().all(|plane| plane.words == 0);
    if let (Some(first), true) = (planes.first_mut(), empty) {
        first.words = 1;
    }
    planes
}

/// Writes the numbers of `window`. `describe` makes the JSON, which lists the planes, and further attributes.
///
/// # Errors
/// [`Error::Output`].
pub fn write_part(
    path: &Path,
    frame: [u32; 2],
    window: Window,
    numbers: &dyn Numbers,
    describe: impl FnOnce(&[Plane]) -> (String, Vec<(String, Attribute)>),
) -> Result<()> {
    let fail = |message: String| Error::output(path, message);
    let planes = planes(window, numbers);
    let mut order: Vec<(String, usize, u32)> = Vec::new();
    for (i, plane) in planes.iter().enumerate() {
        order.extend(plane.channels().enumerate().map(|(word, name)| (name, i, word as u32)));
    }
    order.sort();
    for (name, ..) in &order {
        check_name("channel", name).map_err(fail)?;
    }
    let (width, height) = (window.width as usize, window.height as usize);
    let chunk = |index: usize| -> Vec<u8> {
        let rows = index * ROWS..((index + 1) * ROWS).min(height);
        let (mut plain, mut parted) = (Vec::new(), Vec::new());
        let mut values = vec![0i128; width * planes.len()];
        let mut words = vec![0u32; width];
        for row in rows.clone() {
            values.fill(0);
            for (i, values) in values.chunks_exact_mut(width).enumerate().filter(|(i, _)| planes[*i].words > 0) {
                numbers.fill(i, window.y + row as i32, values);
            }
            for (_, i, word) in &order {
                let down = planes[*i].shift + 32 * word;
                for (word, x) in words.iter_mut().zip(&values[i * width..(i + 1) * width]) {
                    *word = (x >> down) as u32;
                }
                plain.extend(words.iter().flat_map(|word| word.to_le_bytes()));
                let mut before = 0;
                let differences = words.iter_mut();
                differences.for_each(|word| {
                    let own = *word;
                    *word = own.wrapping_sub(before);
                    before = own;
                });
                for byte in (0..4).rev() {
                    parted.extend(words.iter().map(|word| (word >> (8 * byte)) as u8));
                }
            }
        }
        pack(window.y + rows.start as i32, &parted, plain)
    };
    let chunks: Vec<Vec<u8>> = (0..height.div_ceil(ROWS)).into_par_iter().map(chunk).collect();
    let (json, mut attributes) = describe(&planes);
    let hash = checksum(&json, chunks.iter().map(Vec::as_slice));
    attributes.push((JSON.into(), Attribute::Text(json)));
    attributes.push((HASH.into(), Attribute::Text(hash)));
    let names: Vec<&str> = order.iter().map(|(name, ..)| name.as_str()).collect();
    let mut bytes = header_of(frame, window, &names, PXR24, &attributes).map_err(fail)?;
    let mut place = (bytes.len() + 8 * chunks.len()) as u64;
    for chunk in &chunks {
        bytes.extend_from_slice(&place.to_le_bytes());
        place += chunk.len() as u64;
    }
    chunks.iter().for_each(|chunk| bytes.extend_from_slice(chunk));
    write_atomically(path, &bytes)
}

fn checksum<'a>(json: &str, chunks: impl Iterator<Item = &'a [u8]>) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(json.as_bytes());
    chunks.for_each(|chunk| {
        hasher.update(chunk);
    });
    hasher.finalize().to_hex()[..32].to_owned()
}

/// Takes a row: index of the plane, y, numbers.
pub type Take<'a> = dyn FnMut(usize, i32, &[i128]) -> Result<()> + 'a;

/// A part whose header has been read.
#[derive(Debug)]
pub struct PartFile {
    path: PathBuf,
    /// The pixels of its planes.
    pub window: Window,
    /// What `abbe/part` says.
    pub json: String,
    hash: String,
    channels: Vec<String>,
    /// Where the table of chunks begins.
    table: u64,
}

impl PartFile {
    /// Reads the header of `path`.
    ///
    /// # Errors
    /// [`Error::Input`] if it is missing or no part.
    pub fn open(path: &Path) -> Result<PartFile> {
        let fail = |message: &str| Error::input(path, message);
        let file = crate::input::open(path).map_err(|e| Error::unread(path, &e))?;
        let mut reader = Counted { inner: BufReader::new(file), count: 0 };
        let mut start = [0u8; 8];
        let damaged = |e: std::io::Error| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => fail("expected a part of a picture, found a file that ends early"),
            _ => Error::input(path, e.to_string()),
        };
        reader.read_exact(&mut start).map_err(damaged)?;
        if start[..4] != [0x76, 0x2f, 0x31, 0x01] {
            return Err(fail("expected a part of a picture, found no OpenEXR file"));
        }
        let mut found = [None, None, None, None, None];
        const NAMES: [&str; 5] = [JSON, HASH, "dataWindow", "channels", "compression"];
        loop {
            let name = reader.text().map_err(damaged)?;
            if name.is_empty() {
                break;
            }
            let _kind = reader.text().map_err(damaged)?;
            let mut size = [0u8; 4];
            reader.read_exact(&mut size).map_err(damaged)?;
            let size = u32::from_le_bytes(size) as usize;
            if reader.count + size > HEADER_LIMIT {
                return Err(fail("expected a part of a picture, found a damaged header"));
            }
            let mut value = Vec::new();
            (&mut reader).take(size as u64).read_to_end(&mut value).map_err(damaged)?;
            if value.len() < size {
                return Err(fail("expected a part of a picture, found a file that ends early"));
            }
            if let Some(i) = NAMES.iter().position(|own| *own == name) {
                found[i] = Some(value);
            }
        }
        let [Some(json), Some(hash), Some(window), Some(channels), Some(compression)] = found else {
            return Err(fail(
                "expected a part of a picture (`abbe render --tile` or `--samples`), found another OpenEXR file",
            ));
        };
        let text = |bytes| String::from_utf8(bytes).map_err(|_| fail("the part is damaged: its header is no text"));
        let odd = || fail("the part is damaged: its header does not hold together");
        let corners: Vec<i64> =
            window.chunks_exact(4).map(|b| i64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect();
        let [x, y, right, bottom] = corners[..] else { return Err(odd()) };
        let (width, height) = (right - x + 1, bottom - y + 1);
        if compression != [PXR24] || width < 1 || height < 1 || width.max(height) > i64::from(i32::MAX) {
            return Err(odd());
        }
        let window = Window { x: x as i32, y: y as i32, width: width as u32, height: height as u32 };
        let mut names = Vec::new();
        let mut rest = channels.as_slice();
        while let Some(end) = rest.iter().position(|b| *b == 0).filter(|end| *end > 0) {
            names.push(text(rest[..end].to_vec())?);
            rest = rest.get(end + 17..).ok_or_else(odd)?;
        }
        let table = reader.count as u64;
        Ok(PartFile { path: path.into(), window, json: text(json)?, hash: text(hash)?, channels: names, table })
    }

    /// Reads all rows: `take` gets the plane's index in `planes`, y, and the numbers of the row. Planes without
    /// words are left out.
    ///
    /// # Errors
    /// [`Error::Input`] if the file is damaged; `take` may have been called before it is known.
    pub fn read(&self, planes: &[Plane], take: &mut Take) -> Result<()> {
        let damaged = |what: &str| Error::input(&self.path, format!("the part is damaged: {what}"));
        let ends = |e: std::io::Error| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => damaged("it ends early"),
            _ => Error::input(&self.path, e.to_string()),
        };
        let mut order: Vec<(String, usize, u32)> = Vec::new();
        for (i, plane) in planes.iter().enumerate() {
            if plane.words > 4 || plane.shift > 127 {
                return Err(damaged("its planes are of no size that sums have"));
            }
            order.extend(plane.channels().enumerate().map(|(word, name)| (name, i, word as u32)));
        }
        order.sort();
        if !order.iter().map(|(name, ..)| name).eq(&self.channels) {
            return Err(damaged("its channels are not those of its planes"));
        }
        let mut reader = BufReader::new(File::open(&self.path).map_err(ends)?);
        let (width, height) = (self.window.width as usize, self.window.height as usize);
        let count = height.div_ceil(ROWS);
        std::io::Seek::seek(&mut reader, std::io::SeekFrom::Start(self.table + 8 * count as u64)).map_err(ends)?;
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.json.as_bytes());
        let mut values = vec![0i128; width];
        for index in 0..count {
            let rows = index * ROWS..((index + 1) * ROWS).min(height);
            let mut head = [0u8; 8];
            reader.read_exact(&mut head).map_err(ends)?;
            let packed_size = u32::from_le_bytes([head[4], head[5], head[6], head[7]]) as usize;
            let size = 4 * width * order.len() * rows.len();
            if packed_size > size || head[..4] != (self.window.y + rows.start as i32).to_le_bytes() {
                return Err(damaged("its rows are out of order"));
            }
            let mut packed = vec![0u8; packed_size];
            reader.read_exact(&mut packed).map_err(ends)?;
            hasher.update(&head).update(&packed);
            let shrunk = packed_size < size;
            let bytes = if shrunk {
                let mut bytes = Vec::with_capacity(size);
                let unpacked = ZlibDecoder::new(packed.as_slice()).take(size as u64 + 1).read_to_end(&mut bytes);
                if unpacked.is_err() || bytes.len() != size {
                    return Err(damaged("its rows cannot be unpacked"));
                }
                bytes
            } else {
                packed
            };
            let mut lines = bytes.chunks_exact(4 * width);
            for row in rows {
                let mut at = 0;
                while at < order.len() {
                    let plane = order[at].1;
                    values.fill(0);
                    while at < order.len() && order[at].1 == plane {
                        let line = lines.next().unwrap_or_default();
                        let word = order[at].2;
                        let mut before = 0u32;
                        for (x, value) in values.iter_mut().enumerate() {
                            let number = if shrunk {
                                let byte = |b: usize| line[b * width + x];
                                before = before.wrapping_add(u32::from_be_bytes([byte(0), byte(1), byte(2), byte(3)]));
                                before
                            } else {
                                u32::from_le_bytes([line[4 * x], line[4 * x + 1], line[4 * x + 2], line[4 * x + 3]])
                            };
                            *value |= i128::from(number) << (32 * word);
                        }
                        at += 1;
                    }
                    let Plane { shift, words, .. } = planes[plane];
                    let unused = 128 - 32 * words;
                    values.iter_mut().for_each(|value| *value = (*value << unused >> unused) << shift);
                    take(plane, self.window.y + row as i32, &values)?;
                }
            }
        }
        if hasher.finalize().to_hex()[..32] != *self.hash {
            return Err(damaged("its checksum is another one"));
        }
        Ok(())
    }
}

/// A reader that knows where it is.
struct Counted<R> {
    inner: R,
    count: usize,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.count += n;
        Ok(n)
    }
}

impl<R: Read> Counted<R> {
    /// Text up to a zero byte; at most 255 bytes, as names have.
    fn text(&mut self) -> std::io::Result<String> {
        let mut text = Vec::new();
        loop {
            let mut byte = [0];
            self.read_exact(&mut byte)?;
            if byte[0] == 0 || text.len() == 255 {
                return Ok(String::from_utf8_lossy(&text).into_owned());
            }
            text.push(byte[0]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from nothing to all of 127 bits, of either sign, in planes of 19 × 37 pixels.
    struct Drawn;

    impl Numbers for Drawn {
        fn names(&self) -> Vec<String> {
            (0..6).map(|i| format!("p{i}.X")).collect()
        }

        fn fill(&self, plane: usize, y: i32, row: &mut [i128]) {
            for (x, value) in row.iter_mut().enumerate() {
                let draw = |i: u64| crate::math::sampler::mix64(i ^ (y as u64) << 32 ^ x as u64);
                let wide = i128::from(draw(plane as u64) as i64) << 64 | i128::from(draw(99));
                *value = match plane {
                    0 => 0,
                    1 => wide >> 1,
                    2 => (wide >> 90) << 17,
                    3 => i128::from(i64::MIN) - i128::from(x as i64),
                    4 => 7 << 120,
                    _ => -1,
                };
            }
        }
    }

    const WINDOW: Window = Window { x: -3, y: 5, width: 19, height: 37 };

    fn write(path: &Path) -> Vec<Plane> {
        let mut known = Vec::new();
        write_part(path, [40, 50], WINDOW, &Drawn, |planes| {
            known = planes.to_vec();
            ("{}".to_owned(), Vec::new())
        })
        .unwrap();
        known
    }

    fn read(path: &Path, planes: &[Plane]) -> Result<()> {
        let file = PartFile::open(path)?;
        assert_eq!((file.window, file.json.as_str()), (WINDOW, "{}"));
        let mut seen = 0;
        file.read(planes, &mut |plane, y, row| {
            let mut expected = vec![0; 19];
            Drawn.fill(plane, y, &mut expected);
            assert_eq!(row, expected, "plane {plane}, row {y}");
            seen += 1;
            Ok(())
        })?;
        assert_eq!(seen, 5 * 37);
        Ok(())
    }

    #[test]
    fn numbers_of_any_size_come_back_and_take_the_words_that_they_need() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let planes = write(&path);
        assert_eq!(planes.iter().map(|p| p.words).collect::<Vec<_>>(), [0, 4, 2, 3, 1, 1]);
        assert_eq!((planes[2].shift, planes[4].shift), (17, 120));
        read(&path, &planes).unwrap();
        // It is an OpenEXR file.
        let exr = super::super::read_exr(&path).unwrap();
        assert_eq!((exr.parts[0].window, exr.parts[0].channels.len()), (WINDOW, 11));
        let ones = exr.parts[0].channel("p5.X.w0").unwrap();
        assert!(ones.iter().all(|x| *x == 4_294_967_296.0));
    }

    /// Bytes changed and files cut short, all over the file: an error of input, never other numbers.
    #[test]
    fn a_damaged_part_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let planes = write(&path);
        let whole = std::fs::read(&path).unwrap();
        let table = PartFile::open(&path).unwrap().table as usize;
        let chunks = table + 8 * 3;
        for at in (chunks..whole.len()).step_by(41) {
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << (at % 8);
            std::fs::write(&path, &bytes).unwrap();
            let file = PartFile::open(&path).unwrap();
            assert!(matches!(file.read(&planes, &mut |_, _, _| Ok(())), Err(Error::Input { .. })), "byte {at}");
        }
        for length in (0..whole.len()).step_by(211) {
            std::fs::write(&path, &whole[..length]).unwrap();
            let read = PartFile::open(&path).and_then(|file| file.read(&planes, &mut |_, _, _| Ok(())));
            assert!(matches!(read, Err(Error::Input { .. })), "length {length}");
        }
    }
}
