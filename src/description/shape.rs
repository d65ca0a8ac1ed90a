//! Shapes as they are written, and the transforms that place them.

use glam::{DMat3, DMat4, DVec3, DVec4};
use serde::Deserialize;

use super::emitter::{EmissionDirection, check_weight};
use super::fault::Checker;
use super::material::MaterialRef;
use super::medium::check_sides;
use super::path::At;
use super::spectrum::{FilePath, Role, SpectrumOrTexture, Vec3, yes};

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
    /// `rectangle: {corner, edge_u, edge_v}`; the normal is edge_u × edge_v.
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

/// Three lengths, or one for all.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extent {
    /// `2`
    Number(f64),
    /// `[1, 2, 3]`
    List(Vec3),
}

impl Extent {
    /// Along x, y and z.
    #[must_use]
    pub fn xyz(self) -> Vec3 {
        match self {
            Extent::Number(length) => [length; 3],
            Extent::List(lengths) => lengths,
        }
    }

    /// Checks each number; `wrong` names what was expected where it is not met.
    fn check(self, at: At<'_>, checker: &mut Checker<'_>, expected: &str, holds: impl Fn(f64) -> bool) {
        match self {
            Extent::Number(number) => checker.require(holds(number), at, expected, number),
            Extent::List(numbers) => {
                for (i, number) in numbers.into_iter().enumerate() {
                    checker.require(holds(number), at.index(i), expected, number);
                }
            }
        }
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

/// One step of a transform.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TransformStep {
    /// `translate: [x, y, z]`, metres.
    Translate(Vec3),
    /// `rotate: {axis: [0, 1, 0], deg: 30}`
    Rotate(Rotation),
    /// `scale: 2` or `scale: [1, 2, 1]`
    Scale(Extent),
    /// `matrix: [[…4], …4]`: rows; the last is `[0, 0, 0, 1]`.
    Matrix([[f64; 4]; 4]),
}

/// A turn about an axis through the origin, by the right hand.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Any length.
    pub axis: Vec3,
    /// Degrees.
    pub deg: f64,
}

impl TransformStep {
    /// Checks a step of a list, of which `at` is the element.
    pub(crate) fn check_in_list(&self, at: At<'_>, checker: &mut Checker<'_>) {
        self.check(at.key(self.key()), checker);
    }

    fn key(&self) -> &'static str {
        match self {
            TransformStep::Translate(_) => "translate",
            TransformStep::Rotate(_) => "rotate",
            TransformStep::Scale(_) => "scale",
            TransformStep::Matrix(_) => "matrix",
        }
    }

    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        match self {
            TransformStep::Translate(_) => {}
            TransformStep::Rotate(rotation) => checker.direction(at.key("axis"), rotation.axis),
            TransformStep::Scale(extent) => extent.check(at, checker, "a number other than 0", |x| x != 0.0),
            TransformStep::Matrix(rows) => {
                let last = rows[3];
                let expected = "the last row [0, 0, 0, 1]";
                checker.require(last == [0.0, 0.0, 0.0, 1.0], at.index(3), expected, format_args!("{last:?}"));
                let linear = DMat3::from_mat4(self.matrix());
                let found = format_args!("one with determinant {}", linear.determinant());
                checker.require(is_invertible(linear), at, "a matrix that can be inverted", found);
            }
        }
    }

    /// The step as a matrix on column vectors.
    #[must_use]
    pub fn matrix(&self) -> DMat4 {
        match *self {
            TransformStep::Translate(by) => DMat4::from_translation(by.into()),
            TransformStep::Rotate(Rotation { axis, deg }) => rotation(axis.into(), deg),
            TransformStep::Scale(extent) => DMat4::from_scale(extent.xyz().into()),
            TransformStep::Matrix([x, y, z, w]) => DMat4::from_cols(x.into(), y.into(), z.into(), w.into()).transpose(),
        }
    }
}

/// Rodrigues' formula, R v = cos θ v + sin θ a × v + (1 − cos θ) (a · v) a. Quarter turns are exact.
pub(crate) fn rotation(axis: DVec3, deg: f64) -> DMat4 {
    // Dividing by the greatest component first keeps the length within range.
    let a = (axis / axis.abs().max_element()).normalize();
    let (sin, cos) = match deg.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        deg => (libm::sin(deg.to_radians()), libm::cos(deg.to_radians())),
    };
    let column = |e: DVec3| (cos * e + sin * a.cross(e) + (1.0 - cos) * a.dot(e) * a).extend(0.0);
    DMat4::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z), DVec4::W)
}

fn is_invertible(linear: DMat3) -> bool {
    let determinant = linear.determinant();
    determinant.is_finite() && determinant != 0.0
}

