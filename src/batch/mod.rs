//! Jobs: from a file that a person names to pictures, report and exit code.
//!
//! A batch goes on with the other scenes after one fails; what failed is told at the end.

pub mod accuracy;
pub mod adaptive;
pub mod checkpoint;
mod checks;
mod clashes;
pub mod contact;
pub mod develop;
pub mod farm;
mod files;
pub mod finish;
pub mod forecast;
pub mod frame;
mod header;
mod layers;
mod mattes;
pub mod memory;
pub mod merge;
pub mod motion;
pub mod names;
mod outlook;
pub mod part;
pub mod part_file;
mod portion;
mod prepare;
pub mod report;
pub mod splatting;
pub mod stop;
mod techniques;
pub mod tev;
mod unit;
pub mod words;

use crate::description::{self, BatchEntry, PathMap, SceneDescription};
use crate::error::{Error, Result};
use crate::film::output::{self, Inputs};
use crate::scene::shelf::Shelf;
use checkpoint::{Keep, Keeper};
use contact::Contact;
use finish::Finish;
use forecast::Forecast;
use frame::{Progress, go_on};
use part_file::Identity;
pub use portion::{Portion, Samples};
use prepare::prepare_one_of;
pub use prepare::{Prepared, prepare, prepare_watched, window};
use report::{Report, SceneReport, Status};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Scenes whose reports are put in one place at a time.
const GATHERED: usize = 64;

/// What the command line says over the files.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    /// `--set KEY=VALUE`, in order.
    pub set: Vec<(String, String)>,
    /// `-D NAME=VALUE`: parameters of Mitsuba scenes.
    pub define: Vec<(String, String)>,
    /// Where files lie that the scenes name.
    pub paths: PathMap,
    /// Where pictures go: a directory, or for a single scene a file name that ends in `.exr`.
    pub output: Option<PathBuf>,
    /// Where the report goes as well.
    pub report: Option<PathBuf>,
    /// Only the scenes with these names; all where empty.
    pub scenes: Vec<String>,
    /// Count what robust arithmetic was needed for, and write it as a layer.
    pub check_numerics: bool,
    /// Which part of each picture; all of it, and its files, by default.
    pub portion: Portion,
    /// What is kept of a render that ends early.
    pub keep: Keep,
    /// The most bytes that the process may hold.
    pub memory_limit: Option<u64>,
}

/// Whose turn it is in a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Turn {
    /// Number of the scene from 0, and how many there are.
    pub scene: [usize; 2],
    /// Number of its frame from 0, and how many it has.
    pub frame: [usize; 2],
}

/// What a batch tells while it runs. All methods may be called from any thread.
pub trait Watcher: Sync {
    /// A picture begins, whose name is [`names::label`].
    fn scene_begins(&self, turn: Turn, name: &str);
    /// Before a picture, light that mirrors or glass may throw is looked for: `share` of what may be spent in vain is, after `elapsed`.
    fn searches(&self, _share: f64, _elapsed: Duration) {}
    /// Samples were done.
    fn progress(&self, progress: Progress);
    /// Something went wrong that does not end the render: its report will say so, but somebody may mend it before.
    fn warns(&self, _message: &str) {}
    /// A picture ended.
    fn scene_ends(&self, report: &SceneReport);
}

/// Nobody watches.
impl Watcher for () {
    fn scene_begins(&self, _: Turn, _: &str) {}
    fn progress(&self, _: Progress) {}
    fn scene_ends(&self, _: &SceneReport) {}
}

/// The entries of `path`, filtered by name.
///
/// # Errors
/// [`Error::Config`] for a batch that cannot be read or a name that no scene has; [`Error::Input`] for
/// a missing file.
pub fn entries(path: &Path, overrides: &Overrides) -> Result<Vec<BatchEntry>> {
    let document = description::load_mapped(path, overrides.paths.clone())?;
    let all = document.entries();
    for wanted in &overrides.scenes {
        if !all.iter().any(|e| &e.name == wanted) {
            let nearest = description::did_you_mean(wanted, all.iter().map(|entry| &*entry.name));
            return Err(Error::Config(format!("{}: no scene is named \"{wanted}\"{nearest}", path.display())));
        }
    }
    let mut entries = document.into_entries();
    entries.retain(|e| overrides.scenes.is_empty() || overrides.scenes.contains(&e.name));
    for entry in &mut entries {
        entry.define(&overrides.define)?;
    }
    Ok(entries)
}

