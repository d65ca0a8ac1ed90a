//! Clear bodies that overlap without saying which of them has the place: two that refract, or two that hold a medium.
//!
//! Where a ray is in two bodies at once, and each of them both begins and ends beside the other, neither lies in the
//! other: the surfaces that the ray crosses then bound nothing that their indices describe. Along a ray a body is a row of
//! intervals; of bodies that hold one another each interval lies within one of the other, and of bodies that touch they
//! meet at their ends. So two intervals that interleave prove an overlap, and no bodies that touch or hold each other have
//! such. A few rays through what the boxes of two bodies share find all but slight overlaps.

use super::bvh::Aabb;
use super::material::Kind;
use super::{Geometry, Hit, Object, Scene};
use crate::math::Ray;
use crate::math::warp;
use crate::scene::shape::Shape;
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// Rays for a pair of bodies.
const RAYS: u32 = 64;

/// Pairs that are looked at; a bound on time.
const MOST_PAIRS: usize = 256;

/// Bodies that are looked at; a bound on time.
const MOST_BODIES: usize = 1024;

/// Surfaces of a body along one ray.
const MOST_SURFACES: usize = 256;

/// Intervals may interleave by less than this share of the ray's length in the two boxes. A ray that grazes a quadric
/// finds its ends within the root of the rounding error, √(16 · 2⁻⁵³) = 4e-8 of its size; 2⁻²⁰ is above that.
const SLIGHT: f64 = 1.0 / (1u64 << 20) as f64;

/// A body and its box.
struct Body {
    object: u32,
    bounds: Aabb,
    ranked: bool,
    refracts: bool,
    holds_medium: bool,
}

/// Two bodies that overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlap {
    /// The two objects.
    pub objects: [u32; 2],
    /// Whether each of them refracts, so that priorities can say which has the place; else each holds a medium.
    pub refracting: bool,
}

/// Intervals of a ray, from and to.
type Intervals = Vec<[f64; 2]>;

impl Scene {
    /// Pairs of objects that stand in the scene itself and overlap, of which not both have a priority.
    #[must_use]
    pub fn overlaps(&self) -> Vec<Overlap> {
        let bodies = self.clear_bodies();
        let mut found = Vec::new();
        let mut looked = 0;
        for (i, a) in bodies.iter().enumerate() {
            for b in &bodies[i + 1..] {
                let shared = Aabb { min: a.bounds.min.max(b.bounds.min), max: a.bounds.max.min(b.bounds.max) };
                let apart = shared.min.cmpge(shared.max).any();
                let refracting = a.refracts && b.refracts;
                let alike = refracting || a.holds_medium && b.holds_medium;
                if apart || !alike || a.ranked && b.ranked || !shared.is_finite() {
                    continue;
                }
                looked += 1;
                if looked > MOST_PAIRS {
                    return found;
                }
                if self.interleave(a, b, &shared) {
                    found.push(Overlap { objects: [a.object, b.object], refracting });
                }
            }
        }
        found
    }

    /// Objects that bound a space that light goes into, where it is refracted or in another medium.
    fn clear_bodies(&self) -> Vec<Body> {
        let refracts = |object: &Object| {
            let leaves = self.materials[object.material as usize].leaves();
            leaves.iter().any(|leaf| match &leaf.kind {
                Kind::Dielectric { .. } => true,
                Kind::Principled(solid) => solid.transmission.is_some(),
                _ => false,
            })
        };
        let holds_medium = |object: &Object| {
            !object.keeps_medium
                && object.inside != object.outside
                && self.materials[object.material as usize].transmits()
        };
        let closed = |object: &Object| match &object.geometry {
            Geometry::Shape(shape) => shape.is_closed() || matches!(shape, Shape::Plane(_)),
            Geometry::Mesh(_) => true,
            Geometry::Sdf(sdf) => sdf.is_closed(),
            Geometry::Curves(_) | Geometry::Instance(_) => false,
        };
        let is_body = |object: &&Object| closed(object) && (refracts(object) || holds_medium(object));
        let standing = self.objects[..self.standing].iter().zip(0u32..);
        // Groups are looked through once, however many copies they have.
        let mut groups: HashMap<u32, Option<&Object>> = HashMap::new();
        let bodies = standing.filter_map(|(object, i)| {
            let inner = match &object.geometry {
                Geometry::Instance(instance) => *groups.entry(instance.group.first).or_insert_with(|| {
                    let mut all = self.objects[instance.group.members()].iter().filter(is_body);
                    // Of several bodies in one group the surfaces are not told apart here.
                    all.next().filter(|_| all.next().is_none())
                }),
                _ => Some(object).filter(is_body),
            }?;
            let (refracts, holds_medium) = (refracts(inner), holds_medium(inner));
            Some(Body { object: i, bounds: object.bounds(), ranked: inner.body != 0, refracts, holds_medium })
        });
        bodies.take(MOST_BODIES).collect()
    }

