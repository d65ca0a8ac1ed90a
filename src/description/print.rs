//! A tree as YAML: what [`yaml`](super::yaml) reads back to the same values.
//!
//! Numbers have the shortest digits that read back to the same f64. Paths of files stand under the
//! key `file` throughout the grammar; they are written for a document in another directory.

use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

use super::edit::INCLUDE;
use super::node::{Entry, Node, Sources, Value};
use super::scene::SceneDescription;

/// Columns up to which a map or list stands on one line.
const WIDTH: usize = 110;

/// A scene as a document in `directory`: what was read, with settings and what it includes in their places.
#[must_use]
pub fn yaml(scene: &SceneDescription, directory: &Path) -> String {
    let Some((root, sources)) = scene.tree() else { return String::new() };
    let mut root = root.clone();
    if let Value::Map(entries) = &mut root.value {
        // It would be there twice.
        entries.retain(|entry| entry.key != INCLUDE);
    }
    Printer::new(sources, directory).document(&root)
}

/// Prints trees for a document in a directory.
#[derive(Clone, Copy)]
pub(crate) struct Printer<'a> {
    /// Where paths in the tree start from.
    sources: &'a Sources,
    /// Directory of the document that is printed.
    directory: &'a Path,
    /// Whether a text under `file` is a path.
    names_files: bool,
}

impl<'a> Printer<'a> {
    pub(crate) fn new(sources: &'a Sources, directory: &'a Path) -> Printer<'a> {
        Printer { sources, directory, names_files: true }
    }

    /// A document: the entries of a map, blocks by indentation.
    pub(crate) fn document(&self, root: &Node) -> String {
        let mut out = String::new();
        if let Value::Map(entries) = &root.value {
            self.entries(entries, 0, &mut out);
        }
        out
    }

    fn entries(&self, entries: &[Entry], indent: usize, out: &mut String) {
        for (i, entry) in entries.iter().filter(|entry| says_something(&entry.node)).enumerate() {
            if i > 0 || indent == 0 {
                out.push_str(&" ".repeat(indent));
            }
            self.entry(entry, indent, out);
        }
    }

    /// For what stands under `key`: attributes of a header have whatever names they are given.
    fn under(self, key: &str) -> Self {
        Printer { names_files: self.names_files && key != "attributes", ..self }
    }

    /// `key: value` and the end of the line; the cursor stands at column `indent`.
    fn entry(&self, entry: &Entry, indent: usize, out: &mut String) {
        let key = scalar(&entry.key);
        let flow = self.flow_of(&entry.key, &entry.node);
        let fits = indent + key.chars().count() + 2 + flow.chars().count() <= WIDTH;
        match &entry.node.value {
            Value::Map(inner) if !fits => {
                let _ = write!(out, "{key}:\n{}", " ".repeat(indent + 2));
                self.under(&entry.key).entries(inner, indent + 2, out);
            }
            Value::List(items) if !fits && items.iter().any(|item| !is_scalar(item)) => {
                let _ = writeln!(out, "{key}:");
                for item in items {
                    let _ = write!(out, "{}- ", " ".repeat(indent));
                    let flow = self.flow(item);
                    match &item.value {
                        Value::Map(inner) if indent + 2 + flow.chars().count() > WIDTH => {
                            self.entries(inner, indent + 2, out);
                        }
                        _ => {
                            let _ = writeln!(out, "{flow}");
                        }
                    }
                }
            }
            _ => {
                let _ = writeln!(out, "{key}: {flow}");
            }
        }
    }

    /// The value on one line.
    pub(crate) fn flow(&self, node: &Node) -> String {
        match &node.value {
            Value::Null => "null".to_owned(),
            Value::Bool(value) => value.to_string(),
            Value::Unsigned(value) => value.to_string(),
            Value::Signed(value) => value.to_string(),
            Value::Float(value) => number(*value),
            Value::Text(text) => scalar(text),
            Value::List(items) => {
                let items: Vec<String> = items.iter().map(|item| self.flow(item)).collect();
                format!("[{}]", items.join(", "))
            }
            Value::Map(entries) => {
                let said = entries.iter().filter(|entry| says_something(&entry.node));
                let fields =
                    said.map(|entry| format!("{}: {}", scalar(&entry.key), self.flow_of(&entry.key, &entry.node)));
                format!("{{{}}}", fields.collect::<Vec<_>>().join(", "))
            }
        }
    }

    fn flow_of(&self, key: &str, node: &Node) -> String {
        match &node.value {
            Value::Text(file) if key == "file" && self.names_files => {
                let path = self.sources.file(node.place, file);
                scalar(&relative(&path, self.directory).to_string_lossy())
            }
            _ => self.under(key).flow(node),
        }
    }
}

