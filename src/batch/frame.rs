//! One picture: work units, threads, passes.
//!
//! A work unit is a tile and a range of samples. Units run in any order on any thread; the film adds
//! integers, so the picture does not depend on it. Samples come in passes that double their number,
//! and after each pass the error so far is known.

use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::accumulate::{Film, Invalid, InvalidCounts, REPLICATES, TileBuffer};
use crate::film::filter::FilterSampler;
use crate::film::resolve::{self, ErrorEstimate};
use crate::scene::Scene;
use crate::spectrum::{ColourSpace, Lanes, observer};
use crate::transport::plan::{EffectPlan, Integrator};
use crate::transport::{self, PixelSample};
use rayon::prelude::*;
use std::cell::RefCell;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// What to render.
#[derive(Clone, Copy, Debug)]
pub struct FrameJob<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// What is simulated.
    pub plan: &'a EffectPlan,
    /// Reconstruction filter (for `path`).
    pub filter: &'a FilterSampler,
    /// The pixels to render.
    pub window: Window,
    /// Samples of a pixel.
    pub samples: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Side of a tile in pixels.
    pub tile: u32,
}

/// The error after a pass.
#[derive(Clone, Copy, Debug)]
pub struct Milestone {
    /// Samples of a pixel so far.
    pub samples: u32,
    /// Since the start.
    pub elapsed: Duration,
    /// The estimate, where replicates give one.
    pub error: Option<ErrorEstimate>,
}

/// A rendered picture.
#[derive(Debug)]
pub struct Frame {
    /// The sums.
    pub film: Film,
    /// Wall time of rendering alone.
    pub elapsed: Duration,
    /// The error after each pass.
    pub milestones: Vec<Milestone>,
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
}

/// Share of samples that may be invalid before the picture is refused: one in a million.
pub const INVALID_LIMIT: f64 = 1e-6;

/// The tiles that cover `window`, row by row, aligned to the frame so that a crop has the same ones.
#[must_use]
pub fn tiles(window: Window, side: u32) -> Vec<Window> {
    let side_i = i64::from(side);
    let starts = |start: i32, size: u32| -> Vec<(i32, u32)> {
        let (start, end) = (i64::from(start), i64::from(start) + i64::from(size));
        let mut all = Vec::new();
        let mut at = start;
        while at < end {
            let next = ((at.div_euclid(side_i) + 1) * side_i).min(end);
            all.push((at as i32, (next - at) as u32));
            at = next;
        }
        all
    };
    let columns = starts(window.x, window.width);
    starts(window.y, window.height)
        .into_iter()
        .flat_map(|(y, height)| columns.iter().map(move |&(x, width)| Window { x, y, width, height }))
        .collect()
}

/// Sample ranges of the passes: 4, 8, 16, … up to `samples`.
#[must_use]
pub fn passes(samples: u32) -> Vec<Range<u32>> {
    let mut all = Vec::new();
    let mut start = 0;
    let mut end = REPLICATES as u32;
    while start < samples {
        all.push(start..end.min(samples));
        start = end.min(samples);
        end = end.saturating_mul(2);
    }
    all
}

/// Renders one work unit into `tile`.
pub fn render_unit(job: &FrameJob, samples: Range<u32>, tile: &mut TileBuffer) {
    let window = tile.window();
    let layers = tile.layers.channels() > 0;
    let mut values = Vec::new();
    for y in window.y..window.y + window.height as i32 {
        for x in window.x..window.x + window.width as i32 {
            // Overscan makes negative coordinates; as addresses they wrap.
            let pixel = [x as u32, y as u32];
            for s in samples.clone() {
                let replicate = s % REPLICATES as u32;
                let index = s / REPLICATES as u32;
                let FrameJob { scene, plan, filter, seed, .. } = *job;
                if layers {
                    let sample =
                        transport::sample_with_layers(scene, plan, filter, seed, pixel, replicate, index, &mut values);
                    let at = ((y - window.y) * window.width as i32 + (x - window.x)) as usize;
                    tile.layers.add(at, sample.weight, &values);
                    record(tile, [x, y], replicate, &sample);
                } else {
                    let sample = transport::sample(scene, plan, filter, seed, pixel, replicate, index);
                    record(tile, [x, y], replicate, &sample);
                }
            }
        }
    }
}

