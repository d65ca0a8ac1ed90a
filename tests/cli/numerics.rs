//! What is counted of the arithmetic: where it had to be robust, and samples that are no light.

use super::batch;
use crate::common::place::Place;
use serde_json::Value;

/// A ball of radius 1, 10⁵ away, in the middle of 4 × 4 pixels. In single precision b² and 4ac of its quadratic are
/// 4·10¹⁰ with steps of 4096, and they differ by at most 4: rounding decides whether it is found. Asked for or not, the
/// picture is the same.
#[test]
fn what_robust_arithmetic_was_needed_for_is_counted() {
    let scene = "camera: {origin: [3.0e+4, 4.0e+4, 8.6602540378e+4], target: [0, 0, 0], fov_deg: 0.0015}\n\
                 image: {width: 4, height: 4}\nrender: {samples: 64}\nlights: [{constant: {radiance: 1}}]\n\
                 shapes: [{sphere: {radius: 1}}]\n";
    let place = Place::with(&[("s.yaml", scene)]);
    let report = |arguments: &[&str]| -> Value {
        let ran = place.run(&[&["render", "s.yaml", "-o", "s.exr", "--report", "r.json"], arguments].concat());
        assert_eq!(ran.code, 0, "{}", ran.err);
        assert_eq!(ran.out.contains("textbook f32 misses"), arguments.contains(&"--check-numerics"), "{}", ran.out);
        let report: Value = serde_json::from_slice(&std::fs::read(place.path("r.json")).unwrap()).unwrap();
        report["scenes"][0].clone()
    };
    let off = report(&[]);
    let names = || {
        let bytes = std::fs::read(place.path("s.exr")).unwrap();
        let names = ["numerics.surfaces", "numerics.robust", "numerics.selfHits", "numerics.nan"];
        names.map(|name| bytes.windows(name.len()).any(|w| w == name.as_bytes()))
    };
    assert_eq!((names(), &off["numerics"]), ([false; 4], &Value::Null));
    let on = report(&["--check-numerics"]);
    assert_eq!((names(), &on["pixel_hash"]), ([true; 4], &off["pixel_hash"]));
    let count = |name: &str| on["numerics"][name].as_u64().unwrap();
    assert!(count("surfaces") > 400 && (10..400).contains(&count("robust")), "{on}");
    assert!(count("rays") > 400 && count("self_hits") <= count("rays"), "{on}");

    let taken =
        place.run(&["render", "s.yaml", "--check-numerics", "--set", "layers=[{name: numerics, surface: depth}]"]);
    assert!(taken.code == 2 && taken.err.contains("give yours another"), "{}", taken.err);
}

/// Three lights whose sum is beyond what f32 holds: samples are dropped, counted by cause, and the exit code says so. The
/// picture is written all the same, and every pixel of it is finite.
#[test]
fn invalid_samples_are_counted_and_end_with_code_4() {
    let place = batch();
    let lights = |radiance: &str| {
        let light = format!("{{constant: {{radiance: {radiance}}}}}");
        format!("lights=[{light}, {light}, {light}]")
    };
    let hot = |radiance: &str, more: &[&str]| {
        let set = lights(radiance);
        let ran = place.run(&[&["render", "scenes/good.yaml", "-q", "-o", "hot", "--set", &set], more].concat());
        (ran, abbe::film::exr::read_exr(&place.path("hot/good.exr")).unwrap())
    };
    let (ran, file) = hot("3e38", &[]);
    assert_eq!(ran.code, 4);
    assert!(ran.err.contains("64 of 64 samples were invalid") && ran.err.contains("64 infinite"), "{}", ran.err);
    assert!(file.parts[0].channels.iter().all(|(_, c)| c.iter().all(|x| x.is_finite())));
    assert_eq!(file.parts[0].text("abbe/invalidSamples"), Some("64"));
    assert_eq!(file.parts[0].text("abbe/invalidByCause"), Some("0 64 0 0"));
    // So it is when the picture is found there, which nothing changes.
    let written = std::fs::metadata(place.path("hot/good.exr")).unwrap().modified().unwrap();
    for keep in ["--resume", "--skip-existing"] {
        let set = lights("3e38");
        let again = place.run(&["render", "scenes/good.yaml", "-q", "-o", "hot", "--set", &set, keep]);
        assert_eq!((again.code, again.err.lines().last()), (4, ran.err.lines().last()), "{keep}");
        let report: serde_json::Value =
            serde_json::from_slice(&std::fs::read(place.path("hot/report.json")).unwrap()).unwrap();
        assert_eq!(report["scenes"][0]["invalid"]["infinite"], 64, "{keep}");
        assert_eq!(std::fs::metadata(place.path("hot/good.exr")).unwrap().modified().unwrap(), written, "{keep}");
    }
    // What f32 holds the film holds.
    let (ran, file) = hot("1e30", &["--check-numerics"]);
    assert_eq!((ran.code, file.parts[0].text("abbe/invalidSamples")), (0, Some("0")), "{}", ran.err);
    let green = file.parts[0].channel("G").unwrap();
    assert!(green.iter().all(|x| (1e28..1e31).contains(x)), "{green:?}");
    let overflow = file.parts[0].channel("numerics.overflow").unwrap();
    assert!(overflow.iter().all(|n| *n == 0.0), "{overflow:?}");
}
