//! Integrators: the fields `integrator` and `layers`.

use std::collections::HashSet;

use super::super::fault::Fault;
use super::super::node::{Node, Place, quote};
use super::object::{Bag, Document, Family, Object, Value};
use super::{Fields, Import, boolean, list, text, whole};

const INTEGRATORS: [&str; 8] = ["path", "volpath", "volpathmis", "direct", "ptracer", "depth", "aov", "moment"];

/// What `aov` can show, by its name and by ours.
const QUANTITIES: [(&str, &str); 12] = [
    ("albedo", "albedo"),
    ("depth", "depth"),
    ("position", "position"),
    ("uv", "uv"),
    ("geo_normal", "geometric_normal"),
    ("sh_normal", "shading_normal"),
    ("dp_du", "dp_du"),
    ("dp_dv", "dp_dv"),
    ("duv_dx", "duv_dx"),
    ("duv_dy", "duv_dy"),
    ("prim_index", "primitive"),
    ("shape_index", "shape"),
];

/// Whether the scene's integrator sees media. Mitsuba's `path`, `direct` and `ptracer` do not: light goes through as if there
/// were none. What is written in the grammar does.
///
/// # Errors
/// Where there are media and one of several integrators sees them and another does not.
pub(super) fn sees_media(document: &Document) -> Result<bool, Fault> {
    let objects = Bag::new(document, 0).objects(Family::Integrator);
    let mut known: Option<(usize, bool)> = None;
    let mut open = objects;
    let mut seen = HashSet::new();
    while let Some(index) = open.pop() {
        if !seen.insert(index) {
            continue;
        }
        let bag = Bag::new(document, index);
        let sees = match bag.object.plugin.as_str() {
            _ if bag.written().is_some() => true,
            "volpath" | "volpathmis" => true,
            "path" | "direct" | "ptracer" => false,
            _ => {
                open.extend(bag.objects(Family::Integrator));
                continue;
            }
        };
        match known {
            Some((other, seen)) if seen != sees && has_media(document) => {
                let [with, without] = if sees { [index, other] } else { [other, index] };
                let [with, without] = [with, without].map(|i| quote(&document.objects[i].plugin));
                let message = format!(
                    "expected integrators that all see the scene's media, or none, found {with} beside {without}, which does not"
                );
                return Err(Fault::at_place(bag.object.place, message));
            }
            _ => known = Some((index, sees)),
        }
    }
    Ok(known.is_none_or(|(_, sees)| sees))
}

/// Whether a scene has media.
pub(super) fn has_media(document: &Document) -> bool {
    document.objects.iter().any(|object| object.family == Family::Medium)
}

/// What computes the picture, and its further channels.
struct Translated {
    integrator: Node,
    layers: Vec<Layer>,
}

/// A further layer.
struct Layer {
    place: Place,
    name: String,
    content: Content,
    /// The name of the layer of squares.
    squares: Option<String>,
}

