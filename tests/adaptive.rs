//! Samples go where the noise is, and nothing else changes: the same bits however the work is cut, and the same mean.

mod common;

use abbe::batch::checkpoint::Keep;
use abbe::batch::frame::Progress;
use abbe::batch::report::{SceneReport, Status};
use abbe::batch::{self, Overrides, Portion, Samples, Turn, Watcher, merge};
use abbe::film::exr::read_exr;
use abbe::math::statistics::Moments;
use abbe::spectrum::ColourSpace;
use common::place::{Place, pixels};
use common::{Bench, bench_with, on_threads, sums};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A picture of 44 × 30 pixels, which cells do not divide: a bright floor, a ball of glass, light from the lights.
fn scene(render: &str) -> String {
    format!(
        "camera: {{origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}}\n\
         image: {{width: 44, height: 30}}\n\
         output: {{exr: {{precision: float, stderr: true}}}}\n\
         layers:\n- {{name: n, surface: shading_normal}}\n- caustic\n- indirect\n- Z\n\
         render: {{samples: 64, techniques: {{adaptive: on, merging: off, light_tracing: on}}, {render}}}\n\
         shapes:\n\
         - plane: {{normal: [0, 1, 0]}}\n\
         - sphere: {{center: [0, 1, 0], radius: 1, material: {{dielectric: {{ior: {{glass: N-SF11}}}}}}}}\n\
         - sphere: {{center: [1, 3, 1], radius: 0.2, emission: 20}}\n"
    )
}

#[test]
fn threads_tiles_and_all_effects_do_not_change_a_bit() {
    let film = |threads, render: &str| on_threads(threads, || bench_with(&scene(render), &[]).film());
    let reference = film(1, "tile: 32");
    let counts: Vec<u32> = reference.cells().iter().map(|c| c.iter().map(|c| c.count + c.dropped).sum()).collect();
    let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
    assert!(*least == 16 && *most >= 128, "{least} to {most} samples");
    assert!(reference.cells().iter().any(|c| c[0].count != c[3].count), "halves differ somewhere");
    for (threads, render) in [(2, "tile: 8"), (1, "tile: 5"), (2, "tile: 1"), (2, "effects: all")] {
        assert!(sums(&film(threads, render)) == sums(&reference), "{threads} threads, {render}");
    }
}

/// A lit edge moves over a black picture while the shutter is open: the noise of its way is what the pilot has to see, or the shares come
/// to eight times the samples that were asked for. Half or thrice of them is what it may come to where noise is in few cells.
#[test]
fn the_pilot_sees_what_moves() {
    let film = bench_with(
        "camera: {to_world: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 5], [0, 0, 0, 1]], orthographic_height: 64, \
         shutter: {open: -0.5, close: 0.5, moments: 16}}\nimage: {width: 64, height: 64}\n\
         render: {samples: 64, frames: 4, techniques: {adaptive: on}}\nintegrator: {path: {max_depth: 1}}\nshapes:\n\
         - rectangle: {corner: [-100, -100, 0], edge_u: [100, 0, 0], edge_v: [0, 200, 0], emission: 1, \
         transform: [{translate: [{3: -24, 4: 0, 5: 24}, 0, 0]}]}\n\
         - sphere: {center: [26.5, 26.5, 1], radius: 0.45, emission: 1}\n",
        &[],
    )
    .film();
    let all: u32 = film.cells().iter().flatten().map(|cell| cell.count).sum();
    let mean = f64::from(all) / film.cells().len() as f64;
    assert!((32.0..192.0).contains(&mean), "{mean}");
}

fn render(
    place: &Place,
    out: &str,
    portion: Portion,
    keep: Keep,
    watcher: &dyn Watcher,
    stop: &AtomicBool,
) -> SceneReport {
    let overrides = Overrides { output: Some(place.path(out)), portion, keep, ..Overrides::default() };
    let mut report = batch::render_batch(&place.path("scene.yaml"), &overrides, watcher, stop).unwrap();
    report.scenes.swap_remove(0)
}

