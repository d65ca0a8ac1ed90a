//! Techniques change the noise, never the mean; and light does not come through where there is a wall.

use super::LAMP;
use super::common::{Bench, CAMERA, Estimate, bench, bench_with, mean, ray, v};
use abbe::math::sampler::mix64;
use abbe::math::statistics::Moments;
use abbe::math::{Frame, Ray};
use abbe::optics::bsdf::Bsdf;
use abbe::scene::environment::Drawn;
use abbe::scene::{Hit, SurfacePoint};
use abbe::spectrum::Lanes;
use glam::{DVec2, DVec3};

/// Independent numbers in [0, 1) for draw `i`.
fn random(i: u64) -> [f64; 3] {
    [1, 2, 3].map(|k| (mix64(mix64(i) ^ (k << 56)) >> 11) as f64 / (1u64 << 53) as f64)
}

/// The first hit of a ray, and its material there.
struct Vertex<'a> {
    hit: Hit,
    surface: SurfacePoint,
    frame: Frame,
    wo: DVec3,
    bsdf: Bsdf<'a>,
}

fn vertex<'a>(bench: &'a Bench, ray: &Ray) -> Vertex<'a> {
    let scene = &bench.prepared.scene;
    let hit = scene.closest(ray, f64::INFINITY).unwrap();
    let surface = scene.surface(ray, &hit);
    let frame = Frame::from_normal_and_tangent(surface.shading_normal, surface.tangent);
    let material = &scene.materials[scene.objects[hit.object as usize].material as usize];
    let bsdf = material.bsdf(&hit.texture_point(&surface), Lanes::splat(550.0), false);
    Vertex { hit, surface, wo: frame.to_local(-ray.direction), frame, bsdf }
}

const NM: f32 = 550.0;

/// Direct light of the scene's only lamp, by points on the lamp alone.
fn by_light(bench: &Bench, x: &Vertex, n: u64) -> Estimate {
    let scene = &bench.prepared.scene;
    let moments: Moments = (0..n)
        .map(|i| {
            let [a, b, _] = random(i);
            let nm = Lanes::splat(NM);
            let (from, u) = (x.surface.point, DVec2::new(a, b));
            let Some(l) = scene.lights[0].arriving(&scene.objects, from, None, u, Drawn::All, nm) else { return 0.0 };
            let wi = x.frame.to_local(l.wi);
            let f = mean(x.bsdf.eval(x.wo, wi).f) * wi.z.abs();
            if f == 0.0 || scene.occluded(&scene.leave(&x.surface, &x.hit, l.wi), l.distance, l.target) {
                return 0.0;
            }
            f * mean(l.radiance) / l.density.unwrap()
        })
        .collect();
    Estimate { mean: moments.mean, error: moments.standard_error() }
}

/// The same by directions of the material alone.
fn by_material(bench: &Bench, x: &Vertex, n: u64) -> Estimate {
    let scene = &bench.prepared.scene;
    let moments: Moments = (0..n)
        .map(|i| {
            let [a, b, lobe] = random(i);
            let Some(s) = x.bsdf.sample(x.wo, lobe, DVec2::new(a, b)) else { return 0.0 };
            let onward = scene.leave(&x.surface, &x.hit, x.frame.to_world(s.wi));
            let nm = Lanes::splat(NM);
            let light = match scene.closest(&onward, f64::INFINITY) {
                None => scene.lights[0].background(onward.direction, nm),
                Some(hit) => match scene.objects[hit.object as usize].light {
                    Some(l) => {
                        let surface = scene.surface(&onward, &hit);
                        scene.lights[l as usize].emitted(&surface, &hit, -onward.direction, nm)
                    }
                    None => Lanes::ZERO,
                },
            };
            mean(s.weight * light)
        })
        .collect();
    Estimate { mean: moments.mean, error: moments.standard_error() }
}

