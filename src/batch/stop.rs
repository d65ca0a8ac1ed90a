//! When a render ends, and when it will.
//!
//! Variance falls as samples^−b, with b between 1 (independent samples) and 2 or so (evenly spread ones), or below 1 where
//! bright light is still turning up. The last passes, each of which doubles the samples, tell b, as far as their errors are
//! known. From it follow the samples that an error takes and, as a sample takes as long as those of the last pass, the time.
//! Passes are cut short where the forecast says that the target lies before the next doubling.
//!
//! Where samples are shared out by noise, all of that is said of a picture whose pixels have as many each, and an [`Outlook`] tells what
//! sharing out makes of its variance and of its time.

use super::frame::{Milestone, pass_end};
use super::outlook::Outlook;
use crate::error::{Error, Result};
use crate::film::accumulate::REPLICATES;
use crate::film::error::{ErrorEstimate, NoEstimate};
use crate::math::statistics::normal_quantile;
use serde::{Deserialize, Serialize};
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

/// How a render has come so far.
#[derive(Clone, Copy, Debug)]
pub struct Course<'a> {
    /// After each pass.
    pub milestones: &'a [Milestone],
    /// What sharing out does, where samples are shared out.
    pub outlook: Option<&'a Outlook>,
}

impl<'a, T: AsRef<[Milestone]> + ?Sized> From<&'a T> for Course<'a> {
    fn from(milestones: &'a T) -> Course<'a> {
        Course { milestones: milestones.as_ref(), outlook: None }
    }
}

impl Course<'_> {
    /// The variance at `samples` over that of a picture whose pixels have as many each.
    fn shared(&self, samples: f64) -> f64 {
        self.outlook.map_or(1.0, |outlook| outlook.variance(samples, usual_slope(samples, true)))
    }

    /// What `samples` of the mean take, in samples of all pixels.
    fn spent(&self, samples: f64) -> f64 {
        self.outlook.map_or(samples, |outlook| outlook.spent(samples))
    }

    /// The samples of the mean, at most `most`, that take no more than `spent` ones of all pixels.
    fn samples_for(&self, spent: f64, most: f64) -> f64 {
        match self.outlook {
            None => spent.min(most),
            Some(_) if self.spent(most) <= spent => most,
            Some(_) => bisect(0.0, most, |samples| self.spent(samples) > spent)[0],
        }
    }
}

/// Two numbers next to each other, from `low`, where `above` is false, and `high`, where it is true, between which it becomes so.
fn bisect(mut low: f64, mut high: f64, above: impl Fn(f64) -> bool) -> [f64; 2] {
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        *(if above(middle) { &mut high } else { &mut low }) = middle;
    }
    [low, high]
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
const SHORTEST: f64 = 1.0 / 32.0;

