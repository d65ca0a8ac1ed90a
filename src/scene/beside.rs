//! The eye and lamps without extent that lie on a surface: they are put on one of its sides.
//!
//! On the surface itself rounding decides, ray by ray, whether it lies before or behind them. Points of surfaces and distances to
//! them are exact to some 2⁻⁵² of the largest coordinate or length, and rays that leave surfaces begin 2⁻⁴⁶ of it off them (see
//! [`Ray::leaving`]). A step along the normal of 2⁻³³ of the size of the scene leaves no ray in doubt that comes from as far as
//! 8192 sizes, on planes without end, and is nothing to see.

use super::light::Light;
use super::{Hit, Scene};
use crate::math::Ray;
use glam::DVec3;

/// The step, relative to the largest coordinate or length.
const STEP: f64 = 1.0 / (1u64 << 33) as f64;

/// Surfaces that are nearer, relative to the same, are lain on: four steps of rays that leave surfaces.
const NEAR: f64 = 1.0 / (1u64 << 44) as f64;

/// Surfaces that a probe meets at the most; a bound on time.
const MOST: usize = 64;

/// Which side of a surface a point is put on.
#[derive(Clone, Copy)]
enum Side {
    /// That into which this direction leads.
    Along(DVec3),
    /// That which is seen from here of what it lies on: of a body its outside, unless one is within.
    SeenFrom(DVec3),
}

/// A surface through a point.
struct Lain {
    hit: Hit,
    normal: DVec3,
    scale: f64,
}

impl Scene {
    /// Puts the eye and lamps beside the surfaces that they lie on. For each that was moved `None`, for the eye, or which light, and
    /// the object it lay on.
    pub(super) fn put_beside(&mut self) -> Vec<(Option<usize>, u32)> {
        let mut moved = Vec::new();
        let eye = self.camera.eye();
        if let Some((step, object)) = self.step_off(eye, Side::Along(self.camera.forward())) {
            self.camera = self.camera.moved(step);
            moved.push((None, object));
        }
        let eye = self.camera.eye();
        for i in 0..self.lights.len() {
            let (position, side) = match &self.lights[i] {
                Light::Point { position, .. } => (*position, Side::SeenFrom(eye)),
                Light::Spot { position, axis, .. } => (*position, Side::Along(*axis)),
                Light::Projector(projector) => (projector.position(), Side::Along(projector.axis())),
                Light::Directional { .. }
                | Light::Constant { .. }
                | Light::Environment(_)
                | Light::Area { .. }
                | Light::AlongNormal { .. } => continue,
            };
            let Some((step, object)) = self.step_off(position, side) else { continue };
            match &mut self.lights[i] {
                Light::Point { position, .. } | Light::Spot { position, .. } => *position += step,
                Light::Projector(projector) => projector.shift(step),
                _ => {}
            }
            moved.push((Some(i), object));
        }
        moved
    }

    /// The step off all surfaces that `point` lies on, and one of them; `None` if there is none.
    fn step_off(&self, point: DVec3, side: Side) -> Option<(DVec3, u32)> {
        let (mut step, mut first) = (DVec3::ZERO, None);
        for Lain { hit, normal, scale } in self.through(point) {
            let forward = match side {
                Side::Along(direction) => normal.dot(direction) >= 0.0,
                Side::SeenFrom(eye) => self.shows_front(&hit, eye, point),
            };
            step += normal * if forward { STEP * scale } else { -STEP * scale };
            first = first.or(Some(hit.object));
        }
        first.map(|object| (step, object))
    }

    /// The surfaces that go through a point to within rounding, each normal once. One of the three axes crosses each of them at
    /// less than 55° to its normal.
    fn through(&self, point: DVec3) -> Vec<Lain> {
        let size = point.abs().max_element().max(self.center.abs().max_element() + self.radius);
        let mut found: Vec<Lain> = Vec::new();
        if size == 0.0 || !size.is_finite() {
            return found;
        }
        // Long against what is near, so that it begins before all of that.
        let reach = 4.0 * STEP * size;
        for axis in DVec3::AXES {
            for direction in [axis, -axis] {
                let mut ray = Ray::new(point - direction * reach, direction);
                for _ in 0..MOST {
                    let left = 2.0 * reach - (ray.origin - point + direction * reach).dot(direction);
                    let Some(hit) = self.closest(&ray, left) else { break };
                    let surface = self.surface(&ray, &hit);
                    let scale = surface.scale.max(size);
                    let away = (surface.point - point).dot(surface.normal).abs();
                    let known = |other: &Lain| {
                        other.hit.object == hit.object && other.normal.dot(surface.normal).abs() > 1.0 - 1e-9
                    };
                    if away <= NEAR * scale && !found.iter().any(known) {
                        found.push(Lain { hit, normal: surface.normal, scale });
                    }
                    ray = self.leave(&surface, &hit, direction);
                }
            }
        }
        found
    }

    /// Whether the first that is seen from `eye` toward `point` of the object of `hit` is its front; true where nothing of it is.
    fn shows_front(&self, hit: &Hit, eye: DVec3, point: DVec3) -> bool {
        let Some(direction) = (point - eye).try_normalize() else { return true };
        let mut ray = Ray::new(eye, direction);
        for _ in 0..MOST {
            let Some(met) = self.closest(&ray, f64::INFINITY) else { break };
            let surface = self.surface(&ray, &met);
            if (met.object, met.instance) == (hit.object, hit.instance) {
                return surface.normal.dot(direction) <= 0.0;
            }
            ray = self.leave(&surface, &met, direction);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use crate::description::SceneDescription;
    use crate::scene::compile::compile;

    #[test]
    fn what_is_moved_is_told_where_it_is_written() {
        let text = "camera: {origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}\n\
            shapes: [rectangle: {name: wall, corner: [-1, 0, 5], edge_u: [2, 0, 0], edge_v: [0, 2, 0]}]\n\
            lights:\n- point: {position: [0, 1, 4], intensity: 1}\n- point: {position: [0.5, 1, 5], intensity: 1}\n";
        let description = SceneDescription::parse(text, std::path::Path::new("s.yaml")).unwrap();
        let notes = compile(&description, "s").unwrap().notes;
        let told = [
            "s.yaml:1:9: camera: stands on wall: it sees from the side to which it looks",
            "s.yaml:5:10: lights[1].point: lies on wall: it shines from the side that it is aimed at, or that is seen",
        ];
        assert_eq!(notes, told);
    }
}
