//! The eye and lamps without extent that lie on a surface: they are put on one of its sides.
//!
//! On the surface itself rounding decides, ray by ray, whether it lies before or behind them. Points of surfaces and distances to
//! them are exact to some 2⁻⁵² of the largest coordinate or length, and rays that leave surfaces begin 2⁻⁴⁶ of it off them (see
//! [`Ray::leaving`]). A step along the normal of 2⁻³³ of what the surface measures, and of the distance from which a lamp is seen,
//! leaves no ray in doubt that comes from as far as 8192 times that, on planes without end, and is nothing to see. Where something
//! else is near, it goes half the way there.
//!
//! Corners of meshes are rounded to f32 (see [`super::mesh`]): what lies on one as it is written may lie beneath it as it is. So what
//! is within that rounding of a mesh, on the wrong side, is on it.

use super::apart::{APART, NEAR};
use super::bvh::Aabb;
use super::light::Light;
use super::shape::SurfacePoint;
use super::{Geometry, Hit, Scene};
use crate::math::Ray;
use glam::DVec3;

/// The step, relative to the largest coordinate or length at hand.
const STEP: f64 = 1.0 / (1u64 << 33) as f64;

/// Meshes, by the largest coordinate of their corners: three roundings to f32, and to spare.
const NEAR_MESH: f64 = 1.0 / (1u64 << 23) as f64;

/// Surfaces that lie ahead within this are lain on, as well: sixteen times the gap of [`super::apart`].
const ON_TOO: f64 = 16.0 * APART;

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
    surface: SurfacePoint,
    scale: f64,
}

impl Scene {
    /// Puts the eye and lamps beside the surfaces that they lie on. For each that was moved `None`, for the eye, or which light, and
    /// the object it lay on. `boxes` are those of the objects that stand in the scene itself.
    pub(super) fn put_beside(&mut self, boxes: &[Aabb]) -> Vec<(Option<usize>, u32)> {
        let mut moved = Vec::new();
        let eye = self.camera.eye();
        let copied = self.objects[boxes.len()..].iter().any(|object| matches!(object.geometry, Geometry::Mesh(_)));
        let rounded = self.objects.iter().zip(boxes).filter_map(|(object, b)| match object.geometry {
            Geometry::Mesh(_) => Some((b.max - b.min).max_element()),
            Geometry::Instance(_) if copied => Some((b.max - b.min).max_element()),
            Geometry::Instance(_) | Geometry::Shape(_) | Geometry::Sdf(_) | Geometry::Curves(_) => None,
        });
        let extent = rounded.filter(|extent| extent.is_finite()).fold(0.0, f64::max);
        // A mesh that is not moved to the origin has coordinates of at most 4.5 times its size.
        let rounding = 5.0 * NEAR_MESH * extent;
        let ahead = Side::Along(self.camera.forward());
        if let Some((step, object)) = self.step_off(eye, ahead, self.near_eye(eye, boxes), rounding) {
            self.camera = self.camera.moved(step);
            moved.push((None, object));
        }
        let eye = self.camera.eye();
        for i in 0..self.lights.len() {
            let Some(position) = self.lights[i].position() else { continue };
            let side = match &self.lights[i] {
                Light::Spot { axis, .. } => Side::Along(*axis),
                Light::Projector(projector) => Side::Along(projector.axis()),
                _ => Side::SeenFrom(eye),
            };
            let reach = (eye - position).length();
            let Some((step, object)) = self.step_off(position, side, reach, rounding) else { continue };
            match &mut self.lights[i] {
                Light::Point { position, .. } | Light::Spot { position, .. } => *position += step,
                Light::Projector(projector) => projector.shift(step),
                _ => {}
            }
            moved.push((Some(i), object));
        }
        moved
    }

    /// How far the nearest lamp without extent is; without lamps, and coordinates that say what a length is, the nearest thing,
    /// or what there is in all.
    fn near_eye(&self, eye: DVec3, boxes: &[Aabb]) -> f64 {
        let least = |places: &mut dyn Iterator<Item = DVec3>| {
            let far = places.map(|place| (place - eye).length()).filter(|far| *far > 0.0 && far.is_finite());
            far.reduce(f64::min)
        };
        let lamps = least(&mut self.lights.iter().filter_map(Light::position));
        if eye != DVec3::ZERO {
            return lamps.unwrap_or(0.0);
        }
        let things = || least(&mut boxes.iter().map(|b| 0.5 * (b.min + b.max)));
        lamps.or_else(things).unwrap_or(self.center.abs().max_element() + self.radius)
    }

