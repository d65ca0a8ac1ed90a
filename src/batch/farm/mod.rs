//! Jobs for engines that farms have: what the tasks of a batch are, written down for one of them. There is no scheduler here.
//!
//! A task renders some frames of a scene, and where pictures are cut, one part of each; tasks know nothing of each other. A
//! part of frame 12 of `prism` is in `parts/prism/12`, whatever task made it, and a task for each picture adds them up,
//! which verifies that all are there. Every task may be run again at any time: it goes on where it was stopped, and what is
//! finished it leaves alone.

pub mod openjd;
pub mod slurm;

use super::adaptive::SIDE;
use super::part::bands;
use super::prepare::{check_stop, spare_whitted};
use super::{Overrides, checks, clashes, ends_in, entries, names, prepare, window};
use crate::description::{self, SceneDescription};
use crate::error::{Error, Result};
use crate::scene::compile;
use crate::scene::shelf::Shelf;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A task has a share of the pictures: a sheet of those alone would stand in the place of another task's.
const NO_SHEET: [&str; 2] = ["--set", "output.contact_sheet=false"];

/// How pictures and frames are shared out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Bands of rows of a picture.
    pub tiles: u32,
    /// Ranges of its samples.
    pub ranges: u32,
    /// Frames in a row that one task renders.
    pub frames: usize,
}

impl Cut {
    /// Whether pictures are cut, and parts are to be added up.
    #[must_use]
    pub fn parts(&self) -> bool {
        self.tiles > 1 || self.ranges > 1
    }

    /// The arguments of each part of a picture: values of `--tile` and `--samples`.
    pub fn each(&self) -> impl Iterator<Item = [String; 2]> + use<> {
        let Cut { tiles, ranges, .. } = *self;
        (0..tiles).flat_map(move |t| (0..ranges).map(move |r| [format!("{t}/{tiles}"), format!("{r}/{ranges}")]))
    }
}

/// Scenes of which the same frames are rendered; none where they are one picture each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Their names.
    pub scenes: Vec<String>,
    /// Their frames.
    pub frames: Vec<i32>,
}

/// All that is to be done.
#[derive(Clone, Debug)]
pub struct Job {
    /// What it is called.
    pub name: String,
    /// The batch or scene file.
    pub source: PathBuf,
    /// Where the pictures go.
    pub pictures: PathBuf,
    /// The program.
    pub program: String,
    /// Further arguments of `render`.
    pub arguments: Vec<String>,
    /// What is rendered.
    pub groups: Vec<Group>,
    /// How it is shared out.
    pub cut: Cut,
    /// Threads of a task; 0 for what the engine grants.
    pub threads: usize,
    /// The files that it reads.
    pub files: Vec<PathBuf>,
}

/// A file of a bundle.
#[derive(Clone, Debug)]
pub struct BundleFile {
    /// Its name.
    pub name: &'static str,
    /// What it says.
    pub text: String,
    /// Whether it is a program.
    pub executable: bool,
}

impl Job {
    /// Reads each scene at its first frame, at all where pictures are cut, and finds what there is to do.
    ///
    /// # Errors
    /// [`Error::Config`] and [`Error::Input`] with the faults of all scenes, or for a cut that one of them does not have.
    pub fn of(source: &Path, overrides: &Overrides, cut: Cut) -> Result<Job> {
        if crate::input::is_of_this_process(source) {
            return Err(Error::input(source, "expected a file that tasks can read, found one of this process alone"));
        }
        let mut groups: Vec<Group> = Vec::new();
        let mut files = BTreeSet::from([source.to_path_buf()]);
        let mut shelf = Shelf::default();
        let mut faults: Vec<Error> = Vec::new();
        let entries = entries(source, overrides)?;
        // A task knows only its own scenes, and where they go.
        let place = overrides.output.clone().unwrap_or("pictures".into());
        checks::output_place("--pictures", Some(&place), entries.len())?;
        clashes::check(&entries, &Overrides { output: Some(place), ..overrides.clone() })?;
        for entry in entries {
            // A task has this scene alone.
            let alone = Overrides { scenes: vec![entry.name.clone()], ..overrides.clone() };
            let as_its_task_has_it = |mut description: SceneDescription| -> Result<SceneDescription> {
                spare_whitted(&mut description, &entry, &alone);
                check_stop(&description).map_err(|e| Error::Config(format!("{}: {e}", entry.name)))?;
                Ok(description)
            };
            let mut look = || -> Result<Vec<i32>> {
                let animation = entry.animation(&overrides.set)?;
                let frames = animation.frames().to_vec();
                files.extend(animation.files());
                let description = as_its_task_has_it(animation.scene(frames.first().copied())?)?;
                files.extend(compile::compile_with(&description, &entry.name, &mut shelf)?.files);
                if cut.parts() {
                    let adaptive = description.render.techniques.adaptive == description::Technique::On
                        && prepare(&entry, overrides)?.plan.adaptive.is_some();
                    for (frame, description) in animation.into_scenes() {
                        check_cut(&as_its_task_has_it(description?)?, cut, adaptive).map_err(|message| {
                            Error::Config(format!("{}: {message}", names::label(&entry.name, frame)))
                        })?;
                    }
                }
                // A line of a table is a task, and a column a name.
                if entry.name.contains(char::is_control) {
                    return Err(Error::Config(format!(
                        "{:?}: expected a name without control characters, found one",
                        entry.name
                    )));
                }
                if entry.name.contains("{{") {
                    return Err(Error::Config(format!("{}: expected a name without {{{{, found one", entry.name)));
                }
                if cut.parts() && frames.is_empty() && ends_in(Path::new(&entry.name), &["exr"]) {
                    return Err(Error::Config(format!(
                        "{}: expected a name that does not end in .exr, for the directory of its parts",
                        entry.name
                    )));
                }
                if let Some(mark) = names::mark(&entry.name, !frames.is_empty()).filter(|_| cut.parts()) {
                    return Err(Error::Config(format!(
                        "{}: expected a name of plain text, which is part of the pattern for its parts, found one with {mark}",
                        entry.name
                    )));
                }
                Ok(frames)
            };
            match look() {
                Ok(frames) => match groups.iter_mut().find(|group| group.frames == frames) {
                    Some(group) => group.scenes.push(entry.name),
                    None => groups.push(Group { scenes: vec![entry.name], frames }),
                },
                Err(e) => faults.push(e),
            }
        }
        if !faults.is_empty() {
            let mut lines: Vec<String> = faults.iter().map(ToString::to_string).collect();
            lines.dedup();
            return match (faults.pop(), lines.len()) {
                (Some(only), 1) => Err(only),
                _ => Err(Error::Config(lines.join("\n"))),
            };
        }
        let absolute = |path: PathBuf| std::path::absolute(&path).map_err(|e| Error::input(&path, e.to_string()));
        let name = source.file_stem().map_or("abbe".into(), |stem| stem.to_string_lossy().into_owned());
        Ok(Job {
            name,
            source: absolute(source.to_path_buf())?,
            pictures: PathBuf::from("pictures"),
            program: "abbe".into(),
            arguments: Vec::new(),
            groups,
            cut,
            threads: 0,
            files: files.into_iter().map(absolute).collect::<Result<_>>()?,
        })
    }

