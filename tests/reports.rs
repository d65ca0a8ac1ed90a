//! What two well-known reports on student ray tracers list as faults, each held right here: seen through
//! pixels, or through the light along one ray.

mod common;

use abbe::math::Ray;
use common::{Bench, CAMERA, assert_close, bench, bench_with, grey_png, ray, v};
use glam::DVec3;
use std::f64::consts::PI;

const INTEGRATORS: [&str; 2] = ["path", "{whitted: {}}"];

/// A surface that shines on its outside and reflects nothing.
const LAMP: &str = "emission: 1, material: {diffuse: {reflectance: 0}}";

/// A grey surface lit by ambient light of 1: `whitted` shows its reflectance, whatever its normal.
const AMBIENT: &str = "integrator: {whitted: {grid: 1, ambient: 1}}";

/// Whether the shapes are met along a ray parallel to z at (x, y).
fn met(bench: &Bench, x: f64, y: f64) -> bool {
    bench.look(v(x, y, 5.0), v(x, y, 0.0)) > 0.5
}

/// "if (abs(delta) < 0.001) return -1": at 10⁻⁴ and 10⁻¹² from the rim the discriminants are 2·10⁻⁴ and
/// 2·10⁻¹², and the body is still met; as far outside the rim it is not.
#[test]
fn grazing_rays_meet_spheres_cylinders_and_cones() {
    for integrator in INTEGRATORS {
        let bodies = [
            format!("sphere: {{radius: 1, {LAMP}}}"),
            format!("cylinder: {{base: [0, -1, 0], top: [0, 1, 0], radius: 1, {LAMP}}}"),
            // At y = 0 the cone's radius is 1.
            format!("cone: {{base: [0, -1, 0], apex: [0, 1, 0], radius: 2, {LAMP}}}"),
        ];
        for body in bodies {
            let scene = bench(&format!("integrator: {integrator}\nshapes: [{{{body}}}]\n"));
            for gap in [1e-4, 1e-8, 1e-12] {
                assert!(met(&scene, 1.0 - gap, 0.0), "{integrator} {body}: missed {gap} within the rim");
                assert!(!met(&scene, 1.0 + gap, 0.0), "{integrator} {body}: met {gap} beyond the rim");
            }
        }
    }
}

/// The camera inside: the nearer root is behind it, the far one counts. The wall is 2 m behind the eye and
/// 4 m before it, so light that falls off by depth fog (linear from 0 to 8 m) tells which was taken.
#[test]
fn a_camera_inside_a_shape_sees_its_far_wall() {
    let bodies = [
        "sphere: {radius: 3, material: {diffuse: {reflectance: 1}}}",
        "cylinder: {base: [0, -9, 0], top: [0, 9, 0], radius: 3, material: {diffuse: {reflectance: 1}}}",
        // Radius 3 at y = 0.
        "cone: {base: [0, -9, 0], apex: [0, 9, 0], radius: 6, material: {diffuse: {reflectance: 1}}}",
        "cube: {size: 6, material: {diffuse: {reflectance: 1}}}",
    ];
    for body in bodies {
        let text = format!(
            "camera: {{origin: [0, 0, 1], target: [0, 0, 0], fov_deg: 1}}\nimage: {{width: 1, height: 1}}\n\
             {AMBIENT}\nshapes: [{{{body}}}]\nfog: {{colour: 0, start: 0, end: 8}}\n"
        );
        let y = bench_with(&text, &[]).grey().picture().at(0, 0);
        assert_close(y, 0.5, 1e-5);
    }
}

/// A body of albedo 0.6 in sunlight that comes from behind the eye: L = ρ/π E (n · wo), the normal facing
/// the eye all the way round.
fn in_own_light(body: &str, direction: DVec3, integrator: &str) -> Bench {
    bench(&format!(
        "integrator: {integrator}\nshapes: [{{{body}}}]\n\
         lights: [{{directional: {{direction: [{}, {}, {}], irradiance: 3}}}}]\n",
        direction.x, direction.y, direction.z
    ))
}

