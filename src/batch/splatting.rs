//! Samples that count for all pixels whose filters hold them.
//!
//! The place of a sample is drawn by the filter of its own pixel, but the filters of others may hold it as well. With a sample
//! s_p of each pixel p of a block, drawn with density f_p, the light of pixel q is
//!
//! ```text
//! Σ over p of w_q(s_p) · L(s_p),    w_q(s) = f_q(s) / Σ over p of f_p(s)
//! ```
//!
//! which is the balance heuristic (Veach and Guibas 1995) of all that could have drawn a place. The weights of a place add up to
//! one, so that a sample is dealt out whole: the sum over a block is that of its samples. What the weights of a pixel lack of one a
//! sample [`resolve`](crate::film::resolve) makes up for.
//!
//! What a sample has for its own pixel alone counts there as much as all samples of its number do, Σ over p of w_q(s_p), which is one in the
//! mean and knows nothing of it: so what is alike in all samples is not made uneven by what is made up for.
//!
//! A block is a cell of [`SIDE`] × [`SIDE`] pixels, aligned to the frame and cut where the frame ends or what counts, so that tiles and
//! crops need nothing from beyond their cells and overscan changes nothing inside. Of the noise of a Gaussian of 0.5 pixels 0.38
//! is left in the mean over the pixels of a cell, where samples have nothing to do with each other, and 0.32 in its middle.

use super::adaptive::{SIDE, corners};
use crate::film::Window;
use crate::film::filter::FilterSampler;
use crate::transport::pilot::Use;
use crate::transport::plan::{Effect, EffectPlan, Integrator};
use glam::DVec2;
use std::ops::Range;
use wide::f32x8;

/// Pixels of a cell along an axis.
const WIDTH: usize = SIDE as usize;

/// Pixels of a block at the most.
const PIXELS: usize = WIDTH * WIDTH;

/// Decides whether samples count for several pixels, and what to say of it.
#[must_use]
pub fn choose(wish: Use, plan: &EffectPlan, filter: &FilterSampler) -> (bool, Option<Effect>) {
    if matches!(plan.integrator, Integrator::Whitted(_)) {
        return (false, None);
    }
    let off = if wish == Use::Off {
        Some("the scene says so")
    } else if filter.radius() <= 0.5 {
        Some("the filter does not reach beyond its pixel")
    } else if !filter.is_positive() {
        Some("the filter has negative lobes")
    } else if plan.layers.mattes {
        Some("mattes count the samples of each pixel")
    } else {
        None
    };
    let reason = off.unwrap_or("each sample counts for all pixels near it whose filters hold it").to_owned();
    (off.is_none(), Some(Effect { name: "splatting".into(), on: off.is_none(), reason }))
}

/// Pixels among which samples are dealt out.
#[derive(Clone, Debug)]
pub struct Block {
    /// The pixels.
    pub window: Window,
    /// [`FilterSampler::gain`] of its columns and of its rows; nothing beyond.
    gains: [f32x8; 2],
}

/// The blocks of a picture of `resolution` that have pixels of `window`.
pub fn blocks(window: Window, resolution: [u32; 2], filter: &FilterSampler) -> impl Iterator<Item = Block> {
    let bounds = filter.bounds().map(|corners| corners.map(|corner| [corner.x, corner.y].map(|x| x as i32)));
    let cut = move |axis: usize, start: i32| {
        let (mut from, mut to) = (start, start + SIDE as i32);
        if let Some([low, high]) = bounds {
            (from, to) = (from.max(low[axis]), to.min(high[axis]));
        }
        let edges = [0, resolution[axis] as i32].map(|edge| edge.clamp(from, to.max(from)));
        [from..edges[0], edges[0]..edges[1], edges[1]..to].into_iter().filter(|range| !range.is_empty())
    };
    let meets = move |pixels: &Window| pixels.iter().any(|pixel| window.index(pixel).is_some());
    let of = move |[x, y]: [i32; 2]| {
        let pixels = move |rows: Range<i32>, columns: Range<i32>| Window {
            x: columns.start,
            y: rows.start,
            width: columns.len() as u32,
            height: rows.len() as u32,
        };
        cut(1, y).flat_map(move |rows| cut(0, x).map(move |columns| pixels(rows.clone(), columns)))
    };
    corners(window).flat_map(of).filter(meets).map(|window| Block::new(window, filter))
}

