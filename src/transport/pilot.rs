//! Whether light is traced from the lights, where to, and how much: decided by a pilot of few paths.
//!
//! All numbers of the pilot are functions of scene and seed, and costs are counted in rays, not in seconds: every
//! machine that renders a part of a picture decides alike.

use super::caustics::{Caustics, Source};
use super::guide::{Guide, SIDE};
use super::light::{Bounds, LightPaths, trace};
use super::plan::{Effect, EffectPlan, Integrator, PathSettings};
use super::{Incoming, Shot};
use crate::film::filter::FilterSampler;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::bvh::Aabb;
use crate::scene::camera::Projection;
use crate::scene::casters::{Ball, Casters};
use crate::scene::environment::Environment;
use crate::scene::light::Light;
use crate::scene::{Geometry, Scene};
use crate::spectrum::{Lanes, SampledWavelengths, observer};
use crate::transport::layers::Source as Channel;
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::PI;
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

/// Paths from the lights in each of two rounds: the second is aimed by what the first has learnt.
const FROM_LIGHTS: u64 = 1 << 15;

/// Blocks of the picture along each side; each gets paths from the camera.
const BLOCKS: usize = 32;

/// Pixels of a block that are tried, with two paths each.
const PIXELS: u32 = 4;

/// Tells the pilot's numbers from the picture's.
const STREAM: u64 = 0x7069_6c6f_7470_696c;

/// Share of the paths that go where the pilot found nothing: it may have missed something.
const ANYWHERE: f64 = 0.2;

/// How often the pilot must have met light of the class on its paths from the camera to trust what they say about it.
const ENOUGH: usize = 16;

/// Half of the solid angle of a hemisphere in which light counts as coming from one place, over 2π.
const SMALL: f64 = 0.3;

/// What light tracing with merging costs beyond its rays: 1.2 to 1.5 in scenes of the gallery.
const OVERHEAD: f64 = 1.4;

/// A name and whether it holds, for people.
fn technique(name: &'static str, on: bool, reason: String) -> Effect {
    Effect { name, on, reason }
}

