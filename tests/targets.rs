//! What a person asks of accuracy and time on the command line, and what comes of it.

mod common;

use abbe::film::exr::read_exr;
use abbe::spectrum::{ColourSpace, Spectrum, colour, observer, upsample};
use common::place::Place;
use serde_json::Value;

/// A ball under a lamp, in a white room without a ceiling.
const SCENE: &str = "\
camera: {origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}
image: {width: 24, height: 24}
render: {samples: 16, techniques: {reuse: on, shadow_rays: 4}}
shapes:
- sphere: {radius: 0.7}
- rectangle: {corner: [-3, -1, -2], edge_u: [0, 0, 5], edge_v: [6, 0, 0]}
- sphere: {center: [-1.5, 3.5, 2], radius: 0.5, emission: 30}
";

/// The colour of light in linear Rec. 709.
fn rgb(s: &Spectrum) -> [f64; 3] {
    colour::times(ColourSpace::Rec709.matrix_from_xyz(), observer::tristimulus(s))
}

/// The exit code, and what was said on both outputs.
fn abbe(place: &Place, arguments: &str) -> (i32, String) {
    let ran = place.run(&arguments.split_whitespace().collect::<Vec<_>>());
    (ran.code, ran.out + &ran.err)
}

/// The render ends below the error that was asked for, not far below, and what was foretold stands beside what came.
#[test]
fn a_render_ends_at_the_error_that_was_asked_for() {
    let place = Place::of(SCENE);
    let (code, said) = abbe(&place, "render scene.yaml -o . --error 3%");
    assert_eq!(code, 0, "{said}");
    let scene = &place.json("report.json")["scenes"][0];
    let error = scene["error"]["rel_rmse"].as_f64().unwrap();
    // One pass adds an eighth of the samples or more: at worst a doubling that was not foretold.
    assert!((0.02..=0.03).contains(&error), "{error}");
    let samples = scene["samples"].as_u64().unwrap();
    assert!(scene["forecast"]["made_at"].as_u64().unwrap() <= samples / 4);
    assert!(said.contains("foretold at a quarter of the samples"), "{said}");
    // Where no samples are shared out it is the same picture as that of as many samples asked for as a number.
    let even = "--set render.techniques.adaptive=off";
    let hash = |arguments: &str| {
        let (code, said) = abbe(&place, &format!("render scene.yaml {even} {arguments}"));
        assert_eq!(code, 0, "{said}");
        let scene = place.json("report.json")["scenes"][0].take();
        (scene["pixel_hash"].clone(), scene["samples"].as_u64().unwrap())
    };
    let (to_error, samples) = hash("-o even.exr --error 3%");
    assert_eq!((to_error, samples), hash(&format!("-o same.exr --spp {samples}")));
}

#[test]
fn targets_end_a_render_whichever_comes_first() {
    let place = Place::of(SCENE);
    let samples = |arguments: &str| {
        let (code, said) = abbe(&place, &format!("render scene.yaml -o . {arguments}"));
        assert_eq!(code, 0, "{said}");
        place.json("report.json")["scenes"][0]["samples"].as_u64().unwrap()
    };
    assert_eq!(samples("--error 0.001% --spp 8"), 8);
    assert_eq!(samples("--time 1h --spp 12"), 12);
    assert!(samples("--time 1h --error 20%") <= 32);
    assert_eq!(samples("--set render.stop.samples=20"), 20);
}

