//! What accuracy costs: each knob of a scene moved by itself, and what that does to time, noise and light.
//!
//! A small copy of the scene is rendered with the chosen setting and with each knob at other values, in rounds with a seed
//! of their own, one setting after the other, so that what else the machine does falls on all alike. Against them stands a
//! reference: the full setting (no bound to depth, merging off) with more samples.
//!
//! * **time** is the median over the rounds;
//! * **noise** is √relMSE ([`crate::film::error`]), over the rounds in the mean square;
//! * **bias** is what is left of the distance to the reference without the noise of both: of each block of pixels, and its
//!   standard error from how the blocks differ;
//! * **light** is the mean of red, green and blue over the reference's, with the standard error of replicates and rounds;
//! * **efficiency** is 1 / (noise² · time), over that of the chosen setting;
//! * **to the target** is the time until noise and bias together are the target, by the convergence that was seen; none where
//!   the bias is above it.

mod advice;
mod knobs;
pub mod page;

use super::frame::{self, Frame, FrameJob, Milestone};
use super::stop::Fit;
use super::{BatchEntry, Overrides, Prepared, develop, prepare_scene};
use crate::error::{Error, Result};
use crate::film::accumulate::REPLICATES;
use crate::film::error;
use crate::film::filter::FilterSampler;
use crate::film::png;
use crate::film::resolve::Image;
use crate::math::statistics::Moments;
use crate::scene::Scene;
use crate::scene::shelf::Shelf;
use crate::spectrum::ColourSpace;
use crate::transport::plan::Integrator;
use half::f16;
use knobs::{Trial, Way};
use serde::Serialize;
use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};

/// How a sheet is made.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// About as many pixels as the copy has.
    pub pixels: u32,
    /// Samples of a pixel of the chosen setting.
    pub samples: u32,
    /// How often each setting is rendered.
    pub rounds: u32,
    /// The error that is wanted; that of the chosen setting if none.
    pub target: Option<f64>,
}

/// A figure and the standard error of it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Figure {
    /// The figure.
    pub value: f64,
    /// Its standard error.
    pub error: f64,
}

/// The error after some time.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    /// Samples of a pixel.
    pub samples: u32,
    /// Seconds of rendering.
    pub seconds: f64,
    /// Noise with the ends of its interval.
    pub noise: [f64; 3],
}

/// What a setting costs and gives.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What was moved.
    pub knob: &'static str,
    /// To what.
    pub value: String,
    /// Whether this is the chosen setting.
    pub chosen: bool,
    /// Samples of a pixel.
    pub samples: u32,
    /// Seconds of rendering, median of the rounds.
    pub seconds: f64,
    /// Least and most of the rounds.
    pub spread: [f64; 2],
    /// √relMSE of the noise, with its interval of 95 %.
    pub noise: [f64; 3],
    /// Whether the noise can be believed.
    pub converged: bool,
    /// relMSE of what is not noise.
    pub bias_squared: Figure,
    /// Red, green and blue over those of the reference.
    pub light: [Figure; 3],
    /// 1 / (noise² · time) over that of the chosen setting.
    pub efficiency: f64,
    /// Seconds to the target; none where it cannot be reached.
    pub to_target: Option<f64>,
    /// How noise fell.
    pub curve: Vec<Point>,
    /// A PNG of the last round.
    #[serde(skip)]
    pub png: Vec<u8>,
}

/// All of a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Sheet {
    /// Name of the scene.
    pub scene: String,
    /// Width and height of the copy in pixels.
    pub size: [u32; 2],
    /// The error that is wanted.
    pub target: f64,
    /// Samples of a pixel of the reference, and its noise.
    pub reference: (u32, f64),
    /// The settings, knob by knob.
    pub rows: Vec<Row>,
    /// A sentence for each knob.
    pub advice: Vec<(&'static str, String)>,
}

/// What came of one render.
struct Outcome {
    seconds: f64,
    image: Image,
    noise: [f64; 3],
    converged: bool,
    milestones: Vec<Milestone>,
    /// Mean red, green and blue of each replicate.
    means: [[f64; 3]; REPLICATES],
    png: Vec<u8>,
}

