//! Faults: what is wrong, with what was written, and where.
//!
//! A fault reads `file:line:column: field.path: expected …, found …; did you mean "…"?`.

use std::collections::BTreeSet;
use std::fmt;

use serde::de::{Expected, Unexpected};

use super::material::Material;
use super::node::{Node, Place, Sources, Value, did_you_mean, enumerate, quote};
use super::path::{self, At, Segment};
use crate::error::{Error, in_short, one_line};

/// One thing wrong with a document.
#[derive(Clone, Debug)]
pub(crate) struct Fault {
    /// Where, once known.
    pub(crate) place: Option<Place>,
    /// The field, innermost step first while a fault travels outward.
    steps: Vec<Segment>,
    /// What is wrong.
    message: Message,
}

#[derive(Clone, Debug)]
enum Message {
    Text(String),
    /// None of what may stand here; kept apart because an outer choice may add to that.
    NoneOf {
        expected: Vec<String>,
        /// In words.
        found: String,
        /// If it is a name, which may be misspelt.
        name: Option<String>,
    },
}

impl Fault {
    /// A fault at a known place.
    pub(crate) fn at_place(place: Place, message: impl Into<String>) -> Fault {
        Fault { place: Some(place), steps: Vec::new(), message: Message::Text(message.into()) }
    }

    /// `expected …, found …` about a node.
    pub(crate) fn expected(node: &Node, expected: impl fmt::Display) -> Fault {
        Fault::at_place(node.place, format!("expected {expected}, found {}", node.found()))
    }

    /// A name that is not among those that the grammar knows here.
    pub(crate) fn unknown<'a>(place: Place, found: &str, expected: impl IntoIterator<Item = &'a str>) -> Fault {
        let expected = expected.into_iter().map(str::to_owned).collect();
        let message = Message::NoneOf { expected, found: quote(found), name: Some(found.to_owned()) };
        Fault { place: Some(place), steps: Vec::new(), message }
    }

    /// A node that is none of what the grammar knows here.
    pub(crate) fn none_of<'a>(node: &Node, expected: impl IntoIterator<Item = &'a str>) -> Fault {
        let expected = expected.into_iter().map(str::to_owned).collect();
        let message = Message::NoneOf { expected, found: node.found(), name: None };
        Fault { place: Some(node.place), steps: Vec::new(), message }
    }

    /// Gives the place, unless a deeper one is known already.
    pub(crate) fn or_at(mut self, place: Place) -> Fault {
        self.place.get_or_insert(place);
        self
    }

    /// The same fault seen from one step further out.
    pub(crate) fn under(mut self, segment: Segment) -> Fault {
        self.steps.push(segment);
        self
    }

    /// The same fault seen from `path` further out.
    pub(crate) fn under_path(mut self, path: &[Segment]) -> Fault {
        self.steps.extend(path.iter().rev().cloned());
        self
    }

    /// Another word on the same field.
    pub(crate) fn saying(self, message: impl Into<String>) -> Fault {
        Fault { message: Message::Text(message.into()), ..self }
    }

    /// For a choice between forms: a fault at the choice itself could also have been cured by
    /// one of `others`. So could be a key that is none of its kinds, and nothing further in.
    pub(crate) fn or_one_of<'a>(mut self, others: impl IntoIterator<Item = &'a str>) -> Fault {
        if let Message::NoneOf { expected, name, .. } = &mut self.message
            && match &self.steps[..] {
                [] => true,
                [Segment::Key(key)] => Some(key) == name.as_ref(),
                _ => false,
            }
        {
            // Forms in words, as "a number", are read more easily before the others.
            let (forms, names): (Vec<_>, Vec<_>) = others.into_iter().partition(|other| other.starts_with("a "));
            expected.splice(0..0, forms.into_iter().map(str::to_owned));
            expected.extend(names.into_iter().map(str::to_owned));
        }
        self
    }

    /// A required field that is not there.
    fn missing(field: &str) -> Fault {
        serde::de::Error::custom(format!("expected the field {field:?}, found none"))
    }

    /// Whether it is that `field` is not there.
    pub(crate) fn misses(&self, field: &str) -> bool {
        self.steps.is_empty() && self.to_string() == Fault::missing(field).to_string()
    }

    /// Writes the fault on one line.
    pub(crate) fn write(&self, sources: &Sources) -> String {
        let place = self.place.map_or(String::new(), |place| format!("{}: ", sources.describe(place)));
        one_line(format!("{place}{}", self.told()))
    }

    /// The field and what is wrong.
    pub(crate) fn told(&self) -> String {
        let path = path::display(self.steps.iter().rev());
        let separator = if path.is_empty() { "" } else { ": " };
        format!("{path}{separator}{self}")
    }

    /// The fault as the error that ends the reading.
    pub(crate) fn into_error(self, sources: &Sources) -> Error {
        Error::Config(self.write(sources))
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.message {
            Message::Text(text) => f.write_str(text),
            Message::NoneOf { expected, found, name } => {
                let candidates = || expected.iter().map(String::as_str);
                let hint = name.as_deref().map_or(String::new(), |name| did_you_mean(name, candidates()));
                match expected.as_slice() {
                    [] => write!(f, "expected no field, found {found}"),
                    [only] => write!(f, "expected {only}, found {found}{hint}"),
                    all => write!(f, "expected one of {}, found {found}{hint}", all.join(", ")),
                }
            }
        }
    }
}

