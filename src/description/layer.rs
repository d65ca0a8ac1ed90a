//! Further channels of the picture, as they are written.

use serde::Deserialize;

use super::camera::check_channel;
use super::fault::Checker;
use super::material::given_fields;
use super::path::At;
use super::settings::Integrator;

/// `{name: nn, surface: shading_normal}` or `{name: direct, light: {path: {max_depth: 2}}, form: xyz}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenLayer")]
pub struct Layer {
    /// Before the dot in the names of its channels.
    pub name: String,
    /// What it holds.
    pub content: LayerContent,
    /// The layer in which the squares of its numbers are written too; default none.
    pub squares: Option<String>,
}

/// What a layer holds.
#[derive(Clone, Debug, PartialEq)]
pub enum LayerContent {
    /// Something of the first surface that the camera sees.
    Surface(Quantity),
    /// Light.
    Light {
        /// By another integrator than the picture's; default that of the picture.
        of: Option<Integrator>,
        /// Default `rgba`.
        form: LightForm,
    },
}

/// Something of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Distance along the ray.
    Depth,
    /// Where it is.
    Position,
    /// Texture coordinates.
    Uv,
    /// The true normal.
    GeometricNormal,
    /// The interpolated normal.
    ShadingNormal,
    /// ∂p/∂u.
    DpDu,
    /// ∂p/∂v.
    DpDv,
    /// ∂(u, v)/∂x from one sample to the next.
    DuvDx,
    /// ∂(u, v)/∂y from one sample to the next.
    DuvDy,
    /// Diffuse reflectance.
    Albedo,
    /// Number of the face or triangle, from 0.
    Primitive,
    /// Number of the shape, from 1.
    Shape,
}

/// How light is written in a layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightForm {
    /// R, G, B, A.
    #[default]
    Rgba,
    /// CIE X, Y, Z.
    Xyz,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenLayer {
    name: String,
    surface: Option<Quantity>,
    light: Option<Integrator>,
    form: Option<LightForm>,
    #[serde(default)]
    squares: bool,
    squares_name: Option<String>,
}

impl TryFrom<WrittenLayer> for Layer {
    type Error = String;

    fn try_from(written: WrittenLayer) -> Result<Layer, String> {
        let WrittenLayer { name, surface, light, form, squares, squares_name } = written;
        let content = match (surface, light, form) {
            (Some(quantity), None, None) => LayerContent::Surface(quantity),
            (None, of, form) => LayerContent::Light { of, form: form.unwrap_or_default() },
            (surface, light, form) => {
                let given = [("surface", surface.is_some()), ("light", light.is_some()), ("form", form.is_some())];
                return Err(format!("expected either surface, or light and form, found {}", given_fields(&given)));
            }
        };
        let squares = squares.then(|| squares_name.unwrap_or_else(|| format!("m2_{name}")));
        Ok(Layer { name, content, squares })
    }
}

impl Layer {
    pub(crate) fn check(&self, taken: bool, at: At<'_>, checker: &mut Checker<'_>) {
        check_channel(&self.name, taken, at.key("name"), checker);
        if let LayerContent::Light { of: Some(integrator), .. } = &self.content {
            let at = at.key("light");
            let by_camera = matches!(integrator, Integrator::Path(_) | Integrator::Depth(_) | Integrator::None(_));
            checker.require(by_camera, at, "path, depth or none", "another integrator");
            integrator.check(at, checker);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    #[test]
    fn a_layer_is_of_a_surface_or_of_light() {
        let layers = scene("layers:\n- {name: nn, surface: shading_normal}\n- {name: b, squares: true}\n").layers;
        assert_eq!(layers[0].content, LayerContent::Surface(Quantity::ShadingNormal));
        assert_eq!(layers[1].content, LayerContent::Light { of: None, form: LightForm::Rgba });
        assert_eq!(
            faults("layers:\n- {name: nn, surface: depth, form: xyz}\n"),
            "dir/s.yaml:3:3: layers[0]: expected either surface, or light and form, found surface and form"
        );
    }

    #[test]
    fn layers_have_names_of_their_own_and_camera_rays() {
        assert_eq!(
            faults("layers:\n- {name: a, surface: depth}\n- {name: a, light: whitted}\n"),
            "dir/s.yaml:4:10: layers[1].name: expected a name of its own, found \"a\" again\n\
             dir/s.yaml:4:20: layers[1].light: expected path, depth or none, found another integrator"
        );
    }
}