impl Stop {
    /// Whether anything but samples may end the render.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.error.is_some() || self.time.is_some()
    }

    /// The error at which to end: what is asked for, or what the file can hold.
    fn target(&self) -> Option<f64> {
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
    fn in_time(&self, course: Course, most: u32) -> f64 {
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
        // Beyond the most nothing is to be told apart.
        let most = f64::from(most).max(now);
        let bounded = |spent: f64| course.samples_for(spent, most).max(now);
        let spent = course.spent(now) + left;
        Some(if spent < course.spent(most) { bounded(spent) - now } else { left })
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

/// Seconds that a sample of all pixels takes: those of the last pass.
fn seconds_a_sample(course: Course) -> Option<f64> {
    let last = course.milestones.last()?;
    let before = course.milestones.len().checked_sub(2).map(|i| course.milestones[i]);
    let spent = |m: &Milestone| course.spent(m.samples.into());
    let (samples, seconds) = match before {
        Some(m) => (spent(last) - spent(&m), (last.elapsed.saturating_sub(m.elapsed)).as_secs_f64()),
        None => (spent(last), last.elapsed.as_secs_f64()),
    };
    (samples > 0.0 && seconds > 0.0).then(|| seconds / samples)
}

/// How variance falls with samples: V = V₁ (N₁/N)^b where all pixels have as many.
#[derive(Clone, Copy, Debug)]
pub struct Fit<'a> {
    /// N₁, that of the last milestone.
    samples: f64,
    /// √V₁.
    error: f64,
    /// b: below 1, bright light is so rare that more of it turns up with every sample.
    slope: f64,
    /// Variance of ln V₁ as told.
    told: f64,
    /// Variance of b.
    unsteady: f64,
    /// How far ln N₁ is from the middle of what told b, which V₁ has a part in.
    beyond: f64,
    /// What it goes through, which knows how samples are shared out.
    course: Course<'a>,
}

/// How far logarithms of variance lie off their line besides what their intervals say: 0.07 in 118 triples of doublings over the
/// gallery; 0.2 foretells as well.
const SCATTER: f64 = 0.1;

/// What an error that cannot be believed adds to the variance of that logarithm: a few pixels carry it.
const UNBELIEVED: f64 = 0.2;

/// The slope at `samples`, before any is seen: that of V = α/N + β/N², as few samples gain by how evenly they are spread and many
/// do as if they were independent, with β/α of three samples. Errors that cannot be believed fall a little slower. See "What is
/// foretold" in tools/bench/NOTES.md.
pub(super) fn usual_slope(samples: f64, believed: bool) -> f64 {
    1.0 + 3.0 / (samples + 3.0) - if believed { 0.0 } else { 0.05 }
}

/// How far off that slopes are.
const UNUSUAL: f64 = 0.35;

impl<'a> Fit<'a> {
    /// Through the last milestone, with the slope in the middle of the last three that lie a doubling or so apart: by least
    /// squares over logarithms, each weighed by its interval, and with what slopes are before any is seen. So what few
    /// pixels carry, of which the error is a guess, tells no slope, and one milestone alone has the usual one.
    #[must_use]
    pub fn of(course: impl Into<Course<'a>>) -> Option<Fit<'a>> {
        let course = course.into();
        let mut points: Vec<(f64, &ErrorEstimate)> = Vec::new();
        for m in course.milestones.iter().rev() {
            let Some(e) = m.error.as_ref().filter(|e| e.rel_rmse > 0.0) else { continue };
            let apart = points.last().is_none_or(|p| f64::from(m.samples) <= p.0 / 1.4);
            if apart && points.len() < 3 {
                points.push((f64::from(m.samples), e));
            }
        }
        let &(samples, last) = points.first()?;
        let uniform = |samples: f64, e: &ErrorEstimate| e.rel_rmse / course.shared(samples).sqrt();
        let log = |samples: f64, e: &ErrorEstimate| 2.0 * libm::log(uniform(samples, e));
        let logs = points.iter().map(|(samples, e)| (1.0 / log_variance(e), libm::log(*samples), log(*samples, e)));
        let (w, x, y) = logs.clone().fold((0.0, 0.0, 0.0), |(a, b, c), (w, x, y)| (a + w, b + w * x, c + w * y));
        let (x, y) = (x / w, y / w);
        let (xy, xx) =
            logs.fold((0.0, 0.0), |(a, b), (w, u, v)| (a + w * (u - x) * (v - y), b + w * (u - x) * (u - x)));
        let usual = 1.0 / (UNUSUAL * UNUSUAL);
        let slope = (usual * usual_slope(samples, last.valid) - xy) / (usual + xx);
        let fit = Fit::with_slope(samples, uniform(samples, last), slope);
        // The interval of an error that cannot be believed cannot, either.
        let told = if last.valid { log_variance(last) } else { SCATTER * SCATTER + UNBELIEVED };
        Some(Fit { told, unsteady: 1.0 / (usual + xx), beyond: libm::log(samples) - x, course, ..fit })
    }

    /// Through `error` at `samples`, from where variance falls as samples^−slope, from 0 to 2; both are certain.
    #[must_use]
    pub fn with_slope(samples: f64, error: f64, slope: f64) -> Fit<'a> {
        let course = Course { milestones: &[], outlook: None };
        Fit { samples, error, slope: slope.clamp(0.0, 2.0), told: 0.0, unsteady: 0.0, beyond: 0.0, course }
    }

    /// Samples at which the error is `error`; infinite where it does not fall.
    #[must_use]
    pub fn samples_for(&self, error: f64) -> f64 {
        let uniform = self.samples * libm::pow(self.error / error, 2.0 / self.slope);
        let reached = |samples: f64| self.error_at(samples) <= error;
        match self.course.outlook {
            // Sharing out may take as many times the samples as the largest share at the most, at either end.
            Some(_) if uniform.is_finite() => {
                let (low, high) = (uniform / 64.0, uniform * 64.0);
                if reached(low) { low } else { bisect(low, high, reached)[1] }
            }
            _ => uniform,
        }
    }

    /// The error at `samples`.
    #[must_use]
    pub fn error_at(&self, samples: f64) -> f64 {
        self.error * libm::pow(self.samples / samples, 0.5 * self.slope) * self.course.shared(samples).sqrt()
    }

    /// What `samples` of the mean take over what those so far take.
    #[must_use]
    pub fn times_as_long(&self, samples: f64) -> f64 {
        self.course.spent(samples) / self.course.spent(self.samples)
    }

    /// How far ln V at `samples`, as it will be told, lies from what is foretold, 95 times of 100. Let x be ln(N/N₁) and d how far ln N₁
    /// is beyond the middle. What ln V₁ is told wrong by, of variance σ², moves b by d σ_b²/σ² of itself; of what ln V will be told
    /// wrong by, as large, N₁/N is the same, since so many of the samples are. So ln V is off by 2 σ² f + σ_b² (x² + 2 x d f), where
    /// f = 1 − N₁/N.
    fn log_half_width(&self, samples: f64) -> f64 {
        let x = libm::log(samples / self.samples);
        let fresh = -libm::expm1(-x);
        let slope = self.unsteady * x * (x + 2.0 * self.beyond * fresh);
        normal_quantile(0.975) * (2.0 * self.told * fresh + slope).sqrt()
    }

    /// Between what the error at `samples` lies, 95 times of 100.
    fn error_between(&self, samples: f64) -> [f64; 2] {
        let [error, factor] = [self.error_at(samples), libm::exp(0.5 * self.log_half_width(samples))];
        [error / factor, error * factor]
    }

    /// Between what the samples lie at which the error is `error`, 95 times of 100: where that is at either end of what the error
    /// there lies between, or at some number beyond `most`.
    fn samples_between(&self, error: f64, most: f64) -> [f64; 2] {
        [0, 1].map(|end| {
            let reached = |samples: f64| self.error_between(samples)[end] <= error;
            let (mut low, mut high) = (self.samples, self.samples);
            while high < most && !reached(high) {
                (low, high) = (high, 2.0 * high);
            }
            bisect(low, high, reached)[1]
        })
    }
}

/// Variance of ln V as `error` tells it.
fn log_variance(error: &ErrorEstimate) -> f64 {
    SCATTER * SCATTER + error.log_variance() + if error.valid { 0.0 } else { UNBELIEVED }
}

/// Where a render will end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Forecast {
    /// Samples of a pixel when it was made.
    pub made_at: u32,
    /// Samples of a pixel at the end.
    pub samples: f64,
    /// Seconds of rendering in all.
    pub seconds: f64,
    /// Relative RMSE at the end.
    pub error: f64,
    /// Between what that lies, 95 times of 100, as far as it goes on as it has. An error that ends the render is no more than its
    /// target.
    pub error_between: [f64; 2],
    /// Between what the seconds lie, 95 times of 100, as far as an error ends the render; a sample is taken to last as long as before.
    pub seconds_between: [f64; 2],
}

