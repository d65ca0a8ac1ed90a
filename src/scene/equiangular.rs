//! Distances along a ray through a medium, drawn toward lamps (Kulla and Fajardo 2012, "Importance Sampling Techniques for Path
//! Tracing in Participating Media", section 4).
//!
//! What such a lamp throws onto a ray goes as 1/r², which flights drawn by the medium's extinction know nothing of: near the lamp a
//! few of them would be very bright. Distances whose density goes as 1/r² are even in the angle at which the lamp sees them. A spot
//! sees only what is in its cone, and a lamp with extent is taken to be in the middle of its box. Light is still found at the ends of
//! flights, too; the two share it by their densities.

use super::Object;
use super::light::Light;
use crate::math::Ray;
use crate::math::elementary::atan2;
use crate::math::trig::sin_cos_turn;
use crate::math::warp::one_minus_cos;
use arrayvec::ArrayVec;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Lamps among which is chosen; each of them is judged on every stretch.
pub const MOST: usize = 8;

/// A lamp, as a point.
#[derive(Clone, Debug)]
pub struct Lamp {
    /// Its index among the lights.
    pub light: u32,
    /// Whether it has an extent, so that what is scattered may meet it.
    pub has_extent: bool,
    place: DVec3,
    /// Share of the power of all, sr⁻¹.
    strength: f64,
    /// Axis and cosine of the half angle of the cone that it shines into, less than a right angle.
    cone: Option<(DVec3, f64)>,
}

/// What a lamp sees of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stretch {
    /// Distances along the ray, metres; the second may be infinite.
    from: f64,
    to: f64,
    /// Distance along the ray of the point that is nearest to the lamp, and from there to the lamp.
    foot: f64,
    height: f64,
    /// At which the lamp sees it, radians.
    angle: f64,
}

/// What lamps see of a ray.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The index of each among the lights, what it sees, and what it may throw onto that.
    all: ArrayVec<(u32, Stretch, f64), MOST>,
    total: f64,
}

/// Whether a light stands anywhere.
#[must_use]
pub fn stands(light: &Light) -> bool {
    light.position().is_some() || matches!(light, Light::Area { .. })
}

/// Those of `lights` that stand somewhere and have, by `share`, some of the power of all, those without extent first; where they are
/// more than [`MOST`], these alone, and none where they are more.
#[must_use]
pub fn lamps(lights: &[Light], objects: &[Object], share: impl Fn(usize) -> f64) -> Vec<Lamp> {
    let lamp = |(i, light): (usize, &Light)| {
        let (place, has_extent) = match light {
            Light::Area { object, .. } => {
                let bounds = objects[*object as usize].bounds();
                (bounds.is_finite().then(|| 0.5 * bounds.min + 0.5 * bounds.max)?, true)
            }
            _ => (light.position()?, false),
        };
        let (solid_angle, cone) = match light {
            Light::Spot { axis, beam, cutoff, .. } => {
                let cone = (*cutoff < FRAC_PI_2).then(|| (*axis, libm::cos(*cutoff)));
                (TAU * one_minus_cos(0.5 * (beam + cutoff)), cone)
            }
            _ => (4.0 * PI, None),
        };
        let strength = share(i) / solid_angle;
        (strength > 0.0).then_some(Lamp { light: i as u32, has_extent, place, strength, cone })
    };
    let (mut all, large): (Vec<Lamp>, Vec<Lamp>) =
        lights.iter().enumerate().filter_map(lamp).partition(|lamp| !lamp.has_extent);
    if all.len() + large.len() <= MOST {
        all.extend(large);
    }
    if all.len() > MOST { Vec::new() } else { all }
}

impl Seen {
    /// What `lamps` see of `ray` between the two distances of `span`.
    #[must_use]
    pub fn of(lamps: &[Lamp], ray: &Ray, span: (f64, f64)) -> Seen {
        let seen = |lamp: &Lamp| {
            let stretch = lamp.stretch(ray, span)?;
            Some((lamp.light, stretch, stretch.caught() * lamp.strength))
        };
        let all: ArrayVec<_, MOST> = lamps.iter().filter_map(seen).collect();
        let total = all.iter().map(|(.., weight)| weight).sum();
        Seen { all, total }
    }

    /// A light, chosen by what each may throw onto the ray, a distance at which it sees the ray, and the density of both, 1/m; by
    /// numbers in [0, 1).
    #[must_use]
    pub fn sample(&self, u_light: f64, u: f64) -> Option<(u32, f64, f64)> {
        let mut left = u_light * self.total;
        let found = self.all.iter().find(|(.., weight)| {
            left -= weight;
            left < 0.0
        });
        let &(light, stretch, _) = found.or(self.all.last())?;
        let t = stretch.sample(u);
        let density = self.density(light, t);
        (t.is_finite() && density > 0.0).then_some((light, t, density))
    }

