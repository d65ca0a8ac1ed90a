//! Bodies that overlap: which of them a point belongs to.
//!
//! A glass of water is two bodies whose surfaces should share a place, which rounding does not let them: a film of air
//! or of neither would lie between. So bodies overlap, and where they do the one of higher priority has the space
//! (Schmidt and Budge 2002, "Simple Nested Dielectrics in Ray Traced Images"). A path keeps the list of the bodies that
//! it is in. Of a surface that it meets it asks who is the strongest of the *other* bodies there: if that is stronger
//! than the surface's own body, nothing changes at the surface, and the path goes straight through; else light passes
//! between the two, by the ratio of their indices.
//!
//! Bodies are ranked by priority; of equal ones that comes first that was written first. Parts of one body that overlap,
//! and copies of one, are one body: the list counts how often the path is in it.

use super::bvh::Aabb;
use super::{Geometry, Object, Scene, SurfacePoint};
use crate::math::Ray;
use crate::scene::shape::{Detail, Shape};
use crate::spectrum::RefractiveIndex;
use glam::DVec3;
use std::collections::HashMap;

/// Bodies that a path is in at one time; of more the weakest are forgotten.
const MOST: usize = 8;

/// Surfaces that are counted to find out what a point is in.
const MOST_SURFACES: u32 = 1 << 16;

/// A body with a priority.
#[derive(Clone, Debug)]
pub struct Body {
    /// The object that it is.
    pub object: u32,
    /// Its priority.
    pub priority: i32,
    /// Its index.
    pub index: RefractiveIndex,
    /// The medium within.
    pub medium: Option<u32>,
    /// Bodies of one kind have the same index, and between them light notices nothing; 0 is empty space, and none for
    /// a body whose surface shows by more than its index.
    kind: Option<u32>,
}

/// The bodies of a scene, from the weakest to the strongest.
#[derive(Clone, Debug, Default)]
pub struct Nested {
    bodies: Vec<Body>,
    /// Objects that stand in the scene itself and are such, or copy such, and their boxes.
    holders: Vec<(u32, Aabb)>,
}

/// The bodies that a point is in: their ranks from 1, the strongest first; 0 for none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bodies([u32; MOST]);

/// What a path is in.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inside {
    /// The medium.
    pub medium: Option<u32>,
    /// The bodies with a priority.
    pub bodies: Bodies,
}

impl Inside {
    /// In no medium and no body.
    pub const NOTHING: Inside = Inside { medium: None, bodies: Bodies([0; MOST]) };
}

/// How a path meets the surface of a body.
#[derive(Clone, Copy, Debug)]
pub struct Crossing<'a> {
    /// Whether light notices the surface.
    pub shows: bool,
    /// The index on the outside; that of the material itself for none.
    pub around: Option<&'a RefractiveIndex>,
    /// The bodies on the side from where the path comes.
    pub here: Bodies,
}

impl Bodies {
    /// None.
    pub const NONE: Bodies = Bodies([0; MOST]);

    /// The rank of the strongest; 0 for none.
    #[must_use]
    pub fn strongest(&self) -> u32 {
        self.0[0]
    }

    /// With one more.
    #[must_use]
    fn with(&self, rank: u32) -> Bodies {
        let mut all = self.0;
        let mut carried = rank;
        for place in &mut all {
            if *place < carried {
                std::mem::swap(place, &mut carried);
            }
        }
        Bodies(all)
    }

    /// With one less, if it is among them.
    #[must_use]
    fn without(&self, rank: u32) -> Bodies {
        let Some(at) = self.0.iter().position(|r| *r == rank) else { return *self };
        let mut all = self.0;
        all.copy_within(at + 1.., at);
        all[MOST - 1] = 0;
        Bodies(all)
    }
}

