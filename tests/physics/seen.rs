//! What the camera sees and what it does not: straight through what is open, past hidden lamps, between clipping planes.

use super::common::bench_with;
use super::pictures::{PARALLEL, render};
use abbe::film::resolve::Image;
use abbe::spectrum::ColourSpace;

/// The sky is seen behind 256 surfaces in a row that hide nothing, and behind more there is none, whatever their number.
#[test]
fn light_goes_straight_through_256_surfaces_at_the_most() {
    let row = |integrator: &str, material: &str, count: u32| {
        let mut scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {integrator}\n\
             lights: [{{constant: {{radiance: 1}}}}]\nmaterials: {{open: {material}}}\nshapes:\n"
        );
        for i in 0..count {
            let z = -1e-3 * f64::from(i);
            scene += &format!(
                "- rectangle: {{corner: [-2, -2, {z}], edge_u: [4, 0, 0], edge_v: [0, 4, 0], material: open}}\n"
            );
        }
        let sample = bench_with(&scene, &[]).sample([0, 0], 0);
        (sample.radiance.to_array()[0], sample.alpha)
    };
    for integrator in ["path", "{whitted: {}}"] {
        for material in ["{mask: {opacity: 0, material: {diffuse: {}}}}", "{boundary: {}}"] {
            for (count, sky) in [(256, 1.0), (257, 0.0), (5000, 0.0)] {
                assert_eq!(row(integrator, material, count), (sky, 0.0), "{integrator} {material} {count}");
            }
        }
    }
}

/// Lamps without power change no pixel, but what is said of lamps holds of them: `hide_emitters` hides one, and a sky covers.
#[test]
fn lights_without_power_are_left_out() {
    let day = [&b"PF\n2 1\n-1\n"[..], &1f32.to_le_bytes().repeat(6)].concat();
    let bench = |integrator: &str, emission: &str, dark: &str| {
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {integrator}\nshapes:\n\
             - rectangle: {{corner: [-9, -9, 0], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {{diffuse: {{}}}}}}\n\
             - sphere: {{name: lamp, center: [3, 0, 3], radius: 1, material: {{diffuse: {{}}}}{emission}}}\n\
             lights:\n- point: {{name: bulb, position: [0, 3, 3], intensity: 3}}\n{dark}"
        );
        bench_with(&scene, &[("day.pfm", &day)])
    };
    let dark = "- constant: {radiance: {table: [[360, 0], [830, 0]]}}\n- directional: {direction: [0, 0, -1], irradiance: 0}\n\
                - point: {name: out, position: [1, 2, 3], intensity: 0}\n\
                - spot: {position: [1, 2, 3], target: [0, 0, 0], cutoff_deg: 30, intensity: 0}\n\
                - spot: {position: [1, 2, 3], target: [0, 0, 0], texture: black, intensity: 1}\n\
                - projector: {name: slide, origin: [1, 2, 3], target: [0, 0, 0], fov_deg: 30, scale: 0}\n\
                - projector: {name: board, origin: [1, 2, 3], target: [0, 0, 0], fov_deg: 30, irradiance: {texture: black}}\n\
                - environment: {name: night, file: day.pfm, scale: 0}\n\
                textures: {black: {checkerboard: {a: 0, b: 0}}}\n\
                light_groups: {a: [out], b: [bulb]}\n";
    for integrator in ["path", "{whitted: {}}", "light_tracer"] {
        let [with, without] =
            [(", emission: 0", dark), ("", "")].map(|(emission, dark)| bench(integrator, emission, dark));
        for i in 0..64 {
            let [a, b] = [&with, &without].map(|bench| bench.sample([0, 0], i));
            assert_eq!((a.radiance, a.alpha), (b.radiance, b.alpha), "{integrator}");
        }
        assert_eq!((with.prepared.scene.lights.len(), &with.prepared.scene.light_groups.of[..]), (1, &[2][..]));
        let dark = ["lamp", "constant1", "directional2", "out", "spot4", "spot5", "slide", "board", "night"];
        assert_eq!(with.prepared.scene.dark, dark.map(str::to_owned));
    }
    let front =
        ", emission: 0}\n- rectangle: {corner: [-9, -9, 2], edge_u: [18, 0, 0], edge_v: [0, 18, 0], emission: 0";
    for (setting, alpha) in [("hide_emitters", 0.0), ("opaque_sky", 1.0)] {
        let lamp = if setting == "hide_emitters" { front } else { "" };
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {{path: {{{setting}: true}}}}\nshapes:\n\
             - sphere: {{center: [99, 0, 0], radius: 1{lamp}}}\nlights: [{{constant: {{radiance: 0}}}}]\n"
        );
        assert_eq!(bench_with(&scene, &[]).sample([0, 0], 0).alpha, alpha, "{setting}");
    }
    // Behind panes, too, where a bound to depth ends the path before it gets there.
    let panes: String = (0..4)
        .map(|z| format!("- rectangle: {{corner: [-9, -9, {z}], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {{boundary: {{}}}}}}\n"))
        .collect();
    let scene = format!(
        "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {{path: {{opaque_sky: true, max_depth: 2, count_crossings: true}}}}\n\
         lights: [{{constant: {{radiance: 1}}}}]\nshapes:\n{panes}"
    );
    let scene = bench_with(&scene, &[]);
    assert_eq!(scene.sample([0, 0], 0).alpha, 1.0);
    assert_eq!(scene.picture().alpha, [1.0]);
}

