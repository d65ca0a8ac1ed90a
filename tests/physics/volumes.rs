//! Media and textures that vary through space, and panes before lamps.

use super::LAMP;
use super::common::{Bench, CAMERA, Estimate, assert_close, bench, bench_with, ray, try_bench, v};
use std::f64::consts::PI;

/// The bytes of a grid over the unit cube.
pub fn vol(size: [i32; 3], channels: i32, values: &[f32]) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    for n in [1, size[0], size[1], size[2], channels] {
        bytes.extend(n.to_le_bytes());
    }
    for x in [0f32, 0.0, 0.0, 1.0, 1.0, 1.0].iter().chain(values) {
        bytes.extend(x.to_le_bytes());
    }
    bytes
}

/// Some 500 numbers between 0 and 2, without order.
pub fn noise() -> Vec<f32> {
    (0..512u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / f32::powi(2.0, 23)).collect()
}

/// The cube of side 2 about the origin holds a medium of the grid `values`, 8³, times `scale`.
fn cloud(values: &[f32], fields: &str, more: &str) -> Bench {
    let scene = format!(
        "{CAMERA}volumes: {{v: {{grid: {{file: v.vol, transform: [{{scale: 2}}, {{translate: [-1, -1, -1]}}]}}}}}}\n\
         media: {{m: {{heterogeneous: {{extinction: {{volume: v}}, {fields}}}}}}}\n\
         shapes:\n- cube: {{size: 2, material: {{boundary: {{}}}}, inside: m}}\n{more}\n"
    );
    bench_with(&scene, &[("v.vol", &vol([8, 8, 8], 1, values))])
}

/// A grid of one density is a homogeneous medium, for light that is scattered once and for all of it: with lamps
/// found both ways.
#[test]
fn a_grid_of_one_density_is_a_homogeneous_medium() {
    let lamp = format!("- rectangle: {{corner: [-1, 1.5, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], {LAMP}}}\n");
    for depth in [2, 8] {
        let more = format!("{lamp}integrator: {{path: {{max_depth: {depth}}}}}");
        let grid = cloud(&[0.5; 512], "scale: 2, albedo: 0.8, phase: {hg: 0.3}", &more);
        let even = bench(&format!(
            "media: {{m: {{homogeneous: {{extinction: 1, albedo: 0.8, phase: {{hg: 0.3}}}}}}}}\n\
             shapes:\n- cube: {{size: 2, material: {{boundary: {{}}}}, inside: m}}\n{more}\n"
        ));
        let through = ray(v(0.2, 0.3, 5.0), v(0.1, 0.2, 0.0));
        let (grid, even) = (grid.estimate(&through, 16_384), even.estimate(&through, 16_384));
        grid.assert_agrees(&even, 2e-2);
    }
}

/// A cloud that only scatters keeps all light: in even light it is invisible, whatever its shape, phase function
/// and way of finding lamps.
#[test]
fn clouds_that_only_scatter_are_invisible_in_even_light() {
    for fields in [
        "scale: 3, albedo: 1",
        "scale: 3, albedo: 1, phase: {hg: 0.7}",
        "scale: 3, albedo: 1, phase: {table: [0, 0.2, 1, 4]}",
        "scale: 3, albedo: 1, phase: {blend: {weight: {volume: v}, of: [rayleigh, {hg: -0.6}]}}",
        "scale: 3, albedo: 1, shadow_rays: false",
    ] {
        let scene = cloud(&noise(), fields, "lights: [{constant: {radiance: 1}}]");
        scene.luminance(&ray(v(0.3, 0.2, 5.0), v(0.3, 0.2, 0.0)), 8192).assert_is(1.0, 2e-2);
    }
    // Coloured: the luminance, since lanes stand in for each other.
    let colours: Vec<f32> = (0..81).map(|i| 0.2 + 0.1 * (i % 7) as f32).collect();
    let scene = bench_with(
        &format!(
            "{CAMERA}volumes: {{v: {{grid: {{file: v.vol, transform: [{{translate: [-0.5, -0.5, -0.5]}}]}}}}}}\n\
             media: {{m: {{heterogeneous: {{extinction: {{volume: v}}, scale: 4, albedo: 1}}}}}}\n\
             shapes: [{{sphere: {{radius: 1, material: {{boundary: {{}}}}, inside: m}}}}]\n\
             lights: [{{constant: {{radiance: 1}}}}]\n"
        ),
        &[("v.vol", &vol([3, 3, 3], 3, &colours))],
    );
    scene.luminance(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 8192).assert_is(1.0, 2e-2);
}

