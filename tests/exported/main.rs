//! A scene that is written for Mitsuba and read back is the same scene: it gives the same picture.

mod camera;
#[path = "../common/mod.rs"]
mod common;
mod sides;
mod words;

use abbe::batch::{self, Overrides};
use abbe::description;
use abbe::math::Ray;
use abbe::scene::{load, mesh, sdf};
use common::Bench;
use glam::DVec3;
use std::path::{Path, PathBuf};

/// A small picture of few samples, the same for both.
fn small() -> Overrides {
    let set = [("image.width", "24"), ("image.height", "16"), ("image.crop", "null"), ("render.samples", "8")];
    Overrides { set: set.map(|(key, value)| (key.to_owned(), value.to_owned())).to_vec(), ..Overrides::default() }
}

/// Every scene that is shipped.
fn shipped() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/scenes");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()).collect();
    files.sort();
    files
}

/// The export of a scene as the verb makes it.
fn exported(scene: &description::SceneDescription, xml: &Path) -> description::Exported {
    description::export(scene, xml, &mesh::FOR_EXPORT, &load::for_mitsuba, &sdf::is_closed)
}

/// The scene of `file`, and what its export says; the export is read where `again` says so.
fn prepared(file: &Path, directory: &Path, again: bool) -> (batch::Prepared, description::Exported) {
    let overrides = small();
    let entry = batch::entries(file, &overrides).unwrap_or_else(|error| panic!("{error}")).remove(0);
    let xml = directory.join("scene.xml");
    let scene = entry.scene(&overrides.set).unwrap_or_else(|error| panic!("{error}"));
    let exported = exported(&scene, &xml);
    if !again {
        return (batch::prepare(&entry, &overrides).unwrap_or_else(|error| panic!("{error}")), exported);
    }
    std::fs::write(&xml, &exported.xml).unwrap();
    for (name, bytes) in &exported.files {
        std::fs::write(directory.join(name), bytes).unwrap();
    }
    let none = Overrides::default();
    let entry = batch::entries(&xml, &none).unwrap_or_else(|error| panic!("{error}")).remove(0);
    let read = batch::prepare(&entry, &none);
    (read.unwrap_or_else(|error| panic!("{}: {error}\n{}", file.display(), exported.xml)), exported)
}

/// A scene in a directory of its own, with the files that it names.
struct Folder {
    directory: tempfile::TempDir,
    yaml: PathBuf,
}

impl Folder {
    fn new() -> Folder {
        let directory = tempfile::tempdir().unwrap();
        Folder { yaml: directory.path().join("s.yaml"), directory }
    }

    /// Puts a file beside the scene.
    fn add(&self, name: &str, bytes: &[u8]) {
        common::write(&self.directory.path().join(name), bytes);
    }

    /// Puts `scene` in place of the one before.
    fn write(&self, scene: &str) {
        common::write(&self.yaml, scene.as_bytes());
    }

    /// What the export of `scene` says.
    fn export(&self, scene: &str) -> description::Exported {
        self.write(scene);
        prepared(&self.yaml, self.directory.path(), false).1
    }

    /// The same of a scene that comes back.
    fn export_and_back(&self, scene: &str) -> description::Exported {
        let exported = self.export(scene);
        same_picture(&self.yaml);
        exported
    }
}

/// What an export loses, field by field.
fn told(exported: &description::Exported) -> Vec<String> {
    exported.losses.iter().map(|loss| format!("{}: {}", loss.field, loss.instead)).collect()
}

/// Placing by a matrix rather than by steps rounds otherwise, in the sixteenth digit: a path then goes the same way
/// but for one in a billion, and its light differs in the seventh digit, the last of f32. The lattice of wavelengths
/// is chosen from the same spectra. So all pixels agree within 1e-4 of the mean but for those, at most 1 in 100, in
/// which a path went another way.
#[test]
fn every_shipped_scene_comes_back_from_mitsubas_xml() {
    let files = shipped();
    assert!(files.len() >= 15);
    files.iter().for_each(|file| same_picture(file));
}

/// What covers the picture comes back, too.
fn same_picture(file: &Path) {
    let pictures = [false, true].map(|again| {
        let directory = tempfile::tempdir().unwrap();
        let (prepared, _) = prepared(file, directory.path(), again);
        Bench { prepared, directory }.picture()
    });
    let [ours, theirs] = pictures.each_ref().map(|picture| picture.alpha.iter());
    let uncovered = ours.zip(theirs).filter(|(a, b)| (*a - *b).abs() > 1e-4).count();
    assert!(uncovered * 100 <= pictures[0].alpha.len(), "{}: alpha of {uncovered} pixels differs", file.display());
    let mean = pictures[0].y.iter().sum::<f64>() / pictures[0].y.len() as f64;
    assert!(mean > 0.0, "{}: the picture is black", file.display());
    let differing = pictures[0].y.iter().zip(&pictures[1].y).filter(|(a, b)| (*a - *b).abs() > 1e-4 * mean).count();
    assert!(differing * 100 <= pictures[0].y.len(), "{}: {differing} pixels differ", file.display());
}