/// Light of a bare boundary is added to what lies behind it, and covers nothing: 2 over a sky of 3.
#[test]
fn a_boundary_that_shines_adds_to_what_is_behind_it() {
    for integrator in ["path", "{whitted: {}}"] {
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {integrator}\nlights: [{{constant: {{radiance: 3}}}}]\n\
             shapes:\n- rectangle: {{corner: [-9, -9, 0], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {{boundary: {{}}}}, \
             emission: 2}}\n"
        );
        let sample = bench_with(&scene, &[]).sample([0, 0], 0);
        assert_eq!((sample.radiance.to_array()[0], sample.alpha), (5.0, 0.0), "{integrator}");
    }
}

/// Between perfect mirrors nothing ends the recursion but its bound, whatever the mirrors are made of.
#[test]
fn light_goes_from_mirror_to_mirror_to_the_bound() {
    let mirror = "{mask: {opacity: 1, material: {two_sided: {front: {mirror: {reflectance: 1}}}}}}";
    let wall = |z: f64| {
        format!("- rectangle: {{corner: [-9, -9, {z}], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {mirror}}}\n")
    };
    let scene = format!(
        "{PARALLEL}image: {{width: 1, height: 1}}\nintegrator: {{whitted: {{max_depth: 256}}}}\nshapes:\n{}{}",
        wall(0.0),
        wall(9.0)
    );
    let sample = bench_with(&scene, &[]).sample([0, 0], 0);
    assert_eq!((sample.radiance.to_array()[0], sample.alpha), (0.0, 1.0));
}

/// A lamp over a hundred open masks lights the floor below as if there were none.
#[test]
fn shadow_rays_of_whitted_go_straight_through_as_camera_rays_do() {
    let floor = |count: u32| {
        let mut scene = "camera: {origin: [3, 3, 0], target: [0, 0, 0], fov_deg: 10}\nimage: {width: 1, height: 1}\n\
             integrator: {whitted: {}}\nlights: [{point: {position: [0, 9, 0], intensity: 30}}]\n\
             materials: {open: {mask: {opacity: 0, material: {diffuse: {}}}}}\n\
             shapes:\n- plane: {normal: [0, 1, 0]}\n"
            .to_owned();
        for i in 0..count {
            let y = 5.0 + 1e-3 * f64::from(i);
            scene += &format!(
                "- rectangle: {{corner: [-1, {y}, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], material: open}}\n"
            );
        }
        bench_with(&scene, &[]).sample([0, 0], 0).radiance.to_array()[0]
    };
    let (bare, behind) = (floor(0), floor(100));
    assert!(bare > 0.0 && (behind / bare - 1.0).abs() < 1e-6, "{bare} {behind}");
}

