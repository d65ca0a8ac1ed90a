//! Abbe, a spectral batch renderer.
//!
//! Rooms, from the ground up; a room may use rooms below its own, never beside or above
//! (`tests/layers.rs` holds the picture):
//!
//! ```text
//!  main.rs  memory.rs  cli/      process edge: allocator | arguments in, exit code and messages out
//!  batch/                        jobs, work units, threads, report
//!  transport/                    which effects, which paths, how much light
//!  scene/                        compiled, immutable, Send + Sync; what rays meet
//!  optics/  film/  description/  light at one point | samples to files | what a person wrote
//!  spectrum/                     wavelengths, spectra, observer, refractive indices
//!  math/  error.rs  input.rs     rays, frames, warps, random numbers, statistics | the one error enum | files that are read
//! ```
pub mod batch;
pub mod cli;
pub mod description;
pub mod error;
pub mod film;
pub mod input;
pub mod math;
pub mod optics;
pub mod scene;
pub mod spectrum;
pub mod transport;
