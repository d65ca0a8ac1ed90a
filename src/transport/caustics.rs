//! Light that mirrors and glass throw onto other things, traced from the lights.
//!
//! A path belongs to the class C if its vertex next to the light is on something sharp, an object that only mirrors
//! and refracts in single directions or nearly so, and its vertex next to the camera is not and scatters over a density: in
//! Heckbert's notation L S (D|S)* D E. The path tracer finds such light only by chance, and of a lamp without extent
//! never; so it leaves the class out, and paths from the lights, which connect to the camera at every vertex, add it.
//! Of lamps without extent the class is wider, by all that no path from the camera finds: their light may be thrown in single
//! directions by what scatters, too, as by the coats of plastics and blends with mirrors, and the vertex next to the camera may be
//! on a narrow gloss if all before it were sharp. Of what stands out of other light from infinity, a sun or a texel many times as bright
//! as the mean, so is what is thrown in single directions by things of an end that scatter.
//! Every path of light belongs to one of the two, so nothing is lost and nothing counted twice, and no weights are
//! needed.
//!
//! Paths of the class begin toward something sharp. They are aimed at balls around it: by direction from a point of
//! a lamp, by place for light from infinity. Toward what has no end a lamp shines as it does. A pilot of paths with fixed random numbers learns which pairs of lamp
//! and ball, and which part of each ball, send light to the picture, and how many paths from the lights are worth one
//! from the camera; then all is frozen, so that the estimate stays unbiased and any split of the work agrees.

use super::guide::Guide;
use crate::math::{Frame, Ray, warp};
use crate::scene::Scene;
use crate::scene::casters::Ball;
use crate::scene::emission::{Emission, Freedom, Power};
use crate::scene::light::Light;
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// How the class C is traced from the lights.
#[derive(Clone, Debug)]
pub struct Caustics {
    /// For each object, whether it is sharp.
    pub casts: Vec<bool>,
    /// For each object, whether it throws light in single directions and scatters the rest.
    pub in_part: Vec<bool>,
    /// For each object, whether it is one of those and has no end.
    pub unending: Vec<bool>,
    /// For each light, whether its part of the class is traced from it.
    pub traced: Vec<bool>,
    /// Pairs of a light and what it is aimed at, those of one light together.
    pub sources: Vec<Source>,
    /// Running sums of their probabilities.
    pub sums: Vec<f64>,
    /// Paths from the lights for each path from the camera.
    pub ratio: f64,
    /// Whether wavelengths that part in glass are followed together.
    pub packets: bool,
    /// Whether any wavelengths part in what casts.
    pub parts: bool,
    /// The first radius within which photons are collected where mirrors and glass are seen, metres.
    pub merging: Option<f64>,
}

/// A light and what it is aimed at.
#[derive(Clone, Debug)]
pub struct Source {
    /// The light.
    pub light: u32,
    /// What it is aimed at.
    pub target: Target,
    /// How often it is chosen.
    pub probability: f64,
    /// Where in the cone or disc around the ball, else in the square that the ray is drawn from.
    pub guide: Guide,
}

/// What a path is aimed at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Sharp things in a ball.
    Ball(Ball),
    /// Sharp things without end: the light shines as it does. Paths that first meet something else sharp do not count,
    /// as other sources send them.
    Endless,
    /// Whatever the light shines on: its rays have no freedom.
    Own,
}

/// The path that begins.
#[derive(Clone, Copy, Debug)]
pub struct Aimed {
    /// Its ray, and the power over all densities.
    pub emission: Emission,
    /// Index of the source.
    pub source: usize,
    /// What the source is aimed at.
    pub target: Target,
    /// Where in the guide's square.
    pub cell: DVec2,
}

/// The directions from a point to a ball, or the rays of a direction through it, mapped to the unit square by area.
enum Aim {
    /// A cone: frame, and 1 − cos of its half angle.
    Cone(Frame, f64),
    /// A disc across a direction: frame, centre, radius.
    Disc(Frame, DVec3, f64),
}

