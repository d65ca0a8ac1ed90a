//! Lights that throw a picture: environments and projectors.

use glam::{DMat3, DMat4};
use serde::Deserialize;

use super::camera::FovAxis;
use super::fault::Checker;
use super::path::At;
use super::spectrum::{FilePath, Role, Spectrum, SpectrumOrTexture, Vec3, one};
use super::transform::{TransformStep, check_view, is_similarity, parallel};
use crate::error::in_short;

/// `environment: {file: sky.exr}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentLight {
    /// For messages; default none.
    pub name: Option<String>,
    /// An image in latitude and longitude, linear (EXR, HDR or PFM) or sRGB (all others).
    pub file: FilePath,
    /// Factor; default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Turn about y, degrees; default 0.
    #[serde(default)]
    pub rotate_deg: f64,
    /// How directions fall on the image; default `texels`.
    #[serde(default)]
    pub mapping: EnvironmentMapping,
    /// Turns and mirrors the sphere of directions, after `rotate_deg`; moves and sizes do nothing. Default none.
    #[serde(default)]
    pub transform: Vec<TransformStep>,
    /// See [`super::PointLight::sampling_weight`].
    #[serde(default = "one")]
    pub sampling_weight: f64,
}

/// How directions fall on an image in latitude and longitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EnvironmentMapping {
    /// Rows are bands of latitude of equal height, the poles lie on the edges of the image, and its middle column
    /// looks along −z.
    #[default]
    Texels,
    /// That of Mitsuba 3: the first and the last row are the poles, the left edge looks along −z and columns to the
    /// right turn toward +x. Between texels colour and brightness are interpolated each by itself.
    Mitsuba,
}

/// `projector: {origin: [0, 2, 0], target: [0, 2, -1], fov_deg: 40, irradiance: {texture: slide}}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProjectorLight {
    /// For messages; default none.
    pub name: Option<String>,
    /// Where it stands, metres.
    pub origin: Vec3,
    /// What it shines at, metres.
    pub target: Vec3,
    /// What is up in the picture; default `[0, 1, 0]`.
    #[serde(default = "up")]
    pub up: Vec3,
    /// Full angle of the beam along the axis, degrees, between 0 and 180.
    pub fov_deg: f64,
    /// The axis; default `x`. The picture's sides are those of the image, a square without one.
    #[serde(default)]
    pub fov_axis: FovAxis,
    /// Irradiance over π on a screen one metre away across the beam, which is the radiance of that screen if it is
    /// white; W·m⁻²·sr⁻¹·nm⁻¹. Spectrum or texture; default D65 of luminance 1.
    #[serde(default = "white")]
    pub irradiance: SpectrumOrTexture,
    /// Which way the texture's v grows; default `up`.
    #[serde(default)]
    pub v: Growth,
    /// Factor; default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// See [`super::PointLight::sampling_weight`].
    #[serde(default = "one")]
    pub sampling_weight: f64,
}

/// Which way a coordinate grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Growth {
    /// Toward the top.
    #[default]
    Up,
    /// Toward the bottom: for a texture that stands on its head.
    Down,
}

fn up() -> Vec3 {
    [0.0, 1.0, 0.0]
}

fn white() -> SpectrumOrTexture {
    SpectrumOrTexture::Spectrum(super::Spectrum::Rgb([1.0; 3]))
}

/// Which way a surface sends its light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EmissionDirection {
    /// Equal radiance in every direction on the side of the normal.
    #[default]
    All,
    /// All of it along the normal: `emission` is then the power by area, W·m⁻²·nm⁻¹.
    Normal,
}

/// The greatest weight of a lamp.
const MOST_WEIGHT: f64 = 1e30;

/// How often lights are chosen is a number of 0 or more.
pub(crate) fn check_weight(weight: f64, at: At<'_>, checker: &mut Checker<'_>) {
    // Sums of them must be numbers, too.
    let at = at.key("sampling_weight");
    checker.not_negative(at, weight);
    checker.require(!weight.is_finite() || weight <= MOST_WEIGHT, at, "at most 1e30", in_short(weight));
}

impl EnvironmentLight {
    /// Map to world: turns and mirrors only.
    #[must_use]
    pub fn world_from_map(&self) -> DMat3 {
        sphere_transform(self.rotate_deg, &self.transform)
    }

    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        Spectrum::Number(self.scale).check(Role::Emission, at.key("scale"), checker);
        check_sphere(&self.transform, at.key("transform"), checker);
    }
}

