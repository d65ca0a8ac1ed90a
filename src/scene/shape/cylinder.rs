//! Cylinders, closed or open at either end.

use super::exact::{along, difference_of_products, dot, rows_times};
use super::plain::Plain;
use super::span::{Exit, Faces, Span};
use super::{
    AreaSample, BELOW_ONE, Detail, ShapeHit, SurfacePoint, check_direction, check_length, check_point, choose,
    in_words, largest, turns, turns_rate,
};
use crate::math::trig::sin_cos_turn;
use crate::math::warp::concentric_disk;
use crate::math::{Frame, Ray};
use glam::{DAffine3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

pub(super) const WALL: u8 = 0;
pub(super) const BASE: u8 = 1;
const TOP: u8 = 2;

/// A cylinder from `base` to `top`. Faces: wall 0, base cap 1, top cap 2.
///
/// Solved as slab ∩ wall in the frame where radius and height are one, where the wall's
/// discriminant is (1 − e)(1 + e) with e the distance of line and axis.
#[derive(Clone, Debug)]
pub struct Cylinder {
    base: DVec3,
    length: f64,
    radius: f64,
    /// n is the axis, from base to top.
    frame: Frame,
    /// −1 where u runs the other way about the axis, else 1.
    turn: f64,
    /// Rows that map p − base to the unit cylinder.
    rows: [DVec3; 3],
    present: Faces,
    scale: f64,
    /// Between which heights the wall is met, in lengths: 0 and 1 but for rounding at open ends.
    ends: (f64, f64),
    /// Between which heights points of the wall lie, as lengths.
    heights: (f64, f64),
}

impl Cylinder {
    pub(super) fn placement(&self) -> DAffine3 {
        let Frame { s, t, n } = self.frame;
        DAffine3::from_cols(s * self.radius, t * self.radius, n * self.length, self.base)
    }

    /// A cylinder; without a cap the end is open and the inside of the wall shows.
    ///
    /// # Errors
    /// In words: numbers not finite, radius not positive, base = top.
    pub fn new(base: DVec3, top: DVec3, radius: f64, cap_base: bool, cap_top: bool) -> Result<Cylinder, String> {
        check_point("base", base)?;
        check_point("top", top)?;
        check_length("radius", radius)?;
        let length = check_direction("top - base", top - base)?;
        let frame = Frame::by_least_turn((top - base) / length);
        let scale = largest(base).max(largest(top)).max(length).max(radius);
        // What closes an open end from without shares its rim but for a few roundings: the wall is longer by as much.
        // Points of it keep 64 steps of `Ray::leaving` from there, so that the step does not lead out.
        let pad = |capped: bool| if capped { 0.0 } else { 16.0 * f64::EPSILON * scale / length };
        let margin = |capped: bool| if capped { 0.0 } else { (4096.0 * f64::EPSILON * scale).min(0.25 * length) };
        Ok(Cylinder {
            base,
            length,
            radius,
            rows: [frame.s / radius, frame.t / radius, frame.n / length],
            frame,
            turn: 1.0,
            present: 1 << WALL | Faces::from(cap_base) << BASE | Faces::from(cap_top) << TOP,
            scale,
            ends: (-pad(cap_base), 1.0 + pad(cap_top)),
            heights: (margin(cap_base), length - margin(cap_top)),
        })
    }

    /// The cylinder with u = 0 in the half plane of the axis and `direction`, and u running the other way where it is
    /// `mirrored`.
    ///
    /// # Errors
    /// In words: a direction along the axis.
    pub fn with_seam(self, direction: DVec3, mirrored: bool) -> Result<Cylinder, String> {
        let frame = frame_at_seam(&self.frame, direction)?;
        let rows = [frame.s / self.radius, frame.t / self.radius, self.rows[2]];
        Ok(Cylinder { frame, rows, turn: if mirrored { -1.0 } else { 1.0 }, ..self })
    }

    /// See [`super::Shape::inset`].
    pub(super) fn inset(&self, by: f64) -> Option<Cylinder> {
        let Frame { s, t, n } = self.frame;
        let radius = super::less(self.radius, by)?;
        let length = super::less(self.length, 2.0 * by)?;
        Some(Cylinder {
            base: self.base + n * by,
            length,
            radius,
            rows: [s / radius, t / radius, n / length],
            heights: (0.0, length),
            ..self.clone()
        })
    }

    pub(super) fn plain(&self) -> Plain {
        let caps = [BASE, TOP].map(|face| (self.present >> face & 1 == 1).then_some(face));
        let rows = self.rows.map(|row| row.as_vec3());
        Plain::Turned { base: self.base.as_vec3(), rows, profile: [1.0, 0.0], caps }
    }

    #[inline]
    fn to_unit(&self, v: DVec3) -> DVec3 {
        rows_times(&self.rows, v)
    }

    #[inline]
    pub(super) fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u8>) -> Option<ShapeHit> {
        let oc = ray.origin - self.base;
        let d = self.to_unit(ray.direction);
        if let Some(face) = departing {
            return self.leave(self.to_unit(oc), d, t_max, face);
        }
        // Move along the ray to near the cylinder, each coordinate rounded once: the new start is
        // on the line to within rounding of the cylinder's own size, however far the origin was.
        let shift = -dot(oc, ray.direction);
        let o = self.to_unit(along(oc, ray.direction, shift));

        let mut span = Span::LINE;
        if !span.clip_slab(o.z, d.z, self.ends, (BASE, TOP)) {
            return None;
        }
        match Chord::of(o, d) {
            Some(chord) => {
                if chord.discriminant < 0.0 {
                    return None;
                }
                let half = chord.half();
                span.clip(chord.middle - half, chord.middle + half, WALL, WALL);
            }
            None if o.x * o.x + o.y * o.y > 1.0 => return None,
            None => {}
        }
        span.first(self.present, shift, t_max)
    }

    /// The exit of a ray that starts on `face` and goes in. The solid is convex: a ray that goes out
    /// does not come back.
    #[inline]
    fn leave(&self, o: DVec3, d: DVec3, t_max: f64, face: u8) -> Option<ShapeHit> {
        let mut exit = Exit::NEVER;
        if face == WALL {
            // The root at the origin is known to be zero; the other is −2B/A.
            let b = o.x.mul_add(d.x, o.y * d.y);
            if b >= 0.0 {
                return None;
            }
            exit.clip(-2.0 * b / d.x.mul_add(d.x, d.y * d.y), WALL);
        } else {
            let goes_in = if face == BASE { d.z > 0.0 } else { d.z < 0.0 };
            if !goes_in {
                return None;
            }
            if let Some(chord) = Chord::of(o, d) {
                exit.clip(chord.middle + chord.half(), WALL);
            }
        }
        exit.clip_slab(o.z, d.z, self.ends, (BASE, TOP));
        exit.hit(self.present, t_max)
    }

    /// Point, normal and the rest at a place on the wall; `outward` is the unit radial vector.
    fn wall_point(&self, outward: DVec3, height: f64) -> DVec3 {
        self.base + (self.frame.n * height + outward * self.radius)
    }

    /// As [`super::Shape::uv_rates`].
    pub(super) fn uv_rates(&self, point: DVec3, face: u8, direction: DVec3) -> DVec2 {
        let d = self.frame.to_local(direction);
        if face != WALL {
            let side = if face == BASE { -1.0 } else { 1.0 };
            return DVec2::new(d.x, d.y * side * self.turn) * (0.5 / self.radius);
        }
        let local = self.frame.to_local(point - self.base);
        DVec2::new(self.turn * turns_rate(local.x, local.y, d.x, d.y), d.z / self.length)
    }

    pub(super) fn surface(&self, point: DVec3, face: u8, detail: Detail) -> SurfacePoint {
        let local = self.frame.to_local(point - self.base);
        if face != WALL {
            let (height, side) = if face == BASE { (0.0, -1.0) } else { (self.length, 1.0) };
            let Cylinder { frame, turn, base, radius, .. } = self;
            let cap = Cap { frame, turn: *turn, base: *base, height, side, radius: *radius };
            return cap.surface(local, self.scale);
        }
        let normal = (self.frame.s * local.x + self.frame.t * local.y).normalize_or(self.frame.s);
        let height = local.z.clamp(self.heights.0, self.heights.1);
        SurfacePoint {
            point: self.wall_point(normal, height),
            scale: self.scale,
            normal,
            shading_normal: normal,
            uv: detail.uv(|| DVec2::new(turns(local.x, self.turn * local.y), (height / self.length).min(BELOW_ONE))),
            tangent: self.frame.n.cross(normal) * self.turn,
        }
    }

    pub(super) fn curvatures(&self, face: u8) -> [f64; 2] {
        if face == WALL { [1.0 / self.radius, 0.0] } else { [0.0; 2] }
    }

    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let top = self.base + self.frame.n * self.length;
        let half = disk_extent(&self.frame, self.radius);
        (self.base.min(top) - half, self.base.max(top) + half)
    }

    pub(super) fn is_closed(&self) -> bool {
        self.present == 1 << WALL | 1 << BASE | 1 << TOP
    }

    /// The whole surface.
    fn whole(&self) -> Part {
        let cap = PI * self.radius * self.radius;
        let present = |face: u8| if self.present >> face & 1 == 1 { cap } else { 0.0 };
        Part { middle: 0.0, turns: 1.0, wall: TAU * self.radius * self.length, caps: [present(BASE), present(TOP)] }
    }

    /// The part of a closed cylinder that faces a point outside it; else the whole surface.
    fn visible(&self, from: DVec3) -> Part {
        let whole = self.whole();
        if !self.is_closed() {
            return whole;
        }
        let local = self.frame.to_local(from - self.base);
        let distance = (local.x * local.x + local.y * local.y).sqrt();
        // The wall faces `from` within acos(r / distance) of its azimuth, at every height.
        let turns_seen = if distance > self.radius { libm::acos(self.radius / distance) / PI } else { 0.0 };
        let part = Part {
            middle: turns(local.x, local.y),
            turns: turns_seen,
            wall: whole.wall * turns_seen,
            caps: [
                if local.z < 0.0 { whole.caps[0] } else { 0.0 },
                if local.z > self.length { whole.caps[1] } else { 0.0 },
            ],
        };
        if part.area() > 0.0 { part } else { whole }
    }

    pub(super) fn area(&self) -> f64 {
        self.whole().area()
    }

    fn sample(&self, u: DVec2, part: &Part) -> AreaSample {
        let (which, x) = choose(u.x, &[part.wall, part.caps[0], part.caps[1]]);
        let pdf_area = 1.0 / part.area();
        if which != 0 {
            let (height, side) = if which == 1 { (0.0, -1.0) } else { (self.length, 1.0) };
            let disk = concentric_disk(DVec2::new(x, u.y)) * self.radius;
            let point = self.base + (self.frame.s * disk.x + self.frame.t * disk.y + self.frame.n * height);
            return AreaSample { point, normal: self.frame.n * side, face: which as u8, scale: self.scale, pdf_area };
        }
        let normal = part.outward(&self.frame, x);
        let point = self.wall_point(normal, u.y * self.length);
        AreaSample { point, normal, face: WALL, scale: self.scale, pdf_area }
    }

    pub(super) fn sample_area(&self, u: DVec2) -> AreaSample {
        self.sample(u, &self.whole())
    }

    pub(super) fn visible_area(&self, from: DVec3) -> f64 {
        self.visible(from).area()
    }

    pub(super) fn sample_visible(&self, from: DVec3, u: DVec2) -> AreaSample {
        self.sample(u, &self.visible(from))
    }
}

