//! Light on a floor, from every kind of lamp, against the closed form.

use super::LAMP;
use super::common::{Bench, assert_close, bench, bench_with, ray, v};
use abbe::math::sampler::Sampler;
use abbe::math::statistics::Moments;
use abbe::scene::light::Light;
use abbe::spectrum::{LANES, Lanes, SampledWavelengths};
use std::f64::consts::PI;

/// A floor y = 0 of albedo 0.6 under `lights` and before further `shapes` (lines of a list).
fn floor(integrator: &str, lights: &str, shapes: &str) -> Bench {
    bench(&format!(
        "integrator: {integrator}\nlights: {lights}\nshapes:\n\
         - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n{shapes}\n"
    ))
}

const INTEGRATORS: [&str; 2] = ["path", "{whitted: {}}"];

/// E = I cos θ / d²: at (0, 3, 4) the lamp is 5 away and cos θ = 3/5.
#[test]
fn a_point_lights_a_floor_by_the_inverse_square() {
    for integrator in INTEGRATORS {
        let scene = floor(integrator, "[{point: {position: [0, 3, 4], intensity: 50}}]", "");
        let expected = 0.6 / PI * 50.0 * 0.6 / 25.0;
        assert_close(scene.look(v(1.0, 1.0, 1.0), v(0.0, 0.0, 0.0)), expected, 1e-6);
    }
}

/// Full within the beam, linear in the angle to the cutoff, nothing beyond. The lamp is 2 above the
/// floor and points down, so the angle at distance x is atan(x/2) and d² = 4 + x², cos θ = 2/d.
#[test]
fn a_spot_lights_a_floor_by_its_cone() {
    for integrator in INTEGRATORS {
        let lamp = "[{spot: {position: [0, 2, 0], direction: [0, -1, 0], beam_deg: 20, cutoff_deg: 30, intensity: 7}}]";
        let scene = floor(integrator, lamp, "");
        for (deg, factor) in [(0.0f64, 1.0), (19.0, 1.0), (25.0, 0.5), (29.0, 0.1), (31.0, 0.0), (60.0, 0.0)] {
            let x = 2.0 * deg.to_radians().tan();
            let d = (4.0 + x * x).sqrt();
            let expected = 0.6 / PI * 7.0 * factor / (d * d) * 2.0 / d;
            let found = scene.look(v(x, 1.0, 3.0), v(x, 0.0, 0.0));
            // Near the cutoff the factor is a difference of angles good to 1e-15, a tenth of a beam wide.
            assert!((found - expected).abs() < 1e-6 * (expected + 0.01), "{deg}°: expected {expected}, found {found}");
        }
    }
}

/// E = E⊥ cos θ.
#[test]
fn the_sun_lights_a_floor_by_the_cosine() {
    for integrator in INTEGRATORS {
        for deg in [0.0f64, 60.0, 89.0, 89.99] {
            let (sin, cos) = deg.to_radians().sin_cos();
            let sun = format!("[{{directional: {{direction: [{sin}, -{cos}, 0], irradiance: 3}}}}]");
            let scene = floor(integrator, &sun, "");
            let found = scene.look(v(0.5, 1.0, 3.0), v(0.0, 0.0, 0.0));
            // The direction is normalised in f64; cos 89.99° = 1.7e-4 keeps 12 digits.
            assert_close(found, 0.6 / PI * 3.0 * cos, 2e-6);
        }
        // From below, nothing.
        let scene = floor(integrator, "[{directional: {direction: [0, 1, 0], irradiance: 3}}]", "");
        assert_eq!(scene.look(v(0.5, 1.0, 3.0), v(0.0, 0.0, 0.0)), 0.0);
    }
}

