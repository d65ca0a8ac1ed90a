//! Whether light is traced from the lights, where to, and how much: decided by a pilot of few paths.
//!
//! All numbers of the pilot are functions of scene and seed, and costs are counted in rays, not in seconds: every
//! machine that renders a part of a picture decides alike.

mod seen;

use super::Shot;
use super::caustics::{Caustics, Source, Target};
use super::guide::{Find, Guide};
use super::light::{Bounds, LightPaths, trace};
use super::merge;
use super::plan::{Effect, EffectPlan, Integrator, PathSettings};
use crate::film::accumulate::REPLICATES;
use crate::film::filter::FilterSampler;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::bvh::Aabb;
use crate::scene::casters::Casters;
use crate::scene::environment::Environment;
use crate::scene::light::Light;
use crate::scene::{Geometry, Scene};
use crate::spectrum::{ColourSpace, Lanes, observer};
use crate::transport::layers::Source as Channel;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use seen::{Arrival, Seen};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

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
}

/// Rounds of paths from the lights: each is aimed by what those before it have learnt.
const ROUNDS: u32 = 4;

/// Paths of a round at least and at most.
const FROM_LIGHTS: [u64; 2] = [1 << 11, 1 << 14];

/// Of that many are always as many followed as all.
const AT_ONCE: u64 = 1 << 11;

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

/// Share of the paths that go where the pilot found nothing: it may have missed something.
const ANYWHERE: f64 = 0.2;

/// How often the pilot must have met light of the class on its paths from the camera to trust what they say about it.
const ENOUGH: usize = 16;

/// Half of the solid angle of a hemisphere in which light counts as coming from one place, over 2π.
const SMALL: f64 = 0.3;

/// What light tracing with merging costs beyond its rays: 1.05 to 1.3 in scenes of the gallery.
const OVERHEAD: f64 = 1.2;

/// A name and whether it holds, for people.
fn technique(name: &'static str, on: bool, reason: String) -> Effect {
    Effect { name: name.into(), on, reason }
}

/// Nothing traced from the lights, for a reason that is not the pilot's.
#[must_use]
pub fn left_off(reason: &str) -> (Option<Arc<Caustics>>, Vec<Effect>) {
    (None, vec![technique("light tracing", false, reason.to_owned())])
}

/// Decides for a picture of `samples` a pixel, and returns what to trace and what to say of it.
#[must_use]
pub fn decide(
    scene: &Scene,
    plan: &EffectPlan,
    filter: &FilterSampler,
    seed: u64,
    samples: u32,
    wishes: Wishes,
) -> (Option<Arc<Caustics>>, Vec<Effect>) {
    let off = |reason: &str| (None, vec![technique("light tracing", false, reason.to_owned())]);
    let Integrator::Path(settings) = &plan.integrator else { return (None, Vec::new()) };
    if wishes.light_tracing == Use::Off {
        return off("the scene says so");
    }
    let casters = Casters::of(scene);
    if casters.balls.is_empty() && casters.endless.is_empty() {
        return off("nothing mirrors or refracts sharply");
    }
    if settings.scatter_samples == 0 || settings.max_depth.is_some_and(|depth| depth < 3) {
        return off("paths are too short for light of mirrors and glass");
    }
    if settings.count_crossings && settings.max_depth.is_some() && scene.has_boundaries {
        return off("panes count for the length of paths");
    }
    if plan.layers.layers.iter().any(|layer| matches!(layer.source, Channel::Light(..))) {
        return off("layers of light are measured path by path from the camera");
    }
    // Who counts panes, as scenes read from Mitsuba's XML do, knows only light that a path from the camera can meet.
    let met =
        |light: &Light| !settings.count_crossings || light.is_environment() || matches!(light, Light::Area { .. });
    let traced: Vec<bool> =
        scene.lights.iter().enumerate().map(|(i, l)| met(l) && is_small(scene, i, &casters)).collect();
    if !traced.contains(&true) {
        return off(if settings.count_crossings {
            "no light that a path from the camera can meet is small or has a sun"
        } else {
            "no light is small or has a sun"
        });
    }
    let caustics = Caustics::untrained(scene, &casters, traced, wishes.packets != Use::Off && casters.parts);
    if caustics.sources.is_empty() {
        let name = casters.endless.first().map_or("", String::as_str);
        return off(&format!("light from infinity cannot be aimed at what has no end: {name}"));
    }
    run(&Trial { scene, plan, settings, filter, seed, samples, wishes, casters: &casters }, caustics)
}

