//! Materials as they are written.

use serde::Deserialize;

use super::absorption::Absorption;
use super::coating::{Film, Thickness};
use super::compound::{Blend, Bump, Mask, NormalMap, Roughness, TwoSided};
use super::fault::Checker;
use super::hair::Hair;
use super::path::At;
use super::principled::{Principled, PrincipledThin};
use super::spectrum::{FilePath, Index, Role, Spectrum, SpectrumOrTexture, yes};

/// The material of a shape: the name of one, or one written in place.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(clippy::large_enum_variant, reason = "one a shape, read once")]
pub enum MaterialRef {
    /// A name under `materials`.
    Name(String),
    /// A material of its own.
    Inline(Material),
}

impl Default for MaterialRef {
    fn default() -> MaterialRef {
        MaterialRef::Inline(Material::default())
    }
}

/// How a surface scatters light.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Material {
    /// Lambert's law.
    Diffuse(Diffuse),
    /// A metal.
    Conductor(Conductor),
    /// An ideal mirror without Fresnel effects.
    Mirror(Mirror),
    /// The boundary between two transparent media: glass, water.
    Dielectric(Dielectric),
    /// A sheet of glass without thickness: reflects and transmits, does not bend.
    ThinDielectric(ThinDielectric),
    /// A diffuse base under a dielectric coat.
    Plastic(Plastic),
    /// Many looks from a few numbers.
    Principled(Principled),
    /// The same for a sheet.
    PrincipledThin(PrincipledThin),
    /// Fibres of hair.
    Hair(Hair),
    /// Invisible; only bounds a medium.
    Boundary(Boundary),
    /// Lets a share of the light through, straight on.
    Mask(Mask),
    /// Two materials by weight.
    Blend(Blend),
    /// A material for each side.
    TwoSided(TwoSided),
    /// A material over a relief.
    Bump(Bump),
    /// A material over a relief given by its normals.
    NormalMap(NormalMap),
}

impl Default for Material {
    /// Diffuse, reflectance 0.5.
    fn default() -> Material {
        Material::Diffuse(Diffuse { reflectance: half(), highlight: None, two_sided: true })
    }
}

/// `diffuse: {reflectance: SPECTRUM_OR_TEXTURE, highlight: {…}, two_sided: true}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diffuse {
    /// Albedo, 0 to 1; default 0.5.
    #[serde(default = "half")]
    pub reflectance: SpectrumOrTexture,
    /// Highlight of the `whitted` integrator; default none.
    pub highlight: Option<Highlight>,
    /// Whether the back reflects like the front; default true.
    #[serde(default = "yes")]
    pub two_sided: bool,
}

/// `conductor: {metal: gold}` or `conductor: {eta: SPECTRUM, k: SPECTRUM}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenConductor")]
pub struct Conductor {
    /// The complex index of refraction η + ik.
    pub index: ConductorIndex,
    /// Factor on the reflection; default 1.
    pub tint: SpectrumOrTexture,
    /// Microfacet roughness α; 0, the default, is a perfect mirror.
    pub roughness: Roughness,
    /// Distribution of the microfacet normals; default `ggx`.
    pub distribution: Distribution,
    /// Fresnel's equations or Schlick's approximation; default `exact`.
    pub fresnel: Fresnel,
    /// A thin film on it; default none.
    pub film: Option<Film>,
    /// Highlight of the `whitted` integrator; default none.
    pub highlight: Option<Highlight>,
    /// Whether the back reflects like the front; default true.
    pub two_sided: bool,
}

