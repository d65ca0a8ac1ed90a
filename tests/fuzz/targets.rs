//! One file of each kind that Abbe reads, and what reads it: for `tests/fuzz` and for libFuzzer (`tests/fuzz/libfuzzer`).

use abbe::batch::{self, Overrides};
use std::path::Path;

/// A kind of file.
pub struct Target {
    pub name: &'static str,
    /// What the file is called.
    pub file: &'static str,
    /// The scene that names it, `s.yaml`; empty where the file is a scene itself.
    scene: &'static str,
    /// Files that are right, to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// A closed mesh.
pub const SOLID: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n\
                         f 1/1 3/3 2/2\nf 1 2 4\nf 1//1 4//1 3//1\nf -3 -2/1/1 -1\n";

/// Two curves.
pub const CURVES: &str = "0 0 0 0.1\n1 0 0 0.1\n1 1 0 0.1\n2 1 1 0.05\n\n0 0 1 0.1\n0 1 1 0.2\n0 2 1 0.1\n0 3 1 0.1\n";

const CAMERA: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 8, height: 8}\n";

/// Everything else that a scene may hold, on one page.
const SCENE: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40, lens: {radius: 0.1, focus_distance: 4}}\n\
    image: {width: 8, height: 8, filter: {tent: {radius: 1}}, crop: {x: 1, y: 1, width: 3, height: 4}}\n\
    integrator: {path: {max_depth: 5}}\nrender: {samples: 4, seed: 3, techniques: {packets: off}}\n\
    textures: {floor: {checkerboard: {a: 0.1, b: {rgb: [0.9, 0.8, 0.7]}}}}\n\
    materials:\n  clay: {diffuse: {reflectance: {texture: floor}}}\n  ring: {conductor: {metal: gold, roughness: 0.1}}\n\
    media: {smoke: {homogeneous: {absorption: 0.1, scattering: 0.2, phase: {hg: 0.5}}}}\n\
    groups: {tree: [{sphere: {center: [0, 2, 0], radius: 1}}]}\n\
    shapes:\n- sphere: {radius: 1, material: clay, transform: [{rotate: {axis: [0, 1, 0], deg: 30}}], inside: smoke}\n\
    - cylinder: {base: [0, 0, 0], top: [0, 1, 0], radius: 0.5, caps: both, material: ring}\n\
    - cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 0.5, material: {dielectric: {ior: {glass: N-SF11}}}}\n\
    - instance: {group: tree, transform: [{scale: [1, 2, 3]}]}\n\
    lights: [point: {position: [0, 5, 0], intensity: {blackbody: {kelvin: 5000}}}, constant: {radiance: 0.1}]\n";

const XML: &str = r#"<scene version="3.0.0"><default name="spp" value="4"/><integrator type="path"/>
<sensor type="perspective"><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film>
<sampler type="independent"><integer name="sample_count" value="$spp"/></sampler></sensor>
<bsdf type="roughconductor" id="m"><string name="material" value="Au"/><float name="alpha" value="0.1"/></bsdf>
<shape type="sphere"><point name="center" x="0" y="0" z="0"/><float name="radius" value="1"/><ref id="m"/></shape>
<shape type="cube"><bsdf type="dielectric"><float name="int_ior" value="1.5"/></bsdf>
<medium name="interior" type="homogeneous"><rgb name="albedo" value="0.9, 0.8, 0.7"/></medium></shape>
<emitter type="constant"><spectrum name="radiance" value="400:0.1, 700:0.9"/></emitter></scene>"#;

const PLY: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n\
    property float z\nproperty uchar red\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 10\n1 0 0 20\n0 1 0 30\n0 0 1 40\n3 0 1 2\n4 0 1 3 2\n";

const INDEX: &str = "REFERENCES: \"none\"\nDATA:\n  - type: formula 2\n    wavelength_range: 0.3 2.5\n    \
    coefficients: 0 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653\n  - type: tabulated k\n    \
    data: |\n        0.300 2.8607E-06\n        0.500 1.0E-8\n        0.900 1.3679E-06\n";

/// The same as a binary file.
fn binary_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property double z\nelement face 1\nproperty list uchar uint vertex_index\nend_header\n"
        .to_vec();
    for [x, y, z] in [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]] {
        bytes.extend(x.to_le_bytes().into_iter().chain(y.to_le_bytes()).chain(f64::from(z).to_le_bytes()));
    }
    bytes.push(3);
    bytes.extend([0u32, 1, 2].into_iter().flat_map(u32::to_le_bytes));
    bytes
}

/// A `.serialized` file of one triangle, in version 4: header, deflated body, table of offsets.
fn serialized() -> Vec<u8> {
    let mut body: Vec<u8> = 0x1000u32.to_le_bytes().to_vec();
    body.extend(b"mesh\0");
    body.extend(3u64.to_le_bytes().into_iter().chain(1u64.to_le_bytes()));
    body.extend([0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().flat_map(f32::to_le_bytes));
    body.extend([0u32, 1, 2].into_iter().flat_map(u32::to_le_bytes));
    let mut bytes = vec![0x1c, 0x04, 0x04, 0x00];
    // A zlib stream of one stored block: nothing is compressed, so that damage reaches the numbers.
    bytes.extend([0x78, 0x01, 0x01]);
    let length = body.len() as u16;
    bytes.extend(length.to_le_bytes().into_iter().chain((!length).to_le_bytes()));
    bytes.extend(&body);
    let (a, b) = body.iter().fold((1u32, 0u32), |(a, b), &x| {
        let a = (a + u32::from(x)) % 65_521;
        (a, (b + a) % 65_521)
    });
    bytes.extend((b << 16 | a).to_be_bytes());
    bytes.extend(0u64.to_le_bytes().into_iter().chain(1u32.to_le_bytes()));
    bytes
}

/// Distances to a ball on a grid of 4³, and `more`, as a `.vol` file.
pub fn ball(more: f32) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    bytes.extend([1i32, 4, 4, 4, 1].into_iter().flat_map(i32::to_le_bytes));
    bytes.extend([0f32, 0.0, 0.0, 1.0, 1.0, 1.0].into_iter().flat_map(f32::to_le_bytes));
    let at = |i: usize| i as f32 / 3.0 - 0.5;
    let distance = |i: usize| (at(i % 4).powi(2) + at(i / 4 % 4).powi(2) + at(i / 16).powi(2)).sqrt() - 0.4 + more;
    bytes.extend((0..64).map(distance).flat_map(f32::to_le_bytes));
    bytes
}

