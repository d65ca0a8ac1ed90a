//! One picture: work units, threads, passes.
//!
//! A work unit is a tile and a range of samples. Units run in any order on any thread; the film adds
//! integers, so the picture does not depend on it. Samples come in passes that double their number,
//! and after each pass the error so far is known.

use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::accumulate::{Film, Invalid, InvalidCounts, REPLICATES, TileBuffer};
use crate::film::filter::FilterSampler;
use crate::film::resolve::{self, ErrorEstimate, Image, Splats};
use crate::film::run::{LONGEST, LayerRun, Run};
use crate::math::sampler::Octet;
use crate::scene::Scene;
use crate::spectrum::{ColourSpace, LANES, SampledWavelengths};
use crate::transport::light::{Bounds, LightPaths, Splat};
use crate::transport::merge::{self, Collection, Photon, PhotonMap, WavelengthCell};
use crate::transport::plan::{EffectPlan, Integrator};
use crate::transport::{self, PixelSample, Samples, Shot};
use glam::DVec2;
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

/// Light that came from the lights to the camera.
#[derive(Debug)]
pub struct SplatFilm {
    /// The sums, and of the bands of the spectrum.
    pub film: Film,
    /// Paths that began in each replicate.
    pub paths: [u64; REPLICATES],
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
    /// The picture from which the last error was estimated, and its colour space.
    resolved: Option<([[f64; 3]; 3], Image)>,
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

impl Frame {
    /// The picture in the colour space of `rgb_from_xyz`.
    #[must_use]
    pub fn resolve(&self, rgb_from_xyz: &[[f64; 3]; 3]) -> Image {
        if let Some((_, image)) = self.resolved.as_ref().filter(|(space, _)| space == rgb_from_xyz) {
            return image.clone();
        }
        let splats = self.splats.as_ref().map(|s| Splats { film: &s.film, photons: s.paths });
        resolve::resolve(&self.film, splats, rgb_from_xyz)
    }

    /// The further channel `channel`; bands come first.
    #[must_use]
    pub fn layer(&self, channel: usize) -> Vec<f32> {
        let mut plane = self.film.layers.plane(channel);
        if let Some(splats) = self.splats.as_ref().filter(|s| channel < s.film.layers.channels()) {
            let paths: u64 = splats.paths.iter().sum();
            for (x, sum) in plane.iter_mut().zip(splats.film.layers.sums_of(channel)) {
                *x += (sum / paths.max(1) as f64) as f32;
            }
        }
        plane
    }