/// The chord of a line in the infinite unit cylinder.
struct Chord {
    /// Parameter of the point nearest to the axis.
    middle: f64,
    /// 1 − e², negative where the line passes outside.
    discriminant: f64,
    /// Length of the direction across the axis.
    across: f64,
}

impl Chord {
    /// `None` for a line along the axis: where the square of the sideways motion underflows,
    /// the line drifts less than 1e-150 radii a radius.
    #[inline]
    fn of(o: DVec3, d: DVec3) -> Option<Chord> {
        let w2 = d.x.mul_add(d.x, d.y * d.y);
        if w2 < f64::MIN_POSITIVE {
            return None;
        }
        let across = w2.sqrt();
        let e = difference_of_products(o.x, d.y, o.y, d.x) / across;
        Some(Chord { middle: -o.x.mul_add(d.x, o.y * d.y) / w2, discriminant: (1.0 - e) * (1.0 + e), across })
    }

    #[inline]
    fn half(&self) -> f64 {
        self.discriminant.max(0.0).sqrt() / self.across
    }
}

/// A part of a cylinder or cone: a range of azimuth of the wall, and caps.
pub(super) struct Part {
    /// Middle of the range, in turns.
    pub middle: f64,
    /// Width of the range, in turns.
    pub turns: f64,
    /// Area of the wall within the range.
    pub wall: f64,
    /// Areas of base and top cap.
    pub caps: [f64; 2],
}