impl Block {
    fn new(window: Window, filter: &FilterSampler) -> Block {
        let gain = |axis: usize, first: i32, i: usize| filter.gain(axis, first + i as i32);
        let gains = [(window.x, window.width), (window.y, window.height)];
        let mut of = [[0.0; WIDTH]; 2];
        for (axis, (first, size)) in gains.into_iter().enumerate() {
            (0..size as usize).for_each(|i| of[axis][i] = gain(axis, first, i) as f32);
        }
        Block { window, gains: of.map(f32x8::new) }
    }

    /// Shares of columns and of rows in a sample of `pixel` at `place`.
    #[inline]
    fn shares(&self, filter: &FilterSampler, pixel: [i32; 2], place: DVec2) -> [f32x8; 2] {
        const STEPS: [f32; WIDTH] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let Window { x, y, .. } = self.window;
        let along = |axis: usize, first: i32, place: f64| {
            let distance = place - (f64::from(first) + 0.5);
            let densities = self.gains[axis] * filter.densities(f32x8::splat(distance as f32) - f32x8::new(STEPS));
            let sum = densities.reduce_add();
            if sum > 0.0 {
                return densities / f32x8::splat(sum);
            }
            // By rounding at the very end of its own filter.
            let mut own = [0.0; WIDTH];
            own[(pixel[axis] - first) as usize] = 1.0;
            f32x8::new(own)
        };
        [along(0, x, place.x), along(1, y, place.y)]
    }
}

/// What is dealt out of a sample besides its layers: X, Y, Z, coverage, and one.
const NUMBERS: usize = 5;

/// Sums of samples of one number of all pixels of a block.
pub struct Pool {
    /// Row by row.
    light: [[f32x8; NUMBERS]; WIDTH],
    /// Row by row, and in a row channel by channel.
    layers: Vec<f32x8>,
    channels: usize,
    /// The pixels whose own sample is there.
    own: [bool; PIXELS],
    /// Of pixels by their places in the block: X, Y, Z and the numbers of the layers that their samples have for them alone.
    alone: Vec<(usize, [f32; 3], Vec<f32>)>,
}

/// What samples come to in a pixel.
pub struct Dealt {
    /// X, Y, Z.
    pub xyz: [f32; 3],
    /// Coverage.
    pub alpha: f32,
    /// What they count for.
    pub weight: f32,
}

impl Default for Pool {
    fn default() -> Pool {
        Pool {
            light: [[f32x8::ZERO; NUMBERS]; WIDTH],
            layers: Vec::new(),
            channels: 0,
            own: [false; PIXELS],
            alone: Vec::new(),
        }
    }
}

impl Pool {
    /// Empties it, for samples with the numbers of `channels`.
    pub fn reset(&mut self, channels: usize) {
        self.light = [[f32x8::ZERO; NUMBERS]; WIDTH];
        self.own = [false; PIXELS];
        self.channels = channels;
        self.alone.clear();
        self.layers.clear();
        self.layers.resize(WIDTH * channels, f32x8::ZERO);
    }

