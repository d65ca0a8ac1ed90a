//! Spectra.

use std::collections::HashSet;

use super::super::fault::Fault;
use super::super::node::{Node, Place};
use super::daylight::d65;
use super::object::{Bag, Family, SpectrumValue, Value};
use super::parse;
use super::{DAYLIGHT, Fields, Import, boolean, entry, list, number, numbers, text};
use crate::spectrum::{BAND_NM, Lanes, Outside, Spectrum as Curve, illuminant, upsample};

/// What a spectrum stands for, which decides what a colour or a bare number means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Role {
    /// From 0 to 1.
    Reflectance,
    /// Radiance, intensity, irradiance: colours are seen under D65.
    Emission,
    /// σ, η, k: any number of 0 or more.
    Coefficient,
}

impl Import<'_> {
    /// The spectrum of a property; `None` where it is not written. Textures are refused.
    pub(crate) fn spectrum(&mut self, bag: &Bag<'_>, name: &'static str, role: Role) -> Result<Option<Node>, Fault> {
        let Some(value) = bag.value(name) else { return Ok(None) };
        self.spectrum_of(bag, name, value, role)
    }

    /// The spectrum that is the value of the property `name`.
    pub(crate) fn spectrum_of(
        &mut self,
        bag: &Bag<'_>,
        name: &str,
        value: &Value,
        role: Role,
    ) -> Result<Option<Node>, Fault> {
        let place = bag.place(name);
        match value {
            Value::Float(value) => grey(bag, name, *value, role).map(Some),
            Value::Integer(value) => grey(bag, name, *value as f64, role).map(Some),
            Value::Rgb(rgb) => {
                if role == Role::Emission {
                    not_negative(bag, name, rgb)?;
                }
                Ok(Some(colour(place, self.coefficients(place, name, *rgb), role)))
            }
            Value::Spectrum(SpectrumValue::Uniform(value)) => Ok(Some(number(place, *value))),
            Value::Spectrum(SpectrumValue::Table(pairs)) => Ok(Some(self.written_table(place, pairs))),
            Value::Spectrum(SpectrumValue::File(path)) => Ok(Some(file(place, path))),
            Value::Object(index) if bag.document.objects[*index].family == Family::Texture => {
                match self.spectrum_plugin(*index, role)? {
                    Some(node) => Ok(Some(node)),
                    None => {
                        let found = value.kind(bag.document);
                        Err(bag.fault_of(name, format!("expected the same spectrum everywhere, found {found}")))
                    }
                }
            }
            other => {
                let found = other.kind(bag.document);
                Err(bag.fault_of(name, format!("expected a spectrum, a colour or a float, found {found}")))
            }
        }
    }

    /// The colour `rgb` of `name`. Of metals and of what hair absorbs such numbers are told where Mitsuba makes others of them.
    fn coefficients(&mut self, place: Place, name: &str, rgb: [f64; 3]) -> [f64; 3] {
        if !["eta", "k", "sigma_a"].contains(&name) {
            return rgb;
        }
        let taken = if name == "sigma_a" { rgb } else { rgb.map(|x| x.max(0.0)) };
        if taken != rgb {
            self.notes.push((place, format!("{name}: numbers below 0 of {rgb:?} are taken for 0, as in Mitsuba")));
        }
        if rgb.iter().any(|x| *x > 1.0) {
            let note = format!("{name}: numbers above 1 of {rgb:?} are what they say; Mitsuba takes 1 for them");
            self.notes.push((place, note));
        }
        taken
    }

    /// The pairs of a scene. Where no light is simulated at any of their wavelengths they are 0, and told; in µm, as it seems,
    /// they are left to be refused.
    fn written_table(&mut self, place: Place, pairs: &[[f64; 2]]) -> Node {
        let cut = from_band(pairs);
        let pairs = cut.as_deref().unwrap_or(pairs);
        let samples: Vec<(f64, f64)> = pairs.iter().map(|[nm, value]| (*nm, *value)).collect();
        let ([low, high], [first, last]) =
            (BAND_NM, [pairs.first(), pairs.last()].map(|pair| pair.map_or(0.0, |p| p[0])));
        let misses = |unit: f64| last * unit < low || first * unit > high;
        if !(misses(1.0) && misses(1e3)) || Curve::from_samples(&samples, Outside::Zero).is_err() {
            return table(place, pairs);
        }
        let message = format!(
            "a spectrum of {first} to {last} nm is taken for 0, as in Mitsuba: light is simulated from {low} to {high} nm"
        );
        self.notes.push((place, message));
        number(place, 0.0)
    }

    /// The spectrum or `{texture: name}` of a property.
    pub(crate) fn spectrum_or_texture(
        &mut self,
        bag: &Bag<'_>,
        name: &'static str,
        role: Role,
    ) -> Result<Option<Node>, Fault> {
        // The illuminant of a picture is for where it shines: on a surface it would be lost, and its scale with it.
        if role == Role::Reflectance
            && let Some(Value::Object(index)) = bag.value(name)
            && self.is_lit(*index, &mut HashSet::new())
        {
            let message =
                "expected a texture without D65, found a \"d65\" with a picture inside, which is for what shines";
            return Err(bag.fault_of(name, message));
        }
        self.spectrum_or_cell(bag, name, role)
    }

    /// The same of a square of a checkerboard, which may shine or reflect.
    pub(crate) fn spectrum_or_cell(
        &mut self,
        bag: &Bag<'_>,
        name: &'static str,
        role: Role,
    ) -> Result<Option<Node>, Fault> {
        if let Some(Value::Object(index)) = bag.value(name)
            && bag.document.objects[*index].family == Family::Texture
            && bag.document.objects[*index].plugin == "d65"
            && let Some(texture) = self.lit_texture(*index)?
        {
            let place = bag.place(name);
            return Ok(Some(entry(place, "texture", text(place, texture))));
        }
        if let Some(Value::Object(index)) = bag.value(name)
            && bag.document.objects[*index].family == Family::Texture
            && !SPECTRA.contains(&bag.document.objects[*index].plugin.as_str())
        {
            let place = bag.place(name);
            let texture = self.declare_texture(*index)?;
            return Ok(Some(entry(place, "texture", text(place, texture))));
        }
        self.spectrum(bag, name, role)
    }

    /// Declares a texture of the scene; a spectrum stands where it is used, but has to hold.
    pub(crate) fn texture_or_spectrum(&mut self, index: usize) -> Result<(), Fault> {
        let lit = self.bag(index).object.plugin == "d65" && self.lit_texture(index)?.is_some();
        if !lit && self.spectrum_plugin(index, Role::Reflectance)?.is_none() {
            self.declare_texture(index)?;
        }
        Ok(())
    }

    /// A `<spectrum type="…">`; `None` where the plugin varies over the surface.
    pub(crate) fn spectrum_plugin(&mut self, index: usize, role: Role) -> Result<Option<Node>, Fault> {
        let bag = self.bag(index);
        let place = bag.object.place;
        let node = match bag.object.plugin.as_str() {
            "rawconstant" => number(place, bag.required("value", bag.float("value"))?),
            "uniform" => {
                let value = bag.required("value", bag.float("value"))?;
                // The range is read and, as in Mitsuba, does not cut the spectrum.
                bag.float("wavelength_min")?;
                bag.float("wavelength_max")?;
                number(place, value)
            }
            "d65" => self.daylight(&bag, role)?,
            "srgb" => {
                bag.boolean("unbounded")?;
                srgb(&bag, "color", role)?
            }
            // What `<rgb>` and `<spectrum>` say, as plugins, without the D65 of what shines.
            "rgb" | "spectrum" if matches!(bag.value("value"), Some(Value::Rgb(_))) => srgb(&bag, "value", role)?,
            "rgb" | "spectrum" => {
                let plain = if role == Role::Emission { Role::Coefficient } else { role };
                bag.required("value", self.spectrum(&bag, "value", plain))?
            }
            "regular" | "irregular" if bag.has("value") => match bag.value("value") {
                Some(Value::Spectrum(SpectrumValue::Table(pairs))) => self.written_table(place, pairs),
                Some(Value::Spectrum(SpectrumValue::File(path))) => file(place, path),
                other => {
                    let found = other.map_or(String::new(), |value| value.kind(bag.document));
                    return Err(bag.fault_of("value", format!("expected wavelengths and values, found {found}")));
                }
            },
            "regular" => {
                let least = bag.required("wavelength_min", bag.float("wavelength_min"))?;
                let most = bag.required("wavelength_max", bag.float("wavelength_max"))?;
                let values = floats(&bag, "values")?;
                let step = (most - least) / (values.len().max(2) - 1) as f64;
                let pairs: Vec<[f64; 2]> =
                    values.iter().enumerate().map(|(i, value)| [least + step * i as f64, *value]).collect();
                self.written_table(place, &pairs)
            }
            "irregular" => {
                let (nm, values) = (floats(&bag, "wavelengths")?, floats(&bag, "values")?);
                if nm.len() != values.len() {
                    let message = format!("expected {} numbers, one a wavelength, found {}", nm.len(), values.len());
                    return Err(bag.fault_of("values", message));
                }
                let pairs: Vec<[f64; 2]> = nm.iter().zip(&values).map(|(nm, value)| [*nm, *value]).collect();
                self.written_table(place, &pairs)
            }
            "blackbody" => blackbody(&bag, role)?,
            _ => return Ok(None),
        };
        bag.finish()?;
        Ok(Some(node))
    }
}

