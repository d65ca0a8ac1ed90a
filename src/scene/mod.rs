//! What rays meet: compiled, immutable, `Send + Sync`.
//!
//! Objects are what a person wrote: a sphere, a mesh. A ray that leaves an object carries its index
//! and that of the face or triangle, so that nothing is met again by rounding; see
//! [`crate::math::Departure`].

pub mod ahead;
pub mod along_normal;
mod apart;
mod around;
pub mod bands;
mod beside;
pub mod brightness;
pub mod bundle;
pub mod bvh;
pub mod camera;
pub mod casters;
pub mod census;
pub mod choice;
pub mod compile;
pub mod compound;
pub mod curves;
pub mod daylight;
pub mod emission;
pub mod environment;
pub mod equiangular;
pub mod few;
pub mod grid;
pub mod instance;
pub mod lamps;
pub mod light;
pub mod load;
pub mod material;
pub mod medium;
pub mod mesh;
pub mod nested;
pub mod overlaps;
pub mod partials;
pub mod principled;
pub mod projector;
pub mod sdf;
pub mod several;
pub mod shape;
pub mod shelf;
pub mod texture;
pub mod through;
pub mod volume;
pub mod watch;

use crate::math::sampler::{Octet, Sampler, Set, unit};
use crate::math::{Departure, Ray};
use crate::spectrum::{Spectrum, WavelengthDistribution};
use brightness::Powers;
use bvh::{Aabb, Bvh};
use camera::Camera;
use choice::Asked;
use curves::Curves;
use few::Few;
use glam::{DVec2, DVec3};
use instance::{AffineMap, Instance, PartHit};
use lamps::Lamps;
use light::Light;
use material::{Kind, Material};
pub use medium::Medium;
use mesh::together::Together;
use mesh::{AreaTable, Mesh, MeshTree};
pub use nested::Inside;
use nested::Nested;
use sdf::SdfGrid;
use shape::Detail;
use shape::Shape;
pub use shape::SurfacePoint;
use std::path::PathBuf;
use std::sync::Arc;
use texture::TexturePoint;
use watch::Watch;

/// A scene, ready to be rendered.
#[derive(Debug)]
pub struct Scene {
    /// Its name.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// What was written: first what stands in the scene itself, then the children of groups, which are
    /// seen through instances.
    pub objects: Vec<Object>,
    /// Of each object the name of its material, or its own where it has one of its own.
    pub material_names: Vec<String>,
    /// How many of them stand in the scene itself.
    pub standing: usize,
    /// Over the objects that stand in the scene itself, but for the meshes of [`Scene::together`].
    pub bvh: Bvh,
    /// The same, where they are few: searched in place of the tree.
    pub few: Option<Few>,
    /// The triangles of most meshes that stand in the scene itself: a ray is made ready for them once.
    pub together: Option<Together>,
    /// Materials, by index.
    pub materials: Vec<Material>,
    /// Media, by index.
    pub media: Vec<Medium>,
    /// Whether any of them fills a part of space.
    pub has_media: bool,
    /// Whether some surface has on one side what the camera is not in.
    pub parts_media: bool,
    /// What is where no body is.
    pub camera_medium: Option<u32>,
    /// Bodies with a priority.
    pub nested: Nested,
    /// What paths of the camera begin in.
    pub camera_inside: Inside,
    /// Lights.
    pub lights: Vec<Light>,
    /// How a point of the scene chooses among those that it asks; and by power alone those are chosen that paths begin at.
    pub all_asked: Asked,
    /// The same without light that is even over all directions, if there is any: what is scattered finds that, too.
    pub uneven_asked: Option<Asked>,
    /// Where rays may meet lamps.
    pub lamps: Lamps,
    /// Lamps toward which distances in media may be drawn; none where they are many.
    pub near_lamps: Vec<equiangular::Lamp>,
    /// By which powers of two sums count light.
    pub light_powers: Powers,
    /// And lengths.
    pub length_powers: Powers,
    /// Indices of lights from infinity.
    pub backgrounds: Vec<u32>,
    /// Whether a light from infinity was written, be it with no power: what `opaque_sky` covers all with.
    pub has_sky: bool,
    /// Names of those that were written without power, and are none.
    pub dark: Vec<String>,
    /// The groups that lights are in.
    pub light_groups: LightGroups,
    /// Of each object whether what it throws onto others is a caustic, where layers part light; else empty. Mirrors, and glass and
    /// metal that are smooth or nearly so, as paths from the lights take them. Whether those are used changes nothing about it.
    pub sharp: Vec<bool>,
    /// Depth fog of the picture.
    pub fog: Option<DepthFog>,
    /// From which wavelengths are drawn.
    pub wavelengths: WavelengthDistribution,
    /// Bands of the spectrum that the picture holds instead of colour.
    pub bands: Vec<Band>,
    /// Centre of the bounded part of the scene.
    pub center: DVec3,
    /// Its radius, metres.
    pub radius: f64,
    /// How far from there anything is that sends out light, metres; infinite where light comes from anywhere.
    pub lit_within: f64,
    /// True where something that stands in the scene has no end.
    pub has_planes: bool,
    /// True where light may go straight through some object: the boundary of a medium, a pane, a body within another.
    pub has_boundaries: bool,
    /// True where a ray can meet light by chance: some light has an extent.
    pub shines_on_rays: bool,
    /// The light that is an environment too large for the caches, if any: see [`Scene::foresee`].
    pub large_sky: Option<u32>,
    /// Files that were read.
    pub files: Vec<PathBuf>,
    /// What a person should know of the scene, with its place in the file.
    pub notes: Vec<String>,
    /// Counts what robust arithmetic was needed for, where that is asked for.
    pub watch: Option<Box<Watch>>,
}

