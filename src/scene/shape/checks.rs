//! Rays that leave shapes and go through them; shared with `tests/numerics/sweep`, which compiles this file too.

use super::testing::{Random, random_shape};
use crate::math::{Departure, Frame, Ray};
use crate::scene::shape::{Shape, ShapeHit, SurfacePoint};
use glam::DVec3;

const FAR: f64 = f64::INFINITY;

/// Size log-uniform over 12 decades, centre up to 1e6 sizes from the origin.
pub fn shape_anywhere(kind: usize, random: &mut Random) -> (Shape, f64) {
    let size = random.log_uniform(-6.0, 6.0);
    let offset = if random.uniform() < 0.25 { 0.0 } else { size * random.log_uniform(-3.0, 6.0) };
    let center = random.direction() * offset;
    (random_shape(kind, center, size, random), size)
}

/// A unit direction at the given cosine to the normal.
pub fn direction_at(cos: f64, normal: DVec3, random: &mut Random) -> DVec3 {
    let frame = Frame::from_normal(normal);
    let (sin_phi, cos_phi) = crate::math::trig::sin_cos_turn(random.uniform());
    let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
    frame.to_world(DVec3::new(sin * cos_phi, sin * sin_phi, cos)).normalize()
}

pub fn leaving(s: &SurfacePoint, face: u8, direction: DVec3) -> Ray {
    Ray::leaving(s.point, s.scale, s.normal, direction, Departure::new(0, u32::from(face)))
}

fn is_in(point: DVec3, (low, high): (DVec3, DVec3)) -> bool {
    point.cmpge(low).all() && point.cmple(high).all()
}

/// The least exit cosine for which the side of the surface that a direction is on is known: a point
/// is rounded to a few ε of `scale`, which turns the normal by that over the radius of curvature.
fn least_cosine(shape: &Shape, s: &SurfacePoint, size: f64) -> f64 {
    let curvature_radius = match shape {
        // Near the apex the side curves within its distance from the axis; v is clamped below one,
        // so nearer than 2⁻²³ of the height that distance is not known here: nothing is asked.
        Shape::Cone(_) if s.uv.y > 1.0 - 2.4e-7 => return f64::INFINITY,
        Shape::Cone(_) if s.uv.y > 0.0 => size.min(size * (1.0 - s.uv.y)),
        _ => size,
    };
    1e-6f64.max(8.0 * f64::EPSILON * s.scale / curvature_radius)
}

/// Two rays from each of `points` places of a random shape of a kind: one outward, which never meets the shape again where
/// that is convex, and one inward, which comes out exactly once where it is closed. How many rays were asked.
pub fn leave(kind: usize, points: u32, random: &mut Random) -> Result<u64, String> {
    let (shape, size) = shape_anywhere(kind, random);
    let mut rays = 0;
    for _ in 0..points {
        let area = shape.sample_area(random.pair());
        let s = shape.surface(area.point, area.face);
        let least = least_cosine(&shape, &s, size);
        if least > 1.0 {
            continue;
        }
        rays += 2;
        let cos = random.log_uniform(least.log10(), 0.0).min(1.0);
        let outward = leaving(&s, area.face, direction_at(cos, s.normal, random));
        if shape.intersect(&outward, FAR, Some(area.face)).is_some() {
            return Err(format!("self-hit: {shape:?} {s:?} {outward:?}"));
        }
        let inward = leaving(&s, area.face, direction_at(-cos, s.normal, random));
        let hit = shape.intersect(&inward, FAR, Some(area.face));
        if let Some(ShapeHit { t, face }) = hit {
            let exit = shape.surface(inward.at(t), face);
            if t <= 0.0 || !shape.bounds().is_some_and(|bounds| is_in(exit.point, bounds)) {
                return Err(format!("an exit outside: {shape:?} {exit:?}"));
            }
        }
        if shape.is_closed() && hit.is_none() {
            return Err(format!("missed exit: {shape:?} {s:?} {inward:?} cos {cos}"));
        }
        if matches!(shape, Shape::Plane(_) | Shape::Disk(_) | Shape::Rectangle(_)) && hit.is_some() {
            return Err(format!("a flat face met itself: {shape:?} {s:?} {inward:?}"));
        }
    }
    Ok(rays)
}

/// Follows a ray through a shape; returns how many surfaces it crosses.
pub fn crossings(shape: &Shape, ray: &Ray, size: f64) -> Result<u32, String> {
    let mut ray = *ray;
    let mut departing = None;
    for count in 0..4 {
        let Some(hit) = shape.intersect(&ray, FAR, departing) else { return Ok(count) };
        let s = shape.surface(ray.at(hit.t), hit.face);
        if shape.bounds().is_some_and(|b| !is_in(s.point, b)) {
            return Err(format!("hit outside the bounds: {s:?}"));
        }
        // Hits nearer to edge-on than the point is rounded have no known side: not asked about.
        let reach = s.scale.max(ray.origin.abs().max_element());
        if s.normal.dot(ray.direction).abs() < least_cosine(shape, &s, size).max(64.0 * f64::EPSILON * reach / size) {
            return Ok(u32::MAX);
        }
        ray = leaving(&s, hit.face, ray.direction);
        departing = Some(hit.face);
    }
    Err("more than three crossings".into())
}

/// A ray at a closed shape and one from within: at random, near the axis or an edge direction, at rims, edges and the apex,
/// by `i`. From outside it crosses none or two surfaces, from inside one; whether it was two.
pub fn cross(kind: usize, i: u64, random: &mut Random) -> Result<bool, String> {
    let size = random.log_uniform(-4.0, 4.0);
    let center = random.direction() * size * random.log_uniform(-3.0, 4.0);
    let shape = random_shape(kind, center, size, random);
    let on = shape.sample_area(random.pair());
    let inside = center.lerp(on.point, 0.999 * random.uniform());
    let target = match i % 3 {
        0 => inside,
        // Onto a rim, an edge or the apex, as near as bounds tell.
        1 => on.point + random.direction() * size * random.log_uniform(-9.0, -1.0),
        _ => shape.surface(on.point + random.direction() * 10.0 * size, on.face).point,
    };
    let direction = if i.is_multiple_of(2) {
        random.direction()
    } else {
        // Nearly along the surface.
        direction_at(random.log_uniform(-6.0, 0.0), on.normal, random)
    };
    let far = Ray::new(target - direction * size * random.log_uniform(2.0, 4.0), direction);
    let through = match crossings(&shape, &far, size) {
        Ok(0) | Ok(u32::MAX) => false,
        Ok(2) => true,
        found => return Err(format!("{found:?} crossings: {shape:?} {far:?}")),
    };
    match crossings(&shape, &Ray::new(inside, direction), size) {
        Ok(1) | Ok(u32::MAX) => Ok(through),
        found => Err(format!("{found:?} crossings from inside: {shape:?} {inside} {direction}")),
    }
}
