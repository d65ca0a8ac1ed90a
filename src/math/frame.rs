//! Orthonormal frames.

use glam::DVec3;

/// A right-handed orthonormal frame; local z is `n`.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Local x in world space.
    pub s: DVec3,
    /// Local y in world space.
    pub t: DVec3,
    /// Local z in world space.
    pub n: DVec3,
}

impl Frame {
    /// A frame about the unit vector `n`.
    ///
    /// Duff et al. 2017, "Building an Orthonormal Basis, Revisited", listing 3.
    #[must_use]
    pub fn from_normal(n: DVec3) -> Frame {
        let sign = 1.0f64.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Frame {
            s: DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: DVec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// The axes of the world turned by the least angle that takes z to the unit vector `n`: where `n` turns, the frame follows it
    /// without a jump, but for `n` = −z, where [`Frame::from_normal`] jumps all along z = 0.
    #[must_use]
    pub fn by_least_turn(n: DVec3) -> Frame {
        let across = n.x * n.x + n.y * n.y;
        if n.z < 0.0 && across < f64::MIN_POSITIVE {
            return Frame::from_normal(n);
        }
        // 1/(1 + z), without a difference: (1 + z)(1 − z) = x² + y².
        let a = if n.z < 0.0 { (1.0 - n.z) / across } else { 1.0 / (1.0 + n.z) };
        let b = -n.x * n.y * a;
        Frame { s: DVec3::new(1.0 - n.x * n.x * a, b, -n.x), t: DVec3::new(b, 1.0 - n.y * n.y * a, -n.y), n }
    }

    /// A frame about the unit vector `n` whose `s` lies as near to `tangent` as it can.
    /// Falls back to [`Frame::from_normal`] where `tangent` is parallel to `n` or zero.
    #[must_use]
    pub fn from_normal_and_tangent(n: DVec3, tangent: DVec3) -> Frame {
        let across = |v: DVec3| v - n * n.dot(v);
        let mut s = across(tangent);
        // What is left of a tangent nearly parallel to n is rounding, along n as well as across: it is taken across n once
        // more, and if hardly anything stays it says nothing (Daniel et al. 1976: twice is enough).
        if s.length_squared() < NEARLY_PARALLEL * tangent.length_squared() {
            let again = across(s);
            s = if again.length_squared() < 0.25 * s.length_squared() { DVec3::ZERO } else { again };
        }
        match s.try_normalize() {
            Some(s) => Frame { s, t: n.cross(s), n },
            None => Frame::from_normal(n),
        }
    }

    /// World to local.
    #[must_use]
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Local to world.
    #[must_use]
    pub fn to_world(&self, v: DVec3) -> DVec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

/// Square of the sine, 2⁻²⁰, below which a tangent is projected twice: the first leaves 2⁻³² of itself along n there.
const NEARLY_PARALLEL: f64 = 1.0 / (1u64 << 40) as f64;

#[cfg(test)]
mod tests {
    use super::*;

    /// Tangents that are parallel to n but for rounding, of any size: frames stay orthonormal to 1e-9, which is 2⁻³² and
    /// room. Projected once, frames came out that lengthened directions by a tenth.
    #[test]
    fn a_tangent_along_the_normal_leaves_a_frame() {
        let mut worst = 0f64;
        for i in 0..20_000u32 {
            let turn = |k: u32| f64::from(i.wrapping_mul(k) % 9973) / 9973.0 * 2.0 - 1.0;
            let Some(n) = DVec3::new(turn(7919), turn(104_729), turn(1_299_709)).try_normalize() else { continue };
            let size = libm::exp2(f64::from(i % 81) - 40.0);
            let off = libm::exp2(-f64::from(i % 61)) * DVec3::new(turn(31), turn(37), turn(41));
            let off = if i % 3 == 0 { DVec3::ZERO } else { off };
            let Frame { s, t, n } = Frame::from_normal_and_tangent(n, (n * (1.0 + 1e-16) + off) * size);
            for (found, expected) in
                [(s.dot(n), 0.0), (t.dot(n), 0.0), (s.dot(t), 0.0), (s.length(), 1.0), (t.length(), 1.0)]
            {
                worst = worst.max((found - expected).abs());
            }
        }
        assert!(worst < 1e-9, "{worst}");
    }

    #[test]
    fn frames_are_orthonormal_and_right_handed_for_every_normal() {
        for i in 0..2000u32 {
            let z = 1.0 - 2.0 * f64::from(i) / 1999.0;
            let phi = 2.399_963 * f64::from(i);
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = DVec3::new(r * phi.cos(), r * phi.sin(), z).normalize();
            for f in [Frame::from_normal(n), Frame::by_least_turn(n)] {
                // Each entry is a handful of roundings of numbers of size one.
                let tolerance = 8.0 * f64::EPSILON;
                assert!(f.s.dot(f.t).abs() <= tolerance && f.s.dot(n).abs() <= tolerance);
                assert!((f.s.length() - 1.0).abs() <= tolerance && (f.t.length() - 1.0).abs() <= tolerance);
                assert!((f.s.cross(f.t) - n).length() <= tolerance);
            }
        }
    }

    /// A turn by θ that follows n twists by (1 − cos θ) dφ beside: a step of n moves s by no more than 1 + tan(θ/2) of it, which at
    /// z = 0 is 2.
    #[test]
    fn frames_by_the_least_turn_follow_the_normal_without_a_jump() {
        for i in 0..100u32 {
            let (sin, cos) = libm::sincos(f64::from(i));
            let [above, below] = [1e-6, -1e-6].map(|z| DVec3::new(cos, sin, z).normalize());
            let step = (above - below).length();
            for (a, b) in [(above, below), (DVec3::new(cos, sin, 0.0), DVec3::new(cos, sin, -0.0))] {
                let moved = (Frame::by_least_turn(a).s - Frame::by_least_turn(b).s).length();
                assert!(moved <= 2.1 * step, "{a} {b}: {moved} for {step}");
            }
        }
    }
}