/// Groups of lights, for layers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightGroups {
    /// Names of those after the first, which has the lights that are in none.
    pub names: Vec<String>,
    /// The group of each light.
    pub of: Vec<u8>,
}

impl LightGroups {
    /// Number of groups, the nameless first one included.
    #[must_use]
    pub fn count(&self) -> u8 {
        // No more names than that pass the check of a description.
        self.names.len() as u8 + 1
    }
}

/// A band of the spectrum.
#[derive(Clone, Debug)]
pub struct Band {
    /// Of the channel.
    pub name: String,
    /// How much each wavelength counts.
    pub response: Spectrum,
}

/// What a person wrote.
#[derive(Debug)]
pub struct Object {
    /// Its name, given or made from kind and number.
    pub name: String,
    /// Its form.
    pub geometry: Geometry,
    /// Its material.
    pub material: u32,
    /// The light that it is, if it shines.
    pub light: Option<u32>,
    /// Whether anything on it varies over the surface.
    pub detail: Detail,
    /// Medium on the side away from the normal.
    pub inside: Option<u32>,
    /// Medium on the side of the normal.
    pub outside: Option<u32>,
    /// True where the two above say nothing: a path that crosses stays in the medium that it was in.
    pub keeps_medium: bool,
    /// Whether its normals point to the other side than the form's own.
    pub flipped: bool,
    /// Whether it was written to shine, be it with no power: what `hide_emitters` hides.
    pub is_lamp: bool,
    /// Its rank among the bodies with a priority, from 1; 0 for none.
    pub body: u32,
}

impl Object {
    /// One that does not shine, has nothing that varies, and tells of no media.
    fn plain(name: String, geometry: Geometry, material: u32) -> Object {
        Object {
            name,
            geometry,
            material,
            light: None,
            detail: Detail::Geometry,
            inside: None,
            outside: None,
            keeps_medium: false,
            flipped: false,
            is_lamp: false,
            body: 0,
        }
    }

