//! A part of a picture as a file: its sums, what it stands for, and what the files of the picture will need.
//!
//! [`crate::film::exr::part`] says how sums become channels. Their names: `camera0.X` is the sum of X in replicate 0, in
//! units of 2⁻⁶⁴ of light over 2^`exponent`; `camera0.A` that of coverage, in 2⁻³⁴; `camera0.n` counts its samples,
//! `camera0.dropped` those that were dropped; `lights0.X` … are the same of paths from the lights. `cameraLayers.3` is
//! the sum of the fourth further channel, in units of 2⁻⁶⁴ over 2 to the power that `finish.layers` has for it,
//! `cameraLayers.n` its samples, or `cameraLayers0.3` and `cameraLayers0.n` those of replicate 0 where standard errors of layers
//! are wanted; `cameraMattes.0` is the number of what covers the pixel, times 2³², and how many samples met it,
//! `cameraMattes.1` of the next: these are not added as they are, but the counts of each number, wherever it stands. A value is the
//! sum over replicates over the count over replicates; of paths from the lights over `splat_paths` instead.
//!
//! The same file, with what is done so far in `claims`, is a checkpoint.

use super::adaptive::{self, Allocation, HALVES};
use super::finish::Finish;
use super::frame::Milestone;
use super::outlook::Outlook;
use super::part::{Claims, Part, Share, SplatFilm};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::accumulate::{Cell, Film, InvalidCounts, REPLICATES, SAMPLES_LIMIT};
use crate::film::exr::Attribute;
use crate::film::exr::part::{Numbers, PartFile, Plane, write_part};
use crate::film::layers::{Kept, Layout};
use crate::scene::watch::Counts;
use crate::transport::plan::EffectPlan;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Version of the format; another one is refused.
const FORMAT: u32 = 6;

/// Of the planes of mattes, before their rank.
const MATTES: &str = "cameraMattes.";

/// What the header of a part says, in the attribute `abbe/part`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Version of the format.
    pub format: u32,
    /// The program, whose every version may compute other bits.
    pub build: String,
    /// Hash of all decisions of the plan, with what the pilot has learnt.
    pub plan_hash: String,
    /// Hash of `finish` without its notes.
    pub settings_hash: String,
    /// The file that was rendered.
    #[serde(serialize_with = "super::report::in_text")]
    pub source: PathBuf,
    /// Light is counted over 2 to this power.
    pub exponent: i32,
    /// Which tile of how many.
    pub tile: [u32; 2],
    /// The first sample, and the one after the last, that the part is to have.
    pub samples: [u32; 2],
    /// What it has.
    pub claims: Claims,
    /// How samples are shared out among cells, in a checkpoint where that is decided ([`super::adaptive`]).
    pub shares: Option<Vec<[i16; HALVES]>>,
    /// What becomes of the picture then.
    pub outlook: Option<Outlook>,
    /// Paths from the lights of each sample of the picture, where there are any.
    pub paths: Option<u64>,
    /// Those that are in the sums, by replicate.
    pub splat_paths: Option<[u64; REPLICATES]>,
    /// Samples that were dropped: of the camera, of its layers, of the lights, of theirs.
    pub invalid: [InvalidCounts; 4],
    /// Wall time of rendering, seconds.
    pub seconds: f64,
    /// The error after each pass, in a checkpoint.
    pub milestones: Vec<Milestone>,
    /// What was counted of robust arithmetic.
    pub numerics: Option<Counts>,
    /// What the files of the picture need.
    pub finish: Finish,
    /// The sums in the file.
    pub planes: Vec<Plane>,
}

/// What all parts of a picture have in common.
#[derive(Clone, Debug)]
pub struct Identity {
    /// What the files of the picture need.
    pub finish: Finish,
    /// The file that is rendered.
    pub source: PathBuf,
    plan_hash: String,
}