/// Of a table that begins at 0 nm or less, which are no wavelengths, what is within the band and beyond.
fn from_band(pairs: &[[f64; 2]]) -> Option<Vec<[f64; 2]>> {
    let increases = pairs.is_sorted_by(|a, b| a[0] < b[0]);
    let after = pairs.iter().position(|pair| pair[0] > BAND_NM[0])?;
    if !increases || pairs[0][0] > 0.0 {
        return None;
    }
    let ([x, y], [next_x, next_y]) = (*pairs.get(after.checked_sub(1)?)?, pairs[after]);
    let begin = y + (next_y - y) * (BAND_NM[0] - x) / (next_x - x);
    Some([[BAND_NM[0], begin]].into_iter().chain(pairs[after..].iter().copied()).collect())
}

/// The curve by which a surface of the colour `name` reflects.
fn srgb(bag: &Bag<'_>, name: &'static str, role: Role) -> Result<Node, Fault> {
    let place = bag.object.place;
    let rgb = bag.required(name, bag.rgb(name))?;
    match role {
        Role::Reflectance => Ok(entry(place, "rgb", numbers(place, &rgb))),
        // What a surface of this colour reflects, also as light: there is no D65 in it.
        Role::Emission | Role::Coefficient => {
            let curve = upsample::reflectance(rgb).map_err(|message| bag.fault_of(name, message))?;
            Ok(sampled(place, BAND_NM, &curve))
        }
    }
}

