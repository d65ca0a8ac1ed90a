//! Chunks that say what the numbers of a PNG file mean (PNG, third edition, section 11.3).

use super::Space;
use crate::spectrum::ColourSpace;
use crate::spectrum::colour::{d50_from_d65, multiply};
use std::io::Write;

/// The CRC-32 of a chunk's name and content.
pub(super) fn crc(name: &[u8], content: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(name);
    crc.update(content);
    crc.sum()
}

/// A chunk: length, name, content, and its CRC.
pub(super) fn chunk(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = (content.len() as u32).to_be_bytes().to_vec();
    bytes.extend(name);
    bytes.extend(content);
    bytes.extend(crc(name, content).to_be_bytes());
    bytes
}

/// The chunks of a display's colours, which stand before the pixels.
pub(super) fn colours(space: Space) -> Vec<u8> {
    match space {
        // Rendering intent: perceptual.
        Space::Srgb => chunk(b"sRGB", &[0]),
        Space::DisplayP3 => {
            // Code points of ITU-T H.273: primaries 12 (P3, D65), curve 13 (sRGB), no matrix, full range. For readers that do
            // not know it an ICC profile that says the same follows.
            let mut bytes = chunk(b"cICP", &[12, 13, 0, 1]);
            let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
            // Writing to memory does not fail.
            let packed = packed.write_all(&display_p3()).and_then(|()| packed.finish()).unwrap_or_default();
            // Name of the profile, method 0.
            bytes.extend(chunk(b"iCCP", &[b"Display P3\0\0", packed.as_slice()].concat()));
            bytes
        }
    }
}

/// Text of ASCII under a keyword.
pub(super) fn text(keyword: &str, text: &str) -> Vec<u8> {
    chunk(b"tEXt", &[keyword.as_bytes(), &[0], text.as_bytes()].concat())
}

/// An ICC profile of a display with the primaries of P3, the white D65 and the curve of sRGB: version 4 (ICC.1:2022), matrix
/// and curves, with the white adapted to D50 by Bradford, as `chad` says.
fn display_p3() -> Vec<u8> {
    let fixed = |v: f64| ((v * 65536.0).round() as i32).to_be_bytes();
    let typed = |kind: &[u8; 4], content: Vec<u8>| [kind.as_slice(), &[0; 4], &content].concat();
    let words = |text: &str| {
        let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let mut content = [1u32.to_be_bytes(), 12u32.to_be_bytes()].concat();
        content.extend(b"enUS");
        content.extend((utf16.len() as u32).to_be_bytes());
        content.extend(28u32.to_be_bytes());
        content.extend(utf16);
        typed(b"mluc", content)
    };
    let chad = d50_from_d65();
    let to_d50 = multiply(chad, ColourSpace::P3D65.matrix_to_xyz());
    let column = |c: usize| typed(b"XYZ ", to_d50.iter().flat_map(|row| fixed(row[c])).collect());
    // Y = (aX + b)^g from d on, cX below: IEC 61966-2-1.
    let curve = [2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.040_45];
    let curve = typed(b"para", [0, 3, 0, 0].into_iter().chain(curve.into_iter().flat_map(fixed)).collect());
    let white = [0.9642, 1.0, 0.8249];
    let tags: [(&[u8; 4], Vec<u8>); 10] = [
        (b"desc", words("Display P3")),
        (b"cprt", words("No copyright, use freely")),
        (b"wtpt", typed(b"XYZ ", white.into_iter().flat_map(fixed).collect())),
        (b"chad", typed(b"sf32", chad.iter().flatten().flat_map(|v| fixed(*v)).collect())),
        (b"rXYZ", column(0)),
        (b"gXYZ", column(1)),
        (b"bXYZ", column(2)),
        (b"rTRC", curve.clone()),
        (b"gTRC", curve.clone()),
        (b"bTRC", curve),
    ];
    let mut table = (tags.len() as u32).to_be_bytes().to_vec();
    let mut data = Vec::new();
    let start = 128 + 4 + 12 * tags.len();
    for (name, content) in &tags {
        table.extend(*name);
        table.extend(((start + data.len()) as u32).to_be_bytes());
        table.extend((content.len() as u32).to_be_bytes());
        data.extend(content);
        // Each begins at a multiple of four bytes.
        data.resize(data.len().next_multiple_of(4), 0);
    }
    let mut header = vec![0; 128];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &((start + data.len()) as u32).to_be_bytes());
    put(8, &[4, 0x40]);
    put(12, b"mntrRGB XYZ ");
    // A date has to stand here; the same in every file.
    for (i, part) in [2024u16, 1, 1, 0, 0, 0].into_iter().enumerate() {
        put(24 + 2 * i, &part.to_be_bytes());
    }
    put(36, b"acsp");
    for (i, v) in white.into_iter().enumerate() {
        put(68 + 4 * i, &fixed(v));
    }
    [header, table, data].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The published CRC of the sRGB chunk with intent 0, and the colorants that Apple's Display P3 profile states:
    /// red 0.51512, 0.24120, -0.00105 (to its 16 bits). All three make the white D50, and the curve is IEC 61966-2-1's on both sides
    /// of its joint: numbers of 2⁻¹⁷ at the most off, of which a value has a few.
    #[test]
    fn tags_are_those_of_the_standards() {
        assert_eq!(chunk(b"sRGB", &[0])[9..], [0xae, 0xce, 0x1c, 0xe9]);
        let profile = display_p3();
        assert_eq!(u32::from_be_bytes(profile[..4].try_into().unwrap()) as usize, profile.len());
        // The numbers of a tag, `skipped` bytes behind its kind.
        let numbers = |tag: &[u8; 4], kind: &[u8; 4], skipped: usize| {
            let entry = profile[132..].chunks(12).find(|entry| entry[..4] == tag[..]).unwrap();
            let [at, length] = [4, 8].map(|k| u32::from_be_bytes(entry[k..k + 4].try_into().unwrap()) as usize);
            assert_eq!(&profile[at..at + 4], kind);
            let of = |bytes: &[u8]| f64::from(i32::from_be_bytes(bytes.try_into().unwrap())) / 65536.0;
            profile[at + 8 + skipped..at + length].chunks(4).map(of).collect::<Vec<f64>>()
        };
        let [red, green, blue] = [b"rXYZ", b"gXYZ", b"bXYZ"].map(|tag| numbers(tag, b"XYZ ", 0));
        for (i, (expected, white)) in [(0.51512, 0.9642), (0.24120, 1.0), (-0.00105, 0.8249)].into_iter().enumerate() {
            assert!((red[i] - expected).abs() < 5e-5, "{i}: {}", red[i]);
            let sum = red[i] + green[i] + blue[i];
            assert!((sum - white).abs() < 5e-5, "{i}: {sum}");
        }
        for tag in [b"rTRC", b"gTRC", b"bTRC"] {
            let [g, a, b, c, d] = numbers(tag, b"para", 4).try_into().unwrap();
            for x in [0.01f64, 0.04, 0.05, 0.5, 1.0] {
                let expected = if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) };
                let found = if x >= d { (a * x + b).powf(g) } else { c * x };
                assert!((found - expected).abs() < 5e-5, "{x}: {found} for {expected}");
            }
        }
    }
}
