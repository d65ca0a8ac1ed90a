//! Portable float maps: `PF` (colours) or `Pf` (grey), width, height and a scale in words, then f32 from the lowest row up,
//! with the lowest byte first where the scale is negative.
//!
//! The scale's size is a factor on the values, as for Mitsuba.

use super::decoded::LARGEST;
use image::DynamicImage;

/// More bytes than any number has that is written with sense.
const LONGEST: usize = 32;

/// Whether a file begins as one.
pub(super) fn is(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'F' | b'f', end, ..] if end.is_ascii_whitespace())
}

/// Whether it has colours, or grey alone.
pub(super) fn is_coloured(bytes: &[u8]) -> bool {
    bytes[1] == b'F'
}

/// Its pixels, which are linear.
///
/// # Errors
/// What was expected and what was found.
pub(super) fn decode(bytes: &[u8]) -> Result<DynamicImage, String> {
    let channels = if is_coloured(bytes) { 3 } else { 1 };
    let mut rest = &bytes[2..];
    let mut word = |what: &str| {
        let start = rest.iter().position(|b| !b.is_ascii_whitespace());
        let from = &rest[start.unwrap_or(rest.len())..];
        let none = if from.len() > LONGEST { "a longer word" } else { "its end" };
        let end = from.iter().take(LONGEST).position(u8::is_ascii_whitespace);
        let end = end.ok_or_else(|| format!("expected {what}, found {none}"))?;
        // One byte lies between the last word and the values.
        rest = &from[end + 1..];
        std::str::from_utf8(&from[..end]).map_err(|_| format!("expected {what}, found other bytes"))
    };
    let mut size = |what: &str| {
        let word = word(what)?;
        word.parse().ok().filter(|n: &u32| *n > 0).ok_or_else(|| format!("expected {what} from 1 up, found {word}"))
    };
    let (width, height) = (size("a width")?, size("a height")?);
    let scale = word("a scale")?;
    let scale: f32 = scale
        .parse()
        .ok()
        .filter(|s: &f32| s.is_finite() && *s != 0.0)
        .ok_or_else(|| format!("expected a scale that is a number other than 0, found {scale}"))?;
    let row = u64::from(width) * 4 * channels;
    let all = row.checked_mul(u64::from(height)).filter(|all| *all <= LARGEST);
    let all = all.ok_or_else(|| format!("expected at most 2 GiB, found {width} x {height} pixels"))?;
    let found = rest.len() as u64;
    if found != all {
        return Err(format!("expected {all} bytes of {width} x {height} pixels, found {found}"));
    }
    let value = |b: &[u8]| {
        let b = [b[0], b[1], b[2], b[3]];
        scale.abs() * if scale < 0.0 { f32::from_le_bytes(b) } else { f32::from_be_bytes(b) }
    };
    let rows = rest.chunks_exact(row as usize).rev();
    let repeat = if channels == 1 { 3 } else { 1 };
    let values = rows.flat_map(|row| row.chunks_exact(4)).flat_map(|b| std::iter::repeat_n(value(b), repeat)).collect();
    image::Rgb32FImage::from_raw(width, height, values).map(DynamicImage::from).ok_or("expected pixels".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, values: &[f32], bytes: impl Fn(f32) -> [u8; 4]) -> Vec<u8> {
        let mut file = header.as_bytes().to_vec();
        values.iter().for_each(|x| file.extend(bytes(*x)));
        file
    }

    /// One column of two rows, the lower one first in the file.
    #[test]
    fn rows_go_up_and_the_scale_tells_the_order_of_bytes_and_a_factor() {
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 0.25];
        for (scale, factor) in [("-1", 1.0), ("-0.5", 0.5), ("1.0", 1.0), ("2", 2.0)] {
            let header = format!("PF\n1 2\n{scale}\n");
            let bytes = if scale.starts_with('-') { f32::to_le_bytes } else { f32::to_be_bytes };
            let image = decode(&file(&header, &values, bytes)).unwrap();
            assert_eq!((image.width(), image.height()), (1, 2));
            assert_eq!(image.into_rgb32f().into_raw(), [4.0, 5.0, 0.25, 1.0, 2.0, 3.0].map(|x| x * factor), "{scale}");
        }
        let grey = decode(&file("Pf 2 1 -1\n", &[0.5, -7.0], f32::to_le_bytes)).unwrap();
        assert_eq!(grey.into_rgb32f().into_raw(), [0.5, 0.5, 0.5, -7.0, -7.0, -7.0]);
    }

    #[test]
    fn what_is_no_map_is_told() {
        for (header, said) in [
            ("PF\n1 ", "expected a height, found its end"),
            ("PF\n1234567890123456789012345678901234567890 1 -1\n", "expected a width, found a longer word"),
            ("PF\n0 1 -1\n", "expected a width from 1 up, found 0"),
            ("PF\n1 -1 -1\n", "expected a height from 1 up, found -1"),
            ("PF\n1 1 x\n", "expected a scale that is a number other than 0, found x"),
            ("PF\n1 1 0\n", "expected a scale that is a number other than 0, found 0"),
            ("PF\n1 1 nan\n", "expected a scale that is a number other than 0, found nan"),
            ("PF\n1 1 -1\n", "expected 12 bytes of 1 x 1 pixels, found 0"),
            ("PF\n4000000000 4000000000 -1\n", "expected at most 2 GiB, found 4000000000 x 4000000000 pixels"),
        ] {
            assert!(is(header.as_bytes()));
            assert_eq!(decode(header.as_bytes()).unwrap_err(), said);
        }
        assert!(!is(b"PNG") && !is(b"P"));
    }
}
