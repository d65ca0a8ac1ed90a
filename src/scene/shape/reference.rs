//! Stretches of lines inside solids, in double-double, and hits held against them; shared with
//! `tests/numerics/sweep`, which compiles this file too.
//!
//! Centres and origins are rounded to a grid of 2⁻²⁴ sizes, so that differences of positions are exact
//! in f64; directions are f64. What is left to err is the algebra.

use super::testing::Random;
use crate::math::dd::{Dd, Dd3};
use crate::math::{Frame, Ray};
use crate::scene::shape::{Cone, Cube, Cylinder, Shape, Sphere};
use glam::{DMat3, DVec3};

const FAR: f64 = f64::INFINITY;

/// The stretch of a line inside a solid, in double-double.
#[derive(Clone, Copy)]
pub struct Reference {
    pub enter: Dd,
    pub exit: Dd,
    /// Relative margin of the discriminant: 0 is tangent, negative passes outside.
    pub margin: f64,
}

impl Reference {
    const LINE: Reference = Reference { enter: Dd::MIN, exit: Dd::MAX, margin: 1.0 };

    fn clip(&mut self, enter: Dd, exit: Dd) {
        self.enter = self.enter.max(enter);
        self.exit = self.exit.min(exit);
    }

    /// 0 ≤ (o + t d) ≤ l.
    fn clip_slab(&mut self, o: Dd, d: Dd, low: Dd, high: Dd) {
        let (t0, t1) = ((low - o) / d, (high - o) / d);
        self.clip(t0.min(t1), t0.max(t1));
    }

    fn empty(&mut self) {
        self.clip(Dd::MAX, Dd::MIN);
    }
}

/// Roots of a t² + 2 b t + c, lesser first.
fn roots(a: Dd, b: Dd, c: Dd) -> Option<(Dd, Dd)> {
    let discriminant = b * b - a * c;
    if discriminant.to_f64() < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    let q = if b.to_f64() < 0.0 { root - b } else { -(b + root) };
    let (t0, t1) = (q / a, c / q);
    Some((t0.min(t1), t0.max(t1)))
}

fn sphere_reference(ray: &Ray, center: DVec3, radius: f64) -> Reference {
    let (o, d) = (Dd3::from(ray.origin) - Dd3::from(center), Dd3::from(ray.direction));
    let r2 = Dd::from(radius) * Dd::from(radius);
    let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - r2);
    let mut reference = Reference::LINE;
    reference.margin = ((b * b - a * c) / (r2 * a)).to_f64();
    match roots(a, b, c) {
        Some((t0, t1)) => reference.clip(t0, t1),
        None => reference.empty(),
    }
    reference
}

fn cylinder_reference(ray: &Ray, base: DVec3, top: DVec3, radius: f64) -> Reference {
    let (o, d) = (Dd3::from(ray.origin) - Dd3::from(base), Dd3::from(ray.direction));
    let axis = Dd3::from(top) - Dd3::from(base);
    let l2 = axis.dot(axis);
    let mut reference = Reference::LINE;
    reference.clip_slab(o.dot(axis), d.dot(axis), Dd::from(0.0), l2);
    let (oa, da) = (o.cross(axis), d.cross(axis));
    let r2 = Dd::from(radius) * Dd::from(radius) * l2;
    let (a, b, c) = (da.dot(da), oa.dot(da), oa.dot(oa) - r2);
    reference.margin = ((b * b - a * c) / (r2 * a)).to_f64();
    match roots(a, b, c) {
        Some((t0, t1)) => reference.clip(t0, t1),
        None => reference.empty(),
    }
    reference
}

