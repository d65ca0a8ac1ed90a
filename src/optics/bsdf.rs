//! The closed set of surface scattering functions, evaluated at one point for eight wavelengths.

use super::dielectric::{Dielectric, RelativeIndex, RoughDielectric, Tint};
use super::fresnel::{self, Model};
use super::hair::Hair;
use super::mean;
use super::microfacet::{Microfacets, Terms};
use super::plastic::{Plastic, RoughPlastic};
use super::principled::{Principled, PrincipledThin};
use super::thin_film::{self, ThinFilm};
use crate::math::warp;
use crate::spectrum::{LANES, Lanes};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// What a surface does with light, with its parameters at one point.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf<'a> {
    /// Lambert: f = ρ/π on the side of the normal.
    Diffuse {
        /// Albedo ρ.
        reflectance: Lanes,
    },
    /// A perfect mirror with a spectral reflectance.
    Mirror {
        /// Reflectance at every angle.
        reflectance: Lanes,
    },
    /// A smooth metal.
    Conductor(Metal),
    /// A rough metal: microfacets that are metal mirrors.
    RoughConductor(Metal, Microfacets),
    /// A smooth interface between two transparent media.
    Dielectric(Dielectric),
    /// A rough interface between two transparent media.
    RoughDielectric(RoughDielectric),
    /// A thin pane: two smooth interfaces that the path crosses as one, without bending.
    Thin {
        /// Index of the pane over the index around it.
        eta: RelativeIndex,
        /// Its thickness over the wavelength around it, where that is so small that light reflected by its faces
        /// interferes.
        thickness: Option<Lanes>,
        /// Factors beside Fresnel's.
        tint: Tint,
    },
    /// A diffuse base under a smooth dielectric coat.
    Plastic(Plastic),
    /// A diffuse base under a rough dielectric coat.
    RoughPlastic(RoughPlastic<'a>),
    /// Burley's surface of a solid.
    Principled(Principled),
    /// Burley's surface of a sheet.
    PrincipledThin(PrincipledThin),
    /// A fibre of hair.
    Hair(Hair<'a>),
    /// No interface: the boundary of a medium only.
    Null,
}

/// Index, absorption and tint of a metal.
#[derive(Clone, Copy, Debug)]
pub struct Metal {
    /// Real part of the index relative to the medium outside.
    pub eta: Lanes,
    /// Imaginary part.
    pub k: Lanes,
    /// A factor on the reflectance; one for a physical metal.
    pub tint: Lanes,
    /// Which Fresnel formula.
    pub fresnel: Model,
    /// A film on it.
    pub film: Option<ThinFilm>,
}

impl Metal {
    /// What is reflected at |cos θ| = `cos`.
    #[must_use]
    pub fn reflectance(&self, cos: f64) -> Lanes {
        let plain = || fresnel::conductor(self.fresnel, cos, self.eta, self.k);
        self.film.as_ref().map_or_else(plain, |film| film.over_metal(cos, self.eta, self.k)) * self.tint
    }
}

/// f and the densities of sampling, for a pair of directions.
#[derive(Clone, Copy, Debug)]
pub struct Evaluation {
    /// f in sr⁻¹, without the cosine.
    pub f: Lanes,
    /// Density of [`Bsdf::sample`] in sr⁻¹ had that lane led the way.
    pub pdf: Lanes,
}

impl Evaluation {
    /// No light, never sampled.
    pub const NONE: Evaluation = Evaluation { f: Lanes::ZERO, pdf: Lanes::ZERO };
}

/// How a sampled direction was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Chosen {
    /// From a density over directions; lane 0's, in sr⁻¹.
    Density(f64),
    /// One of finitely many directions: no other technique can find it.
    Discrete,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Where the path goes on.
    pub wi: DVec3,
    /// f · |cos θ| / (density or probability of the hero): the factor on the throughput.
    pub weight: Lanes,
    /// Density of each lane over the hero's. One where sampling does not depend on wavelength.
    pub ratio: Lanes,
    /// The hero's density.
    pub chosen: Chosen,
    /// True where the path crosses the surface.
    pub transmitted: bool,
    /// Square of the index ratio gathered by crossing, for Russian roulette: radiance scales by
    /// 1/η² on the way in and regains it on the way out. One for reflection.
    pub eta2: f64,
}

