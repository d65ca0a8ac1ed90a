//! What a volume nowhere exceeds, block by block, and the way of a ray through the blocks.

use super::{GridVolume, Volume, Voxels};
use crate::math::Ray;
use glam::{DAffine3, DVec3};

/// Voxels along each edge of a block with a bound of its own.
const BLOCK: usize = 4;

/// Room for the rounding of a look-up: seven mixes and a product of f32 in [`GridVolume::blend`] and
/// eight operations in a sigmoid leave it within 24 · 2⁻²⁴ of the exact value, which no bound is below.
const ROUNDING: f64 = 1.0 + 24.0 / (1u32 << 24) as f64;

/// Upper bounds of a volume, block by block, and the way of a ray through them.
#[derive(Clone, Debug)]
pub struct Bounds {
    /// From the world to voxel coordinates.
    place_from_world: DAffine3,
    /// Blocks along each axis.
    blocks: [usize; 3],
    /// Voxels along each axis.
    size: [f64; 3],
    /// By block, x fastest.
    values: Vec<f32>,
    /// Of the whole volume, and of everything beyond the grid.
    pub global: f64,
    /// Two corners of the box in which the volume is, in the world.
    pub extent: [DVec3; 2],
}

impl Bounds {
    /// The bounds of `volume`.
    #[must_use]
    pub fn new(volume: &Volume) -> Bounds {
        let mut bounds = match volume {
            Volume::Grid(grid) => Bounds::of(grid, BLOCK),
            Volume::Constant { value, local_from_world } => {
                let global = value.max() * ROUNDING;
                Bounds {
                    place_from_world: *local_from_world,
                    blocks: [1; 3],
                    size: [1.0; 3],
                    values: vec![global as f32],
                    global,
                    extent: [DVec3::ZERO; 2],
                }
            }
        };
        let world = volume.local_from_world().inverse();
        let corner =
            |i: u32| world.transform_point3(DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)));
        let corners: Vec<DVec3> = (0..8).map(corner).collect();
        bounds.extent = [
            corners.iter().copied().reduce(DVec3::min).unwrap_or_default(),
            corners.iter().copied().reduce(DVec3::max).unwrap_or_default(),
        ];
        bounds
    }

    /// Mean free paths across the volume, if it were everywhere as dense as where it is densest.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        self.global * self.extent[0].distance(self.extent[1])
    }

    /// Whether `point` is in the box in which the volume is.
    #[must_use]
    pub fn holds(&self, point: DVec3) -> bool {
        self.extent[0].cmple(point).all() && point.cmple(self.extent[1]).all()
    }

    /// Bounds of blocks of `edge` voxels a side.
    pub(super) fn of(grid: &GridVolume, edge: usize) -> Bounds {
        match &grid.values {
            Voxels::Grey(values) => Bounds::by(grid, edge, |i| (values[i], 1.0)),
            Voxels::Raw(_) => Bounds::by(grid, edge, |i| grid.bound(i)),
            // Each is asked for several times, and worked out once.
            Voxels::Coloured(_) => {
                let bounds: Vec<(f32, f32)> = (0..grid.len()).map(|i| grid.bound(i)).collect();
                Bounds::by(grid, edge, |i| bounds[i])
            }
        }
    }

    /// The same where a voxel has the bound that `bound` tells, as [`GridVolume::bound`].
    fn by(grid: &GridVolume, edge: usize, bound: impl Fn(usize) -> (f32, f32)) -> Bounds {
        let edge = edge.min(grid.size.into_iter().max().unwrap_or(1));
        let blocks = grid.size.map(|n| n.div_ceil(edge));
        // A look-up at place x mixes voxels ⌊x − ½⌋ and the next; rounding may carry a point over a face
        // of its block, so one voxel on either side counts.
        let around = |axis: usize, block: usize| -> Vec<usize> {
            let first = (block * edge) as f64 - 1.0;
            let last = ((block + 1) * edge).min(grid.size[axis]) as f64;
            let mut all: Vec<usize> =
                (0..=(last - first) as usize).map(|i| grid.wrapped(first + i as f64, axis)).collect();
            all.sort_unstable();
            all.dedup();
            all
        };
        let ranges: [Vec<Vec<usize>>; 3] =
            std::array::from_fn(|axis| (0..blocks[axis]).map(|b| around(axis, b)).collect());
        let mut values = Vec::with_capacity(blocks.iter().product());
        for z in &ranges[2] {
            for y in &ranges[1] {
                for x in &ranges[0] {
                    let (mut value, mut factor) = (0.0f32, 0.0f32);
                    for &k in z {
                        for &j in y {
                            for &i in x {
                                let (v, f) = bound(grid.index([i, j, k]));
                                (value, factor) = (value.max(v), factor.max(f));
                            }
                        }
                    }
                    let exact = f64::from(value) * f64::from(factor) * ROUNDING;
                    // Up, where f32 lies below.
                    let near = exact as f32;
                    values.push(if f64::from(near) < exact { near.next_up() } else { near });
                }
            }
        }
        let n = grid.size.map(|n| n as f64);
        let largest = |pick: fn((f32, f32)) -> f32| (0..grid.len()).map(|i| pick(bound(i))).fold(0.0f32, f32::max);
        Bounds {
            place_from_world: DAffine3::from_scale(DVec3::from(n)) * grid.local_from_world,
            blocks,
            size: n,
            values,
            global: f64::from(largest(|f| f.0)) * f64::from(largest(|f| f.1)) * ROUNDING,
            extent: [DVec3::ZERO; 2],
        }
    }

    /// Where along the first `t_max` metres of `ray` the volume is; empty where the second is not greater.
    #[must_use]
    pub fn span(&self, ray: &Ray, t_max: f64) -> (f64, f64) {
        slab(ray.origin, ray.direction, self.extent, [0.0, t_max])
    }

    /// The stretches of `ray` up to `t_max` inside the volume, each with its bound.
    #[must_use]
    #[inline]
    pub fn march(&self, ray: &Ray, t_max: f64) -> March<'_> {
        let (enter, leave) = self.span(ray, t_max);
        let origin = self.place_from_world.transform_point3(ray.origin);
        let direction = self.place_from_world.transform_vector3(ray.direction);
        let (inside, outside) = slab(origin, direction, [DVec3::ZERO, DVec3::from(self.size)], [enter, leave]);
        let (origin, direction) = (origin.to_array(), direction.to_array());
        let mut march = March {
            bounds: self,
            origin,
            direction,
            at: 0.0,
            inside: 0.0,
            outside: 0.0,
            leave: 0.0,
            block: [0; 3],
            faces: [f64::INFINITY; 3],
        };
        if enter < leave {
            (march.at, march.inside, march.outside, march.leave) = (enter, leave, leave, leave);
            if inside < outside {
                (march.inside, march.outside) = (inside, outside);
                for axis in 0..3 {
                    let place = direction[axis].mul_add(inside, origin[axis]) / march.edge(axis);
                    march.block[axis] = (place.max(0.0) as usize).min(self.blocks[axis] - 1);
                    march.faces[axis] = march.face(axis);
                }
            }
        }
        march
    }
}

