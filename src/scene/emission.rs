//! Rays that leave the lights, for paths that begin there.
//!
//! Their power is told over an area of its own, [`Power::unit_area`]: it goes with the square of how large lamps, and what they are
//! aimed at, are, which f32 does not hold beyond 10¹⁹ m and below 10⁻¹⁹ m.

use super::environment::Drawn;
use super::light::{Light, spot_falloff};
use super::texture::TexturePoint;
use super::{Geometry, Object, Scene, SurfacePoint};
use crate::math::{Departure, Frame, Ray, inverse_power_of_two, warp};
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// By how much of the size of what it is aimed at light from infinity may begin beside its line: less than f32 tells.
const BLUR: f64 = 1.0 / (1u64 << 26) as f64;

/// Spectral power.
#[derive(Clone, Copy, Debug)]
pub struct Power {
    /// W·nm⁻¹ over the unit of area.
    pub lanes: Lanes,
    /// The unit of area, m²: a power of two, by which the largest of the lanes is about one. So the bits of a picture do not know it.
    pub unit_area: f64,
}

impl Power {
    /// Of so much over a square metre.
    fn new(lanes: Lanes) -> Power {
        let largest = lanes.to_array().into_iter().fold(0.0, f32::max);
        let scale = inverse_power_of_two(f64::from(largest)).min(MOST_SCALE);
        Power { lanes: lanes * scale as f32, unit_area: 1.0 / scale }
    }

    /// So many times as much.
    #[must_use]
    pub fn times(self, factor: f64) -> Power {
        let scale = inverse_power_of_two(factor);
        Power { lanes: self.lanes * (factor * scale) as f32, unit_area: self.unit_area / scale }
    }
}

/// The greatest power of two of f32.
const MOST_SCALE: f64 = (1u128 << 127) as f64;

/// A ray of light.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// From the light.
    pub ray: Ray,
    /// Spectral power over the density of the ray and of the choice of its light: its mean is the power of all lights.
    pub power: Power,
    /// Index of the light.
    pub light: u32,
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

/// A light of which a point, or for light from infinity a direction, has been drawn.
pub struct Start<'a> {
    light: &'a Light,
    place: Place,
    /// The wavelengths.
    nm: Lanes,
}

enum Place {
    /// On a shape that shines in all directions of a hemisphere.
    Surface(Spot),
    /// On a shape that shines along its normal, or a point that throws its light one way only.
    Beam { ray: Ray, power: Power },
    /// A point.
    Point(DVec3),
    /// Infinitely far: where the light goes, and what falls on an area across it over the density of the direction,
    /// W·m⁻²·nm⁻¹.
    Infinity { direction: DVec3, irradiance: Lanes },
}

/// The freedom that is left when a [`Start`] has been drawn.
pub enum Freedom {
    /// None: this is the ray, and its power over its density.
    None(Ray, Power),
    /// The direction, from this point.
    Direction(DVec3),
    /// The place of the ray, whose direction this is.
    Place(DVec3),
}

