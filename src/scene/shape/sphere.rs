//! Spheres.
//!
//! # Texture coordinates
//! (x, y, z) = outward normal in the object frame, pole +y:
//!
//! u = ½ + atan2(x, z) / 2π, v = ½ + asin(y) / π, both in [0, 1).
//!
//! The middle of the picture faces +z, u grows to the right as seen from outside with +y up, v
//! grows upward from the south pole (v = 0, bottom of the picture) to the north pole. The seam is
//! at −z. A texture whose first row is the top of the picture is read at row (1 − v)·height.
//!
//! [`Layout::ZUp`] is the other usual convention, u' = φ/2π with φ = atan2(y, x) and v' = θ/π from the +z pole. [`Z_POLE`]
//! as the frame gives u = u' and v = 1 − v'.

use super::exact::{cross, dot};
use super::plain::Plain;
use super::{
    AreaSample, BELOW_ONE, Detail, Layout, ShapeHit, SurfacePoint, TowardSample, check_length, check_point, largest,
    solid_angle_density, toward_by_area, turns_rate,
};
use crate::math::warp::{uniform_cone, uniform_sphere};
use crate::math::{Frame, Ray};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// The frame in which texture coordinates have their pole at +z and u = φ/2π with φ from +x
/// towards +y: x, y, z of the object frame are −y, z, −x.
pub const Z_POLE: DMat3 = DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X);

/// How far from orthonormal a given frame may be: a rotation written with six digits.
const FRAME_TOLERANCE: f64 = 4e-6;

/// A sphere.
#[derive(Clone, Debug)]
pub struct Sphere {
    pub(super) center: DVec3,
    radius: f64,
    pub(super) radius_squared: f64,
    /// Rotation of the object frame, for texture coordinates only.
    world_from_object: DMat3,
    /// Whether v is counted from the pole at +y of that frame, not from the one at −y.
    from_north: bool,
}

impl Sphere {
    pub(super) fn placement(&self) -> DAffine3 {
        DAffine3::from_mat3_translation(self.world_from_object * self.radius, self.center)
    }

    /// A sphere; `world_from_object` turns its texture (see the module page).
    ///
    /// # Errors
    /// In words: centre not finite, radius not positive, frame not a rotation.
    pub fn new(center: DVec3, radius: f64, world_from_object: DMat3) -> Result<Sphere, String> {
        check_point("center", center)?;
        check_length("radius", radius)?;
        let error = world_from_object.transpose() * world_from_object - DMat3::IDENTITY;
        // A comparison with NaN is false, so a frame of NaN fails.
        if !error.to_cols_array().iter().all(|e| e.abs() <= FRAME_TOLERANCE) {
            return Err(format!("frame: expected a rotation, found {world_from_object}"));
        }
        let radius_squared = radius * radius;
        Ok(Sphere { center, radius, radius_squared, world_from_object, from_north: false })
    }

    /// See [`super::Shape::inset`].
    pub(super) fn inset(&self, by: f64) -> Option<Sphere> {
        let radius = super::less(self.radius, by)?;
        Some(Sphere { radius, radius_squared: radius * radius, ..self.clone() })
    }

    /// The sphere with its texture laid out so.
    #[must_use]
    pub fn with_layout(self, layout: Layout) -> Sphere {
        match layout {
            Layout::YUp => self,
            Layout::ZUp => Sphere { world_from_object: self.world_from_object * Z_POLE, from_north: true, ..self },
        }
    }

