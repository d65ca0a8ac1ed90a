//! Light tracing: paths that begin at a light, and at each surface send their light to the camera.
//!
//! A pixel is I = ∫ f_j L dx, L the radiance that reaches the camera and f_j the pixel's filter. With a path that
//! carries the power Φ over its density, each vertex adds Φ f |cos θ| · (pixels per area across the way to the
//! camera) to the pixel where the camera sees it, and the sum is divided by the number of paths (Veach 1997,
//! chapters 4 and 8). Shading normals are made adjoint by Veach's factor (5.3.2), and refraction does not scale power
//! as it scales radiance (5.2).
//!
//! Found are paths L … D E: what a smooth mirror or glass shows cannot be found, and is black. Light that the camera sees
//! itself, L E, is the camera's part (`path` of one segment). Wavelengths are carried as in [`path`](super::path).

mod connect;
mod flight;
mod packet;
mod span;
mod views;

pub use span::span;

use self::flight::{Landing, Met};
use self::views::{Place, View};
use super::caustics::{Caustics, Target};
use super::merge::WavelengthCell;
use super::photons::{Alone, Photon, Photons, Together};
use super::plan::{EffectPlan, LightSettings};
use super::roulette;
use super::shadow::MAX_BOUNDARIES;
use super::{moment_at, scene_at};
use crate::math::Ray;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::optics::bsdf::{Bsdf, BsdfSample, Chosen, Lobes};
use crate::scene::compound::below;
use crate::scene::light::Light;
use crate::scene::nested::Bodies;
use crate::scene::{Hit, Inside, Medium, Scene, SurfacePoint};
use crate::spectrum::{LANES, Lanes, SampledWavelengths, observer};
use glam::{DVec2, DVec3};

/// The set that chooses which wavelength goes on: above every vertex's.
const CHOSEN: u32 = 1 << 29;

/// Tells the random numbers of lights from those of the camera.
const STREAM: u64 = 0x6c69_6768_7470_6174;

/// Light that reached the camera.
#[derive(Clone, Copy, Debug)]
pub struct Splat {
    /// Where on the picture, in pixels.
    pub place: DVec2,
    /// Spectral power by pixel, W·nm⁻¹, for each lane; its mean over paths is the picture's radiance.
    pub light: Lanes,
    /// The one lane that is not dark, where wavelengths have parted.
    pub alone: Option<usize>,
    /// The group of its lamp.
    pub group: u8,
}

impl Splat {
    /// CIE XYZ of the light times `unit`.
    #[must_use]
    pub fn xyz(&self, unit: f32, wavelengths: &SampledWavelengths) -> [f32; 3] {
        let light = self.light * unit;
        match self.alone {
            Some(lane) => observer::xyz_of_lane(light, lane, wavelengths),
            None => observer::xyz(light, wavelengths),
        }
    }
}

/// The part of the plane of the picture where light is wanted, in pixels.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Upper left corner.
    pub low: DVec2,
    /// Lower right corner.
    pub high: DVec2,
}

impl Bounds {
    fn holds(&self, place: DVec2) -> bool {
        place.cmpge(self.low).all() && place.cmple(self.high).all()
    }
}

/// Which paths from the lights are wanted.
#[derive(Clone, Copy, Debug)]
pub struct LightPaths<'a> {
    /// What light crosses.
    pub scene: &'a Scene,
    /// The same while the shutter is open, of which each path sees one; none where nothing is blurred.
    pub moments: &'a [Scene],
    /// What is simulated.
    pub plan: &'a EffectPlan,
    /// How far.
    pub settings: LightSettings,
    /// Only those of the class C, and how they are aimed; all for `None`.
    pub caustics: Option<&'a Caustics>,
    /// Of the random numbers.
    pub seed: u64,
    /// Where light is wanted.
    pub bounds: Bounds,
    /// From where in [0, 1) wavelengths are chosen, where paths share them or nearly so.
    pub wavelength: Option<WavelengthCell>,
}

