//! Shapes as they are written.

use glam::DMat4;
use serde::Deserialize;

use super::emitter::{EmissionDirection, check_weight};
use super::fault::Checker;
use super::material::MaterialRef;
use super::medium::check_sides;
use super::path::At;
use super::spectrum::{FilePath, Role, SpectrumOrTexture, Vec3, yes};
use super::transform::{Extent, TransformStep, check_steps, is_similarity, matrix_of, parallel};

/// A surface of the scene: a form, and the fields that every form has.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(from = "written::Shape")]
pub struct Shape {
    /// For messages and masks; default none.
    pub name: Option<String>,
    /// Default diffuse, reflectance 0.5.
    pub material: MaterialRef,
    /// Emitted radiance, W·m⁻²·sr⁻¹·nm⁻¹; default none.
    pub emission: Option<SpectrumOrTexture>,
    /// Which way the emission goes; default all.
    pub emission_direction: Option<EmissionDirection>,
    /// How often the shape is chosen as a light, relative to its power; default 1.
    pub sampling_weight: Option<f64>,
    /// Name of the medium behind the surface, where the normal does not point; `vacuum`; or, as on the other side,
    /// `unchanged`: what it was before. Default none.
    pub inside: Option<String>,
    /// Name of the medium before the surface; default none.
    pub outside: Option<String>,
    /// Applied in the order of the list; default none.
    pub transform: Vec<TransformStep>,
    /// Whether the normal points to the other side than the form's own; default false.
    pub flip_normals: bool,
    /// The form.
    pub geometry: Geometry,
}

impl Shape {
    /// The name of its material, or `own` where that stands in the shape.
    #[must_use]
    pub fn material_name(&self, own: &str) -> String {
        match &self.material {
            MaterialRef::Name(name) => name.clone(),
            MaterialRef::Inline(_) => own.to_owned(),
        }
    }

    /// Its name, given or made from kind and number.
    #[must_use]
    pub fn name_or_kind(&self, number: usize) -> String {
        self.name.clone().unwrap_or_else(|| format!("{}{number}", self.geometry.kind()))
    }
}

