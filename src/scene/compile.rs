//! From what a person wrote to what rays meet: names become indices, degrees radians, files arrays.
//!
//! Faults that only show here (an unknown glass, a missing picture) are collected and come all at
//! once, each with its place in the file.

mod attributes;
mod bodies;
mod camera;
mod files;
mod films;
mod hair;
mod indices;
mod lights;
mod media;
mod meshes;
mod notes;
mod objects;
mod principled;
mod shapes;
mod spectra;
mod surface;
mod wavelengths;

use super::apart::put_apart;
use super::brightness::Powers;
use super::bvh::{Aabb, Bvh};
use super::camera::Camera;
use super::choice::{self, Asked, Choice};
use super::equiangular;
use super::few::Few;
use super::instance::Group;
use super::light::Light;
use super::load::{Pictures, Wanted};
use super::material::Material;
use super::medium::Medium;
use super::mesh::MeshTree;
use super::mesh::together::Together;
use super::nested::{Inside, Nested};
use super::shelf::Shelf;
use super::texture::{Scalar, Texture};
use super::volume::Volume;
use super::{DepthFog, FogFalloff, Geometry, Object, Scene, TriangleMesh};
use crate::description::{self as written, SceneDescription};
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::spectrum::{Outside, Spectrum};
use attributes::{AtHand, Surface};
use glam::DVec3;
use meshes::Meshes;
use spectra::Role;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

struct Compiler<'a> {
    description: &'a SceneDescription,
    faults: Vec<String>,
    /// What a person should know.
    notes: Vec<(String, String)>,
    /// The same, to look them up.
    noted: HashSet<(String, String)>,
    /// The first curve that could not be read.
    unread: Option<Error>,
    files: Vec<PathBuf>,
    meshes: Meshes,
    /// Decoded before they are asked for.
    pictures: Pictures,
    /// What the scene before has read.
    shelf: Shelf,
    /// What textures lie on.
    surface: Surface,
    /// What was made for it.
    at_hand: AtHand<'a>,
    /// Whether a texture has asked for that.
    asks_for_surface: bool,
    /// Materials that are others on each surface.
    on_surface: BTreeSet<&'a str>,
    /// Textures as spectra and as numbers, once they are asked for.
    textures: HashMap<&'a str, Texture>,
    /// Spectra of lamps, once they are asked for.
    common: HashMap<spectra::Common, Spectrum>,
    /// Textures as light.
    shining: HashMap<&'a str, lights::Shining>,
    volumes: HashMap<&'a str, Volume>,
    /// Environments, by where they stand among the lights, until they are asked for.
    skies: HashMap<usize, Result<Option<Light>>>,
    numbers: HashMap<&'a str, Scalar>,
    named: HashMap<&'a str, Arc<Material>>,
    material_ids: HashMap<&'a str, u32>,
    medium_ids: HashMap<&'a str, u32>,
    /// Media of bodies that absorb by themselves, after those that have names.
    absorbing: Vec<Medium>,
    /// Which of them is that of a material.
    absorbing_ids: HashMap<u32, u32>,
    /// Groups that are copied, and the material of their first shape.
    groups: HashMap<&'a str, (Arc<Group>, u32)>,
    materials: Vec<Material>,
}

/// The lamps that shine, one after the other, and the names of those that do not.
#[derive(Default)]
struct Lamps {
    lights: Vec<Light>,
    /// How often each is asked, times what its power says.
    weights: Vec<f64>,
    names: Vec<String>,
    dark: Vec<String>,
}

/// What rays look for things in.
struct Search {
    bvh: Bvh,
    few: Option<Few>,
    together: Option<Together>,
}

/// The spectrum of the ambient light of `whitted`.
///
/// # Errors
/// [`Error::Config`] with every fault found.
pub fn ambient(description: &SceneDescription, ambient: &written::Spectrum) -> Result<Spectrum> {
    let mut c = Compiler::new(description);
    let spectrum = c.light_spectrum("integrator.whitted.ambient", ambient);
    c.finish(Ok(spectrum))
}

/// Compiles a scene.
///
/// # Errors
/// [`Error::Config`] with every fault found; [`Error::Input`] where a file is missing or broken.
pub fn compile(description: &SceneDescription, name: &str) -> Result<Scene> {
    compile_with(description, name, &mut Shelf::default())
}

