//! Files of pixels, as they are decoded.

use super::{jpeg, pfm};
use crate::error::{Error, Result};
use crate::film::exr;
use crate::scene::bands::is_band;
use image::ImageDecoder;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::io::{Cursor, Read};
use std::panic::AssertUnwindSafe;
use std::path::{Path, PathBuf};

/// The most bytes a decoded picture may take: 2 GiB.
pub(super) const LARGEST: u64 = 1 << 31;

/// What is read.
const KINDS: &str = "a PNG, JPEG, BMP, TGA, PNM, PFM, HDR or EXR picture";

pub(super) fn decode(path: &Path) -> Result<image::DynamicImage> {
    let bytes = crate::input::read(path).map_err(|e| Error::input(path, words(&e)))?;
    if image::guess_format(&bytes).is_ok_and(|format| format == image::ImageFormat::Jpeg)
        && let Some(fault) = jpeg::fault(&bytes)
    {
        return Err(Error::input(path, fault));
    }
    let fault = |e: &dyn Display| Error::input(path, format!("expected {KINDS}: {e}"));
    if pfm::is(&bytes) {
        return pfm::decode(&bytes).map_err(|e| fault(&e));
    }
    let decoder = decoder(path, bytes)?;
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(Error::input(path, format!("expected a picture of one pixel or more, found {width} x {height}")));
    }
    if decoder.total_bytes() > LARGEST {
        return Err(Error::input(
            path,
            format!("expected a picture of at most 2 GiB, found {width} x {height} pixels"),
        ));
    }
    // A damaged file that a decoder was not written for is no reason to end a batch.
    let pixels = std::panic::catch_unwind(AssertUnwindSafe(|| image::DynamicImage::from_decoder(decoder)));
    pixels.map_err(|_| fault(&"its decoder gave up"))?.map_err(|e| fault(&e))
}

/// What decodes the `bytes` of the picture `path`, of a kind that the decoders know; they have seen no pixel yet.
pub(super) fn decoder(path: &Path, mut bytes: Vec<u8>) -> Result<impl ImageDecoder> {
    // Radiance pictures have either signature; the decoder knows one.
    if bytes.starts_with(b"#?RGBE") {
        bytes.splice(..6, *b"#?RADIANCE");
    }
    let mut reader = image::ImageReader::new(Cursor::new(bytes));
    if let Ok(format) = image::ImageFormat::from_path(path) {
        reader.set_format(format);
    }
    let mut reader = reader.with_guessed_format().map_err(|e| Error::input(path, words(&e)))?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(LARGEST);
    reader.limits(limits);
    reader.into_decoder().map_err(|e| Error::input(path, format!("expected {KINDS}: {e}")))
}

/// A file of pixels, as it was decoded.
#[derive(Debug)]
pub enum Decoded {
    /// EXR.
    Exr(exr::ExrFile),
    /// 8 bits a channel.
    Bytes {
        /// Red, green and blue in turn.
        rgb: Vec<u8>,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Its colours, where they have been counted.
        counted: Option<Counted>,
    },
    /// All others.
    Other(image::DynamicImage),
}

/// The colours of a picture: each once, and for each pixel the number of its own.
#[derive(Debug)]
pub struct Counted {
    pub(super) colours: Vec<[u8; 3]>,
    pub(super) numbers: Vec<u32>,
}

/// Reads a file of pixels.
///
/// # Errors
/// [`Error::Input`] where there is no such file or it is no picture.
pub fn open(path: &Path) -> Result<Decoded> {
    use image::ColorType::{L8, La8, Rgb8, Rgba8};
    if is_exr(path) {
        return exr::read_exr(path).map(with_picture_first).map(Decoded::Exr);
    }
    let decoded = decode(path)?;
    if !matches!(decoded.color(), L8 | La8 | Rgb8 | Rgba8) {
        return Ok(Decoded::Other(decoded));
    }
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    Ok(Decoded::Bytes { rgb: decoded.into_rgb8().into_raw(), width, height, counted: None })
}

/// Whether a file is to be read as EXR: it begins as one, whatever it is called, or is called so and begins as nothing else.
pub(super) fn is_exr(path: &Path) -> bool {
    let mut first = Vec::new();
    // A file that cannot be read says so to who reads it.
    let _ = crate::input::open(path).and_then(|file| file.take(LONGEST_SIGNATURE).read_to_end(&mut first));
    match image::guess_format(&first) {
        Ok(image::ImageFormat::OpenExr) => true,
        Ok(_) => false,
        Err(_) => extension(path) == "exr" && !pfm::is(&first),
    }
}