    /// The density with which [`Seen::sample`] comes to `light` and the distance `t`, 1/m.
    #[must_use]
    pub fn density(&self, light: u32, t: f64) -> f64 {
        let own = self.all.iter().find(|(of, ..)| *of == light);
        own.map_or(0.0, |(_, stretch, weight)| weight / self.total * stretch.density(t))
    }
}

impl Lamp {
    /// What it sees of `ray` between the two distances of `span`; `None` where that is nothing, or next to it.
    fn stretch(&self, ray: &Ray, span: (f64, f64)) -> Option<Stretch> {
        let to_lamp = self.place - ray.origin;
        let (from, to) = match self.cone {
            Some((axis, cos)) => lit(-to_lamp, ray.direction, axis, cos, span)?,
            None => span,
        };
        if from >= to {
            return None;
        }
        let (foot, height) = (to_lamp.dot(ray.direction), to_lamp.cross(ray.direction).length());
        let (a, b) = (from - foot, to - foot);
        // The angle between the ways to both ends, without the difference of two.
        let angle = match b.is_finite() {
            true => atan2(height * (b - a), height.mul_add(height, a * b)),
            false => atan2(height, a),
        };
        let stretch = Stretch { from, to, foot, height, angle };
        // A ray through the lamp itself is left to flights.
        (angle > 0.0 && stretch.caught().is_finite()).then_some(stretch)
    }
}

impl Stretch {
    /// ∫ 1/r² along it, 1/m.
    fn caught(&self) -> f64 {
        self.angle / self.height
    }

    /// A distance on it, by `u` in [0, 1).
    fn sample(&self, u: f64) -> f64 {
        let (sin, cos) = sin_cos_turn(self.angle * u / TAU);
        // D tan(α + φ) − D tan α, where tan α = a / D.
        let a = self.from - self.foot;
        let on = sin * self.height.mul_add(self.height, a * a) / (self.height * cos - a * sin);
        (self.from + on.max(0.0)).min(self.to)
    }

    /// The density of [`Stretch::sample`] at distance `t`, 1/m.
    fn density(&self, t: f64) -> f64 {
        if t < self.from || t > self.to {
            return 0.0;
        }
        let s = t - self.foot;
        1.0 / (self.caught() * self.height.mul_add(self.height, s * s))
    }
}