    /// The object's box; without end for a plane.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        match &self.geometry {
            Geometry::Shape(shape) => match shape.bounds() {
                Some((min, max)) => Aabb { min, max },
                None => Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY },
            },
            Geometry::Mesh(mesh) => mesh.tree.as_ref().map_or_else(|| mesh.mesh.bounds(), MeshTree::bounds),
            Geometry::Sdf(sdf) => sdf.bounds(),
            Geometry::Curves(curves) => curves.bounds(),
            Geometry::Instance(instance) => instance.bounds(),
        }
    }

    /// −1 where the normals of the form point the other way, else 1.
    #[must_use]
    pub fn facing(&self) -> f64 {
        if self.flipped { -1.0 } else { 1.0 }
    }

    /// The medium that a ray in `direction`, which was in `before`, is in after it has crossed the surface.
    #[must_use]
    pub fn beyond(&self, surface: &SurfacePoint, direction: DVec3, before: Option<u32>) -> Option<u32> {
        self.medium_beyond(direction.dot(surface.normal) < 0.0, before)
    }

    /// The same of a ray that goes to the side away from the normal, or to that of the normal.
    #[must_use]
    fn medium_beyond(&self, inward: bool, before: Option<u32>) -> Option<u32> {
        match inward {
            _ if self.keeps_medium => before,
            true => self.inside,
            false => self.outside,
        }
    }
}

/// The form of an object. Shapes lie in place: a pointer would cost each ray a cache line.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "see above")]
pub enum Geometry {
    /// An analytic shape.
    Shape(Shape),
    /// Triangles.
    Mesh(Box<TriangleMesh>),
    /// A signed distance on a grid.
    Sdf(Box<SdfGrid>),
    /// Curves with a thickness. Scenes in which they have the same place share them.
    Curves(Arc<Curves>),
    /// A copy of a group. No hit names it: the child is the object that was met.
    Instance(Box<Instance>),
}

impl Geometry {
    /// Its area, m²; zero where it is not known, of forms and meshes that do not shine.
    #[must_use]
    pub fn area(&self) -> f64 {
        match self {
            Geometry::Shape(shape) => shape.area(),
            Geometry::Mesh(mesh) => mesh.areas.total(),
            Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => 0.0,
        }
    }
}

/// A mesh with what finds its triangles.
#[derive(Debug)]
pub struct TriangleMesh {
    /// The triangles.
    pub mesh: Mesh,
    /// For rays; none where the triangles are in [`Scene::together`].
    pub tree: Option<MeshTree>,
    /// For light; of none where the mesh does not shine.
    pub areas: AreaTable,
}

impl TriangleMesh {
    /// Moves it.
    fn shift(&mut self, by: DVec3) {
        self.mesh.origin += by;
        if let Some(tree) = &mut self.tree {
            tree.shift(by);
        }
    }
}

/// Fog that thickens with the distance from the picture plane: what a compositor does with a
/// depth channel, not a simulation of a medium. The first surface a camera ray meets is faded.
#[derive(Clone, Debug)]
pub struct DepthFog {
    /// Radiance of the fog.
    pub colour: Spectrum,
    /// How much of it.
    pub falloff: FogFalloff,
}

/// How depth fog grows with depth.
#[derive(Clone, Copy, Debug)]
pub enum FogFalloff {
    /// (z − start) / (end − start), clamped to [0, 1].
    Linear {
        /// Depth where it begins, metres.
        start: f64,
        /// Depth where it hides everything, metres.
        end: f64,
    },
    /// 1 − exp(−density z).
    Exponential {
        /// 1/m.
        density: f64,
    },
    /// 1 − exp(−(density z)²).
    ExponentialSquared {
        /// 1/m.
        density: f64,
    },
}

impl FogFalloff {
    /// The share of fog at depth `z` metres, in [0, 1]; one at infinity, unless its density is 0.
    #[must_use]
    pub fn amount(&self, z: f64) -> f64 {
        match *self {
            FogFalloff::Linear { start, end } => ((z - start) / (end - start)).clamp(0.0, 1.0),
            // max takes no NaN: a density of 0 leaves no fog even at infinity.
            FogFalloff::Exponential { density } => -libm::expm1(-(density * z).max(0.0)),
            FogFalloff::ExponentialSquared { density } => -libm::expm1(-(density * z).max(0.0).powi(2)),
        }
    }
}

/// Where a ray meets an object.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray, metres.
    pub t: f64,
    /// The object.
    pub object: u32,
    /// Its face, triangle, cell or segment.
    pub part: u32,
    /// For triangles the barycentric coordinates of the second and third vertex, for curves first the place along the
    /// segment.
    pub barycentric: [f64; 2],
    /// The instance that the object belongs to, where it is a child of one.
    pub instance: Option<u32>,
}

