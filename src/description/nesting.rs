//! Materials and textures that hold others by name: none holds itself, and none holds too much.
//!
//! What is rendered is checked as it is made, by the same rules. Here is the check for what only reads a description.

use std::collections::HashMap;

use super::material::{Material, MaterialRef};
use super::path::field;
use super::scene::SceneDescription;
use super::texture::Texture;
use crate::error::{Error, Result};

/// The most layers and materials in a material, and colours and textures in boards within boards, each as often as it is
/// mentioned: it bounds the time of a look-up.
pub(crate) const MOST_PARTS: usize = 4096;

/// The most materials or textures that hold each other.
pub(crate) const DEEPEST: usize = 64;

/// Refuses materials and textures that hold themselves, or too much.
///
/// # Errors
/// [`Error::Config`] with each of them.
pub(crate) fn check(scene: &SceneDescription) -> Result<()> {
    let material = |name: &str| scene.materials.get(name).map_or((0, Vec::new()), in_material);
    let texture = |name: &str| scene.textures.get(name).map_or((0, Vec::new()), in_texture);
    let parts = "layers and materials";
    let mut materials = Nesting::new(scene, ["materials", "material", parts], &material);
    for name in scene.materials.keys() {
        materials.parts(name);
    }
    let parts = "colours and textures in boards within boards";
    let mut textures = Nesting::new(scene, ["textures", "texture", parts], &texture);
    for name in scene.textures.keys() {
        textures.parts(name);
    }
    let faults = [materials.faults, textures.faults].concat();
    if faults.is_empty() { Ok(()) } else { Err(Error::Config(faults.join("\n"))) }
}

/// How many parts are a material's own, and the names of the others.
fn in_material(material: &Material) -> (usize, Vec<&str>) {
    let (mut own, mut names, mut open) = (0, Vec::new(), vec![material]);
    while let Some(material) = open.pop() {
        own += 1;
        for inner in material.inner() {
            match inner {
                MaterialRef::Name(name) => names.push(name.as_str()),
                MaterialRef::Inline(material) => open.push(material),
            }
        }
    }
    (own, names)
}

/// The same of a texture.
fn in_texture(texture: &Texture) -> (usize, Vec<&str>) {
    let names = texture.inner();
    let colours = if matches!(texture, Texture::Checkerboard(_)) { 2 } else { 1 };
    (colours - names.len(), names)
}

/// Names of one kind that are looked at.
struct Nesting<'a, 'f> {
    scene: &'a SceneDescription,
    /// The section, what one is called, and what its parts are.
    words: [&'static str; 3],
    /// How many parts are one's own, and which it holds.
    held: &'f dyn Fn(&str) -> (usize, Vec<&'a str>),
    known: HashMap<&'a str, usize>,
    /// From the outermost.
    open: Vec<&'a str>,
    faults: Vec<String>,
}

impl<'a, 'f> Nesting<'a, 'f> {
    fn new(
        scene: &'a SceneDescription,
        words: [&'static str; 3],
        held: &'f dyn Fn(&str) -> (usize, Vec<&'a str>),
    ) -> Nesting<'a, 'f> {
        Nesting { scene, words, held, known: HashMap::new(), open: Vec::new(), faults: Vec::new() }
    }

    fn fault(&mut self, name: &str, message: &str) {
        let fault = self.scene.fault(&field(&[self.words[0], name]), message);
        if !self.faults.contains(&fault) {
            self.faults.push(fault);
        }
    }

    /// How many parts `name` has. One with a fault counts as one.
    fn parts(&mut self, name: &'a str) -> usize {
        if let Some(parts) = self.known.get(name) {
            return *parts;
        }
        let [_, kind, what] = self.words;
        if self.open.contains(&name) {
            self.fault(name, &format!("expected a {kind} that does not hold itself, found \"{name}\""));
            return 1;
        }
        if self.open.len() == DEEPEST {
            self.fault(name, &format!("expected at most {DEEPEST} {kind}s that hold each other, found more"));
            return 1;
        }
        self.open.push(name);
        let (own, inner) = (self.held)(name);
        let mut parts = inner.into_iter().fold(own, |sum, inner| sum.saturating_add(self.parts(inner)));
        self.open.pop();
        if parts > MOST_PARTS {
            self.fault(name, &format!("expected at most {MOST_PARTS} {what}, found more"));
            parts = 1;
        }
        self.known.insert(name, parts);
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::scene;
    use super::*;

    /// What is said of the scene of these lines, from line 2.
    fn told(text: &str) -> String {
        check(&scene(text)).err().map(|error| error.to_string()).unwrap_or_default()
    }

    /// The blend k has one part more than twice those of the one before: 2^(k + 2) - 1, within 4096 up to the tenth. The board k has
    /// twice the colours: 2^(k + 1), within 4096 up to the eleventh.
    #[test]
    fn nothing_holds_itself_or_more_than_a_look_up_may_take() {
        let itself = |name: &str| format!("expected a {name} that does not hold itself, found ");
        let m = told("materials: {m: {blend: {weight: 0.5, first: m, second: m}}}\n");
        assert_eq!(m, format!("dir/s.yaml:2:16: materials.m: {}\"m\"", itself("material")));
        let m = told(
            "materials: {a.1: {mask: {material: b}}, b: {blend: {weight: 0.5, first: {mask: {material: a.1}}, second: {diffuse: {}}}}}\n",
        );
        assert_eq!(m, format!("dir/s.yaml:2:18: materials.\"a.1\": {}\"a.1\"", itself("material")));
        let t = told("textures: {a: {checkerboard: {a: {texture: a}, b: 0.5}}}\n");
        assert_eq!(t, format!("dir/s.yaml:2:15: textures.a: {}\"a\"", itself("texture")));

        let blends = |last: usize| {
            let next =
                |k: usize| format!("  b{k:02}: {{blend: {{weight: 0.5, first: b{0:02}, second: b{0:02}}}}}\n", k - 1);
            let first =
                "materials:\n  paint: {diffuse: {}}\n  b00: {blend: {weight: 0.5, first: paint, second: paint}}\n";
            first.to_owned() + &(1..=last).map(next).collect::<String>()
        };
        assert_eq!(told(&blends(10)), "");
        let message = told(&blends(11));
        assert!(
            message.ends_with(": materials.b11: expected at most 4096 layers and materials, found more"),
            "{message}"
        );
        let boards = |last: usize| {
            let next = |k: usize| {
                format!("  t{k:02}: {{checkerboard: {{a: {{texture: t{0:02}}}, b: {{texture: t{0:02}}}}}}}\n", k - 1)
            };
            let first = "textures:\n  t00: {checkerboard: {a: 0.1, b: 0.5}}\n";
            first.to_owned() + &(1..=last).map(next).collect::<String>()
        };
        assert_eq!(told(&boards(11)), "");
        assert!(told(&boards(12)).contains(": textures.t12: expected at most 4096 colours and textures"));
    }
}
