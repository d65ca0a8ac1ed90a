//! Burley's principled surfaces as they are written.

use serde::Deserialize;

use super::compound::NumberOrTexture;
use super::fault::Checker;
use super::path::At;
use super::spectrum::{Role, Spectrum, SpectrumOrTexture};
use crate::error::in_short;

/// `principled: {base_color: SPECTRUM_OR_TEXTURE, roughness: 0.5, metallic: 0, …}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenPrincipled")]
pub struct Principled {
    /// The colour of the diffuse lobe, the metal and the body; default 0.5.
    pub base_color: SpectrumOrTexture,
    /// √α of the facets, 0 to 1; default 0.5.
    pub roughness: NumberOrTexture,
    /// 0 to 1; default 0.
    pub anisotropic: NumberOrTexture,
    /// From dielectric to metal, 0 to 1; default 0.
    pub metallic: NumberOrTexture,
    /// From diffuse to clear, 0 to 1; default none.
    pub spec_trans: Option<NumberOrTexture>,
    /// Contrast of the interface; default a `specular` of 0.5.
    pub contrast: Contrast,
    /// Share of the dielectric reflection that is tinted, 0 to 1; default 0.
    pub spec_tint: NumberOrTexture,
    /// 0 to 10; default 0.
    pub sheen: NumberOrTexture,
    /// Share of it that is tinted, 0 to 1; default 0.
    pub sheen_tint: NumberOrTexture,
    /// From diffuse to the shape of subsurface scattering, 0 to 1; default 0.
    pub flatness: NumberOrTexture,
    /// 0 to 10; default 0.
    pub clearcoat: NumberOrTexture,
    /// 0 to 1; default 0.
    pub clearcoat_gloss: NumberOrTexture,
    /// What the base colour is divided by for a tint; default `colour`.
    pub luminance: Luminance,
    /// How often the lobes are sampled.
    pub sampling: Sampling,
    /// Whether the back reflects like the front; default where nothing is transmitted.
    pub two_sided: bool,
}

/// Contrast of an interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contrast {
    /// Index inside over outside.
    Eta(f64),
    /// 0 to 1 for a reflectance of 0 to 0.08 along the normal.
    Specular(f64),
}

/// What a base colour is divided by for a tint, which is to keep its hue alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Luminance {
    /// Its luminance under D65.
    #[default]
    Colour,
    /// What Mitsuba 3 takes for it in spectral modes: its tints are about 2.6 times as bright.
    Mitsuba,
}

/// Factors from the least to the most on how often a lobe is sampled: beyond, the others would in effect not be.
const RATES: [f64; 2] = [1e-6, 1e6];

/// The strongest sheen and clearcoat, which add to the light that comes back; as they are meant, they go up to 1.
pub const MOST_STRENGTH: f64 = 10.0;

/// Of the diffuse light of a sheet, all.
pub const MOST_CROSSING: f64 = 2.0;

/// Factors on how often the lobes of a [`Principled`] are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sampling {
    /// Main facets; default 1, more than 0.
    pub specular: f64,
    /// Clear coat; default 1. Where it is 0 the main facets find what the coat scatters.
    pub clearcoat: f64,
    /// Default 1. Where it is 0 the main facets find what is diffuse.
    pub diffuse: f64,
}

