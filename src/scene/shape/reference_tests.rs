//! Hits and misses held against double-double references, and the published hard cases of spheres.
//!
//! Centres and origins are rounded to a grid of 2⁻²⁴ sizes, so that differences of positions are exact
//! in f64; directions are f64. What is left to err is the algebra.

use super::testing::Random;
use super::{Cone, Cube, Cylinder, Rectangle, Shape, Sphere};
use crate::math::dd::{Dd, Dd3};
use crate::math::{Frame, Ray};
use glam::{DMat3, DVec3};

const FAR: f64 = f64::INFINITY;

/// The stretch of a line inside a solid, in double-double.
#[derive(Clone, Copy)]
struct Reference {
    enter: Dd,
    exit: Dd,
    /// Relative margin of the discriminant: 0 is tangent, negative passes outside.
    margin: f64,
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
fn round(v: DVec3, size: f64) -> DVec3 {
    let grid = 2f64.powi(size.log2().floor() as i32 - 24);
    (v / grid).round() * grid
}

/// Counts that show that a sweep saw what it was made for.
#[derive(Debug, Default)]
struct Seen {
    hits: u32,
    misses: u32,
    grazing: u32,
}

/// Holds one ray against the reference.
///
/// Class: exact where the relative margin of the discriminant exceeds 1e-13 (the unit axis and the
/// rows of the unit frame are rounded: some 10 ε at the aspect ratios up to 10 that are tried).
/// Distance: the start is moved to within about `size` of the shape with each coordinate rounded once,
/// and the frame and the algebra add some tens of roundings of `size`; across the surface that is
/// 64 ε·size, along the ray 1 / cos times as much. The distance itself is rounded at t, on a sphere as a
/// quotient of two dot products: 8 roundings, 4 ε.
fn hold(shape: &Shape, ray: &Ray, reference: &Reference, size: f64, seen: &mut Seen) {
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
fn ray_at(shape: &Shape, center: DVec3, size: f64, i: u32, random: &mut Random) -> Ray {
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
fn place(random: &mut Random) -> (DVec3, f64) {
    let size = f64::from(random.log_uniform(-4.0, 4.0) as f32);
    (round(random.direction() * size * random.log_uniform(-3.0, 3.0), size), size)
}

fn check(seen: &Seen) {
    assert!(seen.hits > 1000 && seen.misses > 1000 && seen.grazing > 100, "{seen:?}");
}

#[test]
fn sphere_hits_match_double_double() {
    let mut random = Random::new(101);
    let mut seen = Seen::default();
    for i in 0..150_000 {
        let (center, size) = place(&mut random);
        let shape = Sphere::new(center, size, DMat3::IDENTITY).map(Shape::Sphere).unwrap();
        let ray = ray_at(&shape, center, size, i, &mut random);
        hold(&shape, &ray, &sphere_reference(&ray, center, size), size, &mut seen);
    }
    check(&seen);
}

#[test]
fn cylinder_hits_match_double_double() {
    let mut random = Random::new(102);
    let mut seen = Seen::default();
    for i in 0..100_000 {
        let (base, size) = place(&mut random);
        let top = round(base + random.direction() * size * random.log_uniform(-1.0, 1.0), size);
        let shape = Cylinder::new(base, top, size, true, true).map(Shape::Cylinder).unwrap();
        let ray = ray_at(&shape, 0.5 * (base + top), size, i, &mut random);
        let reference = cylinder_reference(&ray, base, top, size);
        hold(&shape, &ray, &reference, size.max((top - base).length()), &mut seen);
    }
    check(&seen);
}

#[test]
fn cone_hits_match_double_double() {
    let mut random = Random::new(103);
    let mut seen = Seen::default();
    for i in 0..100_000 {
        let (base, size) = place(&mut random);
        let apex = round(base + random.direction() * size * random.log_uniform(-1.0, 1.0), size);
        let shape = Cone::new(base, apex, size, true).map(Shape::Cone).unwrap();
        let ray = ray_at(&shape, base.lerp(apex, 0.25), size, i, &mut random);
        let reference = cone_reference(&ray, base, apex, size);
        hold(&shape, &ray, &reference, size.max((apex - base).length()), &mut seen);
    }
    check(&seen);
}

#[test]
fn cube_hits_match_double_double() {
    let mut random = Random::new(104);
    let mut seen = Seen::default();
    for i in 0..100_000 {
        let (center, size) = place(&mut random);
        let m = random.rotation() * size;
        let edges = [m.x_axis, m.y_axis + 0.5 * m.x_axis, m.z_axis * random.log_uniform(-1.0, 0.0)];
        let shape = Cube::new(center, edges).map(Shape::Cube).unwrap();
        let ray = ray_at(&shape, center, size, i, &mut random);
        hold(&shape, &ray, &cube_reference(&ray, center, edges), 2.0 * size, &mut seen);
    }
    assert!(seen.hits > 1000 && seen.misses > 1000, "{seen:?}");
}

/// Coordinates on the patch are a = −m·v / (d·N), b = m·u / (d·N) with m = o × d and N = u × v. In f64
/// they err by some tens of ε over the cosine of incidence, from 1e6 sizes away as from near.
#[test]
fn rectangle_edges_match_double_double() {
    let mut random = Random::new(105);
    let mut inside = 0;
    for _ in 0..100_000 {
        let (corner, size) = place(&mut random);
        let m = random.rotation() * size;
        let (u, v) = (m.x_axis, m.y_axis + 0.5 * m.x_axis);
        let shape = Rectangle::new(corner, u, v).map(Shape::Rectangle).unwrap();
        // At a point within 1e-14 … 1e-1 of an edge.
        let off = random.log_uniform(-14.0, -1.0) * if random.uniform() < 0.5 { 1.0 } else { -1.0 };
        let target = corner + u * off + v * random.uniform();
        let origin = round(target + random.direction() * size * random.log_uniform(0.0, 6.0), size);
        let ray = Ray::new(origin, (target - origin).normalize());
        let (o, d) = (Dd3::from(ray.origin) - Dd3::from(corner), Dd3::from(ray.direction));
        let (u, v) = (Dd3::from(u), Dd3::from(v));
        let moment = o.cross(d);
        let across = d.dot(u.cross(v));
        let (a, b) = ((-moment.dot(v) / across).to_f64(), (moment.dot(u) / across).to_f64());
        let cos = across.to_f64().abs() / (size * size);
        let edge_distance = a.min(1.0 - a).min(b).min(1.0 - b);
        // The rectangle is larger than its edges by 16 ε of its largest coordinate, √1.25 of that in a.
        let pad = 18.0 * f64::EPSILON * (corner.abs().max_element() / size + 2.0);
        if edge_distance.abs() < 64.0 * f64::EPSILON / cos + pad {
            continue;
        }
        inside += u32::from(edge_distance > 0.0);
        assert_eq!(shape.intersect(&ray, FAR, None).is_some(), edge_distance > 0.0, "{a} {b} {shape:?} {ray:?}");
    }
    assert!(inside > 30_000, "{inside}");
}

/// Case O01. In units of the radius: t = 1e6 − √(1 − 0.25) = 999999.133974596…, z = −√0.75.
#[test]
fn a_unit_sphere_is_met_from_a_million_radii() {
    let shape = Sphere::new(DVec3::ZERO, 1.0, DMat3::IDENTITY).map(Shape::Sphere).unwrap();
    let ray = Ray::new(DVec3::new(0.5, 0.0, -1e6), DVec3::Z);
    let hit = shape.intersect(&ray, FAR, None).unwrap();
    // t is rounded to 1.2e-10, and so is the point along the ray.
    assert!((hit.t - 999_999.133_974_596_2).abs() < 2.4e-10, "{hit:?}");
    let p = shape.surface(ray.at(hit.t), 0).point;
    assert!((p - DVec3::new(0.5, 0.0, -(0.75f64.sqrt()))).length() < 2.4e-10, "{p}");
}

/// Case O02: impact parameter 1 ± 1e-12 from 1e3 radii; the discriminant is ∓2e-12, its error 4 ε.
#[test]
fn hit_and_miss_are_exact_a_trillionth_from_tangency() {
    let shape = Sphere::new(DVec3::ZERO, 1.0, DMat3::IDENTITY).map(Shape::Sphere).unwrap();
    for (b, hits) in [(1.0 - 1e-12, true), (1.0 + 1e-12, false)] {
        for (x, y) in [(b, 0.0), (0.0, b), (b * 0.6, b * 0.8)] {
            let ray = Ray::new(DVec3::new(x, y, -1e3), DVec3::Z);
            assert_eq!(shape.intersect(&ray, FAR, None).is_some(), hits, "{x} {y}");
        }
    }
}

/// Case O03: 1.7 m above a sphere of 6371 km the horizon is √(2·6371000·1.7 + 1.7²) = 4654.181226597 m
/// away. The last ray that hits is found by bisection; entry and exit lie evenly about the horizon.
#[test]
fn the_horizon_is_where_it_should_be() {
    let r = 6_371_000.0;
    let shape = Sphere::new(DVec3::new(0.0, -r, 0.0), r, DMat3::IDENTITY).map(Shape::Sphere).unwrap();
    let eye = DVec3::new(0.0, 1.7, 0.0);
    let ray = |slope: f64| Ray::new(eye, DVec3::new(1.0, -slope, 0.0).normalize());
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if shape.intersect(&ray(middle), FAR, None).is_some() {
            high = middle;
        } else {
            low = middle;
        }
    }
    let ray = ray(high);
    let enter = shape.intersect(&ray, FAR, None).unwrap().t;
    let on = shape.surface(ray.at(enter), 0).point;
    let chord = shape.intersect(&Ray::new(on, ray.direction), FAR, Some(0)).unwrap().t;
    let horizon = enter + 0.5 * chord;
    assert!((horizon / 4_654.181_226_597 - 1.0).abs() < 1e-9, "{horizon}");
}
