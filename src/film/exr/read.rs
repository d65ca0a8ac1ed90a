//! Reads any flat OpenEXR file that the `exr` crate can decode.

use super::chunks;
use super::content_hash;
use super::header::{Header, read_headers};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::spectrum::ColourSpace;
use ::exr::compression::Compression;
use ::exr::image::FlatSamples;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, IntegerBounds, Text};
use ::exr::prelude::{ReadChannels, ReadLayers, read};
use std::io::{Read, Seek};
use std::path::Path;

/// Files with more samples than this (8 GiB as f32) are refused rather than risked.
const SAMPLES_LIMIT: u64 = 1 << 31;

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrFile {
    /// The display window: the frame.
    pub display: Window,
    /// CIE x, y of red, green, blue and white, if the file says.
    pub chromaticities: Option<[[f32; 2]; 4]>,
    /// The parts, at least one.
    pub parts: Vec<ExrPart>,
}

/// One part of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrPart {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// The data window.
    pub window: Window,
    /// Channels by name; samples in raster order. Integers are rounded to 24 bits.
    pub channels: Vec<(String, Vec<f32>)>,
    /// Those of integers, as they are.
    pub integers: Vec<(String, Vec<u32>)>,
    /// Attributes that are texts or integers, as text, sorted by name.
    pub texts: Vec<(String, String)>,
}

/// The samples of a channel, none of them rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Samples<'a> {
    /// Of floats.
    Float(&'a [f32]),
    /// Of integers.
    Integer(&'a [u32]),
}

impl<'a> Samples<'a> {
    /// The sample of pixel `i`.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub fn at(self, i: usize) -> f64 {
        match self {
            Samples::Float(samples) => samples[i].into(),
            Samples::Integer(samples) => samples[i].into(),
        }
    }

    /// All of them.
    pub fn iter(self) -> impl Iterator<Item = f64> + 'a {
        let count = match self {
            Samples::Float(samples) => samples.len(),
            Samples::Integer(samples) => samples.len(),
        };
        (0..count).map(move |i| self.at(i))
    }
}

impl ExrFile {
    /// CIE x, y of red, green, blue and white: Rec. 709's where the file does not say, as OpenEXR has it.
    #[must_use]
    pub fn primaries(&self) -> [[f64; 2]; 4] {
        self.chromaticities.map_or(ColourSpace::Rec709.chromaticities(), |all| all.map(|xy| xy.map(f64::from)))
    }

    /// The hash of the channels of all parts, as [`super::ExrImage::content_hash`].
    #[must_use]
    pub fn content_hash(&self) -> String {
        let channels = self.parts.iter().flat_map(|part| &part.channels);
        let bytes = |plane: &[f32]| plane.iter().flat_map(|x| x.to_bits().to_le_bytes()).collect();
        content_hash(channels.map(|(name, plane)| (name.as_str(), plane.as_slice())), bytes)
    }
}

impl ExrPart {
    /// The samples of the channel `name`.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(n, _)| n == name).map(|(_, samples)| samples.as_slice())
    }

    /// The samples of the channel `name` as they stand in the file.
    #[must_use]
    pub fn samples(&self, name: &str) -> Option<Samples<'_>> {
        match self.integers.iter().find(|(n, _)| n == name) {
            Some((_, samples)) => Some(Samples::Integer(samples)),
            None => self.channel(name).map(Samples::Float),
        }
    }

    /// The attribute `name` that is a text or an integer.
    #[must_use]
    pub fn text(&self, name: &str) -> Option<&str> {
        self.texts.iter().find(|(n, _)| n == name).map(|(_, text)| text.as_str())
    }
}

/// Reads `path`: all parts, the largest level of each.
///
/// # Errors
/// [`Error::Input`]: the file is missing, is no OpenEXR file, is damaged, or holds what cannot be read (deep data,
/// channels with fewer samples than pixels, an unknown compression).
pub fn read_exr(path: &Path) -> Result<ExrFile> {
    let fail = |e: ::exr::error::Error| Error::input(path, words(e));
    let headers = read_headers(path)?;
    if let Some(why) = headers.parts.iter().find_map(Header::unreadable) {
        return Err(Error::input(path, why));
    }
    let file = std::fs::File::open(path).map_err(|e| Error::input(path, e.to_string()))?;
    let mut reader = std::io::BufReader::new(file);
    let meta = MetaData::read_from_buffered(&mut reader, false).map_err(fail)?;
    let length = reader.get_ref().metadata().map_err(|e| Error::input(path, e.to_string()))?.len();
    check_size(path, &meta, length)?;
    if !chunks::counts_can_be(&mut reader, &meta, length).map_err(|e| Error::input(path, e.to_string()))? {
        return Err(Error::input(path, "not a valid OpenEXR file: a chunk announces more than its pixels can take"));
    }
    reader.rewind().map_err(|e| Error::input(path, e.to_string()))?;
    let file = parts_of(reader).map_err(fail)?;
    if file.parts.is_empty() {
        return Err(Error::input(path, "the file has no part with pixels"));
    }
    Ok(file)
}

