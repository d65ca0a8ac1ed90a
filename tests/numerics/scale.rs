//! The same scene at another size or place is the same picture.
//!
//! In the texts below `P(x, y, z)` is a point, `L(x)` a length, `I(x)` one over a length and `S(x)` a length squared; the
//! rest has no unit of length.

use crate::common::{Bench, ball_of_distances, bench_with, grey_png, sums};
use crate::meshes::icosphere;

/// Where the unit scene lies: size, and the place of its origin.
#[derive(Clone, Copy)]
struct Frame {
    size: f64,
    origin: [f64; 3],
}

const HERE: Frame = Frame { size: 1.0, origin: [0.0; 3] };

impl Frame {
    fn fill(&self, text: &str) -> String {
        let mut out = String::new();
        let mut rest = text;
        while let Some(at) = rest.find(['P', 'L', 'I', 'S']) {
            let (kind, tail) = (rest.as_bytes()[at], &rest[at + 1..]);
            out += &rest[..at];
            if !tail.starts_with('(') {
                out.push(kind as char);
                rest = tail;
                continue;
            }
            let end = tail.find(')').unwrap();
            let numbers: Vec<f64> = tail[1..end].split(',').map(|x| x.trim().parse().unwrap()).collect();
            out += &match kind {
                b'P' => {
                    let at: [f64; 3] = std::array::from_fn(|k| numbers[k] * self.size + self.origin[k]);
                    format!("[{:?}, {:?}, {:?}]", at[0], at[1], at[2])
                }
                b'L' => format!("{:?}", numbers[0] * self.size),
                b'I' => format!("{:?}", numbers[0] / self.size),
                _ => format!("{:?}", numbers[0] * self.size * self.size),
            };
            rest = &tail[end + 1..];
        }
        out + rest
    }
}

struct Subject {
    name: &'static str,
    text: String,
}

