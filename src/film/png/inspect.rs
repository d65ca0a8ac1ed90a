//! What a PNG file says of itself.

use super::tags;
use crate::error::{Error, Result};
use crate::film::icc;
use serde::Serialize;
use std::io::{BufReader, Cursor, Read};
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
    /// What its numbers mean, by the chunk that counts: cICP, iCCP, sRGB, cHRM, gAMA.
    pub colours: String,
    /// Keywords and text.
    pub texts: Vec<(String, String)>,
}

/// Reads `path` to its end.
///
/// # Errors
/// [`Error::Input`] for a file that is missing, no PNG file, or damaged.
pub fn inspect(path: &Path) -> Result<PngFacts> {
    let bytes = crate::input::read(path).map_err(|e| Error::unread(path, &e))?;
    let mut damaged = None;
    let facts = chunks(&bytes, &mut damaged);
    if let Some(chunk) = damaged {
        return Err(Error::input(path, format!("the PNG file is damaged: the checksum of the chunk {chunk} is wrong")));
    }
    let facts = facts.ok_or_else(|| Error::input(path, "not a whole PNG file: its chunks break off"))?;
    rows(&bytes).map_err(|e| Error::input(path, format!("the PNG file is damaged: {e}")))?;
    Ok(facts)
}

/// Reads all pixels, whose checksums hold then, row by row: a picture may be large.
fn rows(bytes: &[u8]) -> std::result::Result<(), png::DecodingError> {
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info()?;
    while reader.next_row()?.is_some() {}
    reader.finish()
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
        if let Some((own, text)) = meaning(name, content).filter(|(own, _)| *own > rank) {
            (rank, facts.colours) = (own, text);
        }
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
            b"tEXt" => {
                // Without the zero between them all is keyword: a fault beside the picture keeps nobody from reading that.
                let end = content.iter().position(|b| *b == 0).unwrap_or(content.len());
                facts.texts.push((latin1(&content[..end]), latin1(content.get(end + 1..).unwrap_or_default())));
            }
            b"IEND" => {
                if rank == 0 {
                    facts.colours = format!("not said, so {SRGB}");
                }
                return Some(facts);
            }
            _ => {}
        }
    }
}

/// What a chunk says of the numbers of the file, and its rank among those that do.
fn meaning(name: &[u8], content: &[u8]) -> Option<(i32, String)> {
    Some(match name {
        b"cICP" => (
            5,
            match content {
                [12, 13, 0, 1] => "Display P3 (cICP)".into(),
                [1, 13, 0, 1] => format!("{SRGB} (cICP)"),
                [9, 16, 0, 1] => "Rec. 2100 PQ (cICP)".into(),
                [9, 18, 0, 1] => "Rec. 2100 HLG (cICP)".into(),
                other => format!("code points {other:?} of H.273 (cICP)"),
            },
        ),
        b"iCCP" => {
            let end = content.iter().position(|b| *b == 0)?;
            (ICC, format!("{} (ICC profile)", latin1(&content[..end])))
        }
        b"sRGB" => (3, SRGB.into()),
        b"cHRM" => (2, other_primaries(content)?),
        b"gAMA" => {
            let gamma = u32::from_be_bytes(content.try_into().ok()?);
            // What writers state beside sRGB, for readers that know nothing better.
            let like = if gamma == 45_455 { ", as of sRGB" } else { "" };
            (1, format!("gamma {}{like}", 1e5 / f64::from(gamma.max(1))))
        }
        _ => return None,
    })
}

/// The primaries that a chunk cHRM states, where they are not those of sRGB to its digits: x and y of white, red, green and blue,
/// times 10⁵.
fn other_primaries(content: &[u8]) -> Option<String> {
    const OF_SRGB: [u32; 8] = [31_270, 32_900, 64_000, 33_000, 30_000, 60_000, 15_000, 6_000];
    let words: Vec<u32> = content.as_chunks().0.iter().map(|word| u32::from_be_bytes(*word)).collect();
    let [white, red, green, blue] = words.as_chunks::<2>().0.try_into().ok()?;
    let place = |[x, y]: [u32; 2]| format!("{} {}", f64::from(x) / 1e5, f64::from(y) / 1e5);
    let other = words.iter().zip(OF_SRGB).any(|(a, b)| a.abs_diff(b) > 100);
    let [white, red, green, blue] = [white, red, green, blue].map(place);
    other.then(|| format!("of the primaries {red}, {green}, {blue} and the white {white} (cHRM)"))
}

/// The rank of a profile.
const ICC: i32 = 4;

/// The colours that pictures have that do not say which.
const SRGB: &str = "sRGB";

