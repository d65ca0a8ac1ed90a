//! Light that a path finds: sent by what it meets, from infinity, and of lights that its vertices ask.

use super::{Path, Tracer};
use crate::math::{Frame, Ray};
use crate::optics::bsdf::Bsdf;
use crate::scene::compound::Slopes;
use crate::scene::{Medium, Object, SurfacePoint};
use crate::spectrum::Lanes;
use crate::transport::shadow::Shadow;
use glam::{DVec2, DVec3};

/// The power heuristic for densities `a` and `b`, safe for any finite and infinite values.
pub(super) fn power_heuristic(a: f64, b: f64) -> f64 {
    if a <= 0.0 {
        return 0.0;
    }
    let r = b / a;
    1.0 / r.mul_add(r, 1.0)
}

/// What scatters at a vertex.
pub(super) enum Scatterer<'a> {
    Surface {
        bsdf: &'a Bsdf<'a>,
        frame: &'a Frame,
        surface: &'a SurfacePoint,
        object: &'a Object,
        flip: bool,
        slopes: Option<&'a Slopes>,
    },
    Medium {
        medium: &'a Medium,
        point: DVec3,
    },
}

impl Scatterer<'_> {
    /// f · |cos| and densities toward `wi` (world), given `wo` (local for surfaces, world for media).
    pub(super) fn eval(&self, wo: DVec3, wi_world: DVec3) -> (Lanes, Lanes) {
        match self {
            Scatterer::Surface { bsdf, frame, surface, flip, slopes, .. } => {
                let wi = frame.to_local(wi_world);
                let geometric = wi_world.dot(surface.normal) * if *flip { -1.0 } else { 1.0 };
                // Light that the shading normal sees and the true one does not would leak through.
                if geometric * wi.z <= 0.0 {
                    return (Lanes::ZERO, Lanes::ZERO);
                }
                let e = bsdf.eval(wo, wi);
                let cos = wi.z.abs() * slopes.map_or(1.0, |s| s.shadowing(wi_world));
                (e.f * cos as f32, e.pdf)
            }
            Scatterer::Medium { medium, point } => {
                let p = Lanes::splat(medium.phase.eval(*point, wo, wi_world) as f32);
                (p, p)
            }
        }
    }
}

impl Tracer<'_> {
    /// Whether light that the path meets is of the class that is traced from `light`; see [`crate::transport::caustics`].
    pub(super) fn leaves(&self, path: &Path, light: u32) -> bool {
        path.seen && path.sharp && self.plan.caustics.as_ref().is_some_and(|c| c.traced[light as usize])
    }

    /// Whether light that the path meets counts: always for the camera, else where scattering is a technique.
    pub(super) fn meets_lights(&self, path: &Path) -> bool {
        self.settings.scatter_samples > 0 || path.vertices == 0
    }

    /// Light from infinity along a ray that met nothing.
    pub(super) fn add_background<const CHROMATIC: bool>(&self, path: &mut Path) {
        if !self.meets_lights(path) || self.settings.hide_emitters && path.vertices == 0 {
            return;
        }
        for &i in &self.scene.backgrounds {
            let light = &self.scene.lights[i as usize];
            let (l, weight) = match &path.previous {
                None => (light.background(path.ray.direction, self.nm), 1.0),
                Some(p) => {
                    let (l, pdf) = light.background_and_pdf(path.ray.direction, p.normal, self.nm);
                    let q = self.scene.light_probability_at(i as usize, p.point, p.normal) * pdf;
                    (l, power_heuristic(p.density * path.rho_sum::<CHROMATIC>(), q * p.rho))
                }
            };
            if self.leaves(path, i) {
                path.leave_out::<CHROMATIC>(l, weight);
            } else {
                path.add::<CHROMATIC>(l, weight);
            }
        }
    }

    /// Next-event estimation: light from one point of one light.
    #[expect(clippy::too_many_arguments, reason = "the state of a vertex, split by borrow")]
    pub(super) fn add_light<const CHROMATIC: bool, const MEDIA: bool>(
        &self,
        path: &mut Path,
        scatterer: &Scatterer,
        point: DVec3,
        wo: DVec3,
        normal: Option<DVec3>,
        u: DVec2,
        u_light: f64,
        leave: impl FnOnce(DVec3) -> Ray,
    ) {
        let scene = self.scene;
        let Some((i, probability)) = scene.choose_light_at(point, normal, u_light) else { return };
        let Some(light) = scene.lights[i].arriving(&scene.objects, point, normal, u, self.nm) else { return };
        let (f, pdf) = scatterer.eval(wo, light.wi);
        if f.simd_eq(Lanes::ZERO).all() {
            return;
        }
        let inside = match scatterer {
            // Light from the other side comes through what is there.
            Scatterer::Surface { surface, object, .. }
                if MEDIA && light.wi.dot(surface.normal) * path.ray.direction.dot(surface.normal) > 0.0 =>
            {
                scene.beyond(object, surface, light.wi, path.inside)
            }
            _ => path.inside,
        };
        let shadow = Shadow {
            scene,
            sampler: self.sampler,
            nm: self.nm,
            vertex: path.vertices,
            inside,
            panes: self.panes(path),
            target: light.target,
        };
        let Some((through, passing)) = shadow.cast::<MEDIA>(&leave(light.wi), light.distance) else { return };
        let value = f * light.radiance * through;
        let weight = match light.density {
            None => 1.0 / probability,
            Some(density) => {
                let q = density * probability;
                // B: what scattering, led by any lane, would have found this light with.
                let led = if CHROMATIC { path.rho * pdf * passing } else { pdf * passing };
                let scattering = if self.settings.scatter_samples > 0 { f64::from(led.reduce_add()) } else { 0.0 };
                power_heuristic(q * path.rho_sum::<CHROMATIC>(), scattering) / q
            }
        };
        if self.leaves(path, i as u32) {
            path.leave_out::<CHROMATIC>(value, weight);
        } else {
            path.add::<CHROMATIC>(value, weight);
        }
    }
}