/// What a search has found so far. Of things at the same distance the first in the scene counts, so that the order of a
/// search decides nothing.
#[derive(Clone, Copy, Debug)]
struct Nearest {
    hit: Option<Hit>,
    /// What counts is nearer than this: as near as `hit` or nearer.
    reach: f64,
}

impl Nearest {
    fn of(hit: Hit) -> Nearest {
        Nearest { reach: hit.t.next_up(), hit: Some(hit) }
    }
}

impl Hit {
    /// The part that was met, as a ray that leaves it names it.
    #[must_use]
    pub fn departure(&self) -> Departure {
        Departure { object: self.object, part: self.part, instance: self.instance }
    }

    /// The hit on `surface`, as textures see it.
    #[must_use]
    pub fn texture_point(&self, surface: &SurfacePoint) -> TexturePoint {
        TexturePoint::new(surface, self.part, self.barycentric)
    }

    /// True where the hit is on the face or triangle `target`.
    #[must_use]
    pub fn is_on(&self, target: Option<Departure>) -> bool {
        target.is_some_and(|t| t.object == self.object && t.part == self.part)
    }
}

impl Scene {
    /// Where `ray` meets `object` before `t_max`.
    #[inline]
    fn meet(&self, ray: &Ray, object: u32, t_max: f64) -> Option<Hit> {
        let geometry = &self.objects[object as usize].geometry;
        if let Geometry::Instance(instance) = geometry {
            return instance.closest(&self.objects, object, ray, t_max);
        }
        // Children of groups have indices of their own, so that of an instance's child is never this one.
        let departing = ray.departure.filter(|d| d.object == object).map(|d| d.part);
        let PartHit { t, part, barycentric } = geometry.meet(ray, t_max, departing)?;
        Some(Hit { t, object, part, barycentric, instance: None })
    }

    /// The nearest thing that `ray` meets closer than `t_max`.
    #[must_use]
    pub fn closest(&self, ray: &Ray, t_max: f64) -> Option<Hit> {
        let best = self.closest_apart(ray, t_max);
        let Some(together) = &self.together else { return best };
        together.closest(ray, best.map_or(t_max, |hit| hit.t)).or(best)
    }

    /// [`Scene::closest`] but for the triangles of [`Scene::together`].
    #[inline]
    fn closest_apart(&self, ray: &Ray, t_max: f64) -> Option<Hit> {
        if let Some(few) = &self.few {
            return few.closest(ray, t_max, |object, nearest| _ = self.meet_nearer(ray, object, nearest));
        }
        let mut nearest = Nearest { hit: None, reach: t_max };
        self.bvh.closest(ray, t_max, |object, _| self.meet_nearer(ray, object, &mut nearest));
        nearest.hit
    }

    /// Tries `object`. Answers its distance where it is what `ray` meets first of all that was tried.
    #[inline]
    fn meet_nearer(&self, ray: &Ray, object: u32, nearest: &mut Nearest) -> Option<f64> {
        let hit = self.meet(ray, object, nearest.reach)?;
        let order = |hit: &Hit| (hit.object, hit.instance);
        if nearest.hit.is_some_and(|known| known.t == hit.t && order(&known) < order(&hit)) {
            return None;
        }
        *nearest = Nearest::of(hit);
        Some(hit.t)
    }

    /// True where anything stands between the ray's origin and `distance`. `target` is the face or
    /// triangle that lies at the far end, facing the ray. Every shape is convex, so that of its outside what
    /// faces the ray cannot stand in its own way, and skipping it needs no tolerance; of its inside
    /// everything is hidden by the wall through which the ray would enter.
    #[must_use]
    pub fn occluded(&self, ray: &Ray, distance: f64, target: Option<Departure>) -> bool {
        let by_triangles = || self.together.as_ref().is_some_and(|t| t.any(ray, distance, target, |_| true));
        let blocked_by = |object: u32| self.blocks(ray, object, distance, target);
        let by_others = match &self.few {
            Some(few) => {
                let aimed = self.aimed(target);
                // A shape that shines outward does not hide itself.
                let own = aimed.map(|object| (object, &self.objects[object as usize]));
                let own = own.filter(|(_, o)| o.flipped || !matches!(o.geometry, Geometry::Shape(_)));
                few.any(ray, distance, aimed, |object, met| met || blocked_by(object))
                    || own.is_some_and(|(object, _)| blocked_by(object))
            }
            None => self.bvh.any(ray, distance, blocked_by),
        };
        by_others || by_triangles()
    }

