//! Volumes, media and phase functions.

use glam::DMat4;

use super::super::super::medium::{Coefficients, Medium, Phase};
use super::super::super::spectrum::Spectrum;
use super::super::super::texture::Wrap;
use super::super::super::volume::{NumberOrVolume, SpectrumOrVolume, Volume, VolumeFilter};
use super::spectra::{Role, curve_of, is_colour};
use super::xml::numbers;
use super::{Export, joined};

impl Export<'_> {
    /// A medium of the scene's list.
    pub(super) fn medium(&mut self, name: &str, medium: &Medium) {
        let why = self.medium_shortfall(medium);
        if let Some(why) = &why {
            self.instead("medium", &super::field(&["media", name]), why.as_str());
        }
        let id = self.id(name, "medium");
        let (phase, shadow_rays) = match medium {
            Medium::Homogeneous(m) => {
                self.xml.open("medium", &[("type", "homogeneous"), ("id", &id)]);
                match &m.coefficients {
                    Coefficients::Parts { absorption, scattering } => self.parts(absorption, scattering),
                    Coefficients::Sum { extinction, albedo, scale } => {
                        self.spectrum("sigma_t", extinction, Role::Coefficient);
                        self.spectrum_or_volume("albedo", albedo);
                        self.xml.value("float", "scale", scale);
                    }
                }
                (&m.phase, m.shadow_rays)
            }
            Medium::Heterogeneous(m) => {
                self.xml.open("medium", &[("type", "heterogeneous"), ("id", &id)]);
                self.spectrum_or_volume("sigma_t", &m.extinction);
                self.spectrum_or_volume("albedo", &m.albedo);
                self.xml.value("float", "scale", m.scale);
                (&m.phase, m.shadow_rays)
            }
        };
        if !shadow_rays {
            self.xml.value("boolean", "sample_emitters", false);
        }
        self.phase(phase);
        self.xml.close();
        if why.is_some() {
            self.end();
        }
    }

    /// σₐ and σₛ as their sum and the share of the second.
    fn parts(&mut self, absorption: &Spectrum, scattering: &Spectrum) {
        match (absorption, scattering) {
            (Spectrum::Number(a), Spectrum::Number(s)) => {
                self.xml.value("spectrum", "sigma_t", a + s);
                self.xml.value("spectrum", "albedo", if a + s > 0.0 { s / (a + s) } else { 0.0 });
            }
            (absorption, Spectrum::Number(0.0)) if !is_colour(absorption) => {
                self.spectrum("sigma_t", absorption, Role::Coefficient);
                self.xml.value("spectrum", "albedo", 0.0);
            }
            (absorption, scattering) => match (curve_of(absorption), curve_of(scattering)) {
                (Some(a), Some(s)) => {
                    self.samples("sigma_t", |nm| a(nm) + s(nm));
                    self.samples("albedo", |nm| if a(nm) + s(nm) > 0.0 { s(nm) / (a(nm) + s(nm)) } else { 0.0 });
                }
                _ => {
                    self.xml.value("spectrum", "sigma_t", 1.0);
                    self.xml.value("spectrum", "albedo", 0.75);
                }
            },
        }
    }

    fn phase(&mut self, phase: &Phase) {
        match phase {
            Phase::Isotropic => self.xml.open("phase", &[("type", "isotropic")]),
            Phase::Rayleigh => self.xml.open("phase", &[("type", "rayleigh")]),
            Phase::Hg(g) => {
                self.xml.open("phase", &[("type", "hg")]);
                self.xml.value("float", "g", g);
            }
            Phase::Table(values) => {
                self.xml.open("phase", &[("type", "tabphase")]);
                self.xml.value("string", "values", numbers(values));
            }
            Phase::Blend(blend) => {
                self.xml.open("phase", &[("type", "blendphase")]);
                match &blend.weight {
                    NumberOrVolume::Number(weight) => self.xml.value("float", "weight", weight),
                    NumberOrVolume::Volume(name) => self.volume("weight", name),
                }
                blend.of.iter().for_each(|part| self.phase(part));
            }
        }
        self.xml.close();
    }

    fn spectrum_or_volume(&mut self, name: &str, value: &SpectrumOrVolume) {
        match value {
            SpectrumOrVolume::Spectrum(spectrum) => self.spectrum(name, spectrum, Role::Coefficient),
            SpectrumOrVolume::Volume(volume) => self.volume(name, volume),
        }
    }

    /// A volume where it is used.
    pub(super) fn volume(&mut self, name: &str, volume: &str) {
        let Some(volume) = self.scene.volumes.get(volume) else { return };
        match volume {
            Volume::Constant(constant) => {
                self.xml.open("volume", &[("type", "constvolume"), ("name", name)]);
                self.spectrum("value", &constant.value, Role::Coefficient);
            }
            Volume::Grid(grid) => {
                self.xml.open("volume", &[("type", "gridvolume"), ("name", name)]);
                let file = self.file(&grid.file);
                self.xml.value("string", "filename", file);
                let filter = match grid.filter {
                    VolumeFilter::Trilinear => "trilinear",
                    VolumeFilter::Nearest => "nearest",
                };
                self.xml.value("string", "filter_type", filter);
                let wrap = match grid.wrap {
                    Wrap::Repeat => "repeat",
                    Wrap::Mirror => "mirror",
                    Wrap::Clamp => "clamp",
                };
                self.xml.value("string", "wrap_mode", wrap);
                self.xml.value("boolean", "raw", grid.raw);
                self.xml.value("boolean", "use_grid_bbox", grid.file_box);
            }
        }
        let matrix = volume.world_from_local();
        if matrix != DMat4::IDENTITY {
            self.placing(matrix);
        }
        self.xml.close();
    }

    fn medium_shortfall(&self, medium: &Medium) -> Option<String> {
        let either = |value: &SpectrumOrVolume| match value {
            SpectrumOrVolume::Spectrum(spectrum) => Export::coefficient_shortfall(spectrum),
            SpectrumOrVolume::Volume(name) => self.volume_shortfall(name),
        };
        let share = |value: &SpectrumOrVolume| match value {
            SpectrumOrVolume::Spectrum(_) => None,
            SpectrumOrVolume::Volume(name) => self.share_shortfall(name),
        };
        let both = |extinction: Option<&'static str>, albedo: &SpectrumOrVolume| {
            let albedo = either(albedo).or(share(albedo)).filter(|why| extinction != Some(why));
            joined([extinction, albedo].map(|why| why.map(str::to_owned)))
        };
        match medium {
            Medium::Homogeneous(m) => match &m.coefficients {
                Coefficients::Parts { absorption: Spectrum::Number(_), scattering: Spectrum::Number(_) } => None,
                // A colour within 1 is not the reflectance that Mitsuba takes it for.
                Coefficients::Parts { absorption, scattering: Spectrum::Number(0.0) }
                    if Export::can_say(absorption) && !is_colour(absorption) =>
                {
                    None
                }
                Coefficients::Parts { absorption, scattering } => {
                    let known = curve_of(absorption).is_some() && curve_of(scattering).is_some();
                    let instead = if known { "its coefficients at every fifth nanometre" } else { "a grey medium" };
                    Some(instead.to_owned())
                }
                Coefficients::Sum { extinction, albedo, .. } => both(Export::coefficient_shortfall(extinction), albedo),
            },
            Medium::Heterogeneous(m) => both(either(&m.extinction), &m.albedo),
        }
    }

    /// What Mitsuba gets in place of a volume that it has no words for.
    pub(super) fn volume_shortfall(&self, name: &str) -> Option<&'static str> {
        match self.scene.volumes.get(name) {
            Some(Volume::Constant(constant)) => Export::coefficient_shortfall(&constant.value),
            Some(Volume::Grid(_)) | None => None,
        }
    }

    /// What Mitsuba gets in place of a volume whose numbers are shares of light.
    pub(super) fn share_shortfall(&self, name: &str) -> Option<&'static str> {
        let differs = |volume: &Volume| matches!(volume, Volume::Grid(grid) if !grid.above_one && !grid.raw);
        self.scene.volumes.get(name).is_some_and(differs).then_some(
            "the same grid: Mitsuba's spectra of its colours, if it has some and they are strong, exceed 1, and make light",
        )
    }
}
