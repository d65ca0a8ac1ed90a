//! Textbook intersectors in single precision: what most renderers do, kept to measure against.
//!
//! Nothing is rendered with these, unless the feature `single_precision` is compiled in, for measurements: then they take
//! the place of the robust ones, with an epsilon of [`EPSILON`]. `abbe render --check-numerics` asks them whether a surface
//! that was met would have been missed in f32, and `tools/bench/robustness` what robustness costs beside them. They are the formulas of textbooks
//! (Glassner 1989, "An Introduction to Ray Tracing", chapter 2; Möller and Trumbore 1997, "Fast, Minimum Storage
//! Ray/Triangle Intersection"), and have their faults: discriminants that cancel, edges that leak, walls and caps that
//! disagree at a rim.

use super::Shape;
use glam::Vec3;

/// A shape in single precision.
#[derive(Clone, Copy, Debug)]
pub enum Plain {
    /// By the quadratic formula.
    Sphere {
        /// Centre.
        center: Vec3,
        /// Radius.
        radius: f32,
    },
    /// By the dot products with its normal.
    Plane {
        /// On it.
        point: Vec3,
        /// Unit normal.
        normal: Vec3,
    },
    /// By the plane, then by coordinates on it.
    Patch {
        /// Where both coordinates are zero.
        origin: Vec3,
        /// Unit normal.
        normal: Vec3,
        /// A coordinate is one of these · (p − origin).
        duals: [Vec3; 2],
        /// Whether a² + b² ≤ 1 is inside, else 0 ≤ a, b ≤ 1.
        round: bool,
    },
    /// By three slabs.
    Cube {
        /// Centre.
        center: Vec3,
        /// Coordinate i is dualᵢ · (p − centre), in [−1, 1].
        duals: [Vec3; 3],
    },
    /// x² + y² = (f + g z)² for 0 ≤ z ≤ 1, and its caps: a cylinder or a cone.
    Turned {
        /// Where the axis begins.
        base: Vec3,
        /// Coordinate i is rowᵢ · (p − base).
        rows: [Vec3; 3],
        /// f and g.
        profile: [f32; 2],
        /// Faces at z = 0 and z = 1, where they are closed.
        caps: [Option<u8>; 2],
    },
}

/// How far a ray has to go before it meets anything, where no part is left out: scenes of some metres in size.
pub const EPSILON: f32 = 1e-4;

