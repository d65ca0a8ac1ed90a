//! Materials by name: the optical glasses of SCHOTT, liquids, crystals and plastics, and metals.
//!
//! A formula is taken beyond the range that its source states, to the ends of the band, if that range
//! covers at least 405 to 700 nm; outside lies less than 1 % of each of x̄, ȳ and z̄, and a Sellmeier
//! formula stays smooth down to its resonance below 300 nm. That of strontium titanate is stated from 430 nm on,
//! and another measurement agrees with it below. [`Substance::note`] says so. A table
//! is never continued. Birefringent crystals have the index of their ordinary ray. Absorption of glass
//! is not here: it depends on the batch more than on the type.

use crate::spectrum::table::{Outside, Table};
use crate::spectrum::{BAND_NM, RefractiveIndex, Spectrum};
use std::sync::{Arc, LazyLock};

/// A transparent material of the catalogue.
#[derive(Clone, Debug)]
pub struct Substance {
    /// Its usual name.
    pub name: &'static str,
    /// Other names it answers to.
    pub aliases: Vec<&'static str>,
    /// Index of refraction, relative to air for glasses (as glass makers measure).
    pub index: RefractiveIndex,
    /// The range that the source states, nm.
    pub stated_nm: [f64; 2],
    /// Index at the d line and Abbe number that the glass catalogue prints.
    pub catalogue: Option<[f64; 2]>,
    /// Where the numbers were published.
    pub reference: &'static str,
}

impl Substance {
    /// Says where the index is used beyond the range that its source states, if it is.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let [lo, hi] = self.stated_nm;
        (lo > BAND_NM[0] || hi < BAND_NM[1]).then(|| {
            format!("{}: the formula is stated for {lo:.0} to {hi:.0} nm and continued to 360 to 830 nm", self.name)
        })
    }
}

/// Names in use that the catalogue has under another: makers' successors and old types.
const ALIASES: [(&str, &str); 6] = [
    ("BK7", "N-BK7"),
    ("SK16", "N-SK16"),
    ("LAK9", "N-LAK9"),
    ("BAK4", "N-BAK4"),
    ("FK51", "N-FK51A"),
    ("LASF9", "N-LASF9"),
];

static SUBSTANCES: LazyLock<Vec<Substance>> = LazyLock::new(|| {
    let mut all: Vec<Substance> = lines(include_str!("data/glasses.txt")).map(parse_glass).collect();
    all.extend(lines(include_str!("data/substances.txt")).map(parse_substance));
    all.push(Substance {
        name: "vacuum",
        aliases: Vec::new(),
        index: RefractiveIndex::Constant(1.0),
        stated_nm: BAND_NM,
        catalogue: None,
        reference: "by definition",
    });
    all
});

/// The lines of a data file that are not comments, each split at its bars. The files are part of the program
/// and tests read every line, so a fault in one is a fault of the build.
fn lines(text: &'static str) -> impl Iterator<Item = Vec<&'static str>> {
    text.lines().filter(|line| !line.starts_with('#')).map(|line| line.split('|').map(str::trim).collect())
}

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|x| x.parse().expect("the catalogue holds numbers")).collect()
}

fn pair(text: &str) -> [f64; 2] {
    numbers(text).try_into().expect("the catalogue holds two numbers here")
}

/// `name | coefficients of formula 2 | range | nd Vd`
fn parse_glass(fields: Vec<&'static str>) -> Substance {
    let name = fields[0];
    Substance {
        name,
        aliases: ALIASES.iter().filter(|(_, of)| *of == name).map(|(alias, _)| *alias).collect(),
        index: RefractiveIndex::formula(2, &numbers(fields[1])).expect("a Sellmeier formula"),
        stated_nm: pair(fields[2]),
        catalogue: Some(pair(fields[3])),
        reference: "SCHOTT Zemax catalogue 2017-01-20b",
    }
}

