//! Distributions and moments that a claim about noise needs: tails and quantiles of the normal, of Student's t and
//! of Fisher's F, running moments, the Šidák correction.
//!
//! Everything rests on `libm`, so figures and verdicts are the same on every machine.

use std::f64::consts::{PI, SQRT_2};

/// P(Z ≤ `z`) for a standard normal Z.
#[must_use]
pub fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z / SQRT_2)
}

/// P(|Z| ≥ |`z`|) for a standard normal Z.
#[must_use]
pub fn normal_two_sided_p(z: f64) -> f64 {
    libm::erfc(z.abs() / SQRT_2)
}

/// The z with P(Z ≤ z) = `p`: −∞ at 0, +∞ at 1, NaN outside [0, 1].
///
/// Starts from Abramowitz and Stegun 26.2.23 (off by less than 4.5e-4) and takes three steps of
/// Halley's method, whose error falls with the cube: 1e-10 after one step, rounding after two.
#[must_use]
pub fn normal_quantile(p: f64) -> f64 {
    if !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    if p == 0.0 || p == 1.0 {
        return if p == 0.0 { f64::NEG_INFINITY } else { f64::INFINITY };
    }
    if p > 0.5 {
        return -normal_quantile(1.0 - p);
    }
    let t = libm::sqrt(-2.0 * libm::log(p));
    let mut z = -(t
        - (2.515_517 + t * (0.802_853 + t * 0.010_328)) / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308))));
    for _ in 0..3 {
        let density = libm::exp(-0.5 * z * z) / libm::sqrt(2.0 * PI);
        if density > 0.0 {
            // Halley's step with f''/f' = −z.
            let newton = (normal_cdf(z) - p) / density;
            z -= newton / (1.0 + 0.5 * newton * z);
        }
    }
    z
}

/// P(|T| ≥ |`t`|) for Student's T with `dof` > 0 degrees of freedom, which need not be whole.
///
/// The regularised incomplete beta function I_x(ν/2, 1/2) at x = ν/(ν + t²) (Abramowitz and Stegun
/// 26.7.1). Above 1e8 degrees of freedom the normal tail stands in; its relative error is about
/// t⁴/4ν (first term of 26.7.8), below 2.5e-5 for |t| ≤ 10.
#[must_use]
pub fn student_t_two_sided_p(t: f64, dof: f64) -> f64 {
    if t.is_nan() || dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    if t.is_infinite() {
        return 0.0;
    }
    if dof > 1e8 {
        return normal_two_sided_p(t);
    }
    // x and 1 − x each without cancellation; t² may overflow to infinity, which gives x = 0.
    let ratio = t * t / dof;
    let x = 1.0 / (1.0 + ratio);
    let y = if ratio.is_infinite() { 1.0 } else { ratio / (1.0 + ratio) };
    regularised_beta(x, y, 0.5 * dof, 0.5)
}

/// The t with P(|T| ≤ t) = `confidence`: half the width of an interval in standard errors.
///
/// Bisection of the tail between neighbouring floats. NaN where `confidence` is not in (0, 1).
#[must_use]
pub fn student_t_half_width(confidence: f64, dof: f64) -> f64 {
    if !(confidence > 0.0 && confidence < 1.0 && dof > 0.0) {
        return f64::NAN;
    }
    let tail = 1.0 - confidence;
    bisect(|t| student_t_two_sided_p(t, dof) > tail)
}

/// P(F ≥ `f`) for Fisher's F with `dof` > 0 degrees of freedom of its numerator and of its denominator, which need not be whole.
///
/// I_x(ν₂/2, ν₁/2) at x = ν₂/(ν₂ + ν₁ f) (Abramowitz and Stegun 26.6.2).
#[must_use]
pub fn f_upper_p(f: f64, dof: [f64; 2]) -> f64 {
    if f.is_nan() || !dof.iter().all(|dof| dof.is_finite() && *dof > 0.0) {
        return f64::NAN;
    }
    let ratio = dof[0] * f.max(0.0) / dof[1];
    let x = 1.0 / (1.0 + ratio);
    let y = if ratio.is_infinite() { 1.0 } else { ratio / (1.0 + ratio) };
    regularised_beta(x, y, 0.5 * dof[1], 0.5 * dof[0])
}

/// The f with P(F ≥ f) = `p`, by bisection of the tail. NaN where `p` is not in (0, 1).
#[must_use]
pub fn f_upper_quantile(p: f64, dof: [f64; 2]) -> f64 {
    if !(p > 0.0 && p < 1.0) || f_upper_p(1.0, dof).is_nan() {
        return f64::NAN;
    }
    bisect(|f| f_upper_p(f, dof) > p)
}

