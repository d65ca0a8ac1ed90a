//! XML as it is written.

use std::fmt::{Display, Write};

/// Text under construction, indented by two blanks a level.
#[derive(Debug, Default)]
pub(super) struct Xml {
    text: String,
    open: Vec<&'static str>,
}

impl Xml {
    fn line(&mut self, line: &str) {
        let indent = 2 * self.open.len();
        let _ = writeln!(self.text, "{:indent$}{line}", "");
    }

    /// `<tag a="b">`
    pub(super) fn open(&mut self, tag: &'static str, attributes: &[(&str, &str)]) {
        self.line(&format!("<{tag}{}>", written(attributes)));
        self.open.push(tag);
    }

    /// The end of what was opened last.
    pub(super) fn close(&mut self) {
        if let Some(tag) = self.open.pop() {
            self.line(&format!("</{tag}>"));
        }
    }

    /// `<tag a="b"/>`
    pub(super) fn leaf(&mut self, tag: &str, attributes: &[(&str, &str)]) {
        self.line(&format!("<{tag}{}/>", written(attributes)));
    }

    /// `<tag name="…" value="…"/>`
    pub(super) fn value(&mut self, tag: &str, name: &str, value: impl Display) {
        self.leaf(tag, &[("name", name), ("value", &value.to_string())]);
    }

    /// `<tag name="…" value="$parameter"/>`
    pub(super) fn parameter(&mut self, tag: &str, name: &str, parameter: &str) {
        self.line(&format!("<{tag} name=\"{name}\" value=\"${parameter}\"/>"));
    }

    /// `<?abbe …?>`
    pub(super) fn instruction(&mut self, text: &str) {
        // Within a quoted string of YAML the two characters may be told apart.
        self.line(&format!("<?abbe {}?>", text.replace("?>", "?\\U0000003E")));
    }

    pub(super) fn finish(self) -> String {
        self.text
    }
}

fn written(attributes: &[(&str, &str)]) -> String {
    attributes.iter().map(|(name, value)| format!(" {name}=\"{}\"", escaped(value))).collect()
}

fn escaped(value: &str) -> String {
    value
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;")
        .replace('$', "\\$")
        .replace('\t', "&#9;")
        .replace('\n', "&#10;")
        .replace('\r', "&#13;")
}

/// `1, 2, 3`
pub(super) fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}
