//! Adaptive sampling: more samples where the picture is noisier, at the same mean number.
//!
//! The picture is cut into cells of [`SIDE`] × [`SIDE`] pixels, aligned to the frame, and the replicates into two halves,
//! 0 with 1 and 2 with 3. All pixels first get the same few samples. Then each half of each cell is given its number
//! once, from what the **other** half shows so far: what a half averages has no part in how long it goes on, so that the
//! mean of each half is unbiased, and so is the mean of the two (`film/resolve.rs`). Dark pixels that have not met
//! their light yet would stop early else.
//!
//! To decide again at later counts would let the halves talk: how far one of them has come depends on the other, and so
//! would what it then shows.
//!
//! **How many.** With v the relative variance of a sample, the mean over pixels and channels of var / (value² + f) with
//! f = 0.01 · (mean of the picture)², as the picture's error counts it, and c what a sample costs, the error after a given time is
//! least where a cell has ∝ √(v/c) samples. So the share of a cell, the number of its samples over the mean one, is
//! w = max(¼, λ√(v/c)).
//!
//! **Without the rest of the picture**, f, c and λ come from a pilot: one pixel of each quarter of each cell, with random
//! numbers of its own. Where samples count for several pixels or paths are shared, a pixel by itself does not show the noise that is left:
//! how much less or more there is, is told by some whole cells. The pilot is a pure function of scene and settings, so that parts of a picture agree.
//! Costs are counted in rays, not in seconds.
//!
//! **Where it pays.** Where nobody asks for it, samples are shared out in renders that an error or a time ends, if that is expected to
//! save a twentieth of the time (`outlook.rs`). What the shares that one half gives the other are worth is told by the pilot, for each
//! half by itself: what a half has found must not decide that either, and one may go on evenly while the other does not.

use super::forecast::usual_slope;
use super::frame::FrameJob;
use super::outlook::{Kind, Outlook};
use super::part::Breaks;
use super::unit::render_unit;
use crate::film::Window;
use crate::film::accumulate::{Film, Invalid, REPLICATES, SAMPLES_LIMIT, TileBuffer};
use crate::film::error::floor_about;
use crate::film::layers::Kept;
use crate::film::resolve::means_of_halves;
use crate::math::sampler::mix64;
use crate::spectrum::ColourSpace;
use crate::transport::path::reuse;
use crate::transport::pilot::Use;
use crate::transport::plan::{Adaptive, Effect, EffectPlan, Integrator};
use crate::transport::{self, Shot, moment, scene_at};
use rayon::prelude::*;
use std::ops::Range;

/// Side of a cell in pixels: that of the cells in which paths are shared.
pub const SIDE: u32 = reuse::SIDE as u32;

/// Halves of the replicates.
pub const HALVES: usize = 2;

/// The fewest samples of all pixels before anything is decided.
const FIRST: u32 = 8;

/// What a render with an open end takes for that.
const FIRST_OF_MANY: u32 = 32;

/// The fewest samples of a pixel that can be shared out.
const FEWEST: u32 = 16;

/// The least share of a cell: what noise has not shown yet is looked for everywhere.
const LEAST: f64 = 0.25;

/// The largest share of a cell.
pub(super) const MOST: f64 = 64.0;

/// Shares are powers of 2 to a whole number of these.
const STEPS: f64 = 16.0;

/// What a sample costs besides its rays, in rays: its random numbers, the film.
const OVERHEAD: f64 = 1.0;

/// Of so many cells one is tried where that has to be done with all of its pixels, and so many in all if there are as many.
const ONE_OF: usize = 64;
const CELLS: usize = 24;

/// Cells of a picture of which all are tried so.
const FEW: usize = 16;

/// Up to what share of the time to an error sharing out has to be expected to take, where nobody asks for it.
const WORTH_IT: f64 = 0.95;

/// For how many times the samples by which it is told that is expected.
const HORIZON: u32 = 8;

/// Tells the pilot's numbers from the picture's.
const STREAM: u64 = 0x6164_6170_7469_7665;