/// Samples of the command line bound what the file gives as its targets; a number of samples there is as good as one outside.
#[test]
fn samples_of_the_command_line_bound_the_stop_of_the_file() {
    for stop in ["{samples: 32}", "{error: 1e-5}", "{error: 1e-5, samples: 32}"] {
        let place = Place::of(&SCENE.replace("samples: 16", &format!("samples: 16, stop: {stop}")));
        let (code, said) = abbe(&place, "render scene.yaml -q -o a.exr --spp 8");
        assert_eq!(code, 0, "{stop}: {said}");
        assert_eq!(place.json("report.json")["scenes"][0]["samples"], 8, "{stop}");
    }
    let place = Place::of(SCENE);
    let (code, said) = abbe(&place, "render scene.yaml -q -o a.exr --error 1% --set render.samples=0");
    assert_eq!((code, said.matches("expected").count()), (2, 1), "{said}");
    let hash = |arguments: &str| {
        assert_eq!(abbe(&place, &format!("render scene.yaml -q -o a.exr {arguments}")).0, 0);
        place.json("report.json")["scenes"][0]["scene_hash"].clone()
    };
    let eight = hash("--spp 8");
    assert_eq!(eight, hash("--set render.samples=8"));
    assert_eq!(eight, hash("--set render.stop.samples=8"));
    assert_ne!(eight, hash("--spp 12"));
    let place = Place::of(&SCENE.replace("samples: 16", "samples: 16, stop: {error: 1e-5}"));
    for spelt in ["8.0", "8e0", "0x8", "+8"] {
        assert_eq!(abbe(&place, &format!("render scene.yaml -q -o a.exr --set render.samples={spelt}")).0, 0);
        assert_eq!(place.json("report.json")["scenes"][0]["samples"], 8, "{spelt}");
    }
    assert_eq!(abbe(&place, "render scene.yaml -q -o a.exr --set \"render\".samples=8").0, 0);
    assert_eq!(place.json("report.json")["scenes"][0]["samples"], 8);
}

/// A time or an error for all scenes is none for those by `whitted`; one of their own is refused.
#[test]
fn targets_of_a_batch_pass_over_scenes_without_noise() {
    let place = Place::of(SCENE);
    let batch = |render: &str, own: &str| {
        let whitted = format!("{{file: scene.yaml, name: w, set: {{integrator: whitted{own}}}}}");
        std::fs::write(place.path("batch.yaml"), format!("{render}scenes: [{{file: scene.yaml}}, {whitted}]\n"))
            .unwrap();
    };
    batch("", "");
    let (code, said) = abbe(&place, "render batch.yaml -q -o . --error 20%");
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("note: w: whitted has no noise") && place.path("w.exr").exists(), "{said}");
    assert!(!said.contains("note: scene: whitted"), "{said}");
    batch("render: {stop: {error: 0.2}}\n", "");
    assert_eq!(abbe(&place, "render batch.yaml -q -o .").0, 0);
    // So are those of a task, which has one scene, and what is planned.
    let (code, said) = abbe(&place, "render batch.yaml -q -o . --scene w");
    assert!(code == 0 && said.contains("note: w: whitted has no noise"), "{code} {said}");
    assert_eq!(abbe(&place, "plan batch.yaml").0, 0);
    assert_eq!(abbe(&place, "farm batch.yaml -q --format slurm -o job --scene w --tiles 2").0, 0);
    batch("", ", render.stop.error: 0.2");
    let (code, said) = abbe(&place, "render batch.yaml -q -o .");
    assert!(code == 2 && said.contains("whitted has no noise: its time"), "{code} {said}");
    // A field without value is not written.
    batch("render: {stop: null}\n", ", render.stop.error: 0.2");
    let (code, said) = abbe(&place, "render batch.yaml -q -o .");
    assert!(code == 2 && said.contains("render.stop: whitted has no noise"), "{code} {said}");
    batch("", "");
    assert_eq!(abbe(&place, "render batch.yaml -q -o . --error 20% --scene w").0, 2);
    // Each task would end so.
    let (code, said) = abbe(&place, "farm batch.yaml -q --format slurm -o other --set render.stop.error=0.2");
    assert!(code == 2 && said.contains("render.stop: whitted has no noise"), "{code} {said}");
}

#[test]
fn a_target_out_of_reach_is_told_and_the_picture_is_there() {
    let place = Place::of(SCENE);
    let (code, said) = abbe(&place, "render scene.yaml -q -o short.exr --time 0.000001s");
    assert_eq!(code, 4, "{said}");
    assert!(said.contains("is too short for 4 samples of each pixel"), "{said}");
    assert!(place.path("short.exr").exists() && place.path("short.png").exists());
    let (code, again) = abbe(&place, "render scene.yaml -q -o short.exr --time 0.000001s --resume");
    assert_eq!((code, again.lines().last()), (4, said.lines().last()));
}