/// Through a density that rises along the ray from 0 to σ over the width of the cube: 8 values at the centres, held
/// beyond the outer ones, have the mean σ/2, so exp(−σ/2 · 2 m) comes through, with and without scattering into black.
#[test]
fn a_linear_density_dims_by_its_mean() {
    let ramp: Vec<f32> = (0..512).map(|i| ((i / 64) as f32 + 0.5) / 8.0 * 1.5).collect();
    let more = format!(
        "- rectangle: {{corner: [-1, -1, -3], edge_u: [2, 0, 0], edge_v: [0, 2, 0], {LAMP}}}\n\
         integrator: {{path: {{max_depth: 1}}}}"
    );
    for albedo in [0.0, 0.7] {
        let scene = cloud(&ramp, &format!("albedo: {albedo}"), &more);
        let found = scene.estimate(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 16_384);
        found.assert_is((-1.5f64).exp(), 1.5e-2);
    }
}

/// Two layers of one density, the one before the camera and the other before the lamp, dim by both: e^(−τ₁ − τ₂). Random numbers
/// that the two walks shared would let the same paths through both. The wall, 1 m below the lamp of 1 W/sr and half white,
/// sends 1/(2π) back.
#[test]
fn camera_and_shadow_rays_walk_through_clouds_by_numbers_of_their_own() {
    let slab = |at: [f64; 3], size: [f64; 3]| {
        format!("- cube: {{center: {at:?}, size: {size:?}, material: {{boundary: {{}}}}, inside: m}}\n")
    };
    let scene = format!(
        "{CAMERA}volumes: {{v: {{grid: {{file: v.vol, transform: [{{scale: 9}}, {{translate: [-4.5, -4.5, -4.5]}}]}}}}}}\n\
         media: {{m: {{heterogeneous: {{extinction: {{volume: v}}, albedo: 0}}}}}}\n\
         shapes:\n- rectangle: {{corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], material: {{diffuse: {{reflectance: 0.5}}}}}}\n\
         {}{}lights: [{{point: {{position: [0, 0, 1], intensity: 1}}}}]\nintegrator: {{path: {{max_depth: 2}}}}\n",
        slab([2.0, 0.0, 2.0], [1.0, 2.0, 6.0]),
        slab([0.0, 0.0, 0.5], [0.5, 0.5, 0.5]),
    );
    let scene = bench_with(&scene, &[("v.vol", &vol([8, 8, 8], 1, &[0.75; 512]))]);
    // Slanted by 45° the first layer is √2 thick.
    let found = scene.estimate(&ray(v(4.0, 0.0, 4.0), v(0.0, 0.0, 0.0)), 16_384);
    found.assert_is((-0.75 * (2f64.sqrt() + 0.5)).exp() / (2.0 * PI), 2e-2);
}

/// A lamp is found by shadow rays and by scattering together as by scattering alone.
#[test]
fn shadow_rays_through_clouds_change_no_mean() {
    let lamp = format!("- sphere: {{center: [0, 2, 0], radius: 0.8, {LAMP}}}\n");
    let through = ray(v(0.3, 0.2, 5.0), v(0.3, 0.2, 0.0));
    let of = |rays: bool| {
        let fields = format!("scale: 2, albedo: 0.9, phase: {{hg: 0.5}}, shadow_rays: {rays}");
        cloud(&noise(), &fields, &lamp).estimate(&through, 16_384)
    };
    let (with, without) = (of(true), of(false));
    with.assert_agrees(&without, 5e-2);
    assert!(with.error < 0.5 * without.error, "{with:?} {without:?}");
}

/// The albedo of a homogeneous medium may vary: half of the cube scatters everything, half nothing. Scattered once
/// from sunlight behind the eye, L = E/(4π) ∫ a(s) σ e^(−2σ s) ds over the half that scatters, the near one (nearest
/// voxels, so that the step is sharp).
#[test]
fn an_albedo_may_vary_in_an_even_medium() {
    let scene = format!(
        "{CAMERA}volumes: {{a: {{grid: {{file: a.vol, filter: nearest, transform: [{{scale: 2}}, {{translate: [-1, -1, -1]}}]}}}}}}\n\
         media: {{m: {{homogeneous: {{extinction: 0.5, albedo: {{volume: a}}}}}}}}\n\
         shapes:\n- cube: {{size: 2, material: {{boundary: {{}}}}, inside: m}}\n\
         lights: [{{directional: {{direction: [0, 0, -1], irradiance: 10}}}}]\nintegrator: {{path: {{max_depth: 2}}}}\n"
    );
    let scene = bench_with(&scene, &[("a.vol", &vol([1, 1, 2], 1, &[0.0, 1.0]))]);
    let expected = 10.0 / (4.0 * PI) * 0.5 * (1.0 - (-1.0f64).exp());
    scene.estimate(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 8192).assert_is(expected, 1e-2);
}

