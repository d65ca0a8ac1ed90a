//! Parts to a picture: the pixels of the one-process render, bit for bit, or a word on what is wrong.
//!
//! All headers are read first: parts of other pictures, gaps and overlaps are told before any sum is read. Then all
//! are read in parallel and added row by row: tiles into films of their own first, whole pictures one at a time. Memory grows with
//! the threads, not with the parts.

use super::checks;
use super::clashes;
use super::files;
use super::finish::Finish;
use super::frame::{Frame, lock};
use super::names;
use super::part_file::{self, Header, Written};
use super::report::{Report, SceneReport};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::output;
use crate::scene::watch::Counts;
use rayon::prelude::*;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// The files of `paths`; of a directory all whose names end in `.exr`, in their order.
///
/// # Errors
/// [`Error::Input`] for a directory that cannot be read or holds none.
pub fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in paths {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).map_err(|e| Error::input(path, e.to_string()))?;
        let mut own: Vec<PathBuf> =
            entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| super::ends_in(p, &["exr"])).collect();
        if own.is_empty() {
            return Err(Error::input(path, "expected parts, found no file whose name ends in .exr"));
        }
        own.sort();
        all.append(&mut own);
    }
    Ok(all)
}

/// Adds up the parts at `paths` and writes the picture at `out`, a file name or a directory, with its report beside it.
///
/// # Errors
/// [`Error::Input`] if a part is missing, damaged or of another picture, or if they do not make up the picture exactly
/// once; [`Error::Config`] for a place that is that of a part or not one for pictures, and where a further `report` would take
/// the picture's; [`Error::Output`]; [`Error::Memory`] if there is too little; [`Error::Render`] as the render itself.
pub fn merge(paths: &[PathBuf], out: &Path, report: Option<&Path>) -> Result<(Report, Result<()>)> {
    checks::output_place("-o", Some(out), 1)?;
    let start = Instant::now();
    let mut opened: Vec<(PathBuf, Result<Written>)> =
        files(paths)?.into_par_iter().map(|path| (path.clone(), part_file::open(&path))).collect();
    let out = opened.iter().find_map(|(_, part)| Some(picture(out, &part.as_ref().ok()?.header.finish)));
    let out = out.unwrap_or_default();
    // What an earlier merge has written among its parts is none.
    let earlier: Vec<PathBuf> = files::places(&out).into_iter().filter_map(|place| place.canonicalize().ok()).collect();
    let is_earlier =
        |path: &PathBuf| path.canonicalize().is_ok_and(|path| earlier.contains(&path)) && !paths.contains(path);
    opened.retain(|(path, part)| part.is_ok() || !is_earlier(path));
    let parts: Vec<Written> = opened.into_iter().map(|(_, part)| part).collect::<Result<_>>()?;
    let Some(first) = parts.first() else {
        return Err(Error::Config("expected parts to merge, found none".into()));
    };
    for part in &parts[1..] {
        part.header.check_like(&part.path, &first.header)?;
    }
    let finish = &first.header.finish;
    output::Inputs::of(parts.iter().map(|part| &part.path)).spare(files::places(&out))?;
    if let Some(report) = report {
        clashes::spare(report, &out, true, &names::label(&finish.name, finish.frame_number))?;
    }
    check_cover(&parts, &out)?;
    output::prepare_place(&out)?;
    output::prepare_place(&out.with_extension("png"))?;

    let sums = Mutex::new(first.empty(finish.window)?);
    parts.par_iter().try_for_each(|part| {
        let share = part.header.share().rows(finish.window);
        // Few rows are unpacked into sums of their own, beside others.
        if share.height < finish.window.height && part.header.paths.is_none() {
            let (mut film, _) = part.empty(share)?;
            part.add_to(&mut film, None)?;
            return lock(&sums).0.merge(&film);
        }
        let (film, splats) = &mut *lock(&sums);
        part.add_to(film, splats.as_mut())
    })?;
    let (film, splats) = sums.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);

    let seconds: f64 = parts.iter().map(|part| part.header.seconds).sum();
    let elapsed = Duration::try_from_secs_f64(seconds).unwrap_or_default();
    let frame = Frame::of(film, splats, finish.samples, elapsed, &finish.gauge());
    let mut scene = SceneReport::new(&finish.name, finish.frame_number);
    scene.describe(finish, start.elapsed());
    scene.measure(finish, &frame, sum(parts.iter().filter_map(|part| part.header.numerics)));
    let written = files::write(finish, &frame, Ok(()), &out, &mut scene);
    if let Err(e) = &written {
        scene.fail(e);
    }
    let mut report = Report::new(&first.header.source, vec![scene], start.elapsed());
    // Many pictures may be merged into one directory.
    let picture = out.file_stem().unwrap_or_default().to_string_lossy();
    report.write(&out.with_file_name(format!("report.{picture}.json")));
    Ok((report, written))
}

