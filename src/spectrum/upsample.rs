//! From linear Rec.709 colours to smooth spectra: Jakob and Hanika 2019, "A Low-Dimensional
//! Function Space for Efficient Spectral Upsampling".
//!
//! A reflectance is s(t) = ½ + x / (2 √(1 + x²)) with x = c₀t² + c₁t + c₂, where t is the
//! wavelength centred and scaled such that the band is [−1, 1]; with raw nanometres the quadratic
//! would lose three digits in f32. Under D65, and seen by the CIE 1931 observer, it has the colour
//! asked for. A flat reflectance is exactly grey: the three channels are each divided by what a
//! white reflectance gives, which differs from 1 by up to 3e-4 because D65's tabulated spectrum and
//! Rec.709's rounded white point (0.3127, 0.3290) do.
//!
//! Two ways lead to the coefficients. [`reflectance`] solves for them in f64 (about 0.1 ms, exact to
//! 1e-6). [`coefficients`] is for textures: a guess from a table of 16³ solutions for each largest
//! channel, then one or two of Newton's steps on 96 wavelengths at once (about 0.2 µs, exact to 2e-4).
//! Interpolation alone would need ten times the accuracy that a 1 MB table has: at 32³ the worst
//! colour is off by 1.3e-2 (narrow blue on white), with Newton's steps 8³ is off by 1e-4.
//!
//! Emission is D65 times twice the largest channel times the spectrum of the colour divided by
//! that, so that no colour is near the ends of the gamut (the convention of Mitsuba 3 and pbrt-v4).

mod fast;
mod fit;

use crate::error::in_short;
use crate::spectrum::{Lanes, Spectrum, illuminant};

/// Middle of the band and half its width in nm: t = (nm − CENTRE) / HALF.
const CENTRE: f64 = 595.0;
const HALF: f64 = 235.0;

/// x of a spectrum that is 0 or 1: s differs from it by 1 / 4x² = 2.5e-37, and x² is finite in f32.
const END: f32 = 1e18;

/// The value of the smooth colour with the coefficients `c` at each wavelength (nm).
#[must_use]
#[inline]
pub fn eval_sigmoid(c: [f32; 3], nm: Lanes) -> Lanes {
    eval_sigmoid_lanes(c.map(Lanes::splat), nm)
}

/// [`eval_sigmoid`] with coefficients of each lane's own.
///
/// s and 1 − s are each 1 / (2 r (r + |x|)) on their side of x = 0, with r = √(1 + x²): no
/// cancellation, so that a reflectance of 1e-9 keeps its digits.
#[must_use]
#[inline]
pub fn eval_sigmoid_lanes(c: [Lanes; 3], nm: Lanes) -> Lanes {
    let one = Lanes::splat(1.0);
    let t = (nm - Lanes::splat(CENTRE as f32)) * Lanes::splat((1.0 / HALF) as f32);
    let x = c[0].mul_add(t, c[1]).mul_add(t, c[2]);
    let r = x.mul_add(x, one).sqrt();
    let small = Lanes::splat(0.5) / (r * (r + x.abs()));
    x.simd_lt(Lanes::splat(0.0)).select(small, one - small)
}

/// The value of a smooth colour at one wavelength.
#[must_use]
pub fn sigmoid_at(c: [f64; 3], nm: f64) -> f64 {
    let t = (nm - CENTRE) / HALF;
    sigmoid((c[0] * t + c[1]) * t + c[2])
}

/// ½ + x / (2 √(1 + x²)) without cancellation.
fn sigmoid(x: f64) -> f64 {
    let r = (1.0 + x * x).sqrt();
    let small = 0.5 / (r * (r + x.abs()));
    if x < 0.0 { small } else { 1.0 - small }
}

/// The x at which the sigmoid is `s`, for `s` in (0, 1).
fn inverse_sigmoid(s: f64) -> f64 {
    (s - 0.5) / (s * (1.0 - s)).sqrt()
}

/// Coefficients of the flat spectrum of value `grey`.
fn flat(grey: f32) -> [f32; 3] {
    let x = inverse_sigmoid(f64::from(grey)) as f32;
    // 0 and 1, where x is infinite, and what rounds to them.
    [0.0, 0.0, x.clamp(-END, END)]
}

