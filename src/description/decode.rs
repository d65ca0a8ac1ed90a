//! A [`Node`] tree to the types of the grammar: a serde deserializer that knows places.
//!
//! Conventions that the grammar rests on:
//! - a field whose value is null (`fog:` or `fog: ~`) is not written;
//! - an enum is a map with one key, the kind: `sphere: {radius: 1}`; a kind whose fields all have
//!   defaults may stand alone as text: `filter: gaussian`;
//! - a variant may also be chosen by the form of the value: a variant renamed `number`, `list`,
//!   `name` or `text` takes a bare number, list or text (a name, or other text); a variant renamed
//!   `inline` takes whatever the other variants do not;
//! - a [`FilePath`](super::FilePath) starts from the directory of the text in which it stands.

use std::fmt;

use serde::de::value::{BytesDeserializer, StrDeserializer};
use serde::de::{self, DeserializeOwned, DeserializeSeed, Deserializer, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;

use super::fault::Fault;
use super::node::{Entry, Node, Place, Sources, Value, enumerate, not_finite};
use super::path::Segment;

/// Names of variants that are chosen by form, and what they are called in a message.
const BY_FORM: [(&str, &str); 6] = [
    ("number", "a number"),
    ("boolean", "true or false"),
    ("list", "a list"),
    ("name", "a name"),
    ("text", "text"),
    ("inline", ""),
];

/// The name by which [`super::FilePath`] asks for its treatment.
pub(crate) const FILE_PATH: &str = "FilePath";

/// Reads a value of the grammar.
///
/// # Errors
/// The first fault, with its place.
pub(crate) fn decode<T: DeserializeOwned>(node: &Node, sources: &Sources) -> Result<T, Fault> {
    T::deserialize(De { node, sources }).map_err(|fault| fault.or_at(node.place))
}

/// For `deserialize_with`: a whole number that is to lie from `LEAST` to `MOST`, as is told of what is no `u32`. Of the others
/// [`Checker::whole_between`](super::fault::Checker::whole_between) tells it, together with all other faults.
pub(crate) fn whole<'de, D: Deserializer<'de>, const LEAST: u32, const MOST: u32>(de: D) -> Result<u32, D::Error> {
    de.deserialize_u32(Whole(format!("a whole number from {LEAST} to {MOST}")))
}

/// [`whole`] of a field that need not be there, with `serde(default)`.
pub(crate) fn whole_or_none<'de, D: Deserializer<'de>, const LEAST: u32, const MOST: u32>(
    de: D,
) -> Result<Option<u32>, D::Error> {
    whole::<D, LEAST, MOST>(de).map(Some)
}

/// Takes a `u32`, and says what it is to be.
pub(crate) struct Whole(pub(crate) String);

impl Visitor<'_> for Whole {
    type Value = u32;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<u32, E> {
        u32::try_from(value).map_err(|_| E::invalid_value(de::Unexpected::Unsigned(value), &self))
    }
}

#[derive(Clone, Copy)]
struct De<'a> {
    node: &'a Node,
    sources: &'a Sources,
}

impl<'a> De<'a> {
    fn child(self, node: &'a Node) -> De<'a> {
        De { node, sources: self.sources }
    }

    /// A whole number; `1e3` is one too.
    fn whole(self) -> Option<i128> {
        match self.node.value {
            Value::Unsigned(value) => Some(value.into()),
            Value::Signed(value) => Some(value.into()),
            // Below 2^53 a float names one whole number.
            Value::Float(value) if value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0 => {
                Some(value as i128)
            }
            _ => None,
        }
    }

    fn number(self) -> Result<f64, Fault> {
        let number = match &self.node.value {
            Value::Unsigned(value) => *value as f64,
            Value::Signed(value) => *value as f64,
            Value::Float(value) => *value,
            Value::Text(text) => match overflowing(text) {
                true => {
                    return Err(Fault::at_place(self.node.place, not_finite(text)));
                }
                false => return Err(Fault::expected(self.node, "a number")),
            },
            _ => return Err(Fault::expected(self.node, "a number")),
        };
        match number.is_finite() {
            true => Ok(number),
            false => Err(Fault::expected(self.node, "a finite number")),
        }
    }

    fn list(self, length: usize) -> Result<&'a [Node], Fault> {
        match &self.node.value {
            Value::List(items) if items.len() == length => Ok(items),
            Value::List(items) => {
                let message = format!("expected {length} values, found {}", items.len());
                Err(Fault::at_place(self.node.place, message))
            }
            _ => Err(Fault::expected(self.node, format_args!("a list of {length} values"))),
        }
    }
}

