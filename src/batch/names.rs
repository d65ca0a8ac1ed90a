//! Names of files: of scenes, of their frames, and patterns that people write for both.

use std::path::{Path, PathBuf};

/// What a picture is called, without ending: `prism`, or `prism.0012` for a frame.
#[must_use]
pub fn label(scene: &str, frame: Option<i32>) -> String {
    match frame {
        None => scene.to_owned(),
        Some(frame) => format!("{scene}.{frame:04}"),
    }
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
        // What is no pattern stays.
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
    fn frames_sort_by_name() {
        assert_eq!(label("a", None), "a");
        assert_eq!(label("a", Some(12)), "a.0012");
        assert_eq!(label("a", Some(-3)), "a.-003");
    }
}
