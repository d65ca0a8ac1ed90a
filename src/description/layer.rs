//! Further channels of the picture, as they are written.

use serde::Deserialize;

use super::fault::Checker;
use super::image::check_channel;
use super::material::given_fields;
use super::node::{did_you_mean, quote};
use super::path::At;
use super::settings::{DepthIntegrator, Integrator, NoIntegrator, PathIntegrator};

/// `diffuse`, `{name: nn, surface: shading_normal}`, `{name: key, ways: [diffuse, glossy], light_group: key}` or
/// `{name: direct, light: {path: {max_depth: 2}}, form: xyz}`
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
    /// Something of the first surface that rays of the camera meet, mean over the pixel, as Mitsuba has it. Colours are those in
    /// light of equal energy.
    Surface(Quantity),
    /// Something of the first surface that covers what is behind it, mean over the pixel: no hole of a mask, no boundary of a
    /// medium, no hidden lamp. Colours are those in daylight, D65.
    Seen(Quantity),
    /// Light.
    Light {
        /// By another integrator than the picture's; default that of the picture.
        of: Option<Integrator>,
        /// Default `rgba`.
        form: LightForm,
    },
    /// The part of the picture's light that came certain ways.
    Ways {
        /// Which; the layers of all ways add up to the picture.
        ways: Vec<LightWay>,
        /// From lamps of one group; default from all.
        group: Option<String>,
    },
    /// A layer of light for each light group, and one for lamps that are in none.
    LightGroups,
    /// What the ray through the middle of the pixel meets, not filtered.
    Middle(Data),
    /// Mattes: who covers how much of the pixel.
    Matte(Matte),
    /// Variance of each pixel's mean.
    Variance,
    /// Standard error of each pixel's mean.
    StandardError,
    /// Samples of each pixel.
    SampleCount,
}

/// The way that light came to the camera, by what scattered it first, seen from there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightWay {
    /// By nothing: the camera sees the lamp.
    Emission,
    /// Thrown by a mirror, or by glass or metal that is smooth or nearly so, onto something else; in no other way.
    Caustic,
    /// Scattered once.
    Direct,
    /// Scattered more often.
    Indirect,
    /// By a diffuse surface.
    Diffuse,
    /// By a mirror or a gloss.
    Glossy,
    /// Through a surface.
    Transmission,
    /// In a medium.
    Media,
    /// Both.
    DiffuseDirect,
    /// Both.
    DiffuseIndirect,
    /// Both.
    GlossyDirect,
    /// Both.
    GlossyIndirect,
    /// Both.
    TransmissionDirect,
    /// Both.
    TransmissionIndirect,
    /// Both.
    MediaDirect,
    /// Both.
    MediaIndirect,
}

/// What the middle of a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Data {
    /// `Z`: the depth along the line of sight.
    Depth,
    /// `P.X`, `P.Y`, `P.Z`: the place.
    Position,
    /// `uv.U`, `uv.V`: texture coordinates.
    Uv,
    /// `motion.X`, `motion.Y`: how far it moves on the picture until the next frame.
    Motion,
}

/// By what mattes are parted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Matte {
    /// The shapes of the scene.
    Object,
    /// Their materials.
    Material,
    /// The assets that they are part of.
    Asset,
}

impl Matte {
    /// The layer of it, without the number of a channel group.
    #[must_use]
    pub fn layer(self) -> &'static str {
        match self {
            Matte::Object => "CryptoObject",
            Matte::Material => "CryptoMaterial",
            Matte::Asset => "CryptoAsset",
        }
    }
}

/// Something that the camera sees of the first surface that its ray meets; zero where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Distance along the ray, metres.
    Depth,
    /// Point, metres.
    Position,
    /// Texture coordinates.
    Uv,
    /// True normal, outward.
    GeometricNormal,
    /// Interpolated normal.
    ShadingNormal,
    /// ∂p/∂u, metres.
    DpDu,
    /// ∂p/∂v, metres.
    DpDv,
    /// ∂(u, v)/∂x: how much the texture coordinates change from this sample to the next to the right, where
    /// samples stand 1/√n pixels apart.
    DuvDx,
    /// The same downward.
    DuvDy,
    /// Colour of the material, in the colour space of the file: of what is seen [`Bsdf::albedo`](crate::optics::bsdf::Bsdf::albedo) in daylight; of what is met
    /// that of a diffuse base in light of equal energy, else π f for light along the normal.
    Albedo,
    /// Number of the triangle or face, from 0.
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

