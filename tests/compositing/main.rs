//! Layers and mattes for compositing: parts of the light that add up to the picture, data of the middle of a pixel, and
//! who covers it.

#[path = "../common/mod.rs"]
mod common;
mod seen;

use abbe::batch::{self, Overrides};
use abbe::film::compare::{CompareOptions, Verdict, compare};
use abbe::film::cryptomatte::id_of;
use abbe::film::exr::{ExrPart, read_exr};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

/// 24 × 16 pixels in 32-bit floats, 16 samples each.
const FRAME: &str = "camera: {origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}\n\
                     image: {width: 24, height: 16}\n\
                     render: {samples: 16}\n\
                     output: {exr: {precision: float}}\n";

/// Everything that scatters light, under lamps of two groups and one of none.
const STAGE: &str = "light_groups: {key: [lamp], fill: [sky]}\n\
    lights: [{constant: {name: sky, radiance: 0.2}}, {point: {position: [-2, 3, 2], intensity: 3}}]\n\
    shapes:\n\
    - plane: {normal: [0, 1, 0], material: {plastic: {reflectance: 0.5, roughness: 0.1}}}\n\
    - sphere: {name: lamp, center: [1.2, 1.7, 0.5], radius: 0.25, emission: 20}\n\
    - sphere: {name: glass, center: [-0.8, 0.6, 1], radius: 0.6, material: {dielectric: {ior: {glass: N-SF11}}}}\n\
    - sphere: {center: [0.8, 0.6, 0], radius: 0.6, material: {conductor: {metal: gold, roughness: 0.3}}}\n\
    - sphere: {center: [0, 0.4, 2], radius: 0.4, material: {principled: {base_color: 0.6, metallic: 0.3}}}\n\
    - sphere: {center: [0, 2, -1], radius: 0.5, material: {mirror: {reflectance: 0.9}}}\n";

const LAYERS: &str =
    "layers: [emission, caustic, direct, indirect, diffuse, glossy, transmission, media, light_groups]\n";

/// The picture of `yaml`.
fn render(yaml: &str) -> ExrPart {
    let place = TempDir::new().unwrap();
    let (scene, out) = (place.path().join("scene.yaml"), place.path().join("scene.exr"));
    common::write(&scene, yaml.as_bytes());
    let overrides = Overrides { output: Some(out.clone()), ..Overrides::default() };
    let report = batch::render_batch(&scene, &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
    read_exr(&out).unwrap().parts.remove(0)
}

fn plane<'a>(part: &'a ExrPart, name: &str) -> &'a [f32] {
    part.channel(name).unwrap_or_else(|| panic!("no channel {name}"))
}

/// Numbers of a sample are rounded to f32 some dozen times on their way: sums over the path, over eight lanes, the matrix
/// to the file's colours, the file itself. Each is off by at most 2⁻²⁴ of what is added, whose size is that of all three
/// colours, as X, Y and Z mix them; 16 of them cover all.
#[test]
fn light_by_its_ways_and_by_its_lamps_adds_up_to_the_picture() {
    let medium = "media: {haze: {homogeneous: {extinction: 0.3, albedo: 0.8}}}\n";
    let cloud = "- sphere: {center: [0, 1, 0], radius: 4, inside: haze, material: {boundary: {}}}\n";
    let frame = |light: &str, merging: &str| {
        let techniques = format!("samples: 16, techniques: {{light_tracing: {light}, merging: {merging}}}");
        FRAME.replace("samples: 16", &techniques)
    };
    let lamps = |power: i32| {
        ["radiance: 0.2", "intensity: 3", "emission: 20"]
            .into_iter()
            .fold(STAGE.to_owned(), |stage, lamp| stage.replace(lamp, &format!("{lamp}e{power}")))
    };
    let film = |sensitivity: &str| {
        frame("on", "off").replace("height: 16", &format!("height: 16, sensitivity: {sensitivity}"))
    };
    let adaptive = FRAME.replace("samples: 16", "samples: 64, techniques: {adaptive: on, merging: off}");
    let adaptive = adaptive.replace("width: 24, height: 16", "width: 64, height: 48");
    let scenes = [
        ("paths alone", frame("off", "off") + STAGE),
        ("paths from the lights", frame("on", "off") + STAGE),
        ("photons", frame("on", "on") + STAGE),
        ("haze", FRAME.to_owned() + medium + STAGE + cloud),
        ("depth fog", FRAME.to_owned() + "fog: {colour: 0.3, density: 0.1}\n" + STAGE),
        (
            "rays in depth fog",
            FRAME.to_owned()
                + "fog: {colour: 0.3, density: 0.1}\nintegrator: {path: {light_samples: 2}}\n"
                + STAGE
                + "- sphere: {center: [0, 1, 3], radius: 0.5, material: {mask: {opacity: 0.5, material: {diffuse: {reflectance: 1}}}}}\n",
        ),
        // Some cells of 8 × 8 pixels have more samples in one half of the replicates than in the other.
        ("samples shared out", adaptive.clone() + STAGE),
        ("rays", FRAME.to_owned() + "integrator: {path: {light_samples: 2, scatter_samples: 2}}\n" + STAGE),
        // As dark and as bright as sums that count by the number alone do not hold.
        ("darkness", frame("on", "off") + &lamps(-26)),
        ("glare", frame("on", "off") + &lamps(25)),
        // And what a sensitivity makes up for, or takes away.
        ("darkness made up for", film("3e26") + &lamps(-26)),
        ("glare made up for", film("3e-25") + &lamps(25)),
        ("a film of little sensitivity", film("1e-20") + STAGE),
    ];
    let families: [&[&str]; 3] = [
        &["emission", "caustic", "direct", "indirect"],
        &["emission", "caustic", "diffuse", "glossy", "transmission", "media"],
        &["light_key", "light_fill", "light_default"],
    ];
    for (name, yaml) in scenes {
        let (plain, layered) = (render(&yaml), render(&format!("{yaml}{LAYERS}")));
        for colour in ["R", "G", "B", "A"] {
            assert_eq!(plane(&plain, colour), plane(&layered, colour), "{name}: layers change {colour}");
        }
        for family in families {
            for colour in ["R", "G", "B"] {
                let beauty = plane(&layered, colour);
                for (i, whole) in beauty.iter().enumerate() {
                    let of = |layer: &&str| f64::from(plane(&layered, &format!("{layer}.{colour}"))[i]);
                    let sum: f64 = family.iter().map(of).sum();
                    let size: f64 = ["R", "G", "B"].iter().map(|c| f64::from(plane(&layered, c)[i].abs())).sum();
                    let off = (sum - f64::from(*whole)).abs();
                    assert!(
                        off <= 16.0 * size * 2f64.powi(-24),
                        "{name}: {family:?} {colour} of pixel {i}: off by {off}"
                    );
                }
            }
        }
        // No layer is empty where its light is in the scene.
        let total = |layer: &str| plane(&layered, &format!("{layer}.G")).iter().sum::<f32>();
        for layer in families.concat().iter().filter(|layer| **layer != "media") {
            assert!(total(layer) > 0.0, "{name}: {layer} is black");
        }
        assert_eq!(total("media") > 0.0, ["haze", "depth fog", "rays in depth fog"].contains(&name), "{name}");
    }
}

