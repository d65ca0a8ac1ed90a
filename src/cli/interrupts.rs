//! What the system asks of a render while it runs: to stop, to show what is done.

use crate::error::Result;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Flags that signals set.
#[derive(Clone, Debug, Default)]
pub struct Interrupts {
    /// SIGTERM or SIGINT came: keep what is done, and end. A second one ends the process at once.
    pub stop: Arc<AtomicBool>,
    /// SIGUSR1 came: write a picture of what is done.
    pub snapshot: Arc<AtomicBool>,
}

impl Interrupts {
    /// Sets the flags from now on.
    ///
    /// # Errors
    /// [`Error::Render`](crate::error::Error::Render) if the system refuses.
    #[cfg(unix)]
    pub fn listen() -> Result<Interrupts> {
        use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
        use signal_hook::flag;
        let all = Interrupts::default();
        for (signal, code) in [(SIGTERM, 143), (SIGINT, 130)] {
            // In this order: the first signal finds the flag down, the second one up.
            flag::register_conditional_shutdown(signal, code, all.stop.clone()).map_err(refused)?;
            flag::register(signal, all.stop.clone()).map_err(refused)?;
        }
        flag::register(SIGUSR1, all.snapshot.clone()).map_err(refused)?;
        Ok(all)
    }

    /// Other systems have no signals that are asked for here.
    #[cfg(not(unix))]
    pub fn listen() -> Result<Interrupts> {
        Ok(Interrupts::default())
    }
}

/// Lets a write beyond the limit on the size of files (`ulimit -f`) fail with an error that says so, in the place of SIGXFSZ,
/// which would end the process without a word. Programs that it starts are not touched.
///
/// # Errors
/// [`Error::Render`](crate::error::Error::Render) if the system refuses.
pub fn take_size_limits_for_errors() -> Result<()> {
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).map_err(refused)?;
    Ok(())
}

/// What keeps the process from hearing signals.
#[cfg(unix)]
fn refused(e: std::io::Error) -> crate::error::Error {
    crate::error::Error::Render(format!("cannot listen for signals: {e}"))
}