/// As it stands in YAML: a name that says all, or fields.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum WrittenLayer {
    Name(String),
    Inline(WrittenFields),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenFields {
    name: String,
    surface: Option<Quantity>,
    light: Option<CameraIntegrator>,
    form: Option<LightForm>,
    ways: Option<Vec<LightWay>>,
    light_group: Option<String>,
    #[serde(default)]
    squares: bool,
    squares_name: Option<String>,
}

/// The integrators that start at the camera, and so see what the picture does.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum CameraIntegrator {
    Path(PathIntegrator),
    Depth(DepthIntegrator),
    None(NoIntegrator),
}

impl From<CameraIntegrator> for Integrator {
    fn from(written: CameraIntegrator) -> Integrator {
        match written {
            CameraIntegrator::Path(path) => Integrator::Path(path),
            CameraIntegrator::Depth(depth) => Integrator::Depth(depth),
            CameraIntegrator::None(none) => Integrator::None(none),
        }
    }
}

/// Layers that a name says all of, with the names of their channels.
const NAMED: [(&str, &str, LayerContent); 13] = [
    ("Z", "Z", LayerContent::Middle(Data::Depth)),
    ("P", "P", LayerContent::Middle(Data::Position)),
    ("uv", "uv", LayerContent::Middle(Data::Uv)),
    ("motion", "motion", LayerContent::Middle(Data::Motion)),
    ("normal", "normal", LayerContent::Seen(Quantity::ShadingNormal)),
    ("albedo", "albedo", LayerContent::Seen(Quantity::Albedo)),
    ("light_groups", "light_groups", LayerContent::LightGroups),
    ("variance", "variance", LayerContent::Variance),
    ("stderr", "stderr", LayerContent::StandardError),
    ("sampleCount", "sampleCount", LayerContent::SampleCount),
    ("crypto_object", "CryptoObject", LayerContent::Matte(Matte::Object)),
    ("crypto_material", "CryptoMaterial", LayerContent::Matte(Matte::Material)),
    ("crypto_asset", "CryptoAsset", LayerContent::Matte(Matte::Asset)),
];

/// The ways that are layers by their names.
const WAYS: [(&str, LightWay); 16] = [
    ("emission", LightWay::Emission),
    ("caustic", LightWay::Caustic),
    ("direct", LightWay::Direct),
    ("indirect", LightWay::Indirect),
    ("diffuse", LightWay::Diffuse),
    ("glossy", LightWay::Glossy),
    ("transmission", LightWay::Transmission),
    ("media", LightWay::Media),
    ("diffuse_direct", LightWay::DiffuseDirect),
    ("diffuse_indirect", LightWay::DiffuseIndirect),
    ("glossy_direct", LightWay::GlossyDirect),
    ("glossy_indirect", LightWay::GlossyIndirect),
    ("transmission_direct", LightWay::TransmissionDirect),
    ("transmission_indirect", LightWay::TransmissionIndirect),
    ("media_direct", LightWay::MediaDirect),
    ("media_indirect", LightWay::MediaIndirect),
];

impl TryFrom<WrittenLayer> for Layer {
    type Error = String;

    fn try_from(written: WrittenLayer) -> Result<Layer, String> {
        let written = match written {
            WrittenLayer::Name(name) => return Layer::named(&name),
            WrittenLayer::Inline(fields) => fields,
        };
        let WrittenFields { name, surface, light, form, ways, light_group, squares, squares_name } = written;
        let given = [
            ("surface", surface.is_some()),
            ("light", light.is_some()),
            ("form", form.is_some()),
            ("ways", ways.is_some()),
            ("light_group", light_group.is_some()),
        ];
        let content = match (surface, light, form, ways, light_group) {
            (Some(quantity), None, None, None, None) => LayerContent::Surface(quantity),
            (None, None, None, Some(ways), group) => LayerContent::Ways { ways, group },
            (None, None, None, None, Some(group)) => LayerContent::Ways { ways: EVERY.to_vec(), group: Some(group) },
            (None, of, form, None, None) => {
                LayerContent::Light { of: of.map(Integrator::from), form: form.unwrap_or_default() }
            }
            _ => {
                let found = given_fields(&given);
                return Err(format!(
                    "expected either surface, or light and form, or ways and light_group, found {found}"
                ));
            }
        };
        if squares && matches!(content, LayerContent::Ways { .. }) {
            return Err("expected squares of a surface or of light by an integrator, found ways".to_owned());
        }
        if squares_name.is_some() && !squares {
            return Err("expected squares: true beside squares_name, found squares_name alone".to_owned());
        }
        let squares = squares.then(|| squares_name.unwrap_or_else(|| format!("m2_{name}")));
        Ok(Layer { name, content, squares })
    }
}

