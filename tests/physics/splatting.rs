//! Samples that count for all pixels whose filters hold them change the noise, never the mean.

use super::common::{Bench, bench_with, grey_png, room};
use super::reuse::{assert_layers_add_up, assert_same_light, over_seeds};

const LAMP: &str = "- rectangle: {corner: [-0.3, 0.9, -0.3], edge_u: [0.6, 0, 0], edge_v: [0, 0, 0.6], emission: 3}\n";

/// A lamp among `shapes` under `filter`, seen from within a room, in pixels that are no whole number of cells.
fn lit(splatting: &str, (filter, samples, techniques): (&str, u32, &str), rest: &str, shapes: &str) -> Bench {
    let yaml = format!(
        "camera: {{origin: [0, 0, 0.95], target: [0, -0.1, -1], fov_deg: 80}}\n\
         image: {{width: 20, height: 13, filter: {filter}}}\n\
         textures: {{map: {{image: {{file: map.png, filter: nearest}}}}}}\nmaterials: {{chalk: {{diffuse: {{reflectance: 0.7}}}}}}\n\
         render: {{samples: {samples}, techniques: {{splatting: {splatting}, light_tracing: off, {techniques}}}}}\n\
         {rest}{shapes}{LAMP}"
    );
    let map = grey_png(16, 8, |x, y| if (x + y) % 2 == 0 { 20 } else { 230 });
    bench_with(&yaml, &[("map.png", &map)])
}

/// Balls, one of them checked, before walls: edges of everything.
fn things() -> String {
    room("material: {diffuse: {reflectance: 0.7}}")
        + "- sphere: {center: [-0.4, -0.6, -0.3], radius: 0.4, material: {diffuse: {reflectance: {texture: map}}}, name: ball}\n\
           - sphere: {center: [0.5, -0.6, -0.3], radius: 0.4, material: {mirror: {}}}\n"
}

const GAUSSIAN: &str = "{gaussian: {stddev: 0.5}}";

/// With one sample in each replicate as with four what weights lack is made up for without bias.
#[test]
fn pixels_that_samples_are_dealt_to_have_the_light_of_those_with_their_own() {
    let smoke = "media: {smoke: {homogeneous: {scattering: 0.9, absorption: 0.1}}}\nshapes:\n\
                 - sphere: {center: [0, 0, -0.2], radius: 0.6, material: {boundary: {}}, inside: smoke}\n";
    let border = "{gaussian: {stddev: 0.7}}, sample_border: false";
    let plain = "reuse: off, shadow_rays: 1";
    let cases = [
        ("four samples", GAUSSIAN, 4, plain, ""),
        ("sixteen", GAUSSIAN, 16, plain, ""),
        ("a tent", "{tent: {radius: 1.25}}", 4, plain, ""),
        ("a spline", "{mitchell: {b: 1, c: 0}}", 4, plain, ""),
        ("shared paths", GAUSSIAN, 4, "reuse: on, shadow_rays: 2", ""),
        ("as noise asks for", GAUSSIAN, 32, "reuse: off, adaptive: on", ""),
        ("a picture that ends", border, 4, plain, ""),
        ("smoke", GAUSSIAN, 4, plain, smoke),
    ];
    for (name, filter, samples, techniques, rest) in cases {
        let [apart, dealt] = [("off", 0), ("on", 100)].map(|(splatting, first)| {
            let things = if rest.is_empty() { things() } else { things().replace("shapes:\n", "") };
            let bench = lit(splatting, (filter, samples, techniques), rest, &things);
            assert_eq!(bench.prepared.plan.splatting, splatting == "on", "{name}");
            over_seeds(bench, first..first + 60)
        });
        let ratio = assert_same_light(name, &apart, &dealt);
        assert!(ratio < 0.7, "{name}: {ratio}");
    }
}

/// Light that is alike everywhere is what it is in each pixel, whatever the weights; so is coverage. Sums of f32 in a cell are off by
/// 64 roundings at the most.
#[test]
fn even_light_has_no_noise() {
    for (samples, rest) in [(1, ""), (2, ""), (4, ""), (9, ""), (16, "adaptive: on, ")] {
        let yaml = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
             image: {{width: 20, height: 13, overscan: 3, filter: {GAUSSIAN}}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             integrator: {{path: {{opaque_sky: true}}}}\n\
             render: {{samples: {samples}, wavelengths: uniform, techniques: {{{rest}splatting: on}}}}\n"
        );
        let picture = bench_with(&yaml, &[]).grey().picture();
        assert!(picture.alpha.iter().all(|alpha| *alpha == 1.0), "{samples}");
        let mean = picture.y[0];
        let off = picture.y.iter().map(|y| (y / mean - 1.0).abs()).fold(0.0, f64::max);
        assert!(off < 64.0 * f64::from(f32::EPSILON), "{samples}: {off}");
    }
}