/// A broken grid is one error that names the file, and has the exit code of a broken file.
#[test]
fn a_broken_grid_is_one_error() {
    let scene = format!("{CAMERA}volumes: {{v: {{grid: {{file: v.vol}}}}}}\n");
    let fault = |bytes: &[u8]| try_bench(&scene, &[("v.vol", bytes)]).err().unwrap();
    assert_eq!(
        fault(b"PNG"),
        "DIR/v.vol: expected a grid that starts with the letters VOL, found another format; it is named at \
         DIR/scene.yaml:3:28: volumes.v.grid.file"
    );
    assert!(fault(&vol([2, 2, 2], 1, &[1.0; 7])).contains("truncated"));
    assert!(fault(&vol([1, 1, 1], 6, &[1.0; 6])).contains("expected 1 channel or 3, found 6"));
    assert!(fault(&vol([1, 1, 1], 1, &[-1.0])).contains("expected numbers of 0 or more, found -1"));
    let raw = format!(
        "{CAMERA}volumes: {{v: {{grid: {{file: v.vol, raw: true}}}}}}\n\
         media: {{m: {{heterogeneous: {{extinction: {{volume: v}}, albedo: 1}}}}}}\n"
    );
    let fault = try_bench(&raw, &[("v.vol", &vol([1, 1, 1], 3, &[0.5; 3]))]).err().unwrap();
    assert!(fault.contains("extinction.volume: expected a volume of spectra, found one of raw numbers"), "{fault}");
}

/// A ray that has a step for each of 1e20 mean free paths in thin places has no end. The diagonal of the cube is √3.
#[test]
fn a_volume_too_thick_to_be_crossed_is_refused() {
    let fault = |scale: &str| {
        let scene = format!(
            "{CAMERA}volumes: {{v: {{grid: {{file: v.vol}}}}}}\n\
             media: {{m: {{heterogeneous: {{extinction: {{volume: v}}, albedo: 1, scale: {scale}}}}}}}\n"
        );
        try_bench(&scene, &[("v.vol", &vol([2, 1, 1], 1, &[1.0, 1e-3]))]).err()
    };
    assert_eq!(fault("5.7e6"), None);
    assert_eq!(
        fault("1e20").unwrap(),
        "DIR/scene.yaml:4:41: media.m.heterogeneous.extinction: expected at most 1e7 mean free paths across the volume, found 1.7e20"
    );
}

/// A texture of a volume is the volume where the surface cuts it: on the floor, 0.2 on one side, 0.8 on the other.
#[test]
fn a_volume_on_a_surface_is_cut_by_it() {
    let scene = bench_with(
        &format!(
            "{CAMERA}volumes: {{v: {{grid: {{file: v.vol, filter: nearest, transform: [{{translate: [-0.5, -0.5, -0.5]}}]}}}}}}\n\
             textures: {{t: {{volume: v}}}}\nlights: [{{constant: {{radiance: 1}}}}]\nintegrator: {{path: {{max_depth: 2}}}}\n\
             shapes: [{{plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: {{texture: t}}}}}}}}}}]\n"
        ),
        &[("v.vol", &vol([2, 1, 1], 1, &[0.2, 0.8]))],
    );
    for (x, expected) in [(-0.3, 0.2), (0.3, 0.8)] {
        scene.estimate(&ray(v(x, 3.0, 0.0), v(x, 0.0, 0.0)), 1024).assert_is(expected, 1e-3);
    }
}

/// Normals may be the three numbers of a volume. Those of (0.8, 0.5, 0.9) are (0.6, 0, 0.8): light from straight above, of
/// irradiance π, comes back from a floor of ½ as ½ · 0.8, whichever way u runs.
#[test]
fn normals_of_a_volume_are_its_three_numbers() {
    for filter in ["nearest", "trilinear"] {
        let scene = bench_with(
            &format!(
                "{CAMERA}volumes: {{v: {{grid: {{file: v.vol, raw: true, filter: {filter}}}}}}}\ntextures: {{t: {{volume: v}}}}\n\
                 lights: [{{directional: {{direction: [0, -1, 0], irradiance: 3.141592653589793}}}}]\n\
                 shapes: [{{plane: {{normal: [0, 1, 0], material: {{normal_map: {{normals: {{texture: t}}, shadowing: false, \
                 material: {{diffuse: {{reflectance: 0.5}}}}}}}}}}}}]\n"
            ),
            &[("v.vol", &vol([1, 1, 1], 3, &[0.8, 0.5, 0.9]))],
        );
        scene.estimate(&ray(v(0.5, 3.0, 0.5), v(0.5, 0.0, 0.5)), 64).assert_is(0.4, 1e-6);
    }
}

