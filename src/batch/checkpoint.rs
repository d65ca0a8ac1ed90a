//! Checkpoints: what is done of a picture, kept beside it, so that it is not lost when the process ends.
//!
//! A checkpoint is a part ([`super::part_file`]) named like the picture with `.checkpoint` behind, whole or not there. It is
//! written when the render is asked to stop, which then ends with exit code 75, and from time to time, for those who are
//! not asked. Work pauses between two units, so that it is exact: what is resumed gives the same bits. The same pauses show
//! the picture to a viewer ([`super::tev`]).

use super::Watcher;
use super::develop;
use super::files::spectral_path;
use super::finish::Finish;
use super::frame::{self, Begun, FrameJob, Milestone, lock};
use super::header::{FAULT, SPECTRAL};
use super::merge::sum;
use super::names;
use super::part::{Breaks, Part, Share, SplatFilm};
use super::part_file::{self, Identity};
use super::tev::{self, Viewer};
use crate::error::{Error, Result};
use crate::film::output;
use crate::film::resolve::{self, Image};
use crate::film::{exr, png};
use crate::scene::watch::{Counts, Watch};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// What is kept of a render that ends early, and what is made of files that are there.
#[derive(Clone, Debug, Default)]
pub struct Keep {
    /// Write a checkpoint when the render is stopped.
    pub on_stop: bool,
    /// And as often as this.
    pub every: Option<Duration>,
    /// Go on from a checkpoint, if there is one.
    pub resume: bool,
    /// Leave alone what is there, whole and of the same scene and settings.
    pub skip_existing: bool,
    /// Set when a picture of what is done is wanted.
    pub snapshot: Arc<AtomicBool>,
    /// Who looks on.
    pub viewer: Option<Arc<Viewer>>,
}

/// The checkpoint of the file at `path`.
#[must_use]
pub fn place(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".checkpoint");
    name.into()
}

/// How the names of snapshots end, without `.png`.
pub(super) const SNAPSHOT: &str = ".snapshot";

/// The PNG of what is done of the file at `path`.
#[must_use]
pub fn snapshot_place(path: &Path) -> PathBuf {
    path.with_extension(format!("{}.png", &SNAPSHOT[1..]))
}

/// Keeps one render.
pub struct Keeper<'a> {
    keep: &'a Keep,
    stop: &'a AtomicBool,
    /// The file that is to be.
    path: &'a Path,
    identity: &'a Identity,
    watch: Option<&'a Watch>,
    watcher: &'a dyn Watcher,
    /// Of the run that is resumed.
    counted: Option<Counts>,
    /// Whether the checkpoint that is there, if there is one, is of this render.
    own: AtomicBool,
    next: Mutex<Option<Instant>>,
    /// When a viewer is shown the picture again.
    next_look: Mutex<Instant>,
    /// What a person should know.
    notes: Mutex<Vec<String>>,
}

