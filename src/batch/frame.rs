//! One picture: work units, threads, passes.
//!
//! A work unit is a tile and a range of samples. Units run in any order on any thread; the film adds
//! integers, so the picture does not depend on it. Samples come in passes that double their number,
//! and after each pass the error so far is known.

use super::finish::Sharing;
use super::forecast::{Course, Forecast};
use super::outlook::Outlook;
use super::part::{Breaks, Part, Share, SplatFilm};
use super::stop::Stop;
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::accumulate::{Film, InvalidCounts, REPLICATES};
use crate::film::error::{self, ErrorEstimate, NoEstimate, Values};
use crate::film::filter::FilterSampler;
use crate::film::resolve::{self, Image, Splats};
use crate::film::sharing;
use crate::scene::Scene;
use crate::spectrum::ColourSpace;
use crate::transport::plan::EffectPlan;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// What to render.
#[derive(Clone, Copy, Debug)]
pub struct FrameJob<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The same one frame later, where it is known.
    pub next: Option<&'a Scene>,
    /// What is simulated.
    pub plan: &'a EffectPlan,
    /// The scene while the shutter is open, of which each sample sees one; none where nothing is blurred.
    pub moments: &'a [Scene],
    /// Reconstruction filter (for `path`).
    pub filter: &'a FilterSampler,
    /// The pixels to render.
    pub window: Window,
    /// Samples of a pixel; the most of them, where `stop` has other targets.
    pub samples: u32,
    /// Samples of a pixel for which techniques are planned.
    pub planned: u32,
    /// What else ends the render.
    pub stop: Stop,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Side of a tile in pixels.
    pub tile: u32,
    /// Whether samples have nothing in common, in place of being spread evenly: to see what that gains.
    pub independent: bool,
    /// How the error is told.
    pub gauge: Gauge,
}

/// What there is to know of a picture whose error is told.
#[derive(Clone, Copy, Debug)]
pub struct Gauge {
    /// Whether samples differ by chance, so that there is noise.
    pub random: bool,
    /// Whether anything shines.
    pub lit: bool,
    /// How many bands of the spectrum it holds in place of colours.
    pub bands: usize,
    /// Which pixels share their errors.
    pub sharing: Sharing,
}

/// The error after a pass.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Milestone {
    /// Samples of a pixel so far.
    pub samples: u32,
    /// Since the start.
    pub elapsed: Duration,
    /// The estimate, where replicates give one.
    pub error: Option<ErrorEstimate>,
    /// Why they give none, where samples are random.
    #[serde(default)]
    pub unknown: Option<NoEstimate>,
}

/// A rendered picture.
#[derive(Debug)]
pub struct Frame {
    /// The sums.
    pub film: Film,
    /// What paths from the lights added.
    pub splats: Option<SplatFilm>,
    /// Wall time of rendering alone.
    pub elapsed: Duration,
    /// The error after each pass.
    pub milestones: Vec<Milestone>,
    /// What sharing out does, where samples are shared out.
    outlook: Option<Outlook>,
    /// The picture from which the last error was estimated, and its colour space.
    resolved: Option<Resolved>,
}

/// How far a frame is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Samples of all pixels done.
    pub done: u64,
    /// Samples of all pixels to do.
    pub total: u64,
    /// Since the start.
    pub elapsed: Duration,
    /// The latest milestone's error.
    pub error: Option<ErrorEstimate>,
    /// Where the render will end, from the latest milestone.
    pub forecast: Option<Forecast>,
    /// The error at which it is to end.
    pub target: Option<f64>,
}

impl Frame {
    /// The frame of `samples` of each pixel that were added up elsewhere in `elapsed`, whose error `gauge` tells.
    #[must_use]
    pub fn of(film: Film, splats: Option<SplatFilm>, samples: u32, elapsed: Duration, gauge: &Gauge) -> Frame {
        let Estimate { error, unknown, resolved } = estimate(&film, splats.as_ref(), gauge);
        let milestones = vec![Milestone { samples, elapsed, error, unknown }];
        Frame { film, splats, elapsed, milestones, outlook: None, resolved }
    }

