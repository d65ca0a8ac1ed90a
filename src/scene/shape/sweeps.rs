//! Sweeps over random shapes and rays: self-hits, missed exits, parity, areas.

use super::Shape;
use super::checks::{cross, crossings, direction_at, leave, leaving, shape_anywhere};
use super::testing::{KINDS, Random, random_shape};
use crate::math::{Frame, Ray};
use glam::{DMat3, DVec2, DVec3};

const FAR: f64 = f64::INFINITY;

/// Case O14, and that there are no self-hits and no missed exits: sizes 1e±6, offsets to 1e6 sizes, exit
/// cosines from 1e-6. A ray that leaves a convex surface outward never meets it again; a ray that goes
/// into a closed one comes out exactly once.
#[test]
fn no_shape_is_met_again_and_no_exit_is_missed() {
    let mut random = Random::new(14);
    for i in 0..500_000 {
        leave(i % KINDS, 4, &mut random).unwrap();
    }
}

/// The step off the side of a cone is 64 ε of the scale and turns the gradient of x² + y² − z² by that
/// over the distance from the axis. Exit cosines between the rounding of the point (8 ε) and that must
/// still fall on the right side.
#[test]
fn leaving_a_cone_near_the_apex_keeps_the_side() {
    let mut random = Random::new(15);
    for _ in 0..100_000 {
        let center = random.direction() * random.log_uniform(-3.0, 4.0);
        let shape = random_shape(3, center, 1.0, &mut random);
        // u.y = 0 is the apex; walk from there down a generator.
        let apex = shape.sample_area(DVec2::ZERO).point;
        let below = shape.sample_area(DVec2::new(0.4 * random.uniform(), 1.0)).point;
        let s = shape.surface(apex.lerp(below, random.log_uniform(-5.0, -1.0)), 0);
        let least = 8.0 * f64::EPSILON * s.scale / (1.0 - s.uv.y);
        if s.uv.y > 1.0 - 2.4e-7 || least > 1e-3 {
            continue;
        }
        let cos = least * random.log_uniform(0.0, 2.0);
        let outward = leaving(&s, 0, direction_at(cos, s.normal, &mut random));
        assert_eq!(shape.intersect(&outward, FAR, Some(0)), None, "{cos} {s:?}");
        let inward = leaving(&s, 0, direction_at(-cos, s.normal, &mut random));
        assert!(shape.intersect(&inward, FAR, Some(0)).is_some(), "{cos} {s:?}");
    }
}

/// Case O19 at every scale: the chord of a sphere at cosine c is 2 r c long. The origin is rounded to
/// 4 ε of its scale, which changes the chord by at most twice that; the step of 2⁻⁴⁶ (64 ε) off the
/// surface changes it by 2·64 ε·c of the scale.
#[test]
fn chords_of_spheres_are_two_r_cosine() {
    let mut random = Random::new(19);
    for _ in 0..100_000 {
        let (shape, size) = shape_anywhere(0, &mut random);
        let s = shape.surface(shape.sample_area(random.pair()).point, 0);
        let cos = random.log_uniform(-6.0, 0.0).max(64.0 * f64::EPSILON * s.scale / size);
        let ray = leaving(&s, 0, direction_at(-cos, s.normal, &mut random));
        let expected = -2.0 * size * ray.direction.dot(s.normal);
        let t = shape.intersect(&ray, FAR, Some(0)).unwrap().t;
        assert!((t - expected).abs() <= f64::EPSILON * s.scale * (16.0 + 256.0 * cos), "{t} {expected} {shape:?}");
    }
    let unit = random_shape(0, DVec3::ZERO, 1.0, &mut random);
    let d = DVec3::new(-1e-4, (1.0f64 - 1e-8).sqrt(), 0.0);
    let t = unit.intersect(&Ray::new(DVec3::X, d), FAR, Some(0)).unwrap().t;
    assert!((t / 2e-4 - 1.0).abs() < 1e-15, "{t}");
}

