//! PNG previews: exposure, tone curve, sRGB encoding, dither, eight bits.
//!
//! A picture for looking at; numbers live in the EXR. Transcendental functions are `libm`'s and the
//! dither is a function of the pixel, so the file has the same bytes on every machine.
//!
//! Alpha is not written: the picture stands on black, as its premultiplied colours are.

use crate::error::{Error, Result};
use crate::film::output::write_atomically;
use crate::film::resolve::Image;
use crate::math::sampler::mix64;
use crate::spectrum::colour::srgb_curve;
use image::ImageEncoder;
use rayon::prelude::*;
use std::path::Path;

/// How scene light becomes display light. All act on linear Rec.709 after exposure; what is left outside [0, 1] is cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tonemap {
    /// As it is.
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

/// How a value between two of the 256 levels is placed.
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

/// How a picture is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PngSettings {
    /// Factor 2^exposure before the tone curve.
    pub exposure_stops: f64,
    /// The tone curve.
    pub tonemap: Tonemap,
    /// The dither.
    pub dither: Dither,
    /// From the colours of the picture to linear Rec.709.
    pub rec709_from_rgb: [[f64; 3]; 3],
}

impl Default for PngSettings {
    fn default() -> PngSettings {
        PngSettings {
            exposure_stops: 0.0,
            tonemap: Tonemap::default(),
            dither: Dither::default(),
            rec709_from_rgb: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }
}

/// Whether `path` is a whole picture of that width and height.
#[must_use]
pub fn holds(path: &Path, size: [u32; 2]) -> bool {
    image::open(path).is_ok_and(|image| [image.width(), image.height()] == size)
}

/// Writes the preview of `image` to `path`.
///
/// # Errors
/// [`Error::Output`].
pub fn write_png(path: &Path, image: &Image, settings: &PngSettings) -> Result<()> {
    write_encoded(path, encode_png(image, settings))
}

/// Writes what [`encode_png`] gave.
///
/// # Errors
/// [`Error::Output`].
pub fn write_encoded(path: &Path, bytes: std::result::Result<Vec<u8>, String>) -> Result<()> {
    write_atomically(path, &bytes.map_err(|message| Error::output(path, message))?)
}

/// The bytes of the file.
///
/// # Errors
/// Why the picture cannot be packed.
pub fn encode_png(image: &Image, settings: &PngSettings) -> std::result::Result<Vec<u8>, String> {
    let rgb8 = develop(image, settings);
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(&rgb8, image.window.width, image.window.height, image::ExtendedColorType::Rgb8)
        .map_err(|e| e.to_string())?;
    // The encoder does not declare sRGB. The chunk goes between IHDR, which ends at byte 33, and the pixels: length 1,
    // name, rendering intent 0 (perceptual), CRC-32 of name and intent (PNG, third edition, section 11.3.2.5).
    const SRGB: [u8; 13] = [0, 0, 0, 1, b's', b'R', b'G', b'B', 0, 0xae, 0xce, 0x1c, 0xe9];
    bytes.splice(33..33, SRGB);
    Ok(bytes)
}

/// Eight-bit sRGB, three bytes a pixel in raster order.
#[must_use]
pub fn develop(image: &Image, settings: &PngSettings) -> Vec<u8> {
    let width = image.window.width as usize;
    let gain = libm::exp2(settings.exposure_stops);
    let tone = Tone::new(settings.tonemap);
    let mut out = vec![0; 3 * image.window.pixels()];
    if width == 0 {
        return out;
    }
    out.par_chunks_mut(3 * width).enumerate().for_each(|(row, line)| {
        for (column, bytes) in line.chunks_exact_mut(3).enumerate() {
            let i = row * width + column;
            let rgb = [0, 1, 2].map(|c| f64::from(image.rgb[c][i]) * gain);
            let display = tone.apply(multiply(&settings.rec709_from_rgb, rgb));
            let pixel = [i64::from(image.window.x) + column as i64, i64::from(image.window.y) + row as i64];
            for (c, byte) in bytes.iter_mut().enumerate() {
                *byte = quantise(srgb_encode(display[c]), settings.dither, pixel, c as u64);
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

/// A level such that its mean over the dither is the value: v lies between two levels and takes the upper one with
/// probability v − ⌊v⌋. Whole levels, black and white among them, stay.
fn quantise(encoded: f64, dither: Dither, pixel: [i64; 2], channel: u64) -> u8 {
    let threshold = match dither {
        Dither::None => 0.5,
        Dither::Ordered => bayer(pixel),
        Dither::Hash => {
            let key = mix64(pixel[0] as u64 ^ mix64(pixel[1] as u64 ^ channel << 60));
            (key >> 11) as f64 / 9_007_199_254_740_992.0
        }
    };
    (encoded * 255.0 + threshold).floor().clamp(0.0, 255.0) as u8
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

fn multiply(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// A tone curve with its matrices at hand.
struct Tone {
    tonemap: Tonemap,
    agx_outset: [[f64; 3]; 3],
}

/// Rec.709 to the ACES rendering space (Hill 2016), rows.
const ACES_INPUT: [[f64; 3]; 3] =
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
/// And back to Rec.709, with the desaturation of the output transform.
const ACES_OUTPUT: [[f64; 3]; 3] =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

/// The inset of AgX (Sobotka 2022): each primary of Rec.709 drawn towards white; rows sum to one.
const AGX_INSET: [[f64; 3]; 3] = [
    [0.842_401_070_950_468_6, 0.078_436_501_561_802_76, 0.079_162_427_487_728_7],
    [0.042_401_070_950_468_54, 0.878_436_501_561_802_8, 0.079_162_427_487_728_7],
    [0.042_401_070_950_468_54, 0.078_436_501_561_802_76, 0.879_162_427_487_728_7],
];

impl Tone {
    fn new(tonemap: Tonemap) -> Tone {
        Tone { tonemap, agx_outset: inverse(&AGX_INSET) }
    }

    /// Display light, linear, not yet cut.
    fn apply(&self, rgb: [f64; 3]) -> [f64; 3] {
        match self.tonemap {
            Tonemap::None => rgb,
            Tonemap::Reinhard => {
                // Rec.709 luminance; below zero there is nothing to compress.
                let y = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
                rgb.map(|v| v / (1.0 + y.max(0.0)))
            }
            Tonemap::Aces => {
                let fit =
                    |v: f64| (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081);
                // The quotient of infinities is NaN; far before that the curve has reached its limit.
                multiply(&ACES_OUTPUT, multiply(&ACES_INPUT, rgb).map(|v| fit(v.clamp(0.0, 1e9))))
            }
            Tonemap::Agx => {
                let curved = multiply(&AGX_INSET, rgb).map(|v| {
                    let stops = libm::log2(v.max(f64::MIN_POSITIVE) / 0.18);
                    agx_sigmoid(((stops + 10.0) / 16.5).clamp(0.0, 1.0))
                });
                multiply(&self.agx_outset, curved).map(|v| libm::pow(v.max(0.0), 2.2))
            }
        }
    }
}

/// The contrast curve of AgX on [0, 1]: y = 1/2 + s·d / (1 + (|s·d|/L)^p)^(1/p), d = x − 10/16.5, slope s = 2, with
/// p = 3 in the toe and 3.25 in the shoulder; L is such that the curve ends in (0, 0) and (1, 1): where
/// S = s·d there, S/(1 + (S/L)^p)^(1/p) = 1/2 gives (1/L)^p = 2^p − S^−p.
fn agx_sigmoid(x: f64) -> f64 {
    const PIVOT: f64 = 10.0 / 16.5;
    const SLOPE: f64 = 2.0;
    let d = SLOPE * (x - PIVOT);
    let (power, end) = if d < 0.0 { (3.0, SLOPE * PIVOT) } else { (3.25, SLOPE * (1.0 - PIVOT)) };
    let inverse_limit = libm::pow(2.0, power) - libm::pow(end, -power);
    0.5 + d / libm::pow(1.0 + inverse_limit * libm::pow(d.abs(), power), 1.0 / power)
}

fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant = m[0][0] * cofactor(0, 0) + m[0][1] * cofactor(0, 1) + m[0][2] * cofactor(0, 2);
    [0, 1, 2].map(|r| [0, 1, 2].map(|c| cofactor(c, r) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;

    const MAPS: [Tonemap; 4] = [Tonemap::None, Tonemap::Reinhard, Tonemap::Aces, Tonemap::Agx];

    fn grey(value: f32, side: u32) -> Image {
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

    /// CRC-32 of PNG, bit by bit (annex D of the standard).
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |mut crc, &b| {
            crc ^= u32::from(b);
            for _ in 0..8 {
                crc = crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
            }
            crc
        })
    }

    #[test]
    fn the_file_declares_srgb_and_decodes_to_what_was_developed() {
        let settings = PngSettings { tonemap: Tonemap::None, ..PngSettings::default() };
        let image = grey(0.3, 5);
        let bytes = encode_png(&image, &settings).unwrap();
        assert_eq!(&bytes[37..41], b"sRGB");
        assert_eq!(u32::from_be_bytes(bytes[42..46].try_into().unwrap()), crc(&bytes[37..42]));
        let back = image::load_from_memory(&bytes).unwrap().into_rgb8().into_raw();
        assert_eq!(back, develop(&image, &settings));
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

    /// Rows of the ACES and AgX matrices sum to one (to their 5 digits), so grey stays grey within one part in 1e4.
    #[test]
    fn grey_stays_grey_and_brighter_stays_brighter() {
        for map in MAPS {
            let tone = Tone::new(map);
            let mut previous = f64::NEG_INFINITY;
            for i in 0..400 {
                let v = libm::exp2(f64::from(i) / 20.0 - 12.0);
                let [r, g, b] = tone.apply([v; 3]);
                assert!(
                    (r - g).abs() <= 1e-4 * g.abs().max(1e-3) && (b - g).abs() <= 1e-4 * g.abs().max(1e-3),
                    "{map:?} {v}"
                );
                assert!(g >= previous, "{map:?} at {v}: {g} after {previous}");
                previous = g;
            }
        }
    }

    /// Reinhard: 1 → 1/2. Hill's ACES fit of 1: (1.0245786 − 0.000090537)/(0.983729 + 0.432951 + 0.238081) = 0.61911,
    /// times its row sum 1.0000 of the output matrix. AgX pins 0.18 to 1/2 encoded with power 2.2, black at −10 stops
    /// and white at +6.5.
    #[test]
    fn tone_curves_pass_through_their_published_points() {
        let at = |map, v: f64| Tone::new(map).apply([v; 3])[1];
        assert_eq!(at(Tonemap::Reinhard, 1.0), 0.5);
        assert!((at(Tonemap::Aces, 1.0) - 0.619_114).abs() < 1e-5, "{}", at(Tonemap::Aces, 1.0));
        assert!((at(Tonemap::Agx, 0.18) - libm::pow(0.5, 2.2)).abs() < 1e-12);
        assert!(at(Tonemap::Agx, 0.18 / 1024.0).abs() < 1e-12);
        assert!((at(Tonemap::Agx, 0.18 * libm::exp2(6.5)) - 1.0).abs() < 1e-12);
        // The published closed form of the toe: |x − 20/33|³ times 59.507875 below the pivot.
        let d: f64 = 0.3 - 20.0 / 33.0;
        let expected = 0.5 + 2.0 * d / (1.0 + 59.507_875 * d.abs().powi(3)).powf(1.0 / 3.0);
        assert!((agx_sigmoid(0.3) - expected).abs() < 1e-7);
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
                let found = quantise(level, dither, pixel, 1);
                assert_eq!(f64::from(found), (level * 255.0).round(), "{dither:?} {level}");
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