    /// Moment form: with m = oc × d the discriminant is r²d² − m², where m is exact to 1.5 ulp, so
    /// hit and miss do not depend on how far away the origin is.
    #[inline]
    pub(super) fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u8>) -> Option<ShapeHit> {
        let d = ray.direction;
        let oc = ray.origin - self.center;
        let a = dot(d, d);
        let b = dot(oc, d);
        let t = if departing.is_some() {
            // The root at the origin is known to be zero; the other is −2B/A.
            -2.0 * b / a
        } else {
            let m = cross(oc, d);
            let discriminant = self.radius_squared.mul_add(a, -dot(m, m));
            if discriminant < 0.0 {
                return None;
            }
            let half = discriminant.sqrt();
            let near = -b - half;
            (if near > 0.0 { near } else { half - b }) / a
        };
        (t > 0.0 && t < t_max).then_some(ShapeHit { t, face: 0 })
    }

    pub(super) fn plain(&self) -> Plain {
        Plain::Sphere { center: self.center.as_vec3(), radius: self.radius as f32 }
    }

    fn at_normal(&self, normal: DVec3) -> DVec3 {
        self.center + normal * self.radius
    }

    /// Largest number that goes into a point of the surface.
    fn scale(&self) -> f64 {
        largest(self.center).max(self.radius)
    }

    /// As [`super::Shape::uv_rates`].
    pub(super) fn uv_rates(&self, point: DVec3, direction: DVec3) -> DVec2 {
        let to_object = self.world_from_object.transpose();
        let n = to_object * (point - self.center).normalize_or(DVec3::Y);
        let d = to_object * direction / self.radius;
        // Of the latitude: y and its cosine turn into each other.
        let across = (n.x * n.x + n.z * n.z).sqrt();
        let latitude = (d.y * across - n.y * (n.x * d.x + n.z * d.z) / across) / PI;
        DVec2::new(turns_rate(n.z, n.x, d.z, d.x), if self.from_north { -latitude } else { latitude })
    }

    pub(super) fn surface(&self, point: DVec3, detail: Detail) -> SurfacePoint {
        let normal = (point - self.center).normalize_or(DVec3::Y);
        let n = self.world_from_object.transpose() * normal;
        let uv = || {
            let u = 0.5 + libm::atan2(n.x, n.z) / TAU;
            // asin(y) by its tangent: asin itself loses half the digits at the poles.
            let latitude = libm::atan2(n.y, (n.x * n.x + n.z * n.z).sqrt()) / PI;
            let v = if self.from_north { 0.5 - latitude } else { 0.5 + latitude };
            DVec2::new(if u >= 1.0 { 0.0 } else { u.min(BELOW_ONE) }, v.clamp(0.0, BELOW_ONE))
        };
        // East; at the poles every direction is, take the object frame's x.
        let east = DVec3::new(n.z, 0.0, -n.x);
        let east = if east == DVec3::ZERO { DVec3::X } else { east };
        SurfacePoint {
            point: self.at_normal(normal),
            scale: self.scale(),
            normal,
            shading_normal: normal,
            uv: detail.uv(uv),
            tangent: self.world_from_object * east,
        }
    }

    pub(super) fn curvatures(&self) -> [f64; 2] {
        [1.0 / self.radius; 2]
    }

    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        (self.center - self.radius, self.center + self.radius)
    }

    pub(super) fn area(&self) -> f64 {
        4.0 * PI * self.radius_squared
    }

    pub(super) fn sample_area(&self, u: DVec2) -> AreaSample {
        let normal = uniform_sphere(u);
        AreaSample { point: self.at_normal(normal), normal, face: 0, scale: self.scale(), pdf_area: 1.0 / self.area() }
    }

    /// The cone of directions from `from` to the sphere; `None` from inside or on it.
    ///
    /// With u = 2⁻⁵³ and S the largest of its numbers, a point of the surface is off it by less than 8uS: 2u from the length
    /// of its normal, and three coordinates of at most 2S with 2u each. The distance adds as much again at the most. What is
    /// nearer than four times that counts as on it, so that no wall sees its own lamp from the wrong side.
    fn cone(&self, from: DVec3) -> Option<Cap> {
        /// 2⁻⁴⁸.
        const ON: f64 = 16.0 * f64::EPSILON;
        let to_center = self.center - from;
        let distance = to_center.length();
        if distance - self.radius <= ON * self.scale() {
            return None;
        }
        let s = self.radius / distance;
        let power = (distance - self.radius) * (distance + self.radius);
        // 1 − cos θ_max = s² / (1 + cos θ_max): no cancellation for any s.
        let one_minus_cos = s * s / (1.0 + power.sqrt() / distance);
        Some(Cap { axis: to_center / distance, distance, power, one_minus_cos })
    }

    /// The sphere from `from` as one point; `None` from inside or on it.
    #[must_use]
    pub fn toward_middle(&self, from: DVec3) -> Option<Middle> {
        let cap = self.cone(from)?;
        let sine = self.radius / cap.distance;
        Some(Middle {
            direction: cap.axis,
            distance: cap.power / (cap.distance + self.radius),
            projected: PI * sine * sine,
        })
    }

    /// Uniform in solid angle from outside, uniform on the area from inside.
    pub(super) fn sample_toward(&self, from: DVec3, u: DVec2) -> Option<TowardSample> {
        let Some(cap) = self.cone(from) else {
            return toward_by_area(from, self.sample_area(u));
        };
        let Seen { frame, local, sine, side, half, distance } = self.seen(&cap, u);
        // From the middle to there, across the way and along it: without cancellation, however small the sphere.
        let across = DVec2::new(local.x, local.y) * distance;
        let along = -(side * sine + half * local.z);
        let normal = frame.to_world(DVec3::new(across.x, across.y, along)).normalize_or(-cap.axis);
        Some(TowardSample {
            direction: frame.to_world(local),
            distance,
            point: self.at_normal(normal),
            normal,
            face: 0,
            scale: self.scale(),
            pdf_solid_angle: cap.density(),
        })
    }

    /// Direction, distance and density in sr⁻¹ of [`super::Shape::sample_toward`] from outside; `None` from inside or on it.
    #[must_use]
    #[inline(always)]
    pub fn look_toward(&self, from: DVec3, u: DVec2) -> Option<(DVec3, f64, f64)> {
        let cap = self.cone(from)?;
        let seen = self.seen(&cap, u);
        Some((seen.frame.to_world(seen.local), seen.distance, cap.density()))
    }

    /// The point of the surface that is seen in a direction of the cone.
    #[inline(always)]
    fn seen(&self, cap: &Cap, u: DVec2) -> Seen {
        let local = uniform_cone(u, cap.one_minus_cos);
        // Near root of t² − 2 t d cos θ + (d² − r²) = 0 in the form without cancellation.
        let foot = cap.distance * local.z;
        let sine = (local.x * local.x + local.y * local.y).sqrt();
        let side = cap.distance * sine;
        let half = ((self.radius - side) * (self.radius + side)).max(0.0).sqrt();
        Seen { frame: Frame::from_normal(cap.axis), local, sine, side, half, distance: cap.power / (foot + half) }
    }

    pub(super) fn pdf_toward(&self, from: DVec3, direction: DVec3, hit_t: f64, hit_normal: DVec3) -> f64 {
        match self.cone(from) {
            Some(cap) => cap.density(),
            None => solid_angle_density(1.0 / self.area(), hit_t, direction.dot(hit_normal)),
        }
    }
}