/// Scenes of every kind of shape, light, camera and matter.
fn subjects() -> Vec<Subject> {
    let eye = "camera: {origin: P(0, 1.5, 6), target: P(0, 0.75, 0), fov_deg: 40}\n";
    let image = "image: {width: 32, height: 24}\nrender: {samples: 16}\n";
    let scene = |name, camera: &str, rest: &str| Subject { name, text: format!("{camera}{image}{rest}") };
    let floor = "- plane: {point: P(0, 0, 0), normal: [0, 1, 0]}\n";
    let sky = "lights: [{constant: {radiance: 0.3}}]\n";
    let copy = |file: &str| format!("transform: [{{scale: L(1)}}, {{translate: P(0, 0, 0)}}], file: {file}");
    vec![
        scene(
            "shapes",
            eye,
            &format!(
                "{sky}shapes:\n{floor}\
             - sphere: {{center: P(-2, 1, 0), radius: L(0.7)}}\n\
             - cone: {{base: P(1, 0, 1), apex: P(1, 1, 1), radius: L(0.5)}}\n\
             - cone: {{base: P(2, 0.5, 0), apex: P(2, 1.5, 0), radius: L(0.5), cap: false}}\n\
             - cylinder: {{base: P(-1, 0, 1), top: P(-1, 1, 1), radius: L(0.25), material: {{conductor: {{metal: gold, roughness: 0.3}}}}}}\n\
             - cylinder: {{base: P(-0.2, 0, 2), top: P(0.2, 0.7, 1.5), radius: L(0.25), caps: none}}\n\
             - disk: {{center: P(0, 2, -1), normal: [0.3, -1, 0.5], radius: L(0.5)}}\n\
             - rectangle: {{corner: P(-1, 0, -2), edge_u: [L(2), 0, 0], edge_v: [0, L(2), 0], material: {{plastic: {{reflectance: 0.6}}}}}}\n\
             - cube: {{center: P(0.5, 0.25, 2), size: L(0.5)}}\n\
             - sphere: {{center: P(1, 3, 1), radius: L(0.5), emission: 2}}\n"
            ),
        ),
        // Overlapping balls hold some light for hundreds of reflections, each of which multiplies what a direction is off
        // by: after a hundred the last bit of f64 is a way of its own. Sixty-four are told.
        scene(
            "glass",
            eye,
            &format!(
                "{sky}integrator: {{path: {{max_depth: 64}}}}\nshapes:\n{floor}\
             - sphere: {{center: P(-1, 1, 0), radius: L(1), material: {{dielectric: {{ior: 1.5, priority: 2}}}}}}\n\
             - sphere: {{center: P(-1, 1.7, 0), radius: L(1), material: {{dielectric: {{ior: 1.33, priority: 1}}}}}}\n\
             - cube: {{center: P(1.5, 0.6, 0.5), size: L(1), material: {{dielectric: {{ior: {{glass: N-SF11}}}}}}}}\n\
             - sphere: {{center: P(1, 2.5, 0), radius: L(0.5), material: {{dielectric: {{ior: 1.5, roughness: 0.2}}}}}}\n\
             - sphere: {{center: P(0.5, 0.4, 2), radius: L(0.4), material: {{dielectric: {{ior: 1.5, absorption: {{color: 0.5, at: L(0.3)}}}}}}}}\n"
            ),
        ),
        // Rough, so that no light is traced from the lamp: a mesh that is moved has its vertices rounded to f32 anew, and which
        // way the pilot aims follows single paths.
        scene(
            "meshes",
            eye,
            &format!(
                "{sky}shapes:\n{floor}\
             - mesh: {{{}, material: {{conductor: {{metal: silver, roughness: 0.1}}}}}}\n\
             - mesh: {{{}, normals: face, emission: 1}}\n",
                copy("m.obj"),
                copy("n.obj")
            ),
        ),
        scene(
            "smoke",
            eye,
            &format!(
                "{sky}media:\n  smoke: {{homogeneous: {{scattering: I(1), absorption: I(0.2), phase: {{hg: 0.5}}}}}}\n  \
             blue: {{homogeneous: {{scattering: {{rgb: [I(0.2), I(0.5), I(1)]}}}}}}\n  \
             air: {{homogeneous: {{extinction: I(0.05), albedo: 0.9}}}}\nmedium: air\nshapes:\n{floor}\
             - sphere: {{center: P(-1, 1, 0), radius: L(1), material: {{boundary: {{}}}}, inside: smoke}}\n\
             - cube: {{center: P(1.2, 1, 0), size: L(1.5), material: {{boundary: {{}}}}, inside: blue}}\n\
             - sphere: {{center: P(1, 3, 1), radius: L(0.4), emission: 2}}\n"
            ),
        ),
        scene(
            "lamps",
            eye,
            &format!(
                "textures: {{map: {{image: {{file: map.png}}}}}}\nshapes:\n{floor}\
             - cube: {{center: P(0, 0.5, 0), size: L(1)}}\n\
             - rectangle: {{corner: P(2, 2, -1), edge_u: [0, 0, L(1)], edge_v: [L(-0.5), L(0.5), 0], emission: 3}}\n\
             - disk: {{center: P(-3, 2, 0), normal: [1, -0.3, 0.2], radius: L(0.3), emission: {{texture: map}}}}\n\
             lights:\n\
             - point: {{position: P(0, 4, 0), intensity: S(3)}}\n\
             - spot: {{position: P(-2, 3, 2), target: P(0, 0, 0), cutoff_deg: 20, intensity: S(20)}}\n\
             - projector: {{origin: P(2, 3, 3), target: P(0, 0, 0), fov_deg: 30, irradiance: {{texture: map}}, scale: S(10)}}\n\
             - directional: {{direction: [0.3, -1, -0.5], irradiance: 0.5}}\n"
            ),
        ),
        scene(
            "lens",
            "camera: {origin: P(0, 1.5, 6), target: P(0, 0.75, 0), fov_deg: 40, lens: {radius: L(0.1), focus_distance: L(5)}, clip: {near: L(0.5), far: L(20)}}\n",
            &format!(
                "textures: {{map: {{image: {{file: map.png}}}}}}\nlights: [{{environment: {{file: map.png, rotate_deg: 30}}}}]\nshapes:\n{floor}\
             - sphere: {{center: P(0, 1, 0), radius: L(1), material: {{diffuse: {{reflectance: {{texture: map}}}}}}}}\n\
             - sphere: {{center: P(2, 1, 1), radius: L(0.5), material: {{principled: {{roughness: 0.3, clearcoat: 1, metallic: 0.4}}}}}}\n"
            ),
        ),
        scene(
            "parallel",
            "camera: {origin: P(0, 1.5, 6), target: P(0, 0.75, 0), orthographic_height: L(4)}\n",
            &format!(
                "{sky}groups: {{g: [{{sphere: {{center: [0, 0.5, 0], radius: 0.5}}}}, {{cone: {{base: [0.5, 0, 0.5], apex: [0.5, 1, 0.5], radius: 0.5}}}}]}}\n\
             shapes:\n{floor}\
             - instance: {{group: g, transform: [{{scale: [2, 1, 0.5]}}, {{scale: L(1)}}, {{translate: P(-0.5, 0, 0)}}]}}\n\
             - instance: {{group: g, transform: [{{rotate: {{axis: [1, 1, 0], deg: 40}}}}, {{scale: L(0.7)}}, {{translate: P(1.5, 0.7, 1)}}]}}\n\
             - curves: {{file: c.txt, basis: bspline}}\n\
             - sdf_grid: {{file: g.vol, transform: [{{scale: L(1)}}, {{translate: P(-2, 1, 0)}}]}}\n\
             - sphere: {{center: P(1, 3, 1), radius: L(0.5), emission: 2}}\n"
            ),
        ),
        scene(
            "caustics",
            eye,
            &format!(
                "shapes:\n{floor}\
             - sphere: {{center: P(0, 1, 0), radius: L(0.7), material: {{dielectric: {{ior: 1.5}}}}}}\n\
             - sphere: {{center: P(2, 4, 1), radius: L(0.1), emission: 200}}\n"
            ),
        ),
    ]
}

