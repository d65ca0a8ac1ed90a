//! Meshes, read and placed on all threads before the rest of the scene is compiled.

use crate::description::{self as written, SceneDescription};
use crate::scene::TriangleMesh;
use crate::scene::mesh::{AreaTable, Mesh, MeshSource, MeshTree, NormalMode, Sources, Winding};
use crate::scene::shelf::Shelf;
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;

/// The meshes of a scene, by where their shapes stand in the description (`shapes[3].mesh`).
#[derive(Default)]
pub(super) struct Meshes {
    sources: Sources,
    placed: HashMap<String, Result<TriangleMesh, String>>,
}

/// The meshes that a scene places, with where they stand in it: those of groups that are copied, too.
fn wanted(description: &SceneDescription) -> Vec<(String, &written::Shape, &written::Mesh)> {
    let copied: BTreeSet<&str> = description.shapes.iter().filter_map(|shape| shape.geometry.group()).collect();
    let alone = description.shapes.iter().enumerate().map(|(i, shape)| (format!("shapes[{i}]"), shape));
    let grouped =
        description.groups.iter().filter(|(name, _)| copied.contains(name.as_str())).flat_map(|(name, shapes)| {
            let list = written::field(&["groups", name]);
            shapes.iter().enumerate().map(move |(i, shape)| (format!("{list}[{i}]"), shape))
        });
    alone
        .chain(grouped)
        .filter_map(|(at, shape)| match &shape.geometry {
            written::Geometry::Mesh(mesh) => Some((format!("{at}.{}", shape.geometry.kind()), shape, mesh)),
            _ => None,
        })
        .collect()
}

impl Meshes {
    /// What of the meshes of `description` is on the shelf.
    pub(super) fn known(description: &SceneDescription, shelf: &mut Shelf) -> Sources {
        let all = wanted(description);
        let all = all.iter().map(|(_, _, mesh)| (&*mesh.file, mesh.index));
        Sources::from_known(all.filter_map(|(path, index)| Some((path, index, shelf.meshes.find(path, index)?))))
    }

    /// All meshes that `description` places, of files of which some are `known`. A file that cannot be read is left to
    /// [`Meshes::source`].
    pub(super) fn of(description: &SceneDescription, known: Sources) -> Meshes {
        let wanted = wanted(description);
        let sources = known.and(wanted.iter().map(|(_, _, mesh)| (&*mesh.file, mesh.index)));
        let placed: Vec<Option<Result<Mesh, String>>> = wanted
            .par_iter()
            .map(|(_, shape, mesh)| {
                let source = sources.known(&mesh.file, mesh.index)?;
                Some(place(source, mesh, &DAffine3::from_mat4(shape.world_from_object())))
            })
            .collect();
        // The first mesh of a file gives its tree to all others that are the same turned, moved or resized.
        let mut first: HashMap<(&Path, u32), usize> = HashMap::new();
        let model: Vec<usize> = wanted
            .iter()
            .enumerate()
            .map(|(i, (_, shape, mesh))| {
                let placed = matches!(placed[i], Some(Ok(_)));
                let alike = placed && keeps_angles(&DAffine3::from_mat4(shape.world_from_object()));
                if alike { *first.entry((&*mesh.file, mesh.index)).or_insert(i) } else { i }
            })
            .collect();
        let built: Vec<Option<MeshTree>> = placed
            .par_iter()
            .enumerate()
            .map(|(i, mesh)| match mesh {
                Some(Ok(mesh)) if model[i] == i => Some(MeshTree::build(mesh)),
                _ => None,
            })
            .collect();
        let again: Vec<Option<MeshTree>> = placed
            .par_iter()
            .zip(&model)
            .enumerate()
            .map(|(i, (mesh, &model))| match (mesh, &built[model]) {
                (Some(Ok(mesh)), Some(tree)) if model != i => Some(tree.again(mesh)),
                _ => None,
            })
            .collect();
        let placed = wanted
            .into_iter()
            .zip(placed)
            .zip(built.into_iter().zip(again))
            .filter_map(|(((at, shape, _), mesh), (built, again))| {
                // Only a lamp is asked for its area.
                let areas =
                    |mesh: &Mesh| shape.emission.as_ref().map_or_else(AreaTable::default, |_| AreaTable::new(mesh));
                Some((at, mesh?.map(|mesh| with_tree(areas(&mesh), mesh, built.or(again)))))
            })
            .collect();
        Meshes { sources, placed }
    }

    /// Puts what was read on the shelf.
    pub(super) fn keep(&self, shelf: &mut Shelf) {
        self.sources.each(|path, index, source| {
            let Ok(_) = shelf.meshes.get(path, index, || Ok::<_, Infallible>(source.clone()));
        });
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
        self.placed.remove(at).unwrap_or_else(|| {
            let mesh = place(source, mesh, world_from_object)?;
            Ok(with_tree(AreaTable::new(&mesh), mesh, None))
        })
    }
}

/// Whether shapes stay similar, to a thousandth: trees of turned and resized meshes are about as good.
fn keeps_angles(map: &DAffine3) -> bool {
    let square = map.matrix3.transpose() * map.matrix3;
    let scale = square.x_axis.x;
    let off = square - DMat3::from_diagonal(DVec3::splat(scale));
    off.to_cols_array().iter().all(|x| x.abs() <= 1e-3 * scale)
}

fn with_tree(areas: AreaTable, mesh: Mesh, tree: Option<MeshTree>) -> TriangleMesh {
    let tree = Some(tree.unwrap_or_else(|| MeshTree::build(&mesh)));
    TriangleMesh { mesh, tree, areas }
}

fn place(source: &MeshSource, written: &written::Mesh, world_from_object: &DAffine3) -> Result<Mesh, String> {
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
    Ok(mesh)
}