/// The complex index of refraction of a metal.
#[derive(Clone, Debug, PartialEq)]
pub enum ConductorIndex {
    /// Measured, by name: `gold`.
    Metal(String),
    /// Measured, as refractiveindex.info writes it: `Au.yml`.
    File(FilePath),
    /// Written out.
    Written {
        /// Real part η, relative to vacuum.
        eta: Spectrum,
        /// Imaginary part k.
        k: Spectrum,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenConductor {
    metal: Option<String>,
    file: Option<FilePath>,
    eta: Option<Spectrum>,
    k: Option<Spectrum>,
    #[serde(default = "unit")]
    tint: SpectrumOrTexture,
    #[serde(default)]
    roughness: Roughness,
    #[serde(default)]
    distribution: Distribution,
    #[serde(default)]
    fresnel: Fresnel,
    film: Option<Film>,
    highlight: Option<Highlight>,
    #[serde(default = "yes")]
    two_sided: bool,
}

impl TryFrom<WrittenConductor> for Conductor {
    type Error = String;

    fn try_from(written: WrittenConductor) -> Result<Conductor, String> {
        let index = match (written.metal, written.file, written.eta, written.k) {
            (Some(metal), None, None, None) => ConductorIndex::Metal(metal),
            (None, Some(file), None, None) => ConductorIndex::File(file),
            (None, None, Some(eta), Some(k)) => ConductorIndex::Written { eta, k },
            (metal, file, eta, k) => {
                let given =
                    [("metal", metal.is_some()), ("file", file.is_some()), ("eta", eta.is_some()), ("k", k.is_some())];
                return Err(format!("expected either metal, or file, or eta and k, found {}", given_fields(&given)));
            }
        };
        Ok(Conductor {
            index,
            tint: written.tint,
            roughness: written.roughness,
            distribution: written.distribution,
            fresnel: written.fresnel,
            film: written.film,
            highlight: written.highlight,
            two_sided: written.two_sided,
        })
    }
}

/// The names of the fields that are given, joined by "and"; "neither" without any.
pub(crate) fn given_fields(fields: &[(&str, bool)]) -> String {
    let given: Vec<&str> = fields.iter().filter(|(_, given)| *given).map(|(name, _)| *name).collect();
    if given.is_empty() { "neither".to_owned() } else { given.join(" and ") }
}

/// `mirror: {reflectance: 0.9}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mirror {
    /// 0 to 1; default 0.9.
    #[serde(default = "nine_tenths")]
    pub reflectance: Spectrum,
    /// Highlight of the `whitted` integrator; default none.
    pub highlight: Option<Highlight>,
}

/// `dielectric: {ior: INDEX}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dielectric {
    /// Index inside.
    pub ior: Index,
    /// Index outside; default 1.
    #[serde(default = "vacuum")]
    pub exterior_ior: Index,
    /// Microfacet roughness α; 0, the default, is smooth.
    #[serde(default)]
    pub roughness: Roughness,
    /// Distribution of the microfacet normals; default `ggx`.
    #[serde(default)]
    pub distribution: Distribution,
    /// Fresnel's equations or Schlick's approximation; default `exact`.
    #[serde(default)]
    pub fresnel: Fresnel,
    /// Factor on the reflection; default 1.
    #[serde(default = "unit")]
    pub reflection_tint: SpectrumOrTexture,
    /// Factor on the transmission; default 1.
    #[serde(default = "unit")]
    pub transmission_tint: SpectrumOrTexture,
    /// Which of two bodies has the place where they overlap: that of the higher one; default none.
    pub priority: Option<i32>,
    /// A thin film on it; default none.
    pub film: Option<Film>,
    /// How its inside absorbs; default by the k of the file of its index, if it has one.
    pub absorption: Option<Absorption>,
    /// Highlight of the `whitted` integrator; default none.
    pub highlight: Option<Highlight>,
}

/// `thin_dielectric: {ior: INDEX}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThinDielectric {
    /// Index of the sheet.
    pub ior: Index,
    /// Index around it; default 1.
    #[serde(default = "vacuum")]
    pub exterior_ior: Index,
    /// Thickness, nm, where it is so small that light reflected by the two faces interferes; default none.
    pub thickness_nm: Option<Thickness>,
    /// Factor on the reflection; default 1.
    #[serde(default = "unit")]
    pub reflection_tint: SpectrumOrTexture,
    /// Factor on the transmission; default 1.
    #[serde(default = "unit")]
    pub transmission_tint: SpectrumOrTexture,
}

/// `plastic: {reflectance: SPECTRUM_OR_TEXTURE}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plastic {
    /// Albedo of the base, 0 to 1; default 0.5.
    #[serde(default = "half")]
    pub reflectance: SpectrumOrTexture,
    /// Index of the coat; default 1.5.
    #[serde(default = "coat")]
    pub ior: Index,
    /// Index outside; default 1.
    #[serde(default = "vacuum")]
    pub exterior_ior: Index,
    /// Microfacet roughness α of the coat; 0, the default, is smooth.
    #[serde(default)]
    pub roughness: f64,
    /// Factor on what the coat reflects; default 1.
    #[serde(default = "unit")]
    pub tint: SpectrumOrTexture,
    /// Whether light that bounces between coat and base takes on more colour each time; default
    /// false.
    #[serde(default)]
    pub nonlinear: bool,
    /// Distribution of the microfacet normals; default `ggx`.
    #[serde(default)]
    pub distribution: Distribution,
    /// Of a rough coat; default `integral`.
    #[serde(default)]
    pub diffuse_mean: DiffuseMean,
    /// Highlight of the `whitted` integrator; default none.
    pub highlight: Option<Highlight>,
    /// Whether the back reflects like the front; default true.
    #[serde(default = "yes")]
    pub two_sided: bool,
}