/// A lamp over a diffuse floor in an empty world: all light is diffuse and direct, as the closed form of E · ρ/π says; a
/// floor that only mirrors a lamp is glossy.
#[test]
fn ways_are_what_their_names_say() {
    let floor = |material: &str| {
        format!(
            "{FRAME}lights: [{{constant: {{radiance: 1}}}}]\nshapes: [{{plane: {{normal: [0, 0, 1], point: [0, 0, -1], \
             material: {material}}}}}]\n{LAYERS}"
        )
    };
    for (material, way) in [
        ("{diffuse: {reflectance: 0.5}}", "diffuse"),
        ("{mirror: {reflectance: 0.5}}", "glossy"),
        ("{conductor: {metal: gold, roughness: 0.4}}", "glossy"),
    ] {
        let part = render(&floor(material));
        for layer in ["diffuse", "glossy", "transmission", "media", "indirect", "caustic", "emission"] {
            let lit = plane(&part, &format!("{layer}.G")).iter().all(|x| *x > 0.0);
            assert_eq!(lit, layer == way, "{material}: {layer}");
        }
        assert_eq!(plane(&part, "direct.G"), plane(&part, &format!("{way}.G")));
    }
}

/// The plane z = −1 seen by a camera at z = 6: its depth is 7 in every pixel, whatever the filter; the place of the pixel
/// in column x is 7 · tan 20° · (2 (x + 1/2)/24 − 1) to the right. A sphere that covers half of a pixel is all or nothing.
#[test]
fn data_are_those_of_the_middle_of_the_pixel() {
    let camera = FRAME.replace("origin: [0, 1.5, 6], target: [0, 0.7, 0]", "origin: [0, 0, 6], target: [0, 0, 0]");
    let text = "lights: [{constant: {radiance: 1}}]\nlayers: [Z, P, uv, sampleCount, variance, stderr]\nshapes:\n";
    let wall = "- plane: {normal: [0, 0, 1], point: [0, 0, -1]}\n";
    let part =
        render(&format!("{camera}{text}{wall}").replace("height: 16", "height: 16, filter: {gaussian: {stddev: 0.7}}"));
    assert!(plane(&part, "Z").iter().all(|z| (z - 7.0).abs() <= f32::EPSILON * 7.0));
    let half = 7.0 * 20f64.to_radians().tan();
    for (i, x) in plane(&part, "P.X").iter().enumerate() {
        let expected = half * (2.0 * ((i % 24) as f64 + 0.5) / 24.0 - 1.0);
        assert!((f64::from(*x) - expected).abs() < 1e-6, "{x} against {expected}");
    }
    assert!(plane(&part, "sampleCount").iter().all(|n| *n == 16.0));
    for (variance, error) in plane(&part, "variance.G").iter().zip(plane(&part, "stderr.G")) {
        assert_eq!(*variance, error * error);
    }

    let part = render(&format!("{camera}{text}- sphere: {{radius: 1}}\n"));
    let (sphere, nothing): (Vec<f32>, Vec<f32>) = plane(&part, "Z").iter().partition(|z| **z < 1e9);
    assert!(sphere.iter().all(|z| (5.0..6.0).contains(z)) && !sphere.is_empty());
    assert!(nothing.iter().all(|z| *z == 1e10) && !nothing.is_empty());
}

