//! A signed distance on a grid: the surface is where its trilinear interpolant is zero.
//!
//! The grid fills the unit cube before the transform, its points at the corners of (nx − 1)(ny − 1)(nz − 1)
//! cells. Positive is outside: a normal points to where the values grow. Where the surface leaves the
//! grid it ends.
//!
//! **Rays.** Along a ray the interpolant is a cubic in each cell, and continuous from cell to cell
//! (Hansson-Söderlund, Evans and Akenine-Möller 2022, "Ray Tracing of Signed Distance Function Grids",
//! JCGT 11 (3)). The walk through the cells carries one thing, the side of the surface that the ray is on,
//! and asks each cell where its cubic first has the other sign, so that a root between two cells is found
//! in one of them whatever rounding does to it: there are no cracks. A ray that leaves the surface is on
//! the side that its direction points to in the cell that it leaves, and the root at its origin is taken
//! out of that cell's cubic (c₀ = 0): no distance is compared with anything small.
//!
//! **Empty space.** Each cell knows how many cells away the nearest piece of the surface is at least, and
//! the walk takes that many at once.
//!
//! **Normals.** [`SdfNormals::Analytic`] is the gradient in the cell, which jumps from cell to cell;
//! [`SdfNormals::Smooth`] shades with the mean of the gradients of the eight nearest cells, weighted by
//! nearness (section 4 of the same paper).

mod cubic;
mod plain;
#[cfg(test)]
mod tests;

use super::bvh::Aabb;
use super::grid::Grid;
use super::shape::SurfacePoint;
use crate::math::{Frame, Ray};
use cubic::Cubic;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::path::Path;
use std::sync::Arc;

/// Where the shading normals of a grid come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdfNormals {
    /// The gradient of the interpolant.
    Analytic,
    /// Gradients interpolated between the middles of the cells.
    Smooth,
}

/// A signed distance on a grid, in no place yet. What is made of it shares the numbers.
#[derive(Clone, Debug)]
pub struct Distances {
    /// Points along each axis.
    size: [usize; 3],
    values: Arc<[f32]>,
    /// For each cell: no piece of the surface is nearer than this many cells, along any axis; 0 where
    /// the cell has one.
    empty: Arc<[u8]>,
    closed: bool,
    /// The least and the greatest corner of the cells that hold a piece of the surface, in cells.
    tight: [DVec3; 2],
}

/// A signed distance on a grid, in the world.
#[derive(Clone, Debug)]
pub struct SdfGrid {
    pub(in crate::scene) distances: Distances,
    /// The corner of the grid, in the world.
    origin: DVec3,
    /// World vectors from those of the grid, whose unit is a cell.
    world_from_grid: DMat3,
    grid_from_world: DMat3,
    normals: SdfNormals,
    bounds: Aabb,
    /// The largest coordinate of the box of the grid, or its largest edge.
    scale: f64,
}

/// Where a ray meets the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SdfHit {
    /// Ray parameter.
    pub t: f64,
    /// The cell.
    pub cell: u32,
}

/// The interpolant in one cell as a polynomial of the three coordinates, each from 0 to 1.
#[derive(Clone, Copy)]
struct Cell {
    k: f64,
    kx: f64,
    ky: f64,
    kz: f64,
    kxy: f64,
    kyz: f64,
    kzx: f64,
    kxyz: f64,
}

impl Cell {
    /// From the values at the corners, x fastest.
    #[inline]
    fn new(s: [f64; 8]) -> Cell {
        let (kx, ky, kz) = (s[1] - s[0], s[2] - s[0], s[4] - s[0]);
        let (xy, yz, zx) = (s[3] - s[2], s[6] - s[4], s[5] - s[1]);
        let kxy = xy - kx;
        Cell { k: s[0], kx, ky, kz, kxy, kyz: yz - ky, kzx: zx - kz, kxyz: (s[7] - s[6]) - (s[5] - s[4]) - kxy }
    }

    #[inline]
    fn value(&self, p: DVec3) -> f64 {
        let x = self.kx + self.kxy * p.y + (self.kzx + self.kxyz * p.y) * p.z;
        self.k + self.ky * p.y + (self.kz + self.kyz * p.y) * p.z + x * p.x
    }

