//! Materials and textures.

use super::super::super::absorption::Absorption;
use super::super::super::compound::Roughness;
use super::super::super::material::{
    Conductor, ConductorIndex, Dielectric, DiffuseMean, Distribution, Fresnel, Material, MaterialRef, Plastic,
    ThinDielectric,
};
use super::super::super::optical_data::{ReadK, optical_data};
use super::super::super::spectrum::{Index, Spectrum, SpectrumOrTexture};
use super::spectra::Role;
use super::{Export, joined};
use crate::spectrum::{self, Outside, RefractiveIndex, catalogue};

/// The wavelength at which a dispersive index is taken where there can be only one: the d line, nm.
const D_LINE_NM: f64 = 587.5618;

/// The ratio of two indices which Mitsuba tells apart: eight steps of its 32-bit floats. Such a surface reflects 2.5e-13.
const APART: f64 = 1.0 + 1e-6;

/// Names and values of an element's attributes.
pub(super) type Attributes = [(&'static str, String)];

impl Export<'_> {
    /// What Mitsuba gets in place of a material that it cannot express.
    fn shortfall(&self, material: &Material) -> Option<String> {
        self.plain_shortfall(material).or_else(|| self.compound_shortfall(material))
    }

    /// The same for materials that are not made of others.
    fn plain_shortfall(&self, material: &Material) -> Option<String> {
        let highlight = |given: bool| given.then(|| "no highlight: those belong to the Whitted ray tracer".to_owned());
        let spectra = |all: &[&SpectrumOrTexture]| {
            Export::either_shortfall(all, "grey in place of a spectrum").map(str::to_owned)
        };
        let schlick = |fresnel: Fresnel| {
            (fresnel == Fresnel::Schlick).then(|| "Fresnel's equations in place of Schlick's approximation".to_owned())
        };
        let barely = |rough: bool, inside: &Index, outside: &Index| {
            (rough && alike(inside, outside)).then(|| {
                "an index a millionth above that around it: Mitsuba wants those of what is rough to differ".to_owned()
            })
        };
        let film = |given: bool| given.then(|| "no interference: Mitsuba has no thin films".to_owned());
        match material {
            Material::Diffuse(m) => joined([highlight(m.highlight.is_some()), spectra(&[&m.reflectance])]),
            Material::Mirror(m) => {
                let grey = Export::reflectance_shortfall(&[&m.reflectance], "a grey mirror");
                joined([highlight(m.highlight.is_some()), grey.map(str::to_owned)])
            }
            Material::Conductor(m) => {
                let index = match &m.index {
                    ConductorIndex::Metal(_) | ConductorIndex::File(_) => {
                        Some("its index at every fifth nanometre".to_owned())
                    }
                    ConductorIndex::Written { eta, k } => {
                        Export::constant_shortfall(&[eta, k], "grey indices in place of spectra")
                    }
                };
                let film = film(m.film.is_some());
                joined([highlight(m.highlight.is_some()), schlick(m.fresnel), film, index, spectra(&[&m.tint])])
            }
            Material::Dielectric(m) => {
                let said = |given: bool, what: &str| given.then(|| what.to_owned());
                joined([
                    highlight(m.highlight.is_some()),
                    schlick(m.fresnel),
                    film(m.film.is_some()),
                    dispersive(&m.ior, &m.exterior_ior),
                    said(absorbs(m), "no absorption inside, which Mitsuba has in media only"),
                    said(m.priority.is_some(), "no priority: in Mitsuba bodies that overlap are wrong"),
                    barely(bends_roughly(m), &m.ior, &m.exterior_ior),
                    spectra(&[&m.reflection_tint, &m.transmission_tint]),
                ])
            }
            Material::ThinDielectric(m) => joined([
                film(m.thickness_nm.is_some()),
                dispersive(&m.ior, &m.exterior_ior),
                spectra(&[&m.reflection_tint, &m.transmission_tint]),
            ]),
            Material::Plastic(m) => {
                let few = m.roughness > 0.0 && m.diffuse_mean == DiffuseMean::Integral;
                joined([
                    highlight(m.highlight.is_some()),
                    dispersive(&m.ior, &m.exterior_ior),
                    spectra(&[&m.reflectance, &m.tint]),
                    barely(m.roughness > 0.0, &m.ior, &m.exterior_ior),
                    self.meanless(m),
                    few.then(|| "the coat's mean over 64 cosines, which makes the base darker by up to 2 %".to_owned()),
                ])
            }
            _ => None,
        }
    }

    /// What a plastic has in place of textures of which Mitsuba does not know the mean.
    fn meanless(&self, m: &Plastic) -> Option<String> {
        let instead = match (self.lacks_mean(&m.reflectance), self.lacks_mean(&m.tint)) {
            (true, true) => "a base of 0.5 and no tint",
            (true, false) => "a base of 0.5",
            (false, true) => "no tint",
            (false, false) => return None,
        };
        let why = "Mitsuba's plastics want the mean of a texture, which it does not have of volumes and of attributes of meshes";
        Some(format!("{instead}: {why}"))
    }

    /// A material of the scene's list.
    pub(super) fn material(&mut self, field: &str, material: &Material, id: Option<&str>) {
        match self.shortfall(material) {
            Some(why) => {
                self.instead("bsdf", field, why);
                self.bsdf(field, material, id, both_sides(material));
                self.end();
            }
            None => self.bsdf(field, material, id, both_sides(material)),
        }
    }

    /// A material within one that says what the other side is.
    pub(super) fn one_sided(&mut self, field: &str, material: &Material) {
        let why = self.shortfall(material);
        if let Some(why) = &why {
            self.instead("bsdf", field, why.as_str());
        }
        self.bsdf(field, material, None, false);
        if why.is_some() {
            self.end();
        }
    }

    /// The material of a shape.
    pub(super) fn material_ref(&mut self, field: &str, material: &MaterialRef) {
        match material {
            MaterialRef::Name(name) => {
                let id = self.id(name, "bsdf");
                self.xml.leaf("ref", &[("id", &id)]);
            }
            MaterialRef::Inline(material) => self.material(field, material, None),
        }
    }

    fn bsdf(&mut self, field: &str, material: &Material, id: Option<&str>, two_sided: bool) {
        let named = |plugin: &'static str, id: Option<&str>| -> Vec<(&'static str, String)> {
            let mut attributes = vec![("type", plugin.to_owned())];
            attributes.extend(id.map(|id| ("id", id.to_owned())));
            attributes
        };
        let inner_id = if two_sided { None } else { id };
        if two_sided {
            let attributes = named("twosided", id);
            self.open_owned("bsdf", &attributes);
        }
        match material {
            Material::Diffuse(m) => {
                self.open_owned("bsdf", &named("diffuse", inner_id));
                self.spectrum_or_texture("reflectance", &m.reflectance, Role::Reflectance);
            }
            Material::Mirror(m) => {
                self.open_owned("bsdf", &named("conductor", inner_id));
                self.xml.value("string", "material", "none");
                self.spectrum("specular_reflectance", &m.reflectance, Role::Reflectance);
            }
            Material::Conductor(m) => {
                self.conductor(m, &named(plugin("conductor", "roughconductor", &m.roughness), inner_id))
            }
            Material::Dielectric(m) => {
                let kind = if bends_roughly(m) { "roughdielectric" } else { "dielectric" };
                self.dielectric(m, &named(kind, inner_id));
            }
            Material::ThinDielectric(m) => self.thin(m, &named("thindielectric", inner_id)),
            Material::Plastic(m) => {
                let kind = if m.roughness > 0.0 { "roughplastic" } else { "plastic" };
                self.plastic(m, &named(kind, inner_id));
            }
            Material::Boundary(_) => self.open_owned("bsdf", &named("null", inner_id)),
            Material::Principled(m) => self.principled(m, &named("principled", inner_id)),
            Material::PrincipledThin(m) => self.principled_thin(m, &named("principledthin", inner_id)),
            Material::Hair(m) => self.hair(m, &named("hair", inner_id)),
            Material::Mask(m) => self.mask(field, m, &named("mask", inner_id)),
            Material::Blend(m) => self.blend(field, m, &named("blendbsdf", inner_id)),
            Material::TwoSided(m) => self.two_sided(field, m, &named("twosided", inner_id)),
            Material::Bump(m) => self.bump(field, m, &named("bumpmap", inner_id)),
            Material::NormalMap(m) => self.normal_map(field, m, &named("normalmap", inner_id)),
        }
        self.xml.close();
        if two_sided {
            self.xml.close();
        }
    }

    pub(super) fn open_owned(&mut self, tag: &'static str, attributes: &Attributes) {
        let borrowed: Vec<(&str, &str)> = attributes.iter().map(|(name, value)| (*name, value.as_str())).collect();
        self.xml.open(tag, &borrowed);
    }

    fn conductor(&mut self, m: &Conductor, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        match &m.index {
            ConductorIndex::Metal(name) => {
                if let Ok((eta, k)) = catalogue::metal(name) {
                    self.curve("eta", &eta, 1.0);
                    self.curve("k", &k, 1.0);
                }
            }
            ConductorIndex::File(file) => {
                if let Ok(data) = optical_data(file, ReadK::Needed) {
                    let curve = |f: &dyn Fn(f64) -> f64| {
                        let all = (0..=94).map(|i| 360.0 + 5.0 * f64::from(i)).map(|nm| (nm, f(nm)));
                        spectrum::Spectrum::from_samples(&all.collect::<Vec<_>>(), Outside::Hold)
                    };
                    for (name, made) in [
                        ("eta", curve(&|nm| data.index.as_ref().map_or(1.0, |index| index.at(nm)))),
                        ("k", curve(&|nm| data.k_at(nm))),
                    ] {
                        if let Ok(made) = made {
                            self.curve(name, &made, 1.0);
                        }
                    }
                }
            }
            ConductorIndex::Written { eta, k } => {
                self.spectrum("eta", eta, Role::OpticalConstant);
                self.spectrum("k", k, Role::OpticalConstant);
            }
        }
        self.tint("specular_reflectance", &m.tint);
        self.roughness(&m.roughness, m.distribution);
    }

    fn dielectric(&mut self, m: &Dielectric, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        let rough = bends_roughly(m);
        self.indices(&m.ior, &m.exterior_ior, rough);
        self.tints(&m.reflection_tint, &m.transmission_tint);
        if rough {
            self.roughness(&m.roughness, m.distribution);
        }
    }

    fn thin(&mut self, m: &ThinDielectric, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        self.indices(&m.ior, &m.exterior_ior, false);
        self.tints(&m.reflection_tint, &m.transmission_tint);
    }

    fn plastic(&mut self, m: &Plastic, attributes: &Attributes) {
        self.open_owned("bsdf", attributes);
        match self.lacks_mean(&m.reflectance) {
            true => self.xml.value("float", "diffuse_reflectance", 0.5),
            false => self.spectrum_or_texture("diffuse_reflectance", &m.reflectance, Role::Reflectance),
        }
        if !self.lacks_mean(&m.tint) {
            self.tint("specular_reflectance", &m.tint);
        }
        self.indices(&m.ior, &m.exterior_ior, m.roughness > 0.0);
        self.xml.value("boolean", "nonlinear", m.nonlinear);
        if m.roughness > 0.0 {
            self.roughness(&Roughness::Number(m.roughness), m.distribution);
        }
    }

    fn indices(&mut self, inside: &Index, outside: &Index, rough: bool) {
        let apart = if rough && alike(inside, outside) { APART } else { 1.0 };
        self.xml.value("float", "int_ior", at_d(inside) * apart);
        self.xml.value("float", "ext_ior", at_d(outside));
    }

    fn tints(&mut self, reflection: &SpectrumOrTexture, transmission: &SpectrumOrTexture) {
        self.tint("specular_reflectance", reflection);
        self.tint("specular_transmittance", transmission);
    }

    /// A factor, where it is one.
    fn tint(&mut self, name: &str, tint: &SpectrumOrTexture) {
        if *tint != SpectrumOrTexture::Spectrum(Spectrum::Number(1.0)) {
            self.spectrum_or_texture(name, tint, Role::Reflectance);
        }
    }

    fn roughness(&mut self, roughness: &Roughness, distribution: Distribution) {
        match roughness {
            Roughness::Number(alpha) if *alpha == 0.0 => return,
            Roughness::Number(alpha) => self.xml.value("float", "alpha", alpha),
            Roughness::Texture(name) => self.numbers_of(Some("alpha"), name),
            Roughness::Brushed(brushed) => {
                self.number("alpha_u", &brushed.u);
                self.number("alpha_v", &brushed.v);
            }
        }
        let name = match distribution {
            Distribution::Ggx => "ggx",
            Distribution::Beckmann => "beckmann",
        };
        self.xml.value("string", "distribution", name);
    }
}