/// The part of `span` of a ray that is in a cone. `origin` is seen from the apex.
fn lit(origin: DVec3, direction: DVec3, axis: DVec3, cos: f64, span: (f64, f64)) -> Option<(f64, f64)> {
    let (f, g) = (origin.dot(axis), direction.dot(axis));
    // Where (f + t g)² = cos² |origin + t direction|²: a t² + 2 b t + c = 0.
    let cos2 = cos * cos;
    let (a, b, c) = (g * g - cos2, f * g - cos2 * origin.dot(direction), f * f - cos2 * origin.length_squared());
    let discriminant = b * b - a * c;
    if a == 0.0 {
        return Some(span);
    }
    if discriminant <= 0.0 {
        return None;
    }
    let q = -(b + b.signum() * discriminant.sqrt());
    let (one, other) = (q / a, c / q);
    let (near, far) = (one.min(other), one.max(other));
    // Along the cone a ray leaves one nappe and is later in the other; across it is in one of them between the two.
    let (from, to) = match (a > 0.0, g > 0.0) {
        (true, true) => (far, span.1),
        (true, false) => (span.0, near),
        (false, _) if f + 0.5 * (near + far) * g > 0.0 => (near, far),
        (false, _) => return None,
    };
    Some((from.max(span.0), to.min(span.1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shape::testing::Random;

    fn lamp(light: u32, place: DVec3, strength: f64, cone: Option<(DVec3, f64)>) -> Lamp {
        Lamp { light, has_extent: false, place, strength, cone }
    }

    /// Rays about lamps at any scale, with and without cones and ends.
    fn cases() -> impl Iterator<Item = (Vec<Lamp>, Ray, (f64, f64), f64)> {
        let mut random = Random::new(7);
        (0..400).map(move |k| {
            let scale = 10f64.powi([0, -9, 9, -60, 60][k % 5]);
            let mut place = || DVec3::from([0; 3].map(|_| scale * (4.0 * random.pair().x - 2.0)));
            let [a, b, origin] = [0; 3].map(|_| place());
            let [direction, axis] = [0; 2].map(|_| place().normalize());
            let u = random.pair();
            let cone = (k % 3 != 0).then(|| (axis, libm::cos(0.01 + 1.5 * u.x)));
            let from = if k % 4 == 0 { scale * u.x } else { 0.0 };
            let to = if k % 2 == 0 { f64::INFINITY } else { scale * (1.0 + 5.0 * u.y) };
            (vec![lamp(3, a, 2.0, cone), lamp(5, b, 1.0, None)], Ray::new(origin, direction), (from, to), scale)
        })
    }

    /// Of even numbers as many distances fall short of each of them as the density says, by the angle that the lamp sees up to there.
    #[test]
    fn distances_have_their_density() {
        for (lamps, ray, span, scale) in cases() {
            let seen = Seen::of(&lamps, &ray, span);
            assert_eq!(seen.all.iter().filter(|(light, ..)| *light == 5).count(), 1);
            for (light, stretch, weight) in &seen.all {
                assert!(stretch.from >= span.0 && stretch.to <= span.1 && stretch.from < stretch.to);
                let place = lamps.iter().find(|lamp| lamp.light == *light).unwrap().place;
                for i in 0..16 {
                    let u = (f64::from(i) + 0.5) / 16.0;
                    let t = stretch.sample(u);
                    assert!(t >= stretch.from && t <= stretch.to, "{t} {stretch:?}");
                    // By the triangle of the lamp, the start and there.
                    let [a, b] = [stretch.from, t].map(|t| (ray.at(t) - place) / scale);
                    let up_to = libm::atan2(a.cross(b).length(), a.dot(b));
                    assert!((up_to - u * stretch.angle).abs() < 1e-9, "{up_to} {u} {stretch:?}");
                    // dθ/dt = h / r².
                    let r2 = b.length_squared() * scale * scale;
                    let expected = stretch.height / (r2 * stretch.angle) * weight / seen.total;
                    let density = seen.density(*light, t);
                    assert!((density / expected - 1.0).abs() < 1e-6, "{density} {expected}");
                }
            }
        }
    }

    /// A spot is chosen only for what is in its cone, and all of that: points of the ray are, where the lamp sees them within it.
    #[test]
    fn a_spot_sees_what_is_in_its_cone() {
        let mut inside = 0;
        for (lamps, ray, (from, to), scale) in cases() {
            let Some((axis, cos)) = lamps[0].cone else { continue };
            let seen = lamps[0].stretch(&ray, (from, to));
            for i in 0..64 {
                let t = from + (to.min(from + 8.0 * scale) - from) * (f64::from(i) + 0.5) / 64.0;
                let angle = (ray.at(t) - lamps[0].place).normalize().dot(axis) - cos;
                // Within rounding of the edge either is right.
                if angle.abs() > 1e-9 {
                    let is_seen = seen.is_some_and(|stretch| (stretch.from..=stretch.to).contains(&t));
                    assert_eq!(is_seen, angle > 0.0, "{t} {seen:?} {angle}");
                    inside += u32::from(is_seen);
                }
            }
        }
        assert!(inside > 500, "{inside}");
    }

    /// A ray through the lamp, of no length, away from all cones, or beyond what a number holds: none is chosen, and nothing is NaN.
    #[test]
    fn what_no_lamp_sees_is_left_to_flights() {
        let at = |place, cone| [lamp(0, place, 1.0, cone)];
        let ray = Ray::new(DVec3::ZERO, DVec3::X);
        let forward = Some((DVec3::X, 0.9));
        for (lamps, span) in [
            (at(DVec3::X, None), (0.0, 2.0)),
            (at(DVec3::ZERO, None), (0.0, f64::INFINITY)),
            (at(DVec3::Y, None), (1.0, 1.0)),
            (at(DVec3::Y, None), (2.0, 1.0)),
            (at(DVec3::X, forward), (0.0, 0.5)),
            (at(DVec3::new(0.0, 1e200, 0.0), None), (0.0, 1.0)),
            (at(DVec3::new(1.0, 1e-310, 0.0), None), (0.0, 2.0)),
        ] {
            let seen = Seen::of(&lamps, &ray, span);
            for u in [0.0, 0.5, 1.0 - f64::EPSILON] {
                if let Some((_, t, density)) = seen.sample(u, u) {
                    assert!(
                        t >= span.0 && t <= span.1 && density > 0.0 && density.is_finite(),
                        "{lamps:?} {t} {density}"
                    );
                }
                assert!(seen.density(0, 0.5).is_finite());
            }
        }
        assert!(Seen::of(&at(DVec3::X, None), &ray, (0.0, 2.0)).sample(0.5, 0.5).is_none());
    }
}
