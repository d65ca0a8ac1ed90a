//! Pictures and tables from files.

mod anew;
mod curve;
mod decoded;
mod jpeg;
mod pfm;
mod radiance;

pub use anew::for_mitsuba;
pub use curve::samples;
pub use decoded::{Counted, Decoded, Pictures, Wanted, open};

use super::bands::Bands;
use super::texture::{DataImage, Grid, ImageTexture, Numbers, Texel, Texels};
use crate::error::{Error, Result};
use crate::film::{Window, exr, icc, png};
use crate::spectrum::Carried;
use crate::spectrum::colour::{self, ColourSpace};
use decoded::{COLOURS, count};
use rayon::prelude::*;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

/// A picture in linear Rec. 709, row 0 at the top.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels, row by row.
    pub pixels: Vec<[f32; 3]>,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What was changed in it, where something was.
    pub note: Option<String>,
}

/// A part of a frame is stretched over the whole, as Mitsuba 3 has it: what a person should know of such a file.
#[must_use]
pub fn cut_out(path: &Path, file: &exr::ExrFile) -> Option<String> {
    let (window, frame) = (file.parts[0].window, file.display);
    let Window { width, height, .. } = frame;
    (window != frame).then(|| {
        let path = path.display();
        format!("{path} holds {window} of a frame of {width}x{height}; that part is taken for the whole picture")
    })
}

/// What a person should know of a file that says of its colours or its light what is not minded: PNG and JPEG files are taken for sRGB.
fn not_minded(file: &Path) -> Option<String> {
    /// More than heads have.
    const HEAD: u64 = 1 << 16;
    let mut head = Vec::new();
    crate::input::open(file).ok()?.take(HEAD).read_to_end(&mut head).ok()?;
    let path = file.display();
    if radiance::is(&head) {
        return radiance::says(&head).map(|said| format!("{path} says {said}; its numbers are taken as they are"));
    }
    let said = match image::guess_format(&head).ok()? {
        image::ImageFormat::Png => png::inspect::other_colours(file),
        image::ImageFormat::Jpeg => icc::colours(file).filter(|colours| !png::inspect::are_srgb(colours)),
        _ => None,
    };
    Some(format!("{path} says that its colours are {}; they are taken for sRGB", said?))
}

/// A picture of light from the file `path`: EXR by its chromaticities, HDR as it is, 8- and 16-bit files decoded from sRGB.
///
/// # Errors
/// [`Error::Input`] where a pixel is not finite.
pub fn picture(path: &Path, decoded: Decoded) -> Result<Picture> {
    let mut notes = Vec::from_iter(not_minded(path));
    let picture = match decoded {
        Decoded::Exr(file) => {
            notes.extend(cut_out(path, &file));
            let Window { width, height, .. } = file.parts[0].window;
            let pixels = exr_colours(path, &file)?;
            Picture { pixels, width: width as usize, height: height as usize, note: None }
        }
        Decoded::Bytes { rgb, width, height, .. } => {
            let level = colour::srgb8_table();
            let pixel = |p: &[u8]| [0, 1, 2].map(|k| level[usize::from(p[k])]);
            Picture { pixels: rgb.chunks_exact(3).map(pixel).collect(), width, height, note: None }
        }
        Decoded::Other(decoded) => {
            let linear = is_linear(&decoded);
            let rgb = decoded.into_rgb32f();
            let (width, height) = (rgb.width() as usize, rgb.height() as usize);
            let decode = |x: f32| if linear { x } else { colour::srgb_decode(x) };
            Picture { pixels: rgb.pixels().map(|p| p.0.map(decode)).collect(), width, height, note: None }
        }
    };
    if let Some(i) = picture.pixels.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        let (x, y) = (i % picture.width, i / picture.width);
        return Err(Error::input(path, format!("expected finite pixels, found {:?} at ({x}, {y})", picture.pixels[i])));
    }
    // Light cannot be negative; a colour outside Rec. 709 can. It is moved to the nearest one inside.
    let numbers = picture.pixels.iter().flatten().filter(|x| **x < 0.0);
    let (count, least) = numbers.fold((0u64, 0.0f32), |(count, least), x| (count + 1, least.min(*x)));
    if count > 0 {
        notes.push(format!("{count} numbers of {} are below 0, the least {least}: taken for 0", path.display()));
    }
    let note = (!notes.is_empty()).then(|| notes.join("; "));
    let pixels = picture.pixels.into_iter().map(|p| p.map(|x| x.max(0.0))).collect();
    Ok(Picture { pixels, note, ..picture })
}

