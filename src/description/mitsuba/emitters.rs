//! Emitters that are not the surface of a shape, and the emission of those that are.

use glam::{DMat3, DMat4, DVec3};

use super::super::fault::Fault;
use super::super::node::{Node, quote};
use super::super::sky::SunPlace;
use super::super::transform::{is_mirror, is_similarity};
use super::daylight::in_daylight;
use super::object::{Bag, Family};
use super::parse::ABOUT_ONE;
use super::sensors::field_of_view;
use super::spectra::{Role, not_negative};
use super::{DAYLIGHT, Fields, Import, SKY_FROM_MITSUBA, boolean, entry, list, matrix, named, number, numbers, text};

const EMITTERS: [&str; 7] = ["point", "constant", "envmap", "spot", "directional", "projector", "sunsky"];

/// Emitters that are all around, of which a scene has one.
pub(super) const AROUND: [&str; 3] = ["constant", "envmap", "sunsky"];

/// Emitters that are a part of a shape.
const SHINING: [&str; 2] = ["area", "directionalarea"];

impl Import<'_> {
    /// Adds an emitter of the scene to `lights`.
    pub(crate) fn emitter(&mut self, index: usize) -> Result<(), Fault> {
        let bag = self.bag(index);
        if let Some(node) = bag.written() {
            self.lights.push(node);
            return Ok(());
        }
        let mut fields = Fields::new(bag.object.place);
        if let Some(name) = named(self.document, bag.object) {
            fields.add("name", text(bag.object.place, name));
        }
        weight(&bag, &mut fields)?;
        self.unused_medium(&bag)?;
        let plugin = bag.object.plugin.as_str();
        let kind = match plugin {
            "point" => self.point(&bag, &mut fields)?,
            "constant" => self.constant(&bag, &mut fields)?,
            "envmap" => self.envmap(&bag, &mut fields)?,
            "spot" => self.spot(&bag, &mut fields)?,
            "directional" => self.directional(&bag, &mut fields)?,
            "projector" => self.projector(&bag, &mut fields)?,
            "sunsky" => self.sunsky(&bag, &mut fields)?,
            // It stands here for a <ref> of that shape.
            _ if self.shining.contains(&index) => return Ok(()),
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
        if !self.shining.insert(index) {
            let message = "expected an emitter of its own, found one that another shape has";
            return Err(Fault::at_place(fields.place, message));
        }
        match bag.object.plugin.as_str() {
            "area" => {}
            "directionalarea" => fields.add("emission_direction", text(bag.object.place, "normal")),
            plugin if EMITTERS.contains(&plugin) => {
                let known = SHINING.join(", ");
                let message = format!("expected an emitter that a shape can be ({known}), found {}", quote(plugin));
                return Err(Fault::at_place(bag.object.plugin_place, message));
            }
            _ => return Err(bag.unknown(SHINING)),
        }
        weight(&bag, fields)?;
        self.unused_medium(&bag)?;
        let radiance = self.spectrum_or_texture(&bag, "radiance", Role::Emission)?;
        fields.add("emission", radiance.unwrap_or_else(|| one(&bag)));
        bag.finish()
    }

    /// The medium around an emitter, which has to hold: Mitsuba reads it, and looks at those of surfaces and sensors only.
    fn unused_medium(&mut self, bag: &Bag<'_>) -> Result<(), Fault> {
        if let Some(medium) = bag.only(Family::Medium)? {
            self.medium(medium)?;
        }
        Ok(())
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
        let to_world = self.round(bag, bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY))?;
        let place = bag.place("to_world");
        fields.add("position", numbers(place, &to_world.transform_point3(DVec3::ZERO).to_array()));
        fields.add("direction", numbers(place, &to_world.transform_vector3(DVec3::Z).to_array()));
        let cutoff = bag.float("cutoff_angle")?;
        if let Some(cutoff) = cutoff {
            fields.add("cutoff_deg", number(bag.place("cutoff_angle"), cutoff));
        }
        if let Some(beam) = bag.float("beam_width")? {
            // As in Mitsuba, where what is full within the beam ends at the cutoff.
            fields.add("beam_deg", number(bag.place("beam_width"), beam.min(cutoff.unwrap_or(20.0))));
        }
        let mut intensity = self.spectrum(bag, "intensity", Role::Emission)?.unwrap_or_else(|| one(bag));
        if let Some(texture) = bag.object("texture", &[Family::Texture])? {
            let (name, daylight) = self.slide(texture)?;
            if let Some(scale) = daylight {
                intensity = in_daylight(bag.object.place, &intensity, scale).ok_or_else(|| {
                    let message = "expected an intensity that is a number, a table or D65 beside a d65 of a picture, found another";
                    bag.fault_of("intensity", message)
                })?;
            }
            fields.add("texture", text(bag.place("texture"), name));
            // Their u grows along +x, to the left of who looks along the axis with +y up, and v along +y: with
            // -y up, u grows to the right and v downward.
            hang(bag, fields, to_world, -DVec3::Y);
        }
        fields.add("intensity", intensity);
        Ok("spot")
    }

    fn projector(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
        let to_world = self.rigid(bag, bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY))?;
        let place = bag.place("to_world");
        fields.add("origin", numbers(place, &to_world.transform_point3(DVec3::ZERO).to_array()));
        fields.add("target", numbers(place, &to_world.transform_point3(DVec3::Z).to_array()));
        // v = 0 is the top of the picture.
        hang(bag, fields, to_world, DVec3::Y);
        let (fov_deg, axis) = field_of_view(bag)?;
        fields.add("fov_deg", number(bag.place("fov"), fov_deg));
        fields.add("fov_axis", text(bag.place("fov_axis"), axis));
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
            (None, to_world) => {
                let along = to_world.unwrap_or(DMat4::IDENTITY).transform_vector3(DVec3::Z);
                unscaled(bag, along.length())?;
                along.into()
            }
            (Some(_), Some(_)) => {
                return Err(bag.fault_of("direction", "expected either direction or to_world, found both"));
            }
        };
        fields.add("direction", numbers(bag.place("direction"), &direction));
        let irradiance = self.spectrum(bag, "irradiance", Role::Emission)?.unwrap_or_else(|| one(bag));
        fields.add("irradiance", irradiance);
        Ok("directional")
    }

    fn sunsky(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
        let to_world = bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY);
        let linear = DMat3::from_mat4(self.rigid(bag, to_world)?);
        let given = PLACE_AND_TIME.into_iter().find(|name| bag.has(name));
        let direction = match (bag.vector("sun_direction")?, given) {
            (Some(_), Some(given)) => {
                let message = format!("expected either sun_direction or place and time, found both (also {given})");
                return Err(bag.fault_of("sun_direction", message));
            }
            (Some(direction), None) => DVec3::from(direction),
            (None, _) => linear * sun_by_place(bag)?,
        };
        let place = bag.place(given.unwrap_or("sun_direction"));
        if direction.try_normalize().is_none() {
            return Err(bag.fault_of("sun_direction", "expected a vector with a direction, found one of length zero"));
        }
        let toward = entry(place, "direction", numbers(place, &direction.to_array()));
        fields.add("sun", toward);
        for (from, to, [least, most], what) in [
            ("turbidity", "turbidity", [1.0, 10.0], "a number from 1 to 10"),
            ("sky_scale", "sky_scale", [0.0, f64::INFINITY], "a number of 0 or more"),
            ("sun_scale", "sun_scale", [0.0, f64::INFINITY], "a number of 0 or more"),
            ("sun_aperture", "sun_angle_deg", [1e-4, 90.0], "an angle from 0.0001 to 90 degrees"),
        ] {
            if let Some(value) = bag.float(from)? {
                if !(least..=most).contains(&value) {
                    return Err(bag.fault_of(from, format!("expected {what}, found {value}")));
                }
                fields.add(to, number(bag.place(from), value));
            }
        }
        if let Some(albedo) = self.spectrum(bag, "albedo", Role::Reflectance)? {
            fields.add("albedo", albedo);
        }
        if let Some(complex) = bag.boolean("complex_sun")? {
            fields.add("limb_darkening", boolean(bag.place("complex_sun"), complex));
        }
        let place = bag.place("to_world");
        let frame = DMat4::from_mat3(linear * SKY_FROM_MITSUBA.transpose());
        fields.add("transform", list(place, [entry(place, "matrix", matrix(place, frame))]));
        Ok("sky")
    }

    fn envmap(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<&'static str, Fault> {
        let file = bag.required("filename", bag.file("filename"))?;
        fields.add("file", text(bag.place("filename"), file));
        let scale = bag.float("scale")?.unwrap_or(1.0);
        not_negative(bag, "scale", &[scale])?;
        fields.add("scale", number(bag.place("scale"), scale * DAYLIGHT));
        // How it is sampled.
        bag.boolean("mis_compensation")?;
        fields.add("mapping", text(bag.object.place, "mitsuba"));
        if let Some(to_world) = bag.transform("to_world")? {
            let place = bag.place("to_world");
            let linear = DMat3::from_mat4(to_world);
            let to_world = if is_similarity(linear) {
                unscaled(bag, linear.x_axis.length())?;
                to_world
            } else {
                // Other transforms are refused where they are read.
                self.turned(bag, to_world, 1.0).unwrap_or(to_world)
            };
            fields.add("transform", list(place, [entry(place, "matrix", matrix(place, to_world))]));
        }
        Ok("environment")
    }

    /// A transform that leaves a cone round, and its angle what it is.
    fn round(&mut self, bag: &Bag<'_>, to_world: DMat4) -> Result<DMat4, Fault> {
        let linear = DMat3::from_mat4(to_world);
        if is_similarity(linear) {
            return Ok(to_world);
        }
        let message = "expected turns, moves, mirrors and even scaling, found another transform";
        let scale = libm::cbrt(linear.determinant().abs());
        self.turned(bag, to_world, scale).ok_or_else(|| bag.fault_of("to_world", message))
    }

    /// A transform that only moves, turns and mirrors what throws a picture: Mitsuba lets light on what is diffuse grow with a
    /// scale, as that from infinity.
    fn rigid(&mut self, bag: &Bag<'_>, to_world: DMat4) -> Result<DMat4, Fault> {
        let linear = DMat3::from_mat4(to_world);
        let gram = linear.transpose() * linear;
        // Numbers of six digits, as in shapes.
        let off = (gram - DMat3::IDENTITY).to_cols_array().into_iter().fold(0.0f64, |most, x| most.max(x.abs()));
        if off <= 3e-6 {
            return Ok(to_world);
        }
        let message = "expected turns, moves and mirrors, found a transform that scales or shears";
        self.turned(bag, to_world, 1.0).ok_or_else(|| bag.fault_of("to_world", message))
    }
}

