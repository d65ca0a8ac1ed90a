//! Part of a picture: some samples of some of its pixels, and their sums.
//!
//! What a part stands for are its [`Claims`]: samples of the pixels of windows, and samples of paths from the lights. Both
//! are addressed, so a path gives the same light whoever follows it, and the film adds integers: parts that claim
//! everything once add up to the picture, bit for bit.
//!
//! A picture is shared out by samples, by rows ([`Share`]), or both. Paths from the lights land anywhere, so that a part
//! of `n` tiles adds the `n`-th of the paths of each of its samples, over the whole picture. Where photons are collected
//! every tile needs all of them: it follows all paths and adds its own.
//!
//! A part can pause between two units of work and tell exactly what it has done: that is what a checkpoint holds.

pub(super) mod lights;

use super::adaptive::{self, Allocation};
use super::frame::{FrameJob, Milestone, lock};
use super::outlook::Outlook;
use super::unit::render_unit;
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::accumulate::{Film, REPLICATES, TileBuffer};
use crate::film::layers::Layout;
use crate::transport::light::LightPaths;
use crate::transport::merge::{self, Collection};
pub use lights::SplatFilm;
use lights::{LightsDone, PATHS_OF_A_UNIT, light_paths, paths_of_a_sample};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

/// What one process does of a picture: all rows or some, all samples or some.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Share {
    /// Which tile, from 0.
    pub tile: u32,
    /// Into how many tiles, bands of rows from the top, the picture is cut.
    pub tiles: u32,
    /// Samples of each pixel.
    pub samples: Range<u32>,
    /// Rows that are not parted: one, or those of a cell of adaptive sampling.
    pub rows: u32,
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Range { start, end } = self.samples;
        write!(f, "tile {}/{}, samples {start}-{}", self.tile, self.tiles, i64::from(end) - 1)
    }
}

/// Rows of `window`, `rows` of the frame together.
#[must_use]
pub fn bands(window: Window, rows: u32) -> u64 {
    let (start, end) = (i64::from(window.y), i64::from(window.y) + i64::from(window.height));
    let side = i64::from(rows);
    ((end + side - 1).div_euclid(side) - start.div_euclid(side)) as u64
}

impl Share {
    /// All of a picture.
    #[must_use]
    pub fn all(samples: u32) -> Share {
        Share { tile: 0, tiles: 1, samples: 0..samples, rows: 1 }
    }

    /// Whether this is all of a picture of `samples` a pixel.
    #[must_use]
    pub fn is_all(&self, samples: u32) -> bool {
        self.tiles == 1 && self.samples == (0..samples)
    }

    /// The `tile`-th of `tiles` of the numbers below `n`.
    pub(super) fn of(&self, n: u64) -> Range<u64> {
        let cut = |i: u32| (u128::from(n) * u128::from(i) / u128::from(self.tiles)) as u64;
        cut(self.tile)..cut(self.tile + 1)
    }

    /// The rows of `window` that belong to the share.
    #[must_use]
    pub fn rows(&self, window: Window) -> Window {
        let side = i64::from(self.rows);
        let (start, end) = (i64::from(window.y), i64::from(window.y) + i64::from(window.height));
        let first = start.div_euclid(side);
        let own = self.of(bands(window, self.rows));
        let row = |band: u64| ((first + band as i64) * side).clamp(start, end);
        let (from, to) = (row(own.start), row(own.end));
        Window { y: from as i32, height: (to - from) as u32, ..window }
    }
}

/// For what a part stands.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "WrittenClaims", try_from = "WrittenClaims")]
pub struct Claims {
    /// Samples of all pixels of a window; one without samples names a tile that has not begun.
    pub camera: Vec<(Window, Range<u32>)>,
    /// Paths of a sample, and samples.
    pub lights: Vec<(Range<u64>, Range<u32>)>,
}

/// [`Claims`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenClaims {
    /// x, y, width, height, first sample and the one after the last.
    camera: Vec<[i64; 6]>,
    /// First path and the one after the last, first sample and the one after the last.
    lights: Vec<[u64; 4]>,
}

impl From<Claims> for WrittenClaims {
    fn from(claims: Claims) -> WrittenClaims {
        let camera = |(w, s): &(Window, Range<u32>)| {
            [w.x.into(), w.y.into(), w.width.into(), w.height.into(), s.start.into(), s.end.into()]
        };
        let lights = |(p, s): &(Range<u64>, Range<u32>)| [p.start, p.end, s.start.into(), s.end.into()];
        WrittenClaims {
            camera: claims.camera.iter().map(camera).collect(),
            lights: claims.lights.iter().map(lights).collect(),
        }
    }
}

