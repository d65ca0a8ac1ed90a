//! Volumes, media and phase functions.

use super::Compiler;
use super::spectra::Role;
use crate::description as written;
use crate::error::{Error, Result, in_short};
use crate::optics::phase::{Phase, PhaseTable};
use crate::scene::grid::Grid;
use crate::scene::medium::{Filling, Medium, PhaseBlend, PhaseFunction, Varying};
use crate::scene::texture::Wrap;
use crate::scene::volume::{Between, GridVolume, Unplaced, Volume, Voxels};
use crate::scene::{Geometry, Object, Scene};
use crate::spectrum::{Carried, Outside, Spectrum};
use glam::{DAffine3, DVec3};
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// What a volume is asked for.
#[derive(Clone, Copy, PartialEq)]
enum Use {
    Spectrum,
    Number,
}

/// Mean free paths across the thickest volume: a ray may take a step for each, and a sample of a cloud of half as many 0.15 s.
const THICKEST: f64 = 1e7;

impl Compiler<'_> {
    pub(super) fn volume(&mut self, at: &str, volume: &written::Volume) -> Result<Volume> {
        let world_from_local = DAffine3::from_mat4(volume.world_from_local());
        match volume {
            written::Volume::Constant(constant) => Ok(Volume::Constant {
                value: self.coefficient(&format!("{at}.constant.value"), &constant.value),
                local_from_world: world_from_local.inverse(),
            }),
            written::Volume::Grid(grid) => {
                self.files.push(grid.file.to_path_buf());
                let carried = self.shelf.carried;
                let read = self.shelf.volumes.get(&grid.file, grid.raw, || read_grid(&grid.file, grid.raw, carried));
                let placed = read.and_then(|read| place_grid(grid, read, world_from_local));
                Ok(Volume::Grid(Arc::new(placed.map_err(|e| self.asked(&format!("{at}.grid.file"), e))?)))
            }
        }
    }

    /// A spectrum that is 0 or more. A colour within [0, 1] is upsampled as a reflectance, one beyond with a
    /// factor (the convention of Mitsuba 3, which refuses the latter).
    fn coefficient(&mut self, at: &str, s: &written::Spectrum) -> Spectrum {
        let role = match s {
            written::Spectrum::Rgb(rgb) if rgb.iter().all(|v| *v <= 1.0) => Role::Reflectance,
            _ => Role::Coefficient,
        };
        self.spectrum(at, s, Outside::Hold, role)
    }

    /// A volume by its name, if it can be what it is asked for.
    fn named_volume(&mut self, at: &str, name: &str, asked: Use) -> Volume {
        let volume = self.volumes[name].clone();
        if let Volume::Grid(grid) = &volume {
            let fault = match (&grid.values, asked) {
                (Voxels::Raw(_), Use::Spectrum) => Some("expected a volume of spectra, found one of raw numbers"),
                (Voxels::Coloured(_), Use::Number) => {
                    Some("expected a volume of numbers (one channel, or raw), found one of colours")
                }
                _ => None,
            };
            if let Some(fault) = fault {
                self.fault(at, fault);
            }
        }
        volume
    }

    pub(super) fn volume_texture(&mut self, at: &str, name: &str) -> Volume {
        self.named_volume(at, name, Use::Spectrum)
    }

    pub(super) fn volume_numbers(&mut self, at: &str, name: &str) -> Volume {
        self.named_volume(at, name, Use::Number)
    }

    fn spectrum_or_volume(&mut self, at: &str, s: &written::SpectrumOrVolume) -> Volume {
        match s {
            written::SpectrumOrVolume::Volume(name) => self.named_volume(&format!("{at}.volume"), name, Use::Spectrum),
            written::SpectrumOrVolume::Spectrum(s) => {
                Volume::Constant { value: self.coefficient(at, s), local_from_world: DAffine3::IDENTITY }
            }
        }
    }

    fn albedo(&mut self, at: &str, s: &written::SpectrumOrVolume) -> Volume {
        let albedo = self.spectrum_or_volume(at, s).of_shares();
        match (s, &albedo) {
            (written::SpectrumOrVolume::Spectrum(written), Volume::Constant { value, .. }) => {
                self.check_file_of_shares(at, written, value);
            }
            (written::SpectrumOrVolume::Volume(name), volume) => {
                self.check_shares(&format!("{at}.volume"), volume, name);
            }
            _ => {}
        }
        albedo
    }

    /// Refuses a file of more than all light in the volume `name`, which the field `at` takes for shares of it.
    pub(super) fn check_shares(&mut self, at: &str, volume: &Volume, name: &str) {
        let description = self.description;
        match (&description.volumes[name], volume) {
            (written::Volume::Constant(written), Volume::Constant { value, .. }) => {
                self.check_file_of_shares(at, &written.value, value);
            }
            (written::Volume::Grid(written), Volume::Grid(grid)) => {
                let found = grid.greatest();
                if found > 1.0 {
                    let found = in_short(f64::from(found));
                    let message = format!("expected values from 0 to 1 for a share of light, found {found}");
                    let error = self.asked(at, Error::input(&written.file, message));
                    self.unread.get_or_insert(error);
                }
            }
            _ => {}
        }
    }

    pub(super) fn medium(&mut self, at: &str, medium: &written::Medium) -> Medium {
        let at = |field: &str| format!("{at}.{}.{field}", medium.kind());
        match medium {
            written::Medium::Homogeneous(m) => {
                let filling = match &m.coefficients {
                    written::Coefficients::Parts { absorption, scattering } => Filling::Even {
                        absorption: self.spectrum(&at("absorption"), absorption, Outside::Hold, Role::Coefficient),
                        scattering: self.spectrum(&at("scattering"), scattering, Outside::Hold, Role::Coefficient),
                    },
                    written::Coefficients::Sum { extinction, albedo, scale } => {
                        let albedo = self.albedo(&at("albedo"), albedo);
                        Filling::EvenExtinction {
                            extinction: self.coefficient(&at("extinction"), extinction).scaled(*scale),
                            scatters: albedo.max() > 0.0,
                            albedo,
                        }
                    }
                };
                Medium { filling, phase: self.phase(&at("phase"), &m.phase), shadow_rays: m.shadow_rays }
            }
            written::Medium::Heterogeneous(m) => {
                let extinction = self.spectrum_or_volume(&at("extinction"), &m.extinction);
                let albedo = self.albedo(&at("albedo"), &m.albedo);
                let varying = Varying::new(extinction, m.scale, albedo);
                let thickness = varying.thickness();
                if thickness > THICKEST {
                    let message = format!(
                        "expected at most {THICKEST:e} mean free paths across the volume, found {thickness:.1e}"
                    );
                    self.fault(&at("extinction"), message);
                }
                Medium {
                    filling: Filling::Varying(Box::new(varying)),
                    phase: self.phase(&at("phase"), &m.phase),
                    shadow_rays: m.shadow_rays,
                }
            }
        }
    }

    /// Whether light from infinity is lost in an endless medium. `whitted` knows no media.
    pub(super) fn loses_distant_light(&self, scene: &Scene) -> bool {
        let followed =
            matches!(self.description.integrator, written::Integrator::Path(_) | written::Integrator::LightTracer(_));
        let around = scene.camera_medium.filter(|medium| scene.media[*medium as usize].is_opaque_at_infinity());
        // Out there is what the camera is in, unless some surface has something else on its far side.
        let holds = |object: &Object| {
            let (far, near) =
                if object.flipped { (object.inside, object.outside) } else { (object.outside, object.inside) };
            let alike = far == around && (near == around || object.bounds().is_finite());
            alike || object.keeps_medium || matches!(object.geometry, Geometry::Instance(_))
        };
        followed && around.is_some() && scene.objects.iter().all(holds)
    }

    /// Notes which lights, of these names, come from infinity and are lost.
    pub(super) fn note_lost_light(&self, scene: &mut Scene, names: &[String]) {
        let named = scene.lights.iter().zip(names).filter(|(light, _)| light.is_distant());
        let lost = named.map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ");
        if !lost.is_empty() {
            let note = format!(
                "has no end: light from infinity comes through it only at wavelengths at which it neither absorbs nor \
                 scatters: {lost}"
            );
            scene.notes.push(self.description.fault("medium", &note));
        }
    }

    fn phase(&mut self, at: &str, phase: &written::Phase) -> PhaseFunction {
        PhaseFunction::One(match phase {
            written::Phase::Isotropic => Phase::Isotropic,
            written::Phase::Rayleigh => Phase::Rayleigh,
            written::Phase::Hg(g) => Phase::HenyeyGreenstein(*g),
            written::Phase::Table(values) => {
                let table = PhaseTable::new(values).map(|table| Phase::Table(Arc::new(table)));
                self.or(&format!("{at}.table"), table, Phase::Isotropic)
            }
            written::Phase::Blend(blend) => {
                let at = format!("{at}.blend");
                let weight = match &blend.weight {
                    written::NumberOrVolume::Number(weight) => {
                        Volume::Constant { value: Spectrum::constant(*weight), local_from_world: DAffine3::IDENTITY }
                    }
                    written::NumberOrVolume::Volume(name) => {
                        self.named_volume(&format!("{at}.weight.volume"), name, Use::Number)
                    }
                };
                let parts = [0, 1].map(|i| self.phase(&format!("{at}.of[{i}]"), &blend.of[i]));
                return PhaseFunction::Blend(Box::new(PhaseBlend { weight, parts }));
            }
        })
    }
}

