//! Mitsuba's scene files on the command line: what is rendered, and what each kind of bad input says.

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// A scene of a lamp, rendered in no time.
const GOOD: &str = "<scene version=\"3.0.0\">
<default name=\"res\" value=\"8\"/>
<integrator type=\"path\"/>
<sensor type=\"perspective\">
  <film type=\"hdrfilm\"><integer name=\"width\" value=\"$res\"/><integer name=\"height\" value=\"4\"/><rfilter type=\"box\"/></film>
  <sampler type=\"independent\"><integer name=\"sample_count\" value=\"4\"/></sampler>
</sensor>
<emitter type=\"constant\"><rgb name=\"radiance\" value=\"1\"/></emitter>
</scene>";

fn abbe(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_abbe")).current_dir(directory).args(arguments).output().unwrap()
}

/// The exit code and the lines of the standard error for a file `s.xml` with `text`.
fn told(text: &str) -> (i32, String) {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("s.xml"), text).unwrap();
    outcome(&abbe(directory.path(), &["plan", "s.xml"]))
}

fn outcome(output: &Output) -> (i32, String) {
    (output.status.code().unwrap(), String::from_utf8(output.stderr.clone()).unwrap())
}

fn error(message: &str) -> String {
    format!("error: {message}\n")
}

#[test]
fn a_scene_is_rendered_with_parameters_from_the_command_line() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("s.xml"), GOOD).unwrap();
    let output = abbe(
        directory.path(),
        &["render", "s.xml", "-o", "out.exr", "--spp", "16", "-D", "res=6", "-q", "--threads", "1"],
    );
    assert_eq!(outcome(&output), (0, String::new()));
    let file = abbe::film::exr::read_exr(&directory.path().join("out.exr")).unwrap();
    let part = &file.parts[0];
    assert_eq!((part.window.width, part.window.height), (6, 4));
    assert!(directory.path().join("out.png").exists());
    // White light of radiance 1 on Mitsuba's film: 1 but for the constants of their D65 (1e-4) and half precision (5e-4).
    for name in ["R", "G", "B"] {
        let mean = part.channel(name).unwrap().iter().sum::<f32>() / 24.0;
        // 8 stratified wavelengths, 16 samples, 24 pixels: about 1e-3.
        assert!((mean - 1.0).abs() < 1e-2, "{name}: {mean}");
    }
}

/// The channels of 16 x 16 pixels of 30 degrees from (0, 0, 5) toward the origin, by an integrator and a further part of the film.
fn channels<const N: usize>(integrator: &str, film: &str, body: &str, names: [&str; N]) -> [Vec<f32>; N] {
    let directory = tempfile::tempdir().unwrap();
    let head = "<sensor type=\"perspective\"><float name=\"fov\" value=\"30\"/>\
                <transform name=\"to_world\"><lookat origin=\"0, 0, 5\" target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform>\
                <film type=\"hdrfilm\"><integer name=\"width\" value=\"16\"/><integer name=\"height\" value=\"16\"/>\
                <string name=\"component_format\" value=\"float32\"/>FILM</film></sensor>"
        .replace("FILM", film);
    let scene = format!("<scene version=\"3.0.0\"><integrator type=\"{integrator}\"/>{head}{body}</scene>");
    std::fs::write(directory.path().join("s.xml"), scene).unwrap();
    let output = abbe(directory.path(), &["render", "s.xml", "-o", "out.exr", "--spp", "64", "-q", "--threads", "1"]);
    assert_eq!(output.status.code(), Some(0), "{}", outcome(&output).1);
    let file = abbe::film::exr::read_exr(&directory.path().join("out.exr")).unwrap();
    names.map(|name| file.parts[0].channel(name).unwrap().to_vec())
}

const BOX: &str = "<rfilter type=\"box\"/>";

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// The mean colour.
fn colour(body: &str) -> [f64; 3] {
    channels("path", BOX, body, ["R", "G", "B"]).each_ref().map(|values| mean(values))
}

/// The lamp ends at the top edge of the picture, where 5 tan(15 deg) lies: the filters of the pixels below it reach
/// beyond, but what is there counts only where the film says so. Mitsuba 3.9.1: 0, and 0.16 of the lamp with a Gaussian
/// of 0.5 pixels in the top row.
#[test]
fn light_from_beyond_the_picture_counts_where_the_film_says_so() {
    let edge = 5.0 * 15f64.to_radians().tan();
    let lamp = format!(
        "<shape type=\"rectangle\"><transform name=\"to_world\"><scale x=\"9\"/><translate y=\"{}\"/></transform>\
         <emitter type=\"area\"/></shape>",
        edge + 1.0
    );
    let [bell, crop] = [
        "",
        "<integer name=\"crop_width\" value=\"4\"/><integer name=\"crop_height\" value=\"3\"/>\
         <integer name=\"crop_offset_x\" value=\"6\"/>",
    ];
    for film in [bell, crop] {
        let [dark] = channels("path", film, &lamp, ["G"]);
        assert!(dark.iter().all(|g| *g == 0.0), "{dark:?}");
        let with = format!("{film}<boolean name=\"sample_border\" value=\"true\"/>");
        let [lit] = channels("path", &with, &lamp, ["G"]);
        // 1 - F(1/2 pixel), one standard deviation, of the Gaussian less its value at four: 0.159 - 0.001; 64 samples.
        let top = mean(&lit[..4]);
        assert!((top - 0.158).abs() < 0.02, "{top}");
    }
}

