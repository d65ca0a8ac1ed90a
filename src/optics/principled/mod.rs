//! Burley's principled surfaces: many looks from a few numbers between 0 and 1.
//!
//! [`Principled`] is the boundary of a solid: a dielectric or metallic lobe of microfacets, a diffuse one
//! with retro-reflection, sheen, a clear coat, and refraction into the body. [`PrincipledThin`] is a
//! leaf or a sheet, seen from both sides. The parameters and formulas are those of Mitsuba 3's `principled`
//! and `principledthin`, after Burley 2012, "Physically Based Shading at Disney", and Burley 2015,
//! "Extending the Disney BRDF to a BSDF with Integrated Subsurface Scattering".
//!
//! The model is made for looks. It is reciprocal where it reflects, but it does not keep energy: sheen adds
//! up to `sheen` / 11 of the light at any base colour, retro-reflection reflects more than comes in at grazing
//! angles on rough white surfaces, the clear coat does not dim what is below it. All lanes share one way of
//! sampling.
//!
//! ```yaml
//! # material
//! principled: {base_color: {rgb: [0.8, 0.3, 0.1]}, roughness: 0.3, metallic: 1, clearcoat: 0.5}
//! ```

use crate::spectrum::Lanes;

mod lobes;
mod solid;
#[cfg(test)]
mod tests;
mod thin;

pub use solid::{Principled, Rates};
pub use thin::{PrincipledThin, ThinRates};

/// A principled surface as a tracer of single rays shows it.
#[derive(Clone, Copy, Debug)]
pub struct SmoothParts {
    /// Albedo of the diffuse reflection.
    pub matte: Lanes,
    /// Albedo of the diffuse transmission.
    pub translucent: Lanes,
    /// Reflected as by a mirror.
    pub reflected: Lanes,
    /// Transmitted as by smooth glass, as power.
    pub transmitted: Lanes,
}

/// Least index contrast of a surface that transmits: without any it would not be seen at all.
const LEAST_CONTRAST: f64 = 1.001;

/// The index for a `specular` of 0 to 1: R₀ = 0.08 `specular` (Burley 2012, 5.4). A transmitting surface keeps
/// a contrast, as in Mitsuba 3.
#[must_use]
pub fn index_of_specular(specular: f64, transmits: bool) -> f64 {
    let specular = if transmits && specular == 0.0 { 1e-3 } else { specular };
    2.0 / (1.0 - (0.08 * specular).sqrt()) - 1.0
}

/// The index `eta`; one is no contrast, so a transmitting surface takes a little more, as in Mitsuba 3.
#[must_use]
pub fn index_of_eta(eta: f64, transmits: bool) -> f64 {
    if transmits && eta == 1.0 { LEAST_CONTRAST } else { eta }
}