/// What Mitsuba has words for is not said in ours.
#[test]
fn a_scene_of_plain_things_loses_nothing() {
    let folder = Folder::new();
    let scene = "
camera: {origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40, fov_axis: y, lens: {radius: 0.1, focus_distance: 5}}
image: {filter: {gaussian: {stddev: 0.4}}}
integrator: {path: {delta_caustics: false, opaque_sky: true}}
media: {smoke: {homogeneous: {absorption: 0.1, scattering: 0.3, phase: {hg: 0.5}}}}
textures: {board: {checkerboard: {a: 0.2, b: {rgb: [0.2, 0.5, 0.8]}, scale: [4, 4]}}}
materials:
  floor: {diffuse: {reflectance: {texture: board}}}
  metal: {conductor: {eta: {table: [[400, 1.2], [700, 0.3]]}, k: 3, roughness: 0.2, distribution: beckmann}}
  glass: {dielectric: {ior: 1.5, exterior_ior: 1.33}}
  unused: {dielectric: {ior: {glass: N-SF11}}}
shapes:
- rectangle: {corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: floor}
- sphere: {center: [0, 1, 0], radius: 0.5, material: metal, name: ball}
- sphere: {center: [1, 0.5, 0], radius: 0.4, material: glass, inside: smoke}
- cube: {size: [1, 2, 0.5], transform: [{rotate: {axis: [0, 1, 0], deg: 30}}, {translate: [-1, 1, -1]}]}
- disk: {center: [0, 3, 0], normal: [0, -1, 0], radius: 0.5, emission: {scaled: {by: 3, of: {illuminant: D65}}}}
lights:
- point: {position: [2, 3, 1], intensity: {table: [[400, 1], [700, 2]]}}
- spot: {position: [2, 3, 3], direction: [-1, -1, -1], intensity: {rgb: [1, 2, 3]}}
- constant: {radiance: 0.1}
";
    let exported = folder.export_and_back(scene);
    assert_eq!(exported.losses, []);
    assert!(!exported.xml.contains("instead"), "{}", exported.xml);

    // What its glass throws of the point and the spot, no path tracer of Mitsuba's finds.
    let caustics = scene.replace("delta_caustics: false, opaque_sky: true", "opaque_sky: true");
    let exported = folder.export_and_back(&caustics);
    let losses: Vec<&str> = exported.losses.iter().map(|loss| loss.field.as_str()).collect();
    assert_eq!(losses, ["integrator.path.delta_caustics"]);
}

/// Mitsuba 3.9.1 shows no light of a `directionalarea` but by `ptracer`, which sees no media; distances need none.
#[test]
fn light_along_normals_is_lost_where_paths_start_at_the_camera() {
    let folder = Folder::new();
    let losses = |integrator: &str, media: &str| {
        let scene = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}}\nintegrator: {integrator}\n{media}shapes:\n\
             - rectangle: {{corner: [-2, -1, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: {{diffuse: {{}}}}}}\n\
             - disk: {{center: [0, 3, 0], normal: [0, -1, 0], radius: 0.5, emission: 1, emission_direction: normal}}\n\
             - disk: {{center: [1, 3, 0], normal: [0, -1, 0], radius: 0.5, emission: 1}}\n"
        );
        folder.export_and_back(&scene).losses.into_iter().map(|loss| loss.field).collect::<Vec<String>>()
    };
    let lamp = "shapes[1].disk.emission_direction";
    let media = "media: {smoke: {homogeneous: {scattering: 1}}}\nmedium: smoke\n";
    assert_eq!(losses("path", ""), [lamp]);
    assert_eq!(losses("{light_tracer: {count_crossings: true}}", ""), [""; 0]);
    assert_eq!(losses("{light_tracer: {count_crossings: true}}", media), ["integrator.light_tracer", lamp]);
    assert_eq!(losses("depth", ""), [""; 0]);
}

/// Paths from the lights are cut short by panes there, which matters where paths end and panes are.
#[test]
fn paths_of_the_light_tracer_are_shorter_there() {
    let folder = Folder::new();
    let losses = |depth: &str, material: &str| {
        let scene = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}}\nintegrator: {{light_tracer: {{{depth}}}}}\nshapes:\n\
             - sphere: {{radius: 0.5, material: {material}}}\n\
             - rectangle: {{corner: [-2, -1, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: {{diffuse: {{}}}}}}\n\
             - disk: {{center: [0, 3, 0], normal: [0, -1, 0], radius: 0.5, emission: 1}}\n"
        );
        folder.export_and_back(&scene).losses.into_iter().map(|loss| loss.field).collect::<Vec<String>>()
    };
    let pane = "{thin_dielectric: {ior: 1.5}}";
    assert_eq!(losses("max_depth: 4", pane), ["integrator.light_tracer.count_crossings"]);
    assert_eq!(losses("max_depth: 4, count_crossings: true", pane), [""; 0]);
    assert_eq!(losses("max_depth: 4", "{diffuse: {}}"), [""; 0]);
    assert_eq!(losses("", pane), [""; 0]);
}

