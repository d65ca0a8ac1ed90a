//! `abbe render`.

use super::interrupts::Interrupts;
use super::progress::Teller;
use super::text::columns;
use super::{ProgressStyle, RenderArguments};
use crate::batch;
use crate::batch::report::{Report, SceneReport, Status};
use crate::batch::tev::Viewer;
use crate::batch::words::{per_cent, seconds};
use crate::error::Result;
use crate::film::output::prepare_place;
use std::fmt::Write;
use std::sync::Arc;

/// Renders, and prints a table at the end.
pub fn run(arguments: &RenderArguments) -> Result<i32> {
    let style = if arguments.quiet { ProgressStyle::None } else { arguments.progress };
    let teller = Teller::new(style);
    if let Some(limit) = arguments.memory_limit {
        super::memory_limit::watch(limit)?;
    }
    let interrupts = Interrupts::listen()?;
    let mut scene = arguments.scene.overrides(arguments.output.clone())?;
    arguments.stop.add_to(&mut scene.set);
    let overrides = batch::Overrides {
        report: arguments.report.clone(),
        check_numerics: arguments.check_numerics,
        memory_limit: arguments.memory_limit,
        portion: batch::Portion { tile: arguments.tile, samples: arguments.samples },
        keep: batch::checkpoint::Keep {
            on_stop: true,
            every: Some(arguments.checkpoint_interval).filter(|interval| !interval.is_zero()),
            resume: arguments.resume,
            skip_existing: arguments.skip_existing,
            snapshot: interrupts.snapshot.clone(),
            viewer: arguments.tev.as_deref().map(|place| Arc::new(Viewer::new(place))),
        },
        ..scene
    };
    if let Some(file) = &arguments.report {
        prepare_place(file)?;
    }
    let mut report = batch::render_batch(&arguments.scene.file, &overrides, &teller, &interrupts.stop)
        .inspect_err(|fault| teller.fails(&fault.to_string()))?;
    teller.finish();
    if let Some(gone) = overrides.keep.viewer.as_ref().and_then(|viewer| viewer.close()) {
        super::complain(&format!("warning: {gone}"));
    }
    if let Some(file) = arguments.report.as_ref().filter(|_| report.misplaced.is_none()) {
        report.copy_to(file);
    }
    if !arguments.quiet && style != ProgressStyle::Json {
        super::say(&table(&report));
    }
    if arguments.quiet || style == ProgressStyle::Json {
        for (scene, note) in notes(&report.scenes.iter().collect::<Vec<_>>()) {
            super::complain(&format!("note: {}: {note}", scene.label()));
        }
    }
    let failures = report.scenes.iter().filter_map(|scene| match &scene.status {
        Status::Failed { message, .. } => Some((scene, message)),
        Status::Done | Status::Skipped => None,
    });
    // What is wrong with every frame of a scene is told once.
    let mut told: Option<(&str, &str)> = None;
    for (scene, message) in failures {
        if told.replace((&scene.name, message)) == Some((&scene.name, message)) {
            continue;
        }
        for line in message.lines() {
            super::complain(&format!("error: {}: {line}", scene.label()));
        }
    }
    let there = report.scenes.iter().filter(|s| matches!(s.status, Status::Skipped)).count();
    if there > 0 && !arguments.quiet && style != ProgressStyle::Json {
        super::say(&format!("{there} of {} were there already\n", report.scenes.len()));
    }
    for line in endings(&report.scenes) {
        super::complain(&format!("error: {line}"));
    }
    for e in report.unwritten.iter().chain(&report.misplaced) {
        super::complain(&super::prefixed(e));
    }
    Ok(report.exit_code())
}

/// How many pictures of several did not end as they should: those that failed, those that are written all the same, and those
/// that were stopped.
fn endings(scenes: &[SceneReport]) -> Vec<String> {
    let all = scenes.len();
    if all < 2 {
        return Vec::new();
    }
    let what = if scenes.iter().any(|s| s.frame.is_some()) { "pictures" } else { "scenes" };
    let count = |holds: &dyn Fn(&SceneReport) -> bool| scenes.iter().filter(|s| holds(s)).count();
    let stopped = count(&|s| s.is_stopped());
    let faulty = count(&|s| s.is_written_with_a_fault());
    let failed = count(&|s| matches!(s.status, Status::Failed { .. })) - stopped - faulty;
    let mut lines = Vec::new();
    if failed > 0 {
        let rest = if stopped == 0 && failed < all { "; the others are written" } else { "" };
        lines.push(format!("{failed} of {all} {what} failed{rest}"));
    }
    if faulty > 0 {
        lines.push(format!("{faulty} of {all} {what} written short of a target or with invalid samples"));
    }
    if stopped > 0 {
        // Of those that were not begun nobody knows how many pictures they are.
        let written = all - stopped - failed;
        lines.push(format!("stopped: {what} written so far: {written}; --resume goes on with the others"));
    }
    lines
}

