//! Textures as they are written.

use serde::Deserialize;

use super::fault::Checker;
use super::path::At;
use super::spectrum::{FilePath, Illuminant, Role, Spectrum, SpectrumOrTexture};
use crate::spectrum::illuminant;

/// A pattern over the surface parameters (u, v).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Texture {
    /// From a file.
    Image(ImageTexture),
    /// Two spectra in turn.
    Checkerboard(Checkerboard),
    /// `volume: haze`: a volume, by name, at the points of the surface.
    Volume(String),
    /// Numbers that the file of the mesh has at its vertices or on its faces.
    MeshAttribute(MeshAttribute),
}

/// `mesh_attribute: {name: vertex_color, scale: 1}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshAttribute {
    /// `vertex_…` or `face_…`; see `scene::mesh::attribute`.
    pub name: String,
    /// Factor on the numbers; default 1.
    #[serde(default = "one")]
    pub scale: f64,
}

fn one() -> f64 {
    1.0
}

/// `image: {file: earth.jpg}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageTexture {
    /// PNG, JPEG, BMP, TGA, PNM, PFM, HDR or EXR.
    pub file: FilePath,
    /// What lies beyond the edges; default `repeat`.
    #[serde(default)]
    pub wrap: Wrap,
    /// What lies above and below, where it is not the same: a map of a globe repeats around and is clamped at the
    /// poles; default `wrap`.
    pub wrap_v: Option<Wrap>,
    /// Between the texels; default `bilinear`.
    #[serde(default)]
    pub filter: TextureFilter,
    /// Repetitions in u and v; default `[1, 1]`.
    #[serde(default = "unscaled")]
    pub scale: [f64; 2],
    /// Added to u and v after scaling; default `[0, 0]`.
    #[serde(default)]
    pub offset: [f64; 2],
    /// From the surface's u, v to the picture's, as the first two rows of an affine map, applied before `scale` and
    /// `offset`; default none.
    pub uv: Option<[[f64; 3]; 2]>,
    /// Whether the values are data, not sRGB colour; default false.
    #[serde(default)]
    pub raw: bool,
    /// What multiplies the colours where the image shines; default D65 of luminance 1, of measured radiance none.
    pub illuminant: Option<Illuminant>,
}

/// What lies beyond the edges of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image reversed.
    Mirror,
    /// The outermost texels.
    Clamp,
}

/// What lies between the texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TextureFilter {
    /// A mean of the four around.
    #[default]
    Bilinear,
    /// The texel in which the point lies.
    Nearest,
}

/// `checkerboard: {a: SPECTRUM_OR_TEXTURE, b: SPECTRUM_OR_TEXTURE, scale: [12, 12]}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkerboard {
    /// Where ⌊2u⌋ + ⌊2v⌋ of the scaled coordinates is even.
    pub a: SpectrumOrTexture,
    /// Where it is odd.
    pub b: SpectrumOrTexture,
    /// Periods, of two squares each, in u and v; default `[1, 1]`.
    #[serde(default = "unscaled")]
    pub scale: [f64; 2],
    /// From u, v to the board's, as the first two rows of an affine map, applied before `scale`; default none.
    pub uv: Option<[[f64; 3]; 2]>,
}

fn unscaled() -> [f64; 2] {
    [1.0; 2]
}

impl Texture {
    /// Names of the textures in it.
    pub(crate) fn inner(&self) -> Vec<&str> {
        match self {
            Texture::Image(_) | Texture::Volume(_) | Texture::MeshAttribute(_) => Vec::new(),
            Texture::Checkerboard(board) => {
                [&board.a, &board.b].into_iter().filter_map(SpectrumOrTexture::name).collect()
            }
        }
    }

    /// Checks a texture; `role` is how the scene uses it.
    pub(crate) fn check<'a>(&'a self, role: Role, at: At<'_>, checker: &mut Checker<'a>) {
        match self {
            Texture::Volume(name) => {
                checker.volume(at.key("volume"), name);
                if role == Role::Reflectance {
                    checker.reflecting_volumes.insert(name);
                }
            }
            Texture::Image(image) => {
                if let Some(lit) = &image.illuminant {
                    // Also where the picture does not shine, or shines as it was measured.
                    Spectrum::Illuminant(lit.clone()).check(Role::Emission, at.key("image"), checker);
                    if let Err(message) = illuminant::illuminant(&lit.name) {
                        checker.fault(at.key("image").key("illuminant"), message);
                    }
                }
            }
            Texture::MeshAttribute(attribute) => {
                let name = attribute.name.as_str();
                let named = name.starts_with("vertex_") || name.starts_with("face_");
                let at = at.key("mesh_attribute");
                checker.require(named, at.key("name"), "a name that starts with vertex_ or face_", name);
                checker.not_negative(at.key("scale"), attribute.scale);
            }
            Texture::Checkerboard(board) => {
                let at = at.key("checkerboard");
                board.a.check(role, at.key("a"), checker);
                board.b.check(role, at.key("b"), checker);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::faults;

    #[test]
    fn a_checkerboard_that_reflects_is_at_most_one() {
        let board = "textures:\n  a: {checkerboard: {a: 2, b: 1}}\n";
        let reflecting = "materials: {m: {plastic: {reflectance: {texture: a}}}}\n";
        let emitting = "shapes:\n- sphere: {radius: 1, emission: {texture: a}}\n";
        assert_eq!(faults(&format!("{board}{emitting}")), "none");
        assert_eq!(
            faults(&format!("{board}{emitting}{reflecting}")),
            "dir/s.yaml:3:25: textures.a.checkerboard.a: expected a number from 0 to 1, found 2"
        );
    }

    /// Nothing has to shine by the picture for its illuminant to be told.
    #[test]
    fn the_illuminant_of_a_picture_is_a_light() {
        let told = |illuminant: &str| {
            faults(&format!("textures:\n  a: {{image: {{file: a.png, illuminant: {illuminant}}}}}\n"))
        };
        assert_eq!([told("F11"), told("{name: d50, scale: 3}")], ["none", "none"]);
        assert_eq!(
            told("{name: D65, scale: -2}"),
            "dir/s.yaml:3:59: textures.a.image.illuminant.scale: expected a number of 0 or more, found -2"
        );
        assert!(
            told("{name: D66}").starts_with("dir/s.yaml:3:40: textures.a.image.illuminant: unknown illuminant \"D66\""),
            "{}",
            told("{name: D66}")
        );
    }
}