/// Bytes at the beginning of a file by which its kind is told: those of WebP and AVIF are twelve.
const LONGEST_SIGNATURE: u64 = 16;

/// The names of colours, and those that some writers give them.
pub(super) const COLOURS: [[&str; 3]; 2] = [["R", "G", "B"], ["r", "g", "b"]];

/// The file with the part first that has a picture. Where colours are in layers alone, they are those of the one layer that
/// has red, green and blue, or among several those of Blender's `Combined`.
pub(super) fn with_picture_first(mut file: exr::ExrFile) -> exr::ExrFile {
    let is_band = |(name, _): &(String, Vec<f32>)| is_band(name);
    let has = |part: &exr::ExrPart, before: &str, names: [&str; 3]| {
        names.iter().all(|name| part.channel(&format!("{before}{name}")).is_some())
    };
    let in_colour = |part: &exr::ExrPart| has(part, "", COLOURS[0]) || part.channels.iter().any(is_band);
    let of = |is_one: &dyn Fn(&exr::ExrPart) -> bool| file.parts.iter().position(is_one);
    let mut first = of(&in_colour).or_else(|| of(&|part| part.channel("Y").is_some()));
    if first.is_none() {
        let names =
            file.parts.iter().enumerate().flat_map(|(i, part)| part.channels.iter().map(move |(name, _)| (i, name)));
        let layers = names.flat_map(|(i, name)| COLOURS.map(|colours| (i, name.strip_suffix(colours[0]), colours)));
        let whole = |(i, before, colours): (usize, Option<&str>, [&'static str; 3])| {
            before.filter(|before| has(&file.parts[i], before, colours)).map(|before| (i, before.to_owned(), colours))
        };
        let layers: Vec<_> = layers.filter_map(whole).collect();
        let combined = layers.iter().find(|(_, before, _)| before.ends_with("Combined."));
        if let Some((i, before, colours)) = combined.or(layers.first().filter(|_| layers.len() == 1)) {
            for (name, _) in &mut file.parts[*i].channels {
                if let Some(k) = colours.iter().position(|colour| *name == format!("{before}{colour}")) {
                    COLOURS[0][k].clone_into(name);
                }
            }
            first = Some(*i);
        }
    }
    if let Some(first) = first {
        file.parts[..=first].rotate_right(1);
    }
    file
}

pub(super) fn extension(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

/// What a picture is wanted for, as far as is known before it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wanted {
    /// Its pixels.
    Pixels,
    /// Its colours.
    Colours,
}

/// Pictures that are decoded before they are asked for.
#[derive(Debug, Default)]
pub struct Pictures {
    decoded: HashMap<PathBuf, Decoded>,
}

impl Pictures {
    /// All of `wanted` that can be read, on the current rayon pool.
    #[must_use]
    pub fn of<'a>(wanted: impl Iterator<Item = (&'a Path, Wanted)>) -> Pictures {
        let mut distinct: BTreeMap<&Path, Wanted> = BTreeMap::new();
        for (path, what) in wanted {
            let known = distinct.entry(path).or_insert(what);
            *known = what.max(*known);
        }
        let read = |(path, what): (&Path, Wanted)| {
            let mut decoded = open(path).ok()?;
            if let (Decoded::Bytes { rgb, counted, .. }, Wanted::Colours) = (&mut decoded, what) {
                *counted = Some(count(rgb));
            }
            Some((path.to_path_buf(), decoded))
        };
        let distinct: Vec<(&Path, Wanted)> = distinct.into_iter().collect();
        Pictures { decoded: distinct.into_par_iter().filter_map(read).collect() }
    }

    /// What `path` holds; it is read again where it is asked for again.
    ///
    /// # Errors
    /// As [`open`].
    pub fn take(&mut self, path: &Path) -> Result<Decoded> {
        self.decoded.remove(path).map_or_else(|| open(path), Ok)
    }
}

pub(super) fn words(e: &std::io::Error) -> String {
    match e.kind() {
        std::io::ErrorKind::NotFound => "expected a file, found none".into(),
        std::io::ErrorKind::PermissionDenied => "no permission to read the file".into(),
        _ => e.to_string(),
    }
}

/// Pictures of so many pixels at the most have their colours numbered in a table of their own size.
const SMALL: usize = 1 << 18;

