//! What stands in a pixel once: data of the ray through its middle, from the middle of the lens, which no filter mixes; and
//! what covers a sample.

use super::layers::Source;
use super::path::seen_normal;
use super::plan::{EffectPlan, Integrator};
use super::shadow::MAX_BOUNDARIES;
use crate::math::Ray;
use crate::scene::compound::{Turns, Vertex};
use crate::scene::environment::Environment;
use crate::scene::light::Light;
use crate::scene::material::Kind;
use crate::scene::{Geometry, Hit, Scene, SurfacePoint};
use glam::{DAffine3, DVec2, DVec3};

/// A datum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Middle {
    /// Depth along the line of sight, metres; [`FAR`] where there is nothing, more in scenes that reach farther.
    Depth,
    /// The place, metres; 0 where there is nothing.
    Position,
    /// Texture coordinates.
    Uv,
    /// How far what is seen moves on the picture until the next frame, pixels, to the right and up; 0 where that is
    /// behind the eye, and without frames.
    Motion,
}

/// The least depth of what is not there.
pub const FAR: f32 = 1e10;

/// The depth of what is not there: beyond all that has an end, so that nothing of it is behind, and finite, so that nothing that is
/// computed with it is NaN. In scenes that reach farther than [`FAR`] a power of ten, which few changes of a scene alter.
fn far(scene: &Scene) -> f32 {
    let reach = scene.radius + scene.camera.eye().distance(scene.center);
    if reach < f64::from(FAR) { FAR } else { 10f64.powi(libm::log10(reach) as i32 + 1).min(f64::from(f32::MAX)) as f32 }
}

impl Middle {
    /// Names of its components; an empty one is the layer itself.
    #[must_use]
    pub fn components(self) -> &'static [&'static str] {
        match self {
            Middle::Depth => &[""],
            Middle::Position => &["X", "Y", "Z"],
            Middle::Uv => &["U", "V"],
            Middle::Motion => &["X", "Y"],
        }
    }
}

/// The data of a pixel: each channel's number and value. `next` is the scene one frame later.
pub fn middle(
    scene: &Scene,
    next: Option<&Scene>,
    plan: &EffectPlan,
    pixel: [i32; 2],
    mut put: impl FnMut(usize, f32),
) {
    let place = DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + 0.5;
    let mut channel = 0;
    let mut met = None;
    for layer in &plan.layers.layers {
        let end = channel + layer.channels();
        if let Source::Middle(middle) = layer.source {
            let (ray, met) = met.get_or_insert_with(|| {
                let ray = scene.camera.ray(place, || DVec2::splat(0.5));
                // What is half there counts.
                (ray, first_covering(scene, plan, &ray, |_, _| 0.5))
            });
            let values = match (middle, met) {
                (Middle::Depth, Some(seen)) => [scene.camera.depth(seen.surface.point) as f32, 0.0, 0.0],
                (Middle::Depth, None) => [far(scene), 0.0, 0.0],
                (Middle::Position, Some(seen)) => seen.surface.point.to_array().map(|x| x as f32),
                (Middle::Uv, Some(seen)) => [seen.surface.uv.x as f32, seen.surface.uv.y as f32, 0.0],
                (Middle::Position | Middle::Uv, None) => [0.0; 3],
                (Middle::Motion, met) => {
                    let [x, y] = next.map_or([0.0; 2], |next| motion(scene, next, place, ray, met.as_ref()));
                    [x, y, 0.0]
                }
            };
            (channel..end).zip(values).for_each(|(channel, value)| put(channel, value));
        }
        channel = end;
    }
}

/// How far what is seen at `place` moves until the scene is `next`, pixels, to the right and up.
fn motion(scene: &Scene, next: &Scene, place: DVec2, ray: &Ray, met: Option<&Covering>) -> [f32; 2] {
    let there = match met {
        Some(Covering { hit, surface, .. }) => {
            let point = moved(scene, next, hit, surface.point);
            next.camera.place_of(point)
        }
        None => next.camera.vanishing_point(turned(scene, next, ray.direction)),
    };
    let Some(there) = there else { return [0.0; 2] };
    let shift = there - place;
    [shift.x as f32, -shift.y as f32]
}

/// How far what has no end, a plane or a picture of the sky, moves at `place` until the scene is `next`, pixels; `None` where
/// something else is seen.
///
/// What leaves the camera's view counts as well: its way is told beside the ray through the same place.
#[must_use]
pub fn passes(scene: &Scene, next: &Scene, place: DVec2) -> Option<f64> {
    let through = |scene: &Scene, place| scene.camera.ray(place, || DVec2::splat(0.5));
    let (ray, beside, after) = (through(scene, place), through(scene, place + DVec2::X), through(next, place));
    let (way, pixel) = match scene.closest(&ray, scene.camera.reach(&ray)) {
        Some(hit) if !scene.objects[hit.instance.unwrap_or(hit.object) as usize].bounds().is_finite() => {
            let point = scene.surface(&ray, &hit).point;
            let apart = moved(scene, next, &hit, point) - after.origin;
            (apart.reject_from(after.direction), beside.at(hit.t) - ray.at(hit.t))
        }
        None if scene.backgrounds.iter().any(|&i| matches!(scene.lights[i as usize], Light::Environment(_))) => {
            (turned(scene, next, ray.direction) - after.direction, beside.direction - ray.direction)
        }
        _ => return None,
    };
    let pixels = way.length() / pixel.length();
    pixels.is_finite().then_some(pixels)
}

