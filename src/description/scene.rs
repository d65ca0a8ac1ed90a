//! A scene as it is written, and the way back from a field to its line.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use serde::Deserialize;

use super::animation::{Animation, Motion};
use super::camera::Camera;
use super::decode::decode;
use super::edit;
use super::exr_file;
use super::fault::{Checker, Fault};
use super::image::{Image, check_channel};
use super::layer::{Layer, LayerContent};
use super::light::{Fog, Light};
use super::material::Material;
use super::medium::{Medium, UNCHANGED, VACUUM};
use super::nesting;
use super::node::{Node, Sources, Value, quote};
use super::output::Output;
use super::path::{self, At, Segment};
use super::settings::{Integrator, Render, Technique};
use super::shape::Shape;
use super::spectrum::{FilePath, Role};
use super::texture::Texture;
use super::volume::Volume;
use crate::error::Result;

/// The light group of lamps that are in no other. Lamps may be put into it by name, too.
pub const DEFAULT_GROUP: &str = "default";

/// Everything that one picture is made of.
///
/// It has passed validation: numbers are finite and in range, names refer to something. What only
/// the compiler can know (files, names of glasses and metals) is still open; it reports with
/// [`SceneDescription::fault`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneDescription {
    /// Files whose materials, textures and media are part of this scene already.
    #[serde(default)]
    pub include: Vec<FilePath>,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// The raster; default 600 × 600.
    #[serde(default)]
    pub image: Image,
    /// Default `path`.
    #[serde(default)]
    pub integrator: Integrator,
    /// Further channels of the picture; default none.
    #[serde(default)]
    pub layers: Vec<Layer>,
    /// How to render.
    #[serde(default)]
    pub render: Render,
    /// What to write.
    #[serde(default)]
    pub output: Output,
    /// By name.
    #[serde(default)]
    pub textures: BTreeMap<String, Texture>,
    /// By name.
    #[serde(default)]
    pub volumes: BTreeMap<String, Volume>,
    /// By name.
    #[serde(default)]
    pub materials: BTreeMap<String, Material>,
    /// By name.
    #[serde(default)]
    pub media: BTreeMap<String, Medium>,
    /// Shapes that are placed together, by name: seen where an instance copies them.
    #[serde(default)]
    pub groups: BTreeMap<String, Vec<Shape>>,
    /// In the order of the text.
    #[serde(default)]
    pub shapes: Vec<Shape>,
    /// In the order of the text.
    #[serde(default)]
    pub lights: Vec<Light>,
    /// Names of lamps by the group that they are in, for layers: of lights and of shapes that shine, given or made from
    /// kind and number (`point0`).
    #[serde(default)]
    pub light_groups: BTreeMap<String, Vec<String>>,
    /// Names of shapes by the asset that they are part of, for mattes.
    #[serde(default)]
    pub assets: BTreeMap<String, Vec<String>>,
    /// Name of the medium that the camera is in, and all space where no body is; default none. It has no end: light from
    /// infinity comes through only at wavelengths at which it neither absorbs nor scatters.
    pub medium: Option<String>,
    /// Depth fog; default none.
    pub fog: Option<Fog>,
    /// Which frame this is of, where the scene has frames.
    #[serde(skip)]
    pub frame: Option<i32>,
    /// The scene at other times, where the camera has a shutter and something changes.
    #[serde(skip)]
    pub motion: Option<Box<Motion>>,
    /// The directory of the scene's file, relative to the working directory. Paths in the
    /// description are joined to it already.
    #[serde(skip)]
    pub directory: PathBuf,
    /// Where each field is written.
    #[serde(skip)]
    pub locator: Locator,
}

/// Finds the file, line and column of a field.
#[derive(Clone, Debug, Default)]
pub struct Locator {
    text: Option<Arc<Text>>,
}

/// What a scene was read from.
#[derive(Debug)]
struct Text {
    root: Node,
    sources: Sources,
    /// Where each name stands in its section, once a field is sought: among thousands of materials each would be sought for long.
    names: OnceLock<HashMap<String, HashMap<String, usize>>>,
}

