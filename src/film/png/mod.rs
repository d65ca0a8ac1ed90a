//! PNG previews: exposure, white balance, gamut, tone curve, the encoding of sRGB, dither.
//!
//! A picture for looking at; numbers live in the EXR. Transcendental functions are `libm`'s and the
//! dither is a function of the pixel, so the file has the same bytes on every machine.
//!
//! Alpha is not written: the picture stands on black, as its premultiplied colours are.

mod gamut;
pub mod inspect;
pub mod meter;
mod tags;
mod tone;

use crate::error::{Error, Result};
use crate::film::output::write_atomically;
use crate::film::resolve::Image;
use crate::math::sampler::mix64;
use crate::spectrum::colour::{Matrix, srgb_curve, times};
use crate::spectrum::{ColourSpace, luminance};
use gamut::Gamut;
use image::ImageEncoder;
use rayon::prelude::*;
use std::path::Path;
use tone::Tone;

/// How scene light becomes display light. All act on light that is linear in the display's primaries, after exposure and,
/// but for `none`, with colours that it lacks brought within its gamut; what is left outside [0, 1] is cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tonemap {
    /// As it is; a colour that the display lacks is cut, too.
    None,
    /// Y / (1 + Y) on luminance: Reinhard et al. 2002, eq. 3.
    Reinhard,
    /// Hill's rational fit of the ACES 1.0 reference rendering and sRGB output transforms (BakingLab, 2016; matrices
    /// with Rec.709 primaries folded in).
    #[default]
    Aces,
    /// Sobotka's AgX, base look: inset matrix, log₂ from −10 to +6.5 stops about 0.18, sigmoid through
    /// (10/16.5, 1/2) with slope 2 and powers 3 and 3.25, and back; output for a 2.2 power display.
    Agx,
}

/// How a value between two levels is placed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dither {
    /// To the nearest.
    None,
    /// By an 8 × 8 Bayer matrix: regular, and quiet in films.
    Ordered,
    /// By a hash of pixel and channel: white noise, no pattern.
    #[default]
    Hash,
}

/// The colours of the display that a picture is for; both have the curve of sRGB and the white D65.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// sRGB: the primaries of Rec.709.
    #[default]
    Srgb,
    /// Display P3.
    DisplayP3,
}

impl Space {
    /// Its primaries.
    #[must_use]
    pub fn primaries(self) -> ColourSpace {
        match self {
            Space::Srgb => ColourSpace::Rec709,
            Space::DisplayP3 => ColourSpace::P3D65,
        }
    }

    /// What each channel adds to the luminance.
    #[must_use]
    pub fn luminance(self) -> [f64; 3] {
        match self {
            Space::Srgb => luminance::REC709,
            Space::DisplayP3 => self.primaries().matrix_to_xyz()[1],
        }
    }
}

/// Bits of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bits {
    /// 8.
    #[default]
    Eight,
    /// 16.
    Sixteen,
}

/// How a picture is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct PngSettings {
    /// Factor 2^exposure before the tone curve.
    pub exposure_stops: f64,
    /// The tone curve.
    pub tonemap: Tonemap,
    /// The dither.
    pub dither: Dither,
    /// The display.
    pub space: Space,
    /// Of a channel.
    pub bits: Bits,
    /// From the colours of the picture to linear light of the display.
    pub display_from_rgb: Matrix,
    /// What is said in the file: keywords and ASCII text.
    pub texts: Vec<(String, String)>,
}

impl Default for PngSettings {
    fn default() -> PngSettings {
        PngSettings {
            exposure_stops: 0.0,
            tonemap: Tonemap::default(),
            dither: Dither::default(),
            space: Space::default(),
            bits: Bits::default(),
            display_from_rgb: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            texts: Vec::new(),
        }
    }
}

/// Whether `path` is a whole picture of that width and height that says `texts`.
#[must_use]
pub fn holds(path: &Path, size: [u32; 2], texts: &[(String, String)]) -> bool {
    inspect::inspect(path).is_ok_and(|facts| facts.size == size && texts.iter().all(|text| facts.texts.contains(text)))
}

/// Writes the preview of `image` to `path`.
///
/// # Errors
/// [`Error::Output`].
pub fn write_png(path: &Path, image: &Image, settings: &PngSettings) -> Result<()> {
    let bytes = encode_png(image, settings).map_err(|message| Error::output(path, message))?;
    write_atomically(path, &bytes)
}

