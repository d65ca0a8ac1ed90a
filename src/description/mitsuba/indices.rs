//! Refractive indices.

use super::super::fault::Fault;
use super::super::node::{Node, did_you_mean, quote};
use super::object::{Bag, SpectrumValue, Value};
use super::spectra::pairs_node;
use super::{Import, entry, number};

/// Indices of refraction by the names that Mitsuba gives them.
///
/// Values at the sodium D line and standard conditions as tables of physics print them; "bk7" and
/// "air" are the defaults of dielectrics.
const INDICES: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.52045),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

impl Import<'_> {
    /// The index of refraction of `int_ior` or `ext_ior`: a number, a name, or (which Mitsuba does not
    /// have) a spectrum.
    pub(crate) fn index(&mut self, bag: &Bag<'_>, name: &'static str, default: &str) -> Result<Index, Fault> {
        let place = bag.place(name);
        let by_name = |name: &str| {
            let folded = name.to_lowercase();
            INDICES.iter().find(|(known, _)| *known == folded).map(|(_, index)| *index)
        };
        match bag.value(name) {
            None => Ok(Index { node: number(place, by_name(default).unwrap_or(1.0)), number: by_name(default) }),
            Some(Value::Float(value)) => Ok(Index { node: number(place, *value), number: Some(*value) }),
            Some(Value::Integer(value)) => {
                let value = *value as f64;
                Ok(Index { node: number(place, value), number: Some(value) })
            }
            Some(Value::Text(text)) => match by_name(text) {
                Some(value) => Ok(Index { node: number(place, value), number: Some(value) }),
                None => {
                    let known = || INDICES.iter().map(|(known, _)| *known);
                    let hint = did_you_mean(text, known());
                    let message = format!(
                        "expected one of {}, found {}{hint}",
                        known().collect::<Vec<_>>().join(", "),
                        quote(text)
                    );
                    Err(bag.fault_of(name, message))
                }
            },
            Some(Value::Spectrum(SpectrumValue::Uniform(value))) => {
                Ok(Index { node: number(place, *value), number: Some(*value) })
            }
            Some(Value::Spectrum(SpectrumValue::Table(pairs))) => {
                Ok(Index { node: entry(place, "table", pairs_node(place, pairs)), number: None })
            }
            Some(other) => {
                let found = other.kind(bag.document);
                Err(bag
                    .fault_of(name, format!("expected a float, the name of a substance or a spectrum, found {found}")))
            }
        }
    }
}

/// An index of refraction.
pub(crate) struct Index {
    /// As it stands in the grammar.
    pub(crate) node: Node,
    /// Where it does not depend on wavelength.
    pub(crate) number: Option<f64>,
}