/// A mask covers as much as its opacity, and fog is that of the depth of what covers anything. The ambient light of 1 shows
/// the white mask, and the sky behind it has 3.
#[test]
fn open_masks_cover_nothing() {
    let bench = |integrator: &str, fog: &str, shapes: &str| {
        let lights = "lights: [{constant: {radiance: 3}}]";
        let picture = "image: {width: 1, height: 1}";
        bench_with(&format!("{PARALLEL}{picture}\nintegrator: {integrator}\n{fog}{lights}\nshapes: [{shapes}]\n"), &[])
    };
    let rectangle = |z: f64, material: &str| {
        let sides = "edge_u: [18, 0, 0], edge_v: [0, 18, 0]";
        format!("{{rectangle: {{corner: [-9, -9, {z}], {sides}, material: {material}}}}}")
    };
    let mask = |opacity: f64| {
        rectangle(2.0, &format!("{{mask: {{opacity: {opacity}, material: {{diffuse: {{reflectance: 1}}}}}}}}"))
    };
    let whitted = |fog: &str, shapes: &str| {
        let sample = bench("{whitted: {grid: 1, ambient: 1}}", fog, shapes).sample([0, 0], 0);
        (sample.radiance.to_array()[0], sample.alpha)
    };
    for opacity in [0.0, 0.25, 1.0] {
        let expected = (opacity + 3.0 * (1.0 - opacity), opacity);
        assert_eq!(whitted("", &mask(f64::from(opacity))), expected, "{opacity}");
        // The standard error of 4096 samples is 0.0068: z = 4.
        let path = bench("path", "", &mask(f64::from(opacity)));
        let alpha = (0..4096).map(|i| path.sample([0, 0], i).alpha).sum::<f32>() / 4096.0;
        assert!((alpha - opacity).abs() < 0.028, "{opacity}: {alpha}");
    }
    let wall = rectangle(0.0, "{diffuse: {reflectance: 0.5}}");
    let fog = "fog: {colour: 0.3, density: 0.1}\n";
    assert_eq!(whitted(fog, &format!("{}, {wall}", mask(0.0))), whitted(fog, &wall));
}

/// Before the sky stands a lamp: neither is seen, and neither covers anything; the wall behind is lit by both.
#[test]
fn hidden_lights_shine_and_are_not_seen() {
    let scene = |walls: &str| {
        render(&format!(
            "{PARALLEL}image: {{width: 4, height: 4}}\nrender: {{samples: 256}}\n\
             integrator: {{path: {{hide_emitters: true}}}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             shapes:\n- sphere: {{radius: 0.5, emission: 4, material: {{diffuse: {{reflectance: 0}}}}}}\n{walls}"
        ))
        .resolve(&ColourSpace::Xyz.matrix_from_xyz())
    };
    let empty = scene("");
    assert!(empty.rgb.iter().flatten().chain(&empty.alpha).all(|x| *x == 0.0));
    // A black wall close behind it.
    let wall = "- rectangle: {corner: [-9, -9, -0.6], edge_u: [18, 0, 0], edge_v: [0, 18, 0], material: {diffuse: {reflectance: RHO}}}\n";
    let black = scene(&wall.replace("RHO", "0"));
    assert!(black.rgb.iter().flatten().all(|x| *x == 0.0) && black.alpha.iter().all(|a| *a == 1.0));
    // A sphere that stands wholly above a wall fills r²d/D³ of its cosine-weighted sky, where D² = d² + x² + y², d = 0.6 and
    // r = 0.5, so that the wall's radiance is 1 + (4 − 1) r²d/D³. Over a pixel next to the axis, a = 0.5 wide, ∫∫ d/D³ is the
    // solid angle of the pixel, atan(a² / (d √(d² + 2a²))): the mean of the share is that times r²/a² = 1.
    let white = scene(&wall.replace("RHO", "1"));
    let solid_angle = (0.25f64 / (0.6 * (0.36f64 + 0.5).sqrt())).atan();
    let middle = [5, 6, 9, 10];
    let mean = middle.iter().map(|i| f64::from(white.rgb[1][*i])).sum::<f64>() / 4.0;
    let error = middle.iter().map(|i| f64::from(white.standard_error[1][*i]).powi(2)).sum::<f64>().sqrt() / 4.0;
    // Of four pixels with three degrees of freedom each, one in 600 is beyond four of these errors.
    assert!((mean - 1.0 - 3.0 * solid_angle).abs() < 4.0 * error && error < 0.01 * mean, "{mean} ± {error}");
}

/// A boundary before a hidden sky: where the first hit covers, there is alpha, and so is the light that comes through; where it covers
/// nothing, nothing is seen. Beside it there is neither.
#[test]
fn a_hidden_sky_is_seen_where_what_is_before_it_covers() {
    for (coverage, x, expected) in
        [("first_hit", 0, (1.0, 1.0)), ("scattering", 0, (0.0, 0.0)), ("first_hit", 9, (0.0, 0.0))]
    {
        let scene = format!(
            "{PARALLEL}image: {{width: 1, height: 1}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             integrator: {{path: {{max_depth: 2, count_crossings: true, hide_emitters: true, coverage: {coverage}}}}}\nshapes:\n\
             - rectangle: {{corner: [{}, -2, 0], edge_u: [4, 0, 0], edge_v: [0, 4, 0], material: {{boundary: {{}}}}}}\n",
            x - 2
        );
        let sample = bench_with(&scene, &[]).sample([0, 0], 0);
        assert_eq!((sample.radiance.to_array()[0], sample.alpha), expected, "{coverage} {x}");
    }
}