impl Text {
    /// What stands under a name of a section of the scene.
    fn named(&self, section: &str, name: &str) -> Option<&Node> {
        let names = self.names.get_or_init(|| {
            let Value::Map(sections) = &self.root.value else { return HashMap::new() };
            let names = |node: &Node| match &node.value {
                Value::Map(entries) => (0..).zip(entries).map(|(i, entry)| (entry.key.clone(), i)).collect(),
                _ => HashMap::new(),
            };
            sections.iter().map(|section| (section.key.clone(), names(&section.node))).collect()
        });
        let index = *names.get(section)?.get(name)?;
        match &self.root.get(section)?.value {
            Value::Map(entries) => entries.get(index).map(|entry| &entry.node),
            _ => None,
        }
    }

    /// The node to which the first steps of `path` lead, and the others.
    fn enter<'p>(&self, path: &'p [Segment]) -> (&Node, &'p [Segment]) {
        match path {
            [Segment::Key(section), Segment::Key(name), rest @ ..] => {
                self.named(section, name).map_or((&self.root, path), |node| (node, rest))
            }
            _ => (&self.root, path),
        }
    }
}

impl Locator {
    /// `file:line:column: field: message`, where `field` is a path such as
    /// `shapes[3].mesh.file`. A field that is not written has the place of the nearest one around
    /// it that is.
    #[must_use]
    pub fn fault(&self, field: &str, message: &str) -> String {
        let Some(text) = self.text.as_deref() else {
            return format!("{field}: {message}");
        };
        let place = path::parse(field).map_or(text.root.place, |path| {
            let (node, rest) = text.enter(&path);
            node.locate(rest)
        });
        format!("{}: {field}: {message}", text.sources.describe(place))
    }

    /// What was seen when the text was read that is no fault, each with its place.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        self.text.as_deref().map_or(Vec::new(), |text| text.sources.notes().collect())
    }
}

impl SceneDescription {
    /// Reads a scene from text, as if it stood in the file `path`.
    ///
    /// # Errors
    /// [`Error::Config`](crate::error::Error::Config) with every fault; [`Error::Input`](crate::error::Error::Input) if an included file cannot be read.
    pub fn parse(text: &str, path: &Path) -> Result<SceneDescription> {
        let mut sources = Sources::default();
        let mut root = edit::read_bytes_as(text.as_bytes(), path, &mut sources)?;
        edit::include(&mut root, path, &mut sources)?;
        Animation::new(root, path, sources)?.into_first()
    }

    /// Decodes and validates a complete tree.
    pub(crate) fn of_tree(root: Node, path: &Path, sources: Sources) -> Result<SceneDescription> {
        let decoded: std::result::Result<SceneDescription, Fault> = decode(&root, &sources);
        let mut scene = decoded.map_err(|fault| {
            // Without a camera it may have been meant for a batch.
            let batch =
                matches!(root.value, Value::Map(_)) && root.get("camera").is_none() && root.get("scenes").is_none();
            let fault = if batch { fault.or_one_of(["scenes"]) } else { fault };
            fault.into_error(&sources)
        })?;
        scene.check(&root, &sources)?;
        scene.directory = path.parent().unwrap_or(Path::new("")).to_path_buf();
        scene.locator = Locator { text: Some(Arc::new(Text { root, sources, names: OnceLock::new() })) };
        Ok(scene)
    }

    /// The tree that it was decoded from, where there is one.
    pub(crate) fn tree(&self) -> Option<(&Node, &Sources)> {
        self.locator.text.as_deref().map(|text| (&text.root, &text.sources))
    }

    /// The node at `path` of that tree.
    pub(crate) fn node(&self, path: &[Segment]) -> Option<&Node> {
        let (node, rest) = self.locator.text.as_deref()?.enter(path);
        node.find(rest)
    }

    /// A message about a field, with its place: see [`Locator::fault`].
    #[must_use]
    pub fn fault(&self, field: &str, message: &str) -> String {
        self.locator.fault(field, message)
    }

