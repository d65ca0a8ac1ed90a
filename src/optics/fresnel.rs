//! Fresnel's equations, in forms that do not cancel.
//!
//! Cosines are on the side the light comes from and positive; `eta` is the index beyond the
//! interface over the index on this side. Born and Wolf, *Principles of Optics*, 1.5.2 and 14.2.

use crate::spectrum::{LANES, Lanes};
use wide::f64x4;

/// Which formula gives the reflectance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Model {
    /// Fresnel's equations for unpolarised light.
    #[default]
    Exact,
    /// Schlick 1994: R₀ + (1 − R₀)(1 − cos θ)⁵, with the angle in the thinner medium.
    Schlick,
}

/// What a smooth dielectric interface does with unpolarised light at one angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// Reflected share of the power.
    pub reflected: f64,
    /// Transmitted share, computed on its own: 1 − `reflected` would cancel at grazing angles.
    pub transmitted: f64,
    /// Cosine of the refracted direction; zero under total reflection.
    pub cos_transmitted: f64,
}

const TOTAL: Split = Split { reflected: 1.0, transmitted: 0.0, cos_transmitted: 0.0 };

/// Reflection and transmission at a smooth interface between two transparent media.
///
/// With c = `cos`, q = η² − 1 and g = √(c² + q) = η cos θ_t, the amplitudes are
/// r_s = −q / (c + g)² and r_p = q ((η² + 1) c² − 1) / (η² c + g)²: as products of q they keep
/// their relative accuracy for η near one, where (c − g) / (c + g) would cancel.
#[must_use]
pub fn dielectric(model: Model, cos: f64, eta: f64) -> Split {
    // (η − 1)(η + 1) is exact to an ulp for η near one; η² − 1 is not. Near the critical angle c² takes nearly all of it
    // away, and what its rounding left out, `missing`, would show: with it g² keeps its digits.
    let (less, more) = (eta - 1.0, eta + 1.0);
    let q = less * more;
    let (less_missing, more_missing) = ((eta - (less + 1.0)), (eta - (more - 1.0)));
    let missing = less.mul_add(more, -q) + less.mul_add(more_missing, less_missing * more);
    let g2 = cos.mul_add(cos, q) + missing;
    if g2 <= 0.0 && q < 0.0 {
        return TOTAL;
    }
    if q == 0.0 {
        // No interface: exactly nothing is reflected, at any angle.
        return Split { reflected: 0.0, transmitted: 1.0, cos_transmitted: cos };
    }
    let g = g2.sqrt();
    let cos_transmitted = g / eta;
    match model {
        Model::Exact => {
            let s = cos + g;
            let p = (eta * eta).mul_add(cos, g);
            if s == 0.0 || p == 0.0 {
                return TOTAL;
            }
            let rs = q / (s * s);
            let rp = q * (eta * eta + 1.0).mul_add(cos * cos, -1.0) / (p * p);
            let (a, b) = (eta.mul_add(cos, cos_transmitted), eta.mul_add(cos_transmitted, cos));
            Split {
                reflected: 0.5 * rs.mul_add(rs, rp * rp),
                transmitted: 2.0 * eta * cos * cos_transmitted * (1.0 / (a * a) + 1.0 / (b * b)),
                cos_transmitted,
            }
        }
        Model::Schlick => {
            let r0 = ((eta - 1.0) / (eta + 1.0)).powi(2);
            let m = 1.0 - if q < 0.0 { cos_transmitted } else { cos };
            let m5 = (m * m) * (m * m) * m;
            let reflected = (1.0 - r0).mul_add(m5, r0);
            Split { reflected, transmitted: (1.0 - r0) * (1.0 - m5), cos_transmitted }
        }
    }
}

