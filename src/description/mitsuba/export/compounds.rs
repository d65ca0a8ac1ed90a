//! Materials that are made of others, principled ones, and hair.

use super::super::super::compound::{Blend, Bump, Mask, NormalMap, NumberOrTexture, Roughness, TwoSided};
use super::super::super::hair::{Hair, HairColour};
use super::super::super::material::{Material, MaterialRef};
use super::super::super::principled::{Contrast, Luminance, Principled, PrincipledThin};
use super::super::super::spectrum::SpectrumOrTexture;
use super::spectra::Role;
use super::surface::{Attributes, absorbs};
use super::{Export, joined};
use crate::spectrum::upsample;

/// Absorption of the two pigments of concentration one in red, green and blue: d'Eon et al. 2011.
const PIGMENTS: [[f64; 3]; 2] = [[0.419, 0.697, 1.37], [0.187, 0.4, 1.05]];

const ZERO: NumberOrTexture = NumberOrTexture::Number(0.0);

impl Export<'_> {
    /// A `<float>`, or a texture that is asked for numbers.
    pub(super) fn number(&mut self, name: &str, value: &NumberOrTexture) {
        match value {
            NumberOrTexture::Number(x) => self.xml.value("float", name, x),
            NumberOrTexture::Texture(texture) => self.numbers_of(Some(name), texture),
        }
    }

    /// Numbers, where they are not the plugin's default.
    fn numbers_but(&mut self, numbers: &[(&str, &NumberOrTexture, f64)]) {
        for (name, value, default) in numbers {
            if **value != NumberOrTexture::Number(*default) {
                self.number(name, value);
            }
        }
    }

    fn rates(&mut self, rates: &[(&str, f64)]) {
        for (name, rate) in rates.iter().filter(|(_, rate)| *rate != 1.0) {
            self.xml.value("float", name, rate);
        }
    }

    pub(super) fn principled(&mut self, m: &Principled, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        self.spectrum_or_texture("base_color", &m.base_color, Role::Reflectance);
        self.numbers_but(&[
            ("roughness", &m.roughness, 0.5),
            ("anisotropic", &m.anisotropic, 0.0),
            ("metallic", &m.metallic, 0.0),
            ("spec_trans", m.spec_trans.as_ref().unwrap_or(&ZERO), 0.0),
            ("spec_tint", &m.spec_tint, 0.0),
            ("sheen", &m.sheen, 0.0),
            ("sheen_tint", &m.sheen_tint, 0.0),
            ("flatness", &m.flatness, 0.0),
            ("clearcoat", &m.clearcoat, 0.0),
            ("clearcoat_gloss", &m.clearcoat_gloss, 0.0),
        ]);
        match m.contrast {
            Contrast::Eta(eta) => self.xml.value("float", "eta", eta),
            Contrast::Specular(specular) => self.xml.value("float", "specular", specular),
        }
        self.rates(&[
            ("main_specular_sampling_rate", m.sampling.specular),
            ("clearcoat_sampling_rate", m.sampling.clearcoat),
            ("diffuse_reflectance_sampling_rate", m.sampling.diffuse),
        ]);
    }

    pub(super) fn principled_thin(&mut self, m: &PrincipledThin, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        self.spectrum_or_texture("base_color", &m.base_color, Role::Reflectance);
        self.numbers_but(&[
            ("roughness", &m.roughness, 0.5),
            ("anisotropic", &m.anisotropic, 0.0),
            ("spec_trans", &m.spec_trans, 0.0),
            ("diff_trans", &m.diff_trans, 0.0),
            ("eta", &m.eta, 1.5),
            ("spec_tint", &m.spec_tint, 0.0),
            ("sheen", &m.sheen, 0.0),
            ("sheen_tint", &m.sheen_tint, 0.0),
            ("flatness", &m.flatness, 0.0),
        ]);
        self.rates(&[
            ("specular_reflectance_sampling_rate", m.sampling.reflection),
            ("specular_transmittance_sampling_rate", m.sampling.transmission),
            ("diffuse_reflectance_sampling_rate", m.sampling.diffuse_reflection),
            ("diffuse_transmittance_sampling_rate", m.sampling.diffuse_transmission),
        ]);
    }

    pub(super) fn hair(&mut self, m: &Hair, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        self.xml.value("float", "longitudinal_roughness", m.roughness_along);
        self.xml.value("float", "azimuthal_roughness", m.roughness_around);
        self.xml.value("float", "scale_tilt", m.tilt_deg);
        self.xml.value("float", "int_ior", m.ior);
        self.xml.value("float", "ext_ior", m.exterior_ior);
        match &m.colour {
            HairColour::Absorption(absorption) => self.spectrum("sigma_a", absorption, Role::OpticalConstant),
            HairColour::Pigments { eumelanin, pheomelanin } => {
                let curves = PIGMENTS.map(|rgb| upsample::unbounded(rgb).ok());
                let value = |nm: f64| {
                    let parts = curves.iter().zip([eumelanin, pheomelanin]);
                    parts.map(|(curve, share)| curve.as_ref().map_or(0.0, |c| share * super::spectra::at(c, nm))).sum()
                };
                self.samples("sigma_a", value);
            }
        }
    }

    pub(super) fn mask(&mut self, field: &str, m: &Mask, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        self.number("opacity", &m.opacity);
        self.material_ref(&format!("{field}.mask.material"), &m.material);
    }

    pub(super) fn blend(&mut self, field: &str, m: &Blend, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        self.number("weight", &m.weight);
        self.material_ref(&format!("{field}.blend.first"), &m.first);
        self.material_ref(&format!("{field}.blend.second"), &m.second);
    }

    pub(super) fn two_sided(&mut self, field: &str, m: &TwoSided, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        if self.either_transmits(m) {
            self.xml.value("boolean", "allow_transmission", true);
        }
        for (key, side) in [("front", Some(&m.front)), ("back", m.back.as_ref())] {
            match side.map(|side| &**side) {
                // Each is seen from one side only.
                Some(MaterialRef::Inline(material)) => {
                    self.one_sided(&format!("{field}.two_sided.{key}"), material);
                }
                Some(name) => self.material_ref("", name),
                None => {}
            }
        }
    }

    pub(super) fn bump(&mut self, field: &str, m: &Bump, attributes: &Attributes) {
        let texture = &m.height.texture;
        let has_slopes = self.has_slopes(texture);
        self.relief(attributes, None, has_slopes.then_some(texture), m.turn, m.shadowing);
        if has_slopes {
            self.xml.value("float", "scale", m.scale);
        }
        self.material_ref(&format!("{field}.bump.material"), &m.material);
    }

    pub(super) fn normal_map(&mut self, field: &str, m: &NormalMap, attributes: &Attributes) {
        let texture = &m.normals.texture;
        let normals = self.has_normals(texture).then_some(texture);
        self.relief(attributes, Some("normalmap"), normals, m.turn, m.shadowing);
        self.material_ref(&format!("{field}.normal_map.material"), &m.material);
    }

    /// Begins a relief of `texture`, which the plugin knows by `name`; where Mitsuba has none, a plugin that leaves the material
    /// in it as it is.
    fn relief(
        &mut self,
        attributes: &Attributes,
        name: Option<&str>,
        texture: Option<&String>,
        turn: bool,
        shadowing: bool,
    ) {
        if let Some(texture) = texture {
            self.open_owned("bsdf", attributes);
            self.numbers_of(name, texture);
            self.xml.value("boolean", "flip_invalid_normals", turn);
            self.xml.value("boolean", "use_shadowing_function", shadowing);
        } else {
            let id = attributes.iter().filter(|(name, _)| *name == "id").cloned();
            let all: Vec<(&'static str, String)> = std::iter::once(("type", "mask".to_owned())).chain(id).collect();
            self.open_owned("bsdf", &all);
            self.xml.value("float", "opacity", 1.0);
        }
    }

    /// The material that a reference means.
    pub(super) fn meant<'m>(&'m self, material: &'m MaterialRef) -> Option<&'m Material> {
        match material {
            MaterialRef::Name(name) => self.scene.materials.get(name),
            MaterialRef::Inline(material) => Some(material),
        }
    }

    /// A material and all that it is made of.
    fn made_of<'m>(&'m self, material: &'m MaterialRef) -> Vec<&'m Material> {
        let Some(material) = self.meant(material) else { return Vec::new() };
        let inner = material.inner().into_iter().flat_map(|part| self.made_of(part));
        std::iter::once(material).chain(inner).collect()
    }

    /// Whether a material throws light in single directions, be it a part of what comes.
    pub(super) fn is_single(&self, material: &MaterialRef) -> bool {
        self.made_of(material).into_iter().any(|m| match m {
            Material::Mirror(_) | Material::ThinDielectric(_) => true,
            Material::Conductor(m) => m.roughness == Roughness::Number(0.0),
            Material::Dielectric(m) => m.roughness == Roughness::Number(0.0),
            Material::Plastic(m) => m.roughness <= 0.0,
            Material::Diffuse(_) | Material::Hair(_) | Material::Principled(_) | Material::PrincipledThin(_) => false,
            Material::Mask(_) | Material::Blend(_) | Material::TwoSided(_) | Material::Boundary(_) => false,
            Material::Bump(_) | Material::NormalMap(_) => false,
        })
    }

    /// Whether a material lets light straight through.
    pub(super) fn is_open(&self, material: &MaterialRef) -> bool {
        let open = |m| matches!(m, &Material::ThinDielectric(_) | &Material::Boundary(_) | &Material::Mask(_));
        self.made_of(material).into_iter().any(open)
    }

    /// Whether a material has a pane in it.
    pub(super) fn is_pane(&self, material: &MaterialRef) -> bool {
        self.made_of(material).into_iter().any(|m| matches!(m, Material::ThinDielectric(_)))
    }

    /// Whether light may cross a surface.
    pub(super) fn transmits(&self, material: &MaterialRef) -> bool {
        self.made_of(material).into_iter().any(|m| match m {
            Material::Dielectric(_) | Material::ThinDielectric(_) | Material::PrincipledThin(_) => true,
            Material::Hair(_) | Material::Boundary(_) | Material::Mask(_) => true,
            Material::Principled(m) => m.spec_trans.is_some(),
            Material::Diffuse(_) | Material::Conductor(_) | Material::Mirror(_) | Material::Plastic(_) => false,
            Material::Blend(_) | Material::TwoSided(_) | Material::Bump(_) | Material::NormalMap(_) => false,
        })
    }

    /// Whether a body of it takes light away inside.
    pub(super) fn absorbs(&self, material: &MaterialRef) -> bool {
        self.made_of(material).into_iter().any(|m| matches!(m, Material::Dielectric(m) if absorbs(m)))
    }

    /// Whether light may come through one of two sides.
    fn either_transmits(&self, m: &TwoSided) -> bool {
        [Some(&m.front), m.back.as_ref()].into_iter().flatten().any(|side| self.transmits(side))
    }

    /// What Mitsuba gets in place of such a material, where it cannot express it.
    pub(super) fn compound_shortfall(&self, material: &Material) -> Option<String> {
        let colour =
            |s: &SpectrumOrTexture| Export::either_shortfall(&[s], "grey in place of a spectrum").map(str::to_owned);
        let tinted = |luminance: Luminance, tints: [&NumberOrTexture; 2]| {
            let bright = luminance == Luminance::Colour && tints.iter().any(|tint| **tint != ZERO);
            bright.then(|| "tints over the luminance that Mitsuba takes, about 2.6 times as bright".to_owned())
        };
        match material {
            Material::Principled(m) => {
                joined([colour(&m.base_color), tinted(m.luminance, [&m.spec_tint, &m.sheen_tint])])
            }
            Material::PrincipledThin(m) => {
                joined([colour(&m.base_color), tinted(m.luminance, [&m.spec_tint, &m.sheen_tint])])
            }
            Material::Hair(m) => match &m.colour {
                HairColour::Pigments { .. } => {
                    Some("the absorption of its pigments at every fifth nanometre".to_owned())
                }
                HairColour::Absorption(s) => Export::constant_shortfall(&[s], "a grey absorption"),
            },
            Material::Bump(m) => (!self.has_slopes(&m.height.texture))
                .then(|| "what it covers: Mitsuba has no slopes but of pictures".to_owned()),
            Material::NormalMap(m) => (!self.has_normals(&m.normals.texture))
                .then(|| "what it covers: normals are written for Mitsuba as pictures in colour alone".to_owned()),
            _ => None,
        }
    }

    /// Whether what covers a shape depends on how u and v run over it.
    pub(super) fn follows_uv(&self, material: &MaterialRef) -> bool {
        let texture = |name: &String| self.texture_follows_uv(name);
        let colour = |s: &SpectrumOrTexture| s.name().is_some_and(|name| self.texture_follows_uv(name));
        let number = |n: &NumberOrTexture| matches!(n, NumberOrTexture::Texture(name) if texture(name));
        // The grain lies along u.
        let grain = |n: &NumberOrTexture| *n != ZERO;
        match self.meant(material) {
            None | Some(Material::Mirror(_) | Material::Boundary(_)) => false,
            Some(Material::Diffuse(m)) => colour(&m.reflectance),
            Some(Material::Conductor(m)) => colour(&m.tint) || self.roughness_follows_uv(&m.roughness),
            Some(Material::Dielectric(m)) => {
                colour(&m.reflection_tint) || colour(&m.transmission_tint) || self.roughness_follows_uv(&m.roughness)
            }
            Some(Material::ThinDielectric(m)) => colour(&m.reflection_tint) || colour(&m.transmission_tint),
            Some(Material::Plastic(m)) => colour(&m.reflectance) || colour(&m.tint),
            Some(Material::Principled(m)) => {
                let numbers = [
                    &m.roughness,
                    &m.metallic,
                    &m.spec_tint,
                    &m.sheen,
                    &m.sheen_tint,
                    &m.flatness,
                    &m.clearcoat,
                    &m.clearcoat_gloss,
                ];
                grain(&m.anisotropic) || colour(&m.base_color) || numbers.into_iter().chain(&m.spec_trans).any(number)
            }
            Some(Material::PrincipledThin(m)) => {
                let numbers = [
                    &m.roughness,
                    &m.spec_trans,
                    &m.diff_trans,
                    &m.eta,
                    &m.spec_tint,
                    &m.sheen,
                    &m.sheen_tint,
                    &m.flatness,
                ];
                grain(&m.anisotropic) || colour(&m.base_color) || numbers.into_iter().any(number)
            }
            Some(Material::Mask(m)) => number(&m.opacity) || self.follows_uv(&m.material),
            Some(Material::Blend(m)) => number(&m.weight) || self.follows_uv(&m.first) || self.follows_uv(&m.second),
            Some(Material::TwoSided(m)) => {
                self.follows_uv(&m.front) || m.back.as_ref().is_some_and(|back| self.follows_uv(back))
            }
            // Fibres lie along u; slopes are by u and v.
            Some(Material::Hair(_) | Material::Bump(_) | Material::NormalMap(_)) => true,
        }
    }
}