fn bench(subject: &Subject, frame: Frame) -> Bench {
    let map = grey_png(16, 8, |x, y| (x * 15 + y * 2) as u8);
    let ball = icosphere(2).map(|p| [0.8 * p[0] - 1.0, 0.8 * p[1] + 0.9, 0.8 * p[2]]).obj();
    let lamp = icosphere(1).map(|p| [0.3 * p[0] + 1.5, 0.3 * p[1] + 2.0, 0.3 * p[2]]).obj();
    let curve = frame.fill("P(-1, 0.1, 2) L(0.05)\nP(0, 0.5, 2) L(0.1)\nP(0.5, 1.2, 2) L(0.07)\nP(1, 0.2, 2) L(0.02)\nP(1.5, 0.3, 1) L(0.04)\n");
    let curve = curve.replace(['[', ']', ','], "");
    bench_with(
        &frame.fill(&subject.text),
        &[
            ("map.png", &map),
            ("m.obj", ball.as_bytes()),
            ("n.obj", lamp.as_bytes()),
            ("c.txt", curve.as_bytes()),
            ("g.vol", &ball_of_distances()),
        ],
    )
}

/// Case O39: sizes 2^k give the same bits.
#[test]
fn scenes_of_every_kind_have_the_same_bits_at_sizes_of_powers_of_two() {
    for subject in subjects() {
        let reference = sums(&bench(&subject, HERE).film());
        let picture = bench(&subject, HERE).picture();
        assert!(reference.iter().any(|s| s.0[1] > 0), "{} is black", subject.name);
        for k in [-20, -1, 13, 20] {
            let scaled = bench(&subject, Frame { size: 2f64.powi(k), ..HERE });
            // What paths from the lights add stands in the picture alone.
            assert!(scaled.picture().y == picture.y, "{}, 2^{k}: another picture", subject.name);
            let film = scaled.film();
            let differ = sums(&film).iter().zip(&reference).filter(|(a, b)| a != b).count();
            assert!(differ == 0, "{}, 2^{k}: {differ} of {} sums differ", subject.name, reference.len());
        }
    }
}

