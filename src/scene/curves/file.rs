//! Files of curves: one control point a line, `x y z radius`; an empty line ends a curve.

use std::path::Path;

use crate::error::{Error, Result};

/// A control point: x, y, z and radius.
pub type ControlPoint = [f64; 4];

/// The control points of each curve of a file.
pub type Strands = Vec<Vec<ControlPoint>>;

/// Reads a file of curves.
///
/// # Errors
/// [`Error::Input`] with the line: no file, a line without four finite numbers, a negative radius, no
/// curve at all.
pub fn load(path: &Path) -> Result<Strands> {
    let bytes = crate::input::read(path).map_err(|e| Error::input(path, format!("cannot read: {e}")))?;
    let text = std::str::from_utf8(crate::input::without_mark(&bytes));
    let text = text.map_err(|_| Error::input(path, "expected text, found other bytes"))?;
    parse(text).map_err(|message| Error::input(path, message))
}

/// Reads the text of such a file. As in Mitsuba, what follows the four numbers of a line is passed over.
///
/// # Errors
/// The first fault in words.
pub fn parse(text: &str) -> std::result::Result<Strands, String> {
    let mut curves = Strands::new();
    let mut open = false;
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() {
            open = false;
            continue;
        }
        let mut fields = line.split_whitespace();
        let mut point = [0.0; 4];
        for (number, what) in point.iter_mut().zip(["x", "y", "z", "radius"]) {
            let field = fields.next().unwrap_or("nothing");
            *number = field.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
                format!("line {}: expected four numbers, x y z radius; found {field} for {what}", i + 1)
            })?;
        }
        if point[3] < 0.0 {
            return Err(format!("line {}: expected a radius of 0 or more, found {}", i + 1, point[3]));
        }
        match curves.last_mut() {
            Some(curve) if open => curve.push(point),
            _ => curves.push(vec![point]),
        }
        open = true;
    }
    if curves.is_empty() { Err("expected control points, found none".into()) } else { Ok(curves) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_lines_separate_curves() {
        let text = "\n 0 0 0 .5\n1 0 0 0.5\r\n \t\r\n\n2 0 0 1\n3 0\t0 1e-3 passed over\n4 0 0 0\n";
        let curves = parse(text).unwrap();
        assert_eq!(curves[0], [[0.0, 0.0, 0.0, 0.5], [1.0, 0.0, 0.0, 0.5]]);
        assert_eq!(curves[1], [[2.0, 0.0, 0.0, 1.0], [3.0, 0.0, 0.0, 1e-3], [4.0, 0.0, 0.0, 0.0]]);
        assert_eq!(curves.len(), 2);
    }

    #[test]
    fn faults_name_the_line() {
        let fault = |text: &str| parse(text).unwrap_err();
        assert_eq!(fault(" \n"), "expected control points, found none");
        assert_eq!(fault("1 2 3 4\n1 2 3"), "line 2: expected four numbers, x y z radius; found nothing for radius");
        assert_eq!(fault("1 b 3 4"), "line 1: expected four numbers, x y z radius; found b for y");
        assert_eq!(fault("1 2 inf 4"), "line 1: expected four numbers, x y z radius; found inf for z");
        assert_eq!(fault("\n1 2 3 -4"), "line 2: expected a radius of 0 or more, found -4");
    }
}
