//! What rays meet: compiled, immutable, `Send + Sync`.

pub mod shape;