/// Materials made of others, principled ones, media of volumes, groups, curves, distances on a grid and textures of all
/// kinds have plugins of Mitsuba's, and nothing of ours is left in the file.
#[test]
fn a_scene_of_all_that_mitsuba_has_plugins_for_loses_nothing() {
    let root = env!("CARGO_MANIFEST_DIR");
    let folder = Folder::new();
    let scene = format!(
        "
camera: {{origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 50}}
integrator: {{path: {{delta_caustics: false, opaque_sky: true}}}}
medium: haze
volumes:
  puff: {{grid: {{file: {root}/tools/cross_validate/mitsuba/assets/puff.vol, transform: [{{translate: [-3, 0, 0]}}]}}}}
  mix: {{constant: {{value: 0.4}}}}
media:
  haze: {{homogeneous: {{absorption: {{table: [[400, 0.01], [700, 0.02]]}}}}}}
  cloud:
    heterogeneous:
      extinction: {{volume: puff}}
      albedo: {{rgb: [0.9, 0.8, 0.7]}}
      scale: 4
      phase: {{blend: {{weight: {{volume: mix}}, of: [rayleigh, {{table: [1, 2, 4]}}]}}}}
textures:
  board: {{checkerboard: {{a: 0.1, b: 0.7, scale: [3, 3]}}}}
  coat: {{checkerboard: {{a: {{rgb: [0.6, 0.3, 0.2]}}, b: 0.3}}}}
  waves: {{image: {{file: {root}/tools/cross_validate/mitsuba/assets/waves.png, raw: true}}}}
  normals: {{image: {{file: {root}/tools/cross_validate/mitsuba/assets/normals.png, raw: true}}}}
  through: {{volume: mix}}
  painted: {{mesh_attribute: {{name: vertex_color}}}}
materials:
  car: {{principled: {{base_color: {{texture: coat}}, roughness: {{texture: board}}, metallic: 0.3, clearcoat: 0.5}}}}
  leaf: {{principled_thin: {{base_color: 0.4, diff_trans: 0.8, spec_trans: 0.2}}}}
  strand: {{hair: {{absorption: 0.3, ior: 1.5}}}}
  lace: {{mask: {{opacity: {{texture: board}}, material: car}}}}
  patched: {{blend: {{weight: {{texture: board}}, first: {{diffuse: {{}}}}, second: {{conductor: {{eta: 0.2, k: 3}}}}}}}}
  a_page: {{two_sided: {{front: {{diffuse: {{reflectance: {{texture: through}}}}}}, back: car}}}}
  pool: {{bump: {{height: {{texture: waves}}, scale: 0.1, material: {{diffuse: {{}}}}}}}}
  tiles: {{normal_map: {{normals: {{texture: normals}}, shadowing: false, material: {{plastic: {{}}}}}}}}
  mosaic: {{diffuse: {{reflectance: {{texture: painted}}}}}}
groups:
  pair:
  - sphere: {{radius: 0.3, layout: z_up, material: car}}
  - cube: {{center: [0.5, 0, 0], size: 0.4, layout: z_up, material: patched}}
shapes:
- rectangle: {{corner: [-4, 0, 4], edge_u: [8, 0, 0], edge_v: [0, 0, -8], material: pool, outside: haze, inside: haze}}
- rectangle: {{corner: [-1, 0, -2], edge_u: [2, 0, 0], edge_v: [0, 2, 0], material: tiles}}
- rectangle: {{corner: [1, 0, -2], edge_u: [1, 0, 1], edge_v: [0, 2, 0], material: lace, inside: unchanged, outside: unchanged}}
- rectangle: {{corner: [2, 0, -2], edge_u: [1, 0, 1], edge_v: [0, 2, 0], material: leaf, inside: haze, outside: haze}}
- rectangle: {{corner: [-3, 0, -1], edge_u: [1, 0, 1], edge_v: [0, 2, 0], material: a_page}}
- cube: {{center: [-2.5, 0.5, 0.5], size: 1, layout: z_up, material: {{boundary: {{}}}}, inside: cloud, outside: haze}}
- instance: {{group: pair, transform: [{{scale: 1.5}}, {{translate: [0, 1, 0]}}]}}
- instance: {{group: pair, transform: [{{translate: [1.5, 0.4, 1]}}]}}
- curves: {{file: {root}/tools/cross_validate/mitsuba/assets/tuft.txt, basis: bspline, material: strand, inside: haze, outside: haze}}
- sdf_grid: {{file: {root}/tools/cross_validate/mitsuba/assets/ring_and_ball.vol, material: car, transform: [{{translate: [-1.5, 0, 1]}}]}}
- mesh: {{file: {root}/tools/cross_validate/mitsuba/assets/tile.ply, normals: vertex, winding: world, material: mosaic, transform: [{{translate: [0, 0.3, 2]}}]}}
lights:
- constant: {{radiance: 0.5, sampling_weight: 2}}
- projector: {{origin: [0, 3, 5], target: [0, 0, 0], fov_deg: 30, irradiance: {{texture: waves}}}}
- spot: {{position: [3, 4, 3], target: [0, 0, 0], intensity: 20, texture: coat, cutoff_deg: 30}}
"
    );
    let exported = folder.export_and_back(&scene);
    assert_eq!(exported.losses, []);
    assert!(!exported.xml.contains("instead"), "{}", exported.xml);
}

