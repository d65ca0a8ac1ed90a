//! Cubes, boxes and parallelepipeds.

use super::exact::along;
use super::plain::Plain;
use super::{
    AreaSample, Layout, ShapeHit, SurfacePoint, check_direction, check_length, check_point, choose, in_words, largest,
};
use crate::math::Ray;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use wide::f64x4;

/// A parallelepiped: centre + x·e₀ + y·e₁ + z·e₂ with |x|, |y|, |z| ≤ 1.
///
/// Face 2i is coordinate i at −1, face 2i + 1 at +1.
#[derive(Clone, Debug)]
pub struct Cube {
    pub(super) center: DVec3,
    half_edges: [DVec3; 3],
    /// Dual vectors: coordinate i = dualᵢ · (p − centre). They point along the outward normals. By axis of space, one in each
    /// lane; the last lane is zero.
    duals: [f64x4; 3],
    normals: [DVec3; 3],
    /// Areas of the faces of each pair.
    areas: [f64; 3],
    scale: f64,
    /// How u and v lie on the faces.
    pictures: &'static [Picture; 6],
}

/// −1 for the face where its coordinate is −1, else +1.
#[inline]
fn side(face: u8) -> f64 {
    f64::from(face & 1) * 2.0 - 1.0
}

/// Picture axes of a face: (index of the half edge, sign) for right and for up.
#[derive(Debug)]
struct Picture {
    right: (usize, f64),
    up: (usize, f64),
}

/// Right × up points outward; up is +y on the four sides.
const PICTURES: [Picture; 6] = [
    Picture { right: (2, 1.0), up: (1, 1.0) },
    Picture { right: (2, -1.0), up: (1, 1.0) },
    Picture { right: (0, 1.0), up: (2, 1.0) },
    Picture { right: (0, 1.0), up: (2, -1.0) },
    Picture { right: (0, -1.0), up: (1, 1.0) },
    Picture { right: (0, 1.0), up: (1, 1.0) },
];

/// The faces of [`Layout::ZUp`].
const PICTURES_Z_UP: [Picture; 6] = [
    Picture { right: (1, 1.0), up: (2, 1.0) },
    Picture { right: (1, 1.0), up: (2, -1.0) },
    Picture { right: (2, 1.0), up: (0, 1.0) },
    Picture { right: (0, -1.0), up: (2, -1.0) },
    Picture { right: (1, -1.0), up: (0, 1.0) },
    Picture { right: (1, 1.0), up: (0, 1.0) },
];

impl Cube {
    pub(super) fn placement(&self) -> DAffine3 {
        let [x, y, z] = self.half_edges;
        DAffine3::from_cols(x, y, z, self.center)
    }

    /// A cube from its centre and the three vectors from there to the middles of faces +x, +y, +z.
    ///
    /// # Errors
    /// In words: numbers not finite, an edge of length zero, edges in one plane.
    pub fn new(center: DVec3, half_edges: [DVec3; 3]) -> Result<Cube, String> {
        check_point("center", center)?;
        let [e0, e1, e2] = half_edges;
        let mut lengths = 1.0;
        for (i, e) in half_edges.into_iter().enumerate() {
            lengths *= check_direction(&format!("edge {i}"), e)?;
        }
        let crosses = [(e1, e2), (e2, e0), (e0, e1)].map(|(a, b)| super::exact::cross(a, b));
        let volume = e0.dot(crosses[0]);
        // The edges are rounded themselves: a volume below 8 ε of a box's is none. Also NaN.
        if volume.abs().partial_cmp(&(8.0 * f64::EPSILON * lengths)) != Some(std::cmp::Ordering::Greater) {
            let found = [e0, e1, e2].map(in_words).join(", ");
            return Err(format!("edges: expected three vectors that are not in one plane, found {found}"));
        }
        check_length("edges' volume's root", libm::cbrt(volume.abs()))?;
        let duals = crosses.map(|c| c / volume);
        Ok(Cube {
            center,
            half_edges,
            duals: DMat3::from_cols_array_2d(&duals.map(|dual| dual.to_array()))
                .transpose()
                .to_cols_array_2d()
                .map(|[a, b, c]| f64x4::new([a, b, c, 0.0])),
            normals: duals.map(DVec3::normalize),
            areas: crosses.map(|c| 4.0 * c.length()),
            scale: largest(center).max(largest(e0.abs() + e1.abs() + e2.abs())),
            pictures: &PICTURES,
        })
    }

    /// See [`super::Shape::inset`].
    pub(super) fn inset(&self, by: f64) -> Option<Cube> {
        let mut edges = self.half_edges;
        for (edge, dual) in edges.iter_mut().zip(self.duals()) {
            let height = 1.0 / dual.length();
            *edge *= super::less(height, by)? / height;
        }
        let cube = Cube::new(self.center, edges).ok()?;
        Some(Cube { pictures: self.pictures, ..cube })
    }

