//! Depth fog: (1 − a) L + a C with a of the depth along the camera's axis, in both integrators.

use super::LAMP;
use super::common::{bench, bench_with, v};
use glam::DVec3;

/// A shining wall across the view, 2, 6, 10 or 40 metres from the eye, for each law. The camera is at
/// z = 5 and looks along −z; a corner pixel's ray is longer, its depth is not.
#[test]
fn fog_fades_a_wall_by_its_depth() {
    type Law = (&'static str, fn(f64) -> f64);
    let laws: [Law; 3] = [
        ("start: 2, end: 10", |z| ((z - 2.0) / 8.0).clamp(0.0, 1.0)),
        ("density: 0.1", |z| 1.0 - (-0.1 * z).exp()),
        ("density: 0.1, falloff: exp2", |z| 1.0 - (-(0.1 * z).powi(2)).exp()),
    ];
    for integrator in ["path", "{whitted: {grid: 1}}"] {
        for (law, amount) in laws {
            for depth in [1.0, 2.0, 6.0, 10.0, 40.0] {
                let scene = bench(&format!(
                    "integrator: {integrator}\nfog: {{colour: 0.3, {law}}}\nshapes:\n\
                     - rectangle: {{corner: [-99, -99, {}], edge_u: [198, 0, 0], edge_v: [0, 198, 0], {LAMP}}}\n",
                    5.0 - depth
                ))
                .grey();
                let a = amount(depth);
                for pixel in [[0, 0], [4, 3], [7, 7]] {
                    let found = f64::from(scene.sample(pixel, 0).radiance.to_array()[0]);
                    let expected = 1.0 - a + 0.3 * a;
                    assert!((found - expected).abs() < 1e-6, "{integrator} {law} {depth}: {expected}, found {found}");
                }
            }
        }
    }
}

/// What is infinitely far is all fog; without fog it is all background.
#[test]
fn fog_hides_the_background() {
    for integrator in ["path", "{whitted: {grid: 1}}"] {
        for (fog, expected) in [
            ("fog: {colour: 0.3, density: 0.01}\n", 0.3),
            ("fog: {colour: 0.3, density: 0}\n", 0.8),
            ("fog: {colour: 0.3, density: 0, falloff: exp2}\n", 0.8),
            ("", 0.8),
        ] {
            let scene = bench(&format!("integrator: {integrator}\nlights: [{{constant: {{radiance: 0.8}}}}]\n{fog}"));
            scene.grey().picture().assert_all(expected, 1e-6);
        }
    }
}

/// XYZ is light over a density of wavelengths, some hundred times as much, of which f32 holds 3.4e38: the film's unit comes first.
#[test]
fn fog_is_as_bright_as_f32_holds() {
    for integrator in ["path", "{whitted: {grid: 1}}"] {
        let sky = "lights: [{constant: {radiance: 0.8}}]\n";
        let scene = bench(&format!("integrator: {integrator}\nfog: {{colour: 1.0e38, density: 0.01}}\n{sky}"));
        let picture = scene.grey().picture();
        assert_eq!(picture.invalid, 0);
        picture.assert_all(1e38, 1e33);
    }
}

/// A tilted floor: each pixel has its own depth, and the fog is that of its ray's first hit.
#[test]
fn fog_follows_the_depth_of_each_pixel() {
    let text = |fog: &str| {
        format!(
            "camera: {{origin: [0, 1, 0], target: [0, 0, -4], fov_deg: 40}}\nintegrator: {{whitted: {{grid: 1}}}}\n\
             image: {{width: 8, height: 8}}\n{fog}lights: [{{directional: {{direction: [0, -1, -1], irradiance: 2}}}}]\n\
             shapes: [{{plane: {{normal: [0, 1, 0]}}}}]\n"
        )
    };
    let clear = bench_with(&text(""), &[]).grey().picture();
    let fogged = bench_with(&text("fog: {colour: 0.5, density: 0.2}\n"), &[]).grey();
    let picture = fogged.picture();
    let axis = v(0.0, -1.0, -4.0).normalize();
    for (x, y) in [(0, 2), (3, 3), (7, 5), (2, 7)] {
        let ray = fogged.camera_ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let hit: DVec3 = ray.at(-ray.origin.y / ray.direction.y);
        let depth = (hit - ray.origin).dot(axis);
        assert!(depth > 0.0);
        let a = 1.0 - (-0.2 * depth).exp();
        let expected = clear.at(x, y) * (1.0 - a) + 0.5 * a;
        assert!((picture.at(x, y) - expected).abs() < 2e-6, "({x}, {y}): {expected}, {}", picture.at(x, y));
    }
}

/// A mask, half open, one metre from the eye, and a black wall far behind: which of them a path meets first is drawn, and its
/// light is faded by that depth alone, however many paths a sample has: ½ · ρE/π · e^(−0.2), with ρ = 1 and E = π.
#[test]
fn each_path_of_a_sample_is_behind_its_own_fog() {
    for rays in [1, 2, 8] {
        let scene = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], orthographic_height: 0.1}}\nimage: {{width: 8, height: 8}}\n\
             render: {{samples: 64}}\nintegrator: {{path: {{light_samples: {rays}}}}}\nfog: {{colour: 0, density: 0.2}}\n\
             lights: [{{directional: {{direction: [0, 0, -1], irradiance: 3.14159265}}}}]\nmaterials:\n\
             \x20 half: {{mask: {{opacity: 0.5, material: {{diffuse: {{reflectance: 1}}}}}}}}\n\
             \x20 black: {{diffuse: {{reflectance: 0}}}}\nshapes:\n\
             - rectangle: {{corner: [-1, -1, 4], edge_u: [2, 0, 0], edge_v: [0, 2, 0], material: half}}\n\
             - rectangle: {{corner: [-1, -1, -5], edge_u: [2, 0, 0], edge_v: [0, 2, 0], material: black}}\n"
        );
        bench_with(&scene, &[]).grey().picture().mean().assert_is(0.5 * (-0.2f64).exp(), 0.02);
    }
}

