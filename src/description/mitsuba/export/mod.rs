//! Scenes of the grammar as Mitsuba 3 XML.
//!
//! What Mitsuba can express becomes its plugins. What it cannot is told as a [`Loss`], and stands in
//! the file twice: as the nearest thing that Mitsuba has, for Mitsuba, and before it as it was
//! written, in a processing instruction, which Mitsuba passes over and the importer reads:
//!
//! ```xml
//! <?abbe set render.seed: 7?>
//! <?abbe instead bsdf: {dielectric: {ior: {glass: N-SF11}}}?>
//! <bsdf type="dielectric" id="flint"><float name="int_ior" value="1.785"/></bsdf>
//! <?abbe end?>
//! ```
//!
//! So reading the file back gives the scene. Mitsuba's picture of it is brighter by the factor of
//! [`FILM`](super::FILM), everywhere and evenly.
//!
//! Ids are one list in Mitsuba and one for each kind in the grammar: where two kinds share a name, the
//! id of one ends in its kind, `floor (texture)`, which the importer takes away.

mod compounds;
mod light;
mod shape;
mod spectra;
mod surface;
mod textures;
mod volumes;
mod xml;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::DVec3;

use super::super::camera::{Camera, Clip, FovAxis, Lens, Pose, Projection};
use super::super::image::{Band, Filter, Image};
use super::super::light::Light;
use super::super::node::{Node, Sources, Value};
use super::super::path::{self, Segment, field};
use super::super::print::{Printer, relative};
use super::super::scene::SceneDescription;
use super::super::settings::{Coverage, Integrator, Technique};
use super::{DAYLIGHT, FILM, SKY_FROM_MITSUBA};
use spectra::can_be_band;
use xml::Xml;

/// Something that Mitsuba cannot express.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// The field, as `shapes[3].cone`.
    pub field: String,
    /// What stands in its place.
    pub instead: String,
}

/// A scene for Mitsuba.
#[derive(Clone, Debug)]
pub struct Exported {
    /// The text of the scene file.
    pub xml: String,
    /// What it cannot say, in the order of the text.
    pub losses: Vec<Loss>,
    /// Files that it names and that do not exist yet: name, beside the scene, and content.
    pub files: Vec<(String, Vec<u8>)>,
}

/// Where the normals of a mesh file point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshNormals {
    /// It has none.
    Missing,
    /// To the side from which its corners are counterclockwise, over most of the area.
    Outward,
    /// To the other.
    Inward,
}

/// Writes `scene` for the file `path`. `normals` reads mesh `index` of a file, `anew` gives a PLY of it where Mitsuba does not read
/// the same from the file, `closed` tells whether the grid of one bounds a solid.
pub fn export(
    scene: &SceneDescription,
    path: &Path,
    normals: &dyn Fn(&Path, u32) -> MeshNormals,
    anew: &dyn Fn(&Path, u32) -> Option<Vec<u8>>,
    closed: &dyn Fn(&Path) -> bool,
) -> Exported {
    let nothing = Node::new(Default::default(), Value::Null);
    let no_sources = Sources::default();
    let (root, sources) = scene.tree().unwrap_or((&nothing, &no_sources));
    let stem = path.file_stem().map_or(String::new(), |stem| format!("{}.", stem.to_string_lossy()));
    let directory = path.parent().unwrap_or(Path::new(""));
    let (losses, files) = (Vec::new(), Vec::new());
    let (ids, mentioned, meshes) = (BTreeSet::new(), BTreeSet::new(), BTreeMap::new());
    let xml = Xml::default();
    // Each file is read once.
    let known = RefCell::default();
    let normals = &|file: &Path, index: u32| once(&known, (file.to_owned(), index), || normals(file, index));
    let known = RefCell::default();
    let anew =
        &|file: &Path, index: u32| once(&known, (file.to_owned(), index), || anew(file, index).map(Contents::from));
    let known = RefCell::default();
    let closed = &|file: &Path| once(&known, file.to_owned(), || closed(file));
    let mut export = Export {
        scene,
        root,
        sources,
        normals,
        anew,
        closed,
        directory,
        stem,
        ids,
        mentioned,
        xml,
        losses,
        files,
        meshes,
    };
    export.scene();
    export.missing_light();
    let Export { xml, mut losses, files, .. } = export;
    let mut told = BTreeSet::new();
    losses.retain(|loss| told.insert((loss.field.clone(), loss.instead.clone())));
    Exported { xml: xml.finish(), losses, files }
}