impl Nested {
    /// Ranks the bodies of `objects`, of which the first `alone` stand in the scene itself. `of` tells an object's
    /// priority, its index, and whether its surface shows by more than that.
    pub(super) fn of(
        objects: &mut [Object],
        alone: usize,
        of: impl Fn(&Object) -> Option<(i32, RefractiveIndex, bool)>,
    ) -> Nested {
        let found = objects.iter().zip(0u32..).filter_map(|(o, i)| of(o).map(|(p, index, shows)| (p, i, index, shows)));
        let mut all: Vec<(i32, u32, RefractiveIndex, bool)> = found.collect();
        all.sort_by_key(|(priority, object, ..)| (*priority, std::cmp::Reverse(*object)));
        // By all their numbers.
        let in_text = |index: &RefractiveIndex| format!("{index:?}");
        let mut kinds = HashMap::from([(in_text(&RefractiveIndex::Constant(1.0)), 0)]);
        let mut nested = Nested::default();
        for ((priority, object, index, shows), rank) in all.into_iter().zip(1..) {
            let kind = (!shows).then(|| {
                let next = kinds.len() as u32;
                *kinds.entry(in_text(&index)).or_insert(next)
            });
            let owner = &mut objects[object as usize];
            owner.body = rank;
            nested.bodies.push(Body { object, priority, index, medium: owner.inside, kind });
        }
        // Groups are looked through once, however many copies they have.
        let mut groups: HashMap<u32, bool> = HashMap::new();
        let mut holds = |object: &Object| match &object.geometry {
            Geometry::Instance(instance) => {
                let any = || objects[instance.group.members()].iter().any(|child| child.body != 0);
                *groups.entry(instance.group.first).or_insert_with(any)
            }
            _ => object.body != 0,
        };
        let standing = objects[..alone].iter().zip(0u32..).filter(|(object, _)| holds(object));
        nested.holders = standing.map(|(object, i)| (i, object.bounds())).collect();
        nested
    }

    /// The bodies, from the weakest to the strongest.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    fn body(&self, rank: u32) -> Option<&Body> {
        self.bodies.get((rank as usize).wrapping_sub(1))
    }

    fn kind(&self, rank: u32) -> Option<u32> {
        self.body(rank).map_or(Some(0), |body| body.kind)
    }
}

