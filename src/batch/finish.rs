//! From sums to files: what a picture's files need besides its sums, and the writing of them.
//!
//! A part carries its [`Finish`], so that `abbe merge` needs no scene, and writes what the one process would have written.

use super::adaptive;
use super::frame::{self, Frame};
use super::report::{Developed, SceneReport};
use super::{Prepared, colour_space, develop, window};
use crate::description::{self, Output};
use crate::error::Result;
use crate::film::Window;
use crate::film::exr::{self, Attribute, ColourEncoding, LayerPlane};
use crate::film::png::{self, PngSettings};
use crate::film::resolve::Image;
use crate::spectrum::ColourSpace;
use crate::transport::layers::Channel;
use crate::transport::plan::{Effect, Integrator};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What the files of a picture need besides its sums.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finish {
    /// Name of the scene.
    pub name: String,
    /// Which frame of it, where it has frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_number: Option<i32>,
    /// Frames a second, where it is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames_per_second: Option<f64>,
    /// Width and height of the frame in pixels.
    pub frame: [u32; 2],
    /// The pixels of the picture.
    pub window: Window,
    /// Samples of a pixel.
    pub samples: u32,
    /// Where samples are shared out by noise, how many all pixels have before; `samples` is then their mean.
    pub adaptive: Option<u32>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Hash of the description and of the files it names.
    pub scene_hash: String,
    /// What computes the light.
    pub integrator: String,
    /// What is simulated.
    pub effects: Vec<Effect>,
    /// How.
    pub techniques: Vec<Effect>,
    /// From which wavelengths samples are drawn.
    pub wavelengths: String,
    /// What a person should know of the scene.
    pub notes: Vec<String>,
    /// The camera's place and view, as the header of an EXR file has them.
    pub world_to_camera: [f32; 16],
    /// And to the frame.
    pub world_to_ndc: [f32; 16],
    /// Files, colours and tone curve.
    pub output: Output,
    /// The chromaticity that is shown white.
    pub white: Option<[f64; 2]>,
    /// Factor on colours.
    pub sensitivity: f64,
    /// Whether bands of the spectrum stand in place of colour.
    pub bands: bool,
    /// Further channels.
    pub layers: Vec<Channel>,
}

impl Finish {
    /// What the files of `prepared` need.
    #[must_use]
    pub fn of(prepared: &Prepared) -> Finish {
        let Prepared { description, scene, plan, samples, hash, .. } = prepared;
        let (white, note) = develop::white(&description.output.png, scene);
        Finish {
            name: scene.name.clone(),
            frame_number: description.frame,
            frames_per_second: description.render.frames_per_second,
            frame: scene.camera.resolution,
            window: window(description),
            samples: *samples,
            adaptive: plan.adaptive,
            seed: description.render.seed,
            scene_hash: hash.clone(),
            integrator: integrator(&plan.integrator).to_owned(),
            effects: plan.effects.clone(),
            techniques: plan.techniques.clone(),
            wavelengths: scene.wavelengths.describe().to_owned(),
            notes: scene.notes.iter().cloned().chain(note).collect(),
            world_to_camera: scene.camera.camera_from_world(),
            world_to_ndc: scene.camera.ndc_from_world(),
            // Where the files go is no matter of what is in them.
            output: Output { dir: PathBuf::new(), ..description.output.clone() },
            white,
            sensitivity: description.image.sensitivity,
            bands: !description.image.bands.is_empty(),
            layers: plan.layers.channels(),
        }
    }

    /// Rows of the frame that no part cuts.
    #[must_use]
    pub fn rows(&self) -> u32 {
        if self.adaptive.is_some() { adaptive::SIDE } else { 1 }
    }

    /// What a pixel of the file holds: bands replace colour.
    fn base(&self) -> exr::Base {
        if self.bands {
            return exr::Base::Nothing;
        }
        match self.output.exr.channels {
            description::Channels::Rgba => exr::Base::Rgba,
            description::Channels::Rgb => exr::Base::Rgb,
            description::Channels::Xyza => exr::Base::Xyza,
            description::Channels::Xyz => exr::Base::Xyz,
            description::Channels::LuminanceAlpha => exr::Base::LuminanceAlpha,
            description::Channels::Luminance => exr::Base::Luminance,
        }
    }

