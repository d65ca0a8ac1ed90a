//! When a render ends.
//!
//! Passes double the samples; one is cut short where the forecast says that the target lies before the next doubling.

use super::forecast::{Course, Fit, Forecast, seconds_a_sample};
use super::frame::{Milestone, pass_end};
use crate::error::{Error, Result};
use crate::film::accumulate::REPLICATES;
use crate::film::error::NoEstimate;
use std::time::Duration;

/// Targets besides the number of samples; the first that is reached ends the render.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stop {
    /// Relative RMSE of the picture.
    pub error: Option<f64>,
    /// Wall time of rendering.
    pub time: Option<Duration>,
    /// Whether the samples are a wish, too, or just a bound to what cannot be reached.
    pub samples_wanted: bool,
    /// What the file's own rounding makes, as relative RMSE: no picture in it has less.
    pub floor: f64,
}

/// The relative RMSE of rounding to `bits` of mantissa, the leading one included, for values whose logarithms are even:
/// a step is 2^(1−bits) of the power of two below, an even error has a twelfth of its square, and ⟨1/m²⟩ over m from 1 to 2
/// is 3/(8 ln 2).
#[must_use]
pub fn rounding(bits: u32) -> f64 {
    let step = libm::exp2(1.0 - f64::from(bits));
    step * (3.0 / (8.0 * std::f64::consts::LN_2) / 12.0).sqrt()
}

/// A picture that has met no light with so many samples a pixel is left black: more would hardly find what those did not.
const BLACK_UNTIL: u32 = 256;

/// Passes do not get shorter than this part of what is there: an error that is just missed is not paid for many times.
pub(super) const SHORTEST: f64 = 1.0 / 32.0;