/// A cone is lit from every side alike: its normal leans up by the half angle, tan = r/h = ½, so n · wo for a
/// level ray toward the axis is cos 26.57° = 2/√5.
#[test]
fn a_cone_is_not_dark_on_its_back() {
    for integrator in INTEGRATORS {
        for step in 0..8 {
            let phi = PI * f64::from(step) / 4.0;
            let out = v(phi.cos(), 0.0, phi.sin());
            let body = "cone: {base: [0, -1, 0], apex: [0, 1, 0], radius: 1, material: {diffuse: {reflectance: 0.6}}}";
            let found = in_own_light(body, -out, integrator).look(5.0 * out, DVec3::ZERO);
            assert_close(found, 0.6 / PI * 3.0 * 2.0 / 5f64.sqrt(), 1e-6);
        }
    }
}

/// Straight light on a cap meets it head on, not at the angle of the wall.
#[test]
fn caps_are_shaded_with_the_normal_of_the_cap() {
    let expected = 0.6 / PI * 3.0;
    for integrator in INTEGRATORS {
        for (body, from) in [
            ("cylinder: {base: [0, -1, 0], top: [0, 1, 0], radius: 1, material: {diffuse: {reflectance: 0.6}}}", 5.0),
            ("cylinder: {base: [0, -1, 0], top: [0, 1, 0], radius: 1, material: {diffuse: {reflectance: 0.6}}}", -5.0),
            ("cone: {base: [0, -1, 0], apex: [0, 1, 0], radius: 1, material: {diffuse: {reflectance: 0.6}}}", -5.0),
        ] {
            let scene = in_own_light(body, v(0.0, -from, 0.0), integrator);
            // Off the middle, and near the rim.
            for x in [0.3, 0.999] {
                assert_close(scene.look(v(x, from, 0.0), v(x, 0.0, 0.0)), expected, 1e-6);
            }
        }
    }
}

/// Under the middle of an upright cylinder in light from straight above: its caps, or either one alone, cast
/// a shadow; without caps the light falls through.
#[test]
fn caps_cast_shadows_and_open_ends_do_not() {
    for integrator in INTEGRATORS {
        for (caps, lit) in [("both", false), ("base", false), ("top", false), ("none", true)] {
            let scene = bench(&format!(
                "integrator: {integrator}\nlights: [{{directional: {{direction: [0, -1, 0], irradiance: 3}}}}]\nshapes:\n\
                 - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
                 - cylinder: {{base: [0, 1, 0], top: [0, 2, 0], radius: 0.5, caps: {caps}}}\n"
            ));
            let found = scene.look(v(2.0, 0.5, 0.0), v(0.1, 0.0, 0.0));
            assert_close(found, if lit { 0.6 / PI * 3.0 } else { 0.0 }, 1e-6);
        }
    }
}

/// A cylinder about any axis is met at its radius from any side, is as long as it says, and without a cap
/// shows its inside: the far wall of the tube.
#[test]
fn a_cylinder_stands_along_any_axis_and_shows_its_inside_where_it_is_open() {
    for axis in [v(1.0, 2.0, 3.0), v(-0.3, 0.1, 0.9), v(0.0, 0.0, 1.0), v(1.0, 0.0, 0.0), v(0.0, -1.0, 0.0)] {
        let axis = axis.normalize();
        let (s, t) = axis.any_orthonormal_pair();
        let base = v(0.3, -0.2, 0.1);
        let top = base + 2.0 * axis;
        let at = |p: DVec3| format!("[{}, {}, {}]", p.x, p.y, p.z);
        let tube = |caps: &str| {
            bench(&format!(
                "{AMBIENT}\nshapes: [{{cylinder: {{base: {}, top: {}, radius: 0.5, caps: {caps}}}}}]\n",
                at(base),
                at(top)
            ))
        };
        let distance = |bench: &Bench, from: DVec3, direction: DVec3| {
            bench.prepared.scene.closest(&Ray::new(from, direction), f64::INFINITY).map(|hit| hit.t)
        };
        let solid = tube("both");
        for step in 0..6 {
            let phi = f64::from(step);
            let out = s * phi.cos() + t * phi.sin();
            for height in [0.01, 1.0, 1.99] {
                let met = distance(&solid, base + axis * height + 3.0 * out, -out).unwrap();
                assert!((met - 2.5).abs() < 1e-12, "{axis}: {met}");
            }
            for height in [-0.01, 2.01] {
                assert_eq!(distance(&solid, base + axis * height + 3.0 * out, -out), None);
            }
        }
        // Into the top at 45°, entering 0.25 off the axis: capped, the lid is met at √2; open, the far wall.
        let (from, down) = (top + axis + 0.75 * s, (-axis - s).normalize());
        for (caps, expected) in [("both", 2f64.sqrt()), ("base", 1.25 * 2f64.sqrt()), ("none", 1.25 * 2f64.sqrt())] {
            let met = distance(&tube(caps), from, down).unwrap();
            assert!((met - expected).abs() < 1e-12, "{axis} {caps}: {met}, expected {expected}");
            // And it is seen, not black: the default albedo in ambient light.
            assert_close(tube(caps).look(from, from + down), 0.5, 1e-6);
        }
        // The same at the base.
        let (from, up) = (base - axis + 0.75 * s, (axis - s).normalize());
        for (caps, expected) in [("both", 2f64.sqrt()), ("top", 1.25 * 2f64.sqrt())] {
            let met = distance(&tube(caps), from, up).unwrap();
            assert!((met - expected).abs() < 1e-12, "{axis} {caps}: {met}, expected {expected}");
        }
    }
}

