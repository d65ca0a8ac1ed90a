//! Jobs: from a file that a person names to pictures, report and exit code.
//!
//! A batch goes on with the other scenes after one fails; what failed is told at the end.

pub mod accuracy;
pub mod adaptive;
pub mod checkpoint;
mod clashes;
pub mod contact;
pub mod develop;
pub mod farm;
pub mod finish;
pub mod frame;
mod layers;
pub mod merge;
pub mod motion;
pub mod names;
pub mod part;
pub mod part_file;
mod portion;
pub mod report;
pub mod stop;
pub mod tev;

use crate::description::{self, BatchEntry, LayerContent, PathMap, SceneDescription};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::accumulate::{Film, REPLICATES, SAMPLES_LIMIT};
use crate::film::filter::{Filter, FilterSampler};
use crate::film::output::{self, Inputs};
use crate::scene::Scene;
use crate::scene::compile;
use crate::scene::shelf::Shelf;
use crate::spectrum::ColourSpace;
use crate::transport::layers::{Channel, Layer, Source};
use crate::transport::pilot::{self, Use, Wishes};
use crate::transport::plan::{EffectMode, EffectPlan, Integrator, LightSettings, PathSettings, WhittedSettings};
use crate::transport::trial;
use checkpoint::{Keep, Keeper};
use contact::Contact;
use finish::{Finish, spectral_path};
use frame::{Frame, FrameJob, Progress, go_on};
use part_file::Identity;
pub use portion::{Portion, Samples};
use report::{Report, SceneReport, Status};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use stop::{Forecast, Stop};

/// Scenes whose reports are put in one place at a time.
const GATHERED: usize = 64;

/// What may be written is what a film holds.
const _: () = assert!(description::SAMPLES_LIMIT == SAMPLES_LIMIT * REPLICATES as u32);

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
    /// Samples were done.
    fn progress(&self, progress: Progress);
    /// A picture ended.
    fn scene_ends(&self, report: &SceneReport);
}

/// Nobody watches.
impl Watcher for () {
    fn scene_begins(&self, _: Turn, _: &str) {}
    fn progress(&self, _: Progress) {}
    fn scene_ends(&self, _: &SceneReport) {}
}

/// A scene made ready: compiled and planned.
#[derive(Debug)]
pub struct Prepared {
    /// What was written.
    pub description: SceneDescription,
    /// What rays meet.
    pub scene: Scene,
    /// The same while the shutter is open, where that is not always the same.
    pub moments: Vec<Scene>,
    /// What is simulated.
    pub plan: EffectPlan,
    /// Samples of a pixel; the most of them, where `stop` has other targets.
    pub samples: u32,
    /// Samples of a pixel for which techniques are planned.
    pub planned: u32,
    /// What else ends the render.
    pub stop: Stop,
    /// Hash of the description and of the files it names.
    pub hash: String,
    /// The file of the scene.
    pub source: PathBuf,
    /// The scene one frame later, where the picture says how things move.
    pub next: Option<Box<Scene>>,
}

