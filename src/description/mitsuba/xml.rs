//! XML text to elements with places: the one file that names an XML crate.
//!
//! `quick-xml` is a pull parser without recursion and without external entities, whose events
//! borrow from the text, so that the offset of each name and value is known. Nesting is limited
//! here, before anything deep is built. Instructions `<?abbe …?>` become elements of their own: what
//! [`export`](super::export) says past Mitsuba. A document type is refused, and with it every entity but
//! the five of XML and character references: nothing here grows as it is read. What references write out more than
//! once is counted where that happens, by [`Import::again`](super::Import::again).

use std::borrow::Cow;

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

use super::super::fault::Fault;
use super::super::node::{Place, quote};
use super::super::yaml::{MAX_BYTES, MAX_NODES};

/// The deepest nesting of elements. A scene needs about ten levels.
pub(crate) const MAX_DEPTH: usize = 64;

/// An element and all inside it; text between elements says nothing in a scene and is passed over.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    /// Its name.
    pub(crate) tag: String,
    /// Of its `<`.
    pub(crate) place: Place,
    /// In the order of the text; names are distinct.
    pub(crate) attributes: Vec<Attribute>,
    /// Elements, in the order of the text.
    pub(crate) children: Vec<Element>,
}

/// `name="value"`
#[derive(Clone, Debug)]
pub(crate) struct Attribute {
    /// As written.
    pub(crate) name: String,
    /// With character references resolved.
    pub(crate) value: String,
    /// Of the first character of the value.
    pub(crate) place: Place,
}

impl Element {
    /// The attribute of this name.
    pub(crate) fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|attribute| attribute.name == name)
    }
}

/// The tag of an element made of `<?abbe set KEY: YAML?>`.
pub(crate) const SET: &str = "?set";
/// The attribute of an element made of an instruction that holds its YAML.
pub(crate) const YAML: &str = "?yaml";

/// Of an entity that is not defined.
const NO_ENTITIES: &str = "expected no entities but those of XML";
/// Of text that is in no element.
const NO_TEXT: &str = "expected an element, found text outside of one";

/// Reads one document. Each element and attribute takes one from `budget`.
///
/// # Errors
/// The first fault, with its place.
pub(crate) fn read(bytes: &[u8], source: u32, budget: &mut usize) -> Result<Element, Fault> {
    let start = Place { source, line: 1, column: 1 };
    if bytes.len() > MAX_BYTES {
        let (limit, found) = (MAX_BYTES >> 20, bytes.len());
        return Err(Fault::at_place(start, format!("expected at most {limit} MiB of text, found {found} bytes")));
    }
    let text = decoded(bytes).map_err(|(before, message)| {
        let mut cursor = Cursor::new(&before, source);
        Fault::at_place(cursor.place(before.len()), message)
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    Builder { text, source, cursor: Cursor::new(text, source), open: Vec::new(), root: None, replaced: None, budget }
        .build()
}

/// What `bytes` say: in UTF-16 or ISO 8859-1 where they begin as such a file does (XML 1.0, appendix F), else in UTF-8. A fault comes
/// with the text before it.
fn decoded(bytes: &[u8]) -> Result<Cow<'_, str>, (String, String)> {
    let from_pair = match bytes {
        [0xff, 0xfe, ..] | [b'<', 0, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] | [0, b'<', ..] => u16::from_be_bytes,
        // Its characters are the first 256 of Unicode.
        _ if is_latin1(bytes) => return Ok(bytes.iter().map(|&byte| char::from(byte)).collect()),
        _ => {
            return str::from_utf8(bytes).map(Cow::Borrowed).map_err(|error| {
                let (before, after) = bytes.split_at(error.valid_up_to());
                let message = format!("expected text in UTF-8, found the byte 0x{:02x}", after[0]);
                (String::from_utf8_lossy(before).into_owned(), message)
            });
        }
    };
    let (pairs, rest) = bytes.as_chunks();
    let mut text = String::with_capacity(bytes.len() / 2);
    for c in char::decode_utf16(pairs.iter().map(|&pair| from_pair(pair))) {
        match c {
            Ok(c) => text.push(c),
            Err(error) => {
                let half = error.unpaired_surrogate();
                return Err((text, format!("expected text in UTF-16, found 0x{half:04x}, half of a character")));
            }
        }
    }
    match rest {
        [] => Ok(text.into()),
        _ => Err((text, "expected text in UTF-16, found an odd number of bytes".to_owned())),
    }
}

/// Whether the declaration of a document says that it is in ISO 8859-1.
fn is_latin1(bytes: &[u8]) -> bool {
    let declaration = bytes.strip_prefix(b"<?xml").and_then(|rest| rest.split(|&byte| byte == b'>').next());
    let value = declaration.and_then(|declaration| {
        let (_, after) = str::from_utf8(declaration).ok()?.split_once("encoding")?;
        after.trim_start().strip_prefix('=')?.trim_start().strip_prefix(['"', '\''])?.split(['"', '\'']).next()
    });
    value.is_some_and(|value| ["iso-8859-1", "latin1"].iter().any(|name| name.eq_ignore_ascii_case(value)))
}

/// Counts lines and columns up to offsets that mostly grow.
struct Cursor<'a> {
    text: &'a str,
    offset: usize,
    place: Place,
}