    #[inline]
    fn gradient(&self, p: DVec3) -> DVec3 {
        DVec3::new(
            self.kx + self.kxy * p.y + (self.kzx + self.kxyz * p.y) * p.z,
            self.ky + self.kxy * p.x + (self.kyz + self.kxyz * p.x) * p.z,
            self.kz + self.kzx * p.x + (self.kyz + self.kxyz * p.x) * p.y,
        )
    }

    /// The interpolant at p + τ d.
    #[inline]
    fn along(&self, p: DVec3, d: DVec3) -> Cubic {
        let mixed = DVec3::new(self.kxy + self.kxyz * p.z, self.kyz + self.kxyz * p.x, self.kzx + self.kxyz * p.y);
        Cubic([
            self.value(p),
            self.gradient(p).dot(d),
            mixed.dot(DVec3::new(d.x * d.y, d.y * d.z, d.z * d.x)),
            self.kxyz * d.x * d.y * d.z,
        ])
    }
}

/// Whether the grid in a file bounds a solid; one that cannot be read does.
#[must_use]
pub fn is_closed(file: &Path) -> bool {
    let distances = Grid::load(file).ok().and_then(|grid| Distances::new(grid).ok());
    distances.is_none_or(|distances| distances.is_closed())
}

impl Distances {
    /// The distances of a grid, which fills the unit cube, whatever box the file names.
    ///
    /// # Errors
    /// In words: more than one channel, fewer than two points along an axis, no surface, too many cells.
    pub fn new(grid: Grid) -> Result<Distances, String> {
        if grid.channels != 1 {
            return Err(format!("expected distances, one channel, found {}", grid.channels));
        }
        let [nx, ny, nz] = grid.size;
        if grid.size.iter().any(|&n| n < 2) {
            return Err(format!("expected 2 or more points along each axis, found {nx} × {ny} × {nz}"));
        }
        let cells = [nx - 1, ny - 1, nz - 1];
        if cells.iter().map(|&n| n as u128).product::<u128>() > i32::MAX as u128 {
            return Err(format!("expected fewer than 2³¹ cells, found a grid of {nx} × {ny} × {nz} points"));
        }

        // The surface is in a cell unless all its corners are on one side.
        let mut closed = true;
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut empty = vec![u8::MAX; cells.iter().product()];
        let mut cell = 0;
        for z in 0..cells[2] {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    let corners: [f32; 8] =
                        std::array::from_fn(|i| grid.values[grid.index(x + (i & 1), y + (i >> 1 & 1), z + (i >> 2))]);
                    if !(corners.iter().all(|&s| s > 0.0) || corners.iter().all(|&s| s < 0.0)) {
                        empty[cell] = 0;
                        let p = DVec3::new(x as f64, y as f64, z as f64);
                        (low, high) = (low.min(p), high.max(p + 1.0));
                    }
                    for (i, &s) in corners.iter().enumerate() {
                        let p = [x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)];
                        let on_side = (0..3).any(|a| p[a] == 0 || p[a] == cells[a]);
                        closed &= !on_side || s > 0.0;
                    }
                    cell += 1;
                }
            }
        }
        if grid.values.iter().all(|&s| s == 0.0) {
            return Err("expected values of both signs, found zeros alone".into());
        }
        if low.x > high.x {
            return Err("expected values of both signs, found none where the distance is zero".into());
        }
        spread(&mut empty, cells);
        Ok(Distances { size: grid.size, values: grid.values.into(), empty: empty.into(), closed, tight: [low, high] })
    }

    /// Whether the surface bounds a solid: it does not reach the sides of the grid.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Whether both are the same numbers in memory.
    #[cfg(test)]
    pub(in crate::scene) fn shares(&self, other: &Distances) -> bool {
        Arc::ptr_eq(&self.values, &other.values) && Arc::ptr_eq(&self.empty, &other.empty)
    }

    /// Cells along each axis: whole numbers, as are the coordinates of cells below.
    fn cells(&self) -> DVec3 {
        DVec3::from(self.size.map(|n| n as f64 - 1.0))
    }
}