/// What all renders of a sheet share.
struct Desk<'a> {
    entry: &'a BatchEntry,
    /// With what makes the small copy.
    overrides: Overrides,
    stop: &'a AtomicBool,
    shelf: RefCell<Shelf>,
}

/// The sheet of a scene, or why there is none: what has no noise has nothing to weigh.
///
/// # Errors
/// As [`super::prepare`] and [`frame::render`].
pub fn sheet(
    entry: &BatchEntry,
    overrides: &Overrides,
    settings: &Settings,
    told: &dyn Fn(&str, usize, usize),
    stop: &AtomicBool,
) -> Result<std::result::Result<Sheet, String>> {
    let written = entry.scene(&overrides.set)?;
    let [width, height] = [written.image.width, written.image.height].map(f64::from);
    let scale = (f64::from(settings.pixels) / (width * height)).sqrt().min(1.0);
    let size = [width, height].map(|side| ((side * scale).round() as u32).max(8));
    let mut overrides = overrides.clone();
    overrides.set.extend([
        ("image.width".to_owned(), size[0].to_string()),
        ("image.height".to_owned(), size[1].to_string()),
        ("render.stop".to_owned(), "{}".to_owned()),
        ("render.samples".to_owned(), settings.samples.to_string()),
    ]);
    if written.image.crop.is_some() {
        overrides.set.push(("image.crop".to_owned(), "null".to_owned()));
    }
    let desk = Desk { entry, overrides, stop, shelf: RefCell::default() };
    let chosen = desk.prepare(&[], |_| {})?;
    let Integrator::Path(path) = &chosen.plan.integrator else {
        return Ok(Err(
            "only `path` has knobs to weigh; whatever else computes the light has no noise, or no choice".into()
        ));
    };
    let trials = knobs::trials(&chosen, path);
    let rounds = settings.rounds.max(1);
    let total = trials.len() * rounds as usize + 1;
    let mut done = 0;
    let mut tell = |what: &str| {
        told(what, done, total);
        done += 1;
    };
    tell("reference");
    let more = settings.samples.saturating_mul(REFERENCE);
    let full = Trial {
        knob: "reference",
        value: String::new(),
        set: [
            ("render.samples", more.to_string()),
            ("integrator.path.max_depth", "null".into()),
            ("render.techniques.merging", "off".into()),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into(),
        way: Way::AsSet,
    };
    let seed = chosen.description.render.seed;
    let reference = desk.render(&full, seed ^ SEED_OF_THE_REFERENCE)?;
    let mut outcomes: Vec<Vec<Outcome>> = trials.iter().map(|_| Vec::new()).collect();
    for round in 0..rounds {
        for (trial, outcomes) in trials.iter().zip(&mut outcomes) {
            tell(&format!("{} {}", trial.knob, trial.value));
            outcomes.push(desk.render(trial, seed.wrapping_add(u64::from(round)))?);
        }
    }
    let mut rows: Vec<Row> = trials.iter().zip(&mut outcomes).map(|(t, o)| row(t, o, &reference)).collect();
    let half = outcomes[0].last().map_or(0.0, |outcome| rounding(&outcome.image));
    let target = settings.target.unwrap_or(rows[0].noise[0]);
    let own = rows[0].noise[0].powi(2) * rows[0].seconds;
    for (row, outcomes) in rows.iter_mut().zip(&outcomes) {
        row.efficiency = own / (row.noise[0].powi(2) * row.seconds);
        row.to_target = to_target(row, outcomes, target);
    }
    let bias_squared = Figure { value: half, error: 0.0 };
    rows.push(Row { knob: "file", value: "half".into(), chosen: false, bias_squared, ..rows[0].clone() });
    let advice = advice::sentences(&rows);
    let reference = (more, reference.noise[0]);
    Ok(Ok(Sheet { scene: chosen.scene.name, size, target, reference, rows, advice }))
}

impl Desk<'_> {
    /// The small copy with further settings.
    fn prepare(&self, set: &[(String, String)], alter: impl FnOnce(&mut Scene)) -> Result<Prepared> {
        let mut overrides = self.overrides.clone();
        overrides.set.extend(set.iter().cloned());
        let description = self.entry.scene(&overrides.set)?;
        prepare_scene(self.entry, description, &overrides, &mut self.shelf.borrow_mut(), alter)
    }

    fn render(&self, trial: &Trial, seed: u64) -> Result<Outcome> {
        let mut set = trial.set.clone();
        set.push(("render.seed".into(), seed.to_string()));
        let one = |alter: &dyn Fn(&mut Scene)| -> Result<(Prepared, Frame)> {
            let prepared = self.prepare(&set, alter)?;
            let frame = self.frame(&prepared, trial.way == Way::Independent)?;
            Ok((prepared, frame))
        };
        let (prepared, frame) = match trial.way {
            Way::AsSet | Way::Independent => one(&|_| {})?,
            Way::Wavelengths(16) => {
                let (prepared, eight) = one(&|_| {})?;
                let (_, further) = one(&|scene| scene.wavelengths = scene.wavelengths.half_a_step_on())?;
                (prepared, both(eight, further)?)
            }
            Way::Wavelengths(count) => one(&|scene| scene.wavelengths = scene.wavelengths.with_count(count))?,
        };
        outcome(&prepared, frame)
    }

    fn frame(&self, prepared: &Prepared, independent: bool) -> Result<Frame> {
        let filter = FilterSampler::new(super::filter(&prepared.description.image.filter))?;
        let job = FrameJob { independent, ..prepared.job(&filter) };
        let frame = frame::render(&job, &|_| {}, self.stop)?;
        if self.stop.load(Ordering::Relaxed) {
            return Err(Error::Render("stopped; nothing was written".into()));
        }
        Ok(frame)
    }
}