impl BsdfSample {
    /// A reflection or achromatic event in a single direction.
    pub(super) fn discrete(wi: DVec3, weight: Lanes) -> BsdfSample {
        BsdfSample { wi, weight, ratio: Lanes::ONE, chosen: Chosen::Discrete, transmitted: false, eta2: 1.0 }
    }
}

/// What a thin pane reflects and lets through, of light at one angle.
#[derive(Clone, Copy, Debug)]
pub struct Pane {
    /// The probability to go through: the mean of the lanes' shares, so that no wavelength leads.
    pub share: f64,
    /// What goes through, over `share`.
    pub transmitted: Lanes,
    /// What is reflected, over 1 − `share`.
    pub reflected: Lanes,
}

impl Pane {
    /// The pane of relative index `eta` at |cos θ| = `cos`. It reflects the series of reflections inside,
    /// R + T²R + T²R³ + … = 2R/(1 + R), and lets T/(1 + R) through. With a `thickness` in wavelengths the reflections
    /// are added by amplitude: a film that stands free.
    #[must_use]
    pub fn new(cos: f64, eta: &RelativeIndex, thickness: Option<Lanes>) -> Pane {
        if let Some(thickness) = thickness {
            let thickness = thickness.to_array();
            let eta = eta.each();
            let film = |k: usize| thin_film::reflectance(cos, eta[k], f64::from(thickness[k]), 1.0, 0.0);
            return Pane::of(std::array::from_fn(|k| 1.0 - film(k)));
        }
        let through = |eta| {
            let split = fresnel::dielectric(Model::Exact, cos, eta);
            split.transmitted / (1.0 + split.reflected)
        };
        match eta {
            RelativeIndex::Constant(eta) => {
                Pane { share: through(*eta), transmitted: Lanes::ONE, reflected: Lanes::ONE }
            }
            RelativeIndex::Dispersive(eta) => Pane::of(eta.map(through)),
        }
    }

    /// The pane that lets `shares` through.
    fn of(shares: [f64; LANES]) -> Pane {
        let share = shares.iter().sum::<f64>() / LANES as f64;
        // Nothing is chosen with probability zero.
        let over = |sum: f64, part: [f64; LANES]| {
            if sum > 0.0 { Lanes::new(part.map(|p| (p / sum) as f32)) } else { Lanes::ZERO }
        };
        Pane { share, transmitted: over(share, shares), reflected: over(1.0 - share, shares.map(|s| 1.0 - s)) }
    }
}

/// `wo` reflected about the local normal.
#[must_use]
pub fn mirror(wo: DVec3) -> DVec3 {
    DVec3::new(-wo.x, -wo.y, wo.z)
}

/// What a path asks of a scattering function.
pub trait Lobes {
    /// As [`Bsdf::is_discrete`].
    fn is_discrete(&self) -> bool;
    /// As [`Bsdf::eval`].
    fn eval(&self, wo: DVec3, wi: DVec3) -> Evaluation;
    /// As [`Bsdf::sample`]; the number for the lobe is drawn where there are several.
    fn sample_by(&self, wo: DVec3, u_lobe: impl FnOnce() -> f64, u: DVec2) -> Option<BsdfSample>;
    /// Whether it may mirror in a single direction where it may as well do something else.
    fn may_mirror(&self) -> bool;
    /// What is mirrored in a single direction, where that is one of several ways that [`Lobes::sample_by`] may take: f · |cos θ| as
    /// a weight, no matter how often it is taken.
    fn mirrored(&self, wo: DVec3) -> Option<Lanes>;
    /// Smooth glass.
    fn glass(&self) -> Option<&Dielectric>;
    /// As [`Bsdf::diffuse_share`].
    fn diffuse_share(&self, wo: DVec3, wi: DVec3) -> Lanes;
}

/// Lambert: f = ρ/π on the side of the normal.
#[derive(Clone, Copy, Debug)]
pub struct Lambert {
    /// Albedo ρ.
    pub reflectance: Lanes,
}

impl Lobes for Lambert {
    #[inline(always)]
    fn is_discrete(&self) -> bool {
        false
    }