impl TryFrom<WrittenClaims> for Claims {
    type Error = std::num::TryFromIntError;

    fn try_from(written: WrittenClaims) -> std::result::Result<Claims, Self::Error> {
        let mut claims = Claims::default();
        for [x, y, width, height, from, to] in written.camera {
            let window =
                Window { x: x.try_into()?, y: y.try_into()?, width: width.try_into()?, height: height.try_into()? };
            claims.camera.push((window, from.try_into()?..to.try_into()?));
        }
        for [first, end, from, to] in written.lights {
            claims.lights.push((first..end, from.try_into()?..to.try_into()?));
        }
        Ok(claims)
    }
}

/// What may come between two units of work: a checkpoint, a picture of what is there, the end.
pub trait Breaks: Sync {
    /// Whether work should pause. Asked before each unit, from any thread.
    fn wanted(&self) -> bool;

    /// Whether the wish is to end: that waits for nothing, while a checkpoint may wait for the end of a sample.
    fn ending(&self) -> bool;

    /// Called while nothing is added; then work goes on.
    ///
    /// # Errors
    /// Whatever it returns ends the render.
    fn take(&self, part: &Part, milestones: &[Milestone], elapsed: Duration) -> Result<()>;
}

/// A flag that stops the render.
impl Breaks for AtomicBool {
    fn wanted(&self) -> bool {
        self.load(Ordering::Relaxed)
    }

    fn ending(&self) -> bool {
        self.load(Ordering::Relaxed)
    }

    fn take(&self, _: &Part, _: &[Milestone], _: Duration) -> Result<()> {
        Err(Error::Render("stopped before the picture was finished; nothing was written".into()))
    }
}

/// Breaks of which only the end counts.
struct Ending<'a>(&'a dyn Breaks);

impl Breaks for Ending<'_> {
    fn wanted(&self) -> bool {
        self.0.ending()
    }

    fn ending(&self) -> bool {
        self.0.ending()
    }

    fn take(&self, part: &Part, milestones: &[Milestone], elapsed: Duration) -> Result<()> {
        self.0.take(part, milestones, elapsed)
    }
}

/// Samples of the camera that a thread takes before it asks whether to pause, about.
const SAMPLES_OF_A_STEP: usize = 1 << 16;

/// A tile and the sample up to which it is done.
#[derive(Debug)]
struct Tile {
    window: Window,
    done: AtomicU32,
}

/// Renders some of the samples of a picture, with their paths from the lights. What any split of the samples adds up to
/// is the whole picture, bit for bit.
///
/// # Errors
/// [`Error::Memory`] if the memory cannot be had.
pub fn render_part(job: &FrameJob, samples: Range<u32>) -> Result<(Film, Option<SplatFilm>)> {
    let part = Part::new(job, Share::all(job.samples))?;
    part.add(samples, &AtomicBool::new(false), &|_| {});
    Ok(part.finish())
}

/// The sums of a part on the way.
#[derive(Debug)]
pub struct Part<'a> {
    job: &'a FrameJob<'a>,
    share: Share,
    window: Window,
    film: Mutex<Film>,
    splats: Option<(LightPaths<'a>, Mutex<SplatFilm>)>,
    tiles: Vec<Tile>,
    lights: Mutex<LightsDone>,
    layers: Layout,
    /// Once the samples that all pixels have are there.
    allocation: OnceLock<Allocation>,
}

fn empty_film(job: &FrameJob, window: Window, layers: Layout) -> Result<Film> {
    let film = Film::new(job.scene.camera.resolution, window)?;
    Ok(film.with_layers(layers).with_exponent(job.scene.light_powers.exponent))
}

/// Empty sums of paths from the lights, where there are any; they land anywhere.
fn empty_splats(job: &FrameJob) -> Result<Option<SplatFilm>> {
    let film = light_paths(job).map(|_| empty_film(job, job.window, light_layers(job))).transpose()?;
    Ok(film.map(|film| SplatFilm { film, paths: [0; REPLICATES] }))
}

/// The layers to which paths from the lights add.
fn light_layers(job: &FrameJob) -> Layout {
    Layout { channels: job.plan.layers.light_channels(), kept: job.plan.layers.kept.without_weights() }
}

impl<'a> Part<'a> {
    /// The memory that the sums of `share` take: the camera's of its rows, and those of paths from the lights, which land anywhere.
    #[must_use]
    pub fn bytes(job: &FrameJob, share: &Share) -> u64 {
        let layers = job.plan.layers.layout();
        let lights = light_paths(job).map_or(0, |_| Film::bytes(job.window, light_layers(job)));
        Film::bytes(share.rows(job.window), layers) + lights
    }

