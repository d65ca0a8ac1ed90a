//! Spectra.

use std::collections::HashSet;

use super::super::fault::Fault;
use super::super::node::{Node, Place};
use super::object::{Bag, Family, SpectrumValue, Value};
use super::parse;
use super::{DAYLIGHT, Fields, Import, entry, list, number, numbers, text};
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

    /// Whether a texture is D65 times a picture, or has such squares. Textures that were `seen` are not.
    fn is_lit(&self, index: usize, seen: &mut HashSet<usize>) -> bool {
        if !seen.insert(index) {
            return false;
        }
        let bag = self.bag(index);
        let inner = bag.objects(Family::Texture);
        let varies = |index: &usize| !SPECTRA.contains(&self.document.objects[*index].plugin.as_str());
        (bag.object.plugin == "d65" && inner.iter().any(varies))
            || inner.into_iter().any(|inner| self.is_lit(inner, seen))
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

    /// The picture or checkerboard within a `d65`, under a name of its own, as light of D65; `None` where there is none.
    fn lit_texture(&mut self, index: usize) -> Result<Option<String>, Fault> {
        if let Some(name) = self.names.get(&index) {
            return Ok(Some(name.clone()));
        }
        let bag = self.bag(index);
        let nested = bag.only(Family::Texture)?;
        let is_spectrum = |index: &usize| SPECTRA.contains(&bag.document.objects[*index].plugin.as_str());
        let Some(nested) = nested.filter(|index| !is_spectrum(index)) else { return Ok(None) };
        let place = bag.object.place;
        let scale = bag.float("scale")?.unwrap_or(1.0);
        not_negative(&bag, "scale", &[scale])?;
        bag.finish()?;
        let plain = self.declare_texture(nested)?;
        let lit =
            self.textures.iter().find(|entry| entry.key == plain).and_then(|entry| match entry.node.get("image") {
                Some(_) => picture_in_daylight(place, entry.node.clone(), scale),
                None => board_in_daylight(place, entry.node.clone(), scale),
            });
        let Some(lit) = lit else {
            return Err(bag.fault("expected a bitmap or a checkerboard of two spectra inside, found another texture"));
        };
        let name = self.name_for(index);
        self.textures.push(self.entry(index, &name, lit));
        Ok(Some(name))
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
            "d65" => {
                let scale = bag.float("scale")?.unwrap_or(1.0);
                not_negative(&bag, "scale", &[scale])?;
                let colour = match bag.value("color") {
                    None => None,
                    Some(Value::Rgb(rgb)) => Some(*rgb),
                    Some(other) => {
                        let found = other.kind(bag.document);
                        return Err(bag.fault_of("color", format!("expected an rgb colour, found {found}")));
                    }
                };
                not_negative(&bag, "color", &colour.unwrap_or_default())?;
                if let Some(inner) = bag.only(Family::Texture)? {
                    if colour.is_some() {
                        return Err(bag.fault("expected either color or a spectrum inside, found both"));
                    }
                    bag.finish()?;
                    let Some(inner) = self.spectrum_plugin(inner, Role::Coefficient)? else {
                        return Err(bag.fault("expected a spectrum inside, found a texture"));
                    };
                    let Some(lit) = in_daylight(place, &inner, scale) else {
                        return Err(bag.fault("expected a spectrum that is no file inside, found one of a file"));
                    };
                    return Ok(Some(lit));
                }
                match (colour.map(|rgb| rgb.map(|x| x * scale)), role) {
                    (None, Role::Emission) => d65(place, scale),
                    (Some(rgb), Role::Emission) => self::colour(place, rgb, role),
                    // What is no light has no kind of its own for it.
                    (None, Role::Reflectance | Role::Coefficient) => {
                        sampled(place, BAND_NM, &illuminant::d65().scaled(scale * DAYLIGHT))
                    }
                    // Colours of a surface and of the squares of a checkerboard have no D65 in them.
                    (Some(rgb), Role::Reflectance | Role::Coefficient) => match upsample::emission(rgb) {
                        Ok(curve) => sampled(place, BAND_NM, &curve.scaled(DAYLIGHT)),
                        Err(message) => return Err(bag.fault_of("color", message)),
                    },
                }
            }
            "srgb" => {
                let rgb = match bag.value("color") {
                    Some(Value::Rgb(rgb)) => *rgb,
                    Some(other) => {
                        let found = other.kind(bag.document);
                        return Err(bag.fault_of("color", format!("expected an rgb colour, found {found}")));
                    }
                    None => return Err(bag.fault("expected the parameter \"color\", found none")),
                };
                bag.boolean("unbounded")?;
                match role {
                    Role::Reflectance => entry(place, "rgb", numbers(place, &rgb)),
                    // What a surface of this colour reflects, also as light: there is no D65 in it.
                    Role::Emission | Role::Coefficient => match upsample::reflectance(rgb) {
                        Ok(curve) => sampled(place, BAND_NM, &curve),
                        Err(message) => return Err(bag.fault_of("color", message)),
                    },
                }
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
            "blackbody" => {
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
                    fields.add("normalised", super::boolean(place, false));
                    fields.kind("blackbody")
                } else {
                    let curve = illuminant::blackbody(kelvin).map_err(|m| bag.fault_of("temperature", m))?;
                    sampled(place, [least, most], &curve)
                }
            }
            _ => return Ok(None),
        };
        bag.finish()?;
        Ok(Some(node))
    }
}

