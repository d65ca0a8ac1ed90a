//! What the text of an attribute says: numbers, spectra, versions, names.

use super::super::super::fault::Fault;
use super::super::super::node::{Place, quote};
use super::super::object::SpectrumValue;
use super::super::xml::Attribute;
use crate::error::in_short;

/// What stands between blanks and commas.
pub(crate) fn tokens(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_whitespace()).filter(|token| !token.is_empty())
}

pub(crate) fn number(text: &str, place: Place) -> std::result::Result<f64, Fault> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(Fault::at_place(place, format!("expected a finite number, found {}", quote(text)))),
    }
}

/// One number, or `nm:value` pairs.
pub(super) fn spectrum_value(text: &str, place: Place) -> std::result::Result<SpectrumValue, Fault> {
    let tokens: Vec<&str> = tokens(text).collect();
    if let [only] = tokens[..]
        && !only.contains(':')
    {
        return number(only, place).map(SpectrumValue::Uniform);
    }
    let mut table: Vec<[f64; 2]> = Vec::with_capacity(tokens.len());
    for token in &tokens {
        let Some((nm, value)) = token.split_once(':') else {
            let message = format!("expected pairs such as 400:0.5, found {}", quote(token));
            return Err(Fault::at_place(place, message));
        };
        let nm = number(nm, place)?;
        if let Some(&[last, _]) = table.last()
            && nm <= last
        {
            let [nm, last] = [nm, last].map(in_short);
            let message = format!("expected wavelengths that increase, found {nm} nm after {last} nm");
            return Err(Fault::at_place(place, message));
        }
        table.push([nm, number(value, place)?]);
    }
    match table.len() {
        0 => Err(Fault::at_place(place, "expected a number or pairs such as 400:0.5, found none")),
        1 => Err(Fault::at_place(place, format!("expected two pairs or more, found {}", quote(text)))),
        _ => Ok(SpectrumValue::Table(table)),
    }
}

pub(super) fn major_version(attribute: &Attribute) -> std::result::Result<u32, Fault> {
    let parts: Option<Vec<u32>> = attribute.value.split('.').map(|part| part.trim().parse().ok()).collect();
    match parts.as_deref() {
        Some([major, _, _]) => Ok(*major),
        _ => {
            let message = format!("expected a version such as 3.0.0, found {}", quote(&attribute.value));
            Err(Fault::at_place(attribute.place, message))
        }
    }
}

/// `toWorld` to `to_world`, `intIOR` to `int_ior`.
pub(super) fn underscored(name: &str) -> String {
    let mut text = String::with_capacity(name.len() + 4);
    let mut before: Option<char> = None;
    let mut inside_capitals = false;
    for c in name.chars() {
        let begins = c.is_ascii_uppercase() && before.is_some_and(|before| before.is_ascii_lowercase());
        if begins {
            text.push('_');
        }
        inside_capitals = begins || (inside_capitals && c.is_ascii_uppercase());
        text.push(if inside_capitals { c.to_ascii_lowercase() } else { c });
        before = Some(c);
    }
    text
}
