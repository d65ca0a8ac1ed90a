//! Copies are held against the same surfaces placed by hand.

use super::*;
use crate::description::SceneDescription;
use crate::scene::Scene;
use crate::scene::compile::testing::compiled;
use crate::scene::shape::testing::Random;
use std::path::Path;

const CAMERA: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n";

fn scene(text: &str) -> Scene {
    compiled(&format!("{CAMERA}{text}"))
}

/// A turn, an even scaling that mirrors, and a move, as steps.
const SIMILAR: &str = "[{scale: [-2, 2, 2]}, {rotate: {axis: [1, 2, 3], deg: 40}}, {translate: [100, -20, 3]}]";
/// A map that stretches and shears.
const SKEWED: &str = "[{matrix: [[2, 0.5, 0, 7], [0, -0.3, 1, -30], [0.2, 0, 1.5, 2], [0, 0, 0, 1]]}]";

/// A ray from a random place near `at` toward another.
fn ray(random: &mut Random, at: DVec3, size: f64) -> Ray {
    let origin = at + random.direction() * 5.0 * size;
    let target = at + random.direction() * size;
    Ray::new(origin, (target - origin).normalize())
}

/// Every kind of surface that may lie in the world under any map: boxes, rectangles, disks. Rays meet the
/// copy and the one placed by its own transform at the same distance, part, u, v and normal, and rays that
/// go on from there do so as well.
#[test]
fn a_copy_is_the_shape_under_the_same_transform() {
    for steps in [SIMILAR, SKEWED] {
        for shape in [
            "cube: {size: [1, 2, 1.5]",
            "rectangle: {corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0]",
            "disk: {normal: [0, 0, 1], radius: 1",
        ] {
            let board = "textures: {t: {checkerboard: {a: 0.1, b: 0.9}}}\n";
            let material = "material: {diffuse: {reflectance: {texture: t}}}";
            let placed = scene(&format!("{board}shapes:\n- {shape}, {material}, transform: {steps}}}\n"));
            let copied = scene(&format!(
                "{board}groups:\n  g:\n  - {shape}, {material}}}\nshapes:\n- instance: {{group: g, transform: {steps}}}\n"
            ));
            let mut random = Random::new(3);
            let (mut met, mut on) = (0, 0);
            for _ in 0..20_000 {
                let mut pair = [ray(&mut random, placed.center, placed.radius); 2];
                let mut tolerance = 0.0;
                for _ in 0..3 {
                    let hits = [placed.closest(&pair[0], f64::INFINITY), copied.closest(&pair[1], f64::INFINITY)];
                    let [Some(a), Some(b)] = hits else {
                        assert!(hits[0].is_none() && hits[1].is_none(), "{shape} {steps} {hits:?}");
                        break;
                    };
                    met += 1;
                    assert_eq!((b.instance, b.object), (Some(0), 1));
                    let (sa, sb) = (placed.surface(&pair[0], &a), copied.surface(&pair[1], &b));
                    // Rays that go on start a step of 2⁻⁴⁶ of their scales apart, which are below 2000, and are
                    // off at the next surface by as much more as their slope there is less.
                    tolerance = (tolerance + 2000.0 / (1u64 << 46) as f64) / sa.normal.dot(pair[0].direction).abs();
                    if tolerance > 1e-9 {
                        break;
                    }
                    assert!((a.t - b.t).abs() < tolerance && a.part == b.part, "{shape} {steps} {a:?} {b:?}");
                    assert!((sa.point - sb.point).length() < tolerance);
                    // Both maps mirror: the normal stays on the side where the shape has it.
                    assert!((sa.normal - sb.normal).length() < 1e-13, "{shape} {sa:?} {sb:?}");
                    assert!((sa.uv - sb.uv).length() < tolerance);
                    assert!((sa.tangent - sb.tangent).length() < 1e-12 * sa.tangent.length());
                    let direction = random.direction();
                    pair = [placed.leave(&sa, &a, direction), copied.leave(&sb, &b, direction)];
                    on += 1;
                    for distance in [0.1, 10.0] {
                        let blocked =
                            [placed.occluded(&pair[0], distance, None), copied.occluded(&pair[1], distance, None)];
                        assert_eq!(blocked[0], blocked[1], "{shape} {steps}");
                    }
                }
            }
            assert!(met > 500 && on > 500, "{met} {on}");
        }
    }
}

/// The inverse times the map is one to within the rounding of the entries of the inverse, however skewed
/// the map is: here the condition number is 2·10⁹.
#[test]
fn inverses_are_exact_to_the_rounding_of_their_entries() {
    let m = DMat3::from_cols(DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 1.0 + 1e-9, 0.0), DVec3::new(3.0, 5.0, 2.0));
    let map = AffineMap::new(DAffine3 { matrix3: m, translation: DVec3::new(1.0, 2.0, 3.0) }).unwrap();
    let n = map.object_from_world.matrix3;
    for (row, exact) in [n.row(0), n.row(1), n.row(2)].into_iter().zip([DVec3::X, DVec3::Y, DVec3::Z]) {
        let product = [m.x_axis, m.y_axis, m.z_axis].map(|column| Dd3::from(row).dot(Dd3::from(column)).to_f64());
        // Each entry of the row is off by at most 2⁻⁵³ of itself.
        let bound = m.transpose().abs() * row.abs() * f64::EPSILON;
        let error = (DVec3::from(product) - exact).abs();
        assert!(error.cmple(bound).all(), "{error} {bound}");
    }
    let flat = DAffine3 { matrix3: DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z), translation: DVec3::ZERO };
    assert!(AffineMap::new(flat).unwrap_err().starts_with("expected a transform that can be inverted"));
}