/// False for a field without value, which is not written.
fn says_something(node: &Node) -> bool {
    !matches!(node.value, Value::Null)
}

fn is_scalar(node: &Node) -> bool {
    !matches!(node.value, Value::List(_) | Value::Map(_))
}

fn number(value: f64) -> String {
    if value == 0.0 {
        // A whole zero has no sign.
        return format!("{value:?}");
    }
    let plain = value.to_string();
    let short = format!("{value:e}");
    if plain.len() <= short.len() + 3 { plain } else { short }
}

/// Text that reads back as text: bare where nothing in it means anything, quoted otherwise.
fn scalar(text: &str) -> String {
    let first = text.chars().next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    let bare = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    let word = ["true", "false", "null", "yes", "no", "on", "off", "y", "n"];
    if first && text.chars().all(bare) && !word.contains(&text.to_ascii_lowercase().as_str()) {
        return text.to_owned();
    }
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            // Beyond what YAML calls printable, and marks that a reader might take for the end of a line.
            _ if c.is_control() || "\u{2028}\u{2029}\u{feff}\u{fffe}\u{ffff}".contains(c) => {
                let _ = write!(quoted, "\\U{:08X}", u32::from(c));
            }
            _ => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

/// `path` as it is named in a file in `directory`; absolute where there is no way from one to the other.
pub(crate) fn relative(path: &Path, directory: &Path) -> PathBuf {
    if let Ok(below) = path.strip_prefix(directory) {
        return below.to_path_buf();
    }
    let absolute = |path: &Path| std::path::absolute(path).ok();
    let (Some(path_whole), Some(from)) = (absolute(path), absolute(directory)) else { return path.to_path_buf() };
    // Without `..` in the way, the two can be compared name by name.
    let plain = |path: &Path| path.components().all(|c| !matches!(c, Component::ParentDir));
    let (path_whole, from) = match (plain(&path_whole), plain(&from)) {
        (true, true) => (path_whole, from),
        _ => match (path_whole.canonicalize(), from.canonicalize()) {
            (Ok(path), Ok(from)) => (path, from),
            _ => return path_whole,
        },
    };
    let shared = path_whole.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(path_whole.components().skip(shared)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{edit, load};
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str, sources: &mut Sources) -> Node {
        edit::read_bytes_as(text.as_bytes(), Path::new("dir/s.yaml"), sources).unwrap_or_else(|error| panic!("{error}"))
    }

    fn same(a: &Node, b: &Node) -> bool {
        match (&a.value, &b.value) {
            (Value::List(a), Value::List(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)),
            (Value::Map(a), Value::Map(b)) => {
                let said = |entries: &[Entry]| -> Vec<Entry> {
                    entries.iter().filter(|entry| says_something(&entry.node)).cloned().collect()
                };
                let (a, b) = (said(a), said(b));
                a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a.key == b.key && same(&a.node, &b.node))
            }
            (Value::Text(a), Value::Text(b)) => a == b,
            (Value::Bool(a), Value::Bool(b)) => a == b,
            (Value::Null, Value::Null) => true,
            (a, b) => number_of(a).zip(number_of(b)).is_some_and(|(a, b)| a.to_bits() == b.to_bits()),
        }
    }

    fn number_of(value: &Value) -> Option<f64> {
        match value {
            Value::Unsigned(value) => Some(*value as f64),
            Value::Signed(value) => Some(*value as f64),
            Value::Float(value) => Some(*value),
            _ => None,
        }
    }

    #[test]
    fn every_shipped_scene_reads_back_from_its_print() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/scenes");
        let mut count = 0;
        for file in std::fs::read_dir(&folder).unwrap() {
            let text = std::fs::read_to_string(file.unwrap().path()).unwrap();
            let mut sources = Sources::default();
            let node = read(&text, &mut sources);
            let printed = Printer::new(&sources, Path::new("dir")).document(&node);
            let again = read(&printed, &mut Sources::default());
            assert!(same(&node, &again), "{printed}");
            count += 1;
        }
        assert!(count >= 15);
    }

    #[test]
    fn a_file_is_named_from_the_directory_of_the_document() {
        let mut sources = Sources::default();
        let node = read("a: {file: x.png}\n", &mut sources);
        let printed = |directory: &str| Printer::new(&sources, Path::new(directory)).document(&node);
        assert_eq!(printed("dir"), "a: {file: x.png}\n");
        assert_eq!(printed(""), "a: {file: dir/x.png}\n");
        assert_eq!(printed("dir/sub"), "a: {file: \"../x.png\"}\n");
        let text = "output: {exr: {attributes: {file: take7.mov}}}\n";
        let node = read(text, &mut sources);
        assert_eq!(Printer::new(&sources, Path::new("far")).document(&node), text);
    }

    /// A document in another directory has what its scene includes, which names a file from where it stands.
    #[test]
    fn a_document_includes_nothing_and_lacks_nothing() {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        let write = |name: &str, text: &str| std::fs::write(path(name), text).unwrap();
        for name in ["presets", "far"] {
            std::fs::create_dir(path(name)).unwrap();
        }
        let camera = "camera: {origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}\n";
        let shapes = "shapes: [{sphere: {radius: 1, material: m}}]\n";
        let (textures, materials) =
            ("textures: {t: {image: {file: FILE}}}\n", "materials: {m: {diffuse: {reflectance: {texture: t}}}}\n");
        write("s.yaml", &format!("include: [presets/p.yaml]\n{camera}{shapes}"));
        write("presets/p.yaml", &format!("{textures}{materials}").replace("FILE", "t.png"));
        let scene = |name: &str| load(&path(name)).unwrap().entries()[0].scene(&[]).unwrap();
        let printed = yaml(&scene("s.yaml"), &path("far"));
        let expected = format!("{camera}{shapes}{textures}{materials}").replace("FILE", "\"../presets/t.png\"");
        assert_eq!(printed, expected);
        write("far/s.yaml", &printed);
        assert_eq!(scene("far/s.yaml").materials, scene("s.yaml").materials);
    }

    #[test]
    fn a_name_like_a_merge_key_reads_back() {
        let mut sources = Sources::default();
        let node = read("materials: {\"<<\": {diffuse: {reflectance: 0.5}}}\n", &mut sources);
        let printed = Printer::new(&sources, Path::new("dir")).document(&node);
        assert_eq!(printed, "materials: {\"<<\": {diffuse: {reflectance: 0.5}}}\n");
        assert!(same(&node, &read(&printed, &mut sources)));
    }

    proptest! {
        #[test]
        fn any_text_and_number_reads_back(text in ".{0,12}", x in any::<f64>().prop_filter("finite", |x| x.is_finite())) {
            let mut sources = Sources::default();
            let place = Default::default();
            let entry = |key: &str, value| Entry { key: key.to_owned(), key_place: place, node: Node::new(place, value) };
            let node = Node::new(place, Value::Map(vec![
                entry("t", Value::Text(text.clone())),
                entry("x", Value::Float(x)),
                entry("l", Value::List(vec![Node::new(place, Value::Text(text))])),
            ]));
            let printed = Printer::new(&sources, Path::new("")).document(&node);
            prop_assert!(same(&node, &read(&printed, &mut sources)), "{}", printed);
        }
    }
}