/// The colours of an EXR file in linear Rec. 709: R, G, B by its chromaticities; X, Y, Z; Y alone is grey.
fn exr_colours(path: &Path, file: &exr::ExrFile) -> Result<Vec<[f32; 3]>> {
    let part = &file.parts[0];
    let all = |names: [&str; 3]| match names.map(|name| part.channel(name)) {
        [Some(a), Some(b), Some(c)] => Some(a.iter().zip(b).zip(c).map(|((&a, &b), &c)| [a, b, c])),
        _ => None,
    };
    if let Some(rgb) = all(["R", "G", "B"]) {
        let into = |m| move |p: [f32; 3]| colour::times(m, p.map(f64::from)).map(|x| x as f32);
        return Ok(match other_primaries(path, file)? {
            Some(matrix) => rgb.map(into(matrix)).collect(),
            None => rgb.collect(),
        });
    }
    if let Some(xyz) = all(["X", "Y", "Z"]) {
        return Ok(xyz.map(|p| ColourSpace::Rec709.from_xyz(p)).collect());
    }
    let is_grey = ["R", "G", "B", "RY", "BY"].iter().all(|name| part.channel(name).is_none());
    if let (Some(grey), true) = (part.channel("Y"), is_grey) {
        return Ok(grey.iter().map(|&y| [y; 3]).collect());
    }
    let missing = COLOURS[0].into_iter().find(|name| part.channel(name).is_none()).unwrap_or("R");
    Err(Error::input(path, format!("expected channels R, G, B, or X, Y, Z, or Y alone; found no {missing}")))
}

/// The matrix to Rec. 709 from what a file says its colours are, where they are others.
///
/// # Errors
/// [`Error::Input`] where they are none.
fn other_primaries(path: &Path, file: &exr::ExrFile) -> Result<Option<[[f64; 3]; 3]>> {
    let primaries = file.primaries();
    let is = |space: &ColourSpace| colour::are_same_primaries(primaries, space.chromaticities());
    match ColourSpace::ALL.into_iter().find(is) {
        Some(ColourSpace::Rec709) => return Ok(None),
        Some(space) => return Ok(Some(space.to_rec709())),
        None => {}
    }
    let expected = "expected chromaticities of red, green, blue and white that span colours";
    let matrix = colour::rec709_from(primaries);
    matrix.map(Some).ok_or_else(|| Error::input(path, format!("{expected}, found {primaries:?}")))
}

fn is_linear(decoded: &image::DynamicImage) -> bool {
    matches!(decoded, image::DynamicImage::ImageRgb32F(_) | image::DynamicImage::ImageRgba32F(_))
}

