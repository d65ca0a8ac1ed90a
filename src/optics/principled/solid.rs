//! The boundary of a solid.

use super::SmoothParts;
use super::lobes::{self, CoatFacets};
use crate::math::warp;
use crate::optics::bsdf::{BsdfSample, Evaluation, from_evaluation};
use crate::optics::dielectric::refract;
use crate::optics::fresnel::{self, Model, Split};
use crate::optics::microfacet::{Microfacets, Terms};
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A principled surface at one point.
///
/// Light that comes from the front meets all lobes; from the back only the microfacets, and nothing at all
/// where nothing is transmitted.
#[derive(Clone, Copy, Debug)]
pub struct Principled {
    /// The base colour, 0 to 1.
    pub base: Lanes,
    /// The base colour over its luminance: the hue of the tints.
    pub hue: Lanes,
    /// Index inside over outside.
    pub eta: f32,
    /// √α.
    pub roughness: f32,
    /// How much longer highlights are along x than along y.
    pub anisotropic: f32,
    /// From dielectric to metal.
    pub metallic: f32,
    /// From diffuse to clear.
    pub transmission: f32,
    /// Tint of the dielectric reflection.
    pub specular_tint: f32,
    /// Strength of the sheen at grazing angles.
    pub sheen: f32,
    /// Its tint.
    pub sheen_tint: f32,
    /// From diffuse to the shape of subsurface scattering.
    pub flatness: f32,
    /// Strength of the clear coat.
    pub clearcoat: f32,
    /// Its gloss.
    pub clearcoat_gloss: f32,
    /// How often each lobe is sampled.
    pub rates: Rates,
}

/// Factors on how often each lobe is sampled; they change noise, not the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// The main microfacets, reflected and refracted.
    pub specular: f32,
    /// The clear coat.
    pub clearcoat: f32,
    /// The diffuse lobe.
    pub diffuse: f32,
}

impl Default for Rates {
    fn default() -> Rates {
        Rates { specular: 1.0, clearcoat: 1.0, diffuse: 1.0 }
    }
}

/// The probabilities of the lobes for light leaving on one side.
struct Choice {
    diffuse: f64,
    clearcoat: f64,
    /// Reflection and refraction by the main facets.
    main: f64,
}

/// A facet of the main lobe and what it does.
struct Facet {
    /// Its normal, on the side of the surface's.
    m: DVec3,
    split: Split,
    /// Probability of refraction by a drawn facet, beside the other lobes.
    refraction: f64,
    /// The same of reflection.
    reflection: f64,
}

impl Principled {
    /// Weight of the lobes that transmit.
    fn clear(&self) -> f64 {
        (1.0 - f64::from(self.metallic)) * f64::from(self.transmission)
    }

    /// Weight of the diffuse lobe.
    fn matte(&self) -> f64 {
        (1.0 - f64::from(self.metallic)) * (1.0 - f64::from(self.transmission))
    }

    fn facets(&self) -> Microfacets {
        lobes::facets(f64::from(self.roughness), f64::from(self.anisotropic))
    }

    fn coat(&self) -> CoatFacets {
        CoatFacets::of_gloss(f64::from(self.clearcoat_gloss))
    }

    /// The dielectric interface of a facet met at the cosine `cos` > 0 from the front or the back.
    fn interface(&self, cos: f64, front: bool) -> Split {
        let eta = f64::from(self.eta);
        fresnel::dielectric(Model::Exact, cos, if front { eta } else { 1.0 / eta })
    }

    /// `None` where nothing is sampled: all rates zero.
    fn choice(&self, front: bool) -> Option<Choice> {
        if !front {
            return Some(Choice { diffuse: 0.0, clearcoat: 0.0, main: 1.0 });
        }
        let specular = f64::from(self.rates.specular);
        // The coat reflects about a quarter of what the main lobe does.
        let clearcoat = 0.25 * f64::from(self.clearcoat) * f64::from(self.rates.clearcoat);
        let diffuse = self.matte() * f64::from(self.rates.diffuse);
        let total = specular + clearcoat + diffuse;
        (total > 0.0).then(|| {
            let share = 1.0 / total;
            Choice { diffuse: diffuse * share, clearcoat: clearcoat * share, main: specular * share }
        })
    }