/// What a linear map may depart from a similarity, relative to its squared scale.
///
/// A matrix of a similarity with scale s, written with six significant digits, has entries off by
/// up to 5·10⁻⁷ s; an entry of AᵀA is a sum of three products of two such entries and is off by up
/// to 2·3·5·10⁻⁷ s². Rounding of the arithmetic (10⁻¹⁵) drowns in that.
const SIMILARITY_TOLERANCE: f64 = 3e-6;

/// Whether AᵀA = s² I, so that a ball stays a ball.
pub(crate) fn is_similarity(linear: DMat3) -> bool {
    // Divided by the greatest entry, so that squares neither overflow nor vanish.
    let greatest = [linear.x_axis, linear.y_axis, linear.z_axis]
        .into_iter()
        .fold(0.0f64, |greatest, axis| greatest.max(axis.abs().max_element()));
    let unit = linear * (1.0 / greatest);
    let gram = unit.transpose() * unit;
    let squared = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let off = gram - DMat3::from_diagonal(DVec3::splat(squared));
    [off.x_axis, off.y_axis, off.z_axis]
        .into_iter()
        .all(|axis| axis.abs().max_element() <= SIMILARITY_TOLERANCE * squared)
}

/// The steps of a transform as one matrix: the first step acts first.
pub(crate) fn matrix_of(steps: &[TransformStep]) -> DMat4 {
    steps.iter().fold(DMat4::IDENTITY, |before, step| step.matrix() * before)
}

/// Checks a transform; its linear part, unless there was a fault.
pub(crate) fn check_steps(steps: &[TransformStep], at: At<'_>, checker: &mut Checker<'_>) -> Option<DMat3> {
    let before = checker.count();
    for (i, step) in steps.iter().enumerate() {
        let at = at.index(i);
        step.check(at.key(step.key()), checker);
    }
    if checker.count() > before {
        return None;
    }
    // The product may overflow or vanish although each step is sound.
    let matrix = matrix_of(steps);
    let linear = DMat3::from_mat4(matrix);
    if !matrix.is_finite() || !is_invertible(linear) {
        let determinant = linear.determinant();
        checker.fault(at, format!("expected a transform that can be inverted, found determinant {determinant}"));
        return None;
    }
    Some(linear)
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
            let written = [
                ("material", self.material != MaterialRef::default()),
                ("emission", self.emission.is_some()),
                ("inside", self.inside.is_some()),
                ("outside", self.outside.is_some()),
                ("flip_normals", self.flip_normals),
            ];
            for (key, _) in written.into_iter().filter(|(_, is_written)| *is_written) {
                checker.fault(
                    at.key(key),
                    "expected no such field of an instance: the shapes of its group have their own",
                );
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
                checker.require(
                    apart,
                    at.key("top"),
                    "a point other than the base",
                    format_args!("{:?}", cylinder.top),
                );
                if let Some(seam) = cylinder.seam {
                    checker.direction(at.key("seam"), seam);
                }
            }
            Geometry::Cone(cone) => {
                checker.positive(at.key("radius"), cone.radius);
                let apart = cone.base != cone.apex;
                checker.require(apart, at.key("apex"), "a point other than the base", format_args!("{:?}", cone.apex));
            }
            Geometry::Mesh(_) | Geometry::SdfGrid(_) | Geometry::Curves(_) => {}
            Geometry::Instance(instance) => checker.group(at.key("group"), &instance.group),
        }
    }
}