/// The least positive float at which `is_below` no longer holds.
fn bisect(is_below: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while is_below(high) {
        low = high;
        high *= 2.0;
    }
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return high;
        }
        *(if is_below(middle) { &mut low } else { &mut high }) = middle;
    }
}

/// I_x(a, b) with y = 1 − x given apart.
///
/// Continued fraction DLMF 8.17.22, evaluated by the modified method of Lentz (Thompson and
/// Barnett 1986); where x is large the symmetric form 1 − I_y(b, a) converges faster.
fn regularised_beta(x: f64, y: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if y <= 0.0 {
        return 1.0;
    }
    let front =
        libm::exp(libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * libm::log(x) + b * libm::log(y));
    if x > (a + 1.0) / (a + b + 2.0) {
        1.0 - front / b * beta_fraction(y, b, a)
    } else {
        front / a * beta_fraction(x, a, b)
    }
}

fn beta_fraction(x: f64, a: f64, b: f64) -> f64 {
    // A stand-in for a denominator of zero, as Lentz's method wants one.
    const TINY: f64 = f64::MIN_POSITIVE;
    let guard = |v: f64| if v == 0.0 { TINY } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / guard(1.0 - (a + b) * x / (a + 1.0));
    let mut value = d;
    // O(√max(a, b)) terms are needed; √(5e7) = 7e3, so the bound is never met by a convergent fraction.
    for m in 1..100_000u32 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / guard(1.0 + even * d);
        c = guard(1.0 + even / c);
        value *= c * d;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / guard(1.0 + odd * d);
        c = guard(1.0 + odd / c);
        let step = c * d;
        value *= step;
        if (step - 1.0).abs() <= f64::EPSILON {
            break;
        }
    }
    value
}

/// The level for each of `tests` independent tests whose family errs with probability `alpha`:
/// 1 − (1 − α)^(1/n), Šidák 1967.
#[must_use]
pub fn sidak(alpha: f64, tests: usize) -> f64 {
    -libm::expm1(libm::log1p(-alpha) / tests.max(1) as f64)
}

/// Count, mean and sum of squared deviations of a stream of numbers (Welford 1962).
///
/// The result depends on the order of the numbers in the last bits: feed pixels in raster order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// How many numbers.
    pub count: u64,
    /// Their mean; 0 of none.
    pub mean: f64,
    /// Σ (x − mean)².
    pub squares: f64,
}

impl Moments {
    /// Adds a number.
    pub fn push(&mut self, x: f64) {
        self.count += 1;
        let from_old = x - self.mean;
        self.mean += from_old / self.count as f64;
        self.squares += from_old * (x - self.mean);
    }

    /// The unbiased variance of the numbers; NaN for fewer than two.
    #[must_use]
    pub fn variance(&self) -> f64 {
        if self.count < 2 { f64::NAN } else { self.squares / (self.count - 1) as f64 }
    }

    /// The standard error of the mean, if the numbers are independent; NaN for fewer than two.
    #[must_use]
    pub fn standard_error(&self) -> f64 {
        (self.variance() / self.count as f64).sqrt()
    }
}

