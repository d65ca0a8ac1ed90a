//! Files that are whole or absent.
//!
//! Bytes go to a temporary name in the same directory, reach the disk (fsync), and take the final
//! name by a rename, so a reader never meets half a file and a full disk leaves the old one alone.

use crate::error::{Error, Result};
use atomic_write_file::AtomicWriteFile;
use serde::Serialize;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::Path;

/// Writes `bytes` to `path`, replacing what stands there.
///
/// # Errors
/// [`Error::Output`] that says what is wrong with the place; the file is then as it was before.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    write_pieces(path, |file| file.write_all(bytes))
}

/// Writes to `path` what `write` writes piece by piece, for what is too long to lie in memory, replacing what stands there.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_pieces(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let fail = |e: std::io::Error| Error::output(path, words(path, &e));
    if path.is_dir() {
        return Err(Error::output(path, "it is a directory"));
    }
    let mut file = BufWriter::new(AtomicWriteFile::open(path).map_err(fail)?);
    write(&mut file).map_err(fail)?;
    file.into_inner().map_err(|e| fail(e.into_error()))?.commit().map_err(fail)
}

/// Writes `value` to `path` as JSON for people, replacing what stands there.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    write_pieces(path, |file| Ok(serde_json::to_writer_pretty(file, value)?))
}

/// The directory in which `file` lies.
#[must_use]
pub fn directory_of(file: &Path) -> &Path {
    match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Makes the directory of `file` if there is none, and tries whether the file could be written: that is told
/// before the work, not after.
///
/// # Errors
/// As [`write_atomically`].
pub fn prepare_place(file: &Path) -> Result<()> {
    let directory = directory_of(file);
    let fail = |e: std::io::Error| Error::output(file, words(file, &e));
    if directory.exists() && !directory.is_dir() {
        return Err(Error::output(file, format!("{} is not a directory", directory.display())));
    }
    std::fs::create_dir_all(directory).map_err(fail)?;
    if file.is_dir() {
        return Err(Error::output(file, "it is a directory"));
    }
    let probe = directory.join(format!(".abbe-{}", std::process::id()));
    std::fs::File::create(&probe).map_err(fail)?;
    match std::fs::remove_file(&probe) {
        // Another machine, whose process has the same number, was faster.
        Err(e) if e.kind() != ErrorKind::NotFound => Err(fail(e)),
        _ => Ok(()),
    }
}

/// What an I/O error means for a file that was to be written.
fn words(path: &Path, e: &std::io::Error) -> String {
    let directory = directory_of(path);
    let there = directory.is_dir();
    let directory = directory.display();
    match e.kind() {
        ErrorKind::NotFound if !there => format!("the directory {directory} does not exist"),
        ErrorKind::PermissionDenied => format!("no permission to write in {directory}"),
        ErrorKind::NotADirectory => format!("{directory} is not a directory"),
        ErrorKind::StorageFull => format!("the disk that holds {directory} is full"),
        ErrorKind::QuotaExceeded => format!("the quota of the disk that holds {directory} is used up"),
        ErrorKind::FileTooLarge => format!("the file is larger than this process may write in {directory}"),
        ErrorKind::ReadOnlyFilesystem => format!("{directory} is on a read-only disk"),
        _ => e.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_file_replaces_the_old_one_and_leaves_nothing_beside_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ä b.txt");
        write_atomically(&path, b"old and longer").unwrap();
        write_atomically(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_directory_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let missing = dir.path().join("frames");
        let e = write_atomically(&missing.join("a.exr"), b"").unwrap_err().to_string();
        assert!(e.contains(&format!("the directory {} does not exist", missing.display())), "{e}");
        let e = write_atomically(dir.path(), b"").unwrap_err().to_string();
        assert!(e.ends_with("it is a directory"), "{e}");
    }

    /// `/dev/full` is no regular file, so the device is not replaced; what a full disk says is tested by words.
    #[test]
    fn a_full_disk_is_named() {
        let e = std::io::Error::from(ErrorKind::StorageFull);
        assert_eq!(words(Path::new("out/a.exr"), &e), "the disk that holds out is full");
        assert_eq!(words(Path::new("a.exr"), &e), "the disk that holds . is full");
    }
}
