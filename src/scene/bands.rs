//! Pictures with many bands of the spectrum a texel: spectral OpenEXR files (layout 1.0 of Fichet, Pacanowski and Wilkie,
//! "An OpenEXR Layout for Spectral Images", JCGT 10(3), 2021).
//!
//! `S0.<nm>nm` is spectral radiance, `T.<nm>nm` reflectance or transmittance. Polarisation (S1 to S3) and fluorescence
//! (`T.<nm>nm.<nm>nm`) are refused.

use super::texture::spread;
use crate::error::{Error, Result};
use crate::film::exr::ExrPart;
use crate::spectrum::{Lanes, Outside, Spectrum};
use rayon::prelude::*;
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// What the numbers of a spectral file are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Radiance, W·m⁻²·sr⁻¹·nm⁻¹.
    Radiance,
    /// Reflectance, 0 to 1.
    Reflectance,
}

/// The spectra of the texels of a picture, row by row.
#[derive(Clone, Debug)]
pub struct Bands {
    /// What they are.
    pub quantity: Quantity,
    /// Wavelengths of the bands, rising, nm.
    nm: Vec<f32>,
    /// For each texel a number for each band.
    values: Arc<Vec<f32>>,
    /// The texel with the most over all bands, once that is asked for.
    brightest: Arc<OnceLock<Option<usize>>>,
}

impl Bands {
    /// Those of a file, if it is a spectral one.
    ///
    /// # Errors
    /// [`Error::Input`] where it holds what is not read, or a number that is no light or reflectance.
    pub fn of(path: &Path, part: &ExrPart) -> Result<Option<Bands>> {
        let fail = |message: String| Err(Error::input(path, message));
        let mut found: Vec<(Quantity, f64, &[f32])> = Vec::new();
        for (name, plane) in &part.channels {
            let Some((quantity, rest)) = quantity(name) else {
                if ["S1.", "S2.", "S3."].iter().any(|prefix| name.starts_with(prefix))
                    && wavelength(&name[3..]).is_some()
                {
                    return fail(format!("expected light that is not polarised, found the channel `{name}`"));
                }
                continue;
            };
            match (wavelength(rest), rest.split_once("m.").and_then(|(_, to)| wavelength(to))) {
                (Some(nm), _) => found.push((quantity, nm, plane)),
                (None, Some(_)) => return fail(format!("expected no fluorescence, found the channel `{name}`")),
                (None, None) => {}
            }
        }
        let Some(&(quantity, ..)) = found.first() else { return Ok(None) };
        if found.iter().any(|(other, ..)| *other != quantity) {
            return fail("expected either radiance (S0) or reflectance (T), found both".into());
        }
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        if let Some(pair) = found.windows(2).find(|pair| pair[0].1 == pair[1].1) {
            return fail(format!("expected each wavelength once, found {} nm again", pair[0].1));
        }
        if quantity == Quantity::Radiance && found.len() < 2 {
            return fail("expected two bands or more, found one: how wide it is cannot be known".into());
        }
        let most = if quantity == Quantity::Reflectance { 1.0 } else { f32::MAX };
        for (_, nm, plane) in &found {
            if let Some(i) = plane.iter().position(|x| !(0.0..=most).contains(x)) {
                let (x, y) = (i % part.window.width as usize, i / part.window.width as usize);
                let expected = if most == 1.0 { "reflectances from 0 to 1" } else { "radiance of 0 or more" };
                return fail(format!("expected {expected}, found {} at {nm} nm of ({x}, {y})", plane[i]));
            }
        }
        let nm: Vec<f32> = found.iter().map(|(_, nm, _)| *nm as f32).collect();
        let texels = part.window.pixels();
        let of_texel = |i: usize| found.iter().map(move |(_, _, plane)| plane[i]).collect::<Vec<f32>>();
        let values: Vec<f32> = (0..texels).into_par_iter().with_min_len(1024).flat_map_iter(of_texel).collect();
        Ok(Some(Bands { quantity, nm, values: Arc::new(values), brightest: Arc::default() }))
    }

    /// The same spectra times `factor`.
    #[must_use]
    pub fn scaled(self, factor: f32) -> Bands {
        let values = self.values.par_iter().map(|x| x * factor).collect();
        Bands { values: Arc::new(values), brightest: Arc::default(), ..self }
    }

    /// How many texels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len() / self.nm.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The numbers of the texel `i`.
    #[must_use]
    pub fn texel(&self, i: usize) -> &[f32] {
        &self.values[i * self.nm.len()..(i + 1) * self.nm.len()]
    }

