//! Media: what fills space, how far light flies through it, and which way it scatters.
//!
//! In a homogeneous medium flights are drawn from the closed form (`optics::medium`). Where extinction
//! varies they are drawn by delta tracking (Woodcock et al. 1965): tentative collisions come at the
//! rate of an upper bound μ̄, the same for all wavelengths and constant over blocks of the grid; each is a real one
//! with probability σ_t/μ̄ of the hero, else nothing happened. A lane's factor and density over the
//! hero's follow from its own probabilities of the same decisions (Miller, Georgiev and Jarosz 2019,
//! "A null-scattering path integral formulation of light transport"), so wavelengths are combined
//! as everywhere else. Light from a lamp is dimmed by ratio tracking (Novák et al. 2014): each tentative
//! collision leaves the factor 1 − σ_t/μ̄.

use super::volume::{Bounds, Volume};
use crate::math::Ray;
use crate::math::sampler::Walk;
use crate::optics::medium::{FreeFlight, MediumLanes};
use crate::optics::phase::Phase;
use crate::spectrum::{Lanes, Spectrum};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A medium at all wavelengths.
#[derive(Clone, Debug)]
pub struct Medium {
    /// How much of it there is, and what it takes away.
    pub filling: Filling,
    /// Which way it scatters.
    pub phase: PhaseFunction,
    /// Whether points inside look for lamps with rays of their own. Behind glass none gets through.
    pub shadow_rays: bool,
}

/// Extinction and albedo of a medium.
#[derive(Clone, Debug)]
pub enum Filling {
    /// The same everywhere.
    Even {
        /// σ_a, 1/m.
        absorption: Spectrum,
        /// σ_s, 1/m.
        scattering: Spectrum,
    },
    /// The same extinction everywhere.
    EvenExtinction {
        /// σ_t, 1/m.
        extinction: Spectrum,
        /// σ_s / σ_t.
        albedo: Volume,
        /// Whether the albedo is above zero anywhere.
        scatters: bool,
    },
    /// Neither.
    Varying(Box<Varying>),
}

/// A medium whose extinction varies through space. Outside the box of its volume it is empty.
#[derive(Clone, Debug)]
pub struct Varying {
    /// σ_t over `scale`, 1/m.
    extinction: Volume,
    /// Factor on it.
    scale: f32,
    /// σ_s / σ_t.
    albedo: Volume,
    /// Upper bounds of `extinction`.
    bounds: Bounds,
    /// Whether the albedo is above zero anywhere.
    scatters: bool,
}

/// A flight drawn before it is known what ends it.
#[derive(Clone, Copy, Debug)]
pub struct Draft {
    lanes: MediumLanes,
    u: f64,
    /// No surface beyond this many metres matters to it.
    pub reach: f64,
}

/// What a shadow ray keeps.
#[derive(Clone, Copy, Debug)]
pub struct Dimmed {
    /// An estimate of the transmittance of each lane.
    pub through: Lanes,
    /// For each lane the probability that a path on the same way would have come through.
    pub passing: Lanes,
}

impl Medium {
    /// Samples the flight along `ray` toward a surface at `distance` (may be infinite): `u` in [0, 1) decides
    /// first, `walk` on.
    #[must_use]
    #[inline]
    pub fn fly(&self, ray: &Ray, distance: f64, nm: Lanes, u: f64, walk: impl FnOnce() -> Walk) -> FreeFlight {
        self.arrive(&self.set_out(nm, u), ray, distance, nm, walk)
    }

    /// Draws a flight by `u` in [0, 1), before it is known what ends it.
    #[must_use]
    #[inline]
    pub fn set_out(&self, nm: Lanes, u: f64) -> Draft {
        match self.lanes(nm) {
            Ok(lanes) => Draft { lanes, u, reach: lanes.reach(u) },
            Err(_) => {
                let lanes = MediumLanes { extinction: Lanes::ZERO, scattering: Lanes::ZERO };
                Draft { lanes, u, reach: f64::INFINITY }
            }
        }
    }