impl Forecast {
    /// From what is known after `course`, for a render of at most `most` samples.
    #[must_use]
    pub fn of<'a>(course: impl Into<Course<'a>>, stop: &Stop, most: u32) -> Option<Forecast> {
        let course = course.into();
        let last = course.milestones.last()?;
        let fit = Fit::of(course)?;
        let rate = seconds_a_sample(course)?;
        let now = f64::from(last.samples);
        let elapsed = last.elapsed.as_secs_f64();
        // What ends the render besides the error.
        let most = stop.in_time(course, most);
        let within = |samples: f64| samples.max(now).min(most);
        let reached = stop.target().map_or(most, |target| fit.samples_for(target));
        let between = stop.target().map_or([most; 2], |target| fit.samples_between(target, most));
        // An error that cannot be believed has to be there twice.
        let once_more = 1.0 + if last.error.is_some_and(|e| e.valid) { 0.0 } else { SHORTEST };
        let samples = within(reached * once_more);
        let samples_between = between.map(|samples| within(samples * once_more));
        let seconds = |samples: f64| elapsed + (course.spent(samples) - course.spent(now)) * rate;
        let error = fit.error_at(within(reached));
        // What is told at the end scatters, below a target as well: a render ends where it is told that or less.
        let [low, high] = fit.error_between(samples);
        let high = match stop.target() {
            None => high,
            // What ends the render is reached, or all else ends before.
            Some(_) if samples_between[1] < most => error,
            Some(_) => fit.error_between(most)[1].max(error),
        };
        let error_between = [low, high];
        Some(Forecast {
            made_at: last.samples,
            samples,
            seconds: seconds(samples),
            error,
            error_between,
            seconds_between: samples_between.map(seconds),
        })
    }

    /// The forecast that was made at the last milestone of `course` with at most a quarter of the samples: what to hold against
    /// how it came.
    #[must_use]
    pub fn at_a_quarter<'a>(course: impl Into<Course<'a>>, stop: &Stop, most: u32) -> Option<Forecast> {
        let Course { milestones, outlook } = course.into();
        let end = milestones.last()?.samples;
        let known = milestones.iter().take_while(|m| m.samples <= end / 4).count();
        let milestones = &milestones[..known];
        // Before its samples were shared out nobody knew how.
        let outlook = outlook.filter(|outlook| milestones.last().is_some_and(|last| outlook.is_known_at(last.samples)));
        Forecast::of(Course { milestones, outlook }, stop, most)
    }
}