/// The part of [t₀, t₁] in which origin + t direction lies between two corners; empty where the
/// second is not greater.
fn slab(origin: DVec3, direction: DVec3, corners: [DVec3; 2], range: [f64; 2]) -> (f64, f64) {
    let (o, d) = (origin.to_array(), direction.to_array());
    let (low, high) = (corners[0].to_array(), corners[1].to_array());
    let [mut t0, mut t1] = range;
    for axis in 0..3 {
        if d[axis] == 0.0 {
            if o[axis] < low[axis] || o[axis] > high[axis] {
                return (0.0, 0.0);
            }
            continue;
        }
        let (a, b) = ((low[axis] - o[axis]) / d[axis], (high[axis] - o[axis]) / d[axis]);
        t0 = t0.max(a.min(b));
        t1 = t1.min(a.max(b));
    }
    (t0, t1)
}

/// A stretch of a ray on which a volume is at most `bound`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// From here, metres along the ray.
    pub from: f64,
    /// To here, metres along the ray.
    pub to: f64,
    /// At most this.
    pub bound: f64,
}

/// The way of a ray through blocks (Amanatides and Woo 1987), with the space between the grid and
/// the box about it before and after.
#[derive(Debug)]
pub struct March<'a> {
    bounds: &'a Bounds,
    origin: [f64; 3],
    direction: [f64; 3],
    at: f64,
    inside: f64,
    outside: f64,
    leave: f64,
    /// The block that the ray is in, once it is inside of the grid.
    block: [usize; 3],
    /// Where the ray meets the face of the block that lies ahead along each axis.
    faces: [f64; 3],
}