fn whole(place: &Place) -> PathBuf {
    let report = render(place, "whole.exr", Portion::default(), Keep::default(), &(), &AtomicBool::new(false));
    assert!(matches!(report.status, Status::Done), "{:?}", report.status);
    let counts = report.adaptive.unwrap();
    assert!(counts.least == 16 && counts.most > 64 && (40.0..100.0).contains(&counts.mean), "{counts:?}");
    let file = read_exr(&place.path("whole.exr")).unwrap();
    let written = file.parts[0].text("abbe/adaptiveSamples").unwrap();
    assert!(written.starts_with("least 16, mean "), "{written}");
    place.path("whole.exr")
}

#[test]
fn parts_by_rows_of_cells_are_the_picture_bit_for_bit() {
    let place = Place::of(&scene("seed: 3"));
    let whole = whole(&place);
    let tile = |i, n| Portion { tile: Some([i, n]), samples: None };
    let go = AtomicBool::new(false);
    for n in [1, 3, 4] {
        let parts: Vec<PathBuf> = (0..n)
            .map(|i| {
                let name = format!("{i}of{n}.exr");
                let report = render(&place, &name, tile(i, n), Keep::default(), &(), &go);
                assert!(matches!(report.status, Status::Done), "{:?}", report.status);
                place.path(&name)
            })
            .collect();
        let merged = place.path(&format!("merged{n}.exr"));
        merge::merge(&parts, &merged, None).unwrap().1.unwrap();
        assert!(pixels(&merged) == pixels(&whole), "{n} parts");
    }
    let refused = |portion| match render(&place, "x.exr", portion, Keep::default(), &(), &go).status {
        Status::Failed { exit_code: 2, message } => message,
        other => panic!("{other:?}"),
    };
    let message = refused(tile(0, 5));
    assert!(message.contains("n at most 4, the rows of cells of adaptive sampling"), "{message}");
    let message = refused(Portion { tile: None, samples: Some(Samples::Range([0, 31])) });
    assert!(message.contains("--samples 0-31: expected --tile i/n or render.techniques.adaptive: off"), "{message}");
}

/// The pilot goes over the whole picture for each part. Its paths are none of the picture, and were counted once for each.
#[test]
fn parts_count_what_robust_arithmetic_was_needed_for_as_one_render_does() {
    let place = Place::of(&scene("seed: 3"));
    let counts = |portion: Portion| {
        let output = Some(place.path("out"));
        let overrides = Overrides { output, portion, check_numerics: true, ..Overrides::default() };
        let stop = AtomicBool::new(false);
        let report = batch::render_batch(&place.path("scene.yaml"), &overrides, &(), &stop).unwrap();
        report.scenes[0].numerics.unwrap()
    };
    let parts = (0..3).map(|i| counts(Portion { tile: Some([i, 3]), samples: None }));
    assert_eq!(merge::sum(parts), Some(counts(Portion::default())));
}

/// Stops the render after so many units of work.
struct StopAfter<'a>(AtomicU64, &'a AtomicBool);

impl Watcher for StopAfter<'_> {
    fn scene_begins(&self, _: Turn, _: &str) {}
    fn progress(&self, _: Progress) {
        if self.0.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.1.store(true, Ordering::Relaxed);
        }
    }
    fn scene_ends(&self, _: &SceneReport) {}
}

/// Stopped after every 37 units, which is before the samples are shared out, at once after, and in the midst.
#[test]
fn stopped_anywhere_and_resumed_the_pixels_are_those_of_one_go() {
    let place = Place::of(&scene("tile: 8"));
    let whole = whole(&place);
    let keep = || Keep { on_stop: true, resume: true, ..Keep::default() };
    for units in [37, 48] {
        let out = format!("{units}.exr");
        let stops = (0..1000).position(|_| {
            let stop = AtomicBool::new(false);
            let report =
                render(&place, &out, Portion::default(), keep(), &StopAfter(AtomicU64::new(units), &stop), &stop);
            matches!(report.status, Status::Done)
        });
        assert!(stops.unwrap() >= 4, "stopped {stops:?} times");
        assert!(pixels(&place.path(&out)) == pixels(&whole), "stopped after every {units} units");
    }
}

