//! Names of files: of scenes, of their frames, and patterns that people write for both.

use super::Overrides;
use std::path::{Path, PathBuf};

/// What a part of the work may add to the name of its report, in bytes: file systems take names of 255.
const LONGEST: usize = 150;

/// What a picture is called, without ending: `prism`, or `prism.0012` for a frame.
#[must_use]
pub fn label(scene: &str, frame: Option<i32>) -> String {
    match frame {
        None => scene.to_owned(),
        Some(frame) => format!("{scene}.{frame:04}"),
    }
}

/// The name of a file about the work that is asked for: `report.json` about all of it; about scenes, frames, rows or samples
/// of it a name that says which, so that tasks that share a directory keep a report each.
#[must_use]
pub fn about(work: &Overrides, stem: &str, ending: &str) -> String {
    let frames = work.set.iter().rfind(|(key, _)| key == "render.frames").map_or("", |(_, frames)| frames);
    // The step of `1-9:2` is no part of a file's name everywhere; `1-9x2` says the same.
    let frames: String =
        frames.replace(':', "x").chars().filter(|c| c.is_ascii_alphanumeric() || "-,".contains(*c)).collect();
    let mut which = String::new();
    for piece in [work.scenes.join("+"), frames].iter().filter(|piece| !piece.is_empty()) {
        which = which + "." + piece;
    }
    which += &work.portion.suffix();
    if which.len() > LONGEST {
        let hash = &blake3::hash(which.as_bytes()).to_hex()[..16];
        let end = which.floor_char_boundary(LONGEST - 1 - hash.len());
        which = format!("{}~{hash}", &which[..end]);
    }
    format!("{stem}{which}.{ending}")
}

/// A piece of a pattern.
enum Piece {
    Text,
    Scene,
    /// The frame, in so many digits at least.
    Frame(usize),
}

/// The first piece of `text`, which is not empty, and the rest.
fn piece(text: &str) -> (Piece, &str) {
    if let Some(rest) = text.strip_prefix("{scene}") {
        return (Piece::Scene, rest);
    }
    let digits = |text: &str, end: char| -> Option<(usize, usize)> {
        let at = text.find(end)?;
        let width = &text[..at];
        let fits = width.len() <= 2 && width.chars().all(|c| c.is_ascii_digit());
        fits.then(|| (width.parse().unwrap_or(1), at + 1))
    };
    let hashes = text.len() - text.trim_start_matches('#').len();
    if hashes > 0 {
        return (Piece::Frame(hashes), &text[hashes..]);
    }
    if let Some(rest) = text.strip_prefix("{frame}") {
        return (Piece::Frame(1), rest);
    }
    for (start, end) in [("{frame:", '}'), ("%", 'd')] {
        if let Some((width, used)) = text.strip_prefix(start).and_then(|rest| digits(rest, end)) {
            return (Piece::Frame(width), &text[start.len() + used..]);
        }
    }
    let next = text.char_indices().skip(1).find(|(_, c)| "{#%".contains(*c)).map_or(text.len(), |(at, _)| at);
    (Piece::Text, &text[next..])
}

/// The path that `pattern` means for a scene and its frame: `{scene}`; and `{frame}`, `{frame:04}`, `%04d`, `####`, which
/// stay as they are where there is no frame.
#[must_use]
pub fn fill(pattern: &Path, scene: &str, frame: Option<i32>) -> PathBuf {
    let Some(mut rest) = pattern.to_str() else { return pattern.to_path_buf() };
    let mut out = String::new();
    while !rest.is_empty() {
        let (piece, after) = piece(rest);
        match (piece, frame) {
            (Piece::Scene, _) => out.push_str(scene),
            (Piece::Frame(width), Some(frame)) => out.push_str(&format!("{frame:0width$}")),
            (Piece::Text | Piece::Frame(_), _) => out.push_str(&rest[..rest.len() - after.len()]),
        }
        rest = after;
    }
    out.into()
}

/// Whether two scenes, or two frames, have two paths.
#[must_use]
pub fn tells(pattern: &Path) -> Tells {
    let mut tells = Tells::default();
    let mut rest = pattern.to_str().unwrap_or_default();
    while !rest.is_empty() {
        let (piece, after) = piece(rest);
        tells.scenes |= matches!(piece, Piece::Scene);
        tells.frames |= matches!(piece, Piece::Frame(_));
        rest = after;
    }
    tells
}

/// The first piece of `text` that is more than text in a pattern: what stands for the scene, or for a frame of one that has
/// `frames`, or a word in braces that stands for nothing.
#[must_use]
pub fn mark(text: &str, frames: bool) -> Option<&str> {
    let mut rest = text;
    while !rest.is_empty() {
        let (piece, after) = piece(rest);
        match piece {
            Piece::Frame(_) if !frames => {}
            Piece::Text => {}
            Piece::Scene | Piece::Frame(_) => return Some(&rest[..rest.len() - after.len()]),
        }
        rest = after;
    }
    unknown(Path::new(text))
}

