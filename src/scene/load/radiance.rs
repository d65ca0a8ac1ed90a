//! What the heads of Radiance pictures say (Radiance's `filefmts`, "Pictures"): lines up to an empty one, then the size, then pixels.

/// Whether a file begins as one.
pub(super) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?")
}

/// The lines of the head, and what stands behind it: the line of the size and the pixels.
fn head(bytes: &[u8]) -> (Vec<&str>, &[u8]) {
    let mut lines = Vec::new();
    let mut rest = bytes;
    while let Some(end) = rest.iter().position(|byte| *byte == b'\n') {
        let line = rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end]);
        rest = &rest[end + 1..];
        if line.is_empty() {
            break;
        }
        lines.extend(std::str::from_utf8(line).ok());
    }
    (lines, rest)
}

/// What a head says of its light that is not minded: factors that its pixels have been multiplied by, a gamma, and primaries that
/// are neither those of Radiance, which pictures have that say nothing, nor those of Rec. 709.
pub(super) fn says(bytes: &[u8]) -> Option<String> {
    /// x and y of red, green, blue and white.
    const USUAL: [[f64; 8]; 2] =
        [[0.64, 0.33, 0.29, 0.6, 0.15, 0.06, 0.3333, 0.3333], [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329]];
    let is_said = |line: &&&str| {
        let Some((name, value)) = line.split_once('=') else { return false };
        let Ok(values) = value.split_ascii_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>() else {
            return false;
        };
        match name {
            "EXPOSURE" | "COLORCORR" | "GAMMA" => values.iter().any(|x| *x != 1.0),
            "PRIMARIES" => {
                let are = |usual: &[f64; 8]| {
                    // To the digits that are written.
                    values.len() == 8 && values.iter().zip(usual).all(|(a, b)| (a - b).abs() < 0.001)
                };
                !USUAL.iter().any(are)
            }
            _ => false,
        }
    };
    let (lines, _) = head(bytes);
    let said: Vec<&str> = lines.iter().filter(is_said).copied().collect();
    (!said.is_empty()).then(|| said.join(", "))
}

/// Whether Mitsuba 3.9.1 reads it: it wants the line of the format, and does not know the runs that came before those of whole rows.
pub(super) fn is_plain(bytes: &[u8]) -> bool {
    let (lines, rest) = head(bytes);
    let Some(end) = rest.iter().position(|byte| *byte == b'\n') else { return true };
    let (size, pixels) = (String::from_utf8_lossy(&rest[..end]), &rest[end + 1..]);
    let sides: Vec<usize> = size.split_ascii_whitespace().filter_map(|word| word.parse().ok()).collect();
    let &[height, width] = sides.as_slice() else { return true };
    let whole_rows = pixels.starts_with(&[2, 2]) && pixels.get(2).is_some_and(|high| high >> 7 == 0);
    let has_format = lines.iter().any(|line| line.starts_with("FORMAT="));
    has_format && (whole_rows || pixels.len() >= height.saturating_mul(width).saturating_mul(4))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(lines: &str, pixels: &[u8]) -> Vec<u8> {
        [format!("#?RADIANCE\n{lines}\n-Y 1 +X 2\n").as_bytes(), pixels].concat()
    }

    #[test]
    fn what_is_said_of_light_is_told() {
        let told = |lines: &str| says(&picture(lines, &[0; 8]));
        let format = "FORMAT=32-bit_rle_rgbe\n";
        for usual in
            ["", "EXPOSURE=1\n", "GAMMA= 1.0\n", "PRIMARIES=.640 .330 .290 .600 .150 .060 .333 .333\n", "VIEW= -vp 4\n"]
        {
            assert_eq!(told(&format!("{format}{usual}")), None, "{usual}");
        }
        assert_eq!(told("EXPOSURE=4\r\nEXPOSURE= 0.5\r\n").unwrap(), "EXPOSURE=4, EXPOSURE= 0.5");
        assert_eq!(told("COLORCORR=1 2 4\nGAMMA=2.2\n").unwrap(), "COLORCORR=1 2 4, GAMMA=2.2");
        let p3 = "PRIMARIES=.68 .32 .265 .69 .15 .06 .3127 .329";
        assert_eq!(told(&format!("{p3}\n")).as_deref(), Some(p3));
        // What follows the head is no part of it.
        assert_eq!(says(&picture(format, b"EXPOSURE=4\n")), None);
    }

    #[test]
    fn old_runs_and_heads_without_a_format_are_not_plain() {
        let format = "FORMAT=32-bit_rle_rgbe\n";
        assert!(is_plain(&picture(format, &[9; 8])));
        assert!(is_plain(&picture(format, &[2, 2, 0, 2, 130, 7, 130, 7])));
        assert!(!is_plain(&picture("", &[9; 8])));
        // One pixel, and once more.
        assert!(!is_plain(&picture(format, &[9, 9, 9, 128, 1, 1, 1])));
    }
}