impl Default for Sampling {
    fn default() -> Sampling {
        Sampling { specular: 1.0, clearcoat: 1.0, diffuse: 1.0 }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenPrincipled {
    #[serde(default = "half_colour")]
    base_color: SpectrumOrTexture,
    #[serde(default = "half")]
    roughness: NumberOrTexture,
    #[serde(default = "zero")]
    anisotropic: NumberOrTexture,
    #[serde(default = "zero")]
    metallic: NumberOrTexture,
    spec_trans: Option<NumberOrTexture>,
    eta: Option<f64>,
    specular: Option<f64>,
    #[serde(default = "zero")]
    spec_tint: NumberOrTexture,
    #[serde(default = "zero")]
    sheen: NumberOrTexture,
    #[serde(default = "zero")]
    sheen_tint: NumberOrTexture,
    #[serde(default = "zero")]
    flatness: NumberOrTexture,
    #[serde(default = "zero")]
    clearcoat: NumberOrTexture,
    #[serde(default = "zero")]
    clearcoat_gloss: NumberOrTexture,
    #[serde(default)]
    luminance: Luminance,
    #[serde(default)]
    sampling: Sampling,
    two_sided: Option<bool>,
}

impl TryFrom<WrittenPrincipled> for Principled {
    type Error = String;

    fn try_from(w: WrittenPrincipled) -> Result<Principled, String> {
        let contrast = match (w.eta, w.specular) {
            (Some(_), Some(_)) => return Err("expected either eta or specular, found both".to_owned()),
            (Some(eta), None) => Contrast::Eta(eta),
            (None, specular) => Contrast::Specular(specular.unwrap_or(0.5)),
        };
        // A surface with `spec_trans: 0` is one without.
        let spec_trans = w.spec_trans.filter(|t| *t != zero());
        if spec_trans.is_some() && w.two_sided == Some(true) {
            return Err("expected two_sided: false with spec_trans, found true".to_owned());
        }
        Ok(Principled {
            base_color: w.base_color,
            roughness: w.roughness,
            anisotropic: w.anisotropic,
            metallic: w.metallic,
            two_sided: w.two_sided.unwrap_or(spec_trans.is_none()),
            spec_trans,
            contrast,
            spec_tint: w.spec_tint,
            sheen: w.sheen,
            sheen_tint: w.sheen_tint,
            flatness: w.flatness,
            clearcoat: w.clearcoat,
            clearcoat_gloss: w.clearcoat_gloss,
            luminance: w.luminance,
            sampling: w.sampling,
        })
    }
}

/// `principled_thin: {base_color: SPECTRUM_OR_TEXTURE, roughness: 0.5, diff_trans: 0, …}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrincipledThin {
    /// The colour of the diffuse lobes and of what is transmitted; default 0.5.
    #[serde(default = "half_colour")]
    pub base_color: SpectrumOrTexture,
    /// √α of the facets, 0 to 1; default 0.5.
    #[serde(default = "half")]
    pub roughness: NumberOrTexture,
    /// 0 to 1; default 0.
    #[serde(default = "zero")]
    pub anisotropic: NumberOrTexture,
    /// From diffuse to clear, 0 to 1; default 0.
    #[serde(default = "zero")]
    pub spec_trans: NumberOrTexture,
    /// How much of the diffuse light crosses the sheet, 0 to 2: all; default 0.
    #[serde(default = "zero")]
    pub diff_trans: NumberOrTexture,
    /// Index of the sheet over that around it; default 1.5.
    #[serde(default = "index")]
    pub eta: NumberOrTexture,
    /// Share of the reflection that is tinted, 0 to 1; default 0.
    #[serde(default = "zero")]
    pub spec_tint: NumberOrTexture,
    /// 0 to 10; default 0.
    #[serde(default = "zero")]
    pub sheen: NumberOrTexture,
    /// Share of it that is tinted, 0 to 1; default 0.
    #[serde(default = "zero")]
    pub sheen_tint: NumberOrTexture,
    /// From diffuse to the shape of subsurface scattering, 0 to 1; default 0.
    #[serde(default = "zero")]
    pub flatness: NumberOrTexture,
    /// What the base colour is divided by for a tint; default `colour`.
    #[serde(default)]
    pub luminance: Luminance,
    /// How often the lobes are sampled.
    #[serde(default)]
    pub sampling: ThinSampling,
}

/// Factors on how often the lobes of a [`PrincipledThin`] are sampled; 0 only for a lobe that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThinSampling {
    /// Facets that reflect; default 1.
    pub reflection: f64,
    /// Facets that transmit; default 1.
    pub transmission: f64,
    /// Default 1.
    pub diffuse_reflection: f64,
    /// Default 1.
    pub diffuse_transmission: f64,
}

impl Default for ThinSampling {
    fn default() -> ThinSampling {
        ThinSampling { reflection: 1.0, transmission: 1.0, diffuse_reflection: 1.0, diffuse_transmission: 1.0 }
    }
}

fn half_colour() -> SpectrumOrTexture {
    SpectrumOrTexture::Spectrum(Spectrum::Number(0.5))
}

fn half() -> NumberOrTexture {
    NumberOrTexture::Number(0.5)
}

fn zero() -> NumberOrTexture {
    NumberOrTexture::Number(0.0)
}

