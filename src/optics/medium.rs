//! Homogeneous media and their phase functions.
//!
//! Coefficients in 1/m. Beer and Lambert: transmittance exp(−σ_t d). Scattering is sampled at the
//! hero's wavelength and every lane states its density, so fog whose density depends on wavelength
//! is sampled by all of them together (Wilkie et al. 2014, section 4.2).

use crate::math::frame::Frame;
use crate::math::trig::sin_cos_turn;
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Which way a medium scatters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// 1 / 4π.
    Isotropic,
    /// Henyey and Greenstein 1941, with mean cosine g in (−1, 1).
    HenyeyGreenstein(f64),
    /// 3 (1 + cos²) / 16π: molecules.
    Rayleigh,
}

impl Phase {
    /// Density in sr⁻¹ of scattering from `wo` to `wi`, both leaving the point: cos θ of the
    /// deflection is −wo·wi. Value and sampling density are the same number.
    #[must_use]
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> f64 {
        let cos = -wo.dot(wi);
        match *self {
            Phase::Isotropic => 0.25 / PI,
            Phase::HenyeyGreenstein(g) => {
                // 1 + g² − 2 g cos as a sum of nonnegative terms, (1 − |g|)² + 2|g| (1 − cos of the angle
                // from the peak): it must not cancel for |g| near one.
                let from_peak = 1.0 - cos * g.signum();
                let d = (1.0 - g.abs()).mul_add(1.0 - g.abs(), 2.0 * g.abs() * from_peak);
                (1.0 - g) * (1.0 + g) / (4.0 * PI * d * d.sqrt())
            }
            Phase::Rayleigh => 3.0 / (16.0 * PI) * cos.mul_add(cos, 1.0),
        }
    }

    /// A direction with density [`Phase::eval`].
    #[must_use]
    pub fn sample(&self, wo: DVec3, u: DVec2) -> DVec3 {
        // 1 − cos θ, which keeps its digits for narrow forward peaks.
        let one_minus_cos = match *self {
            Phase::Isotropic => 2.0 * u.x,
            // The inverse CDF of Pharr et al. 2023, 11.3.1, rearranged for 1 − cos: with
            // s = (1 + g)/(1 + g − 2 g u), cos = (1 + g² − (1 − g)² s²) / 2g.
            Phase::HenyeyGreenstein(g) => {
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
        };
        let cos = 1.0 - one_minus_cos;
        let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos_turn(u.y);
        Frame::from_normal(-wo).to_world(DVec3::new(sin * cos_phi, sin * sin_phi, cos))
    }
}

/// A homogeneous medium at eight wavelengths.
#[derive(Clone, Copy, Debug)]
pub struct MediumLanes {
    /// σ_t = σ_a + σ_s, 1/m.
    pub extinction: Lanes,
    /// σ_s, 1/m.
    pub scattering: Lanes,
    /// Which way it scatters.
    pub phase: Phase,
}

/// What happens to a path on the way through a medium.
#[derive(Clone, Copy, Debug)]
pub struct FreeFlight {
    /// Distance to the scattering event; `None` where the path reaches its end first.
    pub scattered_at: Option<f64>,
    /// Factor on the throughput, for sampling led by the hero.
    pub weight: Lanes,
    /// Density of each lane over the hero's.
    pub ratio: Lanes,
    /// The hero's probability of coming through, or density of scattering there.
    pub density: f64,
}

impl MediumLanes {
    /// True where any lane scatters.
    #[must_use]
    pub fn scatters(&self) -> bool {
        !self.scattering.simd_eq(Lanes::ZERO).all()
    }

    /// exp(−σ_t `distance`) for each lane; one at distance zero, whatever σ_t.
    #[must_use]
    pub fn transmittance(&self, distance: f64) -> Lanes {
        // σ_t = 0 over an infinite distance is no attenuation, not 0 · ∞.
        let zero = self.extinction.simd_eq(Lanes::ZERO);
        let depth = self.extinction * distance as f32;
        zero.select(Lanes::ONE, (-depth).exp())
    }

