//! No two pictures of a job go to one file, and no report: what would be written twice is told before anything is rendered.

use super::files::{self, spectral_path};
use super::{Overrides, about_files, about_place, checkpoint, names, place};
use crate::description::{Animation, BatchEntry};
use crate::error::{Error, Result};
use crate::film::output::{self, Inputs};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::ffi::OsStr;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Component, Path, PathBuf};

/// The pictures of a scene, as far as they decide about names.
struct Pictures {
    /// Of the description.
    directory: PathBuf,
    frames: Vec<i32>,
    /// Whether each has a file of bands.
    spectral: bool,
    /// Whether they are on the contact sheet.
    sheet: bool,
}

impl Pictures {
    /// None of a scene that cannot be read, which is told in its turn.
    fn of(entry: &BatchEntry, overrides: &Overrides) -> Option<Pictures> {
        Pictures::seen(&entry.animation(&overrides.set).ok()?, overrides)
    }

    /// [`Pictures::of`] a scene that has been read.
    fn seen(animation: &Animation, overrides: &Overrides) -> Option<Pictures> {
        let output = animation.output().ok()?;
        Some(Pictures {
            // `./out` is `out`.
            directory: output.dir.components().filter(|piece| *piece != Component::CurDir).collect(),
            frames: animation.frames().to_vec(),
            spectral: output.spectral.is_some() && overrides.portion.is_all(),
            sheet: output.contact_sheet && overrides.portion.is_all(),
        })
    }

    /// The EXR files of a frame, and its snapshot as if it were one. What lies beside them has their names, with other endings.
    fn files(&self, name: &str, frame: Option<i32>, overrides: &Overrides) -> impl Iterator<Item = PathBuf> + use<> {
        let file = place(&self.directory, name, frame, overrides);
        let spectral = self.spectral.then(|| spectral_path(&file));
        // Parts are no PNGs, whose place it could take.
        let snapshot = || checkpoint::snapshot_place(&file).with_extension("exr");
        let snapshot = overrides.portion.is_all().then(snapshot);
        std::iter::once(file).chain(spectral).chain(snapshot)
    }

    fn frames(&self) -> impl Iterator<Item = Option<i32>> {
        let none = self.frames.is_empty().then_some(None);
        none.into_iter().chain(self.frames.iter().map(|frame| Some(*frame)))
    }
}

/// What is the same of the names of all frames of a scene.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Key {
    /// All but the last piece between dots, where that is a number.
    BeforeNumber,
    /// All but digits and signs.
    Letters,
}

impl Key {
    /// A hash: equal paths have equal ones.
    fn of(self, path: &Path) -> u64 {
        let digits = |c: char| c.is_ascii_digit() || c == '-';
        let mut hasher = DefaultHasher::new();
        match self {
            Key::BeforeNumber => {
                let stem = path.file_stem().map(OsStr::to_string_lossy).unwrap_or_default();
                // The number of a frame stands before it.
                let stem = stem.strip_suffix(checkpoint::SNAPSHOT).unwrap_or(&stem);
                let numbered = stem.rsplit_once('.').filter(|(_, number)| number.chars().all(digits));
                path.parent().hash(&mut hasher);
                (numbered.map_or(stem, |(before, _)| before), numbered.is_some()).hash(&mut hasher);
            }
            Key::Letters => path.to_string_lossy().replace(digits, "").hash(&mut hasher),
        }
        hasher.finish()
    }
}

/// What is kept of a scene.
struct Look {
    /// Whether [`Key::BeforeNumber`] is the same for all its frames.
    told: bool,
    /// By [`Key::BeforeNumber`] and by [`Key::Letters`], of the files of a frame.
    keys: [Vec<u64>; 2],
    /// Where the contact sheet would lie if its first picture were that of the batch.
    sheet: PathBuf,
    /// Whether its pictures are on the sheet.
    on_sheet: bool,
}

impl Look {
    /// None of a scene that cannot be read.
    fn at(entry: &BatchEntry, overrides: &Overrides) -> Option<Look> {
        // Two frames that are far apart show what changes.
        const PROBES: [i32; 2] = [1, 98_765];
        let pictures = Pictures::of(entry, overrides)?;
        let keys_of = |key: Key, frame| -> Vec<u64> {
            pictures.files(&entry.name, frame, overrides).map(|file| key.of(&file)).collect()
        };
        let probe = PROBES.map(|frame| keys_of(Key::BeforeNumber, Some(frame)));
        let told = pictures.frames.is_empty() || probe[0] == probe[1];
        let first = pictures.frames.first().copied();
        let keys = [Key::BeforeNumber, Key::Letters].map(|key| keys_of(key, first));
        let sheet = sheet_place(&pictures, overrides);
        Some(Look { told, keys, sheet, on_sheet: pictures.sheet })
    }
}

