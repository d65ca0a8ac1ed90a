//! What pixels share of their errors: how many times the variance of the sum of all of them is that of independent ones.

use super::accumulate::{Film, REPLICATES};
use super::compare::GLOBAL_ALPHA;
use super::error::{Measured, Values};
use super::resolve::{Splats, counts};
use crate::math::statistics::student_t_half_width;
use std::collections::HashMap;

/// For the value of `values` where it is most, of standard errors `errors` by pixel: what is splatted falls into `span` pixels
/// together ([`Filter::span`](super::filter::Filter::span)).
#[must_use]
pub fn by_filter(splats: &Splats, values: Values, errors: &[&[f32]], span: f64) -> f64 {
    let shared = |(errors, splatted): (&&[f32], &Vec<f64>)| {
        let (mut all, mut own) = (0.0, 0.0);
        for (error, splatted) in errors.iter().zip(splatted) {
            let error = f64::from(*error);
            if error.is_finite() && splatted.is_finite() {
                all += error * error;
                own += splatted;
            }
        }
        if all > 0.0 { 1.0 + (span - 1.0) * (own / all).min(1.0) } else { 1.0 }
    };
    let splatted: Vec<Vec<f64>> = match values {
        Values::Colours(rgb_from_xyz, _) => {
            let variances: Vec<[f64; 3]> = splats.variances(rgb_from_xyz).collect();
            (0..3).map(|c| variances.iter().map(|variance| variance[c]).collect()).collect()
        }
        Values::Bands(first, count) => {
            let of = |band| splats.film.layers.variances_of(band, Some(splats.photons)).collect();
            (first..first + count).map(of).collect()
        }
    };
    errors.iter().zip(&splatted).map(shared).fold(1.0, f64::max)
}

/// At the most, for the value of `values` where it is most, of standard errors `errors` by pixel, where pixels may share them with all
/// in their cell of so many on a side, aligned to the frame, or with every other where there are no cells; 1 where replicates are empty.
///
/// What the sum of a cell varies by is told by the sums of its replicates, with three degrees of freedom, that of all by as many times
/// (Σv)²/Σv², with v that of each. [`compare`](super::compare) takes what a file says for known and its scores for normal: so
/// variances are multiplied by (t/z)², t and z the quantiles of Student and Gauss at its level, and what is beyond z standard
/// errors is beyond t of those that were found.
#[must_use]
pub fn in_cells(film: &Film, splats: Option<Splats>, values: Values, errors: &[&[f32]], cell: Option<u32>) -> f64 {
    /// Of a cell and a value: sums by replicate, and the variances of the pixels.
    #[derive(Clone, Copy, Default)]
    struct Sums {
        light: [f64; REPLICATES],
        own: f64,
    }
    let place = |x: i32| cell.map_or(0, |cell| x.div_euclid(cell as i32));
    let measured = Measured::new(film, splats, values, false);
    let mut cells: HashMap<[i32; 2], ([f64; REPLICATES], Vec<Sums>)> = HashMap::new();
    let mut light = Vec::new();
    for (i, (counted, pixel)) in film.cells().iter().zip(film.window().iter()).enumerate() {
        if !measured.read(i, &mut light) || errors.iter().any(|plane| !plane[i].is_finite()) {
            continue;
        }
        let nothing = || ([0.0; REPLICATES], vec![Sums::default(); errors.len()]);
        let (samples, sums) = cells.entry(pixel.map(place)).or_insert_with(nothing);
        for (all, count) in samples.iter_mut().zip(counts(counted)) {
            *all += count as f64;
        }
        for ((sums, value), errors) in sums.iter_mut().zip(&light).zip(errors) {
            (0..REPLICATES).for_each(|r| sums.light[r] += value.replicates[r]);
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
            let mean = (0..REPLICATES).map(|r| samples[r] * light[r]).sum::<f64>() / total;
            let spread: f64 = (0..REPLICATES).map(|r| samples[r] * (light[r] - mean).powi(2)).sum();
            let variance = spread / ((REPLICATES - 1) as f64 * total);
            all += variance;
            squares += variance * variance;
            own += of_pixels;
        }
        let dof = (REPLICATES - 1) as f64 * (all * all / squares);
        (quantile(dof) / quantile(f64::INFINITY)).powi(2) * all / own
    };
    // Without errors there is nothing to share: 0/0.
    (0..errors.len()).map(bound).filter(|shared| shared.is_finite()).fold(1.0, f64::max)
}