/// [`dielectric`] by the exact equations at four cosines, side by side and to the same bits: the reflected and the transmitted
/// share and the cosine of the refracted direction.
#[must_use]
pub fn dielectric_of_four(cos: f64x4, eta: f64) -> [f64x4; 3] {
    let (less, more) = (eta - 1.0, eta + 1.0);
    let q = less * more;
    let (less_missing, more_missing) = ((eta - (less + 1.0)), (eta - (more - 1.0)));
    let missing = less.mul_add(more, -q) + less.mul_add(more_missing, less_missing * more);
    if q == 0.0 {
        return [f64x4::ZERO, f64x4::ONE, cos];
    }
    let (all, square, q) = (f64x4::splat(eta), f64x4::splat(eta * eta), f64x4::splat(q));
    let g2 = cos.mul_add(cos, q) + f64x4::splat(missing);
    let g = g2.sqrt();
    let cos_transmitted = g / all;
    let (s, p) = (cos + g, square.mul_add(cos, g));
    let total = (g2.simd_le(f64x4::ZERO) & q.simd_lt(f64x4::ZERO)) | s.simd_eq(f64x4::ZERO) | p.simd_eq(f64x4::ZERO);
    let rs = q / (s * s);
    let rp = q * (square + f64x4::ONE).mul_add(cos * cos, -f64x4::ONE) / (p * p);
    let (a, b) = (all.mul_add(cos, cos_transmitted), all.mul_add(cos_transmitted, cos));
    let reflected = f64x4::HALF * rs.mul_add(rs, rp * rp);
    let transmitted = f64x4::splat(2.0 * eta) * cos * cos_transmitted * (f64x4::ONE / (a * a) + f64x4::ONE / (b * b));
    let or = |at_total: f64x4, else_: f64x4| total.select(at_total, else_);
    [or(f64x4::ONE, reflected), or(f64x4::ZERO, transmitted), or(f64x4::ZERO, cos_transmitted)]
}