/// Refuses a job in which two pictures, or a picture and the contact sheet, go to one file.
///
/// Scenes are read for this and forgotten. Only of those whose names are alike but for numbers all frames are compared.
///
/// # Errors
/// [`Error::Config`] with each two scenes, and the first file that both would write.
pub(super) fn check(entries: &[BatchEntry], overrides: &Overrides) -> Result<()> {
    if entries.len() < 2 {
        // Frames of one scene differ by their numbers.
        return Ok(());
    }
    let looks: Vec<Option<Look>> = entries.par_iter().map(|entry| Look::at(entry, overrides)).collect();
    let which = usize::from(!looks.iter().flatten().all(|look| look.told));
    let key = [Key::BeforeNumber, Key::Letters][which];
    let sheets = sheets(looks.iter().flatten().map(|look| (look.on_sheet, &*look.sheet)));

    let mut met: HashMap<u64, u32> = HashMap::new();
    sheets.iter().for_each(|sheet| *met.entry(key.of(sheet)).or_default() += 1);
    for look in looks.iter().flatten() {
        look.keys[which].iter().collect::<HashSet<_>>().into_iter().for_each(|key| *met.entry(*key).or_default() += 1);
    }
    let alike = |look: &Look| look.keys[which].iter().any(|key| met[key] > 1);
    let suspects = (0..entries.len()).filter(|i| looks[*i].as_ref().is_some_and(alike));

    let line = |((_, i), clash): (&(usize, usize), &String)| {
        let place = entries[*i].place().map_or(String::new(), |place| format!("{place}: "));
        let name = &entries[*i].name;
        format!("{place}scene \"{name}\": expected each file once, {clash}; give one of them another name")
    };
    let lines: Vec<String> = clashes(entries, suspects, &sheets, overrides).iter().map(line).collect();
    if lines.is_empty() { Ok(()) } else { Err(Error::Config(lines.join("\n"))) }
}

/// Where the contact sheet may lie, of the scenes' pictures whether they are on it and where it lies if they come first: beside the
/// first picture that can be begun, on the sheet or not, since those before it may fail. Nowhere if none is on it.
fn sheets<P: Ord>(scenes: impl Iterator<Item = (bool, P)>) -> BTreeSet<P> {
    let (on_sheet, places): (Vec<bool>, BTreeSet<P>) = scenes.unzip();
    if on_sheet.contains(&true) { places } else { BTreeSet::new() }
}

/// For each two of `suspects`, by number, the first file that both would write; twice the same number for one that would
/// write one of the `sheets`.
fn clashes(
    entries: &[BatchEntry],
    suspects: impl Iterator<Item = usize>,
    sheets: &BTreeSet<&Path>,
    overrides: &Overrides,
) -> BTreeMap<(usize, usize), String> {
    let who = |i: usize, frame: Option<i32>| {
        let frame = frame.map_or(String::new(), |frame| format!("frame {frame} of "));
        format!("{frame}scene \"{}\"", entries[i].name)
    };
    let mut first: HashMap<PathBuf, (usize, Option<i32>)> = HashMap::new();
    let mut clashes = BTreeMap::new();
    for i in suspects {
        let entry = &entries[i];
        let Some(pictures) = Pictures::of(entry, overrides) else { continue };
        for frame in pictures.frames() {
            for file in pictures.files(&entry.name, frame, overrides) {
                if sheets.contains(&*file) {
                    let file = file.with_extension("png");
                    let is = if sheets.len() == 1 { "is" } else { "may be" };
                    let clash = format!("{} {is} the contact sheet of the batch", file.display());
                    clashes.entry((i, i)).or_insert(clash);
                }
                if let Some((other, at)) = first.insert(file.clone(), (i, frame)).filter(|(other, _)| *other != i) {
                    let stem = file.file_stem().map(OsStr::to_string_lossy).unwrap_or_default();
                    let is_snapshot = stem.ends_with(checkpoint::SNAPSHOT);
                    let file = if is_snapshot { file.with_extension("png") } else { file };
                    let (file, one, two) = (file.display(), who(other, at), who(i, frame));
                    clashes.entry((other, i)).or_insert_with(|| format!("{file} would be that of {one} and of {two}"));
                }
            }
        }
    }
    clashes
}