/// Two spheres that share a material before nothing; the second is an asset. Coverage of objects adds up to alpha.
#[test]
fn mattes_know_objects_materials_and_assets() {
    let text = "materials: {clay: {diffuse: {reflectance: 0.4}}}\nlights: [{constant: {radiance: 1}}]\n\
                assets: {hero: [right]}\nlayers: [crypto_object, crypto_material, crypto_asset]\nshapes:\n\
                - sphere: {name: left, center: [-0.6, 0.7, 0], radius: 0.7, material: clay}\n\
                - sphere: {name: right, center: [0.6, 0.7, 0], radius: 0.7, material: clay}\n";
    let part = render(&format!("{FRAME}{text}"));
    let alpha = plane(&part, "A");
    for (layer, names) in
        [("CryptoObject", ["left", "right"]), ("CryptoMaterial", ["clay", "clay"]), ("CryptoAsset", ["left", "hero"])]
    {
        let pair = |i: usize| {
            let channels = if i.is_multiple_of(2) { ["R", "G"] } else { ["B", "A"] };
            channels.map(|c| plane(&part, &format!("{layer}{:02}.{c}", i / 2)))
        };
        let pairs: Vec<[&[f32]; 2]> = (0..6).map(pair).collect();
        let ids = names.map(|name| id_of(name).to_bits());
        let mut seen = [false; 2];
        for i in 0..alpha.len() {
            let covered: f32 = pairs.iter().map(|[_, coverage]| coverage[i]).sum();
            assert!((covered - alpha[i]).abs() <= 2.0 * f32::EPSILON, "{layer}: {covered} against {}", alpha[i]);
            for [id, coverage] in &pairs {
                let known = ids.iter().position(|known| *known == id[i].to_bits());
                assert_eq!(known.is_some(), coverage[i] > 0.0, "{layer}: an id without a name");
                known.into_iter().for_each(|k| seen[k] = true);
            }
        }
        assert!(seen[0] && (seen[1] || names[0] == names[1]), "{layer}: {seen:?}");
        let key = &format!("{:08x}", id_of(layer).to_bits())[..7];
        let text = |name: &str| part.text(&format!("cryptomatte/{key}/{name}")).unwrap();
        assert_eq!((text("name"), text("hash"), text("conversion")), (layer, "MurmurHash3_32", "uint32_to_float32"));
        let manifest: serde_json::Value = serde_json::from_str(text("manifest")).unwrap();
        assert_eq!(manifest[names[0]], format!("{:08x}", ids[0]));
    }
}

/// What a manifest names can be had as a matte: an instance is an object and part of its group, and what is seen of it are shapes
/// of the group, which have materials.
#[test]
fn a_manifest_names_what_can_be_seen_and_nothing_else() {
    let text = "materials: {clay: {diffuse: {reflectance: 0.4}}}\nlights: [{constant: {radiance: 1}}]\n\
                groups: {tree: [{sphere: {center: [0, 1, 0], radius: 0.4, material: clay}}, \
                {cylinder: {base: [0, 0, 0], top: [0, 1, 0], radius: 0.2}}]}\n\
                layers: [crypto_object, crypto_material, crypto_asset]\nshapes:\n\
                - instance: {name: left, group: tree, transform: [{translate: [-1, 0, 0]}]}\n\
                - instance: {group: tree}\n- sphere: {name: ball, center: [1, 0.5, 0], radius: 0.5}\n";
    let part = render(&format!("{FRAME}{text}"));
    for (layer, names) in [
        ("CryptoObject", vec!["ball", "instance1", "left"]),
        ("CryptoMaterial", vec!["ball", "clay", "tree.cylinder1"]),
        ("CryptoAsset", vec!["ball", "tree"]),
    ] {
        let key = &format!("{:08x}", id_of(layer).to_bits())[..7];
        let text = part.text(&format!("cryptomatte/{key}/manifest")).unwrap();
        let manifest: BTreeMap<String, String> = serde_json::from_str(text).unwrap();
        assert_eq!(manifest.keys().collect::<Vec<_>>(), names, "{layer}");
        for name in names {
            let seen =
                (0..3).flat_map(|i| [("R", "G"), ("B", "A")].map(|pair| (i, pair))).any(|(i, (id, coverage))| {
                    let of = |channel: &str| plane(&part, &format!("{layer}{i:02}.{channel}"));
                    of(id).iter().zip(of(coverage)).any(|(id, x)| id.to_bits() == id_of(name).to_bits() && *x > 0.0)
                });
            assert!(seen, "{layer}: {name}");
        }
    }
}