/// A globe whose texture's grey tells u (or v) by 256 columns (or rows, from the bottom).
fn globe(coordinate: char, transform: &str) -> Bench {
    let picture = match coordinate {
        'u' => grey_png(256, 128, |x, _| x as u8),
        _ => grey_png(512, 256, |_, y| 255 - y as u8),
    };
    let text = format!(
        "{CAMERA}{AMBIENT}\ntextures: {{map: {{image: {{file: map.png, raw: true, filter: nearest}}}}}}\nshapes:\n\
         - sphere: {{radius: 1, material: {{diffuse: {{reflectance: {{texture: map}}}}}}, transform: [{transform}]}}\n"
    );
    bench_with(&text, &[("map.png", &picture)])
}

/// The texel that is seen at `n` from outside: 0 to 255.
fn texel(globe: &Bench, n: DVec3) -> f64 {
    255.0 * globe.look(5.0 * n, DVec3::ZERO)
}

/// u = 0.5 + atan2(nx, nz) / 2π, v = 0.5 + asin(ny) / π.
#[test]
fn the_earth_lies_on_its_globe_by_the_formula_of_the_report() {
    let (u_globe, v_globe) = (globe('u', ""), globe('v', ""));
    for i in 0..24 {
        for j in 1..12 {
            let longitude = 2.0 * PI * (f64::from(i) + 0.3) / 24.0;
            let latitude = PI * (f64::from(j) / 12.0 - 0.5) + 0.01;
            let n = v(latitude.cos() * longitude.sin(), latitude.sin(), latitude.cos() * longitude.cos());
            let (u, v) = (0.5 + n.x.atan2(n.z) / (2.0 * PI), 0.5 + n.y.asin() / PI);
            for (found, expected) in
                [(texel(&u_globe, n), (256.0 * u).floor()), (texel(&v_globe, n), (256.0 * v).floor())]
            {
                // Upsampled colours come back to 10⁻³ or so, a quarter of a step.
                assert!((found - expected).abs() < 0.3, "{n}: expected {expected}, found {found}");
            }
        }
    }
}

/// North is up, east is right: from +z the middle of the map is in the middle, larger u to the right, the
/// top row at +y.
#[test]
fn the_earth_is_the_right_way_up_and_not_mirrored() {
    let (u_globe, v_globe) = (globe('u', ""), globe('v', ""));
    let pixel = |globe: &Bench, x: f64, y: f64| 255.0 * globe.look(v(x, y, 5.0), v(x, y, 0.0));
    assert!((pixel(&u_globe, 1e-3, 0.0) - 128.0).abs() < 0.3);
    assert!(pixel(&u_globe, 0.5, 0.0) > 140.0 && pixel(&u_globe, -0.5, 0.0) < 116.0);
    assert!(pixel(&v_globe, 0.0, 0.9) > 190.0 && pixel(&v_globe, 0.0, -0.9) < 65.0);
    // A turn of the globe by 90° to the east brings what was at the left (−x, u = ¼) to the middle.
    let turned = globe('u', "{rotate: {axis: [0, 1, 0], deg: 90}}");
    assert!((pixel(&turned, 1e-3, 0.0) - 64.0).abs() < 0.3);
}

