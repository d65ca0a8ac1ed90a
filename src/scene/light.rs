//! What shines, and how a path finds it.

use super::along_normal;
use super::environment::{Drawn, Environment, EnvironmentSample};
use super::projector::Projector;
use super::shape::{Shape, Sphere, TowardSample};
use super::texture::{Texture, TexturePoint};
use super::{Geometry, Hit, Object, SurfacePoint, TriangleMesh};
use crate::math::frame::Frame;
use crate::math::warp::{self, one_minus_cos};
use crate::math::{Departure, Ray};
use crate::spectrum::observer::tristimulus;
use crate::spectrum::{Lanes, Spectrum};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// A light.
#[derive(Clone, Debug)]
pub enum Light {
    /// A surface that emits on the side of its normal.
    Area {
        /// The object that shines.
        object: u32,
        /// Radiance, W·m⁻²·sr⁻¹·nm⁻¹.
        radiance: Texture,
    },
    /// A surface whose points each send their light along the normal.
    AlongNormal {
        /// The object that shines.
        object: u32,
        /// Power by area, W·m⁻²·nm⁻¹.
        exitance: Texture,
    },
    /// A point that shines equally in all directions.
    Point {
        /// Where, m, in the world.
        position: DVec3,
        /// W·sr⁻¹·nm⁻¹.
        intensity: Spectrum,
    },
    /// A point that shines in a cone, full within `beam` and falling linearly in the angle to
    /// nothing at `cutoff`.
    Spot {
        /// Where, m, in the world.
        position: DVec3,
        /// Whither, unit.
        axis: DVec3,
        /// Half angle of full intensity, radians.
        beam: f64,
        /// Half angle of no intensity, radians.
        cutoff: f64,
        /// W·sr⁻¹·nm⁻¹ on the axis.
        intensity: Spectrum,
        /// What multiplies the intensity.
        slide: Option<Box<Slide>>,
    },
    /// Parallel light.
    Directional {
        /// The way the light goes, unit.
        direction: DVec3,
        /// On a surface across the light, W·m⁻²·nm⁻¹.
        irradiance: Spectrum,
    },
    /// The same radiance from everywhere.
    Constant {
        /// W·m⁻²·sr⁻¹·nm⁻¹.
        radiance: Spectrum,
    },
    /// An image on the sphere at infinity.
    Environment(Arc<Environment>),
    /// A picture thrown from a point.
    Projector(Box<Projector>),
}

/// A picture in front of a spot light, which fills the square around its cone.
#[derive(Clone, Debug)]
pub struct Slide {
    /// The picture.
    pub texture: Texture,
    /// Columns: right on the picture, up, the axis.
    pub axes: DMat3,
    /// From its middle to where u and v are one, at distance one: the tangent of the cutoff, and that or its
    /// negative.
    pub half: DVec2,
}

impl Slide {
    /// The value in the direction `wi` toward the light, which is at `position`: what varies in space has one value there, as in
    /// Mitsuba.
    pub(super) fn eval(&self, wi: DVec3, position: DVec3, nm: Lanes) -> Lanes {
        let d = self.axes.transpose() * -wi;
        let uv = 0.5 + 0.5 * d.truncate() / (d.z * self.half);
        self.texture.eval(&TexturePoint { uv, point: position, ..TexturePoint::default() }, nm)
    }
}

/// Light that arrives at a point, before anything stands in its way.
#[derive(Clone, Copy, Debug)]
pub struct Arriving {
    /// Toward the light, unit.
    pub wi: DVec3,
    /// Distance to the light, m; infinite for light from infinity.
    pub distance: f64,
    /// Radiance, W·m⁻²·sr⁻¹·nm⁻¹; for lights without extent the irradiance across `wi`, W·m⁻²·nm⁻¹ (then `density` is `None`).
    pub radiance: Lanes,
    /// sr⁻¹; `None` for lights without extent, which no scattering finds by chance.
    pub density: Option<f64>,
    /// The face or triangle that shines, where there is one.
    pub target: Option<Departure>,
}

