//! What the batch writes is what a reader finds: windows, channels, colour, header, values.

mod common;

use abbe::batch::checkpoint::Keep;
use abbe::batch::report::{Report, Status};
use abbe::batch::{self, Overrides};
use abbe::film::Window;
use abbe::film::compare::{CompareOptions, Verdict, compare};
use abbe::film::exr::{ExrFile, SHARED_ERRORS, read_exr};
use abbe::film::resolve;
use abbe::spectrum::ColourSpace;
use common::{Bench, assert_close, bench_with};
use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// A red ball in front of a blue wall, 20 × 12 pixels, of which 7 × 5 are cropped.
const SCENE: &str = "camera: {origin: [1, 2, 6], target: [0, 0.5, 0], fov_deg: 40}\n\
    lights: [{directional: {direction: [-1, -2, -3], irradiance: 4}}]\n\
    materials: {red: {diffuse: {reflectance: {rgb: [0.8, 0.1, 0.05]}}}, blue: {diffuse: {reflectance: {rgb: [0.1, 0.2, 0.7]}}}}\n\
    shapes:\n- sphere: {center: [0, 0.5, 0], radius: 1, material: red}\n\
    - rectangle: {corner: [-2, -2, -2], edge_u: [4, 0, 0], edge_v: [0, 4, 0], material: blue}\n";
const IMAGE: &str = "image: {width: 20, height: 12, crop: {x: 6, y: 3, width: 7, height: 5}}\n";
const CROP: Window = Window { x: 6, y: 3, width: 7, height: 5 };

struct Written {
    bench: Bench,
    report: Report,
    path: PathBuf,
}

/// Renders through the batch with `more` in the scene.
fn written(more: &str) -> Written {
    written_as(IMAGE, more)
}

/// [`written`] with another `image`.
fn written_as(image: &str, more: &str) -> Written {
    let bench = bench_with(&format!("{SCENE}{image}render: {{samples: 16, seed: 5}}\n{more}"), &[]);
    let out = bench.directory.path().join("out");
    let overrides = Overrides { output: Some(out.clone()), ..Overrides::default() };
    let yaml = bench.directory.path().join("scene.yaml");
    let report = batch::render_batch(&yaml, &overrides, &(), &AtomicBool::new(false)).unwrap();
    assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
    Written { bench, report, path: out.join("scene.exr") }
}

impl Written {
    fn file(&self) -> ExrFile {
        read_exr(&self.path).unwrap()
    }

    fn header(&self) -> Header {
        let meta = exr::meta::MetaData::read_from_file(&self.path, true).unwrap();
        assert_eq!(meta.headers.len(), 1, "one part");
        meta.headers[0].clone()
    }
}

#[test]
fn a_cropped_file_has_the_frame_as_display_and_the_crop_as_data_window() {
    let file = written("").file();
    assert_eq!(file.display, Window::full(20, 12));
    assert_eq!(file.parts.len(), 1);
    assert_eq!(file.parts[0].window, CROP);
    let names: Vec<&str> = file.parts[0].channels.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(names, ["A", "B", "G", "R"]);
    assert!(file.parts[0].channels.iter().all(|(_, c)| c.len() == CROP.pixels()));
}

/// The values in a 32-bit file are those of the film, to the bit, in every compression; in a 16-bit file they
/// are rounded to 11 bits.
#[test]
fn values_come_back_as_they_were_rendered() {
    let float = "output: {exr: {precision: float, compression: zips, stderr: true}}\n";
    let reference = written(float);
    let film = reference.bench.film();
    let image = resolve::resolve(&film, None, &ColourSpace::Rec709.matrix_from_xyz());
    let bits = |v: &[f32]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    for compression in ["none", "zips", "zip", "piz"] {
        let file = written(&float.replace("zips", compression)).file();
        let part = &file.parts[0];
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            assert_eq!(bits(part.channel(name).unwrap()), bits(&image.rgb[c]), "{compression} {name}");
            let error = part.channel(&format!("stderr.{name}")).unwrap();
            assert_eq!(bits(error), bits(&image.standard_error[c]), "{compression} {name}");
        }
        assert_eq!(bits(part.channel("A").unwrap()), bits(&image.alpha), "{compression}");
    }
    let half = written("").file();
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        for (found, exact) in half.parts[0].channel(name).unwrap().iter().zip(&image.rgb[c]) {
            // Half an ulp of 11 bits; below the normal range of half, of its smallest step 2⁻²⁴.
            assert!((found - exact).abs() <= exact.abs() / 2048.0 + 2f32.powi(-25), "{name}: {exact}, {found}");
        }
    }
}

