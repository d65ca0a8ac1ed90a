//! Path tracing: next-event estimation at every vertex, combined with scattering by multiple
//! importance sampling; media; eight wavelengths a path.
//!
//! Where sampling depends on wavelength, lane 0 leads and the estimator divides by the sum over
//! lanes of the densities with which each could have led (hero wavelengths, Wilkie et al. 2014).
//! The path carries β, the throughput over the hero's density, and ρ_k = p(path | λ_k) / p(path |
//! λ_0). A contribution is Σ_k β_k L_k / Σ_j ρ_j; with ρ = 1 that is the plain mean of the lanes.
//!
//! For light found both ways, with q the density of the light sample, A = q Σ ρ_j and B = Σ ρ_j p_j
//! are the densities of the two techniques, each already summed over the lanes that could lead;
//! they are combined by the power heuristic (Veach 1997, eq. 9.13).

mod along;
mod lights;
mod merged;
mod mirrored;
mod parting;
pub mod reuse;
mod state;
pub mod together;

use super::Incoming;
use super::photons::PhotonMap;
use super::plan::{Coverage, EffectPlan, PathSettings};
use super::roulette::{survival, worth};
use super::shadow::MAX_BOUNDARIES;
use super::ways::{First, Ledger};
use crate::math::Frame;
use crate::math::Ray;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::optics::bsdf::{Bsdf, BsdfSample, Chosen, Lambert, Lobes};
use crate::scene::ahead::Ahead;
use crate::scene::compound::{Compound, Leaf, Vertex};
use crate::scene::material::{Kind, Material, Straight};
use crate::scene::medium::Medium;
use crate::scene::{Hit, Scene, SurfacePoint};
use crate::spectrum::{LANES, Lanes, SampledWavelengths};
use along::Along;
use glam::DVec3;
use lights::{Questions, power_heuristic};
use mirrored::Counted;
use reuse::Joint;
use state::{Choice, Leaving, Path, Previous, Step, Walk};
use std::cell::Cell;

/// What light a path looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sought {
    /// All.
    All,
    /// All but that of lamps which it meets before anything scatters it; see [`crate::transport::glints`].
    Rest,
    /// That of these lamps alone: the path ends where something scatters it.
    Lamps,
}

impl Sought {
    /// By a path from anywhere in a pixel, whose lamps may be looked for `apart`.
    #[inline(always)]
    pub(super) fn in_pixel(apart: bool) -> Sought {
        if apart { Sought::Rest } else { Sought::All }
    }
}

/// The light that is `sought` along a camera ray, entered in a `ledger` if there is one.
#[must_use]
#[expect(clippy::too_many_arguments, reason = "all that a path is made of")]
pub fn radiance(
    scene: &Scene,
    plan: &EffectPlan,
    settings: &PathSettings,
    sampler: &Sampler,
    wavelengths: &SampledWavelengths,
    (ray, sought): (&Ray, Sought),
    photons: Option<&PhotonMap>,
    ledger: Option<&Ledger>,
) -> Incoming {
    let tracer = Tracer { scene, plan, settings, sampler: *sampler, nm: wavelengths.nm, photons, ledger, sought };
    let mut path = Path::BLANK;
    let walk = tracer.trace(ray, &mut path, None);
    path.incoming(walk.alpha, walk.depth)
}

struct Tracer<'a> {
    scene: &'a Scene,
    plan: &'a EffectPlan,
    settings: &'a PathSettings,
    sampler: Sampler<'a>,
    nm: Lanes,
    photons: Option<&'a PhotonMap>,
    /// Where light is parted by the way it came.
    ledger: Option<&'a Ledger>,
    sought: Sought,
}

