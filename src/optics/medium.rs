//! Homogeneous media.
//!
//! Coefficients in 1/m. Beer and Lambert: transmittance exp(−σ_t d). Scattering is sampled at the
//! hero's wavelength and every lane states its density, so fog whose density depends on wavelength
//! is sampled by all of them together (Wilkie et al. 2014, section 4.2).

use crate::spectrum::Lanes;

/// A homogeneous medium at eight wavelengths.
#[derive(Clone, Copy, Debug)]
pub struct MediumLanes {
    /// σ_t = σ_a + σ_s, 1/m.
    pub extinction: Lanes,
    /// σ_s, 1/m.
    pub scattering: Lanes,
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
        self.arrive(distance, self.reach(u))
    }

    /// How far the flight drawn by `u` goes where no surface ends it; infinite where nothing scatters.
    #[must_use]
    #[inline]
    pub fn reach(&self, u: f64) -> f64 {
        let hero = f64::from(self.extinction.to_array()[0]);
        if hero > 0.0 && self.scatters() { -libm::log1p(-u) / hero } else { f64::INFINITY }
    }

    /// The flight of [`MediumLanes::reach`] `t` toward a surface at `distance`.
    #[must_use]
    #[inline]
    pub fn arrive(&self, distance: f64, t: f64) -> FreeFlight {
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
        let through = self.transmittance(distance);
        if !self.scatters() {
            return FreeFlight { scattered_at: None, weight: through, ratio: Lanes::ONE, density: 1.0 };
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
            let medium = MediumLanes { extinction: Lanes::new(lanes), scattering: Lanes::new(lanes) * 0.5 };
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

    /// Of all flights 1 − e^(−σd) scatter before d: that is the u up to which they do. Behind it are three functions and a
    /// division, each exact to an ulp.
    #[test]
    fn the_thinnest_fog_scatters_its_share() {
        for depth in [1e-12, 1e-8, 1e-4, 1.0] {
            let medium = MediumLanes { extinction: Lanes::splat(0.25), scattering: Lanes::splat(0.25) };
            let share = -libm::expm1(-depth);
            for (u, scatters) in
                [(share * (1.0 - 4.0 * f64::EPSILON), true), (share * (1.0 + 4.0 * f64::EPSILON), false)]
            {
                assert_eq!(medium.fly(4.0 * depth, u).scattered_at.is_some(), scatters, "{depth} {u}");
            }
        }
    }

    #[test]
    fn vacuum_and_infinite_distances_are_no_nan() {
        let medium = |s: f32| MediumLanes { extinction: Lanes::splat(s), scattering: Lanes::splat(s) };
        assert_eq!(medium(0.0).transmittance(f64::INFINITY).to_array(), [1.0; 8]);
        assert_eq!(medium(1.0).transmittance(f64::INFINITY).to_array(), [0.0; 8]);
        assert_eq!(medium(1e30).transmittance(0.0).to_array(), [1.0; 8]);
        for (sigma, distance) in [(0.0, f64::INFINITY), (1e30, 1.0), (1e30, f64::INFINITY), (1e-30, f64::INFINITY)] {
            let flight = medium(sigma).fly(distance, 0.5);
            assert!(flight.weight.to_array().iter().all(|w| w.is_finite()), "{sigma} {distance} {flight:?}");
        }
    }
}