/// What tells where the sun stands, besides its direction.
const PLACE_AND_TIME: [&str; 9] =
    ["latitude", "longitude", "timezone", "year", "month", "day", "hour", "minute", "second"];

/// Toward the sun at a place and time, in Mitsuba's frame of the sky. There the sun of noon on the northern half of the Earth
/// stands at +x and that of the morning at −y.
fn sun_by_place(bag: &Bag<'_>) -> Result<DVec3, Fault> {
    let whole = |name: &'static str, or: u32, most: u32| -> Result<u32, Fault> {
        let Some(value) = bag.integer(name)? else { return Ok(or) };
        match u32::try_from(value).ok().filter(|value| (1..=most).contains(value)) {
            Some(value) => Ok(value),
            None => Err(bag.fault_of(name, format!("expected a whole number from 1 to {most}, found {value}"))),
        }
    };
    let real = |name: &'static str, or: f64, most: f64| -> Result<f64, Fault> {
        let value = bag.float(name)?.unwrap_or(or);
        match value.abs() <= most {
            true => Ok(value),
            false => Err(bag.fault_of(name, format!("expected a number from -{most} to {most}, found {value}"))),
        }
    };
    let place = SunPlace {
        latitude_deg: real("latitude", 35.6894, 90.0)?,
        longitude_deg: real("longitude", 139.6917, 360.0)?,
        utc_offset: real("timezone", 9.0, 24.0)?,
        year: whole("year", 2010, 2100)?,
        month: whole("month", 7, 12)?,
        day: whole("day", 10, 31)?,
        hour: real("hour", 15.0, 1e6)? + (real("minute", 0.0, 1e6)? + real("second", 0.0, 1e6)? / 60.0) / 60.0,
    };
    let [elevation, azimuth] = place.angles();
    let ((up, level), (sin, cos)) = (libm::sincos(elevation), libm::sincos(azimuth));
    Ok(DVec3::new(-level * cos, -level * sin, up))
}

