//! Where a cubic first becomes negative.

/// c₀ + c₁ τ + c₂ τ² + c₃ τ³.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cubic(pub [f64; 4]);

impl Cubic {
    /// The value at `tau`.
    #[inline]
    #[must_use]
    pub fn at(&self, tau: f64) -> f64 {
        let [c0, c1, c2, c3] = self.0;
        c3.mul_add(tau, c2).mul_add(tau, c1).mul_add(tau, c0)
    }

    #[inline]
    fn slope(&self, tau: f64) -> f64 {
        let [_, c1, c2, c3] = self.0;
        (3.0 * c3).mul_add(tau, 2.0 * c2).mul_add(tau, c1)
    }

    /// Where between 0 and `end` the cubic first becomes negative; its value at 0 counts as positive,
    /// also where rounding says otherwise.
    ///
    /// Between its extrema the cubic is monotone, so the sign at the end of each such stretch tells
    /// whether there is a root on it (Marmitt et al. 2004, "Fast and Accurate Ray-Voxel Intersection
    /// Techniques for Iso-Surface Ray Tracing"). A root is found to the last bit or two.
    #[inline]
    #[must_use]
    pub fn first_negative(&self, end: f64) -> Option<f64> {
        let [c0, c1, c2, c3] = self.0;
        let cubic = Cubic([c0.max(0.0), c1, c2, c3]);

        // Extrema: c₁ + 2 c₂ τ + 3 c₃ τ² = 0, without cancellation. NaN where there is none.
        let root = (c2 * c2 - 3.0 * c1 * c3).sqrt();
        let q = -(c2 + root.copysign(c2));
        let (e, f) = (q / (3.0 * c3), c1 / q);
        let (first, second) = if e < f { (e, f) } else { (f, e) };

        let mut from = 0.0;
        for to in [first, second, end] {
            // Also false for NaN.
            if to > from && to <= end {
                if cubic.at(to) < 0.0 {
                    return Some(cubic.falling_root(from, to));
                }
                from = to;
            }
        }
        None
    }

    /// The root of a monotone stretch that falls from `from`, where the value is not negative, to
    /// `to`, where it is. Newton's steps, halving where they leave the bracket.
    fn falling_root(&self, mut from: f64, mut to: f64) -> f64 {
        let mut x = 0.5 * (from + to);
        // Halving alone ends after at most 1100 steps; together they need about six.
        loop {
            let value = self.at(x);
            if value < 0.0 {
                to = x
            } else {
                from = x
            }
            let newton = x - value / self.slope(x);
            let next = if newton > from && newton < to { newton } else { 0.5 * (from + to) };
            // Where the bracket is two neighbouring numbers, or Newton stands still within a bit.
            if next == x || next <= from || next >= to || (next - x).abs() <= f64::EPSILON * x {
                return next.clamp(from, to);
            }
            x = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shape::testing::Random;

    /// k (r₀ − τ)(r₁ − τ)(r₂ − τ).
    fn with_roots(k: f64, r: [f64; 3]) -> Cubic {
        let [a, b, c] = r;
        Cubic([k * a * b * c, -k * (a * b + b * c + c * a), k * (a + b + c), -k])
    }

    /// Roots half a unit apart or more: the condition number of each is at most 4 of the coefficients,
    /// whose rounding is 4 ε of up to 8: 1e-13 is generous. Then the first of them is the answer.
    #[test]
    fn the_first_of_three_roots_is_found() {
        let mut random = Random::new(3);
        for _ in 0..100_000 {
            let a = random.range(0.0, 1.0);
            let b = a + random.range(0.5, 1.0);
            let c = b + random.range(0.5, 1.0);
            let k = random.log_uniform(-30.0, 30.0);
            let cubic = with_roots(k, [a, b, c]);
            let found = cubic.first_negative(4.0).unwrap();
            assert!((found - a).abs() < 1e-13, "{found} {a}");
            // Short of the first root there is none.
            assert_eq!(cubic.first_negative(a * (1.0 - 1e-12)), None);
        }
    }

    /// Lower degrees have infinite or no extrema.
    #[test]
    fn lines_parabolas_and_constants_are_cubics_too() {
        // The last bit or two.
        let half = |found: Option<f64>| assert!((found.unwrap() - 0.5).abs() <= 2.0 * f64::EPSILON, "{found:?}");
        half(Cubic([1.0, -2.0, 0.0, 0.0]).first_negative(1.0));
        assert_eq!(Cubic([1.0, 2.0, 0.0, 0.0]).first_negative(1.0), None);
        half(Cubic([0.75, -2.0, 1.0, 0.0]).first_negative(3.0));
        // Touching is not crossing.
        assert_eq!(Cubic([1.0, -2.0, 1.0, 0.0]).first_negative(3.0), None);
        assert_eq!(Cubic([0.0; 4]).first_negative(1.0), None);
        assert_eq!(Cubic([0.0, 1.0, 0.0, 0.0]).first_negative(1.0), None);
        assert!(Cubic([0.0, -1.0, 0.0, 0.0]).first_negative(1.0).unwrap() < 1e-300);
    }

    /// A root at 0 that the ray departs from is not met again; the other one, at 1/4, is.
    #[test]
    fn the_root_at_the_start_is_left_out() {
        let cubic = Cubic([-1e-17, 0.25, -1.0, 0.0]);
        assert!((cubic.first_negative(1.0).unwrap() - 0.25).abs() < 1e-15);
        assert_eq!(cubic.first_negative(0.2), None);
    }
}