/// `name | aliases | reference | range | form | numbers`
fn parse_substance(fields: Vec<&'static str>) -> Substance {
    let values = numbers(fields[5]);
    let index = match fields[4].strip_prefix("formula ") {
        Some(number) => {
            let number = number.parse().expect("the number of a formula");
            RefractiveIndex::formula(number, &values).expect("a formula")
        }
        None => RefractiveIndex::Table { samples: values.chunks_exact(2).map(|p| [p[0], p[1]]).collect() },
    };
    Substance {
        name: fields[0],
        aliases: fields[1].split_whitespace().collect(),
        index,
        stated_nm: pair(fields[3]),
        catalogue: None,
        reference: fields[2],
    }
}

/// Letters and digits only, in lower case: `N-BK7`, `nbk7` and `N BK 7` are one name.
fn plain(name: &str) -> String {
    name.chars().filter(|c| !matches!(c, '-' | '_' | ' ')).flat_map(char::to_lowercase).collect()
}

/// The transparent material called `name`; letter case, hyphens and spaces do not count.
///
/// # Errors
/// In words, with near misses, if there is none.
pub fn substance(name: &str) -> Result<&'static Substance, String> {
    let wanted = plain(name);
    SUBSTANCES
        .iter()
        .find(|s| plain(s.name) == wanted || s.aliases.iter().any(|a| plain(a) == wanted))
        .ok_or_else(|| unknown("glass", name, &glass_names()))
}

/// The index of the transparent material called `name`: see [`substance`].
///
/// # Errors
/// As [`substance`].
pub fn glass(name: &str) -> Result<RefractiveIndex, String> {
    substance(name).map(|s| s.index.clone())
}

/// All names that [`glass`] knows, without aliases.
#[must_use]
fn glass_names() -> Vec<&'static str> {
    SUBSTANCES.iter().map(|s| s.name).collect()
}

/// A metal or semiconductor of the catalogue: complex index η + ik.
#[derive(Clone, Debug)]
pub struct Metal {
    /// Its usual name.
    pub name: &'static str,
    /// Other names it answers to: the chemical symbol first.
    pub aliases: Vec<&'static str>,
    /// Real part.
    pub eta: Spectrum,
    /// Imaginary part; positive absorbs.
    pub k: Spectrum,
    /// Where the numbers were published.
    pub reference: &'static str,
}

static METALS: LazyLock<Vec<Metal>> = LazyLock::new(|| {
    lines(include_str!("data/metals.txt"))
        .map(|fields| {
            let rows = numbers(fields[3]);
            let column = |c: usize| {
                let samples: Vec<(f64, f64)> = rows.chunks_exact(3).map(|row| (row[0], row[c])).collect();
                let measured = Table::new(&samples, Outside::Hold).expect("a table");
                // At each nanometre: five times as fast as the measured knots, and off by a quarter of
                // what the slope changes by at a knot: 4e-3 at most, where the measurement is good to 1e-2.
                let values: Vec<f64> = (360..=830).map(|nm| measured.at(f64::from(nm))).collect();
                Spectrum::Table(Arc::new(Table::uniform(BAND_NM[0], 1.0, &values, Outside::Hold)))
            };
            Metal {
                name: fields[0],
                aliases: fields[1].split_whitespace().collect(),
                eta: column(1),
                k: column(2),
                reference: fields[2],
            }
        })
        .collect()
});

/// η and k of the metal called `name`, or by its chemical symbol; letter case and hyphens do not
/// count.
///
/// # Errors
/// In words, with near misses, if there is none.
pub fn metal(name: &str) -> Result<(Spectrum, Spectrum), String> {
    let wanted = plain(name);
    METALS
        .iter()
        .find(|m| plain(m.name) == wanted || m.aliases.iter().any(|a| plain(a) == wanted))
        .map(|m| (m.eta.clone(), m.k.clone()))
        .ok_or_else(|| unknown("metal", name, &metal_names()))
}

/// All names that [`metal`] knows, without aliases.
#[must_use]
fn metal_names() -> Vec<&'static str> {
    METALS.iter().map(|m| m.name).collect()
}

/// The most names that are told where none is near.
const LISTED: usize = 50;

