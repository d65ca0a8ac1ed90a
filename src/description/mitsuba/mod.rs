//! Mitsuba 3's XML scenes, translated into the grammar of this room.
//!
//! Text becomes elements ([`xml`]), elements become objects ([`parse`]), and the files named after
//! families turn objects into the [`Node`]s that a person would have written in YAML; each node
//! keeps its place in the XML. From there on nothing knows where a scene came from: the decoder,
//! its checks and `--set` are the same.
//!
//! # Conventions that are translated
//! - Mitsuba's cameras look along +z with +x to the left; ours have +x to the right.
//! - Its film divides by 106.7502593994 where ours divides by the integral of ȳ, 106.8569: the
//!   picture is multiplied by the ratio, [`FILM`], and what is defined by its colour under D65 is
//!   divided by it (and made 0.01 % darker, as their D65 is: [`DAYLIGHT`]).
//! - `<rgb>` and `<float>` of a light are colours under D65; `<spectrum>` is radiance as it stands.
//!   Outside its wavelengths a `<spectrum>` is zero, also a reflectance.
//! - Surfaces reflect on the side of their normal only, unless `twosided`; shapes shine on it only.
//!
//! A plugin or parameter that is not translated is a fault with its place, never passed over.

mod bsdfs;
mod compounds;
mod daylight;
mod emitters;
pub(crate) mod export;
mod hair;
mod indices;
mod integrators;
mod media;
mod metals;
mod nodes;
mod object;
mod parse;
mod principled;
mod sensors;
mod shapes;
mod spectra;
mod textures;
mod turns;
mod volumes;
mod xml;

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::{DMat3, DVec3};

use super::edit::Setting;
use super::fault::Fault;
use super::medium::{UNCHANGED, VACUUM};
use super::node::{Entry, Node, Place, Sources, Value};
use super::yaml::{MAX_NODES, weight};
use crate::error::Result;
use nodes::{Fields, boolean, entry, list, matrix, number, numbers, text, whole};
use object::{Bag, Document, Family, Object};
pub(crate) use parse::Define;

/// Ratio of the integral of ȳ, by which our film divides, to the constant of Mitsuba's film.
const FILM: f64 = 106.856_914_916_767 / 106.750_259_399_414_06;

/// What Mitsuba's D65 of scale 1 is of ours. Ours has luminance 1. Theirs has 0.999894136 on their film:
/// the integral of its table, divided by 98.997417518762 there, against ȳ over 106.7502594.
const DAYLIGHT: f64 = 0.999_894_136 / FILM;

/// Turns Mitsuba's frame of a sky, +z up and +x where the sun of noon stands, into ours, +y up and that at −z.
const SKY_FROM_MITSUBA: DMat3 = DMat3::from_cols(DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y);

/// Parameters of a scene that are about the structures in which Mitsuba looks for surfaces.
const SEARCH: [&str; 12] = [
    "allow_thread_reordering",
    "compact_acceleration_structures",
    "embree_use_robust_intersections",
    "kd_clip",
    "kd_empty_space_bonus",
    "kd_exact_primitive_threshold",
    "kd_intersection_cost",
    "kd_max_depth",
    "kd_min_max_bins",
    "kd_retract_bad_splits",
    "kd_stop_prims",
    "kd_traversal_cost",
];

/// Whether a file holds a Mitsuba scene: by its name.
pub(crate) fn is_xml(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"))
}

