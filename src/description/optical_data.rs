//! Refractive indices and absorption from files: the YAML of refractiveindex.info, and the CSV that its site writes.
//!
//! In both, wavelengths are in µm. A YAML file lists under `DATA` one formula or table of n, and may add one of k. A CSV
//! file has lines of numbers under headings `wl,n`, `wl,k` or `wl,n,k`.
//!
//! A formula is taken beyond the range that the file states if that covers 405 to 700 nm, outside of which lies less
//! than 1 % of each of x̄, ȳ and z̄, and says so; else the file is refused. So is a k beside an n, whose last values are held:
//! makers measure the k of dense glass from 365 to 400 nm on. No other table is continued.

use std::path::Path;

use super::fault::Fault;
use super::node::{Node, Place, Sources, Value};
use super::yaml;
use crate::error::{Error, Result, in_short};
use crate::spectrum::index::check_table;
use crate::spectrum::{BAND_NM, RefractiveIndex};

/// What the stated range of a formula, and a table of k beside an n, has to cover, nm.
const MUST_COVER: [f64; 2] = [405.0, 700.0];

/// How far below zero k may be, which is then taken as zero: by as much as clear glass absorbs, σ = 0.25 m⁻¹.
const MOST_NOISE: f64 = 1e-8;

/// No material has a k near to this; by a greater one σ = 4πk/λ or what lies between two rows may be none that a number holds.
const MOST_K: f64 = 1e6;

/// What a file says of a material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OpticalData {
    /// The index n.
    pub index: Option<RefractiveIndex>,
    /// The imaginary part k: pairs of nm and k; beyond the ends the last values are held.
    pub k: Option<Vec<[f64; 2]>>,
    /// Where the formula, or a k that is needed, is used beyond the range that the file states.
    pub notes: Vec<String>,
}

/// Whether the k of a file is needed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum ReadK {
    /// By metals, and by bodies that absorb by it: one that cannot be used is a fault.
    Needed,
    /// By nothing that uses the index alone: one that cannot be used is passed over.
    PassedOver,
}

impl OpticalData {
    /// k at `nm`; 0 without.
    #[must_use]
    pub fn k_at(&self, nm: f64) -> f64 {
        let table = |samples: &Vec<[f64; 2]>| RefractiveIndex::Table { samples: samples.clone() }.at(nm);
        self.k.as_ref().map_or(0.0, table)
    }
}

/// Reads a file, with its k as far as `k` says; one whose name ends in `.yml` or `.yaml` is YAML, any other CSV.
///
/// # Errors
/// [`Error::Input`] if it cannot be read, or with line, column and field where it is not what it should be or cannot be used
/// over the whole band.
pub fn optical_data(path: &Path, k: ReadK) -> Result<OpticalData> {
    let mut bytes = crate::input::read(path).map_err(|e| {
        let message = match e.kind() {
            std::io::ErrorKind::NotFound => "expected a file, found none".to_owned(),
            _ => e.to_string(),
        };
        Error::input(path, message)
    })?;
    // Parsers differ about a last line without an end.
    bytes.push(b'\n');
    let source = Sources::default().add_file(path);
    let ending = path.extension().map(|e| e.to_ascii_lowercase());
    let read = if ending.is_some_and(|e| e == "yml" || e == "yaml") {
        yaml::read(&bytes, source).and_then(|root| of_yaml(&root, k))
    } else {
        of_csv(&String::from_utf8_lossy(crate::input::without_mark(&bytes)), source, k)
    };
    read.map_err(|fault| {
        let Place { line, column, .. } = fault.place.unwrap_or_default();
        Error::input(path, format!("line {line}, column {column}: {}", fault.told()))
    })
}

/// Columns of a table.
#[derive(Clone, Copy, PartialEq)]
enum Columns {
    N,
    K,
    Nk,
}

/// Where a table stands, its field, and its rows (nm, value).
type Rows = (Place, String, Vec<[f64; 2]>);

/// Tables of n and k in the making.
#[derive(Default)]
struct Tables {
    n: Option<Rows>,
    k: Option<Rows>,
}

