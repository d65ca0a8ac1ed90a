//! OpenEXR files of named channels, in one part or a part a layer, written atomically with reproducible bytes; any flat
//! file read back.
//!
//! Conventions: channels R, G, B, A in upper case, premultiplied; the display window is the frame and the data window
//! the crop; colour is declared twice, by `chromaticities` and by `colorInteropID` (OpenEXR 3.4). Text is UTF-8.
//!
//! The header is written here, attributes sorted by name, and pixels are compressed by the `exr` crate, whose own
//! writer puts custom attributes in hash order: the same picture would give other bytes in every run.
//!
//! Source: "OpenEXR File Layout", openexr.com (technical documentation), and its list of standard attributes.

mod chunks;
pub mod header;
mod pack;
pub mod part;
mod read;
mod write;

pub use chunks::rows_are_apart;
pub use read::{ExrFile, ExrPart, Samples, read_exr};
pub use write::{encode_exr, write_exr};

use crate::error::Result;
use crate::film::Window;
use crate::film::resolve::Image;
use crate::spectrum::ColourSpace;
use half::f16;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// How pixels are packed; without loss but for DWA.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Compression {
    /// Not at all.
    None,
    /// Deflate of single rows: quick to read by rows, as compositing does.
    #[default]
    Zips,
    /// Deflate of 16 rows.
    Zip,
    /// Wavelets and Huffman codes of 32 rows: good for noise.
    Piz,
    /// Cosines of 32 rows, which lose up to so much; light only.
    Dwaa(f32),
    /// The same of 256 rows.
    Dwab(f32),
}

impl Compression {
    /// Whether values are changed.
    #[must_use]
    pub fn loses(self) -> bool {
        matches!(self, Compression::Dwaa(_) | Compression::Dwab(_))
    }
}

/// How channels lie in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// In one part.
    #[default]
    Single,
    /// Each layer in one of its own, named like it, the picture itself in `rgba`.
    Multipart,
}

/// The samples of a channel, in raster order of the data window.
#[derive(Clone, Debug, PartialEq)]
pub enum ChannelData {
    /// 16-bit floats.
    F16(Vec<f16>),
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 32-bit counts or ids.
    U32(Vec<u32>),
}

impl ChannelData {
    /// How many samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            ChannelData::F16(samples) => samples.len(),
            ChannelData::F32(samples) => samples.len(),
            ChannelData::U32(samples) => samples.len(),
        }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// What the numbers of a colour file mean.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourEncoding {
    /// CIE 1931 x, y of red, green, blue and white.
    pub primaries: [[f64; 2]; 4],
    /// Name of the encoding in the Color Interop Forum's list, such as `lin_rec709_scene`; none if the list has none.
    pub interop_id: Option<String>,
}

impl ColourEncoding {
    /// Of numbers in `space`.
    #[must_use]
    pub fn of(space: ColourSpace) -> ColourEncoding {
        ColourEncoding { primaries: space.chromaticities(), interop_id: Some(space.interop_id().to_owned()) }
    }
}

/// When a frame is shown, as SMPTE ST 12-1 counts it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeCode {
    /// Below 24.
    pub hours: u32,
    /// Below 60.
    pub minutes: u32,
    /// Below 60.
    pub seconds: u32,
    /// Below 30: there is room for 39.
    pub frames: u32,
    /// Whether it is the second of two frames of this number, as above 30 a second.
    pub second: bool,
}

/// The value of a header attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// `string`, UTF-8.
    Text(String),
    /// `int`.
    Int(i32),
    /// `float`.
    Float(f32),
    /// `double`.
    Double(f64),
    /// `rational`: numerator and denominator.
    Rational(i32, u32),
    /// `v2f`.
    Vec2([f32; 2]),
    /// `timecode`; no frames are dropped.
    TimeCode(TimeCode),
    /// `m44f`, row by row for row vectors (v·M), as Imath holds it: `(matrix for column vectors).to_cols_array()`.
    Matrix4([f32; 16]),
}

/// A picture to be written, in scan lines.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrImage {
    /// Width and height of the frame: the display window.
    pub frame: [u32; 2],
    /// The pixels that the file holds: the data window.
    pub window: Window,
    /// Channels by name, in any order; `layer.R` belongs to a layer.
    pub channels: Vec<(String, ChannelData)>,
    /// What R, G and B mean; none for a file of data (`colorInteropID` is then `data`).
    pub colour: Option<ColourEncoding>,
    /// Further attributes by name: `owner`, `comments`, `software`, `capDate`, `worldToCamera`, `worldToNDC`, … and one's own.
    pub attributes: Vec<(String, Attribute)>,
    /// Channels that hold other things than light, by name: they are never packed with loss.
    pub data: BTreeSet<String>,
    /// How pixels are packed.
    pub compression: Compression,
    /// How channels lie in the file.
    pub layout: Layout,
}