impl Part {
    pub(super) fn area(&self) -> f64 {
        self.wall + self.caps[0] + self.caps[1]
    }

    /// The unit radial vector at fraction `x` of the range of azimuth.
    pub(super) fn outward(&self, frame: &Frame, x: f64) -> DVec3 {
        // In [−½, 2): two turns are folded back into [0, 1].
        let turn = self.middle + (x - 0.5) * self.turns;
        let (sin, cos) = sin_cos_turn(turn - turn.floor());
        frame.s * cos + frame.t * sin
    }
}

/// A frame of the same axis that begins in the half plane of `direction`.
///
/// # Errors
/// In words: a direction along the axis.
pub(super) fn frame_at_seam(frame: &Frame, direction: DVec3) -> Result<Frame, String> {
    let unit = direction / check_direction("seam", direction)?;
    let across = unit - frame.n * frame.n.dot(unit);
    // Both are rounded: an angle below 4 ε between them is none.
    if across.length() <= 4.0 * f64::EPSILON {
        return Err(format!("seam: expected a direction that is not along the axis, found {}", in_words(direction)));
    }
    Ok(Frame::from_normal_and_tangent(frame.n, unit))
}

/// Half extents of the box about a disk across the frame's n: r √(1 − nᵢ²), without cancellation.
pub(super) fn disk_extent(frame: &Frame, radius: f64) -> DVec3 {
    (frame.s * frame.s + frame.t * frame.t).map(f64::sqrt) * radius
}