/// Plugins that are a spectrum, the same everywhere.
pub(super) const SPECTRA: [&str; 7] = ["uniform", "rawconstant", "d65", "srgb", "regular", "irregular", "blackbody"];

/// A curve at one wavelength, nm.
pub(crate) fn at(curve: &Curve, nm: f64) -> f64 {
    f64::from(curve.eval(Lanes::splat(nm as f32)).to_array()[0])
}

/// A curve between two wavelengths, nm, at each whole one, and zero outside.
fn sampled(place: Place, ends: [f64; 2], curve: &Curve) -> Node {
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

/// D65 of luminance `scale` times a number, a colour of a surface or a table; `None` of anything else.
fn in_daylight(place: Place, of: &Node, scale: f64) -> Option<Node> {
    let daylight = illuminant::d65().scaled(scale * DAYLIGHT);
    if let super::Value::Float(by) = of.value {
        return Some(sampled(place, BAND_NM, &daylight.scaled(by)));
    }
    let (knots, curve) = if let Some(rgb) = of.get("rgb") {
        (BAND_NM.to_vec(), upsample::reflectance(floats_of(rgb)?.try_into().ok()?).ok()?)
    } else {
        let super::Value::List(rows) = &of.get("zero_outside").unwrap_or(of).get("table")?.value else { return None };
        let rows: Option<Vec<[f64; 2]>> = rows.iter().map(|row| floats_of(row)?.try_into().ok()).collect();
        let samples: Vec<(f64, f64)> = rows?.into_iter().map(|[nm, value]| (nm, value)).collect();
        let curve = Curve::from_samples(&samples, Outside::Zero).ok()?;
        (samples.into_iter().map(|(nm, _)| nm).collect(), curve)
    };
    // Each whole wavelength, and where a table has its own; zero outside.
    let [from, to] = [knots.first()?.max(BAND_NM[0]), knots.last()?.min(BAND_NM[1])];
    let whole = (BAND_NM[0] as i32..=BAND_NM[1] as i32).map(f64::from);
    let mut all: Vec<f64> = whole.chain(knots).filter(|nm| (from..=to).contains(nm)).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    if all.len() < 2 {
        return Some(number(place, 0.0));
    }
    Some(table(place, &all.into_iter().map(|nm| [nm, at(&curve, nm) * at(&daylight, nm)]).collect::<Vec<_>>()))
}

/// A picture as light of D65 of luminance `scale`.
fn picture_in_daylight(place: Place, mut picture: Node, scale: f64) -> Option<Node> {
    let mut fields = Fields::new(place);
    fields.add("name", text(place, "D65"));
    fields.add("scale", number(place, scale * DAYLIGHT));
    *picture.get_mut("image")?.get_mut("illuminant")? = fields.map();
    Some(picture)
}

/// The same of a checkerboard; `None` where a square is a texture or a file.
fn board_in_daylight(place: Place, mut board: Node, scale: f64) -> Option<Node> {
    for key in ["a", "b"] {
        let square = board.get_mut("checkerboard")?.get_mut(key)?;
        *square = in_daylight(place, square, scale)?;
    }
    Some(board)
}

/// The numbers of a list of them.
fn floats_of(list: &Node) -> Option<Vec<f64>> {
    let super::Value::List(items) = &list.value else { return None };
    let float = |item: &Node| match item.value {
        super::Value::Float(x) => Some(x),
        _ => None,
    };
    items.iter().map(float).collect()
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

fn colour(place: Place, rgb: [f64; 3], role: Role) -> Node {
    match role {
        Role::Emission => scaled(place, DAYLIGHT, entry(place, "rgb", numbers(place, &rgb))),
        Role::Reflectance | Role::Coefficient => entry(place, "rgb", numbers(place, &rgb)),
    }
}

/// CIE D65, of luminance `scale` on Mitsuba's film.
pub(crate) fn d65(place: Place, scale: f64) -> Node {
    let mut fields = Fields::new(place);
    fields.add("name", text(place, "D65"));
    fields.add("scale", number(place, scale * DAYLIGHT));
    fields.kind("illuminant")
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
fn table(place: Place, pairs: &[[f64; 2]]) -> Node {
    let table = entry(place, "table", pairs_node(place, pairs));
    let covers = pairs.first().is_some_and(|p| p[0] <= 360.0) && pairs.last().is_some_and(|p| p[0] >= 830.0);
    if covers { table } else { entry(place, "zero_outside", table) }
}

#[cfg(test)]
mod tests {
    use super::super::super::{Light, Material, Spectrum, SpectrumOrTexture, Texture};
    use super::super::tests::{fault, good};
    use crate::spectrum::{ColourSpace, Outside, Spectrum as Curve, colour, illuminant, observer, upsample};

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

    /// D65 of a colour is the light of that colour in a square of a checkerboard, too: Mitsuba 3.9.1 shows a lamp of the two of
    /// these as their mean. Surfaces that reflect it have its curve, whose largest value at a scale of 2 is above 1.
    #[test]
    fn daylight_of_a_colour_has_d65_in_it_wherever_it_stands() {
        let lit = |name: &str, rgb: &str, scale: f64| {
            format!(
                "<spectrum type=\"d65\" name=\"{name}\"><float name=\"scale\" value=\"{scale}\"/>\
                 <rgb name=\"color\" value=\"{rgb}\"/></spectrum>"
            )
        };
        let board = lit("color0", "0.9, 0.2, 0.4", 1.0) + &lit("color1", "2, 2, 2", 1.0);
        let scene = good(&format!("<texture type=\"checkerboard\" id=\"board\">{board}</texture>"));
        let Texture::Checkerboard(board) = &scene.textures["board"] else { panic!("a checkerboard") };
        for (square, rgb) in [(&board.a, [0.9, 0.2, 0.4]), (&board.b, [2.0; 3])] {
            let SpectrumOrTexture::Spectrum(Spectrum::Table(table)) = square else { panic!("a table: {square:?}") };
            let pairs: Vec<(f64, f64)> = table.iter().map(|[nm, x]| (*nm, *x)).collect();
            let xyz = observer::tristimulus(&Curve::from_samples(&pairs, Outside::Zero).unwrap());
            let shown = colour::times(ColourSpace::Rec709.matrix_from_xyz(), xyz).map(|x| x / super::DAYLIGHT);
            // Straight lines of 1 nm leave the curve by less.
            assert!((0..3).all(|c| (shown[c] - rgb[c]).abs() < 1e-3), "{shown:?}, expected {rgb:?}");
        }
        let white =
            |scale| format!("<bsdf type=\"diffuse\" id=\"m\">{}</bsdf>", lit("reflectance", "0.5, 0.5, 0.5", scale));
        assert_eq!(fault(&white(1.0), &[]), "none");
        assert!(
            fault(&white(2.0), &[]).contains("expected a number from 0 to 1, found 1."),
            "{}",
            fault(&white(2.0), &[])
        );
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

    /// Of 560 nm D65 has 100 / 98.9974 there; half of what stands at 500 and at 620 nm is what stands at 560.
    #[test]
    fn daylight_multiplies_the_spectrum_or_the_squares_inside() {
        let lit = |inside: &str| {
            let scale = "<float name=\"scale\" value=\"3\"/>";
            good(&format!(
                "<shape type=\"sphere\"><emitter type=\"area\"><texture type=\"d65\" name=\"radiance\" id=\"lit\">{scale}{inside}</texture>\
                 </emitter></shape>"
            ))
        };
        let at_560 = |spectrum: &Spectrum| {
            let mut table = match spectrum {
                Spectrum::Table(table) => table.as_slice(),
                Spectrum::ZeroOutside(inner) => match &**inner {
                    Spectrum::Table(table) => {
                        assert_eq!((table[0][0], table[120][0], table.len()), (500.0, 620.0, 121));
                        table.as_slice()
                    }
                    other => panic!("a table: {other:?}"),
                },
                other => panic!("a table: {other:?}"),
            }
            .iter();
            table.find(|[nm, _]| *nm == 560.0).unwrap()[1] / (3.0 * 100.0 / 98.997_417_5)
        };
        let near =
            |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-4, "{found}, expected {expected}");
        let irregular = |name: &str| {
            format!(
                "<spectrum type=\"irregular\" name=\"{name}\"><string name=\"wavelengths\" value=\"500, 620\"/>\
                 <string name=\"values\" value=\"0.2, 0.6\"/></spectrum>"
            )
        };
        let uniform = "<spectrum type=\"uniform\" name=\"a\"><float name=\"value\" value=\"0.7\"/></spectrum>";
        for (inside, expected) in [(irregular("a").as_str(), 0.4), (uniform, 0.7)] {
            let scene = lit(inside);
            let Some(SpectrumOrTexture::Spectrum(radiance)) = &scene.shapes[0].emission else { panic!("a spectrum") };
            near(at_560(radiance), expected);
        }
        let squares = irregular("color0") + "<rgb name=\"color1\" value=\"0.9, 0.2, 0.4\"/>";
        let scene = lit(&format!("<texture type=\"checkerboard\" name=\"a\">{squares}</texture>"));
        let Texture::Checkerboard(board) = &scene.textures["lit"] else { panic!("a checkerboard") };
        let [SpectrumOrTexture::Spectrum(a), SpectrumOrTexture::Spectrum(b)] = [&board.a, &board.b] else {
            panic!("spectra: {board:?}")
        };
        near(at_560(a), 0.4);
        near(at_560(b), super::at(&upsample::reflectance([0.9, 0.2, 0.4]).unwrap(), 560.0));
    }

    /// Mitsuba 3.9.1 shows what reflects by such a picture by D65 times its colours, times the scale.
    #[test]
    fn a_picture_in_d65_is_for_what_shines() {
        let lit = |name: &str| {
            format!(
                "<texture type=\"d65\" name=\"{name}\"><float name=\"scale\" value=\"0.5\"/><texture type=\"bitmap\" name=\"t\">\
                 <string name=\"filename\" value=\"a.png\"/></texture></texture>"
            )
        };
        let board = |name: &str| format!("<texture type=\"checkerboard\" name=\"{name}\">{}</texture>", lit("color0"));
        let ball = |inside: String| fault(&format!("<shape type=\"sphere\">{inside}</shape>"), &[]);
        let reflects = |texture: String| ball(format!("<bsdf type=\"diffuse\">{texture}</bsdf>"));
        let shines = |texture: String| ball(format!("<emitter type=\"area\">{texture}</emitter>"));
        for told in [reflects(lit("reflectance")), reflects(board("reflectance"))] {
            assert!(told.contains("bsdf \"diffuse\": reflectance: expected a texture without D65, found"), "{told}");
        }
        assert_eq!([shines(lit("radiance")), shines(board("radiance"))], ["none", "none"]);
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