/// What is `known` of `key`, else what `read` finds, which is known from then on.
fn once<K: Ord, V: Clone>(known: &RefCell<BTreeMap<K, V>>, key: K, read: impl FnOnce() -> V) -> V {
    known.borrow_mut().entry(key).or_insert_with(read).clone()
}

/// Of a file.
type Contents = Rc<[u8]>;

struct Export<'a> {
    scene: &'a SceneDescription,
    root: &'a Node,
    sources: &'a Sources,
    normals: &'a dyn Fn(&Path, u32) -> MeshNormals,
    anew: &'a dyn Fn(&Path, u32) -> Option<Contents>,
    closed: &'a dyn Fn(&Path) -> bool,
    directory: &'a Path,
    /// Before the names of files that are written beside the scene.
    stem: String,
    /// Ids that shapes and lights have.
    ids: BTreeSet<String>,
    /// Texts in what is written as it was: a name of a volume among them needs that volume.
    mentioned: BTreeSet<String>,
    xml: Xml,
    losses: Vec<Loss>,
    files: Vec<(String, Vec<u8>)>,
    /// Those of them that stand for a mesh of a file.
    meshes: BTreeMap<(PathBuf, u32), String>,
}

/// Settings that are about the work and the files, not about the light: Mitsuba has other words for
/// some, but the same ones mean other things.
const SETTINGS: [&str; 6] = ["render", "output", "fog", "layers", "light_groups", "assets"];

/// All that is said, in one sentence; `None` of nothing.
fn joined(said: impl IntoIterator<Item = Option<String>>) -> Option<String> {
    let all: Vec<String> = said.into_iter().flatten().collect();
    (!all.is_empty()).then(|| all.join("; "))
}

/// Whether a file has this extension.
fn ends_in(file: &Path, extension: &str) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

impl<'a> Export<'a> {
    fn scene(&mut self) {
        self.xml.open("scene", &[("version", "3.0.0")]);
        for key in SETTINGS {
            if let Some(node) = self.root.get(key) {
                let yaml = self.yaml(node);
                self.xml.instruction(&format!("set {key}: {yaml}"));
                if key == "fog" {
                    self.lose("fog", "nothing: Mitsuba has no fog by depth");
                }
            }
        }
        let samples = self.scene.render.samples.to_string();
        self.xml.leaf("default", &[("name", "spp"), ("value", &samples)]);
        self.integrator();
        self.sensor();
        for (name, texture) in &self.scene.textures {
            self.texture(name, texture);
        }
        let used = self.used_materials();
        for (name, material) in self.scene.materials.iter().filter(|(name, _)| used.contains(name.as_str())) {
            self.material(&field(&["materials", name]), material, Some(name));
        }
        for (name, medium) in &self.scene.media {
            self.medium(name, medium);
        }
        for (name, shapes) in &self.scene.groups {
            self.group(name, shapes);
        }
        for (i, shape) in self.scene.shapes.iter().enumerate() {
            self.shape("shapes", i, shape);
        }
        for (i, light) in self.scene.lights.iter().enumerate() {
            self.light(i, light);
        }
        // Volumes stand where they are used, but what is written as it was knows them by name.
        let volumes = self.scene.volumes.keys().filter(|name| self.mentioned.contains(*name));
        for name in volumes.collect::<Vec<_>>() {
            if let Some(node) = self.named("volumes", name) {
                let yaml = self.yaml(node);
                self.xml.instruction(&format!("set {}: {yaml}", field(&["volumes", name])));
            }
        }
        self.xml.close();
    }

