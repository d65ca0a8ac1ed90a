//! What a render cost and how good it is: for `report.json`, the terminal and the EXR header.

use super::finish::Finish;
use super::forecast::{Fit, Forecast};
use super::frame::{self, Begun, Frame};
use super::{memory, names};
use crate::error::Error;
use crate::film::accumulate::{Film, InvalidCounts, PixelCells};
use crate::film::error::ErrorEstimate;
use crate::film::exr::header::read_headers;
use crate::film::heat::Small;
use crate::film::output;
use crate::scene::watch::Counts;
use crate::transport::plan::Effect;
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A batch.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Version of Abbe.
    pub version: &'static str,
    /// The batch or scene file.
    #[serde(serialize_with = "in_text")]
    pub source: PathBuf,
    /// Wall time of everything.
    pub seconds: f64,
    /// Threads that rendered.
    pub threads: usize,
    /// Bytes of memory that the process had at the most, where the system tells.
    pub peak_memory: Option<u64>,
    /// Each scene.
    pub scenes: Vec<SceneReport>,
    /// The page of the contact sheet.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "sheet_in_text")]
    pub contact_sheet: Option<PathBuf>,
    /// Where this report is written.
    #[serde(skip)]
    pub file: Option<PathBuf>,
    /// Why it is not written, where it could not be.
    #[serde(skip)]
    pub unwritten: Option<Error>,
    /// Why it may not be written where `--report` says, where it may not.
    #[serde(skip)]
    pub misplaced: Option<Error>,
}

/// How a scene ended.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// All files are written.
    Done,
    /// All files were there already, whole and of the same scene and settings.
    Skipped,
    /// It went wrong.
    Failed {
        /// The exit code that it calls for.
        exit_code: i32,
        /// What went wrong.
        message: String,
    },
}

/// Wall times in seconds.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Seconds {
    /// Reading and compiling the scene, and making its sums empty or what a checkpoint holds.
    pub loading: f64,
    /// Trials before the render, which choose techniques.
    pub trials: f64,
    /// Rendering.
    pub rendering: f64,
    /// Writing files.
    pub writing: f64,
}

/// The error after a number of samples.
#[derive(Clone, Debug, Serialize)]
pub struct ConvergencePoint {
    /// Samples of a pixel.
    pub samples: u32,
    /// Seconds since rendering began.
    pub seconds: f64,
    /// Relative RMSE.
    pub relative_error: f64,
    /// Ends of its 95 % interval.
    pub low: f64,
    /// See `low`.
    pub high: f64,
    /// Whether that could be believed.
    pub valid: bool,
}

/// How the PNG was developed, where that was not written down.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Developed {
    /// Stops.
    pub exposure_stops: f64,
    /// Whether the picture itself says how many.
    pub metered: bool,
    /// The chromaticity x, y that is shown white; none for that of the display, D65.
    pub white: Option<[f64; 2]>,
}

/// Samples of the pixels of a picture.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SampleCounts {
    /// The fewest.
    pub least: u64,
    /// In the mean.
    pub mean: f64,
    /// The most.
    pub most: u64,
}

impl SampleCounts {
    /// Those of `film`, dropped ones with them.
    fn of(film: &Film) -> SampleCounts {
        let of_pixel =
            |cells: &PixelCells| cells.iter().map(|cell| u64::from(cell.count) + u64::from(cell.dropped)).sum::<u64>();
        let (mut least, mut most, mut all) = (u64::MAX, 0, 0);
        for count in film.cells().iter().map(of_pixel) {
            (least, most, all) = (least.min(count), most.max(count), all + count);
        }
        SampleCounts { least, mean: all as f64 / film.cells().len().max(1) as f64, most }
    }

    /// As a header says them.
    #[must_use]
    pub fn words(&self) -> String {
        format!("least {}, mean {:.1}, most {}", self.least, self.mean, self.most)
    }