/// Asked for: of sizes 1e±6 and moved by 1e6, with the same random numbers, 99.9 % of the pixels agree to 1e-4 and the mean
/// to 1e-5. What moves is rounding: at 1e6 that of a coordinate is 1e-10, which turns a path the other way where it is
/// near to an edge, and a sample in 2e5 or so is.
#[test]
fn scenes_of_every_kind_look_the_same_at_any_size_and_place() {
    let mut wrong = Vec::new();
    for subject in subjects() {
        let reference = bench(&subject, HERE).picture();
        for (what, frame) in [
            ("1e-6", Frame { size: 1e-6, ..HERE }),
            ("1e6", Frame { size: 1e6, ..HERE }),
            ("moved", Frame { origin: [1e6, -1e6, 1e6], ..HERE }),
            ("smaller and moved", Frame { size: 1e-6, origin: [1.0, 0.3, -0.7] }),
        ] {
            let picture = bench(&subject, frame).picture();
            let n = picture.y.len();
            let near = |(a, b): &(&f64, &f64)| (*a - *b).abs() <= 1e-4 * b.abs();
            let same = picture.y.iter().zip(&reference.y).filter(near).count();
            let mean = picture.mean().mean / reference.mean().mean - 1.0;
            let share = 1.0 - same as f64 / n as f64;
            if std::env::var_os("ABBE_PRINT").is_some() {
                eprintln!("{}, {what}: {share:.5} of the pixels differ, the mean by {mean:.2e}", subject.name);
            }
            if mean.abs() > 1e-5 || (share > 1e-3) {
                wrong.push(format!("{}, {what}: {share} of the pixels differ, the mean by {mean:e}", subject.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Light of any size: a box with a glass ball under each kind of lamp, and fog, from 2⁻⁷⁰ to 2⁹⁰. Powers of two change no mantissa,
/// and what the film rounds off, 2⁻⁸⁴ of the brightest, no bit of a pixel here. Nothing is dropped.
#[test]
fn a_scene_in_light_of_any_size_is_the_same_picture() {
    let lamps: [(&str, &dyn Fn(f64) -> String); 6] = [
        ("area", &|e| {
            format!(
                "- rectangle: {{corner: [-0.4, 1.999, -0.4], edge_u: [0.8, 0, 0], edge_v: [0, 0, 0.8], emission: {e:e}}}\n"
            )
        }),
        ("small", &|e| format!("- sphere: {{center: [0.3, 1.5, 0.4], radius: 0.01, emission: {e:e}}}\n")),
        ("point", &|e| format!("lights: [point: {{position: [0.3, 1.5, 0.4], intensity: {e:e}}}]\n")),
        ("spot", &|e| {
            format!(
                "lights: [spot: {{position: [0, 1.9, 0.4], target: [0.4, 0.35, 0.35], cutoff_deg: 30, intensity: {e:e}}}]\n"
            )
        }),
        ("sky", &|e| {
            format!(
                "lights: [constant: {{radiance: {e:e}}}, directional: {{direction: [-0.2, -1, -0.7], irradiance: {e:e}}}]\n"
            )
        }),
        ("fog", &|e| format!("fog: {{colour: {e:e}, density: 0.3}}\n")),
    ];
    for (name, lamp) in lamps {
        let picture = |power: i32| {
            let text = format!(
                "camera: {{origin: [0, 1, 4.6], target: [0, 1, 0], fov_deg: 31}}\nimage: {{width: 24, height: 24}}\n\
                 render: {{samples: 64}}\nshapes:\n\
                 - rectangle: {{corner: [-1, 0, 1], edge_u: [2, 0, 0], edge_v: [0, 0, -2]}}\n\
                 - rectangle: {{corner: [-1, 2, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2]}}\n\
                 - rectangle: {{corner: [-1, 0, -1], edge_u: [2, 0, 0], edge_v: [0, 2, 0]}}\n\
                 - sphere: {{center: [0.4, 0.35, 0.35], radius: 0.35, material: {{dielectric: {{ior: 1.5}}}}}}\n{}",
                lamp(2f64.powi(power))
            );
            let bench = bench_with(&text, &[]);
            let frame = bench.frame();
            assert_eq!(frame.invalid().total(), 0, "{name} times 2^{power}");
            let image = frame.resolve(&abbe::spectrum::ColourSpace::Rec709.matrix_from_xyz());
            let unit = 2f64.powi(-power);
            image.rgb.iter().flatten().map(|&x| f64::from(x) * unit).collect::<Vec<f64>>()
        };
        let one = picture(0);
        let mean = one.iter().sum::<f64>() / one.len() as f64;
        assert!(mean > 1e-5, "{name}: {mean}");
        for power in [-70, -20, 20, 50, 90] {
            assert!(picture(power) == one, "{name} times 2^{power}");
        }
    }
}