/// Where it cannot be, it is off and says why.
#[test]
fn adaptive_sampling_is_off_where_it_would_not_be_exact() {
    let said = |change: &[(&str, &str)]| {
        let mut text = scene("seed: 1");
        for (from, to) in change {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        let bench = bench_with(&text, &[]);
        let plan = &bench.prepared.plan;
        let said = plan.techniques.iter().find(|t| t.name == "adaptive sampling");
        assert_eq!(plan.adaptive.is_some(), said.is_some_and(|t| t.on));
        said.map_or(String::new(), |t| t.reason.clone())
    };
    assert_eq!(said(&[]), "cells of 8 x 8 pixels, told by 16 samples");
    assert!(said(&[("adaptive: on", "adaptive: off")]).contains("the scene says so"));
    let auto = ("adaptive: on", "adaptive: auto");
    assert_eq!(said(&[auto]), "neither an error nor a time ends the render");
    let open = ("seed: 1", "stop: {error: 0.1}");
    assert!(said(&[open]).ends_with("told by 32 samples"));
    // It would take four sums of each layer.
    assert_eq!(said(&[auto, open]), "layers would be summed by replicate");
    let bare = ("layers:\n- {name: n, surface: shading_normal}\n- caustic\n- indirect\n- Z\n", "");
    assert!(said(&[auto, open, bare]).ends_with("told by 32 samples, where that is expected to save time"));
    assert!(said(&[("merging: off", "merging: on")]).contains("photons are collected"));
    assert!(said(&[("samples: 64", "samples: 15")]).contains("fewer than 16 samples"));
    // Layers of light go with it, beside which nothing is traced from the lights.
    let untraced = ("light_tracing: on", "light_tracing: off");
    let with_light = said(&[("surface: shading_normal", "light: depth"), untraced]);
    assert_eq!(with_light, "cells of 8 x 8 pixels, told by 16 samples");
    let no_layers = ("layers:\n- {name: n, surface: shading_normal}\n- caustic\n- indirect\n- Z\n", "");
    let no_paths = "no paths start from the camera";
    assert_eq!(said(&[no_layers, ("shapes:", "integrator: whitted\nshapes:")]), no_paths);
    assert_eq!(said(&[no_layers, ("shapes:", "integrator: light_tracer\nshapes:")]), no_paths);
}

/// A floor lit by a lamp that is met by chance alone: in a pixel one path in some hundred brings nearly all of the light.
/// The mean of many adaptive renders is that of uniform ones within four standard errors, over all pixels; the squares
/// of the deviations of single pixels over theirs have the mean one: means of heavy tails are nearly normal after so many
/// renders, so that the mean over 256 pixels scatters by √(2/256), and four times that is 0.35.
///
/// With each half's number told by what it shows itself the test fails: z −4.4 and 1.41, and −9.1 and 1.67 for 1000 renders of
/// 16 samples, where halves told by each other have 0.7 and 0.97. Under the Gaussian, whose samples count for several pixels, halves that make
/// up for what their weights lack by each other's light have z −3.7 over 200 renders; of its pixels, which are not independent of each
/// other, only the mean is held.
#[test]
fn the_mean_of_adaptive_renders_is_that_of_uniform_ones() {
    let renders: u64 = if std::env::var_os("ABBE_NIGHTLY").is_some() { 1000 } else { 400 };
    for filter in ["box", "{gaussian: {stddev: 0.5}}"] {
        let text = |adaptive: &str| {
            format!(
                "camera: {{origin: [0, 3, 4], target: [0, 0, 0], fov_deg: 40}}\n\
             image: {{width: 16, height: 16, filter: {filter}}}\n\
             integrator: {{path: {{max_depth: 2, light_samples: 0}}}}\n\
             render: {{samples: 32, techniques: {{adaptive: {adaptive}}}}}\n\
             shapes:\n\
             - plane: {{normal: [0, 1, 0]}}\n\
             - sphere: {{center: [0.5, 2, 0], radius: 0.3, emission: 20}}\n"
            )
        };
        let values = |bench: &mut Bench, seed: u64| -> Vec<f64> {
            bench.prepared.description.render.seed = seed;
            let image = bench.frame().resolve(&ColourSpace::Rec709.matrix_from_xyz());
            image.rgb[1].iter().map(|x| f64::from(*x)).collect()
        };
        let of = |adaptive: &str, first: u64, renders: u64| -> (Vec<Moments>, Moments) {
            let mut bench = bench_with(&text(adaptive), &[]);
            assert_eq!(bench.prepared.plan.adaptive.is_some(), adaptive == "on");
            let (mut pixels, mut all) = (vec![Moments::default(); 256], Moments::default());
            for seed in first..first + renders {
                let values = values(&mut bench, seed);
                all.push(values.iter().sum::<f64>() / 256.0);
                pixels.iter_mut().zip(values).for_each(|(moments, x)| moments.push(x));
            }
            (pixels, all)
        };
        let (uniform, uniform_mean) = of("off", 1 << 32, 2 * renders);
        let (adaptive, adaptive_mean) = of("on", 0, renders);
        let z = |a: &Moments, b: &Moments| (a.mean - b.mean) / a.standard_error().hypot(b.standard_error());
        let global = z(&adaptive_mean, &uniform_mean);
        let squares: f64 = adaptive.iter().zip(&uniform).map(|(a, b)| z(a, b).powi(2)).sum::<f64>() / 256.0;
        assert!(
            global.abs() < 4.0 && (filter != "box" || (squares - 1.0).abs() < 0.35),
            "{filter}: z {global:.2}, squares {squares:.3}; means {} and {}",
            adaptive_mean.mean,
            uniform_mean.mean
        );
    }
}

/// Of two cells one has eight dots of a 256th of their pixels, all the light that there is; an error ends the render. Whether samples are shared
/// out at all is a decision, too, that a half must not take by what it averages: taken by both halves, or not at all where one has met
/// nothing, the mean is too low by 5.5 % ± 0.8 % over 1000 seeds, of which 2000 would show 9.7 standard errors. Held are four.
#[test]
fn the_mean_does_not_depend_on_whether_samples_are_shared_out() {
    let renders: u64 = if std::env::var_os("ABBE_NIGHTLY").is_some() { 10_000 } else { 2000 };
    let radius = (1.0 / 256.0 / std::f64::consts::PI).sqrt();
    let dots: String = [1, 3, 4, 6]
        .into_iter()
        .flat_map(|x| [2, 5].map(|y| [f64::from(x) - 7.5, 3.5 - f64::from(y)]))
        .map(|[x, y]| format!("- disk: {{center: [{x}, {y}, 0], normal: [0, 0, 1], radius: {radius}, emission: 1}}\n"))
        .collect();
    let bench = |adaptive: &str| {
        bench_with(
            &format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], orthographic_height: 8}}\n\
                 image: {{width: 16, height: 8, filter: box}}\n\
                 integrator: {{path: {{max_depth: 1}}}}\n\
                 render: {{stop: {{error: 1.0e-9, samples: 64}}, techniques: {{adaptive: {adaptive}, glints: off}}}}\n\
                 shapes:\n{dots}"
            ),
            &[],
        )
    };
    let total = |bench: &mut Bench, seed: u64| -> f64 {
        bench.prepared.description.render.seed = seed;
        let image = bench.frame().resolve(&ColourSpace::Rec709.matrix_from_xyz());
        image.rgb[1].iter().map(|x| f64::from(*x)).sum()
    };
    let mut off = bench("off");
    let uniform: Vec<f64> = (0..renders).map(|seed| total(&mut off, seed)).collect();
    for wish in ["on", "auto"] {
        let mut adaptive = bench(wish);
        // Of the same seed the first samples are the same.
        let mut differences = Moments::default();
        (0..renders).for_each(|seed| differences.push(total(&mut adaptive, seed) - uniform[seed as usize]));
        assert!(differences.standard_error() > 0.0, "{wish}: some are shared out");
        let z = differences.mean / differences.standard_error();
        println!("{wish}: z {z}, {} of {}", differences.mean, uniform.iter().sum::<f64>() / renders as f64);
        assert!(z.abs() < 4.0, "{wish}: z {z}");
    }
}

