//! Materials that are made of others, and numbers that may follow a texture.

use std::collections::HashSet;

use super::super::LEAST_ALPHA;
use super::super::fault::Fault;
use super::super::node::Node;
use super::bsdfs::Sides;
use super::object::{Bag, Family, SpectrumValue, Value};
use super::spectra::Role;
use super::textures::Use;
use super::{Fields, Import, boolean, entry, number, text};

/// Whether two nodes are the same number.
fn same(a: &Node, b: &Node) -> bool {
    matches!((&a.value, &b.value), (super::Value::Float(a), super::Value::Float(b)) if a == b)
}

/// Materials that let light through and are not told whether they have two sides.
const CLEAR: [&str; 6] =
    ["dielectric", "dispersivedielectric", "thindielectric", "roughdielectric", "principledthin", "hair"];

impl Import<'_> {
    /// A number, or `{texture: name}`; `None` where it is not written.
    pub(crate) fn number_or_texture(&mut self, bag: &Bag<'_>, name: &'static str) -> Result<Option<Node>, Fault> {
        self.number_as(bag, name, Use::Numbers)
    }

    fn number_as(&mut self, bag: &Bag<'_>, name: &'static str, used: Use) -> Result<Option<Node>, Fault> {
        let Some(value) = bag.value(name) else { return Ok(None) };
        let place = bag.place(name);
        match value {
            Value::Float(value) => Ok(Some(number(place, *value))),
            Value::Integer(value) => Ok(Some(number(place, *value as f64))),
            Value::Spectrum(SpectrumValue::Uniform(value)) => Ok(Some(number(place, *value))),
            Value::Rgb([r, g, b]) if r == g && g == b => Ok(Some(number(place, *r))),
            Value::Object(index) if bag.document.objects[*index].family == Family::Texture => {
                match self.spectrum_plugin(*index, Role::Coefficient)? {
                    Some(node) if matches!(node.value, super::Value::Float(_)) => Ok(Some(node)),
                    Some(_) => {
                        let found = value.kind(bag.document);
                        let message = format!("expected a float or a texture of numbers, found {found}");
                        Err(bag.fault_of(name, message))
                    }
                    None => {
                        let texture = self.declare_numbers(*index, used)?;
                        Ok(Some(entry(place, "texture", text(place, texture))))
                    }
                }
            }
            other => {
                let found = other.kind(bag.document);
                Err(bag.fault_of(name, format!("expected a float or a texture of numbers, found {found}")))
            }
        }
    }

    /// A share from 0 to 1, to which Mitsuba clamps numbers.
    pub(crate) fn share(&mut self, bag: &Bag<'_>, name: &'static str) -> Result<Option<Node>, Fault> {
        let node = self.number_as(bag, name, Use::Clamped)?;
        Ok(node.map(|node| match node.value {
            super::Value::Float(share) => number(node.place, share.clamp(0.0, 1.0)),
            _ => node,
        }))
    }

    /// A number of 0 or more, to which Mitsuba clamps it, or a texture of those.
    pub(super) fn least(&mut self, bag: &Bag<'_>, name: &'static str) -> Result<Option<Node>, Fault> {
        let node = self.number_as(bag, name, Use::Clamped)?;
        Ok(node.map(|node| match node.value {
            super::Value::Float(x) => number(node.place, x.max(0.0)),
            _ => node,
        }))
    }

    /// `alpha`, or `alpha_u` and `alpha_v`, and `distribution`.
    pub(crate) fn roughness(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
        let clamped = |node: Node| match node.value {
            super::Value::Float(x) => number(node.place, x.max(LEAST_ALPHA)),
            _ => node,
        };
        let is_plastic = bag.object.plugin == "roughplastic";
        let mut alpha = |name| match is_plastic {
            // Plastic is as rough everywhere: by a number, and no spectrum.
            true => Ok(bag.float(name)?.map(|alpha| number(bag.place(name), alpha))),
            false => self.number_as(bag, name, Use::Clamped),
        };
        let brushed = [alpha("alpha_u")?, alpha("alpha_v")?];
        let place = bag.object.place;
        match brushed {
            [None, None] => {
                let alpha = alpha("alpha")?.unwrap_or_else(|| number(place, 0.1));
                fields.add("roughness", clamped(alpha));
            }
            // Plastic is the same along u and v: this is one number for it.
            [Some(u), Some(v)] if !bag.has("alpha") && is_plastic && same(&u, &v) => {
                fields.add("roughness", clamped(u));
            }
            [Some(u), Some(v)] if !bag.has("alpha") => {
                let mut both = Fields::new(place);
                both.add("u", clamped(u));
                both.add("v", clamped(v));
                fields.add("roughness", both.map());
            }
            _ => return Err(bag.fault("expected either alpha, or both alpha_u and alpha_v")),
        }
        let distribution = bag.choice_in_any_case("distribution", &["beckmann", "ggx"])?.unwrap_or("beckmann");
        fields.add("distribution", text(bag.place("distribution"), distribution));
        // How directions are drawn, not which there are.
        bag.boolean("sample_visible")?;
        Ok(())
    }

    /// The one material in another.
    fn covered(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let inner = bag.only(Family::Bsdf)?.ok_or_else(|| bag.fault("expected a <bsdf> inside, found none"))?;
        self.material(inner)
    }

    pub(crate) fn twosided(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let allowed = bag.boolean("allow_transmission")?.unwrap_or(false);
        let inner = bag.objects(Family::Bsdf);
        bag.finish()?;
        if !allowed && let Some(open) = inner.iter().find_map(|index| self.lets_through(*index, &mut HashSet::new())) {
            super::bsdfs::transparent(&self.bag(open), Sides::Both)?;
        }
        match inner[..] {
            // Named once for all who refer to it, it stands on its own.
            [one] if !self.is_compound(one) && !self.is_clear(one) => self.bsdf(one, Sides::Both),
            [one] => {
                let mut fields = Fields::new(bag.object.place);
                fields.add("front", self.material(one)?);
                Ok(fields.kind("two_sided"))
            }
            [front, back] => {
                let mut fields = Fields::new(bag.object.place);
                fields.add("front", self.material(front)?);
                fields.add("back", self.material(back)?);
                Ok(fields.kind("two_sided"))
            }
            _ => Err(bag.fault(format!("expected one <bsdf> inside, or two, found {}", inner.len()))),
        }
    }

    /// A part of a material that lets light through, whatever its other numbers. Materials that were `seen` do not.
    fn lets_through(&self, index: usize, seen: &mut HashSet<usize>) -> Option<usize> {
        if !seen.insert(index) {
            return None;
        }
        let bag = self.bag(index);
        match bag.object.plugin.as_str() {
            "null" | "mask" => Some(index),
            _ if self.is_clear(index) => Some(index),
            _ => bag.objects(Family::Bsdf).into_iter().find_map(|inner| self.lets_through(inner, seen)),
        }
    }

    /// Whether a material is one of those that let light through: `principled` does by its `spec_trans`, unless that is 0.
    fn is_clear(&self, index: usize) -> bool {
        let bag = self.bag(index);
        match bag.object.plugin.as_str() {
            "principled" => !matches!(bag.value("spec_trans"), None | Some(Value::Float(0.0) | Value::Integer(0))),
            plugin => CLEAR.contains(&plugin),
        }
    }

    /// Whether a material is made of others.
    fn is_compound(&self, index: usize) -> bool {
        let plugin = self.document.objects[index].plugin.as_str();
        ["mask", "blendbsdf", "bumpmap", "normalmap", "twosided"].contains(&plugin)
    }

    pub(crate) fn mask(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let mut fields = Fields::new(bag.object.place);
        fields.maybe("opacity", self.share(bag, "opacity")?);
        fields.add("material", self.covered(bag)?);
        bag.finish()?;
        Ok(fields.kind("mask"))
    }

    pub(crate) fn blended(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let mut fields = Fields::new(bag.object.place);
        let weight = self.share(bag, "weight")?;
        fields.add("weight", weight.ok_or_else(|| bag.fault("expected the parameter \"weight\", found none"))?);
        let inner = bag.objects(Family::Bsdf);
        let [first, second] = inner[..] else {
            return Err(bag.fault(format!("expected two <bsdf> inside, found {}", inner.len())));
        };
        fields.add("first", self.material(first)?);
        fields.add("second", self.material(second)?);
        bag.finish()?;
        Ok(fields.kind("blend"))
    }

    pub(crate) fn bump(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        let height = bag.only(Family::Texture)?.ok_or_else(|| bag.fault("expected a <texture> inside, found none"))?;
        let height = self.declare_numbers(height, Use::Numbers)?;
        fields.add("height", entry(place, "texture", text(place, height)));
        if let Some(scale) = bag.float("scale")? {
            fields.add("scale", number(bag.place("scale"), scale));
        }
        self.relief(bag, fields, "bump")
    }

    pub(crate) fn normal_map(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let place = bag.place("normalmap");
        let mut fields = Fields::new(bag.object.place);
        let normals = bag.required("normalmap", bag.object("normalmap", &[Family::Texture]))?;
        let normals = self.declare_numbers(normals, Use::Numbers)?;
        fields.add("normals", entry(place, "texture", text(place, normals)));
        self.relief(bag, fields, "normal_map")
    }

    fn relief(&mut self, bag: &Bag<'_>, mut fields: Fields, kind: &str) -> Result<Node, Fault> {
        for (ours, theirs) in [("turn", "flip_invalid_normals"), ("shadowing", "use_shadowing_function")] {
            if let Some(on) = bag.boolean(theirs)? {
                fields.add(ours, boolean(bag.place(theirs), on));
            }
        }
        fields.add("material", self.covered(bag)?);
        bag.finish()?;
        Ok(fields.kind(kind))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::{Material, MaterialRef, NumberOrTexture, Spectrum, SpectrumOrTexture, Texture};
    use super::super::tests::{fault, good};

    /// The material of a sphere.
    fn material(bsdf: &str) -> Material {
        let scene = good(&format!("<shape type=\"sphere\">{bsdf}</shape>"));
        let MaterialRef::Inline(material) = &scene.shapes[0].material else { panic!("in place") };
        (*material).clone()
    }

    /// Mitsuba 3.9.1 gives the pictures of 1 for 2, and those of 0 for -1.
    #[test]
    fn shares_are_clamped() {
        for (written, share) in [("2", 1.0), ("-1", 0.0), ("0.5", 0.5)] {
            let number = |name: &str| format!("<float name=\"{name}\" value=\"{written}\"/><bsdf type=\"diffuse\"/>");
            let Material::Mask(mask) = material(&format!("<bsdf type=\"mask\">{}</bsdf>", number("opacity"))) else {
                panic!("a mask")
            };
            assert_eq!(mask.opacity, NumberOrTexture::Number(share));
            let blend = format!("<bsdf type=\"blendbsdf\">{}<bsdf type=\"diffuse\"/></bsdf>", number("weight"));
            let Material::Blend(blend) = material(&blend) else { panic!("a blend") };
            assert_eq!(blend.weight, NumberOrTexture::Number(share));
        }
    }

    /// So are those of the squares of a board, by which Mitsuba 3.9.1 gives the pictures of 0 for -1, too; not where it clamps nothing.
    #[test]
    fn squares_of_shares_are_clamped() {
        let board = |name: &str| {
            format!(
                "<texture type=\"checkerboard\" name=\"{name}\" id=\"t\"><float name=\"color0\" value=\"-1\"/>\
                 <float name=\"color1\" value=\"0.5\"/></texture>"
            )
        };
        let of = |bsdf: &str| good(&format!("<shape type=\"sphere\">{bsdf}</shape>")).textures["t as numbers"].clone();
        let mask = format!("<bsdf type=\"mask\">{}<bsdf type=\"diffuse\"/></bsdf>", board("opacity"));
        let metal = format!("<bsdf type=\"roughconductor\">{}</bsdf>", board("alpha"));
        for bsdf in [mask, metal] {
            let Texture::Checkerboard(board) = of(&bsdf) else { panic!("a board") };
            let number = |x: f64| SpectrumOrTexture::Spectrum(Spectrum::Number(x));
            assert_eq!((board.b, board.a), (number(0.0), number(0.5)));
        }
        let burley = format!("<shape type=\"sphere\"><bsdf type=\"principled\">{}</bsdf></shape>", board("roughness"));
        assert!(fault(&burley, &[]).contains("expected a number of 0 or more, found -1"), "{}", fault(&burley, &[]));
    }

    /// What is the same everywhere and at all wavelengths is a number, in whatever words.
    #[test]
    fn grey_is_a_number() {
        let words = [
            "<rgb name=\"NAME\" value=\"0.25\"/>",
            "<spectrum name=\"NAME\" value=\"0.25\"/>",
            "<spectrum type=\"uniform\" name=\"NAME\"><float name=\"value\" value=\"0.25\"/></spectrum>",
            "<texture type=\"rawconstant\" name=\"NAME\"><float name=\"value\" value=\"0.25\"/></texture>",
            "<spectrum type=\"srgb\" name=\"NAME\"><rgb name=\"color\" value=\"0.25\"/></spectrum>",
        ];
        for word in words {
            let mask =
                format!("<bsdf type=\"mask\">{}<bsdf type=\"diffuse\"/></bsdf>", word.replace("NAME", "opacity"));
            let Material::Mask(mask) = material(&mask) else { panic!("a mask") };
            assert_eq!(mask.opacity, NumberOrTexture::Number(0.25), "{word}");
            let phase = format!(
                "<medium type=\"homogeneous\"><phase type=\"blendphase\">{}<phase type=\"isotropic\"/><phase type=\"rayleigh\"/>\
                 </phase></medium>",
                word.replace("NAME", "weight")
            );
            assert_eq!(fault(&phase, &[]), "none", "{word}");
        }
        let told =
            |word: &str| fault(&format!("<bsdf type=\"mask\" id=\"m\">{word}<bsdf type=\"diffuse\"/></bsdf>"), &[]);
        let green = told("<rgb name=\"opacity\" value=\"0, 1, 0\"/>");
        assert!(green.ends_with("opacity: expected a float or a texture of numbers, found an rgb colour"), "{green}");
        let day = told("<spectrum type=\"d65\" name=\"opacity\"/>");
        assert!(day.ends_with("expected a float or a texture of numbers, found the texture \"d65\""), "{day}");
    }

    /// So it is for Mitsuba 3.9.1, unless allow_transmission is true.
    #[test]
    fn what_has_two_sides_lets_nothing_through() {
        let told = |inside: &str, allowed: &str| {
            fault(&format!("<bsdf type=\"twosided\" id=\"m\">{allowed}{inside}</bsdf>"), &[])
        };
        let mask = "<bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf>";
        let blend = "<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.5\"/><bsdf type=\"diffuse\"/><bsdf type=\"null\"/></bsdf>";
        for open in [mask, blend, "<bsdf type=\"null\"/>", "<bsdf type=\"dielectric\"/>"] {
            assert!(told(open, "").ends_with("lets no light through inside <twosided>"), "{open}: {}", told(open, ""));
        }
        let allowed = "<boolean name=\"allow_transmission\" value=\"true\"/>";
        for open in [mask, blend, "null", "thindielectric", "principledthin", "hair"] {
            let inside = if open.starts_with('<') { open.to_owned() } else { format!("<bsdf type=\"{open}\"/>") };
            assert_eq!(told(&inside, allowed), "none", "{open}");
        }
        assert_eq!(told("<bsdf type=\"diffuse\"/>", ""), "none");
        let burley = |share: &str| format!("<bsdf type=\"principled\">{share}</bsdf>");
        for none in ["", "<float name=\"spec_trans\" value=\"0\"/>"] {
            assert_eq!(told(&burley(none), ""), "none");
        }
        let half = "<float name=\"spec_trans\" value=\"0.5\"/>";
        for some in [half, "<texture type=\"checkerboard\" name=\"spec_trans\"/>"] {
            let expected =
                "\"principled\": spec_trans: expected a surface that lets no light through inside <twosided>";
            assert!(told(&burley(some), "").ends_with(expected), "{}", told(&burley(some), ""));
        }
        assert_eq!(told(&burley(half), allowed), "none");
    }

    #[test]
    fn rough_plastic_may_say_twice_how_rough_it_is() {
        let plastic = |v: &str| {
            format!(
                "<bsdf type=\"roughplastic\"><float name=\"alpha_u\" value=\"0.2\"/><float name=\"alpha_v\" value=\"{v}\"/></bsdf>"
            )
        };
        let once = "<bsdf type=\"roughplastic\"><float name=\"alpha\" value=\"0.2\"/></bsdf>";
        assert_eq!(material(&plastic("0.2")), material(once));
        assert_ne!(fault(&format!("<shape type=\"sphere\">{}</shape>", plastic("0.3")), &[]), "none");
        for value in ["spectrum name=\"alpha\" value=\"0.2\"", "rgb name=\"alpha\" value=\"0.2\""] {
            let told =
                fault(&format!("<shape type=\"sphere\"><bsdf type=\"roughplastic\"><{value}/></bsdf></shape>"), &[]);
            assert!(told.contains("alpha: expected a float, found "), "{told}");
        }
    }
}
