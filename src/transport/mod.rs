//! Which effects, which paths, how much light.
//!
//! [`plan`] decides from the scene what has to be simulated; [`path`] and [`whitted`] carry eight
//! wavelengths along paths of light; [`Samples`] is the one entry: the light of some samples of one
//! pixel; [`sample`] is that of a single one.

pub mod caustics;
pub mod glints;
pub mod guide;
pub mod layers;
pub mod light;
pub mod merge;
pub mod middle;
pub mod path;
pub mod photons;
pub mod pilot;
pub mod plan;
mod roulette;
mod shadow;
mod spread;
pub mod trial;
pub mod ways;
pub mod whitted;

use crate::film::accumulate::REPLICATES;
use crate::film::filter::FilterSampler;
use crate::math::Ray;
use crate::math::sampler::{Octet, Sampler, Set, pairs};
use crate::scene::watch::{self, Counts};
use crate::scene::{DepthFog, Medium, Scene};
use crate::spectrum::{LANES, Lanes, SampledWavelengths, observer};
use glam::{DVec2, DVec3};
use glints::Glints;
use merge::Collection;
use path::Sought;
use path::together::Wanted;
use plan::{EffectPlan, Integrator, PathSettings};
use ways::Ledger;

pub use spread::Spread;

/// Light that a camera ray brings.
#[derive(Clone, Copy, Debug)]
pub struct Incoming {
    /// Spectral radiance of each lane, W·m⁻²·sr⁻¹·nm⁻¹, scaled so that the mean over lanes of
    /// radiance × weight estimates the integral over wavelengths.
    pub radiance: Lanes,
    /// One where the ray met something, zero where it met the background only.
    pub alpha: f32,
    /// Distance of the first surface along the axis of the camera; infinite for none, and where several paths are added.
    pub depth: f64,
    /// Light that was left to paths from the lights, like `radiance`.
    pub left: Lanes,
    /// Vertices of the path, and surfaces that it went straight through.
    pub events: u32,
    /// Shadow rays beyond one from each vertex.
    pub further: u32,
    /// Whether the first of them was on something sharp.
    pub mirrored: bool,
}

impl Incoming {
    /// No light.
    pub const NONE: Incoming = Incoming {
        radiance: Lanes::ZERO,
        alpha: 0.0,
        depth: f64::INFINITY,
        left: Lanes::ZERO,
        events: 0,
        further: 0,
        mirrored: false,
    };
}

/// One sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelSample {
    /// The light.
    pub radiance: Lanes,
    /// Its wavelengths.
    pub wavelengths: SampledWavelengths,
    /// CIE XYZ of the light, times [`Scene::light_unit`]: what f32 holds of bright light may be more in XYZ than it holds.
    pub xyz: [f32; 3],
    /// Coverage.
    pub alpha: f32,
    /// Weight of the reconstruction filter: ±1 up to its norm.
    pub weight: f32,
    /// On the picture, in pixels.
    pub place: DVec2,
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
    /// Photons that paths collect, and the wavelengths that all then share.
    pub photons: Option<Collection<'a>>,
}

impl<'a> Shot<'a> {
    /// Depth fog before what `integrator` shows, where there is some: a distance is no light, nor is nothing.
    fn fog(&self, integrator: &Integrator) -> Option<&'a DepthFog> {
        depth_fog(self.scene, self.plan).filter(|_| integrator.shows_light())
    }
}

/// Depth fog of a scene, where there is some.
fn depth_fog<'a>(scene: &'a Scene, plan: &EffectPlan) -> Option<&'a DepthFog> {
    scene.fog.as_ref().filter(|_| plan.depth_fog)
}

/// Where the random numbers of a sample come from.
#[derive(Clone, Copy, Debug)]
pub struct Address {
    /// Its pixel; coordinates of overscan wrap.
    pub pixel: [u32; 2],
    /// Which scrambling.
    pub replicate: u32,
    /// Its number in that.
    pub index: u32,
}

/// A pixel as addresses have it: overscan makes negative coordinates, which wrap.
#[must_use]
pub fn address(pixel: [i32; 2]) -> [u32; 2] {
    pixel.map(|x| x as u32)
}

impl Address {
    /// Its pixel on the picture.
    fn on_picture(self) -> [i32; 2] {
        self.pixel.map(|x| x as i32)
    }

    /// Its number among all samples of the pixel, of whose replicates one comes after the other.
    fn in_turn(self) -> u32 {
        self.index * REPLICATES as u32 + self.replicate
    }
}

