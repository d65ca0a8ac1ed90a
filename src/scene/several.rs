//! Four rays at once through a scene of few things: each thing is tried with all four by one run of instructions.
//!
//! The steps are those of [`super::few`], with rays in the lanes in place of shapes, so that the bits are the same.

use super::bvh::Aabb;
use super::few::{NONE, NOWHERE};
use super::shape::Shape;
use super::shape::four::{Boxes, Cubes, FourRays, Patches, Planes, Spheres};
use super::{Geometry, Hit, Nearest, Object, Scene};
use crate::math::{Departure, Ray};
use wide::f64x4;

/// The things of a scene of few, each in all lanes.
#[derive(Clone, Debug, Default)]
pub(super) struct Apart {
    patches: Vec<One<Patches>>,
    spheres: Vec<One<Spheres>>,
    planes: Vec<One<Planes>>,
    cubes: Vec<One<Cubes>>,
    boxes: Vec<One<Boxes>>,
}

/// A thing in all lanes.
#[derive(Clone, Debug)]
struct One<T> {
    object: u32,
    /// The same in all lanes.
    index: f64x4,
    lanes: T,
}

fn add<T>(all: &mut Vec<One<T>>, object: u32, mut lanes: T, put: impl Fn(&mut T, usize)) {
    (0..4).for_each(|lane| put(&mut lanes, lane));
    all.push(One { object, index: f64x4::splat(f64::from(object)), lanes });
}

/// What is met by four rays at once.
struct Met {
    t: f64x4,
    /// Of the rays, which meet it at a positive distance.
    hit: f64x4,
    face: f64x4,
    object: f64x4,
}

impl Apart {
    pub(super) fn new(objects: &[Object], indices: &[u32], boxes: &[Aabb]) -> Apart {
        let mut all = Apart::default();
        for &index in indices {
            match &objects[index as usize].geometry {
                Geometry::Shape(Shape::Rectangle(shape)) => {
                    add(&mut all.patches, index, Patches::EMPTY, |block, lane| block.put_rectangle(lane, shape));
                }
                Geometry::Shape(Shape::Disk(shape)) => {
                    add(&mut all.patches, index, Patches::EMPTY, |block, lane| block.put_disk(lane, shape));
                }
                Geometry::Shape(Shape::Sphere(shape)) => {
                    add(&mut all.spheres, index, Spheres::EMPTY, |block, lane| block.put(lane, shape));
                }
                Geometry::Shape(Shape::Plane(shape)) => {
                    add(&mut all.planes, index, Planes::EMPTY, |block, lane| block.put(lane, shape));
                }
                Geometry::Shape(Shape::Cube(shape)) => {
                    add(&mut all.cubes, index, Cubes::EMPTY, |block, lane| block.put(lane, shape));
                }
                _ => {
                    let Aabb { min, max } = boxes[index as usize];
                    add(&mut all.boxes, index, Boxes::EMPTY, |block, lane| block.put(lane, min, max));
                }
            }
        }
        all
    }

    /// Shows `met` what rays that leave the objects `departing` meet of things with a place in the lanes, until it says
    /// stop. A cube that a ray leaves is not among them.
    #[inline(always)]
    fn each(&self, rays: &FourRays, departing: f64x4, mut met: impl FnMut(Met) -> bool) {
        const ZERO: f64x4 = f64x4::ZERO;
        for &One { index: object, ref lanes, .. } in &self.patches {
            let (t, within) = lanes.meet(rays);
            let hit = within & object.simd_ne(departing) & t.simd_gt(ZERO);
            if met(Met { t, hit, face: ZERO, object }) {
                return;
            }
        }
        for &One { index: object, ref lanes, .. } in &self.spheres {
            let t = lanes.meet(rays, object.simd_eq(departing));
            if met(Met { t, hit: t.simd_gt(ZERO), face: ZERO, object }) {
                return;
            }
        }
        for &One { index: object, ref lanes, .. } in &self.planes {
            let t = lanes.meet(rays);
            if met(Met { t, hit: object.simd_ne(departing) & t.simd_gt(ZERO), face: ZERO, object }) {
                return;
            }
        }
        for &One { index: object, ref lanes, .. } in &self.cubes {
            let (t, face, within) = lanes.meet(rays);
            if met(Met { t, hit: within & object.simd_ne(departing) & t.simd_gt(ZERO), face, object }) {
                return;
            }
        }
    }