/// What [`read_exr`] will read of the `bytes` of a file.
///
/// # Errors
/// Why they are none.
pub(super) fn decode(bytes: &[u8]) -> std::result::Result<ExrFile, String> {
    parts_of(std::io::Cursor::new(bytes)).map_err(words)
}

/// All parts, the largest level of each.
fn parts_of(reader: impl Read + Seek) -> ::exr::error::Result<ExrFile> {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(reader)?;

    let shared = &image.attributes;
    let mut parts = Vec::new();
    for layer in image.layer_data {
        let own = &layer.attributes;
        let size = [layer.size.width() as u32, layer.size.height() as u32];
        let window = Window { x: own.layer_position.x(), y: own.layer_position.y(), width: size[0], height: size[1] };
        let (mut channels, mut integers) = (Vec::new(), Vec::new());
        for channel in layer.channel_data.list {
            let name = text(&channel.name);
            let samples = match channel.sample_data {
                FlatSamples::F16(samples) => samples.into_iter().map(half::f16::to_f32).collect(),
                FlatSamples::F32(samples) => samples,
                FlatSamples::U32(samples) => {
                    let rounded = samples.iter().map(|&v| v as f32).collect();
                    integers.push((name.clone(), samples));
                    rounded
                }
            };
            channels.push((name, samples));
        }
        let known = [
            ("capDate", &own.capture_date),
            ("comments", &own.comments),
            ("lookModTransform", &own.look_modification_transform_name),
            ("owner", &own.owner),
            ("renderingTransform", &own.rendering_transform_name),
            ("software", &own.software_name),
            ("view", &own.view_name),
            ("wrapmodes", &own.wrap_mode_name),
        ];
        let known = known.iter().filter_map(|(name, value)| Some(((*name).to_string(), text(value.as_ref()?))));
        let custom = own.other.iter().chain(&shared.other).filter_map(|(name, value)| match value {
            AttributeValue::Text(value) => Some((text(name), text(value))),
            AttributeValue::I32(value) => Some((text(name), value.to_string())),
            _ => None,
        });
        let mut texts: Vec<(String, String)> = known.chain(custom).collect();
        texts.sort();
        parts.push(ExrPart { name: own.layer_name.as_ref().map(text), window, channels, integers, texts });
    }
    let chromaticities = shared.chromaticities.map(|c| [c.red, c.green, c.blue, c.white].map(|p| [p.x(), p.y()]));
    Ok(ExrFile { display: window(shared.display_window), chromaticities, parts })
}

fn window(bounds: IntegerBounds) -> Window {
    let IntegerBounds { position, size } = bounds;
    Window { x: position.x(), y: position.y(), width: size.width() as u32, height: size.height() as u32 }
}

/// Text as UTF-8, which the specification asks for; other bytes become replacement characters.
fn text(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}

/// Refuses a file of `length` bytes whose header announces more samples than can be held, or than it can have: memory is taken
/// for all that is announced, before it is read.
fn check_size(path: &Path, meta: &MetaData, length: u64) -> Result<()> {
    let (mut samples, mut packed) = (0u64, 0u64);
    for header in &meta.headers {
        let pixels = (header.layer_size.width() as u64).saturating_mul(header.layer_size.height() as u64);
        let channels = &header.channels.list;
        samples = samples.saturating_add(pixels.saturating_mul(channels.len() as u64));
        let bytes: u64 = channels.iter().map(|channel| channel.sample_type.bytes_per_sample() as u64).sum();
        packed = packed.saturating_add(pixels.saturating_mul(bytes).div_ceil(most_unpacked(header.compression)));
    }
    let fail =
        |than: String| Err(Error::input(path, format!("the header announces {samples} samples, more than {than}")));
    match () {
        () if samples > SAMPLES_LIMIT => fail("can be held".into()),
        () if packed > length => fail(format!("a file of {length} bytes can have")),
        () => Ok(()),
    }
}

/// How many bytes of samples a byte of a file gives at the most.
fn most_unpacked(compression: Compression) -> u64 {
    /// 258 bytes by a code of two bits (RFC 1951).
    const DEFLATED: u64 = 1032;
    /// 128 bytes by two.
    const RUNS: u64 = 64;
    match compression {
        Compression::Uncompressed => 1,
        Compression::RLE => RUNS,
        Compression::ZIP1 | Compression::ZIP16 => DEFLATED,
        // Three bytes for the four of a float.
        Compression::PXR24 => DEFLATED.div_ceil(3) * 4,
        // 256 numbers of two bytes by two codes of a bit and a count of eight.
        Compression::PIZ => 410,
        // 16 numbers of two bytes by three bytes, where they are the same.
        Compression::B44 | Compression::B44A => 11,
        // 64 floats by two numbers of two bytes, or runs, which are then deflated.
        Compression::DWAA(_) | Compression::DWAB(_) => RUNS * DEFLATED,
        // Refused before.
        Compression::HTJ2K32 | Compression::HTJ2K256 => u64::MAX,
    }
}

