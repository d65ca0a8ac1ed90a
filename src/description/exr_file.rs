//! What an OpenEXR file is made of besides its channels, as it is written.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::decode::whole;
use super::fault::Checker;
use super::layer::Layer;
use super::output::{Channels, Colour, Compression, Output, Precision};
use super::path::At;
use super::scene::SceneDescription;
use crate::error::in_short;

/// How channels lie in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FileLayout {
    /// All in one part: what every reader knows.
    #[default]
    Single,
    /// Each layer in a part of its own, which is read without the others.
    Multipart,
}

/// The value of a header attribute of one's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HeaderValue {
    /// A number.
    Number(f64),
    /// Text.
    Text(String),
}

/// Header attributes by name.
pub type HeaderValues = BTreeMap<String, HeaderValue>;

/// `spectral: {bands: 16, from_nm: 400, to_nm: 700}`: a further file of bands of the spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpectralFile {
    /// How many, 1 to 512.
    #[serde(deserialize_with = "whole::<_, 1, 512>")]
    pub bands: u32,
    /// Lower end of the first, nm; default 400.
    #[serde(default = "from_nm")]
    pub from_nm: f64,
    /// Upper end of the last, nm; default 700.
    #[serde(default = "to_nm")]
    pub to_nm: f64,
}

fn from_nm() -> f64 {
    400.0
}

fn to_nm() -> f64 {
    700.0
}

/// The narrowest band of a spectral file, nm, as of spectral lines: wavelengths are rounded to some 6e-5 nm.
const LEAST_BAND_NM: f64 = 0.01;

/// What DWA compression is allowed to lose, by default: 45 is what its makers call visually lossless.
pub(crate) const DWA_LEVEL: f64 = 45.0;

/// Names that the renderer itself writes, or that say how a file is built.
const OWN: [&str; 23] = [
    "acesImageContainerFlag",
    "channels",
    "chromaticities",
    "chunkCount",
    "colorInteropID",
    "compression",
    "dataWindow",
    "displayWindow",
    "dwaCompressionLevel",
    "framesPerSecond",
    "imageCounter",
    "lineOrder",
    "maxSamplesPerPixel",
    "name",
    "pixelAspectRatio",
    "screenWindowCenter",
    "screenWindowWidth",
    "software",
    "tiles",
    "type",
    "version",
    "worldToCamera",
    "worldToNDC",
];

/// What a standard attribute of OpenEXR holds ("Standard Attributes", openexr.com).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standard {
    /// Text.
    Text,
    /// A 32-bit float.
    Float,
    /// A time code.
    TimeCode,
    /// What is neither text nor a number, such as a box or a rational.
    Other,
}

const TEXTS: [&str; 19] = [
    "ascFramingDecisionList",
    "cameraFirmwareVersion",
    "cameraLabel",
    "cameraMake",
    "cameraModel",
    "cameraSerialNumber",
    "cameraUuid",
    "capDate",
    "comments",
    "lensFirmwareVersion",
    "lensMake",
    "lensModel",
    "lensSerialNumber",
    "lookModTransform",
    "owner",
    "reelName",
    "renderingTransform",
    "view",
    "wrapmodes",
];

const FLOATS: [&str; 19] = [
    "altitude",
    "aperture",
    "cameraCCTSetting",
    "cameraTintSetting",
    "effectiveFocalLength",
    "entrancePupilOffset",
    "expTime",
    "focus",
    "isoSpeed",
    "latitude",
    "longitude",
    "nominalFocalLength",
    "pinholeFocalLength",
    "sensorPhotositePitch",
    "shutterAngle",
    "tStop",
    "utcOffset",
    "whiteLuminance",
    "xDensity",
];

const OTHERS: [&str; 13] = [
    "adoptedNeutral",
    "cameraColorBalance",
    "captureRate",
    "deepImageState",
    "envmap",
    "idManifest",
    "keyCode",
    "multiView",
    "originalDataWindow",
    "preview",
    "sensorAcquisitionRectangle",
    "sensorCenterOffset",
    "sensorOverallDimensions",
];

/// What the attribute `name` holds, if it is a standard one.
#[must_use]
pub fn standard(name: &str) -> Option<Standard> {
    match name {
        "timeCode" => Some(Standard::TimeCode),
        _ if TEXTS.contains(&name) => Some(Standard::Text),
        _ if FLOATS.contains(&name) => Some(Standard::Float),
        _ if OTHERS.contains(&name) => Some(Standard::Other),
        _ => None,
    }
}

