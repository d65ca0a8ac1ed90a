//! Textures.

use super::super::fault::Fault;
use super::super::node::Node;
use super::object::{Bag, Family};
use super::spectra::{Role, SPECTRA};
use super::{Fields, Import, boolean, entry, list, number, numbers, text};

const TEXTURES: [&str; 4] = ["bitmap", "checkerboard", "volume", "mesh_attribute"];

impl Import<'_> {
    /// The name under which a texture stands in `textures`.
    pub(crate) fn declare_texture(&mut self, index: usize) -> Result<String, Fault> {
        if let Some(name) = self.names.get(&index) {
            return Ok(name.clone());
        }
        let bag = self.bag(index);
        if let Some(node) = bag.written() {
            let name = self.name_for(index);
            self.textures.push(self.entry(index, &name, node));
            return Ok(name);
        }
        let node = match bag.object.plugin.as_str() {
            "bitmap" => bitmap(&bag)?,
            "checkerboard" => self.checkerboard(&bag, Use::Spectra)?,
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
            plugin if SPECTRA.contains(&plugin) => {
                let known = TEXTURES.join(", ");
                return Err(
                    bag.fault(format!("expected a texture that varies over a surface ({known}), found a spectrum"))
                );
            }
            _ => return Err(bag.unknown(TEXTURES.into_iter().chain(SPECTRA))),
        };
        bag.finish()?;
        let name = self.name_for(index);
        self.textures.push(self.entry(index, &name, node));
        Ok(name)
    }

    /// The name of a texture that is asked for numbers. Mitsuba's checkerboard then has its colours the other
    /// way round, so it stands in `textures` a second time.
    pub(crate) fn declare_numbers(&mut self, index: usize, used: Use) -> Result<String, Fault> {
        let bag = self.bag(index);
        if bag.object.plugin != "checkerboard" {
            return self.declare_texture(index);
        }
        if let Some(name) = self.for_numbers.get(&(index, used)) {
            return Ok(name.clone());
        }
        let node = self.checkerboard(&bag, used)?;
        bag.finish()?;
        let plain = bag.object.id.clone().unwrap_or_else(|| format!("checkerboard {index}"));
        let name = self.made(format!("{plain} as numbers"));
        self.for_numbers.insert((index, used), name.clone());
        self.textures.push(self.entry(index, &name, node));
        Ok(name)
    }

    fn checkerboard(&mut self, bag: &Bag<'_>, used: Use) -> Result<Node, Fault> {
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        let keys = if used == Use::Spectra { ["a", "b"] } else { ["b", "a"] };
        for (ours, theirs, default) in [(keys[0], "color0", 0.4), (keys[1], "color1", 0.2)] {
            let colour = match used {
                Use::Spectra => self.spectrum_or_cell(bag, theirs, Role::Reflectance)?,
                Use::Numbers => self.number_or_texture(bag, theirs)?,
                Use::Clamped => self.least(bag, theirs)?,
            };
            fields.add(ours, colour.unwrap_or_else(|| number(place, default)));
        }
        if let Some(rows) = to_uv(bag)? {
            fields.add("uv", uv_rows(bag, rows));
        }
        Ok(fields.kind("checkerboard"))
    }
}

/// What a texture is asked for.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Use {
    Spectra,
    Numbers,
    /// Numbers of which Mitsuba takes those below 0 for 0.
    Clamped,
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
    // How it is kept in memory. Eight bits are for their RGB variants alone.
    bag.choice("format", &["auto", "variant", "fp16", "float16", "uint8"])?;
    bag.boolean("accel")?;
    // Theirs begins at the upper left corner of the file, ours at the lower left.
    let [u, v] = to_uv(bag)?.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let place = bag.place("to_uv");
    if u[1] == 0.0 && v[0] == 0.0 {
        fields.add("scale", numbers(place, &[u[0], -v[1]]));
        fields.add("offset", numbers(place, &[u[2], 1.0 - v[2]]));
    } else {
        fields.add("uv", uv_rows(bag, [u, [-v[0], -v[1], 1.0 - v[2]]]));
    }
    Ok(fields.kind("image"))
}

/// What is done to u and v: the first two rows of an affine map.
fn to_uv(bag: &Bag<'_>) -> Result<Option<[[f64; 3]; 2]>, Fault> {
    let Some(matrix) = bag.transform("to_uv")? else { return Ok(None) };
    Ok(Some([matrix.row(0), matrix.row(1)].map(|row| [row.x, row.y, row.w])))
}

fn uv_rows(bag: &Bag<'_>, rows: [[f64; 3]; 2]) -> Node {
    let place = bag.place("to_uv");
    list(place, rows.iter().map(|row| numbers(place, row)))
}
