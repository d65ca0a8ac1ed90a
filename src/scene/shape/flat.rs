//! Planes, disks and rectangles.

use super::exact::{along, dot};
use super::plain::Plain;
use super::{
    AreaSample, Detail, ShapeHit, SurfacePoint, TowardSample, check_direction, check_length, check_point, in_words,
    largest, toward_by_area, turns, turns_rate,
};
use crate::math::warp::concentric_disk;
use crate::math::{Frame, Ray};
use glam::{DAffine3, DVec2, DVec3};
use std::f64::consts::PI;

/// An infinite plane.
#[derive(Clone, Debug)]
pub struct Plane {
    pub(super) point: DVec3,
    /// Along u, along v, and the normal; left-handed where it is mirrored.
    pub(super) frame: Frame,
}

impl Plane {
    pub(super) fn placement(&self) -> DAffine3 {
        let Frame { s, t, n } = self.frame;
        DAffine3::from_cols(s, t, n, self.point)
    }

    /// How far `point` lies on the side of the normal, metres.
    #[must_use]
    pub fn height(&self, point: DVec3) -> f64 {
        (point - self.point).dot(self.frame.n)
    }

    /// A plane; u runs along `tangent` made perpendicular to `normal`. A zero `tangent` leaves
    /// the choice open.
    ///
    /// # Errors
    /// In words: point not finite, normal without direction, tangent not finite or along the normal.
    pub fn new(point: DVec3, normal: DVec3, tangent: DVec3) -> Result<Plane, String> {
        check_point("point", point)?;
        let normal = normal / check_direction("normal", normal)?;
        if tangent == DVec3::ZERO {
            return Ok(Plane { point, frame: Frame::by_least_turn(normal) });
        }
        let tangent = tangent / check_direction("tangent", tangent)?;
        // The cross product of parallel unit vectors is rounding error: below 4 ε it has no direction.
        if normal.cross(tangent).length() <= 4.0 * f64::EPSILON {
            return Err(format!(
                "tangent: expected a vector that is not along the normal, found {}",
                in_words(tangent)
            ));
        }
        Ok(Plane { point, frame: Frame::from_normal_and_tangent(normal, tangent) })
    }

    /// The same plane with v running the other way, as in a mirror.
    #[must_use]
    pub fn mirrored(mut self) -> Plane {
        self.frame.t = -self.frame.t;
        self
    }

    #[inline]
    pub(super) fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u8>) -> Option<ShapeHit> {
        let across = dot(ray.direction, self.frame.n);
        // Exactly parallel: no hit, also from within the plane.
        if departing.is_some() || across == 0.0 {
            return None;
        }
        let t = dot(self.point - ray.origin, self.frame.n) / across;
        (t > 0.0 && t < t_max).then_some(ShapeHit { t, face: 0 })
    }

    pub(super) fn plain(&self) -> Plain {
        Plain::Plane { point: self.point.as_vec3(), normal: self.frame.n.as_vec3() }
    }

    /// As [`super::Shape::uv_rates`].
    pub(super) fn uv_rates(&self, direction: DVec3) -> DVec2 {
        self.frame.to_local(direction).truncate()
    }

    pub(super) fn surface(&self, point: DVec3) -> SurfacePoint {
        let local = self.frame.to_local(point - self.point);
        let normal = self.frame.n;
        SurfacePoint {
            point: point - normal * local.z,
            scale: largest(point).max(largest(self.point)),
            normal,
            shading_normal: normal,
            uv: DVec2::new(local.x, local.y),
            tangent: self.frame.s,
        }
    }

    pub(super) fn area(&self) -> f64 {
        f64::INFINITY
    }

    pub(super) fn sample_area(&self, _u: DVec2) -> AreaSample {
        AreaSample { point: self.point, normal: self.frame.n, face: 0, scale: largest(self.point), pdf_area: 0.0 }
    }
}