/// The voxels of a file, as colours or `raw`.
///
/// # Errors
/// [`Error::Input`] where the file is missing or broken, holds numbers below zero, or has neither one channel
/// nor three.
fn read_grid(path: &Path, raw: bool, carried: Carried) -> Result<Unplaced> {
    let grid = Grid::load(path)?;
    if let Some(i) = grid.values.iter().position(|v| *v < 0.0) {
        let found = grid.values[i];
        return Err(Error::input(path, format!("expected numbers of 0 or more, found {found} as value {i}")));
    }
    let triples = || grid.values.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect::<Vec<_>>();
    let values = match (grid.channels, raw) {
        (1, _) => Voxels::Grey(grid.values.into()),
        (3, true) => Voxels::Raw(triples().into()),
        (3, false) => Voxels::upsampled(&triples(), carried),
        (n, _) => return Err(Error::input(path, format!("expected 1 channel or 3, found {n}"))),
    };
    Ok(Unplaced { size: grid.size, min: grid.min, max: grid.max, values })
}

/// What was read for `written`, where that stands.
fn place_grid(written: &written::GridVolume, grid: Unplaced, world_from_local: DAffine3) -> Result<GridVolume> {
    let mut local_from_world = world_from_local.inverse();
    if written.file_box {
        let extent = grid.max - grid.min;
        if extent.min_element() <= 0.0 {
            let (min, max) = (grid.min, grid.max);
            return Err(Error::input(&written.file, format!("expected a box with a volume, found {min} to {max}")));
        }
        // Mitsuba's order: from the world by the transform, then from the file's box to the unit cube.
        local_from_world =
            DAffine3::from_scale(DVec3::ONE / extent) * DAffine3::from_translation(-grid.min) * local_from_world;
    }
    Ok(GridVolume {
        size: grid.size,
        values: grid.values,
        local_from_world,
        between: match written.filter {
            written::VolumeFilter::Trilinear => Between::Trilinear,
            written::VolumeFilter::Nearest => Between::Nearest,
        },
        above_one: written.above_one,
        clamped: false,
        wrap: match written.wrap {
            written::Wrap::Repeat => Wrap::Repeat,
            written::Wrap::Mirror => Wrap::Mirror,
            written::Wrap::Clamp => Wrap::Clamp,
        },
        brightest: OnceLock::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::census::Census;
    use crate::scene::compile::testing::{compiled, compiled_with};
    use crate::scene::grid::testing::vol;
    use crate::scene::material::Kind;
    use crate::scene::shelf::Shelf;
    use crate::scene::texture::Texture;
    use crate::spectrum::Lanes;

    /// A cloud is read once for all the scenes of its way, such as the moments while a shutter is open: they share its numbers,
    /// and each has a place of its own.
    #[test]
    fn voxels_of_a_volume_that_moves_are_read_once() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("cloud.vol"), vol([2, 1, 1], 1, &[0.25, 0.75])).unwrap();
        let mut shelf = Shelf::default();
        let mut placed = |x: f64| {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                 volumes: {{v: {{grid: {{file: cloud.vol, transform: [{{translate: [{x}, 0, 0]}}]}}}}}}\n\
                 textures: {{t: {{volume: v}}}}\n\
                 shapes: [sphere: {{radius: 1, material: {{diffuse: {{reflectance: {{texture: t}}}}}}}}]\n"
            );
            let scene = compiled_with(directory.path(), &text, &mut shelf);
            match &scene.materials[scene.objects[0].material as usize].kind {
                Kind::Diffuse { reflectance: Texture::Volume(Volume::Grid(grid)) } => grid.clone(),
                _ => panic!("a volume"),
            }
        };
        let (here, there) = (placed(0.0), placed(2.0));
        let (Voxels::Grey(a), Voxels::Grey(b)) = (&here.values, &there.values) else { panic!("one channel") };
        assert!(Arc::ptr_eq(a, b));
        // The middle of the second voxel.
        let at = DVec3::new(0.75, 0.5, 0.5);
        assert_eq!([here.scalar(at), there.scalar(at + DVec3::X * 2.0)], [0.75; 2]);
    }

    /// The spectrum of a strong red, which Mitsuba upsamples with a factor: as an albedo and a reflectance no more than all light, and as it
    /// is where that is said.
    #[test]
    fn colours_of_a_grid_are_shares_where_they_stand_for_some() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("red.vol"), vol([1, 1, 1], 3, &[0.9, 0.05, 0.05])).unwrap();
        let most = |above_one: bool| -> [f32; 2] {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                 volumes: {{v: {{grid: {{file: red.vol, above_one: {above_one}}}}}}}\ntextures: {{t: {{volume: v}}}}\n\
                 media: {{m: {{homogeneous: {{extinction: 1, albedo: {{volume: v}}}}}}}}\nshapes:\n\
                 - sphere: {{radius: 1, material: {{diffuse: {{reflectance: {{texture: t}}}}}}}}\n\
                 - sphere: {{center: [3, 0, 0], radius: 1, inside: m, material: {{boundary: {{}}}}}}\n"
            );
            let scene = compiled_with(directory.path(), &text, &mut Shelf::default());
            let Kind::Diffuse { reflectance: Texture::Volume(reflectance) } =
                &scene.materials[scene.objects[0].material as usize].kind
            else {
                panic!("a volume")
            };
            let Filling::EvenExtinction { albedo, .. } = &scene.media[0].filling else { panic!("an albedo") };
            [reflectance, albedo].map(|volume| volume.eval(DVec3::splat(0.5), Lanes::splat(700.0)).to_array()[0])
        };
        let [reflectance, albedo] = most(true);
        assert!(reflectance == albedo && albedo > 1.7, "{reflectance} {albedo}");
        assert_eq!(most(false), [1.0; 2]);
    }

    /// No path gets into what light does not cross. What it was said to hold counted as a medium and kept pixels from sharing paths.
    #[test]
    fn what_light_cannot_enter_holds_no_medium() {
        let made = |shape: &str| {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nmedia: {{m: {{homogeneous: {{scattering: 1}}}}}}\n\
                 shapes: [{{{shape}}}]\n"
            );
            let scene = compiled(&text);
            let told = scene.notes.iter().any(|note| note.contains("light cannot enter"));
            (Census::of(&scene).media, told)
        };
        assert_eq!(made("sphere: {radius: 1, inside: m}"), (0, true));
        assert_eq!(made("sphere: {radius: 1, inside: m, emission: 1}"), (0, true));
        assert_eq!(made("cube: {size: 1, outside: m, flip_normals: true}"), (0, true));
        assert_eq!(made("sphere: {radius: 1, inside: m, outside: m}"), (1, true));
        // Around it, beside it, and within a lamp that shines inward there may be one.
        assert_eq!(made("sphere: {radius: 1, outside: m}"), (1, false));
        assert_eq!(made("rectangle: {corner: [0, 0, 0], edge_u: [1, 0, 0], edge_v: [0, 1, 0], inside: m}"), (1, false));
        assert_eq!(made("sphere: {radius: 1, outside: m, flip_normals: true, emission: 1}"), (1, false));
        assert_eq!(made("sphere: {radius: 1, inside: m, material: {boundary: {}}}"), (1, false));
        assert_eq!(made("sphere: {radius: 1, inside: m, material: {mask: {material: {diffuse: {}}}}}"), (1, false));
    }
}
