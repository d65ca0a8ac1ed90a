//! Elementary functions that give the same bits on every machine, in fewer steps than `libm` takes.
//!
//! Polynomials interpolate at the Chebyshev nodes of their intervals, with coefficients solved for in 60 digits and
//! rounded to f64. What interpolation leaves is stated at each; with the roundings of the steps around it a result is
//! within 4 ulp, which the tests hold against `libm` (itself within one).

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Σ c_k z^k by Horner's rule.
#[inline(always)]
pub(super) fn polynomial<const N: usize>(c: &[f64; N], z: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum: f64, &c| sum.mul_add(z, c))
}

/// (atan √z / √z − 1) / z for z in [0, tan² 22.5°], to 3.2e-17.
const ATAN: [f64; 11] = [
    -0.333_333_333_333_333_3,
    0.199_999_999_999_955_16,
    -0.142_857_142_846_656_82,
    0.111_111_110_151_870_18,
    -0.090_909_045_753_064_9,
    0.076_921_831_253_768_92,
    -0.066_645_105_255_089_36,
    0.058_581_409_048_663_28,
    -0.050_854_078_345_894_844,
    0.039_230_447_784_793_09,
    -0.019_175_404_711_104_935,
];

/// The angle of (x, y) from the x axis, in [−π, π]; 0 at the origin.
///
/// A ratio above tan 22.5° is turned by 45°, so that a single division is left.
#[must_use]
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    let (ax, ay) = (x.abs(), y.abs());
    let (small, large) = if ay > ax { (ax, ay) } else { (ay, ax) };
    const TAN_22_5: f64 = std::f64::consts::SQRT_2 - 1.0;
    let (top, bottom, from) =
        if small > TAN_22_5 * large { (small - large, small + large, FRAC_PI_4) } else { (small, large, 0.0) };
    let t = if bottom > 0.0 { top / bottom } else { 0.0 };
    let z = t * t;
    let angle = from + t + (t * z) * polynomial(&ATAN, z);
    let angle = if ay > ax { FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    angle.copysign(y)
}

/// (e^r − 1 − r) / r² for |r| ≤ ln 2 / 2, to 1.4e-18.
const EXP: [f64; 11] = [
    0.5,
    0.166_666_666_666_666_7,
    0.041_666_666_666_666_67,
    0.008_333_333_333_326_136,
    0.001_388_888_888_888_374_8,
    0.000_198_412_698_748_206_27,
    2.480_158_732_554_774_5e-5,
    2.755_725_540_020_642_2e-6,
    2.755_727_364_311_03e-7,
    2.510_521_700_472_074_5e-8,
    2.091_468_696_808_687_6e-9,
];

/// ln 2 in two parts; the first has 32 bits, so that its product with an exponent is exact.
const LN2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];

/// eˣ for `x` ≤ 0; 0 below −708, where the result would be subnormal.
#[must_use]
#[inline]
pub fn exp_down(x: f64) -> f64 {
    if x < -708.0 {
        return 0.0;
    }
    let k = (x * std::f64::consts::LOG2_E).round_ties_even();
    let r = k.mul_add(-LN2[1], k.mul_add(-LN2[0], x));
    let e = 1.0 + (r * r).mul_add(polynomial(&EXP, r), r);
    // −1022 ≤ k ≤ 0: 2ᵏ is normal. NaN makes k zero and stays.
    e * f64::from_bits(((k as i64 + 1023) as u64) << 52)
}

/// (2 artanh √z / √z − 2) / z for z in [0, tan⁴ 22.5°], to 2.1e-18.
const LOG: [f64; 8] = [
    0.666_666_666_666_666_6,
    0.400_000_000_000_008_8,
    0.285_714_285_708_032_3,
    0.222_222_223_918_004_7,
    0.181_817_956_308_847_53,
    0.153_862_402_058_134_78,
    0.132_687_596_685_606_12,
    0.130_867_670_099_481_75,
];