/// How far a `ray` that left a surface at `point` has to be free toward a light at `distance` from the point. The ray begins a
/// little nearer, and what is behind a lamp without extent does not hide it; one that has a `target` ends there.
#[must_use]
pub fn free(distance: f64, target: Option<Departure>, point: DVec3, ray: &Ray) -> f64 {
    match target {
        None if distance.is_finite() => distance - (ray.origin - point).length(),
        _ => distance,
    }
}

/// How spot light falls off between beam and cutoff, as a factor in [0, 1], in `direction` about `axis`, both unit. The angle is that
/// of sine and cosine: a cosine alone has none below 1e-8.
#[must_use]
pub fn spot_falloff(direction: DVec3, axis: DVec3, beam: f64, cutoff: f64) -> f64 {
    let angle = libm::atan2(direction.cross(axis).length(), direction.dot(axis));
    if angle <= beam {
        1.0
    } else if angle >= cutoff {
        0.0
    } else {
        (cutoff - angle) / (cutoff - beam)
    }
}

/// CIE x, y of all `lights` together, each by its luminous power; `None` where none shines.
#[must_use]
pub fn chromaticity(lights: &[Light], objects: &[Object], radius: f64) -> Option<[f64; 2]> {
    let mut sum = [0.0; 3];
    for light in lights {
        let mut xyz = [0.0; 3];
        for (weight, spectrum) in light.shares() {
            let own = tristimulus(&spectrum);
            xyz = [0, 1, 2].map(|c| xyz[c] + weight * own[c]);
        }
        let power = light.power(objects, radius);
        if xyz[1] > 0.0 && power > 0.0 {
            sum = [0, 1, 2].map(|c| sum[c] + xyz[c] * (power / xyz[1]));
        }
    }
    let total = sum[0] + sum[1] + sum[2];
    (total > 0.0 && total.is_finite()).then(|| [sum[0] / total, sum[1] / total])
}

impl Light {
    /// Whether it sends out nothing: it costs nothing then.
    #[must_use]
    pub fn is_dark(&self) -> bool {
        match self {
            Light::Area { radiance: light, .. } | Light::AlongNormal { exitance: light, .. } => light.is_black(),
            Light::Spot { intensity, slide, .. } => {
                intensity.is_black() || slide.as_ref().is_some_and(|slide| slide.texture.is_black())
            }
            Light::Point { intensity: light, .. }
            | Light::Directional { irradiance: light, .. }
            | Light::Constant { radiance: light } => light.is_black(),
            Light::Environment(map) => map.mean_luminance() == 0.0,
            Light::Projector(projector) => projector.is_dark(),
        }
    }

    /// True for light from infinity that a ray which meets nothing sees.
    #[must_use]
    pub fn is_environment(&self) -> bool {
        matches!(self, Light::Constant { .. } | Light::Environment(_))
    }

    /// Whether a ray may meet it: lamps without extent are met by none.
    #[must_use]
    pub fn may_be_met(&self) -> bool {
        self.is_environment() || matches!(self, Light::Area { .. })
    }

    /// Where a lamp without extent is.
    #[must_use]
    pub fn position(&self) -> Option<DVec3> {
        match self {
            Light::Point { position, .. } | Light::Spot { position, .. } => Some(*position),
            Light::Projector(projector) => Some(projector.position()),
            Light::Directional { .. }
            | Light::Constant { .. }
            | Light::Environment(_)
            | Light::Area { .. }
            | Light::AlongNormal { .. } => None,
        }
    }

    /// True for light from infinity.
    #[must_use]
    pub fn is_distant(&self) -> bool {
        self.is_environment() || matches!(self, Light::Directional { .. })
    }

    /// Whether light from infinity comes from near `direction` as from a lamp: see [`Environment::stands_out`].
    #[must_use]
    #[inline]
    pub fn stands_out(&self, direction: DVec3) -> bool {
        matches!(self, Light::Environment(map) if map.stands_out(direction))
    }

    /// Whether light from infinity stands out anywhere.
    #[must_use]
    pub fn may_stand_out(&self) -> bool {
        matches!(self, Light::Environment(map) if map.may_stand_out())
    }

