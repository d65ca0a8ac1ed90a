//! What robust intersectors cost beside textbook ones in single precision: nanoseconds a ray, shape by shape.
//!
//! `cargo bench --bench intersectors` prints a table in Markdown. Half the rays are aimed at the shape from four sizes
//! away, half pass it by; both intersectors get the same rays, in turn, eleven times. A figure is the median; the ratio is
//! the median of the eleven, with their range.

use abbe::math::Ray;
use abbe::math::sampler::mix64;
use abbe::math::warp::uniform_sphere;
use abbe::scene::mesh::TriangleRay;
use abbe::scene::shape::{Cone, Cube, Cylinder, Disk, Plane, Rectangle, Shape, Sphere, plain};
use glam::{DMat3, DVec2, DVec3, Vec3};
use std::hint::black_box;
use std::time::Instant;

const RAYS: usize = 4096;
const REPEATS: usize = 60;
const ROUNDS: usize = 11;

fn uniform(i: u64) -> f64 {
    (mix64(i) >> 11) as f64 / (1u64 << 53) as f64
}

fn direction(i: u64) -> DVec3 {
    uniform_sphere(DVec2::new(uniform(2 * i), uniform(2 * i + 1)))
}

/// Nanoseconds a ray.
fn time(mut once: impl FnMut(usize) -> f64) -> f64 {
    let start = Instant::now();
    let mut sum = 0.0;
    for _ in 0..REPEATS {
        for i in 0..RAYS {
            sum += once(i);
        }
    }
    black_box(sum);
    start.elapsed().as_secs_f64() * 1e9 / (RAYS * REPEATS) as f64
}

fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

fn row(name: &str, mut robust: impl FnMut(usize) -> f64, mut textbook: impl FnMut(usize) -> f64) {
    let (mut ours, mut theirs, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let (a, b) = (time(&mut robust), time(&mut textbook));
        ours.push(a);
        theirs.push(b);
        ratios.push(a / b);
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "| {name} | {:.1} | {:.1} | {:.2} ({:.2}-{:.2}) |",
        median(ours),
        median(theirs),
        ratios[ROUNDS / 2],
        ratios[1],
        ratios[ROUNDS - 2]
    );
}

fn main() {
    let (x, y, z) = (DVec3::X, DVec3::Y * 0.8, DVec3::new(0.1, 0.2, 1.2));
    let shapes = [
        ("sphere", Sphere::new(x * 0.1, 1.0, DMat3::IDENTITY).map(Shape::Sphere)),
        ("plane", Plane::new(x * 0.1, z, x).map(Shape::Plane)),
        ("disk", Disk::new(x * 0.1, x, y).map(Shape::Disk)),
        ("rectangle", Rectangle::new(-x - y, x * 2.0, y * 2.0).map(Shape::Rectangle)),
        ("cube", Cube::new(x * 0.1, [x, y, z]).map(Shape::Cube)),
        ("cylinder, capped", Cylinder::new(-z, z, 0.7, true, true).map(Shape::Cylinder)),
        ("cylinder, open", Cylinder::new(-z, z, 0.7, false, false).map(Shape::Cylinder)),
        ("cone, capped", Cone::new(-z, z, 0.9, true).map(Shape::Cone)),
    ];
    let rays: Vec<Ray> = (0..RAYS as u64)
        .map(|i| {
            let origin = direction(3 * i) * 4.0;
            let target = direction(3 * i + 1) * if i % 2 == 0 { 0.6 } else { 2.5 };
            Ray::new(origin, (target - origin).normalize())
        })
        .collect();
    let singles: Vec<(Vec3, Vec3)> = rays.iter().map(|r| (r.origin.as_vec3(), r.direction.as_vec3())).collect();
    println!("| shape | robust, f64, ns | textbook, f32, ns | ratio |\n|---|---|---|---|");
    for (name, shape) in shapes {
        let shape = shape.expect("a shape");
        let plain = shape.plain();
        row(
            name,
            |i| black_box(&shape).intersect(&rays[i], f64::INFINITY, None).map_or(0.0, |hit| hit.t),
            |i| {
                let (origin, direction) = singles[i];
                black_box(&plain).intersect(origin, direction, 1e-4, f32::INFINITY).map_or(0.0, |(t, _)| t.into())
            },
        );
    }
    let corners = [-x - y, x - y, y * 2.0 + z];
    let small = corners.map(|v| v.as_vec3());
    let single = small.map(|v| v.to_array());
    // A ray is made ready once for all triangles of a mesh, and those without area were sorted out.
    let ready: Vec<TriangleRay> = rays.iter().map(|ray| TriangleRay::new(ray, DVec3::ZERO)).collect();
    row(
        "triangle",
        |i| {
            let (ray, [a, b, c]) = (&ready[i], black_box(&single));
            // One by one, as a mesh has it.
            let axis = |k: usize| [f64::from(a[k]), f64::from(b[k]), f64::from(c[k])];
            let [x, y, z] = ray.axes;
            ray.meet([axis(x), axis(y), axis(z)]).map_or(0.0, |hit| hit.t)
        },
        |i| {
            let (origin, direction) = singles[i];
            plain::triangle(*black_box(&small), origin, direction, 1e-4, f32::INFINITY).map_or(0.0, f64::from)
        },
    );
}
