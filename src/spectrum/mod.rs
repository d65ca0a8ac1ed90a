//! Wavelengths, spectra, the observer, refractive indices.
//!
//! Light is carried in eight wavelengths at a time ([`Lanes`]), which are drawn together
//! ([`SampledWavelengths`]) from a density that is chosen for the scene
//! ([`WavelengthDistribution`]); lane 0 is the hero. A [`Spectrum`] is a function of wavelength:
//! a constant, a measured table, a smooth colour. [`observer`] turns radiance into CIE XYZ,
//! [`colour`] turns XYZ into the primaries of a file, [`upsample`] turns colours into spectra,
//! and [`RefractiveIndex`] tells how glass bends each wavelength.
//!
//! Units: wavelength in nm (in µm inside dispersion formulas, as catalogues have it); emission
//! in W·m⁻²·sr⁻¹·nm⁻¹ where absolute; a radiance of 1 at every wavelength has luminance Y = 1.
//!
//! Every function that reaches pixels is free of the platform's mathematics library, so that
//! results are the same bits on every machine of one architecture.

pub mod carried;
pub mod catalogue;
pub mod colour;
pub mod illuminant;
pub mod index;
pub mod luminance;
pub mod observer;
mod spectra;
mod table;
pub mod upsample;
mod wavelengths;

pub use carried::Carried;
pub use colour::ColourSpace;
pub use index::RefractiveIndex;
pub use spectra::Spectrum;
pub use table::{Outside, Table};
pub use wavelengths::{RANDOM, SampledWavelengths, WavelengthDistribution};

/// One number for each of the eight wavelengths of a path.
#[cfg(not(feature = "four_lanes"))]
pub use wide::f32x8 as Lanes;

/// One number for each of four wavelengths of a path.
#[cfg(feature = "four_lanes")]
pub use wide::f32x4 as Lanes;

/// Whole numbers as lanes.
#[cfg(not(feature = "four_lanes"))]
#[inline]
pub(crate) fn whole(numbers: wide::i32x8) -> Lanes {
    Lanes::from_i32x8(numbers)
}

/// Whole numbers as lanes.
#[cfg(feature = "four_lanes")]
#[inline]
pub(crate) fn whole(numbers: wide::i32x4) -> Lanes {
    Lanes::from_i32x4(numbers)
}

/// How many wavelengths a path carries.
pub const LANES: usize = if cfg!(feature = "four_lanes") { 4 } else { 8 };

/// The wavelengths that are rendered, in nm: the range of the observer's table.
pub const BAND_NM: [f64; 2] = [360.0, 830.0];