    /// The cube with its texture laid out so.
    #[must_use]
    pub fn with_layout(self, layout: Layout) -> Cube {
        match layout {
            Layout::YUp => self,
            Layout::ZUp => Cube { pictures: &PICTURES_Z_UP, ..self },
        }
    }

    pub(super) fn plain(&self) -> Plain {
        Plain::Cube { center: self.center.as_vec3(), duals: self.duals().map(|dual| dual.as_vec3()) }
    }

    pub(super) fn duals(&self) -> [DVec3; 3] {
        [0, 1, 2].map(|i| DVec3::from_array(self.duals.map(|axis| axis.to_array()[i])))
    }

    /// The coordinates, and a zero; each rounded as [`super::exact::dot`] rounds.
    #[inline(always)]
    fn coordinates(&self, v: DVec3) -> f64x4 {
        let [x, y, z] = self.duals;
        x.mul_add(f64x4::splat(v.x), y.mul_add(f64x4::splat(v.y), z * f64x4::splat(v.z)))
    }

    /// A line at coordinates `o` that moves by `d` is between a pair of faces from here to there, pair by pair. None where it
    /// runs beside a pair. It divides as [`super::span::Span::clip_slab`] does.
    #[inline(always)]
    fn slabs(o: f64x4, d: f64x4) -> Option<[f64x4; 2]> {
        let one = f64x4::ONE;
        let along = d.simd_eq(f64x4::ZERO);
        if (along & o.abs().simd_gt(one)).any() {
            return None;
        }
        let (low, high) = ((-one - o) / d, (one - o) / d);
        let backward = d.simd_lt(f64x4::ZERO);
        let (enter, exit) = (backward.select(high, low), backward.select(low, high));
        let forever = f64x4::splat(f64::INFINITY);
        Some([along.select(-forever, enter), along.select(forever, exit)])
    }

    /// The first of the lanes where `of` is `at`, and there the face that a line enters by, which moves by `d`.
    #[inline(always)]
    fn face(of: f64x4, at: f64, d: f64x4) -> u8 {
        let axis = of.simd_eq(f64x4::splat(at)).to_bitmask().trailing_zeros();
        let backward = d.simd_lt(f64x4::ZERO).to_bitmask();
        (2 * axis + (backward >> axis & 1)) as u8
    }

