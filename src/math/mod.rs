//! Rays, frames, warps, statistics: numbers without light.
//!
//! Geometry is f64 throughout (positions, directions, distances, densities);
//! colour is f32. Vectors are [`glam::DVec3`]; transforms read right to left
//! (`world_from_object`).

pub mod dd;
pub mod elementary;
pub mod four;
pub mod frame;
pub mod ray;
pub mod sampler;
pub mod statistics;
pub mod trig;
pub mod warp;

/// The power of two that brings the size of a finite `x` into [1, 2); the largest or least that there is where none does.
#[must_use]
pub fn inverse_power_of_two(x: f64) -> f64 {
    let exponent = (x.to_bits() >> 52 & 0x7ff) as i64 - 1023;
    f64::from_bits(((1023 - exponent.clamp(-1022, 1022)) as u64) << 52)
}

pub use frame::Frame;
pub use ray::{Departure, Ray};

/// Least and greatest length of a shape, and of what says where one looks. The intersectors multiply at most four lengths, so
/// their products stay within 1e±240 and neither overflow nor underflow.
pub const LENGTHS: std::ops::RangeInclusive<f64> = 1e-60..=1e60;
