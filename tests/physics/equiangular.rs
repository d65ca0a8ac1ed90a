//! Distances in media that are drawn toward lamps change the noise, never the mean.

use super::common::{Bench, bench_with, grey_png, ray, v};
use super::reuse::{assert_layers_add_up, assert_same_light, over_seeds};
use super::volumes::{noise, vol};
use std::f64::consts::PI;

/// A ray that passes a lamp of intensity I at distance h, the nearer the brighter, in fog that is told by its scattering once:
/// L = I σ_s / 4π ∫ e^(−σ_t (t + r)) / r² dt, with r² = h² + (t − 5)², to a black wall 10 m away. So near the lamp as here nearly
/// every flight ends where it finds little: without such distances 2¹³ of them tell nothing.
#[test]
fn light_beside_a_lamp_in_fog_is_its_integral() {
    let (scattering, absorption, intensity) = (0.02f64, 0.01, 3.0);
    let fog = bench_with(
        &format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 10}}\nintegrator: {{path: {{max_depth: 2}}}}\n\
             render: {{samples: 16, techniques: {{equiangular: on}}}}\n\
             media: {{fog: {{homogeneous: {{scattering: {scattering}, absorption: {absorption}}}}}}}\nmedium: fog\n\
             lights: [{{point: {{position: [0, 0, 0], intensity: {intensity}}}}}]\n\
             shapes: [{{plane: {{point: [0, 0, -5], normal: [0, 0, 1], material: {{diffuse: {{reflectance: 0}}}}}}}}]\n"
        ),
        &[],
    );
    assert_eq!(fog.prepared.plan.near_lamps, 1);
    for h in [1.0f64, 1e-2, 1e-5] {
        // t − 5 = h tan θ, so that dt / r² = dθ / h: 10⁵ midpoints of a smooth integrand.
        let (n, end) = (100_000, (5.0 / h).atan());
        let sum: f64 = (0..n)
            .map(|i| {
                let theta = end * ((f64::from(i) + 0.5) * 2.0 / f64::from(n) - 1.0);
                let (t, r) = (5.0 + h * theta.tan(), h / theta.cos());
                (-(scattering + absorption) * (t + r)).exp() * 2.0 * end / (f64::from(n) * h)
            })
            .sum();
        let expected = intensity * scattering / (4.0 * PI) * sum;
        fog.estimate(&ray(v(h, 0.0, 5.0), v(h, 0.0, 0.0)), 8192).assert_is(expected, 2e-3);
    }
}

/// Smoke, a ball and a floor in the light of lamps that stand away from the smoke: near them, flights alone are too noisy to compare.
fn lit(equiangular: &str, medium: &str, lights: &str, shapes: &str, layers: &str) -> Bench {
    let yaml = format!(
        "camera: {{origin: [0, 0.2, 4], target: [0, 0, 0], fov_deg: 20}}\nimage: {{width: 20, height: 16}}\n\
         integrator: {{path: {{max_depth: 4}}}}\nrender: {{samples: 32, techniques: {{equiangular: {equiangular}, light_tracing: off}}}}\n\
         volumes: {{v: {{grid: {{file: v.vol, transform: [{{scale: 2}}, {{translate: [-1, -1, -1]}}]}}}}}}\n\
         media: {{m: {medium}}}\nlights: [{lights}]\n{layers}\
         shapes:\n- plane: {{point: [0, -1.2, 0], normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
         - cube: {{size: 2, material: {{boundary: {{}}}}, inside: m}}\n{shapes}"
    );
    let slide = grey_png(4, 4, |x, y| if (x + y) % 2 == 0 { 255 } else { 60 });
    bench_with(&yaml, &[("v.vol", &vol([8, 8, 8], 1, &noise())), ("slide.png", &slide)])
}