    /// Deals out the sample of `pixel` of `block` at `place`.
    ///
    /// # Panics
    /// If the pixel lies beyond the block.
    pub fn add(
        &mut self,
        block: &Block,
        filter: &FilterSampler,
        (pixel, place): ([i32; 2], DVec2),
        (xyz, alpha): ([f32; 3], f32),
        values: &[f32],
    ) {
        self.own[block.window.index(pixel).expect("the pixel lies in the block")] = true;
        let [columns, rows] = block.shares(filter, pixel, place);
        let [x, y, z] = xyz;
        let numbers = [x, y, z, alpha, 1.0].map(f32x8::splat);
        for (row, share) in rows.to_array().into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
            let weights = columns * f32x8::splat(share);
            for (sum, number) in self.light[row].iter_mut().zip(numbers) {
                *sum = weights.mul_add(number, *sum);
            }
            for (sum, value) in self.layers[row * self.channels..].iter_mut().zip(values) {
                *sum = weights.mul_add(f32x8::splat(*value), *sum);
            }
        }
    }

    /// Adds what the sample of `pixel` of `block` has for that alone.
    ///
    /// # Panics
    /// If the pixel lies beyond the block.
    pub fn add_alone(&mut self, block: &Block, pixel: [i32; 2], xyz: [f32; 3], values: &[f32]) {
        let place = block.window.index(pixel).expect("the pixel lies in the block");
        self.alone.push((place, xyz, values.to_vec()));
    }

    /// What it comes to in each pixel of `block` whose own sample is there, with its place in the block and the numbers of the layers.
    pub fn deal(&self, block: &Block, mut give: impl FnMut(([i32; 2], usize), &Dealt, &[f32])) {
        let Window { x, y, width, height } = block.window;
        let mut numbers = vec![0.0; self.channels];
        for row in 0..height as usize {
            let [xs, ys, zs, alphas, weights] = self.light[row].each_ref().map(f32x8::as_array);
            for column in 0..width as usize {
                let place = row * width as usize + column;
                if !self.own[place] {
                    continue;
                }
                let layers = &self.layers[row * self.channels..];
                numbers.iter_mut().zip(layers).for_each(|(number, sum)| *number = sum.as_array()[column]);
                let weight = weights[column];
                let mut xyz = [xs[column], ys[column], zs[column]];
                for (_, light, values) in self.alone.iter().filter(|(at, ..)| *at == place) {
                    xyz.iter_mut().zip(light).for_each(|(sum, x)| *sum += weight * x);
                    numbers.iter_mut().zip(values).for_each(|(sum, x)| *sum += weight * x);
                }
                let dealt = Dealt { xyz, alpha: alphas[column], weight };
                give(([x + column as i32, y + row as i32], place), &dealt, &numbers);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::filter::Filter;

    /// Of independent samples a pixel q has the variance of ∫f_q w_q = ∫f_q² / Σf, along each axis: for a Gaussian of 0.5 pixels
    /// 1 / (2√π σ) in the middle, where Σf is 1 to 2 exp(−2π²σ²) = 1.4 %; 0.38 in the mean over a cell. By the midpoint rule.
    #[test]
    fn a_gaussian_of_half_a_pixel_leaves_four_tenths_of_the_noise() {
        let filter = FilterSampler::new(Filter::Gaussian { stddev: 0.5 }).unwrap();
        let block = Block::new(Window::full(SIDE, SIDE), &filter);
        const STEPS: u32 = 4096;
        let (low, step) = (-2.0, 12.0 / f64::from(STEPS));
        let (mut shares, mut whole) = ([0.0; WIDTH], 0.0);
        for i in 0..STEPS {
            let x = low + (f64::from(i) + 0.5) * step;
            let [columns, _] = block.shares(&filter, [0, 0], DVec2::new(x, 0.5));
            for (c, share) in shares.iter_mut().enumerate() {
                let density = filter.densities(f32x8::splat((x - (c as f64 + 0.5)) as f32)).as_array()[0];
                *share += f64::from(columns.as_array()[c] * density);
                whole += f64::from(density) / WIDTH as f64;
            }
        }
        let shares = shares.map(|share| share / whole);
        let middle = 1.0 / (2.0 * std::f64::consts::PI.sqrt() * 0.5);
        assert!((shares[3] / middle - 1.0).abs() < 0.014, "{shares:?}");
        let mean = shares.iter().sum::<f64>() / WIDTH as f64;
        assert!((mean * mean - 0.38).abs() < 0.005, "{shares:?}");
    }
}