/// Planck's radiance, whole or cut at two wavelengths.
fn blackbody(bag: &Bag<'_>, role: Role) -> Result<Node, Fault> {
    let place = bag.object.place;
    let kelvin = bag.required("temperature", bag.float("temperature"))?;
    let least = bag.float("wavelength_min")?.unwrap_or(BAND_NM[0]);
    let most = bag.float("wavelength_max")?.unwrap_or(BAND_NM[1]);
    if least >= most {
        let message = format!("expected more than wavelength_min, {least}, found {most}");
        return Err(bag.fault_of("wavelength_max", message));
    }
    if role == Role::Emission && least <= BAND_NM[0] && most >= BAND_NM[1] {
        let mut fields = Fields::new(place);
        fields.add("kelvin", number(place, kelvin));
        fields.add("normalised", boolean(place, false));
        Ok(fields.kind("blackbody"))
    } else {
        let curve = illuminant::blackbody(kelvin).map_err(|m| bag.fault_of("temperature", m))?;
        Ok(sampled(place, [least, most], &curve))
    }
}

/// Plugins that are a spectrum, the same everywhere.
pub(super) const SPECTRA: [&str; 9] =
    ["uniform", "rawconstant", "d65", "srgb", "rgb", "spectrum", "regular", "irregular", "blackbody"];