/// At the seam (−z) column 255 meets column 0 with nothing between, and at the poles the outermost row is
/// seen, from straight above as well.
#[test]
fn the_seam_and_the_poles_of_the_globe_are_clean() {
    let (u_globe, v_globe) = (globe('u', ""), globe('v', ""));
    for gap in [1e-3, 1e-6, 1e-9, 1e-15, 0.0, -0.0] {
        for latitude in [0.0, 1.0, -1.3f64] {
            let at = |x: f64| texel(&u_globe, v(x, latitude.sin(), -latitude.cos()).normalize());
            let (east, west) = (at(gap), at(-gap));
            for seen in [east, west] {
                assert!(seen < 0.3 || (seen - 255.0).abs() < 0.3, "seam at {gap}, {latitude}: {east}, {west}");
            }
            if gap >= 1e-9 {
                assert!((east - 255.0).abs() < 0.3 && west < 0.3, "seam at {gap}: {east}, {west}");
            }
        }
        for (y, expected) in [(1.0, 255.0), (-1.0, 0.0)] {
            let seen = texel(&v_globe, v(gap, y, 0.5 * gap).normalize());
            assert!((seen - expected).abs() < 0.3, "pole {y} at {gap}: {seen}");
        }
    }
}

/// Between texels too: with `wrap_v: clamp` the rows of one pole are not mixed into the other, and across the
/// seam a picture that has no seam (255 · (½ + ½ cos 2πu), columns) is smooth.
#[test]
fn an_interpolated_globe_has_neither_seam_nor_dots_at_its_poles() {
    let globe = |map: &[u8]| {
        let text = format!(
            "{CAMERA}{AMBIENT}\ntextures: {{map: {{image: {{file: map.png, raw: true, wrap_v: clamp}}}}}}\nshapes:\n\
             - sphere: {{radius: 1, material: {{diffuse: {{reflectance: {{texture: map}}}}}}}}\n"
        );
        bench_with(&text, &[("map.png", map)])
    };
    let rows = globe(&grey_png(16, 8, |_, y| 255 - 36 * y as u8));
    for gap in [0.0, 1e-9, 1e-3] {
        for (y, expected) in [(1.0, 255.0), (-1.0, 3.0)] {
            let seen = texel(&rows, v(gap, y, -gap).normalize());
            assert!((seen - expected).abs() < 0.3, "pole {y} at {gap}: {seen}");
        }
    }
    let wave = |u: f64| 255.0 * (0.5 + 0.5 * (2.0 * PI * u).cos());
    let columns = globe(&grey_png(256, 8, |x, _| wave((f64::from(x) + 0.5) / 256.0).round() as u8));
    for i in -40..=40 {
        let u = f64::from(i) * 1e-3;
        let seen = texel(&columns, v(-(2.0 * PI * u).sin(), 0.0, -(2.0 * PI * u).cos()));
        // Half a step of the picture's bytes, and the spectra's accuracy.
        assert!((seen - wave(u)).abs() < 0.9, "u = {u}: {seen}, expected {}", wave(u));
    }
}

/// A ball above a floor and a lamp on either side: two shadows, each filled by the other lamp.
#[test]
fn two_lights_cast_two_shadows() {
    for integrator in INTEGRATORS {
        let lamps = [(-2.0, 4.0, 8.0), (2.0, 4.0, 20.0)];
        let lights: Vec<String> =
            lamps.iter().map(|(x, y, i)| format!("{{point: {{position: [{x}, {y}, 0], intensity: {i}}}}}")).collect();
        let scene = bench(&format!(
            "integrator: {integrator}\nlights: [{}]\nshapes:\n\
             - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
             - sphere: {{center: [0, 2, 0], radius: 0.3, material: {{diffuse: {{reflectance: 0}}}}}}\n",
            lights.join(", ")
        ));
        let share = |lamp: usize, x: f64| {
            let (lx, ly, i) = lamps[lamp];
            let d2 = (x - lx) * (x - lx) + ly * ly;
            0.6 / PI * i / d2 * ly / d2.sqrt()
        };
        // The shadow of the left lamp falls on x = 2, that of the right on x = −2.
        for (x, expected) in [(2.0, share(1, 2.0)), (-2.0, share(0, -2.0)), (0.0, share(0, 0.0) + share(1, 0.0))] {
            let looking = ray(v(x, 0.5, 2.0), v(x, 0.0, 0.0));
            if integrator == "path" {
                scene.estimate(&looking, 4096).assert_is(expected, 3e-2);
            } else {
                assert_close(scene.look(looking.origin, v(x, 0.0, 0.0)), expected, 1e-6);
            }
        }
    }
}

