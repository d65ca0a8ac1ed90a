//! Further channels of a picture, besides colour and coverage: bands of the spectrum, what the camera sees of the
//! surfaces, light of other integrators, squares.
//!
//! A layer is a number a sample. Numbers are added exactly, as in [`accumulate`](super::accumulate), in one sum a
//! pixel and channel and one count a pixel; a picture without layers has neither. What cannot be added is left out
//! of all layers of its pixel and counted by cause; colour does not hear of it.

use super::Window;
use super::accumulate::{Invalid, InvalidCounts, SAMPLE_LIMIT, SAMPLES_LIMIT, Sum};
use super::mattes::Mattes;
use super::run::LayerRun;

/// Sums of all layers of a window, pixel by pixel in raster order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LayerSums {
    channels: usize,
    sums: Vec<Sum>,
    counts: Vec<u32>,
    /// Who covers the pixels.
    pub mattes: Mattes,
    /// Samples that were left out.
    pub invalid: InvalidCounts,
}

impl LayerSums {
    /// Empty sums of `channels` numbers for each of `pixels`.
    #[must_use]
    pub fn new(channels: usize, pixels: usize) -> LayerSums {
        let mut sums = LayerSums::default();
        sums.reset(channels, pixels);
        sums
    }

    /// Empties the sums, keeping their memory.
    pub fn reset(&mut self, channels: usize, pixels: usize) {
        self.channels = channels;
        self.sums.clear();
        self.counts.clear();
        self.mattes.clear();
        self.invalid = InvalidCounts::default();
        if channels > 0 {
            self.sums.resize(channels * pixels, Sum::default());
            self.counts.resize(pixels, 0);
        }
    }

    /// The memory that they take.
    #[must_use]
    pub fn bytes(channels: usize, pixels: usize) -> u64 {
        let pixel = if channels == 0 { 0 } else { size_of::<Sum>() * channels + size_of::<u32>() };
        pixels as u64 * pixel as u64
    }

    /// How many numbers a sample has.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Sums pixel by pixel, the channels of one together, and the count of each pixel.
    #[must_use]
    pub fn parts(&self) -> (&[Sum], &[u32]) {
        (&self.sums, &self.counts)
    }

    /// [`LayerSums::parts`], for sums that were read from a file.
    pub fn parts_mut(&mut self) -> (&mut [Sum], &mut [u32]) {
        (&mut self.sums, &mut self.counts)
    }

    /// Adds a sample of the pixel at `index`: its numbers times the filter's `weight`.
    ///
    /// # Panics
    /// If there are not as many numbers as channels.
    pub fn add(&mut self, index: usize, weight: f32, values: &[f32]) {
        assert_eq!(values.len(), self.channels, "a number for each channel");
        if self.channels == 0 {
            return;
        }
        if let Some(cause) = values.iter().find_map(|x| fault(x * weight)) {
            self.invalid.record(cause);
            return;
        }
        if self.counts[index] >= SAMPLES_LIMIT {
            self.invalid.record(Invalid::Overflow);
            return;
        }
        let start = index * self.channels;
        for (sum, x) in self.sums[start..start + self.channels].iter_mut().zip(values) {
            // The check above leaves nothing to refuse.
            let _ = sum.add(x * weight);
        }
        self.counts[index] += 1;
    }

    /// Adds what stands in a pixel once, however many samples it has: the number of each of `channels`.
    pub fn add_once(&mut self, index: usize, values: impl IntoIterator<Item = (usize, f32)>) {
        for (channel, x) in values {
            match fault(x) {
                Some(cause) => self.invalid.record(cause),
                None => {
                    let _ = self.sums[index * self.channels + channel].add(x);
                }
            }
        }
    }

    /// Adds the samples of a run to the pixel at `index`.
    ///
    /// # Panics
    /// If the run has other channels.
    pub fn add_run(&mut self, index: usize, run: &LayerRun) {
        if self.counts[index] + run.count() > SAMPLES_LIMIT {
            self.invalid.overflow += u64::from(run.count());
            return;
        }
        let start = index * self.channels;
        for (sum, part) in self.sums[start..start + self.channels].iter_mut().zip(run.sums()) {
            *sum += part;
        }
        self.counts[index] += run.count();
    }

