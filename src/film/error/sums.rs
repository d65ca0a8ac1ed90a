//! What pixels add to the estimate; symbols as on the page of [`super`].

use super::super::accumulate::REPLICATES;
use super::values::Four;
use super::{ONE_REPLICATE, PAIRINGS};
use wide::f64x4;

/// See [`Told::is_spoiled_by_few`]: of the pixels whose replicates differ.
const FEW: f64 = 0.01;

/// The most that q can be of light that is nowhere less than nothing, x = (X, 0, 0, 0): with f = 0 it is v g = 1, from which
/// g′κ₃ = −2 is taken off.
const MOST: f64 = 3.0;

/// What the pixels of a block add: those whose q is of a size that it can have, and those where it is below nothing or more than
/// [`MOST`]. It is where light is rare, and where it cancels: single wavelengths outside the gamut have channels of either sign, and
/// noise is divided by what is left of them.
#[derive(Clone, Copy, Default)]
pub(super) struct Told {
    plausible: Sums,
    implausible: Sums,
}

impl Told {
    /// Adds a pixel; `uneven` where one of its replicates has at least twice the samples of another.
    pub(super) fn add(&mut self, values: &[Four], floors: &[f64x4], counted: usize, uneven: bool) {
        let mut pixel = Sums::of_pixel(values, floors, counted);
        pixel.uneven = u64::from(uneven);
        if (0.0..=MOST).contains(&pixel.error) { self.plausible.join(&pixel) } else { self.implausible.join(&pixel) }
    }

    /// Adds what other pixels add.
    pub(super) fn join(&mut self, other: &Told) {
        self.plausible.join(&other.plausible);
        self.implausible.join(&other.implausible);
    }

    /// Whether a few implausible pixels count for more than half of what all others do, for it or against it.
    pub(super) fn is_spoiled_by_few(&self) -> bool {
        let all = self.plausible.noisy + self.implausible.noisy;
        let few = self.implausible.noisy as f64 <= FEW * all as f64;
        few && self.implausible.error_of_pixels > 0.5 * self.plausible.error
    }

    /// Whether implausible pixels, few or not, count for more than all others do.
    pub(super) fn is_implausible(&self) -> bool {
        self.implausible.error > self.plausible.error
    }

