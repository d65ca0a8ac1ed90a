//! On which side of a shape its outside and its media are.

use super::super::super::medium::{UNCHANGED, VACUUM};
use super::super::super::shape::{Caps, Geometry, Mesh, Normals, Shape, Winding};
use super::super::super::transform::is_mirror;
use super::{Export, MeshNormals};

impl Export<'_> {
    /// Whether Mitsuba has the outside of a mesh on the side from which its corners are clockwise in the world. It goes by the
    /// normals of the file, which a mirror leaves on their side while it turns the order of the corners round.
    fn is_against_its_corners(&self, mesh: &Mesh, mirrored: bool) -> bool {
        mesh.normals != Normals::Face
            && match (self.normals)(&mesh.file, mesh.index) {
                MeshNormals::Missing => false,
                MeshNormals::Outward => mirrored,
                MeshNormals::Inward => !mirrored,
            }
    }

    /// Whether Mitsuba has the outside of a mesh where its inside is.
    pub(super) fn is_turned(&self, mesh: &Mesh, mirrored: bool) -> bool {
        match (mesh.winding, mesh.normals) {
            (Winding::World, Normals::File | Normals::Vertex | Normals::Face) => false,
            // Ours are not those of the file.
            (Winding::World, Normals::Smooth) => self.is_against_its_corners(mesh, mirrored),
            (Winding::Object, _) => mirrored != self.is_against_its_corners(mesh, mirrored),
        }
    }

    /// Whether Mitsuba would have the media of a mesh on the wrong sides: it tells those by the order of the corners, and the
    /// outside of a surface by the normals.
    pub(super) fn has_crossed_media(&self, shape: &Shape) -> bool {
        let sides = self.sides(shape);
        match &shape.geometry {
            Geometry::Mesh(mesh) if sides[0] != sides[1] && self.transmits(&shape.material) => {
                self.is_against_its_corners(mesh, is_mirror(shape.world_from_object()))
            }
            _ => false,
        }
    }

    /// The media inside and outside of a shape, as they are written or else follow: outside is what the camera is in, on
    /// both sides of what is open; a closed body is empty.
    pub(super) fn sides<'s>(&'s self, shape: &'s Shape) -> [Option<&'s str>; 2] {
        let around = self.scene.medium.as_deref().filter(|_| self.transmits(&shape.material));
        let closed = match &shape.geometry {
            Geometry::Sphere(_) | Geometry::Cube(_) | Geometry::Mesh(_) => true,
            Geometry::SdfGrid(grid) => around.is_none() || (self.closed)(&grid.file),
            Geometry::Cylinder(cylinder) => cylinder.caps == Caps::Both,
            Geometry::Cone(cone) => cone.cap,
            Geometry::Disk(_) | Geometry::Plane(_) | Geometry::Rectangle(_) => false,
            Geometry::Curves(_) | Geometry::Instance(_) => false,
        };
        let enclosed = if closed { None } else { around };
        let unwritten = if shape.flip_normals { [around, enclosed] } else { [enclosed, around] };
        [shape.inside.as_deref().or(unwritten[0]), shape.outside.as_deref().or(unwritten[1])]
    }

    /// What Mitsuba gets in place of the media of a shape: there a side that is not named is empty if the other is, and
    /// a shape that names neither leaves a ray in what it is in.
    pub(super) fn sides_shortfall(&self, shape: &Shape) -> Option<&'static str> {
        if self.scene.media.is_empty() || !self.transmits(&shape.material) {
            return None;
        }
        let sides = self.sides(shape);
        let unchanged = sides.map(|side| side == Some(UNCHANGED));
        let medium = sides.map(|side| side.is_some_and(|s| s != VACUUM));
        match (unchanged, medium) {
            ([true, true], _) => None,
            ([true, _] | [_, true], _) => Some("empty space on the side that leaves the medium as it is"),
            (_, [false, false]) => Some("the medium of one side on the other, too"),
            _ => None,
        }
    }
}