/// A pixel of an n × n grid is the mean of the n² pixels of the larger picture that lie in it.
#[test]
fn supersampling_is_the_mean_of_the_finer_picture() {
    let scene = |side: u32, grid: u32| {
        let text = format!(
            "camera: {{origin: [0, 1, 5], target: [0, 0.5, 0], fov_deg: 40}}\nimage: {{width: {side}, height: {side}}}\n\
             integrator: {{whitted: {{grid: {grid}, ambient: 0.2}}}}\n\
             lights: [{{point: {{position: [2, 4, 3], intensity: 40}}}}]\n\
             textures: {{board: {{checkerboard: {{a: 0.1, b: 0.9, scale: [0.5, 0.5]}}}}}}\nshapes:\n\
             - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: {{texture: board}}}}}}}}\n\
             - sphere: {{center: [0, 1, 0], radius: 1, material: {{mirror: {{reflectance: 0.8}}}}}}\n"
        );
        bench_with(&text, &[]).grey().picture()
    };
    for grid in [2, 3] {
        let (coarse, fine) = (scene(8, grid), scene(8 * grid, 1));
        let n = grid as i32;
        let mut spread: f64 = 0.0;
        for y in 0..8 {
            for x in 0..8 {
                let cells = (0..n * n).map(|c| fine.at(n * x + c % n, n * y + c / n));
                let mean = cells.clone().sum::<f64>() / f64::from(n * n);
                assert!((coarse.at(x, y) - mean).abs() < 2e-6, "{grid}: ({x}, {y}): {mean}, {}", coarse.at(x, y));
                spread = spread.max(cells.map(|c| (c - mean).abs()).fold(0.0, f64::max));
            }
        }
        assert!(spread > 0.1, "the scene has nothing to smooth: {spread}");
    }
}

/// Glass over a floor in straight light: an opaque shadow as written in the report, or, asked for, what two
/// faces of n = 1.5 let through: 0.96² (a thin pane, with its inner reflections: (1 − r)/(1 + r), r = 0.04).
#[test]
fn transparent_shadows_are_dark_or_light_as_asked() {
    let bodies = [
        ("cube: {center: [0, 1, 0], size: 1, material: {dielectric: {ior: 1.5}}}", 0.96 * 0.96),
        (
            "disk: {center: [0, 1, 0], normal: [0, 1, 0], radius: 1, material: {thin_dielectric: {ior: 1.5}}}",
            0.96 / 1.04,
        ),
        (
            "cube: {center: [0, 1, 0], size: 1, material: {dielectric: {ior: 1.5, transmission_tint: 0.5}}}",
            0.96 * 0.96 * 0.25,
        ),
        (
            "disk: {center: [0, 1, 0], normal: [0, 1, 0], radius: 1, \
             material: {thin_dielectric: {ior: 1.5, transmission_tint: 0.5}}}",
            0.5 * 0.96 / 1.04,
        ),
        // Half of it is a wall, whatever it is made of: the other half does as it does by itself.
        (
            "disk: {center: [0, 1, 0], normal: [0, 1, 0], radius: 1, \
             material: {blend: {weight: 0.5, first: {diffuse: {}}, second: {thin_dielectric: {ior: 1.5}}}}}",
            0.5 * 0.96 / 1.04,
        ),
        (
            "cube: {center: [0, 1, 0], size: 1, material: {mask: {opacity: 1, material: {dielectric: {ior: 1.5}}}}}",
            0.96 * 0.96,
        ),
        ("cube: {center: [0, 1, 0], size: 1, material: {diffuse: {}}}", 0.0),
    ];
    for (body, share) in bodies {
        for (asked, share) in [(false, 0.0), (true, share)] {
            let scene = bench(&format!(
                "integrator: {{whitted: {{transparent_shadows: {asked}}}}}\n\
                 lights: [{{directional: {{direction: [0, -1, 0], irradiance: 3}}}}]\nshapes:\n\
                 - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n- {body}\n"
            ));
            let found = scene.look(v(2.0, 0.2, 0.0), v(0.1, 0.0, 0.0));
            assert_close(found, share * 0.6 / PI * 3.0, 1e-6);
        }
    }
}

