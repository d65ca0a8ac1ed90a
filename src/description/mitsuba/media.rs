//! Media and phase functions.

use super::super::fault::Fault;
use super::super::medium::{UNCHANGED, VACUUM};
use super::super::node::Node;
use super::object::{Bag, Family, Value};
use super::parse;
use super::spectra::Role;
use super::{Fields, Import, boolean, entry, list, number, numbers, text};

const MEDIA: [&str; 2] = ["homogeneous", "heterogeneous"];
const PHASES: [&str; 5] = ["isotropic", "hg", "rayleigh", "tabphase", "blendphase"];

impl Import<'_> {
    /// The name under which a medium stands in `media`.
    pub(crate) fn medium(&mut self, index: usize) -> Result<String, Fault> {
        if let Some(name) = self.names.get(&index) {
            return Ok(name.clone());
        }
        let bag = self.bag(index);
        if let Some(node) = bag.written() {
            let name = self.name_for(index);
            self.media.push(self.entry(index, &name, node));
            return Ok(name);
        }
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        let kind = match bag.object.plugin.as_str() {
            "homogeneous" => {
                let extinction = self.even_volume(&bag, "sigma_t")?;
                fields.add("extinction", extinction.unwrap_or_else(|| number(place, 1.0)));
                "homogeneous"
            }
            "heterogeneous" => {
                let extinction = self.volume_of(&bag, "sigma_t", 1.0)?;
                fields.add("extinction", extinction);
                "heterogeneous"
            }
            _ => return Err(bag.unknown(MEDIA)),
        };
        let albedo = self.spectrum_or_volume(&bag, "albedo", Role::Reflectance)?;
        fields.add("albedo", albedo.unwrap_or_else(|| number(place, 0.75)));
        if let Some(scale) = bag.float("scale")? {
            fields.add("scale", number(bag.place("scale"), scale));
        }
        // How light is looked for, not what there is.
        bag.boolean("has_spectral_extinction")?;
        if let Some(sample) = bag.boolean("sample_emitters")? {
            fields.add("shadow_rays", boolean(bag.place("sample_emitters"), sample));
        }
        if let Some(phase) = bag.only(Family::Phase)? {
            fields.add("phase", self.phase(phase)?);
        }
        bag.finish()?;
        let name = self.name_for(index);
        self.media.push(self.entry(index, &name, fields.kind(kind)));
        Ok(name)
    }

    /// The media on the two sides of a shape. A side that a shape does not name is empty if it names the other; a
    /// shape that names none leaves a ray in what it is in.
    pub(crate) fn sides(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
        if !self.has_media {
            return Ok(());
        }
        let sides = [("inside", "interior"), ("outside", "exterior")];
        let written = sides.iter().any(|(_, theirs)| bag.has(theirs));
        for (ours, theirs) in sides {
            let name = match bag.object(theirs, &[Family::Medium])? {
                Some(medium) => self.medium(medium)?,
                None => if written { VACUUM } else { UNCHANGED }.to_owned(),
            };
            if !self.sees_media {
                continue;
            }
            fields.add(ours, text(bag.place(theirs), name));
        }
        Ok(())
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
            "tabphase" => {
                let values = bag.required("values", bag.text("values"))?;
                let place = bag.place("values");
                let values: Result<Vec<f64>, Fault> =
                    parse::tokens(values).map(|token| parse::number(token, place)).collect();
                entry(place, "table", numbers(place, &values?))
            }
            "blendphase" => self.blend(&bag)?,
            _ => return Err(bag.unknown(PHASES)),
        };
        bag.finish()?;
        self.again(index, &node)?;
        Ok(node)
    }

    fn blend(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let mut fields = Fields::new(bag.object.place);
        let place = bag.place("weight");
        let weight = match bag.value("weight") {
            Some(Value::Object(index)) if bag.document.objects[*index].family == Family::Volume => {
                let volume = self.declare_volume(*index)?;
                entry(place, "volume", text(place, volume))
            }
            _ => match self.share(bag, "weight")? {
                None => return Err(bag.fault("expected the parameter \"weight\", found none")),
                Some(weight) if matches!(weight.value, super::Value::Float(_)) => weight,
                Some(_) => return Err(bag.fault_of("weight", "expected a float or a volume, found a texture")),
            },
        };
        fields.add("weight", weight);
        // In the order of the text. (The names of the two play no part.)
        let parts = bag.objects(Family::Phase);
        let [first, second] = parts[..] else {
            return Err(bag.fault(format!("expected two phase functions, found {}", parts.len())));
        };
        let parts = [self.phase(first)?, self.phase(second)?];
        fields.add("of", list(bag.object.place, parts));
        Ok(fields.kind("blend"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::{Coefficients, Medium, Spectrum};
    use super::super::tests::{fault, good};

    /// Two names are words of the grammar, and a medium has another.
    #[test]
    fn media_may_have_any_id() {
        let medium = |id: &str, t: &str| {
            let t = format!("<float name=\"sigma_t\" value=\"{t}\"/>");
            let sphere =
                format!("<shape type=\"sphere\"><bsdf type=\"null\"/><ref name=\"interior\" id=\"{id}\"/></shape>");
            format!("<medium type=\"homogeneous\" id=\"{id}\">{t}</medium>{sphere}")
        };
        let scene = good(&(medium("vacuum", "1") + &medium("unchanged", "2") + &medium("vacuum (medium)", "3")));
        let inside: Vec<f64> = scene
            .shapes
            .iter()
            .map(|shape| match &scene.media[shape.inside.as_ref().unwrap()] {
                Medium::Homogeneous(m) => match &m.coefficients {
                    Coefficients::Sum { extinction: Spectrum::Number(t), .. } => *t,
                    other => panic!("{other:?}"),
                },
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(inside, [1.0, 2.0, 3.0]);
    }

    /// Each of 100,000 looked among all of them for a medium: 41 s where the rest takes one.
    #[test]
    fn many_shapes_without_media_take_no_quadratic_time() {
        let begin = std::time::Instant::now();
        assert_eq!(good(&"<shape type=\"sphere\"/>".repeat(100_000)).shapes.len(), 100_000);
        assert!(begin.elapsed() < std::time::Duration::from_secs(20));
    }

    /// A volume that is the same everywhere is a spectrum, wherever it is; one that varies is no even extinction.
    #[test]
    fn an_even_extinction_may_stand_in_a_volume() {
        let medium =
            |volume: &str| format!("<medium type=\"homogeneous\" id=\"m\"><volume type=\"{volume}\" name=\"sigma_t\">");
        let text = medium("constvolume")
            + "<float name=\"value\" value=\"0.3\"/><transform name=\"to_world\"><scale value=\"2\"/></transform>\
               </volume></medium>";
        let scene = good(&text);
        let Medium::Homogeneous(m) = &scene.media["m"] else { panic!("homogeneous") };
        let Coefficients::Sum { extinction, .. } = &m.coefficients else { panic!("a sum") };
        assert_eq!(*extinction, Spectrum::Number(0.3));
        assert!(scene.volumes.is_empty());
        let varies = medium("gridvolume") + "<string name=\"filename\" value=\"a.vol\"/></volume></medium>";
        assert!(fault(&varies, &[]).contains("sigma_t: expected a spectrum, a colour or a float"));
    }
}