impl Prepared {
    /// The whole picture, sampled by `filter`.
    #[must_use]
    pub fn job<'a>(&'a self, filter: &'a FilterSampler) -> FrameJob<'a> {
        let Prepared { description, scene, moments, plan, samples, planned, stop, next, .. } = self;
        FrameJob {
            scene,
            moments,
            next: next.as_deref(),
            plan,
            filter,
            window: window(description),
            samples: *samples,
            planned: *planned,
            stop: *stop,
            seed: description.render.seed,
            tile: description.render.tile,
            independent: false,
        }
    }
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
            let nearest = all
                .iter()
                .map(|e| (strsim::damerau_levenshtein(&e.name, wanted), &e.name))
                .min()
                .filter(|(distance, _)| *distance <= 3)
                .map_or(String::new(), |(_, name)| format!("; did you mean \"{name}\"?"));
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

/// Reads, compiles and plans a scene.
///
/// # Errors
/// [`Error::Config`] and [`Error::Input`], as [`compile::compile`].
pub fn prepare(entry: &BatchEntry, overrides: &Overrides) -> Result<Prepared> {
    prepare_scene(entry, entry.scene(&overrides.set)?, overrides, &mut Shelf::default(), |_| {})
}

/// Compiles a scene that has been read, with what the scene before has read (see [`compile::compile_with`]), has `alter`
/// change it, and plans it.
fn prepare_scene(
    entry: &BatchEntry,
    description: SceneDescription,
    overrides: &Overrides,
    shelf: &mut Shelf,
    alter: impl FnOnce(&mut Scene),
) -> Result<Prepared> {
    let mut scene = compile::compile_with(&description, &entry.name, shelf)?;
    alter(&mut scene);
    let integrator = integrator(&description, &description.integrator)?;
    let stop = stop(&description);
    let samples = match &integrator {
        Integrator::Whitted(_) if stop.is_open() => {
            let hint = "whitted has no noise: its time and its error are given";
            return Err(Error::Config(format!("render.stop: {hint}")));
        }
        Integrator::Whitted(w) => w.samples(),
        Integrator::Path(_) | Integrator::Depth | Integrator::Light(_) | Integrator::Nothing => {
            description.render.most_samples()
        }
    };
    let planned = if stop.is_open() { description.render.samples.min(samples) } else { samples };
    let mode = match description.render.effects {
        description::Effects::Auto => EffectMode::Auto,
        description::Effects::All => EffectMode::All,
    };
    let blur = motion::moments(&entry.name, &description, &scene, &integrator, shelf)?;
    let mut moments = blur.scenes;
    // One film counts the light of all.
    let exponents = moments.iter().map(|moment| moment.light_exponent);
    scene.light_exponent = exponents.fold(scene.light_exponent, i32::max);
    moments.iter_mut().for_each(|moment| moment.light_exponent = scene.light_exponent);
    let mut plan = EffectPlan::of(&motion::census(&scene, &moments), integrator, mode);
    plan.effects.extend(blur.said);
    plan.layers = layers::plan(&description, &scene, planned)?;
    let filter = FilterSampler::new(filter(&description.image.filter))?;
    let (seed, wishes) = (description.render.seed, wishes(&description));
    if let Some((packets, said)) = trial::packets(&scene, &plan, &filter, seed, planned, wishes.packets) {
        plan.packets = packets;
        plan.techniques.push(said);
    }
    let (caustics, said) = match moments.is_empty() {
        true => pilot::decide(&scene, &plan, &filter, seed, planned, wishes),
        false => pilot::left_off("lamps and what bends their light move while the shutter is open"),
    };
    plan.caustics = caustics;
    plan.techniques.extend(said);
    if overrides.check_numerics && !moments.is_empty() {
        let expected = "--check-numerics: expected a scene in which nothing moves, or --set camera.shutter=null";
        return Err(Error::Config(format!("{expected}, found motion blur")));
    }
    if overrides.check_numerics {
        let name = "numerics";
        let taken = |channel: &Channel| channel.name.split('.').next() == Some(name);
        if plan.layers.channels().iter().any(taken) {
            let hint = "--check-numerics writes a layer of that name: give yours another";
            return Err(Error::Config(format!("{}: layer \"{name}\": {hint}", entry.name)));
        }
        // From here on: the pilot's paths are no part of the picture.
        scene.watch = Some(Box::default());
        plan.layers.layers.push(Layer { name: name.into(), source: Source::Numerics, squares: None });
    }
    let (first, said) = adaptive::choose(wish(description.render.techniques.adaptive), stop.is_open(), &plan, samples);
    plan.adaptive = first;
    plan.techniques.extend(said);
    let moving =
        description.layers.iter().any(|layer| layer.content == LayerContent::Middle(description::Data::Motion));
    let mut hash = hash(&description, &blur.texts, &scene.files, &overrides.paths);
    let next = match description.frame.filter(|_| moving) {
        None => None,
        Some(frame) => {
            let later = entry.animation(&overrides.set)?.into_scene(Some(frame.saturating_add(1)))?;
            let scene = compile::compile_with(&later, &entry.name, shelf)?;
            // It is part of the picture.
            let both = hash + &self::hash(&later, &[], &scene.files, &overrides.paths);
            hash = blake3::hash(both.as_bytes()).to_hex()[..32].to_owned();
            Some(Box::new(scene))
        }
    };
    let source = entry.path.clone();
    let prepared = Prepared { description, scene, moments, plan, samples, planned, stop, hash, source, next };
    check_files(&prepared)?;
    Ok(prepared)
}

/// Whether the files of a picture can be written, whatever its pixels are.
fn check_files(prepared: &Prepared) -> Result<()> {
    let Prepared { description, scene, plan, .. } = prepared;
    names::check(&description.output.dir)
        .map_err(|message| Error::Config(description.fault("output.dir", &message)))?;
    let one = Film::new(scene.camera.resolution, Window::full(1, 1))?.with_layers(plan.layers.channels().len());
    let frame = Frame::of(one, None, 0, Duration::ZERO, false);
    let field = if description.layers.is_empty() { "output.exr" } else { "layers" };
    finish::check_files(&Finish::of(prepared), &frame).map_err(|message| {
        Error::Config(description.fault(field, &format!("expected a file that can be written: {message}")))
    })
}

/// Refuses a picture whose sums are more than the machine's memory or `limit`, before it is begun.
fn check_memory(description: &SceneDescription, rows: Window, limit: Option<u64>) -> Result<()> {
    let needed = Film::bytes(rows);
    let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
    if let Some(limit) = limit.filter(|limit| needed > *limit) {
        let [needed, limit] = [needed, limit].map(mebibytes);
        return Err(Error::Memory(format!(
            "the sums of {rows} take {needed} MiB, more than --memory-limit, {limit} MiB"
        )));
    }
    let room = Vec::<u8>::new().try_reserve_exact(usize::try_from(needed).unwrap_or(usize::MAX));
    if room.is_ok() && machine_memory().is_none_or(|there| needed <= there) {
        return Ok(());
    }
    let description::Image { overscan, crop, .. } = &description.image;
    let field = match crop {
        Some(_) => "image.crop",
        None if *overscan > 0 => "image.overscan",
        None => "image.width",
    };
    let message =
        format!("expected a picture that fits into memory, found {rows}, which takes {} MiB", mebibytes(needed));
    Err(Error::Config(description.fault(field, &message)))
}

/// Bytes of memory and swap of the machine, where it tells.
fn machine_memory() -> Option<u64> {
    let all = std::fs::read_to_string("/proc/meminfo").ok()?;
    let kilobytes = |name: &str| -> Option<u64> {
        all.lines().find_map(|line| line.strip_prefix(name))?.trim().trim_end_matches("kB").trim().parse().ok()
    };
    Some(1024 * (kilobytes("MemTotal:")? + kilobytes("SwapTotal:").unwrap_or(0)))
}

/// What ends the render besides samples.
fn stop(description: &SceneDescription) -> Stop {
    let written = &description.render.stop;
    let floor = match description.output.exr.precision {
        description::Precision::Half => stop::rounding(11),
        description::Precision::Float => stop::rounding(24),
    };
    Stop {
        error: written.error,
        time: written.time.as_ref().and_then(description::Time::duration),
        samples_wanted: written.samples.is_some(),
        floor,
    }
}

/// Whether a technique is used.
fn wish(technique: description::Technique) -> Use {
    match technique {
        description::Technique::Auto => Use::Auto,
        description::Technique::On => Use::On,
        description::Technique::Off => Use::Off,
    }
}

/// Techniques that the description asks for or forbids.
fn wishes(description: &SceneDescription) -> Wishes {
    let written = &description.render.techniques;
    Wishes {
        light_tracing: wish(written.light_tracing),
        packets: wish(written.packets),
        merging: wish(written.merging),
    }
}

/// What computes the light.
fn integrator(description: &SceneDescription, written: &description::Integrator) -> Result<Integrator> {
    Ok(match written {
        description::Integrator::Path(p) => Integrator::Path(PathSettings {
            max_depth: p.max_depth,
            roulette_depth: p.roulette_depth,
            hide_emitters: p.hide_emitters,
            opaque_sky: p.opaque_sky,
            light_samples: p.light_samples,
            scatter_samples: p.scatter_samples,
            count_crossings: p.count_crossings,
        }),
        description::Integrator::Whitted(w) => Integrator::Whitted(WhittedSettings {
            max_depth: w.max_depth,
            grid: w.grid,
            ambient: compile::ambient(description, &w.ambient)?,
            transparent_shadows: w.transparent_shadows,
        }),
        description::Integrator::Depth(_) => Integrator::Depth,
        description::Integrator::LightTracer(l) => Integrator::Light(LightSettings {
            max_depth: l.max_depth,
            roulette_depth: l.roulette_depth,
            hide_emitters: l.hide_emitters,
        }),
        description::Integrator::None(_) => Integrator::Nothing,
    })
}

/// 128 bits of BLAKE3 over what was written, with every default, and over the files that it names.
fn hash(description: &SceneDescription, moments: &[String], files: &[PathBuf], paths: &PathMap) -> String {
    let mut hasher = blake3::Hasher::new();
    // Two machines have one scene in two places.
    for text in [hash_text(description)].iter().chain(moments) {
        hasher.update(paths.undo(text.clone()).as_bytes());
    }
    // A file that is named several times counts once: where else it is named stands in the text.
    let mut read: HashSet<&Path> = HashSet::new();
    for file in files {
        if read.insert(file)
            && let Ok(bytes) = std::fs::read(file)
        {
            hasher.update(&bytes);
        }
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

/// What was written, as far as it decides about the picture.
fn hash_text(description: &SceneDescription) -> String {
    // Where the scene lies, and where its pictures go, does not change them.
    let mut content = description.clone();
    content.locator = description::Locator::default();
    content.directory = PathBuf::new();
    content.output = description::Output::default();
    // What is written for a frame says more than its number.
    content.frame = None;
    content.motion = None;
    content.render.frames_per_second = None;
    let mut text = format!("{content:?}");
    if description.directory != Path::new("") {
        text = text.replace(&format!("{}/", description.directory.display()), "");
    }
    text
}

fn filter(filter: &description::Filter) -> Filter {
    match *filter {
        description::Filter::Box => Filter::Box,
        description::Filter::Tent { radius } => Filter::Tent { radius },
        description::Filter::Gaussian { stddev } => Filter::Gaussian { stddev },
        description::Filter::Mitchell { b, c } => Filter::Mitchell { b, c },
        description::Filter::CatmullRom => Filter::CatmullRom,
        description::Filter::Lanczos { radius } => Filter::Lanczos { radius },
    }
}

fn colour_space(colour: description::Colour) -> ColourSpace {
    match colour {
        description::Colour::Rec709 => ColourSpace::Rec709,
        description::Colour::AcesCg => ColourSpace::AcesCg,
        description::Colour::Aces2065 => ColourSpace::Aces2065_1,
        description::Colour::Rec2020 => ColourSpace::Rec2020,
        description::Colour::P3 => ColourSpace::P3D65,
        description::Colour::Xyz => ColourSpace::Xyz,
    }
}

/// Whether the name of `path` ends in one of `extensions`, whose case does not matter.
fn ends_in(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|e| extensions.iter().any(|x| e.eq_ignore_ascii_case(x)))
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

/// The data window: the crop, or the whole frame and what is rendered beyond it.
#[must_use]
pub fn window(description: &SceneDescription) -> Window {
    match &description.image.crop {
        Some(c) => Window { x: c.x as i32, y: c.y as i32, width: c.width, height: c.height },
        None => {
            let description::Image { width, height, overscan, .. } = description.image;
            let (x, y) = (-(overscan as i32), -(overscan as i32));
            Window { x, y, width: width + 2 * overscan, height: height + 2 * overscan }
        }
    }
}

/// Renders a prepared scene and writes its pictures.
///
/// # Errors
/// [`Error::Render`] for invalid samples (the pictures are written all the same) or a stop,
/// [`Error::Output`] where a file cannot be written.
pub fn render_scene(
    prepared: &Prepared,
    overrides: &Overrides,
    loading: std::time::Duration,
    watcher: &dyn Watcher,
    stop: &AtomicBool,
) -> (SceneReport, Result<()>) {
    let mut report = SceneReport::new(&prepared.scene.name, prepared.description.frame);
    report.describe(&Finish::of(prepared), loading);
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
    // A place that cannot be written to is told before the work, not after.
    output::prepare_place(&exr_path)?;
    output::prepare_place(&checkpoint::place(&exr_path))?;
    if overrides.portion.is_all() {
        output::prepare_place(&exr_path.with_extension("png"))?;
        if description.output.spectral.is_some() {
            output::prepare_place(&spectral_path(&exr_path))?;
        }
    }
    let filter = FilterSampler::new(filter(&description.image.filter))?;
    let job = prepared.job(&filter);
    let portion = &overrides.portion;
    if prepared.stop.is_open() && !portion.is_all() {
        let hint = "a part cannot know the error or the time of the whole picture; give it a number of samples";
        return Err(Error::Config(format!("render.stop: {hint}")));
    }
    let identity = Identity::new(Finish::of(prepared), &prepared.source, &prepared.plan);
    let finish = &identity.finish;
    let share = portion.share(job.window, job.samples, finish.rows())?;
    check_memory(description, share.rows(job.window), overrides.memory_limit)?;
    if checkpoint::is_there(&overrides.keep, &exr_path, &identity, (!portion.is_all()).then_some(&share)) {
        checkpoint::remove_left_over(&exr_path, &identity)?;
        report.status = Status::Skipped;
        report.files = vec![exr_path];
        return Ok(());
    }
    let mut keeper = Keeper::new(&overrides.keep, stop, &exr_path, &identity, prepared.scene.watch.as_deref());
    let begun = keeper.begin(&job, share)?;
    let begun = go_on(begun, &|p| watcher.progress(p), &keeper)?;
    if !portion.is_all() {
        report.measure_part(&begun, keeper.numerics());
        let written = Instant::now();
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
    report.forecast = Forecast::at_a_quarter(&frame.milestones, &prepared.stop, prepared.samples);
    let written = finish::write(finish, &frame, &exr_path, report);
    // What cannot be written can still be resumed.
    if report.files.is_empty() {
        return written;
    }
    report.notes.extend(keeper.done()?);
    written.and_then(|()| prepared.stop.check(&frame.milestones))
}

/// The place of `-o` for `scenes` scenes.
///
/// # Errors
/// [`Error::Config`] for the name of another kind of file, for a word in braces that stands for nothing, and for one file for
/// all scenes.
fn check_output(output: Option<&Path>, scenes: usize) -> Result<()> {
    const OTHERS: [&str; 7] = ["png", "jpg", "jpeg", "tif", "tiff", "hdr", "pfm"];
    if let Some(file) = output.filter(|path| ends_in(path, &OTHERS) && !path.is_dir()) {
        return Err(Error::Config(format!(
            "-o {}: expected a directory or a file name that ends in .exr, beside which the PNG is written",
            file.display()
        )));
    }
    if let Some((output, Err(message))) = output.map(|output| (output, names::check(output))) {
        return Err(Error::Config(format!("-o {}: {message}", output.display())));
    }
    let file = output.filter(|path| ends_in(path, &["exr"]));
    match file.filter(|file| scenes > 1 && !names::tells(file).scenes) {
        Some(file) => Err(Error::Config(format!(
            "-o {}: expected a directory for {scenes} scenes, or a pattern with {{scene}}, found the name of one file",
            file.display()
        ))),
        None => Ok(()),
    }
}

/// Refuses a picture that would take the place of a file that its scene reads, one before it, or the batch: `read`, to which
/// this one's are added. What an earlier scene has written a later one may read.
fn check_places(prepared: &Prepared, overrides: &Overrides, read: &mut Inputs) -> Result<()> {
    for scene in prepared.moments.iter().chain(prepared.next.as_deref()).chain([&prepared.scene]) {
        read.add(&scene.files);
    }
    let places = finish::places(&output_path(prepared, overrides));
    // A part has no PNG and nothing else beside it.
    read.spare(if overrides.portion.is_all() { &places[..] } else { &places[..1] })
}

/// [`check_output`] for the frames of a scene.
fn check_frames(output: Option<&PathBuf>, frames: usize) -> Result<()> {
    let file = output.filter(|path| ends_in(path, &["exr"]));
    match file.filter(|file| frames > 1 && !names::tells(file).frames) {
        Some(file) => Err(Error::Config(format!(
            "-o {}: expected a directory for {frames} frames, or a pattern as a.####.exr, a.%04d.exr or \
             {{scene}}.{{frame:04}}.exr, found the name of one file",
            file.display()
        ))),
        None => Ok(()),
    }
}

/// Renders all frames of all scenes of `path` that are asked for; one that fails does not stop the others.
///
/// # Errors
/// What keeps the batch from beginning. What goes wrong in a scene is in the report.
pub fn render_batch(path: &Path, overrides: &Overrides, watcher: &dyn Watcher, stop: &AtomicBool) -> Result<Report> {
    let entries = entries(path, overrides)?;
    check_output(overrides.output.as_deref(), entries.len())?;
    clashes::check(&entries, overrides)?;
    let start = Instant::now();
    let mut scenes = Vec::new();
    let mut report_dir: Option<PathBuf> = None;
    let mut shelf = Shelf::default();
    let mut contact = Contact::default();
    let mut read = Inputs::of(entries.iter().map(|entry| &*entry.path).chain([path]));
    read.spare(&overrides.report)?;
    'batch: for (i, entry) in entries.iter().enumerate() {
        let mut loading = Instant::now();
        let animation = entry.animation(&overrides.set);
        read.add(animation.iter().flat_map(|animation| animation.files()));
        let frames = animation.as_ref().map_or(1, |animation| animation.frames().len().max(1));
        let animation = animation.and_then(|a| check_frames(overrides.output.as_ref(), frames).map(|()| a));
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
            let prepared = description.and_then(|d| prepare_scene(entry, d, overrides, &mut shelf, |_| {}));
            if i + 1 == entries.len() && n + 1 == frames {
                // Nobody comes after the last one.
                shelf = Shelf::default();
            }
            let prepared = prepared.and_then(|p| check_places(&p, overrides, &mut read).map(|()| p));
            // Unlike a picture it would be written all the same.
            read.spare(&overrides.report)?;
            let mut report = match prepared {
                Ok(prepared) => {
                    let dir = output_path(&prepared, overrides);
                    report_dir.get_or_insert_with(|| dir.parent().unwrap_or(Path::new(".")).to_path_buf());
                    let mut report = render_scene(&prepared, overrides, loading.elapsed(), watcher, stop).0;
                    let several = entries.len() > 1 || frames > 1;
                    if several && prepared.description.output.contact_sheet && overrides.portion.is_all() {
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
    if let Some(dir) = report_dir {
        let sheet = ["png", "html"].map(|ending| dir.join(names::about(overrides, "contact-sheet", ending)));
        match contact.write(&sheet, &report) {
            Ok(page) => report.contact_sheet = page,
            Err(e) => report.unwritten = Some(e),
        }
        report.write(&dir.join(names::about(overrides, "report", "json")));
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
        worst(codes.chain(self.unwritten.as_ref().map(Error::exit_code)))
    }
}

/// The exit code of a batch whose scenes call for `codes`; 0 where none does.
#[must_use]
pub fn worst(codes: impl Iterator<Item = i32>) -> i32 {
    // Where something can go on, it should. A fault of the description outranks a missing file, which outranks what
    // went wrong later.
    codes
        .min_by_key(|code| match code {
            75 => 0,
            2 => 1,
            3 => 2,
            4 => 3,
            _ => 4,
        })
        .unwrap_or(0)
}
