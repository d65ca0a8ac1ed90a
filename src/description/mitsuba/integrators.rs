//! Integrators.

use super::super::fault::Fault;
use super::super::node::Node;
use super::object::{Bag, Family};
use super::{Fields, Import, boolean, whole};

const INTEGRATORS: [&str; 5] = ["path", "volpath", "volpathmis", "direct", "moment"];

impl Import<'_> {
    pub(crate) fn integrator(&mut self, index: usize) -> Result<Node, Fault> {
        let bag = self.bag(index);
        let mut fields = Fields::new(bag.object.place);
        common(&bag)?;
        match bag.object.plugin.as_str() {
            // Ours weighs by all wavelengths and all techniques as `volpathmis` does.
            "path" | "volpath" | "volpathmis" => {
                if bag.object.plugin == "volpathmis" {
                    bag.boolean("use_spectral_mis")?;
                }
                depth(&bag, &mut fields)?;
                if bag.object.plugin == "path" {
                    // Panes and null surfaces are vertices for it, unlike for the two that know media.
                    fields.add("count_crossings", boolean(bag.object.place, true));
                }
            }
            // Light that was scattered once: how many samples each technique takes is noise.
            "direct" => {
                for key in ["shading_samples", "emitter_samples", "bsdf_samples"] {
                    bag.integer(key)?;
                }
                fields.add("max_depth", whole(bag.object.place, 2));
            }
            // Our pictures carry their variance anyway; what is nested makes the picture.
            "moment" => {
                let inner = bag.only(Family::Integrator)?;
                let inner = inner.ok_or_else(|| bag.fault("expected an <integrator> inside, found none"))?;
                bag.finish()?;
                return self.integrator(inner);
            }
            _ => return Err(bag.unknown(INTEGRATORS)),
        }
        bag.finish()?;
        Ok(fields.kind("path"))
    }
}

/// What every integrator has and what says nothing about the picture.
fn common(bag: &Bag<'_>) -> Result<(), Fault> {
    bag.integer("block_size")?;
    bag.integer("samples_per_pass")?;
    bag.float("timeout")?;
    if bag.boolean("hide_emitters")? == Some(true) {
        return Err(bag.fault_of("hide_emitters", "expected false, found true, which Abbe does not have"));
    }
    Ok(())
}

fn depth(bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
    match bag.integer("max_depth")? {
        None | Some(-1) => {}
        Some(depth) => fields.add("max_depth", whole(bag.place("max_depth"), depth)),
    }
    if let Some(depth) = bag.integer("rr_depth")? {
        fields.add("roulette_depth", whole(bag.place("rr_depth"), depth));
    }
    Ok(())
}