/// A cap of a cylinder or cone.
pub(super) struct Cap<'a> {
    /// That of the shape: n is the axis.
    pub frame: &'a Frame,
    /// −1 where u of the shape runs the other way about the axis, else 1.
    pub turn: f64,
    pub base: DVec3,
    /// Where it lies along n from the base.
    pub height: f64,
    /// +1 where its normal is n, −1 where it is −n.
    pub side: f64,
    pub radius: f64,
}

impl Cap<'_> {
    /// Its point nearest to `local`, which counts from the base in the frame.
    pub(super) fn surface(&self, local: DVec3, scale: f64) -> SurfacePoint {
        let Cap { frame, turn, base, height, side, radius } = *self;
        // A hit at the rim may round to either side of it.
        let at = DVec2::new(local.x, local.y).clamp_length_max(radius);
        let normal = frame.n * side;
        SurfacePoint {
            point: base + (frame.s * at.x + frame.t * at.y + frame.n * height),
            scale,
            normal,
            shading_normal: normal,
            // Seen from outside: u to the right, v upward.
            uv: (DVec2::splat(0.5) + DVec2::new(at.x, at.y * side * turn) * (0.5 / radius))
                .clamp(DVec2::ZERO, DVec2::splat(BELOW_ONE)),
            tangent: frame.s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: f64 = f64::INFINITY;

    fn upright(cap_base: bool, cap_top: bool) -> Cylinder {
        Cylinder::new(DVec3::ZERO, DVec3::Z * 3.0, 1.0, cap_base, cap_top).unwrap()
    }

    /// Case O04: along the axis at r (1 ∓ 1e-6), also drifting sideways by 1e-20 a metre.
    #[test]
    fn a_ray_along_the_axis_enters_by_one_cap_and_leaves_by_the_other() {
        for drift in [0.0, 1e-20, 1e-200] {
            let ray = |x: f64| Ray::new(DVec3::new(x, 0.0, -2.0), DVec3::new(drift, 0.0, 1.0));
            let inside = ray(1.0 - 1e-6);
            let hit = upright(true, true).intersect(&inside, FAR, None).unwrap();
            assert_eq!(hit, ShapeHit { t: 2.0, face: BASE });
            let s = upright(true, true).surface(inside.at(hit.t), hit.face, Detail::Texture);
            assert_eq!((s.normal, s.point.z), (DVec3::NEG_Z, 0.0));
            let onward = Ray::new(s.point, inside.direction);
            let exit = upright(true, true).intersect(&onward, FAR, Some(BASE)).unwrap();
            assert_eq!(exit, ShapeHit { t: 3.0, face: TOP });
            assert_eq!(upright(true, true).intersect(&ray(1.0 + 1e-6), FAR, None), None);
        }
    }

    /// Case O13, from VisRTX issue 73: an orthographic view along the axis is the cap's disc.
    #[test]
    fn a_view_along_a_slanted_axis_is_a_disc_of_the_cap() {
        let base = DVec3::new(-30.005, -77.1061, -16.8721);
        let top = DVec3::new(-30.005, -27.301, 16.8721);
        let radius = 10.0;
        let cylinder = Cylinder::new(base, top, radius, true, true).unwrap();
        let view = DVec3::new(0.0, 0.827_878, 0.560_908).normalize();
        let frame = Frame::from_normal(view);
        // The view is along the axis to 1e-6, so over the length of 60 the disc's edge blurs by 6e-5.
        for i in 0..20_000u32 {
            let (sin, cos) = sin_cos_turn(f64::from(i % 1000) / 1000.0);
            let rho = radius * f64::from(i / 1000) / 9.97;
            let ray = Ray::new(base - view * 100.0 + (frame.s * cos + frame.t * sin) * rho, view);
            let hit = cylinder.intersect(&ray, FAR, None);
            if rho < radius - 1e-4 {
                assert_eq!(hit.map(|h| h.face), Some(BASE), "rho {rho}");
            } else if rho > radius + 1e-4 {
                assert_eq!(hit, None, "rho {rho}");
            }
        }
    }

    /// Looking into an open top from (0, 0, 4), 1 sideways for 2 down: through where the cap would be at
    /// (½, 0, 3), to the inside of the wall at (1, 0, 2), √5 away.
    #[test]
    fn the_inner_wall_shows_through_an_open_end() {
        let ray = Ray::new(DVec3::new(0.0, 0.0, 4.0), DVec3::new(1.0, 0.0, -2.0) / 5f64.sqrt());
        let closed = upright(true, true).intersect(&ray, FAR, None).unwrap();
        assert_eq!(closed.face, TOP);
        let open = upright(true, false).intersect(&ray, FAR, None).unwrap();
        assert_eq!(open.face, WALL);
        assert!((open.t - 5f64.sqrt()).abs() < 4.0 * f64::EPSILON, "{open:?}");
        let s = upright(true, false).surface(ray.at(open.t), WALL, Detail::Texture);
        assert!(s.normal.dot(ray.direction) > 0.0, "seen from inside: {}", s.normal);
    }

    #[test]
    fn an_open_tube_lets_light_through() {
        let ray = Ray::new(DVec3::new(0.5, 0.0, 9.0), DVec3::NEG_Z);
        assert_eq!(upright(false, false).intersect(&ray, FAR, None), None);
        assert_eq!(upright(true, false).intersect(&ray, FAR, None), Some(ShapeHit { t: 9.0, face: BASE }));
    }

    /// A wall normal has no part along the axis and a cap normal none across it.
    #[test]
    fn cap_normals_are_the_axis_and_wall_normals_are_across_it() {
        let c = Cylinder::new(DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 4.0, 5.0), 0.7, true, true).unwrap();
        let axis = DVec3::new(1.0, 2.0, 2.0) / 3.0;
        for i in 0..100u32 {
            let u = DVec2::new((f64::from(i) + 0.5) / 100.0, 0.37);
            let a = c.sample_area(u);
            let s = c.surface(a.point, a.face, Detail::Texture);
            let along = s.normal.dot(axis);
            let expected = match a.face {
                BASE => -1.0,
                TOP => 1.0,
                _ => 0.0,
            };
            assert!((along - expected).abs() < 8.0 * f64::EPSILON, "face {}: {along}", a.face);
        }
    }
}
