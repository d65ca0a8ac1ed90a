//! Boundaries of media that lie ahead of a path, found in one search together with what ends its flight.
//!
//! A path goes straight through the boundary of a medium, and what is behind it may be known from the search that found
//! the boundary. One search lists the nearest boundaries up to the first thing that is none.

use super::{Geometry, Hit, Scene};
use crate::math::Ray;
use crate::scene::material::Kind;

/// Boundaries that are kept; what lies beyond is searched for again.
const MOST: usize = 4;

/// What is known of the way of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Ahead {
    /// Boundaries, nearest first, with distances from where the search began.
    boundaries: [Hit; MOST],
    count: usize,
    /// How many of them were handed out.
    passed: usize,
    /// What is met behind them, closer than `until`.
    end: Option<Hit>,
    /// How far the way is known, but for `end`.
    until: f64,
    /// How far the ray has gone since the search.
    gone: f64,
    /// Whether the ray is still on that way.
    straight: bool,
}

impl Ahead {
    /// Nothing is known.
    pub const UNKNOWN: Ahead = {
        const NOTHING: Hit = Hit { t: 0.0, object: 0, part: 0, barycentric: [0.0; 2], instance: None };
        Ahead { boundaries: [NOTHING; MOST], count: 0, passed: 0, end: None, until: 0.0, gone: 0.0, straight: false }
    };

    /// The ray goes straight on from what [`Scene::next`] met last, at distance `t`.
    pub fn go_on(&mut self, t: f64) {
        self.gone += t;
        self.straight = true;
    }

    /// Takes a boundary in the order of distances. Answers beyond which distance none counts, once there is no room.
    fn push(&mut self, hit: Hit) -> Option<f64> {
        let mut at = self.count.min(MOST - 1);
        self.count = at + 1;
        while at > 0 && self.boundaries[at - 1].t > hit.t {
            self.boundaries[at] = self.boundaries[at - 1];
            at -= 1;
        }
        self.boundaries[at] = hit;
        if self.count < MOST {
            return None;
        }
        self.until = self.until.min(self.boundaries[MOST - 1].t);
        Some(self.until)
    }
}

impl Scene {
    /// [`Scene::closest`] for a path that goes straight on from what it met where it says so by [`Ahead::go_on`].
    /// `ray` then starts at what was met last.
    #[must_use]
    pub fn next(&self, ahead: &mut Ahead, ray: &Ray, t_max: f64) -> Option<Hit> {
        if std::mem::take(&mut ahead.straight) {
            let known = if ahead.passed < ahead.count {
                ahead.passed += 1;
                Some(ahead.boundaries[ahead.passed - 1])
            } else {
                // The place of a hit on a triangle does not depend on the ray; that on other things is searched for
                // from near.
                ahead.end.take().filter(|hit| {
                    hit.instance.is_none() && matches!(self.objects[hit.object as usize].geometry, Geometry::Mesh(_))
                })
            };
            if let Some(hit) = known {
                let t = hit.t - ahead.gone;
                return (t < t_max).then_some(Hit { t, ..hit });
            }
            if ahead.until - ahead.gone >= t_max {
                return None;
            }
        }
        self.look(ahead, ray, t_max)
    }