impl March<'_> {
    /// Edge of a block, voxels.
    fn edge(&self, axis: usize) -> f64 {
        // The last block may hang over: all but it have the same edge.
        if self.bounds.blocks[axis] == 1 { self.bounds.size[axis] } else { BLOCK as f64 }
    }

    /// Where the ray meets the face of the block ahead along `axis`; nowhere where it runs beside it.
    #[inline]
    fn face(&self, axis: usize) -> f64 {
        let (o, d) = (self.origin[axis], self.direction[axis]);
        let face = (self.block[axis] + usize::from(d > 0.0)) as f64 * self.edge(axis);
        if d == 0.0 { f64::INFINITY } else { (face - o) / d }
    }
}

impl Iterator for March<'_> {
    type Item = Stretch;

    #[inline]
    fn next(&mut self) -> Option<Stretch> {
        let from = self.at;
        let goes_on = from < self.leave;
        if !goes_on {
            return None;
        }
        let global = self.bounds.global;
        if from < self.inside {
            self.at = self.inside;
            return Some(Stretch { from, to: self.inside, bound: global });
        }
        if from >= self.outside {
            self.at = self.leave;
            return Some(Stretch { from, to: self.leave, bound: global });
        }
        // The nearest of the faces ahead.
        let (mut to, mut across) = (self.outside, None);
        for axis in 0..3 {
            if self.faces[axis] < to {
                (to, across) = (self.faces[axis], Some(axis));
            }
        }
        let (block, blocks) = (self.block, self.bounds.blocks);
        let bound = f64::from(self.bounds.values[(block[2] * blocks[1] + block[1]) * blocks[0] + block[0]]);
        // Rounding may put a face a little behind: the stretch is then empty, not negative.
        let to = to.max(from);
        self.at = to;
        match across {
            None => self.at = self.outside,
            Some(axis) => {
                let next = if self.direction[axis] > 0.0 { block[axis] + 1 } else { block[axis].wrapping_sub(1) };
                if next < blocks[axis] {
                    self.block[axis] = next;
                    self.faces[axis] = self.face(axis);
                } else {
                    self.at = self.outside.max(to);
                }
            }
        }
        Some(Stretch { from, to, bound })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{grid, noise};
    use super::*;
    use crate::scene::texture::Wrap;
    use crate::scene::volume::Between;
    use crate::spectrum::{Carried, Lanes};
    use std::sync::Arc;

    /// The march covers the way through the box without gap or overlap, and nowhere is the volume above its bound:
    /// random rays through grids of all kinds, looked up a hundred times a stretch.
    #[test]
    fn no_look_up_is_above_the_bound_of_its_stretch() {
        let colours: Vec<[f32; 3]> = noise(3 * 7 * 9 * 5).chunks_exact(3).map(|c| [c[0], c[1], 3.0 * c[2]]).collect();
        let turned =
            DAffine3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7) * DAffine3::from_scale(DVec3::new(0.5, 1.0, 2.0));
        for values in [Voxels::Grey(noise(7 * 9 * 5).into()), Voxels::upsampled(&colours, Carried::Spectra)] {
            for wrap in [Wrap::Clamp, Wrap::Mirror, Wrap::Repeat] {
                for (between, local_from_world) in [
                    (Between::Trilinear, DAffine3::IDENTITY),
                    (Between::Nearest, DAffine3::IDENTITY),
                    (Between::Trilinear, turned),
                ] {
                    let grid = GridVolume { between, wrap, local_from_world, ..grid([7, 9, 5], values.clone()) };
                    let volume = Volume::Grid(Arc::new(grid));
                    let bounds = Bounds::new(&volume);
                    let random = noise(6 * 40);
                    for r in random.chunks_exact(6) {
                        let target = bounds.extent[0]
                            + (bounds.extent[1] - bounds.extent[0]) * DVec3::new(r[0].into(), r[1].into(), r[2].into());
                        let origin =
                            DVec3::new(f64::from(r[3]) - 0.5, f64::from(r[4]) - 0.5, f64::from(r[5]) - 0.5) * 8.0;
                        let ray = Ray::new(origin, (target - origin).normalize());
                        let (enter, leave) = slab(origin, ray.direction, bounds.extent, [0.0, f64::INFINITY]);
                        let mut end = enter;
                        let nm = Lanes::new([380.0, 450.0, 480.0, 530.0, 550.0, 600.0, 650.0, 780.0]);
                        for stretch in bounds.march(&ray, f64::INFINITY) {
                            assert_eq!(stretch.from, end);
                            end = stretch.to;
                            for i in 0..100 {
                                let t = stretch.from + (stretch.to - stretch.from) * f64::from(i) / 99.0;
                                let value = volume.eval(ray.at(t), nm).to_array().into_iter().fold(0.0f32, f32::max);
                                assert!(f64::from(value) <= stretch.bound, "{value} {stretch:?} {wrap:?} {between:?}");
                                assert!(stretch.bound <= bounds.global * 1.000_001);
                            }
                        }
                        assert!((end - leave).abs() <= 1e-12 * leave, "{end} {leave}");
                    }
                }
            }
        }
    }

    /// Along an axis, along an edge, from inside, past the box, and from a corner.
    #[test]
    fn rays_in_special_places_march_through_the_box_and_no_further() {
        let volume = Volume::Grid(Arc::new(grid([8, 8, 8], Voxels::Grey(noise(512).into()))));
        let bounds = Bounds::new(&volume);
        let length = |origin: [f64; 3], direction: [f64; 3], t_max: f64| -> f64 {
            let ray = Ray::new(origin.into(), DVec3::from(direction).normalize());
            bounds.march(&ray, t_max).map(|s| s.to - s.from).sum()
        };
        let infinity = f64::INFINITY;
        assert_eq!(length([-1.0, 0.5, 0.5], [1.0, 0.0, 0.0], infinity), 1.0);
        assert_eq!(length([-1.0, 0.5, 0.5], [1.0, 0.0, 0.0], 1.25), 0.25);
        assert_eq!(length([-1.0, 0.5, 0.5], [-1.0, 0.0, 0.0], infinity), 0.0);
        assert_eq!(length([0.25, 0.5, 0.5], [-1.0, 0.0, 0.0], infinity), 0.25);
        assert_eq!(length([0.5, 0.5, 0.5], [0.0, 0.0, 1.0], infinity), 0.5);
        assert_eq!(length([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], infinity), 1.0);
        assert_eq!(length([-1.0, 1.5, 0.5], [1.0, 0.0, 0.0], infinity), 0.0);
        assert!((length([0.0; 3], [1.0; 3], infinity) - 3f64.sqrt()).abs() < 1e-12);
        assert!((length([1.0; 3], [-1.0; 3], infinity) - 3f64.sqrt()).abs() < 1e-12);
    }
}
