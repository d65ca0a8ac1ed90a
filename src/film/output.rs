//! Files that are whole or absent.
//!
//! Bytes go to a temporary name in the same directory, reach the disk (fsync), and take the final
//! name by a rename, so a reader never meets half a file and a full disk leaves the old one alone.
//! A process that is killed leaves its temporary file; the next one that writes to the directory removes it.
//! A symbolic link stays, and the file at its end is replaced. Devices and FIFOs are written to as they stand.

use crate::error::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::{Duration, Instant};

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
    replace(&file, write).map_err(|e| Error::output(path, words(&file, &e)))
}

/// Writes files that belong together, replacing what stands there. They reach the disk at the same time, on the current rayon pool,
/// and take their names only when all of them are there, in turn: where one cannot be written, all are as they were before.
///
/// # Errors
/// As [`write_atomically`], of the first.
pub fn write_together(files: &[(&Path, &[u8])]) -> Result<()> {
    let fill = |&(path, bytes): &(&Path, &[u8])| match target(path)? {
        Target::Stream(_) => Ok(None),
        Target::File(file) => match fill(&file, |out| out.write_all(bytes)) {
            Ok(nameless) => Ok(Some(nameless)),
            Err(e) => Err(Error::output(path, words(&file, &e))),
        },
    };
    let filled: Vec<Result<Option<Nameless>>> = files.par_iter().map(fill).collect();
    let filled: Vec<Option<Nameless>> = filled.into_iter().collect::<Result<_>>()?;
    // A stream, too, may fail when it is written.
    let streams = files.iter().zip(&filled).filter(|(_, filled)| filled.is_none());
    for (&(path, bytes), _) in streams {
        write_atomically(path, bytes)?;
    }
    let mut named: Vec<PathBuf> = Vec::new();
    let all = files.iter().zip(filled).try_for_each(|(&(path, _), filled)| {
        let Some(nameless) = filled else { return Ok(()) };
        let file = nameless.path.clone();
        nameless.take_name().map_err(|e| Error::output(path, words(&file, &e)))?;
        named.push(file);
        Ok(())
    });
    // One directory is brought to the disk once.
    named.dedup_by(|a, b| directory_of(a) == directory_of(b));
    let kept = named.iter().try_for_each(|file| keep_name(file).map_err(|e| Error::output(file, words(file, &e))));
    all.and(kept)
}

/// Writes to a temporary file, which then takes the place of the one at `path`.
fn replace(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> std::io::Result<()> {
    fill(path, write)?.take_name()?;
    keep_name(path)
}

/// A file that is whole and on the disk under a temporary name. It is removed where it gets no other.
struct Nameless {
    temporary: Option<PathBuf>,
    /// Its name.
    path: PathBuf,
}

impl Nameless {
    fn take_name(mut self) -> std::io::Result<()> {
        if let Some(temporary) = &self.temporary {
            std::fs::rename(temporary, &self.path)?;
        }
        self.temporary = None;
        Ok(())
    }
}

impl Drop for Nameless {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            // What went wrong first is told.
            let _ = std::fs::remove_file(temporary);
        }
    }
}

/// Writes to a temporary file what is to be at `path`.
fn fill(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> std::io::Result<Nameless> {
    let (file, temporary) = open_temporary(path)?;
    let nameless = Nameless { temporary: Some(temporary), path: path.to_path_buf() };
    take_after(&file, path)?;
    let mut writer = BufWriter::new(file);
    write(&mut writer)?;
    writer.into_inner()?.sync_all()?;
    Ok(nameless)
}

/// Brings the name of the file at `path` to the disk, too. The file is there already, so what a directory does not do by its nature
/// is no fault.
fn keep_name(path: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    File::open(directory_of(path)).and_then(|directory| directory.sync_all()).or_else(unless_it_cannot_be)?;
    #[cfg(not(unix))]
    let _ = path;
    Ok(())
}

/// Passes over what a file system or the rights in it do not allow.
#[cfg(unix)]
fn unless_it_cannot_be(e: std::io::Error) -> std::io::Result<()> {
    match e.kind() {
        ErrorKind::PermissionDenied | ErrorKind::InvalidInput | ErrorKind::Unsupported => Ok(()),
        _ => Err(e),
    }
}

/// Gives `file` the owner and the permissions of what it is to replace, as far as that may be.
fn take_after(file: &File, path: &Path) -> std::io::Result<()> {
    let Ok(old) = std::fs::metadata(path) else { return Ok(()) };
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt, fchown};
        let new = file.metadata()?;
        if (new.uid(), new.gid()) != (old.uid(), old.gid()) {
            // Only root may give files away, and not to users that a container lacks.
            fchown(file, Some(old.uid()), Some(old.gid())).or_else(unless_it_cannot_be)?;
        }
        file.set_permissions(old.permissions()).or_else(unless_it_cannot_be)
    }
    #[cfg(not(unix))]
    file.set_permissions(old.permissions())
}