    /// Radiance seen along `direction` by a ray that meets nothing.
    #[must_use]
    pub fn background(&self, direction: DVec3, nm: Lanes) -> Lanes {
        match self {
            Light::Constant { radiance } => radiance.eval(nm),
            Light::Environment(map) => map.radiance(direction, nm),
            _ => Lanes::ZERO,
        }
    }

    /// [`Light::background`] and [`Light::background_pdf`] at once.
    #[must_use]
    pub fn background_and_pdf(&self, direction: DVec3, normal: Option<DVec3>, drawn: Drawn, nm: Lanes) -> (Lanes, f64) {
        match self {
            Light::Environment(map) => map.radiance_and_pdf(direction, drawn, nm),
            _ => (self.background(direction, nm), self.background_pdf(direction, normal, drawn)),
        }
    }

    /// Density of [`Light::arriving`] toward the background along `direction`, sr⁻¹. `normal` is the
    /// shading normal that the sample was asked with.
    #[must_use]
    pub fn background_pdf(&self, direction: DVec3, normal: Option<DVec3>, drawn: Drawn) -> f64 {
        match self {
            Light::Constant { .. } => match normal {
                Some(n) => n.dot(direction).max(0.0) / PI,
                None => 0.25 / PI,
            },
            Light::Environment(map) => map.pdf(direction, drawn),
            _ => 0.0,
        }
    }

    /// Radiance that the point `surface`, which a ray met at `hit`, sends toward `wo`.
    #[must_use]
    pub fn emitted(&self, surface: &SurfacePoint, hit: &Hit, wo: DVec3, nm: Lanes) -> Lanes {
        match self {
            Light::Area { radiance, .. } if wo.dot(surface.normal) > 0.0 => {
                radiance.eval(&TexturePoint::new(surface, hit.part, hit.barycentric), nm)
            }
            _ => Lanes::ZERO,
        }
    }

    /// Density with which [`Light::arriving`] at `from` picks the point of the light that the ray in
    /// `direction` met at `hit`; sr⁻¹.
    #[must_use]
    pub fn area_pdf(&self, objects: &[Object], from: DVec3, direction: DVec3, hit: &Hit, normal: DVec3) -> f64 {
        let Light::Area { object, .. } = self else { return 0.0 };
        let lamp = &objects[*object as usize];
        match &lamp.geometry {
            Geometry::Shape(shape) if lamp.flipped => hit.t * hit.t / (shape.area() * normal.dot(direction).abs()),
            Geometry::Shape(shape) => shape.pdf_toward(from, direction, hit.t, normal),
            Geometry::Mesh(mesh) => hit.t * hit.t / (mesh.areas.total() * normal.dot(direction).abs()),
            // They do not shine.
            Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => 0.0,
        }
    }

