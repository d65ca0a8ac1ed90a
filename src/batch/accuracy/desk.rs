//! Where the renders of a sheet are made: the small copy of a scene, one setting after the other.

use super::figures::{Reference, Replicates};
use super::knobs::{self, Trial, Way};
use super::{FEWEST, Settings};
use crate::batch::frame::{self, FrameJob, pass_end};
use crate::batch::part::{Part, Share, SplatFilm};
use crate::batch::prepare::prepare_scene;
use crate::batch::{BatchEntry, Overrides, Prepared};
use crate::error::{Error, Result};
use crate::film::resolve::{self, Image};
use crate::scene::Scene;
use crate::scene::shelf::Shelf;
use crate::spectrum::Carried;
use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What all renders of a sheet share.
pub struct Desk<'a> {
    /// The scene.
    pub entry: &'a BatchEntry,
    /// With what makes the small copy.
    pub overrides: Overrides,
    /// Ends it.
    pub stop: &'a AtomicBool,
    /// What the renders have read: those of spectra, and those of three numbers.
    shelves: [RefCell<Shelf>; 2],
}

/// What came of one render.
#[derive(Debug)]
pub struct Outcome {
    /// The picture in linear Rec. 709.
    pub image: Image,
    /// Its replicates.
    pub replicates: Vec<Option<Replicates>>,
    /// How it came to that; the last is the whole.
    pub passes: Vec<Pass>,
}

/// How far a render was after some samples.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Samples of a pixel.
    pub samples: u32,
    /// Seconds of rendering.
    pub seconds: f64,
    /// noise² of each block; empty without a reference.
    pub noise: Vec<f64>,
    /// Whether the picture's own interval of its error can be believed.
    pub converged: bool,
}

