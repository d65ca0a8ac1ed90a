//! Triangle meshes.
//!
//! A [`MeshSource`] is what a file says, in f64 and object space. [`Mesh::new`] places it in the
//! world: each vertex is transformed in f64 and rounded once, to f32 relative to the mesh's
//! origin, so triangles that share a vertex share it bit for bit and the mesh stays watertight.
//!
//! The origin is the world's, or, for a mesh far from there, a multiple of a power of two near
//! the mesh. Coordinates that were f32 in the file and are not transformed are therefore kept
//! exactly, and neighbouring meshes with equal vertices in the file still fit together.
//!
//! Triangles are wound counterclockwise seen from outside. A transform that mirrors reverses the
//! winding, so that outside stays outside.

mod anew;
pub mod attribute;
mod load;
mod obj;
mod ply;
mod polygon;
mod serialized;
pub mod together;
mod tree;
mod triangle;

pub use load::{Sources, load};
pub use tree::{MAX_TRIANGLES, MeshHit, MeshTree};
pub use triangle::{TriangleHit, TriangleRay};

use crate::description::{MeshNormals, Meshes};
use crate::error::in_short;
use crate::math::{Frame, warp};
use crate::scene::bvh::Aabb;
use crate::scene::shape::SurfacePoint;
use attribute::{Attribute, Element};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::collections::HashMap;
use std::path::Path;
use triangle::area_vector;

/// Where shading normals come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NormalMode {
    /// The triangle's own normal: faceted.
    Face,
    /// The mean of the adjacent triangles' normals, weighted by their angle at the vertex.
    /// Vertices at the same place count as one, so seams of a texture do not show.
    Smooth,
    /// The file's; [`NormalMode::Smooth`] where it has none.
    File,
    /// The file's; where it has none, means as for [`NormalMode::Smooth`] but at each vertex of the file by
    /// itself: an edge between vertices that are only at the same place stays sharp.
    Vertex,
}

/// Which side of a triangle is the outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Winding {
    /// That from which the file's order of corners is counterclockwise, before any transform: outside stays
    /// outside under a transform that mirrors.
    Object,
    /// That from which it is counterclockwise in the world, so that a mirror turns the mesh inside out; but
    /// where there are normals at the vertices, the file's or their own means, the side that they are on, triangle by triangle.
    World,
}

/// What a mesh file says: f64, object space, triangles only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshSource {
    /// Vertices.
    pub positions: Vec<DVec3>,
    /// One a vertex, or none at all. A zero vector stands for a vertex without.
    pub normals: Vec<DVec3>,
    /// One a vertex, or none at all.
    pub uvs: Vec<DVec2>,
    /// Indices of vertices, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Further numbers at vertices or on triangles.
    pub attributes: Vec<Attribute>,
}

impl MeshSource {
    /// What is wrong, if anything: no triangles, an index out of range, a number that is not
    /// finite, or lists of different lengths. [`load`] has checked already.
    ///
    /// # Errors
    /// The first fault in words.
    pub fn check(&self) -> Result<(), String> {
        let n = self.positions.len();
        if self.triangles.is_empty() {
            return Err("the mesh has no triangles".into());
        }
        if self.triangles.len() > MAX_TRIANGLES {
            return Err(format!("expected at most {MAX_TRIANGLES} triangles, found {}", self.triangles.len()));
        }
        if let Some((i, p)) = self.positions.iter().enumerate().find(|(_, p)| !p.is_finite()) {
            return Err(format!("vertex {i} is at {p}: expected finite numbers"));
        }
        for (what, len) in [("normals", self.normals.len()), ("texture coordinates", self.uvs.len())] {
            if len != 0 && len != n {
                return Err(format!("expected {n} {what}, one a vertex, or none; found {len}"));
            }
        }
        if let Some((i, v)) = self.normals.iter().enumerate().find(|(_, v)| !v.is_finite()) {
            return Err(format!("the normal of vertex {i} is {v}: expected finite numbers"));
        }
        if let Some((i, v)) = self.uvs.iter().enumerate().find(|(_, v)| !v.is_finite()) {
            return Err(format!("the texture coordinates of vertex {i} are {v}: expected finite numbers"));
        }
        for a in &self.attributes {
            let values = if a.element == Element::Vertex { n } else { self.triangles.len() } * a.channels;
            if a.values.len() != values {
                return Err(format!("expected {values} numbers of attribute {}, found {}", a.name, a.values.len()));
            }
            if let Some(i) = a.values.iter().position(|v| !v.is_finite()) {
                let (i, v) = (i / a.channels, a.values[i]);
                return Err(format!("attribute {} of number {i} is {v}: expected finite numbers", a.name));
            }
        }
        for (i, t) in self.triangles.iter().enumerate() {
            if let Some(v) = t.iter().find(|&&v| v as usize >= n) {
                return Err(format!("triangle {i} names vertex {v}, but there are only {n} (counted from 0)"));
            }
        }
        Ok(())
    }
}

