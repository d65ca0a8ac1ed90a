//! Nodes of the grammar as they are built: each stands at the place in the XML that it came from.

use glam::DMat4;

use super::super::node::{Entry, Node, Place, Value};

/// A map under construction whose fields stand at one place, unless they know a better one.
pub(super) struct Fields {
    pub(super) place: Place,
    pub(super) entries: Vec<Entry>,
}

impl Fields {
    pub(super) fn new(place: Place) -> Fields {
        Fields { place, entries: Vec::new() }
    }

    pub(super) fn add(&mut self, key: &str, node: Node) {
        self.entries.push(Entry { key: key.to_owned(), key_place: node.place, node });
    }

    /// Adds a field if there is something to say.
    pub(super) fn maybe(&mut self, key: &str, node: Option<Node>) {
        if let Some(node) = node {
            self.add(key, node);
        }
    }

    pub(super) fn extend(&mut self, other: Fields) {
        self.entries.extend(other.entries);
    }

    pub(super) fn map(self) -> Node {
        Node::new(self.place, Value::Map(self.entries))
    }

    /// `{kind: {…}}`
    pub(super) fn kind(self, kind: &str) -> Node {
        let place = self.place;
        entry(place, kind, self.map())
    }
}

/// `{key: node}`
pub(super) fn entry(place: Place, key: &str, node: Node) -> Node {
    Node::new(place, Value::Map(vec![Entry { key: key.to_owned(), key_place: place, node }]))
}

pub(super) fn number(place: Place, value: f64) -> Node {
    Node::new(place, Value::Float(value))
}

pub(super) fn whole(place: Place, value: i64) -> Node {
    Node::new(place, u64::try_from(value).map_or(Value::Signed(value), Value::Unsigned))
}

pub(super) fn boolean(place: Place, value: bool) -> Node {
    Node::new(place, Value::Bool(value))
}

pub(super) fn text(place: Place, value: impl Into<String>) -> Node {
    Node::new(place, Value::Text(value.into()))
}

pub(super) fn list(place: Place, values: impl IntoIterator<Item = Node>) -> Node {
    Node::new(place, Value::List(values.into_iter().collect()))
}

pub(super) fn numbers(place: Place, values: &[f64]) -> Node {
    list(place, values.iter().map(|value| number(place, *value)))
}

/// The rows of a matrix on column vectors.
pub(super) fn matrix(place: Place, matrix: DMat4) -> Node {
    let rows = matrix.transpose().to_cols_array_2d();
    list(place, rows.iter().map(|row| numbers(place, row)))
}