    /// Samples that were dropped.
    #[must_use]
    pub fn invalid(&self) -> InvalidCounts {
        let mut all = self.film.invalid;
        if let Some(splats) = &self.splats {
            all += splats.film.invalid;
        }
        all
    }
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

/// Tiles of at most `side` pixels, halved until every thread has 32 or they are 4 pixels wide: a
/// small picture keeps all threads busy to its end. How it is cut changes no bit of it.
fn shares(window: Window, side: u32, threads: usize) -> Vec<Window> {
    let halves = std::iter::successors(Some(side), |side| (*side >= 8).then_some(side / 2));
    let cuts = halves.map(|side| tiles(window, side));
    let mut last = Vec::new();
    for cut in cuts {
        last = cut;
        if last.len() >= 32 * threads {
            break;
        }
    }
    last
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
fn render_unit(job: &FrameJob, samples: Range<u32>, photons: Option<Collection>, tile: &mut TileBuffer) {
    let FrameJob { scene, plan, filter, seed, .. } = *job;
    let shot = Shot { scene, plan, filter, seed, photons };
    let window = tile.window();
    let mut memory = Samples::default();
    let mut layers = LayerRun::default();
    for y in window.y..window.y + window.height as i32 {
        for x in window.x..window.x + window.width as i32 {
            for replicate in 0..REPLICATES as u32 {
                // Samples take turns among the replicates.
                let turns = |s: u32| s.saturating_sub(replicate).div_ceil(REPLICATES as u32);
                let (mut start, end) = (turns(samples.start), turns(samples.end));
                while start < end {
                    let next = (start - start % Octet::SAMPLES).saturating_add(LONGEST).min(end);
                    render_run(&shot, tile, &mut memory, &mut layers, [x, y], replicate, start..next);
                    start = next;
                }
            }
        }
    }
}

/// Renders samples of one replicate of `pixel`, at most [`LONGEST`].
fn render_run(
    shot: &Shot,
    tile: &mut TileBuffer,
    memory: &mut Samples,
    layers: &mut LayerRun,
    pixel: [i32; 2],
    replicate: u32,
    indices: Range<u32>,
) {
    let index = tile.window().index(pixel).expect("the pixel lies in the tile");
    let channels = tile.layers.channels();
    let unit = light_unit(shot.scene);
    let mut run = Run::default();
    layers.reset(channels);
    // Overscan makes negative coordinates; as addresses they wrap.
    let address = pixel.map(|x| x as u32);
    let mut start = indices.start;
    while start < indices.end {
        let next = (start - start % Octet::SAMPLES).saturating_add(Octet::SAMPLES).min(indices.end);
        memory.render(shot, address, replicate, start..next, |sample, values| {
            if channels > 0 && !layers.add(sample.weight, values) {
                tile.layers.add(index, sample.weight, values);
            }
            record(tile, &mut run, unit, pixel, replicate, sample);
        });
        start = next;
    }
    tile.add_run(pixel, replicate as usize, &run);
    if channels > 0 {
        tile.layers.add_run(index, layers);
    }
}

#[inline]
fn record(tile: &mut TileBuffer, run: &mut Run, unit: f32, pixel: [i32; 2], replicate: u32, sample: &PixelSample) {
    if let Some(cause) = Invalid::of(sample.radiance) {
        tile.drop_sample(pixel, replicate as usize, cause);
        return;
    }
    let xyz = sample.xyz.map(|x| x * unit * sample.weight);
    let alpha = sample.alpha * sample.weight;
    if !run.add(xyz, alpha) {
        tile.add(pixel, replicate as usize, xyz, alpha);
    }
}

/// What light is multiplied by on its way to the film; a power of two.
fn light_unit(scene: &Scene) -> f32 {
    f32::from_bits(((127 - scene.light_exponent) as u32) << 23)
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Renders some of the samples of a picture, with their paths from the lights. What any split of the samples adds up to
/// is the whole picture, bit for bit.
///
/// # Errors
/// [`Error::Render`] if the memory cannot be had.
pub fn render_part(job: &FrameJob, samples: Range<u32>) -> Result<(Film, Option<SplatFilm>)> {
    let part = Part::new(job)?;
    part.add(samples, &AtomicBool::new(false), &|_| {});
    Ok(part.finish())
}

/// The sums of a picture on the way.
struct Part<'a> {
    job: &'a FrameJob<'a>,
    film: Mutex<Film>,
    splats: Option<(LightPaths<'a>, Mutex<SplatFilm>)>,
    tiles: Vec<Window>,
    layers: usize,
}

impl<'a> Part<'a> {
    fn new(job: &'a FrameJob<'a>) -> Result<Part<'a>> {
        let layers = job.plan.layers.channels().len();
        let exponent = job.scene.light_exponent;
        let film = |layers| {
            let film = Film::new(job.scene.camera.resolution, job.window)?;
            Ok(film.with_layers(layers).with_exponent(exponent))
        };
        let splats = match light_paths(job) {
            Some(paths) => {
                let film = film(job.scene.bands.len())?;
                Some((paths, Mutex::new(SplatFilm { film, paths: [0; REPLICATES] })))
            }
            None => None,
        };
        let tiles = shares(job.window, job.tile, rayon::current_num_threads());
        Ok(Part { job, film: Mutex::new(film(layers)?), splats, tiles, layers })
    }

    /// Adds `samples` of all pixels; `finished` hears how many were done with each tile.
    fn add(&self, samples: Range<u32>, stop: &AtomicBool, finished: &(dyn Fn(u64) + Sync)) {
        let merging = self.job.plan.caustics.as_ref().and_then(|c| c.merging);
        let (Some(first), Some((paths, splats))) = (merging, &self.splats) else {
            if let Some((paths, splats)) = &self.splats {
                from_lights(self.job, paths, samples.clone(), splats, stop, None);
            }
            self.add_tiles(samples, None, stop, finished);
            return;
        };
        // Photons are collected sample by sample.
        for sample in samples {
            let (map, wavelength) = from_lights_for(self.job, paths, sample, first, splats, stop);
            self.add_tiles(sample..sample + 1, Some(Collection { map: &map, wavelength }), stop, finished);
        }
    }

    fn add_tiles(
        &self,
        samples: Range<u32>,
        photons: Option<Collection>,
        stop: &AtomicBool,
        finished: &(dyn Fn(u64) + Sync),
    ) {
        thread_local! {
            static TILE: RefCell<Option<TileBuffer>> = const { RefCell::new(None) };
        }
        self.tiles.par_iter().for_each(|&window| {
            if stop.load(Ordering::Relaxed) {
                return;
            }
            TILE.with_borrow_mut(|slot| {
                let tile = slot.get_or_insert_with(|| TileBuffer::new(window));
                tile.reset(window, self.layers);
                render_unit(self.job, samples.clone(), photons, tile);
                lock(&self.film).merge_tile(tile);
            });
            finished(window.pixels() as u64 * samples.len() as u64);
        });
    }

    fn finish(self) -> (Film, Option<SplatFilm>) {
        let film = self.film.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        let splats = self.splats.map(|(_, s)| s.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner));
        (film, splats)
    }
}

/// Renders the picture on the threads of the current rayon pool. `watch` hears of progress now and
/// then, from any thread; `stop` ends the render at the next unit.
///
/// # Errors
/// [`Error::Render`] if more than [`INVALID_LIMIT`] of the samples were invalid, or the memory cannot be
/// had, or the render was stopped.
pub fn render(job: &FrameJob, watch: &(dyn Fn(Progress) + Sync), stop: &AtomicBool) -> Result<Frame> {
    let start = Instant::now();
    let part = Part::new(job)?;
    let total = job.window.pixels() as u64 * u64::from(job.samples);
    let done = AtomicU64::new(0);
    let mut milestones: Vec<Milestone> = Vec::new();
    let mut resolved = None;
    let random = !matches!(job.plan.integrator, Integrator::Whitted(_));

    for pass in passes(job.samples) {
        let latest = milestones.last().and_then(|m| m.error);
        part.add(pass.clone(), stop, &|unit| {
            let done = done.fetch_add(unit, Ordering::Relaxed) + unit;
            watch(Progress { done, total, elapsed: start.elapsed(), error: latest });
        });
        if stop.load(Ordering::Relaxed) {
            return Err(Error::Render("stopped before the picture was finished; nothing was written".into()));
        }
        let error = if random {
            let film = lock(&part.film);
            let photons = part.splats.as_ref().map(|(_, splats)| lock(splats));
            let photons = photons.as_ref().map(|s| Splats { film: &s.film, photons: s.paths });
            let space = ColourSpace::Rec709.matrix_from_xyz();
            let image = resolve::resolve(&film, photons, &space);
            let error = image.relative_error().ok();
            resolved = Some((space, image));
            error
        } else {
            None
        };
        milestones.push(Milestone { samples: pass.end, elapsed: start.elapsed(), error });
    }
    let (film, splats) = part.finish();
    Ok(Frame { film, splats, elapsed: start.elapsed(), milestones, resolved })
}

/// Paths of one work unit from the lights.
const PATHS_OF_A_UNIT: u64 = 1 << 14;

/// The paths from the lights that the plan calls for.
fn light_paths<'a>(job: &FrameJob<'a>) -> Option<LightPaths<'a>> {
    let FrameJob { scene, plan, filter, window, seed, .. } = *job;
    let (settings, caustics) = match &plan.integrator {
        Integrator::Light(settings) => (*settings, None),
        Integrator::Path(settings) => (settings.of_light_paths(), Some(plan.caustics.as_deref()?)),
        Integrator::Whitted(_) | Integrator::Depth | Integrator::Nothing => return None,
    };
    let radius = filter.radius() + 0.5;
    let corner = DVec2::new(f64::from(window.x), f64::from(window.y));
    let bounds = Bounds {
        low: corner - radius,
        high: corner + DVec2::new(f64::from(window.width), f64::from(window.height)) + radius,
    };
    Some(LightPaths { scene, plan, settings, caustics, seed, bounds, wavelength: None })
}

