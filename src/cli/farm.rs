//! `abbe farm`.

use super::{FarmArguments, FarmFormat};
use crate::batch::farm::{Cut, Job, openjd, slurm};
use crate::batch::{Overrides, names};
use crate::error::{Error, Result};
use crate::film::output::{Inputs, prepare_place, write_atomically};
use std::path::Path;

/// Writes the bundle, and says how to start it.
pub fn run(arguments: &FarmArguments) -> Result<i32> {
    let cut =
        Cut { tiles: arguments.tiles, ranges: arguments.sample_ranges, frames: arguments.frames_per_task as usize };
    let overrides = arguments.scene.overrides(arguments.pictures.clone())?;
    let bundle = std::path::absolute(&arguments.output).map_err(|e| Error::output(&arguments.output, e))?;
    let pictures = match &arguments.pictures {
        Some(pictures) => std::path::absolute(pictures).map_err(|e| Error::output(pictures, e))?,
        None => bundle.join("pictures"),
    };
    let job = Job {
        pictures,
        program: program(&arguments.program)?,
        arguments: further(arguments, &overrides)?,
        threads: arguments.threads,
        ..Job::of(&arguments.scene.file, &overrides, cut)?
    };
    check_pictures(arguments, &job)?;
    let read = if arguments.format == FarmFormat::Openjd { &job.files[..] } else { &[] };
    for path in [&job.source, &job.pictures, &bundle].into_iter().chain(read) {
        in_words(path)?;
    }
    let files = match arguments.format {
        FarmFormat::Openjd => openjd::files(&job)?,
        FarmFormat::Slurm => slurm::files(&job),
    };
    Inputs::of(&job.files).spare(files.iter().map(|file| bundle.join(file.name)))?;
    for file in &files {
        let path = bundle.join(file.name);
        prepare_place(&path)?;
        write_atomically(&path, file.text.as_bytes())?;
        #[cfg(unix)]
        if file.executable {
            use std::os::unix::fs::PermissionsExt;
            let read = path.metadata().map_err(|e| Error::output(&path, e))?.permissions().mode();
            // By whom it may be read.
            let run = std::fs::Permissions::from_mode(read | (read & 0o444) >> 2);
            std::fs::set_permissions(&path, run).map_err(|e| Error::output(&path, e))?;
        }
    }
    let shown = |before: &str, name: &str| shell(&format!("{before}{}{name}", bundle.display()));
    let start = match arguments.format {
        // All of its steps, each after those that it depends on.
        FarmFormat::Openjd => format!(
            "openjd run {} -p {}\ndeadline bundle submit {}\n",
            shown("", "/template.yaml"),
            shown("file://", "/parameters.json"),
            shown("", "")
        ),
        FarmFormat::Slurm => shown("", "/submit.sh") + "\n",
    };
    if !arguments.quiet {
        let pictures = match job.count() {
            1 => "1 picture".into(),
            count => format!("{count} pictures"),
        };
        super::say(&format!("{pictures}; start with\n{start}"));
    }
    Ok(0)
}

/// Refuses a place that means another one to a task, which takes it for a pattern. `--pictures` may be one, if no parts are
/// looked for there.
fn check_pictures(arguments: &FarmArguments, job: &Job) -> Result<()> {
    let refuse = |what: &str, path: &Path, mark: &str| {
        let path = path.display();
        Err(Error::Config(format!("{what} {path}: expected a place of plain text, found {mark}, which is a pattern")))
    };
    let mark = |path: &Path| names::mark(&path.to_string_lossy(), job.has_frames()).map(str::to_owned);
    let (what, written) = match &arguments.pictures {
        // One that is rendered again may be an EXR file.
        Some(pictures) if pictures.is_file() && pictures.extension().is_none_or(|e| !e.eq_ignore_ascii_case("exr")) => {
            return Err(Error::Config(format!(
                "--pictures {}: expected a directory, found a file",
                pictures.display()
            )));
        }
        Some(pictures) => ("--pictures", pictures),
        // In the directory of the job.
        None => ("-o", &arguments.output),
    };
    if let (true, Some(mark)) = (job.cut.parts() || arguments.pictures.is_none(), mark(written)) {
        return refuse(what, written, &mark);
    }
    match &arguments.pictures {
        Some(pictures) => job.check_place(what, pictures)?,
        None => names::check(written).map_err(|e| Error::Config(format!("{what} {}: {e}", written.display())))?,
    }
    let here = std::env::current_dir().ok().filter(|_| written.is_relative());
    match here.and_then(|here| Some((mark(&here)?, here))) {
        Some((mark, here)) => refuse("the working directory", &here, &mark),
        None => Ok(()),
    }
}

/// The program as a task, which runs in another directory, finds it. A name alone is looked for on the path of each machine.
fn program(written: &str) -> Result<String> {
    if !written.contains(std::path::is_separator) {
        return Ok(written.to_owned());
    }
    let path = std::path::absolute(written).map_err(|e| Error::input(Path::new(written), e.to_string()))?;
    Ok(in_words(&path)?.to_owned())
}

/// A path as the files of a bundle, which are text, say it.
fn in_words(path: &Path) -> Result<&str> {
    let fault = || Error::Config(format!("{}: expected a path in UTF-8, found other bytes", path.display()));
    path.to_str().ok_or_else(fault)
}

/// A word as a person may paste it into a shell, in quotes where it needs them.
pub(super) fn shell(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+:,@%=".contains(c);
    if !text.is_empty() && text.chars().all(plain) { text.to_owned() } else { slurm::word(text) }
}

/// What every task is told besides its part of the work, in the words of one that runs in another directory.
fn further(arguments: &FarmArguments, overrides: &Overrides) -> Result<Vec<String>> {
    let scene = &arguments.scene;
    let set = scene.set.iter().map(|(key, value)| ["--set".to_owned(), format!("{key}={value}")]);
    let define = scene.define.iter().map(|(name, value)| ["-D".to_owned(), format!("{name}={value}")]);
    let mut all: Vec<String> = set.chain(define).flatten().collect();
    if !scene.set.is_empty() {
        let from = scene.set_from.as_deref().unwrap_or(Path::new("."));
        let from = std::path::absolute(from).map_err(|e| Error::input(from, e.to_string()))?;
        all.extend(["--set-from".to_owned(), in_words(&from)?.to_owned()]);
    }
    let numbers = [("--spp", scene.spp.map(u64::from)), ("--seed", scene.seed)];
    all.extend(numbers.into_iter().filter_map(|(name, value)| Some([name.to_owned(), value?.to_string()])).flatten());
    let rules = overrides.paths.written().map_err(Error::Config)?;
    all.extend(rules.into_iter().flat_map(|rule| ["--path-map".to_owned(), rule]));
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_shell_would_take_apart_is_quoted() {
        assert_eq!(shell("file:///a_b/1.json"), "file:///a_b/1.json");
        assert_eq!(shell("/my jobs/it's"), "'/my jobs/it'\\''s'");
        assert_eq!(shell("/$(x)"), "'/$(x)'");
        assert_eq!(shell(""), "''");
    }
}
