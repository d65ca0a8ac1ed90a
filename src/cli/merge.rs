//! `abbe merge`.

use super::MergeArguments;
use super::render::{table, threads};
use crate::batch::merge;
use crate::error::{Error, Result};
use crate::film::output::{prepare_place, write_atomically};

/// Merges, and prints the table of the picture.
pub fn run(arguments: &MergeArguments) -> Result<i32> {
    // A second call in one process keeps the pool.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads(arguments.threads)).build_global();
    if let Some(file) = &arguments.report {
        prepare_place(file)?;
    }
    let (report, written) = merge::merge(&arguments.parts, &arguments.output)?;
    if let Some(file) = &arguments.report {
        let json = serde_json::to_vec_pretty(&report).map_err(|e| Error::output(file, e))?;
        write_atomically(file, &json)?;
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