/// Decides whether a picture of `samples` a pixel is sampled adaptively, and from how many samples it is told where; and
/// what to say of it. `open` where an error or a time may end the render before.
#[must_use]
pub fn choose(wish: Use, open: bool, plan: &EffectPlan, samples: u32) -> (Option<Adaptive>, Option<Effect>) {
    if !matches!(plan.integrator, Integrator::Path(_)) {
        return (None, None);
    }
    let say = |chosen: Option<Adaptive>, reason: String| {
        (chosen, Some(Effect { name: "adaptive sampling".into(), on: chosen.is_some(), reason }))
    };
    let off = |reason: &str| say(None, reason.to_owned());
    match wish {
        Use::Off => return off("the scene says so"),
        // A picture of so many samples may be rendered in parts by ranges of them.
        Use::Auto if !open => return off("neither an error nor a time ends the render"),
        Use::Auto | Use::On => {}
    }
    if plan.caustics.as_ref().is_some_and(|c| c.merging.is_some()) {
        return off("photons are collected, and every sample needs its own");
    }
    if samples < FEWEST && !open {
        return off("there are fewer than 16 samples");
    }
    if wish == Use::Auto && !plan.layers.channels().is_empty() && plan.layers.kept == Kept::Together {
        return off("layers would be summed by replicate");
    }
    // What is rendered to one error can go on to another: what is shared out depends on neither, nor on their bounds.
    let first = if open { FIRST_OF_MANY } else { (1 << (samples / 4).ilog2()).max(FIRST) };
    let always = wish == Use::On;
    let pays = if always { "" } else { ", where that is expected to save time" };
    say(Some(Adaptive { first, always }), format!("cells of {SIDE} x {SIDE} pixels, told by {first} samples{pays}"))
}

/// The cells of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Grid {
    window: Window,
    /// Column and row of the first cell in the frame.
    first: [i32; 2],
    columns: usize,
    rows: usize,
}

impl Grid {
    fn of(window: Window) -> Grid {
        let side = i64::from(SIDE);
        let span = |start: i32, size: u32| {
            let first = i64::from(start).div_euclid(side);
            let end = (i64::from(start) + i64::from(size)).div_euclid(side)
                + i64::from((i64::from(start) + i64::from(size)).rem_euclid(side) != 0);
            (first as i32, (end - first) as usize)
        };
        let ((x, columns), (y, rows)) = (span(window.x, window.width), span(window.y, window.height));
        Grid { window, first: [x, y], columns, rows }
    }

    fn cells(&self) -> usize {
        self.columns * self.rows
    }

    /// What of a cell lies in the window.
    fn pixels(&self, cell: usize) -> Window {
        let [x, y] = self.corner(cell);
        let cut = |start: i32, first: i32, size: u32| {
            let end = (start + SIDE as i32).min(first.saturating_add_unsigned(size));
            (start.max(first), (end - start.max(first)) as u32)
        };
        let ((x, width), (y, height)) =
            (cut(x, self.window.x, self.window.width), cut(y, self.window.y, self.window.height));
        Window { x, y, width, height }
    }

    /// The cell of a pixel of the window.
    fn index(&self, [x, y]: [i32; 2]) -> usize {
        let side = SIDE as i32;
        let column = (x.div_euclid(side) - self.first[0]) as usize;
        let row = (y.div_euclid(side) - self.first[1]) as usize;
        row * self.columns + column
    }

    /// The first pixel of a cell, which may lie beyond the window.
    fn corner(&self, cell: usize) -> [i32; 2] {
        let side = SIDE as i32;
        let (column, row) = (cell % self.columns, cell / self.columns);
        [(self.first[0] + column as i32) * side, (self.first[1] + row as i32) * side]
    }
}

/// The first pixel of each cell of `window`, which may lie beyond it.
pub fn corners(window: Window) -> impl Iterator<Item = [i32; 2]> {
    let grid = Grid::of(window);
    (0..grid.cells()).map(move |cell| grid.corner(cell))
}