/// Follows paths from the lights for each sample of `samples`: as many as the frame has pixels, or the share of them
/// that the plan wants. A sample's replicate and number address its paths as they do for the camera, so the sums do
/// not depend on units or passes.
fn from_lights(
    job: &FrameJob,
    light_paths: &LightPaths,
    samples: Range<u32>,
    splats: &Mutex<SplatFilm>,
    stop: &AtomicBool,
    photons: Option<&mut Vec<Photon>>,
) {
    let FrameJob { scene, filter, window, .. } = *job;
    let [width, height] = scene.camera.resolution.map(u64::from);
    let paths = light_paths.caustics.map_or(width * height, |c| c.paths(width * height));
    let units: Vec<(u32, Range<u64>)> = samples
        .flat_map(|s| {
            (0..paths).step_by(PATHS_OF_A_UNIT as usize).map(move |j| (s, j..(j + PATHS_OF_A_UNIT).min(paths)))
        })
        .collect();
    let wanted = photons.is_some();
    let left = units.into_par_iter().map(|(sample, unit)| {
        let mut left = Vec::new();
        if stop.load(Ordering::Relaxed) {
            return left;
        }
        let replicate = sample % REPLICATES as u32;
        let base = u64::from(sample / REPLICATES as u32) * paths;
        let mut landed = Landed::default();
        let count = unit.end - unit.start;
        for j in unit {
            let photons = wanted.then_some(&mut left);
            transport::light::trace(light_paths, replicate, base + j, photons, &mut |wavelengths, splat| {
                landed.add(scene, filter, window, wavelengths, &splat);
            });
        }
        landed.add_to(&mut lock(splats), replicate, count);
        left
    });
    match photons {
        // In the order of the paths, whoever follows them.
        Some(photons) => *photons = left.collect::<Vec<_>>().concat(),
        None => left.for_each(drop),
    }
}