impl Tables {
    fn add(
        &mut self,
        columns: Columns,
        place: Place,
        field: &str,
        rows: &[Vec<f64>],
    ) -> std::result::Result<(), Fault> {
        let column = |c: usize| rows.iter().map(|row| [row[0] * 1e3, row[c]]).collect::<Vec<_>>();
        let put = |slot: &mut Option<_>, what: &str, c: usize| match slot {
            Some(_) => Err(told(place, field, &format!("expected one table of {what}, found a second"))),
            None => {
                *slot = Some((place, field.to_owned(), column(c)));
                Ok(())
            }
        };
        if columns != Columns::K {
            put(&mut self.n, "n", 1)?;
        }
        if columns != Columns::N {
            put(&mut self.k, "k", if columns == Columns::K { 1 } else { 2 })?;
        }
        Ok(())
    }

    /// The data of both, once they cover what they have to.
    fn finish(self, data: &mut OpticalData, k: ReadK) -> std::result::Result<(), Fault> {
        if let Some((place, field, samples)) = self.n {
            let index = RefractiveIndex::Table { samples };
            index.check_band().map_err(|fault| told(place, &field, &fault))?;
            data.index = Some(index);
        }
        let Some(table) = self.k else { return Ok(()) };
        let range = if data.index.is_some() { MUST_COVER } else { BAND_NM };
        data.k = match (usable_k(table, range), k) {
            (Ok(samples), ReadK::Needed) => {
                let stated = [samples[0][0], samples[samples.len() - 1][0]];
                data.notes.extend(beyond(stated, "k is stated for", "held over"));
                Some(samples)
            }
            (Err(fault), ReadK::Needed) => return Err(fault),
            (found, ReadK::PassedOver) => found.ok(),
        };
        Ok(())
    }
}

/// The rows of a k that covers `range`.
fn usable_k((place, field, samples): Rows, range: [f64; 2]) -> std::result::Result<Vec<[f64; 2]>, Fault> {
    if let Some([nm, k]) = samples.iter().find(|s| s[1] < -MOST_NOISE) {
        let found = format!("expected k of 0 or more, found {} at {nm} nm", in_short(*k));
        return Err(told(place, &field, &found));
    }
    if let Some([nm, k]) = samples.iter().find(|s| s[1] > MOST_K) {
        let found = format!("expected k of at most {MOST_K}, found {} at {nm} nm", in_short(*k));
        return Err(told(place, &field, &found));
    }
    check_table(&samples, range).map_err(|fault| told(place, &field, &format!("k: {fault}")))?;
    // Of clear glass k is a small difference, and noise takes some below zero.
    Ok(samples.into_iter().map(|[nm, k]| [nm, k.max(0.0)]).collect())
}

/// Says that `what` is stated for less than the band, and `done` over it, if so.
fn beyond([low, high]: [f64; 2], what: &str, done: &str) -> Option<String> {
    let is_beyond = low > BAND_NM[0] || high < BAND_NM[1];
    is_beyond.then(|| format!("{what} {low:.0} to {high:.0} nm and {done} 360 to 830 nm"))
}

fn told(place: Place, field: &str, message: &str) -> Fault {
    let separator = if field.is_empty() { "" } else { ": " };
    Fault::at_place(place, format!("{field}{separator}{message}"))
}

fn text(node: &Node) -> Option<String> {
    match &node.value {
        Value::Text(text) => Some(text.clone()),
        Value::Float(x) => Some(x.to_string()),
        Value::Unsigned(x) => Some(x.to_string()),
        Value::Signed(x) => Some(x.to_string()),
        _ => None,
    }
}

/// The numbers of a field, apart by spaces.
fn numbers(node: &Node, field: &str) -> std::result::Result<Vec<f64>, Fault> {
    let found =
        text(node).ok_or_else(|| told(node.place, field, &format!("expected numbers, found {}", node.found())))?;
    let parse = |word: &str| {
        let number = word.parse::<f64>().ok().filter(|x| x.is_finite());
        number.ok_or_else(|| told(node.place, field, &format!("expected numbers, found \"{word}\"")))
    };
    found.split_whitespace().map(parse).collect()
}

/// What the types of formulas begin with.
const FORMULA: &str = "formula ";