impl<'a> Cursor<'a> {
    fn new(text: &'a str, source: u32) -> Cursor<'a> {
        Cursor { text, offset: 0, place: Place { source, line: 1, column: 1 } }
    }

    /// The place of the character at `offset`.
    fn place(&mut self, offset: usize) -> Place {
        if offset < self.offset {
            *self = Cursor::new(self.text, self.place.source);
        }
        let end = self.text.len().min(offset);
        for c in self.text.get(self.offset..end).unwrap_or("").chars() {
            if c == '\n' {
                self.place.line += 1;
                self.place.column = 1;
            } else {
                self.place.column += 1;
            }
        }
        self.offset = self.offset.max(end);
        self.place
    }
}

struct Builder<'a, 'b> {
    text: &'a str,
    source: u32,
    cursor: Cursor<'a>,
    /// Elements that are not closed yet, outermost first.
    open: Vec<Element>,
    root: Option<Element>,
    /// Between `<?abbe instead …?>` and `<?abbe end?>`.
    replaced: Option<Replaced>,
    budget: &'b mut usize,
}

impl<'a> Builder<'a, '_> {
    fn build(mut self) -> Result<Element, Fault> {
        let mut reader = Reader::from_str(self.text);
        loop {
            match reader.read_event() {
                Ok(Event::Start(tag)) => self.start(&tag, Closing::Later)?,
                Ok(Event::Empty(tag)) => self.start(&tag, Closing::Now)?,
                Ok(Event::End(_)) => self.end(),
                Ok(Event::PI(instruction)) => {
                    let at = self.offset_of(&instruction);
                    self.instruction(&instruction, at)?;
                }
                // The mere name of a type says nothing.
                Ok(Event::DocType(kind)) if kind.contains('[') => {
                    let at = self.offset_of(&kind);
                    let message = "expected no document type with declarations, found <!DOCTYPE … […]>: entities are not expanded";
                    return Err(self.fault(at, message));
                }
                Ok(Event::Eof) => break,
                Ok(Event::Text(text)) if self.open.is_empty() && !blank(&text) => {
                    let at = self.offset_of(&text);
                    return Err(self.fault(at, NO_TEXT));
                }
                Ok(Event::GeneralRef(name)) => self.reference(&name)?,
                // What stands between elements means nothing to a scene.
                Ok(_) => {}
                Err(error) => {
                    let at = usize::try_from(reader.error_position()).unwrap_or(usize::MAX);
                    return Err(self.fault(at, format!("expected XML, found a fault of syntax: {error}")));
                }
            }
        }
        if let Some(replaced) = &self.replaced {
            return Err(Fault::at_place(replaced.place, "expected <?abbe end?> further on, found none"));
        }
        if let Some(element) = self.open.last() {
            let message = format!("expected </{}>, found the end of the text", element.tag);
            return Err(Fault::at_place(element.place, message));
        }
        let start = Place { source: self.source, line: 1, column: 1 };
        self.root.ok_or_else(|| Fault::at_place(start, "expected the element <scene>, found none"))
    }

