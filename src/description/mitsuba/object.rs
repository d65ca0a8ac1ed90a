//! The objects of a Mitsuba scene: what the elements mean before any plugin is known.
//!
//! An [`Object`] has a family (`shape`, `bsdf`, …), a plugin, and named properties, of which some
//! are objects. A [`Bag`] hands the properties of one object to the code that knows its plugin,
//! and at the end says which of them nobody asked for.

use std::cell::{Cell, RefCell};

use glam::DMat4;

use super::super::edit::Setting;
use super::super::fault::Fault;
use super::super::node::{Node, Place, did_you_mean, quote};

/// What kind of thing an element describes: its tag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    Scene,
    Integrator,
    Sensor,
    Film,
    ReconstructionFilter,
    Sampler,
    Shape,
    Bsdf,
    Emitter,
    Medium,
    Phase,
    /// `<texture>`, and `<spectrum>` with a type.
    Texture,
    Volume,
}

impl Family {
    /// By the tag of an element.
    pub(crate) const TAGS: [(&'static str, Family); 13] = [
        ("scene", Family::Scene),
        ("integrator", Family::Integrator),
        ("sensor", Family::Sensor),
        ("film", Family::Film),
        ("rfilter", Family::ReconstructionFilter),
        ("sampler", Family::Sampler),
        ("shape", Family::Shape),
        ("bsdf", Family::Bsdf),
        ("emitter", Family::Emitter),
        ("medium", Family::Medium),
        ("phase", Family::Phase),
        ("texture", Family::Texture),
        ("volume", Family::Volume),
    ];

    /// The tag of its elements.
    pub(crate) fn tag(self) -> &'static str {
        Family::TAGS.iter().find(|(_, family)| *family == self).map_or("", |(tag, _)| tag)
    }
}

/// A plugin and its properties.
#[derive(Clone, Debug)]
pub(crate) struct Object {
    pub(crate) family: Family,
    /// The attribute `type`.
    pub(crate) plugin: String,
    /// Of the attribute `type`, or of the element.
    pub(crate) plugin_place: Place,
    pub(crate) id: Option<String>,
    /// Of the element.
    pub(crate) place: Place,
    /// Number of the file in which it stands, whose directory is the last place where its files are looked for.
    pub(crate) source: u32,
    /// In the order of the text; names are distinct but for the empty one.
    pub(crate) properties: Vec<Property>,
}

/// A named value.
#[derive(Clone, Debug)]
pub(crate) struct Property {
    /// Empty for an object that has no name.
    pub(crate) name: String,
    /// Of the element.
    pub(crate) place: Place,
    pub(crate) value: Value,
}

/// What a property can be.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Boolean(bool),
    Integer(i64),
    Float(f64),
    Text(String),
    /// `<point>`, `<vector>`
    Vector([f64; 3]),
    /// `<rgb>`
    Rgb([f64; 3]),
    /// `<spectrum>` without a type.
    Spectrum(SpectrumValue),
    Transform(DMat4),
    /// An object inside, or one that a `<ref>` names: index into the document's.
    Object(usize),
    /// The object itself, as it stands in the grammar: `<?abbe instead …?>`.
    Written(Node),
}

/// `<spectrum value="…"/>` or `<spectrum filename="…"/>`
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SpectrumValue {
    Uniform(f64),
    /// nm and value; nm increases.
    Table(Vec<[f64; 2]>),
    /// Path of a file with two columns.
    File(String),
}

impl Value {
    /// What it is, for "expected …, found …".
    pub(crate) fn kind(&self, document: &Document) -> String {
        match self {
            Value::Boolean(_) => "a boolean".to_owned(),
            Value::Integer(_) => "an integer".to_owned(),
            Value::Float(_) => "a float".to_owned(),
            Value::Text(text) => format!("the string {}", quote(text)),
            Value::Vector(_) => "a vector".to_owned(),
            Value::Rgb(_) => "an rgb colour".to_owned(),
            Value::Spectrum(_) => "a spectrum".to_owned(),
            Value::Transform(_) => "a transform".to_owned(),
            Value::Written(_) => "a field of the grammar".to_owned(),
            Value::Object(index) => {
                let object = &document.objects[*index];
                format!("the {} {}", object.family.tag(), quote(&object.plugin))
            }
        }
    }
}

