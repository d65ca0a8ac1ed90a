//! What stands in a scene: from a shape that a person wrote to an object that rays meet.

use super::attributes::Surface;
use super::{Compiler, Lamps};
use crate::description as written;
use crate::error::Result;
use crate::scene::bvh::{Aabb, Bvh};
use crate::scene::instance::Group;
use crate::scene::light::Light;
use crate::scene::material::Kind;
use crate::scene::shape::{Detail, Shape};
use crate::scene::{Geometry, Object};
use std::collections::BTreeSet;
use std::sync::Arc;

/// The media on the two sides of a surface.
struct Sides {
    inside: Option<u32>,
    outside: Option<u32>,
    /// As [`Object::keeps_medium`].
    keeps_medium: bool,
}

impl<'a> Compiler<'a> {
    /// What stands in the scene itself, and the names of its materials. Shapes that shine join the lamps.
    pub(super) fn objects(&mut self, lamps: &mut Lamps) -> Result<(Vec<Object>, Vec<String>)> {
        let (mut objects, mut material_names) = (Vec::new(), Vec::new());
        for (i, shape) in self.description.shapes.iter().enumerate() {
            let at = format!("shapes[{i}].{}", shape.geometry.kind());
            let name = shape.name_or_kind(i);
            let index = objects.len() as u32;
            if let Some(object) = self.object(&at, name, shape, index, &mut lamps.lights)? {
                if object.light.is_some() {
                    lamps.names.push(object.name.clone());
                    lamps.weights.push(shape.sampling_weight.unwrap_or(1.0));
                } else if object.is_lamp {
                    lamps.dark.push(object.name.clone());
                }
                material_names.push(shape.material_name(&object.name));
                objects.push(object);
            }
        }
        self.lie_on(Surface::Unknown);
        Ok((objects, material_names))
    }

    /// The children of all groups that are copied somewhere, and the names of their materials; each group knows where its
    /// own will lie.
    pub(super) fn groups(&mut self) -> Result<(Vec<Object>, Vec<String>)> {
        let d = self.description;
        let copied: BTreeSet<&str> = d.shapes.iter().filter_map(|shape| shape.geometry.group()).collect();
        let mut children: Vec<Object> = Vec::new();
        let mut materials = Vec::new();
        for (group, shapes) in d.groups.iter().filter(|(name, _)| copied.contains(name.as_str())) {
            let first = (d.shapes.len() + children.len()) as u32;
            let start = children.len();
            let list = written::field(&["groups", group]);
            for (i, shape) in shapes.iter().enumerate() {
                let kind = shape.geometry.kind();
                let name = shape.name.clone().unwrap_or_else(|| format!("{group}.{kind}{i}"));
                let at = format!("{list}[{i}].{kind}");
                // No child shines, by the checks of the description.
                if let Some(child) = self.object(&at, name, shape, first, &mut Vec::new())? {
                    materials.push(shape.material_name(&child.name));
                    children.push(child);
                }
            }
            let boxes: Vec<Aabb> = children[start..].iter().map(Object::bounds).collect();
            let material = children.get(start).map_or(0, |child| child.material);
            self.groups.insert(group, (Arc::new(Group { first, bvh: Bvh::build(&boxes) }), material));
        }
        Ok((children, materials))
    }

    /// The object that `shape` is; `index` is the one that it will have. Its light goes to `lights`.
    fn object(
        &mut self,
        at: &str,
        name: String,
        shape: &'a written::Shape,
        index: u32,
        lights: &mut Vec<Light>,
    ) -> Result<Option<Object>> {
        self.lie_on(Surface::Shape);
        let Some(geometry) = self.geometry(at, shape)? else { return Ok(None) };
        if let Some(group) = shape.geometry.group() {
            return Ok(Some(Object::plain(name, geometry, self.groups[group].1)));
        }
        let material = self.material_index(at, &shape.material);
        let light = shape.emission.as_ref().map(|emission| self.shining(at, shape, emission, index, &geometry));
        let light = light.filter(|light| !light.is_dark());
        let is_lamp = shape.emission.is_some();
        if is_lamp && matches!(geometry, Geometry::Shape(Shape::Plane(_))) {
            self.fault(&format!("{at}.emission"), "expected a shape with an end, found a plane: its light is infinite");
        }
        let detail = self.detail(material, light.as_ref());
        let light = light.map(|light| {
            lights.push(light);
            lights.len() as u32 - 1
        });
        let closed = counts_as_closed(&geometry);
        if let Some(fault) = self.unfit_for_a_body(&self.materials[material as usize], &geometry, closed, shape) {
            self.fault(&format!("{at}.material"), fault);
        }
        let reliefs = self.materials[material as usize].compound().map_or(0, |compound| compound.reliefs);
        if matches!(geometry, Geometry::Sdf(_)) && reliefs > 0 {
            self.note(
                at,
                "u and v are 0 all over it, so that its bumps and normal maps turn all normals alike and show no picture",
            );
        }
        let Sides { inside, outside, keeps_medium } = self.media_beside(at, shape, &geometry, material);
        Ok(Some(Object {
            name,
            geometry,
            material,
            light,
            detail,
            inside,
            outside,
            keeps_medium,
            flipped: shape.flip_normals,
            is_lamp,
            body: 0,
        }))
    }