    /// The colour space of the file.
    fn space(&self) -> ColourSpace {
        if self.base().is_xyz() { ColourSpace::Xyz } else { colour_space(self.output.colour) }
    }

    /// From XYZ to the colours of the file.
    #[must_use]
    pub fn rgb_from_xyz(&self) -> [[f64; 3]; 3] {
        self.space().matrix_from_xyz().map(|row| row.map(|x| x * self.sensitivity))
    }

    /// How the PNG of `image` is developed, whose colours are those of the file.
    #[must_use]
    pub fn png_settings(&self, image: &Image) -> PngSettings {
        develop::settings(&self.output.png, self.white, image, self.space())
    }
}

/// The name of an integrator.
#[must_use]
pub fn integrator(integrator: &Integrator) -> &'static str {
    match integrator {
        Integrator::Path(_) => "path",
        Integrator::Whitted(_) => "whitted",
        Integrator::Depth => "depth",
        Integrator::Light(_) => "light_tracer",
        Integrator::Nothing => "none",
    }
}

/// Writes the EXR at `exr_path` and the PNG beside it, and notes them in the report, which has measured the frame.
///
/// # Errors
/// [`Error::Output`](crate::error::Error::Output) where a file cannot be written, [`Error::Render`](crate::error::Error::Render)
/// for invalid samples; the files are then written all the same.
pub fn write(finish: &Finish, frame: &Frame, exr_path: &Path, report: &mut SceneReport) -> Result<()> {
    let image = frame.resolve(&finish.rgb_from_xyz());
    report.pixel_hash = pixel_hash(&image);
    let written = Instant::now();
    let png_path = exr_path.with_extension("png");
    let settings = finish.png_settings(&image);
    report.png = Some(Developed {
        exposure_stops: settings.exposure_stops,
        metered: finish.output.png.exposure == description::Exposure::Auto,
        white: finish.white,
    });
    // Packed together but written one after the other: where the first cannot be written, nothing of the picture is left.
    let (written_exr, png) =
        rayon::join(|| write_exr(exr_path, finish, frame, &image, report), || png::encode_png(&image, &settings));
    written_exr?;
    png::write_encoded(&png_path, png)?;
    report.files = vec![exr_path.to_path_buf(), png_path];
    report.seconds.writing = written.elapsed().as_secs_f64();

    let (counted, dropped) = frame.film.samples();
    let samples = counted + dropped;
    frame::check_invalid(&frame.invalid(), samples)
}

fn write_exr(path: &Path, finish: &Finish, frame: &Frame, image: &Image, report: &mut SceneReport) -> Result<()> {
    let (output, space) = (&finish.output, finish.space());
    let colour = ColourEncoding { primaries: space.chromaticities(), interop_id: Some(space.interop_id().to_owned()) };
    let precision = match output.exr.precision {
        description::Precision::Half => exr::Precision::Half,
        description::Precision::Float => exr::Precision::Float,
    };
    let compression = match output.exr.compression {
        description::Compression::None => exr::Compression::None,
        description::Compression::Zips => exr::Compression::Zips,
        description::Compression::Zip => exr::Compression::Zip,
        description::Compression::Piz => exr::Compression::Piz,
    };
    let error = if output.exr.stderr { exr::StandardError::Write } else { exr::StandardError::Leave };
    let layer = |(i, channel): (usize, &Channel)| LayerPlane {
        name: channel.name.clone(),
        plane: frame.layer(i),
        light: channel.light,
    };
    let layers = finish.layers.iter().enumerate().map(layer).collect();
    let mut beauty = exr::beauty(image, finish.base(), layers, colour, precision, error, compression);
    if frame.film.layers.invalid.total() > 0 {
        report.notes.push(format!("{} samples of layers could not be added", frame.film.layers.invalid.total()));
    }
    report.notes.extend(beauty.note.take());
    beauty.exr.attributes = attributes(finish, frame, report);
    let hash = Attribute::Text(beauty.exr.content_hash());
    beauty.exr.attributes.push(("abbe/contentHash".to_owned(), hash));
    exr::write_exr(path, &beauty.exr)
}

