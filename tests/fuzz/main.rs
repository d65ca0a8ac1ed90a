//! Input by chance: random scenes, and files that were damaged at random. Each is refused in words with its place or
//! gives a picture of finite numbers, in time. Nothing panics.
//!
//! The draws follow `ABBE_SEED`, which `tools/test` sets to the date; `ABBE_FUZZ=N` draws N scenes and as many files of
//! each kind. `tools/fuzz` runs the long draws, and libFuzzer over the same targets.

#[path = "../common/mod.rs"]
mod common;

mod dice;
mod parsers;
mod scenes;
mod targets;

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The longest that one input may take on one core.
const LIMIT: Duration = Duration::from_secs(10);

/// Time that this thread has had on a core, where the system tells; else what has passed since `start`.
fn spent(start: Instant) -> Duration {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.as_deref().and_then(|text| text.split_whitespace().next()?.parse().ok());
    nanoseconds.map_or_else(|| start.elapsed(), Duration::from_nanos)
}

/// The seed of the day.
fn seed() -> u64 {
    std::env::var("ABBE_SEED").ok().and_then(|n| n.parse().ok()).unwrap_or(0)
}

/// How many inputs: `ABBE_FUZZ`, else `few`.
fn count(few: u64) -> u64 {
    std::env::var("ABBE_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(few)
}

/// Calls `one` with 0 … `count` − 1 on all cores. It answers with what went wrong, which is told with what `shown` says
/// of the input; a panic is a fault, and so is more time than [`LIMIT`].
fn each(count: u64, shown: impl Fn(u64) -> String + Sync, one: impl Fn(u64) -> Result<(), String> + Sync) {
    let next = AtomicU64::new(0);
    let faults = Mutex::new(Vec::new());
    let slowest = Mutex::new(Duration::ZERO);
    let begun = Instant::now();
    let work = || loop {
        let i = next.fetch_add(1, Ordering::Relaxed);
        if i >= count || faults.lock().unwrap().len() >= 3 {
            return;
        }
        let before = spent(begun);
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| one(i)));
        let outcome = outcome.unwrap_or_else(|panic| {
            let words = panic.downcast_ref::<String>().cloned();
            let words = words.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
            Err(format!("panic: {}", words.unwrap_or_default()))
        });
        let took = spent(begun) - before;
        let outcome = outcome.and_then(|()| match took > LIMIT {
            true => Err(format!("took {took:?}")),
            false => Ok(()),
        });
        if let Err(words) = outcome {
            faults.lock().unwrap().push(format!("input {i}: {words}\n{}", shown(i)));
        }
        let mut slowest = slowest.lock().unwrap();
        *slowest = took.max(*slowest);
    };
    // Each thread renders by itself, so that its time is that of its inputs.
    let alone = || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        pool.expect("a pool of this thread").install(work);
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(alone))));
    let faults = faults.into_inner().unwrap();
    assert!(faults.is_empty(), "seed {}:\n{}", seed(), faults.join("\n\n"));
    eprintln!("{count} inputs, the slowest in {:?}", slowest.into_inner().unwrap());
}
