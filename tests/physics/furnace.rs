//! Energy: in even light nothing may show but what it keeps for itself.

use super::common::{Bench, assert_close, bench, bench_with, mean, ray, room, v};
use super::in_even_light;
use abbe::optics::fresnel::{self, Model};
use abbe::scene::material::Kind;
use abbe::scene::texture::TexturePoint;
use abbe::spectrum::Lanes;
use glam::DVec3;
use std::f64::consts::PI;

fn inside(text: &str) -> Bench {
    bench_with(
        &format!(
            "camera: {{origin: [0.1, 0.2, 0.3], target: [0, 0, -1], fov_deg: 100}}\nimage: {{width: 16, height: 16}}\n{text}"
        ),
        &[],
    )
}

/// A convex body in even light sees the same light everywhere: L = ρ/π ∫ cos = ρ. Light and material
/// are sampled with the same density here, so every sample is exact.
#[test]
fn a_diffuse_sphere_in_even_light_shows_its_albedo_in_every_pixel() {
    for albedo in [0.0, 0.18, 0.5, 1.0] {
        let sphere = format!("[{{sphere: {{radius: 1, material: {{diffuse: {{reflectance: {albedo}}}}}}}}}]");
        in_even_light(&sphere).grey().picture().assert_all(albedo, 2e-6);
    }
}

/// In a closed room whose walls shine with 1 and reflect ½, L = 1 + ½ L everywhere: L = 2.
#[test]
fn furnace_radiance_is_one_over_one_minus_albedo() {
    let text = room("emission: 1, material: {diffuse: {reflectance: 0.5}}") + "render: {samples: 64}\n";
    inside(&text).grey().picture().mean().assert_is(2.0, 3e-3);
}

/// Without a light, no walls of whatever albedo send light.
#[test]
fn a_dark_room_is_black() {
    inside(&room("material: {diffuse: {reflectance: 1}}")).grey().picture().assert_all(0.0, 0.0);
}

/// White bodies in even light are invisible, however much light they exchange.
#[test]
fn a_heap_of_white_spheres_in_even_light_is_invisible() {
    let mut shapes = String::from("[");
    for (x, y, z) in [(0, 0, 0), (1, 1, 0), (-1, 1, 0), (1, -1, 0), (-1, -1, 0), (0, 0, -1), (0, 1, -1)] {
        shapes += &format!(
            "{{sphere: {{center: [{}, {}, {}], radius: 0.5, material: {{diffuse: {{reflectance: 1}}}}}}}},",
            0.5 * f64::from(x),
            0.5 * f64::from(y),
            0.5 * f64::from(z)
        );
    }
    let heap = in_even_light(&(shapes + "]")).grey();
    let picture = heap.picture();
    picture.mean().assert_is(1.0, 1e-2);
    // At the joint of four spheres a path meets many of them: still 1.
    heap.estimate(&ray(v(0.25, 0.25, 5.0), v(0.25, 0.25, 0.0)), 8192).assert_is(1.0, 1e-2);
}

/// The integrating sphere: light from the centre arrives as I/R² everywhere, and what the wall sends
/// on reaches every part of it alike: L = ρ/π · I/R² · (1 + ρ + ρ² + …).
#[test]
fn an_integrating_sphere_multiplies_its_lamp_by_one_over_one_minus_albedo() {
    let (albedo, intensity, radius) = (0.8, 3.0, 2.0);
    let sphere = bench(&format!(
        "shapes: [{{sphere: {{radius: {radius}, material: {{diffuse: {{reflectance: {albedo}}}}}}}}}]\n\
         lights: [{{point: {{position: [0, 0, 0], intensity: {intensity}}}}}]\n"
    ));
    let expected = albedo * intensity / (PI * radius * radius * (1.0 - albedo));
    let found = sphere.estimate(&ray(v(0.3, 0.1, -0.2), v(1.0, 1.0, 0.5)), 4096);
    found.assert_is(expected, 1e-2);
}

