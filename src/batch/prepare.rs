//! From what was written to what is rendered: a scene compiled and planned, with the hash of all that decides about it.

use super::files;
use super::finish::{Finish, Sharing};
use super::frame::{Frame, FrameJob, Gauge};
use super::part::{Part, Share};
use super::stop::{self, Stop};
use super::techniques::Choice;
use super::{Overrides, Watcher, layers, motion, names};
use crate::description::{self, BatchEntry, LayerContent, SceneDescription};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::accumulate::{Film, REPLICATES, SAMPLES_LIMIT};
use crate::film::filter::{Filter, FilterSampler};
use crate::scene::Scene;
use crate::scene::brightness::Powers;
use crate::scene::casters::Casters;
use crate::scene::compile;
use crate::scene::shelf::Shelf;
use crate::spectrum::ColourSpace;
use crate::transport::Spread;
use crate::transport::layers::{Channel, Layer, Source};
use crate::transport::plan::{
    Coverage, EffectMode, EffectPlan, Integrator, LightSettings, PathSettings, WhittedSettings,
};
use glam::DVec2;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// What may be written is what a film holds.
const _: () = assert!(description::SAMPLES_LIMIT == SAMPLES_LIMIT * REPLICATES as u32);

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
    /// Wall time that pilot and trials took to choose techniques.
    pub trials: Duration,
}

impl Prepared {
    /// Its filter, ready for sampling.
    ///
    /// # Errors
    /// As [`FilterSampler::new`] and [`FilterSampler::within`].
    pub fn sampler(&self) -> Result<FilterSampler> {
        sampler(&self.description)
    }

    /// The memory that the sums of the whole picture take, in bytes: the scene and, while they are written, files take more.
    ///
    /// # Errors
    /// As [`Prepared::sampler`].
    pub fn sums(&self) -> Result<u64> {
        let filter = self.sampler()?;
        Ok(Part::bytes(&self.job(&filter), &Share::all(self.samples)))
    }

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
            gauge: Gauge {
                random: !matches!(plan.integrator, Integrator::Whitted(_)),
                lit: plan.lit,
                bands: description.image.bands.len(),
                sharing: Sharing::of(plan, description),
            },
        }
    }
}

/// Reads, compiles and plans a scene.
///
/// # Errors
/// [`Error::Config`] and [`Error::Input`], as [`compile::compile`].
pub fn prepare(entry: &BatchEntry, overrides: &Overrides) -> Result<Prepared> {
    prepare_watched(entry, overrides, &())
}

/// [`prepare`]; `watcher` hears what takes long.
///
/// # Errors
/// As [`prepare`].
pub fn prepare_watched(entry: &BatchEntry, overrides: &Overrides, watcher: &dyn Watcher) -> Result<Prepared> {
    let never = AtomicBool::new(false);
    prepare_one_of(entry, entry.scene(&overrides.set)?, overrides, &mut Shelf::default(), &never, watcher)
}

/// [`prepare_scene`] of one of the pictures of a batch. What is asked of all of them asks nothing of those by `whitted`.
pub(super) fn prepare_one_of(
    entry: &BatchEntry,
    mut description: SceneDescription,
    overrides: &Overrides,
    shelf: &mut Shelf,
    stop: &AtomicBool,
    watcher: &dyn Watcher,
) -> Result<Prepared> {
    let spared = spare_whitted(&mut description, entry, overrides);
    let mut prepared = prepare_scene(entry, description, overrides, shelf, stop, watcher, |_| {})?;
    if spared {
        let note = "whitted has no noise: the time or error that is given to all has no say";
        prepared.scene.notes.push(note.into());
    }
    let asked = overrides.set.iter().any(|(key, _)| ["render.samples", "render.stop.samples"].contains(&key.as_str()));
    if asked && matches!(prepared.description.integrator, description::Integrator::Whitted(_)) {
        let note = "whitted takes no samples: a pixel has the rays of its grid, integrator.whitted.grid to a side";
        prepared.scene.notes.push(note.into());
    }
    Ok(prepared)
}