/// The cells of `window`.
#[must_use]
pub fn cells(window: Window) -> usize {
    Grid::of(window).cells()
}

/// How samples are shared out among the cells of a window.
#[derive(Clone, Debug, PartialEq)]
pub struct Allocation {
    grid: Grid,
    /// Samples of all pixels alike.
    first: u32,
    /// Share of each half of each cell: its number of samples over the mean is 2 to this over [`STEPS`].
    shares: Vec<[i16; HALVES]>,
    /// Halves whose pixels all go on alike.
    even: [bool; HALVES],
    /// What becomes of the picture: even where all of it goes on so.
    outlook: Outlook,
}

impl Allocation {
    /// The cells of `window`, where all pixels have `first` samples, with their shares as [`Allocation::shares`] gave them and what
    /// [`Allocation::outlook`] did; none if they are not those of the window.
    #[must_use]
    pub fn from(window: Window, first: u32, shares: Vec<[i16; HALVES]>, outlook: Outlook) -> Option<Allocation> {
        let grid = Grid::of(window);
        (shares.len() == grid.cells()).then(|| {
            let even = [0, 1].map(|half| shares.iter().all(|shares| shares[half] == 0));
            Allocation { grid, first, shares, even, outlook }
        })
    }

    /// What becomes of the picture.
    #[must_use]
    pub fn outlook(&self) -> &Outlook {
        &self.outlook
    }

    /// The share of each half of each cell.
    #[must_use]
    pub fn shares(&self) -> &[[i16; HALVES]] {
        &self.shares
    }

    /// Which samples of `replicate` of `pixel` belong to `samples` of the mean of all pixels, as numbers within the
    /// replicate.
    #[must_use]
    pub fn turns(&self, pixel: [i32; 2], replicate: u32, samples: &Range<u32>) -> Range<u32> {
        let half = replicate as usize * HALVES / REPLICATES;
        let share = self.shares[self.grid.index(pixel)][half];
        let of = |mean: u32| match mean <= self.first || self.even[half] {
            true => mean.saturating_sub(replicate).div_ceil(REPLICATES as u32),
            false => count(self.first, share, mean) / REPLICATES as u32,
        };
        of(samples.start)..of(samples.end)
    }
}

/// Samples of a pixel both of whose halves have `share`, at `mean` samples, more than `first`, of the mean of all pixels: `first`
/// times a power of two, which is what the sampler spreads evenly, and never fewer at a higher mean.
pub(super) fn count(first: u32, share: i16, mean: u32) -> u32 {
    let times = f64::from(mean) / f64::from(first);
    let doublings = (libm::log2(times) + f64::from(share) / STEPS).round().max(0.0);
    let most = SAMPLES_LIMIT * REPLICATES as u32;
    let wanted = f64::from(first) * libm::exp2(doublings);
    if wanted < f64::from(most) { wanted as u32 } else { 1 << most.ilog2() }
}

/// What all cells of a picture have in common, told by the pilot.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Added to the square of a value: a hundredth of that of the mean.
    floor: f64,
    /// A share over what a cell wishes.
    shares: f64,
    /// Of a sample of each cell of the picture, over that of all.
    costs: Vec<f64>,
    /// The variance of each cell that the pilot has looked into.
    variances: Vec<Option<f64>>,
}

/// Relative variance of the mean of one replicate in some pixels, as both of their halves show it.
fn variance_of_both(pixels: &[[[f64; 3]; REPLICATES]], floor: f64) -> f64 {
    0.5 * (variance(pixels, 0, floor) + variance(pixels, 1, floor))
}