/// Ways that hold every path of light once.
const EVERY: [LightWay; 4] = [LightWay::Emission, LightWay::Caustic, LightWay::Direct, LightWay::Indirect];

impl Layer {
    /// Whether it holds other things than light.
    #[must_use]
    pub fn is_data(&self) -> bool {
        match &self.content {
            LayerContent::Surface(quantity) | LayerContent::Seen(quantity) => {
                *quantity != Quantity::Albedo || self.squares.is_some()
            }
            LayerContent::Light { .. } => self.squares.is_some(),
            LayerContent::Ways { .. } | LayerContent::LightGroups => false,
            LayerContent::Middle(_)
            | LayerContent::Matte(_)
            | LayerContent::Variance
            | LayerContent::StandardError
            | LayerContent::SampleCount => true,
        }
    }

    fn named(text: &str) -> Result<Layer, String> {
        let ways = WAYS.iter().find(|(name, _)| *name == text);
        let found = ways.map(|(name, way)| (*name, LayerContent::Ways { ways: vec![*way], group: None }));
        let named = NAMED.iter().find(|(name, ..)| *name == text).map(|(_, name, content)| (*name, content.clone()));
        let Some((name, content)) = found.or(named) else {
            let known: Vec<&str> =
                NAMED.iter().map(|(name, ..)| *name).chain(WAYS.iter().map(|(name, _)| *name)).collect();
            let hint = did_you_mean(text, known.iter().copied());
            return Err(format!(
                "expected a map of fields, or one of {}, found {}{hint}",
                known.join(", "),
                quote(text)
            ));
        };
        Ok(Layer { name: name.to_owned(), content, squares: None })
    }
}

impl Quantity {
    /// Names of its components, as OpenEXR layers have them.
    #[must_use]
    pub fn components(self) -> &'static [&'static str] {
        match self {
            Quantity::Depth => &["T"],
            Quantity::Uv | Quantity::DuvDx | Quantity::DuvDy => &["U", "V"],
            Quantity::Primitive | Quantity::Shape => &["I"],
            Quantity::Albedo => &["R", "G", "B"],
            Quantity::Position
            | Quantity::GeometricNormal
            | Quantity::ShadingNormal
            | Quantity::DpDu
            | Quantity::DpDv => &["X", "Y", "Z"],
        }
    }
}

impl Layer {
    /// Whether two may not have their names: one name does for things of a surface whose components have others.
    pub(crate) fn clashes(&self, other: &Layer) -> bool {
        let apart = match (&self.content, &other.content) {
            (LayerContent::Surface(a), LayerContent::Surface(b)) => {
                !a.components().iter().any(|component| b.components().contains(component))
            }
            _ => false,
        };
        self.name == other.name && !apart
    }

    pub(crate) fn check(&self, taken: bool, at: At<'_>, checker: &mut Checker<'_>) {
        check_channel(&self.name, taken, at.key("name"), checker);
        if let LayerContent::Ways { ways, .. } = &self.content {
            checker.require(!ways.is_empty(), at.key("ways"), "one way or more", "none");
        }
        if let LayerContent::Light { of: Some(integrator), .. } = &self.content {
            integrator.check(at.key("light"), checker);
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
            "dir/s.yaml:3:3: layers[0]: expected either surface, or light and form, or ways and light_group, found surface \
             and form"
        );
    }

    #[test]
    fn a_layer_may_be_a_name_that_says_all() {
        let layers = scene("layers: [Z, diffuse_direct, crypto_object, sampleCount]\n").layers;
        let names: Vec<&str> = layers.iter().map(|layer| layer.name.as_str()).collect();
        assert_eq!(names, ["Z", "diffuse_direct", "CryptoObject", "sampleCount"]);
        assert_eq!(layers[1].content, LayerContent::Ways { ways: vec![LightWay::DiffuseDirect], group: None });
        let found = faults("layers: [difuse]\n");
        assert!(
            found.starts_with("dir/s.yaml:2:10: layers[0]: expected a map of fields, or one of Z, P, uv, "),
            "{found}"
        );
        assert!(found.ends_with("found \"difuse\"; did you mean \"diffuse\"?"), "{found}");
    }