/// Between clipping planes at 4 and 6 m from a camera at 5 m there is the unit sphere's middle part: the near cap is
/// open, and what the camera sees is the inside.
#[test]
fn the_camera_sees_between_its_clipping_planes_only() {
    let see = |pose: &str, integrator: &str, clip: &str| {
        let camera = format!("camera: {{{pose}, clip: {{{clip}}}}}\n");
        let frame = render(&format!(
            "{camera}image: {{width: 1, height: 1}}\nrender: {{samples: 4}}\nintegrator: {integrator}\n\
             lights: [{{constant: {{radiance: 1}}}}]\nlayers: [{{name: d, surface: depth}}]\n\
             shapes: [{{sphere: {{radius: 1, material: {{diffuse: {{reflectance: 0}}}}}}}}]\n"
        ));
        let Image { rgb, alpha, .. } = frame.resolve(&ColourSpace::Xyz.matrix_from_xyz());
        (f64::from(frame.layer(0)[0]), rgb[1][0], alpha[0])
    };
    const PLAIN: &str = "origin: [0, 0, 5], target: [0, 0, 0], orthographic_height: 0.01";
    // The same camera with another unit, which the planes do not follow.
    const LARGE: &str =
        "to_world: [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, -2, 5], [0, 0, 0, 1]], orthographic_height: 0.005";
    for (pose, integrator) in [(PLAIN, "path"), (PLAIN, "{whitted: {}}"), (LARGE, "path"), (LARGE, "{whitted: {}}")] {
        // Half the picture is 5 mm wide: the sphere is at most 2.5e-5 m off there.
        for (clip, expected) in [("near: 0", 4.0), ("near: 3.5", 0.5), ("near: 4.5", 1.5), ("near: 4.5, far: 5.5", 0.0)]
        {
            let (depth, light, alpha) = see(pose, integrator, clip);
            assert!((depth - expected).abs() < 3e-5, "{integrator} {clip}: {depth}");
            // The sphere is black, and the sky behind it is not.
            assert_eq!(
                (light > 0.0, alpha),
                if expected > 0.0 { (false, 1.0) } else { (true, 0.0) },
                "{integrator} {clip}"
            );
        }
    }
}

/// What a camera looks at through something open is no nearer: a floor, 8 m away behind a mask without a covering, seen by paths from
/// either end; and through a camera that a matrix makes larger.
#[test]
fn the_far_clipping_plane_stays_where_it_is_behind_what_is_open() {
    let light = |camera: &str, integrator: &str, far: f64| {
        let frame = render(&format!(
            "camera: {{{camera}, clip: {{far: {far}}}}}\nimage: {{width: 8, height: 8}}\nrender: {{samples: 16}}\n\
             integrator: {integrator}\nmaterials: {{white: {{diffuse: {{}}}}, hole: {{mask: {{opacity: 0, material: white}}}}}}\n\
             shapes:\n- rectangle: {{corner: [-20, -20, -3], edge_u: [40, 0, 0], edge_v: [0, 40, 0], material: white}}\n\
             - rectangle: {{corner: [-20, -20, 2], edge_u: [40, 0, 0], edge_v: [0, 40, 0], material: hole}}\n\
             lights: [{{point: {{position: [0, 0, 0], intensity: 10}}}}]\n"
        ));
        let Image { rgb, alpha, .. } = frame.resolve(&ColourSpace::Xyz.matrix_from_xyz());
        let seen = alpha.iter().filter(|alpha| **alpha > 0.0).count();
        (rgb[1].iter().sum::<f32>() / rgb[1].len() as f32, seen)
    };
    let scaled = "to_world: [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, -2, 5], [0, 0, 0, 1]], orthographic_height: 2";
    for camera in ["origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 30", scaled] {
        let expected = light(camera, "path", 9.0);
        assert!(expected.0 > 0.05, "{camera}: {expected:?}");
        for integrator in ["path", "{whitted: {}}", "light_tracer"] {
            assert_eq!(light(camera, integrator, 6.0), (0.0, 0), "{camera} {integrator}");
            let found = light(camera, integrator, 9.0).0;
            assert!((found / expected.0 - 1.0).abs() < 0.2, "{camera} {integrator}: {found} for {expected:?}");
        }
    }
}
