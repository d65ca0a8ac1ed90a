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
        // Uniform by the checks of the description for shapes that need it.
        let scale = libm::cbrt(DMat3::from_mat4(m).determinant().abs());
        let made: std::result::Result<Shape, String> = match &shape.geometry {
            written::Geometry::Sphere(s) => {
                let rotation = DMat3::from_mat4(m) * (1.0 / scale);
                let made = Sphere::new(point(s.center), s.radius * scale, rotation);
                made.map(|sphere| Shape::Sphere(sphere.with_layout(layout(s.layout))))
            }
            written::Geometry::Plane(p) => {
                let tangent = p.tangent.map_or(DVec3::ZERO, vector);
                Plane::new(point(p.point), normal_transform(m, vec3(p.normal)), tangent).map(Shape::Plane)
            }
            written::Geometry::Disk(d) => {
                let frame = match vec3(d.normal).try_normalize() {
                    Some(n) => Frame::from_normal(n),
                    None => {
                        self.fault(&format!("{at}.normal"), "expected a direction, found one of length zero");
                        return Ok(None);
                    }
                };
                let (u, v) = (vector((frame.s * d.radius).into()), vector((frame.t * d.radius).into()));
                Disk::new(point(d.center), u, v).map(Shape::Disk)
            }
            written::Geometry::Rectangle(r) => {
                Rectangle::new(point(r.corner), vector(r.edge_u), vector(r.edge_v)).map(Shape::Rectangle)
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
                let made = match c.seam {
                    Some(seam) => made.and_then(|cylinder| cylinder.with_seam(vector(seam))),
                    None => made,
                };
                made.map(Shape::Cylinder)
            }
            written::Geometry::Cone(c) => {
                Cone::new(point(c.base), point(c.apex), c.radius * scale, c.cap).map(Shape::Cone)
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
                self.surface = Surface::Mesh(OfMesh::new(source, &made.mesh));
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

fn normal_transform(m: DMat4, n: DVec3) -> DVec3 {
    DMat3::from_mat4(m).inverse().transpose() * n
}