/// Files in other primaries hold the same light: brought back to Rec. 709 they agree, and their header names
/// the primaries and the encoding.
#[test]
fn colour_spaces_are_named_and_hold_the_same_light() {
    let spaces = [
        ("rec709", ColourSpace::Rec709, "lin_rec709_scene"),
        ("acescg", ColourSpace::AcesCg, "lin_ap1_scene"),
        ("aces2065-1", ColourSpace::Aces2065_1, "lin_ap0_scene"),
        ("rec2020", ColourSpace::Rec2020, "lin_rec2020_scene"),
        ("p3", ColourSpace::P3D65, "lin_p3d65_scene"),
        ("xyz", ColourSpace::Xyz, "lin_ciexyzd65_scene"),
    ];
    let rgb = |file: &ExrFile, i: usize| ["R", "G", "B"].map(|c| file.parts[0].channel(c).unwrap()[i]);
    let mut first: Option<ExrFile> = None;
    for (name, space, id) in spaces {
        let file = written(&format!("output: {{colour: {name}, exr: {{precision: float}}}}\n")).file();
        let primaries = space.chromaticities().map(|p| p.map(|x| x as f32));
        assert_eq!(file.chromaticities, Some(primaries), "{name}");
        assert_eq!(file.parts[0].text("colorInteropID"), Some(id), "{name}");
        let reference = first.get_or_insert_with(|| file.clone());
        for i in 0..CROP.pixels() {
            let (a, m) = (rgb(reference, i), space.to_rec709());
            let b = rgb(&file, i).map(f64::from);
            for c in 0..3 {
                let back = m[c][0] * b[0] + m[c][1] * b[1] + m[c][2] * b[2];
                // Three products of numbers up to 1 with entries up to 3, rounded to f32.
                assert!((back - f64::from(a[c])).abs() < 1e-6, "{name}: pixel {i}, channel {c}: {}, {back}", a[c]);
            }
        }
    }
}

#[test]
fn the_header_says_how_the_picture_was_made_and_how_good_it_is() {
    let w = written("");
    let file = w.file();
    let text = |name: &str| file.parts[0].text(name).unwrap_or_else(|| panic!("no {name}")).to_owned();
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(text("software"), format!("Abbe {version}"));
    assert_eq!(text("comments"), "scene");
    assert_eq!(text("abbe/version"), version);
    assert_eq!(text("abbe/sceneHash"), w.report.scenes[0].scene_hash);
    assert_eq!(text("abbe/seed"), "5");
    assert_eq!(text("abbe/integrator"), "path");
    assert_eq!(text("abbe/invalidSamples"), "0");
    assert_eq!(text("abbe/effects"), w.report.scenes[0].effects_in_force().join(", "));
    assert_eq!(text("abbe/wavelengths"), w.report.scenes[0].wavelengths);

    let header = w.header();
    let own = |name: &str| header.own_attributes.other.get(&exr::meta::attribute::Text::from(name)).cloned();
    assert_eq!(own("abbe/samples"), Some(AttributeValue::I32(16)));
    let Some(AttributeValue::F64(seconds)) = own("abbe/renderSeconds") else { panic!("{header:?}") };
    assert!(seconds > 0.0 && (seconds - w.report.scenes[0].seconds.rendering).abs() < 1e-9);
    let Some(AttributeValue::F64(error)) = own("abbe/relativeError") else { panic!("{header:?}") };
    assert_eq!(error, w.report.scenes[0].error.unwrap().rel_rmse);
    assert!(header.shared_attributes.pixel_aspect == 1.0);
}