    /// A new search.
    fn look(&self, ahead: &mut Ahead, ray: &Ray, t_max: f64) -> Option<Hit> {
        (ahead.count, ahead.passed, ahead.gone) = (0, 0, 0.0);
        let mut end = self.closest_apart(ray, t_max);
        ahead.until = end.map_or(t_max, |hit| hit.t);
        if let Some(together) = &self.together {
            together.nearest(ray, ahead.until, |hit| {
                let object = &self.objects[hit.object as usize];
                if matches!(self.materials[object.material as usize].kind, Kind::Boundary) {
                    return ahead.push(hit);
                }
                end = Some(hit);
                ahead.until = hit.t;
                Some(hit.t)
            });
        }
        let until = ahead.until;
        while ahead.count > 0 && ahead.boundaries[ahead.count - 1].t > until {
            ahead.count -= 1;
        }
        ahead.end = end.filter(|hit| hit.t <= until);
        if ahead.count > 0 {
            ahead.passed = 1;
            return Some(ahead.boundaries[0]);
        }
        ahead.end.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::compile::testing::compiled_in;
    use crate::scene::shape::testing::Random;
    use glam::DVec3;

    /// The boundaries of five cubes in one another, meshes, ten along a ray through the middle, and beside them an
    /// opaque one, an opaque sphere and a sphere that is a boundary.
    fn scene() -> Scene {
        const CUBE: &str = "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n\
            f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("cube.obj"), CUBE).unwrap();
        let mut text = String::from("camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nshapes:\n");
        let mut cube = |size: f64, x: f64, material: &str| {
            text += &format!(
                "- mesh: {{file: cube.obj, material: {{{material}: {{}}}}, \
                 transform: [{{scale: {size}}}, {{translate: [{x}, 0, 0]}}]}}\n"
            );
        };
        (0..5).for_each(|i| cube(1.0 - 0.15 * f64::from(i), 0.0, "boundary"));
        cube(0.5, 3.0, "diffuse");
        text += "- sphere: {center: [0, 3, 0], radius: 0.5, material: {diffuse: {}}}\n\
                 - sphere: {center: [0, 0, 3], radius: 0.5, material: {boundary: {}}}\n";
        compiled_in(directory.path(), &text)
    }

    /// A path that goes straight on through boundaries meets what searches of their own find, in the same order and at
    /// the same distances to 1e-11: each search of a ray that leaves a surface starts 2⁻⁴⁶ of its size away, and no
    /// ray here grazes by more than a thousandth. It reaches as far as it is asked to at each step: what ends a flight
    /// through a medium is closer than the next boundary or not.
    #[test]
    fn what_lies_ahead_is_what_searches_of_their_own_find() {
        let scene = scene();
        assert!(scene.together.is_some());
        let mut random = Random::new(7);
        let (mut most, mut ended, mut short) = (0, [0; 2], 0);
        for _ in 0..5_000 {
            let origin = random.direction() * 6.0 * random.uniform();
            let target = random.direction() * 3.5 * random.uniform();
            let (mut ray, mut ahead, mut met) = (Ray::new(origin, (target - origin).normalize()), Ahead::UNKNOWN, 0);
            loop {
                let t_max = if random.uniform() < 0.5 { f64::INFINITY } else { random.uniform() };
                let expected = scene.closest(&ray, t_max);
                let found = scene.next(&mut ahead, &ray, t_max);
                let named = |hit: Option<Hit>| hit.map(|hit| (hit.object, hit.part));
                if expected.is_none_or(|hit| (hit.t - t_max).abs() > 1e-9) {
                    assert_eq!(named(found), named(expected), "{ray:?}");
                }
                let (Some(hit), Some(other)) = (found, expected) else {
                    short += u32::from(t_max < f64::INFINITY);
                    break;
                };
                assert!((hit.t - other.t).abs() < 1e-11, "{} {}", hit.t, other.t);
                met += 1;
                let surface = scene.surface(&ray, &hit);
                let graze = surface.normal.dot(ray.direction).abs() < 1e-3;
                let object = &scene.objects[hit.object as usize];
                if graze || !matches!(scene.materials[object.material as usize].kind, Kind::Boundary) {
                    ended[usize::from(matches!(object.geometry, Geometry::Mesh(_)))] += 1;
                    break;
                }
                ray = scene.leave(&surface, &hit, ray.direction);
                ahead.go_on(hit.t);
            }
            most = most.max(met);
        }
        assert!(most >= 10 && ended.iter().all(|&n| n > 20) && short > 500, "{most} {ended:?} {short}");
        let ray = Ray::new(DVec3::new(-4.0, 0.01, 0.02), DVec3::X);
        let first = scene.next(&mut { Ahead::UNKNOWN }, &ray, f64::INFINITY).unwrap();
        assert!((first.t - 3.0).abs() < 1e-12);
    }
}