/// `1e999`: a number in writing, infinite in a double. YAML readers take it for text.
fn overflowing(text: &str) -> bool {
    let digits = text.trim_start_matches(['+', '-']);
    digits.starts_with(|c: char| c.is_ascii_digit() || c == '.') && text.parse().is_ok_and(|x: f64| x.is_infinite())
}

macro_rules! whole_numbers {
    ($($method:ident $visit:ident $type:ty),*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
            match self.whole().and_then(|whole| <$type>::try_from(whole).ok()) {
                Some(value) => visitor.$visit(value),
                None => {
                    // Serde's own visitors say no more than the name of the type.
                    let said = (&visitor as &dyn de::Expected).to_string();
                    let (least, most) = (<$type>::MIN, <$type>::MAX);
                    let range = || format!("a whole number from {least} to {most}");
                    Err(Fault::expected(self.node, if said == stringify!($type) { range() } else { said }))
                }
            }
        }
    )*};
}

impl<'de> Deserializer<'de> for De<'_> {
    type Error = Fault;

    whole_numbers!(
        deserialize_u8 visit_u8 u8, deserialize_u16 visit_u16 u16, deserialize_u32 visit_u32 u32,
        deserialize_u64 visit_u64 u64, deserialize_i8 visit_i8 i8, deserialize_i16 visit_i16 i16,
        deserialize_i32 visit_i32 i32, deserialize_i64 visit_i64 i64
    );

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_f64(self.number()?)
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.deserialize_f64(visitor)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.node.value {
            Value::Bool(value) => visitor.visit_bool(value),
            _ => Err(Fault::expected(self.node, "true or false")),
        }
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::Text(text) => visitor.visit_str(text),
            _ => Err(Fault::expected(self.node, "text")),
        }
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.deserialize_str(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.node.value {
            Value::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, Fault> {
        if name != FILE_PATH {
            return visitor.visit_newtype_struct(self);
        }
        match &self.node.value {
            Value::Text(text) if text.is_empty() => {
                Err(Fault::at_place(self.node.place, "expected the path of a file, found empty text"))
            }
            Value::Text(text) => {
                // Directories need not be UTF-8, so the path travels as bytes.
                let path = self.sources.file(self.node.place, text);
                visitor.visit_newtype_struct(BytesDeserializer::new(path.as_os_str().as_encoded_bytes()))
            }
            _ => Err(Fault::expected(self.node, "the path of a file")),
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::List(items) => visitor.visit_seq(Items { de: self, items: items.iter().enumerate() }),
            _ => Err(Fault::expected(self.node, "a list")),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_seq(Items { de: self, items: self.list(length)?.iter().enumerate() })
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::Map(entries) => visitor.visit_map(Entries::new(self, entries, Nulls::Kept)),
            _ => Err(Fault::expected(self.node, "a map of names")),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let Value::Map(entries) = &self.node.value else {
            let map = format!("a map with fields among {}", enumerate(fields.iter().copied()));
            return Err(Fault::none_of(self.node, [map.as_str()]));
        };
        if let Some(entry) = entries.iter().find(|entry| !fields.contains(&entry.key.as_str())) {
            let fault = Fault::unknown(entry.key_place, &entry.key, fields.iter().copied());
            return Err(fault.under(Segment::Key(entry.key.clone())));
        }
        visitor.visit_map(Entries::new(self, entries, Nulls::Skipped)).map_err(|fault| {
            // A field that is there without value was perhaps taken away by a setting, which then is what to look at.
            let is_empty = |entry: &&Entry| matches!(entry.node.value, Value::Null) && fault.misses(&entry.key);
            let place = entries.iter().find(is_empty).map_or(self.node.place, |entry| entry.node.place);
            fault.or_at(place)
        })
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let by_form = match &self.node.value {
            Value::Unsigned(_) | Value::Signed(_) | Value::Float(_) => "number",
            Value::Text(text) if variants.contains(&"number") && overflowing(text) => "number",
            Value::Text(_) if variants.contains(&"text") => "text",
            Value::Text(_) => "name",
            Value::Bool(_) => "boolean",
            Value::List(_) => "list",
            _ => "",
        };
        if variants.contains(&by_form) {
            return visitor.visit_enum(Choice { kind: by_form, content: Some(self.node), key: None, de: self });
        }
        let kinds = || variants.iter().copied().filter(|kind| BY_FORM.iter().all(|(form, _)| form != kind));
        let named = |name: &str| kinds().find(|&kind| kind == name);
        match &self.node.value {
            Value::Map(entries) if entries.len() == 1 && named(&entries[0].key).is_some() => {
                let entry = &entries[0];
                let content = Some(&entry.node).filter(|node| !matches!(node.value, Value::Null));
                visitor.visit_enum(Choice { kind: &entry.key, content, key: Some(entry), de: self })
            }
            Value::Text(text) if named(text).is_some() => {
                visitor.visit_enum(Choice { kind: text, content: None, key: None, de: self })
            }
            _ if variants.contains(&"inline") => visitor
                .visit_enum(Choice { kind: "inline", content: Some(self.node), key: None, de: self })
                .map_err(|fault| fault.or_one_of(kinds_in_words(variants))),
            Value::Map(entries) if entries.len() == 1 => {
                let Entry { key, key_place, .. } = &entries[0];
                Err(Fault::unknown(*key_place, key, kinds_in_words(variants)).under(Segment::Key(key.clone())))
            }
            Value::Text(text) => Err(Fault::unknown(self.node.place, text, kinds_in_words(variants))),
            Value::Map(entries) if entries.iter().any(|entry| named(&entry.key).is_some()) => {
                let keys = enumerate(entries.iter().map(|entry| entry.key.as_str()));
                let mut message = format!("expected one key, the kind, found {keys}");
                let kinds: Vec<&Entry> = entries.iter().filter(|entry| named(&entry.key).is_some()).collect();
                // The usual slip: fields that stand beside their kind, not under it. Another kind is no field, and a kind that
                // holds a list or a text has none.
                if let [kind] = kinds[..]
                    && matches!(kind.node.value, Value::Null | Value::Map(_))
                {
                    message += &format!("; fields of {} are indented under it", kind.key);
                }
                // What is too many, perhaps by a setting.
                let more = entries.iter().find(|entry| entry.key != kinds[0].key);
                Err(Fault::at_place(more.map_or(self.node.place, |entry| entry.key_place), message))
            }
            _ => Err(Fault::none_of(self.node, kinds_in_words(variants))),
        }
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_unit()
    }

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::Null => visitor.visit_unit(),
            Value::Bool(value) => visitor.visit_bool(*value),
            Value::Unsigned(value) => visitor.visit_u64(*value),
            Value::Signed(value) => visitor.visit_i64(*value),
            Value::Float(_) => self.deserialize_f64(visitor),
            Value::Text(text) => visitor.visit_str(text),
            Value::List(_) => self.deserialize_seq(visitor),
            Value::Map(_) => self.deserialize_map(visitor),
        }
    }

    forward_to_deserialize_any! {
        i128 u128 char bytes byte_buf unit unit_struct tuple_struct identifier
    }
}