    /// Says which light Mitsuba's integrators do not know.
    fn missing_light(&mut self) {
        let shapes = || self.scene.shapes.iter().chain(self.scene.groups.values().flatten());
        let path = match &self.scene.integrator {
            Integrator::Path(path) => path,
            Integrator::LightTracer(tracer) => {
                let open = shapes().any(|shape| self.is_open(&shape.material));
                if open && tracer.max_depth.is_some() && !tracer.count_crossings {
                    let what = "shorter paths where panes, masks and boundaries end a segment";
                    self.lose("integrator.light_tracer.count_crossings", what);
                }
                return;
            }
            _ => return,
        };
        let delta = |light: &Light| match light {
            Light::Directional(l) => l.angle_deg == 0.0,
            _ => !light.is_around(),
        };
        if !path.opaque_sky && !path.hide_emitters && self.scene.lights.iter().any(Light::is_around) {
            self.lose("integrator.path.opaque_sky", "an alpha of 1 where light from infinity is seen");
        }
        if path.coverage == Coverage::Surfaces && shapes().any(|shape| self.is_pane(&shape.material)) {
            self.lose("integrator.path.coverage", "the alpha of what is behind them where light goes through panes");
        }
        let traced = path.delta_caustics && self.scene.render.techniques.light_tracing != Technique::Off;
        let throws = shapes().any(|shape| self.is_single(&shape.material));
        if traced && throws && self.scene.lights.iter().any(delta) {
            self.lose(
                "integrator.path.delta_caustics",
                "no light that mirrors, glass and smooth coats throw of lights without extent",
            );
        }
    }