impl Identity {
    /// Of a picture that is rendered from `source` with `plan`.
    #[must_use]
    pub fn new(finish: Finish, source: &Path, plan: &EffectPlan) -> Identity {
        /// Text that is hashed as it is written.
        struct Hashed(blake3::Hasher);
        impl Write for Hashed {
            fn write_str(&mut self, text: &str) -> std::fmt::Result {
                self.0.update(text.as_bytes());
                Ok(())
            }
        }
        let mut hashed = Hashed(blake3::Hasher::new());
        // A hasher takes all that it is given.
        let _ = write!(hashed, "{plan:?}");
        let plan_hash = hashed.0.finalize().to_hex()[..32].to_owned();
        Identity { finish, source: source.to_path_buf(), plan_hash }
    }
}

/// The program that renders.
#[must_use]
pub fn build() -> String {
    let precision = if cfg!(feature = "single_precision") { " single precision" } else { "" };
    let lanes = if cfg!(feature = "four_lanes") { " four lanes" } else { "" };
    format!("Abbe {} {}{precision}{lanes}", env!("CARGO_PKG_VERSION"), std::env::consts::ARCH)
}

impl Finish {
    /// Hash of what decides about the pixels of the files: all but the notes.
    #[must_use]
    pub fn settings_hash(&self) -> String {
        let plain = Finish { notes: Vec::new(), ..self.clone() };
        // A record of numbers and text always is JSON.
        let json = serde_json::to_string(&plain).unwrap_or_default();
        blake3::hash(json.as_bytes()).to_hex()[..32].to_owned()
    }
}

/// Where a plane's numbers are.
#[derive(Clone, Copy)]
enum Kind {
    Xyz(usize, usize),
    Alpha(usize),
    Count(usize),
    Dropped(usize),
    Weight(usize),
    /// Of a set of sums, see [`LayerSums::place`](crate::film::layers::LayerSums::place), and a channel.
    Layer(usize, usize),
    LayerCount(usize),
    Matte(usize),
}

/// The planes of one film, with their names.
fn kinds(prefix: &str, layers: Layout) -> Vec<(Kind, String)> {
    let mut all = Vec::new();
    for r in 0..REPLICATES {
        for (c, letter) in ["X", "Y", "Z"].iter().enumerate() {
            all.push((Kind::Xyz(r, c), format!("{prefix}{r}.{letter}")));
        }
        all.push((Kind::Alpha(r), format!("{prefix}{r}.A")));
        all.push((Kind::Count(r), format!("{prefix}{r}.n")));
        all.push((Kind::Dropped(r), format!("{prefix}{r}.dropped")));
        if layers.kept == Kept::Weighed {
            all.push((Kind::Weight(r), format!("{prefix}{r}.weight")));
        }
    }
    if layers.channels > 0 {
        for set in 0..layers.kept.sets() {
            let of = match layers.kept {
                Kept::Together => format!("{prefix}Layers"),
                Kept::ByReplicate | Kept::Weighed => format!("{prefix}Layers{set}"),
            };
            all.extend((0..layers.channels).map(|i| (Kind::Layer(set, i), format!("{of}.{i}"))));
            all.push((Kind::LayerCount(set), format!("{of}.n")));
        }
    }
    all
}

/// The planes of a part: those of the lights follow those of the camera.
fn all_kinds(camera_layers: Layout, mattes: usize, light_layers: Option<Layout>) -> (usize, Vec<(Kind, String)>) {
    let mut all = kinds("camera", camera_layers);
    all.extend((0..mattes).map(|i| (Kind::Matte(i), format!("{MATTES}{i}"))));
    let own = all.len();
    if let Some(layers) = light_layers {
        all.extend(kinds("lights", layers));
    }
    (own, all)
}

struct Sums<'a> {
    window: Window,
    film: &'a Film,
    splats: Option<&'a Film>,
    own: usize,
    kinds: Vec<(Kind, String)>,
}