    #[test]
    fn ways_belong_to_paths_and_groups_to_lamps() {
        let text = "lights: [{point: {position: [0, 1, 0], intensity: 1}}]\nlight_groups: {key: [point0]}\n";
        let layers = scene(&format!("{text}layers: [{{name: k, light_group: key}}, light_groups]\n")).layers;
        assert!(matches!(&layers[0].content, LayerContent::Ways { ways, group } if ways.len() == 4 && group.is_some()));
        assert_eq!(
            faults(&format!("{text}integrator: whitted\nlayers: [{{name: k, ways: [diffuse], light_group: kex}}]\n")),
            "dir/s.yaml:5:10: layers[0]: expected the integrator path, which knows the ways of light, found another\n\
             dir/s.yaml:5:50: layers[0].light_group: unknown light group \"kex\"; did you mean \"key\"?"
        );
        assert_eq!(
            faults(
                "lights: [{point: {position: [0, 1, 0], intensity: 1}}]\nlight_groups: {a: [point0], b: [point0, x]}\n"
            ),
            "dir/s.yaml:3:33: light_groups.b[0]: expected each name once, found \"point0\"\n\
             dir/s.yaml:3:41: light_groups.b[1]: unknown lamp \"x\"; known: point0"
        );
    }

    /// They would be black, and not add up to the picture.
    #[test]
    fn light_groups_belong_to_paths() {
        for integrator in ["whitted", "depth", "none"] {
            assert_eq!(
                faults(&format!("integrator: {integrator}\nlayers: [Z, light_groups]\n")),
                "dir/s.yaml:3:13: layers[1]: expected the integrator path, which knows the ways of light, found another"
            );
        }
    }

    /// It would be black.
    #[test]
    fn a_layer_of_no_way_is_refused() {
        assert_eq!(
            faults("layers: [{name: k, ways: []}]\n"),
            "dir/s.yaml:2:26: layers[0].ways: expected one way or more, found none"
        );
    }

    /// Their name would name nothing.
    #[test]
    fn a_name_of_squares_that_nobody_asks_for_is_refused() {
        for squares in ["", ", squares: false"] {
            assert_eq!(
                faults(&format!("layers: [{{name: k, surface: depth, squares_name: q{squares}}}]\n")),
                "dir/s.yaml:2:10: layers[0]: expected squares: true beside squares_name, found squares_name alone"
            );
        }
        let layers = scene("layers: [{name: k, surface: depth, squares_name: q, squares: true}]\n").layers;
        assert_eq!(layers[0].squares.as_deref(), Some("q"));
    }

    /// Mattes would show both as one.
    #[test]
    fn a_shape_is_not_called_what_an_unnamed_one_is() {
        let shapes = "shapes:\n- sphere: {radius: 1}\n- sphere: {radius: 1, name: sphere0}\n";
        assert_eq!(
            faults(&format!("{shapes}layers: [crypto_object]\n")),
            "dir/s.yaml:4:29: shapes[1].sphere.name: expected a name of its own, found \"sphere0\", which shapes[0] has, \
             since it has no other"
        );
        scene(shapes);
    }

    #[test]
    fn layers_have_names_of_their_own_and_camera_rays() {
        assert_eq!(
            faults("layers:\n- {name: a, surface: depth}\n- {name: a, light: path}\n"),
            "dir/s.yaml:4:10: layers[1].name: expected a name of its own, found \"a\" again"
        );
        // a.T beside a.U and a.V, but no second a.T.
        let layers = "layers: [{name: a, surface: depth}, {name: a, surface: uv}]\n";
        assert_eq!(scene(layers).layers.len(), 2);
        assert_eq!(
            faults(&layers.replace("uv", "depth")),
            "dir/s.yaml:2:44: layers[1].name: expected a name of its own, found \"a\" again"
        );
        assert_eq!(
            faults("layers:\n- {name: a, light: whitted}\n"),
            "dir/s.yaml:3:20: layers[0].light: expected one of path, depth, none, found \"whitted\""
        );
    }
}