/// Stretched spheres, far from the origin: every ray that enters comes out once, along any path of
/// refractions, and never meets the point it left.
#[test]
fn a_stretched_sphere_is_entered_and_left_once() {
    for translate in ["0, 0, 0", "1e5, -3e4, 10"] {
        let copied = scene(&format!(
            "groups: {{g: [{{sphere: {{radius: 1}}}}]}}\nshapes:\n- instance: {{group: g, transform: [{{scale: [1, 30, 0.1]}}, \
             {{rotate: {{axis: [1, 2, 3], deg: 40}}}}, {{translate: [{translate}]}}]}}\n"
        ));
        let mut random = Random::new(4);
        let (mut inside, mut chords) = (0, 0);
        for _ in 0..20_000 {
            let start = ray(&mut random, copied.center, 0.3);
            let Some(hit) = copied.closest(&start, f64::INFINITY) else { continue };
            let surface = copied.surface(&start, &hit);
            let enters = start.direction.dot(surface.normal) < 0.0;
            inside += u32::from(!enters);
            let d = random.direction();
            let inward = d * -d.dot(surface.normal).signum();
            // Along the surface rounding decides; elsewhere one more crossing, outward, and no third.
            if inward.dot(surface.normal).abs() < 1e-6 {
                continue;
            }
            let through = copied.leave(&surface, &hit, inward);
            let exit = copied.closest(&through, f64::INFINITY).expect("a way out");
            let out = copied.surface(&through, &exit);
            assert!(out.normal.dot(inward) > 0.0);
            assert!(copied.closest(&copied.leave(&out, &exit, inward), f64::INFINITY).is_none());
            assert!(copied.closest(&copied.leave(&surface, &hit, -inward), f64::INFINITY).is_none());
            chords += 1;
        }
        assert!(chords > 1000 && inside > 0, "{chords} {inside}");
    }
}

/// Two unit boxes of one group that share a face, in a skewed copy: a ray that leaves one through the shared
/// face meets the other at once, or has passed it by the step off the surface; it never sees a third thing.
#[test]
fn neighbours_in_a_copy_are_cleared_by_the_step() {
    let copied = scene(&format!(
        "groups: {{g: [{{cube: {{size: 2}}}}, {{cube: {{size: 2, center: [2, 0, 0]}}}}]}}\n\
         shapes:\n- instance: {{group: g, transform: {SKEWED}}}\n"
    ));
    let mut random = Random::new(5);
    let mut crossed = 0;
    for _ in 0..20_000 {
        let start = ray(&mut random, copied.center, copied.radius);
        let (mut at, mut parity) = (start, [0; 2]);
        while let Some(hit) = copied.closest(&at, f64::INFINITY) {
            let surface = copied.surface(&at, &hit);
            parity[hit.object as usize - 1] += if at.direction.dot(surface.normal) < 0.0 { 1 } else { -1 };
            at = copied.leave(&surface, &hit, at.direction);
            crossed += 1;
            assert!(crossed < 200_000);
        }
        // A neighbour's face that the step has jumped costs its entry or its exit, so only a box that was
        // entered by its own face is sure to be left.
        assert!(parity.iter().all(|p| (-1..=1).contains(p)), "{parity:?}");
    }
    assert!(crossed > 4000, "{crossed}");
}

#[test]
fn faults_of_groups_are_told() {
    let fault = |text: &str| match SceneDescription::parse(&format!("{CAMERA}{text}"), Path::new("s.yaml")) {
        Ok(_) => "none".to_owned(),
        Err(error) => error.to_string(),
    };
    let cases = [
        (
            "groups: {tree: [{sphere: {radius: 1}}]}\nshapes:\n- instance: {group: tre}\n",
            "s.yaml:4:21: shapes[0].instance.group: unknown group \"tre\"; did you mean \"tree\"?",
        ),
        (
            "groups: {tree: [{sphere: {radius: 1, emission: 3}}]}\n",
            "s.yaml:2:48: groups.tree[0].sphere.emission: expected no light in a group: only shapes of the scene itself shine",
        ),
        ("groups: {tree: []}\n", "s.yaml:2:16: groups.tree: expected one shape or more, found an empty list"),
        (
            "groups: {tree: [{sphere: {radius: 1}}]}\nshapes:\n- instance: {group: tree, emission: 3}\n",
            "s.yaml:4:37: shapes[0].instance.emission: expected no such field of an instance: the shapes of its group have their own",
        ),
        // Also where it says what a shape has without it.
        (
            "groups: {tree: [{sphere: {radius: 1}}]}\nshapes:\n- instance: {group: tree, material: {diffuse: {}}, inside: }\n",
            "s.yaml:4:37: shapes[0].instance.material: expected no such field of an instance: the shapes of its group have their own",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(fault(text), expected);
    }
    let nested = "groups: {a: [{sphere: {radius: 1}}], b: [{instance: {group: a}}]}\n";
    assert!(fault(nested).contains("expected a shape, found an instance"), "{}", fault(nested));
}
