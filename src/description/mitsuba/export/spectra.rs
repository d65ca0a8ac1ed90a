//! Spectra and textures in the place of one.

use std::path::Path;

use super::super::super::spectrum::{Spectrum, SpectrumOrTexture};
pub(super) use super::super::spectra::at;
use super::xml::numbers;
use super::{DAYLIGHT, Export, ends_in};
use crate::spectrum::{BAND_NM, Spectrum as Curve, illuminant, upsample};

/// What a spectrum is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    /// Held beyond the ends of a table.
    Reflectance,
    /// σ of media: held beyond the ends.
    Coefficient,
    /// η, k, σₐ of hair: held beyond the ends.
    OpticalConstant,
    /// Zero beyond the ends.
    Emission,
}

impl Export<'_> {
    /// Whether Mitsuba has words for a spectrum.
    pub(super) fn can_say(spectrum: &Spectrum) -> bool {
        match spectrum {
            Spectrum::Number(_) | Spectrum::Rgb(_) | Spectrum::Table(_) => true,
            Spectrum::Illuminant(illuminant) => illuminant.name.eq_ignore_ascii_case("D65"),
            Spectrum::Blackbody(body) => !body.normalised && body.scale == 1.0,
            Spectrum::Scaled(scaled) => match unscaled(&scaled.of).1 {
                Spectrum::Blackbody(_) => false,
                Spectrum::ZeroOutside(inner) => matches!(**inner, Spectrum::Table(_)),
                inner => Export::can_say(inner),
            },
            Spectrum::ZeroOutside(inner) => match &**inner {
                Spectrum::Table(_) => true,
                Spectrum::File(file) => reads(file),
                _ => false,
            },
            _ => false,
        }
    }

    /// What Mitsuba gets in place of optical constants that it has no words for: `grey`, or where a colour is above 1, which
    /// Mitsuba takes for 1, its curve.
    pub(super) fn constant_shortfall(constants: &[&Spectrum], grey: &str) -> Option<String> {
        if !constants.iter().all(|constant| Export::can_say(constant)) {
            return Some(grey.to_owned());
        }
        let sampled = constants.iter().any(|constant| colour_beyond(constant, Role::OpticalConstant, 1.0).is_some());
        sampled
            .then(|| "its colour at every fifth nanometre: Mitsuba has none above 1 there, and no multiples".to_owned())
    }

    /// What Mitsuba gets in place of shares of light that it has no words for: `grey`, or of a multiple of a colour its curve.
    pub(super) fn reflectance_shortfall(shares: &[&Spectrum], grey: &'static str) -> Option<&'static str> {
        let unsaid: Vec<&Spectrum> = shares.iter().copied().filter(|share| !Export::can_say(share)).collect();
        if !unsaid.is_empty() {
            // The squares of a checkerboard may be light.
            let curves = unsaid.iter().all(|share| sampled(unscaled(share).1).is_some());
            return Some(if curves { "its spectra at every fifth nanometre" } else { grey });
        }
        let sampled = shares.iter().any(|share| colour_beyond(share, Role::Reflectance, 1.0).is_some());
        sampled.then_some("its colour at every fifth nanometre: Mitsuba has no multiples of one")
    }

    /// The same where textures may stand, which tell what they lack by themselves.
    pub(super) fn either_shortfall(shares: &[&SpectrumOrTexture], grey: &'static str) -> Option<&'static str> {
        let spectra = shares.iter().filter_map(|share| match share {
            SpectrumOrTexture::Spectrum(spectrum) => Some(spectrum),
            SpectrumOrTexture::Texture(_) => None,
        });
        Export::reflectance_shortfall(&spectra.collect::<Vec<_>>(), grey)
    }

    /// What Mitsuba gets in place of a coefficient that it has no words for.
    pub(super) fn coefficient_shortfall(coefficient: &Spectrum) -> Option<&'static str> {
        if !Export::can_say(coefficient) {
            return Some("grey in place of a spectrum");
        }
        colour_beyond(coefficient, Role::Coefficient, 1.0).map(|_| "its colour at every fifth nanometre")
    }

    /// A `<spectrum>` or `<rgb>`; what Mitsuba cannot say is grey of one half.
    pub(super) fn spectrum(&mut self, name: &str, spectrum: &Spectrum, role: Role) {
        self.scaled_spectrum(name, spectrum, role, 1.0);
    }

    fn scaled_spectrum(&mut self, name: &str, spectrum: &Spectrum, role: Role, by: f64) {
        if let Some(curve) = colour_beyond(spectrum, role, by) {
            return self.curve(name, &curve, 1.0);
        }
        match spectrum {
            Spectrum::Number(value) => self.xml.value("spectrum", name, value * by),
            // Mitsuba refuses a black `<rgb>` as light.
            Spectrum::Rgb(rgb) if role == Role::Emission && rgb.iter().all(|c| c * by == 0.0) => {
                self.xml.value("spectrum", name, 0);
            }
            Spectrum::Rgb(rgb) => {
                let light = if role == Role::Emission { 1.0 / DAYLIGHT } else { 1.0 };
                self.xml.value("rgb", name, numbers(&rgb.map(|c| c * by * light)));
            }
            Spectrum::Table(pairs) => {
                let ends = if role == Role::Emission { Ends::Zero } else { Ends::Held };
                self.table(name, pairs, by, ends);
            }
            Spectrum::ZeroOutside(inner) => match &**inner {
                Spectrum::Table(pairs) => self.table(name, pairs, by, Ends::Zero),
                Spectrum::File(file) if by == 1.0 && reads(file) => {
                    let file = self.file(file);
                    self.xml.leaf("spectrum", &[("name", name), ("filename", &file)]);
                }
                _ => self.xml.value("spectrum", name, 0.5 * by),
            },
            Spectrum::Illuminant(illuminant) if illuminant.scale * by == 0.0 => self.xml.value("spectrum", name, 0),
            Spectrum::Illuminant(illuminant) if illuminant.name.eq_ignore_ascii_case("D65") => {
                self.xml.open("spectrum", &[("type", "d65"), ("name", name)]);
                self.xml.value("float", "scale", illuminant.scale * by / DAYLIGHT);
                self.xml.close();
            }
            Spectrum::Blackbody(body) if by == 1.0 && Export::can_say(spectrum) => {
                self.xml.open("spectrum", &[("type", "blackbody"), ("name", name)]);
                self.xml.value("float", "temperature", body.kelvin);
                self.xml.close();
            }
            Spectrum::Scaled(scaled) => self.scaled_spectrum(name, &scaled.of, role, by * scaled.by),
            other => match sampled(other) {
                Some(curve) => self.curve(name, &curve, by),
                None => self.xml.value("spectrum", name, 0.5 * by),
            },
        }
    }

    /// The response of a band, zero beyond the ends of a table; a number is a table of the whole band.
    pub(super) fn band(&mut self, name: &str, response: &Spectrum) {
        let (by, inner) = unscaled(response);
        match inner {
            Spectrum::Number(value) => self.table(name, &BAND_NM.map(|nm| [nm, *value]), by, Ends::Zero),
            _ => self.scaled_spectrum(name, inner, Role::Emission, by),
        }
    }

    /// A curve at every fifth nanometre.
    pub(super) fn curve(&mut self, name: &str, curve: &Curve, by: f64) {
        self.samples(name, |nm| at(curve, nm) * by);
    }

    /// What a function is at every fifth nanometre; Mitsuba refuses a table of zeros.
    pub(super) fn samples(&mut self, name: &str, value: impl Fn(f64) -> f64) {
        let pairs: Vec<(u32, f64)> = (360..=830).step_by(5).map(|nm| (nm, value(f64::from(nm)))).collect();
        if pairs.iter().all(|(_, value)| *value == 0.0) {
            return self.xml.value("spectrum", name, 0);
        }
        let pairs: Vec<String> = pairs.iter().map(|(nm, value)| format!("{nm}:{value}")).collect();
        self.xml.value("spectrum", name, pairs.join(", "));
    }

    /// What Mitsuba gets in place of a light that it has no words for.
    pub(super) fn light_shortfall(spectrum: &Spectrum) -> Option<String> {
        match (Export::can_say(spectrum), sampled(unscaled(spectrum).1)) {
            (true, _) => None,
            (false, Some(_)) => Some("its spectrum at every fifth nanometre".to_owned()),
            (false, None) => Some("a grey light".to_owned()),
        }
    }

    /// Mitsuba's tables are zero beyond their ends, so what is held is written to the ends of the band. It refuses one of zeros.
    fn table(&mut self, name: &str, pairs: &[[f64; 2]], by: f64, ends: Ends) {
        if pairs.iter().all(|[_, value]| value * by == 0.0) {
            return self.xml.value("spectrum", name, 0);
        }
        let mut all = pairs.to_vec();
        if let (Ends::Held, Some(&first), Some(&last)) = (ends, pairs.first(), pairs.last()) {
            if first[0] > BAND_NM[0] {
                all.insert(0, [BAND_NM[0], first[1]]);
            }
            if last[0] < BAND_NM[1] {
                all.push([BAND_NM[1], last[1]]);
            }
        }
        let text: Vec<String> = all.iter().map(|[nm, value]| format!("{nm}:{}", value * by)).collect();
        self.xml.value("spectrum", name, text.join(", "));
    }

    /// A spectrum, or a reference to a texture.
    pub(super) fn spectrum_or_texture(&mut self, name: &str, value: &SpectrumOrTexture, role: Role) {
        match value {
            SpectrumOrTexture::Spectrum(spectrum) => self.spectrum(name, spectrum, role),
            SpectrumOrTexture::Texture(texture) => self.colours_of(name, texture),
        }
    }
}

