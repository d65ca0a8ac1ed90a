//! Which effects, which paths, how much light.
//!
//! [`plan`] decides from the scene what has to be simulated; [`path`] and [`whitted`] carry eight
//! wavelengths along paths of light; [`sample`] is the one entry: the light of one sample of one
//! pixel.

pub mod path;
pub mod plan;
pub mod whitted;

use crate::film::accumulate::REPLICATES;
use crate::film::filter::FilterSampler;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::Scene;
use crate::spectrum::{LANES, Lanes, SampledWavelengths};
use glam::DVec2;
use plan::{EffectPlan, Integrator};

/// Light that a camera ray brings, before fog.
#[derive(Clone, Copy, Debug)]
pub struct Incoming {
    /// Spectral radiance of each lane, W·m⁻²·sr⁻¹·nm⁻¹, scaled so that the mean over lanes of
    /// radiance × weight estimates the integral over wavelengths.
    pub radiance: Lanes,
    /// One where the ray met something, zero where it met the background only.
    pub alpha: f32,
    /// Distance of the first surface along the axis of the camera; infinite for none.
    pub depth: f64,
}

/// One sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelSample {
    /// The light.
    pub radiance: Lanes,
    /// Its wavelengths.
    pub wavelengths: SampledWavelengths,
    /// Coverage.
    pub alpha: f32,
    /// Weight of the reconstruction filter: ±1 up to its norm.
    pub weight: f32,
}

/// Renders sample `index` of `replicate` at `pixel`.
#[must_use]
pub fn sample(
    scene: &Scene,
    plan: &EffectPlan,
    filter: &FilterSampler,
    seed: u64,
    pixel: [u32; 2],
    replicate: u32,
    index: u32,
) -> PixelSample {
    let corner = DVec2::new(f64::from(pixel[0]), f64::from(pixel[1]));
    match &plan.integrator {
        Integrator::Whitted(settings) => {
            // A regular grid, the same for every pixel. The wavelengths of all samples together make one
            // lattice: a step of the lanes' own distance over their number.
            let n = settings.grid;
            let s = index * REPLICATES as u32 + replicate;
            let cell = s % (n * n);
            let offset = DVec2::new(f64::from(cell % n) + 0.5, f64::from(cell / n) + 0.5) / f64::from(n);
            let nodes = f64::from(settings.samples()) * LANES as f64;
            let wavelengths = scene.wavelengths.sample((f64::from(s) + 0.5) / nodes);
            let ray = scene.camera.ray(corner + offset, || DVec2::splat(0.5));
            let light = whitted::radiance(scene, plan, settings, &wavelengths, &ray);
            PixelSample {
                radiance: fogged(scene, plan, light, wavelengths.nm),
                wavelengths,
                alpha: light.alpha,
                weight: 1.0,
            }
        }
        Integrator::Path(settings) => {
            let sampler = Sampler::new(seed, pixel, replicate, index);
            let (u_pixel, u_time) = pairs(sampler.set(Set::Camera));
            let wavelengths = scene.wavelengths.sample(u_time.x);
            let place = filter.sample(u_pixel);
            let ray = scene.camera.ray(corner + DVec2::splat(0.5) + place.offset, || pairs(sampler.set(Set::Lens)).0);
            let light = path::radiance(scene, plan, settings, &sampler, &wavelengths, &ray);
            PixelSample {
                radiance: fogged(scene, plan, light, wavelengths.nm),
                wavelengths,
                alpha: light.alpha,
                weight: place.weight,
            }
        }
    }
}

/// Depth fog over what the camera sees.
fn fogged(scene: &Scene, plan: &EffectPlan, light: Incoming, nm: Lanes) -> Lanes {
    match &scene.fog {
        Some(fog) if plan.depth_fog => {
            let amount = fog.falloff.amount(light.depth) as f32;
            light.radiance * (1.0 - amount) + fog.colour.eval(nm) * amount
        }
        _ => light.radiance,
    }
}
