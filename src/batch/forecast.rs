//! What a render is foretold.
//!
//! Variance falls as samples^−b, with b between 1 (independent samples) and 2 or so (evenly spread ones), or below 1 where
//! bright light is still turning up. The last passes, each of which doubles the samples, tell b, as far as their errors are
//! known. From it follow the samples that an error takes and, as a sample takes as long as those of the last pass, the time.
//!
//! Where samples are shared out by noise, all of that is said of a picture whose pixels have as many each, and `outlook.rs` tells what
//! sharing out makes of its variance and of its time.

use super::adaptive;
use super::frame::Milestone;
use super::outlook::Outlook;
use super::stop::{SHORTEST, Stop};
use crate::film::error::ErrorEstimate;
use crate::math::statistics::normal_quantile;
use serde::{Deserialize, Serialize};

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
    pub(super) fn spent(&self, samples: f64) -> f64 {
        self.outlook.map_or(samples, |outlook| outlook.spent(samples))
    }

    /// The samples of the mean, beyond `now`, that take `spent` ones of all pixels; infinite where `most` of the mean take less.
    pub(super) fn samples_for(&self, spent: f64, now: f64, most: f64) -> f64 {
        match self.outlook {
            None => spent,
            Some(_) if self.spent(most) <= spent => f64::INFINITY,
            Some(_) => bisect(now, most, |samples| self.spent(samples) > spent)[0],
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

/// Seconds that a sample of all pixels takes: those of the last pass.
pub(super) fn seconds_a_sample(course: Course) -> Option<f64> {
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
            // That changes samples by a share at the most.
            Some(_) if uniform.is_finite() => {
                let (low, high) = (uniform / adaptive::MOST, uniform * adaptive::MOST);
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
pub(super) mod tests {
    use super::super::outlook::Kind;
    use super::*;
    use crate::math::sampler::uniform;
    use std::time::Duration;

    /// After `samples`, a millisecond each, an error of √(1/N^b).
    pub fn milestones(samples: &[u32], b: f64) -> Vec<Milestone> {
        let of = |&n: &u32| {
            let rel_rmse = f64::from(n).powf(-0.5 * b);
            let error = ErrorEstimate { rel_rmse, low: rel_rmse, high: rel_rmse, pixels: 100, valid: true };
            Milestone { samples: n, elapsed: Duration::from_millis(n.into()), error: Some(error), unknown: None }
        };
        samples.iter().map(of).collect()
    }

    /// No target.
    pub const FREE: Stop = Stop { error: None, time: None, samples_wanted: true, floor: 0.0 };

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
