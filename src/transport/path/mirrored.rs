//! Lamps that glass and the coats of plastics mirror, in one direction of several that a path may go on in.
//!
//! A path that is mirrored by chance, with the probability F of a few hundredths, and meets a lamp brings all of its radiance L: a
//! variance of F L² a path. Where the mirrored direction leads to a lamp, or into a sun, F L is added at every vertex instead, and
//! what goes on in that direction leaves the lamp out. What leads there is told without chance, so that the mean is the same.

use super::{Leaving, Path, Tracer};
use crate::math::Ray;
use crate::optics::bsdf::Lobes;
use crate::scene::{Hit, Inside};
use crate::spectrum::Lanes;
use crate::transport::shadow::Shadow;
use glam::DVec3;

impl Tracer<'_> {
    /// Adds the light of the lamp that a vertex mirrors, and tells which; `None` where there is none, or where chance does not decide
    /// whether it is mirrored.
    #[inline(always)]
    pub(super) fn look_at_mirrored<const CHROMATIC: bool, const MEDIA: bool, B: Lobes>(
        &self,
        path: &mut Path,
        bsdf: &B,
        wo: DVec3,
        at: &Leaving,
    ) -> Option<u32> {
        if !bsdf.may_mirror() || at.pane || !self.scene.shines_on_rays || !self.looks_and_meets() {
            return None;
        }
        let wi = at.frame.to_world(DVec3::new(-wo.x, -wo.y, wo.z));
        let ray = self.scene.leave(at.surface, at.hit, wi);
        let sun = || self.scene.backgrounds.iter().copied().find(|&i| self.scene.lights[i as usize].stands_out(wi));
        let sun = if self.scene.lamps.may_be_met(&ray) { None } else { Some(sun()?) };
        self.add_mirrored::<CHROMATIC, MEDIA>(path, &ray, sun, || bsdf.mirrored(wo), at)
    }

    /// Adds the light of the first lamp along `ray`, in the mirrored direction of a vertex, or else of the `sun`.
    #[inline(never)]
    fn add_mirrored<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        ray: &Ray,
        sun: Option<u32>,
        mirrored: impl FnOnce() -> Option<Lanes>,
        at: &Leaving,
    ) -> Option<u32> {
        let scene = self.scene;
        // As a path that goes on there: neither side is the other's.
        let geometric = ray.direction.dot(at.surface.normal) * if at.flip { -1.0 } else { 1.0 };
        if geometric * ray.direction.dot(at.frame.n) <= 0.0 {
            return None;
        }
        let (lamp, emitted, distance, target) = match sun {
            Some(sun) => (sun, scene.lights[sun as usize].background(ray.direction, self.nm), f64::INFINITY, None),
            None => {
                let (last, hit, distance) = self.first_lamp(ray, self.panes(path))?;
                let lamp = scene.objects[hit.object as usize].light?;
                let surface = scene.surface(&last, &hit);
                let emitted = scene.lights[lamp as usize].emitted(&surface, &hit, -ray.direction, self.nm);
                (lamp, emitted, distance, Some(hit.departure()))
            }
        };
        let mut weight = mirrored()?;
        path.further += 1;
        if let Some(slopes) = at.slopes {
            weight *= slopes.shadowing(ray.direction) as f32;
        }
        // What is nearest is known to be reached.
        let reached = target.is_some() && !MEDIA && !scene.has_boundaries;
        let through = if reached {
            Some(Lanes::ONE)
        } else if emitted.simd_eq(Lanes::ZERO).all() {
            None
        } else {
            let bodies = at.crossing.map_or(path.inside.bodies, |crossing| crossing.here);
            let shadow = Shadow {
                scene,
                sampler: &self.sampler,
                nm: self.nm,
                vertex: path.vertices.wrapping_add(MIRRORED),
                inside: Inside { bodies, ..path.inside },
                panes: self.panes(path),
                target,
                past_lamps: false,
                to_viewer: false,
            };
            shadow.cast::<MEDIA>(ray, distance).map(|(through, _)| through)
        };
        if let Some(through) = through {
            let found = weight * emitted * through;
            if self.leaves(path, lamp) {
                path.leave_out::<CHROMATIC>(found, 1.0);
            } else {
                let share = path.share_of::<CHROMATIC>(found, 1.0);
                path.radiance += share;
                if let Some(ledger) = self.ledger {
                    ledger.mirrored(path.vertices, self.found(path, share, lamp));
                }
            }
        }
        Some(lamp)
    }

    /// The first lamp along `ray`, behind at most so many panes: where its last stretch begins, where it is met, and how far it is
    /// in all.
    fn first_lamp(&self, ray: &Ray, panes: u32) -> Option<(Ray, Hit, f64)> {
        let scene = self.scene;
        let (mut ray, mut before) = (*ray, 0.0);
        for _ in 0..=panes {
            let hit = scene.closest(&ray, f64::INFINITY)?;
            if scene.objects[hit.object as usize].light.is_some() {
                return Some((ray, hit, before + hit.t));
            }
            if !scene.has_boundaries || !scene.lets_through(hit.object) {
                return None;
            }
            before += hit.t;
            ray = scene.leave(&scene.surface(&ray, &hit), &hit, ray.direction);
        }
        None
    }
}

/// Sets the numbers of these shadow rays apart from those of vertices.
const MIRRORED: u32 = 1 << 26;
