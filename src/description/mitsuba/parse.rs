//! Elements to objects: parameters, includes, old spellings.

mod references;
mod text;
mod transform;
mod values;

use std::cell::Cell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};

use self::text::{major_version, underscored};
pub(crate) use self::text::{number, tokens};
pub(super) use self::transform::ABOUT_ONE;
use super::super::edit::{Setting, read_bytes};
use super::super::fault::Fault;
use super::super::node::{Node, Place, Sources, Value as NodeValue, did_you_mean, quote};
use super::super::path::Segment;
use super::super::yaml::{self, MAX_NODES};
use super::object::{Document, Family, Object, Property, Value};
use super::xml::{self, Attribute, Element};
use crate::error::{Error, Result};

/// The deepest nesting of includes, as in Mitsuba.
const MAX_INCLUDES: usize = 15;
/// The most text of all files, each as often as it is included.
const MAX_TEXT: usize = 4 * yaml::MAX_BYTES;
/// What a file counts for at the least: to open it takes as long as to read so much.
const LEAST_TEXT: usize = 4096;

/// A value for a parameter of a scene.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Define {
    /// Of the parameter.
    pub name: String,
    /// As it would stand in XML.
    pub value: String,
    /// Where a batch gives it; none of `-D name=value` on the command line.
    pub place: Option<Place>,
}

impl Define {
    /// The value, in which `\$` is a dollar as it is in XML. Mitsuba fills parameters into parameters, in an order of its own.
    fn plain(&self, sources: &Sources) -> Result<String> {
        if self.value.matches('$').count() == self.value.matches("\\$").count() {
            return Ok(self.value.replace("\\$", "$"));
        }
        Err(self.fault("expected a value without other parameters, found a $; \\$ is a dollar", sources))
    }

    /// A fault of it.
    fn fault(&self, message: &str, sources: &Sources) -> Error {
        match self.place {
            Some(place) => {
                let path = [Segment::Key("define".into()), Segment::Key(self.name.clone())];
                Fault::at_place(place, message).under_path(&path).into_error(sources)
            }
            None => Error::Config(format!("-D {}={}: {message}", self.name, self.value)),
        }
    }
}

/// Reads a scene with `defines`.
///
/// # Errors
/// [`Error::Config`] with the first fault; [`Error::Input`] for a file that cannot be read.
pub(crate) fn read(path: &Path, defines: &[Define], sources: &mut Sources) -> Result<Document> {
    let mut parser = Parser {
        sources,
        budget: MAX_NODES,
        read: 0,
        filled: Cell::new(0),
        search: vec![path.parent().unwrap_or(Path::new("")).to_path_buf(), PathBuf::new()],
        parameters: Vec::new(),
        document: Document::default(),
        names: HashMap::new(),
        references: Vec::new(),
        reading: Vec::new(),
        unreadable: None,
    };
    for define in defines {
        let Define { name, .. } = define;
        if parser.parameters.iter().any(|parameter| parameter.name == *name) {
            let message = format!("expected each name once, found {} again", quote(name));
            return Err(define.fault(&message, parser.sources));
        }
        let value = define.plain(parser.sources)?;
        parser.parameters.push(Parameter { name: name.clone(), value, used: false });
    }
    let outcome = parser.file(path, None, None).and_then(|()| parser.resolve());
    if let Some(error) = parser.unreadable.take() {
        return Err(error);
    }
    outcome.map_err(|fault| fault.into_error(parser.sources))?;
    // Those of the definitions are the first.
    if let Some((unused, _)) = defines.iter().zip(&parser.parameters).find(|(_, parameter)| !parameter.used) {
        let own = parser.parameters.iter().skip(defines.len());
        let known = own.chain(parser.parameters.iter().filter(|parameter| parameter.used));
        let hint = did_you_mean(&unused.name, known.map(|parameter| parameter.name.as_str()));
        let message = format!(
            "expected a parameter that {} uses, found none named {}{hint}",
            path.display(),
            quote(&unused.name)
        );
        return Err(unused.fault(&message, parser.sources));
    }
    Ok(parser.document)
}