/// At a slant a plate of n = 1.5 lets T² of unpolarised light through, T by Fresnel's equations of the angle outside, which has no
/// critical angle: light that goes in also comes out. A film of the index of the glass is none.
#[test]
fn transparent_shadows_of_a_plate_are_those_of_its_two_faces_at_any_angle() {
    let transmitted = |angle: f64| {
        let (i, t) = (angle, (angle.sin() / 1.5).asin());
        let s = (i - t).sin() / (i + t).sin();
        let p = (i - t).tan() / (i + t).tan();
        1.0 - 0.5 * (s * s + p * p)
    };
    for deg in [20.0f64, 41.0, 42.0, 60.0, 80.0] {
        let (sin, cos) = deg.to_radians().sin_cos();
        for film in ["", ", film: {ior: 1.5, thickness_nm: 300}"] {
            let scene = bench(&format!(
                "integrator: {{whitted: {{transparent_shadows: true}}}}\n\
                 lights: [{{directional: {{direction: [{sin}, {}, 0], irradiance: 3}}}}]\nshapes:\n\
                 - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
                 - cube: {{center: [0, 1.5, 0], size: [40, 0.2, 40], material: {{dielectric: {{ior: 1.5{film}}}}}}}\n",
                -cos
            ));
            let found = scene.look(v(2.0, 0.2, 0.0), v(0.1, 0.0, 0.0));
            let expected = transmitted(deg.to_radians()).powi(2) * 0.6 / PI * 3.0 * cos;
            // A few roundings to f32.
            assert_close(found, expected, 2e-6);
        }
    }
}

/// A glossy wall across the view, black but for its highlight, and a lamp at (1, 2, 3): strength · cosⁿ · I/d²
/// at the middle of each pixel, the cosine by Phong (mirrored eye and lamp) or Blinn (normal and half way).
#[test]
fn phong_and_blinn_highlights_are_right_at_each_pixel() {
    for model in ["phong", "blinn"] {
        let scene = bench(&format!(
            "integrator: {{whitted: {{grid: 1}}}}\nlights: [{{point: {{position: [1, 2, 3], intensity: 30}}}}]\nshapes:\n\
             - plane: {{normal: [0, 0, 1], material: {{diffuse: {{reflectance: 0, \
               highlight: {{strength: 0.5, exponent: 20, model: {model}}}}}}}}}\n"
        ));
        let picture = scene.grey().picture();
        let mut brightest: f64 = 0.0;
        for y in 0..8 {
            for x in 0..8 {
                // 40° across 8 pixels, from 5 m.
                let step = 5.0 * 20f64.to_radians().tan() / 4.0;
                let p = v((f64::from(x) - 3.5) * step, (3.5 - f64::from(y)) * step, 0.0);
                let (eye, lamp) = ((v(0.0, 0.0, 5.0) - p).normalize(), v(1.0, 2.0, 3.0) - p);
                let wi = lamp.normalize();
                let cos = match model {
                    "phong" => v(-eye.x, -eye.y, eye.z).dot(wi),
                    _ => (eye + wi).normalize().z,
                };
                let expected = 0.5 * cos.powi(20) * 30.0 / lamp.length_squared();
                assert!((picture.at(x, y) - expected).abs() < 2e-6, "{model} ({x}, {y}): {expected}");
                brightest = brightest.max(expected);
            }
        }
        assert!(brightest > 0.5, "{model}: the highlight is in the picture");
    }
}

