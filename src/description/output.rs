//! Which files are written, and how, as it is written.

use std::path::PathBuf;

use serde::{Deserialize, Deserializer, Serialize};

use super::decode::Whole;
use super::exr_file::{self, DWA_LEVEL, FileLayout, HeaderValues, SpectralFile};
use super::fault::Checker;
use super::path::At;
use super::settings::yes;
use crate::error::in_short;
use crate::spectrum::illuminant;
use crate::spectrum::observer::tristimulus;

/// `output: {dir: out, colour: rec709}`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Directory, relative to the working directory; default `out`.
    #[serde(default = "dir")]
    pub dir: PathBuf,
    /// The OpenEXR file.
    #[serde(default)]
    pub exr: Exr,
    /// The PNG file.
    #[serde(default)]
    pub png: Png,
    /// Colour space of the OpenEXR file; default `rec709`.
    #[serde(default)]
    pub colour: Colour,
    /// A further file of bands of the spectrum; default none.
    pub spectral: Option<SpectralFile>,
    /// Whether the picture is on the contact sheet of its batch; default true.
    #[serde(default = "yes")]
    pub contact_sheet: bool,
}

fn dir() -> PathBuf {
    PathBuf::from("out")
}

impl Default for Output {
    fn default() -> Output {
        Output {
            dir: dir(),
            exr: Exr::default(),
            png: Png::default(),
            colour: Colour::default(),
            spectral: None,
            contact_sheet: true,
        }
    }
}

/// `exr: {precision: half, compression: zips}`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exr {
    /// Of the colour channels; default `half`.
    #[serde(default)]
    pub precision: Precision,
    /// Default `zips`.
    #[serde(default)]
    pub compression: Compression,
    /// Also write the standard error of each pixel, `stderr.R`, `stderr.G`, `stderr.B`; default false. Of bands, too:
    /// `stderr.NAME`, and `stderr.S0.…nm` in the spectral file.
    #[serde(default)]
    pub stderr: bool,
    /// What a pixel holds; default `rgba`.
    #[serde(default)]
    pub channels: Channels,
    /// Default `single`.
    #[serde(default)]
    pub layout: FileLayout,
    /// What DWA compression may lose, from 0; default 45.
    #[serde(default = "dwa_level")]
    pub dwa_level: f64,
    /// Further attributes of the header; default none.
    #[serde(default)]
    pub attributes: HeaderValues,
    /// Whether the file is an ACES container (SMPTE ST 2065-4); default false.
    #[serde(default)]
    pub aces_container: bool,
}

fn dwa_level() -> f64 {
    DWA_LEVEL
}

impl Default for Exr {
    fn default() -> Exr {
        Exr {
            precision: Precision::default(),
            compression: Compression::default(),
            stderr: false,
            channels: Channels::default(),
            layout: FileLayout::default(),
            dwa_level: DWA_LEVEL,
            attributes: HeaderValues::default(),
            aces_container: false,
        }
    }
}

/// What a pixel of the OpenEXR file holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channels {
    /// R, G, B and coverage A.
    #[default]
    Rgba,
    /// R, G, B.
    Rgb,
    /// CIE X, Y, Z and A.
    Xyza,
    /// CIE X, Y, Z.
    Xyz,
    /// Luminance Y and A.
    LuminanceAlpha,
    /// Luminance Y.
    Luminance,
}

/// Number format of the colour channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// 16 bits.
    #[default]
    Half,
    /// 32 bits.
    Float,
}

/// Compression of an OpenEXR file; all but `dwaa` and `dwab` are lossless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// None.
    None,
    /// Deflate, each line alone.
    #[default]
    Zips,
    /// Deflate, sixteen lines together.
    Zip,
    /// Wavelets.
    Piz,
    /// Cosines, 32 lines together: loses up to `dwa_level`, of colour alone.
    Dwaa,
    /// The same, 256 lines together.
    Dwab,
}

impl Compression {
    /// Whether values are changed.
    #[must_use]
    pub fn loses(self) -> bool {
        matches!(self, Compression::Dwaa | Compression::Dwab)
    }
}

/// `png: {exposure: 0, tonemap: aces}`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Png {
    /// Default 0 stops.
    #[serde(default)]
    pub exposure: Exposure,
    /// Default `aces`.
    #[serde(default)]
    pub tonemap: Tonemap,
    /// Which light is to look white; default none: D65, the white of the display.
    #[serde(default)]
    pub white_balance: WhiteBalance,
    /// The display; default `srgb`.
    #[serde(default)]
    pub space: PngSpace,
    /// Of a channel, 8 or 16; default 8.
    #[serde(default = "eight", deserialize_with = "bits")]
    pub bits: u32,
    /// Default `hash`.
    #[serde(default)]
    pub dither: PngDither,
}

