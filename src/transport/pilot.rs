//! Whether light is traced from the lights, where to, and how much: decided by a pilot of few paths.
//!
//! All numbers of the pilot are functions of scene and seed, and costs are counted in rays, not in seconds: every
//! machine that renders a part of a picture decides alike.

mod aims;
mod camera;
mod rounds;
mod seen;
mod words;

use super::Shot;
use super::caustics::Caustics;
use super::light::{Bounds, LightPaths};
use super::plan::{Effect, EffectPlan, Integrator, PathSettings};
use crate::film::accumulate::REPLICATES;
use crate::film::error::floor_about;
use crate::film::filter::FilterSampler;
use crate::scene::Scene;
use crate::scene::casters::{self, Casters};
use crate::scene::light::Light;
use crate::transport::layers;
use aims::{chance, is_small};
use camera::{Camera, from_camera};
use glam::DVec2;
use rounds::Round;
use seen::Seen;
use std::sync::Arc;
use words::{say, technique};

/// Whether a technique is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Use {
    /// Where it pays.
    #[default]
    Auto,
    /// Wherever it can be.
    On,
    /// Not.
    Off,
}

/// What is wished for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wishes {
    /// Paths from the lights.
    pub light_tracing: Use,
    /// Wavelengths that part followed together.
    pub packets: Use,
    /// Photons collected where mirrors and glass are seen.
    pub merging: Use,
    /// Paths that pixels share.
    pub reuse: Use,
    /// Shadow rays to light that is even over all directions.
    pub even_sky: Use,
    /// Small pictures of lamps looked for by themselves.
    pub glints: Use,
    /// Distances in media drawn toward lamps.
    pub equiangular: Use,
    /// How many shadow rays first vertices send.
    pub shadow_rays: Option<u32>,
}

/// Rounds of paths from the lights: each is aimed by what those before it have learnt.
const ROUNDS: u32 = 4;

/// Share of the rays of the picture after which light that nothing else finds is no longer looked for by further rounds, and paths
/// from the lights for each from the camera where it was not found: it may be there all the same, and is then found by these.
const PATIENCE: f64 = 1.0 / 8.0;

/// Share of the rays of the picture that a round may take beyond the least number of paths.
const SHARE: f64 = 1.0 / 256.0;

/// Blocks of the picture along each side; each gets paths from the camera.
const BLOCKS: usize = 32;

/// Pixels of a block that are tried at the most.
const PIXELS: u32 = 4;

/// Samples that are enough to tell how evenly spread ones do.
const EVEN: u32 = 16;

/// Tells the pilot's numbers from the picture's.
const STREAM: u64 = 0x7069_6c6f_7470_696c;

/// How often paths from the camera must have met light of the class to trust what they say about it: those of the pilot, and those
/// of the picture, whose stated error counts what they have met.
const ENOUGH: usize = 16;

/// The share of what comes from the lights that paths from the camera must bring to be trusted, however many met some.
const MET: f64 = 0.5;

/// What light tracing with merging costs beyond its rays: 1.05 to 1.3 in scenes of the gallery.
const OVERHEAD: f64 = 1.2;

/// Square of the brightness of light in mirrors and glass, over the rest's variance in the picture, below which it is not
/// worth merging.
const FAINT: f64 = 0.1;

/// Share of the rest's variance above which light that is met in mirrors and glass is worth merging.
const WORTH: f64 = 0.3;

/// What no path finds where none is traced from the lights.
const MISSING: &str = "what mirrors and glass throw of lamps without extent is missing";

/// Nothing traced from the lights, for this reason.
#[must_use]
fn left_off(reason: &str) -> (Option<Arc<Caustics>>, Vec<Effect>) {
    (None, vec![technique("light tracing", false, reason.to_owned())])
}

/// Whether two scenes have the same lamps, by their numbers, and the same things that focus light.
fn correspond(a: &Scene, b: &Scene) -> bool {
    let kinds = |scene: &Scene| -> Vec<_> { scene.lights.iter().map(std::mem::discriminant).collect() };
    kinds(a) == kinds(b) && a.dark == b.dark && a.light_groups == b.light_groups && casters::casts_alike(a, b)
}