    /// The step off all surfaces that `point` lies on, and one of them; `None` if there is none. It is seen, or sees what counts,
    /// `reach` metres away; corners of meshes are rounded by less than `rounding` metres.
    fn step_off(&self, point: DVec3, side: Side, reach: f64, rounding: f64) -> Option<(DVec3, u32)> {
        let (mut step, mut first, mut offs) = (DVec3::ZERO, None, Vec::new());
        for Lain { hit, surface, scale } in self.through(point, reach, rounding) {
            let forward = match side {
                Side::Along(direction) => surface.normal.dot(direction) >= 0.0,
                Side::SeenFrom(eye) => self.shows_front(&hit, eye, point),
            };
            let off = if forward { surface.normal } else { -surface.normal };
            // Of two faces that look at each other, as of bodies that touch, the first decides.
            if offs.iter().any(|known: &DVec3| known.dot(off) < -0.5) {
                continue;
            }
            offs.push(off);
            let height = self.room(&self.leave(&surface, &hit, off), 2.0 * STEP * scale) * 0.5;
            let more = height - (point - surface.point).dot(off);
            if more > 0.0 {
                step += off * more;
                first = first.or(Some(hit.object));
            }
        }
        first.map(|object| (step, object))
    }

    /// How far `ray` leads to the next thing, up to `most`; what is as near as bodies that were put apart is lain on, too.
    fn room(&self, ray: &Ray, most: f64) -> f64 {
        let (mut at, mut gone) = (*ray, 0.0);
        for _ in 0..MOST {
            let Some(hit) = self.closest(&at, most - gone) else { break };
            gone += hit.t;
            let surface = self.surface(&at, &hit);
            if gone > ON_TOO * surface.scale {
                return gone;
            }
            at = self.leave(&surface, &hit, ray.direction);
        }
        most
    }

    /// The surfaces that go through a point to within rounding, each normal once. One of the three axes crosses each of them at less
    /// than 55° to its normal.
    fn through(&self, point: DVec3, reach: f64, rounding: f64) -> Vec<Lain> {
        let size = point.abs().max_element().max(reach);
        let mut found: Vec<Lain> = Vec::new();
        if size == 0.0 || !size.is_finite() {
            return found;
        }
        // Long against what is near, so that it begins before all of that.
        let reach = (4.0 * STEP * size).max(2.0 * rounding);
        for axis in DVec3::AXES {
            for direction in [axis, -axis] {
                let mut ray = Ray::new(point - direction * reach, direction);
                for _ in 0..MOST {
                    let left = 2.0 * reach - (ray.origin - point + direction * reach).dot(direction);
                    let Some(hit) = self.closest(&ray, left) else { break };
                    let surface = self.surface(&ray, &hit);
                    let scale = surface.scale.max(size);
                    let away = surface.point - point;
                    let known = |other: &Lain| {
                        other.hit.object == hit.object && other.surface.normal.dot(surface.normal).abs() > 1.0 - 1e-9
                    };
                    // Some axis meets it within √3 of how far its plane is away; what is farther has another plane by the point.
                    let tolerance = (NEAR * scale).max(self.rounding(&hit, surface.normal));
                    let through = away.dot(surface.normal).abs() <= tolerance && away.length() <= 2.0 * tolerance;
                    if through && !found.iter().any(known) {
                        found.push(Lain { hit, surface, scale });
                    }
                    ray = self.leave(&surface, &hit, direction);
                }
            }
        }
        found
    }