/// Where what is infinitely far in `direction` is seen in the scene `next`: there still, or of the first picture of a sky in the
/// same place of it.
fn turned(scene: &Scene, next: &Scene, direction: DVec3) -> DVec3 {
    // Other light from infinity may be dark in one of both.
    fn map(scene: &Scene) -> Option<&Environment> {
        scene.backgrounds.iter().find_map(|&i| match &scene.lights[i as usize] {
            Light::Environment(map) => Some(&**map),
            _ => None,
        })
    }
    match (map(scene), map(next)) {
        (Some(here), Some(there)) => here.carried(there, direction),
        _ => direction,
    }
}

/// Where the point that was hit is in the scene `next`: at the same place of the same triangle, or of the same form. What
/// has no such place there is taken to stand still.
fn moved(scene: &Scene, next: &Scene, hit: &Hit, point: DVec3) -> DVec3 {
    let map = |scene: &Scene, object: u32| match &scene.objects.get(object as usize)?.geometry {
        Geometry::Instance(instance) => Some(*instance.map.world_from_object()),
        _ => None,
    };
    // Of a copy first into the space of its group, and at last out of it.
    let (into, out) = match hit.instance {
        None => (None, None),
        Some(instance) => match (map(scene, instance), map(next, instance)) {
            (Some(before), Some(after)) => (Some(before.inverse()), Some(after)),
            _ => return point,
        },
    };
    let local = into.map_or(point, |into| into.transform_point3(point));
    let (Some(before), Some(after)) = (scene.objects.get(hit.object as usize), next.objects.get(hit.object as usize))
    else {
        return point;
    };
    let carried = |from: DAffine3, to: DAffine3| to.transform_point3(from.inverse().transform_point3(local));
    let local = match (&before.geometry, &after.geometry) {
        (Geometry::Shape(before), Geometry::Shape(after)) => carried(before.placement(), after.placement()),
        (Geometry::Mesh(_), Geometry::Mesh(after)) if (hit.part as usize) < after.mesh.triangles.len() => {
            after.mesh.surface(hit.part, hit.barycentric[0], hit.barycentric[1]).point
        }
        (Geometry::Sdf(before), Geometry::Sdf(after)) => carried(before.placement(), after.placement()),
        (Geometry::Curves(before), Geometry::Curves(after)) => {
            before.carried(after, hit.part, hit.barycentric[0], local).unwrap_or(local)
        }
        _ => local,
    };
    let moved = out.map_or(local, |out| out.transform_point3(local));
    if moved.is_finite() { moved } else { point }
}

/// The number of what covers a sample: above 2³² the object that stands in the scene, below the child of a group that it
/// shows, or the object itself.
#[must_use]
pub fn covered(scene: &Scene, plan: &EffectPlan, ray: &Ray, u: impl Fn(u32, Option<f64>) -> f64) -> Option<u64> {
    let hit = match &plan.integrator {
        // It knows no materials.
        Integrator::Depth => scene.closest(ray, scene.camera.reach(ray))?,
        _ => first_covering(scene, plan, ray, u)?.hit,
    };
    Some(u64::from(hit.instance.unwrap_or(hit.object)) << 32 | u64::from(hit.object))
}

/// A surface that the camera sees.
pub(super) struct Covering {
    pub hit: Hit,
    pub surface: SurfacePoint,
    /// Its normal in light, with all relief, on the side of the surface's own.
    pub normal: DVec3,
}

/// The first surface that a camera ray meets and that is really there: no hole of a mask, which `u` decides at the
/// crossing of that number, told what is left of the number before, no boundary of a medium alone, no hidden lamp, no surface of
/// a body where a stronger one has the place.
pub(super) fn first_covering(
    scene: &Scene,
    plan: &EffectPlan,
    ray: &Ray,
    u: impl Fn(u32, Option<f64>) -> f64,
) -> Option<Covering> {
    let hides = matches!(&plan.integrator, Integrator::Path(settings) if settings.hide_emitters);
    let (mut ray, mut reach, mut left) = (*ray, scene.camera.reach(ray), None);
    let mut inside = scene.camera_inside;
    for crossing in 0..=MAX_BOUNDARIES {
        let hit = scene.closest(&ray, reach)?;
        let surface = scene.surface_with_texture(&ray, &hit);
        let object = &scene.objects[hit.object as usize];
        let is_hidden_lamp = hides && object.is_lamp;
        let of_body = scene.crossing(object, &surface, ray.direction, &inside.bodies);
        let normal = match &scene.materials[object.material as usize].kind {
            _ if is_hidden_lamp || of_body.is_some_and(|of_body| !of_body.shows) => None,
            Kind::Boundary => None,
            Kind::Compound(compound) => {
                let (wo, at) = (-ray.direction, &hit.texture_point(&surface));
                let vertex = Vertex { scene, hit: &hit, surface: &surface, at, wo };
                let mut number = u(crossing, left);
                let leaf = compound.choose(&vertex, seen_normal(&surface, wo), Turns::Seen, &mut number);
                left = Some(number);
                // A part of it may only bound a medium.
                let leaf = leaf.filter(|leaf| !matches!(leaf.material.kind, Kind::Boundary));
                leaf.map(|leaf| if leaf.flipped { -leaf.frame.n } else { leaf.frame.n })
            }
            _ => Some(surface.shading_normal),
        };
        if let Some(normal) = normal {
            return Some(Covering { hit, surface, normal });
        }
        if !is_hidden_lamp {
            inside = scene.beyond(object, &surface, ray.direction, inside);
        }
        ray = scene.leave(&surface, &hit, ray.direction);
        reach -= hit.t;
    }
    None
}