    /// Samples of a pixel.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.milestones.last().map_or(0, |m| m.samples)
    }

    /// How it has come.
    #[must_use]
    pub fn course(&self) -> Course<'_> {
        Course { milestones: &self.milestones, outlook: self.outlook.as_ref() }
    }

    /// The picture in the colour space of `rgb_from_xyz`.
    #[must_use]
    pub fn resolve(&self, rgb_from_xyz: &[[f64; 3]; 3]) -> Image {
        if let Some((_, image)) = self.resolved.as_ref().filter(|(space, _)| space == rgb_from_xyz) {
            return image.clone();
        }
        let splats = self.splats.as_ref().map(SplatFilm::splats);
        resolve::resolve(&self.film, splats, rgb_from_xyz)
    }

    /// The error of the further channels `bands`, which are bands that are summed by replicate, told as `gauge` tells that of the
    /// picture.
    #[must_use]
    pub fn error_of_bands(&self, bands: Range<usize>, gauge: &Gauge) -> Option<ErrorEstimate> {
        let splats = self.splats.as_ref().map(SplatFilm::splats);
        let values = Values::Bands(bands.start, bands.len());
        if gauge.random { told(&self.film, splats, values, gauge).ok() } else { None }
    }

    /// How many times the variance of the sum of all pixels of `image` is that of independent ones, at the most.
    #[must_use]
    pub fn shared_errors(&self, image: &Image, rgb_from_xyz: &[[f64; 3]; 3], sharing: Sharing) -> f64 {
        let errors = image.standard_error.each_ref().map(Vec::as_slice);
        self.shared(Values::Colours(rgb_from_xyz, image), &errors, sharing)
    }

    /// The same of the further channels from `first` on, bands that are summed by replicate, whose standard errors are `errors`.
    #[must_use]
    pub fn shared_errors_of_bands(&self, first: usize, errors: &[Vec<f32>], sharing: Sharing) -> f64 {
        let errors: Vec<&[f32]> = errors.iter().map(Vec::as_slice).collect();
        self.shared(Values::Bands(first, errors.len()), &errors, sharing)
    }

    fn shared(&self, values: Values, errors: &[&[f32]], sharing: Sharing) -> f64 {
        if errors.is_empty() {
            return 1.0;
        }
        let splats = self.splats.as_ref().map(SplatFilm::splats);
        let in_cells = |cell| sharing::in_cells(&self.film, splats.as_ref(), values, errors, cell);
        match sharing {
            Sharing::All => in_cells(None),
            Sharing::Near { span, cell, .. } => {
                let by_filter = splats.map_or(1.0, |splats| sharing::by_filter(&splats, values, errors, span));
                let by_paths = if cell > 1 { in_cells(Some(cell)) } else { 1.0 };
                by_filter + by_paths - 1.0
            }
        }
    }

    /// The further channel `channel` where its values stand once, not samples.
    #[must_use]
    pub fn layer_once(&self, channel: usize) -> Vec<f32> {
        self.film.layers.once(channel)
    }

    /// The further channel `channel`, its mean over samples; bands and light by its ways come first.
    #[must_use]
    pub fn layer(&self, channel: usize) -> Vec<f32> {
        resolve::layer(&self.film, self.splats.as_ref().map(SplatFilm::splats).as_ref(), channel)
    }

    /// The standard errors of [`Frame::layer`], where sums are kept by replicate; else NaN.
    #[must_use]
    pub fn layer_error(&self, channel: usize) -> Vec<f32> {
        let mut variances: Vec<f64> = self.film.layers.variances_of(channel, None);
        if let Some(splats) = self.splats.as_ref().filter(|s| channel < s.film.layers.channels()) {
            // Two independent estimates of two parts of the light: variances add.
            let light = splats.film.layers.variances_of(channel, Some(splats.paths));
            variances.iter_mut().zip(light).for_each(|(all, own)| *all += own);
        }
        variances.into_iter().map(|v| v.sqrt() as f32).collect()
    }

    /// Samples that were dropped.
    #[must_use]
    pub fn invalid(&self) -> InvalidCounts {
        invalid(&self.film, self.splats.as_ref())
    }
}

/// Samples that were dropped on both films.
#[must_use]
pub fn invalid(film: &Film, splats: Option<&SplatFilm>) -> InvalidCounts {
    let mut all = film.invalid;
    if let Some(splats) = splats {
        all += splats.film.invalid;
    }
    all
}

/// Share of samples that may be invalid before the picture is refused: one in a million.
pub const INVALID_LIMIT: f64 = 1e-6;

