//! Materials.

use super::super::fault::Fault;
use super::super::node::{Node, Place};
use super::object::Bag;
use super::spectra::Role;
use super::{Fields, Import, boolean, number, text};

const BSDFS: [&str; 18] = [
    "diffuse",
    "dielectric",
    "thindielectric",
    "roughdielectric",
    "dispersivedielectric",
    "conductor",
    "roughconductor",
    "plastic",
    "roughplastic",
    "principled",
    "principledthin",
    "hair",
    "null",
    "twosided",
    "mask",
    "blendbsdf",
    "bumpmap",
    "normalmap",
];

/// On which sides a surface reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sides {
    /// Only where its normal points.
    Front,
    /// Inside a `twosided`.
    Both,
}

impl Import<'_> {
    /// A material as it stands at a shape: the name of an entry of `materials`, or, where it has
    /// no id, written in place.
    pub(crate) fn material(&mut self, index: usize) -> Result<Node, Fault> {
        let object = &self.document.objects[index];
        if let Some(name) = self.names.get(&index) {
            return Ok(text(object.place, name));
        }
        let node = self.bsdf(index, Sides::Front)?;
        if object.id.is_none() {
            return Ok(node);
        }
        let name = self.name_for(index);
        self.materials.push(self.entry(index, &name, node));
        Ok(text(object.place, name))
    }

    /// A diffuse surface, the same everywhere, one-sided: what a shape without a `<bsdf>` has.
    pub(crate) fn plain_diffuse(&self, place: Place, reflectance: f64) -> Node {
        let mut fields = Fields::new(place);
        fields.add("reflectance", number(place, reflectance));
        fields.add("two_sided", boolean(place, false));
        fields.kind("diffuse")
    }

    pub(crate) fn bsdf(&mut self, index: usize, sides: Sides) -> Result<Node, Fault> {
        let bag = self.bag(index);
        if let Some(node) = bag.written() {
            return Ok(node);
        }
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        let two_sided = boolean(place, sides == Sides::Both);
        let kind = match bag.object.plugin.as_str() {
            "diffuse" => {
                fields.maybe("reflectance", self.spectrum_or_texture(&bag, "reflectance", Role::Reflectance)?);
                fields.add("two_sided", two_sided);
                "diffuse"
            }
            "dielectric" | "dispersivedielectric" | "roughdielectric" => {
                fields.add("ior", self.index(&bag, "int_ior", "bk7")?.node);
                fields.add("exterior_ior", self.index(&bag, "ext_ior", "air")?.node);
                if bag.object.plugin == "roughdielectric" {
                    self.roughness(&bag, &mut fields)?;
                }
                self.tints(&bag, &mut fields)?;
                transparent(&bag, sides)?;
                "dielectric"
            }
            "thindielectric" => {
                fields.add("ior", self.index(&bag, "int_ior", "bk7")?.node);
                fields.add("exterior_ior", self.index(&bag, "ext_ior", "air")?.node);
                self.tints(&bag, &mut fields)?;
                transparent(&bag, sides)?;
                "thin_dielectric"
            }
            "conductor" | "roughconductor" => {
                let metal = bag.text("material")?.unwrap_or("none");
                if metal != "none" && (bag.has("eta") || bag.has("k")) {
                    return Err(bag.fault_of("material", "expected either material, or eta and k, found both"));
                }
                if bag.has("eta") || bag.has("k") || metal == "none" {
                    let (eta, k) =
                        (self.spectrum(&bag, "eta", Role::Coefficient)?, self.spectrum(&bag, "k", Role::Coefficient)?);
                    fields.add("eta", eta.unwrap_or_else(|| number(place, 0.0)));
                    fields.add("k", k.unwrap_or_else(|| number(place, 1.0)));
                } else {
                    super::metals::metal(&bag, metal, &mut fields)?;
                }
                fields.maybe("tint", self.spectrum_or_texture(&bag, "specular_reflectance", Role::Reflectance)?);
                if bag.object.plugin == "roughconductor" {
                    self.roughness(&bag, &mut fields)?;
                }
                fields.add("two_sided", two_sided);
                "conductor"
            }
            "plastic" | "roughplastic" => {
                let reflectance = self.spectrum_or_texture(&bag, "diffuse_reflectance", Role::Reflectance)?;
                fields.maybe("reflectance", reflectance);
                fields.maybe("tint", self.spectrum_or_texture(&bag, "specular_reflectance", Role::Reflectance)?);
                let (inside, outside) =
                    (self.index(&bag, "int_ior", "polypropylene")?, self.index(&bag, "ext_ior", "air")?);
                // As one number, relative to what surrounds it, where it is one; not below 1, which would be told as no index of anything.
                match (inside.number, outside.number) {
                    (Some(inside), Some(outside)) if inside >= outside => {
                        fields.add("ior", number(bag.place("int_ior"), inside / outside));
                    }
                    _ => {
                        fields.add("ior", inside.node);
                        fields.add("exterior_ior", outside.node);
                    }
                }
                fields.maybe("nonlinear", bag.boolean("nonlinear")?.map(|on| boolean(bag.place("nonlinear"), on)));
                if bag.object.plugin == "roughplastic" {
                    fields.add("diffuse_mean", text(place, "nodes"));
                    self.roughness(&bag, &mut fields)?;
                }
                fields.add("two_sided", two_sided);
                "plastic"
            }
            "null" => "boundary",
            "principled" => return self.principled(&bag, sides),
            "hair" => return self.hair(&bag, sides),
            "principledthin" => return self.principled_thin(&bag, sides),
            "twosided" => return self.twosided(&bag),
            "mask" => return self.mask(&bag),
            "blendbsdf" => return self.blended(&bag),
            "bumpmap" => return self.bump(&bag),
            "normalmap" => return self.normal_map(&bag),
            _ => return Err(bag.unknown(BSDFS)),
        };
        bag.finish()?;
        Ok(fields.kind(kind))
    }

    /// What colours an interface beside Fresnel's equations.
    fn tints(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
        for (ours, theirs) in
            [("reflection_tint", "specular_reflectance"), ("transmission_tint", "specular_transmittance")]
        {
            fields.maybe(ours, self.spectrum_or_texture(bag, theirs, Role::Reflectance)?);
        }
        Ok(())
    }
}

/// Glass has two sides of its own.
pub(super) fn transparent(bag: &Bag<'_>, sides: Sides) -> Result<(), Fault> {
    match sides {
        Sides::Front => Ok(()),
        Sides::Both => {
            let message = "expected a surface that lets no light through inside <twosided>";
            // Without it this one lets none through.
            let is_by_share = bag.object.plugin == "principled";
            Err(if is_by_share { bag.fault_of("spec_trans", message) } else { bag.fault(message) })
        }
    }
}