    /// What [`SampleCounts::words`] says.
    fn read(words: &str) -> Option<SampleCounts> {
        let (least, rest) = words.strip_prefix("least ")?.split_once(", mean ")?;
        let (mean, most) = rest.split_once(", most ")?;
        Some(SampleCounts { least: least.parse().ok()?, mean: mean.parse().ok()?, most: most.parse().ok()? })
    }
}

/// One scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneReport {
    /// Its name.
    pub name: String,
    /// Which frame of it, where it has frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<i32>,
    /// How it ended; what is said of one that was there already, its header says.
    pub status: Status,
    /// As the scene names it: `path`, `whitted`, `light_tracer`, `depth` or `none`.
    pub integrator: String,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Samples of a pixel.
    pub samples: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Hash of the scene: what was written and the files it names.
    pub scene_hash: String,
    /// Hash of the resolved picture before rounding to the file's precision: equal for equal pixels.
    pub pixel_hash: String,
    /// Wall times.
    pub seconds: Seconds,
    /// Million samples a second.
    pub msamples_per_second: f64,
    /// Samples of a pixel where they were shared out by noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<SampleCounts>,
    /// Relative RMSE of the picture with its 95 % interval; none for `whitted`, which has no noise.
    pub error: Option<ErrorEstimate>,
    /// How the PNG was developed.
    pub png: Option<Developed>,
    /// The error of its pixels, for the contact sheet.
    #[serde(skip)]
    pub error_map: Option<Small>,
    /// Further seconds of rendering that would halve the error.
    pub halving_seconds: Option<f64>,
    /// What was foretold at a quarter of the samples: to be held against `samples`, `seconds.rendering` and `error`.
    pub forecast: Option<Forecast>,
    /// How the error fell.
    pub convergence: Vec<ConvergencePoint>,
    /// Samples that were dropped, by cause.
    pub invalid: InvalidCounts,
    /// What robust arithmetic was needed for, where `--check-numerics` asked for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub numerics: Option<Counts>,
    /// Each effect, on or off, with its reason.
    #[serde(serialize_with = "shared")]
    pub effects: Arc<[Effect]>,
    /// How they were computed.
    #[serde(serialize_with = "shared")]
    pub techniques: Arc<[Effect]>,
    /// From which wavelengths samples were drawn.
    pub wavelengths: String,
    /// What a person should know.
    pub notes: Vec<String>,
    /// Files written, or there already.
    #[serde(serialize_with = "all_in_text")]
    pub files: Vec<PathBuf>,
    /// What is wrong with the picture although it is written, which its header tells.
    #[serde(skip)]
    pub fault: Option<String>,
}

/// Million samples a second.
fn msamples_per_second(samples: f64, seconds: f64) -> f64 {
    samples / seconds.max(1e-9) * 1e-6
}

/// What `serde` does for an [`Arc`] only with its feature `rc`.
fn shared<S: Serializer>(effects: &Arc<[Effect]>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(effects.iter())
}

/// A path in JSON, which knows text alone: what is no UTF-8 of a name becomes U+FFFD, as on the terminal.
///
/// # Errors
/// Those of `serializer`.
pub fn in_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

fn sheet_in_text<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(serializer)
}

fn all_in_text<S: Serializer>(paths: &[PathBuf], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.iter().map(|path| path.to_string_lossy()))
}

/// Copies what reports hold to one place. Effects and techniques, most of a report, are one for all in a row that have the
/// same. `before` is the report before the first.
///
/// Reports are made piece by piece beside scenes and films. A piece that stays cuts the room that these leave, and what is
/// made for the next scene, as large as that of the last, does not fit in again. Memory would grow by the bulk of a scene
/// for each piece.
pub fn gather(before: Option<&SceneReport>, reports: &mut [SceneReport]) {
    let mut copies: Vec<SceneReport> = Vec::with_capacity(reports.len());
    for report in &*reports {
        let last = copies.last().or(before);
        let copy = |own: &Arc<[Effect]>, last: Option<&Arc<[Effect]>>| match last {
            Some(last) if last == own => Arc::clone(last),
            _ => own.iter().cloned().collect(),
        };
        let effects = copy(&report.effects, last.map(|last| &last.effects));
        let techniques = copy(&report.techniques, last.map(|last| &last.techniques));
        copies.push(SceneReport { effects, techniques, ..report.clone() });
    }
    for (report, copy) in reports.iter_mut().zip(copies) {
        *report = copy;
    }
}

