//! Several meshes of a scene in one tree, so that a ray is made ready once and walks down once.

use super::{MAX_TRIANGLES, MeshHit, MeshTree};
use crate::math::{Departure, Ray};
use crate::scene::bvh::Aabb;
use crate::scene::{Geometry, Hit, Object, TriangleMesh};

/// A mesh that is smaller than this share of the largest keeps a tree of its own: boxes of a tree are rounded to 2⁻²⁴
/// of its size, which is then at most 2⁻¹⁶ of the mesh's.
const SMALLEST: f64 = 1.0 / 256.0;

/// Marks objects without triangles here.
const NONE: u32 = u32::MAX;

/// The triangles of some objects, numbered through.
#[derive(Clone, Debug)]
pub struct Together {
    tree: MeshTree,
    /// The number of the first triangle, by object.
    first: Vec<u32>,
    /// The object, by number of the triangle.
    object: Vec<u32>,
}

impl Together {
    /// Takes the trees of all meshes among `objects` that belong together: of one origin and comparable size. `boxes`
    /// are the objects'. None where there are no meshes. Shadow rays look for those that are `opaque` first: of the others
    /// none matters where one of them stands in the way.
    #[must_use]
    pub fn take(objects: &mut [Object], boxes: &[Aabb], opaque: impl Fn(&Object) -> bool) -> Option<Together> {
        fn mesh(object: &Object) -> Option<&TriangleMesh> {
            match &object.geometry {
                Geometry::Mesh(mesh) => Some(mesh),
                _ => None,
            }
        }
        let size = |i: usize| (boxes[i].max - boxes[i].min).max_element();
        let meshes = || (0..objects.len()).filter(|&i| mesh(&objects[i]).is_some());
        let largest = meshes().max_by(|&a, &b| size(a).total_cmp(&size(b)))?;
        let origin = mesh(&objects[largest])?.mesh.origin;

        let (mut first, mut object) = (vec![NONE; objects.len()], Vec::new());
        for i in meshes() {
            let Some(TriangleMesh { mesh, tree: Some(_), .. }) = mesh(&objects[i]) else { continue };
            let fits = object.len() + mesh.triangles.len() <= MAX_TRIANGLES;
            if fits && mesh.origin == origin && size(i) >= SMALLEST * size(largest) {
                first[i] = object.len() as u32;
                object.resize(object.len() + mesh.triangles.len(), i as u32);
            }
        }
        let (mut parts, mut in_front) = (Vec::new(), Vec::new());
        for (i, taken) in objects.iter_mut().enumerate() {
            let is_opaque = opaque(taken);
            if let Geometry::Mesh(mesh) = &mut taken.geometry
                && first[i] != NONE
            {
                parts.extend(mesh.tree.take());
                in_front.push(is_opaque);
            }
        }
        Some(Together { tree: MeshTree::joined(parts, &in_front), first, object })
    }

    /// Whether the triangles of an object are here.
    #[must_use]
    pub fn holds(&self, object: u32) -> bool {
        self.first.get(object as usize).is_some_and(|&first| first != NONE)
    }

    /// The nearest triangle that `ray` hits before `t_max`, other than the one that it leaves.
    #[must_use]
    #[inline]
    pub fn closest(&self, ray: &Ray, t_max: f64) -> Option<Hit> {
        self.tree.closest(ray, t_max, self.number(ray.departure)).map(|met| self.hit(&met))
    }

    /// Shows `met` the triangles that `ray` hits before `t_max`, other than the one that it leaves, roughly front to
    /// back. From then on only what is nearer than it answers counts.
    #[inline]
    pub fn nearest(&self, ray: &Ray, t_max: f64, mut met: impl FnMut(Hit) -> Option<f64>) {
        self.tree.nearest_of(ray, t_max, self.number(ray.departure), |hit| met(self.hit(&hit)));
    }

    /// Shows `met` the triangles that `ray` hits before `t_max`, other than the one that it leaves and `target`, in any
    /// order, until it says stop; true if it did.
    #[inline]
    pub fn any(&self, ray: &Ray, t_max: f64, target: Option<Departure>, mut met: impl FnMut(Hit) -> bool) -> bool {
        let skip = [self.number(ray.departure), self.number(target)];
        self.tree.any_of(ray, t_max, skip, |hit| met(self.hit(&hit)))
    }

