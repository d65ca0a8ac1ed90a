//! JPEG files that are cut off: the decoder makes grey of what is missing.

/// Whether a JPEG file has the marker of its end behind a scan, ITU-T T.81 annex B, and enough in between for the size that it
/// states: each block of 8 × 8 numbers has a code of one bit or more in its first scan (sections F.1.2 and G.1.2), and there are a
/// quarter as many blocks as the picture has at least, however coarse its components are.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    const END: u8 = 0xd9;
    const SCAN: u8 = 0xda;
    let mut at = 2;
    let mut scan = None;
    let mut blocks = 0_usize;
    let word = |at: usize| Some(usize::from(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?])));
    while let Some(found) = bytes.get(at..).and_then(|rest| rest.windows(2).position(|m| m[0] == 0xff && m[1] != 0xff))
    {
        let marker = bytes[at + found + 1];
        at += found + 2;
        match marker {
            END => return scan.is_some_and(|start| 8 * (at - 2).saturating_sub(start) >= blocks.div_ceil(4)),
            // A byte 0xff of the scan itself, the beginnings of its intervals, and markers that stand alone.
            0x00 | 0x01 | 0xd0..=0xd8 => {}
            _ => {
                // A frame; between those of its kinds are tables.
                if let (0xc0..=0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf, Some(height), Some(width)) =
                    (marker, word(at + 3), word(at + 5))
                {
                    blocks = width.div_ceil(8) * height.div_ceil(8);
                }
                let Some(length) = word(at) else { return false };
                at += length;
                if marker == SCAN {
                    scan.get_or_insert(at);
                }
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::super::open;

    /// Cut off anywhere, also within its header or just before the marker of its end; what follows that does no harm.
    #[test]
    fn a_jpeg_that_is_cut_off_is_damaged() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.jpg");
        let image = image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([x as u8, 5 * y as u8, (x * y) as u8]));
        image.save(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in [300, whole.len() / 2, whole.len() - 2] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = open(&path).unwrap_err();
            assert_eq!(error.exit_code(), 3);
            assert!(error.to_string().contains("cut off: it is damaged"), "{length}: {error}");
        }
        std::fs::write(&path, [whole.as_slice(), &[0xff, 1, 2]].concat()).unwrap();
        open(&path).unwrap();
        // The same scan for 20000 × 20000 pixels, and an empty one for the 48 blocks that there are.
        let at = |marker: u8| whole.windows(2).position(|m| m == [0xff, marker]).unwrap();
        let size = at(0xc0) + 5;
        let large = [&whole[..size], &20_000_u16.to_be_bytes().repeat(2), &whole[size + 4..]].concat();
        let scan = at(0xda) + 2;
        let empty = [&whole[..scan + usize::from(whole[scan + 1])], &[0xff, 0xd9]].concat();
        for bytes in [large, empty] {
            std::fs::write(&path, bytes).unwrap();
            let error = open(&path).unwrap_err().to_string();
            assert!(error.contains("cut off: it is damaged"), "{error}");
        }
    }
}