/// What of even light the material at the origin (normal +z) sends to a viewer at `cos`, from above and
/// from below the surface: ∫ f |cos θ| dω, midpoints in azimuth and in x with cos θ = x³, which thins the
/// steps toward grazing. The integrand is smooth at the roughness used here (α ≥ 0.3), and doubling the
/// grid moves the value by less than 1e-5.
fn albedo_by_quadrature(scene: &Bench, cos: f64) -> [f64; 2] {
    let material = &scene.prepared.scene.materials[0];
    let bsdf = material.bsdf(&TexturePoint::default(), Lanes::splat(550.0), false);
    let wo = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    const STEPS: u32 = 400;
    let mut sums = [0.0; 2];
    for i in 0..STEPS {
        let x = (f64::from(i) + 0.5) / f64::from(STEPS);
        let (z, dz) = (x * x * x, 3.0 * x * x / f64::from(STEPS));
        let sin = (1.0 - z * z).sqrt();
        for j in 0..STEPS {
            let phi = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(STEPS);
            for (sum, z) in sums.iter_mut().zip([z, -z]) {
                let wi = DVec3::new(sin * phi.cos(), sin * phi.sin(), z);
                *sum += mean(bsdf.eval(wo, wi).f) * z.abs() * dz * 2.0 * PI / f64::from(STEPS);
            }
        }
    }
    sums
}

/// A disc at the origin facing +z, without end for what looks at its middle.
fn disc(material: &str) -> Bench {
    bench(&format!(
        "materials: {{m: {material}}}\nshapes: [{{disk: {{normal: [0, 0, 1], radius: 1, material: m}}}}]\n\
         lights: [{{constant: {{radiance: 1}}}}]\nrender: {{wavelengths: uniform}}\n"
    ))
}

fn toward_the_middle(cos: f64) -> abbe::math::Ray {
    ray(5.0 * v((1.0 - cos * cos).sqrt(), 0.0, cos), v(0.0, 0.0, 0.0))
}

/// Facets lose the light that meets a second facet (Walter et al. 2007 follow one bounce), so a rough
/// surface sends on at most what it gets; radiance from below counts η² as much. In even light it is what
/// quadrature of its f says.
#[test]
fn rough_surfaces_in_even_light_lose_what_quadrature_says_and_gain_nothing() {
    let materials = [
        ("{conductor: {eta: 0, k: 1, roughness: 0.3}}", 1.0),
        ("{conductor: {eta: 0.2, k: 3.5, roughness: 0.6, distribution: beckmann}}", 1.0),
        ("{dielectric: {ior: 1.5, roughness: 0.3}}", 1.5),
        ("{dielectric: {ior: 1.5, exterior_ior: 2.0, roughness: 0.4}}", 0.75),
        ("{plastic: {reflectance: 0.7, roughness: 0.4}}", 1.0),
    ];
    for (material, eta) in materials {
        let scene = disc(material);
        for cos in [0.95, 0.3] {
            let [above, below] = albedo_by_quadrature(&scene, cos);
            let sent_on = above + below * eta * eta;
            assert!((0.4..=1.0 + 1e-5).contains(&sent_on), "{material} at {cos}: {sent_on}");
            let expected = above + below;
            let found = scene.estimate(&toward_the_middle(cos), 2048);
            // The quadrature's own error stands beside the noise.
            let off = (found.mean - expected).abs();
            assert!(off <= 4.0 * found.error + 2e-4, "{material} at {cos}: expected {expected}, found {found:?}");
            assert!(found.error < 0.01, "{found:?}");
        }
    }
}

/// A metal that absorbs nothing (η = 0: R = 1 at every angle) is a perfect mirror, smooth.
#[test]
fn a_lossless_mirror_in_even_light_is_invisible() {
    for material in ["{conductor: {eta: 0, k: 1}}", "{mirror: {reflectance: 1}}"] {
        let sphere = format!("[{{sphere: {{radius: 1, material: {material}}}}}]");
        in_even_light(&sphere).grey().picture().assert_all(1.0, 2e-5);
    }
}

/// Under a smooth coat, light enters with T(θ), bounces between base and coat, and comes out: in even
/// light, by reciprocity of the coat's diffuse transmittance, E = R + T ρ (linear) and
/// E = R + T ρ (1 − F) / (1 − ρ F) (nonlinear), F the coat's diffuse reflectance from inside.
#[test]
fn plastic_in_even_light_reflects_coat_and_base() {
    for (nonlinear, albedo) in [(false, 1.0), (false, 0.5), (true, 1.0), (true, 0.5)] {
        let scene = disc(&format!("{{plastic: {{reflectance: {albedo}, ior: 1.5, nonlinear: {nonlinear}}}}}"));
        let internal = match &scene.prepared.scene.materials[0].kind {
            Kind::Plastic { coat, .. } => coat.tables.internal(1.5),
            other => panic!("{other:?}"),
        };
        // The published diffuse reflectance from inside glass of 1.5: 0.5964 (Egan and Hilgeman 1973).
        assert_close(internal, 0.5964, 2e-4);
        for cos in [1.0, 0.4, 0.1] {
            let split = fresnel::dielectric(Model::Exact, cos, 1.5);
            let base = if nonlinear { albedo * (1.0 - internal) / (1.0 - albedo * internal) } else { albedo };
            let expected = split.reflected + split.transmitted * base;
            let found = scene.estimate(&toward_the_middle(cos), 8192);
            let off = (found.mean - expected).abs();
            // `internal` is a midpoint sum good to 1e-5 or so.
            assert!(off <= 4.0 * found.error + 5e-5, "{nonlinear} {albedo} {cos}: {expected}, found {found:?}");
        }
    }
}

