//! Which frames of a scene are rendered: `1-100`, `1-100x5`, `1-10,20,30-40`.

use serde::Deserialize;

use super::node::quote;

/// The most frames of one scene.
const MOST: usize = 1_000_000;

/// `frames: 12` or `frames: 1-100x5`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Frames {
    /// One.
    Number(f64),
    /// As [`frames`] reads it.
    Text(String),
}

impl Frames {
    /// The frames, in order.
    ///
    /// # Errors
    /// What was expected and found, in words.
    pub fn list(&self) -> Result<Vec<i32>, String> {
        match self {
            Frames::Number(frame) => frames(&frame.to_string()),
            Frames::Text(text) => frames(text),
        }
    }
}

/// The frames of `1-100`, of `1-100x5` or `1-100:5` (1, 6, … 96), of `1-10,20,30-40`, in the order in which they are
/// written. A frame may be below 0: `-10--5`.
///
/// # Errors
/// What was expected and found, in words: other text, no frame at all, a frame that is there twice, more than a million.
pub fn frames(text: &str) -> Result<Vec<i32>, String> {
    let mut all = Vec::new();
    for piece in text.split(',') {
        let [first, last, step] = range(piece.trim()).ok_or_else(|| {
            let hint = if piece.contains(['y', 'Y']) { "; y, which leaves frames out, is not known" } else { "" };
            let expected = "expected frames, as 12, 1-100, 1-100x5, 1-100:5 or 1-10,20,30-40";
            format!("{expected}, found {}{hint}", quote(text))
        })?;
        if first > last || step < 1 {
            let expected = "expected ranges from a frame to a later one in steps of 1 or more";
            return Err(format!("{expected}, found {}", quote(piece.trim())));
        }
        if ((last - first) / step) as usize >= MOST - all.len() {
            return Err(format!("expected at most {MOST} frames, found {}", quote(text)));
        }
        // Between two of i32.
        all.extend((first..=last).step_by(step as usize).map(|frame| frame as i32));
    }
    let mut sorted = all.clone();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("expected each frame once, found {} twice in {}", pair[0], quote(text))),
        None => Ok(all),
    }
}

/// [`frames`], the other way: runs of even steps, `1-96:5,200`.
#[must_use]
pub fn frames_in_short(frames: &[i32]) -> String {
    let mut pieces = Vec::new();
    let mut rest = frames;
    while let [first, after @ ..] = rest {
        let gap = |a: i32, b: i32| i64::from(b) - i64::from(a);
        let step = after.first().map_or(0, |next| gap(*first, *next));
        let even = rest.windows(2).take_while(|pair| step > 0 && gap(pair[0], pair[1]) == step).count();
        // Two that are far apart are no run.
        let run = if even == 1 && step > 1 { 0 } else { even };
        let last = rest[run];
        pieces.push(match (run, step) {
            (0, _) => first.to_string(),
            (_, 1) => format!("{first}-{last}"),
            _ => format!("{first}-{last}:{step}"),
        });
        rest = &rest[run + 1..];
    }
    pieces.join(",")
}

/// First, last and step of `a`, `a-b`, `a-bxs` or `a-b:s`.
fn range(piece: &str) -> Option<[i64; 3]> {
    let (first, rest) = number(piece)?;
    if rest.is_empty() {
        return Some([first, first, 1]);
    }
    let (last, rest) = number(rest.strip_prefix('-')?)?;
    if rest.is_empty() {
        return Some([first, last, 1]);
    }
    let (step, rest) = number(rest.strip_prefix(['x', ':'])?)?;
    rest.is_empty().then_some([first, last, step])
}

/// A number of an i32 at the head of `text`, and the rest.
fn number(text: &str) -> Option<(i64, &str)> {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let end = text.len() - digits.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let number: i32 = text[..end].parse().ok()?;
    Some((number.into(), &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_written_as_farms_write_them() {
        assert_eq!(frames("12").unwrap(), [12]);
        assert_eq!(frames("1-5").unwrap(), [1, 2, 3, 4, 5]);
        // The last one is the last that a step reaches.
        assert_eq!(frames("1-100x25").unwrap(), [1, 26, 51, 76]);
        assert_eq!(frames("1-101:25").unwrap(), [1, 26, 51, 76, 101]);
        assert_eq!(frames("8-10, 20,3-4").unwrap(), [8, 9, 10, 20, 3, 4]);
        assert_eq!(frames("-3--1,0-2").unwrap(), [-3, -2, -1, 0, 1, 2]);
        assert_eq!(frames("7-7x3").unwrap(), [7]);
        assert_eq!(frames("1-1000000").unwrap().len(), MOST);
    }

    #[test]
    fn frames_are_written_in_short() {
        for text in ["12", "1-5", "1-96:5,200", "8-10,20,3,5", "-10--5,0", "1,100", "-2147483648,2147483647"] {
            assert_eq!(frames_in_short(&frames(text).unwrap()), text);
        }
        assert_eq!(frames_in_short(&frames("1-3,4,6-7").unwrap()), "1-4,6-7");
    }

    #[test]
    fn what_is_no_frames_is_refused_in_words() {
        let says = |text: &str| frames(text).unwrap_err();
        let expected = "expected frames, as 12, 1-100, 1-100x5, 1-100:5 or 1-10,20,30-40";
        for text in ["", "x", "1-", "1,", "1-5x", "1.5", "1-5s2", "1 - 5", "99999999999", "1--"] {
            assert_eq!(says(text), format!("{expected}, found {text:?}"));
        }
        assert_eq!(says("1-100y5"), format!("{expected}, found \"1-100y5\"; y, which leaves frames out, is not known"));
        let range = "expected ranges from a frame to a later one in steps of 1 or more";
        assert_eq!(says("1-3,10-1"), format!("{range}, found \"10-1\""));
        assert_eq!(says("1-10x0"), format!("{range}, found \"1-10x0\""));
        assert_eq!(says("1-10,5"), "expected each frame once, found 5 twice in \"1-10,5\"");
        for text in ["0-1000000", "1-600000,700001-1100001", "0,1-1000000", "1-1000000,0"] {
            assert_eq!(says(text), format!("expected at most 1000000 frames, found {text:?}"));
        }
        assert_eq!(Frames::Number(1.5).list().unwrap_err(), format!("{expected}, found \"1.5\""));
    }
}