impl MeshSource {
    /// True where most of the area has its vertex normals on the side from which its corners are clockwise.
    fn is_wound_against_its_normals(&self) -> bool {
        let of = |t: &[u32; 3]| agreement(*t, |v| self.positions[v], |v| self.normals[v]);
        self.triangles.iter().map(of).sum::<f64>() < 0.0
    }
}

/// What exporting a scene asks of meshes.
pub const FOR_EXPORT: Meshes<'static> = Meshes {
    normals: &normals_of,
    anew: &anew::for_mitsuba,
    bare: &lacks_coordinates,
    mean_of_three: &attribute::mean_of_three,
};

/// Where the normals of mesh `index` of a file point; none of a file that cannot be read.
fn normals_of(path: &Path, index: u32) -> MeshNormals {
    match load(path, index) {
        Ok(source) if source.normals.is_empty() => MeshNormals::Missing,
        Ok(source) if source.is_wound_against_its_normals() => MeshNormals::Inward,
        Ok(_) => MeshNormals::Outward,
        Err(_) => MeshNormals::Missing,
    }
}

/// Whether mesh `index` of a file has no texture coordinates; false of a file that cannot be read.
fn lacks_coordinates(path: &Path, index: u32) -> bool {
    load(path, index).is_ok_and(|source| source.uvs.is_empty())
}

/// A mesh in the world.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// In world space; all positions are relative to it.
    pub origin: DVec3,
    /// Vertices.
    pub positions: Vec<[f32; 3]>,
    /// Shading normals, one a vertex, of unit length or zero (the triangle's own normal stands
    /// in); empty where the mesh is faceted.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, one a vertex, or empty.
    pub uvs: Vec<[f32; 2]>,
    /// Indices of vertices, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles without area. They are kept, so that indices are the file's, but no ray hits
    /// and no sampler chooses them.
    pub flat_triangles: usize,
    /// True where the second and third corner of each triangle stand the other way round than in the file.
    swapped: bool,
    /// The triangles of which the contrary is true, in order.
    contrary: Vec<u32>,
}

impl Mesh {
    /// Places `source` in the world.
    ///
    /// # Errors
    /// What [`MeshSource::check`] finds, or that the transform takes a vertex or the size of the mesh out of the range
    /// of f32.
    pub fn new(
        source: &MeshSource,
        world_from_object: &DAffine3,
        mode: NormalMode,
        winding: Winding,
    ) -> Result<Mesh, String> {
        source.check()?;
        let world: Vec<DVec3> = source.positions.iter().map(|&p| world_from_object.transform_point3(p)).collect();
        let bounds = Aabb::from_points(world.iter().copied());
        let size = (bounds.max - bounds.min).max_element();
        // Below, f32 has fewer digits. What is scaled to nothing is nowhere.
        if size > 0.0 && size < f64::from(f32::MIN_POSITIVE) {
            return Err(format!("the mesh is {size:e} m across in the world, outside the range of f32"));
        }
        let origin = choose_origin(&bounds);
        let positions: Vec<[f32; 3]> = world.iter().map(|&p| (p - origin).as_vec3().to_array()).collect();
        if let Some(i) = positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            let [x, y, z] = world[i].to_array().map(in_short);
            return Err(format!("vertex {i} lies at [{x}, {y}, {z}] in the world, outside the range of f32"));
        }