    /// Light arriving at `from` from a point of the light chosen by `u`; `None` where there is none.
    /// With `normal` the light is wanted on that side of a surface only (light from everywhere is
    /// then drawn by the cosine).
    #[must_use]
    pub fn arriving(
        &self,
        objects: &[Object],
        from: DVec3,
        normal: Option<DVec3>,
        u: DVec2,
        drawn: Drawn,
        nm: Lanes,
    ) -> Option<Arriving> {
        match self {
            Light::Area { object, radiance } => {
                let facing = objects[*object as usize].facing();
                match &objects[*object as usize].geometry {
                    Geometry::Shape(shape) => {
                        let lamp = Lamp { object: *object, form: shape, facing, radiance };
                        match shape {
                            _ if facing < 0.0 => lamp.arriving(shape.sample_inward(from, u)?, nm),
                            // The most common lamp has code of its own.
                            Shape::Rectangle(patch) => lamp.arriving(patch.sample_toward(from, u)?, nm),
                            Shape::Sphere(ball) => lamp.arriving_from_ball(ball, from, u, nm),
                            _ => lamp.arriving(shape.sample_toward(from, u)?, nm),
                        }
                    }
                    Geometry::Mesh(mesh) => {
                        Lamp { object: *object, form: &**mesh, facing, radiance }.arriving(from, u, nm)
                    }
                    Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => None,
                }
            }
            Light::Point { position, intensity } => {
                arriving_from_point(*position, from, |_| 1.0).map(|(wi, distance, factor)| Arriving {
                    wi,
                    distance,
                    radiance: intensity.eval(nm) * factor,
                    density: None,
                    target: None,
                })
            }
            Light::Spot { position, axis, beam, cutoff, intensity, slide } => {
                let falloff = |wi: DVec3| spot_falloff(-wi, *axis, *beam, *cutoff);
                arriving_from_point(*position, from, falloff).map(|(wi, distance, factor)| {
                    let intensity = match slide {
                        Some(slide) => intensity.eval(nm) * slide.eval(wi, *position, nm),
                        None => intensity.eval(nm),
                    };
                    Arriving { wi, distance, radiance: intensity * factor, density: None, target: None }
                })
            }
            Light::AlongNormal { object, exitance } => {
                let lamp = &objects[*object as usize];
                along_normal::arriving(&lamp.geometry, lamp.facing(), *object, exitance, from, u, nm)
            }
            Light::Projector(projector) => projector.arriving(from, nm),
            Light::Directional { direction, irradiance } => {
                Some(Arriving::from_infinity(-*direction, irradiance.eval(nm), None))
            }
            Light::Constant { radiance } => {
                let wi = match normal {
                    Some(n) => Frame::from_normal(n).to_world(warp::cosine_hemisphere(u)),
                    None => warp::uniform_sphere(u),
                };
                let density = self.background_pdf(wi, normal, drawn);
                (density > 0.0).then(|| Arriving::from_infinity(wi, radiance.eval(nm), Some(density)))
            }
            Light::Environment(map) => {
                let s = map.sample(u, drawn)?;
                Some(Arriving::from_infinity(s.direction, map.radiance_of(&s, nm), Some(s.pdf_solid_angle)))
            }
        }
    }

    /// [`Light::arriving`], but that the radiance of a map of the sky is left black and the place that is to be looked up noted in
    /// `sky`: to look it up takes two thirds as long as to draw it, and is in vain where something stands in the way.
    #[must_use]
    #[inline]
    #[expect(clippy::too_many_arguments, reason = "what arrives where, and what is left to do")]
    pub fn arriving_unseen<'a>(
        &'a self,
        objects: &[Object],
        from: DVec3,
        normal: Option<DVec3>,
        u: DVec2,
        drawn: Drawn,
        nm: Lanes,
        sky: &mut Option<(&'a Environment, EnvironmentSample)>,
    ) -> Option<Arriving> {
        let Light::Environment(map) = self else { return self.arriving(objects, from, normal, u, drawn, nm) };
        let s = map.sample(u, drawn)?;
        *sky = Some((map, s));
        Some(Arriving::from_infinity(s.direction, Lanes::ZERO, Some(s.pdf_solid_angle)))
    }

    /// Luminous power, in film units times m²: by which lights are chosen. `radius` is that of the
    /// scene.
    #[must_use]
    pub fn power(&self, objects: &[Object], radius: f64) -> f64 {
        let mean = Texture::mean_luminance;
        match self {
            Light::Area { object, radiance, .. } => PI * objects[*object as usize].geometry.area() * mean(radiance),
            Light::AlongNormal { object, exitance } => objects[*object as usize].geometry.area() * mean(exitance),
            Light::Point { intensity, .. } => 4.0 * PI * intensity.luminance(),
            Light::Spot { intensity, beam, cutoff, slide, .. } => {
                let slide = slide.as_ref().map_or(1.0, |slide| mean(&slide.texture));
                TAU * one_minus_cos(0.5 * (beam + cutoff)) * intensity.luminance() * slide
            }
            Light::Directional { irradiance, .. } => PI * radius * radius * irradiance.luminance(),
            Light::Constant { radiance } => 4.0 * PI * PI * radius * radius * radiance.luminance(),
            Light::Environment(map) => 4.0 * PI * PI * radius * radius * map.mean_luminance(),
            Light::Projector(projector) => projector.power(),
        }
    }

