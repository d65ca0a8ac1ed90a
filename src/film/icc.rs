//! The names of ICC profiles of pictures (ICC.1:2022, section 9.2.41; of version 2 in ICC.1:2001-04, section 6.5.17).

use image::ImageReader;
use std::io::BufReader;
use std::path::Path;

/// What the picture at `path` says of its colours by a profile, where it has one that has a name.
#[must_use]
pub fn colours(path: &Path) -> Option<String> {
    let file = BufReader::new(crate::input::open(path).ok()?);
    let decoder = ImageReader::new(file).with_guessed_format().ok()?.into_decoder();
    let profile = image::ImageDecoder::icc_profile(&mut decoder.ok()?).ok()??;
    let linear = if is_linear(&profile) { ", linear" } else { "" };
    Some(format!("{}{linear} (ICC profile)", name(&profile)?))
}

/// What profiles of values in proportion to light say of themselves, in small letters.
pub const LINEAR: &str = "linear";

/// Whether values of red are in proportion to its light: the tag `rTRC`.
fn is_linear(profile: &[u8]) -> bool {
    let Some(curve) = tag(profile, b"rTRC") else { return false };
    // No values of a table, the exponent 1 as a number of 8 bits and a fraction of 8, or as one of 16 and 16.
    let ends = |start: &[u8]| curve.starts_with(start);
    ends(b"curv\0\0\0\0\0\0\0\0") || ends(b"curv\0\0\0\0\0\0\0\x01\x01\0") || ends(b"para\0\0\0\0\0\0\0\0\0\x01\0\0")
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize)
}

fn within(bytes: &[u8], start: usize, length: usize) -> Option<&[u8]> {
    bytes.get(start..start.checked_add(length)?)
}

/// What the tag of this name holds.
fn tag<'a>(profile: &'a [u8], name: &[u8; 4]) -> Option<&'a [u8]> {
    // Behind the head the number of tags, and of each its name, place and length.
    let mut tags = profile.get(132..)?.chunks_exact(12).take(word(profile, 128)?);
    let tag = tags.find(|tag| tag.starts_with(name))?;
    within(profile, word(tag, 4)?, word(tag, 8)?)
}

/// What a profile is called: its tag `desc`.
fn name(profile: &[u8]) -> Option<String> {
    let text = tag(profile, b"desc")?;
    let name = match text.get(..4)? {
        // One string of ASCII, with a zero at its end.
        b"desc" => String::from_utf8_lossy(within(text, 12, word(text, 8)?)?).into_owned(),
        // Strings of UTF-16 by language: the first.
        b"mluc" => {
            let letters = within(text, word(text, 24)?, word(text, 20)?)?;
            let letters: Vec<u16> = letters.as_chunks().0.iter().map(|pair| u16::from_be_bytes(*pair)).collect();
            String::from_utf16_lossy(&letters)
        }
        _ => return None,
    };
    let name: String = name.chars().filter(|c| !c.is_control()).collect();
    Some(name.trim().to_owned()).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A profile with a tag before that of its name.
    fn profile(text: &[u8]) -> Vec<u8> {
        let word = |n: usize| u32::try_from(n).unwrap().to_be_bytes();
        let tags = [&word(2)[..], b"cprt", &word(0), &word(4), b"desc", &word(156), &word(text.len())].concat();
        [&[0; 128][..], &tags, text].concat()
    }

    #[test]
    fn profiles_have_names_in_two_forms() {
        let ascii = [b"desc\0\0\0\0\0\0\0\x08", &b"Adobe 1\0"[..], &[0; 9]].concat();
        assert_eq!(name(&profile(&ascii)).unwrap(), "Adobe 1");
        let letters: Vec<u8> = "LG HDR".encode_utf16().flat_map(u16::to_be_bytes).collect();
        let head = [0, 0, 0, 1, 0, 0, 0, 12, b'e', b'n', b'U', b'S', 0, 0, 0, 12, 0, 0, 0, 28];
        let unicode = [b"mluc\0\0\0\0", &head[..], &letters].concat();
        assert_eq!(name(&profile(&unicode)).unwrap(), "LG HDR");
        // However it is cut off there is a name or none.
        for whole in [profile(&ascii), profile(&unicode)] {
            (0..whole.len()).for_each(|end| drop(name(&whole[..end])));
        }
        assert_eq!(name(&profile(b"none")), None);
    }

    #[test]
    fn linear_profiles_are_told_by_their_curve() {
        let with = |curve: &[u8]| {
            let word = |n: usize| u32::try_from(n).unwrap().to_be_bytes();
            [&[0; 128][..], &word(1), b"rTRC", &word(144), &word(curve.len()), curve].concat()
        };
        let linear = |curve: &[u8]| is_linear(&with(curve));
        assert!(linear(b"curv\0\0\0\0\0\0\0\0"));
        assert!(linear(b"curv\0\0\0\0\0\0\0\x01\x01\0"));
        assert!(linear(b"para\0\0\0\0\0\0\0\0\0\x01\0\0"));
        // The exponents 2.2 and 2.4, a table, and none.
        assert!(!linear(b"curv\0\0\0\0\0\0\0\x01\x02\x33"));
        assert!(!linear(b"para\0\0\0\0\0\x03\0\0\0\x02\x66\x66"));
        assert!(!linear(b"curv\0\0\0\0\0\0\x04\0\0\0"));
        assert!(!is_linear(&[0; 200]));
    }
}