impl SdfGrid {
    /// Distances in the world.
    ///
    /// # Errors
    /// In words: a transform that cannot be inverted.
    pub fn new(distances: Distances, world_from_object: &DAffine3, normals: SdfNormals) -> Result<SdfGrid, String> {
        let extent = distances.cells();
        let linear = world_from_object.matrix3;
        let world_from_grid = linear * DMat3::from_diagonal(extent.recip());
        let grid_from_world = world_from_grid.inverse();
        let origin = world_from_object.translation;
        if !(grid_from_world.is_finite() && world_from_grid.is_finite() && origin.is_finite()) {
            return Err("expected a transform that can be inverted".into());
        }
        let [low, high] = distances.tight;
        let corner = |low: DVec3, high: DVec3, i: usize| {
            let pick = |a: usize| if i >> a & 1 == 0 { low[a] } else { high[a] };
            origin + world_from_grid * DVec3::new(pick(0), pick(1), pick(2))
        };
        let tight = Aabb::from_points((0..8).map(|i| corner(low, high, i)));
        let whole = Aabb::from_points((0..8).map(|i| corner(DVec3::ZERO, extent, i)));
        let scale = whole.min.abs().max(whole.max.abs()).max_element().max((whole.max - whole.min).max_element());
        // A corner has four roundings of numbers up to `scale`, a surface point twice as many.
        let pad = 16.0 * f64::EPSILON * scale;
        let bounds = Aabb { min: tight.min - pad, max: tight.max + pad };
        Ok(SdfGrid { distances, origin, world_from_grid, grid_from_world, normals, bounds, scale })
    }

    /// From the unit cube that the grid fills to the world.
    #[must_use]
    pub fn placement(&self) -> DAffine3 {
        let extent = self.cells();
        DAffine3 { matrix3: self.world_from_grid * DMat3::from_diagonal(extent), translation: self.origin }
    }