/// Whether two vectors other than zero span no plane.
///
/// Both are divided by their greatest component, which rounds each by ε/2 relative; a component of
/// the cross product then is a difference of two products, each at most 1, and is off by at most
/// 2·(2·ε/2 + ε/2) + ε/2·2 = 4ε. Vectors closer to parallel than that cannot be told from parallel.
pub(crate) fn parallel(a: Vec3, b: Vec3) -> bool {
    let unit = |v: Vec3| DVec3::from(v) / DVec3::from(v).abs().max_element();
    let cross = unit(a).cross(unit(b));
    let apart = cross.abs().max_element() > 4.0 * f64::EPSILON;
    // Subnormal vectors divide to NaN or infinity; they too have no direction that can be used.
    !apart
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

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
                "3:36: shapes[0].cylinder.top: expected a point other than the base, found [0.0, 1.0, 0.0]",
            ),
            (
                "cone: {base: [0, 0, 0], apex: [0, 0, 0], radius: 1}",
                "3:33: shapes[0].cone.apex: expected a point other than the base, found [0.0, 0.0, 0.0]",
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

    /// Faults of a transform, which starts at 3:34.
    fn transform(kind: &str, steps: &str) -> String {
        match kind {
            "sphere" => shape(&format!("sphere: {{radius: 1, transform: {steps}}}")),
            "cube" => shape(&format!("cube: {{  size: 1,   transform: {steps}}}")),
            _ => unreachable!(),
        }
    }

    #[test]
    fn a_transform_can_be_inverted() {
        let at = |step: &str| format!("shapes[0].cube.transform{step}: expected");
        assert_eq!(
            transform("cube", "[{scale: 0}]"),
            format!("dir/s.yaml:3:43: {} a number other than 0, found 0", at("[0].scale"))
        );
        assert_eq!(
            transform("cube", "[{scale: [1, 0, 1]}]"),
            format!("dir/s.yaml:3:47: {} a number other than 0, found 0", at("[0].scale[1]"))
        );
        assert_eq!(
            transform("cube", "[{rotate: {axis: [0, 0, 0], deg: 3}}]"),
            format!("dir/s.yaml:3:51: {} a vector with a direction, found [0, 0, 0]", at("[0].rotate.axis"))
        );
        assert_eq!(
            transform("cube", "[{matrix: [[1, 2, 0, 0], [2, 4, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]"),
            format!(
                "dir/s.yaml:3:44: {} a matrix that can be inverted, found one with determinant 0",
                at("[0].matrix")
            )
        );
        assert_eq!(
            transform("cube", "[{matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]}]"),
            format!("dir/s.yaml:3:87: {} the last row [0, 0, 0, 1], found [0.0, 0.0, 0.0, 2.0]", at("[0].matrix[3]"))
        );
        // Each step is sound, but the determinant 10⁶⁰⁰ is beyond 1.8·10³⁰⁸.
        assert_eq!(
            transform("cube", "[{scale: 1e100}, {scale: 1e100}]"),
            format!("dir/s.yaml:3:34: {} a transform that can be inverted, found determinant inf", at(""))
        );
    }

    #[test]
    fn a_sphere_stays_a_sphere() {
        let refused = "dir/s.yaml:3:34: shapes[0].sphere.transform: expected moves, turns and even scaling, \
                       so that a sphere stays a sphere, found a transform that stretches or shears";
        for steps in ["[{scale: [1, 2, 1]}]", "[{matrix: [[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]"] {
            assert_eq!(transform("sphere", steps), refused);
            assert_eq!(transform("cube", steps), "none");
        }
        let kept = [
            "[{scale: 2}, {rotate: {axis: [1, 2, 3], deg: 31}}, {translate: [1, 2, 3]}, {scale: 1e-90}]",
            "[{scale: [-1, 1, 1]}]",
            "[{scale: [1, 2, 1]}, {scale: [2, 1, 2]}]",
            // A turn by 30 degrees with six digits.
            "[{matrix: [[0.866025, -0.5, 0, 0], [0.5, 0.866025, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]",
        ];
        for steps in kept {
            assert_eq!(transform("sphere", steps), "none");
        }
        // A thousandth of stretching is not a slip of rounding.
        assert_eq!(transform("sphere", "[{scale: [1, 1.001, 1]}]"), refused);
        assert_eq!(
            shape("cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 1, transform: [{scale: [1, 2, 1]}]}"),
            "dir/s.yaml:3:66: shapes[0].cone.transform: expected moves, turns and even scaling, \
             so that a cone stays a cone, found a transform that stretches or shears"
        );
    }

    #[test]
    fn steps_act_in_the_order_of_the_list() {
        let matrix = |steps: &str| {
            let scene = scene(&format!("shapes:\n- cube: {{size: 1, transform: {steps}}}"));
            scene.shapes[0].world_from_object()
        };
        let point = |steps: &str| matrix(steps).transform_point3(DVec3::new(1.0, 0.0, 0.0)).to_array();
        // First to (2, 0, 0), then three times as far; or the other way round.
        assert_eq!(point("[{translate: [1, 0, 0]}, {scale: 3}]"), [6.0, 0.0, 0.0]);
        assert_eq!(point("[{scale: 3}, {translate: [1, 0, 0]}]"), [4.0, 0.0, 0.0]);
        // By the right hand about y, x goes to −z; quarter turns are exact.
        assert_eq!(point("[{rotate: {axis: [0, 2, 0], deg: 90}}]"), [0.0, 0.0, -1.0]);
        assert_eq!(point("[{rotate: {axis: [0, 1, 0], deg: -90}}]"), [0.0, 0.0, 1.0]);
        // Rows: x' = y + 5.
        assert_eq!(point("[{matrix: [[0, 1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]}]"), [5.0, 7.0, 7.0]);
    }

    #[test]
    fn a_turn_about_a_diagonal_permutes_the_axes() {
        let turned = rotation(DVec3::ONE, 120.0).transform_vector3(DVec3::X);
        // cos 120° and sin 120° carry an error of ε/2 each, the axis 2 ε; four products and sums.
        assert!((turned - DVec3::Y).abs().max_element() <= 8.0 * f64::EPSILON, "{turned}");
        // Axes of any length do.
        for length in [1e-200, 1e200] {
            assert_eq!(rotation(DVec3::Y * length, 90.0), rotation(DVec3::Y, 90.0));
        }
    }
}