impl Report {
    /// Gathers the scenes.
    #[must_use]
    pub fn new(source: &Path, scenes: Vec<SceneReport>, elapsed: Duration) -> Report {
        Report {
            version: env!("CARGO_PKG_VERSION"),
            source: source.to_path_buf(),
            seconds: elapsed.as_secs_f64(),
            threads: rayon::current_num_threads(),
            peak_memory: memory::peak(),
            scenes,
            contact_sheet: None,
            file: None,
            unwritten: None,
            misplaced: None,
        }
    }

    /// Writes the report. Where not even a directory could be made, the scenes have said so.
    pub fn write(&mut self, file: &Path) {
        if !output::directory_of(file).is_dir() {
            return;
        }
        if self.copy_to(file) {
            self.file = Some(file.to_path_buf());
        }
    }

    /// Writes it to a further place. Whether that went well: the pictures are there, and a report that cannot be written is a failure of
    /// its own, which hides none of theirs.
    pub fn copy_to(&mut self, file: &Path) -> bool {
        let written = output::write_json(file, self);
        let is_there = written.is_ok();
        self.unwritten = written.err().or(self.unwritten.take());
        is_there
    }
}

impl SceneReport {
    /// A scene that has not been rendered.
    #[must_use]
    pub fn new(name: &str, frame: Option<i32>) -> SceneReport {
        SceneReport {
            name: name.to_owned(),
            frame,
            status: Status::Done,
            integrator: String::new(),
            resolution: [0, 0],
            samples: 0,
            seed: 0,
            scene_hash: String::new(),
            pixel_hash: String::new(),
            seconds: Seconds::default(),
            msamples_per_second: 0.0,
            adaptive: None,
            error: None,
            png: None,
            error_map: None,
            halving_seconds: None,
            forecast: None,
            convergence: Vec::new(),
            invalid: InvalidCounts::default(),
            numerics: None,
            effects: Arc::default(),
            techniques: Arc::default(),
            wavelengths: String::new(),
            notes: Vec::new(),
            files: Vec::new(),
            fault: None,
        }
    }

    /// What people call it.
    #[must_use]
    pub fn label(&self) -> String {
        names::label(&self.name, self.frame)
    }

    /// Notes what is to be rendered, and the time it took to read.
    pub fn describe(&mut self, finish: &Finish, loading: Duration) {
        self.notes.extend(finish.notes.iter().cloned());
        self.integrator.clone_from(&finish.integrator);
        self.resolution = finish.frame;
        self.samples = finish.samples;
        self.seed = finish.seed;
        self.scene_hash.clone_from(&finish.scene_hash);
        self.effects = finish.effects.as_slice().into();
        self.techniques = finish.techniques.as_slice().into();
        self.wavelengths.clone_from(&finish.wavelengths);
        self.seconds.loading = loading.as_secs_f64();
    }