/// The file at or in `out` of the picture that `finish` is of.
fn picture(out: &Path, finish: &Finish) -> PathBuf {
    let filled = names::fill(out, &finish.name, finish.frame_number);
    match super::ends_in(out, &["exr"]) {
        true => filled,
        false => filled.join(format!("{}.exr", names::label(&finish.name, finish.frame_number))),
    }
}

/// What several counted of robust arithmetic, if any did.
#[must_use]
pub fn sum(counts: impl IntoIterator<Item = Counts>) -> Option<Counts> {
    counts.into_iter().reduce(|a, b| Counts {
        surfaces: a.surfaces.saturating_add(b.surfaces),
        robust: a.robust.saturating_add(b.robust),
        rays: a.rays.saturating_add(b.rays),
        self_hits: a.self_hits.saturating_add(b.self_hits),
    })
}

/// Samples of things in a row: those from `things.start` to `things.end`, of the part `part`.
struct Claim {
    part: usize,
    things: Vec<Range<usize>>,
    samples: Range<u32>,
}

/// What is wrong with claims that should have every sample of every thing once.
enum Fault {
    /// These samples of what a claim has are there twice.
    Twice(usize, Range<u32>),
    /// These samples of a thing are in none.
    Missing(usize, Range<u32>),
    /// There is no memory to count them.
    NoMemory,
}

/// Checks that `claims` have the samples below `samples` of all things below `things` exactly once: in the order of their
/// first samples each must begin where the things are.
fn cover(mut claims: Vec<Claim>, things: usize, samples: u32) -> std::result::Result<(), Fault> {
    claims.sort_by_key(|claim| claim.samples.start);
    let mut done = Vec::new();
    if done.try_reserve_exact(things).is_err() {
        return Err(Fault::NoMemory);
    }
    done.resize(things, 0u32);
    for claim in claims.iter().filter(|claim| !claim.samples.is_empty()) {
        for thing in claim.things.iter().cloned().flatten() {
            let Range { start, end } = claim.samples;
            if done[thing] > start {
                return Err(Fault::Twice(claim.part, start..done[thing].min(end)));
            }
            if done[thing] < start {
                return Err(Fault::Missing(thing, done[thing]..start));
            }
            done[thing] = end;
        }
    }
    match done.iter().position(|done| *done < samples) {
        Some(thing) => Err(Fault::Missing(thing, done[thing]..samples)),
        None => Ok(()),
    }
}

/// Samples as people count them, the last one included.
fn words(samples: &Range<u32>) -> String {
    if samples.len() == 1 {
        format!("sample {}", samples.start)
    } else {
        format!("samples {}-{}", samples.start, samples.end - 1)
    }
}