/// Reads a scene as a tree of the grammar, with values for its parameters.
///
/// # Errors
/// [`Error::Config`](crate::error::Error::Config) with the first fault;
/// [`Error::Input`](crate::error::Error::Input) for a file that cannot be read.
pub(crate) fn read(path: &Path, defines: &[Define], sources: &mut Sources) -> Result<Node> {
    let document = parse::read(path, defines, sources)?;
    let sees_media = integrators::sees_media(&document).map_err(|fault| fault.into_error(sources))?;
    let import = Import { sees_media, ..Import::new(&document) };
    let (root, notes) = import.scene().map_err(|fault| fault.into_error(sources))?;
    notes.into_iter().for_each(|(place, message)| sources.note(place, message));
    if !sees_media && let Some(medium) = document.objects.iter().find(|object| object.family == Family::Medium) {
        let message = "medium: it is passed over, with all others: the scene's integrator sees none, volpath does";
        sources.note(medium.place, message.to_owned());
    }
    let mut sensors = Bag::new(&document, 0).objects(Family::Sensor).into_iter().map(|i| document.objects[i].place);
    if let Some(first) = sensors.next().map(|place| sources.describe(place)) {
        for other in sensors {
            sources.note(other, format!("sensor: it is passed over, for the first one takes the picture, at {first}"));
        }
    }
    Ok(root)
}

/// A translation under way.
struct Import<'a> {
    document: &'a Document,
    textures: Vec<Entry>,
    materials: Vec<Entry>,
    volumes: Vec<Entry>,
    media: Vec<Entry>,
    groups: Vec<Entry>,
    shapes: Vec<Node>,
    lights: Vec<Node>,
    /// Under which name an object stands in one of the maps.
    names: HashMap<usize, String>,
    /// Under which name a texture stands there a second time, for numbers.
    for_numbers: HashMap<(usize, textures::Use), String>,
    /// Groups without shapes.
    empty: HashSet<usize>,
    /// The emitters that shapes have.
    shining: HashSet<usize>,
    /// Names that no other object may be given.
    taken: HashSet<String>,
    /// Whether there are media.
    has_media: bool,
    /// Whether the integrator sees media.
    sees_media: bool,
    /// Objects that stand in place of a reference already.
    in_place: HashSet<usize>,
    /// How many more nodes references may write out again.
    left: usize,
    /// What a person should know, and of which place.
    notes: Vec<(Place, String)>,
}

impl<'a> Import<'a> {
    fn new(document: &'a Document) -> Import<'a> {
        let with_ids = document.objects.iter().filter(|object| object.id.is_some());
        let mut taken: HashSet<String> = with_ids.filter_map(|object| named(document, object)).collect();
        taken.extend(document.settings.iter().filter_map(Setting::entry).map(str::to_owned));
        Import {
            document,
            textures: Vec::new(),
            materials: Vec::new(),
            volumes: Vec::new(),
            media: Vec::new(),
            groups: Vec::new(),
            shapes: Vec::new(),
            lights: Vec::new(),
            names: HashMap::new(),
            for_numbers: HashMap::new(),
            empty: HashSet::new(),
            shining: HashSet::new(),
            taken,
            has_media: integrators::has_media(document),
            sees_media: true,
            in_place: HashSet::new(),
            left: MAX_NODES,
            notes: Vec::new(),
        }
    }

    fn bag(&self, index: usize) -> Bag<'a> {
        Bag::new(self.document, index)
    }

