//! Cones, closed or open.

use super::cylinder::{BASE, Cap, Part, WALL, disk_extent, frame_at_seam};
use super::exact::{along, cone_form, cross, dot, rows_times};
use super::plain::Plain;
use super::span::{Exit, Faces, Span};
use super::{
    AreaSample, BELOW_ONE, Detail, ShapeHit, SurfacePoint, check_direction, check_length, check_point, choose, largest,
    turns, turns_rate,
};
use crate::math::warp::concentric_disk;
use crate::math::{Frame, Ray};
use glam::{DAffine3, DVec2, DVec3};
use std::f64::consts::PI;

/// A cone from `base` to `apex`. Faces: side 0, base cap 1.
///
/// Solved as slab ∩ side in the frame with the apex at the origin, z into the cone, where radius and
/// height are one: x² + y² ≤ z², 0 ≤ z ≤ 1. The slab keeps the mirror nappe out.
#[derive(Clone, Debug)]
pub struct Cone {
    base: DVec3,
    apex: DVec3,
    height: f64,
    radius: f64,
    /// Length of a generator.
    slant: f64,
    /// n is the axis, from base to apex.
    frame: Frame,
    /// −1 where u runs the other way about the axis, else 1.
    turn: f64,
    /// Rows that map p − apex to the unit cone.
    rows: [DVec3; 3],
    present: Faces,
    scale: f64,
    /// How far from the apex the side is met, and how far its points lie, in heights: 1 but for an open base; as in
    /// [`super::Cylinder`].
    end: f64,
    last: f64,
}

impl Cone {
    pub(super) fn placement(&self) -> DAffine3 {
        let Frame { s, t, n } = self.frame;
        DAffine3::from_cols(s * self.radius, t * self.radius, n * self.height, self.base)
    }

    /// A cone; without a cap the base is open and the inside of the side shows.
    ///
    /// # Errors
    /// In words: numbers not finite, radius not positive, base = apex.
    pub fn new(base: DVec3, apex: DVec3, radius: f64, cap: bool) -> Result<Cone, String> {
        check_point("base", base)?;
        check_point("apex", apex)?;
        check_length("radius", radius)?;
        let height = check_direction("apex - base", apex - base)?;
        let frame = Frame::by_least_turn((apex - base) / height);
        let scale = largest(base).max(largest(apex)).max(height).max(radius);
        let pad = |steps: f64| if cap { 0.0 } else { steps * f64::EPSILON * scale / height };
        Ok(Cone {
            base,
            apex,
            height,
            radius,
            slant: (radius * radius + height * height).sqrt(),
            rows: [frame.s / radius, frame.t / radius, -frame.n / height],
            frame,
            turn: 1.0,
            present: 1 << WALL | Faces::from(cap) << BASE,
            scale,
            end: 1.0 + pad(16.0),
            last: 1.0 - pad(4096.0).min(0.25),
        })
    }

    /// The cone with u = 0 in the half plane of the axis and `direction`, and u running the other way where it is `mirrored`.
    ///
    /// # Errors
    /// In words: a direction along the axis.
    pub fn with_seam(self, direction: DVec3, mirrored: bool) -> Result<Cone, String> {
        let frame = frame_at_seam(&self.frame, direction)?;
        let rows = [frame.s / self.radius, frame.t / self.radius, self.rows[2]];
        Ok(Cone { frame, rows, turn: if mirrored { -1.0 } else { 1.0 }, ..self })
    }

    /// See [`super::Shape::inset`].
    pub(super) fn inset(&self, by: f64) -> Option<Cone> {
        let Frame { s, t, n } = self.frame;
        // How far the apex comes down as the side moves in.
        let down = by * self.slant / self.radius;
        let height = super::less(self.height, by + down)?;
        let (base, radius) = (self.base + n * by, self.radius * (height / self.height));
        let slant = (radius * radius + height * height).sqrt();
        let rows = [s / radius, t / radius, -n / height];
        Some(Cone { base, apex: self.apex - n * down, height, radius, slant, rows, ..self.clone() })
    }

    pub(super) fn plain(&self) -> Plain {
        let caps = [None, (self.present >> BASE & 1 == 1).then_some(BASE)];
        let rows = self.rows.map(|row| row.as_vec3());
        Plain::Turned { base: self.apex.as_vec3(), rows, profile: [0.0, 1.0], caps }
    }

    #[inline]
    fn to_unit(&self, v: DVec3) -> DVec3 {
        rows_times(&self.rows, v)
    }