    /// Where `slice`, a part of the text, begins.
    fn offset_of(&self, slice: &str) -> usize {
        (slice.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize).min(self.text.len())
    }

    fn fault(&mut self, offset: usize, message: impl Into<String>) -> Fault {
        Fault::at_place(self.cursor.place(offset), message)
    }

    fn charge(&mut self, at: usize) -> Result<(), Fault> {
        match self.budget.checked_sub(1) {
            Some(rest) => {
                *self.budget = rest;
                Ok(())
            }
            None => {
                Err(self.fault(at, format!("expected at most {MAX_NODES} elements and attributes in all, found more")))
            }
        }
    }

    fn start(&mut self, tag: &BytesStart<'a>, closing: Closing) -> Result<(), Fault> {
        let at = self.offset_of(tag).saturating_sub(1);
        let place = self.cursor.place(at);
        self.charge(at)?;
        if self.root.is_some() {
            return Err(Fault::at_place(place, "expected one element around all others, found a second"));
        }
        if self.open.len() >= MAX_DEPTH {
            return Err(Fault::at_place(place, format!("expected at most {MAX_DEPTH} levels of nesting, found more")));
        }
        let name = tag.name().into_inner().to_owned();
        let mut attributes = Vec::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|error| {
                Fault::at_place(
                    place,
                    format!("expected attributes of the form name=\"value\" in <{name}>, found: {error}"),
                )
            })?;
            let raw: &str = &attribute.value;
            let at = self.offset_of(raw);
            self.charge(at)?;
            let place = self.cursor.place(at);
            // A line end within an attribute is a blank, unless it is written as an entity.
            let blank = raw.replace(['\n', '\r', '\t'], " ");
            let value =
                unescape(&blank).map_err(|_| Fault::at_place(place, format!("{NO_ENTITIES}, found {}", quote(raw))))?;
            let name = attribute.key.into_inner().to_owned();
            attributes.push(Attribute { name, value: value.into_owned(), place });
        }
        self.open.push(Element { tag: name, place, attributes, children: Vec::new() });
        if let Closing::Now = closing {
            self.end();
        }
        Ok(())
    }

    /// `&name;` between elements.
    fn reference(&mut self, name: &str) -> Result<(), Fault> {
        let at = self.offset_of(name).saturating_sub(1);
        let written = format!("&{name};");
        if unescape(&written).is_err() {
            return Err(self.fault(at, format!("{NO_ENTITIES}, found {}", quote(&written))));
        }
        match self.open.is_empty() {
            true => Err(self.fault(at, NO_TEXT)),
            false => Ok(()),
        }
    }

    /// `<?abbe …?>`; those of other programs say nothing here.
    fn instruction(&mut self, text: &str, at: usize) -> Result<(), Fault> {
        let Some(text) = text.strip_prefix("abbe").filter(|rest| rest.starts_with(char::is_whitespace)) else {
            return Ok(());
        };
        let place = self.cursor.place(at);
        self.charge(at)?;
        let text = text.trim();
        let element = |tag: &str, yaml: &str| {
            let yaml = Attribute { name: YAML.to_owned(), value: yaml.to_owned(), place };
            Element { tag: tag.to_owned(), place, attributes: vec![yaml], children: Vec::new() }
        };
        if text == "end" {
            match &mut self.replaced {
                Some(replaced) if replaced.nested > 0 => replaced.nested -= 1,
                Some(replaced) if replaced.level == self.open.len() => self.replaced = None,
                _ => return Err(Fault::at_place(place, "expected <?abbe instead …?> before, found <?abbe end?>")),
            }
            return Ok(());
        }
        if let Some(replaced) = &mut self.replaced {
            replaced.nested += usize::from(text.starts_with("instead "));
            return Ok(());
        }
        let made = if let Some(setting) = text.strip_prefix("set ") {
            element(SET, setting)
        } else if let Some((tag, yaml)) = text.strip_prefix("instead ").and_then(|rest| rest.split_once(':')) {
            self.replaced = Some(Replaced { level: self.open.len(), nested: 0, place });
            element(tag.trim(), yaml.trim())
        } else {
            let message = format!("expected set, instead or end after <?abbe, found {}", quote(text));
            return Err(Fault::at_place(place, message));
        };
        match self.open.last_mut() {
            Some(parent) => parent.children.push(made),
            None => return Err(Fault::at_place(place, "expected <?abbe …?> inside an element, found it outside")),
        }
        Ok(())
    }

    fn end(&mut self) {
        // The reader has checked that it closes what was opened.
        let Some(element) = self.open.pop() else { return };
        let level = self.open.len();
        if self.replaced.as_ref().is_some_and(|replaced| replaced.level == level)
            && let Some(parent) = self.open.last_mut()
        {
            // Its id is kept, for those who refer to it, and its name, for what it is in.
            if let Some(made) = parent.children.last_mut() {
                for key in ["id", "name"] {
                    let kept = element.attribute(key).filter(|_| made.attribute(key).is_none()).cloned();
                    made.attributes.extend(kept);
                }
            }
            return;
        }
        match self.open.last_mut() {
            Some(parent) => parent.children.push(element),
            None => self.root = Some(element),
        }
    }
}