    /// How far corners of what was met may lie off where they are written, along the normal there.
    fn rounding(&self, hit: &Hit, normal: DVec3) -> f64 {
        let Geometry::Mesh(mesh) = &self.objects[hit.object as usize].geometry else { return 0.0 };
        let corners = mesh.mesh.vertices(hit.part).map(|corner| corner.abs().max_element());
        let stretch = self.instance_map(hit).map_or(1.0, |map| {
            let m = map.world_from_object().matrix3;
            [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.dot(normal).abs()).iter().sum()
        });
        NEAR_MESH * stretch * corners.into_iter().fold(0.0, f64::max)
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
    use crate::scene::compile::testing::{compiled, compiled_in};
    use crate::scene::light::Light;

    #[test]
    fn what_is_moved_is_told_where_it_is_written() {
        let text = "camera: {origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}\n\
            shapes: [rectangle: {name: wall, corner: [-1, 0, 5], edge_u: [2, 0, 0], edge_v: [0, 2, 0]}]\n\
            lights:\n- point: {position: [0, 1, 4], intensity: 1}\n- point: {position: [0.5, 1, 5], intensity: 1}\n";
        let notes = compiled(text).notes;
        let told = [
            "s.yaml:1:9: camera: stands on wall: it sees from the side to which it looks",
            "s.yaml:5:10: lights[1].point: lies on wall: it shines from the side that it is aimed at, or that is seen",
        ];
        assert_eq!(notes, told);
    }

    fn lamp(y: f64, more: &str) -> (f64, usize) {
        let text = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 0.3, 0], fov_deg: 40}}\n\
             shapes:\n- rectangle: {{corner: [-1, 2, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2]}}\n{more}\
             lights: [point: {{position: [0, {y}, 0], intensity: 1}}]\n"
        );
        let scene = compiled(&text);
        (scene.lights.iter().find_map(Light::position).unwrap().y, scene.notes.len())
    }

    /// On the face of two bodies the eye is in the one to which it looks, whichever was put off the other.
    #[test]
    fn an_eye_between_two_bodies_is_in_one() {
        let halves = [
            "- cube: {center: [0, 0, 0.5], size: 1, material: glass}\n",
            "- cube: {center: [0, 0, -0.5], size: 1, material: glass}\n",
        ];
        for shapes in [halves.concat(), [halves[1], halves[0]].concat()] {
            let text = format!(
                "camera: {{origin: [0.1, 0.2, 0], target: [0.1, 0.2, -1], fov_deg: 40}}\n\
                 materials: {{glass: {{dielectric: {{ior: 1.5}}}}}}\nshapes:\n{shapes}"
            );
            let eye = compiled(&text).camera.eye();
            assert!(eye.z < -1e-11 && eye.z > -1e-8, "{eye}");
        }
    }

    /// The corners of a mesh at 0.3 lie 1.2·10⁻⁸ above it.
    #[test]
    fn lamps_on_meshes_are_beside_them_as_they_are_rounded() {
        let directory = tempfile::tempdir().unwrap();
        let table = "v -1 0.3 -1\nv -1 0.3 1\nv 1 0.3 1\nv 1 0.3 -1\nf 1 2 3 4\n";
        std::fs::write(directory.path().join("table.obj"), table).unwrap();
        for (placed, y) in [("", 0.3), (", transform: [translate: [0, 0.8, 0]]", 1.1)] {
            let text = format!(
                "camera: {{origin: [0, 3, 5], target: [0, 0.3, 0], fov_deg: 40}}\n\
                 shapes:\n- mesh: {{file: table.obj{placed}}}\nlights: [point: {{position: [0.2, {y}, 0], intensity: 1}}]\n"
            );
            let scene = compiled_in(directory.path(), &text);
            let above = scene.lights[0].position().unwrap().y - f64::from(y as f32);
            assert!(above > 0.0 && above < 1e-8, "{y}: {above}");
        }
    }

    /// A ball of 1 m that is stretched to 10¹⁰ m along x measures as much, but at z = 6 the eye is 5 m off it. The floor of a
    /// mesh, half a metre below the eye, has corners that are told to 1.2 km along x alone.
    #[test]
    fn what_is_stretched_is_not_nearer() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(
            directory.path().join("strip.obj"),
            "v -1 0.5 -9\nv -1 0.5 9\nv 1 0.5 9\nv 1 0.5 -9\nf 1 2 3 4\n",
        )
        .unwrap();
        for child in ["sphere: {radius: 1}", "mesh: {file: strip.obj}}, {sphere: {radius: 1}"] {
            let text = format!(
                "camera: {{origin: [0, 1, 6], target: [0, 0.5, 0], fov_deg: 40}}\ngroups: {{g: [{{{child}}}]}}\n\
                 shapes:\n- plane: {{normal: [0, 1, 0]}}\n- instance: {{group: g, transform: [{{scale: [1.0e10, 1, 1]}}]}}\n"
            );
            let scene = compiled_in(directory.path(), &text);
            assert_eq!((scene.camera.eye().y, scene.notes.len()), (1.0, 0), "{child}: {:?}", scene.notes);
        }
    }

    /// What is far away does not make the steps long, and the next surface is not stepped over.
    #[test]
    fn steps_are_small_against_what_is_near() {
        let sun = "- sphere: {center: [0, -1.2e11, 9e10], radius: 7.5e8, emission: 1}\n";
        assert_eq!(lamp(2.0 - 1e-6, sun), (2.0 - 1e-6, 0));
        let (below, told) = lamp(2.0, sun);
        assert!(below < 2.0 && below > 2.0 - 1e-8 && told == 1, "{below}");
        let shelf = "- rectangle: {corner: [-1, 1.9999999999, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2]}\n";
        let (between, _) = lamp(2.0, shelf);
        // Rays begin 2⁻⁴⁶ of some 5 m off the surface.
        assert!((between - (2.0 - 0.5e-10)).abs() < 1e-13, "{between}");
    }
}
