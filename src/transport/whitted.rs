//! The deterministic recursive tracer of Whitted 1980, "An Improved Illumination Model for Shaded
//! Display": an ambient term, for each light a hard shadow and a highlight, mirrors and glass by
//! recursion. No random numbers; spectral like the rest.
//!
//! Flat lamps and balls shine from their middle, other lamps with area from 60 points, each with a shadow of
//! its own; light from infinity is seen, and reaches surfaces through the ambient term only. Glass reflects and
//! refracts by Fresnel's shares; where its index depends on the wavelength, each wavelength goes on alone after the first
//! refraction. Media that are the same everywhere and only absorb dim what crosses them (Beer and Lambert); others are
//! left out.

use super::Incoming;
use super::path::seen_normal;
use super::plan::{EffectPlan, WhittedSettings};
use super::shadow::MAX_BOUNDARIES;
use crate::math::{Departure, Frame, Ray};
use crate::optics::bsdf::Pane;
use crate::optics::dielectric::{RelativeIndex, Tint, refract};
use crate::optics::fresnel::{self, Model};
use crate::scene::compound::{Composition, Slopes, Standing, Vertex, share};
use crate::scene::environment::Drawn;
use crate::scene::light::{Arriving, Light, free};
use crate::scene::material::{Highlight, HighlightModel, Kind, Material, Tints, metal, relative_index};
use crate::scene::shape::Shape;
use crate::scene::shape::sphere::{Middle, Sphere};
use crate::scene::texture::Texture;
use crate::scene::{Geometry, Inside, Object, Scene};
use crate::spectrum::{LANES, Lanes, RefractiveIndex, SampledWavelengths, Spectrum};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Least share of a ray's light that is followed. Glass doubles the rays at each level, so the
/// recursion must end by light as well as by depth; what is lost is at most this share of the
/// brightest radiance in the scene for each branch that is cut.
const FAINTEST: f32 = 1.0 / 65_536.0;

/// How many points stand for a lamp that is neither flat nor a ball: as many for each of the 1, 2, 3 or, from inside, 6 faces of a
/// cube that are seen.
const POINTS: u32 = 60;

/// Light that arrives along a camera ray.
#[must_use]
pub fn radiance(
    scene: &Scene,
    plan: &EffectPlan,
    settings: &WhittedSettings,
    wavelengths: &SampledWavelengths,
    ray: &Ray,
) -> Incoming {
    let tracer = Tracer { scene, plan, settings, nm: wavelengths.nm };
    let seen = tracer.trace(ray, scene.camera_inside, Lanes::ONE, 0, scene.camera.reach(ray));
    Incoming {
        radiance: seen.light,
        alpha: 1.0 - seen.open * (seen.kept.reduce_add() / LANES as f32),
        depth: seen.first.map_or(f64::INFINITY, |point| scene.camera.depth(point)),
        ..Incoming::NONE
    }
}

struct Tracer<'a> {
    scene: &'a Scene,
    plan: &'a EffectPlan,
    settings: &'a WhittedSettings,
    nm: Lanes,
}

/// What a ray brings.
struct Arrived {
    light: Lanes,
    /// Share that no surface covers.
    open: f32,
    /// What media on the way leave of what is behind.
    kept: Lanes,
    /// The first point that covers some of it.
    first: Option<DVec3>,
}

/// What a surface does with the light of one direction.
struct Sent {
    /// Sent to the viewer.
    light: Lanes,
    /// Share of what is behind that comes straight through.
    straight: f64,
}

impl Sent {
    const NOTHING: Sent = Sent { light: Lanes::ZERO, straight: 0.0 };
}

/// What is on the two sides of a surface.
#[derive(Clone, Copy)]
struct Standpoint<'a> {
    /// Where the viewer is.
    here: Inside,
    /// Behind.
    beyond: Inside,
    /// The index on the outside, where it is not that of the material.
    around: Option<&'a RefractiveIndex>,
}

/// A vertex and what is around it.
#[derive(Clone, Copy)]
struct Meeting<'a> {
    x: &'a Vertex<'a>,
    standpoint: Standpoint<'a>,
}