/// A patch of a plane with two edge vectors: points origin + a·u + b·v.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    pub(super) origin: DVec3,
    u: DVec3,
    v: DVec3,
    pub(super) normal: DVec3,
    /// Dual vectors: a = `to_a` · (p − origin), b likewise.
    pub(super) to_a: DVec3,
    pub(super) to_b: DVec3,
    /// |u × v|.
    jacobian: f64,
    /// What a and b are off by where a neighbour shares the edge, see [`Patch::new`].
    pub(super) pad: DVec2,
    /// How near to the edge a surface point may be.
    margin: DVec2,
}

/// Coordinates on a patch, and how far along the ray.
struct PatchHit {
    t: f64,
    a: f64,
    b: f64,
}

impl Patch {
    pub(super) fn placement(&self) -> DAffine3 {
        DAffine3::from_cols(self.u, self.v, self.normal, self.origin)
    }

    fn new(place: &str, origin: DVec3, u: DVec3, v: DVec3) -> Result<Patch, String> {
        check_point(place, origin)?;
        let length_u = check_direction("edge_u", u)?;
        let length_v = check_direction("edge_v", v)?;
        let cross = super::exact::cross(u, v);
        let jacobian = cross.length();
        // The edges themselves are rounded: an angle below 4 ε between them is none.
        if jacobian <= 4.0 * f64::EPSILON * length_u * length_v {
            let [u, v] = [u, v].map(in_words);
            return Err(format!("edges: expected two vectors that are not parallel, found {u} and {v}"));
        }
        check_length("edges' area's root", jacobian.sqrt())?;
        let normal = cross / jacobian;
        let (to_a, to_b) = (v.cross(normal) / jacobian, normal.cross(u) / jacobian);
        // Corners that several patches share come out of the transforms of each off by a few roundings, and so does a ray
        // that is moved near to each. Patches are larger by as much, so that no ray passes between them.
        let scale = largest(origin).max(largest(u)).max(largest(v));
        let heights = DVec2::new(to_a.length(), to_b.length());
        let pad = heights * (16.0 * f64::EPSILON * scale);
        // The step off a surface, 64 ε of its scale, must not lead through the neighbour at the edge: points keep 64
        // steps from it, which is enough for wedges wider than a 64th.
        let margin = (heights * (4096.0 * f64::EPSILON * scale)).min(DVec2::splat(0.25));
        Ok(Patch { origin, u, v, normal, to_a, to_b, jacobian, pad, margin })
    }

    /// The same points and coordinates with the normal on the other side.
    fn turned(mut self) -> Patch {
        self.normal = -self.normal;
        self
    }

    /// Where the ray's line meets the plane of the patch. Moves along the ray to near the patch
    /// first (each coordinate rounded once, so the new start is on the line to within rounding
    /// of the patch's own size), then solves there: the edges are as sharp from far as from near.
    #[inline]
    fn meet(&self, ray: &Ray) -> Option<PatchHit> {
        let d = ray.direction;
        let across = dot(d, self.normal);
        // Exactly parallel: no hit, also from within the plane.
        if across == 0.0 {
            return None;
        }
        let oc = ray.origin - self.origin;
        let shift = -dot(oc, d);
        let near = along(oc, d, shift);
        let t = -dot(near, self.normal) / across;
        let a = t.mul_add(dot(d, self.to_a), dot(near, self.to_a));
        let b = t.mul_add(dot(d, self.to_b), dot(near, self.to_b));
        Some(PatchHit { t: shift + t, a, b })
    }

    fn plain(&self, round: bool) -> Plain {
        let duals = [self.to_a, self.to_b].map(|dual| dual.as_vec3());
        Plain::Patch { origin: self.origin.as_vec3(), normal: self.normal.as_vec3(), duals, round }
    }

    #[inline]
    fn coordinates(&self, point: DVec3) -> DVec2 {
        self.rates(point - self.origin)
    }

    /// How fast the coordinates change along `direction`.
    #[inline]
    fn rates(&self, direction: DVec3) -> DVec2 {
        DVec2::new(dot(direction, self.to_a), dot(direction, self.to_b))
    }

    /// The vector of coordinates `at`.
    #[inline]
    fn across(&self, at: DVec2) -> DVec3 {
        self.u * at.x + self.v * at.y
    }

