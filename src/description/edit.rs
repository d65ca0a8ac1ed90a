//! Trees made of several texts: files, includes, batch layers, `set`.

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::decode::decode;
use super::fault::Fault;
use super::keyed;
use super::node::{Entry, Node, Place, Sources, Value, did_you_mean, quote};
use super::path::{self, At, Segment};
use super::spectrum::FilePath;
use super::yaml::{self, MAX_BYTES, MAX_DEPTH};
use crate::error::{Error, Result};
use crate::input;

/// The maps that an included file may hold.
pub(super) const SHARED: [&str; 4] = ["materials", "textures", "volumes", "media"];
pub(super) const INCLUDE: &str = "include";

/// Reads a file to a tree.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, [`Error::Config`] if it is not YAML.
pub(crate) fn read_file(path: &Path, sources: &mut Sources) -> Result<Node> {
    let bytes = read_bytes(path).map_err(|error| Error::input(path, format!("cannot be read: {error}")))?;
    read_bytes_as(&bytes, path, sources)
}

/// The bytes of a file that the command line names, at most one more than may be read. It may be what another process writes:
/// `/dev/stdin`, or the `/dev/fd/63` of a shell's `<(…)`.
pub(crate) fn named_bytes(path: &Path) -> std::io::Result<Vec<u8>> {
    if is_of_the_system(path) { File::open(path).and_then(read_most) } else { read_bytes(path) }
}

/// Whether what stands at `path` may be no file that can be read again.
pub(crate) fn is_of_the_system(path: &Path) -> bool {
    ["/dev", "/proc"].iter().any(|system| path.starts_with(system))
}

/// Reads the bytes of a file to a tree.
///
/// # Errors
/// [`Error::Config`] if they are not YAML.
pub(crate) fn read_bytes_as(bytes: &[u8], path: &Path, sources: &mut Sources) -> Result<Node> {
    let source = sources.add_file(path);
    yaml::read(bytes, source).map_err(|fault| fault.into_error(sources))
}

/// The bytes of a regular file, at most one more than may be read.
pub(crate) fn read_bytes(path: &Path) -> std::io::Result<Vec<u8>> {
    read_most(input::open(path)?)
}

fn read_most(file: File) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(input::end_without_memory)?;
    Ok(bytes)
}

/// Adds to `root`, read from `path`, the maps of all files that it includes, and that these
/// include. Each file is read once, so a circle of includes ends.
///
/// # Errors
/// [`Error::Input`] if a file cannot be read; [`Error::Config`] if one is not YAML, holds other
/// fields, or defines a name that is defined already.
pub(crate) fn include(root: &mut Node, path: &Path, sources: &mut Sources) -> Result<()> {
    let canonical = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let mut seen = BTreeSet::from([canonical(path)]);
    let mut waiting: VecDeque<(PathBuf, Place)> = included_by(root, sources)?.into();
    if waiting.is_empty() {
        return Ok(());
    }
    let mut names = Names::of(root);
    while let Some((path, place)) = waiting.pop_front() {
        if !seen.insert(canonical(&path)) {
            continue;
        }
        let bytes = read_bytes(&path).map_err(|error| {
            Error::input(&path, format!("cannot be read: {error}; it is included at {}", sources.describe(place)))
        })?;
        let tree = read_bytes_as(&bytes, &path, sources)?;
        waiting.extend(included_by(&tree, sources)?);
        graft(root, tree, &mut names, sources).map_err(|fault| fault.into_error(sources))?;
    }
    Ok(())
}

/// The files that a tree includes, and where it says so.
fn included_by(tree: &Node, sources: &Sources) -> Result<Vec<(PathBuf, Place)>> {
    let Some(list) = tree.get(INCLUDE) else { return Ok(Vec::new()) };
    let files: Option<Vec<FilePath>> =
        decode(list, sources).map_err(|fault| fault.under(Segment::Key(INCLUDE.to_owned())).into_error(sources))?;
    let places = match &list.value {
        Value::List(items) => items.iter().map(|item| item.place).collect(),
        _ => Vec::new(),
    };
    Ok(files.unwrap_or_default().into_iter().map(|file| file.0).zip(places).collect())
}