/// So many bytes of a name go into that of its temporary file: file systems take 255.
const LONGEST: usize = 200;

/// A temporary file of a process elsewhere is left over when it has not been written to for so long; writing takes minutes.
const LEFT_AFTER: Duration = Duration::from_secs(7 * 24 * 3600);

/// A new file beside `path`, `.x.exr.abbe-HOME-PROCESS-NUMBER`. Those that dead processes left in its directory are removed.
fn open_temporary(path: &Path) -> std::io::Result<(File, PathBuf)> {
    let name = path.file_name().ok_or(ErrorKind::IsADirectory)?.to_string_lossy();
    let name = &name[..name.floor_char_boundary(LONGEST)];
    let home = HOME.as_deref().unwrap_or("0");
    let mut number = 0_u32;
    loop {
        let own = directory_of(path).join(format!(".{name}.abbe-{home}-{}-{number}", std::process::id()));
        match OpenOptions::new().write(true).create_new(true).open(&own) {
            // Another thread, or machine.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => number += 1,
            Err(e) => return Err(e),
            Ok(file) => {
                remove_left_over(directory_of(path), &file.metadata()?);
                return Ok((file, own));
            }
        }
    }
}

/// Where the numbers of processes mean what they mean here: this start of this machine, and this container on it. None where
/// the system does not tell, or shows the processes of another container.
static HOME: LazyLock<Option<String>> = LazyLock::new(|| {
    let own = std::fs::read_link("/proc/self").ok()?;
    let boot = std::fs::read("/proc/sys/kernel/random/boot_id").ok().filter(|boot| !boot.is_empty())?;
    let space = std::fs::read_link("/proc/self/ns/pid").ok()?;
    let is_shown = own.to_str() == Some(&std::process::id().to_string());
    let all = [boot.as_slice(), space.as_os_str().as_encoded_bytes()].concat();
    is_shown.then(|| blake3::hash(&all).to_hex()[..8].to_owned())
});

/// Home and process in the name of a temporary file.
fn owner(name: &str) -> Option<(&str, u32)> {
    let (_, owner) = name.strip_prefix('.')?.rsplit_once(".abbe-")?;
    let mut pieces = owner.split('-');
    let (home, process, number) = (pieces.next()?, pieces.next()?.parse().ok()?, pieces.next()?);
    (number.parse::<u32>().is_ok() && pieces.next().is_none()).then_some((home, process))
}