/// All objects of a scene; the first is the scene itself. References are resolved, and do not run
/// in circles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Document {
    pub(crate) objects: Vec<Object>,
    /// Which object has this id, or this alias.
    pub(crate) ids: std::collections::HashMap<String, usize>,
    /// Fields of the grammar that are set past everything else, in the order of the text.
    pub(crate) settings: Vec<Setting>,
    /// Directories in which what a file names is looked for, in order, by source.
    pub(crate) searches: std::collections::HashMap<u32, Vec<std::path::PathBuf>>,
    /// Directory of each file that was read, by source.
    pub(crate) directories: std::collections::HashMap<u32, std::path::PathBuf>,
}

type Asked<T> = Result<Option<T>, Fault>;

/// The properties of one object, with a record of what was asked for.
pub(crate) struct Bag<'a> {
    pub(crate) document: &'a Document,
    pub(crate) object: &'a Object,
    used: Vec<Cell<bool>>,
    asked: RefCell<Vec<&'static str>>,
}

impl<'a> Bag<'a> {
    pub(crate) fn new(document: &'a Document, index: usize) -> Bag<'a> {
        let object = &document.objects[index];
        let used = object.properties.iter().map(|_| Cell::new(false)).collect();
        Bag { document, object, used, asked: RefCell::default() }
    }

    /// The object as it stands in the grammar, if it was written so.
    pub(crate) fn written(&self) -> Option<Node> {
        match &self.object.properties.first()?.value {
            Value::Written(node) => Some(node.clone()),
            _ => None,
        }
    }

    /// A fault of the whole object.
    pub(crate) fn fault(&self, message: impl AsRef<str>) -> Fault {
        self.fault_at(self.object.place, message)
    }

    /// A fault of one property; of the object where it is not written.
    pub(crate) fn fault_of(&self, name: &str, message: impl AsRef<str>) -> Fault {
        let place = self.place(name);
        self.fault_at(place, format!("{name}: {}", message.as_ref()))
    }

    fn fault_at(&self, place: Place, message: impl AsRef<str>) -> Fault {
        let Object { family, plugin, .. } = self.object;
        match family {
            Family::Scene => Fault::at_place(place, message.as_ref()),
            _ => Fault::at_place(place, format!("{} {}: {}", family.tag(), quote(plugin), message.as_ref())),
        }
    }

    /// The place of a property; of the object where it is not written.
    pub(crate) fn place(&self, name: &str) -> Place {
        let property = self.object.properties.iter().find(|property| property.name == name);
        property.map_or(self.object.place, |property| property.place)
    }

    /// The property of this name, whatever it is.
    pub(crate) fn value(&self, name: &'static str) -> Option<&'a Value> {
        self.asked.borrow_mut().push(name);
        let index = self.object.properties.iter().position(|property| property.name == name)?;
        self.used[index].set(true);
        Some(&self.object.properties[index].value)
    }

    /// Whether there is a property of this name; does not count as use.
    pub(crate) fn has(&self, name: &'static str) -> bool {
        self.asked.borrow_mut().push(name);
        self.object.properties.iter().any(|property| property.name == name)
    }

    fn typed<T>(&self, name: &'static str, expected: &str, of: impl Fn(&'a Value) -> Option<T>) -> Asked<T> {
        let Some(value) = self.value(name) else { return Ok(None) };
        match of(value) {
            Some(value) => Ok(Some(value)),
            None => {
                let found = value.kind(self.document);
                Err(self.fault_of(name, format!("expected {expected}, found {found}")))
            }
        }
    }

    /// A `<float>` or `<integer>`.
    pub(crate) fn float(&self, name: &'static str) -> Asked<f64> {
        self.typed(name, "a float", |value| match value {
            Value::Float(value) => Some(*value),
            Value::Integer(value) => Some(*value as f64),
            _ => None,
        })
    }

    pub(crate) fn integer(&self, name: &'static str) -> Asked<i64> {
        self.typed(name, "an integer", |value| match value {
            Value::Integer(value) => Some(*value),
            _ => None,
        })
    }

    pub(crate) fn boolean(&self, name: &'static str) -> Asked<bool> {
        self.typed(name, "a boolean", |value| match value {
            Value::Boolean(value) => Some(*value),
            _ => None,
        })
    }

    pub(crate) fn text(&self, name: &'static str) -> Asked<&'a str> {
        self.typed(name, "a string", |value| match value {
            Value::Text(value) => Some(value.as_str()),
            _ => None,
        })
    }

    /// A `<point>` or `<vector>`.
    pub(crate) fn vector(&self, name: &'static str) -> Asked<[f64; 3]> {
        self.typed(name, "a point or a vector", |value| match value {
            Value::Vector(value) => Some(*value),
            _ => None,
        })
    }

    pub(crate) fn rgb(&self, name: &'static str) -> Asked<[f64; 3]> {
        self.typed(name, "an rgb colour", |value| match value {
            Value::Rgb(rgb) => Some(*rgb),
            _ => None,
        })
    }

    pub(crate) fn transform(&self, name: &'static str) -> Asked<DMat4> {
        self.typed(name, "a transform", |value| match value {
            Value::Transform(value) => Some(*value),
            _ => None,
        })
    }

    /// One of several words, as they are spelt.
    pub(crate) fn choice(&self, name: &'static str, choices: &[&'static str]) -> Asked<&'static str> {
        self.one_of(name, choices, |choice, text| choice == text)
    }