/// A lamp over a floor behind a pane, F = ½ as without it, times what the pane lets through on the way of each
/// direction: less than without. What shadow rays and scattering find together is what a path without shadow rays
/// finds.
#[test]
fn a_lamp_behind_a_pane_is_found_both_ways() {
    let (both, chance) = behind_a_pane("1.5", "");
    both.assert_agrees(&chance, 1e-2);
    assert!(both.mean < 0.3 && both.mean > 0.25 && both.error < 0.6 * chance.error, "{both:?} {chance:?}");
}

/// The same in thin fog, with a pane of index 4, which lets 1 − 2R/(1 + R) = 0.47 or less through, R = 0.36 or more: what it
/// reflects is lost to the path that would have met the lamp by chance.
#[test]
fn a_lamp_behind_a_pane_in_fog_is_found_both_ways() {
    let (both, chance) = behind_a_pane("4", "media: {fog: {homogeneous: {absorption: 0.1}}}\nmedium: fog\n");
    both.assert_agrees(&chance, 1e-2);
}

/// The light of a floor under a lamp, with a pane of index `ior` between, by shadow rays and scattering, and by scattering.
fn behind_a_pane(ior: &str, more: &str) -> (Estimate, Estimate) {
    let scene = |samples: u32| {
        bench(&format!(
            "integrator: {{path: {{light_samples: {samples}}}}}\n{more}shapes:\n\
             - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
             - disk: {{center: [0, 1, 0], normal: [0, -1, 0], radius: 1, {LAMP}}}\n\
             - rectangle: {{corner: [-9, 0.5, -9], edge_u: [18, 0, 0], edge_v: [0, 0, 18], \
             material: {{thin_dielectric: {{ior: {ior}}}}}}}\n"
        ))
    };
    let floor = ray(v(0.0, 0.1, 0.1), v(0.0, 0.0, 0.0));
    (scene(1).estimate(&floor, 16_384), scene(0).estimate(&floor, 16_384))
}

/// A point lamp, which nothing can meet by chance, shines through a pane: at normal incidence T = 1 − 2R/(1 + R)
/// with R = 0.04.
#[test]
fn a_point_lamp_shines_through_a_pane() {
    let scene = bench(
        "lights: [{point: {position: [0, 2, 0], intensity: 4}}]\nintegrator: {path: {max_depth: 2}}\nshapes:\n\
         - plane: {normal: [0, 1, 0], material: {diffuse: {reflectance: 0.6}}}\n\
         - rectangle: {corner: [-1, 1, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], material: {thin_dielectric: {ior: 1.5}}}\n",
    );
    let expected = 0.6 / PI * (1.0 - 0.08 / 1.04);
    assert_close(scene.look(v(0.3, 0.5, 0.0), v(0.0, 0.0, 0.0)), expected, 2e-6);
    // Where panes count, the light has one segment too many.
    let counted = bench(
        "lights: [{point: {position: [0, 2, 0], intensity: 4}}]\n\
         integrator: {path: {max_depth: 2, count_crossings: true}}\nshapes:\n\
         - plane: {normal: [0, 1, 0], material: {diffuse: {reflectance: 0.6}}}\n\
         - rectangle: {corner: [-1, 1, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], material: {thin_dielectric: {ior: 1.5}}}\n",
    );
    assert_eq!(counted.look(v(0.3, 0.5, 0.0), v(0.0, 0.0, 0.0)), 0.0);
}

/// Fog goes on inside a glass ball that leaves the medium unchanged, and does not inside one that says nothing: seen
/// straight through the middle of a ball of index 1 in fog, a lamp is dimmed over 5 m or over 3 m.
#[test]
fn a_shape_may_leave_the_medium_unchanged() {
    let through = |sides: &str| {
        let scene = bench(&format!(
            "media: {{fog: {{homogeneous: {{absorption: 0.2}}}}}}\nmedium: fog\nshapes:\n\
             - rectangle: {{corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], {LAMP}}}\n\
             - sphere: {{center: [0, 0, 2.5], radius: 1, material: {{boundary: {{}}}}{sides}}}\n"
        ));
        scene.look(v(0.0, 0.0, 5.0), v(0.0, 0.0, 0.0))
    };
    assert_close(through(""), (-0.6f64).exp(), 2e-6);
    assert_close(through(", inside: unchanged, outside: unchanged"), (-1.0f64).exp(), 2e-6);
    // Empty outside as well: fog only before the ball.
    assert_close(through(", inside: vacuum, outside: vacuum"), (-0.3f64).exp(), 2e-6);
}