/// Matrices for row vectors: the camera's place is the origin of its space, the target lies on its axis, in
/// the middle of the picture.
#[test]
fn the_camera_in_the_header_is_the_camera() {
    let header = written("").header();
    let own = &header.own_attributes;
    let to_camera = own.world_to_camera.expect("worldToCamera");
    let to_ndc = own.world_to_normalized_device.expect("worldToNDC");
    let apply = |m: &[f32; 16], p: [f64; 4]| -> [f64; 4] {
        std::array::from_fn(|j| (0..4).map(|i| p[i] * f64::from(m[4 * i + j])).sum())
    };
    let eye = apply(&to_camera, [1.0, 2.0, 6.0, 1.0]);
    // Sums of numbers up to 10, rounded to f32.
    assert!(eye[..3].iter().all(|x| x.abs() < 2e-6), "{eye:?}");
    let target = apply(&to_camera, [0.0, 0.5, 0.0, 1.0]);
    let distance = (1.0f64 + 1.5 * 1.5 + 36.0).sqrt();
    assert!(target[0].abs() < 2e-6 && target[1].abs() < 2e-6);
    assert_close(target[2], distance, 1e-6);
    let middle = apply(&to_ndc, [0.0, 0.5, 0.0, 1.0]);
    assert_close(middle[0] / middle[3], 0.5, 1e-6);
    assert_close(middle[1] / middle[3], 0.5, 1e-6);
    // The frame in the plane at distance one: what is at its left edge there is at 0 of the picture.
    let exr::math::Vec2(x, y) = own.screen_window_center;
    assert_eq!([x, y], [0.0; 2]);
    let half = f64::from(own.screen_window_width) / 2.0;
    let world = [0.7, -0.4, 1.2, 1.0];
    let (seen, place) = (apply(&to_camera, world), apply(&to_ndc, world));
    assert_close(place[0] / place[3], 0.5 + seen[0] / seen[2] / (2.0 * half), 1e-5);
}

/// Where half cannot hold a value, the file is 32 bits wide and the report says so; nothing is clamped.
#[test]
fn light_beyond_half_is_written_as_float_with_a_note() {
    let hot = "fog: {colour: 1.0e+6, start: 0, end: 1}\n";
    let w = written(hot);
    let file = w.file();
    let peak = file.parts[0].channel("G").unwrap().iter().copied().fold(0.0f32, f32::max);
    assert!(peak > 65504.0 && peak.is_finite(), "{peak}");
    let note = w.report.scenes[0].notes.join("; ");
    assert!(note.contains("written as 32-bit float"), "{note}");
}

/// The PNG holds the pixels of the data window, right side up: the same middle as the EXR.
#[test]
fn the_png_shows_the_crop() {
    let w = written("output: {png: {tonemap: none}}\n");
    let png = image::open(w.path.with_extension("png")).unwrap().into_rgb8();
    assert_eq!((png.width(), png.height()), (CROP.width, CROP.height));
    let file = w.file();
    let encode = |linear: f32| {
        let l = f64::from(linear).clamp(0.0, 1.0);
        let coded = if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
        255.0 * coded
    };
    for (i, pixel) in png.pixels().enumerate() {
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            let exact = encode(file.parts[0].channel(name).unwrap()[i]);
            // Dither moves a value to either neighbour; half's rounding by a tenth of a step.
            assert!((f64::from(pixel.0[c]) - exact).abs() < 1.2, "pixel {i}, {name}: {exact}, {}", pixel.0[c]);
        }
    }
}

