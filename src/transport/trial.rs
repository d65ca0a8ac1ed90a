//! Trials before the render: whether wavelengths that part at the glass before the camera are worth following together, whether
//! paths are worth sharing by pixels, and how many shadow rays their first vertices are to send.
//!
//! Two ways to spend time are equal where variance times cost is. Both are rendered at places spread over the picture, with as
//! many evenly spread samples as a replicate of the render has (sixteen at the most), because a hero's colours average out over its
//! samples; two replicates tell the variance. Costs are counted in rays, so that every machine decides alike.

pub mod first;

use super::plan::{Effect, EffectPlan, Integrator};
use super::{Incoming, Shot};
use crate::film::accumulate::REPLICATES;
use crate::film::error::floor_about;
use crate::film::filter::FilterSampler;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::Scene;
use crate::spectrum::{ColourSpace, observer};
use crate::transport::pilot::Use;
use rayon::prelude::*;

/// Pixels for each place that is tried, and the least and most places along a side of the picture.
const PIXELS: f64 = 256.0;
const SIDES: (f64, f64) = (8.0, 32.0);
/// Samples that are enough to tell how evenly spread ones do.
const MOST: u32 = 16;
/// A place counts at most as so many times what 99 of 100 stay below: single fireflies do not decide.
const FIREFLY: f64 = 4.0;
/// What a ray of eight that go side by side costs of one that goes alone, as measured: they meet the same things.
const SIDE_BY_SIDE: f64 = 0.8;
/// Tells the random numbers of the trial from those of the picture.
const STREAM: u64 = 0x7472_6961_6c6f_6667;

/// What one way of rendering makes of the places.
#[derive(Default)]
struct Tried {
    /// Linear Rec. 709 of two replicates.
    colours: Vec<[[f64; 3]; 2]>,
    rays: f64,
    /// Pairs of vertices that were asked whether they see each other.
    pairs: u64,
}

/// Whether packets pay, and what to say of it; nothing where no smooth glass disperses.
#[must_use]
pub fn packets(
    scene: &Scene,
    plan: &EffectPlan,
    filter: &FilterSampler,
    seed: u64,
    samples: u32,
    wish: Use,
) -> Option<(bool, Effect)> {
    let Integrator::Path(_) = &plan.integrator else { return None };
    if !plan.packets {
        return None;
    }
    let said = |on, reason| Some((on, Effect { name: "wavelength packets from the camera".into(), on, reason }));
    if let Some(on) = decided(wish) {
        return said(on, "the scene says so".into());
    }
    let each = (samples / REPLICATES as u32).clamp(1, MOST);
    let [alone, together] = [false, true].map(|packets| {
        let plan = EffectPlan { packets, caustics: None, ..plan.clone() };
        try_out(&Shot { scene, plan: &plan, filter, seed: seed ^ STREAM, photons: None }, each)
    });
    if together.rays == alone.rays {
        return said(false, "no path from the camera parts".into());
    }
    let (on, reason) = judge(SIDE_BY_SIDE * cost_of_error(&together) / cost_of_error(&alone), 1.0);
    said(on, reason)
}

/// What the scene says of a technique, where it does.
fn decided(wish: Use) -> Option<bool> {
    match wish {
        Use::Auto => None,
        Use::On => Some(true),
        Use::Off => Some(false),
    }
}

/// Whether what takes `ratio` times the time to the same error is worth it, as it is below `bound`, and why.
fn judge(ratio: f64, bound: f64) -> (bool, String) {
    match ratio.is_nan() {
        true => (false, "the trial sees no light".into()),
        false => (ratio < bound, format!("the trial expects {ratio:.2} times the time to the same error")),
    }
}

/// Renders the places.
fn try_out(shot: &Shot, each: u32) -> Tried {
    let [width, height] = shot.scene.camera.resolution.map(f64::from);
    let side = (width * height / PIXELS).sqrt().clamp(SIDES.0, SIDES.1) as usize;
    let places: Vec<_> = (0..side * side)
        .into_par_iter()
        .map(|k| {
            let u = pairs(Sampler::new(shot.seed, [k as u32, 0], 0, 0).set(Set::Lens)).0;
            let place = super::place_in(shot.scene, side, k, u);
            let mut rays = 0.0;
            let colours = [0, 1].map(|replicate| {
                let mut sum = [0.0; 3];
                for index in 0..each {
                    let (light, wavelengths) = super::probe(shot, [place.x as u32, place.y as u32], replicate, index);
                    let Incoming { radiance, events, .. } = light;
                    // A ray to the next vertex and one to a light from each.
                    rays += f64::from(1 + 2 * events);
                    let rgb =
                        ColourSpace::Rec709.from_xyz(observer::xyz(radiance * shot.scene.light_unit(), &wavelengths));
                    for (sum, value) in sum.iter_mut().zip(rgb) {
                        *sum += f64::from(value) / f64::from(each);
                    }
                }
                sum
            });
            (colours, rays)
        })
        .collect();
    let rays = places.iter().map(|p| p.1).sum();
    Tried { rays, colours: places.into_iter().map(|p| p.0).collect(), pairs: 0 }
}

/// Variance times cost.
fn cost_of_error(tried: &Tried) -> f64 {
    variance(tried) * tried.rays
}

/// Variance, relative as that of a picture is; the sum of all places.
fn variance(tried: &Tried) -> f64 {
    let values = || tried.colours.iter().flatten().flatten();
    let mean = values().sum::<f64>() / values().count() as f64;
    let floor = floor_about(mean);
    let mut squares: Vec<f64> = tried
        .colours
        .iter()
        .map(|[a, b]| (0..3).map(|c| (a[c] - b[c]).powi(2) / ((0.5 * (a[c] + b[c])).powi(2) + floor)).sum())
        .collect();
    squares.sort_by(f64::total_cmp);
    let most = FIREFLY * squares[squares.len() - squares.len() / 100 - 1];
    squares.iter().map(|square| square.min(most)).sum()
}