#[cfg(test)]
mod tests {
    use super::super::outlook::Kind;
    use super::*;
    use crate::math::sampler::uniform;

    /// After `samples`, a millisecond each, an error of √(1/N^b).
    fn milestones(samples: &[u32], b: f64) -> Vec<Milestone> {
        let of = |&n: &u32| {
            let rel_rmse = f64::from(n).powf(-0.5 * b);
            let error = ErrorEstimate { rel_rmse, low: rel_rmse, high: rel_rmse, pixels: 100, valid: true };
            Milestone { samples: n, elapsed: Duration::from_millis(n.into()), error: Some(error), unknown: None }
        };
        samples.iter().map(of).collect()
    }

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

    const FREE: Stop = Stop { error: None, time: None, samples_wanted: true, floor: 0.0 };

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
    fn a_forecast_follows_the_slope_and_the_rate() {
        let stop = Stop { error: Some(0.01), ..FREE };
        let f = Forecast::of(&milestones(&[16, 32, 64], 1.0), &stop, 1 << 16).unwrap();
        let samples = 64.0 * libm::pow(12.5, 2.0 / told(1.0, 64.0));
        assert!((f.samples / samples - 1.0).abs() < 1e-12 && (f.seconds - 1e-3 * samples).abs() < 1e-9, "{f:?}");
        assert!((f.error - 0.01).abs() < 1e-12);
        // What ends the render is the target or less; where samples end before, as many as it takes or a fortieth of them, what comes is
        // as without a target.
        let free = |samples| Forecast::of(&milestones(&[16, 32, 64], 1.0), &FREE, samples).unwrap().error_between;
        let near = |a: [f64; 2], b: [f64; 2]| a.iter().zip(b).all(|(a, b)| (a / b - 1.0).abs() < 1e-9);
        assert!(free(9_000)[0] > f.error_between[0] && f.error_between[0] > free(10_000)[0], "{f:?}");
        assert_eq!(f.error_between[1], f.error);
        for most in [9_000, 256] {
            let short = Forecast::of(&milestones(&[16, 32, 64], 1.0), &stop, most).unwrap();
            assert!(near(short.error_between, free(most)), "{short:?}");
            assert!(
                short.error_between[0] < 0.9 * short.error && short.error_between[1] > 1.1 * short.error,
                "{short:?}"
            );
        }
        let all = milestones(&[4, 8, 16, 32, 64], 1.2);
        let quarter = Forecast::at_a_quarter(&all, &FREE, 64).unwrap();
        assert_eq!(quarter.made_at, 16);
        let expected = 16f64.powf(-0.6) * 4f64.powf(-0.5 * told(1.2, 16.0));
        assert!((quarter.error / expected - 1.0).abs() < 1e-12);
        assert!(Forecast::at_a_quarter(&all[..1], &FREE, 4).is_none());
    }