/// Removes the temporary files that dead processes of this user left in `directory`, once in a process: some directories
/// have a file for each of many thousand frames. `own` is of a file that has just been made there, by the clock of its disk.
fn remove_left_over(directory: &Path, own: &Metadata) {
    static DONE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    if !DONE.lock().unwrap_or_else(PoisonError::into_inner).insert(directory.to_path_buf()) {
        return;
    }
    for entry in std::fs::read_dir(directory).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some((home, process)) = name.to_str().and_then(owner) else { continue };
        let Ok(data) = entry.metadata() else { continue };
        let is_dead = match HOME.as_deref() {
            Some(here) if home == here => {
                matches!(Path::new("/proc").join(process.to_string()).try_exists(), Ok(false))
            }
            _ => age(&data, own).is_some_and(|age| age >= LEFT_AFTER),
        };
        if data.is_file() && same_user(&data, own) && is_dead {
            // What cannot be removed is in nobody's way.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// How long before `own` a file was last written to.
fn age(data: &Metadata, own: &Metadata) -> Option<Duration> {
    own.modified().ok()?.duration_since(data.modified().ok()?).ok()
}

/// The processes of others may be hidden.
#[cfg(unix)]
fn same_user(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    a.uid() == b.uid()
}

#[cfg(not(unix))]
fn same_user(_: &Metadata, _: &Metadata) -> bool {
    true
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

/// The one name of the file that is written where `path` is; none of a stream, or where there is no directory for it.
#[must_use]
pub fn end(path: &Path) -> Option<PathBuf> {
    let Ok(Target::File(end)) = target(path) else { return None };
    Some(directory_of(&end).canonicalize().ok()?.join(end.file_name()?))
}

fn open_stream(path: &Path, data: &Metadata) -> std::io::Result<File> {
    #[cfg(unix)]
    if std::os::unix::fs::FileTypeExt::is_socket(&data.file_type()) {
        return Err(std::io::Error::other("it is a socket"));
    }
    #[cfg(target_os = "linux")]
    let _reader = await_reader(path, data, READER_COMES_WITHIN)?;
    standard(data).map_or_else(|| OpenOptions::new().write(true).open(path), Ok)
}

/// How long the reader of a FIFO is waited for. Whoever opened one that nobody reads would wait for ever, and hear no signal.
#[cfg(target_os = "linux")]
const READER_COMES_WITHIN: Duration = Duration::from_secs(30);

/// What holds a FIFO open toward its reader, who is there; none for what is no FIFO.
#[cfg(target_os = "linux")]
fn await_reader(path: &Path, data: &Metadata, most: Duration) -> std::io::Result<Option<File>> {
    use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
    // `O_NONBLOCK`, and `ENXIO`, by which it tells that there is no reader.
    const WITHOUT_WAITING: i32 = 0o4000;
    const NO_READER: i32 = 6;
    if !data.file_type().is_fifo() {
        return Ok(None);
    }
    let end = Instant::now() + most;
    loop {
        match OpenOptions::new().write(true).custom_flags(WITHOUT_WAITING).open(path) {
            Ok(file) => return Ok(Some(file)),
            Err(e) if e.raw_os_error() != Some(NO_READER) => return Err(e),
            Err(_) if Instant::now() >= end => {
                return Err(std::io::Error::other(format!(
                    "it is a FIFO that nobody has read for {} s",
                    most.as_secs()
                )));
            }
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
    }
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
    let Some(end) = named_end(file)? else { return Ok(()) };
    let directory = directory_of(&end);
    if directory.exists() && !directory.is_dir() {
        return Err(Error::output(file, format!("{} is not a directory", directory.display())));
    }
    std::fs::create_dir_all(directory).map_err(|e| match e.kind() {
        // What is there is no directory, nor anything else: the end of a link.
        ErrorKind::AlreadyExists => {
            Error::output(file, format!("{} leads through a symbolic link to nowhere", directory.display()))
        }
        _ => Error::output(file, words(&end, &e)),
    })?;
    probe(file, &end, directory)
}

/// [`prepare_place`] that makes nothing, for what may come to nothing yet: directories that are not there could be made in the one
/// above them that is.
///
/// # Errors
/// As [`prepare_place`], but for what only the making of directories tells.
pub fn try_place(file: &Path) -> Result<()> {
    let Some(end) = named_end(file)? else { return Ok(()) };
    let directory = directory_of(&end);
    let there = directory.ancestors().find(|above| above.exists()).unwrap_or(Path::new("."));
    match there.is_dir() {
        true => probe(file, &end, there),
        false => Err(Error::output(file, format!("{} is not a directory", directory.display()))),
    }
}

/// Where the file at `file` ends up, whose name is none of a directory; none of a stream.
fn named_end(file: &Path) -> Result<Option<PathBuf>> {
    if file.as_os_str().as_encoded_bytes().last().is_some_and(|byte| std::path::is_separator(char::from(*byte))) {
        return Err(Error::output(file, "expected the name of a file, found that of a directory"));
    }
    Ok(match target(file)? {
        Target::File(end) => Some(end),
        Target::Stream(_) => None,
    })
}

/// Tries whether a file with the name of `end`, which is where `file` leads, could be made in `directory`.
fn probe(file: &Path, end: &Path, directory: &Path) -> Result<()> {
    let fail = |e: std::io::Error| Error::output(file, words(end, &e));
    // A temporary name is shorter than one that is too long.
    if let Err(e) = std::fs::symlink_metadata(end)
        && e.kind() == ErrorKind::InvalidFilename
    {
        return Err(fail(e));
    }
    let name = end.file_name().ok_or_else(|| fail(ErrorKind::IsADirectory.into()))?;
    let (_, probe) = open_temporary(&directory.join(name)).map_err(fail)?;
    std::fs::remove_file(&probe).map_err(fail)
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
    let directory =
        if directory == Path::new(".") { "the working directory".into() } else { directory.to_string_lossy() };
    match e.kind() {
        ErrorKind::NotFound if !there => format!("the directory {directory} does not exist"),
        ErrorKind::PermissionDenied => format!("no permission to write in {directory}"),
        ErrorKind::NotADirectory => format!("{directory} is not a directory"),
        ErrorKind::InvalidFilename => "the name is too long, with the endings of what is written beside it".into(),
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

    /// The second is a directory: the first is as it was, the third is not there, and nothing else. The files of two renders stood
    /// beside each other on a full disk.
    #[test]
    fn files_that_belong_together_take_their_names_when_all_are_there() {
        let dir = tempfile::tempdir().unwrap();
        let paths = ["a", "b", "c"].map(|name| dir.path().join(name));
        let files = [0, 1, 2].map(|i| (&*paths[i], [&b"one"[..], b"two", b"three"][i]));
        std::fs::write(&paths[0], "old").unwrap();
        std::fs::create_dir(&paths[1]).unwrap();
        assert!(write_together(&files).unwrap_err().to_string().contains("it is a directory"));
        assert_eq!(std::fs::read(&paths[0]).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
        std::fs::remove_dir(&paths[1]).unwrap();
        write_together(&files).unwrap();
        assert!(files.iter().all(|(path, bytes)| std::fs::read(path).unwrap() == *bytes));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);
    }

    /// A device that is always full.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_stream_that_fails_leaves_the_files_beside_it_as_they_were() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        std::fs::write(&path, "old").unwrap();
        let e = write_together(&[(&*path, b"new"), (Path::new("/dev/full"), b"new")]).unwrap_err().to_string();
        assert!(e.contains("/dev/full") && std::fs::read(&path).unwrap() == b"old", "{e}");
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

    #[test]
    fn a_name_of_a_directory_is_none_of_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let e = prepare_place(&dir.path().join("new/")).unwrap_err().to_string();
        assert!(e.ends_with("expected the name of a file, found that of a directory"), "{e}");
    }

    #[test]
    fn a_place_is_tried_without_a_trace() {
        let dir = tempfile::tempdir().unwrap();
        let place = |name: &str| try_place(&dir.path().join(name)).map_err(|e| e.to_string());
        std::fs::write(dir.path().join("file"), "").unwrap();
        assert_eq!((place("a.exr"), place("new/deep/a.exr"), place("file")), (Ok(()), Ok(()), Ok(())));
        for below in ["file", "file/deep"] {
            let told = format!("{} is not a directory", dir.path().join(below).display());
            assert!(place(&format!("{below}/a.exr")).unwrap_err().ends_with(&told));
        }
        assert!(place("new/").unwrap_err().ends_with("found that of a directory"));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_directory_that_is_a_link_to_nowhere_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let link = dir.path().join("shots");
        std::os::unix::fs::symlink(dir.path().join("unmounted/shots"), &link).unwrap();
        for directory in [link.clone(), link.join("a")] {
            let e = prepare_place(&directory.join("a.exr")).unwrap_err();
            let said = format!("{} leads through a symbolic link to nowhere", directory.display());
            assert!(e.exit_code() == 1 && e.to_string().ends_with(&said), "{e}");
        }
    }

    /// What a dead process left goes, but nothing of a live one, of one elsewhere that may live, or of people.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_dead_processes_left_is_removed() {
        let dir = tempfile::tempdir().unwrap();
        let mut dead = std::process::Command::new("true").spawn().unwrap();
        dead.wait().unwrap();
        let (home, dead, own) = (HOME.as_deref().unwrap(), dead.id(), std::process::id());
        let old = std::time::SystemTime::now() - LEFT_AFTER - Duration::from_secs(60);
        let file = |name: String| (File::create(dir.path().join(&name)).unwrap(), name);
        let left = [format!(".x.exr.abbe-{home}-{dead}-0"), format!(".y.exr.checkpoint.abbe-{home}-{dead}-7")];
        let stays =
            [format!(".x.exr.abbe-{home}-{own}-9"), format!(".x.exr.abbe-01234567-{dead}-0"), ".x.exr.DU08XR".into()];
        left.iter().chain(&stays).for_each(|name| drop(file(name.clone())));
        file(format!(".x.exr.abbe-76543210-{own}-0")).0.set_modified(old).unwrap();
        let (_, kept) = file(format!(".x.exr.abbe-{home}-{dead}-notes"));
        write_atomically(&dir.path().join("x.exr"), b"new").unwrap();
        let mut found: Vec<String> =
            std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        let mut expected: Vec<String> = stays.into_iter().chain([kept, "x.exr".into()]).collect();
        found.sort();
        expected.sort();
        assert_eq!(found, expected);
    }

    /// Also names as long as file systems take them, and what was there keeps its permissions.
    #[cfg(unix)]
    #[test]
    fn a_long_name_is_written_and_permissions_stay() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("é".repeat(125) + ".exr");
        write_atomically(&path, b"old").unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).unwrap();
        write_atomically(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
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
        #[cfg(target_os = "linux")]
        {
            let unread = at("unread");
            assert!(std::process::Command::new("mkfifo").arg(&unread).status().unwrap().success());
            let told = await_reader(&unread, &std::fs::metadata(&unread).unwrap(), Duration::ZERO).unwrap_err();
            assert_eq!(told.to_string(), "it is a FIFO that nobody has read for 0 s");
        }
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
        assert_eq!(words(Path::new("a.exr"), &e), "the disk that holds the working directory is full");
    }
}
