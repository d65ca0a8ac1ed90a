//! What the tests of this module share, with those of `tests/numerics/sweep`, which compile this file too.

use crate::math::Frame;
use crate::math::warp::uniform_sphere;
use crate::scene::shape::{Cone, Cube, Cylinder, Disk, Plane, Rectangle, Shape, Sphere};
use glam::{DMat3, DVec2, DVec3};

/// A small generator (splitmix64) with a fixed seed.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        Random(seed)
    }

    /// In [0, 1), 53 bits.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn pair(&mut self) -> DVec2 {
        DVec2::new(self.uniform(), self.uniform())
    }

    /// From `low` to `high`.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// 10^x with x uniform from `low` to `high`.
    pub fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(self.range(low, high))
    }

    pub fn direction(&mut self) -> DVec3 {
        let u = self.pair();
        uniform_sphere(u)
    }

    /// A rotation.
    pub fn rotation(&mut self) -> DMat3 {
        let n = self.direction();
        let tangent = self.direction();
        let f = Frame::from_normal_and_tangent(n, tangent);
        DMat3::from_cols(f.s, f.t, f.n)
    }
}

/// How many kinds [`random_shape`] makes; the first four are closed.
pub const KINDS: usize = 10;

/// A shape of the given kind about `center`, sizes about `size` with aspect ratios up to 10.
pub fn random_shape(kind: usize, center: DVec3, size: f64, random: &mut Random) -> Shape {
    let m = random.rotation() * size;
    let aspect = random.log_uniform(-1.0, 1.0);
    let (a, b) = (center - m.z_axis * (0.5 * aspect), center + m.z_axis * (0.5 * aspect));
    let skew = m.y_axis + m.x_axis * random.range(-0.5, 0.5);
    let shape = match kind {
        0 => Sphere::new(center, size, random.rotation()).map(Shape::Sphere),
        1 => Cube::new(center, [m.x_axis, skew, m.z_axis * aspect]).map(Shape::Cube),
        2 => Cylinder::new(a, b, size, true, true).map(Shape::Cylinder),
        3 => Cone::new(a, b, size, true).map(Shape::Cone),
        4 => Cylinder::new(a, b, size, false, false).map(Shape::Cylinder),
        5 => Cylinder::new(a, b, size, true, false).map(Shape::Cylinder),
        6 => Cone::new(a, b, size, false).map(Shape::Cone),
        7 => Disk::new(center, m.x_axis, skew).map(Shape::Disk),
        8 => Rectangle::new(center, m.x_axis, skew).map(Shape::Rectangle),
        _ => Plane::new(center, m.z_axis, m.x_axis).map(Shape::Plane),
    };
    shape.expect("valid by construction")
}

/// One of each kind, near the origin.
pub fn all_shapes() -> Vec<Shape> {
    let mut random = Random::new(1);
    (0..KINDS).map(|kind| random_shape(kind, DVec3::new(0.3, -0.2, 0.5), 1.0, &mut random)).collect()
}