    /// Notes what rendering gave.
    pub fn measure(&mut self, finish: &Finish, frame: &Frame, numerics: Option<Counts>) {
        let seconds = frame.elapsed.as_secs_f64();
        let (counted, dropped) = frame.film.samples();
        self.seconds.rendering = seconds;
        self.samples = frame.samples();
        self.msamples_per_second = msamples_per_second((counted + dropped) as f64, seconds);
        self.invalid = frame.invalid();
        self.adaptive = finish.adaptive.map(|_| SampleCounts::of(&frame.film));
        self.numerics = numerics;
        self.error = frame.milestones.last().and_then(|m| m.error);
        if let (Some(error), Some(fit)) = (&self.error, Fit::of(frame.course())) {
            let factor = fit.times_as_long(fit.samples_for(0.5 * error.rel_rmse));
            self.halving_seconds = Some(seconds * (factor - 1.0)).filter(|s| s.is_finite());
        }
        self.convergence = frame
            .milestones
            .iter()
            .filter_map(|m| {
                let e = m.error.as_ref()?;
                Some(ConvergencePoint {
                    samples: m.samples,
                    seconds: m.elapsed.as_secs_f64(),
                    relative_error: e.rel_rmse,
                    low: e.low,
                    high: e.high,
                    valid: e.valid,
                })
            })
            .collect();
        if let Some(why) = frame.milestones.last().and_then(|m| m.unknown) {
            self.notes.push(format!("the error cannot be estimated: {why}"));
        }
    }

    /// Notes what the header of a picture at `path` says, which was there already.
    pub fn recall(&mut self, finish: &Finish, path: &Path) {
        // It has just been read in full.
        let Ok(headers) = read_headers(path) else { return };
        let header = &headers.parts[0];
        self.samples = header.number("abbe/samples").map_or(self.samples, |samples| samples as u32);
        self.adaptive = header.text("abbe/adaptiveSamples").and_then(SampleCounts::read);
        let pixels = finish.window.pixels() as u64;
        if let Some(seconds) = header.number("abbe/renderSeconds") {
            let each = self.adaptive.map_or(f64::from(self.samples), |counts| counts.mean);
            self.seconds.rendering = seconds;
            self.msamples_per_second = msamples_per_second(each * pixels as f64, seconds);
        }
        self.pixel_hash = header.text("abbe/pixelHash").unwrap_or_default().to_owned();
        self.halving_seconds = header.number("abbe/secondsToHalveError");
        let causes: Vec<u64> = header
            .text("abbe/invalidByCause")
            .map_or_else(Vec::new, |text| text.split(' ').filter_map(|n| n.parse().ok()).collect());
        if let [nan, infinite, negative, overflow] = causes[..] {
            self.invalid = InvalidCounts { nan, infinite, negative, overflow };
        }
        let interval = header.text("abbe/relativeErrorInterval95").unwrap_or_default();
        let ends: Vec<f64> = interval.split(' ').filter_map(|end| end.parse().ok()).collect();
        if let (Some(rel_rmse), [low, high]) = (header.number("abbe/relativeError"), ends.as_slice()) {
            let valid = header.text("abbe/relativeErrorState") == Some("valid");
            self.error = Some(ErrorEstimate { rel_rmse, low: *low, high: *high, pixels, valid });
        }
    }

    /// Notes what rendering a part gave, whose error nobody knows.
    pub fn measure_part(&mut self, begun: &Begun, numerics: Option<Counts>) {
        let seconds = begun.elapsed.as_secs_f64();
        self.seconds.rendering = seconds;
        self.msamples_per_second = msamples_per_second(begun.part.progress().1 as f64, seconds);
        self.invalid = begun.part.look(frame::invalid);
        self.numerics = numerics;
    }

    /// Notes an error.
    pub fn fail(&mut self, e: &Error) {
        self.status = Status::Failed { exit_code: e.exit_code(), message: e.to_string() };
    }

    /// Whether it was asked to stop, and `--resume` goes on with it.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        matches!(self.status, Status::Failed { exit_code: 75, .. })
    }

    /// Whether its picture is written although samples were invalid or a target was out of reach.
    #[must_use]
    pub fn is_written_with_a_fault(&self) -> bool {
        matches!(self.status, Status::Failed { exit_code: 4, .. }) && !self.files.is_empty()
    }

    /// Names of the effects that are on.
    #[must_use]
    pub fn effects_in_force(&self) -> Vec<&str> {
        self.effects.iter().filter(|e| e.on).map(|e| e.name.as_ref()).collect()
    }
}
