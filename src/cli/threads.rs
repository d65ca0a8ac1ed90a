//! How many threads a process has.

use crate::error::{Error, Result};

/// More threads than this help nobody: so many processors a process is bound to at the most (Linux, `cpu_set_t`).
pub(super) const MOST_THREADS: usize = 1024;

/// Makes the pool of as many threads as were asked for, else as the farm grants, else as the cpuset has cores; the latter
/// where nothing is rendered, too (`None`). Renders do not block, so the pool may be the global one; a second call in one
/// process keeps it.
///
/// # Errors
/// [`Error::Config`] where the farm grants more than can be meant; [`Error::Threads`] where the system has none to give.
pub(super) fn use_threads(asked: Option<usize>) -> Result<()> {
    let granted = ["SLURM_CPUS_PER_TASK", "CUE_THREADS", "OMP_NUM_THREADS"];
    let granted = || {
        let set = |v| Some((v, std::env::var_os(v).filter(|text| !text.is_empty())?));
        let Some((by, text)) = granted.into_iter().find_map(set) else { return Ok(None) };
        let text = text.to_string_lossy();
        // Of a list, as of OpenMP, the first is for what begins.
        match text.split(',').next().unwrap_or_default().trim().parse() {
            Ok(0) => Ok(None),
            Ok(n) => Ok(Some((by, n))),
            Err(_) => Err(Error::Config(format!("{by}: expected a number of threads, found {text:?}"))),
        }
    };
    let wanted = match asked {
        None => None,
        Some(0) => granted()?,
        Some(n) => Some(("--threads", n)),
    };
    let threads = match wanted {
        Some((by, n)) if n > MOST_THREADS => {
            return Err(Error::Config(format!("{by}: expected at most {MOST_THREADS} threads, found {n}")));
        }
        Some((_, n)) => n,
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build_global() {
        // Without a cause it is that there is a pool already.
        Err(e) if std::error::Error::source(&e).is_some() => Err(Error::Threads { threads, message: e.to_string() }),
        _ => Ok(()),
    }
}
