//! The rooms of the project keep their order: the picture at the head of `src/lib.rs` is read, and
//! every `crate::` path under `src/` is held against it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Level of each room, from the picture in `src/lib.rs`: 0 is the bottom line.
fn levels() -> BTreeMap<String, usize> {
    let page = fs::read_to_string("src/lib.rs").unwrap();
    let picture = page.lines().skip_while(|line| *line != "//! ```text").skip(1).take_while(|line| *line != "//! ```");
    let mut lines: Vec<Vec<String>> = Vec::new();
    for line in picture {
        // Rooms stand before the words that explain them, each with a slash or an ending.
        let rooms = line.trim_start_matches("//!").split_whitespace();
        let rooms = rooms.map_while(|word| word.strip_suffix('/').or(word.strip_suffix(".rs")).map(str::to_owned));
        lines.push(rooms.collect());
    }
    lines.reverse();
    lines.into_iter().enumerate().flat_map(|(level, rooms)| rooms.into_iter().map(move |room| (room, level))).collect()
}

fn sources(under: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(under).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            all.push(path);
        }
    }
    all.sort();
    all
}

/// The room of a file under `src/`: its directory there, or its own name.
fn room(file: &Path) -> String {
    let inside = file.strip_prefix("src").unwrap();
    let first = inside.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
    first.trim_end_matches(".rs").to_owned()
}

/// Code without comments. Strings stay: none of the project's holds `//` before a path.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// The rooms that `code` names: what follows `crate::` or `abbe::`, alone or in braces.
fn named(code: &str) -> Vec<String> {
    let mut all = Vec::new();
    for start in ["crate::", "abbe::"] {
        for (at, _) in code.match_indices(start) {
            let rest = &code[at + start.len()..];
            let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
            match rest.strip_prefix('{') {
                None => all.push(word(rest)),
                Some(group) => {
                    // Names at depth one of the braces.
                    let (mut depth, mut fresh) = (1, true);
                    for (i, c) in group.char_indices() {
                        match c {
                            '{' => depth += 1,
                            '}' => depth -= 1,
                            ',' => fresh = true,
                            c if depth == 1 && fresh && !c.is_whitespace() => {
                                all.push(word(&group[i..]));
                                fresh = false;
                            }
                            _ => {}
                        }
                        if depth == 0 {
                            break;
                        }
                    }
                }
            }
        }
    }
    all.retain(|name| !name.is_empty());
    all
}

#[test]
fn the_picture_in_lib_rs_shows_the_rooms_in_their_order() {
    let levels = levels();
    let below = [
        ("math", "spectrum"),
        ("error", "spectrum"),
        ("spectrum", "optics"),
        ("spectrum", "film"),
        ("spectrum", "description"),
        ("optics", "scene"),
        ("film", "scene"),
        ("description", "scene"),
        ("scene", "transport"),
        ("transport", "batch"),
        ("batch", "cli"),
    ];
    for (low, high) in below {
        assert!(levels[low] < levels[high], "{low} is below {high}");
    }
    assert_eq!(levels["main"], levels["cli"], "the process edge");
    assert!(levels["optics"] == levels["film"] && levels["film"] == levels["description"]);
}

#[test]
fn architecture_shows_the_same_picture() {
    let page = fs::read_to_string("ARCHITECTURE.md").unwrap();
    let theirs: Vec<&str> =
        page.lines().skip_while(|line| *line != "```").skip(1).take_while(|l| *l != "```").collect();
    let page = fs::read_to_string("src/lib.rs").unwrap();
    let ours = page.lines().skip_while(|line| *line != "//! ```text").skip(1).take_while(|line| *line != "//! ```");
    let ours: Vec<&str> = ours.map(|line| line.strip_prefix("//! ").unwrap_or("")).collect();
    assert!(!ours.is_empty());
    assert_eq!(theirs, ours);
}

#[test]
fn every_file_is_in_a_room_of_the_picture_and_every_room_has_files() {
    let levels = levels();
    let files = sources(Path::new("src"));
    for file in &files {
        let room = room(file);
        assert!(room == "lib" || levels.contains_key(&room), "{}: the picture lacks {room}", file.display());
    }
    for name in levels.keys() {
        assert!(files.iter().any(|f| &room(f) == name), "the picture shows {name}, src/ has no such room");
    }
}

/// `main.rs` shares its line with `cli/` and is the one that may enter it: it is the door.
#[test]
fn a_room_uses_only_rooms_below_its_own() {
    let levels = levels();
    let mut broken = Vec::new();
    let mut seen = 0;
    for file in sources(Path::new("src")) {
        let from = room(&file);
        if from == "lib" {
            continue;
        }
        for to in named(&code(&fs::read_to_string(&file).unwrap())) {
            seen += 1;
            let allowed = to == from
                || (from == "main" && to == "cli")
                || levels.get(&to).is_some_and(|level| *level < levels[&from]);
            if !allowed {
                broken.push(format!("{}: {from} uses {to}", file.display()));
            }
        }
    }
    assert!(seen > 100, "found only {seen} paths: the reader of sources is broken");
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// A package from outside enters through one file, so that changing it changes one file.
#[test]
fn packages_are_named_only_where_they_enter() {
    let doors: [(&str, &[&str]); 7] = [
        ("signal_hook", &["src/cli/interrupts.rs", "src/memory.rs"]),
        ("serde_yaml", &["src/description/yaml.rs"]),
        ("granit_parser", &["src/description/yaml.rs"]),
        ("indicatif", &["src/cli/progress.rs"]),
        ("clap", &["src/cli/"]),
        ("quick_xml", &["src/description/mitsuba/xml.rs"]),
        (
            "flate2",
            &["src/scene/mesh/serialized.rs", "src/film/exr/pack.rs", "src/film/exr/part.rs", "src/film/png/tags.rs"],
        ),
    ];
    for file in sources(Path::new("src")) {
        let text = code(&fs::read_to_string(&file).unwrap());
        for (package, allowed) in doors {
            let uses = text.contains(&format!("{package}::")) || text.contains(&format!("use {package};"));
            let here = file.to_string_lossy();
            assert!(!uses || allowed.iter().any(|door| here.starts_with(door)), "{here} names {package}");
        }
    }
}

#[test]
fn the_reader_of_sources_sees_groups_and_skips_comments() {
    let text = "use crate::{math::{Ray, warp}, film}; // crate::cli\nlet x = crate::scene::Hit { t };";
    assert_eq!(named(&code(text)), ["math", "film", "scene"]);
}
