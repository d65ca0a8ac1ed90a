//! A sheet without thickness.

use super::SmoothParts;
use super::lobes;
use crate::math::warp;
use crate::optics::bsdf::{BsdfSample, Evaluation, from_evaluation};
use crate::optics::fresnel::{self, Model};
use crate::optics::microfacet::Microfacets;
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A thin principled surface at one point; the same from both sides.
///
/// Light that crosses by the clear lobe is not bent: it leaves as if mirrored through the sheet, spread by
/// facets that are narrower the smaller the index is (Burley 2015, figure 15).
#[derive(Clone, Copy, Debug)]
pub struct PrincipledThin {
    /// The base colour, 0 to 1.
    pub base: Lanes,
    /// The base colour over its luminance: the hue of the tints.
    pub hue: Lanes,
    /// Index of the sheet over that around it.
    pub eta: f32,
    /// √α.
    pub roughness: f32,
    /// How much longer highlights are along x than along y.
    pub anisotropic: f32,
    /// From diffuse to clear.
    pub transmission: f32,
    /// Which share of the diffuse light crosses, 0 to 2: at 2, all.
    pub diffuse_transmission: f32,
    /// Tint of the reflection.
    pub specular_tint: f32,
    /// Strength of the sheen at grazing angles.
    pub sheen: f32,
    /// Its tint.
    pub sheen_tint: f32,
    /// From diffuse to the shape of subsurface scattering.
    pub flatness: f32,
    /// How often each lobe is sampled.
    pub rates: ThinRates,
}

/// Factors on how often each lobe is sampled; they change noise, not the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinRates {
    /// Reflection by microfacets.
    pub reflection: f32,
    /// Transmission by microfacets.
    pub transmission: f32,
    /// Diffuse reflection.
    pub diffuse_reflection: f32,
    /// Diffuse transmission.
    pub diffuse_transmission: f32,
}

impl Default for ThinRates {
    fn default() -> ThinRates {
        ThinRates { reflection: 1.0, transmission: 1.0, diffuse_reflection: 1.0, diffuse_transmission: 1.0 }
    }
}

/// The probabilities of the lobes; that of diffuse transmission is what is left.
struct Choice {
    reflection: f64,
    transmission: f64,
    diffuse_reflection: f64,
    diffuse_transmission: f64,
}

impl PrincipledThin {
    /// The share of diffuse light that crosses, 0 to 1.
    fn crossing(&self) -> f64 {
        0.5 * f64::from(self.diffuse_transmission)
    }

    fn facets(&self, transmitted: bool) -> Microfacets {
        let scale = if transmitted { 0.65 * f64::from(self.eta) - 0.35 } else { 1.0 };
        lobes::facets(scale * f64::from(self.roughness), f64::from(self.anisotropic))
    }

    /// `None` where nothing is sampled: all rates zero.
    fn choice(&self) -> Option<Choice> {
        let clear = f64::from(self.transmission);
        let rates = self.rates;
        let reflection = 0.5 * clear * f64::from(rates.reflection);
        let transmission = 0.5 * clear * f64::from(rates.transmission);
        let diffuse_reflection = (1.0 - clear) * (1.0 - self.crossing()) * f64::from(rates.diffuse_reflection);
        let diffuse_transmission = (1.0 - clear) * self.crossing() * f64::from(rates.diffuse_transmission);
        let total = reflection + transmission + diffuse_reflection + diffuse_transmission;
        (total > 0.0).then(|| Choice {
            reflection: reflection / total,
            transmission: transmission / total,
            diffuse_reflection: diffuse_reflection / total,
            diffuse_transmission: diffuse_transmission / total,
        })
    }

    /// Reflectance of facets met at the cosine `cos`, and the share that they transmit.
    fn reflectance(&self, cos: f64) -> (Lanes, f64) {
        let eta = f64::from(self.eta);
        let split = fresnel::dielectric(Model::Exact, cos, eta);
        let mut sum = Lanes::splat((1.0 - self.specular_tint) * split.reflected as f32);
        if self.specular_tint > 0.0 {
            let r0 = self.hue * lobes::r0(eta) as f32;
            sum += lobes::toward_one(r0, lobes::schlick_outside(cos, eta)) * self.specular_tint;
        }
        (sum, split.transmitted)
    }

    /// What a tracer of single rays shows of it, met at the cosine `cos` > 0: all facets smooth, without sheen.
    #[must_use]
    pub fn smooth(&self, cos: f64) -> SmoothParts {
        let (reflected, transmitted) = self.reflectance(cos);
        let (clear, crossing) = (self.transmission, self.crossing() as f32);
        SmoothParts {
            matte: self.base * ((1.0 - clear) * (1.0 - crossing)),
            translucent: self.base * ((1.0 - clear) * crossing),
            reflected: reflected * clear,
            transmitted: self.base * (clear * transmitted as f32),
        }
    }

