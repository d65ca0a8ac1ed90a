//! What pixels add to the estimate; symbols as on the page of [`super`].

use super::super::accumulate::REPLICATES;
use super::values::Value;
use super::{ONE_REPLICATE, PAIRINGS};

/// What some pixels add to the estimate.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    /// Pixels with all replicates.
    pub(super) pixels: u64,
    /// Pixels whose replicates differ.
    pub(super) noisy: u64,
    /// Pixels without any light.
    pub(super) black: u64,
    /// Pixels of which one replicate has at least twice the samples of another.
    pub(super) uneven: u64,
    /// Σ q, q a pixel's expected relative squared error.
    pub(super) error: f64,
    /// What is taken off for the noise of the values that variances are divided by.
    pub(super) further: f64,
    /// Its magnitudes, pixel by pixel.
    pub(super) further_of_pixels: f64,
    /// Σ q with variances divided by values of other replicates.
    pub(super) crossed: f64,
    /// Σ q².
    pub(super) squares: f64,
    /// Σ q of pixels of which one replicate has most of the spread.
    pub(super) heavy: f64,
    /// Σ tr(WΣ)² of single pixels.
    pub(super) own: f64,
    /// The same of what was splatted.
    pub(super) splatted: f64,
    /// Σ uᵀWv for each way to pair the replicates.
    pub(super) pairs: [f64; 3],
    /// Σ (uᵀWv)² of single pixels, over the ways to pair.
    pub(super) pair_squares: f64,
}

impl Sums {
    /// Adds a pixel, given f of each of its values.
    pub(super) fn add(&mut self, values: &[Value], floors: &[f64]) {
        self.pixels += 1;
        self.noisy += u64::from(values.iter().any(|v| v.replicates.iter().any(|x| *x != v.replicates[0])));
        self.black += u64::from(values.iter().all(|v| v.mean == 0.0));
        let channels = floors.iter().filter(|f| **f > 0.0).count() as f64;
        let (mut error, mut plain, mut further, mut crossed) = (0.0, 0.0, 0.0, 0.0);
        let mut shares = [0.0; REPLICATES];
        let mut pairs = [0.0; 3];
        let (mut own, mut splatted) = (Gram::default(), Gram::default());
        for (value, &floor) in values.iter().zip(floors) {
            let x = value.replicates;
            let mean = x.iter().sum::<f64>() / REPLICATES as f64;
            let deviations = x.map(|x| x - mean);
            let squares: f64 = deviations.iter().map(|d| d * d).sum();
            if squares == 0.0 {
                continue;
            }
            let value_squared = value.mean * value.mean;
            let g = 1.0 / (value_squared + floor);
            // Derivatives of g.
            let first = -2.0 * value.mean * g * g;
            let second = (6.0 * value_squared - 2.0 * floor) * g * g * g;
            let variance = squares / 12.0;
            let third = deviations.iter().map(|d| d.powi(3)).sum::<f64>() / 24.0;
            let mut fourth = 0.0;
            for (pair, [i, j, k, l]) in pairs.iter_mut().zip(PAIRINGS) {
                let product = (x[i] - x[j]) * (x[k] - x[l]);
                *pair += product * g / channels;
                fourth += product * product / PAIRINGS.len() as f64 / 64.0;
            }
            further += (0.5 * second * fourth + first * third) / channels;
            plain += variance * g / channels;
            error += (variance * g - 0.5 * second * fourth - first * third) / channels;
            crossed += self::crossed(x, floor) / channels;
            for (share, d) in shares.iter_mut().zip(deviations) {
                *share += d * d * g;
            }
            own.add(deviations, g / channels);
            if let Some(x) = value.splatted {
                let mean = x.iter().sum::<f64>() / REPLICATES as f64;
                splatted.add(x.map(|x| x - mean), g / channels);
            }
        }
        self.error += error;
        self.further += further;
        self.further_of_pixels += further.abs();
        self.crossed += crossed;
        self.squares += error * error;
        let largest = shares.iter().copied().fold(0.0, f64::max);
        if largest > ONE_REPLICATE * shares.iter().sum::<f64>() {
            self.heavy += error;
        }
        for (sum, pair) in self.pairs.iter_mut().zip(pairs) {
            *sum += pair;
            self.pair_squares += pair * pair;
        }
        // W of the mean itself is as much larger or smaller as the size is that it makes.
        self.own += if plain > 0.0 { own.trace() * (error.max(0.0) / plain).powi(2) } else { 0.0 };
        self.splatted += splatted.trace();
    }

