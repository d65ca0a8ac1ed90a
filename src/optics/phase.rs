//! Phase functions: which way a medium scatters.
//!
//! Directions leave the point; cos θ of the deflection is −wo·wi, so forward scattering is cos θ =
//! 1. Value and sampling density are the same number, in sr⁻¹.

use crate::math::frame::Frame;
use crate::math::trig::sin_cos_turn;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// Which way a medium scatters.
#[derive(Clone, Debug, PartialEq)]
pub enum Phase {
    /// 1 / 4π.
    Isotropic,
    /// Henyey and Greenstein 1941, with mean cosine g in (−1, 1).
    HenyeyGreenstein(f64),
    /// 3 (1 + cos²) / 16π: molecules.
    Rayleigh,
    /// Measured.
    Table(Arc<PhaseTable>),
}

/// A phase function that is linear in cos θ between values at even steps from −1 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseTable {
    /// Densities over cos θ at the knots: their integral is one.
    density: Vec<f64>,
    /// The integral from −1 to each knot; the last is one.
    cdf: Vec<f64>,
}

impl PhaseTable {
    /// The table of `values`, of any common factor.
    ///
    /// # Errors
    /// In words: fewer than two values, one that is negative or not finite, or all zero.
    pub fn new(values: &[f64]) -> Result<PhaseTable, String> {
        if values.len() < 2 {
            return Err(format!("expected 2 or more values, found {}", values.len()));
        }
        if let Some(bad) = values.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
            return Err(format!("expected values of 0 or more, found {bad}"));
        }
        let largest = values.iter().copied().fold(0.0, f64::max);
        if largest == 0.0 {
            return Err("expected a value above 0, found none".into());
        }
        let step = 2.0 / (values.len() - 1) as f64;
        // Over the largest first: a sum of large values must not overflow.
        let values: Vec<f64> = values.iter().map(|v| v / largest).collect();
        let mut cdf = vec![0.0];
        let mut sum = 0.0;
        for pair in values.windows(2) {
            sum += 0.5 * (pair[0] + pair[1]) * step;
            cdf.push(sum);
        }
        let last = cdf.len() - 1;
        cdf.iter_mut().for_each(|c| *c /= sum);
        cdf[last] = 1.0;
        Ok(PhaseTable { density: values.iter().map(|v| v / sum).collect(), cdf })
    }

    fn step(&self) -> f64 {
        2.0 / (self.density.len() - 1) as f64
    }

    /// The density of cos θ.
    fn at(&self, cos: f64) -> f64 {
        let x = (cos.clamp(-1.0, 1.0) + 1.0) / self.step();
        let i = (x as usize).min(self.density.len() - 2);
        let t = (x - i as f64).min(1.0);
        self.density[i] * (1.0 - t) + self.density[i + 1] * t
    }

    /// The cos θ below which a share `u` lies.
    fn invert(&self, u: f64) -> f64 {
        let i = (self.cdf.partition_point(|c| *c <= u)).clamp(1, self.cdf.len() - 1) - 1;
        let (a, b) = (self.density[i], self.density[i + 1]);
        // ∫₀ᵗ a + (b − a) t′ dt′ = a t + (b − a) t²/2 = s, solved without cancellation.
        let s = (u - self.cdf[i]).max(0.0) / self.step();
        let root = (2.0 * (b - a)).mul_add(s, a * a).max(0.0).sqrt();
        let t = if s > 0.0 { (2.0 * s / (a + root)).min(1.0) } else { 0.0 };
        (i as f64 + t).mul_add(self.step(), -1.0)
    }
}

impl Phase {
    /// Density in sr⁻¹ of scattering from `wo` to `wi`, both leaving the point.
    #[must_use]
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> f64 {
        let cos = -wo.dot(wi);
        match self {
            Phase::Isotropic => 0.25 / PI,
            Phase::HenyeyGreenstein(g) => {
                // 1 + g² − 2 g cos as a sum of nonnegative terms, (1 − |g|)² + 2|g| (1 − cos of the angle
                // from the peak): it must not cancel for |g| near one.
                // A cosine beyond one by rounding is one.
                let from_peak = (1.0 - cos * g.signum()).max(0.0);
                let d = (1.0 - g.abs()).mul_add(1.0 - g.abs(), 2.0 * g.abs() * from_peak);
                (1.0 - g) * (1.0 + g) / (4.0 * PI * d * d.sqrt())
            }
            Phase::Rayleigh => 3.0 / (16.0 * PI) * cos.mul_add(cos, 1.0),
            Phase::Table(table) => table.at(cos) * (0.5 / PI),
        }
    }