    /// Whether `object` stands between the ray's origin and `distance`.
    fn blocks(&self, ray: &Ray, object: u32, distance: f64, target: Option<Departure>) -> bool {
        let geometry = &self.objects[object as usize].geometry;
        if let Geometry::Instance(instance) = geometry {
            return instance.blocks(&self.objects, object, ray, distance);
        }
        let departing = ray.departure.filter(|d| d.object == object).map(|d| d.part);
        let target = target.filter(|t| t.object == object).map(|t| t.part);
        match geometry {
            Geometry::Shape(shape) if target.is_some() && self.objects[object as usize].flipped => {
                let first = shape.intersect(ray, distance, departing.map(|face| face as u8));
                first.is_some_and(|hit| enters(shape, ray, hit.t, hit.face))
            }
            _ => geometry.blocks(ray, distance, departing, target),
        }
    }

    /// Whether [`Scene::occluded`] tells of every ray if it reaches the face of `hit`, which is seen from the side of its normal or
    /// not; of the latter's shapes together with [`Scene::enters_on_the_way`].
    #[must_use]
    pub fn can_be_aimed_at(&self, hit: &Hit, from_outside: bool) -> bool {
        let object = &self.objects[hit.object as usize];
        hit.instance.is_none()
            && match object.geometry {
                Geometry::Mesh(_) => true,
                Geometry::Shape(_) => from_outside || !object.flipped,
                Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => false,
            }
    }

    /// Whether `ray` enters the shape `object` before `distance`: then it meets the inside of none of its faces.
    #[must_use]
    pub fn enters_on_the_way(&self, ray: &Ray, object: u32, distance: f64) -> bool {
        let Geometry::Shape(shape) = &self.objects[object as usize].geometry else { return false };
        let departing = ray.departure.filter(|d| d.object == object).map(|d| d.part as u8);
        let first = shape.intersect(ray, distance, departing);
        first.is_some_and(|hit| enters(shape, ray, hit.t, hit.face))
    }

    /// The object of `target`, where it stands in the scene itself.
    #[inline]
    fn aimed(&self, target: Option<Departure>) -> Option<u32> {
        target.map(|t| t.object).filter(|&object| (object as usize) < self.standing)
    }

    /// True where `hit` is what a shadow ray toward `target` was to reach: on it, and not on the outside of a
    /// shape that shines inward.
    #[must_use]
    pub fn reaches(&self, ray: &Ray, hit: &Hit, target: Option<Departure>) -> bool {
        let object = &self.objects[hit.object as usize];
        hit.is_on(target)
            && match &object.geometry {
                Geometry::Shape(shape) if object.flipped => !enters(shape, ray, hit.t, hit.part as u8),
                _ => true,
            }
    }