/// Says which channel of a colour is not a number in [0, `max`].
fn check(rgb: [f64; 3], max: f64, what: &str) -> Result<(), String> {
    match rgb.iter().position(|v| !(0.0..=max).contains(v)) {
        None => Ok(()),
        Some(i) => Err(format!("{} channel: expected {what}, found {}", ["red", "green", "blue"][i], in_short(rgb[i]))),
    }
}

/// The reflectance that has the linear Rec.709 colour `rgb` under D65.
///
/// Exact to 1e-5 of each channel; greys become constants.
///
/// # Errors
/// In words, if a channel is outside [0, 1]: no surface reflects that, or less than no light.
pub fn reflectance(rgb: [f64; 3]) -> Result<Spectrum, String> {
    check(rgb, 1.0, "a reflectance in [0, 1]")?;
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
        return Ok(Spectrum::constant(rgb[0]));
    }
    let c = fit::solve(rgb);
    // What is darker than f32 can tell is as dark as it can tell, of the same hue.
    let beyond = (fit::largest(c) / f64::from(END)).max(1.0);
    Ok(Spectrum::Sigmoid { c: c.map(|x| (x / beyond) as f32), scale: 1.0 })
}

/// The emission that has the linear Rec.709 colour `rgb`: for (1, 1, 1), D65 of luminance 1.
///
/// Channels may be of any size; the spectrum is linear in a common factor.
///
/// # Errors
/// In words, if a channel is negative or not finite.
pub fn emission(rgb: [f64; 3]) -> Result<Spectrum, String> {
    check(rgb, f64::from(f32::MAX) / 4.0, "a finite emission of zero or more")?;
    let scale = 2.0 * rgb[0].max(rgb[1]).max(rgb[2]);
    if scale == 0.0 {
        return Ok(Spectrum::constant(0.0));
    }
    Ok(reflectance(rgb.map(|v| v / scale))?.scaled(scale).times(&illuminant::d65()))
}

/// A smooth nonnegative spectrum of any size with the colour `rgb`, for coefficients such as a medium's: a
/// reflectance of the same hue times twice the largest channel.
///
/// # Errors
/// In words, if a channel is negative or not finite.
pub fn unbounded(rgb: [f64; 3]) -> Result<Spectrum, String> {
    if let Some(v) = rgb.iter().find(|v| !v.is_finite() || **v < 0.0) {
        return Err(format!("expected channels of 0 or more, found {}", in_short(*v)));
    }
    let scale = 2.0 * rgb.into_iter().fold(0.0, f64::max);
    if scale == 0.0 {
        return Ok(Spectrum::Constant(0.0));
    }
    Ok(reflectance(rgb.map(|v| v / scale))?.scaled(scale))
}

/// A smooth nonnegative spectrum with the colour `rgb` for an optical constant of a surface: the reflectance of this colour
/// where there is one, as Mitsuba has it, else [`unbounded`].
///
/// # Errors
/// In words, if a channel is negative or not finite.
pub fn optical_constant(rgb: [f64; 3]) -> Result<Spectrum, String> {
    if rgb.iter().all(|v| (0.0..=1.0).contains(v)) { reflectance(rgb) } else { unbounded(rgb) }
}

/// Coefficients of the reflectance that has the linear Rec.709 colour `rgb` under D65: within
/// 2e-4 of each channel, fast enough for each texel of a texture. Channels are clamped to [0, 1].
#[must_use]
pub fn coefficients(rgb: [f32; 3]) -> [f32; 3] {
    // Unlike `clamp` this makes NaN zero, so that the coefficients are always finite.
    let rgb = rgb.map(|v| if v > 0.0 { f32::min(v, 1.0) } else { 0.0 });
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
        return flat(rgb[0]);
    }
    fast::solve(rgb)
}

/// Coefficients of the smooth colour that has the values `values` at the wavelengths `nm`, each kept from 0 and 1 by 2⁻¹⁶.
///
/// The quadratic is at most 128 there, and its terms, with wavelengths 60 nm apart or more, below 2¹⁰: four roundings to f32
/// put it off by 2⁻¹², and the sigmoid by half of that: 1.4e-4 with the bound.
#[must_use]
pub fn through(nm: [f64; 3], values: [f32; 3]) -> [f32; 3] {
    if values[0] == values[1] && values[1] == values[2] {
        return flat(values[0]);
    }
    const LEAST: f64 = 1.0 / 65536.0;
    let t = nm.map(|nm| (nm - CENTRE) / HALF);
    let x = values.map(|v| inverse_sigmoid(f64::from(v).max(0.0).clamp(LEAST, 1.0 - LEAST)));
    // Newton's divided differences, multiplied out.
    let first = (x[1] - x[0]) / (t[1] - t[0]);
    let second = ((x[2] - x[1]) / (t[2] - t[1]) - first) / (t[2] - t[0]);
    [second, first - second * (t[0] + t[1]), x[0] - t[0] * (first - second * t[1])].map(|c| c as f32)
}

