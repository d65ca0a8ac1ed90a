//! Batches: many scenes, one after the other, with what differs between them.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::de::{IgnoredAny, Visitor};
use serde::{Deserialize, Deserializer};

use super::animation::Animation;
use super::decode::decode;
use super::edit::{self, Setting};
use super::fault::{Checker, Fault};
use super::mitsuba::{self, Define};
use super::node::{Entry, Node, Place, Sources, Value, not_finite, quote};
use super::output::Output;
use super::path::{At, Segment};
use super::path_map::PathMap;
use super::scene::SceneDescription;
use super::settings::{Render, SAMPLES_LIMIT};
use super::spectrum::FilePath;
use crate::error::{Error, Result};

/// A file that was named on the command line.
#[derive(Clone, Debug)]
pub enum Document {
    /// One scene.
    Scene(BatchEntry),
    /// A list of scenes.
    Batch(Batch),
}

impl Document {
    /// The scenes to render, in order.
    #[must_use]
    pub fn entries(&self) -> &[BatchEntry] {
        match self {
            Document::Scene(entry) => std::slice::from_ref(entry),
            Document::Batch(batch) => &batch.entries,
        }
    }

    /// [`Document::entries`], to keep.
    #[must_use]
    pub fn into_entries(self) -> Vec<BatchEntry> {
        match self {
            Document::Scene(entry) => vec![entry],
            Document::Batch(batch) => batch.entries,
        }
    }

