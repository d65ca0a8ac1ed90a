//! Shapes.

use std::path::Path;

use glam::{DAffine3, DMat3, DMat4, DVec3, DVec4};

use super::super::super::medium::{UNCHANGED, VACUUM};
use super::super::super::shape::{
    Caps, Cube, CurveBasis, Cylinder, Geometry, Layout, Mesh, Normals, Plane, SdfNormals, Shape, Sphere,
};
use super::super::super::spectrum::SpectrumOrTexture;
use super::super::super::transform::{is_mirror, is_similarity};
use super::meshes::{PLANE, SEGMENTS, cone_mesh, plane_mesh};
use super::textures::Stands;
use super::xml::numbers;
use super::{Export, ends_in, joined};
use crate::math::Frame;

impl Export<'_> {
    /// The shapes of a group.
    pub(super) fn group(&mut self, name: &str, shapes: &[Shape]) {
        let id = self.id(name, "shape");
        self.ids.insert(id.clone());
        self.xml.open("shape", &[("type", "shapegroup"), ("id", &id)]);
        let list = super::field(&["groups", name]);
        for (i, shape) in shapes.iter().enumerate() {
            self.shape(&list, i, shape);
        }
        self.xml.close();
    }

    /// A shape of a list: the scene's, or a group's.
    pub(super) fn shape(&mut self, list: &str, i: usize, shape: &Shape) {
        let why = self.shape_shortfall(shape);
        let reads_otherwise = self.reads_otherwise(shape);
        match &why {
            Some(why) => self.instead("shape", &format!("{list}[{i}]"), why.as_str()),
            None if reads_otherwise => self.restate("shape", &format!("{list}[{i}]")),
            None => {}
        }
        let kind = shape.geometry.kind();
        let field = format!("{list}[{i}].{kind}");
        self.plugin(&field, shape);
        // The shapes of a group have their own.
        if !matches!(shape.geometry, Geometry::Instance(_)) {
            self.surface(&field, shape);
        }
        self.xml.close();
        if why.is_some() || reads_otherwise {
            self.end();
        } else {
            self.coordinates(&field, shape);
        }
    }

    /// Opens the plugin of a shape, with what it says of the form and its place. Caps of a cylinder are shapes before it.
    fn plugin(&mut self, field: &str, shape: &Shape) {
        let world = shape.world_from_object();
        match &shape.geometry {
            Geometry::Sphere(sphere) => {
                self.open("sphere", shape);
                self.xml.value("point", "center", numbers(&sphere.center));
                self.xml.value("float", "radius", sphere.radius);
                self.placing(world);
            }
            Geometry::Cylinder(cylinder) => self.cylinder(field, shape, cylinder),
            Geometry::Cone(cone) => {
                self.open("ply", shape);
                let name = self.mesh(cone_mesh(cone).into_bytes());
                self.xml.value("string", "filename", name);
                self.placing(world);
            }
            Geometry::Disk(disk) => {
                self.open("disk", shape);
                self.placing(world * placed(disk.center.into(), disk.normal.into(), disk.radius));
            }
            // A picture on it repeats by the metre, which the coordinates of a rectangle cannot say.
            Geometry::Plane(plane) if self.is_textured(shape) => {
                self.open("ply", shape);
                let name = self.mesh(plane_mesh(&standing(plane, world), is_mirror(world)).into_bytes());
                self.xml.value("string", "filename", name);
            }
            Geometry::Plane(plane) => {
                self.open("rectangle", shape);
                let DAffine3 { matrix3, translation } = standing(plane, world);
                let scaled = DMat3::from_cols(matrix3.x_axis * PLANE, matrix3.y_axis * PLANE, matrix3.z_axis);
                self.placing(DAffine3 { matrix3: scaled, translation }.into());
            }
            Geometry::Rectangle(rectangle) => {
                self.open("rectangle", shape);
                let [corner, u, v] = [rectangle.corner, rectangle.edge_u, rectangle.edge_v].map(DVec3::from);
                let (u, v) = (0.5 * u, 0.5 * v);
                let columns = [u, v, u.cross(v).normalize_or_zero()].map(|column| column.extend(0.0));
                let centre = (corner + u + v).extend(1.0);
                self.placing(world * DMat4::from_cols(columns[0], columns[1], columns[2], centre));
            }
            Geometry::Cube(cube) => {
                self.open("cube", shape);
                let half = DVec3::from(cube.size.xyz()) * 0.5;
                self.placing(world * DMat4::from_translation(cube.center.into()) * DMat4::from_scale(half));
            }
            Geometry::Mesh(mesh) => {
                let anew = self.mesh_anew(mesh);
                let plugin = if anew.is_some() { "ply" } else { mesh_plugin(&mesh.file) };
                self.open(plugin, shape);
                let file = anew.unwrap_or_else(|| self.file(&mesh.file));
                self.xml.value("string", "filename", file);
                match plugin {
                    "serialized" => self.xml.value("integer", "shape_index", mesh.index),
                    plugin => {
                        if mesh.flip_v != (plugin == "obj") {
                            self.xml.value("boolean", "flip_tex_coords", mesh.flip_v);
                        }
                    }
                }
                if mesh.normals == Normals::Face {
                    self.xml.value("boolean", "face_normals", true);
                }
                self.placing(world);
            }
            Geometry::Instance(instance) => {
                self.open("instance", shape);
                let id = self.id(&instance.group, "shape");
                self.xml.leaf("ref", &[("id", &id)]);
                self.placing(world);
            }
            Geometry::SdfGrid(grid) => {
                self.open("sdfgrid", shape);
                let file = self.file(&grid.file);
                self.xml.value("string", "filename", file);
                let normals = match grid.normals {
                    SdfNormals::Smooth => "smooth",
                    SdfNormals::Analytic => "analytic",
                };
                self.xml.value("string", "normals", normals);
                self.placing(world);
            }
            Geometry::Curves(curves) => {
                let plugin = match curves.basis {
                    CurveBasis::Linear => "linearcurve",
                    CurveBasis::Bspline => "bsplinecurve",
                };
                self.open(plugin, shape);
                let file = self.file(&curves.file);
                self.xml.value("string", "filename", file);
                self.placing(world);
            }
        }
    }

    /// The same of a cylinder.
    fn cylinder(&mut self, field: &str, shape: &Shape, cylinder: &Cylinder) {
        let world = shape.world_from_object();
        for (cap, at, from) in [(Caps::Base, cylinder.base, cylinder.top), (Caps::Top, cylinder.top, cylinder.base)] {
            if cylinder.caps == Caps::Both || cylinder.caps == cap {
                let outward = DVec3::from(at) - DVec3::from(from);
                self.xml.open("shape", &[("type", "disk")]);
                self.placing(world * placed(at.into(), outward, cylinder.radius));
                self.surface(field, shape);
                self.xml.close();
            }
        }
        self.open("cylinder", shape);
        if let Some(tube) = self.turned_tube(shape) {
            return self.placing(world * tube);
        }
        let (place, scale, rest) = match self.mirrored_tube(shape) {
            Some(scale) => (world, scale, DMat4::IDENTITY),
            None => (DMat4::IDENTITY, 1.0, world),
        };
        for (key, end) in [("p0", cylinder.base), ("p1", cylinder.top)] {
            self.xml.value("point", key, numbers(&place.transform_point3(end.into()).to_array()));
        }
        self.xml.value("float", "radius", cylinder.radius * scale);
        self.placing(rest);
    }

    /// How coordinates run on a shape, where ours do otherwise than Mitsuba's.
    fn coordinates(&mut self, field: &str, shape: &Shape) {
        match &shape.geometry {
            // No picture lies on it, but the same random numbers shall mean the same directions.
            Geometry::Sphere(Sphere { layout: Layout::YUp, .. }) | Geometry::Cube(Cube { layout: Layout::YUp, .. }) => {
                self.xml.instruction(&format!("set {field}.layout: y_up"));
            }
            // Nor does a picture follow it, but layers of coordinates do. It is read back where the world has it.
            Geometry::Cylinder(cylinder) => {
                if let Some(seam) = seam(cylinder) {
                    let seam = shape.world_from_object().transform_vector3(seam);
                    self.xml.instruction(&format!("set {field}.seam: [{}]", numbers(&seam.to_array())));
                }
            }
            _ => {}
        }
    }

    /// Material, light and media.
    fn surface(&mut self, field: &str, shape: &Shape) {
        let mirrored = is_mirror(shape.world_from_object());
        let turned = match &shape.geometry {
            // One that is mirrored is turned inside out by Mitsuba.
            Geometry::Sphere(_) => mirrored,
            Geometry::Mesh(mesh) => self.is_turned(mesh, mirrored),
            _ => false,
        };
        if shape.flip_normals != turned && can_be_flipped(&shape.geometry) {
            self.xml.value("boolean", "flip_normals", true);
        }
        self.material_ref(&format!("{field}.material"), &shape.material);
        if let Some(emission) = &shape.emission {
            self.area(field, shape, emission);
        }
        let keys = if self.has_crossed_media(shape) { ["exterior", "interior"] } else { ["interior", "exterior"] };
        for (key, medium) in keys.into_iter().zip(self.sides(shape).map(|side| side.map(str::to_owned))) {
            if let Some(medium) = medium.filter(|medium| is_medium(medium)) {
                let id = self.id(&medium, "medium");
                self.xml.leaf("ref", &[("name", key), ("id", &id)]);
            }
        }
    }

    /// The scale of a cylinder that is mirrored, but looks like one that is not. As a lamp it sends too little light in Mitsuba.
    fn mirrored_tube(&self, shape: &Shape) -> Option<f64> {
        let world = shape.world_from_object();
        let mirrored = matches!(shape.geometry, Geometry::Cylinder(_)) && is_mirror(world);
        let linear = DMat3::from_mat4(world);
        (mirrored && !self.is_textured(shape) && is_similarity(linear)).then(|| linear.x_axis.length())
    }

    /// The unit tube along z, where u begins at x, as a tube with a picture that begins elsewhere than Mitsuba has it by the ends alone.
    fn turned_tube(&self, shape: &Shape) -> Option<DMat4> {
        let Geometry::Cylinder(cylinder) = &shape.geometry else { return None };
        let seam = seam(cylinder).filter(|_| self.is_textured(shape))?;
        let base = DVec3::from(cylinder.base);
        let along = DVec3::from(cylinder.top) - base;
        let Frame { s, t, .. } = Frame::from_normal_and_tangent(along.normalize_or_zero(), seam);
        let columns = DMat3::from_cols(s * cylinder.radius, t * cylinder.radius, along);
        Some(DAffine3 { matrix3: columns, translation: base }.into())
    }

    /// Whether a shape stands in the file as it was written, too.
    pub(super) fn is_restated(&self, shape: &Shape) -> bool {
        self.shape_shortfall(shape).is_some() || self.reads_otherwise(shape)
    }

    /// Whether a shape that Mitsuba can express would be read as another: a tube and a mesh on which other directions would be
    /// drawn, media that are crossed, meshes that are written anew, and bodies that absorb in a medium, which would be empty.
    fn reads_otherwise(&self, shape: &Shape) -> bool {
        let mirrored = is_mirror(shape.world_from_object());
        let turned = matches!(&shape.geometry, Geometry::Mesh(mesh) if self.is_turned(mesh, mirrored));
        let anew = matches!(&shape.geometry, Geometry::Mesh(mesh) if (self.anew)(&mesh.file, mesh.index).is_some());
        let tube = self.mirrored_tube(shape).is_some() || self.turned_tube(shape).is_some();
        let filled = self.absorbs(&shape.material) && self.sides(shape).into_iter().flatten().any(is_medium);
        turned || anew || tube || filled || self.has_crossed_media(shape)
    }

    /// The name of a new file with a mesh.
    fn mesh(&mut self, ply: Vec<u8>) -> String {
        let name = format!("{}shape{}.ply", self.stem, self.files.len());
        self.files.push((name.clone(), ply));
        name
    }

    /// The same of a mesh whose file Mitsuba does not read; one for all shapes that have it.
    fn mesh_anew(&mut self, mesh: &Mesh) -> Option<String> {
        let ply = (self.anew)(&mesh.file, mesh.index)?;
        let key = (mesh.file.to_path_buf(), mesh.index);
        if let Some(name) = self.meshes.get(&key) {
            return Some(name.clone());
        }
        let name = self.mesh(ply.to_vec());
        self.meshes.insert(key, name.clone());
        Some(name)
    }

    /// Whether what covers it or shines from it depends on its texture coordinates.
    fn is_textured(&self, shape: &Shape) -> bool {
        self.follows_uv(&shape.material) || matches!(shape.emission, Some(SpectrumOrTexture::Texture(_)))
    }

    fn open(&mut self, plugin: &str, shape: &Shape) {
        match shape.name.as_ref().map(|name| self.id(name, "shape")) {
            Some(id) if self.ids.insert(id.clone()) => self.xml.open("shape", &[("type", plugin), ("id", &id)]),
            _ => self.xml.open("shape", &[("type", plugin)]),
        }
    }

    pub(super) fn placing(&mut self, matrix: DMat4) {
        if matrix != DMat4::IDENTITY {
            let rows = matrix.transpose().to_cols_array();
            self.xml.open("transform", &[("name", "to_world")]);
            self.xml.leaf("matrix", &[("value", &numbers(&rows))]);
            self.xml.close();
        }
    }

    /// What Mitsuba gets in place of a shape that it cannot express.
    fn shape_shortfall(&self, shape: &Shape) -> Option<String> {
        let said = |text: &str| Some(text.to_owned());
        let textured = self.is_textured(shape);
        let grey = shape.emission.as_ref().and_then(|emission| self.shining_shortfall(emission, Stands::Upright));
        let own = match &shape.geometry {
            Geometry::Rectangle(_) => None,
            Geometry::Plane(_) => said("a square of 5 km: Mitsuba has no plane without end"),
            Geometry::Cone(cone) => Some(format!(
                "a mesh of {SEGMENTS} sides{}, at most {:.2e} m inside: Mitsuba has no cone",
                if textured { " without texture coordinates" } else { "" },
                cone.radius * (1.0 - libm::cos(std::f64::consts::PI / f64::from(SEGMENTS)))
            )),
            Geometry::Cylinder(c) if c.caps != Caps::None => Some(format!(
                "a tube and disks at its ends{}: Mitsuba's cylinder has none",
                if textured { ", with Mitsuba's texture coordinates" } else { "" }
            )),
            Geometry::Sphere(Sphere { layout: Layout::ZUp, .. }) | Geometry::Cube(Cube { layout: Layout::ZUp, .. }) => {
                None
            }
            Geometry::Sphere(_) | Geometry::Cube(_) if textured => {
                said("the same shape with Mitsuba's texture coordinates")
            }
            // The coordinates of a disk are Mitsuba's, and those of a tube are where its seam is.
            Geometry::Sphere(_) | Geometry::Cylinder(_) | Geometry::Disk(_) | Geometry::Cube(_) => None,
            Geometry::Mesh(mesh) if textured && mesh.flip_v && mesh_plugin(&mesh.file) == "serialized" => {
                said("the same mesh, its textures upside down")
            }
            Geometry::Mesh(mesh) => match mesh.normals {
                Normals::File | Normals::Smooth => {
                    said("the same mesh; without normals in its file Mitsuba smooths each vertex by itself")
                }
                _ => None,
            },
            Geometry::Instance(_) | Geometry::SdfGrid(_) | Geometry::Curves(_) => None,
        };
        let flipped = (shape.flip_normals && !can_be_flipped(&shape.geometry))
            .then(|| "the same shape with its normals outward: Mitsuba's has no others".to_owned());
        let even = self.even(shape).map(str::to_owned);
        joined([own, flipped, even, grey, self.sides_shortfall(shape).map(str::to_owned)])
    }
}

