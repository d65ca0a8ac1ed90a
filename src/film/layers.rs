//! Further channels of a picture, besides colour and coverage: bands of the spectrum, what the camera sees of the
//! surfaces, light of other integrators, squares.
//!
//! A layer is a number a sample. Numbers are added exactly, as in [`accumulate`](super::accumulate), in one sum a
//! pixel and channel and one count a pixel; a picture without layers has neither. Where standard errors are wanted or
//! samples are shared out by noise, a pixel has a sum and a count for each replicate. What cannot be added is left out of
//! its own channel and counted by cause; colour does not hear of it.

use super::Window;
use super::accumulate::{
    ALPHA_QUANTUM, Invalid, InvalidCounts, REPLICATES, SAMPLE_LIMIT, SAMPLES_LIMIT, Sum, check, fill,
};
use super::mattes::Mattes;
use super::resolve::{HALF, even, mean_of_replicates};
use super::run::LayerRun;
use rayon::prelude::*;

/// How many sums a pixel has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// Numbers of a sample.
    pub channels: usize,
    /// Which samples share their sums.
    pub kept: Kept,
}

/// Which samples of a pixel are added up together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kept {
    /// All of them.
    #[default]
    Together,
    /// Those of a replicate, so that the spread of the replicates tells the error.
    ByReplicate,
    /// Those of a replicate, where they count by weights, as a sample does that goes to several pixels: see
    /// [`resolve`](super::resolve).
    Weighed,
}

impl Kept {
    /// How many sums a channel has.
    #[must_use]
    pub fn sets(self) -> usize {
        match self {
            Kept::Together => 1,
            Kept::ByReplicate | Kept::Weighed => REPLICATES,
        }
    }

    /// Which of them a sample of `replicate` is in.
    #[must_use]
    pub fn set(self, replicate: usize) -> usize {
        match self {
            Kept::Together => 0,
            Kept::ByReplicate | Kept::Weighed => replicate,
        }
    }

    /// How sums are kept to which no sample goes by a weight.
    #[must_use]
    pub fn without_weights(self) -> Kept {
        if self == Kept::Weighed { Kept::ByReplicate } else { self }
    }
}

/// Sums of all layers of a window, pixel by pixel in raster order, and in a pixel set by set.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LayerSums {
    layout: Layout,
    sums: Vec<Sum>,
    counts: Vec<u32>,
    /// What the samples of each replicate of each pixel count for together, in [`ALPHA_QUANTUM`], colour and layers alike.
    weights: Vec<i64>,
    /// Who covers the pixels.
    pub mattes: Mattes,
    /// Samples that were left out.
    pub invalid: InvalidCounts,
}

impl LayerSums {
    /// Empty sums for each of `pixels`.
    #[must_use]
    pub fn new(layout: Layout, pixels: usize) -> LayerSums {
        let mut all = LayerSums { layout, ..LayerSums::default() };
        let (sets, weights) = LayerSums::sizes(layout, pixels);
        fill(&mut all.sums, layout.channels * sets);
        fill(&mut all.counts, sets);
        fill(&mut all.weights, weights);
        all
    }

    /// How many sets have numbers, and how many weights.
    fn sizes(Layout { channels, kept }: Layout, pixels: usize) -> (usize, usize) {
        let sets = if channels > 0 { kept.sets() * pixels } else { 0 };
        (sets, if kept == Kept::Weighed { REPLICATES * pixels } else { 0 })
    }

    /// Empties the sums, keeping their memory.
    pub fn reset(&mut self, layout: Layout, pixels: usize) {
        self.layout = layout;
        self.sums.clear();
        self.counts.clear();
        self.weights.clear();
        self.mattes.clear();
        self.invalid = InvalidCounts::default();
        let (sets, weights) = LayerSums::sizes(layout, pixels);
        self.sums.resize(layout.channels * sets, Sum::default());
        self.counts.resize(sets, 0);
        self.weights.resize(weights, 0);
    }