impl<'a> Desk<'a> {
    /// Where `entry` is rendered until `stop`.
    #[must_use]
    pub fn new(entry: &'a BatchEntry, overrides: Overrides, stop: &'a AtomicBool) -> Desk<'a> {
        let shelves =
            [Carried::Spectra, Carried::Colours].map(|carried| RefCell::new(Shelf { carried, ..Shelf::default() }));
        Desk { entry, overrides, stop, shelves }
    }

    /// Samples of a pixel for which the time suffices, as a first render tells it.
    ///
    /// # Errors
    /// As [`Desk::render`].
    pub fn samples(&self, settings: &Settings<'_>) -> Result<u32> {
        let Some(time) = settings.time.filter(|_| settings.samples > FEWEST) else { return Ok(settings.samples) };
        let start = Instant::now();
        let few = self.prepare(&[("render.samples".into(), FEWEST.to_string())])?;
        let (trials, ready) = (knobs::wanted(&few, settings)?, start.elapsed());
        let passes = self.follow(&[few], Way::AsSet, None)?.passes;
        let each = passes.last().map_or(0.0, |p| p.seconds) / f64::from(FEWEST);
        let work: f64 = trials.iter().map(Trial::work).sum();
        let rounds = f64::from(settings.rounds.max(1));
        let left = time.saturating_sub(ready.mul_f64(rounds * trials.len() as f64)).as_secs_f64();
        let samples = left / (each * (rounds * work + f64::from(settings.times_as_many())));
        Ok(1 << (samples.clamp(f64::from(FEWEST), f64::from(settings.samples)) as u32).ilog2())
    }

    /// The small copy with further settings.
    ///
    /// # Errors
    /// As [`super::super::prepare`].
    pub fn prepare(&self, set: &[(String, String)]) -> Result<Prepared> {
        self.prepare_with(set, Carried::Spectra, |_| {})
    }

    /// The small copy with further settings and what light is to carry, altered before it is planned.
    fn prepare_with(&self, set: &[(String, String)], carried: Carried, alter: impl Fn(&mut Scene)) -> Result<Prepared> {
        let mut overrides = self.overrides.clone();
        overrides.set.extend(set.iter().cloned());
        let description = self.entry.scene(&overrides.set)?;
        let shelf = &mut self.shelves[carried as usize].borrow_mut();
        prepare_scene(self.entry, description, &overrides, shelf, self.stop, &(), alter).map_err(|error| match error {
            Error::Stopped(_) => stopped(),
            error => error,
        })
    }

    /// Renders a setting; with a reference the noise of each pass is known.
    ///
    /// # Errors
    /// As [`super::super::prepare`] and [`Part::new`], and where it was stopped.
    pub fn render(&self, trial: &Trial, seed: u64, reference: Option<&Reference>) -> Result<Outcome> {
        let mut set = trial.set.clone();
        set.push(("render.seed".into(), seed.to_string()));
        let altered = |alter: &dyn Fn(&mut Scene)| self.prepare_with(&set, trial.way.carried(), alter);
        let prepared = match trial.way {
            Way::AsSet | Way::Independent | Way::Beside | Way::Colours => vec![altered(&|_| {})?],
            Way::Wavelengths(16) => {
                let further = altered(&|s| s.wavelengths = s.wavelengths.half_a_step_on())?;
                vec![altered(&|_| {})?, further]
            }
            Way::Wavelengths(count) => vec![altered(&|s| s.wavelengths = s.wavelengths.with_count(count))?],
        };
        self.follow(&prepared, trial.way, reference)
    }

    /// Renders copies of the scene side by side, pass by pass, and takes their mean: replicate by replicate, so that the
    /// spread of replicates is that of independent means, whatever the copies have in common.
    fn follow(&self, prepared: &[Prepared], way: Way, reference: Option<&Reference>) -> Result<Outcome> {
        let independent = way == Way::Independent;
        let filter = prepared[0].sampler()?;
        let jobs: Vec<FrameJob> = prepared.iter().map(|p| FrameJob { independent, ..p.job(&filter) }).collect();
        let samples = jobs[0].samples;
        let parts = jobs.iter().map(|job| Part::new(job, Share::all(samples))).collect::<Result<Vec<Part>>>()?;
        let space = way.carried().rgb_from_film();
        let replicates = || {
            let of = |part: &Part| {
                part.look(|film, splats| {
                    let splats = splats.map(SplatFilm::splats);
                    resolve::replicates(film, splats, &space)
                })
            };
            parts.iter().map(of).reduce(|a, b| sum(a, &b)).map_or(Vec::new(), |all| over(all, parts.len()))
        };
        let converged = |part: &Part| {
            part.look(|film, splats| {
                let image = resolve::resolve(film, splats.map(SplatFilm::splats), &space);
                frame::converged(film, splats, &space, &image, &part.job().gauge)
            })
        };
        let (mut passes, mut elapsed, mut at) = (Vec::new(), Duration::ZERO, 0);
        while at < samples {
            let end = pass_end(at, samples);
            let start = Instant::now();
            for part in &parts {
                part.add(at..end, self.stop, &|_| {});
            }
            elapsed += start.elapsed();
            if self.stop.load(Ordering::Relaxed) {
                return Err(stopped());
            }
            let noise = reference.map_or(Vec::new(), |reference| reference.noise_of(&replicates()));
            let converged = reference.is_some() && parts.iter().all(converged);
            passes.push(Pass { samples: end, seconds: elapsed.as_secs_f64(), noise, converged });
            at = end;
        }
        let replicates = replicates();
        let image = |part: &Part| {
            part.look(|film, splats| {
                let splats = splats.map(SplatFilm::splats);
                resolve::resolve(film, splats, &space)
            })
        };
        let mut images = parts.iter().map(image);
        let mut image = images.next().expect("there is a copy");
        for further in images {
            for (a, b) in image.rgb.iter_mut().flatten().zip(further.rgb.iter().flatten()) {
                *a = 0.5 * (*a + b);
            }
        }
        Ok(Outcome { image, replicates, passes })
    }
}

/// The sums of replicates, pixel by pixel.
pub fn sum(mut a: Vec<Option<Replicates>>, b: &[Option<Replicates>]) -> Vec<Option<Replicates>> {
    for (a, b) in a.iter_mut().zip(b) {
        *a = a.zip(*b).map(|(a, b)| std::array::from_fn(|r| std::array::from_fn(|c| a[r][c] + b[r][c])));
    }
    a
}

fn stopped() -> Error {
    Error::Stopped("stopped before its sheet was done, which begins anew".into())
}

fn over(mut all: Vec<Option<Replicates>>, parts: usize) -> Vec<Option<Replicates>> {
    all.iter_mut().flatten().flatten().flatten().for_each(|x| *x /= parts as f64);
    all
}
