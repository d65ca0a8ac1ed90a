//! What a person should know of a scene.

use super::Compiler;
use crate::description as written;
use std::collections::BTreeSet;

impl<'a> Compiler<'a> {
    /// Something at `at` that is no fault, once.
    pub(super) fn note(&mut self, at: &str, message: &str) {
        let note = (at.to_owned(), message.to_owned());
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// All notes with their places, but for those on materials that nothing shows.
    pub(super) fn told_notes(&self) -> Vec<String> {
        let mut used = BTreeSet::new();
        let shapes = self.description.shapes.iter().chain(self.description.groups.values().flatten());
        for shape in shapes {
            self.use_material(&shape.material, &mut used);
        }
        let shown = |at: &str| match at.strip_prefix("materials.") {
            Some(rest) => used.iter().any(|name| rest.strip_prefix(name).is_some_and(|rest| rest.starts_with('.'))),
            None => true,
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
