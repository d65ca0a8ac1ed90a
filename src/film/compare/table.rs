//! A comparison as a table for people.

use super::{ACCEPT_FRACTION, ChannelFigures, Comparison, GLOBAL_ALPHA, NoiseSource, Verdict};
use crate::error::one_line;
use std::collections::BTreeSet;
use std::fmt::Write as _;

impl Comparison {
    /// The comparison as a table for people.
    #[must_use]
    pub fn table(&self) -> String {
        let mut out = String::new();
        // Writing to a string cannot fail.
        let mut line = |text: String| {
            let _ = writeln!(out, "{}", one_line(text.trim_end().to_owned()));
        };
        if !self.channels.is_empty() {
            line(format!(
                "{:<14}{:>10} ± {:<9}{:>9}{:>10}{:>11}{:>11}{:>11}{:>11}",
                "channel", "ratio", "s.e.", "z", "p", "RMSE", "relMSE", "SMAPE", "max |d|"
            ));
            for c in &self.channels {
                line(format!(
                    "{:<14}{:>10.6} ± {:<9.6}{:>9.2}{:>10.2e}{:>11.3e}{:>11.3e}{:>11.3e}{:>11.3e}",
                    c.name,
                    c.mean_ratio,
                    c.mean_ratio_error,
                    c.global_z,
                    c.global_p,
                    c.rmse,
                    c.rel_mse,
                    c.smape,
                    c.max_difference
                ));
            }
            line(format!("global p, all channels   {:.3e} (different below {GLOBAL_ALPHA:.0e})", self.global_p));
            if let Some(test) = &self.pixel_test {
                line(format!(
                    "pixel values that agree  {:.3} %, {} pixels rejected at {:.1e} (different below {} % with more than {} rejected)",
                    100.0 * test.accepted,
                    test.pixels_rejected,
                    test.alpha,
                    100.0 * ACCEPT_FRACTION,
                    test.pixels_allowed
                ));
                let (mean, deviation) = (test.score_mean, test.score_deviation);
                line(format!("pixel scores             mean {mean:.3}, deviation {deviation:.3}"));
            }
            let sum = |f: fn(&ChannelFigures) -> usize| self.channels.iter().map(f).sum::<usize>();
            line(format!(
                "not finite               A: {} NaN, {} inf; B: {} NaN, {} inf",
                sum(|c| c.nan_a),
                sum(|c| c.infinite_a),
                sum(|c| c.nan_b),
                sum(|c| c.infinite_b)
            ));
            if self.pixels_without_error > 0 {
                let n = self.pixels_without_error;
                line(format!("without a standard error {n} pixels: judged together, by their differences"));
            }
            if !self.not_compared.is_empty() {
                let layer =
                    |name: &String| name.rsplit_once('.').map_or(name.clone(), |(layer, _)| format!("{layer}.*"));
                let layers: BTreeSet<String> = self.not_compared.iter().map(layer).collect();
                line(format!("not compared             {}", Vec::from_iter(layers).join(", ")));
            }
            line(format!("noise known from         {}", self.sources()));
        }
        let verdict = match self.verdict {
            Verdict::Same => "same",
            Verdict::Different => "different",
            Verdict::CannotCompare => "cannot compare",
        };
        line(format!("verdict: {verdict}: {}", self.reason));
        out
    }

    /// Where the noise is known from, with the names of the channels where these differ in that.
    fn sources(&self) -> String {
        if let Some(source) = self.noise {
            return source.words().to_owned();
        }
        let mut all: Vec<(NoiseSource, Vec<&str>)> = Vec::new();
        for ChannelFigures { noise, name, .. } in &self.channels {
            match all.iter_mut().find(|(source, _)| source == noise) {
                Some((_, names)) => names.push(name.as_str()),
                None => all.push((*noise, vec![name.as_str()])),
            }
        }
        let words = |(source, names): &(NoiseSource, Vec<&str>)| format!("{}: {}", names.join(", "), source.words());
        all.iter().map(words).collect::<Vec<_>>().join("; ")
    }
}

impl NoiseSource {
    /// The source in words.
    fn words(self) -> &'static str {
        match self {
            NoiseSource::StandardErrors => "the standard errors of both",
            NoiseSource::OneStandardError => "the standard errors of one; the other is taken as exact",
            NoiseSource::SampleVariance => "the variance file; B is taken as exact",
            NoiseSource::Differences => "the differences themselves",
        }
    }
}
