//! Field paths: how a fault names a field, and how `set` finds one.
//!
//! `shapes[3].sphere.radius` is a key, an index, a key, a key. A key that itself holds a dot, a
//! bracket, a quote or a space stands in double quotes: `materials."dark red".diffuse`.

use std::fmt;

/// One step of a path, from a node to a node inside it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Segment {
    /// Into a map.
    Key(String),
    /// Into a list, counted from zero.
    Index(usize),
}

/// Writes a path as a person would type it.
pub(crate) fn display<'a>(segments: impl IntoIterator<Item = &'a Segment>) -> String {
    let mut text = String::new();
    for segment in segments {
        match segment {
            Segment::Key(key) => push_key(&mut text, key),
            Segment::Index(index) => text.push_str(&format!("[{index}]")),
        }
    }
    text
}

/// The path of a field within maps.
pub(crate) fn field(keys: &[&str]) -> String {
    let keys: Vec<Segment> = keys.iter().map(|key| Segment::Key((*key).to_owned())).collect();
    display(&keys)
}

fn push_key(text: &mut String, key: &str) {
    if !text.is_empty() {
        text.push('.');
    }
    let plain = !key.is_empty() && !key.contains(|c: char| ".[]\"\\".contains(c) || c.is_whitespace());
    if plain {
        text.push_str(key);
    } else {
        text.push('"');
        for c in key.chars() {
            match c {
                '"' | '\\' => text.extend(['\\', c]),
                c if c.is_control() => text.extend(c.escape_default()),
                c => text.push(c),
            }
        }
        text.push('"');
    }
}

/// Reads a path; the inverse of [`display`].
///
/// # Errors
/// What was expected and found, in words.
pub(crate) fn parse(text: &str) -> Result<Vec<Segment>, String> {
    let mut segments = Vec::new();
    let mut rest = text;
    while !rest.is_empty() || segments.is_empty() {
        if let Some(after) = rest.strip_prefix('[') {
            let (digits, tail) = after
                .split_once(']')
                .ok_or_else(|| format!("expected a path such as shapes[2].sphere, found {text:?} without \"]\""))?;
            let index = digits
                .parse()
                .map_err(|_| format!("expected a whole number in the brackets of {text:?}, found {digits:?}"))?;
            segments.push(Segment::Index(index));
            rest = tail;
        } else {
            // Between keys stands a dot; before the first there is none.
            if !segments.is_empty() {
                rest = rest
                    .strip_prefix('.')
                    .ok_or_else(|| format!("expected \".\" or \"[\" before {rest:?} in the path {text:?}"))?;
            }
            let (key, tail) = take_key(rest, text)?;
            segments.push(Segment::Key(key));
            rest = tail;
        }
    }
    Ok(segments)
}

fn take_key<'a>(rest: &'a str, whole: &str) -> Result<(String, &'a str), String> {
    let Some(quoted) = rest.strip_prefix('"') else {
        let end = rest.find(['.', '[']).unwrap_or(rest.len());
        if end == 0 {
            return Err(format!("expected a path such as render.samples, found {whole:?} with an empty part"));
        }
        return Ok((rest[..end].to_owned(), &rest[end..]));
    };
    let mut key = String::new();
    let mut chars = quoted.char_indices();
    while let Some((i, c)) = chars.next() {
        match c {
            '"' => return Ok((key, &quoted[i + 1..])),
            '\\' => match chars.next() {
                Some((_, 't')) => key.push('\t'),
                Some((_, 'n')) => key.push('\n'),
                Some((_, 'r')) => key.push('\r'),
                // \u{7}
                Some((_, 'u')) => {
                    let written = chars.by_ref().map(|(_, c)| c).take_while(|c| *c != '}');
                    let digits: String = written.filter(|c| *c != '{').collect();
                    key.extend(u32::from_str_radix(&digits, 16).ok().and_then(char::from_u32));
                }
                other => key.extend(other.map(|(_, c)| c)),
            },
            c => key.push(c),
        }
    }
    Err(format!("expected a closing quote in the path {whole:?}, found none"))
}

/// A path under construction during a walk: cheap to extend, written out only when a fault
/// needs it.
#[derive(Clone, Copy)]
pub(crate) struct At<'a> {
    parent: Option<&'a At<'a>>,
    step: Step<'a>,
}

#[derive(Clone, Copy)]
enum Step<'a> {
    Root,
    Key(&'a str),
    Index(usize),
}

impl<'a> At<'a> {
    pub(crate) const ROOT: At<'static> = At { parent: None, step: Step::Root };

    pub(crate) fn key(&'a self, key: &'a str) -> At<'a> {
        At { parent: Some(self), step: Step::Key(key) }
    }

    pub(crate) fn index(&'a self, index: usize) -> At<'a> {
        At { parent: Some(self), step: Step::Index(index) }
    }

    /// The steps from the root to here.
    pub(crate) fn segments(&self) -> Vec<Segment> {
        let mut segments = Vec::new();
        self.collect(&mut segments);
        segments
    }

    fn collect(&self, segments: &mut Vec<Segment>) {
        if let Some(parent) = self.parent {
            parent.collect(segments);
        }
        match self.step {
            Step::Root => {}
            Step::Key(key) => segments.push(Segment::Key(key.to_owned())),
            Step::Index(index) => segments.push(Segment::Index(index)),
        }
    }
}

impl fmt::Display for At<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&display(&self.segments()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_path_is_keys_and_indices() {
        let parsed = parse("shapes[3].sphere.\"dark red\"").unwrap();
        let key = |k: &str| Segment::Key(k.to_owned());
        assert_eq!(parsed, [key("shapes"), Segment::Index(3), key("sphere"), key("dark red")]);
        let list = At::ROOT.key("shapes");
        assert_eq!(list.index(3).key("sphere").to_string(), "shapes[3].sphere");
        let controls = [key("a\tb\n"), key("\u{7} b")];
        assert_eq!(display(&controls), "\"a\\tb\\n\".\"\\u{7} b\"");
        assert_eq!(parse(&display(&controls)).unwrap(), controls);
    }

    #[test]
    fn a_broken_path_is_refused_in_words() {
        let says = |text: &str| parse(text).unwrap_err();
        assert_eq!(says(""), "expected a path such as render.samples, found \"\" with an empty part");
        assert_eq!(says("a..b"), "expected a path such as render.samples, found \"a..b\" with an empty part");
        assert_eq!(says("a[x]"), "expected a whole number in the brackets of \"a[x]\", found \"x\"");
        assert_eq!(says("a[1"), "expected a path such as shapes[2].sphere, found \"a[1\" without \"]\"");
        assert_eq!(says("a[1]b"), "expected \".\" or \"[\" before \"b\" in the path \"a[1]b\"");
        assert_eq!(says("\"a"), "expected a closing quote in the path \"\\\"a\", found none");
    }

    proptest! {
        #[test]
        fn reading_undoes_writing(keys in prop::collection::vec(("(?s:.){0,6}", 0usize..9), 1..5)) {
            let segments: Vec<Segment> =
                keys.into_iter().flat_map(|(key, index)| [Segment::Key(key), Segment::Index(index)]).collect();
            prop_assert_eq!(parse(&display(&segments)).unwrap(), segments);
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".{0,40}") {
            let _ = parse(&text);
        }
    }
}
