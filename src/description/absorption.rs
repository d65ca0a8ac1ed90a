//! Absorption inside a clear body as it is written.

use serde::Deserialize;

use super::fault::Checker;
use super::path::At;
use super::spectrum::{FilePath, Role, Spectrum};

/// How a body absorbs.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Absorption {
    /// `none`: not at all, even where the file of the index says how much.
    None,
    /// `{file: water.yml}`: by the k of a file of refractiveindex.info.
    File(FilePath),
    /// `{color: SPECTRUM, at: 0.05}`.
    #[serde(rename = "inline")]
    Color(ColorAt),
}

/// `{color: SPECTRUM, at: 0.05}`: what is left of white light on a way.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorAt {
    /// The share of light that is left, above 0 and up to 1.
    pub color: Spectrum,
    /// After how long a way, m.
    pub at: f64,
}

impl Absorption {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        if let Absorption::Color(color) = self {
            color.color.check(Role::Reflectance, at.key("color"), checker);
            checker.positive(at.key("at"), color.at);
        }
    }
}
