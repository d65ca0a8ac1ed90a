//! Numbers on a regular grid in space, as `.vol` files hold them.
//!
//! The format is that of Mitsuba, version 3, little endian: the letters `VOL`, the byte 3, the 32-bit
//! integers 1 (for f32), x, y, z (points along each axis) and channels, six f32 for the least and the
//! greatest corner of the box that the grid fills, then the values as f32; channels change fastest,
//! then x, y and z.

use crate::error::{Error, Result};
use glam::DVec3;
use std::path::Path;

/// Bytes before the values.
const HEADER: usize = 48;

/// A grid of values.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Points along x, y and z; each at least one.
    pub size: [usize; 3],
    /// Numbers a point; at least one.
    pub channels: usize,
    /// Least corner of the box that the file says the grid fills.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
    /// All values, finite: channels change fastest, then x, y and z.
    pub values: Vec<f32>,
}

impl Grid {
    /// Reads a `.vol` file.
    ///
    /// # Errors
    /// [`Error::Input`] with what is wrong: no file, another format, truncated, a value that is not
    /// finite.
    pub fn load(path: &Path) -> Result<Grid> {
        let bytes = crate::input::read(path).map_err(|e| Error::input(path, format!("cannot read: {e}")))?;
        Grid::parse(&bytes).map_err(|message| Error::input(path, message))
    }

    /// Reads the bytes of a `.vol` file.
    ///
    /// # Errors
    /// The first fault in words.
    pub fn parse(bytes: &[u8]) -> std::result::Result<Grid, String> {
        if !bytes.starts_with(b"VOL") {
            return Err("expected a grid that starts with the letters VOL, found another format".into());
        }
        if bytes.len() < HEADER {
            return Err(format!("truncated: expected a header of {HEADER} bytes, found {}", bytes.len()));
        }
        if bytes[3] != 3 {
            return Err(format!("expected version 3 of the format, found {}", bytes[3]));
        }
        let word = |i: usize| [bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]];
        let integer = |i: usize| i32::from_le_bytes(word(i));
        let number = |i: usize| f32::from_le_bytes(word(i));
        if integer(1) != 1 {
            return Err(format!("expected values of type 1, f32, found type {}", integer(1)));
        }

        // Four positive integers below 2³¹ multiply to less than 2¹²⁴.
        let counts = [2, 3, 4, 5].map(integer);
        for (what, count) in ["points along x", "points along y", "points along z", "channels"].iter().zip(counts) {
            if count < 1 {
                return Err(format!("expected 1 or more {what}, found {count}"));
            }
        }
        let [x, y, z, channels] = counts.map(|n| n as usize);
        let expected: u128 = counts.iter().map(|&n| n as u128).product();
        let found = (bytes.len() - HEADER) / 4;
        if expected > found as u128 {
            return Err(format!(
                "truncated: expected {expected} values of {x} × {y} × {z} points with {channels} channels, found {found}"
            ));
        }
        let values: Vec<f32> = bytes[HEADER..]
            .chunks_exact(4)
            .take(expected as usize)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            return Err(format!("expected finite numbers, found {} as value {i} (counted from 0)", values[i]));
        }

        let corner = |first: usize| DVec3::from([0, 1, 2].map(|a| f64::from(number(first + a))));
        let (min, max) = (corner(6), corner(9));
        if !(min.is_finite() && max.is_finite()) {
            return Err(format!("expected a box with finite corners, found {min} to {max}"));
        }
        Ok(Grid { size: [x, y, z], channels, min, max, values })
    }

    /// Where the first channel of the point (x, y, z) is in [`Grid::values`].
    #[must_use]
    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        ((z * self.size[1] + y) * self.size[0] + x) * self.channels
    }
}

#[cfg(test)]
pub(in crate::scene) mod testing {
    /// The bytes of a file with the unit cube as its box.
    pub fn vol(size: [i32; 3], channels: i32, values: &[f32]) -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        for n in [1, size[0], size[1], size[2], channels] {
            bytes.extend(n.to_le_bytes());
        }
        for x in [0f32, 0.0, 0.0, 1.0, 1.0, 1.0].iter().chain(values) {
            bytes.extend(x.to_le_bytes());
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::testing::vol;
    use super::*;

    #[test]
    fn channels_change_fastest_then_x_y_and_z() {
        let values: Vec<f32> = (0..48u8).map(f32::from).collect();
        let grid = Grid::parse(&vol([2, 3, 4], 2, &values)).unwrap();
        assert_eq!((grid.size, grid.channels, grid.min, grid.max), ([2, 3, 4], 2, DVec3::ZERO, DVec3::ONE));
        // ((2·3 + 1)·2 + 1)·2 = 30.
        assert_eq!(grid.values[grid.index(1, 1, 2)..][..2], [30.0, 31.0]);
    }

    #[test]
    fn what_is_no_grid_is_refused_in_words() {
        let good = vol([2, 1, 1], 1, &[0.5, 1.5]);
        assert!(Grid::parse(&good).is_ok());
        let changed = |at: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[at] = byte;
            Grid::parse(&bytes).unwrap_err()
        };
        assert!(changed(0, b'W').contains("starts with the letters VOL"));
        assert_eq!(changed(3, 2), "expected version 3 of the format, found 2");
        assert_eq!(changed(4, 2), "expected values of type 1, f32, found type 2");
        assert_eq!(changed(12, 0), "expected 1 or more points along y, found 0");
        assert!(changed(23, 0x7f).starts_with("truncated: expected "));
        for len in 3..good.len() {
            assert!(Grid::parse(&good[..len]).unwrap_err().starts_with("truncated"), "{len}");
        }
        let nan = Grid::parse(&vol([2, 1, 1], 1, &[0.5, f32::NAN])).unwrap_err();
        assert_eq!(nan, "expected finite numbers, found NaN as value 1 (counted from 0)");
    }
}
