//! A piece of a linear curve: the space that a ball sweeps while it moves along a straight line and its
//! radius changes evenly, which is the convex hull of the two balls at the ends.
//!
//! With the axis c(v) = p₀ + v a, the radius r(v) = r₀ − v ρ and w = p − p₀, a point p lies in the ball of v
//! where |w − v a|² ≤ r(v)². The least of |w − v a|² − r(v)² is at v = (w·a − ρ r₀)/D with D = |a|² − ρ²; there
//! it is |w|² − r₀² − (w·a − ρ r₀)²/D, whose zero is the wall: a cone that touches both balls.
//!
//! **Entry.** Where a ray enters the ball of v is a convex function of v, as all (v, t) with the point at t in
//! the ball of v are a convex set. So the ray enters the whole at the v of the wall, or where that is beyond an
//! end, at the ball of that end: one decision, hence no gap between wall and ball.
//!
//! **Accuracy.** The quadratic of the wall is solved about a point near the hit: once from the middle of the axis,
//! then again from the ball of the first answer. The second time all lengths are of the size of the radius, and
//! 1/thinness of the piece does not multiply the rounding.

use glam::DVec3;

/// A hull of two balls.
#[derive(Clone, Copy, Debug)]
pub struct RoundCone {
    /// Centre at v = 0.
    pub start: DVec3,
    /// From there to the centre at v = 1.
    pub axis: DVec3,
    /// Radius at v = 0.
    pub radius: f64,
    /// Radius at v = 0 less that at v = 1.
    pub taper: f64,
    /// Whether the ball at v = 0 is that at v = 1 of the piece before.
    pub joined: bool,
}

impl RoundCone {
    /// The centre at `v`.
    #[inline]
    pub fn center(&self, v: f64) -> DVec3 {
        self.start + self.axis * v
    }

    /// The radius at `v`.
    #[inline]
    pub fn radius(&self, v: f64) -> f64 {
        self.radius - v * self.taper
    }

    /// The box of the balls from one v to the other.
    pub fn bounds(&self, from: f64, to: f64) -> (DVec3, DVec3) {
        let ([p, q], [r, s]) = ([from, to].map(|v| self.center(v)), [from, to].map(|v| self.radius(v)));
        ((p - r).min(q - s), (p + r).max(q + s))
    }

    /// D above; not positive where one ball holds the other.
    #[inline]
    fn spread(&self) -> f64 {
        self.axis.length_squared() - self.taper * self.taper
    }

    /// The v of the ball that `p` is deepest in, or on whose surface it lies if it is on the wall or a cap.
    pub fn v_at(&self, p: DVec3) -> f64 {
        let d = self.spread();
        if d > 0.0 {
            (((p - self.start).dot(self.axis) - self.taper * self.radius) / d).clamp(0.0, 1.0)
        } else {
            self.larger_end()
        }
    }

    /// Whether `p` lies inside, by more than `slack`.
    pub fn holds(&self, p: DVec3, slack: f64) -> bool {
        let v = self.v_at(p);
        (p - self.center(v)).length() + slack < self.radius(v)
    }

    fn larger_end(&self) -> f64 {
        if self.taper >= 0.0 { 0.0 } else { 1.0 }
    }

    /// Where the line o + t d, with d of unit length, enters, and at which v; t may be negative.
    pub fn entry(&self, o: DVec3, d: DVec3) -> Option<(f64, f64)> {
        let spread = self.spread();
        if spread <= 0.0 {
            return self.ball(self.larger_end(), o, d);
        }
        let (a, k) = (self.axis, self.taper);
        let axis_cross = a.cross(d);
        let along = a.dot(d);
        let quadratic = axis_cross.length_squared() - k * k;
        if quadratic <= 0.0 && k * along >= 0.0 {
            // Along the inside of the cone towards its point, or along a cylinder: by the end.
            return self.ball(if along > 0.0 { 0.0 } else { 1.0 }, o, d);
        }

        let mut v = 0.5;
        let mut t = (self.center(v) - o).dot(d);
        for last in [false, true] {
            let (w, r) = (o - self.center(v) + d * t, self.radius(v));
            let w_cross = a.cross(w);
            let (wa, wd) = (w.dot(a), w.dot(d));
            // D·(the zero of the wall) as A τ² + 2 B τ + C, with a·b − … written as cross products.
            let b = w_cross.dot(axis_cross) - k * k * wd + k * r * along;
            let c =
                w_cross.length_squared() - k * k * w.length_squared() - r * r * a.length_squared() + 2.0 * k * r * wa;
            let discriminant = b * b - quadratic * c;
            if discriminant < 0.0 && last {
                return None;
            }
            let root = discriminant.max(0.0).sqrt();
            // A line that passes the wall is nearest to it there: c / −b is as far off as b is small.
            let tau = match discriminant > 0.0 {
                true if b > 0.0 => -(b + root) / quadratic,
                true => c / (root - b),
                false => -b / quadratic,
            };
            let next = v + (wa - k * r + tau * along) / spread;
            if next.is_nan() {
                return None;
            }
            if last && !(0.0..=1.0).contains(&next) {
                return self.ball(next.clamp(0.0, 1.0), o, d);
            }
            v = next.clamp(0.0, 1.0);
            // Beyond an end the ball there is the better place to look from.
            t = if v == next { t + tau } else { (self.center(v) - o).dot(d) };
        }
        Some((t, v))
    }

    /// Where the line enters the ball of `v`.
    fn ball(&self, v: f64, o: DVec3, d: DVec3) -> Option<(f64, f64)> {
        let (w, r) = (self.center(v) - o, self.radius(v));
        let t = w.dot(d);
        let off = w - d * t;
        let squared = r * r - off.length_squared();
        (squared >= 0.0).then(|| (t - squared.sqrt(), v))
    }
}
