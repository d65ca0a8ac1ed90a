//! Hair, from what a person wrote.

use super::Compiler;
use super::spectra::Role;
use crate::description as written;
use crate::optics::hair::Fibre;
use crate::scene::material::Kind;
use crate::spectrum::{Outside, Spectrum, upsample};
use std::sync::Arc;

/// Absorption of pigments of concentration one in red, green and blue, for a fibre of radius one: d'Eon et
/// al. 2011.
const EUMELANIN: [f64; 3] = [0.419, 0.697, 1.37];
const PHEOMELANIN: [f64; 3] = [0.187, 0.4, 1.05];

impl Compiler<'_> {
    pub(super) fn hair(&mut self, place: &str, m: &written::Hair) -> Kind {
        let absorption = match &m.colour {
            written::HairColour::Absorption(s) => {
                vec![self.spectrum(&format!("{place}.absorption"), s, Outside::Hold, Role::OpticalConstant)]
            }
            written::HairColour::Pigments { eumelanin, pheomelanin } => {
                let mut pigment = |concentration: f64, rgb: [f64; 3]| {
                    let spectrum = self.or(place, upsample::unbounded(rgb), Spectrum::Constant(0.0));
                    self.shelf.carried.coefficient(spectrum).scaled(concentration)
                };
                vec![pigment(*eumelanin, EUMELANIN), pigment(*pheomelanin, PHEOMELANIN)]
            }
        };
        let fibre = Fibre::new(m.ior / m.exterior_ior, m.roughness_along, m.roughness_around, m.tilt_deg.to_radians());
        Kind::Hair { fibre: Arc::new(fibre), absorption }
    }
}