/// So it is where samples count against their pixel, but where the weights of three replicates come to about nothing, as they do in no
/// pixel of these pictures.
#[test]
fn even_light_has_no_noise_under_lobes_below_zero() {
    for (filter, samples) in [("mitchell", 16), ("catmull_rom", 16), ("{lanczos: {radius: 3}}", 256)] {
        let yaml = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
             image: {{width: 20, height: 13, filter: {filter}}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             integrator: {{path: {{opaque_sky: true}}}}\nrender: {{samples: {samples}, wavelengths: uniform}}\n\
             layers: [emission]\n"
        );
        let picture = bench_with(&yaml, &[]).grey().picture();
        assert!(picture.alpha.iter().all(|alpha| (alpha - 1.0).abs() < 1e-6), "{filter}: {:?}", picture.alpha);
        let mean = picture.y[0];
        let off = picture.y.iter().map(|y| (y / mean - 1.0).abs()).fold(0.0, f64::max);
        assert!(off < 64.0 * f64::from(f32::EPSILON), "{filter}: {off}");
    }
}

/// What is made up for has no bias with one sample in each replicate, where two of the three others may count against the pixel.
/// Lanczos is told to a hundredth with eight in each.
#[test]
fn lobes_below_zero_have_the_light_of_many_samples() {
    for (filter, least) in [("mitchell", 4), ("{lanczos: {radius: 3}}", 32)] {
        let bench = |samples| lit("off", (filter, samples, "reuse: off, shadow_rays: 1"), "", &things());
        let [few, many] = [(least, 0), (64, 100)].map(|(samples, first)| over_seeds(bench(samples), first..first + 60));
        assert_same_light(filter, &few, &many);
    }
}

/// What the replicates tell of the variance of a pixel is that over seeds. Of 260 pixels and 24 seeds the former has 3 degrees of
/// freedom each and the latter 23 in all, so that their ratio is 23/21 in the mean; pixels have their errors in common with some 3,
/// (∫h)²/∫h² of the Gaussian: four standard errors are 4 √(3.1 / 260 · (2/72 + 2/23)) = 15 %.
#[test]
fn errors_of_weighed_samples_are_those_that_come() {
    let lanczos = "{lanczos: {radius: 3}}";
    for (splatting, filter, samples) in [("on", GAUSSIAN, 16), ("off", "mitchell", 64), ("off", lanczos, 64)] {
        let bench = || lit(splatting, (filter, samples, "reuse: off, shadow_rays: 1"), "", &things());
        let (pixels, _) = over_seeds(bench(), 0..24);
        let mut told = vec![0.0; pixels.len()];
        for seed in 0..24 {
            let mut bench = bench();
            bench.prepared.description.render.seed = seed;
            told.iter_mut().zip(&bench.picture().error).for_each(|(sum, error)| *sum += error * error / 24.0);
        }
        let ratios = told.iter().zip(&pixels).map(|(told, came)| told / came.variance());
        let ratio = ratios.sum::<f64>() / pixels.len() as f64 * 21.0 / 23.0;
        assert!((ratio - 1.0).abs() < 0.15, "{filter}: {ratio} of what came");
    }
}

/// Layers of light change no bit of the picture, and add up to it: each sum of them is rounded to an f32 once a sample, and
/// a pixel has 16.
#[test]
fn layers_of_dealt_light_add_up_to_the_picture_that_they_leave_as_it_is() {
    for (splatting, filter, techniques) in
        [("on", GAUSSIAN, "reuse: off"), ("on", GAUSSIAN, "reuse: on"), ("off", "mitchell", "reuse: off")]
    {
        let with = |rest: &str| lit(splatting, (filter, 16, techniques), rest, &things());
        assert_layers_add_up(&with(""), &with("layers: [emission, direct, indirect, caustic]\n"));
    }
}

/// A box ends where its pixel does; lobes below zero would have weights without bounds, and mattes count whole samples.
#[test]
fn samples_are_dealt_where_they_can_be() {
    let is_on =
        |filter: &str, rest: &str| lit("on", (filter, 4, "reuse: off"), rest, &things()).prepared.plan.splatting;
    assert!(is_on(GAUSSIAN, ""));
    for (filter, rest) in [
        ("box", ""),
        ("{tent: {radius: 0.5}}", ""),
        ("mitchell", ""),
        ("{lanczos: {radius: 3}}", ""),
        (GAUSSIAN, "layers: [crypto_object]\n"),
        (GAUSSIAN, "integrator: {whitted: {grid: 2}}\n"),
    ] {
        assert!(!is_on(filter, rest), "{filter}, {rest}");
    }
}