    /// Adds what other pixels add.
    pub(super) fn join(&mut self, other: &Sums) {
        self.pixels += other.pixels;
        self.noisy += other.noisy;
        self.black += other.black;
        self.uneven += other.uneven;
        self.error += other.error;
        self.further += other.further;
        self.further_of_pixels += other.further_of_pixels;
        self.crossed += other.crossed;
        self.squares += other.squares;
        self.heavy += other.heavy;
        self.own += other.own;
        self.splatted += other.splatted;
        self.pair_squares += other.pair_squares;
        self.pairs.iter_mut().zip(other.pairs).for_each(|(sum, pair)| *sum += pair);
    }
}

/// q of a value with replicates `x`, the variance σ² of their mean told by two of them and divided by what the other two show,
/// y. That varies by 2σ², so that E g(y) is g(μ) + g″(μ) σ² to second order, whatever σ² was told from: the latter is taken off.
fn crossed(x: [f64; REPLICATES], floor: f64) -> f64 {
    let ways = PAIRINGS.iter().flat_map(|&[i, j, k, l]| [[i, j, k, l], [k, l, i, j]]);
    let q = |[i, j, k, l]: [usize; REPLICATES]| {
        let variance = |a: usize, b: usize| (x[a] - x[b]).powi(2) / 8.0;
        let value_squared = (0.5 * (x[k] + x[l])).powi(2);
        let g = 1.0 / (value_squared + floor);
        let second = (6.0 * value_squared - 2.0 * floor) * g * g * g;
        variance(i, j) * (g - second * variance(k, l))
    };
    ways.map(q).sum::<f64>() / (2 * PAIRINGS.len()) as f64
}

/// Of the replicates' deviations d in the values of a pixel: Σ g dₐ dᵇ.
#[derive(Clone, Copy, Default)]
struct Gram([[f64; REPLICATES]; REPLICATES]);

impl Gram {
    fn add(&mut self, deviations: [f64; REPLICATES], g: f64) {
        for (row, a) in self.0.iter_mut().zip(deviations) {
            for (product, b) in row.iter_mut().zip(deviations) {
                *product += a * b * g;
            }
        }
    }

    /// tr(WΣ)².
    fn trace(&self) -> f64 {
        let squares: f64 = self.0.iter().flatten().map(|x| x * x).sum();
        let trace = (0..REPLICATES).map(|r| self.0[r][r]).sum::<f64>() / 12.0;
        (squares / 144.0 - trace * trace / 3.0) * 0.9
    }
}

#[cfg(test)]
mod tests {
    use super::crossed;

    /// One replicate of four has X: by the spread of all, v = X²/16; by two of them, the others dark, (X²/8)/f for half of the
    /// ways to choose and nothing for the rest. Of noise of 1e-4 it is as if the divisor were known, within twice the noise.
    #[test]
    fn crossed_values_do_not_know_of_a_bright_path() {
        assert_eq!(crossed([4.0, 0.0, 0.0, 0.0], 0.25), 4.0);
        let x = [1.0, 1.0001, 0.9999, 1.00006];
        let mean = x.iter().sum::<f64>() / 4.0;
        let variance = x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 12.0;
        assert!((crossed(x, 0.01) / (variance / (mean * mean + 0.01)) - 1.0).abs() < 2e-4);
    }
}
