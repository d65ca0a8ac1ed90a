//! What a PNG file says of itself.

use super::tags;
use crate::error::{Error, Result};
use serde::Serialize;
use std::path::Path;

/// The head of a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PngFacts {
    /// Width and height.
    pub size: [u32; 2],
    /// Of a channel.
    pub bits: u8,
    /// `grey`, `RGB`, `indexed`, `grey and alpha`, `RGBA`.
    pub channels: &'static str,
    /// What its numbers mean, by the chunk that counts: cICP, iCCP, sRGB, gAMA.
    pub colours: String,
    /// Keywords and text.
    pub texts: Vec<(String, String)>,
}

/// Reads `path` to its end.
///
/// # Errors
/// [`Error::Input`] for a file that is missing, no PNG file, or damaged.
pub fn inspect(path: &Path) -> Result<PngFacts> {
    let bytes = std::fs::read(path).map_err(|e| {
        let missing = e.kind() == std::io::ErrorKind::NotFound;
        Error::input(path, if missing { "there is no such file".to_string() } else { e.to_string() })
    })?;
    let mut damaged = None;
    let facts = chunks(&bytes, &mut damaged);
    if let Some(chunk) = damaged {
        return Err(Error::input(path, format!("the PNG file is damaged: the checksum of the chunk {chunk} is wrong")));
    }
    let facts = facts.ok_or_else(|| Error::input(path, "not a whole PNG file: its chunks break off"))?;
    // All pixels are there and their checksums hold.
    image::load_from_memory_with_format(&bytes, image::ImageFormat::Png)
        .map_err(|e| Error::input(path, format!("the PNG file is damaged: {e}")))?;
    Ok(facts)
}

/// What chunks say, up to the first that is `damaged`, whose name is left there; readers of pixels pass over those of text and
/// colours. None where they break off or make no sense.
fn chunks(bytes: &[u8], damaged: &mut Option<String>) -> Option<PngFacts> {
    let mut rest = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n")?;
    let mut facts = PngFacts::default();
    // By rank: a better one replaces what was found before.
    let mut rank = 0;
    loop {
        let (length, after) = rest.split_at_checked(4)?;
        let length = u32::from_be_bytes(length.try_into().ok()?) as usize;
        let (name, after) = after.split_at_checked(4)?;
        let (content, after) = after.split_at_checked(length)?;
        let (crc, after) = after.split_at_checked(4)?;
        rest = after;
        if crc != tags::crc(name, content).to_be_bytes() {
            *damaged = Some(latin1(name));
            return None;
        }
        let mut says = |own: i32, text: String| {
            if own > rank {
                (rank, facts.colours) = (own, text);
            }
        };
        match name {
            b"IHDR" => {
                let word = |i: usize| Some(u32::from_be_bytes(content.get(i..i + 4)?.try_into().ok()?));
                facts.size = [word(0)?, word(4)?];
                facts.bits = *content.get(8)?;
                facts.channels = match content.get(9)? {
                    0 => "grey",
                    2 => "RGB",
                    3 => "indexed",
                    4 => "grey and alpha",
                    6 => "RGBA",
                    _ => return None,
                };
            }
            b"cICP" => says(
                4,
                match content {
                    [12, 13, 0, 1] => "Display P3 (cICP)".into(),
                    [1, 13, 0, 1] => "sRGB (cICP)".into(),
                    [9, 16, 0, 1] => "Rec. 2100 PQ (cICP)".into(),
                    [9, 18, 0, 1] => "Rec. 2100 HLG (cICP)".into(),
                    other => format!("code points {other:?} of H.273 (cICP)"),
                },
            ),
            b"iCCP" => {
                let end = content.iter().position(|b| *b == 0)?;
                says(3, format!("{} (ICC profile)", latin1(&content[..end])));
            }
            b"sRGB" => says(2, "sRGB".into()),
            b"gAMA" => {
                let gamma = u32::from_be_bytes(content.try_into().ok()?);
                says(1, format!("gamma {}", 1e5 / f64::from(gamma.max(1))));
            }
            b"tEXt" => {
                let end = content.iter().position(|b| *b == 0)?;
                facts.texts.push((latin1(&content[..end]), latin1(&content[end + 1..])));
            }
            b"IEND" => {
                if rank == 0 {
                    facts.colours = "not said, so sRGB".into();
                }
                return Some(facts);
            }
            _ => {}
        }
    }
}

fn latin1(bytes: &[u8]) -> String {
    bytes.iter().map(|b| char::from(*b)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::grey;
    use super::super::{Bits, PngSettings, Space, encode_png};
    use super::*;

    #[test]
    fn a_file_of_ours_says_what_it_is_and_a_damaged_one_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let texts = vec![("abbe/exposure".to_owned(), "1.5 stops".to_owned())];
        let settings = PngSettings {
            space: Space::DisplayP3,
            bits: Bits::Sixteen,
            texts: texts.clone(),
            ..PngSettings::default()
        };
        let bytes = encode_png(&grey(0.3, 5), &settings).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        let facts = inspect(&path).unwrap();
        let colours = "Display P3 (cICP)".to_owned();
        assert_eq!(facts, PngFacts { size: [5, 5], bits: 16, channels: "RGB", colours, texts });
        std::fs::write(&path, &bytes[..bytes.len() - 20]).unwrap();
        assert!(inspect(&path).unwrap_err().to_string().contains("its chunks break off"));
        // A chunk's name, what it says, and the pixels.
        for (name, place, told) in [(b"cICP", 0, "dICP"), (b"tEXt", 9, "tEXt"), (b"IDAT", 8, "IDAT")] {
            let mut bytes = bytes.clone();
            let at = bytes.windows(4).position(|w| w == name).unwrap() + place;
            bytes[at] = bytes[at].wrapping_add(1);
            std::fs::write(&path, &bytes).unwrap();
            let message = format!("the PNG file is damaged: the checksum of the chunk {told} is wrong");
            assert!(inspect(&path).unwrap_err().to_string().ends_with(&message), "{told}");
        }
    }
}
