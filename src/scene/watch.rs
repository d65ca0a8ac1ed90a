//! What robust arithmetic was needed for, counted where `abbe render --check-numerics` asks for it.
//!
//! The textbook intersector in single precision ([`plain`]) is asked about the same rays. Where it
//! finds nothing of a surface that a path met, light would have leaked; where it finds the face that a ray leaves, ahead
//! of anything that is there, the ray would have hit its own origin: what other renderers keep an epsilon for. Triangles
//! and analytic shapes are judged, in place; children of instances, curves and distance grids are counted as met only.

use super::shape::plain;
use super::{Geometry, Hit, Scene};
use crate::math::{Departure, Ray};
use glam::DVec3;
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

/// The corners of a triangle in the world.
fn corners(mesh: &super::TriangleMesh, triangle: u32) -> [DVec3; 3] {
    mesh.mesh.vertices(triangle).map(|v| mesh.mesh.origin + v)
}

/// Whether single precision finds nothing of the object at all on `ray`.
fn is_missed(scene: &Scene, ray: &Ray, hit: &Hit) -> bool {
    if hit.instance.is_some() {
        return false;
    }
    let (origin, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
    match &scene.objects[hit.object as usize].geometry {
        Geometry::Shape(shape) => shape.plain().intersect(origin, direction, 0.0, f32::INFINITY).is_none(),
        Geometry::Mesh(mesh) => {
            let corners = corners(mesh, hit.part).map(|v| v.as_vec3());
            plain::triangle(corners, origin, direction, 0.0, f32::INFINITY).is_none()
        }
        Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => false,
    }
}

/// Whether single precision meets the face that `ray` leaves where the ray does not come back to it.
fn is_met_again(scene: &Scene, ray: &Ray, departure: Departure) -> bool {
    if departure.instance.is_some() {
        return false;
    }
    let (origin, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
    match &scene.objects[departure.object as usize].geometry {
        Geometry::Shape(shape) => {
            let met = shape.plain().intersect(origin, direction, 0.0, f32::INFINITY);
            let far = shape.intersect(ray, f64::INFINITY, Some(departure.part as u8));
            // The root at the origin is nothing but rounding; the far one is the same in both.
            met.is_some_and(|(t, _)| far.is_none_or(|far| f64::from(t) < 0.5 * far.t))
        }
        Geometry::Mesh(mesh) => {
            let corners = corners(mesh, departure.part).map(|v| v.as_vec3());
            plain::triangle(corners, origin, direction, 0.0, f32::INFINITY).is_some()
        }
        Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => false,
    }
}
