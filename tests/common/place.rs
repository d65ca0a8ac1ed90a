//! A directory with files in which the command is run.

use abbe::film::exr::read_exr;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

pub struct Place {
    pub directory: TempDir,
}

/// What a run of the command left.
pub struct Ran {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Ran {
    /// What is left of a process that ended by itself.
    pub fn of(output: Output) -> Ran {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        let ran = Ran { code: output.status.code().unwrap(), out: text(output.stdout), err: text(output.stderr) };
        assert!(!ran.err.contains("panicked"), "{}", ran.err);
        ran
    }
}

impl Place {
    /// A directory with `files`, each a name and what it holds.
    pub fn with(files: &[(&str, &str)]) -> Place {
        let place = Place { directory: tempfile::tempdir().unwrap() };
        for (name, text) in files {
            super::write(&place.path(name), text.as_bytes());
        }
        place
    }

    /// A directory with `scene.yaml`.
    pub fn of(scene: &str) -> Place {
        Place::with(&[("scene.yaml", scene)])
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_abbe"));
        command.current_dir(self.directory.path()).args(arguments).env_remove("RUST_BACKTRACE");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Ran {
        Ran::of(self.command(arguments).output().unwrap())
    }

    /// Names in a directory, sorted; none where there is no directory.
    pub fn names(&self, directory: &str) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.path(directory)) else { return Vec::new() };
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&std::fs::read(self.path(name)).unwrap()).unwrap()
    }
}

/// Bits of all channels.
pub fn pixels(path: &Path) -> Vec<(String, Vec<u32>)> {
    let part = read_exr(path).unwrap().parts.swap_remove(0);
    part.channels.into_iter().map(|(name, v)| (name, v.into_iter().map(f32::to_bits).collect())).collect()
}