/// Light by lamp, light by material, and the path tracer, which weighs both: three estimators of one
/// integral, for lamps small and large and materials dull and shiny.
#[test]
fn light_found_by_lamp_by_material_and_by_both_is_the_same() {
    let lamps = [
        format!("- sphere: {{center: [-1, 1.5, 0], radius: 0.5, {LAMP}}}\n"),
        format!("- rectangle: {{corner: [-2, 1, -1], edge_u: [2, 0, 0], edge_v: [0, 0.5, 2], {LAMP}}}\n"),
        format!("- disk: {{center: [-1, 1, 0], normal: [1, -1, 0], radius: 0.4, {LAMP}}}\n"),
        format!("- cylinder: {{base: [-2, 1, 0], top: [0, 1, 0], radius: 0.2, {LAMP}}}\n"),
        format!("- cone: {{base: [-1.5, 1, 0], apex: [-0.5, 1.5, 0.4], radius: 0.4, {LAMP}}}\n"),
        format!("- cube: {{center: [-1, 1.5, 0], size: [1, 0.5, 0.7], {LAMP}}}\n"),
        String::from("lights: [{constant: {radiance: 1}}]\n"),
    ];
    let materials = [
        "{diffuse: {reflectance: 0.7}}",
        "{conductor: {metal: gold, roughness: 0.3}}",
        "{conductor: {eta: 0.2, k: 3, roughness: 0.2, distribution: beckmann}}",
        "{dielectric: {ior: 1.5, roughness: 0.3}}",
        "{plastic: {reflectance: 0.5, roughness: 0.3}}",
    ];
    for lamp in &lamps {
        for material in materials {
            let bench = bench(&format!(
                "integrator: {{path: {{max_depth: 2}}}}\nshapes:\n\
                 - rectangle: {{corner: [-9, 0, 9], edge_u: [18, 0, 0], edge_v: [0, 0, -18], material: {material}}}\n{lamp}"
            ));
            let looking = ray(v(1.0, 0.9, 0.2), v(0.0, 0.0, 0.0));
            let x = vertex(&bench, &looking);
            let lights = by_light(&bench, &x, 20_000);
            let materials = by_material(&bench, &x, 20_000);
            // Metals and glass are coloured: the estimators above stand at one wavelength.
            let both = at_one_wavelength(bench).estimate(&looking, 4096);
            let say = |a: &Estimate, b: &Estimate| {
                let error = a.error.hypot(b.error);
                assert!(
                    (a.mean - b.mean).abs() <= 4.0 * error + 1e-5 * a.mean,
                    "{lamp}{material}: lamp {lights:?}, material {materials:?}, both {both:?}"
                );
            };
            say(&lights, &both);
            say(&materials, &both);
            assert!(both.mean > 0.0 && both.error < 0.05 * both.mean, "{lamp}{material}: {both:?}");
        }
    }
}

fn at_one_wavelength(mut bench: Bench) -> Bench {
    let fixed = abbe::spectrum::WavelengthDistribution::fixed([f64::from(NM); 8]).unwrap();
    bench.prepared.scene.wavelengths = fixed;
    bench
}

/// A triangle in the plane y = 0 whose vertex normals all lean by `deg` from +y toward +x.
fn leaning(deg: f64, material: &str, more: &str) -> Bench {
    let (sin, cos) = deg.to_radians().sin_cos();
    let obj = format!("v -5 0 5\nv 5 0 5\nv 0 0 -9\nvn {sin} {cos} 0\nf 1//1 2//1 3//1\n");
    bench_with(
        &format!("{CAMERA}shapes:\n- mesh: {{file: a.obj, material: {material}}}\n{more}\n"),
        &[("a.obj", obj.as_bytes())],
    )
}