    /// What all pixels add, or those that are plausible.
    pub(super) fn sums(&self, plausible_only: bool) -> Sums {
        let mut sums = self.plausible;
        if !plausible_only {
            sums.join(&self.implausible);
        }
        sums
    }
}

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
    /// Σ |q|.
    error_of_pixels: f64,
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
    /// What a pixel adds, given f of each of its values, of which `counted` are told of.
    fn of_pixel(values: &[Four], floors: &[f64x4], counted: usize) -> Sums {
        let alike = |v: &Four| v.replicates.iter().all(|x| x.simd_eq(v.replicates[0]).all());
        let noisy = !values.iter().all(alike);
        let black = values.iter().all(|v| v.means.simd_eq(f64x4::ZERO).all());
        let share = f64x4::splat(1.0 / counted.max(1) as f64);
        let (mut plain, mut further, mut crossed) = (f64x4::ZERO, f64x4::ZERO, f64x4::ZERO);
        let mut shares = f64x4::ZERO;
        let mut pairs = [f64x4::ZERO; PAIRINGS.len()];
        let (mut own, mut splatted) = (Gram::default(), Gram::default());
        for (four, &floor) in values.iter().zip(floors) {
            let x = four.replicates;
            let deviations = deviations(x);
            let [a, b, c, d] = deviations;
            let squares = a * a + b * b + c * c + d * d;
            // Those that do not differ add nothing, though f and they may be zero.
            let still = squares.simd_eq(f64x4::ZERO);
            let differing = |x: f64x4| still.select(f64x4::ZERO, x);
            let (two, half) = (f64x4::splat(2.0), f64x4::HALF);
            let value_squared = four.means * four.means;
            let g = differing(f64x4::ONE / (value_squared + floor));
            // Derivatives of g.
            let first = -two * four.means * g * g;
            let second = (f64x4::splat(6.0) * value_squared - two * floor) * g * g * g;
            let third = (a * a * a + b * b * b + c * c * c + d * d * d) * f64x4::splat(1.0 / 24.0);
            let g = g * share;
            let mut fourth = f64x4::ZERO;
            for (pair, [i, j, k, l]) in pairs.iter_mut().zip(PAIRINGS) {
                let product = (x[i] - x[j]) * (x[k] - x[l]);
                *pair += product * g;
                fourth += product * product;
            }
            let fourth = fourth * f64x4::splat(1.0 / (64 * PAIRINGS.len()) as f64);
            further += (half * second * fourth + first * third) * share;
            plain += squares * f64x4::splat(1.0 / 12.0) * g;
            crossed += differing(self::crossed(x, floor)) * share;
            shares += own.add(deviations, g);
            if let Some(x) = four.splatted {
                splatted.add(self::deviations(x), g);
            }
        }
        let [plain, further, crossed] = [plain, further, crossed].map(f64x4::reduce_add);
        let error = plain - further;
        let largest = shares.to_array().into_iter().fold(0.0, f64::max);
        let pairs = pairs.map(f64x4::reduce_add);
        Sums {
            pixels: 1,
            noisy: u64::from(noisy),
            black: u64::from(black),
            uneven: 0,
            error,
            error_of_pixels: error.abs(),
            further,
            further_of_pixels: further.abs(),
            crossed,
            squares: error * error,
            heavy: if largest > ONE_REPLICATE * shares.reduce_add() { error } else { 0.0 },
            // W of the mean itself is as much larger or smaller as the size is that it makes.
            own: if plain > 0.0 { own.trace() * (error.max(0.0) / plain).powi(2) } else { 0.0 },
            splatted: splatted.trace(),
            pairs,
            pair_squares: pairs.iter().map(|pair| pair * pair).sum(),
        }
    }

    /// Adds what other pixels add.
    fn join(&mut self, other: &Sums) {
        self.pixels += other.pixels;
        self.noisy += other.noisy;
        self.black += other.black;
        self.uneven += other.uneven;
        self.error += other.error;
        self.error_of_pixels += other.error_of_pixels;
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

/// How far the replicates of four values are from their means.
fn deviations(x: [f64x4; REPLICATES]) -> [f64x4; REPLICATES] {
    let [a, b, c, d] = x;
    let mean = (a + b + c + d) * f64x4::splat(1.0 / REPLICATES as f64);
    [a - mean, b - mean, c - mean, d - mean]
}

/// q of four values with replicates `x`, the variance σ² of their mean told by two of them and divided by what the other two show,
/// y. That varies by 2σ², so that E g(y) is g(μ) + g″(μ) σ² to second order, whatever σ² was told from: the latter is taken off.
fn crossed(x: [f64x4; REPLICATES], floor: f64x4) -> f64x4 {
    // Of two replicates the variance that they tell, and g less what is taken off by it.
    let of_two = |a: usize, b: usize| {
        let difference = x[a] - x[b];
        let variance = difference * difference * f64x4::splat(1.0 / 8.0);
        let value = f64x4::HALF * (x[a] + x[b]);
        let value_squared = value * value;
        let g = f64x4::ONE / (value_squared + floor);
        let second = (f64x4::splat(6.0) * value_squared - f64x4::splat(2.0) * floor) * g * g * g;
        (variance, g - second * variance)
    };
    let mut sum = f64x4::ZERO;
    for [i, j, k, l] in PAIRINGS {
        let ((v, g), (w, h)) = (of_two(i, j), of_two(k, l));
        sum += v * h + w * g;
    }
    sum * f64x4::splat(1.0 / (2 * PAIRINGS.len()) as f64)
}

/// Of the replicates' deviations d in the values of a pixel: Σ g dₐ dᵇ.
#[derive(Clone, Copy, Default)]
struct Gram([f64x4; REPLICATES]);

impl Gram {
    /// Adds four values, and gives g d² of each replicate.
    fn add(&mut self, deviations: [f64x4; REPLICATES], g: f64x4) -> f64x4 {
        let mut squares = f64x4::ZERO;
        for (d, g) in f64x4::transpose(deviations).into_iter().zip(g.to_array()) {
            let weighed = d * f64x4::splat(g);
            squares += d * weighed;
            for (row, a) in self.0.iter_mut().zip(d.to_array()) {
                *row += f64x4::splat(a) * weighed;
            }
        }
        squares
    }

    /// tr(WΣ)².
    fn trace(&self) -> f64 {
        let squares = self.0.iter().map(|row| *row * *row).sum::<f64x4>().reduce_add();
        let trace = (0..REPLICATES).map(|r| self.0[r].to_array()[r]).sum::<f64>() / 12.0;
        (squares / 144.0 - trace * trace / 3.0) * 0.9
    }
}

#[cfg(test)]
mod tests {
    use super::super::values::Four;
    use super::{MOST, Sums, crossed};
    use crate::math::sampler::uniform;
    use wide::f64x4;

    /// ½ g″σ⁴ + g′κ₃ of one value, by hand. Of 2, 1, 1, 1 the mean is 5/4 and Σd³ 3/8, so that κ₃ is (2/3)(3/8)/16 = 1/64, of which f =
    /// 7/16 takes g′ = −2 · 5/4 / 4 times; as three of four agree, no pairs differ twice. Of 2, 2, 1, 1 κ₃ is 0 and σ⁴ is 1/96 by the pairs;
    /// with f = 7/4 g is 1/4 and g″ (6 · 9/4 − 2 · 7/4)/64. The variance of the mean is Σd²/12.
    #[test]
    fn what_noisy_divisors_take_off_is_of_second_order() {
        for (x, floor, plain, further) in [
            ([2.0, 1.0, 1.0, 1.0], 7.0 / 16.0, 1.0 / 32.0, -5.0 / 8.0 / 64.0),
            ([2.0, 2.0, 1.0, 1.0], 7.0 / 4.0, 1.0 / 48.0, 0.5 * (10.0 / 64.0) / 96.0),
        ] {
            let mean = x.iter().sum::<f64>() / 4.0;
            let first = |x| f64x4::new([x, 0.0, 0.0, 0.0]);
            let four = Four { means: first(mean), replicates: x.map(first), splatted: None };
            let sums = Sums::of_pixel(&[four], &[f64x4::splat(floor)], 1);
            let close = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-14;
            assert!(close(sums.further, further), "{x:?}: {} for {further}", sums.further);
            assert!(close(sums.error, plain - further), "{x:?}: {} for {plain} - {further}", sums.error);
        }
    }

    /// With f of a millionth of X²: 3 by one replicate of four, -1/6 by two, within ten times what f changes; and of 4,000 draws of light
    /// that is nowhere less than nothing, from even to rare, none is beyond these.
    #[test]
    fn light_has_a_size_between_bounds() {
        let q = |x: [f64; 4]| {
            let four = Four {
                means: f64x4::splat(x.iter().sum::<f64>() / 4.0),
                replicates: x.map(f64x4::splat),
                splatted: None,
            };
            Sums::of_pixel(&[four], &[f64x4::splat(1e-6)], 4).error
        };
        let [least, most] = [q([1.0, 1.0, 0.0, 0.0]), q([1.0, 0.0, 0.0, 0.0])];
        assert!((least + 1.0 / 6.0).abs() < 1e-5 && (most - MOST).abs() < 1e-3 && most < MOST, "{least} {most}");
        for draw in 0..4000 {
            let rarity = f64::from(1 << (draw % 6));
            let found = q([0, 1, 2, 3].map(|r| uniform(3, 4 * draw + r).powf(rarity)));
            assert!((-1.0 / 6.0..=MOST).contains(&found), "{found}");
        }
    }

    /// One replicate of four has X: by the spread of all, v = X²/16; by two of them, the others dark, (X²/8)/f for half of the
    /// ways to choose and nothing for the rest. Of noise of 1e-4 it is as if the divisor were known, within twice the noise.
    #[test]
    fn crossed_values_do_not_know_of_a_bright_path() {
        let crossed = |x: [f64; 4], floor| crossed(x.map(f64x4::splat), f64x4::splat(floor)).to_array()[0];
        assert_eq!(crossed([4.0, 0.0, 0.0, 0.0], 0.25), 4.0);
        let x = [1.0, 1.0001, 0.9999, 1.00006];
        let mean = x.iter().sum::<f64>() / 4.0;
        let variance = x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 12.0;
        assert!((crossed(x, 0.01) / (variance / (mean * mean + 0.01)) - 1.0).abs() < 2e-4);
    }
}
