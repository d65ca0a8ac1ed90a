//! Analytic shapes.
//!
//! # Rays and faces
//! A shape answers with the nearest hit with 0 < t < `t_max` and the face it is on. There is no
//! epsilon: a ray that starts on a shape says on which face (`departing`), and the root at its
//! origin, known to be zero, is left out by algebra. A flat face skips itself; on a sphere the
//! other root is −2B/A; a convex solid lets a ray that goes out never come back, and gives a ray
//! that goes in exactly one exit. [`Ray::leaving`] steps 2⁻⁴⁶ off the surface for the sake of
//! *other* primitives. Directions need not have unit length, though accuracy far from the shape
//! (distances beyond 1e3 sizes) wants it; t counts in lengths of the direction.
//!
//! # Normals
//! Outward on spheres, cubes, walls and caps, never turned towards the ray: the caller decides
//! what is inside from the sign of normal · direction. A cone's side has one outward normal on
//! each generator, a cap has the axis. Planes, disks and rectangles have the normal they were given,
//! or edge u × edge v.
//!
//! # Texture coordinates
//! | shape | u | v |
//! |---|---|---|
//! | sphere | longitude, see [`sphere`] | latitude, 0 at the south pole |
//! | plane | along the tangent, unbounded | along normal × tangent, unbounded |
//! | rectangle | along `edge_u` | along `edge_v` |
//! | disk | distance from the centre, 0 … 1 | angle from `edge_u` towards `edge_v`, in turns |
//! | cube | to the right of each face seen from outside | upward: +y on the sides, −z on the top (+y), +z on the bottom |
//! | cylinder, cone | angle about the axis, in turns | 0 at the base … 1 at the top |
//! | caps | ½ + x/2r | ½ + y/2r, seen from outside |
//!
//! v = 0 is the bottom of a picture throughout. Angles in turns and the sphere's u, v lie in [0, 1)
//! and stay below one when rounded to f32.

#[cfg(test)]
mod checks;
mod cone;
mod cube;
mod cylinder;
pub mod exact;
mod flat;
pub mod four;
#[cfg(test)]
mod light_tests;
pub mod plain;
#[cfg(test)]
mod reference;
#[cfg(test)]
mod reference_tests;
mod span;
pub mod sphere;
#[cfg(test)]
mod sweeps;
#[cfg(test)]
pub(super) mod testing;

use crate::error::in_short;
use crate::math::{LENGTHS, Ray};
use glam::{DAffine3, DVec2, DVec3};

pub use cone::Cone;
pub use cube::Cube;
pub use cylinder::Cylinder;
pub use flat::{Disk, Plane, Rectangle};
pub use sphere::Sphere;

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter.
    pub t: f64,
    /// Which face of the shape.
    pub face: u8,
}

/// What is wanted of a surface: texture coordinates cost an arc tangent or two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Point and normal; the rest may be anything that is finite.
    Boundary,
    /// Point, normal and tangent; the texture coordinates are zero where they are not free.
    Geometry,
    /// All.
    Texture,
}

/// How texture coordinates lie on a sphere or a cube.
///
/// | face of a cube, `ZUp` | −x | +x | −y | +y | −z | +z |
/// |---|---|---|---|---|---|---|
/// | u grows along | +y | +y | +z | −x | −y | +y |
/// | v grows along | +z | −z | +x | −z | +x | +x |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// As the table of the module says.
    YUp,
    /// On a sphere u = φ/2π, φ from +x towards +y, and v = θ/π from +z; on a cube as above.
    ZUp,
}

impl Detail {
    #[inline]
    fn uv(self, uv: impl FnOnce() -> DVec2) -> DVec2 {
        match self {
            Detail::Boundary | Detail::Geometry => DVec2::ZERO,
            Detail::Texture => uv(),
        }
    }
}

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// On the surface to within a few roundings of `scale`.
    pub point: DVec3,
    /// The largest coordinate or length that went into `point`, for [`Ray::leaving`].
    pub scale: f64,
    /// Geometric normal, unit, outward.
    pub normal: DVec3,
    /// The same: analytic shapes are as smooth as they look.
    pub shading_normal: DVec3,
    /// Texture coordinates.
    pub uv: DVec2,
    /// Direction of ∂p/∂u; not zero, not of unit length. Where u has no direction (a pole, the
    /// middle of a disk) one is chosen.
    pub tangent: DVec3,
}