/// A curve at one wavelength, nm.
pub(crate) fn at(curve: &Curve, nm: f64) -> f64 {
    f64::from(curve.eval(Lanes::splat(nm as f32)).to_array()[0])
}

/// A curve between two wavelengths, nm, at each whole one, and zero outside.
pub(super) fn sampled(place: Place, ends: [f64; 2], curve: &Curve) -> Node {
    if let Curve::Constant(value) = curve
        && ends == BAND_NM
    {
        return number(place, f64::from(*value));
    }
    let [from, to] = [ends[0].max(BAND_NM[0]), ends[1].min(BAND_NM[1])];
    if from >= to {
        return number(place, 0.0);
    }
    let between = (from.floor() as i32 + 1..to.ceil() as i32).map(f64::from);
    let pairs: Vec<[f64; 2]> = [from].into_iter().chain(between).chain([to]).map(|nm| [nm, at(curve, nm)]).collect();
    table(place, &pairs)
}

/// The numbers of a string such as `"1, 2, 3"`.
fn floats(bag: &Bag<'_>, name: &'static str) -> Result<Vec<f64>, Fault> {
    let text = bag.required(name, bag.text(name))?;
    parse::tokens(text).map(|token| parse::number(token, bag.place(name))).collect()
}

fn grey(bag: &Bag<'_>, name: &str, value: f64, role: Role) -> Result<Node, Fault> {
    let place = bag.place(name);
    match role {
        Role::Emission => not_negative(bag, name, &[value]).map(|()| d65(place, value)),
        Role::Reflectance | Role::Coefficient => Ok(number(place, value)),
    }
}

/// That numbers which are multiplied before the grammar has them are 0 or more: a fault there would name others than the file.
pub(crate) fn not_negative(bag: &Bag<'_>, name: &str, numbers: &[f64]) -> Result<(), Fault> {
    match numbers.iter().find(|x| **x < 0.0) {
        Some(x) => Err(bag.fault_of(name, format!("expected a number of 0 or more, found {x}"))),
        None => Ok(()),
    }
}

pub(super) fn colour(place: Place, rgb: [f64; 3], role: Role) -> Node {
    match role {
        Role::Emission => scaled(place, DAYLIGHT, entry(place, "rgb", numbers(place, &rgb))),
        Role::Reflectance | Role::Coefficient => entry(place, "rgb", numbers(place, &rgb)),
    }
}

pub(crate) fn scaled(place: Place, by: f64, of: Node) -> Node {
    let mut fields = Fields::new(place);
    fields.add("by", number(place, by));
    fields.add("of", of);
    fields.kind("scaled")
}

pub(super) fn pairs_node(place: Place, pairs: &[[f64; 2]]) -> Node {
    list(place, pairs.iter().map(|pair| numbers(place, pair)))
}

/// A table in a file, zero outside.
fn file(place: Place, path: &str) -> Node {
    entry(place, "zero_outside", entry(place, "file", text(place, path)))
}

/// Linear between the pairs, zero outside.
pub(super) fn table(place: Place, pairs: &[[f64; 2]]) -> Node {
    let table = entry(place, "table", pairs_node(place, pairs));
    let covers = pairs.first().is_some_and(|p| p[0] <= 360.0) && pairs.last().is_some_and(|p| p[0] >= 830.0);
    if covers { table } else { entry(place, "zero_outside", table) }
}

#[cfg(test)]
mod tests {
    use super::super::super::{Light, Material, Spectrum, SpectrumOrTexture, Texture};
    use super::super::tests::{fault, good};
    use crate::spectrum::{illuminant, upsample};

