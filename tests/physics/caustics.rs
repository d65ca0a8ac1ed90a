//! Light of mirrors and glass that is traced from the lights: none is lost, none counted twice.

use super::common::{Bench, bench_with, grey_png};
use super::pictures::{job, render_with, sums};
use super::traced::techniques;
use abbe::batch::part::render_part;
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
  floor: FLOOR
  glass: MATERIAL
shapes:
- rectangle: {corner: [-3, -1, -2], edge_u: [0, 0, 5], edge_v: [6, 0, 0], material: floor}
- rectangle: {corner: [-3, -1, -2], edge_u: [6, 0, 0], edge_v: [0, 4, 0], material: floor}
- CASTER
";

pub(super) const BALL: &str = "sphere: {name: ball, center: [0.2, -0.2, 0], radius: 0.7, material: glass}";

/// What a comparison varies.
#[derive(Clone, Copy)]
pub(super) struct Case {
    pub(super) what: &'static str,
    pub(super) camera: &'static str,
    pub(super) material: &'static str,
    pub(super) light: &'static str,
    pub(super) depth: &'static str,
    pub(super) caster: &'static str,
    pub(super) floor: &'static str,
}

pub(super) const GLASS: &str = "{dielectric: {ior: 1.5}}";
const FLINT: &str = "{dielectric: {ior: {glass: SF11}}}";
pub(super) const LAMP: &str =
    "- sphere: {center: [-1.5, 2, 1], radius: 0.5, emission: {illuminant: {name: D65, scale: 10}}}\n";
const FLOOR: &str = "{diffuse: {reflectance: {rgb: [0.7, 0.5, 0.3]}}}";
pub(super) const AREA: Case =
    Case { what: "area", camera: "", material: GLASS, light: LAMP, depth: "null", caster: BALL, floor: FLOOR };

/// A lamp without extent there.
pub(super) const POINT: &str = "lights: [{point: {position: [-1.5, 2, 1], intensity: 9}}]\n";

/// The same lamp, and a pane.
pub(super) const PANE: &str = "\
- sphere: {center: [-1.5, 2, 1], radius: 0.5, emission: {illuminant: {name: D65, scale: 10}}}
- rectangle: {corner: [-1, 1, -1], edge_u: [0, 0, 1], edge_v: [1, 0, 0], material: {thin_dielectric: {ior: 1.5}}}
";

/// The same lamp, and a picture of hills and valleys.
const WAVES: &str = "\
- sphere: {center: [-1.5, 2, 1], radius: 0.5, emission: {illuminant: {name: D65, scale: 10}}}
textures:
  waves: {image: {file: waves.png, raw: true}}
";

/// The same lamp in a room full of fog, and the ball with coloured glass inside.
const FOGGY: &str = "\
- sphere: {center: [-1.5, 2, 1], radius: 0.5, emission: {illuminant: {name: D65, scale: 10}}}
media:
  fog: {homogeneous: {scattering: {rgb: [0.15, 0.1, 0.05]}, absorption: 0.02, phase: {hg: 0.3}}}
  amber: {homogeneous: {absorption: {table: [[360, 3], [450, 2], [550, 0.5], [650, 0.08], [830, 0.02]]}}}
medium: fog
";