    /// The box of all cells that hold a piece of the surface.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Whether the surface bounds a solid: it does not reach the sides of the grid.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.distances.is_closed()
    }

    /// Memory of the lists, which it may share.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<SdfGrid>() + 4 * self.distances.values.len() + self.distances.empty.len()
    }

    fn cells(&self) -> DVec3 {
        self.distances.cells()
    }

    #[inline]
    fn cell_index(&self, c: DVec3) -> usize {
        let n = [self.distances.size[0] - 1, self.distances.size[1] - 1];
        (c.z as usize * n[1] + c.y as usize) * n[0] + c.x as usize
    }

    fn cell_at(&self, index: u32) -> DVec3 {
        let (i, nx, ny) = (index as usize, self.distances.size[0] - 1, self.distances.size[1] - 1);
        DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64)
    }

    /// Index of the value at the least corner of a cell.
    #[inline]
    fn first_corner(&self, c: DVec3) -> usize {
        (c.z as usize * self.distances.size[1] + c.y as usize) * self.distances.size[0] + c.x as usize
    }

    #[inline]
    fn cell(&self, c: DVec3) -> Cell {
        let [nx, ny, _] = self.distances.size;
        let first = self.first_corner(c);
        let at = |i: usize| f64::from(self.distances.values[i]);
        let pair = |i: usize| [at(i), at(i + 1)];
        let ([a, b], [c, d]) = (pair(first), pair(first + nx));
        let ([e, f], [g, h]) = (pair(first + nx * ny), pair(first + nx * ny + nx));
        Cell::new([a, b, c, d, e, f, g, h])
    }

    /// The nearest hit with 0 < t < `t_max`, from either side. `departing` is the cell that holds
    /// the piece of the surface that the ray starts on.
    #[must_use]
    pub fn intersect(&self, ray: &Ray, t_max: f64, departing: Option<u32>) -> Option<SdfHit> {
        // In cells, with a direction whose largest component is one.
        let cells = self.cells();
        let mut o = self.grid_from_world * (ray.origin - self.origin);
        let d = self.grid_from_world * ray.direction;
        let speed = d.abs().max_element();
        let d = d / speed;
        let inverse = d.recip();
        if !(o.is_finite() && d.is_finite()) {
            return None;
        }
        let t_max = t_max * speed;

        let (start, mut cell) = if let Some(departing) = departing {
            (0.0, self.cell_at(departing))
        } else {
            // Where the ray enters the grid. A zero of `d` gives ±∞, or NaN on a side, which min and max ignore.
            let (a, b) = (-o * inverse, (cells - o) * inverse);
            let ends = |axis: usize| if d[axis] < 0.0 { (b[axis], a[axis]) } else { (a[axis], b[axis]) };
            let ([x, y, z], mut enter, mut leave) = ([0, 1, 2].map(ends), 0.0f64, t_max);
            for (axis, (near, far)) in [x, y, z].into_iter().enumerate() {
                if d[axis] == 0.0 && !(0.0..=cells[axis]).contains(&o[axis]) {
                    return None;
                }
                enter = enter.max(near);
                leave = leave.min(far);
            }
            if enter > leave {
                return None;
            }
            o = (o + d * enter).clamp(DVec3::ZERO, cells);
            (enter, o.floor().min(cells - 1.0))
        };

        // The side that the ray is on: that of its direction where it leaves the surface.
        let local = (o - cell).clamp(DVec3::ZERO, DVec3::ONE);
        let first = self.cell(cell).along(local, d);
        let side = match departing {
            Some(_) => first.0[1..].iter().copied().find(|&c| c != 0.0).unwrap_or(1.0),
            // Far from the surface all corners are on that side.
            None if self.distances.empty[self.cell_index(cell)] > 0 => {
                f64::from(self.distances.values[self.first_corner(cell)])
            }
            None => first.0[0] + 0.0,
        };
        let side = 1.0f64.copysign(side);
        let mut departing = departing.is_some();

        let forward = d.cmpge(DVec3::ZERO);
        let mut t = 0.0f64;
        loop {
            let index = self.cell_index(cell);
            let reach = self.distances.empty[index];
            let count = f64::from(reach.max(1));

            // Where the ray leaves the cells that are known: this one, or all that are nearer than the surface.
            let plane = DVec3::select(forward, cell + count, cell + (1.0 - count));
            let distance = (plane - o) * inverse;
            let usable = |a: usize| if d[a] == 0.0 { f64::INFINITY } else { distance[a] };
            let far = [usable(0), usable(1), usable(2)];
            let axis = if far[0] <= far[1] && far[0] <= far[2] { 0 } else { 1 + usize::from(far[2] < far[1]) };
            let leave = far[axis].max(t);

            if reach == 0 {
                let p = (o + d * t - cell).clamp(DVec3::ZERO, DVec3::ONE);
                let mut cubic = Cubic(self.cell(cell).along(p, d).0.map(|c| c * side));
                if departing {
                    cubic.0[0] = 0.0;
                }
                if let Some(tau) = cubic.first_negative(leave - t) {
                    let t = ((start + t + tau) / speed).max(f64::MIN_POSITIVE);
                    return (t * speed < t_max).then_some(SdfHit { t, cell: index as u32 });
                }
            }
            departing = false;

            t = leave;
            if start + t >= t_max {
                return None;
            }
            // Through the plane; along the other axes as far as the ray went, but not out of what is known.
            let step = if forward.test(axis) { count } else { -count };
            let next = cell[axis] + step;
            if reach > 1 {
                let last = DVec3::select(forward, cell + (count - 1.0), cell - (count - 1.0));
                let now = (o + d * t).floor();
                cell = now.clamp(cell.min(last), cell.max(last)).clamp(DVec3::ZERO, cells - 1.0);
            }
            cell[axis] = next;
            if cell[axis] < 0.0 || cell[axis] >= cells[axis] {
                return None;
            }
        }
    }

    /// The surface in `cell` nearest to `point_on_ray`.
    #[must_use]
    pub fn surface(&self, point_on_ray: DVec3, cell: u32) -> SurfacePoint {
        let corner = self.cell_at(cell);
        let in_cell = self.cell(corner);
        let clamped = |p: DVec3| (p - corner).clamp(DVec3::ZERO, DVec3::ONE);
        let grid = self.grid_from_world * (point_on_ray - self.origin);
        let mut local = clamped(grid);
        let gradient = in_cell.gradient(local);
        // One step of Newton takes away the rounding of the point on the ray. Where the gradient
        // vanishes (the tip of a cone) a step is no correction, and is not taken.
        let step = gradient * (-in_cell.value(local) / gradient.length_squared());
        const CORRECTION: f64 = 1.0 / (1u64 << 20) as f64;
        if step.abs().max_element() < CORRECTION {
            local += step;
        }
        let point = self.origin + self.world_from_grid * (corner + local);

        let normal = self.world_normal(in_cell.gradient(local)).unwrap_or(DVec3::Z);
        let shading_normal = match self.normals {
            SdfNormals::Analytic => normal,
            SdfNormals::Smooth => self.world_normal(self.smooth_gradient(corner + local)).unwrap_or(normal),
        };
        let tangent = Frame::from_normal(shading_normal).s;
        SurfacePoint { point, scale: self.scale, normal, shading_normal, uv: DVec2::ZERO, tangent }
    }

    /// The unit normal of a gradient; none of zero. Gradients are mapped by the inverse transpose.
    fn world_normal(&self, gradient: DVec3) -> Option<DVec3> {
        let n = self.grid_from_world.transpose() * gradient;
        // Divided by the greatest component first, so that squares stay in range.
        (n / n.abs().max_element()).try_normalize()
    }

    /// The interpolant at a point of the grid.
    fn value(&self, p: DVec3) -> f64 {
        let cells = self.cells();
        let p = p.clamp(DVec3::ZERO, cells);
        let c = p.floor().min(cells - 1.0);
        self.cell(c).value(p - c)
    }

    /// The mean of the directions of the gradients of the eight cells around `p`, by the distance of
    /// their middles. As in Mitsuba the gradient of a neighbour is the difference across it along each
    /// axis, on the line through `p`; cells outside the grid do not count.
    fn smooth_gradient(&self, p: DVec3) -> DVec3 {
        let cells = self.cells();
        let nearest = (p + 0.5).floor();
        let first = nearest - 1.0;
        let weight = p - nearest + 0.5;
        // Axis by axis the difference across the cell before and the one after.
        let difference = |axis: usize, cell: f64| {
            let mut q = p;
            let mut at = |x: f64| {
                q[axis] = x;
                self.value(q)
            };
            at(cell + 1.0) - at(cell)
        };
        let inside = |axis: usize, cell: f64| (0.0..cells[axis]).contains(&cell);
        let both: [[f64; 2]; 3] = std::array::from_fn(|a| [difference(a, first[a]), difference(a, first[a] + 1.0)]);
        // Lengths are compared in object space, where the grid is the unit cube.
        let mut sum = DVec3::ZERO;
        for i in 0..8usize {
            let offset = [i & 1, i >> 1 & 1, i >> 2];
            if (0..3).any(|a| !inside(a, first[a] + offset[a] as f64)) {
                continue;
            }
            // Where only one of two counts, it counts whole.
            let share: f64 = (0..3)
                .map(|a| {
                    let alone = !inside(a, first[a] + 1.0 - offset[a] as f64);
                    if alone {
                        1.0
                    } else if offset[a] == 1 {
                        weight[a]
                    } else {
                        1.0 - weight[a]
                    }
                })
                .product();
            let g = DVec3::new(both[0][offset[0]], both[1][offset[1]], both[2][offset[2]]) * cells;
            sum += (g / g.abs().max_element()).normalize_or_zero() * share;
        }
        sum / cells
    }
}

