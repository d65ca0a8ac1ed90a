//! Spectra and refractive indices as they are written.

use std::fmt;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{self, Deserializer, Visitor};

use super::decode::{FILE_PATH, whole};
use super::fault::Checker;
use super::path::At;
use crate::error::in_short;
use crate::spectrum::index::INDICES;

/// Three numbers: a position or a vector, metres; or a colour.
pub type Vec3 = [f64; 3];

/// The path of a file, relative to the working directory of the process.
///
/// In YAML it is relative to the file in which it is written (on the command line: to the working
/// directory); reading joins the two.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FilePath(pub PathBuf);

impl Deref for FilePath {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl<'de> Deserialize<'de> for FilePath {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<FilePath, D::Error> {
        deserializer.deserialize_newtype_struct(FILE_PATH, FilePathVisitor)
    }
}

struct FilePathVisitor;

impl<'de> Visitor<'de> for FilePathVisitor {
    type Value = FilePath;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the path of a file")
    }

    fn visit_newtype_struct<D: Deserializer<'de>>(self, deserializer: D) -> Result<FilePath, D::Error> {
        deserializer.deserialize_bytes(self)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<FilePath, E> {
        Ok(FilePath(text.into()))
    }

    fn visit_bytes<E: de::Error>(self, bytes: &[u8]) -> Result<FilePath, E> {
        #[cfg(unix)]
        {
            use std::os::unix::ffi::OsStrExt;
            Ok(FilePath(std::ffi::OsStr::from_bytes(bytes).into()))
        }
        #[cfg(not(unix))]
        match str::from_utf8(bytes) {
            Ok(text) => Ok(FilePath(text.into())),
            Err(_) => Err(E::custom("expected a directory whose name is Unicode")),
        }
    }
}

/// A function of wavelength. Its unit is that of the field in which it stands.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Spectrum {
    /// `0.5`: the same at every wavelength.
    Number(f64),
    /// `{rgb: [r, g, b]}`: linear Rec. 709, made a spectrum by upsampling.
    Rgb(Vec3),
    /// `{table: [[nm, value], …]}`: linear between the entries; wavelengths increase.
    Table(Vec<[f64; 2]>),
    /// `{file: path.csv}`: a table of two columns.
    File(FilePath),
    /// `{blackbody: {kelvin: 5000}}`: Planck's law.
    Blackbody(Blackbody),
    /// `{illuminant: D65}` or `{illuminant: {name: D65, scale: 3}}`: a CIE illuminant by name.
    Illuminant(Illuminant),
    /// `{lines: [{nm: 589}]}`: emission lines.
    Lines(Vec<Line>),
    /// `{scaled: {by: 2, of: SPECTRUM}}`.
    Scaled(Scaled),
    /// `{zero_outside: SPECTRUM}`: a table or file, 0 beyond its ends.
    ZeroOutside(Box<Spectrum>),
}

/// Planck's law.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blackbody {
    /// Temperature, K.
    pub kelvin: f64,
    /// Factor; default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Whether the curve is scaled to luminance 1, that of 1 at every wavelength, as illuminants are; default true. If not,
    /// it is radiance in W·m⁻²·sr⁻¹·nm⁻¹.
    #[serde(default = "yes")]
    pub normalised: bool,
}

/// A CIE illuminant, scaled to luminance 1, that of 1 at every wavelength.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(from = "WrittenIlluminant")]
pub struct Illuminant {
    /// Its name, such as `D65`, `A`, `E`.
    pub name: String,
    /// Factor; default 1.
    pub scale: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum WrittenIlluminant {
    Name(String),
    Inline(IlluminantFields),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct IlluminantFields {
    name: String,
    #[serde(default = "one")]
    scale: f64,
}

impl From<WrittenIlluminant> for Illuminant {
    fn from(written: WrittenIlluminant) -> Illuminant {
        match written {
            WrittenIlluminant::Name(name) => Illuminant { name, scale: 1.0 },
            WrittenIlluminant::Inline(IlluminantFields { name, scale }) => Illuminant { name, scale },
        }
    }
}

/// One emission line.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Centre, nm.
    pub nm: f64,
    /// Integral over wavelength, in the unit of the field times nm; default 1.
    #[serde(default = "one")]
    pub power: f64,
    /// Full width, nm; default 1.
    #[serde(default = "one")]
    pub width_nm: f64,
}

/// A spectrum times a number.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scaled {
    /// The number.
    pub by: f64,
    /// The spectrum.
    pub of: Box<Spectrum>,
}

