//! Rays that remember what they left, so that no surface needs an epsilon.

use glam::DVec3;

/// The surface that a ray starts on: an object of the scene and one of its parts.
///
/// An intersector that is asked about the departing face itself answers with the *other*
/// root (quadrics) or with none (flat faces), because the root at the origin is known to be
/// zero exactly. No distance threshold is involved; see `scene::shape`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Departure {
    /// Index of the object in the scene.
    pub object: u32,
    /// Face of a shape (wall, cap, side of a cube; 0 where there is only one), or triangle of a mesh.
    pub part: u32,
    /// Index of the instance that `object` belongs to, where it is a child of one.
    pub instance: Option<u32>,
}

impl Departure {
    /// A part of an object that stands for itself.
    #[must_use]
    pub fn new(object: u32, part: u32) -> Departure {
        Departure { object, part, instance: None }
    }
}

/// A half line. `direction` has unit length to within rounding, so distances along the ray
/// are metres (scene units).
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Where it goes; unit length.
    pub direction: DVec3,
    /// The surface it starts on, if any.
    pub departure: Option<Departure>,
}

/// Relative length of the step off a surface along its normal that clears *other* primitives
/// which touch it: 2⁻⁴⁶ of the largest coordinate or length that went into the hit point. Hit
/// points are exact to a few 2⁻⁵² of it, so the step is some 16 times the error, and still
/// 2²² times finer than an f32.
pub const NEIGHBOUR_STEP: f64 = 1.0 / (1u64 << 46) as f64;

impl Ray {
    /// A ray from free space.
    #[must_use]
    pub fn new(origin: DVec3, direction: DVec3) -> Ray {
        Ray { origin, direction, departure: None }
    }

    /// A ray that leaves `departure` at `point`; `normal` is the geometric normal there, on
    /// either side, and `scale` the largest coordinate or length that went into `point`.
    #[must_use]
    pub fn leaving(point: DVec3, scale: f64, normal: DVec3, direction: DVec3, departure: Departure) -> Ray {
        let step = scale * NEIGHBOUR_STEP;
        let side = if direction.dot(normal) < 0.0 { -step } else { step };
        Ray { origin: point + normal * side, direction, departure: Some(departure) }
    }

    /// The point at distance `t`.
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaving_steps_to_the_side_the_ray_goes() {
        let departure = Departure::new(3, 1);
        let p = DVec3::new(4.0, -8.0, 1.0);
        let up = Ray::leaving(p, 8.0, DVec3::Y, DVec3::Y, departure);
        let down = Ray::leaving(p, 8.0, DVec3::Y, -DVec3::Y, departure);
        assert_eq!(up.origin.y - p.y, 8.0 * NEIGHBOUR_STEP);
        assert_eq!(down.origin.y - p.y, -8.0 * NEIGHBOUR_STEP);
        assert_eq!(up.departure, Some(departure));
    }
}
