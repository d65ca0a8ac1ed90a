//! Picture files for Mitsuba, which reads fewer than are read here.
//!
//! What it refuses (3.9.1): EXR files with more channels than those of colours, spectral ones among them; of PNM all but `P6`; of BMP
//! all but 8, 24 and 32 bits without packing behind a header of 40 bytes; JPEG of four colours; TGA files without the footer of version 2, with palettes
//! or with 16 bits; Radiance files with runs of the old kind or without the line of their format; EXR files of one layer with alpha.
//! On EXR files whose data window begins below 0 it ends. It mirrors what TGA files hold from right to left, and takes other colours from
//! palettes in BMP, which it has for grey, and from `P6` of 16 bits.

use super::decoded::{COLOURS, decode, decoder, is_exr, with_picture_first};
use super::{jpeg, pfm, radiance};
use crate::description::{PictureAnew, PictureRead};
use crate::film::exr::{self, ChannelData, ColourEncoding, Compression, ExrImage, ExrPart, Layout};
use crate::scene::bands::{Bands, Quantity};
use crate::spectrum::observer::tristimulus;
use crate::spectrum::{ColourSpace, illuminant};
use image::ImageDecoder;
use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::Path;

/// The channels of a picture that Mitsuba takes for one, besides A.
const TAKEN: [&[&str]; 3] = [&["R", "G", "B"], &["Y"], &["X", "Y", "Z"]];

/// What Mitsuba makes of a picture file. One that cannot be read is left to it as it is.
#[must_use]
pub fn for_mitsuba(path: &Path) -> PictureRead {
    let read = if is_exr(path) { of_exr(path) } else { of_others(path) };
    read.unwrap_or(PictureRead { coloured: true, anew: None })
}

/// Of all kinds but EXR.
fn of_others(path: &Path) -> Option<PictureRead> {
    let bytes = crate::input::read(path).ok()?;
    if pfm::is(&bytes) {
        return Some(PictureRead { coloured: pfm::is_coloured(&bytes), anew: None });
    }
    let is_plain = is_plain(&bytes);
    if radiance::is(&bytes) && !is_plain {
        let pixels = decode(path).ok()?.into_rgb32f();
        let plane = |k: usize| (COLOURS[0][k], pixels.pixels().map(|pixel| pixel.0[k]).collect());
        let primaries = ColourSpace::Rec709.chromaticities();
        let bytes = encoded([pixels.width(), pixels.height()], [0, 1, 2].map(plane).into(), primaries)?;
        return Some(PictureRead {
            coloured: true,
            anew: Some(PictureAnew { extension: "exr", bytes, loses_spectra: false }),
        });
    }
    let coloured = decoder(path, bytes).ok()?.color_type().has_color();
    if is_plain {
        return Some(PictureRead { coloured, anew: None });
    }
    let mut png = Vec::new();
    decode(path).ok()?.write_to(&mut Cursor::new(&mut png), image::ImageFormat::Png).ok()?;
    Some(PictureRead { coloured, anew: Some(PictureAnew { extension: "png", bytes: png, loses_spectra: false }) })
}

/// Whether Mitsuba reads a picture of a kind that is told by its first bytes, or its last.
fn is_plain(bytes: &[u8]) -> bool {
    let number = |at: usize, count: usize| {
        let number = bytes.get(at..at + count)?;
        Some(number.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte)))
    };
    match bytes {
        [b'P', b'6', ..] => {
            let mut words = bytes[2..].split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).take(3);
            words.all(|word| word.iter().all(u8::is_ascii_digit)) && header_word(bytes, 3) == Some(b"255".as_slice())
        }
        [b'P', b'1'..=b'7', ..] => false,
        // Size of the header, bits of a pixel, packing.
        [b'B', b'M', ..] => {
            number(14, 4) == Some(40) && matches!(number(28, 2), Some(24 | 32)) && number(30, 4) == Some(0)
        }
        [0xff, 0xd8, ..] => matches!(jpeg::components(bytes), Some(1 | 3)),
        _ if radiance::is(bytes) => radiance::is_plain(bytes),
        _ if image::guess_format(bytes).is_ok() || pfm::is(bytes) => true,
        // TGA has nothing to tell it by at its beginning.
        _ => {
            let footer = bytes.len().checked_sub(18).is_some_and(|at| bytes[at..].starts_with(b"TRUEVISION-XFILE."));
            // Fifth of the bits that describe pixels: from right to left.
            footer && matches!(bytes[2], 2 | 3 | 10 | 11) && matches!(bytes[16], 8 | 24 | 32) && bytes[17] >> 4 & 1 == 0
        }
    }
}