    #[inline(always)]
    fn eval(&self, wo: DVec3, wi: DVec3) -> Evaluation {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Evaluation::NONE;
        }
        Evaluation { f: self.reflectance * (1.0 / PI) as f32, pdf: Lanes::splat((wi.z / PI) as f32) }
    }

    #[inline(always)]
    fn sample_by(&self, wo: DVec3, _: impl FnOnce() -> f64, u: DVec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let wi = warp::cosine_hemisphere(u);
        let pdf = wi.z / PI;
        (pdf > 0.0).then_some(BsdfSample {
            wi,
            weight: self.reflectance,
            ratio: Lanes::ONE,
            chosen: Chosen::Density(pdf),
            transmitted: false,
            eta2: 1.0,
        })
    }

    #[inline(always)]
    fn may_mirror(&self) -> bool {
        false
    }

    #[inline(always)]
    fn mirrored(&self, _: DVec3) -> Option<Lanes> {
        None
    }

    #[inline(always)]
    fn glass(&self) -> Option<&Dielectric> {
        None
    }

    #[inline(always)]
    fn diffuse_share(&self, _: DVec3, _: DVec3) -> Lanes {
        Lanes::ONE
    }
}

impl Lobes for Bsdf<'_> {
    #[inline]
    fn is_discrete(&self) -> bool {
        Bsdf::is_discrete(self)
    }

    #[inline]
    fn eval(&self, wo: DVec3, wi: DVec3) -> Evaluation {
        Bsdf::eval(self, wo, wi)
    }

    #[inline]
    fn sample_by(&self, wo: DVec3, u_lobe: impl FnOnce() -> f64, u: DVec2) -> Option<BsdfSample> {
        Bsdf::sample(self, wo, u_lobe(), u)
    }

    #[inline]
    fn may_mirror(&self) -> bool {
        matches!(self, Bsdf::Plastic(_) | Bsdf::Dielectric(_))
    }

    #[inline]
    fn mirrored(&self, wo: DVec3) -> Option<Lanes> {
        match self {
            Bsdf::Plastic(plastic) => plastic.mirrored(wo),
            Bsdf::Dielectric(glass) => glass.mirrored(wo),
            _ => None,
        }
    }

    #[inline]
    fn glass(&self) -> Option<&Dielectric> {
        match self {
            Bsdf::Dielectric(glass) => Some(glass),
            _ => None,
        }
    }

    #[inline]
    fn diffuse_share(&self, wo: DVec3, wi: DVec3) -> Lanes {
        Bsdf::diffuse_share(self, wo, wi)
    }
}

