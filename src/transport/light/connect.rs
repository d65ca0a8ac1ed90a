//! From where a beam has come to into the camera.

use super::views::{Place, View};
use super::{Beam, LightPaths, Splat, Walk, adjoint};
use crate::math::Ray;
use crate::optics::bsdf::Bsdf;
use crate::scene::camera::Entry;
use crate::scene::light::free;
use crate::scene::{Inside, Medium};
use crate::spectrum::{LANES, Lanes};
use crate::transport::depth_fog;
use crate::transport::shadow::{MAX_BOUNDARIES, Shadow};
use glam::{DVec2, DVec3};

impl Walk<'_, '_> {
    /// Light that a surface sends into the camera.
    pub(super) fn connect(&mut self, beam: &Beam, bsdf: &Bsdf, at: &Place, view: &View, u_lens: DVec2) {
        let scene = self.paths.scene;
        let object = &scene.objects[at.hit.object as usize];
        if object.is_lamp && self.hides_lamps() {
            return;
        }
        let Some(entry) = scene.camera.entry(at.surface.point, || u_lens) else { return };
        if !self.paths.bounds.holds(entry.pixel) {
            return;
        }
        let view = if at.is_plain() { *view } else { at.seen_from(entry.direction) };
        let [local, to_camera] = [at.came, entry.direction].map(|direction| view.frame.to_local(direction));
        let (came, went) = (at.came.dot(at.surface.normal), entry.direction.dot(at.surface.normal));
        if view.facing(came) * local.z <= 0.0 || went == 0.0 {
            return;
        }
        // The viewer is at the camera: f as radiance has it.
        let f = bsdf.eval(to_camera, local).f;
        if f.simd_eq(Lanes::ZERO).all() {
            return;
        }
        let cosines = to_camera.z.abs() * adjoint(local.z, to_camera.z, came, went);
        let before = beam.inside();
        let inside = if came * went < 0.0 { scene.beyond(object, at.surface, entry.direction, before) } else { before };
        let ray = scene.leave(at.surface, at.hit, entry.direction);
        let light = f * (view.shadowing * (cosines * entry.density * self.unit_area) as f32);
        let distance = free(entry.distance, None, at.surface.point, &ray);
        self.send(beam, at.surface.point, &ray, inside, &Entry { distance, ..entry }, light);
    }

    /// Light that a point of a medium sends into the camera.
    pub(super) fn connect_medium(&mut self, beam: &Beam, point: DVec3, medium: &Medium, u_lens: DVec2) {
        let Some(entry) = self.paths.scene.camera.entry(point, || u_lens) else { return };
        if !self.paths.bounds.holds(entry.pixel) {
            return;
        }
        let f = medium.phase.eval(point, -beam.ray.direction, entry.direction);
        let light = Lanes::splat((f * entry.density * self.unit_area) as f32);
        self.send(beam, point, &Ray::new(point, entry.direction), beam.inside(), &entry, light);
    }

    /// Splats the light of a beam that is scattered by `light` into the camera, as far as it gets there.
    fn send(&mut self, beam: &Beam, point: DVec3, ray: &Ray, inside: Inside, entry: &Entry, light: Lanes) {
        let Some(through) = self.open(ray, entry.distance, inside, beam) else { return };
        let share = LANES as f32 / beam.rho.reduce_add();
        let clear = self.clear_through(point, ray, entry.distance, inside, beam.nm);
        let light = beam.only(beam.power * light * through * share * clear);
        (self.splat)(self.wavelengths, Splat { place: entry.pixel, light, alone: beam.alone, group: self.group });
    }

    /// What depth fog leaves of light from a point.
    pub(super) fn clear(&self, point: DVec3) -> f32 {
        depth_fog(self.paths.scene, self.paths.plan)
            .map_or(1.0, |fog| 1.0 - fog.falloff.amount(self.paths.scene.camera.depth(point)) as f32)
    }

    /// What depth fog leaves of light from a point that comes straight on to the camera at `distance` along `ray`: it is faded as the
    /// first thing is that the camera sees there. What goes through the holes of a material made of others passes that by.
    pub(super) fn clear_through(&self, point: DVec3, ray: &Ray, distance: f64, mut inside: Inside, nm: Lanes) -> Lanes {
        let LightPaths { scene, plan, .. } = *self.paths;
        let mut clear = Lanes::splat(self.clear(point));
        if depth_fog(scene, plan).is_none() || !scene.has_boundaries {
            return clear;
        }
        let (mut ray, mut left) = (*ray, distance);
        for _ in 0..=MAX_BOUNDARIES {
            let Some(hit) = scene.closest(&ray, left) else { break };
            let surface = scene.surface(&ray, &hit);
            let object = &scene.objects[hit.object as usize];
            let crossing = scene.crossing(object, &surface, ray.direction, &inside.bodies);
            if crossing.is_none_or(|crossing| crossing.shows) && !(object.is_lamp && self.hides_lamps()) {
                let material = &scene.materials[object.material as usize];
                let at = hit.texture_point(&surface);
                let open = material.open(&surface, -ray.direction, &at) as f32;
                let straight = material.straight(&surface, -ray.direction, || at, nm);
                let all = straight.map_or(Lanes::ZERO, |s| s.weight * s.share as f32);
                // Nothing comes through where all is zero.
                let seen =
                    (Lanes::ONE - Lanes::splat(open) / all.max(Lanes::splat(f32::MIN_POSITIVE))).max(Lanes::ZERO);
                clear += (Lanes::splat(self.clear(surface.point)) - clear) * seen;
            }
            inside = scene.beyond(object, &surface, ray.direction, inside);
            ray = scene.leave(&surface, &hit, ray.direction);
            left -= hit.t;
        }
        clear
    }

    /// The share of light that comes straight on to the camera at `distance`; `None` where something opaque stands
    /// between.
    pub(super) fn open(&mut self, ray: &Ray, distance: f64, inside: Inside, beam: &Beam) -> Option<Lanes> {
        let LightPaths { scene, plan, settings, .. } = *self.paths;
        self.rays += 1;
        let (sampler, nm, vertex) = (self.sampler, beam.nm, beam.vertex + 1);
        let panes = match settings.max_depth {
            Some(depth) if settings.count_crossings => depth.saturating_sub(beam.events() + 2).min(MAX_BOUNDARIES),
            _ => MAX_BOUNDARIES,
        };
        let past_lamps = self.hides_lamps();
        let shadow = Shadow { scene, sampler, nm, vertex, inside, panes, target: None, past_lamps, to_viewer: true };
        let tracked = plan.media || plan.nested;
        let came = if tracked { shadow.cast::<true>(ray, distance) } else { shadow.cast::<false>(ray, distance) };
        came.map(|(through, _)| through)
    }
}