/// Coefficients and scale of the emission that has the linear Rec.709 colour `rgb`, for each
/// texel of an environment; the emission is scale · sigmoid · D65 ([`illuminant::d65`]). Negative
/// channels count as zero.
#[must_use]
pub fn emission_coefficients(rgb: [f32; 3]) -> ([f32; 3], f32) {
    let scale = 2.0 * rgb[0].max(rgb[1]).max(rgb[2]).max(0.0);
    if scale == 0.0 {
        return (flat(0.5), 0.0);
    }
    (coefficients(rgb.map(|v| v / scale)), scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::colour::ColourSpace;
    use crate::spectrum::observer::tristimulus;

    /// The colour of `reflectance` under D65 as the film shows it: XYZ by an independent quadrature,
    /// the Rec.709 matrix, and the white of a flat reflectance taken out.
    fn colour(reflectance: &Spectrum) -> [f64; 3] {
        let rgb = |s: &Spectrum| {
            let xyz = tristimulus(s);
            ColourSpace::Rec709.matrix_from_xyz().map(|row| (0..3).map(|k| row[k] * xyz[k]).sum::<f64>())
        };
        let (found, white) = (rgb(&reflectance.times(&illuminant::d65())), rgb(&illuminant::d65()));
        std::array::from_fn(|k| found[k] / white[k])
    }

    fn error(reflectance: &Spectrum, rgb: [f64; 3]) -> f64 {
        let found = colour(reflectance);
        (0..3).map(|k| (found[k] - rgb[k]).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn an_optical_constant_is_a_reflectance_where_it_may_be_one() {
        let nm = Lanes::from([380.0, 430.0, 480.0, 530.0, 580.0, 630.0, 680.0, 780.0]);
        let values = |spectrum: Result<Spectrum, String>| spectrum.unwrap().eval(nm).to_array();
        assert_eq!(values(optical_constant([0.2, 0.3, 1.0])), values(reflectance([0.2, 0.3, 1.0])));
        assert_eq!(values(optical_constant([0.2, 0.3, 1.5])), values(unbounded([0.2, 0.3, 1.5])));
        assert!(optical_constant([-0.1, 0.3, 0.5]).is_err());
    }

    /// A reflectance of 10⁻³⁰⁰ has coefficients of some 10¹⁵⁰, beyond f32: it is as good as black, if not how far.
    #[test]
    fn colours_that_are_all_but_black_are_numbers() {
        for rgb in [[1e-300, 0.0, 0.0], [0.0, 1e-100, 1e-101], [5e-324, 0.0, 0.0]] {
            let spectrum = reflectance(rgb).unwrap();
            let lanes = spectrum.eval(Lanes::new([360.0, 420.0, 480.0, 540.0, 595.0, 660.0, 720.0, 830.0]));
            assert!(lanes.to_array().iter().all(|x| (0.0..1e-20).contains(x)), "{rgb:?}: {lanes:?} of {spectrum:?}");
        }
    }

    /// A deterministic spread of colours: inside, on faces, on edges, dark and near white.
    fn spread() -> Vec<[f64; 3]> {
        let mut state = 1u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        let mut colours = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0]];
        colours.extend([[0.0, 1.0, 1.0], [0.0; 3], [1.0; 3], [1e-9; 3], [1e-9, 0.0, 0.0], [1.0, 1.0, 0.999]]);
        for n in 0..1500 {
            let mut rgb = [random(), random(), random()];
            match n % 5 {
                1 => rgb[n / 5 % 3] = 0.0,
                2 => rgb[n / 5 % 3] = 1.0,
                3 => rgb = rgb.map(|v| v * rgb[0].powi(4)),
                4 => rgb = rgb.map(|v| 1.0 - v * rgb[0].powi(4)),
                _ => (),
            }
            colours.push(rgb);
        }
        colours
    }

    #[test]
    fn direct_reflectance_has_its_colour_to_1e_5() {
        for rgb in spread().into_iter().take(400) {
            let reflectance = reflectance(rgb).unwrap();
            assert!(error(&reflectance, rgb) < 1e-5, "{rgb:?} {reflectance:?}: {:e}", error(&reflectance, rgb));
        }
    }

    #[test]
    fn fast_coefficients_have_their_colour_to_2e_4_and_are_finite() {
        for rgb in spread() {
            let c = coefficients(rgb.map(|v| v as f32));
            assert!(c.iter().all(|x| x.is_finite()), "{rgb:?}: {c:?}");
            let e = error(&Spectrum::Sigmoid { c, scale: 1.0 }, rgb);
            assert!(e < 2e-4, "{rgb:?} {c:?}: {e:e}");
        }
    }

    /// A grey is flat: the same at every wavelength, to the rounding of one f32 coefficient.
    #[test]
    fn greys_black_and_white_are_flat() {
        for grey in [0.0f32, 1e-9, 1e-3, 0.18, 0.5, 0.999, 1.0] {
            let c = coefficients([grey; 3]);
            let values =
                eval_sigmoid(c, Lanes::new([360.0, 400.0, 450.0, 500.0, 595.0, 650.0, 700.0, 830.0])).to_array();
            for v in values {
                assert!((v - grey).abs() <= 4e-7 * grey + 1e-36, "{grey}: {v}");
            }
        }
        assert!(matches!(reflectance([0.18; 3]), Ok(Spectrum::Constant(_))));
        let odd = coefficients([f32::NAN, -1.0, 7.0]);
        assert!(odd.iter().all(|x| x.is_finite()));
    }

    /// Rec.709 white is (1, 1, 1): emission of it is D65 of luminance 1, and twice the colour is twice the light.
    #[test]
    fn emission_of_white_is_d65_of_luminance_one() {
        let white = emission([1.0; 3]).unwrap();
        assert!((white.luminance() - 1.0).abs() < 1e-6);
        for nm in [400.0, 560.0, 700.0] {
            assert!((white.at(nm) / illuminant::d65().at(nm) - 1.0).abs() < 1e-6);
        }
        for rgb in [[3.0, 0.2, 0.0], [1e6, 1e5, 2e4], [0.3, 4.0, 0.2], [0.0, 0.0, 1e-6]] {
            let size = rgb.iter().copied().fold(0.0, f64::max);
            // The emission already holds D65: divide by the colour of a white emission.
            let (c, scale) = emission_coefficients(rgb.map(|v| v as f32));
            let fast = Spectrum::Sigmoid { c, scale }.times(&illuminant::d65());
            for spectrum in [emission(rgb).unwrap(), fast] {
                let xyz = tristimulus(&spectrum);
                let white = tristimulus(&illuminant::d65());
                let m = ColourSpace::Rec709.matrix_from_xyz();
                for k in 0..3 {
                    let dot = |v: [f64; 3]| (0..3).map(|j| m[k][j] * v[j]).sum::<f64>();
                    assert!((dot(xyz) / dot(white) - rgb[k]).abs() < 4e-4 * size, "{rgb:?} {k}");
                }
            }
        }
        assert!(emission([0.0; 3]).unwrap().is_black());
        assert_eq!(emission_coefficients([0.0; 3]).1, 0.0);
    }

    #[test]
    fn colours_that_cannot_be_are_refused_in_words() {
        assert!(reflectance([0.5, 1.2, 0.5]).unwrap_err().contains("green channel"));
        assert!(reflectance([0.5, 0.2, f64::NAN]).unwrap_err().contains("blue channel"));
        assert!(emission([-0.1, 0.0, 0.0]).unwrap_err().contains("red channel"));
        assert!(emission([f64::INFINITY, 0.0, 0.0]).is_err());
    }

    /// 1 − s and s swap when the coefficients change sign, and neither loses digits: at x = −1e4
    /// s = 1 / 4x² = 2.5e-9 to the rounding of five f32 operations.
    #[test]
    fn dark_values_keep_their_digits() {
        let s = eval_sigmoid([0.0, 0.0, -1e4], Lanes::splat(500.0)).to_array()[3];
        assert!((f64::from(s) / 2.5e-9 - 1.0).abs() < 5e-7, "{s:e}");
        assert_eq!(eval_sigmoid([0.0, 0.0, END], Lanes::splat(500.0)).to_array(), [1.0; 8]);
        assert!(eval_sigmoid([0.0, 0.0, -END], Lanes::splat(500.0)).to_array()[0] < 1e-36);
    }
}