    /// The radiance of a constant emitter.
    fn radiance(spectrum: &str) -> Spectrum {
        let scene = good(&format!("<emitter type=\"constant\">{spectrum}</emitter>"));
        let Light::Constant(light) = &scene.lights[0] else { panic!("a constant light") };
        light.radiance.clone()
    }

    /// Mitsuba 3.9.1 is black under all but the one that reaches the band. What would be visible in µm is left to be refused.
    #[test]
    fn what_is_wholly_infrared_or_ultraviolet_is_dark() {
        let regular = |least: u32, most: u32| {
            let ends = format!(
                "<float name=\"wavelength_min\" value=\"{least}\"/><float name=\"wavelength_max\" value=\"{most}\"/>"
            );
            format!(
                "<spectrum type=\"regular\" name=\"radiance\">{ends}<string name=\"values\" value=\"1, 2\"/></spectrum>"
            )
        };
        let pairs = |pairs: &str| format!("<spectrum name=\"radiance\" value=\"{pairs}\"/>");
        let dark = [regular(100, 359), regular(831, 900), pairs("300:1, 350:2"), pairs("900:1, 950:2, 1000:0")];
        for spectrum in dark {
            assert_eq!(radiance(&spectrum), Spectrum::Number(0.0), "{spectrum}");
        }
        // What reaches the band is what it says.
        assert!(matches!(radiance(&pairs("300:1, 361:2")), Spectrum::ZeroOutside(_)));
        assert!(matches!(radiance(&pairs("0.4:1, 0.7:2")), Spectrum::ZeroOutside(_)));
    }

    /// Linear from 1 at 0 nm to 3 at 1000 nm: 1.72 at 360. Mitsuba 3.9.1 reads it.
    #[test]
    fn a_table_may_begin_at_no_wavelength() {
        let regular = "<spectrum type=\"regular\" name=\"radiance\"><float name=\"wavelength_min\" value=\"0\"/>\
                       <float name=\"wavelength_max\" value=\"2000\"/><string name=\"values\" value=\"1, 3, 2\"/></spectrum>";
        let pairs = "<spectrum name=\"radiance\" value=\"-1000:-1, 1000:3, 2000:2\"/>";
        for spectrum in [regular, pairs] {
            let Spectrum::Table(table) = radiance(spectrum) else { panic!("a table: {spectrum}") };
            assert_eq!((table[0][0], &table[1..]), (360.0, &[[1000.0, 3.0], [2000.0, 2.0]][..]), "{spectrum}");
            assert!((table[0][1] - 1.72).abs() < 1e-14, "{table:?}");
        }
        let unordered = "<spectrum type=\"irregular\" name=\"radiance\"><string name=\"wavelengths\" value=\"0, 900, 800\"/>\
                         <string name=\"values\" value=\"1, 2, 3\"/></spectrum>";
        for other in ["<spectrum name=\"radiance\" value=\"0:1, 0.7:2\"/>", unordered] {
            let told = fault(&format!("<emitter type=\"constant\">{other}</emitter>"), &[]);
            assert!(told.contains("for wavelengths increase, found 0"), "{told}");
        }
    }

    /// Mitsuba 3.9.1 makes of them what such a property of a surface is.
    #[test]
    fn the_words_of_properties_are_plugins() {
        let sky = |kind: &str, value: &str| {
            radiance(&format!("<spectrum type=\"{kind}\" name=\"radiance\">{value}</spectrum>"))
        };
        let rgb = |name: &str| format!("<rgb name=\"{name}\" value=\"0.9, 0.3, 0.1\"/>");
        assert_eq!(sky("rgb", &rgb("value")), sky("srgb", &rgb("color")));
        assert_eq!(sky("spectrum", "<spectrum name=\"value\" value=\"2\"/>"), Spectrum::Number(2.0));
        assert_eq!(sky("spectrum", "<float name=\"value\" value=\"2\"/>"), Spectrum::Number(2.0));
        let scene = good(&format!(
            "<texture type=\"rgb\" id=\"t\">{}</texture><bsdf type=\"diffuse\" id=\"m\"><ref name=\"reflectance\" id=\"t\"/></bsdf>",
            rgb("value")
        ));
        let Material::Diffuse(diffuse) = &scene.materials["m"] else { panic!("diffuse") };
        let SpectrumOrTexture::Spectrum(Spectrum::Rgb(found)) = &diffuse.reflectance else { panic!("a colour") };
        assert_eq!(*found, [0.9, 0.3, 0.1]);
        let none = fault("<emitter type=\"constant\"><texture type=\"rgb\" name=\"radiance\"/></emitter>", &[]);
        assert!(none.contains("\"value\", found none"), "{none}");
    }

