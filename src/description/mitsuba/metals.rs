//! Conductors by the names that Mitsuba gives them.

use super::super::fault::Fault;
use super::super::node::{did_you_mean, quote};
use super::object::Bag;
use super::{Fields, entry, text};

/// Mitsuba's names, and the entry of our catalogue whose measurement is nearest in reflectance
/// from 400 to 700 nm: equal for half of them, within 0.01 for most of the others, 0.015 for Au, Cr
/// and Mo. Mitsuba's own tables are not part of Abbe; see [`metal`].
const METALS: [(&str, &str); 28] = [
    ("a-C", "amorphous-carbon"),
    ("Ag", "silver-rakic"),
    ("Al", "aluminium-cheng"),
    ("AlSb", "aluminium-antimonide"),
    ("Au", "gold-olmon"),
    ("Be", "beryllium"),
    ("Cr", "chromium-sytchkova"),
    ("CsI", "caesium-iodide"),
    ("Cu", "copper-hagemann"),
    ("Cu_palik", "copper-hagemann"),
    ("d-C", "diamond-crystal"),
    ("Hg", "mercury"),
    ("Hg_palik", "mercury"),
    ("K", "potassium"),
    ("K_palik", "potassium"),
    ("Li", "lithium"),
    ("MgO", "magnesium-oxide"),
    ("Mo", "molybdenum"),
    ("Na_palik", "sodium"),
    ("Nb", "niobium"),
    ("Ni_palik", "nickel-rakic"),
    ("Rh", "rhodium"),
    ("TiC", "titanium-carbide"),
    ("TiN", "titanium-nitride-pfluger"),
    ("VC", "vanadium-carbide"),
    ("VN", "vanadium-nitride"),
    ("V_palik", "vanadium"),
    ("W", "tungsten"),
];

/// Adds the index of the conductor `name`: from the files `data/ior/NAME.eta.spd` and `….k.spd`
/// where the search path has them, as Mitsuba reads them, else from the catalogue.
///
/// # Errors
/// If neither knows it.
pub(crate) fn metal(bag: &Bag<'_>, name: &str, fields: &mut Fields) -> Result<(), Fault> {
    let place = bag.place("material");
    let files =
        ["eta", "k"].map(|part| bag.document.look_for(&format!("data/ior/{name}.{part}.spd"), bag.object.source));
    if let [Some(eta), Some(k)] = files {
        for (key, path) in [("eta", eta), ("k", k)] {
            fields.add(key, entry(place, "zero_outside", entry(place, "file", text(place, path))));
        }
        return Ok(());
    }
    match METALS.iter().find(|(theirs, _)| *theirs == name) {
        Some((_, ours)) => {
            fields.add("metal", text(place, *ours));
            Ok(())
        }
        None => {
            let known = || METALS.iter().map(|(theirs, _)| *theirs);
            let hint = did_you_mean(name, known());
            let message = format!(
                "expected one of {}, or a file data/ior/{name}.eta.spd in the search path, found {}{hint}",
                known().collect::<Vec<_>>().join(", "),
                quote(name)
            );
            Err(bag.fault_of("material", message))
        }
    }
}