        let linear = world_from_object.matrix3;
        let mirrored = linear.determinant() < 0.0;
        let uvs = source.uvs.iter().map(|uv| uv.as_vec2().to_array()).collect();
        let mut mesh = Mesh {
            origin,
            positions,
            normals: Vec::new(),
            uvs,
            triangles: source.triangles.clone(),
            flat_triangles: 0,
            swapped: winding == Winding::Object && mirrored,
            contrary: Vec::new(),
        };
        if mesh.swapped {
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        mesh.flat_triangles = (0..mesh.triangles.len()).filter(|&i| mesh.area(i as u32) == 0.0).count();
        mesh.normals = match mode {
            NormalMode::Face => Vec::new(),
            NormalMode::File | NormalMode::Vertex if !source.normals.is_empty() => {
                // A mirror leaves normals on their side.
                let to_world = normal_transform(&linear);
                source.normals.iter().map(|&n| unit_or_zero(to_world * n).as_vec3().to_array()).collect()
            }
            NormalMode::File | NormalMode::Smooth => smooth_normals(&mesh, &places(&mesh)),
            NormalMode::Vertex => smooth_normals(&mesh, &(0..mesh.positions.len()).collect::<Vec<usize>>()),
        };
        if winding == Winding::World && matches!(mode, NormalMode::File | NormalMode::Vertex) {
            mesh.turn_to_normals();
        }
        Ok(mesh)
    }

    /// Winds the triangles, still as in the file, so that their outside is where the normals at their corners are; those of which that
    /// cannot be said as most of the area.
    fn turn_to_normals(&mut self) {
        let wide = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let of = |t: &[u32; 3]| agreement(*t, |v| wide(self.positions[v]), |v| wide(self.normals[v]));
        let agreements: Vec<f64> = self.triangles.iter().map(of).collect();
        self.swapped = agreements.iter().sum::<f64>() < 0.0;
        let sign = if self.swapped { -1.0 } else { 1.0 };
        let contrary = agreements.iter().enumerate().filter(|(_, agreement)| sign * **agreement < 0.0);
        self.contrary = contrary.map(|(i, _)| i as u32).collect();
        for i in 0..self.triangles.len() {
            if self.is_swapped(i as u32) {
                self.triangles[i].swap(1, 2);
            }
        }
    }

    /// Whether the second and third corner of triangle `i` stand the other way round than in the file.
    fn is_swapped(&self, i: u32) -> bool {
        self.swapped != self.contrary.binary_search(&i).is_ok()
    }

    /// Whether it may enclose a volume, with edges that do not meet or not: the areas of what is closed add up to nothing, as vectors.
    /// Corners are rounded to f32, 2⁻²⁴, and so are areas.
    #[must_use]
    pub fn may_be_closed(&self) -> bool {
        let areas = (0..self.triangles.len() as u32).map(|i| self.area_vector(i));
        let (sum, all) = areas.fold((DVec3::ZERO, 0.0), |(sum, all), area| (sum + area, all + area.length()));
        sum.length() <= 1e-6 * all
    }

    /// The corners of triangle `i`, relative to [`Mesh::origin`].
    #[must_use]
    pub fn vertices(&self, i: u32) -> [DVec3; 3] {
        self.triangles[i as usize].map(|v| DVec3::from(self.positions[v as usize].map(f64::from)))
    }

    /// (u, v) at the corners of triangle `i`, as they are stored: where a mesh has none, u and v are the weights of the file's
    /// second and third corner.
    #[must_use]
    pub fn texture_corners(&self, i: u32) -> [DVec2; 3] {
        match (self.uvs.is_empty(), self.is_swapped(i)) {
            (false, _) => self.triangles[i as usize].map(|v| DVec2::from(self.uvs[v as usize].map(f64::from))),
            (true, false) => [DVec2::ZERO, DVec2::X, DVec2::Y],
            (true, true) => [DVec2::ZERO, DVec2::Y, DVec2::X],
        }
    }