    /// The spectrum of the texel `i` at `nm`: linear between the bands' wavelengths. Beyond them a reflectance is that of
    /// the outermost band; light reaches half a band farther, and what was not measured is not assumed.
    #[must_use]
    pub fn eval(&self, i: usize, nm: Lanes) -> Lanes {
        let values = self.texel(i);
        let [low, high] = self.reach();
        Lanes::new(nm.to_array().map(|nm| {
            if nm < low || nm > high {
                return 0.0;
            }
            let after = self.nm.partition_point(|band| *band <= nm);
            if after == 0 {
                return values[0];
            }
            let (Some(&next), last) = (self.nm.get(after), values[after - 1]) else { return values[after - 1] };
            let t = (nm - self.nm[after - 1]) / (next - self.nm[after - 1]);
            last + (values[after] - last) * t
        }))
    }

    /// The wavelengths beyond which there is nothing.
    fn reach(&self) -> [f32; 2] {
        let n = self.nm.len();
        if self.quantity == Quantity::Reflectance || n < 2 {
            return [f32::MIN, f32::MAX];
        }
        let half = |i: usize| 0.5 * (self.nm[i + 1] - self.nm[i]);
        [self.nm[0] - half(0), self.nm[n - 1] + half(n - 2)]
    }

    /// Some 16 of the spectra and the brightest, for the choice of wavelengths.
    #[must_use]
    pub fn representatives(&self) -> Vec<Spectrum> {
        spread(self.len(), 16).chain(self.brightest()).map(|i| self.spectrum(i)).collect()
    }

    /// The texel with the most over all bands.
    #[must_use]
    pub fn brightest(&self) -> Option<usize> {
        *self.brightest.get_or_init(|| {
            let sum = |i: &usize| self.texel(*i).iter().sum::<f32>();
            (0..self.len()).max_by(|a, b| sum(a).total_cmp(&sum(b)))
        })
    }

    /// The spectrum of the texel `i`, for choices; of one level where wavelengths are no table, as when f32 does not tell two apart.
    ///
    /// # Panics
    /// If there is no such texel.
    #[must_use]
    pub fn spectrum(&self, i: usize) -> Spectrum {
        let values = self.texel(i).iter().map(|x| f64::from(*x));
        let mut samples: Vec<(f64, f64)> = self.nm.iter().map(|nm| f64::from(*nm)).zip(values).collect();
        let outside = match self.quantity {
            Quantity::Reflectance => Outside::Hold,
            Quantity::Radiance => {
                let [low, high] = self.reach().map(f64::from);
                let (first, last) = (samples[0].1, samples[samples.len() - 1].1);
                samples.insert(0, (low, first));
                samples.push((high, last));
                Outside::Zero
            }
        };
        let mean = samples.iter().map(|(_, x)| x).sum::<f64>() / samples.len() as f64;
        Spectrum::from_samples(&samples, outside).unwrap_or_else(|_| Spectrum::constant(mean))
    }

    /// The mean over the bands of each texel.
    #[must_use]
    pub fn means(&self) -> Vec<f32> {
        let n = self.nm.len() as f32;
        self.values.chunks_exact(self.nm.len()).map(|texel| texel.iter().sum::<f32>() / n).collect()
    }
}

/// What the channel `name` is of by the beginning of its name, and the rest of that.
fn quantity(name: &str) -> Option<(Quantity, &str)> {
    [("S0.", Quantity::Radiance), ("T.", Quantity::Reflectance)]
        .into_iter()
        .find_map(|(prefix, quantity)| name.strip_prefix(prefix).map(|rest| (quantity, rest)))
}

/// Whether the channel `name` is a band: any layer may be called T.
#[must_use]
pub fn is_band(name: &str) -> bool {
    quantity(name).is_some_and(|(_, rest)| wavelength(rest).is_some())
}

