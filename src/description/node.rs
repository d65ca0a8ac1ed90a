//! The tree of a document: every value with the place where a person wrote it.
//!
//! Includes, batch entries and `--set` graft nodes of several sources into one tree; each node
//! keeps its own place, so a fault always points at the text that has to change.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::path::Segment;
use super::path_map::{self, PathMap};

/// Where a node was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    /// Index into [`Sources`].
    pub(crate) source: u32,
    /// Line, from 1; 0 when the source has no lines (the command line).
    pub(crate) line: u32,
    /// Column in characters, from 1.
    pub(crate) column: u32,
}

/// What the nodes of one tree were read from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sources {
    sources: Vec<Source>,
    /// What is no fault in them, and should be known.
    notes: Vec<(Place, String)>,
    /// Where files lie that are named in them.
    map: Arc<PathMap>,
}

#[derive(Clone, Debug)]
struct Source {
    label: String,
    directory: PathBuf,
    argument: bool,
}

impl Sources {
    /// None yet, whose files lie where `map` says.
    pub(crate) fn mapped(map: PathMap) -> Sources {
        Sources { map: Arc::new(map), ..Sources::default() }
    }

    /// Something at `place` that is no fault.
    pub(crate) fn note(&mut self, place: Place, message: String) {
        self.notes.push((place, message));
    }

    /// All of these, with their places.
    pub(crate) fn notes(&self) -> impl Iterator<Item = String> {
        self.notes.iter().map(|(place, message)| format!("{}: {message}", self.describe(*place)))
    }

    /// The file that `written`, at `place`, means.
    pub(crate) fn file(&self, place: Place, written: &str) -> PathBuf {
        path_map::place(&self.map, self.directory(place), written)
    }

    /// Adds a file; relative paths written in it start from its directory.
    pub(crate) fn add_file(&mut self, path: &Path) -> u32 {
        self.add(path.display().to_string(), path.parent().unwrap_or(Path::new("")).to_path_buf(), false)
    }

    /// Adds a file whose reader has found the files that it names already: relative paths in its
    /// nodes start from the working directory.
    pub(crate) fn add_resolved_file(&mut self, path: &Path) -> u32 {
        self.add(path.display().to_string(), PathBuf::new(), false)
    }

    /// The files among them.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        self.sources.iter().filter(|source| !source.argument).map(|source| source.label.clone().into()).collect()
    }

    /// Adds an argument of the command line; relative paths in it start from the working directory, or where the map says.
    pub(crate) fn add_argument(&mut self, argument: String) -> u32 {
        self.add(argument, self.map.arguments.clone(), true)
    }

    fn add(&mut self, label: String, directory: PathBuf, argument: bool) -> u32 {
        self.sources.push(Source { label, directory, argument });
        // Sources are files and arguments that a person named one by one.
        u32::try_from(self.sources.len() - 1).expect("fewer than 2^32 sources")
    }

    /// The directory from which a path written at `place` starts.
    pub(crate) fn directory(&self, place: Place) -> &Path {
        self.sources.get(place.source as usize).map_or(Path::new(""), |source| &source.directory)
    }

    /// `file:line:column`.
    pub(crate) fn describe(&self, place: Place) -> String {
        let label = self.sources.get(place.source as usize).map_or("", |source| source.label.as_str());
        match place.line {
            0 => label.to_owned(),
            line => format!("{label}:{line}:{}", place.column),
        }
    }
}

/// A value and its place.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) place: Place,
    pub(crate) value: Value,
}

/// What YAML can say.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Null,
    Bool(bool),
    Unsigned(u64),
    Signed(i64),
    Float(f64),
    Text(String),
    List(Vec<Node>),
    Map(Vec<Entry>),
}

/// A key of a map, its place, and its value. Keys of one map are distinct.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) key: String,
    pub(crate) key_place: Place,
    pub(crate) node: Node,
}

impl Node {
    pub(crate) fn new(place: Place, value: Value) -> Node {
        Node { place, value }
    }

    /// The entry of a map; `None` also when this is no map.
    pub(crate) fn entry(&self, key: &str) -> Option<&Entry> {
        match &self.value {
            Value::Map(entries) => entries.iter().find(|entry| entry.key == key),
            _ => None,
        }
    }

    /// The value under a key of a map.
    pub(crate) fn get(&self, key: &str) -> Option<&Node> {
        self.entry(key).map(|entry| &entry.node)
    }

    /// [`Node::get`], to be changed.
    pub(crate) fn get_mut(&mut self, key: &str) -> Option<&mut Node> {
        match &mut self.value {
            Value::Map(entries) => entries.iter_mut().find(|entry| entry.key == key).map(|entry| &mut entry.node),
            _ => None,
        }
    }

    /// The place of the node at `path`, or of the nearest node around it.
    pub(crate) fn locate(&self, path: &[Segment]) -> Place {
        let mut node = self;
        for segment in path {
            let child = match (segment, &node.value) {
                (Segment::Key(key), Value::Map(_)) => node.get(key),
                (Segment::Index(index), Value::List(items)) => items.get(*index),
                _ => None,
            };
            match child {
                Some(child) => node = child,
                None => break,
            }
        }
        node.place
    }

    /// The node at `path`.
    pub(crate) fn find(&self, path: &[Segment]) -> Option<&Node> {
        path.iter().try_fold(self, |node, segment| match (segment, &node.value) {
            (Segment::Key(key), Value::Map(_)) => node.get(key),
            (Segment::Index(index), Value::List(items)) => items.get(*index),
            _ => None,
        })
    }

