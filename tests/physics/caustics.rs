//! Light of mirrors and glass that is traced from the lights: none is lost, none counted twice.

use super::channels::{job, render_with};
use super::common::{Bench, bench_with};
use abbe::batch::frame::render_part;
use abbe::film::filter::{Filter, FilterSampler};
use abbe::film::resolve::Image;
use abbe::spectrum::ColourSpace;

/// A ball of glass over a floor and before a wall.
const SCENE: &str = "\
camera: {origin: [0, 1.2, 5], target: [0, 0.1, 0], fov_deg: 40, CAMERA}
image: {width: 24, height: 24}
render: {samples: SAMPLES, techniques: {light_tracing: TRACING, packets: PACKETS}}
integrator: {INTEGRATOR: {max_depth: DEPTH}}
materials:
  floor: {diffuse: {reflectance: {rgb: [0.7, 0.5, 0.3]}}}
  glass: MATERIAL
shapes:
- rectangle: {corner: [-3, -1, -2], edge_u: [0, 0, 5], edge_v: [6, 0, 0], material: floor}
- rectangle: {corner: [-3, -1, -2], edge_u: [6, 0, 0], edge_v: [0, 4, 0], material: floor}
- sphere: {name: ball, center: [0.2, -0.2, 0], radius: 0.7, material: glass}
";

/// What a comparison varies.
#[derive(Clone, Copy)]
struct Case {
    what: &'static str,
    camera: &'static str,
    material: &'static str,
    light: &'static str,
    depth: &'static str,
}

const GLASS: &str = "{dielectric: {ior: 1.5}}";
const FLINT: &str = "{dielectric: {ior: {glass: SF11}}}";
const LAMP: &str = "- sphere: {center: [-1.5, 2, 1], radius: 0.5, emission: {illuminant: {name: D65, scale: 10}}}\n";
const AREA: Case = Case { what: "area", camera: "", material: GLASS, light: LAMP, depth: "null" };

/// The same lamp in a room full of fog, and the ball with coloured glass inside.
const FOGGY: &str = "\
- sphere: {center: [-1.5, 2, 1], radius: 0.5, emission: {illuminant: {name: D65, scale: 10}}}
media:
  fog: {homogeneous: {scattering: {rgb: [0.15, 0.1, 0.05]}, absorption: 0.02, phase: {hg: 0.3}}}
  amber: {homogeneous: {absorption: {table: [[360, 3], [450, 2], [550, 0.5], [650, 0.08], [830, 0.02]]}}}
medium: fog
";

impl Case {
    fn scene(&self, integrator: &str, tracing: &str, packets: &str, samples: u32) -> String {
        SCENE
            .replace(", CAMERA", self.camera)
            .replace("MATERIAL", self.material)
            .replace("SAMPLES", &samples.to_string())
            .replace("TRACING", tracing)
            .replace("PACKETS", packets)
            .replace("INTEGRATOR", integrator)
            .replace("DEPTH", self.depth)
            .replace(
                ", material: glass}",
                if self.light == FOGGY { ", material: glass, inside: amber}" } else { ", material: glass}" },
            )
            + self.light
    }

    fn bench(&self, tracing: &str, packets: &str, samples: u32) -> Bench {
        bench_with(&self.scene("path", tracing, packets, samples), &[])
    }
}

fn render(bench: &Bench) -> Image {
    let frame = render_with(bench, Filter::Box, 32);
    assert_eq!(frame.invalid().total(), 0);
    if let Some(splats) = &frame.splats {
        assert!(splats.paths.iter().all(|n| *n > 0));
    }
    frame.resolve(&ColourSpace::Rec709.matrix_from_xyz())
}

/// Mean of the channel over a part of the picture, and its standard error: pixels are independent.
fn part(image: &Image, channel: usize, inside: impl Fn(usize, usize) -> bool) -> (f64, f64) {
    let [width, height] = image.frame.map(|n| n as usize);
    let (mut sum, mut variance, mut n) = (0.0, 0.0, 0.0);
    for y in 0..height {
        for x in 0..width {
            if inside(x, y) {
                sum += f64::from(image.rgb[channel][y * width + x]);
                variance += f64::from(image.standard_error[channel][y * width + x]).powi(2);
                n += 1.0;
            }
        }
    }
    (sum / n, variance.sqrt() / n)
}