    /// The memory that they take.
    #[must_use]
    pub fn bytes(Layout { channels, kept }: Layout, pixels: usize) -> u64 {
        let sums = if channels == 0 { 0 } else { size_of::<Sum>() * channels + size_of::<u32>() };
        let weight = if kept == Kept::Weighed { size_of::<i64>() } else { 0 };
        pixels as u64 * kept.sets() as u64 * (sums + weight) as u64
    }

    /// How many numbers a sample has, and whose sums they are in.
    #[must_use]
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// How many numbers a sample has.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.layout.channels
    }

    /// The place of the set in which samples of `replicate` of the pixel at `index` are: of its count, and over the channels
    /// of its first sum.
    #[must_use]
    pub fn place(&self, index: usize, replicate: usize) -> usize {
        index * self.layout.kept.sets() + self.layout.kept.set(replicate)
    }

    /// Sums set by set, the channels of one together, and the count of each set; [`LayerSums::place`] tells where.
    #[must_use]
    pub fn parts(&self) -> (&[Sum], &[u32]) {
        (&self.sums, &self.counts)
    }

    /// [`LayerSums::parts`], for sums that were read from a file.
    pub fn parts_mut(&mut self) -> (&mut [Sum], &mut [u32]) {
        (&mut self.sums, &mut self.counts)
    }

    /// What the samples of each replicate of the pixel at `index` count for together, where they count by weights.
    #[must_use]
    pub fn weights(&self, index: usize) -> Option<[f64; REPLICATES]> {
        let own = self.weights.get(index * REPLICATES..)?.first_chunk::<REPLICATES>()?;
        Some(own.map(|units| units as f64 * ALPHA_QUANTUM))
    }

    /// Those of all pixels, replicate by replicate, in [`ALPHA_QUANTUM`].
    #[must_use]
    pub fn weight_units(&self) -> &[i64] {
        &self.weights
    }

    /// [`LayerSums::weight_units`], for sums that were read from a file.
    pub fn weight_units_mut(&mut self) -> &mut [i64] {
        &mut self.weights
    }

    /// Adds what samples of `replicate` of the pixel at `index` count for, in [`ALPHA_QUANTUM`], if they count by weights.
    pub fn weigh(&mut self, index: usize, replicate: usize, units: i64) {
        if let Some(weight) = self.weights.get_mut(index * REPLICATES + replicate) {
            *weight += units;
        }
    }

    /// Adds a sample of `replicate` of the pixel at `index`: its numbers times the filter's `weight`. One that no sum can hold
    /// is nothing, and the sample is counted among the invalid ones; the others are none the worse for it.
    ///
    /// # Panics
    /// If there are not as many numbers as channels.
    pub fn add(&mut self, index: usize, replicate: usize, weight: f32, values: &[f32]) {
        let channels = self.layout.channels;
        assert_eq!(values.len(), channels, "a number for each channel");
        if channels == 0 {
            return;
        }
        if let Some(cause) = values.iter().find_map(|x| fault(x * weight)) {
            self.invalid.record(cause);
        }
        let place = self.place(index, replicate);
        if self.counts[place] >= SAMPLES_LIMIT {
            self.invalid.record(Invalid::Overflow);
            return;
        }
        for (sum, x) in self.sums[place * channels..][..channels].iter_mut().zip(values) {
            // What is refused is counted above.
            let _ = sum.add(x * weight);
        }
        self.counts[place] += 1;
    }

    /// Adds what stands in a pixel once, however many samples it has: the number of each of `channels`. It is kept by its bits, as
    /// nothing is added to it: places may be farther away than a sum of samples holds.
    pub fn add_once(&mut self, index: usize, values: impl IntoIterator<Item = (usize, f32)>) {
        let start = self.place(index, 0) * self.layout.channels;
        for (channel, x) in values {
            match check(x, f32::INFINITY) {
                Err(cause) => self.invalid.record(cause),
                Ok(()) => self.sums[start + channel].0 += i128::from(x.to_bits()),
            }
        }
    }

    /// Adds the samples of a run to `replicate` of the pixel at `index`.
    ///
    /// # Panics
    /// If the run has other channels.
    pub fn add_run(&mut self, index: usize, replicate: usize, run: &LayerRun) {
        let (place, channels) = (self.place(index, replicate), self.layout.channels);
        if self.counts[place] + run.count() > SAMPLES_LIMIT {
            self.invalid.overflow += u64::from(run.count());
            return;
        }
        for (sum, part) in self.sums[place * channels..][..channels].iter_mut().zip(run.sums()) {
            *sum += part;
        }
        self.counts[place] += run.count();
    }

    /// Adds the sums of `part`, which cover `inner`, to these, which cover `window` around it.
    ///
    /// # Panics
    /// If the channels differ or `inner` reaches beyond `window`.
    pub fn merge(&mut self, window: Window, part: &LayerSums, inner: Window) {
        assert_eq!(self.layout, part.layout, "sums of the same layers");
        self.invalid += part.invalid;
        self.mattes.merge(window, &part.mattes, inner);
        let Layout { channels, kept } = self.layout;
        if channels == 0 && kept != Kept::Weighed {
            return;
        }
        for pixel in 0..inner.pixels() {
            let (column, row) = (pixel % inner.width as usize, pixel / inner.width as usize);
            let place = [inner.x + column as i32, inner.y + row as i32];
            let to = window.index(place).expect("the part lies in the window");
            for (replicate, units) in part.weights.iter().skip(pixel * REPLICATES).take(REPLICATES).enumerate() {
                self.weigh(to, replicate, *units);
            }
            if channels == 0 {
                continue;
            }
            for set in 0..kept.sets() {
                let (from, to) = (part.place(pixel, set), self.place(to, set));
                if self.counts[to] + part.counts[from] > SAMPLES_LIMIT {
                    self.invalid.overflow += u64::from(part.counts[from]);
                    continue;
                }
                self.counts[to] += part.counts[from];
                for c in 0..channels {
                    self.sums[to * channels + c] += part.sums[from * channels + c];
                }
            }
        }
    }

    /// The sums of one channel, pixel by pixel: of each set, and how many samples are in it.
    fn sets_of(&self, channel: usize) -> impl IndexedParallelIterator<Item = impl Iterator<Item = (Sum, u32)> + Clone> {
        let Layout { channels, kept } = self.layout;
        let sums = self.sums.par_chunks_exact((channels * kept.sets()).max(1));
        let pixels = sums.zip(self.counts.par_chunks_exact(kept.sets())).with_min_len(1024);
        pixels.map(move |(sums, counts)| {
            let own = sums.iter().skip(channel).step_by(channels.max(1)).copied();
            own.zip(counts.iter().copied())
        })
    }

    /// The means of the `sets` of the pixel at `index`, with what the weights lack made up for, and their samples, where samples
    /// count by weights.
    fn evened(
        &self,
        index: usize,
        sets: &(impl Iterator<Item = (Sum, u32)> + Clone),
    ) -> Option<([[f64; 1]; REPLICATES], [u64; REPLICATES])> {
        let weights = self.weights(index)?;
        let (mut means, mut counts) = ([[0.0]; REPLICATES], [0; REPLICATES]);
        for (r, (sum, n)) in sets.clone().enumerate().filter(|(_, (_, n))| *n > 0) {
            (means[r], counts[r]) = ([sum.value() / f64::from(n)], u64::from(n));
        }
        even(&mut means, counts, weights);
        Some((means, counts))
    }

    /// The sums of one channel, pixel by pixel.
    #[must_use]
    pub fn sums_of(&self, channel: usize) -> Vec<f64> {
        self.sets_of(channel).map(|sets| total(sets).0).collect()
    }

    /// What [`LayerSums::add_once`] put into one channel, pixel by pixel; 0 where that is nothing.
    #[must_use]
    pub fn once(&self, channel: usize) -> Vec<f32> {
        let pixels = self.sets_of(channel).map(|sets| sets.map(|(Sum(bits), _)| bits).sum::<i128>());
        pixels.map(|bits| f32::from_bits(bits as u32)).collect()
    }

    /// The means of one channel, pixel by pixel, as [`resolve`](super::resolve) has them; 0 where there is no sample.
    #[must_use]
    pub fn plane(&self, channel: usize) -> Vec<f32> {
        let mean = |(sum, n): (f64, u64)| if n == 0 { 0.0 } else { sum / n as f64 };
        let value = |(index, sets)| match (self.evened(index, &sets), halves(&sets)) {
            (None, Some([a, b])) => 0.5 * (mean(a) + mean(b)),
            (None, None) => mean(total(sets)),
            (Some((means, counts)), halves) => mean_of_replicates(&means, counts, halves.is_some())[0],
        };
        self.sets_of(channel).enumerate().map(|pixel| value(pixel) as f32).collect()
    }

    /// The mean of each replicate of a channel of the pixel at `index`, its sums over `divisors` or how many samples it has; `None`
    /// where one has none, and where sums are not kept by replicate.
    #[must_use]
    pub fn replicates(
        &self,
        index: usize,
        channel: usize,
        divisors: Option<[u64; REPLICATES]>,
    ) -> Option<[f64; REPLICATES]> {
        let means = self.replicates_or_zero(index, channel, divisors)?;
        (!self.divisors(index, divisors).contains(&0)).then_some(means)
    }

    /// The same, zero of replicates without samples; `None` where sums are not kept by replicate.
    #[must_use]
    pub fn replicates_or_zero(
        &self,
        index: usize,
        channel: usize,
        divisors: Option<[u64; REPLICATES]>,
    ) -> Option<[f64; REPLICATES]> {
        let Layout { channels, kept: Kept::ByReplicate | Kept::Weighed } = self.layout else { return None };
        let counts = self.divisors(index, divisors);
        let mean = |replicate: usize| match counts[replicate] {
            0 => 0.0,
            count => self.sums[self.place(index, replicate) * channels + channel].value() / count as f64,
        };
        let mut means = std::array::from_fn(|replicate| [mean(replicate)]);
        if let Some(weights) = self.weights(index) {
            even(&mut means, counts, weights);
        }
        Some(means.map(|[x]| x))
    }

    /// What the sums of the replicates of the pixel at `index` are divided by: what is `given`, or how many samples they have.
    fn divisors(&self, index: usize, given: Option<[u64; REPLICATES]>) -> [u64; REPLICATES] {
        given.unwrap_or_else(|| std::array::from_fn(|r| u64::from(self.counts[self.place(index, r)])))
    }

    /// The variances of the means of one channel, pixel by pixel, from the spread of the replicates as
    /// [`resolve`](super::resolve) has it. `divisors` are what the sums of a pixel's replicates are divided by, where that
    /// is not how many samples they have.
    ///
    /// NaN where fewer than two replicates have samples, and where sums are not kept by replicate.
    #[must_use]
    pub fn variances_of(&self, channel: usize, divisors: Option<[u64; REPLICATES]>) -> Vec<f64> {
        let variances = self.sets_of(channel).enumerate().map(|(index, sets)| {
            let alike = divisors.is_none() && are_halves(&sets);
            let evened = self.evened(index, &sets);
            let own = sets.enumerate().map(|(r, (sum, n))| match evened {
                Some((means, counts)) => (means[r][0], counts[r]),
                None => {
                    let n = divisors.map_or(u64::from(n), |all| all[r]);
                    (sum.value() / n as f64, n)
                }
            });
            // Where the halves weigh alike, so do their replicates, which take turns.
            let weight = |n: u64| if alike { 1.0 } else { n as f64 };
            variance_of_mean(own.filter(|(_, n)| *n > 0).map(|(mean, n)| (mean, weight(n))))
        });
        variances.collect()
    }
}