    /// What decides about flights where extinction is the same everywhere, as if the albedo were so, too, 1 or 0; else what varies.
    #[inline]
    fn lanes(&self, nm: Lanes) -> Result<MediumLanes, &Varying> {
        match &self.filling {
            Filling::Even { absorption, scattering } => {
                let scattering = scattering.eval(nm);
                Ok(MediumLanes { extinction: absorption.eval(nm) + scattering, scattering })
            }
            Filling::EvenExtinction { extinction, scatters, .. } => {
                let extinction = extinction.eval(nm);
                Ok(MediumLanes { extinction, scattering: if *scatters { extinction } else { Lanes::ZERO } })
            }
            Filling::Varying(varying) => Err(varying),
        }
    }

    /// The flight of `draft` along `ray` toward a surface at `distance`, infinite where there is none within its reach;
    /// `walk` decides what `draft` does not.
    #[must_use]
    #[inline]
    pub fn arrive(
        &self,
        draft: &Draft,
        ray: &Ray,
        distance: f64,
        nm: Lanes,
        walk: impl FnOnce() -> Walk,
    ) -> FreeFlight {
        match &self.filling {
            Filling::Even { .. } => draft.lanes.arrive(distance, draft.reach),
            Filling::EvenExtinction { albedo, .. } => {
                let mut flight = draft.lanes.arrive(distance, draft.reach);
                if let Some(t) = flight.scattered_at {
                    flight.weight *= albedo.eval(ray.at(t), nm);
                }
                flight
            }
            Filling::Varying(varying) => varying.fly(ray, distance, nm, draft.u, walk()),
        }
    }

    /// What light keeps over `distance` along `ray`.
    #[must_use]
    #[inline]
    pub fn dim(&self, ray: &Ray, distance: f64, nm: Lanes, walk: impl FnOnce() -> Walk) -> Dimmed {
        let (dimmed, scatters) = match self.lanes(nm) {
            Ok(lanes) => {
                let through = lanes.transmittance(distance);
                (Dimmed { through, passing: through }, lanes.scatters())
            }
            Err(varying) => (varying.dim(ray, distance, nm, walk()), varying.scatters),
        };
        if scatters { dimmed } else { Dimmed { passing: Lanes::ONE, ..dimmed } }
    }

    /// Whether paths look for lamps with rays of their own where it scatters them.
    #[must_use]
    pub fn asks_lights(&self) -> bool {
        self.shadow_rays && self.scatters()
    }

    /// Whether it scatters light.
    #[must_use]
    pub fn scatters(&self) -> bool {
        match &self.filling {
            Filling::Even { scattering, .. } => !scattering.is_black(),
            Filling::EvenExtinction { scatters, .. } => *scatters,
            Filling::Varying(varying) => varying.scatters,
        }
    }

    /// Where along `ray`, which meets a surface at `distance`, it may be; empty where the second is not greater.
    #[must_use]
    pub fn span(&self, ray: &Ray, distance: f64) -> (f64, f64) {
        match &self.filling {
            Filling::Varying(varying) => varying.bounds.span(ray, distance),
            Filling::Even { .. } | Filling::EvenExtinction { .. } => (0.0, distance),
        }
    }

    /// σ_s at `t` metres along `ray`, and about the density with which a flight ends there whose lanes lead by `rho`, 1/m:
    /// that itself where extinction is the same everywhere, and what it is where little lies before, elsewhere.
    #[must_use]
    pub fn scattering_at(&self, ray: &Ray, t: f64, nm: Lanes, rho: Lanes) -> (Lanes, f64) {
        let point = ray.at(t);
        let (scattering, density) = match self.lanes(nm) {
            Ok(lanes) => {
                let albedo = match &self.filling {
                    Filling::EvenExtinction { albedo, .. } => albedo.eval(point, nm),
                    _ => Lanes::ONE,
                };
                (lanes.scattering * albedo, lanes.extinction * lanes.transmittance(t))
            }
            Err(varying) => {
                let extinction = varying.extinction.eval(point, nm) * varying.scale;
                (extinction * varying.albedo.eval(point, nm), extinction)
            }
        };
        (scattering, f64::from((rho * density).reduce_add() / rho.reduce_add()))
    }

