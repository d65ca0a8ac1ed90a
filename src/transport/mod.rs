//! Which effects, which paths, how much light.
//!
//! [`plan`] decides from the scene what has to be simulated; [`path`] and [`whitted`] carry eight
//! wavelengths along paths of light; [`sample`] is the one entry: the light of one sample of one
//! pixel.

pub mod layers;
pub mod light;
pub mod path;
pub mod plan;
pub mod whitted;

use crate::film::accumulate::REPLICATES;
use crate::film::filter::FilterSampler;
use crate::math::Ray;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::Scene;
use crate::spectrum::{LANES, Lanes, SampledWavelengths};
use glam::DVec2;
use plan::{EffectPlan, Integrator, PathSettings};

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

/// A camera ray, and the random numbers of what follows.
struct Begun {
    seed: u64,
    pixel: [u32; 2],
    replicate: u32,
    index: u32,
    sampler: Sampler,
    wavelengths: SampledWavelengths,
    /// On the picture, in pixels.
    place: DVec2,
    weight: f32,
    ray: Ray,
}

impl Begun {
    fn new(
        scene: &Scene,
        plan: &EffectPlan,
        filter: &FilterSampler,
        seed: u64,
        pixel: [u32; 2],
        replicate: u32,
        index: u32,
    ) -> Begun {
        // Overscan has negative coordinates, which wrap as addresses.
        let corner = DVec2::new(f64::from(pixel[0] as i32), f64::from(pixel[1] as i32));
        let sampler = Sampler::new(seed, pixel, replicate, index);
        if let Integrator::Whitted(settings) = &plan.integrator {
            // A regular grid, the same for every pixel. The wavelengths of all samples together make one
            // lattice: a step of the lanes' own distance over their number.
            let n = settings.grid;
            let s = index * REPLICATES as u32 + replicate;
            let cell = s % (n * n);
            let offset = DVec2::new(f64::from(cell % n) + 0.5, f64::from(cell / n) + 0.5) / f64::from(n);
            let nodes = f64::from(settings.samples()) * LANES as f64;
            let wavelengths = scene.wavelengths.sample((f64::from(s) + 0.5) / nodes);
            let place = corner + offset;
            let ray = scene.camera.ray(place, || DVec2::splat(0.5));
            return Begun { seed, pixel, replicate, index, sampler, wavelengths, place, weight: 1.0, ray };
        }
        let (u_pixel, u_time) = pairs(sampler.set(Set::Camera));
        let wavelengths = scene.wavelengths.sample(u_time.x);
        let chosen = filter.sample(u_pixel);
        let place = corner + DVec2::splat(0.5) + chosen.offset;
        let ray = scene.camera.ray(place, || pairs(sampler.set(Set::Lens)).0);
        Begun { seed, pixel, replicate, index, sampler, wavelengths, place, weight: chosen.weight, ray }
    }

    /// What `integrator` makes of the ray.
    #[inline]
    fn light(&self, scene: &Scene, plan: &EffectPlan, integrator: &Integrator) -> Incoming {
        let Begun { sampler, wavelengths, ray, .. } = self;
        match integrator {
            Integrator::Path(settings) => {
                let rays = settings.light_samples.max(settings.scatter_samples);
                if rays == 1 {
                    return path::radiance(scene, plan, settings, sampler, wavelengths, ray);
                }
                // Several paths from one camera ray, each with numbers of its own.
                let mut sum = Incoming { radiance: Lanes::ZERO, alpha: 0.0, depth: f64::INFINITY };
                for i in 0..rays {
                    let index = self.index.wrapping_mul(rays).wrapping_add(i);
                    let sampler = Sampler::new(self.seed, self.pixel, self.replicate, index);
                    let one = path::radiance(scene, plan, settings, &sampler, wavelengths, ray);
                    sum.radiance += one.radiance;
                    sum.alpha += one.alpha;
                    sum.depth = one.depth;
                }
                Incoming { radiance: sum.radiance / rays as f32, alpha: sum.alpha / rays as f32, ..sum }
            }
            Integrator::Whitted(settings) => whitted::radiance(scene, plan, settings, wavelengths, ray),
            Integrator::Depth => {
                let hit = scene.closest(ray, scene.camera.reach(ray));
                Incoming {
                    radiance: Lanes::splat(hit.map_or(0.0, |h| h.t as f32)),
                    alpha: if hit.is_some() { 1.0 } else { 0.0 },
                    depth: hit.map_or(f64::INFINITY, |h| scene.camera.depth(ray.at(h.t))),
                }
            }
            // Lights that the camera sees itself; the rest comes by itself.
            Integrator::Light(settings) => {
                let direct = PathSettings {
                    max_depth: Some(1),
                    hide_emitters: settings.hide_emitters,
                    ..PathSettings::default()
                };
                path::radiance(scene, plan, &direct, sampler, wavelengths, ray)
            }
            Integrator::Nothing => Incoming { radiance: Lanes::ZERO, alpha: 0.0, depth: f64::INFINITY },
        }
    }

    fn finish(&self, scene: &Scene, plan: &EffectPlan, light: Incoming) -> PixelSample {
        PixelSample {
            radiance: fogged(scene, plan, light, self.wavelengths.nm),
            wavelengths: self.wavelengths,
            alpha: light.alpha,
            weight: self.weight,
        }
    }
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
    let begun = Begun::new(scene, plan, filter, seed, pixel, replicate, index);
    begun.finish(scene, plan, begun.light(scene, plan, &plan.integrator))
}

/// [`sample`] with the numbers of its layers in `values`.
#[expect(clippy::too_many_arguments, reason = "the address of a sample and where to put it")]
pub fn sample_with_layers(
    scene: &Scene,
    plan: &EffectPlan,
    filter: &FilterSampler,
    seed: u64,
    pixel: [u32; 2],
    replicate: u32,
    index: u32,
    values: &mut Vec<f32>,
) -> PixelSample {
    let begun = Begun::new(scene, plan, filter, seed, pixel, replicate, index);
    let own = begun.light(scene, plan, &plan.integrator);
    let sample = begun.finish(scene, plan, own);
    values.clear();
    layers::append(
        scene,
        plan,
        &begun.wavelengths,
        &begun.ray,
        |step| scene.camera.ray(begun.place + step, || pairs(begun.sampler.set(Set::Lens)).0),
        layers::Seen { radiance: sample.radiance, alpha: own.alpha },
        |integrator| {
            let light = begun.light(scene, plan, integrator);
            layers::Seen { radiance: light.radiance, alpha: light.alpha }
        },
        values,
    );
    sample
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
