//! Lights by name and by temperature.

use crate::error::in_short;
use crate::spectrum::Spectrum;
use crate::spectrum::table::{Outside, Table};
use std::sync::{Arc, LazyLock, OnceLock};

/// First radiation constant for radiance, 2 h c², W·m²·sr⁻¹, from the exact h and c of the SI.
const C1L: f64 = 2.0 * 6.626_070_15e-34 * 299_792_458.0 * 299_792_458.0;
/// Second radiation constant, h c / k, m·K.
const C2: f64 = 6.626_070_15e-34 * 299_792_458.0 / 1.380_649e-23;

/// Spectral radiance of a black body of `kelvin` at `nm`, W·m⁻²·sr⁻¹·nm⁻¹ (Planck 1901).
#[must_use]
pub fn planck(nm: f64, kelvin: f64) -> f64 {
    let metre = nm * 1e-9;
    let per_metre = C1L / (metre * metre * metre * metre * metre) / libm::expm1(C2 / (metre * kelvin));
    per_metre * 1e-9
}

/// Says what is wrong with a temperature. At 50 K the band's brightest wavelength is 1e-134 of a
/// candle and f64 still holds it; at 1e12 K radiance is still finite in f32.
fn check_kelvin(kelvin: f64) -> Result<(), String> {
    if (50.0..=1e12).contains(&kelvin) {
        return Ok(());
    }
    Err(format!("expected a temperature of 50 to 1e12 K, found {}", in_short(kelvin)))
}

/// A black body of `kelvin`: absolute spectral radiance, W·m⁻²·sr⁻¹·nm⁻¹, at each nanometre of
/// the band, linear between (within 2e-6 at 5000 K).
///
/// # Errors
/// In words, if the temperature is not between 50 and 1e12 K.
pub fn blackbody(kelvin: f64) -> Result<Spectrum, String> {
    check_kelvin(kelvin)?;
    let values: Vec<f64> = (360..=830).map(|nm| planck(f64::from(nm), kelvin)).collect();
    Ok(Spectrum::Table(Arc::new(Table::uniform(360.0, 1.0, &values, Outside::Zero))))
}

/// A black body of `kelvin`, scaled to luminance Y = 1.
///
/// # Errors
/// As [`blackbody`].
pub fn blackbody_normalised(kelvin: f64) -> Result<Spectrum, String> {
    check_kelvin(kelvin)?;
    // Relative to the radiance at 830 nm, the greatest of a cold body: f32 holds it at any temperature.
    let top = planck(830.0, kelvin);
    let values: Vec<f64> = (360..=830).map(|nm| planck(f64::from(nm), kelvin) / top).collect();
    Ok(normalised(&Spectrum::Table(Arc::new(Table::uniform(360.0, 1.0, &values, Outside::Zero)))))
}

/// `spectrum` scaled to luminance Y = 1.
fn normalised(spectrum: &Spectrum) -> Spectrum {
    spectrum.scaled(1.0 / spectrum.luminance())
}

/// The illuminant that is 1 everywhere.
const EVEN: &str = "E";

/// The rest of a line of the table, and the illuminant once somebody has asked for it: to scale one takes as long as to compile a small scene.
struct Tabulated {
    name: &'static str,
    numbers: &'static str,
    spectrum: OnceLock<Spectrum>,
}

static TABULATED: LazyLock<Vec<Tabulated>> = LazyLock::new(|| {
    let lines = include_str!("data/illuminants.txt").lines().filter(|line| !line.starts_with('#'));
    let named = lines.map(|line| line.split_once(' ').expect("an illuminant has a name and numbers"));
    named.map(|(name, numbers)| Tabulated { name, numbers, spectrum: OnceLock::new() }).collect()
});

impl Tabulated {
    fn spectrum(&self) -> Spectrum {
        let made = self.spectrum.get_or_init(|| {
            let number = |x: &str| x.parse::<f64>().expect("the illuminants' table holds numbers");
            let mut numbers = self.numbers.split(' ').map(number);
            let first = numbers.next().expect("first wavelength");
            let step = numbers.next().expect("step");
            let values: Vec<f64> = numbers.collect();
            normalised(&Spectrum::Table(Arc::new(Table::uniform(first, step, &values, Outside::Zero))))
        });
        made.clone()
    }
}

/// A CIE illuminant by name, scaled to luminance Y = 1: A, B, C, D50, D55, D65, D75, E, F1 to F12,
/// F3.1 to F3.15, HP1 to HP5, LED-B1 to LED-B5, LED-BH1, LED-RGB1, LED-V1, LED-V2. Letter case
/// does not count. All but A, D and E are tabulated up to 780 nm and dark beyond.
///
/// # Errors
/// In words, with near misses, if there is no such illuminant.
pub fn illuminant(name: &str) -> Result<Spectrum, String> {
    if name.eq_ignore_ascii_case(EVEN) {
        return Ok(Spectrum::constant(1.0));
    }
    match TABULATED.iter().find(|light| light.name.eq_ignore_ascii_case(name)) {
        Some(light) => Ok(light.spectrum()),
        None => Err(super::catalogue::unknown("illuminant", name, &illuminant_names())),
    }
}

