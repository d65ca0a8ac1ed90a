//! Lamps that glass and the coats of plastics mirror, in one direction of several that a path may go on in.
//!
//! A path that is mirrored by chance, with the probability F of a few hundredths, and meets a lamp brings all of its radiance L: a
//! variance of F L² a path. Where the mirrored direction leads to a lamp, or into a sun, F L is added at every vertex instead, and
//! what goes on in that direction leaves the lamp out. Inside a shape of glass the mirrored direction is followed on out of it. What
//! leads there is told without chance, so that the mean is the same.

use super::{Leaving, Path, Tracer, seen_normal};
use crate::math::sampler::Set;
use crate::math::{Frame, Ray};
use crate::optics::bsdf::{Bsdf, Lobes, mirror};
use crate::optics::dielectric::{Dielectric, refract};
use crate::scene::material::Kind;
use crate::scene::shape::Detail;
use crate::scene::{Geometry, Inside};
use crate::spectrum::{LANES, Lanes};
use crate::transport::shadow::{MAX_BOUNDARIES, straight};
use glam::DVec3;

/// Sets the numbers of shadow rays along the stretches of such a way apart from those of vertices.
const MIRRORED: u32 = 1 << 26;

/// A lamp that has been counted at a vertex which mirrors it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Counted {
    /// The light.
    pub(super) light: u32,
    /// Surfaces of glass before it.
    pub(super) behind: u32,
}

impl Counted {
    /// The same as told from beyond one of the surfaces before it.
    pub(super) fn further(self) -> Option<Counted> {
        Some(Counted { behind: self.behind.checked_sub(1)?, ..self })
    }
}

/// A way from a vertex in its mirrored direction.
struct Way {
    ray: Ray,
    inside: Inside,
    /// What comes along it of each lane.
    weight: Lanes,
    /// Density of each lane over the hero's.
    ratio: Lanes,
    /// Segments so far, less one, as a path counts them.
    events: u32,
    /// Whether the last surface is sharp, and whether it throws light in part and scatters the rest.
    sharp: bool,
    in_part: bool,
    /// Surfaces of glass that it has come through, and stretches between surfaces.
    through: u32,
    stretches: u32,
}