    /// The part of f that the diffuse lobe gives, of directions on one side.
    pub(crate) fn diffuse_part(&self, wo: DVec3, wi: DVec3) -> Lanes {
        let (wo, wi) = (wo * wo.z.signum(), wi * wo.z.signum());
        let back = (1.0 - f64::from(self.transmission)) * (1.0 - self.crossing());
        if wi.z <= 0.0 || wo.z <= 0.0 || back <= 0.0 {
            return Lanes::ZERO;
        }
        self.diffuse(back, wo, wi, wo.dot((wo + wi).normalize()))
    }

    #[inline]
    fn diffuse(&self, back: f64, wo: DVec3, wi: DVec3, cos_i: f64) -> Lanes {
        let (roughness, flatness) = (f64::from(self.roughness), f64::from(self.flatness));
        self.base * (back / PI * lobes::diffusion(roughness, flatness, wo.z, wi.z, cos_i)) as f32
    }

    pub(crate) fn eval(&self, wo: DVec3, wi: DVec3) -> Evaluation {
        if wo.z == 0.0 || wi.z == 0.0 {
            return Evaluation::NONE;
        }
        // Seen from the back, all is turned over.
        let (wo, wi) = (wo * wo.z.signum(), wi * wo.z.signum());
        let Some(choice) = self.choice() else { return Evaluation::NONE };
        let reflect = wi.z > 0.0;
        let mirrored = DVec3::new(wi.x, wi.y, wi.z.abs());
        let m = (wo + mirrored).normalize();
        let (cos_o, cos_i) = (wo.dot(m), mirrored.dot(m));
        let clear = f64::from(self.transmission);
        let mut f = Lanes::ZERO;
        let mut pdf = 0.0;

        // A convention of Mitsuba 3: the facet must see the two directions from its two sides, although the
        // light that crosses was mirrored by it and then through the sheet. What is lost by that near grazing
        // angles is lost one way only, so crossing light is not quite reciprocal.
        if clear > 0.0 && (wi.dot(m) > 0.0) == reflect && wi.dot(m) != 0.0 {
            let facets = self.facets(!reflect);
            let seen = facets.density(m) * facets.masking(wo, m);
            let geometry = clear * seen * facets.masking(wi, m) / (4.0 * wo.z * wi.z.abs());
            let (reflectance, transmittance) = self.reflectance(cos_o);
            let pdf_i = seen * cos_o / wo.z / (4.0 * cos_i);
            if reflect {
                f += reflectance * geometry as f32;
                pdf += choice.reflection * pdf_i;
            } else {
                f += self.base * (transmittance * geometry) as f32;
                pdf += choice.transmission * pdf_i;
            }
        }
        let matte = 1.0 - clear;
        if reflect {
            let back = matte * (1.0 - self.crossing());
            if back > 0.0 {
                f += self.diffuse(back, wo, wi, cos_i);
                if self.sheen > 0.0 {
                    let strength = self.sheen * (back * lobes::schlick_weight(cos_i)) as f32;
                    f += (Lanes::ONE + (self.hue - Lanes::ONE) * self.sheen_tint) * strength;
                }
            }
            pdf += choice.diffuse_reflection * wi.z / PI;
        } else {
            f += self.base * (matte * self.crossing() / PI) as f32;
            pdf += choice.diffuse_transmission * -wi.z / PI;
        }
        Evaluation { f, pdf: Lanes::splat(pdf as f32) }
    }

    pub(crate) fn sample(&self, wo: DVec3, u_lobe: f64, u: DVec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let choice = self.choice()?;
        let side = wo.z.signum();
        let up = wo * side;
        // By a facet, then through the sheet where the light is to cross; `None` where the facet would see
        // either direction from its wrong side.
        let by_facet = |transmitted: bool| {
            let m = self.facets(transmitted).sample(up, u);
            let wi = (m * (2.0 * up.dot(m)) - up) * DVec3::new(1.0, 1.0, if transmitted { -1.0 } else { 1.0 });
            ((wi.dot(m) < 0.0) == transmitted).then_some(wi)
        };
        let mut left = u_lobe - choice.reflection;
        let (wi, transmitted) = if left < 0.0 {
            (by_facet(false)?, false)
        } else {
            left -= choice.transmission;
            if left < 0.0 {
                (by_facet(true)?, true)
            } else if left < choice.diffuse_reflection {
                (warp::cosine_hemisphere(u), false)
            } else {
                (-warp::cosine_hemisphere(u), true)
            }
        };
        if (wi.z > 0.0) == transmitted {
            return None;
        }
        let wi = wi * side;
        from_evaluation(wi, wi.z.abs(), self.eval(wo, wi), transmitted, 1.0)
    }
}