    /// Shows `visit` the rays of `wanted` and the objects that they may meet, of those that have no place in the lanes,
    /// nearer than `reach`.
    #[inline(always)]
    fn each_alone(
        &self,
        rays: &FourRays,
        departing: f64x4,
        wanted: u32,
        reach: f64x4,
        mut visit: impl FnMut(usize, u32),
    ) {
        for One { object, index, .. } in &self.cubes {
            let leaves = departing.simd_eq(*index);
            lanes_of(leaves.to_bitmask() & wanted).for_each(|lane| visit(lane, *object));
        }
        if !self.boxes.is_empty() {
            let inverse = rays.inverse();
            for One { object, lanes, .. } in &self.boxes {
                let (_, near) = lanes.meet_four(rays, &inverse, reach);
                lanes_of(near.to_bitmask() & wanted).for_each(|lane| visit(lane, *object));
            }
        }
    }
}

/// The lanes of a mask.
#[inline(always)]
fn lanes_of(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < 4).then_some(lane)
    })
}

#[inline(always)]
fn departures([a, b, c, d]: [&Ray; 4]) -> f64x4 {
    let of = |ray: &Ray| ray.departure.map_or(NOWHERE, |d| f64::from(d.object));
    f64x4::new([of(a), of(b), of(c), of(d)])
}

impl Scene {
    /// [`Scene::closest`] of the first `count` of four rays.
    pub fn closest_of_four(&self, rays: [&Ray; 4], t_max: [f64; 4], count: usize, hits: &mut [Option<Hit>]) {
        let Some(few) = self.few.as_ref().filter(|_| count > 1) else {
            for (lane, hit) in hits.iter_mut().enumerate().take(count) {
                *hit = self.closest(rays[lane], t_max[lane]);
            }
            return;
        };
        let lanes = FourRays::of(rays);
        let departing = departures(rays);
        // Of each ray the nearest, and of several as near the first; all that is nearer than `t_max`.
        let limits = if t_max == [f64::INFINITY; 4] { [f64::MAX; 4] } else { t_max.map(f64::next_down) };
        let (mut nearest, mut first) = (f64x4::new(limits), f64x4::splat(f64::INFINITY));
        let mut face = f64x4::ZERO;
        few.apart.each(&lanes, departing, |met| {
            let before = met.t.simd_lt(nearest) | (met.t.simd_eq(nearest) & met.object.simd_lt(first));
            let closer = met.hit & before;
            nearest = closer.select(met.t, nearest);
            first = closer.select(met.object, first);
            face = closer.select(met.face, face);
            false
        });
        let (t, object, part) = (nearest.to_array(), first.to_array(), face.to_array());
        for (lane, hit) in hits.iter_mut().enumerate().take(count) {
            *hit = (object[lane] < f64::INFINITY).then(|| Hit {
                t: t[lane],
                object: object[lane] as u32,
                part: part[lane] as u32,
                barycentric: [0.0; 2],
                instance: None,
            });
        }
        few.apart.each_alone(&lanes, departing, (1 << count) - 1, nearest, |lane, object| {
            let mut best = hits[lane].map_or(Nearest { hit: None, reach: t_max[lane] }, Nearest::of);
            self.meet_nearer(rays[lane], object, &mut best);
            hits[lane] = best.hit;
        });
        if let Some(together) = &self.together {
            for (lane, hit) in hits.iter_mut().enumerate().take(count) {
                let reach = hit.map_or(t_max[lane], |hit| hit.t);
                *hit = together.closest(rays[lane], reach).or(*hit);
            }
        }
    }