    /// The surface at a hit. Within what follows paths it would crowd out what they carry.
    #[must_use]
    #[inline(never)]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        if let Some(watch) = &self.watch {
            watch.met(self, ray, hit);
        }
        self.surface_with(ray, hit, self.objects[hit.object as usize].detail)
    }

    /// The medium beyond `hit` on the boundary of a medium, where `ray` is in `before`: [`Object::beyond`] without the
    /// rest of the surface. None where the surface is something else as well.
    #[must_use]
    pub fn beyond_boundary(&self, ray: &Ray, hit: &Hit, before: Option<u32>) -> Option<Option<u32>> {
        let object = &self.objects[hit.object as usize];
        let is_boundary = matches!(self.materials[object.material as usize].kind, Kind::Boundary) && object.body == 0;
        match &object.geometry {
            Geometry::Mesh(mesh) if is_boundary && hit.instance.is_none() && self.watch.is_none() => {
                let inward = ray.direction.dot(mesh.mesh.area_vector(hit.part)) * object.facing() < 0.0;
                Some(object.medium_beyond(inward, before))
            }
            _ => None,
        }
    }

    /// The map of the instance that was met.
    #[inline]
    fn instance_map(&self, hit: &Hit) -> Option<&AffineMap> {
        match &self.objects[hit.instance? as usize].geometry {
            Geometry::Instance(instance) => Some(&instance.map),
            _ => None,
        }
    }

    /// [`Scene::surface`] with as much as is asked for.
    #[inline]
    fn surface_with(&self, ray: &Ray, hit: &Hit, detail: Detail) -> SurfacePoint {
        let object = &self.objects[hit.object as usize];
        let mut surface = match self.instance_map(hit) {
            Some(map) => map.surface(&object.geometry, ray, hit, detail),
            None => object.geometry.surface(ray.at(hit.t), hit, detail),
        };
        if object.flipped {
            surface.normal = -surface.normal;
            surface.shading_normal = -surface.shading_normal;
        }
        surface
    }

    /// The ray that leaves a surface in `direction`.
    #[must_use]
    #[inline]
    pub fn leave(&self, surface: &SurfacePoint, hit: &Hit, direction: DVec3) -> Ray {
        let ray = Ray::leaving(surface.point, surface.scale, surface.normal, direction, hit.departure());
        if let Some(watch) = &self.watch {
            watch.left(self, &ray);
        }
        ray
    }

    /// A light chosen by `u` in [0, 1) and its probability.
    #[must_use]
    pub fn choose_light(&self, u: f64) -> Option<(usize, f64)> {
        self.all_asked.chosen_by_power(u)
    }

    /// How a point chooses among the lights that it asks, with light that is even over all directions or without.
    #[must_use]
    #[inline]
    pub fn asked(&self, even_sky: bool) -> &Asked {
        match &self.uneven_asked {
            Some(uneven) if !even_sky => uneven,
            _ => &self.all_asked,
        }
    }

    /// Prepares for the samples that go with this one, when the first of them asks for the numbers by which they choose
    /// points of lights.
    #[inline]
    pub fn foresee(&self, sampler: &Sampler, set: Set) {
        if let Some(sky) = self.large_sky
            && let Light::Environment(map) = &self.lights[sky as usize]
        {
            sampler.announce(set, |all| {
                let mut us = [DVec2::ZERO; Octet::SAMPLES];
                us.iter_mut().zip(all).for_each(|(u, x)| *u = DVec2::new(unit(x[0]), unit(x[1])));
                map.foresee(&us[..all.len()]);
            });
        }
    }

    /// The probability of [`Scene::choose_light`] for light `i`.
    #[must_use]
    pub fn light_probability(&self, i: usize) -> f64 {
        self.all_asked.share_of_power(i)
    }
}

/// Whether a ray crosses a face from outside.
fn enters(shape: &Shape, ray: &Ray, t: f64, face: u8) -> bool {
    shape.surface(ray.at(t), face).normal.dot(ray.direction) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The formula of depth fog at three distances, start and end exact, and far beyond.
    #[test]
    fn fog_is_the_closed_form_at_every_depth() {
        let linear = FogFalloff::Linear { start: 2.0, end: 10.0 };
        assert_eq!([0.0, 2.0, 6.0, 10.0, 1e30].map(|z| linear.amount(z)), [0.0, 0.0, 0.5, 1.0, 1.0]);
        let exponential = FogFalloff::Exponential { density: 0.1 };
        assert!((exponential.amount(1e-9) - 1e-10).abs() < 1e-19);
        assert!((exponential.amount(10.0) - (1.0 - (-1f64).exp())).abs() < 1e-15);
        let squared = FogFalloff::ExponentialSquared { density: 0.1 };
        assert!((squared.amount(20.0) - (1.0 - (-4f64).exp())).abs() < 1e-15);
        for f in [linear, exponential, squared] {
            assert_eq!(f.amount(f64::INFINITY), 1.0);
            assert_eq!(f.amount(-1.0), 0.0);
        }
        for none in [FogFalloff::Exponential { density: 0.0 }, FogFalloff::ExponentialSquared { density: 0.0 }] {
            assert_eq!([1.0, f64::INFINITY].map(|z| none.amount(z)), [0.0; 2]);
        }
    }
}