/// Decides for a picture of `samples` a pixel, and returns what to trace and what to say of it. `moments` are the scene
/// while the shutter is open, of which each path sees one; none where nothing is blurred. `goes_on` hears how much of its patience a
/// search for light that has found none has used up, if there is one, and ends it where it is false; what is then returned means
/// nothing.
#[must_use]
pub fn decide(
    shot: &Shot,
    moments: &[Scene],
    samples: u32,
    wishes: Wishes,
    goes_on: &(dyn Fn(Option<f64>) -> bool + Sync),
) -> (Option<Arc<Caustics>>, Vec<Effect>) {
    let Shot { scene, plan, filter, seed, .. } = *shot;
    let Integrator::Path(settings) = &plan.integrator else { return (None, Vec::new()) };
    if wishes.light_tracing == Use::Off {
        return left_off("the scene says so");
    }
    let scenes = || std::iter::once(scene).chain(moments);
    // Which paths are left to the lights is told by the numbers of lamps and things.
    if !moments.iter().all(|moment| correspond(scene, moment)) {
        let throws = |scene: &Scene| !Casters::of(scene, &[]).is_empty() || !Casters::in_part(scene, &[]).is_empty();
        if !scenes().any(throws) {
            return left_off("nothing mirrors or refracts sharply");
        }
        let reason =
            "a lamp goes on or off, or something begins or ceases to mirror or refract, while the shutter is open";
        return left_off(&format!("{reason}: {MISSING}"));
    }
    let casters = Casters::of(scene, moments);
    let without_extent = settings.delta_caustics && scene.lights.iter().any(|light| !light.may_be_met());
    let stands_out = scene.lights.iter().any(Light::may_stand_out);
    let in_part = if without_extent || stands_out { Casters::in_part(scene, moments) } else { Casters::none(scene) };
    if casters.is_empty() && in_part.is_empty() {
        return left_off("nothing mirrors or refracts sharply");
    }
    let chances: Vec<f64> = (0..scene.lights.len()).map(|i| chance(scene, i, &casters)).collect();
    let few = |chance: f64| chance * paths(scene, samples) < ENOUGH as f64;
    let is_rare = |(light, chance): (&Light, &f64)| light.may_be_met() && casters.single && few(*chance);
    let rare: Vec<bool> = scene.lights.iter().zip(&chances).map(is_rare).collect();
    // What no path from the camera finds, or hardly any, is worth its noise.
    let unfound = without_extent && (casters.single || in_part.single);
    if filter.leaves_gaps() && wishes.light_tracing == Use::Auto && !unfound && !rare.contains(&true) {
        return left_off("the filter leaves gaps between pixels: little of what comes to the picture would be in any");
    }
    // What cannot be traced has no path that finds it.
    let lost = |reason: &str| if unfound { left_off(&format!("{reason}: {MISSING}")) } else { left_off(reason) };
    if let Some(curve) = scenes().find_map(casters::one_way) {
        let name = &curve.name;
        return lost(&format!("light leaves {name}, a curve, unseen, and its way back from the lights is another"));
    }
    if settings.scatter_samples == 0 || settings.max_depth.is_some_and(|depth| depth < 3) {
        return left_off("paths are too short for light of mirrors and glass");
    }
    if settings.count_crossings && scenes().any(|scene| scene.has_boundaries) {
        if settings.max_depth.is_some() {
            return lost("panes count for the length of paths");
        }
        if settings.hide_emitters {
            return lost("lamps are hidden up to the first pane only");
        }
    }
    if plan.layers.layers.iter().any(|layer| matches!(layer.source, layers::Source::Light(..))) {
        return lost("layers of light are measured path by path from the camera");
    }
    let wanted = |light: &Light| settings.delta_caustics || light.may_be_met();
    // No path begins at a light of weight 0: what it throws is met by chance or not at all.
    let begins = |i: usize| scene.light_probability(i) > 0.0;
    let small = |i: usize| is_small(scene, i, chances[i], &casters);
    let traced: Vec<bool> = scene.lights.iter().enumerate().map(|(i, l)| wanted(l) && begins(i) && small(i)).collect();
    if !traced.contains(&true) {
        return left_off(if settings.delta_caustics {
            "no light is small or has a sun"
        } else {
            "no light that a path from the camera can meet is small or has a sun"
        });
    }
    let packets = wishes.packets != Use::Off && (casters.parts || in_part.parts);
    let caustics = Caustics::untrained(scene, &casters, &in_part, traced, packets);
    if caustics.sources.is_empty() {
        let name = casters.endless.iter().chain(&in_part.endless).next().map_or("", String::as_str);
        return lost(&format!("light from infinity cannot be aimed at what has no end, {name}"));
    }
    let (casters, in_part) = (&casters, &in_part);
    let trial = Trial {
        scene,
        moments,
        plan,
        settings,
        filter,
        seed,
        samples,
        wishes,
        casters,
        in_part,
        chances,
        rare,
        goes_on,
    };
    run(&trial, caustics)
}