#[test]
fn a_batch_tells_a_target_out_of_reach_from_a_failure() {
    let place = Place::of(SCENE);
    let batch = "scenes: [{file: scene.yaml, name: a, set: {render.stop.time: 1e-6}}, {file: scene.yaml}]";
    std::fs::write(place.path("batch.yaml"), batch).unwrap();
    let (code, said) = abbe(&place, "render batch.yaml -q -o .");
    assert_eq!(code, 4, "{said}");
    assert_eq!(
        said.lines().last(),
        Some("error: 1 of 2 scenes written short of a target or with invalid samples"),
        "{said}"
    );
    assert!(!said.contains("failed") && place.path("a.exr").exists() && place.path("scene.exr").exists());
    // Both have a row, and their files and pictures count.
    let (_, table) = abbe(&place, "render batch.yaml -o .");
    assert!(table.lines().any(|line| line.starts_with("a ")), "{table}");
    assert!(table.contains("4 files in"), "{table}");
    let page = std::fs::read_to_string(place.path("contact-sheet.html")).unwrap();
    assert!(page.contains("a.exr") && page.contains("scene.exr"));
}

/// A frame before its fade-in: where no light has power the picture is black for sure, whole or in parts.
#[test]
fn without_light_any_error_is_reached_at_once() {
    let place = Place::of(SCENE);
    let dark = "--set shapes[2].sphere.emission=0";
    let (code, said) = abbe(&place, &format!("render scene.yaml -o whole.exr --error 1e-3 {dark}"));
    assert_eq!(code, 0, "{said}");
    let scene = &place.json("report.json")["scenes"][0];
    assert!(scene["error"]["rel_rmse"] == 0.0 && scene["error"]["valid"] == true, "{scene}");
    assert!(scene["samples"].as_u64().unwrap() <= 16, "{scene}");
    for part in ["0/2", "1/2"] {
        assert_eq!(
            abbe(&place, &format!("render scene.yaml -o {{scene}}.{}.exr --tile {part} {dark}", &part[..1])).0,
            0
        );
    }
    assert_eq!(abbe(&place, "merge scene.0.exr scene.1.exr -o merged.exr").0, 0);
    assert!(abbe(&place, "info merged.exr").1.contains("error       0"));
}

#[test]
fn what_knows_no_error_refuses_one() {
    let place = Place::of(SCENE);
    let part = abbe(&place, "render scene.yaml -q -o part.exr --error 1% --tile 0/2");
    assert_eq!(part.0, 2);
    assert!(part.1.contains("a part cannot know the error"), "{}", part.1);
    let whitted = abbe(&place, "render scene.yaml -q -o w.exr --error 1% --set integrator=whitted");
    assert_eq!(whitted.0, 2);
    assert!(whitted.1.contains("whitted has no noise"), "{}", whitted.1);
    assert_eq!(abbe(&place, "render scene.yaml --error=-1").0, 2);
}