impl<'a> Keeper<'a> {
    /// For the render that makes `path`.
    #[must_use]
    pub fn new(
        keep: &'a Keep,
        stop: &'a AtomicBool,
        path: &'a Path,
        identity: &'a Identity,
        watch: Option<&'a Watch>,
        watcher: &'a dyn Watcher,
    ) -> Keeper<'a> {
        let next = Mutex::new(keep.every.and_then(|every| Instant::now().checked_add(every)));
        Keeper {
            keep,
            stop,
            path,
            identity,
            watch,
            watcher,
            counted: None,
            own: AtomicBool::new(false),
            next,
            next_look: Mutex::new(Instant::now()),
            notes: Mutex::default(),
        }
    }

    /// The render from where a checkpoint left it, if one is to be resumed and there, else from the beginning.
    ///
    /// # Errors
    /// [`Error::Input`] for a checkpoint that is damaged or of something else; [`Error::Memory`] if the memory cannot be had.
    pub fn begin<'j>(&mut self, job: &'j FrameJob<'j>, share: Share) -> Result<Begun<'j>> {
        let file = place(self.path);
        if !file.exists() {
            return Begun::new(job, share);
        }
        if !self.keep.resume {
            let of_it = part_file::open(&file).and_then(|w| w.header.check_begun(&file, self.identity, &share));
            self.watcher.warns(&match of_it {
                Ok(()) => format!("{} of an earlier render is there; --resume goes on from it", file.display()),
                Err(error) => format!("{error}; --resume does not go on from it"),
            });
            return Begun::new(job, share);
        }
        let written = part_file::open(&file)?;
        written.header.check_begun(&file, self.identity, &share)?;
        let (mut film, mut splats) = written.empty(share.rows(job.window))?;
        written.add_to(&mut film, splats.as_mut())?;
        let header = &written.header;
        let part = Part::resume(job, share, &header.claims, header.allocation(), film, splats)?;
        lock(&self.notes).push(format!("resumed at {:.1} %", per_cent(&part, &header.milestones)));
        self.counted = header.numerics;
        *self.own.get_mut() = true;
        let elapsed = Duration::try_from_secs_f64(header.seconds).unwrap_or_default();
        Ok(Begun::from(part, header.milestones.clone(), elapsed))
    }

    /// What was counted of robust arithmetic, in all runs.
    #[must_use]
    pub fn numerics(&self) -> Option<Counts> {
        sum(self.counted.into_iter().chain(self.watch.map(Watch::counts)))
    }

    /// The files are there: nothing is left to resume, and a checkpoint of the same is removed. What a person should know is returned.
    ///
    /// # Errors
    /// [`Error::Output`] if the checkpoint cannot be removed.
    pub fn done(&self) -> Result<Vec<String>> {
        match self.own.load(Ordering::Relaxed) {
            true => remove(&place(self.path))?,
            false => remove_left_over(self.path, self.identity)?,
        }
        Ok(std::mem::take(&mut lock(&self.notes)))
    }

    /// Makes the directory of `file` again, where somebody removed it while the picture was rendered: that may have taken days.
    ///
    /// # Errors
    /// As [`output::prepare_place`].
    pub fn keep_place(&self, file: &Path) -> Result<()> {
        let directory = output::directory_of(file);
        if !directory.exists() {
            output::prepare_place(file)?;
            self.note(format!("{} was removed meanwhile, and is made again", directory.display()));
        }
        Ok(())
    }

    fn write(&self, part: &Part, milestones: &[Milestone], elapsed: Duration) -> Result<()> {
        self.keep_place(self.path)?;
        part_file::write(&place(self.path), self.identity, part, milestones, elapsed, self.numerics())?;
        self.own.store(true, Ordering::Relaxed);
        Ok(())
    }

    /// What is done.
    fn look(&self, part: &Part, rgb_from_xyz: &[[f64; 3]; 3]) -> Image {
        part.look(|film, splats| {
            // A tile's rows are less than what its light from the lights covers.
            let splats = splats.filter(|s| s.film.window() == film.window());
            let splats = splats.map(SplatFilm::splats);
            resolve::resolve(film, splats, rgb_from_xyz)
        })
    }

    /// The viewer, where it would take a picture now.
    fn looking_on(&self) -> Option<&Viewer> {
        let viewer = self.keep.viewer.as_deref()?;
        (viewer.is_ready() && Instant::now() >= *lock(&self.next_look)).then_some(viewer)
    }

    /// A PNG of what is done.
    fn snapshot(&self, part: &Part) -> Result<()> {
        let finish = &self.identity.finish;
        let image = self.look(part, &finish.rgb_from_xyz());
        let shown = image.shown();
        png::write_png(&snapshot_place(self.path), &shown, &finish.png_settings(&shown))
    }

    /// What is not worth losing the render for: told at once, and in the report. The same trouble twice in a row is told once.
    fn note(&self, note: String) {
        let mut notes = lock(&self.notes);
        if notes.last() != Some(&note) {
            self.watcher.warns(&note);
            notes.push(note);
        }
    }

    fn is_due(&self) -> bool {
        self.keep.every.is_some() && lock(&self.next).is_some_and(|next| Instant::now() >= next)
    }
}

/// How much is done of what `part` will be, as far as `milestones` foretell that.
fn per_cent(part: &Part, milestones: &[Milestone]) -> f64 {
    let (done, total) = (part.progress().0, frame::samples_in_all(part, milestones));
    100.0 * done as f64 / total.max(done).max(1) as f64
}

impl Breaks for Keeper<'_> {
    fn wanted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
            || self.keep.snapshot.load(Ordering::Relaxed)
            || self.is_due()
            || self.looking_on().is_some()
    }

    fn ending(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn take(&self, part: &Part, milestones: &[Milestone], elapsed: Duration) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            if !self.keep.on_stop {
                return self.stop.take(part, milestones, elapsed);
            }
            self.write(part, milestones, elapsed)?;
            let file = place(self.path);
            let message = format!(
                "stopped at {:.1} %, kept in {}; --resume goes on from there",
                per_cent(part, milestones),
                file.display()
            );
            return Err(Error::Stopped(message));
        }
        if self.keep.snapshot.swap(false, Ordering::Relaxed)
            && let Err(e) = self.snapshot(part)
        {
            self.note(format!("no snapshot: {e}"));
        }
        if let Some(viewer) = self.looking_on() {
            let start = Instant::now();
            let name = names::label(&self.identity.finish.name, self.identity.finish.frame_number);
            viewer.show(&name, self.look(part, &self.identity.finish.rec709_from_xyz()));
            // At most a twentieth of the time goes into looking.
            *lock(&self.next_look) = Instant::now() + tev::EVERY.max(20 * start.elapsed());
        }
        if self.is_due() {
            let start = Instant::now();
            if let Err(e) = self.write(part, milestones, elapsed) {
                self.note(format!("no checkpoint: {e}"));
            }
            // At most a fifth of the time goes into checkpoints.
            let pause = self.keep.every.map(|every| every.max(4 * start.elapsed()));
            *lock(&self.next) = pause.and_then(|pause| Instant::now().checked_add(pause));
        }
        Ok(())
    }
}

