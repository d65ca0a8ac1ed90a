//! What comes through between two points that are joined: a vertex and a lamp, or a vertex and the camera.

use crate::math::sampler::{Sampler, Set};
use crate::math::{Departure, Ray};
use crate::scene::material::Straight;
use crate::scene::medium::Dimmed;
use crate::scene::nested::Crossing;
use crate::scene::through::Way;
use crate::scene::{Hit, Inside, Scene, SurfacePoint};
use crate::spectrum::Lanes;
use glam::DVec3;

/// Boundaries of media that a ray crosses at the most: beyond it what it aims at counts as hidden.
/// A bound on time, far above any scene's nesting.
pub(super) const MAX_BOUNDARIES: u32 = 256;

/// Sets the numbers of shadow rays apart from those of the path: 2²⁸ is above any vertex plus 2¹⁶ times any count of
/// boundaries.
const SHADOW: u32 = 1 << 28;

/// A ray that only asks what comes through.
#[derive(Clone, Copy)]
pub(super) struct Shadow<'a> {
    pub scene: &'a Scene,
    pub sampler: &'a Sampler<'a>,
    /// Wavelengths.
    pub nm: Lanes,
    /// Tells its random numbers from those of other rays of the path: events of the path before.
    pub vertex: u32,
    /// What it starts in.
    pub inside: Inside,
    /// Surfaces that it may go straight through.
    pub panes: u32,
    /// The face or triangle that it aims at, where there is one.
    pub target: Option<Departure>,
    /// Whether lamps are not there.
    pub past_lamps: bool,
    /// Whether it leads to who sees, and not from there: materials with two sides are as they are seen.
    pub to_viewer: bool,
}

impl Shadow<'_> {
    /// Transmittance along `ray` to `distance`, and for each lane the probability that a path would have come through
    /// without scattering; `None` where something opaque stands between.
    pub fn cast<const MEDIA: bool>(self, ray: &Ray, distance: f64) -> Option<(Lanes, Lanes)> {
        let Shadow { scene, sampler, nm, vertex, mut inside, panes, target, past_lamps, .. } = self;
        let dim = |medium: Option<u32>, ray: &Ray, distance: f64, crossings: u32| match medium {
            Some(m) if MEDIA => {
                // Shadow rays walk by numbers of their own.
                let set = Set::Extra(vertex.wrapping_add(crossings << 16).wrapping_add(SHADOW));
                scene.media[m as usize].dim(ray, distance, nm, || sampler.walk(set))
            }
            _ => Dimmed { through: Lanes::ONE, passing: Lanes::ONE },
        };
        if !scene.has_boundaries && !past_lamps {
            if scene.occluded(ray, distance, target) {
                return None;
            }
            let Dimmed { through, passing } = dim(inside.medium, ray, distance, 0);
            return Some((through, passing));
        }
        let way = if MEDIA && !past_lamps { scene.way(ray, distance, target) } else { Way::Long };
        if let Way::Blocked = way {
            return None;
        }
        if let Way::Open(crossed) = &way {
            let hits = crossed.hits();
            if hits.len() > panes as usize {
                return None;
            }
            let (mut through, mut passing, mut from) = (Lanes::ONE, Lanes::ONE, 0.0);
            for (crossings, hit) in (0..).zip(hits) {
                let dimmed = dim(inside.medium, &Ray::new(ray.at(from), ray.direction), hit.t - from, crossings);
                through *= dimmed.through;
                passing *= dimmed.passing;
                from = hit.t;
                if let Some(medium) = scene.beyond_boundary(ray, hit, inside.medium) {
                    inside.medium = medium;
                    continue;
                }
                let (straight, _) = self.pass(ray, hit, &mut inside)?;
                through *= straight.weight * straight.share as f32;
                passing *= straight.share as f32;
            }
            let last = Ray::new(ray.at(from), ray.direction);
            let dimmed = dim(inside.medium, &last, distance - from, hits.len() as u32);
            return Some((through * dimmed.through, passing * dimmed.passing));
        }
        // Walk from one surface that lets light straight through to the next.
        let (mut through, mut passing) = (Lanes::ONE, Lanes::ONE);
        let (mut ray, mut left, mut crossed) = (*ray, distance, 0);
        for crossings in 0..=MAX_BOUNDARIES {
            let hit = scene.closest(&ray, left).filter(|h| !scene.reaches(&ray, h, target));
            let dimmed = dim(inside.medium, &ray, hit.map_or(left, |h| h.t), crossings);
            through *= dimmed.through;
            passing *= dimmed.passing;
            let Some(hit) = hit else { return Some((through, passing)) };
            if past_lamps && scene.objects[hit.object as usize].is_lamp {
                ray = scene.leave(&scene.surface(&ray, &hit), &hit, ray.direction);
                left -= hit.t;
                continue;
            }
            if crossed == panes || !scene.lets_through(hit.object) {
                return None;
            }
            crossed += 1;
            let (straight, surface) = self.pass(&ray, &hit, &mut inside)?;
            through *= straight.weight * straight.share as f32;
            passing *= straight.share as f32;
            ray = scene.leave(&surface, &hit, ray.direction);
            left -= hit.t;
        }
        None
    }

    /// What goes straight on at `hit`, after which the ray is in `inside`; `None` where nothing can.
    fn pass(&self, ray: &Ray, hit: &Hit, inside: &mut Inside) -> Option<(Straight, SurfacePoint)> {
        let scene = self.scene;
        let object = &scene.objects[hit.object as usize];
        let surface = scene.surface(ray, hit);
        let crossing = scene.crossing(object, &surface, ray.direction, &inside.bodies);
        let direction = if self.to_viewer { -ray.direction } else { ray.direction };
        let straight = straight(scene, hit, &surface, direction, crossing.as_ref(), self.nm)?;
        *inside = scene.beyond(object, &surface, ray.direction, *inside);
        Some((straight, surface))
    }
}

/// What of light of the wavelengths `nm` goes straight on in `direction` at `hit`, which is met as `crossing` tells; `None` where nothing can.
#[inline(always)]
pub(super) fn straight(
    scene: &Scene,
    hit: &Hit,
    surface: &SurfacePoint,
    direction: DVec3,
    crossing: Option<&Crossing>,
    nm: Lanes,
) -> Option<Straight> {
    // Within a body that has the place the surface is not there.
    if crossing.is_some_and(|crossing| !crossing.shows) {
        return Some(Straight::OPEN);
    }
    let material = &scene.materials[scene.objects[hit.object as usize].material as usize];
    material.straight(surface, direction, || hit.texture_point(surface), nm)
}
