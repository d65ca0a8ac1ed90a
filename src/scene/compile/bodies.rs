//! Bodies with a priority.

use super::Compiler;
use crate::description as written;
use crate::scene::apart::Contact;
use crate::scene::around::{Side, Stranger};
use crate::scene::bvh::Aabb;
use crate::scene::material::Material;
use crate::scene::overlaps::Overlap;
use crate::scene::shape::Shape;
use crate::scene::{Geometry, Object, Scene};
use std::collections::HashMap;

/// Pairs that are told.
const TOLD: usize = 8;

impl Compiler<'_> {
    /// Notes which bodies overlap, and nothing says which of them has the place.
    pub(super) fn note_overlaps(&self, scene: &mut Scene) {
        let pairs = scene.overlaps();
        for Overlap { objects: [a, b], refracting } in pairs.iter().take(TOLD) {
            let at = format!("shapes[{b}].{}", self.description.shapes[*b as usize].geometry.kind());
            let why = if *refracting {
                "not both have a priority: where they share a place, light is refracted by indices that neither has; a \
                 higher priority says which has the place"
            } else {
                "both hold a medium: where they share a place, light is in the one that it went into last, and pictures \
                 differ by where paths begin; leave them apart"
            };
            scene.notes.push(self.description.fault(&at, &format!("overlaps shapes[{a}], and {why}")));
        }
        if pairs.len() > TOLD {
            scene.notes.push(format!(
                "{} more pairs of bodies overlap, and nothing says which has the place",
                pairs.len() - TOLD
            ));
        }
    }

    /// Notes which bodies share faces, and what was done.
    pub(super) fn note_contacts(&self, scene: &mut Scene, contacts: &[Contact], passed_over: usize) {
        for Contact { body, other, by, parted } in contacts.iter().take(TOLD) {
            let at = format!("shapes[{body}].{}", self.description.shapes[*body as usize].geometry.kind());
            let done = match by {
                Some(by) if *by < 0.0 => {
                    format!("it reaches {:.0e} m into it, as bodies with a priority may", -by)
                }
                Some(by) => {
                    format!("it is put off by {by:.0e} m, so that rays meet both, with empty space between")
                }
                None if *parted => {
                    "it is put off with empty space between, as one of them shares a face with something that has no \
                                    priority; leave a gap there"
                        .to_owned()
                }
                None => "it has no room to be put off, and rays may miss one of the two; leave a gap".to_owned(),
            };
            scene.notes.push(self.description.fault(&at, &format!("shares a face with shapes[{other}]: {done}")));
        }
        if contacts.len() > TOLD {
            scene.notes.push(format!("{} more pairs of shapes share faces", contacts.len() - TOLD));
        }
        if passed_over > 0 {
            let note = "more bodies that light goes into are not looked at for faces that they share; leave gaps there";
            scene.notes.push(format!("{passed_over} {note}"));
        }
    }

    /// Notes which bodies stand in another medium than they are taken to, as nothing is written of it, and which are around a camera
    /// that is taken to be in another one.
    pub(super) fn note_strangers(&self, scene: &mut Scene) {
        // What a material absorbs with has none.
        let name = |medium: Option<u32>| match medium {
            None => Some(written::VACUUM),
            Some(medium) => self.medium_ids.iter().find(|(_, id)| **id == medium).map(|(name, _)| *name),
        };
        let place = |medium: Option<u32>| name(medium).unwrap_or("a body that absorbs");
        let told = |stranger: &Stranger| {
            let shape = self.description.shapes.get(stranger.object as usize)?;
            let medium = place(stranger.medium);
            let stands = |side: &str| {
                let says = match name(stranger.medium) {
                    Some(name) => format!("{side}: {name} says"),
                    None => "a priority of each says".to_owned(),
                };
                format!(
                    "stands in {medium}, but its {side}, which is not written, is taken to be what the camera is in; {says} where \
                     it stands"
                )
            };
            let note = match stranger.side {
                Side::Outside => shape.outside.is_none().then(|| stands("outside"))?,
                Side::Inside => shape.inside.is_none().then(|| stands("inside"))?,
                Side::Camera => format!(
                    "the camera is inside, in {own}, but is taken to be in {medium}: medium says what the camera is in, but for \
                     bodies with a priority",
                    own = place(stranger.own),
                ),
            };
            let at = format!("shapes[{}].{}", stranger.object, shape.geometry.kind());
            Some(self.description.fault(&at, &note))
        };
        let notes: Vec<String> = scene.strangers().iter().filter_map(told).collect();
        if notes.len() > TOLD {
            let more = notes.len() - TOLD;
            scene.notes.extend(notes.into_iter().take(TOLD));
            scene.notes.push(format!("{more} more bodies stand in another medium than they say"));
        } else {
            scene.notes.extend(notes);
        }
    }

    /// Notes which meshes that light goes into are open, or have normals that point inwards, unless somebody wants that.
    pub(super) fn note_meshes(&self, scene: &mut Scene) {
        let told = |(i, object): (usize, &Object)| {
            let Geometry::Mesh(mesh) = &object.geometry else { return None };
            let material = &scene.materials[object.material as usize];
            let bounds = material.refracts() || material.transmits() && object.inside != object.outside;
            let shape = self.description.shapes.get(i).filter(|_| bounds)?;
            let note = match mesh.mesh.open_edges() {
                0 if object.flipped || !mesh.mesh.is_inside_out() => return None,
                0 => "it is closed, and its normals point inwards: its inside, and what is in there, is all that is around it; \
                      flip_normals: true turns it"
                    .to_owned(),
                open => format!(
                    "{open} of its edges have no second triangle, wound the same way, on their other side: light that goes in where it \
                     is open, or out, is taken to be where it was"
                ),
            };
            Some(self.description.fault(&format!("shapes[{i}].{}", shape.geometry.kind()), &note))
        };
        let notes: Vec<String> = scene.objects.iter().enumerate().filter_map(told).collect();
        scene.notes.extend(notes);
    }

    /// Puts the eye and lamps beside the surfaces that they lie on, and says so.
    pub(super) fn note_beside(&self, scene: &mut Scene, boxes: &[Aabb], light_names: &[String]) {
        let moved = scene.put_beside(boxes);
        if moved.is_empty() {
            return;
        }
        // Of those with one name the first.
        let lamps = self.description.lights.iter().enumerate().rev();
        let lamps: HashMap<String, _> = lamps.map(|(k, lamp)| (lamp.name_or_kind(k), (k, lamp))).collect();
        for (light, object) in moved {
            let on = &scene.objects[object as usize].name;
            let lamp = |i: usize| lamps.get(&light_names[i]);
            let (at, note) = match light.and_then(lamp) {
                None => ("camera".to_owned(), format!("stands on {on}: it sees from the side to which it looks")),
                Some((k, lamp)) => (
                    format!("lights[{k}].{}", lamp.kind()),
                    format!("lies on {on}: it shines from the side that it is aimed at, or that is seen"),
                ),
            };
            scene.notes.push(self.description.fault(&at, &note));
        }
    }

    /// Why an object of this form cannot be a body with a priority, if its material asks for one.
    pub(super) fn unfit_for_a_body(
        &self,
        material: &Material,
        geometry: &Geometry,
        closed: bool,
        shape: &written::Shape,
    ) -> Option<String> {
        match material.body() {
            Ok(None) => None,
            Err(fault) => Some(fault),
            Ok(Some(_)) if !closed && !matches!(geometry, Geometry::Shape(Shape::Plane(_))) => {
                let kind = shape.geometry.kind();
                Some(format!("expected a closed shape or a plane for a material with a priority, found an open {kind}"))
            }
            Ok(Some(_)) if shape.flip_normals => {
                Some("expected normals that point out of a body with a priority, found flip_normals".into())
            }
            Ok(Some(_)) => None,
        }
    }
}