/// Whether the name of `path` ends in one of `extensions`, whose case does not matter. `a.exr/` is a directory.
fn ends_in(path: &Path, extensions: &[&str]) -> bool {
    let directory = path.to_string_lossy().ends_with(std::path::is_separator);
    !directory && path.extension().is_some_and(|e| extensions.iter().any(|x| e.eq_ignore_ascii_case(x)))
}

/// Where a picture goes: `-o FILE.exr`, `-o DIR`, or the directory of the description, each of which may be a pattern
/// ([`names::fill`]). In a directory the name of a part says which it is.
#[must_use]
pub fn output_path(prepared: &Prepared, overrides: &Overrides) -> PathBuf {
    let Prepared { description, scene, .. } = prepared;
    place(&description.output.dir, &scene.name, description.frame, overrides)
}

/// [`output_path`] of the scene `name` whose description has `directory`.
fn place(directory: &Path, name: &str, frame: Option<i32>, overrides: &Overrides) -> PathBuf {
    let filled = names::fill(overrides.output.as_deref().unwrap_or(directory), name, frame);
    match &overrides.output {
        Some(path) if ends_in(path, &["exr"]) => filled,
        _ => filled.join(format!("{}{}.exr", names::label(name, frame), overrides.portion.suffix())),
    }
}

/// Where the report and the contact sheet lie: with the pictures of a scene that go to `directory`, frames or one; of a pattern
/// whose directories have names of scenes or frames in the one above those.
fn about_place(directory: &Path, frames: bool, overrides: &Overrides) -> PathBuf {
    let pictures = match &overrides.output {
        Some(path) if ends_in(path, &["exr"]) => path.parent().unwrap_or(Path::new("")),
        Some(path) => path,
        None => directory,
    };
    let plain = |place: &&Path| names::mark(&place.to_string_lossy(), frames).is_none();
    pictures.ancestors().find(plain).unwrap_or(Path::new("")).to_path_buf()
}

/// The report, and the picture and the page of the contact sheet, in `directory`.
fn about_files(directory: &Path, overrides: &Overrides) -> [PathBuf; 3] {
    [("report", "json"), ("contact-sheet", "png"), ("contact-sheet", "html")]
        .map(|(stem, ending)| directory.join(names::about(overrides, stem, ending)))
}

/// Renders a prepared scene and writes its pictures.
///
/// # Errors
/// [`Error::Render`] for invalid samples (the pictures are written all the same) or a stop,
/// [`Error::Output`] where a file cannot be written.
pub fn render_scene(
    prepared: &Prepared,
    overrides: &Overrides,
    loading: Duration,
    watcher: &dyn Watcher,
    stop: &AtomicBool,
) -> (SceneReport, Result<()>) {
    let mut report = SceneReport::new(&prepared.scene.name, prepared.description.frame);
    report.describe(&Finish::of(prepared), loading.saturating_sub(prepared.trials));
    report.seconds.trials = prepared.trials.as_secs_f64();
    let result = render_and_write(prepared, overrides, watcher, stop, &mut report);
    if let Err(e) = &result {
        report.fail(e);
    }
    (report, result)
}

