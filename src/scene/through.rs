//! All that a ray goes straight through on its way to a lamp, found in one search.
//!
//! Going from surface to surface costs a search each, front to back. What dims light on its way needs no such order:
//! one search lists all hits, or stops at the first thing that lets nothing through, and the list is sorted.

use super::shape::Detail;
use super::{Geometry, Hit, Scene};
use crate::math::{Departure, Ray};

/// Hits that are kept; a ray that crosses more goes from surface to surface.
const MOST: usize = 8;

/// What a ray meets on its way.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "it lies on the stack of one shadow ray")]
pub enum Way {
    /// Something that lets nothing through.
    Blocked,
    /// Only what lets light through: the hits, nearest first, with distances along the whole ray.
    Open(Crossed),
    /// More than a list holds.
    Long,
}

/// Hits in the order of their distance.
#[derive(Clone, Copy, Debug)]
pub struct Crossed {
    hits: [Hit; MOST],
    count: usize,
}

impl Crossed {
    /// The hits.
    #[must_use]
    pub fn hits(&self) -> &[Hit] {
        &self.hits[..self.count]
    }

    /// False where there is no room.
    fn push(&mut self, hit: Hit) -> bool {
        if self.count == MOST {
            return false;
        }
        let mut at = self.count;
        // At the same distance as the objects stand in the scene, however they were found.
        let place = |hit: &Hit| (hit.t, hit.object);
        while at > 0 && place(&self.hits[at - 1]) > place(&hit) {
            self.hits[at] = self.hits[at - 1];
            at -= 1;
        }
        self.hits[at] = hit;
        self.count += 1;
        true
    }
}

impl Scene {
    /// What `ray` meets before `distance`. `target` is the face or triangle at the far end, which does not count.
    #[must_use]
    pub fn way(&self, ray: &Ray, distance: f64, target: Option<Departure>) -> Way {
        const NOTHING: Hit = Hit { t: 0.0, object: 0, part: 0, barycentric: [0.0; 2], instance: None };
        let mut crossed = Crossed { hits: [NOTHING; MOST], count: 0 };
        let mut long = false;
        let lets_through = |object: u32| self.lets_through(object);
        let by_triangles = self.together.as_ref().is_some_and(|together| {
            together.any(ray, distance, target, |hit| {
                if !lets_through(hit.object) {
                    return true;
                }
                long = !crossed.push(hit);
                long
            })
        });
        let mut visit = |object: u32| {
            let geometry = &self.objects[object as usize].geometry;
            let departing = ray.departure.filter(|d| d.object == object).map(|d| d.part);
            let aimed = target.filter(|t| t.object == object).map(|t| t.part);
            match geometry {
                Geometry::Instance(_) => {}
                _ if !lets_through(object) => return self.blocks(ray, object, distance, target),
                Geometry::Mesh(mesh) => {
                    let Some(tree) = &mesh.tree else { return false };
                    return tree.any_of(ray, distance, [departing, aimed], |met| {
                        let barycentric = [met.hit.b1, met.hit.b2];
                        let hit = Hit { t: met.hit.t, object, part: met.triangle, barycentric, instance: None };
                        long = !crossed.push(hit);
                        long
                    });
                }
                _ => {}
            }
            // From one surface of it to the next.
            let (mut ray, mut gone) = (*ray, 0.0);
            while let Some(hit) = self.meet(&ray, object, distance - gone) {
                if self.reaches(&ray, &hit, target) {
                    break;
                }
                if !lets_through(hit.object) {
                    return true;
                }
                let surface = self.surface_with(&ray, &hit, Detail::Geometry);
                ray = self.leave(&surface, &hit, ray.direction);
                gone += hit.t;
                long = !crossed.push(Hit { t: gone, ..hit });
                if long {
                    return true;
                }
            }
            false
        };
        let stopped = by_triangles
            || match &self.few {
                Some(few) => {
                    let aimed = self.aimed(target);
                    few.any(ray, distance, aimed, |object, _| visit(object)) || aimed.is_some_and(visit)
                }
                None => self.bvh.any(ray, distance, visit),
            };
        match (long, stopped) {
            (true, _) => Way::Long,
            (false, true) => Way::Blocked,
            (false, false) => Way::Open(crossed),
        }
    }
}