/// Two shares, with the sign once.
fn per_cent_interval([low, high]: [f64; 2]) -> String {
    format!("{}-{}", per_cent(low).replace(" %", ""), per_cent(high))
}

/// Two shares in brackets; nothing where they read alike.
pub fn per_cent_between(between: [f64; 2]) -> String {
    let [low, high] = between.map(per_cent);
    if low == high { String::new() } else { format!(" ({})", per_cent_interval(between)) }
}

/// Two times in brackets; nothing where they read alike.
pub fn seconds_between([low, high]: [f64; 2]) -> String {
    let ends = [seconds(low), seconds(high)];
    match ends {
        [a, b] if a == b => String::new(),
        [_, end] if low <= 0.0 => format!(" (up to {end})"),
        [a, b] => format!(" ({a} to {b})"),
    }
}

/// A number, and its share of `all`.
fn with_share(part: u64, all: u64) -> String {
    let share = part as f64 / all.max(1) as f64;
    if share < 1e-3 {
        format!("{part} ({:.1} in a million)", share * 1e6)
    } else {
        format!("{part} ({})", per_cent(share))
    }
}

/// Pictures, each with the frame of its scene that comes before it, if one does.
fn with_frame_before<'a>(
    scenes: &[&'a SceneReport],
) -> impl Iterator<Item = (&'a SceneReport, Option<&'a SceneReport>)> {
    scenes
        .iter()
        .enumerate()
        .map(|(i, s)| (*s, i.checked_sub(1).map(|i| scenes[i]).filter(|before| before.name == s.name)))
}

/// The notes of pictures. What is to be known of every frame of a scene is told once.
fn notes<'a>(scenes: &[&'a SceneReport]) -> Vec<(&'a SceneReport, &'a String)> {
    let of = |(s, before): (&'a SceneReport, Option<&'a SceneReport>)| {
        let known = move |note: &&String| before.is_some_and(|before| before.notes.contains(note));
        s.notes.iter().filter(move |note| !known(note)).map(move |note| (s, note))
    };
    with_frame_before(scenes).flat_map(of).collect()
}

/// The columns of the table, in order.
const HEADINGS: [&str; 7] = ["scene", "samples", "time", "Msamples/s", "error (95 %)", "half the error", "invalid"];

fn row(s: &SceneReport) -> [String; 7] {
    let error = match (&s.error, s.integrator.as_str()) {
        (Some(e), _) => {
            let interval = per_cent_interval([e.low, e.high]);
            format!("{} ({})", per_cent(e.rel_rmse), if e.valid { &interval } else { "not converged" })
        }
        (None, "whitted") => "no noise".into(),
        (None, _) => "unknown".into(),
    };
    let half = s.halving_seconds.map_or("-".into(), |t| format!("+{}", seconds(t)));
    [
        s.label(),
        // Of those that are shared out `samples` is the number for which that is done.
        s.adaptive.as_ref().map_or(s.samples.to_string(), |counts| format!("mean {:.1}", counts.mean)),
        seconds(s.seconds.rendering),
        format!("{:.2}", s.msamples_per_second),
        error,
        half,
        s.invalid.total().to_string(),
    ]
}

