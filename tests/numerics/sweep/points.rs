//! How far hit points are from the true surface.

use crate::Found;
use crate::math::Ray;
use crate::math::dd::{Dd, Dd3};
use crate::scene::shape::{Cone, Cube, Cylinder, Disk, Plane, Rectangle, Shape, Sphere};
use crate::testing::Random;
use glam::{DMat3, DVec3};

/// Asked for: a millionth of the step of f32 numbers as large as what went into the point.
const MOST: f64 = 1e-6;

/// A shape with the distance from each of its faces, in arithmetic of 104 bits.
enum True {
    Sphere(DVec3, f64),
    Cube(DVec3, [DVec3; 3]),
    Cylinder(DVec3, DVec3, f64),
    Cone(DVec3, DVec3, f64),
    Flat(DVec3, Dd3),
}

impl True {
    fn distance(&self, point: DVec3, face: u8) -> f64 {
        let from = |o: DVec3| Dd3::from(point) - Dd3::from(o);
        let two = Dd::from(2.0);
        match *self {
            True::Sphere(center, radius) => {
                let (p, r) = (from(center), Dd::from(radius));
                ((p.dot(p) - r * r) / (two * r)).to_f64()
            }
            True::Cube(center, edges) => {
                let k = face as usize / 2;
                let [e, f, g] = [0, 1, 2].map(|i| Dd3::from(edges[(k + i) % 3]));
                let normal = f.cross(g);
                let volume = e.dot(normal);
                let height = if face % 2 == 1 { volume } else { -volume };
                ((from(center).dot(normal) - height) / normal.dot(normal).sqrt()).to_f64()
            }
            True::Cylinder(base, top, radius) => {
                let axis = Dd3::from(top) - Dd3::from(base);
                let (p, l2) = (from(base), axis.dot(axis));
                match face {
                    0 => {
                        let across = p.cross(axis);
                        let r = Dd::from(radius);
                        ((across.dot(across) / l2 - r * r) / (two * r)).to_f64()
                    }
                    1 => (p.dot(axis) / l2.sqrt()).to_f64(),
                    _ => ((p.dot(axis) - l2) / l2.sqrt()).to_f64(),
                }
            }
            True::Cone(base, apex, radius) => {
                let axis = Dd3::from(base) - Dd3::from(apex);
                let h = axis.dot(axis).sqrt();
                if face == 1 {
                    return (from(base).dot(axis) / h).to_f64();
                }
                let (p, r) = (from(apex), Dd::from(radius));
                let across = p.cross(axis);
                let rho = across.dot(across).sqrt() / h;
                ((rho * h - p.dot(axis) / h * r) / (h * h + r * r).sqrt()).to_f64()
            }
            True::Flat(origin, normal) => (from(origin).dot(normal) / normal.dot(normal).sqrt()).to_f64(),
        }
    }
}

fn shape(kind: usize, at: DVec3, size: f64, random: &mut Random) -> (Shape, True) {
    let m = random.rotation() * size;
    let end = at + random.direction() * size * random.log_uniform(-1.0, 1.0);
    let skew = m.y_axis + m.x_axis * random.range(-0.5, 0.5);
    let normal = Dd3::from(m.x_axis).cross(Dd3::from(skew));
    let made = match kind {
        0 => Sphere::new(at, size, DMat3::IDENTITY).map(|s| (Shape::Sphere(s), True::Sphere(at, size))),
        1 => {
            let edges = [m.x_axis, skew, m.z_axis * random.log_uniform(-1.0, 0.0)];
            Cube::new(at, edges).map(|s| (Shape::Cube(s), True::Cube(at, edges)))
        }
        2 | 3 => Cylinder::new(at, end, size, kind == 2, kind == 2)
            .map(|s| (Shape::Cylinder(s), True::Cylinder(at, end, size))),
        4 | 5 => Cone::new(at, end, size, kind == 4).map(|s| (Shape::Cone(s), True::Cone(at, end, size))),
        6 => Disk::new(at, m.x_axis, skew).map(|s| (Shape::Disk(s), True::Flat(at, normal))),
        7 => Rectangle::new(at, m.x_axis, skew).map(|s| (Shape::Rectangle(s), True::Flat(at, normal))),
        _ => Plane::new(at, m.z_axis, m.x_axis).map(|s| (Shape::Plane(s), True::Flat(at, Dd3::from(m.z_axis)))),
    };
    made.expect("valid by construction")
}

/// Sizes over twelve decades, centres and origins of rays up to 1e6 sizes away; half of the rays pass near the silhouette.
pub fn ask(rays: u64, random: &mut Random, found: &mut Found) {
    while found.rays < rays {
        let kind = (random.uniform() * 9.0) as usize;
        let size = random.log_uniform(-6.0, 6.0);
        let at = random.direction() * size * random.log_uniform(-3.0, 6.0);
        let (shape, truth) = shape(kind, at, size, random);
        for _ in 0..8 {
            let on = shape.sample_area(random.pair());
            let direction = random.direction();
            let off = if random.uniform() < 0.5 { 0.0 } else { -size * random.log_uniform(-7.0, -1.0) };
            let target = on.point + on.normal * off;
            let ray = Ray::new(target - direction * size * random.log_uniform(0.0, 6.0), direction);
            let Some(hit) = shape.intersect(&ray, f64::INFINITY, None) else { continue };
            let s = shape.surface(ray.at(hit.t), hit.face);
            let ulp32 = 2f64.powi(s.scale.log2().floor() as i32 - 23);
            let error = truth.distance(s.point, hit.face).abs() / ulp32;
            found.worst = found.worst.max(error);
            found.note(if error <= MOST { Ok(1) } else { Err(format!("{error:e}: {shape:?} {ray:?} {s:?}")) });
        }
    }
}
