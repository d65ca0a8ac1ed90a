//! What a person asks of the numbers of a channel.

use serde::Serialize;

/// Of all samples of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Facts {
    /// The least finite one; none where there is none.
    pub min: Option<f64>,
    /// The greatest finite one.
    pub max: Option<f64>,
    /// Mean of the finite ones.
    pub mean: Option<f64>,
    /// How many are NaN.
    pub nan: usize,
    /// How many are infinite.
    pub infinite: usize,
}

impl Facts {
    /// Of `samples`.
    #[must_use]
    pub fn of(samples: impl IntoIterator<Item = f64>) -> Facts {
        let (mut min, mut max, mut sum, mut finite) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0usize);
        let (mut nan, mut infinite) = (0, 0);
        for x in samples {
            if x.is_finite() {
                (min, max, sum, finite) = (min.min(x), max.max(x), sum + x, finite + 1);
            } else if x.is_nan() {
                nan += 1;
            } else {
                infinite += 1;
            }
        }
        let known = |x: f64| (finite > 0).then_some(x);
        Facts { min: known(min), max: known(max), mean: known(sum / finite as f64), nan, infinite }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_is_counted_and_left_out() {
        let facts = Facts::of([1.0, f64::NAN, 3.0, f64::INFINITY, f64::NEG_INFINITY, -1.0]);
        assert_eq!(facts, Facts { min: Some(-1.0), max: Some(3.0), mean: Some(1.0), nan: 1, infinite: 2 });
        assert_eq!(Facts::of([f64::NAN]).mean, None);
    }
}