/// n = 0.9: a bubble in something denser. From outside, light steeper than sin θ = 0.9 is mirrored in full.
#[test]
fn an_index_below_one_reflects_totally_from_outside() {
    for integrator in INTEGRATORS {
        // Only the sky before the eye shines: what is mirrored at a grazing angle goes on away from it.
        let scene = bench(&format!(
            "integrator: {integrator}\nshapes:\n- sphere: {{radius: 1, material: {{dielectric: {{ior: 0.9}}}}}}\n\
             - rectangle: {{corner: [2, -9, -9], edge_u: [0, 0, 18], edge_v: [0, 18, 0], {LAMP}}}\n"
        ));
        for b in [0.901, 0.93, 0.95] {
            // Mirrored at x = b the ray turns toward +x: direction (2b√(1−b²), 1 − 2(1 − b²)…) meets the lamp.
            assert_close(scene.look(v(b, 0.0, 5.0), v(b, 0.0, 0.0)), 1.0, 1e-6);
        }
    }
}

/// Diffuse bodies under a point light, direct light only: the recursive tracer and the path tracer agree along
/// every ray, and in the picture within the noise.
#[test]
fn whitted_and_path_agree_in_direct_light() {
    let scene = |integrator: &str, grid: u32| {
        let text = format!(
            "camera: {{origin: [0, 2, 6], target: [0, 0.7, 0], fov_deg: 40}}\nimage: {{width: 16, height: 12}}\n\
             integrator: {integrator}\nrender: {{samples: {}}}\n\
             lights: [{{point: {{position: [2, 4, 3], intensity: 40}}}}]\nshapes:\n\
             - plane: {{normal: [0, 1, 0]}}\n- sphere: {{center: [-1, 1, 0], radius: 1}}\n\
             - cone: {{base: [1, 0, 0.5], apex: [1, 1.5, 0.5], radius: 0.6}}\n\
             - cylinder: {{base: [0.5, 0, 1.5], top: [0.8, 0.8, 1.5], radius: 0.3}}\n\
             - cube: {{center: [2, 0.5, -1], size: 1}}\n",
            grid * grid
        );
        bench_with(&text, &[]).grey()
    };
    let (whitted, path) = (scene("{whitted: {grid: 8}}", 8), scene("{path: {max_depth: 2}}", 8));
    for y in 0..12 {
        for x in 0..16 {
            let at = whitted.camera_ray(f64::from(x) + 0.37, f64::from(y) + 0.61);
            let (a, b) = (whitted.lanes(&at)[0], path.lanes(&at)[0]);
            assert!((a - b).abs() <= 1e-6 * a, "({x}, {y}): {a}, {b}");
        }
    }
    let (a, b) = (whitted.picture(), path.picture());
    // Both are means over the pixel, one on a grid of 64 and one of 64 scattered samples: an edge across the
    // pixel of contrast up to 1 is placed to within a few 64ths by each.
    for (i, (a, b)) in a.y.iter().zip(&b.y).enumerate() {
        assert!((a - b).abs() < 0.1, "pixel {i}: {a}, {b}");
    }
    let mean = |y: &[f64]| y.iter().sum::<f64>() / y.len() as f64;
    assert_close(mean(&a.y), mean(&b.y), 3e-3);
}

/// Two facing mirrors of ½ that also shine: with n reflections allowed, L = 1 + ½ + … + ½ⁿ.
#[test]
fn recursion_goes_as_deep_as_asked_and_no_deeper() {
    for depth in [1, 2, 5] {
        let mirror = "emission: 1, material: {mirror: {reflectance: 0.5}}";
        let scene = bench(&format!(
            "integrator: {{whitted: {{max_depth: {depth}}}}}\nshapes:\n\
             - rectangle: {{corner: [-9, -9, -1], edge_u: [18, 0, 0], edge_v: [0, 18, 0], {mirror}}}\n\
             - rectangle: {{corner: [-9, -9, 1], edge_u: [0, 18, 0], edge_v: [18, 0, 0], {mirror}}}\n"
        ));
        assert_close(scene.look(v(0.0, 0.0, 0.0), v(0.1, 0.0, -1.0)), 2.0 - 0.5f64.powi(depth), 1e-6);
    }
}