/// The samples at which the pass ends that begins at sample `at`, of at most `most`: 4, 8, 16, …
#[must_use]
pub fn pass_end(at: u32, most: u32) -> u32 {
    let doublings = std::iter::successors(Some(REPLICATES as u32), |end| end.checked_mul(2));
    doublings.into_iter().find(|end| *end > at).unwrap_or(most).min(most)
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// A picture that has been begun.
#[derive(Debug)]
pub struct Begun<'a> {
    /// The sums so far.
    pub part: Part<'a>,
    /// The error after each pass so far.
    pub milestones: Vec<Milestone>,
    /// Wall time so far.
    pub elapsed: Duration,
    /// The picture from which the last error was estimated.
    resolved: Option<Resolved>,
}

impl<'a> Begun<'a> {
    /// Nothing yet of `share`.
    ///
    /// # Errors
    /// As [`Part::new`].
    pub fn new(job: &'a FrameJob<'a>, share: Share) -> Result<Begun<'a>> {
        Ok(Begun::from(Part::new(job, share)?, Vec::new(), Duration::ZERO))
    }

    /// A picture whose first samples are in `part`.
    #[must_use]
    pub fn from(part: Part<'a>, milestones: Vec<Milestone>, elapsed: Duration) -> Begun<'a> {
        Begun { part, milestones, elapsed, resolved: None }
    }

    /// The picture, when all is done.
    #[must_use]
    pub fn finish(self) -> Frame {
        let outlook = self.part.outlook().cloned();
        let (film, splats) = self.part.finish();
        let Begun { elapsed, milestones, resolved, .. } = self;
        Frame { film, splats, elapsed, milestones, outlook, resolved }
    }
}

/// Renders the picture on the threads of the current rayon pool. `watch` hears of progress now and
/// then, from any thread; `breaks` may end the render between two units.
///
/// # Errors
/// [`Error::Memory`] if the memory cannot be had, or what `breaks` says.
pub fn render(job: &FrameJob, watch: &(dyn Fn(Progress) + Sync), breaks: &dyn Breaks) -> Result<Frame> {
    Ok(go_on(Begun::new(job, Share::all(job.samples))?, watch, breaks)?.finish())
}

/// Renders what is left of a picture or of a part of one. After each pass of a picture the error is estimated; a part
/// cannot know.
///
/// # Errors
/// As [`render`].
pub fn go_on<'a>(mut begun: Begun<'a>, watch: &(dyn Fn(Progress) + Sync), breaks: &dyn Breaks) -> Result<Begun<'a>> {
    let before = begun.elapsed;
    let start = Instant::now();
    let part = &begun.part;
    let done = AtomicU64::new(part.progress().0);
    let job = part.job();
    let whole = part.share().is_all(job.samples);

    let Range { start: first, end: most } = part.share().samples;
    loop {
        let milestones = &begun.milestones;
        let at = milestones.last().map_or(first, |m| m.samples);
        let ends = at >= most || job.stop.reached(milestones);
        if whole && !ends && job.plan.adaptive.is_some_and(|adaptive| at >= adaptive.first) {
            while !part.share_out(breaks) {
                breaks.take(part, milestones, before + start.elapsed())?;
            }
        }
        let course = course(part, milestones);
        let end = match job.stop.is_open() {
            _ if ends => at,
            true => job.stop.pass_end(course, most).unwrap_or(at),
            false => pass_end(at, most),
        };
        // What a checkpoint holds beyond is kept.
        let pass = at..end.max(part.reached());
        if pass.is_empty() {
            break;
        }
        let latest = milestones.last().and_then(|m| m.error);
        let forecast = Forecast::of(course, &job.stop, most).filter(|_| whole);
        let total = samples_in_all(part, milestones);
        let finished = |unit| {
            let done = done.fetch_add(unit, Ordering::Relaxed) + unit;
            let total = total.max(done);
            let target = job.stop.error;
            watch(Progress { done, total, elapsed: before + start.elapsed(), error: latest, forecast, target });
        };
        while !part.add(pass.clone(), breaks, &finished) {
            breaks.take(part, &begun.milestones, before + start.elapsed())?;
        }
        let Estimate { error, unknown, resolved } = match whole {
            true => part.look(|film, splats| estimate(film, splats, &job.gauge)),
            false => Estimate::default(),
        };
        begun.resolved = resolved;
        begun.milestones.push(Milestone { samples: pass.end, elapsed: before + start.elapsed(), error, unknown });
    }
    begun.elapsed = before + start.elapsed();
    Ok(begun)
}