/// Of a disc wholly above the horizon the irradiance of a tilted surface is E cos θ of its middle, whatever its width: ∫ ω dω
/// over a cone lies along its axis. Behind a wall that hides the half of it that is farther from the zenith, with its edge
/// through the middle, half is left but for the cosine: of a disc at the zenith exactly half.
#[test]
fn a_wide_sun_lights_a_floor_by_the_cosine_and_has_half_shadows() {
    let found = |sun: &str, shapes: &str| {
        let scene = floor("path", sun, shapes);
        scene.estimate_of(&ray(v(0.0, 1.0, 3.0), v(0.0, 0.0, 0.0)), 1 << 15, |light, _| {
            f64::from(light.radiance.reduce_add()) / LANES as f64
        })
    };
    for (elevation, angle) in [(90.0f64, 0.5), (40.0, 30.0), (60.0, 1e-3)] {
        let (sin, cos) = elevation.to_radians().sin_cos();
        let sun = format!("[{{directional: {{direction: [{cos}, -{sin}, 0], irradiance: 3, angle_deg: {angle}}}}}]");
        let light = found(&sun, "");
        let expected = 0.6 / PI * 3.0 * sin;
        assert!((light.mean - expected).abs() < 4.0 * light.error + 1e-6, "{elevation}: {} {expected}", light.mean);
        assert!(light.error < 0.01 * expected);
    }
    let sun = "[{directional: {direction: [0, -1, 0], irradiance: 3, angle_deg: 2}}]";
    let roof = "- rectangle: {corner: [0, 2, -5], edge_u: [5, 0, 0], edge_v: [0, 0, 10], material: {diffuse: {reflectance: 0}}}";
    let half = found(sun, roof);
    assert!((half.mean - 0.3 / PI * 3.0).abs() < 4.0 * half.error, "{}", half.mean);
}

/// E = ∫ L cos θ dω over the sky, by the midpoint rule over bands of equal solid angle, and that of the sun. The rule of 256 by 512
/// misses what a smooth sky turns within a step, 1e-4; the estimate is within four standard errors. `whitted` has the sun alone.
#[test]
fn a_floor_under_a_sky_has_the_light_of_sky_and_sun() {
    let sky = "[{sky: {sun: {elevation_deg: 30, azimuth_deg: 70}, turbidity: 4}}]";
    let scene = floor("path", sky, "");
    let Light::Environment(map) = &scene.prepared.scene.lights[0] else { panic!("a sky") };
    let (direction, _) = map.sun(Lanes::splat(550.0)).expect("a sun");
    let nm = Lanes::new([380.0, 420.0, 460.0, 500.0, 550.0, 600.0, 650.0, 700.0]);
    let (rows, columns) = (256, 512);
    let mut irradiance = map.sun(nm).expect("a sun").1.to_array().map(|e| f64::from(e) * direction.y);
    let sun = irradiance;
    for row in 0..rows {
        let cos = (f64::from(row) + 0.5) / f64::from(rows);
        let sin = (1.0 - cos * cos).sqrt();
        for column in 0..columns {
            let (s, c) = (2.0 * PI * (f64::from(column) + 0.5) / f64::from(columns)).sin_cos();
            let toward = v(sin * s, cos, sin * c);
            // The disc is narrower than a cell: the sky alone.
            if toward.dot(direction) < 0.9999 {
                let light = map.radiance(toward, nm).to_array();
                let weight = 2.0 * PI * cos / f64::from(rows * columns);
                irradiance.iter_mut().zip(light).for_each(|(e, l)| *e += f64::from(l) * weight);
            }
        }
    }
    for lane in 0..LANES {
        let only = SampledWavelengths {
            nm: Lanes::splat(nm.to_array()[lane]),
            ..scene.prepared.scene.wavelengths.sample(0.5)
        };
        let looks = ray(v(1.0, 1.0, 1.0), v(0.0, 0.0, 0.0));
        let mut found = Moments::default();
        for index in 0..8192 {
            let sampler = Sampler::new(7, [3, 5], index, 0);
            let light = scene.incoming(&looks, &only, &sampler).radiance.to_array()[0];
            found.push(f64::from(light));
        }
        let expected = 0.6 / PI * irradiance[lane];
        let scatter = found.standard_error();
        assert!((found.mean - expected).abs() < 4.0 * scatter + 1e-3 * expected, "{} {expected} {scatter}", found.mean);
        assert!(scatter < 0.02 * expected, "{scatter}");
        let whitted = floor("{whitted: {}}", sky, "");
        let light = whitted.incoming(&looks, &only, &Sampler::new(7, [3, 5], 0, 0)).radiance.to_array()[0];
        assert_close(f64::from(light), 0.6 / PI * sun[lane], 1e-6);
    }
}