    /// The facet `m`, which `wo` meets at the cosine `cos`.
    #[inline]
    fn facet(&self, choice: &Choice, m: DVec3, cos: f64, front: bool) -> Facet {
        let split = self.interface(cos.max(0.0), front);
        let (refraction, reflection) = if !front {
            (split.transmitted, split.reflected)
        } else if self.transmission > 0.0 {
            let refraction = choice.main * self.clear() * split.transmitted;
            (refraction, choice.main - refraction)
        } else {
            (0.0, choice.main)
        };
        Facet { m, split, refraction, reflection }
    }

    /// Reflectance of the main facets, met at the cosine `cos` from the front: Fresnel's equations for the
    /// dielectric, Schlick's approximation for its tinted part and for the metal.
    fn reflectance(&self, cos: f64, dielectric: f64) -> Lanes {
        let eta = f64::from(self.eta);
        let (metal, tint) = (self.metallic, self.specular_tint);
        let mut sum = Lanes::splat((1.0 - metal) * (1.0 - tint) * dielectric as f32);
        if metal == 0.0 && tint == 0.0 {
            return sum;
        }
        let weight = lobes::schlick_outside(cos, eta);
        sum += lobes::toward_one(self.base, weight) * metal;
        if tint > 0.0 {
            let r0 = self.hue * lobes::r0(eta) as f32;
            sum += lobes::toward_one(r0, weight) * ((1.0 - metal) * tint);
        }
        sum
    }

    /// Reflectance of a facet of the coat, met at the cosine `cos`.
    fn coat_reflectance(&self, cos: f64) -> f64 {
        0.04 + 0.96 * lobes::schlick_outside(cos, f64::from(self.eta))
    }

    /// What a tracer of single rays shows of it, met at the cosine `cos` > 0: all facets smooth, without sheen.
    #[must_use]
    pub fn smooth(&self, cos: f64, front: bool) -> SmoothParts {
        let split = self.interface(cos, front);
        let clear = self.clear() as f32;
        SmoothParts {
            matte: self.base * self.matte() as f32,
            translucent: Lanes::ZERO,
            reflected: if front {
                // The lobe of the coat over facets so narrow that all see the same cosines: dω = 4 cos dm, and ∫ D cos dm = 1.
                let up = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
                let coat = self.coat_reflectance(cos) * CoatFacets::masking(up, up) * cos * cos;
                self.reflectance(cos, split.reflected) + Lanes::splat(self.clearcoat * coat as f32)
            } else {
                Lanes::splat(clear * split.reflected as f32)
            },
            transmitted: self.base.sqrt() * (clear * split.transmitted as f32),
        }
    }

    pub(crate) fn eval(&self, wo: DVec3, wi: DVec3) -> Evaluation {
        let front = wo.z > 0.0;
        if wo.z == 0.0 || wi.z == 0.0 || !(front || self.clear() > 0.0) {
            return Evaluation::NONE;
        }
        let side = wo.z.signum();
        let reflect = wi.z * side > 0.0;
        let eta = if front { f64::from(self.eta) } else { 1.0 / f64::from(self.eta) };
        // The half vector, of the directions scaled by their indices for refraction (Walter et al.
        // 2007, eq. 16), on the side of the normal.
        let Some(m) = (if reflect { wo + wi } else { wo + wi * eta }).try_normalize() else {
            return Evaluation::NONE;
        };
        let m = m * m.z.signum();
        let Some(choice) = self.choice(front) else { return Evaluation::NONE };
        self.eval_by(wo, wi, &choice, &self.facet(&choice, m, wo.dot(m) * side, front), &self.facets())
    }