/// The whole picture and each of its nine ninths agree in each channel within `sigmas` standard errors of the
/// difference. Of 30 numbers a case, with four replicates a pixel: 4 is an α of 2e-3 a case.
fn assert_agree(what: &str, a: &Image, b: &Image) {
    for channel in 0..3 {
        let ninths = (0..9).map(|k| (k, move |x: usize, y: usize| (x / 8, y / 8) == (k % 3, k / 3)));
        for (k, inside) in ninths {
            let ((a, ea), (b, eb)) = (part(a, channel, inside), part(b, channel, inside));
            let z = (a - b) / ea.hypot(eb);
            assert!(z.abs() < 4.0, "{what}, channel {channel}, part {k}: {a} ± {ea} against {b} ± {eb}, z = {z:.1}");
        }
        let ((a, ea), (b, eb)) = (part(a, channel, |_, _| true), part(b, channel, |_, _| true));
        let z = (a - b) / ea.hypot(eb);
        assert!(z.abs() < 4.0 && ea < 0.02 * a, "{what}, channel {channel}: {a} ± {ea} against {b} ± {eb}");
    }
}

/// Lamps so large that paths from the camera find them in glass and mirrors, too: traced from the lights and by chance,
/// with pinhole and lens, limits of depth, in fog and through coloured glass, with and without dispersion, bumped floors
/// and smooth meshes.
#[test]
fn no_light_is_lost_and_none_counted_twice() {
    let cases = [
        AREA,
        Case { what: "mirror", material: "{mirror: {reflectance: 0.9}}", ..AREA },
        Case { what: "metal", material: "{conductor: {metal: gold}}", ..AREA },
        Case { what: "lens", camera: ", lens: {radius: 0.2, focus_distance: 4}", ..AREA },
        Case { what: "depth 4", depth: "4", ..AREA },
        Case { what: "depth 3", depth: "3", material: "{mirror: {reflectance: 0.9}}", ..AREA },
        Case { what: "fog", light: FOGGY, ..AREA },
    ];
    for case in cases {
        let on = case.bench("on", "auto", 64);
        assert!(on.prepared.plan.caustics.is_some(), "{}", case.what);
        let off = case.bench("off", "auto", 768);
        assert!(off.prepared.plan.caustics.is_none());
        assert_agree(case.what, &render(&on), &render(&off));
    }
}

#[test]
fn wavelengths_that_part_are_all_there_with_and_without_packets() {
    let flint = Case { what: "flint", material: FLINT, ..AREA };
    let off = render(&flint.bench("off", "auto", 1536));
    assert_agree("packets", &render(&flint.bench("on", "on", 96)), &off);
    assert_agree("single", &render(&flint.bench("on", "off", 96)), &off);
}

/// Light without extent, which no path from the camera finds behind glass, against the tracer of all paths from the
/// lights, where the ball is out of the picture: a path through a mirror next to the camera is not its part.
#[test]
fn lights_without_extent_agree_with_the_light_tracer() {
    // Straight down on the floor beside the ball, where its light falls.
    let above = "origin: [1.6, 2, -0.6], target: [1.6, -1, -0.6], fov_deg: 24, up: [0, 0, -1]";
    let place = |text: String| text.replace("origin: [0, 1.2, 5], target: [0, 0.1, 0], fov_deg: 40", above);
    let lights = [
        ("point", "lights: [{point: {position: [-1.5, 2, 1], intensity: {illuminant: {name: D65, scale: 9}}}}]\n"),
        ("spot", "lights: [{spot: {position: [-1.5, 2, 1], target: [0, -0.5, 0], cutoff_deg: 30, intensity: 9}}]\n"),
        ("directional", "lights: [{directional: {direction: [0.5, -1, -0.3], irradiance: 3}}]\n"),
        (
            "beam",
            "- disk: {center: [-1.5, 2, 1], normal: [1.7, -2.2, -1], radius: 0.4, emission: 3, emission_direction: normal}\n",
        ),
    ];
    for (what, light) in lights {
        let case = Case { what, light, ..AREA };
        let on = bench_with(&place(case.scene("path", "on", "auto", 96)), &[]);
        assert!(on.prepared.plan.caustics.is_some(), "{what}");
        let all = bench_with(&place(case.scene("light_tracer", "auto", "auto", 1024)), &[]);
        assert_agree(what, &render(&on), &render(&all));
    }
}