/// A spectrum without the factors before it, and their product.
fn unscaled(spectrum: &Spectrum) -> (f64, &Spectrum) {
    match spectrum {
        Spectrum::Scaled(scaled) => {
            let (by, inner) = unscaled(&scaled.of);
            (by * scaled.by, inner)
        }
        other => (1.0, other),
    }
}

/// The curve of a colour times `by`, unless it is a reflectance as it stands, or light: half of the reflectance of a colour is
/// not that of half the colour.
fn colour_beyond(spectrum: &Spectrum, role: Role, by: f64) -> Option<Curve> {
    match spectrum {
        Spectrum::Rgb(rgb) if by != 1.0 || rgb.iter().any(|channel| *channel > 1.0) => {
            let curve = match role {
                Role::Reflectance => upsample::reflectance(*rgb),
                Role::Coefficient => upsample::unbounded(*rgb),
                Role::OpticalConstant => upsample::optical_constant(*rgb),
                Role::Emission => return None,
            };
            curve.ok().map(|curve| curve.scaled(by))
        }
        Spectrum::Scaled(scaled) => colour_beyond(&scaled.of, role, by * scaled.by),
        _ => None,
    }
}

/// Whether it is a colour, or a multiple of one.
pub(super) fn is_colour(spectrum: &Spectrum) -> bool {
    matches!(unscaled(spectrum).1, Spectrum::Rgb(_))
}