    /// The number of a triangle, if it is here. Children of groups come after the objects of the scene.
    #[inline]
    fn number(&self, part: Option<Departure>) -> Option<u32> {
        let part = part?;
        let first = *self.first.get(part.object as usize)?;
        (first != NONE).then(|| first + part.part)
    }

    #[inline]
    fn hit(&self, met: &MeshHit) -> Hit {
        let object = self.object[met.triangle as usize];
        let part = met.triangle - self.first[object as usize];
        Hit { t: met.hit.t, object, part, barycentric: [met.hit.b1, met.hit.b2], instance: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::{AreaTable, Mesh, MeshSource, NormalMode, Winding};
    use crate::scene::shape::testing::Random;
    use glam::{DAffine3, DVec3};

    /// Some triangles in the unit sphere, moved and resized.
    fn soup(random: &mut Random, triangles: u32, size: f64, centre: DVec3) -> Mesh {
        let positions = (0..3 * triangles).map(|_| centre + random.direction() * (size * random.uniform())).collect();
        let triangles = (0..triangles).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let source = MeshSource { positions, triangles, ..MeshSource::default() };
        Mesh::new(&source, &DAffine3::IDENTITY, NormalMode::Face, Winding::Object).unwrap()
    }

    fn object(mesh: Mesh) -> Object {
        let (tree, areas) = (Some(MeshTree::build(&mesh)), AreaTable::new(&mesh));
        let geometry = Geometry::Mesh(Box::new(TriangleMesh { mesh, tree, areas }));
        Object::plain(String::new(), geometry, 0)
    }

    /// Of four meshes the third is a thousandth of the others in size and the fourth lies far away: those keep their
    /// trees. Rays toward the other two meet the triangle, at the distance, that the trees of each find, and go on from
    /// there.
    #[test]
    fn triangles_are_found_as_in_trees_of_their_own() {
        let mut random = Random::new(5);
        let meshes = [
            soup(&mut random, 40, 1.0, DVec3::ZERO),
            soup(&mut random, 7, 2.0, DVec3::X),
            soup(&mut random, 9, 0.001, DVec3::Y),
            soup(&mut random, 9, 1.0, DVec3::X * 1e6),
        ];
        let trees = meshes.each_ref().map(MeshTree::build);
        let boxes = meshes.each_ref().map(Mesh::bounds);
        let mut objects: Vec<Object> = meshes.into_iter().map(object).collect();
        let together = Together::take(&mut objects, &boxes, |_| true).unwrap();
        for (i, object) in (0..).zip(&objects) {
            let Geometry::Mesh(mesh) = &object.geometry else { panic!("{i}") };
            assert_eq!((together.holds(i), mesh.tree.is_none()), (i < 2, i < 2), "{i}");
        }
        assert!(!together.holds(4));

        let mut met = [0; 2];
        for _ in 0..20_000 {
            let origin = random.direction() * 5.0;
            let mut ray = Ray::new(origin, (random.direction() - origin).normalize());
            for _ in 0..3 {
                let alone = |i: u32| {
                    let skip = ray.departure.filter(|d| d.object == i).map(|d| d.part);
                    trees[i as usize].closest(&ray, f64::INFINITY, skip).map(|hit| (i, hit))
                };
                let expected =
                    [alone(0), alone(1)].into_iter().flatten().min_by(|a, b| a.1.hit.t.total_cmp(&b.1.hit.t));
                let found = together.closest(&ray, f64::INFINITY);
                let named = found.map(|hit| (hit.object, hit.part, hit.t, hit.barycentric));
                assert_eq!(named, expected.map(|(i, m)| (i, m.triangle, m.hit.t, [m.hit.b1, m.hit.b2])));
                assert_eq!(together.any(&ray, f64::INFINITY, None, |_| true), found.is_some());
                let Some(hit) = found else { break };
                met[hit.object as usize] += 1;
                // A target does not stand in its own way, whatever else does.
                let target = hit.departure();
                assert!(!together.any(&ray, f64::INFINITY, Some(target), |other| other.departure() == target));
                ray = Ray { origin: ray.at(hit.t), departure: Some(target), ..ray };
            }
        }
        assert!(met.iter().all(|&n| n > 1000), "{met:?}");
    }
}