impl Plain {
    /// The nearest hit with `t_min` < t < `t_max`, and its face.
    #[must_use]
    #[inline]
    pub fn intersect(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<(f32, u8)> {
        let within = |t: f32| (t > t_min && t < t_max).then_some((t, 0));
        match *self {
            Plain::Sphere { center, radius } => {
                let oc = origin - center;
                let [near, far] =
                    roots(direction.dot(direction), 2.0 * oc.dot(direction), oc.dot(oc) - radius * radius)?;
                [near, far].into_iter().find_map(within)
            }
            Plain::Plane { point, normal } => {
                let t = (point - origin).dot(normal) / direction.dot(normal);
                within(t)
            }
            Plain::Patch { origin: corner, normal, duals, round } => {
                let t = (corner - origin).dot(normal) / direction.dot(normal);
                let p = origin + direction * t - corner;
                let [a, b] = duals.map(|dual| dual.dot(p));
                let inside =
                    if round { a * a + b * b <= 1.0 } else { (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b) };
                if inside { within(t) } else { None }
            }
            Plain::Cube { center, duals } => {
                let oc = origin - center;
                let (mut enter, mut exit) = ((f32::NEG_INFINITY, 0), (f32::INFINITY, 0));
                for (dual, face) in duals.into_iter().zip([0, 2, 4]) {
                    let (o, d) = (dual.dot(oc), 1.0 / dual.dot(direction));
                    let (low, high) = (((-1.0 - o) * d, face), ((1.0 - o) * d, face + 1));
                    let (near, far) = if low.0 < high.0 { (low, high) } else { (high, low) };
                    enter = if near.0 > enter.0 { near } else { enter };
                    exit = if far.0 < exit.0 { far } else { exit };
                }
                if enter.0 > exit.0 {
                    return None;
                }
                [enter, exit].into_iter().find(|(t, _)| *t > t_min && *t < t_max)
            }
            Plain::Turned { base, rows, profile: [f, g], caps } => {
                let oc = origin - base;
                let (o, d) = (rows.map(|row| row.dot(oc)), rows.map(|row| row.dot(direction)));
                let radius = f + g * o[2];
                let slope = g * d[2];
                let a = d[0] * d[0] + d[1] * d[1] - slope * slope;
                let b = 2.0 * (o[0] * d[0] + o[1] * d[1] - radius * slope);
                let c = o[0] * o[0] + o[1] * o[1] - radius * radius;
                let mut nearest = (t_max, 0);
                for t in roots(a, b, c).into_iter().flatten() {
                    let z = o[2] + t * d[2];
                    if t > t_min && t < nearest.0 && (0.0..=1.0).contains(&z) {
                        nearest = (t, 0);
                    }
                }
                for (cap, z) in caps.into_iter().zip([0.0, 1.0]) {
                    let Some(face) = cap else { continue };
                    let t = (z - o[2]) / d[2];
                    let (x, y, r) = (o[0] + t * d[0], o[1] + t * d[1], f + g * z);
                    if t > t_min && t < nearest.0 && x * x + y * y <= r * r {
                        nearest = (t, face);
                    }
                }
                (nearest.0 < t_max).then_some(nearest)
            }
        }
    }
}

/// The roots of a t² + b t + c, the smaller first; none where they are not real.
#[inline]
pub(in crate::scene) fn roots(a: f32, b: f32, c: f32) -> Option<[f32; 2]> {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    let (p, q) = ((-b - root) / (2.0 * a), (-b + root) / (2.0 * a));
    Some(if p < q { [p, q] } else { [q, p] })
}

/// The nearest hit with `t_min` < t < `t_max` of a triangle (Möller and Trumbore 1997), from either side.
#[must_use]
#[inline]
pub fn triangle([a, b, c]: [Vec3; 3], origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<f32> {
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let v = direction.dot(q) / det;
    let t = e2.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > t_min && t < t_max).then_some(t)
}

/// What takes the place of [`Shape::intersect`]. The shape is rounded for each ray, which costs some instructions.
#[inline]
pub(super) fn instead(shape: &Shape, ray: &crate::math::Ray, t_max: f64) -> Option<super::ShapeHit> {
    let (origin, direction) = (ray.origin.as_vec3(), ray.direction.as_vec3());
    let (t, face) = shape.plain().intersect(origin, direction, EPSILON, t_max as f32)?;
    Some(super::ShapeHit { t: t.into(), face })
}

impl Shape {
    /// The shape in single precision.
    #[must_use]
    pub fn plain(&self) -> Plain {
        match self {
            Shape::Sphere(s) => s.plain(),
            Shape::Plane(s) => s.plain(),
            Shape::Disk(s) => s.plain(),
            Shape::Rectangle(s) => s.plain(),
            Shape::Cube(s) => s.plain(),
            Shape::Cylinder(s) => s.plain(),
            Shape::Cone(s) => s.plain(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{KINDS, Random, random_shape};
    use super::*;
    use crate::math::Ray;
    use glam::DVec3;

    /// Seen from a few sizes away, and not near an edge, single precision finds what the robust intersectors find, to
    /// some roundings of 2⁻²⁴ times the distance over the cosine; nine rays of ten at least.
    #[test]
    fn textbook_formulas_are_the_same_shapes() {
        let mut random = Random::new(3);
        let (mut both, mut differ) = ([0; KINDS], [0; KINDS]);
        for i in 0..70_000 {
            let kind = i % KINDS;
            let shape = random_shape(kind, random.direction() * 0.5, 1.0, &mut random);
            let origin = random.direction() * 4.0;
            let target = random.direction() * 0.7;
            let ray = Ray::new(origin, (target - origin).normalize());
            let found = shape.plain().intersect(ray.origin.as_vec3(), ray.direction.as_vec3(), 0.0, f32::INFINITY);
            let expected = shape.intersect(&ray, f64::INFINITY, None);
            match (found, expected) {
                (Some((t, face)), Some(hit)) if (f64::from(t) - hit.t).abs() < 1e-3 && face == hit.face => {
                    both[kind] += 1
                }
                (None, None) => {}
                _ => differ[kind] += 1,
            }
        }
        assert!((0..KINDS).all(|k| both[k] > 500 && differ[k] * 100 < both[k]), "{both:?} {differ:?}");
        let v = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| p.as_vec3());
        assert_eq!(triangle(v, Vec3::new(0.25, 0.5, 2.0), Vec3::NEG_Z, 0.0, 10.0), Some(2.0));
        assert_eq!(triangle(v, Vec3::new(0.75, 0.5, 2.0), Vec3::NEG_Z, 0.0, 10.0), None);
    }
}
