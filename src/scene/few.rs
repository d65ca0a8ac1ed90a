//! Scenes of few things: all are tried, four at a time, instead of a tree.
//!
//! A ray is not made ready for a tree and no node is read. Patches, spheres and planes are met side by side
//! ([`super::shape::four`]); of everything else the boxes are, and what is in them is met one by one.

use super::bvh::Aabb;
use super::several::Apart;
use super::shape::Shape;
use super::shape::four::{BoxRay, Boxes, FourRays, Patches, Planes, Spheres};
use super::{Geometry, Hit, Nearest, Object};
use crate::math::Ray;
use wide::f64x4;

/// How many things are few: of rectangles, spheres and planes as many are met as fast as a tree is searched.
const MOST: usize = 16;
/// How many that are met one by one are few: their boxes are met side by side.
const FEW_ALONE: usize = 4;

/// Names no object: less than all.
pub(super) const NONE: f64 = -1.0;
/// Where a ray starts that leaves nothing; not equal to a lane of nothing.
pub(super) const NOWHERE: f64 = -2.0;

/// What stands in a scene of few things.
#[derive(Clone, Debug, Default)]
pub struct Few {
    patches: Vec<Block<Patches>>,
    spheres: Vec<Block<Spheres>>,
    planes: Vec<Block<Planes>>,
    boxes: Vec<Block<Boxes>>,
    /// Each by itself, for four rays at once.
    pub(super) apart: Apart,
}

/// Four of a kind.
#[derive(Clone, Debug)]
struct Block<T> {
    /// Indices of the objects: exact, so that they are compared and chosen in lanes like distances.
    objects: f64x4,
    lanes: T,
}

/// Gives `object` the first free lane, in a new block where there is none, and lets `put` fill it.
fn add<T>(blocks: &mut Vec<Block<T>>, object: u32, empty: T, put: impl FnOnce(&mut T, usize)) {
    let free = |block: &Block<T>| block.objects.as_array().iter().position(|&object| object == NONE);
    let lane = blocks.last().and_then(free).unwrap_or_else(|| {
        blocks.push(Block { objects: f64x4::splat(NONE), lanes: empty });
        0
    });
    if let Some(block) = blocks.last_mut() {
        block.objects.as_mut_array()[lane] = f64::from(object);
        put(&mut block.lanes, lane);
    }
}

impl Few {
    /// `indices` are of the `objects` that are searched; `boxes` are all objects'. None where they are not few, and where
    /// most of more than four are met one by one, whose boxes a tree finds as fast.
    #[must_use]
    pub fn of(objects: &[Object], indices: &[u32], boxes: &[Aabb]) -> Option<Few> {
        if cfg!(feature = "single_precision") {
            // What is measured there are the shapes' own intersectors.
            return None;
        }
        let alone = |index: &&u32| match &objects[**index as usize].geometry {
            Geometry::Shape(shape) => matches!(shape, Shape::Cube(_) | Shape::Cylinder(_) | Shape::Cone(_)),
            _ => true,
        };
        let most_alone = (indices.len() / 2).max(FEW_ALONE);
        let few = (1..=MOST).contains(&indices.len()) && indices.iter().filter(alone).count() <= most_alone;
        few.then(|| Few::new(objects, indices, boxes))
    }

    fn new(objects: &[Object], indices: &[u32], boxes: &[Aabb]) -> Few {
        let mut few = Few { apart: Apart::new(objects, indices, boxes), ..Few::default() };
        for &index in indices {
            match &objects[index as usize].geometry {
                Geometry::Shape(Shape::Rectangle(shape)) => {
                    add(&mut few.patches, index, Patches::EMPTY, |block, lane| block.put_rectangle(lane, shape));
                }
                Geometry::Shape(Shape::Disk(shape)) => {
                    add(&mut few.patches, index, Patches::EMPTY, |block, lane| block.put_disk(lane, shape));
                }
                Geometry::Shape(Shape::Sphere(shape)) => {
                    add(&mut few.spheres, index, Spheres::EMPTY, |block, lane| block.put(lane, shape));
                }
                Geometry::Shape(Shape::Plane(shape)) => {
                    add(&mut few.planes, index, Planes::EMPTY, |block, lane| block.put(lane, shape));
                }
                _ => {
                    let Aabb { min, max } = boxes[index as usize];
                    add(&mut few.boxes, index, Boxes::EMPTY, |block, lane| block.put(lane, min, max));
                }
            }
        }
        few
    }