/// Makes of 0 (surface) and 255 (none) the number of cells to the nearest 0, along the axis where it is
/// farthest, up to 255: two passes over all cells that look at the 13 neighbours already seen.
fn spread(empty: &mut [u8], cells: [usize; 3]) {
    let [nx, ny, nz] = cells;
    // Along a row, with one more at either end.
    let mut near = vec![u8::MAX; nx + 2];
    for sign in [1, -1] {
        for i in 0..ny * nz {
            let row = if sign > 0 { i } else { ny * nz - 1 - i };
            // The nearest by way of the four rows beside this one that the pass has been to.
            near.fill(u8::MAX);
            for (dy, dz) in [(-1, -1), (0, -1), (1, -1), (-1, 0)] {
                let y = (row % ny).checked_add_signed(sign * dy).filter(|&y| y < ny);
                let z = (row / ny).checked_add_signed(sign * dz).filter(|&z| z < nz);
                let (Some(y), Some(z)) = (y, z) else { continue };
                let beside = &empty[(z * ny + y) * nx..][..nx];
                near[1..=nx].iter_mut().zip(beside).for_each(|(near, &cells)| *near = cells.min(*near));
            }
            let row = &mut empty[row * nx..][..nx];
            for (cells, near) in row.iter_mut().zip(near.windows(3)) {
                *cells = near[0].min(near[1]).min(near[2]).saturating_add(1).min(*cells);
            }
            // And by way of the cell before.
            let mut before = u8::MAX;
            let along = |cells: &mut u8| {
                *cells = before.saturating_add(1).min(*cells);
                before = *cells;
            };
            if sign > 0 { row.iter_mut().for_each(along) } else { row.iter_mut().rev().for_each(along) }
        }
    }
}