/// The wavelength of `450,500000nm` in nm; units are those of the layout, from picometres to metres, and hertz.
fn wavelength(text: &str) -> Option<f64> {
    let (digits, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic() && c != 'e' && c != 'E')?);
    let number: f64 = digits.replace(',', ".").parse().ok()?;
    let prefixes = [
        ("", 1.0),
        ("p", 1e-12),
        ("n", 1e-9),
        ("u", 1e-6),
        ("m", 1e-3),
        ("c", 1e-2),
        ("d", 1e-1),
        ("k", 1e3),
        ("M", 1e6),
    ];
    let prefixes = prefixes.into_iter().chain([("G", 1e9), ("T", 1e12), ("P", 1e15)]);
    let factor = |prefix: &str| prefixes.clone().find(|(name, _)| *name == prefix).map(|(_, factor)| factor);
    let nm = match (unit.strip_suffix("Hz"), unit.strip_suffix('m')) {
        (Some(prefix), _) => 299_792_458.0 / (number * factor(prefix)?) * 1e9,
        // 1e-9 is no power of two: 450,5 nm stays 450.5.
        (None, Some("n")) => number,
        (None, Some(prefix)) => number * factor(prefix)? * 1e9,
        (None, None) => return None,
    };
    (nm.is_finite() && nm > 0.0).then_some(nm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;

    fn part(channels: &[(&str, [f32; 2])]) -> ExrPart {
        ExrPart {
            name: None,
            window: Window::full(2, 1),
            channels: channels.iter().map(|(name, v)| ((*name).to_owned(), v.to_vec())).collect(),
            integers: Vec::new(),
            texts: Vec::new(),
        }
    }

    fn bands(channels: &[(&str, [f32; 2])]) -> std::result::Result<Option<Bands>, String> {
        Bands::of(Path::new("a.exr"), &part(channels)).map_err(|e| e.to_string())
    }

    /// 500 THz are 299792458 / 5e14 m = 599.584916 nm.
    #[test]
    fn wavelengths_have_units() {
        assert_eq!(wavelength("450,500000nm"), Some(450.5));
        assert!((wavelength("0,5um").unwrap() - 500.0).abs() < 1e-9);
        assert!((wavelength("500THz").unwrap() - 599.584_916).abs() < 1e-9);
        assert!((wavelength("5,5E-7m").unwrap() - 550.0).abs() < 1e-9);
        assert_eq!(["R", "450", "nm", "450ms", "-3nm"].map(wavelength), [None; 5]);
    }

    #[test]
    fn spectra_are_linear_between_bands_and_held_beyond() {
        let found = bands(&[("T.600,0nm", [0.5, 0.0]), ("T.400,0nm", [0.1, 1.0]), ("R", [9.0, 9.0])]).unwrap().unwrap();
        assert_eq!((found.len(), found.quantity), (2, Quantity::Reflectance));
        let nm = Lanes::new([380.0, 400.0, 450.0, 500.0, 550.0, 600.0, 700.0, 830.0]);
        let expected = [0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.5, 0.5];
        for (x, expected) in found.eval(0, nm).to_array().into_iter().zip(expected) {
            assert!((x - expected).abs() < 1e-6, "{x} against {expected}");
        }
        assert_eq!(found.means(), [0.3, 0.5]);
    }

    /// Bands 100 nm apart reach from 350 to 650 nm.
    #[test]
    fn light_ends_half_a_band_beyond() {
        let found =
            bands(&[("S0.400nm", [1.0, 0.0]), ("S0.500nm", [3.0, 0.0]), ("S0.600nm", [5.0, 0.0])]).unwrap().unwrap();
        let nm = Lanes::new([340.0, 351.0, 400.0, 450.0, 600.0, 649.0, 651.0, 800.0]);
        assert_eq!(found.eval(0, nm).to_array(), [0.0, 1.0, 1.0, 2.0, 5.0, 5.0, 0.0, 0.0]);
        let spectrum = &found.representatives()[0];
        assert_eq!(spectrum.eval(nm).to_array(), found.eval(0, nm).to_array());
    }

    #[test]
    fn what_is_no_plain_spectrum_is_refused() {
        assert!(bands(&[("R", [0.0; 2]), ("T.x", [0.0; 2])]).unwrap().is_none());
        let fault = |channels: &[(&str, [f32; 2])]| bands(channels).unwrap_err();
        assert!(
            fault(&[("T.500nm", [0.5, 1.5])])
                .ends_with("expected reflectances from 0 to 1, found 1.5 at 500 nm of (1, 0)")
        );
        assert!(
            fault(&[("S0.400nm", [0.0; 2]), ("S0.500nm", [0.5, f32::NAN])])
                .contains("radiance of 0 or more, found NaN")
        );
        assert!(fault(&[("S0.500nm", [0.0; 2]), ("T.500nm", [0.0; 2])]).contains("found both"));
        assert!(fault(&[("S0.500nm", [0.0; 2]), ("S1.500nm", [0.0; 2])]).contains("not polarised"));
        assert!(fault(&[("T.400nm.500nm", [0.0; 2])]).contains("no fluorescence"));
        assert!(fault(&[("S0.400nm", [0.0; 2])]).contains("two bands or more"));
        assert!(fault(&[("T.500nm", [0.0; 2]), ("T.0,5um", [0.0; 2])]).contains("500 nm again"));
    }
}