/// The same as their half `half` shows it.
fn variance(pixels: &[[[f64; 3]; REPLICATES]], half: usize, floor: f64) -> f64 {
    let of = |means: &[[f64; 3]; REPLICATES]| -> f64 {
        let (a, b) = (means[2 * half], means[2 * half + 1]);
        let channel = |c: usize| {
            let (difference, value) = (a[c] - b[c], 0.5 * (a[c] + b[c]));
            if difference == 0.0 { 0.0 } else { 0.5 * difference * difference / (value * value + floor) }
        };
        (channel(0) + channel(1) + channel(2)) / 3.0
    };
    pixels.iter().map(of).sum::<f64>() / pixels.len().max(1) as f64
}

/// λ with which the mean of max(least, λs) over `deviations` s is one; 0 where there is no noise.
fn scale(deviations: &[f64], least: f64) -> f64 {
    let mean = |factor: f64| {
        let share = |s: &f64| (factor * s).clamp(least, MOST);
        deviations.iter().map(share).sum::<f64>() / deviations.len().max(1) as f64
    };
    let noisy = deviations.iter().copied().filter(|s| *s > 0.0);
    let (low, high) = noisy.fold((f64::INFINITY, 0f64), |(low, high), s| (low.min(s), high.max(s)));
    if high == 0.0 {
        return 0.0;
    }
    // At the first all shares are the least, at the other the noisy ones the largest.
    let (mut below, mut above) = (libm::log2(least / high), libm::log2(MOST / low));
    for _ in 0..64 {
        let middle = 0.5 * (below + above);
        if mean(libm::exp2(middle)) < 1.0 {
            below = middle;
        } else {
            above = middle;
        }
    }
    libm::exp2(below)
}

/// What the pilot has seen of a cell.
#[derive(Clone, Debug, Default)]
struct Tried {
    /// Means of the replicates of each pixel.
    pixels: Vec<[[f64; 3]; REPLICATES]>,
    /// Of a sample, in rays.
    cost: f64,
}