/// Whether the part at `path` is there, whole, undamaged, and that `share` of the same picture.
#[must_use]
pub fn part_holds(path: &Path, identity: &Identity, share: &Share) -> bool {
    part_file::open(path).is_ok_and(|written| {
        let header = &written.header;
        header.check_of(path, identity).is_ok()
            && header.share() == *share
            && header.is_whole()
            && written.verify().is_ok()
    })
}

/// Whether the picture at `path`, its PNG and its file of bands are there, undamaged, of the same scene and settings and by
/// this version, and of one render: how that ended.
fn picture_ended(path: &Path, finish: &Finish) -> Option<Result<()>> {
    // A file that is not there need not be read.
    let png = path.with_extension("png");
    let spectral = finish.output.spectral.map(|_| spectral_path(path));
    if !(path.is_file() && png.is_file() && spectral.as_ref().is_none_or(|spectral| spectral.is_file())) {
        return None;
    }
    let Found { pixels, fault } = exr_holds(path, finish, Holds::Colours)?;
    let shown = finish.window.shown(finish.frame);
    let size = [shown.width, shown.height];
    let mut texts = finish.png_marks(&pixels);
    texts.push(develop::software());
    let bands = |spectral: PathBuf| exr_holds(&spectral, finish, Holds::Bands).is_some_and(|f| f.pixels == pixels);
    let holds = spectral.is_none_or(bands) && png::holds(&png, size, &texts);
    holds.then(|| fault.map_or(Ok(()), |fault| Err(Error::Render(fault))))
}

/// What a file of a picture is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Holds {
    Colours,
    Bands,
}

/// What such a file says.
struct Found {
    /// The hash of the picture's pixels.
    pixels: String,
    /// What is wrong with the picture although it is written.
    fault: Option<String>,
}

/// [`picture_ended`] of one of its EXR files.
fn exr_holds(path: &Path, finish: &Finish, holds: Holds) -> Option<Found> {
    let file = exr::read_exr(path).ok()?;
    if !exr::rows_are_apart(path).is_ok_and(|apart| apart) {
        return None;
    }
    // What is said of the whole file stands in its first part.
    let part = &file.parts[0];
    let found = part.text(SPECTRAL).map_or(Holds::Colours, |_| Holds::Bands);
    let expected = [
        ("abbe/version", env!("CARGO_PKG_VERSION").to_owned()),
        ("abbe/sceneHash", finish.scene_hash.clone()),
        ("abbe/settingsHash", finish.settings_hash()),
        ("abbe/contentHash", file.content_hash()),
    ];
    let is = |(name, value): &(&str, String)| part.text(name) == Some(value.as_str());
    let same = found == holds && part.window == finish.window && expected.iter().all(is);
    let text = |name: &str| part.text(name).map(str::to_owned);
    Some(Found { pixels: text("abbe/pixelHash").filter(|_| same)?, fault: text(FAULT) })
}

/// Removes the checkpoint of what is at `path` already: a process that was killed after it had written the one and before it
/// removed the other left it. One of something else stays.
///
/// # Errors
/// [`Error::Output`] if it cannot be removed.
pub fn remove_left_over(path: &Path, identity: &Identity) -> Result<()> {
    let file = place(path);
    let is_of_it = || part_file::open(&file).is_ok_and(|written| written.header.check_of(&file, identity).is_ok());
    if file.is_file() && is_of_it() { remove(&file) } else { Ok(()) }
}

fn remove(file: &Path) -> Result<()> {
    match std::fs::remove_file(file) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::output(file, e)),
        _ => Ok(()),
    }
}