/// How the diffuse reflectance of a rough coat from inside is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DiffuseMean {
    /// By an integral.
    #[default]
    Integral,
    /// By the mean over 64 cosines from 0 to 1, as Mitsuba 3 does: 1/64 too little.
    Nodes,
}

/// `boundary: {}`
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Boundary {}

/// A highlight that the `whitted` integrator adds; other integrators ignore it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Highlight {
    /// Factor on the light's spectrum; default 0.5.
    #[serde(default = "highlight_strength")]
    pub strength: f64,
    /// Exponent of the cosine; default 50.
    #[serde(default = "highlight_exponent")]
    pub exponent: f64,
    /// Which cosine; default `blinn`.
    #[serde(default)]
    pub model: HighlightModel,
}

/// The cosine of a highlight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HighlightModel {
    /// Between the normal and the half vector.
    #[default]
    Blinn,
    /// Between the viewer and the reflected light.
    Phong,
}

/// Distribution of microfacet normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Trowbridge–Reitz.
    #[default]
    Ggx,
    /// Beckmann.
    Beckmann,
}

/// How reflection depends on the angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fresnel {
    /// Fresnel's equations.
    #[default]
    Exact,
    /// Schlick's approximation.
    Schlick,
}

fn half() -> SpectrumOrTexture {
    SpectrumOrTexture::Spectrum(Spectrum::Number(0.5))
}

fn unit() -> SpectrumOrTexture {
    SpectrumOrTexture::Spectrum(Spectrum::Number(1.0))
}

fn nine_tenths() -> Spectrum {
    Spectrum::Number(0.9)
}

fn vacuum() -> Index {
    Index::Number(1.0)
}

fn coat() -> Index {
    Index::Number(1.5)
}

fn highlight_strength() -> f64 {
    0.5
}

fn highlight_exponent() -> f64 {
    50.0
}

impl MaterialRef {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        match self {
            MaterialRef::Name(name) => checker.material(at, name),
            MaterialRef::Inline(material) => material.check(at, checker),
        }
    }
}

impl Material {
    /// Names of the kinds.
    pub(crate) const KINDS: [&'static str; 15] = [
        "diffuse",
        "conductor",
        "mirror",
        "dielectric",
        "thin_dielectric",
        "plastic",
        "principled",
        "principled_thin",
        "hair",
        "boundary",
        "mask",
        "blend",
        "two_sided",
        "bump",
        "normal_map",
    ];

    /// What the material is made of, if of others.
    #[must_use]
    pub fn inner(&self) -> Vec<&MaterialRef> {
        match self {
            Material::Mask(m) => vec![&m.material],
            Material::Blend(m) => vec![&m.first, &m.second],
            Material::TwoSided(m) => std::iter::once(&m.front).chain(&m.back).map(|m| &**m).collect(),
            Material::Bump(m) => vec![&m.material],
            Material::NormalMap(m) => vec![&m.material],
            Material::Diffuse(_) | Material::Conductor(_) | Material::Mirror(_) => Vec::new(),
            Material::Dielectric(_) | Material::ThinDielectric(_) | Material::Plastic(_) => Vec::new(),
            Material::Principled(_) | Material::PrincipledThin(_) => Vec::new(),
            Material::Hair(_) | Material::Boundary(_) => Vec::new(),
        }
    }