/// Where u begins is seen by layers alone where nothing has a picture on it; the seam comes back with the world's transform.
#[test]
fn the_seam_of_a_cylinder_comes_back() {
    let tube = "cylinder: {base: [0, 0, 0], top: [0.3, 1, 0.4], radius: 0.4, caps: none";
    for more in
        ["", ", seam: [0, 0, 1]", ", seam: [1, 0, 2], transform: [{scale: 1.5}, {rotate: {axis: [1, 2, 3], deg: 40}}]"]
    {
        let folder = Folder::new();
        let camera = "camera: {origin: [0, 0.5, 5], target: [0, 0.5, 0], fov_deg: 40}";
        folder.write(&format!("{camera}\nintegrator: none\nshapes: [{{{tube}{more}}}}}]\n"));
        let ray = Ray::new(DVec3::new(0.1, 0.4, 5.0), DVec3::NEG_Z);
        let [ours, theirs] = [false, true].map(|again| {
            let (prepared, _) = prepared(&folder.yaml, folder.directory.path(), again);
            let hit = prepared.scene.closest(&ray, f64::INFINITY).unwrap();
            prepared.scene.surface(&ray, &hit).uv
        });
        assert!((ours - theirs).length() < 1e-12, "{more}: {ours} {theirs}");
    }
}

/// Each loss names its field, and its reason names what Mitsuba lacks.
#[test]
fn what_mitsuba_lacks_is_told_by_name() {
    let folder = Folder::new();
    let exported = folder.export(
        "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nfog: {colour: 1, density: 1}\nmaterials:\n  flint: {dielectric: {ior: {glass: N-SF11}}}\nshapes:\n- cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 1, material: flint}\n- plane: {normal: [0, 1, 0]}\n",
    );
    assert_eq!(
        told(&exported),
        [
            "fog: nothing: Mitsuba has no fog by depth",
            // n_d of N-SF11 by its data sheet: 1.78472.
            "materials.flint: the index at 587.5618 nm, 1.7847 over 1.0000: Mitsuba has no dispersion",
            // 1 - cos(pi/256) = 7.53e-5.
            "shapes[0]: a mesh of 256 sides, at most 7.53e-5 m inside: Mitsuba has no cone",
            "shapes[1]: a square of 5 km: Mitsuba has no plane without end",
        ]
    );
    assert_eq!(exported.files.len(), 1);
}

/// Bands are a film of Mitsuba's, too, unless one is of a colour.
#[test]
fn bands_are_exported() {
    let folder = Folder::new();
    let back = |response: &str| {
        let scene = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nintegrator: {{path: {{opaque_sky: true}}}}\nlights: [{{constant: {{radiance: 1}}}}]\nimage:\n  bands:\n  \
             - {{name: first, response: {{table: [[400, 1], [450.5, 0.25]]}}}}\n  - {{name: 'S0.500,0nm', response: {response}}}\n"
        );
        folder.write(&scene);
        let scene_of = |file: &Path| {
            let none = Overrides::default();
            let entry = batch::entries(file, &none).unwrap_or_else(|error| panic!("{error}")).remove(0);
            entry.scene(&none.set).unwrap_or_else(|error| panic!("{error}"))
        };
        let ours = scene_of(&folder.yaml);
        let xml = folder.directory.path().join("s.xml");
        let exported = exported(&ours, &xml);
        std::fs::write(&xml, &exported.xml).unwrap();
        let theirs = scene_of(&xml);
        (ours.image.bands, theirs.image.bands, exported)
    };
    for response in ["2", "{scaled: {by: 3, of: {table: [[500, 1], [600, 1]]}}}", "{illuminant: D65}"] {
        let (ours, theirs, exported) = back(response);
        assert_eq!(exported.losses, []);
        assert!(exported.xml.contains("<film type=\"specfilm\">"), "{}", exported.xml);
        let names = |bands: &[description::Band]| bands.iter().map(|band| band.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&ours), names(&theirs));
    }
    assert!(back("2").2.xml.contains("<spectrum name=\"S0.500,0nm\" value=\"360:2, 830:2\"/>"));
    for response in ["{rgb: [1, 0.5, 0.2]}", "{blackbody: {kelvin: 4000, normalised: false}}"] {
        let (ours, theirs, exported) = back(response);
        assert_eq!(ours, theirs);
        assert_eq!(exported.losses[0].field, "image.bands");
        assert!(exported.xml.contains("<film type=\"hdrfilm\">"), "{}", exported.xml);
    }
}

