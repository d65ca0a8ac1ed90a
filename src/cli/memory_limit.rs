//! `--memory-limit`: the process ends by itself, with a sentence and exit code 33, before the system kills it without.

use crate::batch::memory::resident;
use crate::error::{Error, Result};
use std::time::Duration;

/// The exit code of a process that ends at its limit.
pub const EXIT_CODE: i32 = 33;

/// How often the memory is looked at.
const EVERY: Duration = Duration::from_millis(20);

/// Bytes of `8G`, `500M`, `64K` (powers of 1024) or a number.
pub fn bytes(text: &str) -> std::result::Result<u64, String> {
    let text = text.trim().trim_end_matches(['b', 'B']).trim_end_matches('i');
    let (number, unit) = match text.char_indices().next_back() {
        Some((at, 'k' | 'K')) => (&text[..at], 1 << 10),
        Some((at, 'm' | 'M')) => (&text[..at], 1 << 20),
        Some((at, 'g' | 'G')) => (&text[..at], 1 << 30),
        Some((at, 't' | 'T')) => (&text[..at], 1_u64 << 40),
        _ => (text, 1),
    };
    let number = number.trim().parse::<f64>().ok().filter(|x| *x > 0.0 && x.is_finite());
    number.map(|x| (x * unit as f64) as u64).ok_or_else(|| "expected a size above 0, as 8G or 500M".into())
}

/// Ends the process as soon as more than `limit` bytes of its memory are resident. What is written stays: files come to
/// their names whole.
///
/// # Errors
/// [`Error::Config`] where the system does not tell how much memory a process has; [`Error::Threads`].
pub fn watch(limit: u64) -> Result<()> {
    if resident().is_none() {
        return Err(Error::Config("--memory-limit: this system does not tell how much memory a process has".into()));
    }
    let look = move || {
        loop {
            if let Some(found) = resident().filter(|found| *found > limit) {
                let [found, limit] = [found, limit].map(|bytes| bytes as f64 / (1_u64 << 20) as f64);
                super::complain(&format!(
                    "error: {found:.0} MiB of memory in use, more than --memory-limit, {limit:.0} MiB"
                ));
                std::process::exit(EXIT_CODE);
            }
            std::thread::sleep(EVERY);
        }
    };
    let started = std::thread::Builder::new().name("memory".into()).spawn(look);
    started.map(drop).map_err(|e| Error::Threads { threads: 1, message: e.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!(bytes("8G"), Ok(8 << 30));
        assert_eq!(bytes("500 MiB"), Ok(500 << 20));
        assert_eq!(bytes("1.5k"), Ok(1536));
        assert_eq!(bytes("4096"), Ok(4096));
        assert!(bytes("much").is_err() && bytes("-1G").is_err() && bytes("G").is_err());
    }
}