/// Which of `moments` a sample sees, by the number of it that is spread evenly together with its place and wavelengths.
#[must_use]
pub fn moment(seed: u64, pixel: [u32; 2], replicate: u32, index: u32, moments: usize) -> usize {
    moment_at(pairs(Sampler::new(seed, pixel, replicate, index).set(Set::Camera)).1.y, moments)
}

/// What is seen of a scene: one of its `moments` while the shutter is open, `which` of so many; itself where nothing is blurred.
#[must_use]
pub fn scene_at<'a>(scene: &'a Scene, moments: &'a [Scene], which: impl FnOnce(usize) -> usize) -> &'a Scene {
    if moments.is_empty() { scene } else { &moments[which(moments.len())] }
}

/// Which of `moments` is at `u` of [0, 1).
fn moment_at(u: f64, moments: usize) -> usize {
    // A number next to 1 may become it.
    ((u * moments as f64) as usize).min(moments - 1)
}

/// A sample on its way.
struct Begun {
    at: Address,
    ray: Ray,
    /// Whether it begins where small pictures of lamps lie, whose light then comes by itself.
    apart: bool,
    sample: PixelSample,
    /// What was counted on its way, where that is asked for.
    counted: Counts,
    /// See [`Incoming::events`].
    events: u32,
    /// See [`Incoming::further`].
    further: u32,
}

impl Begun {
    fn blank() -> Begun {
        let zero = Lanes::ZERO;
        let wavelengths = SampledWavelengths { nm: zero, inv_pdf: zero };
        Begun {
            at: Address { pixel: [0; 2], replicate: 0, index: 0 },
            ray: Ray::new(DVec3::ZERO, DVec3::Z),
            apart: false,
            sample: PixelSample {
                radiance: zero,
                wavelengths,
                xyz: [0.0; 3],
                alpha: 0.0,
                weight: 1.0,
                place: DVec2::ZERO,
            },
            counted: Counts::default(),
            events: 0,
            further: 0,
        }
    }

    /// Draws its wavelengths, its place and its ray.
    #[inline]
    fn begin(&mut self, shot: &Shot, at: Address, sampler: &Sampler) {
        let Shot { scene, plan, filter, .. } = shot;
        self.at = at;
        let corner = DVec2::from(at.on_picture().map(f64::from));
        if let Integrator::Whitted(settings) = &plan.integrator {
            // A regular grid, the same for every pixel. The wavelengths of all samples together make one
            // lattice: a step of the lanes' own distance over their number; those of any part of the pixel are spread over it.
            let n = settings.grid;
            let s = at.in_turn();
            let cell = s % (n * n);
            let offset = DVec2::new(f64::from(cell % n) + 0.5, f64::from(cell / n) + 0.5) / f64::from(n);
            let turn = settings.wavelengths.at(s) / LANES as f64;
            self.sample.wavelengths = scene.wavelengths.sample(turn);
            self.sample.place = corner + offset;
            self.ray = scene.camera.ray(self.sample.place, || DVec2::splat(0.5));
            self.sample.weight = 1.0;
            return;
        }
        let (u_pixel, u_time) = pairs(sampler.set(Set::Camera));
        let centre = corner + DVec2::splat(0.5);
        let chosen = filter.sample_at(centre, u_pixel);
        let place = centre + chosen.offset;
        self.sample.wavelengths = scene.wavelengths.sample(shot.photons.map_or(u_time.x, |p| p.wavelength));
        self.sample.weight = chosen.weight;
        self.sample.place = place;
        self.apart = self.glints(shot).is_some_and(|glints| glints.hold(place));
        // Rays of the camera leave no surface, and never did here: two vectors are stored, no enum is copied.
        let ray = scene.camera.ray(place, || pairs(sampler.set(Set::Lens)).0);
        (self.ray.origin, self.ray.direction) = (ray.origin, ray.direction);
    }

    /// What `integrator` makes of the ray, entered in a `ledger` if there is one, behind `fog`.
    #[inline]
    fn light(
        &self,
        shot: &Shot,
        sampler: &Sampler,
        integrator: &Integrator,
        fog: Option<&DepthFog>,
        ledger: Option<&Ledger>,
    ) -> Incoming {
        if let Integrator::Path(settings) = integrator {
            let rays = settings.light_samples.max(settings.scatter_samples);
            if rays != 1 {
                return self.light_of_several(shot, rays, integrator, fog, ledger);
            }
        }
        let mut light = self.clear_light(shot, sampler, integrator, ledger);
        veil(fog, &mut light, self.sample.wavelengths.nm, ledger);
        light
    }

