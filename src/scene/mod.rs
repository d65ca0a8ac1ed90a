//! What rays meet: compiled, immutable, `Send + Sync`.

pub mod bvh;
pub mod mesh;
pub mod shape;