/// A material as one vertex shows it.
#[derive(Clone, Copy)]
struct Seen<'a> {
    x: &'a Vertex<'a>,
    standpoint: &'a Standpoint<'a>,
    material: &'a Material,
    /// Shading normal, on the side that is seen of a material with two.
    normal: DVec3,
    slopes: Slopes,
}

impl Tracer<'_> {
    /// What arrives along `ray` from no farther than `reach`, for the lanes in which `weight`, the share that reaches the eye,
    /// is not zero.
    fn trace(&self, ray: &Ray, mut inside: Inside, weight: Lanes, depth: u32, mut reach: f64) -> Arrived {
        let scene = self.scene;
        let mut ray = *ray;
        let mut arrived = Arrived { light: Lanes::ZERO, open: 1.0, kept: Lanes::ONE, first: None };
        // What goes straight on does so here, and only mirrors and glass by recursion.
        for _ in 0..=MAX_BOUNDARIES {
            let hit = scene.closest(&ray, reach);
            arrived.kept *= self.clear(&inside, hit.map_or(f64::INFINITY, |hit| hit.t));
            let Some(hit) = hit else {
                let all = &scene.backgrounds;
                let sky = all.iter().map(|&i| scene.lights[i as usize].background(ray.direction, self.nm));
                arrived.light += sky.fold(Lanes::ZERO, |a, b| a + b) * arrived.kept * arrived.open;
                return arrived;
            };
            reach -= hit.t;
            let surface = scene.surface(&ray, &hit);
            let object = &scene.objects[hit.object as usize];
            let material = &scene.materials[object.material as usize];
            let wo = -ray.direction;
            let crossing = scene.crossing(object, &surface, ray.direction, &inside.bodies);
            let hidden = crossing.is_some_and(|crossing| !crossing.shows);
            let beyond = scene.beyond(object, &surface, ray.direction, inside);
            // A lamp shines whatever its surface bounds.
            let emitted = object.light.map(|l| scene.lights[l as usize].emitted(&surface, &hit, wo, self.nm));
            arrived.light += emitted.unwrap_or(Lanes::ZERO) * arrived.kept * arrived.open;
            if !hidden {
                let standpoint = Standpoint {
                    here: crossing.map_or(inside, |crossing| Inside { bodies: crossing.here, ..inside }),
                    beyond,
                    around: crossing.and_then(|crossing| crossing.around),
                };
                let vertex = Vertex { scene, hit: &hit, surface: &surface, at: &hit.texture_point(&surface), wo };
                let standing = Standing::new(seen_normal(&surface, wo), surface.tangent);
                let at = Meeting { x: &vertex, standpoint };
                let sent = self.scattered(&at, material, standing, weight * arrived.kept * arrived.open, depth);
                arrived.light += sent.light * arrived.kept * arrived.open;
                let straight = sent.straight as f32;
                if straight < 1.0 {
                    arrived.first.get_or_insert(surface.point);
                }
                arrived.open *= straight;
                if !visible(weight * arrived.open) {
                    return arrived;
                }
            }
            inside = beyond;
            ray = scene.leave(&surface, &hit, ray.direction);
        }
        arrived
    }

    /// What a material does: one made of others does the sum of what they do.
    fn scattered(&self, at: &Meeting, material: &Material, mut standing: Standing, weight: Lanes, depth: u32) -> Sent {
        let Meeting { x, .. } = at;
        let part = |share: f64, inner: &Material| {
            let onward = weight * share as f32;
            if !visible(onward) {
                return Sent::NOTHING;
            }
            let Sent { light, straight } = self.scattered(at, inner, standing, onward, depth);
            Sent { light: light * share as f32, straight: straight * share }
        };
        let outside = x.wo.dot(x.surface.normal) > 0.0;
        if let Some(compound) = material.compound() {
            return match &compound.composition {
                Composition::Mask { opacity, inner } => {
                    let opacity = share(opacity, x.at);
                    let Sent { light, straight } = part(opacity, inner);
                    Sent { light, straight: straight + (1.0 - opacity) }
                }
                Composition::Blend { weight: second_share, first, second } => {
                    let share = share(second_share, x.at);
                    let (first, second) = (part(1.0 - share, first), part(share, second));
                    Sent { light: first.light + second.light, straight: first.straight + second.straight }
                }
                Composition::TwoSided { front, .. } if outside => self.scattered(at, front, standing, weight, depth),
                Composition::TwoSided { back, .. } => {
                    standing.mirror();
                    self.scattered(at, back, standing, weight, depth)
                }
                Composition::Relief { relief, inner } => {
                    standing.turn(relief, x);
                    self.scattered(at, inner, standing, weight, depth)
                }
            };
        }
        if matches!(material.kind, Kind::Boundary) {
            return Sent { light: Lanes::ZERO, straight: 1.0 };
        }
        // A thin sheet is the same from both sides.
        if !outside && (material.two_sided || matches!(material.kind, Kind::PrincipledThin(_))) {
            standing.mirror();
        }
        if !outside && !standing.is_mirrored() && !material.transmits() {
            return Sent::NOTHING;
        }
        let seen =
            Seen { x, standpoint: &at.standpoint, material, normal: standing.frame().n, slopes: standing.slopes() };
        let mut light = self.shade(&seen);
        if depth < self.settings.max_depth {
            light += self.specular(&seen, weight, depth);
        }
        Sent { light, straight: 0.0 }
    }

    /// Ambient light, and from each light the diffuse part and the highlight.
    fn shade(&self, seen: &Seen) -> Lanes {
        let Seen { x: &Vertex { surface, hit, at, wo, .. }, standpoint, material, normal, slopes } = *seen;
        let leave = |direction: DVec3| self.scene.leave(surface, hit, direction);
        let mut translucent = Lanes::ZERO;
        let matte = match &material.kind {
            Kind::Diffuse { reflectance } => reflectance.eval(at, self.nm),
            Kind::Plastic { reflectance, coat, nonlinear, .. } => {
                // The base under its coat, for light along the normal both ways.
                let base = coat.base(reflectance.eval(at, self.nm), *nonlinear, Lanes::ONE, self.nm);
                let t = base.eta.lanes(|eta| fresnel::dielectric(Model::Exact, 1.0, eta).transmitted);
                base.albedo() * t * t
            }
            Kind::Principled(solid) => solid.at(at, self.nm).smooth(1.0, true).matte,
            Kind::PrincipledThin(sheet) => {
                let parts = sheet.at(at, self.nm).smooth(1.0);
                translucent = parts.translucent;
                parts.matte
            }
            // Hair is shown matte, in the colour of light that crosses its middle.
            Kind::Hair { absorption, .. } => {
                (absorption.iter().fold(Lanes::ZERO, |sum, s| sum + s.eval(self.nm)) * -2.0).exp()
            }
            Kind::Mirror { .. }
            | Kind::Conductor { .. }
            | Kind::Dielectric { .. }
            | Kind::Thin { .. }
            | Kind::Boundary
            | Kind::Compound(_) => Lanes::ZERO,
        };
        let (diffuse, sheer) = (matte.simd_gt(Lanes::ZERO).any(), translucent.simd_gt(Lanes::ZERO).any());
        let mut light = (matte + translucent) * self.settings.ambient.eval(self.nm);
        if !diffuse && !sheer && material.highlight.is_none() {
            return light;
        }
        for source in &self.scene.lights {
            let count = self.points(source);
            let share = (1.0 / f64::from(count)) as f32;
            for k in 0..count {
                let u = (DVec2::new(f64::from(k), f64::from(row(k))) + 0.5) / f64::from(count);
                let Some(arriving) = self.toward(source, surface.point, u) else { continue };
                let Arriving { wi, distance, radiance: irradiance, target, .. } = arriving;
                let cos = wi.dot(normal);
                let reflects = cos > 0.0;
                // Light of which a leaning shading normal says another side than the true one is lost, as in `path`.
                let (albedo, inside) = match wi.dot(surface.normal) * wo.dot(surface.normal) > 0.0 {
                    true if reflects => (matte, standpoint.here),
                    false if !reflects && sheer => (translucent, standpoint.beyond),
                    _ => continue,
                };
                let ray = leave(wi);
                let distance = free(distance, target, surface.point, &ray);
                let through = self.unshadowed(&ray, inside, distance, target);
                if !through.simd_gt(Lanes::ZERO).any() {
                    continue;
                }
                let mut sent = albedo * (cos.abs() * slopes.shadowing(wi) / PI) as f32;
                if let Some(h) = material.highlight.as_ref().filter(|_| reflects) {
                    sent += Lanes::splat(highlight(h, normal, wo, wi) as f32);
                }
                light += sent * irradiance * through * share;
            }
        }
        light
    }

    /// How many points stand for a lamp: one where that is its middle, or all of it that a point may see.
    fn points(&self, light: &Light) -> u32 {
        let (Light::Area { object, .. } | Light::AlongNormal { object, .. }) = light else { return 1 };
        let lamp = &self.scene.objects[*object as usize];
        match &lamp.geometry {
            Geometry::Shape(Shape::Rectangle(_) | Shape::Disk(_)) => 1,
            // From outside a convex shape one of its normals comes at the most.
            Geometry::Shape(_) if !lamp.flipped && matches!(light, Light::AlongNormal { .. }) => 1,
            _ if self.ball(light).is_some() => 1,
            _ => POINTS,
        }
    }

    /// The object and form of a ball that shines evenly outward, and its radiance.
    fn ball<'a>(&'a self, light: &'a Light) -> Option<(u32, &'a Sphere, &'a Spectrum)> {
        let Light::Area { object, radiance: Texture::Uniform(radiance) } = light else { return None };
        match &self.scene.objects[*object as usize] {
            Object { geometry: Geometry::Shape(Shape::Sphere(sphere)), flipped: false, .. } => {
                Some((*object, sphere, radiance))
            }
            _ => None,
        }
    }

    /// The irradiance that all of a light would give if it were where `u` says, across the way there.
    fn toward(&self, light: &Light, from: DVec3, u: DVec2) -> Option<Arriving> {
        if let Light::Environment(map) = light
            && let Some((wi, radiance)) = map.sun(self.nm)
        {
            return Some(Arriving { wi, distance: f64::INFINITY, radiance, density: None, target: None });
        }
        if light.is_environment() {
            return None;
        }
        // The middle of a sphere, which is the point nearest to the receiver, needs no sampling.
        if let Some((object, sphere, radiance)) = self.ball(light) {
            let Middle { direction, distance, projected } = sphere.toward_middle(from)?;
            let radiance = radiance.eval(self.nm) * projected as f32;
            return Some(Arriving {
                wi: direction,
                distance,
                radiance,
                density: None,
                target: Some(Departure::new(object, 0)),
            });
        }
        let a = light.arriving(&self.scene.objects, from, None, u, Drawn::All, self.nm)?;
        Some(match a.density {
            None => a,
            Some(density) => Arriving { radiance: a.radiance * (1.0 / density) as f32, density: None, ..a },
        })
    }

    /// What light keeps over `distance` through the medium that it is in.
    fn clear(&self, inside: &Inside, distance: f64) -> Lanes {
        let medium = inside.medium.filter(|_| self.plan.media).map(|medium| &self.scene.media[medium as usize]);
        medium.and_then(|medium| medium.clear(distance, self.nm)).unwrap_or(Lanes::ONE)
    }

    /// What media leave where nothing stands between; dimmed by transparent surfaces, too, where the scene asks for it.
    fn unshadowed(&self, ray: &Ray, mut inside: Inside, distance: f64, target: Option<Departure>) -> Lanes {
        let scene = self.scene;
        if !self.settings.transparent_shadows && !scene.has_boundaries {
            return if scene.occluded(ray, distance, target) { Lanes::ZERO } else { self.clear(&inside, distance) };
        }
        let (mut ray, mut left, mut through) = (*ray, distance, Lanes::ONE);
        for _ in 0..=MAX_BOUNDARIES {
            let hit = scene.closest(&ray, left).filter(|h| !scene.reaches(&ray, h, target));
            through *= self.clear(&inside, hit.map_or(left, |hit| hit.t));
            let Some(hit) = hit else { return through };
            let surface = scene.surface(&ray, &hit);
            let object = &scene.objects[hit.object as usize];
            let material = &scene.materials[object.material as usize];
            let crossing = scene.crossing(object, &surface, ray.direction, &inside.bodies);
            inside = scene.beyond(object, &surface, ray.direction, inside);
            if crossing.is_none_or(|crossing| crossing.shows) {
                let around = crossing.and_then(|crossing| crossing.around);
                let wo = -ray.direction;
                let x = Vertex { scene, hit: &hit, surface: &surface, at: &hit.texture_point(&surface), wo };
                through *= self.passing(material, &x, around);
                if !through.simd_gt(Lanes::ZERO).any() {
                    return Lanes::ZERO;
                }
            }
            ray = scene.leave(&surface, &hit, ray.direction);
            left -= hit.t;
        }
        Lanes::ZERO
    }

    /// What goes straight on through a material toward a light, `around` being the index outside where it is not the material's:
    /// of one that is made of others the sum of what they let through. Glass and panes do where the scene asks for it.
    fn passing(&self, material: &Material, x: &Vertex, around: Option<&RefractiveIndex>) -> Lanes {
        let &Vertex { surface, at, wo, .. } = x;
        let part = |share: f64, inner: &Material| match share {
            0.0 => Lanes::ZERO,
            _ => self.passing(inner, x, around) * share as f32,
        };
        let cos = wo.dot(surface.normal);
        match &material.kind {
            Kind::Boundary => Lanes::ONE,
            Kind::Compound(compound) => match &compound.composition {
                Composition::Mask { opacity, inner } => {
                    let opacity = share(opacity, at);
                    part(opacity, inner) + Lanes::splat((1.0 - opacity) as f32)
                }
                Composition::Blend { weight, first, second } => {
                    let weight = share(weight, at);
                    part(1.0 - weight, first) + part(weight, second)
                }
                Composition::TwoSided { front, back } => part(1.0, if cos < 0.0 { back } else { front }),
                Composition::Relief { inner, .. } => part(1.0, inner),
            },
            Kind::Dielectric { interior, exterior, fresnel: model, tints, film, .. }
                if self.settings.transparent_shadows =>
            {
                let exterior = around.unwrap_or(exterior);
                let index = relative_index(interior, exterior, self.nm, self.plan.all_dispersive);
                // What goes straight on keeps the angle that it has outside, which tells what either face lets through: within
                // a plate light is bent, and its way out is its way in turned round.
                let transmitted = match film {
                    None => index.lanes(|eta| fresnel::dielectric(*model, cos.abs(), eta).transmitted),
                    Some(film) => {
                        let reflected = film.at(at, self.nm, exterior).over_dielectric(cos.abs(), index.each(), true);
                        Lanes::new(reflected.map(|r| (1.0 - r) as f32))
                    }
                };
                transmitted * Tints::at(tints.as_deref(), at, self.nm).transmitted
            }
            Kind::Thin { .. } if self.settings.transparent_shadows => {
                let straight = material.straight(surface, -wo, || *at, self.nm);
                straight.map_or(Lanes::ZERO, |straight| straight.weight * straight.share as f32)
            }
            _ => Lanes::ZERO,
        }
    }

    /// Light from mirrors and through glass.
    fn specular(&self, seen: &Seen, weight: Lanes, depth: u32) -> Lanes {
        let Seen { x: &Vertex { at, wo, .. }, standpoint, material, normal, .. } = *seen;
        let frame = Frame::from_normal(normal);
        let local = frame.to_local(wo);
        let cos = local.z.abs();
        let bounce = Bounce { tracer: self, seen, frame, local, weight, depth };
        match &material.kind {
            Kind::Diffuse { .. } | Kind::Hair { .. } | Kind::Boundary | Kind::Compound(_) => Lanes::ZERO,
            Kind::Mirror { reflectance } => bounce.reflect(reflectance.eval(self.nm)),
            // Rough metal and rough glass are shown smooth: a single ray knows one direction.
            Kind::Conductor { eta, k, tint, fresnel, film, .. } => {
                bounce.reflect(metal(eta, k, tint, *fresnel, film.as_deref(), at, self.nm).reflectance(cos))
            }
            Kind::Plastic { coat, tint, .. } => {
                let r = coat.eta(self.nm).lanes(|eta| fresnel::dielectric(Model::Exact, cos, eta).reflected);
                let tint = tint.as_ref().map_or(Lanes::ONE, |tint| tint.eval(at, self.nm));
                bounce.reflect(tint * r)
            }
            Kind::Principled(solid) => {
                let front = local.z > 0.0;
                let parts = solid.at(at, self.nm).smooth(cos, front);
                if !material.transmits() {
                    return bounce.reflect(parts.reflected);
                }
                let eta = if front { solid.eta } else { 1.0 / solid.eta };
                let split = fresnel::dielectric(Model::Exact, cos, eta);
                let wi = refract(local, DVec3::Z * local.z.signum(), eta, split.cos_transmitted);
                let transmitted = parts.transmitted * (1.0 / (eta * eta)) as f32;
                bounce.reflect(parts.reflected) + bounce.cross(transmitted, frame.to_world(wi))
            }
            Kind::PrincipledThin(sheet) => {
                let parts = sheet.at(at, self.nm).smooth(cos);
                bounce.reflect(parts.reflected) + bounce.cross(parts.transmitted, -wo)
            }
            Kind::Thin { interior, exterior, tints, thickness } => {
                let tint = Tints::at(tints.as_deref(), at, self.nm);
                let waves = thickness.as_ref().map(|t| t.waves(at, self.nm, exterior));
                let pane = Pane::new(cos, &relative_index(interior, exterior, self.nm, false), waves);
                let reflected = tint.reflected * pane.reflected * (1.0 - pane.share) as f32;
                bounce.reflect(reflected) + bounce.cross(tint.transmitted * pane.transmitted * pane.share as f32, -wo)
            }
            Kind::Dielectric { interior, exterior, fresnel: model, tints, film, .. } => {
                let tint = Tints::at(tints.as_deref(), at, self.nm);
                let exterior = standpoint.around.unwrap_or(exterior);
                // As paths do under a film (`Material::bsdf`).
                let index = relative_index(interior, exterior, self.nm, self.plan.all_dispersive && film.is_none());
                let filmed = film
                    .as_ref()
                    .map(|film| film.at(at, self.nm, exterior).over_dielectric(cos, index.each(), local.z > 0.0));
                bounce.glass(*model, &index, filmed, &tint)
            }
        }
    }
}