/// Where u = 0 on a cylinder that has it elsewhere than Mitsuba: as it is written, or about an axis that runs down z.
fn seam(cylinder: &Cylinder) -> Option<DVec3> {
    let axis = (DVec3::from(cylinder.top) - DVec3::from(cylinder.base)).normalize_or_zero();
    let chosen = || axis.z.is_sign_negative().then(|| Frame::by_least_turn(axis).s);
    cylinder.seam.map(DVec3::from).or_else(chosen)
}

/// Whether a side of that name has something in it.
fn is_medium(side: &str) -> bool {
    ![VACUUM, UNCHANGED].contains(&side)
}

/// Whether Mitsuba's plugin can turn the normals round.
fn can_be_flipped(geometry: &Geometry) -> bool {
    !matches!(geometry, Geometry::SdfGrid(_) | Geometry::Curves(_))
}

/// The plugin that reads a mesh.
fn mesh_plugin(file: &Path) -> &'static str {
    if ends_in(file, "ply") {
        "ply"
    } else if ends_in(file, "serialized") {
        "serialized"
    } else {
        "obj"
    }
}

/// Where a plane stands and which way u and v run on it, a metre each, but for v of one that is mirrored, which runs the other
/// way: it is moved and turned by `world`, but not stretched.
fn standing(plane: &Plane, world: DMat4) -> DAffine3 {
    let linear = DMat3::from_mat4(world);
    let normal = (linear.inverse().transpose() * DVec3::from(plane.normal)).normalize_or_zero();
    // One that is chosen turns with the plane, too.
    let chosen = || Frame::by_least_turn(DVec3::from(plane.normal).normalize_or_zero()).s;
    let tangent = plane.tangent.map_or_else(chosen, DVec3::from);
    let Frame { s, t, n } = Frame::from_normal_and_tangent(normal, linear * tangent);
    DAffine3::from_cols(s, t, n, world.transform_point3(plane.point.into()))
}

/// The unit square or disk across z, moved, turned and scaled.
fn placed(centre: DVec3, normal: DVec3, scale: f64) -> DMat4 {
    let frame = Frame::by_least_turn(normal.normalize_or_zero());
    let column = |v: DVec3, by: f64| (v * by).extend(0.0);
    DMat4::from_cols(
        column(frame.s, scale),
        column(frame.t, scale),
        column(frame.n, 1.0),
        DVec4::new(centre.x, centre.y, centre.z, 1.0),
    )
}