/// A spectrum, or the name of a texture that gives one at each point.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SpectrumOrTexture {
    /// `{texture: name}`.
    Texture(String),
    /// Any [`Spectrum`].
    #[serde(rename = "inline")]
    Spectrum(Spectrum),
}

/// A refractive index as a function of wavelength, relative to vacuum.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Index {
    /// `1.5`: without dispersion.
    Number(f64),
    /// `{glass: N-SF11}`: by catalogue name.
    Glass(String),
    /// `{sellmeier: {b: [..3], c: [..3]}}`.
    Sellmeier(Sellmeier),
    /// `{cauchy: [a, b]}` or `{cauchy: [a, b, c]}`.
    Cauchy(Cauchy),
    /// `{abbe: {nd: 1.5, vd: 30}}`.
    Abbe(Abbe),
    /// `{table: [[nm, n], …]}`: wavelengths increase.
    Table(Vec<[f64; 2]>),
    /// `{schott: [..6]}`: n² = a₀ + a₁λ² + a₂λ⁻² + a₃λ⁻⁴ + a₄λ⁻⁶ + a₅λ⁻⁸, λ in µm.
    Schott([f64; 6]),
    /// `{formula: {number: 2, coefficients: […]}}`: of refractiveindex.info.
    Formula(NumberedFormula),
    /// `{file: N-BK7.yml}`: as refractiveindex.info writes them.
    File(FilePath),
}

/// A formula of refractiveindex.info.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumberedFormula {
    /// Which one, from 1 to 9.
    #[serde(deserialize_with = "whole::<_, 1, 9>")]
    pub number: u32,
    /// As the database lists them, λ in µm.
    pub coefficients: Vec<f64>,
}

/// Sellmeier's equation, n² = 1 + Σ bᵢ λ² / (λ² − cᵢ), λ in µm.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sellmeier {
    /// Strengths bᵢ.
    pub b: [f64; 3],
    /// Squared resonances cᵢ, µm².
    pub c: [f64; 3],
}

/// Cauchy's equation, n = a + b/λ² + c/λ⁴, λ in µm.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Vec<f64>")]
pub struct Cauchy {
    /// Constant term.
    pub a: f64,
    /// Of λ⁻², µm².
    pub b: f64,
    /// Of λ⁻⁴, µm⁴; default 0.
    pub c: f64,
}

impl TryFrom<Vec<f64>> for Cauchy {
    type Error = String;

    fn try_from(written: Vec<f64>) -> Result<Cauchy, String> {
        match written[..] {
            [a, b] => Ok(Cauchy { a, b, c: 0.0 }),
            [a, b, c] => Ok(Cauchy { a, b, c }),
            _ => Err(format!("expected 2 or 3 numbers, found {}", written.len())),
        }
    }
}

/// An index by two figures of the trade.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Abbe {
    /// Index at the d line, 587.56 nm.
    pub nd: f64,
    /// Abbe number (n_d − 1) / (n_F − n_C).
    pub vd: f64,
}

/// What a spectrum stands for, and so which values it may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Role {
    /// From 0 to 1.
    Reflectance,
    /// 0 or more.
    Emission,
    /// 0 or more, and nothing that emits: σ.
    Coefficient,
    /// η and k: from 0 to [`MOST_CONSTANT`], and nothing that emits.
    OpticalConstant,
}

/// The largest optical constant of a metal. Fresnel's equations take fourth powers of it.
const MOST_CONSTANT: f64 = 1e6;

/// What a lane of light can hold.
const MOST_LIGHT: f64 = f32::MAX as f64;

impl Spectrum {
    pub(crate) fn check(&self, role: Role, at: At<'_>, checker: &mut Checker<'_>) {
        self.check_times(1.0, role, at, checker);
    }

