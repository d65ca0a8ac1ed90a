//! The textbook intersector of one cell in single precision, kept to measure against: see [`crate::scene::watch`].
//!
//! The ray goes into the cell's box by slabs; from there the interpolant along it is a cubic (Parker et al. 1998,
//! "Interactive Ray Tracing for Isosurface Rendering"), and where its sign changes from one extremum to the next there is a
//! root (Marmitt et al. 2004, "Fast and Accurate Ray-Voxel Intersection Techniques for Iso-Surface Ray Tracing"). It has the
//! faults of textbooks: the place of entry is rounded, so a root near a face of the cell may fall out of it, and a ray
//! that starts on the surface starts on either side of it, by rounding.

use super::SdfGrid;
use crate::scene::shape::plain::roots;
use glam::Vec3;

impl SdfGrid {
    /// Where the ray first meets the surface within `cell`, at t > 0, from either side.
    #[must_use]
    pub(in crate::scene) fn meet_plain(&self, cell: u32, origin: Vec3, direction: Vec3) -> Option<f32> {
        // In the cell's own coordinates, each from 0 to 1.
        let corner = self.cell_at(cell);
        let linear = self.grid_from_world.as_mat3();
        let moved = (self.grid_from_world * -self.origin).as_vec3();
        let (o, d) = (linear * origin + moved - corner.as_vec3(), linear * direction);

        let (a, b) = (-o / d, (Vec3::ONE - o) / d);
        let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        if enter >= leave {
            return None;
        }

        // The interpolant is linear in x, y and z by turns, and so in each a polynomial of the ray.
        let first = self.first_corner(corner);
        let [nx, ny, _] = self.distances.size;
        let p = o + d * enter;
        let along_x =
            |i: usize| lerp(constant(self.distances.values[i]), constant(self.distances.values[i + 1]), p.x, d.x);
        let along_y = |i: usize| lerp(along_x(i), along_x(i + nx), p.y, d.y);
        let cubic = lerp(along_y(first), along_y(first + nx * ny), p.z, d.z);
        Some(enter + first_root(cubic, leave - enter)?)
    }
}

/// c₀ + c₁ τ + c₂ τ² + c₃ τ³.
type Cubic = [f32; 4];

fn constant(value: f32) -> Cubic {
    [value, 0.0, 0.0, 0.0]
}

/// a + (b − a)(p + τ d) of polynomials below the third degree.
fn lerp(a: Cubic, b: Cubic, p: f32, d: f32) -> Cubic {
    let rise: Cubic = std::array::from_fn(|i| b[i] - a[i]);
    std::array::from_fn(|i| a[i] + rise[i] * p + if i == 0 { 0.0 } else { rise[i - 1] * d })
}

/// Where between 0 and `end` the cubic first changes its sign.
fn first_root(cubic: Cubic, end: f32) -> Option<f32> {
    let [c0, c1, c2, c3] = cubic;
    let is_negative = |tau: f32| ((c3 * tau + c2) * tau + c1) * tau + c0 < 0.0;
    // Extrema; of a parabola there is one.
    let extrema = if c3 == 0.0 { Some([-c1 / (2.0 * c2); 2]) } else { roots(3.0 * c3, 2.0 * c2, c1) };
    let mut from = 0.0;
    for to in extrema.into_iter().flatten().filter(|&e| e > 0.0 && e < end).chain([end]) {
        if is_negative(from) != is_negative(to) {
            // As often as an f32 has bits.
            let (low, high) = (0..24).fold((from, to), |(low, high), _| {
                let middle = 0.5 * (low + high);
                if is_negative(middle) == is_negative(from) { (middle, high) } else { (low, middle) }
            });
            return Some(0.5 * (low + high));
        }
        from = to;
    }
    None
}
