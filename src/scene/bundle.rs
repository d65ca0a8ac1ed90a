//! Eight rays that lie close together, four at a time where the scene has few things.

use super::{Hit, Scene};
use crate::math::{Departure, Ray};
use crate::spectrum::LANES;

/// The lanes whose bits are set.
pub fn each(lanes: u8) -> impl Iterator<Item = usize> {
    (0..LANES).filter(move |lane| lanes >> lane & 1 == 1)
}

/// Shows `visit` the lanes whose bits are set, four at a time: what is beyond the count repeats the first.
fn by_fours(lanes: u8, mut visit: impl FnMut([usize; 4], usize)) {
    let mut left = each(lanes);
    while let Some(first) = left.next() {
        let (mut group, mut count) = ([first; 4], 1);
        while count < 4
            && let Some(lane) = left.next()
        {
            group[count] = lane;
            count += 1;
        }
        visit(group, count);
    }
}

impl Scene {
    /// [`Scene::closest`] for the rays whose bits are in `lanes`; `None` for the others.
    #[must_use]
    pub fn closest_of(&self, rays: &[Ray; LANES], lanes: u8) -> [Option<Hit>; LANES] {
        let mut best = [None; LANES];
        by_fours(lanes, |group, count| {
            let [a, b, c, d] = group;
            let mut hits = [None; 4];
            self.closest_of_four([&rays[a], &rays[b], &rays[c], &rays[d]], [f64::INFINITY; 4], count, &mut hits);
            group.into_iter().zip(hits).take(count).for_each(|(lane, hit)| best[lane] = hit);
        });
        best
    }

    /// The rays among `lanes` in whose way anything stands before their `distances`, a bit each; see
    /// [`Scene::occluded`].
    #[must_use]
    pub fn occluded_of(
        &self,
        rays: &[Ray; LANES],
        distances: &[f64; LANES],
        lanes: u8,
        target: Option<Departure>,
    ) -> u8 {
        let mut hidden = 0;
        by_fours(lanes, |group, count| {
            let [a, b, c, d] = group;
            let (four, far) = ([&rays[a], &rays[b], &rays[c], &rays[d]], group.map(|lane| distances[lane]));
            let found = self.occluded_of_four(four, far, [target; 4], count);
            let of = |i: usize| u8::from(found >> i & 1 == 1) << group[i];
            hidden |= (0..count).fold(0, |set, i| set | of(i));
        });
        hidden
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::compile::testing::compiled_in;
    use crate::scene::few::tests::bits;
    use crate::scene::shape::testing::Random;
    use glam::DVec3;

    /// A scene of few things: `meshes` tetrahedra, two spheres, a cube and a plane.
    fn scene(meshes: usize) -> Scene {
        let directory = tempfile::tempdir().unwrap();
        let solid = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
        std::fs::write(directory.path().join("solid.obj"), solid).unwrap();
        let mut text = String::from(
            "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nshapes:\n\
             - sphere: {center: [-1, 0, 0], radius: 0.7}\n- sphere: {center: [0, 1, 1], radius: 0.4}\n\
             - cube: {center: [1, -1, 0], size: [0.8, 0.5, 0.6]}\n- plane: {point: [0, -1.5, 0], normal: [0, 1, 0]}\n",
        );
        for i in 0..meshes {
            text +=
                &format!("- mesh: {{file: solid.obj, transform: [{{translate: [{}, -0.3, 0.2]}}]}}\n", i as f64 - 0.5);
        }
        compiled_in(directory.path(), &text)
    }

    /// Any of eight rays, from anywhere and on from what they met, with what they meet of the same bits as alone, and the
    /// same ones hidden: with no mesh, one small mesh among the few, and several in a tree of theirs.
    #[test]
    fn bundles_meet_what_each_ray_meets_alone() {
        let mut random = Random::new(5);
        for meshes in [0, 1, 3] {
            let scene = scene(meshes);
            assert!(scene.few.is_some() && scene.together.is_some() == (meshes > 1));
            let (mut met, mut stopped, mut by_triangles) = (0, 0, 0);
            let mut rays = [Ray::new(DVec3::ZERO, DVec3::X); LANES];
            for _ in 0..3_000 {
                for ray in &mut rays {
                    if random.uniform() < 0.5 {
                        let origin = random.direction() * 4.0 * random.uniform();
                        *ray = Ray::new(origin, (random.direction() * 1.5 * random.uniform() - origin).normalize());
                    }
                }
                let lanes = (random.uniform() * 256.0) as u8;
                let distances = rays.map(|_| 4.0 * random.uniform());
                let target = Departure::new((random.uniform() * scene.objects.len() as f64) as u32, 0);
                let target = (random.uniform() < 0.5).then_some(target);
                let hits = scene.closest_of(&rays, lanes);
                let hidden = scene.occluded_of(&rays, &distances, lanes, target);
                for lane in 0..LANES {
                    if lanes >> lane & 1 == 0 {
                        assert!(hits[lane].is_none() && hidden >> lane & 1 == 0);
                        continue;
                    }
                    let alone = scene.closest(&rays[lane], f64::INFINITY);
                    assert_eq!(bits(hits[lane]), bits(alone), "{:?}", rays[lane]);
                    let occluded = scene.occluded(&rays[lane], distances[lane], target);
                    assert_eq!(hidden >> lane & 1 == 1, occluded, "{:?} {target:?}", rays[lane]);
                    stopped += u32::from(occluded);
                    if let Some(hit) = alone {
                        met += 1;
                        by_triangles += u32::from(hit.object >= 4);
                        let surface = scene.surface(&rays[lane], &hit);
                        rays[lane] = scene.leave(&surface, &hit, random.direction());
                    }
                }
            }
            assert!(
                met > 5_000 && stopped > 2_000 && (by_triangles > 1_000) == (meshes > 0),
                "{met} {stopped} {by_triangles}"
            );
        }
    }
}