fn cone_reference(ray: &Ray, base: DVec3, apex: DVec3, radius: f64) -> Reference {
    let (o, d) = (Dd3::from(ray.origin) - Dd3::from(apex), Dd3::from(ray.direction));
    // From the apex into the cone; inside ρ ≤ r z / l, that is l² |o × axis|² ≤ r² (o · axis)².
    let axis = Dd3::from(base) - Dd3::from(apex);
    let l2 = axis.dot(axis);
    let (oz, dz) = (o.dot(axis), d.dot(axis));
    let mut reference = Reference::LINE;
    reference.clip_slab(oz, dz, Dd::from(0.0), l2);
    let (oa, da) = (o.cross(axis), d.cross(axis));
    let r2 = Dd::from(radius) * Dd::from(radius);
    let form = |xa: Dd3, xz: Dd, ya: Dd3, yz: Dd| l2 * xa.dot(ya) - r2 * xz * yz;
    let (a, b, c) = (form(da, dz, da, dz), form(oa, oz, da, dz), form(oa, oz, oa, oz));
    // B² − A C against the greater of its two parts in moment form, r² l⁴ (m across the axis)².
    let m = o.cross(d);
    let across = m.cross(axis);
    reference.margin = ((b * b - a * c) / (r2 * l2 * l2 * across.dot(across))).to_f64();
    match roots(a, b, c) {
        // Shallow: between the roots; the slab removes the mirror nappe.
        Some((t0, t1)) if a.to_f64() > 0.0 => reference.clip(t0, t1),
        // Steep: beyond the root of our nappe.
        Some((_, t1)) if dz.to_f64() > 0.0 => reference.clip(t1, Dd::MAX),
        Some((t0, _)) => reference.clip(Dd::MIN, t0),
        None => reference.empty(),
    }
    reference
}

fn cube_reference(ray: &Ray, center: DVec3, edges: [DVec3; 3]) -> Reference {
    let (o, d) = (Dd3::from(ray.origin) - Dd3::from(center), Dd3::from(ray.direction));
    let mut reference = Reference::LINE;
    for i in 0..3 {
        let [e, f, g] = [0, 1, 2].map(|k| Dd3::from(edges[(i + k) % 3]));
        let normal = f.cross(g);
        let volume = e.dot(normal);
        reference.clip_slab(o.dot(normal), d.dot(normal), -volume, volume);
    }
    reference
}

/// To a multiple of 2⁻²⁴ of the power of two at `size`: coordinates up to 2²⁸ sizes fit 53 bits.
pub fn round(v: DVec3, size: f64) -> DVec3 {
    let grid = 2f64.powi(size.log2().floor() as i32 - 24);
    (v / grid).round() * grid
}

/// Counts that show that a sweep saw what it was made for.
#[derive(Debug, Default)]
pub struct Seen {
    pub hits: u32,
    pub misses: u32,
    pub grazing: u32,
}

/// Holds one ray against the reference.
///
/// Class: exact where the relative margin of the discriminant exceeds 1e-13 (the unit axis and the
/// rows of the unit frame are rounded: some 10 ε at the aspect ratios up to 10 that are tried).
/// Distance: the start is moved to within about `size` of the shape with each coordinate rounded once,
/// and the frame and the algebra add some tens of roundings of `size`; across the surface that is
/// 64 ε·size, along the ray 1 / cos times as much. The distance itself is rounded at t, on a sphere as a
/// quotient of two dot products: 8 roundings, 4 ε.
pub fn hold(shape: &Shape, ray: &Ray, reference: &Reference, size: f64, seen: &mut Seen) {
    let stretch = (reference.exit - reference.enter).to_f64();
    let hit = shape.intersect(ray, FAR, None);
    assert!(hit.is_none_or(|h| h.t.is_finite()));
    // Rims, edges and tangents within rounding may fall either way.
    if reference.margin.abs() < 1e-13 || stretch.abs() < 1e-9 * size || reference.exit.to_f64().abs() < 1e-9 * size {
        return;
    }
    let inside = stretch > 0.0 && reference.exit.to_f64() > 0.0;
    assert_eq!(hit.is_some(), inside, "margin {} stretch {stretch}: {shape:?} {ray:?}", reference.margin);
    let Some(hit) = hit else {
        seen.misses += 1;
        return;
    };
    seen.hits += 1;
    seen.grazing += u32::from(reference.margin < 1e-4);
    let expected = if reference.enter.to_f64() > 0.0 { reference.enter } else { reference.exit };
    let s = shape.surface(ray.at(hit.t), hit.face);
    let cos = s.normal.dot(ray.direction).abs();
    let error = (Dd::from(hit.t) - expected).to_f64().abs();
    // Near edge-on and near an apex the distance varies by more than its first order in the error.
    if cos > 1e-5 {
        let tolerance = 64.0 * f64::EPSILON * (size / cos) + 4.0 * f64::EPSILON * hit.t;
        assert!(error <= tolerance, "t {} off by {error}, tolerance {tolerance}: {shape:?} {ray:?}", hit.t);
    }
}