/// Takes away the targets of a picture by `whitted`, which knows none, where they are not its own but those of all scenes: of the
/// batch, or of the command line if that asks for more than this scene. Whether there were any.
pub(super) fn spare_whitted(description: &mut SceneDescription, entry: &BatchEntry, overrides: &Overrides) -> bool {
    let is_target = |key: &str| ["render.stop", "render.stop.error", "render.stop.time"].contains(&key);
    let of_all = match overrides.set.iter().any(|(key, _)| is_target(key)) {
        true => entry.place().is_some() && overrides.scenes.len() != 1,
        false => entry.batch_has_stop(),
    };
    let spared = of_all && check_stop(description).is_err();
    if spared {
        description.render.stop = description::Stop::default();
    }
    spared
}

/// Refuses a time or an error for a picture by `whitted`.
pub(super) fn check_stop(description: &SceneDescription) -> Result<()> {
    let whitted = matches!(description.integrator, description::Integrator::Whitted(_));
    match whitted && stop(description).is_open() {
        true => Err(Error::Config(
            description.fault("render.stop", "whitted has no noise: its time and its error are given"),
        )),
        false => Ok(()),
    }
}

/// Compiles a scene that has been read, with what the scene before has read (see [`compile::compile_with`]), has `alter`
/// change it and its moments, and plans it, unless there comes an `interrupt`. `watcher` hears what takes long.
pub(super) fn prepare_scene(
    entry: &BatchEntry,
    description: SceneDescription,
    overrides: &Overrides,
    shelf: &mut Shelf,
    interrupt: &AtomicBool,
    watcher: &dyn Watcher,
    alter: impl Fn(&mut Scene),
) -> Result<Prepared> {
    let mut scene = compile::compile_with(&description, &entry.name, shelf)?;
    alter(&mut scene);
    let integrator = integrator(&description, &description.integrator)?;
    let stop = stop(&description);
    check_stop(&description)?;
    let samples = match &integrator {
        Integrator::Whitted(w) => w.samples,
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
    moments.iter_mut().for_each(&alter);
    // One film counts the light of all.
    let powers = moments.iter().map(|moment| moment.light_powers);
    scene.light_powers = powers.fold(scene.light_powers, Powers::max);
    moments.iter_mut().for_each(|moment| moment.light_powers = scene.light_powers);
    let powers = moments.iter().map(|moment| moment.length_powers);
    scene.length_powers = powers.fold(scene.length_powers, Powers::max);
    moments.iter_mut().for_each(|moment| moment.length_powers = scene.length_powers);
    let census = motion::census(&scene, &moments);
    let layers = layers::plan(&description, &scene, planned)?;
    if layers.parts_light() {
        for scene in moments.iter_mut().chain([&mut scene]) {
            scene.sharp = Casters::of(scene, &[]).casts;
        }
    }
    let mut plan = EffectPlan::of(&census, integrator, layers, mode);
    plan.effects.extend(blur.said);
    if matches!(plan.integrator, Integrator::Depth) {
        // Distances are no brighter where the lamps are.
        scene.light_powers = scene.length_powers;
        moments.iter_mut().for_each(|moment| moment.light_powers = scene.length_powers);
    }
    let filter = sampler(&description)?;
    let choosing = Instant::now();
    let choice = Choice {
        description: &description,
        scene: &scene,
        moments: &moments,
        census: &census,
        filter: &filter,
        stop,
        samples,
        interrupt,
        watcher,
    };
    let mut plan = choice.make(plan, planned)?;
    let trials = choosing.elapsed();
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
    let moving =
        description.layers.iter().any(|layer| layer.content == LayerContent::Middle(description::Data::Motion));
    let files = scene.files.iter().chain(moments.iter().flat_map(|moment| &moment.files));
    let mut hash = hash(&description, &blur.texts, files)?;
    let next = match description.frame.filter(|_| moving) {
        None => None,
        Some(frame) => {
            let later = entry.animation(&overrides.set)?.into_scene(Some(frame.saturating_add(1)))?;
            let scene = compile::compile_with(&later, &entry.name, shelf)?;
            // It is part of the picture.
            let both = hash + &self::hash(&later, &[], &scene.files)?;
            hash = blake3::hash(both.as_bytes()).to_hex()[..32].to_owned();
            Some(Box::new(scene))
        }
    };
    // They were for moments: rendering would only hold them, beside the curves that were made of them.
    shelf.strands = Default::default();
    let source = entry.path.clone();
    let prepared = Prepared { description, scene, moments, plan, samples, planned, stop, hash, source, next, trials };
    check_files(&prepared)?;
    Ok(prepared)
}

/// Whether the files of a picture can be written, whatever its pixels are.
fn check_files(prepared: &Prepared) -> Result<()> {
    let Prepared { description, scene, plan, .. } = prepared;
    names::check(&description.output.dir)
        .map_err(|message| Error::Config(description.fault("output.dir", &message)))?;
    let one = Film::new(scene.camera.resolution, Window::full(1, 1))?.with_layers(plan.layers.layout());
    let finish = Finish::of(prepared);
    let frame = Frame::of(one, None, 0, Duration::ZERO, &Gauge { random: false, ..finish.gauge() });
    let field = if description.layers.is_empty() { "output.exr" } else { "layers" };
    files::check_files(&finish, &frame).map_err(|message| {
        Error::Config(description.fault(field, &format!("expected a file that can be written: {message}")))
    })
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

/// What computes the light.
pub(super) fn integrator(description: &SceneDescription, written: &description::Integrator) -> Result<Integrator> {
    Ok(match written {
        description::Integrator::Path(p) => Integrator::Path(PathSettings {
            max_depth: p.max_depth,
            roulette_depth: p.roulette_depth,
            hide_emitters: p.hide_emitters,
            opaque_sky: p.opaque_sky,
            light_samples: p.light_samples,
            scatter_samples: p.scatter_samples,
            count_crossings: p.count_crossings,
            delta_caustics: p.delta_caustics,
            coverage: match p.coverage {
                description::Coverage::Surfaces => Coverage::Surfaces,
                description::Coverage::Scattering => Coverage::Scattering,
                description::Coverage::FirstHit => Coverage::FirstHit,
            },
        }),
        description::Integrator::Whitted(w) => Integrator::Whitted(WhittedSettings {
            max_depth: w.max_depth,
            grid: w.grid,
            samples: w.samples(),
            wavelengths: Spread::of_wavelengths(w.samples()),
            ambient: compile::ambient(description, &w.ambient)?,
            transparent_shadows: w.transparent_shadows,
        }),
        description::Integrator::Depth(_) => Integrator::Depth,
        description::Integrator::LightTracer(l) => Integrator::Light(LightSettings {
            max_depth: l.max_depth,
            roulette_depth: l.roulette_depth,
            hide_emitters: l.hide_emitters,
            count_crossings: l.count_crossings,
        }),
        description::Integrator::None(_) => Integrator::Nothing,
    })
}

/// 128 bits of BLAKE3 over what was written, with every default, where each of the `files` that were read stands by what it
/// holds: two machines, and two working directories, call one file by two names.
///
/// # Errors
/// [`Error::Input`] for one that can be read no more: without it the picture would be of another scene.
fn hash<'a>(
    description: &SceneDescription,
    moments: &[String],
    files: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<String> {
    let mut held: HashMap<String, String> = HashMap::new();
    for file in files {
        if let Entry::Vacant(place) = held.entry(format!("{file:?}")) {
            place.insert(contents(file).map_err(|e| Error::input(file, format!("cannot be read again: {e}")))?);
        }
    }
    let mut hasher = blake3::Hasher::new();
    for text in [hash_text(description)].iter().chain(moments) {
        let mut rest = text.as_str();
        while let Some(at) = rest.find('"') {
            let (before, from) = rest.split_at(at);
            let (quoted, after) = from.split_at(end_of_quoted(from));
            hasher.update(before.as_bytes());
            match before.ends_with("FilePath(") {
                // What nothing reads does not change the picture.
                true => hasher.update(held.get(quoted).map_or(&[][..], |held| held.as_bytes())),
                false => hasher.update(quoted.as_bytes()),
            };
            rest = after;
        }
        hasher.update(rest.as_bytes());
    }
    Ok(hasher.finalize().to_hex()[..32].to_owned())
}

/// The hash of what a file holds, with the ending of its name, from which some readers know what it is.
fn contents(file: &Path) -> std::io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(std::fs::File::open(file)?)?;
    Ok(format!("{} {:?}", hasher.finalize().to_hex(), file.extension()))
}

/// Bytes of the text in quotes, as `{:?}` writes it, with which `text` begins.
fn end_of_quoted(text: &str) -> usize {
    let mut at = 1;
    loop {
        match text.as_bytes().get(at) {
            None => return text.len(),
            Some(b'"') => return at + 1,
            Some(b'\\') => at += 2,
            Some(_) => at += 1,
        }
    }
}

/// What was written, as far as it decides about the picture; files by the names that they have here.
pub(super) fn hash_text(description: &SceneDescription) -> String {
    // Where its pictures go does not change them.
    let mut content = description.clone();
    content.locator = description::Locator::default();
    content.directory = PathBuf::new();
    content.output = description::Output::default();
    // What is written for a frame says more than its number.
    content.frame = None;
    content.motion = None;
    content.render.frames_per_second = None;
    // A stop at a number of samples is that number; a target stands beside the hash.
    if !stop(description).is_open() {
        content.render.samples = content.render.most_samples();
    }
    content.render.stop = description::Stop::default();
    format!("{content:?}")
}

pub(super) fn filter(filter: &description::Filter) -> Filter {
    match *filter {
        description::Filter::Box => Filter::Box,
        description::Filter::Tent { radius } => Filter::Tent { radius },
        description::Filter::Gaussian { stddev } => Filter::Gaussian { stddev },
        description::Filter::Mitchell { b, c } => Filter::Mitchell { b, c },
        description::Filter::CatmullRom => Filter::CatmullRom,
        description::Filter::Lanczos { radius } => Filter::Lanczos { radius },
    }
}

/// The filter of a picture, ready for sampling.
fn sampler(description: &SceneDescription) -> Result<FilterSampler> {
    let sampler = FilterSampler::new(filter(&description.image.filter))?;
    if description.image.sample_border {
        return Ok(sampler);
    }
    let Window { x, y, width, height } = window(description);
    let low = DVec2::new(f64::from(x), f64::from(y));
    sampler.within(low, low + DVec2::new(f64::from(width), f64::from(height)))
}

pub(super) fn colour_space(colour: description::Colour) -> ColourSpace {
    match colour {
        description::Colour::Rec709 => ColourSpace::Rec709,
        description::Colour::AcesCg => ColourSpace::AcesCg,
        description::Colour::Aces2065 => ColourSpace::Aces2065_1,
        description::Colour::Rec2020 => ColourSpace::Rec2020,
        description::Colour::P3 => ColourSpace::P3D65,
        description::Colour::Xyz => ColourSpace::Xyz,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples see the moments, and of these one path of the still scene told nothing.
    #[test]
    fn what_alters_a_scene_alters_each_of_its_moments() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("s.yaml");
        let text = "camera: {origin: {0: [0, 0, 5], 1: [1, 0, 5]}, target: [0, 0, 0], fov_deg: 40, shutter: 0.5}\n\
                    image: {width: 8, height: 8}\nrender: {frames: 0}\nlights: [constant: {radiance: 1}]\n";
        std::fs::write(&file, text).unwrap();
        let overrides = Overrides::default();
        let entry = super::super::entries(&file, &overrides).unwrap().remove(0);
        let description = entry.scene(&[]).unwrap();
        let alter = |scene: &mut Scene| scene.wavelengths = scene.wavelengths.with_count(1);
        let (shelf, go_on) = (&mut Shelf::default(), AtomicBool::new(false));
        let prepared = prepare_scene(&entry, description, &overrides, shelf, &go_on, &(), alter).unwrap();
        assert_eq!(prepared.moments.len(), 16);
        for scene in prepared.moments.iter().chain([&prepared.scene]) {
            let nm = scene.wavelengths.sample(0.3).nm.to_array();
            assert_eq!(nm, [nm[0]; 8]);
        }
    }

    /// A scene of the same numbers without its mesh would have had the hash: its parts, and what is there already, would no longer be
    /// known for its own.
    #[test]
    fn a_file_that_cannot_be_read_again_fails_the_picture() {
        let dir = tempfile::tempdir().unwrap();
        let [yaml, mesh] = ["s.yaml", "m.obj"].map(|name| dir.path().join(name));
        let camera = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}";
        std::fs::write(&yaml, format!("{camera}\nshapes: [mesh: {{file: m.obj}}]\n")).unwrap();
        std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let none = Overrides::default();
        let entry = &crate::batch::entries(&yaml, &none).unwrap()[0];
        let (description, never) = (entry.scene(&[]).unwrap(), AtomicBool::new(false));
        let gone = |_: &mut Scene| std::fs::remove_file(&mesh).unwrap();
        let found = prepare_scene(entry, description, &none, &mut Shelf::default(), &never, &(), gone).unwrap_err();
        assert!(found.exit_code() == 3 && found.to_string().contains("m.obj: cannot be read again"), "{found}");
    }
}
