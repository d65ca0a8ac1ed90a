//! Shapes as lights: densities against solid angles, and every sample on the shape.

use super::testing::{KINDS, Random, random_shape};
use super::{Shape, Sphere};
use crate::math::Ray;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

const FAR: f64 = f64::INFINITY;

/// Every sample lies on the shape, in its bounds, with the normal of the surface there; a plane gives
/// none.
#[test]
fn area_samples_lie_on_the_surface() {
    let mut random = Random::new(41);
    for i in 0..60_000 {
        let kind = i % KINDS;
        let size = random.log_uniform(-6.0, 6.0);
        let center = random.direction() * size * random.log_uniform(-3.0, 6.0);
        let shape = random_shape(kind, center, size, &mut random);
        let a = shape.sample_area(random.pair());
        if kind == KINDS - 1 {
            assert_eq!((a.pdf_area, shape.area()), (0.0, FAR));
            continue;
        }
        let s = shape.surface(a.point, a.face);
        assert!((a.point - s.point).length() <= 16.0 * f64::EPSILON * s.scale, "{shape:?} {a:?} {s:?}");
        // A point rounded to ε·scale turns a normal by that over the radius of curvature: at the apex
        // of a cone without bound, so only the size is asked for.
        let turn = (a.normal - s.normal).length();
        let by_apex = matches!(shape, Shape::Cone(_)) && s.uv.y > 0.99;
        assert!(by_apex || turn <= 64.0 * f64::EPSILON * (1.0 + 100.0 * s.scale / size), "{turn} {shape:?}");
        assert!((a.pdf_area * shape.area() - 1.0).abs() < 1e-14);
        let (low, high) = shape.bounds().unwrap();
        assert!(a.point.cmpge(low).all() && a.point.cmple(high).all(), "{shape:?} {a:?}");
    }
}

/// A ray along each direction meets the shape, at the sample if that faces the viewer, and there
/// `pdf_toward` says what `sample_toward` said.
#[test]
fn samples_toward_a_shape_hit_it_with_the_density_they_state() {
    let mut random = Random::new(42);
    let mut checked = 0;
    for i in 0..100_000 {
        let kind = i % (KINDS - 1);
        let shape = random_shape(kind, DVec3::ZERO, 1.0, &mut random);
        let inside = i % 4 == 0;
        let from = random.direction() * if inside { 0.02 } else { random.log_uniform(1.2, 3.0) };
        let Some(sample) = shape.sample_toward(from, random.pair()) else { continue };
        assert!(sample.pdf_solid_angle > 0.0 && sample.pdf_solid_angle.is_finite());
        assert!((from + sample.direction * sample.distance - sample.point).length() < 1e-12 * sample.distance.max(1.0));
        let cos = sample.direction.dot(sample.normal);
        // At the silhouette rounding decides; distances there err by ε d / cos.
        if cos.abs() < 1e-4 {
            continue;
        }
        let hit = shape.intersect(&Ray::new(from, sample.direction), FAR, None).expect("a sample that misses");
        let s = shape.surface(from + sample.direction * hit.t, hit.face);
        let reached = (hit.t - sample.distance).abs() < 1e-11 * sample.distance.max(1.0) / cos.abs();
        // Open shapes may stand in their own way; closed ones sample only what can be seen.
        assert!(reached || !shape.is_closed(), "{shape:?} {from} {sample:?} {hit:?}");
        if reached {
            checked += 1;
            assert_eq!(hit.face, sample.face);
            let pdf = shape.pdf_toward(from, sample.direction, hit.t, s.normal);
            // d² / cos: the relative error of a cosine is ε d / (cos · curvature radius ≥ 0.1 or so).
            let tolerance = 1e-9 / cos.abs();
            assert!((pdf / sample.pdf_solid_angle - 1.0).abs() < tolerance, "{pdf} {sample:?} {shape:?}");
        }
    }
    assert!(checked > 60_000, "{checked}");
}

/// The mean of 1/pdf over samples whose points are seen is the solid angle of the shape, which directions
/// uniform on the sphere estimate too. Near edges where cos → 0 the former is bounded by the latter's
/// geometry: area sampling has 1/pdf = A cos / d².
#[test]
fn densities_integrate_to_the_solid_angle() {
    let mut random = Random::new(43);
    for kind in 0..KINDS - 1 {
        let shape = random_shape(kind, DVec3::ZERO, 1.0, &mut random);
        for distance in [0.02, 3.0, 20.0] {
            let from = random.direction() * distance;
            let n = 40_000;
            let (mut sum, mut squares) = (0.0, 0.0);
            let mut hits = 0.0;
            // From afar, uniform directions in a cone that holds the shape (bounding radius 11).
            let one_minus_cos: f64 = if distance > 12.0 {
                let s: f64 = 11.0 / distance;
                s * s / (1.0 + (1.0 - s * s).sqrt())
            } else {
                2.0
            };
            let frame = crate::math::Frame::from_normal(-from.normalize());
            for _ in 0..n {
                if let Some(sample) = shape.sample_toward(from, random.pair()) {
                    let first = shape.intersect(&Ray::new(from, sample.direction), FAR, None);
                    // Seen unless something is clearly nearer.
                    if first.is_none_or(|h| h.t > sample.distance * (1.0 - 1e-7)) {
                        sum += 1.0 / sample.pdf_solid_angle;
                        squares += sample.pdf_solid_angle.powi(-2);
                    }
                }
                let d = frame.to_world(crate::math::warp::uniform_cone(random.pair(), one_minus_cos));
                hits += f64::from(u8::from(shape.intersect(&Ray::new(from, d), FAR, None).is_some()));
            }
            let n = f64::from(n);
            let by_samples = sum / n;
            let error_samples = ((squares / n - by_samples * by_samples).max(0.0) / n).sqrt();
            let cone = TAU * one_minus_cos;
            let p = hits / n;
            let by_hits = p * cone;
            let error_hits = cone * (p * (1.0 - p) / n).sqrt();
            // z = 4.5, two-sided α = 7e-6 for each of 27 comparisons, fixed seed.
            let tolerance = 4.5 * error_samples.hypot(error_hits) + 1e-9;
            assert!(
                (by_samples - by_hits).abs() < tolerance,
                "kind {kind} from {distance}: {by_samples} {by_hits} ± {tolerance}"
            );
        }
    }
}

