//! What accuracy costs: each knob of a scene moved by itself, and what that does to time, noise and light.
//!
//! A small copy of the scene is rendered with the chosen setting and with each knob at other values, in rounds with a seed
//! of their own, one setting after the other, so that what else the machine does falls on all alike. Against them stands a
//! reference: the full setting (no bound to depth, merging off) with more samples.
//!
//! * **time** is the least of the rounds: what else the machine does adds to it;
//! * **noise** and **bias** are √relMSE against the reference, **light** the mean of red, green and blue over the reference's
//!   (`figures`);
//! * **efficiency** is 1 / (noise² · time), over that of the chosen setting;
//! * **to the target** is the time until noise and bias together are the target, by the convergence that was seen; none where
//!   the bias is above it.

mod advice;
pub mod beside;
mod desk;
mod figures;
mod knobs;
pub mod page;

use super::finish::Finish;
use super::forecast::Fit;
use super::{BatchEntry, Overrides, develop};
use crate::description;
use crate::error::{Error, Result};
use crate::film::error;
use crate::film::exr::half_loses;
use crate::film::png;
use crate::film::resolve::Image;
use crate::math::statistics::Moments;
use crate::spectrum::ColourSpace;
use beside::Beside;
use desk::Desk;
use figures::{Reference, SIGNIFICANT, Tally};
use half::f16;
use knobs::{Trial, Way};
use serde::Serialize;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// How a sheet is made.
#[derive(Clone, Debug)]
pub struct Settings<'a> {
    /// About as many pixels as the copy has.
    pub pixels: u32,
    /// Samples of a pixel of the chosen setting.
    pub samples: u32,
    /// How often each setting is rendered.
    pub rounds: u32,
    /// The error that is wanted; that of the chosen setting if none.
    pub target: Option<f64>,
    /// About how long all of it may take: samples are cut to that, to [`FEWEST`] at the least.
    pub time: Option<Duration>,
    /// What every pixel is known to be, radiance at all wavelengths alike: in place of a reference.
    pub truth: Option<f64>,
    /// The knobs that are moved; all where empty.
    pub knobs: &'a [String],
    /// Another build that renders the chosen setting, too.
    pub beside: Option<Beside<'a>>,
}

impl Settings<'_> {
    /// Whether a knob is moved.
    fn moves(&self, knob: &str) -> bool {
        self.knobs.is_empty() || self.knobs.iter().any(|name| name == knob)
    }

    /// How many times the samples the picture without a bound to depth has: against the truth it is only looked at.
    fn times_as_many(&self) -> u32 {
        if self.truth.is_some() { 1 } else { REFERENCE }
    }
}

/// See [`Settings::time`].
pub const FEWEST: u32 = 16;

/// A figure and the standard error of it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Figure {
    /// The figure.
    pub value: f64,
    /// Its standard error.
    pub error: f64,
}

