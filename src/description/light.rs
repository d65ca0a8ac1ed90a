//! Lights and fog as they are written.

use glam::DVec3;
use serde::Deserialize;

use super::emitter::{EnvironmentLight, Growth, ProjectorLight, check_weight};
use super::fault::Checker;
use super::material::given_fields;
use super::path::At;
use super::sky::SkyLight;
use super::spectrum::{Role, Spectrum, Vec3, one};
use super::transform::{check_place, parallel};
use crate::error::in_short;

/// A light that is not a surface. Surfaces emit by their field `emission`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Light {
    /// From a point in all directions.
    Point(PointLight),
    /// From a point into a cone.
    Spot(SpotLight),
    /// From infinity in one direction.
    Directional(DirectionalLight),
    /// From all directions alike.
    Constant(ConstantLight),
    /// From all directions, by an image.
    Environment(EnvironmentLight),
    /// A clear sky with its sun.
    Sky(Box<SkyLight>),
    /// A picture thrown from a point.
    Projector(ProjectorLight),
}

/// `point: {position: [0, 3, 0], intensity: 10}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointLight {
    /// For messages; default none.
    pub name: Option<String>,
    /// Metres.
    pub position: Vec3,
    /// W·sr⁻¹·nm⁻¹.
    pub intensity: Spectrum,
    /// How often the light is chosen, relative to its power; default 1. At 0 it is only seen, and lights what
    /// scattering happens to find it from.
    #[serde(default = "one")]
    pub sampling_weight: f64,
}

/// `spot: {position: [0, 3, 0], target: [0, 0, 0], intensity: 10}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenSpot")]
pub struct SpotLight {
    /// For messages; default none.
    pub name: Option<String>,
    /// Metres.
    pub position: Vec3,
    /// Where the axis points.
    pub aim: Aim,
    /// Angle between the axis and the edge of the light; default 20, at most 90.
    pub cutoff_deg: f64,
    /// Angle between the axis and the edge of the full intensity; default 3/4 of the cutoff.
    pub beam_deg: f64,
    /// On the axis, W·sr⁻¹·nm⁻¹.
    pub intensity: Spectrum,
    /// Name of a texture that the intensity is multiplied with; default none. It fills the square around the edge
    /// of the light, upright.
    pub texture: Option<String>,
    /// What is up in that texture; default `[0, 1, 0]`.
    pub up: Option<Vec3>,
    /// Which way its v grows; default `up`.
    pub v: Growth,
    /// See [`PointLight::sampling_weight`].
    pub sampling_weight: f64,
}

/// Where a spot light points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// At a point, metres.
    Target(Vec3),
    /// Along a vector of any length.
    Direction(Vec3),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenSpot {
    name: Option<String>,
    position: Vec3,
    target: Option<Vec3>,
    direction: Option<Vec3>,
    #[serde(default = "cutoff_deg")]
    cutoff_deg: f64,
    beam_deg: Option<f64>,
    intensity: Spectrum,
    texture: Option<String>,
    up: Option<Vec3>,
    #[serde(default)]
    v: Growth,
    #[serde(default = "one")]
    sampling_weight: f64,
}

fn cutoff_deg() -> f64 {
    20.0
}

impl TryFrom<WrittenSpot> for SpotLight {
    type Error = String;

    fn try_from(written: WrittenSpot) -> Result<SpotLight, String> {
        let aim = match (written.target, written.direction) {
            (Some(target), None) => Aim::Target(target),
            (None, Some(direction)) => Aim::Direction(direction),
            (target, direction) => {
                let given = [("target", target.is_some()), ("direction", direction.is_some())];
                return Err(format!("expected either target or direction, found {}", given_fields(&given)));
            }
        };
        Ok(SpotLight {
            name: written.name,
            position: written.position,
            aim,
            cutoff_deg: written.cutoff_deg,
            beam_deg: written.beam_deg.unwrap_or(0.75 * written.cutoff_deg),
            intensity: written.intensity,
            texture: written.texture,
            up: written.up,
            v: written.v,
            sampling_weight: written.sampling_weight,
        })
    }
}

impl SpotLight {
    /// The way the axis points, of any length.
    #[must_use]
    pub fn axis(&self) -> DVec3 {
        match self.aim {
            Aim::Target(target) => DVec3::from(target) - DVec3::from(self.position),
            Aim::Direction(direction) => direction.into(),
        }
    }
}