    /// Spectra that the light sends out, for the choice of wavelengths.
    #[must_use]
    pub fn spectra(&self) -> Vec<Spectrum> {
        match self {
            Light::Area { radiance: t, .. } | Light::AlongNormal { exitance: t, .. } => t.representatives(),
            Light::Spot { intensity, slide: Some(slide), .. } => {
                slide.texture.representatives().iter().map(|s| s.times(intensity)).collect()
            }
            Light::Point { intensity: s, .. }
            | Light::Spot { intensity: s, .. }
            | Light::Directional { irradiance: s, .. }
            | Light::Constant { radiance: s } => vec![s.clone()],
            Light::Environment(map) => map.representatives(),
            Light::Projector(projector) => projector.spectra(),
        }
    }

    /// Spectra of its light, each with what it gives to the mean of all.
    fn shares(&self) -> Vec<(f64, Spectrum)> {
        match self {
            Light::Area { radiance: t, .. } | Light::AlongNormal { exitance: t, .. } => t.shares(),
            Light::Spot { intensity, slide: Some(slide), .. } => {
                slide.texture.shares().into_iter().map(|(share, s)| (share, s.times(intensity))).collect()
            }
            Light::Point { intensity: s, .. }
            | Light::Spot { intensity: s, .. }
            | Light::Directional { irradiance: s, .. }
            | Light::Constant { radiance: s } => vec![(1.0, s.clone())],
            Light::Environment(map) => map.shares(),
            Light::Projector(projector) => projector.shares(),
        }
    }
}

/// A shape or a mesh that shines.
struct Lamp<'a, F> {
    object: u32,
    form: &'a F,
    facing: f64,
    radiance: &'a Texture,
}

impl Lamp<'_, Shape> {
    /// The light of a point of a ball; `None` from inside.
    #[inline(always)]
    fn arriving_from_ball(&self, ball: &Sphere, from: DVec3, u: DVec2, nm: Lanes) -> Option<Arriving> {
        // Of what shines evenly, seen from outside, nothing needs to be known but where it is.
        if let Texture::Uniform(spectrum) = self.radiance
            && let Some((wi, distance, density)) = ball.look_toward(from, u)
        {
            let target = Some(Departure::new(self.object, 0));
            return Some(Arriving { wi, distance, radiance: spectrum.eval(nm), density: Some(density), target });
        }
        self.arriving(self.form.sample_toward(from, u)?, nm)
    }

    /// The light of one of its points; `None` from its back.
    #[inline(always)]
    fn arriving(&self, s: TowardSample, nm: Lanes) -> Option<Arriving> {
        if s.direction.dot(s.normal) * self.facing >= 0.0 {
            return None;
        }
        let radiance = match self.radiance {
            Texture::Uniform(spectrum) => spectrum.eval(nm),
            varying => {
                let surface = self.form.surface(s.point, s.face);
                varying.eval(&TexturePoint::new(&surface, u32::from(s.face), [0.0; 2]), nm)
            }
        };
        Some(Arriving {
            wi: s.direction,
            distance: s.distance,
            radiance,
            density: Some(s.pdf_solid_angle),
            target: Some(Departure::new(self.object, u32::from(s.face))),
        })
    }
}

impl Lamp<'_, TriangleMesh> {
    /// The light of a point of a triangle, drawn by area; `None` from its back.
    #[inline(always)]
    fn arriving(&self, from: DVec3, u: DVec2, nm: Lanes) -> Option<Arriving> {
        let TriangleMesh { mesh, areas, .. } = self.form;
        let (i, u_x) = areas.sample(u.x)?;
        let b = warp::triangle(DVec2::new(u_x, u.y));
        let surface = mesh.boundary(i, b.x, b.y);
        let offset = surface.point - from;
        let distance = offset.length();
        let wi = offset / distance;
        let cos = -wi.dot(surface.normal) * self.facing;
        (cos > 0.0 && distance > 0.0).then(|| Arriving {
            wi,
            distance,
            radiance: match self.radiance {
                Texture::Uniform(spectrum) => spectrum.eval(nm),
                varying => {
                    let surface = mesh.surface(i, b.x, b.y);
                    varying.eval(&TexturePoint::new(&surface, i, b.into()), nm)
                }
            },
            density: Some(distance * distance / (areas.total() * cos)),
            target: Some(Departure::new(self.object, i)),
        })
    }
}

