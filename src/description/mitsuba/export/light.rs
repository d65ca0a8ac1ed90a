//! Lights and media.

use super::super::super::light::{Aim, Light};
use super::super::super::medium::{Coefficients, Medium, Phase};
use super::super::super::spectrum::{Spectrum, SpectrumOrTexture};
use super::super::super::volume::SpectrumOrVolume;
use super::Export;
use super::spectra::Role;
use super::xml::numbers;

impl Export<'_> {
    /// A light of the scene's list.
    pub(super) fn light(&mut self, i: usize, light: &Light) {
        let why = match light {
            Light::Point(l) => Export::light_shortfall(&l.intensity),
            Light::Spot(l) if l.texture.is_some() => Some("a spot without its slide"),
            Light::Spot(l) => Export::light_shortfall(&l.intensity),
            Light::Directional(l) => Export::light_shortfall(&l.irradiance),
            Light::Constant(l) => Export::light_shortfall(&l.radiance),
            Light::Environment(_) => Some("the same image on Mitsuba's grid, shifted by half a row toward the poles"),
            _ => Some("a weak grey light: this kind is not exported yet"),
        };
        let why = why.or((light.sampling_weight() != 1.0).then_some("the same light, chosen as often as the others"));
        if let Some(why) = why {
            self.instead("emitter", &format!("lights[{i}]"), why);
        }
        match light {
            Light::Point(l) => {
                self.xml.open("emitter", &[("type", "point")]);
                self.xml.value("point", "position", numbers(&l.position));
                self.spectrum("intensity", &l.intensity, Role::Emission);
            }
            Light::Spot(l) => {
                self.xml.open("emitter", &[("type", "spot")]);
                let axis = l.axis();
                let target = glam::DVec3::from(l.position) + axis;
                // Any direction across will do without a slide.
                let up = if axis.x.abs() <= axis.y.abs().max(axis.z.abs()) { glam::DVec3::X } else { glam::DVec3::Y };
                let target = match l.aim {
                    Aim::Target(target) => target,
                    Aim::Direction(_) => target.into(),
                };
                self.xml.open("transform", &[("name", "to_world")]);
                let [origin, target, up] = [l.position, target, up.into()].map(|v| numbers(&v));
                self.xml.leaf("lookat", &[("origin", &origin), ("target", &target), ("up", &up)]);
                self.xml.close();
                self.xml.value("float", "cutoff_angle", l.cutoff_deg);
                self.xml.value("float", "beam_width", l.beam_deg);
                self.spectrum("intensity", &l.intensity, Role::Emission);
            }
            Light::Directional(l) => {
                self.xml.open("emitter", &[("type", "directional")]);
                self.xml.value("vector", "direction", numbers(&l.direction));
                self.spectrum("irradiance", &l.irradiance, Role::Emission);
            }
            Light::Constant(l) => {
                self.xml.open("emitter", &[("type", "constant")]);
                self.spectrum("radiance", &l.radiance, Role::Emission);
            }
            Light::Environment(l) => {
                self.xml.open("emitter", &[("type", "envmap")]);
                let file = self.file(&l.file);
                self.xml.value("string", "filename", file);
                self.xml.value("float", "scale", l.scale / super::DAYLIGHT);
                self.xml.open("transform", &[("name", "to_world")]);
                // Its left edge, where ours has the middle, looks along -z.
                self.xml.leaf("rotate", &[("y", "1"), ("angle", &(l.rotate_deg + 180.0).to_string())]);
                self.xml.close();
            }
            _ => {
                self.xml.open("emitter", &[("type", "constant")]);
                self.xml.value("spectrum", "radiance", 0.01);
            }
        }
        self.xml.close();
        if why.is_some() {
            self.end();
        }
    }

    /// The emission of a shape.
    pub(super) fn area(&mut self, emission: &SpectrumOrTexture) {
        self.xml.open("emitter", &[("type", "area")]);
        self.spectrum_or_texture("radiance", emission, Role::Emission);
        self.xml.close();
    }

    /// A medium of the scene's list.
    pub(super) fn medium(&mut self, name: &str, medium: &Medium) {
        let said = match medium {
            Medium::Homogeneous(m) => coefficients(&m.coefficients).zip(phase(&m.phase)),
            Medium::Heterogeneous(_) => None,
        };
        if said.is_none() {
            let why = "a grey medium of extinction 1 and albedo 0.75";
            self.instead("medium", &format!("media.{name}"), why);
        }
        let id = self.id(name, "medium");
        self.xml.open("medium", &[("type", "homogeneous"), ("id", &id)]);
        match &said {
            Some(((extinction, albedo, scale), (plugin, g))) => {
                self.spectrum("sigma_t", extinction, Role::Coefficient);
                self.spectrum("albedo", albedo, Role::Reflectance);
                self.xml.value("float", "scale", scale);
                self.xml.open("phase", &[("type", plugin)]);
                if let Some(g) = g {
                    self.xml.value("float", "g", g);
                }
                self.xml.close();
                self.xml.close();
            }
            None => {
                self.xml.close();
                self.end();
            }
        }
    }
}

/// σₜ, albedo and scale, where Mitsuba has words for them.
fn coefficients(coefficients: &Coefficients) -> Option<(Spectrum, Spectrum, f64)> {
    match coefficients {
        Coefficients::Parts { absorption: Spectrum::Number(a), scattering: Spectrum::Number(s) } if a + s > 0.0 => {
            Some((Spectrum::Number(a + s), Spectrum::Number(s / (a + s)), 1.0))
        }
        Coefficients::Sum { extinction, albedo: SpectrumOrVolume::Spectrum(albedo), scale }
            if Export::can_say(extinction) && Export::can_say(albedo) =>
        {
            Some((extinction.clone(), albedo.clone(), *scale))
        }
        Coefficients::Parts { .. } | Coefficients::Sum { .. } => None,
    }
}

/// The plugin, and its g.
fn phase(phase: &Phase) -> Option<(&'static str, Option<f64>)> {
    match phase {
        Phase::Isotropic => Some(("isotropic", None)),
        Phase::Rayleigh => Some(("rayleigh", None)),
        Phase::Hg(g) => Some(("hg", Some(*g))),
        Phase::Table(_) | Phase::Blend(_) => None,
    }
}
