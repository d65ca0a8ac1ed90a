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

use super::path::seen_normal;
use super::plan::{EffectPlan, LightSettings};
use crate::math::sampler::{Sampler, Set, pairs};
use crate::math::{Frame, Ray};
use crate::optics::bsdf::Bsdf;
use crate::scene::compound::Leaf;
use crate::scene::material::{Kind, Material};
use crate::scene::{Hit, Scene, SurfacePoint};
use crate::spectrum::{LANES, Lanes, SampledWavelengths};
use glam::{DVec2, DVec3};

/// Vertices up to which a path that has lost nothing goes on for sure, as in `path`.
const FOR_SURE: u32 = 256;

/// Longest survival of a path beyond that.
const SURVIVAL: f64 = 0.999;

/// Boundaries in a row that a ray crosses at the most.
const MAX_BOUNDARIES: u32 = 256;

/// Tells the random numbers of lights from those of the camera.
const STREAM: u64 = 0x6c69_6768_7470_6174;

/// Light that reached the camera.
#[derive(Clone, Copy, Debug)]
pub struct Splat {
    /// Where on the picture, in pixels.
    pub place: DVec2,
    /// Spectral power by pixel, W·nm⁻¹, for each lane; its mean over paths is the picture's radiance.
    pub light: Lanes,
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

/// Follows path `index` of `replicate` and hands each of its splats within `bounds` to `splat`.
#[expect(clippy::too_many_arguments, reason = "the address of a path, and where its light goes")]
pub fn trace(
    scene: &Scene,
    plan: &EffectPlan,
    settings: &LightSettings,
    seed: u64,
    replicate: u32,
    index: u64,
    bounds: Bounds,
    mut splat: impl FnMut(&SampledWavelengths, Splat),
) {
    // One long sequence a replicate, as the lights are the same for every pixel.
    let sampler = Sampler::new(seed ^ STREAM, [(index >> 32) as u32, 0], replicate, index as u32);
    let (u_choice, u_time) = pairs(sampler.set(Set::Camera));
    let (u_point, u_direction) = pairs(sampler.set(Set::Extra(0)));
    let wavelengths = scene.wavelengths.sample(u_time.x);
    let Some(emission) = scene.emit(u_choice.x, u_point, u_direction, wavelengths.nm) else { return };
    let start = largest(emission.power);
    if start.is_nan() || start <= 0.0 {
        return;
    }
    let walk = Walk { scene, frame: bounds };
    let mut ray = emission.ray;
    let mut power = emission.power;
    // Density of each lane over the hero's, as in `path`.
    let mut rho = Lanes::ONE;

    for vertex in 0u32.. {
        // The camera is one segment further than the next surface.
        if settings.max_depth.is_some_and(|depth| vertex + 2 > depth) {
            return;
        }
        let numbers = |crossings: u32| sampler.set(Set::Extra((vertex + 1).wrapping_add(crossings << 16)))[2];
        let Some((hit, surface, from, leaf)) = walk.next_surface(&ray, numbers) else { return };
        let material = &scene.materials[scene.objects[hit.object as usize].material as usize];
        let material = leaf.as_ref().map_or(material, |leaf| leaf.material);
        let came = -from;
        let frame = match &leaf {
            Some(leaf) => leaf.frame,
            None => {
                let flip = material.two_sided && came.dot(surface.normal) < 0.0;
                let normal = seen_normal(&surface, came);
                Frame::from_normal_and_tangent(if flip { -normal } else { normal }, surface.tangent)
            }
        };
        // Slopes shadow by the direction to the light alone, which is where the path comes from.
        if let Some(leaf) = &leaf {
            power *= leaf.slopes.shadowing(came) as f32;
        }
        let bsdf = material.bsdf(&hit.texture_point(&surface), wavelengths.nm, plan.all_dispersive);
        let wo = frame.to_local(came);
        let choice = sampler.set(Set::Choice(vertex));
        let (u_lens, u_scatter) = pairs(sampler.set(Set::Scatter(vertex)));
        let share = LANES as f32 / rho.reduce_add();

        if !bsdf.is_discrete() {
            let at = Vertex { hit: &hit, surface: &surface, frame: &frame, came, local: wo };
            if let Some(seen) = walk.connect(&bsdf, &at, u_lens, wavelengths.nm) {
                splat(&wavelengths, Splat { light: power * seen.light * share, ..seen });
            }
        }

        let Some(sample) = bsdf.sample(wo, choice[1], u_scatter) else { return };
        let went = frame.to_world(sample.wi);
        let side = went.dot(surface.normal) * came.dot(surface.normal);
        if (side > 0.0) == sample.transmitted || side == 0.0 {
            return;
        }
        // Power, not radiance: no 1/η² on crossing, and the cosines of the true normal for those of the other.
        let adjoint = sample.eta2 * adjoint(wo.z, sample.wi.z, came.dot(surface.normal), went.dot(surface.normal));
        power *= sample.weight * adjoint as f32;
        rho *= sample.ratio;
        let carried = largest(power) * f64::from(LANES as f32 / rho.reduce_add());
        if carried.is_nan() || carried <= 0.0 {
            return;
        }
        if vertex + 2 >= settings.roulette_depth {
            let q = (carried / start).min(if vertex < FOR_SURE { 1.0 } else { SURVIVAL });
            if choice[2] >= q {
                return;
            }
            power *= (1.0 / q) as f32;
        }
        ray = scene.leave(&surface, &hit, went);
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

/// A point where light scatters.
struct Vertex<'a> {
    hit: &'a Hit,
    surface: &'a SurfacePoint,
    frame: &'a Frame,
    /// Toward where the light came from.
    came: DVec3,
    /// The same in the frame.
    local: DVec3,
}

struct Walk<'a> {
    scene: &'a Scene,
    frame: Bounds,
}

impl Walk<'_> {
    /// The next surface that does not let this path through as if it were not there, the direction in which it is
    /// met, and of a material made of others the one that is met. `number` chooses, by crossings so far.
    fn next_surface(
        &self,
        ray: &Ray,
        number: impl Fn(u32) -> f64,
    ) -> Option<(Hit, SurfacePoint, DVec3, Option<Leaf<'_>>)> {
        let mut ray = *ray;
        for crossings in 0..MAX_BOUNDARIES {
            let hit = self.scene.closest(&ray, f64::INFINITY)?;
            let surface = self.scene.surface(&ray, &hit);
            match &self.material(&hit).kind {
                Kind::Boundary => {}
                Kind::Compound(compound) => {
                    let (at, wo) = (&hit.texture_point(&surface), -ray.direction);
                    let x = crate::scene::compound::Vertex { scene: self.scene, hit: &hit, surface: &surface, at, wo };
                    let leaf = compound.resolve(&x, seen_normal(&surface, wo), number(crossings));
                    if let Some(leaf) = leaf
                        && !matches!(leaf.material.kind, Kind::Boundary)
                    {
                        return Some((hit, surface, ray.direction, Some(leaf)));
                    }
                }
                _ => return Some((hit, surface, ray.direction, None)),
            }
            ray = self.scene.leave(&surface, &hit, ray.direction);
        }
        None
    }