impl Arriving {
    fn from_infinity(wi: DVec3, radiance: Lanes, density: Option<f64>) -> Arriving {
        Arriving { wi, distance: f64::INFINITY, radiance, density, target: None }
    }
}

/// Direction, distance and 1/d² times `falloff`.
fn arriving_from_point(position: DVec3, from: DVec3, falloff: impl FnOnce(DVec3) -> f64) -> Option<(DVec3, f64, f32)> {
    let offset = position - from;
    let d2 = offset.length_squared();
    if d2 == 0.0 {
        return None;
    }
    let distance = d2.sqrt();
    let wi = offset / distance;
    let factor = falloff(wi) / d2;
    (factor > 0.0).then_some((wi, distance, factor as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::texture::Wrap;
    use crate::scene::volume::{Between, GridVolume, Volume, Voxels};
    use glam::DAffine3;

    #[test]
    fn spots_are_full_in_the_beam_linear_to_the_cutoff_and_dark_beyond() {
        // Down to angles of which the cosine is one.
        for cutoff in [1.0, 20f64.to_radians(), 1e-5, 1e-9, 1e-15] {
            let at = |share: f64| {
                let angle = share * cutoff;
                let direction = DVec3::new(libm::sin(angle), 0.0, libm::cos(angle));
                spot_falloff(direction, DVec3::Z, 0.75 * cutoff, cutoff)
            };
            assert_eq!([at(0.0), at(0.74), at(1.01), at(1.0 / cutoff)], [1.0, 1.0, 0.0, 0.0]);
            // Linear in the angle, whose sine along an axis is good to a few units of its last place.
            assert!((at(0.875) - 0.5).abs() < 1e-12, "{cutoff}");
        }
    }

    /// A slide of a volume shows what that is where the spot stands, as in Mitsuba 3.9.1: seen from there it is even.
    #[test]
    fn a_slide_of_a_volume_has_the_value_at_the_spot() {
        // One voxel to the left of x = 1, the other to the right.
        let volume = Volume::Grid(Arc::new(GridVolume {
            size: [2, 1, 1],
            values: Voxels::Grey([0.25, 0.75].into()),
            between: Between::Nearest,
            wrap: Wrap::Clamp,
            above_one: false,
            clamped: false,
            local_from_world: DAffine3::from_scale(DVec3::splat(0.5)),
            brightest: std::sync::OnceLock::new(),
        }));
        for (x, value) in [(0.5, 0.25), (1.5, 0.75)] {
            let position = DVec3::new(x, 0.0, 0.0);
            let slide = Slide { texture: Texture::Volume(volume.clone()), axes: DMat3::IDENTITY, half: DVec2::ONE };
            let spot = Light::Spot {
                position,
                axis: DVec3::Z,
                beam: 0.8,
                cutoff: 0.9,
                intensity: Spectrum::Constant(1.0),
                slide: Some(Box::new(slide)),
            };
            for from in [DVec3::new(x - 0.6, 0.0, 1.0), DVec3::new(x + 0.6, 0.0, 1.0)] {
                let light = spot.arriving(&[], from, None, DVec2::ZERO, Drawn::All, Lanes::splat(550.0)).unwrap();
                let intensity = f64::from(light.radiance.to_array()[0]) * light.distance * light.distance;
                // Three roundings to f32.
                assert!((intensity / value - 1.0).abs() < 3.0 * f64::from(f32::EPSILON), "{from}: {intensity}");
            }
        }
    }

    #[test]
    fn point_light_falls_off_with_the_square_of_the_distance() {
        let light = Light::Point { position: DVec3::new(0.0, 3.0, 4.0), intensity: Spectrum::Constant(50.0) };
        let a = light.arriving(&[], DVec3::ZERO, None, DVec2::ZERO, Drawn::All, Lanes::splat(550.0)).unwrap();
        assert_eq!((a.distance, a.radiance.to_array()[0], a.density), (5.0, 2.0, None));
        assert!(
            light
                .arriving(&[], DVec3::new(0.0, 3.0, 4.0), None, DVec2::ZERO, Drawn::All, Lanes::splat(550.0))
                .is_none()
        );
    }
}