fn words(e: ::exr::error::Error) -> String {
    match e {
        ::exr::error::Error::NotSupported(what) => format!("not supported: {what}"),
        ::exr::error::Error::Invalid(what) => format!("not a valid OpenEXR file: {what}"),
        // Of a place to go on from that is beyond what a file can have.
        ::exr::error::Error::Io(e) if e.kind() == std::io::ErrorKind::InvalidInput => {
            "not a valid OpenEXR file: its table of chunks points beyond its end".to_owned()
        }
        ::exr::error::Error::Io(e) => e.to_string(),
        ::exr::error::Error::Aborted => "reading was stopped".to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{image, rec709};
    use super::super::{Base, Compression, Precision, StandardError, beauty, encode_exr};
    use super::*;

    fn file(bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        std::fs::write(&path, bytes).unwrap();
        (dir, path)
    }

    /// The first chunk begins behind the table, which has one entry for each row of `zips`. A place of 2⁶⁴ − 1 was told as "Invalid
    /// argument (os error 22)".
    #[test]
    fn a_table_of_chunks_that_points_nowhere_is_told_in_words() {
        let image = image(0.5);
        let beauty =
            beauty(&image, Base::Rgba, Vec::new(), rec709(), Precision::Half, StandardError::Leave, Compression::Zips);
        let mut bytes = encode_exr(&beauty.exr).unwrap();
        let rows = image.window.height as usize;
        let entry = |bytes: &[u8], at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        let table = (0..bytes.len() - 8).find(|&at| entry(&bytes, at) == (at + 8 * rows) as u64).unwrap();
        bytes[table..table + 8].fill(0xff);
        let (_dir, path) = file(&bytes);
        let e = read_exr(&path).unwrap_err().to_string();
        assert!(e.ends_with("not a valid OpenEXR file: its table of chunks points beyond its end"), "{e}");
    }

    #[test]
    fn a_missing_or_foreign_file_is_told_in_words() {
        let e = read_exr(Path::new("/nowhere/a.exr")).unwrap_err().to_string();
        assert_eq!(e, "/nowhere/a.exr: there is no such file");
        let (_dir, path) = file(b"no picture at all");
        let e = read_exr(&path).unwrap_err();
        assert!(matches!(e, Error::Input { .. }) && e.to_string().contains("not a valid OpenEXR file"), "{e}");
    }

    /// Every prefix of a file is an error and no panic.
    #[test]
    fn a_truncated_file_is_an_error() {
        let beauty = beauty(
            &image(0.5),
            Base::Rgba,
            Vec::new(),
            rec709(),
            Precision::Half,
            StandardError::Leave,
            Compression::Zips,
        );
        let bytes = encode_exr(&beauty.exr).unwrap();
        for length in (0..bytes.len()).step_by(7) {
            let (_dir, path) = file(&bytes[..length]);
            assert!(read_exr(&path).is_err(), "{length} of {} bytes", bytes.len());
        }
    }

    /// Data windows in a file of a few hundred bytes: of 2²⁹ × 2²⁹ pixels, and of 2²⁶ × 1, whose half a gigabyte may be held, and
    /// would need a thousandth of that in the file.
    #[test]
    fn a_header_that_announces_too_much_is_refused() {
        let beauty = beauty(
            &image(0.5),
            Base::Rgba,
            Vec::new(),
            rec709(),
            Precision::Half,
            StandardError::Leave,
            Compression::Zips,
        );
        let whole = encode_exr(&beauty.exr).unwrap();
        let name = b"dataWindow\0box2i\0";
        let at = whole.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4 + 8;
        let found = format!("more than a file of {} bytes can have", whole.len());
        for (right, bottom, told) in [(1 << 29, 1 << 29, "more than can be held"), ((1 << 26) - 1, 2, &found)] {
            let mut bytes = whole.clone();
            bytes[at..at + 4].copy_from_slice(&i32::to_le_bytes(right));
            bytes[at + 4..at + 8].copy_from_slice(&i32::to_le_bytes(bottom));
            let (_dir, path) = file(&bytes);
            let message = read_exr(&path).unwrap_err().to_string();
            assert!(message.contains(told), "{message}");
        }
    }

    /// Zeros, packed as tightly as they can be.
    #[test]
    fn what_packs_well_is_read() {
        use super::super::{ChannelData, ExrImage, Layout};
        let samples = 4096 * 256;
        for compression in [
            Compression::None,
            Compression::Zips,
            Compression::Zip,
            Compression::Piz,
            Compression::Dwaa(45.0),
            Compression::Dwab(45.0),
        ] {
            let image = ExrImage {
                frame: [4096, 256],
                window: Window::full(4096, 256),
                channels: ["B", "G", "R"].map(|name| (name.to_owned(), ChannelData::F32(vec![0.0; samples]))).into(),
                colour: None,
                attributes: Vec::new(),
                data: std::collections::BTreeSet::new(),
                compression,
                layout: Layout::Single,
            };
            let (_dir, path) = file(&encode_exr(&image).unwrap());
            let read = read_exr(&path).unwrap();
            assert!(read.parts[0].channels.iter().all(|(_, found)| *found == vec![0.0; samples]), "{compression:?}");
        }
    }
}
