//! Maps from the unit square to the domains that are sampled, with their densities.

use crate::math::trig::{sin_cos_quarter, sin_cos_turn};
use glam::{DVec2, DVec3};

/// Uniform on the unit disc; concentric map of Shirley and Chiu 1997.
#[must_use]
pub fn concentric_disk(u: DVec2) -> DVec2 {
    let a = 2.0 * u.x - 1.0;
    let b = 2.0 * u.y - 1.0;
    if a == 0.0 && b == 0.0 {
        return DVec2::ZERO;
    }
    // The smaller coordinate is to the larger as the angle from the larger's axis is to an eighth of a turn.
    // One or the other by bits: nobody can foretell which.
    let wide = u64::from(a.abs() > b.abs()).wrapping_neg();
    let either = |x: f64, y: f64| f64::from_bits(y.to_bits() ^ (x.to_bits() ^ y.to_bits()) & wide);
    let r = either(a, b);
    let (sin, cos) = sin_cos_quarter(0.5 * (either(b, a) / r));
    DVec2::new(r * either(cos, sin), r * either(sin, cos))
}

/// The inverse of [`concentric_disk`], of points inside the disc.
#[must_use]
pub fn from_concentric_disk(p: DVec2) -> DVec2 {
    let r = p.length();
    // The smaller coordinate is to the larger as the angle between to an eighth of a turn.
    let share = |x: f64, y: f64| libm::atan(y / x) * (4.0 / std::f64::consts::PI);
    let square = if p.x.abs() > p.y.abs() {
        let a = r.copysign(p.x);
        DVec2::new(a, a * share(p.x, p.y))
    } else if r > 0.0 {
        let b = r.copysign(p.y);
        DVec2::new(b * share(p.y, p.x), b)
    } else {
        DVec2::ZERO
    };
    0.5 * square + 0.5
}

/// 1 − cos θ = 2 sin² θ/2 of any angle, without cancellation.
#[must_use]
pub fn one_minus_cos(angle: f64) -> f64 {
    let sine = libm::sin(0.5 * angle);
    2.0 * sine * sine
}

/// Directions about +z with density cos θ / π.
#[must_use]
pub fn cosine_hemisphere(u: DVec2) -> DVec3 {
    let d = concentric_disk(u);
    DVec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Uniform directions on the sphere, density 1 / 4π.
#[must_use]
pub fn uniform_sphere(u: DVec2) -> DVec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (u.x * (1.0 - u.x)).max(0.0).sqrt() * 2.0;
    let (sin, cos) = sin_cos_turn(u.y);
    DVec3::new(r * cos, r * sin, z)
}

/// Uniform directions in the cone about +z with `one_minus_cos_max` = 1 − cos θ_max, which is
/// passed rather than the cosine because the cosine of a narrow cone rounds to one.
/// Density 1 / (2π · `one_minus_cos_max`).
#[must_use]
pub fn uniform_cone(u: DVec2, one_minus_cos_max: f64) -> DVec3 {
    let h = u.x * one_minus_cos_max;
    // sin²θ = 1 − (1 − h)² = h (2 − h)
    let r = (h * (2.0 - h)).max(0.0).sqrt();
    let (sin, cos) = sin_cos_turn(u.y);
    DVec3::new(r * cos, r * sin, 1.0 - h)
}

/// Barycentric coordinates (of the second and third vertex) uniform on a triangle.
///
/// Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
#[must_use]
pub fn triangle(u: DVec2) -> DVec2 {
    if u.y > u.x {
        let x = u.x * 0.5;
        DVec2::new(x, u.y - x)
    } else {
        let y = u.y * 0.5;
        DVec2::new(u.x - y, y)
    }
}

/// The middles of n × n equal squares of the unit square, row by row.
pub(crate) fn midpoints(n: u32) -> impl Iterator<Item = DVec2> {
    (0..n * n).map(move |i| DVec2::new(f64::from(i % n) + 0.5, f64::from(i / n) + 0.5) / f64::from(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> impl Iterator<Item = DVec2> {
        (0..256u32).flat_map(|i| {
            (0..256u32).map(move |j| DVec2::new((f64::from(i) + 0.5) / 256.0, (f64::from(j) + 0.5) / 256.0))
        })
    }

    /// The mean of z over a cosine-weighted hemisphere is ∫cos²θ/π dω = 2/3; over the midpoint
    /// grid of 256² the square root at the rim leaves a quadrature error below h^1.5 = 2.4e-4; x and y
    /// cancel by symmetry.
    #[test]
    fn cosine_hemisphere_has_mean_cosine_two_thirds() {
        let n = 65_536.0;
        let mean: DVec3 = grid().map(cosine_hemisphere).sum::<DVec3>() / n;
        assert!((mean.z - 2.0 / 3.0).abs() < 2.4e-4 && mean.x.abs() < 1e-12 && mean.y.abs() < 1e-12, "{mean}");
    }

    #[test]
    fn directions_have_unit_length() {
        for u in grid() {
            for v in [cosine_hemisphere(u), uniform_sphere(u), uniform_cone(u, 1e-12), uniform_cone(u, 1.0)] {
                assert!((v.length() - 1.0).abs() < 4.0 * f64::EPSILON, "{u} {v}");
            }
        }
    }

    /// E[x²] on the unit disc is 1/4; the concentric map keeps area, so the midpoint rule holds to 1e-5.
    #[test]
    fn concentric_disk_keeps_area() {
        let m: f64 = grid().map(|u| concentric_disk(u).x.powi(2)).sum::<f64>() / 65_536.0;
        assert!((m - 0.25).abs() < 1e-5, "{m}");
    }

    #[test]
    fn triangle_coordinates_stay_inside_and_have_mean_one_third() {
        let mut sum = DVec2::ZERO;
        for u in grid() {
            let b = triangle(u);
            assert!(b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0);
            sum += b;
        }
        assert!((sum / 65_536.0 - DVec2::splat(1.0 / 3.0)).abs().max_element() < 1e-5);
    }
}