impl Scene {
    /// How a path that is in `bodies` meets `object` in `direction`; `None` where that is no body with a priority.
    #[must_use]
    pub fn crossing(
        &self,
        object: &Object,
        surface: &SurfacePoint,
        direction: DVec3,
        bodies: &Bodies,
    ) -> Option<Crossing<'_>> {
        let rank = object.body;
        if rank == 0 {
            return None;
        }
        let entering = direction.dot(surface.normal) < 0.0;
        let others = if entering { *bodies } else { bodies.without(rank) };
        let around = others.strongest();
        let same = self.nested.kind(rank).is_some_and(|kind| Some(kind) == self.nested.kind(around));
        Some(Crossing {
            shows: rank > around && !same,
            around: self.nested.body(around).map(|body| &body.index),
            here: if entering { others } else { others.with(rank) },
        })
    }

    /// What a path is in beyond the surface of `object`, which it crosses in `direction`.
    #[must_use]
    pub fn beyond(&self, object: &Object, surface: &SurfacePoint, direction: DVec3, before: Inside) -> Inside {
        let rank = object.body;
        if rank == 0 {
            return Inside { medium: object.beyond(surface, direction, before.medium), ..before };
        }
        let entering = direction.dot(surface.normal) < 0.0;
        let others = if entering { before.bodies } else { before.bodies.without(rank) };
        let around = others.strongest();
        let bodies = if entering { others.with(rank) } else { others };
        // Behind a surface that is not there the medium stays, whatever it is.
        let medium = match self.nested.body(if entering { rank } else { around }) {
            _ if rank <= around => before.medium,
            Some(body) => body.medium,
            None => object.beyond(surface, direction, before.medium),
        };
        Inside { medium, bodies }
    }

    /// The bodies that hold `origin` of a ray.
    ///
    /// Whoever leaves a body once more often than it enters it on its way out to infinity has begun inside. Each body is
    /// asked by itself, so that surfaces in one place do not hide each other. A ray that leaves the surface of a body is itself
    /// asked about that one: another would go back in unnoticed, as the surface that it begins on is not met again.
    #[must_use]
    pub fn bodies_around(&self, origin: &Ray) -> Bodies {
        // Along no axis, face or diagonal that a person would write.
        let direction = DVec3::new(0.359_814_2, 0.771_356_8, 0.525_127_9).normalize();
        let ray = Ray { direction, ..*origin };
        let mut bodies = Bodies::NONE;
        let mut add = |object: u32, depth: i64| {
            let rank = self.objects[object as usize].body;
            bodies = (0..depth.min(MOST as i64)).fold(bodies, |bodies, _| bodies.with(rank));
        };
        for &(index, bounds) in &self.nested.holders {
            let object = &self.objects[index as usize];
            if !(ray.origin.cmpge(bounds.min).all() && ray.origin.cmple(bounds.max).all()) {
                continue;
            }
            let Geometry::Instance(instance) = &object.geometry else {
                let is_left = origin.departure.is_some_and(|departure| departure.object == index);
                add(index, self.depth(index, if is_left { origin } else { &ray }));
                continue;
            };
            let (local, _) = instance.map.enter(&ray);
            for child in instance.group.members().filter(|child| self.objects[*child].body != 0) {
                add(child as u32, self.depth(child as u32, &local));
            }
        }
        bodies
    }

    /// How often the origin of `ray` is in `object`: how much more often the ray leaves it than it enters it. A plane is
    /// left on one side only, and is asked itself.
    fn depth(&self, object: u32, ray: &Ray) -> i64 {
        if let Geometry::Shape(Shape::Plane(plane)) = &self.objects[object as usize].geometry {
            return i64::from(plane.height(ray.origin) < 0.0);
        }
        let side = |surface: &SurfacePoint| if ray.direction.dot(surface.normal) > 0.0 { 1 } else { -1 };
        let mut depth = 0;
        if let Some(together) = self.together.as_ref().filter(|together| together.holds(object)) {
            together.any(ray, f64::INFINITY, None, |hit| {
                if hit.object == object {
                    depth += side(&self.surface_with(ray, &hit, Detail::Geometry));
                }
                false
            });
            return depth;
        }
        let mut at = *ray;
        for _ in 0..MOST_SURFACES {
            let Some(hit) = self.meet(&at, object, f64::INFINITY) else { break };
            let surface = self.surface_with(&at, &hit, Detail::Geometry);
            depth += side(&surface);
            at = Ray::leaving(surface.point, surface.scale, surface.normal, ray.direction, hit.departure());
        }
        depth
    }

    /// What a path is in that begins in `bodies`, where there is `otherwise` in none of them.
    #[must_use]
    pub fn inside(&self, bodies: Bodies, otherwise: Option<u32>) -> Inside {
        let medium = self.nested.body(bodies.strongest()).map_or(otherwise, |body| body.medium);
        Inside { medium, bodies }
    }

    /// What fills the space where `origin` of a ray is that leaves a light, but for bodies with a priority.
    ///
    /// A light that is an object shines from its front. Elsewhere the first surface between two media on the way to the
    /// camera tells, and if there is none it is what the camera is in.
    #[must_use]
    pub fn medium_around(&self, origin: &Ray) -> Option<u32> {
        let lamp = origin.departure.map(|departure| &self.objects[departure.object as usize]);
        if let Some(lamp) = lamp.filter(|lamp| !lamp.keeps_medium) {
            return lamp.outside;
        }
        if !self.parts_media {
            return self.camera_medium;
        }
        let way = self.camera.eye() - origin.origin;
        let (mut distance, mut ray) = (way.length(), Ray { direction: way.normalize_or(DVec3::Z), ..*origin });
        for _ in 0..MOST_SURFACES {
            let Some(hit) = self.closest(&ray, distance) else { break };
            let (object, surface) = (&self.objects[hit.object as usize], self.surface(&ray, &hit));
            if !object.keeps_medium {
                return object.beyond(&surface, -ray.direction, None);
            }
            distance -= hit.t;
            ray = self.leave(&surface, &hit, ray.direction);
        }
        self.camera_medium
    }

    /// True where light may go straight through an object.
    #[must_use]
    pub fn lets_through(&self, object: u32) -> bool {
        let object = &self.objects[object as usize];
        object.body != 0 || self.materials[object.material as usize].lets_through()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::compile::testing::{compiled, compiled_in};

    /// A scene of these shapes.
    fn scene(shapes: &str) -> Scene {
        let text = format!("camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nshapes:\n{shapes}");
        compiled(&text)
    }

    /// Cubes of triangles with a medium on one side of them, two of them with normals that point the other way, and one that
    /// is of glass: of a boundary the side of a ray is told as by the whole surface, of glass not.
    #[test]
    fn a_boundary_tells_what_is_beyond_it_without_its_surface() {
        const CUBE: &str = "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n\
            f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("cube.obj"), CUBE).unwrap();
        let mut text = String::from(
            "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n\
             media: {fog: {homogeneous: {scattering: 1, absorption: 1}}}\nshapes:\n",
        );
        for (material, side, flip, x) in [
            ("boundary: {}", "inside", false, 0.0),
            ("boundary: {}", "inside", true, 3.0),
            ("boundary: {}", "outside", true, 6.0),
            ("dielectric: {ior: 1.5}", "inside", false, 9.0),
        ] {
            text += &format!(
                "- mesh: {{file: cube.obj, material: {{{material}}}, {side}: fog, flip_normals: {flip}, \
                 transform: [{{translate: [{x}, 0, 0]}}]}}\n"
            );
        }
        let scene = compiled_in(directory.path(), &text);
        let mut random = crate::scene::shape::testing::Random::new(4);
        let mut met = [[0; 2]; 4];
        for _ in 0..2_000 {
            let origin = DVec3::new(9.0 * random.uniform(), 0.0, 0.0) + random.direction();
            let ray = Ray::new(origin, random.direction());
            let Some(hit) = scene.closest(&ray, f64::INFINITY) else { continue };
            let object = &scene.objects[hit.object as usize];
            let expected = object.beyond(&scene.surface(&ray, &hit), ray.direction, None);
            let expected = (hit.object < 3).then_some(expected);
            assert_eq!(scene.beyond_boundary(&ray, &hit, None), expected, "{ray:?} {hit:?}");
            met[hit.object as usize][usize::from(expected == Some(None))] += 1;
        }
        assert!(met[..3].iter().flatten().all(|&n| n > 50) && met[3][0] > 50, "{met:?}");
    }

    /// Two bodies in the very same place: whoever is in one is in both.
    #[test]
    fn bodies_with_the_same_surface_do_not_hide_each_other() {
        for shape in [
            "sphere: {radius: 1",
            "cube: {size: 2",
            "cylinder: {base: [0, -1, 0], top: [0, 1, 0], radius: 1, caps: both",
        ] {
            let body =
                |priority: i32| format!("- {shape}, material: {{dielectric: {{ior: 1.5, priority: {priority}}}}}}}\n");
            let scene = scene(&(body(1) + &body(2)));
            let at = |x: f64| scene.bodies_around(&Ray::new(DVec3::new(x, 0.2, 0.1), DVec3::X));
            assert_eq!((at(0.3), at(1.3)), (Bodies::NONE.with(1).with(2), Bodies::NONE), "{shape}");
        }
    }

    /// The list is the sorted multiset of what was put in and not taken out: against a plain list, for 10,000 random
    /// steps among twelve bodies, of which it may hold eight.
    #[test]
    fn the_list_holds_the_eight_strongest_of_what_a_path_is_in() {
        let mut random = crate::scene::shape::testing::Random::new(3);
        let (mut list, mut plain): (Bodies, Vec<u32>) = (Bodies::NONE, Vec::new());
        for _ in 0..10_000 {
            let rank = 1 + (random.uniform() * 12.0) as u32;
            let at = plain.iter().position(|r| *r == rank);
            match at {
                Some(at) if random.uniform() < 0.6 => {
                    plain.remove(at);
                    list = list.without(rank);
                }
                _ if plain.len() < MOST => {
                    plain.push(rank);
                    list = list.with(rank);
                }
                _ => assert_eq!(list.with(0), list),
            }
            plain.sort_by_key(|r| std::cmp::Reverse(*r));
            let kept: Vec<u32> = list.0.iter().copied().filter(|r| *r != 0).collect();
            assert_eq!(kept, plain);
            assert_eq!(list.strongest(), plain.first().copied().unwrap_or(0));
        }
        // A ninth drives out the weakest.
        let many = (1..=9).fold(Bodies::NONE, |bodies, rank| bodies.with(rank));
        assert_eq!(many.0, [9, 8, 7, 6, 5, 4, 3, 2]);
        assert_eq!(many.without(1), many);
    }
}