/// `unknown glass "N-BK8"; did you mean "N-BK7" or "N-BK10"?`
pub(super) fn unknown(kind: &str, name: &str, known: &[&str]) -> String {
    let wanted = plain(name);
    let mut near: Vec<(usize, &str)> = known.iter().map(|k| (strsim::osa_distance(&wanted, &plain(k)), *k)).collect();
    // Stable: names at one distance stay in the catalogue's order.
    near.sort_by_key(|(distance, _)| *distance);
    // Up to two slips, or a third of a long name.
    let most = 2.max(wanted.chars().count() / 3);
    let near: Vec<String> =
        near.iter().take(3).filter(|(distance, _)| *distance <= most).map(|(_, k)| format!("{k:?}")).collect();
    match near.as_slice() {
        [] if known.len() <= LISTED => format!("unknown {kind} {name:?}; there are {}", known.join(", ")),
        [] => format!(
            "unknown {kind} {name:?}; there are {} such names, from {:?} to {:?}",
            known.len(),
            known[0],
            known[known.len() - 1]
        ),
        names => format!("unknown {kind} {name:?}; did you mean {}?", names.join(" or ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::index::{LINE_C, LINE_D, LINE_F};

    /// The catalogue prints nd to 5 decimals and the Abbe number to 2 (of 20 to 91): each within the rounding
    /// of both. N-ZK7A's nd has 6.
    #[test]
    fn every_glass_has_its_catalogue_index_and_abbe_number() {
        let mut count = 0;
        for s in SUBSTANCES.iter() {
            s.index.check_band().unwrap_or_else(|e| panic!("{}: {e}", s.name));
            let Some([nd, vd]) = s.catalogue else { continue };
            let n = s.index.at(LINE_D);
            let v = (n - 1.0) / (s.index.at(LINE_F) - s.index.at(LINE_C));
            assert!((n - nd).abs() < 1.1e-5 && (v - vd).abs() < 0.02, "{}: {n} {v}", s.name);
            count += 1;
        }
        assert!(count >= 100, "{count}");
    }

    /// Indices at the d line as handbooks print them; the tolerance is the spread between handbooks, or
    /// the last printed digit.
    #[test]
    fn substances_have_the_index_that_handbooks_print() {
        let printed = [
            ("fused silica", 1.4585, 1e-4),
            ("water", 1.3334, 3e-4),
            ("diamond", 2.4175, 2e-3),
            ("sapphire", 1.7682, 3e-4),
            ("ice", 1.3092, 1e-3),
            ("acrylic", 1.491, 4e-3),
            ("salt", 1.5443, 3e-4),
            ("air", 1.000_277, 1e-6),
            ("vacuum", 1.0, 0.0),
            ("calcite", 1.6584, 1e-3),
            ("cubic-zirconia", 2.165, 2e-2),
            ("soda-lime", 1.523, 2e-3),
            ("strontium-titanate", 2.41, 2e-2),
        ];
        for (name, n, tolerance) in printed {
            let found = glass(name).unwrap().at(LINE_D);
            assert!((found - n).abs() <= tolerance, "{name}: {found}");
        }
        assert!(glass("diamond").unwrap().is_dispersive() && !glass("vacuum").unwrap().is_dispersive());
    }

    #[test]
    fn names_are_found_however_they_are_written() {
        for name in ["N-BK7", "n-bk7", "NBK7", "bk7", "n bk 7"] {
            assert_eq!(substance(name).unwrap().name, "N-BK7");
        }
        for name in ["SF11", "N-SF11", "F2", "N-SF6", "N-LAK33A", "silica", "H2O", "PMMA"] {
            glass(name).unwrap();
        }
        let message = glass("N-BK8").unwrap_err();
        assert!(message.starts_with("unknown glass \"N-BK8\"; did you mean \"N-BK7\""), "{message}");
        assert!(glass("xyzzyplugh").unwrap_err().contains("there are"));
        assert!(metal("gould").unwrap_err().contains("\"gold\""));
        let all = metal("xyzzyplugh").unwrap_err();
        assert!(metal_names().iter().all(|name| all.contains(name)), "{all}");
    }

    #[test]
    fn use_beyond_the_stated_range_is_said() {
        assert_eq!(
            substance("SF11").unwrap().note().unwrap(),
            "SF11: the formula is stated for 390 to 2500 nm and continued to 360 to 830 nm"
        );
        assert!(substance("N-BK7").unwrap().note().is_none());
        let from = |name: &str| if name == "strontium-titanate" { 430.0 } else { 405.0 };
        assert!(SUBSTANCES.iter().all(|s| s.stated_nm[0] <= from(s.name) && s.stated_nm[1] >= 700.0));
    }

    /// The crystal as E. Chernova et al. measured it (Opt. Mater. Express 7, 3844, 2017), to four decimals, within the range
    /// that the formula's source states and below it: 0.41 % apart at 362 nm, less than 0.1 % from 434 nm on.
    #[test]
    fn strontium_titanate_is_the_crystal_below_its_stated_range_too() {
        let index = glass("strontium-titanate").unwrap();
        let measured = [(361.82, 2.8665), (389.59, 2.7068), (410.60, 2.6327), (434.00, 2.5740), (542.16, 2.4381)];
        for (nm, n) in measured {
            let most = if nm < 430.0 { 5e-3 } else { 1e-3 };
            assert!((index.at(nm) / n - 1.0).abs() < most, "{nm} nm: {} for {n}", index.at(nm));
        }
    }

    /// Johnson and Christy 1972 print 0.43 + 2.455i for gold and 0.06 + 3.586i for silver at 2.26 eV
    /// (548.6 nm). The reflectances that follow: gold is yellow, copper red, silver and aluminium white.
    #[test]
    fn metals_have_the_measured_index_and_the_expected_hue() {
        let at = |name: &str, nm: f64| {
            let (eta, k) = metal(name).unwrap();
            [eta.at(nm), k.at(nm)]
        };
        // Off by the measured knots' being met at whole nanometres only.
        assert!((at("gold", 548.6)[0] - 0.43).abs() < 5e-3 && (at("gold", 548.6)[1] - 2.455).abs() < 5e-3);
        assert!((at("Ag", 548.6)[0] - 0.06).abs() < 5e-3 && (at("Ag", 548.6)[1] - 3.586).abs() < 5e-3);
        let reflectance = |name: &str, nm: f64| {
            let [n, k] = at(name, nm);
            ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k)
        };
        assert!(reflectance("Au", 650.0) > 0.95 && reflectance("Au", 450.0) < 0.45);
        assert!(reflectance("Cu", 650.0) > 0.9 && reflectance("Cu", 500.0) < 0.65);
        for nm in [450.0, 550.0, 650.0] {
            assert!(reflectance("Ag", nm) > 0.95 && (0.88..0.95).contains(&reflectance("aluminum", nm)));
        }
        // Rakić 1998's fit to several measurements is 0.588, 0.642, 0.679; films of others lie some hundredths beside it.
        for (nm, r) in [(450.0, 0.588), (550.0, 0.642), (650.0, 0.679)] {
            assert!((reflectance("Pt", nm) - r).abs() < 0.04, "platinum at {nm} nm: {}", reflectance("Pt", nm));
        }
        // Titanium nitride is golden, as Mitsuba's table by the name TiN is; a film of atomic layers is not.
        for name in ["titanium-nitride", "TiN"] {
            assert!(reflectance(name, 650.0) > 2.0 * reflectance(name, 450.0), "{name}: {}", reflectance(name, 450.0));
        }
        assert!(reflectance("titanium-nitride-shkondin", 650.0) < reflectance("titanium-nitride-shkondin", 450.0));
        for m in METALS.iter() {
            assert!(
                m.k.at(600.0) >= 0.0 && m.eta.at(600.0) > 0.0 && !m.eta.is_constant() && !m.reference.is_empty(),
                "{}",
                m.name
            );
        }
        assert!(METALS.len() >= 20);
    }
}