const THIN: &str = "{homogeneous: {scattering: 0.1, absorption: 0.05, phase: {hg: 0.3}}}";
const COLOURED: &str = "{homogeneous: {scattering: {rgb: [0.2, 0.6, 0.3]}, absorption: 0.1}}";
const GRID: &str = "{heterogeneous: {extinction: {volume: v}, albedo: 0.8, scale: 0.5, phase: {hg: 0.5}}}";
const POINT: &str = "{point: {position: [0.4, 1.8, 0.3], intensity: 3}}";
const SPOT: &str = "{spot: {position: [-2, 1.5, 0.5], target: [0, 0, 0], cutoff_deg: 20, beam_deg: 15, intensity: 9}}";
const PROJECTOR: &str =
    "{projector: {origin: [2.2, 0.5, 0.6], target: [0, 0, 0], fov_deg: 30, irradiance: {texture: slide}, scale: 20}}";

#[test]
fn light_is_the_same_by_distances_toward_lamps() {
    let ball = "- sphere: {center: [0.2, -0.3, 0.1], radius: 0.4, material: {diffuse: {reflectance: 0.7}}}\n";
    let open = "- sphere: {center: [0.2, -0.3, 0.1], radius: 0.4, material: {mask: {opacity: 0.5, material: {diffuse: {}}}}}\n\
                - rectangle: {corner: [-0.9, -0.9, 0.8], edge_u: [1, 0, 0], edge_v: [0, 1, 0], material: {thin_dielectric: {ior: 1.5}}}\n\
                - rectangle: {corner: [-0.9, -0.9, -0.8], edge_u: [1.8, 0, 0], edge_v: [0, 1.8, 0], material: {mirror: {}}}\n";
    let textures = "textures: {slide: {image: {file: slide.png}}}\n";
    let all = [POINT, SPOT, PROJECTOR].join(", ") + ", {constant: {radiance: 0.05}}";
    // Lamps with extent, small and large, one of them within the smoke, one behind panes.
    let bulb = "- sphere: {center: [0.4, 1.5, 0.3], radius: 0.08, emission: 90}\n";
    let panel = "- rectangle: {corner: [-1, 1.6, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], emission: 0.6}\n";
    let within = "- sphere: {center: [-0.3, 0.3, 0.2], radius: 0.25, emission: 3}\n";
    let lamps = [bulb, panel, within].concat();
    // Without the mirror, which shows the bulb to the smoke by rare chance.
    let (panes, _) = open.split_at(open.rfind("- rectangle").unwrap());
    let bulb_and_panes = format!("{bulb}{panes}");
    for (name, medium, lights, shapes, most) in [
        ("thin smoke and a point", THIN, POINT, ball, 0.8),
        ("coloured smoke and a spot", COLOURED, SPOT, ball, 0.9),
        ("a grid, a point and a spot", GRID, &[POINT, SPOT].join(", "), ball, 0.9),
        ("a pane, a mask and a mirror", COLOURED, &[POINT, SPOT].join(", "), open, 1.0),
        ("all kinds and a sky", GRID, &all, ball, 1.0),
        ("thin smoke and a bulb", THIN, "", bulb, 0.8),
        ("coloured smoke and a panel", COLOURED, "", panel, 1.1),
        // What the phase function finds of the lamp within counts no longer, as much as distances save.
        ("a grid, lamps with and without extent and a sky", GRID, &all, &lamps, 1.3),
        ("a pane and a mask before a bulb", COLOURED, POINT, &bulb_and_panes, 1.0),
    ] {
        let by_flights = over_seeds(lit("off", medium, lights, shapes, textures), 0..24);
        let bench = lit("on", medium, lights, shapes, textures);
        assert_eq!(bench.prepared.plan.near_lamps, bench.prepared.scene.near_lamps.len(), "{name}");
        let both = over_seeds(bench, 100..124);
        let ratio = assert_same_light(name, &by_flights, &both);
        assert!(ratio < most, "{name}: {ratio}");
    }
}