/// Where samples count for several pixels, or paths are shared, less noise is left than a pixel by itself shows. What is shared out is what was asked for all
/// the same, to the fifth that a pilot of 64 cells with shares of 1/4 to 2 is uncertain by (one standard deviation 0.6 / √64), twice, and
/// the roundings to powers of two.
#[test]
fn dealt_samples_are_as_many_as_were_asked_for() {
    for (filter, reuse) in [("{gaussian: {stddev: 0.8}}", "off"), ("{tent: {radius: 2}}", "off"), ("box", "on")] {
        let film = bench_with(
            &format!(
                "camera: {{origin: [0, 1.6, 6], target: [0, 0.9, 0], fov_deg: 40}}\n\
                 image: {{width: 64, height: 64, filter: {filter}}}\n\
                 render: {{samples: 64, techniques: {{adaptive: on, shadow_rays: 1, reuse: {reuse}}}}}\n\
                 shapes:\n\
                 - plane: {{normal: [0, 1, 0]}}\n\
                 - sphere: {{center: [0, 1, 0], radius: 0.8, material: {{plastic: {{reflectance: 0.4, roughness: 0.2}}}}}}\n\
                 - sphere: {{center: [-3, 5, 4], radius: 1.5, emission: 8}}\n\
                 lights: [constant: {{radiance: 0.3}}]\n"
            ),
            &[],
        )
        .film();
        let all: u64 = film.cells().iter().flatten().map(|cell| u64::from(cell.count)).sum();
        let mean = all as f64 / film.cells().len() as f64;
        println!("{filter}, {reuse}: {mean}");
        assert!((mean / 64.0 - 1.0).abs() < 0.2, "{filter}, {reuse}: {mean}");
    }
}