/// An image of one colour as environment is the constant light of that radiance; the map is read as
/// Rec. 709, so white is D65 and only luminance is told.
#[test]
fn an_even_environment_map_is_a_constant_light() {
    let mut file = Vec::new();
    let pixels = vec![image::Rgb([1.0f32; 3]); 16 * 8];
    image::codecs::hdr::HdrEncoder::new(&mut file).encode(&pixels, 16, 8).unwrap();
    let text = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 10}\nimage: {width: 8, height: 8}\n\
                shapes: [{sphere: {radius: 1, material: {diffuse: {reflectance: 0.5}}}}]\n\
                lights: [{environment: {file: even.hdr}}]\nrender: {samples: 64}\n";
    let sphere = bench_with(text, &[("even.hdr", &file)]);
    let found = sphere.luminance(&ray(v(0.3, 0.1, 5.0), v(0.3, 0.1, 0.0)), 8192);
    found.assert_is(0.5, 5e-3);
    let background = sphere.luminance(&ray(v(0.0, 0.0, 5.0), v(0.3, 8.0, 1.0)), 2048);
    background.assert_is(1.0, 5e-3);
}

/// Lambert's law integrates to its albedo: that the quadrature integrates at all is not left to chance.
#[test]
fn the_quadrature_of_this_file_integrates_a_known_lobe() {
    let [above, below] = albedo_by_quadrature(&disc("{diffuse: {reflectance: 0.7}}"), 0.5);
    assert_close(above, 0.7, 1e-5);
    assert_eq!(below, 0.0);
}

/// The shortest and the longest of the wavelengths: each lane's light there over what it should be.
fn at_both_ends(scene: Bench, cos: f64, expected: impl Fn(f64) -> f64) {
    let scene = scene.grey();
    for longest in [false, true] {
        let lane = |nm: [f32; 8]| {
            let by = |a: &usize, b: &usize| nm[*a].total_cmp(&nm[*b]);
            if longest { (0..8).max_by(by).unwrap() } else { (0..8).min_by(by).unwrap() }
        };
        let over = scene.estimate_of(&toward_the_middle(cos), 16384, |light, wavelengths| {
            let nm = wavelengths.nm.to_array();
            let k = lane(nm);
            f64::from(light.radiance.to_array()[k]) / expected(f64::from(nm[k]))
        });
        // A coat's tables are linear between indices and good to 1e-4.
        assert!((over.mean - 1.0).abs() <= 4.0 * over.error + 2e-4, "{cos} {longest}: {over:?}");
        assert!(over.error < 0.02, "{over:?}");
    }
}

/// n(λ) of the tests below, linear from violet to red, and a coat or pane that has it.
fn steep(nm: f64) -> f64 {
    1.3 + 0.6 * (nm - 360.0) / 470.0
}

const STEEP: &str = "ior: {table: [[360, 1.3], [830, 1.9]]}";

/// A pane whose index depends on wavelength reflects 2R/(1 + R) and lets (1 − R)/(1 + R) through, by Fresnel's R at each
/// wavelength: before a dark wall only the first is seen, and where nothing but the pane shines only the second.
#[test]
fn a_pane_reflects_each_wavelength_by_its_own_index() {
    for cos in [1.0, 0.5] {
        let r = |nm: f64| fresnel::dielectric(Model::Exact, cos, steep(nm)).reflected;
        let pane = |more: &str| {
            bench(&format!(
                "shapes:\n- disk: {{normal: [0, 0, 1], radius: 1, material: {{thin_dielectric: {{{STEEP}}}}}}}\n{more}"
            ))
        };
        let wall =
            "- disk: {center: [0, 0, -1], normal: [0, 0, 1], radius: 99, material: {diffuse: {reflectance: 0}}}\n";
        let sky = "lights: [{constant: {radiance: 1}}]\n";
        at_both_ends(pane(&format!("{wall}{sky}")), cos, |nm| 2.0 * r(nm) / (1.0 + r(nm)));
        let lamp = "- disk: {center: [0, 0, -1], normal: [0, 0, 1], radius: 99, emission: 1, material: {diffuse: {reflectance: 0}}}\n";
        at_both_ends(pane(lamp), cos, |nm| (1.0 - r(nm)) / (1.0 + r(nm)));
    }
}