/// ln(1 + `x`) for −1 < `x` ≤ 1.
#[must_use]
#[inline]
pub fn log1p(x: f64) -> f64 {
    let w = 1.0 + x;
    if w <= 0.0 {
        return if w < 0.0 { f64::NAN } else { f64::NEG_INFINITY };
    }
    // What rounding took from 1 + x, over it.
    log_and(w, (x - (w - 1.0)) / w)
}

/// ln `x` for normal `x` > 0.
#[must_use]
#[inline]
pub fn log(x: f64) -> f64 {
    log_and(x, 0.0)
}

/// ln w + `more`, which is small against ln 2 or nothing.
#[inline(always)]
fn log_and(w: f64, more: f64) -> f64 {
    // w = 2ᵏ m with m in [√½, √2).
    let bits = w.to_bits();
    let k = ((bits + (0x3ff0_0000_0000_0000 - std::f64::consts::FRAC_1_SQRT_2.to_bits())) >> 52) as i64 - 1023;
    let m = f64::from_bits(bits.wrapping_sub((k << 52) as u64));
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let k = k as f64;
    let log = (s * z).mul_add(polynomial(&LOG, z), k.mul_add(LN2[1], more));
    k.mul_add(LN2[0], 2.0 * s + log)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, expected: f64, at: f64) {
        let ulp = f64::EPSILON * expected.abs();
        assert!((found - expected).abs() <= 4.0 * ulp, "{at:e}: {found:e}, expected {expected:e}");
    }

    #[test]
    fn angles_are_right_all_around_and_on_the_axes() {
        for i in 0..100_000 {
            let (sin, cos) = (f64::from(i) * 6.5e-5).sin_cos();
            for scale in [1e-300, 1.0, 1e150] {
                near(atan2(sin * scale, cos * scale), libm::atan2(sin * scale, cos * scale), f64::from(i));
            }
        }
        for small in [1e-18, 1e-9, 1e-3] {
            for (y, x) in [(small, 1.0), (small, -1.0), (1.0, small), (-1.0, -small), (-small, 1.0)] {
                near(atan2(y, x), libm::atan2(y, x), small);
            }
        }
        for (y, x) in [(0.0, 1.0), (0.0, -1.0), (-0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0)] {
            assert_eq!(atan2(y, x), libm::atan2(y, x), "{y} {x}");
        }
        assert!(atan2(f64::NAN, 1.0).is_nan());
    }

    #[test]
    fn falling_exponentials_are_right_down_to_nothing() {
        assert_eq!(exp_down(0.0), 1.0);
        for i in 1..100_000 {
            let x = -f64::from(i) * 0.007;
            near(exp_down(x), libm::exp(x), x);
            near(exp_down(x * 1e-6), libm::exp(x * 1e-6), x * 1e-6);
        }
        assert_eq!(exp_down(-709.0), 0.0);
        assert_eq!(exp_down(f64::NEG_INFINITY), 0.0);
        assert!(exp_down(f64::NAN).is_nan());
    }

    #[test]
    fn logarithms_keep_their_digits_beside_zero_and_beside_minus_one() {
        for i in 1..100_000 {
            let u = f64::from(i) / 100_000.0;
            for x in [-u, u, -u * 1e-9, u * 1e-9, -u * 1e-18, u - 1.0, u * 2f64.powi(-32) - 1.0] {
                near(log1p(x), libm::log1p(x), x);
            }
        }
        for i in 1..100_000 {
            let u = f64::from(i) / 100_000.0;
            for x in [u, u * 1e-9, u * 1e-300, 1.0 + u * 1e-3, 1.0 / u] {
                near(log(x), libm::log(x), x);
            }
        }
        assert_eq!(log1p(0.0), 0.0);
        assert_eq!(log(1.0), 0.0);
        assert_eq!(log1p(-1.0), f64::NEG_INFINITY);
    }
}
