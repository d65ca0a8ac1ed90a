//! Emitters that are not the surface of a shape, and the emission of those that are.

use glam::{DMat3, DMat4, DVec3};

use super::super::fault::Fault;
use super::super::node::Node;
use super::object::{Bag, Family};
use super::sensors::field_of_view;
use super::spectra::Role;
use super::{FILM, Fields, Import, entry, list, matrix, number, numbers, text};

const EMITTERS: [&str; 6] = ["point", "constant", "envmap", "spot", "directional", "projector"];

/// Emitters that are a part of a shape.
const SHINING: [&str; 2] = ["area", "directionalarea"];

impl Import<'_> {
    /// Adds an emitter of the scene to `lights`.
    pub(crate) fn emitter(&mut self, index: usize) -> Result<(), Fault> {
        let bag = self.bag(index);
        let mut fields = Fields::new(bag.object.place);
        weight(&bag, &mut fields)?;
        let plugin = bag.object.plugin.as_str();
        let kind = match plugin {
            "point" => self.point(&bag, &mut fields)?,
            "constant" => self.constant(&bag, &mut fields)?,
            "envmap" => envmap(&bag, &mut fields)?,
            "spot" => self.spot(&bag, &mut fields)?,
            "directional" => self.directional(&bag, &mut fields)?,
            "projector" => self.projector(&bag, &mut fields)?,
            _ if SHINING.contains(&plugin) => return Err(bag.fault("expected a <shape> around it, found it alone")),
            _ => return Err(bag.unknown(EMITTERS.into_iter().chain(SHINING))),
        };
        bag.finish()?;
        self.lights.push(fields.kind(kind));
        Ok(())
    }

    /// The fields of a shape that shines.
    pub(crate) fn emission(&mut self, index: usize, fields: &mut Fields) -> Result<(), Fault> {
        let bag = self.bag(index);
        match bag.object.plugin.as_str() {
            "area" => {}
            "directionalarea" => fields.add("emission_direction", text(bag.object.place, "normal")),
            _ => return Err(bag.unknown(SHINING)),
        }
        weight(&bag, fields)?;
        let radiance = self.spectrum_or_texture(&bag, "radiance", Role::Emission)?;
        fields.add("emission", radiance.unwrap_or_else(|| one(&bag)));
        bag.finish()
    }

    fn point(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
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
        Ok("point")
    }

    fn constant(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
        // The same from all sides, wherever it is.
        bag.transform("to_world")?;
        let radiance = self.spectrum(bag, "radiance", Role::Emission)?.unwrap_or_else(|| one(bag));
        fields.add("radiance", radiance);
        Ok("constant")
    }

    fn spot(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
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
        if let Some(texture) = bag.object("texture", &[Family::Texture])? {
            rigid(bag, to_world)?;
            let name = self.declare_texture(texture)?;
            fields.add("texture", text(bag.place("texture"), name));
            // Their u grows along +x, to the left of who looks along the axis with +y up, and v along +y: with
            // -y up, u grows to the right and v downward.
            fields.add("up", numbers(place, &to_world.transform_vector3(-DVec3::Y).to_array()));
            fields.add("v", text(place, "down"));
        }
        Ok("spot")
    }

    fn projector(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
        let to_world = bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY);
        rigid(bag, to_world)?;
        let place = bag.place("to_world");
        fields.add("origin", numbers(place, &to_world.transform_point3(DVec3::ZERO).to_array()));
        fields.add("target", numbers(place, &to_world.transform_point3(DVec3::Z).to_array()));
        fields.add("up", numbers(place, &to_world.transform_vector3(DVec3::Y).to_array()));
        let (fov_deg, axis) = field_of_view(bag)?;
        fields.add("fov_deg", number(bag.place("fov"), fov_deg));
        fields.add("fov_axis", text(bag.place("fov_axis"), axis));
        // v = 0 is the top of the picture.
        fields.add("v", text(bag.object.place, "down"));
        let irradiance = self.spectrum_or_texture(bag, "irradiance", Role::Emission)?.unwrap_or_else(|| one(bag));
        fields.add("irradiance", irradiance);
        if let Some(scale) = bag.float("scale")? {
            fields.add("scale", number(bag.place("scale"), scale));
        }
        Ok("projector")
    }

    fn directional(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
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
        Ok("directional")
    }
}

fn envmap(bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
    let file = bag.required("filename", bag.file("filename"))?;
    fields.add("file", text(bag.place("filename"), file));
    let scale = bag.float("scale")?.unwrap_or(1.0);
    fields.add("scale", number(bag.place("scale"), scale / FILM));
    // How it is sampled.
    bag.boolean("mis_compensation")?;
    fields.add("mapping", text(bag.object.place, "mitsuba"));
    if let Some(to_world) = bag.transform("to_world")? {
        let place = bag.place("to_world");
        fields.add("transform", list(place, [entry(place, "matrix", matrix(place, to_world))]));
    }
    Ok("environment")
}

/// How often light is looked for there; 0 is never.
fn weight(bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
    if let Some(weight) = bag.float("sampling_weight")? {
        fields.add("sampling_weight", number(bag.place("sampling_weight"), weight));
    }
    Ok(())
}

/// That a transform moves and turns what throws a picture.
fn rigid(bag: &Bag<'_>, to_world: DMat4) -> Result<(), Fault> {
    let linear = DMat3::from_mat4(to_world);
    let gram = linear.transpose() * linear;
    // Numbers of six digits, as in shapes.
    let off = (gram - DMat3::IDENTITY).to_cols_array().into_iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if off <= 3e-6 && linear.determinant() > 0.0 {
        return Ok(());
    }
    Err(bag.fault_of("to_world", "expected turns and moves, found a transform that scales, shears or mirrors"))
}

/// What is not written shines like D65 of luminance 1.
fn one(bag: &Bag<'_>) -> Node {
    super::spectra::d65(bag.object.place, 1.0)
}
