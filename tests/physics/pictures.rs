//! Whole pictures: rendered, summed up and compared.

use super::common::{Bench, bench_with};
use abbe::batch::frame::{self, Frame, FrameJob};
use abbe::film::accumulate::{Film, REPLICATES};
use abbe::film::filter::{Filter, FilterSampler};
use abbe::film::resolve::Image;
use abbe::spectrum::ColourSpace;
use std::sync::atomic::AtomicBool;

/// A camera of parallel rays that looks along −z at 2 m × 2 m about the origin, from five metres.
pub(super) const PARALLEL: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], orthographic_height: 2}\n";

/// What renders a scene with tiles of `tile` pixels.
pub(super) fn job<'a>(bench: &'a Bench, filter: &'a FilterSampler, tile: u32) -> FrameJob<'a> {
    FrameJob { tile, ..bench.prepared.job(filter) }
}

/// The picture of a scene.
pub(super) fn render_with(bench: &Bench, filter: Filter, tile: u32) -> Frame {
    let filter = FilterSampler::new(filter).unwrap();
    frame::render(&job(bench, &filter, tile), &|_| {}, &AtomicBool::new(false)).unwrap()
}

/// What the paths of the camera and of the lights add up to on `threads` threads with tiles of `tile` pixels, and how many
/// the latter are.
pub(super) fn sums(bench: &Bench, threads: usize, tile: u32) -> (Film, Film, [u64; REPLICATES]) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let frame = pool.install(|| render_with(bench, Filter::Gaussian { stddev: 0.5 }, tile));
    let splats = frame.splats.unwrap();
    (frame.film, splats.film, splats.paths)
}

/// The picture of a scene that names no files.
pub(super) fn render(yaml: &str) -> Frame {
    render_with(&bench_with(yaml, &[]), Filter::Box, 32)
}

/// Mean luminance of a picture with its standard error.
pub(super) fn luminance(frame: &Frame) -> (f64, f64) {
    let Image { rgb, standard_error, .. } = frame.resolve(&ColourSpace::Xyz.matrix_from_xyz());
    let n = rgb[1].len() as f64;
    let mean = rgb[1].iter().map(|y| f64::from(*y)).sum::<f64>() / n;
    (mean, standard_error[1].iter().map(|e| f64::from(*e).powi(2)).sum::<f64>().sqrt() / n)
}

/// Two pictures have the same mean luminance, within three standard errors of the difference, and it is known to 2 %.
pub(super) fn assert_agree(what: &str, a: &Frame, b: &Frame) {
    let ((a, ea), (b, eb)) = (luminance(a), luminance(b));
    let z = (a - b) / ea.hypot(eb);
    assert!(z.abs() < 3.0 && ea < 0.02 * a, "{what}: {a} ± {ea} against {b} ± {eb}, z = {z:.1}");
}