/// A shell 1e-6 of the radius above a sphere up to 1e5 radii from the origin is met by every ray that
/// leaves the sphere along its normal: the step off the surface, 2⁻⁴⁶·1e5 = 1.4e-9, is below the gap.
#[test]
fn a_neighbour_a_millionth_away_is_not_stepped_over() {
    let mut random = Random::new(27);
    for _ in 0..50_000 {
        let size = random.log_uniform(-6.0, 6.0);
        let center = random.direction() * size * random.log_uniform(-3.0, 5.0);
        let inner = super::Sphere::new(center, size, DMat3::IDENTITY).map(Shape::Sphere).unwrap();
        let outer = super::Sphere::new(center, size * (1.0 + 1e-6), DMat3::IDENTITY).map(Shape::Sphere).unwrap();
        let s = inner.surface(inner.sample_area(random.pair()).point, 0);
        let t = outer.intersect(&leaving(&s, 0, s.normal), FAR, None).unwrap().t;
        // Rounding to 4 ε of the scale at either end, and the step.
        let tolerance = (8.0 + 64.0) * f64::EPSILON * s.scale;
        assert!((t - size * 1e-6).abs() <= tolerance + f64::EPSILON * size * 2.0, "{t} {size}");
    }
}

/// Rays at closed shapes: at random, near the axis or an edge direction, at rims, edges and the apex.
/// Outside they cross none or two surfaces, from inside one.
#[test]
fn closed_shapes_are_crossed_an_even_number_of_times() {
    let mut random = Random::new(2);
    let mut even = [0; 4];
    for i in 0..300_000 {
        even[i % 4] += u32::from(cross(i % 4, i as u64 / 4, &mut random).unwrap());
    }
    assert!(even.iter().all(|&n| n > 5000), "{even:?}");
}