/// The sum of all sets, rounded once, and its samples.
fn total(sets: impl Iterator<Item = (Sum, u32)>) -> (f64, u64) {
    let (sum, count) = sets.fold((Sum::default(), 0), |(mut all, n), (own, count)| {
        all += own;
        (all, n + u64::from(count))
    });
    (sum.value(), count)
}

/// The sums of the halves of the replicates and their samples, where one half went on for longer than the other.
fn halves(sets: &(impl Iterator<Item = (Sum, u32)> + Clone)) -> Option<[(f64, u64); 2]> {
    are_halves(sets).then(|| [total(sets.clone().take(HALF)), total(sets.clone().skip(HALF))])
}

/// Whether there are [`halves`], which the numbers of samples tell.
fn are_halves(sets: &(impl Iterator<Item = (Sum, u32)> + Clone)) -> bool {
    let count = |sets: &mut dyn Iterator<Item = (Sum, u32)>| sets.map(|(_, n)| u64::from(n)).sum::<u64>();
    let [first, second] = [count(&mut sets.clone().take(HALF)), count(&mut sets.clone().skip(HALF))];
    first > 0 && second > 0 && first.abs_diff(second) > HALF as u64
}

/// Σᵣ nᵣ (mᵣ − m)² / ((R − 1) Σ nᵣ), given mᵣ and nᵣ.
fn variance_of_mean(replicates: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let (sum, total) = replicates.clone().fold((0.0, 0.0), |(sum, total), (m, n)| (sum + n * m, total + n));
    let mean = sum / total;
    let (squares, count) =
        replicates.fold((0.0, 0), |(squares, count), (m, n)| (squares + n * (m - mean).powi(2), count + 1));
    if count < 2 { f64::NAN } else { squares / (f64::from(count - 1) * total) }
}