/// [`compile`] with what the scene before it has read. The shelf then holds what this one asked for.
///
/// # Errors
/// As [`compile`].
pub fn compile_with(description: &SceneDescription, name: &str, shelf: &mut Shelf) -> Result<Scene> {
    let mut c = Compiler::new(description);
    c.shelf = std::mem::take(shelf);
    let scene = c.scene(name);
    *shelf = std::mem::take(&mut c.shelf);
    shelf.forget_unwanted();
    c.finish(scene)
}

/// What makes the sky of `sky` differ from others of its file.
fn sky_key(sky: &written::EnvironmentLight) -> Vec<u64> {
    let numbers = sky.world_from_map().to_cols_array().into_iter().chain([sky.scale]);
    let mapping = u64::from(sky.mapping == written::EnvironmentMapping::Mitsuba);
    numbers.map(f64::to_bits).chain([mapping]).collect()
}

/// The pictures that a scene names and `shelf` lacks. What textures are used for shows later: without `raw` mostly as
/// colours.
fn pictures<'a>(d: &'a SceneDescription, shelf: &Shelf) -> impl Iterator<Item = (&'a Path, Wanted)> {
    let has = |file: &Path, raw| shelf.colours.has(file, raw) || shelf.numbers.has(file, raw);
    let textures = d.textures.values().filter_map(move |texture| match texture {
        written::Texture::Image(image) if !has(&image.file, image.raw) => {
            Some((&*image.file, if image.raw { Wanted::Pixels } else { Wanted::Colours }))
        }
        _ => None,
    });
    let skies = d.lights.iter().filter_map(|light| match light {
        written::Light::Environment(sky) if !shelf.skies.has(&sky.file, sky_key(sky)) => {
            Some((&*sky.file, Wanted::Pixels))
        }
        _ => None,
    });
    textures.chain(skies)
}

fn vec3(v: [f64; 3]) -> DVec3 {
    DVec3::from_array(v)
}