    /// Checks the spectrum times `by`.
    fn check_times(&self, by: f64, role: Role, at: At<'_>, checker: &mut Checker<'_>) {
        let number = |role: Role, value: f64, at: At<'_>, checker: &mut Checker<'_>| {
            let times = if by == 1.0 { String::new() } else { format!(" times {}", in_short(by)) };
            let (holds, expected) = match role {
                Role::Reflectance => ((0.0..=1.0).contains(&(value * by)), "a number from 0 to 1"),
                Role::Emission | Role::Coefficient if value * by > MOST_LIGHT => (false, "a number from 0 to 3.4e38"),
                Role::Emission | Role::Coefficient => (value * by >= 0.0, "a number of 0 or more"),
                Role::OpticalConstant => ((0.0..=MOST_CONSTANT).contains(&(value * by)), "a number from 0 to 1e6"),
            };
            checker.require(holds, at, expected, format_args!("{}{times}", in_short(value)));
        };
        let value = |value: f64, at: At<'_>, checker: &mut Checker<'_>| number(role, value, at, checker);
        let emits = |kind: &str, checker: &mut Checker<'_>| {
            if role != Role::Emission {
                let expected = "a spectrum that does not emit (number, rgb, table, file)";
                checker.require(false, at, expected, kind);
            }
        };
        match self {
            Spectrum::Number(number) => value(*number, at, checker),
            Spectrum::Rgb(rgb) => {
                let at = at.key("rgb");
                for (i, &channel) in rgb.iter().enumerate() {
                    value(channel, at.index(i), checker);
                }
            }
            Spectrum::Table(table) => {
                let at = at.key("table");
                check_wavelengths(table, at, checker);
                for (i, pair) in table.iter().enumerate() {
                    value(pair[1], at.index(i).index(1), checker);
                }
            }
            Spectrum::File(_) => {}
            Spectrum::Blackbody(blackbody) => {
                emits("blackbody", checker);
                let at = at.key("blackbody");
                checker.positive(at.key("kelvin"), blackbody.kelvin);
                number(Role::Emission, blackbody.scale, at.key("scale"), checker);
            }
            Spectrum::Illuminant(illuminant) => {
                emits("illuminant", checker);
                number(Role::Emission, illuminant.scale, at.key("illuminant").key("scale"), checker);
            }
            Spectrum::Lines(lines) => {
                emits("lines", checker);
                let at = at.key("lines");
                checker.require(!lines.is_empty(), at, "at least one line", "none");
                for (i, line) in lines.iter().enumerate() {
                    let at = at.index(i);
                    checker.positive(at.key("nm"), line.nm);
                    number(Role::Emission, line.power, at.key("power"), checker);
                    checker.positive(at.key("width_nm"), line.width_nm);
                }
            }
            Spectrum::ZeroOutside(inner) => {
                let at = at.key("zero_outside");
                let ends = matches!(**inner, Spectrum::Table(_) | Spectrum::File(_));
                checker.require(ends, at, "a table or a file", "a spectrum without ends");
                inner.check_times(by, role, at, checker);
            }
            Spectrum::Scaled(scaled) => {
                let at = at.key("scaled");
                checker.not_negative(at.key("by"), scaled.by);
                // A negative factor is one fault, not one more for each value.
                scaled.of.check_times(by * scaled.by.abs(), role, at.key("of"), checker);
            }
        }
    }
}

impl SpectrumOrTexture {
    /// The name of the texture, if it is one.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        match self {
            SpectrumOrTexture::Texture(name) => Some(name),
            SpectrumOrTexture::Spectrum(_) => None,
        }
    }

    pub(crate) fn check<'a>(&'a self, role: Role, at: At<'_>, checker: &mut Checker<'a>) {
        match self {
            SpectrumOrTexture::Spectrum(spectrum) => spectrum.check(role, at, checker),
            SpectrumOrTexture::Texture(name) => {
                checker.texture(at.key("texture"), name);
                if role == Role::Reflectance {
                    checker.reflecting_textures.insert(name);
                }
            }
        }
    }
}

impl Index {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        match self {
            Index::Number(n) => checker.index(at, *n),
            Index::Glass(_) | Index::Schott(_) | Index::Formula(_) | Index::File(_) => {}
            Index::Sellmeier(Sellmeier { c, .. }) => {
                let at = at.key("sellmeier");
                let at = at.key("c");
                for (i, &c) in c.iter().enumerate() {
                    checker.not_negative(at.index(i), c);
                }
            }
            Index::Cauchy(cauchy) => checker.index(at.key("cauchy").index(0), cauchy.a),
            Index::Abbe(abbe) => {
                let at = at.key("abbe");
                checker.index(at.key("nd"), abbe.nd);
                checker.positive(at.key("vd"), abbe.vd);
            }
            Index::Table(table) => {
                let at = at.key("table");
                check_wavelengths(table, at, checker);
                for (i, pair) in table.iter().enumerate() {
                    checker.index(at.index(i).index(1), pair[1]);
                }
            }
        }
    }
}

impl Checker<'_> {
    /// `found` is an index of refraction.
    pub(crate) fn index(&mut self, at: At<'_>, found: f64) {
        let holds = INDICES.contains(&found);
        self.require(holds, at, "an index of refraction, a number from 0.1 to 10", found);
    }
}

/// Two entries or more, wavelengths positive and strictly increasing.
fn check_wavelengths(table: &[[f64; 2]], at: At<'_>, checker: &mut Checker<'_>) {
    checker.require(table.len() >= 2, at, "at least 2 pairs of wavelength and value", table.len());
    let mut last = 0.0;
    for (i, &[nm, _]) in table.iter().enumerate() {
        let expected = format!("a wavelength above {} nm, for wavelengths increase", in_short(last));
        checker.require(nm > last, at.index(i).index(0), &expected, nm);
        last = nm;
    }
}