    #[inline]
    pub(super) fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u8>) -> Option<ShapeHit> {
        let oc = ray.origin - self.apex;
        let d = self.to_unit(ray.direction);
        if let Some(face) = departing {
            return self.leave(self.to_unit(oc), d, t_max, face);
        }
        // Move along the ray to near the apex, each coordinate rounded once: the new start is on
        // the line to within rounding of the cone's own size, however far the origin was.
        let shift = -dot(oc, ray.direction);
        let o = self.to_unit(along(oc, ray.direction, shift));

        let mut span = Span::LINE;
        // A hit on the apex plane is a hit of the apex, that is of the side.
        if !span.clip_slab(o.z, d.z, (0.0, self.end), (WALL, BASE)) {
            return None;
        }
        let (enter, exit) = Quadratic::of(o, d).inside(d.z)?;
        span.clip(enter, exit, WALL, WALL);
        span.first(self.present, shift, t_max)
    }

    /// The exit of a ray that starts on `face` and goes in. The solid is convex: a ray that goes out
    /// does not come back.
    #[inline]
    fn leave(&self, o: DVec3, d: DVec3, t_max: f64, face: u8) -> Option<ShapeHit> {
        let mut exit = Exit::NEVER;
        if face == WALL {
            // On the side z = ρ, so half the slope of x² + y² − z² is ρ times (normal · d). Both ρ and
            // the azimuth are read from x and y alone: the step that `Ray::leaving` took along the
            // normal does not change the sign.
            let rho = o.x.mul_add(o.x, o.y * o.y).sqrt();
            let b = o.x.mul_add(d.x, o.y.mul_add(d.y, -rho * d.z));
            if b >= 0.0 {
                return None;
            }
            // The root at the origin is known to be zero; the other is −2B/A, on the mirror nappe
            // where A < 0: then the ray leaves by the base.
            let a = cone_form(d, d);
            if a > 0.0 {
                exit.clip(-2.0 * b / a, WALL);
            }
        } else {
            if d.z >= 0.0 {
                return None;
            }
            if let Some((_, t)) = Quadratic::of(o, d).through().inside(d.z) {
                exit.clip(t, WALL);
            }
        }
        exit.clip_slab(o.z, d.z, (0.0, self.end), (WALL, BASE));
        exit.hit(self.present, t_max)
    }

    /// The outward unit normal of the side on the generator at the unit radial vector `outward`.
    fn side_normal(&self, outward: DVec3) -> DVec3 {
        (outward * self.height + self.frame.n * self.radius) / self.slant
    }

    /// The point on that generator a fraction `f` of the way from apex to base.
    fn side_point(&self, outward: DVec3, f: f64) -> DVec3 {
        self.apex + (outward * self.radius - self.frame.n * self.height) * f
    }

    /// As [`super::Shape::uv_rates`].
    pub(super) fn uv_rates(&self, point: DVec3, face: u8, direction: DVec3) -> DVec2 {
        let d = self.frame.to_local(direction);
        if face != WALL {
            return DVec2::new(d.x, -d.y * self.turn) * (0.5 / self.radius);
        }
        let local = self.frame.to_local(point - self.apex);
        let outward = (local.x * d.x + local.y * d.y) / (local.x * local.x + local.y * local.y).sqrt();
        // Of the foot of the perpendicular on the generator, which v counts from the base.
        let down = (outward * self.radius - d.z * self.height) / (self.slant * self.slant);
        DVec2::new(self.turn * turns_rate(local.x, local.y, d.x, d.y), -down)
    }

    pub(super) fn surface(&self, point: DVec3, face: u8, detail: Detail) -> SurfacePoint {
        if face != WALL {
            let local = self.frame.to_local(point - self.base);
            let Cone { frame, turn, base, radius, .. } = self;
            let cap = Cap { frame, turn: *turn, base: *base, height: 0.0, side: -1.0, radius: *radius };
            return cap.surface(local, self.scale);
        }
        let local = self.frame.to_local(point - self.apex);
        let rho = (local.x * local.x + local.y * local.y).sqrt();
        let outward = (self.frame.s * local.x + self.frame.t * local.y).normalize_or(self.frame.s);
        // Foot of the perpendicular on the generator.
        let f = (rho * self.radius - local.z * self.height) / (self.slant * self.slant);
        let f = f.clamp(0.0, self.last);
        let normal = self.side_normal(outward);
        SurfacePoint {
            point: self.side_point(outward, f),
            scale: self.scale,
            normal,
            shading_normal: normal,
            uv: detail.uv(|| DVec2::new(turns(local.x, self.turn * local.y), (1.0 - f).min(BELOW_ONE))),
            tangent: self.frame.n.cross(outward) * self.turn,
        }
    }

    pub(super) fn share_azimuth(&self, a: DVec3, b: DVec3, face: u8) -> bool {
        let radial = |p: DVec3| self.frame.to_local(p - self.apex).truncate();
        face != WALL || radial(a).dot(radial(b)) > 0.0
    }

    /// Along a generator none; across it cos α / ρ, with the half angle α at the apex and the distance
    /// ρ from the axis (Meusnier), which is h / r over the distance from the apex.
    pub(super) fn curvatures(&self, point: DVec3, face: u8) -> [f64; 2] {
        if face == WALL { [self.height / (self.radius * (point - self.apex).length()), 0.0] } else { [0.0; 2] }
    }

    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let half = disk_extent(&self.frame, self.radius);
        (self.apex.min(self.base - half), self.apex.max(self.base + half))
    }

    pub(super) fn is_closed(&self) -> bool {
        self.present >> BASE & 1 == 1
    }

    /// The whole surface.
    fn whole(&self) -> Part {
        let cap = if self.is_closed() { PI * self.radius * self.radius } else { 0.0 };
        Part { middle: 0.0, turns: 1.0, wall: PI * self.radius * self.slant, caps: [cap, 0.0] }
    }

    /// The part of a closed cone that faces a point outside it; else the whole surface.
    fn visible(&self, from: DVec3) -> Part {
        let whole = self.whole();
        if !self.is_closed() {
            return whole;
        }
        let local = self.frame.to_local(from - self.apex);
        let distance = (local.x * local.x + local.y * local.y).sqrt();
        // All planes that touch the side pass through the apex, so a generator faces `from` where
        // normal · (from − apex) = h·distance·cos φ + r·z > 0, φ counted from the azimuth of `from`.
        let (cos_part, constant) = (self.height * distance, self.radius * local.z);
        let turns_seen = if constant >= cos_part {
            1.0
        } else if constant <= -cos_part {
            0.0
        } else {
            libm::acos(-constant / cos_part) / PI
        };
        let part = Part {
            middle: turns(local.x, local.y),
            turns: turns_seen,
            wall: whole.wall * turns_seen,
            caps: [if local.z < -self.height { whole.caps[0] } else { 0.0 }, 0.0],
        };
        if part.area() > 0.0 { part } else { whole }
    }

    pub(super) fn area(&self) -> f64 {
        self.whole().area()
    }

    fn sample(&self, u: DVec2, part: &Part) -> AreaSample {
        let (which, x) = choose(u.x, &[part.wall, part.caps[0]]);
        let pdf_area = 1.0 / part.area();
        if which != 0 {
            let disk = concentric_disk(DVec2::new(x, u.y)) * self.radius;
            let point = self.base + (self.frame.s * disk.x + self.frame.t * disk.y);
            return AreaSample { point, normal: -self.frame.n, face: BASE, scale: self.scale, pdf_area };
        }
        let outward = part.outward(&self.frame, x);
        // The area between apex and fraction f of the generator grows as f².
        let point = self.side_point(outward, u.y.sqrt());
        AreaSample { point, normal: self.side_normal(outward), face: WALL, scale: self.scale, pdf_area }
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

/// A t² + 2 B t + C = x² + y² − z² along a line, and its discriminant.
struct Quadratic {
    a: f64,
    b: f64,
    c: f64,
    /// B² − A C = mx² + my² − mz² with the moment m = o × d, as a product without cancellation.
    discriminant: f64,
}

impl Quadratic {
    #[inline]
    fn of(o: DVec3, d: DVec3) -> Quadratic {
        let m = cross(o, d);
        let across = m.x.mul_add(m.x, m.y * m.y).sqrt();
        Quadratic {
            // −0.0 + 0.0 is +0.0: a ray parallel to a generator counts as shallow.
            a: cone_form(d, d) + 0.0,
            b: cone_form(o, d),
            c: cone_form(o, o),
            discriminant: (across - m.z.abs()) * (across + m.z.abs()),
        }
    }

    /// The same for a line that is known to pass through the inside: a negative discriminant is
    /// rounding.
    #[inline]
    fn through(self) -> Quadratic {
        Quadratic { discriminant: self.discriminant.max(0.0), ..self }
    }

    /// The stretch of the line inside the nappe that it is to be clipped to (z ≥ 0), given that the
    /// slab clips it too; `dz` is how fast z grows.
    #[inline]
    fn inside(&self, dz: f64) -> Option<(f64, f64)> {
        let Quadratic { a, b, c, discriminant } = *self;
        // A steep line (A < 0) crosses both nappes always: a negative discriminant is rounding.
        if discriminant < 0.0 && a >= 0.0 {
            return None;
        }
        let q = -(b + discriminant.max(0.0).sqrt().copysign(b));
        let (t0, t1) = if q != 0.0 {
            // With A = 0 the one is infinite, on the side where A → +0 puts it.
            (q / a, c / q)
        } else if a != 0.0 {
            // B = 0 and a double root: through the apex, or along it, at the origin.
            (0.0, 0.0)
        } else {
            // Parallel to a generator in its tangent plane: never inside.
            return None;
        };
        let (low, high) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
        Some(if a >= 0.0 {
            // Shallow: inside between the roots, both on one nappe; if that is the mirror nappe,
            // z < 0 there and the slab takes it away.
            (low, high)
        } else if dz > 0.0 {
            // Steep: in our nappe after the later root, in the mirror nappe before the earlier.
            (high, f64::INFINITY)
        } else {
            (f64::NEG_INFINITY, low)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: f64 = f64::INFINITY;

    /// Radius and height one, base at z = 0.
    fn unit() -> Cone {
        Cone::new(DVec3::ZERO, DVec3::Z, 1.0, true).unwrap()
    }

    /// Case O05: d parallel to a generator, A = 0. On the side x = −(1 − z): from (−1.5, 1.2) along
    /// (1, −1) by s, −1.5 + s = −(1 − 1.2 + s) gives s = 0.85; the base z = 0 is left at s = 1.2.
    #[test]
    fn a_ray_parallel_to_a_generator_is_solved() {
        let ray = Ray::new(DVec3::new(-1.5, 0.0, 1.2), DVec3::new(1.0, 0.0, -1.0) / 2f64.sqrt());
        let hit = unit().intersect(&ray, FAR, None).unwrap();
        assert_eq!(hit.face, WALL);
        assert!((hit.t - 0.85 * 2f64.sqrt()).abs() < 8.0 * f64::EPSILON, "{hit:?}");
        let s = unit().surface(ray.at(hit.t), hit.face, Detail::Texture);
        let exit = unit().intersect(&Ray::new(s.point, ray.direction), FAR, Some(WALL)).unwrap();
        assert_eq!(exit.face, BASE);
        assert!((hit.t + exit.t - 1.2 * 2f64.sqrt()).abs() < 8.0 * f64::EPSILON, "{exit:?}");
    }

    /// Case O06: at z = 1.5 the ray crosses only the mirror nappe.
    #[test]
    fn the_mirror_nappe_is_not_there() {
        let ray = Ray::new(DVec3::new(-2.0, 0.0, 1.5), DVec3::X);
        assert_eq!(unit().intersect(&ray, FAR, None), None);
        let steep = Ray::new(DVec3::new(0.0, 0.0, 5.0), DVec3::new(0.9, 0.0, -1.0).normalize());
        assert_eq!(unit().intersect(&steep, FAR, None), None);
    }

    /// Case O07: e below the apex the ray crosses a disc of radius e. At e = 0, anything but NaN.
    #[test]
    fn rays_at_the_apex_hit_below_it() {
        for e in [1e-7, 1e-12, 0.0] {
            let ray = Ray::new(DVec3::new(0.0, -5.0, 1.0 - e), DVec3::Y);
            match unit().intersect(&ray, FAR, None) {
                Some(hit) => assert!((hit.t - 5.0).abs() < 2e-7 && hit.face == WALL, "{hit:?}"),
                None => assert_eq!(e, 0.0),
            }
        }
    }

    /// The normal of the side leans towards the apex everywhere, on the far side of the axis too:
    /// for radius = height it is (radial + axis) / √2.
    #[test]
    fn side_normals_point_outward_on_both_sides_of_the_axis() {
        for x in [-1.0, 1.0] {
            let ray = Ray::new(DVec3::new(4.0 * x, 0.0, 0.25), DVec3::new(-x, 0.0, 0.0));
            let hit = unit().intersect(&ray, FAR, None).unwrap();
            let s = unit().surface(ray.at(hit.t), hit.face, Detail::Texture);
            let expected = DVec3::new(x, 0.0, 1.0) / 2f64.sqrt();
            assert!((s.normal - expected).length() < 4.0 * f64::EPSILON, "{}", s.normal);
            // Seen from inside the same point has the same normal, now along the ray.
            let out = Ray::new(DVec3::new(0.0, 0.0, 0.25), DVec3::new(x, 0.0, 0.0));
            let hit = unit().intersect(&out, FAR, None).unwrap();
            let s = unit().surface(out.at(hit.t), hit.face, Detail::Texture);
            assert!((s.normal - expected).length() < 4.0 * f64::EPSILON, "{}", s.normal);
        }
    }

    #[test]
    fn the_inside_shows_through_an_open_base() {
        let open = Cone::new(DVec3::ZERO, DVec3::Z, 1.0, false).unwrap();
        let ray = Ray::new(DVec3::new(0.5, 0.0, -1.0), DVec3::Z);
        assert_eq!(unit().intersect(&ray, FAR, None), Some(ShapeHit { t: 1.0, face: BASE }));
        let hit = open.intersect(&ray, FAR, None).unwrap();
        assert_eq!(hit.face, WALL);
        assert!((hit.t - 1.5).abs() < 4.0 * f64::EPSILON);
        assert!(open.surface(ray.at(hit.t), WALL, Detail::Texture).normal.dot(ray.direction) > 0.0);
    }
}