impl Figure {
    /// Whether this factor is another than 1, by a standard error that is a share of itself.
    fn is_another_factor(&self) -> bool {
        libm::log(self.value).abs() * self.value > figures::SIGNIFICANT * self.error
    }
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
    /// Whether the interval can be believed: whether the pictures of all rounds have converged.
    pub converged: bool,
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
    /// Seconds of rendering, the least of the rounds.
    pub seconds: f64,
    /// The most of the rounds.
    pub most_seconds: f64,
    /// √relMSE of the noise, with its interval of 95 %; not a number where no light was met, whose noise nobody knows.
    pub noise: [f64; 3],
    /// As [`Point::converged`].
    pub converged: bool,
    /// relMSE of what is not noise.
    pub bias_squared: Figure,
    /// Red, green and blue over those of the reference.
    pub light: [Figure; 3],
    /// 1 / (noise² · time) over that of the chosen setting; infinite without noise, and not a number where that is unknown.
    pub efficiency: Figure,
    /// Seconds to the target; none where it cannot be reached, or the noise is unknown.
    pub to_target: Option<f64>,
    /// How noise fell.
    pub curve: Vec<Point>,
    /// A PNG of the first round.
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
    /// Samples of a pixel of the reference, and its noise; none where the truth is known.
    pub reference: Option<(u32, f64)>,
    /// A PNG of the reference.
    #[serde(skip)]
    pub png: Vec<u8>,
    /// The settings, knob by knob.
    pub rows: Vec<Row>,
    /// A sentence for each knob.
    pub advice: Vec<(&'static str, String)>,
    /// Why there is no row of another build, where there should be.
    pub failed: Option<String>,
    /// Whether the scene's file has bands of the spectrum in place of the colours, of which all this is.
    pub bands: bool,
}

/// The sheet of a scene, or why there is none: what has no noise has nothing to weigh, nor has what is black.
///
/// # Errors
/// As [`super::prepare`], and where it was stopped.
pub fn sheet(
    entry: &BatchEntry,
    overrides: &Overrides,
    settings: &Settings<'_>,
    told: &dyn Fn(&str, usize, usize),
    stop: &AtomicBool,
) -> Result<std::result::Result<Sheet, String>> {
    let written = entry.scene(&overrides.set)?;
    let (size, small) = small_copy(&written.image, settings.pixels);
    let mut overrides = overrides.clone();
    overrides.set.extend(small);
    if !matches!(written.integrator, description::Integrator::Path(_)) {
        return Ok(Err(
            "only `path` has knobs to weigh; whatever else computes the light has no noise, or no choice".into()
        ));
    }
    let rounds = settings.rounds.max(1);
    let mut desk = Desk::new(entry, overrides, stop);
    let samples = desk.samples(settings)?;
    desk.overrides.set.push(("render.samples".to_owned(), samples.to_string()));
    let chosen = desk.prepare(&[])?;
    let trials = knobs::wanted(&chosen, settings)?;
    let total = trials.len() * rounds as usize + 1;
    let mut done = 0;
    let mut tell = |what: &str| {
        told(what, done, total);
        done += 1;
    };
    tell("reference");
    let more = samples.saturating_mul(settings.times_as_many());
    let seed = chosen.description.render.seed;
    let full = desk.render(&full_setting(more), seed ^ SEED_OF_THE_REFERENCE, None)?;
    let reference = match settings.truth {
        Some(radiance) => Reference::known(&full.image, radiance),
        None => Reference::new(&full.image, full.replicates),
    };
    if reference.is_black() {
        return Ok(Err("its picture is black: no error is relative to that".into()));
    }
    let mut tallies: Vec<Tally> = trials.iter().map(|_| Tally::default()).collect();
    let mut images: Vec<Option<Image>> = trials.iter().map(|_| None).collect();
    let mut failed = None;
    for round in 0..rounds {
        for ((trial, tally), image) in trials.iter().zip(&mut tallies).zip(&mut images) {
            if failed.is_some() && trial.way == Way::Beside {
                continue;
            }
            tell(&format!("{} {}", trial.knob, trial.value));
            let seed = seed.wrapping_add(u64::from(round));
            let outcome = match settings.beside.filter(|_| trial.way == Way::Beside) {
                Some(build) => {
                    let mut set = vec![("render.seed".to_owned(), seed.to_string())];
                    // Of frames the first, as here.
                    set.extend(chosen.description.frame.map(|n| ("render.frames".to_owned(), format!("\"{n}\""))));
                    match build.render(&entry.name, &desk.overrides, &set, Some(&reference)) {
                        Ok(outcome) => outcome,
                        // It costs its own row, and not those that are done.
                        Err(e) => {
                            failed = Some(e.to_string());
                            *image = None;
                            continue;
                        }
                    }
                }
                None => desk.render(trial, seed, Some(&reference))?,
            };
            if round == 0 {
                *image = Some(outcome.image.clone());
            }
            tally.add(outcome);
        }
    }
    if tallies[0].is_black() {
        return Ok(Err(format!(
            "{samples} samples a pixel of the chosen setting meet no light, of which the reference has some: their noise is unknown"
        )));
    }
    // All pictures are developed as the reference is: else a meter would hide what is lost.
    let finish = Finish::of(&chosen);
    let settings_of_png = develop::settings(&finish.output.png, finish.white, &full.image, ColourSpace::Rec709);
    let target = settings.target.unwrap_or(tallies[0].noise()[0]);
    let mut rows: Vec<Row> = Vec::new();
    for ((trial, tally), image) in trials.iter().zip(&tallies).zip(&images) {
        let Some(image) = image else { continue };
        let png = png::encode_png(image, &settings_of_png).map_err(Error::Render)?;
        rows.push(row(trial, tally, &tallies[0], &reference, target, png));
    }
    if settings.moves(knobs::FILE) {
        rows.push(row_of_file(&rows[0], images[0].as_ref(), target));
    }
    let advice = advice::sentences(&rows);
    let reference = settings.truth.is_none().then_some((more, reference.noise));
    let png = png::encode_png(&full.image, &settings_of_png).map_err(Error::Render)?;
    let bands = finish.bands;
    Ok(Ok(Sheet { scene: chosen.scene.name, size, target, reference, png, rows, advice, failed, bands }))
}

/// Width and height, pixels, of a copy of a picture with about so many `pixels`, and what is set for it.
fn small_copy(image: &description::Image, pixels: u32) -> ([u32; 2], Vec<(String, String)>) {
    let [width, height] = [image.width, image.height].map(f64::from);
    let scale = (f64::from(pixels) / (width * height)).sqrt().min(1.0);
    let size = [width, height].map(|side| (side * scale).round().max(side.min(8.0)) as u32);
    let mut set = vec![
        ("image.width".to_owned(), size[0].to_string()),
        ("image.height".to_owned(), size[1].to_string()),
        // What is beyond the frame has the share of the picture that it has.
        ("image.overscan".to_owned(), (f64::from(image.overscan) * scale).round().to_string()),
        ("render.stop".to_owned(), "{}".to_owned()),
    ];
    if image.crop.is_some() {
        set.push(("image.crop".to_owned(), "null".to_owned()));
    }
    (size, set)
}

/// The setting of the reference.
fn full_setting(samples: u32) -> Trial {
    let set = [
        ("render.samples", samples.to_string()),
        ("integrator.path.max_depth", "null".into()),
        ("render.techniques.merging", "off".into()),
    ];
    let set = set.map(|(key, value)| (key.to_owned(), value)).into();
    Trial { knob: "reference", value: String::new(), set, way: Way::AsSet }
}

/// relMSE of what has no noise and no bias, at most: sums in f32 and the inverse of a matrix are off by 1e-5.
const ROUNDING: f64 = 1e-10;

/// What more or less of a colour is worth a word.
const SHIFT: f64 = 0.005;

/// The reference has as many times the samples.
const REFERENCE: u32 = 16;

/// Its random numbers are others.
const SEED_OF_THE_REFERENCE: u64 = 0x7265_6665_7265_6e63;

/// relMSE of a file of half precision against `image`: the same samples, so nothing of it is noise. None where half precision
/// cannot hold it.
fn rounding(image: &Image) -> Option<f64> {
    if half_loses(&image.rgb.each_ref()).is_some() {
        return None;
    }
    let values = image.rgb.iter().flatten().map(|&x| (f64::from(x), f64::from(f16::from_f32(x).to_f32())));
    let floor = error::floor(image);
    let all: Moments = values.map(|(x, rounded)| (rounded - x).powi(2) / (x * x + floor)).collect();
    Some(all.mean)
}

/// The row of a file of half precision, of the `image` of the chosen setting. What half cannot hold is written in full.
fn row_of_file(chosen: &Row, image: Option<&Image>, target: f64) -> Row {
    let rounded = image.and_then(rounding);
    let value = rounded.map_or(knobs::FULL, |_| "half").into();
    let bias_squared = Figure { value: rounded.unwrap_or(0.0), error: 0.0 };
    let mut row = Row { knob: knobs::FILE, value, chosen: false, bias_squared, ..chosen.clone() };
    row.to_target = row.reaches(target, chosen.bias().unwrap_or(0.0));
    row
}

fn row(trial: &Trial, tally: &Tally, chosen: &Tally, reference: &Reference, target: f64, png: Vec<u8>) -> Row {
    let curve: Vec<Point> = tally.curve();
    let end = curve[curve.len() - 1];
    let cost = |tally: &Tally| {
        let Figure { value, error } = tally.noise_squared();
        // Of the least of a few times nobody knows the error: half of how far they lie apart, of two the whole, and of one
        // that is not known.
        let apart = tally.most_seconds() / tally.seconds() - 1.0;
        let time = match tally.rounds() {
            0 | 1 => f64::INFINITY,
            2 => apart,
            _ => 0.5 * apart,
        };
        (value * tally.seconds(), libm::hypot(error / value, time))
    };
    let ((own, own_error), (cost, error)) = (cost(chosen), cost(tally));
    let is_black = tally.is_black();
    let mut row = Row {
        knob: trial.knob,
        value: trial.value.clone(),
        chosen: trial.knob == knobs::CHOSEN,
        samples: end.samples,
        seconds: end.seconds,
        most_seconds: tally.most_seconds(),
        noise: if is_black { [f64::NAN; 3] } else { end.noise },
        converged: end.converged,
        bias_squared: tally.bias_squared(reference),
        light: tally.light(reference),
        efficiency: match own / cost {
            value if value.is_finite() && tally.noise_squared().value > ROUNDING => {
                Figure { value, error: value * libm::hypot(own_error, error) }
            }
            _ if is_black => Figure { value: f64::NAN, error: f64::NAN },
            // Without noise: nothing to weigh.
            _ => Figure { value: f64::INFINITY, error: 0.0 },
        },
        to_target: None,
        curve,
        png,
    };
    row.to_target = row.reaches(target, 0.0);
    row
}

impl Row {
    /// b of variance that falls as samples^−b from a quarter of the samples on, kept to what sampling does.
    #[must_use]
    pub fn exponent(&self) -> f64 {
        let Some(end) = self.curve.last().filter(|end| end.noise[0] > 0.0) else { return 1.0 };
        let before = self.curve.iter().rev().find(|p| p.samples <= end.samples / 4);
        before.map_or(1.0, |p| {
            let fallen = 2.0 * libm::log(p.noise[0] / end.noise[0]);
            (fallen / libm::log(f64::from(end.samples) / f64::from(p.samples))).clamp(1.0, 2.0)
        })
    }