/// Light that is mirrored and refracted at a vertex.
struct Bounce<'a> {
    tracer: &'a Tracer<'a>,
    seen: &'a Seen<'a>,
    frame: Frame,
    /// The direction to the viewer, in the frame.
    local: DVec3,
    /// The share that reaches the eye.
    weight: Lanes,
    depth: u32,
}

impl Bounce<'_> {
    /// The `share` that goes to the viewer of what arrives from `wi`, in which direction there is `inside`.
    fn follow(&self, share: Lanes, wi: DVec3, inside: Inside) -> Lanes {
        let Vertex { surface, hit, .. } = *self.seen.x;
        let share = share * self.seen.slopes.shadowing(wi) as f32;
        let onward = self.weight * share;
        if !visible(onward) {
            return Lanes::ZERO;
        }
        let ray = self.tracer.scene.leave(surface, hit, wi);
        self.tracer.trace(&ray, inside, onward, self.depth + 1, f64::INFINITY).light * share
    }

    /// Above zero where `wi` is on the viewer's side of the true surface. A shading normal that leans may send light to the wrong
    /// side, where it would see through it: that light is lost, as in `path`.
    fn sides(&self, wi: DVec3) -> f64 {
        let Vertex { surface, wo, .. } = *self.seen.x;
        wi.dot(surface.normal) * wo.dot(surface.normal)
    }

    /// Light that is mirrored.
    fn reflect(&self, share: Lanes) -> Lanes {
        let wi = self.frame.to_world(DVec3::new(-self.local.x, -self.local.y, self.local.z));
        if self.sides(wi) > 0.0 { self.follow(share, wi, self.seen.standpoint.here) } else { Lanes::ZERO }
    }

    /// Light that comes through from `wi`.
    fn cross(&self, share: Lanes, wi: DVec3) -> Lanes {
        if self.sides(wi) < 0.0 { self.follow(share, wi, self.seen.standpoint.beyond) } else { Lanes::ZERO }
    }

    /// Both at a face of glass. Under a film the share that each lane reflects is `filmed`.
    fn glass(&self, model: Model, index: &RelativeIndex, filmed: Option<[f64; LANES]>, tint: &Tint) -> Lanes {
        let local = self.local;
        let m = DVec3::Z * local.z.signum();
        let toward = |eta: f64| if local.z > 0.0 { eta } else { 1.0 / eta };
        // Radiance that crosses scales by 1/η².
        let bent = |eta: f64, reflected: Option<f64>| {
            let mut split = fresnel::dielectric(model, local.z.abs(), eta);
            if let Some(reflected) = reflected {
                (split.reflected, split.transmitted) = (reflected, 1.0 - reflected);
            }
            let wi = self.frame.to_world(refract(local, m, eta, split.cos_transmitted));
            (split.reflected as f32, (split.transmitted / (eta * eta)) as f32, wi)
        };
        match index {
            RelativeIndex::Constant(eta) => {
                let eta = toward(*eta);
                let (r, t, wi) = bent(eta, None);
                let (reflected, transmitted) = match filmed {
                    None => (tint.reflected * r, tint.transmitted * t),
                    Some(filmed) => {
                        let r = Lanes::new(filmed.map(|r| r as f32));
                        (tint.reflected * r, tint.transmitted * (Lanes::ONE - r) * (1.0 / (eta * eta)) as f32)
                    }
                };
                self.reflect(reflected) + self.cross(transmitted, wi)
            }
            RelativeIndex::Dispersive(all) => {
                let lanes: [_; LANES] = std::array::from_fn(|k| bent(toward(all[k]), filmed.map(|f| f[k])));
                let mut light = self.reflect(tint.reflected * Lanes::new(lanes.map(|l| l.0)));
                // Lanes with the very same index stay together; others part.
                let mut done = [false; LANES];
                for k in 0..LANES {
                    if done[k] {
                        continue;
                    }
                    let share: [f32; LANES] = std::array::from_fn(|j| {
                        let together = !done[j] && all[j] == all[k];
                        done[j] |= together;
                        if together { lanes[j].1 } else { 0.0 }
                    });
                    light += self.cross(tint.transmitted * Lanes::new(share), lanes[k].2);
                }
                light
            }
        }
    }
}

