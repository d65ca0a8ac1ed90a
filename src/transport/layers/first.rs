//! The first surface of a sample of the camera, for layers.

use super::{Sampled, rgb};
use crate::description::Quantity;
use crate::math::{Frame, Ray};
use crate::scene::compound::{Composition, Vertex, share};
use crate::scene::material::Material;
use crate::scene::{Hit, Scene, SurfacePoint};
use crate::spectrum::{Lanes, observer};
use crate::transport::middle::{Covering, first_covering};
use crate::transport::plan::EffectPlan;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// The first surface that a camera ray meets, or shows.
pub(super) struct First {
    hit: Hit,
    surface: SurfacePoint,
    /// Its normal in light, where it is what the ray shows.
    normal: Option<DVec3>,
}

impl First {
    /// The first that a ray meets.
    pub(super) fn met(scene: &Scene, ray: &Ray) -> Option<First> {
        let hit = scene.closest(ray, scene.camera.reach(ray))?;
        Some(First { hit, surface: scene.surface_with_texture(ray, &hit), normal: None })
    }

    /// The first that it shows: `u` gives the numbers that decide at its crossings.
    pub(super) fn seen(
        scene: &Scene,
        plan: &EffectPlan,
        ray: &Ray,
        u: impl Fn(u32, Option<f64>) -> f64,
    ) -> Option<First> {
        let Covering { hit, surface, normal } = first_covering(scene, plan, ray, u)?;
        Some(First { hit, surface, normal: Some(normal) })
    }

    /// Appends a quantity of it, as `sample` sees it.
    pub(super) fn append<N: Fn(DVec2) -> Ray, U>(
        &self,
        sample: &Sampled<N, U>,
        quantity: Quantity,
        values: &mut Vec<f32>,
    ) {
        let Sampled { scene, plan, wavelengths, ray, .. } = *sample;
        let surface = &self.surface;
        let three = |v: DVec3| v.to_array().map(|x| x as f32);
        match quantity {
            Quantity::Depth => values.push(self.hit.t as f32),
            Quantity::Position => values.extend(three(surface.point)),
            Quantity::Uv => values.extend(surface.uv.to_array().map(|x| x as f32)),
            Quantity::GeometricNormal => values.extend(three(surface.normal)),
            Quantity::ShadingNormal => {
                values.extend(three(self.normal.unwrap_or_else(|| self.shading_normal(scene, ray))));
            }
            Quantity::DpDu | Quantity::DpDv => {
                let [du, dv] = scene.uv_gradient(&self.hit, surface).partials();
                values.extend(three(if quantity == Quantity::DpDu { du } else { dv }));
            }
            Quantity::DuvDx | Quantity::DuvDy => {
                let step = if quantity == Quantity::DuvDx { DVec2::X } else { DVec2::Y };
                let other = (sample.neighbours)(step * plan.layers.sample_distance);
                let change = self.uv_change(scene, &other);
                values.extend(change.to_array().map(|x| x as f32));
            }
            Quantity::Albedo => {
                let mut albedo = self.albedo(scene, plan, wavelengths.nm, ray);
                // Of what is seen in the light of day, so that grey is grey.
                if self.normal.is_some() {
                    albedo *= plan.layers.white.eval(wavelengths.nm);
                }
                let xyz = observer::xyz(albedo, wavelengths);
                values.extend(rgb(&plan.layers.rgb_from_xyz, xyz));
            }
            Quantity::Primitive => values.push(self.hit.part as f32),
            Quantity::Shape => values.push((self.hit.object + 1) as f32),
        }
    }

    /// How much u and v change from this point to where another ray meets the tangent plane.
    fn uv_change(&self, scene: &Scene, other: &Ray) -> DVec2 {
        let n = self.surface.normal;
        let distance = (self.surface.point - other.origin).dot(n) / other.direction.dot(n);
        let change = scene.uv_gradient(&self.hit, &self.surface).change(other.at(distance) - self.surface.point);
        if change.is_finite() { change } else { DVec2::ZERO }
    }

    /// The normal of the outermost relief, or the interpolated one.
    fn shading_normal(&self, scene: &Scene, ray: &Ray) -> DVec3 {
        let (surface, hit) = (&self.surface, &self.hit);
        let material = &scene.materials[scene.objects[hit.object as usize].material as usize];
        let relief = material.compound().filter(|c| matches!(c.composition, Composition::Relief { .. }));
        let vertex = Vertex { scene, hit, surface, at: &hit.texture_point(surface), wo: -ray.direction };
        let leaf = relief.and_then(|compound| compound.resolve(&vertex, surface.shading_normal, 0.5));
        leaf.map_or(surface.shading_normal, |leaf| leaf.frame.n)
    }

    /// The colour of the material: see [`Quantity::Albedo`].
    fn albedo(&self, scene: &Scene, plan: &EffectPlan, nm: Lanes, ray: &Ray) -> Lanes {
        let object = &scene.objects[self.hit.object as usize];
        let material = &scene.materials[object.material as usize];
        self.albedo_of(material, plan, nm, ray)
    }

    fn albedo_of(&self, material: &Material, plan: &EffectPlan, nm: Lanes, ray: &Ray) -> Lanes {
        let surface = &self.surface;
        if let Some(compound) = material.compound() {
            let inner = |material: &Material| self.albedo_of(material, plan, nm, ray);
            return match &compound.composition {
                Composition::Mask { inner: material, .. } | Composition::Relief { inner: material, .. } => {
                    inner(material)
                }
                Composition::Blend { weight, first, second } => {
                    let at = self.hit.texture_point(surface);
                    let mut w = share(weight, &at);
                    // What is seen is no hole: each part counts by how much of it covers.
                    if self.normal.is_some() {
                        let covers = |part: &Material| 1.0 - part.open(surface, ray.direction, &at);
                        let [first, second] = [(1.0 - w) * covers(first), w * covers(second)];
                        w = if first + second > 0.0 { second / (first + second) } else { w };
                    }
                    let w = w as f32;
                    inner(first) * (1.0 - w) + inner(second) * w
                }
                Composition::TwoSided { front, back } => {
                    inner(if ray.direction.dot(surface.normal) > 0.0 { back } else { front })
                }
            };
        }
        let bsdf = material.bsdf(&self.hit.texture_point(surface), nm, plan.all_dispersive);
        let frame = Frame::from_normal_and_tangent(surface.shading_normal, surface.tangent);
        let mut wo = frame.to_local(-ray.direction);
        match bsdf.base() {
            // Mitsuba's stand-in where nothing is diffuse, as if all light came along the normal: a highlight.
            None if self.normal.is_none() => {
                if material.two_sided {
                    wo.z = wo.z.abs();
                }
                bsdf.eval(wo, DVec3::Z).f * PI as f32
            }
            _ => bsdf.albedo(wo),
        }
    }
}
