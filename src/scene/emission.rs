//! Rays that leave the lights, for paths that begin there.

use super::light::{Light, spot_falloff};
use super::texture::TexturePoint;
use super::{Geometry, Object, Scene, SurfacePoint};
use crate::math::{Departure, Frame, Ray, warp};
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A ray of light.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// From the light.
    pub ray: Ray,
    /// Spectral power over the density of the ray and of the choice of its light, W·nm⁻¹: its mean is the power of all
    /// lights.
    pub power: Lanes,
}

/// A point drawn by area on a shape that shines.
struct Spot {
    surface: SurfacePoint,
    texture: TexturePoint,
    departure: Departure,
    /// Area of the shape, m².
    area: f64,
}

fn spot_on(objects: &[Object], object: u32, u: DVec2) -> Option<Spot> {
    let facing = objects[object as usize].facing();
    match &objects[object as usize].geometry {
        Geometry::Shape(shape) => {
            let s = shape.sample_area(u);
            let surface = shape.surface(s.point, s.face);
            let surface = SurfacePoint { normal: surface.normal * facing, ..surface };
            let part = u32::from(s.face);
            (s.pdf_area > 0.0).then(|| Spot {
                surface,
                texture: TexturePoint::new(&surface, part, [0.0; 2]),
                departure: Departure::new(object, part),
                area: 1.0 / s.pdf_area,
            })
        }
        Geometry::Mesh(mesh) => {
            let (part, u_x) = mesh.areas.sample(u.x)?;
            let b = warp::triangle(DVec2::new(u_x, u.y));
            let surface = mesh.mesh.surface(part, b.x, b.y);
            let surface = SurfacePoint { normal: surface.normal * facing, ..surface };
            Some(Spot {
                surface,
                texture: TexturePoint::new(&surface, part, b.into()),
                departure: Departure::new(object, part),
                area: mesh.areas.total(),
            })
        }
        // They do not shine.
        Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => None,
    }
}

impl Spot {
    fn ray(&self, direction: DVec3) -> Ray {
        Ray::leaving(self.surface.point, self.surface.scale, self.surface.normal, direction, self.departure)
    }
}

impl Scene {
    /// A ray of a light that `u_light` chooses; `None` where there is none.
    ///
    /// Light from infinity comes through a disc as wide as the bounded part of the scene: a plane without end gets
    /// it there only.
    #[must_use]
    pub fn emit(&self, u_light: f64, u_point: DVec2, u_direction: DVec2, nm: Lanes) -> Option<Emission> {
        let (i, probability) = self.choose_light(u_light)?;
        let light = &self.lights[i];
        let (ray, power) = match light {
            Light::Area { object, radiance } => {
                let spot = spot_on(&self.objects, *object, u_point)?;
                let local = warp::cosine_hemisphere(u_direction);
                let direction = Frame::from_normal(spot.surface.normal).to_world(local);
                // L cos θ over the density (1 / area) (cos θ / π).
                (spot.ray(direction), radiance.eval(&spot.texture, nm) * (PI * spot.area) as f32)
            }
            Light::AlongNormal { object, exitance } => {
                let spot = spot_on(&self.objects, *object, u_point)?;
                (spot.ray(spot.surface.normal), exitance.eval(&spot.texture, nm) * spot.area as f32)
            }
            Light::Point { position, intensity } => {
                let direction = warp::uniform_sphere(u_direction);
                (Ray::new(*position, direction), intensity.eval(nm) * (4.0 * PI) as f32)
            }
            Light::Spot { position, axis, beam, cutoff, intensity, slide } => {
                // 1 − cos of the cutoff without cancellation.
                let half = libm::sin(0.5 * cutoff);
                let one_minus_cos = 2.0 * half * half;
                let direction = Frame::from_normal(*axis).to_world(warp::uniform_cone(u_direction, one_minus_cos));
                let factor = spot_falloff(direction.dot(*axis), *beam, *cutoff) * 2.0 * PI * one_minus_cos;
                let slide = slide.as_ref().map_or(Lanes::ONE, |slide| slide.eval(-direction, nm));
                (Ray::new(*position, direction), intensity.eval(nm) * slide * factor as f32)
            }
            Light::Projector(projector) => projector.emit(u_direction, nm),
            Light::Directional { direction, irradiance } => {
                (self.arriving_ray(*direction, u_point), irradiance.eval(nm) * self.section())
            }
            Light::Constant { radiance } => {
                let direction = warp::uniform_sphere(u_direction);
                let factor = (4.0 * PI) as f32 * self.section();
                (self.arriving_ray(direction, u_point), radiance.eval(nm) * factor)
            }
            Light::Environment(map) => {
                let s = map.sample(u_direction)?;
                let factor = self.section() * (1.0 / s.pdf_solid_angle) as f32;
                (self.arriving_ray(-s.direction, u_point), map.radiance_of(&s, nm) * factor)
            }
        };
        Some(Emission { ray, power: power * (1.0 / probability) as f32 })
    }

    /// The area of the disc through which light from infinity comes, m².
    fn section(&self) -> f32 {
        (PI * self.radius * self.radius) as f32
    }

    /// A ray from outside the scene.
    fn arriving_ray(&self, direction: DVec3, u: DVec2) -> Ray {
        let frame = Frame::from_normal(direction);
        let disk = warp::concentric_disk(u) * self.radius;
        Ray::new(self.center + frame.s * disk.x + frame.t * disk.y - direction * self.radius, direction)
    }
}
