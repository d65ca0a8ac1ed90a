//! Surfaces whose points each send their light along the normal, as a collimated lamp does.
//!
//! Light reaches a point from where a normal of the surface passes through it. Every shape is convex, so
//! from outside that is the nearest point, if any; within a cube that shines inward there is one on each
//! face. The beam that leaves a small area spreads with the curvature of the surface: at a distance h its
//! area has grown by (1 + h κ₁)(1 + h κ₂), and the irradiance across it has shrunk by that.

use super::Geometry;
use super::light::Arriving;
use super::shape::Shape;
use super::texture::{Texture, TexturePoint};
use crate::math::{Departure, Ray};
use crate::spectrum::Lanes;
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

/// The most faces of a shape.
const FACES: u8 = 6;

/// How near to a surface a point may be and still be in its light, relative to the lengths that the distance is computed from:
/// points of a surface are good to some eight roundings each, and light that leaves a point does not come back to it.
const NEAREST: f64 = 32.0 * f64::EPSILON;

/// Light at `from`; `facing` is −1 where the surface shines against its own normal, else 1. Of several faces that shine there
/// `u` chooses one. A mesh is asked at one triangle, which `u` chooses by area.
#[must_use]
pub fn arriving(
    geometry: &Geometry,
    facing: f64,
    object: u32,
    exitance: &Texture,
    from: DVec3,
    u: DVec2,
    nm: Lanes,
) -> Option<Arriving> {
    match geometry {
        Geometry::Shape(shape) => {
            let feet = feet(shape, facing, from);
            let foot = feet.get((u.x * feet.len() as f64) as usize)?;
            let surface = shape.surface(foot.point, foot.face);
            let at = TexturePoint::new(&surface, u32::from(foot.face), [0.0; 2]);
            Some(Arriving {
                wi: foot.direction,
                distance: foot.distance,
                radiance: exitance.eval(&at, nm) * (foot.spread * feet.len() as f64) as f32,
                density: None,
                target: Some(Departure::new(object, u32::from(foot.face))),
            })
        }
        Geometry::Mesh(mesh) => {
            let (triangle, _) = mesh.areas.sample(u.x)?;
            let [a, b, c] = mesh.mesh.vertices(triangle);
            let (e1, e2, p) = (b - a, c - a, from - mesh.mesh.origin - a);
            let normal = e1.cross(e2) * facing;
            let twice = normal.length_squared();
            let (b1, b2) = (p.cross(e2).dot(normal) * facing / twice, e1.cross(p).dot(normal) * facing / twice);
            let height = p.dot(normal) / twice.sqrt();
            let nearest = NEAREST * (a + mesh.mesh.origin).abs().max(from.abs()).max_element();
            if !(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0 && height > nearest) {
                return None;
            }
            let surface = mesh.mesh.surface(triangle, b1, b2);
            let probability = 0.5 * twice.sqrt() / mesh.areas.total();
            let at = TexturePoint::new(&surface, triangle, [b1, b2]);
            Some(Arriving {
                wi: -surface.normal * facing,
                distance: height,
                radiance: exitance.eval(&at, nm) * (1.0 / probability) as f32,
                density: None,
                target: Some(Departure::new(object, triangle)),
            })
        }
        // They do not shine.
        Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => None,
    }
}

/// Where the normal of a surface passes through a point.
struct Foot {
    /// From the point to `point`, unit.
    direction: DVec3,
    distance: f64,
    point: DVec3,
    face: u8,
    /// The area of the beam at the surface over that at the point.
    spread: f64,
}

