//! Paths that pixels share change the noise, never the mean, whatever their vertices are on.

use super::common::{Bench, ball_of_distances, bench_with, grey_png, room};
use abbe::math::statistics::{Moments, student_t_half_width};
use abbe::spectrum::ColourSpace;
use std::ops::Range;

/// Two triangles that meet at an angle and a third, with normals by which they look round.
const FOLD: &str = "v -0.5 -1 -0.4\nv 0.5 -1 -0.4\nv 0.5 -0.3 -0.2\nv -0.5 -0.3 -0.2\nv 0 -0.4 0.5\n\
                    vn 0 0.2 1\nvn 0 0.8 0.6\nvn 0 1 0.1\n\
                    f 1//1 2//1 3//2\nf 1//1 3//2 4//2\nf 4//2 3//2 5//3\n";

const LAMP: &str = "- rectangle: {corner: [-0.3, 0.9, -0.3], edge_u: [0.6, 0, 0], edge_v: [0, 0, 0.6], emission: 3}\n";

/// A lamp among `shapes`, seen from within a room.
fn lit(reuse: &str, shapes: &str, before: &str) -> Bench {
    let yaml = format!(
        "camera: {{origin: [0, 0, 0.95], target: [0, -0.1, -1], fov_deg: 80}}\nimage: {{width: 20, height: 16}}\n\
         textures: {{map: {{image: {{file: map.png}}}}}}\nmaterials: {{chalk: {{diffuse: {{reflectance: 0.7}}}}}}\n\
         render: {{samples: 16, techniques: {{reuse: {reuse}, light_tracing: off}}}}\n{before}{shapes}{LAMP}"
    );
    let map = grey_png(16, 8, |x, y| (100 + x * 9 + y) as u8);
    bench_with(&yaml, &[("map.png", &map), ("ball.vol", &ball_of_distances()), ("fold.obj", FOLD.as_bytes())])
}

/// Luminance of each pixel, and of their mean, over seeds.
pub fn over_seeds(mut bench: Bench, seeds: Range<u64>) -> (Vec<Moments>, Moments) {
    let mut pixels = vec![Moments::default(); bench.window().pixels()];
    let mut all = Moments::default();
    for seed in seeds {
        bench.prepared.description.render.seed = seed;
        let picture = bench.picture();
        assert_eq!(picture.invalid, 0);
        pixels.iter_mut().zip(&picture.y).for_each(|(moments, y)| moments.push(*y));
        all.push(picture.y.iter().sum::<f64>() / picture.y.len() as f64);
    }
    (pixels, all)
}

/// Student's t of the difference of two means.
fn t(a: &Moments, b: &Moments) -> f64 {
    (a.mean - b.mean).abs() / a.standard_error().hypot(b.standard_error())
}

/// Holds what two ways make of a scene over 24 seeds each to the same light, each pixel by Student's t of the difference: of 24 + 24
/// numbers of about normal law it has at least 23 degrees of freedom (Welch). The level is 1e-3 for all pixels of the scene
/// together, and again for their mean. The variance of all pixels by the second way over that by the first.
pub fn assert_same_light(
    name: &str,
    (a, a_all): &(Vec<Moments>, Moments),
    (b, b_all): &(Vec<Moments>, Moments),
) -> f64 {
    let most = student_t_half_width(1.0 - 1e-3 / a.len() as f64, 23.0);
    let worst = a.iter().zip(b).map(|(a, b)| t(a, b)).fold(0.0, f64::max);
    let mean = t(a_all, b_all);
    let precision = a_all.standard_error().hypot(b_all.standard_error()) / a_all.mean;
    let variance = |pixels: &[Moments]| pixels.iter().map(Moments::variance).sum::<f64>();
    let ratio = variance(b) / variance(a);
    println!("{name}: worst {worst:.2} of {most:.2}, mean {mean:.2}, told to {precision:.1e}, variance {ratio:.2}");
    assert!(worst < most, "{name}: {worst} standard errors, {most} allowed");
    assert!(mean < student_t_half_width(1.0 - 1e-3, 23.0) && precision < 1e-2, "{name}: {mean}, {precision}");
    ratio
}