/// Mean of the exact reflectance over the cosine-weighted hemisphere, ∫₀¹ 2 c R(c) dc.
///
/// Midpoint rule on 4096 intervals in c². R is smooth but for a square root at total reflection
/// and at grazing, which leaves an error of order 4096^−1.5 = 4e-6.
#[must_use]
pub fn dielectric_diffuse(eta: f64) -> f64 {
    const STEPS: u32 = 4096;
    let sum: f64 = (0..STEPS)
        .map(|i| dielectric(Model::Exact, ((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt(), eta).reflected)
        .sum();
    sum / f64::from(STEPS)
}

/// Reflectance of a conductor with index `eta` + i`k` (relative to the medium outside), a lane a
/// wavelength.
///
/// Exact form of Born and Wolf 14.2 in f64, because a − cos θ cancels in f32 for weak
/// absorbers. Schlick: R₀ from the complex index at normal incidence.
#[must_use]
pub fn conductor(model: Model, cos: f64, eta: Lanes, k: Lanes) -> Lanes {
    let (eta, k) = (eta.to_array(), k.to_array());
    let mut out = [0.0f32; LANES];
    for half in 0..LANES / 4 {
        let at = |x: &[f32; LANES]| f64x4::new(std::array::from_fn(|i| f64::from(x[4 * half + i])));
        let (n, k) = (at(&eta), at(&k));
        let r = match model {
            Model::Exact => conductor_exact(cos, n, k),
            Model::Schlick => {
                let (one, k2) = (f64x4::ONE, k * k);
                let r0 = ((n - one) * (n - one) + k2) / ((n + one) * (n + one) + k2);
                let m = 1.0 - cos;
                r0 + (one - r0) * f64x4::splat((m * m) * (m * m) * m)
            }
        };
        for (o, r) in out[4 * half..].iter_mut().zip(r.to_array()) {
            *o = r as f32;
        }
    }
    Lanes::new(out)
}

/// With √(η² − sin²θ) = a + ib: r_s = (cos θ − a − ib) / (cos θ + a + ib), and so on; sums of squares, which cannot come out
/// below zero where nothing is reflected.
fn conductor_exact(cos: f64, n: f64x4, k: f64x4) -> f64x4 {
    let (c, s2) = (f64x4::splat(cos), f64x4::splat((1.0 - cos) * (1.0 + cos)));
    let nk = n * k;
    let t0 = (n - k) * (n + k) - s2;
    let length = (t0 * t0 + f64x4::splat(4.0) * nk * nk).sqrt();
    // The larger of a and b by way of a² − b² = t₀ without cancellation, the other by ab = nk.
    let large = (f64x4::splat(0.5) * (length + t0.abs())).sqrt();
    let small = large.simd_gt(f64x4::ZERO).select(nk / large, f64x4::ZERO);
    let negative = t0.simd_lt(f64x4::ZERO);
    let (a, b) = (negative.select(small, large), negative.select(large, small));
    let of = |minus: f64x4, plus: f64x4, rest: f64x4| {
        let (rest, plus) = (rest * rest, plus * plus);
        let below = plus + rest;
        // Nothing over nothing is a ray along a surface that is not there.
        below.simd_gt(f64x4::ZERO).select((minus * minus + rest) / below, f64x4::ZERO)
    };
    let rs = of(a - c, a + c, b);
    let rp = rs * of(a * c - s2, a * c + s2, b * c);
    f64x4::splat(0.5) * (rs + rp)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relative(a: f64, b: f64) -> f64 {
        ((a - b) / b).abs()
    }

    /// From grazing to straight, through the critical angle of indices below one, and without an interface.
    #[test]
    fn four_cosines_give_the_bits_of_one() {
        for eta in [0.4_f64, 0.67, 0.999, 1.0, 1.0001, 1.5, 2.42] {
            let critical = (1.0 - eta * eta).max(0.0).sqrt();
            for cosines in [[0.0, 1e-9, 1e-3, critical], [critical.next_up(), 0.3, 0.5, 0.6], [0.7, 0.8, 0.95, 1.0]] {
                let [reflected, transmitted, cos_transmitted] =
                    dielectric_of_four(f64x4::new(cosines), eta).map(f64x4::to_array);
                for (i, cos) in cosines.into_iter().enumerate() {
                    let found = Split {
                        reflected: reflected[i],
                        transmitted: transmitted[i],
                        cos_transmitted: cos_transmitted[i],
                    };
                    assert_eq!(found, dielectric(Model::Exact, cos, eta), "{eta} {cos}");
                }
            }
        }
    }

    /// Closed forms: R(0°) = ((η−1)/(η+1))²; the grazing T and the R of a nearly matched index were
    /// computed with 50 digits.
    #[test]
    fn dielectric_keeps_its_digits_at_grazing_and_near_index_one() {
        assert!(relative(dielectric(Model::Exact, 1.0, 1.5).reflected, 0.04) < 1e-15);
        assert!(relative(dielectric(Model::Exact, 1e-6, 1.5).transmitted, 5.813_757_341_55e-6) < 1e-11);
        assert!(relative(dielectric(Model::Exact, 1.0, 1.000_001).reflected, 2.499_997_500_001_9e-13) < 1e-9);
        assert_eq!(
            dielectric(Model::Exact, 0.3, 1.0),
            Split { reflected: 0.0, transmitted: 1.0, cos_transmitted: 0.3 }
        );
    }

    /// At 45° and η = 1.5: sin θ_t = sin 45°/1.5, R by the textbook amplitudes.
    #[test]
    fn dielectric_agrees_with_the_textbook_form_at_0_45_80_and_90_degrees() {
        for (deg, eta) in [(0.0f64, 1.5), (45.0, 1.5), (80.0, 1.5), (80.0, 2.4), (30.0, 1.0 / 1.5)] {
            let (s, c) = deg.to_radians().sin_cos();
            let ct = (1.0 - (s / eta).powi(2)).sqrt();
            let rs = (c - eta * ct) / (c + eta * ct);
            let rp = (eta * c - ct) / (eta * c + ct);
            let expected = 0.5 * (rs * rs + rp * rp);
            let found = dielectric(Model::Exact, c, eta);
            assert!(relative(found.reflected, expected) < 1e-12, "{deg}° {eta}: {found:?} {expected}");
        }
        // At 90° both amplitudes are one to within a few roundings.
        assert!((dielectric(Model::Exact, 0.0, 1.5).reflected - 1.0).abs() <= 4.0 * f64::EPSILON);
    }

    /// Schlick 1994, eq. 15, by hand: R₀ = 0.04; (1 − cos 45°)⁵ = 2.155e-3; (1 − cos 80°)⁵ = 0.38533.
    #[test]
    fn schlick_is_schlick_at_0_45_80_and_90_degrees() {
        for deg in [0.0f64, 45.0, 80.0, 90.0] {
            let c = deg.to_radians().cos();
            let expected = 0.04 + 0.96 * (1.0 - c).powi(5);
            let found = dielectric(Model::Schlick, c, 1.5);
            assert!((found.reflected - expected).abs() < 1e-15, "{deg}: {found:?}");
            assert!((found.reflected + found.transmitted - 1.0).abs() < 1e-15);
        }
        // From the denser side the angle counts in the air, so the curve meets total reflection.
        let critical = (1.0f64 - 1.0 / 2.25).sqrt();
        assert!(dielectric(Model::Schlick, critical + 1e-9, 1.0 / 1.5).reflected > 0.99);
    }

    /// R and T are computed apart; each is a dozen roundings, so their sum is one within 16 ulp.
    #[test]
    fn reflected_and_transmitted_sum_to_one() {
        for i in 0..=1000 {
            for eta in [1.000_000_1, 1.01, 1.33, 1.5, 2.4, 1.0 / 1.5, 1.0 / 2.4] {
                let split = dielectric(Model::Exact, f64::from(i) / 1000.0, eta);
                assert!((split.reflected + split.transmitted - 1.0).abs() < 16.0 * f64::EPSILON, "{i} {eta} {split:?}");
            }
        }
    }

    /// sin θ = 1/η is the critical angle; margins of 1e-12 in the sine are decided right.
    #[test]
    fn total_reflection_is_classified_exactly() {
        for n in [1.01, 1.33, 1.5, 2.4] {
            for margin in [1e-12, 1e-9, 1e-6] {
                let cos = |sin: f64| ((1.0 - sin) * (1.0 + sin)).sqrt();
                assert_eq!(dielectric(Model::Exact, cos((1.0 + margin) / n), 1.0 / n), TOTAL);
                assert!(dielectric(Model::Exact, cos((1.0 - margin) / n), 1.0 / n).transmitted > 0.0);
            }
        }
    }

    /// Just above the critical angle c² + η² − 1 loses nearly all of its digits. Here squares are kept in two numbers, of which the
    /// greater ones, near ½ to 1, cancel without rounding.
    #[test]
    fn the_refracted_cosine_keeps_its_digits_at_the_critical_angle() {
        let square = |x: f64| (x * x, x.mul_add(x, -(x * x)));
        for eta in [0.75f64, 1.0 / 1.33, 0.9, 0.99, 1.0 / 1.0003] {
            let critical = ((1.0 - eta) * (1.0 + eta)).sqrt();
            for i in 10..200 {
                let cos = critical * (1.0 + f64::from(i) * f64::EPSILON);
                let ((c, c_rest), (e, e_rest)) = (square(cos), square(eta));
                let expected = ((c - (1.0 - e)) + (c_rest + e_rest)).sqrt() / eta;
                let found = dielectric(Model::Exact, cos, eta).cos_transmitted;
                assert!(relative(found, expected) < 8.0 * f64::EPSILON, "{i} {eta}: {found} {expected}");
            }
        }
    }

    /// With k = 0 a conductor is a dielectric; with n = 1, k = 0 there is no interface at all.
    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        for i in 1..=100 {
            let cos = f64::from(i) / 100.0;
            let r = conductor(Model::Exact, cos, Lanes::splat(1.5), Lanes::ZERO).to_array()[3];
            let expected = dielectric(Model::Exact, cos, 1.5).reflected;
            // f32 result: half an ulp; the f64 cancellation near Brewster's angle is far below it.
            assert!((f64::from(r) - expected).abs() < 1e-7 * expected + 1e-12, "{cos}: {r} {expected}");
            assert!(conductor(Model::Exact, cos, Lanes::ONE, Lanes::ZERO).to_array()[0].abs() < 1e-12);
        }
    }

    /// Gold at 587.6 nm, n = 0.2798, k = 2.9278 (Johnson and Christy 1972, interpolated):
    /// R(0°) = ((n−1)² + k²) / ((n+1)² + k²).
    #[test]
    fn conductor_at_normal_incidence_is_the_closed_form() {
        let (n, k) = (0.2798f64, 2.9278f64);
        let expected = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
        for model in [Model::Exact, Model::Schlick] {
            let r = conductor(model, 1.0, Lanes::splat(n as f32), Lanes::splat(k as f32)).to_array()[7];
            assert!(relative(f64::from(r), expected) < 1e-6);
        }
    }

    /// Schlick 1994, eq. 15, with the R₀ of the complex index: the same gold. n, k and R are rounded to f32, 6e-8 each,
    /// and of n and k R takes less than a quarter.
    #[test]
    fn schlick_of_a_conductor_is_schlick_at_45_60_and_80_degrees() {
        let (n, k) = (0.2798f64, 2.9278f64);
        let r0 = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
        for deg in [45.0f64, 60.0, 80.0] {
            let cos = deg.to_radians().cos();
            let expected = r0 + (1.0 - r0) * (1.0 - cos).powi(5);
            let found = conductor(Model::Schlick, cos, Lanes::splat(n as f32), Lanes::splat(k as f32)).to_array()[7];
            assert!(relative(f64::from(found), expected) < 1e-7, "{deg}°: {found} {expected}");
        }
    }

    /// The published internal diffuse reflectance at η = 1.5 is 0.5963 and the external one 0.0918
    /// (Egan and Hilgeman 1973, fits quoted to 1e-3). The two are tied by
    /// 1 − F_int = (1 − F_ext)/η².
    #[test]
    fn diffuse_reflectances_are_the_published_ones() {
        let (external, internal) = (dielectric_diffuse(1.5), dielectric_diffuse(1.0 / 1.5));
        assert!((external - 0.0918).abs() < 1e-3 && (internal - 0.5963).abs() < 1e-3, "{external} {internal}");
        assert!(((1.0 - internal) - (1.0 - external) / 2.25).abs() < 1e-5);
    }
}