impl Bsdf<'_> {
    /// True where every direction is one of finitely many: next-event estimation is pointless.
    #[must_use]
    pub fn is_discrete(&self) -> bool {
        match self {
            Bsdf::Mirror { .. } | Bsdf::Conductor(_) | Bsdf::Dielectric(_) | Bsdf::Thin { .. } | Bsdf::Null => true,
            Bsdf::Diffuse { .. }
            | Bsdf::RoughConductor(..)
            | Bsdf::RoughDielectric(_)
            | Bsdf::Plastic(_)
            | Bsdf::RoughPlastic(_)
            | Bsdf::Principled(_)
            | Bsdf::PrincipledThin(_)
            | Bsdf::Hair(_) => false,
        }
    }

    /// False where light that comes at the cosine `cos` to the normal cannot leave at an angle to the surface of sine `most` or
    /// less.
    #[must_use]
    pub fn may_graze(&self, cos: f64, most: f64) -> bool {
        match self {
            Bsdf::Dielectric(glass) => glass.may_graze(cos, most),
            // A single direction has the angle that it came at.
            _ => !self.is_discrete() || cos.abs() <= most,
        }
    }

    /// f and pdf for a pair of directions; discrete parts excluded.
    #[must_use]
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> Evaluation {
        match self {
            Bsdf::Diffuse { reflectance } => Lambert { reflectance: *reflectance }.eval(wo, wi),
            Bsdf::RoughConductor(metal, facets) => rough_conductor(metal, facets, wo, wi),
            Bsdf::RoughDielectric(glass) => glass.eval(wo, wi),
            Bsdf::Plastic(plastic) => plastic.eval(wo, wi),
            Bsdf::RoughPlastic(plastic) => plastic.eval(wo, wi),
            Bsdf::Principled(surface) => surface.eval(wo, wi),
            Bsdf::PrincipledThin(sheet) => sheet.eval(wo, wi),
            Bsdf::Hair(hair) => hair.eval(wo, wi),
            Bsdf::Mirror { .. } | Bsdf::Conductor(_) | Bsdf::Dielectric(_) | Bsdf::Thin { .. } | Bsdf::Null => {
                Evaluation::NONE
            }
        }
    }

    /// The colour of a diffuse base, or the base colour; `None` of what has neither.
    #[must_use]
    pub fn base(&self) -> Option<Lanes> {
        match self {
            Bsdf::Diffuse { reflectance } => Some(*reflectance),
            Bsdf::Plastic(plastic) => Some(plastic.base.reflectance),
            Bsdf::RoughPlastic(plastic) => Some(plastic.base.reflectance),
            Bsdf::Principled(surface) => Some(surface.base),
            Bsdf::PrincipledThin(sheet) => Some(sheet.base),
            _ => None,
        }
    }

    /// The colour of the surface whatever its roughness, each lane from 0 to 1: of what has a diffuse base or a base colour that
    /// one; of metal, mirrors and what is clear the light along the normal that is not absorbed, reflected and transmitted; of hair
    /// that toward `wo`.
    #[must_use]
    pub fn albedo(&self, wo: DVec3) -> Lanes {
        let clear =
            |reflected: Lanes, tint: &Tint| reflected * tint.reflected + (Lanes::ONE - reflected) * tint.transmitted;
        let interface = |glass: &Dielectric| {
            let reflected = glass.lanes(&[1.0; LANES]).reflected;
            clear(Lanes::new(reflected.map(|r| r as f32)), &glass.tint)
        };
        if let Some(base) = self.base() {
            return base;
        }
        match self {
            Bsdf::Mirror { reflectance } => *reflectance,
            Bsdf::Conductor(metal) | Bsdf::RoughConductor(metal, _) => metal.reflectance(1.0),
            Bsdf::Dielectric(glass) => interface(glass),
            Bsdf::RoughDielectric(RoughDielectric { eta, tint, film, .. }) => {
                interface(&Dielectric { eta: *eta, fresnel: Model::Exact, tint: *tint, film: *film })
            }
            Bsdf::Thin { eta, thickness, tint } => {
                let pane = Pane::new(1.0, eta, *thickness);
                clear(pane.reflected * (1.0 - pane.share) as f32, tint)
            }
            Bsdf::Hair(hair) => hair.reflectance(wo),
            // A boundary; all others have a base.
            _ => Lanes::ONE,
        }
    }

    /// Of f, for a pair of directions on one side, the share of a diffuse base, from 0 to 1.
    #[must_use]
    pub fn diffuse_share(&self, wo: DVec3, wi: DVec3) -> Lanes {
        let part = match self {
            Bsdf::Diffuse { .. } | Bsdf::Plastic(_) => return Lanes::ONE,
            Bsdf::RoughPlastic(plastic) => plastic.diffuse_part(wo, wi),
            Bsdf::Principled(surface) => surface.diffuse_part(wo, wi),
            Bsdf::PrincipledThin(sheet) => sheet.diffuse_part(wo, wi),
            Bsdf::Mirror { .. }
            | Bsdf::Conductor(_)
            | Bsdf::RoughConductor(..)
            | Bsdf::Dielectric(_)
            | Bsdf::RoughDielectric(_)
            | Bsdf::Thin { .. }
            | Bsdf::Hair(_)
            | Bsdf::Null => return Lanes::ZERO,
        };
        let (part, whole) = (part.to_array(), self.eval(wo, wi).f.to_array());
        let share = |k: usize| if whole[k] > 0.0 { (part[k] / whole[k]).clamp(0.0, 1.0) } else { 0.0 };
        Lanes::new(std::array::from_fn(share))
    }

    /// η² of each lane over the hero's, by which a sample from `wo` is worth more as power where it `crosses` into another medium.
    #[must_use]
    #[inline]
    pub fn power_of_lanes(&self, wo: DVec3, crosses: bool) -> Lanes {
        match self {
            Bsdf::RoughDielectric(glass) if crosses => glass.power_of_lanes(wo),
            _ => Lanes::ONE,
        }
    }

    /// A direction for the path to go on in; `None` ends it. `u_lobe` chooses among lobes.
    #[must_use]
    pub fn sample(&self, wo: DVec3, u_lobe: f64, u: DVec2) -> Option<BsdfSample> {
        match self {
            Bsdf::Diffuse { reflectance } => Lambert { reflectance: *reflectance }.sample_by(wo, || u_lobe, u),
            Bsdf::Mirror { reflectance } => (wo.z > 0.0).then(|| BsdfSample::discrete(mirror(wo), *reflectance)),
            Bsdf::Conductor(metal) => (wo.z > 0.0).then(|| BsdfSample::discrete(mirror(wo), metal.reflectance(wo.z))),
            Bsdf::RoughConductor(metal, facets) => {
                if wo.z <= 0.0 {
                    return None;
                }
                let m = facets.sample(wo, u);
                let cos = wo.dot(m);
                let wi = m * (2.0 * cos) - wo;
                if cos <= 0.0 || wi.z <= 0.0 {
                    return None;
                }
                from_evaluation(wi, wi.z, rough_conductor_by(metal, facets, wo, wi, m), false, 1.0)
            }
            Bsdf::Dielectric(glass) => glass.sample(wo, u_lobe),
            Bsdf::RoughDielectric(glass) => glass.sample(wo, u_lobe, u),
            Bsdf::Thin { eta, thickness, tint } => {
                let pane = Pane::new(wo.z.abs(), eta, *thickness);
                Some(if u_lobe < 1.0 - pane.share {
                    BsdfSample::discrete(mirror(wo), pane.reflected * tint.reflected)
                } else {
                    BsdfSample { transmitted: true, ..BsdfSample::discrete(-wo, pane.transmitted * tint.transmitted) }
                })
            }
            Bsdf::Plastic(plastic) => plastic.sample(wo, u_lobe, u),
            Bsdf::RoughPlastic(plastic) => plastic.sample(wo, u_lobe, u),
            Bsdf::Principled(surface) => surface.sample(wo, u_lobe, u),
            Bsdf::PrincipledThin(sheet) => sheet.sample(wo, u_lobe, u),
            Bsdf::Hair(hair) => hair.sample(wo, u_lobe, u),
            Bsdf::Null => Some(BsdfSample { transmitted: true, ..BsdfSample::discrete(-wo, Lanes::ONE) }),
        }
    }
}