fn render_and_write(
    prepared: &Prepared,
    overrides: &Overrides,
    watcher: &dyn Watcher,
    stop: &AtomicBool,
    report: &mut SceneReport,
) -> Result<()> {
    let description = &prepared.description;
    let exr_path = output_path(prepared, overrides);
    let filter = prepared.sampler()?;
    let job = prepared.job(&filter);
    let portion = &overrides.portion;
    if prepared.stop.is_open() && !portion.is_all() {
        let hint = "a part cannot know the error or the time of the whole picture; give it a number of samples";
        return Err(Error::Config(format!("render.stop: {hint}")));
    }
    let identity = Identity::new(Finish::of(prepared), &prepared.source, &prepared.plan);
    let finish = &identity.finish;
    let share = portion.share(job.window, job.samples, finish.rows())?;
    checks::fits(description, share.rows(job.window), part::Part::bytes(&job, &share), overrides.memory_limit)?;
    let part = (!portion.is_all()).then_some(&share);
    if part.is_some() {
        report.samples = share.samples.end - share.samples.start;
    }
    if let Some(ended) = checkpoint::ended(&overrides.keep, &exr_path, &identity, part) {
        checkpoint::remove_left_over(&exr_path, &identity)?;
        report.status = Status::Skipped;
        if part.is_none() {
            report.recall(finish, &exr_path);
            report.files = files::of(finish, &exr_path);
        } else {
            report.files = vec![exr_path];
        }
        return ended;
    }
    // A place that cannot be written to is told before the work, not after.
    files::written(&exr_path, &description.output, portion.is_all())
        .iter()
        .try_for_each(|file| output::prepare_place(file))?;
    let mut keeper = Keeper::new(&overrides.keep, stop, &exr_path, &identity, prepared.scene.watch.as_deref(), watcher);
    let asked = Instant::now();
    let begun = keeper.begin(&job, share)?;
    report.seconds.loading += asked.elapsed().as_secs_f64();
    let begun = go_on(begun, &|p| watcher.progress(p), &keeper)?;
    if !portion.is_all() {
        report.measure_part(&begun, keeper.numerics());
        let written = Instant::now();
        keeper.keep_place(&exr_path)?;
        part_file::write(&exr_path, &identity, &begun.part, &[], begun.elapsed, keeper.numerics())?;
        report.files = vec![exr_path.clone()];
        report.seconds.writing = written.elapsed().as_secs_f64();
        report.notes.extend(keeper.done()?);
        return Ok(());
    }
    let frame = begun.finish();
    if let Some(viewer) = &overrides.keep.viewer {
        viewer.show_last(&report.label(), frame.resolve(&finish.rec709_from_xyz()));
    }
    report.measure(finish, &frame, keeper.numerics());
    report.forecast = Forecast::at_a_quarter(frame.course(), &prepared.stop, prepared.samples);
    let target = prepared.stop.check(&frame.milestones);
    keeper.keep_place(&exr_path)?;
    let written = files::write(finish, &frame, target, &exr_path, report);
    // What cannot be written can still be resumed.
    if report.files.is_empty() {
        return written;
    }
    report.notes.extend(keeper.done()?);
    written
}