/// `$name`
struct Parameter {
    name: String,
    value: String,
    used: bool,
}

/// A `<ref>` whose object may come later.
struct Reference {
    object: usize,
    property: usize,
    id: String,
    place: Place,
}

struct Parser<'a> {
    sources: &'a mut Sources,
    budget: usize,
    /// Bytes of the files that were read.
    read: usize,
    /// Bytes of parameters that were filled in.
    filled: Cell<usize>,
    /// Directories in which what the file that is being read names is looked for, in order.
    search: Vec<PathBuf>,
    parameters: Vec<Parameter>,
    document: Document,
    /// Where each named property of each object is written.
    names: HashMap<(usize, String), Place>,
    references: Vec<Reference>,
    /// The files that are being read, outermost first.
    reading: Vec<PathBuf>,
    /// A file that could not be read: it ends the reading with an error of its own.
    unreadable: Option<Error>,
}

/// What holds for all elements of one file.
#[derive(Clone, Copy)]
struct InFile {
    source: u32,
    /// Major version below 2: names in camelCase.
    old: bool,
}

impl Parser<'_> {
    /// Reads a file; its objects go into `parent`, or make the root.
    fn file(
        &mut self,
        path: &Path,
        parent: Option<usize>,
        include: Option<&Element>,
    ) -> std::result::Result<(), Fault> {
        let here = include.map_or(Place::default(), |element| element.place);
        let canonical = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        if self.reading.contains(&canonical) {
            let message = format!("expected a file that does not include itself, found {}", path.display());
            return Err(Fault::at_place(here, message));
        }
        if self.reading.len() > MAX_INCLUDES {
            let message = format!("expected at most {MAX_INCLUDES} files that include each other, found more");
            return Err(Fault::at_place(here, message));
        }
        let bytes = match read_bytes(path) {
            Ok(bytes) => bytes,
            Err(error) => {
                let named = match include {
                    Some(element) => format!("; it is included at {}", self.sources.describe(element.place)),
                    None => String::new(),
                };
                self.unreadable = Some(Error::input(path, format!("cannot be read: {error}{named}")));
                return Err(Fault::at_place(here, "cannot be read"));
            }
        };
        self.read += bytes.len().max(LEAST_TEXT);
        if self.read > MAX_TEXT {
            let message = format!("expected at most {} MiB of text in all files, found more", MAX_TEXT >> 20);
            return Err(Fault::at_place(here, message));
        }
        let source = self.sources.add_resolved_file(path);
        self.document.directories.insert(source, path.parent().unwrap_or(Path::new("")).to_path_buf());
        let root = xml::read(&bytes, source, &mut self.budget)?;
        let version = root
            .attribute("version")
            .ok_or_else(|| Fault::at_place(root.place, format!("expected a version in <{}>, found none", root.tag)))?;
        let in_file = InFile { source, old: major_version(version)? < 2 };

        self.reading.push(canonical);
        let around = self.search.clone();
        // What it names is looked for beside the file that includes it first.
        if let Some(outer) = include.and_then(|include| self.document.directories.get(&include.place.source)) {
            self.search.insert(0, outer.clone());
        }
        let result = match parent {
            None if root.tag != "scene" => {
                let found = quote(&root.tag);
                Err(Fault::at_place(root.place, format!("expected the element <scene>, found {found}")))
            }
            None => self.object(&root, Family::Scene, in_file).map(|_| ()),
            Some(parent) if root.tag == "scene" => {
                check_attributes(&root, &["version"], &["id", "type", "name"])?;
                root.children.iter().try_for_each(|child| self.child(child, parent, in_file))
            }
            // A file may also hold a single object, which goes where the <include> stands.
            Some(parent) => {
                let mut root = root;
                root.attributes.retain(|attribute| attribute.name != "version");
                if let Some(name) = include.and_then(|include| include.attribute("name")) {
                    root.attributes.retain(|attribute| attribute.name != "name");
                    root.attributes.push(name.clone());
                }
                self.child(&root, parent, in_file)
            }
        };
        self.reading.pop();
        // Its <path> is no other file's.
        let own = std::mem::replace(&mut self.search, around);
        self.document.searches.insert(source, own);
        result
    }

    /// Makes an object of an element and gives its index.
    fn object(&mut self, element: &Element, family: Family, in_file: InFile) -> std::result::Result<usize, Fault> {
        if let Some(yaml) = element.attribute(xml::YAML) {
            return self.written(element, yaml, family, in_file);
        }
        match family {
            Family::Scene => check_attributes(element, &["version"], &["id", "type", "name"])?,
            _ => check_attributes(element, &["type"], &["id", "name"])?,
        }
        let kind = element.attribute("type");
        let plugin = kind.map_or(Ok("scene".to_owned()), |kind| self.text(kind))?;
        let id = element.attribute("id").map(|id| self.text(id)).transpose()?.filter(|id| !id.is_empty());
        let index = self.document.objects.len();
        if let Some(id) = &id {
            self.name(id, index, element.place)?;
        }
        self.document.objects.push(Object {
            family,
            plugin,
            plugin_place: kind.map_or(element.place, |kind| kind.place),
            id,
            place: element.place,
            source: in_file.source,
            properties: Vec::new(),
        });
        for child in &element.children {
            self.child(child, index, in_file)?;
        }
        if in_file.old {
            self.upgrade(index)?;
        }
        Ok(index)
    }

    /// Makes an object that is written in the grammar.
    fn written(
        &mut self,
        element: &Element,
        yaml: &Attribute,
        family: Family,
        in_file: InFile,
    ) -> std::result::Result<usize, Fault> {
        let node = self.grammar(&yaml.value, yaml.place, in_file)?;
        let id = element.attribute("id").map(|id| self.text(id)).transpose()?;
        let index = self.document.objects.len();
        if let Some(id) = &id {
            self.name(id, index, element.place)?;
        }
        self.document.objects.push(Object {
            family,
            plugin: "<?abbe instead?>".to_owned(),
            plugin_place: element.place,
            id,
            place: element.place,
            source: in_file.source,
            properties: vec![Property { name: String::new(), place: element.place, value: Value::Written(node) }],
        });
        Ok(index)
    }

    /// YAML inside an instruction; all of it stands at `place`, and files are found from this file.
    fn grammar(&self, text: &str, place: Place, in_file: InFile) -> std::result::Result<Node, Fault> {
        let mut node = yaml::read(text.as_bytes(), place.source).map_err(|mut fault| {
            fault.place = Some(place);
            fault
        })?;
        node.move_to(place);
        if let Some(directory) = self.document.directories.get(&in_file.source) {
            find_files(&mut node, directory);
        }
        Ok(node)
    }

    fn name(&mut self, id: &str, index: usize, place: Place) -> std::result::Result<(), Fault> {
        if let Some(first) = self.document.ids.insert(id.to_owned(), index) {
            let first = self.sources.describe(self.document.objects[first].place);
            let message = format!("expected each id once, found {} again; it is first at {first}", quote(id));
            return Err(Fault::at_place(place, message));
        }
        Ok(())
    }

    /// Reads an element inside an object.
    fn child(&mut self, element: &Element, parent: usize, in_file: InFile) -> std::result::Result<(), Fault> {
        let tag = element.tag.as_str();
        if let (xml::SET, Some(setting)) = (tag, element.attribute(xml::YAML)) {
            let Some((key, yaml)) = setting.value.split_once(": ") else {
                let message = format!("expected <?abbe set KEY: VALUE?>, found {}", quote(&setting.value));
                return Err(Fault::at_place(setting.place, message));
            };
            let node = self.grammar(yaml, setting.place, in_file)?;
            self.document.settings.push(Setting::new(key.trim(), setting.place, node)?);
            return Ok(());
        }
        let family = match tag {
            "spectrum" if element.attribute("type").is_some() => Some(Family::Texture),
            "scene" => None,
            tag => Family::TAGS.iter().find(|(known, _)| *known == tag).map(|(_, family)| *family),
        };
        if let Some(family) = family {
            let name = self.name_of(element, in_file)?;
            let index = self.object(element, family, in_file)?;
            return self.set(parent, name, element.place, Value::Object(index));
        }
        if tag != "transform"
            && PROPERTY_TAGS.contains(&tag)
            && let Some(inner) = element.children.first()
        {
            let message = format!("expected nothing inside <{tag}>, found <{}>", inner.tag);
            return Err(Fault::at_place(inner.place, message));
        }
        match tag {
            "ref" => self.reference(element, parent, in_file),
            "alias" => self.alias(element),
            "default" => self.default(element),
            "include" => {
                check_attributes(element, &["filename"], &["name"])?;
                let file = self.text(attribute(element, "filename")?)?;
                let path = self.find_from(&file, in_file.source);
                self.file(&path, Some(parent), Some(element))
            }
            "path" => self.search_path(element, parent, in_file),
            "translate" | "rotate" | "scale" | "lookat" | "matrix" => {
                let message = format!("expected <{tag}> inside <transform>, found it outside");
                Err(Fault::at_place(element.place, message))
            }
            _ => {
                let value = self.value(element, in_file)?;
                let name = self.name_of(element, in_file)?;
                self.set(parent, name, element.place, value)
            }
        }
    }

    /// The value of a parameter that is no object.
    fn value(&mut self, element: &Element, in_file: InFile) -> std::result::Result<Value, Fault> {
        match element.tag.as_str() {
            "float" => {
                check_attributes(element, &["name", "value"], &[])?;
                Ok(Value::Float(self.number(attribute(element, "value")?)?))
            }
            "integer" => {
                check_attributes(element, &["name", "value"], &[])?;
                let written = attribute(element, "value")?;
                let text = self.text(written)?;
                // Mitsuba's have no plus.
                let whole = text.trim().parse().ok().filter(|_| !text.trim().starts_with('+'));
                let whole = whole.ok_or_else(|| {
                    Fault::at_place(written.place, format!("expected a whole number, found {}", quote(&text)))
                })?;
                Ok(Value::Integer(whole))
            }
            "boolean" => {
                check_attributes(element, &["name", "value"], &[])?;
                let written = attribute(element, "value")?;
                let text = self.text(written)?;
                match text.to_ascii_lowercase().as_str() {
                    "true" => Ok(Value::Boolean(true)),
                    "false" => Ok(Value::Boolean(false)),
                    _ => {
                        let message = format!("expected true or false, found {}", quote(&text));
                        Err(Fault::at_place(written.place, message))
                    }
                }
            }
            "string" => {
                check_attributes(element, &["name", "value"], &[])?;
                Ok(Value::Text(self.text(attribute(element, "value")?)?))
            }
            "point" | "vector" => {
                check_attributes(element, &["name"], &["value", "x", "y", "z"])?;
                if element.attribute("value").is_none() {
                    check_attributes(element, &["name", "x", "y", "z"], &[])?;
                }
                Ok(Value::Vector(self.vector(element, 0.0)?))
            }
            "rgb" => {
                check_attributes(element, &["name", "value"], &[])?;
                let written = attribute(element, "value")?;
                match self.numbers(written)?[..] {
                    [grey] => Ok(Value::Rgb([grey; 3])),
                    [r, g, b] => Ok(Value::Rgb([r, g, b])),
                    ref other => {
                        let message = format!("expected 1 or 3 numbers, found {}", other.len());
                        Err(Fault::at_place(written.place, message))
                    }
                }
            }
            "spectrum" => self.spectrum(element, in_file),
            "transform" => {
                check_attributes(element, &["name"], &[])?;
                Ok(Value::Transform(self.transform(element)?))
            }
            "scene" => Err(Fault::at_place(element.place, "expected <scene> around all others, found it inside")),
            tag => {
                let inside = Family::TAGS.iter().filter(|(_, family)| *family != Family::Scene);
                let known = inside.map(|(tag, _)| *tag).chain(PROPERTY_TAGS);
                let mut hint = did_you_mean(tag, known.clone());
                if hint.is_empty() {
                    hint = format!("; known: {}", known.collect::<Vec<_>>().join(", "));
                }
                let message = format!("expected an element of a scene, found <{tag}>{hint}");
                Err(Fault::at_place(element.place, message))
            }
        }
    }

    fn reference(&mut self, element: &Element, parent: usize, in_file: InFile) -> std::result::Result<(), Fault> {
        check_attributes(element, &["id"], &["name"])?;
        let name = self.name_of(element, in_file)?;
        let id = self.text(attribute(element, "id")?)?;
        // The index is filled in by `resolve`.
        self.set(parent, name, element.place, Value::Object(usize::MAX))?;
        let property = self.document.objects[parent].properties.len() - 1;
        self.references.push(Reference { object: parent, property, id, place: element.place });
        Ok(())
    }

    fn alias(&mut self, element: &Element) -> std::result::Result<(), Fault> {
        check_attributes(element, &["id", "as"], &[])?;
        let id = self.text(attribute(element, "id")?)?;
        let Some(&index) = self.document.ids.get(&id) else {
            let hint = did_you_mean(&id, self.document.ids.keys().map(String::as_str));
            let message = format!("expected the id of an object above, found {}{hint}", quote(&id));
            return Err(Fault::at_place(element.place, message));
        };
        let new = self.text(attribute(element, "as")?)?;
        self.name(&new, index, element.place)
    }

    fn default(&mut self, element: &Element) -> std::result::Result<(), Fault> {
        check_attributes(element, &["name", "value"], &[])?;
        let written = attribute(element, "name")?;
        let name = self.text(written)?;
        if name.is_empty() {
            return Err(Fault::at_place(written.place, "expected a name, found empty text"));
        }
        let value = self.text(attribute(element, "value")?)?;
        if !self.parameters.iter().any(|parameter| parameter.name == name) {
            self.parameters.push(Parameter { name, value, used: false });
        }
        Ok(())
    }

    fn search_path(&mut self, element: &Element, parent: usize, in_file: InFile) -> std::result::Result<(), Fault> {
        check_attributes(element, &["value"], &[])?;
        if self.document.objects[parent].family != Family::Scene {
            return Err(Fault::at_place(element.place, "expected <path> directly inside <scene>, found it deeper"));
        }
        let written = attribute(element, "value")?;
        let text = self.text(written)?;
        let path = self.find_from(&text, in_file.source);
        if !path.is_dir() {
            let message = format!("expected a directory, found none at {}", path.display());
            return Err(Fault::at_place(written.place, message));
        }
        self.search.insert(0, path);
        Ok(())
    }

    fn name_of(&mut self, element: &Element, in_file: InFile) -> std::result::Result<String, Fault> {
        let name = match element.attribute("name") {
            Some(name) => self.text(name)?,
            None => String::new(),
        };
        Ok(if in_file.old { underscored(&name) } else { name })
    }

    fn set(&mut self, parent: usize, name: String, place: Place, value: Value) -> std::result::Result<(), Fault> {
        if !name.is_empty()
            && let Some(first) = self.names.insert((parent, name.clone()), place)
        {
            let first = self.sources.describe(first);
            let message = format!("expected each parameter once, found {} again; it is first at {first}", quote(&name));
            return Err(Fault::at_place(place, message));
        }
        self.document.objects[parent].properties.push(Property { name, place, value });
        Ok(())
    }

    /// A file or directory that an element of `source` names: first beside that file, then where all
    /// files are looked for.
    fn find_from(&self, name: &str, source: u32) -> PathBuf {
        let own = self.document.directories.get(&source).cloned().unwrap_or_default();
        let first = own.join(name);
        if first.exists() {
            return first;
        }
        self.searched(name).unwrap_or(first)
    }

    /// What the directories that are known so far hold by this name.
    fn searched(&self, name: &str) -> Option<PathBuf> {
        self.search.iter().map(|directory| directory.join(name)).find(|path| path.exists())
    }

    /// What was spelt otherwise before version 2, beside camelCase.
    fn upgrade(&mut self, index: usize) -> std::result::Result<(), Fault> {
        let object = &mut self.document.objects[index];
        if object.plugin == "diffuse" && !object.properties.iter().any(|p| p.name == "reflectance") {
            for property in &mut object.properties {
                if property.name == "diffuse_reflectance" {
                    property.name = "reflectance".to_owned();
                }
            }
        }
        // uoffset, voffset, uscale, vscale: to_uv = scale · translate.
        let keys = ["uoffset", "voffset", "uscale", "vscale"];
        let mut values = [0.0, 0.0, 1.0, 1.0];
        let mut place = None;
        for (key, value) in keys.iter().zip(&mut values) {
            let Some(at) = object.properties.iter().position(|property| property.name == *key) else { continue };
            let property = object.properties.remove(at);
            *value = match property.value {
                Value::Float(value) => value,
                Value::Integer(value) => value as f64,
                _ => return Err(Fault::at_place(property.place, format!("{key}: expected a float"))),
            };
            place = Some(property.place);
            // References know their property by its number.
            for reference in &mut self.references {
                if reference.object == index && reference.property > at {
                    reference.property -= 1;
                }
            }
        }
        if let Some(place) = place {
            let [u, v, scale_u, scale_v] = values;
            let to_uv =
                DMat4::from_scale(DVec3::new(scale_u, scale_v, 1.0)) * DMat4::from_translation(DVec3::new(u, v, 0.0));
            self.set(index, "to_uv".to_owned(), place, Value::Transform(to_uv))?;
        }
        Ok(())
    }
}