    /// Seconds to an error of `target` beside a bias of `more` than its own; none where that is more than the target.
    fn reaches(&self, target: f64, more: f64) -> Option<f64> {
        let left = target * target - self.bias().unwrap_or(0.0).powi(2) - more * more;
        let samples = f64::from(self.samples);
        let fit = Fit::with_slope(samples, self.noise[0], self.exponent());
        (left > 0.0 && self.meets_light()).then(|| self.seconds * fit.samples_for(left.sqrt()) / samples)
    }

    /// Whether any light was met, so that there is noise to know.
    #[must_use]
    pub fn meets_light(&self) -> bool {
        !self.noise[0].is_nan()
    }

    /// √relMSE of the bias, where it stands out.
    #[must_use]
    pub fn bias(&self) -> Option<f64> {
        let Figure { value, error } = self.bias_squared;
        (value > SIGNIFICANT * error && value > ROUNDING).then(|| value.sqrt())
    }

    /// √relMSE that the bias is below, by as many standard errors as it takes to stand out.
    #[must_use]
    pub fn bias_bound(&self) -> f64 {
        (self.bias_squared.value.max(0.0) + SIGNIFICANT * self.bias_squared.error).sqrt()
    }

    /// Whether this cannot be told from `other` by its light: neither bias nor colours differ by what stands out and is half a per
    /// cent or more.
    #[must_use]
    fn finds_as(&self, other: &Row) -> bool {
        let near = |a: &Figure, b: &Figure, least: f64| {
            (a.value - b.value).abs() <= (SIGNIFICANT * libm::hypot(a.error, b.error)).max(least)
        };
        near(&self.bias_squared, &other.bias_squared, ROUNDING.max(2.0 * SHIFT * other.bias_squared.value))
            && self.light.iter().zip(&other.light).all(|(a, b)| near(a, b, SHIFT))
    }

    /// What is more or less of red, green and blue, where that stands out and is half a per cent or more.
    #[must_use]
    pub fn colour_shift(&self) -> Vec<(&'static str, f64)> {
        let all = ["red", "green", "blue"].into_iter().zip(&self.light);
        let stands_out = |f: &Figure| (f.value - 1.0).abs() > (SIGNIFICANT * f.error).max(SHIFT);
        all.filter(|(_, f)| stands_out(f)).map(|(name, f)| (name, f.value - 1.0)).collect()
    }
}
