//! Trigonometry that gives the same bits on every machine.
//!
//! The platform's `sin` and `cos` differ in the last bit between C libraries, which would
//! break bit-identical merging; [`sin_cos_turn`] is a polynomial of our own, the rest is `libm`.

use super::elementary::polynomial;

/// (sin √z / √z − 1) / z: Taylor's series to the 17th degree of the sine.
const SIN: [f64; 8] = [
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
    1.0 / 355_687_428_096_000.0,
];

/// (cos √z − 1) / z, to the 16th degree of the cosine.
const COS: [f64; 8] = [
    -0.5,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];

/// Sine and cosine of 2π·`u` for `u` in [0, 1].
///
/// The angle is reduced to [−π/4, π/4] exactly, in turns; there the Taylor series to degree
/// 17 (sine) and 16 (cosine) err by less than 4e-17 (next term: (π/4)¹⁹/19! = 8e-20,
/// (π/4)¹⁸/18! = 2e-18), so the result is within 2 ulp of one.
#[must_use]
pub fn sin_cos_turn(u: f64) -> (f64, f64) {
    let quarter = (u * 4.0 + 0.5).floor();
    // u·4 − quarter is exact: both are multiples of ulp(u·4) and near each other.
    let (sin, cos) = sin_cos_quarter(u * 4.0 - quarter);
    // Quarter 0 has (sin, cos), 1 (cos, −sin), 2 (−sin, −cos), 3 (−cos, sin): by bits, for nobody can foretell which it is.
    let quarter = quarter as i64 as u64;
    let swapped = (sin.to_bits() ^ cos.to_bits()) & (quarter & 1).wrapping_neg();
    let sign = |quarter: u64| (quarter & 2) << 62;
    (
        f64::from_bits(sin.to_bits() ^ swapped ^ sign(quarter)),
        f64::from_bits(cos.to_bits() ^ swapped ^ sign(quarter.wrapping_add(1))),
    )
}

/// Sine and cosine of `q` quarter turns, for `q` in [−½, ½]: those of [`sin_cos_turn`].
#[must_use]
#[inline(always)]
pub fn sin_cos_quarter(q: f64) -> (f64, f64) {
    let x = q * std::f64::consts::FRAC_PI_2;
    let z = x * x;
    ((x * z).mul_add(polynomial(&SIN, z), x), z.mul_add(polynomial(&COS, z), 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sin_cos_turn_is_within_two_ulp_of_one() {
        for i in 0..=100_000u32 {
            let u = f64::from(i) / 100_000.0;
            let (s, c) = sin_cos_turn(u);
            let (sr, cr) = (u * std::f64::consts::TAU).sin_cos();
            // The reference itself rounds its argument: |2π·u| ≤ 6.3, half an ulp of 4.4e-16.
            let tolerance = 2.0 * f64::EPSILON + 4.5e-16;
            assert!((s - sr).abs() <= tolerance && (c - cr).abs() <= tolerance, "u = {u}");
        }
        assert_eq!(sin_cos_turn(0.0), (0.0, 1.0));
        assert_eq!(sin_cos_turn(0.25), (1.0, 0.0));
    }
}