/// The colours of pixels (red, green, blue in turn).
pub(super) fn count(pixels: &[u8]) -> Counted {
    let pixels = pixels.as_chunks().0;
    if pixels.len() <= SMALL {
        return count_few(pixels);
    }
    // For each of the 2²⁴ colours its number among those met so far, from 1; only the pages that hold a colour
    // of the picture become memory.
    let mut number = vec![0u32; 1 << 24];
    let mut colours: Vec<[u8; 3]> = Vec::new();
    let numbers = pixels
        .iter()
        .map(|&[r, g, b]| {
            let number = &mut number[usize::from(r) << 16 | usize::from(g) << 8 | usize::from(b)];
            if *number == 0 {
                colours.push([r, g, b]);
                *number = colours.len() as u32;
            }
            *number - 1
        })
        .collect();
    Counted { colours, numbers }
}

/// The same with at least twice as many places as pixels, since memory that is touched for the first time is dearer than to look for
/// a place.
fn count_few(pixels: &[[u8; 3]]) -> Counted {
    let bits = (2 * pixels.len()).next_power_of_two().ilog2().max(1);
    let mut places = vec![0u32; 1 << bits];
    let mut colours: Vec<[u8; 3]> = Vec::new();
    let number = |&[r, g, b]: &[u8; 3]| {
        // The golden ratio of 2³² keeps neighbours apart (Knuth, The Art of Computer Programming 3, section 6.4).
        let hash = u32::from_be_bytes([0, r, g, b]).wrapping_mul(0x9e37_79b1);
        let mut at = (hash >> (32 - bits)) as usize;
        while places[at] != 0 && colours[places[at] as usize - 1] != [r, g, b] {
            at = (at + 1) & (places.len() - 1);
        }
        if places[at] == 0 {
            colours.push([r, g, b]);
            places[at] = colours.len() as u32;
        }
        places[at] - 1
    };
    let numbers = pixels.iter().map(number).collect();
    Counted { colours, numbers }
}

#[cfg(test)]
mod tests {
    use super::super::{exr_colours, picture};
    use super::*;
    use crate::film::Window;

    /// All 2¹⁸ colours of six bits a channel: numbers go as they are met, in a small picture and in a large one that has them twice.
    #[test]
    fn colours_are_numbered_as_they_are_met() {
        let pixel = |i: u32| [i >> 10 & 0xfc, i >> 4 & 0xfc, i << 2 & 0xfc].map(|x| x as u8);
        let once: Vec<[u8; 3]> = (0..1 << 18).map(|i| pixel(i * 77 % (1 << 18))).collect();
        for times in [1, 2] {
            let found = count(once.repeat(times).as_flattened());
            assert!(found.colours == once);
            assert!(found.numbers.iter().copied().eq((0..times).flat_map(|_| 0..1 << 18)));
        }
    }

    /// Parts of one pixel each: the value of red in what is taken for the picture, and whether there is one.
    #[test]
    fn the_picture_of_a_file_of_layers_is_found() {
        let part = |channels: &[(&str, f32)]| exr::ExrPart {
            name: None,
            window: Window::full(1, 1),
            channels: channels.iter().map(|(name, value)| ((*name).to_owned(), vec![*value])).collect(),
            integers: Vec::new(),
            texts: Vec::new(),
        };
        let red = |parts: Vec<exr::ExrPart>| {
            let file = exr::ExrFile { display: Window::full(1, 1), chromaticities: None, parts };
            let file = with_picture_first(file);
            exr_colours(Path::new("a.exr"), &file).ok().map(|pixels| pixels[0][0])
        };
        let layer = |before: &str, value: f32| {
            let names = ["R", "G", "B"].map(|c| format!("{before}{c}"));
            part(&names.each_ref().map(|name| (name.as_str(), value)))
        };
        let depth = || part(&[("Z", 9.0)]);
        assert_eq!(red(vec![layer("", 1.0), layer("", 2.0)]), Some(1.0));
        assert_eq!(red(vec![depth(), layer("", 2.0)]), Some(2.0));
        assert_eq!(red(vec![part(&[("Y", 3.0)]), layer("", 2.0)]), Some(2.0));
        assert_eq!(red(vec![depth(), part(&[("Y", 3.0)])]), Some(3.0));
        assert_eq!(red(vec![part(&[("b", 6.0), ("g", 5.0), ("r", 4.0)])]), Some(4.0));
        assert_eq!(red(vec![depth(), layer("sky.", 2.0)]), Some(2.0));
        assert_eq!(red(vec![layer("sky.", 2.0), layer("sun.", 3.0)]), None);
        assert_eq!(red(vec![layer("V.DiffCol.", 2.0), depth(), layer("V.Combined.", 3.0)]), Some(3.0));
        assert_eq!(red(vec![depth()]), None);
    }

