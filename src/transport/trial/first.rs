//! What the first vertices of paths do: whether they share what paths find, and how many shadow rays they send; and whether
//! any vertex sends some to light that is even over all directions.

use super::{MOST, STREAM, Tried, cost_of_error, decided, judge, variance};
use crate::film::accumulate::REPLICATES;
use crate::math::sampler::{PARTS, Sampler, Set, pairs};
use crate::scene::Scene;
use crate::scene::census::Census;
use crate::scene::equiangular;
use crate::scene::medium::Medium;
use crate::spectrum::ColourSpace;
use crate::transport::layers::LayerPlan;
use crate::transport::path::reuse;
use crate::transport::pilot::{Use, Wishes};
use crate::transport::plan::{Effect, EffectPlan, Integrator, PathSettings};
use crate::transport::{Samples, Shot, place_in};
use rayon::prelude::*;
use std::iter;

/// Share of the samples of the picture that each way takes in the trial.
const SHARE: f64 = 1.0 / 128.0;
/// The least and most groups of pixels that are tried.
const GROUPS: (f64, f64) = (9.0, 256.0);
/// How much less the time to an error has to be for a technique to be used.
const WORTH_IT: f64 = 0.9;
/// How many shadow rays are tried beside one. What others cost and gain follows.
const PROBED: u32 = 4;
/// The share of the variance that further shadow rays are believed to take away at the most. The trial tells it to ± 0.25, and where
/// rare bright paths make a part of the noise it sees none of them. Over 42 scenes and ten seeds what it chooses takes 1.05 times
/// the time to an error that the best number would, in place of 1.09 where all is believed.
const BELIEVED: f64 = 0.7;

/// Up to what ratio of times to an error distances in media are drawn toward lamps. What they save first is light of flights that end
/// near a lamp, rare and bright, of which a trial sees next to none: it expects about 1.25 times what comes (`tools/bench/NOTES.md`).
const NEAR_LAMPS: f64 = 1.1;
/// The same of lamps with extent over those without alone: near them nothing is rare and bright, and the trial, which counts rays,
/// expects down to 0.7 of the time that comes.
const NEAR_LARGE_LAMPS: f64 = 0.7;

/// What first vertices do.
#[derive(Clone, Debug)]
pub struct First {
    /// Whether they share what paths find.
    pub reuse: bool,
    /// How many shadow rays each sends.
    pub shadow_rays: u32,
    /// Whether shadow rays go to light that is even over all directions.
    pub asks_even_sky: bool,
    /// Toward how many of the scene's near lamps distances in media are drawn, too.
    pub near_lamps: usize,
    /// What to say of it.
    pub said: Vec<Effect>,
}

/// Paths that share, or do not.
struct Way {
    shadow_rays: u32,
    /// Variance times cost.
    cost: f64,
    /// The same where it has been rendered with so many, and is not worked out.
    tried: Option<f64>,
    /// That over what it is with one shadow ray; where one is best, what the best of several would have. Not a number where that is not known.
    ratio: f64,
    /// Whether vertices of different pixels saw each other.
    meets: bool,
}

/// The numbers of shadow rays among which is chosen: powers of two, so that aligned blocks of samples keep their strata.
pub fn counts() -> impl Iterator<Item = u32> {
    iter::successors(Some(1), |count| Some(2 * count)).take_while(|count| *count <= PARTS)
}

/// Why one shadow ray from a vertex is all that can be wanted; `None` where several may be.
#[must_use]
pub fn single(census: &Census, settings: &PathSettings) -> Option<&'static str> {
    if several_ways(settings) {
        Some("samples have several paths, or look for light in one way only")
    } else if census.lights() == 0 {
        Some("there are no lights")
    } else if census.lights() == 1 && census.delta_lights == 1 {
        Some("the only light has no extent")
    } else {
        None
    }
}