/// [`from_lights`] for one sample, with the photons for its paths from the camera and what chooses their wavelengths.
fn from_lights_for(
    job: &FrameJob,
    light_paths: &LightPaths,
    sample: u32,
    first_radius: f64,
    splats: &Mutex<SplatFilm>,
    stop: &AtomicBool,
) -> (PhotonMap, f64) {
    let (replicate, index) = (sample % REPLICATES as u32, sample / REPLICATES as u32);
    let wavelength = merge::shared_wavelength(job.seed, replicate, index);
    let parts = light_paths.caustics.is_some_and(|c| c.parts);
    let cell = match parts {
        true => WavelengthCell::around(wavelength, job.samples.div_ceil(REPLICATES as u32)),
        false => WavelengthCell::point(wavelength),
    };
    let paths = LightPaths { wavelength: Some(cell), ..*light_paths };
    let mut photons = Vec::new();
    from_lights(job, &paths, sample..sample + 1, splats, stop, Some(&mut photons));
    let [width, height] = job.scene.camera.resolution.map(u64::from);
    let followed = light_paths.caustics.map_or(0, |c| c.paths(width * height));
    (PhotonMap::new(&photons, followed, merge::radius(first_radius, index)), wavelength)
}

/// What the paths of one unit left on the picture.
#[derive(Default)]
struct Landed {
    pixels: Vec<([i32; 2], [f32; 3])>,
    /// The bands of each.
    bands: Vec<f32>,
    invalid: InvalidCounts,
}

impl Landed {
    fn add(
        &mut self,
        scene: &Scene,
        filter: &FilterSampler,
        window: Window,
        wavelengths: &SampledWavelengths,
        splat: &Splat,
    ) {
        if let Some(cause) = Invalid::of(splat.light) {
            self.invalid.record(cause);
            return;
        }
        let unit = light_unit(scene);
        let xyz = splat.xyz(wavelengths).map(|x| x * unit);
        filter.deal(splat.place, |pixel, share| {
            if window.index(pixel).is_some() {
                self.pixels.push((pixel, xyz.map(|x| x * share)));
                for band in &scene.bands {
                    let counted = splat.light * wavelengths.inv_pdf * band.response.eval(wavelengths.nm);
                    self.bands.push(counted.reduce_add() / LANES as f32 * share);
                }
            }
        });
    }

    fn add_to(&self, splats: &mut SplatFilm, replicate: u32, paths: u64) {
        splats.paths[replicate as usize] += paths;
        splats.film.invalid += self.invalid;
        let channels = splats.film.layers.channels();
        let window = splats.film.window();
        for (i, &(pixel, xyz)) in self.pixels.iter().enumerate() {
            splats.film.add(pixel, replicate as usize, xyz, 0.0);
            if let (Some(index), true) = (window.index(pixel), channels > 0) {
                splats.film.layers.add(index, 1.0, &self.bands[i * channels..(i + 1) * channels]);
            }
        }
    }
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
    fn a_small_picture_is_cut_for_all_threads() {
        let window = |side: u32| Window { x: 0, y: 0, width: side, height: side };
        // 16 × 16 pixels make 16 tiles of 4 × 4, as small as they get; 1024 × 1024 stay whole tiles.
        assert_eq!(shares(window(16), 32, 8).len(), 16);
        assert_eq!(shares(window(48), 32, 2).len(), 144);
        assert_eq!(shares(window(256), 32, 2).len(), 64);
        assert_eq!(shares(window(1024), 32, 2).len(), 1024);
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