impl Aim {
    /// At `ball` from `point`.
    fn cone(ball: &Ball, point: DVec3) -> Aim {
        let offset = ball.center - point;
        let d2 = offset.length_squared();
        let sin2 = ball.radius * ball.radius / d2;
        // From inside, or so near that it makes no difference: all directions.
        if sin2.is_nan() || sin2 >= 1.0 {
            return Aim::Cone(Frame::from_normal(DVec3::Z), 2.0);
        }
        // 1 − √(1 − s²) without cancellation.
        Aim::Cone(Frame::from_normal(offset / d2.sqrt()), sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }

    /// At `ball` along `direction`.
    fn disc(ball: &Ball, direction: DVec3) -> Aim {
        Aim::Disc(Frame::from_normal(direction), ball.center, ball.radius)
    }

    /// Solid angle or area.
    fn measure(&self) -> f64 {
        match self {
            Aim::Cone(_, h) => TAU * h,
            Aim::Disc(_, _, radius) => PI * radius * radius,
        }
    }

    /// The direction, or the point of the disc, at `u` of the unit square.
    fn at(&self, u: DVec2) -> DVec3 {
        // Neighbours stay neighbours, so that what is found in a slit is not scattered over the square.
        let p = warp::concentric_disk(u);
        match self {
            Aim::Cone(frame, most) => {
                // 1 − cos is to its most as the square of the distance from the middle to that of the rim.
                let h = p.length_squared() * most;
                let r = (most * (2.0 - h)).max(0.0).sqrt();
                frame.to_world(DVec3::new(p.x * r, p.y * r, 1.0 - h))
            }
            Aim::Disc(frame, center, radius) => *center + (frame.s * p.x + frame.t * p.y) * *radius,
        }
    }

    /// The inverse of [`Aim::at`]; `None` outside.
    fn coordinates(&self, x: DVec3) -> Option<DVec2> {
        let p = match self {
            Aim::Cone(frame, most) => {
                let local = frame.to_local(x);
                // 1 − z, for narrow cones from the sine.
                let sin2 = local.x * local.x + local.y * local.y;
                let h = if local.z > 0.0 { sin2 / (1.0 + local.z) } else { 1.0 - local.z };
                let r = (most * (2.0 - h)).max(f64::MIN_POSITIVE).sqrt();
                if h >= *most {
                    return None;
                }
                DVec2::new(local.x, local.y) / r
            }
            Aim::Disc(frame, center, radius) => {
                let local = frame.to_local(x - *center);
                DVec2::new(local.x, local.y) / *radius
            }
        };
        (p.length_squared() < 1.0).then(|| warp::from_concentric_disk(p))
    }
}

impl Caustics {
    /// Begins a path: `u_source` chooses light and ball, `u_start` the point of the light or the direction of light
    /// from infinity, `u_aim` the rest. `None` where no light goes that way.
    #[must_use]
    pub fn begin(&self, scene: &Scene, u_source: f64, u_start: DVec2, u_aim: DVec2, nm: Lanes) -> Option<Aimed> {
        let index = self.sums.partition_point(|&sum| sum <= u_source);
        let source = self.sources.get(index)?;
        let light = source.light as usize;
        let aimed = |ray, power: Power, density: f64, cell| {
            let emission = Emission { ray, power: power.times(1.0 / density), light: source.light };
            Aimed { emission, source: index, target: source.target, cell }
        };
        let own_density = |cell| source.probability * source.guide.density(cell);
        let ball = match &source.target {
            Target::Ball(ball) => ball,
            Target::Own => {
                let cell = source.guide.sample(u_aim);
                let Freedom::None(ray, power) = scene.start(light, cell, cell, nm)?.freedom() else { return None };
                return Some(aimed(ray, power, own_density(cell), cell));
            }
            Target::Endless => {
                let cell = source.guide.sample(u_aim);
                let (ray, power) = scene.shine(light, u_start, cell, nm)?;
                return Some(aimed(ray, power, own_density(cell), cell));
            }
        };
        let start = scene.start(light, u_start, u_aim, nm)?;
        let cell = source.guide.sample(u_aim);
        let aim = |ball: &Ball, freedom: &Freedom| match *freedom {
            Freedom::Direction(from) => Aim::cone(ball, from),
            Freedom::Place(direction) | Freedom::None(Ray { direction, .. }, _) => Aim::disc(ball, direction),
        };
        let freedom = start.freedom();
        let own = aim(ball, &freedom);
        let x = own.at(cell);
        let mut density = own_density(cell) / own.measure();
        // Balls may hide each other: what any of them would have aimed at counts.
        let mut below = index;
        while below > 0 && self.sources[below - 1].light == source.light {
            below -= 1;
        }
        let of_light = self.sources[below..].iter().take_while(|other| other.light == source.light);
        for (i, other) in (below..).zip(of_light) {
            if i != index
                && let Target::Ball(ball) = &other.target
            {
                let aim = aim(ball, &freedom);
                if let Some(u) = aim.coordinates(x) {
                    density += other.probability * other.guide.density(u) / aim.measure();
                }
            }
        }
        let (ray, power) = match freedom {
            Freedom::Direction(_) => start.toward(x)?,
            Freedom::Place(direction) => {
                // From outside the ball, or everything that has an end.
                let (near, far) =
                    (2.0 * ball.radius, (ball.center - scene.center).length() + scene.radius + ball.radius);
                (scene.from_infinity(x, direction, near, far), start.irradiance())
            }
            Freedom::None(..) => return None,
        };
        Some(aimed(ray, power, density, cell))
    }

