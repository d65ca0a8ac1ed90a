//! YAML text to a [`Node`] tree: the one file that names a YAML crate.
//!
//! The text is read twice. First as events with marks (`granit-parser`, a YAML 1.2 parser
//! without unsafe code): this gives the form of the tree and the place of every node, and it
//! holds the limits before anything large is built. Then by `serde_yaml`, which says what each
//! scalar means (`1e3` is a number, `"1e3"` is text). Both must see the same form; a text that
//! two parsers read differently is refused rather than guessed.
//!
//! Refused here, with the place: text that is not YAML, tabs for indentation, a second document,
//! tags, keys that are not plain names, duplicate keys (with both places), nesting deeper than
//! [`MAX_DEPTH`], more than [`MAX_NODES`] nodes after aliases and merges are written out, more than
//! [`MAX_BYTES`] of text.

use std::cell::Cell;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt;

use granit_parser::{ErrorKind, Event, Options, Parser, ScalarStyle, ScanError, Span};
use serde::Deserialize;
use serde::de::{self, DeserializeSeed, Deserializer, EnumAccess, MapAccess, SeqAccess, Visitor};

use super::fault::Fault;
use super::node::{Entry, Node, Place, Value, quote};
use super::path::Segment;

/// The largest document, in bytes.
pub(crate) const MAX_BYTES: usize = 64 << 20;
/// The deepest nesting of lists and maps. The grammar itself needs 9 levels.
pub(crate) const MAX_DEPTH: usize = 64;
/// The most nodes of a tree, aliases written out; text counts one more for each [`TEXT_PER_NODE`]
/// bytes. A scene of 100 000 shapes with inline materials has about two million.
pub(crate) const MAX_NODES: usize = 4_000_000;
/// Bytes of text that weigh as much as a node: about what a node takes in memory.
const TEXT_PER_NODE: usize = 64;

/// What a key is that stands for the fields of another map, if it is not in quotes.
const MERGE_KEY: &str = "<<";