/// What could have been written: forms first, in words.
fn kinds_in_words(variants: &'static [&'static str]) -> impl Iterator<Item = &'static str> {
    variants
        .iter()
        .map(|&kind| BY_FORM.iter().find(|(form, _)| *form == kind).map_or(kind, |(_, words)| words))
        .filter(|words| !words.is_empty())
}

/// The items of a list.
struct Items<'a, I> {
    de: De<'a>,
    items: I,
}

impl<'de, 'a, I: Iterator<Item = (usize, &'a Node)>> de::SeqAccess<'de> for Items<'a, I> {
    type Error = Fault;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Fault> {
        let Some((index, node)) = self.items.next() else { return Ok(None) };
        let value = seed.deserialize(self.de.child(node));
        value.map(Some).map_err(|fault| fault.or_at(node.place).under(Segment::Index(index)))
    }
}

/// What becomes of entries that are null.
#[derive(Clone, Copy, PartialEq)]
enum Nulls {
    Kept,
    Skipped,
}

/// The entries of a map.
struct Entries<'a> {
    de: De<'a>,
    entries: std::slice::Iter<'a, Entry>,
    nulls: Nulls,
    current: Option<&'a Entry>,
}

impl<'a> Entries<'a> {
    fn new(de: De<'a>, entries: &'a [Entry], nulls: Nulls) -> Entries<'a> {
        Entries { de, entries: entries.iter(), nulls, current: None }
    }
}