    /// The mean of as many paths as `rays` from one camera ray, each with numbers of its own. What one meets first need not
    /// be what another does, so that each is behind its own fog.
    #[inline(never)]
    fn light_of_several(
        &self,
        shot: &Shot,
        rays: u32,
        integrator: &Integrator,
        fog: Option<&DepthFog>,
        ledger: Option<&Ledger>,
    ) -> Incoming {
        let Begun { at, sample: PixelSample { wavelengths, .. }, .. } = self;
        let mut sum = Incoming::NONE;
        for i in 0..rays {
            let index = at.index.wrapping_mul(rays).wrapping_add(i);
            let sampler = Sampler::new(shot.seed, at.pixel, at.replicate, index);
            let mut one = self.clear_light(shot, &sampler, integrator, ledger);
            veil(fog, &mut one, wavelengths.nm, ledger);
            sum.radiance += one.radiance;
            sum.alpha += one.alpha;
            sum.left += one.left;
            sum.events += one.events;
            sum.further += one.further;
            sum.mirrored |= one.mirrored;
        }
        let share = 1.0 / rays as f32;
        if let Some(ledger) = ledger {
            ledger.scale(share);
        }
        Incoming { radiance: sum.radiance * share, alpha: sum.alpha * share, left: sum.left * share, ..sum }
    }

    /// What one path of `integrator` makes of the ray, without fog.
    #[inline]
    fn clear_light(
        &self,
        shot: &Shot,
        sampler: &Sampler,
        integrator: &Integrator,
        ledger: Option<&Ledger>,
    ) -> Incoming {
        let Begun { ray, sample: PixelSample { wavelengths, .. }, .. } = self;
        let Shot { scene, plan, .. } = shot;
        match integrator {
            Integrator::Path(settings) => {
                let map = shot.photons.map(|p| p.map);
                path::radiance(
                    scene,
                    plan,
                    settings,
                    sampler,
                    wavelengths,
                    (ray, Sought::in_pixel(self.apart)),
                    map,
                    ledger,
                )
            }
            Integrator::Whitted(settings) => whitted::radiance(scene, plan, settings, wavelengths, ray),
            Integrator::Depth => {
                let hit = scene.closest(ray, scene.camera.reach(ray));
                Incoming {
                    radiance: Lanes::splat(hit.map_or(0.0, |h| h.t as f32)),
                    alpha: if hit.is_some() { 1.0 } else { 0.0 },
                    depth: hit.map_or(f64::INFINITY, |h| scene.camera.depth(ray.at(h.t))),
                    ..Incoming::NONE
                }
            }
            // Lights that the camera sees itself; the rest comes by itself.
            Integrator::Light(settings) => {
                let direct = PathSettings {
                    max_depth: Some(1),
                    hide_emitters: settings.hide_emitters,
                    ..PathSettings::default()
                };
                path::radiance(scene, plan, &direct, sampler, wavelengths, (ray, Sought::All), None, None)
            }
            Integrator::Nothing => Incoming::NONE,
        }
    }

    /// Follows the ray with the picture's own integrator.
    #[inline]
    fn follow(&mut self, shot: &Shot, sampler: &Sampler, ledger: Option<&Ledger>) {
        let watched = shot.scene.watch.is_some();
        if watched {
            // What came before belongs to no sample.
            let _ = watch::take();
        }
        let integrator = &shot.plan.integrator;
        let light = self.light(shot, sampler, integrator, shot.fog(integrator), ledger);
        if watched {
            self.counted = watch::take();
        }
        self.see(&light);
    }

