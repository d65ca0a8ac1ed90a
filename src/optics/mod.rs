//! Light at one point: how a surface or a medium scatters it.
//!
//! Conventions: `wo` points to the viewer and `wi` to the light, both leaving the surface, in the
//! local frame whose z is the shading normal. Directions and densities are f64, spectral values
//! [`Lanes`]. `eval` gives f in sr⁻¹ without the cosine.
//!
//! Wavelengths share a path. Where a sampling decision depends on the wavelength, lane 0 (the
//! hero) decides, and every density is given for each lane, so that the estimator can divide by
//! the sum over all lanes that could have led the way (Wilkie et al. 2014, "Hero Wavelength
//! Spectral Sampling", eq. 11).

pub mod bsdf;
pub mod dielectric;
pub mod fresnel;
pub mod hair;
pub mod medium;
pub mod microfacet;
pub mod phase;
pub mod plastic;
pub mod principled;
pub mod thin_film;

pub use bsdf::{Bsdf, BsdfSample, Evaluation};

use crate::spectrum::Lanes;

/// The mean of the lanes.
#[must_use]
pub fn mean(x: Lanes) -> f64 {
    f64::from(x.reduce_add()) * 0.125
}
