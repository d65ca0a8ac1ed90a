//! Materials and textures that hold others by name: none holds itself, and none holds too much.

use std::collections::HashMap;

use super::fault::Checker;
use super::material::{Material, MaterialRef};
use super::path::At;
use super::scene::SceneDescription;
use super::shape::Shape;
use super::texture::Texture;

/// The most layers and materials in a material, and colours and textures in boards within boards, each as often as it is
/// mentioned: it bounds the time of a look-up.
const MOST_PARTS: usize = 4096;

/// The most materials or textures that hold each other.
const DEEPEST: usize = 64;

/// Refuses materials and textures that hold themselves, or too much.
pub(crate) fn check(scene: &SceneDescription, checker: &mut Checker<'_>) {
    let held = |name: &str| scene.materials.get(name).map_or((0, Vec::new()), in_material);
    let mut materials = Nesting::new(["material", "layers and materials"], &held);
    for (name, material) in &scene.materials {
        let at = At::ROOT.key("materials");
        let at = at.key(name);
        materials.named(at, at.key(material.kind()), name, checker);
    }
    for (i, shape) in scene.shapes.iter().enumerate() {
        let at = At::ROOT.key("shapes");
        materials.of_shape(at.index(i), shape, checker);
    }
    for (name, shapes) in &scene.groups {
        for (i, shape) in shapes.iter().enumerate() {
            let at = At::ROOT.key("groups");
            materials.of_shape(at.key(name).index(i), shape, checker);
        }
    }
    let held = |name: &str| scene.textures.get(name).map_or((0, Vec::new()), in_texture);
    let mut textures = Nesting::new(["texture", "colours and textures in boards within boards"], &held);
    for name in scene.textures.keys() {
        let at = At::ROOT.key("textures");
        textures.named(at.key(name), at.key(name), name, checker);
    }
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

/// What is wrong with a name.
#[derive(Clone, Copy)]
enum Wrong {
    HoldsItself,
    TooDeep,
    TooMuch,
}

/// Names of one kind that are looked at.
struct Nesting<'a, 'f> {
    /// What one is called, and what its parts are.
    words: [&'static str; 2],
    /// How many parts are one's own, and which it holds.
    held: &'f dyn Fn(&str) -> (usize, Vec<&'a str>),
    /// How many parts each has. One that is wrong counts as one: what holds it is not wrong for that.
    known: HashMap<&'a str, (usize, Option<Wrong>)>,
    /// From the outermost.
    open: Vec<&'a str>,
}

impl<'a, 'f> Nesting<'a, 'f> {
    fn new(words: [&'static str; 2], held: &'f dyn Fn(&str) -> (usize, Vec<&'a str>)) -> Nesting<'a, 'f> {
        Nesting { words, held, known: HashMap::new(), open: Vec::new() }
    }

    /// The thing `name`, which stands at `at`, its parts at `inner`.
    fn named(&mut self, at: At<'_>, inner: At<'_>, name: &'a str, checker: &mut Checker<'_>) {
        self.parts(name);
        let [word, parts] = self.words;
        match self.known.get(name).and_then(|known| known.1) {
            None => {}
            Some(Wrong::HoldsItself) => {
                checker.fault(at, format!("expected a {word} that does not hold itself, found \"{name}\""));
            }
            Some(Wrong::TooDeep) => {
                checker.fault(at, format!("expected at most {DEEPEST} {word}s that hold each other, found more"));
            }
            Some(Wrong::TooMuch) => {
                checker.fault(inner, format!("expected at most {MOST_PARTS} {parts}, found more"));
            }
        }
    }

    /// How many parts `name` has.
    fn parts(&mut self, name: &'a str) -> usize {
        if let Some(&(parts, _)) = self.known.get(name) {
            return parts;
        }
        let wrong = if self.open.contains(&name) {
            Some(Wrong::HoldsItself)
        } else if self.open.len() == DEEPEST {
            Some(Wrong::TooDeep)
        } else {
            None
        };
        if wrong.is_some() {
            self.known.insert(name, (1, wrong));
            return 1;
        }
        self.open.push(name);
        let parts = self.sum((self.held)(name));
        self.open.pop();
        let known = if parts > MOST_PARTS { (1, Some(Wrong::TooMuch)) } else { (parts, None) };
        self.known.entry(name).or_insert(known).0
    }

    /// How many parts there are of which so many stand by themselves.
    fn sum(&mut self, (own, inner): (usize, Vec<&'a str>)) -> usize {
        inner.into_iter().fold(own, |sum, inner| sum.saturating_add(self.parts(inner)))
    }

    /// The material that stands in `shape`, if one does.
    fn of_shape(&mut self, at: At<'_>, shape: &'a Shape, checker: &mut Checker<'_>) {
        if let MaterialRef::Inline(material) = &shape.material
            && self.sum(in_material(material)) > MOST_PARTS
        {
            let [_, parts] = self.words;
            let message = format!("expected at most {MOST_PARTS} {parts}, found more");
            checker.fault(at.key(shape.geometry.kind()).key("material"), message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::faults as told;

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
        assert_eq!(told(&blends(10)), "none");
        let message = told(&blends(11));
        assert!(
            message.ends_with(": materials.b11.blend: expected at most 4096 layers and materials, found more"),
            "{message}"
        );
        let boards = |last: usize| {
            let next = |k: usize| {
                format!("  t{k:02}: {{checkerboard: {{a: {{texture: t{0:02}}}, b: {{texture: t{0:02}}}}}}}\n", k - 1)
            };
            let first = "textures:\n  t00: {checkerboard: {a: 0.1, b: 0.5}}\n";
            first.to_owned() + &(1..=last).map(next).collect::<String>()
        };
        assert_eq!(told(&boards(11)), "none");
        assert!(told(&boards(12)).contains(": textures.t12: expected at most 4096 colours and textures"));
    }
}