/// The open room has two bounces and more: depth 2 misses them, and the sheet says so; without a bound nothing is missed.
#[test]
fn the_sheet_finds_what_a_bound_to_depth_costs() {
    let place = Place::of(SCENE);
    let (code, said) =
        abbe(&place, "accuracy scene.yaml -o sheet --rounds 2 --set image.width=48 --set image.height=48");
    assert_eq!(code, 0, "{said}");
    let sheet = &place.json("sheet/accuracy.json")[0];
    let row = |knob: &str, value: &str| {
        let rows = sheet["rows"].as_array().unwrap();
        rows.iter().find(|r| r["knob"] == knob && r["value"] == value).unwrap().clone()
    };
    let bias =
        |row: &Value| [&row["bias_squared"]["value"], &row["bias_squared"]["error"]].map(|x| x.as_f64().unwrap());
    let [two, error] = bias(&row("depth", "2"));
    assert!(two > 1e-3 && two > 2.0 * error, "{two} {error}");
    assert!(row("depth", "2")["to_target"].is_null() && row("depth", "16")["to_target"].is_f64());
    let green = |row: Value| row["light"][1]["value"].as_f64().unwrap();
    assert!(green(row("depth", "2")) < 0.98 && (green(row("depth", "16")) - 1.0).abs() < 0.02);
    let [none, error] = bias(&row("chosen", "as written"));
    assert!(none.abs() < 4.0 * error, "{none} {error}");
    let noise = |row: Value| row["noise"][0].as_f64().unwrap();
    // Nothing here has a colour: three numbers carry all that eight wavelengths do.
    let [colours, error] = bias(&row("transport", "RGB"));
    assert!(colours.abs() < 4.0 * error, "{colours} {error}");
    // Independent samples are noisier than evenly spread ones.
    assert!(noise(row("sampler", "independent")) > 1.1 * noise(row("chosen", "as written")));
    // Four times the samples: half of the noise or less, as the samples are evenly spread.
    let ratio = noise(row("samples", "x 4")) / noise(row("chosen", "as written"));
    assert!((0.2..0.6).contains(&ratio), "{ratio}");
    let page = std::fs::read_to_string(place.path("sheet/accuracy.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("data:image/png;base64,") && !page.contains("http"));
    let csv = std::fs::read_to_string(place.path("sheet/accuracy.csv")).unwrap();
    let columns = csv.lines().next().unwrap().split(',').count();
    assert!(csv.lines().all(|line| line.split(',').count() == columns), "{csv}");
    let without = abbe(&place, "accuracy scene.yaml -o sheet --set integrator=whitted");
    assert!(without.0 == 0 && without.1.contains("only `path` has knobs to weigh"), "{}", without.1);
    let dark = abbe(&place, "accuracy scene.yaml -o sheet --set shapes[2].sphere.emission=0");
    assert!(dark.0 == 0 && dark.1.contains("its picture is black"), "{}", dark.1);
    assert_eq!(place.json("sheet/accuracy.json"), Value::Array(Vec::new()));
}

/// In a room whose walls glow with 1 and give half back the light is 1 + 1/2 + 1/4 + … = 2, and 3/2 with one bounce: of
/// √relMSE |3/2 − 2| / √(2² + f), where f is a hundredth of the square of the mean of all values, 1.02 × 2 in white of equal
/// energy (the mean of 1.205, 0.948 and 0.909): the mean over channels of 1 / (4 + f/c²) is 0.2475 to a hundredth, so the bias is
/// 0.2487. Samples of the full setting have none.
#[test]
fn against_a_closed_form_the_sheet_finds_the_bias_that_is_there() {
    let furnace = "camera: {origin: [0.1, 0.2, 0.3], target: [0, 0, -1], fov_deg: 60}\nimage: {width: 16, height: 16}\n\
                   render: {samples: 64}\nintegrator: {path: {max_depth: null}}\n";
    let walls = common::room("emission: 1, material: {diffuse: {reflectance: 0.5}}");
    let place = Place::of(&(furnace.to_owned() + &walls));
    let (code, said) = abbe(&place, "accuracy scene.yaml -o sheet --rounds 2 --truth 2");
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("the truth is known in closed form"), "{said}");
    let sheet = &place.json("sheet/accuracy.json")[0];
    let rows = sheet["rows"].as_array().unwrap();
    for row in rows.iter().filter(|row| row["knob"] != "file") {
        let figure = |of: &Value| [of["value"].as_f64().unwrap(), of["error"].as_f64().unwrap()];
        let [bias, error] = figure(&row["bias_squared"]);
        if row["knob"] == "depth" && row["value"] == "2" {
            assert!((bias.sqrt() - 0.2487).abs() < 0.003, "{row}");
            let [green, _] = figure(&row["light"][1]);
            assert!((green - 0.75).abs() < 0.005, "{row}");
        } else if row["knob"] != "depth" {
            assert!(bias.abs() < 4.0 * error, "{row}");
        }
    }
    // What a reference would have in samples is said of one alone.
    let page = || std::fs::read_to_string(place.path("sheet/accuracy.html")).unwrap();
    assert!(page().contains("<figcaption>no bound to depth</figcaption>"));
    assert_eq!(abbe(&place, "accuracy scene.yaml -o sheet --rounds 1 --knob samples --spp 16").0, 0);
    assert!(page().contains("<figcaption>no bound to depth, sixteen times the samples</figcaption>"));
    assert_eq!(abbe(&place, "accuracy scene.yaml --truth 0").0, 2);
}

/// A board that shines with 1 fills the frame and nothing is beyond it: of a picture that is rendered for half its width beyond each
/// edge it is (1/2)² = a quarter, so that light of 1 in every pixel is found to a quarter, in a copy of an eighth of its width as well.
#[test]
fn the_small_copy_has_as_much_beyond_the_frame_as_the_picture() {
    let place = Place::of(
        "camera: {origin: [0, 0, 2], target: [0, 0, 0], orthographic_height: 2}\nimage: {width: 64, height: 64, overscan: 32}\n\
         render: {samples: 16}\nshapes:\n- rectangle: {corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], emission: 1}\n",
    );
    let (code, said) = abbe(&place, "accuracy scene.yaml -o sheet --pixels 64 --rounds 1 --knob samples --truth 1");
    assert_eq!(code, 0, "{said}");
    let sheet = &place.json("sheet/accuracy.json")[0];
    assert_eq!(sheet["size"], serde_json::json!([8, 8]));
    let green = sheet["rows"][0]["light"][1]["value"].as_f64().unwrap();
    assert!((green - 0.25).abs() < 0.01, "{green}");
}

/// A lit board of 4 × 4 pixels before nothing: sixteen carry the error of the picture, fewer than an interval is believed of, by
/// `accuracy` as by `render`. One that fills the frame has 256.
#[test]
fn the_sheet_says_what_has_not_converged_as_renders_do() {
    let scene = |half: f64| {
        format!(
            "camera: {{origin: [0, 0, 2], target: [0, 0, 0], orthographic_height: 2}}\nimage: {{width: 16, height: 16}}\n\
             render: {{samples: 16}}\nshapes:\n\
             - rectangle: {{corner: [-{half}, -{half}, 0], edge_u: [{side}, 0, 0], edge_v: [0, {side}, 0]}}\n\
             - sphere: {{center: [0, 3, 3], radius: 0.5, emission: 1}}\n",
            side = 2.0 * half
        )
    };
    for (half, converged) in [(0.25, false), (1.0, true)] {
        let place = Place::of(&scene(half));
        let (code, said) = abbe(&place, "accuracy scene.yaml -o sheet --rounds 2 --knob file");
        assert_eq!(code, 0, "{said}");
        assert_eq!(said.contains("not converged"), !converged, "{said}");
        let row = &place.json("sheet/accuracy.json")[0]["rows"][0];
        assert_eq!(row["converged"], converged, "{row}");
        let (code, said) = abbe(&place, "render scene.yaml -o scene.exr");
        assert_eq!(code, 0, "{said}");
        assert_eq!(said.contains("not converged"), !converged, "{said}");
    }
}

/// A coloured wall fills the view, in coloured light that is the same from everywhere. Its radiance is that of the light times
/// its reflectance, wavelength by wavelength; three numbers are multiplied instead. Both colours are those of smooth
/// spectra, so both products are known. Bounds are four errors of the sheet and the 2e-4 that upsampling may be off by.
#[test]
fn transport_of_three_numbers_errs_as_products_of_colours_do() {
    let (wall, light) = ([0.8, 0.3, 0.05], [0.1, 0.5, 1.0]);
    let scene = format!(
        "camera: {{origin: [0, 0, 1], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 16, height: 16}}\n\
         render: {{samples: 64}}\nlights:\n- constant: {{radiance: {{rgb: {light:?}}}}}\nshapes:\n\
         - rectangle: {{corner: [-2, -2, 0], edge_u: [4, 0, 0], edge_v: [0, 4, 0], \
         material: {{diffuse: {{reflectance: {{rgb: {wall:?}}}}}}}}}\n"
    );
    let place = Place::of(&scene);
    let (code, said) = abbe(&place, "accuracy scene.yaml -o sheet --rounds 2");
    assert_eq!(code, 0, "{said}");
    let sheet = &place.json("sheet/accuracy.json")[0];
    let rows = sheet["rows"].as_array().unwrap();
    let row = rows.iter().find(|row| row["knob"] == "transport").unwrap();
    let spectral = rgb(&upsample::emission(light).unwrap().times(&upsample::reflectance(wall).unwrap()));
    let of_light = rgb(&upsample::emission(light).unwrap());
    let expected: [f64; 3] = std::array::from_fn(|c| of_light[c] * wall[c] / spectral[c]);
    for (c, expected) in expected.into_iter().enumerate() {
        let [found, error] = ["value", "error"].map(|key| row["light"][c][key].as_f64().unwrap());
        assert!((found - expected).abs() < 4.0 * error + 2e-4 * expected, "{c}: {found} ± {error}, {expected}");
    }
    // In two channels or more the products are 2 % apart, so that one is told from the other.
    assert!(expected.iter().filter(|x| (*x - 1.0).abs() > 0.02).count() >= 2, "{expected:?}");
    assert!(said.contains("RGB finds"), "{said}");
}

/// The scenes of `configs/closed_form` have the light that stands in them, whatever a knob is moved to: no bias exceeds four
/// of its errors. The interval that a picture states of its error holds the one that it has.
#[test]
fn shipped_scenes_of_known_light_have_it() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/closed_form");
    for (name, truth) in [("slab", libm::exp(-1.0)), ("disk", 1.0)] {
        let place = Place::with(&[]);
        let scene = format!("{folder}/{name}.yaml");
        let (code, said) = abbe(&place, &format!("accuracy {scene} -o sheet --rounds 2 --truth {truth}"));
        assert_eq!(code, 0, "{said}");
        let sheet = &place.json("sheet/accuracy.json")[0];
        for row in sheet["rows"].as_array().unwrap().iter().filter(|row| row["knob"] != "file") {
            let [bias, error] = ["value", "error"].map(|key| row["bias_squared"][key].as_f64().unwrap());
            // What has no noise at all is off by sums in f32 and by the inverse of a matrix: 1e-5.
            assert!(bias.abs() < 4.0 * error + 1e-10, "{name}: {row}");
        }
        assert_eq!(abbe(&place, &format!("render {scene} -q -o p.exr")).0, 0);
        let white = rgb(&Spectrum::constant(truth));
        let floor = 0.01 * (white.iter().sum::<f64>() / 3.0).powi(2);
        let image = read_exr(&place.path("p.exr")).unwrap();
        let square = |c: usize| {
            let values = image.parts[0].channel(["R", "G", "B"][c]).unwrap();
            let sum: f64 = values.iter().map(|&x| (f64::from(x) - white[c]).powi(2)).sum();
            sum / values.len() as f64 / (white[c] * white[c] + floor)
        };
        let own = ((0..3).map(square).sum::<f64>() / 3.0).sqrt();
        let stated = &place.json("report.json")["scenes"][0]["error"];
        let [low, high] = ["low", "high"].map(|key| stated[key].as_f64().unwrap());
        assert!(stated["valid"] == true && (low..=high).contains(&own), "{name}: {own}, {stated}");
    }
}