/// The samples of two frames as those of one: replicate by replicate, so that the spread of replicates is still that of
/// independent means, whatever the frames have in common.
fn both(a: Frame, b: Frame) -> Result<Frame> {
    let (samples, elapsed) = (a.samples(), a.elapsed + b.elapsed);
    let (mut film, mut splats) = (a.film, a.splats);
    film.merge(&b.film)?;
    if let (Some(a), Some(b)) = (&mut splats, b.splats) {
        a.film.merge(&b.film)?;
        a.paths.iter_mut().zip(b.paths).for_each(|(a, b)| *a += b);
    }
    Ok(Frame::of(film, splats, samples, elapsed, true))
}

fn outcome(prepared: &Prepared, frame: Frame) -> Result<Outcome> {
    let space = ColourSpace::Rec709.matrix_from_xyz();
    let image = frame.resolve(&space);
    let error = frame.milestones.last().and_then(|m| m.error);
    let finish = super::finish::Finish::of(prepared);
    let settings = develop::settings(&finish.output.png, finish.white, &image, ColourSpace::Rec709);
    Ok(Outcome {
        seconds: frame.elapsed.as_secs_f64(),
        converged: error.is_some_and(|e| e.valid),
        noise: error.map_or([f64::NAN; 3], |e| [e.rel_rmse, e.low, e.high]),
        means: frame.replicate_means(&space),
        png: png::encode_png(&image, &settings).map_err(Error::Render)?,
        milestones: frame.milestones,
        image,
    })
}

/// The reference has as many times the samples.
const REFERENCE: u32 = 16;

/// Its random numbers are others.
const SEED_OF_THE_REFERENCE: u64 = 0x7265_6665_7265_6e63;

/// relMSE of a file of half precision against `image`: the same samples, so nothing of it is noise.
fn rounding(image: &Image) -> f64 {
    let values = image.rgb.iter().flatten().map(|&x| (f64::from(x), f64::from(f16::from_f32(x).to_f32())));
    let floor = error::floor(image);
    let all: Moments = values.map(|(x, rounded)| (rounded - x).powi(2) / (x * x + floor)).collect();
    all.mean
}

