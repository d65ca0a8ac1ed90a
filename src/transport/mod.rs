//! Which effects, which paths, how much light.
//!
//! [`plan`] decides from the scene what has to be simulated; [`path`] and [`whitted`] carry eight
//! wavelengths along paths of light; [`Samples`] is the one entry: the light of some samples of one
//! pixel; [`sample`] is that of a single one.

pub mod layers;
pub mod light;
pub mod path;
pub mod plan;
pub mod whitted;

use crate::film::accumulate::REPLICATES;
use crate::film::filter::FilterSampler;
use crate::math::Ray;
use crate::math::sampler::{Octet, Sampler, Set, pairs};
use crate::scene::Scene;
use crate::spectrum::{LANES, Lanes, SampledWavelengths, observer};
use glam::DVec2;
use plan::{EffectPlan, Integrator, PathSettings};
use std::ops::Range;

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
    /// CIE XYZ of the light.
    pub xyz: [f32; 3],
    /// Coverage.
    pub alpha: f32,
    /// Weight of the reconstruction filter: ±1 up to its norm.
    pub weight: f32,
}

/// What all samples of a picture share.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// What is simulated.
    pub plan: &'a EffectPlan,
    /// Reconstruction filter.
    pub filter: &'a FilterSampler,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Where the random numbers of a sample come from.
#[derive(Clone, Copy)]
struct Address {
    pixel: [u32; 2],
    replicate: u32,
    index: u32,
}

/// A camera ray.
struct Begun {
    at: Address,
    wavelengths: SampledWavelengths,
    /// On the picture, in pixels.
    place: DVec2,
    weight: f32,
    ray: Ray,
}

impl Begun {
    #[inline]
    fn new(shot: &Shot, at: Address, sampler: &Sampler) -> Begun {
        let Shot { scene, plan, filter, .. } = shot;
        // Overscan has negative coordinates, which wrap as addresses.
        let corner = DVec2::new(f64::from(at.pixel[0] as i32), f64::from(at.pixel[1] as i32));
        if let Integrator::Whitted(settings) = &plan.integrator {
            // A regular grid, the same for every pixel. The wavelengths of all samples together make one
            // lattice: a step of the lanes' own distance over their number.
            let n = settings.grid;
            let s = at.index * REPLICATES as u32 + at.replicate;
            let cell = s % (n * n);
            let offset = DVec2::new(f64::from(cell % n) + 0.5, f64::from(cell / n) + 0.5) / f64::from(n);
            let nodes = f64::from(settings.samples()) * LANES as f64;
            let wavelengths = scene.wavelengths.sample((f64::from(s) + 0.5) / nodes);
            let place = corner + offset;
            let ray = scene.camera.ray(place, || DVec2::splat(0.5));
            return Begun { at, wavelengths, place, weight: 1.0, ray };
        }
        let (u_pixel, u_time) = pairs(sampler.set(Set::Camera));
        let wavelengths = scene.wavelengths.sample(u_time.x);
        let chosen = filter.sample(u_pixel);
        let place = corner + DVec2::splat(0.5) + chosen.offset;
        let ray = scene.camera.ray(place, || pairs(sampler.set(Set::Lens)).0);
        Begun { at, wavelengths, place, weight: chosen.weight, ray }
    }

    /// What `integrator` makes of the ray.
    #[inline]
    fn light(&self, shot: &Shot, sampler: &Sampler, integrator: &Integrator) -> Incoming {
        let Begun { at, wavelengths, ray, .. } = self;
        let Shot { scene, plan, .. } = shot;
        match integrator {
            Integrator::Path(settings) => {
                let rays = settings.light_samples.max(settings.scatter_samples);
                if rays == 1 {
                    return path::radiance(scene, plan, settings, sampler, wavelengths, ray);
                }
                // Several paths from one camera ray, each with numbers of its own.
                let mut sum = Incoming { radiance: Lanes::ZERO, alpha: 0.0, depth: f64::INFINITY };
                for i in 0..rays {
                    let index = at.index.wrapping_mul(rays).wrapping_add(i);
                    let sampler = Sampler::new(shot.seed, at.pixel, at.replicate, index);
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

    #[inline]
    fn finish(&self, shot: &Shot, light: Incoming) -> PixelSample {
        let radiance = fogged(shot.scene, shot.plan, light, self.wavelengths.nm);
        PixelSample {
            radiance,
            wavelengths: self.wavelengths,
            xyz: observer::xyz(radiance, &self.wavelengths),
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
    let shot = Shot { scene, plan, filter, seed };
    let sampler = Sampler::new(seed, pixel, replicate, index);
    let begun = Begun::new(&shot, Address { pixel, replicate, index }, &sampler);
    begun.finish(&shot, begun.light(&shot, &sampler, &plan.integrator))
}

/// The memory of samples that are rendered one after the other.
#[derive(Default)]
pub struct Samples {
    octet: Octet,
    begun: Vec<Begun>,
    layers: layers::Values,
}

impl Samples {
    /// Renders the samples `indices` of `replicate` at `pixel`, and gives each with the numbers of its layers. The
    /// indices over eight are of one whole number.
    pub fn render(
        &mut self,
        shot: &Shot,
        pixel: [u32; 2],
        replicate: u32,
        indices: Range<u32>,
        mut give: impl FnMut(&PixelSample, &[f32]),
    ) {
        let Samples { octet, begun, layers } = self;
        octet.reset(shot.seed, pixel, replicate, indices.start);
        // All camera rays first: one need not wait for the other.
        begun.clear();
        for index in indices {
            begun.push(Begun::new(shot, Address { pixel, replicate, index }, &octet.sampler(index)));
        }
        for begun in begun {
            let sampler = octet.sampler(begun.at.index);
            let light = begun.light(shot, &sampler, &shot.plan.integrator);
            let sample = begun.finish(shot, light);
            if !shot.plan.layers.layers.is_empty() {
                begun.layers(shot, &sampler, &sample, layers);
            }
            give(&sample, &layers.numbers);
        }
    }
}

impl Begun {
    /// The numbers of the layers of `sample`, which began here.
    #[inline]
    fn layers(&self, shot: &Shot, sampler: &Sampler, sample: &PixelSample, values: &mut layers::Values) {
        values.fill(
            shot.scene,
            shot.plan,
            &self.wavelengths,
            &self.ray,
            |step| shot.scene.camera.ray(self.place + step, || pairs(sampler.set(Set::Lens)).0),
            layers::Seen { radiance: sample.radiance, xyz: sample.xyz, alpha: sample.alpha },
            |integrator| {
                let light = self.light(shot, sampler, integrator);
                let xyz = observer::xyz(light.radiance, &self.wavelengths);
                layers::Seen { radiance: light.radiance, xyz, alpha: light.alpha }
            },
        );
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
