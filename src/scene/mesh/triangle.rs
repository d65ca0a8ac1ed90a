//! Rays against triangles, watertight.
//!
//! Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", in f64: the ray is
//! sheared onto the z axis and three edge functions are taken there. Each is a difference of
//! two products by Kahan's algorithm with FMA, whose sign is exact (Jeannerod, Louvet and Muller
//! 2013), so that no ray passes between two triangles that share an edge or a vertex. The paper's
//! fallback to double precision at zero becomes needless.

use crate::math::Ray;
use crate::scene::shape::exact::{cross, difference_of_products};
use crate::scene::shape::plain;
use glam::DVec3;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance along the ray, positive.
    pub t: f64,
    /// Barycentric coordinate of the second corner.
    pub b1: f64,
    /// Barycentric coordinate of the third corner.
    pub b2: f64,
}

/// A ray made ready for many triangles.
#[derive(Clone, Copy, Debug)]
pub struct TriangleRay {
    /// Axes of the sheared frame: the last is that of the largest component of the direction.
    pub axes: [usize; 3],
    /// Relative to the origin of the vertices, in the order of `axes`.
    pub(super) origin: [f64; 3],
    /// Shear per unit of z along x and y, and 1 / direction along z.
    pub(super) shear: [f64; 3],
}

impl TriangleRay {
    /// Prepares `ray` for triangles with vertices relative to `origin`.
    #[must_use]
    pub fn new(ray: &Ray, origin: DVec3) -> TriangleRay {
        let d = ray.direction;
        let size = d.abs();
        let kz = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        let sz = 1.0 / d[kz];
        let o = ray.origin - origin;
        let axes = [kx, ky, kz];
        TriangleRay { axes, origin: axes.map(|k| o[k]), shear: [d[kx] * sz, d[ky] * sz, sz] }
    }

    /// The hit with the triangle of corners `v`, from either side, at t > 0. None for
    /// triangles without area.
    #[must_use]
    pub fn intersect(&self, v: [DVec3; 3]) -> Option<TriangleHit> {
        let hit = self.meet(self.axes.map(|k| v.map(|corner| corner[k])))?;
        (area_vector(v) != DVec3::ZERO).then_some(hit)
    }

    /// [`TriangleRay::intersect`] with a triangle that has an area; its corners by axis, in the order of the ray's.
    #[must_use]
    #[inline(always)]
    pub fn meet(&self, [x, y, z]: [[f64; 3]; 3]) -> Option<TriangleHit> {
        let [ox, oy, oz] = self.origin;
        let [sx, sy, sz] = self.shear;
        // One by one: what is written as a map of arrays is not kept in registers.
        let (az, bz, cz) = (z[0] - oz, z[1] - oz, z[2] - oz);
        let (ax, bx, cx) = ((-sx).mul_add(az, x[0] - ox), (-sx).mul_add(bz, x[1] - ox), (-sx).mul_add(cz, x[2] - ox));
        let (ay, by, cy) = ((-sy).mul_add(az, y[0] - oy), (-sy).mul_add(bz, y[1] - oy), (-sy).mul_add(cz, y[2] - oy));
        let e0 = difference_of_products(cx, by, cy, bx);
        let e1 = difference_of_products(ax, cy, ay, cx);
        let e2 = difference_of_products(bx, ay, by, ax);
        let inside = e0.min(e1).min(e2) >= 0.0 || e0.max(e1).max(e2) <= 0.0;
        if !inside {
            return None;
        }
        let det = e0 + e1 + e2;
        let t = e2.mul_add(sz * cz, e1.mul_add(sz * bz, e0 * (sz * az))) / det;
        // det = 0 makes t infinite or NaN.
        if !(t > 0.0 && t < f64::INFINITY) {
            return None;
        }
        Some(TriangleHit { t, b1: e1 / det, b2: e2 / det })
    }