/// Why `x` cannot be added, if it cannot.
#[must_use]
pub fn fault(x: f32) -> Option<Invalid> {
    check(x, SAMPLE_LIMIT).err()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two channels over 2 × 2 pixels, filled in one go, and as a right and a left column merged in either order.
    #[test]
    fn layers_do_not_depend_on_order_or_split() {
        let window = Window { x: 4, y: -1, width: 2, height: 2 };
        let sample = |i: usize| (i % 4, [0.1 * i as f32 - 3.0, 1e9 / (i + 1) as f32], 1.0 - 0.3 * (i % 5) as f32);
        for kept in [Kept::Together, Kept::ByReplicate] {
            let empty = |pixels| LayerSums::new(Layout { channels: 2, kept }, pixels);
            let (mut whole, mut halves) = (empty(4), [empty(2), empty(2)]);
            for i in 0..1000 {
                let (pixel, values, weight) = sample(i);
                whole.add(pixel, i / 7 % 4, weight, &values);
            }
            for i in (0..1000).rev() {
                let (pixel, values, weight) = sample(i);
                halves[pixel % 2].add(pixel / 2, i / 7 % 4, weight, &values);
            }
            for order in [[0, 1], [1, 0]] {
                let mut merged = empty(4);
                for half in order {
                    merged.merge(window, &halves[half], Window { x: 4 + half as i32, y: -1, width: 1, height: 2 });
                }
                assert_eq!(merged, whole);
            }
        }
    }

    /// Replicates of 2, 1, 0 and 3 samples with means 1, 4, – and 2: m = 12/6 = 2, and
    /// (2·1² + 1·2² + 3·0²)/((3 − 1)·6) = 1/2. Sums over divisors of their own, here 4, 4, 4 and 4, with means
    /// 1/2, 1, 0, 3/2: m = 3/4, and 4 (1/16 + 1/16 + 9/16 + 9/16)/(3·16) = 5/48.
    #[test]
    fn the_spread_of_replicates_is_the_variance_of_the_mean() {
        let mut sums = LayerSums::new(Layout { channels: 2, kept: Kept::ByReplicate }, 2);
        for (replicate, x) in [(0, 0.5), (0, 1.5), (1, 4.0), (3, 1.0), (3, 2.0), (3, 3.0)] {
            sums.add(1, replicate, 1.0, &[7.0, x]);
        }
        assert_eq!((sums.plane(0), sums.plane(1)), (vec![0.0, 7.0], vec![0.0, 2.0]));
        let variances = sums.variances_of(1, None);
        assert!(variances[0].is_nan() && variances[1] == 0.5, "{variances:?}");
        let variances = sums.variances_of(1, Some([4; 4]));
        assert!(variances[0] == 0.0 && (variances[1] - 5.0 / 48.0).abs() < 1e-15, "{variances:?}");
        // Halves that had 2 and 8 samples weigh alike: (1 + 2)/2, and with means 0, 2, 1 and 3 of the replicates
        // (9/4 + 1/4 + 1/4 + 9/4)/(4·3) = 5/12.
        let mut sums = LayerSums::new(Layout { channels: 1, kept: Kept::ByReplicate }, 1);
        for (replicate, count, x) in [(0, 1, 0.0), (1, 1, 2.0), (2, 4, 1.0), (3, 4, 3.0)] {
            (0..count).for_each(|_| sums.add(0, replicate, 1.0, &[x]));
        }
        let variance = sums.variances_of(0, None)[0];
        assert!(sums.plane(0) == [1.5] && (variance - 5.0 / 12.0).abs() < 1e-15, "{variance}");
        let together = LayerSums::new(Layout { channels: 1, kept: Kept::Together }, 1);
        assert!(together.variances_of(0, None).into_iter().all(f64::is_nan));
    }

    #[test]
    fn what_is_not_a_number_is_counted_and_is_nothing_of_its_own_channel_alone() {
        let mut sums = LayerSums::new(Layout { channels: 2, kept: Kept::Together }, 1);
        sums.add(0, 0, 1.0, &[1.0, f32::NAN]);
        sums.add(0, 1, 1.0, &[f32::INFINITY, 1.0]);
        sums.add(0, 2, 2.0, &[1.5, -1.0]);
        // (1 + 0 + 3) / 3 and (0 + 1 − 2) / 3.
        assert_eq!((sums.plane(0), sums.plane(1)), (vec![4.0 / 3.0], vec![-1.0 / 3.0]));
        assert_eq!(sums.invalid, InvalidCounts { nan: 1, infinite: 1, negative: 0, overflow: 0 });
    }

    /// A depth may be any number of 32 bits, in whatever sets the samples are, which have zeros in its channel; what is no number is
    /// counted.
    #[test]
    fn what_stands_once_comes_back_at_any_size() {
        let values = [3e12, -1e38, 1e-30, 0.0, -2.5, f32::INFINITY, f32::NAN];
        for kept in [Kept::Together, Kept::ByReplicate] {
            let mut sums = LayerSums::new(Layout { channels: 2, kept }, values.len());
            for (index, &x) in values.iter().enumerate() {
                (0..REPLICATES).for_each(|replicate| sums.add(index, replicate, 1.0, &[1.0, 0.0]));
                sums.add_once(index, [(1, x)]);
            }
            assert_eq!(sums.once(1), [3e12, -1e38, 1e-30, 0.0, -2.5, 0.0, 0.0], "{kept:?}");
            assert_eq!(sums.invalid, InvalidCounts { nan: 1, infinite: 1, ..InvalidCounts::default() });
        }
    }

    #[test]
    fn a_picture_without_layers_takes_no_memory_for_them() {
        let none = Layout::default();
        assert_eq!(LayerSums::bytes(none, 1 << 20), 0);
        assert_eq!(LayerSums::new(none, 1 << 20), LayerSums::default());
    }
}