fn index() -> NumberOrTexture {
    NumberOrTexture::Number(1.5)
}

impl Principled {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        self.base_color.check(Role::Reflectance, at.key("base_color"), checker);
        let shares = [
            ("roughness", Some(&self.roughness)),
            ("anisotropic", Some(&self.anisotropic)),
            ("metallic", Some(&self.metallic)),
            ("spec_trans", self.spec_trans.as_ref()),
            ("spec_tint", Some(&self.spec_tint)),
            ("sheen_tint", Some(&self.sheen_tint)),
            ("flatness", Some(&self.flatness)),
            ("clearcoat_gloss", Some(&self.clearcoat_gloss)),
        ];
        for (key, share) in shares {
            if let Some(share) = share {
                share.check(1.0, at.key(key), checker);
            }
        }
        for (key, strength) in [("sheen", &self.sheen), ("clearcoat", &self.clearcoat)] {
            strength.check(MOST_STRENGTH, at.key(key), checker);
        }
        match self.contrast {
            Contrast::Eta(eta) => checker.index(at.key("eta"), eta),
            Contrast::Specular(s) => {
                checker.require((0.0..=1.0).contains(&s), at.key("specular"), "a number from 0 to 1", s);
            }
        }
        let at = at.key("sampling");
        let Sampling { specular, clearcoat, diffuse } = self.sampling;
        check_rate(at.key("specular"), specular, Lobe::Needed, checker);
        check_rate(at.key("clearcoat"), clearcoat, Lobe::Spared, checker);
        check_rate(at.key("diffuse"), diffuse, Lobe::Spared, checker);
    }
}

impl PrincipledThin {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        self.base_color.check(Role::Reflectance, at.key("base_color"), checker);
        let ranges = [
            ("roughness", &self.roughness, 1.0),
            ("anisotropic", &self.anisotropic, 1.0),
            ("spec_trans", &self.spec_trans, 1.0),
            ("diff_trans", &self.diff_trans, MOST_CROSSING),
            ("spec_tint", &self.spec_tint, 1.0),
            ("sheen", &self.sheen, MOST_STRENGTH),
            ("sheen_tint", &self.sheen_tint, 1.0),
            ("flatness", &self.flatness, 1.0),
        ];
        for (key, number, most) in ranges {
            number.check(most, at.key(key), checker);
        }
        match self.eta {
            NumberOrTexture::Number(eta) => checker.index(at.key("eta"), eta),
            NumberOrTexture::Texture(_) => self.eta.check(f64::INFINITY, at.key("eta"), checker),
        }
        let at = at.key("sampling");
        let ThinSampling { reflection, transmission, diffuse_reflection, diffuse_transmission } = self.sampling;
        let is = |number: &NumberOrTexture, x: f64| *number == NumberOrTexture::Number(x);
        let clear = is(&self.spec_trans, 1.0);
        for (key, rate, absent) in [
            ("reflection", reflection, is(&self.spec_trans, 0.0)),
            ("transmission", transmission, is(&self.spec_trans, 0.0)),
            ("diffuse_reflection", diffuse_reflection, clear || is(&self.diff_trans, 2.0)),
            ("diffuse_transmission", diffuse_transmission, clear || is(&self.diff_trans, 0.0)),
        ] {
            check_rate(at.key(key), rate, if absent { Lobe::Spared } else { Lobe::Needed }, checker);
        }
    }
}

/// Whether anything else samples what a lobe scatters.
#[derive(Clone, Copy, PartialEq)]
enum Lobe {
    /// Nothing: without it light is lost.
    Needed,
    /// Something, or there is no such light.
    Spared,
}