/// A point of a surface, drawn by area.
#[derive(Clone, Copy, Debug)]
pub struct AreaSample {
    /// The point.
    pub point: DVec3,
    /// Its outward unit normal.
    pub normal: DVec3,
    /// Its face.
    pub face: u8,
    /// As in [`SurfacePoint::scale`].
    pub scale: f64,
    /// Density in m⁻²; 0 for a plane, which has no uniform density.
    pub pdf_area: f64,
}

/// Insets are at most this part of half a body's thickness: it covers, or absorbs along a way through it, a thousandth less, a
/// quarter of a step of 8-bit pictures. Bodies are put apart by 2⁻⁴² of their coordinates, so what is thinner than 2⁻³¹ of
/// these has no room.
const INSET: f64 = 1.0 / (1u64 << 10) as f64;

/// `length` less `by`, where that is a small part of it.
fn less(length: f64, by: f64) -> Option<f64> {
    (by.abs() <= INSET * length).then_some(length - by)
}

/// A point of a surface, drawn to be looked at from another point.
#[derive(Clone, Copy, Debug)]
pub struct TowardSample {
    /// From the other point to `point`; unit length.
    pub direction: DVec3,
    /// From the other point to `point`.
    pub distance: f64,
    /// The point.
    pub point: DVec3,
    /// Its outward unit normal.
    pub normal: DVec3,
    /// Its face.
    pub face: u8,
    /// As in [`SurfacePoint::scale`].
    pub scale: f64,
    /// Density in sr⁻¹; positive and finite.
    pub pdf_solid_angle: f64,
}

/// An analytic shape.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A sphere; one face.
    Sphere(Sphere),
    /// An infinite plane; one face.
    Plane(Plane),
    /// A disk or ellipse; one face.
    Disk(Disk),
    /// A rectangle or parallelogram; one face.
    Rectangle(Rectangle),
    /// A cube, box or parallelepiped; faces −x, +x, −y, +y, −z, +z are 0 … 5.
    Cube(Cube),
    /// A cylinder, capped or open at either end; wall 0, base 1, top 2.
    Cylinder(Cylinder),
    /// A cone, capped or open; side 0, base 1.
    Cone(Cone),
}

/// The same expression for every kind of shape.
macro_rules! each {
    ($shape:expr, $s:ident => $body:expr) => {
        match $shape {
            Shape::Sphere($s) => $body,
            Shape::Plane($s) => $body,
            Shape::Disk($s) => $body,
            Shape::Rectangle($s) => $body,
            Shape::Cube($s) => $body,
            Shape::Cylinder($s) => $body,
            Shape::Cone($s) => $body,
        }
    };
}

impl Shape {
    /// How the form lies in the world: from a frame in which it is of unit size, so that what changes place, size or
    /// turning keeps the coordinates of its points.
    #[must_use]
    pub fn placement(&self) -> DAffine3 {
        each!(self, s => s.placement())
    }