/// How `part` has come to `milestones`.
fn course<'a>(part: &'a Part, milestones: &'a [Milestone]) -> Course<'a> {
    Course { milestones, outlook: part.outlook() }
}

/// Samples of pixels that `part` will have at its end, as far as `milestones` foretell that.
#[must_use]
pub fn samples_in_all(part: &Part, milestones: &[Milestone]) -> u64 {
    let job = part.job();
    match job.stop.is_open() {
        true => {
            (job.stop.foreseen(course(part, milestones), part.share().samples.end) * job.window.pixels() as f64) as u64
        }
        false => part.progress().1,
    }
}

/// A picture and the matrix from XYZ to its colours.
type Resolved = ([[f64; 3]; 3], Image);

/// What the replicates tell of a picture; nothing where they do not differ by chance.
#[derive(Default)]
struct Estimate {
    /// Its error, where they tell one; it is known where nothing shines.
    error: Option<ErrorEstimate>,
    /// Why they tell none.
    unknown: Option<NoEstimate>,
    /// The picture.
    resolved: Option<Resolved>,
}

fn estimate(film: &Film, splats: Option<&SplatFilm>, gauge: &Gauge) -> Estimate {
    if !gauge.random {
        return Estimate::default();
    }
    let photons = splats.map(SplatFilm::splats);
    let space = ColourSpace::Rec709.matrix_from_xyz();
    let image = resolve::resolve(film, photons, &space);
    let values = match gauge.bands {
        0 => Values::Colours(&space, &image),
        bands => Values::Bands(0, bands),
    };
    let (error, unknown) = match told(film, photons, values, gauge) {
        Ok(error) => (Some(error), None),
        Err(why) => (None, Some(why)),
    };
    Estimate { error, unknown, resolved: Some((space, image)) }
}

/// Whether the interval of the error of `image`, the picture in the colours of `space`, can be believed.
pub(super) fn converged(
    film: &Film,
    splats: Option<&SplatFilm>,
    space: &[[f64; 3]; 3],
    image: &Image,
    gauge: &Gauge,
) -> bool {
    let values = Values::Colours(space, image);
    told(film, splats.map(SplatFilm::splats), values, gauge).is_ok_and(|error| error.valid)
}

/// The error of `values`, where replicates tell one; it is known where nothing shines.
fn told(
    film: &Film,
    splats: Option<Splats>,
    values: Values,
    gauge: &Gauge,
) -> std::result::Result<ErrorEstimate, NoEstimate> {
    let (overlap, cell) = match gauge.sharing {
        Sharing::Near { overlap, cell, .. } => (overlap, Some(cell)),
        Sharing::All => (1.0, None),
    };
    match error::relative_error(film, splats, values, overlap, cell) {
        Err(NoEstimate::Black) if !gauge.lit => Ok(ErrorEstimate::none(film.window().pixels() as u64)),
        found => found,
    }
}

/// An error where too many of the `samples`, among which paths from the lights are counted, were invalid to trust the picture.
///
/// # Errors
/// [`Error::Render`] with the counts by cause.
pub fn check_invalid(invalid: &InvalidCounts, samples: u64) -> Result<()> {
    let share = invalid.total() as f64 / samples.max(1) as f64;
    if share <= INVALID_LIMIT {
        return Ok(());
    }
    Err(Error::Render(format!(
        "{} of {samples} samples were invalid ({} NaN, {} infinite, {} negative, {} too large): more than the limit of \
         one in a million",
        invalid.total(),
        invalid.nan,
        invalid.infinite,
        invalid.negative,
        invalid.overflow
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_double_and_cover_every_sample_once() {
        let ends = |mut at: u32, most: u32| {
            let mut ends = Vec::new();
            while at < most {
                at = pass_end(at, most);
                ends.push(at);
            }
            ends
        };
        assert_eq!(ends(0, 1), [1]);
        assert_eq!(ends(0, 4), [4]);
        assert_eq!(ends(0, 21), [4, 8, 16, 21]);
        assert_eq!(ends(5, 21), [8, 16, 21]);
        assert_eq!(ends(16, 21), [21]);
        assert_eq!(ends(1 << 31, u32::MAX), [u32::MAX]);
    }
}
