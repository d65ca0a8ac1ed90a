//! A picture thrown from a point, as if by a pinhole camera run backward.

use super::light::Arriving;
use super::texture::{Texture, TexturePoint};
use crate::math::Ray;
use crate::spectrum::{Lanes, Spectrum};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::f64::consts::PI;

/// A projector.
#[derive(Clone, Debug)]
pub struct Projector {
    /// Where it stands.
    position: DVec3,
    /// Columns: right on the picture, up, the way it shines. Unit, at right angles.
    axes: DMat3,
    /// From the middle of the picture to where u and v are one, at distance one; may be negative.
    half: DVec2,
    /// Irradiance over π of a screen across the axis at a distance of one metre, as it varies over the
    /// picture.
    irradiance: Texture,
    scale: f32,
}

/// A cone from a point.
#[derive(Clone, Copy, Debug)]
pub struct Cone {
    /// Where it begins.
    pub apex: DVec3,
    /// Its middle, unit.
    pub axis: DVec3,
    /// From the middle to what is farthest from it, radians.
    pub half_angle: f64,
    /// What is lit of it, sr.
    pub solid_angle: f64,
}

impl Projector {
    /// Where it stands, whither it shines, and what is right on its picture.
    #[must_use]
    pub fn pose(&self) -> [DVec3; 3] {
        [self.position, self.axes.z_axis, self.axes.x_axis]
    }

    /// A projector that throws a picture `half` wide and high, to each side, at distance one. With a negative
    /// height v grows downward.
    #[must_use]
    pub fn new(world_from_projector: DAffine3, half: DVec2, irradiance: Texture, scale: f64) -> Projector {
        let (axes, position) = (world_from_projector.matrix3, world_from_projector.translation);
        Projector { position, axes, half, irradiance, scale: scale as f32 }
    }

    /// Where it stands.
    #[must_use]
    pub fn position(&self) -> DVec3 {
        self.position
    }

    /// The way it shines, unit.
    #[must_use]
    pub fn axis(&self) -> DVec3 {
        self.axes.z_axis
    }

    /// Moves it by `step`, metres.
    pub fn shift(&mut self, step: DVec3) {
        self.position += step;
    }

    /// Light at `from`.
    ///
    /// An angle θ off the axis the screen one metre away is at a distance of 1 / cos θ and inclined by
    /// θ: E = π T there is an intensity of π T / cos³θ. At depth z, distance z / cos θ, that makes an
    /// irradiance across the light of π T / (z² cos θ).
    #[must_use]
    pub fn arriving(&self, from: DVec3, nm: Lanes) -> Option<Arriving> {
        let offset = from - self.position;
        let local = self.axes.transpose() * offset;
        if local.z <= 0.0 {
            return None;
        }
        let uv = 0.5 + 0.5 * local.truncate() / (local.z * self.half);
        let inside = uv.cmpge(DVec2::ZERO).all() && uv.cmple(DVec2::ONE).all();
        if !inside {
            return None;
        }
        let distance = offset.length();
        let factor = PI * distance / (local.z * local.z * local.z);
        Some(Arriving {
            wi: -offset / distance,
            distance,
            radiance: self.thrown(uv, nm) * (self.scale * factor as f32),
            density: None,
            target: None,
        })
    }

    /// A ray through a point of the picture that `u` chooses, and its power over its density, W·nm⁻¹.
    ///
    /// The intensity π T / cos³θ over the density by solid angle of a point uniform on the screen at distance one,
    /// 1 / (area cos³θ).
    #[must_use]
    pub fn emit(&self, u: DVec2, nm: Lanes) -> (Ray, Lanes) {
        let place = (2.0 * u - 1.0) * self.half;
        let direction = (self.axes * place.extend(1.0)).normalize();
        let factor = PI * 4.0 * (self.half.x * self.half.y).abs();
        (Ray::new(self.position, direction), self.thrown(u, nm) * (self.scale * factor as f32))
    }

    /// What the picture is at `uv`. What varies in space has one value, that where the projector stands, so that light met from
    /// its two ends is the same.
    fn thrown(&self, uv: DVec2, nm: Lanes) -> Lanes {
        self.irradiance.eval(&TexturePoint { uv, point: self.position, ..TexturePoint::default() }, nm)
    }

    /// The cone that holds its light.
    #[must_use]
    pub fn cone(&self) -> Cone {
        let half = self.half.abs();
        // Of a rectangle seen from above its middle (Oosterom and Strackee 1983, four corners).
        let solid_angle = 4.0 * libm::atan2(half.x * half.y, (1.0 + half.length_squared()).sqrt());
        Cone { apex: self.position, axis: self.axes.z_axis, half_angle: libm::atan(half.length()), solid_angle }
    }

    /// Whether it sends out nothing.
    #[must_use]
    pub fn is_dark(&self) -> bool {
        self.scale == 0.0 || self.irradiance.is_black()
    }

    /// Luminous power, film units times m²: that which falls on the screen.
    #[must_use]
    pub fn power(&self) -> f64 {
        4.0 * (self.half.x * self.half.y).abs() * PI * f64::from(self.scale) * self.irradiance.mean_luminance()
    }

    /// Spectra of its light and their shares.
    #[must_use]
    pub fn shares(&self) -> Vec<(f64, Spectrum)> {
        self.irradiance.shares()
    }