/// Case O17 in the small: a floor of many triangles under a sun 0.01° above the horizon has no
/// dark or bright pixel, E = cos 89.99° everywhere.
#[test]
fn a_flat_mesh_under_a_low_sun_is_even() {
    let n = 40;
    let mut obj = String::new();
    for i in 0..=n {
        for j in 0..=n {
            obj += &format!("v {} 0 {}\n", 0.1 * f64::from(i) - 2.0, 0.1 * f64::from(j) - 2.0);
        }
    }
    for i in 0..n {
        for j in 0..n {
            let a = i * (n + 1) + j + 1;
            obj += &format!("f {a} {} {}\nf {} {} {}\n", a + 1, a + n + 2, a, a + n + 2, a + n + 1);
        }
    }
    let (sin, cos) = 89.99f64.to_radians().sin_cos();
    let text = format!(
        "camera: {{origin: [0, 3, 0.1], target: [0, 0, 0], fov_deg: 50}}\nimage: {{width: 24, height: 24}}\n\
         render: {{samples: 4}}\nlights: [{{directional: {{direction: [{sin}, -{cos}, 0.0], irradiance: 1000}}}}]\n\
         shapes: [{{mesh: {{file: floor.obj, material: {{diffuse: {{reflectance: 1}}}}}}}}]\n"
    );
    let scene = super::common::bench_with(&text, &[("floor.obj", obj.as_bytes())]).grey();
    let expected = 1000.0 * cos / PI;
    scene.picture().assert_all(expected, 1e-5 * expected);
}

/// The share of what leaves a point's hemisphere (by the cosine) that meets a parallel rectangle with one
/// corner straight above: sides a and b, height c, A = a/c, B = b/c (Siegel and Howell, configuration
/// C-11): F = (A/√(1+A²) atan(B/√(1+A²)) + B/√(1+B²) atan(A/√(1+B²))) / 2π.
fn corner_form_factor(a: f64, b: f64, c: f64) -> f64 {
    let (a, b) = (a / c, b / c);
    let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / ra * (b / ra).atan() + b / rb * (a / rb).atan()) / (2.0 * PI)
}

/// L = ρ F · 1 under a lamp of radiance 1; a lamp that reaches over the point is four corners, one beside
/// it a difference of two.
#[test]
fn a_rectangle_lights_a_floor_by_its_form_factor() {
    let lamp = format!("- rectangle: {{corner: [-1, 2, -1], edge_u: [3, 0, 0], edge_v: [0, 0, 2], {LAMP}}}");
    let scene = floor("path", "[]", &lamp);
    let above = [(1.0, 1.0), (1.0, 1.0), (2.0, 1.0), (2.0, 1.0)];
    let f: f64 = above.iter().map(|&(a, b)| corner_form_factor(a, b, 2.0)).sum();
    scene.estimate(&ray(v(3.0, 1.0, 4.0), v(0.0, 0.0, 0.0)), 8192).assert_is(0.6 * f, 2e-3);
    // From x = 3 the lamp lies from 1 to 4 aside.
    let f = 2.0 * (corner_form_factor(4.0, 1.0, 2.0) - corner_form_factor(1.0, 1.0, 2.0));
    scene.estimate(&ray(v(3.0, 1.0, 4.0), v(3.0, 0.0, 0.0)), 8192).assert_is(0.6 * f, 2e-3);
}

/// A disc of radius r at height h straight above: F = r²/(r² + h²).
#[test]
fn a_disc_lights_a_floor_by_its_form_factor() {
    for (r, h) in [(1.0, 1.0), (0.1, 1.0), (5.0, 0.5)] {
        let lamp = format!("- disk: {{center: [0, {h}, 0], normal: [0, -1, 0], radius: {r}, {LAMP}}}");
        let scene = floor("path", "[]", &lamp);
        let from = v(0.0, 0.2 * h, 0.3 * h);
        scene.estimate(&ray(from, v(0.0, 0.0, 0.0)), 8192).assert_is(0.6 * r * r / (r * r + h * h), 2e-3);
    }
}

/// A sphere wholly above the horizon, at any distance: F = (r/d)² cos θ (its cone's projected solid angle
/// over π). Case O26: down to r/d = 10⁻⁴, where 1 − cos has no digits left in f32.
#[test]
fn a_sphere_lights_a_floor_at_every_distance() {
    for s in [0.9, 0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-6] {
        // At s = 0.9 the lamp stands straight above, else 60° from the normal.
        let (x, y) = if s > 0.4 { (0.0, 1.0) } else { (0.75f64.sqrt(), 0.5) };
        let lamp = format!("- sphere: {{center: [{x}, {y}, 0], radius: {s}, {LAMP}}}");
        let scene = floor("path", "[]", &lamp);
        let found = scene.estimate(&ray(v(0.0, 0.05, 0.3), v(0.0, 0.0, 0.0)), 8192);
        found.assert_is(0.6 * s * s * y, 2e-3);
    }
}

