//! Emitters that are not the surface of a shape, and the emission of those that are.

use glam::{DMat4, DVec3};

use super::super::fault::Fault;
use super::super::node::Node;
use super::object::Bag;
use super::spectra::Role;
use super::{FILM, Fields, Import, number, numbers, text};

const EMITTERS: [&str; 5] = ["point", "constant", "envmap", "spot", "directional"];

impl Import<'_> {
    /// Adds an emitter of the scene to `lights`.
    pub(crate) fn emitter(&mut self, index: usize) -> Result<(), Fault> {
        let bag = self.bag(index);
        // How often it is chosen, not how bright it is.
        bag.float("sampling_weight")?;
        let light = match bag.object.plugin.as_str() {
            "point" => self.point(&bag)?,
            "constant" => self.constant(&bag)?,
            "envmap" => envmap(&bag)?,
            "spot" => self.spot(&bag)?,
            "directional" => self.directional(&bag)?,
            "area" => return Err(bag.fault("expected a <shape> around it, found it alone")),
            _ => return Err(bag.unknown(EMITTERS.into_iter().chain(["area"]))),
        };
        bag.finish()?;
        self.lights.push(light);
        Ok(())
    }

    /// The field `emission` of a shape.
    pub(crate) fn area(&mut self, index: usize) -> Result<Node, Fault> {
        let bag = self.bag(index);
        if bag.object.plugin != "area" {
            return Err(bag.unknown(["area"]));
        }
        bag.float("sampling_weight")?;
        let radiance = self.spectrum_or_texture(&bag, "radiance", Role::Emission)?;
        bag.finish()?;
        Ok(radiance.unwrap_or_else(|| one(&bag)))
    }

    fn point(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let mut fields = Fields::new(bag.object.place);
        let position = match (bag.vector("position")?, bag.transform("to_world")?) {
            (Some(position), None) => position,
            (None, to_world) => to_world.unwrap_or(DMat4::IDENTITY).transform_point3(DVec3::ZERO).into(),
            (Some(_), Some(_)) => {
                return Err(bag.fault_of("position", "expected either position or to_world, found both"));
            }
        };
        fields.add("position", numbers(bag.place("position"), &position));
        let intensity = self.spectrum(bag, "intensity", Role::Emission)?.unwrap_or_else(|| one(bag));
        fields.add("intensity", intensity);
        Ok(fields.kind("point"))
    }

    fn constant(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let mut fields = Fields::new(bag.object.place);
        // The same from all sides, wherever it is.
        bag.transform("to_world")?;
        let radiance = self.spectrum(bag, "radiance", Role::Emission)?.unwrap_or_else(|| one(bag));
        fields.add("radiance", radiance);
        Ok(fields.kind("constant"))
    }

    fn spot(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let mut fields = Fields::new(bag.object.place);
        let to_world = bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY);
        let place = bag.place("to_world");
        fields.add("position", numbers(place, &to_world.transform_point3(DVec3::ZERO).to_array()));
        fields.add("direction", numbers(place, &to_world.transform_vector3(DVec3::Z).to_array()));
        if let Some(cutoff) = bag.float("cutoff_angle")? {
            fields.add("cutoff_deg", number(bag.place("cutoff_angle"), cutoff));
        }
        if let Some(beam) = bag.float("beam_width")? {
            fields.add("beam_deg", number(bag.place("beam_width"), beam));
        }
        let intensity = self.spectrum(bag, "intensity", Role::Emission)?.unwrap_or_else(|| one(bag));
        fields.add("intensity", intensity);
        Ok(fields.kind("spot"))
    }

    fn directional(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let mut fields = Fields::new(bag.object.place);
        let direction = match (bag.vector("direction")?, bag.transform("to_world")?) {
            (Some(direction), None) => direction,
            (None, to_world) => to_world.unwrap_or(DMat4::IDENTITY).transform_vector3(DVec3::Z).into(),
            (Some(_), Some(_)) => {
                return Err(bag.fault_of("direction", "expected either direction or to_world, found both"));
            }
        };
        fields.add("direction", numbers(bag.place("direction"), &direction));
        let irradiance = self.spectrum(bag, "irradiance", Role::Emission)?.unwrap_or_else(|| one(bag));
        fields.add("irradiance", irradiance);
        Ok(fields.kind("directional"))
    }
}

fn envmap(bag: &Bag<'_>) -> Result<Node, Fault> {
    let mut fields = Fields::new(bag.object.place);
    let file = bag.required("filename", bag.file("filename"))?;
    fields.add("file", text(bag.place("filename"), file));
    let scale = bag.float("scale")?.unwrap_or(1.0);
    fields.add("scale", number(bag.place("scale"), scale / FILM));
    bag.boolean("mis_compensation")?;
    let to_world = bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| to_world.transform_vector3(axis));
    let [x, y, _] = axes;
    let turned = (y - DVec3::Y).length() < 1e-9 && (x.length() - 1.0).abs() < 1e-9;
    if !turned {
        return Err(bag.fault_of("to_world", "expected a turn about y, found another transform"));
    }
    let degrees = libm::atan2(-x.z, x.x).to_degrees();
    fields.add("rotate_deg", number(bag.place("to_world"), degrees));
    Ok(fields.kind("environment"))
}

/// What is not written shines like D65 of luminance 1.
fn one(bag: &Bag<'_>) -> Node {
    super::spectra::d65(bag.object.place, 1.0)
}