/// A ray at a point near the shape: at random, or past the silhouette by ±1e-7 … 1e-1 of the size, or
/// from inside.
pub fn ray_at(shape: &Shape, center: DVec3, size: f64, i: u32, random: &mut Random) -> Ray {
    let on = shape.sample_area(random.pair());
    let f = Frame::from_normal(on.normal);
    let (target, direction, distance) = match i % 3 {
        0 => (on.point, random.direction(), size * random.log_uniform(0.5, 6.0)),
        1 => {
            let miss = random.log_uniform(-7.0, -1.0) * if random.uniform() < 0.5 { size } else { -size };
            let (sin, cos) = crate::math::trig::sin_cos_turn(random.uniform());
            (on.point + on.normal * miss, f.s * cos + f.t * sin, size * random.log_uniform(0.5, 6.0))
        }
        _ => (on.point, (on.point - center).normalize(), (on.point - center).length() * random.uniform()),
    };
    let origin = round(target - direction * distance, size);
    Ray::new(origin, (target - origin).normalize())
}

/// Sizes over 8 decades; distances to 1e6 sizes.
pub fn place(random: &mut Random) -> (DVec3, f64) {
    let size = f64::from(random.log_uniform(-4.0, 4.0) as f32);
    (round(random.direction() * size * random.log_uniform(-3.0, 3.0), size), size)
}

/// A random closed shape of a kind (as in [`super::testing::random_shape`]) and one ray, held against the reference.
pub fn hold_one(kind: usize, i: u32, random: &mut Random, seen: &mut Seen) {
    let (at, size) = place(random);
    let mut end = || round(at + random.direction() * size * random.log_uniform(-1.0, 1.0), size);
    match kind {
        0 => {
            let shape = Sphere::new(at, size, DMat3::IDENTITY).map(Shape::Sphere).expect("a sphere");
            let ray = ray_at(&shape, at, size, i, random);
            hold(&shape, &ray, &sphere_reference(&ray, at, size), size, seen);
        }
        1 => {
            let m = random.rotation() * size;
            let edges = [m.x_axis, m.y_axis + 0.5 * m.x_axis, m.z_axis * random.log_uniform(-1.0, 0.0)];
            let shape = Cube::new(at, edges).map(Shape::Cube).expect("a cube");
            let ray = ray_at(&shape, at, size, i, random);
            hold(&shape, &ray, &cube_reference(&ray, at, edges), 2.0 * size, seen);
        }
        2 => {
            let top = end();
            let shape = Cylinder::new(at, top, size, true, true).map(Shape::Cylinder).expect("a cylinder");
            let ray = ray_at(&shape, 0.5 * (at + top), size, i, random);
            let reference = cylinder_reference(&ray, at, top, size);
            hold(&shape, &ray, &reference, size.max((top - at).length()), seen);
        }
        _ => {
            let apex = end();
            let shape = Cone::new(at, apex, size, true).map(Shape::Cone).expect("a cone");
            let ray = ray_at(&shape, at.lerp(apex, 0.25), size, i, random);
            let reference = cone_reference(&ray, at, apex, size);
            hold(&shape, &ray, &reference, size.max((apex - at).length()), seen);
        }
    }
}