impl Tracer<'_> {
    /// Follows a blank `path` along a ray of the camera to its end. Its first vertices may be noted in a `joint`.
    fn trace(&self, ray: &Ray, path: &mut Path, joint: Option<&mut Joint>) -> Walk {
        let Tracer { scene, plan, .. } = *self;
        (path.ray, path.inside) = (*ray, scene.camera_inside);
        // The camera does not see beyond its clipping plane; what it sees lies in everything's light.
        let reach = scene.camera.reach(ray);
        // The plan chooses the kernel: what a scene lacks is not in the code that runs.
        match (plan.chromatic, plan.media || plan.nested) {
            (false, false) => self.follow::<false, false>(path, reach, joint),
            (true, false) => self.follow::<true, false>(path, reach, joint),
            (false, true) => self.follow::<false, true>(path, reach, joint),
            (true, true) => self.follow::<true, true>(path, reach, joint),
        }
    }

    /// Follows a path to its end, no farther than `seen` until it scatters. Its first vertices may be noted in a `joint`.
    fn follow<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        mut seen: f64,
        mut joint: Option<&mut Joint>,
    ) -> Walk {
        let scene = self.scene;
        let mut walk = Walk::begin(scene, self.settings);
        let mut ahead = Ahead::UNKNOWN;

        loop {
            let mut reach = seen;
            // The flight through a medium is drawn first: beyond its reach no surface matters.
            let flying = if MEDIA { path.inside.medium } else { None }.map(|medium| {
                let medium = &scene.media[medium as usize];
                let set = Set::Extra(path.vertices.wrapping_add(walk.crossings << 16));
                let u = match walk.crossings {
                    0 => self.sampler.set(Set::Choice(path.vertices))[3],
                    _ => self.sampler.set(set)[0],
                };
                let draft = medium.set_out(self.nm, u);
                let looks_along = self.looks_along(path, medium);
                if !looks_along {
                    reach = reach.min(draft.reach);
                }
                (medium, set, draft, looks_along)
            });
            let hit = match MEDIA && scene.has_boundaries {
                true => scene.next(&mut ahead, &path.ray, reach),
                false => scene.closest(&path.ray, reach),
            };
            let distance = hit.map_or(f64::INFINITY, |h| h.t);

            // The medium between here and the next surface may scatter the path first.
            if MEDIA && let Some((medium, set, draft, looks_along)) = &flying {
                let (medium, set) = (*medium, *set);
                let along = looks_along.then(|| self.along(path, medium, distance));
                if let Some(along) = along.as_ref().filter(|_| self.sought != Sought::Lamps) {
                    self.ask_along::<CHROMATIC, MEDIA>(path, along, walk.crossings);
                }
                let flight = medium.arrive(draft, &path.ray, distance, self.nm, || self.sampler.walk(set));
                path.beta *= flight.weight;
                if CHROMATIC {
                    path.rho *= flight.ratio;
                }
                if let Some(previous) = &mut path.previous {
                    previous.density *= flight.density;
                }
                if let Some(t) = flight.scattered_at {
                    let point = path.ray.at(t);
                    // A medium counts as coverage: what is behind it is dimmed.
                    walk.cover();
                    walk.show(|| scene.camera.depth(point));
                    if !self.scatter_in_medium::<CHROMATIC, MEDIA>(
                        path,
                        point,
                        medium,
                        along.as_ref().map(|along| (along, t)),
                    ) {
                        break;
                    }
                    walk.crossings = 0;
                    seen = f64::INFINITY;
                    continue;
                }
                // What only absorbs dims it, too, without chance. Of the hero, whose chance decides where light is scattered: where
                // it does, one is left here.
                walk.veil(flight.weight.to_array()[0]);
            }

            match self.meet::<CHROMATIC, MEDIA>(path, &mut walk, hit, None, joint.as_deref_mut()) {
                Step::Ended => break,
                Step::Straight(distance) => {
                    seen -= distance;
                    ahead.go_on(distance);
                }
                Step::Scattered => seen = f64::INFINITY,
            }
            if self.sought == Sought::Lamps && !path.specular {
                break;
            }
        }
        walk
    }

    /// What a path does with what it meets. A shadow ray is left to `later`, where there is such a place; its first vertices are
    /// noted in a `joint`.
    #[inline(always)]
    fn meet<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        walk: &mut Walk,
        hit: Option<Hit>,
        later: Option<&mut Questions>,
        joint: Option<&mut Joint>,
    ) -> Step {
        let scene = self.scene;
        let Some(hit) = hit else {
            self.add_background::<CHROMATIC>(path);
            return Step::Ended;
        };
        let surface = scene.surface(&path.ray, &hit);
        let object = &scene.objects[hit.object as usize];
        let is_seen = path.vertices == 0 && !(self.settings.count_crossings && path.crossings > 0);
        if self.settings.hide_emitters && is_seen && object.is_lamp {
            // A lamp that the camera would see itself is not there.
            walk.crossings += 1;
            if walk.crossings > MAX_BOUNDARIES {
                return Step::Ended;
            }
            path.ray = scene.leave(&surface, &hit, path.ray.direction);
            return Step::Straight(hit.t);
        }
        let material = &scene.materials[object.material as usize];
        let wo_world = -path.ray.direction;
        // Of bodies that overlap one has the place; the surfaces of the others are not there.
        let bodies = &path.inside.bodies;
        let crossing = if MEDIA { scene.crossing(object, &surface, path.ray.direction, bodies) } else { None };
        let hidden = crossing.is_some_and(|crossing| !crossing.shows);
        // Of a material made of others, what this path meets, if anything.
        let compound = (matches!(material.kind, Kind::Compound(_)) && !hidden).then_some(material);
        let leaf = match &material.kind {
            Kind::Compound(compound) if !hidden => {
                let u = self.sampler.set(Set::Extra(path.vertices.wrapping_add(walk.crossings << 16)))[2];
                self.resolve(compound, &surface, &hit, wo_world, u)
            }
            _ => None,
        };
        let open = compound.is_some() && leaf.is_none();
        let material = leaf.as_ref().map_or(material, |leaf| leaf.material);
        let boundary = open || hidden || matches!(material.kind, Kind::Boundary);
        let straight = if open || hidden {
            Some(Straight::OPEN)
        } else if !MEDIA && !scene.has_boundaries {
            None
        } else {
            material.straight(&surface, path.ray.direction, || hit.texture_point(&surface), self.nm)
        };
        if match self.settings.coverage {
            Coverage::Surfaces => !boundary,
            Coverage::Scattering => straight.is_none(),
            Coverage::FirstHit => true,
        } {
            walk.cover();
        }
        if !boundary {
            walk.show(|| scene.camera.depth(surface.point));
        }

        // Light that the surface itself sends out.
        if let Some(light) = object.light.filter(|_| self.meets_lights(path))
            && !path.has_counted(light)
        {
            self.meet_lamp::<CHROMATIC>(path, light, &hit, &surface);
        }

        // What goes straight on has no vertex there: a lamp behind is also found from the vertex before.
        if let Some(straight) = &straight
            && (boundary
                || self.sampler.set(Set::Extra(path.vertices.wrapping_add(walk.crossings << 16)))[1] < straight.share)
        {
            let share = || match compound {
                None => straight.share,
                Some(all) => {
                    let at = || hit.texture_point(&surface);
                    all.straight(&surface, path.ray.direction, at, self.nm).map_or(1.0, |s| s.share)
                }
            };
            let through = Straight { share: path.previous.as_ref().map_or(1.0, |_| share()), ..*straight };
            return self.go_straight::<MEDIA>(path, walk, &hit, &surface, &through);
        }
        // A pane that mirrors.
        walk.cover();
        if self.is_last(path) {
            return Step::Ended;
        }

        let (frame, flip) = match &leaf {
            Some(leaf) => (leaf.frame, leaf.flipped),
            None => seen_frame(material, &surface, wo_world),
        };
        if let Some(caustics) = &self.plan.caustics {
            path.sharp = caustics.is_sharp(hit.object);
        }
        if let Some(ledger) = self.ledger {
            ledger.meet(self.scene.sharp[hit.object as usize]);
        }
        let choice = Choice { sampler: self.sampler, vertex: path.vertices, drawn: Cell::new(None) };
        let leaving = Leaving {
            hit: &hit,
            surface: &surface,
            object,
            frame: &frame,
            slopes: leaf.as_ref().map(|leaf| &leaf.slopes),
            crossing: crossing.as_ref(),
            wo: wo_world,
            sided: None,
            flip,
            pane: straight.is_some(),
            choice: &choice,
        };
        let at = hit.texture_point(&surface);
        if let Some(joint) = joint {
            match &material.kind {
                Kind::Diffuse { reflectance } if leaf.is_none() && straight.is_none() => {
                    let vertex = reuse::Vertex { hit, surface, up: frame.n, flip, wo: wo_world };
                    joint.meet(path, &vertex, || reflectance.eval(&at, self.nm), scene, self.ledger);
                }
                _ => joint.part(),
            }
        }
        // The most common of all has code of its own.
        let goes_on = match &material.kind {
            Kind::Diffuse { reflectance } if !MEDIA => {
                let lambert = Lambert { reflectance: reflectance.eval(&at, self.nm) };
                let leaving = Leaving { sided: Some(frame.n), ..leaving };
                self.scatter::<CHROMATIC, MEDIA, Lambert>(path, &leaving, &lambert, later)
            }
            _ => {
                let around = crossing.and_then(|crossing| crossing.around);
                let bsdf = material.bsdf_beside(&at, self.nm, self.plan.all_dispersive, around);
                let leaving = Leaving { sided: sided_normal(material, &frame), ..leaving };
                self.scatter::<CHROMATIC, MEDIA, Bsdf>(path, &leaving, &bsdf, later)
            }
        };
        if !goes_on {
            return Step::Ended;
        }
        walk.crossings = 0;
        Step::Scattered
    }

    /// The light of a lamp that the path meets.
    #[inline(always)]
    fn meet_lamp<const CHROMATIC: bool>(&self, path: &mut Path, index: u32, hit: &Hit, surface: &SurfacePoint) {
        let light = &self.scene.lights[index as usize];
        let emitted = light.emitted(surface, hit, -path.ray.direction, self.nm);
        let weight = match &path.previous {
            None => 1.0,
            Some(p) => {
                let total = Hit { t: p.distance + hit.t, ..*hit };
                let density = light.area_pdf(&self.scene.objects, p.point, path.ray.direction, &total, surface.normal);
                let q = self.asked().probability(index as usize, p.point, p.normal, path.judged) * density;
                if p.looked_along && q > 0.0 && self.is_left_to_shadow_rays(index) {
                    return;
                }
                power_heuristic(p.density * path.rho_sum::<CHROMATIC>(), q * p.rho)
            }
        };
        self.meet_light::<CHROMATIC>(path, index, emitted, weight);
    }

    /// On through a surface as if it were not there; `through` has the chance of that and its factor.
    #[inline(always)]
    fn go_straight<const MEDIA: bool>(
        &self,
        path: &mut Path,
        walk: &mut Walk,
        hit: &Hit,
        surface: &SurfacePoint,
        through: &Straight,
    ) -> Step {
        if self.settings.count_crossings && self.is_last(path) {
            return Step::Ended;
        }
        walk.crossings += 1;
        path.crossings += 1;
        if walk.crossings > MAX_BOUNDARIES {
            return Step::Ended;
        }
        path.beta *= through.weight;
        if let Some(p) = &mut path.previous {
            p.density *= through.share;
            p.distance += hit.t;
        }
        if MEDIA {
            let object = &self.scene.objects[hit.object as usize];
            path.inside = self.scene.beyond(object, surface, path.ray.direction, path.inside);
        }
        path.ray = self.scene.leave(surface, hit, path.ray.direction);
        Step::Straight(hit.t)
    }

    /// Asks a light and sends the path on; false where it ends.
    #[inline(always)]
    fn scatter<const CHROMATIC: bool, const MEDIA: bool, B: Lobes>(
        &self,
        path: &mut Path,
        at: &Leaving,
        bsdf: &B,
        later: Option<&mut Questions>,
    ) -> bool {
        let Leaving { hit, surface, object, frame, .. } = *at;
        let scene = self.scene;
        let wo = frame.to_local(at.wo);
        self.foresee(path);
        let (u_light, u_direction) = pairs(self.sampler.set(Set::Scatter(path.vertices)));
        // First, as light of a shadow ray may be left for later: the order of a sum is the same either way, and so are its bits.
        if let Some(map) = self.photons
            && path.specular
            && path.vertices > 0
            && !bsdf.is_discrete()
            && !path.sharp
        {
            self.add_merged::<CHROMATIC, B>(map, path, at, bsdf, wo);
        }
        path.beyond = path.counted.and_then(Counted::further);
        path.counted = match path.beyond {
            // All goes on the way on which the lamp has been counted.
            Some(beyond) if bsdf.glass().is_some_and(|glass| glass.mirrored(wo).is_none()) => Some(beyond),
            _ => self.look_at_mirrored::<CHROMATIC, MEDIA, B>(path, bsdf, wo, at),
        };
        if self.sought != Sought::Lamps && !bsdf.is_discrete() && self.asks() {
            let toward = path.ray.direction.dot(surface.normal);
            let inside = path.inside;
            self.ask_lights::<CHROMATIC, MEDIA>(
                path,
                (surface.point, at.sided),
                u_light,
                || at.choice.draw(0),
                |wi| at.eval(bsdf, wo, wi),
                |_| None,
                |wi| match wi.dot(surface.normal) * toward > 0.0 {
                    true => First::Transmitted,
                    false => First::Reflected(bsdf.diffuse_share(wo, frame.to_local(wi))),
                },
                // Light from the other side comes through what is there.
                |wi| match MEDIA && wi.dot(surface.normal) * toward > 0.0 {
                    true => scene.beyond(object, surface, wi, inside),
                    false => inside,
                },
                |wi| scene.leave(surface, hit, wi),
                later,
            );
        }

        // Of wavelengths that parted one goes on from where all have been seen.
        if !bsdf.is_discrete() && !path.goes_on() {
            return false;
        }

        // The last ray of a path only looks for light: there is none to meet.
        if !scene.shines_on_rays && self.is_next_to_last(path) {
            return false;
        }

        // On along a direction of the material's choice.
        // A pane that did not let the path straight through reflects it.
        let u_lobe = || if at.pane { 0.0 } else { at.choice.draw(1) };
        if let Some(glass) = bsdf.glass() {
            if let Some(reflection) = self.goes_both_ways(path, glass, wo, at) {
                return self.go_both_ways::<CHROMATIC, MEDIA>(path, glass, wo, &reflection, at);
            }
            if self.parts_at::<CHROMATIC>(path, glass) {
                return self.part::<MEDIA>(path, glass, wo, u_lobe(), at);
            }
        }
        match bsdf.sample_by(wo, u_lobe, u_direction) {
            Some(sample) => {
                let share = || match sample.chosen {
                    Chosen::Discrete => Lanes::ZERO,
                    Chosen::Density(_) => bsdf.diffuse_share(wo, sample.wi),
                };
                self.leave::<CHROMATIC, MEDIA>(path, &sample, share, at)
            }
            None => false,
        }
    }

    /// Sends the path on from a surface; false where it ends. `diffuse` is the share of f that is diffuse.
    #[inline(always)]
    fn leave<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        sample: &BsdfSample,
        diffuse: impl FnOnce() -> Lanes,
        at: &Leaving,
    ) -> bool {
        let Leaving { hit, surface, object, .. } = *at;
        let wi = at.frame.to_world(sample.wi);
        // As light that is asked for: neither side is the other's.
        let geometric = wi.dot(surface.normal) * if at.flip { -1.0 } else { 1.0 };
        if geometric * sample.wi.z <= 0.0 {
            return false;
        }
        let crosses = wi.dot(surface.normal) * at.wo.dot(surface.normal) < 0.0;
        path.previous = match sample.chosen {
            Chosen::Density(density) if self.asks() => Some(Previous {
                point: surface.point,
                normal: at.sided,
                rho: path.rho_sum::<CHROMATIC>() * f64::from(self.shadow_rays(path)),
                density,
                distance: 0.0,
                looked_along: false,
            }),
            Chosen::Density(_) | Chosen::Discrete => None,
        };
        if let Some(ledger) = self.ledger {
            let first = || if crosses { First::Transmitted } else { First::Reflected(diffuse()) };
            ledger.leave(path.vertices, first, sample.chosen == Chosen::Discrete);
        }
        path.mirrored |= path.sharp && path.vertices == 0;
        if let Some(caustics) = &self.plan.caustics {
            path.thrown = sample.chosen == Chosen::Discrete && caustics.throws_in_part(hit.object);
        }
        if sample.chosen != Chosen::Discrete {
            path.counted = None;
        } else if sample.transmitted {
            path.counted = path.beyond;
        }
        if path.specular && !path.sharp && sample.chosen != Chosen::Discrete {
            path.specular = false;
            let caustics = self.plan.caustics.as_ref();
            path.seen = caustics.is_some_and(|c| path.vertices == 0 || c.merging.is_some());
        }
        path.beta *= sample.weight;
        if let Some(slopes) = at.slopes {
            path.beta *= slopes.shadowing(wi) as f32;
        }
        if CHROMATIC {
            path.rho *= sample.ratio;
        }
        path.eta2 *= sample.eta2;
        if MEDIA && crosses {
            path.inside = self.scene.beyond(object, surface, wi, path.inside);
        } else if let Some(crossing) = at.crossing {
            path.inside.bodies = crossing.here;
        }
        path.ray = self.scene.leave(surface, hit, wi);
        path.vertices += 1;
        self.survives::<CHROMATIC>(path, sample.chosen == Chosen::Discrete, 1.0, || at.choice.draw(2))
    }

    /// What one path meets of a material made of others, chosen by `u`; `None` where it goes straight on.
    #[inline(never)]
    fn resolve<'a>(
        &self,
        compound: &'a Compound,
        surface: &SurfacePoint,
        hit: &Hit,
        wo: DVec3,
        u: f64,
    ) -> Option<Leaf<'a>> {
        let vertex = Vertex { scene: self.scene, hit, surface, at: &hit.texture_point(surface), wo };
        compound.resolve(&vertex, seen_normal(surface, wo), u)
    }

    /// Segments so far, less one: events that count for `max_depth`.
    fn events(&self, path: &Path) -> u32 {
        path.vertices + if self.settings.count_crossings { path.crossings } else { 0 }
    }

    /// Whether the path may not go on from where it is.
    fn is_last(&self, path: &Path) -> bool {
        self.settings.max_depth.is_some_and(|d| self.events(path) + 1 >= d)
    }

    /// Whether the path may go on once more, to see what shines there.
    fn is_next_to_last(&self, path: &Path) -> bool {
        self.settings.max_depth.is_some_and(|d| self.events(path) + 2 >= d)
    }

    /// Surfaces that a shadow ray from where the path is may go straight through.
    fn panes(&self, path: &Path) -> u32 {
        match self.settings.max_depth {
            Some(d) if self.settings.count_crossings => d.saturating_sub(self.events(path) + 2).min(MAX_BOUNDARIES),
            _ => MAX_BOUNDARIES,
        }
    }

    /// One event of scattering inside a medium; false where the path ends.
    fn scatter_in_medium<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        point: DVec3,
        medium: &Medium,
        along: Option<(&Along, f64)>,
    ) -> bool {
        if self.is_last(path) {
            return false;
        }
        (path.sharp, path.thrown) = (false, false);
        path.counted = None;
        if let Some(ledger) = self.ledger {
            ledger.meet(false);
        }
        let choice = self.sampler.set(Set::Choice(path.vertices));
        let wo = -path.ray.direction;
        self.foresee(path);
        let (u_light, u_direction) = pairs(self.sampler.set(Set::Scatter(path.vertices)));
        let next_event = self.asks() && medium.shadow_rays;
        if next_event && self.sought != Sought::Lamps {
            let inside = path.inside;
            let eval = |wi| {
                let p = Lanes::splat(medium.phase.eval(point, wo, wi) as f32);
                (p, p)
            };
            let share = |lamp| along.and_then(|(along, t)| self.share_of_flight(along, t, lamp));
            self.ask_lights::<CHROMATIC, MEDIA>(
                path,
                (point, None),
                u_light,
                || choice[0],
                eval,
                share,
                |_| First::Media,
                |_| inside,
                |wi| Ray::new(point, wi),
                None,
            );
        }
        if !path.goes_on() {
            return false;
        }
        let wi = medium.phase.sample(point, wo, u_direction);
        if let Some(ledger) = self.ledger {
            ledger.leave(path.vertices, || First::Media, false);
        }
        path.previous = next_event.then(|| Previous {
            point,
            normal: None,
            rho: path.rho_sum::<CHROMATIC>() * f64::from(self.shadow_rays(path)),
            density: medium.phase.eval(point, wo, wi),
            distance: 0.0,
            looked_along: along.is_some(),
        });
        path.ray = Ray::new(point, wi);
        path.seen |= path.vertices == 0;
        path.specular = false;
        path.vertices += 1;
        let worth = worth(&mut path.near, || self.scene.lit_within, point.distance(self.scene.center));
        self.survives::<CHROMATIC>(path, false, worth, || choice[2])
    }

    /// Russian roulette on the largest lane, after a vertex that mirrors or refracts or one that does not, where `worth` of the light
    /// comes that came before; false where the path ends.
    fn survives<const CHROMATIC: bool>(
        &self,
        path: &mut Path,
        discrete: bool,
        worth: f64,
        u: impl FnOnce() -> f64,
    ) -> bool {
        if path.beta.simd_gt(Lanes::ZERO).none() {
            return false;
        }
        if path.vertices + 1 < self.settings.roulette_depth {
            return true;
        }
        let beta = path.beta.to_array().into_iter().fold(0.0f32, f32::max);
        let carried = f64::from(beta) * LANES as f64 / path.rho_sum::<CHROMATIC>() * path.eta2 * worth;
        let q = survival(carried, path.vertices, discrete);
        if u() >= q {
            return false;
        }
        path.beta *= (1.0 / q) as f32;
        true
    }
}

