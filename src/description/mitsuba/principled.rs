//! Principled surfaces.

use super::super::fault::Fault;
use super::super::node::Node;
use super::bsdfs::{Sides, transparent};
use super::object::Bag;
use super::spectra::Role;
use super::{Fields, Import, boolean, number, text};

/// Factors on how often a lobe is sampled: Mitsuba's name and ours.
type Rates = [(&'static str, &'static str)];

impl Import<'_> {
    pub(super) fn principled(&mut self, bag: &Bag<'_>, sides: Sides) -> Result<Node, Fault> {
        let mut fields = Fields::new(bag.object.place);
        self.principled_numbers(
            bag,
            &mut fields,
            &[
                "roughness",
                "anisotropic",
                "metallic",
                "spec_trans",
                "spec_tint",
                "sheen",
                "sheen_tint",
                "flatness",
                "clearcoat",
                "clearcoat_gloss",
            ],
        )?;
        if bag.has("eta") && bag.has("specular") {
            return Err(bag.fault("expected either eta or specular, found both"));
        }
        fields.maybe("eta", bag.float("eta")?.map(|value| number(bag.place("eta"), value)));
        if let Some(specular) = bag.float("specular")? {
            let place = bag.place("specular");
            // Above 1, up to 12.5, it stands for an index just the same.
            let index = 2.0 / (1.0 - (0.08 * specular).sqrt()) - 1.0;
            let beyond = specular > 1.0 && index > 1.0 && index.is_finite();
            let (name, value) = if beyond { ("eta", index) } else { ("specular", specular) };
            fields.add(name, number(place, value));
        }
        rates(
            bag,
            &mut fields,
            &[
                ("main_specular_sampling_rate", "specular"),
                ("clearcoat_sampling_rate", "clearcoat"),
                ("diffuse_reflectance_sampling_rate", "diffuse"),
            ],
        )?;
        fields.add("two_sided", boolean(bag.object.place, sides == Sides::Both));
        bag.finish()?;
        Ok(fields.kind("principled"))
    }

    pub(super) fn principled_thin(&mut self, bag: &Bag<'_>, sides: Sides) -> Result<Node, Fault> {
        transparent(bag, sides)?;
        let mut fields = Fields::new(bag.object.place);
        self.principled_numbers(
            bag,
            &mut fields,
            &[
                "roughness",
                "anisotropic",
                "spec_trans",
                "diff_trans",
                "eta",
                "spec_tint",
                "sheen",
                "sheen_tint",
                "flatness",
            ],
        )?;
        rates(
            bag,
            &mut fields,
            &[
                ("specular_reflectance_sampling_rate", "reflection"),
                ("specular_transmittance_sampling_rate", "transmission"),
                ("diffuse_reflectance_sampling_rate", "diffuse_reflection"),
                ("diffuse_transmittance_sampling_rate", "diffuse_transmission"),
            ],
        )?;
        bag.finish()?;
        Ok(fields.kind("principled_thin"))
    }

    /// The base colour, numbers that have the same name in both grammars, and whose luminance a tint is
    /// divided by.
    fn principled_numbers(&mut self, bag: &Bag<'_>, fields: &mut Fields, names: &[&'static str]) -> Result<(), Fault> {
        fields.maybe("base_color", self.spectrum_or_texture(bag, "base_color", Role::Reflectance)?);
        for &name in names {
            fields.maybe(name, self.number_or_texture(bag, name)?);
        }
        // A tint is the base colour over a luminance that Mitsuba's spectral modes take from the path's own
        // four wavelengths: 0.38 for white. The picture is to be the same.
        if bag.has("spec_tint") || bag.has("sheen_tint") {
            fields.add("luminance", text(bag.object.place, "mitsuba"));
        }
        Ok(())
    }
}

/// How often the lobes are sampled.
fn rates(bag: &Bag<'_>, fields: &mut Fields, rates: &Rates) -> Result<(), Fault> {
    let mut sampling = Fields::new(bag.object.place);
    let mut any = false;
    for &(theirs, ours) in rates {
        if let Some(rate) = bag.float(theirs)? {
            sampling.add(ours, number(bag.place(theirs), rate));
            any = true;
        }
    }
    if any {
        fields.add("sampling", sampling.map());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::super::{Contrast, HairColour, Luminance, Material, NumberOrTexture};
    use super::super::tests::{fault, good};

    #[test]
    fn principled_surfaces_keep_their_parameters() {
        let text = "<bsdf type=\"principled\" id=\"a\"><float name=\"eta\" value=\"1.3\"/><float name=\"metallic\" value=\"0.5\"/>\
                    <float name=\"sheen_tint\" value=\"1\"/><float name=\"clearcoat_sampling_rate\" value=\"2\"/></bsdf>\
                    <bsdf type=\"twosided\" id=\"b\"><bsdf type=\"principled\"><texture type=\"checkerboard\" \
                    name=\"roughness\"/></bsdf></bsdf>\
                    <bsdf type=\"principledthin\" id=\"c\"><float name=\"diff_trans\" value=\"2\"/></bsdf>\
                    <bsdf type=\"hair\" id=\"d\"/>";
        let scene = good(text);
        let Material::Principled(a) = &scene.materials["a"] else { panic!("principled") };
        assert_eq!((a.contrast, a.two_sided, a.luminance), (Contrast::Eta(1.3), false, Luminance::Mitsuba));
        assert_eq!((&a.metallic, a.sampling.clearcoat), (&NumberOrTexture::Number(0.5), 2.0));
        let Material::Principled(b) = &scene.materials["b"] else { panic!("principled") };
        assert!(b.two_sided && matches!(b.roughness, NumberOrTexture::Texture(_)) && b.luminance == Luminance::Colour);
        let Material::PrincipledThin(c) = &scene.materials["c"] else { panic!("principled_thin") };
        assert_eq!(c.diff_trans, NumberOrTexture::Number(2.0));
        let Material::Hair(d) = &scene.materials["d"] else { panic!("hair") };
        assert!(matches!(d.colour, HairColour::Absorption(_)) && d.ior == 1.55);
    }

    /// F0 = 0.08 · specular of ((n - 1) / (n + 1))²; at 2, n = 1.4 / 0.6.
    #[test]
    fn specular_above_one_is_an_index() {
        let contrast = |specular: &str| {
            let text =
                format!("<bsdf type=\"principled\" id=\"a\"><float name=\"specular\" value=\"{specular}\"/></bsdf>");
            let Material::Principled(a) = &good(&text).materials["a"] else { panic!("principled") };
            a.contrast
        };
        assert_eq!(contrast("1"), Contrast::Specular(1.0));
        let Contrast::Eta(eta) = contrast("2") else { panic!("an index") };
        assert!((eta - 1.4 / 0.6).abs() < 1e-15);
        let none = "<bsdf type=\"principled\" id=\"a\"><float name=\"specular\" value=\"12.5\"/></bsdf>";
        assert!(
            fault(none, &[]).contains("specular: expected a number from 0 to 1, found 12.5"),
            "{}",
            fault(none, &[])
        );
    }

    #[test]
    fn an_index_given_twice_is_refused() {
        let text =
            "<bsdf type=\"principled\"><float name=\"eta\" value=\"1\"/><float name=\"specular\" value=\"1\"/></bsdf>";
        let found = fault(text, &[]);
        assert!(found.ends_with("bsdf \"principled\": expected either eta or specular, found both"), "{found}");
    }
}
