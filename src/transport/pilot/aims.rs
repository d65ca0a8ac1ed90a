//! Which lights are traced, at what their paths are aimed, and what finds change about that.

use super::STREAM;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::bvh::Aabb;
use crate::scene::casters::Casters;
use crate::scene::environment::{Drawn, Environment};
use crate::scene::light::Light;
use crate::scene::{Geometry, Scene};
use crate::transport::caustics::{Caustics, Source, Target};
use crate::transport::guide::{Find, Guide};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Share of the paths that go where the pilot found nothing: it may have missed something.
const ANYWHERE: f64 = 0.2;

/// Half of the solid angle of a hemisphere in which light counts as coming from one place, over 2π.
const SMALL: f64 = 0.3;

/// Whether light `i`, of this [`chance`], comes from so small a part of the sphere, seen from what casts, that chance finds it seldom.
pub(super) fn is_small(scene: &Scene, i: usize, chance: f64, casters: &Casters) -> bool {
    match &scene.lights[i] {
        Light::Point { .. }
        | Light::Spot { .. }
        | Light::Directional { .. }
        | Light::Projector(_)
        | Light::AlongNormal { .. } => true,
        Light::Environment(map) => chance < 1.0 && (map.may_stand_out() || !casters.is_empty()),
        _ if casters.is_empty() => false,
        Light::Constant { .. } => false,
        Light::Area { object, .. } => {
            let lamp = &scene.objects[*object as usize];
            let bounds = lamp.bounds();
            let (centre, radius) = match &lamp.geometry {
                Geometry::Shape(_) | Geometry::Mesh(_) => around(&bounds),
                Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => return false,
            };
            // How near to a mirror without end it is does not bound how it is seen there. A lamp in a globe is met through the globe by
            // what stands around it, which may be far off.
            let in_globe = |globe: &Aabb| bounds.min.cmpgt(globe.min).all() && bounds.max.cmplt(globe.max).all();
            !casters.endless.is_empty()
                || casters.boxes.iter().any(in_globe)
                || casters.balls.iter().any(|ball| share_of_hemisphere(radius, (ball.center - centre).length()) < SMALL)
        }
    }
}

/// About how often a path from the camera may meet light `i` by what casts: the share of the hemisphere that it takes at the nearest of
/// that, as flat mirrors and panes show it. One where nothing bounds it, none of lamps without extent.
pub(super) fn chance(scene: &Scene, i: usize, casters: &Casters) -> f64 {
    match &scene.lights[i] {
        light if !light.may_be_met() => 0.0,
        Light::Area { object, .. } if casters.endless.is_empty() => {
            let (centre, radius) = around(&scene.objects[*object as usize].bounds());
            let distance = |b: &Aabb| (centre - centre.clamp(b.min, b.max)).length();
            share_of_hemisphere(radius, casters.boxes.iter().map(distance).fold(f64::INFINITY, f64::min))
        }
        Light::Environment(map) => sun(map).unwrap_or(1.0),
        _ => 1.0,
    }
}

/// The middle of a box, and half its diagonal: of a flat or curved surface in it the radius at most.
fn around(b: &Aabb) -> (DVec3, f64) {
    (0.5 * b.min + 0.5 * b.max, 0.5 * (b.max - b.min).length())
}

/// 1 − cos of the half angle of a ball: its solid angle over 2π; one from within.
fn share_of_hemisphere(radius: f64, distance: f64) -> f64 {
    let sine = radius / distance;
    // Without cancellation.
    if sine < 1.0 { sine * sine / (1.0 + (1.0 - sine * sine).sqrt()) } else { 1.0 }
}