    /// Shows `met` the distances along `ray` to what is met side by side, in which lanes there is a hit at a positive
    /// distance unless that is too far, and the indices of the objects; until it says stop.
    #[inline(always)]
    fn side_by_side(&self, ray: &Ray, lanes: &FourRays, mut met: impl FnMut(f64x4, f64x4, f64x4) -> bool) -> bool {
        const ZERO: f64x4 = f64x4::ZERO;
        let departing = f64x4::splat(ray.departure.map_or(NOWHERE, |d| f64::from(d.object)));
        for block in &self.patches {
            let (t, within) = block.lanes.meet(lanes);
            let elsewhere = block.objects.simd_ne(departing);
            if met(t, within & elsewhere & t.simd_gt(ZERO), block.objects) {
                return true;
            }
        }
        for block in &self.spheres {
            let t = block.lanes.meet(lanes, block.objects.simd_eq(departing));
            if met(t, t.simd_gt(ZERO), block.objects) {
                return true;
            }
        }
        for block in &self.planes {
            let t = block.lanes.meet(lanes);
            if met(t, block.objects.simd_ne(departing) & t.simd_gt(ZERO), block.objects) {
                return true;
            }
        }
        false
    }

    /// The nearest thing that `ray` meets closer than `t_max`; of things at the same distance the first. `meet` tries one
    /// object.
    #[inline]
    pub(super) fn closest(&self, ray: &Ray, t_max: f64, mut meet: impl FnMut(u32, &mut Nearest)) -> Option<Hit> {
        let lanes = FourRays::new(ray);
        // In each lane the nearest, and of several as near the first; all that is nearer than `t_max`.
        let (mut nearest, mut first) = (f64x4::splat(t_max.next_down()), f64x4::splat(f64::INFINITY));
        self.side_by_side(ray, &lanes, |t, hit, objects| {
            let before = t.simd_lt(nearest) | (t.simd_eq(nearest) & objects.simd_lt(first));
            let closer = hit & before;
            nearest = closer.select(t, nearest);
            first = closer.select(objects, first);
            false
        });
        let t = least(nearest);
        let object = least(nearest.simd_eq(f64x4::splat(t)).select(first, f64x4::splat(f64::INFINITY)));
        let met = Hit { t, object: object as u32, part: 0, barycentric: [0.0; 2], instance: None };
        let mut best = if object < f64::INFINITY { Nearest::of(met) } else { Nearest { hit: None, reach: t_max } };
        if !self.boxes.is_empty() {
            let ray = BoxRay::new(ray, &lanes);
            for block in &self.boxes {
                let (_, near) = block.lanes.meet(&ray, f64x4::splat(best.reach));
                for object in of_lanes(near.to_bitmask(), block.objects) {
                    meet(object, &mut best);
                }
            }
        }
        best.hit
    }