/// Whether Mitsuba has words for it as the response of a band, whose wavelengths have to end.
pub(super) fn can_be_band(spectrum: &Spectrum) -> bool {
    match spectrum {
        Spectrum::Rgb(_) | Spectrum::Blackbody(_) => false,
        Spectrum::Scaled(_) => Export::can_say(spectrum) && can_be_band(unscaled(spectrum).1),
        other => Export::can_say(other),
    }
}

/// Whether Mitsuba reads such a file of two columns: one between which are blanks.
fn reads(file: &Path) -> bool {
    ends_in(file, "spd")
}

/// A coefficient as a function of the wavelength, where it is numbers.
pub(super) fn curve_of(spectrum: &Spectrum) -> Option<Box<dyn Fn(f64) -> f64 + '_>> {
    match spectrum {
        Spectrum::Number(value) => Some(Box::new(|_| *value)),
        // Linear between samples, held beyond the ends.
        Spectrum::Table(pairs) => Some(Box::new(|nm| {
            let after = pairs.partition_point(|pair| pair[0] <= nm);
            match (after.checked_sub(1).and_then(|before| pairs.get(before)), pairs.get(after)) {
                (Some([x0, y0]), Some([x1, y1])) => y0 + (y1 - y0) * (nm - x0) / (x1 - x0),
                (Some(end), None) | (None, Some(end)) => end[1],
                (None, None) => 0.0,
            }
        })),
        Spectrum::Rgb(rgb) => {
            let curve = upsample::unbounded(*rgb).ok()?;
            Some(Box::new(move |nm| at(&curve, nm)))
        }
        Spectrum::Scaled(scaled) => {
            let inner = curve_of(&scaled.of)?;
            Some(Box::new(move |nm| inner(nm) * scaled.by))
        }
        _ => None,
    }
}

/// A light whose spectrum has a formula or a table of ours.
fn sampled(spectrum: &Spectrum) -> Option<Curve> {
    match spectrum {
        Spectrum::Blackbody(body) if body.normalised => illuminant::blackbody_normalised(body.kelvin).ok(),
        Spectrum::Blackbody(body) => illuminant::blackbody(body.kelvin).ok(),
        Spectrum::Illuminant(light) => illuminant::illuminant(&light.name).ok(),
        _ => None,
    }
    .map(|curve| match spectrum {
        Spectrum::Blackbody(body) => curve.scaled(body.scale),
        Spectrum::Illuminant(light) => curve.scaled(light.scale),
        _ => curve,
    })
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Ends {
    Held,
    Zero,
}
