//! What the files of a picture need besides its sums.
//!
//! A part carries its [`Finish`], so that `abbe merge` needs no scene, and writes what the one process would have written.

use super::adaptive;
use super::frame::Gauge;
use super::prepare::{Prepared, colour_space, filter, window};
use super::{develop, layers, mattes};
use crate::description::{self, LayerContent, Output, SceneDescription, Shutter};
use crate::film::Window;
use crate::film::cryptomatte::Matte;
use crate::film::exr;
use crate::film::filter::Filter;
use crate::film::layers::{Kept, Layout};
use crate::film::png::PngSettings;
use crate::film::resolve::Image;
use crate::scene::camera::{Camera, Projection};
use crate::spectrum::ColourSpace;
use crate::transport::layers::{Channel, Holds};
use crate::transport::plan::{Effect, EffectPlan, Integrator};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::path::PathBuf;

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
    /// Samples of a pixel; the most of them, where there is a `target`.
    pub samples: u32,
    /// What else ends the render, if anything does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<Target>,
    /// Where samples are shared out by noise, how many all pixels have before; `samples` is then their mean.
    pub adaptive: Option<u32>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Hash of the description, without `target`, and of the files it names.
    pub scene_hash: String,
    /// What computes the light.
    pub integrator: String,
    /// What is simulated.
    pub effects: Vec<Effect>,
    /// How.
    pub techniques: Vec<Effect>,
    /// Whether anything shines.
    pub lit: bool,
    /// From which wavelengths samples are drawn.
    pub wavelengths: String,
    /// What a person should know of the scene.
    pub notes: Vec<String>,
    /// The camera's place and view, as the header of an EXR file has them; none where they are more than it can hold.
    pub world_to_camera: Option<[f32; 16]>,
    /// And to the frame.
    pub world_to_ndc: Option<[f32; 16]>,
    /// Middle and width of the frame before a camera that sees from a point.
    pub screen_window: Option<[f32; 3]>,
    /// Files, colours and tone curve.
    pub output: Output,
    /// The chromaticity that is shown white.
    pub white: Option<[f64; 2]>,
    /// Factor on colours.
    pub sensitivity: f64,
    /// Which pixels share their errors.
    pub sharing: Sharing,
    /// Whether bands of the spectrum stand in place of colour.
    pub bands: bool,
    /// Further channels.
    pub layers: Vec<Channel>,
    /// Whose samples share a sum of them.
    pub kept: Kept,
    /// Whether the variance of each pixel's mean is one.
    pub variance: bool,
    /// Whether the number of samples of each pixel is one.
    pub sample_count: bool,
    /// Mattes.
    pub mattes: Vec<Matte>,
    /// What a photographer would say of the camera.
    pub lens: Lens,
}

/// What ends a render besides its samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Relative error of the picture.
    pub error: Option<f64>,
    /// Wall time of rendering, seconds.
    pub time: Option<f64>,
    /// Samples of a pixel for which techniques are planned: of what is here alone they decide about pixels.
    pub planned: u32,
}

/// Which pixels of a picture share their errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sharing {
    /// All: where photons are merged, the samples of one number share their wavelengths in all pixels.
    All,
    /// Those near each other.
    Near {
        /// Where light is splatted, the more of [`Filter::span`](crate::film::filter::Filter::span) and [`EffectPlan::span`]; else 1.
        span: f64,
        /// [`Filter::overlap`](crate::film::filter::Filter::overlap), likewise.
        overlap: f64,
        /// Side of the cells, aligned to the frame, in which paths share what they find or pixels their samples; 1 where they do
        /// not.
        cell: u32,
    },
}

impl Sharing {
    /// What light by `plan` comes to under the filter of `description`.
    #[must_use]
    pub fn of(plan: &EffectPlan, description: &SceneDescription) -> Sharing {
        let splats = plan.caustics.is_some() || matches!(plan.integrator, Integrator::Light(_));
        let merging = plan.caustics.as_ref().is_some_and(|caustics| caustics.merging.is_some());
        if merging {
            return Sharing::All;
        }
        let filter = splats.then(|| filter(&description.image.filter));
        let of = |part: fn(&Filter) -> f64| filter.as_ref().map_or(1.0, part);
        let cell = if plan.shares_cells() { adaptive::SIDE } else { 1 };
        Sharing::Near { span: of(Filter::span).max(plan.span), overlap: of(Filter::overlap), cell }
    }
}

/// The lens of a camera whose picture were on film 36 mm wide.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Focal length, mm; none of an orthographic camera.
    pub focal_length_mm: Option<f64>,
    /// f-number: focal length over the diameter of the lens, where that has one.
    pub aperture: Option<f64>,
    /// Distance in focus, metres, where the lens has a diameter.
    pub focus: Option<f64>,
    /// How much of a frame the shutter is open, where it has one that the picture knows of.
    pub shutter: Option<f64>,
}

impl Lens {
    fn of(camera: &Camera, shutter: Option<&Shutter>) -> Lens {
        let shutter = shutter.map(Shutter::times).map(|times| times.close - times.open);
        let Projection::Perspective { half_width } = camera.projection else {
            return Lens { shutter, ..Lens::default() };
        };
        let focal_length = 18.0 / half_width;
        let wide = camera.lens.as_ref();
        Lens {
            focal_length_mm: Some(focal_length),
            aperture: wide.map(|lens| focal_length / 1000.0 / (2.0 * lens.radius)),
            focus: wide.map(|lens| lens.focus_distance),
            shutter,
        }
    }
}

