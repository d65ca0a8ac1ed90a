//! Textbook intersectors of curves in single precision, kept to measure against: see [`crate::scene::watch`].
//!
//! Linear pieces by the quadratics of the cone and of the two balls (Glassner 1989, "An Introduction to Ray Tracing",
//! chapter 2). Tubes by the iteration of Reshetov and Luebke 2018, "Phantom Ray-Hair Intersector", PACMCGIT 1 (2): the
//! cone that touches the tube at some u is met by the ray, and the next u is that of the plane across the curve through
//! this point. Where it stands still the point is on the circle of u: the tube is that of `tube.rs`. As there, curves
//! are met only from outside. The faults: discriminants that cancel; a u that leaves the piece before it comes back, or
//! that rounding keeps from standing still.

use super::{Curves, Pieces, RoundCone, Tube};
use crate::scene::shape::plain::roots;
use glam::{Vec3, Vec4};

impl Curves {
    /// Where the ray enters a segment, at t > 0.
    #[must_use]
    pub(in crate::scene) fn meet_plain(&self, segment: u32, origin: Vec3, direction: Vec3) -> Option<f32> {
        match &self.pieces {
            Pieces::Cones(cones) => enter_cone(&cones[segment as usize], origin, direction).filter(|&t| t > 0.0),
            Pieces::Tubes(tubes, first) => {
                let [from, to] = [segment, segment + 1].map(|i| first[i as usize] as usize);
                tubes[from..to].iter().filter_map(|tube| enter_tube(tube, origin, direction)).reduce(f32::min)
            }
        }
    }
}

/// Where the line enters the hull of two balls: at the first of all points where it meets the wall or a ball.
fn enter_cone(cone: &RoundCone, origin: Vec3, direction: Vec3) -> Option<f32> {
    let (start, axis) = (cone.start.as_vec3(), cone.axis.as_vec3());
    let (radius, taper) = (cone.radius as f32, cone.taper as f32);
    let ball = |center: Vec3, radius: f32| {
        let w = origin - center;
        roots(direction.dot(direction), 2.0 * w.dot(direction), w.dot(w) - radius * radius)
    };
    // The wall of `cone.rs`: |w|² − r₀² = (w·a − ρ r₀)²/D, with w = o − p₀ + t d, from v = 0 to 1.
    let spread = axis.dot(axis) - taper * taper;
    let wall = || {
        let w = origin - start;
        let (m, n) = (w.dot(axis) - taper * radius, direction.dot(axis));
        let a = spread * direction.dot(direction) - n * n;
        let b = 2.0 * (spread * w.dot(direction) - m * n);
        let found = roots(a, b, spread * (w.dot(w) - radius * radius) - m * m)?;
        Some(found.into_iter().filter(move |t| (0.0..=1.0).contains(&((m + t * n) / spread))))
    };
    let walls = if spread > 0.0 { wall() } else { None };
    let balls = [ball(start, radius), ball(start + axis, radius - taper)];
    walls.into_iter().flatten().chain(balls.into_iter().flatten().flatten()).reduce(f32::min)
}

/// Where the ray enters a tube, at t > 0.
fn enter_tube(tube: &Tube, origin: Vec3, direction: Vec3) -> Option<f32> {
    // In coordinates where the ray is the z axis; radii beside them.
    let (x, y) = direction.any_orthonormal_pair();
    let points = tube.points.map(|p| {
        let p = p.map(|c| c as f32);
        let w = Vec3::new(p[0], p[1], p[2]) - origin;
        Vec4::new(x.dot(w), y.dot(w), direction.dot(w), p[3])
    });
    // From the end that the ray comes to first, then from the other. An end itself may have no direction.
    const INWARD: f32 = 1.0 / 1024.0;
    let ends = if points[0].z <= points[3].z { [INWARD, 1.0 - INWARD] } else { [1.0 - INWARD, INWARD] };
    ends.into_iter().find_map(|end| settle(points, end).filter(|&t| t > 0.0))
}

/// The iteration from `u` on; t where it comes to stand still on a cone that the ray meets.
fn settle(points: [Vec4; 4], mut u: f32) -> Option<f32> {
    /// As the paper has it.
    const STILL: f32 = 5e-5;
    const STEPS: u32 = 40;
    let mut last = (u, 0.0);
    for count in 0..STEPS {
        let (at, slope) = point_and_slope(points, u);
        let near = NearCone::new(at, slope);
        if near.is_met && near.step.abs() < STILL {
            return Some(near.t);
        }

        // Between two u that point at each other the zero of the step: by the secant, now and then by the middle.
        let step = near.step.clamp(-0.5, 0.5);
        let next = if step * last.1 >= 0.0 {
            u + step
        } else if count % 4 == 0 {
            0.5 * (u + last.0)
        } else {
            (step * last.0 - last.1 * u) / (step - last.1)
        };
        last = (u, step);
        u = next;
        // NaN as well.
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
    }
    None
}

/// De Casteljau's algorithm.
fn point_and_slope([a, b, c, d]: [Vec4; 4], u: f32) -> (Vec4, Vec4) {
    let (ab, bc, cd) = (a.lerp(b, u), b.lerp(c, u), c.lerp(d, u));
    let (abc, bcd) = (ab.lerp(bc, u), bc.lerp(cd, u));
    (abc.lerp(bcd, u), 3.0 * (bcd - abc))
}

/// Where the z axis enters the cone that touches a tube along one of its circles.
struct NearCone {
    t: f32,
    /// From the u of the circle to that of the plane across the cone through the point that was met.
    step: f32,
    /// Else `t` is where the axis is nearest to the cone.
    is_met: bool,
}

impl NearCone {
    /// With c = (x, y, z), its slope c', and s = t − z, the point (0, 0, t) lies α = (s z' − x x' − y y')/|c'|² past the
    /// circle, and on the cone where x² + y² + s² − α² |c'|² = r² + 2 r r' α, to the first order of r'.
    fn new(at: Vec4, slope: Vec4) -> NearCone {
        let [x, y, z, r] = at.to_array();
        let [dx, dy, dz, dr] = slope.to_array();
        let length_squared = slope.truncate().length_squared();
        let across = x * dx + y * dy;
        let turn = x * dy - y * dx;
        // a s² − 2 b s + c = 0.
        let a = dx * dx + dy * dy;
        let b = dz * (r * dr - across);
        let c = turn * turn + (x * x + y * y) * dz * dz - r * r * length_squared + 2.0 * r * dr * across;
        let discriminant = b * b - a * c;
        let s = (b - discriminant.max(0.0).sqrt()) / a;
        NearCone { t: z + s, step: (s * dz - across) / length_squared, is_met: discriminant >= 0.0 }
    }
}