fn several_ways(settings: &PathSettings) -> bool {
    settings.light_samples != 1 || settings.scatter_samples != 1
}

/// What the first vertices of paths are to do; nothing but for paths from the camera.
#[must_use]
pub fn decide(shot: &Shot, census: &Census, moments: &[Scene], samples: u32, wishes: Wishes) -> Option<First> {
    let Shot { scene, plan, seed, .. } = *shot;
    let Integrator::Path(settings) = &plan.integrator else { return None };
    let try_out = |asks_even_sky, reuse, shadow_rays, near_lamps| {
        let layers = LayerPlan::default();
        let plan = EffectPlan { reuse, shadow_rays, asks_even_sky, near_lamps, layers, ..plan.clone() };
        try_groups(&Shot { plan: &plan, seed: seed ^ STREAM, ..*shot }, samples)
    };
    let single = single(census, settings);
    let fixed = single.map_or(wishes.shadow_rays, |_| Some(1));
    let way = |sky: bool, reuse: bool| {
        // Where the sky is the only light, nobody is asked.
        let fixed = if scene.asked(sky).is_nobody() { Some(1) } else { fixed };
        Way::find(fixed, reuse, |shadow_rays| try_out(sky, reuse, shadow_rays, 0))
    };
    let obstacle = reuse::obstacle(scene, census, plan, moments.len());
    let wish = obstacle.map_or_else(|| decided(wishes.reuse), |_| Some(false));

    // Whether to ask the even sky, where there is one and a choice.
    let sky = scene.uneven_asked.is_some() && !several_ways(settings);
    let sky_wish = if sky { decided(wishes.even_sky) } else { Some(true) };
    let settled = obstacle.unwrap_or("the scene says so");
    let best = |sky: bool| match (wish, fixed, sky_wish) {
        // What is settled needs no trial.
        (Some(reuse), Some(shadow_rays), Some(_)) => {
            (reuse, settled.to_owned(), Way { shadow_rays, cost: f64::NAN, tried: None, ratio: f64::NAN, meets: true })
        }
        (Some(reuse), ..) => (reuse, settled.to_owned(), way(sky, reuse)),
        (None, ..) => {
            let (alone, together) = (way(sky, false), way(sky, true));
            let (on, reason) = judge(together.cost / alone.cost, WORTH_IT);
            match together.meets {
                true if on => (true, reason, together),
                true => (false, reason, alone),
                false => (false, "no path goes from one diffuse surface to another".into(), alone),
            }
        }
    };
    let (asks_even_sky, why_sky, (reuse, why, way)) = match sky_wish {
        Some(asks) => (asks, "the scene says so".to_owned(), best(asks)),
        None => {
            let (asked, met) = (best(true), best(false));
            // Such rays, too, have to be worth it.
            let ratio = met.2.cost / asked.2.cost;
            let (leaves_out, reason) = judge(ratio, 1.0 / WORTH_IT);
            let reason = if ratio.is_nan() { reason } else { format!("without them {reason}") };
            (!leaves_out, reason, if leaves_out { met } else { asked })
        }
    };
    let mut said = Vec::new();
    if sky {
        said.push(Effect { name: "shadow rays to the even sky".into(), on: asks_even_sky, reason: why_sky });
    }
    let count = way.shadow_rays;
    let rays = match count {
        1 => "several shadow rays from the first vertex".into(),
        _ => format!("{count} shadow rays from the first vertex").into(),
    };
    let of_rays = match (single, wishes.shadow_rays) {
        (Some(reason), _) => reason.into(),
        (None, Some(_)) => "the scene says so".into(),
        (None, None) if scene.asked(asks_even_sky).is_nobody() => "no light is asked".into(),
        (None, None) => judge(way.ratio, WORTH_IT).1,
    };
    said.push(Effect { name: "paths shared by pixels".into(), on: reuse, reason: why });
    said.push(Effect { name: rays, on: count > 1, reason: of_rays });
    let (near_lamps, along) = along(scene, wishes.equiangular, |near_lamps| match way.tried {
        Some(cost) if near_lamps == 0 => cost,
        _ => cost_of_error(&try_out(asks_even_sky, reuse, count, near_lamps)),
    });
    said.extend(along);
    Some(First { reuse, shadow_rays: count, asks_even_sky, near_lamps, said })
}