/// Writes each form as a struct of its own fields, and beside it the struct that stands in YAML,
/// which has the common fields too.
macro_rules! forms {
    ($(
        $(#[doc = $doc:literal])+
        $key:literal $form:ident {
            $( $(#[doc = $field_doc:literal])+ $field:ident: $type:ty = [$($serde:tt)*], )*
        }
    )*) => {
        $(
            $(#[doc = $doc])+
            #[derive(Clone, Debug, PartialEq)]
            pub struct $form {
                $( $(#[doc = $field_doc])+ pub $field: $type, )*
            }
        )*

        /// The form of a shape, before its transform.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Geometry {
            $( $(#[doc = $doc])+ $form($form), )*
        }

        impl Geometry {
            /// The key under which the shape is written.
            #[must_use]
            pub fn kind(&self) -> &'static str {
                match self {
                    $( Geometry::$form(_) => $key, )*
                }
            }
        }

        /// Shapes as YAML spells them: own and common fields in one map.
        mod written {
            use super::*;

            $(
                #[derive(Deserialize)]
                #[serde(deny_unknown_fields)]
                pub struct $form {
                    $( #[serde($($serde)*)] $field: $type, )*
                    name: Option<String>,
                    #[serde(default)]
                    material: MaterialRef,
                    emission: Option<SpectrumOrTexture>,
                    emission_direction: Option<EmissionDirection>,
                    sampling_weight: Option<f64>,
                    inside: Option<String>,
                    outside: Option<String>,
                    #[serde(default)]
                    transform: Vec<TransformStep>,
                    #[serde(default)]
                    flip_normals: bool,
                }
            )*

            #[derive(Deserialize)]
            #[serde(deny_unknown_fields)]
            pub enum Shape {
                $( #[serde(rename = $key)] $form($form), )*
            }

            impl From<Shape> for super::Shape {
                fn from(written: Shape) -> super::Shape {
                    match written {
                        $( Shape::$form(written) => super::Shape {
                            name: written.name,
                            material: written.material,
                            emission: written.emission,
                            emission_direction: written.emission_direction,
                            sampling_weight: written.sampling_weight,
                            inside: written.inside,
                            outside: written.outside,
                            transform: written.transform,
                            flip_normals: written.flip_normals,
                            geometry: Geometry::$form(super::$form { $( $field: written.$field, )* }),
                        }, )*
                    }
                }
            }
        }
    };
}

forms! {
    /// `sphere: {center: [0, 0, 0], radius: 1}`
    "sphere" Sphere {
        /// Metres; default the origin.
        center: Vec3 = [default],
        /// Metres.
        radius: f64 = [],
        /// How the texture lies on it; default `y_up`.
        layout: Layout = [default],
    }
    /// `plane: {point: [0, 0, 0], normal: [0, 1, 0]}`: without end.
    "plane" Plane {
        /// A point of it, metres; default the origin.
        point: Vec3 = [default],
        /// Any length.
        normal: Vec3 = [],
        /// Direction in which the texture's u grows by one a metre; default chosen.
        tangent: Option<Vec3> = [default],
    }
    /// `disk: {center: [0, 0, 0], normal: [0, 1, 0], radius: 1}`
    "disk" Disk {
        /// Metres; default the origin.
        center: Vec3 = [default],
        /// Any length.
        normal: Vec3 = [],
        /// Metres.
        radius: f64 = [],
    }
    /// `rectangle: {corner, edge_u, edge_v}`; the normal is edge_u × edge_v, before its transform.
    "rectangle" Rectangle {
        /// Where u = v = 0, metres.
        corner: Vec3 = [],
        /// From the corner to u = 1, metres.
        edge_u: Vec3 = [],
        /// From the corner to v = 1, metres.
        edge_v: Vec3 = [],
    }
    /// `cube: {center: [0, 0, 0], size: [x, y, z] or one number}`
    "cube" Cube {
        /// Metres; default the origin.
        center: Vec3 = [default],
        /// Edges, metres.
        size: Extent = [],
        /// How the texture lies on its faces; default `y_up`.
        layout: Layout = [default],
    }
    /// `cylinder: {base, top, radius, caps: both}`
    "cylinder" Cylinder {
        /// Centre of one end, metres.
        base: Vec3 = [],
        /// Centre of the other, metres.
        top: Vec3 = [],
        /// Metres.
        radius: f64 = [],
        /// Which ends are closed; default `both`.
        caps: Caps = [default],
        /// Where the texture begins, u = 0, as seen from the axis; default chosen.
        seam: Option<Vec3> = [default],
    }
    /// `cone: {base, apex, radius, cap: true}`
    "cone" Cone {
        /// Centre of the base, metres.
        base: Vec3 = [],
        /// The point, metres.
        apex: Vec3 = [],
        /// Of the base, metres.
        radius: f64 = [],
        /// Whether the base is closed; default true.
        cap: bool = [default = "yes"],
    }
    /// `mesh: {file: bunny.ply, normals: file, winding: object}`
    "mesh" Mesh {
        /// OBJ, PLY or `.serialized`.
        file: FilePath = [],
        /// Where shading normals come from; default `file`.
        normals: Normals = [default],
        /// Which side is the outside; default `object`.
        winding: Winding = [default],
        /// Which mesh of a `.serialized` file, counted from 0; default 0.
        index: u32 = [default],
        /// Whether the texture's v is counted from the top, v ↦ 1 − v; default false.
        flip_v: bool = [default],
    }
    /// `instance: {group: tree}`: a copy of a group, which has its own materials and media.
    "instance" Instance {
        /// Name under `groups`.
        group: String = [],
    }
    /// `sdf_grid: {file: torus.vol, normals: smooth}`
    "sdf_grid" SdfGrid {
        /// Signed distances on a grid, `.vol`; the grid fills the unit cube.
        file: FilePath = [],
        /// Where shading normals come from; default `smooth`.
        normals: SdfNormals = [default],
    }
    /// `curves: {file: hair.txt, basis: linear}`
    "curves" Curves {
        /// Lines of `x y z radius`; an empty line ends a curve.
        file: FilePath = [],
        /// What the points mean; default `linear`.
        basis: CurveBasis = [default],
    }
}

/// How texture coordinates lie on a sphere or a cube.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Pictures stand upright, with their top towards +y.
    #[default]
    YUp,
    /// On a sphere u is the longitude from +x towards +y and v the angle from +z; on a cube u and v grow along
    /// the axes that `scene::shape::Layout` tells. This is how Mitsuba lays them.
    ZUp,
}

/// Closed ends of a cylinder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Caps {
    /// A solid.
    #[default]
    Both,
    /// A tube.
    None,
    /// Only the first end.
    Base,
    /// Only the second.
    Top,
}

/// Where the shading normals of a mesh come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normals {
    /// The file; `smooth` where it has none.
    #[default]
    File,
    /// Means of the adjoining faces; vertices at the same place count as one.
    Smooth,
    /// The file; where it has none, means of the faces at each of its vertices by itself.
    Vertex,
    /// The faces.
    Face,
}

/// Where the shading normals of a grid of distances come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SdfNormals {
    /// Gradients, interpolated between cells.
    #[default]
    Smooth,
    /// The gradient in the cell.
    Analytic,
}

/// What the control points of curves mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CurveBasis {
    /// Straight lines between them, with round joints and ends.
    #[default]
    Linear,
    /// Uniform cubic B-splines, open at the ends.
    Bspline,
}

/// Which side of a mesh is the outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Winding {
    /// That from which the corners of its triangles are counterclockwise in the file, whatever the transform.
    #[default]
    Object,
    /// That from which they are counterclockwise in the world, so that a mirror turns the mesh inside out;
    /// with normals of the file, the side that these are on.
    World,
}

impl Shape {
    /// The steps of the transform as one matrix: the first step acts first.
    #[must_use]
    pub fn world_from_object(&self) -> DMat4 {
        matrix_of(&self.transform)
    }

    /// Checks a shape of a group, which neither shines nor copies another group.
    pub(crate) fn check_child<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        self.check(at, checker);
        let at = at.key(self.geometry.kind());
        if self.emission.is_some() {
            checker.fault(at.key("emission"), "expected no light in a group: only shapes of the scene itself shine");
        }
        if let Geometry::Instance(_) = self.geometry {
            checker.fault(at, "expected a shape, found an instance: a group holds no copies of groups");
        }
    }

    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        let at = at.key(self.geometry.kind());
        self.geometry.check(at, checker);
        if let Geometry::Instance(_) = self.geometry {
            // A material that is the default, too, would be one that nobody sees.
            for key in ["material", "emission", "inside", "outside", "flip_normals"] {
                if checker.is_written(at.key(key)) {
                    checker.fault(
                        at.key(key),
                        "expected no such field of an instance: the shapes of its group have their own",
                    );
                }
            }
        }
        self.material.check(at.key("material"), checker);
        if let Some(emission) = &self.emission {
            if matches!(self.geometry, Geometry::SdfGrid(_) | Geometry::Curves(_)) {
                let kind = self.geometry.kind();
                checker.fault(at.key("emission"), format!("expected a form that can shine, found {kind}"));
            }
            emission.check(Role::Emission, at.key("emission"), checker);
            check_weight(self.sampling_weight.unwrap_or(1.0), at, checker);
        } else {
            let given = [
                ("emission_direction", self.emission_direction.is_some()),
                ("sampling_weight", self.sampling_weight.is_some()),
            ];
            if let Some((key, _)) = given.into_iter().find(|(_, given)| *given) {
                checker.fault(at.key(key), "expected emission, found none");
            }
        }
        check_sides([("inside", &self.inside), ("outside", &self.outside)], at, checker);
        self.check_transform(at.key("transform"), checker);
    }

    fn check_transform(&self, at: At<'_>, checker: &mut Checker<'_>) {
        let Some(linear) = check_steps(&self.transform, at, checker) else { return };
        let round = match self.geometry {
            Geometry::Sphere(_) | Geometry::Cylinder(_) | Geometry::Cone(_) => true,
            Geometry::Plane(_)
            | Geometry::Disk(_)
            | Geometry::Rectangle(_)
            | Geometry::Cube(_)
            | Geometry::Mesh(_)
            | Geometry::SdfGrid(_)
            | Geometry::Curves(_)
            | Geometry::Instance(_) => false,
        };
        if round && !is_similarity(linear) {
            let kind = self.geometry.kind();
            let expected = format!("moves, turns and even scaling, so that a {kind} stays a {kind}");
            checker.require(false, at, &expected, "a transform that stretches or shears");
        }
    }
}