enum Content {
    Surface(&'static str),
    Light { of: Node, form: &'static str },
}

impl Import<'_> {
    /// The fields `integrator` and `layers`.
    pub(crate) fn integrator(&mut self, index: usize) -> Result<Fields, Fault> {
        let place = self.bag(index).object.place;
        let Translated { integrator, layers } = self.translated(index)?;
        let mut all = Fields::new(place);
        all.add("integrator", integrator);
        if !layers.is_empty() {
            all.add("layers", list(place, layers.into_iter().map(Layer::node)));
        }
        Ok(all)
    }

    fn translated(&mut self, index: usize) -> Result<Translated, Fault> {
        let bag = self.bag(index);
        if let Some(node) = bag.written() {
            return Ok(Translated { integrator: node, layers: Vec::new() });
        }
        let mut fields = Fields::new(bag.object.place);
        common(&bag)?;
        let kind = match bag.object.plugin.as_str() {
            // Ours weighs by all wavelengths and all techniques as `volpathmis` does.
            "path" | "volpath" | "volpathmis" => {
                if bag.object.plugin == "volpathmis" {
                    bag.boolean("use_spectral_mis")?;
                }
                hide_emitters(&bag, &mut fields)?;
                depth(&bag, &mut fields)?;
                fields.add("opaque_sky", boolean(bag.object.place, true));
                fields.add("coverage", text(bag.object.place, "scattering"));
                fields.add("delta_caustics", boolean(bag.object.place, false));
                if bag.object.plugin == "path" {
                    // Panes and null surfaces are vertices for it, unlike for the two that know media.
                    fields.add("count_crossings", boolean(bag.object.place, true));
                }
                "path"
            }
            "direct" => {
                hide_emitters(&bag, &mut fields)?;
                fields.add("max_depth", whole(bag.object.place, 2));
                fields.add("coverage", text(bag.object.place, "first_hit"));
                // What shines through a pane has met two things.
                fields.add("count_crossings", boolean(bag.object.place, true));
                fields.add("delta_caustics", boolean(bag.object.place, false));
                samples_of_direct(&bag, &mut fields)?;
                "path"
            }
            "ptracer" => {
                hide_emitters(&bag, &mut fields)?;
                depth(&bag, &mut fields)?;
                fields.add("count_crossings", boolean(bag.object.place, true));
                "light_tracer"
            }
            "depth" => {
                bag.boolean("hide_emitters")?;
                "depth"
            }
            "aov" => return self.aov(&bag),
            "moment" => return self.moment(&bag),
            _ => return Err(bag.unknown(INTEGRATORS)),
        };
        bag.finish()?;
        // Paths that may not even meet a lamp show nothing.
        let integrator = match bag.integer("max_depth")? {
            Some(0) => Fields::new(bag.place("max_depth")).kind("none"),
            _ => fields.kind(kind),
        };
        Ok(Translated { integrator, layers: Vec::new() })
    }

    /// What lies inside an integrator, with its name.
    fn nested(&mut self, bag: &Bag<'_>) -> Result<Vec<(String, Place, Translated)>, Fault> {
        bag.boolean("hide_emitters")?;
        let inside = bag.objects(Family::Integrator);
        let mut all = Vec::new();
        for index in inside {
            let place = self.bag(index).object.place;
            let translated = self.translated(index)?;
            // It is a layer; those within it have counted themselves.
            self.again(index, &translated.integrator)?;
            all.push((name_of(bag.object, index), place, translated));
        }
        Ok(all)
    }

    /// Each integrator inside gives a layer of colour; the first gives the picture.
    fn aov(&mut self, bag: &Bag<'_>) -> Result<Translated, Fault> {
        let nested = self.nested(bag)?;
        let mut layers = Vec::new();
        let mut picture = None;
        let mut further = Vec::new();
        for (name, place, Translated { integrator, layers: inner }) in nested {
            layers.push(Layer::light(place, name.clone(), integrator.clone(), "rgba"));
            further.extend(inner.into_iter().map(|layer| layer.within(&name)));
            picture.get_or_insert(integrator);
        }
        layers.extend(further);
        let place = bag.place("aovs");
        let written = bag.required("aovs", bag.text("aovs"))?;
        for token in written.split([' ', ',']).filter(|token| !token.is_empty()) {
            let quantity = |kind: &str| QUANTITIES.iter().find(|(theirs, _)| *theirs == kind).map(|(_, ours)| *ours);
            let parts: Vec<&str> = token.split(':').filter(|part| !part.is_empty()).collect();
            let (name, quantity) = match parts[..] {
                [name, kind] => (name, quantity(kind)),
                _ => ("", None),
            };
            let Some(quantity) = quantity else {
                let known: Vec<&str> = QUANTITIES.iter().map(|(theirs, _)| *theirs).collect();
                let message = format!("expected name:type with a type among {}, found {token:?}", known.join(", "));
                return Err(bag.fault_of("aovs", message));
            };
            layers.push(Layer { place, name: name.to_owned(), content: Content::Surface(quantity), squares: None });
        }
        bag.finish()?;
        let none = || Fields::new(bag.object.place).kind("none");
        Ok(Translated { integrator: picture.unwrap_or_else(none), layers })
    }

    /// Each integrator inside gives a layer of XYZ, and all have their squares.
    fn moment(&mut self, bag: &Bag<'_>) -> Result<Translated, Fault> {
        let nested = self.nested(bag)?;
        let mut layers = Vec::new();
        let mut picture = None;
        for (name, place, Translated { integrator, layers: inner }) in nested {
            if inner.iter().any(|layer| layer.squares.is_some()) {
                return Err(bag.fault("expected integrators without moments inside, found moments of moments"));
            }
            layers.extend(inner.into_iter().map(|layer| layer.within(&name)));
            layers.push(Layer::light(place, name, integrator.clone(), "xyz"));
            picture.get_or_insert(integrator);
        }
        layers.iter_mut().for_each(|layer| layer.squares = Some(format!("m2_{}", layer.name)));
        bag.finish()?;
        let integrator = picture.ok_or_else(|| bag.fault("expected an <integrator> inside, found none"))?;
        Ok(Translated { integrator, layers })
    }
}

impl Layer {
    fn light(place: Place, name: String, of: Node, form: &'static str) -> Layer {
        Layer { place, name, content: Content::Light { of, form }, squares: None }
    }