    /// [`TriangleRay::meet`] in single precision without exact signs, beyond [`plain::EPSILON`]: what the feature
    /// `single_precision` measures.
    #[must_use]
    #[inline(always)]
    pub fn meet_single(&self, corners: [[f64; 3]; 3]) -> Option<TriangleHit> {
        let [x, y, z] = corners.map(|axis| axis.map(|v| v as f32));
        let [ox, oy, oz] = self.origin.map(|v| v as f32);
        let [sx, sy, sz] = self.shear.map(|v| v as f32);
        let (az, bz, cz) = (z[0] - oz, z[1] - oz, z[2] - oz);
        let (ax, bx, cx) = (x[0] - ox - sx * az, x[1] - ox - sx * bz, x[2] - ox - sx * cz);
        let (ay, by, cy) = (y[0] - oy - sy * az, y[1] - oy - sy * bz, y[2] - oy - sy * cz);
        let (e0, e1, e2) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        if !(e0.min(e1).min(e2) >= 0.0 || e0.max(e1).max(e2) <= 0.0) {
            return None;
        }
        let det = e0 + e1 + e2;
        let t = sz * (e0 * az + e1 * bz + e2 * cz) / det;
        let hit = || TriangleHit { t: t.into(), b1: (e1 / det).into(), b2: (e2 / det).into() };
        (t > plain::EPSILON && t < f32::INFINITY).then(hit)
    }
}

/// The normal times twice the area; zero exactly where the corners lie on a line.
pub(super) fn area_vector([a, b, c]: [DVec3; 3]) -> DVec3 {
    cross(b - a, c - a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shape::testing::Random;

    fn hit(ray: &Ray, v: [DVec3; 3]) -> Option<TriangleHit> {
        TriangleRay::new(ray, DVec3::ZERO).intersect(v)
    }

    /// The axes moved on by `turn`.
    fn turned(v: DVec3, turn: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|i| v[(i + turn) % 3]))
    }

    /// Plane z = 2 seen from the origin along (0.25, 0.5, 1): the point is (0.5, 1, 2), t = 2 in
    /// units of the direction; with v0 = (0,0,2), v1 = (4,0,2), v2 = (0,4,2) weights 1/8 and 1/4.
    #[test]
    fn barycentric_coordinates_are_those_of_the_point() {
        let ray = Ray::new(DVec3::ZERO, DVec3::new(0.25, 0.5, 1.0));
        let v = [DVec3::new(0.0, 0.0, 2.0), DVec3::new(4.0, 0.0, 2.0), DVec3::new(0.0, 4.0, 2.0)];
        let expected = TriangleHit { t: 2.0, b1: 0.125, b2: 0.25 };
        assert_eq!(hit(&ray, v), Some(expected));
        // From behind, and with another axis dominant, the same weights.
        for turn in 1..=2 {
            let ray = Ray::new(DVec3::ZERO, turned(ray.direction, turn));
            assert_eq!(hit(&ray, v.map(|p| turned(p, turn))), Some(expected));
            let back = Ray::new(ray.direction * 4.0, -ray.direction);
            assert_eq!(hit(&back, v.map(|p| turned(p, turn))), Some(expected));
        }
    }

    /// Case O12: pbrt-v4 `shapes_test.cpp`, Triangle.BadCases: three points on one line.
    #[test]
    fn collinear_vertices_are_missed() {
        let v = [
            DVec3::new(-1_113.454_59, -79.049_614, -56.243_190_8),
            DVec3::new(-1_113.454_59, -87.092_269_9, -56.243_190_8),
            DVec3::new(-1_113.454_59, -79.209_014_9, -56.243_190_8),
        ]
        .map(|p| p.as_vec3().as_dvec3());
        let o = DVec3::new(-1_081.479_25, 99.999_954_2, 87.770_111_1).as_vec3().as_dvec3();
        let d = DVec3::new(-32.107_299_8, -183.355_865, -144.607_635).as_vec3().as_dvec3();
        assert_eq!(hit(&Ray::new(o, d), v), None);
    }

    /// Case O10: slivers 1 : 1e7, zero area, repeated vertices.
    #[test]
    fn degenerate_triangles_give_no_nan() {
        let mut random = Random::new(10);
        let mut hits = 0;
        for i in 0..100_000 {
            let a = random.direction();
            let b = random.direction();
            let c = match i % 3 {
                0 => a + (b - a) * random.uniform() + random.direction() * 1e-7,
                1 => a + (b - a) * 0.5,
                _ => b,
            };
            let target = a + (b - a) * random.uniform();
            let origin = random.direction() * 3.0;
            let ray = Ray::new(origin, (target - origin).normalize());
            if let Some(hit) = hit(&ray, [a, b, c]) {
                hits += 1;
                assert!(hit.t.is_finite() && hit.b1 >= 0.0 && hit.b2 >= 0.0, "{hit:?}");
                // The weights divide numbers of one sign by their sum, rounded twice.
                assert!(hit.b1 + hit.b2 <= 1.0 + 4.0 * f64::EPSILON, "{hit:?}");
            }
        }
        assert!(hits > 1000, "{hits}");
    }
}