impl<'de> de::MapAccess<'de> for Entries<'_> {
    type Error = Fault;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Fault> {
        let skipped = |entry: &&Entry| self.nulls == Nulls::Skipped && matches!(entry.node.value, Value::Null);
        self.current = self.entries.by_ref().find(|entry| !skipped(entry));
        let Some(entry) = self.current else { return Ok(None) };
        let key: StrDeserializer<'_, Fault> = entry.key.as_str().into_deserializer();
        seed.deserialize(key).map(Some).map_err(|fault| fault.or_at(entry.key_place))
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, Fault> {
        let Some(entry) = self.current else {
            return Err(de::Error::custom("a value was asked for before its key"));
        };
        seed.deserialize(self.de.child(&entry.node))
            .map_err(|fault| fault.or_at(entry.node.place).under(Segment::Key(entry.key.clone())))
    }
}

/// A chosen variant and what it holds.
struct Choice<'a> {
    kind: &'a str,
    content: Option<&'a Node>,
    /// The entry, when the kind is a key.
    key: Option<&'a Entry>,
    de: De<'a>,
}

impl<'a> Choice<'a> {
    /// Reads the content; a kind that stands alone holds an empty map.
    fn read<T>(self, read: impl FnOnce(De<'_>) -> Result<T, Fault>) -> Result<T, Fault> {
        let place: Place = self.key.map_or(self.de.node.place, |entry| entry.node.place);
        let empty = Node::new(place, Value::Map(Vec::new()));
        let content = self.content.unwrap_or(&empty);
        let value = read(De { node: content, sources: self.de.sources }).map_err(|fault| fault.or_at(place));
        match self.key {
            Some(entry) => value.map_err(|fault| fault.under(Segment::Key(entry.key.clone()))),
            None => value,
        }
    }
}

impl<'de, 'a> de::EnumAccess<'de> for Choice<'a> {
    type Error = Fault;
    type Variant = Choice<'a>;