/// Elements that stand for something that Mitsuba cannot express.
struct Replaced {
    /// How many elements are open around them.
    level: usize,
    /// Such stretches inside this one.
    nested: usize,
    place: Place,
}

enum Closing {
    /// `<a>`
    Later,
    /// `<a/>`
    Now,
}

fn blank(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_whitespace())
}

#[cfg(test)]
mod tests {
    use super::super::super::node::Sources;
    use super::*;
    use std::path::Path;

    fn fault(text: &str) -> String {
        let mut sources = Sources::default();
        let source = sources.add_file(Path::new("s.xml"));
        match read(text.as_bytes(), source, &mut { MAX_NODES }) {
            Ok(_) => "none".to_owned(),
            Err(fault) => fault.write(&sources),
        }
    }

    #[test]
    fn elements_and_attributes_know_their_places() {
        let text = "<?xml version='1.0'?>\n<!-- é --><scene version=\"3.0.0\">\n  <float name='a&lt;b' value=\"&#50;\"/>\n</scene>\n";
        let root = read(text.as_bytes(), 0, &mut { MAX_NODES }).unwrap();
        assert_eq!((root.place.line, root.place.column), (2, 11));
        let float = &root.children[0];
        assert_eq!((float.tag.as_str(), float.place.line, float.place.column), ("float", 3, 3));
        assert_eq!(float.attribute("name").unwrap().value, "a<b");
        let value = float.attribute("value").unwrap();
        assert_eq!((value.value.as_str(), value.place.line, value.place.column), ("2", 3, 31));
        // XML 1.0, section 3.3.3.
        let ends = read(b"<a b='1\n2&#10;3\t4'/>", 0, &mut { MAX_NODES }).unwrap();
        assert_eq!(ends.attribute("b").unwrap().value, "1 2\n3 4");
    }