/// Overscan changes nothing inside the frame, and none of it is shown: not by the light that a meter sees, either. The picture is found
/// again.
#[test]
fn the_png_ends_at_the_frame() {
    let png = |overscan: u32| {
        let image = format!("image: {{width: 20, height: 12, overscan: {overscan}}}\n");
        let w = written_as(&image, "output: {png: {exposure: auto}}\n");
        let yaml = w.bench.directory.path().join("scene.yaml");
        let keep = Keep { skip_existing: true, ..Keep::default() };
        let again = Overrides { output: w.path.parent().map(PathBuf::from), keep, ..Overrides::default() };
        let report = batch::render_batch(&yaml, &again, &(), &AtomicBool::new(false)).unwrap();
        assert!(matches!(report.scenes[0].status, Status::Skipped), "{:?}", report.scenes[0].status);
        image::open(w.path.with_extension("png")).unwrap().into_rgb8()
    };
    let frame = png(0);
    assert_eq!(frame.dimensions(), (20, 12));
    assert!(png(5) == frame);
}

/// Alpha is coverage: one on the ball and the wall, zero beside them, between at the edges.
#[test]
fn alpha_is_one_on_things_and_zero_beside_them() {
    let bench = bench_with(
        "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 16, height: 16}\n\
         render: {samples: 64}\nlights: [{constant: {radiance: 1}}]\nshapes: [{sphere: {radius: 1}}]\n",
        &[],
    );
    let image = resolve::resolve(&bench.film(), None, &ColourSpace::Rec709.matrix_from_xyz());
    let at = |x: usize, y: usize| image.alpha[16 * y + x];
    assert_eq!((at(8, 8), at(7, 7), at(0, 0), at(15, 3)), (1.0, 1.0, 0.0, 0.0));
    // The disc seen has the angle asin(1/5): its share of the picture is π tan²(asin ⅕) / (2 tan 20°)².
    let covered: f64 = image.alpha.iter().map(|a| f64::from(*a)).sum::<f64>() / 256.0;
    let expected = std::f64::consts::PI * (1.0 / 24.0) / (2.0 * 20f64.to_radians().tan()).powi(2);
    // 256 pixels of 64 samples, of which the edge's 30 are not certain: √(30 · ¼ / 64) / 256 = 0.0013 at most.
    assert!((covered - expected).abs() < 4.0 * 0.0013, "{covered}, expected {expected}");
}

/// Light that is dealt to all pixels under a wide filter falls into them together. Ten pairs of pictures of one scene, of which
/// one in a thousand may be called different: the chance of two or more is 4e-5. Told nothing, half of them are.
#[test]
fn pictures_of_one_scene_are_the_same_where_pixels_share_their_light() {
    let file = |seed: u64| {
        let text = format!(
            "camera: {{origin: [0, 1.6, 6], target: [0, 0.9, 0], fov_deg: 40}}\n\
             image: {{width: 16, height: 16, filter: {{gaussian: {{stddev: 2}}}}}}\nrender: {{samples: 64, seed: {seed}}}\n\
             integrator: light_tracer\noutput: {{exr: {{precision: float, stderr: true}}}}\n\
             shapes:\n- plane: {{normal: [0, 1, 0]}}\n- sphere: {{center: [0, 1, 0], radius: 1}}\n\
             - sphere: {{center: [-3, 5, 4], radius: 1, emission: 25}}\n"
        );
        let bench = bench_with(&text, &[]);
        let out = bench.directory.path().join("out");
        let overrides = Overrides { output: Some(out.clone()), ..Overrides::default() };
        let yaml = bench.directory.path().join("scene.yaml");
        let report = batch::render_batch(&yaml, &overrides, &(), &AtomicBool::new(false)).unwrap();
        assert_eq!(report.exit_code(), 0, "{:?}", report.scenes[0].status);
        read_exr(&out.join("scene.exr")).unwrap()
    };
    let forget = |mut file: ExrFile| {
        file.parts[0].texts.retain(|(name, _)| name != SHARED_ERRORS);
        file
    };
    let (mut told, mut untold) = (0, 0);
    for pair in 0..10 {
        let (a, b) = (file(2 * pair), file(2 * pair + 1));
        let differ = |a: &ExrFile, b: &ExrFile| compare(a, b, &CompareOptions::default()).verdict == Verdict::Different;
        told += u32::from(differ(&a, &b));
        untold += u32::from(differ(&forget(a), &forget(b)));
    }
    assert!(told <= 1 && untold >= 3, "{told} {untold}");
}