/// What a decision rests on.
struct Trial<'a> {
    scene: &'a Scene,
    moments: &'a [Scene],
    plan: &'a EffectPlan,
    settings: &'a PathSettings,
    filter: &'a FilterSampler,
    seed: u64,
    /// Of a pixel.
    samples: u32,
    wishes: Wishes,
    casters: &'a Casters,
    /// What throws light of lamps without extent alone.
    in_part: &'a Casters,
    /// For each light, how often a path from the camera may meet it by what throws its light.
    chances: Vec<f64>,
    /// For each light, whether it has an extent, but one so small that all paths from the camera are not expected to meet it by what
    /// throws it in single directions often enough for the stated error to know of it.
    rare: Vec<bool>,
    /// Whether to go on, with a search that has used up this share of its patience, if it is one.
    goes_on: &'a (dyn Fn(Option<f64>) -> bool + Sync),
}

/// Paths from the camera for the whole picture.
fn paths(scene: &Scene, samples: u32) -> f64 {
    let [width, height] = scene.camera.resolution.map(f64::from);
    width * height * f64::from(samples)
}

impl Trial<'_> {
    /// Paths from the camera for the whole picture.
    fn paths(&self) -> f64 {
        paths(self.scene, self.samples)
    }

    /// Pixels of a block to try, and the samples of each of two replicates there: together no more than a hundredth of the
    /// picture's, or one of each.
    fn tries(&self) -> (u32, u32) {
        let wanted = (0.01 * self.paths() / (2 * BLOCKS * BLOCKS) as f64) as u32;
        let each = wanted.clamp(1, EVEN.min(self.samples / REPLICATES as u32).max(1));
        ((wanted / each).clamp(1, PIXELS), each)
    }
}

/// The weight of a squared error in each block: relative to its mean, in the dark to a tenth of that of the picture.
fn relative(means: &[f64]) -> Vec<f64> {
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    means.iter().map(|m| if mean > 0.0 { 1.0 / (m * m + floor_about(mean)) } else { 1.0 }).collect()
}

/// The mean of values with weights.
fn average(values: &[(usize, f64)], weights: &[f64]) -> f64 {
    values.iter().map(|(block, v)| v * weights[*block]).sum::<f64>() / values.len() as f64
}

/// Whether a light that is traced has no extent, so that no path from the camera can find it by chance.
fn endless_odds(scene: &Scene, caustics: &Caustics) -> bool {
    scene.lights.iter().zip(&caustics.traced).any(|(light, traced)| *traced && !light.may_be_met())
}

/// The mean of values with weights, without the largest hundredth: single fireflies do not decide.
fn trimmed(values: &[(usize, f64)], weights: &[f64]) -> f64 {
    let mut weighted: Vec<f64> = values.iter().map(|(block, v)| v * weights[*block]).collect();
    weighted.sort_by(f64::total_cmp);
    let kept = weighted.len() - weighted.len() / 100;
    weighted[..kept].iter().sum::<f64>() / kept as f64
}