/// Case O26: at s = r/d = 1e-4 the solid angle is 2π s² / (1 + √(1 − s²)) = 3.14159266144e-8 (published to 12
/// digits); from inside and from the surface itself densities are finite.
#[test]
fn the_density_of_a_sphere_light_is_right_from_afar_and_finite_up_close() {
    let sphere = Sphere::new(DVec3::ZERO, 1.0, DMat3::IDENTITY).map(Shape::Sphere).unwrap();
    let from = DVec3::new(0.0, 0.0, 1e4);
    let sample = sphere.sample_toward(from, DVec2::new(0.3, 0.7)).unwrap();
    assert!((sample.pdf_solid_angle * 3.141_592_661_44e-8 - 1.0).abs() < 1e-11, "{sample:?}");
    assert!((sample.point.length() - 1.0).abs() < 4.0 * f64::EPSILON && sample.normal.z > 0.0);

    let mut random = Random::new(26);
    for from in [DVec3::ZERO, DVec3::X * 0.7, DVec3::X, DVec3::X * 1.0f64.next_up(), DVec3::X * 1.0f64.next_down()] {
        let samples = (0..10_000).filter_map(|_| sphere.sample_toward(from, random.pair()));
        let met = samples.fold(0, |met, sample| {
            assert!(sample.pdf_solid_angle.is_finite() && sample.distance > 0.0, "{from} {sample:?}");
            assert!(sample.direction.is_normalized() && sample.point.is_finite());
            met + 1
        });
        assert!(met > 9_900, "{from}: {met}");
    }
    // Just outside a sphere fills half the sky, less √(2 · 1e-12): density 1/2π.
    let just_outside = sphere.pdf_toward(DVec3::X * (1.0 + 1e-12), DVec3::NEG_X, 2.0, DVec3::X);
    assert!((just_outside * 2.0 * PI - 1.0).abs() < 2e-6, "{just_outside}");
    // By rounding alone outside is on it: its far side, 2 away, has t²/(A cos θ) = 1/π.
    let on = sphere.pdf_toward(DVec3::X * 1.0f64.next_up(), DVec3::NEG_X, 2.0, DVec3::X);
    assert!((on * PI - 1.0).abs() < 1e-12, "{on}");
}

#[test]
fn a_light_seen_edge_on_has_no_samples_and_no_density() {
    let mut random = Random::new(44);
    let o = DVec3::ZERO;
    let flats = [
        super::Disk::new(o, DVec3::X, DVec3::Y).map(Shape::Disk).unwrap(),
        super::Rectangle::new(o, DVec3::X, DVec3::Y).map(Shape::Rectangle).unwrap(),
        super::Plane::new(o, DVec3::Z, DVec3::X).map(Shape::Plane).unwrap(),
    ];
    for shape in flats {
        for from in [DVec3::X * 3.0, DVec3::X * 0.5] {
            assert!(shape.sample_toward(from, random.pair()).is_none());
            assert_eq!(shape.pdf_toward(from, DVec3::NEG_X, 2.0, DVec3::Z), 0.0);
            assert_eq!(shape.pdf_toward(from, DVec3::NEG_X, 0.0, DVec3::Z), 0.0);
        }
    }
}

/// Areas in closed form: sphere 4πr², box 2·(2·2 + 2·4 + 2·4)… , cylinder 2πrh + 2πr², cone πrs + πr².
#[test]
fn areas_are_those_of_the_textbook() {
    let z = DVec3::Z;
    let cases = [
        (Sphere::new(z, 3.0, DMat3::IDENTITY).map(Shape::Sphere), 36.0 * PI),
        (super::Cube::new(z, [DVec3::X, DVec3::Y, z * 2.0]).map(Shape::Cube), 2.0 * (4.0 + 8.0 + 8.0)),
        (super::Cylinder::new(z, z * 3.0, 0.5, true, true).map(Shape::Cylinder), 2.5 * PI),
        (super::Cylinder::new(z, z * 3.0, 0.5, false, false).map(Shape::Cylinder), 2.0 * PI),
        (super::Cone::new(z, z * 5.0, 3.0, true).map(Shape::Cone), 24.0 * PI),
        (super::Disk::new(z, DVec3::X * 2.0, DVec3::Y * 3.0).map(Shape::Disk), 6.0 * PI),
        (super::Rectangle::new(z, DVec3::X * 2.0, DVec3::new(1.0, 3.0, 0.0)).map(Shape::Rectangle), 6.0),
    ];
    for (shape, expected) in cases {
        let area = shape.unwrap().area();
        assert!((area / expected - 1.0).abs() < 8.0 * f64::EPSILON, "{area} {expected}");
    }
}