/// The header of a picture: what is needed to make it again, and how good it is.
fn attributes(finish: &Finish, frame: &Frame, report: &SceneReport) -> Vec<(String, Attribute)> {
    let text = |s: &str| Attribute::Text(s.to_owned());
    let mut all = vec![
        ("software".to_owned(), text(concat!("Abbe ", env!("CARGO_PKG_VERSION")))),
        ("comments".to_owned(), text(&finish.name)),
        ("worldToCamera".to_owned(), Attribute::Matrix4(finish.world_to_camera)),
        ("worldToNDC".to_owned(), Attribute::Matrix4(finish.world_to_ndc)),
        ("abbe/version".to_owned(), text(env!("CARGO_PKG_VERSION"))),
        ("abbe/sceneHash".to_owned(), text(&finish.scene_hash)),
        ("abbe/settingsHash".to_owned(), text(&finish.settings_hash())),
        ("abbe/pixelHash".to_owned(), text(&report.pixel_hash)),
        ("abbe/seed".to_owned(), text(&finish.seed.to_string())),
        ("abbe/samples".to_owned(), Attribute::Int(frame.samples() as i32)),
        ("abbe/wavelengths".to_owned(), text(&finish.wavelengths)),
        ("abbe/integrator".to_owned(), text(&finish.integrator)),
        ("abbe/effects".to_owned(), text(&report.effects_in_force().join(", "))),
        ("abbe/renderSeconds".to_owned(), Attribute::Double(frame.elapsed.as_secs_f64())),
        ("abbe/invalidSamples".to_owned(), text(&frame.invalid().total().to_string())),
    ];
    if let Some(number) = finish.frame_number {
        all.push(("abbe/frame".to_owned(), Attribute::Int(number)));
        all.push(("imageCounter".to_owned(), Attribute::Int(number)));
    }
    if let Some(rate) = finish.frames_per_second {
        let [frames, seconds] = rational_rate(rate);
        all.push(("framesPerSecond".to_owned(), Attribute::Rational(frames as i32, seconds)));
    }
    if let Some(counts) = &report.adaptive {
        let counts = format!("least {}, mean {:.1}, most {}", counts.least, counts.mean, counts.most);
        all.push(("abbe/adaptiveSamples".to_owned(), text(&counts)));
    }
    if let Some(e) = &report.error {
        all.push(("abbe/relativeError".to_owned(), Attribute::Double(e.rel_rmse)));
        let state = if e.valid { "valid" } else { "not converged, interval not valid" };
        all.push(("abbe/relativeErrorState".to_owned(), text(state)));
        all.push(("abbe/relativeErrorInterval95".to_owned(), text(&format!("{:.3e} {:.3e}", e.low, e.high))));
    }
    if let Some(seconds) = report.halving_seconds {
        all.push(("abbe/secondsToHalveError".to_owned(), Attribute::Double(seconds)));
    }
    all
}

/// Frames and seconds of a rate: whole ones a second, those of television (24000 in 1001 seconds, written 23.976 or 23.98),
/// else to the nearest thousandth, which the description keeps from 0.001 to 10⁶ frames a second.
fn rational_rate(rate: f64) -> [u32; 2] {
    let whole = (rate * 1.001).round();
    // 23.98 for 23.976…: digits are left out beyond the second.
    let television = (whole / 1.001 - rate).abs() <= 0.005 && rate.fract() != 0.0 && whole % 6.0 == 0.0;
    if television {
        [whole as u32 * 1000, 1001]
    } else if rate.fract() == 0.0 {
        [rate as u32, 1]
    } else {
        [(rate * 1000.0).round() as u32, 1000]
    }
}

/// 128 bits of BLAKE3 over the numbers of a picture.
fn pixel_hash(image: &Image) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut bytes = Vec::new();
    for plane in image.rgb.iter().chain([&image.alpha]) {
        bytes.clear();
        bytes.extend(plane.iter().flat_map(|x| x.to_le_bytes()));
        hasher.update(&bytes);
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_of_television_are_over_1001() {
        let rates = [(24.0, [24, 1]), (23.976, [24_000, 1001]), (29.97, [30_000, 1001]), (59.94, [60_000, 1001])];
        for (rate, rational) in
            rates.into_iter().chain([(23.98, [24_000, 1001]), (12.5, [12_500, 1000]), (1e6, [1_000_000, 1])])
        {
            assert_eq!(rational_rate(rate), rational, "{rate}");
        }
    }
}
