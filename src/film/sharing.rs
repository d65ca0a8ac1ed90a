//! What pixels share of their errors: how many times the variance of the sum of all of them is that of independent ones.

use super::accumulate::{Film, REPLICATES};
use super::compare::GLOBAL_ALPHA;
use super::error::Values;
use super::resolve::{Splats, counts, in_halves, layer_or_zero, light_or_zero};
use crate::math::statistics::student_t_half_width;
use std::collections::HashMap;

/// For the value of `values` where it is most, of standard errors `errors` by pixel: what is splatted falls into `span` pixels
/// together, by the filter ([`Filter::span`](super::filter::Filter::span)) and since a path is seen in several. Where replicates tell
/// nothing all of the variance may be of that.
#[must_use]
pub fn by_filter(splats: &Splats, values: Values, errors: &[&[f32]], span: f64) -> f64 {
    if are_unknown(errors) {
        return span;
    }
    // Variances, and what was splatted of them.
    let mut sums = vec![[0.0; 2]; errors.len()];
    let mut add = |value: usize, pixel: usize, splatted: f64| {
        let error = f64::from(errors[value][pixel]);
        if error.is_finite() && splatted.is_finite() {
            sums[value][0] += error * error;
            sums[value][1] += splatted;
        }
    };
    match values {
        Values::Colours(rgb_from_xyz, _) => {
            for (pixel, variances) in splats.variances(rgb_from_xyz).enumerate() {
                variances.into_iter().enumerate().for_each(|(c, variance)| add(c, pixel, variance));
            }
        }
        Values::Bands(first, count) => {
            for value in 0..count {
                let variances = splats.film.layers.variances_of(first + value, Some(splats.photons));
                variances.into_iter().enumerate().for_each(|(pixel, variance)| add(value, pixel, variance));
            }
        }
    }
    let shared = |[all, own]: [f64; 2]| if all > 0.0 { 1.0 + (span - 1.0) * (own / all).min(1.0) } else { 1.0 };
    sums.into_iter().map(shared).fold(1.0, f64::max)
}

/// Whether replicates tell nothing: there is one, of one sample a pixel, or sums are not kept by them.
fn are_unknown(errors: &[&[f32]]) -> bool {
    !errors.iter().copied().flatten().any(|error| error.is_finite())
}

/// At the most, for the value of `values` where it is most, of standard errors `errors` by pixel, where pixels may share them with all
/// in their cell of so many on a side, aligned to the frame, or with every other where there are no cells.
///
/// What the sum of a cell varies by is told by the sums of its R replicates, as far as they have samples, with R − 1 degrees of freedom,
/// that of all by as many times (Σv)²/Σv², with v that of each. [`compare`](super::compare) takes what a file says for known and its
/// scores for normal: so variances are multiplied by (t/z)², t and z the quantiles of Student and Gauss at its level, and what is
/// beyond z standard errors is beyond t of those that were found.
///
/// Where replicates tell nothing all pixels of a cell may err alike, and the sum of n such varies n times as much; no sum of n varies
/// more, whatever few replicates tell.
#[must_use]
pub fn in_cells(film: &Film, splats: Option<&Splats>, values: Values, errors: &[&[f32]], cell: Option<u32>) -> f64 {
    /// Of a cell and a value: sums by replicate, and the variances of the pixels.
    #[derive(Clone, Copy, Default)]
    struct Sums {
        light: [f64; REPLICATES],
        own: f64,
    }
    let place = |x: i32| cell.map_or(0, |cell| x.div_euclid(cell as i32));
    let pixels = film.window().pixels() as f64;
    let most = cell.map_or(pixels, |cell| f64::from(cell * cell).min(pixels));
    if are_unknown(errors) {
        return most;
    }
    // Of two samples a pixel, or three, some have none.
    let has_samples = |r: &usize| film.cells().iter().any(|pixel| pixel[*r].count > 0);
    let replicates: Vec<usize> = (0..REPLICATES).filter(has_samples).collect();
    let read = |pixel: usize, light: &mut Vec<[f64; REPLICATES]>| {
        light.clear();
        match values {
            Values::Colours(rgb_from_xyz, _) => {
                let all = light_or_zero(film, splats, pixel, rgb_from_xyz);
                light.extend((0..3).map(|c| all.map(|colour| colour[c])));
            }
            Values::Bands(first, count) => {
                light.extend((first..first + count).map_while(|band| layer_or_zero(film, splats, pixel, band)));
            }
        }
        let counts = counts(&film.cells()[pixel]);
        light.len() == errors.len() && replicates.iter().all(|r| counts[*r] > 0)
    };
    let mut cells: HashMap<[i32; 2], ([f64; REPLICATES], Vec<Sums>)> = HashMap::new();
    let mut light = Vec::new();
    for (i, (counted, pixel)) in film.cells().iter().zip(film.window().iter()).enumerate() {
        if !read(i, &mut light) || errors.iter().any(|plane| !plane[i].is_finite()) {
            continue;
        }
        let nothing = || ([0.0; REPLICATES], vec![Sums::default(); errors.len()]);
        let (samples, sums) = cells.entry(pixel.map(place)).or_insert_with(nothing);
        // Halves weigh alike, however many samples they have.
        let halves = in_halves(counted);
        for (all, count) in samples.iter_mut().zip(counts(counted)) {
            *all += if halves { 1.0 } else { count as f64 };
        }
        for ((sums, value), errors) in sums.iter_mut().zip(&light).zip(errors) {
            replicates.iter().for_each(|&r| sums.light[r] += value[r]);
            sums.own += f64::from(errors[i]) * f64::from(errors[i]);
        }
    }
    // In an order that no hash decides, for the sake of the last bit.
    let mut cells: Vec<_> = cells.into_iter().collect();
    cells.sort_by_key(|(place, _)| *place);
    let confidence = 1.0 - GLOBAL_ALPHA / errors.len() as f64;
    let quantile = |dof| student_t_half_width(confidence, dof);
    let bound = |value: usize| {
        let (mut all, mut squares, mut own) = (0.0, 0.0, 0.0);
        for (_, (samples, sums)) in &cells {
            let Sums { light, own: of_pixels } = sums[value];
            let total: f64 = samples.iter().sum();
            let mean = replicates.iter().map(|&r| samples[r] * light[r]).sum::<f64>() / total;
            let spread: f64 = replicates.iter().map(|&r| samples[r] * (light[r] - mean).powi(2)).sum();
            let variance = spread / ((replicates.len() - 1) as f64 * total);
            all += variance;
            squares += variance * variance;
            own += of_pixels;
        }
        let dof = (replicates.len() - 1) as f64 * (all * all / squares);
        (quantile(dof) / quantile(f64::INFINITY)).powi(2) * all / own
    };
    // Without errors there is nothing to share: 0/0.
    (0..errors.len()).map(bound).filter(|shared| shared.is_finite()).fold(1.0, f64::max).min(most)
}