/// The bytes of the file.
///
/// # Errors
/// Why the picture cannot be packed.
pub fn encode_png(image: &Image, settings: &PngSettings) -> std::result::Result<Vec<u8>, String> {
    use image::ExtendedColorType::{Rgb8, Rgb16};
    let levels = develop(image, settings);
    let (pixels, kind): (Vec<u8>, _) = match settings.bits {
        Bits::Eight => (levels.into_iter().map(|v| v as u8).collect(), Rgb8),
        // The encoder turns the bytes round itself.
        Bits::Sixteen => (levels.into_iter().flat_map(u16::to_ne_bytes).collect(), Rgb16),
    };
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(&pixels, image.window.width, image.window.height, kind)
        .map_err(|e| e.to_string())?;
    // The encoder declares no colours. Chunks go between IHDR, which ends at byte 33, and the pixels.
    let mut chunks = tags::colours(settings.space);
    for (keyword, text) in &settings.texts {
        chunks.extend(tags::text(keyword, text));
    }
    bytes.splice(33..33, chunks);
    Ok(bytes)
}

/// Coded levels of the display, three numbers a pixel in raster order.
#[must_use]
pub fn develop(image: &Image, settings: &PngSettings) -> Vec<u16> {
    let width = image.window.width as usize;
    let gain = libm::exp2(settings.exposure_stops);
    let tone = Tone::new(settings.tonemap, settings.space);
    // Without a curve the picture is as the file has it: what no display has is cut.
    let gamut = (settings.tonemap != Tonemap::None).then(|| Gamut::new(settings.space));
    let top = match settings.bits {
        Bits::Eight => 255.0,
        Bits::Sixteen => 65535.0,
    };
    let mut out = vec![0; 3 * image.window.pixels()];
    if width == 0 {
        return out;
    }
    out.par_chunks_mut(3 * width).enumerate().for_each(|(row, line)| {
        for (column, levels) in line.chunks_exact_mut(3).enumerate() {
            let i = row * width + column;
            // Infinite light is as bright as can be, where a matrix would make it none: 0 · ∞ is no number.
            let rgb = [0, 1, 2].map(|c| f64::from(image.rgb[c][i].clamp(-f32::MAX, f32::MAX)) * gain);
            let light = times(settings.display_from_rgb, rgb);
            let display = tone.apply(gamut.as_ref().map_or(light, |gamut| gamut.compress(light)));
            let pixel = [i64::from(image.window.x) + column as i64, i64::from(image.window.y) + row as i64];
            for (c, level) in levels.iter_mut().enumerate() {
                *level = quantise(srgb_encode(display[c]), top, settings.dither, pixel, c as u64);
            }
        }
    });
    out
}

/// The sRGB transfer function (IEC 61966-2-1), of a value cut to [0, 1]; NaN is black.
#[must_use]
pub fn srgb_encode(linear: f64) -> f64 {
    if linear.is_nan() || linear <= 0.0 { 0.0 } else { srgb_curve(linear.min(1.0)) }
}

/// A level of 0 to `top` such that its mean over the dither is the value: v lies between two levels and takes the upper one
/// with probability v − ⌊v⌋. Whole levels, black and white among them, stay.
fn quantise(encoded: f64, top: f64, dither: Dither, pixel: [i64; 2], channel: u64) -> u16 {
    let threshold = match dither {
        Dither::None => 0.5,
        Dither::Ordered => bayer(pixel),
        Dither::Hash => {
            let key = mix64(pixel[0] as u64 ^ mix64(pixel[1] as u64 ^ channel << 60));
            (key >> 11) as f64 / 9_007_199_254_740_992.0
        }
    };
    (encoded * top + threshold).floor().clamp(0.0, top) as u16
}

