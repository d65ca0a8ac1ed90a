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

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

/// The longest that one input may take on one core where [`yardstick`] takes [`YARDSTICK`] or less; in proportion on a
/// slower machine and in a slower build.
const LIMIT: Duration = Duration::from_secs(10);

/// What [`yardstick`] takes as tests are built, on a core of a server (measured: 19 ms).
const YARDSTICK: Duration = Duration::from_millis(20);

/// Time that this thread has had on a core, where the system tells; else what has passed since `start`.
fn spent(start: Instant) -> Duration {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.as_deref().and_then(|text| text.split_whitespace().next()?.parse().ok());
    nanoseconds.map_or_else(|| start.elapsed(), Duration::from_nanos)
}

/// What a plain scene takes in this build on a core of this machine: the least of three.
fn yardstick() -> Duration {
    let scene = "camera: {origin: [0, 1, 5], target: [0, 0.5, 0], fov_deg: 40}\nimage: {width: 32, height: 32}\n\
        render: {samples: 16}\nlights: [constant: {radiance: 1}]\nmedia: {mist: {homogeneous: {scattering: 2}}}\n\
        shapes:\n- plane: {normal: [0, 1, 0]}\n- sphere: {center: [-1, 1, 0], radius: 1, material: {dielectric: {ior: 1.5}}}\n\
        - sphere: {center: [1, 1, 0], radius: 1, material: {boundary: {}}, inside: mist}\n";
    let bench = common::bench_with(scene, &[]);
    let begun = Instant::now();
    let once = |_| {
        let before = spent(begun);
        drop(bench.film());
        spent(begun) - before
    };
    (0..3).map(once).min().unwrap_or_default()
}

/// [`LIMIT`] here.
fn limit() -> Duration {
    static HERE: OnceLock<Duration> = OnceLock::new();
    *HERE.get_or_init(|| {
        let took = yardstick();
        let limit = LIMIT.mul_f64((took.as_secs_f64() / YARDSTICK.as_secs_f64()).max(1.0));
        eprintln!("a plain scene in {took:?}: at most {limit:?} for each input");
        limit
    })
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
/// of the input; a panic is a fault, and so is more time than [`limit`].
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
        let limit = limit();
        let before = spent(begun);
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| one(i)));
        let outcome = outcome.unwrap_or_else(|panic| {
            let words = panic.downcast_ref::<String>().cloned();
            let words = words.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
            Err(format!("panic: {}", words.unwrap_or_default()))
        });
        let took = spent(begun) - before;
        let outcome = outcome.and_then(|()| match took > limit {
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