    /// A direction with density [`Phase::eval`].
    #[must_use]
    pub fn sample(&self, wo: DVec3, u: DVec2) -> DVec3 {
        // 1 − cos θ, which keeps its digits for narrow forward peaks.
        let one_minus_cos = match self {
            Phase::Isotropic => 2.0 * u.x,
            // The inverse CDF of Pharr et al. 2023, 11.3.1, rearranged for 1 − cos: with
            // s = (1 + g)/(1 + g − 2 g u), cos = (1 + g² − (1 − g)² s²) / 2g.
            &Phase::HenyeyGreenstein(g) => {
                let d = 1.0 + g - 2.0 * g * u.x;
                // 1 − cos = (1−g)² (s² − 1) / 2g and s² − 1 = 4 g u (1 + g − g u) / d².
                2.0 * (1.0 - g) * (1.0 - g) * u.x * (1.0 + g - g * u.x) / (d * d)
            }
            Phase::Rayleigh => {
                // Cardano on cos³ + 3 cos = 8 u − 4 (Frisvad 2011).
                let b = 4.0 * u.x - 2.0;
                let a = libm::cbrt(b + b.mul_add(b, 1.0).sqrt());
                1.0 + (a - 1.0 / a)
            }
            Phase::Table(table) => 1.0 - table.invert(u.x),
        };
        let cos = 1.0 - one_minus_cos;
        let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos_turn(u.y);
        Frame::from_normal(-wo).to_world(DVec3::new(sin * cos_phi, sin * sin_phi, cos))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::warp;

    fn phases() -> Vec<Phase> {
        let table = |values: &[f64]| Phase::Table(Arc::new(PhaseTable::new(values).unwrap()));
        vec![
            Phase::Isotropic,
            Phase::Rayleigh,
            Phase::HenyeyGreenstein(0.5),
            Phase::HenyeyGreenstein(-0.7),
            Phase::HenyeyGreenstein(1e-9),
            table(&[3.0, 3.0]),
            table(&[0.0, 1.0]),
            table(&[0.4, 0.0, 0.0, 2.0, 0.5, 9.0]),
        ]
    }

    /// ∫ p dω = 1, by 65,536 midpoints in the cosine (the functions are symmetric about the axis); the
    /// sharpest has a width of 0.06 there, so the error h²/24 · f″/f is below 1e-7; at the five kinks of a table
    /// it is at most h² times the change of slope, 1e-8.
    #[test]
    fn phase_functions_are_normalised() {
        for phase in phases() {
            let at = |i: u32| warp::uniform_sphere(DVec2::new((f64::from(i) + 0.5) / 65_536.0, 0.3));
            let mean = (0..65_536).map(|i| phase.eval(DVec3::Z, at(i))).sum::<f64>() / 65_536.0;
            assert!((mean * 4.0 * PI - 1.0).abs() < 1e-6, "{phase:?} {mean}");
        }
    }

    /// The mean cosine of the deflection is g for Henyey–Greenstein, ∫ p cos for a table (here by the same
    /// 65,536 midpoints), and zero for the others. Where a density starts from zero its inverse starts as a root, and
    /// the mean of 256 midpoints errs by up to 256^-1.5.
    #[test]
    fn sampled_directions_have_the_right_mean_cosine() {
        for phase in phases() {
            let expected = match &phase {
                Phase::HenyeyGreenstein(g) => *g,
                Phase::Table(table) => {
                    let cos = |i: i32| (f64::from(i) + 0.5) / 32_768.0 - 1.0;
                    (0..65_536).map(|i| cos(i) * table.at(cos(i))).sum::<f64>() / 32_768.0
                }
                _ => 0.0,
            };
            let wo = DVec3::new(0.6, 0.0, 0.8);
            let mean = warp::midpoints(256).map(|u| -wo.dot(phase.sample(wo, u))).sum::<f64>() / 65_536.0;
            assert!(
                (mean - expected).abs() < if matches!(phase, Phase::Table(_)) { 2.5e-4 } else { 1e-4 },
                "{phase:?} {mean} {expected}"
            );
        }
    }

    /// Sampling inverts the cumulated density: of n evenly spaced u, the share that falls below a cosine is its
    /// integral, to 1/n. In 40 cells, none of them a multiple of the table's; and each density is that of `eval`.
    #[test]
    fn the_share_of_samples_in_every_cell_is_the_integral_of_the_density() {
        for phase in phases() {
            let (n, cells) = (20_000u32, 40);
            let mut found = vec![0u32; cells];
            for i in 0..n {
                let u = DVec2::new((f64::from(i) + 0.5) / f64::from(n), 0.37);
                let cos = -DVec3::Z.dot(phase.sample(DVec3::Z, u));
                found[(((cos + 1.0) * 0.5 * cells as f64) as usize).min(cells - 1)] += 1;
            }
            for (cell, &count) in found.iter().enumerate() {
                let steps = 1000;
                let cos = |j: i32| ((cell as f64 + (f64::from(j) + 0.5) / f64::from(steps)) / cells as f64) * 2.0 - 1.0;
                let p = |cos: f64| phase.eval(DVec3::Z, DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, -cos));
                let mean = (0..steps).map(|j| p(cos(j))).sum::<f64>() / f64::from(steps);
                let expected = mean * 2.0 * PI * 2.0 / cells as f64 * f64::from(n);
                assert!((f64::from(count) - expected).abs() < 2.1, "{phase:?} cell {cell}: {count} {expected}");
            }
        }
    }

