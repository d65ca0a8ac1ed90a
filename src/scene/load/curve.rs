//! Curves from files of text.

use super::decoded::{extension, words};
use std::path::Path;

/// Reads a curve: two columns, wavelength in nm and value, separated by commas, semicolons or
/// blanks; what follows a `#` and a heading are passed over. In a `.spd` anything may follow two columns that are apart
/// by blanks, as in Mitsuba.
///
/// # Errors
/// In words, with the line.
pub fn samples(path: &Path) -> std::result::Result<Vec<(f64, f64)>, String> {
    let bytes = crate::input::read(path).map_err(|e| words(&e))?;
    let has_comments = extension(path) == "spd";
    let number = |word: &str| word.parse().ok().filter(|x: &f64| x.is_finite());
    let mut samples = Vec::new();
    for (i, line) in crate::input::without_mark(&bytes).split(|&b| b == b'\n').enumerate() {
        let told = line.split(|&b| b == b'#').next().unwrap_or_default();
        let told =
            std::str::from_utf8(told).map_err(|_| format!("line {}: expected text, found other bytes", i + 1))?;
        let line = told.trim();
        if line.is_empty() {
            continue;
        }
        let fields = line.split(|c: char| c == ',' || c == ';' || c.is_whitespace()).filter(|f| !f.is_empty());
        let numbers: Vec<Option<f64>> = fields.map(number).collect();
        // A comma in the second word is that of a decimal fraction, and what comes after it is no comment.
        let has_columns = || line.split_whitespace().take(2).all(|word| number(word).is_some());
        match numbers.as_slice() {
            [Some(nm), Some(value), rest @ ..] if rest.is_empty() || has_comments && has_columns() => {
                samples.push((*nm, *value));
            }
            // A heading may stand before the first numbers; a wavelength that is none is not one.
            _ if samples.is_empty() && numbers.iter().take(2).all(Option::is_none) => {}
            _ => return Err(format!("line {}: expected a wavelength and a value, found \"{line}\"", i + 1)),
        }
    }
    if samples.is_empty() { Err("expected lines of wavelength and value, found none".into()) } else { Ok(samples) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_read_with_headings_comments_and_any_separator() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("curve.csv");
        std::fs::write(&path, "# source\nnm,value\n400, 0.1\n500;0.2\n\n600\t3e-1\n").unwrap();
        assert_eq!(samples(&path).unwrap(), [(400.0, 0.1), (500.0, 0.2), (600.0, 0.3)]);
        std::fs::write(&path, "\u{feff}400,0.1\n500,0.2\n").unwrap();
        assert_eq!(samples(&path).unwrap(), [(400.0, 0.1), (500.0, 0.2)]);
        std::fs::write(&path, "4OO,0.1\n500,0.2\n600,0.3\n").unwrap();
        assert_eq!(samples(&path).unwrap_err(), "line 1: expected a wavelength and a value, found \"4OO,0.1\"");
        std::fs::write(&path, "400 0.1 # dark\n500 0.2#\n").unwrap();
        assert_eq!(samples(&path).unwrap(), [(400.0, 0.1), (500.0, 0.2)]);
        let wide = "400 0.1 7\n500 0.2 lit by day\n";
        std::fs::write(&path, wide).unwrap();
        let told = "line 1: expected a wavelength and a value, found \"400 0.1 7\"";
        assert_eq!(samples(&path).unwrap_err(), told);
        std::fs::write(dir.path().join("curve.spd"), wide).unwrap();
        assert_eq!(samples(&dir.path().join("curve.spd")).unwrap(), [(400.0, 0.1), (500.0, 0.2)]);
        for commas in ["400 0,31", "400,0 0,31", "400 0,31 lit by day"] {
            std::fs::write(dir.path().join("curve.spd"), commas).unwrap();
            let told = format!("line 1: expected a wavelength and a value, found \"{commas}\"");
            assert_eq!(samples(&dir.path().join("curve.spd")).unwrap_err(), told);
        }
        std::fs::write(&path, "400 0.1\n500 zwei\n").unwrap();
        assert_eq!(samples(&path).unwrap_err(), "line 2: expected a wavelength and a value, found \"500 zwei\"");
        std::fs::write(&path, b"# 20 \xb0C\n400 0.1\n500 0.2\n").unwrap();
        assert_eq!(samples(&path).unwrap(), [(400.0, 0.1), (500.0, 0.2)]);
        std::fs::write(&path, b"400 0.1\n500 0.2\xb0\n").unwrap();
        assert_eq!(samples(&path).unwrap_err(), "line 2: expected text, found other bytes");
        assert_eq!(samples(&dir.path().join("none")).unwrap_err(), "expected a file, found none");
    }
}
