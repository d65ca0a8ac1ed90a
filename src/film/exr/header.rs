//! What the header of an OpenEXR file says, of any file: also of those whose pixels cannot be read here.
//!
//! Source: "OpenEXR File Layout" and "Standard Attributes", openexr.com (technical documentation).

use crate::error::{Error, Result};
use crate::film::Window;
use serde::Serialize;
use std::io::{BufReader, Read};
use std::path::Path;

/// A header of more bytes than this is none.
const LIMIT: u64 = 1 << 28;

/// The headers of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Headers {
    /// Whether the file has several parts, or is written as if.
    pub multipart: bool,
    /// Of each part.
    pub parts: Vec<Header>,
}

/// The header of a part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// Name, type and value of each attribute, in the order of the file.
    pub attributes: Vec<(String, String, Value)>,
    /// Whether the version field says that its pixels are in tiles.
    tiled: bool,
}

/// The value of an attribute.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// `string`; `timecode` as `01:02:03:04`.
    Text(String),
    /// `stringvector`.
    Texts(Vec<String>),
    /// `int`, `float`, `double`.
    Number(f64),
    /// Several numbers: boxes (least x, y, greatest x, y), vectors, matrices row by row, chromaticities, rationals (n, d).
    Numbers(Vec<f64>),
    /// `chlist`.
    Channels(Vec<Channel>),
    /// `compression`, `lineOrder`, `envmap`: the number of a name.
    Code(u8),
    /// Anything else: how many bytes.
    Bytes {
        /// Their number.
        bytes: usize,
    },
}

/// A channel as a header has it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Channel {
    /// With its layer: `layer.R`.
    pub name: String,
    /// `uint`, `half` or `float`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Pixels in x and y for each sample.
    pub sampling: [i32; 2],
}

impl Header {
    /// The attribute `name`.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.attributes.iter().find(|(known, ..)| known == name).map(|(.., value)| value)
    }

    /// A text.
    #[must_use]
    pub fn text(&self, name: &str) -> Option<&str> {
        match self.get(name)? {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// A number.
    #[must_use]
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.get(name)? {
            Value::Number(number) => Some(*number),
            _ => None,
        }
    }

    /// `N` numbers.
    #[must_use]
    pub fn numbers<const N: usize>(&self, name: &str) -> Option<[f64; N]> {
        match self.get(name)? {
            Value::Numbers(numbers) => numbers.as_slice().try_into().ok(),
            _ => None,
        }
    }

    /// A box of pixels; `None` where it is not there or empty.
    #[must_use]
    pub fn window(&self, name: &str) -> Option<Window> {
        let [x0, y0, x1, y1] = self.numbers::<4>(name)?;
        let side = |a: f64, b: f64| (b >= a).then_some((b - a + 1.0) as u32);
        Some(Window { x: x0 as i32, y: y0 as i32, width: side(x0, x1)?, height: side(y0, y1)? })
    }

    /// The channels.
    #[must_use]
    pub fn channels(&self) -> &[Channel] {
        match self.get("channels") {
            Some(Value::Channels(channels)) => channels,
            _ => &[],
        }
    }

    /// `scanlineimage`, `tiledimage`, `deepscanline` or `deeptile`.
    #[must_use]
    pub fn kind(&self) -> &str {
        self.text("type").unwrap_or(if self.tiled { "tiledimage" } else { "scanlineimage" })
    }

    /// The name of the compression, or its number where that has no name.
    #[must_use]
    pub fn compression(&self) -> String {
        const NAMES: [&str; 14] = [
            "none", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB", "HTJ2K256", "HTJ2K32", "LJ2K",
            "ZSTD",
        ];
        match self.get("compression") {
            Some(Value::Code(code)) => {
                NAMES.get(usize::from(*code)).map_or_else(|| format!("number {code}"), |name| (*name).to_owned())
            }
            _ => "unknown".to_owned(),
        }
    }

    /// Why the pixels of this part cannot be read here.
    #[must_use]
    pub fn unreadable(&self) -> Option<String> {
        if self.kind().starts_with("deep") {
            return Some("it holds deep pixels, of many depths each, which are not supported: flatten it first".into());
        }
        let thinned = |channel: &&Channel| channel.sampling != [1, 1];
        if let Some(channel) = self.channels().iter().find(thinned) {
            let chroma = ["RY", "BY"].contains(&channel.name.rsplit('.').next().unwrap_or(""));
            let what = if chroma { "it holds luminance and thinned chroma (YC)" } else { "" };
            let [x, y] = channel.sampling;
            return Some(match what {
                "" => {
                    format!("channel `{}` has a sample for {x} x {y} pixels only, which is not supported", channel.name)
                }
                what => format!("{what}, which is not supported: save it as RGB first"),
            });
        }
        match self.get("compression") {
            Some(Value::Code(code)) if *code >= 10 => {
                Some(format!("its compression ({}) is not supported: save it as ZIP first", self.compression()))
            }
            _ => None,
        }
    }
}