impl ExrImage {
    /// Adds a channel of data.
    pub fn push_data(&mut self, name: String, samples: ChannelData) {
        self.data.insert(name.clone());
        self.channels.push((name, samples));
    }

    /// 128 bits of BLAKE3 over the channels as [`read_exr`] gives them, in the order of their names: what was damaged is known
    /// by it.
    ///
    /// # Errors
    /// What in the picture cannot be written.
    pub fn content_hash(&self) -> std::result::Result<String, String> {
        if self.compression.loses() {
            // What packing leaves is not what it was given.
            return Ok(read::decode(&encode_exr(self)?)?.content_hash());
        }
        // One at a time: there may be hundreds of them.
        let plane = |data: &ChannelData| -> Vec<u8> {
            let bytes = |x: f32| x.to_bits().to_le_bytes();
            match data {
                ChannelData::F16(samples) => samples.iter().flat_map(|x| bytes(x.to_f32())).collect(),
                ChannelData::F32(samples) => samples.iter().flat_map(|x| bytes(*x)).collect(),
                ChannelData::U32(samples) => samples.iter().flat_map(|x| bytes(*x as f32)).collect(),
            }
        };
        Ok(content_hash(self.channels.iter().map(|(name, data)| (name.as_str(), data)), plane))
    }
}

/// [`ExrImage::content_hash`] of channels whose samples are those `bytes`.
fn content_hash<'a, T: ?Sized + 'a>(
    channels: impl Iterator<Item = (&'a str, &'a T)>,
    bytes: impl Fn(&T) -> Vec<u8>,
) -> String {
    let mut channels: Vec<(&str, &T)> = channels.collect();
    channels.sort_by_key(|channel| channel.0);
    let mut hasher = blake3::Hasher::new();
    for (name, plane) in channels {
        hasher.update(name.as_bytes()).update(&[0]).update(&bytes(plane));
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

/// How many bits a beauty file spends on a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// 16-bit floats, where they can hold the picture.
    #[default]
    Half,
    /// 32-bit floats.
    Float,
}

/// What a pixel of a beauty file holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Base {
    /// R, G, B, A.
    #[default]
    Rgba,
    /// R, G, B.
    Rgb,
    /// X, Y, Z, A of a picture in XYZ.
    Xyza,
    /// X, Y, Z of a picture in XYZ.
    Xyz,
    /// Y and A of a picture in XYZ.
    LuminanceAlpha,
    /// Y of a picture in XYZ.
    Luminance,
    /// Nothing: layers only.
    Nothing,
}

impl Base {
    /// Whether the picture is to be resolved to XYZ.
    #[must_use]
    pub fn is_xyz(self) -> bool {
        match self {
            Base::Rgba | Base::Rgb | Base::Nothing => false,
            Base::Xyza | Base::Xyz | Base::LuminanceAlpha | Base::Luminance => true,
        }
    }

    /// Names of the colour channels and which planes they are.
    #[must_use]
    pub fn colours(self) -> &'static [(&'static str, usize)] {
        match self {
            Base::Rgba | Base::Rgb => &[("R", 0), ("G", 1), ("B", 2)],
            Base::Xyza | Base::Xyz => &[("X", 0), ("Y", 1), ("Z", 2)],
            Base::LuminanceAlpha | Base::Luminance => &[("Y", 1)],
            Base::Nothing => &[],
        }
    }

    fn has_alpha(self) -> bool {
        matches!(self, Base::Rgba | Base::Xyza | Base::LuminanceAlpha)
    }
}

/// A further channel of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerPlane {
    /// With the layer, `nn.X`.
    pub name: String,
    /// The samples.
    pub plane: Vec<f32>,
    /// What they are.
    pub kind: PlaneKind,
}

/// What a further channel is, for the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaneKind {
    /// Light in colours: its primaries are told.
    Colour,
    /// Light of a band: of no colour.
    Band,
    /// Data: 32-bit floats, whatever the precision of the file.
    Data,
}

/// What packing with loss changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loss {
    /// Root of the mean of squared changes.
    pub root_mean_square: f64,
    /// The largest change.
    pub most: f64,
    /// How many values are finite on one side only; they are in no other number.
    pub no_longer_finite: u64,
    /// Mean of the values' sizes.
    pub mean: f64,
}

