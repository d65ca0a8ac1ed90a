//! Hits and misses held against double-double references, and the published hard cases of spheres.

use super::reference::{Seen, hold_one, place, round};
use super::testing::Random;
use super::{Rectangle, Shape, Sphere};
use crate::math::Ray;
use crate::math::dd::Dd3;
use glam::{DMat3, DVec3};

const FAR: f64 = f64::INFINITY;

/// What a sweep over one kind of shape saw.
fn sweep(kind: usize, seed: u64, rays: u32) -> Seen {
    let mut random = Random::new(seed);
    let mut seen = Seen::default();
    (0..rays).for_each(|i| hold_one(kind, i, &mut random, &mut seen));
    assert!(seen.hits > 1000 && seen.misses > 1000, "{seen:?}");
    seen
}

#[test]
fn sphere_hits_match_double_double() {
    assert!(sweep(0, 101, 150_000).grazing > 100);
}

#[test]
fn cylinder_hits_match_double_double() {
    assert!(sweep(2, 102, 100_000).grazing > 100);
}

#[test]
fn cone_hits_match_double_double() {
    assert!(sweep(3, 103, 100_000).grazing > 100);
}

#[test]
fn cube_hits_match_double_double() {
    sweep(1, 104, 100_000);
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