impl SpectralFile {
    /// The ends of each band, nm.
    #[must_use]
    pub fn edges(&self) -> Vec<[f64; 2]> {
        let at = |i: u32| self.from_nm + (self.to_nm - self.from_nm) * f64::from(i) / f64::from(self.bands);
        (0..self.bands).map(|i| [at(i), at(i + 1)]).collect()
    }
}

/// Hours, minutes, seconds and frames of `01:02:03:04`.
#[must_use]
pub fn time_code(text: &str) -> Option<[u32; 4]> {
    let fields: Vec<u32> = text.split(':').map(|field| field.parse().ok()).collect::<Option<_>>()?;
    let [hours, minutes, seconds, frames] = fields[..] else { return None };
    (hours < 24 && minutes < 60 && seconds < 60 && frames < 60).then_some([hours, minutes, seconds, frames])
}

/// Frames a second as time codes count them: whole ones, and 30 where nobody says how many.
#[must_use]
pub fn counted_rate(frames_per_second: Option<f64>) -> u32 {
    frames_per_second.map_or(30, |rate| (rate.round() as u32).max(1))
}

/// What the file of `scene` may not have, beside what each field says of itself.
pub(crate) fn check_scene(scene: &SceneDescription, checker: &mut Checker<'_>) {
    let (output, layers) = (&scene.output, &scene.layers);
    let at = At::ROOT.key("output");
    let exr = at.key("exr");
    if let Some(HeaderValue::Text(text)) = output.exr.attributes.get("timeCode")
        && let Some([.., frames]) = time_code(text)
    {
        let rate = counted_rate(scene.render.frames_per_second);
        let told = if scene.render.frames_per_second.is_some() { "" } else { ", for want of render.frames_per_second" };
        let expected = format!("a time code of frames below {rate}{told}");
        let attributes = exr.key("attributes");
        checker.require(frames < rate, attributes.key("timeCode"), &expected, format_args!("{text:?}"));
    }
    if output.exr.compression.loses() && output.exr.layout == FileLayout::Single && layers.iter().any(Layer::is_data) {
        let expected = "no loss in layers of data, found dwa; layout: multipart keeps them apart";
        checker.fault(exr.key("compression"), format!("expected {expected}"));
    }
    if output.exr.aces_container {
        let at = exr.key("aces_container");
        checker.require(layers.is_empty(), at, "no layers", layers.len());
        let bands = scene.image.bands.len();
        checker.require(bands == 0, at, "no bands in the place of R, G and B", bands);
    }
    let xyz = matches!(output.exr.channels, Channels::Xyz | Channels::Xyza);
    if xyz && layers.iter().any(|layer| layer.name == "Z") {
        let at = exr.key("channels");
        checker.fault(at, format!("expected no channel Z of colour where Z is a layer, found {}", checker.written(at)));
    }
}