impl Numbers for Sums<'_> {
    fn names(&self) -> Vec<String> {
        self.kinds.iter().map(|(_, name)| name.clone()).collect()
    }

    fn fill(&self, plane: usize, y: i32, row: &mut [i128]) {
        let Some(film) = (if plane < self.own { Some(self.film) } else { self.splats }) else { return };
        let window = film.window();
        let Some(start) = window.index([window.x, y]) else { return };
        let width = window.width as usize;
        let cells = &film.cells()[start..start + width];
        let (sums, counts) = film.layers.parts();
        let channels = film.layers.channels();
        // The window of the file is as wide as that of each film: they differ by rows.
        debug_assert!(window.x == self.window.x && row.len() == width);
        let kind = self.kinds[plane].0;
        for (i, value) in row.iter_mut().enumerate() {
            *value = match kind {
                Kind::Xyz(r, c) => cells[i][r].xyz[c].0,
                Kind::Alpha(r) => cells[i][r].alpha.into(),
                Kind::Count(r) => cells[i][r].count.into(),
                Kind::Dropped(r) => cells[i][r].dropped.into(),
                Kind::Weight(r) => film.layers.weight_units()[(start + i) * REPLICATES + r].into(),
                Kind::Layer(set, c) => sums[film.layers.place(start + i, set) * channels + c].0,
                Kind::LayerCount(set) => counts[film.layers.place(start + i, set)].into(),
                Kind::Matte(rank) => {
                    let of = film.layers.mattes.of(start + i).get(rank);
                    of.map_or(0, |&(number, count)| i128::from(number) << 32 | i128::from(count))
                }
            };
        }
    }
}

/// Writes what `part` has so far.
///
/// # Errors
/// [`Error::Output`].
pub fn write(
    path: &Path,
    identity: &Identity,
    part: &Part,
    milestones: &[Milestone],
    elapsed: Duration,
    numerics: Option<Counts>,
) -> Result<()> {
    let share = part.share();
    part.look(|film, splats| {
        let layers = splats.map(|s| s.film.layers.layout());
        let (own, kinds) = all_kinds(film.layers.layout(), film.layers.mattes.most(), layers);
        let window = splats.map_or(film.window(), |s| s.film.window());
        let sums = Sums { window, film, splats: splats.map(|s| &s.film), own, kinds };
        let none = InvalidCounts::default();
        let dropped = |film: &Film| [film.invalid, film.layers.invalid];
        let [a, b] = dropped(film);
        let [c, d] = splats.map_or([none; 2], |s| dropped(&s.film));
        let describe = |planes: &[Plane]| {
            let header = Header {
                format: FORMAT,
                build: build(),
                plan_hash: identity.plan_hash.clone(),
                settings_hash: identity.finish.settings_hash(),
                source: identity.source.clone(),
                exponent: film.exponent(),
                tile: [share.tile, share.tiles],
                samples: [share.samples.start, share.samples.end],
                claims: part.claims(),
                shares: part.allocation().map(|a| a.shares().to_vec()),
                outlook: part.allocation().map(|a| a.outlook().clone()),
                paths: part.paths_of_a_sample(),
                splat_paths: splats.map(|s| s.paths),
                invalid: [a, b, c, d],
                seconds: elapsed.as_secs_f64(),
                milestones: milestones.to_vec(),
                numerics,
                finish: identity.finish.clone(),
                planes: planes.to_vec(),
            };
            // A record of numbers and text always is JSON.
            (serde_json::to_string(&header).unwrap_or_default(), header.attributes())
        };
        write_part(path, film.frame(), window, &sums, describe)
    })
}