/// Reads one document.
///
/// # Errors
/// The first fault, with its place.
pub(crate) fn read(bytes: &[u8], source: u32) -> Result<Node, Fault> {
    let start = Place { source, line: 1, column: 1 };
    if bytes.len() > MAX_BYTES {
        let (limit, found) = (MAX_BYTES >> 20, bytes.len());
        return Err(Fault::at_place(start, format!("expected at most {limit} MiB of text, found {found} bytes")));
    }
    let text = str::from_utf8(bytes).map_err(|error| {
        let (before, rest) = bytes.split_at(error.valid_up_to());
        let place = end_of(&String::from_utf8_lossy(before), source);
        Fault::at_place(place, format!("expected text in UTF-8, found the byte 0x{:02x}", rest[0]))
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);

    let mut builder = Builder {
        source,
        budget: MAX_NODES,
        frames: Vec::new(),
        anchors: HashMap::new(),
        merges: BTreeSet::new(),
        root: None,
    };
    let Some(mut root) = builder.build(text)? else {
        return Ok(Node::new(start, Value::Null));
    };
    interpret(&mut root, text)?;
    merge(&mut root, &builder.merges, &mut builder.budget)?;
    Ok(root)
}

/// The place just after `text`.
fn end_of(text: &str, source: u32) -> Place {
    let line = text.matches('\n').count() + 1;
    let column = text.rsplit('\n').next().map_or(0, |last| last.chars().count()) + 1;
    place(source, line, column)
}

fn place(source: u32, line: usize, column: usize) -> Place {
    // Neither exceeds MAX_BYTES + 1.
    let small = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    Place { source, line: small(line), column: small(column) }
}

// ---------------------------------------------------------------------------------------------
// First reading: form and places.

/// Builds the tree from events; scalars are kept as text.
struct Builder {
    source: u32,
    /// Nodes that may still be made.
    budget: usize,
    /// The lists and maps that are open, outermost first.
    frames: Vec<Frame>,
    /// Finished nodes that aliases may name, and how deep they nest.
    anchors: HashMap<usize, (Node, usize)>,
    /// Where keys stand that are [`MERGE_KEY`].
    merges: BTreeSet<Place>,
    root: Option<Node>,
}

struct Frame {
    place: Place,
    anchor: usize,
    /// The levels of nesting inside, this one counted.
    height: usize,
    content: Content,
}

enum Content {
    List(Vec<Node>),
    Map { entries: Vec<Entry>, seen: HashMap<String, Place>, key: Option<(String, Place)> },
}

impl Builder {
    fn build(&mut self, text: &str) -> Result<Option<Node>, Fault> {
        let mut options = Options::default();
        options.flow_nesting_limit = MAX_DEPTH;
        options.block_nesting_limit = MAX_DEPTH;
        let mut documents = 0;
        for event in Parser::new_from_str_with_options(text, options) {
            let (event, span) = event.map_err(|error| self.syntax(&error, text))?;
            let at = self.place_of(&span);
            match event {
                Event::DocumentStart(..) => {
                    documents += 1;
                    if documents > 1 {
                        return Err(Fault::at_place(at, "expected one document, found the start of a second"));
                    }
                }
                Event::Scalar(text, style, anchor, tag) => {
                    self.no_tag(at, tag.is_some())?;
                    self.charge(1 + text.len() / TEXT_PER_NODE, at)?;
                    match self.expects_key() {
                        true if anchor != 0 => {
                            return Err(self.fault(at, "expected a plain name as key, found an anchor"));
                        }
                        true => {
                            if style == ScalarStyle::Plain && text == MERGE_KEY {
                                self.merges.insert(at);
                            }
                            self.key(&text, at)?;
                        }
                        false => self.finish_node(Node::new(at, Value::Text(text.into_owned())), 0, anchor)?,
                    }
                }
                Event::SequenceStart(_, anchor, tag) => {
                    self.no_tag(at, tag.is_some())?;
                    self.open(at, anchor, Content::List(Vec::new()))?;
                }
                Event::MappingStart(_, anchor, tag) => {
                    self.no_tag(at, tag.is_some())?;
                    self.open(at, anchor, Content::Map { entries: Vec::new(), seen: HashMap::new(), key: None })?;
                }
                Event::SequenceEnd | Event::MappingEnd => self.close()?,
                Event::Alias(anchor) => self.alias(anchor, at)?,
                // Stream boundaries; unresolved aliases, anchors and comments are not asked for.
                _ => {}
            }
        }
        Ok(self.root.take())
    }

    fn place_of(&self, span: &Span) -> Place {
        place(self.source, span.start.line(), span.start.col() + 1)
    }

    /// The path of the node that is being read.
    fn path(&self) -> Vec<Segment> {
        let step = |frame: &Frame| match &frame.content {
            Content::List(items) => Some(Segment::Index(items.len())),
            Content::Map { key, .. } => key.as_ref().map(|(key, _)| Segment::Key(key.clone())),
        };
        self.frames.iter().filter_map(step).collect()
    }

    fn fault(&self, at: Place, message: impl Into<String>) -> Fault {
        Fault::at_place(at, message).under_path(&self.path())
    }

    fn syntax(&self, error: &ScanError, text: &str) -> Fault {
        let mark = error.marker();
        let at = place(self.source, mark.line(), mark.col() + 1);
        match error.kind() {
            ErrorKind::RecursionLimitExceeded => self.too_deep(at),
            ErrorKind::TabNotAllowed
            | ErrorKind::TabInIndentation
            | ErrorKind::TabInBlockIndentation
            | ErrorKind::TabAtBlockScalarStart
            | ErrorKind::TabInPlainScalar => self.fault(at, "expected spaces for indentation, found a tab"),
            ErrorKind::UnknownAnchor => {
                self.fault(at, "expected an alias of an anchor above, found one without anchor")
            }
            _ => {
                let line = text.lines().nth(mark.line().saturating_sub(1)).unwrap_or_default();
                let mut here = line.chars().skip(mark.col().saturating_sub(1));
                // Within braces an opening bracket ends plain text, as in `{dir: o/{scene}}`.
                let is_text = |c: char| !c.is_whitespace() && !"[{,:".contains(c);
                let in_text = here.next().is_some_and(is_text) && matches!(here.next(), Some('{' | '['));
                let hint = if in_text { "; text with brackets in it is written in quotes" } else { "" };
                self.fault(at, format!("expected YAML, found a fault of syntax: {}{hint}", error.info()))
            }
        }
    }

    fn too_deep(&self, at: Place) -> Fault {
        // A path of 64 steps would hide the message.
        let mut path = self.path();
        path.truncate(4);
        Fault::at_place(at, format!("expected at most {MAX_DEPTH} levels of nesting, found more")).under_path(&path)
    }

    fn no_tag(&self, at: Place, tagged: bool) -> Result<(), Fault> {
        match tagged {
            true => Err(self.fault(at, "expected a value without a tag, found a tag (\"!…\")")),
            false => Ok(()),
        }
    }

    fn charge(&mut self, nodes: usize, at: Place) -> Result<(), Fault> {
        match self.budget.checked_sub(nodes) {
            Some(rest) => {
                self.budget = rest;
                Ok(())
            }
            None => Err(self.fault(at, format!("expected at most {MAX_NODES} values in all, found more"))),
        }
    }

    fn expects_key(&self) -> bool {
        matches!(self.frames.last(), Some(Frame { content: Content::Map { key: None, .. }, .. }))
    }

    fn key(&mut self, name: &str, at: Place) -> Result<(), Fault> {
        let Some(Frame { content: Content::Map { seen, key, .. }, .. }) = self.frames.last_mut() else {
            return Ok(());
        };
        *key = Some((name.to_owned(), at));
        if let Some(first) = seen.insert(name.to_owned(), at) {
            let Place { line, column, .. } = first;
            return Err(self.fault(
                at,
                format!(
                    "expected each key once, found {} again; it is first at line {line}, column {column}",
                    quote(name)
                ),
            ));
        }
        Ok(())
    }

    fn open(&mut self, at: Place, anchor: usize, content: Content) -> Result<(), Fault> {
        if self.expects_key() {
            return Err(self.fault(at, "expected a plain name as key, found a list or a map"));
        }
        if self.frames.len() >= MAX_DEPTH {
            return Err(self.too_deep(at));
        }
        self.charge(1, at)?;
        self.frames.push(Frame { place: at, anchor, height: 1, content });
        Ok(())
    }

    fn close(&mut self) -> Result<(), Fault> {
        let Some(frame) = self.frames.pop() else { return Ok(()) };
        let value = match frame.content {
            Content::List(items) => Value::List(items),
            Content::Map { entries, .. } => Value::Map(entries),
        };
        self.finish_node(Node::new(frame.place, value), frame.height, frame.anchor)
    }

    /// Hands a finished node to the list or map around it, and to its anchor.
    fn finish_node(&mut self, node: Node, height: usize, anchor: usize) -> Result<(), Fault> {
        if anchor != 0 {
            self.charge(weight(&node), node.place)?;
            self.anchors.insert(anchor, (node.clone(), height));
        }
        match self.frames.last_mut() {
            None => self.root = Some(node),
            Some(frame) => {
                frame.height = frame.height.max(height + 1);
                match &mut frame.content {
                    Content::List(items) => items.push(node),
                    Content::Map { entries, key, .. } => {
                        // `expects_key` was false, so the key is there.
                        if let Some((key, key_place)) = key.take() {
                            entries.push(Entry { key, key_place, node });
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Writes out an alias.
    fn alias(&mut self, anchor: usize, at: Place) -> Result<(), Fault> {
        if self.expects_key() {
            return Err(self.fault(at, "expected a plain name as key, found an alias"));
        }
        let Some((node, height)) = self.anchors.get(&anchor) else {
            return Err(self.fault(at, "expected an alias of a finished value, found one inside its own anchor"));
        };
        let (cost, height) = (weight(node), *height);
        if self.frames.len() + height > MAX_DEPTH {
            return Err(self.too_deep(at));
        }
        self.charge(cost, at)?;
        let node = self.anchors[&anchor].0.clone();
        self.finish_node(node, height, 0)
    }
}

/// What a node and all inside it count toward [`MAX_NODES`].
pub(crate) fn weight(node: &Node) -> usize {
    match &node.value {
        Value::Text(text) => 1 + text.len() / TEXT_PER_NODE,
        Value::List(items) => 1 + items.iter().map(weight).sum::<usize>(),
        Value::Map(entries) => {
            1 + entries.iter().map(|e| 1 + e.key.len() / TEXT_PER_NODE + weight(&e.node)).sum::<usize>()
        }
        _ => 1,
    }
}

// ---------------------------------------------------------------------------------------------
// Second reading: what the scalars mean.

/// Replaces the text of each scalar by what `serde_yaml` reads.
fn interpret(root: &mut Node, text: &str) -> Result<(), Fault> {
    let start = root.place;
    let differs = Cell::new(None);
    let seed = Fill { node: root, differs: &differs };
    seed.deserialize(serde_yaml::Deserializer::from_str(text)).map_err(|error| match differs.get() {
        Some(at) => {
            Fault::at_place(at, "expected YAML that reads one way, found text that two parsers read differently")
        }
        None => {
            let at = error.location().map_or(start, |mark| place(start.source, mark.line(), mark.column()));
            Fault::at_place(at, format!("expected YAML, found a fault of syntax: {error}"))
        }
    })
}

/// Walks a node beside the second reading of it.
struct Fill<'a> {
    node: &'a mut Node,
    /// Where the two readings part, once they do.
    differs: &'a Cell<Option<Place>>,
}

impl Fill<'_> {
    fn scalar<E: de::Error>(self, value: Value) -> Result<(), E> {
        match self.node.value {
            Value::Text(_) => {
                self.node.value = value;
                Ok(())
            }
            _ => Err(part(self.node.place, self.differs)),
        }
    }
}

fn part<E: de::Error>(at: Place, differs: &Cell<Option<Place>>) -> E {
    differs.set(differs.get().or(Some(at)));
    E::custom("the readings differ")
}

impl<'de> DeserializeSeed<'de> for Fill<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Fill<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a YAML value")
    }

    fn visit_unit<E: de::Error>(self) -> Result<(), E> {
        self.scalar(Value::Null)
    }

    fn visit_bool<E: de::Error>(self, value: bool) -> Result<(), E> {
        self.scalar(Value::Bool(value))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<(), E> {
        self.scalar(Value::Unsigned(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<(), E> {
        self.scalar(Value::Signed(value))
    }

    // Whole numbers beyond 64 bits: as good as any other large number.
    fn visit_u128<E: de::Error>(self, value: u128) -> Result<(), E> {
        self.scalar(Value::Float(value as f64))
    }

    fn visit_i128<E: de::Error>(self, value: i128) -> Result<(), E> {
        self.scalar(Value::Float(value as f64))
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<(), E> {
        self.scalar(Value::Float(value))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<(), E> {
        match &self.node.value {
            Value::Text(first) if first == text => Ok(()),
            _ => Err(part(self.node.place, self.differs)),
        }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        let Fill { node, differs } = self;
        let Value::List(items) = &mut node.value else {
            return Err(part(node.place, differs));
        };
        for item in items {
            let at = item.place;
            seq.next_element_seed(Fill { node: item, differs })?.ok_or_else(|| part(at, differs))?;
        }
        match seq.next_element::<de::IgnoredAny>()? {
            None => Ok(()),
            Some(_) => Err(part(node.place, differs)),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Fill { node, differs } = self;
        let Value::Map(entries) = &mut node.value else {
            return Err(part(node.place, differs));
        };
        for entry in entries {
            if map.next_key::<Key>()?.is_none_or(|key| key.0 != entry.key) {
                return Err(part(entry.key_place, differs));
            }
            map.next_value_seed(Fill { node: &mut entry.node, differs })?;
        }
        match map.next_key::<Key>()? {
            None => Ok(()),
            Some(_) => Err(part(node.place, differs)),
        }
    }

    fn visit_enum<A: EnumAccess<'de>>(self, _: A) -> Result<(), A::Error> {
        // A tag; the first reading has refused those that it saw.
        Err(part(self.node.place, self.differs))
    }
}

/// A key as it is spelt, also when it looks like a number.
#[derive(Deserialize)]
struct Key(String);

// ---------------------------------------------------------------------------------------------
// Merge keys.

/// Writes out `<<: *defaults`: the fields of the named map, or maps, that are not written here, where `<<` stands, as the
/// order of frames counts. Such keys are where `merges` says.
fn merge(node: &mut Node, merges: &BTreeSet<Place>, budget: &mut usize) -> Result<(), Fault> {
    match &mut node.value {
        Value::List(items) => {
            for (i, item) in items.iter_mut().enumerate() {
                merge(item, merges, budget).map_err(|fault| fault.under(Segment::Index(i)))?;
            }
        }
        Value::Map(entries) => {
            for entry in entries.iter_mut() {
                merge(&mut entry.node, merges, budget).map_err(|fault| fault.under(Segment::Key(entry.key.clone())))?;
            }
            if let Some(i) = entries.iter().position(|entry| merges.contains(&entry.key_place)) {
                let Entry { node: from, .. } = entries.remove(i);
                let from = match from.value {
                    Value::List(maps) => maps,
                    _ => vec![from],
                };
                let mut present: HashSet<String> = entries.iter().map(|entry| entry.key.clone()).collect();
                let mut merged = Vec::new();
                for map in from {
                    let found = map.found();
                    let Value::Map(fields) = map.value else {
                        let message = format!("expected a map or a list of maps, found {found}");
                        return Err(Fault::at_place(map.place, message).under(Segment::Key(MERGE_KEY.to_owned())));
                    };
                    let absent: Vec<Entry> =
                        fields.into_iter().filter(|field| present.insert(field.key.clone())).collect();
                    let cost: usize = absent.iter().map(|entry| weight(&entry.node)).sum();
                    *budget = budget.checked_sub(cost).ok_or_else(|| {
                        Fault::at_place(node.place, format!("expected at most {MAX_NODES} values in all, found more"))
                    })?;
                    merged.extend(absent);
                }
                entries.splice(i..i, merged);
            }
        }
        _ => {}
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::node::Sources;
    use super::*;

    fn tree(text: &str) -> Node {
        read(text.as_bytes(), 0).unwrap_or_else(|fault| panic!("{fault}"))
    }

    fn refusal(bytes: impl AsRef<[u8]>) -> String {
        let mut sources = Sources::default();
        let source = sources.add_file(Path::new("f.yaml"));
        match read(bytes.as_ref(), source) {
            Ok(node) => format!("read as {}", node.found()),
            Err(fault) => fault.write(&sources),
        }
    }

    #[test]
    fn places_count_lines_and_characters_from_one() {
        let root = tree("a: 1\r\nb:\n  - é: [x, 'y']\n");
        let at = |path: &str| {
            let Place { line, column, .. } = root.locate(&super::super::path::parse(path).unwrap());
            (line, column)
        };
        assert_eq!(at("a"), (1, 4));
        assert_eq!(at("b"), (3, 3));
        assert_eq!(at("b[0]"), (3, 5));
        assert_eq!(at("b[0].é[1]"), (3, 12));
        // What is not there is where it would be.
        assert_eq!(at("b[7].c"), (3, 3));
    }

    #[test]
    fn scalars_mean_what_serde_yaml_says() {
        let values = [
            ("1", "1"),
            ("-1", "-1"),
            ("1e3", "1000.0"),
            ("0x10", "16"),
            ("'1'", "the text \"1\""),
            ("007", "the text \"007\""),
            ("true", "true"),
            ("yes", "the text \"yes\""),
            ("~", "nothing"),
            ("", "nothing"),
            ("18446744073709551616", "1.8446744073709552e19"),
            ("|\n  a\n  b\n", "the text \"a\\nb\\n\""),
        ];
        for (text, found) in values {
            assert_eq!(tree(&format!("a: {text}")).get("a").unwrap().found(), found, "{text}");
        }
    }

    #[test]
    fn a_byte_order_mark_is_skipped() {
        assert_eq!(tree("\u{feff}a: 1").found(), "a map with a");
    }

    #[test]
    fn an_empty_file_is_nothing() {
        for text in ["", "\n", "# only a comment\n", "---\n", "---\n...\n"] {
            assert_eq!(tree(text).found(), "nothing", "{text:?}");
        }
    }

    #[test]
    fn a_table_on_one_long_line_is_read() {
        let pairs: Vec<String> = (360..=830).map(|nm| format!("[{nm}, 0.123456789]")).collect();
        let root = tree(&format!("a: {{table: [{}]}}", pairs.join(", ")));
        assert_eq!(root.get("a").unwrap().get("table").unwrap().found(), "a list of 471");
    }

    #[test]
    fn text_that_is_not_yaml_is_refused_with_its_place() {
        let cases: [(&str, &str); 10] = [
            ("a:\n\tb: 1\n", "f.yaml:2:2: a: expected spaces for indentation, found a tab"),
            ("a: [1,", "f.yaml:1:4: a[1]: expected YAML, found a fault of syntax: unclosed bracket '['"),
            ("a: 'b", "f.yaml:1:4: a: expected YAML, found a fault of syntax: unclosed quote"),
            (
                "a: 1\nb: {dir: o/{scene}}",
                "f.yaml:2:12: b: expected YAML, found a fault of syntax: while parsing a flow mapping, did not find expected \
                 ',' or '}'; text with brackets in it is written in quotes",
            ),
            (
                "a: b: c",
                "f.yaml:1:5: expected YAML, found a fault of syntax: mapping values are not allowed in this context",
            ),
            ("a: 1\n---\nb: 2\n", "f.yaml:2:1: expected one document, found the start of a second"),
            ("a: !x 1", "f.yaml:1:7: a: expected a value without a tag, found a tag (\"!…\")"),
            ("? [1]\n: 2", "f.yaml:1:3: expected a plain name as key, found a list or a map"),
            ("a: *b", "f.yaml:1:4: a: expected an alias of an anchor above, found one without anchor"),
            ("a: &b [*b]", "f.yaml:1:8: a[0]: expected an alias of a finished value, found one inside its own anchor"),
        ];
        for (text, message) in cases {
            assert_eq!(refusal(text), message);
        }
        assert_eq!(refusal(b"a: 1\nb: \xc3\xa9\xff"), "f.yaml:2:5: expected text in UTF-8, found the byte 0xff");
    }

    #[test]
    fn text_that_two_versions_of_yaml_read_differently_is_refused() {
        // U+0085 ends a line in YAML 1.1 and not in 1.2.
        assert_eq!(
            refusal("a: 'x\u{85}y'"),
            "f.yaml:1:4: expected YAML that reads one way, found text that two parsers read differently"
        );
    }

    #[test]
    fn a_duplicate_key_is_refused_with_both_places() {
        assert_eq!(
            refusal("m:\n  red: 1\n  blue: 2\n  \"red\": 3\n"),
            "f.yaml:4:3: m.red: expected each key once, found \"red\" again; it is first at line 2, column 3"
        );
        assert_eq!(
            refusal("[{1: a, 1: b}]"),
            "f.yaml:1:9: [0].1: expected each key once, found \"1\" again; it is first at line 1, column 3"
        );
    }

    #[test]
    fn nesting_has_an_end() {
        let deep = |open: &str, close: &str, levels: usize| format!("{}1{}", open.repeat(levels), close.repeat(levels));
        assert_eq!(refusal(deep("[", "]", MAX_DEPTH)), "read as a list of 1");
        for levels in [MAX_DEPTH + 1, 100_000] {
            assert_eq!(
                refusal(deep("[", "]", levels)),
                "f.yaml:1:65: expected at most 64 levels of nesting, found more"
            );
        }
        let block: String = (0..100).map(|level| format!("{}a:\n", " ".repeat(level))).collect();
        assert_eq!(refusal(block), "f.yaml:65:65: a.a.a.a: expected at most 64 levels of nesting, found more");
        // Aliases add up to the same depth: each line nests the one before 30 levels deeper.
        let aliases = format!(
            "a: &a {}\nb: &b {}\nc: &c {}\n",
            deep("[", "]", 30),
            deep("[", "]", 30).replace('1', "*a"),
            deep("[", "]", 30).replace('1', "*b")
        );
        assert_eq!(refusal(aliases), "f.yaml:3:37: c[0][0][0]: expected at most 64 levels of nesting, found more");
    }

    #[test]
    fn aliases_may_not_explode() {
        // Ten to the tenth values in ten lines.
        let mut bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n".to_owned();
        for i in 1..10 {
            let aliases = vec![format!("*a{}", i - 1); 10].join(", ");
            bomb.push_str(&format!("a{i}: &a{i} [{aliases}]\n"));
        }
        // The tree of a_n has T_n = 1 + 10 T_{n−1} nodes, T_0 = 11, and counts again for its anchor:
        // 2 (T_0 + … + T_5) = 2 469 132. Of a6 one alias fits, T_5 = 1 111 111, and no second.
        assert_eq!(refusal(bomb), "f.yaml:7:15: a6[1]: expected at most 4000000 values in all, found more");

        // Long text, many times.
        let text = "x".repeat(1 << 20);
        let bomb = format!("a: &a {text}\nb: [{}]", vec!["*a"; 1000].join(", "));
        // 2^20 / 64 + 1 = 16385 for each copy: once written, once for the anchor, and 242 aliases fit.
        assert_eq!(4_000_000 / 16385 - 2, 242);
        let column = "b: [".len() + 1 + 242 * "*a, ".len();
        assert_eq!(
            refusal(bomb),
            format!("f.yaml:2:{column}: b[242]: expected at most 4000000 values in all, found more")
        );
    }

    #[test]
    fn merges_may_not_explode() {
        // Maps of a thousand lists, each merged into a thousand maps of a thousand values.
        let big: Vec<String> = (0..1000).map(|i| format!("k{i}: 1")).collect();
        let bomb = format!("a: &a {{{}}}\nb: [{}]", big.join(", "), vec!["{<<: *a, x: {<<: *a}}"; 3000].join(", "));
        assert!(refusal(bomb).ends_with("expected at most 4000000 values in all, found more"));
    }

    #[test]
    fn a_document_has_at_most_64_mib() {
        assert_eq!(
            refusal(vec![b' '; MAX_BYTES + 1]),
            "f.yaml:1:1: expected at most 64 MiB of text, found 67108865 bytes"
        );
    }

    #[test]
    fn a_merge_key_adds_what_is_not_written() {
        let root = tree("base: &b {x: 1, y: 2}\nmore: &m {y: 3, z: 4}\na: {<<: *b, x: 5}\nb: {<<: [*m, *b]}\n");
        let values = |key: &str| {
            let Some(Value::Map(entries)) = root.get(key).map(|node| &node.value) else { panic!("a map") };
            entries.iter().map(|e| format!("{}={}", e.key, e.node.found())).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(values("a"), "y=2 x=5");
        assert_eq!(values("b"), "y=3 z=4 x=1");
        // Names of all maps before were gathered for each: 36 s for so many.
        let begin = std::time::Instant::now();
        let many: String = (0..40_000).map(|i| format!("{{k{i}: 1}}, ")).collect();
        tree(&format!("a: {{<<: [{many}]}}\n"));
        assert!(begin.elapsed().as_secs() < 10);
        assert_eq!(refusal("a: {<<: 3}"), "f.yaml:1:9: a.<<: expected a map or a list of maps, found 3");
    }

    /// YAML 1.1, "Merge Key Language-Independent Type": what is in quotes is text.
    #[test]
    fn a_merge_key_in_quotes_is_a_name() {
        let root = tree("base: &b {'<<': 1, y: 2}\na: {\"<<\": {x: 3}}\nb: {<<: *b, z: 4}\n");
        assert_eq!(root.get("a").unwrap().get("<<").unwrap().found(), "a map with x");
        assert_eq!(root.get("b").unwrap().found(), "a map with <<, y, z");
    }
}