    /// Textures within textures that reflect do so too.
    fn reflect_through_textures<'a>(&'a self, checker: &mut Checker<'a>) {
        let mut open: Vec<&str> = checker.reflecting_textures.iter().copied().collect();
        while let Some(name) = open.pop() {
            for inner in self.textures.get(name).into_iter().flat_map(Texture::inner) {
                if checker.reflecting_textures.insert(inner) {
                    open.push(inner);
                }
            }
        }
    }

    /// The names of all lamps, dark ones too: shapes that shine, and lights.
    #[must_use]
    pub fn lamps(&self) -> Vec<String> {
        let shining = self.shapes.iter().enumerate().filter(|(_, shape)| shape.emission.is_some());
        let lights = self.lights.iter().enumerate().map(|(i, light)| light.name_or_kind(i));
        shining.map(|(i, shape)| shape.name_or_kind(i)).chain(lights).collect()
    }

    /// Light groups and assets name what is there, each thing once.
    fn check_names(&self, checker: &mut Checker<'_>) {
        // Mattes, assets and groups of lamps go by name.
        let mattes = self.layers.iter().any(|layer| matches!(layer.content, LayerContent::Matte(_)));
        let named = mattes || !self.light_groups.is_empty() || !self.assets.is_empty();
        if named {
            self.check_names_of_their_own(checker);
        }
        let shapes = self.shapes.iter().enumerate().map(|(i, shape)| shape.name_or_kind(i)).collect();
        let all =
            [("light_groups", "lamp", &self.light_groups, self.lamps()), ("assets", "shape", &self.assets, shapes)];
        // Light is parted by numbers of eight bits; mattes go by names.
        let (most, groups) = (usize::from(u8::MAX) - 1, self.light_groups.len());
        checker.require(groups <= most, At::ROOT.key("light_groups"), "at most 254 names", groups);
        for (field, kind, groups, known) in all {
            let mut taken: HashSet<&str> = HashSet::new();
            let known: BTreeSet<&str> = known.iter().map(String::as_str).collect();
            for (group, names) in groups {
                let field = At::ROOT.key(field);
                let at = field.key(group);
                check_channel(group, false, at, checker);
                for (i, name) in names.iter().enumerate() {
                    checker.known(at.index(i), kind, name, &known);
                    checker.require(taken.insert(name), at.index(i), "each name once", quote(name));
                }
            }
        }
    }

    /// No shape and no lamp of a group is called as another is that has no name.
    fn check_names_of_their_own(&self, checker: &mut Checker<'_>) {
        let shape = |(i, shape): (usize, &Shape)| ("shapes", i, shape.geometry.kind(), shape.name.clone());
        let light = |(i, light): (usize, &Light)| ("lights", i, light.kind(), light.name().map(str::to_owned));
        let lights = self.lights.iter().enumerate().filter(|_| !self.light_groups.is_empty()).map(light);
        let all: Vec<_> = self.shapes.iter().enumerate().map(shape).chain(lights).collect();
        let unnamed = all.iter().filter(|(_, _, _, name)| name.is_none());
        let made: HashMap<String, _> = unnamed.map(|(list, i, kind, _)| (format!("{kind}{i}"), (list, i))).collect();
        for (list, i, kind, name) in &all {
            if let Some((name, (other, j))) = name.as_ref().and_then(|name| Some((name, made.get(name)?))) {
                let (list, found) = (At::ROOT.key(list), quote(name));
                let found = format!("{found}, which {other}[{j}] has, since it has no other");
                checker.require(false, list.index(*i).key(kind).key("name"), "a name of its own", found);
            }
        }
    }

    fn check(&self, root: &Node, sources: &Sources) -> Result<()> {
        let mut checker = Checker::new(root);
        checker.materials = self.materials.keys().map(String::as_str).collect();
        checker.textures = self.textures.keys().map(String::as_str).collect();
        checker.volumes = self.volumes.keys().map(String::as_str).collect();
        checker.media = self.media.keys().map(String::as_str).collect();
        checker.groups = self.groups.keys().map(String::as_str).collect();
        let at = At::ROOT;

        self.camera.check(at.key("camera"), &mut checker);
        self.image.check(at.key("image"), &mut checker);
        self.integrator.check(at.key("integrator"), &mut checker);
        if matches!(self.integrator, Integrator::LightTracer(_)) && !self.layers.is_empty() {
            let expected = "an integrator that follows camera rays, since there are layers";
            checker.require(false, at.key("integrator"), expected, "light_tracer");
        }
        let groups: BTreeSet<&str> = self.light_groups.keys().map(String::as_str).chain([DEFAULT_GROUP]).collect();
        for (i, layer) in self.layers.iter().enumerate() {
            let taken = self.layers[..i].iter().any(|other| layer.clashes(other));
            let at = at.key("layers");
            layer.check(taken, at.index(i), &mut checker);
            if matches!(layer.content, LayerContent::Ways { .. } | LayerContent::LightGroups) {
                let path = matches!(self.integrator, Integrator::Path(_));
                checker.require(path, at.index(i), "the integrator path, which knows the ways of light", "another");
            }
            if let LayerContent::Ways { group: Some(group), .. } = &layer.content {
                checker.known(at.index(i).key("light_group"), "light group", group, &groups);
            }
        }
        self.render.check(at.key("render"), &mut checker);
        let measured = self.layers.iter().any(|layer| matches!(layer.content, LayerContent::Light { .. }));
        let asked = self.render.techniques.light_tracing == Technique::On;
        let place = at.key("render");
        let place = place.key("techniques");
        let expected = "auto or off beside layers of light, which are measured path by path from the camera";
        checker.require(!(measured && asked), place.key("light_tracing"), expected, "on");
        self.output.check(at.key("output"), &mut checker);
        exr_file::check_scene(self, &mut checker);
        for (name, material) in &self.materials {
            material.check(at.key("materials").key(name), &mut checker);
        }
        let groups = at.key("groups");
        for (name, shapes) in &self.groups {
            let at = groups.key(name);
            if shapes.is_empty() {
                checker.fault(at, "expected one shape or more, found an empty list");
            }
            for (i, shape) in shapes.iter().enumerate() {
                shape.check_child(at.index(i), &mut checker);
            }
        }
        for (i, shape) in self.shapes.iter().enumerate() {
            shape.check(at.key("shapes").index(i), &mut checker);
        }
        for (i, light) in self.lights.iter().enumerate() {
            light.check(at.key("lights").index(i), &mut checker);
        }
        self.check_names(&mut checker);
        for (name, medium) in &self.media {
            let media = at.key("media");
            let at = media.key(name);
            for (reserved, what) in [(VACUUM, "empty space"), (UNCHANGED, "the medium on the other side")] {
                if name == reserved {
                    checker.fault(at, format!("expected another name: this one means {what}"));
                }
            }
            medium.check(at, &mut checker);
        }
        if let Some(medium) = &self.medium {
            checker.medium(at.key("medium"), medium);
        }
        if let Some(fog) = &self.fog {
            fog.check(at.key("fog"), &mut checker);
        }
        // Last, for what a texture may hold depends on where it was used.
        self.reflect_through_textures(&mut checker);
        for (name, texture) in &self.textures {
            let reflects = checker.reflecting_textures.contains(name.as_str());
            let role = if reflects { Role::Reflectance } else { Role::Emission };
            texture.check(role, at.key("textures").key(name), &mut checker);
        }
        for (name, volume) in &self.volumes {
            let reflects = checker.reflecting_volumes.contains(name.as_str());
            let role = if reflects { Role::Reflectance } else { Role::Coefficient };
            volume.check(role, at.key("volumes").key(name), &mut checker);
        }
        nesting::check(self, &mut checker);
        checker.finish(sources)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::testing::{CAMERA, faults, parse, reference, scene};
    use super::super::*;
    use crate::error::Error;

    /// Each of many names is found where it stands, below the camera and the name of the section; if it were sought among all of
    /// them that would take most of a minute. What is not there is told at the section.
    #[test]
    fn places_of_many_names_take_no_quadratic_time() {
        const MANY: usize = 150_000;
        let begin = std::time::Instant::now();
        let mut text = format!("{CAMERA}materials:\n");
        (0..MANY).for_each(|i| text += &format!("  m{i}: {{diffuse: {{}}}}\n"));
        let scene = parse(&text).unwrap();
        let line = |field: &str| scene.fault(field, "told").split(':').nth(1).and_then(|line| line.parse().ok());
        for i in 0..MANY {
            assert_eq!(line(&format!("materials.m{i}.diffuse.reflectance")), Some(i + 3));
        }
        assert_eq!(line("materials.m.diffuse"), Some(3));
        assert!(begin.elapsed() < std::time::Duration::from_secs(20));
    }

    #[test]
    fn a_scene_with_everything_becomes_the_structs() {
        let scene = parse(&reference("scene")).unwrap();
        let number = Spectrum::Number;
        let one_of = |x| SpectrumOrTexture::Spectrum(number(x));
        let text = str::to_owned;
        assert_eq!(
            scene.camera,
            Camera {
                pose: Pose::LookAt { origin: [0.0, 3.2, 12.0], target: [0.0, 1.1, 0.0], up: [0.0, 1.0, 0.0] },
                projection: Projection::Perspective { fov_deg: 38.0, fov_axis: FovAxis::X },
                lens: Some(Lens { radius: 0.05, focus_distance: 10.0 }),
                clip: Clip::default(),
                principal_point: [0.0, 0.0],
                shutter: None,
            }
        );
        assert_eq!(scene.image.crop, Some(Crop { x: 0, y: 0, width: 10, height: 10 }));
        let Texture::Image(earth) = &scene.textures["earth"] else { panic!("an image") };
        assert_eq!(*earth.file, *std::path::Path::new("dir/earth.jpg"));
        assert_eq!(
            scene.textures["floor"],
            Texture::Checkerboard(Checkerboard {
                a: one_of(0.1),
                b: SpectrumOrTexture::Spectrum(Spectrum::Rgb([0.9, 0.8, 0.7])),
                scale: [12.0, 12.0],
                uv: None,
            })
        );
        assert_eq!(
            scene.materials["clay"],
            Material::Diffuse(Diffuse {
                reflectance: SpectrumOrTexture::Texture(text("floor")),
                highlight: Some(Highlight { strength: 0.5, exponent: 50.0, model: HighlightModel::Blinn }),
                two_sided: true,
            })
        );
        assert_eq!(
            scene.materials["ring"],
            Material::Conductor(Conductor {
                index: ConductorIndex::Metal(text("gold")),
                tint: one_of(1.0),
                roughness: Roughness::Number(0.0),
                distribution: Distribution::Ggx,
                fresnel: Fresnel::Exact,
                film: Some(Film { ior: Index::Number(2.5), thickness_nm: Thickness::Number(45.0) }),
                highlight: None,
                two_sided: true,
            })
        );
        assert_eq!(scene.materials["silvered"], Material::Mirror(Mirror { reflectance: number(0.9), highlight: None }));
        assert_eq!(
            scene.materials["flint"],
            Material::Dielectric(Dielectric {
                ior: Index::Glass(text("N-SF11")),
                exterior_ior: Index::Number(1.0),
                roughness: Roughness::Number(0.0),
                reflection_tint: one_of(1.0),
                transmission_tint: one_of(1.0),
                priority: Some(2),
                film: None,
                absorption: Some(Absorption::Color(ColorAt { color: number(0.9), at: 0.05 })),
                distribution: Distribution::Ggx,
                fresnel: Fresnel::Exact,
                highlight: None,
            })
        );
        assert_eq!(
            scene.materials["pane"],
            Material::ThinDielectric(ThinDielectric {
                ior: Index::Number(1.5),
                exterior_ior: Index::Number(1.0),
                thickness_nm: None,
                reflection_tint: one_of(1.0),
                transmission_tint: one_of(1.0),
            })
        );
        assert_eq!(
            scene.materials["lacquer"],
            Material::Plastic(Plastic {
                reflectance: SpectrumOrTexture::Spectrum(number(0.5)),
                ior: Index::Number(1.5),
                exterior_ior: Index::Number(1.0),
                roughness: 0.0,
                tint: one_of(1.0),
                nonlinear: false,
                distribution: Distribution::Ggx,
                diffuse_mean: DiffuseMean::Integral,
                highlight: None,
                two_sided: true,
            })
        );
        assert_eq!(scene.materials["edge"], Material::Boundary(Boundary {}));
        assert_eq!(
            scene.media["smoke"],
            Medium::Homogeneous(HomogeneousMedium {
                coefficients: Coefficients::Parts {
                    absorption: number(0.1),
                    scattering: Spectrum::Rgb([0.2, 0.3, 0.4]),
                },
                phase: Phase::Hg(0.5),
                shadow_rays: true,
            })
        );
        assert_eq!(scene.medium.as_deref(), Some("smoke"));
        assert_eq!(scene.fog, Some(Fog { colour: number(0.8), law: FogLaw::Linear { start: 5.0, end: 40.0 } }));
        let ball = &scene.shapes[0];
        assert_eq!(
            *ball,
            Shape {
                name: Some(text("ball")),
                material: MaterialRef::Name(text("clay")),
                emission: Some(SpectrumOrTexture::Spectrum(Spectrum::Blackbody(Blackbody {
                    kelvin: 5000.0,
                    scale: 1.0,
                    normalised: true
                }))),
                emission_direction: Some(EmissionDirection::All),
                sampling_weight: Some(1.0),
                inside: Some(text("smoke")),
                outside: Some(text("smoke")),
                transform: ball.transform.clone(),
                flip_normals: false,
                geometry: Geometry::Sphere(Sphere { center: [0.0, 1.0, 0.0], radius: 1.0, layout: Layout::YUp }),
            }
        );
        assert_eq!(ball.transform.len(), 4);
        let kinds: Vec<&str> = scene.shapes.iter().map(|shape| shape.geometry.kind()).collect();
        assert_eq!(
            kinds,
            [
                "sphere",
                "plane",
                "disk",
                "rectangle",
                "cube",
                "cylinder",
                "cone",
                "mesh",
                "sdf_grid",
                "curves",
                "instance"
            ]
        );
        assert_eq!(scene.shapes[1].material, MaterialRef::default());
        assert_eq!(
            scene.lights[1],
            Light::Spot(SpotLight {
                name: None,
                position: [0.0, 5.0, 0.0],
                aim: Aim::Target([0.0; 3]),
                cutoff_deg: 20.0,
                beam_deg: 15.0,
                intensity: Spectrum::Scaled(Scaled {
                    by: 2.0,
                    of: Box::new(Spectrum::Illuminant(Illuminant { name: text("D65"), scale: 1.0 })),
                }),
                texture: Some(text("earth")),
                up: Some([0.0, 0.0, 1.0]),
                v: Growth::Up,
                sampling_weight: 1.0,
            })
        );
        assert_eq!(scene.directory, std::path::Path::new("dir"));
    }

    #[test]
    fn the_page_states_the_default_beam_of_a_spot() {
        let scene = scene("lights:\n- spot: {position: [0, 1, 0], target: [0, 0, 0], intensity: 1}\n");
        let Light::Spot(spot) = &scene.lights[0] else { panic!("a spot") };
        assert_eq!((spot.cutoff_deg, spot.beam_deg), (20.0, 15.0));
    }

    #[test]
    fn validation_tells_all_faults_at_once_in_the_order_of_the_text() {
        assert_eq!(
            faults(
                "shapes:\n- sphere: {radius: -1, material: flnt}\nmedium: fogg\nmaterials:\n  flint: {mirror: {reflectance: 2}}\n"
            ),
            "dir/s.yaml:3:20: shapes[0].sphere.radius: expected a number greater than 0, found -1\n\
             dir/s.yaml:3:34: shapes[0].sphere.material: unknown material \"flnt\"; did you mean \"flint\"?\n\
             dir/s.yaml:4:9: medium: unknown medium \"fogg\"; the scene defines none\n\
             dir/s.yaml:6:33: materials.flint.mirror.reflectance: expected a number from 0 to 1, found 2"
        );
    }

    /// A production has hundreds.
    #[test]
    fn only_groups_of_lamps_are_at_most_254() {
        let shapes: String = (0..300).map(|i| format!("- sphere: {{radius: 1, name: s{i}, emission: 1}}\n")).collect();
        let groups: Vec<String> = (0..300).map(|i| format!("g{i}: [s{i}]")).collect();
        let told = |field: &str| faults(&format!("shapes:\n{shapes}{field}: {{{}}}\n", groups.join(", ")));
        assert_eq!(told("assets"), "none");
        assert_eq!(told("light_groups"), "dir/s.yaml:303:15: light_groups: expected at most 254 names, found 300");
    }

    #[test]
    fn a_hundred_faults_are_enough() {
        let many = faults(&format!("shapes:\n{}", "- sphere: {radius: 0, material: red}\n".repeat(60)));
        assert_eq!(many.lines().count(), 101);
        assert_eq!(many.lines().last(), Some("and 20 more"));
    }

    /// Each unknown name sorted all that there are: 8 s for 8000, which is 50 s for 20,000.
    #[test]
    fn many_unknown_names_among_many_take_no_quadratic_time() {
        let begin = std::time::Instant::now();
        let shapes = "- sphere: {radius: 1, material: {boundary: {}}}\n".repeat(20_000);
        let names: Vec<String> = (0..20_000).map(|i| format!("unknown{i}")).collect();
        let told = faults(&format!("shapes:\n{shapes}assets: {{a: [{}]}}\n", names.join(", ")));
        assert_eq!(told.lines().last(), Some("and 19900 more"));
        assert!(begin.elapsed() < std::time::Duration::from_secs(20));
    }

    #[test]
    fn the_compiler_can_point_at_a_field() {
        let scene = scene("shapes:\n- mesh: {file: a.ply}\n");
        assert_eq!(
            scene.fault("shapes[0].mesh.file", "cannot be read"),
            "dir/s.yaml:3:16: shapes[0].mesh.file: cannot be read"
        );
        // A default stands where the map around it does.
        assert_eq!(scene.fault("shapes[0].mesh.normals", "none"), "dir/s.yaml:3:9: shapes[0].mesh.normals: none");
        assert_eq!(scene.fault("", "empty"), "dir/s.yaml:1:1: : empty");
    }

    #[test]
    fn a_missing_camera_is_said() {
        assert_eq!(
            parse("image: {}").unwrap_err().to_string(),
            "dir/s.yaml:1:1: expected the field \"camera\", found none"
        );
        let empty = parse("").unwrap_err().to_string();
        assert!(empty.starts_with("dir/s.yaml:1:1: expected a map with fields among "), "{empty}");
    }

    /// Every line of a fault has a place.
    fn is_well_formed(error: &Error) -> bool {
        let placed = |line: &str| {
            let Some(rest) = line.strip_prefix("dir/s.yaml:") else { return line.starts_with("and ") };
            let mut parts = rest.splitn(3, ':');
            let number = |part: Option<&str>| part.is_some_and(|part| part.parse::<u32>().is_ok_and(|n| n > 0));
            number(parts.next()) && number(parts.next()) && parts.next().is_some()
        };
        match error {
            Error::Config(text) => text.lines().all(placed),
            Error::Input { .. } => true,
            Error::Output { .. } | Error::Threads { .. } | Error::System(_) => false,
            Error::Render(_) | Error::Memory(_) | Error::Stopped(_) => false,
        }
    }

    /// Pieces that break documents.
    const SHARDS: [&str; 24] = [
        "\t", "\n", "  ", "- ", ": ", "{", "}", "[", "]", "&a ", "*a", "<<: ", "!t ", "\"", "'", "#", "|\n", "? ",
        "---\n", "null", "1e999", ".nan", "-1", "\u{feff}",
    ];

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn a_damaged_scene_is_read_or_refused_with_a_place(
            damage in prop::collection::vec((any::<prop::sample::Index>(), 0usize..6, 0..SHARDS.len()), 1..6)
        ) {
            let mut text: Vec<char> = reference("scene").chars().collect();
            for (at, cut, shard) in damage {
                let at = at.index(text.len());
                let end = (at + cut).min(text.len());
                text.splice(at..end, SHARDS[shard].chars());
            }
            let text: String = text.into_iter().collect();
            if let Err(error) = parse(&text) {
                prop_assert!(is_well_formed(&error), "{}", error);
            }
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut sources = super::Sources::default();
            let path = std::path::Path::new("dir/s.yaml");
            if let Err(error) = super::edit::read_bytes_as(&bytes, path, &mut sources) {
                prop_assert!(is_well_formed(&error), "{}", error);
            }
        }

        #[test]
        fn any_value_of_a_field_is_read_or_refused(value in "[-+.0-9eE\\[\\]{}, a-z:\"]{0,20}") {
            for field in ["image", "integrator", "render", "shapes", "lights", "materials", "fog", "textures"] {
                if let Err(error) = parse(&format!("{CAMERA}{field}: {value}\n")) {
                    prop_assert!(is_well_formed(&error), "{}", error);
                }
            }
        }
    }
}
