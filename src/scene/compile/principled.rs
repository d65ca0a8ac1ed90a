//! Principled surfaces, from what a person wrote.

use super::Compiler;
use crate::description as written;
use crate::optics::principled::{Rates, ThinRates, index_of_eta, index_of_specular};
use crate::scene::principled::{Luminance, Solid, Thin};
use crate::scene::texture::{Scalar, Texture};

impl<'a> Compiler<'a> {
    pub(super) fn principled(&mut self, place: &str, m: &'a written::Principled) -> Solid {
        let base = self.reflectance_texture(&format!("{place}.base_color"), &m.base_color);
        let transmission = m.spec_trans.as_ref().map(|s| self.scalar(s));
        let specular_tint = self.scalar(&m.spec_tint);
        let sheen_tint = self.scalar(&m.sheen_tint);
        Solid {
            luminance: luminance(m.luminance, &base, [&specular_tint, &sheen_tint]),
            base,
            eta: match m.contrast {
                written::Contrast::Eta(eta) => index_of_eta(eta, transmission.is_some()),
                written::Contrast::Specular(specular) => index_of_specular(specular, transmission.is_some()),
            },
            roughness: self.scalar(&m.roughness),
            anisotropic: self.scalar(&m.anisotropic),
            metallic: self.scalar(&m.metallic),
            transmission,
            specular_tint,
            sheen: self.scalar(&m.sheen),
            sheen_tint,
            flatness: self.scalar(&m.flatness),
            clearcoat: self.scalar(&m.clearcoat),
            clearcoat_gloss: self.scalar(&m.clearcoat_gloss),
            rates: Rates {
                specular: m.sampling.specular as f32,
                clearcoat: m.sampling.clearcoat as f32,
                diffuse: m.sampling.diffuse as f32,
            },
        }
    }

    pub(super) fn principled_thin(&mut self, place: &str, m: &'a written::PrincipledThin) -> Thin {
        let base = self.reflectance_texture(&format!("{place}.base_color"), &m.base_color);
        let specular_tint = self.scalar(&m.spec_tint);
        let sheen_tint = self.scalar(&m.sheen_tint);
        Thin {
            luminance: luminance(m.luminance, &base, [&specular_tint, &sheen_tint]),
            base,
            eta: self.scalar(&m.eta),
            roughness: self.scalar(&m.roughness),
            anisotropic: self.scalar(&m.anisotropic),
            transmission: self.scalar(&m.spec_trans),
            diffuse_transmission: self.scalar(&m.diff_trans),
            specular_tint,
            sheen: self.scalar(&m.sheen),
            sheen_tint,
            flatness: self.scalar(&m.flatness),
            rates: ThinRates {
                reflection: m.sampling.reflection as f32,
                transmission: m.sampling.transmission as f32,
                diffuse_reflection: m.sampling.diffuse_reflection as f32,
                diffuse_transmission: m.sampling.diffuse_transmission as f32,
            },
        }
    }
}

/// The luminance that tints need, if there are any.
fn luminance(written: written::Luminance, base: &Texture, tints: [&Scalar; 2]) -> Luminance {
    if tints.iter().all(|tint| matches!(tint, Scalar::Uniform(0.0))) {
        return Luminance::Unused;
    }
    match written {
        written::Luminance::Colour => Luminance::of(base),
        written::Luminance::Mitsuba => Luminance::Packet,
    }
}