/// A picture of colours from the file `path`, upsampled texel by texel, or of the spectra of a spectral EXR; `raw`
/// takes 8- and 16-bit values as linear. And what was changed in it, where something was.
///
/// # Errors
/// As [`picture`]. Colours above one are light: who takes them for reflectances looks at [`Texels::greatest`].
pub fn image_texture(
    path: &Path,
    decoded: Decoded,
    raw: bool,
    carried: Carried,
) -> Result<(ImageTexture, Option<String>)> {
    let make = |texels: Texels, width: usize, height: usize| ImageTexture {
        texels,
        grid: Grid::new(width, height),
        illuminant: None,
        bands: None,
        mean: Arc::default(),
    };
    if let Decoded::Exr(file) = &decoded
        && let Some(bands) = Bands::of(path, &file.parts[0])?
    {
        let Window { width, height, .. } = file.parts[0].window;
        let none = make(Texels::each(Vec::new()), width as usize, height as usize);
        return Ok((ImageTexture { bands: Some(bands), ..none }, cut_out(path, file)));
    }
    let colours = || if raw { None } else { not_minded(path) };
    match decoded {
        Decoded::Bytes { rgb, width, height, counted } => {
            let level = if raw { std::array::from_fn(|x| x as f32 / 255.0) } else { colour::srgb8_table() };
            let texels = upsampled_bytes(counted.unwrap_or_else(|| count(&rgb)), &level, carried);
            Ok((make(texels, width, height), colours()))
        }
        Decoded::Other(decoded) if !is_linear(&decoded) => {
            let (width, height) = (decoded.width() as usize, decoded.height() as usize);
            let level = |x: u16| {
                let x = f32::from(x) / 65535.0;
                if raw { x } else { colour::srgb_decode(x) }
            };
            let rgb = decoded.into_rgb16();
            let texel = |p: &[u16]| colour_texel([level(p[0]), level(p[1]), level(p[2])], carried);
            let texels = rgb.as_raw().par_chunks_exact(3).map(texel).collect();
            Ok((make(Texels::each(texels), width, height), colours()))
        }
        decoded => {
            let picture = picture(path, decoded)?;
            let texels = picture.pixels.par_iter().map(|&rgb| colour_texel(rgb, carried)).collect();
            Ok((make(Texels::each(texels), picture.width, picture.height), picture.note))
        }
    }
}

fn colour_texel(rgb: [f32; 3], carried: Carried) -> Texel {
    let (coefficients, scale) = carried.texel(rgb);
    Texel { coefficients, scale }
}

/// Texels of pixels of the given levels. Many share a colour: each is upsampled once.
fn upsampled_bytes(counted: Counted, level: &[f32; 256], carried: Carried) -> Texels {
    let texel = |c: &[u8; 3]| colour_texel(c.map(|x| level[usize::from(x)]), carried);
    let colours = counted.colours.par_iter().with_min_len(256).map(texel).collect();
    Texels::numbered(colours, counted.numbers)
}

