//! What the camera sees in mirrors and through glass: tells the pilot which photons would be collected.

use super::super::caustics::Caustics;
use super::super::light::{Bounds, LightPaths, seen_in_sharp};
use super::super::photons::{Photon, PhotonMap, Photons, Together};
use super::super::plan::EffectPlan;
use super::super::{moment_at, place_in, scene_at};
use super::camera::Colour;
use super::{BLOCKS, PIXELS, STREAM, Trial};
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::camera::Projection;
use crate::spectrum::{LANES, SampledWavelengths, observer};
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Pixels, as wide as they are at what is seen, that the first radius of merging spans.
pub(super) const FIRST_RADIUS: f64 = 2.5;

/// What surfaces are taken to reflect.
const ALBEDO: f64 = 0.5;

/// Places that are seen in sharp things.
pub(super) struct Seen {
    map: PhotonMap,
    /// Pixels for which each place stands.
    pixels: f64,
    /// Within which a photon is taken to be near a place, over the first radius of merging.
    widened: f64,
    /// The first radius of merging, metres.
    pub radius: f64,
    /// What light is multiplied by.
    light_unit: f32,
}

/// Light that came to some pixels.
pub(super) struct Arrival {
    pub block: usize,
    /// Luminance, as that of a splat.
    pub y: f64,
    /// The mean square of its colour's channels.
    pub square: f64,
    /// Pixels that get it.
    pub pixels: f64,
}

impl Seen {
    /// Looks through a few pixels of each block; `None` where nothing is seen so.
    pub fn of(trial: &Trial, plan: &EffectPlan, caustics: &Caustics) -> Option<Seen> {
        let Trial { scene, moments, settings, seed, .. } = *trial;
        // One wavelength stands for all.
        let caustics = Caustics { packets: false, ..caustics.clone() };
        let bounds = Bounds { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY };
        let settings = settings.of_light_paths();
        let caustics = Some(&caustics);
        let paths = LightPaths { scene, moments: &[], plan, settings, caustics, seed, bounds, wavelength: None };
        let size = DVec2::from(scene.camera.resolution.map(f64::from));
        let (pixels, each) = trial.tries();
        let tries = (2 * pixels * each).min(2 * PIXELS);
        let look = |block: usize, n: u32| {
            let sampler = Sampler::new(seed ^ STREAM, [block as u32, n], 1, 0);
            let (u_place, u) = pairs(sampler.set(Set::Camera));
            let scene = scene_at(scene, moments, |count| moment_at(u.y, count));
            let paths = LightPaths { scene, ..paths };
            let place = place_in(scene, BLOCKS, block, u_place);
            let ray = scene.camera.ray(place, || pairs(sampler.set(Set::Lens)).0);
            let seen = seen_in_sharp(&paths, &ray, &scene.wavelengths.sample(u.x), &sampler)?;
            Some(Photon { vertices: block as u32, ..seen })
        };
        let places: Vec<Photon<Together>> = (0..BLOCKS * BLOCKS)
            .into_par_iter()
            .flat_map_iter(|block| (0..tries).filter_map(move |n| look(block, n)))
            .collect();
        let eye = scene.camera.world_from_camera.translation;
        let mut distances: Vec<f64> = places.iter().map(|p| (p.point - eye).length()).collect();
        distances.sort_by(f64::total_cmp);
        let distance = *distances.get(distances.len() / 2)?;
        let side = 2.0 / size.x;
        let pixel = match scene.camera.projection {
            Projection::Perspective { half_width } => half_width * side * distance,
            Projection::Orthographic { half_width } => {
                half_width * side * scene.camera.world_from_camera.matrix3.x_axis.length()
            }
        };
        let radius = FIRST_RADIUS * pixel;
        let pixels = size.x * size.y / (BLOCKS * BLOCKS * tries as usize) as f64;
        let widened = pixels.sqrt().max(1.0);
        let places = [Photons { together: places, ..Photons::over(1.0) }];
        (radius > 0.0).then(|| Seen {
            map: PhotonMap::new(&places, 1, radius * widened),
            pixels,
            widened,
            radius,
            light_unit: scene.light_unit(),
        })
    }

    /// Where the light of a photon, whose power is told over `unit_area`, would come to.
    pub fn collect(
        &self,
        photon: &Photon<Together>,
        unit_area: f64,
        wavelengths: &SampledWavelengths,
        arrivals: &mut Vec<Arrival>,
    ) {
        let light = photon.light.power * self.light_unit * (LANES as f32 / photon.light.rho.reduce_add());
        let scale = ALBEDO * unit_area / (PI * PI * self.radius * self.radius);
        let colour = Colour::of(observer::xyz(light, wavelengths));
        let (by_area, square) = (colour.y * scale, colour.square() * scale * scale);
        if by_area <= 0.0 {
            return;
        }
        let pixels = self.pixels / (self.widened * self.widened);
        self.map.each_near(photon.point, photon.normal.as_dvec3(), |seen| {
            let share = f64::from(seen.light.power.reduce_add() / seen.light.rho.reduce_add());
            arrivals.push(Arrival {
                block: seen.vertices as usize,
                y: by_area * share,
                square: square * share * share,
                pixels,
            });
        });
    }
}
