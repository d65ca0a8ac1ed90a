//! Interfaces between transparent media: smooth and rough, with an index for every wavelength.
//!
//! Refraction is computed in f64. On a smooth dispersive interface each wavelength would take its
//! own way: the reflected branch keeps all lanes (its direction is the same for all), the
//! refracted one keeps the hero and those lanes that have the very same index.
//! Radiance that crosses is scaled by 1/η², the square of the index ratio (Veach 1997, 5.2).

use super::bsdf::{BsdfSample, Chosen, Evaluation, from_evaluation, mirror};
use super::fresnel::{self, Model, Split};
use super::microfacet::{Microfacets, Terms};
use super::thin_film::ThinFilm;
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

    /// Each lane's.
    #[must_use]
    pub fn each(&self) -> [f64; LANES] {
        match self {
            RelativeIndex::Constant(eta) => [*eta; LANES],
            RelativeIndex::Dispersive(eta) => *eta,
        }
    }

    /// The same with no index closer to one than 2⁻⁴⁰. The half vector of refraction (Walter et al. 2007, eq. 16) is as long as
    /// the index differs from one: of equal indices there is none, and of closer ones rounding, 2⁻⁵³, would leave it fewer
    /// than 13 bits.
    #[must_use]
    pub fn apart_from_one(self) -> RelativeIndex {
        const CLOSEST: f64 = 1.0 / (1u64 << 40) as f64;
        let apart = |eta: f64| if (eta - 1.0).abs() < CLOSEST { 1.0 + CLOSEST } else { eta };
        match self {
            RelativeIndex::Constant(eta) => RelativeIndex::Constant(apart(eta)),
            RelativeIndex::Dispersive(all) => RelativeIndex::Dispersive(all.map(apart)),
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

/// What a smooth interface does with light of each lane.
#[derive(Clone, Copy, Debug)]
pub struct Ways {
    /// Index beyond over index on the side that it comes from.
    pub eta: [f64; LANES],
    /// Reflected share.
    pub reflected: [f64; LANES],
    /// Cosine of the refracted direction; zero under total reflection.
    pub cos_transmitted: [f64; LANES],
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
    /// A film on it.
    pub film: Option<ThinFilm>,
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
        let film = self.film.as_ref().map(|film| film.lane(lane));
        Dielectric { eta: RelativeIndex::Constant(eta), tint, film, ..*self }
    }

    /// What the interface does with light of each lane at an angle of its own: `cosines` to the normal.
    #[must_use]
    pub fn lanes(&self, cosines: &[f64; LANES]) -> Ways {
        let mut ways = Ways { eta: [1.0; LANES], reflected: [0.0; LANES], cos_transmitted: [1.0; LANES] };
        for (lane, &cos) in cosines.iter().enumerate() {
            let eta = match &self.eta {
                RelativeIndex::Constant(eta) => *eta,
                RelativeIndex::Dispersive(eta) => eta[lane],
            };
            let eta = if cos > 0.0 { eta } else { 1.0 / eta };
            let split = fresnel::dielectric(self.fresnel, cos.abs(), eta);
            ways.eta[lane] = eta;
            (ways.reflected[lane], ways.cos_transmitted[lane]) = (split.reflected, split.cos_transmitted);
            if let Some(film) = self.film.as_ref().filter(|_| split.transmitted > 0.0) {
                let inside = if cos > 0.0 { eta } else { 1.0 / eta };
                ways.reflected[lane] = film.of_lane(lane, cos.abs(), inside, cos > 0.0);
            }
        }
        ways
    }

    /// Whether light that comes at the cosine `cos` to the normal can leave at an angle to the surface of sine `most` or less.
    #[must_use]
    pub fn may_graze(&self, cos: f64, most: f64) -> bool {
        let (sin2, least) = (1.0 - cos * cos, 1.0 - most * most);
        let refracted = |eta: f64| if cos > 0.0 { sin2 / (eta * eta) } else { sin2 * (eta * eta) };
        let bent = |eta: &f64| (least..=1.0).contains(&refracted(*eta));
        sin2 >= least
            || match &self.eta {
                RelativeIndex::Constant(eta) => bent(eta),
                RelativeIndex::Dispersive(each) => each.iter().any(bent),
            }
    }

    /// The reflection, where `u_lobe` has every wavelength reflected that decides for itself.
    #[must_use]
    pub fn reflects_all(&self, wo: DVec3, u_lobe: f64) -> Option<BsdfSample> {
        let reflects = |eta: f64| u_lobe < self.reflected(wo, eta);
        let all = match self.eta {
            _ if self.film.is_some() => self.film_reflects(wo).is_some_and(|r| r.into_iter().all(|r| u_lobe < r)),
            RelativeIndex::Constant(eta) => reflects(eta),
            RelativeIndex::Dispersive(eta) => eta.into_iter().all(reflects),
        };
        all.then(|| BsdfSample::discrete(mirror(wo), self.tint.reflected))
    }

    /// Where light goes that is not reflected, or all that is under total reflection, and the chance of that.
    #[must_use]
    pub fn go_through(&self, wo: DVec3) -> Option<(BsdfSample, f64)> {
        let sample = self.sample(wo, 1.0f64.next_down())?;
        if !sample.transmitted {
            return Some((sample, 1.0));
        }
        Some((sample, 1.0 - self.chance(wo, self.film_reflects(wo).as_ref())))
    }

    /// What is mirrored of light of each lane; `None` where all light is reflected, without chance.
    #[must_use]
    pub fn mirrored(&self, wo: DVec3) -> Option<Lanes> {
        let film = self.film_reflects(wo);
        let chance = self.chance(wo, film.as_ref());
        (chance < 1.0).then(|| self.reflection_of(wo, film.as_ref()))
    }

    /// Whether wavelengths part here of which some are reflected without chance.
    #[must_use]
    pub fn reflects_all_of_some(&self, wo: DVec3) -> bool {
        self.parts() && self.eta.each().into_iter().any(|eta| self.reflected(wo, eta) >= 1.0)
    }

    /// The direction in which light is mirrored, and what is mirrored there of each lane as its weight.
    #[must_use]
    pub fn reflection(&self, wo: DVec3) -> BsdfSample {
        BsdfSample::discrete(mirror(wo), self.reflection_of(wo, self.film_reflects(wo).as_ref()))
    }

    /// What is mirrored of light of each lane, given what the film reflects.
    fn reflection_of(&self, wo: DVec3, film: Option<&[f64; LANES]>) -> Lanes {
        let reflected = match film {
            Some(each) => Lanes::new(each.map(|r| r as f32)),
            None => self.eta.lanes(|eta| self.reflected(wo, eta)),
        };
        reflected * self.tint.reflected
    }

    /// The chance that light is reflected, of which `film` tells what each lane has reflected, where there is one: the hero's, or the
    /// mean where all wavelengths go the same two ways.
    fn chance(&self, wo: DVec3, film: Option<&[f64; LANES]>) -> f64 {
        match (film, &self.eta) {
            (None, eta) => self.reflected(wo, eta.hero()),
            (Some(each), RelativeIndex::Constant(_)) => each.iter().sum::<f64>() / LANES as f64,
            (Some(each), RelativeIndex::Dispersive(_)) => each[0],
        }
    }

    /// Share that a bare interface of the index `eta` reflects.
    fn reflected(&self, wo: DVec3, eta: f64) -> f64 {
        let toward = if wo.z > 0.0 { eta } else { 1.0 / eta };
        fresnel::dielectric(self.fresnel, wo.z.abs(), toward).reflected
    }

    /// What each lane has reflected by the film; `None` where there is none.
    fn film_reflects(&self, wo: DVec3) -> Option<[f64; LANES]> {
        self.film.as_ref().map(|film| film.over_dielectric(wo.z.abs(), self.eta.each(), wo.z > 0.0))
    }

    /// The same with a film, whose reflectance depends on the wavelength even where the index does not. Where all
    /// wavelengths go the same two ways they are chosen by the mean, so that none leads.
    fn sample_filmed(&self, reflected: [f64; LANES], wo: DVec3, u_lobe: f64) -> Option<BsdfSample> {
        let eta = if wo.z > 0.0 { self.eta.hero() } else { 1.0 / self.eta.hero() };
        let share = self.chance(wo, Some(&reflected));
        let same = match self.eta {
            RelativeIndex::Constant(_) => None,
            RelativeIndex::Dispersive(all) => Some(all.map(|e| e == all[0])),
        };
        let over = |part: [f64; LANES], share: f64| Lanes::new(part.map(|p| (p / share) as f32));
        if u_lobe < share {
            let weight = over(reflected, share);
            let ratio = if same.is_some() { weight } else { Lanes::ONE };
            return Some(BsdfSample { ratio, ..BsdfSample::discrete(mirror(wo), weight * self.tint.reflected) });
        }
        let split = fresnel::dielectric(Model::Exact, wo.z.abs(), eta);
        // All is reflected but for rounding.
        if split.transmitted == 0.0 || share >= 1.0 {
            return None;
        }
        let wi = refract(wo, DVec3::Z * wo.z.signum(), eta, split.cos_transmitted);
        let mut transmitted = reflected.map(|r| 1.0 - r);
        if let Some(same) = same {
            transmitted = std::array::from_fn(|k| if same[k] { transmitted[k] } else { 0.0 });
        }
        let weight = over(transmitted, 1.0 - share);
        let eta2 = eta * eta;
        Some(BsdfSample {
            wi,
            weight: weight * (1.0 / eta2) as f32 * self.tint.transmitted,
            ratio: if same.is_some() { weight } else { Lanes::ONE },
            chosen: Chosen::Discrete,
            transmitted: true,
            eta2,
        })
    }

    /// Reflects with the hero's reflectance, else refracts.
    #[must_use]
    pub fn sample(&self, wo: DVec3, u_lobe: f64) -> Option<BsdfSample> {
        if let Some(reflected) = self.film_reflects(wo) {
            return self.sample_filmed(reflected, wo, u_lobe);
        }
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
    /// A film on each facet.
    pub film: Option<ThinFilm>,
}

impl RoughDielectric {
    /// η² of each lane over the hero's where light from `wo` crosses: of what goes on as power [`BsdfSample::eta2`] is the hero's, while
    /// the radiance of each lane has scaled by its own.
    pub(super) fn power_of_lanes(&self, wo: DVec3) -> Lanes {
        let toward = |eta: f64| if wo.z > 0.0 { eta } else { 1.0 / eta };
        let hero = toward(self.eta.hero());
        self.eta.lanes(|eta| (toward(eta) / hero).powi(2))
    }

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
        // With a film as on a smooth interface: by the mean where none leads, else by the hero's.
        let share = match (&self.film, self.eta) {
            (None, _) => split.reflected,
            (Some(film), RelativeIndex::Constant(eta)) => mean_of(film.over_dielectric(cos, [eta; LANES], side > 0.0)),
            (Some(film), RelativeIndex::Dispersive(all)) => film.of_lane(0, cos, all[0], side > 0.0),
        };
        let (wi, transmitted) = if u_lobe < share {
            (m * (2.0 * cos) - wo, false)
        } else {
            (refract(wo, m, eta, split.cos_transmitted), true)
        };
        // Behind a film rounding may find a way where there is none.
        if (wi.z * side > 0.0) == transmitted || transmitted && split.transmitted == 0.0 {
            return None;
        }
        let eta2 = if transmitted { eta * eta } else { 1.0 };
        let evaluation = match self.eta {
            // The facet is known, and what it reflects.
            RelativeIndex::Constant(_) if self.film.is_none() => {
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
            _ => self.eval(wo, wi),
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
        if let Some(film) = &self.film {
            return self.eval_filmed(film, wo, wi, side > 0.0, tint);
        }
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

fn mean_of(x: [f64; LANES]) -> f64 {
    x.iter().sum::<f64>() / LANES as f64
}

impl RoughDielectric {
    /// f and the densities with a film, seen from a side where `wo` has z > 0.
    fn eval_filmed(&self, film: &ThinFilm, wo: DVec3, wi: DVec3, front: bool, tint: Lanes) -> Evaluation {
        // Of facets that do all of what is asked for; the film then divides light.
        const WHOLE: Split = Split { reflected: 1.0, transmitted: 1.0, cos_transmitted: 0.0 };
        let reflect = wi.z > 0.0;
        let parts = |reflected: [f64; LANES]| if reflect { reflected } else { reflected.map(|r| 1.0 - r) };
        let whole = |eta: f64| facet(wo, wi, eta).map(|m| (m, by_facet(&self.facets, wo, wi, m, &WHOLE, eta)));
        let lanes = |x: [f64; LANES]| Lanes::new(x.map(|x| x as f32));
        match self.eta {
            RelativeIndex::Constant(eta) => {
                let Some((m, (f, pdf))) = whole(if front { eta } else { 1.0 / eta }) else { return Evaluation::NONE };
                let parts = parts(film.over_dielectric(wo.dot(m), [eta; LANES], front));
                Evaluation {
                    f: lanes(parts.map(|part| f * part)) * tint,
                    pdf: Lanes::splat((pdf * mean_of(parts)) as f32),
                }
            }
            RelativeIndex::Dispersive(all) => {
                let each: [(f64, f64); LANES] = std::array::from_fn(|k| {
                    let found = whole(if front { all[k] } else { 1.0 / all[k] });
                    found.map_or((0.0, 0.0), |(m, (f, pdf))| {
                        let reflected = film.of_lane(k, wo.dot(m), all[k], front);
                        let part = if reflect { reflected } else { 1.0 - reflected };
                        (f * part, pdf * part)
                    })
                });
                Evaluation { f: lanes(each.map(|e| e.0)) * tint, pdf: lanes(each.map(|e| e.1)) }
            }
        }
    }
}

/// The facet that leads from `wi` to `wo` (z > 0), on the side of `wo`, where there is one.
fn facet(wo: DVec3, wi: DVec3, eta: f64) -> Option<DVec3> {
    let reflect = wi.z > 0.0;
    // The half vector; for refraction of the two directions scaled by their indices (eq. 16).
    let m = (if reflect { wo + wi } else { wo + wi * eta }).try_normalize()?;
    let m = m * m.z.signum();
    (wo.dot(m) > 0.0 && (wi.dot(m) > 0.0) == reflect).then_some(m)
}

/// f and pdf at one index, beyond over on this side; `wo` has z > 0.
fn one(facets: &Microfacets, wo: DVec3, wi: DVec3, eta: f64) -> (f64, f64) {
    let Some(m) = facet(wo, wi, eta) else { return (0.0, 0.0) };
    by_facet(facets, wo, wi, m, &fresnel::dielectric(Model::Exact, wo.dot(m), eta), eta)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::uniform;
    use crate::optics::bsdf::{Bsdf, Chosen};
    use crate::optics::microfacet::{Distribution, Microfacets};

    /// What goes through ground flint as power is what the way back lets through as radiance, at each wavelength: f(i, o) = (η_i/η_o)² f(o, i)
    /// (Veach 1997, eq. 5.14).
    #[test]
    fn power_through_ground_flint_is_radiance_the_other_way() {
        let eta = RelativeIndex::Dispersive(std::array::from_fn(|k| 1.5 + 0.05 * k as f64));
        let facets = Microfacets::isotropic(Distribution::Ggx, 0.3);
        let tint = Tint { reflected: Lanes::ONE, transmitted: Lanes::ONE };
        let bsdf = Bsdf::RoughDielectric(RoughDielectric { facets, eta, tint, film: None });
        let mut crossed = 0;
        for i in 0..200u64 {
            let u = |k: u64| uniform(5, 8 * i + k);
            let wo = crate::math::warp::uniform_sphere(DVec2::new(u(0), u(1)));
            let Some(sample) = bsdf.sample(wo, u(2), DVec2::new(u(3), u(4))) else { continue };
            let Chosen::Density(pdf) = sample.chosen else { panic!("a density") };
            if !sample.transmitted {
                continue;
            }
            crossed += 1;
            let power = sample.weight * bsdf.power_of_lanes(wo, true) * sample.eta2 as f32;
            let back = bsdf.eval(sample.wi, wo).f * (sample.wi.z.abs() / pdf) as f32;
            for (found, expected) in power.to_array().into_iter().zip(back.to_array()) {
                assert!(
                    (found - expected).abs() <= 1e-4 * expected + 1e-12,
                    "{wo} {:?}: {found} for {expected}",
                    sample.wi
                );
            }
        }
        assert!(crossed > 50, "{crossed}");
    }
}