/// A word in braces that stands for nothing, where `pattern` has one. Braces around anything else are part of a name.
fn unknown(pattern: &Path) -> Option<&str> {
    let mut rest = pattern.to_str().unwrap_or_default();
    while !rest.is_empty() {
        let (piece, after) = piece(rest);
        let word = rest.strip_prefix('{').and_then(|text| text.split_once('}')).map(|(word, _)| word);
        let word = word.filter(|word| word.chars().all(|c| c.is_alphanumeric() || "_:".contains(c)));
        if let (Piece::Text, Some(word)) = (piece, word) {
            return Some(&rest[..word.len() + 2]);
        }
        rest = after;
    }
    None
}

/// Refuses a pattern with a word in braces that stands for nothing.
///
/// # Errors
/// In words, with those there are.
pub fn check(pattern: &Path) -> Result<(), String> {
    match unknown(pattern) {
        Some(word) => {
            Err(format!("expected {{scene}}, {{frame}}, {{frame:04}}, %04d or #### in a pattern, found {word}"))
        }
        None => Ok(()),
    }
}

/// What a pattern tells apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tells {
    /// Scenes.
    pub scenes: bool,
    /// Frames.
    pub frames: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_filled_with_scene_and_frame() {
        let filled = |pattern: &str, frame| fill(Path::new(pattern), "a#b", frame).to_string_lossy().into_owned();
        assert_eq!(filled("out/{scene}.{frame:04}.exr", Some(12)), "out/a#b.0012.exr");
        assert_eq!(filled("{scene}/x.####.exr", Some(12)), "a#b/x.0012.exr");
        assert_eq!(filled("x_%04d.exr", Some(12345)), "x_12345.exr");
        assert_eq!(filled("x_%d-#-{frame}.exr", Some(7)), "x_7-7-7.exr");
        assert_eq!(filled("é{frame:3}%.exr", Some(-7)), "é-07%.exr");
        // What is no pattern stays; of such words `unknown` tells.
        assert_eq!(filled("{aov}{frame:x}%s.exr", Some(7)), "{aov}{frame:x}%s.exr");
        assert_eq!(filled("C#/x.####.exr", None), "C#/x.####.exr");
        assert_eq!(filled("{scene}.exr", None), "a#b.exr");
    }

    #[test]
    fn a_pattern_tells_frames_or_scenes_apart() {
        let tells = |pattern: &str| tells(Path::new(pattern));
        assert_eq!(tells("x/{scene}.exr"), Tells { scenes: true, frames: false });
        assert_eq!(tells("x/%03d.exr"), Tells { scenes: false, frames: true });
        assert_eq!(tells("x/{scen}.{frme}.exr"), Tells::default());
    }

    #[test]
    fn words_in_braces_that_stand_for_nothing_are_found() {
        let found = |pattern: &str| unknown(Path::new(pattern)).map(str::to_owned);
        for pattern in ["{foo}", "{}", "{Scene}", "{frame:x}", "{frame:004}", "{scene:3}"] {
            assert_eq!(found(&format!("é/%04d{{scene}}{pattern}.exr")).as_deref(), Some(pattern));
        }
        for name in ["{scene}.{frame}.exr", "{frame:04}", "####/%d%s", "{B1F0-22}/a", "a{/b}", "{x", "}{"] {
            assert_eq!(found(name), None, "{name}");
        }
    }

    #[test]
    fn what_is_no_mere_text_in_a_pattern_is_found() {
        for (text, with, without) in [
            ("é#1", Some("#"), None),
            ("a##", Some("##"), None),
            ("shot_%d", Some("%d"), None),
            ("{frame:04}", Some("{frame:04}"), None),
            ("x{scene}", Some("{scene}"), Some("{scene}")),
            ("#{x}", Some("#"), Some("{x}")),
            ("50%", None, None),
            ("{a b}", None, None),
        ] {
            assert_eq!((mark(text, true), mark(text, false)), (with, without), "{text}");
        }
    }

    #[test]
    fn a_report_is_named_after_its_part_of_the_work() {
        use crate::batch::{Portion, Samples};
        let name = |scenes: &[&str], frames: Option<&str>, portion: Portion| {
            let set = frames.map(|frames| ("render.frames".to_owned(), format!("\"{frames}\"")));
            let scenes = scenes.iter().map(|s| (*s).to_owned()).collect();
            let work = Overrides { scenes, set: set.into_iter().collect(), portion, ..Overrides::default() };
            about(&work, "report", "json")
        };
        let part = || Portion { tile: Some([0, 4]), samples: Some(Samples::Range([8, 15])) };
        assert_eq!(name(&[], None, Portion::default()), "report.json");
        assert_eq!(name(&[], Some("1-9:2, 12"), Portion::default()), "report.1-9x2,12.json");
        assert_eq!(name(&["a", "b c"], None, Portion::default()), "report.a+b c.json");
        assert_eq!(name(&["a"], Some("-5--1"), part()), "report.a.-5--1.tile0of4.samples8-15.json");
        // Long ones are cut, and still differ.
        let long = |last: &str| name(&["é".repeat(90).as_str(), last], None, part());
        assert!(long("x").len() <= 255 && long("x").starts_with("report.ééé") && long("x") != long("y"));
    }

    #[test]
    fn frames_sort_by_name() {
        assert_eq!(label("a", None), "a");
        assert_eq!(label("a", Some(12)), "a.0012");
        assert_eq!(label("a", Some(-3)), "a.-003");
    }
}