    /// Says that this and all inside it stands at one place.
    pub(crate) fn move_to(&mut self, place: Place) {
        self.place = place;
        match &mut self.value {
            Value::List(items) => items.iter_mut().for_each(|item| item.move_to(place)),
            Value::Map(entries) => {
                for entry in entries {
                    entry.key_place = place;
                    entry.node.move_to(place);
                }
            }
            _ => {}
        }
    }

    /// What stands here, in words, for the end of "expected …, found …".
    pub(crate) fn found(&self) -> String {
        match &self.value {
            Value::Null => "nothing".to_owned(),
            Value::Bool(value) => value.to_string(),
            Value::Unsigned(value) => value.to_string(),
            Value::Signed(value) => value.to_string(),
            Value::Float(value) if value.is_nan() => "NaN".to_owned(),
            Value::Float(value) => format!("{value:?}"),
            Value::Text(text) => format!("the text {}", quote(text)),
            Value::List(items) if items.is_empty() => "an empty list".to_owned(),
            Value::List(items) => format!("a list of {}", items.len()),
            Value::Map(entries) if entries.is_empty() => "an empty map".to_owned(),
            Value::Map(entries) => {
                format!("a map with {}", enumerate(entries.iter().map(|entry| entry.key.as_str())))
            }
        }
    }
}

/// The text in quotes, cut when it is long.
pub(crate) fn quote(text: &str) -> String {
    let (shown, more) = cut(text);
    format!("{shown:?}{more}")
}

/// What is said of a number in writing that is infinite in a double, cut when it is long.
pub(crate) fn not_finite(text: &str) -> String {
    let (shown, more) = cut(text);
    format!("expected a finite number, found {shown}{more}")
}

/// As much of a text as an error shows, and dots where there is more.
fn cut(text: &str) -> (&str, &'static str) {
    const LONGEST: usize = 60;
    text.char_indices().nth(LONGEST).map_or((text, ""), |(end, _)| (&text[..end], "…"))
}

/// "a, b, c", cut after a dozen.
pub(crate) fn enumerate<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const MOST: usize = 12;
    let names: Vec<&str> = names.collect();
    let mut text = names[..names.len().min(MOST)].join(", ");
    if names.len() > MOST {
        text.push_str(&format!(" and {} more", names.len() - MOST));
    }
    text
}

/// The candidate that `found` is most likely a misspelling of.
///
/// Damerau's distance (insertion, deletion, substitution, transposition), at most a third of the
/// letters and at least one; the first in alphabetical order among equals.
fn near_miss<'a>(found: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // The distance takes time quadratic in the length, and nobody misspells that much.
    const LONGEST: usize = 100;
    let letters = found.chars().count();
    if letters > LONGEST {
        return None;
    }
    let folded = found.to_lowercase();
    let sorted: BTreeSet<&str> = candidates.into_iter().collect();
    sorted
        .iter()
        .copied()
        .filter(|candidate| candidate.len() <= 4 * LONGEST)
        .filter_map(|candidate| {
            let of_candidate = candidate.chars().count();
            let most = (letters.max(of_candidate) / 3).max(1);
            // The distance is no less than the difference of the lengths, and takes longer to tell.
            let near = letters.abs_diff(of_candidate) <= most;
            let distance = near.then(|| strsim::damerau_levenshtein(&folded, &candidate.to_lowercase()))?;
            (distance <= most).then_some((distance, candidate))
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
        .or_else(|| begun(&folded, &sorted))
}

/// The shortest candidate that begins with `found`, or else the longest with which `found` begins; of three letters or more.
fn begun<'a>(found: &str, candidates: &BTreeSet<&'a str>) -> Option<&'a str> {
    let long = |name: &str| name.chars().nth(2).is_some();
    let begins = |all: &str, start: &str| long(start) && all.to_lowercase().starts_with(start);
    let longer = candidates.iter().filter(|name| begins(name, found)).min_by_key(|name| name.len());
    let shorter = || candidates.iter().filter(|name| begins(found, &name.to_lowercase())).max_by_key(|name| name.len());
    longer.or_else(shorter).copied()
}

/// `; did you mean "flint"?`, or nothing.
pub(crate) fn did_you_mean<'a>(found: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    near_miss(found, candidates).map_or(String::new(), |near| format!("; did you mean {near:?}?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_near_miss_is_the_nearest_name() {
        let names = ["flint", "floor", "glass"];
        assert_eq!(near_miss("flnt", names), Some("flint"));
        assert_eq!(near_miss("Glass", names), Some("glass"));
        assert_eq!(near_miss("galss", names), Some("glass"));
        assert_eq!(near_miss("mirror", names), None);
        let fields = ["fov_axis", "fov_deg", "path", "up"];
        let near = |found| near_miss(found, fields);
        assert_eq!(
            [near("fov"), near("FOV"), near("pathtracer"), near("upper"), near("fo")].map(|n| n.unwrap_or("")),
            ["fov_deg", "fov_deg", "path", "", ""]
        );
        assert_eq!(near_miss(&"flint".repeat(1000), names), None);
    }

    #[test]
    fn long_text_is_cut_in_messages() {
        assert_eq!(quote("short"), "\"short\"");
        assert_eq!(quote(&"x".repeat(61)), format!("\"{}\"…", "x".repeat(60)));
        let names: Vec<String> = (0..14).map(|i| i.to_string()).collect();
        assert_eq!(enumerate(names.iter().map(String::as_str)), "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11 and 2 more");
    }
}