/// A PGM, which Mitsuba refuses, stands in a new file, one for all who name it; read back, the scene is what it was.
#[test]
fn pictures_that_mitsuba_refuses_are_written_beside_the_scene() {
    let directory = tempfile::tempdir().unwrap();
    let pgm = b"P5\n2 1\n255\n\x10\xa0";
    common::write(&directory.path().join("a.pgm"), pgm);
    let yaml = directory.path().join("s.yaml");
    let scene = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nintegrator: {path: {opaque_sky: true}}\n\
                 textures: {t: {image: {file: a.pgm}}}\nshapes: [{rectangle: {corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], \
                 material: {diffuse: {reflectance: {texture: t}}}}}]\nlights: [{environment: {file: a.pgm, mapping: mitsuba}}]\n";
    common::write(&yaml, scene.as_bytes());
    let (_, exported) = prepared(&yaml, directory.path(), false);
    assert_eq!(exported.losses, []);
    let names: Vec<&str> = exported.files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["scene.picture0.png"]);
    assert_eq!(
        exported.xml.matches("<string name=\"filename\" value=\"scene.picture0.png\"/>").count(),
        2,
        "{}",
        exported.xml
    );
    same_picture(&yaml);
}

/// Mitsuba has one environment.
#[test]
fn a_second_environment_is_told() {
    let folder = Folder::new();
    let scene = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nintegrator: {path: {opaque_sky: true}}\nshapes: [{sphere: {radius: 1}}]\n\
                 lights: [{constant: {radiance: 0.5}}, {constant: {radiance: {rgb: [0.1, 0.5, 0.3]}}}]\n";
    assert_eq!(told(&folder.export_and_back(scene)), ["lights[1]: nothing: Mitsuba has one environment"]);
}

/// Light adds up: a sky and its sun, each by itself, are one sky for Mitsuba. Two that are not alike are not.
#[test]
fn skies_that_are_alike_are_one() {
    let folder = Folder::new();
    let export = |second: &str| {
        let scene = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nintegrator: {{path: {{opaque_sky: true}}}}\nshapes: [{{sphere: {{radius: 1}}}}]\n\
             light_groups: {{day: [air], noon: [disc]}}\nlights:\n\
             - sky: {{name: air, sun: {{elevation_deg: 40}}, turbidity: 2, sky_scale: 0.5, sun_scale: 0}}\n\
             - sky: {{name: disc, sun: {{elevation_deg: 40}}, {second}, sky_scale: 0, sun_scale: 0.25}}\n"
        );
        folder.export_and_back(&scene)
    };
    let exported = export("turbidity: 2");
    assert_eq!(exported.losses, []);
    assert_eq!(exported.xml.matches("<emitter type=\"sunsky\"").count(), 1, "{}", exported.xml);
    for scale in ["<float name=\"sky_scale\" value=\"0.5\"/>", "<float name=\"sun_scale\" value=\"0.25\"/>"] {
        assert!(exported.xml.contains(scale), "{}", exported.xml);
    }
    assert_eq!(export("turbidity: 3").losses[0].instead, "nothing: Mitsuba has one environment");
}

/// A file that Mitsuba refuses is written anew, once, beside the scene: nothing is lost, and reading it back takes the file.
#[test]
fn meshes_that_mitsuba_does_not_read_are_written_anew() {
    let folder = Folder::new();
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n4 0 1 2 3\n";
    folder.add("square.ply", ply.as_bytes());
    let obj = "v -1 -1 1\nv 1 -1 1\nv 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\n";
    folder.add("back.obj", format!("{obj}f -3/-3 -2/-2 -1/-1\n").as_bytes());
    folder.add("plain.obj", format!("{obj}f 1/1 2/2 3/3\n").as_bytes());
    let of = |file: &str, more: &str| {
        format!("- mesh: {{file: {file}, normals: vertex, winding: world, flip_v: true, {more}}}\n")
    };
    let scene = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nintegrator: {path: {opaque_sky: true}}\nlights: [{constant: {radiance: 1}}]\n\
                 textures: {board: {checkerboard: {a: 0.2, b: 0.7, scale: [4, 3]}}}\nmaterials: {m: {diffuse: {reflectance: {texture: board}}}}\n\
                 shapes:\n"
        .to_owned()
        + &["square.ply", "back.obj", "plain.obj", "back.obj"].map(|file| of(file, "material: m")).concat();
    let exported = folder.export_and_back(&scene);
    assert_eq!(exported.losses, []);
    let names: Vec<&str> = exported.files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["scene.shape0.ply", "scene.shape1.ply"]);
    for (name, times) in [(names[0], 1), (names[1], 2), ("plain.obj", 1)] {
        let found = exported.xml.matches(&format!("name=\"filename\" value=\"{name}\"")).count();
        assert_eq!(found, times, "{name}: {}", exported.xml);
    }
}

