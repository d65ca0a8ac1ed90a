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
mod integrator;
mod light;
mod meshes;
mod sensor;
mod shape;
mod sides;
mod spectra;
mod surface;
mod textures;
mod volumes;
mod xml;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::super::node::{Entry, Node, Sources, Value};
use super::super::path::{self, Segment, field};
use super::super::print::{Printer, relative};
use super::super::scene::SceneDescription;
use super::super::settings::Render;
use super::super::texture::Texture;
use super::{DAYLIGHT, FILM, SKY_FROM_MITSUBA};
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

/// What Mitsuba makes of a picture file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureRead {
    /// Whether it finds more than grey. In what cannot be read it does.
    pub coloured: bool,
    /// What it has to read in place of a file that it refuses or takes for another picture.
    pub anew: Option<PictureAnew>,
}

/// A picture that is written for Mitsuba.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureAnew {
    /// By which the kind of its file is known.
    pub extension: &'static str,
    /// The file.
    pub bytes: Vec<u8>,
    /// Whether it has colours in place of spectra.
    pub loses_spectra: bool,
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

/// What gives a mesh as a PLY where Mitsuba does not read the same from its file; of attributes those of these names matter.
pub type PlyAnew<'a> = dyn Fn(&Path, u32, &BTreeSet<&str>) -> Option<Vec<u8>> + 'a;

/// What is asked of mesh `index` of a file.
pub struct Meshes<'a> {
    /// Where its normals point.
    pub normals: &'a dyn Fn(&Path, u32) -> MeshNormals,
    /// It anew, if need be.
    pub anew: &'a PlyAnew<'a>,
    /// Whether it has no texture coordinates.
    pub bare: &'a dyn Fn(&Path, u32) -> bool,
    /// The mean of its attribute of this name as one number, where that has three.
    pub mean_of_three: &'a dyn Fn(&Path, u32, &str) -> Option<f64>,
}

/// Writes `scene` for the file `path`. `pictures` tells what Mitsuba makes of a picture, `closed` whether the grid of a file bounds a
/// solid.
pub fn export(
    scene: &SceneDescription,
    path: &Path,
    meshes: &Meshes<'_>,
    pictures: &dyn Fn(&Path) -> PictureRead,
    closed: &dyn Fn(&Path) -> bool,
) -> Exported {
    let nothing = Node::new(Default::default(), Value::Null);
    let no_sources = Sources::default();
    let (root, sources) = scene.tree().unwrap_or((&nothing, &no_sources));
    let stem = path.file_stem().map_or(String::new(), |stem| format!("{}.", stem.to_string_lossy()));
    let directory = path.parent().unwrap_or(Path::new(""));
    let (losses, files) = (Vec::new(), Vec::new());
    let (ids, mentioned, new_meshes, images) = (BTreeSet::new(), BTreeSet::new(), BTreeMap::new(), BTreeMap::new());
    let xml = Xml::default();
    // Each file is read once.
    let known = RefCell::default();
    let normals = &|file: &Path, index: u32| once(&known, (file.to_owned(), index), || (meshes.normals)(file, index));
    let asked = scene.textures.values().filter_map(|texture| match texture {
        Texture::MeshAttribute(attribute) => Some(attribute.name.as_str()),
        Texture::Image(_) | Texture::Checkerboard(_) | Texture::Volume(_) => None,
    });
    let asked: BTreeSet<&str> = asked.collect();
    let known = RefCell::default();
    let anew = &|file: &Path, index: u32| {
        once(&known, (file.to_owned(), index), || (meshes.anew)(file, index, &asked).map(Contents::from))
    };
    let known = RefCell::default();
    let mean_of_three = &|file: &Path, index: u32, name: &str| {
        once(&known, (file.to_owned(), index, name.to_owned()), || (meshes.mean_of_three)(file, index, name))
    };
    let known = RefCell::default();
    let pictures = &|file: &Path| once(&known, file.to_owned(), || Rc::new(pictures(file)));
    let known = RefCell::default();
    let closed = &|file: &Path| once(&known, file.to_owned(), || closed(file));
    let known = RefCell::default();
    let bare = &|file: &Path, index: u32| once(&known, (file.to_owned(), index), || (meshes.bare)(file, index));
    let mut export = Export {
        scene,
        root,
        sources,
        normals,
        anew,
        pictures,
        closed,
        bare,
        mean_of_three,
        directory,
        stem,
        ids,
        mentioned,
        xml,
        losses,
        files,
        meshes: new_meshes,
        images,
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
    pictures: &'a dyn Fn(&Path) -> Rc<PictureRead>,
    closed: &'a dyn Fn(&Path) -> bool,
    bare: &'a dyn Fn(&Path, u32) -> bool,
    mean_of_three: &'a dyn Fn(&Path, u32, &str) -> Option<f64>,
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
    /// Those that stand for a picture.
    images: BTreeMap<PathBuf, String>,
}

/// Settings that are about the files, not about the light, and what Mitsuba has no words for: it has other words for some, but the
/// same ones mean other things.
const SETTINGS: [&str; 5] = ["output", "fog", "layers", "light_groups", "assets"];

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
            }
        }
        if self.scene.fog.is_some() {
            self.lose("fog", "nothing: Mitsuba has no fog by depth");
        }
        if !self.scene.layers.is_empty() {
            self.lose("layers", "the picture alone: layers are not written for Mitsuba");
        }
        self.render();
        self.integrator();
        self.sensor();
        for (name, texture) in &self.scene.textures {
            self.texture(name, texture);
        }
        let used = self.used_materials();
        for (name, material) in self.scene.materials.iter().filter(|(name, _)| used.contains(name.as_str())) {
            let id = self.id(name, "bsdf");
            self.material(&field(&["materials", name]), material, Some(&id));
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

    /// How the picture is rendered. How many samples are taken the parameter of the file says, to both.
    fn render(&mut self) {
        let Render { samples, stop, .. } = &self.scene.render;
        // Where they are drawn until a target is reached, their number is none of the file's.
        let has_target = stop.error.is_some() || stop.time.is_some();
        let said_by_parameter = |key: &str| key == "samples" || key == "stop" && !has_target;
        let says_more = |entry: &&Entry| !said_by_parameter(&entry.key) && !matches!(entry.node.value, Value::Null);
        if let Some(Value::Map(entries)) = self.root.get("render").map(|node| &node.value) {
            for entry in entries.iter().filter(says_more) {
                let yaml = self.yaml(&entry.node);
                self.xml.instruction(&format!("set {}: {yaml}", field(&["render", &entry.key])));
            }
        }
        let samples = if has_target { *samples } else { self.scene.render.most_samples() };
        self.xml.leaf("default", &[("name", "spp"), ("value", &samples.to_string())]);
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
        // What looks like such an end would be taken away, and an empty id is none.
        if taken || name.is_empty() || name.ends_with(&format!(" ({kind})")) {
            format!("{name} ({kind})")
        } else {
            name.to_owned()
        }
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
        Printer::new(self.sources, self.directory).flow(node)
    }

    /// A path as it is written in the file.
    fn file(&self, file: &Path) -> String {
        relative(file, self.directory).to_string_lossy().into_owned()
    }
}