/// A sky that is the same everywhere: three numbers of it are the same in each sample, and differ by rounding alone.
#[test]
fn what_differs_by_rounding_alone_has_no_noise() {
    let place = Place::of(
        "camera: {origin: [0, 0, 1], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 8, height: 8}\nrender: {samples: 16}\n\
         lights:\n- constant: {radiance: {illuminant: D65}}\n",
    );
    let (code, said) = abbe(&place, "accuracy scene.yaml -o sheet --rounds 2 --pixels 64 --knob transport");
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("to the same noise RGB has no noise"), "{said}");
    let row = &place.json("sheet/accuracy.json")[0]["rows"][1];
    let noise = row["noise"][0].as_f64().unwrap();
    assert!(row["efficiency"]["value"].is_null() && noise < 1e-5, "{row}");
}

/// Beside layers of light nothing can be traced from the lamps: there is no such knob, and all others have their rows.
#[test]
fn a_scene_with_layers_of_light_has_a_sheet() {
    let glass = "- sphere: {center: [1, 0.5, 1], radius: 0.4, material: {dielectric: {ior: 1.5}}}\n";
    let lamp = "lights:\n- point: {position: [2, 4, 3], intensity: 30}\n";
    let place = Place::of(&format!("{SCENE}{glass}{lamp}layers:\n- {{name: d, light: depth}}\n"));
    let (code, said) = abbe(&place, "accuracy scene.yaml -o sheet --rounds 1 --pixels 64");
    assert_eq!(code, 0, "{said}");
    let sheet = &place.json("sheet/accuracy.json")[0];
    let knobs: Vec<&str> = sheet["rows"].as_array().unwrap().iter().map(|row| row["knob"].as_str().unwrap()).collect();
    assert!(knobs.contains(&"effects") && !knobs.contains(&"light tracing"), "{knobs:?}");
}

