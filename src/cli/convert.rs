//! `abbe import` and `abbe export`: Mitsuba's XML to YAML and back.

use super::ConvertArguments;
use crate::batch;
use crate::description::{self, SceneDescription};
use crate::error::{Error, Result};
use crate::film::output::{Inputs, directory_of, is_stream, write_atomically};
use crate::scene::{compile, load, mesh, sdf};
use std::path::Path;

/// Prints the scene as YAML, or writes it.
pub fn import(arguments: &ConvertArguments) -> Result<i32> {
    let (scene, _) = read(arguments)?;
    // Beside a stream lies nothing.
    let file = arguments.output.as_deref().filter(|path| !is_stream(path));
    let directory = file.map_or(Path::new(""), directory_of);
    write(arguments.output.as_deref(), &description::yaml(&scene, directory))?;
    Ok(0)
}

/// Prints the scene as Mitsuba's XML, or writes it, and says what Mitsuba cannot express.
pub fn export(arguments: &ConvertArguments) -> Result<i32> {
    let (scene, read) = read(arguments)?;
    // What is wrong with it is no matter of what Mitsuba can express: names that nothing has, files that are not there.
    compile::compile(&scene, "scene")?;
    let output = arguments.output.as_deref();
    let file = output.filter(|path| !is_stream(path));
    let path = file.unwrap_or(Path::new(""));
    let exported = description::export(&scene, path, &mesh::FOR_EXPORT, &load::for_mitsuba, &sdf::is_closed);
    match file {
        Some(path) => {
            let beside = |name: &String| directory_of(path).join(name);
            read.spare(exported.files.iter().map(|(name, _)| beside(name)))?;
            for (name, bytes) in &exported.files {
                write_atomically(&beside(name), bytes)?;
            }
        }
        None if !exported.files.is_empty() => {
            return Err(Error::Config(
                "expected -o FILE.xml, for a mesh or a picture has to be written beside the scene; found none".into(),
            ));
        }
        None => {}
    }
    write(output, &exported.xml)?;
    for loss in &exported.losses {
        let message = format!("Mitsuba cannot express this; it gets {}", loss.instead);
        super::complain(&format!("note: {}", scene.fault(&loss.field, &message)));
    }
    Ok(0)
}

/// The one scene that is asked for, of other files than the one that is to be written, and those files. Its notes are told.
fn read(arguments: &ConvertArguments) -> Result<(SceneDescription, Inputs)> {
    let file = &arguments.scene.file;
    if arguments.output.as_deref() == Some(Path::new("-")) {
        return Err(Error::Config("-o -: expected the name of a file; without -o the scene is printed".into()));
    }
    let overrides = arguments.scene.overrides(None)?;
    match &batch::entries(file, &overrides)?[..] {
        [entry] => {
            let animation = entry.animation(&overrides.set)?;
            let mut read = Inputs::of(animation.files().iter().chain([file]));
            read.add(animation.named_files());
            read.spare(&arguments.output)?;
            if let [first, _, ..] = animation.frames() {
                let count = animation.frames().len();
                let message = format!("frame {first} of {count} is written; --frames N picks another");
                super::complain(&format!("note: {}: {message}", file.display()));
            }
            let scene = animation.into_first()?;
            for note in scene.locator.notes() {
                super::complain(&format!("note: {note}"));
            }
            Ok((scene, read))
        }
        entries => Err(Error::Config(format!(
            "{}: expected one scene, found {}; --scene NAME picks one",
            file.display(),
            entries.len()
        ))),
    }
}

fn write(path: Option<&Path>, text: &str) -> Result<()> {
    match path {
        Some(path) => write_atomically(path, text.as_bytes()),
        None => {
            super::say(text);
            Ok(())
        }
    }
}