/// What a decision rests on.
struct Trial<'a> {
    scene: &'a Scene,
    plan: &'a EffectPlan,
    settings: &'a PathSettings,
    filter: &'a FilterSampler,
    seed: u64,
    /// Of a pixel.
    samples: u32,
    wishes: Wishes,
    casters: &'a Casters,
}

impl Trial<'_> {
    /// Paths from the camera for the whole picture.
    fn paths(&self) -> f64 {
        let [width, height] = self.scene.camera.resolution.map(f64::from);
        width * height * f64::from(self.samples)
    }

    /// Pixels of a block to try, and the samples of each of two replicates there: together no more than a hundredth of the
    /// picture's, or one of each.
    fn tries(&self) -> (u32, u32) {
        let wanted = (0.01 * self.paths() / (2 * BLOCKS * BLOCKS) as f64) as u32;
        let each = wanted.clamp(1, EVEN.min(self.samples / REPLICATES as u32).max(1));
        ((wanted / each).clamp(1, PIXELS), each)
    }
}

/// Whether light `i` comes from so small a part of the sphere, seen from what casts, that chance finds it seldom.
fn is_small(scene: &Scene, i: usize, casters: &Casters) -> bool {
    match &scene.lights[i] {
        Light::Point { .. }
        | Light::Spot { .. }
        | Light::Directional { .. }
        | Light::Projector(_)
        | Light::AlongNormal { .. } => true,
        Light::Constant { .. } => false,
        Light::Environment(map) => has_sun(map),
        Light::Area { object, .. } => {
            let lamp = &scene.objects[*object as usize];
            let b: Aabb = lamp.bounds();
            let centre = 0.5 * b.min + 0.5 * b.max;
            let radius = match &lamp.geometry {
                // Of a flat or curved surface the half diagonal of its box is the radius at most.
                Geometry::Shape(_) | Geometry::Mesh(_) => 0.5 * (b.max - b.min).length(),
                Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => return false,
            };
            // How near to a mirror without end it is does not bound how it is seen there.
            !casters.endless.is_empty()
                || casters.balls.iter().any(|ball| {
                    let distance = (ball.center - centre).length();
                    let sine = radius / distance;
                    // 1 − cos of the half angle: its solid angle over 2π.
                    sine < 1.0 && 1.0 - (1.0 - sine * sine).sqrt() < SMALL
                })
        }
    }
}

/// Whether a fifth of an environment's light comes from less than a two-hundredth of the sphere.
fn has_sun(map: &Environment) -> bool {
    const DRAWS: u32 = 4096;
    let sampler = |i| Sampler::new(STREAM, [0, 0], 0, i);
    let mut densities: Vec<f64> = (0..DRAWS)
        .filter_map(|i| map.sample(pairs(sampler(i).set(Set::Camera)).0).map(|s| s.pdf_solid_angle))
        .collect();
    densities.sort_by(|a, b| b.total_cmp(a));
    let mut angle = 0.0;
    let bright = densities.iter().take_while(|&&density| {
        angle += 1.0 / (density * f64::from(DRAWS));
        angle < 4.0 * PI * 0.005
    });
    bright.count() > DRAWS as usize / 5
}