    /// Surface point with texture coordinates and tangent left to the caller.
    #[inline]
    fn surface(&self, point: DVec3, uv: DVec2, tangent: DVec3) -> SurfacePoint {
        SurfacePoint {
            point: point - self.normal * dot(point - self.origin, self.normal),
            scale: largest(point).max(largest(self.origin)),
            normal: self.normal,
            shading_normal: self.normal,
            uv,
            tangent,
        }
    }

    #[inline(always)]
    fn sample(&self, at: DVec2, area: f64) -> AreaSample {
        let point = self.origin + self.across(at);
        let scale = largest(point).max(largest(self.origin));
        AreaSample { point, normal: self.normal, face: 0, scale, pdf_area: 1.0 / area }
    }
}

/// A disk, or an ellipse: centre + a·u + b·v with a² + b² ≤ 1.
#[derive(Clone, Debug)]
pub struct Disk(pub(super) Patch);

impl Disk {
    pub(super) fn placement(&self) -> DAffine3 {
        self.0.placement()
    }

    /// A disk whose rim passes through `center` ± `edge_u` and `center` ± `edge_v`; round if these
    /// are perpendicular and of equal length. Normal along `edge_u` × `edge_v`.
    ///
    /// # Errors
    /// In words: numbers not finite, an edge of length zero, parallel edges.
    pub fn new(center: DVec3, edge_u: DVec3, edge_v: DVec3) -> Result<Disk, String> {
        Patch::new("center", center, edge_u, edge_v).map(Disk)
    }

    /// The same disk with its normal against `edge_u` × `edge_v`: a mirror leaves the front in front, but not the cross product.
    #[must_use]
    pub fn mirrored(self) -> Disk {
        Disk(self.0.turned())
    }

    #[inline]
    pub(super) fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u8>) -> Option<ShapeHit> {
        if departing.is_some() {
            return None;
        }
        let PatchHit { t, a, b } = self.0.meet(ray)?;
        let rim = 1.0 + self.0.pad.max_element();
        (a * a + b * b <= rim * rim && t > 0.0 && t < t_max).then_some(ShapeHit { t, face: 0 })
    }

    pub(super) fn plain(&self) -> Plain {
        self.0.plain(true)
    }

    /// As [`super::Shape::uv_rates`].
    pub(super) fn uv_rates(&self, point: DVec3, direction: DVec3) -> DVec2 {
        let (at, d) = (self.0.coordinates(point), self.0.rates(direction));
        DVec2::new(at.dot(d) / at.length(), turns_rate(at.x, at.y, d.x, d.y))
    }

    pub(super) fn surface(&self, point: DVec3, detail: Detail) -> SurfacePoint {
        let mut at = self.0.coordinates(point);
        let (radius, most) = (at.length(), 1.0 - self.0.margin.max_element());
        let mut point = point;
        if radius > most {
            let inside = at * (most / radius);
            point += self.0.across(inside - at);
            at = inside;
        }
        let outward = self.0.u * at.x + self.0.v * at.y;
        let outward = if outward == DVec3::ZERO { self.0.u } else { outward };
        let uv = detail.uv(|| DVec2::new(at.length(), turns(at.x, at.y)));
        self.0.surface(point, uv, outward - self.0.normal * outward.dot(self.0.normal))
    }

    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        // max over the rim of a·u_i + b·v_i is hypot(u_i, v_i).
        let half = (self.0.u * self.0.u + self.0.v * self.0.v).map(f64::sqrt);
        (self.0.origin - half, self.0.origin + half)
    }

    pub(super) fn area(&self) -> f64 {
        PI * self.0.jacobian
    }

    pub(super) fn sample_area(&self, u: DVec2) -> AreaSample {
        self.0.sample(concentric_disk(u), self.area())
    }
}

/// A rectangle, or a parallelogram: corner + a·u + b·v with 0 ≤ a, b ≤ 1.
#[derive(Clone, Debug)]
pub struct Rectangle(pub(super) Patch);