/// What a path was.
#[derive(Clone, Copy, Debug, Default)]
pub struct Traced {
    /// Rays that were followed, to surfaces and to the camera; of those that went side by side half.
    pub rays: u32,
    /// The source and the place in its guide.
    pub began: Option<(usize, DVec2)>,
    /// The direction in which it began.
    pub direction: DVec3,
    /// What of the light a path from the camera would find, if that is thrown to the lamp by what scatters the rest: a share of it.
    pub share: f64,
    /// Its wavelengths.
    pub wavelengths: Option<SampledWavelengths>,
    /// Whether no path from the camera could be the same: a lamp without extent, and what throws its light in a single direction.
    pub unfound: bool,
}

/// Follows path `index` of `replicate` and hands each of its splats within the bounds to `splat`.
pub fn trace(
    paths: &LightPaths,
    replicate: u32,
    index: u64,
    photons: Option<&mut Photons>,
    splat: &mut dyn FnMut(&SampledWavelengths, Splat),
) -> Traced {
    // One long sequence a replicate, as the lights are the same for every pixel.
    let sampler = Sampler::new(paths.seed ^ STREAM, [(index >> 32) as u32, 0], replicate, index as u32);
    let (u_choice, u_time) = pairs(sampler.set(Set::Camera));
    let (u_point, u_direction) = pairs(sampler.set(Set::Extra(0)));
    let scene = scene_at(paths.scene, paths.moments, |count| moment_at(u_time.y, count));
    let paths = &LightPaths { scene, ..*paths };
    let wavelengths = scene.wavelengths.sample(paths.wavelength.map_or(u_time.x, |cell| cell.at(u_time.x)));
    let mut traced = Traced { wavelengths: Some(wavelengths), ..Traced::default() };
    let (mut target, mut group) = (Target::Own, 0);
    let emission = match paths.caustics {
        None => scene.emit(u_choice.x, u_point, u_direction, wavelengths.nm),
        Some(caustics) => caustics.begin(scene, u_choice.x, u_point, u_direction, wavelengths.nm).map(|aimed| {
            traced.began = Some((aimed.source, aimed.cell));
            target = aimed.target;
            group = scene.light_groups.of[aimed.emission.light as usize];
            aimed.emission
        }),
    };
    let Some(emission) = emission else { return traced };
    traced.direction = emission.ray.direction;
    let start = largest(emission.power.lanes);
    if start.is_nan() || start <= 0.0 {
        return traced;
    }
    let mut walk = Walk {
        paths,
        sampler: &sampler,
        wavelengths: &wavelengths,
        start,
        unit_area: emission.power.unit_area,
        splat,
        photons,
        target,
        group,
        lamp: Some(&scene.lights[emission.light as usize]),
        unfound: false,
        share: 1.0,
        rays: 0,
        ahead: None,
    };
    let bodies = if paths.plan.nested { scene.bodies_around(&emission.ray) } else { Bodies::NONE };
    walk.follow(Beam::begin(emission.ray, emission.power.lanes, wavelengths.nm, None, bodies));
    (traced.rays, traced.unfound, traced.share) = (walk.rays, walk.unfound, walk.share);
    traced
}

/// Where what is not sharp is seen in sharp things along a ray of the camera, as if a photon of unit power came out of it.
#[must_use]
pub(super) fn seen_in_sharp(
    paths: &LightPaths,
    ray: &Ray,
    wavelengths: &SampledWavelengths,
    sampler: &Sampler,
) -> Option<Photon<Together>> {
    let mut seen = Photons::over(1.0);
    let splat = &mut |_: &SampledWavelengths, _| {};
    let mut walk = Walk {
        paths,
        sampler,
        wavelengths,
        start: 1.0,
        unit_area: 1.0,
        splat,
        photons: Some(&mut seen),
        target: Target::Own,
        group: 0,
        lamp: None,
        unfound: false,
        share: 1.0,
        rays: 0,
        ahead: None,
    };
    let ray = if walk.hides_lamps() { past_lamps(paths.scene, ray) } else { *ray };
    let Inside { medium, bodies } = paths.scene.camera_inside;
    walk.follow(Beam::begin(ray, Lanes::ONE, wavelengths.nm, Some(medium), bodies));
    seen.iter().next()
}

/// A ray of the camera, from behind the lamps in its way.
fn past_lamps(scene: &Scene, ray: &Ray) -> Ray {
    let mut ray = *ray;
    for _ in 0..MAX_BOUNDARIES {
        let lamp = |hit: &Hit| scene.objects[hit.object as usize].is_lamp;
        let Some(hit) = scene.closest(&ray, f64::INFINITY).filter(lamp) else { break };
        ray = scene.leave(&scene.surface(&ray, &hit), &hit, ray.direction);
    }
    ray
}