    /// The box of the mesh in world space.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(self.positions.iter().map(|p| DVec3::from(p.map(f64::from)) + self.origin))
    }

    /// How many edges have no second triangle, wound the same way, on their other side: none of a closed mesh. Corners in one place
    /// are one.
    #[must_use]
    pub fn open_edges(&self) -> usize {
        let places = places(self);
        // Those that run to a place of a higher number, and those that run back.
        let mut edges = [Vec::new(), Vec::new()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|v| places[v as usize] as u64);
            for (from, to) in [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from != to) {
                edges[usize::from(to < from)].push(from.min(to) << 32 | from.max(to));
            }
        }
        edges.iter_mut().for_each(|edges| edges.sort_unstable());
        let without_partner = |edges: &[u64], others: &[u64]| {
            let mut others = others.iter().peekable();
            let alone = |edge: &&u64| {
                while others.next_if(|other| other < edge).is_some() {}
                others.next_if_eq(edge).is_none()
            };
            edges.iter().filter(alone).count()
        };
        let [there, back] = &edges;
        without_partner(there, back) + without_partner(back, there)
    }

    /// Whether the volume that a closed mesh bounds, a sum over its triangles and any point, is negative beyond its rounding: its
    /// normals point into it.
    #[must_use]
    pub fn is_inside_out(&self) -> bool {
        let (mut volume, mut all) = (0.0, 0.0);
        for i in 0..self.triangles.len() as u32 {
            let corners = self.vertices(i);
            let area = area_vector(corners);
            (volume, all) = (volume + area.dot(corners[0]), all + area.length() * corners[0].length());
        }
        // A sum of n terms, each of them wrong by a few roundings.
        volume < -(self.triangles.len() as f64 + 8.0) * f64::EPSILON * all
    }

    /// The area of triangle `i`, m². Zero exactly for triangles that are never hit.
    #[must_use]
    pub fn area(&self, i: u32) -> f64 {
        0.5 * self.area_vector(i).length()
    }

    /// The normal of triangle `i` times twice its area, m².
    #[must_use]
    pub fn area_vector(&self, i: u32) -> DVec3 {
        area_vector(self.vertices(i))
    }

    /// Point and normal of [`Mesh::surface`], to the bit; the triangle's own normal and first side stand in for the rest.
    #[must_use]
    pub fn boundary(&self, i: u32, b1: f64, b2: f64) -> SurfacePoint {
        let [a, b, c] = self.vertices(i);
        let (e1, e2) = (b - a, c - a);
        let scale = a.abs().max(b.abs()).max(c.abs()).max(self.origin.abs()).max_element();
        let area = area_vector([a, b, c]);
        let (b1, b2) = off_the_edges([b1, b2], [e1, e2], area, scale);
        let point = a + e1 * b1 + e2 * b2 + self.origin;
        let normal = area.normalize();
        SurfacePoint { point, scale, normal, shading_normal: normal, uv: DVec2::ZERO, tangent: e1 }
    }

    /// The surface of triangle `i` at barycentric coordinates `b1` (of its second corner) and
    /// `b2` (of its third). The triangle must have an area.
    #[must_use]
    pub fn surface(&self, i: u32, b1: f64, b2: f64) -> SurfacePoint {
        let [a, b, c] = self.vertices(i);
        let (e1, e2) = (b - a, c - a);
        let scale = a.abs().max(b.abs()).max(c.abs()).max(self.origin.abs()).max_element();
        let area = area_vector([a, b, c]);
        let (b1, b2) = off_the_edges([b1, b2], [e1, e2], area, scale);
        let b0 = 1.0 - b1 - b2;
        let point = a + e1 * b1 + e2 * b2 + self.origin;
        let normal = area.normalize();

        let corners = self.triangles[i as usize].map(|v| v as usize);
        let shading_normal = if self.normals.is_empty() {
            normal
        } else {
            let [n0, n1, n2] = corners.map(|v| DVec3::from(self.normals[v].map(f64::from)));
            (n0 * b0 + n1 * b1 + n2 * b2).try_normalize().unwrap_or(normal)
        };

        let (uv, tangent) = if self.uvs.is_empty() {
            // u and v are the weights of the file's second and third corner.
            if self.is_swapped(i) { (DVec2::new(b2, b1), e2) } else { (DVec2::new(b1, b2), e1) }
        } else {
            let [t0, t1, t2] = self.texture_corners(i);
            let (d1, d2) = (t1 - t0, t2 - t0);
            // e1 = d1.x ∂p/∂u + d1.y ∂p/∂v and likewise e2, solved for ∂p/∂u.
            let tangent = (e1 * d2.y - e2 * d1.y) / d1.perp_dot(d2);
            let usable = tangent.is_finite() && tangent != DVec3::ZERO;
            (t0 * b0 + t1 * b1 + t2 * b2, if usable { tangent } else { Frame::from_normal(normal).s })
        };
        SurfacePoint { point, scale, normal, shading_normal, uv, tangent }
    }

    /// Whether the shading normals are the triangles' own, to the rounding of f32 in the files that meshes come from.
    #[must_use]
    pub fn is_faceted(&self) -> bool {
        const APART: f64 = 16.0 * f32::EPSILON as f64;
        self.normals.is_empty()
            || (0..self.triangles.len() as u32).filter(|&i| self.area(i) > 0.0).all(|i| {
                let normal = area_vector(self.vertices(i)).normalize();
                self.triangles[i as usize].iter().all(|&v| {
                    let n = DVec3::from(self.normals[v as usize].map(f64::from));
                    n == DVec3::ZERO || (n - normal).length() <= APART
                })
            })
    }

    /// A point uniform over triangle `i`, for `u` in the unit square; its density is
    /// 1 / [`Mesh::area`].
    #[must_use]
    pub fn sample_area(&self, i: u32, u: DVec2) -> SurfacePoint {
        let b = warp::triangle(u);
        self.surface(i, b.x, b.y)
    }

    /// Memory of the lists.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Mesh>()
            + 12 * (self.positions.len() + self.normals.len() + self.triangles.len())
            + 8 * self.uvs.len()
            + 4 * self.contrary.len()
    }
}

