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

mod lights;
mod parting;

use super::Incoming;
use super::merge::PhotonMap;
use super::plan::{EffectPlan, PathSettings};
use super::shadow::MAX_BOUNDARIES;
use crate::math::Frame;
use crate::math::Ray;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::optics::bsdf::{Bsdf, BsdfSample, Chosen};
use crate::scene::ahead::Ahead;
use crate::scene::compound::{Compound, Leaf, Slopes, Vertex};
use crate::scene::material::{Kind, Material, Straight};
use crate::scene::medium::Medium;
use crate::scene::nested::Crossing;
use crate::scene::{Hit, Inside, Object, Scene, SurfacePoint};
use crate::spectrum::{LANES, Lanes, SampledWavelengths};
use glam::DVec3;
use lights::{Scatterer, power_heuristic};

/// Vertices up to which a path that has lost nothing goes on for sure: clear glass then shows what
/// is behind it without the noise of roulette, in every sample.
pub(super) const FOR_SURE: u32 = 256;

/// Longest survival of a path beyond that: one in a thousand is ended at each vertex, so that light
/// trapped between perfect mirrors costs some thousand vertices, not for ever.
pub(super) const SURVIVAL: f64 = 0.999;

/// Light that arrives along a camera ray.
#[must_use]
pub fn radiance(
    scene: &Scene,
    plan: &EffectPlan,
    settings: &PathSettings,
    sampler: &Sampler,
    wavelengths: &SampledWavelengths,
    ray: &Ray,
    photons: Option<&PhotonMap>,
) -> Incoming {
    let tracer = Tracer { scene, plan, settings, sampler, nm: wavelengths.nm, photons };
    // The plan chooses the kernel: what a scene lacks is not in the code that runs.
    match (plan.chromatic, plan.media || plan.nested) {
        (false, false) => tracer.trace::<false, false>(ray),
        (true, false) => tracer.trace::<true, false>(ray),
        (false, true) => tracer.trace::<false, true>(ray),
        (true, true) => tracer.trace::<true, true>(ray),
    }
}

struct Tracer<'a> {
    scene: &'a Scene,
    plan: &'a EffectPlan,
    settings: &'a PathSettings,
    sampler: &'a Sampler<'a>,
    nm: Lanes,
    photons: Option<&'a PhotonMap>,
}

/// The last vertex that light could also have been found from by next-event estimation.
#[derive(Clone, Copy)]
struct Previous {
    point: DVec3,
    /// Shading normal, where the light sample was asked with one.
    normal: Option<DVec3>,
    /// Σ ρ before scattering.
    rho: f64,
    /// The hero's density of the direction taken, sr⁻¹, times that of the flight since.
    density: f64,
    /// Distance flown since (across boundaries of media).
    distance: f64,
}

/// The state of a path between two vertices.
struct Path {
    ray: Ray,
    beta: Lanes,
    rho: Lanes,
    /// Product of η² over crossings: β shrinks by it in glass and regains it, and roulette must not
    /// take that for a loss.
    eta2: f64,
    inside: Inside,
    /// `None` where only scattering could find light: at the camera and after mirrors.
    previous: Option<Previous>,
    radiance: Lanes,
    /// Scattering events so far.
    vertices: u32,
    /// Surfaces so far that it went straight through.
    crossings: u32,
    /// Whether it has met mirrors and glass only.
    specular: bool,
    /// Whether paths from the lights can be joined to it: by the camera at its first vertex, by merging behind mirrors
    /// and glass.
    seen: bool,
    /// Whether its first vertex was on something sharp.
    mirrored: bool,
    /// Whether the last vertex that it has come to is on something sharp.
    sharp: bool,
    /// Light of paths that are traced from the lights.
    left: Lanes,
    /// The lane whose wavelength is in all lanes, after the others took other ways.
    alone: Option<usize>,
    /// Whether it goes on for all that parted.
    chosen: bool,
}