    /// The key under which the material is written.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Material::Diffuse(_) => "diffuse",
            Material::Conductor(_) => "conductor",
            Material::Mirror(_) => "mirror",
            Material::Dielectric(_) => "dielectric",
            Material::ThinDielectric(_) => "thin_dielectric",
            Material::Plastic(_) => "plastic",
            Material::Principled(_) => "principled",
            Material::PrincipledThin(_) => "principled_thin",
            Material::Hair(_) => "hair",
            Material::Boundary(_) => "boundary",
            Material::Mask(_) => "mask",
            Material::Blend(_) => "blend",
            Material::TwoSided(_) => "two_sided",
            Material::Bump(_) => "bump",
            Material::NormalMap(_) => "normal_map",
        }
    }

    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        let at = at.key(self.kind());
        match self {
            Material::Diffuse(diffuse) => {
                diffuse.reflectance.check(Role::Reflectance, at.key("reflectance"), checker);
                check_highlight(diffuse.highlight, at, checker);
            }
            Material::Conductor(conductor) => {
                if let ConductorIndex::Written { eta, k } = &conductor.index {
                    eta.check(Role::OpticalConstant, at.key("eta"), checker);
                    k.check(Role::OpticalConstant, at.key("k"), checker);
                }
                conductor.tint.check(Role::Reflectance, at.key("tint"), checker);
                conductor.roughness.check(at.key("roughness"), checker);
                check_film(conductor.film.as_ref(), conductor.fresnel, at, checker);
                check_highlight(conductor.highlight, at, checker);
            }
            Material::Mirror(mirror) => {
                mirror.reflectance.check(Role::Reflectance, at.key("reflectance"), checker);
                check_highlight(mirror.highlight, at, checker);
            }
            Material::Dielectric(dielectric) => {
                dielectric.ior.check(at.key("ior"), checker);
                let alone = dielectric.priority.is_none() || dielectric.exterior_ior == vacuum();
                if alone {
                    dielectric.exterior_ior.check(at.key("exterior_ior"), checker);
                } else {
                    let expected = "none beside priority: the index outside is that of the body around";
                    checker.require(false, at.key("exterior_ior"), expected, "one");
                }
                dielectric.roughness.check(at.key("roughness"), checker);
                dielectric.reflection_tint.check(Role::Reflectance, at.key("reflection_tint"), checker);
                dielectric.transmission_tint.check(Role::Reflectance, at.key("transmission_tint"), checker);
                if let Some(absorption) = &dielectric.absorption {
                    absorption.check(at.key("absorption"), checker);
                }
                check_film(dielectric.film.as_ref(), dielectric.fresnel, at, checker);
                check_highlight(dielectric.highlight, at, checker);
            }
            Material::ThinDielectric(sheet) => {
                sheet.ior.check(at.key("ior"), checker);
                sheet.exterior_ior.check(at.key("exterior_ior"), checker);
                if let Some(thickness) = &sheet.thickness_nm {
                    thickness.check(at.key("thickness_nm"), checker);
                }
                sheet.reflection_tint.check(Role::Reflectance, at.key("reflection_tint"), checker);
                sheet.transmission_tint.check(Role::Reflectance, at.key("transmission_tint"), checker);
            }
            Material::Plastic(plastic) => {
                plastic.reflectance.check(Role::Reflectance, at.key("reflectance"), checker);
                plastic.ior.check(at.key("ior"), checker);
                plastic.exterior_ior.check(at.key("exterior_ior"), checker);
                plastic.tint.check(Role::Reflectance, at.key("tint"), checker);
                checker.roughness(at.key("roughness"), plastic.roughness);
                check_highlight(plastic.highlight, at, checker);
            }
            Material::Principled(surface) => surface.check(at, checker),
            Material::PrincipledThin(sheet) => sheet.check(at, checker),
            Material::Hair(hair) => hair.check(at, checker),
            Material::Boundary(Boundary {}) => {}
            Material::Mask(mask) => mask.check(at, checker),
            Material::Blend(blend) => blend.check(at, checker),
            Material::TwoSided(sides) => sides.check(at, checker),
            Material::Bump(bump) => bump.check(at, checker),
            Material::NormalMap(map) => map.check(at, checker),
        }
    }
}

/// A film counts by Fresnel's equations.
fn check_film<'a>(film: Option<&'a Film>, fresnel: Fresnel, at: At<'_>, checker: &mut Checker<'a>) {
    if let Some(film) = film {
        film.check(at.key("film"), checker);
        checker.require(fresnel == Fresnel::Exact, at.key("fresnel"), "exact under a film", "schlick");
    }
}