/// How the render of what is to be at `path` ended, if that is there already.
#[must_use]
pub fn ended(keep: &Keep, path: &Path, identity: &Identity, share: Option<&Share>) -> Option<Result<()>> {
    if !(keep.skip_existing || keep.resume) || !output::directory_of(path).is_dir() {
        return None;
    }
    match share {
        Some(share) => part_holds(path, identity, share).then_some(Ok(())),
        None => picture_ended(path, &identity.finish),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::frame::go_on;
    use crate::batch::part::Claims;
    use crate::batch::{Overrides, entries, prepare};
    use crate::film::error::ErrorEstimate;
    use crate::film::filter::{Filter, FilterSampler};

    const SCENE: &str = "camera: {origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}\n\
        image: {width: 4, height: 4}\nrender: {samples: 4, techniques: {light_tracing: on}}\nshapes:\n\
        - plane: {normal: [0, 1, 0]}\n- sphere: {center: [0, 1, 0], radius: 1, material: {dielectric: {ior: 1.5}}}\n\
        - sphere: {center: [1, 3, 1], radius: 0.2, emission: 20}\n";

    /// 512 samples with an error of √(1/512), which falls as √(1/N), are half of the 1024 that bring it to 1/32, and not a 128th of
    /// the most there may be.
    #[test]
    fn what_is_done_of_a_render_to_an_error_is_a_share_of_what_that_takes() {
        let dir = tempfile::tempdir().unwrap();
        let yaml = dir.path().join("scene.yaml");
        std::fs::write(&yaml, SCENE).unwrap();
        let overrides =
            Overrides { set: vec![("render.stop".into(), "{error: 0.03125}".into())], ..Overrides::default() };
        let prepared = prepare(&entries(&yaml, &overrides).unwrap()[0], &overrides).unwrap();
        let filter = FilterSampler::new(Filter::Box).unwrap();
        let job = prepared.job(&filter);
        let share = Share::all(job.samples);
        let empty = Part::new(&job, share.clone()).unwrap();
        let claims = Claims { camera: vec![(job.window, 0..512)], ..empty.claims() };
        let (film, splats) = empty.finish();
        let part = Part::resume(&job, share, &claims, None, film, splats).unwrap();
        let milestone = |samples: u32| {
            let rel_rmse = f64::from(samples).powf(-0.5);
            let error = ErrorEstimate { rel_rmse, low: rel_rmse, high: rel_rmse, pixels: 16, valid: true };
            Milestone { samples, elapsed: Duration::from_millis(samples.into()), error: Some(error), unknown: None }
        };
        let found = per_cent(&part, &[128, 256, 512].map(milestone));
        // The usual slope is 0.0058 more than this one and counts for 0.08 of it: 1024 samples are foretold to 0.0003.
        assert!((found - 50.0).abs() < 50.0 * 0.0004, "{found}");
    }

    /// A run of 90 seconds that dropped samples of four kinds, and did no others, is gone on with: the seconds and what was
    /// counted are there at the end, as scenes like this drop none.
    #[test]
    fn a_resumed_run_keeps_the_time_and_the_counts_of_the_one_before() {
        let dir = tempfile::tempdir().unwrap();
        let yaml = dir.path().join("scene.yaml");
        std::fs::write(&yaml, SCENE).unwrap();
        let none = Overrides::default();
        let prepared = prepare(&entries(&yaml, &none).unwrap()[0], &none).unwrap();
        let filter = FilterSampler::new(Filter::Box).unwrap();
        let job = prepared.job(&filter);
        let share = Share::all(job.samples);
        let identity = Identity::new(Finish::of(&prepared), &prepared.source, &prepared.plan);

        let empty = Part::new(&job, share.clone()).unwrap();
        let claims = empty.claims();
        let (mut film, splats) = empty.finish();
        let mut splats = splats.unwrap();
        (film.invalid.nan, film.layers.invalid.negative) = (1, 2);
        (splats.film.invalid.infinite, splats.film.layers.invalid.overflow) = (3, 4);
        let dropped = [film.invalid, film.layers.invalid, splats.film.invalid, splats.film.layers.invalid];
        let before = Part::resume(&job, share.clone(), &claims, None, film, Some(splats)).unwrap();
        let (path, time) = (dir.path().join("a.exr"), Duration::from_secs(90));
        let counts = Counts { surfaces: 5, robust: 1, rays: 4, self_hits: 1 };
        part_file::write(&place(&path), &identity, &before, &[], time, Some(counts)).unwrap();

        let (keep, stop) = (Keep { resume: true, ..Keep::default() }, AtomicBool::new(false));
        let mut keeper = Keeper::new(&keep, &stop, &path, &identity, None, &());
        let begun = keeper.begin(&job, share).unwrap();
        assert_eq!((begun.elapsed, keeper.numerics()), (time, Some(counts)));
        let frame = go_on(begun, &|_| {}, &keeper).unwrap().finish();
        assert!(frame.elapsed > time);
        let splats = frame.splats.unwrap().film;
        let found = [frame.film.invalid, frame.film.layers.invalid, splats.invalid, splats.layers.invalid];
        assert_eq!(found, dropped);
    }
}