    /// [`Scene::occluded`] of the first `count` of four rays: one bit each.
    #[must_use]
    pub fn occluded_of_four(
        &self,
        rays: [&Ray; 4],
        distances: [f64; 4],
        targets: [Option<Departure>; 4],
        count: usize,
    ) -> u32 {
        let alone = |lane: usize| u32::from(self.occluded(rays[lane], distances[lane], targets[lane])) << lane;
        // A lamp that may hide itself is met one by one.
        let aimed = targets.map(|target| self.aimed(target));
        let hides = |object: u32| {
            let object = &self.objects[object as usize];
            object.flipped || !matches!(object.geometry, Geometry::Shape(_))
        };
        let few = self.few.as_ref().filter(|_| count > 1);
        let Some(few) = few.filter(|_| !aimed.into_iter().flatten().any(hides)) else {
            return (0..count).map(alone).sum();
        };
        let lanes = FourRays::of(rays);
        let departing = departures(rays);
        let (reach, wanted) = (f64x4::new(distances), (1 << count) - 1);
        let aims = f64x4::new(aimed.map(|object| object.map_or(NONE, f64::from)));
        let mut hidden = 0;
        few.apart.each(&lanes, departing, |met| {
            let hit = met.hit & met.t.simd_lt(reach) & met.object.simd_ne(aims);
            hidden |= hit.to_bitmask();
            hidden & wanted == wanted
        });
        let open = wanted & !hidden;
        if open != 0 {
            few.apart.each_alone(&lanes, departing, open, reach, |lane, object| {
                if aimed[lane] != Some(object) && self.blocks(rays[lane], object, distances[lane], targets[lane]) {
                    hidden |= 1 << lane;
                }
            });
        }
        if let Some(together) = &self.together {
            for lane in lanes_of(wanted & !hidden) {
                let stopped = together.any(rays[lane], distances[lane], targets[lane], |_| true);
                hidden |= u32::from(stopped) << lane;
            }
        }
        hidden & wanted
    }
}

#[cfg(test)]
mod tests {
    use super::super::few::tests::{bits, scene};
    use crate::math::{Departure, Ray};
    use crate::scene::shape::testing::Random;
    use glam::DVec3;

    /// Rays from anywhere and along axes, and on from what was met, which starts them on a face, some of them into the
    /// solid: two to four at once meet the same things at distances of the same bits as each alone, and the same ones are
    /// stopped on their way to a target.
    #[test]
    fn rays_side_by_side_meet_the_same_bits_as_alone() {
        let mut random = Random::new(12);
        let (mut met, mut stopped) = (0, 0);
        for count in [1, 3, 7, 16] {
            let scene = scene(count, &mut random);
            let mut rays = [Ray::new(DVec3::ZERO, DVec3::X); 4];
            for i in 0..3_000 {
                for (lane, ray) in rays.iter_mut().enumerate() {
                    if random.uniform() < 0.3 {
                        let axis = DVec3::AXES[i % 3] * if random.uniform() < 0.5 { -1.0 } else { 1.0 };
                        let origin = random.direction() * random.log_uniform(-1.0, 2.0);
                        let toward = random.direction() * 4.0 * random.uniform() - origin;
                        *ray = Ray::new(origin, if lane == 0 { axis } else { toward.normalize() });
                    }
                }
                let all = [&rays[0], &rays[1], &rays[2], &rays[3]];
                let together = 2 + i % 3;
                let far: [f64; 4] = std::array::from_fn(|_| match random.uniform() < 0.5 {
                    true => f64::INFINITY,
                    false => 5.0 * random.uniform(),
                });
                let mut hits = [None; 4];
                scene.closest_of_four(all, far, together, &mut hits);
                let targets: [Option<Departure>; 4] = std::array::from_fn(|_| {
                    let object = (random.uniform() * count as f64) as u32;
                    (random.uniform() < 0.7).then(|| Departure::new(object, 0))
                });
                let hidden = scene.occluded_of_four(all, far, targets, together);
                for lane in 0..together {
                    let expected = scene.closest(all[lane], far[lane]);
                    assert_eq!(bits(hits[lane]), bits(expected), "{:?}", all[lane]);
                    let alone = scene.occluded(all[lane], far[lane], targets[lane]);
                    assert_eq!(hidden >> lane & 1 == 1, alone, "{:?} {:?}", all[lane], targets[lane]);
                    stopped += u32::from(alone);
                }
                for lane in 0..together {
                    if let Some(hit) = hits[lane] {
                        met += 1;
                        let surface = scene.surface(&rays[lane], &hit);
                        rays[lane] = scene.leave(&surface, &hit, random.direction());
                    }
                }
            }
        }
        assert!(met > 5_000 && stopped > 2_000, "{met} {stopped}");
    }
}