    /// How far from a lamp without extent at `point` a white wall shows as much of it as this medium: metres; infinite where
    /// the medium is not, or scatters nothing.
    ///
    /// A ray that passes a lamp of intensity I at the distance d meets ∫ σ_s I / (4π r²) dt = σ_s I / 4d of it, at a mean free
    /// path σ_s σ_t I / 4; a wall at r shows I / (π r²). Of what varies both are as where it is densest, and all is scattered.
    #[must_use]
    pub fn glows_like_a_wall_at(&self, point: DVec3) -> f64 {
        let (scattering, extinction) = match &self.filling {
            Filling::Even { absorption, scattering } => (scattering.max(), absorption.max() + scattering.max()),
            Filling::EvenExtinction { extinction, scatters: true, .. } => (extinction.max(), extinction.max()),
            Filling::Varying(varying) if varying.scatters && varying.bounds.holds(point) => {
                let most = f64::from(varying.scale) * varying.bounds.global;
                (most, most)
            }
            Filling::EvenExtinction { .. } | Filling::Varying(_) => (0.0, 0.0),
        };
        2.0 / (PI * scattering * extinction).sqrt()
    }

    /// Whether it is the same everywhere and scatters nothing.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        !matches!(self.filling, Filling::Varying(_)) && !self.scatters()
    }

    /// What light keeps over `distance` in a medium that [is clear](Medium::is_clear): exp(−σ_a `distance`). None of another.
    #[must_use]
    pub fn clear(&self, distance: f64, nm: Lanes) -> Option<Lanes> {
        let lanes = self.lanes(nm).ok().filter(|_| self.is_clear());
        lanes.map(|lanes| lanes.transmittance(distance))
    }

    /// Whether light at some wavelengths does not come through an endless way in it.
    #[must_use]
    pub fn is_opaque_at_infinity(&self) -> bool {
        match &self.filling {
            Filling::Even { absorption, scattering } => !(absorption.is_black() && scattering.is_black()),
            Filling::EvenExtinction { extinction, .. } => !extinction.is_black(),
            // It has an end.
            Filling::Varying(_) => false,
        }
    }

    /// Whether flights depend on wavelength: light is scattered, and extinction is not grey.
    #[must_use]
    pub fn is_chromatic(&self) -> bool {
        match &self.filling {
            Filling::Even { absorption, scattering } => {
                !(absorption.is_constant() && scattering.is_constant()) && scattering.max() > 0.0
            }
            Filling::EvenExtinction { extinction, scatters, .. } => *scatters && !extinction.is_constant(),
            Filling::Varying(varying) => varying.scatters && varying.extinction.is_chromatic(),
        }
    }
}

/// Below this a shadow ray goes on by chance only, with a sixteenth of what it has left made one.
const FAINT: f32 = 1.0 / 16.0;

impl Varying {
    /// A medium of extinction `scale` · `extinction`.
    #[must_use]
    pub fn new(extinction: Volume, scale: f64, albedo: Volume) -> Varying {
        let bounds = Bounds::new(&extinction);
        let scatters = albedo.max() > 0.0;
        Varying { extinction, scale: scale as f32, albedo, bounds, scatters }
    }

