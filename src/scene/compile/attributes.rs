//! Textures that are attributes of the mesh they lie on.
//!
//! Such a texture, and with it a material that holds one, is another one on each mesh: neither is kept by
//! name for longer than its mesh, and the material is compiled anew for each shape that has it.

use super::Compiler;
use crate::description as written;
use crate::scene::material::Material;
use crate::scene::mesh::attribute::AttributeTexture;
use crate::scene::mesh::{Mesh, MeshSource};
use crate::scene::texture::{Scalar, Texture};
use std::collections::HashMap;
use std::sync::Arc;

/// The surface that a material is compiled for.
pub(super) enum Surface {
    /// Any.
    Unknown,
    /// One without attributes.
    Shape,
    /// None: a light throws it.
    Light,
    /// A mesh.
    Mesh(OfMesh),
}

/// What is another on each surface, by name, as it is on the one at hand.
#[derive(Default)]
pub(super) struct AtHand<'a> {
    pub(super) textures: HashMap<&'a str, Texture>,
    pub(super) numbers: HashMap<&'a str, Scalar>,
    pub(super) materials: HashMap<&'a str, Arc<Material>>,
}

/// The attributes of a mesh, and its triangles as they lie in the world.
pub(super) struct OfMesh {
    source: Arc<MeshSource>,
    triangles: Vec<[u32; 3]>,
}

impl OfMesh {
    pub(super) fn new(source: Arc<MeshSource>, mesh: &Mesh) -> OfMesh {
        // Only attributes need them.
        let triangles = if source.attributes.is_empty() { Vec::new() } else { mesh.triangles.clone() };
        OfMesh { source, triangles }
    }
}

impl<'a> Compiler<'a> {
    /// From here on textures lie on `surface`.
    pub(super) fn lie_on(&mut self, surface: Surface) {
        self.surface = surface;
        self.at_hand = AtHand::default();
    }

    /// What is known of the surface at hand; who uses it asks for that.
    pub(super) fn kept<T: Clone>(&mut self, of: impl for<'b> FnOnce(&'b AtHand<'a>) -> Option<&'b T>) -> Option<T> {
        let known = of(&self.at_hand).cloned();
        self.asks_for_surface |= known.is_some();
        known
    }

    /// What `make` makes, and whether it asked for the surface.
    pub(super) fn asking<T>(&mut self, make: impl FnOnce(&mut Self) -> T) -> (T, bool) {
        let before = std::mem::take(&mut self.asks_for_surface);
        let made = make(self);
        let asked = self.asks_for_surface;
        self.asks_for_surface |= before;
        (made, asked)
    }

    /// The attribute that `texture` names, of the mesh at hand; `None` where the surface is not known, or after a
    /// fault.
    pub(super) fn attribute(&mut self, at: &str, texture: &'a written::MeshAttribute) -> Option<AttributeTexture> {
        self.asks_for_surface = true;
        let name = texture.name.as_str();
        let message = match &self.surface {
            Surface::Unknown => return None,
            Surface::Shape => format!("expected a mesh that has the attribute {name}, found another shape"),
            Surface::Light => format!("expected a mesh that has the attribute {name}, found a light that throws it"),
            Surface::Mesh(mesh) => {
                let attributes = &mesh.source.attributes;
                match attributes.iter().find(|a| a.name == name) {
                    Some(a) => match a.values.iter().find(|x| a.channels == 3 && !(0.0..=1.0).contains(*x)) {
                        None => {
                            return Some(AttributeTexture::new(a, &mesh.triangles, texture.scale, self.shelf.carried));
                        }
                        Some(x) => format!("expected colours from 0 to 1 in the attribute {name}, found {x}"),
                    },
                    None if attributes.is_empty() => {
                        format!("expected a mesh that has the attribute {name}, found none")
                    }
                    None => {
                        let names: Vec<&str> = attributes.iter().map(|a| a.name.as_str()).collect();
                        format!("expected an attribute of the mesh, {}; found {name}", names.join(", "))
                    }
                }
            }
        };
        self.fault(&format!("{at}.mesh_attribute.name"), message);
        None
    }
}

#[cfg(test)]
mod tests {
    use crate::description::SceneDescription;
    use crate::scene::compile::compile;
    use crate::scene::grid::testing::vol;

    /// What `text` says is wrong on a mesh of one triangle that is `m`. At its vertices stand grey of 0.5 as a colour, and numbers up
    /// to 1.5; volumes of one voxel are white and twice as bright.
    fn fault(text: &str) -> String {
        let directory = tempfile::tempdir().unwrap();
        let numbers: String =
            ["x", "y", "z", "red", "green", "blue", "wear_0"].map(|name| format!("property float {name}\n")).concat();
        let vertices = "0 0 0 0.5 0.5 0.5 1.5\n1 0 0 0.5 0.5 0.5 0\n0 1 0 0.5 0.5 0.5 0\n";
        let face = "element face 1\nproperty list uchar int vertex_indices\n";
        let ply = format!("ply\nformat ascii 1.0\nelement vertex 3\n{numbers}{face}end_header\n{vertices}3 0 1 2\n");
        std::fs::write(directory.path().join("t.ply"), ply).unwrap();
        for (file, values) in
            [("one.vol", &[1.0][..]), ("two.vol", &[2.0]), ("white.vol", &[1.0; 3]), ("red.vol", &[2.0, 1.0, 0.0])]
        {
            std::fs::write(directory.path().join(file), vol([1; 3], values.len() as i32, values)).unwrap();
        }
        let head = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nshapes: [{mesh: {file: t.ply, material: m}}]\n";
        let description = SceneDescription::parse(&format!("{head}{text}"), &directory.path().join("s.yaml"));
        let made = description.and_then(|description| compile(&description, "s"));
        made.err().map(|error| error.to_string()).unwrap_or_default()
    }