    /// Whether any ray through `shared` finds intervals of both bodies that interleave.
    fn interleave(&self, a: &Body, b: &Body, shared: &Aabb) -> bool {
        let finite = [a, b].into_iter().map(|body| body.bounds).filter(Aabb::is_finite);
        let Some(whole) = finite.reduce(|a, b| a.union(&b)) else { return false };
        let length = 2.0 * (whole.max - whole.min).length();
        (0..RAYS).any(|i| {
            // Points and directions of a lattice: multiples of the roots of x⁶ = x + 1 (the generalised golden ratio).
            const GOLDEN: f64 = 1.134_724_138_401_519_4;
            let lattice = |k: i32| (0.5 + f64::from(i + 1) / GOLDEN.powi(k)).fract();
            let through = shared.min + (shared.max - shared.min) * DVec3::new(lattice(1), lattice(2), lattice(3));
            let direction = warp::uniform_sphere(DVec2::new(lattice(4), lattice(5)));
            let ray = Ray::new(through - direction * (0.5 * length), direction);
            let [Some(a), Some(b)] = [a, b].map(|body| self.intervals(body, &ray, length)) else { return false };
            let slight = length * SLIGHT;
            let interleaved =
                |a: &[f64; 2], b: &[f64; 2]| a[0] + slight < b[0] && b[0] + slight < a[1] && a[1] + slight < b[1];
            a.iter().any(|a| b.iter().any(|b| interleaved(a, b) || interleaved(b, a)))
        })
    }

    /// Where the ray is in a body, whatever else stands there; `None` for one whose surface it does not cross in pairs.
    fn intervals(&self, body: &Body, ray: &Ray, length: f64) -> Option<Intervals> {
        let below = match &self.objects[body.object as usize].geometry {
            Geometry::Shape(Shape::Plane(plane)) => Some(plane.height(ray.origin) < 0.0),
            _ => None,
        };
        let mut crossed = if below == Some(true) { vec![f64::NEG_INFINITY] } else { vec![] };
        let (mut at, mut gone) = (*ray, 0.0);
        for _ in 0..MOST_SURFACES {
            let Some(hit) = self.meet_alone(&at, body.object, length - gone) else { break };
            gone += hit.t;
            // Of an instance only the one body counts, not what stands beside it in the group.
            if self.materials[self.objects[hit.object as usize].material as usize].transmits() {
                crossed.push(gone);
            }
            at = self.leave(&self.surface(&at, &hit), &hit, at.direction);
        }
        if crossed.len() % 2 == 1 && below.is_some() {
            crossed.push(f64::INFINITY);
        }
        (crossed.len() % 2 == 0).then(|| crossed.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect())
    }

    /// Where the ray meets `object`, whatever else stands there.
    fn meet_alone(&self, ray: &Ray, object: u32, t_max: f64) -> Option<Hit> {
        let Some(together) = self.together.as_ref().filter(|together| together.holds(object)) else {
            return self.meet(ray, object, t_max);
        };
        let mut met = None;
        together.nearest(ray, t_max, |hit| (hit.object == object).then(|| met.insert(hit).t));
        met
    }
}

#[cfg(test)]
mod tests {

    use crate::scene::compile::testing::compiled;

    /// Notes of overlaps in a scene of these shapes.
    fn notes(shapes: &str) -> Vec<String> {
        notes_with("", shapes)
    }

    fn notes_with(media: &str, shapes: &str) -> Vec<String> {
        let text = format!("camera: {{origin: [0, 0.3, 5], target: [0, 0, 0], fov_deg: 40}}\n{media}shapes:\n{shapes}");
        let mut notes = compiled(&text).notes;
        notes.retain(|note| note.contains(": overlaps "));
        notes
    }

    fn sphere(x: f64, radius: f64, more: &str) -> String {
        format!(
            "- sphere: {{center: [{x}, 0.1, 0.2], radius: {radius}, material: {{dielectric: {{ior: 1.5{more}}}}}}}\n"
        )
    }