/// Where a path leaves a surface.
struct Leaving<'a> {
    hit: &'a Hit,
    surface: &'a SurfacePoint,
    object: &'a Object,
    frame: &'a Frame,
    slopes: Option<&'a Slopes>,
    crossing: Option<&'a Crossing<'a>>,
    /// Toward where it came from.
    wo: DVec3,
    /// Shading normal, where lights were asked with one.
    sided: Option<DVec3>,
    /// For the roulette.
    u: f64,
}

impl Path {
    fn rho_sum<const CHROMATIC: bool>(&self) -> f64 {
        if CHROMATIC { f64::from(self.rho.reduce_add()) } else { LANES as f64 }
    }

    /// Adds light `l` found with weight `w` in the estimator Σ β l / Σ ρ; the film's mean over lanes
    /// divides by 8.
    fn add<const CHROMATIC: bool>(&mut self, l: Lanes, w: f64) {
        let share = if CHROMATIC { w * LANES as f64 / self.rho_sum::<true>() } else { w };
        self.radiance += self.beta * l * share as f32;
    }

    /// Notes light `l`, found with weight `w`, that paths from the lights add.
    #[cold]
    fn leave_out<const CHROMATIC: bool>(&mut self, l: Lanes, w: f64) {
        let share = if CHROMATIC { w * LANES as f64 / self.rho_sum::<true>() } else { w };
        self.left += self.beta * l * share as f32;
    }
}