/// Reflection by facets of metal: Walter et al. 2007, eq. 20.
fn rough_conductor(metal: &Metal, facets: &Microfacets, wo: DVec3, wi: DVec3) -> Evaluation {
    if wo.z <= 0.0 || wi.z <= 0.0 {
        return Evaluation::NONE;
    }
    rough_conductor_by(metal, facets, wo, wi, (wo + wi).normalize())
}

/// The same by the half vector `m`.
fn rough_conductor_by(metal: &Metal, facets: &Microfacets, wo: DVec3, wi: DVec3, m: DVec3) -> Evaluation {
    let cos = wo.dot(m);
    let Terms { flow, pdf } = facets.terms(wo, wi, m);
    Evaluation { f: metal.reflectance(cos) * (0.25 * flow) as f32, pdf: Lanes::splat((pdf / (4.0 * cos)) as f32) }
}

/// The sample record of a direction drawn from a density that `eval` states; `cos` is |cos θ_i|.
pub(super) fn from_evaluation(wi: DVec3, cos: f64, e: Evaluation, transmitted: bool, eta2: f64) -> Option<BsdfSample> {
    let hero = e.pdf.to_array()[0];
    if !(hero > 0.0 && cos > 0.0) {
        return None;
    }
    Some(BsdfSample {
        wi,
        weight: e.f * (cos / f64::from(hero)) as f32,
        ratio: e.pdf / hero,
        chosen: Chosen::Density(f64::from(hero)),
        transmitted,
        eta2,
    })
}

/// The probability of the coat's lobe for a coat that reflects `f` over a base of `albedo`:
/// proportional to what each sends back, and the same for every wavelength.
pub(super) fn coat_probability(f: f64, albedo: Lanes) -> f64 {
    let base = (1.0 - f) * mean(albedo);
    if f + base > 0.0 { f / (f + base) } else { 1.0 }
}