impl FromIterator<f64> for Moments {
    fn from_iter<I: IntoIterator<Item = f64>>(numbers: I) -> Moments {
        let mut moments = Moments::default();
        for x in numbers {
            moments.push(x);
        }
        moments
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(found: f64, expected: f64, relative: f64) {
        assert!((found - expected).abs() <= relative * expected.abs(), "expected {expected}, found {found}");
    }

    /// Φ⁻¹ of the levels of everyday tables, to the digits of Wichura 1988 (AS 241) and, in the far
    /// tail, of erfc: Φ(−10) = 7.619853024160527e-24. Conditioning: dz = dp/φ(z), so a relative error
    /// ε of p moves z by ε·p/φ ≈ ε/|z|; 1e-14 leaves room for erfc's own ulp.
    #[test]
    fn normal_quantiles_equal_the_tables() {
        assert_close(normal_quantile(0.975), 1.959_963_984_540_054, 1e-14);
        assert_close(normal_quantile(0.995), 2.575_829_303_548_901, 1e-14);
        assert_close(normal_quantile(0.25), -0.674_489_750_196_081_7, 1e-14);
        assert_close(normal_quantile(0.001), -3.090_232_306_167_813, 1e-14);
        assert_close(normal_quantile(7.619_853_024_160_527e-24), -10.0, 1e-14);
        assert!(normal_quantile(0.5).abs() < 1e-16);
        assert!(normal_quantile(1.5).is_nan() && normal_quantile(0.0) == f64::NEG_INFINITY);
    }

    #[test]
    fn normal_tails_equal_the_tables() {
        // Two-sided p of 1, 1.96 and 5 standard deviations.
        assert_close(normal_two_sided_p(1.0), 0.317_310_507_862_914_1, 1e-14);
        assert_close(normal_two_sided_p(-5.0), 5.733_031_437_583_878e-7, 1e-13);
        assert_close(normal_cdf(1.0), 0.841_344_746_068_542_9, 1e-15);
    }

    /// For 1, 2 and 3 degrees of freedom the tail has closed forms: 1 − (2/π) atan t; 1 − t/√(2 + t²);
    /// 1 − (2/π)(atan(t/√3) + (t/√3)/(1 + t²/3)).
    #[test]
    fn student_tails_equal_their_closed_forms() {
        for t in [0.01, 0.3, 1.0, 2.5, 7.0f64] {
            assert_close(student_t_two_sided_p(t, 1.0), 1.0 - 2.0 / PI * t.atan(), 1e-13);
            assert_close(student_t_two_sided_p(-t, 2.0), 1.0 - t / (2.0 + t * t).sqrt(), 2e-13);
            let s = t / 3f64.sqrt();
            assert_close(student_t_two_sided_p(t, 3.0), 1.0 - 2.0 / PI * (s.atan() + s / (1.0 + s * s)), 2e-12);
        }
    }

    /// Half widths of 95 % and 99 % intervals: roots of the incomplete beta function to 30 digits (mpmath). A relative error
    /// of the tail of 2e-12 (lgamma at 1000) moves t by less than 1e-11 of itself.
    #[test]
    fn student_half_widths_equal_the_tables() {
        for (dof, confidence, expected) in [
            (1.0, 0.95, 12.706_204_736_174_705),
            (3.0, 0.95, 3.182_446_305_283_709_6),
            (10.0, 0.99, 3.169_272_672_616_951),
            (30.0, 0.95, 2.042_272_456_301_238),
            (1000.0, 0.95, 1.962_339_080_826_408_5),
        ] {
            assert_close(student_t_half_width(confidence, dof), expected, 1e-11);
        }
    }

    /// With one degree of freedom above, F is t²; with two the tail is (1 + 2f/ν)^(−ν/2).
    #[test]
    fn fisher_tails_equal_their_closed_forms() {
        for x in [0.1, 1.0, 2.5, 7.0f64] {
            for dof in [1.0, 3.0, 3.6, 1000.0] {
                assert_close(f_upper_p(x * x, [1.0, dof]), student_t_two_sided_p(x, dof), 2e-12);
                assert_close(f_upper_p(x, [2.0, dof]), (1.0 + 2.0 * x / dof).powf(-0.5 * dof), 2e-12);
            }
        }
        for p in [0.5, 0.05, 1e-3] {
            assert_close(f_upper_quantile(p, [2.0, 6.0]), 3.0 * (p.powf(-1.0 / 3.0) - 1.0), 1e-11);
        }
        assert!(f_upper_p(1.0, [0.0, 3.0]).is_nan() && f_upper_quantile(1.0, [1.0, 3.0]).is_nan());
    }

    /// The first term of the difference of the tails of t and the normal is φ(t)(t³ + t)/2ν, 1.2e-8 of 0.05
    /// at ν = 1e7 and t = 1.96; beyond that lgamma(5e6) costs 5e6·ln(5e6)·2⁻⁵³ = 1e-8.
    #[test]
    fn student_goes_over_into_the_normal() {
        assert_close(student_t_two_sided_p(1.96, 1e7), normal_two_sided_p(1.96), 4e-8 / 0.05);
        assert_eq!(student_t_two_sided_p(3.0, 1e9), normal_two_sided_p(3.0));
    }

    #[test]
    fn sidak_level_restores_the_family_level() {
        // 1 − (1 − a)ⁿ must be α again; for one test a is α.
        let level = sidak(0.01, 65_536);
        assert_close(-libm::expm1(65_536.0 * libm::log1p(-level)), 0.01, 1e-12);
        assert_close(sidak(0.05, 1), 0.05, 1e-15);
    }

    #[test]
    fn moments_of_one_to_nine() {
        // Mean 5, Σ(x − 5)² = 60, variance 60/8; standard error √(7.5/9).
        let moments: Moments = (1..=9).map(f64::from).collect();
        assert_close(moments.mean, 5.0, 1e-15);
        assert_close(moments.variance(), 7.5, 1e-15);
        assert_close(moments.standard_error(), (7.5f64 / 9.0).sqrt(), 1e-15);
        assert!(Moments::default().variance().is_nan());
    }
}
