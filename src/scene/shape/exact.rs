//! Small sums of products whose rounding error does not depend on cancellation.
//!
//! u = 2⁻⁵³ is the unit roundoff. All of these want hardware fused multiply-add: without it
//! `mul_add` is a library call, right but slow.

use glam::DVec3;

/// a·b − c·d to within 1.5 ulp; its sign is exact, and it is zero only where the exact value is.
///
/// Kahan's algorithm; bound by Jeannerod, Louvet and Muller 2013, "Further Analysis of Kahan's
/// Algorithm for the Accurate Computation of 2 × 2 Determinants".
#[inline(always)]
#[must_use]
pub fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let cd = c * d;
    // The rounding error of c·d, exactly.
    let error = (-c).mul_add(d, cd);
    a.mul_add(b, -cd) + error
}

/// a × b, each component to within 1.5 ulp.
#[inline]
#[must_use]
pub fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(
        difference_of_products(a.y, b.z, a.z, b.y),
        difference_of_products(a.z, b.x, a.x, b.z),
        difference_of_products(a.x, b.y, a.y, b.x),
    )
}

/// a · b with fused multiply-add.
#[inline]
#[must_use]
pub fn dot(a: DVec3, b: DVec3) -> f64 {
    a.x.mul_add(b.x, a.y.mul_add(b.y, a.z * b.z))
}

/// The product of a matrix, given by its rows, and `v`.
#[inline]
#[must_use]
pub fn rows_times(rows: &[DVec3; 3], v: DVec3) -> DVec3 {
    DVec3::new(dot(rows[0], v), dot(rows[1], v), dot(rows[2], v))
}

/// The point origin + t·direction, each component rounded once.
#[inline]
#[must_use]
pub fn along(origin: DVec3, direction: DVec3, t: f64) -> DVec3 {
    DVec3::new(t.mul_add(direction.x, origin.x), t.mul_add(direction.y, origin.y), t.mul_add(direction.z, origin.z))
}

/// a.x·b.x + a.y·b.y − a.z·b.z as if computed in twice the precision and rounded.
///
/// Ogita, Rump and Oishi 2005, "Accurate Sum and Dot Product", algorithm Dot2.
#[inline]
#[must_use]
pub fn cone_form(a: DVec3, b: DVec3) -> f64 {
    let xx = a.x * b.x;
    let yy = a.y * b.y;
    let zz = a.z * b.z;
    let product_errors = a.x.mul_add(b.x, -xx) + a.y.mul_add(b.y, -yy) - a.z.mul_add(b.z, -zz);
    let (s, e0) = two_sum(xx, yy);
    let (s, e1) = two_sum(s, -zz);
    s + (product_errors + (e0 + e1))
}

/// a + b and the error of that sum, exactly (Knuth).
#[inline]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let bb = s - a;
    (s, (a - (s - bb)) + (b - bb))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (1 + 2⁻³⁰)(1 − 2⁻³⁰) − 1·1 = −2⁻⁶⁰, where the products rounded one by one cancel to zero.
    #[test]
    fn difference_of_products_survives_total_cancellation() {
        let e = (0.5f64).powi(30);
        assert_eq!((1.0 + e) * (1.0 - e) - 1.0, 0.0);
        assert_eq!(difference_of_products(1.0 + e, 1.0 - e, 1.0, 1.0), -e * e);
    }

    /// With a = b = (1, e, 1) the form is e² exactly; the plain sum loses it below 2⁻⁵³.
    #[test]
    fn cone_form_survives_total_cancellation() {
        let e = (0.5f64).powi(40);
        let v = DVec3::new(1.0, e, 1.0);
        assert_eq!(cone_form(v, v), e * e);
    }

    /// Of whole numbers of 50 bits each of the three squares is rounded. The form is m² + n² − k², to its own rounding and to that of what
    /// twice the precision leaves: 9 · 2⁻¹⁰⁶ of 2¹⁰², below one.
    #[test]
    fn cone_form_keeps_what_each_of_its_products_loses() {
        let (m, n) = (1_034_567_890_123_457i128, 987_654_321_987_651i128);
        let k = ((m * m + n * n) as f64).sqrt() as i128;
        for (m, n, k) in [(m, n, k), (m, n, k + 1), (n, m, k - 1), (m - 2, n + 1, k)] {
            let v = DVec3::new(m as f64, n as f64, k as f64);
            let expected = (m * m + n * n - k * k) as f64;
            let off = cone_form(v, v) - expected;
            assert!(off.abs() <= 1.0 + f64::EPSILON * expected.abs(), "{m} {n} {k}: {off} of {expected}");
        }
    }
}