/// What a file may not have, beside what each field says of itself.
pub(crate) fn check(output: &Output, at: At<'_>, checker: &mut Checker<'_>) {
    let exr = &output.exr;
    let file = at.key("exr");
    let level = file.key("dwa_level");
    let most = f64::from(f32::MAX);
    checker.require((0.0..=most).contains(&exr.dwa_level), level, "a number from 0 to 3.4e38", exr.dwa_level);
    let lossy = exr.compression.loses();
    for (name, value) in &exr.attributes {
        let attributes = file.key("attributes");
        let at = attributes.key(name);
        let own = OWN.contains(&name.as_str()) || name.starts_with("abbe/") || name.starts_with("cryptomatte/");
        checker.require(!own, at, "a name that the renderer does not give itself", format_args!("{name:?}"));
        checker.require((1..256).contains(&name.len()), at, "a name of 1 to 255 bytes", name.len());
        checker.require(!name.contains('\0'), at, "a name without a zero byte", format_args!("{name:?}"));
        let (expected, fits) = match (standard(name), value) {
            (None, _) => continue,
            (Some(Standard::Text), value) => ("text", matches!(value, HeaderValue::Text(_))),
            (Some(Standard::Float), HeaderValue::Number(number)) => {
                ("a number that a 32-bit float holds", number.abs() <= f64::from(f32::MAX))
            }
            (Some(Standard::Float), HeaderValue::Text(_)) => ("a number", false),
            (Some(Standard::TimeCode), value) => {
                let fits = matches!(value, HeaderValue::Text(text) if time_code(text).is_some());
                ("a time code, as \"01:02:03:04\"", fits)
            }
            (Some(Standard::Other), _) => {
                ("an attribute of text or of a number, which this one of OpenEXR is not", false)
            }
        };
        checker.require(fits, at, expected, checker.written(at));
    }
    if exr.aces_container {
        let holds = output.colour == Colour::Aces2065
            && exr.precision == Precision::Half
            && exr.compression == Compression::None
            && exr.layout == FileLayout::Single
            && matches!(exr.channels, Channels::Rgba | Channels::Rgb)
            && !exr.stderr;
        checker.require(
            holds,
            file.key("aces_container"),
            "colour aces2065-1, precision half, compression none, channels rgb or rgba, one part and no stderr \
             (SMPTE ST 2065-4)",
            "others",
        );
    }
    if lossy && exr.stderr && exr.layout == FileLayout::Single {
        checker.fault(
            file.key("compression"),
            "expected no loss in stderr, found dwa; layout: multipart keeps data apart",
        );
    }
    if let Some(spectral) = &output.spectral {
        let at = at.key("spectral");
        checker.whole_between(at.key("bands"), spectral.bands, 1, 512);
        let inside = spectral.from_nm >= 360.0 && spectral.to_nm <= 830.0 && spectral.from_nm < spectral.to_nm;
        let found = format_args!("{} to {}", in_short(spectral.from_nm), in_short(spectral.to_nm));
        let at_fault = at.key(if spectral.from_nm < 360.0 { "from_nm" } else { "to_nm" });
        checker.require(inside, at_fault, "a range within 360 to 830 nm", found);
        let width = (spectral.to_nm - spectral.from_nm) / f64::from(spectral.bands.max(1));
        // What the ends are rounded by is no fault.
        let wide = !inside || width > LEAST_BAND_NM - 1e-9;
        checker.require(wide, at, "bands at least 0.01 nm wide", format_args!("{} nm", in_short(width)));
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    #[test]
    fn time_codes_have_four_fields() {
        assert_eq!(time_code("01:02:03:04"), Some([1, 2, 3, 4]));
        assert_eq!(["1:2:3", "25:00:00:00", "00:00:00:x", "00:60:00:00"].map(time_code), [None; 4]);
    }

    #[test]
    fn bands_share_the_range_evenly() {
        let file = scene("output: {spectral: {bands: 3}}").output.spectral.unwrap();
        assert_eq!(file.edges(), [[400.0, 500.0], [500.0, 600.0], [600.0, 700.0]]);
        assert_eq!(
            faults("output: {spectral: {bands: 0, from_nm: 300}}"),
            "dir/s.yaml:2:28: output.spectral.bands: expected a whole number from 1 to 512, found 0\n\
             dir/s.yaml:2:40: output.spectral.from_nm: expected a range within 360 to 830 nm, found 300 to 700"
        );
        assert_eq!(
            faults("output: {spectral: {bands: 4, to_nm: 900}}"),
            "dir/s.yaml:2:38: output.spectral.to_nm: expected a range within 360 to 830 nm, found 400 to 900"
        );
    }

    /// 512 of 10⁻⁷ nm have fewer names than bands: (400.0000001 - 400) / 512 = 1.953e-10, to the rounding of 400.0000001.
    #[test]
    fn bands_are_wider_than_wavelengths_are_rounded() {
        let told = faults("output: {spectral: {bands: 512, from_nm: 400, to_nm: 400.0000001}}");
        assert!(told.starts_with("dir/s.yaml:2:20: output.spectral: expected bands at least 0.01 nm wide, found 1.95"));
        scene("output: {spectral: {bands: 10, from_nm: 500.1, to_nm: 500.2}}");
    }

    #[test]
    fn attributes_have_the_types_of_the_format() {
        assert_eq!(
            faults("output: {exr: {attributes: {compression: 3, timeCode: 7, expTime: long, shot: '010'}}}"),
            "dir/s.yaml:2:42: output.exr.attributes.compression: expected a name that the renderer does not give itself, \
             found \"compression\"\n\
             dir/s.yaml:2:55: output.exr.attributes.timeCode: expected a time code, as \"01:02:03:04\", found 7\n\
             dir/s.yaml:2:67: output.exr.attributes.expTime: expected a number, found the text \"long\""
        );
        assert_eq!(
            faults("output: {exr: {attributes: {timeCode: '01:02:60:00'}}}"),
            "dir/s.yaml:2:39: output.exr.attributes.timeCode: expected a time code, as \"01:02:03:04\", found the text \
             \"01:02:60:00\""
        );
        // The standard says of which type an attribute is, and a 32-bit float must hold what one is to hold.
        for (value, expected) in [
            ("owner: 3", "owner: expected text, found 3"),
            ("capDate: 2026", "capDate: expected text, found 2026"),
            ("wrapmodes: 1", "wrapmodes: expected text, found 1"),
            ("aperture: f/2", "aperture: expected a number, found the text \"f/2\""),
            ("focus: far", "focus: expected a number, found the text \"far\""),
            ("xDensity: a", "xDensity: expected a number, found the text \"a\""),
            ("altitude: 1e39", "altitude: expected a number that a 32-bit float holds, found 1e39"),
            (
                "keyCode: 7",
                "keyCode: expected an attribute of text or of a number, which this one of OpenEXR is not, found 7",
            ),
            (
                "acesImageContainerFlag: 1",
                "acesImageContainerFlag: expected a name that the renderer does not give itself, found \
                 \"acesImageContainerFlag\"",
            ),
        ] {
            let found = faults(&format!("output: {{exr: {{attributes: {{{value}}}}}}}"));
            assert_eq!(found.split_once("attributes.").map(|(_, told)| told), Some(expected));
        }
        assert_eq!(
            faults("output: {exr: {attributes: {shot: [1, 2]}}}"),
            "dir/s.yaml:2:35: output.exr.attributes.shot: expected one of a number, text, found a list of 2"
        );
        scene("output: {exr: {attributes: {shot: 123456789, big: 1e300, owner: '3', focus: 2, xDensity: 72}}}");
    }

    /// A second has as many frames as the rate says; without one, 30.
    #[test]
    fn frames_of_a_time_code_are_below_the_rate() {
        let told = |rate: &str, frames: &str| {
            let attributes = format!("{{timeCode: '01:00:00:{frames}'}}");
            format!("render: {{{rate}}}\noutput: {{exr: {{attributes: {attributes}}}}}\n")
        };
        let refused = |rate: &str, frames: &str| {
            let found = faults(&told(rate, frames));
            found.split_once("timeCode: ").map(|(_, told)| told.to_owned()).unwrap()
        };
        assert_eq!(
            refused("frames_per_second: 24", "40"),
            "expected a time code of frames below 24, found \"01:00:00:40\""
        );
        assert_eq!(
            refused("", "40"),
            "expected a time code of frames below 30, for want of render.frames_per_second, found \"01:00:00:40\""
        );
        refused("frames_per_second: 29.97", "30");
        for (rate, frames) in [("frames_per_second: 23.976", "23"), ("", "29"), ("frames_per_second: 59.94", "59")] {
            scene(&told(rate, frames));
        }
    }

    #[test]
    fn dwa_loses_what_a_header_can_hold() {
        assert_eq!(
            faults("output: {exr: {dwa_level: 1e39}}"),
            "dir/s.yaml:2:27: output.exr.dwa_level: expected a number from 0 to 3.4e38, found 1e39"
        );
    }

    #[test]
    fn depth_has_no_place_beside_the_z_of_a_colour() {
        for channels in ["xyz", "xyza"] {
            assert_eq!(
                faults(&format!("layers: [Z]\noutput: {{exr: {{channels: {channels}}}}}\n")),
                format!(
                    "dir/s.yaml:3:26: output.exr.channels: expected no channel Z of colour where Z is a layer, found the text \
                     \"{channels}\""
                )
            );
        }
    }

    #[test]
    fn an_aces_container_holds_nothing_else() {
        let found = faults("output: {exr: {aces_container: true}}");
        assert!(
            found.starts_with("dir/s.yaml:2:32: output.exr.aces_container: expected colour aces2065-1,"),
            "{found}"
        );
        let aces = "output: {colour: aces2065-1, exr: {aces_container: true, compression: none}}";
        scene(aces);
        assert_eq!(
            faults(&format!("{aces}\nimage: {{bands: [{{name: R, response: 1}}]}}\n")),
            "dir/s.yaml:2:52: output.exr.aces_container: expected no bands in the place of R, G and B, found 1"
        );
    }
}