fn record(tile: &mut TileBuffer, pixel: [i32; 2], replicate: u32, sample: &PixelSample) {
    let r = sample.radiance;
    let light = r.simd_ge(Lanes::ZERO) & r.simd_le(Lanes::splat(f32::MAX));
    if !light.all() {
        tile.drop_sample(pixel, replicate as usize, cause(r));
        return;
    }
    let xyz = observer::xyz(r, &sample.wavelengths).map(|x| x * sample.weight);
    tile.add(pixel, replicate as usize, xyz, sample.alpha * sample.weight);
}

/// What is wrong with a radiance that has a lane light cannot have.
fn cause(r: Lanes) -> Invalid {
    let lanes = r.to_array();
    if lanes.iter().any(|x| x.is_nan()) {
        Invalid::Nan
    } else if lanes.iter().any(|x| x.is_infinite()) {
        Invalid::Infinite
    } else {
        Invalid::Negative
    }
}

/// Renders the picture on the threads of the current rayon pool. `watch` hears of progress now and
/// then, from any thread; `stop` ends the render at the next unit.
///
/// # Errors
/// [`Error::Render`] if more than [`INVALID_LIMIT`] of the samples were invalid, or the memory cannot be
/// had, or the render was stopped.
pub fn render(job: &FrameJob, watch: &(dyn Fn(Progress) + Sync), stop: &AtomicBool) -> Result<Frame> {
    thread_local! {
        static TILE: RefCell<Option<TileBuffer>> = const { RefCell::new(None) };
    }
    let start = Instant::now();
    let layers = job.plan.layers.channels().len();
    let film = Mutex::new(Film::new(job.scene.camera.resolution, job.window)?.with_layers(layers));
    let total = job.window.pixels() as u64 * u64::from(job.samples);
    let done = AtomicU64::new(0);
    let mut milestones: Vec<Milestone> = Vec::new();
    let tiles = tiles(job.window, job.tile);
    let random = !matches!(job.plan.integrator, Integrator::Whitted(_));

    for pass in passes(job.samples) {
        let latest = milestones.last().and_then(|m| m.error);
        tiles.par_iter().for_each(|&window| {
            if stop.load(Ordering::Relaxed) {
                return;
            }
            TILE.with_borrow_mut(|slot| {
                let tile = slot.get_or_insert_with(|| TileBuffer::new(window));
                tile.reset(window, layers);
                render_unit(job, pass.clone(), tile);
                film.lock().unwrap_or_else(std::sync::PoisonError::into_inner).merge_tile(tile);
            });
            let unit = window.pixels() as u64 * pass.len() as u64;
            let done = done.fetch_add(unit, Ordering::Relaxed) + unit;
            watch(Progress { done, total, elapsed: start.elapsed(), error: latest });
        });
        if stop.load(Ordering::Relaxed) {
            return Err(Error::Render("stopped before the picture was finished; nothing was written".into()));
        }
        let film = film.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let error = if random {
            resolve::resolve(&film, None, &ColourSpace::Rec709.matrix_from_xyz()).relative_error().ok()
        } else {
            None
        };
        milestones.push(Milestone { samples: pass.end, elapsed: start.elapsed(), error });
    }
    let film = film.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    Ok(Frame { film, elapsed: start.elapsed(), milestones })
}

/// An error where too many samples were invalid to trust the picture.
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
        assert_eq!(passes(1), vec![0..1; 1]);
        assert_eq!(passes(4), vec![0..4; 1]);
        assert_eq!(passes(21), [0..4, 4..8, 8..16, 16..21]);
    }

    #[test]
    fn tiles_cover_a_crop_once_and_are_those_of_the_frame() {
        let window = Window { x: -5, y: 30, width: 70, height: 40 };
        let all = tiles(window, 32);
        assert_eq!(all.iter().map(Window::pixels).sum::<usize>(), window.pixels());
        assert!(all.iter().all(|t| window.contains(t)));
        assert!(all.contains(&Window { x: 0, y: 32, width: 32, height: 32 }));
    }
}
