//! Four vectors side by side.

use glam::DVec3;
use wide::f64x4;

/// A vector in each lane.
pub type Vec4 = [f64x4; 3];

/// `v` in each lane.
#[inline(always)]
#[must_use]
pub fn splat(v: DVec3) -> Vec4 {
    [f64x4::splat(v.x), f64x4::splat(v.y), f64x4::splat(v.z)]
}

/// A vector for each lane.
#[inline(always)]
#[must_use]
pub fn lanes([a, b, c, d]: [DVec3; 4]) -> Vec4 {
    [f64x4::new([a.x, b.x, c.x, d.x]), f64x4::new([a.y, b.y, c.y, d.y]), f64x4::new([a.z, b.z, c.z, d.z])]
}

/// As [`DVec3::dot`], each product rounded by itself.
#[inline(always)]
#[must_use]
pub fn plain_dot(a: &Vec4, b: &Vec4) -> f64x4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