/// Tags that are properties or say how to read the rest.
const PROPERTY_TAGS: [&str; 14] = [
    "float",
    "integer",
    "boolean",
    "string",
    "point",
    "vector",
    "rgb",
    "spectrum",
    "transform",
    "ref",
    "alias",
    "default",
    "include",
    "path",
];

fn attribute<'a>(element: &'a Element, name: &str) -> std::result::Result<&'a Attribute, Fault> {
    element.attribute(name).ok_or_else(|| missing(element, name))
}

fn missing(element: &Element, name: &str) -> Fault {
    Fault::at_place(element.place, format!("expected the attribute {name:?} in <{}>, found none", element.tag))
}

fn check_attributes(element: &Element, required: &[&str], optional: &[&str]) -> std::result::Result<(), Fault> {
    let known = || required.iter().chain(optional).copied();
    if let Some(unknown) = element.attributes.iter().find(|attribute| !known().any(|name| name == attribute.name)) {
        let hint = did_you_mean(&unknown.name, known());
        let expected = known().collect::<Vec<_>>().join(", ");
        let message =
            format!("expected attributes among {expected} in <{}>, found {}{hint}", element.tag, quote(&unknown.name));
        return Err(Fault::at_place(unknown.place, message));
    }
    match required.iter().find(|name| element.attribute(name).is_none()) {
        Some(name) => Err(missing(element, name)),
        None => Ok(()),
    }
}

/// Makes the paths of files, which stand under `file` throughout the grammar, start from `directory`.
fn find_files(node: &mut Node, directory: &Path) {
    match &mut node.value {
        NodeValue::List(items) => items.iter_mut().for_each(|item| find_files(item, directory)),
        NodeValue::Map(entries) => {
            for entry in entries {
                match &mut entry.node.value {
                    NodeValue::Text(file) if entry.key == "file" => {
                        *file = directory.join(&*file).to_string_lossy().into_owned();
                    }
                    _ => find_files(&mut entry.node, directory),
                }
            }
        }
        _ => {}
    }
}