/// Toward how many near lamps distances in media are drawn, and why; nothing to say where there are no such lamps or media. `cost` is
/// variance times cost with so many.
fn along(scene: &Scene, wish: Use, cost: impl Fn(usize) -> f64) -> (usize, Option<Effect>) {
    let near = &scene.near_lamps;
    let lamps = scene.lights.iter().filter(|light| equiangular::stands(light)).count();
    if lamps == 0 || !scene.media.iter().any(Medium::asks_lights) {
        return (0, None);
    }
    let points = near.iter().filter(|lamp| !lamp.has_extent).count();
    let (count, reason) = match decided(wish) {
        _ if near.is_empty() && lamps > equiangular::MOST => {
            (0, format!("there are more than {} lamps", equiangular::MOST))
        }
        _ if near.is_empty() => (0, "no lamp that stands somewhere is asked".into()),
        Some(on) => (if on { near.len() } else { 0 }, "the scene says so".into()),
        None => {
            let none = cost(0);
            let (mut best, mut least, mut said) = (0, none, None);
            // First toward those without extent, then toward all.
            let of_points = (points > 0).then_some((points, NEAR_LAMPS));
            let of_all = (near.len() > points).then_some((near.len(), NEAR_LARGE_LAMPS));
            for (count, bound) in of_points.into_iter().chain(of_all) {
                let cost = cost(count);
                let pays = cost / least < bound;
                if pays || said.is_none() {
                    said = Some(judge(cost / none, bound).1);
                }
                if pays {
                    (best, least) = (count, cost);
                }
            }
            (best, said.unwrap_or_default())
        }
    };
    (count, Some(Effect { name: "equiangular sampling".into(), on: count > 0, reason }))
}

impl Way {
    /// Finds how many shadow rays are best, if the number is not `fixed`, by rendering with some.
    fn find(fixed: Option<u32>, reuse: bool, try_out: impl Fn(u32) -> Tried) -> Way {
        let one = try_out(fixed.unwrap_or(1));
        let meets = one.pairs > 0;
        let variance_of_one = variance(&one);
        let cost = variance_of_one * one.rays;
        let way = |shadow_rays, ratio| Way { shadow_rays, cost, tried: Some(cost), ratio, meets };
        if let Some(shadow_rays) = fixed {
            return way(shadow_rays, f64::NAN);
        }
        if variance_of_one.is_nan() || variance_of_one <= 0.0 || reuse && !meets {
            return way(1, f64::NAN);
        }
        let several = try_out(PROBED);
        // V = a + b n^-1.5 and C = c + d (n − 1) of n rays, over those of one ray: what evenly spread rays find at the edge of a
        // shadow varies so.
        let fall = |n: u32| 1.0 - 1.0 / (f64::from(n) * f64::from(n).sqrt());
        let b = ((1.0 - variance(&several) / variance_of_one) / fall(PROBED)).min(BELIEVED);
        let d = (several.rays / one.rays - 1.0) / f64::from(PROBED - 1);
        let ratio = |n: u32| (1.0 - b * fall(n)) * (1.0 + d * f64::from(n - 1));
        let best = counts().skip(1).min_by(|a, b| ratio(*a).total_cmp(&ratio(*b))).unwrap_or(1);
        let least = ratio(best);
        match judge(least, WORTH_IT).0 {
            true => Way { cost: cost * least, tried: None, ..way(best, least) },
            false => way(1, least),
        }
    }
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
            let place = place_in(shot.scene, side, k, u);
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