/// Whether the back of a material is like its front.
fn both_sides(material: &Material) -> bool {
    match material {
        Material::Diffuse(m) => m.two_sided,
        Material::Conductor(m) => m.two_sided,
        Material::Plastic(m) => m.two_sided,
        Material::Principled(m) => m.two_sided,
        Material::Mirror(_) => true,
        _ => false,
    }
}

fn plugin(smooth: &'static str, rough: &'static str, roughness: &Roughness) -> &'static str {
    if is_rough(roughness) { rough } else { smooth }
}

fn is_rough(roughness: &Roughness) -> bool {
    *roughness != Roughness::Number(0.0)
}

/// Whether glass scatters what it bends. Of the index around it it bends nothing and is clear, however rough: Mitsuba's rough
/// glass wants another index, and facets that hide each other take light at any (6 to 10 % in even light where alpha is 0.3).
fn bends_roughly(m: &Dielectric) -> bool {
    is_rough(&m.roughness) && at_d(&m.ior) != at_d(&m.exterior_ior)
}

fn dispersive(inside: &Index, outside: &Index) -> Option<String> {
    let constant = |index: &Index| matches!(index, Index::Number(_));
    (!constant(inside) || !constant(outside)).then(|| {
        format!("the index at {D_LINE_NM} nm, {:.4} over {:.4}: Mitsuba has no dispersion", at_d(inside), at_d(outside))
    })
}

