//! The filters themselves: their formulas, and what of them pixels share.

use crate::error::{Error, Result};

/// A reconstruction filter. Lengths are in pixels.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Filter {
    /// One over the pixel, nothing outside.
    Box,
    /// Falls linearly to zero at `radius`.
    Tent {
        /// Where it reaches zero.
        radius: f64,
    },
    /// exp(−x²/2σ²) − exp(−8): cut off at 4σ, less its value there, so that it is continuous (as in Mitsuba 3).
    Gaussian {
        /// σ.
        stddev: f64,
    },
    /// Mitchell and Netravali 1988, eq. 8; radius 2.
    Mitchell {
        /// Their B: 1/3 as they recommend.
        b: f64,
        /// Their C: 1/3 as they recommend.
        c: f64,
    },
    /// The interpolating cubic of Catmull and Rom 1974: Mitchell with B = 0, C = 1/2.
    CatmullRom,
    /// sinc(x)·sinc(x / radius).
    Lanczos {
        /// Where it ends: its number of lobes.
        radius: f64,
    },
}

impl Filter {
    /// The distance from the centre, along an axis, at which the filter ends.
    #[must_use]
    pub fn radius(&self) -> f64 {
        match *self {
            Filter::Box => 0.5,
            Filter::Tent { radius } | Filter::Lanczos { radius } => radius,
            Filter::Gaussian { stddev } => 4.0 * stddev,
            Filter::Mitchell { .. } | Filter::CatmullRom => 2.0,
        }
    }

    /// In how many pixels light falls together that is dealt to all that the filter covers: (∫h)² / ∫h² over the plane. Errors
    /// of their sum are those of independent pixels, times its root.
    #[must_use]
    pub fn span(&self) -> f64 {
        const STEPS: u32 = 4096;
        let step = 2.0 * self.radius() / f64::from(STEPS);
        let values = (0..STEPS).map(|i| self.eval((f64::from(i) + 0.5) * step - self.radius()));
        let (sum, squares) = values.fold((0.0, 0.0), |(sum, squares), f| (sum + f, squares + f * f));
        (sum * sum * step / squares).powi(2)
    }

    /// What light that is dealt to all that the filter covers makes of pairs of pixels: Σ ρ² over all places k of one pixel beside
    /// another, with ρ(k) = ∫h(x) h(x + k) / ∫h² the correlation of the two. One where no pixel shares with another.
    #[must_use]
    pub fn overlap(&self) -> f64 {
        const STEPS: u32 = 4096;
        let step = 2.0 * self.radius() / f64::from(STEPS);
        let product = |k: f64| {
            let x = (0..STEPS).map(|i| (f64::from(i) + 0.5) * step - self.radius());
            x.map(|x| self.eval(x) * self.eval(x + k)).sum::<f64>()
        };
        let apart = (2.0 * self.radius()).ceil() as u32;
        let whole = product(0.0);
        let beside: f64 = (1..apart).map(|k| (product(f64::from(k)) / whole).powi(2)).sum();
        (1.0 + 2.0 * beside).powi(2)
    }

    /// The filter along an axis at distance `x` from the centre, up to a factor.
    #[must_use]
    pub fn eval(&self, x: f64) -> f64 {
        let x = x.abs();
        if x > self.radius() {
            return 0.0;
        }
        match *self {
            Filter::Box => 1.0,
            Filter::Tent { radius } => 1.0 - x / radius,
            Filter::Gaussian { stddev } => {
                let z = x / stddev;
                (libm::exp(-0.5 * z * z) - libm::exp(-8.0)).max(0.0)
            }
            Filter::Mitchell { b, c } => mitchell(x, b, c),
            Filter::CatmullRom => mitchell(x, 0.0, 0.5),
            Filter::Lanczos { radius } => sinc(x) * sinc(x / radius),
        }
    }

    pub(super) fn validate(&self) -> Result<()> {
        let positive = |name: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                Ok(())
            } else {
                Err(Error::Config(format!("filter: {name}: expected a positive number of pixels, found {value}")))
            }
        };
        match *self {
            Filter::Box | Filter::CatmullRom => Ok(()),
            Filter::Tent { radius } => positive("tent.radius", radius),
            Filter::Lanczos { radius } => positive("lanczos.radius", radius),
            Filter::Gaussian { stddev } => positive("gaussian.stddev", stddev),
            Filter::Mitchell { b, c } => {
                if b.is_finite() && c.is_finite() {
                    Ok(())
                } else {
                    Err(Error::Config(format!("filter: mitchell: expected finite b and c, found {b} and {c}")))
                }
            }
        }
    }
}

