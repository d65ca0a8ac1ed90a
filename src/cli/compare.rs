//! `abbe compare`.

use super::CompareArguments;
use crate::error::Result;
use crate::film::compare::{self, CompareOptions, Verdict};
use crate::film::exr::read_exr;
use crate::film::output::{Inputs, write_json};

/// Prints figures and a verdict.
pub fn run(arguments: &CompareArguments) -> Result<i32> {
    if let Some(file) = &arguments.json {
        Inputs::of([&arguments.a, &arguments.b]).spare([file])?;
    }
    let a = read_exr(&arguments.a)?;
    let b = read_exr(&arguments.b)?;
    let options = CompareOptions { mean_tolerance: arguments.mean_tolerance, ..CompareOptions::default() };
    let comparison = compare::compare(&a, &b, &options);
    super::say(&comparison.table());
    if let Some(file) = &arguments.json {
        write_json(file, &comparison)?;
    }
    Ok(match comparison.verdict {
        Verdict::Same => 0,
        Verdict::Different => 1,
        Verdict::CannotCompare => 2,
    })
}