fn check_rate(at: At<'_>, rate: f64, lobe: Lobe, checker: &mut Checker<'_>) {
    let [least, most] = RATES;
    let holds = (least..=most).contains(&rate) || lobe == Lobe::Spared && rate == 0.0;
    let or_zero = if lobe == Lobe::Spared { "0, or " } else { "" };
    checker.require(holds, at, &format!("{or_zero}a number from {} to {}", in_short(least), in_short(most)), rate);
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::super::{Contrast, Material, NumberOrTexture};

    fn material(text: &str) -> Material {
        scene(&format!("materials:\n  m: {{{text}}}\n")).materials.remove("m").unwrap()
    }

    #[test]
    fn defaults_are_those_of_the_reference() {
        let Material::Principled(m) = material("principled: {}") else { panic!("principled") };
        assert_eq!(m.contrast, Contrast::Specular(0.5));
        assert_eq!((m.roughness, m.spec_trans, m.two_sided), (NumberOrTexture::Number(0.5), None, true));
        let Material::Principled(m) = material("principled: {spec_trans: 0.5, eta: 1.3}") else { panic!("principled") };
        assert_eq!((m.contrast, m.two_sided), (Contrast::Eta(1.3), false));
        let Material::Principled(m) = material("principled: {spec_trans: 0}") else { panic!("principled") };
        assert_eq!((m.spec_trans, m.two_sided), (None, true));
        let Material::PrincipledThin(m) = material("principled_thin: {}") else { panic!("principled_thin") };
        assert_eq!(m.eta, NumberOrTexture::Number(1.5));
    }

    #[test]
    fn what_does_not_go_together_is_refused() {
        for (text, message) in [
            (
                "{eta: 1.5, specular: 0.5}",
                "dir/s.yaml:3:19: materials.m.principled: expected either eta or specular, found both",
            ),
            (
                "{spec_trans: 1, two_sided: true}",
                "dir/s.yaml:3:19: materials.m.principled: expected two_sided: false with spec_trans, found true",
            ),
            (
                "{eta: 0}",
                "dir/s.yaml:3:25: materials.m.principled.eta: expected an index of refraction, a number from 0.1 to 10, found 0",
            ),
            (
                "{sheen: 1.0e38, clearcoat: 1.0e30}",
                "dir/s.yaml:3:27: materials.m.principled.sheen: expected a number from 0 to 10, found 1e38\n\
                 dir/s.yaml:3:46: materials.m.principled.clearcoat: expected a number from 0 to 10, found 1e30",
            ),
            (
                "{metallic: 2}",
                "dir/s.yaml:3:30: materials.m.principled.metallic: expected a number from 0 to 1, found 2",
            ),
            (
                "{sampling: {diffuse: -1}}",
                "dir/s.yaml:3:40: materials.m.principled.sampling.diffuse: expected 0, or a number from 1e-6 to 1000000, \
                 found -1",
            ),
            (
                "{sampling: {specular: 0, clearcoat: 0, diffuse: 1e300}}",
                "dir/s.yaml:3:41: materials.m.principled.sampling.specular: expected a number from 1e-6 to 1000000, found 0\n\
                 dir/s.yaml:3:67: materials.m.principled.sampling.diffuse: expected 0, or a number from 1e-6 to 1000000, \
                 found 1e300",
            ),
            (
                "{roughness: 2}",
                "dir/s.yaml:3:31: materials.m.principled.roughness: expected a number from 0 to 1, found 2",
            ),
        ] {
            assert_eq!(faults(&format!("materials:\n  m: {{principled: {text}}}")), message);
        }
        assert_eq!(
            faults("materials:\n  m: {principled_thin: {diff_trans: 3, spec_trans: {texture: no}}}"),
            "dir/s.yaml:3:37: materials.m.principled_thin.diff_trans: expected a number from 0 to 2, found 3\n\
             dir/s.yaml:3:62: materials.m.principled_thin.spec_trans.texture: unknown texture \"no\"; the scene defines none"
        );
    }

    /// A sheet's lobes do not reach where the others do; a rate of 0 is right for one that is not there.
    #[test]
    fn a_lobe_of_a_sheet_that_nothing_samples_is_refused() {
        let refused = |fields: &str| {
            let faults = faults(&format!("materials:\n  m: {{principled_thin: {{{fields}}}}}"));
            faults.matches(".sampling.").count()
        };
        let none = "sampling: {reflection: 0, transmission: 0, diffuse_reflection: 0, diffuse_transmission: 0}";
        assert_eq!(refused(none), 1);
        for (lobes, count) in
            [("spec_trans: 1", 2), ("spec_trans: 0.5", 3), ("diff_trans: 2", 1), ("spec_trans: 0.5, diff_trans: 1", 4)]
        {
            assert_eq!(refused(&format!("{lobes}, {none}")), count, "{lobes}");
        }
        assert_eq!(refused("sampling: {reflection: 0, transmission: 0, diffuse_transmission: 0}"), 0);
    }
}