impl Tracer<'_> {
    /// Adds the light of the lamp that a vertex mirrors, and tells which; `None` where there is none, or where chance does not decide
    /// whether it is mirrored.
    #[inline(always)]
    pub(super) fn look_at_mirrored<const CHROMATIC: bool, const MEDIA: bool, B: Lobes>(
        &self,
        path: &mut Path,
        bsdf: &B,
        wo: DVec3,
        at: &Leaving,
    ) -> Option<Counted> {
        if !bsdf.may_mirror() || at.pane || self.scene.lamps.are_none() || !self.looks_and_meets() {
            return None;
        }
        let wi = at.frame.to_world(mirror(wo));
        let ray = self.scene.leave(at.surface, at.hit, wi);
        let most = match bsdf.glass() {
            Some(glass) if wo.z < 0.0 => {
                // Wavelengths that go on side by side come to another place each.
                if self.parts_at::<CHROMATIC>(path, glass) || !self.leads_out_to_a_lamp(&ray, glass, at) {
                    return None;
                }
                1
            }
            _ if !self.leads_to_a_lamp(&ray) => return None,
            _ => 0,
        };
        // Any wavelength might lead along this way. Were the lamp counted here where one leads that is reflected by chance, and met where
        // one leads that always is, the two would not add up to all of it: it is left to chance, whichever leads.
        if bsdf.glass().is_some_and(|glass| glass.reflects_all_of_some(wo)) {
            return None;
        }
        self.add_mirrored::<CHROMATIC, MEDIA>(path, &ray, bsdf.mirrored(wo)?, most, at)
    }

    /// Whether `ray`, within a shape of `glass`, may lead to a lamp from where it comes out of it, were there nothing else; at any
    /// wavelength.
    #[inline(never)]
    fn leads_out_to_a_lamp(&self, ray: &Ray, glass: &Dielectric, at: &Leaving) -> bool {
        let Geometry::Shape(shape) = &at.object.geometry else { return false };
        if at.hit.instance.is_some() {
            return false;
        }
        let Some(hit) = shape.intersect(ray, f64::INFINITY, Some(at.hit.part as u8)) else { return false };
        let point = ray.at(hit.t);
        let (wo, n) = (-ray.direction, shape.surface_with(point, hit.face, Detail::Geometry).normal);
        let cos = wo.dot(n).abs();
        let leads = |eta: f64| {
            let cos2 = 1.0 - (1.0 - cos * cos) * (eta * eta);
            let went = refract(wo, n * wo.dot(n).signum(), eta.recip(), cos2.max(0.0).sqrt());
            cos2 > 0.0 && self.leads_to_a_lamp(&Ray::new(point, went))
        };
        // A lamp within the shape is before it whichever wavelength leads: it is looked for by all or none.
        if glass.parts() { glass.eta.each().into_iter().any(leads) } else { leads(glass.eta.hero()) }
    }

    /// Whether `ray` may meet a lamp, or goes into a sun.
    #[inline(always)]
    fn leads_to_a_lamp(&self, ray: &Ray) -> bool {
        let scene = self.scene;
        scene.lamps.may_be_met(ray) || self.sun(ray.direction).is_some()
    }

    /// The light from infinity that stands out in a direction.
    #[inline(always)]
    fn sun(&self, direction: DVec3) -> Option<u32> {
        self.scene.backgrounds.iter().copied().find(|&i| self.scene.lights[i as usize].stands_out(direction))
    }

    /// Adds the light of the first lamp along `ray`, in the mirrored direction of a vertex, which has the `weight`, behind no more than
    /// `most` surfaces of glass.
    #[inline(never)]
    fn add_mirrored<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        ray: &Ray,
        mut weight: Lanes,
        most: u32,
        at: &Leaving,
    ) -> Option<Counted> {
        // As a path that goes on there: neither side is the other's.
        let geometric = ray.direction.dot(at.surface.normal) * if at.flip { -1.0 } else { 1.0 };
        if geometric * ray.direction.dot(at.frame.n) <= 0.0 {
            return None;
        }
        if let Some(slopes) = at.slopes {
            weight *= slopes.shadowing(ray.direction) as f32;
        }
        let bodies = at.crossing.map_or(path.inside.bodies, |crossing| crossing.here);
        let mut way = Way {
            ray: *ray,
            inside: Inside { bodies, ..path.inside },
            weight,
            ratio: Lanes::ONE,
            events: self.events(path) + 1,
            sharp: path.sharp,
            in_part: self.plan.caustics.as_ref().is_some_and(|caustics| caustics.throws_in_part(at.hit.object)),
            through: 0,
            stretches: 0,
        };
        loop {
            path.further += 1;
            if let Some((light, emitted)) = self.go_on::<CHROMATIC, MEDIA>(&mut way, path, most)? {
                self.enter_mirrored::<CHROMATIC>(path, &way, light, emitted);
                return Some(Counted { light, behind: way.through });
            }
        }
    }

    /// To the next thing on a way of `path`: the light that it sends, or beyond it if it is a surface of glass, of which the way has come
    /// through less than `most`. `None` where neither is there.
    fn go_on<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        way: &mut Way,
        path: &Path,
        most: u32,
    ) -> Option<Option<(u32, Lanes)>> {
        let scene = self.scene;
        let may_pass = |events: u32| self.settings.max_depth.is_none_or(|depth| events + 1 < depth);
        for _ in 0..=MAX_BOUNDARIES {
            let hit = scene.closest(&way.ray, f64::INFINITY);
            if MEDIA && let Some(medium) = way.inside.medium {
                let distance = hit.map_or(f64::INFINITY, |hit| hit.t);
                let set = Set::Extra(path.vertices.wrapping_add(MIRRORED).wrapping_add(way.stretches << 16));
                let dimmed = scene.media[medium as usize].dim(&way.ray, distance, self.nm, || self.sampler.walk(set));
                way.weight *= dimmed.through;
            }
            way.stretches += 1;
            let Some(hit) = hit else {
                let sun = self.sun(way.ray.direction)?;
                return Some(Some((sun, scene.lights[sun as usize].background(way.ray.direction, self.nm))));
            };
            let (object, surface) = (&scene.objects[hit.object as usize], scene.surface(&way.ray, &hit));
            let went = way.ray.direction;
            if let Some(light) = object.light {
                let emitted = scene.lights[light as usize].emitted(&surface, &hit, -went, self.nm);
                return Some(Some((light, emitted)));
            }
            let material = &scene.materials[object.material as usize];
            let crossing = if MEDIA { scene.crossing(object, &surface, went, &way.inside.bodies) } else { None };
            if let Some(straight) = straight(scene, &hit, &surface, went, crossing.as_ref(), self.nm) {
                if self.settings.count_crossings {
                    if !may_pass(way.events) {
                        return None;
                    }
                    way.events += 1;
                }
                way.weight *= straight.weight * straight.share as f32;
                if MEDIA {
                    way.inside = scene.beyond(object, &surface, went, way.inside);
                }
                way.ray = scene.leave(&surface, &hit, went);
                continue;
            }
            if way.through == most || !may_pass(way.events) || !matches!(material.kind, Kind::Dielectric { .. }) {
                return None;
            }
            let around = crossing.and_then(|crossing| crossing.around);
            let at = hit.texture_point(&surface);
            let Bsdf::Dielectric(glass) = material.bsdf_beside(&at, self.nm, self.plan.all_dispersive, around) else {
                return None;
            };
            let frame = Frame::from_normal_and_tangent(seen_normal(&surface, -went), surface.tangent);
            let wo = frame.to_local(-went);
            // Here, too, wavelengths that go on side by side come to another place each, and of those that turn back any might lead.
            if self.parts_at::<CHROMATIC>(path, &glass) || glass.reflects_all_of_some(wo) {
                return None;
            }
            let (sample, chance) = glass.go_through(wo)?;
            let wi = frame.to_world(sample.wi);
            if wi.dot(surface.normal) * sample.wi.z <= 0.0 {
                return None;
            }
            way.weight *= sample.weight * chance as f32;
            way.ratio *= sample.ratio;
            way.sharp = self.plan.caustics.as_ref().is_some_and(|caustics| caustics.is_sharp(hit.object));
            way.in_part = false;
            way.events += 1;
            way.through += 1;
            if MEDIA && sample.transmitted {
                way.inside = scene.beyond(object, &surface, wi, way.inside);
            } else if let Some(crossing) = crossing {
                way.inside.bodies = crossing.here;
            }
            way.ray = scene.leave(&surface, &hit, wi);
            let goes_on = way.through < most || self.leads_to_a_lamp(&way.ray);
            return goes_on.then_some(None);
        }
        None
    }

    /// Adds what comes along a way of the light that a lamp sends.
    fn enter_mirrored<const CHROMATIC: bool>(&self, path: &mut Path, way: &Way, light: u32, emitted: Lanes) {
        let led = if CHROMATIC { f64::from((path.rho * way.ratio).reduce_add()) } else { LANES as f64 };
        let share = path.beta * way.weight * emitted * (LANES as f64 / led) as f32;
        if self.leaves_from(path, way.sharp, way.in_part, way.ray.direction, light) {
            path.left += share;
            return;
        }
        if !self.seeks(path, true) {
            return;
        }
        path.radiance += share;
        if let Some(ledger) = self.ledger {
            ledger.mirrored(path.vertices, way.through + 1, self.found(path, share, light));
        }
    }
}
