//! Light that lamps throw onto the way through a medium: found at distances that are drawn toward them
//! ([`crate::scene::equiangular`]) as well as at the ends of flights, and weighed by the power heuristic. What is scattered there by
//! its phase function may meet a lamp with extent, too, which counts for nothing: shadow rays find all of it.

use super::lights::power_heuristic;
use super::{Path, Tracer};
use crate::math::Ray;
use crate::math::sampler::Set;
use crate::scene::equiangular::{Lamp, Seen};
use crate::scene::light::free;
use crate::scene::medium::Medium;
use crate::spectrum::Lanes;
use crate::transport::shadow::Shadow;
use crate::transport::ways::First;
use glam::DVec2;

/// How much larger than the share of light that is left to it the chance of such a shadow ray is.
const SPARED: f64 = 4.0;

/// Sets the numbers of these shadow rays apart from those of vertices.
const ALONG: u32 = 1 << 27;

/// The way of a path through a medium to the next surface.
pub(super) struct Along<'a> {
    medium: &'a Medium,
    ray: Ray,
    /// What the lanes lead by.
    rho: Lanes,
    /// What lamps see of it.
    seen: Seen,
    /// How often the end of a flight there asks for light.
    times: u32,
}

impl Tracer<'_> {
    /// Whether light is looked for along the way of the path through `medium`.
    pub(super) fn looks_along(&self, path: &Path, medium: &Medium) -> bool {
        self.plan.near_lamps > 0 && medium.asks_lights() && self.settings.light_samples > 0 && !self.is_last(path)
    }

    /// The lamps whose light is looked for. While the shutter is open some may be dark.
    fn near_lamps(&self) -> &[Lamp] {
        let near = &self.scene.near_lamps;
        &near[..near.len().min(self.plan.near_lamps)]
    }

    /// The way of `path` through `medium` to a surface at `distance`.
    pub(super) fn along<'a>(&self, path: &Path, medium: &'a Medium, distance: f64) -> Along<'a> {
        let seen = Seen::of(self.near_lamps(), &path.ray, medium.span(&path.ray, distance));
        Along { medium, ray: path.ray, rho: path.rho, seen, times: self.shadow_rays(path) }
    }

    /// Light of one lamp that is scattered at one point of the way, behind so many `crossings` since the last vertex.
    pub(super) fn ask_along<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        along: &Along,
        crossings: u32,
    ) {
        let Along { medium, ray, seen, .. } = along;
        let scene = self.scene;
        let set = Set::Along(path.vertices.wrapping_add(crossings << 16));
        let [u_light, u_distance, u, v] = self.sampler.set(set);
        let Some((lamp, t, drawn)) = seen.sample(u_light, u_distance) else { return };
        let point = ray.at(t);
        let (scattering, by_flight) = self.flight(along, t, lamp);
        if scattering.simd_eq(Lanes::ZERO).all() {
            return;
        }
        // Where flights find nearly all of it few such rays are sent.
        let mut walk = self.sampler.walk(set);
        let share = power_heuristic(drawn, by_flight);
        let chance = (SPARED * share).min(1.0);
        if walk.draw() >= chance {
            return;
        }
        let light = &scene.lights[lamp as usize];
        let arriving = light.arriving(&scene.objects, point, None, DVec2::new(u, v), self.drawn(), self.nm);
        let Some(arriving) = arriving else { return };
        let phase = medium.phase.eval(point, -ray.direction, arriving.wi);
        let value = scattering * medium.dim(ray, t, self.nm, || walk).through * arriving.radiance * phase as f32;
        if value.simd_eq(Lanes::ZERO).all() {
            return;
        }
        path.further += 1;
        let shadow = Shadow {
            scene,
            sampler: &self.sampler,
            nm: self.nm,
            vertex: path.vertices.wrapping_add(ALONG),
            inside: path.inside,
            panes: self.panes(path),
            target: arriving.target,
            past_lamps: false,
            to_viewer: false,
        };
        let toward = Ray::new(point, arriving.wi);
        let distance = free(arriving.distance, arriving.target, point, &toward);
        let Some((open, _)) = shadow.cast::<MEDIA>(&toward, distance) else { return };
        let density = chance * drawn * arriving.density.unwrap_or(1.0);
        let found = path.share_of::<CHROMATIC>(value * open, share / density);
        if let Some(ledger) = self.ledger {
            ledger.meet(false);
        }
        self.enter(path, found, lamp as usize, || First::Media);
    }

    /// The share of the light of `lamp` that is left to shadow rays from a flight which ended `t` metres on the way; `None` where
    /// distances are not drawn toward it.
    pub(super) fn share_of_flight(&self, along: &Along, t: f64, lamp: u32) -> Option<f64> {
        if !self.near_lamps().iter().any(|near| near.light == lamp) {
            return None;
        }
        let drawn = along.seen.density(lamp, t);
        Some(if drawn > 0.0 { power_heuristic(self.flight(along, t, lamp).1, drawn) } else { 1.0 })
    }

    /// Whether `light`, which the path has met with a chance that shadow rays have, too, is left to them.
    pub(super) fn is_left_to_shadow_rays(&self, light: u32) -> bool {
        self.near_lamps().iter().any(|near| near.light == light && near.has_extent)
    }

    /// σ_s `t` metres on the way, and the density with which flights end there and ask `lamp`, 1/m.
    fn flight(&self, along: &Along, t: f64, lamp: u32) -> (Lanes, f64) {
        let Along { medium, ray, rho, times, .. } = along;
        let (scattering, density) = medium.scattering_at(ray, t, self.nm, *rho);
        let point = ray.at(t);
        let judged = self.asked().asker(point, None).judged();
        let asked = self.asked().probability(lamp as usize, point, None, judged);
        (scattering, density * asked * f64::from(*times))
    }
}
