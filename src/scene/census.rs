//! Facts about a scene that decide what has to be simulated.

use super::material::Kind;
use super::{Geometry, Scene};
use crate::scene::light::Light;
use std::collections::HashSet;

/// Counts of what a scene holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Analytic shapes.
    pub shapes: usize,
    /// Triangles.
    pub triangles: usize,
    /// Copies of groups.
    pub instances: usize,
    /// Materials in use whose index depends on wavelength, smooth.
    pub dispersive: Vec<String>,
    /// The same, rough.
    pub rough_dispersive: Vec<String>,
    /// Materials in use that reflect by an index that depends on wavelength and bend nothing by it: panes and coats.
    pub coloured_coats: Vec<String>,
    /// Transparent objects.
    pub refractive: Vec<String>,
    /// Objects with a texture that varies.
    pub textured: Vec<String>,
    /// Objects with a mirror-like or metal surface.
    pub reflective: Vec<String>,
    /// Objects that shine.
    pub area_lights: Vec<String>,
    /// Lights without power, which are left out.
    pub dark: Vec<String>,
    /// Lights without extent.
    pub delta_lights: usize,
    /// Lights from infinity.
    pub backgrounds: usize,
    /// Media that rays can be in.
    pub media: usize,
    /// Of those, media that are the same everywhere and scatter nothing.
    pub clear_media: usize,
    /// Of all, media that scatter and whose extinction depends on wavelength.
    pub chromatic_media: usize,
    /// Objects with a film.
    pub films: Vec<String>,
    /// Bodies with a priority.
    pub nested: Vec<String>,
    /// A lens with a radius above zero.
    pub lens: bool,
    /// Depth fog.
    pub fog: bool,
}

impl Census {
    /// What two scenes call for together, of which one is the other at another time.
    #[must_use]
    pub fn join(self, other: Census) -> Census {
        let all = |mut a: Vec<String>, b: Vec<String>| {
            let known: HashSet<&String> = a.iter().collect();
            let new: Vec<String> = b.into_iter().filter(|name| !known.contains(name)).collect();
            a.extend(new);
            a
        };
        Census {
            shapes: self.shapes.max(other.shapes),
            triangles: self.triangles.max(other.triangles),
            instances: self.instances.max(other.instances),
            dispersive: all(self.dispersive, other.dispersive),
            rough_dispersive: all(self.rough_dispersive, other.rough_dispersive),
            coloured_coats: all(self.coloured_coats, other.coloured_coats),
            refractive: all(self.refractive, other.refractive),
            textured: all(self.textured, other.textured),
            reflective: all(self.reflective, other.reflective),
            area_lights: all(self.area_lights, other.area_lights),
            dark: all(self.dark, other.dark),
            delta_lights: self.delta_lights.max(other.delta_lights),
            backgrounds: self.backgrounds.max(other.backgrounds),
            media: self.media.max(other.media),
            clear_media: self.clear_media.max(other.clear_media),
            chromatic_media: self.chromatic_media.max(other.chromatic_media),
            films: all(self.films, other.films),
            nested: all(self.nested, other.nested),
            lens: self.lens || other.lens,
            fog: self.fog || other.fog,
        }
    }

    /// How many lights can be met by chance.
    #[must_use]
    pub fn extended_lights(&self) -> usize {
        self.area_lights.len() + self.backgrounds
    }

    /// How many lights there are.
    #[must_use]
    pub fn lights(&self) -> usize {
        self.extended_lights() + self.delta_lights
    }

