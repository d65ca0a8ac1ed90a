//! JPEG files that the decoder would make another picture of: cut off, which it fills with grey, and kinds that it cannot read.

/// What the frame of a JPEG file says (ITU-T T.81, B.2.2).
struct Frame {
    /// SOF0 to SOF15.
    kind: u8,
    /// Blocks of 8 × 8 that cover the picture.
    blocks: usize,
    /// How many samples across each of its components has, over the others.
    across: Vec<u8>,
}

/// Why a JPEG file is not read, in words, where that is so: it has no marker of its end behind a scan, ITU-T T.81 annex B, or less in
/// between than the size that it states takes: each block of 8 × 8 numbers has a code of one bit or more in its first scan (sections F.1.2
/// and G.1.2), and there are a quarter as many blocks as the picture has at least, however coarse its components are. Or it is of a kind
/// that the decoder does not know, or reads otherwise than its writer meant.
pub(super) fn fault(bytes: &[u8]) -> Option<&'static str> {
    const SCAN: u8 = 0xda;
    const CUT_OFF: &str = "expected a JPEG picture to its end, found one cut off: it is damaged";
    let mut scan = None;
    let mut frame = None;
    for (marker, at) in segments(bytes) {
        match marker {
            END => {
                let blocks = frame.map_or(0, |frame: Frame| frame.blocks);
                let whole = scan.is_some_and(|start| 8 * (at - 2).saturating_sub(start) >= blocks.div_ceil(4));
                return (!whole).then_some(CUT_OFF);
            }
            SCAN => {
                if let (None, Some(frame)) = (scan, &frame)
                    && let Some(fault) = fault_of(frame, bytes.get(at + 2).copied())
                {
                    return Some(fault);
                }
                scan = scan.or_else(|| Some(at + word(bytes, at)?));
            }
            _ => frame = Frame::of(bytes, marker, at).or(frame),
        }
    }
    Some(CUT_OFF)
}

/// How many colours the frame of a JPEG has.
pub(super) fn components(bytes: &[u8]) -> Option<u8> {
    let (_, at) = segments(bytes).find(|(marker, _)| is_frame(*marker))?;
    bytes.get(at + 7).copied()
}

/// The marker of the end.
const END: u8 = 0xd9;

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    Some(usize::from(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?])))
}

/// The markers of a file that have a segment, and that of its end, each with where its segment begins: by its length.
fn segments(bytes: &[u8]) -> impl Iterator<Item = (u8, usize)> {
    let mut at = 2;
    std::iter::from_fn(move || {
        loop {
            at += bytes.get(at..)?.windows(2).position(|m| m[0] == 0xff && m[1] != 0xff)? + 2;
            let (marker, start) = (bytes[at - 1], at);
            match marker {
                // A byte 0xff of the scan itself, the beginnings of its intervals, and markers that stand alone.
                0x00 | 0x01 | 0xd0..=0xd8 => continue,
                END => at = bytes.len(),
                _ => at += word(bytes, at)?,
            }
            return Some((marker, start));
        }
    })
}

/// Whether a marker begins a frame; between those of all kinds are tables.
fn is_frame(marker: u8) -> bool {
    matches!(marker, 0xc0..=0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf)
}

impl Frame {
    /// The one that begins at `at` behind `marker`, if it is one.
    fn of(bytes: &[u8], marker: u8, at: usize) -> Option<Frame> {
        let [height, width] = [word(bytes, at + 3)?, word(bytes, at + 5)?];
        let components = bytes.get(at + 8..).unwrap_or_default().as_chunks::<3>().0.iter();
        let across = components.take(bytes.get(at + 7).map_or(0, |count| usize::from(*count)));
        is_frame(marker).then(|| Frame {
            kind: marker - 0xc0,
            blocks: width.div_ceil(8) * height.div_ceil(8),
            across: across.map(|component| component[1] >> 4).collect(),
        })
    }
}

/// What the decoder does not know, of a frame whose first scan has so many components.
fn fault_of(frame: &Frame, scanned: Option<u8>) -> Option<&'static str> {
    let interleaved = scanned.is_none_or(|scanned| usize::from(scanned) == frame.across.len());
    let finest = frame.across.iter().max();
    match frame.kind {
        3 | 7 | 11 | 15 => Some("expected a JPEG picture of baseline or progressive coding, found lossless coding"),
        5 | 6 | 13 | 14 => Some("expected a JPEG picture of baseline or progressive coding, found hierarchical coding"),
        9 | 10 => Some("expected a JPEG picture in Huffman's code, found arithmetic coding"),
        // Of sequential ones alone: progressive ones have scans of one component each.
        0 | 1 if !interleaved => {
            Some("expected a JPEG picture whose first scan has all colours, found scans of one colour: save it anew")
        }
        _ if frame.across.first() < finest => {
            Some("expected a JPEG picture whose first component is its finest, found a coarser one: save it anew")
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::open;
    use super::fault;

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

    /// A frame of three components with its scan, as far as it is looked at: what `image` 0.25 reads, and what it made grey or rubbish of.
    #[test]
    fn kinds_that_are_not_read_are_refused_by_name() {
        let told = |kind: u8, across: [u8; 3], scanned: u8| {
            let frame = [0xff, 0xd8, 0xff, 0xc0 + kind, 0, 17, 8, 0, 8, 0, 8, 3];
            let components = [0, 1, 2].map(|k| [1 + k as u8, across[k] << 4 | 1, 0]);
            let scan = [0xff, 0xda, 0, 6 + 2 * scanned, scanned];
            let rest = vec![0; 3 + 2 * usize::from(scanned)];
            fault(&[&frame[..], components.as_flattened(), &scan, &rest, &[0; 8], &[0xff, 0xd9]].concat())
        };
        for (kind, across, scanned) in [(0, [2, 1, 1], 3), (1, [1; 3], 3), (2, [2, 1, 1], 1), (2, [1; 3], 3)] {
            assert_eq!(told(kind, across, scanned), None, "{kind} {across:?} {scanned}");
        }
        for (kind, across, scanned, word) in [
            (0, [2, 1, 1], 1, "scans of one colour"),
            (1, [1; 3], 2, "scans of one colour"),
            (0, [1, 2, 1], 3, "a coarser one"),
            (2, [1, 1, 2], 1, "a coarser one"),
            (3, [1; 3], 3, "lossless"),
            (5, [1; 3], 3, "hierarchical"),
            (9, [1; 3], 3, "arithmetic"),
        ] {
            assert!(told(kind, across, scanned).is_some_and(|told| told.contains(word)), "{kind} {across:?} {scanned}");
        }
    }
}
