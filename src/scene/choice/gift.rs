//! What lights have to give to a point: as much as is known before one looks.

use crate::math::warp::one_minus_cos;
use crate::scene::bvh::Aabb;
use crate::scene::light::Light;
use crate::scene::shape::Shape;
use crate::scene::{Geometry, Object};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Where a light, or several, may be seen, and how strong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// A ball around it.
    pub(super) center: DVec3,
    pub(super) radius: f64,
    /// Luminous intensity in the direction where it is strongest, film units times m².
    pub(super) intensity: f64,
    /// Middle of all normals, unit, and the largest angle of a normal with it, radians.
    pub(super) axis: DVec3,
    pub(super) spread: f64,
    /// The largest angle from a normal into which light goes, radians.
    pub(super) reach: f64,
    /// Whether it is as strong in all those directions, and does not fall with the cosine.
    pub(super) even: bool,
}

/// What lights have to give to a point, before anything stands in the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Gift {
    Near(Extent),
    /// From infinity: on a surface that is turned to it, and on a point of a medium, in film units. `toward` where it
    /// comes from one direction, unit.
    Distant {
        toward: Option<DVec3>,
        surface: f64,
        point: f64,
    },
}

impl Gift {
    pub(super) fn of(light: &Light, power: f64, objects: &[Object]) -> Gift {
        let from_point = |position: DVec3, intensity: f64, axis: DVec3, reach: f64| {
            let spread = if reach >= PI { PI } else { 0.0 };
            Gift::Near(Extent { center: position, radius: 0.0, intensity, axis, spread, reach, even: true })
        };
        match light {
            Light::Area { object, .. } => Gift::Near(Extent::of_surface(&objects[*object as usize], power / PI)),
            Light::AlongNormal { object, .. } => {
                let extent = Extent::of_surface(&objects[*object as usize], power);
                Gift::Near(Extent { spread: PI, ..extent })
            }
            Light::Point { position, .. } => from_point(*position, power / (4.0 * PI), DVec3::Z, PI),
            Light::Spot { position, axis, beam, cutoff, .. } => {
                let angle = TAU * one_minus_cos(0.5 * (beam + cutoff));
                from_point(*position, power / angle, *axis, *cutoff)
            }
            Light::Projector(projector) => {
                let cone = projector.cone();
                from_point(cone.apex, power / cone.solid_angle, cone.axis, cone.half_angle)
            }
            Light::Directional { direction, irradiance } => {
                let irradiance = irradiance.luminance();
                Gift::Distant { toward: Some(-*direction), surface: irradiance, point: irradiance }
            }
            Light::Constant { radiance } => Gift::everywhere(radiance.luminance()),
            Light::Environment(map) => Gift::everywhere(map.brighter_luminance()),
        }
    }

    fn everywhere(radiance: f64) -> Gift {
        Gift::Distant { toward: None, surface: PI * radiance, point: 4.0 * PI * radiance }
    }
}

impl Extent {
    /// A surface with `strength`, its area times its radiance.
    fn of_surface(object: &Object, strength: f64) -> Extent {
        let Aabb { min, max } = object.bounds();
        let (center, radius) = (0.5 * min + 0.5 * max, 0.5 * (max - min).length());
        let (axis, spread) = match &object.geometry {
            Geometry::Shape(shape @ (Shape::Disk(_) | Shape::Rectangle(_))) => {
                (shape.sample_area(glam::DVec2::splat(0.5)).normal, 0.0)
            }
            Geometry::Mesh(mesh) => {
                let normals = || (0..mesh.mesh.triangles.len() as u32).map(|i| mesh.mesh.area_vector(i));
                let axis = normals().sum::<DVec3>().normalize_or_zero();
                let least = normals().filter_map(DVec3::try_normalize).map(|n| n.dot(axis)).fold(1.0, f64::min);
                (axis, if least > 0.0 { libm::acos(least.min(1.0)) } else { PI })
            }
            _ => (DVec3::Z, PI),
        };
        // A closed convex body shows a quarter of its surface, in the mean over all directions (Cauchy).
        let seen = if spread < PI { 1.0 } else { 0.25 };
        let radius = match &object.geometry {
            Geometry::Shape(Shape::Sphere(_)) => 0.5 * (max - min).max_element(),
            _ => radius,
        };
        let axis = axis * object.facing();
        Extent { center, radius, intensity: seen * strength, axis, spread, reach: 0.5 * PI, even: false }
    }

    pub(super) fn bounds(&self) -> Aabb {
        Aabb { min: self.center - self.radius, max: self.center + self.radius }
    }

    /// Around all of `parts`, of which there is one at least.
    pub(super) fn around(parts: &[Extent]) -> Extent {
        let all = parts.iter().fold(Aabb::EMPTY, |b, part| b.union(&part.bounds()));
        let (mut axis, mut spread) = (parts[0].axis, parts[0].spread);
        for part in &parts[1..] {
            (axis, spread) = cone_around((axis, spread), (part.axis, part.spread));
        }
        Extent {
            center: 0.5 * all.min + 0.5 * all.max,
            radius: 0.5 * (all.max - all.min).length(),
            intensity: parts.iter().map(|part| part.intensity).sum(),
            axis,
            spread,
            reach: parts.iter().map(|part| part.reach).fold(0.0, f64::max),
            even: parts.iter().any(|part| part.even),
        }
    }
}

/// A cone of directions that holds two.
fn cone_around(a: (DVec3, f64), b: (DVec3, f64)) -> (DVec3, f64) {
    let ((wide, spread), (narrow, other)) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = libm::acos(wide.dot(narrow).clamp(-1.0, 1.0));
    if (between + other).min(PI) <= spread {
        return (wide, spread);
    }
    let all = 0.5 * (spread + between + other);
    let across = (narrow - wide * wide.dot(narrow)).normalize_or_zero();
    if all >= PI || across == DVec3::ZERO {
        return (wide, PI);
    }
    let turn = all - spread;
    (wide * libm::cos(turn) + across * libm::sin(turn), all)
}
