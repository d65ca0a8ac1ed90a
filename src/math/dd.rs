//! Double-double arithmetic: some 104 bits, for inverses and as the yardstick that tests hold f64 code
//! against.
//!
//! Dekker 1971; Hida, Li and Bailey 2001, "Algorithms for Quad-Double Precision Floating Point
//! Arithmetic".

use glam::DVec3;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// The unevaluated sum of two f64, the second below half an ulp of the first.
#[derive(Clone, Copy, Debug)]
pub struct Dd(f64, f64);

/// A vector of [`Dd`].
#[derive(Clone, Copy, Debug)]
pub struct Dd3(pub [Dd; 3]);

fn two_sum(a: f64, b: f64) -> Dd {
    let s = a + b;
    let bb = s - a;
    Dd(s, (a - (s - bb)) + (b - bb))
}

/// Sum where |a| ≥ |b|.
fn ordered_sum(a: f64, b: f64) -> Dd {
    let s = a + b;
    Dd(s, b - (s - a))
}

impl From<f64> for Dd {
    fn from(x: f64) -> Dd {
        Dd(x, 0.0)
    }
}

impl Add for Dd {
    type Output = Dd;
    fn add(self, other: Dd) -> Dd {
        let s = two_sum(self.0, other.0);
        let t = two_sum(self.1, other.1);
        let s = ordered_sum(s.0, s.1 + t.0);
        ordered_sum(s.0, s.1 + t.1)
    }
}

impl Neg for Dd {
    type Output = Dd;
    fn neg(self) -> Dd {
        Dd(-self.0, -self.1)
    }
}

impl Sub for Dd {
    type Output = Dd;
    fn sub(self, other: Dd) -> Dd {
        self + -other
    }
}

impl Mul for Dd {
    type Output = Dd;
    fn mul(self, other: Dd) -> Dd {
        let p = self.0 * other.0;
        let e = self.0.mul_add(other.0, -p);
        ordered_sum(p, e + (self.0 * other.1 + self.1 * other.0))
    }
}

impl Div for Dd {
    type Output = Dd;
    fn div(self, other: Dd) -> Dd {
        // Long division, three digits of 53 bits.
        let q0 = self.0 / other.0;
        let r = self - other * Dd::from(q0);
        let q1 = r.0 / other.0;
        let r = r - other * Dd::from(q1);
        ordered_sum(q0, q1) + Dd::from(r.0 / other.0)
    }
}

impl Dd {
    /// Less than any other.
    pub const MIN: Dd = Dd(-1e300, 0.0);
    /// Greater than any other.
    pub const MAX: Dd = Dd(1e300, 0.0);

    /// The nearest f64.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        self.0 + self.1
    }

    /// The square root; zero for a negative number.
    #[must_use]
    pub fn sqrt(self) -> Dd {
        if self.0 <= 0.0 {
            return Dd(0.0, 0.0);
        }
        // One step of Newton from the f64 root doubles the digits.
        let root = Dd::from(self.0.sqrt());
        root + (self - root * root) / (root + root)
    }

    /// The lesser of two.
    #[must_use]
    pub fn min(self, other: Dd) -> Dd {
        if (other - self).to_f64() < 0.0 { other } else { self }
    }

    /// The greater of two.
    #[must_use]
    pub fn max(self, other: Dd) -> Dd {
        if (other - self).to_f64() > 0.0 { other } else { self }
    }
}

impl From<DVec3> for Dd3 {
    fn from(v: DVec3) -> Dd3 {
        Dd3(v.to_array().map(Dd::from))
    }
}

impl Sub for Dd3 {
    type Output = Dd3;
    fn sub(self, other: Dd3) -> Dd3 {
        Dd3(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl Dd3 {
    /// self · other.
    #[must_use]
    pub fn dot(self, other: Dd3) -> Dd {
        let [a, b, c] = std::array::from_fn(|i| self.0[i] * other.0[i]);
        a + b + c
    }

    /// self × other.
    #[must_use]
    pub fn cross(self, other: Dd3) -> Dd3 {
        let ([ax, ay, az], [bx, by, bz]) = (self.0, other.0);
        Dd3([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// √2² − 2 and 3 · (1/3) − 1 vanish to 2⁻¹⁰⁰; in f64 they would to 2⁻⁵².
    #[test]
    fn double_double_carries_a_hundred_bits() {
        let two = Dd::from(2.0);
        let root = two.sqrt();
        let third = Dd::from(1.0) / Dd::from(3.0);
        for error in [root * root - two, third * Dd::from(3.0) - Dd::from(1.0)] {
            assert!(error.to_f64().abs() < (0.5f64).powi(100), "{error:?}");
        }
    }
}