/// Of a scene with frames both render the one that the sheet is of, with the same random numbers.
#[test]
fn another_build_renders_the_frame_of_the_sheet() {
    let place = Place::of(&SCENE.replace("samples: 16", "samples: 16, frames: 4-6"));
    let program = env!("CARGO_BIN_EXE_abbe");
    let arguments = "accuracy scene.yaml -o sheet --rounds 1 --pixels 64 --knob roulette";
    let (code, said) = abbe(&place, &format!("{arguments} --beside {program}"));
    assert_eq!(code, 0, "{said}");
    let rows = &place.json("sheet/accuracy.json")[0]["rows"];
    let build = rows.as_array().unwrap().last().unwrap();
    assert_eq!(build["knob"], "build");
    for key in ["samples", "light", "noise", "bias_squared"] {
        assert_eq!(build[key], rows[0][key], "{key}");
    }
}

/// This very program beside itself finds the same picture. What is no build or no knob is told.
#[test]
fn another_build_has_a_row_of_its_own() {
    let place = Place::of(SCENE);
    let program = env!("CARGO_BIN_EXE_abbe");
    let (code, said) =
        abbe(&place, &format!("accuracy scene.yaml -o sheet --rounds 2 --knob depth --beside {program}"));
    assert_eq!(code, 0, "{said}");
    let sheet = &place.json("sheet/accuracy.json")[0];
    let rows = sheet["rows"].as_array().unwrap();
    let knobs: Vec<&str> = rows.iter().map(|row| row["knob"].as_str().unwrap()).collect();
    assert_eq!(knobs, ["chosen", "depth", "depth", "depth", "depth", "build"]);
    for key in ["samples", "light", "noise", "bias_squared"] {
        // The film adds integers: the same samples give the same digits, in one pass or several.
        assert_eq!(rows[5][key], rows[0][key], "{key}");
    }
    assert_eq!(rows[5]["value"], program);
    let (code, said) = abbe(&place, "accuracy scene.yaml --knob depht");
    assert!(code == 2 && said.contains("expected one of samples, depth, sampler"), "{code} {said}");
    assert!(said.contains("found \"depht\"; did you mean \"depth\"?"), "{said}");
    let (code, said) = abbe(&place, "accuracy scene.yaml -o file --rounds 2 --knob file");
    assert_eq!(code, 0, "{said}");
    let rows = &place.json("file/accuracy.json")[0]["rows"];
    assert_eq!(rows.as_array().unwrap().iter().map(|row| &row["knob"]).collect::<Vec<_>>(), ["chosen", "file"]);
    assert_eq!(rows[1]["value"], "half");
    // What half cannot hold is written in float, and loses nothing.
    let (code, said) =
        abbe(&place, "accuracy scene.yaml -o file --rounds 2 --knob file --set shapes[2].sphere.emission=1e9");
    let row = &place.json("file/accuracy.json")[0]["rows"][1];
    assert!(code == 0 && said.contains("files are in float") && !said.contains("NaN"), "{code} {said}");
    assert_eq!((&row["value"], &row["bias_squared"]["value"]), (&"float".into(), &0.0.into()));
    // A program that is not Abbe is told before anything is rendered, and the sheet that is there stays.
    for (program, found) in [("./nothing", "./nothing: "), ("/bin/sh", "/bin/sh: another program")] {
        let (code, said) = abbe(&place, &format!("accuracy scene.yaml -o sheet --knob depth --beside {program}"));
        assert!(code == 2 && said.contains("--beside: expected a build of Abbe, found "), "{code} {said}");
        assert!(said.contains(found) && !said.contains("reference") && !said.contains("written"), "{said}");
    }
    assert_eq!(place.json("sheet/accuracy.json").as_array().unwrap().len(), 1);
}

