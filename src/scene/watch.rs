//! What robust arithmetic was needed for, counted where `abbe render --check-numerics` asks for it.
//!
//! Textbook intersectors in single precision are asked about the same rays: [`plain`] of shapes and triangles,
//! `sdf/plain.rs` of cells of distance grids, `curves/plain.rs` of segments of curves; of children of instances in the
//! group's space, where the ray comes by the inverse map in single precision. Where they find nothing of a surface that
//! a path met, light would have leaked. Where they find what a ray leaves, ahead of anything that is there, the ray would
//! have hit its own origin: what other renderers keep an epsilon for. A curve is met only from outside, so that only a
//! ray that goes through it does so: one that rounding puts before the surface that it was to be behind.
//!
//! A triangle, cell or segment is judged by itself: a ray that slips over its edge counts as one that misses, though its
//! neighbour may catch it.

use super::shape::plain;
use super::{Geometry, Hit, Scene};
use crate::math::{Departure, Ray};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

/// What was counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Surfaces that were met.
    pub surfaces: u64,
    /// Of them, those which textbook arithmetic in single precision misses on the same ray.
    pub robust: u64,
    /// Rays that left a surface.
    pub rays: u64,
    /// Of them, those which in single precision meet the face that they left, where nothing is.
    pub self_hits: u64,
}

thread_local! {
    /// Since the last [`take`] on this thread.
    static RECENT: Cell<Counts> = const { Cell::new(Counts { surfaces: 0, robust: 0, rays: 0, self_hits: 0 }) };
}

/// What was counted on this thread since the last call.
#[must_use]
pub fn take() -> Counts {
    RECENT.take()
}

/// Sums over all threads.
#[derive(Debug, Default)]
pub struct Watch {
    surfaces: AtomicU64,
    robust: AtomicU64,
    rays: AtomicU64,
    self_hits: AtomicU64,
}

impl Watch {
    /// The sums so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let of = |sum: &AtomicU64| sum.load(Ordering::Relaxed);
        Counts {
            surfaces: of(&self.surfaces),
            robust: of(&self.robust),
            rays: of(&self.rays),
            self_hits: of(&self.self_hits),
        }
    }

    /// Does `work` and counts nothing of it. Nothing else is traced meanwhile.
    pub fn aside<T>(&self, work: impl FnOnce() -> T) -> T {
        let Counts { surfaces, robust, rays, self_hits } = self.counts();
        let done = work();
        for (sum, before) in
            [(&self.surfaces, surfaces), (&self.robust, robust), (&self.rays, rays), (&self.self_hits, self_hits)]
        {
            sum.store(before, Ordering::Relaxed);
        }
        done
    }

    /// A surface was met.
    #[cold]
    #[inline(never)]
    pub(super) fn met(&self, scene: &Scene, ray: &Ray, hit: &Hit) {
        let robust = u64::from(is_missed(scene, ray, hit));
        self.surfaces.fetch_add(1, Ordering::Relaxed);
        self.robust.fetch_add(robust, Ordering::Relaxed);
        let recent = RECENT.get();
        RECENT.set(Counts { surfaces: recent.surfaces + 1, robust: recent.robust + robust, ..recent });
    }

    /// A ray left a surface.
    #[cold]
    #[inline(never)]
    pub(super) fn left(&self, scene: &Scene, ray: &Ray) {
        let again = u64::from(ray.departure.is_some_and(|departure| is_met_again(scene, ray, departure)));
        self.rays.fetch_add(1, Ordering::Relaxed);
        self.self_hits.fetch_add(again, Ordering::Relaxed);
        let recent = RECENT.get();
        RECENT.set(Counts { rays: recent.rays + 1, self_hits: recent.self_hits + again, ..recent });
    }
}

/// A ray in the space of an object, as robust arithmetic has it and in single precision.
struct Local {
    robust: Ray,
    origin: Vec3,
    direction: Vec3,
}

/// `ray` of the world in the space of the objects of `instance`, if it is one.
fn enter(scene: &Scene, ray: &Ray, instance: Option<u32>) -> Local {
    let (origin, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
    match instance.map(|i| &scene.objects[i as usize].geometry) {
        Some(Geometry::Instance(instance)) => {
            let (origin, direction) = instance.map.enter_plain(origin, direction);
            Local { robust: instance.map.enter(ray).0, origin, direction }
        }
        _ => Local { robust: *ray, origin, direction },
    }
}

impl Local {
    /// Where single precision meets a shape, or the one triangle, cell or segment `part`.
    fn meet(&self, geometry: &Geometry, part: u32) -> Option<f32> {
        let (origin, direction) = (self.origin, self.direction);
        match geometry {
            Geometry::Shape(shape) => shape.plain().intersect(origin, direction, 0.0, f32::INFINITY).map(|(t, _)| t),
            Geometry::Mesh(mesh) => {
                let corners = mesh.mesh.vertices(part).map(|v| (mesh.mesh.origin + v).as_vec3());
                plain::triangle(corners, origin, direction, 0.0, f32::INFINITY)
            }
            Geometry::Sdf(sdf) => sdf.meet_plain(part, origin, direction),
            Geometry::Curves(curves) => curves.meet_plain(part, origin, direction),
            // Its children are asked.
            Geometry::Instance(_) => None,
        }
    }
}

/// Whether single precision finds nothing of what was met, on the same ray.
fn is_missed(scene: &Scene, ray: &Ray, hit: &Hit) -> bool {
    let local = enter(scene, ray, hit.instance);
    local.meet(&scene.objects[hit.object as usize].geometry, hit.part).is_none()
}

/// Whether single precision meets the part that `ray` leaves where the ray does not come back to it.
fn is_met_again(scene: &Scene, ray: &Ray, departure: Departure) -> bool {
    let Departure { object, part, instance } = departure;
    let local = enter(scene, ray, instance);
    let geometry = &scene.objects[object as usize].geometry;
    let Some(t) = local.meet(geometry, part) else { return false };
    let far = match geometry {
        // A ray that leaves a triangle never comes back to it.
        Geometry::Mesh(_) => None,
        _ => geometry.meet(&local.robust, f64::INFINITY, Some(part)),
    };
    // The root at the origin is nothing but rounding; the far one is the same in both.
    far.is_none_or(|far| f64::from(t) < 0.5 * far.t)
}

#[cfg(test)]
mod tests;