impl Caustics {
    /// Aimed at everything alike.
    fn untrained(scene: &Scene, casters: &Casters, traced: Vec<bool>, packets: bool) -> Caustics {
        let infinite = |light: &Light| light.is_environment() || matches!(light, Light::Directional { .. });
        // Light from infinity meets what has no end everywhere: neither is aimed at the other.
        let bounded = scene.lights.iter().zip(&traced).any(|(light, traced)| *traced && infinite(light));
        let (mut casts, mut unending) = (casters.casts.clone(), casters.unending.clone());
        if bounded {
            casts.iter_mut().zip(&mut unending).for_each(|(casts, unending)| *casts &= !std::mem::take(unending));
        }
        let mut targets: Vec<Target> = casters.balls.iter().map(|ball| Target::Ball(*ball)).collect();
        if unending.contains(&true) {
            targets.push(Target::Endless);
        }
        let mut sources = Vec::new();
        for (i, light) in scene.lights.iter().enumerate().filter(|(i, _)| traced[*i]) {
            let probability = scene.light_probability(i);
            let source = |target, probability| Source { light: i as u32, target, probability, guide: Guide::uniform() };
            if matches!(light, Light::AlongNormal { .. } | Light::Projector(_)) {
                sources.push(source(Target::Own, probability));
            } else {
                let each = probability / targets.len() as f64;
                sources.extend(targets.iter().map(|target| source(*target, each)));
            }
        }
        let total: f64 = sources.iter().map(|s| s.probability).sum();
        sources.iter_mut().for_each(|s| s.probability /= total);
        let stands = &scene.objects[..scene.standing];
        let endless = stands.iter().any(|o| !o.bounds().is_finite());
        let sums = Caustics::sums(&sources);
        Caustics {
            casts,
            unending,
            traced,
            sources,
            sums,
            ratio: 1.0,
            packets,
            parts: casters.parts,
            endless,
            merging: None,
        }
    }
}

/// What the pilot saw of the picture.
struct Camera {
    /// Mean luminance of each block.
    means: Vec<f64>,
    /// Variances, over those of single samples as evenly spread ones have them: of what remains with the camera, and of
    /// all.
    kept: Vec<(usize, f64)>,
    all: Vec<(usize, f64)>,
    /// Of light of the class that is seen in mirrors and glass.
    mirrored: Vec<(usize, f64)>,
    /// How many paths there were, how many met light of the class, and how many in mirrors and glass.
    paths: usize,
    met: usize,
    met_mirrored: usize,
    /// Rays of a path.
    rays: f64,
    /// Share of the paths that begin on something sharp.
    sharp: f64,
}

/// A colour: luminance and linear Rec. 709, whose channels all count where errors are told.
#[derive(Clone, Copy, Default)]
struct Colour {
    y: f64,
    rgb: DVec3,
}

impl Colour {
    fn of(xyz: [f32; 3]) -> Colour {
        let rgb = DVec3::from(ColourSpace::Rec709.from_xyz(xyz).map(f64::from));
        let y = f64::from(xyz[1]);
        if y.is_finite() && rgb.is_finite() { Colour { y, rgb } } else { Colour::default() }
    }

    /// The mean of the squares of the channels.
    fn square(&self) -> f64 {
        self.rgb.length_squared() / 3.0
    }
}

impl std::ops::Add for Colour {
    type Output = Colour;
    fn add(self, other: Colour) -> Colour {
        Colour { y: self.y + other.y, rgb: self.rgb + other.rgb }
    }
}

/// What a replicate of a pixel showed, a sample.
#[derive(Clone, Copy, Default)]
struct Shown {
    kept: Colour,
    /// Light of the class that is seen in mirrors and glass, and other light of the class.
    seen: Colour,
    left: Colour,
    met: usize,
    met_seen: usize,
    /// A ray to the next vertex and one to a light from each, of all samples.
    rays: f64,
    sharp: usize,
}