    /// The small pictures of lamps of which the filter of its pixel may hold a part, if there are any.
    #[inline]
    fn glints<'a>(&self, shot: &Shot<'a>) -> Option<&'a Glints> {
        shot.plan.glints.as_deref().filter(|glints| glints.are_near(self.at.on_picture()))
    }

    /// Adds their light.
    #[inline]
    fn add_glints(&mut self, shot: &Shot, ledger: Option<&Ledger>) {
        if let Some(glints) = self.glints(shot) {
            for region in glints.about(self.at.on_picture()) {
                self.add_lamps(region, shot, ledger);
            }
        }
        // All of it is there.
        self.apart = false;
    }

    /// Their light apart from all else, after the `numbers` of the layers of the sample without it: in the layers by how much they change.
    #[inline(never)]
    fn glints_alone(&mut self, (shot, sampler): (&Shot, &Sampler), ledger: Option<&Ledger>, numbers: &[f32]) -> Alone {
        let before = self.sample;
        self.sample.radiance = Lanes::ZERO;
        self.add_glints(shot, ledger);
        self.finish(shot.scene);
        let sample = self.sample;
        let mut changed = layers::Values::default();
        if !numbers.is_empty() {
            self.sample.radiance = before.radiance + sample.radiance;
            self.finish(shot.scene);
            self.layers(shot, sampler, ledger, &mut changed);
            changed.numbers.iter_mut().zip(numbers).for_each(|(after, before)| *after -= before);
        }
        self.sample = before;
        Alone { sample, values: changed.numbers }
    }

    /// Takes what came of the ray.
    #[inline]
    fn see(&mut self, light: &Incoming) {
        self.sample.radiance = light.radiance;
        self.sample.alpha = light.alpha;
        (self.events, self.further) = (light.events, light.further);
    }

    /// What it took, in rays: a ray of the camera, from each vertex one to the next and one to a light, and further ones to lights.
    fn rays(&self, scene: &Scene) -> f64 {
        let clear = scene.media.iter().all(Medium::is_clear);
        let halvings = scene.lights.len().max(1).ilog2();
        let further = if clear { FURTHER } else { FURTHER_IN_MEDIA } + HALVING * f64::from(halvings);
        f64::from(1 + 2 * self.events) + further * f64::from(self.further)
    }

    /// What the film needs of the light.
    #[inline]
    fn finish(&mut self, scene: &Scene) {
        self.sample.xyz = observer::xyz(self.sample.radiance * scene.light_unit(), &self.sample.wavelengths);
    }

    /// Appends the numbers of the layers of the finished sample.
    #[inline]
    fn layers(&self, shot: &Shot, sampler: &Sampler, ledger: Option<&Ledger>, values: &mut layers::Values) {
        let Begun { ray, sample: PixelSample { radiance, wavelengths, xyz, alpha, weight, place }, counted, .. } =
            *self;
        let sampled = layers::Sampled {
            scene: shot.scene,
            plan: shot.plan,
            wavelengths: &wavelengths,
            ray: &ray,
            neighbours: |step: DVec2| shot.scene.camera.ray(place + step, || pairs(sampler.set(Set::Lens)).0),
            u: |crossing: u32, left: Option<f64>| deciding(shot, sampler, self.at, crossing, left),
            own: layers::Seen { radiance, xyz, alpha },
            counted,
            weight,
            ledger,
        };
        values.append(&sampled, |integrator| {
            let light = self.light(shot, sampler, integrator, shot.fog(integrator), None);
            let unit = shot.plan.layers.unit_of_integrator(integrator);
            let xyz = observer::xyz(light.radiance * unit, &wavelengths);
            layers::Seen { radiance: light.radiance, xyz, alpha: light.alpha }
        });
    }
}

/// What a sample took.
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Vertices of its path.
    pub events: u32,
    /// What it costs, in rays.
    pub rays: f64,
}

/// Renders sample `index` of `replicate` at `pixel`, and says what that took.
#[must_use]
pub fn sample(shot: &Shot, pixel: [u32; 2], replicate: u32, index: u32) -> (PixelSample, Work) {
    let sampler = Sampler::new(shot.seed, pixel, replicate, index);
    let mut begun = Begun::blank();
    begun.begin(shot, Address { pixel, replicate, index }, &sampler);
    let integrator = &shot.plan.integrator;
    let light = begun.light(shot, &sampler, integrator, shot.fog(integrator), None);
    begun.see(&light);
    begun.add_glints(shot, None);
    begun.finish(shot.scene);
    (begun.sample, Work { events: begun.events, rays: begun.rays(shot.scene) })
}

/// A place in block `block` of the `side` × `side` that the picture is cut into, in pixels.
fn place_in(scene: &Scene, side: usize, block: usize, u: DVec2) -> DVec2 {
    let corner = DVec2::new((block % side) as f64, (block / side) as f64);
    (corner + u) / side as f64 * DVec2::from(scene.camera.resolution.map(f64::from))
}

/// The light of sample `index` of `replicate` at `pixel` before fog, with what it left to paths from the lights.
fn probe(shot: &Shot, pixel: [u32; 2], replicate: u32, index: u32) -> (Incoming, SampledWavelengths) {
    let sampler = Sampler::new(shot.seed, pixel, replicate, index);
    let mut begun = Begun::blank();
    begun.begin(shot, Address { pixel, replicate, index }, &sampler);
    (begun.light(shot, &sampler, &shot.plan.integrator, None, None), begun.sample.wavelengths)
}