/// The side on which light is wanted: the shading normal for surfaces that only reflect.
fn sided_normal(material: &Material, frame: &Frame) -> Option<DVec3> {
    (!material.transmits()).then_some(frame.n)
}

/// The shading normal; the true one where the viewer sees the surface from one side and the shading normal's from
/// the other.
pub(super) fn seen_normal(surface: &SurfacePoint, wo: DVec3) -> DVec3 {
    if sides_differ(surface, wo) { surface.normal } else { surface.shading_normal }
}

/// The local frame of a surface that is seen from `wo`, whose z is the shading normal, and whether it is turned against that: two-sided
/// materials turn it to the viewer.
#[inline(always)]
pub(super) fn seen_frame(material: &Material, surface: &SurfacePoint, wo: DVec3) -> (Frame, bool) {
    let flip = material.two_sided && wo.dot(surface.normal) < 0.0;
    let normal = seen_normal(surface, wo);
    (Frame::from_normal_and_tangent(if flip { -normal } else { normal }, surface.tangent), flip)
}

/// Whether `wo` is on one side of the surface and on the other of its shading normal's.
fn sides_differ(surface: &SurfacePoint, wo: DVec3) -> bool {
    surface.shading_normal.dot(wo) * surface.normal.dot(wo) <= 0.0
}