/// Paths from the camera through all blocks: `pixels` of each, two replicates of each with `each` samples. Evenly spread
/// samples have less variance than their number says, as those of the picture have.
fn from_camera(shot: &Shot, (pixels, each): (u32, u32)) -> Camera {
    let show = |pixel: [u32; 2], replicate: u32| {
        let mut shown = Shown::default();
        let share = 1.0 / each as f32;
        for index in 0..each {
            let (light, wavelengths) = super::probe(shot, pixel, replicate, index);
            let colour = |light: Lanes| Colour::of(observer::xyz(light * share, &wavelengths));
            let left = colour(light.left);
            let met = left.y > 0.0;
            shown.kept = shown.kept + colour(light.radiance);
            // Light of the class that is seen in mirrors and glass stays with the camera unless it is merged.
            if light.mirrored {
                shown.seen = shown.seen + left;
                shown.met_seen += usize::from(met);
            } else {
                shown.left = shown.left + left;
            }
            shown.met += usize::from(met);
            shown.rays += f64::from(1 + 2 * light.events);
            shown.sharp += usize::from(light.mirrored);
        }
        shown
    };
    let tried: Vec<_> = (0..BLOCKS * BLOCKS)
        .into_par_iter()
        .flat_map_iter(|block| (0..pixels).map(move |n| (block, n)))
        .map(|(block, n)| {
            let u = pairs(Sampler::new(shot.seed, [block as u32, n], 0, 0).set(Set::Lens)).0;
            let place = super::place_in(shot.scene, BLOCKS, block, u);
            (block, [0, 1].map(|replicate| show([place.x as u32, place.y as u32], replicate)))
        })
        .collect();
    let paths = 2 * each as usize * tried.len();
    let mut camera = Camera {
        means: vec![0.0; BLOCKS * BLOCKS],
        kept: Vec::new(),
        mirrored: Vec::new(),
        all: Vec::new(),
        paths,
        met: 0,
        met_mirrored: 0,
        rays: 0.0,
        sharp: 0.0,
    };
    for (block, [a, b]) in &tried {
        let variance = |a: Colour, b: Colour| 0.5 * f64::from(each) * (a.rgb - b.rgb).length_squared() / 3.0;
        camera.means[*block] += 0.5 * (a.kept.y + b.kept.y) / f64::from(pixels);
        camera.kept.push((*block, variance(a.kept, b.kept)));
        camera.mirrored.push((*block, variance(a.seen, b.seen)));
        camera.all.push((*block, variance(a.kept + a.seen + a.left, b.kept + b.seen + b.left)));
        camera.met += a.met + b.met;
        camera.met_mirrored += a.met_seen + b.met_seen;
        camera.rays += (a.rays + b.rays) / paths as f64;
        camera.sharp += (a.sharp + b.sharp) as f64 / paths as f64;
    }
    camera
}

/// The weight of a squared error in each block: relative to its mean, in the dark to a tenth of that of the picture.
fn relative(means: &[f64]) -> Vec<f64> {
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    means.iter().map(|m| if mean > 0.0 { 1.0 / (m * m + 0.01 * mean * mean) } else { 1.0 }).collect()
}

/// The mean of values with weights.
fn average(values: &[(usize, f64)], weights: &[f64]) -> f64 {
    values.iter().map(|(block, v)| v * weights[*block]).sum::<f64>() / values.len() as f64
}

/// Whether a light that is traced has no extent, so that no path from the camera can find it by chance.
fn endless_odds(scene: &Scene, caustics: &Caustics) -> bool {
    scene
        .lights
        .iter()
        .zip(&caustics.traced)
        .any(|(light, traced)| *traced && !light.is_environment() && !matches!(light, Light::Area { .. }))
}

/// Square of the brightness of light in mirrors and glass, over the rest's variance in the picture, below which it is not
/// worth merging.
const FAINT: f64 = 0.1;

/// Share of the rest's variance above which light that is met in mirrors and glass is worth merging.
const WORTH: f64 = 0.3;

/// The mean of values with weights, without the largest hundredth: single fireflies do not decide.
fn trimmed(values: &[(usize, f64)], weights: &[f64]) -> f64 {
    let mut weighted: Vec<f64> = values.iter().map(|(block, v)| v * weights[*block]).collect();
    weighted.sort_by(f64::total_cmp);
    let kept = weighted.len() - weighted.len() / 100;
    weighted[..kept].iter().sum::<f64>() / kept as f64
}

/// What one path from a light left on the picture.
struct Landed {
    source: usize,
    place: DVec2,
    /// What the camera sees itself.
    splats: Vec<Arrival>,
    /// What it would collect where mirrors and glass are seen.
    collected: Vec<Arrival>,
    rays: u32,
}