    /// Names of the materials that shapes have, or that such materials are made of.
    fn used_materials(&self) -> BTreeSet<&'a str> {
        let mut used = BTreeSet::new();
        let mut open: Vec<&Node> = ["shapes", "groups"].iter().filter_map(|key| self.root.get(key)).collect();
        while let Some(node) = open.pop() {
            match &node.value {
                Value::List(items) => open.extend(items),
                Value::Map(entries) => open.extend(entries.iter().map(|entry| &entry.node)),
                // Any text may be a name; one that is not used does no harm.
                Value::Text(text) => {
                    if let Some((name, _)) = self.scene.materials.get_key_value(text)
                        && used.insert(name.as_str())
                    {
                        open.extend(self.named("materials", name));
                    }
                }
                _ => {}
            }
        }
        used
    }

    /// What is written under a name of a section.
    fn named(&self, section: &str, name: &str) -> Option<&'a Node> {
        self.scene.node(&[section, name].map(|key| Segment::Key(key.to_owned())))
    }

    /// An id for something of a kind that has this name.
    fn id(&mut self, name: &str, kind: &str) -> String {
        let [materials, textures] = [self.scene.materials.contains_key(name), self.scene.textures.contains_key(name)];
        let taken = match kind {
            "bsdf" => false,
            "texture" => materials,
            "medium" => materials || textures,
            _ => materials || textures || self.scene.media.contains_key(name),
        };
        if taken { format!("{name} ({kind})") } else { name.to_owned() }
    }

    /// Says that Mitsuba gets something else.
    fn lose(&mut self, field: &str, instead: impl Into<String>) {
        self.losses.push(Loss { field: field.to_owned(), instead: instead.into() });
    }

    /// Begins what stands for a field that Mitsuba cannot express; `end` closes it.
    fn instead(&mut self, tag: &str, field: &str, instead: impl Into<String>) {
        self.lose(field, instead);
        self.restate(tag, field);
    }

    /// Begins what says a field in another way, which reading it back shall not take; `end` closes it.
    fn restate(&mut self, tag: &str, field: &str) {
        let node = path::parse(field).ok().and_then(|path| self.scene.node(&path));
        if let Some(node) = node {
            self.mention(node);
        }
        let yaml = node.map_or("{}".to_owned(), |node| self.yaml(node));
        self.xml.instruction(&format!("instead {tag}: {yaml}"));
    }

    /// Remembers the texts of what is written as it was.
    fn mention(&mut self, node: &Node) {
        match &node.value {
            Value::List(items) => items.iter().for_each(|item| self.mention(item)),
            Value::Map(entries) => entries.iter().for_each(|entry| self.mention(&entry.node)),
            Value::Text(text) => {
                self.mentioned.insert(text.clone());
            }
            _ => {}
        }
    }

    fn end(&mut self) {
        self.xml.instruction("end");
    }

    fn yaml(&self, node: &Node) -> String {
        Printer { sources: self.sources, directory: self.directory }.flow(node)
    }

    /// A path as it is written in the file.
    fn file(&self, file: &Path) -> String {
        relative(file, self.directory).to_string_lossy().into_owned()
    }

    fn integrator(&mut self) {
        // Theirs counts the crossing of a pane as scattering, unless it is the one for media, which alone sees them.
        let media = !self.scene.media.is_empty();
        let counts = matches!(&self.scene.integrator, Integrator::Path(path) if path.count_crossings);
        let plugin = if counts && !media { "path" } else { "volpath" };
        let (plugin, depth, roulette, hidden) = match &self.scene.integrator {
            Integrator::Depth(_) => {
                self.xml.open("integrator", &[("type", "depth")]);
                self.xml.close();
                return;
            }
            Integrator::LightTracer(tracer) if !media => {
                ("ptracer", tracer.max_depth, tracer.roulette_depth, tracer.hide_emitters)
            }
            Integrator::Path(path) => {
                if path.light_samples != 1 || path.scatter_samples != 1 {
                    self.lose("integrator.path", "one shadow ray and one scattered ray at each surface");
                }
                if counts && media {
                    let what =
                        "longer paths where panes, masks and boundaries end a segment, or lamps behind them hidden";
                    self.lose("integrator.path.count_crossings", what);
                }
                (plugin, path.max_depth, path.roulette_depth, path.hide_emitters)
            }
            other => {
                let (tag, what) = match other {
                    Integrator::Whitted(_) => ("whitted", "a path tracer: Mitsuba has no Whitted ray tracer"),
                    Integrator::LightTracer(_) => ("light_tracer", "a path tracer: Mitsuba's ptracer sees no media"),
                    _ => ("", "a path tracer"),
                };
                let field = if tag.is_empty() { "integrator".to_owned() } else { format!("integrator.{tag}") };
                self.lose(&field, what);
                let yaml = self.root.get("integrator").map(|node| self.yaml(node)).unwrap_or_default();
                self.xml.instruction(&format!("instead integrator: {yaml}"));
                self.xml.open("integrator", &[("type", plugin)]);
                self.xml.close();
                self.end();
                return;
            }
        };
        self.xml.open("integrator", &[("type", plugin)]);
        if let Some(depth) = depth {
            self.xml.value("integer", "max_depth", depth);
        }
        self.xml.value("integer", "rr_depth", roulette);
        if hidden {
            self.xml.value("boolean", "hide_emitters", true);
        }
        self.xml.close();
        match &self.scene.integrator {
            Integrator::Path(path) => {
                let coverage = match path.coverage {
                    Coverage::Surfaces => "surfaces",
                    Coverage::Scattering => "scattering",
                    Coverage::FirstHit => "first_hit",
                };
                let fields = [
                    ("opaque_sky", "false".to_owned(), !path.opaque_sky),
                    ("coverage", coverage.to_owned(), path.coverage != Coverage::Scattering),
                    ("delta_caustics", "true".to_owned(), path.delta_caustics),
                    ("count_crossings", "true".to_owned(), counts && media),
                    ("light_samples", path.light_samples.to_string(), path.light_samples != 1),
                    ("scatter_samples", path.scatter_samples.to_string(), path.scatter_samples != 1),
                ];
                for (key, value, _) in fields.iter().filter(|(.., differs)| *differs) {
                    self.xml.instruction(&format!("set integrator.path.{key}: {value}"));
                }
            }
            Integrator::LightTracer(tracer) if !tracer.count_crossings => {
                self.xml.instruction("set integrator.light_tracer.count_crossings: false");
            }
            _ => {}
        }
    }

    fn sensor(&mut self) {
        let Camera { pose, projection, lens, clip, principal_point, shutter: _ } = &self.scene.camera;
        if self.scene.motion.is_some() {
            self.lose("camera.shutter", "the scene at its frame: what is exported does not move");
        }
        let Image { width, height, filter, crop, overscan, sample_border, sensitivity, .. } = &self.scene.image;
        if ![1.0, FILM].contains(sensitivity) {
            self.lose("image.sensitivity", "a film of sensitivity 1");
        }
        if *overscan > 0 {
            self.lose("image.overscan", "the frame: Mitsuba's film ends at its edge");
            self.xml.instruction(&format!("set image.overscan: {overscan}"));
        }
        // The film's unit is theirs.
        let yaml = Node::new(self.root.place, Value::Float(*sensitivity));
        let yaml = self.yaml(&yaml);
        self.xml.instruction(&format!("set image.sensitivity: {yaml}"));
        let plugin = match (projection, lens) {
            (Projection::Orthographic { .. }, _) => "orthographic",
            (Projection::Perspective { .. }, Some(_)) => "thinlens",
            (Projection::Perspective { .. }, None) => "perspective",
        };
        self.xml.open("sensor", &[("type", plugin)]);
        self.xml.open("transform", &[("name", "to_world")]);
        // Theirs shows −1 to 1 across the width.
        let half = match projection {
            Projection::Orthographic { height: shown } => Some(0.5 * shown * f64::from(*width) / f64::from(*height)),
            Projection::Perspective { .. } => None,
        };
        if let Some(half) = half {
            self.xml.leaf("scale", &[("x", &half.to_string()), ("y", &half.to_string())]);
        }
        match pose {
            Pose::LookAt { origin, target, up } => {
                let [origin, target, up] = [origin, target, up].map(|v| xml::numbers(v));
                self.xml.leaf("lookat", &[("origin", &origin), ("target", &target), ("up", &up)]);
            }
            Pose::ToWorld(rows) => {
                // Theirs has +x to the left.
                let rows = rows.map(|[x, y, z, w]| [-x, y, z, w]);
                self.xml.leaf("matrix", &[("value", &xml::numbers(rows.as_flattened()))]);
            }
        }
        self.xml.close();
        if let (Some(half), Some(lens)) = (half, lens) {
            self.lose("camera.lens", "none: Mitsuba's orthographic camera has no lens");
            // It is made larger with the rest of the camera.
            let Lens { radius, focus_distance } = lens;
            let radius = radius / half;
            self.xml.instruction(&format!("set camera.lens: {{radius: {radius}, focus_distance: {focus_distance}}}"));
        }
        if let Projection::Perspective { fov_deg, fov_axis } = projection {
            let axis = match fov_axis {
                FovAxis::X => "x",
                FovAxis::Y => "y",
                FovAxis::Smaller => "smaller",
                FovAxis::Larger => "larger",
                FovAxis::Diagonal => "diagonal",
            };
            self.xml.value("float", "fov", fov_deg);
            self.xml.value("string", "fov_axis", axis);
        }
        if *principal_point != [0.0; 2] && plugin == "perspective" {
            // Theirs says where the middle of the picture looks, ours where the axis falls on it.
            self.xml.value("float", "principal_point_offset_x", -principal_point[0]);
            self.xml.value("float", "principal_point_offset_y", -principal_point[1]);
        } else if *principal_point != [0.0; 2] {
            let what = "the middle of the picture: Mitsuba has another for a pinhole with a perspective alone";
            self.lose("camera.principal_point", what);
            self.xml.instruction(&format!("set camera.principal_point: {principal_point:?}"));
        }
        if *clip == Clip::default() {
            // Theirs always ends somewhere.
            self.xml.instruction("set camera.clip: {near: 0}");
        }
        // As an import has it.
        let scale = match (pose, projection) {
            (Pose::ToWorld(rows), Projection::Orthographic { .. }) => {
                DVec3::from_array([0, 1, 2].map(|i| rows[i][2])).length()
            }
            _ => 1.0,
        };
        let begin = clip.near / scale;
        self.xml.value("float", "near_clip", if begin > 0.0 { begin } else { 1e-4 });
        self.xml.value("float", "far_clip", (clip.far - (clip.near - begin)).min(1e8));
        if let (Some(lens), "thinlens") = (lens, plugin) {
            self.xml.value("float", "aperture_radius", lens.radius);
            self.xml.value("float", "focus_distance", lens.focus_distance);
        }
        if let Some(medium) = &self.scene.medium {
            let id = self.id(medium, "medium");
            self.xml.leaf("ref", &[("name", "medium"), ("id", &id)]);
        }
        self.xml.open("sampler", &[("type", "independent")]);
        self.xml.value("integer", "sample_count", "$spp");
        self.xml.close();
        let bands = self.bands();
        self.xml.open("film", &[("type", if bands.is_empty() { "hdrfilm" } else { "specfilm" })]);
        self.xml.value("integer", "width", width);
        self.xml.value("integer", "height", height);
        if let Some(crop) = crop {
            self.xml.value("integer", "crop_offset_x", crop.x);
            self.xml.value("integer", "crop_offset_y", crop.y);
            self.xml.value("integer", "crop_width", crop.width);
            self.xml.value("integer", "crop_height", crop.height);
        }
        for band in bands {
            self.band(&band.name, &band.response);
        }
        if bands.is_empty() {
            self.xml.value("string", "pixel_format", "rgba");
        }
        self.xml.value("string", "component_format", "float32");
        if *sample_border {
            self.xml.value("boolean", "sample_border", true);
        }
        self.filter(*filter);
        self.xml.close();
        self.xml.close();
        // The importer would map what the film says to `output`, where nothing else is set.
        if self.root.get("output").is_none() {
            self.xml.instruction("set output: {}");
        }
    }

    /// The bands of the film, where Mitsuba has words for all of them.
    fn bands(&mut self) -> &'a [Band] {
        let bands = &self.scene.image.bands;
        if bands.iter().all(|band| can_be_band(&band.response)) {
            return bands;
        }
        self.lose("image.bands", "colour: Mitsuba has no words for the response of a band");
        if let Some(node) = self.root.get("image").and_then(|image| image.get("bands")) {
            let yaml = self.yaml(node);
            self.xml.instruction(&format!("set image.bands: {yaml}"));
        }
        &[]
    }

    fn filter(&mut self, filter: Filter) {
        let (plugin, fields): (&str, &[(&str, f64)]) = match filter {
            Filter::Box => ("box", &[]),
            Filter::Tent { radius } => ("tent", &[("radius", radius)]),
            Filter::Gaussian { stddev, .. } => ("gaussian", &[("stddev", stddev)]),
            Filter::Mitchell { b, c } => ("mitchell", &[("B", b), ("C", c)]),
            Filter::CatmullRom => ("catmullrom", &[]),
            Filter::Lanczos { .. } => ("lanczos", &[]),
        };
        self.xml.open("rfilter", &[("type", plugin)]);
        for (name, value) in fields {
            self.xml.value("float", name, value);
        }
        if let Filter::Lanczos { radius } = filter {
            let lobes = radius.round().max(1.0);
            self.xml.value("integer", "lobes", lobes);
            if lobes != radius {
                self.lose("image.filter", format!("{lobes} lobes: Mitsuba's are whole"));
                self.xml.instruction(&format!("set image.filter: {{lanczos: {{radius: {radius}}}}}"));
            }
        }
        self.xml.close();
    }
}