    /// The nearest hit with 0 < t < `t_max`, from inside or outside. `departing` is the face of
    /// this very shape that the ray starts on.
    #[inline]
    #[must_use]
    pub fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u8>) -> Option<ShapeHit> {
        if cfg!(feature = "single_precision") {
            return plain::instead(self, ray, t_max);
        }
        each!(self, s => s.intersect(ray, t_max, departing))
    }

    /// The point of `face` nearest to `point_on_ray` (`ray.at(t)`), and what is there.
    ///
    /// The point is on the surface to a few roundings; how far along the surface it may be off is
    /// set by the rounding of `ray.at(t)`.
    #[must_use]
    pub fn surface(&self, point_on_ray: DVec3, face: u8) -> SurfacePoint {
        self.surface_with(point_on_ray, face, Detail::Texture)
    }

    /// [`Shape::surface`] with as much as is asked for.
    #[inline]
    #[must_use]
    pub fn surface_with(&self, point_on_ray: DVec3, face: u8, detail: Detail) -> SurfacePoint {
        match self {
            Shape::Sphere(s) => s.surface(point_on_ray, detail),
            Shape::Plane(s) => s.surface(point_on_ray),
            Shape::Disk(s) => s.surface(point_on_ray, detail),
            Shape::Rectangle(s) => s.surface(point_on_ray),
            Shape::Cube(s) => s.surface(point_on_ray, face),
            Shape::Cylinder(s) => s.surface(point_on_ray, face, detail),
            Shape::Cone(s) => s.surface(point_on_ray, face, detail),
        }
    }

    /// How fast u and v change at `point` of `face` along a `direction` in the surface, times its length. No numbers where u has no
    /// direction: at a pole, the middle of a disk, the apex of a cone.
    #[must_use]
    pub fn uv_rates(&self, point: DVec3, face: u8, direction: DVec3) -> DVec2 {
        match self {
            Shape::Sphere(s) => s.uv_rates(point, direction),
            Shape::Plane(s) => s.uv_rates(direction),
            Shape::Disk(s) => s.uv_rates(point, direction),
            Shape::Rectangle(s) => s.uv_rates(direction),
            Shape::Cube(s) => s.uv_rates(face, direction),
            Shape::Cylinder(s) => s.uv_rates(point, face, direction),
            Shape::Cone(s) => s.uv_rates(point, face, direction),
        }
    }

    /// Least and greatest corner of a box that holds every point that [`Shape::surface`] gives;
    /// `None` for a plane.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let (low, high) = match self {
            Shape::Plane(_) => return None,
            Shape::Sphere(s) => s.bounds(),
            Shape::Disk(s) => s.bounds(),
            Shape::Rectangle(s) => s.bounds(),
            Shape::Cube(s) => s.bounds(),
            Shape::Cylinder(s) => s.bounds(),
            Shape::Cone(s) => s.bounds(),
        };
        // Surface points are within 8 roundings of the exact surface, the box within 4.
        let pad = 16.0 * f64::EPSILON * largest(low).max(largest(high));
        Some((low - pad, high + pad))
    }

    /// Area in m²; infinite for a plane.
    #[must_use]
    pub fn area(&self) -> f64 {
        each!(self, s => s.area())
    }

    /// Whether the surface bounds a solid: every ray that enters also leaves.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        match self {
            Shape::Sphere(_) | Shape::Cube(_) => true,
            Shape::Plane(_) | Shape::Disk(_) | Shape::Rectangle(_) => false,
            Shape::Cylinder(s) => s.is_closed(),
            Shape::Cone(s) => s.is_closed(),
        }
    }

    /// A closed shape whose faces lie `by` metres further in, or out where that is negative; `None` where that is more than a
    /// small part of its size.
    #[must_use]
    pub fn inset(&self, by: f64) -> Option<Shape> {
        match self {
            Shape::Sphere(s) => s.inset(by).map(Shape::Sphere),
            Shape::Cube(s) => s.inset(by).map(Shape::Cube),
            Shape::Cylinder(s) if s.is_closed() => s.inset(by).map(Shape::Cylinder),
            Shape::Cone(s) if s.is_closed() => s.inset(by).map(Shape::Cone),
            Shape::Cylinder(_) | Shape::Cone(_) | Shape::Plane(_) | Shape::Disk(_) | Shape::Rectangle(_) => None,
        }
    }

    /// A point uniform on the area, caps and all. A plane gives its own point with density 0.
    #[must_use]
    pub fn sample_area(&self, u: DVec2) -> AreaSample {
        each!(self, s => s.sample_area(u))
    }

    /// A direction from `from` to a point of the shape: uniform in solid angle for a sphere seen
    /// from outside, uniform on the part of the area that faces `from` for other closed shapes
    /// seen from outside, uniform on the area otherwise. `None` for a plane, and where the point
    /// is edge-on or at `from` itself.
    #[must_use]
    pub fn sample_toward(&self, from: DVec3, u: DVec2) -> Option<TowardSample> {
        match self {
            Shape::Sphere(s) => s.sample_toward(from, u),
            Shape::Plane(_) => None,
            Shape::Disk(s) => toward_by_area(from, s.sample_area(u)),
            Shape::Rectangle(s) => s.sample_toward(from, u),
            Shape::Cube(s) => toward_by_area(from, s.sample_visible(from, u)),
            Shape::Cylinder(s) => toward_by_area(from, s.sample_visible(from, u)),
            Shape::Cone(s) => toward_by_area(from, s.sample_visible(from, u)),
        }
    }

    /// A direction from `from` to a point of the whole area, uniform on it: for a shape that shines inward, whose
    /// outer face says nothing about what is seen. `None` as for [`Shape::sample_toward`].
    #[must_use]
    pub fn sample_inward(&self, from: DVec3, u: DVec2) -> Option<TowardSample> {
        match self {
            Shape::Plane(_) => None,
            other => toward_by_area(from, other.sample_area(u)),
        }
    }

    /// The principal curvatures of `face` at `point`, m⁻¹: positive where the surface bends away from its normal.
    #[must_use]
    pub fn curvatures(&self, point: DVec3, face: u8) -> [f64; 2] {
        match self {
            Shape::Sphere(s) => s.curvatures(),
            Shape::Cylinder(s) => s.curvatures(face),
            Shape::Cone(s) => s.curvatures(point, face),
            Shape::Plane(_) | Shape::Disk(_) | Shape::Rectangle(_) | Shape::Cube(_) => [0.0; 2],
        }
    }

    /// Whether two points lie on the same side of the axis of a cone, if `face` is its side; true of anything else.
    #[must_use]
    pub fn share_azimuth(&self, a: DVec3, b: DVec3, face: u8) -> bool {
        match self {
            Shape::Cone(s) => s.share_azimuth(a, b, face),
            _ => true,
        }
    }

    /// The density in sr⁻¹ with which [`Shape::sample_toward`] makes the unit `direction` by the
    /// point that a ray from `from` meets at distance `hit_t`, where the normal is `hit_normal`
    /// (on either side). 0 edge-on, where `sample_toward` gives nothing.
    #[must_use]
    pub fn pdf_toward(&self, from: DVec3, direction: DVec3, hit_t: f64, hit_normal: DVec3) -> f64 {
        let area = match self {
            Shape::Sphere(s) => return s.pdf_toward(from, direction, hit_t, hit_normal),
            Shape::Plane(_) => return 0.0,
            Shape::Disk(s) => s.area(),
            Shape::Rectangle(s) => s.area(),
            Shape::Cube(s) => s.visible_area(from),
            Shape::Cylinder(s) => s.visible_area(from),
            Shape::Cone(s) => s.visible_area(from),
        };
        solid_angle_density(1.0 / area, hit_t, direction.dot(hit_normal))
    }
}