/// A word of the header of a PNM file, from 0 on.
fn header_word(bytes: &[u8], index: usize) -> Option<&[u8]> {
    bytes.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).nth(index)
}

/// Of EXR.
fn of_exr(path: &Path) -> Option<PictureRead> {
    let file = exr::read_exr(path).ok()?;
    if let Some(taken) = taken_of(&file) {
        return Some(PictureRead { coloured: taken.len() > 1, anew: None });
    }
    let file = with_picture_first(file);
    let part = &file.parts[0];
    let (channels, primaries, loses_spectra) = match Bands::of(path, part).ok()? {
        Some(bands) => (colours_of(&bands), ColourSpace::Rec709.chromaticities(), true),
        None => (channels_of(part)?, file.primaries(), false),
    };
    let coloured = channels.len() > 1;
    let bytes = encoded([part.window.width, part.window.height], channels, primaries)?;
    Some(PictureRead { coloured, anew: Some(PictureAnew { extension: "exr", bytes, loses_spectra }) })
}

/// An EXR file of these channels.
fn encoded(size: [u32; 2], channels: Vec<(&'static str, Vec<f32>)>, primaries: [[f64; 2]; 4]) -> Option<Vec<u8>> {
    let image = ExrImage {
        frame: size,
        window: crate::film::Window::full(size[0], size[1]),
        channels: channels.into_iter().map(|(name, plane)| (name.to_owned(), ChannelData::F32(plane))).collect(),
        colour: Some(ColourEncoding { primaries, interop_id: None }),
        attributes: Vec::new(),
        data: BTreeSet::new(),
        compression: Compression::Zips,
        layout: Layout::Single,
    };
    exr::encode_exr(&image).ok()
}

/// Which channels Mitsuba takes of a file whose first part it takes for the picture that is taken here; it looks at what stands
/// behind the last dot.
fn taken_of(file: &exr::ExrFile) -> Option<&'static [&'static str]> {
    let names = file.parts[0].channels.iter().map(|(name, _)| name.rsplit_once('.').unwrap_or(("", name)));
    let layers: BTreeSet<&str> = names.clone().map(|(layer, _)| layer).collect();
    let mut letters: Vec<String> = names.map(|(_, letter)| letter.to_ascii_uppercase()).collect();
    let all = letters.len();
    letters.retain(|letter| letter != "A");
    let (covers, in_layer) = (letters.len() < all, layers.iter().any(|layer| !layer.is_empty()));
    let window = file.parts[0].window;
    letters.sort_unstable();
    let taken = |channels: &&[&str]| {
        let mut channels = channels.to_vec();
        channels.sort_unstable();
        letters == channels
    };
    let is_first = file.parts.len() == 1 || file.parts[0].channel("R").is_some();
    let is_read = is_first && layers.len() == 1 && !(covers && in_layer) && window.x >= 0 && window.y >= 0;
    TAKEN.into_iter().find(taken).filter(|_| is_read)
}

/// The channels of the picture alone, as they stand in the file.
fn channels_of(part: &ExrPart) -> Option<Vec<(&'static str, Vec<f32>)>> {
    let all = |names: &[&'static str]| -> Option<Vec<(&'static str, Vec<f32>)>> {
        names.iter().map(|name| Some((*name, part.channel(name)?.to_vec()))).collect()
    };
    let [rgb, grey, xyz] = TAKEN;
    all(rgb).or_else(|| all(xyz)).or_else(|| all(grey))
}

