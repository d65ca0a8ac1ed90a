//! Conductors by the names that Mitsuba gives them, with the measurements that it goes by.

use std::sync::OnceLock;

use super::super::fault::Fault;
use super::super::node::{did_you_mean, enumerate, quote};
use super::object::Bag;
use super::{Fields, entry, list, numbers, text};

/// Measurements by name; see the head of the file.
const TABLES: &str = include_str!("data/conductors.txt");

/// nm and value.
type Curve = Vec<[f64; 2]>;

/// Names with the real and the imaginary part of the index, in alphabetical order.
fn tables() -> &'static [(&'static str, [Curve; 2])] {
    static READ: OnceLock<Vec<(&str, [Curve; 2])>> = OnceLock::new();
    READ.get_or_init(|| {
        let curve = |line: &str| -> Curve {
            let pair = |pair: &str| pair.split_once(':').map(|(nm, value)| [nm.parse().ok(), value.parse().ok()]);
            line.split(' ').filter_map(pair).filter_map(|[nm, value]| Some([nm?, value?])).collect()
        };
        let lines: Vec<&str> = TABLES.lines().filter(|line| !line.starts_with('#')).collect();
        lines.chunks_exact(3).map(|entry| (entry[0], [curve(entry[1]), curve(entry[2])])).collect()
    })
}

/// Adds the index of the conductor `name`: from the files `data/ior/NAME.eta.spd` and `….k.spd`
/// where the search path has them, as Mitsuba reads them, else from [`TABLES`].
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
    match tables().iter().find(|(known, _)| *known == name) {
        Some((_, curves)) => {
            for (key, curve) in ["eta", "k"].iter().zip(curves) {
                let pairs = list(place, curve.iter().map(|pair| numbers(place, pair)));
                fields.add(key, entry(place, "zero_outside", entry(place, "table", pairs)));
            }
            Ok(())
        }
        None => {
            let known = || tables().iter().map(|(known, _)| *known);
            let hint = did_you_mean(name, known());
            let message = format!(
                "expected none, or one of {}, or a file data/ior/{name}.eta.spd in the search path, found {}{hint}",
                enumerate(known()),
                quote(name)
            );
            Err(bag.fault_of("material", message))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The file holds 71 conductors; each curve is a function of wavelength, and no number was lost in reading.
    #[test]
    fn every_conductor_is_a_pair_of_curves() {
        let numbers = TABLES.lines().filter(|line| !line.starts_with('#')).flat_map(|line| line.matches(':')).count();
        let read: usize = tables().iter().flat_map(|(_, curves)| curves).map(Vec::len).sum();
        assert_eq!((tables().len(), read), (71, numbers));
        for (name, curves) in tables() {
            for curve in curves {
                assert!(curve.len() >= 2 && curve.windows(2).all(|w| w[0][0] < w[1][0]), "{name}");
                assert!(curve.iter().all(|[_, value]| *value >= 0.0), "{name}");
            }
        }
    }

    /// R = ((n − 1)² + k²) / ((n + 1)² + k²) at 650 nm: gold and copper are bright there, carbon is not. Palik prints
    /// n = 0.166 and k = 3.15 for gold at 652.6 nm.
    #[test]
    fn metals_shine_as_they_are_known_to() {
        let at = |name: &str| {
            let (_, curves) = tables().iter().find(|(known, _)| *known == name).unwrap();
            let [n, k] = curves.each_ref().map(|curve| {
                let i = curve.partition_point(|[nm, _]| *nm < 650.0);
                let ([x0, y0], [x1, y1]) = (curve[i - 1], curve[i]);
                y0 + (y1 - y0) * (650.0 - x0) / (x1 - x0)
            });
            ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)
        };
        assert!(at("Au") > 0.9 && at("Cu") > 0.9 && at("Ag") > 0.95 && at("a-C") < 0.3);
    }
}