/// Renders all frames of all scenes of `path` that are asked for; one that fails does not stop the others.
///
/// # Errors
/// What keeps the batch from beginning. What goes wrong in a scene is in the report.
pub fn render_batch(path: &Path, overrides: &Overrides, watcher: &dyn Watcher, stop: &AtomicBool) -> Result<Report> {
    let entries = entries(path, overrides)?;
    checks::output_place("-o", overrides.output.as_deref(), entries.len())?;
    clashes::check(&entries, overrides)?;
    let start = Instant::now();
    let mut scenes = Vec::new();
    let mut report_dir: Option<PathBuf> = None;
    let mut shelf = Shelf::default();
    let mut contact = Contact::default();
    let mut read = Inputs::of(entries.iter().map(|entry| &*entry.path).chain([path]));
    read.spare(&overrides.report)?;
    clashes::check_report(&entries, overrides)?;
    clashes::check_about(&entries, overrides)?;
    'batch: for (i, entry) in entries.iter().enumerate() {
        let mut loading = Instant::now();
        let animation = entry.animation(&overrides.set);
        read.add(animation.iter().flat_map(|animation| [animation.files(), animation.named_files()].concat()));
        let frames = animation.as_ref().map_or(1, |animation| animation.frames().len().max(1));
        let animation = animation.and_then(|a| checks::frames("-o", overrides.output.as_deref(), frames).map(|()| a));
        // One that cannot be read is a picture that fails.
        let pictures: Box<dyn Iterator<Item = (Option<i32>, Result<SceneDescription>)>> = match animation {
            Ok(animation) => Box::new(animation.into_scenes()),
            Err(e) => Box::new(std::iter::once((None, Err(e)))),
        };
        for (n, (frame, description)) in pictures.enumerate() {
            let label = names::label(&entry.name, frame);
            if !scenes.is_empty() && stop.load(Ordering::Relaxed) {
                let mut report = SceneReport::new(&entry.name, frame);
                report.fail(&Error::Stopped("stopped before it began; --resume goes on from there".into()));
                scenes.push(report);
                break 'batch;
            }
            watcher.scene_begins(Turn { scene: [i, entries.len()], frame: [n, frames] }, &label);
            let prepared = description.and_then(|d| {
                if let Err(e) = checks::before_work(&entry.name, &d, overrides) {
                    report_dir.get_or_insert_with(|| about_place(&d.output.dir, d.frame.is_some(), overrides));
                    return Err(e);
                }
                prepare_one_of(entry, d, overrides, &mut shelf, stop, watcher)
            });
            if i + 1 == entries.len() && n + 1 == frames {
                // Nobody comes after the last one.
                shelf = Shelf::default();
            }
            let several = entries.len() > 1 || frames > 1;
            let prepared = prepared.and_then(|p| {
                checks::places(&p, overrides, &mut read)?;
                let Prepared { description, .. } = &p;
                let dir = || about_place(&description.output.dir, description.frame.is_some(), overrides);
                let dir = report_dir.clone().unwrap_or_else(dir);
                let sheet = several && description.output.contact_sheet && overrides.portion.is_all();
                let about = about_files(&dir, overrides);
                read.spare(if sheet { &about[..] } else { &about[..1] })?;
                Ok((p, dir, sheet))
            });
            if scenes.is_empty() {
                read.spare(&overrides.report)?;
            }
            let mut report = match prepared {
                Ok((prepared, dir, sheet)) => {
                    report_dir.get_or_insert(dir);
                    let mut report = render_scene(&prepared, overrides, loading.elapsed(), watcher, stop).0;
                    if sheet {
                        contact.add(scenes.len(), &mut report);
                    }
                    report
                }
                Err(e) => {
                    let mut report = SceneReport::new(&entry.name, frame);
                    report.fail(&e);
                    report
                }
            };
            report.error_map = None;
            watcher.scene_ends(&report);
            scenes.push(report);
            if scenes.len() % GATHERED == 0 {
                let gathered = scenes.len() - GATHERED;
                let (before, latest) = scenes.split_at_mut(gathered);
                report::gather(before.last(), latest);
            }
            loading = Instant::now();
        }
    }
    let mut report = Report::new(path, scenes, start.elapsed());
    // What only a later scene reads.
    report.misplaced = read.spare(&overrides.report).err();
    if let Some(dir) = report_dir {
        let [file, sheet @ ..] = about_files(&dir, overrides);
        match contact.write(&sheet, &read, &report) {
            Ok(page) => report.contact_sheet = page,
            Err(e) => report.unwritten = Some(e),
        }
        match read.spare([&file]) {
            Ok(()) => report.write(&file),
            Err(e) => report.unwritten = Some(e),
        }
    }
    Ok(report)
}

impl Report {
    /// The exit code of the batch: that of the worst scene, or of the lost report.
    #[must_use]
    pub fn exit_code(&self) -> i32 {
        let codes = self.scenes.iter().filter_map(|s| match &s.status {
            Status::Done | Status::Skipped => None,
            Status::Failed { exit_code, .. } => Some(*exit_code),
        });
        let lost = self.unwritten.iter().chain(&self.misplaced);
        worst(codes.chain(lost.map(Error::exit_code)))
    }
}

/// The exit code of a batch whose scenes call for `codes`; 0 where none does.
#[must_use]
pub fn worst(codes: impl Iterator<Item = i32>) -> i32 {
    // Where something can go on, it should. A fault of the description outranks a missing file, which outranks what
    // went wrong later; least is 4, which says that the picture is written, so that no other is lost behind it.
    codes
        .min_by_key(|code| match code {
            75 => 0,
            2 => 1,
            3 => 2,
            4 => 4,
            _ => 3,
        })
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 says that the picture is written: behind it a picture that is not was lost.
    #[test]
    fn a_batch_ends_with_the_code_of_what_is_lost() {
        let codes = |codes: &[i32]| worst(codes.iter().copied());
        assert_eq!((codes(&[4, 1]), codes(&[33, 4]), codes(&[4, 4])), (1, 33, 4));
        assert_eq!((codes(&[1, 3, 2, 4]), codes(&[3, 33]), codes(&[2, 75]), codes(&[])), (2, 3, 75, 0));
    }
}
