//! Principled surfaces over a surface: their numbers and colours may follow textures.

use super::texture::{Scalar, Texture, TexturePoint};
use crate::optics::principled::{Principled, PrincipledThin, Rates, ThinRates};
use crate::spectrum::{Lanes, Spectrum, illuminant, luminance};

/// What the base colour is divided by for a tint.
#[derive(Clone, Debug)]
pub enum Luminance {
    /// Nothing is tinted.
    Unused,
    /// Its luminance under D65, the same everywhere.
    Uniform(f32),
    /// Its luminance under D65, point by point.
    Textured,
    /// What Mitsuba 3 takes for it in spectral modes ([`luminance::of_packet`]).
    Packet,
}

impl Luminance {
    /// For tints with the hue of `base`, by its luminance under D65.
    #[must_use]
    pub fn of(base: &Texture) -> Luminance {
        match base {
            Texture::Uniform(spectrum) => Luminance::Uniform(under_d65(spectrum)),
            _ => Luminance::Textured,
        }
    }

    /// `base` over its luminance; one for black.
    fn hue(&self, base: Lanes, texture: &Texture, at: &TexturePoint, nm: Lanes) -> Lanes {
        let luminance = match self {
            Luminance::Unused => return Lanes::ONE,
            Luminance::Uniform(y) => Lanes::splat(*y),
            Luminance::Textured => Lanes::splat(luminance::under_d65(|nm| texture.eval(at, nm))),
            Luminance::Packet => luminance::of_packet(nm, |nm| texture.eval(at, nm)),
        };
        luminance.simd_gt(Lanes::ZERO).select(base / luminance, Lanes::ONE)
    }
}

/// Y under D65, one for white; exact for tables as well.
fn under_d65(spectrum: &Spectrum) -> f32 {
    spectrum.times(&illuminant::d65()).luminance() as f32
}

/// [`Principled`] over a surface.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Base colour.
    pub base: Texture,
    /// Of the base colour.
    pub luminance: Luminance,
    /// Index inside over outside.
    pub eta: f64,
    /// √α.
    pub roughness: Scalar,
    /// See [`Principled::anisotropic`].
    pub anisotropic: Scalar,
    /// See [`Principled::metallic`].
    pub metallic: Scalar,
    /// See [`Principled::transmission`]; `None` where nothing is transmitted.
    pub transmission: Option<Scalar>,
    /// See [`Principled::specular_tint`].
    pub specular_tint: Scalar,
    /// See [`Principled::sheen`].
    pub sheen: Scalar,
    /// See [`Principled::sheen_tint`].
    pub sheen_tint: Scalar,
    /// See [`Principled::flatness`].
    pub flatness: Scalar,
    /// See [`Principled::clearcoat`].
    pub clearcoat: Scalar,
    /// See [`Principled::clearcoat_gloss`].
    pub clearcoat_gloss: Scalar,
    /// How often each lobe is sampled.
    pub rates: Rates,
}

/// A share from 0 to 1. Textures beyond are refused: what is cut is the rounding of what lies between their numbers.
fn share(s: &Scalar, at: &TexturePoint) -> f32 {
    s.eval(at).clamp(0.0, 1.0) as f32
}

/// A number of zero or more, likewise.
fn strength(s: &Scalar, at: &TexturePoint) -> f32 {
    s.eval(at).max(0.0) as f32
}

impl Solid {
    /// The scattering function at a point.
    #[must_use]
    pub fn at(&self, at: &TexturePoint, nm: Lanes) -> Principled {
        let base = self.base.eval(at, nm);
        Principled {
            base,
            hue: self.luminance.hue(base, &self.base, at, nm),
            eta: self.eta as f32,
            roughness: share(&self.roughness, at),
            anisotropic: share(&self.anisotropic, at),
            metallic: share(&self.metallic, at),
            transmission: self.transmission.as_ref().map_or(0.0, |s| share(s, at)),
            specular_tint: share(&self.specular_tint, at),
            sheen: strength(&self.sheen, at),
            sheen_tint: share(&self.sheen_tint, at),
            flatness: share(&self.flatness, at),
            clearcoat: strength(&self.clearcoat, at),
            clearcoat_gloss: share(&self.clearcoat_gloss, at),
            rates: self.rates,
        }
    }

    /// True where anything varies over the surface.
    #[must_use]
    pub fn varies(&self) -> bool {
        let numbers = [
            &self.roughness,
            &self.anisotropic,
            &self.metallic,
            &self.specular_tint,
            &self.sheen,
            &self.sheen_tint,
            &self.flatness,
            &self.clearcoat,
            &self.clearcoat_gloss,
        ];
        self.base.varies()
            || self.transmission.as_ref().is_some_and(Scalar::varies)
            || numbers.into_iter().any(Scalar::varies)
    }
}

/// [`PrincipledThin`] over a surface.
#[derive(Clone, Debug)]
pub struct Thin {
    /// Base colour.
    pub base: Texture,
    /// Of the base colour.
    pub luminance: Luminance,
    /// See [`PrincipledThin::eta`].
    pub eta: Scalar,
    /// √α.
    pub roughness: Scalar,
    /// See [`PrincipledThin::anisotropic`].
    pub anisotropic: Scalar,
    /// See [`PrincipledThin::transmission`].
    pub transmission: Scalar,
    /// See [`PrincipledThin::diffuse_transmission`].
    pub diffuse_transmission: Scalar,
    /// See [`PrincipledThin::specular_tint`].
    pub specular_tint: Scalar,
    /// See [`PrincipledThin::sheen`].
    pub sheen: Scalar,
    /// See [`PrincipledThin::sheen_tint`].
    pub sheen_tint: Scalar,
    /// See [`PrincipledThin::flatness`].
    pub flatness: Scalar,
    /// How often each lobe is sampled.
    pub rates: ThinRates,
}

impl Thin {
    /// The scattering function at a point.
    #[must_use]
    pub fn at(&self, at: &TexturePoint, nm: Lanes) -> PrincipledThin {
        let base = self.base.eval(at, nm);
        PrincipledThin {
            base,
            hue: self.luminance.hue(base, &self.base, at, nm),
            eta: self.eta.eval(at) as f32,
            roughness: share(&self.roughness, at),
            anisotropic: share(&self.anisotropic, at),
            transmission: share(&self.transmission, at),
            diffuse_transmission: self.diffuse_transmission.eval(at).clamp(0.0, 2.0) as f32,
            specular_tint: share(&self.specular_tint, at),
            sheen: strength(&self.sheen, at),
            sheen_tint: share(&self.sheen_tint, at),
            flatness: share(&self.flatness, at),
            rates: self.rates,
        }
    }

    /// True where anything varies over the surface.
    #[must_use]
    pub fn varies(&self) -> bool {
        let numbers = [
            &self.eta,
            &self.roughness,
            &self.anisotropic,
            &self.transmission,
            &self.diffuse_transmission,
            &self.specular_tint,
            &self.sheen,
            &self.sheen_tint,
            &self.flatness,
        ];
        self.base.varies() || numbers.into_iter().any(Scalar::varies)
    }
}