/// A lamp without extent behind such a pane is found by shadow rays alone, each lane dimmed by its own share.
#[test]
fn a_point_lamp_shines_through_a_pane_by_each_wavelengths_index() {
    let scene = bench(&format!(
        "lights: [{{point: {{position: [0, 2, 0], intensity: 4}}}}]\nintegrator: {{path: {{max_depth: 2}}}}\nshapes:\n\
         - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
         - rectangle: {{corner: [-1, 1, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], material: {{thin_dielectric: {{{STEEP}}}}}}}\n",
    ))
    .grey();
    let found = scene.lanes(&ray(v(0.3, 0.5, 0.0), v(0.0, 0.0, 0.0)));
    for (nm, found) in super::common::SPREAD_NM.iter().zip(found) {
        let r = ((steep(*nm) - 1.0) / (steep(*nm) + 1.0)).powi(2);
        assert_close(found, 0.6 / PI * (1.0 - r) / (1.0 + r), 4e-6);
    }
}

/// As plastic of one index, wavelength by wavelength: E = R + T ρ (1 − F) / (1 − ρ F), F from inside at its index; a rough
/// coat as the same coat of one index.
#[test]
fn a_coat_reflects_each_wavelength_by_its_own_index() {
    let cos = 0.4;
    for nonlinear in [false, true] {
        let scene = disc(&format!("{{plastic: {{reflectance: 0.5, nonlinear: {nonlinear}, {STEEP}}}}}"));
        at_both_ends(scene, cos, |nm| {
            let split = fresnel::dielectric(Model::Exact, cos, steep(nm));
            let f = fresnel::dielectric_diffuse(1.0 / steep(nm));
            let base = if nonlinear { 0.5 * (1.0 - f) / (1.0 - 0.5 * f) } else { 0.5 };
            split.reflected + split.transmitted * base
        });
    }
    let rough = |ior: &str| disc(&format!("{{plastic: {{reflectance: 0.5, roughness: 0.3, {ior}}}}}"));
    let of_one = [360.0, 830.0].map(|nm| {
        let [above, _] = albedo_by_quadrature(&rough(&format!("ior: {}", steep(nm))), cos);
        above
    });
    // Of the fixed wavelengths the first and the last are near the ends; E runs smoothly between.
    let mid = {
        let [above, _] = albedo_by_quadrature(&rough(&format!("ior: {}", steep(595.0))), cos);
        above
    };
    at_both_ends(rough(STEEP), cos, |nm| {
        // The parabola through three indices: E bends by less than 0.1 a unit cubed of the index.
        let x = (nm - 360.0) / 470.0;
        of_one[0] * (1.0 - x) * (1.0 - 2.0 * x) + 4.0 * mid * x * (1.0 - x) + of_one[1] * x * (2.0 * x - 1.0)
    });
}

/// Light that is trapped in a perfect mirror, or in a ball of glass that reflects it totally, costs some hundred vertices:
/// 256 for sure and then 1/0.01 − 1 = 99 in the mean, with a spread of 100. Of 4096 paths the mean is within five times
/// 100/√4096 of that.
#[test]
fn trapped_light_ends() {
    let camera = "camera: {origin: [0, 0.9, 0], target: [1, 0.9, 0], fov_deg: 10}\nimage: {width: 16, height: 16}\n";
    for material in ["mirror: {reflectance: 1}", "dielectric: {ior: 1.5}"] {
        let scene = format!(
            "{camera}lights: [constant: {{radiance: 1}}]\nshapes: [sphere: {{radius: 1, material: {{{material}}}}}]\n"
        );
        let bench = bench_with(&scene, &[]);
        let events =
            (0..4096).map(|i| f64::from(bench.work([i % 16, i / 16 % 16], i / 256).events)).sum::<f64>() / 4096.0;
        assert!((events - 355.0).abs() < 5.0 * 100.0 / 64.0, "{material}: {events}");
    }
}