/// What the PNG file at `path` says of its colours, where that is not sRGB; nothing of other files.
#[must_use]
pub fn other_colours(path: &Path) -> Option<String> {
    let mut file = BufReader::new(crate::input::open(path).ok()?);
    let mut signature = [0; 8];
    file.read_exact(&mut signature).ok().filter(|()| signature == *b"\x89PNG\r\n\x1a\n")?;
    let mut best: Option<(i32, String)> = None;
    loop {
        let (mut length, mut name) = ([0; 4], [0; 4]);
        file.read_exact(&mut length).and_then(|()| file.read_exact(&mut name)).ok()?;
        // All that is said of them stands before them.
        if name == *b"IDAT" {
            break;
        }
        let mut content = Vec::new();
        let length = u64::from(u32::from_be_bytes(length));
        (&mut file).take(length).read_to_end(&mut content).ok().filter(|read| *read as u64 == length)?;
        file.read_exact(&mut [0; 4]).ok()?;
        let own = meaning(&name, &content);
        best = own.into_iter().chain(best).max_by_key(|(rank, _)| *rank);
    }
    let text = match best? {
        // What writers call the chunk says little.
        (ICC, chunk) => icc::colours(path).unwrap_or(chunk),
        (_, text) => text,
    };
    Some(text).filter(|text| !are_srgb(text))
}

/// Whether colours of which a file says `said` are what pictures have that say nothing. Linear ones with its primaries are not.
#[must_use]
pub fn are_srgb(said: &str) -> bool {
    said.contains(SRGB) && !said.to_ascii_lowercase().contains(icc::LINEAR)
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

    /// The picture is whole, whatever is wrong with a text beside it.
    #[test]
    fn a_text_without_its_zero_is_a_keyword_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let bytes = encode_png(&grey(0.3, 5), &PngSettings::default()).unwrap();
        let texts = [tags::chunk(b"tEXt", b"marked"), tags::text("Author", "us")].concat();
        std::fs::write(&path, [&bytes[..33], &texts, &bytes[33..]].concat()).unwrap();
        let found = inspect(&path).unwrap().texts;
        assert_eq!(found, [("marked", ""), ("Author", "us")].map(|(k, t)| (k.to_owned(), t.to_owned())));
    }

    /// The chunk that counts most is heard, and only where it says something else than what is taken for granted.
    #[test]
    fn colours_that_are_not_srgb_are_told() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let plain = {
            let mut bytes = Vec::new();
            let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
            image::ImageEncoder::write_image(encoder, &[9; 3], 1, 1, image::ExtendedColorType::Rgb8).unwrap();
            bytes
        };
        // Behind the signature and the head, 25 bytes with length, name and checksum.
        let with = |chunks: &[(&[u8; 4], &[u8])]| {
            let chunk = |(name, content): &(&[u8; 4], &[u8])| {
                let length = u32::try_from(content.len()).unwrap().to_be_bytes();
                [&length[..], &name[..], content, &tags::crc(*name, content).to_be_bytes()].concat()
            };
            let chunks: Vec<u8> = chunks.iter().flat_map(chunk).collect();
            std::fs::write(&path, [&plain[..33], &chunks, &plain[33..]].concat()).unwrap();
            assert!(inspect(&path).is_ok());
            other_colours(&path)
        };
        let gamma = |gamma: u32| gamma.to_be_bytes();
        let (linear, usual) = (gamma(100_000), gamma(45_455));
        assert_eq!(with(&[]), None);
        assert_eq!(with(&[(b"gAMA", &linear)]).unwrap(), "gamma 1");
        assert_eq!(with(&[(b"gAMA", &usual)]), None);
        assert_eq!(with(&[(b"sRGB", &[0]), (b"gAMA", &linear)]), None);
        assert_eq!(with(&[(b"cICP", &[12, 13, 0, 1]), (b"sRGB", &[0])]).unwrap(), "Display P3 (cICP)");
        assert_eq!(with(&[(b"iCCP", b"Adobe RGB (1998)\0\0")]).unwrap(), "Adobe RGB (1998) (ICC profile)");
        assert_eq!(with(&[(b"iCCP", b"GIMP built-in sRGB\0\0")]), None);
        let primaries = |numbers: [u32; 8]| numbers.map(u32::to_be_bytes).concat();
        let srgb = primaries([31_270, 32_900, 64_000, 33_000, 30_000, 60_000, 15_000, 6_000]);
        let adobe = primaries([31_270, 32_900, 64_000, 33_000, 21_000, 71_000, 15_000, 6_000]);
        assert_eq!(with(&[(b"gAMA", &usual), (b"cHRM", &srgb)]), None);
        let told = "of the primaries 0.64 0.33, 0.21 0.71, 0.15 0.06 and the white 0.3127 0.329 (cHRM)";
        assert_eq!(with(&[(b"gAMA", &usual), (b"cHRM", &adobe)]).unwrap(), told);
        assert_eq!(with(&[(b"cHRM", &adobe[..20])]), None);
        std::fs::write(&path, &plain[..40]).unwrap();
        assert_eq!(other_colours(&path), None);
        assert_eq!(other_colours(&dir.path().join("none.png")), None);
    }
}