/// One pixel of each quarter of each cell, with `first` samples; none if the render is to pause.
#[must_use]
pub fn pilot(job: &FrameJob, first: u32, pause: &dyn Breaks) -> Option<Scale> {
    let seed = mix64(job.seed ^ STREAM);
    let shot = Shot { scene: job.scene, plan: job.plan, filter: job.filter, seed, photons: None };
    let grid = Grid::of(job.window);
    let half = SIDE / 2;
    let each = first / REPLICATES as u32;
    let of_cell = |cell: usize| -> Option<Tried> {
        if pause.wanted() {
            return None;
        }
        let [x, y] = grid.corner(cell);
        let mut tried = Tried::default();
        let mut rays = 0.0;
        for quarter in 0..4u32 {
            // Which pixel of a quarter is a matter of chance, lest a pattern of the picture agree with it.
            let draw = mix64(seed ^ mix64((cell as u64) << 2 | u64::from(quarter)));
            let (dx, dy) = (draw as u32 % half, (draw >> 32) as u32 % half);
            let place = [x + (quarter % 2 * half + dx) as i32, y + (quarter / 2 * half + dy) as i32];
            if job.window.index(place).is_none() {
                continue;
            }
            let mut means = [[0.0; 3]; REPLICATES];
            for (replicate, mean) in means.iter_mut().enumerate() {
                for index in 0..each {
                    let (pixel, replicate) = (place.map(|x| x as u32), replicate as u32);
                    let scene = scene_at(job.scene, job.moments, |n| moment(seed, pixel, replicate, index, n));
                    let (sample, work) = transport::sample(&Shot { scene, ..shot }, pixel, replicate, index);
                    rays += OVERHEAD + work.rays;
                    if Invalid::of(sample.radiance).is_none() {
                        let rgb = ColourSpace::Rec709.from_xyz(sample.xyz.map(|x| x * sample.weight));
                        for (sum, x) in mean.iter_mut().zip(rgb) {
                            *sum += f64::from(x) / f64::from(each);
                        }
                    }
                }
            }
            tried.pixels.push(means);
        }
        tried.cost = rays / (tried.pixels.len() as f64 * f64::from(first)).max(1.0);
        Some(tried)
    };
    let tried: Option<Vec<Tried>> = (0..grid.cells()).into_par_iter().map(of_cell).collect();
    let tried = tried?;
    let values = || tried.iter().flat_map(|tried| &tried.pixels).flatten().flatten();
    let mean = values().sum::<f64>() / values().count().max(1) as f64;
    let floor = floor_about(mean);
    let all: f64 = tried.iter().map(|tried| tried.cost).sum();
    let cost = all / tried.iter().filter(|tried| !tried.pixels.is_empty()).count().max(1) as f64;
    // Slivers that the pilot has missed cost as much as others.
    let costs: Vec<f64> =
        tried.iter().map(|tried| if tried.pixels.is_empty() { 1.0 } else { tried.cost / cost }).collect();
    // With its neighbours a cell has about as many pixels here as it has by itself in the picture: a few would miss the
    // rare and bright, and all cells would be promised too much.
    let wish = |cell: usize| {
        let (row, column) = (cell / grid.columns, cell % grid.columns);
        let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        let around = near(row, grid.rows).flat_map(|r| near(column, grid.columns).map(move |c| r * grid.columns + c));
        let pixels: Vec<_> = around.flat_map(|cell| &tried[cell].pixels).copied().collect();
        wish(variance_of_both(&pixels, floor), tried[cell].cost / cost)
    };
    let has_some = |cell: &usize| !tried[*cell].pixels.is_empty();
    let wishes: Vec<f64> = (0..grid.cells()).filter(has_some).map(wish).collect();
    let (wishes, variances) = match job.plan.splatting || job.plan.reuse || grid.cells() <= FEW {
        false => {
            let own = |cell: usize| has_some(&cell).then(|| variance_of_both(&tried[cell].pixels, floor));
            (wishes, (0..grid.cells()).map(own).collect())
        }
        true => {
            // How much more or less they wish for is told by some, where pixels by themselves tell anything.
            let whole = variances_of_whole_cells(job, first, seed, floor, pause)?;
            let mut variances = vec![None; grid.cells()];
            whole.iter().for_each(|&(cell, variance)| variances[cell] = Some(variance));
            let whole: Vec<(usize, f64)> =
                whole.into_iter().map(|(cell, own)| (cell, self::wish(own, costs[cell]))).collect();
            let sums = whole.iter().filter(|(cell, _)| has_some(cell));
            let (told, alone) = sums.fold((0.0, 0.0), |(told, alone), &(cell, own)| (told + own, alone + wish(cell)));
            let wishes = match told > 0.0 && alone > 0.0 && grid.cells() > FEW {
                true => wishes.iter().map(|own| own * (told / alone)).collect(),
                false => whole.into_iter().map(|(_, own)| own).collect(),
            };
            (wishes, variances)
        }
    };
    let least = if job.stop.is_open() { LEAST } else { LEAST.max(f64::from(first) / f64::from(job.samples)) };
    Some(Scale { floor, shares: scale(&wishes, least), costs, variances })
}

/// Some cells, and their variances, whose pixels all have the `first` samples of the pilot, as [`decide`] will tell them; none if the
/// render is to pause.
fn variances_of_whole_cells(
    job: &FrameJob,
    first: u32,
    seed: u64,
    floor: f64,
    pause: &dyn Breaks,
) -> Option<Vec<(usize, f64)>> {
    let job = FrameJob { seed, ..*job };
    let grid = Grid::of(job.window);
    let layout = job.plan.layers.layout();
    let one_of = (grid.cells() / CELLS).clamp(1, ONE_OF) as u64;
    let chosen = |cell: &usize| mix64(seed ^ mix64(*cell as u64)).is_multiple_of(one_of);
    let cells: Vec<usize> = (0..grid.cells()).filter(chosen).collect();
    let rgb_from_xyz = ColourSpace::Rec709.matrix_from_xyz();
    let of_cell = |cell: usize| -> Option<(usize, f64)> {
        if pause.wanted() {
            return None;
        }
        let window = grid.pixels(cell);
        let mut tile = TileBuffer::new(window);
        tile.reset(window, layout);
        render_unit(&job, 0..first, None, None, &mut tile);
        let mut film = Film::new(job.scene.camera.resolution, window).ok()?.with_layers(layout);
        film.merge_tile(&tile);
        let pixels = means(&film, window, &rgb_from_xyz);
        Some((cell, variance_of_both(&pixels, floor)))
    };
    cells.into_par_iter().map(of_cell).collect()
}

