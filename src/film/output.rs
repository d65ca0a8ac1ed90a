//! Files that are whole or absent.
//!
//! Bytes go to a temporary name in the same directory, reach the disk (fsync), and take the final
//! name by a rename, so a reader never meets half a file and a full disk leaves the old one alone.
//! A symbolic link stays, and the file at its end is replaced. Devices and FIFOs are written to as they stand.

use crate::error::{Error, Result};
use atomic_write_file::AtomicWriteFile;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// So many symbolic links may lead from one to the next, as on Linux.
const MOST_LINKS: usize = 40;

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
    let file = match target(path)? {
        Target::Stream(data) => {
            let fail = |e| Error::output(path, words(path, &e));
            let mut stream = BufWriter::new(open_stream(path, &data).map_err(fail)?);
            return write(&mut stream).and_then(|()| stream.flush()).map_err(fail);
        }
        Target::File(file) => file,
    };
    let fail = |e| Error::output(path, words(&file, &e));
    let mut writer = BufWriter::new(AtomicWriteFile::open(&file).map_err(fail)?);
    write(&mut writer).map_err(fail)?;
    writer.into_inner().map_err(|e| fail(e.into_error()))?.commit().map_err(fail)
}

/// What stands at a path that is to be written.
enum Target {
    /// A regular file, or none yet: the end of all symbolic links.
    File(PathBuf),
    /// What cannot be replaced: a device, a FIFO, what the standard output is.
    Stream(Metadata),
}

fn target(path: &Path) -> Result<Target> {
    match std::fs::metadata(path) {
        Ok(data) if data.is_dir() => return Err(Error::output(path, "it is a directory")),
        Ok(data) if !data.is_file() || standard(&data).is_some() => return Ok(Target::Stream(data)),
        _ => {}
    }
    let mut file = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match std::fs::read_link(&file) {
            Ok(to) => file = directory_of(&file).join(to),
            Err(_) => return Ok(Target::File(file)),
        }
    }
    Err(Error::output(path, "it is a symbolic link that leads nowhere"))
}

/// Whether what is written to `path` is no file beside which others could lie.
#[must_use]
pub fn is_stream(path: &Path) -> bool {
    matches!(target(path), Ok(Target::Stream(_)))
}

fn open_stream(path: &Path, data: &Metadata) -> std::io::Result<File> {
    #[cfg(unix)]
    if std::os::unix::fs::FileTypeExt::is_socket(&data.file_type()) {
        return Err(std::io::Error::other("it is a socket"));
    }
    standard(data).map_or_else(|| OpenOptions::new().write(true).open(path), Ok)
}

/// The standard output or error, if that is what `data` is of. Opened anew, a file to which it was redirected would be
/// written from its start, over what was said before.
#[cfg(unix)]
fn standard(data: &Metadata) -> Option<File> {
    use std::os::fd::AsFd;
    use std::os::unix::fs::MetadataExt;
    let ends = [std::io::stdout().as_fd().try_clone_to_owned(), std::io::stderr().as_fd().try_clone_to_owned()];
    let is_it = |own: Metadata| (own.dev(), own.ino()) == (data.dev(), data.ino());
    ends.into_iter().flatten().map(File::from).find(|end| end.metadata().is_ok_and(is_it))
}

#[cfg(not(unix))]
fn standard(_: &Metadata) -> Option<File> {
    None
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
    let Target::File(end) = target(file)? else { return Ok(()) };
    let directory = directory_of(&end);
    let fail = |e: std::io::Error| Error::output(file, words(&end, &e));
    if directory.exists() && !directory.is_dir() {
        return Err(Error::output(file, format!("{} is not a directory", directory.display())));
    }
    std::fs::create_dir_all(directory).map_err(fail)?;
    let probe = directory.join(format!(".abbe-{}", std::process::id()));
    File::create(&probe).map_err(fail)?;
    match std::fs::remove_file(&probe) {
        // Another machine, whose process has the same number, was faster.
        Err(e) if e.kind() != ErrorKind::NotFound => Err(fail(e)),
        _ => Ok(()),
    }
}

/// Files that are read, of which no output may take the place.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    /// As the file system calls them.
    files: BTreeSet<PathBuf>,
}

impl Inputs {
    /// These alone.
    #[must_use]
    pub fn of<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Inputs {
        let mut inputs = Inputs::default();
        inputs.add(paths);
        inputs
    }

    /// These, too.
    pub fn add<P: AsRef<Path>>(&mut self, paths: impl IntoIterator<Item = P>) {
        self.files.extend(paths.into_iter().filter_map(|path| replaceable(path.as_ref())));
    }

    /// Refuses to write to one of them.
    ///
    /// # Errors
    /// [`Error::Config`] with the first.
    pub fn spare<P: AsRef<Path>>(&self, outputs: impl IntoIterator<Item = P>) -> Result<()> {
        let is_read = |path: &P| replaceable(path.as_ref()).is_some_and(|path| self.files.contains(&path));
        match outputs.into_iter().find(is_read) {
            Some(path) => Err(Error::Config(format!(
                "{}: expected a place to write to, found a file that is read",
                path.as_ref().display()
            ))),
            None => Ok(()),
        }
    }
}

/// The regular file at `path`, by the one name that tells it from others.
fn replaceable(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok().filter(|path| path.is_file())
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

    /// Root may replace anything: `--report /dev/null` took the device away.
    #[cfg(unix)]
    #[test]
    fn links_and_fifos_stay_what_they_are() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::create_dir(at("deep")).unwrap();
        std::fs::write(at("old.txt"), "old").unwrap();
        for (to, link, end) in
            [("../old.txt", "deep/a", "old.txt"), ("a", "deep/b", "old.txt"), ("deep/new.txt", "c", "deep/new.txt")]
        {
            symlink(to, at(link)).unwrap();
            prepare_place(&at(link)).unwrap();
            write_atomically(&at(link), link.as_bytes()).unwrap();
            assert!(at(link).is_symlink() && !at(end).is_symlink(), "{link}");
            assert_eq!(std::fs::read(at(end)).unwrap(), link.as_bytes());
        }
        symlink("loop", at("loop")).unwrap();
        assert!(write_atomically(&at("loop"), b"").unwrap_err().to_string().ends_with("leads nowhere"));

        let fifo = at("fifo");
        assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
        let reader = std::thread::spawn({
            let fifo = fifo.clone();
            move || std::fs::read(fifo).unwrap()
        });
        prepare_place(&fifo).unwrap();
        write_json(&fifo, &[1]).unwrap();
        assert_eq!(reader.join().unwrap(), b"[\n  1\n]");
        assert!(std::fs::symlink_metadata(&fifo).unwrap().file_type().is_fifo());
        drop(std::os::unix::net::UnixListener::bind(at("socket")).unwrap());
        assert!(write_atomically(&at("socket"), b"").unwrap_err().to_string().ends_with("it is a socket"));
    }

    /// What a full disk says is tested by words.
    #[test]
    fn a_full_disk_is_named() {
        let e = std::io::Error::from(ErrorKind::StorageFull);
        assert_eq!(words(Path::new("out/a.exr"), &e), "the disk that holds out is full");
        assert_eq!(words(Path::new("a.exr"), &e), "the disk that holds . is full");
    }
}