    /// One of several words, in capitals or not: some are so for Mitsuba.
    pub(crate) fn choice_in_any_case(&self, name: &'static str, choices: &[&'static str]) -> Asked<&'static str> {
        self.one_of(name, choices, str::eq_ignore_ascii_case)
    }

    fn one_of(
        &self,
        name: &'static str,
        choices: &[&'static str],
        same: impl Fn(&str, &str) -> bool,
    ) -> Asked<&'static str> {
        let Some(text) = self.text(name)? else { return Ok(None) };
        match choices.iter().find(|choice| same(choice, text)) {
            Some(choice) => Ok(Some(choice)),
            None => {
                let hint = did_you_mean(text, choices.iter().copied());
                let message = format!("expected one of {}, found {}{hint}", choices.join(", "), quote(text));
                Err(self.fault_of(name, message))
            }
        }
    }

    /// The path of a file that the string `name` holds, found as Mitsuba finds it.
    pub(crate) fn file(&self, name: &'static str) -> Asked<String> {
        let Some(text) = self.text(name)? else { return Ok(None) };
        Ok(Some(self.document.find(text, self.object.source)))
    }

    /// The object of this name and one of these families.
    pub(crate) fn object(&self, name: &'static str, families: &[Family]) -> Asked<usize> {
        let tags: Vec<&str> = families.iter().map(|family| family.tag()).collect();
        self.typed(name, &format!("a {}", tags.join(" or a ")), |value| match value {
            Value::Object(index) if families.contains(&self.document.objects[*index].family) => Some(*index),
            _ => None,
        })
    }

    /// All spectra, written as such or as objects, whatever their names, in the order of the text.
    pub(crate) fn spectra(&self) -> Vec<(&'a str, Place, &'a Value)> {
        let mut found = Vec::new();
        for (property, used) in self.object.properties.iter().zip(&self.used) {
            let is_spectrum = match &property.value {
                Value::Spectrum(_) => true,
                Value::Object(index) => self.document.objects[*index].family == Family::Texture,
                _ => false,
            };
            if is_spectrum {
                used.set(true);
                found.push((property.name.as_str(), property.place, &property.value));
            }
        }
        found
    }

    /// All objects of a family, whatever their names, in the order of the text.
    pub(crate) fn objects(&self, family: Family) -> Vec<usize> {
        let mut found = Vec::new();
        for (property, used) in self.object.properties.iter().zip(&self.used) {
            if let Value::Object(index) = property.value
                && self.document.objects[index].family == family
            {
                used.set(true);
                found.push(index);
            }
        }
        found
    }

    /// The only object of a family, whatever its name.
    pub(crate) fn only(&self, family: Family) -> Asked<usize> {
        let found = self.objects(family);
        match found[..] {
            [] => Ok(None),
            [index] => Ok(Some(index)),
            [_, second, ..] => {
                let place = self.document.objects[second].place;
                Err(self.fault_at(place, format!("expected one {}, found {}", family.tag(), found.len())))
            }
        }
    }

    /// What `of` gave, or a fault that the property has to be written.
    pub(crate) fn required<T>(&self, name: &'static str, of: Asked<T>) -> Result<T, Fault> {
        of?.ok_or_else(|| self.fault(format!("expected the parameter {name:?}, found none")))
    }

    /// That no property is left that nobody asked for.
    ///
    /// # Errors
    /// About the first one that is.
    pub(crate) fn finish(&self) -> Result<(), Fault> {
        let unused = self.object.properties.iter().zip(&self.used).find(|(_, used)| !used.get());
        let Some((property, _)) = unused else { return Ok(()) };
        let found = property.value.kind(self.document);
        if property.name.is_empty() {
            let message = match property.value {
                Value::Object(_) => format!("expected no {}", found.trim_start_matches("the ")),
                _ => format!("expected a name, found {found} without one"),
            };
            return Err(self.fault_at(property.place, message));
        }
        let mut known = self.asked.borrow().clone();
        known.sort_unstable();
        known.dedup();
        let hint = did_you_mean(&property.name, known.iter().copied());
        let expected = match known.as_slice() {
            [] => "expected no parameters".to_owned(),
            known => format!("expected parameters among {}", known.join(", ")),
        };
        Err(self.fault_at(property.place, format!("{expected}, found {}{hint}", quote(&property.name))))
    }

    /// That this plugin, which is none of those that the importer knows.
    pub(crate) fn unknown<'b>(&self, known: impl IntoIterator<Item = &'b str>) -> Fault {
        let known: Vec<&str> = known.into_iter().collect();
        let hint = did_you_mean(&self.object.plugin, known.iter().copied());
        let (tag, plugin) = (self.object.family.tag(), quote(&self.object.plugin));
        let article = if tag.starts_with(['e', 'i']) { "an" } else { "a" };
        let message = format!("expected {article} {tag} that Abbe has ({}), found {plugin}{hint}", known.join(", "));
        Fault::at_place(self.object.plugin_place, message)
    }
}