    /// Spectra of its light.
    #[must_use]
    pub fn spectra(&self) -> Vec<Spectrum> {
        self.irradiance.representatives()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::camera::Camera;
    use crate::scene::texture::Wrap;
    use crate::scene::volume::{Between, GridVolume, Volume, Voxels};
    use glam::DAffine2;
    use std::sync::Arc;

    /// Black to the left, 1 on the right half.
    fn slide() -> Texture {
        let cell = |v| Box::new(Texture::Uniform(Spectrum::Constant(v)));
        // One period is two cells wide and two high; the second coordinate stays in its first cell.
        let uv = DAffine2::from_cols(DVec2::new(1.0, 0.0), DVec2::ZERO, DVec2::new(0.0, 0.25));
        Texture::Checkerboard { a: cell(0.0), b: cell(1.0), uv }
    }

    fn projector(irradiance: Texture) -> Projector {
        let place = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 0.0), DVec3::Y).unwrap();
        Projector::new(place, DVec2::new(2.0, 1.0), irradiance, 3.0)
    }

    /// A uniform slide lights a screen across the axis evenly: E = π · scale / z², wherever on it.
    #[test]
    fn a_screen_across_the_beam_is_lit_evenly_and_by_the_square_of_its_distance() {
        let projector = projector(Texture::one());
        for z in [0.5, 1.0, 4.0] {
            for (x, y) in [(0.0, 0.0), (1.9, 0.9), (-1.9, 0.5), (0.3, -0.99)] {
                let screen = DVec3::new(1.0 + x * z, 2.0 + y * z, 3.0 - z);
                let light = projector.arriving(screen, Lanes::splat(550.0)).unwrap();
                let found = f64::from(light.radiance.to_array()[0]) * light.wi.z;
                // A handful of f32 roundings.
                assert!((found / (3.0 * PI / (z * z)) - 1.0).abs() < 1e-6, "{found}");
                assert!((light.distance - (screen - projector.position).length()).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn there_is_no_light_behind_and_beside_the_beam() {
        let projector = projector(Texture::one());
        for from in [DVec3::new(1.0, 2.0, 4.0), DVec3::new(3.01, 2.0, 2.0), DVec3::new(1.0, 0.99, 2.0), DVec3::NAN] {
            assert!(projector.arriving(from, Lanes::splat(550.0)).is_none(), "{from}");
        }
    }

    /// Seen from the projector, which looks along −z with y up, x grows to the right.
    #[test]
    fn the_picture_is_not_mirrored() {
        let projector = projector(slide());
        let at =
            |x: f64| projector.arriving(DVec3::new(x, 2.0, 2.0), Lanes::splat(550.0)).unwrap().radiance.to_array()[0];
        assert!(at(1.5) > 0.0 && at(0.5) == 0.0);
    }

    /// All light that the beam sends out falls on the screen: ∫ E over it, here π · 3 · mean of the slide (½)
    /// times 4 · 2 · 1 m².
    #[test]
    fn power_is_what_falls_on_the_screen() {
        assert!((projector(slide()).power() - 3.0 * PI * 0.5 * 8.0).abs() < 1e-6);
    }

    /// The same of its rays, in the mean over the slide, upright or upside down: f32 roundings.
    #[test]
    fn its_rays_carry_its_power_whichever_way_up() {
        let place = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 0.0), DVec3::Y).unwrap();
        for half in [DVec2::new(2.0, 1.0), DVec2::new(2.0, -1.0)] {
            let projector = Projector::new(place, half, slide(), 3.0);
            let power = |i: u32| {
                let u = DVec2::new((f64::from(i) + 0.5) / 64.0, 0.3);
                f64::from(projector.emit(u, Lanes::splat(550.0)).1.to_array()[0])
            };
            let mean = (0..64).map(power).sum::<f64>() / 64.0;
            assert!((mean / (3.0 * PI * 0.5 * 8.0) - 1.0).abs() < 1e-6, "{half} {mean}");
        }
    }

    /// A volume that is 1 where the projector stands and 5 beyond x = 2: where its light falls, and where its rays lead,
    /// the picture is 1 all the same. On its axis at distance 2 there arrives π · 3 / 4; its rays carry π · 3 · 8 m².
    #[test]
    fn a_volume_has_the_value_at_the_projector() {
        let (between, wrap) = (Between::Nearest, Wrap::Clamp);
        let local_from_world = DAffine3::from_scale(DVec3::splat(0.25));
        let values = Voxels::Grey([1.0, 5.0].into());
        let grid = GridVolume {
            size: [2, 1, 1],
            values,
            local_from_world,
            between,
            wrap,
            above_one: false,
            clamped: false,
            brightest: Default::default(),
        };
        let place = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(9.0, 2.0, 3.0), DVec3::Y).unwrap();
        let slide = Texture::Volume(Volume::Grid(Arc::new(grid)));
        let projector = Projector::new(place, DVec2::new(2.0, 1.0), slide, 3.0);
        let nm = Lanes::splat(550.0);
        let lit = projector.arriving(DVec3::new(3.0, 2.0, 3.0), nm).unwrap().radiance.to_array()[0];
        assert!((f64::from(lit) / (3.0 * PI / 4.0) - 1.0).abs() < 1e-6, "{lit}");
        let sent = projector.emit(DVec2::new(0.7, 0.2), nm).1.to_array()[0];
        assert!((f64::from(sent) / (3.0 * PI * 8.0) - 1.0).abs() < 1e-6, "{sent}");
    }
}
