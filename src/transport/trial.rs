//! Trials before the render: whether wavelengths that part at the glass before the camera are worth following together, whether
//! paths are worth sharing by pixels, and how many shadow rays their first vertices are to send.
//!
//! Two ways to spend time are equal where variance times cost is. Both are rendered at places spread over the picture, with as
//! many evenly spread samples as a replicate of the render has (sixteen at the most), because a hero's colours average out over its
//! samples; how replicates differ tells the variance. Costs are counted in rays, so that every machine decides alike.

pub mod first;
mod packets;

pub use packets::packets;

use crate::film::error::floor_about;
use crate::transport::pilot::Use;

/// Samples that are enough to tell how evenly spread ones do.
const MOST: u32 = 16;
/// A place counts at most as so many times what 99 of 100 stay below: single fireflies do not decide.
const FIREFLY: f64 = 4.0;
/// Tells the random numbers of the trial from those of the picture.
const STREAM: u64 = 0x7472_6961_6c6f_6667;

/// What one way of rendering makes of the places.
#[derive(Default)]
struct Tried {
    /// Linear Rec. 709 of two replicates.
    colours: Vec<[[f64; 3]; 2]>,
    rays: f64,
    /// Pairs of vertices that were asked whether they see each other.
    pairs: u64,
}

/// What the scene says of a technique, where it does.
fn decided(wish: Use) -> Option<bool> {
    match wish {
        Use::Auto => None,
        Use::On => Some(true),
        Use::Off => Some(false),
    }
}

/// Whether what takes `ratio` times the time to the same error is worth it, as it is below `bound`, and why.
fn judge(ratio: f64, bound: f64) -> (bool, String) {
    match ratio.is_nan() {
        true => (false, "the trial sees no light".into()),
        false => (ratio < bound, format!("the trial expects {ratio:.2} times the time to the same error")),
    }
}

/// Variance times cost.
fn cost_of_error(tried: &Tried) -> f64 {
    variance(tried) * tried.rays
}

/// Variance, relative as that of a picture is; the sum of all places.
fn variance(tried: &Tried) -> f64 {
    let values = || tried.colours.iter().flatten().flatten();
    let mean = values().sum::<f64>() / values().count() as f64;
    let floor = floor_about(mean);
    let mut squares: Vec<f64> = tried
        .colours
        .iter()
        .map(|[a, b]| (0..3).map(|c| (a[c] - b[c]).powi(2) / ((0.5 * (a[c] + b[c])).powi(2) + floor)).sum())
        .collect();
    squares.sort_by(f64::total_cmp);
    let most = FIREFLY * squares[squares.len() - squares.len() / 100 - 1];
    squares.iter().map(|square| square.min(most)).sum()
}