/// What a further shadow ray costs with all that it takes to find its light, in rays of a path: 0.55 to 0.8 in fifteen scenes of up
/// to twelve lights.
const FURTHER: f64 = 0.7;
/// The same where media scatter, which it has to cross: 1.0 and 1.5 to 1.6 in five scenes.
const FURTHER_IN_MEDIA: f64 = 1.45;
/// What it costs besides for each time that the lights are halved on the way to one of them: point lamps take 0.52 in all where
/// they are two, 0.78 where they are a hundred and 1.21 where they are ten thousand, balls 0.82, 1.29 and 1.63.
const HALVING: f64 = 0.05;

/// What a sample has for its own pixel alone, where the samples of others count for it, too: light of small pictures of lamps.
pub struct Alone {
    /// The sample with that light and no other.
    pub sample: PixelSample,
    /// What it adds to the numbers of the layers.
    pub values: Vec<f32>,
}

/// The memory of samples that are rendered one after the other.
pub struct Samples {
    octet: Octet,
    begun: [Begun; Octet::SAMPLES],
    layers: layers::Values,
    /// One for each, where light is parted.
    ledgers: Vec<Ledger>,
    /// By their places among the samples.
    alone: Vec<(usize, Alone)>,
    /// Pairs of vertices that were asked whether they see each other.
    pairs: u32,
}

impl Default for Samples {
    fn default() -> Samples {
        Samples {
            octet: Octet::default(),
            begun: std::array::from_fn(|_| Begun::blank()),
            layers: layers::Values::default(),
            ledgers: Vec::new(),
            alone: Vec::new(),
            pairs: 0,
        }
    }
}

impl Samples {
    /// What the samples of the last call, so many of `scene`, took, in rays.
    fn rays(&self, scene: &Scene, samples: usize) -> f64 {
        let paths: f64 = self.begun[..samples].iter().map(|begun| begun.rays(scene)).sum();
        paths + path::reuse::cost_of_a_pair(scene) * f64::from(self.pairs)
    }

    /// What samples of the last call have for their pixels alone, by their places among them.
    pub fn alone(&self) -> impl Iterator<Item = (usize, &Alone)> {
        self.alone.iter().map(|(i, alone)| (*i, alone))
    }

    /// Renders `samples` and gives each by its place among them, with the numbers of its layers and what covers it, where there
    /// are mattes. Where the plan has paths share what they find they are those of a group, else any.
    ///
    /// # Panics
    /// If they are more than [`Octet::SAMPLES`].
    pub fn render(
        &mut self,
        shot: &Shot,
        samples: &[Address],
        mut give: impl FnMut(usize, &PixelSample, &[f32], Option<u64>),
    ) {
        let Samples { octet, begun, layers, ledgers, alone, pairs } = self;
        let begun = &mut begun[..samples.len()];
        octet.reset(shot.seed, samples.iter().map(|at| (at.pixel, at.replicate, at.index)));
        // Step by step: in all but the second no sample waits for the one before, so that they overlap.
        for (i, (begun, &at)) in begun.iter_mut().zip(samples).enumerate() {
            begun.begin(shot, at, &octet.sampler(i));
        }
        if shot.plan.layers.parts_light() && ledgers.is_empty() {
            let ledger = |_| Ledger::new(shot.scene.light_groups.count().into());
            ledgers.extend((0..Octet::SAMPLES).map(ledger));
        }
        ledgers.iter().for_each(Ledger::clear);
        *pairs = 0;
        match &shot.plan.integrator {
            Integrator::Path(settings) if shot.plan.reuse => {
                *pairs = follow_shared(begun, shot, settings, octet, ledgers);
            }
            Integrator::Path(settings) if path::together::possible(shot, settings) && begun.len() > 1 => {
                follow_together(begun, shot, settings, octet);
            }
            _ => {
                for (i, begun) in begun.iter_mut().enumerate() {
                    begun.follow(shot, &octet.sampler(i), ledgers.get(i));
                }
            }
        }
        for (i, begun) in begun.iter_mut().enumerate() {
            if shot.plan.splatting {
                // That light comes below.
                begun.apart = false;
            } else {
                begun.add_glints(shot, ledgers.get(i));
            }
            begun.finish(shot.scene);
        }
        layers.numbers.clear();
        if !shot.plan.layers.layers.is_empty() {
            for (i, begun) in begun.iter().enumerate() {
                begun.layers(shot, &octet.sampler(i), ledgers.get(i), layers);
            }
        }
        let channels = layers.numbers.len() / begun.len().max(1);
        alone.clear();
        if shot.plan.splatting {
            for (i, begun) in begun.iter_mut().enumerate().filter(|(_, begun)| begun.glints(shot).is_some()) {
                let numbers = &layers.numbers[i * channels..(i + 1) * channels];
                alone.push((i, begun.glints_alone((shot, &octet.sampler(i)), ledgers.get(i), numbers)));
            }
        }
        for (i, begun) in begun.iter().enumerate() {
            let covered = shot.plan.layers.mattes.then(|| {
                let u = |crossing, left| deciding(shot, &octet.sampler(i), begun.at, crossing, left);
                middle::covered(shot.scene, shot.plan, &begun.ray, u)
            });
            give(i, &begun.sample, &layers.numbers[i * channels..(i + 1) * channels], covered.flatten());
        }
    }
}