    /// It was white there, without a word.
    #[test]
    fn no_light_throws_attributes_of_a_mesh() {
        let attribute = "textures: {a: {mesh_attribute: {name: vertex_color}}, b: {checkerboard: {a: 0, b: {texture: a}}}}\n\
                         materials: {m: {diffuse: {reflectance: {texture: b}}}}\n";
        assert_eq!(fault(attribute), "");
        let slide = "spot: {position: [0, 0, 3], target: [0, 0, 0], intensity: 1, texture: a}";
        let picture = "projector: {origin: [0, 0, 3], target: [0, 0, 0], fov_deg: 40, irradiance: {texture: b}}";
        for light in [slide, picture] {
            let told = fault(&format!("{attribute}lights: [{{{light}}}]\n"));
            let expected = "textures.a.mesh_attribute.name: expected a mesh that has the attribute vertex_color, found a light that \
                            throws it";
            assert!(told.ends_with(expected), "{told}");
        }
    }

    /// Each of 60 holds the one before twice: 2⁶⁰ looks, if none were kept. 2¹² colours are as many as there may be, and 2¹²
    /// materials with the 2¹² - 1 blends over them twice as many as that.
    #[test]
    fn what_holds_an_attribute_twice_at_each_level_is_counted_once() {
        let boards: String = (1..60)
            .map(|i| format!("  t{i}: {{checkerboard: {{a: {{texture: t{j}}}, b: {{texture: t{j}}}}}}}\n", j = i - 1))
            .collect();
        let attribute = "textures:\n  t0: {mesh_attribute: {name: vertex_color}}\n";
        let diffuse = |texture: &str| format!("diffuse: {{reflectance: {{texture: {texture}}}}}");
        let told = fault(&format!("{attribute}{boards}materials: {{m: {{{}}}}}\n", diffuse("t59")));
        assert!(told.contains("t13: expected at most 4096 colours and textures in boards within boards"), "{told}");
        assert!(!told.contains("t12:"), "{told}");
        let blends: String = (1..60)
            .map(|i| format!("  m{i}: {{blend: {{weight: 0.5, first: m{j}, second: m{j}}}}}\n", j = i - 1))
            .collect();
        let first = format!(
            "materials:\n  m0: {{{}}}\n{blends}  m: {{blend: {{weight: 0.5, first: m59, second: m59}}}}\n",
            diffuse("t0")
        );
        let told = fault(&format!("{attribute}{first}"));
        assert!(told.contains("m12.blend: expected at most 4096 layers and materials"), "{told}");
        assert!(!told.contains("m11"), "{told}");
    }

    /// Numbers of other uses are not bounded.
    #[test]
    fn what_a_file_has_above_one_is_no_reflectance_and_no_albedo() {
        let reflects = |texture: &str| {
            let material = "materials: {m: {diffuse: {reflectance: {texture: t}}}}\n";
            fault(&format!("textures: {{t: {texture}}}\n{material}"))
        };
        let attribute =
            |name: &str, scale: f64| reflects(&format!("{{mesh_attribute: {{name: {name}, scale: {scale}}}}}"));
        assert_eq!([attribute("vertex_color", 2.0), attribute("vertex_wear", 0.5)], ["", ""]);
        let told = attribute("vertex_color", 4.0);
        assert!(told.contains("reflectances from 0 to 1 in the attribute vertex_color times 4, found 2"), "{told}");
        let told = attribute("vertex_wear", 1.0);
        assert!(told.contains("reflectances from 0 to 1 in the attribute vertex_wear, found 1.5"), "{told}");
        let rough = "materials: {m: {conductor: {metal: gold, roughness: {texture: t}}}}\n";
        assert_eq!(fault(&format!("textures: {{t: {{mesh_attribute: {{name: vertex_wear}}}}}}\n{rough}")), "");

        let scatters = |file: &str| {
            let medium = "media: {smoke: {homogeneous: {extinction: 1, albedo: {volume: v}}}}\n";
            fault(&format!("volumes: {{v: {{grid: {{file: {file}}}}}}}\n{medium}materials: {{m: {{diffuse: {{}}}}}}\n"))
        };
        let paints = |file: &str| {
            let material = "materials: {m: {diffuse: {reflectance: {texture: t}}}}\n";
            fault(&format!("volumes: {{v: {{grid: {{file: {file}}}}}}}\ntextures: {{t: {{volume: v}}}}\n{material}"))
        };
        for file in ["one.vol", "white.vol"] {
            assert_eq!([scatters(file), paints(file)], ["", ""]);
        }
        for file in ["two.vol", "red.vol"] {
            for told in [scatters(file), paints(file)] {
                let parts = [file, "expected values from 0 to 1 for a share of light, found 2", "named at"];
                assert!(parts.iter().all(|part| told.contains(part)), "{told}");
            }
        }
    }
}