/// Blocks along the longer side over which distances to the reference are gathered.
const BLOCKS: u32 = 8;

/// What of relMSE between the pictures and the reference is no noise.
fn bias_squared(outcomes: &[Outcome], reference: &Image) -> Figure {
    let window = reference.window;
    let floor = error::floor(reference);
    let side = window.width.max(window.height).div_ceil(BLOCKS).max(1);
    let columns = window.width.div_ceil(side);
    let mut blocks = vec![Moments::default(); (columns * window.height.div_ceil(side)) as usize];
    let rounds = outcomes.len() as f64;
    for i in 0..window.pixels() {
        let [x, y] = [i as u32 % window.width, i as u32 / window.width];
        let block = &mut blocks[(y / side * columns + x / side) as usize];
        for c in 0..3 {
            let truth = f64::from(reference.rgb[c][i]);
            let square = |e: f32| f64::from(e) * f64::from(e);
            let value = outcomes.iter().map(|s| f64::from(s.image.rgb[c][i])).sum::<f64>() / rounds;
            let noise = outcomes.iter().map(|s| square(s.image.standard_error[c][i])).sum::<f64>() / (rounds * rounds);
            let noise = noise + square(reference.standard_error[c][i]);
            let excess = (value - truth) * (value - truth) - noise;
            if excess.is_finite() {
                block.push(excess / (truth * truth + floor));
            }
        }
    }
    let over: Moments = blocks.iter().filter(|b| b.count > 0).map(|b| b.mean).collect();
    Figure { value: over.mean, error: over.standard_error() }
}

fn row(trial: &Trial, outcomes: &mut [Outcome], reference: &Outcome) -> Row {
    let mut seconds: Vec<f64> = outcomes.iter().map(|o| o.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let n = outcomes.len() as f64;
    let square = |i: usize| (outcomes.iter().map(|o| o.noise[i] * o.noise[i]).sum::<f64>() / n).sqrt();
    let light = std::array::from_fn(|c| {
        let truth: Moments = reference.means.iter().map(|m| m[c]).collect();
        let all: Moments = outcomes.iter().flat_map(|o| o.means.iter().map(|m| m[c])).collect();
        let value = all.mean / truth.mean;
        let relative = (all.standard_error() / all.mean).hypot(truth.standard_error() / truth.mean);
        Figure { value, error: value * relative }
    });
    let noise = [0, 1, 2].map(square);
    let converged = outcomes.iter().all(|o| o.converged);
    let bias_squared = bias_squared(outcomes, &reference.image);
    let last = &mut outcomes[outcomes.len() - 1];
    let curve = last.milestones.iter().filter_map(|m| {
        let e = m.error?;
        Some(Point { samples: m.samples, seconds: m.elapsed.as_secs_f64(), noise: [e.rel_rmse, e.low, e.high] })
    });
    let curve = curve.collect();
    let samples = last.milestones.last().map_or(0, |m| m.samples);
    Row {
        knob: trial.knob,
        value: trial.value.clone(),
        chosen: trial.knob == "chosen",
        samples,
        seconds: seconds[seconds.len() / 2],
        spread: [seconds[0], seconds[seconds.len() - 1]],
        noise,
        converged,
        bias_squared,
        light,
        efficiency: f64::NAN,
        to_target: None,
        curve,
        png: std::mem::take(&mut last.png),
    }
}

impl Row {
    /// √relMSE of the bias, where it stands out of its own noise by two standard errors.
    #[must_use]
    pub fn bias(&self) -> Option<f64> {
        let Figure { value, error } = self.bias_squared;
        (value > 2.0 * error && value > 0.0).then(|| value.sqrt())
    }
}

fn to_target(row: &Row, outcomes: &[Outcome], target: f64) -> Option<f64> {
    let left = target * target - row.bias().unwrap_or(0.0).powi(2);
    let fit = Fit::of(&outcomes.last()?.milestones)?;
    (left > 0.0).then(|| row.seconds * fit.samples_for(left.sqrt()) / f64::from(row.samples))
}
