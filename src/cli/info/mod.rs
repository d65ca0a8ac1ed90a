//! `abbe info`: what is in a picture, as a person would ask.

mod facts;
mod text;

use super::InfoArguments;
use crate::error::{Error, Result};
use crate::film::png::inspect::{self, PngFacts};
use facts::ExrFacts;
use serde::Serialize;
use std::path::Path;

/// What a file is.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
enum Found {
    /// An OpenEXR file.
    Exr(ExrFacts),
    /// A PNG file.
    Png(PngFacts),
    /// A file that cannot be read: why.
    Error(String),
}

/// One file of the answer in JSON.
#[derive(Debug, Serialize)]
struct Answer<'a> {
    #[serde(serialize_with = "crate::batch::report::in_text")]
    file: &'a Path,
    bytes: u64,
    #[serde(flatten)]
    found: Found,
}

/// Tells of each file. One that cannot be read does not keep the others from being told of.
pub fn run(arguments: &InfoArguments) -> Result<i32> {
    let mut answers = Vec::new();
    let mut code = 0;
    for (i, file) in arguments.files.iter().enumerate() {
        let bytes = std::fs::metadata(file).map_or(0, |m| m.len());
        let found = look(file).unwrap_or_else(|e| {
            super::complain(&super::prefixed(&e));
            code = e.exit_code();
            Found::Error(e.to_string())
        });
        if !arguments.json {
            let gap = if i > 0 { "\n" } else { "" };
            match &found {
                Found::Exr(exr) => super::say(&format!("{gap}{}", text::exr(file, bytes, exr))),
                Found::Png(png) => super::say(&format!("{gap}{}", text::png(file, bytes, png))),
                Found::Error(_) => {}
            }
        }
        answers.push(Answer { file, bytes, found });
    }
    if arguments.json {
        let json = serde_json::to_string_pretty(&answers).map_err(|e| Error::Config(e.to_string()))?;
        super::say(&(json + "\n"));
    }
    Ok(code)
}

/// By what the file begins with, whatever its name.
fn look(file: &Path) -> Result<Found> {
    let mut start = [0; 8];
    let read = crate::input::open(file).and_then(|mut f| std::io::Read::read(&mut f, &mut start));
    match read {
        Ok(_) if start == *b"\x89PNG\r\n\x1a\n" => inspect::inspect(file).map(Found::Png),
        Ok(_) if start[..4] != [0x76, 0x2f, 0x31, 0x01] => {
            Err(Error::input(file, "expected an OpenEXR or PNG file, found something else"))
        }
        // What cannot be opened is told there.
        _ => facts::of(file).map(Found::Exr),
    }
}
