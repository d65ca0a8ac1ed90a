//! Hard numbers: scenes and functions where a renderer loses digits, each with its answer derived.

#[path = "../common/mod.rs"]
mod common;

mod bsdfs;
mod forms;
mod lamps;
mod meshes;
mod rooms;
mod scale;
mod spheres;
mod surfaces;
mod values;
mod xml;
