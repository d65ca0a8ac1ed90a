//! The one error enum, and the exit code that each kind of error ends the process with.

use std::path::{Path, PathBuf};

/// What can go wrong, as a person is told.
///
/// Messages name the place, the field, what was expected and what was found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line or a description says something that cannot be: exit code 2.
    ///
    /// The message holds every fault found, one a line, each `file:line:column: field: …`
    /// as far as the place is known.
    #[error("{0}")]
    Config(String),

    /// A file that was named is missing, unreadable or not what it should be: exit code 3.
    #[error("{}: {message}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        message: String,
    },

    /// A result could not be written: exit code 1.
    #[error("{}: cannot write: {message}", path.display())]
    Output {
        /// The file or directory.
        path: PathBuf,
        /// Why, as the system says it.
        message: String,
    },

    /// The system has no threads to give: exit code 1.
    #[error(
        "cannot start {threads} threads: {message}; the process may have too few (ulimit -u), or too little memory"
    )]
    Threads {
        /// How many were wanted.
        threads: usize,
        /// Why, as the system says it.
        message: String,
    },

    /// The system refuses something else that a process needs, such as to hear signals: exit code 1.
    #[error("{0}")]
    System(String),

    /// The render ran but its samples cannot be trusted: exit code 4.
    #[error("{0}")]
    Render(String),

    /// More memory would be needed than the process may have: exit code 33.
    #[error("{0}")]
    Memory(String),

    /// The render was stopped before its end and can go on later: exit code 75.
    #[error("{0}")]
    Stopped(String),
}

/// `std::result::Result` with Abbe's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// The exit code of a process that ends with this error.
    #[must_use]
    pub fn exit_code(&self) -> i32 {
        match self {
            Error::Output { .. } | Error::Threads { .. } | Error::System(_) => 1,
            Error::Config(_) => 2,
            Error::Input { .. } => 3,
            Error::Render(_) => 4,
            Error::Memory(_) => 33,
            Error::Stopped(_) => 75,
        }
    }

    /// An [`Error::Input`] about `path`.
    pub fn input(path: &Path, message: impl Into<String>) -> Error {
        Error::Input { path: path.to_path_buf(), message: one_line(message.into()) }
    }

    /// An [`Error::Input`] of a file that could not be opened or read, and why.
    pub fn unread(path: &Path, why: &std::io::Error) -> Error {
        match why.kind() {
            std::io::ErrorKind::NotFound => Error::input(path, "there is no such file"),
            _ => Error::input(path, why.to_string()),
        }
    }

    /// An [`Error::Output`] about `path`.
    pub fn output(path: &Path, message: impl ToString) -> Error {
        Error::Output { path: path.to_path_buf(), message: message.to_string() }
    }
}

/// A number as a person would write it: `1e308`, and not its three hundred digits.
#[must_use]
pub fn in_short(x: f64) -> String {
    // Between these the shortest digits that tell the number are few enough.
    let plain = x == 0.0 || (1e-5..1e16).contains(&x.abs());
    if plain { x.to_string() } else { format!("{x:e}") }
}

/// `text` with its control characters written out: what is quoted from a file stays on its line, and commands nothing of a
/// terminal.
#[must_use]
pub fn one_line(text: String) -> String {
    if !text.contains(char::is_control) {
        return text;
    }
    text.chars().map(|c| if c.is_control() { c.escape_default().to_string() } else { c.to_string() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_told_as_they_are_written() {
        let pairs =
            [(0.0, "0"), (-1.0, "-1"), (0.25, "0.25"), (1e6, "1000000"), (1e308, "1e308"), (-2.5e-7, "-2.5e-7")];
        for (x, told) in pairs.into_iter().chain([(f64::INFINITY, "inf"), (f64::NAN, "NaN")]) {
            assert_eq!(in_short(x), told);
        }
    }
}