impl Document {
    /// Whether an object of this family has this id.
    pub(crate) fn has(&self, family: Family, id: &str) -> bool {
        self.ids.get(id).is_some_and(|index| self.objects[*index].family == family)
    }

    /// Where the file `name` is: absolute, else in the first directory of the search that has it, or that of the
    /// file that mentions it, else in that of the scene's file, where it is then missed.
    pub(crate) fn find(&self, name: &str, source: u32) -> String {
        self.look_for(name, source).unwrap_or_else(|| self.home().join(name).to_string_lossy().into_owned())
    }

    /// As [`Document::find`], where there is such a file.
    pub(crate) fn look_for(&self, name: &str, source: u32) -> Option<String> {
        // Mitsuba opens files when all is read, and by then knows the <path>s of the scene's file alone. What it does not find so
        // may be where the file that names it has its own.
        let root = self.objects.first().map_or(source, |root| root.source);
        let searches = [root, source].into_iter().filter_map(|source| self.searches.get(&source)).flatten();
        let found = searches
            .chain(self.directories.get(&source))
            .map(|directory| directory.join(name))
            .find(|path| path.exists());
        found.map(|path| path.to_string_lossy().into_owned())
    }

    /// The directory of the scene's file.
    fn home(&self) -> std::path::PathBuf {
        self.objects.first().and_then(|root| self.directories.get(&root.source)).cloned().unwrap_or_default()
    }
}