/// The names that [`illuminant`] knows.
#[must_use]
fn illuminant_names() -> Vec<&'static str> {
    std::iter::once(EVEN).chain(TABULATED.iter().map(|light| light.name)).collect()
}

/// Daylight D65 of luminance Y = 1: the white of Rec.709.
#[must_use]
pub fn d65() -> Spectrum {
    illuminant("D65").expect("the table of illuminants holds D65")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::observer::tristimulus;

    fn chromaticity(spectrum: &Spectrum) -> [f64; 2] {
        let [x, y, z] = tristimulus(spectrum);
        [x / (x + y + z), y / (x + y + z)]
    }

    /// Chromaticities that CIE 15:2018 prints (tables T.3 and T.8). Its sums end at 780 nm and step by
    /// 1 or 5 nm: with the tails and linear interpolation the last digit may move; a wrong row moves the third.
    #[test]
    fn illuminants_have_the_printed_chromaticities() {
        let printed = [
            ("A", [0.447_58, 0.407_45]),
            ("C", [0.310_06, 0.316_16]),
            ("D50", [0.345_67, 0.358_51]),
            ("D55", [0.332_43, 0.347_44]),
            ("D65", [0.312_72, 0.329_03]),
            ("D75", [0.299_03, 0.314_88]),
            ("E", [1.0 / 3.0, 1.0 / 3.0]),
            ("F2", [0.3721, 0.3751]),
            ("F7", [0.3129, 0.3292]),
            ("F11", [0.3805, 0.3769]),
            ("LED-B1", [0.4560, 0.4078]),
        ];
        for (name, xy) in printed {
            let spectrum = illuminant(name).unwrap();
            let found = chromaticity(&spectrum);
            // Lines of the F lamps are 5 nm bins: CIE's own sums take them as points.
            let tolerance = if name.starts_with(['F', 'L']) { 1.5e-3 } else { 1e-4 };
            assert!((found[0] - xy[0]).abs() < tolerance && (found[1] - xy[1]).abs() < tolerance, "{name}: {found:?}");
            assert!((spectrum.luminance() - 1.0).abs() < 1e-6, "{name}");
        }
    }

    /// D65 relative to its value at 560 nm, as ISO 11664-2 prints it, to the end of the band.
    #[test]
    fn d65_has_the_printed_values() {
        let at = |nm: f64| 100.0 * d65().at(nm) / d65().at(560.0);
        for (nm, value) in [(360.0, 46.6383), (450.0, 117.008), (780.0, 63.3828), (785.0, 63.8434), (830.0, 60.3125)] {
            assert!((at(nm) - value).abs() < 1e-4, "{nm}: {}", at(nm));
        }
    }

    /// Wien: the peak of a black body of 5000 K lies at 2.897771955e-3 / 5000 m = 579.55 nm, with
    /// 4.0956786e-6 T⁵ W·m⁻³·sr⁻¹ … = 12799 W·m⁻²·sr⁻¹·nm⁻¹ there.
    #[test]
    fn blackbody_is_absolute() {
        let body = blackbody(5000.0).unwrap();
        let peak = body.at(579.554);
        // b_peak = 2 h c² x⁵ k⁵ / (h⁵ c⁵ (eˣ − 1)) T⁵ with x = 4.965114231744276.
        let x = 4.965_114_231_744_276_f64;
        let expected = C1L * (x / C2).powi(5) / x.exp_m1() * 5000f64.powi(5) * 1e-9;
        // Linear interpolation over 1 nm errs by up to b″/8b = 1.9e-6 at the peak of 5000 K.
        assert!((peak / expected - 1.0).abs() < 2e-6, "{peak} {expected}");
        assert!((body.at(500.0) / planck(500.0, 5000.0) - 1.0).abs() < 1e-7);
        assert!((blackbody_normalised(60.0).unwrap().luminance() - 1.0).abs() < 1e-5);
        assert!((blackbody_normalised(1e9).unwrap().luminance() - 1.0).abs() < 1e-5);
    }

    /// Mitsuba 3.9.1 renders a black body of 5000 K as linear Rec.709 (15278, 12095, 9602); its observer's
    /// table has steps of 5 nm and another normalisation (0.1 %).
    #[test]
    fn blackbody_of_5000_kelvin_has_the_colour_another_renderer_finds() {
        let xyz = tristimulus(&blackbody(5000.0).unwrap()).map(|v| v as f32);
        let rgb = crate::spectrum::ColourSpace::Rec709.from_xyz(xyz);
        for (found, expected) in rgb.into_iter().zip([15278.0, 12095.0, 9602.0]) {
            assert!((found / expected - 1.0f32).abs() < 3e-3, "{rgb:?}");
        }
    }

    #[test]
    fn unknown_lights_are_refused_with_near_misses() {
        let message = illuminant("D56").unwrap_err();
        assert!(message.contains("unknown illuminant \"D56\"") && message.contains("D55"), "{message}");
        assert!(blackbody(-3.0).unwrap_err().contains("found -3"));
        assert!(blackbody(f64::NAN).is_err() && illuminant("led-b1").is_ok());
    }
}
