//! The same work by another build of Abbe: with other features, or for another processor.
//!
//! It is asked for all samples of the small copy as a part ([`part_file`]), whose sums have the replicates that noise and
//! bias are told from, and the time that rendering took. A part of another format is refused.

use super::desk::{Outcome, Pass};
use super::figures::Reference;
use crate::batch::part::SplatFilm;
use crate::batch::{Overrides, frame, part_file};
use crate::error::{Error, Result};
use crate::film::resolve;
use crate::spectrum::ColourSpace;
use std::path::Path;
use std::process::Command;

/// Another build.
#[derive(Clone, Copy, Debug)]
pub struct Beside<'a> {
    /// Its executable.
    pub binary: &'a Path,
    /// The file that holds the scene.
    pub file: &'a Path,
}

impl Beside<'_> {
    /// Whether there is such a program: asked before hours are spent.
    ///
    /// # Errors
    /// [`Error::Config`].
    pub fn check(&self) -> Result<()> {
        let found = match Command::new(self.binary).arg("--version").output() {
            Ok(said) if said.stdout.starts_with(b"abbe ") => return Ok(()),
            Ok(_) => "another program".to_owned(),
            Err(e) => e.to_string(),
        };
        Err(Error::Config(format!("--beside: expected a build of Abbe, found {}: {found}", self.binary.display())))
    }

    /// Renders `scene` with the settings of `overrides` and then `set`.
    ///
    /// # Errors
    /// [`Error::Render`] with what the other build said; [`Error::Input`] where its part is of another format.
    pub fn render(
        &self,
        scene: &str,
        overrides: &Overrides,
        set: &[(String, String)],
        reference: Option<&Reference>,
    ) -> Result<Outcome> {
        let place = std::env::temp_dir().join(format!("abbe-beside-{}", std::process::id()));
        std::fs::create_dir_all(&place).map_err(|e| Error::output(&place, e))?;
        let part = place.join("part.exr");
        let mut command = Command::new(self.binary);
        command.arg("render").arg(self.file).arg(format!("--scene={scene}"));
        // A part of all rows: adaptive sampling has no ranges of samples.
        command.args(["--tile", "0/1", "-q", "-o"]).arg(&part);
        command.args(["--threads", &rayon::current_num_threads().to_string()]);
        for (key, value) in overrides.set.iter().chain(set) {
            command.arg("--set").arg(format!("{key}={value}"));
        }
        for (name, value) in &overrides.define {
            command.arg("-D").arg(format!("{name}={value}"));
        }
        command.arg("--set-from").arg(overrides.paths.starts());
        for rule in overrides.paths.written().map_err(Error::Config)? {
            command.arg("--path-map").arg(rule);
        }
        let failed = |why: &str| Error::Render(format!("{}: {}", self.binary.display(), why.trim()));
        let done = command.output().map_err(|e| failed(&e.to_string()))?;
        let outcome = match done.status.success() {
            true => read(&part, reference),
            false => Err(failed(&String::from_utf8_lossy(&done.stderr))),
        };
        // What cannot be removed is left to the system, whose place it is.
        let _ = std::fs::remove_dir_all(place);
        outcome
    }
}

fn read(part: &Path, reference: Option<&Reference>) -> Result<Outcome> {
    let written = part_file::open_of_any_build(part)?;
    let (mut film, mut splats) = written.empty(written.header.finish.window)?;
    written.add_to(&mut film, splats.as_mut())?;
    let space = ColourSpace::Rec709.matrix_from_xyz();
    let lights = || splats.as_ref().map(SplatFilm::splats);
    let replicates = resolve::replicates(&film, lights(), &space);
    let noise = reference.map_or(Vec::new(), |reference| reference.noise_of(&replicates));
    let image = resolve::resolve(&film, lights(), &space);
    let finish = &written.header.finish;
    let converged = frame::converged(&film, splats.as_ref(), &space, &image, &finish.gauge());
    let passes = vec![Pass { samples: finish.samples, seconds: written.header.seconds, noise, converged }];
    Ok(Outcome { image, replicates, passes })
}
