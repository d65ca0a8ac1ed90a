//! What becomes of a picture whose samples are shared out: its error, and its time, at so many samples of the mean.

use super::adaptive::count;
use serde::{Deserialize, Serialize};

/// Cells of like shares, with what they add to variance and time. None of them where all pixels have as many samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outlook {
    /// Samples of all pixels alike, by which the shares were told.
    first: u32,
    kinds: Vec<Kind>,
}

/// Halves of cells that have one share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kind {
    /// As in [`super::adaptive::Allocation`].
    pub share: i16,
    /// Sum of their variances at the first samples.
    pub variance: f64,
    /// Sum of the costs of a sample.
    pub cost: f64,
}

impl Outlook {
    /// Of halves of cells that have `first` samples, each as a [`Kind`] of its own.
    #[must_use]
    pub fn new(first: u32, mut halves: Vec<Kind>) -> Outlook {
        halves.sort_by_key(|half| half.share);
        let mut kinds: Vec<Kind> = Vec::new();
        for half in halves {
            match kinds.last_mut().filter(|kind| kind.share == half.share) {
                Some(kind) => (kind.variance, kind.cost) = (kind.variance + half.variance, kind.cost + half.cost),
                None => kinds.push(half),
            }
        }
        Outlook { first, kinds }
    }

    /// Whether all pixels have as many samples.
    #[must_use]
    pub fn is_even(&self) -> bool {
        self.kinds.is_empty()
    }

    /// Whether it is known when all pixels have `samples`.
    #[must_use]
    pub fn is_known_at(&self, samples: u32) -> bool {
        samples >= self.first
    }

    /// Whether it can be one: no variance or cost below nothing.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.kinds
            .iter()
            .all(|kind| (0.0..f64::INFINITY).contains(&kind.variance) && (0.0..f64::INFINITY).contains(&kind.cost))
    }

    /// The variance of the picture at `mean` samples over that of one whose pixels all have as many, where that of each falls as
    /// samples^−slope.
    #[must_use]
    pub fn variance(&self, mean: f64, slope: f64) -> f64 {
        let left = |kind: &Kind| kind.variance * libm::pow(mean / self.samples(kind, mean), slope);
        self.ratio(mean, left, |kind| kind.variance)
    }

    /// What `mean` samples take, in samples of all pixels.
    #[must_use]
    pub fn spent(&self, mean: f64) -> f64 {
        mean * self.ratio(mean, |kind| kind.cost * (self.samples(kind, mean) / mean), |kind| kind.cost)
    }

    /// Time to the error of `mean` samples of all pixels alike, over that of these, for variance that falls as samples^−slope.
    #[must_use]
    pub fn time(&self, mean: f64, slope: f64) -> f64 {
        libm::pow(self.variance(mean, slope), 1.0 / slope) * (self.spent(mean) / mean)
    }

    fn samples(&self, kind: &Kind, mean: f64) -> f64 {
        // Means that are no whole number come in forecasts alone.
        f64::from(count(self.first, kind.share, mean as u32))
    }

    /// The sum of `some` of all kinds over that of `all`; one up to the first samples, and where there is nothing.
    fn ratio(&self, mean: f64, some: impl Fn(&Kind) -> f64, all: impl Fn(&Kind) -> f64) -> f64 {
        if mean <= f64::from(self.first) {
            return 1.0;
        }
        let sum = |of: &dyn Fn(&Kind) -> f64| self.kinds.iter().map(of).sum::<f64>();
        let all = sum(&all);
        if all > 0.0 { sum(&some) / all } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Kind; 3] = [
        Kind { share: 16, variance: 3.0, cost: 1.0 },
        Kind { share: -16, variance: 0.5, cost: 2.0 },
        Kind { share: -16, variance: 0.5, cost: 1.0 },
    ];

    /// Of 16 samples each; at 64 in the mean noisy cells have 128, the others 32, at 32 they have 64 and still 16.
    #[test]
    fn noisy_cells_take_the_time_and_lose_the_variance() {
        let outlook = Outlook::new(16, ALL.to_vec());
        assert_eq!(outlook.kinds.len(), 2);
        let near = |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 1e-12, "{found} {wanted}");
        near(outlook.variance(64.0, 1.0), (3.0 / 2.0 + 1.0 * 2.0) / 4.0);
        near(outlook.spent(64.0), (128.0 + 3.0 * 32.0) / 4.0);
        near(outlook.spent(32.0), (64.0 + 3.0 * 16.0) / 4.0);
        near(outlook.variance(64.0, 2.0), (3.0 / 4.0 + 1.0 * 4.0) / 4.0);
        near(outlook.time(64.0, 1.0), 3.5 / 4.0 * 224.0 / 256.0);
        for mean in [4.0, 16.0] {
            assert_eq!((outlook.variance(mean, 1.0), outlook.spent(mean)), (1.0, mean));
        }
    }

    #[test]
    fn what_is_even_is_as_it_was() {
        let even = Outlook::default();
        assert!(even.is_even() && even.is_sound() && !Outlook::new(16, ALL.to_vec()).is_even());
        assert_eq!((even.variance(100.0, 1.2), even.spent(100.0), even.time(100.0, 1.2)), (1.0, 100.0, 1.0));
        let dark = Outlook::new(16, vec![Kind { variance: 0.0, ..ALL[0] }]);
        assert_eq!(dark.variance(64.0, 1.0), 1.0);
        assert!(!Outlook::new(16, vec![Kind { variance: f64::NAN, ..ALL[0] }]).is_sound());
    }
}