    /// Pictures whose errors are what the intervals are made of: slopes of the usual one ± 0.35, told errors off by SCATTER, that at four
    /// times the samples by a quarter of what the last is and by something of its own. Of 2000 the interval of the error there, and
    /// that of the samples to it, hold 95 % ± 2 % (four standard errors). Slopes that are far off are few: the clamp to 0 to 2 is at
    /// 2.6 standard deviations and more.
    #[test]
    fn what_is_foretold_lies_within_its_interval() {
        const DRAWS: u64 = 2000;
        let stop = |target| Stop { error: Some(target), ..FREE };
        let held = (0..DRAWS).map(|draw| {
            let normal = |i: u64| normal_quantile(uniform(draw, i));
            let b = (usual_slope(64.0, true) + UNUSUAL * normal(0)).clamp(0.05, 1.95);
            let told = |n: u32, off: f64| f64::from(n).powf(-0.5 * b) * (0.5 * SCATTER * off).exp();
            let mut known = milestones(&[16, 32, 64], 1.0);
            for (m, i) in known.iter_mut().zip(1..) {
                let rel_rmse = told(m.samples, normal(i));
                m.error = Some(ErrorEstimate { rel_rmse, low: rel_rmse, high: rel_rmse, pixels: 100, valid: true });
            }
            let came = told(256, 0.25 * normal(3) + (1.0 - 0.25f64 * 0.25).sqrt() * normal(4));
            let [low, high] = Forecast::of(&known, &FREE, 256).unwrap().error_between;
            let [soon, late] = Forecast::of(&known, &stop(came), 1 << 16).unwrap().seconds_between;
            [(low..=high).contains(&came), (soon..=late).contains(&0.256)]
        });
        let held = held.fold([0, 0], |[a, b], [x, y]| [a + u64::from(x), b + u64::from(y)]);
        for held in held {
            let share = held as f64 / DRAWS as f64;
            assert!((share - 0.95).abs() < 4.0 * (0.95 * 0.05 / DRAWS as f64).sqrt(), "{share}");
        }
    }

    /// How much of a slope's distance from the usual one counts that errors without scatter tell, at three doublings: their
    /// weight is 2 ln² 2 / SCATTER², that of what is usual 1/UNUSUAL².
    const KNOWN: f64 = {
        let seen = 200.0 * std::f64::consts::LN_2 * std::f64::consts::LN_2;
        seen / (seen + 1.0 / (UNUSUAL * UNUSUAL))
    };

    /// The slope that three doublings up to `samples` tell, whose variance falls with slope `b`.
    fn told(b: f64, samples: f64) -> f64 {
        let usual = usual_slope(samples, true);
        usual + (b - usual) * KNOWN
    }

    /// Independent samples: error ∝ N^−½, so four times the samples. Evenly spread ones, N^−1 all but what is usual, half as many;
    /// light that still turns up, N^−¼: nearly sixteen times.
    #[test]
    fn halving_costs_what_the_convergence_says() {
        let factor = |b: f64| {
            let known = milestones(&[64, 128, 256], b);
            let fit = Fit::of(&known).unwrap();
            let samples = fit.samples_for(0.5 * fit.error_at(256.0));
            assert!((fit.error_at(samples) / fit.error_at(256.0) - 0.5).abs() < 1e-12);
            samples / 256.0
        };
        for b in [1.0, 2.0, 0.5] {
            let expected = 4f64.powf(1.0 / told(b, 256.0));
            assert!((factor(b) / expected - 1.0).abs() < 1e-9, "{b}: {} {expected}", factor(b));
        }
    }