    /// Mean free paths across it where it is densest: as many steps a ray may take that finds next to nothing on its way.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        f64::from(self.scale) * self.bounds.thickness()
    }

    #[inline(never)]
    fn fly(&self, ray: &Ray, distance: f64, nm: Lanes, u: f64, mut walk: Walk) -> FreeFlight {
        if !self.scatters {
            let through = self.dim(ray, distance, nm, walk).through;
            return FreeFlight { scattered_at: None, weight: through, ratio: Lanes::ONE, density: 1.0 };
        }
        let mut flight = FreeFlight { scattered_at: None, weight: Lanes::ONE, ratio: Lanes::ONE, density: 1.0 };
        // Optical depth, under the bound, up to the next tentative collision.
        let mut left = -libm::log1p(-u);
        for stretch in self.bounds.march(ray, distance) {
            let bound = stretch.bound * f64::from(self.scale);
            if bound <= 0.0 {
                continue;
            }
            let mut t = stretch.from;
            loop {
                let depth = bound * (stretch.to - t);
                if left >= depth {
                    left -= depth;
                    break;
                }
                t += left / bound;
                let real = self.extinction.eval(ray.at(t), nm) * (f64::from(self.scale) / bound) as f32;
                let hero = real.to_array()[0];
                if walk.draw() < f64::from(hero) {
                    let ratio = real / hero;
                    flight.scattered_at = Some(t);
                    flight.weight *= ratio * self.albedo.eval(ray.at(t), nm);
                    flight.ratio *= ratio;
                    flight.density *= f64::from(hero);
                    return flight;
                }
                let nothing = (Lanes::ONE - real).max(Lanes::ZERO);
                let hero = nothing.to_array()[0];
                let ratio = nothing / hero;
                flight.weight *= ratio;
                flight.ratio *= ratio;
                flight.density *= f64::from(hero);
                left = walk.exponential();
            }
        }
        flight
    }

    #[inline(never)]
    fn dim(&self, ray: &Ray, distance: f64, nm: Lanes, mut walk: Walk) -> Dimmed {
        let mut dimmed = Dimmed { through: Lanes::ONE, passing: Lanes::ONE };
        let mut left = walk.exponential();
        for stretch in self.bounds.march(ray, distance) {
            let bound = stretch.bound * f64::from(self.scale);
            if bound <= 0.0 {
                continue;
            }
            let mut t = stretch.from;
            loop {
                let depth = bound * (stretch.to - t);
                if left >= depth {
                    left -= depth;
                    break;
                }
                t += left / bound;
                let real = self.extinction.eval(ray.at(t), nm) * (f64::from(self.scale) / bound) as f32;
                let nothing = (Lanes::ONE - real).max(Lanes::ZERO);
                dimmed.through *= nothing;
                dimmed.passing *= nothing;
                // The probabilities of the path are those of the way alone, whatever chance decides here.
                let brightest = dimmed.through.to_array().into_iter().fold(0.0f32, f32::max);
                if brightest < FAINT {
                    if walk.draw() * f64::from(FAINT) >= f64::from(brightest) {
                        return Dimmed { through: Lanes::ZERO, ..dimmed };
                    }
                    dimmed.through *= FAINT / brightest;
                }
                left = walk.exponential();
            }
        }
        dimmed
    }
}

/// Which way a medium scatters, at each of its points.
#[derive(Clone, Debug)]
pub enum PhaseFunction {
    /// The same everywhere.
    One(Phase),
    /// A share of one and the rest of another.
    Blend(Box<PhaseBlend>),
}

/// Two phase functions and their shares.
#[derive(Clone, Debug)]
pub struct PhaseBlend {
    /// Share of the second, clamped to [0, 1].
    pub weight: Volume,
    /// What is blended.
    pub parts: [PhaseFunction; 2],
}

impl PhaseFunction {
    /// Density in sr⁻¹ of scattering from `wo` to `wi`, both leaving `point`.
    #[must_use]
    pub fn eval(&self, point: DVec3, wo: DVec3, wi: DVec3) -> f64 {
        match self {
            PhaseFunction::One(phase) => phase.eval(wo, wi),
            PhaseFunction::Blend(blend) => {
                let weight = blend.weight.scalar(point).clamp(0.0, 1.0);
                let part = |i: usize| blend.parts[i].eval(point, wo, wi);
                if weight == 0.0 {
                    part(0)
                } else if weight == 1.0 {
                    part(1)
                } else {
                    part(0) * (1.0 - weight) + part(1) * weight
                }
            }
        }
    }