    #[inline]
    pub(super) fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u8>) -> Option<ShapeHit> {
        let oc = ray.origin - self.center;
        let d = self.coordinates(ray.direction);
        if let Some(face) = departing {
            return Cube::leave(self.coordinates(oc), d, t_max, face);
        }
        // Move along the ray to near the cube, each coordinate rounded once.
        let shift = -super::exact::dot(oc, ray.direction);
        let o = self.coordinates(along(oc, ray.direction, shift));
        let [enter, exit] = Cube::slabs(o, d)?;
        let [a, b, c, _] = enter.to_array();
        let first = a.max(b).max(c);
        let [a, b, c, _] = exit.to_array();
        let last = a.min(b).min(c);
        if first > last {
            return None;
        }
        let t = shift + first;
        if t > 0.0 {
            return (t < t_max).then(|| ShapeHit { t, face: Cube::face(enter, first, d) });
        }
        let t = shift + last;
        // What is entered by one face is left by the other.
        (t > 0.0 && t < t_max).then(|| ShapeHit { t, face: Cube::face(exit, last, d) ^ 1 })
    }

    /// The exit of a ray that starts on `face` and goes in: there is exactly one. Where rounding puts it at or behind the
    /// origin (a start at an edge) it is at the least positive parameter, for the ray must not stay inside.
    #[inline]
    fn leave(o: f64x4, d: f64x4, t_max: f64, face: u8) -> Option<ShapeHit> {
        let across = d.to_array()[usize::from(face / 2) % 3];
        if across * side(face) >= 0.0 {
            return None;
        }
        let far = f64x4::ONE.copysign(d);
        let exit = d.simd_eq(f64x4::ZERO).select(f64x4::splat(f64::INFINITY), (far - o) / d);
        let [a, b, c, _] = exit.to_array();
        let last = a.min(b).min(c);
        let t = last.max(f64::MIN_POSITIVE);
        (t < t_max).then(|| ShapeHit { t, face: Cube::face(exit, last, d) ^ 1 })
    }

    /// As [`super::Shape::uv_rates`].
    pub(super) fn uv_rates(&self, face: u8, direction: DVec3) -> DVec2 {
        let d = self.coordinates(direction).to_array();
        let Picture { right, up } = &self.pictures[usize::from(face) % 6];
        0.5 * DVec2::new(right.1 * d[right.0], up.1 * d[up.0])
    }

    pub(super) fn surface(&self, point: DVec3, face: u8) -> SurfacePoint {
        let [x, y, z, _] = self.coordinates(point - self.center).to_array();
        let axis = usize::from(face / 2) % 3;
        let side = side(face);
        // A hit at an edge may round to either side of it.
        let mut at = [x, y, z].map(|x| x.clamp(-1.0, 1.0));
        at[axis] = side;
        let [e0, e1, e2] = self.half_edges;
        let normal = self.normals[axis] * side;
        let Picture { right, up } = &self.pictures[usize::from(face) % 6];
        SurfacePoint {
            point: self.center + (e0 * at[0] + e1 * at[1] + e2 * at[2]),
            scale: self.scale,
            normal,
            shading_normal: normal,
            uv: DVec2::new(0.5 + 0.5 * right.1 * at[right.0], 0.5 + 0.5 * up.1 * at[up.0]),
            tangent: self.half_edges[right.0] * right.1,
        }
    }

    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let [e0, e1, e2] = self.half_edges;
        let half = e0.abs() + e1.abs() + e2.abs();
        (self.center - half, self.center + half)
    }

    pub(super) fn area(&self) -> f64 {
        2.0 * self.areas.iter().sum::<f64>()
    }

    fn sample(&self, u: DVec2, areas: [f64; 6]) -> AreaSample {
        let (face, x) = choose(u.x, &areas);
        let axis = face / 2;
        let mut at = [0.0; 3];
        at[axis] = side(face as u8);
        at[(axis + 1) % 3] = 2.0 * x - 1.0;
        at[(axis + 2) % 3] = 2.0 * u.y - 1.0;
        let [e0, e1, e2] = self.half_edges;
        AreaSample {
            point: self.center + (e0 * at[0] + e1 * at[1] + e2 * at[2]),
            normal: self.normals[axis] * at[axis],
            face: face as u8,
            scale: self.scale,
            pdf_area: 1.0 / areas.iter().sum::<f64>(),
        }
    }

    fn face_areas(&self) -> [f64; 6] {
        [0, 0, 1, 1, 2, 2].map(|i| self.areas[i])
    }

    pub(super) fn sample_area(&self, u: DVec2) -> AreaSample {
        self.sample(u, self.face_areas())
    }

    /// The areas of the faces that face `from`; of all faces from inside.
    fn visible(&self, from: DVec3) -> [f64; 6] {
        let at = self.coordinates(from - self.center).to_array();
        let mut areas = [0.0; 6];
        for i in 0..3 {
            if at[i] < -1.0 {
                areas[2 * i] = self.areas[i];
            } else if at[i] > 1.0 {
                areas[2 * i + 1] = self.areas[i];
            }
        }
        if areas == [0.0; 6] { self.face_areas() } else { areas }
    }

    pub(super) fn visible_area(&self, from: DVec3) -> f64 {
        self.visible(from).iter().sum()
    }

    pub(super) fn sample_visible(&self, from: DVec3, u: DVec2) -> AreaSample {
        self.sample(u, self.visible(from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: f64 = f64::INFINITY;

    fn unit() -> Cube {
        Cube::new(DVec3::ZERO, [DVec3::X, DVec3::Y, DVec3::Z]).unwrap()
    }

    /// Case O09: origin on a face plane, direction along it: inside the slab by definition, so the ray
    /// meets the cube where it meets the other slabs.
    #[test]
    fn a_ray_along_a_face_plane_is_consistent() {
        for zero in [0.0, -0.0] {
            let ray = Ray::new(DVec3::new(-3.0, 1.0, 0.0), DVec3::new(1.0, zero, zero));
            assert_eq!(unit().intersect(&ray, FAR, None), Some(ShapeHit { t: 2.0, face: 0 }));
            let beside = Ray::new(DVec3::new(-3.0, 1.0f64.next_up(), 0.0), DVec3::new(1.0, zero, zero));
            assert_eq!(unit().intersect(&beside, FAR, None), None);
        }
    }

    #[test]
    fn faces_are_numbered_and_normals_point_outward() {
        for face in 0..6u8 {
            let mut n = [0.0; 3];
            n[usize::from(face / 2)] = side(face);
            let n = DVec3::from_array(n);
            let ray = Ray::new(n * 4.0, -n);
            assert_eq!(unit().intersect(&ray, FAR, None), Some(ShapeHit { t: 3.0, face }));
            let s = unit().surface(n, face);
            assert_eq!((s.normal, s.point, s.uv), (n, n, DVec2::splat(0.5)));
            // From inside it is the far face, with the same outward normal.
            let inside = Ray::new(-n * 0.5, n);
            assert_eq!(unit().intersect(&inside, FAR, None), Some(ShapeHit { t: 1.5, face }));
        }
    }

    /// Right × up = outward on each face: pictures are not mirrored.
    #[test]
    fn pictures_on_faces_are_not_mirrored() {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        for (face, Picture { right, up }) in PICTURES.iter().enumerate() {
            let outward = (axes[right.0] * right.1).cross(axes[up.0] * up.1);
            let expected = axes[face / 2] * side(face as u8);
            assert_eq!(outward, expected, "face {face}");
        }
    }
}