/// Photons are collected in the order of their paths, radii and wavelengths go by the sample's number: no bit depends on
/// threads or tiles.
#[test]
fn merged_light_does_not_depend_on_tiles_threads_or_parts() {
    let case = Case { what: "flint", material: FLINT, ..AREA };
    let bench = case.bench("on", "auto", 12);
    assert!(bench.prepared.plan.caustics.as_ref().unwrap().merging.is_some());
    let run = |threads: usize, tile: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let frame = pool.install(|| render_with(&bench, Filter::Gaussian { stddev: 0.5 }, tile));
        let splats = frame.splats.unwrap();
        (frame.film, splats.film, splats.paths)
    };
    let whole = run(1, 32);
    assert!(whole == run(3, 5), "the sums differ");
    let filter = FilterSampler::new(Filter::Gaussian { stddev: 0.5 }).unwrap();
    let parts = [5..12, 0..5].map(|samples| render_part(&job(&bench, &filter, 8), samples).unwrap());
    let [(mut film, splats), (second, more)] = parts;
    let (mut splats, more) = (splats.unwrap(), more.unwrap());
    film.merge(&second).unwrap();
    splats.film.merge(&more.film).unwrap();
    let paths = std::array::from_fn(|r| splats.paths[r] + more.paths[r]);
    assert!(whole == (film, splats.film, paths), "the sums of two parts differ");
}

/// A closed white box with a lamp and a ball of glass, flint or mirror: what is traced from the light and what from the
/// camera is the same light. Walls reflect 0.8, so light that were lost or counted twice once would show fivefold.
#[test]
fn a_closed_box_keeps_its_light() {
    for material in [GLASS, FLINT] {
        let scene = |tracing: &str, samples: u32| {
            let text = format!(
                "camera: {{origin: [0, 0, 0.95], target: [0, 0, -1], fov_deg: 80}}\n\
                 image: {{width: 24, height: 24}}\n\
                 render: {{samples: {samples}, techniques: {{light_tracing: {tracing}, merging: off}}}}\n\
                 shapes:\n\
                 - cube: {{center: [0, 0, 0], size: 2, flip_normals: true, material: {{diffuse: {{reflectance: 0.8}}}}}}\n\
                 - sphere: {{center: [0.3, -0.4, -0.2], radius: 0.4, material: {material}}}\n\
                 - sphere: {{center: [-0.4, 0.5, 0], radius: 0.2, emission: 1, material: {{diffuse: {{reflectance: 0}}}}}}\n"
            );
            bench_with(&text, &[])
        };
        assert_agree(material, &render(&scene("on", 128)), &render(&scene("off", 512)));
    }
}

/// A camera in the very middle of a mirror, where the distance to it is zero: the radius of merging is not.
#[test]
fn a_camera_in_the_middle_of_a_mirror_sees_its_light() {
    let text = "camera: {origin: [0, 2, 0], target: [0, 0, 0.2], up: [0, 0, 1], fov_deg: 90}\n\
                image: {width: 24, height: 24}\n\
                render: {samples: 16, techniques: {light_tracing: on, merging: on}}\n\
                shapes:\n\
                - rectangle: {corner: [-5, 0, 5], edge_u: [10, 0, 0], edge_v: [0, 0, -10]}\n\
                - cylinder: {base: [0, 1.5, 0], top: [0, 2.5, 0], radius: 0.5, caps: none, flip_normals: true,\n  \
                    material: {mirror: {}}}\n\
                lights:\n\
                - point: {position: [1, 5, 1], intensity: 10}\n";
    let bench = bench_with(text, &[]);
    let radius = bench.prepared.plan.caustics.as_ref().unwrap().merging.unwrap();
    // 2.5 pixels, 2 tan 45° / 24 wide, at no less than the half diagonal of the box around the mirror.
    assert!((radius / (2.5 * 2.0 / 24.0 * 0.75f64.sqrt()) - 1.0).abs() < 1e-12, "{radius}");
    // No sample is invalid.
    render(&bench);
}