/// `directional: {direction: [0, -1, 0], irradiance: 3}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectionalLight {
    /// For messages; default none.
    pub name: Option<String>,
    /// In which the light travels; any length.
    pub direction: Vec3,
    /// On a surface that faces it, W·m⁻²·nm⁻¹.
    pub irradiance: Spectrum,
    /// Angle of the disc that it comes from, degrees; default 0, all of it parallel. A disc is seen where nothing else is.
    #[serde(default)]
    pub angle_deg: f64,
    /// How often the light is chosen, relative to its power; default 1. At 0 it is only seen, and lights what
    /// scattering happens to find it from.
    #[serde(default = "one")]
    pub sampling_weight: f64,
}

/// `constant: {radiance: 1}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantLight {
    /// For messages; default none.
    pub name: Option<String>,
    /// W·m⁻²·sr⁻¹·nm⁻¹.
    pub radiance: Spectrum,
    /// How often the light is chosen, relative to its power; default 1. At 0 it is only seen, and lights what
    /// scattering happens to find it from.
    #[serde(default = "one")]
    pub sampling_weight: f64,
}

pub(crate) fn nothing() -> Spectrum {
    Spectrum::Number(0.0)
}

/// Fog by depth: what the picture shows fades to a colour.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenFog")]
pub struct Fog {
    /// Radiance of the fog, W·m⁻²·sr⁻¹·nm⁻¹.
    pub colour: Spectrum,
    /// How it thickens.
    pub law: FogLaw,
}

/// How fog thickens with the distance z from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FogLaw {
    /// From nothing at `start` to everything at `end`, metres.
    Linear {
        /// Metres.
        start: f64,
        /// Metres.
        end: f64,
    },
    /// By the exponential of density × z, or of its square.
    Exponential {
        /// m⁻¹.
        density: f64,
        /// Which; default `exp`.
        falloff: Falloff,
    },
}

/// The exponent of exponential fog.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Falloff {
    /// exp(−density z).
    #[default]
    Exp,
    /// exp(−(density z)²).
    Exp2,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenFog {
    colour: Spectrum,
    start: Option<f64>,
    end: Option<f64>,
    density: Option<f64>,
    falloff: Option<Falloff>,
}

impl TryFrom<WrittenFog> for Fog {
    type Error = String;

    fn try_from(written: WrittenFog) -> Result<Fog, String> {
        let WrittenFog { colour, start, end, density, falloff } = written;
        let law = match (start, end, density, falloff) {
            (Some(start), Some(end), None, None) => FogLaw::Linear { start, end },
            (None, None, Some(density), falloff) => {
                FogLaw::Exponential { density, falloff: falloff.unwrap_or_default() }
            }
            (start, end, density, falloff) => {
                let given = [
                    ("start", start.is_some()),
                    ("end", end.is_some()),
                    ("density", density.is_some()),
                    ("falloff", falloff.is_some()),
                ];
                return Err(format!("expected either start and end, or density, found {}", given_fields(&given)));
            }
        };
        Ok(Fog { colour, law })
    }
}

impl Light {
    /// Whether it comes from all around, and is seen where nothing else is.
    #[must_use]
    pub fn is_around(&self) -> bool {
        matches!(self, Light::Constant(_) | Light::Environment(_) | Light::Sky(_))
    }