    /// Mitsuba 3.9.1 shows this sky as 1.0371 0.2862 0.0860, and one of `<rgb>`, under D65, as 0.9005 0.2998 0.0998.
    #[test]
    fn an_srgb_spectrum_shines_as_it_reflects() {
        let srgb = |rgb: &str| {
            format!("<spectrum type=\"srgb\" name=\"radiance\"><rgb name=\"color\" value=\"{rgb}\"/></spectrum>")
        };
        let Spectrum::Table(table) = radiance(&srgb("0.9, 0.3, 0.1")) else { panic!("a table") };
        assert_eq!((table[0][0], table[470][0], table.len()), (360.0, 830.0, 471));
        let curve = upsample::reflectance([0.9, 0.3, 0.1]).unwrap();
        assert!(table.iter().all(|[nm, value]| super::at(&curve, *nm) == *value));
        assert_eq!(radiance(&srgb("0.5")), Spectrum::Number(0.5));
        let above = fault(&format!("<emitter type=\"constant\">{}</emitter>", srgb("2, 1, 1")), &[]);
        assert!(above.contains("texture \"srgb\": color: red channel: expected"), "{above}");
    }

    /// D65's table is 100 at 560 nm, which Mitsuba divides by 98.9974; a black body is Planck's radiance there, whatever it stands for.
    #[test]
    fn what_shines_may_say_what_a_surface_reflects() {
        let d65 = "<spectrum type=\"d65\" name=\"NAME\"><float name=\"scale\" value=\"0.5\"/></spectrum>";
        let body = "<spectrum type=\"blackbody\" name=\"NAME\"><float name=\"temperature\" value=\"1100\"/></spectrum>";
        let at_560 = |reflectance: &SpectrumOrTexture| match reflectance {
            SpectrumOrTexture::Spectrum(Spectrum::Table(table)) => {
                assert_eq!((table[0][0], table[200][0], table.len()), (360.0, 560.0, 471));
                table[200][1]
            }
            other => panic!("a table: {other:?}"),
        };
        for (spectrum, expected) in [(d65, 0.5 * 100.0 / 98.997_417_5), (body, illuminant::planck(560.0, 1100.0))] {
            let named = |name: &str| spectrum.replace("NAME", name);
            let scene = good(&format!(
                "<bsdf type=\"diffuse\" id=\"m\">{}</bsdf><bsdf type=\"conductor\" id=\"c\"><texture type=\"checkerboard\" \
                 name=\"specular_reflectance\" id=\"board\">{}</texture></bsdf>",
                named("reflectance"),
                named("color0")
            ));
            let Material::Diffuse(diffuse) = &scene.materials["m"] else { panic!("diffuse") };
            let Texture::Checkerboard(board) = &scene.textures["board"] else { panic!("a checkerboard") };
            for found in [at_560(&diffuse.reflectance), at_560(&board.a)] {
                assert!((found / expected - 1.0).abs() < 1e-4, "{found}, expected {expected}");
            }
        }
        let above = fault(
            &format!("<bsdf type=\"diffuse\" id=\"m\">{}</bsdf>", d65.replace("0.5", "2"))
                .replace("NAME", "reflectance"),
            &[],
        );
        assert!(above.contains("expected a number from 0 to 1, found "), "{above}");
    }

