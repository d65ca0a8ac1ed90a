//! What attributes hold once parameters are filled in: text, numbers, vectors, spectra.

use super::super::super::fault::Fault;
use super::super::super::node::{did_you_mean, quote};
use super::super::object::{SpectrumValue, Value};
use super::super::xml::{Attribute, Element};
use super::text::{number, spectrum_value, tokens};
use super::{InFile, Parameter, Parser, check_attributes};

/// The most bytes that are filled in, so that parameters cannot multiply each other without end: 64 MiB.
const MOST_FILLED: usize = 1 << 26;

impl Parser<'_> {
    /// The value of an attribute with its parameters filled in.
    pub(super) fn text(&mut self, attribute: &Attribute) -> std::result::Result<String, Fault> {
        let (text, used) = self.substituted(attribute)?;
        for index in used {
            self.parameters[index].used = true;
        }
        Ok(text)
    }

    /// `$name` stands for the parameter with the longest name that fits; `\$` for a dollar.
    fn substituted(&self, attribute: &Attribute) -> std::result::Result<(String, Vec<usize>), Fault> {
        let mut text = String::new();
        let mut used = Vec::new();
        let mut rest = attribute.value.as_str();
        while let Some(at) = rest.find('$') {
            let (before, after) = (&rest[..at], &rest[at + 1..]);
            if let Some(before) = before.strip_suffix('\\') {
                text.push_str(before);
                text.push('$');
                rest = after;
                continue;
            }
            text.push_str(before);
            let fits = |(_, parameter): &(usize, &Parameter)| after.starts_with(&parameter.name);
            let longest = self.parameters.iter().enumerate().filter(fits).max_by_key(|(_, p)| p.name.len());
            let Some((index, parameter)) = longest else {
                let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
                let name = &after[..end];
                if name.is_empty() {
                    let found = quote(&format!("${after}"));
                    let message = format!("expected the name of a parameter after $, found {found}; \\$ is a dollar");
                    return Err(Fault::at_place(attribute.place, message));
                }
                let hint = did_you_mean(name, self.parameters.iter().map(|parameter| parameter.name.as_str()));
                let message =
                    format!("expected a parameter with a <default> or -D {name}=…, found ${name} without either{hint}");
                return Err(Fault::at_place(attribute.place, message));
            };
            text.push_str(&parameter.value);
            self.filled.set(self.filled.get() + parameter.value.len());
            if self.filled.get() > MOST_FILLED {
                let message =
                    format!("expected parameters of at most {MOST_FILLED} bytes in all their places, found more");
                return Err(Fault::at_place(attribute.place, message));
            }
            used.push(index);
            rest = &after[parameter.name.len()..];
        }
        text.push_str(rest);
        Ok((text, used))
    }

    pub(super) fn number(&mut self, attribute: &Attribute) -> std::result::Result<f64, Fault> {
        let text = self.text(attribute)?;
        number(&text, attribute.place)
    }

    /// Numbers between blanks and commas.
    pub(super) fn numbers(&mut self, attribute: &Attribute) -> std::result::Result<Vec<f64>, Fault> {
        let text = self.text(attribute)?;
        tokens(&text).map(|token| number(token, attribute.place)).collect()
    }

    /// `value="1 2 3"`, `value="1"` or `x y z`, of which those that are not written are `default`.
    pub(super) fn vector(&mut self, element: &Element, default: f64) -> std::result::Result<[f64; 3], Fault> {
        if let Some(value) = element.attribute("value") {
            if let Some(other) = ["x", "y", "z"].iter().find_map(|key| element.attribute(key)) {
                let message = format!("expected either value or x, y, z, found value and {}", other.name);
                return Err(Fault::at_place(other.place, message));
            }
            return match self.numbers(value)?[..] {
                [all] => Ok([all; 3]),
                [x, y, z] => Ok([x, y, z]),
                ref other => {
                    Err(Fault::at_place(value.place, format!("expected 1 or 3 numbers, found {}", other.len())))
                }
            };
        }
        let mut vector = [default; 3];
        for (number, key) in vector.iter_mut().zip(["x", "y", "z"]) {
            if let Some(attribute) = element.attribute(key) {
                *number = self.number(attribute)?;
            }
        }
        Ok(vector)
    }

    /// `<spectrum name="…" value="…"/>` or with `filename`.
    pub(super) fn spectrum(&mut self, element: &Element, in_file: InFile) -> std::result::Result<Value, Fault> {
        check_attributes(element, &["name"], &["value", "filename"])?;
        let value = match (element.attribute("value"), element.attribute("filename")) {
            (Some(value), None) => {
                let text = self.text(value)?;
                return spectrum_value(&text, value.place).map(Value::Spectrum);
            }
            (None, Some(file)) => file,
            _ => {
                let message = "expected either value or filename in <spectrum>, found neither or both";
                return Err(Fault::at_place(element.place, message));
            }
        };
        let name = self.text(value)?;
        // Mitsuba reads it at once, so a <path> further on is not for it.
        let found = self.searched(&name).map(|path| path.to_string_lossy().into_owned());
        let file = found.unwrap_or_else(|| self.document.find(&name, in_file.source));
        Ok(Value::Spectrum(SpectrumValue::File(file)))
    }
}