#[test]
fn layers_add_up_with_distances_toward_lamps() {
    let textures = "textures: {slide: {image: {file: slide.png}}}\n";
    let plain = lit("on", GRID, &[POINT, SPOT].join(", "), "", textures);
    let layers = format!("{textures}layers: [emission, direct, indirect, caustic]\n");
    assert_layers_add_up(&plain, &lit("on", GRID, &[POINT, SPOT].join(", "), "", &layers));
    let bulb = "- sphere: {center: [-0.3, 0.3, 0.2], radius: 0.25, emission: 3}\n";
    assert_layers_add_up(&lit("on", THIN, POINT, bulb, textures), &lit("on", THIN, POINT, bulb, &layers));
}

/// Two paths from each camera ray are told to take twice what one does, with the rays that look for lamps along their way: 4096 of
/// them tell a mean of rays, which scatters by less than that mean, to 1.6 %.
#[test]
fn several_paths_of_a_camera_ray_count_all_of_their_rays() {
    let rays = |several: u32| {
        let yaml = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 16, height: 16}}\n\
             integrator: {{path: {{max_depth: 6, light_samples: {several}, scatter_samples: {several}}}}}\n\
             render: {{samples: 16, techniques: {{equiangular: on}}}}\n\
             media: {{fog: {{homogeneous: {{scattering: 0.3}}}}}}\nmedium: fog\n\
             lights: [{{point: {{position: [0, 1, 0], intensity: 1}}}}]\n\
             shapes: [{{plane: {{point: [0, 0, -5], normal: [0, 0, 1], material: {{diffuse: {{}}}}}}}}]\n"
        );
        let fog = bench_with(&yaml, &[]);
        assert_eq!(fog.prepared.plan.near_lamps, 1);
        (0..4096).map(|i| fog.work([i % 16, i / 16 % 16], i / 256).rays - 1.0).sum::<f64>() / 4096.0
    };
    let (one, two) = (rays(1), rays(2));
    assert!((two / one - 2.0).abs() < 0.1, "{one} and {two}");
}

/// A spot's beam in thin smoke is what they are for. In thick smoke flights end before the beam, of nine lamps none is looked at
/// along the way, and where none has a place there is nothing to decide.
#[test]
fn a_trial_draws_distances_toward_lamps_where_that_pays() {
    let decided = |scattering: f64, lights: &str, shapes: &str| {
        let fog = format!("{{homogeneous: {{scattering: {scattering}}}}}");
        let bench = lit("auto", &fog, lights, shapes, "textures: {slide: {image: {file: slide.png}}}\n");
        let plan = bench.prepared.plan;
        let said = plan.techniques.iter().find(|t| t.name == "equiangular sampling");
        said.map(|said| {
            assert_eq!(said.on, plan.near_lamps > 0);
            plan.near_lamps
        })
    };
    assert_eq!(decided(0.05, SPOT, ""), Some(1));
    assert_eq!(decided(40.0, POINT, ""), Some(0));
    assert_eq!(decided(0.05, &[POINT; 9].join(", "), ""), Some(0));
    assert_eq!(decided(0.05, "{directional: {direction: [0, -1, 0], irradiance: 1}}", ""), None);
    // Of lamps with extent bulbs pay; a panel beside a spot does not. Many are left out, and the point among them is not.
    let bulb = "- sphere: {center: [0.4, 1.5, 0.3], radius: 0.08, emission: 90}\n";
    assert_eq!(decided(0.05, "", bulb), Some(1));
    assert_eq!(decided(40.0, "", bulb), Some(0));
    let panel = "- rectangle: {corner: [-6, 8, -3], edge_u: [8, 0, 0], edge_v: [0, 0, 6], emission: 0.3}\n";
    assert_eq!(decided(0.05, SPOT, panel), Some(1));
    assert_eq!(decided(0.05, "", &bulb.repeat(9)), Some(0));
    assert_eq!(decided(0.05, POINT, &bulb.repeat(8)), Some(1));
}