    /// The running sums of the probabilities of `sources`.
    #[must_use]
    pub fn sums(sources: &[Source]) -> Vec<f64> {
        let mut below = 0.0;
        let mut sum = |s: &Source| {
            below += s.probability;
            below
        };
        sources.iter().map(&mut sum).collect()
    }

    /// Paths from the lights for `samples` paths from the camera, at least one.
    #[must_use]
    pub fn paths(&self, samples: u64) -> u64 {
        ((samples as f64 * self.ratio).round() as u64).max(1)
    }

    /// Whether a path that is aimed at `target` counts where `object` is what it meets first, in `direction` from a `lamp`, if not from
    /// the camera.
    #[must_use]
    pub fn begins_at(&self, target: Target, object: u32, lamp: Option<&Light>, direction: DVec3) -> bool {
        let unending = self.unending[object as usize];
        let counts_in_part = |lamp: &Light| !lamp.may_be_met() || lamp.stands_out(-direction);
        (self.is_sharp(object) || self.in_part[object as usize] && lamp.is_some_and(counts_in_part))
            && match target {
                Target::Ball(_) => !unending,
                Target::Endless => unending,
                Target::Own => true,
            }
    }

    /// Whether `object`, which is not sharp, throws light that stands out in single directions, as far as paths from the lights find it.
    #[must_use]
    #[inline]
    pub fn throws_in_part(&self, object: u32) -> bool {
        self.in_part[object as usize] && !self.unending[object as usize]
    }

    /// Whether what a ray met at `object` is sharp.
    #[must_use]
    pub fn is_sharp(&self, object: u32) -> bool {
        self.casts[object as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The maps from the square and back agree to rounding, in wide, narrow and whole cones and on discs.
    #[test]
    fn aims_are_inverted() {
        let ball = Ball { center: DVec3::new(1.0, 2.0, -3.0), radius: 0.5 };
        let far = Ball { center: DVec3::new(1e6, 0.0, 0.0), radius: 1.0 };
        let aims = [
            Aim::cone(&ball, DVec3::ZERO),
            Aim::cone(&far, DVec3::ZERO),
            Aim::cone(&ball, ball.center + DVec3::new(0.1, 0.0, 0.0)),
            Aim::disc(&ball, DVec3::new(0.6, 0.0, 0.8)),
        ];
        for (k, aim) in aims.iter().enumerate() {
            for i in 0..100 {
                let u = DVec2::new((f64::from(i) + 0.5) / 100.0, 0.01 + 0.98 * (f64::from(i) * 0.618).fract());
                let back = aim.coordinates(aim.at(u)).unwrap();
                // A direction is good to 1e-16; at a distance of a million radii its angle from the axis is only to 1e-10.
                assert!((back - u).abs().max_element() < 1e-9, "{k}: {u} {back}");
            }
        }
        assert!(Aim::cone(&ball, DVec3::ZERO).coordinates(DVec3::X).is_none());
        // 1 − √(1 − 0.25/14)
        let cone = Aim::cone(&ball, DVec3::ZERO).measure();
        assert!((cone / (TAU * (1.0 - (1.0f64 - 0.25 / 14.0).sqrt())) - 1.0).abs() < 1e-12);
    }
}