impl Case {
    pub(super) fn scene(&self, integrator: &str, tracing: &str, packets: &str, samples: u32) -> String {
        SCENE
            .replace(", CAMERA", self.camera)
            .replace("CASTER", self.caster)
            .replace("FLOOR", self.floor)
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

    pub(super) fn bench(&self, tracing: &str, packets: &str, samples: u32) -> Bench {
        let hill = |x: u32| 64.0 * (1.0 + (f64::from(x) * std::f64::consts::TAU / 16.0).sin());
        let waves = grey_png(16, 16, |x, y| (hill(x) + hill(y)) as u8);
        let meshes = [("round.obj", ROUND_OBJ.as_bytes()), ("slab.obj", SLAB_OBJ.as_bytes())];
        bench_with(&self.scene("path", tracing, packets, samples), &[meshes[0], meshes[1], ("waves.png", &waves)])
    }
}

/// A coarse ball whose normals are those of a fine one: an octahedron, cut once.
const ROUND: &str = "mesh: {name: ball, file: round.obj, normals: smooth, material: glass, \
    transform: [{scale: 0.7}, {translate: [0.2, -0.2, 0]}]}";
const ROUND_OBJ: &str = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n\
    v 0.7071 0.7071 0\nv 0.7071 -0.7071 0\nv -0.7071 0.7071 0\nv -0.7071 -0.7071 0\n\
    v 0.7071 0 0.7071\nv 0.7071 0 -0.7071\nv -0.7071 0 0.7071\nv -0.7071 0 -0.7071\n\
    v 0 0.7071 0.7071\nv 0 0.7071 -0.7071\nv 0 -0.7071 0.7071\nv 0 -0.7071 -0.7071\n\
    f 1 7 11\nf 3 15 7\nf 5 11 15\nf 7 15 11\nf 1 12 7\nf 3 7 16\nf 6 16 12\nf 7 12 16\n\
    f 1 11 8\nf 4 8 17\nf 5 17 11\nf 8 11 17\nf 1 8 12\nf 4 18 8\nf 6 12 18\nf 8 18 12\n\
    f 2 13 9\nf 3 9 15\nf 5 15 13\nf 9 13 15\nf 2 9 14\nf 3 16 9\nf 6 14 16\nf 9 16 14\n\
    f 2 10 13\nf 4 17 10\nf 5 13 17\nf 10 17 13\nf 2 14 10\nf 4 10 18\nf 6 18 14\nf 10 14 18\n";

/// A slab without sides. The normals of its lower face lean toward −x.
const SLAB: &str = "mesh: {name: ball, file: slab.obj, material: glass}";
const SLAB_OBJ: &str = "v -0.6 0 -0.6\nv -0.6 0 0.6\nv 0.9 0 0.6\nv 0.9 0 -0.6\n\
    v -0.6 -0.3 -0.6\nv -0.6 -0.3 0.6\nv 0.9 -0.3 0.6\nv 0.9 -0.3 -0.6\nvn 0 1 0\nvn -0.894 -0.447 0\n\
    f 1//1 2//1 3//1\nf 1//1 3//1 4//1\nf 5//2 7//2 6//2\nf 5//2 8//2 7//2\n";

/// The picture of a scene: no sample is invalid, and where light is traced each replicate has paths.
pub(super) fn render(bench: &Bench) -> Image {
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

/// The whole picture and each of its nine ninths agree in each channel within four standard errors of the
/// difference. Of 30 numbers a case, with four replicates a pixel: 4 is an α of 2e-3 a case.
pub(super) fn assert_agree(what: &str, a: &Image, b: &Image) {
    for channel in 0..3 {
        let ninths = (0..9).map(|k| (k, move |x: usize, y: usize| (x / 8, y / 8) == (k % 3, k / 3)));
        for (k, inside) in ninths {
            let ((a, ea), (b, eb)) = (part(a, channel, inside), part(b, channel, inside));
            let z = (a - b) / ea.hypot(eb);
            assert!(z.abs() < 4.0, "{what}, channel {channel}, part {k}: {a} ± {ea} against {b} ± {eb}, z = {z:.1}");
        }
        let ((a, ea), (b, eb)) = (part(a, channel, |_, _| true), part(b, channel, |_, _| true));
        let z = (a - b) / ea.hypot(eb);
        assert!(z.abs() < 4.0 && ea < 0.03 * a, "{what}, channel {channel}: {a} ± {ea} against {b} ± {eb}");
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
        Case { what: "smooth mesh", caster: ROUND, ..AREA },
        Case {
            what: "bumps",
            floor: "{bump: {height: {texture: waves}, scale: 0.05, material: {diffuse: {reflectance: 0.6}}}}",
            light: WAVES,
            ..AREA
        },
        Case {
            what: "bumped mirror",
            material: "{bump: {height: {texture: waves}, scale: 0.1, material: {mirror: {reflectance: 0.9}}}}",
            light: WAVES,
            ..AREA
        },
        Case {
            what: "bumped glass",
            material: "{bump: {height: {texture: waves}, scale: 0.1, material: {dielectric: {ior: 1.5}}}}",
            light: WAVES,
            ..AREA
        },
        Case { what: "ground metal", material: "{conductor: {metal: silver, roughness: 0.04}}", ..AREA },
        Case { what: "ground glass", material: "{dielectric: {ior: 1.5, roughness: 0.04}}", ..AREA },
        Case {
            what: "pane",
            material: "{thin_dielectric: {ior: 1.8}}",
            caster: "rectangle: {name: ball, corner: [-0.8, -1, -0.5], edge_u: [1.6, 0, 1], edge_v: [0, 1.4, 0], \
                material: glass}",
            ..AREA
        },
        Case {
            what: "mirror without end",
            material: "{mirror: {reflectance: 0.8}}",
            caster: "plane: {name: ball, point: [1.6, 0, 0], normal: [-1, 0, 0.2], material: glass}",
            ..AREA
        },
    ];
    for case in cases {
        // So many that replicates meet what is rare and bright, and their error is that of the mean.
        let on = case.bench("on", "auto", 256);
        assert!(on.prepared.plan.caustics.is_some(), "{}", case.what);
        let off = case.bench("off", "auto", 768);
        assert!(off.prepared.plan.caustics.is_none());
        assert_agree(case.what, &render(&on), &render(&off));
    }
}

#[test]
fn wavelengths_that_part_are_all_there_with_and_without_packets() {
    let flint = Case { what: "flint", material: FLINT, ..AREA };
    let off = render(&flint.bench("off", "off", 1536));
    assert_agree("packets", &render(&flint.bench("on", "on", 96)), &off);
    assert_agree("packets from the camera", &render(&flint.bench("off", "on", 512)), &off);
    assert_agree("single", &render(&flint.bench("on", "off", 96)), &off);
    // Lanes part at the edges of a mesh, and with normals of its own each has another factor.
    let mesh = Case { what: "flint mesh", caster: ROUND, ..flint };
    assert_agree(mesh.what, &render(&mesh.bench("on", "on", 96)), &render(&mesh.bench("off", "auto", 1536)));
    // Normals of the lower face lean so far that from the floor all of it is seen by the true one.
    let low = "- sphere: {center: [-2.5, 1.2, 0.3], radius: 0.5, emission: {illuminant: {name: D65, scale: 10}}}\n";
    let leaning = Case { what: "leaning flint", caster: SLAB, light: low, ..flint };
    assert_agree(leaning.what, &render(&leaning.bench("on", "on", 192)), &render(&leaning.bench("off", "off", 3072)));
    // A relief turns the normal at which they part.
    let material = "{bump: {height: {texture: waves}, scale: 0.1, material: {dielectric: {ior: {glass: SF11}}}}}";
    let bumped = Case { what: "bumped flint", material, light: WAVES, ..flint };
    assert_agree(bumped.what, &render(&bumped.bench("on", "on", 192)), &render(&bumped.bench("on", "off", 192)));
}

/// A spot lamp shines on nothing but a ball that parts its colours over a floor, close to a block. The camera sees that side
/// of the block alone: all light has scattered on the floor, at other distances for each colour. Wavelengths that are sent
/// on together each bring as much as one that has been on its way alone.
#[test]
fn light_that_goes_on_after_its_wavelengths_have_parted_is_all_there() {
    let light = "- cube: {center: [1.35, -0.7, -0.6], size: [0.6, 0.6, 0.6], material: floor}\n\
        lights: [{spot: {position: [-1.5, 2, 1], target: [0.2, -0.2, 0], cutoff_deg: 11, intensity: 9}}]\n";
    let wide = Case { what: "wide", material: "{dielectric: {ior: {cauchy: [1.4, 0.06]}}}", light, ..AREA };
    let bench = |packets: &str, samples| {
        let scene = wide.scene("path", "on", packets, samples).replace("packets:", "merging: off, packets:");
        let from_above = "origin: [-1, 3, -2], target: [1.05, -0.6, -0.6], fov_deg: 5";
        let scene = scene.replace("origin: [0, 1.2, 5], target: [0, 0.1, 0], fov_deg: 40", from_above);
        assert!(scene.contains(from_above));
        bench_with(&scene, &[])
    };
    assert_agree(wide.what, &render(&bench("on", 32)), &render(&bench("off", 64)));
}

/// A lamp that the camera would see itself is not there: what a mirror throws back at it is not seen, nor does it stand before
/// what is.
#[test]
fn hidden_lamps_show_no_traced_light() {
    let scene = |floor: &str, tracing: &str, samples: u32| {
        bench_with(
            &format!(
                "camera: {{origin: [0, 0.2, 5], target: [0, 0.1, 0], fov_deg: 40}}\nimage: {{width: 24, height: 24}}\n\
                 render: {{samples: {samples}, techniques: {{light_tracing: {tracing}, packets: {tracing}, merging: off}}}}\n\
                 integrator: {{path: {{hide_emitters: true}}}}\nshapes:\n\
                 {floor}\
                 - rectangle: {{corner: [-3, -1, -2], edge_u: [6, 0, 0], edge_v: [0, 4, 0], \
                   material: {{diffuse: {{reflectance: 0.7}}}}}}\n\
                 - disk: {{center: [0.3, 0.8, 0], normal: [0, -1, 0.5], radius: 0.4, emission: 10, \
                   material: {{diffuse: {{reflectance: 0.8}}}}}}\n"
            ),
            &[],
        )
    };
    let mirror = "- rectangle: {corner: [-3, -1, -2], edge_u: [0, 0, 5], edge_v: [6, 0, 0], material: {mirror: {}}}\n";
    // A prism over a mirror: wavelengths part on the way back.
    let prism = format!(
        "{mirror}- cube: {{center: [0.3, -0.6, 0.4], size: [2, 0.4, 2], material: {{dielectric: {{ior: {{glass: SF11}}}}}}, \
         transform: [{{rotate: {{axis: [1, 0, 0.2], deg: 12}}}}]}}\n"
    );
    for floor in [mirror, &prism] {
        let [on, off] = [("on", 256), ("off", 8192)].map(|(tracing, samples)| {
            let bench = scene(floor, tracing, samples);
            let packets = bench.prepared.plan.techniques.iter().any(|t| t.name == "wavelength packets" && t.on);
            assert_eq!(packets, floor == prism && tracing == "on");
            // Above the mirror: the lamp would cover a fifteenth of it.
            part(&render(&bench), 1, |_, y| y < 12)
        });
        let z = (on.0 - off.0) / on.1.hypot(off.1);
        assert!(z.abs() < 3.0 && on.1 < 0.01 * on.0 && off.1 < 0.03 * off.0, "{floor}: {on:?} against {off:?}");
    }

    let paned = Case { light: PANE, depth: "null, count_crossings: true, hide_emitters: true", ..AREA };
    let (tracing, _, reason) = techniques(&paned.bench("on", "auto", 64));
    assert!(!tracing && reason == "lamps are hidden up to the first pane only", "{reason}");
}

/// A camera behind a pane of solid glass sees the floor through it only: paths from the lights cannot be joined to it,
/// and yet the caustic of a point light under the ball is there, as bright as without the pane but for what that reflects.
#[test]
fn a_caustic_is_seen_through_a_window() {
    let light = "lights: [{point: {position: [-1.5, 2, 1], intensity: 9}}]\n";
    let window = "- cube: {name: window, center: [0, 0.9, 4.2], size: [6, 6, 0.1], material: glass}\n";
    let scene = |window: &str| {
        Case { what: "window", light, ..AREA }
            .scene("path", "auto", "auto", 64)
            .replace("lights:", &format!("{window}lights:"))
            .replace("width: 24, height: 24", "width: 72, height: 72")
    };
    let open = bench_with(&scene(""), &[]);
    let shut = bench_with(&scene(window), &[]);
    let (tracing, merging, reason) = techniques(&shut);
    assert!(tracing && merging, "{reason}");
    let (open, shut) = (render(&open), render(&shut));
    // Two faces at up to 25° from the normal let through 0.96² = 0.92 of it, and 0.04² more after reflection inside.
    // What the ball throws lies right of it; the window reflects some more there, and merging blurs.
    let caustic = |x: usize, y: usize| (36..66).contains(&x) && (36..66).contains(&y);
    let ((a, ea), (b, eb)) = (part(&open, 1, caustic), part(&shut, 1, caustic));
    let ratio = b / a;
    assert!((ratio - 0.923).abs() < 0.02 + 4.0 * (ea / a).hypot(eb / b), "{b} ± {eb} against {a} ± {ea}: {ratio}");
    let without = scene(window).replace("light_tracing: auto", "light_tracing: off");
    let (dark, _) = part(&render(&bench_with(&without, &[])), 1, caustic);
    assert!(dark < 0.8 * b, "without the light of the ball there would be {dark} of {b}");
}

/// A spot shines up at a mirror that throws its light down on a floor, which the camera sees in another: lamp, mirror, floor,
/// mirror and camera are four segments. Nothing else lights the floor: with a path of three it is black.
#[test]
fn merged_photons_count_for_the_length_of_a_path() {
    let light = |depth: u32| {
        let text = format!(
            "camera: {{origin: [2, 1.5, 0], target: [4, 1, 0], fov_deg: 10}}\nimage: {{width: 24, height: 24}}\n\
             render: {{samples: 16, techniques: {{light_tracing: on, merging: on}}}}\n\
             integrator: {{path: {{max_depth: {depth}}}}}\nshapes:\n\
             - rectangle: {{corner: [-3, 0, 3], edge_u: [6, 0, 0], edge_v: [0, 0, -6], material: {{diffuse: {{}}}}}}\n\
             - rectangle: {{corner: [-1, 4, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], material: {{mirror: {{}}}}}}\n\
             - rectangle: {{corner: [4, 0.5, -1], edge_u: [0, 0, 2], edge_v: [0, 1, 0], material: {{mirror: {{}}}}}}\n\
             lights: [{{spot: {{position: [0, 1, 0], target: [0, 4, 0], cutoff_deg: 8, intensity: 9}}}}]\n"
        );
        let bench = bench_with(&text, &[]);
        assert!(bench.prepared.plan.caustics.as_ref().is_some_and(|c| c.merging.is_some()), "{depth}");
        part(&render(&bench), 1, |_, _| true)
    };
    let (bright, error) = light(4);
    assert!(bright > 10.0 * error && bright > 0.0, "{bright} ± {error}");
    assert_eq!(light(3).0, 0.0);
}

/// A spot shines up at a mirror that throws its light onto a floor at 60°, which the camera sees in another. What is left of the light
/// that a white floor sends back is the opacity of a mask, the share of a blend with black, and of slopes of tan θ = 2 across the
/// way of the light what shadows leave: α² = tan²θ/8 = 1/2 and G₁ = 2/(1 + √(1 + α² tan² 60°)) = 0.775. The beam is 4° wide, over
/// which G₁ runs from 0.75 to 0.80.
#[test]
fn merged_light_is_that_of_each_material_once() {
    // (0, 2, 1)/√5 as a colour, v across.
    let tilted = [&b"P6\n1 1\n255\n"[..], &[128, 242, 185]].concat();
    let light = |material: &str| {
        let text = format!(
            "camera: {{origin: [2, 1.5, 0], target: [4, 1, 0], fov_deg: 10}}\nimage: {{width: 24, height: 24}}\n\
             render: {{samples: 64, techniques: {{light_tracing: on, merging: on}}}}\n\
             textures: {{tilted: {{image: {{file: tilted.ppm, raw: true}}}}}}\nshapes:\n\
             - rectangle: {{corner: [-3, 0, 3], edge_u: [6, 0, 0], edge_v: [0, 0, -6], material: {material}}}\n\
             - rectangle: {{corner: [-7.794, 3.5, -1], edge_u: [1.732, 1, 0], edge_v: [0, 0, 2], material: {{mirror: {{}}}}}}\n\
             - rectangle: {{corner: [4, 0.5, -1], edge_u: [0, 0, 2], edge_v: [0, 1, 0], material: {{mirror: {{}}}}}}\n\
             lights: [{{spot: {{position: [-6.928, 1, 0], target: [-6.928, 4, 0], cutoff_deg: 2, intensity: 9}}}}]\n"
        );
        let bench = bench_with(&text, &[("tilted.ppm", &tilted)]);
        assert!(bench.prepared.plan.caustics.as_ref().is_some_and(|c| c.merging.is_some()), "{material}");
        part(&render(&bench), 1, |_, _| true)
    };
    let relief = |shadowing| {
        format!("{{normal_map: {{normals: {{texture: tilted}}, shadowing: {shadowing}, material: {{diffuse: {{}}}}}}}}")
    };
    let black = "{blend: {weight: 0.3, first: {diffuse: {reflectance: 0}}, second: {diffuse: {}}}}";
    for (whole, left, expected) in [
        ("{diffuse: {}}", "{mask: {opacity: 0.3, material: {diffuse: {}}}}", 0.3),
        ("{diffuse: {}}", black, 0.3),
        (&*relief(false), &*relief(true), 0.775),
    ] {
        let ((a, ea), (b, eb)) = (light(whole), light(left));
        let ratio = b / a;
        let error = ratio * (ea / a).hypot(eb / b);
        assert!((ratio - expected).abs() < 0.01 + 4.0 * error && error < 0.03, "{left}: {ratio} ± {error}");
    }
}

/// A sun over a black sheet that is open to a quarter throws through a ball of glass what a quarter of that sun does, be the
/// sheet a plane that stands farther out than all that has an end.
#[test]
fn light_that_glass_throws_comes_through_planes_that_stand_far_out() {
    let sun = "lights: [directional: {direction: [0.3, -1, -0.2], irradiance: 1}]\n";
    let sheet = "- plane: {point: [0, 50, 0], normal: [0, -1, 0], \
                 material: {mask: {opacity: 0.75, material: {diffuse: {reflectance: 0}}}}}\n\
                 lights: [directional: {direction: [0.3, -1, -0.2], irradiance: 4}]\n";
    let [a, b] = [sheet, sun].map(|light| {
        let bench = Case { light, ..AREA }.bench("on", "auto", 256);
        assert!(techniques(&bench).0, "{light}");
        render(&bench)
    });
    assert_agree("sheet", &a, &b);
}

/// Light without extent, which no path from the camera finds behind glass, against the tracer of all paths from the
/// lights, where the ball is out of the picture: a path through a mirror next to the camera is not its part.
#[test]
fn lights_without_extent_agree_with_the_light_tracer() {
    // Straight down on the floor beside the ball, where its light falls; where a glossy floor shows the lamp in the ball.
    let above = "origin: [1.6, 2, -0.6], target: [1.6, -1, -0.6], fov_deg: 24, up: [0, 0, -1]";
    let glossy = "origin: [-1.8, 1.12, 2.46], target: [-0.6, -1, 0.9], fov_deg: 16";
    let place = |text: String, what: &str| {
        let camera = if what == "gloss" { glossy } else { above };
        text.replace("origin: [0, 1.2, 5], target: [0, 0.1, 0], fov_deg: 40", camera)
    };
    let lights = [
        ("point", "lights: [{point: {position: [-1.5, 2, 1], intensity: {illuminant: {name: D65, scale: 9}}}}]\n"),
        ("spot", "lights: [{spot: {position: [-1.5, 2, 1], target: [0, -0.5, 0], cutoff_deg: 30, intensity: 9}}]\n"),
        ("directional", "lights: [{directional: {direction: [0.5, -1, -0.3], irradiance: 3}}]\n"),
        (
            "projector",
            "lights: [{projector: {origin: [-1.5, 2, 1], target: [0.2, -0.2, 0], fov_deg: 40, irradiance: 9}}]\n",
        ),
        (
            "beam",
            "- disk: {center: [-1.5, 2, 1], normal: [1.7, -2.2, -1], radius: 0.4, emission: 3, emission_direction: normal}\n",
        ),
    ];
    let lamps = lights.map(|(what, light)| Case { what, light, ..AREA });
    // What mirrors or refracts a part of the light, what is glossy beside a mirror, and a mirror without end beside a sun
    // that does not reach it.
    let point = Case { light: POINT, ..AREA };
    let others = [
        Case { what: "coat", material: "{plastic: {reflectance: 0.2, ior: 2.5}}", ..point },
        Case {
            what: "blend",
            material: "{blend: {weight: 0.6, first: {diffuse: {reflectance: 0.5}}, second: {dielectric: {ior: 1.5}}}}",
            ..point
        },
        Case {
            what: "two sides",
            material: "{two_sided: {front: {mirror: {reflectance: 0.9}}, back: {diffuse: {reflectance: 0}}}}",
            ..point
        },
        Case {
            what: "gloss",
            material: "{mirror: {reflectance: 0.9}}",
            floor: "{conductor: {metal: silver, roughness: 0.045}}",
            light: "lights: [{spot: {position: [-1.5, 2, 1], target: [0.2, -0.2, 0], cutoff_deg: 14, intensity: 9}}]\n",
            ..AREA
        },
        Case {
            what: "mirror without end",
            material: "{mirror: {reflectance: 0.8}}",
            caster: "plane: {name: ball, point: [2.6, 0, 0], normal: [-1, 0, 0.2], material: glass}",
            light: "lights: [{point: {position: [-1.5, 2, 1], intensity: 9}}, \
                {directional: {direction: [-1, -0.2, 0], irradiance: 3}}]\n",
            ..AREA
        },
        Case {
            what: "coat without end",
            material: "{plastic: {reflectance: 0.1, ior: 2.5}}",
            caster: "plane: {name: ball, point: [2.6, 0, 0], normal: [-1, 0, 0.2], material: glass}",
            ..point
        },
    ];
    for case in lamps.iter().chain(&others) {
        let what = case.what;
        let on = bench_with(&place(case.scene("path", "auto", "auto", 192), what), &[]);
        assert!(on.prepared.plan.caustics.is_some(), "{what}");
        let all = bench_with(&place(case.scene("light_tracer", "auto", "auto", 1024), what), &[]);
        assert_agree(what, &render(&on), &render(&all));
    }
}

/// Light from infinity has no end of a way through a medium that fills all space: of wavelengths that the medium takes away
/// nothing is left, of others all, on whatever path it comes. So a medium that takes away all above 620 nm is as none under
/// a sun that has none of that.
#[test]
fn light_from_infinity_is_lost_in_a_medium_without_end() {
    let sun = |irradiance: &str| {
        format!("lights: [{{directional: {{direction: [0.5, -1, -0.3], irradiance: {irradiance}}}}}]\n")
    };
    let filled = |light: &str, medium: &str| format!("{light}media: {{air: {{homogeneous: {medium}}}}}\nmedium: air\n");
    let place = |text: String| {
        text.replace(
            "origin: [0, 1.2, 5], target: [0, 0.1, 0], fov_deg: 40",
            "origin: [1.6, 2, -0.6], target: [1.6, -1, -0.6], fov_deg: 24, up: [0, 0, -1]",
        )
    };
    let bench = |light: &str, integrator: &str, tracing: &str, samples: u32| {
        let depth = if integrator == "whitted" { "8" } else { "null" };
        let case = Case { what: "endless", light: "", depth, ..AREA };
        bench_with(&place(case.scene(integrator, tracing, "auto", samples) + light), &[])
    };
    let lost = |bench: &Bench| bench.prepared.scene.notes.iter().any(|note| note.contains("medium: has no end"));
    for light in [sun("3"), "lights: [{constant: {radiance: 1}}]\n".to_owned()] {
        for medium in ["{absorption: 0.05, scattering: 0.02}", "{extinction: 0.1, albedo: 0}"] {
            for (integrator, tracing) in [("path", "on"), ("path", "auto"), ("light_tracer", "auto")] {
                let bench = bench(&filled(&light, medium), integrator, tracing, 16);
                let black = render(&bench).rgb.iter().flatten().all(|x| *x == 0.0);
                assert!(black, "{integrator}, {tracing}: {light}");
                assert!(lost(&bench), "{:?}", bench.prepared.scene.notes);
            }
        }
    }
    let long = "{absorption: {table: [[360, 0], [620, 0], [621, 1], [830, 1]]}}";
    let short = "{zero_outside: {table: [[360, 3], [620, 3]]}}";
    for (medium, left) in [("{}", "3"), (long, short)] {
        let expected = render(&bench(&sun(left), "path", "on", 192));
        let air = filled(&sun("3"), medium);
        assert!(!lost(&bench(&air, "whitted", "auto", 16)), "{medium}");
        for (integrator, samples) in [("path", 192), ("light_tracer", 1024)] {
            let found = bench(&air, integrator, "on", samples);
            assert_eq!(lost(&found), medium != "{}");
            assert_agree(&format!("{integrator}: {medium}"), &render(&found), &expected);
        }
    }
}

/// Photons are collected in the order of their paths, radii and wavelengths go by the sample's number: no bit depends on
/// threads or tiles.
#[test]
fn merged_light_does_not_depend_on_tiles_threads_or_parts() {
    let case = Case { what: "flint", material: FLINT, ..AREA };
    let bench = case.bench("on", "auto", 12);
    assert!(bench.prepared.plan.caustics.as_ref().unwrap().merging.is_some());
    let whole = sums(&bench, 1, 32);
    assert!(whole == sums(&bench, 3, 5), "the sums differ");
    let filter = FilterSampler::new(Filter::Gaussian { stddev: 0.5 }).unwrap();
    let parts = [5..12, 0..5].map(|samples| render_part(&job(&bench, &filter, 8), samples).unwrap());
    let [(mut film, splats), (second, more)] = parts;
    let (mut splats, more) = (splats.unwrap(), more.unwrap());
    film.merge(&second).unwrap();
    splats.film.merge(&more.film).unwrap();
    let paths = std::array::from_fn(|r| splats.paths[r] + more.paths[r]);
    assert!(whole == (film, splats.film, paths), "the sums of two parts differ");
}

/// A closed white box with a lamp and a ball of glass or flint: what is traced from the light and what from the
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
        let more = if std::env::var_os("ABBE_NIGHTLY").is_some() { 32 } else { 1 };
        let [on, off] = [("on", 128), ("off", 512)].map(|(tracing, samples)| render(&scene(tracing, more * samples)));
        assert_agree(material, &on, &off);
        // 128 samples make an error of 2.5e-3 in the mean of the picture, 4096 one of 4e-4.
        let whole = |image: &Image| part(image, 1, |_, _| true);
        let ((a, ea), (b, eb)) = (whole(&on), whole(&off));
        let [off_by, error] = [a / b - 1.0, ea.hypot(eb) / b];
        assert!(off_by.abs() < 3.0 * error && error < 6e-3 / f64::from(more).sqrt(), "{material}: {off_by} ± {error}");
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
    // 2.5 pixels, 2 tan 45° / 24 wide, at what is seen in the mirror: the floor, 2 to 5 m away.
    let pixel = 2.0 / 24.0;
    assert!((2.5 * pixel * 2.0..2.5 * pixel * 5.0).contains(&radius), "{radius}");
    // No sample is invalid.
    render(&bench);
}

/// A floor, glass, a mirror and lamps, all times a power of two, are the same picture, by paths from the camera and the lights
/// with photons as by paths from the lights alone: powers of lamps go with the square, beyond what f32 holds.
#[test]
fn light_from_the_lamps_is_the_same_at_any_scale() {
    let scene = |k: f64, integrator: &str| {
        let [one, two, half] = [k, 2.0 * k, 0.5 * k];
        let text = format!(
            "camera: {{origin: [0, {one:e}, {:e}], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 24, height: 24}}\n\
             integrator: {{{integrator}: {{}}}}\n\
             render: {{samples: 16, techniques: {{light_tracing: on, merging: on}}}}\nshapes:\n\
             - rectangle: {{corner: [{:e}, {:e}, {two:e}], edge_u: [{:e}, 0, 0], edge_v: [0, 0, {:e}]}}\n\
             - sphere: {{radius: {half:e}, material: {{dielectric: {{ior: 1.5}}}}}}\n\
             - sphere: {{center: [{one:e}, {two:e}, 0], radius: {half:e}, emission: 3}}\n\
             - rectangle: {{corner: [{:e}, {two:e}, 0], edge_u: [{half:e}, 0, 0], edge_v: [0, 0, {half:e}], emission: 2,\n    \
                 emission_direction: normal}}\n\
             - rectangle: {{corner: [{:e}, {:e}, {:e}], edge_u: [{:e}, 0, 0], edge_v: [0, {two:e}, 0], material: {{mirror: {{}}}}}}\n\
             lights: [directional: {{direction: [1, -2, 0.5], irradiance: 1}}]\n",
            5.0 * k,
            -two,
            -half,
            4.0 * k,
            -4.0 * k,
            -one,
            -two,
            -half,
            -two,
            4.0 * k
        );
        render(&bench_with(&text, &[]))
    };
    for integrator in ["path", "light_tracer"] {
        let expected = scene(1.0, integrator);
        let mean = expected.rgb[1].iter().sum::<f32>() / expected.rgb[1].len() as f32;
        assert!(mean > 0.02, "{integrator}: {mean}");
        for power in [-90, -66, 66, 90] {
            let found = scene(2f64.powi(power), integrator);
            let all = found.rgb.iter().flatten().zip(expected.rgb.iter().flatten());
            for (found, expected) in all {
                assert!((found - expected).abs() < 1e-5 * mean, "{integrator}, 2^{power}: {found}, not {expected}");
            }
        }
    }
}

/// Light of a lamp, with and without extent, is the same beside something 10³⁰ m away that no ray meets: its power does not know how
/// far a scene reaches, whose square f32 does not hold.
#[test]
fn what_stands_far_away_takes_no_light_of_a_lamp() {
    let scene = |lamp: &str, far: &str, integrator: &str| {
        let text = format!(
            "camera: {{origin: [0, 1, 2], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 24, height: 24}}\n\
             integrator: {{{integrator}: {{}}}}\n\
             render: {{samples: 16, techniques: {{light_tracing: on, merging: on}}}}\nshapes:\n\
             - rectangle: {{corner: [-2, -0.5, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4]}}\n\
             - sphere: {{radius: 0.5, material: {{dielectric: {{ior: 1.5}}}}}}\n\
             - rectangle: {{corner: [-2, -0.5, -1], edge_u: [4, 0, 0], edge_v: [0, 2, 0], material: {{mirror: {{}}}}}}\n{far}{lamp}"
        );
        render(&bench_with(&text, &[]))
    };
    let lamps = [
        "- sphere: {center: [1, 2, 0], radius: 0.25, emission: 9}\n",
        "lights: [point: {position: [-1, 2, 0], intensity: 1}]\n",
        "lights: [spot: {position: [0, 2, 1], target: [0, 0, 0], cutoff_deg: 40, intensity: 2}]\n",
    ];
    for (lamp, integrator) in
        lamps.iter().flat_map(|lamp| ["path", "light_tracer"].map(|integrator| (lamp, integrator)))
    {
        let expected = scene(lamp, "", integrator);
        let mean = expected.rgb[1].iter().sum::<f32>() / expected.rgb[1].len() as f32;
        assert!(mean > 0.01, "{integrator}, {lamp}: {mean}");
        let found = scene(lamp, "- sphere: {center: [0, -1.0e30, 0], radius: 1.0e20}\n", integrator);
        for (found, expected) in found.rgb.iter().flatten().zip(expected.rgb.iter().flatten()) {
            assert!((found - expected).abs() < 1e-5 * mean, "{integrator}, {lamp}: {found}, not {expected}");
        }
    }
}
