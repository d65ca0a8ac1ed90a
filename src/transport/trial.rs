//! Trials before the render: whether wavelengths that part at the glass before the camera are worth following together, and
//! whether paths are worth sharing by pixels.
//!
//! Two ways to spend time are equal where variance times cost is. Both are rendered at places spread over the picture, with as
//! many evenly spread samples as a replicate of the render has (sixteen at the most), because a hero's colours average out over its
//! samples; two replicates tell the variance. Costs are counted in rays, so that every machine decides alike.

use super::layers::LayerPlan;
use super::path::reuse;
use super::plan::{Effect, EffectPlan, Integrator};
use super::{Incoming, Samples, Shot};
use crate::film::accumulate::REPLICATES;
use crate::film::filter::FilterSampler;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::Scene;
use crate::scene::census::Census;
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

/// Share of the samples of the picture that either way takes in the trial of [`reuse`].
const SHARE: f64 = 1.0 / 128.0;
/// The least and most groups of pixels that are tried.
const GROUPS: (f64, f64) = (9.0, 256.0);
/// How much less the time to an error has to be for paths to be shared.
const WORTH_IT: f64 = 0.9;

/// Whether pixels share what their paths find, and what to say of it; nothing but for paths from the camera.
#[must_use]
#[expect(clippy::too_many_arguments, reason = "all that a picture is made of")]
pub fn reuse(
    scene: &Scene,
    census: &Census,
    moments: &[Scene],
    plan: &EffectPlan,
    filter: &FilterSampler,
    seed: u64,
    samples: u32,
    wish: Use,
) -> Option<(bool, Effect)> {
    let Integrator::Path(_) = &plan.integrator else { return None };
    let said = |on, reason: String| Some((on, Effect { name: "paths shared by pixels".into(), on, reason }));
    if let Some(obstacle) = reuse::obstacle(scene, census, plan, moments.len()) {
        return said(false, obstacle.into());
    }
    if let Some(on) = decided(wish) {
        return said(on, "the scene says so".into());
    }
    let [alone, together] = [false, true].map(|reuse| {
        let plan = EffectPlan { reuse, layers: LayerPlan::default(), ..plan.clone() };
        try_groups(&Shot { scene, plan: &plan, filter, seed: seed ^ STREAM, photons: None }, samples)
    });
    if together.pairs == 0 {
        return said(false, "no path goes from one diffuse surface to another".into());
    }
    let (on, reason) = judge(cost_of_error(&together) / cost_of_error(&alone), WORTH_IT);
    said(on, reason)
}

/// Renders groups of pixels.
fn try_groups(shot: &Shot, samples: u32) -> Tried {
    let each = (samples / REPLICATES as u32).clamp(1, MOST);
    let [width, height] = shot.scene.camera.resolution;
    let all = f64::from(width) * f64::from(height) * f64::from(samples);
    let wanted = SHARE * all / f64::from(2 * each * reuse::SIDE as u32);
    let side = wanted.clamp(GROUPS.0, GROUPS.1).sqrt() as usize;
    let groups: Vec<_> = (0..side * side)
        .into_par_iter()
        .map(|k| {
            let u = pairs(Sampler::new(shot.seed, [k as u32, 0], 0, 0).set(Set::Lens)).0;
            let place = super::place_in(shot.scene, side, k, u);
            let cell = [place.x, place.y].map(|x| x as i32 / reuse::SIDE as i32 * reuse::SIDE as i32);
            let pixel = [place.x as i32, place.y as i32];
            let group = reuse::groups(cell, [width, height]).find(|group| group.holds(pixel));
            let group = group.expect("each pixel of a cell is in a group");
            let pixels = group.pixels();
            let mut tried = Tried { colours: vec![[[0.0; 3]; 2]; pixels.len()], ..Tried::default() };
            let mut memory = Samples::default();
            for (replicate, index) in (0..2).flat_map(|replicate| (0..each).map(move |index| (replicate, index))) {
                let addresses = &group.samples(replicate, index)[..pixels.len()];
                memory.render(shot, addresses, |lane, sample, _, _| {
                    let rgb = ColourSpace::Rec709.from_xyz(sample.xyz);
                    for (sum, value) in tried.colours[lane][replicate as usize].iter_mut().zip(rgb) {
                        *sum += f64::from(value * sample.weight) / f64::from(each);
                    }
                });
                tried.rays += memory.rays(shot.scene, pixels.len());
                tried.pairs += u64::from(memory.pairs);
            }
            tried
        })
        .collect();
    Tried {
        rays: groups.iter().map(|group| group.rays).sum(),
        pairs: groups.iter().map(|group| group.pairs).sum(),
        colours: groups.into_iter().flat_map(|group| group.colours).collect(),
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
                    let rgb = ColourSpace::Rec709.from_xyz(observer::xyz(radiance, &wavelengths));
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

/// Variance, relative as that of a picture is, times cost.
fn cost_of_error(tried: &Tried) -> f64 {
    let values = || tried.colours.iter().flatten().flatten();
    let mean = values().sum::<f64>() / values().count() as f64;
    let floor = 0.01 * mean * mean;
    let mut squares: Vec<f64> = tried
        .colours
        .iter()
        .map(|[a, b]| (0..3).map(|c| (a[c] - b[c]).powi(2) / ((0.5 * (a[c] + b[c])).powi(2) + floor)).sum())
        .collect();
    squares.sort_by(f64::total_cmp);
    let most = FIREFLY * squares[squares.len() - squares.len() / 100 - 1];
    squares.iter().map(|square| square.min(most)).sum::<f64>() * tried.rays
}