impl Tracer<'_> {
    fn trace<const CHROMATIC: bool, const MEDIA: bool>(&self, ray: &Ray) -> Incoming {
        let scene = self.scene;
        let mut path = Path {
            ray: *ray,
            beta: Lanes::ONE,
            rho: Lanes::ONE,
            eta2: 1.0,
            inside: if MEDIA { scene.camera_inside } else { Inside::default() },
            previous: None,
            radiance: Lanes::ZERO,
            vertices: 0,
            crossings: 0,
            specular: true,
            seen: false,
            mirrored: false,
            sharp: false,
            left: Lanes::ZERO,
            alone: None,
            chosen: false,
        };
        // The camera does not see beyond its clipping plane; what it sees lies in everything's light.
        let (alpha, depth) = self.follow::<CHROMATIC, MEDIA>(&mut path, scene.camera.reach(ray));
        let events = path.vertices + path.crossings;
        Incoming { radiance: path.radiance, alpha, depth, left: path.left, events, mirrored: path.mirrored }
    }

    /// Follows a path to its end, first no farther than `reach`; coverage and depth of what it meets first.
    fn follow<const CHROMATIC: bool, const MEDIA: bool>(&self, path: &mut Path, mut reach: f64) -> (f32, f64) {
        let scene = self.scene;
        let mut alpha = 0.0;
        let mut depth = f64::INFINITY;
        let mut first = true;
        // Crossings of boundaries have numbers of their own, so that every vertex of the path keeps
        // the same ones whether or not boundaries lie on the way.
        let mut crossings = 0u32;
        let mut ahead = Ahead::UNKNOWN;

        loop {
            // The flight through a medium is drawn first: beyond its reach no surface matters.
            let flying = if MEDIA { path.inside.medium } else { None }.map(|medium| {
                let medium = &scene.media[medium as usize];
                let set = Set::Extra(path.vertices.wrapping_add(crossings << 16));
                let u = match crossings {
                    0 => self.sampler.set(Set::Choice(path.vertices))[3],
                    _ => self.sampler.set(set)[0],
                };
                let draft = medium.set_out(self.nm, u);
                reach = reach.min(draft.reach);
                (medium, set, draft)
            });
            let hit = match MEDIA && scene.has_boundaries {
                true => scene.next(&mut ahead, &path.ray, reach),
                false => scene.closest(&path.ray, reach),
            };
            reach = f64::INFINITY;
            let distance = hit.map_or(f64::INFINITY, |h| h.t);

            // The medium between here and the next surface may scatter the path first.
            if MEDIA && let Some((medium, set, draft)) = &flying {
                let (medium, set) = (*medium, *set);
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
                    if first {
                        // A medium counts as coverage: what is behind it is dimmed.
                        alpha = 1.0;
                        depth = scene.camera.depth(point);
                        first = false;
                    }
                    if !self.scatter_in_medium::<CHROMATIC, MEDIA>(path, point, medium) {
                        break;
                    }
                    crossings = 0;
                    continue;
                }
            }

            let Some(hit) = hit else {
                self.add_background::<CHROMATIC>(path);
                if self.settings.opaque_sky && !self.settings.hide_emitters && !scene.backgrounds.is_empty() {
                    alpha = 1.0;
                }
                break;
            };
            let surface = scene.surface(&path.ray, &hit);
            let object = &scene.objects[hit.object as usize];
            if self.settings.hide_emitters && path.vertices == 0 && object.light.is_some() {
                // A lamp that the camera would see itself is not there.
                crossings += 1;
                if crossings > MAX_BOUNDARIES {
                    break;
                }
                path.ray = scene.leave(&surface, &hit, path.ray.direction);
                ahead.go_on(hit.t);
                continue;
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
                    let u = self.sampler.set(Set::Extra(path.vertices.wrapping_add(crossings << 16)))[2];
                    self.resolve(compound, &surface, &hit, wo_world, u)
                }
                _ => None,
            };
            let open = compound.is_some() && leaf.is_none();
            let material = leaf.as_ref().map_or(material, |leaf| leaf.material);
            let boundary = open || hidden || matches!(material.kind, Kind::Boundary);
            let straight = if open || hidden {
                Some(Straight::OPEN)
            } else {
                material.straight(&surface, path.ray.direction, || hit.texture_point(&surface), self.nm)
            };
            if first && !boundary {
                alpha = 1.0;
                depth = scene.camera.depth(surface.point);
                first = false;
            }

            // Light that the surface itself sends out.
            if let Some(light) = object.light.filter(|_| self.meets_lights(path)) {
                let emitted = scene.lights[light as usize].emitted(&surface, &hit, wo_world, self.nm);
                let weight = match &path.previous {
                    None => 1.0,
                    Some(p) => {
                        let total = crate::scene::Hit { t: p.distance + hit.t, ..hit };
                        let q = scene.light_probability_at(light as usize, p.point, p.normal)
                            * scene.lights[light as usize].area_pdf(
                                &scene.objects,
                                p.point,
                                path.ray.direction,
                                &total,
                                surface.normal,
                            );
                        power_heuristic(p.density * path.rho_sum::<CHROMATIC>(), q * p.rho)
                    }
                };
                if self.leaves(path, light) {
                    path.leave_out::<CHROMATIC>(emitted, weight);
                } else {
                    path.add::<CHROMATIC>(emitted, weight);
                }
            }

            // What goes straight on has no vertex there: a lamp behind is also found from the vertex before.
            if let Some(straight) = &straight
                && (boundary
                    || self.sampler.set(Set::Extra(path.vertices.wrapping_add(crossings << 16)))[1] < straight.share)
            {
                if self.settings.count_crossings && self.is_last(path) {
                    break;
                }
                crossings += 1;
                path.crossings += 1;
                if crossings > MAX_BOUNDARIES {
                    break;
                }
                path.beta *= straight.weight;
                if let Some(p) = &mut path.previous {
                    p.density *= match compound {
                        None => straight.share,
                        Some(all) => {
                            let at = || hit.texture_point(&surface);
                            all.straight(&surface, path.ray.direction, at, self.nm).map_or(1.0, |s| s.share)
                        }
                    };
                }
                if MEDIA {
                    path.inside = scene.beyond(object, &surface, path.ray.direction, path.inside);
                }
                if let Some(p) = &mut path.previous {
                    p.distance += hit.t;
                }
                path.ray = scene.leave(&surface, &hit, path.ray.direction);
                ahead.go_on(hit.t);
                continue;
            }
            if self.is_last(path) {
                break;
            }

            // The local frame: z is the shading normal; two-sided materials turn it to the viewer.
            let (frame, flip) = match &leaf {
                Some(leaf) => (leaf.frame, leaf.flipped),
                None => {
                    let flip = material.two_sided && wo_world.dot(surface.normal) < 0.0;
                    let normal = seen_normal(&surface, wo_world);
                    (Frame::from_normal_and_tangent(if flip { -normal } else { normal }, surface.tangent), flip)
                }
            };
            let slopes = leaf.as_ref().map(|leaf| &leaf.slopes);
            let wo = frame.to_local(wo_world);
            let around = crossing.and_then(|crossing| crossing.around);
            let at = hit.texture_point(&surface);
            let bsdf = material.bsdf_beside(&at, self.nm, self.plan.all_dispersive, around);

            if let Some(caustics) = &self.plan.caustics {
                path.sharp = caustics.is_sharp(hit.object);
            }

            let choice = self.sampler.set(Set::Choice(path.vertices));
            let (u_light, u_direction) = pairs(self.sampler.set(Set::Scatter(path.vertices)));
            let sided = sided_normal(material, &frame);
            if !bsdf.is_discrete() && self.settings.light_samples > 0 {
                let scatterer =
                    Scatterer::Surface { bsdf: &bsdf, frame: &frame, surface: &surface, object, flip, slopes };
                self.add_light::<CHROMATIC, MEDIA>(
                    path,
                    &scatterer,
                    surface.point,
                    wo,
                    sided,
                    u_light,
                    choice[0],
                    |wi| scene.leave(&surface, &hit, wi),
                );
            }

            if let Some(map) = self.photons
                && path.specular
                && path.vertices > 0
                && !bsdf.is_discrete()
                && !path.sharp
            {
                let scatterer =
                    Scatterer::Surface { bsdf: &bsdf, frame: &frame, surface: &surface, object, flip, slopes };
                let light = path.beta * self.merge::<CHROMATIC>(map, path, &scatterer, &surface, wo);
                path.radiance += path.alone.map_or(light, |lane| Lanes::splat(light.to_array()[lane]));
            }

            // Of wavelengths that parted one goes on from where all have been seen.
            if !bsdf.is_discrete() && !path.goes_on() {
                break;
            }

            // The last ray of a path only looks for light: there is none to meet.
            if !scene.shines_on_rays && self.is_next_to_last(path) {
                break;
            }

            // On along a direction of the material's choice.
            // A pane that did not let the path straight through reflects it.
            let u_lobe = if straight.is_some() { 0.0 } else { choice[1] };
            let leaving = Leaving {
                hit: &hit,
                surface: &surface,
                object,
                frame: &frame,
                slopes,
                crossing: crossing.as_ref(),
                wo: wo_world,
                sided,
                u: choice[2],
            };
            if CHROMATIC
                && self.plan.packets
                && path.specular
                && let Bsdf::Dielectric(glass) = &bsdf
                && glass.parts()
            {
                match self.part::<MEDIA>(path, glass, wo, u_lobe, &leaving) {
                    true => {
                        crossings = 0;
                        continue;
                    }
                    false => break,
                }
            }
            let Some(sample) = bsdf.sample(wo, u_lobe, u_direction) else { break };
            if !self.leave::<CHROMATIC, MEDIA>(path, &sample, &leaving) {
                break;
            }
            crossings = 0;
        }
        (alpha, depth)
    }

    /// Sends the path on from a surface; false where it ends.
    #[inline(always)]
    fn leave<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        sample: &BsdfSample,
        at: &Leaving,
    ) -> bool {
        let Leaving { hit, surface, object, .. } = *at;
        let wi = at.frame.to_world(sample.wi);
        let side = wi.dot(surface.normal) * at.wo.dot(surface.normal);
        if (side > 0.0) == sample.transmitted || side == 0.0 {
            return false;
        }
        path.previous = match sample.chosen {
            Chosen::Density(density) if self.settings.light_samples > 0 => Some(Previous {
                point: surface.point,
                normal: at.sided,
                rho: path.rho_sum::<CHROMATIC>(),
                density,
                distance: 0.0,
            }),
            Chosen::Density(_) | Chosen::Discrete => None,
        };
        path.mirrored |= path.sharp && path.vertices == 0;
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
        if MEDIA && sample.transmitted {
            path.inside = self.scene.beyond(object, surface, wi, path.inside);
        } else if let Some(crossing) = at.crossing {
            path.inside.bodies = crossing.here;
        }
        path.ray = self.scene.leave(surface, hit, wi);
        path.vertices += 1;
        self.survives::<CHROMATIC>(path, at.u)
    }

    /// Light of the photons around a vertex behind mirrors and glass. A lane could lead both parts of the joined path
    /// with the product of its densities.
    #[inline(never)]
    fn merge<const CHROMATIC: bool>(
        &self,
        map: &PhotonMap,
        path: &Path,
        scatterer: &Scatterer,
        surface: &SurfacePoint,
        wo: DVec3,
    ) -> Lanes {
        map.gather(surface.point, surface.normal, |photon| {
            // The camera's segments and the light's.
            if self.settings.max_depth.is_some_and(|most| path.vertices + photon.vertices + 2 > most) {
                return Lanes::ZERO;
            }
            let cosine = photon.came.dot(surface.normal).abs();
            let f = scatterer.eval(wo, photon.came).0;
            let led = f64::from(if CHROMATIC { path.rho * photon.rho } else { photon.rho }.reduce_add());
            let share = LANES as f64 / (led * cosine);
            if share.is_finite() { f * share as f32 } else { Lanes::ZERO }
        })
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
    ) -> bool {
        if self.is_last(path) {
            return false;
        }
        path.sharp = false;
        let choice = self.sampler.set(Set::Choice(path.vertices));
        let wo = -path.ray.direction;
        let (u_light, u_direction) = pairs(self.sampler.set(Set::Scatter(path.vertices)));
        let next_event = self.settings.light_samples > 0 && medium.shadow_rays;
        if next_event {
            self.add_light::<CHROMATIC, MEDIA>(
                path,
                &Scatterer::Medium { medium, point },
                point,
                wo,
                None,
                u_light,
                choice[0],
                |wi| Ray::new(point, wi),
            );
        }
        if !path.goes_on() {
            return false;
        }
        let wi = medium.phase.sample(point, wo, u_direction);
        path.previous = next_event.then(|| Previous {
            point,
            normal: None,
            rho: path.rho_sum::<CHROMATIC>(),
            density: medium.phase.eval(point, wo, wi),
            distance: 0.0,
        });
        path.ray = Ray::new(point, wi);
        path.seen |= path.vertices == 0;
        path.specular = false;
        path.vertices += 1;
        self.survives::<CHROMATIC>(path, choice[2])
    }

    /// Russian roulette on the largest lane; false where the path ends.
    fn survives<const CHROMATIC: bool>(&self, path: &mut Path, u: f64) -> bool {
        if path.beta.simd_gt(Lanes::ZERO).none() {
            return false;
        }
        if path.vertices + 1 < self.settings.roulette_depth {
            return true;
        }
        let beta = path.beta.to_array().into_iter().fold(0.0f32, f32::max);
        let carried = f64::from(beta) * LANES as f64 / path.rho_sum::<CHROMATIC>() * path.eta2;
        let q = carried.min(if path.vertices < FOR_SURE { 1.0 } else { SURVIVAL });
        if u >= q {
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
    let normal = surface.shading_normal;
    if normal.dot(wo) * surface.normal.dot(wo) <= 0.0 { surface.normal } else { normal }
}
