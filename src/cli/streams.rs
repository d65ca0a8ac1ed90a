//! What the process says: on its standard output and its standard error.

use crate::error::Error;
use std::io::Write;
use std::sync::OnceLock;

/// Why something could not be said, the first time.
static LOST: OnceLock<String> = OnceLock::new();

/// Writes to the standard output. What cannot be written ends the process with an error, but not before its work is done.
pub(super) fn say(text: &str) {
    let mut out = std::io::stdout().lock();
    note_loss(out.write_all(text.as_bytes()).and_then(|()| out.flush()));
}

/// Keeps why the standard output was not written to. A reader that went away, as in `abbe plan … | head`, is no fault.
pub(super) fn note_loss(written: std::io::Result<()>) {
    if let Err(e) = written
        && e.kind() != std::io::ErrorKind::BrokenPipe
    {
        LOST.get_or_init(|| e.to_string());
    }
}

/// Why something that the process had to say was not read, if that is so.
pub(super) fn lost() -> Option<&'static str> {
    LOST.get().map(String::as_str)
}

/// Writes a line to the standard error, if anyone listens.
pub(super) fn complain(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Each line of the message with `error: ` before it.
pub(super) fn prefixed(e: &Error) -> String {
    e.to_string().lines().map(|line| format!("error: {line}")).collect::<Vec<_>>().join("\n")
}