/// Light on its way.
#[derive(Clone, Copy)]
struct Beam {
    ray: Ray,
    /// Over the hero's density and the unit of area of the walk.
    power: Lanes,
    /// Density of each lane over the hero's, as in `path`.
    rho: Lanes,
    /// What `rho` was where wavelengths parted; one before.
    led: Lanes,
    /// The wavelengths; all the same for one that goes alone.
    nm: Lanes,
    /// The wavelength that goes alone, since the others took another way.
    alone: Option<usize>,
    /// Whether it goes on for all that parted.
    chosen: bool,
    /// What the beam is in: `None` while it is not known.
    medium: Option<Option<u32>>,
    /// The bodies with a priority that it is in.
    bodies: Bodies,
    /// As that of a path from the camera, with where it is seen from in place of what shines.
    near: f64,
    /// Vertices so far.
    vertex: u32,
    /// What it went straight through so far, if that counts.
    crossings: u32,
    /// Whether no path from the camera that collects photons on the way could be the same.
    unfound: bool,
}

impl Beam {
    /// All wavelengths together, before the first vertex.
    fn begin(ray: Ray, power: Lanes, nm: Lanes, medium: Option<Option<u32>>, bodies: Bodies) -> Beam {
        Beam {
            ray,
            power,
            rho: Lanes::ONE,
            led: Lanes::ONE,
            nm,
            alone: None,
            chosen: false,
            medium,
            bodies,
            near: 0.0,
            vertex: 0,
            crossings: 0,
            unfound: false,
        }
    }

    fn inside(&self) -> Inside {
        Inside { medium: self.medium.flatten(), bodies: self.bodies }
    }

    /// Segments so far, less one: events that count for the greatest depth.
    fn events(&self) -> u32 {
        self.vertex + self.crossings
    }

    /// Of light at the wavelengths of the beam, that at those of the path.
    fn only(&self, light: Lanes) -> Lanes {
        let Some(lane) = self.alone else { return light };
        let value = light.to_array()[0];
        Lanes::new(std::array::from_fn(|k| if k == lane { value } else { 0.0 }))
    }
}

/// A walk from a light and what it has cost.
struct Walk<'a, 'b> {
    paths: &'a LightPaths<'a>,
    sampler: &'a Sampler<'a>,
    wavelengths: &'a SampledWavelengths,
    /// Largest power at the start.
    start: f64,
    /// By which power is told, m².
    unit_area: f64,
    splat: &'b mut dyn FnMut(&SampledWavelengths, Splat),
    /// Where photons are left, if they are wanted.
    photons: Option<&'b mut Photons>,
    /// What it is aimed at.
    target: Target,
    /// The group of the lamp.
    group: u8,
    /// The lamp; none of a walk that begins at the camera.
    lamp: Option<&'a Light>,
    /// As in [`Traced`].
    unfound: bool,
    share: f64,
    rays: u32,
    /// What the beam that is to be followed meets next, where that is known.
    ahead: Option<Hit>,
}

/// What is drawn at a vertex.
struct Numbers {
    flight: f64,
    lobe: f64,
    roulette: f64,
    lens: DVec2,
    scatter: DVec2,
}

