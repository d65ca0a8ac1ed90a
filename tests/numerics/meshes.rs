//! Meshes through the whole renderer: no light at edges and vertices, slivers and shears, grazing light, far places.

use crate::xml::{Answer, BLACK, BRIGHT, Case, DIRECT, GREY, NULL, SKY, camera, glass, hold, list, parallel, shape};
use std::fmt::Write;

/// A closed mesh.
#[derive(Clone)]
pub struct Solid {
    pub points: Vec<[f64; 3]>,
    pub faces: Vec<[usize; 3]>,
}

/// An icosahedron whose edges were halved `levels` times, its vertices on the unit sphere.
pub fn icosphere(levels: u32) -> Solid {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let mut points: Vec<[f64; 3]> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    let distance = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let mut faces = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if [(i, j), (j, k), (i, k)].iter().all(|&(a, b)| distance(points[a], points[b]) < 2.1) {
                    let outward = dot(cross(points[i], points[j]), points[k]) > 0.0;
                    faces.push(if outward { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    let unit = |p: [f64; 3]| p.map(|x| x / dot(p, p).sqrt());
    points.iter_mut().for_each(|p| *p = unit(*p));
    for _ in 0..levels {
        let mut between = std::collections::HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let mut middle = |i: usize, j: usize| {
                *between.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    points.push(unit(std::array::from_fn(|k| points[i][k] + points[j][k])));
                    points.len() - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = finer;
    }
    Solid { points, faces }
}

impl Solid {
    pub fn map(&self, f: impl Fn([f64; 3]) -> [f64; 3]) -> Solid {
        Solid { points: self.points.iter().map(|p| f(*p)).collect(), faces: self.faces.clone() }
    }

    pub fn obj(&self) -> String {
        let mut text = String::new();
        for p in &self.points {
            writeln!(text, "v {:?} {:?} {:?}", p[0], p[1], p[2]).unwrap();
        }
        for f in &self.faces {
            writeln!(text, "f {} {} {}", f[0] + 1, f[1] + 1, f[2] + 1).unwrap();
        }
        text
    }
}

fn mesh(to_world: &str, inside: &str) -> String {
    shape(
        "obj",
        to_world,
        &format!("<string name=\"filename\" value=\"m.obj\"/><boolean name=\"face_normals\" value=\"true\"/>{inside}"),
    )
}

const DARK: &str =
    "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"0.9\"/></bsdf></bsdf>";

/// The camera in a closed mesh under a sky of 1e6, looking at its vertices: black in every pixel. Pixels of a pinhole
/// that span 1e-12 degrees look at the vertex itself, within rounding.
#[test]
fn closed_meshes_leak_nowhere() {
    let mut cases = Vec::new();
    let black = Answer::Every(0.0, 0.0);
    let ball = icosphere(2);
    for (name, to) in [
        ("as it is", ""),
        ("at 1e6", "<translate x=\"1e6\" y=\"-3e5\" z=\"2e4\"/>"),
        ("tiny", "<scale value=\"1e-6\"/>"),
        ("huge", "<scale value=\"1e7\"/>"),
        ("stretched", "<scale x=\"30\" y=\"1\" z=\"0.05\"/><rotate x=\"1\" y=\"2\" z=\"3\" angle=\"40\"/>"),
        ("sheared", "<matrix value=\"1 5 0 0  0 1 -7 0  3 0 1 0  0 0 0 1\"/>"),
        ("mirrored and moved", "<scale x=\"-1\"/><translate x=\"1e4\"/>"),
    ] {
        let points = transformed(&ball, to);
        let centre = mean(&points);
        for i in [0, 3, 17, 40, 100] {
            let target = points[i % points.len()];
            for fov in [1e-12, 1e-6, 60.0] {
                let body = camera(centre, target, fov) + &mesh(to, DARK) + BRIGHT;
                cases.push(
                    Case::new(format!("{name}, vertex {i}, fov {fov:e}"), body, black)
                        .file("m.obj", ball.obj())
                        .side(8),
                );
            }
        }
    }
    hold(&cases);
}

/// What the words of a transform do to the points: through the importer itself, by way of a scene.
fn transformed(solid: &Solid, to: &str) -> Vec<[f64; 3]> {
    let body = camera([0.0, 0.0, 5.0], [0.0; 3], 10.0) + &mesh(to, BLACK);
    let bench = Case::new("", body, Answer::Every(0.0, 0.0)).file("m.obj", solid.obj()).bench().unwrap();
    let abbe::scene::Geometry::Mesh(mesh) = &bench.prepared.scene.objects[0].geometry else { panic!("a mesh") };
    mesh.mesh.positions.iter().map(|p| (mesh.mesh.origin + glam::DVec3::from(p.map(f64::from))).to_array()).collect()
}

fn mean(points: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64)
}

/// A closed mesh, convex and diffuse, of albedo ½ in an even sky: ½ in every pixel; of clear glass: 1.
#[test]
fn convex_meshes_in_even_light_show_their_albedo() {
    let mut cases = Vec::new();
    let ball = icosphere(2);
    for (name, to, centre, distance, seen) in [
        ("as it is", String::new(), [0.0; 3], 5.0f64, 0.3),
        ("tiny", "<scale value=\"1e-8\"/>".into(), [0.0; 3], 5e-8, 3e-9),
        ("huge", "<scale value=\"1e8\"/>".into(), [0.0; 3], 5e8, 3e7),
        ("far", "<translate x=\"1e7\" y=\"1e7\"/>".into(), [1e7, 1e7, 0.0], 5.0, 0.3),
        ("flat", "<scale x=\"1\" y=\"1\" z=\"1e-6\"/>".into(), [0.0; 3], 5.0, 0.3),
        ("a needle", "<scale x=\"1e-5\" y=\"1\" z=\"1\"/>".into(), [0.0; 3], 5.0, 3e-6),
        ("sheared", "<matrix value=\"1 40 0 0  0 1 0 0  0 0 1 0  0 0 0 1\"/>".into(), [0.0; 3], 5.0, 5e-3),
    ] {
        let fov = (2.0 * seen / distance).to_degrees();
        let eye = [centre[0], centre[1], centre[2] + distance];
        let grey = camera(eye, centre, fov) + &mesh(&to, GREY) + SKY;
        cases.push(Case::new(format!("grey {name}"), grey, Answer::Every(0.5, 2e-6)).file("m.obj", ball.obj()));
        if name == "a needle" {
            // Seen edge-on; what goes in is caught between its faces for long.
            continue;
        }
        let clear = camera(eye, centre, fov) + &mesh(&to, &glass(1.5, 1.0)) + SKY;
        cases.push(Case::new(format!("glass {name}"), clear, Answer::Every(1.0, 2e-5)).file("m.obj", ball.obj()));
        let null = camera(eye, centre, fov) + &mesh(&to, NULL) + SKY;
        cases.push(Case::new(format!("null {name}"), null, Answer::Every(1.0, 2e-6)).file("m.obj", ball.obj()));
    }
    hold(&cases);
}

/// A plane of n × n × 2 triangles from −s to s at height y.
fn plane(n: usize, s: f64, at: [f64; 3]) -> Solid {
    let mut solid = Solid { points: Vec::new(), faces: Vec::new() };
    for i in 0..=n {
        for j in 0..=n {
            let x = |k: usize| s * (2.0 * k as f64 / n as f64 - 1.0);
            solid.points.push([at[0] + x(i), at[1], at[2] + x(j)]);
        }
    }
    for i in 0..n {
        for j in 0..n {
            let v = |a: usize, b: usize| (i + a) * (n + 1) + j + b;
            solid.faces.extend([[v(0, 0), v(0, 1), v(1, 1)], [v(0, 0), v(1, 1), v(1, 0)]]);
        }
    }
    solid
}

/// Case O17: a flat plane of 2e4 triangles under a sun at 89.99° and beyond: every pixel ρ/π·E·cos. cos is of the angle
/// that the file gives in decimal; f32 light carries 1e-6.
#[test]
fn a_flat_plane_of_triangles_is_lit_evenly_by_a_grazing_sun() {
    let mut cases = Vec::new();
    for deg in [45.0, 89.0, 89.9, 89.99, 89.9999] {
        for (s, at) in [(1.0, [0.0; 3]), (1.0, [1e5, 0.0, -1e5]), (1e-6, [0.0; 3]), (1e6, [0.0, 3e3, 0.0])] {
            let (sin, cos) = f64::to_radians(deg).sin_cos();
            // Not along the rows.
            let d = [0.6 * sin, -cos, 0.8 * sin];
            let sun = format!(
                "<emitter type=\"directional\"><vector name=\"direction\" value=\"{}\"/><spectrum name=\"irradiance\" value=\"{:?}\"/></emitter>",
                list(d),
                2.0 * std::f64::consts::PI / cos
            );
            let eye = [at[0] + 0.3 * s, at[1] + 3.0 * s, at[2] + 0.1 * s];
            for normals in ["", "<boolean name=\"face_normals\" value=\"true\"/>"] {
                let body = camera(eye, at, 30.0)
                    + &shape("obj", "", &format!("<string name=\"filename\" value=\"m.obj\"/>{normals}{GREY}"))
                    + &sun;
                let case = Case::new(
                    format!("sun at {deg}, plane of {s:e} at {at:?} {}", normals.len()),
                    body,
                    Answer::Every(1.0, 1e-5),
                );
                cases.push(case.file("m.obj", plane(100, s, at).obj()).integrator(DIRECT));
            }
        }
    }
    hold(&cases);
}

/// Slivers of 1 : 1e7 and triangles without area among others: a plane cut into them is a plane; the sky does not show through.
#[test]
fn slivers_and_triangles_without_area_leave_no_holes() {
    let mut cases = Vec::new();
    for width in [1e-2, 1e-5, 1e-7] {
        // Strips of that width in the middle of the plane, each of two triangles, and between them degenerate ones.
        let mut solid = Solid { points: Vec::new(), faces: Vec::new() };
        let mut x = vec![-1.0];
        x.extend((-20..=20).map(|i| f64::from(i) * width));
        x.push(1.0);
        for x in &x {
            solid.points.extend([[*x, -1.0, 0.0], [*x, 1.0, 0.0]]);
        }
        for i in 0..x.len() - 1 {
            let v = 2 * i;
            solid.faces.extend([[v, v + 2, v + 1], [v + 1, v + 2, v + 3], [v, v, v + 1], [v, v + 1, v], [v, v + 2, v]]);
        }
        for half in [30.0 * width, 0.9] {
            let body = parallel([0.0, 0.0, 5.0], [0.0; 3], half)
                + &mesh(
                    "",
                    "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"0\"/></bsdf></bsdf>",
                )
                + BRIGHT;
            cases.push(
                Case::new(format!("strips of {width:e}, {half:e}"), body, Answer::Every(0.0, 0.0))
                    .file("m.obj", solid.obj())
                    .samples(64),
            );
        }
    }
    hold(&cases);
}

/// Case O16: the sphere of Embree's verify.cpp, radius 2 at (148376, 1234, −223423), here of 20480 triangles. Embree allows
/// 2e-5 of the rays to miss; of 4e5 from outside through its middle third, at vertices, edges and anywhere, none may, and
/// each comes out once.
#[test]
fn embrees_tessellated_sphere_is_watertight() {
    let to = "<scale value=\"2\"/><translate x=\"148376\" y=\"1234\" z=\"-223423\"/>";
    let body = camera([0.0; 3], [1.0, 0.0, 0.0], 10.0) + &mesh(to, BLACK);
    let bench = Case::new("", body, Answer::Every(0.0, 0.0)).file("m.obj", icosphere(5).obj()).bench().unwrap();
    let scene = &bench.prepared.scene;
    let abbe::scene::Geometry::Mesh(mesh) = &scene.objects[0].geometry else { panic!("a mesh") };
    let (mesh, centre) = (&mesh.mesh, glam::DVec3::new(148376.0, 1234.0, -223423.0));
    let mut state = 16u64;
    let mut next = || {
        state = abbe::math::sampler::mix64(state);
        (state >> 11) as f64 * 0.5f64.powi(53)
    };
    for i in 0..400_000 {
        let [a, b, _] = mesh.vertices((next() * mesh.triangles.len() as f64) as u32);
        let on = mesh.origin + if i % 3 == 0 { a } else { a.lerp(b, next()) };
        let target = if i % 3 == 2 { centre + (on - centre) * (0.6 * next()) } else { on };
        let away =
            (on - centre).normalize() + glam::DVec3::new(0.5 * next() - 0.25, 0.5 * next() - 0.25, 0.5 * next() - 0.25);
        let origin = target + away * 10f64.powf(4.0 * next() + 0.7);
        let ray = abbe::math::Ray::new(origin, (target - origin).normalize());
        let hit = scene.closest(&ray, f64::INFINITY).unwrap_or_else(|| panic!("missed: {ray:?}"));
        let surface = scene.surface(&ray, &hit);
        let inside = scene.leave(&surface, &hit, ray.direction);
        assert!(scene.closest(&inside, f64::INFINITY).is_some(), "no way out: {ray:?} {surface:?}");
    }
}