fn eight() -> u32 {
    8
}

fn bits<'de, D: Deserializer<'de>>(de: D) -> std::result::Result<u32, D::Error> {
    de.deserialize_u32(Whole("8 or 16".to_owned()))
}

impl Default for Png {
    fn default() -> Png {
        Png {
            exposure: Exposure::default(),
            tonemap: Tonemap::default(),
            white_balance: WhiteBalance::default(),
            space: PngSpace::default(),
            bits: eight(),
            dither: PngDither::default(),
        }
    }
}

/// How bright a picture is shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Exposure {
    /// Stops.
    Number(f64),
    /// By the picture itself.
    Auto,
}

impl Default for Exposure {
    fn default() -> Exposure {
        Exposure::Number(0.0)
    }
}

/// The light that is shown white.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WhiteBalance {
    /// D65: nothing changes.
    #[default]
    None,
    /// That of the scene's lights together.
    Auto,
    /// A black body of so many kelvins.
    Number(f64),
    /// CIE 1931 x, y.
    List([f64; 2]),
    /// `{illuminant: A}`: a CIE illuminant.
    Illuminant(String),
}

impl WhiteBalance {
    /// The chromaticity of that light, where it is not the scene's to say.
    ///
    /// # Errors
    /// Why there is no such light.
    pub fn chromaticity(&self) -> std::result::Result<Option<[f64; 2]>, String> {
        let of = |spectrum: &crate::spectrum::Spectrum| {
            let [x, y, z] = tristimulus(spectrum);
            [x / (x + y + z), y / (x + y + z)]
        };
        Ok(match self {
            WhiteBalance::None | WhiteBalance::Auto => None,
            WhiteBalance::Number(kelvin) => Some(of(&illuminant::blackbody_normalised(*kelvin)?)),
            WhiteBalance::List(xy) => Some(*xy),
            WhiteBalance::Illuminant(name) => Some(of(&illuminant::illuminant(name)?)),
        })
    }

    fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        match self {
            WhiteBalance::Number(kelvin) => {
                let expected = "a temperature from 1000 to 40000 K";
                checker.require((1000.0..=40_000.0).contains(kelvin), at, expected, *kelvin);
            }
            WhiteBalance::List([x, y]) => {
                let expected = "the chromaticity x, y of a light that can be made white";
                let white = crate::spectrum::colour::adapted_to_d65([*x, *y]).is_some();
                checker.require(white, at, expected, format_args!("[{}, {}]", in_short(*x), in_short(*y)));
            }
            WhiteBalance::Illuminant(name) => {
                if let Err(message) = illuminant::illuminant(name) {
                    checker.fault(at.key("illuminant"), message);
                }
            }
            WhiteBalance::None | WhiteBalance::Auto => {}
        }
    }
}

/// The display that a PNG is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PngSpace {
    /// sRGB.
    #[default]
    Srgb,
    /// Display P3.
    #[serde(rename = "display_p3")]
    DisplayP3,
}

/// How a value between two levels of a PNG is placed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PngDither {
    /// To the nearest.
    None,
    /// By a regular pattern.
    Ordered,
    /// By a noise that is the same in every picture.
    #[default]
    Hash,
}

/// How radiance becomes display values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tonemap {
    /// The ACES curve.
    #[default]
    Aces,
    /// AgX.
    Agx,
    /// Reinhard's.
    Reinhard,
    /// Cut at 1.
    None,
}

/// Colour space of the OpenEXR file; all are linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Colour {
    /// `rec709`
    #[default]
    #[serde(rename = "rec709")]
    Rec709,
    /// `acescg`
    #[serde(rename = "acescg")]
    AcesCg,
    /// `aces2065-1`
    #[serde(rename = "aces2065-1")]
    Aces2065,
    /// `rec2020`
    #[serde(rename = "rec2020")]
    Rec2020,
    /// `p3`
    #[serde(rename = "p3")]
    P3,
    /// `xyz`: CIE 1931.
    #[serde(rename = "xyz")]
    Xyz,
}