/// Paths `indices` of one round, in the order of their numbers.
fn from_lights(paths: &LightPaths, seen: Option<&Seen>, round: u32, indices: Range<u64>) -> Vec<Landed> {
    let [width, height] = paths.scene.camera.resolution.map(f64::from);
    let block_of = |place: DVec2| {
        let index = |x: f64, size: f64| ((x / size * BLOCKS as f64).max(0.0) as usize).min(BLOCKS - 1);
        index(place.y, height) * BLOCKS + index(place.x, width)
    };
    indices
        .into_par_iter()
        .map(|i| {
            let mut splats: Vec<(DVec2, Colour)> = Vec::new();
            let (mut photons, mut collected) = (Vec::new(), Vec::new());
            let traced = trace(paths, round, i, seen.map(|_| &mut photons), &mut |wavelengths, splat| {
                let (pixel, colour) = (splat.place.floor(), Colour::of(splat.xyz(wavelengths)));
                // Colours that come to one pixel together make up for each other.
                match splats.iter_mut().find(|(p, _)| *p == pixel) {
                    Some((_, sum)) => *sum = *sum + colour,
                    None => splats.push((pixel, colour)),
                }
            });
            let arrival = |(pixel, colour): &(DVec2, Colour)| Arrival {
                block: block_of(*pixel),
                y: colour.y,
                square: colour.square(),
                pixels: 1.0,
            };
            let splats = splats.iter().map(arrival).collect();
            if let (Some(seen), Some(wavelengths)) = (seen, &traced.wavelengths) {
                photons.iter().for_each(|photon| seen.collect(photon, wavelengths, &mut collected));
            }
            let (source, place) = traced.began.unwrap_or((usize::MAX, DVec2::ZERO));
            Landed { source, place, splats, collected, rays: traced.rays }
        })
        .collect()
}

/// A path that came to the picture.
struct Arrived {
    source: usize,
    place: DVec2,
    /// Of its source and place.
    density: f64,
    /// Weighted squares.
    splatted: f64,
    collected: f64,
}

impl Arrived {
    fn squares(&self) -> f64 {
        self.splatted + self.collected
    }
}

/// What a round of paths from the lights has found, a path.
#[derive(Default)]
struct Round {
    paths: u64,
    rays: f64,
    /// Weighted squares of what came to pixels: by itself, and collected.
    splatted: f64,
    collected: f64,
    /// Mean luminance of each block, and the part of it that is collected.
    thrown: Vec<f64>,
    gathered: Vec<f64>,
}

impl Trial<'_> {
    /// Follows paths from the lights, as many as the picture is worth, and adds what sources and cells sent to `learnt`.
    fn round(
        &self,
        paths: &LightPaths,
        seen: Option<&Seen>,
        number: u32,
        weights: &[f64],
        most_rays: f64,
        learnt: &mut [Vec<Find>],
    ) -> Round {
        let Some(caustics) = paths.caustics else { return Round::default() };
        let mut round =
            Round { thrown: vec![0.0; BLOCKS * BLOCKS], gathered: vec![0.0; BLOCKS * BLOCKS], ..Round::default() };
        let mut arrived = Vec::new();
        let [least, most] = FROM_LIGHTS;
        while round.paths < least || round.paths < most && round.rays < most_rays {
            for landed in from_lights(paths, seen, number, round.paths..round.paths + AT_ONCE) {
                round.rays += f64::from(1 + landed.rays);
                let squares = |all: &[Arrival]| all.iter().map(|a| weights[a.block] * a.pixels * a.square).sum::<f64>();
                let (splatted, collected) = (squares(&landed.splats), squares(&landed.collected));
                for arrival in landed.splats.iter().chain(&landed.collected) {
                    round.thrown[arrival.block] += arrival.pixels * arrival.y;
                }
                for arrival in &landed.collected {
                    round.gathered[arrival.block] += arrival.pixels * arrival.y;
                }
                if splatted + collected > 0.0 {
                    let source = &caustics.sources[landed.source];
                    let density = source.probability * source.guide.density(landed.place);
                    arrived.push(Arrived { source: landed.source, place: landed.place, density, splatted, collected });
                }
            }
            round.paths += AT_ONCE;
        }
        // Single fireflies do not decide where to aim and how much.
        arrived.sort_by(|a, b| b.squares().total_cmp(&a.squares()));
        let most = arrived.get(arrived.len() / 500).map_or(0.0, Arrived::squares);
        for a in &arrived {
            let cut = (most / a.squares()).min(1.0);
            round.splatted += a.splatted * cut;
            round.collected += a.collected * cut;
            learnt[a.source].push(Find { place: a.place, square: a.squares() * cut * a.density });
        }
        let paths = round.paths as f64;
        let [width, height] = self.scene.camera.resolution.map(f64::from);
        let share = (BLOCKS * BLOCKS) as f64 / (width * height * paths);
        round.thrown.iter_mut().chain(&mut round.gathered).for_each(|y| *y *= share);
        Round {
            rays: round.rays / paths,
            splatted: round.splatted / paths,
            collected: round.collected / paths,
            ..round
        }
    }
}

