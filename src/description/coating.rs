//! Thin films as they are written.

use serde::Deserialize;

use super::fault::Checker;
use super::path::At;
use super::spectrum::{Index, one};

/// `film: {ior: INDEX, thickness_nm: 300}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Film {
    /// Its index.
    pub ior: Index,
    /// Its thickness, nm.
    pub thickness_nm: Thickness,
}

/// The thickness of a film, nm.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Thickness {
    /// `300`.
    Number(f64),
    /// `{texture: name, from: 100, to: 800}`.
    #[serde(rename = "inline")]
    Textured(TexturedThickness),
}

/// `{texture: name, from: 100, to: 800}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TexturedThickness {
    /// Numbers.
    pub texture: String,
    /// Where they are 0, nm; default 0.
    #[serde(default)]
    pub from: f64,
    /// Where they are 1, nm; default 1, for a texture of nanometres.
    #[serde(default = "one")]
    pub to: f64,
}

impl Film {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        self.ior.check(at.key("ior"), checker);
        self.thickness_nm.check(at.key("thickness_nm"), checker);
    }
}

impl Thickness {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        match self {
            Thickness::Number(nm) => thickness(at, *nm, checker),
            Thickness::Textured(textured) => {
                checker.texture(at.key("texture"), &textured.texture);
                thickness(at.key("from"), textured.from, checker);
                thickness(at.key("to"), textured.to, checker);
            }
        }
    }
}

/// The thickest film, nanometres: a tenth of a metre, less than 2¹⁸ waves, whose number f32 holds to a 64th or better. From there on
/// it would know fewer phases than interference has.
const THICKEST: f64 = 1e8;

fn thickness(at: At<'_>, found: f64, checker: &mut Checker<'_>) {
    checker.require((0.0..=THICKEST).contains(&found), at, "a thickness from 0 to 1e8 nm", found);
}