    fn within(self, outer: &str) -> Layer {
        let within = |name: String| format!("{outer}.{name}");
        Layer { name: within(self.name), squares: self.squares.map(within), ..self }
    }

    fn node(self) -> Node {
        let mut fields = Fields::new(self.place);
        fields.add("name", text(self.place, self.name));
        match self.content {
            Content::Surface(quantity) => fields.add("surface", text(self.place, quantity)),
            Content::Light { of, form } => {
                fields.add("light", of);
                fields.add("form", text(self.place, form));
            }
        }
        if let Some(name) = self.squares {
            fields.add("squares", boolean(self.place, true));
            fields.add("squares_name", text(self.place, name));
        }
        fields.map()
    }
}

/// The name under which an object lies in another: unnamed ones are counted.
fn name_of(outer: &Object, index: usize) -> String {
    let objects = outer.properties.iter().filter_map(|property| match property.value {
        Value::Object(i) => Some((property.name.as_str(), i)),
        _ => None,
    });
    let mut unnamed = 0;
    for (name, i) in objects {
        if i == index {
            return if name.is_empty() { format!("_arg_{unnamed}") } else { name.to_owned() };
        }
        unnamed += u32::from(name.is_empty());
    }
    String::new()
}

/// What every integrator has and what says nothing about the picture.
fn common(bag: &Bag<'_>) -> Result<(), Fault> {
    bag.integer("block_size")?;
    bag.integer("samples_per_pass")?;
    bag.float("timeout")?;
    Ok(())
}

fn hide_emitters(bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
    if let Some(hide) = bag.boolean("hide_emitters")? {
        fields.add("hide_emitters", boolean(bag.place("hide_emitters"), hide));
    }
    Ok(())
}

/// Shadow rays and scattered rays of `direct`.
fn samples_of_direct(bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
    let both = bag.integer("shading_samples")?;
    for (theirs, ours) in [("emitter_samples", "light_samples"), ("bsdf_samples", "scatter_samples")] {
        let own = bag.integer(theirs)?;
        if own.is_some() && both.is_some() {
            return Err(bag.fault_of(theirs, "expected either shading_samples or this, found both"));
        }
        let name = if own.is_some() { theirs } else { "shading_samples" };
        if let Some(count) = own.or(both) {
            fields.add(ours, whole(bag.place(name), count));
        }
    }
    Ok(())
}

fn depth(bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
    match bag.integer("max_depth")? {
        None | Some(-1) => {}
        Some(depth) if depth < -1 => {
            let message = format!("expected -1, for no limit, or a whole number of 0 or more, found {depth}");
            return Err(bag.fault_of("max_depth", message));
        }
        Some(depth) => fields.add("max_depth", whole(bag.place("max_depth"), depth)),
    }
    if let Some(depth) = bag.integer("rr_depth")? {
        fields.add("roulette_depth", whole(bag.place("rr_depth"), depth));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::super::{Coverage, Integrator, LayerContent, LightForm, PathIntegrator, Quantity};
    use super::super::tests::{fault, good};

    #[test]
    fn a_moment_is_a_picture_with_xyz_and_squares() {
        let scene = good(
            "<integrator type=\"moment\"><integrator type=\"direct\"><integer name=\"shading_samples\" value=\"4\"/>\
             <boolean name=\"hide_emitters\" value=\"true\"/></integrator></integrator>",
        );
        let direct = Integrator::Path(PathIntegrator {
            max_depth: Some(2),
            hide_emitters: true,
            light_samples: 4,
            scatter_samples: 4,
            count_crossings: true,
            delta_caustics: false,
            coverage: Coverage::FirstHit,
            ..PathIntegrator::default()
        });
        assert_eq!(scene.integrator, direct);
        let [layer] = &scene.layers[..] else { panic!("one layer") };
        assert_eq!((layer.name.as_str(), layer.squares.as_deref()), ("_arg_0", Some("m2__arg_0")));
        assert_eq!(layer.content, LayerContent::Light { of: Some(direct), form: LightForm::Xyz });
    }

    /// Mitsuba 3.9.1's `path`, `direct` and `ptracer` give a ball of fog the picture of a ball of nothing.
    #[test]
    fn media_are_for_the_integrators_that_see_them() {
        let fog = "<medium type=\"homogeneous\" id=\"fog\"/><shape type=\"sphere\"><bsdf type=\"null\"/>\
                   <ref name=\"interior\" id=\"fog\"/></shape>";
        let inside = |integrator: &str| good(&format!("{integrator}{fog}")).shapes[0].inside.clone();
        let one = |plugin: &str| format!("<integrator type=\"{plugin}\"/>");
        for plugin in ["path", "direct", "ptracer"] {
            assert_eq!(inside(&one(plugin)), None, "{plugin}");
        }
        for plugin in ["volpath", "volpathmis", "depth"] {
            assert_eq!(inside(&one(plugin)).as_deref(), Some("fog"), "{plugin}");
        }
        assert_eq!(inside("").as_deref(), Some("fog"));
        let moment = |inner: &str| format!("<integrator type=\"moment\">{inner}</integrator>");
        assert_eq!(inside(&moment(&one("direct"))), None);
        let aov = format!(
            "<integrator type=\"aov\"><string name=\"aovs\" value=\"d:depth\"/>{}</integrator>",
            one("volpath")
        );
        assert_eq!(inside(&moment(&aov)).as_deref(), Some("fog"));
        // They have to hold all the same.
        let bad = format!("{}{}", one("path"), fog.replace("homogeneous", "homogenous"));
        assert!(fault(&bad, &[]).contains("expected a medium that Abbe has"), "{}", fault(&bad, &[]));
        let both = moment(&(one("path") + &one("volpath")));
        assert_eq!(fault(&both, &[]), "none");
        let told = fault(&format!("{both}{fog}"), &[]);
        assert!(told.ends_with("found \"volpath\" beside \"path\", which does not"), "{told}");
    }

    /// Black and transparent for Mitsuba 3.9.1, too.
    #[test]
    fn paths_of_no_depth_show_nothing() {
        for plugin in ["path", "volpath", "volpathmis", "ptracer"] {
            let depth = |n: i32| {
                format!("<integrator type=\"{plugin}\"><integer name=\"max_depth\" value=\"{n}\"/></integrator>")
            };
            assert!(matches!(good(&depth(0)).integrator, Integrator::None(_)));
            assert!(!matches!(good(&depth(1)).integrator, Integrator::None(_)));
            let told = fault(&depth(-2), &[]);
            let expected = "max_depth: expected -1, for no limit, or a whole number of 0 or more, found -2";
            assert!(told.ends_with(expected), "{told}");
        }
    }

    #[test]
    fn aovs_stand_beside_the_integrators_that_they_hold() {
        let scene = good(
            "<integrator type=\"aov\"><string name=\"aovs\" value=\"dd.y:depth,nn:sh_normal\"/>\
             <integrator type=\"depth\" name=\"d\"/><integrator type=\"path\"/></integrator>",
        );
        let names: Vec<&str> = scene.layers.iter().map(|layer| layer.name.as_str()).collect();
        assert_eq!(names, ["d", "_arg_0", "dd.y", "nn"]);
        assert!(matches!(scene.integrator, Integrator::Depth(_)));
        assert_eq!(scene.layers[3].content, LayerContent::Surface(Quantity::ShadingNormal));
        let alone = good("<integrator type=\"aov\"><string name=\"aovs\" value=\"a:uv\"/></integrator>");
        assert!(matches!(alone.integrator, Integrator::None(_)));
    }

    /// Mitsuba 3.9.1 calls these channels m.p.X, m.m2_p.X and a.d.T, m2_a.d.T, a.X, m2_a.X.
    #[test]
    fn squares_are_named_where_the_moments_are_taken() {
        let squares = |text: &str| -> Vec<(String, Option<String>)> {
            good(text).layers.into_iter().map(|layer| (layer.name, layer.squares)).collect()
        };
        let named = |name: &str, squares: Option<&str>| (name.to_owned(), squares.map(str::to_owned));
        let within = "<integrator type=\"aov\"><string name=\"aovs\" value=\"d:depth\"/>\
                      <integrator type=\"moment\" name=\"m\"><integrator type=\"path\" name=\"p\"/></integrator></integrator>";
        assert_eq!(squares(within), [named("m", None), named("m.p", Some("m.m2_p")), named("d", None)]);
        let around = "<integrator type=\"moment\"><integrator type=\"aov\" name=\"a\">\
                      <string name=\"aovs\" value=\"d:depth\"/></integrator></integrator>";
        assert_eq!(squares(around), [named("a.d", Some("m2_a.d")), named("a", Some("m2_a"))]);
    }

    #[test]
    fn what_is_inside_has_to_be_there_and_to_be_known() {
        assert_eq!(
            fault("<integrator type=\"moment\"/>", &[]),
            "s.xml:3:1: integrator \"moment\": expected an <integrator> inside, found none"
        );
        let aov = |aovs: &str| {
            fault(&format!("<integrator type=\"aov\"><string name=\"aovs\" value=\"{aovs}\"/></integrator>"), &[])
        };
        assert!(aov("nn").contains("aovs: expected name:type with a type among albedo, depth"), "{}", aov("nn"));
        assert!(aov("nn:normal").ends_with("found \"nn:normal\""), "{}", aov("nn:normal"));
        // So they do to Mitsuba 3.9.1: semicolons part nothing, colons at the ends say nothing, and names may come twice.
        assert!(aov("a:depth;b:uv").ends_with("found \"a:depth;b:uv\""), "{}", aov("a:depth;b:uv"));
        assert_eq!(aov("a:depth, a:uv a:albedo:,"), "none");
        assert!(aov("a:depth,a:depth").ends_with("expected a name of its own, found \"a\" again"));
        let two = "<integrator type=\"direct\"><integer name=\"shading_samples\" value=\"4\"/>\
                   <integer name=\"bsdf_samples\" value=\"4\"/></integrator>";
        assert!(fault(two, &[]).ends_with("expected either shading_samples or this, found both"));
    }
}
