//! Textures that are attributes of the mesh they lie on.
//!
//! Such a texture, and with it a material that holds one, is another one on each mesh: neither is kept by
//! name, and the material is compiled anew for each shape that has it.

use super::Compiler;
use crate::description as written;
use crate::scene::mesh::attribute::AttributeTexture;
use crate::scene::mesh::{Mesh, MeshSource};
use std::sync::Arc;

/// The surface that a material is compiled for.
pub(super) enum Surface {
    /// Any.
    Unknown,
    /// One without attributes.
    Shape,
    /// A mesh.
    Mesh(OfMesh),
}

/// The attributes of a mesh, and its triangles as they lie in the world.
pub(super) struct OfMesh {
    source: Arc<MeshSource>,
    triangles: Vec<[u32; 3]>,
}

impl OfMesh {
    pub(super) fn new(source: Arc<MeshSource>, mesh: &Mesh) -> OfMesh {
        // Only attributes need them.
        let triangles = if source.attributes.is_empty() { Vec::new() } else { mesh.triangles.clone() };
        OfMesh { source, triangles }
    }
}

impl<'a> Compiler<'a> {
    /// What `make` makes, and whether it asked for the surface.
    pub(super) fn asking<T>(&mut self, make: impl FnOnce(&mut Self) -> T) -> (T, bool) {
        let before = std::mem::take(&mut self.asks_for_surface);
        let made = make(self);
        let asked = self.asks_for_surface;
        self.asks_for_surface |= before;
        (made, asked)
    }

    /// The attribute that `texture` names, of the mesh at hand; `None` where the surface is not known, or after a
    /// fault.
    pub(super) fn attribute(&mut self, at: &str, texture: &'a written::MeshAttribute) -> Option<AttributeTexture> {
        self.asks_for_surface = true;
        let name = texture.name.as_str();
        let message = match &self.surface {
            Surface::Unknown => return None,
            Surface::Shape => format!("expected a mesh that has the attribute {name}, found another shape"),
            Surface::Mesh(mesh) => {
                let attributes = &mesh.source.attributes;
                match attributes.iter().find(|a| a.name == name) {
                    Some(a) => match a.values.iter().find(|x| a.channels == 3 && !(0.0..=1.0).contains(*x)) {
                        None => {
                            return Some(AttributeTexture::new(a, &mesh.triangles, texture.scale, self.shelf.carried));
                        }
                        Some(x) => format!("expected colours from 0 to 1 in the attribute {name}, found {x}"),
                    },
                    None if attributes.is_empty() => {
                        format!("expected a mesh that has the attribute {name}, found none")
                    }
                    None => {
                        let names: Vec<&str> = attributes.iter().map(|a| a.name.as_str()).collect();
                        format!("expected an attribute of the mesh, {}; found {name}", names.join(", "))
                    }
                }
            }
        };
        self.fault(&format!("{at}.mesh_attribute.name"), message);
        None
    }
}
