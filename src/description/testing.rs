//! Scenes for tests, and the blocks of the page of `mod.rs`.

use std::path::Path;

use super::SceneDescription;

/// The smallest scene: one line.
pub(crate) const CAMERA: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n";

/// Reads `text` as `dir/s.yaml`.
pub(crate) fn parse(text: &str) -> crate::error::Result<SceneDescription> {
    SceneDescription::parse(text, Path::new("dir/s.yaml"))
}

/// The scene of [`CAMERA`] and, from line 2, `text`.
pub(crate) fn scene(text: &str) -> SceneDescription {
    parse(&format!("{CAMERA}{text}")).unwrap_or_else(|error| panic!("{error}"))
}

/// The faults of [`CAMERA`] and, from line 2, `text`.
pub(crate) fn faults(text: &str) -> String {
    match parse(&format!("{CAMERA}{text}")) {
        Ok(_) => "none".to_owned(),
        Err(error) => error.to_string(),
    }
}

/// The blocks of YAML in the page of `mod.rs`, by their first comment.
pub(crate) fn reference(title: &str) -> String {
    let page = include_str!("mod.rs").lines().filter_map(|line| line.strip_prefix("//!"));
    let start = format!(" # {title}");
    let block = page.skip_while(|line| *line != start).take_while(|line| line.trim() != "```");
    block.map(|line| line.strip_prefix(' ').unwrap_or(line)).collect::<Vec<_>>().join("\n")
}