#[test]
fn pixels_that_share_paths_have_the_light_of_those_that_do_not() {
    let walls = room("material: {diffuse: {reflectance: 0.7}}");
    let cube = "shapes:\n- cube: {center: [0, 0, 0], size: 2, material: chalk}\n".to_owned();
    let tube = "shapes:\n- cylinder: {base: [0, -1, 0], top: [0, 1, 0], radius: 1, material: chalk}\n".to_owned();
    let groups = "groups: {pair: [{sphere: {center: [-0.4, -0.7, -0.3], radius: 0.3, material: chalk}}, \
                  {mesh: {file: fold.obj, material: chalk}}]}\n";
    let cases = [
        (
            "solids",
            "",
            walls.clone()
                + "- sphere: {center: [-0.4, -0.6, -0.3], radius: 0.4, material: chalk}\n\
          - cylinder: {base: [0.4, -1, 0], top: [0.5, 0, -0.3], radius: 0.2, material: chalk}\n\
          - cube: {center: [0.1, -0.8, 0.3], size: 0.3, material: {diffuse: {reflectance: {texture: map}}}}\n",
        ),
        (
            "a cup that lies",
            "",
            walls.clone()
                + "- cylinder: {base: [0, -0.7, -0.6], top: [0, -0.6, 0.2], radius: 0.3, caps: base, material: chalk}\n",
        ),
        ("normals", "", walls.clone() + "- mesh: {file: fold.obj, material: chalk}\n"),
        (
            "one side",
            "",
            walls.clone() + "- mesh: {file: fold.obj, material: {diffuse: {reflectance: 0.8, two_sided: false}}}\n",
        ),
        (
            "distances and a copy",
            groups,
            walls.clone()
                + "- instance: {group: pair}\n\
          - sdf_grid: {file: ball.vol, material: chalk, transform: [{translate: [0, -1, -0.5]}]}\n",
        ),
        (
            "glass and a mirror",
            "",
            walls.clone()
                + "- sphere: {center: [-0.4, -0.6, -0.3], radius: 0.4, material: {dielectric: {ior: {glass: N-SF11}}}}\n\
          - sphere: {center: [0.5, -0.6, -0.3], radius: 0.4, material: {mirror: {}}}\n",
        ),
        (
            "the inside of a cube",
            "",
            cube.clone() + "- sphere: {center: [-0.4, -0.6, -0.3], radius: 0.4, material: chalk}\n",
        ),
        (
            "a cube in the inside of a tube",
            "",
            tube + "- cube: {center: [0.3, -0.6, -0.3], size: 0.6, material: chalk}\n",
        ),
        (
            "a shell turned inside out",
            "",
            cube + "- sphere: {center: [0, -0.6, -0.4], radius: 0.4, material: chalk, flip_normals: true}\n",
        ),
    ];
    for (name, before, shapes) in cases {
        let [apart, shared] = [("off", 0), ("on", 100)].map(|(reuse, first)| {
            let bench = lit(reuse, &shapes, before);
            assert_eq!(bench.prepared.plan.reuse, reuse == "on", "{name}");
            over_seeds(bench, first..first + 24)
        });
        // It is worth something.
        let ratio = assert_same_light(name, &apart, &shared);
        assert!(ratio < 0.9, "{name}: {ratio}");
    }
}

/// Cells that have samples by their noise share paths all the same: those of a cell have the same number.
#[test]
fn noisy_cells_share_more_paths() {
    let walls = room("material: {diffuse: {reflectance: 0.7}}");
    let things = walls + "- sphere: {center: [-0.4, -0.6, -0.3], radius: 0.4, material: {mirror: {}}}\n";
    let [apart, shared_out] = [("off", 0), ("on, adaptive: on", 100)].map(|(reuse, first)| {
        let bench = lit(reuse, &things, "");
        let plan = &bench.prepared.plan;
        assert_eq!((plan.reuse, plan.adaptive.is_some()), (reuse != "off", reuse != "off"), "{reuse}");
        over_seeds(bench, first..first + 24)
    });
    let ratio = assert_same_light("samples by noise", &apart, &shared_out);
    assert!(ratio < 0.9, "{ratio}");
}

/// L = 1 + ½ L everywhere in a room whose walls shine with 1 and reflect ½, and in the inside of a cube.
#[test]
fn a_furnace_of_shared_paths_is_as_bright_as_it_has_to_be() {
    let walls = room("emission: 1, material: {diffuse: {reflectance: 0.5}}");
    let cube = "shapes:\n- cube: {size: 2, emission: 1, flip_normals: true, material: {diffuse: {reflectance: 0.5}}}\n";
    for shapes in [walls.as_str(), cube] {
        let yaml = format!(
            "camera: {{origin: [0.1, 0.2, 0.3], target: [0, 0, -1], fov_deg: 100}}\nimage: {{width: 16, height: 16}}\n\
             render: {{samples: 64, techniques: {{reuse: on}}}}\n{shapes}"
        );
        bench_with(&yaml, &[]).grey().picture().mean().assert_is(2.0, 3e-3);
    }
}

/// Layers of light change no bit of the picture, and add up to it: each sum of them is rounded to an f32 once a sample, and
/// a pixel has 16.
#[test]
fn layers_of_shared_light_add_up_to_the_picture_that_they_leave_as_it_is() {
    let walls = room("material: {diffuse: {reflectance: 0.7}}");
    let things = walls + "- sphere: {center: [-0.4, -0.6, -0.3], radius: 0.4, material: {plastic: {}}, name: ball}\n";
    let plain = lit("on", &things, "");
    let parted = lit("on", &things, "layers: [emission, direct, indirect, caustic]\n");
    assert_layers_add_up(&plain, &parted);
}

/// Of `parted`, which has four layers more than `plain`: they leave the picture as it is, and add up to it.
pub fn assert_layers_add_up(plain: &Bench, parted: &Bench) {
    let (plain, parted) = (plain.frame(), parted.frame());
    let matrix = ColourSpace::Rec709.matrix_from_xyz();
    let (picture, with) = (plain.resolve(&matrix), parted.resolve(&matrix));
    assert!(picture == with);
    for c in 0..3 {
        let layers: Vec<_> = (0..4).map(|layer| parted.layer(3 * layer + c)).collect();
        for (i, all) in with.rgb[c].iter().enumerate() {
            let sum: f32 = layers.iter().map(|layer| layer[i]).sum();
            assert!((sum - all).abs() <= 16.0 * f32::EPSILON * all.abs().max(0.1), "pixel {i}: {sum}, {all}");
        }
    }
}