/// The row of the `k`-th of [`POINTS`] columns in which its point lies: the digits of k to the bases 2, 2, 5 and 3, the last first, as
/// in Hammersley's points (Niederreiter 1992, section 3.1).
fn row(k: u32) -> u32 {
    30 * (k % 2) + 15 * (k / 2 % 2) + 3 * (k / 4 % 5) + k / 20
}

/// Whether a ray of which `weight` reaches the eye is followed.
fn visible(weight: Lanes) -> bool {
    weight.simd_gt(Lanes::splat(FAINTEST)).any()
}

/// strength · cosⁿ, zero on the far side.
fn highlight(h: &Highlight, normal: DVec3, wo: DVec3, wi: DVec3) -> f64 {
    let cos = match h.model {
        HighlightModel::Blinn => (wo + wi).try_normalize().map_or(0.0, |half| half.dot(normal)),
        HighlightModel::Phong => (normal * (2.0 * wo.dot(normal)) - wo).dot(wi),
    };
    if cos > 0.0 { f64::from(h.strength) * libm::pow(cos, h.exponent) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal up, viewer and light 30° to either side: Phong's mirrored viewer meets the light and
    /// Blinn's half vector the normal; with the light 20° higher Phong sees cos 20°, Blinn cos 10°.
    #[test]
    fn highlights_are_powers_of_the_right_cosines() {
        let at = |deg: f64| DVec3::new(deg.to_radians().sin(), deg.to_radians().cos(), 0.0);
        for (model, off) in [(HighlightModel::Phong, 20.0f64), (HighlightModel::Blinn, 10.0)] {
            let h = Highlight { strength: 0.5, exponent: 20.0, model };
            assert!((highlight(&h, DVec3::Y, at(-30.0), at(30.0)) - 0.5).abs() < 1e-14);
            let expected = 0.5 * off.to_radians().cos().powi(20);
            assert!((highlight(&h, DVec3::Y, at(-30.0), at(10.0)) - expected).abs() < 1e-14, "{model:?}");
            assert_eq!(highlight(&h, DVec3::Y, at(-30.0), -at(30.0)), 0.0);
        }
    }
}