/// What rounds of paths from the lights have found.
struct Search {
    /// In the last round.
    found: Round,
    /// Paths of all rounds.
    followed: u64,
    /// The weight of a squared error in each block.
    weights: Vec<f64>,
    /// Whether any round, and what is collected of any, had light that no path from the camera could find, or hardly any would.
    unfound: bool,
    unfound_gathered: bool,
}

/// Follows rounds of paths from the lights, each aimed by what those before it have found. Where it is `possible` that there is
/// light that nothing else finds, they go on until some is found or the patience ends.
fn search(
    trial: &Trial,
    caustics: &mut Caustics,
    plan: &EffectPlan,
    seen: Option<&Seen>,
    camera: &Camera,
    possible: bool,
) -> Search {
    let Trial { scene, moments, settings, seed, .. } = *trial;
    let high = DVec2::from_array(scene.camera.resolution.map(f64::from));
    let mut weights = relative(&camera.means);
    let mut learnt = vec![Vec::new(); caustics.sources.len()];
    let most_rays = SHARE * trial.paths() * camera.rays;
    let patience = PATIENCE * trial.paths() * camera.rays;
    let (mut followed, mut rays) = (0, 0.0);
    // As soon as one path has found light that no path from the camera could, or that hardly any would, it is traced.
    let (mut unfound, mut unfound_gathered) = (false, false);
    let mut number = 0;
    loop {
        let paths = LightPaths {
            scene,
            moments,
            plan,
            settings: settings.of_light_paths(),
            caustics: Some(&*caustics),
            seed: seed ^ STREAM,
            bounds: Bounds { low: DVec2::ZERO, high },
            wavelength: None,
        };
        let found = trial.round(&paths, seen, number, &weights, most_rays, &mut learnt);
        followed += found.paths;
        rays += found.rays * found.paths as f64;
        unfound |= found.unfound;
        unfound_gathered |= found.unfound_gathered;
        caustics.learn(&mut learnt);
        // The first rounds are no search: they tell what to decide by.
        let searches = number + 1 >= ROUNDS && possible && !unfound && !found.came() && rays < patience;
        let stopped = !(trial.goes_on)(searches.then(|| rays / patience));
        if number + 1 < ROUNDS && !stopped {
            // What the lights send there is part of the picture that errors are relative to.
            let means: Vec<f64> = camera.means.iter().zip(&found.thrown).map(|(a, b)| a + b).collect();
            weights = relative(&means);
        } else if !searches || stopped {
            return Search { found, followed, weights, unfound, unfound_gathered };
        }
        number += 1;
    }
}