/// Cauchy and Crofton: lines uniform in a ball of radius R cross a surface of area A on average
/// 2A / 4πR² times, convex or not, closed or open.
#[test]
fn random_lines_cross_each_shape_in_proportion_to_its_area() {
    let mut random = Random::new(3);
    for kind in 0..KINDS - 1 {
        let shape = random_shape(kind, DVec3::new(0.1, 0.2, -0.3), 1.0, &mut random);
        let (low, high) = shape.bounds().unwrap();
        let (middle, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
        let n = 60_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let frame = Frame::from_normal(random.direction());
            let at = crate::math::warp::concentric_disk(random.pair()) * radius;
            let origin = middle + frame.s * at.x + frame.t * at.y - frame.n * (2.0 * radius);
            let count = f64::from(crossings(&shape, &Ray::new(origin, frame.n), 1.0).unwrap());
            sum += count;
            squares += count * count;
        }
        let mean = sum / f64::from(n);
        let error = ((squares / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
        let expected = shape.area() / (2.0 * std::f64::consts::PI * radius * radius);
        // z = 4.5, two-sided α = 7e-6 for each of nine shapes, fixed seed.
        assert!((mean - expected).abs() < 4.5 * error, "kind {kind}: {mean} {expected} ± {error}");
    }
}

/// A discriminant of 8e-5 is below the fixed threshold of 1e-3 that some tracers reject; these rays pass
/// 1e-5 of the radius inside the silhouette and must hit. 1e-5 outside they must miss.
#[test]
fn grazing_hits_are_found() {
    let sphere = super::Sphere::new(DVec3::ZERO, 1.0, DMat3::IDENTITY).map(Shape::Sphere).unwrap();
    let cylinder = super::Cylinder::new(-DVec3::Z, DVec3::Z, 1.0, true, true).map(Shape::Cylinder).unwrap();
    // At z = 0 this cone has radius 1.
    let cone = super::Cone::new(-DVec3::Z, DVec3::Z, 2.0, true).map(Shape::Cone).unwrap();
    for shape in [sphere, cylinder, cone] {
        for (b, hits) in [(1.0 - 1e-5, true), (1.0 + 1e-5, false)] {
            // Along the surface at (b, 0, 0); on the cone, too, y is in the tangent plane there.
            let ray = Ray::new(DVec3::new(b, -5.0, 0.0), DVec3::Y);
            assert_eq!(shape.intersect(&ray, FAR, None).is_some(), hits, "{shape:?} {b}");
        }
    }
}

/// From inside, the exit is found and the normal there points along the ray: the far root.
#[test]
fn a_camera_inside_sees_the_far_wall() {
    let mut random = Random::new(6);
    for kind in 0..7 {
        let shape = random_shape(kind, DVec3::ZERO, 1.0, &mut random);
        for _ in 0..2000 {
            let direction = random.direction();
            let hit = shape.intersect(&Ray::new(DVec3::ZERO, direction), FAR, None);
            if let Some(hit) = hit {
                assert!(shape.surface(direction * hit.t, hit.face).normal.dot(direction) > 0.0);
            }
            assert!(hit.is_some() || !shape.is_closed());
        }
    }
}

/// Case O33: u and v in [0, 1), north up, and the column next to the seam on either side is the same
/// column of the texture to within the step taken.
#[test]
fn sphere_texture_coordinates_are_clean_at_seam_and_poles() {
    let mut random = Random::new(33);
    let sphere = super::Sphere::new(DVec3::ZERO, 1.0, DMat3::IDENTITY).map(Shape::Sphere).unwrap();
    let uv = |p: DVec3| sphere.surface(p, 0).uv;
    for i in 0..300_000 {
        let p = match i % 3 {
            0 => random.direction(),
            // About the seam at −z and about the poles, down to the least numbers.
            1 => DVec3::new(
                random.log_uniform(-320.0, 0.0) * if i % 2 == 0 { 1.0 } else { -1.0 },
                random.range(-1.0, 1.0),
                -1.0,
            ),
            _ => DVec3::new(
                random.log_uniform(-20.0, -1.0),
                if i % 2 == 0 { 1.0 } else { -1.0 },
                -random.log_uniform(-20.0, -1.0),
            ),
        };
        let uv = uv(p);
        assert!(uv.cmpge(DVec2::ZERO).all() && uv.cmplt(DVec2::ONE).all(), "{p} {uv}");
        assert!((uv.as_vec2()).cmplt(glam::Vec2::ONE).all(), "{p} {uv} as f32");
    }
    let e = 1e-9;
    let (east, west) = (uv(DVec3::new(-e, 0.0, -1.0)), uv(DVec3::new(e, 0.0, -1.0)));
    let gap = (east.x - west.x).rem_euclid(1.0);
    // Two steps of 1e-9 radians, and the clamp below one of 2⁻²⁴.
    assert!(gap.min(1.0 - gap) < 2.0 * e + 1.2e-7, "{east} {west}");
    for (p, expected) in [
        (DVec3::Z, DVec2::new(0.5, 0.5)),
        (DVec3::X, DVec2::new(0.75, 0.5)),
        (DVec3::NEG_X, DVec2::new(0.25, 0.5)),
        (DVec3::new(0.0, 1.0, 1.0), DVec2::new(0.5, 0.75)),
        (DVec3::NEG_Y, DVec2::new(0.5, 0.0)),
    ] {
        assert!((uv(p) - expected).abs().max_element() < 1e-15, "{p}: {} {expected}", uv(p));
    }
}

/// With [`super::sphere::Z_POLE`]: u = φ/2π from +x towards +y, v = 1 − θ/π from +z.
#[test]
fn the_z_pole_frame_gives_the_other_usual_convention() {
    let sphere = super::Sphere::new(DVec3::ZERO, 2.0, super::sphere::Z_POLE).map(Shape::Sphere).unwrap();
    for i in 0..100u32 {
        for j in 1..20u32 {
            let (turn, theta) = (f64::from(i) / 100.0, f64::from(j) / 20.0 * std::f64::consts::PI);
            let (phi, rho) = (turn * std::f64::consts::TAU, theta.sin());
            let p = DVec3::new(rho * phi.cos(), rho * phi.sin(), theta.cos()) * 2.0;
            let uv = sphere.surface(p, 0).uv;
            let off = (uv.x - turn + 0.5).rem_euclid(1.0) - 0.5;
            // The clamp below one, where φ rounds to just below 2π.
            assert!(off.abs() < 6e-8 && (uv.y - (1.0 - theta / std::f64::consts::PI)).abs() < 1e-15, "{p} {uv}");
        }
    }
}

/// `cargo test --release --lib scene::shape::sweeps::nanoseconds -- --ignored --nocapture`
#[test]
#[ignore = "prints timings"]
fn nanoseconds_per_intersection() {
    use std::hint::black_box;
    let mut random = Random::new(8);
    for kind in 0..KINDS {
        let data: Vec<(Shape, Ray)> = (0..4096)
            .map(|_| {
                let center = random.direction() * 10.0;
                let shape = random_shape(kind, center, 1.0, &mut random);
                let origin = center + random.direction() * random.log_uniform(0.3, 3.0);
                let target = center + random.direction() * random.uniform();
                (shape, Ray::new(origin, (target - origin).normalize()))
            })
            .collect();
        let mut best = FAR;
        let mut hits = 0;
        for _ in 0..20 {
            let start = std::time::Instant::now();
            hits = 0;
            for _ in 0..10 {
                for (shape, ray) in &data {
                    hits += usize::from(black_box(shape).intersect(black_box(ray), black_box(FAR), None).is_some());
                }
            }
            best = best.min(start.elapsed().as_secs_f64() * 1e9 / (10.0 * data.len() as f64));
        }
        println!("kind {kind}: {best:5.1} ns, {:3} % hits", hits * 10 / data.len());
    }
}