/// Mitsuba's colours of optical constants end at 1.
#[test]
fn colours_of_metals_above_one_are_told() {
    let folder = Folder::new();
    let losses = |eta: &str| {
        let scene = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nintegrator: {{path: {{opaque_sky: true}}}}\nshapes:\n\
             - sphere: {{radius: 0.5, material: {{conductor: {{eta: {eta}, k: 1, distribution: beckmann}}}}}}\n\
             lights: [{{constant: {{radiance: 1}}}}]\n"
        );
        told(&folder.export_and_back(&scene))
    };
    assert_eq!(losses("{rgb: [0.2, 0.9, 1]}"), [""; 0]);
    let sampled = "shapes[0].sphere.material: its colour at every fifth nanometre: Mitsuba has none above 1 there, and no multiples";
    assert_eq!(losses("{rgb: [0.2, 0.9, 1.1]}"), [sampled]);
    assert_eq!(losses("{scaled: {by: 2, of: {rgb: [0.2, 0.5, 0.4]}}}"), [sampled]);
}

/// Films, absorption, priorities and indices from files come back by the lines that Mitsuba passes over.
#[test]
fn optical_materials_come_back() {
    let folder = Folder::new();
    let metal = b"DATA:\n- type: tabulated nk\n  data: |\n    0.3 0.2 3\n    0.9 0.6 9\n";
    folder.add("m.yml", metal);
    folder.add("w.csv", b"wl,n,k\n0.3,1.4,1e-8\n0.9,1.3,2e-7\n");
    let exported = folder.export_and_back(
        "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nshapes:\n\
        - sphere: {center: [-1, 0, 0], radius: 0.5, material: {conductor: {file: m.yml, film: {ior: 2.4, thickness_nm: 50}}}}\n\
        - sphere: {radius: 0.4, material: {dielectric: {ior: {file: w.csv}, absorption: {color: 0.5, at: 0.3}, priority: 2}}}\n\
        - sphere: {center: [0.3, 0, 0], radius: 0.4, material: {dielectric: {ior: 1.5, priority: 1, film: {ior: {formula: \
          {number: 5, coefficients: [1.4, 0.003, -2]}}, thickness_nm: 300}}}}\n\
        - sphere: {center: [1.2, 0, 0], radius: 0.4, material: {thin_dielectric: {ior: 1.33, thickness_nm: 300}}}\n\
        lights: [{constant: {radiance: 0.8}}]\n",
    );
    let told = &exported.losses[1].instead;
    assert!(told.contains("no absorption") && told.contains("no priority"), "{told}");
}

/// A body that takes light away inside stands in smoke: Mitsuba names that medium alone, by which its inside would be empty.
#[test]
fn a_body_that_absorbs_in_a_medium_comes_back() {
    let folder = Folder::new();
    for side in ["", ", outside: fog"] {
        let _ = folder.export_and_back(&format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nmedia: {{fog: {{homogeneous: {{scattering: 0.05}}}}}}\n\
             medium: fog\nshapes:\n\
             - sphere: {{radius: 0.5, material: {{dielectric: {{ior: 1.5, absorption: {{color: 0.5, at: 0.5}}}}}}{side}}}\n\
             - sphere: {{center: [0, 3, 0], radius: 1, emission: 5}}\n",
        ));
    }
}

/// What the paths of lamps without extent are aimed at here, and is told as missing there: materials that throw light in single
/// directions, be it a part of it.
#[test]
fn what_is_made_of_mirrors_is_told_as_a_mirror_is() {
    let folder = Folder::new();
    let loses = |material: &str| {
        let scene = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}}\ntextures: {{board: {{checkerboard: {{a: 0, b: 1}}}}}}\nshapes:\n\
             - sphere: {{radius: 0.5, material: {material}}}\nlights: [point: {{position: [2, 3, 1], intensity: 1}}]\n"
        );
        folder.export(&scene).losses.iter().any(|loss| loss.field == "integrator.path.delta_caustics")
    };
    let blend = |second: &str| format!("{{blend: {{first: {{mirror: {{}}}}, second: {{{second}: {{}}}}}}}}");
    assert!(loses("{mirror: {}}"));
    assert!(loses("{bump: {height: {texture: board}, scale: 0.01, material: {mirror: {}}}}"));
    assert!(loses(&blend("boundary")));
    assert!(loses(&blend("diffuse")));
    assert!(loses("{plastic: {}}"));
    assert!(!loses("{plastic: {roughness: 0.1}}"));
    assert!(!loses("{boundary: {}}"));
}