impl Output {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        let named = !self.dir.as_os_str().is_empty();
        checker.require(named, at.key("dir"), "the path of a directory", "empty text");
        let ends = self.dir.as_os_str().as_encoded_bytes().contains(&0);
        checker.require(!ends, at.key("dir"), "the path of a directory", "one with a NUL character");
        exr_file::check(self, at, checker);
        let png = at.key("png");
        if let Exposure::Number(stops) = self.png.exposure {
            let expected = "a number of stops from -64 to 64, or auto";
            checker.require(stops.abs() <= 64.0, png.key("exposure"), expected, stops);
        }
        let bits = self.png.bits;
        checker.require(bits == 8 || bits == 16, png.key("bits"), "8 or 16", bits);
        self.png.white_balance.check(png.key("white_balance"), checker);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    #[test]
    fn defaults_are_those_of_the_page() {
        let scene = scene("");
        assert_eq!(scene.output.dir, PathBuf::from("out"));
        assert_eq!(
            scene.output.exr,
            Exr { precision: Precision::Half, compression: Compression::Zips, ..Exr::default() }
        );
        assert_eq!(
            scene.output.png,
            Png {
                exposure: Exposure::Number(0.0),
                tonemap: Tonemap::Aces,
                white_balance: WhiteBalance::None,
                space: PngSpace::Srgb,
                bits: 8,
                dither: PngDither::Hash
            }
        );
        assert_eq!(scene.output.colour, Colour::Rec709);
    }

    #[test]
    fn the_directory_of_the_output_has_a_name() {
        assert_eq!(
            faults("output: {dir: ''}"),
            "dir/s.yaml:2:15: output.dir: expected the path of a directory, found empty text"
        );
        assert_eq!(
            faults("output: {dir: \"a\\0b\"}"),
            "dir/s.yaml:2:15: output.dir: expected the path of a directory, found one with a NUL character"
        );
    }

    #[test]
    fn the_png_is_developed_as_it_is_written() {
        let png = |text: &str| scene(&format!("output: {{png: {{{text}}}}}")).output.png;
        assert_eq!(png("exposure: auto").exposure, Exposure::Auto);
        let all = [
            ("none", WhiteBalance::None, None),
            ("auto", WhiteBalance::Auto, None),
            ("[0.4, 0.41]", WhiteBalance::List([0.4, 0.41]), Some([0.4, 0.41])),
            ("{illuminant: A}", WhiteBalance::Illuminant("A".into()), Some([0.44758, 0.40745])),
            // Illuminant A is a black body of 2848 K in today's constants: c₂ was 1.435e-2 m·K.
            ("2855.5", WhiteBalance::Number(2855.5), Some([0.44758, 0.40745])),
        ];
        for (text, expected, white) in all {
            let found = png(&format!("white_balance: {text}")).white_balance;
            let chromaticity = found.chromaticity().unwrap();
            assert_eq!((found, chromaticity.is_some()), (expected, white.is_some()));
            for (a, b) in chromaticity.into_iter().flatten().zip(white.into_iter().flatten()) {
                assert!((a - b).abs() < 1e-4, "{text}: {a} {b}");
            }
        }
        assert_eq!(
            faults("output: {png: {exposure: 65, bits: 12, white_balance: 500}}"),
            "dir/s.yaml:2:26: output.png.exposure: expected a number of stops from -64 to 64, or auto, found 65\n\
             dir/s.yaml:2:36: output.png.bits: expected 8 or 16, found 12\n\
             dir/s.yaml:2:55: output.png.white_balance: expected a temperature from 1000 to 40000 K, found 500"
        );
        // Low-pressure sodium.
        assert_eq!(
            faults("output: {png: {white_balance: [0.569, 0.43]}}"),
            "dir/s.yaml:2:31: output.png.white_balance: expected the chromaticity x, y of a light that can be made white, \
             found [0.569, 0.43]"
        );
        let unknown = faults("output: {png: {white_balance: {illuminant: D66}}}");
        assert!(unknown.contains("output.png.white_balance.illuminant: ") && unknown.contains("\"D65\""), "{unknown}");
        let unknown = faults("output: {png: {exposure: metered}}");
        assert_eq!(unknown, "dir/s.yaml:2:26: output.png.exposure: expected one of a number, auto, found \"metered\"");
    }

    #[test]
    fn colour_spaces_go_by_their_names() {
        let all = [
            ("rec709", Colour::Rec709),
            ("acescg", Colour::AcesCg),
            ("aces2065-1", Colour::Aces2065),
            ("rec2020", Colour::Rec2020),
            ("p3", Colour::P3),
            ("xyz", Colour::Xyz),
        ];
        for (name, colour) in all {
            assert_eq!(scene(&format!("output: {{colour: {name}}}")).output.colour, colour);
        }
        assert_eq!(
            faults("output: {colour: rec708}"),
            "dir/s.yaml:2:18: output.colour: expected one of rec709, acescg, aces2065-1, rec2020, p3, xyz, \
             found \"rec708\"; did you mean \"rec709\"?"
        );
    }
}