/// Where samples are shared out by noise, halves of a pixel's samples weigh alike, whatever their numbers: mattes add up to
/// alpha there, too, to the rounding of the counts' shares, their factor and their sum.
#[test]
fn mattes_add_up_to_alpha_where_samples_are_shared_out() {
    let frame =
        FRAME.replace("samples: 16", "samples: 64, techniques: {adaptive: on, merging: off, light_tracing: off}");
    let frame = frame.replace("width: 24, height: 16", "width: 64, height: 48");
    let part = render(&format!(
        "{frame}layers: [crypto_object]\nlights: [{{point: {{position: [-2, 3, 2], intensity: 3}}}}]\nshapes:\n\
         - sphere: {{center: [1.2, 1.7, 0.5], radius: 0.5}}\n- sphere: {{center: [0, 3, 0], radius: 0.3, emission: 20}}\n\
         - sphere: {{center: [-0.8, 0.6, 1], radius: 0.6, material: {{conductor: {{metal: gold, roughness: 0.3}}}}}}\n"
    ));
    let coverage = (0..3).flat_map(|i| ["G", "A"].map(|c| plane(&part, &format!("CryptoObject0{i}.{c}"))));
    let mut sums = vec![0.0; 64 * 48];
    coverage.for_each(|plane| sums.iter_mut().zip(plane).for_each(|(sum, x)| *sum += x));
    for (sum, alpha) in sums.iter().zip(plane(&part, "A")) {
        assert!((sum - alpha).abs() <= 8.0 * f32::EPSILON, "{sum} {alpha}");
    }
}

/// A mask lets a third through: the matte of what is before covers two thirds, as alpha of a picture without a background. So does
/// a blend of which a third only bounds media, be it glass of the index around it.
#[test]
fn holes_of_a_mask_are_holes_of_its_matte() {
    for material in [
        "mask: {opacity: 0.6667, material: {diffuse: {}}}",
        "blend: {weight: 0.6667, first: {boundary: {}}, second: {diffuse: {}}}",
        "blend: {weight: 0.3333, first: {diffuse: {}}, second: {dielectric: {ior: 1}}}",
    ] {
        let part = render(&format!(
            "{FRAME}lights: [{{constant: {{radiance: 1}}}}]\nlayers: [crypto_object]\nshapes:\n\
             - plane: {{name: veil, normal: [0, 0, 1], material: {{{material}}}}}\n"
        ));
        let (coverage, alpha) = (plane(&part, "CryptoObject00.G"), plane(&part, "A"));
        let alike = coverage.iter().zip(alpha).all(|(c, a)| (c - a).abs() <= f32::EPSILON);
        assert!(alike, "{material}: {coverage:?} {alpha:?}");
        let mean = coverage.iter().sum::<f32>() / coverage.len() as f32;
        // 384 pixels of 16 samples: four standard errors of a share of 2/3 are 4·√(2/9/6144).
        assert!((mean - 0.6667).abs() < 4.0 * (2.0f32 / 9.0 / 6144.0).sqrt(), "{material}: {mean}");
    }
}

/// A spectral file that was rendered is a sky again. The first falls from 2 at 400 nm to 1 at 700 nm; its bands of 100 nm
/// have the means 11/6, 3/2 and 7/6. Between their middles the second is as the first, beyond it stays: its first band has
/// (11/6 + (11/6 + 5/3)/2)/2 = 43/24, its last (7/6 + (7/6 + 4/3)/2)/2 = 29/24.
#[test]
fn a_spectral_file_is_light_again() {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    let file = |scene: &str, text: &str| {
        common::write(&path(scene), text.as_bytes());
        let overrides = Overrides { output: Some(path("out.exr")), ..Overrides::default() };
        let report = batch::render_batch(&path(scene), &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
        let part = read_exr(&path("out.spectral.exr")).unwrap().parts.remove(0);
        // The sums of its bands are not kept by replicate, and the error of the colours is none of its own.
        assert!(["State", "Interval95"].iter().all(|of| part.text(&format!("abbe/relativeError{of}")).is_none()));
        part
    };
    let frame = FRAME.replace("float}", "float}, spectral: {bands: 3}").replace("samples: 16", "samples: 256");
    let means = |part: &ExrPart| -> Vec<f32> {
        let names = ["S0.450,000000nm", "S0.550,000000nm", "S0.650,000000nm"];
        names.map(|name| plane(part, name).iter().sum::<f32>() / 384.0).to_vec()
    };
    let sky = "lights: [{constant: {radiance: {table: [[400, 2], [700, 1]]}}}]\n";
    let first = means(&file("sky.yaml", &format!("{frame}{sky}")));
    // 384 pixels of 2048 wavelengths each, evenly spread: 1e-3 is far above their noise.
    for (found, expected) in first.iter().zip([11.0 / 6.0, 1.5, 7.0 / 6.0]) {
        assert!((found / expected - 1.0).abs() < 2e-3, "{first:?}");
    }
    std::fs::rename(path("out.spectral.exr"), path("sky.exr")).unwrap();
    let again = means(&file("again.yaml", &format!("{frame}lights: [{{environment: {{file: sky.exr}}}}]\n")));
    for (found, expected) in again.iter().zip([43.0 / 24.0, 1.5, 29.0 / 24.0]) {
        assert!((found / expected - 1.0).abs() < 2e-3, "{again:?}");
    }
}

/// The picture of a scene and its spectral file.
fn with_spectral(text: &str) -> [ExrPart; 2] {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    common::write(&path("s.yaml"), text.as_bytes());
    let overrides = Overrides { output: Some(path("out.exr")), ..Overrides::default() };
    let report = batch::render_batch(&path("s.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
    ["out.exr", "out.spectral.exr"].map(|name| read_exr(&path(name)).unwrap().parts.remove(0))
}

/// A band that is called R stands in place of a colour, and `variance.R` is its own: it was that of the colour shown.
#[test]
fn the_variance_of_a_picture_of_bands_is_that_of_its_bands() {
    let picture = |integrator: &str| {
        let text = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 1, 0], fov_deg: 40}}\n\
             image: {{width: 6, height: 4, bands: [{{name: R, response: 1}}, {{name: uv.a, response: 2}}]}}\n\
             integrator: {integrator}\nrender: {{samples: 8}}\nlayers: [variance, stderr]\noutput: {{spectral: {{bands: 1}}}}\n\
             shapes: [{{plane: {{normal: [0, 1, 0]}}}}, {{sphere: {{center: [0, 4, 0], radius: 1, emission: 5}}}}]\n"
        );
        with_spectral(&text)[0].clone()
    };
    for integrator in ["path", "whitted"] {
        let picture = picture(integrator);
        let names: Vec<&str> = picture.channels.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["R", "stderr.R", "stderr.uv.a", "uv.a", "variance.R", "variance.uv.a"]);
        for band in ["R", "uv.a"] {
            let of = |what: &str| plane(&picture, &format!("{what}.{band}"));
            assert_eq!(of("variance"), of("stderr").iter().map(|e| e * e).collect::<Vec<_>>());
            assert_eq!(of("stderr").iter().any(|e| *e > 0.0), integrator == "path");
        }
    }
}

