//! Interfaces between transparent media: smooth and rough, with an index for every wavelength.
//!
//! Refraction is computed in f64. On a smooth dispersive interface each wavelength would take its
//! own way: the reflected branch keeps all lanes (its direction is the same for all), the
//! refracted one keeps the hero and those lanes that have the very same index.
//! Radiance that crosses is scaled by 1/η², the square of the index ratio (Veach 1997, 5.2).

use super::bsdf::{BsdfSample, Chosen, Evaluation, from_evaluation, mirror};
use super::fresnel::{self, Model, Split};
use super::microfacet::{Microfacets, Terms};
use crate::spectrum::{LANES, Lanes};
use glam::{DVec2, DVec3};

/// Index inside over index outside.
#[derive(Clone, Copy, Debug)]
pub enum RelativeIndex {
    /// The same for every wavelength.
    Constant(f64),
    /// One a lane.
    Dispersive([f64; LANES]),
}

impl RelativeIndex {
    /// The hero's.
    #[must_use]
    pub fn hero(&self) -> f64 {
        match self {
            RelativeIndex::Constant(eta) => *eta,
            RelativeIndex::Dispersive(eta) => eta[0],
        }
    }

    /// `f` of each lane's index; once where all are the same.
    pub fn lanes(&self, f: impl Fn(f64) -> f64) -> Lanes {
        match self {
            RelativeIndex::Constant(eta) => Lanes::splat(f(*eta) as f32),
            RelativeIndex::Dispersive(eta) => Lanes::new(eta.map(|e| f(e) as f32)),
        }
    }
}

/// A smooth interface.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index on the side away from the normal over the index on its side.
    pub eta: RelativeIndex,
    /// Which Fresnel formula.
    pub fresnel: Model,
    /// Factors beside Fresnel's.
    pub tint: Tint,
}

/// Factors on what an interface reflects and transmits; one for physical glass.
#[derive(Clone, Copy, Debug)]
pub struct Tint {
    /// On the reflected light.
    pub reflected: Lanes,
    /// On the transmitted light.
    pub transmitted: Lanes,
}

impl Tint {
    /// Physical glass.
    pub const NONE: Tint = Tint { reflected: Lanes::ONE, transmitted: Lanes::ONE };
}

/// Refracts `wo` at the facet `m` (on the side of `wo`); `cos_t` from Fresnel's equations, `eta` =
/// index beyond over index on this side.
///
/// The tangential part shrinks by 1/η exactly and the normal part is cos θ_t, so the result has
/// unit length without a normalisation and agrees with the Fresnel split to the last bits.
#[must_use]
pub fn refract(wo: DVec3, m: DVec3, eta: f64, cos_t: f64) -> DVec3 {
    (m * wo.dot(m) - wo) / eta - m * cos_t
}

impl Dielectric {
    /// Whether wavelengths part here.
    #[must_use]
    pub fn parts(&self) -> bool {
        match self.eta {
            RelativeIndex::Constant(_) => false,
            RelativeIndex::Dispersive(eta) => eta.iter().any(|e| *e != eta[0]),
        }
    }

    /// The interface as one wavelength meets it.
    #[must_use]
    pub fn lane(&self, lane: usize) -> Dielectric {
        let eta = match self.eta {
            RelativeIndex::Constant(eta) => eta,
            RelativeIndex::Dispersive(eta) => eta[lane],
        };
        let only = |x: Lanes| Lanes::splat(x.to_array()[lane]);
        let tint = Tint { reflected: only(self.tint.reflected), transmitted: only(self.tint.transmitted) };
        Dielectric { eta: RelativeIndex::Constant(eta), tint, ..*self }
    }

    /// The reflection, where `u_lobe` has every wavelength reflected that decides for itself.
    #[must_use]
    pub fn reflects_all(&self, wo: DVec3, u_lobe: f64) -> Option<BsdfSample> {
        let reflects = |eta: f64| {
            let toward = if wo.z > 0.0 { eta } else { 1.0 / eta };
            u_lobe < fresnel::dielectric(self.fresnel, wo.z.abs(), toward).reflected
        };
        let all = match self.eta {
            RelativeIndex::Constant(eta) => reflects(eta),
            RelativeIndex::Dispersive(eta) => eta.into_iter().all(reflects),
        };
        all.then(|| BsdfSample::discrete(mirror(wo), self.tint.reflected))
    }

    /// Reflects with the hero's reflectance, else refracts.
    pub(super) fn sample(&self, wo: DVec3, u_lobe: f64) -> Option<BsdfSample> {
        let cos = wo.z.abs();
        let toward = |eta: f64| if wo.z > 0.0 { eta } else { 1.0 / eta };
        let eta = toward(self.eta.hero());
        let split = fresnel::dielectric(self.fresnel, cos, eta);
        if u_lobe < split.reflected {
            let ratio = match self.eta {
                RelativeIndex::Constant(_) => Lanes::ONE,
                RelativeIndex::Dispersive(_) => {
                    self.eta.lanes(|e| fresnel::dielectric(self.fresnel, cos, toward(e)).reflected / split.reflected)
                }
            };
            return Some(BsdfSample { ratio, ..BsdfSample::discrete(mirror(wo), ratio * self.tint.reflected) });
        }
        let m = DVec3::Z * wo.z.signum();
        let wi = refract(wo, m, eta, split.cos_transmitted);
        // Other lanes bend elsewhere: they cannot lead along this path and carry nothing on it.
        let same = match self.eta {
            RelativeIndex::Constant(_) => Lanes::ONE,
            RelativeIndex::Dispersive(all) => Lanes::new(all.map(|e| if e == all[0] { 1.0 } else { 0.0 })),
        };
        let eta2 = eta * eta;
        Some(BsdfSample {
            wi,
            weight: same * (1.0 / eta2) as f32 * self.tint.transmitted,
            ratio: same,
            chosen: Chosen::Discrete,
            transmitted: true,
            eta2,
        })
    }
}

