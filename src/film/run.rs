//! Runs: the samples of one pixel that are rendered one after the other, summed without rounding in floating point
//! before they go to the film's integers.
//!
//! A number x is split into a multiple of 2⁻²⁰, the nearest to x, and the rest, rounded to a multiple of the film's
//! unit of 2⁻⁶⁴. Sums of either are exact in f64:
//!
//! | | unit | one number | numbers | sum |
//! |---|---|---|---|---|
//! | high | 2⁻²⁰ | < 2¹⁶ + 2⁻²⁰ | 2¹⁰ | ≤ 2⁴⁶ + 2¹⁰ units |
//! | low | 2⁻⁶⁴ | ≤ 2⁻²¹ | 2¹⁰ | ≤ 2⁵³ units |
//!
//! The high part is an even number of units of the low one, so that both together are x rounded once to the nearest
//! unit, ties to even: the integer that the film would have added. Four numbers are done side by side.

use super::accumulate::{ALPHA_LIMIT, ALPHA_QUANTUM, Cell, QUANTUM, Sum};
use wide::f64x4;

/// The unit of the high parts: 2⁻²⁰.
const STEP: f64 = 1.0 / 1_048_576.0;

/// Numbers of this magnitude or more do not fit a run: 2¹⁶.
const LIMIT: f32 = 65_536.0;

/// Samples of a run at the most.
pub const LONGEST: u32 = 1 << 10;

/// Added to x, 1.5 · 2⁵² units put the last bit of the sum at the unit: it rounds x to a multiple of the unit where
/// |x| < 2⁵¹ units.
const fn rounder(unit: f64) -> f64 {
    1.5 * 4_503_599_627_370_496.0 * unit
}

/// Sums of four numbers.
#[derive(Clone, Copy, Debug, Default)]
struct Quad {
    high: f64x4,
    low: f64x4,
}

impl Quad {
    /// Adds four numbers; the high parts have the units of `rounders`.
    #[inline]
    fn add(&mut self, x: [f32; 4], rounders: f64x4) {
        let x = f64x4::from(x.map(f64::from));
        let high = (x + rounders) - rounders;
        // Exact: the rest of an f32 less some of its leading bits.
        let low = x - high;
        self.high += high;
        self.low += (low + f64x4::splat(rounder(QUANTUM))) - f64x4::splat(rounder(QUANTUM));
    }

    fn sums(&self) -> [Sum; 4] {
        let (high, low) = (self.high.to_array(), self.low.to_array());
        // Divisions by powers of two, and whole numbers below 2⁵⁴: exact.
        std::array::from_fn(
            |i| Sum((i128::from((high[i] / STEP) as i64) << 44) + i128::from((low[i] / QUANTUM) as i64)),
        )
    }
}

/// Colour and coverage of one replicate of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Run {
    sums: Quad,
    count: u32,
    /// What the samples count for, a whole number of [`ALPHA_QUANTUM`], where they do by weights.
    weight: f64,
}

impl Run {
    /// Adds a sample. False where it does not fit; then it is not in the run.
    #[must_use]
    #[inline]
    pub fn add(&mut self, xyz: [f32; 3], alpha: f32) -> bool {
        let [x, y, z] = xyz;
        // Numbers that are not compare as greater.
        let fits = x.abs() < LIMIT && y.abs() < LIMIT && z.abs() < LIMIT && alpha.abs() < ALPHA_LIMIT;
        if !fits || self.count >= LONGEST {
            return false;
        }
        // Coverage is rounded to its own unit at once: |a| < 2³⁸ units, 2⁴⁸ a run.
        const ROUNDERS: [f64; 4] = [rounder(STEP), rounder(STEP), rounder(STEP), rounder(ALPHA_QUANTUM)];
        self.sums.add([x, y, z, alpha], f64x4::new(ROUNDERS));
        self.count += 1;
        true
    }

    /// What the last sample counts for.
    #[inline]
    pub fn weigh(&mut self, weight: f32) {
        self.weight += rounded(weight);
    }

    /// What the samples count for, in [`ALPHA_QUANTUM`].
    #[must_use]
    pub fn weight_units(&self) -> i64 {
        (self.weight / ALPHA_QUANTUM) as i64
    }

    /// The sums of the run as those of a cell.
    #[must_use]
    pub fn cell(&self) -> Cell {
        let [x, y, z, _] = self.sums.sums();
        let alpha = (self.sums.high.to_array()[3] / ALPHA_QUANTUM) as i64;
        Cell { xyz: [x, y, z], alpha, count: self.count, dropped: 0 }
    }
}

/// `weight` to the nearest multiple of [`ALPHA_QUANTUM`], as coverage is.
fn rounded(weight: f32) -> f64 {
    (f64::from(weight) + rounder(ALPHA_QUANTUM)) - rounder(ALPHA_QUANTUM)
}

/// The layers of a pixel.
#[derive(Clone, Debug, Default)]
pub struct LayerRun {
    sums: Vec<Quad>,
    count: u32,
}

