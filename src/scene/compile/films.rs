//! Thin films.

use super::Compiler;
use crate::description as written;
use crate::scene::material::{Film, Thickness};
use crate::spectrum::{BAND_NM, LANES, RefractiveIndex};

/// Where the eye sees best, nm: for this wavelength a film is called thick or not.
const MIDDLE_NM: f64 = 555.0;

impl<'a> Compiler<'a> {
    /// The film on a surface.
    pub(super) fn film(&mut self, at: &str, film: Option<&'a written::Film>) -> Option<Box<Film>> {
        let film = film?;
        let index = self.index(&format!("{at}.ior"), &film.ior);
        let thickness = self.thickness(&format!("{at}.thickness_nm"), &film.thickness_nm, &index);
        Some(Box::new(Film { index, thickness }))
    }

    /// How thick a film of `index` is.
    pub(super) fn thickness(
        &mut self,
        at: &str,
        thickness: &'a written::Thickness,
        index: &RefractiveIndex,
    ) -> Thickness {
        let (made, most) = match thickness {
            written::Thickness::Number(nm) => (Thickness::Uniform(*nm), *nm),
            written::Thickness::Textured(textured) => {
                let (from, to) = (textured.from, textured.to);
                let numbers = self.named_numbers(&textured.texture);
                (Thickness::Textured { numbers, from, to }, from.max(to))
            }
        };
        // Between one bright fringe and the next the way through the film and back grows by a wavelength.
        let fringes = MIDDLE_NM * MIDDLE_NM / (2.0 * index.at(MIDDLE_NM) * most);
        let lanes = (BAND_NM[1] - BAND_NM[0]) / LANES as f64;
        if fringes < lanes {
            self.note(
                at,
                &format!(
                    "up to {most} nm thick: its fringes at {MIDDLE_NM} nm lie {fringes:.2} nm apart, closer than the \
                     {lanes} nm between the wavelengths of a path; their mean is right, but noisy, and real films of \
                     this thickness are seldom even enough to show them"
                ),
            );
        }
        made
    }
}