fn of_yaml(root: &Node, k: ReadK) -> std::result::Result<OpticalData, Fault> {
    let expected = "DATA: expected a list of formulas and tables";
    let Some(list) = root.get("DATA") else { return Err(told(root.place, "", &format!("{expected}, found no DATA"))) };
    let Value::List(entries) = &list.value else {
        return Err(told(list.place, "", &format!("{expected}, found {}", list.found())));
    };
    let kind_of = |entry: &Node| entry.get("type").and_then(text).unwrap_or_default();
    let has_formula = entries.iter().any(|entry| kind_of(entry).starts_with(FORMULA));
    let (mut data, mut tables) = (OpticalData::default(), Tables::default());
    for (i, entry) in entries.iter().enumerate() {
        let at = |field: &str| format!("DATA[{i}].{field}");
        let field = |name: &str| {
            let missing =
                || told(entry.place, &format!("DATA[{i}]"), &format!("expected the field \"{name}\", found none"));
            entry.get(name).ok_or_else(missing)
        };
        let kind_node = field("type")?;
        let kind = text(kind_node).unwrap_or_default();
        if let Some(number) = kind.strip_prefix(FORMULA) {
            if data.index.is_some() || tables.n.is_some() {
                return Err(told(kind_node.place, &at("type"), "expected one formula or table of n, found a second"));
            }
            // Older editions of the database call it `range`.
            let range = field("wavelength_range").or_else(|missing| entry.get("range").ok_or(missing))?;
            let (index, note) = formula(number, kind_node, field("coefficients")?, range, &at)?;
            data.index = Some(index);
            data.notes.extend(note);
            continue;
        }
        let columns = match kind.as_str() {
            "tabulated n" => Columns::N,
            "tabulated k" => Columns::K,
            "tabulated nk" => Columns::Nk,
            _ => {
                let expected = "expected formula 1 to 9, tabulated n, tabulated k or tabulated nk";
                return Err(told(kind_node.place, &at("type"), &format!("{expected}, found \"{kind}\"")));
            }
        };
        let rows_node = field("data")?;
        let wanted = if columns == Columns::Nk { 3 } else { 2 };
        let rows = rows(&text(rows_node).unwrap_or_default(), wanted);
        let rows = rows.map_err(|fault| told(rows_node.place, &at("data"), &fault))?;
        // A formula of n beside a table of both: the table's k counts.
        let columns = if columns == Columns::Nk && has_formula { Columns::K } else { columns };
        let rows: Vec<Vec<f64>> = match (columns, wanted) {
            (Columns::K, 3) => rows.into_iter().map(|row| vec![row[0], row[2]]).collect(),
            _ => rows,
        };
        tables.add(columns, rows_node.place, &at("data"), &rows)?;
    }
    tables.finish(&mut data, k)?;
    if data.index.is_none() && data.k.is_none() {
        return Err(told(list.place, "DATA", "expected a formula or a table, found none"));
    }
    Ok(data)
}