/// A film of 4096 × 4096 pixels takes four gibibytes: the process ends by itself long before.
#[test]
fn a_memory_limit_ends_the_process_with_a_code_of_its_own() {
    let place = Place::of(SCENE);
    let large = "render scene.yaml -q -o large.exr --set image.width=4096 --set image.height=4096 --spp 1";
    let (code, said) = abbe(&place, &format!("{large} --memory-limit 300M"));
    assert_eq!(code, 33, "{said}");
    assert!(said.contains("more than --memory-limit, 300 MiB"), "{said}");
    assert!(!place.path("large.exr").exists());
    assert_eq!(abbe(&place, "render scene.yaml -q -o small.exr --memory-limit 4G").0, 0);

    // Of 512 × 512 pixels colours and coverage take 64 MiB, 64 bands 256 + 1, and 1024 + 4 with the sums of each replicate.
    let bands = "render scene.yaml -q -o bands.exr --spp 1 --set image.width=512 --set image.height=512 --set output.spectral.bands=64";
    for (more, needed) in [("", 321), (" --set output.exr.stderr=true", 1092)] {
        let (code, said) = abbe(&place, &format!("{bands}{more} --memory-limit 300M"));
        assert!(
            code == 33 && said.contains(&format!("take at least {needed} MiB, more than --memory-limit")),
            "{code} {said}"
        );
    }
    assert!(!place.path("bands.exr").exists());
}