pub(crate) fn one() -> f64 {
    1.0
}

pub(crate) fn yes() -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::super::{Light, Material};
    use super::*;

    /// Faults of an emission; the spectrum starts at 4:15.
    fn emission(spectrum: &str) -> String {
        faults(&format!("lights:\n- constant:\n    radiance: {spectrum}"))
    }

    /// Faults of a reflectance; the spectrum starts at 4:26.
    fn reflectance(spectrum: &str) -> String {
        faults(&format!("materials:\n  a:\n    mirror: {{reflectance: {spectrum}}}"))
    }

    /// Faults of an index; it starts at 4:22.
    fn index(index: &str) -> String {
        faults(&format!("materials:\n  a:\n    dielectric: {{ior: {index}}}"))
    }

    const LIGHT: &str = "lights[0].constant.radiance";
    const MIRROR: &str = "materials.a.mirror.reflectance";
    const GLASS: &str = "materials.a.dielectric.ior";

    #[test]
    fn an_emission_is_not_negative() {
        assert_eq!(emission("-0.5"), format!("dir/s.yaml:4:15: {LIGHT}: expected a number of 0 or more, found -0.5"));
        assert_eq!(
            emission("{rgb: [1, -1, 0]}"),
            format!("dir/s.yaml:4:25: {LIGHT}.rgb[1]: expected a number of 0 or more, found -1")
        );
        assert_eq!(emission("{rgb: [10, 20, 0]}"), "none");
    }

    #[test]
    fn a_reflectance_is_at_most_one() {
        assert_eq!(reflectance("1.5"), format!("dir/s.yaml:4:27: {MIRROR}: expected a number from 0 to 1, found 1.5"));
        assert_eq!(
            reflectance("{table: [[400, 0.5], [500, 2]]}"),
            format!("dir/s.yaml:4:54: {MIRROR}.table[1][1]: expected a number from 0 to 1, found 2")
        );
        assert_eq!(
            reflectance("{scaled: {by: 2, of: 0.8}}"),
            format!("dir/s.yaml:4:48: {MIRROR}.scaled.of: expected a number from 0 to 1, found 0.8 times 2")
        );
        assert_eq!(reflectance("{scaled: {by: 2, of: 0.5}}"), "none");
        assert_eq!(
            reflectance("{blackbody: {kelvin: 5000}}"),
            format!(
                "dir/s.yaml:4:27: {MIRROR}: expected a spectrum that does not emit (number, rgb, table, file), \
                 found blackbody"
            )
        );
    }

    #[test]
    fn wavelengths_increase() {
        assert_eq!(
            emission("{table: [[400, 1], [400, 1]]}"),
            format!(
                "dir/s.yaml:4:35: {LIGHT}.table[1][0]: expected a wavelength above 400 nm, for wavelengths increase, found 400"
            )
        );
        assert_eq!(
            emission("{table: [[0, 1], [400, 1]]}"),
            format!(
                "dir/s.yaml:4:25: {LIGHT}.table[0][0]: expected a wavelength above 0 nm, for wavelengths increase, found 0"
            )
        );
        assert_eq!(
            emission("{table: [[400, 1]]}"),
            format!("dir/s.yaml:4:23: {LIGHT}.table: expected at least 2 pairs of wavelength and value, found 1")
        );
        assert_eq!(
            index("{table: [[500, 1.5], [400, 1.6]]}"),
            format!(
                "dir/s.yaml:4:45: {GLASS}.table[1][0]: expected a wavelength above 500 nm, for wavelengths increase, found 400"
            )
        );
    }

    #[test]
    fn parameters_of_emissions_are_in_range() {
        assert_eq!(
            emission("{blackbody: {kelvin: 0, scale: -1}}"),
            format!(
                "dir/s.yaml:4:36: {LIGHT}.blackbody.kelvin: expected a number greater than 0, found 0\n\
                 dir/s.yaml:4:46: {LIGHT}.blackbody.scale: expected a number of 0 or more, found -1"
            )
        );
        assert_eq!(
            emission("{illuminant: {name: D65, scale: -3}}"),
            format!("dir/s.yaml:4:47: {LIGHT}.illuminant.scale: expected a number of 0 or more, found -3")
        );
        assert_eq!(
            emission("{scaled: {by: 1e30, of: {illuminant: {name: D65, scale: 1e9}}}}"),
            format!(
                "dir/s.yaml:4:71: {LIGHT}.scaled.of.illuminant.scale: expected a number from 0 to 3.4e38, found 1000000000 times 1e30"
            )
        );
        assert_eq!(
            emission("{lines: []}"),
            format!("dir/s.yaml:4:23: {LIGHT}.lines: expected at least one line, found none")
        );
        assert_eq!(
            emission("{lines: [{nm: -5, power: -1, width_nm: 0}]}"),
            format!(
                "dir/s.yaml:4:29: {LIGHT}.lines[0].nm: expected a number greater than 0, found -5\n\
                 dir/s.yaml:4:40: {LIGHT}.lines[0].power: expected a number of 0 or more, found -1\n\
                 dir/s.yaml:4:54: {LIGHT}.lines[0].width_nm: expected a number greater than 0, found 0"
            )
        );
        assert_eq!(
            emission("{scaled: {by: -2, of: 1}}"),
            format!("dir/s.yaml:4:29: {LIGHT}.scaled.by: expected a number of 0 or more, found -2")
        );
    }

    #[test]
    fn an_index_is_positive() {
        let expected = "expected an index of refraction, a number from 0.1 to 10";
        for n in ["0", "-1.5", "15", "0.05", "1e300"] {
            assert_eq!(index(n), format!("dir/s.yaml:4:23: {GLASS}: {expected}, found {n}"));
        }
        for n in ["0.1", "0.9", "10"] {
            assert_eq!(index(n), "none");
        }
        assert_eq!(
            index("{abbe: {nd: 0, vd: 0}}"),
            format!(
                "dir/s.yaml:4:35: {GLASS}.abbe.nd: {expected}, found 0\n\
                 dir/s.yaml:4:42: {GLASS}.abbe.vd: expected a number greater than 0, found 0"
            )
        );
        assert_eq!(index("{cauchy: [-1, 0]}"), format!("dir/s.yaml:4:33: {GLASS}.cauchy[0]: {expected}, found -1"));
        assert_eq!(
            index("{sellmeier: {b: [1, 1, 1], c: [0, 0, -1]}}"),
            format!("dir/s.yaml:4:60: {GLASS}.sellmeier.c[2]: expected a number of 0 or more, found -1")
        );
    }

    #[test]
    fn an_index_has_the_right_count_of_numbers() {
        assert_eq!(
            index("{sellmeier: {b: [1, 1], c: [0, 0, 0]}}"),
            format!("dir/s.yaml:4:39: {GLASS}.sellmeier.b: expected 3 values, found 2")
        );
        assert_eq!(
            index("{cauchy: [1.5]}"),
            format!("dir/s.yaml:4:32: {GLASS}.cauchy: expected 2 or 3 numbers, found 1")
        );
    }

    #[test]
    fn an_illuminant_may_be_only_a_name() {
        for (written, scale) in [("D65", 1.0), ("{name: D65}", 1.0), ("{name: D65, scale: 3}", 3.0)] {
            let scene = scene(&format!("lights:\n- constant: {{radiance: {{illuminant: {written}}}}}"));
            let Light::Constant(light) = &scene.lights[0] else { panic!("constant") };
            assert_eq!(light.radiance, Spectrum::Illuminant(Illuminant { name: "D65".to_owned(), scale }));
        }
    }

    #[test]
    fn indices_become_their_structs() {
        let read = |written: &str| {
            let scene = scene(&format!("materials: {{a: {{dielectric: {{ior: {written}}}}}}}"));
            let Material::Dielectric(glass) = &scene.materials["a"] else { panic!("dielectric") };
            glass.ior.clone()
        };
        assert_eq!(read("1.5"), Index::Number(1.5));
        assert_eq!(read("{cauchy: [1.5, 0.004]}"), Index::Cauchy(Cauchy { a: 1.5, b: 0.004, c: 0.0 }));
        assert_eq!(read("{cauchy: [1.5, 0.004, 1e-5]}"), Index::Cauchy(Cauchy { a: 1.5, b: 0.004, c: 1e-5 }));
        assert_eq!(read("{abbe: {nd: 1.5, vd: 30}}"), Index::Abbe(Abbe { nd: 1.5, vd: 30.0 }));
        assert_eq!(
            read("{sellmeier: {b: [1, 2, 3], c: [4, 5, 6]}}"),
            Index::Sellmeier(Sellmeier { b: [1.0, 2.0, 3.0], c: [4.0, 5.0, 6.0] })
        );
        assert_eq!(read("{table: [[400, 1.5], [700, 1.4]]}"), Index::Table(vec![[400.0, 1.5], [700.0, 1.4]]));
    }
}