/// The colours of spectra: of radiance as it is, of what reflects in daylight.
fn colours_of(bands: &Bands) -> Vec<(&'static str, Vec<f32>)> {
    let daylight = illuminant::d65();
    let colour = |i: usize| {
        let spectrum = bands.spectrum(i);
        let (seen, most) = match bands.quantity {
            Quantity::Radiance => (spectrum, f32::MAX),
            Quantity::Reflectance => (spectrum.times(&daylight), 1.0),
        };
        let xyz = tristimulus(&seen).map(|x| x as f32);
        ColourSpace::Rec709.from_xyz(xyz).map(|x| x.clamp(0.0, most))
    };
    let pixels: Vec<[f32; 3]> = (0..bands.len()).map(colour).collect();
    COLOURS[0].into_iter().zip(0..3).map(|(name, k)| (name, pixels.iter().map(|pixel| pixel[k]).collect())).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{open, picture};
    use super::*;

    /// What is written in place of a file, in the same folder, and both as they are read.
    fn both(name: &str, bytes: &[u8]) -> Option<[Vec<[f32; 3]>; 2]> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let read = for_mitsuba(&path);
        let anew = read.anew?;
        let other = folder.path().join(format!("anew.{}", anew.extension));
        std::fs::write(&other, &anew.bytes).unwrap();
        assert_eq!(for_mitsuba(&other), PictureRead { coloured: read.coloured, anew: None }, "{name}");
        Some([&path, &other].map(|path| picture(path, open(path).unwrap()).unwrap().pixels))
    }

    fn exr(names: &[&str]) -> Vec<u8> {
        exr_at([0, 0], names)
    }

    fn exr_at([x, y]: [i32; 2], names: &[&str]) -> Vec<u8> {
        let planes = names
            .iter()
            .zip(1..)
            .map(|(name, k)| ((*name).to_owned(), ChannelData::F32((0..2).map(|i| 0.125 * (k + i) as f32).collect())));
        let image = ExrImage {
            frame: [2, 1],
            window: crate::film::Window { x, y, ..crate::film::Window::full(2, 1) },
            channels: planes.collect(),
            colour: Some(ColourEncoding::of(ColourSpace::Rec709)),
            attributes: Vec::new(),
            data: BTreeSet::new(),
            compression: Compression::None,
            layout: Layout::Single,
        };
        exr::encode_exr(&image).unwrap()
    }

    /// A segment of four bytes, a table, fill bytes and a frame of so many colours; and what ends before that.
    #[test]
    fn the_colours_of_a_jpeg_are_those_of_its_frame() {
        for colours in [1, 3, 4] {
            let start = [0xff, 0xd8, 0xff, 0xe0, 0, 4, 7, 7, 0xff, 0xc4, 0, 3, 9, 0xff];
            let frame = [0xff, 0xc2, 0, 17, 8, 0, 1, 0, 1, colours, 1, 0x11, 0];
            let bytes = [&start[..], &frame].concat();
            assert_eq!(jpeg::components(&bytes), Some(colours));
            assert_eq!(is_plain(&bytes), colours != 4);
            assert_eq!(jpeg::components(&bytes[..20]), None);
        }
    }

    /// Mitsuba 3.9.1 says of the first that it has no known pixel format.
    #[test]
    fn channels_beside_colours_are_left_out_of_exr() {
        for names in [
            &["R", "G", "B", "Z"][..],
            &["R", "G", "B", "A", "albedo.R"],
            &["Y", "id.X"],
            &["X", "Y", "Z", "W"],
            &["a.R", "a.G", "a.B", "a.A"],
        ] {
            let [read, anew] = both("a.exr", &exr(names)).unwrap_or_else(|| panic!("{names:?}"));
            assert_eq!(read, anew, "{names:?}");
        }
        for names in
            [&["R", "G", "B"][..], &["R", "G", "B", "A"], &["Y"], &["X", "Y", "Z"], &["view.R", "view.G", "view.B"]]
        {
            assert!(both("a.exr", &exr(names)).is_none(), "{names:?}");
        }
    }

    /// Mitsuba 3.9.1 dies of the first two.
    #[test]
    fn windows_before_the_frame_are_moved() {
        for at in [[-1, 0], [0, -2]] {
            let [read, anew] = both("a.exr", &exr_at(at, &["R", "G", "B"])).unwrap();
            assert_eq!(read, anew, "{at:?}");
        }
        assert!(both("a.exr", &exr_at([1, 2], &["R", "G", "B"])).is_none());
    }

    /// Mitsuba 3.9.1 takes no normals from the grey ones: they have one number where it wants three.
    #[test]
    fn grey_pictures_of_all_kinds_are_told_from_coloured_ones() {
        let folder = tempfile::tempdir().unwrap();
        let pfm = |head: &str, values: usize| [head.as_bytes(), &vec![0; 4 * values]].concat();
        for (name, bytes, coloured) in [
            ("y.exr", exr(&["Y"]), false),
            ("ya.exr", exr(&["Y", "A"]), false),
            ("layers.exr", exr(&["Y", "id.X"]), false),
            ("rgb.exr", exr(&["R", "G", "B"]), true),
            ("xyz.exr", exr(&["X", "Y", "Z", "W"]), true),
            ("grey.pfm", pfm("Pf\n2 1\n-1\n", 2), false),
            ("colours.pfm", pfm("PF\n2 1\n-1\n", 6), true),
            ("grey.pgm", b"P5\n2 1\n255\n\x10\xa0".to_vec(), false),
            ("colours.ppm", b"P6\n2 1\n255\n\x01\x02\x03\x04\x05\x06".to_vec(), true),
            ("none.png", b"no picture".to_vec(), true),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(for_mitsuba(&path).coloured, coloured, "{name}");
        }
    }

    /// A reflectance of one half everywhere is grey of one half.
    #[test]
    fn spectra_become_colours() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let planes = ["T.400,0nm", "T.700,0nm"].map(|name| (name.to_owned(), ChannelData::F32(vec![0.5; 2])));
        let image = ExrImage {
            frame: [2, 1],
            window: crate::film::Window::full(2, 1),
            channels: planes.to_vec(),
            colour: None,
            attributes: Vec::new(),
            data: BTreeSet::new(),
            compression: Compression::None,
            layout: Layout::Single,
        };
        exr::write_exr(&path, &image).unwrap();
        let anew = for_mitsuba(&path).anew.unwrap();
        assert!(anew.loses_spectra);
        std::fs::write(&path, &anew.bytes).unwrap();
        let pixels = picture(&path, open(&path).unwrap()).unwrap().pixels;
        // The white of D65 is that of Rec. 709 to the digits in which either is stated.
        assert!(pixels.iter().flatten().all(|x| (x - 0.5).abs() < 1e-3), "{pixels:?}");
    }

    /// Of what stands below, Mitsuba 3.9.1 knows no format of the PNM and of two TGA files and the BMP, reads the low bytes of the `P6` for
    /// high ones, mirrors the third TGA and knows no runs of the Radiance file.
    #[test]
    fn what_mitsuba_reads_otherwise_of_other_pictures_is_written_anew() {
        let tga = |kind: u8, bits: u8, from: u8, footer: &[u8]| {
            let head = [0, 0, kind, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, bits, from];
            [&head[..], &[10, 20, 30, 40, 50, 60][..2 * usize::from(bits / 8)], footer].concat()
        };
        let bmp = |header: u8, bits: u8, pixels: &[u8]| {
            let mut file = [b"BM".as_slice(), &[0; 8], &[14 + header, 0, 0, 0, header, 0, 0, 0]].concat();
            file.extend([2, 0, 0, 0, 1, 0, 0, 0, 1, 0, bits, 0]);
            file.resize(14 + usize::from(header), 0);
            file.extend(pixels);
            file
        };
        let hdr = |pixels: &[u8]| [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 3\n", pixels].concat();
        let whole = b"\0\0\0\0\0\0\0\0TRUEVISION-XFILE.\0";
        for (name, bytes) in [
            ("a.pgm", b"P5\n2 1\n255\n\x10\xa0".to_vec()),
            ("a.pbm", b"P1\n2 1\n0 1\n".to_vec()),
            ("a.ppm", b"P3\n2 1\n255\n1 2 3 40 50 60\n".to_vec()),
            ("a.tga", tga(2, 24, 0x20, b"")),
            ("a.tga", tga(2, 16, 0x20, whole)),
            ("a.ppm", b"P6\n2 1\n65535\n\x01\x02\x03\x04\x05\x06\x10\x20\x30\x40\x50\x60".to_vec()),
            ("a.tga", tga(2, 24, 0x30, whole)),
            ("a.hdr", hdr(&[9, 8, 7, 128, 1, 1, 1, 2])),
            ("a.bmp", bmp(108, 24, &[1, 2, 3, 40, 50, 60, 0, 0])),
        ] {
            let [read, anew] = both(name, &bytes).unwrap_or_else(|| panic!("{name}"));
            assert_eq!(read, anew, "{name}");
        }
        for (name, bytes) in [
            ("a.ppm", b"P6\n2 1\n255\n\x01\x02\x03\x04\x05\x06".to_vec()),
            ("a.tga", tga(2, 24, 0x20, whole)),
            ("a.hdr", hdr(&[9, 8, 7, 128, 6, 5, 4, 129, 3, 2, 1, 130])),
            ("a.bmp", bmp(40, 24, &[1, 2, 3, 40, 50, 60, 0, 0])),
            ("a.pfm", b"Pf\n2 1\n-1\n\0\0\0\0\0\0\x80\x3f".to_vec()),
        ] {
            assert!(both(name, &bytes).is_none(), "{name}");
        }
    }
}