/// The largest f32 below one: texture coordinates stay below one in either precision.
const BELOW_ONE: f64 = 1.0 - 1.0 / (1u64 << 24) as f64;

/// The largest coordinate, as a length.
#[inline]
fn largest(v: DVec3) -> f64 {
    v.abs().max_element()
}

/// Turns (one turn = 1) of the angle from x to y, in [0, 1).
pub(super) fn turns(x: f64, y: f64) -> f64 {
    let t = libm::atan2(y, x) / std::f64::consts::TAU;
    // −1e-30 + 1 rounds to one.
    (if t < 0.0 { t + 1.0 } else { t }).clamp(0.0, BELOW_ONE)
}

/// How fast [`turns`] change at (x, y) along (dx, dy).
pub(super) fn turns_rate(x: f64, y: f64, dx: f64, dy: f64) -> f64 {
    (x * dy - y * dx) / ((x * x + y * y) * std::f64::consts::TAU)
}

/// A density by area as one by solid angle, pdf · d² / |cos|; 0 where that has no finite value (edge-on).
fn solid_angle_density(pdf_area: f64, distance: f64, cos: f64) -> f64 {
    let pdf = pdf_area * distance * distance / cos.abs();
    if pdf.is_finite() { pdf } else { 0.0 }
}

/// An area sample as seen from `from`.
#[inline(always)]
fn toward_by_area(from: DVec3, sample: AreaSample) -> Option<TowardSample> {
    let offset = sample.point - from;
    let distance = offset.length();
    if distance == 0.0 {
        return None;
    }
    let direction = offset / distance;
    let pdf_solid_angle = sample.pdf_area * distance * distance / direction.dot(sample.normal).abs();
    let AreaSample { point, normal, face, scale, .. } = sample;
    (pdf_solid_angle > 0.0 && pdf_solid_angle.is_finite()).then_some(TowardSample {
        direction,
        distance,
        point,
        normal,
        face,
        scale,
        pdf_solid_angle,
    })
}

/// Chooses one of several parts in proportion to its `areas` (not all zero) by `u` in [0, 1);
/// returns its index and `u` stretched over [0, 1) anew.
fn choose(mut u: f64, areas: &[f64]) -> (usize, f64) {
    u *= areas.iter().sum::<f64>();
    let mut last = 0;
    for (i, &area) in areas.iter().enumerate().filter(|(_, area)| **area > 0.0) {
        if u < area {
            return (i, u / area);
        }
        u -= area;
        last = i;
    }
    // The sum rounded up past the parts.
    (last, BELOW_ONE)
}

/// A vector for the end of "expected …, found …".
fn in_words(v: DVec3) -> String {
    format!("[{}]", v.to_array().map(in_short).join(", "))
}