fn run(trial: &Trial, mut caustics: Caustics) -> (Option<Arc<Caustics>>, Vec<Effect>) {
    let Trial { scene, plan, settings, filter, seed, wishes, casters, .. } = *trial;
    let off = |reason: String| (None, vec![technique("light tracing", false, reason)]);
    let seen = match wishes.merging {
        Use::Off => None,
        Use::Auto | Use::On => Seen::of(trial, plan, &caustics),
    };
    // As if photons were collected, so that what they would bring is told from the rest.
    let wanted = Caustics { merging: Some(1.0), ..caustics.clone() };
    let with_all = EffectPlan { caustics: Some(Arc::new(wanted)), ..plan.clone() };
    let shot = Shot { scene, plan: &with_all, filter, seed: seed ^ STREAM, photons: None };
    let camera = from_camera(&shot, trial.tries());
    let [width, height] = scene.camera.resolution.map(f64::from);
    let pixels = width * height;

    let bounds = Bounds { low: DVec2::ZERO, high: DVec2::new(width, height) };
    let mut weights = relative(&camera.means);
    let mut learnt = vec![Vec::new(); caustics.sources.len()];
    let most_rays = SHARE * trial.paths() * camera.rays;
    let (mut found, mut followed) = (Round::default(), 0);
    for number in 0..ROUNDS {
        let paths = LightPaths {
            scene,
            plan: &with_all,
            settings: settings.of_light_paths(),
            caustics: Some(&caustics),
            seed: seed ^ STREAM,
            bounds,
            wavelength: None,
        };
        found = trial.round(&paths, seen.as_ref(), number, &weights, most_rays, &mut learnt);
        followed += found.paths;
        caustics.learn(&mut learnt);
        // What the lights send there is part of the picture that errors are relative to.
        let means: Vec<f64> = camera.means.iter().zip(&found.thrown).map(|(a, b)| a + b).collect();
        if number + 1 < ROUNDS {
            weights = relative(&means);
        }
    }
    if found.splatted + found.collected <= 0.0 && wishes.light_tracing == Use::Auto {
        return off(format!("of {followed} paths from the lights none came to the picture over {}", some(casters)));
    }

    // Paths from the camera that find light of mean m with a probability p have a variance of m² / p, whether or not so
    // few paths met it; for a lamp without extent p is zero.
    let endless = endless_odds(scene, &caustics);
    let square = |means: &[f64]| means.iter().zip(&weights).map(|(m, w)| w * m * m).sum::<f64>() / means.len() as f64;
    let by_chance = |means: &[f64], met: usize| match square(means) {
        square if square > 0.0 && endless => f64::INFINITY,
        square => square * camera.paths as f64 / met.max(1) as f64,
    };
    // Light that is seen in mirrors and glass: often met, it is known what it costs to leave it to chance, else it is told
    // from how bright it is.
    let (kept, mirrored) = (trimmed(&camera.kept, &weights), average(&camera.mirrored, &weights));
    let unmerged = match camera.met_mirrored {
        ENOUGH.. => mirrored,
        met => by_chance(&found.gathered, met),
    };
    // What is as good as never found is missing; where that is less than the noise shows, nothing is gained.
    let faint = !endless && square(&found.gathered) * f64::from(trial.samples) < FAINT * kept;
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
    caustics.ratio = ratio.clamp(1.0 / 64.0, 16.0);
    let k = caustics.ratio;
    let (left, overhead) = if merges { (0.0, OVERHEAD) } else { (mirrored, 1.0) };
    let with = overhead * (kept + left + thrown / k) * (a + k * b);
    let measured = if camera.met >= ENOUGH { average(&camera.all, &weights) } else { f64::INFINITY };
    let without = measured.min(kept + mirrored + by_chance(&found.thrown, camera.met)) * a;
    if wishes.light_tracing == Use::Auto && without < with {
        let loss = with / without;
        return off(format!(
            "the pilot expects it to cost {loss:.1} times as much: paths from the camera find the light over {}, or it hardly counts",
            some(casters)
        ));
    }
    let said = say(trial, &caustics, &camera, k * b / (a + k * b), seen.is_some(), found.collected > 0.0);
    (Some(Arc::new(caustics)), said)
}