    /// Takes the census of `scene`.
    #[must_use]
    pub fn of(scene: &Scene) -> Census {
        let mut census = Census {
            fog: scene.fog.is_some(),
            backgrounds: scene.backgrounds.len(),
            dark: scene.dark.clone(),
            lens: scene.camera.lens.is_some(),
            ..Census::default()
        };
        for object in &scene.objects {
            match &object.geometry {
                Geometry::Shape(_) => census.shapes += 1,
                Geometry::Mesh(mesh) => census.triangles += mesh.mesh.triangles.len(),
                // One surface, however many cells.
                Geometry::Sdf(_) => census.shapes += 1,
                Geometry::Curves(curves) => census.shapes += curves.segments() as usize,
                Geometry::Instance(_) => {
                    // Its children are counted once, as themselves.
                    census.instances += 1;
                    continue;
                }
            }
            let name = || object.name.clone();
            let material = &scene.materials[object.material as usize];
            if material.varies() {
                census.textured.push(name());
            }
            for leaf in material.leaves() {
                if leaf.has_film() {
                    note(&mut census.films, name());
                }
                match &leaf.kind {
                    Kind::Dielectric { interior, exterior, facets, .. } => {
                        note(&mut census.refractive, name());
                        if interior.is_dispersive() || exterior.is_dispersive() {
                            let rough = facets.is_some();
                            note(if rough { &mut census.rough_dispersive } else { &mut census.dispersive }, name());
                        }
                    }
                    Kind::Principled(solid) if solid.transmission.is_some() => note(&mut census.refractive, name()),
                    Kind::Thin { interior, exterior, .. } => {
                        note(&mut census.refractive, name());
                        if interior.is_dispersive() || exterior.is_dispersive() {
                            note(&mut census.coloured_coats, name());
                        }
                    }
                    Kind::Plastic { coat, .. } => {
                        if coat.interior.is_dispersive() || coat.exterior.is_dispersive() {
                            note(&mut census.coloured_coats, name());
                        }
                    }
                    Kind::PrincipledThin(_) => note(&mut census.refractive, name()),
                    Kind::Mirror { .. } | Kind::Conductor { .. } => note(&mut census.reflective, name()),
                    Kind::Diffuse { .. }
                    | Kind::Principled(_)
                    | Kind::Hair { .. }
                    | Kind::Boundary
                    | Kind::Compound(_) => {}
                }
            }
        }
        for light in &scene.lights {
            match light {
                Light::Area { object, radiance } | Light::AlongNormal { object, exitance: radiance } => {
                    let name = scene.objects[*object as usize].name.clone();
                    if radiance.varies() {
                        census.textured.push(name.clone());
                    }
                    census.area_lights.push(name);
                }
                Light::Point { .. } | Light::Spot { .. } | Light::Directional { .. } | Light::Projector(_) => {
                    census.delta_lights += 1;
                }
                Light::Constant { .. } | Light::Environment(_) => {}
            }
        }
        let bodies = scene.nested.bodies().iter().rev();
        census.nested = bodies.map(|body| scene.objects[body.object as usize].name.clone()).collect();
        let sides = scene.objects.iter().flat_map(|object| [object.inside, object.outside]);
        let used: HashSet<u32> = sides.chain([scene.camera_medium]).flatten().collect();
        for (medium, _) in scene.media.iter().zip(0..).filter(|(_, i)| used.contains(i)) {
            census.media += 1;
            census.clear_media += usize::from(medium.is_clear());
            if medium.is_chromatic() {
                census.chromatic_media += 1;
            }
        }
        census
    }
}

/// Adds a name, once.
fn note(names: &mut Vec<String>, name: String) {
    if names.last() != Some(&name) {
        names.push(name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of one scene of which most are in another: each compared with each other they would take a minute.
    #[test]
    fn many_names_at_many_moments_take_no_quadratic_time() {
        const MANY: usize = 200_000;
        let begin = std::time::Instant::now();
        let at = |first: usize| Census {
            reflective: (first..first + MANY).rev().map(|i| format!("ball{i:07}")).collect(),
            ..Census::default()
        };
        let both = at(0).join(at(1));
        assert_eq!((both.reflective.len(), both.reflective[0].as_str()), (MANY + 1, "ball0199999"));
        assert_eq!(both.reflective.last().unwrap(), "ball0200000");
        assert!(begin.elapsed() < std::time::Duration::from_secs(20));
    }
}