/// Where each name of the shared maps is defined.
struct Names(HashMap<(&'static str, String), Place>);

impl Names {
    fn of(root: &Node) -> Names {
        let mut names = HashMap::new();
        for kind in SHARED {
            if let Some(Value::Map(entries)) = root.get(kind).map(|node| &node.value) {
                names.extend(entries.iter().map(|entry| ((kind, entry.key.clone()), entry.key_place)));
            }
        }
        Names(names)
    }
}

fn graft(root: &mut Node, tree: Node, names: &mut Names, sources: &Sources) -> std::result::Result<(), Fault> {
    let maps = match tree.value {
        Value::Map(maps) => maps,
        Value::Null => return Ok(()),
        _ => {
            return Err(Fault::expected(&tree, "a map with fields among include, materials, textures, volumes, media"));
        }
    };
    for Entry { key, key_place, node } in maps {
        if key == INCLUDE || matches!(node.value, Value::Null) && SHARED.contains(&key.as_str()) {
            continue;
        }
        let Some(kind) = SHARED.into_iter().find(|kind| *kind == key) else {
            let fault = Fault::unknown(key_place, &key, [INCLUDE].into_iter().chain(SHARED));
            return Err(fault.under(Segment::Key(key)));
        };
        let Value::Map(entries) = node.value else {
            return Err(Fault::expected(&node, "a map of names").under(Segment::Key(key)));
        };
        for entry in &entries {
            if let Some(first) = names.0.insert((kind, entry.key.clone()), entry.key_place) {
                let first = sources.describe(first);
                let found = quote(&entry.key);
                let message = format!("expected each name once, found {found} again; it is first at {first}");
                let path = [Segment::Key(key), Segment::Key(entry.key.clone())];
                return Err(Fault::at_place(entry.key_place, message).under_path(&path));
            }
        }
        let into = child(root, kind, node.place).map_err(|message| Fault::at_place(key_place, message))?;
        if matches!(into.value, Value::Null) {
            into.value = Value::Map(Vec::new());
        }
        match &mut into.value {
            Value::Map(present) => present.extend(entries),
            _ => return Err(Fault::expected(into, "a map of names").under(Segment::Key(key))),
        }
    }
    Ok(())
}

/// Lays `over` on `base`: maps field by field, all else as a whole; null changes nothing.
pub(crate) fn overlay(base: &mut Node, over: &Node) {
    overlay_at(base, over, At::ROOT);
}

fn overlay_at(base: &mut Node, over: &Node, at: At<'_>) {
    // What changes over frames is one value.
    let whole = keyed::is_keyed_at(base, at) || keyed::is_keyed_at(over, at);
    match (&mut base.value, &over.value) {
        (_, Value::Null) => {}
        (Value::Map(_), Value::Map(entries)) if !whole => {
            for entry in entries {
                if let Ok(into) = child(base, &entry.key, entry.key_place) {
                    overlay_at(into, &entry.node, at.key(&entry.key));
                }
            }
        }
        _ => *base = over.clone(),
    }
}

/// One `set`: a path, where it is written, and the new value.
#[derive(Clone, Debug)]
pub(crate) struct Setting {
    path: Vec<Segment>,
    place: Place,
    value: Node,
}

impl Setting {
    /// # Errors
    /// If the path cannot be read or may not be set.
    pub(crate) fn new(key: &str, place: Place, value: Node) -> std::result::Result<Setting, Fault> {
        let path = path::parse(key).map_err(|message| Fault::at_place(place, message))?;
        if path.len() > MAX_DEPTH {
            return Err(Fault::at_place(
                place,
                format!("expected a path of at most {MAX_DEPTH} steps, found {}", path.len()),
            ));
        }
        if path.first() == Some(&Segment::Key(INCLUDE.to_owned())) {
            let message = "expected a field of the scene, found include, which is read before anything is set";
            return Err(Fault::at_place(place, message).under_path(&path));
        }
        Ok(Setting { path, place, value })
    }

    /// The field that it names.
    pub(crate) fn field(&self) -> String {
        path::display(&self.path)
    }

    /// What it names within a field of the scene.
    pub(crate) fn entry(&self) -> Option<&str> {
        match self.path.get(1) {
            Some(Segment::Key(key)) => Some(key),
            _ => None,
        }
    }

    /// Whether the path leads to an entry of a map of names, which no field of the grammar stands for.
    fn is_a_name(&self) -> bool {
        match &self.path[..] {
            [Segment::Key(map), Segment::Key(_)] => {
                SHARED.contains(&map.as_str()) || ["groups", "light_groups", "assets"].contains(&map.as_str())
            }
            [Segment::Key(output), Segment::Key(exr), Segment::Key(attributes), Segment::Key(_)] => {
                [output, exr, attributes] == ["output", "exr", "attributes"]
            }
            _ => false,
        }
    }

    /// Takes the entry away that the path leads to.
    fn take_away(&self, root: &mut Node) -> std::result::Result<(), Fault> {
        let Some((Segment::Key(name), maps)) = self.path.split_last() else { return Ok(()) };
        let map = maps.iter().try_fold(root, |node, segment| match (&mut node.value, segment) {
            (Value::Map(entries), Segment::Key(key)) => {
                entries.iter_mut().find(|entry| entry.key == *key).map(|entry| &mut entry.node)
            }
            _ => None,
        });
        let mut none = Vec::new();
        let entries = match map.map(|map| &mut map.value) {
            Some(Value::Map(entries)) => entries,
            _ => &mut none,
        };
        match entries.iter().position(|entry| entry.key == *name) {
            Some(at) => drop(entries.remove(at)),
            None => {
                let hint = did_you_mean(name, entries.iter().map(|entry| entry.key.as_str()));
                let message = format!("expected a name that is there, found {}{hint}", quote(name));
                return Err(Fault::at_place(self.place, message).under_path(&self.path));
            }
        }
        Ok(())
    }

    /// A setting of the command line, `KEY=VALUE`. In a file a field without value is one that is not written; here it is
    /// more likely that a shell's variable is empty.
    ///
    /// # Errors
    /// If key or value cannot be read.
    pub(crate) fn of_argument(key: &str, value: &str, sources: &mut Sources) -> std::result::Result<Setting, Fault> {
        let source = sources.add_argument(format!("--set {key}={value}"));
        let place = Place { source, line: 0, column: 0 };
        if value.trim().is_empty() {
            let message = "expected a value, or null to take the field away, found nothing";
            return Err(Fault::at_place(place, message).under_path(&path::parse(key).unwrap_or_default()));
        }
        let mut node = yaml::read(value.as_bytes(), source).map_err(|mut fault| {
            // Lines and columns within an argument help nobody.
            fault.place = Some(place);
            fault
        })?;
        node.move_to(place);
        Setting::new(key, place, node)
    }

    /// Changes the tree.
    ///
    /// # Errors
    /// If the path leads through something that cannot hold it.
    pub(crate) fn apply(&self, root: &mut Node) -> std::result::Result<(), Fault> {
        if matches!(self.value.value, Value::Null) && self.is_a_name() {
            return self.take_away(root);
        }
        let mut node = root;
        // Where a name leads to no list, that beside it which may have been meant.
        let mut hint = String::new();
        for (depth, segment) in self.path.iter().enumerate() {
            let inner = match segment {
                Segment::Key(key) => {
                    hint = match &node.value {
                        Value::Map(entries) if node.get(key).is_none() => {
                            did_you_mean(key, entries.iter().map(|entry| entry.key.as_str()))
                        }
                        _ => String::new(),
                    };
                    child(node, key, self.place)
                }
                Segment::Index(index) => item(node, *index).map_err(|message| message + &std::mem::take(&mut hint)),
            };
            node = inner.map_err(|message| Fault::at_place(self.place, message).under_path(&self.path[..depth]))?;
        }
        *node = self.value.clone();
        Ok(())
    }
}

/// The value under `key`, made if it is not there.
fn child<'a>(node: &'a mut Node, key: &str, place: Place) -> std::result::Result<&'a mut Node, String> {
    let found = node.found();
    match &node.value {
        Value::Map(_) => {}
        Value::Null => node.value = Value::Map(Vec::new()),
        // A kind that stands alone: `integrator: path` is `integrator: {path: {}}`.
        Value::Text(text) if text == key => {
            let inner = Entry { key: key.to_owned(), key_place: node.place, node: Node::new(node.place, Value::Null) };
            node.value = Value::Map(vec![inner]);
        }
        _ => return Err(format!("expected a map that may hold {}, found {found}", quote(key))),
    }
    let Value::Map(entries) = &mut node.value else { return Err(String::new()) };
    let index = entries.iter().position(|entry| entry.key == key).unwrap_or_else(|| {
        let node = Node::new(place, Value::Null);
        entries.push(Entry { key: key.to_owned(), key_place: place, node });
        entries.len() - 1
    });
    Ok(&mut entries[index].node)
}