impl<'a> Walk<'a, '_> {
    /// Beyond the first ray, evenly spread numbers gain nothing: what a path adds to a pixel is too rugged.
    fn numbers(&self, vertex: u32) -> Numbers {
        let mut numbers = self.sampler.walk(Set::Choice(vertex));
        let [flight, lobe, roulette] = std::array::from_fn(|_| numbers.draw());
        let [lens, scatter] = std::array::from_fn(|_| DVec2::new(numbers.draw(), numbers.draw()));
        Numbers { flight, lobe, roulette, lens, scatter }
    }

    /// Whether nothing may be met any more after `events`: the camera is one segment further than the next surface.
    fn is_last(&self, events: u32) -> bool {
        self.paths.settings.max_depth.is_some_and(|depth| events + 2 > depth)
    }

    /// Whether lamps that the camera would see itself are not there, as paths from the camera have it.
    fn hides_lamps(&self) -> bool {
        self.paths.settings.hide_emitters && self.paths.caustics.is_some()
    }

    /// Whether no ray meets the lamp.
    fn is_without_extent(&self) -> bool {
        self.lamp.is_some_and(|lamp| !lamp.may_be_met())
    }

    /// Follows a beam to its end: at each surface and each point of a medium its light goes to the camera, and it goes on.
    fn follow(&mut self, mut beam: Beam) {
        let LightPaths { scene, plan, caustics, .. } = *self.paths;
        loop {
            let vertex = beam.vertex;
            if self.is_last(beam.events()) {
                return;
            }
            let numbers = self.numbers(vertex);
            let Some(met) = self.fly(&mut beam, numbers.flight) else { return };
            let came = -beam.ray.direction;
            let Landing { hit, surface, part, pane, meeting } = match met {
                Met::Surface(landing) => landing,
                Met::Medium { point, medium } => match self.scatter_in_medium(&mut beam, point, medium, &numbers) {
                    true => continue,
                    false => return,
                },
            };
            let Numbers { lobe: u_lobe, roulette: u_roulette, lens: u_lens, scatter: u_scatter, .. } = numbers;
            let object = &scene.objects[hit.object as usize];
            let sharp = caustics.is_some_and(|c| c.is_sharp(hit.object));
            // What else is next to a lamp without extent counts as far as it throws light in a single direction.
            let in_part = vertex == 0 && caustics.is_some() && !sharp;
            if vertex == 0
                && caustics.is_some_and(|c| !c.begins_at(self.target, hit.object, self.lamp, beam.ray.direction))
            {
                return;
            }
            let (material, part_of) = match &part {
                Some((leaf, compound, u)) => (leaf.material, Some((*compound, *u, leaf.turning))),
                None => (&scene.materials[object.material as usize], None),
            };
            let at = Place { scene, hit: &hit, surface: &surface, came, two_sided: material.two_sided, part_of };
            let view = match &part {
                Some((leaf, ..)) => at.of_leaf(leaf),
                None => at.seen_from(came),
            };
            let around = meeting.and_then(|meeting| meeting.around);
            if let Some(meeting) = meeting {
                beam.bodies = meeting.here;
            }
            let mut bsdf = material.bsdf_beside(&hit.texture_point(&surface), beam.nm, plan.all_dispersive, around);
            if let (Bsdf::Dielectric(glass), Some(_)) = (&bsdf, beam.alone) {
                bsdf = Bsdf::Dielectric(glass.lane(0));
            }
            let wo = view.frame.to_local(came);

            // What is black, or lit from behind, sends nothing on and leaves nothing to collect.
            if let Bsdf::Diffuse { reflectance } = &bsdf
                && (wo.z <= 0.0 || reflectance.simd_eq(Lanes::ZERO).all())
            {
                return;
            }
            if !bsdf.is_discrete() && !in_part && (!sharp || beam.unfound) {
                self.connect(&beam, &bsdf, &at, &view, u_lens);
                if !sharp {
                    if part.is_none() {
                        self.leave_photon(&beam, &surface);
                    }
                    beam.unfound = false;
                }
                if !self.goes_on(&mut beam) {
                    return;
                }
            }

            // A pane that did not let the path straight through reflects it.
            let u_lobe = if pane { 0.0 } else { u_lobe };
            if let Bsdf::Dielectric(glass) = &bsdf
                && caustics.is_some_and(|c| c.packets)
                && beam.alone.is_none()
                && !beam.chosen
                && glass.parts()
            {
                self.throw(&mut beam);
                // Each wavelength decides for itself with the same random numbers. Where all are reflected the one that has led so
                // far leads on.
                if at.is_plain()
                    && let Some(sample) = glass.reflects_all(wo, u_lobe)
                {
                    if !self.cross(&mut beam, &sample, &at, &view, u_roulette) {
                        return;
                    }
                    continue;
                }
                beam.power *= LANES as f32 / beam.rho.reduce_add();
                (beam.led, beam.rho) = (beam.rho, Lanes::ONE);
                for view in at.views(&view, &bsdf) {
                    self.part(&beam, glass, &at, &view, [u_lobe, u_roulette]);
                }
                return;
            }
            let Some((sample, view)) = self.sample(&bsdf, &at, &view, vertex, u_lobe, u_scatter) else { return };
            match sample.chosen {
                Chosen::Discrete => self.throw(&mut beam),
                Chosen::Density(_) if in_part => return,
                Chosen::Density(_) => {}
            }
            if in_part && let Some(mirrored) = bsdf.mirrored(wo) {
                self.share = f64::from(mirrored.reduce_add()) / LANES as f64;
            }
            if !self.cross(&mut beam, &sample, &at, &view, u_roulette) {
                return;
            }
        }
    }

    /// Sends the light of a point in a medium to the camera, and the beam on from there; false where it ends.
    fn scatter_in_medium(&mut self, beam: &mut Beam, point: DVec3, medium: &Medium, numbers: &Numbers) -> bool {
        // Next to the light something sharp is wanted.
        if self.paths.caustics.is_some() && beam.vertex == 0 {
            return false;
        }
        self.connect_medium(beam, point, medium, numbers.lens);
        if !self.goes_on(beam) {
            return false;
        }
        let went = medium.phase.sample(point, -beam.ray.direction, numbers.scatter);
        beam.ray = Ray::new(point, went);
        beam.vertex += 1;
        let Scene { center, radius, ref camera, .. } = *self.paths.scene;
        let seen_within = || radius.max(camera.eye().distance(center));
        let worth = roulette::worth(&mut beam.near, seen_within, point.distance(center));
        self.survives(beam, false, worth, numbers.roulette)
    }

    /// Notes that a beam is thrown in a single direction.
    fn throw(&mut self, beam: &mut Beam) {
        if beam.vertex == 0 && self.is_without_extent() {
            (beam.unfound, self.unfound) = (true, true);
        }
    }

    /// Where light goes on from a surface, and as what it is seen from there; `view` is what it is to those whence it came.
    fn sample(
        &self,
        bsdf: &Bsdf,
        at: &Place,
        view: &View,
        vertex: u32,
        u_lobe: f64,
        u_scatter: DVec2,
    ) -> Option<(BsdfSample, View)> {
        let sent = |view: &View| {
            let wo = view.frame.to_local(at.came);
            let sample = bsdf.sample(wo, u_lobe, u_scatter)?;
            Some(BsdfSample { weight: sample.weight * bsdf.power_of_lanes(wo, sample.transmitted), ..sample })
        };
        if at.is_plain() {
            return Some((sent(view)?, *view));
        }
        let mut found = None;
        let (mut count, mut u) = (0u8, self.sampler.set(Walk::set_of_flight(vertex, 0))[3]);
        for view in at.views(view, bsdf) {
            let Some(sample) = sent(&view) else { continue };
            if at.is_seen_so(&view, view.frame.to_world(sample.wi)) {
                // Of n each is kept with probability 1/n.
                count += 1;
                if below(&mut u, 1.0 / f64::from(count)) {
                    found = Some((sample, view));
                }
            }
        }
        found.map(|(sample, view)| (BsdfSample { weight: sample.weight * f32::from(count), ..sample }, view))
    }

    /// Sends the beam on from a surface that is seen as `view` from where it goes; false where it ends.
    fn cross(&self, beam: &mut Beam, sample: &BsdfSample, at: &Place, view: &View, roulette: f64) -> bool {
        let went = view.frame.to_world(sample.wi);
        // Power, not radiance: no 1/η² on crossing, and the cosines of the true normal for those of the other.
        let normal = at.surface.normal;
        let cosines = [view.frame.n, normal].map(|normal| at.came.dot(normal));
        let side = went.dot(normal) * cosines[1];
        if view.facing(cosines[1]) * cosines[0] <= 0.0 || side == 0.0 {
            return false;
        }
        let adjoint = sample.eta2 * adjoint(cosines[0], sample.wi.z, cosines[1], went.dot(normal));
        beam.power *= sample.weight * (view.shadowing * adjoint as f32);
        beam.rho *= sample.ratio;
        let scene = self.paths.scene;
        if side < 0.0 {
            let object = &scene.objects[at.hit.object as usize];
            let beyond = scene.beyond(object, at.surface, went, beam.inside());
            (beam.medium, beam.bodies) = (Some(beyond.medium), beyond.bodies);
        }
        beam.ray = scene.leave(at.surface, at.hit, went);
        beam.vertex += 1;
        self.survives(beam, sample.chosen == Chosen::Discrete, 1.0, roulette)
    }

    /// Russian roulette on the largest lane, where what goes on has `worth`; false where the beam ends.
    fn survives(&self, beam: &mut Beam, discrete: bool, worth: f64, u: f64) -> bool {
        let carried = largest(beam.power) * f64::from(LANES as f32 / beam.rho.reduce_add());
        let Some(times) = self.survival(carried * worth, beam.vertex, discrete, u) else { return false };
        beam.power *= times;
        true
    }

    /// Russian roulette at `vertex` of what has `carried` so much power there: how many times more it is worth if it goes
    /// on; `None` where it ends.
    fn survival(&self, carried: f64, vertex: u32, discrete: bool, u: f64) -> Option<f32> {
        if carried.is_nan() || carried <= 0.0 {
            return None;
        }
        if vertex + 1 < self.paths.settings.roulette_depth {
            return Some(1.0);
        }
        let q = roulette::survival(carried / self.start, vertex, discrete);
        (u < q).then_some((1.0 / q) as f32)
    }

    /// Of wavelengths that parted, only one goes on from where all have been seen: beyond, their ways have nothing in
    /// common.
    fn goes_on(&self, beam: &mut Beam) -> bool {
        let Some(lane) = beam.alone.filter(|_| !beam.chosen) else { return true };
        if self.chosen_lane() != lane {
            return false;
        }
        beam.power *= LANES as f32;
        beam.chosen = true;
        true
    }

    /// Which wavelength goes on: the same answer for each of them, wherever they are.
    fn chosen_lane(&self) -> usize {
        (self.sampler.set(Set::Extra(CHOSEN))[0] * LANES as f64) as usize
    }

    /// Leaves a photon where the beam has come to, if photons are wanted.
    fn leave_photon(&mut self, beam: &Beam, surface: &SurfacePoint) {
        let Some(photons) = &mut self.photons else { return };
        let (point, came, normal) = (surface.point, -beam.ray.direction.as_vec3(), surface.normal.as_vec3());
        let (vertices, group) = (beam.vertex, self.group);
        let power = beam.power * (self.unit_area / photons.unit_area) as f32;
        // It is collected as light of the shared wavelengths, and is weighed by their density: near a line another one than its own.
        let cell = self.paths.wavelength.filter(|cell| cell.width > 0.0);
        let shared = cell.map(|cell| self.paths.scene.wavelengths.sample(cell.shared).inv_pdf);
        let weight = shared.map_or(Lanes::ONE, |shared| self.wavelengths.inv_pdf / shared);
        match beam.alone {
            None => {
                let light = Together { power: power * weight, rho: beam.rho };
                photons.together.push(Photon { point, came, normal, light, vertices, group });
            }
            // What led to where it parted counts beside what leads a path from the camera here.
            Some(_) if beam.led.simd_ne(Lanes::ONE).any() => {
                let power = beam.only(power * beam.led.reduce_add() / LANES as f32) * weight;
                let light = Together { power, rho: beam.led };
                photons.together.push(Photon { point, came, normal, light, vertices, group });
            }
            Some(lane) => {
                let weight = weight.to_array()[lane] * LANES as f32 / beam.rho.reduce_add();
                let power = power.to_array()[0] * weight;
                let light = Alone { power, lane: lane as u8 };
                photons.alone.push(Photon { point, came, normal, light, vertices, group });
            }
        }
    }
}

/// |cos(came, n_s) cos(went, n_g) / (cos(came, n_g) cos(went, n_s))|, Veach 1997, eq. 5.19.
fn adjoint(came_shading: f64, went_shading: f64, came_true: f64, went_true: f64) -> f64 {
    if came_shading.abs() == came_true.abs() && went_shading.abs() == went_true.abs() {
        return 1.0;
    }
    let factor = (came_shading * went_true / (came_true * went_shading)).abs();
    if factor.is_finite() { factor } else { 0.0 }
}

fn largest(x: Lanes) -> f64 {
    f64::from(x.to_array().into_iter().fold(0.0f32, |a, b| if b > a || b.is_nan() { b } else { a }))
}