impl<'a> Compiler<'a> {
    fn new(description: &'a SceneDescription) -> Compiler<'a> {
        Compiler {
            description,
            faults: Vec::new(),
            notes: Vec::new(),
            noted: HashSet::new(),
            unread: None,
            files: Vec::new(),
            meshes: Meshes::default(),
            pictures: Pictures::default(),
            shelf: Shelf::default(),
            surface: Surface::Unknown,
            at_hand: AtHand::default(),
            asks_for_surface: false,
            on_surface: BTreeSet::new(),
            textures: HashMap::new(),
            common: HashMap::new(),
            shining: HashMap::new(),
            volumes: HashMap::new(),
            skies: HashMap::new(),
            numbers: HashMap::new(),
            named: HashMap::new(),
            material_ids: HashMap::new(),
            medium_ids: HashMap::new(),
            absorbing: Vec::new(),
            absorbing_ids: HashMap::new(),
            groups: HashMap::new(),
            materials: Vec::new(),
        }
    }

    fn fault(&mut self, at: &str, message: impl AsRef<str>) {
        self.faults.push(self.description.fault(at, message.as_ref()));
    }

    /// An error about a file that the field `at` names: the message says so.
    fn asked(&self, at: &str, error: Error) -> Error {
        match error {
            Error::Input { path, message } => {
                let place = self.description.fault(at, "");
                let place = place.trim_end_matches([':', ' ']);
                Error::Input { path, message: format!("{message}; it is named at {place}") }
            }
            other => other,
        }
    }

    /// What was made, unless something was wrong: all faults of the description, else the first file that
    /// could not be read.
    fn finish<T>(self, made: Result<T>) -> Result<T> {
        if !self.faults.is_empty() {
            // What many use is told once.
            let mut told = HashSet::new();
            let faults: Vec<&str> =
                self.faults.iter().map(String::as_str).filter(|fault| told.insert(*fault)).collect();
            return Err(Error::Config(faults.join("\n")));
        }
        match self.unread {
            Some(error) => Err(error),
            None => made,
        }
    }

    /// The value, or a fault and a stand-in.
    fn or<T>(&mut self, at: &str, result: std::result::Result<T, String>, stand_in: T) -> T {
        result.unwrap_or_else(|message| {
            self.fault(at, message);
            stand_in
        })
    }

    /// Everything that is written, made in the order in which the one needs the other.
    fn scene(&mut self, name: &str) -> Result<Scene> {
        let d = self.description;
        // What is written, piece by piece; all faults show here.
        self.read()?;
        let mut media = self.media();
        let camera_medium = self.camera_medium();
        // Children of groups come after everything that stands in the scene itself.
        let (children, names_of_children) = self.groups()?;
        let mut lamps = Lamps::default();
        let (mut objects, mut material_names) = self.objects(&mut lamps)?;
        self.lights(&mut lamps)?;
        self.unused_textures();
        let camera = self.camera();
        if !self.faults.is_empty() || self.unread.is_some() {
            // What is wrong is told by `finish`.
            return Err(Error::Config(String::new()));
        }

        // Where things are, how rays find them, and who has a place that bodies share.
        let mut boxes: Vec<Aabb> = objects.iter().map(Object::bounds).collect();
        let (contacts, passed_over) = put_apart(&mut objects, &mut boxes, &self.materials);
        let Search { bvh, few, together } = self.search(&mut objects, &boxes);
        objects.extend(children);
        material_names.extend(names_of_children);
        let nested = Nested::of(&mut objects, boxes.len(), |object| {
            self.materials[object.material as usize].body().ok().flatten()
        });
        media.append(&mut self.absorbing);

        // Which lights a point asks, and at which wavelengths.
        let (center, radius) = extent(&objects, &boxes, &camera);
        let Lamps { lights, weights, names: light_names, dark } = lamps;
        let powers: Vec<f64> = lights.iter().map(|light| light.power(&objects, radius)).collect();
        let asked = |weights: &[f64]| {
            let by_power = lights::light_cdf(&powers, weights);
            let frame = choice::Frame { center, radius, eye: camera.eye() };
            Asked::new(by_power, Choice::of(&lights, &powers, weights, &objects, frame))
        };
        let all_asked = asked(&weights);
        let is_even = |light: &Light| matches!(light, Light::Constant { .. });
        let uneven: Vec<f64> = lights.iter().zip(&weights).map(|(l, &w)| if is_even(l) { 0.0 } else { w }).collect();
        let uneven_asked = (uneven != weights).then(|| asked(&uneven));
        let bands = self.bands();
        let wavelengths = self.wavelengths(&lights, &powers, &objects, &bands);
        self.note_unused_filter();
        let ambient = match &d.integrator {
            written::Integrator::Whitted(whitted) => {
                Some(self.light_spectrum("integrator.whitted.ambient", &whitted.ambient).luminance())
            }
            _ => None,
        };
        let is_large = |light: &Light| matches!(light, Light::Environment(map) if map.is_large());
        let lets_through = |o: &Object| o.body != 0 || self.materials[o.material as usize].lets_through();
        let parts_media = |o: &Object| !o.keeps_medium && [o.inside, o.outside] != [camera_medium; 2];
        let mut scene = Scene {
            name: name.to_owned(),
            camera,
            lamps: super::lamps::Lamps::of(&lights, &objects),
            has_planes: boxes.iter().any(|bounds| !bounds.is_finite()),
            has_boundaries: objects.iter().any(lets_through),
            parts_media: objects.iter().any(parts_media),
            has_media: camera_medium.is_some() || objects.iter().any(|o| o.inside.is_some() || o.outside.is_some()),
            near_lamps: equiangular::lamps(&lights, &objects, |i| all_asked.share_of_power(i)),
            objects,
            material_names,
            standing: boxes.len(),
            bvh,
            few,
            together,
            fog: self.depth_fog(),
            materials: std::mem::take(&mut self.materials),
            media,
            camera_medium,
            nested,
            camera_inside: Inside::default(),
            shines_on_rays: lights.iter().any(Light::may_be_met),
            large_sky: lights.iter().position(is_large).map(|i| i as u32),
            backgrounds: (0..lights.len() as u32).filter(|&i| lights[i as usize].is_environment()).collect(),
            lights,
            all_asked,
            uneven_asked,
            light_powers: Powers::default(),
            length_powers: Powers::default(),
            has_sky: d.lights.iter().any(written::Light::is_around),
            dark,
            light_groups: lights::groups(d, &light_names),
            sharp: Vec::new(),
            wavelengths,
            bands,
            center,
            radius,
            lit_within: f64::INFINITY,
            files: std::mem::take(&mut self.files),
            notes: self.told_notes(),
            watch: None,
        };
        // What follows from the whole, and what a person should know of it.
        self.note_beside(&mut scene, &boxes, &light_names);
        scene.light_powers = scene.powers_of_light(&powers, ambient, &boxes);
        scene.length_powers = scene.powers_of_lengths();
        let eye = Ray::new(scene.camera.eye(), DVec3::Z);
        self.note_contacts(&mut scene, &contacts, passed_over);
        self.note_overlaps(&mut scene);
        self.note_meshes(&mut scene);
        let lost = self.loses_distant_light(&scene);
        if lost {
            self.note_lost_light(&mut scene, &light_names);
        }
        scene.lit_within = scene.lights.iter().map(|light| range(&scene, light, lost)).fold(scene.radius, f64::max);
        scene.camera_inside = scene.inside(scene.bodies_around(&eye), camera_medium);
        self.note_strangers(&mut scene);
        Ok(scene)
    }

    /// Reads what takes long, meshes beside all else, and makes what is used by name.
    fn read(&mut self) -> Result<()> {
        let d = self.description;
        let known = Meshes::known(d, &mut self.shelf);
        let (meshes, made) = rayon::join(
            || Meshes::of(d, known),
            || {
                self.pictures = Pictures::of(pictures(d, &self.shelf));
                for (i, sky) in d.lights.iter().enumerate().filter(|(_, l)| matches!(l, written::Light::Environment(_)))
                {
                    let light = self.light(&format!("lights[{i}].{}", sky.kind()), sky);
                    self.skies.insert(i, light);
                }
                self.volumes_and_materials()
            },
        );
        made?;
        meshes.keep(&mut self.shelf);
        self.meshes = meshes;
        Ok(())
    }

    /// The media that have names.
    fn media(&mut self) -> Vec<Medium> {
        let mut media = Vec::new();
        for (name, medium) in &self.description.media {
            self.medium_ids.insert(name, media.len() as u32);
            let at = written::field(&["media", name]);
            media.push(self.medium(&at, medium));
        }
        media
    }

    /// What the camera is in, and all that no body is in.
    fn camera_medium(&self) -> Option<u32> {
        self.description.medium.as_ref().map(|name| self.medium_ids[name.as_str()])
    }

    /// The lights that are no shapes, behind those that are.
    fn lights(&mut self, lamps: &mut Lamps) -> Result<()> {
        self.lie_on(Surface::Light);
        for (i, light) in self.description.lights.iter().enumerate() {
            let at = format!("lights[{i}].{}", light.kind());
            let weight = light.sampling_weight();
            let made = self.skies.remove(&i).unwrap_or_else(|| self.light(&at, light));
            let name = light.name_or_kind(i);
            match made? {
                Some(light) if light.is_dark() => lamps.dark.push(name),
                Some(light) => {
                    lamps.lights.push(light);
                    lamps.names.push(name);
                    lamps.weights.push(weight);
                }
                None => {}
            }
        }
        self.lie_on(Surface::Unknown);
        Ok(())
    }

    /// How rays find what stands in the scene itself: few things side by side, meshes that belong together in one tree, the
    /// rest in another.
    fn search(&self, objects: &mut [Object], boxes: &[Aabb]) -> Search {
        let all: Vec<u32> = (0..objects.len() as u32).collect();
        // The box of one small mesh among few things is met side by side with theirs.
        let mut meshes = objects.iter().filter_map(|object| match &object.geometry {
            Geometry::Mesh(mesh) => Some((mesh, &self.materials[object.material as usize])),
            _ => None,
        });
        let one = meshes.next().filter(|_| meshes.next().is_none());
        // Boundaries are better found together.
        let is_small = |mesh: &TriangleMesh| mesh.tree.as_ref().is_some_and(MeshTree::is_small);
        let one = one.filter(|(mesh, material)| is_small(mesh) && !material.lets_through());
        let few = one.and_then(|_| Few::of(objects, &all, boxes));
        let opaque = |object: &Object| object.body == 0 && !self.materials[object.material as usize].lets_through();
        let together = if few.is_none() { Together::take(objects, boxes, opaque) } else { None };
        let alone: Vec<u32> = all.into_iter().filter(|&i| !together.as_ref().is_some_and(|t| t.holds(i))).collect();
        let bvh = Bvh::build(&alone.iter().map(|&i| boxes[i as usize]).collect::<Vec<Aabb>>()).named(&alone);
        let few = few.or_else(|| Few::of(objects, &alone, boxes));
        Search { bvh, few, together }
    }

    fn depth_fog(&mut self) -> Option<DepthFog> {
        let fog = self.description.fog.as_ref()?;
        Some(DepthFog {
            colour: self.spectrum("fog.colour", &fog.colour, Outside::Zero, Role::Light),
            falloff: match fog.law {
                written::FogLaw::Linear { start, end } => FogFalloff::Linear { start, end },
                written::FogLaw::Exponential { density, falloff: written::Falloff::Exp } => {
                    FogFalloff::Exponential { density }
                }
                written::FogLaw::Exponential { density, falloff: written::Falloff::Exp2 } => {
                    FogFalloff::ExponentialSquared { density }
                }
            },
        })
    }

    fn volumes_and_materials(&mut self) -> Result<()> {
        let d = self.description;
        for (name, volume) in &d.volumes {
            let compiled = self.volume(&written::field(&["volumes", name]), volume)?;
            self.volumes.insert(name, compiled);
        }
        for name in d.materials.keys() {
            let (material, asked) = self.asking(|c| c.named_material(name).as_ref().clone());
            if asked {
                self.on_surface.insert(name);
            }
            self.material_ids.insert(name, self.materials.len() as u32);
            self.materials.push(material);
        }
        Ok(())
    }
}

/// Centre and radius of all that has an end, in `boxes` of what stands in the scene or beside what has none in a copied group;
/// about the camera where nothing has.
fn extent(objects: &[Object], boxes: &[Aabb], camera: &Camera) -> (DVec3, f64) {
    let copied = objects.iter().zip(boxes).filter(|(_, bounds)| !bounds.is_finite()).flat_map(|(object, _)| {
        let Geometry::Instance(instance) = &object.geometry else { return Vec::new() };
        instance.group.members().map(|child| instance.map.bounds(&objects[child].bounds())).collect()
    });
    let finite = boxes.iter().copied().chain(copied).filter(Aabb::is_finite);
    match finite.reduce(|a, b| a.union(&b)) {
        Some(b) => (b.min * 0.5 + b.max * 0.5, 0.5 * (b.max - b.min).length()),
        None => (camera.world_from_camera.translation, 1.0),
    }
}

/// How far from the middle of `scene` what sends out `light` is at the most, where light from infinity may be `lost`.
fn range(scene: &Scene, light: &Light, lost: bool) -> f64 {
    match light {
        Light::Area { object, .. } | Light::AlongNormal { object, .. } => {
            let ends = scene.objects[*object as usize].bounds().is_finite();
            if ends { scene.radius } else { f64::INFINITY }
        }
        _ => match light.position() {
            Some(position) => position.distance(scene.center),
            None if lost => 0.0,
            None => f64::INFINITY,
        },
    }
}

/// Scenes for tests.
#[cfg(test)]
pub(crate) mod testing {
    use super::{Scene, Shelf, compile_with};
    use crate::description::SceneDescription;
    use std::path::Path;

    /// The scene of `text`.
    pub(crate) fn compiled(text: &str) -> Scene {
        compiled_in(Path::new(""), text)
    }

    /// The scene of `text` in a directory that has the files which it names.
    pub(crate) fn compiled_in(directory: &Path, text: &str) -> Scene {
        compiled_with(directory, text, &mut Shelf::default())
    }

    /// The same with what the scene before it has read.
    pub(crate) fn compiled_with(directory: &Path, text: &str, shelf: &mut Shelf) -> Scene {
        let description = SceneDescription::parse(text, &directory.join("s.yaml")).unwrap();
        compile_with(&description, "s", shelf).unwrap()
    }
}