/// A pane, whole or half of it a hole, one metre from the eye, and a white wall at five, lit through the pane. What comes through
/// the pane, T = (1 − r)/(1 + r) with r = 0.04 of it, is faded as the pane is, what comes through the hole as the wall is: whichever
/// paths bring it, and whatever counts as coverage. With s = h + (1 − h) T in all, E = π and ρ = 1 that is
/// s (h e^(−0.3 · 5) + (1 − h) T e^(−0.3)).
#[test]
fn what_comes_through_a_pane_is_behind_the_fog_before_the_pane() {
    let through = 0.96 / 1.04;
    let pane = "thin_dielectric: {ior: 1.5}";
    for (hole, material) in [(0.0, pane.to_owned()), (0.5, format!("mask: {{opacity: 0.5, material: {{{pane}}}}}"))] {
        let all = hole + (1.0 - hole) * through;
        let expected = all * (hole * (-1.5f64).exp() + (1.0 - hole) * through * (-0.3f64).exp());
        for integrator in [
            "path: {max_depth: 2}",
            "path: {max_depth: 2, coverage: scattering}",
            "path: {max_depth: 2, coverage: first_hit}",
            "light_tracer: {max_depth: 2}",
        ] {
            let scene = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 20}}\nimage: {{width: 8, height: 8}}\n\
                 render: {{samples: 4096}}\nintegrator: {{{integrator}}}\nfog: {{colour: 0, density: 0.3}}\n\
                 lights: [{{directional: {{direction: [0, 0, -1], irradiance: 3.14159265}}}}]\nshapes:\n\
                 - rectangle: {{corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], \
                   material: {{diffuse: {{reflectance: 1}}}}}}\n\
                 - rectangle: {{corner: [-1, -1, 4], edge_u: [2, 0, 0], edge_v: [0, 2, 0], material: {{{material}}}}}\n"
            );
            bench_with(&scene, &[]).grey().picture().mean().assert_is(expected, 0.02);
        }
    }
}