/// Checks that the parts have every sample of every pixel and of every path from the lights exactly once.
fn check_cover(parts: &[Written], out: &Path) -> Result<()> {
    let Header { finish, paths, .. } = &parts[0].header;
    let window = finish.window;
    let twice = |part: usize, samples: &Range<u32>, of: &dyn Fn(&Written) -> bool| {
        let other = parts.iter().enumerate().find(|(i, other)| *i != part && of(other));
        let other = other.map_or("it".into(), |(_, other)| other.path.display().to_string());
        Error::input(&parts[part].path, format!("overlap: {other} has {} of the same rows, too", words(samples)))
    };
    let incomplete = |what: String| Error::input(out, format!("cannot be merged from {} parts: {what}", parts.len()));
    let no_memory =
        || Error::Memory(format!("{}: the parts of {window} take more memory than there is", out.display()));

    let mut claims = Vec::new();
    for (part, written) in parts.iter().enumerate() {
        for (tile, samples) in &written.header.claims.camera {
            let rows = tile.y..tile.y + tile.height as i32;
            let things = rows.filter_map(|y| window.index([tile.x, y])).map(|at| at..at + tile.width as usize);
            claims.push(Claim { part, things: things.collect(), samples: samples.clone() });
        }
    }
    let meets = |a: &Range<u32>, b: &Range<u32>| a.start < b.end && b.start < a.end;
    let row_of = |thing: usize| window.y + (thing / window.width as usize) as i32;
    cover(claims, window.pixels(), finish.samples).map_err(|fault| match fault {
        Fault::Twice(part, samples) => {
            let own = parts[part].header.share().rows(window);
            let same =
                |other: &Written| other.header.claims.camera.iter().any(|(w, s)| meets(s, &samples) && touch(w, &own));
            twice(part, &samples, &same)
        }
        Fault::Missing(thing, samples) => {
            let at = row_of(thing);
            incomplete(format!(
                "{} of row {at} are missing: expected samples 0-{}",
                words(&samples),
                finish.samples - 1
            ))
        }
        Fault::NoMemory => no_memory(),
    })?;

    // Paths from the lights, in pieces between which nobody cuts.
    let Some(paths) = *paths else { return Ok(()) };
    let lights = || parts.iter().enumerate().flat_map(|(i, p)| p.header.claims.lights.iter().map(move |c| (i, c)));
    let mut cuts: Vec<u64> = lights().flat_map(|(_, (p, _))| [p.start, p.end]).chain([0, paths]).collect();
    cuts.sort_unstable();
    cuts.dedup();
    let piece = |path: u64| cuts.partition_point(|cut| *cut < path);
    let claim = |(part, (p, samples)): (usize, &(Range<u64>, Range<u32>))| {
        let things = piece(p.start)..piece(p.end);
        Claim { part, things: vec![things], samples: samples.clone() }
    };
    cover(lights().map(claim).collect(), cuts.len() - 1, finish.samples).map_err(|fault| match fault {
        Fault::Twice(part, samples) => {
            twice(part, &samples, &|other| other.header.claims.lights.iter().any(|(_, s)| meets(s, &samples)))
        }
        Fault::Missing(thing, samples) => incomplete(format!(
            "{} of the paths {}-{} from the lights are missing",
            words(&samples),
            cuts[thing],
            cuts[thing + 1] - 1
        )),
        Fault::NoMemory => no_memory(),
    })
}

/// Whether two windows have rows in common.
fn touch(a: &Window, b: &Window) -> bool {
    a.y < b.y + b.height as i32 && b.y < a.y + a.height as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(things: Range<usize>, samples: Range<u32>) -> Claim {
        Claim { part: things.start, things: vec![things], samples }
    }

    #[test]
    fn claims_must_have_everything_once() {
        let parts = || vec![claim(5..9, 0..4), claim(0..5, 2..8), claim(5..9, 4..8), claim(0..5, 0..2)];
        assert!(cover(parts(), 9, 8).is_ok());
        for left_out in 0..4 {
            let mut some = parts();
            some.remove(left_out);
            assert!(matches!(cover(some, 9, 8), Err(Fault::Missing(..))), "{left_out}");
        }
        for thing in [0, 4, 8] {
            let mut more = parts();
            more.push(claim(thing..thing + 1, 7..8));
            assert!(matches!(cover(more, 9, 8), Err(Fault::Twice(_, samples)) if samples == (7..8)), "{thing}");
        }
        assert!(matches!(cover(parts(), 10, 8), Err(Fault::Missing(9, _))));
    }

    /// It was told as if samples were missing.
    #[test]
    fn more_things_than_memory_can_count_are_no_fault_of_the_parts() {
        assert!(matches!(cover(Vec::new(), usize::MAX, 8), Err(Fault::NoMemory)));
    }
}
