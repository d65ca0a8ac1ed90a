//! The stretch of a ray inside a convex solid, as an intersection of intervals.
//!
//! A solid is the intersection of a slab and a wall (cylinder, cone) or of slabs (cube), and so is
//! the stretch of a ray inside it. Built this way a ray cannot slip through a rim, an edge or an
//! apex: each ray has either no crossing or one entry and one exit, whatever rounding does.

use super::ShapeHit;

/// The parameters where a ray enters and leaves, and by which faces.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    enter: f64,
    exit: f64,
    enter_face: u8,
    exit_face: u8,
}

/// A set of faces, one bit each.
pub type Faces = u8;

impl Span {
    /// The whole line.
    pub const LINE: Span =
        Span { enter: f64::NEG_INFINITY, exit: f64::INFINITY, enter_face: u8::MAX, exit_face: u8::MAX };

    /// Keeps what lies between `enter` and `exit`.
    #[inline]
    pub fn clip(&mut self, enter: f64, exit: f64, enter_face: u8, exit_face: u8) {
        if enter > self.enter {
            self.enter = enter;
            self.enter_face = enter_face;
        }
        if exit < self.exit {
            self.exit = exit;
            self.exit_face = exit_face;
        }
    }

    /// Keeps what lies in the slab `low` ≤ origin + t·direction ≤ `high` of one coordinate.
    /// False where the ray runs beside the slab.
    ///
    /// Divides rather than multiplies by a reciprocal: 0/d is 0 even where 1/d overflows.
    #[inline]
    #[must_use]
    pub fn clip_slab(
        &mut self,
        origin: f64,
        direction: f64,
        (low, high): (f64, f64),
        (face_low, face_high): (u8, u8),
    ) -> bool {
        if direction > 0.0 {
            self.clip((low - origin) / direction, (high - origin) / direction, face_low, face_high);
        } else if direction < 0.0 {
            self.clip((high - origin) / direction, (low - origin) / direction, face_high, face_low);
        } else {
            return low <= origin && origin <= high;
        }
        true
    }

    /// The first crossing of a face in `present` with 0 < t < `t_max`, where t = `shift` + parameter.
    #[inline]
    #[must_use]
    pub fn first(&self, present: Faces, shift: f64, t_max: f64) -> Option<ShapeHit> {
        if self.enter > self.exit {
            return None;
        }
        let enter = shift + self.enter;
        if enter > 0.0 && present >> self.enter_face & 1 == 1 {
            return (enter < t_max).then_some(ShapeHit { t: enter, face: self.enter_face });
        }
        let exit = shift + self.exit;
        (exit > 0.0 && exit < t_max && present >> self.exit_face & 1 == 1)
            .then_some(ShapeHit { t: exit, face: self.exit_face })
    }
}

/// Where a ray that starts on a convex solid and goes into it comes out again: the least of
/// several upper ends.
///
/// Such a ray has exactly one exit. Where rounding puts the exit at or behind the origin (a start
/// at a rim) the exit is at the least positive parameter, for the ray must not stay inside.
#[derive(Clone, Copy, Debug)]
pub struct Exit {
    t: f64,
    face: u8,
}

impl Exit {
    /// No end yet.
    pub const NEVER: Exit = Exit { t: f64::INFINITY, face: 0 };

    /// The exit by `face` at `t`, if it comes first.
    #[inline]
    pub fn clip(&mut self, t: f64, face: u8) {
        if t < self.t {
            *self = Exit { t, face };
        }
    }

    /// The exit from the slab `low` … `high` of one coordinate.
    #[inline]
    pub fn clip_slab(&mut self, origin: f64, direction: f64, (low, high): (f64, f64), (face_low, face_high): (u8, u8)) {
        if direction > 0.0 {
            self.clip((high - origin) / direction, face_high);
        } else if direction < 0.0 {
            self.clip((low - origin) / direction, face_low);
        }
    }

    /// The exit as a hit, if its face is in `present`.
    #[inline]
    #[must_use]
    pub fn hit(&self, present: Faces, t_max: f64) -> Option<ShapeHit> {
        let t = self.t.max(f64::MIN_POSITIVE);
        (t < t_max && present >> self.face & 1 == 1).then_some(ShapeHit { t, face: self.face })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ray in the face plane itself (origin on the plane, no motion across it) counts as inside
    /// the slab; -0.0 is no motion either.
    #[test]
    fn a_ray_along_a_face_plane_is_inside_the_slab() {
        for d in [0.0, -0.0] {
            assert!(Span::LINE.clone().clip_slab(1.0, d, (-1.0, 1.0), (0, 1)));
            assert!(!Span::LINE.clone().clip_slab(1.0f64.next_up(), d, (-1.0, 1.0), (0, 1)));
        }
    }

    /// 0 / 5e-324 = 0 while 0 · (1 / 5e-324) would be 0 · ∞ = NaN.
    #[test]
    fn the_slowest_crossing_gives_no_nan() {
        let mut span = Span::LINE;
        assert!(span.clip_slab(-1.0, 5e-324, (-1.0, 1.0), (0, 1)));
        assert_eq!(span.enter, 0.0);
        assert_eq!(span.exit, f64::INFINITY);
    }
}