impl Header {
    /// What people look for in a header; [`Header`] itself is what is read.
    fn attributes(&self) -> Vec<(String, Attribute)> {
        let text = |name: &str, value: &str| (name.to_owned(), Attribute::Text(value.to_owned()));
        let [tile, tiles] = self.tile;
        let [from, to] = self.samples;
        vec![
            text("software", concat!("Abbe ", env!("CARGO_PKG_VERSION"))),
            text("comments", &self.finish.name),
            text("abbe/version", env!("CARGO_PKG_VERSION")),
            text("abbe/sceneHash", &self.finish.scene_hash),
            text("abbe/settingsHash", &self.settings_hash),
            text("abbe/planHash", &self.plan_hash),
            text("abbe/seed", &self.finish.seed.to_string()),
            text("abbe/frame", &self.finish.frame_number.map_or("none".into(), |frame| frame.to_string())),
            text("abbe/tile", &format!("{tile}/{tiles}")),
            text("abbe/samples", &format!("{from}-{}", i64::from(to) - 1)),
        ]
    }

    /// What the part is to have of the picture.
    #[must_use]
    pub fn share(&self) -> Share {
        let samples = self.samples[0]..self.samples[1];
        Share { tile: self.tile[0], tiles: self.tile[1], samples, rows: self.finish.rows() }
    }

    /// Whether what it says holds together; the rest of it makes no sense otherwise.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let share = self.share();
        let Range { start, end } = share.samples;
        let window = self.finish.window;
        let inside = |claim: &(Window, Range<u32>)| {
            let (tile, samples) = claim;
            share.rows(window).contains(tile) && samples.start == start && samples.end >= start && samples.end <= end
        };
        let followed = |claim: &(Range<u64>, Range<u32>)| {
            let (paths, samples) = claim;
            paths.start <= paths.end
                && self.paths.is_some_and(|all| paths.end <= all)
                && start <= samples.start
                && samples.start <= samples.end
                && samples.end <= end
        };
        window.pixels() > 0
            && window.pixels() <= 1 << 30
            && window.x.unsigned_abs().max(window.y.unsigned_abs()) <= 1 << 30
            && share.tile < share.tiles
            && start < end
            && end <= self.finish.samples
            && self.paths.is_some() == self.splat_paths.is_some()
            && self.seconds >= 0.0
            && self.claims.camera.iter().all(inside)
            && self.claims.lights.iter().all(followed)
            && self.shares_agree()
    }

    /// How samples are shared out, where that is decided.
    #[must_use]
    pub fn allocation(&self) -> Option<Allocation> {
        Allocation::from(
            self.share().rows(self.finish.window),
            self.finish.adaptive?,
            self.shares.clone()?,
            self.outlook.clone()?,
        )
    }

    /// Whether what is said of adaptive sampling agrees with the rest: all samples of the first pass are there before
    /// shares are known, and no others.
    fn shares_agree(&self) -> bool {
        let told = self.outlook.as_ref().map(Outlook::is_sound);
        match (self.finish.adaptive, &self.shares) {
            _ if told != self.shares.as_ref().map(|_| true) => false,
            (None, None) => true,
            (None, Some(_)) => false,
            (Some(first), None) => first >= 4 && self.claims.camera.iter().all(|(_, samples)| samples.end <= first),
            (Some(first), Some(shares)) => {
                first >= 4
                    && first.is_power_of_two()
                    && shares.len() == adaptive::cells(self.share().rows(self.finish.window))
                    && self.claims.camera.iter().all(|(_, samples)| samples.end >= first)
            }
        }
    }

    /// Whether the part has all that it is to have.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let share = self.share();
        let lights = self.paths.map(|paths| share.of(paths)).filter(|paths| !paths.is_empty());
        self.claims.camera == [(share.rows(self.finish.window), share.samples.clone())]
            && self.claims.lights == lights.map(|paths| (paths, share.samples)).into_iter().collect::<Vec<_>>()
    }

    /// The pixels of the file.
    fn window(&self) -> Window {
        match self.splat_paths {
            Some(_) => self.finish.window,
            None => self.share().rows(self.finish.window),
        }
    }

    /// Why `self`, read from `path`, is no part of the picture of `other`.
    ///
    /// # Errors
    /// [`Error::Input`] with what was expected and found.
    pub fn check_like(&self, path: &Path, other: &Header) -> Result<()> {
        self.check(path, &other.finish, &other.plan_hash)?;
        if (self.exponent, self.paths) != (other.exponent, other.paths) {
            return Err(differs(path, "plan", &other.plan_hash, &self.plan_hash));
        }
        Ok(())
    }

    /// Why `self`, read from `path`, is not of the picture of `identity`.
    ///
    /// # Errors
    /// As [`Header::check_like`].
    pub fn check_of(&self, path: &Path, identity: &Identity) -> Result<()> {
        self.check(path, &identity.finish, &identity.plan_hash)
    }

    /// Why a render of `identity` as `share` cannot go on from `self`, read from `path`. Where both have targets these may differ: the
    /// samples that are there are the first ones of either, unless they are more than the most that may be.
    ///
    /// # Errors
    /// As [`Header::check_like`].
    pub fn check_begun(&self, path: &Path, identity: &Identity, share: &Share) -> Result<()> {
        let mut finish = identity.finish.clone();
        let mut found = self.share();
        if let (Some(target), Some(own)) = (&mut finish.target, self.finish.target)
            && target.planned == own.planned
        {
            (*target, finish.samples) = (own, self.finish.samples);
            let camera = self.claims.camera.iter().map(|(_, samples)| samples.end);
            let reached = camera.chain(self.claims.lights.iter().map(|(_, samples)| samples.end)).max();
            found.samples.end = share.samples.end.max(reached.unwrap_or(0));
        }
        self.check(path, &finish, &identity.plan_hash)?;
        match found == *share {
            true => Ok(()),
            false => Err(Error::input(path, format!("expected a checkpoint of {share}, found one of {found}"))),
        }
    }

    fn check(&self, path: &Path, finish: &Finish, plan_hash: &str) -> Result<()> {
        if self.finish.name != finish.name {
            return Err(differs(path, "scene", &finish.name, &self.finish.name));
        }
        // What was set says more than a hash.
        let fields = |finish: &Finish| match serde_json::to_value(finish) {
            Ok(Value::Object(fields)) => fields,
            _ => serde_json::Map::new(),
        };
        let (own, others) = (fields(&self.finish), fields(finish));
        // These follow from the scene and the plan.
        const CONSEQUENCES: [&str; 8] =
            ["notes", "scene_hash", "effects", "techniques", "wavelengths", "sharing", "adaptive", "kept"];
        let names: BTreeSet<&String> = own.keys().chain(others.keys()).collect();
        for name in names.into_iter().filter(|name| !CONSEQUENCES.contains(&name.as_str())) {
            if let Some((field, expected, found)) = difference(name, others.get(name), own.get(name)) {
                return Err(differs(path, &field, &expected, &found));
            }
        }
        if self.finish.scene_hash != finish.scene_hash {
            return Err(differs(path, "scene with the hash", &finish.scene_hash, &self.finish.scene_hash));
        }
        if self.plan_hash != plan_hash {
            return Err(differs(path, "plan with the hash", plan_hash, &self.plan_hash));
        }
        Ok(())
    }
}

