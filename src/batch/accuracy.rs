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

use super::frame::{self, FrameJob, Milestone};
use super::stop::Fit;
use super::{BatchEntry, Overrides, Prepared, develop, prepare_with};
use crate::error::{Error, Result};
use crate::film::accumulate::REPLICATES;
use crate::film::filter::FilterSampler;
use crate::film::png;
use crate::film::resolve::Image;
use crate::math::statistics::Moments;
use crate::scene::shelf::Shelf;
use crate::spectrum::ColourSpace;
use crate::transport::plan::Integrator;
use half::f16;
use serde::Serialize;
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

/// A value of a knob.
struct Trial {
    knob: &'static str,
    value: String,
    set: Vec<(String, String)>,
    /// Samples that have nothing in common.
    independent: bool,
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

/// One render.
struct Shot {
    seconds: f64,
    image: Image,
    noise: [f64; 3],
    converged: bool,
    milestones: Vec<Milestone>,
    /// Mean red, green and blue of each replicate.
    means: [[f64; 3]; REPLICATES],
    png: Vec<u8>,
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
    let mut shelf = Shelf::default();
    let whole = prepare_with(entry, overrides, &mut shelf)?;
    let Integrator::Path(path) = &whole.plan.integrator else {
        return Ok(Err(
            "only `path` has knobs to weigh; whatever else computes the light has no noise, or no choice".into()
        ));
    };
    let [width, height] = whole.scene.camera.resolution.map(f64::from);
    let scale = (f64::from(settings.pixels) / (width * height)).sqrt().min(1.0);
    let size = [width, height].map(|side| ((side * scale).round() as u32).max(8));
    let mut base = vec![
        ("image.width".to_owned(), size[0].to_string()),
        ("image.height".to_owned(), size[1].to_string()),
        ("image.crop".to_owned(), "null".to_owned()),
        ("render.stop".to_owned(), "{}".to_owned()),
        ("render.samples".to_owned(), settings.samples.to_string()),
    ];
    base.retain(|(key, _)| key != "image.crop" || whole.description.image.crop.is_some());
    let trials = trials(&whole, path.max_depth, path.roulette_depth, settings.samples);
    let shoot = |set: &[(String, String)], independent: bool, seed: u64, shelf: &mut Shelf| -> Result<Shot> {
        let mut overrides = overrides.clone();
        overrides.set.extend(base.iter().chain(set).cloned());
        overrides.set.push(("render.seed".into(), seed.to_string()));
        shot(&prepare_with(entry, &overrides, shelf)?, independent, stop)
    };
    let rounds = settings.rounds.max(1);
    let total = trials.len() * rounds as usize + 1;
    let mut done = 0;
    let mut tell = |what: &str| {
        told(what, done, total);
        done += 1;
    };
    tell("reference");
    let more = settings.samples.saturating_mul(REFERENCE);
    let full: Vec<(String, String)> = [
        ("render.samples", more.to_string()),
        ("integrator.path.max_depth", "null".into()),
        ("render.techniques.merging", "off".into()),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into();
    let seed = whole.description.render.seed;
    let reference = shoot(&full, false, seed ^ SEED_OF_THE_REFERENCE, &mut shelf)?;
    let mut shots: Vec<Vec<Shot>> = trials.iter().map(|_| Vec::new()).collect();
    for round in 0..rounds {
        for (i, trial) in trials.iter().enumerate() {
            tell(&format!("{} {}", trial.knob, trial.value));
            let shot = shoot(&trial.set, trial.independent, seed.wrapping_add(u64::from(round)), &mut shelf)?;
            shots[i].push(shot);
        }
    }
    let mut rows: Vec<Row> = trials.iter().zip(&mut shots).map(|(t, s)| row(t, s, &reference)).collect();
    let half = shots[0].last().map_or(0.0, |shot| rounding(&shot.image));
    let target = settings.target.unwrap_or(rows[0].noise[0]);
    let own = rows[0].noise[0].powi(2) * rows[0].seconds;
    for (row, shots) in rows.iter_mut().zip(&shots) {
        row.efficiency = own / (row.noise[0].powi(2) * row.seconds);
        row.to_target = to_target(row, shots, target);
    }
    let bias_squared = Figure { value: half, error: 0.0 };
    rows.push(Row { knob: "file", value: "half".into(), chosen: false, bias_squared, ..rows[0].clone() });
    let advice = advice(&rows);
    let reference = (more, reference.noise[0]);
    Ok(Ok(Sheet { scene: whole.scene.name.clone(), size, target, reference, rows, advice }))
}

/// The reference has as many times the samples.
const REFERENCE: u32 = 16;

/// Its random numbers are others.
const SEED_OF_THE_REFERENCE: u64 = 0x7265_6665_7265_6e63;

/// The chosen setting, then each knob at other values.
fn trials(whole: &Prepared, depth: Option<u32>, roulette: u32, samples: u32) -> Vec<Trial> {
    let trial = |knob, value: &str, set: &[(&str, &str)]| Trial {
        knob,
        value: value.to_owned(),
        set: set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect(),
        independent: false,
    };
    let mut all = vec![trial("chosen", "as written", &[])];
    for (name, samples) in [("1/4", samples / 4), ("1/2", samples / 2), ("2", samples * 2), ("4", samples * 4)] {
        if samples >= REPLICATES as u32 {
            all.push(trial("samples", &format!("x {name}"), &[("render.samples", &samples.to_string())]));
        }
    }
    for value in [Some(2), Some(4), Some(8), Some(16), None] {
        if value != depth {
            let text = value.map_or("no bound".to_owned(), |d| d.to_string());
            let written = value.map_or("null".to_owned(), |d: u32| d.to_string());
            all.push(trial("depth", &text, &[("integrator.path.max_depth", &written)]));
        }
    }
    all.push(Trial { independent: true, ..trial("sampler", "independent", &[]) });
    for value in [1, 5, 1000] {
        if value != roulette {
            let text = if value == 1000 { "from 1000".to_owned() } else { format!("from {value}") };
            all.push(trial("roulette", &text, &[("integrator.path.roulette_depth", &value.to_string())]));
        }
    }
    for value in ["visible", "uniform"] {
        all.push(trial("wavelengths", value, &[("render.wavelengths", value)]));
    }
    // What is on is turned off; what was left off, although there is cause for it, is turned on.
    let techniques: [(&'static str, &str); 3] = [
        ("light tracing", "render.techniques.light_tracing"),
        ("packets", "render.techniques.packets"),
        ("merging", "render.techniques.merging"),
    ];
    let caustics = whole.plan.caustics.as_deref();
    let on =
        [caustics.is_some(), whole.plan.packets || caustics.is_some(), caustics.is_some_and(|c| c.merging.is_some())];
    let about = |words: &str| whole.plan.techniques.iter().any(|t| t.name.contains(words));
    let cause = [about("light tracing"), about("packets"), about("merging")];
    for (((knob, key), on), cause) in techniques.into_iter().zip(on).zip(cause) {
        if on && cause {
            all.push(trial(knob, "off", &[(key, "off")]));
        } else if cause {
            all.push(trial(knob, "on", &[(key, "on")]));
        }
    }
    all.push(trial("effects", "all", &[("render.effects", "all")]));
    all
}

fn shot(prepared: &Prepared, independent: bool, stop: &AtomicBool) -> Result<Shot> {
    let filter = FilterSampler::new(super::filter(&prepared.description.image.filter))?;
    let job = FrameJob { independent, ..prepared.job(&filter) };
    let frame = frame::render(&job, &|_| {}, stop)?;
    if stop.load(Ordering::Relaxed) {
        return Err(Error::Render("stopped; nothing was written".into()));
    }
    let image = frame.resolve(&ColourSpace::Rec709.matrix_from_xyz());
    let error = frame.milestones.last().and_then(|m| m.error);
    let noise = error.map_or([f64::NAN; 3], |e| [e.rel_rmse, e.low, e.high]);
    let png = {
        let finish = super::finish::Finish::of(prepared);
        let settings = develop::settings(&finish.output.png, finish.white, &image, ColourSpace::Rec709);
        png::encode_png(&image, &settings).map_err(Error::Render)?
    };
    Ok(Shot {
        seconds: frame.elapsed.as_secs_f64(),
        converged: error.is_some_and(|e| e.valid),
        means: frame.replicate_means(&ColourSpace::Rec709.matrix_from_xyz()),
        milestones: frame.milestones,
        image,
        noise,
        png,
    })
}

/// relMSE of a file of half precision against `image`: the same samples, so nothing of it is noise.
fn rounding(image: &Image) -> f64 {
    let values = || image.rgb.iter().flatten().map(|&x| (f64::from(x), f64::from(f16::from_f32(x).to_f32())));
    let n = image.rgb.iter().map(Vec::len).sum::<usize>() as f64;
    let mean = values().map(|(x, _)| x).sum::<f64>() / n;
    values().map(|(x, rounded)| (rounded - x).powi(2) / (x * x + 0.01 * mean * mean)).sum::<f64>() / n
}

/// Blocks along the longer side over which distances to the reference are gathered.
const BLOCKS: u32 = 8;

/// What of relMSE between the pictures and the reference is no noise.
fn bias_squared(shots: &[Shot], reference: &Image) -> Figure {
    let window = reference.window;
    let values = reference.rgb.iter().flatten();
    let n = reference.rgb.iter().map(Vec::len).sum::<usize>() as f64;
    let mean = values.map(|&x| f64::from(x)).sum::<f64>() / n;
    let floor = 0.01 * mean * mean;
    let side = window.width.max(window.height).div_ceil(BLOCKS).max(1);
    let columns = window.width.div_ceil(side);
    let mut blocks = vec![Moments::default(); (columns * window.height.div_ceil(side)) as usize];
    let rounds = shots.len() as f64;
    for i in 0..window.pixels() {
        let [x, y] = [i as u32 % window.width, i as u32 / window.width];
        let block = &mut blocks[(y / side * columns + x / side) as usize];
        for c in 0..3 {
            let truth = f64::from(reference.rgb[c][i]);
            let square = |e: f32| f64::from(e) * f64::from(e);
            let value = shots.iter().map(|s| f64::from(s.image.rgb[c][i])).sum::<f64>() / rounds;
            let noise = shots.iter().map(|s| square(s.image.standard_error[c][i])).sum::<f64>() / (rounds * rounds);
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

fn row(trial: &Trial, shots: &mut [Shot], reference: &Shot) -> Row {
    let mut seconds: Vec<f64> = shots.iter().map(|s| s.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let n = shots.len() as f64;
    let square = |i: usize| (shots.iter().map(|s| s.noise[i] * s.noise[i]).sum::<f64>() / n).sqrt();
    let light = std::array::from_fn(|c| {
        let truth: Moments = reference.means.iter().map(|m| m[c]).collect();
        let all: Moments = shots.iter().flat_map(|s| s.means.iter().map(|m| m[c])).collect();
        let value = all.mean / truth.mean;
        let relative = (all.standard_error() / all.mean).hypot(truth.standard_error() / truth.mean);
        Figure { value, error: value * relative }
    });
    let noise = [0, 1, 2].map(square);
    let converged = shots.iter().all(|s| s.converged);
    let bias_squared = bias_squared(shots, &reference.image);
    let last = &mut shots[shots.len() - 1];
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

fn to_target(row: &Row, shots: &[Shot], target: f64) -> Option<f64> {
    let left = target * target - row.bias().unwrap_or(0.0).powi(2);
    let fit = Fit::of(&shots.last()?.milestones)?;
    (left > 0.0).then(|| row.seconds * fit.samples_for(left.sqrt()) / f64::from(row.samples))
}

/// A number to two or three figures.
fn figures(x: f64) -> String {
    if x >= 99.5 {
        format!("{x:.0}")
    } else if x >= 9.95 {
        format!("{x:.1}")
    } else {
        format!("{x:.2}")
    }
}

/// What each knob buys, in a sentence.
fn advice(rows: &[Row]) -> Vec<(&'static str, String)> {
    let chosen = &rows[0];
    let mut knobs: Vec<&'static str> = rows[1..].iter().map(|r| r.knob).collect();
    knobs.dedup();
    let sentence = |knob: &'static str| {
        let parts: Vec<String> = rows.iter().filter(|r| r.knob == knob).map(|r| phrase(chosen, r)).collect();
        (knob, format!("{}.", parts.join("; ")))
    };
    knobs.into_iter().map(sentence).collect()
}

fn phrase(chosen: &Row, row: &Row) -> String {
    let time = figures(row.seconds / chosen.seconds);
    let noise = figures(row.noise[0] / chosen.noise[0]);
    let what = format!("{} {}", row.knob, row.value);
    let lost: Vec<String> = ["red", "green", "blue"]
        .iter()
        .zip(&row.light)
        .filter(|(_, f)| (f.value - 1.0).abs() > 2.0 * f.error && (f.value - 1.0).abs() >= 0.005)
        .map(|(name, f)| {
            let less = if f.value < 1.0 { "less" } else { "more" };
            format!("{:.1} % {less} {name}", 100.0 * (f.value - 1.0).abs())
        })
        .collect();
    let light = match (row.knob, lost.is_empty(), row.bias()) {
        ("file", ..) => {
            return format!("{what} precision adds an error of {:.3} %", 100.0 * row.bias_squared.value.sqrt());
        }
        ("samples", ..) => String::new(),
        (_, false, Some(bias)) => format!(", and finds {} (bias {:.2} %)", lost.join(", "), 100.0 * bias),
        (_, false, None) => format!(", and finds {}", lost.join(", ")),
        (_, true, Some(bias)) => format!(", with a bias of {:.2} %", 100.0 * bias),
        (_, true, None) => ", and finds the same light".into(),
    };
    let price = match row.to_target {
        Some(t) if row.knob != "samples" => chosen
            .to_target
            .map_or(String::new(), |own| format!("; to the target it takes {} of the time", figures(t / own))),
        Some(_) => String::new(),
        None => "; the target is below its bias".into(),
    };
    format!("{what} takes {time} of the time for {noise} of the noise{light}{price}")
}