impl Geometry {
    /// The group that an instance copies.
    #[must_use]
    pub fn group(&self) -> Option<&str> {
        match self {
            Geometry::Instance(instance) => Some(&instance.group),
            _ => None,
        }
    }

    fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        match self {
            Geometry::Sphere(sphere) => checker.positive(at.key("radius"), sphere.radius),
            Geometry::Plane(plane) => {
                checker.direction(at.key("normal"), plane.normal);
                if let Some(tangent) = plane.tangent {
                    checker.direction(at.key("tangent"), tangent);
                    if tangent != [0.0; 3] && plane.normal != [0.0; 3] && parallel(tangent, plane.normal) {
                        let found = "one parallel to it";
                        checker.require(false, at.key("tangent"), "a direction other than the normal", found);
                    }
                }
            }
            Geometry::Disk(disk) => {
                checker.direction(at.key("normal"), disk.normal);
                checker.positive(at.key("radius"), disk.radius);
            }
            Geometry::Rectangle(rectangle) => {
                checker.direction(at.key("edge_u"), rectangle.edge_u);
                checker.direction(at.key("edge_v"), rectangle.edge_v);
                let edges = rectangle.edge_u != [0.0; 3] && rectangle.edge_v != [0.0; 3];
                if edges && parallel(rectangle.edge_u, rectangle.edge_v) {
                    let found = "one parallel to it";
                    checker.require(false, at.key("edge_v"), "a direction other than that of edge_u", found);
                }
            }
            Geometry::Cube(cube) => {
                cube.size.check(at.key("size"), checker, "a number greater than 0", |x| x > 0.0);
            }
            Geometry::Cylinder(cylinder) => {
                checker.positive(at.key("radius"), cylinder.radius);
                let apart = cylinder.base != cylinder.top;
                checker.require(apart, at.key("top"), "a point other than the base", cylinder.top);
                if let Some(seam) = cylinder.seam {
                    checker.direction(at.key("seam"), seam);
                    let along = [0, 1, 2].map(|i| cylinder.top[i] - cylinder.base[i]);
                    if seam != [0.0; 3] && apart && parallel(seam, along) {
                        let expected = "a direction that is not along the axis";
                        checker.require(false, at.key("seam"), expected, "one along it");
                    }
                }
            }
            Geometry::Cone(cone) => {
                checker.positive(at.key("radius"), cone.radius);
                let apart = cone.base != cone.apex;
                checker.require(apart, at.key("apex"), "a point other than the base", cone.apex);
            }
            Geometry::Mesh(_) | Geometry::SdfGrid(_) | Geometry::Curves(_) => {}
            Geometry::Instance(instance) => checker.group(at.key("group"), &instance.group),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::faults;

    /// Faults of a shape whose kind starts at 3:3.
    fn shape(written: &str) -> String {
        faults(&format!("shapes:\n- {written}"))
    }

    #[test]
    fn every_form_has_an_extent() {
        let cases = [
            ("sphere: {radius: 0}", "3:20: shapes[0].sphere.radius: expected a number greater than 0, found 0"),
            (
                "plane: {normal: [0, 0, 0]}",
                "3:19: shapes[0].plane.normal: expected a vector with a direction, found [0, 0, 0]",
            ),
            (
                "plane: {normal: [0, 1, 0], tangent: [0, 2, 0]}",
                "3:39: shapes[0].plane.tangent: expected a direction other than the normal, found one parallel to it",
            ),
            (
                "disk: {normal: [0, 1, 0], radius: -1}",
                "3:37: shapes[0].disk.radius: expected a number greater than 0, found -1",
            ),
            (
                "rectangle: {corner: [0, 0, 0], edge_u: [1, 1, 0], edge_v: [2, 2, 0]}",
                "3:61: shapes[0].rectangle.edge_v: expected a direction other than that of edge_u, found one parallel to it",
            ),
            ("cube: {size: 0}", "3:16: shapes[0].cube.size: expected a number greater than 0, found 0"),
            ("cube: {size: [1, -1, 1]}", "3:20: shapes[0].cube.size[1]: expected a number greater than 0, found -1"),
            (
                "cylinder: {base: [0, 1, 0], top: [0, 1, 0], radius: 1}",
                "3:36: shapes[0].cylinder.top: expected a point other than the base, found [0, 1, 0]",
            ),
            (
                "cylinder: {base: [0, 0, 0], top: [0, 1, 0], radius: 1, seam: [0, -2, 0]}",
                "3:64: shapes[0].cylinder.seam: expected a direction that is not along the axis, found one along it",
            ),
            (
                "cone: {base: [0, 0, 0], apex: [0, 0, 0], radius: 1}",
                "3:33: shapes[0].cone.apex: expected a point other than the base, found [0, 0, 0]",
            ),
            ("mesh: {file: ''}", "3:16: shapes[0].mesh.file: expected the path of a file, found empty text"),
            (
                "curves: {file: a.txt, emission: 1}",
                "3:35: shapes[0].curves.emission: expected a form that can shine, found curves",
            ),
            (
                "sdf_grid: {file: a.vol, emission: 1}",
                "3:37: shapes[0].sdf_grid.emission: expected a form that can shine, found sdf_grid",
            ),
        ];
        for (written, message) in cases {
            assert_eq!(shape(written), format!("dir/s.yaml:{message}"));
        }
    }

    #[test]
    fn emission_is_not_negative() {
        assert_eq!(
            shape("sphere: {radius: 1, emission: -2}"),
            "dir/s.yaml:3:33: shapes[0].sphere.emission: expected a number of 0 or more, found -2"
        );
    }
}