/// Chooses triangles of a mesh in proportion to their area; by default none.
#[derive(Clone, Debug, Default)]
pub struct AreaTable {
    /// Sum of the areas of all triangles up to and with each, m².
    cumulative: Vec<f64>,
}

impl AreaTable {
    /// The table of all of `mesh`.
    #[must_use]
    pub fn new(mesh: &Mesh) -> AreaTable {
        let mut sum = 0.0;
        let add = |i| {
            sum += mesh.area(i as u32);
            sum
        };
        AreaTable { cumulative: (0..mesh.triangles.len()).map(add).collect() }
    }

    /// The area of the mesh, m². The density of [`AreaTable::sample`] followed by
    /// [`Mesh::sample_area`] is one over it.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// A triangle, for `u` in [0, 1): never one without area; and where in its share of [0, 1) `u`
    /// lies, to be used again. None where the mesh has no area.
    #[must_use]
    pub fn sample(&self, u: f64) -> Option<(u32, f64)> {
        let total = self.total();
        // u · total can round up to the total.
        let x = (u * total).min(total.next_down());
        if total <= 0.0 {
            return None;
        }
        let i = self.cumulative.partition_point(|&c| c <= x);
        let low = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        Some((i as u32, ((x - low) / (self.cumulative[i] - low)).min(1.0f64.next_down())))
    }
}

/// Weights of the second and third corner, moved where the point is nearer to an edge than 64 steps of
/// [`crate::math::Ray::leaving`], 2⁻⁴⁰ of `scale`. A step off one face of a wedge must not cross the other: 64 steps from
/// the edge it does not, where the wedge is wider than a 64th, 0.9°. `area` is the normal times twice the area.
#[inline(always)]
fn off_the_edges([b1, b2]: [f64; 2], edges: [DVec3; 2], area: DVec3, scale: f64) -> (f64, f64) {
    const DISTANCE: f64 = 1.0 / (1u64 << 40) as f64;
    let least = b1.min(b2).min(1.0 - b1 - b2);
    // A corner's height is twice the area over the edge across from it, which is at most √12 of the scale: both squared.
    let bound = DISTANCE * scale * scale;
    if least > 0.0 && least * least * area.length_squared() >= 12.0 * bound * bound {
        return (b1, b2);
    }
    away_from_edges([b1, b2], edges, area.length(), DISTANCE * scale)
}