/// The 8 × 8 matrix of Bayer 1973, as the centres of 64 equal steps in (0, 1): bits of x ⊕ y and y interleaved, the
/// lowest first.
fn bayer(pixel: [i64; 2]) -> f64 {
    let (x, y) = ((pixel[0] & 7) as u32, (pixel[1] & 7) as u32);
    let mut rank = 0;
    for bit in 0..3 {
        rank = rank << 2 | ((x ^ y) >> bit & 1) << 1 | y >> bit & 1;
    }
    (f64::from(rank) + 0.5) / 64.0
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::film::Window;

    const MAPS: [Tonemap; 4] = [Tonemap::None, Tonemap::Reinhard, Tonemap::Aces, Tonemap::Agx];

    pub(in crate::film::png) fn grey(value: f32, side: u32) -> Image {
        let n = (side * side) as usize;
        let plane = || vec![value; n];
        Image {
            frame: [side, side],
            window: Window::full(side, side),
            rgb: [plane(), plane(), plane()],
            alpha: plane(),
            standard_error: [plane(), plane(), plane()],
        }
    }

    #[test]
    fn the_file_declares_srgb_and_decodes_to_what_was_developed() {
        let settings = PngSettings { tonemap: Tonemap::None, ..PngSettings::default() };
        let image = grey(0.3, 5);
        let bytes = encode_png(&image, &settings).unwrap();
        assert_eq!(&bytes[37..41], b"sRGB");
        let back = image::load_from_memory(&bytes).unwrap().into_rgb8().into_raw();
        assert_eq!(back.into_iter().map(u16::from).collect::<Vec<_>>(), develop(&image, &settings));
        assert_eq!(bytes, encode_png(&image, &settings).unwrap());
    }

    /// IEC 61966-2-1: mid grey 0.2140 is encoded as 1/2 (((0.5 + 0.055)/1.055)^2.4 = 0.214041), the ends as 0 and 1,
    /// and the two branches meet at 0.0031308 to 4e-8 (12.92 · 0.0031308 = 0.04044994).
    #[test]
    fn srgb_encoding_meets_the_standard() {
        assert!((srgb_encode(0.214_041_140_482_232_55) - 0.5).abs() < 1e-15);
        assert_eq!((srgb_encode(0.0), srgb_encode(-3.0), srgb_encode(f64::NAN)), (0.0, 0.0, 0.0));
        assert!((srgb_encode(f64::INFINITY) - 1.0).abs() < 1e-15);
        let above = srgb_encode(0.003_130_8f64.next_up());
        assert!((above - 12.92 * 0.003_130_8).abs() < 4e-8, "{above}");
    }

    #[test]
    fn no_light_however_strange_breaks_a_curve() {
        for map in MAPS {
            for v in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 3e38, 1e-45] {
                let settings = PngSettings { tonemap: map, exposure_stops: 90.0, ..PngSettings::default() };
                let mut image = grey(v, 1);
                assert_eq!(develop(&image, &settings).len(), 3);
                image.rgb[1][0] = 0.5;
                assert_eq!(develop(&image, &settings).len(), 3);
            }
            if map != Tonemap::Reinhard {
                let settings = PngSettings { tonemap: map, ..PngSettings::default() };
                assert!(develop(&grey(3e38, 1), &settings).iter().all(|&b| b == 255), "{map:?}");
            }
        }
    }

    /// A pixel beyond 32-bit floats is as white as one at their end, and no number is black.
    #[test]
    fn infinite_light_is_white() {
        for tonemap in MAPS {
            for space in [Space::Srgb, Space::DisplayP3] {
                let display_from_rgb = crate::spectrum::colour::multiply(
                    space.primaries().matrix_from_xyz(),
                    ColourSpace::Rec709.matrix_to_xyz(),
                );
                let settings = PngSettings { tonemap, space, display_from_rgb, ..PngSettings::default() };
                let shown = |value: f32| develop(&grey(value, 1), &settings);
                assert_eq!(shown(f32::INFINITY), [255; 3], "{tonemap:?} {space:?}");
                assert_eq!(shown(f32::NEG_INFINITY), [0; 3], "{tonemap:?} {space:?}");
                assert_eq!(shown(f32::NAN), [0; 3], "{tonemap:?} {space:?}");
            }
        }
    }

    /// The mean over 64 × 64 pixels is the value: for the Bayer matrix to 1/128 of a level (half a step of 64), for
    /// the hash to 4·√(p(1 − p)/n) = 4·0.5/√12288 = 1.8e-2 levels.
    #[test]
    fn dither_keeps_the_mean_and_whole_levels() {
        for (dither, tolerance) in [(Dither::Ordered, 1.0 / 128.0 + 1e-6), (Dither::Hash, 1.8e-2)] {
            for linear in [0.0007, 0.02, 0.2, 0.73f32] {
                let settings = PngSettings { tonemap: Tonemap::None, dither, ..PngSettings::default() };
                let bytes = develop(&grey(linear, 64), &settings);
                let mean = bytes.iter().map(|&b| f64::from(b)).sum::<f64>() / bytes.len() as f64;
                let expected = 255.0 * srgb_encode(f64::from(linear));
                assert!((mean - expected).abs() <= tolerance, "{dither:?}: expected {expected}, found {mean}");
            }
            for (pixel, level) in [([3, 4], 0.0), ([5, 9], 1.0), ([-7, 2], 100.0 / 255.0)] {
                let found = quantise(level, 255.0, dither, pixel, 1);
                assert_eq!(f64::from(found), (level * 255.0).round(), "{dither:?} {level}");
            }
        }
    }

    /// Sixteen bits have 257 times the levels of eight; both displays and the text stand before the pixels, each chunk by its
    /// name.
    #[test]
    fn sixteen_bits_and_a_wider_display_come_back() {
        let settings = PngSettings {
            tonemap: Tonemap::None,
            dither: Dither::None,
            space: Space::DisplayP3,
            bits: Bits::Sixteen,
            texts: vec![("abbe/tonemap".into(), "none".into())],
            ..PngSettings::default()
        };
        let image = grey(0.3, 5);
        let bytes = encode_png(&image, &settings).unwrap();
        let back = image::load_from_memory(&bytes).unwrap();
        assert_eq!(back.color(), image::ColorType::Rgb16);
        assert_eq!(back.into_rgb16().into_raw(), develop(&image, &settings));
        let eight = develop(&image, &PngSettings { bits: Bits::Eight, ..settings.clone() });
        assert!(develop(&image, &settings)[0].abs_diff(257 * eight[0]) <= 129);
        let at = |name: &[u8; 4]| bytes.windows(4).position(|w| w == name).unwrap();
        assert!(at(b"cICP") < at(b"iCCP") && at(b"iCCP") < at(b"tEXt") && at(b"tEXt") < at(b"IDAT"));
        assert!(!bytes.windows(4).any(|w| w == b"sRGB"));
    }

    /// The spectrum at many brightnesses: no colour of it turns black where its luminance does not, and bright light runs to
    /// white, which a cut never does: 520 nm, cut, is (0, 1, 0) times anything.
    #[test]
    fn light_of_one_wavelength_is_shown() {
        use crate::spectrum::observer::matching;
        for space in [Space::Srgb, Space::DisplayP3] {
            for tonemap in [Tonemap::Aces, Tonemap::Agx] {
                let gamut = Gamut::new(space);
                let tone = Tone::new(tonemap, space);
                for nm in (450..=650).step_by(5) {
                    let rgb = times(space.primaries().matrix_from_xyz(), matching(f64::from(nm)));
                    let bright = tone.apply(gamut.compress(rgb.map(|v| v * 4096.0)));
                    assert!(bright.iter().all(|v| *v > 0.7), "{space:?} {tonemap:?} {nm}: {bright:?}");
                    let dim = tone.apply(gamut.compress(rgb));
                    assert!(dim.iter().any(|v| *v > 0.01), "{space:?} {tonemap:?} {nm}: {dim:?}");
                }
            }
        }
    }

    /// A crop shows the same bytes as the whole picture there: the dither belongs to the pixel of the frame.
    #[test]
    fn a_crop_is_dithered_like_the_whole() {
        let whole = develop(&grey(0.2, 8), &PngSettings::default());
        let mut image = grey(0.2, 8);
        image.window = Window { x: 0, y: 3, width: 8, height: 5 };
        image.rgb.iter_mut().for_each(|plane| plane.truncate(40));
        assert_eq!(develop(&image, &PngSettings::default()), whole[3 * 8 * 3..]);
    }

    #[test]
    fn one_stop_doubles_the_light() {
        let with =
            |value, stops| develop(&grey(value, 4), &PngSettings { exposure_stops: stops, ..PngSettings::default() });
        assert_eq!(with(0.1, 1.0), with(0.2, 0.0));
    }
}