/// The decision for people; `share` of the rays come from the lights.
fn say(trial: &Trial, caustics: &Caustics, camera: &Camera, share: f64, seen: bool, collected: bool) -> Vec<Effect> {
    let Trial { scene, plan, wishes, casters, .. } = *trial;
    let tracing = format!(
        "of {} over {}: {:.2} paths from the lights for each from the camera, {:.0} % of the rays",
        lamps(scene, caustics),
        some(casters),
        caustics.ratio,
        100.0 * share
    );
    let packets = match (caustics.packets, casters.parts) {
        (true, _) => "wavelengths that part in glass are followed together from the lights",
        (false, true) => "the scene says so",
        (false, false) => "no wavelengths part",
    };
    let merging = match caustics.merging {
        _ if wishes.merging == Use::Off => {
            "the scene says so: caustics in mirrors and behind glass are left to chance".into()
        }
        None if !seen => "the camera sees nothing in mirrors and through glass".into(),
        None if !collected => "no light of mirrors and glass comes to what is seen in them".into(),
        None if camera.met_mirrored < ENOUGH => {
            "caustics in mirrors and behind glass are fainter than the noise of so many samples".into()
        }
        None => format!(
            "paths from the camera find the caustics in mirrors and behind glass: {} of {}",
            camera.met_mirrored, camera.paths
        ),
        Some(radius) => {
            let samples = trial.samples.div_ceil(REPLICATES as u32).max(1);
            let mean = merge::mean_radius(radius, samples);
            format!(
                "caustics seen in mirrors and through glass: photons within {radius:.3} m at the first sample and {:.3} m at the last{}; their light is blurred as by a disc of {mean:.3} m, {:.1} pixels where it is seen",
                merge::radius(radius, samples - 1),
                if plan.media { ", on surfaces, not in media" } else { "" },
                seen::FIRST_RADIUS * mean / radius,
            )
        }
    };
    vec![
        technique("light tracing", true, tracing),
        technique("wavelength packets", caustics.packets, packets.to_owned()),
        technique("photon merging", caustics.merging.is_some(), merging),
    ]
}

fn some(casters: &Casters) -> String {
    let names: Vec<String> = casters.names.iter().chain(&casters.endless).cloned().collect();
    super::plan::some_of(&names)
}

fn lamps(scene: &Scene, caustics: &Caustics) -> String {
    let traced = caustics.traced.iter().filter(|t| **t).count();
    let all = scene.lights.len();
    if traced == all { format!("{all} lights") } else { format!("{traced} of {all} lights") }
}

impl Caustics {
    /// Chooses sources and cells by the root of what squares were found there, over the density that found them: the
    /// least variance, were they exact. Some go anywhere.
    fn learn(&mut self, finds: &mut [Vec<Find>]) {
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