impl Rectangle {
    pub(super) fn placement(&self) -> DAffine3 {
        self.0.placement()
    }

    /// A rectangle with `corner` at texture coordinates (0, 0). Normal along `edge_u` × `edge_v`.
    ///
    /// # Errors
    /// In words: numbers not finite, an edge of length zero, parallel edges.
    pub fn new(corner: DVec3, edge_u: DVec3, edge_v: DVec3) -> Result<Rectangle, String> {
        Patch::new("corner", corner, edge_u, edge_v).map(Rectangle)
    }

    /// As [`Disk::mirrored`].
    #[must_use]
    pub fn mirrored(self) -> Rectangle {
        Rectangle(self.0.turned())
    }

    #[inline]
    pub(super) fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u8>) -> Option<ShapeHit> {
        if departing.is_some() {
            return None;
        }
        let PatchHit { t, a, b } = self.0.meet(ray)?;
        let DVec2 { x, y } = self.0.pad;
        let inside = (-x..=1.0 + x).contains(&a) && (-y..=1.0 + y).contains(&b);
        (inside && t > 0.0 && t < t_max).then_some(ShapeHit { t, face: 0 })
    }

    pub(super) fn plain(&self) -> Plain {
        self.0.plain(false)
    }

    /// As [`super::Shape::uv_rates`].
    pub(super) fn uv_rates(&self, direction: DVec3) -> DVec2 {
        self.0.rates(direction)
    }

    #[inline]
    pub(super) fn surface(&self, point: DVec3) -> SurfacePoint {
        let at = self.0.coordinates(point);
        let uv = at.clamp(self.0.margin, 1.0 - self.0.margin);
        let point = if uv == at { point } else { point + self.0.across(uv - at) };
        self.0.surface(point, uv, self.0.u)
    }

    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let Patch { origin, u, v, .. } = self.0;
        let corners = [origin, origin + u, origin + v, origin + u + v];
        (
            corners.into_iter().reduce(DVec3::min).unwrap_or(origin),
            corners.into_iter().reduce(DVec3::max).unwrap_or(origin),
        )
    }

    /// As [`super::Shape::sample_toward`].
    #[inline(always)]
    #[must_use]
    pub fn sample_toward(&self, from: DVec3, u: DVec2) -> Option<TowardSample> {
        toward_by_area(from, self.sample_area(u))
    }

    #[inline]
    pub(super) fn area(&self) -> f64 {
        self.0.jacobian
    }

    #[inline(always)]
    pub(super) fn sample_area(&self, u: DVec2) -> AreaSample {
        self.0.sample(u, self.area())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Shape;
    use super::*;

    const FAR: f64 = f64::INFINITY;

    fn flat_shapes_at(z: f64) -> [Shape; 3] {
        let o = DVec3::new(0.0, 0.0, z);
        [
            Shape::Plane(Plane::new(o, DVec3::Z, DVec3::X).unwrap()),
            Shape::Disk(Disk::new(o, DVec3::X, DVec3::Y).unwrap()),
            Shape::Rectangle(Rectangle::new(o - DVec3::new(1.0, 1.0, 0.0), DVec3::X * 2.0, DVec3::Y * 2.0).unwrap()),
        ]
    }

    /// Case O08: d·n = 0, and −0.0, from beside the plane and from within it; and from within it
    /// across it, where the only root is zero.
    #[test]
    fn a_parallel_ray_misses_and_gives_no_nan() {
        for z in [0.0, 1.0] {
            for shape in flat_shapes_at(z) {
                for dz in [0.0, -0.0] {
                    for x in [-3.0, 0.0] {
                        let ray = Ray::new(DVec3::new(x, 0.0, 0.0), DVec3::new(1.0, 0.0, dz));
                        assert_eq!(shape.intersect(&ray, FAR, None), None);
                    }
                }
            }
        }
        for shape in flat_shapes_at(0.0) {
            assert_eq!(shape.intersect(&Ray::new(DVec3::ZERO, DVec3::Z), FAR, None), None);
        }
    }

    /// Slope 1 / 1e300 over a distance of one rises less than the least f64 above z = 1: the plane is
    /// met at 1e300, the bounded ones are missed.
    #[test]
    fn a_ray_that_hardly_descends_gives_no_nan() {
        let ray = Ray::new(DVec3::new(0.0, 0.0, 1.0), DVec3::new(1.0, 0.0, -1e-300));
        let [plane, disk, rectangle] = flat_shapes_at(0.0);
        let t = plane.intersect(&ray, FAR, None).unwrap().t;
        assert!((t - 1e300).abs() < 1e285, "{t}");
        assert_eq!(disk.intersect(&ray, FAR, None), None);
        assert_eq!(rectangle.intersect(&ray, FAR, None), None);
    }

    #[test]
    fn a_hit_lies_exactly_on_an_axis_parallel_plane() {
        for shape in flat_shapes_at(0.1) {
            let ray = Ray::new(DVec3::new(0.3, -7.0, 1e4), DVec3::new(0.0, 7.0, -1e4).normalize());
            let hit = shape.intersect(&ray, FAR, None).unwrap();
            assert_eq!(shape.surface(ray.at(hit.t), hit.face).point.z, 0.1);
            assert_eq!(shape.intersect(&ray, hit.t, None), None);
        }
    }

    /// From 1e6 sizes away the edge a = 1 is resolved to 1e-12: the line is moved near the
    /// patch before it is solved.
    #[test]
    fn edges_are_sharp_from_far_away() {
        let rectangle = Rectangle::new(DVec3::ZERO, DVec3::X, DVec3::Y).unwrap();
        for (x, hits) in [(1.0 - 1e-12, true), (1.0 + 1e-12, false), (1e-12, true), (-1e-12, false)] {
            let ray = Ray::new(DVec3::new(x, 0.5, 1e6), DVec3::NEG_Z);
            assert_eq!(rectangle.intersect(&ray, FAR, None).is_some(), hits, "{x}");
        }
    }

    /// What is met on an edge is moved inward along the rectangle, as far as the margin of its coordinates says: to 16 ε, some eight roundings
    /// of numbers up to 4.
    #[test]
    fn what_is_met_on_an_edge_lies_within_it() {
        let (u, v) = (DVec3::new(2.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 0.0));
        let rectangle = Rectangle::new(DVec3::Z, u, v).unwrap();
        let point = |at: DVec2| DVec3::Z + u * at.x + v * at.y;
        let (low, high) = (rectangle.0.margin, 1.0 - rectangle.0.margin);
        assert!(low.min_element() > 100.0 * f64::EPSILON);
        for [x, y] in [[0.0, 0.5], [1.0, 0.5], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0], [0.3, 0.4]] {
            let at = DVec2::new(x, y);
            let within = at.clamp(low, high);
            let s = rectangle.surface(point(at));
            assert!((s.uv - within).length() < 16.0 * f64::EPSILON, "{at}: {}", s.uv - within);
            assert!((s.point - point(within)).length() < 16.0 * f64::EPSILON, "{at}: {}", s.point - point(within));
        }
    }

    /// Coordinates are affine: centre + 0.3 u + 0.4 v has radius 0.5 whatever u and v are.
    #[test]
    fn texture_coordinates_of_skewed_shapes_are_affine() {
        let (u, v) = (DVec3::new(2.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 0.0));
        let disk = Disk::new(DVec3::Z, u, v).unwrap();
        let s = disk.surface(DVec3::Z + u * 0.3 + v * 0.4, Detail::Texture);
        assert!((s.uv - DVec2::new(0.5, libm::atan2(0.4, 0.3) / (2.0 * PI))).length() < 1e-15, "{}", s.uv);
        let rectangle = Rectangle::new(DVec3::Z, u, v).unwrap();
        let s = rectangle.surface(DVec3::Z + u * 0.3 + v * 0.4);
        assert!((s.uv - DVec2::new(0.3, 0.4)).length() < 1e-15, "{}", s.uv);
        assert_eq!(s.normal, DVec3::Z);
        assert_eq!(disk.bounds().1.y, 4.0 - 1.0);
    }
}
