//! Meshes, read and placed on all threads before the rest of the scene is compiled.

use crate::description::{self as written, SceneDescription};
use crate::scene::TriangleMesh;
use crate::scene::mesh::{AreaTable, Mesh, MeshSource, MeshTree, NormalMode, Sources, Winding};
use glam::DAffine3;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

/// The meshes of a scene, by where their shapes stand in the description (`shapes[3].mesh`).
#[derive(Default)]
pub(super) struct Meshes {
    sources: Sources,
    placed: HashMap<String, Result<TriangleMesh, String>>,
}

impl Meshes {
    /// All meshes that `description` places. A file that cannot be read is left to [`Meshes::source`].
    pub(super) fn of(description: &SceneDescription) -> Meshes {
        let copied: BTreeSet<&str> = description.shapes.iter().filter_map(|shape| shape.geometry.group()).collect();
        let alone = description.shapes.iter().enumerate().map(|(i, shape)| (format!("shapes[{i}]"), shape));
        let grouped =
            description.groups.iter().filter(|(name, _)| copied.contains(name.as_str())).flat_map(|(name, shapes)| {
                shapes.iter().enumerate().map(move |(i, shape)| (format!("groups.{name}[{i}]"), shape))
            });
        let wanted: Vec<(String, &written::Shape, &written::Mesh)> = alone
            .chain(grouped)
            .filter_map(|(at, shape)| match &shape.geometry {
                written::Geometry::Mesh(mesh) => Some((format!("{at}.{}", shape.geometry.kind()), shape, mesh)),
                _ => None,
            })
            .collect();
        let sources = Sources::of(wanted.iter().map(|(_, _, mesh)| (&*mesh.file, mesh.index)));
        let placed = wanted
            .into_par_iter()
            .filter_map(|(at, shape, mesh)| {
                let source = sources.known(&mesh.file, mesh.index)?;
                Some((at, place(source, mesh, &DAffine3::from_mat4(shape.world_from_object()))))
            })
            .collect();
        Meshes { sources, placed }
    }

    /// What the file of `mesh` says.
    ///
    /// # Errors
    /// As [`Sources::load`].
    pub(super) fn source(&mut self, mesh: &written::Mesh) -> crate::error::Result<Arc<MeshSource>> {
        self.sources.load(&mesh.file, mesh.index)
    }

    /// The mesh of the shape at `at`, which is asked for once, or what is wrong with it.
    pub(super) fn take(
        &mut self,
        at: &str,
        source: &MeshSource,
        mesh: &written::Mesh,
        world_from_object: &DAffine3,
    ) -> Result<TriangleMesh, String> {
        self.placed.remove(at).unwrap_or_else(|| place(source, mesh, world_from_object))
    }
}

fn place(source: &MeshSource, written: &written::Mesh, world_from_object: &DAffine3) -> Result<TriangleMesh, String> {
    let mode = match written.normals {
        written::Normals::File => NormalMode::File,
        written::Normals::Smooth => NormalMode::Smooth,
        written::Normals::Vertex => NormalMode::Vertex,
        written::Normals::Face => NormalMode::Face,
    };
    let winding = match written.winding {
        written::Winding::Object => Winding::Object,
        written::Winding::World => Winding::World,
    };
    let mut mesh = Mesh::new(source, world_from_object, mode, winding)?;
    if written.flip_v {
        mesh.uvs.iter_mut().for_each(|uv| uv[1] = 1.0 - uv[1]);
    }
    let (tree, areas) = (MeshTree::build(&mesh), AreaTable::new(&mesh));
    Ok(TriangleMesh { mesh, tree, areas })
}