fn check_highlight(highlight: Option<Highlight>, at: At<'_>, checker: &mut Checker<'_>) {
    if let Some(highlight) = highlight {
        let at = at.key("highlight");
        checker.not_negative(at.key("strength"), highlight.strength);
        // A factor on light, and held as light is.
        let held = highlight.strength <= f64::from(f32::MAX);
        checker.require(held, at.key("strength"), "a number from 0 to 3.4e38", highlight.strength);
        checker.not_negative(at.key("exponent"), highlight.exponent);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    #[test]
    fn a_conductor_is_a_metal_or_eta_and_k() {
        let conductor = |fields: &str| faults(&format!("materials:\n  a: {{conductor: {{{fields}}}}}"));
        let place = "dir/s.yaml:3:18: materials.a.conductor: expected either metal, or file, or eta and k, found ";
        assert_eq!(conductor(""), format!("{place}neither"));
        assert_eq!(conductor("eta: 1"), format!("{place}eta"));
        assert_eq!(conductor("metal: gold, k: 1"), format!("{place}metal and k"));
        assert_eq!(conductor("eta: 1, k: 2"), "none");
        assert_eq!(
            conductor("eta: -1, k: -2, tint: 3, roughness: -1"),
            "dir/s.yaml:3:24: materials.a.conductor.eta: expected a number from 0 to 1e6, found -1\n\
             dir/s.yaml:3:31: materials.a.conductor.k: expected a number from 0 to 1e6, found -2\n\
             dir/s.yaml:3:41: materials.a.conductor.tint: expected a number from 0 to 1, found 3\n\
             dir/s.yaml:3:55: materials.a.conductor.roughness: expected a roughness, a number from 0 to 10, found -1"
        );
    }

    #[test]
    fn every_kind_is_checked() {
        let a = |kind: &str| faults(&format!("materials:\n  a: {{{kind}}}"));
        assert_eq!(
            a("diffuse: {reflectance: 2}"),
            "dir/s.yaml:3:30: materials.a.diffuse.reflectance: expected a number from 0 to 1, found 2"
        );
        assert_eq!(
            a("diffuse: {highlight: {strength: 1.0e39}}"),
            "dir/s.yaml:3:39: materials.a.diffuse.highlight.strength: expected a number from 0 to 3.4e38, found 1e39"
        );
        assert_eq!(
            a("diffuse: {highlight: {strength: -1, exponent: -2}}"),
            "dir/s.yaml:3:39: materials.a.diffuse.highlight.strength: expected a number of 0 or more, found -1\n\
             dir/s.yaml:3:53: materials.a.diffuse.highlight.exponent: expected a number of 0 or more, found -2"
        );
        assert_eq!(
            a("thin_dielectric: {ior: 1, exterior_ior: 0}"),
            "dir/s.yaml:3:47: materials.a.thin_dielectric.exterior_ior: expected an index of refraction, a number from 0.1 to 10, found 0"
        );
        assert_eq!(
            a("plastic: {reflectance: 2, ior: 0, roughness: -1}"),
            "dir/s.yaml:3:30: materials.a.plastic.reflectance: expected a number from 0 to 1, found 2\n\
             dir/s.yaml:3:38: materials.a.plastic.ior: expected an index of refraction, a number from 0.1 to 10, found 0\n\
             dir/s.yaml:3:52: materials.a.plastic.roughness: expected a roughness, a number from 0 to 10, found -1"
        );
    }

    #[test]
    fn an_unknown_name_is_told_with_its_near_miss() {
        assert_eq!(
            faults(
                "textures: {floor: {checkerboard: {a: 0, b: 1}}}\nmaterials:\n  a: {diffuse: {reflectance: {texture: flor}}}"
            ),
            "dir/s.yaml:4:40: materials.a.diffuse.reflectance.texture: unknown texture \"flor\"; did you mean \"floor\"?"
        );
        assert_eq!(
            faults("materials: {clay: {diffuse: {}}}\nshapes:\n- sphere: {radius: 1, material: gold}"),
            "dir/s.yaml:4:33: shapes[0].sphere.material: unknown material \"gold\"; known: clay"
        );
        assert_eq!(
            faults("shapes:\n- sphere: {radius: 1, material: boundary}"),
            "dir/s.yaml:3:33: shapes[0].sphere.material: unknown material \"boundary\"; \
             the kind is written {boundary: {…}}"
        );
        // A name that needs quotes in a path gets them.
        assert_eq!(
            faults("materials:\n  dark.red: {mirror: {reflectance: 2}}"),
            "dir/s.yaml:3:36: materials.\"dark.red\".mirror.reflectance: expected a number from 0 to 1, found 2"
        );
    }

    #[test]
    fn the_names_of_kinds_are_those_of_the_grammar() {
        for kind in Material::KINDS {
            let fields = match kind {
                "conductor" => "metal: gold",
                "dielectric" | "thin_dielectric" => "ior: 1.5",
                "mask" => "material: {diffuse: {}}",
                "blend" => "first: {diffuse: {}}, second: {mirror: {}}",
                "two_sided" => "front: {diffuse: {}}",
                "bump" => "height: {texture: t}, material: {diffuse: {}}",
                "normal_map" => "normals: {texture: t}, material: {diffuse: {}}",
                _ => "",
            };
            let scene = scene(&format!(
                "textures: {{t: {{checkerboard: {{a: 0, b: 1}}}}}}\nmaterials: {{a: {{{kind}: {{{fields}}}}}}}"
            ));
            assert_eq!(scene.materials["a"].kind(), kind);
        }
    }
}
