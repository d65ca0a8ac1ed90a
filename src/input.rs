//! Files that are read: regular ones. A FIFO or a device may keep its reader waiting, or never end.

use std::alloc::{Layout, handle_alloc_error};
use std::fs::File;
use std::io::{Error, ErrorKind, Result};
use std::path::Path;

/// Refuses what is no regular file.
///
/// # Errors
/// What stands at `path`, in words, or why that cannot be told.
pub fn check(path: &Path) -> Result<()> {
    let kind = std::fs::metadata(path)?.file_type();
    if kind.is_file() {
        return Ok(());
    }
    #[cfg(unix)]
    let is_fifo = std::os::unix::fs::FileTypeExt::is_fifo(&kind);
    #[cfg(not(unix))]
    let is_fifo = false;
    let found = match () {
        () if kind.is_dir() => "a directory",
        () if is_fifo => "a FIFO",
        () => "a device or socket",
    };
    Err(Error::other(format!("expected a regular file, found {found}")))
}

/// Whether another process would find something else at `path`, or nothing.
#[must_use]
pub fn is_of_this_process(path: &Path) -> bool {
    ["/dev/stdin", "/dev/fd", "/proc"].iter().any(|own| path.starts_with(own))
}

/// Opens a regular file.
///
/// # Errors
/// As [`check`] and [`File::open`].
pub fn open(path: &Path) -> Result<File> {
    check(path)?;
    File::open(path)
}

/// Bytes without the mark of UTF-8 at their beginning, as spreadsheets write it.
#[must_use]
pub fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes)
}

/// All bytes of a regular file. Without memory for them the process ends, as wherever else it needs some.
///
/// # Errors
/// As [`check`] and [`std::fs::read`].
pub fn read(path: &Path) -> Result<Vec<u8>> {
    check(path)?;
    std::fs::read(path).map_err(end_without_memory)
}

/// `e`, unless it says that there is no memory: that is no fault of the file.
#[must_use]
pub fn end_without_memory(e: Error) -> Error {
    if e.kind() == ErrorKind::OutOfMemory {
        handle_alloc_error(Layout::new::<u8>());
    }
    e
}