/// Whether both are one index to Mitsuba.
fn alike(inside: &Index, outside: &Index) -> bool {
    at_d(inside) as f32 == at_d(outside) as f32
}

/// Whether a body takes light away inside: by what is written, else by the file of its index.
pub(super) fn absorbs(m: &Dielectric) -> bool {
    match (&m.absorption, &m.ior) {
        (Some(absorption), _) => *absorption != Absorption::None,
        (None, Index::File(file)) => optical_data(file, ReadK::Needed).is_ok_and(|data| data.k.is_some()),
        (None, _) => false,
    }
}

/// The index at the d line; 1.5 where it cannot be had, which the compiler will say.
fn at_d(index: &Index) -> f64 {
    let curve = match index {
        Index::Number(n) => return *n,
        Index::Abbe(abbe) => return abbe.nd,
        Index::Glass(name) => catalogue::glass(name).ok(),
        Index::Sellmeier(s) => Some(RefractiveIndex::sellmeier(s.b, s.c)),
        Index::Cauchy(c) => Some(RefractiveIndex::Cauchy { a: vec![c.a, c.b, c.c] }),
        Index::Table(samples) => Some(RefractiveIndex::Table { samples: samples.clone() }),
        Index::Schott(a) => Some(RefractiveIndex::Schott { a: *a }),
        Index::Formula(f) => RefractiveIndex::formula(f.number, &f.coefficients).ok(),
        Index::File(file) => optical_data(file, ReadK::PassedOver).ok().and_then(|data| data.index),
    };
    curve.map_or(1.5, |curve| curve.at(D_LINE_NM))
}
