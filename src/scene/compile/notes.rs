//! What a person should know of a scene.

use super::Compiler;
use crate::description as written;
use std::collections::BTreeSet;
use std::ops::Bound;

impl<'a> Compiler<'a> {
    /// Something at `at` that is no fault, once.
    pub(super) fn note(&mut self, at: &str, message: &str) {
        let note = (at.to_owned(), message.to_owned());
        if self.noted.insert(note.clone()) {
            self.notes.push(note);
        }
    }

    /// Tells of a filter that draws no rays: those of `whitted` stand on a grid.
    pub(super) fn note_unused_filter(&mut self) {
        let whitted = matches!(self.description.integrator, written::Integrator::Whitted(_));
        if whitted && self.description.image.filter != written::Filter::Box {
            self.note(
                "image.filter",
                "whitted takes no filter: a pixel is the mean of its grid of rays, as under a box",
            );
        }
    }

    /// All notes with their places, but for those on materials that nothing shows.
    pub(super) fn told_notes(&self) -> Vec<String> {
        let mut used = BTreeSet::new();
        let shapes = self.description.shapes.iter().chain(self.description.groups.values().flatten());
        for shape in shapes {
            self.use_material(&shape.material, &mut used);
        }
        // As their fields begin. With the dot at its end nothing stands in order between one and its fields.
        let used: BTreeSet<String> = used.into_iter().map(|name| written::field(&["materials", name]) + ".").collect();
        let shown = |at: &str| {
            let before = used.range::<str, _>((Bound::Unbounded, Bound::Included(at))).next_back();
            !at.starts_with("materials.") || before.is_some_and(|name| at.starts_with(name.as_str()))
        };
        let notes = self.notes.iter().filter(|(at, _)| shown(at));
        let read = self.description.locator.notes();
        read.into_iter().chain(notes.map(|(at, message)| self.description.fault(at, message))).collect()
    }

    /// Adds the names of a material and of all that are in it.
    fn use_material(&self, material: &'a written::MaterialRef, used: &mut BTreeSet<&'a str>) {
        let material = match material {
            written::MaterialRef::Name(name) => {
                if !used.insert(name) {
                    return;
                }
                &self.description.materials[name]
            }
            written::MaterialRef::Inline(material) => material,
        };
        for material in material.inner() {
            self.use_material(material, used);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::compile::testing::compiled;

    fn notes(text: &str) -> Vec<String> {
        let text = format!("camera: {{origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}}\n{text}");
        compiled(&text).notes
    }

    /// Materials that something has are told of, whatever their names; those that nothing has are not, though their names begin
    /// alike.
    #[test]
    fn materials_that_are_used_are_told_of_by_any_name() {
        let glass = "{dielectric: {ior: 0.9}}";
        let text = format!(
            "materials: {{\"dark red\": {glass}, a: {glass}, a-b: {glass}, a.b: {glass}, ab: {glass}}}\nshapes:\n\
             - sphere: {{center: [0, 0, 0], radius: 1, material: dark red}}\n\
             - sphere: {{center: [3, 0, 0], radius: 1, material: a}}\n\
             - sphere: {{center: [6, 0, 0], radius: 1, material: a.b}}\n"
        );
        let told = notes(&text);
        let names = ["materials.a.", "materials.\"a.b\".", "materials.\"dark red\"."];
        assert_eq!(told.len(), names.len(), "{told:?}");
        for name in names {
            assert!(told.iter().any(|note| note.contains(name)), "{name}: {told:?}");
        }
    }

    /// Without a texture a spot looks alike all around its axis.
    #[test]
    fn what_a_spot_says_of_no_texture_is_told() {
        let spot = |more: &str| {
            notes(&format!(
                "textures: {{t: {{checkerboard: {{a: 0, b: 1}}}}}}\n\
                 lights: [{{spot: {{position: [0, 3, 0], target: [0, 0, 0], intensity: 1{more}}}}}]\n"
            ))
        };
        let idle = spot(", up: [1, 0, 0], v: down");
        assert_eq!(idle.len(), 2, "{idle:?}");
        for (note, field) in idle.iter().zip(["up", "v"]) {
            assert!(
                note.ends_with(&format!("lights[0].spot.{field}: it is the texture's, and there is none")),
                "{note}"
            );
        }
        assert_eq!(spot(""), [""; 0]);
        assert_eq!(spot(", up: [1, 0, 0], v: down, texture: t"), [""; 0]);
    }

    #[test]
    fn a_filter_that_whitted_does_not_take_is_told() {
        let text = |filter: &str, integrator: &str| format!("image: {{filter: {filter}}}\nintegrator: {integrator}\n");
        let message = "whitted takes no filter: a pixel is the mean of its grid of rays, as under a box";
        assert_eq!(
            notes(&text("{gaussian: {stddev: 2}}", "whitted")),
            [format!("s.yaml:2:17: image.filter: {message}")]
        );
        for [filter, integrator] in
            [["box", "whitted"], ["mitchell", "path"], ["mitchell", "light_tracer"], ["mitchell", "depth"]]
        {
            assert_eq!(notes(&text(filter, integrator)), Vec::<String>::new(), "{filter}, {integrator}");
        }
    }

    /// Tens of thousands of lamps on the floor: if each name were sought among all they would take a minute.
    #[test]
    fn many_lamps_on_a_floor_take_no_quadratic_time() {
        const MANY: usize = 30_000;
        let begin = std::time::Instant::now();
        let mut text = "shapes: [plane: {normal: [0, 1, 0]}]\nlights:\n".to_owned();
        (0..MANY).for_each(|i| text += &format!("- point: {{position: [{i}, 0, -3], intensity: 1}}\n"));
        let told = notes(&text);
        assert_eq!(told.len(), MANY);
        assert!(told[MANY - 1].contains(&format!("lights[{}].point: lies on plane0", MANY - 1)), "{}", told[MANY - 1]);
        assert!(begin.elapsed() < std::time::Duration::from_secs(20));
    }
}