/// Mitchell and Netravali 1988, eq. 8, times six.
fn mitchell(x: f64, b: f64, c: f64) -> f64 {
    if x < 1.0 {
        (12.0 - 9.0 * b - 6.0 * c) * x * x * x + (-18.0 + 12.0 * b + 6.0 * c) * x * x + (6.0 - 2.0 * b)
    } else {
        (-b - 6.0 * c) * x * x * x + (6.0 * b + 30.0 * c) * x * x + (-12.0 * b - 48.0 * c) * x + (8.0 * b + 24.0 * c)
    }
}

/// sin(πx) / πx; below πx = 1e-4 the series 1 − (πx)²/6, whose next term is 1e-18.
fn sinc(x: f64) -> f64 {
    let y = std::f64::consts::PI * x;
    if y < 1e-4 { 1.0 - y * y / 6.0 } else { libm::sin(y) / y }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(filter: Filter, found: f64, expected: f64, off: f64) {
        assert!((found / expected - 1.0).abs() < off, "{filter:?}: {found} for {expected}");
    }

    /// By hand: a tent of radius 2 has ¾ at ½; Mitchell and Netravali's cubic with b = c = ⅓ 8/9, 1/18 and −5/144 at 0, 1 and 1½; Catmull
    /// and Rom's 9/16 and −1/16 at ½ and 1½; Lanczos's of radius 3 sin(3π/2)/(3π/2) · sin(π/2)/(π/2) = −4/3π² at 1½. All over what
    /// they have in the middle, as factors do not count.
    #[test]
    fn filters_have_the_values_of_their_formulas() {
        let (mitchell, cut) = (Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }, (-8.0f64).exp());
        for (filter, middle, x, expected) in [
            (Filter::Tent { radius: 2.0 }, 1.0, 0.5, 0.75),
            (Filter::Gaussian { stddev: 0.5 }, 1.0 - cut, 1.0, (-2.0f64).exp() - cut),
            (mitchell, 8.0 / 9.0, 1.0, 1.0 / 18.0),
            (mitchell, 8.0 / 9.0, 1.5, -5.0 / 144.0),
            (Filter::CatmullRom, 1.0, 0.5, 9.0 / 16.0),
            (Filter::CatmullRom, 1.0, 1.5, -1.0 / 16.0),
            (Filter::Lanczos { radius: 3.0 }, 1.0, 1.5, -4.0 / (3.0 * std::f64::consts::PI.powi(2))),
            (Filter::Lanczos { radius: 3.0 }, 1.0, 3.1, 0.0),
        ] {
            for x in [x, -x] {
                let found = filter.eval(x) / filter.eval(0.0);
                assert!((found - expected / middle).abs() < 1e-14, "{filter:?} at {x}: {found} for {expected}");
            }
        }
    }

    /// Closed forms of (∫f)²/∫f², squared for the plane: 1; a tent of radius r 3r/2; a Gaussian 2√π σ, cut at 4σ.
    #[test]
    fn spans_are_those_of_the_squares() {
        let near = |filter: Filter, expected, off| assert_near(filter, filter.span(), expected, off);
        near(Filter::Box, 1.0, 1e-12);
        near(Filter::Tent { radius: 2.0 }, 9.0, 1e-5);
        // What is cut off is 3e-4 at the middle and 8 / √(2π) of that in all.
        near(Filter::Gaussian { stddev: 0.7 }, 4.0 * std::f64::consts::PI * 0.49, 3e-3);
    }

    /// Of a box no pixel shares with another. A tent of radius 1 has ρ(1) = (1/6)/(2/3); a Gaussian exp(−k²/4σ²), where what is
    /// cut off counts as above.
    #[test]
    fn overlaps_are_those_of_the_correlations() {
        let near = |filter: Filter, expected, off| assert_near(filter, filter.overlap(), expected, off);
        near(Filter::Box, 1.0, 1e-12);
        near(Filter::Tent { radius: 1.0 }, 1.125 * 1.125, 1e-5);
        let gaussian: f64 = (-9..=9).map(|k: i32| f64::from(-k * k) / (2.0 * 0.64)).map(f64::exp).sum();
        near(Filter::Gaussian { stddev: 0.8 }, gaussian * gaussian, 3e-3);
    }
}