/// An item of a list, which must be there.
fn item(node: &mut Node, index: usize) -> std::result::Result<&mut Node, String> {
    let found = node.found();
    match &mut node.value {
        Value::List(items) => {
            let length = items.len();
            items.get_mut(index).ok_or_else(|| match length {
                0 => format!("expected no index, for the list is empty, found {index}"),
                length => format!("expected an index from 0 to {}, found {index}", length - 1),
            })
        }
        _ => Err(format!("expected a list, found {found}")),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::testing::CAMERA;
    use super::super::{Material, SceneDescription, load};
    use super::*;

    /// Writes files, loads `scene.yaml` with settings, and names the directory `DIR` in a fault.
    fn with_settings(
        files: &[(&str, &str)],
        settings: &[(&str, &str)],
    ) -> std::result::Result<SceneDescription, String> {
        let directory = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = directory.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let settings: Vec<(String, String)> =
            settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        load(&directory.path().join("scene.yaml"))
            .and_then(|document| document.entries()[0].scene(&settings))
            .map_err(|error| error.to_string().replace(directory.path().to_str().unwrap(), "DIR"))
    }

    fn including(scene: &str, files: &[(&str, &str)]) -> std::result::Result<SceneDescription, String> {
        let scene = format!("{CAMERA}{scene}");
        let mut all = vec![("scene.yaml", scene.as_str())];
        all.extend(files);
        with_settings(&all, &[])
    }

    #[test]
    fn names_of_attributes_may_be_numbers() {
        let tree = |text: &str| yaml::read(text.as_bytes(), 0).unwrap();
        let mut base = tree("output: {exr: {attributes: {owner: us, shot: a}}}\nx: {0: 1, 2: 3}\n");
        overlay(&mut base, &tree("output: {exr: {attributes: {2: x, keys: y}}}\nx: {4: 5}\n"));
        let found = |node: Option<&Node>| node.unwrap().found();
        let attributes = base.get("output").and_then(|output| output.get("exr")).and_then(|exr| exr.get("attributes"));
        assert_eq!(found(attributes), "a map with owner, shot, 2, keys");
        assert_eq!(found(base.get("x")), "a map with 4");
    }

    #[test]
    fn included_names_are_part_of_the_scene() {
        let scene = including(
            "include: [presets/a.yaml]\nmaterials: {own: {mirror: {}}}\n",
            &[
                (
                    "presets/a.yaml",
                    "include: [b.yaml]\nmaterials: {far: {mirror: {}}}\ntextures: {t: {image: {file: t.png}}}\n",
                ),
                // A circle ends.
                ("presets/b.yaml", "include: [a.yaml, ../scene.yaml]\nmedia: {smoke: {homogeneous: {}}}\nmaterials:\n"),
            ],
        )
        .unwrap();
        assert_eq!(scene.materials.keys().collect::<Vec<_>>(), ["far", "own"]);
        assert!(scene.media.contains_key("smoke"));
        // A path starts from the file in which it stands.
        let super::super::Texture::Image(image) = &scene.textures["t"] else { panic!("an image") };
        assert!(image.file.ends_with("presets/t.png"), "{:?}", image.file);
    }

    #[test]
    fn a_name_that_is_defined_twice_is_refused_with_both_places() {
        assert_eq!(
            including(
                "include: [a.yaml]\nmaterials:\n  red: {mirror: {}}\n",
                &[("a.yaml", "materials:\n  blue: {mirror: {}}\n  red: {mirror: {}}\n")]
            )
            .unwrap_err(),
            "DIR/a.yaml:3:3: materials.red: expected each name once, found \"red\" again; \
             it is first at DIR/scene.yaml:4:3"
        );
        assert_eq!(
            including(
                "include: [a.yaml, b.yaml]\n",
                &[("a.yaml", "media: {m: {homogeneous: {}}}"), ("b.yaml", "media: {m: {homogeneous: {}}}")]
            )
            .unwrap_err(),
            "DIR/b.yaml:1:9: media.m: expected each name once, found \"m\" again; it is first at DIR/a.yaml:1:9"
        );
    }

    #[test]
    fn an_included_file_holds_only_names() {
        assert_eq!(
            including("include: [a.yaml]", &[("a.yaml", "materials: {}\nshaps: []\n")]).unwrap_err(),
            "DIR/a.yaml:2:1: shaps: expected one of include, materials, textures, volumes, media, found \"shaps\""
        );
        assert_eq!(
            including("include: [a.yaml]", &[("a.yaml", "material: {}\n")]).unwrap_err(),
            "DIR/a.yaml:1:1: material: expected one of include, materials, textures, volumes, media, found \"material\"; \
             did you mean \"materials\"?"
        );
        assert_eq!(
            including("include: [a.yaml]", &[("a.yaml", "[1]")]).unwrap_err(),
            "DIR/a.yaml:1:1: expected a map with fields among include, materials, textures, volumes, media, found a list of 1"
        );
        assert_eq!(
            including("include: [a.yaml]\nmaterials: 3", &[("a.yaml", "materials: {a: {mirror: {}}}")]).unwrap_err(),
            "DIR/scene.yaml:3:12: materials: expected a map of names, found 3"
        );
        assert_eq!(
            including("include: a.yaml", &[]).unwrap_err(),
            "DIR/scene.yaml:2:10: include: expected a list, found the text \"a.yaml\""
        );
    }

    #[test]
    fn a_fault_in_an_included_file_is_at_its_own_line() {
        assert_eq!(
            including("include: [a.yaml]", &[("a.yaml", "materials:\n  a: {mirror: {reflectance: 2}}\n")]).unwrap_err(),
            "DIR/a.yaml:2:29: materials.a.mirror.reflectance: expected a number from 0 to 1, found 2"
        );
    }

    #[test]
    fn a_missing_file_is_an_input_error_that_says_who_asked() {
        assert_eq!(
            including("include: [no.yaml]", &[]).unwrap_err(),
            "DIR/no.yaml: cannot be read: No such file or directory (os error 2); it is included at DIR/scene.yaml:2:11"
        );
        let error = load(Path::new("no/such.yaml")).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert_eq!(error.to_string(), "no/such.yaml: cannot be read: No such file or directory (os error 2)");
    }

    /// Settings on a scene with two shapes.
    fn set(settings: &[(&str, &str)]) -> std::result::Result<SceneDescription, String> {
        let scene = format!(
            "{CAMERA}shapes:\n- sphere: {{radius: 1}}\n- cube: {{size: 1, material: clay}}\n\
             materials: {{clay: {{diffuse: {{}}}}}}\nfog: {{colour: 1, density: 1}}\nintegrator: path\n"
        );
        with_settings(&[("scene.yaml", &scene)], settings)
    }

    #[test]
    fn a_setting_replaces_adds_and_takes_away() {
        let scene = set(&[
            ("fog", "null"),
            ("render.samples", "16"),
            ("shapes[0].sphere.radius", "2"),
            ("shapes[0].sphere.material.mirror", "{}"),
            ("integrator.path.max_depth", "3"),
            ("materials.clay.diffuse.reflectance", "{rgb: [1, 0, 0]}"),
            ("image", "{width: 10, height: 10}"),
            // The last one wins.
            ("image.width", "11"),
            ("image.width", "12"),
        ])
        .unwrap();
        assert_eq!(scene.fog, None);
        assert_eq!(scene.render.samples, 16);
        let super::super::Geometry::Sphere(sphere) = &scene.shapes[0].geometry else { panic!("a sphere") };
        assert_eq!(sphere.radius, 2.0);
        let super::super::MaterialRef::Inline(Material::Mirror(_)) = &scene.shapes[0].material else {
            panic!("a mirror")
        };
        let super::super::Integrator::Path(path) = scene.integrator else { panic!("path") };
        assert_eq!(path.max_depth, Some(3));
        assert_eq!((scene.image.width, scene.image.height), (12, 10));
        assert_eq!(scene.fault("render.samples", "odd"), "--set render.samples=16: render.samples: odd");
    }

    #[test]
    fn null_takes_a_name_away() {
        let named = "materials: {a: {mirror: {}}, b: {diffuse: {}}}\nlight_groups: {key: [p]}\n\
             output: {exr: {attributes: {owner: us, shot: 7}}}\nlights: [point: {name: p, position: [0, 3, 0], intensity: 1}]\n";
        let scene = |keys: &[&str]| {
            let settings: Vec<(&str, &str)> = keys.iter().map(|key| (*key, "null")).collect();
            with_settings(&[("scene.yaml", &format!("{CAMERA}{named}"))], &settings)
        };
        let found = scene(&["materials.a", "light_groups.key", "output.exr.attributes.shot"]).unwrap();
        assert_eq!(found.materials.keys().collect::<Vec<_>>(), ["b"]);
        assert!(found.light_groups.is_empty());
        assert!(scene(&["output.exr.attributes"]).is_ok());
        for (key, message) in [
            ("materials.floor", "materials.floor: expected a name that is there, found \"floor\""),
            ("media.smoke", "media.smoke: expected a name that is there, found \"smoke\""),
            (
                "light_groups.kez",
                "light_groups.kez: expected a name that is there, found \"kez\"; did you mean \"key\"?",
            ),
        ] {
            assert_eq!(scene(&[key]).unwrap_err(), format!("--set {key}=null: {message}"));
        }
    }

    #[test]
    fn a_setting_of_a_field_that_the_grammar_lacks_is_refused() {
        let says = |key: &str, value: &str| set(&[(key, value)]).unwrap_err();
        assert_eq!(
            says("render.smaples", "3"),
            "--set render.smaples=3: render.smaples: expected one of samples, stop, seed, effects, tile, wavelengths, techniques, \
                frames, seed_per_frame, frames_per_second, \
             found \"smaples\"; did you mean \"samples\"?"
        );
        assert_eq!(
            says("shapes[0].sphere.radus", "3"),
            "--set shapes[0].sphere.radus=3: shapes[0].sphere.radus: expected one of center, radius, layout, name, material, \
             emission, emission_direction, sampling_weight, inside, outside, transform, flip_normals, found \"radus\"; did you mean \"radius\"?"
        );
        assert_eq!(
            says("shapes[2].sphere.radius", "3"),
            "--set shapes[2].sphere.radius=3: shapes: expected an index from 0 to 1, found 2"
        );
        assert_eq!(says("lights[0].point", "3"), "--set lights[0].point=3: lights: expected a list, found nothing");
        assert_eq!(
            says("shape[0].sphere.radius", "3"),
            "--set shape[0].sphere.radius=3: shape: expected a list, found nothing; did you mean \"shapes\"?"
        );
        assert_eq!(
            says("shapes.sphere", "3"),
            "--set shapes.sphere=3: shapes: expected a map that may hold \"sphere\", found a list of 2"
        );
        assert_eq!(
            says("shapes[1].cube.material.mirror", "{}"),
            "--set shapes[1].cube.material.mirror={}: shapes[1].cube.material: \
             expected a map that may hold \"mirror\", found the text \"clay\""
        );
        assert_eq!(
            says("include", "[a.yaml]"),
            "--set include=[a.yaml]: include: expected a field of the scene, found include, \
             which is read before anything is set"
        );
        assert_eq!(
            says(&vec!["a"; 65].join("."), "1"),
            format!("--set {0}=1: expected a path of at most 64 steps, found 65", vec!["a"; 65].join("."))
        );
    }

    #[test]
    fn a_bad_value_of_a_setting_is_refused_by_field() {
        let says = |key: &str, value: &str| set(&[(key, value)]).unwrap_err();
        assert_eq!(
            says("render.samples", "-3"),
            "--set render.samples=-3: render.samples: expected a whole number from 1 to 134217728, found -3"
        );
        assert_eq!(
            says("render.samples", "0"),
            "--set render.samples=0: render.samples: expected a whole number from 1 to 134217728, found 0"
        );
        assert_eq!(
            says("render", "[1"),
            "--set render=[1: expected YAML, found a fault of syntax: unclosed bracket '['"
        );
        assert_eq!(
            says("image.width", ""),
            "--set image.width=: image.width: expected a value, or null to take the field away, found nothing"
        );
        assert_eq!(says("camera", "null"), "--set camera=null: expected the field \"camera\", found none");
        assert_eq!(
            says("camera.shutter", "abc"),
            "--set camera.shutter=abc: camera.shutter: expected one of a number, a map with fields among open, close, moments, \
             found the text \"abc\""
        );
        assert_eq!(
            says("render..x", "1"),
            "--set render..x=1: expected a path such as render.samples, found \"render..x\" with an empty part"
        );
    }

    #[test]
    fn a_path_of_the_command_line_starts_from_the_working_directory() {
        let scene = set(&[("shapes[0]", "{mesh: {file: a.ply}}")]).unwrap();
        let super::super::Geometry::Mesh(mesh) = &scene.shapes[0].geometry else { panic!("a mesh") };
        assert_eq!(mesh.file.0, PathBuf::from("a.ply"));
    }
}