    /// The part of f that the diffuse lobe gives, of directions before the surface.
    pub(crate) fn diffuse_part(&self, wo: DVec3, wi: DVec3) -> Lanes {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Lanes::ZERO;
        }
        self.diffuse(wo, wi, wi.dot((wo + wi).normalize()))
    }

    /// The same, by the cosine at the facet between them.
    #[inline]
    fn diffuse(&self, wo: DVec3, wi: DVec3, cos_i: f64) -> Lanes {
        let (roughness, flatness) = (f64::from(self.roughness), f64::from(self.flatness));
        self.base * (self.matte() / PI * lobes::diffusion(roughness, flatness, wo.z, wi.z, cos_i)) as f32
    }

    /// f and densities by the facet between the directions; neither lies in the surface.
    #[inline]
    fn eval_by(&self, wo: DVec3, wi: DVec3, choice: &Choice, facet: &Facet, facets: &Microfacets) -> Evaluation {
        let Facet { m, split, .. } = *facet;
        let front = wo.z > 0.0;
        let side = wo.z.signum();
        let reflect = wi.z * side > 0.0;
        let (cos_o, cos_i) = (wo.dot(m) * side, wi.dot(m) * side);
        let facing = cos_o > 0.0 && (cos_i > 0.0) == reflect;
        let mut f = Lanes::ZERO;
        let mut pdf = 0.0;
        if facing {
            let Terms { flow, pdf: pdf_m } = facets.terms(wo * side, wi, m);
            if reflect {
                // Torrance and Sparrow 1967. Where the interface has no contrast, metal too is invisible.
                if split.reflected > 0.0 {
                    let geometry = 0.25 * flow;
                    f += if front {
                        self.reflectance(cos_o, split.reflected) * geometry as f32
                    } else {
                        Lanes::splat((self.clear() * split.reflected * geometry) as f32)
                    };
                }
                pdf += facet.reflection * pdf_m / (4.0 * cos_i);
            } else {
                // Walter et al. 2007, eqs. 17 and 21; radiance scales by 1/η² on crossing. The base
                // colour is that of a way in and out, so each crossing takes its root.
                let eta = if front { f64::from(self.eta) } else { 1.0 / f64::from(self.eta) };
                let root = cos_o + eta * cos_i;
                let jacobian = cos_i.abs() / (root * root);
                let geometry = flow * cos_o * jacobian;
                f += self.base.sqrt() * (self.clear() * split.transmitted * geometry) as f32;
                pdf += facet.refraction * pdf_m * eta * eta * jacobian;
            }
        }
        if reflect && front {
            if facing && self.clearcoat > 0.0 {
                let coat = self.coat();
                let density = coat.density(m);
                let fresnel = self.coat_reflectance(cos_o);
                let masking = CoatFacets::masking(wo, wi);
                // Without the 1/(4 cos cos) of a microfacet lobe: Burley 2012 scales the coat by 1/4.
                f += Lanes::splat((0.25 * f64::from(self.clearcoat) * fresnel * density * masking) as f32);
                pdf += choice.clearcoat * density * m.z / (4.0 * cos_i);
            }
            if self.matte() > 0.0 {
                f += self.diffuse(wo, wi, cos_i);
            }
            if self.sheen > 0.0 {
                let strength = (1.0 - self.metallic) * self.sheen * lobes::schlick_weight(cos_i.abs()) as f32;
                f += (Lanes::ONE + (self.hue - Lanes::ONE) * self.sheen_tint) * strength;
            }
            pdf += choice.diffuse * wi.z / PI;
        }
        Evaluation { f, pdf: Lanes::splat(pdf as f32) }
    }

    pub(crate) fn sample(&self, wo: DVec3, u_lobe: f64, u: DVec2) -> Option<BsdfSample> {
        let front = wo.z > 0.0;
        if wo.z == 0.0 || !(front || self.clear() > 0.0) {
            return None;
        }
        let side = wo.z.signum();
        let up = wo * side;
        let choice = self.choice(front)?;
        let mut left = u_lobe - choice.diffuse;
        if left < 0.0 {
            let wi = warp::cosine_hemisphere(u);
            return from_evaluation(wi, wi.z, self.eval(wo, wi), false, 1.0);
        }
        left -= choice.clearcoat;
        let facets = self.facets();
        let coat = left < 0.0;
        let m = if coat { self.coat().sample(u) } else { facets.sample(up, u) };
        let cos = up.dot(m);
        if cos <= 0.0 {
            return None;
        }
        // What the facet reflects decides between its two ways.
        let facet = self.facet(&choice, m, cos, front);
        let transmitted = !coat && left < facet.refraction;
        let eta = if front { f64::from(self.eta) } else { 1.0 / f64::from(self.eta) };
        let wi_up = if transmitted { refract(up, m, eta, facet.split.cos_transmitted) } else { m * (2.0 * cos) - up };
        if (wi_up.z > 0.0) == transmitted || wi_up.z == 0.0 {
            return None;
        }
        let eta2 = if transmitted { eta * eta } else { 1.0 };
        let wi = wi_up * side;
        from_evaluation(wi, wi.z.abs(), self.eval_by(wo, wi, &choice, &facet, &facets), transmitted, eta2)
    }
}