    #[test]
    fn bodies_that_overlap_without_priorities_are_told() {
        let told = "s.yaml:4:11: shapes[1].sphere: overlaps shapes[0], and not both have a priority: where they share a \
            place, light is refracted by indices that neither has; a higher priority says which has the place";
        assert_eq!(notes(&(sphere(0.0, 1.0, "") + &sphere(1.5, 1.0, ""))), [told]);
        assert_eq!(notes(&(sphere(0.0, 1.0, ", priority: 1") + &sphere(1.9, 1.0, ""))), [told]);
        // Half immersed in a sea.
        let sea = "- plane: {point: [0, 0, 0], normal: [0, 1, 0], material: {dielectric: {ior: 1.33}}}\n";
        assert_eq!(notes(&(sea.to_owned() + &sphere(0.0, 1.0, ""))).len(), 1);
        // A copy, and a corner of a cube.
        let cube = "- cube: {center: [0.9, 0.9, 0.9], size: 1, material: {principled: {spec_trans: 1}}}\n";
        assert_eq!(notes(&(sphere(0.0, 1.0, "") + cube)).len(), 1);
    }

    /// Where two media overlap, a path is in the one whose surface it crossed last: another one from the other end.
    #[test]
    fn media_that_overlap_are_told() {
        let told = "overlaps shapes[0], and both hold a medium: where they share a place, light is in the one that it \
            went into last, and pictures differ by where paths begin; leave them apart";
        let sphere = |x: f64, material: &str, inside: &str| {
            format!(
                "- sphere: {{center: [{x}, 0.1, 0.2], radius: 1, material: {{{material}: {{}}}}, inside: {inside}}}\n"
            )
        };
        let media = "media: {smoke: {homogeneous: {scattering: 1, absorption: 1}}, ink: {homogeneous: {scattering: 0, absorption: 2}}}\n";
        let of = |shapes: &str| notes_with(media, shapes);
        let [a, b] = [sphere(0.0, "boundary", "smoke"), sphere(1.5, "boundary", "ink")];
        assert!(of(&(a.clone() + &b))[0].ends_with(told), "{:?}", of(&(a.clone() + &b)));
        let glass = sphere(1.5, "dielectric", "ink").replace("dielectric: {}", "dielectric: {ior: 1.5}");
        assert!(of(&(a.clone() + &glass))[0].ends_with(told));
        // Apart, and what light does not go into.
        assert_eq!(of(&(a.clone() + &sphere(2.5, "boundary", "ink"))), [""; 0]);
        assert_eq!(of(&(a + &sphere(1.5, "diffuse", "ink"))), [""; 0]);
    }

    /// Held, touching from outside and from within, with equal faces, apart, opaque, or with priorities.
    #[test]
    fn bodies_that_touch_or_hold_each_other_are_left_alone() {
        let cube = |center: [f64; 3], size: f64| {
            format!("- cube: {{center: {center:?}, size: {size:?}, material: {{dielectric: {{ior: 1.5}}}}}}\n")
        };
        let sea = |y: f64| {
            format!("- plane: {{point: [0, {y}, 0], normal: [0, 1, 0], material: {{dielectric: {{ior: 1.33}}}}}}\n")
        };
        for shapes in [
            sphere(0.0, 1.0, "") + &sphere(0.1, 0.5, ""),
            sphere(0.0, 1.0, "") + &sphere(2.0, 1.0, ""),
            sphere(0.0, 1.0, "") + &sphere(0.5, 0.5, ""),
            sphere(0.0, 1.0, "") + &sphere(0.0, 1.0, ""),
            cube([0.0, 0.0, 0.0], 1.0) + &cube([1.0, 0.3, 0.2], 1.0),
            cube([0.0, 0.0, 0.0], 1.0) + &cube([0.0, 0.0, 0.0], 1.0),
            cube([0.0, 0.0, 0.0], 1.0) + &cube([0.25, 0.0, 0.0], 0.5),
            cube([0.1, 0.1, 0.1], 0.3) + &cube([0.4, 0.1, 0.1], 0.3),
            sphere(0.0, 1.0, ", priority: 1") + &sphere(1.5, 1.0, ", priority: 1"),
            sphere(0.0, 1.0, "") + "- sphere: {center: [1, 0, 0], radius: 1, material: {diffuse: {}}}\n",
            // In the sea, on it, and beside it.
            sea(1.1) + &sphere(0.0, 1.0, ""),
            sea(3.0) + &sphere(0.0, 1.0, ""),
            sea(-0.9) + &sphere(0.0, 1.0, ""),
        ] {
            assert_eq!(notes(&shapes), [""; 0], "{shapes}");
        }
    }
}