/// What `steps` do, after a turn about y, to a sphere of directions: its size and place do not matter.
pub(crate) fn sphere_transform(rotate_deg: f64, steps: &[TransformStep]) -> DMat3 {
    let turn = DMat4::from_rotation_y(rotate_deg.to_radians());
    let steps = steps.iter().filter(|step| !matches!(step, TransformStep::Translate(_)));
    let linear = DMat3::from_mat4(steps.fold(turn, |before, step| step.matrix() * before));
    linear * (1.0 / libm::cbrt(linear.determinant().abs()))
}

/// That a sphere of directions stays one.
pub(crate) fn check_sphere(steps: &[TransformStep], at: At<'_>, checker: &mut Checker<'_>) {
    let before = checker.count();
    for (i, step) in steps.iter().enumerate() {
        step.check_in_list(at.index(i), checker);
    }
    if checker.count() == before {
        let map = sphere_transform(0.0, steps);
        let round = map.is_finite() && is_similarity(map);
        checker.require(round, at, "turns, mirrors and even scaling", "a transform that stretches or shears");
    }
}

impl ProjectorLight {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        let (origin, target) = (glam::DVec3::from(self.origin), glam::DVec3::from(self.target));
        let holds = check_view(self.origin, self.target, self.up, at, checker);
        if holds && parallel((target - origin).into(), self.up) {
            checker.fault(at.key("up"), "expected a direction that is not along the beam, found one along it");
        }
        let within = self.fov_deg > 0.0 && self.fov_deg < 180.0;
        checker.require(within, at.key("fov_deg"), "an angle between 0 and 180 degrees", self.fov_deg);
        Spectrum::Number(self.scale).check(Role::Emission, at.key("scale"), checker);
        match &self.irradiance {
            SpectrumOrTexture::Spectrum(spectrum) => spectrum.check(Role::Emission, at.key("irradiance"), checker),
            SpectrumOrTexture::Texture(name) => checker.texture(at.key("irradiance").key("texture"), name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Light;
    use super::super::testing::{faults, scene};
    use glam::DVec3;

    fn light(written: &str) -> String {
        faults(&format!("lights:\n- {written}"))
    }

    #[test]
    fn a_projector_has_a_beam_and_an_upright_picture() {
        let projector = |fields: &str| light(&format!("projector: {{origin: [0, 1, 0], {fields}}}"));
        assert_eq!(projector("target: [0, 1, 1], fov_deg: 40"), "none");
        assert_eq!(
            projector("target: [0, 1, 0], fov_deg: 180, sampling_weight: -1"),
            "dir/s.yaml:3:42: lights[0].projector.target: expected a point other than the origin, found [0, 1, 0]\n\
             dir/s.yaml:3:62: lights[0].projector.fov_deg: expected an angle between 0 and 180 degrees, found 180\n\
             dir/s.yaml:3:84: lights[0].projector.sampling_weight: expected a number of 0 or more, found -1"
        );
        assert_eq!(
            projector("target: [0, 2, 0], fov_deg: 40, irradiance: {texture: slide}"),
            "dir/s.yaml:3:14: lights[0].projector.up: expected a direction that is not along the beam, found one along it\n\
             dir/s.yaml:3:88: lights[0].projector.irradiance.texture: unknown texture \"slide\"; the scene defines none"
        );
    }

    #[test]
    fn an_environment_turns_and_does_not_stretch() {
        let map = |transform: &str| format!("environment: {{file: sky.exr, transform: {transform}}}");
        assert!(light(&map("[{scale: [1, 2, 1]}]")).contains("expected turns, mirrors and even scaling"));
        assert!(light(&map("[{rotate: {axis: [0, 0, 0], deg: 3}}]")).contains("expected a vector with a direction"));
        let written = map("[{scale: 3}, {rotate: {axis: [1, 0, 0], deg: 90}}, {translate: [5, 5, 5]}]");
        let scene = scene(&format!("lights:\n- {written}"));
        let Light::Environment(map) = &scene.lights[0] else { panic!("an environment") };
        // A quarter turn about x takes y to z.
        assert!((map.world_from_map() * DVec3::Y - DVec3::Z).length() < 1e-15);
    }

    #[test]
    fn light_along_the_normal_is_a_light() {
        assert_eq!(
            faults("shapes:\n- disk: {normal: [0, 1, 0], radius: 1, emission_direction: normal, sampling_weight: 2}"),
            "dir/s.yaml:3:60: shapes[0].disk.emission_direction: expected emission, found none"
        );
    }
}