/// [`off_the_edges`] where it has something to do.
#[cold]
fn away_from_edges([b1, b2]: [f64; 2], [e1, e2]: [DVec3; 2], twice_area: f64, distance: f64) -> (f64, f64) {
    // Across from the first corner, the second and the third. Of a sliver the middle is far enough.
    let least = [e2 - e1, e2, e1].map(|edge| (distance * edge.length() / twice_area).min(0.25));
    let b = [1.0 - b1 - b2, b1, b2];
    let b: [f64; 3] = std::array::from_fn(|k| b[k].max(least[k]));
    let sum = b[0] + b[1] + b[2];
    (b[1] / sum, b[2] / sum)
}

/// Zero near the world's origin; else a point of a grid no finer than the mesh, near its centre.
fn choose_origin(bounds: &Aabb) -> DVec3 {
    let centre = 0.5 * bounds.min + 0.5 * bounds.max;
    let size = (bounds.max - bounds.min).max_element();
    // From here on the distance costs f32 more than three bits.
    if centre.abs().max_element() <= 4.0 * size || !centre.is_finite() {
        return DVec3::ZERO;
    }
    // The power of two that is not below the size: round the mantissa up to the next exponent.
    const MANTISSA: u64 = (1 << 52) - 1;
    let cell = f64::from_bits((size.max(f64::MIN_POSITIVE).to_bits() + MANTISSA) & !MANTISSA);
    let snapped = (centre / cell).round() * cell;
    if snapped.is_finite() { snapped } else { DVec3::ZERO }
}

/// The inverse transpose of `linear` times |its determinant|: the cofactor matrix, with the sign
/// that keeps outward normals outward. It exists for singular transforms too.
fn normal_transform(linear: &DMat3) -> DMat3 {
    let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
    let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    if linear.determinant() < 0.0 { cofactor * -1.0 } else { cofactor }
}

/// Positive where the normals at the corners of a triangle are on the side from which these are counterclockwise, negative where they are
/// on the other, and more the larger it is.
fn agreement(triangle: [u32; 3], position: impl Fn(usize) -> DVec3, normal: impl Fn(usize) -> DVec3) -> f64 {
    let [a, b, c] = triangle.map(|v| normal(v as usize));
    area_vector(triangle.map(|v| position(v as usize))).dot(a + b + c)
}

/// Scales first, as squares of small or large vectors leave the range of f64.
fn unit_or_zero(v: DVec3) -> DVec3 {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).normalize() } else { DVec3::ZERO }
}

/// For each vertex the number of its place: vertices at the same place, −0 and 0 alike, share it.
fn places(mesh: &Mesh) -> Vec<usize> {
    let mut place_of = HashMap::with_capacity(mesh.positions.len());
    mesh.positions
        .iter()
        .map(|p| {
            let next = place_of.len();
            *place_of.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(next)
        })
        .collect()
}

/// Angle-weighted normals of vertices that share a number in `places`: Thürmer and Wüthrich 1998,
/// "Computing Vertex Normals from Polygonal Facets".
fn smooth_normals(mesh: &Mesh, places: &[usize]) -> Vec<[f32; 3]> {
    let mut sums = vec![DVec3::ZERO; places.len()];
    for (i, corners) in mesh.triangles.iter().enumerate() {
        let v = mesh.vertices(i as u32);
        let normal = unit_or_zero(area_vector(v));
        for k in 0..3 {
            let (to_next, to_last) = (unit_or_zero(v[(k + 1) % 3] - v[k]), unit_or_zero(v[(k + 2) % 3] - v[k]));
            let angle = libm::atan2(to_next.cross(to_last).length(), to_next.dot(to_last));
            sums[places[corners[k] as usize]] += normal * angle;
        }
    }
    places.iter().map(|&place| unit_or_zero(sums[place]).as_vec3().to_array()).collect()
}

#[cfg(test)]
mod tests;