    /// Loads every scene, and forgets them: do all descriptions hold?
    ///
    /// # Errors
    /// The faults of all scenes, each once. [`Error::Config`] if any scene has one; otherwise
    /// [`Error::Input`] for the first file that cannot be read.
    pub fn check(&self, overrides: &[(String, String)]) -> Result<()> {
        let mut lines: Vec<String> = Vec::new();
        let mut unreadable = None;
        let mut faulty = false;
        for entry in self.entries() {
            let Err(error) = entry.scene(overrides) else { continue };
            // Entries that share a scene share its faults.
            for line in error.to_string().lines() {
                if !lines.iter().any(|told| told == line) {
                    lines.push(line.to_owned());
                }
            }
            match error {
                Error::Input { .. } => unreadable = unreadable.or(Some(error)),
                _ => faulty = true,
            }
        }
        match unreadable {
            _ if faulty => Err(Error::Config(lines.join("\n"))),
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}

/// Scenes to render one after the other.
#[derive(Clone, Debug)]
pub struct Batch {
    /// In the order of the text; names are distinct.
    pub entries: Vec<BatchEntry>,
}

/// One picture to make: a scene's file and what is changed in it.
#[derive(Clone, Debug)]
pub struct BatchEntry {
    /// Name of the output, without extension.
    pub name: String,
    /// The scene's file, relative to the working directory.
    pub path: PathBuf,
    /// What stands in it, where it cannot be read again.
    bytes: Option<Arc<[u8]>>,
    /// Where the batch names the file; `None` for a scene on its own.
    place: Option<Place>,
    /// The batch's `output` and `render`, laid over the scene's.
    layers: Arc<[(&'static str, Node)]>,
    settings: Vec<Setting>,
    /// Parameters of a Mitsuba scene.
    defines: Vec<Define>,
    /// What the places of the above refer to.
    sources: Arc<Sources>,
}

/// Reads a batch, or a scene, which is a batch of one.
///
/// The scenes of a batch are not read yet: [`BatchEntry::scene`] does.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, [`Error::Config`] if it is not YAML or not a batch.
pub fn load(path: &Path) -> Result<Document> {
    load_mapped(path, PathMap::default())
}

/// [`load`] where files lie elsewhere than they are written.
///
/// # Errors
/// As there.
pub fn load_mapped(path: &Path, map: PathMap) -> Result<Document> {
    let mut sources = Sources::mapped(map);
    if mitsuba::is_xml(path) {
        return Ok(Document::Scene(BatchEntry::alone(path, sources)?));
    }
    let nothing_read = sources.clone();
    let bytes = edit::named_bytes(path).map_err(|error| Error::input(path, format!("cannot be read: {error}")))?;
    let root = edit::read_bytes_as(&bytes, path, &mut sources)?;
    if root.get("scenes").is_some() {
        return Ok(Document::Batch(Batch::of_tree(&root, &sources)?));
    }
    let mut entry = BatchEntry::alone(path, nothing_read)?;
    // What another process writes can be read once.
    entry.bytes = edit::is_of_the_system(path).then(|| bytes.into());
    Ok(Document::Scene(entry))
}

fn stem(path: &Path) -> Option<String> {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenBatch {
    #[serde(default)]
    output: Output,
    #[serde(default)]
    render: Render,
    scenes: Vec<WrittenEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenEntry {
    file: FilePath,
    name: Option<String>,
    /// Only that it is a map: the values are taken from the tree.
    #[serde(rename = "set")]
    _set: Option<BTreeMap<String, IgnoredAny>>,
    #[serde(default)]
    define: BTreeMap<String, Parameter>,
}

/// The value of a parameter, as it would stand in XML.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Parameter {
    Number(Digits),
    Boolean(bool),
    Text(String),
}

/// A number in words; a whole one with all of its digits.
struct Digits(String);

impl<'de> Deserialize<'de> for Digits {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Digits, D::Error> {
        struct Written;
        impl Visitor<'_> for Written {
            type Value = Digits;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number")
            }
            fn visit_u64<E: serde::de::Error>(self, value: u64) -> std::result::Result<Digits, E> {
                Ok(Digits(value.to_string()))
            }
            fn visit_i64<E: serde::de::Error>(self, value: i64) -> std::result::Result<Digits, E> {
                Ok(Digits(value.to_string()))
            }
            fn visit_f64<E: serde::de::Error>(self, value: f64) -> std::result::Result<Digits, E> {
                Ok(Digits(value.to_string()))
            }
            // Of what is a number by its form, one beyond all floats.
            fn visit_str<E: serde::de::Error>(self, text: &str) -> std::result::Result<Digits, E> {
                Err(E::custom(not_finite(text)))
            }
        }
        deserializer.deserialize_any(Written)
    }
}

impl Parameter {
    fn text(self) -> String {
        match self {
            Parameter::Number(Digits(digits)) => digits,
            Parameter::Boolean(value) => value.to_string(),
            Parameter::Text(text) => text,
        }
    }
}

impl Batch {
    fn of_tree(root: &Node, sources: &Sources) -> Result<Batch> {
        let written: WrittenBatch = decode(root, sources).map_err(|fault| fault.into_error(sources))?;
        let mut checker = Checker::new(root);
        written.output.check(At::ROOT.key("output"), &mut checker);
        written.render.check(At::ROOT.key("render"), &mut checker);
        checker.require(!written.scenes.is_empty(), At::ROOT.key("scenes"), "at least one scene", "none");

        let nodes = match root.get("scenes").map(|node| &node.value) {
            Some(Value::List(nodes)) => nodes.as_slice(),
            _ => &[],
        };
        let layers: Arc<[(&'static str, Node)]> =
            ["output", "render"].into_iter().filter_map(|key| Some((key, root.get(key)?.clone()))).collect();
        let shared = Arc::new(sources.clone());
        let mut entries = Vec::with_capacity(nodes.len());
        let mut names: HashMap<String, Place> = HashMap::new();
        for (i, (entry, node)) in written.scenes.into_iter().zip(nodes).enumerate() {
            let list = At::ROOT.key("scenes");
            let at = list.index(i);
            // `name:` without a value is not written.
            let (name_at, expected) = match &entry.name {
                Some(_) => (at.key("name"), "a name that can be a file name"),
                None => (at.key("file"), "one file, no pattern, in whose name is none of / \\ : * ? \" < > |"),
            };
            let name = entry.name.or_else(|| stem(&entry.file)).unwrap_or_default();
            let name_node = node.get("name").or(node.get("file")).unwrap_or(node);
            checker.require(can_be_a_file_name(&name), name_at, expected, quote(&name));
            if let Some(first) = names.insert(name.clone(), name_node.place) {
                let (name, first) = (quote(&name), sources.describe(first));
                checker.fault(
                    name_at,
                    format!("expected each output name once, found {name} again; it is first at {first}"),
                );
            }
            let mut settings = Vec::new();
            if let Some(Value::Map(set)) = node.get("set").map(|set| &set.value) {
                for change in set {
                    match Setting::new(&change.key, change.key_place, change.node.clone()) {
                        Ok(setting) => settings.push(setting),
                        Err(fault) => checker.fault(at.key("set").key(&change.key), fault.to_string()),
                    }
                }
            }
            let xml = mitsuba::is_xml(&entry.file);
            let define = |(name, value): (String, Parameter)| {
                let place = node.get("define").and_then(|map| map.get(&name)).map(|value| value.place);
                Define { name, value: value.text(), place }
            };
            checker.require(
                xml || entry.define.is_empty(),
                at.key("define"),
                "parameters only where the file is a Mitsuba scene (.xml)",
                entry.file.display(),
            );
            entries.push(BatchEntry {
                name,
                defines: entry.define.into_iter().map(define).collect(),
                path: entry.file.0,
                bytes: None,
                place: node.get("file").map(|file| file.place),
                layers: Arc::clone(&layers),
                settings,
                sources: Arc::clone(&shared),
            });
        }
        checker.finish(sources)?;
        Ok(Batch { entries })
    }
}

/// A name becomes part of file names.
fn can_be_a_file_name(name: &str) -> bool {
    !name.is_empty()
        && name != "."
        && name != ".."
        && !name.contains(|c: char| c.is_control() || "/\\:*?\"<>|".contains(c))
}

impl BatchEntry {
    /// A scene that no batch names.
    fn alone(path: &Path, sources: Sources) -> Result<BatchEntry> {
        let name = stem(path).ok_or_else(|| Error::Config(format!("{}: expected a file name", path.display())))?;
        Ok(BatchEntry {
            name,
            path: path.to_path_buf(),
            bytes: None,
            place: None,
            layers: Arc::default(),
            settings: Vec::new(),
            defines: Vec::new(),
            sources: Arc::new(sources),
        })
    }

    /// Where the batch names the file; none of a scene on its own.
    #[must_use]
    pub fn place(&self) -> Option<String> {
        self.place.map(|place| self.sources.describe(place))
    }

    /// Whether the batch gives all of its scenes a `render.stop`.
    #[must_use]
    pub fn batch_has_stop(&self) -> bool {
        let is_written = |node: &Node| node.get("stop").is_some_and(|stop| !matches!(stop.value, Value::Null));
        self.layers.iter().any(|(key, node)| *key == "render" && is_written(node))
    }

    /// Gives values to parameters of the scene, the `-D NAME=VALUE` of the command line; they win over those of a
    /// batch.
    ///
    /// # Errors
    /// [`Error::Config`] where the scene is YAML, which has no parameters.
    pub fn define(&mut self, defines: &[(String, String)]) -> Result<()> {
        if let (Some((name, value)), false) = (defines.first(), mitsuba::is_xml(&self.path)) {
            let path = self.path.display();
            return Err(Error::Config(format!(
                "-D {name}={value}: expected a Mitsuba scene (.xml), found {path}; --set changes fields of YAML"
            )));
        }
        self.defines.retain(|define| !defines.iter().any(|(name, _)| *name == define.name));
        let given = |(name, value): &(String, String)| Define { name: name.clone(), value: value.clone(), place: None };
        self.defines.extend(defines.iter().map(given));
        Ok(())
    }

    /// Reads the scene, with what the batch and then the command line change in it; the first of its frames, where it
    /// has any.
    ///
    /// # Errors
    /// As [`BatchEntry::animation`] and [`Animation::scene`].
    pub fn scene(&self, overrides: &[(String, String)]) -> Result<SceneDescription> {
        self.animation(overrides)?.into_first()
    }

    /// Reads the scene, with what the batch and then the command line change in it, for all of its frames.
    ///
    /// `overrides` are the key and value of each `--set KEY=VALUE`; the value is YAML.
    ///
    /// # Errors
    /// [`Error::Input`] if the scene's file or one that it includes cannot be read;
    /// [`Error::Config`] if it is not YAML or cannot be changed so.
    pub fn animation(&self, overrides: &[(String, String)]) -> Result<Animation> {
        let mut sources = Sources::clone(&self.sources);
        let read = match &self.bytes {
            _ if mitsuba::is_xml(&self.path) => mitsuba::read(&self.path, &self.defines, &mut sources),
            Some(bytes) => edit::read_bytes_as(bytes, &self.path, &mut sources),
            None => edit::read_file(&self.path, &mut sources),
        };
        let mut root = read.map_err(|error| match (error, self.place) {
            (Error::Input { path, message }, Some(place)) => {
                Error::Input { path, message: format!("{message}; it is named at {}", sources.describe(place)) }
            }
            (error, _) => error,
        })?;
        if let (Some(place), Some(list)) = (self.place, root.entry("scenes")) {
            let message = format!("expected a scene, found a batch; it is named at {}", sources.describe(place));
            let fault = Fault::at_place(list.key_place, message).under(Segment::Key("scenes".into()));
            return Err(fault.into_error(&sources));
        }
        edit::include(&mut root, &self.path, &mut sources)?;

        // Over what is no map nothing can be laid; the decoder says so.
        if let Value::Map(_) = root.value {
            for (key, over) in self.layers.iter() {
                edit::overlay(&mut root, &wrap(key, over));
            }
            for setting in &self.settings {
                setting.apply(&mut root).map_err(|fault| fault.into_error(&sources))?;
            }
            let samples = ["render.samples", "render.stop", "render.stop.samples"].map(str::to_owned);
            let mut last = None;
            for (key, value) in overrides {
                let setting = Setting::of_argument(key, value, &mut sources);
                let set = setting.and_then(|setting| setting.apply(&mut root).map(|()| setting.field()));
                let field = set.map_err(|fault| fault.into_error(&sources))?;
                last = samples.iter().position(|name| *name == field).or(last);
            }
            // Samples that are said last bound other targets, too; what is no number of them is told once.
            let holds = |node: &&Node| decode(node, &sources).is_ok_and(|n: u32| (1..=SAMPLES_LIMIT).contains(&n));
            let said = root.get("render").and_then(|render| render.get("samples")).filter(holds);
            if let (Some(0), true, Some(said)) = (last, has_stop(&root), said.cloned()) {
                let setting = Setting::new(&samples[2], said.place, said);
                let set = setting.and_then(|setting| setting.apply(&mut root));
                set.map_err(|fault| fault.into_error(&sources))?;
            }
        }
        Animation::new(root, &self.path, sources)
    }
}

/// Whether a scene ends at other targets than its samples, or at samples that stand among them.
fn has_stop(root: &Node) -> bool {
    let stop = root.get("render").and_then(|render| render.get("stop"));
    stop.is_some_and(|stop| matches!(&stop.value, Value::Map(targets) if !targets.is_empty()))
}

/// `{key: node}`
fn wrap(key: &str, node: &Node) -> Node {
    let entry = Entry { key: key.to_owned(), key_place: node.place, node: node.clone() };
    Node::new(node.place, Value::Map(vec![entry]))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::testing::CAMERA;
    use super::*;

    /// Writes files and hands the directory to `test`.
    fn with<T>(files: &[(&str, &str)], test: impl FnOnce(&Path) -> T) -> T {
        let directory = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = directory.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        test(directory.path())
    }

    fn in_words(error: &Error, directory: &Path) -> String {
        error.to_string().replace(directory.to_str().unwrap(), "DIR")
    }

    /// The fault of loading a batch.
    fn refusal(batch: &str) -> String {
        with(&[("batch.yaml", batch)], |directory| {
            in_words(&load(&directory.join("batch.yaml")).unwrap_err(), directory)
        })
    }

    #[test]
    fn a_batch_lays_its_changes_over_its_scenes() {
        let scene = format!(
            "{CAMERA}render: {{samples: 1, seed: 7, tile: 8}}\nfog: {{colour: 1, density: 1}}\noutput: {{png: {{exposure: 1}}}}\n"
        );
        let batch = "output: {dir: pictures, png: {tonemap: agx}}\n\
                     render: {samples: 2, tile: 16, seed: null}\n\
                     scenes:\n\
                     - file: scenes/a.yaml\n\
                     - {file: scenes/a.yaml, name: a-nofog, set: {fog: null, render.samples: 3}}\n";
        with(&[("batch.yaml", batch), ("scenes/a.yaml", &scene)], |directory| {
            let Document::Batch(batch) = load(&directory.join("batch.yaml")).unwrap() else { panic!("a batch") };
            let names: Vec<&str> = batch.entries.iter().map(|entry| entry.name.as_str()).collect();
            assert_eq!(names, ["a", "a-nofog"]);
            assert_eq!(batch.entries[0].path, directory.join("scenes/a.yaml"));

            let first = batch.entries[0].scene(&[]).unwrap();
            // The batch over the scene over the default.
            assert_eq!((first.render.samples, first.render.tile, first.render.seed), (2, 16, 7));
            assert_eq!(first.output.dir, PathBuf::from("pictures"));
            assert_eq!(first.output.png.exposure, super::super::Exposure::Number(1.0));
            assert_eq!(first.output.png.tonemap, super::super::Tonemap::Agx);
            assert!(first.fog.is_some());

            // The entry over the batch; the command line over all.
            let second = batch.entries[1].scene(&[]).unwrap();
            assert_eq!((second.render.samples, second.fog), (3, None));
            let overrides = [("render.samples".to_owned(), "4".to_owned())];
            assert_eq!(batch.entries[1].scene(&overrides).unwrap().render.samples, 4);
        });
    }

    #[test]
    fn a_scene_is_a_batch_of_one() {
        with(&[("lone.yaml", CAMERA)], |directory| {
            let document = load(&directory.join("lone.yaml")).unwrap();
            assert!(matches!(document, Document::Scene(_)));
            assert_eq!(document.entries()[0].name, "lone");
            document.check(&[]).unwrap();
        });
    }

    #[test]
    fn one_bad_scene_does_not_stop_the_others() {
        let files = [
            (
                "batch.yaml",
                "scenes: [{file: bad.yaml}, {file: good.yaml}, {file: none.yaml}, {file: bad.yaml, name: again}]",
            ),
            ("bad.yaml", "camera: 3"),
            ("good.yaml", CAMERA),
        ];
        with(&files, |directory| {
            let document = load(&directory.join("batch.yaml")).unwrap();
            let results: Vec<bool> = document.entries().iter().map(|entry| entry.scene(&[]).is_ok()).collect();
            assert_eq!(results, [false, true, false, false]);
            let error = document.check(&[]).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert_eq!(
                in_words(&error, directory),
                "DIR/bad.yaml:1:9: camera: expected a map with fields among origin, target, up, to_world, fov_deg, fov_axis, \
                 orthographic_height, lens, clip, principal_point, shutter, found 3\n\
                 DIR/none.yaml: cannot be read: No such file or directory (os error 2); it is named at DIR/batch.yaml:1:54"
            );
        });
    }

    #[test]
    fn a_batch_in_a_batch_is_told_as_what_it_is() {
        let files =
            [("all.yaml", "scenes:\n- file: batch.yaml\n"), ("batch.yaml", "output: {}\nscenes: [{file: a.yaml}]")];
        with(&files, |directory| {
            assert_eq!(
                in_words(&load(&directory.join("all.yaml")).unwrap().check(&[]).unwrap_err(), directory),
                "DIR/batch.yaml:2:1: scenes: expected a scene, found a batch; it is named at DIR/all.yaml:2:9"
            );
        });
    }

    #[test]
    fn a_missing_scene_is_an_input_error() {
        with(&[("batch.yaml", "scenes: [{file: none.yaml}]")], |directory| {
            let error = load(&directory.join("batch.yaml")).unwrap().check(&[]).unwrap_err();
            assert_eq!(error.exit_code(), 3);
        });
    }

    #[test]
    fn a_setting_of_a_batch_is_told_at_its_own_line() {
        let batch = "scenes:\n- file: a.yaml\n  set:\n    render.smaples: 3\n- file: a.yaml\n  name: b\n  set:\n    render.samples: 0\n";
        with(&[("batch.yaml", batch), ("a.yaml", CAMERA)], |directory| {
            assert_eq!(
                in_words(&load(&directory.join("batch.yaml")).unwrap().check(&[]).unwrap_err(), directory),
                "DIR/batch.yaml:4:5: render.smaples: expected one of samples, stop, seed, effects, tile, wavelengths, techniques, \
                frames, seed_per_frame, frames_per_second, \
                 found \"smaples\"; did you mean \"samples\"?\n\
                 DIR/batch.yaml:8:21: render.samples: expected a whole number from 1 to 134217728, found 0"
            );
        });
    }

    #[test]
    fn output_names_are_distinct_and_can_be_file_names() {
        assert_eq!(
            refusal(
                "scenes:\n- file: x/a.yaml\n- file: y/a.yaml\n- {file: a.yaml, name: b/c}\n- {file: a.yaml, name: ..}\n"
            ),
            "DIR/batch.yaml:3:9: scenes[1].file: expected each output name once, found \"a\" again; \
             it is first at DIR/batch.yaml:2:9\n\
             DIR/batch.yaml:4:24: scenes[2].name: expected a name that can be a file name, found \"b/c\"\n\
             DIR/batch.yaml:5:24: scenes[3].name: expected a name that can be a file name, found \"..\""
        );
        // Of a file the name is the output's, too.
        for (file, stem) in [("sub/*.yaml", "*"), ("sub/a?.yaml", "a?"), ("sub\\s.yaml", "sub\\\\s")] {
            assert_eq!(
                refusal(&format!("scenes:\n- file: {file}\n")),
                format!(
                    "DIR/batch.yaml:2:9: scenes[0].file: expected one file, no pattern, in whose name is none of \
                     / \\ : * ? \" < > |, found \"{stem}\""
                )
            );
        }
    }

    #[test]
    fn a_batch_is_checked_before_its_scenes() {
        assert_eq!(
            refusal("scenes: []\nrender: {samples: 0}"),
            "DIR/batch.yaml:1:9: scenes: expected at least one scene, found none\n\
             DIR/batch.yaml:2:19: render.samples: expected a whole number from 1 to 134217728, found 0"
        );
        assert_eq!(
            refusal("scenes: [{fil: a.yaml}]"),
            "DIR/batch.yaml:1:11: scenes[0].fil: expected one of file, name, set, define, found \"fil\"; did you mean \"file\"?"
        );
        assert_eq!(
            refusal("scenes: [{file: a.yaml, set: {'shapes[x]': 1}}]"),
            "DIR/batch.yaml:1:44: scenes[0].set.\"shapes[x]\": \
             expected a whole number in the brackets of \"shapes[x]\", found \"x\""
        );
        assert_eq!(
            refusal("scens: []\nscenes: []"),
            "DIR/batch.yaml:1:1: scens: expected one of output, render, scenes, found \"scens\"; did you mean \"scenes\"?"
        );
    }

    /// A scene without a camera may have been meant for a batch, and a layer for a name, by its own keys alone.
    #[test]
    fn what_a_choice_may_be_is_no_cure_for_what_is_further_in() {
        let alone = |scene: &str, setting: &[(String, String)]| {
            with(&[("s.yaml", scene)], |directory| {
                let document = load(&directory.join("s.yaml")).unwrap();
                let error = document.entries()[0].scene(setting).unwrap_err();
                in_words(&error, directory)
            })
        };
        assert_eq!(
            alone("integrator: pathtracer\n", &[]),
            "DIR/s.yaml:1:13: integrator: expected one of path, whitted, depth, light_tracer, none, found \"pathtracer\"; did \
             you mean \"path\"?"
        );
        assert!(alone("scene: []\n", &[]).ends_with("fog, scenes, found \"scene\"; did you mean \"scenes\"?"));
        // All of a setting is at one place.
        let setting = ("layers".to_owned(), "[{name: n, surface: normal}]".to_owned());
        let told = alone(CAMERA, &[setting]);
        assert!(told.contains("layers[0].surface: expected one of depth, position, uv, "), "{told}");
    }

    #[test]
    fn a_parameter_that_no_scene_has_is_told_where_it_stands() {
        let scene = "<scene version=\"3.0.0\"><default name=\"res\" value=\"8\"/><integrator type=\"path\">\
                     <integer name=\"max_depth\" value=\"$res\"/></integrator></scene>";
        let batch = "scenes:\n- file: s.xml\n  define: {res: 4, rez: 5}\n";
        with(&[("s.xml", scene), ("batch.yaml", batch)], |directory| {
            let document = load(&directory.join("batch.yaml")).unwrap();
            let error = document.check(&[]).unwrap_err();
            assert_eq!(
                in_words(&error, directory),
                "DIR/batch.yaml:3:25: define.rez: expected a parameter that DIR/s.xml uses, found none named \"rez\"; \
                 did you mean \"res\"?"
            );
        });
    }

    #[test]
    fn a_parameter_is_a_number_true_or_false_or_text() {
        let batch = |define: &str| format!("scenes:\n- file: s.xml\n  define: {{{define}}}\n");
        let value = |define: &str| {
            with(&[("batch.yaml", &batch(define))], |directory| match load(&directory.join("batch.yaml")) {
                Ok(document) => document.entries()[0].defines[0].value.clone(),
                Err(error) => in_words(&error, directory),
            })
        };
        assert_eq!(["a: 1e3", "a: true", "a: false", "a: path"].map(value), ["1000", "true", "false", "path"]);
        // No f64 holds these.
        for whole in ["9007199254740993", "-9007199254740993", "18446744073709551615"] {
            assert_eq!(value(&format!("a: {whole}")), whole);
        }
        let beyond = "DIR/batch.yaml:3:15: scenes[0].define.a: expected a finite number, found -1e999";
        assert_eq!(value("a: -1e999"), beyond);
        let told =
            "DIR/batch.yaml:3:15: scenes[0].define.a: expected one of a number, true or false, text, found a list of 1";
        assert_eq!(value("a: [1]"), told);
    }

    #[test]
    fn the_reference_batch_is_a_batch() {
        with(&[("batch.yaml", &super::super::testing::reference("batch"))], |directory| {
            let document = load(&directory.join("batch.yaml")).unwrap();
            assert_eq!(document.entries().len(), 3);
            assert_eq!(document.entries()[1].settings.len(), 4);
            let defines = document.entries()[2].defines.iter();
            let defines: Vec<_> = defines.map(|define| (define.name.as_str(), define.value.as_str())).collect();
            assert_eq!(defines, [("integrator", "path"), ("res", "64")]);
        });
    }
}