/// A picture of numbers from the file `path`: EXR and HDR as they are, 8- and 16-bit files from 0 to 1, decoded from
/// sRGB unless `raw`. A picture of one channel gives the same number three times. And [`cut_out`].
///
/// # Errors
/// As [`picture`]; numbers may be negative.
pub fn data_image(path: &Path, decoded: Decoded, raw: bool) -> Result<(DataImage, Option<String>)> {
    let (mut note, mut is_decoded) = (None, false);
    let (texels, width, height): (Vec<[f32; 3]>, usize, usize) = match decoded {
        Decoded::Bytes { rgb, width, height, .. } => {
            let level = if raw { std::array::from_fn(|x| x as f32 / 255.0) } else { colour::srgb8_table() };
            let texels = Numbers::Bytes { bytes: Arc::new(rgb), level: Box::new(level) };
            return Ok((DataImage { texels, grid: Grid::new(width, height), decoded: !raw }, None));
        }
        Decoded::Exr(file) => {
            note = cut_out(path, &file);
            let part = &file.parts[0];
            let grey = part.channel("Y");
            let channel = |name: &str| {
                let found = part.channel(name).or(grey);
                found.ok_or_else(|| Error::input(path, format!("expected channels R, G, B or Y; found no {name}")))
            };
            let (r, g, b) = (channel("R")?, channel("G")?, channel("B")?);
            let texels = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect();
            (texels, part.window.width as usize, part.window.height as usize)
        }
        Decoded::Other(decoded) => {
            is_decoded = !(raw || is_linear(&decoded));
            let rgb = decoded.into_rgb32f();
            let number = |x: f32| if is_decoded { colour::srgb_decode(x) } else { x };
            (rgb.pixels().map(|p| p.0.map(number)).collect(), rgb.width() as usize, rgb.height() as usize)
        }
    };
    if let Some(i) = texels.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        let (x, y) = (i % width, i / width);
        return Err(Error::input(path, format!("expected finite numbers, found {:?} at ({x}, {y})", texels[i])));
    }
    let texels = Numbers::Floats(Arc::new(texels));
    Ok((DataImage { texels, grid: Grid::new(width, height), decoded: is_decoded }, note))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{Spectrum, illuminant, observer};

    #[test]
    fn negative_numbers_of_a_picture_are_told() {
        let pixels = [[0.5, -0.25, 0.0], [-2.0, 1.0, -0.0]];
        let channel = |k: usize| (["R", "G", "B"][k].to_owned(), pixels.iter().map(|p| p[k]).collect());
        let window = Window::full(2, 1);
        let part = exr::ExrPart {
            name: None,
            window,
            channels: (0..3).map(channel).collect(),
            integers: Vec::new(),
            texts: Vec::new(),
        };
        let file = exr::ExrFile { display: window, chromaticities: None, parts: vec![part] };
        let picture = picture(Path::new("sky.exr"), Decoded::Exr(file)).unwrap();
        assert_eq!(picture.pixels, [[0.5, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(picture.note.unwrap(), "2 numbers of sky.exr are below 0, the least -2: taken for 0");
    }

    #[test]
    fn a_picture_that_is_a_part_of_a_frame_is_told() {
        let plane = |name: &str| (name.to_owned(), vec![0.5, -0.5]);
        let window = Window { x: 3, y: 1, width: 2, height: 1 };
        let channels = ["R", "G", "B"].map(plane).into();
        let part = exr::ExrPart { name: None, window, channels, integers: Vec::new(), texts: Vec::new() };
        let file = |frame| exr::ExrFile { display: frame, chromaticities: None, parts: vec![part.clone()] };
        let numbers = |frame| data_image(Path::new("bump.exr"), Decoded::Exr(file(frame)), true).unwrap().1;
        assert_eq!(numbers(window), None);
        let told = "bump.exr holds 2x1 at (3, 1) of a frame of 8x4; that part is taken for the whole picture";
        assert_eq!(numbers(Window::full(8, 4)).as_deref(), Some(told));
        let both = picture(Path::new("bump.exr"), Decoded::Exr(file(Window::full(8, 4)))).unwrap().note.unwrap();
        assert_eq!(both, format!("{told}; 3 numbers of bump.exr are below 0, the least -0.5: taken for 0"));
    }

    /// The primaries of ACEScg and white, as Abbe itself writes them, come back as the Rec. 709 that was written; to f32.
    /// Mitsuba 3.9.1 makes the same of these: 0.3, 0.3, 0.2 in XYZ is 0.41129, 0.28033, 0.16694.
    #[test]
    fn grey_and_xyz_are_colours() {
        let colours = |names: &[&str], values: &[f32]| {
            let channels = names.iter().zip(values).map(|(name, value)| ((*name).to_owned(), vec![*value])).collect();
            let part = exr::ExrPart {
                name: None,
                window: Window::full(1, 1),
                channels,
                integers: Vec::new(),
                texts: Vec::new(),
            };
            let file = exr::ExrFile { display: Window::full(1, 1), chromaticities: None, parts: vec![part] };
            picture(Path::new("t.exr"), Decoded::Exr(file)).map(|picture| picture.pixels[0])
        };
        assert_eq!(colours(&["Y"], &[0.3]).unwrap(), [0.3; 3]);
        assert_eq!(colours(&["A", "Y"], &[1.0, 0.3]).unwrap(), [0.3; 3]);
        let found = colours(&["X", "Y", "Z"], &[0.3, 0.3, 0.2]).unwrap();
        // The entries of the matrices, up to 3.24, differ in the fifth digit.
        assert!(found.iter().zip([0.41129, 0.28033, 0.16694]).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
        for wrong in [&["B", "G", "Y"][..], &["BY", "RY", "Y"], &["X", "Z"]] {
            let told = colours(wrong, &[0.3; 3]).unwrap_err().to_string();
            assert!(told.contains("expected channels R, G, B, or X, Y, Z, or Y alone; found no R"), "{told}");
        }
    }

    #[test]
    fn colours_are_read_by_the_chromaticities_of_the_file() {
        let seen = [[0.9f32, 0.1, 0.2], [0.5, 0.5, 0.5], [0.02, 0.7, 0.3]];
        let xyz = seen.map(|rgb| ColourSpace::Rec709.to_xyz(rgb));
        for space in ColourSpace::ALL {
            let written = xyz.map(|xyz| space.from_xyz(xyz));
            let channel = |k: usize| (["R", "G", "B"][k].to_owned(), written.iter().map(|p| p[k]).collect());
            let window = Window::full(3, 1);
            let part = exr::ExrPart {
                name: None,
                window,
                channels: (0..3).map(channel).collect(),
                integers: Vec::new(),
                texts: Vec::new(),
            };
            let chromaticities = Some(space.chromaticities().map(|xy| xy.map(|x| x as f32)));
            let file = exr::ExrFile { display: window, chromaticities, parts: vec![part] };
            let read = picture(Path::new("sky.exr"), Decoded::Exr(file)).unwrap();
            for (found, expected) in read.pixels.iter().flatten().zip(seen.iter().flatten()) {
                assert!((found - expected).abs() < 3e-6, "{space:?} {found} {expected}");
            }
        }
        let nothing =
            exr::ExrFile { display: Window::full(1, 1), chromaticities: Some([[0.3, 0.3]; 4]), parts: Vec::new() };
        assert!(other_primaries(Path::new("sky.exr"), &nothing).unwrap_err().to_string().contains("span colours"));
    }

    /// The same colour gives the same texel by both ways, and each pixel finds its own.
    #[test]
    fn colours_of_eight_bits_are_upsampled_once_each() {
        let pixels = [255, 255, 255, 10, 20, 30, 0, 0, 0, 10, 20, 30, 200, 10, 99];
        let level = colour::srgb8_table();
        let texels = upsampled_bytes(count(&pixels), &level, Carried::Spectra);
        for (i, p) in pixels.chunks_exact(3).enumerate() {
            let texel = texels.at(i);
            let rgb = [0, 1, 2].map(|k| colour::srgb_decode(f32::from(p[k]) / 255.0));
            assert_eq!((texel.coefficients, texel.scale), Carried::Spectra.texel(rgb), "{p:?}");
        }
        assert_eq!(texels.colours.len(), 4);
    }

    /// Of a colour in daylight: by D65 it comes back, to the 2e-4 of the upsampling times the factor. From 1e-2 to one nothing
    /// is scaled.
    #[test]
    fn colours_above_one_and_dim_ones_are_a_reflectance_times_a_factor() {
        for (rgb, factor) in [
            ([5.0, 2.0, 0.5], 5.0),
            ([1e6, 1e6, 1e6], 1e6),
            ([0.9, 0.2, 0.5], 1.0),
            ([1.0, 0.0, 0.0], 1.0),
            ([0.02, 0.002, 0.002], 1.0),
            ([9e-3, 9e-4, 9e-4], 1.8e-2),
            ([1e-7, 1e-8, 1e-8], 2e-7),
            ([0.0; 3], 1.0),
        ] {
            let texel = colour_texel(rgb, Carried::Spectra);
            assert!((texel.scale - factor).abs() <= 1e-6 * factor, "{rgb:?}: {}", texel.scale);
            let light = Spectrum::Sigmoid { c: texel.coefficients, scale: texel.scale }.times(&illuminant::d65());
            let found = colour::times(ColourSpace::Rec709.matrix_from_xyz(), observer::tristimulus(&light));
            for (found, expected) in found.into_iter().zip(rgb) {
                // White itself is off by 3e-4: see `upsample`.
                assert!((found - f64::from(expected)).abs() < 5e-4 * f64::from(factor), "{rgb:?}: {found} {expected}");
            }
        }
    }
}