/// A picture that Abbe writes itself, bands, layers and all.
fn exr() -> Vec<u8> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let scene = format!(
        "{CAMERA}render: {{samples: 4}}\nshapes: [sphere: {{radius: 1}}]\nlights: [constant: {{radiance: 1}}]\n\
         layers: [{{name: nn, surface: shading_normal}}]\noutput: {{exr: {{compression: zips}}}}\n"
    );
    let path = directory.path().join("s.yaml");
    std::fs::write(&path, scene).expect("a file");
    let prepared = prepared(&path).expect("a scene");
    let output = Some(directory.path().join("s.exr"));
    let overrides = Overrides { output, ..Overrides::default() };
    let stop = std::sync::atomic::AtomicBool::new(false);
    let (_, done) = batch::render_scene(&prepared, &overrides, std::time::Duration::ZERO, &(), &stop);
    done.expect("a picture");
    std::fs::read(directory.path().join("s.exr")).expect("a picture")
}

fn texts(all: &[&str]) -> Vec<Vec<u8>> {
    all.iter().map(|text| text.as_bytes().to_vec()).collect()
}

/// Every kind.
pub const TARGETS: [Target; 11] = [
    Target {
        name: "yaml",
        file: "s.yaml",
        scene: "",
        seeds: || texts(&[SCENE, "scenes:\n- {file: s.yaml, name: a, set: {render.samples: 2}}\n"]),
    },
    Target { name: "xml", file: "s.xml", scene: "", seeds: || texts(&[XML]) },
    Target { name: "obj", file: "x.obj", scene: "shapes: [mesh: {file: x.obj}]\n", seeds: || texts(&[SOLID]) },
    Target {
        name: "ply",
        file: "x.ply",
        scene: "shapes: [mesh: {file: x.ply}]\n",
        seeds: || vec![PLY.as_bytes().to_vec(), binary_ply()],
    },
    Target {
        name: "serialized",
        file: "x.serialized",
        scene: "shapes: [mesh: {file: x.serialized}]\n",
        seeds: || vec![serialized()],
    },
    Target {
        name: "curves",
        file: "x.txt",
        scene: "shapes: [curves: {file: x.txt, basis: bspline}]\n",
        seeds: || texts(&[CURVES]),
    },
    Target { name: "vol", file: "x.vol", scene: "shapes: [sdf_grid: {file: x.vol}]\n", seeds: || vec![ball(0.0)] },
    Target {
        name: "spectrum",
        file: "x.csv",
        scene: "lights: [constant: {radiance: {file: x.csv}}]\n",
        seeds: || texts(&["# source\nnm,value\n400, 0.1\n500;0.2\n\n600\t3e-1\n"]),
    },
    Target {
        name: "index",
        file: "x.yml",
        scene: "shapes: [sphere: {radius: 1, material: {dielectric: {ior: {file: x.yml}}}}]\n",
        seeds: || texts(&[INDEX]),
    },
    Target {
        name: "index_csv",
        file: "x.csv",
        scene: "shapes: [sphere: {radius: 1, material: {conductor: {file: x.csv}}}]\n",
        seeds: || texts(&["wl,n\n0.3,1.5\n0.9,1.4\nwl,k\n0.3,0.1\n0.9,2\n"]),
    },
    Target { name: "exr", file: "x.exr", scene: "lights: [environment: {file: x.exr}]\n", seeds: || vec![exr()] },
];

fn prepared(path: &Path) -> abbe::error::Result<batch::Prepared> {
    let none = Overrides::default();
    let entries = batch::entries(path, &none)?;
    batch::prepare(&entries[0], &none)
}

impl Target {
    /// Reads `bytes` as a file of this kind in `directory`; what is wrong with how it is refused, if anything.
    pub fn read(&self, bytes: &[u8], directory: &Path) -> Result<(), String> {
        let file = directory.join(self.file);
        let write = |path: &Path, bytes: &[u8]| std::fs::write(path, bytes).map_err(|e| e.to_string());
        write(&file, bytes)?;
        let scene = directory.join("s.yaml");
        if !self.scene.is_empty() {
            write(&scene, format!("{CAMERA}{}", self.scene).as_bytes())?;
        }
        let outcome = prepared(if self.scene.is_empty() { &file } else { &scene });
        if self.name == "exr" {
            // A picture may also be compared.
            let _ = abbe::film::exr::read_exr(&file);
        }
        let Err(error) = outcome else { return Ok(()) };
        let words = error.to_string();
        let place = directory.to_string_lossy();
        match !words.is_empty()
            && words.lines().all(|line| line.contains(&*place))
            && matches!(error.exit_code(), 2 | 3)
        {
            true => Ok(()),
            false => Err(format!("a fault without a place, or of exit code {}: {words}", error.exit_code())),
        }
    }
}
