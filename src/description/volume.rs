//! Volumes as they are written: spectra that vary through space.

use glam::{DMat3, DMat4};
use serde::Deserialize;

use super::fault::Checker;
use super::path::At;
use super::spectrum::{FilePath, Role, Spectrum};
use super::texture::Wrap;
use super::transform::{TransformStep, check_steps, matrix_of};

/// A spectrum at every point of space.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Volume {
    /// From a file.
    Grid(GridVolume),
    /// The same everywhere.
    Constant(ConstantVolume),
}

/// `grid: {file: smoke.vol}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridVolume {
    /// A grid of 32-bit floats in Mitsuba's format, with one channel or three. Three are a colour, linear Rec. 709.
    pub file: FilePath,
    /// Between the voxels' centres; default `trilinear`.
    #[serde(default)]
    pub filter: VolumeFilter,
    /// What lies beyond the grid; default `clamp`.
    #[serde(default = "clamp")]
    pub wrap: Wrap,
    /// Whether three channels are data, not colours; default false.
    #[serde(default)]
    pub raw: bool,
    /// Whether spectra of colours may exceed 1, as Mitsuba's do where the colours are strong, where the grid is an albedo or a
    /// reflectance: surfaces and media make light then. Default false.
    #[serde(default)]
    pub above_one: bool,
    /// Whether the grid fills the box that its file names, before the transform; default false: the unit cube from
    /// the origin to (1, 1, 1).
    #[serde(default)]
    pub file_box: bool,
    /// As of shapes; default none.
    #[serde(default)]
    pub transform: Vec<TransformStep>,
}

/// `constant: {value: 0.5}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantVolume {
    /// The spectrum.
    pub value: Spectrum,
    /// As of shapes, from the unit cube; it says where a medium of this extinction is. Default none.
    #[serde(default)]
    pub transform: Vec<TransformStep>,
}

/// What lies between the voxels' centres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VolumeFilter {
    /// A mean of the eight around.
    #[default]
    Trilinear,
    /// The voxel in which the point lies.
    Nearest,
}

/// A spectrum, or the name of a volume that gives one at each point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SpectrumOrVolume {
    /// `{volume: name}`.
    Volume(String),
    /// Any [`Spectrum`].
    #[serde(rename = "inline")]
    Spectrum(Spectrum),
}

/// A number, or the name of a volume that gives one at each point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum NumberOrVolume {
    /// `{volume: name}`.
    Volume(String),
    /// A number.
    Number(f64),
}

fn clamp() -> Wrap {
    Wrap::Clamp
}

impl Volume {
    /// The key under which the volume is written.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Volume::Grid(_) => "grid",
            Volume::Constant(_) => "constant",
        }
    }

    /// From the unit cube, or the file's box, to the world.
    #[must_use]
    pub fn world_from_local(&self) -> DMat4 {
        match self {
            Volume::Grid(grid) => matrix_of(&grid.transform),
            Volume::Constant(constant) => matrix_of(&constant.transform),
        }
    }

    /// Checks a volume; `role` is how the scene uses it.
    pub(crate) fn check(&self, role: Role, at: At<'_>, checker: &mut Checker<'_>) {
        let at = at.key(self.kind());
        let steps = match self {
            Volume::Grid(grid) => &grid.transform,
            Volume::Constant(constant) => {
                constant.value.check(role, at.key("value"), checker);
                &constant.transform
            }
        };
        let _: Option<DMat3> = check_steps(steps, at.key("transform"), checker);
    }
}

impl SpectrumOrVolume {
    pub(crate) fn check<'a>(&'a self, role: Role, at: At<'_>, checker: &mut Checker<'a>) {
        match self {
            SpectrumOrVolume::Spectrum(spectrum) => spectrum.check(role, at, checker),
            SpectrumOrVolume::Volume(name) => {
                checker.volume(at.key("volume"), name);
                if role == Role::Reflectance {
                    checker.reflecting_volumes.insert(name);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    #[test]
    fn the_defaults_are_those_of_the_page() {
        let scene = scene("volumes: {a: {grid: {file: a.vol}}, b: {constant: {value: 1}}}");
        let Volume::Grid(grid) = &scene.volumes["a"] else { panic!("a grid") };
        assert_eq!(
            (grid.filter, grid.wrap, grid.raw, grid.file_box),
            (VolumeFilter::Trilinear, Wrap::Clamp, false, false)
        );
        assert_eq!(scene.volumes["b"].world_from_local(), DMat4::IDENTITY);
    }

    #[test]
    fn volumes_are_checked_by_their_use() {
        let used = |field: &str| {
            faults(&format!(
                "volumes: {{v: {{constant: {{value: 2}}}}}}\nmedia: {{m: {{heterogeneous: {{extinction: {{volume: v}}, {field}}}}}}}"
            ))
        };
        assert_eq!(used("albedo: 1"), "none");
        assert_eq!(
            used("albedo: {volume: v}"),
            "dir/s.yaml:2:33: volumes.v.constant.value: expected a number from 0 to 1, found 2"
        );
        assert_eq!(
            used("albedo: {volume: w}"),
            "dir/s.yaml:3:71: media.m.heterogeneous.albedo.volume: unknown volume \"w\"; did you mean \"v\"?"
        );
        assert_eq!(
            faults("volumes: {v: {grid: {file: a.vol, transform: [{scale: 0}]}}}"),
            "dir/s.yaml:2:55: volumes.v.grid.transform[0].scale: expected a number other than 0, found 0"
        );
    }
}