    /// Whether any of its pictures is a frame.
    #[must_use]
    pub fn has_frames(&self) -> bool {
        self.groups.iter().any(|group| !group.frames.is_empty())
    }

    /// Whether `pictures`, which `option` gives, has a place for each of its pictures.
    ///
    /// # Errors
    /// [`Error::Config`] for what `render` refuses by `-o`, and for the name of one file where there are parts.
    pub fn check_place(&self, option: &str, pictures: &Path) -> Result<()> {
        if self.cut.parts() && ends_in(pictures, &["exr"]) {
            return Err(Error::Config(format!(
                "{option} {}: expected a directory for parts of pictures, found the name of one file",
                pictures.display()
            )));
        }
        checks::output_place(option, Some(pictures), self.groups.iter().map(|group| group.scenes.len()).sum())?;
        self.groups.iter().try_for_each(|group| checks::frames(option, Some(pictures), group.frames.len()))
    }

    /// Pictures, all frames counted.
    #[must_use]
    pub fn count(&self) -> usize {
        self.groups.iter().map(|group| group.scenes.len() * group.frames.len().max(1)).sum()
    }
}

/// Whether pictures of `scene` can be cut so, which are sampled adaptively or not.
fn check_cut(scene: &SceneDescription, cut: Cut, adaptive: bool) -> std::result::Result<(), String> {
    let (rows, cells) = if adaptive { (SIDE, " of cells of adaptive sampling") } else { (1, "") };
    let rows = bands(window(scene), rows);
    if u64::from(cut.tiles) > rows {
        return Err(format!("--tiles {}: expected at most {rows}, the rows{cells} of the picture", cut.tiles));
    }
    let samples = match &scene.integrator {
        description::Integrator::Whitted(whitted) => whitted.samples(),
        _ => scene.render.most_samples(),
    };
    if cut.ranges > samples {
        return Err(format!("--sample-ranges {}: expected at most {samples}, the samples of a pixel", cut.ranges));
    }
    let stop = &scene.render.stop;
    if stop.error.is_some() || stop.time.is_some() {
        return Err(
            "render.stop: a part cannot know the error or the time of the whole picture; give it a number of samples"
                .into(),
        );
    }
    if adaptive && cut.ranges > 1 {
        return Err(
            "--sample-ranges: expected --tiles alone, found adaptive sampling, which is decided by all first samples"
                .into(),
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A job without files.
    pub(super) fn job(cut: Cut) -> Job {
        let group = |scenes: &[&str], frames: &[i32]| Group {
            scenes: scenes.iter().map(|s| (*s).to_owned()).collect(),
            frames: frames.to_vec(),
        };
        Job {
            name: "it's".into(),
            source: "/in/it's.yaml".into(),
            pictures: "/out".into(),
            program: "abbe".into(),
            arguments: vec!["--set".into(), "render.seed='x y'".into()],
            groups: vec![group(&["a", "b c"], &[1, 6, 11]), group(&["still"], &[])],
            cut,
            threads: 2,
            files: vec!["/in/it's.yaml".into()],
        }
    }

    #[test]
    fn all_parts_of_a_picture_are_cut_once() {
        let cut = Cut { tiles: 2, ranges: 3, frames: 1 };
        let all: Vec<String> = cut.each().map(|part| part.join(" ")).collect();
        assert_eq!(all, ["0/2 0/3", "0/2 1/3", "0/2 2/3", "1/2 0/3", "1/2 1/3", "1/2 2/3"]);
        assert_eq!(job(cut).count(), 7);
    }
}