    /// Whether `visit` says yes to anything but `aimed` that `ray` may meet within `t_max`. It is told the object and
    /// whether it is met for sure.
    #[inline]
    pub fn any(&self, ray: &Ray, t_max: f64, aimed: Option<u32>, mut visit: impl FnMut(u32, bool) -> bool) -> bool {
        let lanes = FourRays::new(ray);
        let target = f64x4::splat(aimed.map_or(NONE, f64::from));
        let stopped = self.side_by_side(ray, &lanes, |t, hit, objects| {
            let hit = hit & t.simd_lt(f64x4::splat(t_max)) & objects.simd_ne(target);
            of_lanes(hit.to_bitmask(), objects).any(|object| visit(object, true))
        });
        if stopped {
            return true;
        }
        if !self.boxes.is_empty() {
            let ray = BoxRay::new(ray, &lanes);
            for block in &self.boxes {
                let (_, near) = block.lanes.meet(&ray, f64x4::splat(t_max));
                let near = near & block.objects.simd_ne(target);
                if of_lanes(near.to_bitmask(), block.objects).any(|object| visit(object, false)) {
                    return true;
                }
            }
        }
        false
    }
}

/// The least of four numbers.
#[inline(always)]
fn least(lanes: f64x4) -> f64 {
    let [a, b, c, d] = lanes.to_array();
    let less = |a: f64, b: f64| if a < b { a } else { b };
    less(less(a, b), less(c, d))
}