impl Start<'_> {
    /// What is still free.
    #[must_use]
    pub fn freedom(&self) -> Freedom {
        match &self.place {
            Place::Surface(spot) => Freedom::Direction(spot.surface.point),
            Place::Beam { ray, power } => Freedom::None(*ray, *power),
            Place::Point(position) => Freedom::Direction(*position),
            Place::Infinity { direction, .. } => Freedom::Place(*direction),
        }
    }

    /// The ray in `direction`, with its power by solid angle, sr⁻¹, over the density of its start; `None` where there is no light.
    #[must_use]
    pub fn toward(&self, direction: DVec3) -> Option<(Ray, Power)> {
        match (&self.place, self.light) {
            (Place::Surface(spot), Light::Area { radiance, .. }) => {
                let cos = direction.dot(spot.surface.normal);
                let light = || Power::new(radiance.eval(&spot.texture, self.nm)).times(cos * spot.area);
                (cos > 0.0).then(|| (spot.ray(direction), light()))
            }
            (Place::Point(position), Light::Point { intensity, .. }) => {
                Some((Ray::new(*position, direction), Power::new(intensity.eval(self.nm))))
            }
            (Place::Point(position), Light::Spot { axis, beam, cutoff, intensity, slide, .. }) => {
                let falloff = spot_falloff(direction, *axis, *beam, *cutoff);
                let slide = || slide.as_ref().map_or(Lanes::ONE, |slide| slide.eval(-direction, *position, self.nm));
                let light = || Power::new(intensity.eval(self.nm) * slide() * falloff as f32);
                (falloff > 0.0).then(|| (Ray::new(*position, direction), light()))
            }
            _ => None,
        }
    }

    /// For light from infinity: what falls on an area across its direction, by that area, m⁻², over the density of the direction.
    #[must_use]
    pub fn irradiance(&self) -> Power {
        Power::new(match &self.place {
            Place::Infinity { irradiance, .. } => *irradiance,
            Place::Surface(_) | Place::Beam { .. } | Place::Point(_) => Lanes::ZERO,
        })
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
        let environment = self.lights[i].is_environment();
        let (u_start, u_rest) = if environment { (u_direction, u_point) } else { (u_point, u_direction) };
        let (ray, power) = self.shine(i, u_start, u_rest, nm)?;
        Some(Emission { ray, power: power.times(1.0 / probability), light: i as u32 })
    }

    /// A ray of light `i` as it shines by itself, and its power over its density: `u_start` and `u_rest` as for
    /// [`Scene::start`].
    #[must_use]
    pub fn shine(&self, i: usize, u_start: DVec2, u_rest: DVec2, nm: Lanes) -> Option<(Ray, Power)> {
        let start = self.start(i, u_start, u_rest, nm)?;
        Some(match start.freedom() {
            Freedom::None(ray, power) => (ray, power),
            Freedom::Direction(_) => {
                let (direction, factor) = self.spread(&start, u_rest);
                let (ray, power) = start.toward(direction).filter(|_| factor.is_finite())?;
                (ray, power.times(factor))
            }
            Freedom::Place(direction) => {
                (self.arriving_ray(direction, u_rest), start.irradiance().times(self.section()))
            }
        })
    }

    /// A direction after the way a light shines by itself, and one over its density, sr.
    fn spread(&self, start: &Start, u: DVec2) -> (DVec3, f64) {
        match (&start.place, start.light) {
            (Place::Surface(spot), _) => {
                let local = warp::cosine_hemisphere(u);
                (Frame::from_normal(spot.surface.normal).to_world(local), PI / local.z)
            }
            (_, Light::Spot { axis, cutoff, .. }) => {
                // 1 − cos of the cutoff without cancellation.
                let half = libm::sin(0.5 * cutoff);
                let one_minus_cos = 2.0 * half * half;
                let direction = Frame::from_normal(*axis).to_world(warp::uniform_cone(u, one_minus_cos));
                (direction, 2.0 * PI * one_minus_cos)
            }
            _ => (warp::uniform_sphere(u), 4.0 * PI),
        }
    }

    /// Draws where light `i` begins by `u`, for light from infinity the direction that it comes from; `None` where there
    /// is none. Lights that have no other freedom take `rest`.
    #[must_use]
    pub fn start(&self, i: usize, u: DVec2, rest: DVec2, nm: Lanes) -> Option<Start<'_>> {
        let light = &self.lights[i];
        let place = match light {
            Light::Area { object, .. } => Place::Surface(spot_on(&self.objects, *object, u)?),
            Light::AlongNormal { object, exitance } => {
                let spot = spot_on(&self.objects, *object, u)?;
                let power = Power::new(exitance.eval(&spot.texture, nm)).times(spot.area);
                Place::Beam { ray: spot.ray(spot.surface.normal), power }
            }
            Light::Point { position, .. } | Light::Spot { position, .. } => Place::Point(*position),
            Light::Projector(projector) => {
                let (ray, power) = projector.emit(rest, nm);
                Place::Beam { ray, power: Power::new(power) }
            }
            Light::Directional { direction, irradiance } => {
                Place::Infinity { direction: *direction, irradiance: irradiance.eval(nm) }
            }
            Light::Constant { radiance } => {
                let irradiance = radiance.eval(nm) * (4.0 * PI) as f32;
                Place::Infinity { direction: warp::uniform_sphere(u), irradiance }
            }
            Light::Environment(map) => {
                let s = map.sample(u, Drawn::All)?;
                let irradiance = map.radiance_of(&s, nm) * (1.0 / s.pdf_solid_angle) as f32;
                Place::Infinity { direction: -s.direction, irradiance }
            }
        };
        Some(Start { light, place, nm })
    }

    /// The area of the disc through which light from infinity comes, m².
    fn section(&self) -> f64 {
        PI * self.radius * self.radius
    }

    /// A ray from outside the scene.
    fn arriving_ray(&self, direction: DVec3, u: DVec2) -> Ray {
        let frame = Frame::from_normal(direction);
        let disk = warp::concentric_disk(u) * self.radius;
        self.from_infinity(self.center + frame.s * disk.x + frame.t * disk.y, direction, self.radius, self.radius)
    }

    /// Light from infinity that comes to `to` in `direction`, from as far before it as everything that has an end lies
    /// within, `far`. A place so far out is rounded by as many units of the last place: where that is more than `BLUR` of
    /// `near`, the size of what it is to meet, it begins as near as that.
    ///
    /// Planes, and then other things, may stand farther out, and may let light through: it begins behind all that it has to
    /// cross. Twice the way to one is behind it, however that is rounded.
    #[must_use]
    pub fn from_infinity(&self, to: DVec3, direction: DVec3, near: f64, far: f64) -> Ray {
        let farther = |back: f64| {
            let out = Ray::new(to - direction * back, -direction);
            self.closest(&out, f64::INFINITY).map(|hit| 2.0 * (back + hit.t)).filter(|far| far.is_finite())
        };
        let is_blurred = far * f64::EPSILON > near * BLUR;
        let mut back = if is_blurred { near } else { far };
        if self.has_planes || is_blurred {
            while let Some(far) = farther(back) {
                back = far;
            }
        }
        Ray::new(to - direction * back, direction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::compile::testing::compiled;

    /// 10¹⁵ m away the places of f64 are an eighth of a metre apart. Light that is aimed at something a metre wide keeps to its line
    /// there, to a few roundings of a metre, and begins behind what stands in its way.
    #[test]
    fn light_from_infinity_keeps_to_its_line_whatever_stands_far_away() {
        let (to, direction) = (DVec3::new(0.1, 0.2, 0.3), DVec3::new(-0.6, -0.8, 0.0));
        for (place, stands_before) in [("[1.0e15, 0, 0]", false), ("[6.0e14, 8.0e14, 0]", true)] {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nshapes:\n- sphere: {{radius: 0.5}}\n\
                 - sphere: {{center: {place}, radius: 1000}}\n"
            );
            let scene = compiled(&text);
            let ray = scene.from_infinity(to, direction, 1.0, 4.0 * scene.radius);
            let back = to - ray.origin;
            assert_eq!(back.length() > 1e15, stands_before, "{place}: {back}");
            let beside = back.cross(direction).length();
            assert!(stands_before || beside < 4.0 * f64::EPSILON, "{place}: {beside}");
        }
    }

    /// All rays of a lamp carry the same, up to roundings of f32, but those of a spot. What it is chosen by is told as if its light ended
    /// halfway down its edge: 2π (b + c)²/8 of its intensity where beam b and cutoff c are small. Its rays carry 2π (b² + bc + c²)/6,
    /// the integral of min(1, (c − θ)/(c − b)) θ dθ: with b = ¾ c 49/128 and 37/96 of 2π c², up to c²/12 = 4e-4 at 4°. The 16 midpoints
    /// over 1 − cos θ, of which nine lie within the beam, miss less than 1e-3 of the corners of that.
    #[test]
    fn the_power_of_a_lamp_is_that_of_its_rays() {
        let shines = |more: &str| format!("shapes: [{{sphere: {{radius: 2, emission: 3{more}}}}}]\n");
        let lamp = |lamp: &str| format!("shapes: [{{sphere: {{radius: 2}}}}]\nlights: [{{{lamp}}}]\n");
        let cases = [
            (shines(""), 1.0),
            (shines(", emission_direction: normal"), 1.0),
            (lamp("point: {position: [0, 3, 0], intensity: 3}"), 1.0),
            (lamp("directional: {direction: [0, -1, 0], irradiance: 3}"), 1.0),
            (lamp("constant: {radiance: 3}"), 1.0),
            (lamp("projector: {origin: [0, 3, 0], target: [0, 3, -1], fov_deg: 40, irradiance: 3}"), 1.0),
            (
                lamp("spot: {position: [0, 3, 0], target: [0, 0, 0], cutoff_deg: 4, intensity: 3}"),
                49.0 * 96.0 / (128.0 * 37.0),
            ),
        ];
        for (text, expected) in cases {
            let scene = compiled(&format!("camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n{text}"));
            let mut sum = 0.0;
            for start in warp::midpoints(16) {
                for rest in warp::midpoints(16) {
                    let (_, power) = scene.shine(0, start, rest, Lanes::splat(550.0)).unwrap();
                    sum += f64::from(power.lanes.to_array()[0]) * power.unit_area;
                }
            }
            let ratio = scene.lights[0].power(&scene.objects, scene.radius) * 65_536.0 / sum;
            let tolerance = if expected == 1.0 { 1e-6 } else { 2e-3 };
            assert!((ratio - expected).abs() < tolerance, "{text}: {ratio} for {expected}");
        }
    }
}