    /// The first of three is off by ten times, as where two pixels carry the error: the slope is that of the others.
    #[test]
    fn errors_that_nobody_knows_tell_no_slope() {
        let mut known = milestones(&[16, 32, 64], 1.0);
        let first = known[0].error.as_mut().unwrap();
        (first.rel_rmse, first.high) = (10.0 * first.rel_rmse, 1e4);
        let there = Fit::of(&known).unwrap().error_at(256.0);
        assert!((there * 16.0 - 1.0).abs() < 0.02, "{there}");
    }

    /// A picture whose light is still turning up after doubling upon doubling has no end in sight.
    #[test]
    fn an_error_that_does_not_fall_is_never_reached() {
        let fit = Fit::with_slope(64.0, 0.5, 0.0);
        assert_eq!((fit.error_at(1e6), fit.samples_for(0.25)), (0.5, f64::INFINITY));
        assert_eq!(fit.samples_for(0.5), 64.0);
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

    /// Half of the picture has all of its noise: shared out by √v at 32 samples, with a fourth of the mean in the quiet half. Errors that were
    /// told before and after make one picture, whose slope is that of its pixels; its samples take as long as those of all pixels.
    #[test]
    fn sharing_out_is_foretold() {
        let (share, slope) = (libm::log2(1.75) * 16.0, usual_slope(1024.0, true));
        let kind = |share: f64, variance| Kind { share: share.round() as i16, variance, cost: 1.0 };
        let outlook = Outlook::new(32, vec![kind(share, 1.0), kind(-32.0, 0.0)]);
        let mut known = milestones(&[8, 16, 32, 64, 128], slope);
        for m in &mut known {
            let n = f64::from(m.samples);
            let error = m.error.as_mut().unwrap();
            error.rel_rmse *= outlook.variance(n, usual_slope(n, true)).sqrt();
            m.elapsed = Duration::from_secs_f64(1e-3 * outlook.spent(n));
        }
        // 128 of the mean are 256 of one half and 32 of the other, 512 are 1024 and 128.
        assert_eq!((outlook.spent(128.0), outlook.spent(512.0)), (144.0, 576.0));
        for told in [&known[..3], &known[..]] {
            let course = Course { milestones: told, outlook: Some(&outlook) };
            let there = Forecast::of(course, &FREE, 512).unwrap();
            let came = libm::pow(1024.0, -0.5 * slope);
            assert!(
                (there.error / came - 1.0).abs() < 0.03 && (there.seconds / 0.576 - 1.0).abs() < 1e-9,
                "{there:?} {came}"
            );
            let stop = Stop { error: Some(came), ..FREE };
            let f = Forecast::of(course, &stop, 1 << 16).unwrap();
            // Counts are powers of two: half of a step is a factor of √2.
            assert!((256.0..=725.0).contains(&f.samples), "{f:?}");
            let fit = Fit::of(course).unwrap();
            assert!(fit.error_at(fit.samples_for(came)) <= came);
        }
        // A time for twice as much as 144 ms leaves room for as much again.
        let stop = Stop { time: Some(Duration::from_millis(288)), ..FREE };
        let course = Course { milestones: &known, outlook: Some(&outlook) };
        let in_time = stop.foreseen(course, 1 << 16);
        assert!(outlook.spent(in_time) <= 288.0 + 1e-6 && outlook.spent(in_time + 1.0) >= 288.0 - 4.0, "{in_time}");
        // Nobody knew of it before.
        let early =
            Forecast::at_a_quarter(Course { milestones: &known[..4], outlook: Some(&outlook) }, &FREE, 64).unwrap();
        assert!((early.seconds - 0.064).abs() < 1e-9, "{early:?}");
    }
}