    /// Adds the sums of `part`, which cover `inner`, to these, which cover `window` around it.
    ///
    /// # Panics
    /// If the channels differ or `inner` reaches beyond `window`.
    pub fn merge(&mut self, window: Window, part: &LayerSums, inner: Window) {
        assert_eq!(self.channels, part.channels, "sums of the same layers");
        self.invalid += part.invalid;
        self.mattes.merge(window, &part.mattes, inner);
        if self.channels == 0 {
            return;
        }
        for from in 0..inner.pixels() {
            let (column, row) = (from % inner.width as usize, from / inner.width as usize);
            let place = [inner.x + column as i32, inner.y + row as i32];
            let to = window.index(place).expect("the part lies in the window");
            if self.counts[to] + part.counts[from] > SAMPLES_LIMIT {
                self.invalid.overflow += u64::from(part.counts[from]);
                continue;
            }
            self.counts[to] += part.counts[from];
            for c in 0..self.channels {
                self.sums[to * self.channels + c] += part.sums[from * self.channels + c];
            }
        }
    }

    /// The sums of one channel, pixel by pixel.
    pub fn sums_of(&self, channel: usize) -> impl Iterator<Item = f64> {
        self.sums.iter().skip(channel).step_by(self.channels.max(1)).map(|sum| sum.value())
    }

    /// The means of one channel, pixel by pixel; 0 where there is no sample.
    #[must_use]
    pub fn plane(&self, channel: usize) -> Vec<f32> {
        let sums = self.sums.iter().skip(channel).step_by(self.channels.max(1));
        sums.zip(&self.counts).map(|(sum, &n)| if n == 0 { 0.0 } else { (sum.value() / f64::from(n)) as f32 }).collect()
    }
}

/// Why `x` cannot be added, if it cannot.
fn fault(x: f32) -> Option<Invalid> {
    if x.abs() < SAMPLE_LIMIT {
        None
    } else if x.is_nan() {
        Some(Invalid::Nan)
    } else if x.is_infinite() {
        Some(Invalid::Infinite)
    } else {
        Some(Invalid::Overflow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two channels over 2 × 2 pixels, filled in one go, and as a right and a left column merged in either order.
    #[test]
    fn layers_do_not_depend_on_order_or_split() {
        let window = Window { x: 4, y: -1, width: 2, height: 2 };
        let sample = |i: usize| (i % 4, [0.1 * i as f32 - 3.0, 1e9 / (i + 1) as f32], 1.0 - 0.3 * (i % 5) as f32);
        let mut whole = LayerSums::new(2, 4);
        let mut halves = [LayerSums::new(2, 2), LayerSums::new(2, 2)];
        for i in 0..1000 {
            let (pixel, values, weight) = sample(i);
            whole.add(pixel, weight, &values);
        }
        for i in (0..1000).rev() {
            let (pixel, values, weight) = sample(i);
            halves[pixel % 2].add(pixel / 2, weight, &values);
        }
        for order in [[0, 1], [1, 0]] {
            let mut merged = LayerSums::new(2, 4);
            for half in order {
                merged.merge(window, &halves[half], Window { x: 4 + half as i32, y: -1, width: 1, height: 2 });
            }
            assert_eq!(merged, whole);
        }
    }

    #[test]
    fn what_is_not_a_number_is_counted_and_left_out() {
        let mut sums = LayerSums::new(2, 1);
        sums.add(0, 1.0, &[1.0, f32::NAN]);
        sums.add(0, 1.0, &[f32::INFINITY, 1.0]);
        sums.add(0, 2.0, &[1.5, -1.0]);
        assert_eq!((sums.plane(0), sums.plane(1)), (vec![3.0], vec![-2.0]));
        assert_eq!(sums.invalid, InvalidCounts { nan: 1, infinite: 1, negative: 0, overflow: 0 });
    }

    #[test]
    fn a_picture_without_layers_takes_no_memory_for_them() {
        assert_eq!(LayerSums::bytes(0, 1 << 20), 0);
        assert_eq!(LayerSums::new(0, 1 << 20), LayerSums::default());
    }
}