    fn variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<(T::Value, Choice<'a>), Fault> {
        let kind: StrDeserializer<'_, Fault> = self.kind.into_deserializer();
        Ok((seed.deserialize(kind).map_err(|fault| fault.or_at(self.de.node.place))?, self))
    }
}

impl<'de> de::VariantAccess<'de> for Choice<'_> {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        self.read(|de| match &de.node.value {
            Value::Map(entries) if entries.is_empty() => Ok(()),
            _ => Err(Fault::expected(de.node, "an empty map")),
        })
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Fault> {
        self.read(|de| seed.deserialize(de))
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Fault> {
        self.read(|de| de.deserialize_tuple(length, visitor))
    }

    fn struct_variant<V: Visitor<'de>>(self, fields: &'static [&'static str], visitor: V) -> Result<V::Value, Fault> {
        self.read(|de| de.deserialize_struct("", fields, visitor))
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::super::*;

    #[test]
    fn an_unknown_field_is_told_with_its_near_miss() {
        assert_eq!(
            faults("image: {widht: 3}"),
            "dir/s.yaml:2:9: image.widht: expected one of width, height, filter, crop, overscan, sample_border, sensitivity, bands, found \"widht\"; did you mean \"width\"?"
        );
        assert_eq!(
            faults("materials:\n  a: {boundary: {thick: 1}}"),
            "dir/s.yaml:3:18: materials.a.boundary.thick: expected no field, found \"thick\""
        );
    }

    /// `none` and `file` may stand for the whole absorption, not for its colour.
    #[test]
    fn what_a_field_may_be_does_not_hold_what_stands_for_its_owner() {
        let kinds = "a number, rgb, table, file, blackbody, illuminant, lines, scaled, zero_outside";
        assert_eq!(
            faults("materials:\n  a: {dielectric: {ior: 1.5, absorption: {color: [1, 2], at: 1}}}"),
            format!(
                "dir/s.yaml:3:50: materials.a.dielectric.absorption.color: expected one of {kinds}, found a list of 2"
            )
        );
    }

    #[test]
    fn an_unknown_kind_is_told_with_its_near_miss() {
        assert_eq!(
            faults("shapes:\n- spere: {radius: 1}"),
            "dir/s.yaml:3:3: shapes[0].spere: expected one of sphere, plane, disk, rectangle, cube, cylinder, cone, \
             mesh, instance, sdf_grid, curves, found \"spere\"; did you mean \"sphere\"?"
        );
        assert_eq!(
            faults("integrator: pth"),
            "dir/s.yaml:2:13: integrator: expected one of path, whitted, depth, light_tracer, none, found \"pth\"; did you mean \"path\"?"
        );
        assert_eq!(
            faults("shapes:\n- sphere: {radius: 1, emission: {textur: a}}"),
            "dir/s.yaml:3:34: shapes[0].sphere.emission.textur: expected one of a number, rgb, table, file, blackbody, \
             illuminant, lines, scaled, zero_outside, texture, found \"textur\"; did you mean \"texture\"?"
        );
    }

    #[test]
    fn a_wrong_type_is_told_in_plain_words() {
        let cases = [
            (
                "image: 3",
                "2:8: image: expected a map with fields among width, height, filter, crop, overscan, sample_border, sensitivity, bands, found 3",
            ),
            (
                "image: {width: abc}",
                "2:16: image.width: expected a whole number from 1 to 65536, found the text \"abc\"",
            ),
            ("image: {width: 1.5}", "2:16: image.width: expected a whole number from 1 to 65536, found 1.5"),
            ("image: {width: -16}", "2:16: image.width: expected a whole number from 1 to 65536, found -16"),
            (
                "render: {tile: 4294967296}",
                "2:16: render.tile: expected a whole number from 1 to 65536, found 4294967296",
            ),
            (
                "integrator: {path: {max_depth: -1}}",
                "2:32: integrator.path.max_depth: expected a whole number from 1 to 4294967295, found -1",
            ),
            (
                "integrator: {path: {max_depth: 4294967296}}",
                "2:32: integrator.path.max_depth: expected a whole number from 1 to 4294967295, found 4294967296",
            ),
            ("image: {crop: {x: -1}}", "2:19: image.crop.x: expected a whole number from 0 to 65535, found -1"),
            (
                "render: {samples: '3'}",
                "2:19: render.samples: expected a whole number from 1 to 134217728, found the text \"3\"",
            ),
            (
                "render: {seed: -1}",
                "2:16: render.seed: expected a whole number from 0 to 18446744073709551615, found -1",
            ),
            (
                "materials: {a: {dielectric: {ior: {formula: {number: -2, coefficients: []}}}}}",
                "2:54: materials.a.dielectric.ior.formula.number: expected a whole number from 1 to 9, found -2",
            ),
            ("output: {png: {bits: -8}}", "2:22: output.png.bits: expected 8 or 16, found -8"),
            (
                "shapes: [{mesh: {file: a.serialized, index: -1}}]",
                "2:45: shapes[0].mesh.index: expected a whole number from 0 to 4294967295, found -1",
            ),
            ("medium: 3", "2:9: medium: expected text, found 3"),
            ("shapes: {sphere: 1}", "2:9: shapes: expected a list, found a map with sphere"),
            ("materials: [1]", "2:12: materials: expected a map of names, found a list of 1"),
            ("output: {exr: {precision: 16}}", "2:27: output.exr.precision: expected one of half, float, found 16"),
            ("textures: {a: {image: {file: 3}}}", "2:30: textures.a.image.file: expected the path of a file, found 3"),
            (
                "textures: {a: {image: {file: x, raw: 1}}}",
                "2:38: textures.a.image.raw: expected true or false, found 1",
            ),
            (
                "fog: {colour: yes, density: 1}",
                "2:15: fog.colour: expected one of a number, rgb, table, file, blackbody, illuminant, lines, scaled, zero_outside, found \"yes\"",
            ),
            ("image: {filter: {catmull_rom: 3}}", "2:31: image.filter.catmull_rom: expected an empty map, found 3"),
        ];
        for (text, message) in cases {
            assert_eq!(faults(text), format!("dir/s.yaml:{message}"));
        }
        let sphere = |fields: &str| faults(&format!("shapes:\n- sphere: {{{fields}}}"));
        assert_eq!(
            sphere("radius: [1]"),
            "dir/s.yaml:3:20: shapes[0].sphere.radius: expected a number, found a list of 1"
        );
        assert_eq!(
            sphere("radius: 1, center: [1, 2]"),
            "dir/s.yaml:3:31: shapes[0].sphere.center: expected 3 values, found 2"
        );
        assert_eq!(
            sphere("radius: 1, center: [1, 2, x]"),
            "dir/s.yaml:3:38: shapes[0].sphere.center[2]: expected a number, found the text \"x\""
        );
        assert_eq!(
            sphere("radius: 1, emission: true"),
            "dir/s.yaml:3:33: shapes[0].sphere.emission: expected one of a number, rgb, table, file, blackbody, \
             illuminant, lines, scaled, zero_outside, texture, found true"
        );
    }

    #[test]
    fn a_number_that_is_not_finite_is_refused() {
        for (written, found) in
            [(".nan", "NaN"), (".inf", "inf"), ("-.inf", "-inf"), ("1e999", "1e999"), ("-1e999", "-1e999")]
        {
            assert_eq!(
                faults(&format!("shapes:\n- sphere: {{radius: {written}}}")),
                format!("dir/s.yaml:3:20: shapes[0].sphere.radius: expected a finite number, found {found}")
            );
            assert_eq!(
                faults(&format!("lights:\n- constant: {{radiance: {written}}}")),
                format!("dir/s.yaml:3:24: lights[0].constant.radiance: expected a finite number, found {found}")
            );
        }
        // Of a million digits no more is shown than of other texts.
        let told = faults(&format!("shapes:\n- sphere: {{radius: {}}}", "9".repeat(1_000_000)));
        assert!(told.ends_with(&format!("found {}…", "9".repeat(60))), "{}", told.len());
    }

    #[test]
    fn a_missing_field_is_said_at_its_map() {
        assert_eq!(
            faults("shapes:\n- sphere: {center: [0, 0, 0]}"),
            "dir/s.yaml:3:11: shapes[0].sphere: expected the field \"radius\", found none"
        );
        // A field without value is a field that is not written.
        assert_eq!(
            faults("shapes:\n- sphere: {radius: }"),
            "dir/s.yaml:3:18: shapes[0].sphere: expected the field \"radius\", found none"
        );
    }

    #[test]
    fn fields_beside_their_kind_are_pointed_out() {
        assert_eq!(
            faults("shapes:\n- sphere: {radius: 1}\n  material: red"),
            "dir/s.yaml:4:3: shapes[0]: expected one key, the kind, found sphere, material; \
             fields of sphere are indented under it"
        );
        // No fields: another kind, and what stands beside a list or a text.
        let sphere = |field: &str| faults(&format!("shapes:\n- sphere: {{radius: 1, {field}}}"));
        assert_eq!(
            sphere("transform: [{translate: [0, 1, 0], scale: 2}]"),
            "dir/s.yaml:3:58: shapes[0].sphere.transform[0]: expected one key, the kind, found translate, scale"
        );
        assert_eq!(
            sphere("emission: {rgb: [1, 1, 1], by: 5}"),
            "dir/s.yaml:3:50: shapes[0].sphere.emission: expected one key, the kind, found rgb, by"
        );
    }

    /// The file has one kind, to which `--set` adds.
    #[test]
    fn a_field_that_a_setting_puts_beside_a_kind_is_told_at_the_setting() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("s.yaml");
        std::fs::write(&file, format!("{}shapes:\n- sphere: {{radius: 1}}\n", super::super::testing::CAMERA)).unwrap();
        let set = [("shapes[0].radius".to_owned(), "2".to_owned())];
        assert_eq!(
            load(&file).unwrap().entries()[0].scene(&set).unwrap_err().to_string(),
            "--set shapes[0].radius=2: shapes[0]: expected one key, the kind, found sphere, radius; fields of sphere are \
             indented under it"
        );
    }

    #[test]
    fn a_kind_may_stand_alone_or_hold_nothing() {
        for written in ["gaussian", "{gaussian: }", "{gaussian: {}}", "{gaussian: {stddev: 0.5}}"] {
            assert_eq!(scene(&format!("image: {{filter: {written}}}")).image.filter, Filter::Gaussian { stddev: 0.5 });
        }
        for written in ["catmull_rom", "{catmull_rom: {}}"] {
            assert_eq!(scene(&format!("image: {{filter: {written}}}")).image.filter, Filter::CatmullRom);
        }
    }

    #[test]
    fn whole_numbers_may_be_written_as_floats() {
        assert_eq!(scene("render: {samples: 1e3}").render.samples, 1000);
        assert_eq!(scene("render: {seed: 18446744073709551615}").render.seed, u64::MAX);
    }

    #[test]
    fn null_is_a_field_that_is_not_written() {
        let scene = scene("fog:\nimage: ~\nintegrator: {path: {max_depth: null}}\n");
        assert_eq!(scene.fog, None);
        assert_eq!(scene.image, Image::default());
        assert_eq!(scene.integrator, Integrator::default());
        assert!(faults("imag: ~").contains("did you mean \"image\"?"), "an unknown field is unknown without value too");
    }

    #[cfg(unix)]
    #[test]
    fn a_directory_need_not_be_utf8() {
        use std::os::unix::ffi::OsStrExt;
        use std::path::Path;
        let directory = std::ffi::OsStr::from_bytes(b"d\xff");
        let text = format!("{}shapes:\n- mesh: {{file: a.ply}}\n", super::super::testing::CAMERA);
        let scene = SceneDescription::parse(&text, &Path::new(directory).join("s.yaml")).unwrap();
        let Geometry::Mesh(mesh) = &scene.shapes[0].geometry else { panic!("a mesh") };
        assert_eq!(mesh.file.0, Path::new(directory).join("a.ply"));
    }
}