/// The recursive tracer has one ray to a ball, along its axis: ∫ ω dω over a cone lies there, π sin² long, so that one ray is all of
/// the light as long as the ball stands above the horizon.
#[test]
fn whitted_lights_by_all_of_a_ball_at_any_distance() {
    for s in [0.9, 0.5, 0.1, 1e-3, 1e-6] {
        let (x, y) = if s > 0.4 { (0.0, 1.0) } else { (0.75f64.sqrt(), 0.5) };
        let lamp = format!("- sphere: {{center: [{x}, {y}, 0], radius: {s}, {LAMP}}}");
        let found = floor("{whitted: {}}", "[]", &lamp).look(v(0.0, 0.05, 0.3), v(0.0, 0.0, 0.0));
        // Five roundings to f32.
        assert_close(found, 0.6 * s * s * y, 5.0 * f64::from(f32::EPSILON));
    }
}

/// A matt disc in the middle of a lamp that shines inward has an upper half space of radiance 1, whatever the form: E = π. Of points
/// of a ball the cosine, none below, has the mean 1/4 and the mean square 1/6, so that 60 random ones give it to
/// √(1/6 − 1/16) / (1/4 √60) = 0.17 of itself; evenly spread ones shall be four times as good, in what is less round, too.
#[test]
fn whitted_lights_the_inside_of_a_lamp() {
    let mut ball = String::new();
    let (rows, columns) = (24, 48);
    for i in 0..=rows {
        let theta = PI * f64::from(i) / f64::from(rows);
        for j in 0..columns {
            let phi = 2.0 * PI * f64::from(j) / f64::from(columns);
            ball += &format!("v {} {} {}\n", theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        }
    }
    for i in 0..rows {
        for j in 0..columns {
            let at = |i: i32, j: i32| i * columns + j % columns + 1;
            // Facing inward.
            ball += &format!("f {} {} {} {}\n", at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        }
    }
    let lamps = [
        "sphere: {radius: 2, flip_normals: true",
        "cube: {size: 4, flip_normals: true",
        "cylinder: {base: [0, -2, 0], top: [0, 2, 0], radius: 2, flip_normals: true",
        "mesh: {file: ball.obj, transform: [{scale: 2}]",
    ];
    for lamp in lamps {
        let text = format!(
            "{}integrator: {{whitted: {{}}}}\nshapes:\n\
             - disk: {{normal: [0, 1, 0], radius: 0.4, material: {{diffuse: {{reflectance: 0.6}}}}}}\n- {lamp}, {LAMP}}}\n",
            super::common::CAMERA
        );
        let scene = super::common::bench_with(&text, &[("ball.obj", ball.as_bytes())]);
        assert_close(scene.look(v(0.1, 0.5, 0.3), v(0.0, 0.0, 0.0)), 0.6, 0.042);
    }
}

/// A sheet that scatters to both sides, seen and lit along its normal from either: of Burley's diffuse lobe there is Lambert's
/// share/π, of what does not cross on the one side and of what does on the other.
#[test]
fn thin_principled_sheets_scatter_light_to_both_sides() {
    for crossing in [0.0, 0.5, 2.0] {
        for (seen, lit) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let text = |integrator: &str| {
                bench(&format!(
                    "integrator: {integrator}\nlights: [{{directional: {{direction: [0, 0, {}], irradiance: 3}}}}]\nshapes:\n\
                     - rectangle: {{corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], material: {{principled_thin: \
                       {{base_color: 0.5, roughness: 0.5, diff_trans: {crossing}}}}}}}\n",
                    -lit
                ))
            };
            let share = if seen == lit { 1.0 - 0.5 * crossing } else { 0.5 * crossing };
            for integrator in INTEGRATORS {
                let found = text(integrator).look(v(0.1, 0.1, 5.0 * seen), v(0.1, 0.1, 0.0));
                // Roundings to f32.
                let expected = 0.5 * share / PI * 3.0;
                assert!((found - expected).abs() < 1e-6, "{integrator} {crossing} {seen} {lit}: {expected} {found}");
            }
        }
    }
    // Light from everywhere comes from both sides.
    let sheet = bench(
        "integrator: {whitted: {ambient: 1}}\nshapes:\n- rectangle: {corner: [-1, -1, 0], edge_u: [2, 0, 0], \
         edge_v: [0, 2, 0], material: {principled_thin: {base_color: 0.5, diff_trans: 0.5}}}\n",
    );
    assert_close(sheet.look(v(0.1, 0.1, -5.0), v(0.1, 0.1, 0.0)), 0.5, 1e-6);
}

/// A black surface under the coat of `principled` in a white sky, looked at along its normal: 0.04 of a mirror, and of the lobe
/// itself less, as the third of its facets that lean by more than 6° (those of a gloss of 1) send light where it counts less.
#[test]
fn whitted_shows_the_coat_of_principled() {
    let scene = |integrator: &str, strength: f64| {
        bench(&format!(
            "integrator: {integrator}\nlights: [{{constant: {{radiance: 1}}}}]\nshapes:\n\
             - rectangle: {{corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], material: {{principled: \
               {{base_color: 0, specular: 0, clearcoat: {strength}, clearcoat_gloss: 1}}}}}}\n"
        ))
    };
    let (from, to) = (v(0.0, 0.0, 5.0), v(0.0, 0.0, 0.0));
    for strength in [0.0, 0.5, 1.0] {
        let found = scene("{whitted: {}}", strength).look(from, to);
        assert!((found - 0.04 * strength).abs() < 1e-7, "{strength}: {found}");
    }
    let lobe = scene("path", 1.0).estimate(&ray(from, to), 8192);
    assert!(lobe.mean > 0.8 * 0.04 && lobe.mean < 0.04 && lobe.error < 1e-3, "{lobe:?}");
}

/// From far away a lamp of radiance 1 is a point whose intensity is its projected area, whatever its form:
/// a wrong area, density or choice of faces shows.
#[test]
fn every_shape_lights_a_far_floor_by_its_projected_area() {
    let far = 1000.0;
    let lamps = [
        // Seen from straight below.
        (format!("cylinder: {{base: [0, {far}, 0], top: [0, {}, 0], radius: 0.5, {LAMP}}}", far + 1.0), PI * 0.25),
        (format!("cylinder: {{base: [-1, {far}, 0], top: [1, {far}, 0], radius: 0.5, {LAMP}}}"), 2.0),
        (format!("cone: {{base: [0, {far}, 0], apex: [0, {}, 0], radius: 0.5, {LAMP}}}", far + 1.0), PI * 0.25),
        (format!("cone: {{base: [0, {}, 0], apex: [0, {far}, 0], radius: 0.5, {LAMP}}}", far + 1.0), PI * 0.25),
        (format!("cube: {{center: [0, {far}, 0], size: [1, 2, 3], {LAMP}}}"), 3.0),
        (
            format!(
                "cube: {{size: 1, {LAMP}, transform: [{{rotate: {{axis: [0, 0, 1], deg: 45}}}}, {{translate: [0, {far}, 0]}}]}}"
            ),
            2f64.sqrt(),
        ),
    ];
    for (lamp, area) in lamps {
        let expected = 0.6 / PI * area / (far * far);
        let (from, to) = (v(0.0, 1.0, 1.0), v(0.0, 0.0, 0.0));
        // Corrections are of the order of size over distance.
        let found = floor("path", "[]", &format!("- {lamp}")).estimate(&ray(from, to), 4096);
        assert!(
            (found.mean / expected - 1.0).abs() < 4.0 * found.error / expected + 3e-3,
            "{lamp}: {expected} {found:?}"
        );
        assert!(found.error < 0.02 * expected, "{lamp}: {found:?}");
        // The middles of 60 rows of a cosine over half a turn miss its mean by (π/60)²/24 of itself.
        assert_close(floor("{whitted: {}}", "[]", &format!("- {lamp}")).look(from, to), expected, 3e-3);
    }
}

/// A lamp of triangles is the same lamp: the disc above, as a fan.
#[test]
fn a_mesh_lights_a_floor_as_its_form_does() {
    let n = 64;
    let mut obj = String::from("v 0 1 0\n");
    for i in 0..n {
        let phi = 2.0 * PI * f64::from(i) / f64::from(n);
        obj += &format!("v {} 1 {}\n", phi.cos(), phi.sin());
    }
    for i in 0..n {
        // Facing down.
        obj += &format!("f 1 {} {}\n", i + 2, (i + 1) % n + 2);
    }
    let scene = |integrator: &str| {
        let text = format!(
            "{}integrator: {integrator}\nshapes:\n- plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
             - mesh: {{file: disc.obj, {LAMP}}}\n",
            super::common::CAMERA
        );
        super::common::bench_with(&text, &[("disc.obj", obj.as_bytes())])
    };
    // A regular polygon: n triangles between the middle and an edge at distance a = cos(π/n), each with
    // F = (a/√(a²+h²)) atan(tan(π/n) a / √(a²+h²)) / π.
    let a = (PI / f64::from(n)).cos();
    let root = (a * a + 1.0).sqrt();
    let f = f64::from(n) / PI * a / root * ((PI / f64::from(n)).tan() * a / root).atan();
    let (from, to) = (v(0.0, 0.2, 0.3), v(0.0, 0.0, 0.0));
    scene("path").estimate(&ray(from, to), 8192).assert_is(0.6 * f, 2e-3);
    // With the distance r from its middle a point of the disc gives 1/(1 + r²)², of mean 1/2 and mean square 7/24: of 60 random ones
    // the mean is good to √(1/6) / √60 = 0.053 of itself. Those of `whitted`, of which one number says in which triangle and where
    // in it, shall be twice as good.
    assert_close(scene("{whitted: {}}").look(from, to), 0.6 * f, 0.027);
}

/// Two lamps add, and a lamp behind a wall does not.
#[test]
fn lights_add_and_walls_hide_them() {
    for integrator in INTEGRATORS {
        let two = "[{point: {position: [0, 2, 0], intensity: 4}}, {point: {position: [0, 1, 0], intensity: 3}}]";
        let scene = floor(integrator, two, "");
        let (from, to) = (v(1.0, 1.0, 1.0), v(0.0, 0.0, 0.0));
        let expected = 0.6 / PI * (1.0 + 3.0);
        if integrator == "path" {
            scene.estimate(&ray(from, to), 4096).assert_is(expected, 5e-3);
        } else {
            assert_close(scene.look(from, to), expected, 1e-6);
        }
        let wall =
            "- disk: {center: [0, 1.5, 0], normal: [0, 1, 0], radius: 0.2, material: {diffuse: {reflectance: 0}}}";
        let scene = floor(integrator, two, wall);
        let expected = 0.6 / PI * 3.0;
        if integrator == "path" {
            scene.estimate(&ray(from, to), 4096).assert_is(expected, 2e-2);
        } else {
            assert_close(scene.look(from, to), expected, 1e-6);
        }
    }
}

/// Inside a glowing closed shape of albedo ρ the light is L / (1 − ρ) in every direction: each bounce sees walls all
/// around. Outside it is dark but for what the outer wall reflects of nothing.
#[test]
fn a_shape_that_shines_inward_lights_its_inside_alone() {
    let forms = [
        "sphere: {radius: 1",
        "cube: {size: 2",
        "cylinder: {base: [0, -1, 0], top: [0, 1, 0], radius: 1",
        "cone: {base: [0, -1, 0], apex: [0, 2, 0], radius: 2",
    ];
    for form in forms {
        let scene = bench(&format!(
            "integrator: {{path: {{max_depth: 40}}}}\nshapes:\n\
             - {form}, flip_normals: true, emission: 1, material: {{diffuse: {{reflectance: 0.5}}}}}}\n\
             - rectangle: {{corner: [-9, -5, 9], edge_u: [18, 0, 0], edge_v: [0, 0, -18]}}\n"
        ))
        .grey();
        // The forty-first segment would bring 2⁻⁴⁰.
        scene.estimate(&ray(v(0.1, 0.2, 0.3), v(0.5, 0.3, -2.0)), 16_384).assert_is(2.0, 5e-3);
        assert_eq!(scene.estimate(&ray(v(3.0, 0.0, 5.0), v(3.0, -5.0, 0.0)), 500).mean, 0.0, "{form}");
    }
}

/// A lamp hangs exactly on a black ceiling, or the last place before it: the floor is lit as without the ceiling, but for the
/// step off the surface. A ceiling that rounding lets hide the lamp, for any shape and either integrator, leaves it black or
/// salted; the corner of a cube has three of them.
#[test]
fn lamps_on_surfaces_shine_as_without_them() {
    const CEILINGS: [&str; 7] = [
        "rectangle: {corner: [-2, 2, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: black}",
        "plane: {point: [0, 2, 0], normal: [0, 1, 0], material: black}",
        "disk: {center: [0, 2, 0], normal: [0.01, 1, 0.02], radius: 1, material: black}",
        "cube: {center: [1, 3, -1], size: 2, material: black}",
        "sphere: {center: [0, 3, 0], radius: 1, material: black}",
        "cylinder: {base: [-1, 2.3, 0], top: [1, 2.3, 0], radius: 0.3, material: black}",
        "cone: {base: [0, 2, 0.1], apex: [0, 3, 0.1], radius: 0.5, material: black}",
    ];
    const LAMPS: [&str; 3] = [
        "point: {position: [0, Y, 0], intensity: 10}",
        "spot: {position: [0, Y, 0], target: [0.2, 0, 0.1], cutoff_deg: 50, intensity: 10}",
        "projector: {origin: [0, Y, 0], target: [0.2, 0, 0.1], up: [1, 0, 0], fov_deg: 60, irradiance: 10}",
    ];
    let picture = |integrator: &str, lamp: &str, y: f64, ceiling: &str| {
        let lamp = lamp.replace('Y', &y.to_string());
        let scene = format!(
            "camera: {{origin: [0, 1, 3.5], target: [0, 0.5, 0], fov_deg: 40}}\nimage: {{width: 8, height: 8}}\n\
             render: {{samples: 16}}\nintegrator: {integrator}\nlights: [{lamp}]\n\
             materials: {{black: {{diffuse: {{reflectance: 0}}}}}}\nshapes:\n\
             - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n{ceiling}\n"
        );
        bench_with(&scene, &[]).picture().y
    };
    for (integrator, lamps) in [("path", &LAMPS[..]), ("{whitted: {}}", &LAMPS), ("{light_tracer: {}}", &LAMPS[..1])] {
        for lamp in lamps {
            for y in [2.0, 2.0 - 2f64.powi(-47)] {
                let free = picture(integrator, lamp, y, "");
                for ceiling in CEILINGS {
                    let found = picture(integrator, lamp, y, &format!("- {ceiling}"));
                    // What differs is a step of 2⁻³³ of some metres, and the roundings of f32.
                    let off = |(a, b): (&f64, &f64)| (a - b).abs() / b.max(1e-3);
                    let worst = found.iter().zip(&free).map(off).fold(0.0, f64::max);
                    assert!(worst < 1e-5, "{integrator}, {lamp} at {y}, {ceiling}: {worst}");
                }
            }
        }
    }
}

/// An eye exactly on the surface of a body: all rays leave at once, and none is in the body that looks away from it; where
/// it looks inward each sees what the way through the body leaves of a white sky, exp(−d) with d from 4 to 4.5 metres.
#[test]
fn an_eye_on_a_surface_stands_beside_it() {
    let look = |within: &str, eye: &str, body: &str| {
        let scene = format!(
            "camera: {{{eye}, fov_deg: 30}}\nimage: {{width: 16, height: 16}}\n\
             render: {{samples: 4}}\nlights: [{{constant: {{radiance: 1}}}}]\nintegrator: {{path: {{roulette_depth: 1000}}}}\n\
             media: {{smoke: {{homogeneous: {{absorption: 1}}}}}}\nmaterials: {{glass: {{dielectric: {{ior: 1.5}}}}}}\n\
             {within}\nshapes:\n{body}\n"
        );
        bench_with(&scene, &[]).picture().y
    };
    let away = [
        "sphere: {center: [0, -1, 0], radius: 1, material: glass}",
        "cube: {center: [0.1, -1, 0.3], size: 2, material: glass}",
        "cylinder: {base: [-1, -0.3, 0], top: [1, -0.3, 0], radius: 0.3, material: glass}",
        "cone: {base: [0, 0, 0.1], apex: [0, -1, 0.1], radius: 0.5, material: glass}",
        "rectangle: {corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4], material: glass}",
    ];
    // Out of the way of all that is looked at, so that there is one.
    const FAR: &str = "- sphere: {center: [0, -9, 0], radius: 1, material: glass}";
    // Straight up, so that the least of all rays goes up by the sine of 69°.
    let up = "origin: [0, 0, 0], target: [0, 1, 0.2]";
    let free = look("", up, FAR);
    for body in away {
        assert_eq!(look("", up, &format!("- {body}")), free, "{body}");
    }
    let smoke = "- cube: {size: 4, material: {boundary: {}}, inside: smoke, outside: vacuum}";
    let inward = "origin: [0.1, 0.2, 2], target: [0.1, 0.2, 0]";
    for (dim, bright) in look("medium: smoke", inward, smoke).iter().zip(look("", inward, FAR)) {
        // The roundings of f32.
        let bounds = (-4.5f64).exp()..(-4f64).exp() * (1.0 + 1e-5);
        assert!(bounds.contains(&(dim / bright)), "{dim} of {bright}");
    }
}

/// A black plane through the eye, behind all that it sees, changes nothing about light that is traced into the camera.
#[test]
fn a_wall_in_the_plane_of_the_camera_hides_no_caustic() {
    let scene = |wall: &str| {
        bench_with(
            &format!(
                "camera: {{origin: [0, 1, 3.5], target: [0, 0, 0], fov_deg: 40}}\nimage: {{width: 16, height: 16}}\n\
             render: {{samples: 64}}\nlights: [{{point: {{position: [0.5, 2, 0.5], intensity: 10}}}}]\nshapes:\n\
             - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
             - sphere: {{center: [0, 0.6, 0], radius: 0.5, material: {{dielectric: {{ior: 1.5}}}}}}\n{wall}\n"
            ),
            &[],
        )
    };
    let [free, walled] =
        ["", "- plane: {point: [0, 0, 3.5], normal: [0, 0, 1], material: {diffuse: {reflectance: 0}}}"].map(scene);
    for scene in [&free, &walled] {
        assert!(scene.prepared.plan.caustics.is_some());
    }
    walled.picture().mean().assert_agrees(&free.picture().mean(), 0.01);
}

/// The film follows the brightness of the lamps. A black frame about the picture of one, and a picture that is black but for one texel, were
/// taken for lamps without light: every sample was then beyond what the film holds.
#[test]
fn a_lamp_may_have_a_black_frame() {
    let mut framed = image::GrayImage::from_pixel(64, 64, image::Luma([180]));
    let mut dot = image::GrayImage::new(64, 64);
    for i in 0..64 {
        [(i, 0), (i, 63), (0, i), (63, i)].into_iter().for_each(|(x, y)| framed.put_pixel(x, y, image::Luma([0])));
    }
    dot.put_pixel(20, 40, image::Luma([180]));
    // sRGB decoded.
    let grey = ((180.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
    for (picture, share) in [(framed, (62.0 / 64.0_f64).powi(2)), (dot, 1.0 / 4096.0)] {
        let mut png = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let scene = "camera: {origin: [0, 0, 5], target: [0, 0, 0], orthographic_height: 1}\nimage: {width: 8, height: 8}\n\
                     render: {samples: 1024}\ntextures: {t: {image: {file: t.png, filter: nearest, illuminant: E}}}\n\
                     shapes: [rectangle: {corner: [-0.5, -0.5, 0], edge_u: [1, 0, 0], edge_v: [0, 1, 0], emission: {texture: t}}]\n";
        let seen = bench_with(scene, &[("t.png", png.get_ref())]).grey().picture();
        let mean = seen.mean();
        assert_eq!(seen.invalid, 0);
        assert!(
            (mean.mean - share * grey).abs() < 4.5 * mean.error + 2e-3 * share * grey,
            "{mean:?} for {}",
            share * grey
        );
    }
}

/// A card over a floor, black, with other holes on its two sides: 0.8 of it as seen from above, 0.1 from below. To a floor that is lit
/// through it, and seen below it, it is what it is from there, so that with E = π and ρ = 1 there is light of 0.1. Where the floor is
/// lit aslant, below the card, it is seen from above through the holes that are there: 0.8 cos 45°.
#[test]
fn holes_of_a_card_are_those_of_the_side_that_is_seen() {
    let card = "material: {two_sided: {front: {mask: {opacity: 0.2, material: {diffuse: {reflectance: 0}}}}, \
        back: {mask: {opacity: 0.9, material: {diffuse: {reflectance: 0}}}}}}";
    for (eye, fov, light, expected) in [(0.5, 20.0, "[0, -1, 0]", 0.1), (1.5, 6.7, "[1, -1, 0]", 0.8 * 0.5f64.sqrt())] {
        for integrator in ["path: {max_depth: 2}", "light_tracer: {max_depth: 2}"] {
            let scene = format!(
                "camera: {{origin: [0, {eye}, 0], target: [0, 0, 0], up: [0, 0, 1], fov_deg: {fov}}}\n\
                 image: {{width: 8, height: 8}}\nrender: {{samples: 16384}}\nintegrator: {{{integrator}}}\n\
                 lights: [{{directional: {{direction: {light}, irradiance: 3.14159265}}}}]\nshapes:\n\
                 - rectangle: {{corner: [-0.1, 0, 0.1], edge_u: [0.2, 0, 0], edge_v: [0, 0, -0.2], \
                   material: {{diffuse: {{reflectance: 1}}}}}}\n\
                 - rectangle: {{corner: [-0.25, 1, 0.25], edge_u: [0.5, 0, 0], edge_v: [0, 0, -0.5], {card}}}\n"
            );
            bench_with(&scene, &[]).grey().picture().mean().assert_is(expected, 0.05);
        }
    }
}