/// Rows of `wanted` numbers, one a line.
fn rows(text: &str, wanted: usize) -> std::result::Result<Vec<Vec<f64>>, String> {
    let lines = text.lines().filter(|line| !line.trim().is_empty()).enumerate();
    let rows = lines.map(|(i, line)| {
        let row: Option<Vec<f64>> =
            line.split_whitespace().map(|word| word.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        let fits = row.filter(|row| row.len() == wanted);
        fits.ok_or_else(|| format!("row {}: expected {wanted} numbers, found \"{}\"", i + 1, line.trim()))
    });
    rows.collect()
}

type WithNote = (RefractiveIndex, Option<String>);

fn formula(
    number: &str,
    kind: &Node,
    coefficients: &Node,
    range: &Node,
    at: &dyn Fn(&str) -> String,
) -> std::result::Result<WithNote, Fault> {
    let number = number.trim().parse().unwrap_or(0);
    let place = if (1..=9).contains(&number) { (coefficients.place, "coefficients") } else { (kind.place, "type") };
    let fault = |message: String| told(place.0, &at(place.1), &message);
    let index = RefractiveIndex::formula(number, &numbers(coefficients, &at("coefficients"))?).map_err(fault)?;
    let stated = numbers(range, &at("wavelength_range"))?;
    let &[low, high] = stated.as_slice() else {
        let found = format!("expected 2 numbers, found {}", stated.len());
        return Err(told(range.place, &at("wavelength_range"), &found));
    };
    let (low, high) = (low * 1e3, high * 1e3);
    if low > MUST_COVER[0] || high < MUST_COVER[1] {
        let [from, to] = MUST_COVER;
        let message = format!("expected a range that covers {from} to {to} nm, found {low:.0} to {high:.0} nm");
        return Err(told(range.place, &at("wavelength_range"), &message));
    }
    index.check_band().map_err(fault)?;
    Ok((index, beyond([low, high], "the formula is stated for", "continued to")))
}

/// Headings `wl,n`, and rows under them.
fn of_csv(text: &str, source: u32, k: ReadK) -> std::result::Result<OpticalData, Fault> {
    let mut tables = Tables::default();
    // The table that is being read: its columns, its heading's line, its rows.
    let mut open: Option<(Columns, u32, Vec<Vec<f64>>)> = None;
    let place = |line: u32| Place { source, line, column: 1 };
    let mut close = |open: Option<(Columns, u32, Vec<Vec<f64>>)>| match open {
        Some((_, line, rows)) if rows.is_empty() => Err(told(place(line), "", "expected rows of numbers, found none")),
        Some((columns, line, rows)) => tables.add(columns, place(line), "", &rows),
        None => Ok(()),
    };
    for (line, written) in (1..).zip(text.lines()) {
        let fields: Vec<&str> = written.split([',', ';', '\t']).map(|f| f.trim().trim_matches('"')).collect();
        if fields.iter().all(|f| f.is_empty()) || written.starts_with('#') {
            continue;
        }
        let lower = fields[0].to_lowercase();
        if lower.starts_with("wl") || lower.starts_with("wavelength") {
            close(open.take())?;
            let names: Vec<String> = fields[1..].iter().map(|f| f.to_lowercase()).collect();
            let columns = match names.iter().map(String::as_str).collect::<Vec<_>>()[..] {
                ["n"] => Columns::N,
                ["k"] => Columns::K,
                ["n", "k"] => Columns::Nk,
                _ => {
                    let expected = "expected a heading wl,n or wl,k or wl,n,k, found";
                    return Err(told(place(line), "", &format!("{expected} \"{}\"", written.trim())));
                }
            };
            open = Some((columns, line, Vec::new()));
            continue;
        }
        let Some((columns, _, rows)) = &mut open else {
            let expected = "expected a heading wl,n or wl,k or wl,n,k, found";
            return Err(told(place(line), "", &format!("{expected} \"{}\"", written.trim())));
        };
        let wanted = if *columns == Columns::Nk { 3 } else { 2 };
        let row: Option<Vec<f64>> = fields.iter().map(|f| f.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        let fits = row.filter(|row| row.len() == wanted);
        let message = || format!("expected {wanted} numbers, found \"{}\"", written.trim());
        rows.push(fits.ok_or_else(|| told(place(line), "", &message()))?);
    }
    close(open.take())?;
    let mut data = OpticalData::default();
    tables.finish(&mut data, k)?;
    if data.index.is_none() && data.k.is_none() {
        return Err(told(place(1), "", "expected a heading wl,n or wl,k or wl,n,k, found none"));
    }
    Ok(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The data of a file called `name`, or the fault without its directory.
    fn read(name: &str, text: &str) -> std::result::Result<OpticalData, String> {
        read_with(name, text, ReadK::Needed)
    }

    fn read_with(name: &str, text: &str, k: ReadK) -> std::result::Result<OpticalData, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join(name);
        std::fs::write(&path, text).unwrap();
        optical_data(&path, k).map_err(|e| {
            assert_eq!(e.exit_code(), 3, "{e}");
            e.to_string().replace(&format!("{}/", directory.path().display()), "")
        })
    }

    /// Schott's N-BK7 as the database has it: n_d is 1.5168, and k at 546 nm as written.
    const BK7: &str = "# CC0\n\nREFERENCES: |\n    <a href=\"https://x.y/z.agf\">SCHOTT: 2017</a>\n    See also\nDATA:\n  \
        - type: formula 2\n    wavelength_range: 0.3 2.5\n    \
        coefficients: 0 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653\n  \
        - type: tabulated k\n    data: |\n        0.300 2.8607E-06\n        0.546 6.9658E-09\n        2.500 8.1300E-06\n\
        CONDITIONS:\n    temperature: 293\n";

    #[test]
    fn a_formula_with_a_table_of_k_is_read() {
        let data = read("N-BK7.yml", BK7).unwrap();
        assert!((data.index.as_ref().unwrap().at(587.5618) - 1.5168).abs() < 1e-5);
        assert!((data.k_at(546.0) - 6.9658e-9).abs() < 1e-15 && data.notes.is_empty());
    }

    #[test]
    fn a_last_line_needs_no_end_and_noise_about_zero_is_none() {
        let data = read("a.yml", "DATA:\n- type: tabulated k\n  data: |\n    0.3 -8e-10\n    0.9 1e-9").unwrap();
        assert_eq!(data.k, Some(vec![[300.0, 0.0], [900.0, 1e-9]]));
    }

    /// A formula has the index and a table beside it the absorption, whichever is written first.
    #[test]
    fn a_table_of_both_beside_a_formula_gives_k() {
        let table = "- type: tabulated nk\n  data: |\n    0.3 0.2 3\n    0.6 0.4 5\n    0.9 0.6 9";
        let formula = &BK7[BK7.find("- type: formula").unwrap()..BK7.find("- type: tabulated k").unwrap()];
        let (formula, table) = (formula.trim_end(), table.replace('\n', "\n  "));
        let both = [format!("DATA:\n  {formula}\n  {table}\n"), format!("DATA:\n  {table}\n  {formula}\n")];
        let [after, before] = both.map(|yaml| read("g.yml", &yaml).unwrap());
        assert_eq!(after, before);
        assert_eq!(after.index, read("b.yml", BK7).unwrap().index);
        assert_eq!(after.k, Some(vec![[300.0, 3.0], [600.0, 5.0], [900.0, 9.0]]));
    }

    #[test]
    fn tables_and_sites_csv_agree() {
        let yaml = "DATA:\n- type: tabulated nk\n  data: |\n    0.3 0.2 3\n    0.6 0.4 5\n    0.9 0.6 9\n";
        let expected = read("m.yml", yaml).unwrap();
        assert_eq!(expected.k, Some(vec![[300.0, 3.0], [600.0, 5.0], [900.0, 9.0]]));
        assert!((expected.index.as_ref().unwrap().at(450.0) - 0.3).abs() < 1e-12);
        for csv in [
            "wl,n\n0.3,0.2\n0.6,0.4\n0.9,0.6\n\nwl,k\n0.3,3\n0.6,5\n0.9,9\n",
            "\u{feff}\"Wavelength, µm\",n,k\n",
            "wl,n,k\r\n0.3,0.2,3\r\n0.6,0.4,5\r\n0.9,0.6,9\r\n",
        ] {
            match read("m.csv", csv) {
                Ok(found) => assert_eq!(found, expected),
                Err(fault) => assert!(csv.contains("Wavelength") && fault.contains("heading"), "{fault}"),
            }
        }
    }

    #[test]
    fn a_formula_beyond_its_range_is_noted_or_refused() {
        let with = |range: &str| read("a.yml", &BK7.replace("0.3 2.5", range));
        assert_eq!(
            with("0.404 0.7065").unwrap().notes,
            ["the formula is stated for 404 to 706 nm and continued to 360 to 830 nm"]
        );
        for (range, found) in [("0.5 2.5", "500 to 2500"), ("0.3 0.6", "300 to 600")] {
            assert_eq!(
                with(range).unwrap_err(),
                format!(
                    "a.yml: line 8, column 23: DATA[0].wavelength_range: expected a range that covers 405 to 700 nm, \
                     found {found} nm"
                )
            );
        }
    }

    /// Of dense glasses makers state k from 365 to 400 nm on: what it is there it is to the end of the band, with a note beside that
    /// of the formula.
    #[test]
    fn a_k_beside_an_index_is_held_beyond_its_ends() {
        let from = |nm: &str| BK7.replace("0.300 2", nm);
        let dense = read("a.yml", &from("0.370 2").replace("0.3 2.5", "0.365 2.5")).unwrap();
        assert_eq!([360.0, 365.0, 370.0].map(|nm| dense.k_at(nm)), [2.8607e-6; 3]);
        let formula = "the formula is stated for 365 to 2500 nm and continued to 360 to 830 nm";
        assert_eq!(dense.notes, [formula, "k is stated for 370 to 2500 nm and held over 360 to 830 nm"]);
        let csv = read("a.csv", "wl,n\n0.3,1.5\n0.9,1.4\nwl,k\n0.3,1e-8\n0.75,2e-8\n").unwrap();
        assert_eq!(csv.k_at(830.0), 2e-8);
        assert_eq!(csv.notes, ["k is stated for 300 to 750 nm and held over 360 to 830 nm"]);
        // By itself a k covers the band.
        let alone = "DATA:\n- type: tabulated k\n  data: |\n    0.37 1e-8\n    0.9 1e-9\n";
        assert!(
            read("a.yml", alone).unwrap_err().contains("k: expected a table of 360 to 830 nm, found 370 to 900 nm")
        );
        assert!(
            read("a.yml", &from("0.410 2"))
                .unwrap_err()
                .contains("expected a table of 405 to 700 nm, found 410 to 2500")
        );
    }

    /// What uses the index alone does without a k that cannot be used, and has no word of one that is held.
    #[test]
    fn a_k_that_is_not_needed_is_passed_over() {
        let passed_over = |text: &str| read_with("a.yml", text, ReadK::PassedOver).unwrap();
        for text in
            [BK7.replace("0.300 2", "0.410 2"), BK7.replace("8.1300E-06", "-8e-6"), BK7.replace("2.500", "0.546")]
        {
            assert!(read("a.yml", &text).is_err(), "{text}");
            let data = passed_over(&text);
            assert_eq!((data.index, data.k), (read("b.yml", BK7).unwrap().index, None));
        }
        let held = passed_over(&BK7.replace("0.300 2", "0.370 2"));
        assert!(held.k.is_some() && held.notes.is_empty());
    }

    #[test]
    fn what_is_wrong_with_a_file_is_told_with_its_place() {
        let bad = |from: &str, to: &str| read("a.yml", &BK7.replacen(from, to, 1)).unwrap_err();
        assert!(
            bad("formula 2", "formula 12")
                .starts_with("a.yml: line 7, column 11: DATA[0].type: expected formula 1 to 9, found 12")
        );
        assert!(bad("formula 2", "magic").contains("DATA[0].type: expected formula 1 to 9, tabulated n"));
        assert_eq!(
            bad(" 103.560653", ""),
            "a.yml: line 9, column 19: DATA[0].coefficients: formula 2: expected 1, 3, 5, … coefficients, found 6"
        );
        // 0.25 µm² is a resonance at 500 nm.
        assert!(
            bad("0.00600069867", "0.25")
                .starts_with("a.yml: line 9, column 19: DATA[0].coefficients: a resonance at 500.0 nm")
        );
        assert!(
            bad("0.546 6", "0.546 x").contains("DATA[1].data: row 2: expected 2 numbers, found \"0.546 x.9658E-09\"")
        );
        assert!(
            bad("2.500 8", "0.690 8")
                .contains("DATA[1].data: k: expected a table of 405 to 700 nm, found 300 to 690 nm")
        );
        assert!(bad("8.1300E-06", "-8e-6").contains("expected k of 0 or more, found -8e-6 at 2500 nm"));
        assert!(bad("8.1300E-06", "1e308").contains("expected k of at most 1000000, found 1e308 at 2500 nm"));
        assert!(bad("DATA:", "DATUM:").contains("found no DATA"));
        assert!(
            bad("    wavelength_range: 0.3 2.5\n", "").contains("DATA[0]: expected the field \"wavelength_range\"")
        );
        let older = read("a.yml", &BK7.replace("wavelength_range", "range")).unwrap();
        assert_eq!(older, read("a.yml", BK7).unwrap());
        assert_eq!(
            read("a.csv", "0.3,1.5\n").unwrap_err(),
            "a.csv: line 1, column 1: expected a heading wl,n or wl,k or wl,n,k, found \"0.3,1.5\""
        );
        assert_eq!(
            read("a.csv", "wl,n\n0.3,1.5\n0.9\n").unwrap_err(),
            "a.csv: line 3, column 1: expected 2 numbers, found \"0.9\""
        );
        assert_eq!(
            read("a.csv", "wl,n\n0.4,1.5\n0.7,1.4\n").unwrap_err(),
            "a.csv: line 1, column 1: expected a table of 360 to 830 nm, found 400 to 700 nm"
        );
        assert_eq!(
            read("a.csv", "wl,n\n").unwrap_err(),
            "a.csv: line 1, column 1: expected rows of numbers, found none"
        );
        assert!(
            optical_data(Path::new("/nowhere/a.yml"), ReadK::Needed)
                .unwrap_err()
                .to_string()
                .contains("expected a file, found none")
        );
    }
}