/// Colours and coverage of 512 × 512 pixels take 64 MiB.
#[test]
fn the_memory_of_a_picture_is_told_before_and_after() {
    let place = Place::of(SCENE);
    let picture = "scene.yaml --spp 1 --set image.width=512 --set image.height=512";
    let (code, said) = abbe(&place, &format!("plan {picture}"));
    assert!(code == 0 && said.contains("memory: 64 MiB for the sums"), "{code} {said}");
    let (code, said) = abbe(&place, &format!("plan {picture} --format json"));
    assert!(code == 0 && said.contains("\"sums_bytes\": 67108864"), "{code} {said}");
    let (code, said) = abbe(&place, &format!("render {picture} -o out"));
    let peak = place.json("out/report.json")["peak_memory"].as_u64().unwrap();
    assert!(
        peak > 64 << 20 && said.contains(&format!(", {} MiB at the most;", peak.div_ceil(1 << 20))),
        "{code} {said}"
    );
}

/// Samples that are shared out by noise leave a picture that knows its error, and may end at one.
#[test]
fn adaptive_sampling_knows_its_error() {
    let place = Place::of(SCENE);
    let run = |arguments: &str| {
        let adaptive = "render scene.yaml -o . --set render.techniques.adaptive=on";
        let (code, said) = abbe(&place, &format!("{adaptive} {arguments}"));
        assert_eq!(code, 0, "{said}");
        place.json("report.json")["scenes"][0]["error"]["rel_rmse"].as_f64().unwrap()
    };
    let error = run("--spp 64");
    assert!((0.001..0.1).contains(&error), "{error}");
    assert!(run("--error 2%") <= 0.02);
}

/// A penumbra under a small lamp: its samples are shared out where an error ends the render, and fewer are enough; an even sky over a
/// ball, whose noisy pixels are the dear ones, is left alone, as is what ends at a number of samples.
#[test]
fn samples_are_shared_out_where_an_error_ends_the_render() {
    let penumbra = "camera: {origin: [0, 3, 5], target: [0, 0, 0], fov_deg: 60}\nimage: {width: 64, height: 64}\n\
                    render: {techniques: {reuse: off, shadow_rays: 1}}\nshapes:\n\
                    - rectangle: {corner: [-9, 0, -9], edge_u: [0, 0, 18], edge_v: [18, 0, 0]}\n\
                    - sphere: {center: [0, 1, 0], radius: 0.4}\n- sphere: {center: [1, 5, 1], radius: 0.5, emission: 30}\n";
    let ball = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 64, height: 64}\n\
                shapes:\n- sphere: {radius: 0.5}\n- sphere: {center: [3, 3, 0], radius: 0.5, emission: 30}\n\
                lights: [constant: {radiance: 1}]\n";
    let run = |scene: &str, arguments: &str| {
        let place = Place::of(scene);
        let (code, said) = abbe(&place, &format!("render scene.yaml -o . {arguments}"));
        assert_eq!(code, 0, "{said}");
        place.json("report.json")["scenes"][0].take()
    };
    let counts = |report: &serde_json::Value| ["least", "most"].map(|end| report["adaptive"][end].as_u64());
    assert_eq!(counts(&run(penumbra, "--spp 64")), [None; 2]);
    let shared = run(penumbra, "--error 0.5%");
    let [least, most] = counts(&shared).map(Option::unwrap);
    assert!(least >= 32 && most >= 4 * least, "{least} {most}");
    let samples = |report: &serde_json::Value| report["samples"].as_f64().unwrap();
    let off = run(penumbra, "--error 0.5% --set render.techniques.adaptive=off");
    assert!(samples(&shared) < 0.7 * samples(&off), "{} {}", samples(&shared), samples(&off));
    assert_eq!(run(penumbra, "--error 0.5% --threads 1")["pixel_hash"], shared["pixel_hash"]);
    let [least, most] = counts(&run(ball, "--error 0.2%")).map(Option::unwrap);
    assert!(least == most && least > 64, "{least} {most}");
}