/// Of what fills the picture: a pane covers by what it mirrors, 2R / (1 + R) of R for 1.5046 over 1.000277 where light falls
/// on it squarely, and 1 % more at the corners; `direct` counts the first thing, be it nothing but a boundary or a hole.
/// Mitsuba 3.9.1 has these alphas.
#[test]
fn coverage_is_what_mitsuba_takes_for_it() {
    let alpha = |integrator: &str, bsdf: &str| {
        let wall = format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"5\"/></transform>{bsdf}</shape>\
             <emitter type=\"point\"><point name=\"position\" x=\"0\" y=\"0\" z=\"4\"/></emitter>"
        );
        let film = format!("{BOX}<string name=\"pixel_format\" value=\"rgba\"/>");
        mean(&channels(integrator, &film, &wall, ["A"])[0])
    };
    let r = ((1.5046f64 - 1.000_277) / (1.5046 + 1.000_277)).powi(2);
    let pane = 2.0 * r / (1.0 + r);
    for integrator in ["path", "volpath"] {
        // 16384 samples: a standard error of 2.1e-3 at random, less when stratified.
        let found = alpha(integrator, "<bsdf type=\"thindielectric\"/>");
        assert!((found - pane).abs() < 6e-3, "{integrator}: {found} for {pane}");
        assert_eq!(alpha(integrator, "<bsdf type=\"null\"/>"), 0.0);
    }
    for open in [
        "<bsdf type=\"null\"/>",
        "<bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf>",
        "<bsdf type=\"thindielectric\"/>",
    ] {
        assert_eq!(alpha("direct", open), 1.0, "{open}");
    }
}

/// Mitsuba 3.9.1's `path` sees no media: the bits are those of the same file without.
#[test]
fn media_are_nothing_to_an_integrator_without_them() {
    let scene = |media: &str| {
        let [fog, inside] = if media.is_empty() { ["", ""] } else { [media, "<ref name=\"interior\" id=\"fog\"/>"] };
        let ball =
            format!("{fog}<shape type=\"sphere\"><bsdf type=\"null\"/>{inside}</shape><emitter type=\"constant\"/>");
        channels("path", BOX, &format!("{ball}<shape type=\"disk\"/>"), ["R", "G", "B"])
    };
    let fog = "<medium type=\"homogeneous\" id=\"fog\"><float name=\"sigma_t\" value=\"2\"/></medium>";
    assert!(scene(fog) == scene(""), "the pictures differ");
}

/// What a response counts beyond the band is not simulated: Mitsuba 3.9.1 gives 600 nm of an even light for this band.
#[test]
fn responses_end_with_the_band() {
    let film = |response: &str| {
        let spectrum = format!("<film type=\"specfilm\"><spectrum name=\"a\" value=\"{response}\"/>");
        told(&GOOD.replace("<film type=\"hdrfilm\">", &spectrum))
    };
    let (code, message) = film("300:1, 900:1");
    assert_eq!(code, 2);
    assert!(message.contains("expected a response that is 0 beyond 360 and 830 nm"), "{message}");
    assert!(message.contains("s.xml:5:") && message.ends_with("found more between 300 and 900 nm\n"), "{message}");
    // It falls from 500 to 900 nm.
    assert_eq!(film("300:0, 360:0, 500:1, 900:0").0, 2);
    assert_eq!(film("360:1, 830:1"), (0, String::new()));
    assert_eq!(film("300:0, 360:0, 500:1, 830:0, 900:0"), (0, String::new()));
}