/// Where a fifth of an environment's light comes from less than a two-hundredth of the sphere: the solid angle, over 2π, from which all
/// of it would come were it as bright.
fn sun(map: &Environment) -> Option<f64> {
    const DRAWS: u32 = 4096;
    let sampler = |i| Sampler::new(STREAM, [0, 0], 0, i);
    let mut densities: Vec<f64> = (0..DRAWS)
        .filter_map(|i| map.sample(pairs(sampler(i).set(Set::Camera)).0, Drawn::All).map(|s| s.pdf_solid_angle))
        .collect();
    densities.sort_by(|a, b| b.total_cmp(a));
    let mut angle = 0.0;
    for density in densities.iter().take(DRAWS as usize / 5 + 1) {
        angle += 1.0 / (density * f64::from(DRAWS));
    }
    (densities.len() > DRAWS as usize / 5 && angle < 4.0 * PI * 0.005).then_some(5.0 * angle / TAU)
}

impl Caustics {
    /// Aimed at everything alike.
    pub(super) fn untrained(
        scene: &Scene,
        casters: &Casters,
        in_part: &Casters,
        traced: Vec<bool>,
        packets: bool,
    ) -> Caustics {
        // Light from infinity meets what has no end everywhere: neither is aimed at the other. What throws light of no lamp that a
        // path could meet is as good as what does so in part.
        let bounded = scene.lights.iter().zip(&traced).any(|(light, traced)| *traced && light.is_distant());
        let is_bounded = |i: usize| bounded && casters.unending[i];
        let objects = 0..scene.objects.len();
        let casts = objects.clone().map(|i| casters.casts[i] && !is_bounded(i)).collect();
        let partly: Vec<bool> = objects.clone().map(|i| in_part.casts[i] || is_bounded(i)).collect();
        let unending: Vec<bool> = objects.map(|i| in_part.unending[i] || casters.unending[i]).collect();
        let aimed_at = |light: &Light| -> Vec<Target> {
            let partly = (!light.may_be_met() || light.may_stand_out()).then_some(in_part);
            let endless = |casters: &Casters| !casters.endless.is_empty();
            let balls = casters.balls.iter().chain(partly.iter().flat_map(|casters| &casters.balls));
            let endless = match partly {
                Some(in_part) => !light.is_distant() && (endless(casters) || endless(in_part)),
                None => !bounded && endless(casters),
            };
            balls.map(|ball| Target::Ball(*ball)).chain(endless.then_some(Target::Endless)).collect()
        };
        let mut sources = Vec::new();
        for (i, light) in scene.lights.iter().enumerate().filter(|(i, _)| traced[*i]) {
            let probability = scene.light_probability(i);
            let source = |target, probability| Source { light: i as u32, target, probability, guide: Guide::uniform() };
            if matches!(light, Light::AlongNormal { .. } | Light::Projector(_)) {
                sources.push(source(Target::Own, probability));
            } else {
                let targets = aimed_at(light);
                let each = probability / targets.len() as f64;
                sources.extend(targets.iter().map(|target| source(*target, each)));
            }
        }
        let total: f64 = sources.iter().map(|s| s.probability).sum();
        sources.iter_mut().for_each(|s| s.probability /= total);
        let sums = Caustics::sums(&sources);
        Caustics {
            casts,
            in_part: partly,
            unending,
            traced,
            sources,
            sums,
            ratio: 1.0,
            packets,
            parts: casters.parts || in_part.parts,
            merging: None,
        }
    }

    /// Chooses sources and cells by the root of what squares were found there, over the density that found them: the
    /// least variance, were they exact. Some go anywhere.
    pub(super) fn learn(&mut self, finds: &mut [Vec<Find>]) {
        let guides: Vec<(Guide, f64)> = finds.iter_mut().map(|finds| Guide::of(finds, ANYWHERE)).collect();
        let total: f64 = guides.iter().map(|(_, worth)| worth).sum();
        if total.is_nan() || total <= 0.0 {
            return;
        }
        let even = ANYWHERE / self.sources.len() as f64;
        for (source, (guide, worth)) in self.sources.iter_mut().zip(guides) {
            source.probability = (1.0 - ANYWHERE) * worth / total + even;
            source.guide = guide;
        }
        self.sums = Caustics::sums(&self.sources);
    }
}
