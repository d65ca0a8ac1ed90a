//! Rays, frames, warps, statistics: numbers without light.
//!
//! Geometry is f64 throughout (DESIGN: positions, directions, distances, densities);
//! colour is f32. Vectors are [`glam::DVec3`]; transforms read right to left
//! (`world_from_object`).

pub mod dd;
pub mod elementary;
pub mod frame;
pub mod ray;
pub mod sampler;
pub mod statistics;
pub mod trig;
pub mod warp;

pub use frame::Frame;
pub use ray::{Departure, Ray};