    /// Nothing yet of `share`.
    ///
    /// # Errors
    /// [`Error::Memory`] if the memory cannot be had.
    pub fn new(job: &'a FrameJob<'a>, share: Share) -> Result<Part<'a>> {
        let splats = empty_splats(job)?;
        let film = empty_film(job, share.rows(job.window), job.plan.layers.layout())?;
        Ok(Part::of(job, share, film, splats))
    }

    /// Nothing yet of `share`, with sums that are empty or become what others have done.
    fn of(job: &'a FrameJob<'a>, share: Share, film: Film, splats: Option<SplatFilm>) -> Part<'a> {
        let window = share.rows(job.window);
        let splats = light_paths(job).zip(splats.map(Mutex::new));
        let start = share.samples.start;
        // Who has part of a cell of pixels that share renders all of it: tiles are of whole ones, halved or not.
        let (side, least) = match job.plan.shares_cells() {
            true => (job.tile.next_power_of_two().max(adaptive::SIDE), adaptive::SIDE),
            false => (job.tile, 4),
        };
        let tiles = shares(window, side, least, rayon::current_num_threads());
        let tiles = tiles.into_iter().map(|window| Tile { window, done: AtomicU32::new(start) }).collect();
        let lights = Mutex::new(LightsDone { below: start, more: Vec::new() });
        let (layers, film, allocation) = (job.plan.layers.layout(), Mutex::new(film), OnceLock::new());
        Part { job, share, window, film, splats, tiles, lights, layers, allocation }
    }

    /// A part whose `film` and `splats` hold what `claims` say, with samples shared out by `allocation`; they are of this
    /// share.
    ///
    /// # Errors
    /// As [`Part::new`].
    pub fn resume(
        job: &'a FrameJob<'a>,
        share: Share,
        claims: &Claims,
        allocation: Option<Allocation>,
        film: Film,
        splats: Option<SplatFilm>,
    ) -> Result<Part<'a>> {
        // No sums beside those that there are: together they may be more than the memory holds.
        let splats = splats.map_or_else(|| empty_splats(job), |splats| Ok(Some(splats)))?;
        let mut part = Part::of(job, share, film, splats);
        if let Some(allocation) = allocation {
            part.allocation = OnceLock::from(allocation);
        }
        if let [(_, done)] = claims.camera.as_slice() {
            part.tiles.iter_mut().for_each(|tile| tile.done = AtomicU32::new(done.end));
        } else {
            let tile = |(window, done): &(Window, Range<u32>)| Tile { window: *window, done: AtomicU32::new(done.end) };
            part.tiles = claims.camera.iter().map(tile).collect();
        }
        let own = part.own_paths();
        let mut lights = LightsDone { below: part.share.samples.start, more: Vec::new() };
        for (paths, samples) in &claims.lights {
            if *paths == own && samples.start == lights.below {
                lights.below = samples.end;
            } else {
                lights.more.extend(samples.clone().map(|sample| (paths.clone(), sample)));
            }
        }
        part.lights = Mutex::new(lights);
        Ok(part)
    }

    /// What is done.
    #[must_use]
    pub fn claims(&self) -> Claims {
        let start = self.share.samples.start;
        let done = |tile: &Tile| tile.done.load(Ordering::Relaxed);
        let first = self.tiles.first().map_or(start, done);
        let camera = if self.tiles.iter().all(|tile| done(tile) == first) {
            vec![(self.window, start..first)]
        } else {
            self.tiles.iter().map(|tile| (tile.window, start..done(tile))).collect()
        };
        let mut lights = Vec::new();
        if self.splats.is_some() {
            let known = lock(&self.lights);
            if known.below > start && !self.own_paths().is_empty() {
                lights.push((self.own_paths(), start..known.below));
            }
            lights.extend(known.more.iter().map(|(paths, sample)| (paths.clone(), *sample..*sample + 1)));
        }
        Claims { camera, lights }
    }

    /// Samples of pixels that are done, and all of the share.
    #[must_use]
    pub fn progress(&self) -> (u64, u64) {
        let start = self.share.samples.start;
        let of = |tile: &Tile| tile.window.pixels() as u64 * u64::from(tile.done.load(Ordering::Relaxed) - start);
        (self.tiles.iter().map(of).sum(), self.window.pixels() as u64 * self.share.samples.len() as u64)
    }

    /// Paths from the lights that each sample of the whole picture has; none where there are no such paths.
    #[must_use]
    pub fn paths_of_a_sample(&self) -> Option<u64> {
        self.splats.as_ref().map(|(paths, _)| paths_of_a_sample(self.job, paths))
    }

    /// The sample up to which some tile, or some path from the lights, is done.
    #[must_use]
    pub fn reached(&self) -> u32 {
        let lights = lock(&self.lights);
        let camera = self.tiles.iter().map(|tile| tile.done.load(Ordering::Relaxed));
        camera.chain(lights.more.iter().map(|(_, sample)| sample + 1)).fold(lights.below, u32::max)
    }

    /// The job of which this is a part.
    #[must_use]
    pub fn job(&self) -> &'a FrameJob<'a> {
        self.job
    }

    /// What the part is to become.
    #[must_use]
    pub fn share(&self) -> &Share {
        &self.share
    }

    /// Reads the sums while nothing is added.
    pub fn look<T>(&self, read: impl FnOnce(&Film, Option<&SplatFilm>) -> T) -> T {
        let film = lock(&self.film);
        let splats = self.splats.as_ref().map(|(_, splats)| lock(splats));
        read(&film, splats.as_deref())
    }

    /// How samples are shared out, once that is decided.
    #[must_use]
    pub fn allocation(&self) -> Option<&Allocation> {
        self.allocation.get()
    }

    /// What sharing out does, once it is decided, where samples are shared out.
    #[must_use]
    pub fn outlook(&self) -> Option<&Outlook> {
        self.allocation().map(Allocation::outlook).filter(|outlook| !outlook.is_even())
    }

    /// Adds `samples` of all pixels and their paths from the lights, but for what is there already. `finished` hears how
    /// many samples were done with each tile. False if there was a pause, with some of it left to do.
    pub fn add(&self, samples: Range<u32>, pause: &dyn Breaks, finished: &(dyn Fn(u64) + Sync)) -> bool {
        if let Some(first) = self.first_shared().filter(|first| (samples.start + 1..samples.end).contains(first)) {
            return self.add(samples.start..first, pause, finished) && self.add(first..samples.end, pause, finished);
        }
        let merging = self.job.plan.caustics.as_ref().and_then(|c| c.merging);
        match (&self.splats, merging) {
            (Some((paths, splats)), None) => {
                let units = paths_of_a_sample(self.job, paths).div_ceil(PATHS_OF_A_UNIT).max(1);
                let step = ((1 << 16) / units).max(1) as usize;
                samples.clone().step_by(step).all(|start| {
                    let end = start.saturating_add(step as u32).min(samples.end);
                    self.add_paths(paths, start..end, splats, pause, None)
                }) && self.add_tiles(samples, None, pause, finished)
            }
            // Photons are collected sample by sample. A pause in the midst of one would cost its photons.
            (Some((paths, splats)), Some(first)) => {
                let ending = Ending(pause);
                samples.clone().all(|sample| {
                    if self.has(sample) {
                        return true;
                    }
                    let (replicate, index) = (sample % REPLICATES as u32, sample / REPLICATES as u32);
                    let FrameJob { seed, moments, .. } = *self.job;
                    let moment =
                        (!moments.is_empty()).then(|| merge::shared_moment(seed, replicate, index, moments.len()));
                    let paths = LightPaths { moments: moment.map_or(&[], |k| &moments[k..=k]), ..*paths };
                    let Some((map, wavelength)) = self.photons(&paths, sample, first, splats, &ending) else {
                        return false;
                    };
                    let photons = Collection { map: &map, wavelength, moment };
                    let whole = self.add_tiles(sample..sample + 1, Some(photons), &ending, finished);
                    whole && (sample + 1 == samples.end || !pause.wanted())
                })
            }
            (None, _) => self.add_tiles(samples, None, pause, finished),
        }
    }

    /// Whether all of `sample` is there.
    fn has(&self, sample: u32) -> bool {
        self.tiles.iter().all(|tile| tile.done.load(Ordering::Relaxed) > sample) && lock(&self.lights).below > sample
    }

    fn add_tiles(
        &self,
        samples: Range<u32>,
        photons: Option<Collection>,
        pause: &dyn Breaks,
        finished: &(dyn Fn(u64) + Sync),
    ) -> bool {
        thread_local! {
            static TILE: RefCell<Option<TileBuffer>> = const { RefCell::new(None) };
        }
        let shares = match self.first_shared() {
            Some(first) if first <= samples.start => match self.share_out(pause) {
                true => self.allocation().filter(|allocation| !allocation.outlook().is_even()),
                false => return false,
            },
            _ => None,
        };
        let done = |tile: &Tile| -> bool {
            let window = tile.window;
            let start = tile.done.load(Ordering::Relaxed).max(samples.start);
            if start >= samples.end {
                return true;
            }
            if pause.wanted() {
                return false;
            }
            // Whole blocks of the sampler.
            let step = (SAMPLES_OF_A_STEP / window.pixels().max(1)).next_multiple_of(32).max(32) as u32;
            let mut at = start;
            TILE.with_borrow_mut(|slot| {
                let buffer = slot.get_or_insert_with(|| TileBuffer::new(window));
                buffer.reset(window, self.layers);
                while at < samples.end && (at == start || !pause.wanted()) {
                    let next = (at - at % step).saturating_add(step).min(samples.end);
                    render_unit(self.job, at..next, shares, photons, buffer);
                    at = next;
                }
                lock(&self.film).merge_tile(buffer);
            });
            tile.done.store(at, Ordering::Relaxed);
            finished(window.pixels() as u64 * u64::from(at - start));
            at == samples.end
        };
        self.tiles.par_iter().map(done).reduce(|| true, |a, b| a && b)
    }

    /// Samples that all pixels have before they are shared out, where they are.
    fn first_shared(&self) -> Option<u32> {
        self.job.plan.adaptive.map(|adaptive| adaptive.first)
    }

    /// Shares out the samples of a picture, where that is done, each pixel has the first ones and it has not been yet. False if there
    /// was a pause.
    pub fn share_out(&self, pause: &dyn Breaks) -> bool {
        let Some(adaptive) = self.job.plan.adaptive.filter(|_| self.allocation.get().is_none()) else { return true };
        // A pause in its midst would cost all that it has seen.
        let pilot = || adaptive::pilot(self.job, adaptive.first, &Ending(pause));
        // Its paths are no part of the picture, and each part of one has them.
        let scale = self.job.scene.watch.as_ref().map_or_else(pilot, |watch| watch.aside(pilot));
        let Some(scale) = scale else { return false };
        let allocation = adaptive::decide(self.job, adaptive, &lock(&self.film), &scale);
        // Nobody else decides meanwhile.
        let _ = self.allocation.set(allocation);
        true
    }

    /// The sums.
    #[must_use]
    pub fn finish(self) -> (Film, Option<SplatFilm>) {
        let film = self.film.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        let splats = self.splats.map(|(_, s)| s.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner));
        (film, splats)
    }
}

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