    fn scene(mut self) -> std::result::Result<(Node, Vec<(Place, String)>), Fault> {
        let root = self.bag(0);
        let place = root.object.place;
        let integrator = match root.only(Family::Integrator)? {
            Some(index) => Some(self.integrator(index)?),
            None => None,
        };
        let mut camera = None;
        for sensor in root.objects(Family::Sensor) {
            // The first one takes the picture; the others have to hold all the same.
            let parts = self.sensor(sensor)?;
            camera.get_or_insert(parts);
        }
        let camera = camera.ok_or_else(|| root.fault("expected a <sensor>, found none"))?;
        for texture in root.objects(Family::Texture) {
            self.texture_or_spectrum(texture)?;
        }
        for bsdf in root.objects(Family::Bsdf) {
            self.material(bsdf)?;
        }
        for volume in root.objects(Family::Volume) {
            self.declare_volume(volume)?;
        }
        for medium in root.objects(Family::Medium) {
            self.medium(medium)?;
        }
        for shape in root.objects(Family::Shape) {
            self.shape(shape)?;
        }
        let emitters = root.objects(Family::Emitter);
        let around = |index: &&usize| emitters::AROUND.contains(&self.bag(**index).object.plugin.as_str());
        if let Some(second) = emitters.iter().filter(around).nth(1) {
            return Err(self.bag(*second).fault("expected one environment, found another"));
        }
        for emitter in emitters {
            self.emitter(emitter)?;
        }
        // Parts of others that stand here for a <ref>: they have to hold, used or not.
        for film in root.objects(Family::Film) {
            self.film(Some(film), place)?;
        }
        for filter in root.objects(Family::ReconstructionFilter) {
            self.filter(filter)?;
        }
        for sampler in root.objects(Family::Sampler) {
            self.sampler(Some(sampler), place)?;
        }
        for phase in root.objects(Family::Phase) {
            self.phase(phase)?;
        }
        // How what rays meet is looked for.
        for name in SEARCH {
            root.value(name);
        }
        root.finish()?;

        let mut fields = Fields::new(place);
        fields.extend(camera);
        if let Some(integrator) = integrator {
            fields.extend(integrator);
        }
        fields.add("textures", Node::new(place, Value::Map(self.textures)));
        fields.add("materials", Node::new(place, Value::Map(self.materials)));
        fields.add("volumes", Node::new(place, Value::Map(self.volumes)));
        fields.add("media", Node::new(place, Value::Map(self.media)));
        fields.add("groups", Node::new(place, Value::Map(self.groups)));
        fields.add("shapes", Node::new(place, Value::List(self.shapes)));
        fields.add("lights", Node::new(place, Value::List(self.lights)));
        let mut root = fields.map();
        for setting in &self.document.settings {
            setting.apply(&mut root)?;
        }
        Ok((root, self.notes))
    }

    /// Counts `node`, as which an object stands in place of a reference, from the second time on. References that each
    /// name another one twice double at every step.
    fn again(&mut self, index: usize, node: &Node) -> std::result::Result<(), Fault> {
        if self.in_place.insert(index) {
            return Ok(());
        }
        let message = || format!("expected at most {MAX_NODES} values that references write out again, found more");
        let left = self.left.checked_sub(weight(node));
        self.left = left.ok_or_else(|| Fault::at_place(self.document.objects[index].place, message()))?;
        Ok(())
    }

    /// A name for an object in one of the maps: its id, or one made from its place.
    fn name_for(&mut self, index: usize) -> String {
        let object = &self.document.objects[index];
        let name = match named(self.document, object) {
            // Words of the grammar, where the name of a medium is wanted.
            Some(name) if object.family == Family::Medium && [VACUUM, UNCHANGED].contains(&name.as_str()) => {
                self.made(format!("{name} (medium)"))
            }
            Some(name) => name,
            None => self.made(format!("{} {index}", object.plugin)),
        };
        self.names.insert(index, name.clone());
        name
    }

    /// `wanted`, or where something has this name, one like it that nothing has.
    fn made(&mut self, wanted: String) -> String {
        let mut name = wanted.clone();
        let mut count = 1;
        while !self.taken.insert(name.clone()) {
            count += 1;
            name = format!("{wanted} ({count})");
        }
        name
    }

    fn entry(&self, index: usize, key: &str, node: Node) -> Entry {
        Entry { key: key.to_owned(), key_place: self.document.objects[index].place, node }
    }
}

/// The name that an object has by its id. There is one list of ids, but a list of names for each kind, so the exporter
/// ends an id in its kind where another kind has the name: see [`export`].
fn named(document: &Document, object: &Object) -> Option<String> {
    let id = object.id.as_ref()?;
    let name = id.strip_suffix(&format!(" ({})", object.family.tag()));
    Some(name.filter(|name| !document.has(object.family, name)).unwrap_or(id).to_owned())
}

#[cfg(test)]
mod tests;