/// Where two values differ, if they do: the field below `name`, and its two values in words.
fn difference(name: &str, expected: Option<&Value>, found: Option<&Value>) -> Option<(String, String, String)> {
    match (expected, found) {
        (Some(Value::Object(a)), Some(Value::Object(b))) => {
            let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            keys.into_iter().find_map(|key| difference(&format!("{name}.{key}"), a.get(key), b.get(key)))
        }
        (Some(Value::Array(a)), Some(Value::Array(b))) if a.len() == b.len() && a.len() > 4 => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(i, (a, b))| difference(&format!("{name}[{i}]"), Some(a), Some(b)))
        }
        _ if expected == found => None,
        _ => {
            let word = |value: Option<&Value>| value.map_or("none".to_owned(), ToString::to_string);
            Some((name.to_owned(), word(expected), word(found)))
        }
    }
}

fn differs(path: &Path, what: &str, expected: &str, found: &str) -> Error {
    let short = |text: &str| match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    };
    let (expected, found) = (short(expected), short(found));
    Error::input(path, format!("it is of another picture: {what}: expected {expected}, found {found}"))
}

/// A part in a file whose header has been read.
#[derive(Debug)]
pub struct Written {
    /// Where it is.
    pub path: PathBuf,
    /// What it says.
    pub header: Header,
    file: PartFile,
}

