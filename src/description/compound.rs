//! Materials that are made of others, and numbers that may follow a texture.

use serde::Deserialize;

use super::fault::Checker;
use super::material::MaterialRef;
use super::path::At;
use super::spectrum::yes;

/// A number, or the name of a texture of numbers.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum NumberOrTexture {
    /// `0.5`.
    Number(f64),
    /// `{texture: name}`.
    Texture(String),
}

impl NumberOrTexture {
    /// A number from 0 to `most`.
    pub(crate) fn check<'a>(&'a self, most: f64, at: At<'_>, checker: &mut Checker<'a>) {
        match self {
            NumberOrTexture::Number(x) if most == f64::INFINITY => checker.not_negative(at, *x),
            NumberOrTexture::Number(x) => {
                checker.require((0.0..=most).contains(x), at, &format!("a number from 0 to {most}"), *x);
            }
            NumberOrTexture::Texture(name) => checker.texture(at.key("texture"), name),
        }
    }
}

/// The name of a texture.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureRef {
    /// `{texture: name}`.
    pub texture: String,
}

/// The least α of Mitsuba 3, whose numbers are raised to it, and of textures, whose texels of zero are not smooth.
pub const LEAST_ALPHA: f64 = 1e-4;

/// Microfacet roughness α, in all directions or along ∂p/∂u and across.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Roughness {
    /// `0.1`; 0 is smooth.
    Number(f64),
    /// `{texture: name}`.
    Texture(String),
    /// `{u: 0.1, v: 0.3}`.
    #[serde(rename = "inline")]
    Brushed(Brushed),
}

/// `{u: 0.1, v: 0.3}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Brushed {
    /// α along ∂p/∂u.
    pub u: NumberOrTexture,
    /// α across.
    pub v: NumberOrTexture,
}

impl Default for Roughness {
    fn default() -> Roughness {
        Roughness::Number(0.0)
    }
}

impl Roughness {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        match self {
            Roughness::Number(x) => checker.roughness(at, *x),
            Roughness::Texture(name) => checker.texture(at.key("texture"), name),
            Roughness::Brushed(brushed) => {
                for (key, alpha) in [("u", &brushed.u), ("v", &brushed.v)] {
                    let at = at.key(key);
                    match alpha {
                        NumberOrTexture::Number(x) if *x == 0.0 => checker.positive(at, *x),
                        NumberOrTexture::Number(x) => checker.roughness(at, *x),
                        NumberOrTexture::Texture(_) => alpha.check(ROUGHEST, at, checker),
                    }
                }
            }
        }
    }
}

/// The largest roughness. Above 1 the model loses most light between its facets, as Mitsuba's does.
const ROUGHEST: f64 = 10.0;

impl Checker<'_> {
    /// `found` is a roughness.
    pub(crate) fn roughness(&mut self, at: At<'_>, found: f64) {
        self.require((0.0..=ROUGHEST).contains(&found), at, "a roughness, a number from 0 to 10", found);
    }
}

/// `mask: {opacity: 0.5, material: M}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mask {
    /// Share of the light that meets the material, 0 to 1; the rest goes straight on. Default 0.5.
    #[serde(default = "half")]
    pub opacity: NumberOrTexture,
    /// What it meets.
    pub material: Box<MaterialRef>,
}

/// `blend: {weight: 0.5, first: M, second: M}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blend {
    /// Share of the second, 0 to 1; default 0.5.
    #[serde(default = "half")]
    pub weight: NumberOrTexture,
    /// Where the weight is 0.
    pub first: Box<MaterialRef>,
    /// Where the weight is 1.
    pub second: Box<MaterialRef>,
}

/// `two_sided: {front: M, back: M}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TwoSided {
    /// On the side of the normal.
    pub front: Box<MaterialRef>,
    /// On the other side; default the same.
    pub back: Option<Box<MaterialRef>>,
}

/// `bump: {height: {texture: waves}, scale: 1, material: M}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bump {
    /// Displacement along the normal, as a texture of numbers, metres.
    pub height: TextureRef,
    /// Factor on it; default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// What covers the bumps.
    pub material: Box<MaterialRef>,
    /// Whether a normal that the viewer would see from behind is turned about the surface's; default true.
    #[serde(default = "yes")]
    pub turn: bool,
    /// Whether slopes shadow each other near grazing light; default true.
    #[serde(default = "yes")]
    pub shadowing: bool,
}

/// `normal_map: {normals: {texture: scales}, material: M}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormalMap {
    /// Normals as colours: x, y, z from −1 to 1 as red, green, blue from 0 to 1; x along ∂p/∂u.
    pub normals: TextureRef,
    /// What covers the surface.
    pub material: Box<MaterialRef>,
    /// Whether a normal that the viewer would see from behind is turned about the surface's; default true.
    #[serde(default = "yes")]
    pub turn: bool,
    /// Whether slopes shadow each other near grazing light; default true.
    #[serde(default = "yes")]
    pub shadowing: bool,
}

fn half() -> NumberOrTexture {
    NumberOrTexture::Number(0.5)
}

fn one() -> f64 {
    1.0
}

impl Mask {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        self.opacity.check(1.0, at.key("opacity"), checker);
        self.material.check(at.key("material"), checker);
    }
}

impl Blend {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        self.weight.check(1.0, at.key("weight"), checker);
        self.first.check(at.key("first"), checker);
        self.second.check(at.key("second"), checker);
    }
}

impl TwoSided {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        self.front.check(at.key("front"), checker);
        if let Some(back) = &self.back {
            back.check(at.key("back"), checker);
        }
    }
}

impl Bump {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        let height = at.key("height");
        checker.texture(height.key("texture"), &self.height.texture);
        self.material.check(at.key("material"), checker);
    }
}

impl NormalMap {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        let normals = at.key("normals");
        checker.texture(normals.key("texture"), &self.normals.texture);
        self.material.check(at.key("material"), checker);
    }
}