impl Finish {
    /// What the files of `prepared` need.
    #[must_use]
    pub fn of(prepared: &Prepared) -> Finish {
        let Prepared { description, scene, plan, samples, planned, stop, hash, .. } = prepared;
        let time = stop.time.map(|time| time.as_secs_f64());
        let target = stop.is_open().then_some(Target { error: stop.error, time, planned: *planned });
        let (white, note) = develop::white(&description.output.png, scene);
        let mattes = mattes::mattes(description, scene);
        let shutter = description.camera.shutter.as_ref().filter(|_| plan.integrator.draws_times());
        let asked = |content: &LayerContent| description.layers.iter().any(|layer| layer.content == *content);
        // Where the files go is no matter of what is in them.
        let mut output = Output { dir: PathBuf::new(), contact_sheet: true, ..description.output.clone() };
        output.exr.stderr = layers::wants_errors(description);
        Finish {
            name: scene.name.clone(),
            frame_number: description.frame,
            frames_per_second: description.render.frames_per_second,
            frame: scene.camera.resolution,
            window: window(description),
            samples: *samples,
            target,
            adaptive: plan.adaptive.map(|adaptive| adaptive.first),
            seed: description.render.seed,
            scene_hash: hash.clone(),
            integrator: integrator(&plan.integrator).to_owned(),
            effects: plan.effects.clone(),
            techniques: plan.techniques.clone(),
            lit: plan.lit,
            wavelengths: scene.wavelengths.describe().to_owned(),
            notes: scene
                .notes
                .iter()
                .cloned()
                .chain(note)
                .chain(mattes::shared_names(description))
                .chain(mattes::shared_ids(&mattes))
                .collect(),
            world_to_camera: finite(scene.camera.camera_from_world()),
            world_to_ndc: finite(scene.camera.ndc_from_world()),
            screen_window: scene.camera.screen_window().and_then(finite),
            white,
            output,
            sensitivity: description.image.sensitivity,
            sharing: Sharing::of(plan, description),
            bands: !description.image.bands.is_empty(),
            layers: plan.layers.channels(),
            kept: plan.layers.kept,
            variance: asked(&LayerContent::Variance),
            sample_count: asked(&LayerContent::SampleCount),
            mattes,
            lens: Lens::of(&scene.camera, shutter),
        }
    }

    /// How the sums of the layers are kept.
    #[must_use]
    pub fn layout(&self) -> Layout {
        Layout { channels: self.layers.len(), kept: self.kept }
    }

    /// Of the layers, the bands of the spectral file: the last bands, whatever those of the picture before them are called.
    pub(super) fn spectral_channels(&self) -> Range<usize> {
        let all = self.layers.iter().filter(|channel| channel.holds == Holds::Band).count();
        let spectral = self.output.spectral.map_or(0, |spectral| spectral.bands as usize);
        all.saturating_sub(spectral)..all
    }

    /// Whether samples differ by chance, so that there is noise.
    #[must_use]
    pub fn is_random(&self) -> bool {
        self.integrator != "whitted"
    }

    /// How the error is told.
    #[must_use]
    pub fn gauge(&self) -> Gauge {
        let bands = if self.bands { self.spectral_channels().start } else { 0 };
        Gauge { random: self.is_random(), lit: self.lit, bands, sharing: self.sharing }
    }

    /// Rows of the frame that no part cuts.
    #[must_use]
    pub fn rows(&self) -> u32 {
        if self.adaptive.is_some() { adaptive::SIDE } else { 1 }
    }

    /// What a pixel of the file holds.
    pub(super) fn base(&self) -> exr::Base {
        base(&self.output, self.bands)
    }

    /// The colour space of the file.
    pub(super) fn space(&self) -> ColourSpace {
        if self.base().is_xyz() { ColourSpace::Xyz } else { colour_space(self.output.colour) }
    }

    /// From XYZ to the colours of the file.
    #[must_use]
    pub fn rgb_from_xyz(&self) -> [[f64; 3]; 3] {
        self.space().matrix_from_xyz().map(|row| row.map(|x| x * self.sensitivity))
    }

    /// From XYZ to linear Rec.709, which viewers expect.
    #[must_use]
    pub fn rec709_from_xyz(&self) -> [[f64; 3]; 3] {
        ColourSpace::Rec709.matrix_from_xyz().map(|row| row.map(|x| x * self.sensitivity))
    }

    /// How the PNG of `image` is developed, as it is shown, whose colours are those of the file.
    #[must_use]
    pub fn png_settings(&self, image: &Image) -> PngSettings {
        develop::settings(&self.output.png, self.white, image, self.space())
    }

    /// What the PNG says of the picture from which it was developed: that of the EXR whose pixels have the hash `pixels`.
    #[must_use]
    pub fn png_marks(&self, pixels: &str) -> Vec<(String, String)> {
        let text = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        vec![text("abbe/settingsHash", &self.settings_hash()), text("abbe/pixelHash", pixels)]
    }
}

/// What a pixel of a file holds: bands replace colour.
#[must_use]
pub fn base(output: &description::Output, bands: bool) -> exr::Base {
    match output.exr.channels {
        _ if bands => exr::Base::Nothing,
        description::Channels::Rgba => exr::Base::Rgba,
        description::Channels::Rgb => exr::Base::Rgb,
        description::Channels::Xyza => exr::Base::Xyza,
        description::Channels::Xyz => exr::Base::Xyz,
        description::Channels::LuminanceAlpha => exr::Base::LuminanceAlpha,
        description::Channels::Luminance => exr::Base::Luminance,
    }
}

/// Numbers all of which f32 can hold: JSON has no others.
fn finite<const N: usize>(numbers: [f32; N]) -> Option<[f32; N]> {
    Some(numbers).filter(|numbers| numbers.iter().all(|x| x.is_finite()))
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
