//! Eight rays that lie close together: what one meets is tried with all.

use super::{Geometry, Hit, Nearest, Scene};
use crate::math::{Departure, Ray};
use crate::spectrum::LANES;

/// Objects up to which all are tried.
const FEW: usize = 8;

/// The lanes whose bits are set.
pub fn each(lanes: u8) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |lane| lanes >> lane & 1 == 1)
}

impl Scene {
    /// [`Scene::closest`] for the rays whose bits are in `lanes`; `None` for the others.
    #[must_use]
    pub fn closest_of(&self, rays: &[Ray; LANES], lanes: u8) -> [Option<Hit>; LANES] {
        if self.bvh.order().len() > FEW {
            let mut best = [None; LANES];
            for lane in each(lanes) {
                best[lane] = self.closest(&rays[lane], f64::INFINITY);
            }
            return best;
        }
        let mut nearest = [Nearest { hit: None, reach: f64::INFINITY }; LANES];
        for &object in self.bvh.order() {
            for lane in each(lanes) {
                self.meet_nearer(&rays[lane], object, &mut nearest[lane]);
            }
        }
        let mut best = nearest.map(|nearest| nearest.hit);
        if let Some(together) = &self.together {
            for lane in each(lanes) {
                let t_max = best[lane].map_or(f64::INFINITY, |hit| hit.t);
                best[lane] = together.closest(&rays[lane], t_max).or(best[lane]);
            }
        }
        best
    }

    /// The rays among `lanes` in whose way anything stands before their `distances`; see [`Scene::occluded`],
    /// whose `target` is not to be of a shape that is turned inside out here.
    #[must_use]
    pub fn occluded_of(
        &self,
        rays: &[Ray; LANES],
        distances: &[f64; LANES],
        lanes: u8,
        target: Option<Departure>,
    ) -> u8 {
        let mut hidden = 0;
        if self.bvh.order().len() > FEW {
            for lane in each(lanes) {
                hidden |= u8::from(self.occluded(&rays[lane], distances[lane], target)) << lane;
            }
            return hidden;
        }
        for &object in self.bvh.order() {
            let geometry = &self.objects[object as usize].geometry;
            let part = target.filter(|t| t.object == object).map(|t| t.part);
            for lane in each(lanes & !hidden) {
                let (ray, distance) = (&rays[lane], distances[lane]);
                let blocked = match geometry {
                    Geometry::Instance(instance) => instance.blocks(&self.objects, object, ray, distance),
                    _ => {
                        let departing = ray.departure.filter(|d| d.object == object).map(|d| d.part);
                        geometry.blocks(ray, distance, departing, part)
                    }
                };
                hidden |= u8::from(blocked) << lane;
            }
        }
        if let Some(together) = &self.together {
            for lane in each(lanes & !hidden) {
                hidden |= u8::from(together.any(&rays[lane], distances[lane], target, |_| true)) << lane;
            }
        }
        hidden
    }
}
