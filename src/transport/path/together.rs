//! The paths of several samples side by side: the nearest things that their rays meet are found together, and so is what
//! stands before the lights that they ask. In between each goes its own way.
//!
//! What a path does is `Tracer::meet`, as for one alone, with the same numbers in the same order: the bits are the same.

use super::lights::{Question, Questions};
use super::reuse::Joint;
use super::{Path, Sought, Step, Tracer, Walk};
use crate::math::Ray;
use crate::math::sampler::{PARTS, Sampler};
use crate::spectrum::Lanes;
use crate::transport::plan::PathSettings;
use crate::transport::{Incoming, Shot};

/// How many paths go together at the most.
pub const MOST: usize = 8;

/// Whether paths can go together: what they meet is found side by side, they fly through no media, and no wavelengths
/// part.
#[must_use]
pub fn possible(shot: &Shot, settings: &PathSettings) -> bool {
    let Shot { scene, plan, .. } = shot;
    let one_way = !(plan.media || plan.nested || plan.packets);
    let parted = plan.layers.parts_light();
    let plain = scene.watch.is_none() && settings.light_samples.max(settings.scatter_samples) == 1;
    scene.few.is_some() && one_way && plain && !parted
}

/// A sample whose light is wanted.
pub struct Wanted<'a> {
    /// Its numbers.
    pub sampler: Sampler<'a>,
    /// Its wavelengths, nm.
    pub nm: Lanes,
    /// Its ray.
    pub ray: &'a Ray,
    /// Whether its path looks for [`Sought::Rest`], else for all light.
    pub apart: bool,
}

/// The light of `count` samples, at most [`MOST`]: of the `i`th, which `wanted` tells, `give` gets it.
pub fn radiance<'a>(
    shot: &'a Shot,
    settings: &'a PathSettings,
    count: usize,
    wanted: impl Fn(usize) -> Wanted<'a>,
    mut give: impl FnMut(usize, Incoming),
) {
    let mut paths = [const { Path::BLANK }; MOST];
    let mut walks = [const { Walk::NEW }; MOST];
    let (paths, walks) = (&mut paths[..count], &mut walks[..count]);
    follow(shot, settings, wanted, paths, walks, None);
    for (i, (path, walk)) in paths.iter().zip(walks).enumerate() {
        give(i, path.incoming(walk.alpha, walk.depth));
    }
}

/// Follows blank `paths`, at most [`MOST`], to their ends; the first vertices of each may be noted in `joints`.
pub(super) fn follow<'a>(
    shot: &'a Shot,
    settings: &'a PathSettings,
    wanted: impl Fn(usize) -> Wanted<'a>,
    paths: &mut [Path],
    walks: &mut [Walk],
    joints: Option<&mut [Joint]>,
) {
    match shot.plan.chromatic {
        true => trace::<true>(shot, settings, wanted, paths, walks, joints),
        false => trace::<false>(shot, settings, wanted, paths, walks, joints),
    }
}

fn trace<'a, const CHROMATIC: bool>(
    shot: &'a Shot,
    settings: &'a PathSettings,
    wanted: impl Fn(usize) -> Wanted<'a>,
    paths: &mut [Path],
    walks: &mut [Walk],
    mut joints: Option<&mut [Joint]>,
) {
    let Shot { scene, plan, photons, .. } = *shot;
    let photons = photons.map(|p| p.map);
    let mut asked = Questions::new();
    // Whose they are.
    let mut asking = [0; MOST * PARTS as usize];
    // The camera does not see beyond its clipping plane, whatever it looks through.
    let mut reach = [f64::INFINITY; MOST];
    for (i, path) in paths.iter_mut().enumerate() {
        let ray = wanted(i).ray;
        (path.ray.origin, path.ray.direction) = (ray.origin, ray.direction);
        reach[i] = scene.camera.reach(ray);
        walks[i] = Walk::begin(scene, settings);
    }
    // Those that go on, in order.
    let mut on: [usize; MOST] = std::array::from_fn(|i| i);
    let mut left = paths.len();
    while left > 0 {
        let mut hits = [None; MOST];
        for (group, hits) in on[..left].chunks(4).zip(hits.chunks_mut(4)) {
            let rays = from_lanes(group, |i| &paths[i].ray);
            scene.closest_of_four(rays, from_lanes(group, |i| reach[i]), group.len(), hits);
        }

        // Each its own way: it scatters, and asks a light.
        let going = left;
        left = 0;
        for k in 0..going {
            let i = on[k];
            let Wanted { sampler, nm, apart, .. } = wanted(i);
            let sought = Sought::in_pixel(apart);
            let tracer = Tracer { scene, plan, settings, sampler, nm, photons, ledger: None, sought };
            let joint = joints.as_deref_mut().map(|joints| &mut joints[i]);
            let (path, walk) = (&mut paths[i], &mut walks[i]);
            let known = asked.len();
            let step = tracer.meet::<CHROMATIC, false>(path, walk, hits[k], Some(&mut asked), joint);
            asking[known..asked.len()].fill(i);
            reach[i] = match step {
                Step::Ended => continue,
                Step::Straight(distance) => reach[i] - distance,
                Step::Scattered => f64::INFINITY,
            };
            on[left] = i;
            left += 1;
        }

        for (toward, asking) in asked.chunks(4).zip(asking.chunks(4)) {
            let count = toward.len();
            let toward: [&Question; 4] = std::array::from_fn(|lane| toward.get(lane).unwrap_or(&toward[0]));
            let (distances, targets) = (toward.map(|to| to.distance), toward.map(|to| to.target));
            let hidden = scene.occluded_of_four(toward.map(|to| &to.ray), distances, targets, count);
            for (lane, (&i, to)) in asking.iter().zip(toward).take(count).enumerate() {
                if hidden >> lane & 1 == 0 {
                    let path = &mut paths[i];
                    *(if to.traced { &mut path.left } else { &mut path.radiance }) += to.light;
                }
            }
        }
        asked.clear();
    }
}

/// What each of `group` has, and for the lanes beyond what the first has.
#[inline(always)]
pub(super) fn from_lanes<T>(group: &[usize], of: impl Fn(usize) -> T) -> [T; 4] {
    // One closure for the whole of a lane was left a call.
    let lane = |lane: usize| *group.get(lane).unwrap_or(&group[0]);
    [of(lane(0)), of(lane(1)), of(lane(2)), of(lane(3))]
}