/// What decides whether the ray of a sample goes through a hole at a crossing: the number by which its path does.
///
/// A ray of [`Integrator::Whitted`] is parted there and draws none: its samples stand for the parts, each by what is `left` of
/// its number behind a hole.
fn deciding(shot: &Shot, sampler: &Sampler, at: Address, crossing: u32, left: Option<f64>) -> f64 {
    match &shot.plan.integrator {
        Integrator::Whitted(settings) => left.unwrap_or_else(|| Spread::of_holes(settings.samples).at(at.in_turn())),
        _ => sampler.set(Set::Extra(crossing << 16))[2],
    }
}

/// [`Begun::follow`] of several samples whose paths go together.
fn follow_together(begun: &mut [Begun], shot: &Shot, settings: &PathSettings, octet: &Octet) {
    let mut light = [Incoming::NONE; Octet::SAMPLES];
    path::together::radiance(shot, settings, begun.len(), wanted(begun, octet), |i, found| light[i] = found);
    for (begun, mut light) in begun.iter_mut().zip(light) {
        veil(shot.fog(&shot.plan.integrator), &mut light, begun.sample.wavelengths.nm, None);
        begun.see(&light);
    }
}

/// [`Begun::follow`] of samples of a group of pixels whose paths share what they find.
///
/// How many pairs of their vertices were asked whether they see each other.
fn follow_shared(begun: &mut [Begun], shot: &Shot, settings: &PathSettings, octet: &Octet, ledgers: &[Ledger]) -> u32 {
    let watched = shot.scene.watch.is_some();
    if watched {
        // What came before belongs to no sample.
        let _ = watch::take();
    }
    let shared = begun[0].sample.wavelengths;
    begun.iter_mut().for_each(|begun| begun.sample.wavelengths = shared);
    let mut light = [Incoming::NONE; Octet::SAMPLES];
    let give = |i: usize, found| light[i] = found;
    let pairs = path::reuse::radiance(shot, settings, ledgers, begun.len(), wanted(begun, octet), give);
    for (i, (begun, mut light)) in begun.iter_mut().zip(light).enumerate() {
        veil(shot.fog(&shot.plan.integrator), &mut light, shared.nm, ledgers.get(i));
        begun.see(&light);
        begun.counted = Counts::default();
    }
    if watched {
        // They work for all: the first answers for them.
        begun[0].counted = watch::take();
    }
    pairs
}

/// What the paths of samples need.
fn wanted<'a>(begun: &'a [Begun], octet: &'a Octet) -> impl Fn(usize) -> Wanted<'a> {
    |i: usize| {
        let Begun { ray, apart, sample: PixelSample { wavelengths, .. }, .. } = &begun[i];
        Wanted { sampler: octet.sampler(i), nm: wavelengths.nm, ray, apart: *apart }
    }
}

/// Puts depth fog before the `light` of a path, which may be entered in a `ledger`.
#[inline]
fn veil(fog: Option<&DepthFog>, light: &mut Incoming, nm: Lanes, ledger: Option<&Ledger>) {
    let Some(fog) = fog else { return };
    let amount = fog.falloff.amount(light.depth) as f32;
    let veil = fog.colour.eval(nm) * amount;
    light.radiance = light.radiance * (1.0 - amount) + veil;
    if let Some(ledger) = ledger {
        ledger.veil(1.0 - amount, veil);
    }
}
