//! Media and phase functions.

use super::super::fault::Fault;
use super::super::node::Node;
use super::object::{Bag, Family};
use super::spectra::Role;
use super::{Fields, Import, entry, number, text};

const MEDIA: [&str; 1] = ["homogeneous"];
const PHASES: [&str; 3] = ["isotropic", "hg", "rayleigh"];

impl Import<'_> {
    /// The name under which a medium stands in `media`.
    pub(crate) fn medium(&mut self, index: usize) -> Result<String, Fault> {
        if let Some(name) = self.names.get(&index) {
            return Ok(name.clone());
        }
        let bag = self.bag(index);
        let node = match bag.object.plugin.as_str() {
            "homogeneous" => self.homogeneous(&bag)?,
            _ => return Err(bag.unknown(MEDIA)),
        };
        bag.finish()?;
        let name = self.name_for(index);
        self.media.push(self.entry(index, &name, node));
        Ok(name)
    }

    fn homogeneous(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        let extinction = self.spectrum(bag, "sigma_t", Role::Coefficient)?.unwrap_or_else(|| number(place, 1.0));
        let albedo = self.spectrum(bag, "albedo", Role::Reflectance)?.unwrap_or_else(|| number(place, 0.75));
        fields.add("extinction", extinction);
        fields.add("albedo", albedo);
        if let Some(scale) = bag.float("scale")? {
            fields.add("scale", number(bag.place("scale"), scale));
        }
        // How light is looked for, not what there is.
        bag.boolean("has_spectral_extinction")?;
        bag.boolean("sample_emitters")?;
        if let Some(phase) = bag.only(Family::Phase)? {
            fields.add("phase", self.phase(phase)?);
        }
        Ok(fields.kind("homogeneous"))
    }

    /// A phase function, written in place.
    pub(crate) fn phase(&mut self, index: usize) -> Result<Node, Fault> {
        let bag = self.bag(index);
        let place = bag.object.place;
        let node = match bag.object.plugin.as_str() {
            "isotropic" => text(place, "isotropic"),
            "rayleigh" => text(place, "rayleigh"),
            "hg" => {
                let g = bag.float("g")?.unwrap_or(0.8);
                entry(place, "hg", number(bag.place("g"), g))
            }
            _ => return Err(bag.unknown(PHASES)),
        };
        bag.finish()?;
        Ok(node)
    }
}