    /// They are multiplied by D65's luminance on Mitsuba's film before the grammar has them.
    #[test]
    fn negative_lights_are_told_as_they_are_written() {
        let sky = |radiance: &str| fault(&format!("<emitter type=\"constant\">{radiance}</emitter>"), &[]);
        let told = [
            sky("<float name=\"radiance\" value=\"-1\"/>"),
            sky("<rgb name=\"radiance\" value=\"2, -1, 3\"/>"),
            sky("<spectrum type=\"d65\" name=\"radiance\"><float name=\"scale\" value=\"-1\"/></spectrum>"),
            sky("<spectrum type=\"d65\" name=\"radiance\"><rgb name=\"color\" value=\"-1, 0, 0\"/></spectrum>"),
            fault(
                "<emitter type=\"envmap\"><string name=\"filename\" value=\"a.exr\"/><float name=\"scale\" value=\"-1\"/></emitter>",
                &[],
            ),
        ];
        for told in told {
            assert!(told.ends_with("expected a number of 0 or more, found -1"), "{told}");
        }
    }

    /// Bitterli's living-room-2 has a metal of such an index.
    #[test]
    fn colours_of_metals_that_mitsuba_alters_are_told() {
        let metal = |eta: &str, k: &str| {
            good(&format!(
                "<shape type=\"sphere\"><bsdf type=\"conductor\"><rgb name=\"eta\" value=\"{eta}\"/>\n\
                 <rgb name=\"k\" value=\"{k}\"/></bsdf></shape>"
            ))
        };
        let scene = metal("-0.25, 0.5, 4", "-0.5, 0.5, 1");
        let notes = scene.locator.notes();
        let told = [
            "s.xml:3:45: eta: numbers below 0 of [-0.25, 0.5, 4.0] are taken for 0, as in Mitsuba",
            "s.xml:3:45: eta: numbers above 1 of [-0.25, 0.5, 4.0] are what they say; Mitsuba takes 1 for them",
            "s.xml:4:1: k: numbers below 0 of [-0.5, 0.5, 1.0] are taken for 0, as in Mitsuba",
        ];
        assert!(notes.len() == 3 && notes.iter().zip(told).all(|(note, told)| note.ends_with(told)), "{notes:?}");
        assert_eq!(metal("0.2, 0.5, 1", "0, 0.5, 1").locator.notes(), [""; 0]);
    }

    /// Of 500 to 600 nm at 4000 K, Mitsuba 3.9.1 shows 1193 3314 -306; of the whole body 4903 3204 1850.
    #[test]
    fn a_black_body_may_be_cut() {
        let body = |ends: &str| {
            let ends = ends.split_once(' ').map_or(String::new(), |(least, most)| {
                format!("<float name=\"wavelength_min\" value=\"{least}\"/><float name=\"wavelength_max\" value=\"{most}\"/>")
            });
            format!(
                "<spectrum type=\"blackbody\" name=\"radiance\"><float name=\"temperature\" value=\"4000\"/>{ends}</spectrum>"
            )
        };
        assert!(matches!(radiance(&body("")), Spectrum::Blackbody(_)));
        assert_eq!(radiance(&body("300 1000")), radiance(&body("")));
        let Spectrum::ZeroOutside(cut) = radiance(&body("500 599.5")) else { panic!("zero outside") };
        let Spectrum::Table(table) = *cut else { panic!("a table") };
        let curve = illuminant::blackbody(4000.0).unwrap();
        assert_eq!((table[0][0], table[1][0], table[99][0], table[100][0]), (500.0, 501.0, 599.0, 599.5));
        assert!(table.iter().all(|[nm, value]| super::at(&curve, *nm) == *value) && table.len() == 101);
        assert_eq!(radiance(&body("900 1000")), Spectrum::Number(0.0));
        let none = fault(&format!("<emitter type=\"constant\">{}</emitter>", body("600 500")), &[]);
        assert!(none.ends_with("wavelength_max: expected more than wavelength_min, 600, found 500"), "{none}");
    }
}
