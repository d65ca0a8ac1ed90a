//! Four shapes of a kind side by side: a ray is tried with all of them by one run of instructions.
//!
//! Every step is that of the shape's own `intersect`, in the same order, and each rounds as it does for one number: a
//! distance has the same bits either way. What decides whether there is a hit is a comparison that NaN fails, so that
//! lanes without a shape need no care: they are made so that their distance is no number.

use super::{Cube, Disk, Plane, Rectangle, Sphere};
use crate::math::Ray;
use crate::math::four::{Vec4, lanes, splat};
use crate::scene::shape::flat::Patch;
use glam::DVec3;
use wide::f64x4;

/// A ray in each lane: the same for four shapes, or four for a shape that is the same in each lane.
#[derive(Clone, Copy, Debug)]
pub struct FourRays {
    origin: Vec4,
    direction: Vec4,
}

impl FourRays {
    /// `ray` in each lane.
    #[inline(always)]
    #[must_use]
    pub fn new(ray: &Ray) -> FourRays {
        FourRays { origin: splat(ray.origin), direction: splat(ray.direction) }
    }

    /// A ray for each lane.
    #[inline(always)]
    #[must_use]
    pub fn of([a, b, c, d]: [&Ray; 4]) -> FourRays {
        FourRays {
            origin: lanes([a.origin, b.origin, c.origin, d.origin]),
            direction: lanes([a.direction, b.direction, c.direction, d.direction]),
        }
    }
}