impl Stop {
    /// Whether anything but samples may end the render.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.error.is_some() || self.time.is_some()
    }

    /// The error at which to end: what is asked for, or what the file can hold.
    pub(super) fn target(&self) -> Option<f64> {
        self.error.map(|error| error.max(self.floor))
    }

    /// Whether a target is reached after `milestones`.
    #[must_use]
    pub fn reached(&self, milestones: &[Milestone]) -> bool {
        let Some(last) = milestones.last() else { return false };
        let below = |m: &Milestone, target: f64| m.error.is_some_and(|e| e.rel_rmse <= target);
        // A few samples that have not met the light yet look even: an error that cannot be believed has to be there twice.
        let believed = last.error.is_some_and(|e| e.valid);
        let twice = |target| milestones.iter().nth_back(1).is_some_and(|m| below(m, target));
        let error = self.target().is_some_and(|target| below(last, target) && (believed || twice(target)));
        // Where nothing but the error would end it.
        let alone = self.error.is_some() && self.time.is_none() && !self.samples_wanted;
        let hopeless = alone && last.unknown == Some(NoEstimate::Black) && last.samples >= BLACK_UNTIL;
        error || hopeless || self.time.is_some_and(|time| last.elapsed >= time)
    }

    /// The samples at which the pass ends that begins after `course`, with at most `most` samples in all; none where
    /// what is left of the time does not suffice for any.
    #[must_use]
    pub fn pass_end<'a>(&self, course: impl Into<Course<'a>>, most: u32) -> Option<u32> {
        let course = course.into();
        let replicates = REPLICATES as u32;
        let Some(last) = course.milestones.last() else { return Some(replicates.min(most)) };
        // The time is a bound.
        let most = match self.samples_left(course, most) {
            Some(left) if left < f64::from(replicates) => return None,
            Some(left) => {
                let end = last.samples.saturating_add(left as u32);
                most.min((end - end % replicates).max(last.samples + replicates))
            }
            None => most,
        };
        // No pass steps over a power of two, at which samples lie more evenly than at the next larger numbers.
        let mut end = f64::from(pass_end(last.samples, most));
        if let (Some(target), Some(fit)) = (self.target(), Fit::of(course)) {
            end = end.min(fit.samples_for(target).max(f64::from(last.samples) * (1.0 + SHORTEST)));
        }
        let end = (end.ceil() as u32).next_multiple_of(replicates).max(last.samples + replicates);
        Some(end.min(most))
    }

    /// Samples of a pixel at the end, of at most `most`, as far as `course` foretells it: where no error is known, the time is.
    #[must_use]
    pub fn foreseen<'a>(&self, course: impl Into<Course<'a>>, most: u32) -> f64 {
        let course = course.into();
        Forecast::of(course, self, most).map_or_else(|| self.in_time(course, most), |forecast| forecast.samples)
    }

    /// Samples of a pixel for which there is time in all, at most `most`.
    pub(super) fn in_time(&self, course: Course, most: u32) -> f64 {
        let now = course.milestones.last().map_or(0, |m| m.samples);
        let in_time = self.samples_left(course, most).map_or(f64::INFINITY, |left| f64::from(now) + left);
        f64::from(most).min(in_time)
    }

    /// How many more samples the time leaves room for after `course`, whose picture has `most` at the most; none where there is no
    /// such bound.
    fn samples_left(&self, course: Course, most: u32) -> Option<f64> {
        let last = course.milestones.last()?;
        let left = self.time?.saturating_sub(last.elapsed).as_secs_f64() / seconds_a_sample(course)?;
        let now = f64::from(last.samples);
        Some(course.samples_for(course.spent(now) + left, now, most.into()) - now)
    }

    /// What keeps the targets from being met, if they are not.
    ///
    /// # Errors
    /// [`Error::Render`] in words for whoever set the targets.
    pub fn check(&self, milestones: &[Milestone]) -> Result<()> {
        let Some(last) = milestones.last() else { return Ok(()) };
        if let Some(asked) = self.error {
            let found = match last.error {
                Some(e) => format!("the picture is written with an error of {:.3e}", e.rel_rmse),
                None => match last.unknown {
                    Some(NoEstimate::Black) => "the picture is written, and black".to_owned(),
                    Some(why) => format!("the picture is written, its error is unknown: {why}"),
                    None => "the picture is written, its error is unknown".to_owned(),
                },
            };
            if asked < self.floor && last.error.is_some_and(|e| e.rel_rmse <= self.floor) {
                return Err(Error::Render(format!(
                    "stop.error: {asked:.3e} is below {:.1e}, what rounding to the precision of the file makes; {found}; \
                     output.exr.precision: float holds more",
                    self.floor
                )));
            }
            // A time ends a render where less is left of it than four samples take, which is no more than what has passed.
            let in_time = self.time.is_none_or(|time| last.elapsed < time.mul_f64(0.5));
            if last.error.is_none_or(|e| e.rel_rmse > asked) && !self.samples_wanted && in_time {
                return Err(Error::Render(format!(
                    "stop.error: {asked:.3e} was not reached with {} samples a pixel; {found}",
                    last.samples
                )));
            }
        }
        if let (Some(time), [first]) = (self.time, milestones)
            && first.elapsed.as_secs_f64() > time.as_secs_f64() * if first.samples > 1 { 1.5 } else { 1.0 }
        {
            return Err(Error::Render(format!(
                "stop.time: {time:?} is too short for {} samples of each pixel, which took {:.1?}; they are written",
                first.samples, first.elapsed
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::forecast::tests::{FREE, milestones};
    use super::*;

    /// A picture that has not converged may look better than it is: errors of 1/2, 0.35, 0.25, the last two not to be
    /// believed, and one that is unknown.
    #[test]
    fn an_error_that_cannot_be_believed_has_to_be_there_twice() {
        let stop = |error| Stop { error: Some(error), ..FREE };
        let mut known = milestones(&[4, 8, 16], 1.0);
        assert!(stop(0.3).reached(&known));
        known[1..].iter_mut().for_each(|m| m.error.as_mut().unwrap().valid = false);
        assert!(!stop(0.3).reached(&known) && stop(0.4).reached(&known));
        assert_eq!(stop(0.3).pass_end(&known, 1000), Some(20));
        known[2].error = None;
        assert!(!stop(0.4).reached(&known));
    }

    /// Where nothing else ends it, a picture that stays black does not take all samples there are.
    #[test]
    fn a_picture_that_stays_black_is_given_up() {
        let stop = Stop { error: Some(0.1), samples_wanted: false, ..FREE };
        let mut known = milestones(&[64, 128, 256], 1.0);
        known.iter_mut().for_each(|m| (m.error, m.unknown) = (None, Some(NoEstimate::Black)));
        assert!(stop.reached(&known) && !stop.reached(&known[..2]));
        assert!(
            stop.check(&known)
                .unwrap_err()
                .to_string()
                .ends_with("256 samples a pixel; the picture is written, and black")
        );
        let others = [Stop { samples_wanted: true, ..stop }, Stop { time: Some(Duration::from_secs(9)), ..stop }];
        assert!(others.iter().all(|stop| !stop.reached(&known)));
    }

    /// A time that is far away does not excuse an error that was not reached, where the most samples ended the render.
    #[test]
    fn what_ends_before_its_time_without_its_error_is_told() {
        let known = milestones(&[16_384, 32_768, 65_536], 1.0);
        let stop = |seconds| Stop {
            error: Some(1e-9),
            time: Some(Duration::from_secs(seconds)),
            samples_wanted: false,
            floor: 0.0,
        };
        assert!(stop(3600).check(&known).unwrap_err().to_string().contains("was not reached with 65536 samples"));
        stop(66).check(&known).unwrap();
        Stop { samples_wanted: true, ..stop(3600) }.check(&known).unwrap();
    }

    /// Eight samples of a millisecond each, whose error nobody knows: 12 ms more have room for twelve. With no time, or more of it,
    /// as many as there may be.
    #[test]
    fn a_time_foretells_samples_where_no_error_is_known() {
        let mut known = milestones(&[4, 8], 1.0);
        known.iter_mut().for_each(|m| (m.error, m.unknown) = (None, Some(NoEstimate::Black)));
        let foreseen = |stop: Stop, most| (stop.foreseen(&known, most) * 1e6).round() * 1e-6;
        let time = |millis| Stop { time: Some(Duration::from_millis(millis)), ..FREE };
        assert_eq!((foreseen(time(20), 65_536), foreseen(time(20), 16)), (20.0, 16.0));
        assert_eq!((foreseen(time(100_000), 65_536), foreseen(FREE, 65_536)), (65_536.0, 65_536.0));
        assert_eq!(time(20).foreseen(&[], 65_536), 65_536.0);
    }

    /// However far away a time is.
    #[test]
    fn a_time_may_be_as_long_as_there_is() {
        let stop = Stop { time: Some(Duration::MAX), ..FREE };
        stop.check(&milestones(&[4], 1.0)).unwrap();
    }

    #[test]
    fn without_targets_passes_double_up_to_the_samples() {
        let mut known: Vec<u32> = Vec::new();
        while known.last() != Some(&21) {
            known.push(FREE.pass_end(&milestones(&known, 1.0), 21).unwrap());
        }
        assert_eq!(known, [4, 8, 16, 21]);
        assert_eq!(FREE.pass_end(&[], 3), Some(3));
    }

    /// An error of 0.1 takes 100 samples where b = 1, 22 where b = 1.5 (10^(4/3) = 21.5, in fours).
    #[test]
    fn the_last_pass_ends_where_the_error_is_forecast_to_be_reached() {
        let stop = Stop { error: Some(0.1), ..FREE };
        assert_eq!(stop.pass_end(&milestones(&[16, 32, 64], 1.0), 1 << 16), Some(100));
        assert_eq!(stop.pass_end(&milestones(&[4, 8, 16], 1.5), 1 << 16), Some(24));
        assert!(stop.reached(&milestones(&[32, 64, 100], 1.0)) && !stop.reached(&milestones(&[32, 64, 99], 1.0)));
        // A time that is far away changes none of that, though what the error asks for is less than four samples more.
        let long = Stop { time: Some(Duration::from_secs(60)), ..stop };
        assert_eq!(long.pass_end(&milestones(&[16, 32, 64], 1.0), 1 << 16), Some(100));
        let near = Stop { error: Some(0.245), ..long };
        assert_eq!(near.pass_end(&milestones(&[4, 8, 16], 1.0), 1 << 16), Some(20));
        // Just missed: a thirty-second more, not four samples.
        let stop = Stop { error: Some(0.03), ..FREE };
        assert_eq!(stop.pass_end(&milestones(&[272, 544, 1088], 1.0), 1 << 16), Some(1124));
        // Just short of a power of two: on to that, however far away the target is.
        let stop = Stop { error: Some(1e-3), ..FREE };
        assert_eq!(stop.pass_end(&milestones(&[64, 128, 252], 1.0), 1 << 16), Some(256));
        assert_eq!(stop.pass_end(&milestones(&[64, 128, 256], 1.0), 1 << 16), Some(512));
    }

    /// A sample takes a millisecond: after 64 there is time for 30 more, of which 28 make whole rounds of the replicates.
    #[test]
    fn the_last_pass_fits_into_the_time() {
        let stop = Stop { time: Some(Duration::from_millis(94)), ..FREE };
        assert_eq!(stop.pass_end(&milestones(&[32, 64], 1.0), 1 << 16), Some(92));
        assert_eq!(stop.pass_end(&milestones(&[32, 64, 92], 1.0), 1 << 16), None);
        assert!(stop.check(&milestones(&[32, 64, 92], 1.0)).is_ok());
        let short = Stop { time: Some(Duration::from_millis(1)), ..FREE };
        let says = |stop: Stop| stop.check(&milestones(&[4], 1.0)).unwrap_err().to_string();
        assert!(says(short).starts_with("stop.time: 1ms is too short for 4 samples"));
        // To three decimals it was 0.000 s.
        let shorter = Stop { time: Some(Duration::from_micros(100)), ..FREE };
        assert!(says(shorter).starts_with("stop.time: 100µs is too short for 4 samples"));
    }

    #[test]
    fn targets_that_cannot_be_reached_are_told() {
        let low = Stop { error: Some(1e-5), floor: rounding(11), samples_wanted: false, time: None };
        let known = milestones(&[4, 100_000_000], 1.0);
        assert!(low.reached(&known));
        assert!(low.check(&known).unwrap_err().to_string().contains("output.exr.precision: float"));
        let far = Stop { error: Some(0.01), samples_wanted: false, ..FREE };
        assert!(far.check(&milestones(&[4, 64], 1.0)).unwrap_err().to_string().contains("was not reached with 64"));
        assert!(Stop { samples_wanted: true, ..far }.check(&milestones(&[4, 64], 1.0)).is_ok());
    }

    /// All halves of even logarithm between 1 and 2: the root mean square of what rounding changes.
    #[test]
    fn rounding_makes_the_error_that_it_is_said_to_make() {
        let n = 100_000;
        let sum: f64 = (0..n)
            .map(|i| {
                let x = 2f64.powf((f64::from(i) + 0.5) / f64::from(n));
                let rounded = (x * 1024.0).round() / 1024.0;
                (rounded / x - 1.0).powi(2)
            })
            .sum();
        let found = (sum / f64::from(n)).sqrt();
        assert!((found / rounding(11) - 1.0).abs() < 0.01, "{found} {}", rounding(11));
    }
}