/// A sphere as one point.
#[derive(Clone, Copy, Debug)]
pub struct Middle {
    /// To the middle, unit.
    pub direction: DVec3,
    /// To the nearest point.
    pub distance: f64,
    /// The solid angle by its cosines to `direction`, sr: what radiance is multiplied by for the irradiance across it.
    pub projected: f64,
}

/// What a sphere covers of the sky of a point outside it.
struct Cap {
    axis: DVec3,
    /// To the centre.
    distance: f64,
    /// Power of the point: d² − r².
    power: f64,
    one_minus_cos: f64,
}

impl Cap {
    /// Of a direction that is uniform in it, sr⁻¹.
    fn density(&self) -> f64 {
        1.0 / (TAU * self.one_minus_cos)
    }
}

/// A point of a sphere as it is seen from outside.
struct Seen {
    /// About the way to the centre.
    frame: Frame,
    /// The direction to the point in that frame.
    local: DVec3,
    /// Sine of the angle between the ways to the point and to the centre.
    sine: f64,
    /// How far from the centre the line to the point passes.
    side: f64,
    /// Along that line from where it is nearest to the centre to the surface.
    half: f64,
    distance: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    /// A look at an even ball is the look at any, to the bit; from inside and on it there is none.
    #[test]
    fn looks_go_where_samples_lie() {
        let sphere = Sphere::new(DVec3::new(1.0, -2.0, 0.5), 0.75, DMat3::IDENTITY).unwrap();
        for k in 0..64 {
            let u = DVec2::new(f64::from(k) / 64.0, (f64::from(k) * 0.618).fract());
            for from in [DVec3::ZERO, DVec3::new(1.0, -1.24, 0.5), DVec3::splat(1e6)] {
                let seen = sphere.sample_toward(from, u).unwrap();
                assert_eq!(sphere.look_toward(from, u), Some((seen.direction, seen.distance, seen.pdf_solid_angle)));
            }
            assert_eq!(sphere.look_toward(sphere.center, u), None);
            assert_eq!(sphere.look_toward(sphere.at_normal(DVec3::X), u), None);
        }
    }

    /// Points that are seen lie on the side that is seen and in their direction, however small the sphere is beside its distance.
    #[test]
    fn what_is_seen_of_a_small_sphere_faces_who_sees_it() {
        let center = DVec3::new(2e5, -3e5, 6e5);
        for radius in [1e5, 1.0, 1e-6, 1e-11, 1e-15] {
            let sphere = Sphere::new(center, radius, DMat3::IDENTITY).unwrap();
            for k in 0..64 {
                let u = DVec2::new((f64::from(k) + 0.5) / 64.0, (f64::from(k) * 0.618).fract());
                let seen = sphere.sample_toward(DVec3::ZERO, u).unwrap();
                // cos² at the surface is one less (d sin θ / r)², and sin² θ goes evenly to (r/d)² but for a part in (r/d)².
                let cos = -seen.direction.dot(seen.normal);
                assert!(cos > 0.0, "{radius}: {cos}");
                let (d, sine) = (center.length(), seen.direction.cross(center / center.length()).length());
                if radius > 1e-6 * d {
                    assert!((cos * cos - (1.0 - (d * sine / radius).powi(2))).abs() < 1e-6, "{radius}: {cos}");
                    assert!((seen.point - seen.direction * seen.distance).length() < 1e-9 * d, "{radius}");
                }
                assert!((seen.normal.length() - 1.0).abs() < 4.0 * f64::EPSILON);
            }
        }
    }
}
