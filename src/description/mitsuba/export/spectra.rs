//! Spectra and textures in the place of one.

use super::super::super::spectrum::{Spectrum, SpectrumOrTexture};
use super::xml::numbers;
use super::{DAYLIGHT, Export};
use crate::spectrum::{BAND_NM, Lanes, Spectrum as Curve, illuminant};

/// What a spectrum is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    /// Held beyond the ends of a table.
    Reflectance,
    /// η, k, σ: held beyond the ends.
    Coefficient,
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
            Spectrum::Scaled(scaled) => match &*scaled.of {
                Spectrum::Illuminant(_) | Spectrum::Rgb(_) | Spectrum::Number(_) | Spectrum::Table(_) => {
                    Export::can_say(&scaled.of)
                }
                _ => false,
            },
            Spectrum::ZeroOutside(inner) => matches!(**inner, Spectrum::Table(_)),
            _ => false,
        }
    }

    /// Whether Mitsuba has words for it in this role: colours of coefficients are upsampled otherwise.
    pub(super) fn can_say_all(spectra: &[(&Spectrum, Role)]) -> bool {
        spectra.iter().all(|(spectrum, _)| Export::can_say(spectrum))
    }

    /// A `<spectrum>` or `<rgb>`; what Mitsuba cannot say is grey of one half.
    pub(super) fn spectrum(&mut self, name: &str, spectrum: &Spectrum, role: Role) {
        self.scaled_spectrum(name, spectrum, role, 1.0);
    }

    fn scaled_spectrum(&mut self, name: &str, spectrum: &Spectrum, role: Role, by: f64) {
        match spectrum {
            Spectrum::Number(value) => self.xml.value("spectrum", name, value * by),
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
                _ => self.xml.value("spectrum", name, 0.5 * by),
            },
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

    /// A curve at every fifth nanometre.
    pub(super) fn curve(&mut self, name: &str, curve: &Curve, by: f64) {
        let value = |nm: u32| f64::from(curve.eval(Lanes::splat(nm as f32)).to_array()[0]) * by;
        let pairs: Vec<String> = (360..=830).step_by(5).map(|nm| format!("{nm}:{}", value(nm))).collect();
        self.xml.value("spectrum", name, pairs.join(", "));
    }

    /// What Mitsuba gets in place of a light that it has no words for.
    pub(super) fn light_shortfall(spectrum: &Spectrum) -> Option<&'static str> {
        let inner = match spectrum {
            Spectrum::Scaled(scaled) => &scaled.of,
            other => other,
        };
        match (Export::can_say(spectrum), sampled(inner)) {
            (true, _) => None,
            (false, Some(_)) => Some("its spectrum at every fifth nanometre"),
            (false, None) => Some("a grey light"),
        }
    }

    /// Mitsuba's tables are zero beyond their ends, so what is held is written to the ends of the band.
    fn table(&mut self, name: &str, pairs: &[[f64; 2]], by: f64, ends: Ends) {
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
            SpectrumOrTexture::Texture(texture) => self.texture_ref(name, texture),
        }
    }

    pub(super) fn texture_ref(&mut self, name: &str, texture: &str) {
        let id = self.id(texture, "texture");
        self.xml.leaf("ref", &[("name", name), ("id", &id)]);
    }

    pub(super) fn can_say_either(value: &SpectrumOrTexture) -> bool {
        match value {
            SpectrumOrTexture::Spectrum(spectrum) => Export::can_say(spectrum),
            SpectrumOrTexture::Texture(_) => true,
        }
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