/// Reads the headers of `path`, and no pixel.
///
/// # Errors
/// [`Error::Input`] for a file that is missing, is no OpenEXR file, or whose header is cut off or broken.
pub fn read_headers(path: &Path) -> Result<Headers> {
    let file = crate::input::open(path).map_err(|e| Error::unread(path, &e))?;
    let mut reader = Reader { source: BufReader::new(file).take(LIMIT) };
    headers(&mut reader).map_err(|message| Error::input(path, message))
}

/// What was read, or what is wrong.
type Parsed<T> = std::result::Result<T, String>;

struct Reader<R> {
    source: R,
}

impl<R: Read> Reader<R> {
    fn bytes(&mut self, length: usize) -> Parsed<Vec<u8>> {
        let mut bytes = Vec::new();
        let read = (&mut self.source).take(length as u64).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
        if read == length { Ok(bytes) } else { Err("not a valid OpenEXR file: its header is cut off".into()) }
    }

    fn word(&mut self) -> Parsed<u32> {
        let bytes = self.bytes(4)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    /// Text up to a zero.
    fn name(&mut self) -> Parsed<String> {
        let mut bytes = Vec::new();
        loop {
            match self.bytes(1)?[0] {
                0 => break,
                byte => bytes.push(byte),
            }
            if bytes.len() > 255 {
                return Err("not a valid OpenEXR file: a name in its header has no end".into());
            }
        }
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}

fn headers<R: Read>(reader: &mut Reader<R>) -> Parsed<Headers> {
    if reader.bytes(4).unwrap_or_default() != [0x76, 0x2f, 0x31, 0x01] {
        return Err("not a valid OpenEXR file: it begins otherwise".into());
    }
    let version = reader.word()?;
    if version & 0xff != 2 {
        return Err(format!("OpenEXR files of version {} are not supported", version & 0xff));
    }
    let multipart = version & 0x1000 != 0;
    let mut parts = Vec::new();
    loop {
        let mut header = Header { attributes: Vec::new(), tiled: version & 0x200 != 0 };
        loop {
            let name = reader.name()?;
            if name.is_empty() {
                break;
            }
            let kind = reader.name()?;
            let length = reader.word()? as usize;
            let bytes = reader.bytes(length)?;
            let value = value(&kind, &bytes)
                .ok_or_else(|| format!("not a valid OpenEXR file: its attribute `{name}` is no {kind}"))?;
            header.attributes.push((name, kind, value));
        }
        match (multipart, header.attributes.is_empty()) {
            (true, true) => break,
            (false, true) => return Err("not a valid OpenEXR file: its header is empty".into()),
            (_, false) => parts.push(header),
        }
        if !multipart {
            break;
        }
    }
    if parts.is_empty() {
        return Err("the file has no part with pixels".into());
    }
    for part in &parts {
        let needed = part.window("dataWindow").is_some() && part.window("displayWindow").is_some();
        if !needed || part.channels().is_empty() {
            return Err("not a valid OpenEXR file: its header does not say which pixels and channels it has".into());
        }
    }
    Ok(Headers { multipart, parts })
}

/// `None` where `bytes` cannot be of that type.
fn value(kind: &str, bytes: &[u8]) -> Option<Value> {
    let words = || bytes.chunks_exact(4).map(|b| [b[0], b[1], b[2], b[3]]);
    let ints = |n: usize| (bytes.len() == 4 * n).then(|| words().map(|b| f64::from(i32::from_le_bytes(b))).collect());
    let floats = |n: usize| (bytes.len() == 4 * n).then(|| words().map(|b| f64::from(f32::from_le_bytes(b))).collect());
    let doubles = |n: usize| {
        let eight = |b: &[u8]| Some(f64::from_le_bytes(b.try_into().ok()?));
        if bytes.len() == 8 * n { bytes.chunks_exact(8).map(eight).collect::<Option<Vec<f64>>>() } else { None }
    };
    let one = |numbers: Option<Vec<f64>>| numbers.map(|n| Value::Number(n[0]));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    match kind {
        "string" => Some(Value::Text(text(bytes))),
        "stringvector" => {
            let (mut all, mut rest) = (Vec::new(), bytes);
            while let Some((length, after)) = rest.split_at_checked(4) {
                let length = u32::from_le_bytes(length.try_into().ok()?) as usize;
                let (one, after) = after.split_at_checked(length)?;
                all.push(text(one));
                rest = after;
            }
            Some(Value::Texts(all))
        }
        "int" => one(ints(1)),
        "float" => one(floats(1)),
        "double" => one(doubles(1)),
        "box2i" => ints(4).map(Value::Numbers),
        "v2i" => ints(2).map(Value::Numbers),
        "v3i" => ints(3).map(Value::Numbers),
        "v2f" => floats(2).map(Value::Numbers),
        "v3f" => floats(3).map(Value::Numbers),
        "box2f" => floats(4).map(Value::Numbers),
        "chromaticities" => floats(8).map(Value::Numbers),
        "m33f" => floats(9).map(Value::Numbers),
        "m44f" => floats(16).map(Value::Numbers),
        "v2d" => doubles(2).map(Value::Numbers),
        "v3d" => doubles(3).map(Value::Numbers),
        "m33d" => doubles(9).map(Value::Numbers),
        "m44d" => doubles(16).map(Value::Numbers),
        "rational" => {
            let [n, d]: [[u8; 4]; 2] = words().collect::<Vec<_>>().try_into().ok()?;
            Some(Value::Numbers(vec![i32::from_le_bytes(n).into(), u32::from_le_bytes(d).into()]))
        }
        "timecode" => match bytes {
            &[frames, seconds, minutes, hours, _, _, _, _] => {
                Some(Value::Text(time([hours, minutes, seconds, frames])))
            }
            _ => None,
        },
        "compression" | "lineOrder" | "envmap" => match bytes {
            [code] => Some(Value::Code(*code)),
            _ => None,
        },
        "chlist" => channels(bytes).map(Value::Channels),
        _ => Some(Value::Bytes { bytes: bytes.len() }),
    }
}

/// The time of a time code for 60 fields, decimal digits with flags above them: bit 6 of the frames says that some are dropped, bit 7
/// of the seconds that this is the second of two frames.
fn time([hours, minutes, seconds, frames]: [u8; 4]) -> String {
    let number = |byte: u8, tens: u8| 10 * (byte >> 4 & tens) + (byte & 0xf);
    let dropped = if frames & 0x40 == 0 { ':' } else { ';' };
    let second = if seconds & 0x80 == 0 { "" } else { ", the second of two" };
    let (hours, minutes) = (number(hours, 3), number(minutes, 7));
    let (seconds, frames) = (number(seconds, 7), number(frames, 3));
    format!("{hours:02}:{minutes:02}:{seconds:02}{dropped}{frames:02}{second}")
}

/// Each channel: its name and a zero, its type, linearity and three bytes, its sampling in x and y; then a zero.
fn channels(mut bytes: &[u8]) -> Option<Vec<Channel>> {
    let mut all = Vec::new();
    loop {
        let end = bytes.iter().position(|b| *b == 0)?;
        if end == 0 {
            return Some(all);
        }
        let (name, rest) = bytes.split_at(end);
        let (fixed, after) = rest[1..].split_at_checked(16)?;
        let word = |i: usize| Some(i32::from_le_bytes(fixed[i..i + 4].try_into().ok()?));
        let kind = *["uint", "half", "float"].get(usize::try_from(word(0)?).ok()?)?;
        let sampling = [word(8)?, word(12)?];
        all.push(Channel { name: String::from_utf8_lossy(name).into_owned(), kind, sampling });
        bytes = after;
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{image, rec709};
    use super::super::{Base, Compression, Precision, StandardError, beauty, encode_exr, read_exr};
    use super::*;

    fn ours() -> Vec<u8> {
        let (precision, error) = (Precision::Half, StandardError::Leave);
        let picture = beauty(&image(0.5), Base::Rgba, Vec::new(), rec709(), precision, error, Compression::Zips);
        encode_exr(&picture.exr).unwrap()
    }

    fn read(bytes: &[u8]) -> (Result<Headers>, Result<()>) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        std::fs::write(&path, bytes).unwrap();
        (read_headers(&path), read_exr(&path).map(|_| ()))
    }

    /// The place behind `name` and the type of that attribute and its length: where its value begins.
    fn value_at(bytes: &[u8], name: &str, kind: &str) -> usize {
        let pattern = [name.as_bytes(), &[0], kind.as_bytes(), &[0]].concat();
        bytes.windows(pattern.len()).position(|w| w == pattern).unwrap() + pattern.len() + 4
    }

    #[test]
    fn a_header_of_ours_is_read_with_its_types() {
        let (headers, _) = read(&ours());
        let headers = headers.unwrap();
        let [part] = headers.parts.as_slice() else { panic!("one part") };
        assert_eq!((part.kind(), part.compression().as_str()), ("scanlineimage", "ZIPS"));
        assert_eq!(part.channels()[0], Channel { name: "A".into(), kind: "half", sampling: [1, 1] });
        assert_eq!(part.text("colorInteropID"), Some("lin_rec709_scene"));
        assert!((part.numbers::<8>("chromaticities").unwrap()[0] - 0.64).abs() < 1e-7);
        assert_eq!(part.unreadable(), None);
    }

    #[test]
    fn a_time_code_is_read_as_it_is_said() {
        let code = |bits: u32| value("timecode", &[bits.to_le_bytes(), [0; 4]].concat());
        let text = |text: &str| Some(Value::Text(text.to_owned()));
        assert_eq!(code(0x0102_0304), text("01:02:03:04"));
        assert_eq!(code(0x2359_5929), text("23:59:59:29"));
        assert_eq!(code(0x0102_0344), text("01:02:03;04"));
        assert_eq!(code(0x0102_8304), text("01:02:03:04, the second of two"));
        assert_eq!(value("timecode", &[0; 4]), None);
    }

    /// What cannot be read is said in one line, by the header alone.
    #[test]
    fn thinned_channels_and_new_compressions_are_refused() {
        let mut thinned = ours();
        // Of channel A: name, zero, type, linearity and three bytes, then sampling.
        let at = value_at(&thinned, "channels", "chlist") + 2 + 8;
        thinned[at] = 2;
        let (headers, pixels) = read(&thinned);
        assert!(headers.is_ok());
        assert!(
            pixels
                .unwrap_err()
                .to_string()
                .ends_with("channel `A` has a sample for 2 x 1 pixels only, which is not supported")
        );
        let mut new = ours();
        let at = value_at(&new, "compression", "compression");
        for (code, name) in [(10, "HTJ2K256"), (13, "ZSTD"), (14, "number 14")] {
            new[at] = code;
            let refusal = read(&new).1.unwrap_err().to_string();
            assert!(
                refusal.ends_with(&format!("its compression ({name}) is not supported: save it as ZIP first")),
                "{refusal}"
            );
        }
    }

    #[test]
    fn every_cut_and_every_flipped_byte_of_a_header_ends_in_words() {
        let bytes = ours();
        for length in 0..400 {
            assert!(read(&bytes[..length]).0.is_err(), "{length}");
        }
        for at in 4..400 {
            for flip in [0xff, 0x01, 0x80] {
                let mut bytes = bytes.clone();
                bytes[at] ^= flip;
                // Read or refused, and no panic.
                let _ = read(&bytes);
            }
        }
    }
}
