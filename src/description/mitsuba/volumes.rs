//! Volumes, and what takes one or a spectrum.

use glam::DMat4;

use super::super::fault::Fault;
use super::super::node::Node;
use super::object::{Bag, Family, Value};
use super::spectra::Role;
use super::{Fields, Import, boolean, entry, list, matrix, number, text};

const VOLUMES: [&str; 2] = ["gridvolume", "constvolume"];

impl Import<'_> {
    /// The name under which a volume stands in `volumes`.
    pub(crate) fn declare_volume(&mut self, index: usize) -> Result<String, Fault> {
        if let Some(name) = self.names.get(&index) {
            return Ok(name.clone());
        }
        let bag = self.bag(index);
        let node = match bag.object.plugin.as_str() {
            "gridvolume" => grid(&bag)?,
            "constvolume" => {
                let mut fields = Fields::new(bag.object.place);
                let value = self.spectrum(&bag, "value", Role::Coefficient)?;
                fields.add("value", value.unwrap_or_else(|| number(bag.object.place, 1.0)));
                transform(&bag, &mut fields)?;
                fields.kind("constant")
            }
            _ => return Err(bag.unknown(VOLUMES)),
        };
        bag.finish()?;
        let name = self.name_for(index);
        self.volumes.push(self.entry(index, &name, node));
        Ok(name)
    }

    /// The spectrum or `{volume: name}` of a property.
    pub(crate) fn spectrum_or_volume(
        &mut self,
        bag: &Bag<'_>,
        name: &'static str,
        role: Role,
    ) -> Result<Option<Node>, Fault> {
        match bag.value(name) {
            Some(Value::Object(index)) if bag.document.objects[*index].family == Family::Volume => {
                let volume = self.declare_volume(*index)?;
                let place = bag.place(name);
                Ok(Some(entry(place, "volume", text(place, volume))))
            }
            _ => self.spectrum(bag, name, role),
        }
    }

    /// A spectrum, which may stand in a volume that is the same everywhere.
    pub(crate) fn even_volume(&mut self, bag: &Bag<'_>, name: &'static str) -> Result<Option<Node>, Fault> {
        match bag.value(name) {
            Some(Value::Object(index)) if bag.document.objects[*index].plugin == "constvolume" => {
                let volume = self.bag(*index);
                let value = self.spectrum(&volume, "value", Role::Coefficient)?;
                // Wherever it is.
                volume.transform("to_world")?;
                volume.finish()?;
                Ok(Some(value.unwrap_or_else(|| number(volume.object.place, 1.0))))
            }
            _ => self.spectrum(bag, name, Role::Coefficient),
        }
    }

    /// The volume of a property: what is the same everywhere fills the unit cube, as it does for Mitsuba.
    pub(crate) fn volume_of(&mut self, bag: &Bag<'_>, name: &'static str, default: f64) -> Result<Node, Fault> {
        let place = bag.place(name);
        let node = self.spectrum_or_volume(bag, name, Role::Coefficient)?;
        let node = node.unwrap_or_else(|| number(place, default));
        if node.get("volume").is_some() {
            return Ok(node);
        }
        let key = self.made(format!("{name} {}", self.volumes.len()));
        let mut fields = Fields::new(place);
        fields.add("value", node);
        self.volumes.push(super::Entry { key: key.clone(), key_place: place, node: fields.kind("constant") });
        Ok(entry(place, "volume", text(place, key)))
    }
}

fn grid(bag: &Bag<'_>) -> Result<Node, Fault> {
    let mut fields = Fields::new(bag.object.place);
    let file = bag.required("filename", bag.file("filename"))?;
    fields.add("file", text(bag.place("filename"), file));
    if let Some(filter) = bag.choice("filter_type", &["trilinear", "nearest"])? {
        fields.add("filter", text(bag.place("filter_type"), filter));
    }
    if let Some(wrap) = bag.choice("wrap_mode", &["repeat", "mirror", "clamp"])? {
        fields.add("wrap", text(bag.place("wrap_mode"), wrap));
    }
    for (ours, theirs) in [("raw", "raw"), ("file_box", "use_grid_bbox")] {
        if let Some(value) = bag.boolean(theirs)? {
            fields.add(ours, boolean(bag.place(theirs), value));
        }
    }
    fields.add("above_one", boolean(bag.object.place, true));
    // How it is kept in memory, and an upper bound: ours are found from the values.
    bag.boolean("accel")?;
    bag.float("max_value")?;
    transform(bag, &mut fields)?;
    Ok(fields.kind("grid"))
}

fn transform(bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
    let to_world = bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY);
    if to_world != DMat4::IDENTITY {
        let at = bag.place("to_world");
        fields.add("transform", list(at, [entry(at, "matrix", matrix(at, to_world))]));
    }
    Ok(())
}