fn feet(shape: &Shape, facing: f64, from: DVec3) -> ArrayVec<Foot, { FACES as usize }> {
    let foot = |face| {
        let normal = shape.surface_with(from, face, super::shape::Detail::Geometry).normal * facing;
        let hit = shape.intersect(&Ray::new(from, -normal), f64::INFINITY, None).filter(|hit| hit.face == face)?;
        let surface = shape.surface_with(from - normal * hit.t, face, super::shape::Detail::Geometry);
        let outward = surface.normal * facing;
        let nearest = NEAREST * surface.scale.max(from.abs().max_element());
        // Light that comes from the inside, or is the point's own. Beyond the apex of a cone the normal of the near side
        // leads to the far one, which shines elsewhere.
        if outward.dot(normal) <= 0.0 || hit.t <= nearest || !shape.share_azimuth(from, surface.point, face) {
            return None;
        }
        let [k1, k2] = shape.curvatures(surface.point, face);
        let spread = 1.0 / (hit.t.mul_add(k1 * facing, 1.0) * hit.t.mul_add(k2 * facing, 1.0));
        Some(Foot { direction: -outward, distance: hit.t, point: surface.point, face, spread })
    };
    (0..FACES).filter_map(foot).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shape::testing::Random;
    use crate::scene::shape::{Cone, Cube, Cylinder, Disk, Sphere};
    use crate::scene::{TriangleMesh, mesh};
    use glam::{DAffine3, DMat3};

    fn light(geometry: &Geometry, from: DVec3, u: DVec2) -> Option<Arriving> {
        arriving(geometry, 1.0, 0, &Texture::one(), from, u, Lanes::splat(550.0))
    }

    fn of_shape(shape: impl Into<Shape>, from: DVec3) -> Option<(DVec3, f64, f64)> {
        let a = light(&Geometry::Shape(shape.into()), from, DVec2::splat(0.5))?;
        Some((a.wi, a.distance, f64::from(a.radiance.to_array()[0])))
    }

    /// Power is kept: what leaves an area r² dω of a sphere passes d² dω; what leaves r dφ of a cylinder
    /// passes ρ dφ; of a cone likewise, on the circle through the foot; of a plane all of it, above it.
    #[test]
    fn irradiance_is_the_closed_form() {
        let close = |found: Option<(DVec3, f64, f64)>, direction: DVec3, distance: f64, irradiance: f64| {
            let (wi, t, e) = found.expect("light");
            assert!((wi - direction).length() < 1e-14 && (t - distance).abs() < 1e-14, "{wi} {t}");
            // One rounding to f32.
            assert!((e / irradiance - 1.0).abs() < 2e-7, "{e} {irradiance}");
        };
        let sphere = Sphere::new(DVec3::X, 0.5, DMat3::IDENTITY).unwrap();
        close(of_shape(Shape::Sphere(sphere), DVec3::new(1.0, 2.0, 0.0)), -DVec3::Y, 1.5, 0.0625);
        let disk = || Shape::Disk(Disk::new(DVec3::ZERO, DVec3::X, DVec3::Y).unwrap());
        close(of_shape(disk(), DVec3::new(0.3, -0.4, 7.0)), -DVec3::Z, 7.0, 1.0);
        let pipe = || Shape::Cylinder(Cylinder::new(DVec3::ZERO, DVec3::Y * 2.0, 0.5, true, true).unwrap());
        close(of_shape(pipe(), DVec3::new(0.0, 0.7, 2.0)), -DVec3::Z, 1.5, 0.25);
        close(of_shape(pipe(), DVec3::new(0.1, 5.0, 0.2)), -DVec3::Y, 3.0, 1.0);
        let cube = || Shape::Cube(Cube::new(DVec3::ZERO, [DVec3::X, DVec3::Y, DVec3::Z]).unwrap());
        close(of_shape(cube(), DVec3::new(-3.0, 0.5, 0.9)), DVec3::X, 2.0, 1.0);
        // Height and radius 1: at the foot (½, ½, 0), and √2 further along (1, 1, 0) / √2 at a distance of 3/2.
        let cone = Cone::new(DVec3::ZERO, DVec3::Y, 1.0, true).unwrap();
        let slope = DVec3::new(1.0, 1.0, 0.0) / 2f64.sqrt();
        close(of_shape(Shape::Cone(cone), DVec3::new(1.5, 1.5, 0.0)), -slope, 2f64.sqrt(), 1.0 / 3.0);

        // Beside the beam, behind it and inside there is none.
        assert!(of_shape(disk(), DVec3::new(0.9, -0.9, 1.0)).is_none());
        assert!(of_shape(disk(), DVec3::new(0.1, 0.1, -1.0)).is_none());
        assert!(of_shape(pipe(), DVec3::new(0.1, 1.0, 0.1)).is_none());
        assert!(of_shape(pipe(), DVec3::new(2.0, 5.0, 0.1)).is_none());
        assert!(of_shape(cube(), DVec3::new(2.0, 2.0, 0.1)).is_none());
    }

    /// From each point of the side of a tilted cone along its normal, next to the apex as well, the way back leads there; far from
    /// the origin, too. Above a blunt apex no side shines: the normal of the near side leads to the far one.
    #[test]
    fn every_point_on_a_normal_is_lit() {
        let mut random = Random::new(4);
        for centre in [DVec3::ZERO, DVec3::new(1e5, -1e5, 1e5)] {
            let cone = Shape::Cone(
                Cone::new(centre + DVec3::new(1.2, 2.2, 0.5), centre + DVec3::new(0.6, 1.4, 0.2), 0.5, false).unwrap(),
            );
            for _ in 0..20_000 {
                let sample = cone.sample_area(random.pair());
                let height = random.log_uniform(-3.0, 1.0);
                let (_, distance, _) = of_shape(cone.clone(), sample.point + sample.normal * height).expect("light");
                // A few roundings of the largest coordinate.
                let largest = centre.x.max(1.0) + height;
                assert!((distance - height).abs() < 1e-14 * largest, "{height} {distance}");
            }
        }
        let blunt = Cone::new(DVec3::ZERO, DVec3::Y * 0.1, 1.0, true).unwrap();
        assert!(of_shape(Shape::Cone(blunt), DVec3::new(0.01, 0.3, 0.0)).is_none());
    }

    /// What shines outward leaves its own inside and back dark, which lie where its light begins.
    #[test]
    fn a_surface_does_not_light_itself() {
        let mut random = Random::new(5);
        let (base, top) = (DVec3::new(0.1, 0.0, -1.0), DVec3::new(0.0, 0.13, 1.0));
        let tube = Shape::Cylinder(Cylinder::new(base, top, 0.37, false, false).unwrap());
        let cone = Shape::Cone(Cone::new(base, top, 0.37, false).unwrap());
        let ball = Shape::Sphere(Sphere::new(base, 0.37, DMat3::IDENTITY).unwrap());
        for shape in [tube, cone, ball] {
            for _ in 0..20_000 {
                let sample = shape.sample_area(random.pair());
                let found = of_shape(shape.clone(), shape.surface(sample.point, sample.face).point);
                assert!(found.is_none(), "{shape:?} {} {found:?}", sample.point);
            }
        }
    }

    /// Within a cube turned inside out each face lights a point by its exitance, from its own side: over u each of the six is asked
    /// as often, for six times that.
    #[test]
    fn each_face_of_a_cube_turned_inside_out_lights_its_inside() {
        let cube = Cube::new(DVec3::ZERO, [DVec3::X, DVec3::Y, DVec3::Z]).unwrap();
        let geometry = Geometry::Shape(Shape::Cube(cube));
        let from = DVec3::new(0.1, -0.2, 0.3);
        let mut sides: Vec<DVec3> = Vec::new();
        for i in 0..6 {
            let u = DVec2::new((f64::from(i) + 0.5) / 6.0, 0.5);
            let light = arriving(&geometry, -1.0, 0, &Texture::one(), from, u, Lanes::splat(550.0)).expect("light");
            assert_eq!(light.radiance.to_array()[0], 6.0);
            // The wall is at 1 along an axis.
            assert!((light.distance - (1.0 - from.dot(light.wi))).abs() < 1e-14, "{} {}", light.wi, light.distance);
            sides.push(light.wi);
        }
        assert_eq!(sides.iter().sum::<DVec3>(), DVec3::ZERO);
        assert!((0..6).all(|i| (0..i).all(|j| sides[i].dot(sides[j]) < 0.5)), "{sides:?}");
    }

    /// Two triangles of areas 1 and 3: the mean over u of what one of them gives is the exitance, at the origin and far from it.
    #[test]
    fn triangles_of_a_mesh_give_the_exitance_in_the_mean() {
        let source = mesh::MeshSource {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::new(0.0, 2.0, 0.0), DVec3::new(-3.0, 0.0, 0.0)],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..mesh::MeshSource::default()
        };
        for place in [DVec3::ZERO, DVec3::new(1024.0, 2048.0, -512.0)] {
            let moved = DAffine3::from_translation(place);
            let made = mesh::Mesh::new(&source, &moved, mesh::NormalMode::Face, mesh::Winding::Object).unwrap();
            let (tree, areas) = (Some(mesh::MeshTree::build(&made)), mesh::AreaTable::new(&made));
            let geometry = Geometry::Mesh(Box::new(TriangleMesh { mesh: made, tree, areas }));
            for from in [DVec3::new(0.2, 0.4, 1.0), DVec3::new(-0.2, 0.4, 2.0)] {
                let at = |i: u32| light(&geometry, place + from, DVec2::new((f64::from(i) + 0.5) / 64.0, 0.5));
                let found: Vec<Arriving> = (0..64).filter_map(at).collect();
                assert!(found.iter().all(|a| a.wi == -DVec3::Z && a.distance == from.z), "{place} {from}: {found:?}");
                let mean = found.iter().map(|a| f64::from(a.radiance.to_array()[0])).sum::<f64>() / 64.0;
                assert!((mean - 1.0).abs() < 1e-6, "{place} {from}: {mean}");
            }
            let beside = place + DVec3::new(0.9, 1.9, 1.0);
            assert!((0..64).all(|i| light(&geometry, beside, DVec2::splat(f64::from(i) / 64.0)).is_none()));
        }
    }
}