impl std::error::Error for Fault {}

impl serde::de::Error for Fault {
    fn custom<T: fmt::Display>(message: T) -> Fault {
        Fault { place: None, steps: Vec::new(), message: Message::Text(message.to_string()) }
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Fault {
        let found = match found {
            Unexpected::Bool(value) => value.to_string(),
            Unexpected::Unsigned(value) => value.to_string(),
            Unexpected::Signed(value) => value.to_string(),
            Unexpected::Float(value) => format!("{value:?}"),
            Unexpected::Str(text) => format!("the text {}", quote(text)),
            Unexpected::Unit | Unexpected::Option => "nothing".to_owned(),
            Unexpected::Seq => "a list".to_owned(),
            Unexpected::Map => "a map".to_owned(),
            other => other.to_string(),
        };
        Fault::custom(format!("expected {expected}, found {found}"))
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Fault {
        Fault::invalid_type(found, expected)
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Fault {
        let mut fault = Fault::unknown(Place::default(), field, expected.iter().copied());
        fault.place = None;
        fault
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Fault {
        Fault::unknown_field(variant, expected)
    }

    fn missing_field(field: &'static str) -> Fault {
        Fault::missing(field)
    }

    fn duplicate_field(field: &'static str) -> Fault {
        Fault::custom(format!("expected {field:?} once, found it twice"))
    }
}

/// What a fault can have found.
pub(crate) trait Found {
    /// For the end of "expected …, found …".
    fn in_words(&self) -> String;
}

impl Found for f64 {
    fn in_words(&self) -> String {
        in_short(*self)
    }
}

/// A point, a vector or a row, as it is written.
impl<const N: usize> Found for [f64; N] {
    fn in_words(&self) -> String {
        format!("[{}]", self.map(in_short).join(", "))
    }
}

macro_rules! found_as_displayed {
    ($($type:ty),*) => {$(
        impl Found for $type {
            fn in_words(&self) -> String {
                self.to_string()
            }
        }
    )*};
}

found_as_displayed!(&str, String, u32, usize, fmt::Arguments<'_>, std::path::Display<'_>);

/// The most faults that are told at once; the rest are counted.
const MAX_FAULTS: usize = 100;

/// The faults of one validation, and the names that references may use.
pub(crate) struct Checker<'a> {
    root: &'a Node,
    faults: Vec<Fault>,
    untold: usize,
    /// Names under `materials`.
    pub(crate) materials: BTreeSet<&'a str>,
    /// Names under `textures`.
    pub(crate) textures: BTreeSet<&'a str>,
    /// Names under `media`.
    pub(crate) media: BTreeSet<&'a str>,
    /// Names under `volumes`.
    pub(crate) volumes: BTreeSet<&'a str>,
    /// Volumes that were seen in the place of a reflectance.
    pub(crate) reflecting_volumes: BTreeSet<&'a str>,
    /// Names under `groups`.
    pub(crate) groups: BTreeSet<&'a str>,
    /// Textures that were seen in the place of a reflectance.
    pub(crate) reflecting_textures: BTreeSet<&'a str>,
}

impl<'a> Checker<'a> {
    pub(crate) fn new(root: &'a Node) -> Checker<'a> {
        Checker {
            root,
            faults: Vec::new(),
            untold: 0,
            materials: BTreeSet::new(),
            textures: BTreeSet::new(),
            media: BTreeSet::new(),
            groups: BTreeSet::new(),
            reflecting_textures: BTreeSet::new(),
            volumes: BTreeSet::new(),
            reflecting_volumes: BTreeSet::new(),
        }
    }

    /// Records a fault of the field `at`.
    pub(crate) fn fault(&mut self, at: At<'_>, message: impl Into<String>) {
        if self.faults.len() == MAX_FAULTS {
            self.untold += 1;
            return;
        }
        let steps = at.segments();
        let place = self.root.locate(&steps);
        self.faults.push(Fault::at_place(place, message).under_path(&steps));
    }

    /// What is written in the field `at`, in words.
    pub(crate) fn written(&self, at: At<'_>) -> String {
        self.root.find(&at.segments()).map_or_else(|| "nothing".to_owned(), Node::found)
    }

    /// Whether the field `at` is written; one without value is not.
    pub(crate) fn is_written(&self, at: At<'_>) -> bool {
        self.root.find(&at.segments()).is_some_and(|node| !matches!(node.value, Value::Null))
    }

    /// Faults so far.
    pub(crate) fn count(&self) -> usize {
        self.faults.len() + self.untold
    }

    /// Records a fault unless `holds`.
    pub(crate) fn require(&mut self, holds: bool, at: At<'_>, expected: &str, found: impl Found) {
        if !holds {
            self.fault(at, format!("expected {expected}, found {}", found.in_words()));
        }
    }

    /// `found` is greater than zero.
    pub(crate) fn positive(&mut self, at: At<'_>, found: f64) {
        self.require(found > 0.0, at, "a number greater than 0", found);
    }

    /// `found` is zero or more.
    pub(crate) fn not_negative(&mut self, at: At<'_>, found: f64) {
        self.require(found >= 0.0, at, "a number of 0 or more", found);
    }

    /// `found` lies from `least` to `most`.
    pub(crate) fn whole_between(&mut self, at: At<'_>, found: u32, least: u32, most: u32) {
        if !(least..=most).contains(&found) {
            self.fault(at, format!("expected a whole number from {least} to {most}, found {found}"));
        }
    }

    /// `found` is one or more.
    pub(crate) fn at_least_one(&mut self, at: At<'_>, found: u32) {
        self.require(found >= 1, at, "a whole number of 1 or more", found);
    }

    /// The vector has a direction.
    pub(crate) fn direction(&mut self, at: At<'_>, found: [f64; 3]) {
        self.require(found != [0.0; 3], at, "a vector with a direction", "[0, 0, 0]");
    }

    /// `name` is among the materials.
    pub(crate) fn material(&mut self, at: At<'_>, name: &str) {
        if let Some(hint) = unknown(name, &self.materials, self.untold) {
            let kind = Material::KINDS.contains(&name);
            let hint = if kind { format!("; the kind is written {{{name}: {{…}}}}") } else { hint };
            self.fault(at, format!("unknown material {}{hint}", quote(name)));
        }
    }

    /// `name` is among the textures.
    pub(crate) fn texture(&mut self, at: At<'_>, name: &str) {
        if let Some(hint) = unknown(name, &self.textures, self.untold) {
            self.fault(at, format!("unknown texture {}{hint}", quote(name)));
        }
    }

    /// `name` is among the volumes.
    pub(crate) fn volume(&mut self, at: At<'_>, name: &str) {
        if let Some(hint) = unknown(name, &self.volumes, self.untold) {
            self.fault(at, format!("unknown volume {}{hint}", quote(name)));
        }
    }

    /// `name` is among the media.
    pub(crate) fn medium(&mut self, at: At<'_>, name: &str) {
        if let Some(hint) = unknown(name, &self.media, self.untold) {
            self.fault(at, format!("unknown medium {}{hint}", quote(name)));
        }
    }

    /// `name` is among the groups.
    pub(crate) fn group(&mut self, at: At<'_>, name: &str) {
        if let Some(hint) = unknown(name, &self.groups, self.untold) {
            self.fault(at, format!("unknown group {}{hint}", quote(name)));
        }
    }

    /// `name` is among `names` of things of this kind.
    pub(crate) fn known(&mut self, at: At<'_>, kind: &str, name: &str, names: &BTreeSet<&str>) {
        if let Some(hint) = unknown(name, names, self.untold) {
            self.fault(at, format!("unknown {kind} {}{hint}", quote(name)));
        }
    }

    /// Nothing, or all faults in the order of the text.
    ///
    /// # Errors
    /// [`Error::Config`] with one line for each fault.
    pub(crate) fn finish(mut self, sources: &Sources) -> Result<(), Error> {
        if self.faults.is_empty() {
            return Ok(());
        }
        self.faults.sort_by_key(|fault| fault.place);
        let mut lines: Vec<String> = self.faults.iter().map(|fault| fault.write(sources)).collect();
        if self.untold > 0 {
            lines.push(format!("and {} more", self.untold));
        }
        Err(Error::Config(lines.join("\n")))
    }
}

/// What to add to "unknown …", if `name` is not among `known`.
fn unknown(name: &str, known: &BTreeSet<&str>, untold: usize) -> Option<String> {
    if known.contains(name) {
        return None;
    }
    if untold > 0 {
        // Nobody will read it; a near miss among many names takes time.
        return Some(String::new());
    }
    let near = did_you_mean(name, known.iter().copied());
    Some(if !near.is_empty() {
        near
    } else if known.is_empty() {
        "; the scene defines none".to_owned()
    } else {
        format!("; known: {}", enumerate(known.iter().copied()))
    })
}