/// Tries what `caustics` would trace, and decides by what it finds.
fn run(trial: &Trial, mut caustics: Caustics) -> (Option<Arc<Caustics>>, Vec<Effect>) {
    let Trial { scene, moments, plan, filter, seed, wishes, .. } = *trial;
    let seen = match wishes.merging {
        Use::Off => None,
        Use::Auto | Use::On => Seen::of(trial, plan, &caustics),
    };
    // As if photons were collected, so that what they would bring is told from the rest.
    let wanted = Caustics { merging: Some(1.0), ..caustics.clone() };
    let with_all = EffectPlan { caustics: Some(Arc::new(wanted)), ..plan.clone() };
    let shot = Shot { scene, plan: &with_all, filter, seed: seed ^ STREAM, photons: None };
    let camera = from_camera(&shot, moments, trial.tries());
    let [width, height] = scene.camera.resolution.map(f64::from);
    let pixels = width * height;
    let endless = endless_odds(scene, &caustics);
    let traced = || (0..scene.lights.len()).filter(|&i| caustics.traced[i]);
    let rare = traced().any(|i| trial.rare[i]);
    let chance = traced().map(|i| trial.chances[i]).fold(0.0, f64::max);
    // Whether there may be light that no path from the camera finds, or hardly any.
    let possible = rare || endless && (trial.casters.single || trial.in_part.single);
    let searched = search(trial, &mut caustics, &with_all, seen.as_ref(), &camera, possible);
    let Search { found, followed, weights, unfound, unfound_gathered } = searched;
    // It may be there all the same.
    let missing = possible && !found.came();
    if !found.came() && !unfound && !possible && wishes.light_tracing == Use::Auto {
        return left_off(&format!(
            "of {followed} paths from the lights none came to the picture over {}",
            trial.throwers()
        ));
    }

    // Paths from the camera that find light of mean m with a probability p have a variance of m² / p, whether or not so
    // few paths met it; for a lamp without extent p is zero, and where none was met no more than the largest lamp's chance.
    let square = |means: &[f64]| means.iter().zip(&weights).map(|(m, w)| w * m * m).sum::<f64>() / means.len() as f64;
    let by_chance = |means: &[f64], met: usize| match square(means) {
        square if square > 0.0 && endless => f64::INFINITY,
        square if square > 0.0 && met == 0 => square / chance.min(1.0 / camera.paths as f64),
        square => square * camera.paths as f64 / met.max(1) as f64,
    };
    // Ground glass sends a little of a small lamp's light far from where it sends the most: however often that is met, the rest may
    // never have been. It is met by less than one of as many paths.
    let not_met = |means: &[f64], brought: f64| {
        let whole = means.iter().sum::<f64>() / means.len() as f64;
        match brought < MET * whole {
            true => square(means) * (1.0 - brought / whole).powi(2) * camera.paths as f64,
            false => 0.0,
        }
    };
    // Light that is seen in mirrors and glass: often met, it is known what it costs to leave it to chance, else it is told
    // from how bright it is.
    let (kept, mirrored) = (trimmed(&camera.kept, &weights), average(&camera.mirrored, &weights));
    let unmerged = match camera.met_mirrored {
        _ if unfound_gathered => f64::INFINITY,
        // Of a light that is a sky and a sun they may have met the sky alone, however often.
        ENOUGH.. => mirrored.max(found.gathered_by_chance).max(not_met(&found.gathered, camera.brought_mirrored)),
        met => by_chance(&found.gathered, met).max(found.gathered_by_chance),
    };
    // What all paths of the picture are not expected to find once is missing; where that is less than the noise shows, nothing is gained.
    let faint = !endless
        && found.gathered_by_chance == 0.0
        && chance * paths(scene, trial.samples) < 1.0
        && square(&found.gathered) * f64::from(trial.samples) < FAINT * kept;
    let counts = found.collected > 0.0 && !faint && unmerged > WORTH * kept;
    let merging = match wishes.merging {
        Use::On => true,
        Use::Auto => counts,
        Use::Off => false,
    };
    caustics.merging = seen.as_ref().filter(|_| merging).map(|seen| seen.radius);
    let merges = caustics.merging.is_some();

    // Errors by sample and pixel: (A + B / k)(a + k b) is least for k = √(B a / (A b)).
    let (a, b) = (camera.rays, found.rays);
    let thrown = (found.splatted + if merges { found.collected } else { 0.0 }) / (pixels * pixels);
    let ratio = (thrown * a / (kept.max(f64::MIN_POSITIVE) * b)).sqrt();
    let least = if missing { PATIENCE } else { 1.0 / 64.0 };
    caustics.ratio = ratio.clamp(least, 16.0);
    let k = caustics.ratio;
    let (left, overhead) = if merges { (0.0, OVERHEAD) } else { (mirrored, 1.0) };
    let with = overhead * (kept + left + thrown / k) * (a + k * b);
    let measured = if camera.met >= ENOUGH { average(&camera.all, &weights) } else { f64::INFINITY };
    let without = match unfound || missing {
        true => f64::INFINITY,
        false => {
            let by_chance = measured.min(kept + mirrored + by_chance(&found.thrown, camera.met));
            by_chance.max(kept + found.by_chance).max(kept + not_met(&found.thrown, camera.brought)) * a
        }
    };
    if wishes.light_tracing == Use::Auto && without < with {
        let loss = with / without;
        return left_off(&format!(
            "the pilot expects it to cost {loss:.1} times as much: paths from the camera find the light over {}, or it hardly counts",
            trial.throwers()
        ));
    }
    let said = say(trial, &caustics, &camera, k * b / (a + k * b), seen.is_some(), found.collected > 0.0);
    (Some(Arc::new(caustics)), said)
}
