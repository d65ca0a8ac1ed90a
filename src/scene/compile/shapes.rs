//! Shapes where they stand in the world.

use super::attributes::{OfMesh, Surface};
use super::{Compiler, vec3, written};
use crate::error::{Error, Result};
use crate::math::Frame;
use crate::scene::Geometry;
use crate::scene::instance::{AffineMap, Instance};
use crate::scene::shape::{Cone, Cube, Cylinder, Disk, Layout, Plane, Rectangle, Shape, Sphere};
use glam::{DAffine3, DMat3, DMat4, DVec3};

impl Compiler<'_> {
    pub(super) fn geometry(&mut self, at: &str, shape: &written::Shape) -> Result<Option<Geometry>> {
        let m = shape.world_from_object();
        let point = |p: [f64; 3]| m.transform_point3(vec3(p));
        let vector = |v: [f64; 3]| m.transform_vector3(vec3(v));
        let determinant = DMat3::from_mat4(m).determinant();
        let mirrored = determinant < 0.0;
        // Uniform by the checks of the description for shapes that need it.
        let scale = libm::cbrt(determinant.abs());
        let made: std::result::Result<Shape, String> = match &shape.geometry {
            written::Geometry::Sphere(s) => {
                let rotation = DMat3::from_mat4(m) * (1.0 / scale);
                let made = Sphere::new(point(s.center), s.radius * scale, rotation);
                made.map(|sphere| Shape::Sphere(sphere.with_layout(layout(s.layout))))
            }
            written::Geometry::Plane(p) => {
                let normal = vec3(p.normal);
                let tangent = carried(m, normal, p.tangent.map(vec3)).unwrap_or_default();
                let made = Plane::new(point(p.point), normal_transform(m, normal), tangent);
                made.map(|plane| Shape::Plane(if mirrored { plane.mirrored() } else { plane }))
            }
            written::Geometry::Disk(d) => {
                let frame = match vec3(d.normal).try_normalize() {
                    Some(n) => Frame::by_least_turn(n),
                    None => {
                        self.fault(&format!("{at}.normal"), "expected a direction, found one of length zero");
                        return Ok(None);
                    }
                };
                let (u, v) = (vector((frame.s * d.radius).into()), vector((frame.t * d.radius).into()));
                let made = Disk::new(point(d.center), u, v);
                made.map(|disk| Shape::Disk(if mirrored { disk.mirrored() } else { disk }))
            }
            written::Geometry::Rectangle(r) => {
                let made = Rectangle::new(point(r.corner), vector(r.edge_u), vector(r.edge_v));
                made.map(|patch| Shape::Rectangle(if mirrored { patch.mirrored() } else { patch }))
            }
            written::Geometry::Cube(c) => {
                let [x, y, z] = c.size.xyz();
                let half = [[0.5 * x, 0.0, 0.0], [0.0, 0.5 * y, 0.0], [0.0, 0.0, 0.5 * z]].map(vector);
                Cube::new(point(c.center), half).map(|cube| Shape::Cube(cube.with_layout(layout(c.layout))))
            }
            written::Geometry::Cylinder(c) => {
                let (base, top) = match c.caps {
                    written::Caps::Both => (true, true),
                    written::Caps::None => (false, false),
                    written::Caps::Base => (true, false),
                    written::Caps::Top => (false, true),
                };
                let made = Cylinder::new(point(c.base), point(c.top), c.radius * scale, base, top);
                let along = vec3(c.top) - vec3(c.base);
                let made = match seam(m, along, c.seam.map(vec3)) {
                    Some((at, mirrored)) => made.and_then(|cylinder| cylinder.with_seam(at, mirrored)),
                    None => made,
                };
                made.map(Shape::Cylinder)
            }
            written::Geometry::Cone(c) => {
                let made = Cone::new(point(c.base), point(c.apex), c.radius * scale, c.cap);
                let made = match seam(m, vec3(c.apex) - vec3(c.base), None) {
                    Some((at, mirrored)) => made.and_then(|cone| cone.with_seam(at, mirrored)),
                    None => made,
                };
                made.map(Shape::Cone)
            }
            written::Geometry::SdfGrid(grid) => return self.sdf_grid(at, grid, &DAffine3::from_mat4(m)),
            written::Geometry::Curves(curves) => return self.curves(at, curves, &DAffine3::from_mat4(m)),
            written::Geometry::Mesh(mesh) => {
                self.files.push(mesh.file.to_path_buf());
                let place = format!("{at}.file");
                let source = self.meshes.source(mesh).map_err(|e| self.asked(&place, e))?;
                let made = self
                    .meshes
                    .take(at, &source, mesh, &DAffine3::from_mat4(m))
                    .map_err(|message| self.asked(&place, Error::input(&mesh.file, message)))?;
                self.lie_on(Surface::Mesh(OfMesh::new(source, &made.mesh)));
                return Ok(Some(Geometry::Mesh(Box::new(made))));
            }
            written::Geometry::Instance(instance) => {
                let group = self.groups[instance.group.as_str()].0.clone();
                return Ok(match AffineMap::new(DAffine3::from_mat4(m)) {
                    Ok(map) => Some(Geometry::Instance(Box::new(Instance { group, map }))),
                    Err(message) => {
                        self.fault(&format!("{at}.transform"), message);
                        None
                    }
                });
            }
        };
        Ok(match made {
            Ok(shape) => Some(Geometry::Shape(shape)),
            Err(message) => {
                self.fault(at, message);
                None
            }
        })
    }
}