    /// Windows' own programs, and those of the years of Mitsuba 0.5, write such files. Mitsuba 3.9.1 reads all of them.
    #[test]
    fn text_may_be_in_utf_16_or_latin_1() {
        let text = |encoding: &str| format!("<?xml version='1.0' encoding='{encoding}'?>\n<a b='\u{e9}'>\n <c/></a>");
        let pairs = |text: &str, from: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(from).collect::<Vec<u8>>();
        let mut files = Vec::new();
        for mark in ["\u{feff}", ""] {
            files.extend(
                [u16::to_le_bytes, u16::to_be_bytes].map(|from| pairs(&(mark.to_owned() + &text("UTF-16")), from)),
            );
        }
        for name in ["ISO-8859-1", "latin1"] {
            files.push(text(name).chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect());
        }
        files.push(text("utf-8").into_bytes());
        for file in files {
            let root = read(&file, 0, &mut { MAX_NODES }).unwrap();
            assert_eq!(root.attribute("b").unwrap().value, "\u{e9}", "{file:?}");
            assert_eq!((root.children[0].place.line, root.children[0].place.column), (3, 2), "{file:?}");
        }
        let wrong = |bytes: &[u8]| {
            let mut sources = Sources::default();
            let source = sources.add_file(Path::new("s.xml"));
            read(bytes, source, &mut { MAX_NODES }).unwrap_err().write(&sources)
        };
        let half = pairs("<a>\n ", u16::to_le_bytes).into_iter().chain([0x3d, 0xd8, b'x', 0]).collect::<Vec<u8>>();
        assert_eq!(wrong(&half), "s.xml:2:2: expected text in UTF-16, found 0xd83d, half of a character");
        assert_eq!(wrong(b"<\0a\0>"), "s.xml:1:3: expected text in UTF-16, found an odd number of bytes");
        assert_eq!(wrong(b"<a>\n\xe9"), "s.xml:2:1: expected text in UTF-8, found the byte 0xe9");
    }

    #[test]
    fn what_is_not_xml_is_one_fault_at_its_place() {
        assert_eq!(fault("<scene>\n  <shape>\n"), "s.xml:2:3: expected </shape>, found the end of the text");
        assert!(fault("<scene>\n  <shape").starts_with("s.xml:2:3: expected XML, found a fault of syntax: "));
        assert!(fault("<scene>\n</shape>").starts_with("s.xml:2:1: expected XML, found a fault of syntax: "));
        assert_eq!(fault(""), "s.xml:1:1: expected the element <scene>, found none");
        assert_eq!(fault("<a/>\n<b/>"), "s.xml:2:1: expected one element around all others, found a second");
        assert_eq!(fault("a: 1"), "s.xml:1:1: expected an element, found text outside of one");
        assert_eq!(fault("<a>\n <b c='&d;'/></a>"), "s.xml:2:8: expected no entities but those of XML, found \"&d;\"");
        assert!(
            fault("<a b='1' b='2'/>").starts_with("s.xml:1:1: expected attributes of the form name=\"value\" in <a>")
        );
    }

    #[test]
    fn entities_between_elements_are_those_of_xml_too() {
        assert_eq!(fault("<a>\n b &d; <c/></a>"), "s.xml:2:4: expected no entities but those of XML, found \"&d;\"");
        assert_eq!(fault("<a/>&#x110000;"), "s.xml:1:5: expected no entities but those of XML, found \"&#x110000;\"");
        assert_eq!(fault("<a/>\n&amp;"), "s.xml:2:1: expected an element, found text outside of one");
        assert_eq!(fault("<a>&amp; &#50;</a>"), "none");
    }

    #[test]
    fn entities_are_not_expanded() {
        assert_eq!(fault("<!DOCTYPE a>\n<a/>"), "none");
        let bomb = "<!DOCTYPE a [<!ENTITY b \"bbbbbbbb\"><!ENTITY c \"&b;&b;&b;&b;\">]>\n<a d='&c;'/>";
        assert_eq!(
            fault(bomb),
            "s.xml:1:11: expected no document type with declarations, found <!DOCTYPE … […]>: entities are not expanded"
        );
    }

    #[test]
    fn a_million_nested_elements_are_one_fault() {
        let text = "<a>".repeat(1_000_000);
        assert_eq!(fault(&text), "s.xml:1:193: expected at most 64 levels of nesting, found more");
    }
}
