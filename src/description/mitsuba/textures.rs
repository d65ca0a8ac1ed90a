//! Textures.

use glam::{DMat4, DVec4};

use super::super::fault::Fault;
use super::super::node::Node;
use super::object::{Bag, Family};
use super::spectra::Role;
use super::{Fields, Import, boolean, entry, number, numbers, text};

const TEXTURES: [&str; 4] = ["bitmap", "checkerboard", "volume", "mesh_attribute"];

impl Import<'_> {
    /// The name under which a texture stands in `textures`.
    pub(crate) fn declare_texture(&mut self, index: usize) -> Result<String, Fault> {
        if let Some(name) = self.names.get(&index) {
            return Ok(name.clone());
        }
        let bag = self.bag(index);
        let node = match bag.object.plugin.as_str() {
            "bitmap" => bitmap(&bag)?,
            "checkerboard" => self.checkerboard(&bag)?,
            "mesh_attribute" => {
                let mut fields = Fields::new(bag.object.place);
                let name = bag.required("name", bag.text("name"))?;
                fields.add("name", text(bag.place("name"), name));
                fields.add("scale", number(bag.place("scale"), bag.float("scale")?.unwrap_or(1.0)));
                fields.kind("mesh_attribute")
            }
            "volume" => {
                let volume = bag.required("volume", bag.object("volume", &[Family::Volume]))?;
                let name = self.declare_volume(volume)?;
                entry(bag.object.place, "volume", text(bag.place("volume"), name))
            }
            _ => return Err(bag.unknown(TEXTURES)),
        };
        bag.finish()?;
        let name = self.name_for(index);
        self.textures.push(self.entry(index, &name, node));
        Ok(name)
    }

    fn checkerboard(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        for (ours, theirs, default) in [("a", "color0", 0.4), ("b", "color1", 0.2)] {
            let colour = self.spectrum(bag, theirs, Role::Reflectance)?;
            fields.add(ours, colour.unwrap_or_else(|| number(place, default)));
        }
        let to_uv = to_uv(bag)?;
        if to_uv.offset != [0.0; 2] {
            return Err(bag.fault_of("to_uv", "expected only a scale, found an offset"));
        }
        fields.add("scale", numbers(bag.place("to_uv"), &to_uv.scale));
        Ok(fields.kind("checkerboard"))
    }
}

fn bitmap(bag: &Bag<'_>) -> Result<Node, Fault> {
    let mut fields = Fields::new(bag.object.place);
    let file = bag.required("filename", bag.file("filename"))?;
    fields.add("file", text(bag.place("filename"), file));
    if let Some(filter) = bag.choice("filter_type", &["bilinear", "nearest"])? {
        fields.add("filter", text(bag.place("filter_type"), filter));
    }
    if let Some(wrap) = bag.choice("wrap_mode", &["repeat", "mirror", "clamp"])? {
        fields.add("wrap", text(bag.place("wrap_mode"), wrap));
    }
    // As light it is its own spectrum, not a colour under D65.
    fields.add("illuminant", text(bag.object.place, "E"));
    if let Some(raw) = bag.boolean("raw")? {
        fields.add("raw", boolean(bag.place("raw"), raw));
    }
    // How it is kept in memory.
    bag.choice("format", &["auto", "variant", "fp16", "float16"])?;
    bag.boolean("accel")?;
    // Theirs begins at the upper left corner of the file, ours at the lower left.
    let to_uv = to_uv(bag)?;
    let place = bag.place("to_uv");
    fields.add("scale", numbers(place, &[to_uv.scale[0], -to_uv.scale[1]]));
    fields.add("offset", numbers(place, &[to_uv.offset[0], 1.0 - to_uv.offset[1]]));
    Ok(fields.kind("image"))
}

/// What is done to u and v: scaled, then moved.
struct ToUv {
    scale: [f64; 2],
    offset: [f64; 2],
}

fn to_uv(bag: &Bag<'_>) -> Result<ToUv, Fault> {
    let matrix = bag.transform("to_uv")?.unwrap_or(DMat4::IDENTITY);
    let [x, y, w] = [matrix.row(0), matrix.row(1), matrix.row(3)];
    if x.y != 0.0 || y.x != 0.0 || w != DVec4::W {
        return Err(bag.fault_of("to_uv", "expected scales and moves of u and v, found another transform"));
    }
    Ok(ToUv { scale: [x.x, y.y], offset: [x.w, y.w] })
}