/// Of one cell to sixteen a pixel a quarter told so little that pictures of which 64 samples were asked for took 32 to 256. The share of a
/// cell is the square root of a ratio of variances that 64 pixels show each, uncertain by some tenth; then both of its halves
/// are rounded to powers of two, by no more than √2, so that each picture is within 3/2, and the mean of many is nearer.
#[test]
fn pictures_of_few_cells_take_as_many_samples_as_were_asked_for() {
    for [width, height] in [[8, 8], [16, 8], [16, 16], [24, 24]] {
        let mean = |seed: u64| {
            let text = format!(
                "camera: {{origin: [0, 1.6, 6], target: [0, 0.9, 0], fov_deg: 40}}\n\
                 image: {{width: {width}, height: {height}, filter: box}}\n\
                 render: {{samples: 64, seed: {seed}, techniques: {{adaptive: on, shadow_rays: 1, reuse: off}}}}\n\
                 shapes:\n\
                 - plane: {{normal: [0, 1, 0]}}\n\
                 - sphere: {{center: [0, 1, 0], radius: 0.8, material: {{plastic: {{reflectance: 0.4, roughness: 0.2}}}}}}\n\
                 - sphere: {{center: [-3, 5, 4], radius: 1.5, emission: 8}}\n\
                 lights: [constant: {{radiance: 0.3}}]\n"
            );
            let film = bench_with(&text, &[]).film();
            let all: u64 = film.cells().iter().flatten().map(|cell| u64::from(cell.count)).sum();
            all as f64 / film.cells().len() as f64
        };
        let means: Vec<f64> = (1..=8).map(mean).collect();
        let all = means.iter().sum::<f64>() / means.len() as f64;
        println!("{width} x {height}: {all}, {means:?}");
        assert!(means.iter().all(|mean| (64.0 / 1.5..=64.0 * 1.5).contains(mean)), "{width} x {height}: {means:?}");
        assert!((all / 64.0 - 1.0).abs() < 0.2, "{width} x {height}: {means:?}");
    }
}