    /// Straight on, where the product of a direction with itself is rounded to either side of one, the peak is
    /// (1 − g²) / (4π (1 − |g|)³), and no more than rounding below it.
    #[test]
    fn the_narrowest_peaks_are_finite_along_any_direction() {
        for g in [0.999_999_99f64, -0.999_999_999, 1.0 - f64::EPSILON] {
            let phase = Phase::HenyeyGreenstein(g);
            let peak = (1.0 - g) * (1.0 + g) / (4.0 * PI * (1.0 - g.abs()).powi(3));
            for i in 0..1000 {
                let wi = warp::uniform_sphere(DVec2::new((f64::from(i) + 0.5) / 1000.0, f64::from(i) * 0.618 % 1.0));
                let found = phase.eval(wi * -g.signum(), wi);
                assert!(found > 0.0 && found <= peak * (1.0 + 1e-12), "{g}: {found} of {peak}");
            }
        }
    }

    /// For g = ±0.999999 the peak is a millionth of a radian wide: the closed form at cos = ±1 is
    /// (1 + |g|) / (4π (1 − |g|)²), and nothing is NaN.
    #[test]
    fn narrow_peaks_keep_their_digits() {
        for g in [0.999_999f64, -0.999_999] {
            let phase = Phase::HenyeyGreenstein(g);
            let peak = phase.eval(DVec3::Z, -DVec3::Z * g.signum());
            let expected = (1.0 + g.abs()) / (4.0 * PI * (1.0 - g.abs()).powi(2));
            assert!(((peak - expected) / expected).abs() < 1e-9, "{peak} {expected}");
            for u in warp::midpoints(64).chain([DVec2::ZERO, DVec2::splat(1.0 - 2f64.powi(-32))]) {
                let wi = phase.sample(DVec3::Z, u);
                assert!(wi.is_finite() && (wi.length() - 1.0).abs() < 1e-12, "{u} {wi}");
            }
        }
    }

    #[test]
    fn tables_that_are_none_are_refused_in_words() {
        assert_eq!(PhaseTable::new(&[1.0]).unwrap_err(), "expected 2 or more values, found 1");
        assert_eq!(PhaseTable::new(&[1.0, -0.5]).unwrap_err(), "expected values of 0 or more, found -0.5");
        assert_eq!(PhaseTable::new(&[0.0, 0.0]).unwrap_err(), "expected a value above 0, found none");
        assert!(PhaseTable::new(&[1e308, 1e308]).is_ok());
    }
}