/// Bands of the picture and of the spectral file have their standard errors beside them, as data; a picture without a wish for them
/// has none. Both say how much of them pixels share, by which `abbe compare` judges the bands.
#[test]
fn bands_stand_beside_their_standard_errors() {
    let parts = |exr: &str| {
        let text = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 1, 0], fov_deg: 40}}\n\
             image: {{width: 6, height: 4, bands: [{{name: red, response: 1}}, {{name: uv.a, response: 2}}]}}\n\
             render: {{samples: 8, techniques: {{reuse: on}}}}\noutput: {{exr: {{{exr}}}, spectral: {{bands: 1}}}}\n\
             shapes: [{{plane: {{normal: [0, 1, 0]}}}}, {{sphere: {{center: [0, 4, 0], radius: 1, emission: 5}}}}]\n"
        );
        with_spectral(&text)
    };
    let names = |part: &ExrPart| part.channels.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    let [picture, spectral] = parts("precision: float, stderr: true");
    assert_eq!(names(&picture), ["red", "stderr.red", "stderr.uv.a", "uv.a"]);
    let bands = ["S0.550,000000nm", "stderr.S0.550,000000nm"];
    assert_eq!(names(&spectral), ["B", "G", "R", bands[0], bands[1]]);
    // The second band is twice the first, and so is its error.
    let twice = |name: &str| plane(&picture, name).iter().map(|x| 2.0 * x).collect::<Vec<_>>();
    assert_eq!(
        (twice("red"), twice("stderr.red")),
        (plane(&picture, "uv.a").into(), plane(&picture, "stderr.uv.a").into())
    );
    assert!(plane(&spectral, bands[1]).iter().any(|e| *e > 0.0));
    let shared = |part: &ExrPart| part.text("abbe/sharedErrors").map(|x| x.parse::<f64>().unwrap());
    let told = [&picture, &spectral].map(shared);
    assert!(told.iter().all(|shared| shared.unwrap() > 1.0));
    // Each file has the error of its own bands: red and its double have that of all light, the mean over wavelengths another.
    let own = |part: &ExrPart| part.text("abbe/relativeErrorState").is_some();
    assert!(own(&picture) && own(&spectral));
    let [picture, spectral] = parts("precision: float");
    assert_eq!((names(&picture).len(), names(&spectral).len()), (2, 4));
    assert_eq!([&picture, &spectral].map(shared), told);
    assert!(own(&picture) && own(&spectral));
}

/// Beside colours, without standard errors, bands are not summed by replicate: what pixels share of their errors is then all that they
/// can, of a cell the number of its pixels, of which this picture has 24.
#[test]
fn bands_that_do_not_know_their_errors_may_share_all_of_them() {
    let shared = |reuse: &str| {
        let text = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 1, 0], fov_deg: 40}}\nimage: {{width: 6, height: 4}}\n\
             render: {{samples: 8, techniques: {{reuse: {reuse}}}}}\noutput: {{spectral: {{bands: 1}}}}\n\
             shapes: [{{plane: {{normal: [0, 1, 0]}}}}, {{sphere: {{center: [0, 4, 0], radius: 1, emission: 5}}}}]\n"
        );
        with_spectral(&text)[1].text("abbe/sharedErrors").map(str::to_owned)
    };
    assert_eq!((shared("on").as_deref(), shared("off")), (Some("24.000"), None));
}