/// Lamps are called what they were, be it what a material or shape is called; the groups of the file name them. The sky has no
/// alpha of its own, nor has what is behind a pane.
#[test]
fn lamps_keep_their_names_and_pictures_their_alpha() {
    let folder = Folder::new();
    let exported = folder.export_and_back(
        "camera: {origin: [0, 1, 5], target: [0, 0.5, 0], fov_deg: 40}\nlayers: [light_groups, crypto_object]\n\
          light_groups: {key: [sun], fill: [sky, panel], red: [clay]}\nassets: {all: [clay thing, gold]}\n\
          integrator: {path: {max_depth: 4, light_samples: 2, count_crossings: true}}\nmedia: {smoke: {homogeneous: {scattering: 1}}}\n\
          materials: {clay: {diffuse: {}}, gold: {conductor: {metal: gold}}}\nshapes:\n\
          - sphere: {name: clay thing, radius: 0.5, material: clay}\n\
          - sphere: {name: gold, center: [1, 0, 0], radius: 0.5, material: gold}\n\
          - sphere: {name: panel, center: [-1, 3, 1], radius: 0.5, emission: 2}\n\
          - sphere: {center: [-1, 0.5, 1], radius: 0.4, material: {thin_dielectric: {ior: 1.5}}}\n\
          - sphere: {center: [1, 1, 1], radius: 0.3, material: {boundary: {}}, inside: smoke}\n\
          lights:\n- constant: {name: sky, radiance: 0.3}\n- directional: {name: sun, direction: [1, -2, -1], irradiance: 0.5}\n\
          - point: {name: clay, position: [0, 3, 3], intensity: {rgb: [3, 0, 0]}}\n",
    );
    let told: Vec<&str> = exported.losses.iter().map(|loss| loss.field.as_str()).collect();
    for field in ["opaque_sky", "coverage", "count_crossings"] {
        assert!(told.contains(&format!("integrator.path.{field}").as_str()), "{field}: {told:?}");
    }
    for said in
        ["id=\"clay (emitter)\"", "opaque_sky: false", "coverage: surfaces", "light_samples: 2", "type=\"volpath\""]
    {
        assert!(exported.xml.contains(said), "{said}: {}", exported.xml);
    }

    // Paths from the lights that meet media are no ptracer's.
    let text = std::fs::read_to_string(&folder.yaml).unwrap();
    let traced = text.replace("layers: [light_groups, crypto_object]\n", "");
    let (from, to) = (traced.find("integrator").unwrap(), traced.find("\nmedia").unwrap());
    let traced = format!("{}integrator: light_tracer{}", &traced[..from], &traced[to..]);
    let losses = folder.export_and_back(&traced).losses;
    assert!(losses.iter().any(|loss| loss.field == "integrator.light_tracer"), "{losses:?}");
}