/// Decides, and returns what to trace and what to say of it.
#[must_use]
pub fn decide(
    scene: &Scene,
    plan: &EffectPlan,
    filter: &FilterSampler,
    seed: u64,
    wishes: Wishes,
) -> (Option<Arc<Caustics>>, Vec<Effect>) {
    let off = |reason: &str| (None, vec![technique("light tracing", false, reason.to_owned())]);
    let Integrator::Path(settings) = &plan.integrator else { return (None, Vec::new()) };
    if wishes.light_tracing == Use::Off {
        return off("the scene says so");
    }
    let casters = Casters::of(scene);
    if casters.balls.is_empty() {
        return match casters.endless.first() {
            Some(name) => off(&format!("what mirrors or refracts sharply has no end: {name}")),
            None => off("nothing mirrors or refracts sharply"),
        };
    }
    if settings.scatter_samples == 0 || settings.max_depth.is_some_and(|depth| depth < 3) {
        return off("paths are too short for light of mirrors and glass");
    }
    if settings.count_crossings {
        return off("panes count for the length of paths");
    }
    if plan.layers.layers.iter().any(|layer| matches!(layer.source, Channel::Light(..))) {
        return off("layers of light are measured path by path from the camera");
    }
    let traced: Vec<bool> = (0..scene.lights.len()).map(|i| is_small(scene, i, &casters)).collect();
    if !traced.contains(&true) {
        return off("no light is small or has a sun");
    }
    let caustics = Caustics::untrained(scene, &casters, traced, wishes.packets != Use::Off && casters.parts);
    run(scene, plan, settings, filter, seed, wishes, &casters, caustics)
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
            casters.balls.iter().any(|ball| {
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
        let mut sources = Vec::new();
        for (i, light) in scene.lights.iter().enumerate().filter(|(i, _)| traced[*i]) {
            let probability = scene.light_probability(i);
            let source = |ball, probability| Source { light: i as u32, ball, probability, guide: Guide::uniform() };
            if matches!(light, Light::AlongNormal { .. } | Light::Projector(_)) {
                sources.push(source(None, probability));
            } else {
                let each = probability / casters.balls.len() as f64;
                sources.extend(casters.balls.iter().map(|ball| source(Some(*ball), each)));
            }
        }
        let total: f64 = sources.iter().map(|s| s.probability).sum();
        sources.iter_mut().for_each(|s| s.probability /= total);
        let stands = &scene.objects[..scene.bvh.order().len()];
        let endless = stands.iter().any(|o| !o.bounds().is_finite());
        let sums = Caustics::sums(&sources);
        Caustics { casts: casters.casts.clone(), traced, sources, sums, ratio: 1.0, packets, endless, merging: None }
    }
}

/// What the pilot saw of the picture.
struct Camera {
    /// Mean luminance of each block.
    means: Vec<f64>,
    /// Variances of single samples: of what remains with the camera, and of all.
    kept: Vec<(usize, f64)>,
    all: Vec<(usize, f64)>,
    /// Of light of the class that is seen in mirrors and glass.
    mirrored: Vec<(usize, f64)>,
    /// How many paths met light of the class, and how many in mirrors and glass.
    met: usize,
    met_mirrored: usize,
    /// Rays of a path.
    rays: f64,
    /// Share of the paths that begin on something sharp.
    sharp: f64,
}

fn luminance(light: Lanes, wavelengths: &SampledWavelengths) -> f64 {
    let y = f64::from(observer::xyz(light, wavelengths)[1]);
    if y.is_finite() { y } else { 0.0 }
}

/// Paths from the camera through all blocks.
fn from_camera(shot: &Shot) -> Camera {
    let [width, height] = shot.scene.camera.resolution;
    let tried: Vec<_> = (0..BLOCKS * BLOCKS)
        .into_par_iter()
        .flat_map_iter(|block| (0..PIXELS).map(move |n| (block, n)))
        .map(|(block, n)| {
            let u = pairs(Sampler::new(shot.seed, [block as u32, n], 0, 0).set(Set::Lens)).0;
            let corner = DVec2::new((block % BLOCKS) as f64, (block / BLOCKS) as f64);
            let place = (corner + u) / BLOCKS as f64 * DVec2::new(f64::from(width), f64::from(height));
            let pixel = [place.x as u32, place.y as u32];
            let pair = [0, 1].map(|replicate| {
                let (light, wavelengths) = super::probe(shot, pixel, replicate, n);
                let (kept, left) = (luminance(light.radiance, &wavelengths), luminance(light.left, &wavelengths));
                (kept, left, light)
            });
            (block, pair)
        })
        .collect();
    let mut camera = Camera {
        means: vec![0.0; BLOCKS * BLOCKS],
        kept: Vec::new(),
        mirrored: Vec::new(),
        all: Vec::new(),
        met: 0,
        met_mirrored: 0,
        rays: 0.0,
        sharp: 0.0,
    };
    for (block, pair) in &tried {
        let variance = |a: f64, b: f64| 0.5 * (a - b) * (a - b);
        let [(a, a_left, a_light), (b, b_left, b_light)] = *pair;
        camera.means[*block] += 0.5 * (a + b) / f64::from(PIXELS);
        // Light of the class that is seen in mirrors and glass stays with the camera unless it is merged.
        let seen = |left: f64, light: &Incoming| if light.mirrored { (0.0, left) } else { (left, 0.0) };
        let ((a_left, a_seen), (b_left, b_seen)) = (seen(a_left, &a_light), seen(b_left, &b_light));
        camera.kept.push((*block, variance(a, b)));
        camera.mirrored.push((*block, variance(a_seen, b_seen)));
        camera.all.push((*block, variance(a + a_left, b + b_left)));
        camera.met += usize::from(a_left > 0.0) + usize::from(b_left > 0.0);
        camera.met_mirrored += usize::from(a_seen > 0.0) + usize::from(b_seen > 0.0);
        // A ray to the next vertex and one to a light from each.
        camera.rays += f64::from(2 + 2 * (a_light.events + b_light.events)) / (2 * tried.len()) as f64;
        camera.sharp += f64::from(u32::from(a_light.mirrored) + u32::from(b_light.mirrored)) / (2 * tried.len()) as f64;
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
    /// Luminance in each block.
    splats: Vec<(usize, f64)>,
    rays: u32,
}

/// One round of paths from the lights, in the order of their numbers.
fn from_lights(paths: &LightPaths, round: u64) -> Vec<Landed> {
    let [width, height] = paths.scene.camera.resolution.map(f64::from);
    let block_of = |place: DVec2| {
        let index = |x: f64, size: f64| ((x / size * BLOCKS as f64).max(0.0) as usize).min(BLOCKS - 1);
        index(place.y, height) * BLOCKS + index(place.x, width)
    };
    (0..FROM_LIGHTS)
        .into_par_iter()
        .map(|i| {
            let mut splats = Vec::new();
            let traced = trace(paths, round as u32, i, None, &mut |wavelengths, splat| {
                let y = f64::from(splat.xyz(wavelengths)[1]);
                if y.is_finite() {
                    splats.push((block_of(splat.place), y));
                }
            });
            let (source, place) = traced.began.unwrap_or((usize::MAX, DVec2::ZERO));
            Landed { source, place, splats, rays: traced.rays }
        })
        .collect()
}

#[expect(clippy::too_many_arguments, reason = "all that a decision rests on")]
fn run(
    scene: &Scene,
    plan: &EffectPlan,
    settings: &PathSettings,
    filter: &FilterSampler,
    seed: u64,
    wishes: Wishes,
    casters: &Casters,
    mut caustics: Caustics,
) -> (Option<Arc<Caustics>>, Vec<Effect>) {
    let off = |reason: String| (None, vec![technique("light tracing", false, reason)]);
    // As if photons were collected, so that what they would bring is told from the rest.
    let radius = merging_radius(scene, casters);
    let wanted = Caustics { merging: Some(radius), ..caustics.clone() };
    let trial = EffectPlan { caustics: Some(Arc::new(wanted)), ..plan.clone() };
    let camera = from_camera(&Shot { scene, plan: &trial, filter, seed: seed ^ STREAM, photons: None });
    let [width, height] = scene.camera.resolution.map(f64::from);
    let pixels = width * height;
    let mut weights = relative(&camera.means);

    let bounds = Bounds { low: DVec2::ZERO, high: DVec2::new(width, height) };
    let mut learnt = vec![[[0.0; SIDE]; SIDE]; caustics.sources.len()];
    let (mut squares, mut rays, mut reached) = (0.0, 0.0, 0usize);
    let mut thrown = vec![0.0; BLOCKS * BLOCKS];
    for round in 0..2 {
        let paths = LightPaths {
            scene,
            plan: &trial,
            settings: settings.of_light_paths(),
            caustics: Some(&caustics),
            seed: seed ^ STREAM,
            bounds,
            wavelength: None,
        };
        let all = from_lights(&paths, round);
        (squares, rays) = (0.0, 0.0);
        for landed in &all {
            rays += f64::from(1 + landed.rays) / FROM_LIGHTS as f64;
            let square: f64 = landed.splats.iter().map(|&(block, y)| weights[block] * y * y).sum();
            squares += square / FROM_LIGHTS as f64;
            if square > 0.0 {
                reached += 1;
                let source = &caustics.sources[landed.source];
                let (row, column) = Guide::cell(landed.place);
                learnt[landed.source][row][column] += square * source.probability * source.guide.density(landed.place);
            }
        }
        caustics.learn(&learnt);
        thrown.fill(0.0);
        let share = (BLOCKS * BLOCKS) as f64 / (pixels * FROM_LIGHTS as f64);
        for (block, y) in all.iter().flat_map(|landed| &landed.splats) {
            thrown[*block] += y * share;
        }
        if round == 0 {
            // What the lights send there is part of the picture that errors are relative to.
            let means: Vec<f64> = camera.means.iter().zip(&thrown).map(|(a, b)| a + b).collect();
            weights = relative(&means);
        }
    }
    if reached == 0 {
        return off(format!(
            "of {} paths from the lights none came to the picture over {}",
            2 * FROM_LIGHTS,
            some(casters)
        ));
    }

    // Errors by sample and pixel: (A + B / k)(a + k b) is least for k = √(B a / (A b)).
    let kept = trimmed(&camera.kept, &weights);
    let splatted = squares / (pixels * pixels);
    let ratio = (splatted * camera.rays / (kept.max(f64::MIN_POSITIVE) * rays)).sqrt();
    caustics.ratio = ratio.clamp(1.0 / 16.0, 16.0);
    let k = caustics.ratio;
    // Paths from the camera that find light of mean m with a probability p have a variance of m² / p, whether or not so
    // few paths met it; for a lamp without extent p is zero.
    let tries = 2.0 * camera.kept.len() as f64;
    let chance = if endless_odds(scene, &caustics) { 0.0 } else { (camera.met as f64).max(1.0) / tries };
    let by_chance = thrown.iter().zip(&weights).map(|(m, w)| w * m * m).sum::<f64>() / thrown.len() as f64 / chance;
    let mirrored = average(&camera.mirrored, &weights);
    let kept = average(&camera.kept, &weights) + mirrored;
    let with = OVERHEAD * (kept + splatted / k) * (camera.rays + k * rays);
    let measured = if camera.met >= ENOUGH { average(&camera.all, &weights) } else { f64::INFINITY };
    let without = measured.min(kept + by_chance) * camera.rays;
    if wishes.light_tracing == Use::Auto && without < with {
        let loss = with / without;
        return off(format!(
            "the pilot expects it to cost {loss:.1} times as much: paths from the camera find the light over {}, or it hardly counts",
            some(casters)
        ));
    }
    let share = 100.0 * k * rays / (camera.rays + k * rays);
    let mut said = vec![technique(
        "light tracing",
        true,
        format!(
            "of {} over {}: {k:.2} paths from the lights for each from the camera, {share:.0} % of the rays",
            lamps(scene, &caustics),
            some(casters)
        ),
    )];
    let parts = casters.parts;
    said.push(technique(
        "wavelength packets",
        caustics.packets,
        match (caustics.packets, parts) {
            (true, _) => "wavelengths that part in glass are followed together from the lights".into(),
            (false, true) => "the scene says so".into(),
            (false, false) => "no wavelengths part".into(),
        },
    ));
    let sharp_seen = camera.sharp > 0.0;
    // Often met, it is known what it costs to leave it to chance; else chance will not do.
    let counts = camera.met_mirrored < ENOUGH || mirrored > WORTH * kept;
    let merging = wishes.merging == Use::On || wishes.merging == Use::Auto && counts;
    if sharp_seen && merging {
        caustics.merging = Some(radius);
    }
    said.push(technique(
        "photon merging",
        caustics.merging.is_some(),
        match (sharp_seen, caustics.merging) {
            (false, _) => "the camera sees no mirror and no glass".into(),
            (true, None) if wishes.merging == Use::Off => {
                "the scene says so: caustics in mirrors and behind glass are left to chance".into()
            }
            (true, None) => "paths from the camera find the caustics in mirrors and behind glass".into(),
            (true, Some(radius)) => format!(
                "caustics seen in mirrors and through glass, blurred within {radius:.3} m at the first sample and the \
                 sixth root of the sample's number less at later ones"
            ),
        },
    ));
    (Some(Arc::new(caustics)), said)
}

/// Pixels, as wide as they are at what mirrors and refracts, that the first radius of merging spans.
const FIRST_RADIUS: f64 = 2.5;

/// The first radius of merging: some pixels at the nearest thing that casts.
fn merging_radius(scene: &Scene, casters: &Casters) -> f64 {
    let width = f64::from(scene.camera.resolution[0]);
    let eye = scene.camera.world_from_camera.translation;
    // To the middle: what lies behind is farther, what is before nearer. From within, what is seen is as far as the thing is
    // large.
    let distance = |b: &Ball| (b.center - eye).length().max(b.radius);
    let distance = casters.balls.iter().map(distance).fold(f64::INFINITY, f64::min);
    let pixel = match scene.camera.projection {
        Projection::Perspective { half_width } => 2.0 * half_width / width * distance,
        Projection::Orthographic { half_width } => {
            2.0 * half_width / width * scene.camera.world_from_camera.matrix3.x_axis.length()
        }
    };
    FIRST_RADIUS * pixel
}

fn some(casters: &Casters) -> String {
    super::plan::some_of(&casters.names)
}

fn lamps(scene: &Scene, caustics: &Caustics) -> String {
    let traced = caustics.traced.iter().filter(|t| **t).count();
    let all = scene.lights.len();
    if traced == all { format!("{all} lights") } else { format!("{traced} of {all} lights") }
}

impl Caustics {
    /// Chooses sources and cells by the root of what squares were found there, over the density that found them: the
    /// least variance, were they exact. Some go anywhere.
    fn learn(&mut self, squares: &[[[f64; SIDE]; SIDE]]) {
        let roots: Vec<[[f64; SIDE]; SIDE]> = squares.iter().map(|s| s.map(|row| row.map(f64::sqrt))).collect();
        let totals: Vec<f64> = roots.iter().map(|r| r.iter().flatten().sum()).collect();
        let total: f64 = totals.iter().sum();
        if total.is_nan() || total <= 0.0 {
            return;
        }
        let even = ANYWHERE / self.sources.len() as f64;
        for ((source, root), sum) in self.sources.iter_mut().zip(&roots).zip(&totals) {
            source.probability = (1.0 - ANYWHERE) * sum / total + even;
            if *sum > 0.0 && source.ball.is_some() {
                let floor = ANYWHERE / (SIDE * SIDE) as f64;
                source.guide = Guide::of(&root.map(|row| row.map(|x| (1.0 - ANYWHERE) * x / sum + floor)));
            }
        }
        self.sums = Caustics::sums(&self.sources);
    }
}