    /// The key under which the light is written.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Light::Point(_) => "point",
            Light::Spot(_) => "spot",
            Light::Directional(_) => "directional",
            Light::Constant(_) => "constant",
            Light::Environment(_) => "environment",
            Light::Sky(_) => "sky",
            Light::Projector(_) => "projector",
        }
    }

    /// Its name, where it has one.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        match self {
            Light::Point(light) => light.name.as_deref(),
            Light::Spot(light) => light.name.as_deref(),
            Light::Directional(light) => light.name.as_deref(),
            Light::Constant(light) => light.name.as_deref(),
            Light::Environment(light) => light.name.as_deref(),
            Light::Sky(light) => light.name.as_deref(),
            Light::Projector(light) => light.name.as_deref(),
        }
    }

    /// Its name, given or made from kind and number.
    #[must_use]
    pub fn name_or_kind(&self, number: usize) -> String {
        self.name().map_or_else(|| format!("{}{number}", self.kind()), str::to_owned)
    }

    /// How often the light is chosen, relative to its power.
    #[must_use]
    pub fn sampling_weight(&self) -> f64 {
        match self {
            Light::Point(l) => l.sampling_weight,
            Light::Spot(l) => l.sampling_weight,
            Light::Directional(l) => l.sampling_weight,
            Light::Constant(l) => l.sampling_weight,
            Light::Environment(l) => l.sampling_weight,
            Light::Sky(l) => l.sampling_weight,
            Light::Projector(l) => l.sampling_weight,
        }
    }

    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        let at = at.key(self.kind());
        check_weight(self.sampling_weight(), at, checker);
        match self {
            Light::Point(point) => {
                check_place(point.position, at.key("position"), checker);
                point.intensity.check(Role::Emission, at.key("intensity"), checker);
            }
            Light::Spot(spot) => {
                check_place(spot.position, at.key("position"), checker);
                match spot.aim {
                    Aim::Target(target) => {
                        check_place(target, at.key("target"), checker);
                        checker.require(
                            target != spot.position,
                            at.key("target"),
                            "a point other than the position",
                            target,
                        );
                    }
                    Aim::Direction(direction) => checker.direction(at.key("direction"), direction),
                }
                let cutoff = spot.cutoff_deg;
                checker.require(
                    cutoff > 0.0 && cutoff <= 90.0,
                    at.key("cutoff_deg"),
                    "an angle above 0 and up to 90 degrees",
                    cutoff,
                );
                if cutoff > 0.0 {
                    checker.require(
                        (0.0..=cutoff).contains(&spot.beam_deg),
                        at.key("beam_deg"),
                        &format!("an angle from 0 to cutoff_deg, {} degrees", in_short(cutoff)),
                        spot.beam_deg,
                    );
                }
                spot.intensity.check(Role::Emission, at.key("intensity"), checker);
                if let Some(texture) = &spot.texture {
                    checker.texture(at.key("texture"), texture);
                    // The picture is as wide as the tangent of that.
                    checker.require(
                        cutoff != 90.0,
                        at.key("cutoff_deg"),
                        "an angle below 90 degrees where the spot throws a picture",
                        cutoff,
                    );
                    let upright = !parallel(spot.axis().into(), spot.up.unwrap_or([0.0, 1.0, 0.0]));
                    let found = format_args!("one along it");
                    checker.require(upright, at.key("up"), "a direction that is not along the axis", found);
                }
            }
            Light::Directional(directional) => {
                checker.direction(at.key("direction"), directional.direction);
                directional.irradiance.check(Role::Emission, at.key("irradiance"), checker);
                let angle = directional.angle_deg;
                // Smaller ones end in what f64 tells apart.
                let within = angle == 0.0 || (1e-4..=180.0).contains(&angle);
                checker.require(within, at.key("angle_deg"), "0, or an angle from 0.0001 to 180 degrees", angle);
            }
            Light::Constant(constant) => constant.radiance.check(Role::Emission, at.key("radiance"), checker),
            Light::Environment(environment) => environment.check(at, checker),
            Light::Sky(sky) => sky.check(at, checker),
            Light::Projector(projector) => projector.check(at, checker),
        }
    }
}