/// What the file at `path` lost of the light of `image`.
///
/// # Errors
/// As [`read_exr`].
pub fn loss(path: &Path, image: &ExrImage) -> Result<Loss> {
    let file = read_exr(path)?;
    let (mut count, mut squares, mut most, mut sizes) = (0u64, 0.0, 0.0f64, 0.0);
    let mut no_longer_finite = 0;
    for (name, data) in image.channels.iter().filter(|(name, _)| !image.data.contains(name)) {
        let Some(found) = file.parts.iter().find_map(|part| part.channel(name)) else { continue };
        let written: Vec<f32> = match data {
            ChannelData::F16(samples) => samples.iter().map(|x| x.to_f32()).collect(),
            ChannelData::F32(samples) => samples.clone(),
            ChannelData::U32(_) => continue,
        };
        no_longer_finite += written.iter().zip(found).filter(|(a, b)| a.is_finite() != b.is_finite()).count() as u64;
        for (a, b) in written.iter().zip(found).filter(|(a, b)| a.is_finite() && b.is_finite()) {
            let change = f64::from(a - b).abs();
            (count, squares, most) = (count + 1, squares + change * change, most.max(change));
            sizes += f64::from(a.abs());
        }
    }
    let n = count.max(1) as f64;
    Ok(Loss { root_mean_square: (squares / n).sqrt(), most, no_longer_finite, mean: sizes / n })
}

/// Whether a beauty file says how noisy it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StandardError {
    /// Channels R, G, B, A only.
    #[default]
    Leave,
    /// And `stderr.R`, `stderr.G`, `stderr.B` in 32-bit floats: standard errors of the means, for `abbe compare`.
    Write,
}

/// The attribute that says how many times, at the most, the variance of the mean of all pixels is that of independent ones,
/// where light of one path falls into several or samples of all pixels share their wavelengths; a number.
pub const SHARED_ERRORS: &str = "abbe/sharedErrors";

/// The attribute that says that bands stand in place of colours, whatever they are called, and how many; a number.
pub const BANDS: &str = "abbe/bands";

/// The name of the channel with the standard errors of the channel `name`.
#[must_use]
pub fn stderr_name(name: &str) -> String {
    format!("stderr.{name}")
}

/// A beauty file, and why it is wider or packed otherwise than was asked for, if it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Beauty {
    /// What to write.
    pub exr: ExrImage,
    /// A sentence for the log and the report, if half or DWA was asked for and would have lost something.
    pub note: Option<String>,
}

/// The file of a resolved picture, with `layers`; `colour` is what R, G and B mean in it.
///
/// Half holds 11 significant bits between 2⁻¹⁴ and 65504. A picture with a finite value that would round to infinity,
/// or so dim that the step of subnormal halves (2⁻²⁴) exceeds half's own relative precision at the mean
/// (mean of |value| below 2⁻¹⁴), is written as float instead, and so is a layer of light by itself; the note says so.
/// Nothing is clamped.
///
/// DWA packs halves, also of floats, and keeps no infinity: a picture that half cannot hold, or that is not finite, is
/// packed as ZIPS instead, which loses nothing.
#[must_use]
pub fn beauty(
    image: &Image,
    base: Base,
    layers: Vec<LayerPlane>,
    colour: ColourEncoding,
    precision: Precision,
    error: StandardError,
    compression: Compression,
) -> Beauty {
    let colours: Vec<(&str, &Vec<f32>)> = base.colours().iter().map(|&(name, i)| (name, &image.rgb[i])).collect();
    let in_colours = base != Base::Nothing || layers.iter().any(|layer| layer.kind == PlaneKind::Colour);
    let of_colours: Vec<&Vec<f32>> = colours.iter().map(|(_, plane)| *plane).collect();
    let Packing { wide, wide_layers, compression, note } = packing(&of_colours, &layers, precision, compression);
    let data = |plane: &[f32], wide: bool| {
        if wide {
            ChannelData::F32(plane.to_vec())
        } else {
            ChannelData::F16(plane.iter().map(|&v| f16::from_f32(v)).collect())
        }
    };
    let mut channels: Vec<(String, ChannelData)> =
        colours.iter().map(|&(name, plane)| (name.to_string(), data(plane, wide))).collect();
    if base.has_alpha() {
        channels.push(("A".to_string(), data(&image.alpha, wide)));
    }
    let mut data_channels = BTreeSet::new();
    if error == StandardError::Write {
        for &(name, i) in base.colours() {
            let name = stderr_name(name);
            data_channels.insert(name.clone());
            channels.push((name, ChannelData::F32(image.standard_error[i].clone())));
        }
    }
    for layer in layers {
        let samples = match layer.kind {
            PlaneKind::Colour | PlaneKind::Band => {
                data(&layer.plane, wide || wide_layers.iter().any(|name| name == group(&layer.name)))
            }
            PlaneKind::Data => ChannelData::F32(layer.plane),
        };
        if layer.kind != PlaneKind::Colour {
            data_channels.insert(layer.name.clone());
        }
        channels.push((layer.name, samples));
    }
    let exr = ExrImage {
        frame: image.frame,
        window: image.window,
        channels,
        colour: in_colours.then_some(colour),
        attributes: Vec::new(),
        data: data_channels,
        compression,
        layout: Layout::Single,
    };
    Beauty { exr, note }
}