/// As [`super::exact::dot`].
#[inline(always)]
#[must_use]
pub fn dot(a: &Vec4, b: &Vec4) -> f64x4 {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// The difference in each lane.
#[inline(always)]
#[must_use]
pub fn minus(a: &Vec4, b: &Vec4) -> Vec4 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// As [`super::exact::difference_of_products`].
#[inline(always)]
fn difference_of_products(a: f64x4, b: f64x4, c: f64x4, d: f64x4) -> f64x4 {
    let cd = c * d;
    a.mul_sub(b, cd) + c.mul_neg_add(d, cd)
}

/// As [`super::exact::along`].
#[inline(always)]
fn near(origin: &Vec4, direction: &Vec4, t: f64x4) -> Vec4 {
    std::array::from_fn(|axis| t.mul_add(direction[axis], origin[axis]))
}

fn set(lanes: &mut Vec4, lane: usize, v: DVec3) {
    for axis in 0..3 {
        lanes[axis].as_mut_array()[lane] = v[axis];
    }
}

/// Rectangles and disks.
#[derive(Clone, Debug)]
pub struct Patches {
    origin: Vec4,
    normal: Vec4,
    to_a: Vec4,
    to_b: Vec4,
    /// Between which coordinates a rectangle lies; anywhere for a disk.
    low: [f64x4; 2],
    high: [f64x4; 2],
    /// How far from the middle a disk reaches, squared; without end for a rectangle.
    rim_squared: f64x4,
}

impl Patches {
    /// A block of nothing.
    pub const EMPTY: Patches = {
        const OUT: f64x4 = f64x4::splat(f64::INFINITY);
        let zero = [f64x4::ZERO; 3];
        let low = [OUT; 2];
        Patches { origin: zero, normal: zero, to_a: zero, to_b: zero, low, high: [f64x4::ZERO; 2], rim_squared: OUT }
    };

    fn put(&mut self, lane: usize, patch: &Patch, low: [f64; 2], high: [f64; 2], rim_squared: f64) {
        set(&mut self.origin, lane, patch.origin);
        set(&mut self.normal, lane, patch.normal);
        set(&mut self.to_a, lane, patch.to_a);
        set(&mut self.to_b, lane, patch.to_b);
        for i in 0..2 {
            self.low[i].as_mut_array()[lane] = low[i];
            self.high[i].as_mut_array()[lane] = high[i];
        }
        self.rim_squared.as_mut_array()[lane] = rim_squared;
    }

    /// Puts a rectangle into a lane.
    pub fn put_rectangle(&mut self, lane: usize, Rectangle(patch): &Rectangle) {
        let pad = patch.pad.to_array();
        self.put(lane, patch, pad.map(|x| -x), pad.map(|x| 1.0 + x), f64::INFINITY);
    }

    /// Puts a disk into a lane.
    pub fn put_disk(&mut self, lane: usize, Disk(patch): &Disk) {
        let rim = 1.0 + patch.pad.max_element();
        self.put(lane, patch, [f64::NEG_INFINITY; 2], [f64::INFINITY; 2], rim * rim);
    }

    /// Distances along the ray, and in which lanes the place is on the patch. A ray along a plane has a distance that is
    /// no number or not finite.
    #[inline(always)]
    #[must_use]
    pub fn meet(&self, ray: &FourRays) -> (f64x4, f64x4) {
        let d = &ray.direction;
        let across = dot(d, &self.normal);
        let oc = minus(&ray.origin, &self.origin);
        let shift = -dot(&oc, d);
        let near = near(&oc, d, shift);
        let t = -dot(&near, &self.normal) / across;
        let a = t.mul_add(dot(d, &self.to_a), dot(&near, &self.to_a));
        let b = t.mul_add(dot(d, &self.to_b), dot(&near, &self.to_b));
        let within =
            (a.simd_ge(self.low[0]) & a.simd_le(self.high[0])) & (b.simd_ge(self.low[1]) & b.simd_le(self.high[1]));
        (shift + t, within & (a * a + b * b).simd_le(self.rim_squared))
    }
}

/// Spheres.
#[derive(Clone, Debug)]
pub struct Spheres {
    center: Vec4,
    radius_squared: f64x4,
}

impl Spheres {
    /// A block of nothing.
    pub const EMPTY: Spheres = Spheres { center: [f64x4::ZERO; 3], radius_squared: f64x4::splat(-1.0) };

    /// Puts a sphere into a lane.
    pub fn put(&mut self, lane: usize, sphere: &Sphere) {
        set(&mut self.center, lane, sphere.center);
        self.radius_squared.as_mut_array()[lane] = sphere.radius_squared;
    }

    /// Distances along the ray, which starts on the spheres of the lanes `departing`; no number where it passes by.
    #[inline(always)]
    #[must_use]
    pub fn meet(&self, ray: &FourRays, departing: f64x4) -> f64x4 {
        let d = &ray.direction;
        let oc = minus(&ray.origin, &self.center);
        let a = dot(d, d);
        let b = dot(&oc, d);
        let m = [
            difference_of_products(oc[1], d[2], oc[2], d[1]),
            difference_of_products(oc[2], d[0], oc[0], d[2]),
            difference_of_products(oc[0], d[1], oc[1], d[0]),
        ];
        let half = self.radius_squared.mul_sub(a, dot(&m, &m)).sqrt();
        let near = -b - half;
        let first = near.simd_gt(f64x4::ZERO).select(near, half - b);
        departing.select(f64x4::splat(-2.0) * b, first) / a
    }
}

/// Planes.
#[derive(Clone, Debug)]
pub struct Planes {
    point: Vec4,
    normal: Vec4,
}

impl Planes {
    /// A block of nothing.
    pub const EMPTY: Planes = Planes { point: [f64x4::ZERO; 3], normal: [f64x4::ZERO; 3] };

    /// Puts a plane into a lane.
    pub fn put(&mut self, lane: usize, plane: &Plane) {
        set(&mut self.point, lane, plane.point);
        set(&mut self.normal, lane, plane.frame.n);
    }

    /// Distances along the ray; not finite or no number along the plane.
    #[inline(always)]
    #[must_use]
    pub fn meet(&self, ray: &FourRays) -> f64x4 {
        dot(&minus(&self.point, &ray.origin), &self.normal) / dot(&ray.direction, &self.normal)
    }
}

impl FourRays {
    /// One over the directions.
    #[inline(always)]
    #[must_use]
    pub fn inverse(&self) -> Vec4 {
        let [x, y, z] = self.direction;
        let one = f64x4::splat(1.0);
        [one / x, one / y, one / z]
    }
}

/// Cubes.
#[derive(Clone, Debug)]
pub struct Cubes {
    center: Vec4,
    duals: [Vec4; 3],
}

impl Cubes {
    /// A block of nothing.
    pub const EMPTY: Cubes = Cubes { center: [f64x4::ZERO; 3], duals: [[f64x4::ZERO; 3]; 3] };

    /// Puts a cube into a lane.
    pub fn put(&mut self, lane: usize, cube: &Cube) {
        set(&mut self.center, lane, cube.center);
        for (lanes, dual) in self.duals.iter_mut().zip(cube.duals()) {
            set(lanes, lane, dual);
        }
    }

    /// Distances along rays that do not start on the cubes, the faces that are met, and in which lanes one is, at any
    /// distance: the steps of `shape::span::Span`.
    #[inline(always)]
    #[must_use]
    pub fn meet(&self, ray: &FourRays) -> (f64x4, f64x4, f64x4) {
        const ZERO: f64x4 = f64x4::ZERO;
        const ONE: f64x4 = f64x4::splat(1.0);
        let d = &ray.direction;
        let oc = minus(&ray.origin, &self.center);
        let shift = -dot(&oc, d);
        let start = near(&oc, d, shift);
        let (mut enter, mut exit) = (f64x4::splat(f64::NEG_INFINITY), f64x4::splat(f64::INFINITY));
        let (mut enter_face, mut exit_face) = (ZERO, ZERO);
        let mut within = enter.simd_lt(exit);
        for (dual, face) in self.duals.iter().zip([0.0, 2.0, 4.0]) {
            let (o, d) = (dot(dual, &start), dot(dual, d));
            let (low, high) = ((-ONE - o) / d, (ONE - o) / d);
            let (low_face, high_face) = (f64x4::splat(face), f64x4::splat(face + 1.0));
            let (along, against) = (d.simd_gt(ZERO), d.simd_lt(ZERO));
            // What runs beside a slab is in it all the way or never.
            let moves = along | against;
            within &= moves | (o.simd_ge(-ONE) & o.simd_le(ONE));
            let first = against.select(high, low);
            let later = moves & first.simd_gt(enter);
            enter = later.select(first, enter);
            enter_face = later.select(against.select(high_face, low_face), enter_face);
            let last = against.select(low, high);
            let earlier = moves & last.simd_lt(exit);
            exit = earlier.select(last, exit);
            exit_face = earlier.select(against.select(low_face, high_face), exit_face);
        }
        let entry = shift + enter;
        let before = entry.simd_gt(ZERO);
        (before.select(entry, shift + exit), before.select(enter_face, exit_face), within & enter.simd_le(exit))
    }
}

/// Boxes around other things, which a ray is tried with one by one where it meets the box.
#[derive(Clone, Debug)]
pub struct Boxes {
    /// Low x, high x, low y, high y, low z, high z.
    planes: [f64x4; 6],
}

/// A ray, ready for boxes.
#[derive(Clone, Copy, Debug)]
pub struct BoxRay {
    origin: Vec4,
    inverse: Vec4,
    /// Which of [`Boxes::planes`] is nearer.
    near: [usize; 3],
}

impl BoxRay {
    /// `ray` in each lane.
    #[inline(always)]
    #[must_use]
    pub fn new(ray: &Ray, lanes: &FourRays) -> BoxRay {
        let d = ray.direction;
        let inverse = (f64x4::splat(1.0) / f64x4::new([d.x, d.y, d.z, 1.0])).to_array();
        let back = |axis: usize| 2 * axis + usize::from(inverse[axis] < 0.0);
        let splat = |axis: usize| f64x4::splat(inverse[axis]);
        BoxRay { origin: lanes.origin, inverse: [splat(0), splat(1), splat(2)], near: [back(0), back(1), back(2)] }
    }
}

impl Boxes {
    /// A block of nothing.
    pub const EMPTY: Boxes = {
        let (low, high) = (f64x4::splat(f64::INFINITY), f64x4::splat(f64::NEG_INFINITY));
        Boxes { planes: [low, high, low, high, low, high] }
    };

    /// Puts the box from `min` to `max` into a lane, larger by 2⁻²⁴ of its coordinates and of its size: that much an
    /// intersector may be off, as in [`crate::scene::bvh`].
    pub fn put(&mut self, lane: usize, min: DVec3, max: DVec3) {
        const PAD: f64 = 1.0 / (1u64 << 24) as f64;
        let pad = min.abs().max(max.abs()).max_element() * PAD;
        for axis in 0..3 {
            self.planes[2 * axis].as_mut_array()[lane] = min[axis] - pad;
            self.planes[2 * axis + 1].as_mut_array()[lane] = max[axis] + pad;
        }
    }

    /// Where the ray enters the boxes, and whether it does so before `t_max`.
    ///
    /// A distance has three roundings, of difference, reciprocal and product, so that it is off by 2⁻⁵¹ of itself: that
    /// and the rounding of what intersectors answer is less than 2⁻⁴⁰. A ray in the very plane of a face gives 0·∞,
    /// which counts as within.
    #[inline(always)]
    #[must_use]
    pub fn meet(&self, ray: &BoxRay, t_max: f64x4) -> (f64x4, f64x4) {
        let near = |axis: usize| (self.planes[ray.near[axis]], self.planes[ray.near[axis] ^ 1]);
        Boxes::pass(&ray.origin, &ray.inverse, [near(0), near(1), near(2)], t_max)
    }

    /// [`Boxes::meet`] of four rays with the box of each lane.
    #[inline(always)]
    #[must_use]
    pub fn meet_four(&self, rays: &FourRays, inverse: &Vec4, t_max: f64x4) -> (f64x4, f64x4) {
        let near = |axis: usize| {
            let (low, high) = (self.planes[2 * axis], self.planes[2 * axis + 1]);
            let back = inverse[axis].simd_lt(f64x4::ZERO);
            (back.select(high, low), back.select(low, high))
        };
        Boxes::pass(&rays.origin, inverse, [near(0), near(1), near(2)], t_max)
    }

    /// Where rays pass between the nearer and farther planes of each axis.
    #[inline(always)]
    fn pass(origin: &Vec4, inverse: &Vec4, planes: [(f64x4, f64x4); 3], t_max: f64x4) -> (f64x4, f64x4) {
        const SLACK: f64 = 1.0 + 1.0 / (1u64 << 40) as f64;
        let to = |axis: usize, side: usize| {
            let (near, far) = planes[axis];
            ((if side == 0 { near } else { far }) - origin[axis]) * inverse[axis]
        };
        // Of a number and none the second operand is taken.
        let enter = to(0, 0).fast_max(to(1, 0).fast_max(to(2, 0).fast_max(f64x4::ZERO)));
        let leave = to(0, 1).fast_min(to(1, 1).fast_min(to(2, 1).fast_min(t_max)));
        (enter, enter.simd_le(leave * f64x4::splat(SLACK)))
    }
}