    /// A picture of any kind under the names of others, and under none.
    #[test]
    fn pictures_are_known_by_how_they_begin() {
        let dir = tempfile::tempdir().unwrap();
        let png = dir.path().join("a.png");
        image::RgbImage::from_pixel(1, 1, image::Rgb([7, 7, 7])).save(&png).unwrap();
        let exr = dir.path().join("a.exr");
        let image = exr::ExrImage {
            frame: [1, 1],
            window: Window::full(1, 1),
            channels: vec![("Y".to_owned(), exr::ChannelData::F32(vec![0.5]))],
            colour: None,
            attributes: Vec::new(),
            data: std::collections::BTreeSet::new(),
            compression: exr::Compression::None,
            layout: exr::Layout::Single,
        };
        exr::write_exr(&exr, &image).unwrap();
        let pfm = b"Pf\n1 1\n-1\n\0\0\0\x3f".to_vec();
        let [png, exr] = [png, exr].map(|path| std::fs::read(path).unwrap());
        for name in ["b.exr", "b.EXR", "b.png", "b.jpg", "b.tif", "b"] {
            let path = dir.path().join(name);
            let read = |bytes: &[u8]| {
                std::fs::write(&path, bytes).unwrap();
                open(&path).unwrap_or_else(|error| panic!("{error}"))
            };
            assert!(matches!(read(&exr), Decoded::Exr(_)), "{name}");
            assert!(matches!(read(&png), Decoded::Bytes { .. }), "{name}");
            assert!(matches!(read(&pfm), Decoded::Other(_)), "{name}");
        }
        let path = dir.path().join("c.exr");
        std::fs::write(&path, "no picture").unwrap();
        assert!(open(&path).unwrap_err().to_string().contains("not a valid OpenEXR file"));
    }

    /// One of 2 x 1 pixels in four bytes each: 0.5 and, half as bright, 0.25, under both signatures.
    #[test]
    fn radiance_pictures_have_either_signature() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.hdr");
        let read = |signature: &str| {
            let mut bytes = format!("{signature}\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n").into_bytes();
            bytes.extend([128, 128, 128, 128, 128, 128, 128, 127]);
            std::fs::write(&path, bytes).unwrap();
            decode(&path).unwrap().to_rgb32f().into_raw()
        };
        for signature in ["#?RADIANCE", "#?RGBE"] {
            assert_eq!(read(signature), [0.5, 0.5, 0.5, 0.25, 0.25, 0.25], "{signature}");
        }
    }

    /// Three colours of eight bits in a row, under every name of a file that holds them as they are; and what is cut off is told.
    #[test]
    fn eight_bits_are_the_same_from_all_kinds_of_files() {
        let dir = tempfile::tempdir().unwrap();
        let colours = [[1, 2, 3], [250, 0, 128], [7, 255, 9]];
        let image = image::RgbImage::from_fn(3, 1, |x, _| image::Rgb(colours[x as usize]));
        for name in ["a.png", "a.bmp", "a.tga", "a.ppm"] {
            let path = dir.path().join(name);
            image.save(&path).unwrap();
            let Decoded::Bytes { rgb, width: 3, height: 1, .. } = open(&path).unwrap() else { panic!("{name}") };
            assert_eq!(rgb, colours.as_flattened(), "{name}");
            let whole = std::fs::read(&path).unwrap();
            for length in [whole.len() / 2, 20, 1] {
                std::fs::write(&path, &whole[..length]).unwrap();
                let error = open(&path).unwrap_err();
                assert!(error.exit_code() == 3 && error.to_string().contains(KINDS), "{name}, {length}: {error}");
            }
        }
        let mut map = b"PF\n1 1\n-1\n".to_vec();
        map.extend([0.5_f32, 0.25, 2.0].map(f32::to_le_bytes).as_flattened());
        std::fs::write(dir.path().join("a.pfm"), map).unwrap();
        let path = dir.path().join("a.pfm");
        let found = picture(&path, open(&path).unwrap()).unwrap();
        assert_eq!(found.pixels, [[0.5, 0.25, 2.0]]);
    }

    #[test]
    fn a_text_file_is_no_picture() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("earth.jpg");
        std::fs::write(&path, "not a picture").unwrap();
        let e = open(&path).unwrap_err();
        assert!(e.exit_code() == 3 && e.to_string().contains(KINDS), "{e}");
    }
}