/// How the numbers of a file are kept.
struct Packing {
    /// Whether all light is 32-bit floats, and which layers of it are in any case.
    wide: bool,
    wide_layers: Vec<String>,
    compression: Compression,
    /// Why it is not as was asked for.
    note: Option<String>,
}

/// What the picture's own planes of `colours` and each layer of light allow by itself: a dim one may lie beside a bright one.
fn packing(colours: &[&Vec<f32>], layers: &[LayerPlane], precision: Precision, compression: Compression) -> Packing {
    let mut of_layers: BTreeMap<&str, Vec<&Vec<f32>>> = BTreeMap::new();
    for layer in layers.iter().filter(|layer| layer.kind != PlaneKind::Data) {
        of_layers.entry(group(&layer.name)).or_default().push(&layer.plane);
    }
    let (narrow, lossy) = (precision == Precision::Half, compression.loses());
    let lost = |planes: &[&Vec<f32>]| if narrow || lossy { half_loses(planes) } else { None };
    let colours_lost = lost(colours);
    let wide = !narrow || colours_lost.is_some();
    let layers_lost: Vec<(&str, String)> =
        of_layers.iter().filter_map(|(name, planes)| Some((*name, lost(planes)?))).collect();
    let beyond_half = colours_lost.or_else(|| {
        let told: Vec<String> = layers_lost.iter().map(|(name, why)| format!("layer {name}: {why}")).collect();
        (!told.is_empty()).then(|| told.join("; "))
    });
    let planes: Vec<&Vec<f32>> = colours.iter().chain(of_layers.values().flatten()).copied().collect();
    let beyond_dwa = if lossy { beyond_half.clone().or_else(|| not_finite(&planes)) } else { None };
    Packing {
        wide,
        wide_layers: layers_lost.iter().map(|(name, _)| (*name).to_owned()).collect(),
        compression: if beyond_dwa.is_some() { Compression::Zips } else { compression },
        note: match (beyond_half.filter(|_| narrow), beyond_dwa) {
            (Some(why), None) => Some(format!("{why}: written as 32-bit float")),
            (Some(why), Some(_)) => Some(format!("{why}: written as 32-bit float, packed as ZIPS in place of DWA")),
            (None, Some(why)) => Some(format!("{why}: packed as ZIPS in place of DWA")),
            (None, None) => None,
        },
    }
}

/// The layer of a channel: its name up to the last point.
fn group(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(layer, _)| layer)
}

/// Why 16-bit floats cannot hold the planes, if they cannot.
#[must_use]
pub fn half_loses(planes: &[&Vec<f32>]) -> Option<String> {
    let values = planes.iter().copied().flatten();
    let too_large = values.clone().filter(|v| v.is_finite() && f16::from_f32(**v).is_infinite()).count();
    if too_large > 0 {
        let peak = values.filter(|v| v.is_finite()).fold(0.0f32, |peak, v| peak.max(v.abs()));
        return Some(format!("{too_large} values exceed what half floats hold (65504; the peak is {peak:e})"));
    }
    let finite = values.filter(|v| v.is_finite() && **v != 0.0);
    let (count, sum) = finite.fold((0u64, 0.0f64), |(n, sum), v| (n + 1, sum + f64::from(v.abs())));
    let mean = sum / count.max(1) as f64;
    let smallest_normal = f64::from(f16::MIN_POSITIVE);
    (count > 0 && mean < smallest_normal)
        .then(|| format!("the mean value {mean:.1e} is below the normal range of half floats (6.1e-5)"))
}