/// Radiance 1 at 400 nm to 4 at 700 nm is 750 in a band of response 1, whatever the sensitivity, and 1.5, 2.5 and 3.5 in the
/// means of the spectral file; the name of the band is one that the latter has.
#[test]
fn a_band_may_be_called_as_one_of_the_spectral_file() {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    let sky = "lights: [{constant: {radiance: {table: [[400, 1], [700, 4]]}}}]\n";
    let mut pictures = Vec::new();
    for sensitivity in ["1", "2"] {
        let image =
            format!("height: 16, sensitivity: {sensitivity}, bands: [{{name: 'S0.550,000000nm', response: 1}}]");
        let frame = FRAME.replace("float}", "float}, spectral: {bands: 3}").replace("height: 16", &image);
        common::write(&path("s.yaml"), format!("{frame}{sky}").replace("samples: 16", "samples: 256").as_bytes());
        let overrides = Overrides { output: Some(path("out.exr")), ..Overrides::default() };
        let report = batch::render_batch(&path("s.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
        let [picture, spectral] =
            ["out.exr", "out.spectral.exr"].map(|name| read_exr(&path(name)).unwrap().parts.remove(0));
        let mean = |part: &ExrPart, name: &str| plane(part, name).iter().sum::<f32>() / 384.0;
        // The bound of `a_spectral_file_is_light_again`.
        let near = |found: f32, expected: f32| assert!((found / expected - 1.0).abs() < 2e-3, "{found} for {expected}");
        near(mean(&picture, "S0.550,000000nm"), 750.0);
        for (name, expected) in [("S0.450,000000nm", 1.5), ("S0.550,000000nm", 2.5), ("S0.650,000000nm", 3.5)] {
            near(mean(&spectral, name), expected);
        }
        assert_eq!((picture.channels.len(), spectral.channels.len()), (1, 6));
        pictures.push(picture.channels);
    }
    assert_eq!(pictures[0], pictures[1]);
}

/// Grey that is 0.2 in one picture and 0.9 in the other beyond 700 nm: bands that are called like colours are compared all the
/// same, also beside a layer in colours.
#[test]
fn bands_are_compared_whatever_they_are_called() {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    let picture = |name: &str, infrared: f64, bands: [&str; 4], rest: &str| {
        let [red, green, blue, beyond] = bands;
        let bands = format!(
            "height: 16, bands: [{{name: {red}, response: {{table: [[600, 1], [690, 1]]}}}}, \
             {{name: {green}, response: {{table: [[500, 1], [600, 1]]}}}}, \
             {{name: {blue}, response: {{table: [[400, 1], [500, 1]]}}}}, \
             {{name: {beyond}, response: {{table: [[700, 1], [780, 1]]}}}}]"
        );
        let text = format!(
            "{}lights: [{{constant: {{radiance: {{table: [[400, 0.5], [690, 0.5], [700, {infrared}], [780, {infrared}]]}}}}}}]\n\
             {rest}",
            FRAME.replace("height: 16", &bands)
        );
        common::write(&path("s.yaml"), text.as_bytes());
        let overrides = Overrides { output: Some(path(name)), ..Overrides::default() };
        let report = batch::render_batch(&path("s.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
        read_exr(&path(name)).unwrap()
    };
    let named = [["R", "G", "B", "IR"], ["C", "D", "E", "A"], ["U", "V", "W", "Y"], ["X", "Y", "Z", "NIR"]];
    for (bands, rest) in named.into_iter().map(|bands| (bands, "")).chain([(named[0], "layers: [emission]\n")]) {
        let [a, b] = [("a.exr", 0.2), ("b.exr", 0.9)].map(|(name, infrared)| picture(name, infrared, bands, rest));
        let told = compare(&a, &b, &CompareOptions::default());
        assert_eq!(told.verdict, Verdict::Different, "{bands:?} {rest}: {}", told.table());
        for band in bands {
            let figures = told.channels.iter().find(|channel| channel.name == band).unwrap();
            // The sky is the same in the bands of the colours, seen by other wavelengths.
            let beyond = band == bands[3];
            assert_eq!(figures.mean_ratio < 0.5, beyond, "{bands:?} {rest}: {}", told.table());
        }
        assert_eq!(compare(&a, &a, &CompareOptions::default()).verdict, Verdict::Same);
    }
}

/// `whitted` draws nothing, so that another seed is the same picture, and the standard errors of its bands are 0, as those of
/// its colours are.
#[test]
fn bands_without_noise_have_standard_errors_of_zero() {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    let parts = |seed: u32| {
        let text = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 1, 0], fov_deg: 40}}\nintegrator: whitted\n\
             image: {{width: 6, height: 4, bands: [{{name: sodium, response: {{lines: [{{nm: 589}}]}}}}]}}\n\
             render: {{seed: {seed}}}\noutput: {{exr: {{precision: float, stderr: true}}, spectral: {{bands: 3}}}}\n\
             lights: [{{point: {{position: [0, 4, 3], intensity: {{rgb: [30, 20, 10]}}}}}}]\nshapes:\n\
             - plane: {{normal: [0, 1, 0], material: {{mask: {{opacity: 0.5, material: {{diffuse: {{reflectance: 1}}}}}}}}}}\n\
             - plane: {{point: [0, 0, -2], normal: [0, 0, 1]}}\n\
             - sphere: {{center: [0, 1, 0], radius: 1, material: {{dielectric: {{ior: {{glass: SF11}}}}}}}}\n"
        );
        common::write(&path("s.yaml"), text.as_bytes());
        let overrides = Overrides { output: Some(path("out.exr")), ..Overrides::default() };
        let report = batch::render_batch(&path("s.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
        ["out.exr", "out.spectral.exr"].map(|name| read_exr(&path(name)).unwrap().parts.remove(0))
    };
    for (one, other) in parts(1).iter().zip(&parts(2)) {
        let errors = one.channels.iter().filter(|(name, _)| name.starts_with("stderr.")).count();
        assert!(errors > 0);
        for (name, _) in &one.channels {
            assert_eq!(plane(one, name), plane(other, name), "{name}");
            let is_error = name.starts_with("stderr.");
            assert_eq!(plane(one, name).iter().all(|x| *x == 0.0), is_error, "{name}: {:?}", plane(one, name));
        }
    }
}

/// A wall of measured reflectance under a white sky, in the bands of the measurement.
#[test]
fn a_spectral_file_is_paint() {
    use abbe::film::Window;
    use abbe::film::exr::{ChannelData, Compression, ExrImage, Layout, write_exr};
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    let paint = [("T.450,0nm", 0.25), ("T.550,0nm", 0.75), ("T.650,0nm", 0.5)];
    let image = ExrImage {
        frame: [2, 2],
        window: Window::full(2, 2),
        channels: paint.iter().map(|(name, r)| ((*name).to_owned(), ChannelData::F32(vec![*r; 4]))).collect(),
        colour: None,
        attributes: Vec::new(),
        data: std::collections::BTreeSet::new(),
        compression: Compression::Zip,
        layout: Layout::Single,
    };
    write_exr(&path("paint.exr"), &image).unwrap();
    let frame = FRAME.replace("float}", "float}, spectral: {bands: 3}").replace("samples: 16", "samples: 256");
    let wall = "lights: [{constant: {radiance: 1}}]\ntextures: {paint: {image: {file: paint.exr}}}\n\
                shapes: [{plane: {normal: [0, 0, 1], point: [0, 0, -1], material: {diffuse: {reflectance: {texture: paint}}}}}]\n";
    common::write(&path("wall.yaml"), format!("{frame}{wall}").as_bytes());
    let overrides = Overrides { output: Some(path("wall.exr")), ..Overrides::default() };
    let report = batch::render_batch(&path("wall.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
    let part = read_exr(&path("wall.spectral.exr")).unwrap().parts.remove(0);
    // Linear between 0.25, 0.75 and 0.5, and held beyond: means over 400 to 500, 500 to 600 and 600 to 700 nm.
    let expected = [
        (0.25 + (0.25 + 0.5) / 2.0) / 2.0,
        ((0.5 + 0.75) / 2.0 + (0.75 + 0.625) / 2.0) / 2.0,
        (0.5 + (0.625 + 0.5) / 2.0) / 2.0,
    ];
    for (name, expected) in ["S0.450,000000nm", "S0.550,000000nm", "S0.650,000000nm"].iter().zip(expected) {
        let mean = plane(&part, name).iter().sum::<f32>() / 384.0;
        assert!((mean / expected - 1.0).abs() < 5e-3, "{name}: {mean} against {expected}");
    }

    // What is radiance is no paint.
    let radiance = ExrImage {
        channels: ["S0.450nm", "S0.550nm"].map(|name| (name.to_owned(), ChannelData::F32(vec![0.5; 4]))).to_vec(),
        ..image
    };
    write_exr(&path("paint.exr"), &radiance).unwrap();
    let report = batch::render_batch(&path("wall.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 2);
    let said = format!("{:?}", report.scenes[0].status);
    assert!(said.contains("expected reflectances (channels T), found radiance (S0)"), "{said}");
}

/// A camera comes nearer by more than what lies before its near plane, or before the plane of one without perspective: what is
/// cut away by then has its way all the same.
#[test]
fn motion_passes_the_clipping_planes() {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    let scene = |camera: &str, z: f64| {
        format!(
            "camera: {{origin: {{1: [0, 0, 2], 2: [0.1, 0, 1]}}, target: {{1: [0, 0, 0], 2: [0.1, 0, -1]}}, {camera}}}\n\
             image: {{width: 16, height: 16}}\nrender: {{samples: 1, frames: '1-2'}}\noutput: {{exr: {{precision: float}}}}\n\
             layers: [motion]\nlights: [{{constant: {{radiance: 1}}}}]\n\
             shapes: [rectangle: {{corner: [-2, -2, {z}], edge_u: [4, 0, 0], edge_v: [0, 4, 0]}}]\n"
        )
    };
    let motion = |camera: &str, z: f64| {
        common::write(&path("scene.yaml"), scene(camera, z).as_bytes());
        let overrides = Overrides { output: Some(path("out")), ..Overrides::default() };
        let report = batch::render_batch(&path("scene.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
        let picture = read_exr(&path("out/scene.0001.exr")).unwrap().parts.remove(0);
        ["motion.X", "motion.Y"].map(|name| plane(&picture, name).to_vec())
    };
    // From 1.1 m to 0.1 m: what is x pixels from the middle comes to be 11 x away, less 0.1 m of 16 pixels to 2 · 0.1 · tan 20°.
    let shift = 0.1 * 16.0 / (0.2 * 20f64.to_radians().tan());
    let near = motion("fov_deg: 40, clip: {near: 0.5}", 0.9);
    assert_eq!(near, motion("fov_deg: 40", 0.9));
    for i in 0..256 {
        let (x, up) = ((i % 16) as f64 - 7.5, 7.5 - (i / 16) as f64);
        let expected = [10.0 * x - shift, 10.0 * up];
        let off = (0..2).map(|c| (f64::from(near[c][i]) - expected[c]).abs());
        assert!(off.fold(0.0, f64::max) < 1e-3, "{i}: {:?}, expected {expected:?}", near.clone().map(|c| c[i]));
    }
    // Without perspective what stands behind goes as far as all else: 0.1 m of 16 pixels to 2 m.
    let flat = motion("orthographic_height: 2", 1.5).map(|c| c.into_iter().map(f64::from).collect::<Vec<_>>());
    assert!(flat[0].iter().all(|x| (x + 0.8).abs() < 1e-6) && flat[1].iter().all(|y| y.abs() < 1e-6), "{flat:?}");
}

/// Forms of every kind that move, turn and grow, and a camera that pans, from frame 1 to 2: the point that the middle of a
/// pixel shows in frame 1 is, `motion` away, shown with the same texture coordinates in frame 2. There they are taken
/// between four pixels; how far they are from linear over a pixel is a small part of what they change across it.
#[test]
fn motion_leads_to_the_same_point_one_frame_later() {
    let place = TempDir::new().unwrap();
    let path = |name: &str| place.path().join(name);
    let scene = "camera: {origin: [0, 0, 10], target: {1: [0, 0, 0], 2: [0.3, 0, 0]}, fov_deg: 40}\n\
        image: {width: 160, height: 120}\n\
        render: {samples: 1, frames: '1-2', seed_per_frame: false}\n\
        output: {exr: {precision: float}}\n\
        layers: [motion, uv, crypto_object]\n\
        lights: [{constant: {radiance: 1}}]\n\
        groups: {pair: [{sphere: {center: [0, 0, 0], radius: 0.5}}]}\n\
        shapes:\n\
        - sphere: {center: {1: [-2, 1, 0], 2: [-1.6, 1.2, 0]}, radius: {1: 0.8, 2: 1.0}}\n\
        - cube: {center: [1.5, 1, 0], size: 1.2, transform: [{rotate: {axis: [0, 1, 0], deg: {1: 20, 2: 30}}}]}\n\
        - cylinder: {base: {1: [-2, -1.6, 0], 2: [-1.8, -1.5, 0]}, top: {1: [-2, -0.4, 0], 2: [-1.8, -0.1, 0]}, radius: 0.5}\n\
        - rectangle: {corner: {1: [0.8, -1.8, 0], 2: [1, -1.6, 0]}, edge_u: [1.5, 0, 0], edge_v: [0, 1.2, 0]}\n\
        - instance: {group: pair, transform: [{translate: {1: [0, 0, 0], 2: [0.3, -0.2, 0]}}]}\n";
    common::write(&path("scene.yaml"), scene.as_bytes());
    let overrides = Overrides { output: Some(path("out")), ..Overrides::default() };
    let report = batch::render_batch(&path("scene.yaml"), &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
    let frame = |n: u32| read_exr(&path(&format!("out/scene.{n:04}.exr"))).unwrap().parts.remove(0);
    let (first, second) = (frame(1), frame(2));
    let mut compared = std::collections::BTreeMap::<u32, [u32; 2]>::new();
    for i in 0..160 * 120 {
        let (x, y) = ((i % 160) as f32, (i / 160) as f32);
        let [dx, dy] = ["motion.X", "motion.Y"].map(|name| plane(&first, name)[i]);
        let (to_x, to_y) = (x + dx, y - dy);
        let id = plane(&first, "CryptoObject00.R")[i];
        if id == 0.0 || !(1.0..158.0).contains(&to_x) || !(1.0..118.0).contains(&to_y) {
            continue;
        }
        let (left, upper) = (to_x.floor(), to_y.floor());
        let j = upper as usize * 160 + left as usize;
        let corners = [j, j + 1, j + 160, j + 161];
        // All show the same thing.
        if corners.iter().any(|j| plane(&second, "CryptoObject00.R")[*j] != id) {
            continue;
        }
        for name in ["uv.U", "uv.V"] {
            let [a, b, c, d] = corners.map(|j| plane(&second, name)[j]);
            let pixel = (b - a).abs().max((c - a).abs()).max((d - a).abs());
            let (tx, ty) = (to_x - left, to_y - upper);
            let found = (a * (1.0 - tx) + b * tx) * (1.0 - ty) + (c * (1.0 - tx) + d * tx) * ty;
            let off = (plane(&first, name)[i] - found).abs();
            // u of round things jumps where it has been once around, and on faces of a cube.
            if pixel < 0.05 {
                let [all, others] = compared.entry(id.to_bits()).or_default();
                *all += 1;
                *others += u32::from(off > 0.2 * pixel + 1e-4);
            }
        }
    }
    // At its limb a form hides a few of its own points one frame later, and near a pole u is not linear.
    let agree = |[all, others]: &[u32; 2]| *all > 100 && others * 25 <= *all;
    assert!(compared.len() == 5 && compared.values().all(agree), "{compared:?}");
    // Nothing but the camera moves the sky: 0.3 of 10 m at 160 / (2 · 10 · tan 20°) pixels a metre, to the left, and in
    // the middle of the picture a little more exactly: atan of it, turned.
    let sky = plane(&first, "motion.X")[10 * 160 + 80];
    let expected = -0.3 * 160.0 / (20.0 * 20f32.to_radians().tan());
    assert!((sky / expected - 1.0).abs() < 0.05, "{sky} against {expected}");
}