/// The means of the replicates of the `pixels` of `film`, which holds them all.
fn means(film: &Film, pixels: Window, rgb_from_xyz: &[[f64; 3]; 3]) -> Vec<[[f64; 3]; REPLICATES]> {
    let window = film.window();
    pixels.iter().filter_map(|pixel| means_of_halves(film, window.index(pixel)?, rgb_from_xyz)).collect()
}

/// Share of a cell up to a factor that all have in common.
fn wish(variance: f64, cost: f64) -> f64 {
    (variance / cost).sqrt()
}

/// Shares out the samples of the picture among the cells of `film`, the rows of a part, whose pixels have the first samples each that
/// `adaptive` names; evenly where that is as good and nobody asks for more, and where there is no noise.
///
/// A picture that an error or a time ends is whole: what the shares of a half have in common, so that their mean is one, is told by the
/// other half. Of a part by the pilot, for all parts alike.
#[must_use]
pub fn decide(job: &FrameJob, adaptive: Adaptive, film: &Film, scale: &Scale) -> Allocation {
    let first = adaptive.first;
    let rgb_from_xyz = ColourSpace::Rec709.matrix_from_xyz();
    let grid = Grid::of(film.window());
    // A part has all columns, and some rows.
    let offset = (grid.first[1] - Grid::of(job.window).first[1]) as usize * grid.columns;
    // Of a cell its pixels, and of each half its variance and what the other wishes for it.
    let of_cell = |cell: usize| -> (f64, [(f64, f64); HALVES]) {
        let pixels = means(film, grid.pixels(cell), &rgb_from_xyz);
        let variances = [0, 1].map(|half| variance(&pixels, half, scale.floor));
        let wish = |half: usize| wish(variances[1 - half], scale.costs[offset + cell]);
        (pixels.len() as f64, [0, 1].map(|half| (variances[half], wish(half))))
    };
    let cells: Vec<_> = (0..grid.cells()).into_par_iter().map(of_cell).collect();
    let end = f64::from(first.saturating_mul(HORIZON));
    // Those that one half gives the other, none where it has met no noise; only their worth may be looked at here.
    let shares_of = |half: usize| -> Vec<i16> {
        let in_common = match job.stop.is_open() {
            true => self::scale(&cells.iter().map(|(_, halves)| halves[half].1).collect::<Vec<f64>>(), LEAST),
            false => scale.shares,
        };
        let share = |wish: f64| (libm::log2((in_common * wish).clamp(LEAST, MOST)) * STEPS).round() as i16;
        let shares: Vec<i16> = cells.iter().map(|(_, halves)| share(halves[half].1)).collect();
        let kinds = cells.iter().zip(&shares).enumerate().filter_map(|(cell, ((count, _), share))| {
            let variance = count * scale.variances[offset + cell]?;
            Some(Kind { share: *share, variance, cost: count * scale.costs[offset + cell] })
        });
        let pays = || Outlook::new(first, kinds.collect()).time(end, usual_slope(end, true)) < WORTH_IT;
        match in_common > 0.0 && (adaptive.always || pays()) {
            true => shares,
            false => vec![0; cells.len()],
        }
    };
    let [a, b] = [0, 1].map(shares_of);
    let shares: Vec<[i16; HALVES]> = a.into_iter().zip(b).map(|(a, b)| [a, b]).collect();
    let kinds = cells.iter().zip(&shares).enumerate().flat_map(|(cell, ((count, halves), shares))| {
        let cost = count * scale.costs[offset + cell];
        [0, 1].map(|half| Kind { share: shares[half], variance: count * halves[half].0, cost })
    });
    let outlook = match shares.iter().all(|shares| *shares == [0; HALVES]) {
        true => Outlook::default(),
        false => Outlook::new(first, kinds.collect()),
    };
    Allocation::from(film.window(), first, shares, outlook).expect("a share for each cell of the film")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crop whose corner lies left of the frame: every pixel in one cell, whose corner is at a multiple of eight.
    #[test]
    fn cells_are_those_of_the_frame() {
        let window = Window { x: -5, y: 13, width: 22, height: 4 };
        let grid = Grid::of(window);
        assert_eq!((grid.columns, grid.rows, cells(window)), (4, 2, 8));
        let mut pixels = vec![0; grid.cells()];
        for y in 13..17 {
            for x in -5..17 {
                let cell = grid.index([x, y]);
                let [left, top] = grid.corner(cell);
                assert!((left..left + 8).contains(&x) && (top..top + 8).contains(&y) && left % 8 == 0 && top % 8 == 0);
                pixels[cell] += 1;
            }
        }
        assert_eq!(pixels, [15, 24, 24, 3, 5, 8, 8, 1]);
    }

    /// Some shares.
    fn uneven() -> Outlook {
        Outlook::new(16, vec![Kind { share: 0, variance: 1.0, cost: 1.0 }])
    }

    /// However the mean is cut into ranges, each sample comes once, in order, and the first ones are those of a uniform render; of a half
    /// without shares all are.
    #[test]
    fn samples_come_once_in_whole_powers_of_two() {
        let window = Window::full(8, 8);
        for share in [-32, -7, 0, 5, 40, 96] {
            let allocation = Allocation::from(window, 16, vec![[share, 0]], uneven()).unwrap();
            for replicate in 0..4 {
                let mut at = 0;
                for mean in 0..300 {
                    let turns = allocation.turns([3, 4], replicate, &(mean..mean + 1));
                    assert_eq!(turns.start, at);
                    assert!(turns.end >= at);
                    if mean < 16 || replicate >= 2 || share == 0 {
                        assert_eq!(turns.len() == 1, mean % 4 == replicate);
                    } else {
                        assert!(turns.end.is_power_of_two());
                    }
                    at = turns.end;
                }
            }
        }
        // Half a share of 64 is 32 samples, of 100 the nearer of 32 and 64 by ratio; a fourth of 64 the first 16.
        assert_eq!([(-16, 64), (-16, 100), (-32, 64), (16, 64)].map(|(s, n)| count(16, s, n)), [32, 64, 16, 128]);
        assert_eq!(count(16, 96, u32::MAX), 1 << 27);
        assert!(Allocation::from(window, 16, Vec::new(), uneven()).is_none());
    }

    /// Two cells, one without noise and one with: the quiet one has the least share and the other what is left. All alike:
    /// one each, whatever the unit of noise. None noisy: nothing to share out.
    #[test]
    fn the_mean_share_is_one() {
        assert!((scale(&[0.0, 3.0], LEAST) * 3.0 - 1.75).abs() < 1e-9);
        assert!((scale(&[1e-20; 5], LEAST) * 1e-20 - 1.0).abs() < 1e-9);
        assert_eq!((scale(&[0.0; 4], LEAST), scale(&[], LEAST)), (0.0, 0.0));
    }

    /// Replicates 1 and 3 of half 0, values of 2 in the mean: variance of one 2; of half 1 none.
    #[test]
    fn a_half_shows_its_own_variance() {
        let pixel = [[1.0; 3], [3.0; 3], [5.0; 3], [5.0; 3]];
        assert_eq!(variance(&[pixel, pixel], 0, 0.0), 0.5);
        assert_eq!(variance(&[pixel, pixel], 1, 0.0), 0.0);
        assert_eq!(variance(&[[[0.0; 3]; REPLICATES]], 0, 0.0), 0.0);
        assert_eq!(variance(&[], 0, 1.0), 0.0);
    }
}
