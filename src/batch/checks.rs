//! What is looked at before a picture is begun: whether it fits into memory, and whether its files may go where they are to.

use super::prepare::{Prepared, window};
use super::{Overrides, Portion, adaptive, ends_in, files, layers, memory, names, output_path, place};
use crate::description::{self, SceneDescription};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::accumulate::Film;
use crate::film::output::{self, Inputs};
use std::path::Path;

/// Refuses a picture whose sums, of `rows` and `needed` bytes, are more than the machine's memory or `limit`, before it is begun.
pub(super) fn fits(description: &SceneDescription, rows: Window, needed: u64, limit: Option<u64>) -> Result<()> {
    let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
    if let Some(limit) = limit.filter(|limit| needed > *limit) {
        let [needed, limit] = [needed, limit].map(mebibytes);
        return Err(Error::Memory(format!(
            "the sums of {rows} take at least {needed} MiB, more than --memory-limit, {limit} MiB"
        )));
    }
    let room = Vec::<u8>::new().try_reserve_exact(usize::try_from(needed).unwrap_or(usize::MAX));
    if room.is_ok() && memory::of_machine().is_none_or(|there| needed <= there) {
        return Ok(());
    }
    let description::Image { overscan, crop, .. } = &description.image;
    let field = match crop {
        Some(_) => "image.crop",
        None if *overscan > 0 => "image.overscan",
        None => "image.width",
    };
    let message = format!(
        "expected a picture that fits into memory, found {rows}, which takes at least {} MiB",
        mebibytes(needed)
    );
    Err(Error::Config(description.fault(field, &message)))
}

/// Refuses a picture of the scene `name` before anything is made ready for it, which may take minutes: one whose sums cannot
/// [fit](fits), as far as the description alone tells, and one whose files cannot be written.
pub(super) fn before_work(name: &str, description: &SceneDescription, overrides: &Overrides) -> Result<()> {
    let Overrides { portion, keep, .. } = overrides;
    // Where samples are shared out, which is not known yet, parts are cut between cells. A part that the picture does not have is
    // told later.
    let tile = Portion { tile: portion.tile, samples: None };
    let rows = |rows: u32| Some(tile.share(window(description), 1, rows).ok()?.rows(window(description)));
    if let Some(rows) = [1, adaptive::SIDE].into_iter().filter_map(rows).min_by_key(Window::pixels) {
        fits(description, rows, Film::bytes(rows, layers::fewest(description)), overrides.memory_limit)?;
    }
    let path = place(&description.output.dir, name, description.frame, overrides);
    // What is there already may be all that is wanted, and need not be written.
    if (keep.resume || keep.skip_existing) && path.exists() {
        return Ok(());
    }
    files::written(&path, &description.output, portion.is_all()).iter().try_for_each(|file| output::try_place(file))
}

/// The place that `option` gives for `scenes` scenes.
///
/// # Errors
/// [`Error::Config`] for the standard output, for the name of another kind of file, for a word in braces that stands for nothing, and
/// for one file for all scenes.
pub(super) fn output_place(option: &str, output: Option<&Path>, scenes: usize) -> Result<()> {
    if output == Some(Path::new("-")) {
        let message = "expected a directory or a file name, for a picture is several files; found the standard output";
        return Err(Error::Config(format!("{option} -: {message} (a directory of this name is ./-)")));
    }
    const OTHERS: [&str; 7] = ["png", "jpg", "jpeg", "tif", "tiff", "hdr", "pfm"];
    if let Some(file) = output.filter(|path| ends_in(path, &OTHERS) && !path.is_dir()) {
        return Err(Error::Config(format!(
            "{option} {}: expected a directory or a file name that ends in .exr, beside which the PNG is written",
            file.display()
        )));
    }
    if let Some((output, Err(message))) = output.map(|output| (output, names::check(output))) {
        return Err(Error::Config(format!("{option} {}: {message}", output.display())));
    }
    let file = output.filter(|path| ends_in(path, &["exr"]));
    match file.filter(|file| scenes > 1 && !names::tells(file).scenes) {
        Some(file) => Err(Error::Config(format!(
            "{option} {}: expected a directory for {scenes} scenes, or a pattern with {{scene}}, found the name of one file",
            file.display()
        ))),
        None => Ok(()),
    }
}

/// Refuses a picture that would take the place of a file that its scene reads, one before it, or the batch: `read`, to which
/// this one's are added. What an earlier scene has written a later one may read.
pub(super) fn places(prepared: &Prepared, overrides: &Overrides, read: &mut Inputs) -> Result<()> {
    for scene in prepared.moments.iter().chain(prepared.next.as_deref()).chain([&prepared.scene]) {
        read.add(&scene.files);
    }
    read.spare(files::touched(&output_path(prepared, overrides), overrides.portion.is_all()))
}

/// [`output_place`] for the frames of a scene.
pub(super) fn frames(option: &str, output: Option<&Path>, frames: usize) -> Result<()> {
    let file = output.filter(|path| ends_in(path, &["exr"]));
    match file.filter(|file| frames > 1 && !names::tells(file).frames) {
        Some(file) => Err(Error::Config(format!(
            "{option} {}: expected a directory for {frames} frames, or a pattern as a.####.exr, a.%04d.exr or \
             {{scene}}.{{frame:04}}.exr, found the name of one file",
            file.display()
        ))),
        None => Ok(()),
    }
}