impl LayerRun {
    /// Empties the run, for samples of `channels` numbers.
    pub fn reset(&mut self, channels: usize) {
        self.sums.clear();
        self.sums.resize(channels.div_ceil(4), Quad::default());
        self.count = 0;
    }

    /// Adds a sample: its numbers times the filter's `weight`. False where one does not fit; then none is in the run.
    #[must_use]
    #[inline]
    pub fn add(&mut self, weight: f32, values: &[f32]) -> bool {
        let fits = values.iter().fold(true, |all, x| all & ((x * weight).abs() < LIMIT));
        if !fits || self.count >= LONGEST {
            return false;
        }
        let rounders = f64x4::splat(rounder(STEP));
        let (quads, rest) = values.as_chunks();
        for (sums, x) in self.sums.iter_mut().zip(quads) {
            sums.add(x.map(|x: f32| x * weight), rounders);
        }
        if !rest.is_empty() {
            let last = std::array::from_fn(|i| rest.get(i).map_or(0.0, |x| x * weight));
            self.sums[quads.len()].add(last, rounders);
        }
        self.count += 1;
        true
    }

    /// The sums of all channels, and those that fill up the last four.
    pub(super) fn sums(&self) -> impl Iterator<Item = Sum> {
        self.sums.iter().flat_map(Quad::sums)
    }

    /// How many samples are in the sums.
    pub(super) fn count(&self) -> u32 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Window;
    use crate::film::accumulate::TileBuffer;
    use crate::film::layers::{LayerSums, Layout};
    use crate::math::sampler::mix64;

    /// Numbers of both signs and any exponent up to 2¹⁵, some of them halfway between two units of either part.
    fn number(i: u64) -> f32 {
        let h = mix64(i);
        let scale = 2f32.powi((h >> 32) as i32 % 50 - 66 + 31 * (h >> 40 & 1) as i32);
        let mantissa = if h >> 41 & 3 == 0 { (h as i32 >> 20) as f32 + 0.5 } else { h as i32 as f32 / 65_536.0 };
        (mantissa * scale).clamp(-32_768.0, 32_768.0)
    }

    /// As many samples as a run takes, and again one by one.
    #[test]
    fn a_run_has_the_bits_of_its_samples() {
        for start in 0..40 {
            let (mut run, mut tile) = (Run::default(), TileBuffer::new(Window::full(1, 1)));
            for i in 0..u64::from(LONGEST) {
                let [x, y, z, a] = [0, 1, 2, 3].map(|c| number((start << 32) + 4 * i + c));
                let alpha = a.clamp(-2.0, 2.0);
                assert!(run.add([x, y, z], alpha));
                tile.add([0, 0], 0, [x, y, z], alpha);
            }
            assert!(!run.add([0.0; 3], 0.0), "a run ends");
            let mut found = TileBuffer::new(Window::full(1, 1));
            found.add_run([0, 0], 0, &run);
            assert_eq!(found, tile);
        }
    }

    /// The largest numbers that fit add up exactly, and so do the largest rests: half a unit of the high part less a
    /// unit of the low one.
    #[test]
    fn the_largest_sums_fit() {
        for x in [LIMIT.next_down(), (0.5 * STEP) as f32, (0.5 * STEP) as f32 * (1.0 - f32::EPSILON)] {
            let mut run = Run::default();
            (0..LONGEST).for_each(|_| assert!(run.add([x, -x, x], 1.0)));
            let mut one = Sum::default();
            one.add(x).unwrap();
            let all = one.0 * i128::from(LONGEST);
            assert_eq!(run.cell().xyz, [Sum(all), Sum(-all), Sum(all)], "{x:e}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_whole() {
        let mut run = Run::default();
        let mut layers = LayerRun::default();
        layers.reset(2);
        for bad in [f32::NAN, f32::INFINITY, LIMIT, -LIMIT] {
            assert!(!run.add([1.0, bad, 1.0], 1.0) && !layers.add(1.0, &[1.0, bad]));
        }
        assert!(!run.add([1.0; 3], ALPHA_LIMIT) && !run.add([1.0; 3], f32::NAN));
        assert_eq!((run.cell(), layers.count()), (Cell::default(), 0));
    }

    /// Six channels: a whole quad and a half.
    #[test]
    fn a_run_of_layers_has_the_bits_of_its_samples() {
        let layout = Layout { channels: 6, ..Layout::default() };
        let (mut run, mut found, mut expected) =
            (LayerRun::default(), LayerSums::new(layout, 2), LayerSums::new(layout, 2));
        run.reset(6);
        for i in 0..u64::from(LONGEST) {
            let values: [f32; 6] = std::array::from_fn(|c| number(6 * i + c as u64));
            let weight = if i % 3 == 0 { -0.75 } else { 1.5 };
            assert!(run.add(weight, &values));
            expected.add(1, 0, weight, &values);
        }
        found.add_run(1, 0, &run);
        assert_eq!(found, expected);
    }
}