impl Fog {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        self.colour.check(Role::Emission, at.key("colour"), checker);
        match self.law {
            FogLaw::Linear { start, end } => {
                checker.not_negative(at.key("start"), start);
                checker.require(
                    end > start,
                    at.key("end"),
                    &format!("a distance beyond start, {} m", in_short(start)),
                    end,
                );
            }
            FogLaw::Exponential { density, .. } => checker.not_negative(at.key("density"), density),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    /// Faults of a light whose kind starts at 3:3.
    fn light(written: &str) -> String {
        faults(&format!("lights:\n- {written}"))
    }

    #[test]
    fn a_spot_has_one_aim() {
        let spot = |fields: &str| light(&format!("spot: {{position: [0, 1, 0], intensity: 1{fields}}}"));
        let place = "dir/s.yaml:3:9: lights[0].spot: expected either target or direction, found ";
        assert_eq!(spot(""), format!("{place}neither"));
        assert_eq!(spot(", target: [0, 0, 0], direction: [0, 1, 0]"), format!("{place}target and direction"));
        assert_eq!(
            spot(", target: [0, 1, 0]"),
            "dir/s.yaml:3:53: lights[0].spot.target: expected a point other than the position, found [0, 1, 0]"
        );
        assert_eq!(
            spot(", direction: [0, 0, 0]"),
            "dir/s.yaml:3:56: lights[0].spot.direction: expected a vector with a direction, found [0, 0, 0]"
        );
    }

    #[test]
    fn lamps_are_as_near_as_all_things() {
        for (lamp, column) in [("point", 21), ("spot", 20)] {
            let aim = if lamp == "spot" { ", target: [0, 0, 0]" } else { "" };
            assert_eq!(
                light(&format!("{lamp}: {{position: [0, 1.0e61, 0], intensity: 1{aim}}}")),
                format!(
                    "dir/s.yaml:3:{column}: lights[0].{lamp}.position: expected three numbers up to 1e60, found [0, 1e61, 0]"
                )
            );
        }
    }

    #[test]
    fn the_beam_lies_within_the_cutoff_and_that_within_90_degrees() {
        let spot =
            |fields: &str| light(&format!("spot: {{position: [0, 1, 0], target: [0, 0, 0], intensity: 1, {fields}}}"));
        for cutoff in ["0", "90.5"] {
            assert_eq!(
                spot(&format!("cutoff_deg: {cutoff}")),
                format!(
                    "dir/s.yaml:3:76: lights[0].spot.cutoff_deg: expected an angle above 0 and up to 90 degrees, found {cutoff}"
                )
            );
        }
        assert_eq!(
            spot("cutoff_deg: 30, beam_deg: 31"),
            "dir/s.yaml:3:90: lights[0].spot.beam_deg: expected an angle from 0 to cutoff_deg, 30 degrees, found 31"
        );
        assert_eq!(spot("cutoff_deg: 90, beam_deg: 90"), "none");
        let told = spot("cutoff_deg: 90, texture: t");
        assert!(
            told.contains("expected an angle below 90 degrees where the spot throws a picture, found 90"),
            "{told}"
        );
    }

    #[test]
    fn lights_give_and_do_not_take() {
        assert_eq!(
            light("point: {position: [0, 0, 0], intensity: -1}"),
            "dir/s.yaml:3:43: lights[0].point.intensity: expected a number of 0 or more, found -1"
        );
        assert_eq!(
            light("directional: {direction: [0, 0, 0], irradiance: -1}"),
            "dir/s.yaml:3:28: lights[0].directional.direction: expected a vector with a direction, found [0, 0, 0]\n\
             dir/s.yaml:3:51: lights[0].directional.irradiance: expected a number of 0 or more, found -1"
        );
        assert_eq!(
            light("directional: {direction: [0, -1, 0], irradiance: 1, angle_deg: 181}"),
            "dir/s.yaml:3:66: lights[0].directional.angle_deg: expected 0, or an angle from 0.0001 to 180 degrees, found 181"
        );
        assert_eq!(
            light("environment: {file: sky.exr, scale: -1}"),
            "dir/s.yaml:3:39: lights[0].environment.scale: expected a number of 0 or more, found -1"
        );
    }

    #[test]
    fn fog_has_one_law() {
        let place = "dir/s.yaml:2:6: fog: expected either start and end, or density, found ";
        assert_eq!(faults("fog: {colour: 1}"), format!("{place}neither"));
        assert_eq!(faults("fog: {colour: 1, start: 1}"), format!("{place}start"));
        assert_eq!(
            faults("fog: {colour: 1, start: 1, end: 2, density: 3}"),
            format!("{place}start and end and density")
        );
        assert_eq!(
            faults("fog: {colour: -1, start: 5, end: 5}"),
            "dir/s.yaml:2:15: fog.colour: expected a number of 0 or more, found -1\n\
             dir/s.yaml:2:34: fog.end: expected a distance beyond start, 5 m, found 5"
        );
        assert_eq!(
            faults("fog: {colour: 1, density: -1}"),
            "dir/s.yaml:2:27: fog.density: expected a number of 0 or more, found -1"
        );
        let law = |fields: &str| scene(&format!("fog: {{colour: 1, {fields}}}")).fog.map(|fog| fog.law);
        assert_eq!(law("density: 2"), Some(FogLaw::Exponential { density: 2.0, falloff: Falloff::Exp }));
        assert_eq!(
            law("density: 2, falloff: exp2"),
            Some(FogLaw::Exponential { density: 2.0, falloff: Falloff::Exp2 })
        );
    }
}
