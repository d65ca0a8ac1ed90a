//! What the system asks of a render while it runs: to stop, to show what is done.

use crate::error::Result;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Signals to stop that come within so short a time are one wish: `timeout` sends its own to the process and then to the group that
/// the process is in.
pub const ONE_WISH: Duration = Duration::from_secs(1);

/// Flags that signals set.
#[derive(Clone, Debug, Default)]
pub struct Interrupts {
    /// SIGTERM, SIGINT or SIGHUP came: keep what is done, and end. A second one, later than [`ONE_WISH`], ends the process at once.
    pub stop: Arc<AtomicBool>,
    /// SIGUSR1 came: write a picture of what is done.
    pub snapshot: Arc<AtomicBool>,
}

impl Interrupts {
    /// Sets the flags from now on.
    ///
    /// # Errors
    /// [`Error::System`](crate::error::Error::System) if the system refuses.
    #[cfg(unix)]
    pub fn listen() -> Result<Interrupts> {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
        let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
        let heard = [SIGTERM, SIGINT, SIGUSR1].into_iter().chain(hang_up);
        let mut signals = signal_hook::iterator::Signals::new(heard).map_err(refused)?;
        let all = Interrupts::default();
        let Interrupts { stop, snapshot } = all.clone();
        let hear = move || {
            let mut first: Option<Instant> = None;
            for signal in signals.forever() {
                match (signal, first) {
                    (SIGUSR1, _) => snapshot.store(true, Ordering::Relaxed),
                    (_, None) => {
                        first = Some(Instant::now());
                        stop.store(true, Ordering::Relaxed);
                    }
                    (_, Some(first)) if first.elapsed() < ONE_WISH => {}
                    (_, Some(_)) => signal_hook::low_level::exit(128 + signal),
                }
            }
        };
        std::thread::Builder::new().name("signals".into()).spawn(hear).map_err(refused)?;
        Ok(all)
    }

    /// Other systems have no signals that are asked for here.
    #[cfg(not(unix))]
    pub fn listen() -> Result<Interrupts> {
        Ok(Interrupts::default())
    }
}

/// Whether whoever started the process has it ignore `signal`, as `nohup` does a hang-up; it is ignored from here on in any case.
#[cfg(unix)]
fn is_ignored(signal: std::ffi::c_int) -> bool {
    unsafe extern "C" {
        #[link_name = "signal"]
        fn set(signal: std::ffi::c_int, handler: usize) -> usize;
    }
    // `SIG_IGN` of all systems.
    const IGNORED: usize = 1;
    // SAFETY: no handler of this process is replaced, and what ignores a signal runs no code.
    unsafe { set(signal, IGNORED) == IGNORED }
}

/// Lets a write beyond the limit on the size of files (`ulimit -f`) fail with an error that says so, in the place of SIGXFSZ,
/// which would end the process without a word. Programs that it starts are not touched.
///
/// # Errors
/// [`Error::System`](crate::error::Error::System) if the system refuses.
pub fn take_size_limits_for_errors() -> Result<()> {
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).map_err(refused)?;
    Ok(())
}

/// What keeps the process from hearing signals.
#[cfg(unix)]
fn refused(e: std::io::Error) -> crate::error::Error {
    crate::error::Error::System(format!("cannot listen for signals: {e}"))
}