/// The contact sheet beside `pictures`, as if it were an EXR.
fn sheet_place(pictures: &Pictures, overrides: &Overrides) -> PathBuf {
    let directory = about_place(&pictures.directory, !pictures.frames.is_empty(), overrides);
    directory.join(names::about(overrides, "contact-sheet", "exr"))
}

/// Refuses a batch whose report or contact sheet would take the place of a file that it reads. Of one scene that is found when
/// it is compiled, before anything is rendered.
///
/// # Errors
/// [`Error::Config`] with the place.
pub(super) fn check_about(entries: &[BatchEntry], overrides: &Overrides) -> Result<()> {
    if entries.len() < 2 {
        return Ok(());
    }
    let Some(first) = entries.iter().find_map(|entry| Pictures::of(entry, overrides)) else { return Ok(()) };
    let files = about_files(&about_place(&first.directory, !first.frames.is_empty(), overrides), overrides);
    if !files.iter().any(|file| file.is_file()) {
        return Ok(());
    }
    let looked = |entry: &BatchEntry| -> Option<(Vec<PathBuf>, Pictures)> {
        let animation = entry.animation(&overrides.set).ok()?;
        let read = [animation.files(), animation.named_files()].concat();
        Some((read, Pictures::seen(&animation, overrides)?))
    };
    let found: Vec<(Vec<PathBuf>, Pictures)> = entries.par_iter().filter_map(looked).collect();
    let sheet = found.iter().any(|(_, pictures)| pictures.sheet);
    let files = if sheet { &files[..] } else { &files[..1] };
    found.iter().try_for_each(|(read, _)| Inputs::of(read).spare(files))
}

/// Refuses a report in the place of a picture, of what is written beside it, or of a file from which scenes are read.
///
/// # Errors
/// [`Error::Config`] with the place.
pub(super) fn check_report(entries: &[BatchEntry], overrides: &Overrides) -> Result<()> {
    let Some(report) = &overrides.report else { return Ok(()) };
    let looked = |entry: &BatchEntry| -> Result<Option<Pictures>> {
        let Ok(animation) = entry.animation(&overrides.set) else { return Ok(None) };
        Inputs::of(animation.files()).spare([report])?;
        Ok(Pictures::seen(&animation, overrides))
    };
    let all: Vec<Option<Pictures>> = entries.par_iter().map(looked).collect::<Result<_>>()?;
    let found = entries.iter().zip(&all).filter_map(|(entry, pictures)| Some((entry, pictures.as_ref()?)));
    for (entry, pictures) in found.clone() {
        for frame in pictures.frames() {
            let file = place(&pictures.directory, &entry.name, frame, overrides);
            spare(report, &file, overrides.portion.is_all(), &names::label(&entry.name, frame))?;
        }
    }
    let sheets = sheets(found.clone().map(|(_, pictures)| (pictures.sheet, sheet_place(pictures, overrides))));
    let several = found.map(|(_, pictures)| pictures.frames().count()).sum::<usize>() > 1;
    let mut files = sheets.iter().flat_map(|sheet| ["png", "html"].map(|ending| sheet.with_extension(ending)));
    match several && files.any(|file| is_place_of(report, &file)) {
        true => Err(taken(report, "the contact sheet")),
        false => Ok(()),
    }
}

/// Refuses a report in the place of the picture at `exr`, or of what is written beside it, which is `whole` or a part.
///
/// # Errors
/// [`Error::Config`] with the place.
pub(super) fn spare(report: &Path, exr: &Path, whole: bool, label: &str) -> Result<()> {
    match files::touched(exr, whole).iter().any(|file| is_place_of(report, file)) {
        true => Err(taken(report, &format!("a file of the picture {label}"))),
        false => Ok(()),
    }
}

fn is_place_of(report: &Path, file: &Path) -> bool {
    output::end(report).is_some_and(|end| Some(end) == output::end(file))
}

fn taken(report: &Path, by: &str) -> Error {
    Error::Config(format!("--report {}: expected a place of its own, found that of {by}", report.display()))
}