    /// A direction with density [`PhaseFunction::eval`]. The part is chosen by `u.x`, which is then stretched to
    /// [0, 1) again.
    #[must_use]
    pub fn sample(&self, point: DVec3, wo: DVec3, u: DVec2) -> DVec3 {
        let (mut part, mut u) = (self, u);
        loop {
            match part {
                PhaseFunction::One(phase) => return phase.sample(wo, u),
                PhaseFunction::Blend(blend) => {
                    let weight = blend.weight.scalar(point).clamp(0.0, 1.0);
                    if u.x < weight {
                        part = &blend.parts[1];
                        u.x /= weight;
                    } else {
                        part = &blend.parts[0];
                        u.x = (u.x - weight) / (1.0 - weight);
                    }
                    // Rounding may reach one.
                    u.x = u.x.min(1.0 - f64::EPSILON);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{Sampler, Set};
    use crate::scene::texture::Wrap;
    use crate::scene::volume::{Between, GridVolume, Voxels};
    use crate::spectrum::Carried;
    use glam::DAffine3;
    use std::f64::consts::PI;
    use std::sync::{Arc, OnceLock};

    /// A density along x by its values at `values.len()` even steps, constant in y and z, in the unit cube.
    fn along_x(values: &[f32]) -> Volume {
        Volume::Grid(Arc::new(GridVolume {
            size: [values.len(), 1, 1],
            values: Voxels::Grey(values.into()),
            local_from_world: DAffine3::IDENTITY,
            between: Between::Trilinear,
            wrap: Wrap::Clamp,
            above_one: false,
            clamped: false,
            brightest: OnceLock::new(),
        }))
    }

    fn grey(value: f64) -> Volume {
        Volume::Constant { value: Spectrum::constant(value), local_from_world: DAffine3::IDENTITY }
    }

    fn along(medium: Varying) -> Medium {
        Medium {
            filling: Filling::Varying(Box::new(medium)),
            phase: PhaseFunction::One(Phase::Isotropic),
            shadow_rays: true,
        }
    }

    const NM: [f32; 8] = [389.375, 448.125, 506.875, 565.625, 624.375, 683.125, 741.875, 800.625];

    /// exp(−∫σ) of a density that falls, vanishes over four blocks and rises: 64 values, linear between, held over
    /// the outer half voxels, so the integral is their mean. Both estimators are means of 100,000 values within [0, 16]
    /// with standard error below (they are bounded by 1 but for the roulette, which starts below 1/16).
    #[test]
    fn transmittance_is_the_exponential_of_the_integral() {
        let values: Vec<f32> = (0..64).map(|i| ((i as f32 - 32.0).abs() - 16.0).max(0.0) / 4.0).collect();
        let sigma = f64::from(values.iter().sum::<f32>()) / 64.0;
        let expected = (-sigma * 2.0).exp();
        let ray = Ray::new(DVec3::new(-1.0, 0.5, 0.5), DVec3::X);
        let n = 100_000u32;
        for albedo in [0.0, 0.5] {
            let medium = along(Varying::new(along_x(&values), 2.0, grey(albedo)));
            let (mut dimmed, mut flown, mut square) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let sampler = Sampler::new(1, [0, 0], 0, i);
                let walk = || sampler.walk(Set::Extra(1));
                let through = f64::from(medium.dim(&ray, 10.0, Lanes::new(NM), walk).through.to_array()[3]);
                dimmed += through / f64::from(n);
                square += through * through / f64::from(n);
                let flight = medium
                    .fly(&ray, 10.0, Lanes::new(NM), sampler.set(Set::Choice(0))[3], || sampler.walk(Set::Extra(2)));
                if flight.scattered_at.is_none() {
                    flown += f64::from(flight.weight.to_array()[3]) / f64::from(n);
                }
            }
            let error = ((square - dimmed * dimmed) / f64::from(n)).sqrt();
            assert!((dimmed - expected).abs() < 4.0 * error, "{dimmed} ± {error}, {expected}");
            let error = (expected * (1.0 - expected) / f64::from(n)).sqrt();
            assert!((flown - expected).abs() < 4.0 * error, "{flown} ± {error}, {expected}");
        }
    }

    /// Flights end where the density says: in a medium of density 3x the cumulated share at x is
    /// 1 − exp(−3x²/2), compared at ten places; n·share has standard deviation below √n / 2.
    #[test]
    fn flights_end_by_the_density() {
        // Values 3 (i + ½)/256 at the centres; half a voxel at either end is held, which moves x² by 4e-6.
        let values: Vec<f32> = (0..256).map(|i| 3.0 * (i as f32 + 0.5) / 256.0).collect();
        let medium = along(Varying::new(along_x(&values), 1.0, grey(1.0)));
        let ray = Ray::new(DVec3::new(0.0, 0.5, 0.5), DVec3::X);
        let n = 40_000u32;
        let mut ends: Vec<f64> = (0..n)
            .map(|i| {
                let sampler = Sampler::new(2, [0, 0], 0, i);
                let u = sampler.walk(Set::Extra(9)).draw();
                let flight = medium.fly(&ray, 10.0, Lanes::new(NM), u, || sampler.walk(Set::Extra(0)));
                flight.scattered_at.unwrap_or(f64::INFINITY)
            })
            .collect();
        ends.sort_by(f64::total_cmp);
        for i in 1..=10 {
            let x = f64::from(i) / 10.0;
            let found = ends.partition_point(|end| *end < x) as f64;
            let expected = f64::from(n) * (1.0 - (-1.5 * x * x).exp());
            assert!((found - expected).abs() < 4.0 * 0.5 * f64::from(n).sqrt(), "{x}: {found} {expected}");
        }
    }

    /// With a colour in every voxel each lane keeps its own law: the expected weight of coming through is
    /// exp(−σ_λ d), that of scattering (albedo one) the rest, with the densities of all lanes in the denominator and
    /// every lane as hero.
    #[test]
    fn every_lane_gets_its_own_law() {
        let colours = vec![[0.9f32, 0.3, 0.1]; 8];
        let volume = Volume::Grid(Arc::new(GridVolume {
            size: [2, 2, 2],
            values: Voxels::upsampled(&colours, Carried::Spectra),
            local_from_world: DAffine3::IDENTITY,
            between: Between::Trilinear,
            wrap: Wrap::Clamp,
            above_one: false,
            clamped: false,
            brightest: OnceLock::new(),
        }));
        let medium = along(Varying::new(volume.clone(), 2.0, grey(1.0)));
        assert!(medium.is_chromatic());
        let ray = Ray::new(DVec3::new(-1.0, 0.4, 0.3), DVec3::X);
        let (mut through, mut scattered, n) = ([0.0f64; 8], [0.0f64; 8], 20_000u32);
        for rotation in 0..8 {
            let nm = Lanes::new(std::array::from_fn(|k| NM[(k + rotation) % 8]));
            for i in 0..n {
                let sampler = Sampler::new(3, [rotation as u32, 0], 0, i);
                let flight = medium.fly(&ray, 10.0, nm, sampler.set(Set::Choice(0))[3], || sampler.walk(Set::Extra(0)));
                let share = (flight.weight / flight.ratio.reduce_add()).to_array();
                let sums = if flight.scattered_at.is_some() { &mut scattered } else { &mut through };
                for k in 0..8 {
                    sums[(k + rotation) % 8] += f64::from(share[k]) / f64::from(n);
                }
            }
        }
        let sigma = volume.eval(DVec3::splat(0.5), Lanes::new(NM)).to_array();
        for k in 0..8 {
            let t = (-2.0 * f64::from(sigma[k])).exp();
            // Each share is at most 1, so the sum over eight heroes of n has a standard error below √8 / √n / 2.
            let bound = 4.0 * 0.5 * 8f64.sqrt() / f64::from(n).sqrt();
            assert!((through[k] - t).abs() < bound, "lane {k}: {} {t}", through[k]);
            assert!((scattered[k] - (1.0 - t)).abs() < bound, "lane {k}: {} {t}", scattered[k]);
        }
    }

    /// A nest of blends, one by a volume: its density integrates to one at each point, and the mean cosine of sampled
    /// directions is the blend of the means.
    #[test]
    fn blended_phase_functions_are_blends() {
        let inner = PhaseBlend {
            weight: along_x(&[0.0, 1.0]),
            parts: [PhaseFunction::One(Phase::HenyeyGreenstein(-0.5)), PhaseFunction::One(Phase::Rayleigh)],
        };
        let blend = PhaseFunction::Blend(Box::new(PhaseBlend {
            weight: grey(0.3),
            parts: [PhaseFunction::One(Phase::HenyeyGreenstein(0.8)), PhaseFunction::Blend(Box::new(inner))],
        }));
        let wo = DVec3::new(0.0, 0.6, 0.8);
        for (x, share) in [(0.1, 0.0), (0.5, 0.5), (0.9, 1.0)] {
            let point = DVec3::new(x, 0.5, 0.5);
            let expected = 0.7 * 0.8 + 0.3 * (1.0 - share) * -0.5;
            let (mut cos, mut integral, n) = (0.0, 0.0, 256u32);
            for i in 0..n * n {
                let u = DVec2::new((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
                cos += -wo.dot(blend.sample(point, wo, u)) / f64::from(n * n);
                let wi = crate::math::warp::uniform_sphere(u);
                integral += blend.eval(point, wo, wi) * 4.0 * PI / f64::from(n * n);
            }
            // 256 strata of u.x over parts of steep slope: dcos/du is below 40 at the peak, second order elsewhere.
            assert!((cos - expected).abs() < 2e-3, "{x}: {cos} {expected}");
            assert!((integral - 1.0).abs() < 1e-3, "{x}: {integral}");
        }
    }
}