/// Parameters that say nothing about the picture, an up that is empty, and spectra in their third form.
#[test]
fn words_that_mitsuba_reads_are_read() {
    let with = |text: &str| told(&GOOD.replace("</scene>", &format!("{text}</scene>")));
    let words = [
        "<boolean name=\"embree_use_robust_intersections\" value=\"true\"/><integer name=\"kd_max_depth\" value=\"9\"/>",
        "<shape type=\"sphere\"><transform name=\"to_world\"><lookat origin=\"0,0,1\" target=\"0,0,0\" up=\"\"/></transform></shape>",
        "<bsdf type=\"diffuse\" id=\"a\"><spectrum type=\"irregular\" name=\"reflectance\">\
         <spectrum name=\"value\" value=\"400:0.1, 500:0.6, 700:0.3\"/></spectrum></bsdf>",
        "<bsdf type=\"diffuse\" id=\"a\"><spectrum type=\"regular\" name=\"reflectance\">\
         <spectrum name=\"value\" value=\"400:0.1, 500:0.6, 600:0.3\"/></spectrum></bsdf>",
    ];
    for text in words {
        assert_eq!(with(text), (0, String::new()), "{text}");
    }
    let (code, message) = with(
        "<bsdf type=\"diffuse\" id=\"a\"><spectrum type=\"irregular\" name=\"reflectance\">\
                                <float name=\"value\" value=\"1\"/></spectrum></bsdf>",
    );
    assert!(code == 2 && message.contains("value: expected wavelengths and values, found a float"), "{message}");
}

/// Mitsuba 3.9.1, `scalar_spectral`, 4096 samples a pixel. 16384 paths of stratified wavelengths are within 1e-3 here.
#[test]
fn colours_of_metals_are_as_in_mitsuba() {
    let metal = "<emitter type=\"constant\"/><shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"5\"/></transform>\
                 <bsdf type=\"conductor\"><rgb name=\"eta\" value=\"0.2, 0.3, 0.9\"/><rgb name=\"k\" value=\"0.9, 0.2, 0.1\"/></bsdf></shape>";
    let found = colour(metal);
    for (found, expected) in found.iter().zip([0.6415, 0.3086, -0.0259]) {
        assert!((found - expected).abs() < 3e-3, "{found} for {expected}");
    }
}

#[test]
fn a_parameter_that_the_scene_does_not_use_is_an_error() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("s.xml"), GOOD).unwrap();
    assert_eq!(
        outcome(&abbe(directory.path(), &["plan", "s.xml", "-D", "ress=6"])),
        (2, error("-D ress=6: expected a parameter that s.xml uses, found none named \"ress\"; did you mean \"res\"?"))
    );
    std::fs::write(directory.path().join("s.yaml"), "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}")
        .unwrap();
    assert_eq!(
        outcome(&abbe(directory.path(), &["plan", "s.yaml", "-D", "res=6"])),
        (2, error("-D res=6: expected a Mitsuba scene (.xml), found s.yaml; --set changes fields of YAML"))
    );
}

#[test]
fn truncated_text_is_one_error() {
    assert_eq!(
        told(GOOD.rsplit_once("</scene>").unwrap().0),
        (2, error("s.xml:1:1: expected </scene>, found the end of the text"))
    );
    assert_eq!(told(""), (2, error("s.xml:1:1: expected the element <scene>, found none")));
}

#[test]
fn unknown_plugins_and_parameters_are_one_error() {
    let with = |text: &str| told(&GOOD.replace("</scene>", &format!("{text}</scene>")));
    let (code, message) = with("<bsdf type=\"difuse\" id=\"a\"/>");
    assert!(code == 2 && message.starts_with("error: s.xml:9:13: expected a bsdf that Abbe has ("), "{message}");
    assert!(
        message.ends_with("found \"difuse\"; did you mean \"diffuse\"?\n") && message.lines().count() == 1,
        "{message}"
    );
    let (code, message) = with("<bsdf type=\"diffuse\" id=\"a\"><float name=\"reflectence\" value=\"1\"/></bsdf>");
    assert_eq!(code, 2);
    assert_eq!(
        message,
        error(
            "s.xml:9:29: bsdf \"diffuse\": expected parameters among reflectance, found \"reflectence\"; did you mean \
             \"reflectance\"?"
        )
    );
    assert_eq!(
        with("<bsdf type=\"diffuse\" id=\"a\"><boolean name=\"reflectance\" value=\"true\"/></bsdf>"),
        (
            2,
            error(
                "s.xml:9:29: bsdf \"diffuse\": reflectance: expected a spectrum, a colour or a float, found a boolean"
            )
        )
    );
    assert_eq!(
        with("<bsdf type=\"diffuse\" id=\"a\"><float name=\"reflectance\" value=\"many\"/></bsdf>"),
        (2, error("s.xml:9:62: expected a finite number, found \"many\""))
    );
}

#[test]
fn ids_are_unique_and_references_lead_somewhere() {
    let with = |text: &str| told(&GOOD.replace("</scene>", &format!("{text}</scene>")));
    assert_eq!(
        with("<bsdf type=\"diffuse\" id=\"a\"/><bsdf type=\"null\" id=\"a\"/>"),
        (2, error("s.xml:9:30: expected each id once, found \"a\" again; it is first at s.xml:9:1"))
    );
    assert_eq!(
        with("<shape type=\"sphere\"><ref id=\"a\"/></shape>"),
        (2, error("s.xml:9:22: expected the id of an object, found \"a\""))
    );
}