    fn material(&self, hit: &Hit) -> &Material {
        &self.scene.materials[self.scene.objects[hit.object as usize].material as usize]
    }

    /// Light of a unit of power that a vertex sends into the camera.
    fn connect(&self, bsdf: &Bsdf, at: &Vertex, u_lens: DVec2, nm: Lanes) -> Option<Splat> {
        let entry = self.scene.camera.entry(at.surface.point, || u_lens)?;
        if !self.frame.holds(entry.pixel) {
            return None;
        }
        let to_camera = at.frame.to_local(entry.direction);
        let (came, went) = (at.came.dot(at.surface.normal), entry.direction.dot(at.surface.normal));
        if came * at.local.z * went * to_camera.z <= 0.0 {
            return None;
        }
        // The viewer is at the camera: f as radiance has it.
        let f = bsdf.eval(to_camera, at.local).f;
        if f.simd_eq(Lanes::ZERO).all() {
            return None;
        }
        let cosines = to_camera.z.abs() * adjoint(at.local.z, to_camera.z, came, went);
        let through = self.open(&self.scene.leave(at.surface, at.hit, entry.direction), entry.distance, nm)?;
        Some(Splat { place: entry.pixel, light: f * through * (cosines * entry.density) as f32 })
    }

    /// The share of light that comes straight on to `distance`; `None` where something opaque stands between.
    fn open(&self, ray: &Ray, distance: f64, nm: Lanes) -> Option<Lanes> {
        if !self.scene.has_boundaries {
            return (!self.scene.occluded(ray, distance, None)).then_some(Lanes::ONE);
        }
        let (mut ray, mut left, mut through) = (*ray, distance, Lanes::ONE);
        for _ in 0..MAX_BOUNDARIES {
            let Some(hit) = self.scene.closest(&ray, left) else { return Some(through) };
            let material = self.material(&hit);
            if !material.lets_through() {
                return None;
            }
            let surface = self.scene.surface(&ray, &hit);
            let straight = material.straight(&surface, ray.direction, || hit.texture_point(&surface), nm)?;
            through *= straight.weight * straight.share as f32;
            ray = self.scene.leave(&surface, &hit, ray.direction);
            left -= hit.t;
        }
        None
    }
}