/// Errors unless `value` is a length that a shape can have.
fn check_length(name: &str, value: f64) -> Result<(), String> {
    if LENGTHS.contains(&value) {
        Ok(())
    } else {
        Err(format!("{name}: expected a positive length from 1e-60 to 1e60, found {}", in_short(value)))
    }
}

/// Errors unless `value` is a point that a shape can be at.
fn check_point(name: &str, value: DVec3) -> Result<(), String> {
    if value.abs().cmple(DVec3::splat(*LENGTHS.end())).all() {
        Ok(())
    } else {
        Err(format!("{name}: expected three numbers up to 1e60, found {}", in_words(value)))
    }
}

/// Errors unless `value` is a vector with a direction; returns its length.
fn check_direction(name: &str, value: DVec3) -> Result<f64, String> {
    check_point(name, value)?;
    let length = value.length();
    if LENGTHS.contains(&length) {
        Ok(length)
    } else {
        Err(format!("{name}: expected a vector of length from 1e-60 to 1e60, found {}", in_words(value)))
    }
}

#[cfg(test)]
mod tests {
    use super::testing::all_shapes;
    use super::*;
    use glam::DMat3;

    #[test]
    fn bad_input_is_refused_in_words() {
        let (o, x, y, z) = (DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z);
        let nan = DVec3::new(0.0, f64::NAN, 0.0);
        let mirror_of_nothing = DMat3::from_cols(x, x, z);
        let faults = [
            (Sphere::new(o, 0.0, DMat3::IDENTITY).err(), "radius"),
            (Sphere::new(o, -1.0, DMat3::IDENTITY).err(), "radius"),
            (Sphere::new(o, f64::NAN, DMat3::IDENTITY).err(), "radius"),
            (Sphere::new(o, f64::INFINITY, DMat3::IDENTITY).err(), "radius"),
            (Sphere::new(nan, 1.0, DMat3::IDENTITY).err(), "center"),
            (Sphere::new(o, 1.0, mirror_of_nothing).err(), "frame"),
            (Sphere::new(o, 1.0, DMat3::NAN).err(), "frame"),
            (Plane::new(o, o, x).err(), "normal"),
            (Plane::new(o, y, nan).err(), "tangent"),
            (Plane::new(o, y, y).err(), "tangent"),
            (Disk::new(o, x, x * 2.0).err(), "edges"),
            (Disk::new(nan, x, y).err(), "center"),
            (Rectangle::new(o, x, o).err(), "edge_v"),
            (Rectangle::new(o, nan, y).err(), "edge_u"),
            (Rectangle::new(o, DVec3::new(1.0, 3.0, 7.0), DVec3::new(0.1, 0.3, 0.7)).err(), "edges"),
            (Cube::new(o, [x, y, x + y]).err(), "edges"),
            (Cube::new(o, [x, nan, z]).err(), "edge"),
            (Cylinder::new(o, o, 1.0, true, true).err(), "top"),
            (Cylinder::new(o, y, 0.0, true, true).err(), "radius"),
            (Cone::new(y, y, 1.0, true).err(), "apex"),
            (Cone::new(o, y, f64::NAN, true).err(), "radius"),
        ];
        for (i, (fault, word)) in faults.into_iter().enumerate() {
            let message = fault.unwrap_or_else(|| panic!("fault {i} was accepted"));
            assert!(message.contains(word), "fault {i}: {message}");
        }
    }

    /// The sum over the parts of area × share is kept by construction; here only the stretched
    /// number must stay below one and empty parts must not be chosen.
    #[test]
    fn choose_skips_empty_parts_and_stays_below_one() {
        for i in 0..=1000u32 {
            let u = (f64::from(i) / 1000.0).min(1.0f64.next_down());
            let (part, v) = choose(u, &[0.0, 1.0, 0.0, 3.0, 0.0]);
            assert!((0.0..1.0).contains(&v));
            assert_eq!(part, if u < 0.25 { 1 } else { 3 });
        }
    }

    #[test]
    fn tangents_are_never_zero_and_lie_in_the_surface() {
        for shape in all_shapes() {
            for i in 0..32u32 {
                for j in 0..32u32 {
                    let u = DVec2::new(f64::from(i), f64::from(j)) / 31.0;
                    let a = shape.sample_area(u.min(DVec2::splat(BELOW_ONE)));
                    let s = shape.surface(a.point, a.face);
                    let cos = s.tangent.normalize().dot(s.normal);
                    // A handful of roundings of numbers of size one.
                    assert!(cos.abs() < 16.0 * f64::EPSILON, "{shape:?} {cos}");
                }
            }
        }
    }
}