/// The table at the end: what was rendered, what it cost, how good it is, where it is.
pub fn table(report: &Report) -> String {
    let is_written = |s: &&SceneReport| matches!(s.status, Status::Done) || s.is_written_with_a_fault();
    let done: Vec<&SceneReport> = report.scenes.iter().filter(is_written).collect();
    let mut out = String::new();
    if done.is_empty() {
        return out;
    }
    let mut rows = vec![HEADINGS.map(String::from)];
    rows.extend(done.iter().map(|s| row(s)));
    out += &columns(&rows, 1);
    for (s, note) in notes(&done) {
        let _ = writeln!(out, "note: {}: {note}", s.label());
    }
    for s in &done {
        if let Some(png) = s.png.filter(|png| png.metered || png.white.is_some()) {
            let metered = if png.metered { ", metered" } else { "" };
            let white =
                png.white.map_or(String::new(), |[x, y]| format!("; light of x {x:.4}, y {y:.4} is shown white"));
            let _ = writeln!(out, "PNG: {}: exposure {:+} stops{metered}{white}", s.label(), png.exposure_stops);
        }
    }
    for s in &done {
        if let Some(n) = &s.numerics {
            let _ = writeln!(
                out,
                "numerics: {}: of {} surfaces met textbook f32 misses {}; of {} rays that left one it meets the same again with {}",
                s.label(),
                n.surfaces,
                with_share(n.robust, n.surfaces),
                n.rays,
                with_share(n.self_hits, n.rays)
            );
        }
    }
    let foretold = done.iter().filter_map(|s| Some((s, s.forecast?, s.error?)));
    for (i, (s, f, e)) in foretold.enumerate() {
        if i == 0 {
            let _ = writeln!(out, "\nforetold at a quarter of the samples (95 %), and how it came:");
        }
        let _ = writeln!(
            out,
            "  {}: {}{} and {}{} at {:.0} samples; {} and {} at {}",
            s.label(),
            seconds(f.seconds),
            seconds_between(f.seconds_between),
            per_cent(f.error),
            per_cent_between(f.error_between),
            f.samples,
            seconds(s.seconds.rendering),
            per_cent(e.rel_rmse),
            s.samples
        );
    }
    let _ = writeln!(out, "\neffects in force:");
    for (s, before) in with_frame_before(&done) {
        let effects = s.effects_in_force();
        if before.is_none_or(|before| before.effects_in_force() != effects) {
            let _ = writeln!(out, "  {}: {}", s.label(), effects.join(", "));
        }
    }
    let mut dirs: Vec<String> =
        done.iter().flat_map(|s| &s.files).filter_map(|f| f.parent()).map(|d| d.display().to_string()).collect();
    dirs.dedup();
    dirs.iter_mut().filter(|d| d.is_empty()).for_each(|d| *d = ".".into());
    let files: usize = done.iter().map(|s| s.files.len()).sum();
    let _ = writeln!(
        out,
        "\n{files} {} in {}/ after {} on {} threads{}{}",
        if files == 1 { "file" } else { "files" },
        dirs.join("/, "),
        seconds(report.seconds),
        report.threads,
        report.peak_memory.map_or(String::new(), |bytes| format!(", {} MiB at the most", bytes.div_ceil(1 << 20))),
        report.file.as_ref().map_or(String::new(), |f| format!("; figures in {}", f.display()))
    );
    if let Some(page) = &report.contact_sheet {
        let _ = writeln!(out, "all of them side by side: {}", page.display());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::report::SampleCounts;
    use crate::error::Error;

    /// A picture that ended with `error`.
    fn ended(error: Option<Error>, written: bool) -> SceneReport {
        let mut report = SceneReport::new("a", None);
        if let Some(error) = error {
            report.fail(&error);
        }
        report.files.extend(written.then(|| "a.exr".into()));
        report
    }

    /// A note that a frame has and the one before it has not is told again, and so is that of another scene.
    #[test]
    fn what_is_known_of_every_frame_is_told_once() {
        let frame = |name: &str, number: i32, notes: &[&str]| {
            let notes = notes.iter().map(|note| (*note).to_owned()).collect();
            SceneReport { notes, ..SceneReport::new(name, Some(number)) }
        };
        let frames = [
            frame("a", 1, &["dark"]),
            frame("a", 2, &["dark", "cold"]),
            frame("a", 3, &["cold"]),
            frame("a", 4, &["dark"]),
            frame("b", 4, &["dark"]),
        ];
        let told: Vec<String> =
            notes(&frames.iter().collect::<Vec<_>>()).iter().map(|(s, note)| format!("{} {note}", s.label())).collect();
        assert_eq!(told, ["a.0001 dark", "a.0002 cold", "a.0004 dark", "b.0004 dark"]);
    }

    #[test]
    fn samples_that_are_shared_out_are_told_by_their_mean() {
        let adaptive = Some(SampleCounts { least: 32, mean: 84.0, most: 512 });
        assert_eq!(row(&SceneReport { samples: 72, adaptive, ..SceneReport::new("a", None) })[1], "mean 84.0");
        assert_eq!(row(&SceneReport { samples: 72, ..SceneReport::new("a", None) })[1], "72");
    }

    #[test]
    fn what_failed_what_was_stopped_and_what_is_written_all_the_same_are_told_apart() {
        let done = || ended(None, true);
        let bad = || ended(Some(Error::Config("x".into())), false);
        let stopped = || ended(Some(Error::Stopped("x".into())), false);
        let missed = || ended(Some(Error::Render("x".into())), true);
        assert_eq!(endings(&[bad()]), [""; 0]);
        assert_eq!(endings(&[done(), done()]), [""; 0]);
        assert_eq!(endings(&[done(), bad()]), ["1 of 2 scenes failed; the others are written"]);
        assert_eq!(
            endings(&[done(), stopped(), stopped()]),
            ["stopped: scenes written so far: 1; --resume goes on with the others"]
        );
        let short = "1 of 3 scenes written short of a target or with invalid samples";
        assert_eq!(endings(&[done(), missed(), done()]), [short]);
        assert_eq!(endings(&[missed(), bad(), done()]), ["1 of 3 scenes failed; the others are written", short]);
        assert_eq!(
            endings(&[bad(), missed(), stopped()]),
            ["1 of 3 scenes failed", short, "stopped: scenes written so far: 1; --resume goes on with the others"]
        );
        // Without its picture it failed.
        assert_eq!(endings(&[ended(Some(Error::Render("x".into())), false), bad()]), ["2 of 2 scenes failed"]);
    }
}