fn layout(layout: written::Layout) -> Layout {
    match layout {
        written::Layout::YUp => Layout::YUp,
        written::Layout::ZUp => Layout::ZUp,
    }
}

/// Where u = 0 about the axis `along` once it is transformed, and whether u then runs the other way. `None` where neither a
/// transform nor `written` moves it.
fn seam(m: DMat4, along: DVec3, written: Option<DVec3>) -> Option<(DVec3, bool)> {
    Some((carried(m, along, written)?, DMat3::from_mat4(m).determinant() < 0.0))
}

/// The direction across `axis` by which texture coordinates are counted, `written` or chosen, once it is transformed: textures
/// move with what they are on. `None` where neither a transform nor `written` moves it.
fn carried(m: DMat4, axis: DVec3, written: Option<DVec3>) -> Option<DVec3> {
    let chosen = || axis.try_normalize().filter(|_| m != DMat4::IDENTITY).map(|axis| Frame::by_least_turn(axis).s);
    written.or_else(chosen).map(|direction| m.transform_vector3(direction))
}

fn normal_transform(m: DMat4, n: DVec3) -> DVec3 {
    DMat3::from_mat4(m).inverse().transpose() * n
}

#[cfg(test)]
mod tests {
    use crate::scene::Geometry;
    use crate::scene::compile::testing::compiled;
    use crate::scene::shape::testing::Random;
    use glam::{DMat3, DVec2, DVec3};