/// How many values are infinite or no number, if any is.
fn not_finite(planes: &[&Vec<f32>]) -> Option<String> {
    let count = planes.iter().copied().flatten().filter(|v| !v.is_finite()).count();
    (count > 0).then(|| format!("{count} values are not finite"))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Rec. ITU-R BT.709-6, table 1: primaries and D65.
    pub fn rec709() -> ColourEncoding {
        ColourEncoding {
            primaries: [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]],
            interop_id: Some("lin_rec709_scene".to_string()),
        }
    }

    pub fn image(value: f32) -> Image {
        let plane = |k: f32| (0..6).map(|i| value * (1.0 + k * i as f32)).collect::<Vec<f32>>();
        Image {
            frame: [5, 4],
            window: Window { x: 1, y: 2, width: 3, height: 2 },
            rgb: [plane(0.0), plane(1.0), plane(-1.0)],
            alpha: vec![1.0; 6],
            standard_error: [plane(0.1), plane(0.2), plane(0.3)],
        }
    }

    fn precision_of(value: f32) -> (bool, Option<String>) {
        let b = beauty(
            &image(value),
            Base::Rgba,
            Vec::new(),
            rec709(),
            Precision::Half,
            StandardError::Leave,
            Compression::Zips,
        );
        (matches!(b.exr.channels[0].1, ChannelData::F16(_)), b.note)
    }

    #[test]
    fn a_picture_beyond_half_is_written_as_float_and_says_so() {
        assert_eq!(precision_of(1.0), (true, None));
        // 65504 · 6 in the green channel of the last pixel.
        let (half, note) = precision_of(65_504.0);
        assert!(!half && note.unwrap().contains("exceed what half floats hold"));
        // 65519 still rounds to 65504.
        assert!(half_loses(&[&vec![65_519.0]]).is_none());
        assert!(half_loses(&[&vec![65_520.0]]).is_some());
        // Infinity is infinity in half too.
        assert!(half_loses(&[&vec![f32::INFINITY, f32::NAN, 1.0]]).is_none());
    }

    #[test]
    fn a_very_dim_picture_is_written_as_float_and_says_so() {
        let (half, note) = precision_of(1e-6);
        assert!(!half && note.unwrap().contains("below the normal range"));
        assert_eq!(precision_of(0.0), (true, None));
    }

    /// DWA works in halves: 1e9 and infinity come back as 65504 at most or infinite, and 5e-9 as 0. Such pictures come back to the bit, and one
    /// that half holds is packed as asked for.
    #[test]
    fn dwa_packs_only_what_it_can_hold() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let dwa = Compression::Dwaa(45.0);
        for precision in [Precision::Half, Precision::Float] {
            for (value, why) in [
                (0.5, None),
                (1e9, Some("values exceed what half floats hold")),
                (5e-9, Some("below the normal range of half floats")),
                (f32::INFINITY, Some("values are not finite")),
            ] {
                let mut image = image(0.5);
                image.rgb[0].fill(value);
                image.rgb[1].fill(value);
                image.rgb[2].fill(value.max(0.0));
                let beauty = beauty(&image, Base::Rgb, Vec::new(), rec709(), precision, StandardError::Leave, dwa);
                let expected = if why.is_some() { Compression::Zips } else { dwa };
                assert_eq!(beauty.exr.compression, expected, "{value} {precision:?}");
                let said = beauty.note.as_deref().unwrap_or("");
                assert!(
                    why.map_or(said.is_empty(), |why| said.contains(why) && said.ends_with("in place of DWA")),
                    "{said}"
                );
                write_exr(&path, &beauty.exr).unwrap();
                let loss = loss(&path, &beauty.exr).unwrap();
                assert_eq!(loss.no_longer_finite, 0);
                assert!(why.is_none() || loss.most == 0.0, "{value} {precision:?}: {loss:?}");
            }
        }
    }

    /// Three values of six are infinite in the file and were not; of the others the largest is off by 1/2.
    #[test]
    fn a_value_that_became_infinite_is_lost() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let of = |values: [f32; 6]| {
            let mut exr = beauty(
                &image(0.5),
                Base::Rgb,
                Vec::new(),
                rec709(),
                Precision::Float,
                StandardError::Leave,
                Compression::Zips,
            )
            .exr;
            exr.channels = vec![("R".to_owned(), ChannelData::F32(values.to_vec()))];
            exr
        };
        let infinite = f32::INFINITY;
        write_exr(&path, &of([infinite, infinite, infinite, infinite, 1.0, 2.5])).unwrap();
        let found = loss(&path, &of([1.0, 2.0, f32::MAX, infinite, 1.0, 2.0])).unwrap();
        assert_eq!((found.no_longer_finite, found.most, found.mean), (3, 0.5, 1.5));
    }
}
