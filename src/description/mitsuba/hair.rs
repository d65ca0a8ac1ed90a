//! Hair.

use super::super::fault::Fault;
use super::super::node::Node;
use super::bsdfs::{Sides, transparent};
use super::object::Bag;
use super::spectra::{Role, scaled};
use super::{Fields, Import, list, number, numbers};

/// Absorption of a pigment of concentration one in Mitsuba's spectral modes, as its plugin `hair` evaluates it: a
/// smooth colour with these coefficients (λ in nm). They continue a table of reflectances to the colours of
/// d'Eon et al. 2011, (0.419, 0.697, 1.37) and (0.187, 0.4, 1.05), which reach above one, where no smooth
/// colour follows.
const EUMELANIN: [f64; 3] = [0.000_114_295, -0.138_198, 41.7609];
const PHEOMELANIN: [f64; 3] = [0.000_135_58, -0.160_486, 46.891];

fn pigment(c: [f64; 3], nm: f64) -> f64 {
    let x = (c[0] * nm + c[1]) * nm + c[2];
    0.5 + 0.5 * x / (1.0 + x * x).sqrt()
}

impl Import<'_> {
    pub(super) fn hair(&mut self, bag: &Bag<'_>, sides: Sides) -> Result<Node, Fault> {
        transparent(bag, sides)?;
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        for (theirs, ours) in [
            ("longitudinal_roughness", "roughness_along"),
            ("azimuthal_roughness", "roughness_around"),
            ("scale_tilt", "tilt_deg"),
        ] {
            fields.maybe(ours, bag.float(theirs)?.map(|value| number(bag.place(theirs), value)));
        }
        fields.add("ior", self.index(bag, "int_ior", "amber")?.node);
        fields.add("exterior_ior", self.index(bag, "ext_ior", "air")?.node);
        let scale = bag.float("scale")?.unwrap_or(1.0);
        let pigments = [bag.float("eumelanin")?, bag.float("pheomelanin")?];
        let absorption = match self.spectrum(bag, "sigma_a", Role::Coefficient)? {
            Some(_) if pigments.iter().any(Option::is_some) => {
                return Err(bag.fault("expected either sigma_a or pigments, found both"));
            }
            Some(absorption) => scaled(place, scale, absorption),
            None => {
                let [eumelanin, pheomelanin] = [pigments[0].unwrap_or(1.3), pigments[1].unwrap_or(0.2)];
                let rows = (0..=94).map(|i| {
                    let nm = 360.0 + 5.0 * f64::from(i);
                    numbers(place, &[nm, eumelanin * pigment(EUMELANIN, nm) + pheomelanin * pigment(PHEOMELANIN, nm)])
                });
                super::entry(place, "table", list(place, rows))
            }
        };
        fields.add("absorption", absorption);
        bag.finish()?;
        Ok(fields.kind("hair"))
    }
}