/// A picture on a plane repeats by the metre along the tangent for Mitsuba, too, which reads none of our instructions, and turns with
/// it; a plane that is mirrored keeps its front. One on a tube begins at the seam. What else has no texture coordinates there, or
/// others, is told.
#[test]
fn pictures_on_planes_and_tubes_stay_where_they_are() {
    let folder = Folder::new();
    let scene = |more: &str| {
        format!(
            "camera: {{origin: [0.3, 2, 4], target: [0.2, 0, 0], fov_deg: 40}}\nintegrator: {{path: {{max_depth: 2}}}}\n\
             image: {{width: 24, height: 16}}\nrender: {{samples: 8}}\n\
             textures: {{board: {{checkerboard: {{a: 0.1, b: 0.8}}}}, small: {{checkerboard: {{a: 0.1, b: 0.8, scale: [7, 5]}}}}}}\n\
             materials: {{tiles: {{diffuse: {{reflectance: {{texture: board}}}}}}, squares: {{diffuse: {{reflectance: {{texture: small}}}}}}, \
             one: {{two_sided: {{front: tiles, back: {{diffuse: {{reflectance: 0}}}}}}}}}}\n\
             shapes:\n{more}lights: [point: {{position: [1, 3, 2], intensity: 5}}]\n"
        )
    };
    let planes = [
        "- plane: {point: [0, -0.2, 0], normal: [0, 2, 0], tangent: [3, 0, 1], material: tiles}\n",
        "- plane: {point: [0, -0.2, 0], normal: [0, 1, 0], tangent: [3, 0, 1], material: one, transform: [scale: [-0.7, 1, 0.5]]}\n",
        "- plane: {point: [0, -0.2, 0], normal: [0, 1, 0], material: tiles, transform: [rotate: {axis: [0, 1, 0], deg: 30}]}\n",
        "- plane: {point: [0, -0.2, 0], normal: [0, 1, 0], material: {two_sided: {front: {diffuse: {}}, back: {diffuse: {reflectance: 0}}}}, transform: [scale: [-1, 1, 1]]}\n",
        "- cylinder: {base: [0, 1, 0], top: [0.3, -0.8, 0.1], radius: 0.9, caps: none, material: squares}\n",
        "- cylinder: {base: [0, -0.8, 0], top: [0.3, 0.8, 0.1], radius: 0.7, caps: none, seam: [0.2, 0.3, 1], material: squares, \
         transform: [{scale: 1.2}, {rotate: {axis: [1, 2, 3], deg: 40}}]}\n",
        "- cylinder: {base: [0, -0.8, 0], top: [0.3, 0.8, 0.1], radius: 0.8, caps: none, seam: [1, 0, 1], material: squares, \
         transform: [scale: [-1, 1, 1]]}\n",
    ];
    for plane in planes {
        folder.write(&scene(plane));
        let (ours, exported) = prepared(&folder.yaml, folder.directory.path(), false);
        let ours = Bench { prepared: ours, directory: tempfile::tempdir().unwrap() }.picture();
        let plain: String = exported
            .xml
            .split("<?abbe")
            .enumerate()
            .map(|(i, piece)| if i == 0 { piece } else { piece.split_once("?>").unwrap().1 })
            .collect();
        folder.add("plain.xml", plain.as_bytes());
        exported.files.iter().for_each(|(name, bytes)| folder.add(name, bytes));
        let xml = folder.directory.path().join("plain.xml");
        let overrides = small();
        let entry = batch::entries(&xml, &overrides).unwrap().remove(0);
        let theirs = batch::prepare(&entry, &overrides).unwrap_or_else(|error| panic!("{error}\n{plain}"));
        let theirs = Bench { prepared: theirs, directory: tempfile::tempdir().unwrap() }.picture();
        let mean = ours.y.iter().sum::<f64>() / ours.y.len() as f64;
        let differing = ours.y.iter().zip(&theirs.y).filter(|(a, b)| (*a - *b).abs() > 1e-3 * mean).count();
        assert!(mean > 0.01, "{plane}: the picture is black");
        assert!(differing * 100 <= ours.y.len(), "{plane}: {differing} pixels differ\n{plain}");
    }
    for (shape, words) in [
        (
            "cylinder: {base: [0, 0, 0], top: [0, 1, 0], radius: 0.5, material: tiles}",
            ", with Mitsuba's texture coordinates: ",
        ),
        ("cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 0.5, material: tiles}", " without texture coordinates, "),
    ] {
        let losses = told(&folder.export(&scene(&format!("- {shape}\n"))));
        assert!(losses.iter().any(|loss| loss.contains(words)), "{losses:?}");
    }
}

/// A triangle with colours at its corners.
const PAINTED: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    property float r\nproperty float g\nproperty float b\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0.2 0 1 0 0\n1 0.2 0 0 1 0\n0 1.2 0 0 0 1\n3 0 1 2\n";

/// The losses of a scene of a floor under an even sky, `head` and `shape`, and its text for Mitsuba; read back it is the same.
fn exported_with(head: &str, shape: &str) -> (Vec<String>, String) {
    let folder = Folder::new();
    for (name, bytes) in [
        ("red.csv", "400,0.1\n550,0.1\n600,0.7\n700,0.8\n"),
        ("inky.csv", "wl,n,k\n0.3,1.5,1e-7\n0.9,1.5,2e-7\n"),
        ("hair.txt", "-0.4 0.2 0 0.1\n0 0.6 0 0.1\n0.3 0.7 0 0.1\n0.6 0.2 0 0.1\n"),
        ("outward.obj", &sides::tetrahedron("1")),
        ("inward.obj", &sides::tetrahedron("-1")),
        ("bare.obj", &sides::tetrahedron("")),
        ("painted.ply", PAINTED),
        (
            "numbered.ply",
            &PAINTED
                .replace("float r", "float paint_0")
                .replace("float g", "float paint_1")
                .replace("float b", "float paint_2"),
        ),
    ] {
        folder.add(name, bytes.as_bytes());
    }
    let parts = [
        ("camera: ", "camera: {origin: [0, 1, 4], target: [0, 0.5, 0], fov_deg: 40}\n"),
        ("integrator: ", "integrator: {path: {delta_caustics: false, opaque_sky: true, max_depth: 6}}\n"),
        ("lights: ", "lights: [{constant: {radiance: 0.5}}]\n"),
    ];
    let missing: String = parts.iter().filter(|(key, _)| !head.contains(key)).map(|(_, part)| *part).collect();
    let floor = "rectangle: {corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4]}";
    let head = head.replace("EARTH", concat!(env!("CARGO_MANIFEST_DIR"), "/textures/earth.jpg"));
    let waves = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/cross_validate/mitsuba/assets/waves.png");
    let head = head.replace("WAVES", waves);
    let exported = folder.export_and_back(&format!("{missing}{head}shapes:\n- {floor}\n- {shape}\n"));
    (told(&exported), exported.xml)
}
