//! libFuzzer over every kind of file that Abbe reads: `tools/fuzz` runs it once for each, named by `ABBE_FUZZ_TARGET`.
#![no_main]

#[path = "../targets.rs"]
#[allow(dead_code, reason = "the pieces of scenes are for tests/fuzz")]
mod targets;

use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;
use targets::{TARGETS, Target};

static TARGET: LazyLock<&Target> = LazyLock::new(|| {
    let name = std::env::var("ABBE_FUZZ_TARGET").expect("ABBE_FUZZ_TARGET names a kind of file, as tests/fuzz/targets.rs does");
    TARGETS.iter().find(|target| target.name == name).expect("a kind of file")
});

static PLACE: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().expect("a temporary directory"));

fuzz_target!(|bytes: &[u8]| TARGET.read(bytes, PLACE.path()).expect("a fault in words"));