    /// The material of a surface: one that has a name is shared, unless it is another on each surface.
    fn material_index(&mut self, at: &str, material: &'a written::MaterialRef) -> u32 {
        let own = match material {
            written::MaterialRef::Name(name) if !self.on_surface.contains(name.as_str()) => {
                return self.material_ids[name.as_str()];
            }
            written::MaterialRef::Name(name) => self.named_material(name).as_ref().clone(),
            written::MaterialRef::Inline(material) => self.material(&format!("{at}.material"), material),
        };
        self.materials.push(own);
        self.materials.len() as u32 - 1
    }

    /// What of a surface is worked out for paths that meet it, by its material and its light.
    fn detail(&self, material: u32, light: Option<&Light>) -> Detail {
        let material = &self.materials[material as usize];
        let light_varies = matches!(light, Some(Light::Area { radiance, .. }) if radiance.varies());
        if material.varies() || light_varies || self.description.render.effects == written::Effects::All {
            Detail::Texture
        } else if light.is_none() && matches!(material.kind, Kind::Boundary) {
            Detail::Boundary
        } else {
            Detail::Geometry
        }
    }

    /// The media beside a surface, where its normals may point inward.
    ///
    /// A closed body without a word about its inside is empty if light can enter it. An open one, and one that light cannot
    /// enter but may be in, as in a room, has the same medium on both sides; outside is what the camera is in.
    fn media_beside(&mut self, at: &str, shape: &written::Shape, geometry: &Geometry, material: u32) -> Sides {
        let camera_medium = self.camera_medium();
        let closed = counts_as_closed(geometry);
        let transmits = self.materials[material as usize].transmits();
        let enclosed = if closed && transmits { None } else { camera_medium };
        let (behind, before) = if shape.flip_normals { (camera_medium, enclosed) } else { (enclosed, camera_medium) };
        let behind = self.absorbing(at, material, closed, geometry, shape).or(behind);
        // What light never crosses may stand in any medium: it tells of none unless that is written.
        // Nor is a path ever within a closed body of it, unless that is a lamp which shines inward.
        let entered = transmits || shape.emission.is_some() && shape.flip_normals;
        let mut sides = [("inside", shape.inside.as_ref(), behind), ("outside", shape.outside.as_ref(), before)];
        let (field, written, otherwise) = &mut sides[usize::from(shape.flip_normals)];
        let is_named = written.is_some_and(|name| ![written::VACUUM, written::UNCHANGED].contains(&name.as_str()));
        if is_named && !entered && encloses(geometry) {
            let note = "light cannot enter, so that it changes nothing; what the camera is in says the scene's medium";
            self.note(&format!("{at}.{field}"), note);
            (*written, *otherwise) = (None, camera_medium);
        }
        let silent = !transmits && sides.iter().all(|(_, written, _)| written.is_none());
        let unchanged = sides.iter().all(|(_, written, _)| written.is_some_and(|name| name == written::UNCHANGED));
        let medium = |side: Option<&String>, otherwise: Option<u32>| match side.map(String::as_str) {
            None => otherwise,
            Some(written::VACUUM | written::UNCHANGED) => None,
            Some(name) => Some(self.medium_ids[name]),
        };
        let [inside, outside] = sides.map(|(_, written, otherwise)| medium(written, otherwise));
        Sides { inside, outside, keeps_medium: unchanged || silent }
    }
}

/// Whether what is behind its surface is taken for its inside. A mesh has to be closed for that: one that is not is told.
fn counts_as_closed(geometry: &Geometry) -> bool {
    match geometry {
        Geometry::Shape(shape) => shape.is_closed(),
        Geometry::Mesh(_) => true,
        Geometry::Sdf(sdf) => sdf.is_closed(),
        // What goes into curves comes out unseen; an instance is none of its own.
        Geometry::Curves(_) | Geometry::Instance(_) => false,
    }
}

/// Whether it has an inside that its normals point out of, so that nothing but light through it comes in.
fn encloses(geometry: &Geometry) -> bool {
    match geometry {
        Geometry::Shape(shape) => shape.is_closed(),
        Geometry::Mesh(mesh) => mesh.mesh.open_edges() == 0 && !mesh.mesh.is_inside_out(),
        Geometry::Sdf(sdf) => sdf.is_closed(),
        Geometry::Curves(_) | Geometry::Instance(_) => false,
    }
}