    /// Samples the flight toward a surface at `distance` (may be infinite) with `u` in [0, 1).
    ///
    /// The hero draws from σ_t exp(−σ_t t); lanes weigh in with their own densities. A medium
    /// that does not scatter is crossed without a draw.
    #[must_use]
    pub fn fly(&self, distance: f64, u: f64) -> FreeFlight {
        let through = self.transmittance(distance);
        if !self.scatters() {
            return FreeFlight { scattered_at: None, weight: through, ratio: Lanes::ONE, density: 1.0 };
        }
        let hero = f64::from(self.extinction.to_array()[0]);
        let t = if hero > 0.0 { -libm::log1p(-u) / hero } else { f64::INFINITY };
        if t < distance {
            let here = self.transmittance(t);
            let density = here * self.extinction;
            let p = density.to_array()[0];
            if p > 0.0 {
                return FreeFlight {
                    scattered_at: Some(t),
                    weight: here * self.scattering / p,
                    ratio: density / p,
                    density: f64::from(p),
                };
            }
            // So dense and so far that exp underflows: no light comes through.
            return FreeFlight { scattered_at: Some(t), weight: Lanes::ZERO, ratio: Lanes::ONE, density: 0.0 };
        }
        let p = through.to_array()[0];
        if p > 0.0 {
            FreeFlight { scattered_at: None, weight: through / p, ratio: through / p, density: f64::from(p) }
        } else {
            FreeFlight { scattered_at: None, weight: Lanes::ZERO, ratio: Lanes::ONE, density: 0.0 }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::warp;

    const PHASES: [Phase; 5] = [
        Phase::Isotropic,
        Phase::Rayleigh,
        Phase::HenyeyGreenstein(0.5),
        Phase::HenyeyGreenstein(-0.7),
        Phase::HenyeyGreenstein(1e-9),
    ];

    fn grid(n: u32) -> impl Iterator<Item = DVec2> {
        (0..n * n).map(move |i| DVec2::new(f64::from(i % n) + 0.5, f64::from(i / n) + 0.5) / f64::from(n))
    }

    /// ∫ p dω = 1, by 65,536 midpoints in the cosine (the functions are symmetric about the axis); the
    /// sharpest has a width of 0.06 there, so the error h²/24 · f″/f is below 1e-7.
    #[test]
    fn phase_functions_are_normalised() {
        for phase in PHASES {
            let at = |i: u32| warp::uniform_sphere(DVec2::new((f64::from(i) + 0.5) / 65_536.0, 0.3));
            let mean = (0..65_536).map(|i| phase.eval(DVec3::Z, at(i))).sum::<f64>() / 65_536.0;
            assert!((mean * 4.0 * PI - 1.0).abs() < 1e-6, "{phase:?} {mean}");
        }
    }

    /// The mean cosine of the deflection is g for Henyey–Greenstein and zero for the others.
    #[test]
    fn sampled_directions_have_the_right_mean_cosine() {
        for phase in PHASES {
            let g = if let Phase::HenyeyGreenstein(g) = phase { g } else { 0.0 };
            let wo = DVec3::new(0.6, 0.0, 0.8);
            let mean = grid(256).map(|u| -wo.dot(phase.sample(wo, u))).sum::<f64>() / 65_536.0;
            assert!((mean - g).abs() < 1e-4, "{phase:?} {mean}");
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
            for u in grid(64).chain([DVec2::ZERO, DVec2::splat(1.0 - 2f64.powi(-32))]) {
                let wi = phase.sample(DVec3::Z, u);
                assert!(wi.is_finite() && (wi.length() - 1.0).abs() < 1e-12, "{u} {wi}");
            }
        }
    }

    /// The expected weight of reaching the end plus that of scattering, with the densities of all
    /// lanes in the denominator, must give back transmittance and albedo · (1 − transmittance).
    /// With u on 20,000 midpoints and heroes over all eight lanes, the quadrature error of the
    /// discontinuous integrand is below 1/20,000.
    #[test]
    fn every_lane_gets_its_own_beer_lambert_law() {
        let extinction = [0.1f32, 0.5, 1.0, 2.0, 3.0, 5.0, 0.0, 0.7];
        let (distance, n) = (0.8, 20_000);
        let mut through = [0.0f64; 8];
        let mut scattered = [0.0f64; 8];
        for rotation in 0..8 {
            let lanes: [f32; 8] = std::array::from_fn(|i| extinction[(i + rotation) % 8]);
            let medium = MediumLanes {
                extinction: Lanes::new(lanes),
                scattering: Lanes::new(lanes) * 0.5,
                phase: Phase::Isotropic,
            };
            for i in 0..n {
                let flight = medium.fly(distance, (f64::from(i) + 0.5) / f64::from(n));
                let share = (flight.weight / flight.ratio.reduce_add()).to_array();
                let sums = if flight.scattered_at.is_some() { &mut scattered } else { &mut through };
                for lane in 0..8 {
                    sums[(lane + rotation) % 8] += f64::from(share[lane]) / f64::from(n);
                }
            }
        }
        for lane in 0..8 {
            let t = (-f64::from(extinction[lane]) * distance).exp();
            assert!((through[lane] - t).abs() < 2e-4, "lane {lane}: {} {t}", through[lane]);
            assert!((scattered[lane] - 0.5 * (1.0 - t)).abs() < 2e-4, "lane {lane}: {} {t}", scattered[lane]);
        }
    }

    #[test]
    fn vacuum_and_infinite_distances_are_no_nan() {
        let medium =
            |s: f32| MediumLanes { extinction: Lanes::splat(s), scattering: Lanes::splat(s), phase: Phase::Isotropic };
        assert_eq!(medium(0.0).transmittance(f64::INFINITY).to_array(), [1.0; 8]);
        assert_eq!(medium(1.0).transmittance(f64::INFINITY).to_array(), [0.0; 8]);
        assert_eq!(medium(1e30).transmittance(0.0).to_array(), [1.0; 8]);
        for (sigma, distance) in [(0.0, f64::INFINITY), (1e30, 1.0), (1e30, f64::INFINITY), (1e-30, f64::INFINITY)] {
            let flight = medium(sigma).fly(distance, 0.5);
            assert!(flight.weight.to_array().iter().all(|w| w.is_finite()), "{sigma} {distance} {flight:?}");
        }
    }
}