/// Reads the header of the part at `path`.
///
/// # Errors
/// [`Error::Input`] if it is missing, damaged, no part, or of another version.
pub fn open(path: &Path) -> Result<Written> {
    open_if(path, |found| found == build())
}

/// [`open`], whichever build wrote it: to look at, not to add to what this one renders.
///
/// # Errors
/// [`Error::Input`] if it is missing, damaged, no part, or of another format.
pub fn open_of_any_build(path: &Path) -> Result<Written> {
    open_if(path, |_| true)
}

fn open_if(path: &Path, wanted: impl Fn(&str) -> bool) -> Result<Written> {
    /// What is looked at first: another version has other fields.
    #[derive(Deserialize)]
    struct Version {
        format: u32,
        build: String,
    }
    let file = PartFile::open(path)?;
    let damaged = |e: &dyn std::fmt::Display| Error::input(path, format!("the part is damaged: its header: {e}"));
    let version: Version = serde_json::from_str(&file.json).map_err(|e| damaged(&e))?;
    if version.format != FORMAT || !wanted(&version.build) {
        let (own, found) = (build(), version.build);
        let message =
            format!("expected a part by {own}, format {FORMAT}, found one by {found}, format {}", version.format);
        return Err(Error::input(path, message));
    }
    let header: Header = serde_json::from_str(&file.json).map_err(|e| damaged(&e))?;
    if !(header.is_sound() && header.window() == file.window) {
        return Err(damaged(&"it does not hold together"));
    }
    Ok(Written { path: path.to_path_buf(), header, file })
}

impl Written {
    /// Empty sums of the size of `window` for parts like this.
    ///
    /// # Errors
    /// [`Error::Memory`] if the memory cannot be had.
    pub fn empty(&self, window: Window) -> Result<(Film, Option<SplatFilm>)> {
        let Header { finish, exponent, .. } = &self.header;
        let film = |window, layers| {
            let film = Film::new(finish.frame, window)?;
            Ok(film.with_layers(layers).with_exponent(*exponent))
        };
        let splats = match self.header.splat_paths {
            Some(_) => Some(SplatFilm { film: film(finish.window, self.light_layers())?, paths: [0; REPLICATES] }),
            None => None,
        };
        Ok((film(window, finish.layout())?, splats))
    }

    /// Channels of bands and of light by its ways come first among the layers, and paths from the lights have those alone.
    fn light_layers(&self) -> Layout {
        let kept = self.header.finish.layout().kept.without_weights();
        let sums = |p: &&Plane| p.name.starts_with("lightsLayers") && !p.name.ends_with(".n");
        Layout { channels: self.header.planes.iter().filter(sums).count() / kept.sets(), kept }
    }

    /// Reads all, and keeps nothing.
    ///
    /// # Errors
    /// [`Error::Input`] if the file is damaged.
    pub fn verify(&self) -> Result<()> {
        self.file.read(&self.header.planes, &mut |_, _, _| Ok(()))
    }