/// A rough interface: microfacets that reflect and refract. Walter et al. 2007, eqs. 20–21, 33–41.
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectric {
    /// Index on the side away from the normal over the index on its side.
    pub eta: RelativeIndex,
    /// Its facets.
    pub facets: Microfacets,
    /// Factors beside Fresnel's.
    pub tint: Tint,
}

impl RoughDielectric {
    pub(super) fn sample(&self, wo: DVec3, u_lobe: f64, u: DVec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        // Facets are drawn on the side of `wo`.
        let side = wo.z.signum();
        let above = DVec3::new(wo.x, wo.y, wo.z * side);
        let m = self.facets.sample(above, u) * DVec3::new(1.0, 1.0, side);
        let cos = wo.dot(m);
        if cos <= 0.0 {
            return None;
        }
        let eta = if side > 0.0 { self.eta.hero() } else { 1.0 / self.eta.hero() };
        let split = fresnel::dielectric(Model::Exact, cos, eta);
        let (wi, transmitted) = if u_lobe < split.reflected {
            (m * (2.0 * cos) - wo, false)
        } else {
            (refract(wo, m, eta, split.cos_transmitted), true)
        };
        if (wi.z * side > 0.0) == transmitted {
            return None;
        }
        let eta2 = if transmitted { eta * eta } else { 1.0 };
        let evaluation = match self.eta {
            // The facet is known, and what it reflects.
            RelativeIndex::Constant(_) => {
                let tint = if transmitted { self.tint.transmitted } else { self.tint.reflected };
                let (f, pdf) = by_facet(
                    &self.facets,
                    above,
                    wi * DVec3::new(1.0, 1.0, side),
                    m * DVec3::new(1.0, 1.0, side),
                    &split,
                    eta,
                );
                Evaluation { f: tint * f as f32, pdf: Lanes::splat(pdf as f32) }
            }
            RelativeIndex::Dispersive(_) => self.eval(wo, wi),
        };
        from_evaluation(wi, wi.z.abs(), evaluation, transmitted, eta2)
    }

    pub(super) fn eval(&self, wo: DVec3, wi: DVec3) -> Evaluation {
        if wo.z == 0.0 || wi.z == 0.0 {
            return Evaluation::NONE;
        }
        let tint = if wo.z * wi.z > 0.0 { self.tint.reflected } else { self.tint.transmitted };
        // Seen from the side of `wo`.
        let side = wo.z.signum();
        let flip = DVec3::new(1.0, 1.0, side);
        let (wo, wi) = (wo * flip, wi * flip);
        let one = |eta: f64| one(&self.facets, wo, wi, if side > 0.0 { eta } else { 1.0 / eta });
        match self.eta {
            RelativeIndex::Constant(eta) => {
                let (f, pdf) = one(eta);
                Evaluation { f: tint * f as f32, pdf: Lanes::splat(pdf as f32) }
            }
            RelativeIndex::Dispersive(eta) => {
                let all = eta.map(one);
                Evaluation {
                    f: Lanes::new(all.map(|(f, _)| f as f32)) * tint,
                    pdf: Lanes::new(all.map(|(_, pdf)| pdf as f32)),
                }
            }
        }
    }
}

/// f and pdf at one index, beyond over on this side; `wo` has z > 0.
fn one(facets: &Microfacets, wo: DVec3, wi: DVec3, eta: f64) -> (f64, f64) {
    let reflect = wi.z > 0.0;
    // The half vector, on the side of `wo`; for refraction of the two directions scaled by their
    // indices (eq. 16).
    let Some(m) = (if reflect { wo + wi } else { wo + wi * eta }).try_normalize() else { return (0.0, 0.0) };
    let m = m * m.z.signum();
    let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
    if cos_o <= 0.0 || (cos_i > 0.0) != reflect {
        return (0.0, 0.0);
    }
    by_facet(facets, wo, wi, m, &fresnel::dielectric(Model::Exact, cos_o, eta), eta)
}

/// f and pdf where the facet `m` leads from `wi` to `wo` (z > 0) and divides light as `split` says.
fn by_facet(facets: &Microfacets, wo: DVec3, wi: DVec3, m: DVec3, split: &Split, eta: f64) -> (f64, f64) {
    let cos_o = wo.dot(m);
    let Terms { flow, pdf } = facets.terms(wo, wi, m);
    if wi.z > 0.0 {
        (split.reflected * flow * 0.25, split.reflected * pdf / (4.0 * cos_o))
    } else {
        // Eq. 21 and 17; radiance scales by 1/η² on crossing, which cancels the η² of the Jacobian
        // in f but not in the density.
        let cos_i = wi.dot(m);
        let root = cos_o + eta * cos_i;
        let jacobian = cos_i.abs() / (root * root);
        (split.transmitted * flow * cos_o * jacobian, split.transmitted * pdf * eta * eta * jacobian)
    }
}