/// Tiles of at most `side` pixels, halved until every thread has 32 or they are `least` pixels wide: a
/// small picture keeps all threads busy to its end. How it is cut changes no bit of it.
fn shares(window: Window, side: u32, least: u32, threads: usize) -> Vec<Window> {
    let halves = std::iter::successors(Some(side), |side| (*side >= 2 * least).then_some(side / 2));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_cover_rows_and_paths_once() {
        let window = Window { x: 3, y: -2, width: 5, height: 14 };
        for tiles in [1, 2, 3, 14] {
            let (mut row, mut path) = (window.y, 0);
            for tile in 0..tiles {
                let share = Share { tile, tiles, samples: 0..4, rows: 1 };
                let rows = share.rows(window);
                assert!(rows.y == row && rows.height > 0 && window.contains(&rows));
                row += rows.height as i32;
                assert_eq!(share.of(1000).start, path);
                path = share.of(1000).end;
            }
            assert_eq!((row, path), (12, 1000));
        }
    }

    /// Rows of the frame from 8 to 15, from 16 to 23 and so on stay together.
    #[test]
    fn shares_of_cells_begin_where_cells_do() {
        let window = Window { x: 0, y: 13, width: 4, height: 30 };
        assert_eq!(bands(window, 8), 5);
        let share = |tile, tiles| Share { tile, tiles, samples: 0..4, rows: 8 }.rows(window);
        let rows = |w: Window| (w.y, w.y + w.height as i32);
        assert_eq!([0, 1].map(|i| rows(share(i, 2))), [(13, 24), (24, 43)]);
        assert_eq!([0, 1, 2, 3, 4].map(|i| rows(share(i, 5))), [(13, 16), (16, 24), (24, 32), (32, 40), (40, 43)]);
    }

    #[test]
    fn a_small_picture_is_cut_for_all_threads() {
        let window = |side: u32| Window { x: 0, y: 0, width: side, height: side };
        // 16 × 16 pixels make 16 tiles of 4 × 4, as small as they get; 1024 × 1024 stay whole tiles.
        assert_eq!(shares(window(16), 32, 4, 8).len(), 16);
        assert_eq!(shares(window(48), 32, 4, 2).len(), 144);
        assert_eq!(shares(window(256), 32, 4, 2).len(), 64);
        assert_eq!(shares(window(1024), 32, 4, 2).len(), 1024);
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