#[test]
fn missing_files_are_input_errors() {
    let with = |text: &str| told(&GOOD.replace("</scene>", &format!("{text}</scene>")));
    let (code, message) = with("<shape type=\"ply\"><string name=\"filename\" value=\"none.ply\"/></shape>");
    assert!(code == 3 && message.starts_with("error: none.ply: ") && message.contains("s.xml:9:19"), "{message}");
    let (code, message) = with("<include filename=\"none.xml\"/>");
    assert_eq!(
        (code, message.as_str()),
        (3, "error: none.xml: cannot be read: No such file or directory (os error 2); it is included at s.xml:9:1\n")
    );
    let directory = tempfile::tempdir().unwrap();
    let (code, message) = outcome(&abbe(directory.path(), &["plan", "none.xml"]));
    assert_eq!(
        (code, message.as_str()),
        (3, "error: none.xml: cannot be read: No such file or directory (os error 2)\n")
    );
}

#[test]
fn includes_are_read_in_place_and_do_not_run_in_circles() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    std::fs::create_dir(directory.path().join("parts")).unwrap();
    write("s.xml", &GOOD.replace("</scene>", "<include filename=\"parts/a.xml\"/></scene>"));
    write("parts/a.xml", "<scene version=\"3.0.0\"><include filename=\"b.xml\"/><ref id=\"grey\"/></scene>");
    write("parts/b.xml", "<bsdf version=\"3.0.0\" type=\"diffuse\" id=\"grey\"/>");
    assert_eq!(outcome(&abbe(directory.path(), &["plan", "s.xml"])), (0, String::new()));
    write("parts/b.xml", "<scene version=\"3.0.0\">\n<include filename=\"a.xml\"/></scene>");
    assert_eq!(
        outcome(&abbe(directory.path(), &["plan", "s.xml"])),
        (2, error("parts/b.xml:2:1: expected a file that does not include itself, found parts/a.xml"))
    );
}

/// A scene, s.xml, that includes 0.xml, which includes 1.xml so many `times`, and so on `deep`; the last is as it is given.
fn includes(deep: usize, times: usize, last: &str) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    write("s.xml", &GOOD.replace("</scene>", "<include filename=\"0.xml\"/></scene>"));
    for i in 0..deep {
        let all = format!("<include filename=\"{}.xml\"/>", i + 1).repeat(times);
        write(&format!("{i}.xml"), &format!("<scene version=\"3.0.0\">{all}</scene>"));
    }
    write(&format!("{deep}.xml"), &format!("<scene version=\"3.0.0\">{last}</scene>"));
    directory
}

/// Files that include each other twice would be read 2^15 times.
#[test]
fn includes_do_not_multiply_without_end() {
    let directory = includes(20, 2, "");
    let begin = Instant::now();
    let (code, message) = outcome(&abbe(directory.path(), &["plan", "s.xml"]));
    assert_eq!(
        (code, message),
        (2, error("14.xml:1:24: expected at most 15 files that include each other, found more"))
    );
    assert!(begin.elapsed() < Duration::from_secs(20));
}

/// A file of 1 MiB, which is included four times by one that is included four times, and so on: 4⁸ MiB are 64 GiB.
#[test]
fn what_is_included_again_and_again_is_counted_each_time() {
    let directory = includes(8, 4, &format!("<!--{}-->", "x".repeat(1 << 20)));
    let (code, message) = outcome(&abbe(directory.path(), &["plan", "s.xml"]));
    assert_eq!(code, 2, "{message}");
    assert!(message.starts_with("error: 7.xml:1:"), "{message}");
    assert!(message.ends_with(": expected at most 256 MiB of text in all files, found more\n"), "{message}");
}

#[test]
fn bombs_are_one_error_and_no_wait() {
    let begin = Instant::now();
    let entities = "<!DOCTYPE scene [<!ENTITY a \"aaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;\">]>\n<scene version=\"3.0.0\" id=\"&b;\"/>";
    assert_eq!(
        told(entities),
        (
            2,
            error(
                "s.xml:1:11: expected no document type with declarations, found <!DOCTYPE … […]>: entities are not expanded"
            )
        )
    );
    let nested = format!("<scene version=\"3.0.0\">{}", "<shape type=\"sphere\">".repeat(1_000_000));
    let (code, message) = told(&nested);
    assert_eq!(code, 2);
    assert_eq!(message, error("s.xml:1:1347: expected at most 64 levels of nesting, found more"));
    assert!(begin.elapsed() < Duration::from_secs(20));
}
