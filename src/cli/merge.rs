//! `abbe merge`.

use super::MergeArguments;
use super::render::table;
use crate::batch::merge;
use crate::error::Result;
use crate::film::output::{Inputs, prepare_place};

/// Merges, and prints the table of the picture.
pub fn run(arguments: &MergeArguments) -> Result<i32> {
    if let Some(file) = &arguments.report {
        Inputs::of(merge::files(&arguments.parts)?).spare([file])?;
        prepare_place(file)?;
    }
    let (mut report, written) = merge::merge(&arguments.parts, &arguments.output, arguments.report.as_deref())?;
    if let Some(file) = &arguments.report {
        report.copy_to(file);
    }
    if !arguments.quiet {
        super::say(&table(&report));
    }
    written?;
    if let Some(e) = &report.unwritten {
        super::complain(&super::prefixed(e));
    }
    Ok(report.exit_code())
}