    /// Adds the sums to `film` and `splats`, which [`Written::empty`] made.
    ///
    /// # Errors
    /// [`Error::Input`] if the file is damaged; the sums are then of no use.
    pub fn add_to(&self, film: &mut Film, mut splats: Option<&mut SplatFilm>) -> Result<()> {
        let header = &self.header;
        let damaged = |what: &str| Error::input(&self.path, format!("the part is damaged: {what}"));
        let light_layers = header.splat_paths.map(|_| self.light_layers());
        let mattes = header.planes.iter().filter(|p| p.name.starts_with(MATTES)).count();
        let (own, kinds) = all_kinds(header.finish.layout(), mattes, light_layers);
        if !kinds.iter().map(|(_, name)| name).eq(header.planes.iter().map(|plane| &plane.name)) {
            return Err(damaged("its planes are not those of the sums"));
        }
        let too_much = || damaged("its numbers are larger than sums can be");
        self.file.read(&header.planes, &mut |plane, y, row| {
            let film = match &mut splats {
                Some(splats) if plane >= own => &mut splats.film,
                _ => &mut *film,
            };
            let window = film.window();
            let Some(start) = window.index([window.x, y]) else {
                // A tile's own rows are fewer than those of the file; there is nothing in the others.
                return if row.iter().all(|x| *x == 0) { Ok(()) } else { Err(damaged("sums lie outside its rows")) };
            };
            add_row(film, kinds[plane].0, start, row).ok_or_else(too_much)
        })?;
        let [a, b, c, d] = header.invalid;
        film.invalid += a;
        film.layers.invalid += b;
        if let (Some(splats), Some(paths)) = (splats, header.splat_paths) {
            splats.film.invalid += c;
            splats.film.layers.invalid += d;
            for (sum, own) in splats.paths.iter_mut().zip(paths) {
                *sum = sum.saturating_add(own);
            }
        }
        Ok(())
    }
}

/// Adds numbers to pixels from the index `start` on; none if a sum is too large.
fn add_row(film: &mut Film, kind: Kind, start: usize, row: &[i128]) -> Option<()> {
    let channels = film.layers.channels();
    match kind {
        Kind::Layer(set, c) => {
            for (i, x) in row.iter().enumerate() {
                let place = film.layers.place(start + i, set);
                let sum = &mut film.layers.parts_mut().0[place * channels + c].0;
                *sum = sum.checked_add(*x)?;
            }
        }
        Kind::Matte(_) => {
            let pixels = film.window().pixels();
            for (i, x) in row.iter().enumerate().filter(|(_, x)| **x != 0) {
                let (number, count) = (u64::try_from(x >> 32).ok()?, *x as u32);
                film.layers.mattes.add(start + i, pixels, number, count);
            }
        }
        Kind::LayerCount(set) => {
            for (i, x) in row.iter().enumerate() {
                let place = film.layers.place(start + i, set);
                let count = &mut film.layers.parts_mut().1[place];
                *count = count_of(*count, *x)?;
            }
        }
        Kind::Weight(r) => {
            for (units, x) in
                film.layers.weight_units_mut().iter_mut().skip(start * REPLICATES + r).step_by(REPLICATES).zip(row)
            {
                *units = units.checked_add(i64::try_from(*x).ok()?)?;
            }
        }
        Kind::Xyz(..) | Kind::Alpha(_) | Kind::Count(_) | Kind::Dropped(_) => {
            let add = |cell: &mut Cell, x: i128| -> Option<()> {
                match kind {
                    Kind::Xyz(_, c) => cell.xyz[c].0 = cell.xyz[c].0.checked_add(x)?,
                    Kind::Alpha(_) => cell.alpha = cell.alpha.checked_add(i64::try_from(x).ok()?)?,
                    Kind::Count(_) => cell.count = count_of(cell.count, x)?,
                    Kind::Dropped(_) => cell.dropped = cell.dropped.saturating_add(u32::try_from(x).ok()?),
                    Kind::Weight(_) | Kind::Layer(..) | Kind::LayerCount(_) | Kind::Matte(_) => {}
                }
                Some(())
            };
            let (Kind::Xyz(r, _) | Kind::Alpha(r) | Kind::Count(r) | Kind::Dropped(r)) = kind else { return Some(()) };
            for (cells, x) in film.cells_mut()[start..].iter_mut().zip(row) {
                add(&mut cells[r], *x)?;
            }
        }
    }
    Some(())
}

/// A count that the film can have had.
fn count_of(count: u32, x: i128) -> Option<u32> {
    count.checked_add(u32::try_from(x).ok()?).filter(|count| *count <= SAMPLES_LIMIT)
}
