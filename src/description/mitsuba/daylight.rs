//! CIE D65, and what is multiplied by it.

use std::collections::HashSet;

use super::super::fault::Fault;
use super::super::node::{Entry, Node, Place, Value};
use super::object::{Bag, Family};
use super::spectra::{Role, SPECTRA, at, colour, not_negative, sampled, table};
use super::{DAYLIGHT, Fields, Import, number, text};
use crate::spectrum::{BAND_NM, Outside, Spectrum as Curve, illuminant, upsample};

impl Import<'_> {
    /// A `d65`: alone, of a colour, or times the spectrum inside.
    pub(super) fn daylight(&mut self, bag: &Bag<'_>, role: Role) -> Result<Node, Fault> {
        let place = bag.object.place;
        let scale = bag.float("scale")?.unwrap_or(1.0);
        not_negative(bag, "scale", &[scale])?;
        let rgb = bag.rgb("color")?;
        not_negative(bag, "color", &rgb.unwrap_or_default())?;
        if let Some(inner) = bag.only(Family::Texture)? {
            if rgb.is_some() {
                return Err(bag.fault("expected either color or a spectrum inside, found both"));
            }
            bag.finish()?;
            let Some(inner) = self.spectrum_plugin(inner, Role::Coefficient)? else {
                return Err(bag.fault("expected a spectrum inside, found a texture"));
            };
            return in_daylight(place, &inner, scale)
                .ok_or_else(|| bag.fault("expected a spectrum that is no file inside, found one of a file"));
        }
        Ok(match (rgb.map(|rgb| rgb.map(|x| x * scale)), role) {
            (None, Role::Emission) => d65(place, scale),
            (Some(rgb), Role::Emission) => colour(place, rgb, role),
            // What is no light has no kind of its own for it.
            (None, Role::Reflectance | Role::Coefficient) => {
                sampled(place, BAND_NM, &illuminant::d65().scaled(scale * DAYLIGHT))
            }
            // Colours of a surface and of the squares of a checkerboard have no D65 in them.
            (Some(rgb), Role::Reflectance | Role::Coefficient) => {
                let curve = upsample::emission(rgb).map_err(|message| bag.fault_of("color", message))?;
                sampled(place, BAND_NM, &curve.scaled(DAYLIGHT))
            }
        })
    }

    /// The picture or checkerboard within a `d65`, under a name of its own, as light of D65; `None` where there is none.
    pub(super) fn lit_texture(&mut self, index: usize) -> Result<Option<String>, Fault> {
        if let Some(name) = self.names.get(&index) {
            return Ok(Some(name.clone()));
        }
        let bag = self.bag(index);
        let Some((nested, scale)) = within(&bag)? else { return Ok(None) };
        let place = bag.object.place;
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

    /// The name of what hangs in a spot, and the scale of the D65 around it where there is one.
    pub(super) fn slide(&mut self, index: usize) -> Result<(String, Option<f64>), Fault> {
        let bag = self.bag(index);
        let lit = if bag.object.plugin == "d65" { within(&bag)? } else { None };
        match lit {
            Some((inner, scale)) => Ok((self.declare_texture(inner)?, Some(scale))),
            None => Ok((self.declare_texture(index)?, None)),
        }
    }

    /// Whether a texture is D65 times a picture, or has such squares. Textures that were `seen` are not.
    pub(super) fn is_lit(&self, index: usize, seen: &mut HashSet<usize>) -> bool {
        if !seen.insert(index) {
            return false;
        }
        let bag = self.bag(index);
        let inner = bag.objects(Family::Texture);
        let varies = |index: &usize| !SPECTRA.contains(&self.document.objects[*index].plugin.as_str());
        (bag.object.plugin == "d65" && inner.iter().any(varies))
            || inner.into_iter().any(|inner| self.is_lit(inner, seen))
    }
}

/// What is within a `d65` that is no spectrum, and the scale; `None` where there is none such.
fn within(bag: &Bag<'_>) -> Result<Option<(usize, f64)>, Fault> {
    let is_spectrum = |index: &usize| SPECTRA.contains(&bag.document.objects[*index].plugin.as_str());
    let Some(inner) = bag.only(Family::Texture)?.filter(|index| !is_spectrum(index)) else { return Ok(None) };
    let scale = bag.float("scale")?.unwrap_or(1.0);
    not_negative(bag, "scale", &[scale])?;
    bag.finish()?;
    Ok(Some((inner, scale)))
}

/// CIE D65, of luminance `scale` on Mitsuba's film.
pub(super) fn d65(place: Place, scale: f64) -> Node {
    let mut fields = Fields::new(place);
    fields.add("name", text(place, "D65"));
    fields.add("scale", number(place, scale * DAYLIGHT));
    fields.kind("illuminant")
}

/// D65 of luminance `scale` times a number, a colour of a surface, a table or D65; `None` of anything else.
pub(super) fn in_daylight(place: Place, of: &Node, scale: f64) -> Option<Node> {
    let daylight = illuminant::d65().scaled(scale * DAYLIGHT);
    if let Value::Float(by) = of.value {
        return Some(sampled(place, BAND_NM, &daylight.scaled(by)));
    }
    if let Some(illuminant) = of.get("illuminant") {
        let Value::Float(by) = illuminant.get("scale")?.value else { return None };
        return in_daylight(place, &sampled(place, BAND_NM, &illuminant::d65().scaled(by)), scale);
    }
    let (knots, curve) = if let Some(rgb) = of.get("rgb") {
        (BAND_NM.to_vec(), upsample::reflectance(floats_of(rgb)?.try_into().ok()?).ok()?)
    } else {
        let Value::List(rows) = &of.get("zero_outside").unwrap_or(of).get("table")?.value else { return None };
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
    let lit = fields.map();
    let image = picture.get_mut("image")?;
    if let Some(illuminant) = image.get_mut("illuminant") {
        *illuminant = lit;
    } else if let Value::Map(written) = &mut image.value {
        // Of a picture that stands as it was written.
        written.push(Entry { key: "illuminant".to_owned(), key_place: place, node: lit });
    }
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
    let Value::List(items) = &list.value else { return None };
    let float = |item: &Node| match item.value {
        Value::Float(x) => Some(x),
        _ => None,
    };
    items.iter().map(float).collect()
}

#[cfg(test)]
mod tests {
    use super::super::super::{Spectrum, SpectrumOrTexture, Texture};
    use super::super::tests::{fault, good};
    use crate::spectrum::{ColourSpace, Outside, Spectrum as Curve, colour, observer, upsample};

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
}