/// How often light is looked for there; 0 is never.
fn weight(bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
    if let Some(weight) = bag.float("sampling_weight")? {
        fields.add("sampling_weight", number(bag.place("sampling_weight"), weight));
    }
    Ok(())
}

/// That a transform which makes `length` of 1 leaves directions as long as they are. Mitsuba takes what it gets for a unit
/// vector: parallel light on what is diffuse grows with the length, on other things in other ways, and skies are bent.
fn unscaled(bag: &Bag<'_>, length: f64) -> Result<(), Fault> {
    if (length - 1.0).abs() <= ABOUT_ONE {
        return Ok(());
    }
    let message =
        format!("expected a transform without scaling of a light from infinity, found a scale of {length:.6}");
    Err(bag.fault_of("to_world", message))
}

/// Enters where a picture has its top, along `up` and with v downward; in a mirror u grows to the other side, as it does upside down.
fn hang(bag: &Bag<'_>, fields: &mut Fields, to_world: DMat4, up: DVec3) {
    let place = bag.place("to_world");
    let (up, v) = if is_mirror(to_world) { (-up, "up") } else { (up, "down") };
    fields.add("up", numbers(place, &to_world.transform_vector3(up).to_array()));
    fields.add("v", text(place, v));
}

/// What is not written shines like D65 of luminance 1.
fn one(bag: &Bag<'_>) -> Node {
    super::daylight::d65(bag.object.place, 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::super::{
        EmissionDirection, EnvironmentMapping, Growth, Light, Spectrum, SpectrumOrTexture, Texture,
    };
    use super::super::spectra::at;
    use super::super::tests::{fault, good};
    use super::*;

    #[test]
    fn a_slide_stands_as_mitsuba_has_it() {
        // Along +z from (1, 2, 3) with +y up.
        let place = "<transform name=\"to_world\"><translate x=\"1\" y=\"2\" z=\"3\"/></transform>\
                     <texture type=\"bitmap\" name=\"NAME\"><string name=\"filename\" value=\"a.png\"/></texture>";
        let spot = format!("<emitter type=\"spot\">{}</emitter>", place.replace("NAME", "texture"));
        let projector = format!(
            "<emitter type=\"projector\"><float name=\"fov\" value=\"30\"/>{}</emitter>",
            place.replace("NAME", "irradiance")
        );
        let scene = good(&(spot + &projector));
        let Light::Spot(spot) = &scene.lights[0] else { panic!("a spot") };
        assert_eq!((spot.up, spot.v, spot.axis()), (Some([0.0, -1.0, 0.0]), Growth::Down, DVec3::Z));
        let Light::Projector(projector) = &scene.lights[1] else { panic!("a projector") };
        assert_eq!((projector.up, projector.v, projector.fov_deg), ([0.0, 1.0, 0.0], Growth::Down, 30.0));
        assert_eq!((projector.origin, projector.target), ([1.0, 2.0, 3.0], [1.0, 2.0, 4.0]));
    }

    /// Where Mitsuba 3.9.1 has the sun (`sun_direction` of its `sunsky`), in f32, whose hours since 2000 are 1e5 with steps of
    /// 0.008: some 0.1 degrees.
    #[test]
    fn the_sun_stands_where_mitsuba_has_it() {
        let sun = |fields: &str| {
            let scene = good(&format!("<emitter type=\"sunsky\">{fields}</emitter>"));
            let Light::Sky(sky) = &scene.lights[0] else { panic!("a sky") };
            let world_from_sky = sky.world_from_sky();
            assert!((world_from_sky * DVec3::Y - DVec3::Z).length() < 1e-15);
            world_from_sky * sky.sun.in_sky(world_from_sky)
        };
        let near = |found: DVec3, x: f64, y: f64, z: f64| {
            assert!((found - DVec3::new(x, y, z)).length() < 2e-3, "{found}");
        };
        near(sun(""), 0.0513854, 0.691748, 0.720308);
        let fields = [("latitude", 51.5), ("longitude", -0.1), ("timezone", 1.0), ("hour", 9.0), ("minute", 30.0)];
        let fields = fields.map(|(name, x)| format!("<float name=\"{name}\" value=\"{x}\"/>")).concat();
        let date = [("year", 2003), ("month", 2), ("day", 28)];
        let date = date.map(|(name, x)| format!("<integer name=\"{name}\" value=\"{x}\"/>")).concat();
        near(sun(&(fields + &date + "<float name=\"second\" value=\"15\"/>")), 0.524434, -0.817841, 0.236864);
    }

    #[test]
    fn a_sun_is_told_once_and_within_its_limits() {
        let told = |fields: &str| fault(&format!("<emitter type=\"sunsky\">{fields}</emitter>"), &[]);
        let direction = "<vector name=\"sun_direction\" value=\"0, 0, 1\"/>";
        let both = told(&format!("{direction}<float name=\"hour\" value=\"3\"/>"));
        assert!(both.ends_with("expected either sun_direction or place and time, found both (also hour)"), "{both}");
        let hazy = told("<float name=\"turbidity\" value=\"11\"/>");
        assert!(hazy.ends_with("expected a number from 1 to 10, found 11"), "{hazy}");
        let month = told("<integer name=\"month\" value=\"13\"/>");
        assert!(month.ends_with("expected a whole number from 1 to 12, found 13"), "{month}");
        let two = fault(&"<emitter type=\"sunsky\"/>".repeat(2), &[]);
        assert!(two.ends_with("expected one environment, found another"), "{two}");
    }

    /// What grows to the left with +y up grows to the right in a mirror, and with -y up; a scale leaves the directions of a spot.
    #[test]
    fn a_slide_in_a_mirror_has_its_left_on_the_right() {
        let slide = |plugin: &str, texture: &str, transform: &str| {
            format!(
                "<emitter type=\"{plugin}\"><transform name=\"to_world\">{transform}</transform>\
                     <texture type=\"bitmap\" name=\"{texture}\"><string name=\"filename\" value=\"a.png\"/></texture></emitter>"
            )
        };
        let spot = slide("spot", "texture", "<scale x=\"-2\" y=\"2\" z=\"2\"/>");
        let projector = slide("projector", "irradiance", "<scale y=\"-1\"/>");
        let scene = good(&(spot + &projector));
        let Light::Spot(spot) = &scene.lights[0] else { panic!("a spot") };
        assert_eq!((spot.up, spot.v, spot.axis()), (Some([0.0, 2.0, 0.0]), Growth::Up, 2.0 * DVec3::Z));
        let Light::Projector(projector) = &scene.lights[1] else { panic!("a projector") };
        assert_eq!((projector.up, projector.v, projector.target), ([0.0, 1.0, 0.0], Growth::Up, [0.0, 0.0, 1.0]));
        let told = fault(&slide("projector", "irradiance", "<scale value=\"2\"/>"), &[]);
        assert!(told.ends_with("expected turns, moves and mirrors, found a transform that scales or shears"), "{told}");
    }

    /// Mitsuba throws an ellipse where a cone is scaled unevenly, and the same circle where evenly.
    #[test]
    fn the_cone_of_a_spot_stays_round() {
        let spot = |transform: &str| {
            format!("<emitter type=\"spot\"><transform name=\"to_world\">{transform}</transform></emitter>")
        };
        let even = "<scale value=\"2\"/><scale x=\"-1\"/><rotate x=\"1\" angle=\"30\"/><translate x=\"7\"/>";
        let scene = good(&spot(even));
        let Light::Spot(light) = &scene.lights[0] else { panic!("a spot") };
        assert_eq!(light.position, [7.0, 0.0, 0.0]);
        // A beam that is wider than the light ends with it.
        let float = |name: &str, value: u32| format!("<float name=\"{name}\" value=\"{value}\"/>");
        let wide = |more: String| good(&spot("").replace("</emitter>", &format!("{more}</emitter>")));
        for (scene, angle) in
            [(wide(float("cutoff_angle", 12) + &float("beam_width", 30)), 12.0), (wide(float("beam_width", 30)), 20.0)]
        {
            let Light::Spot(light) = &scene.lights[0] else { panic!("a spot") };
            assert_eq!((light.beam_deg, light.cutoff_deg), (angle, angle));
        }
        for uneven in
            ["<scale x=\"3\"/>", "<scale z=\"2\"/>", "<matrix value=\"1 0.1 0 0 1 0 0 0 1\"/>", "<scale value=\"0\"/>"]
        {
            let told = fault(&spot(uneven), &[]);
            let expected = "to_world: expected turns, moves, mirrors and even scaling, found another transform";
            assert!(told.ends_with(expected), "{told}");
        }
    }

    #[test]
    fn pictures_shine_as_they_are_and_within_d65_as_daylight() {
        let bitmap = "<texture type=\"bitmap\" name=\"NAME\"><string name=\"filename\" value=\"a.png\"/></texture>";
        let plain = bitmap.replace("NAME", "radiance");
        let lit = format!(
            "<spectrum type=\"d65\" name=\"radiance\"><float name=\"scale\" value=\"3\"/>{}</spectrum>",
            bitmap.replace("NAME", "picture")
        );
        for (radiance, name, scale) in [(plain, "E", 1.0), (lit, "D65", 3.0 * DAYLIGHT)] {
            let scene = good(&format!("<shape type=\"sphere\"><emitter type=\"area\">{radiance}</emitter></shape>"));
            let Some(SpectrumOrTexture::Texture(texture)) = &scene.shapes[0].emission else { panic!("a texture") };
            let Texture::Image(image) = &scene.textures[texture] else { panic!("an image") };
            let illuminant = image.illuminant.clone().unwrap();
            assert_eq!((illuminant.name.as_str(), illuminant.scale), (name, scale));
        }
    }

    /// Where the same D65 is around the picture of a spot and its intensity is 2, Mitsuba 3.9.1 shows the light of `<float>` 2.
    #[test]
    fn d65_about_the_picture_of_a_spot_is_that_of_its_intensity() {
        let bitmap = "<texture type=\"bitmap\"><string name=\"filename\" value=\"a.png\"/></texture>";
        let spot = |intensity: &str| {
            let lit = format!(
                "<spectrum type=\"d65\" name=\"texture\"><float name=\"scale\" value=\"3\"/>{bitmap}</spectrum>"
            );
            good(&format!("<emitter type=\"spot\">{intensity}{lit}</emitter>"))
        };
        for (intensity, power) in [("<spectrum name=\"intensity\" value=\"2\"/>", 1), ("", 2)] {
            let scene = spot(intensity);
            let Light::Spot(spot) = &scene.lights[0] else { panic!("a spot") };
            let Texture::Image(image) = &scene.textures[spot.texture.as_ref().unwrap()] else { panic!("an image") };
            assert_ne!(image.illuminant.as_ref().unwrap().name, "D65");
            let Spectrum::Table(table) = &spot.intensity else { panic!("a table: {:?}", spot.intensity) };
            let daylight = crate::spectrum::illuminant::d65().scaled(DAYLIGHT);
            for (nm, value) in table.iter().filter(|row| row[0].fract() == 0.0).map(|row| (row[0], row[1])) {
                let daylight = at(&daylight, nm);
                let expected = if power == 1 { 2.0 * 3.0 * daylight } else { 3.0 * daylight * daylight };
                assert!((value - expected).abs() <= 1e-5 * expected, "{nm} {value} {expected}");
            }
        }
        let colour = "<rgb name=\"intensity\" value=\"1, 0, 0\"/>";
        let lit = format!("<spectrum type=\"d65\" name=\"texture\">{bitmap}</spectrum>");
        let told = fault(&format!("<emitter type=\"spot\">{colour}{lit}</emitter>"), &[]);
        assert!(
            told.ends_with(
                "expected an intensity that is a number, a table or D65 beside a d65 of a picture, found another"
            ),
            "{told}"
        );
    }

    #[test]
    fn environments_turn_and_are_mapped_with_rows_at_the_poles() {
        let map = |transform: &str| {
            format!(
                "<emitter type=\"envmap\"><string name=\"filename\" value=\"a.exr\"/>\
                     <float name=\"sampling_weight\" value=\"0\"/><transform name=\"to_world\">{transform}</transform></emitter>"
            )
        };
        let scene = good(&map("<rotate x=\"1\" angle=\"90\"/><translate x=\"7\"/>"));
        let Light::Environment(light) = &scene.lights[0] else { panic!("an environment") };
        assert_eq!((light.mapping, light.sampling_weight), (EnvironmentMapping::Mitsuba, 0.0));
        assert!((light.world_from_map() * DVec3::Y - DVec3::Z).length() < 1e-15);
        assert!(fault(&map("<scale x=\"2\"/>"), &[]).contains("expected turns, mirrors and even scaling"));
    }

    /// A scale of three in Mitsuba 3.9.1 makes the light on a diffuse ball 3.00 times as bright, that on one of rough metal
    /// 1.11 times (alpha 0.3).
    #[test]
    fn lights_from_infinity_are_not_scaled() {
        let scaled = |plugin: &str, scale: &str| {
            let file = if plugin == "envmap" { "<string name=\"filename\" value=\"a.exr\"/>" } else { "" };
            let transform = format!(
                "<transform name=\"to_world\"><rotate y=\"1\" angle=\"30\"/><scale value=\"{scale}\"/></transform>"
            );
            fault(&format!("<emitter type=\"{plugin}\">{file}{transform}</emitter>"), &[])
        };
        for plugin in ["directional", "envmap"] {
            assert_eq!(scaled(plugin, "1.0004"), "none");
            assert!(scaled(plugin, "3").ends_with("found a scale of 3.000000"), "{}", scaled(plugin, "3"));
        }
    }

    /// Mitsuba 3.9.1 gives the bits of the scene without the medium, and of that with the emitter in its place.
    #[test]
    fn emitters_may_name_a_medium_and_be_named_by_a_shape() {
        let fog = "<medium type=\"homogeneous\" id=\"fog\"/>";
        let around = "<emitter type=\"point\" id=\"key\"><ref name=\"medium\" id=\"fog\"/></emitter>";
        let scene = good(&format!(
            "{fog}{around}<emitter type=\"area\" id=\"e\"/><shape type=\"disk\"><ref id=\"e\"/></shape>"
        ));
        let Light::Point(light) = &scene.lights[0] else { panic!("a point") };
        assert_eq!((light.name.as_deref(), scene.lights.len()), (Some("key"), 1));
        assert!(scene.shapes[0].emission.is_some());
        let bad = "<emitter type=\"point\"><medium type=\"homogenous\"/></emitter>";
        assert!(fault(bad, &[]).contains("expected a medium that Abbe has"), "{}", fault(bad, &[]));
    }

    #[test]
    fn what_a_shape_sends_out_goes_all_over_or_along_its_normals() {
        let shape = |kind: &str| format!("<shape type=\"disk\"><emitter type=\"{kind}\"/></shape>");
        let scene = good(&(shape("area") + &shape("directionalarea")));
        assert_eq!(scene.shapes[0].emission_direction, None);
        assert_eq!(scene.shapes[1].emission_direction, Some(EmissionDirection::Normal));
        let told = fault(&shape("point"), &[]);
        assert!(
            told.ends_with("expected an emitter that a shape can be (area, directionalarea), found \"point\""),
            "{told}"
        );
        assert!(fault(&shape("aera"), &[]).contains("expected an emitter that Abbe has (area, directionalarea)"));
        assert!(fault("<emitter type=\"area\"/>", &[]).contains("expected a <shape> around it, found it alone"));
    }
}