/// The shading normal leans by 60° toward +x; the lamp stands on that side but below the surface, where
/// the leaning normal still sees it. The true surface does not.
#[test]
fn light_from_below_does_not_leak_through_a_leaning_shading_normal() {
    let lamps = [
        "lights: [{point: {position: [4, -0.5, 0], intensity: 10}}]".to_owned(),
        "lights: [{directional: {direction: [-1, 0.1, 0], irradiance: 3}}]".to_owned(),
        format!("- sphere: {{center: [8, -2, 0], radius: 1.5, {LAMP}}}"),
        format!("- rectangle: {{corner: [-50, -0.5, 50], edge_u: [100, 0, 0], edge_v: [0, 0, -100], {LAMP}}}"),
    ];
    for lamp in &lamps {
        for material in [
            "{diffuse: {reflectance: 1}}",
            "{conductor: {eta: 0, k: 1, roughness: 0.5}}",
            "{plastic: {roughness: 0.4}}",
        ] {
            for integrator in ["path", "{whitted: {}}"] {
                let scene = leaning(60.0, material, &format!("{lamp}\nintegrator: {integrator}"));
                let found = scene.estimate(&ray(v(1.0, 2.0, 0.1), v(0.0, 0.0, 0.0)), 1024);
                assert_eq!((found.mean, found.error), (0.0, 0.0), "{integrator} {material} {lamp}");
            }
        }
    }
}

/// Seen from below through a one-sided surface there is nothing; two-sided, the back is lit by what is
/// below it only.
#[test]
fn the_back_of_a_surface_sees_the_light_behind_it_only() {
    for integrator in ["path", "{whitted: {}}"] {
        for (two_sided, height, lit) in
            [(true, -3.0, true), (true, 3.0, false), (false, -3.0, false), (false, 3.0, false)]
        {
            let scene = bench(&format!(
                "integrator: {integrator}\nlights: [{{point: {{position: [0, {height}, 0], intensity: 9}}}}]\nshapes:\n\
                 - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.5, two_sided: {two_sided}}}}}}}\n"
            ));
            let found = scene.look(v(1.0, -1.0, 0.0), DVec3::ZERO);
            let expected = if lit { 0.5 / std::f64::consts::PI } else { 0.0 };
            assert!((found - expected).abs() < 1e-6, "{integrator} {two_sided} {height}: {expected}, found {found}");
        }
    }
}

/// Case O18: a dark room far from the origin, with light a million times brighter outside. Nothing
/// comes in along its edges.
#[test]
fn no_light_leaks_into_a_closed_room() {
    let c = 1e4;
    let (l, h) = (c - 1.0, c + 1.0);
    let walls = [
        format!("corner: [{l}, {l}, {l}], edge_u: [0, 0, 2], edge_v: [2, 0, 0]"),
        format!("corner: [{l}, {h}, {l}], edge_u: [2, 0, 0], edge_v: [0, 0, 2]"),
        format!("corner: [{l}, {l}, {l}], edge_u: [2, 0, 0], edge_v: [0, 2, 0]"),
        format!("corner: [{l}, {l}, {h}], edge_u: [0, 2, 0], edge_v: [2, 0, 0]"),
        format!("corner: [{l}, {l}, {l}], edge_u: [0, 2, 0], edge_v: [0, 0, 2]"),
        format!("corner: [{h}, {l}, {l}], edge_u: [0, 0, 2], edge_v: [0, 2, 0]"),
    ];
    let walls: String =
        walls.iter().map(|w| format!("- rectangle: {{{w}, material: {{diffuse: {{reflectance: 0.9}}}}}}\n")).collect();
    let text = format!(
        "camera: {{origin: [{}, {c}, {c}], target: [{h}, {}, {}], fov_deg: 120}}\nimage: {{width: 16, height: 16}}\n\
         render: {{samples: 8}}\nlights: [{{constant: {{radiance: 1e6}}}}]\nshapes:\n{walls}",
        c - 0.5,
        c + 0.1,
        c + 0.2
    );
    bench_with(&text, &[]).grey().picture().assert_all(0.0, 0.0);
}