    /// Texture coordinates belong to the thing, however it is turned, resized and mirrored; to a rounding of the largest
    /// coordinate over the least radius.
    #[test]
    fn textures_move_with_what_they_are_on() {
        let things = [
            "cylinder: {base: [0.1, 0.2, 0], top: [0.3, 1.2, 0.4], radius: 0.7",
            "cylinder: {base: [0.1, 0.2, 0], top: [0.3, 1.2, 0.4], radius: 0.7, seam: [1, 0, 0.3]",
            "cone: {base: [0.1, 0.2, 0], apex: [0.3, 1.2, 0.4], radius: 0.7",
            "sphere: {center: [0.1, 0.2, 0], radius: 0.7",
        ];
        let moves = [
            ("{rotate: {axis: [0.2, 1, 0.3], deg: 75}}", rotation(75.0)),
            ("{scale: [-2, 2, 2]}", DMat3::from_diagonal(DVec3::new(-2.0, 2.0, 2.0))),
            (
                "{rotate: {axis: [0.2, 1, 0.3], deg: 200}}, {scale: [1, 1, -1]}",
                DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)) * rotation(200.0),
            ),
        ];
        for thing in things {
            for (written, moved) in moves {
                let text = format!(
                    "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nshapes:\n- {thing}}}\n\
                     - {thing}, transform: [{written}]}}\n"
                );
                let scene = compiled(&text);
                let [Geometry::Shape(plain), Geometry::Shape(turned)] = [0, 1].map(|i| &scene.objects[i].geometry)
                else {
                    panic!("two shapes");
                };
                let mut random = Random::new(3);
                for _ in 0..1000 {
                    let sample = plain.sample_area(random.pair());
                    let (a, b) =
                        (plain.surface(sample.point, sample.face), turned.surface(moved * sample.point, sample.face));
                    let apart = (a.uv - b.uv).abs();
                    // At the seam 0 is 1.
                    let apart = apart.min((1.0 - apart).abs());
                    assert!(apart.max_element() < 1e-12, "{thing} {written}: {} {}", a.uv, b.uv);
                    assert!(
                        (moved * a.tangent).normalize().dot(b.tangent.normalize()) > 1.0 - 1e-12,
                        "{thing} {written}"
                    );
                }
            }
        }
    }

    /// u and v of a plane are metres along two directions in it, which turn with it, also where its normal stays: a turn moves the
    /// texture coordinates of 0.1 m, 0.3 m along with the point.
    #[test]
    fn the_texture_of_a_plane_turns_with_it() {
        for plane in ["normal: [0.2, 1, 0.3]", "normal: [0.1, 0.7, 0.9]", "normal: [0, 0, 1], tangent: [1, 2, 0]"] {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nshapes:\n- plane: {{{plane}}}\n\
                 - plane: {{{plane}, transform: [{{rotate: {{axis: [0.2, 1, 0.3], deg: 75}}}}]}}\n"
            );
            let scene = compiled(&text);
            let [Geometry::Shape(plain), Geometry::Shape(turned)] = [0, 1].map(|i| &scene.objects[i].geometry) else {
                panic!("two shapes");
            };
            let at = plain.surface(DVec3::ZERO, 0);
            let point = 0.1 * at.tangent + 0.3 * at.normal.cross(at.tangent);
            let (a, b) = (plain.surface(point, 0), turned.surface(rotation(75.0) * point, 0));
            assert!((a.uv - DVec2::new(0.1, 0.3)).abs().max_element() < 1e-14, "{plane}: {}", a.uv);
            assert!((a.uv - b.uv).abs().max_element() < 1e-14, "{plane}: {} {}", a.uv, b.uv);
            assert!((rotation(75.0) * a.tangent).dot(b.tangent) > 1.0 - 1e-14, "{plane}");
        }
    }

    /// A mirror shows the image of everything: at the image of a point are its texture coordinates, and its normal is the image of
    /// the normal, on the side from which the thing shines.
    #[test]
    fn flat_things_and_their_fronts_are_mirrored_as_they_are() {
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        for thing in [
            "plane: {point: [0.1, 0.2, 0], normal: [0.2, 1, 0.3]",
            "plane: {point: [0.1, 0.2, 0], normal: [0.2, 1, 0.3], tangent: [1, 2, 0]",
            "disk: {center: [0.1, 0.2, 0], normal: [0.2, 1, 0.3], radius: 0.7",
            "rectangle: {corner: [0.1, 0.2, 0], edge_u: [1, 0.2, 0.3], edge_v: [0.1, 1, -2]",
            "cube: {center: [0.1, 0.2, 0], size: [1, 2, 3]",
        ] {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nshapes:\n- {thing}}}\n\
                 - {thing}, transform: [{{rotate: {{axis: [0.2, 1, 0.3], deg: 75}}}}, {{scale: [-1, 1, 1]}}]}}\n"
            );
            let scene = compiled(&text);
            let [Geometry::Shape(plain), Geometry::Shape(turned)] = [0, 1].map(|i| &scene.objects[i].geometry) else {
                panic!("two shapes");
            };
            let moved = mirror * rotation(75.0);
            let mut random = Random::new(3);
            for _ in 0..1000 {
                let sample = plain.sample_area(random.pair());
                // One point of a plane is chosen always.
                let beside = if plain.bounds().is_none() { random.pair().extend(0.3) } else { DVec3::ZERO };
                let a = plain.surface(sample.point + beside, sample.face);
                let b = turned.surface(moved * a.point, sample.face);
                let apart = (a.uv - b.uv).abs();
                // At the seam of a disk 0 is 1.
                let apart = apart.min((1.0 - apart).abs());
                assert!(apart.max_element() < 1e-12, "{thing}: {} {}", a.uv, b.uv);
                assert!((moved * a.normal - b.normal).length() < 1e-12, "{thing}: {} {}", a.normal, b.normal);
            }
        }
    }

    /// What a thing chooses itself follows its axis as that turns through z = 0, by 2e-6 here: no coordinate of a point moves by more
    /// than a few times that. It jumped by half a turn, and so did `motion`.
    #[test]
    fn chosen_texture_coordinates_follow_an_axis_that_turns() {
        for thing in [
            "cylinder: {base: [0, 0, 0], top: [0.6, 0.8, Z], radius: 0.7}",
            "cone: {base: [0, 0, 0], apex: [0.6, 0.8, Z], radius: 0.7}",
            "disk: {normal: [0.6, 0.8, Z], radius: 0.7}",
            "plane: {normal: [0.6, 0.8, Z]}",
            "cylinder: {base: [0, 0, 0], top: [0.6, 0.8, Z], radius: 0.7, transform: [{scale: 2}]}",
        ] {
            let [before, after] = ["1.0e-6", "-1.0e-6"].map(|z| {
                let camera = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n";
                let text = format!("{camera}shapes:\n- {}\n", thing.replace('Z', z));
                compiled(&text)
            });
            let (Geometry::Shape(before), Geometry::Shape(after)) =
                (&before.objects[0].geometry, &after.objects[0].geometry)
            else {
                panic!("a shape");
            };
            let mut random = Random::new(3);
            for _ in 0..100 {
                let sample = before.sample_area(random.pair());
                let (a, b) = (before.surface(sample.point, sample.face), after.surface(sample.point, sample.face));
                let apart = (a.uv - b.uv).abs();
                let apart = apart.min((1.0 - apart).abs());
                // Angles move by more near the middle of a disk and the apex of a cone.
                assert!(apart.max_element() < 1e-3, "{thing}: {} {}", a.uv, b.uv);
                assert!((a.tangent.normalize() - b.tangent.normalize()).length() < 1e-3, "{thing}");
            }
        }
    }

    fn rotation(degrees: f64) -> DMat3 {
        DMat3::from_axis_angle(DVec3::new(0.2, 1.0, 0.3).normalize(), degrees.to_radians())
    }
}