/// The objects in the lanes of `mask`.
#[inline(always)]
fn of_lanes(mut mask: u32, objects: f64x4) -> impl Iterator<Item = u32> {
    let objects = objects.to_array();
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        objects.get(lane).map(|&object| object as u32)
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::math::Departure;
    use crate::scene::Scene;
    use crate::scene::bvh::Bvh;
    use crate::scene::compile::testing::compiled;
    use crate::scene::shape::testing::{KINDS, Random, random_shape};
    use crate::scene::through::Way;
    use glam::DVec3;

    /// `count` shapes of all kinds that overlap, every third the same as the one before; half of them let light through.
    pub(in crate::scene) fn scene(count: usize, random: &mut Random) -> Scene {
        let mut text = String::from("camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nshapes:\n");
        for i in 0..count {
            let material = if i / 3 % 2 == 0 { "diffuse" } else { "boundary" };
            text += &format!("- sphere: {{radius: 1, material: {{{material}: {{}}}}}}\n");
        }
        let mut scene = compiled(&text);
        for i in 0..count {
            let (center, size) = (random.direction() * 4.0 * random.uniform(), random.log_uniform(-1.0, 0.3));
            let shape = random_shape((random.uniform() * KINDS as f64) as usize, center, size, random);
            scene.objects[i].geometry = match (&scene.objects[i.saturating_sub(1)].geometry, i % 3) {
                (Geometry::Shape(before), 2) => Geometry::Shape(before.clone()),
                _ => Geometry::Shape(shape),
            };
            scene.objects[i].flipped = random.uniform() < 0.5;
        }
        let boxes: Vec<Aabb> = scene.objects.iter().map(Object::bounds).collect();
        let all: Vec<u32> = (0..count as u32).collect();
        scene.bvh = Bvh::build(&boxes);
        scene.few = Some(Few::new(&scene.objects, &all, &boxes));
        scene
    }

    pub(in crate::scene) type Bits = Option<(u64, u32, u32)>;

    pub(in crate::scene) fn bits(hit: Option<Hit>) -> Bits {
        hit.map(|hit| (hit.t.to_bits(), hit.object, hit.part))
    }

    /// All shapes one by one; of those at the same distance the first.
    fn one_by_one(scene: &Scene, ray: &Ray, t_max: f64) -> Option<Hit> {
        (0..scene.objects.len() as u32)
            .fold(None, |best: Option<Hit>, object| scene.meet(ray, object, best.map_or(t_max, |b| b.t)).or(best))
    }

    /// Rays from anywhere, along axes, toward the edges and middles of shapes, and on from what was met last, which starts
    /// them on a face: the distance has the same bits, and the same object and face are met, one by one, four at a
    /// time and through the tree. A limit that is a distance itself excludes it.
    #[test]
    fn every_way_of_searching_finds_the_same_bits() {
        let mut random = Random::new(11);
        let (mut met, mut shared, mut hidden, mut open) = (0, 0, [0; 2], [0; 2]);
        for count in [1, 2, 4, 5, 7, 9, 16, 31, 32] {
            let mut scene = scene(count, &mut random);
            let mut ray = Ray::new(DVec3::ZERO, DVec3::X);
            for i in 0..4_000 {
                if i % 4 == 0 {
                    let origin = random.direction() * random.log_uniform(-1.0, 2.0);
                    let axis = DVec3::AXES[i / 4 % 3] * if random.uniform() < 0.5 { -1.0 } else { 1.0 };
                    let toward = random.direction() * 4.0 * random.uniform();
                    ray = Ray::new(origin, if i % 16 == 0 { axis } else { (toward - origin).normalize() });
                }
                let far = if random.uniform() < 0.5 { f64::INFINITY } else { 5.0 * random.uniform() };
                let expected = one_by_one(&scene, &ray, far);
                let few = scene.few.take();
                let by_tree = scene.closest(&ray, far);
                scene.few = few;
                assert_eq!(bits(scene.closest(&ray, far)), bits(expected), "{ray:?}");
                assert_eq!(bits(by_tree), bits(expected), "{ray:?}");
                let Some(hit) = expected else { continue };
                met += 1;
                shared += u32::from(scene.objects.iter().zip(0..).any(|(_, other)| {
                    other != hit.object && scene.meet(&ray, other, f64::INFINITY).is_some_and(|o| o.t == hit.t)
                }));
                let nearer = one_by_one(&scene, &ray, hit.t);
                assert!(nearer.is_none());
                assert_eq!(bits(scene.closest(&ray, hit.t)), None);

                // What stands between, up to any object.
                let target = (random.uniform() < 0.7)
                    .then(|| Departure::new((random.uniform() * count as f64) as u32, 0))
                    .or(Some(hit.departure()).filter(|_| random.uniform() < 0.5));
                let distance = hit.t * random.range(0.5, 3.0);
                let answers =
                    |scene: &Scene| (scene.occluded(&ray, distance, target), scene.way(&ray, distance, target));
                let few = scene.few.take();
                let (blocked, way) = answers(&scene);
                scene.few = few;
                let (found, found_way) = answers(&scene);
                assert_eq!(found, blocked, "{ray:?} {target:?}");
                hidden[usize::from(found)] += 1;
                let crossed = |way: Way| match way {
                    Way::Open(crossed) => {
                        Some(crossed.hits().iter().map(|&hit| bits(Some(hit))).collect::<Vec<Bits>>())
                    }
                    Way::Blocked | Way::Long => None,
                };
                let (way, found_way) = (crossed(way), crossed(found_way));
                assert_eq!(found_way, way, "{ray:?} {target:?}");
                open[usize::from(way.is_some_and(|hits| !hits.is_empty()))] += 1;

                let surface = scene.surface(&ray, &hit);
                ray = scene.leave(&surface, &hit, random.direction());
            }
        }
        let enough = hidden.into_iter().chain(open).all(|n| n > 2_000);
        assert!(met > 8_000 && shared > 2_000 && enough, "{met} {shared} {hidden:?} {open:?}");
    }

    /// Spheres up to the limit are few, one more are not; nor are more than four cubes, of which a tree finds the boxes as
    /// fast, unless there are as many spheres.
    #[test]
    fn more_than_few_are_searched_by_the_tree() {
        let compiled = |spheres: usize, cubes: usize| {
            let mut text = String::from("camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nshapes:\n");
            text += &"- sphere: {radius: 1}\n".repeat(spheres);
            text += &"- cube: {size: [1, 1, 1]}\n".repeat(cubes);
            compiled(&text)
        };
        let few = [(1, 0), (MOST, 0), (MOST + 1, 0), (0, 4), (0, 5), (5, 5), (4, 5)];
        let found = few.map(|(spheres, cubes)| compiled(spheres, cubes).few.is_some());
        assert_eq!(found, [true, true, false, true, false, true, false]);
    }
}
