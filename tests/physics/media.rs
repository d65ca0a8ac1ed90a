//! Fog, smoke and coloured glass.

use super::common::{Bench, SPREAD_NM, assert_close, bench, bench_with, mean, ray, v, wavelengths};
use super::{LAMP, pictures};
use abbe::math::Ray;
use abbe::math::sampler::Sampler;
use abbe::scene::through::Way;
use abbe::spectrum::observer;
use glam::DVec3;
use std::f64::consts::PI;

/// A box of side 2 that holds `medium`, with surfaces of `material`.
fn filled(medium: &str, material: &str, more: &str) -> Bench {
    bench(&format!(
        "media: {{m: {{homogeneous: {medium}}}}}\n\
         shapes:\n- cube: {{size: 2, material: {material}, inside: m}}\n{more}\n"
    ))
}

/// σ_a of a blue filter, 1/m, straight between two points: 0.1 at 360 nm, 1.275 at 830 nm.
const FILTER: &str = "{absorption: {table: [[360, 0.1], [830, 1.275]]}}";

fn filter(nm: f64) -> f64 {
    0.1 + (nm - 360.0) * 0.0025
}

/// Beer and Lambert: exp(−σ d) in every lane, d = 2 straight through and 2 / cos θ at a slant.
#[test]
fn light_through_an_absorbing_slab_falls_exponentially_in_every_lane() {
    let slab = filled(FILTER, "{boundary: {}}", "lights: [{constant: {radiance: 1}}]");
    for slope in [0.0, 0.3, 0.9] {
        let through = ray(v(0.0, -slope, 2.0), v(0.0, 0.0, 1.0)).direction;
        let length = 2.0 * (1.0f64 + slope * slope).sqrt();
        let found = slab.lanes(&Ray::new(-4.0 * through, through));
        for (nm, found) in SPREAD_NM.iter().zip(found) {
            assert_close(found, (-filter(*nm) * length).exp(), 2e-6);
        }
    }
}

/// What only absorbs covers what is behind it by the share that it takes, 1 − exp(−σ d): of its first wavelength by `path`, whose
/// chance that alone decides, of all by `whitted`. So in the mean does what scatters, and what varies.
#[test]
fn what_only_absorbs_covers_by_the_share_that_it_takes() {
    let straight = ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0));
    let sampler = Sampler::new(1, [0, 0], 0, 0);
    let taken = SPREAD_NM.map(|nm| 1.0 - (-filter(nm) * 2.0).exp());
    for (integrator, expected) in [("path", taken[0]), ("whitted", taken.iter().sum::<f64>() / 8.0)] {
        let slab = filled(FILTER, "{boundary: {}}", &format!("integrator: {integrator}"));
        let alpha = slab.incoming(&straight, &wavelengths(SPREAD_NM), &sampler).alpha;
        assert_close(alpha.into(), expected, 2e-6);
    }
    let varying = "{heterogeneous: {extinction: {volume: grey}, albedo: 0}}";
    for medium in ["{homogeneous: {absorption: 0.2, scattering: 0.2}}", "{homogeneous: {absorption: 0.4}}", varying] {
        let slab = bench(&format!(
            "volumes: {{grey: {{constant: {{value: 0.4, transform: [{{scale: 4}}, {{translate: [-2, -2, -2]}}]}}}}}}\n\
             media: {{m: {medium}}}\nshapes: [{{cube: {{size: 2, material: {{boundary: {{}}}}, inside: m}}}}]\n"
        ));
        let alpha = slab.estimate_of(&straight, 8192, |light, _| light.alpha.into());
        alpha.assert_is(1.0 - (-0.8f64).exp(), 2e-2);
    }
}

/// A mirrored room full of haze, with lamp and camera inside, has the same light by paths from either end, whichever way the normals
/// of its walls point: what light cannot enter is no body of its own medium.
#[test]
fn light_within_a_room_is_in_what_the_camera_is_in() {
    for flip in ["true", "false"] {
        let room = |technique: &str| {
            let bench = bench(&format!(
                "media: {{haze: {{homogeneous: {{absorption: 0.5}}}}}}\nmedium: haze\n\
                 render: {{samples: 256, techniques: {{light_tracing: {technique}}}}}\n\
                 shapes:\n\
                 - cube: {{size: 12, flip_normals: {flip}, material: {{mirror: {{reflectance: 0.8}}}}}}\n\
                 - rectangle: {{corner: [-2, -2, -2], edge_u: [4, 0, 0], edge_v: [0, 4, 0]}}\n\
                 - sphere: {{center: [0.3, 3.5, 0], radius: 0.4, {LAMP}}}\n"
            ));
            assert_eq!(bench.prepared.plan.caustics.is_some(), technique == "on");
            bench.picture().mean()
        };
        let (on, off) = (room("on"), room("off"));
        assert!((on.mean - off.mean).abs() < 4.0 * on.error.hypot(off.error), "{on:?} {off:?}");
    }
}

/// A slab of tinted glass, seen straight: with R = 0.04 and t = e^(−2σ), the bounces between its faces sum
/// to R + (1 − R)² t / (1 − R t) of the even light around it.
#[test]
fn tinted_glass_absorbs_between_its_reflections() {
    let slab = filled("{absorption: 0.4}", "{dielectric: {ior: 1.5}}", "lights: [{constant: {radiance: 1}}]");
    let (r, t) = (0.04, (-0.8f64).exp());
    let expected = r + (1.0 - r) * (1.0 - r) * t / (1.0 - r * t);
    slab.estimate(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 8192).assert_is(expected, 5e-3);
}

/// The same of glass that absorbs by itself, by `path` and, as it draws nothing, exactly by `whitted`; also where the camera
/// is in what absorbs, where light from infinity has none left, and of two media that `whitted` knows not.
#[test]
fn whitted_dims_what_crosses_a_medium_that_only_absorbs() {
    let (r, t) = (0.04, (-0.8f64).exp());
    let expected = r + (1.0 - r) * (1.0 - r) * t / (1.0 - r * t);
    let whitted = "integrator: {whitted: {max_depth: 24}}\n";
    let glass = "shapes:\n- cube: {size: 2, material: {dielectric: {ior: 1.5, absorption: {color: 0.6703200460356393, at: 1}}}}\n\
                 lights: [{constant: {radiance: 1}}]\n";
    let straight = ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0));
    bench(glass).estimate(&straight, 8192).assert_is(expected, 5e-3);
    // A ray of less than 2^-16 of what reaches the eye is not followed: of the way out and of the way back, one each.
    let dims_to = |text: &str, expected: f64, within: f64| {
        for found in bench(&format!("{whitted}{text}")).lanes(&straight) {
            assert_close(found, expected, within);
        }
    };
    dims_to(glass, expected, 2.0 / 65_536.0 / expected);
    let dims = |text: &str, expected: f64| dims_to(text, expected, 2e-6);
    let board = |medium: &str| {
        format!(
            "media: {{m: {medium}}}\nmedium: m\nshapes:\n\
             - rectangle: {{corner: [-2, -2, 0], edge_u: [4, 0, 0], edge_v: [0, 4, 0], emission: 1, material: {{diffuse: {{reflectance: 0}}}}}}\n"
        )
    };
    dims(&board("{homogeneous: {absorption: 0.3}}"), (-1.5f64).exp());
    dims(&board("{homogeneous: {absorption: 0.3, scattering: 0.1}}"), 1.0);
    dims(
        "media: {m: {homogeneous: {absorption: 0.3}}}\nmedium: m\nlights: [{constant: {radiance: 1}}]\nshapes: []\n",
        0.0,
    );
    // A lamp two metres above a floor, through one metre of the medium; and from the middle of a medium without a wall.
    let lamp = |shape: &str, first: &str| {
        format!(
            "{first}media: {{m: {{homogeneous: {{absorption: 0.3}}}}}}\nlights: [{{point: {{position: [0.1, 0.2, 2], intensity: 8}}}}]\n\
             shapes:\n- plane: {{normal: [0, 0, 1]}}\n{shape}"
        )
    };
    let floor = 0.5 * 2.0 / std::f64::consts::PI;
    let slab = "- cube: {center: [0, 0, 1], size: 1, material: {boundary: {}}, inside: m}\n";
    let crossed = (-0.3f64).exp();
    dims(&lamp(slab, ""), floor * crossed * crossed);
    dims(&lamp("", "medium: m\n"), floor * (-0.3 * 7.0f64).exp());
}

/// What only scatters keeps all light: in even light it is invisible, whatever the phase function. Grey,
/// the mean of the lanes is 1; coloured, the luminance, since lanes stand in for each other there.
#[test]
fn media_that_only_scatter_are_invisible_in_even_light() {
    for medium in [
        "{scattering: 2}",
        "{scattering: 2, phase: {hg: 0.8}}",
        "{scattering: 2, phase: {hg: -0.5}}",
        "{scattering: 1, phase: rayleigh}",
        "{scattering: {table: [[360, 3], [830, 0.5]]}, phase: {hg: 0.3}}",
        "{scattering: {table: [[360, 0.1], [830, 2]]}}",
    ] {
        let scene = bench(&format!(
            "media: {{m: {{homogeneous: {medium}}}}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             shapes: [{{sphere: {{radius: 1, material: {{boundary: {{}}}}, inside: m}}}}]\n"
        ));
        let through = ray(v(0.3, 0.2, 5.0), v(0.3, 0.2, 0.0));
        scene.luminance(&through, 8192).assert_is(1.0, 1e-2);
    }
    // In glass too, where light may go round for long.
    let scene = filled("{scattering: 1}", "{dielectric: {ior: 1.5}}", "lights: [{constant: {radiance: 1}}]");
    scene.luminance(&ray(v(0.3, 0.2, 5.0), v(0.3, 0.2, 0.0)), 4096).assert_is(1.0, 1e-2);
}

/// The camera inside: fog that only scatters is invisible from within as well. Outside its wall stands
/// empty space, which is written as a medium without coefficients: a shape that names no medium outside
/// stands in what the camera is in.
#[test]
fn a_camera_inside_a_scattering_medium_sees_even_light() {
    let scene = bench(
        "media: {fog: {homogeneous: {scattering: 0.5, phase: {hg: 0.4}}}, empty: {homogeneous: {}}}\nmedium: fog\n\
         lights: [{constant: {radiance: 1}}]\n\
         shapes: [{sphere: {radius: 2, material: {boundary: {}}, inside: fog, outside: empty}}]\n",
    );
    scene.luminance(&ray(v(0.5, 0.0, 1.0), v(0.0, 0.3, 0.0)), 8192).assert_is(1.0, 1e-2);
}

/// Sunlight from behind the eye, scattered once back out of a slab of depth D by an isotropic medium:
/// L = σ_s/4π E ∫₀ᴰ e^(−2σ_t s) ds = E σ_s (1 − e^(−2σ_t D)) / (8π σ_t).
#[test]
fn single_scattering_in_a_slab_is_its_integral() {
    let sun = "lights: [{directional: {direction: [0, 0, -1], irradiance: 10}}]\nintegrator: {path: {max_depth: 2}}";
    let slab = filled("{scattering: 0.3, absorption: 0.2}", "{boundary: {}}", sun);
    let expected = 10.0 * 0.3 * (1.0 - (-2.0f64).exp()) / (8.0 * PI * 0.5);
    slab.estimate(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 8192).assert_is(expected, 5e-3);

    // Coloured: the same integral at each wavelength, weighed by ȳ. σ_s from 0.1 to 2.45 1/m.
    let slab = filled("{scattering: {table: [[360, 0.1], [830, 2.45]]}, absorption: 0.2}", "{boundary: {}}", sun);
    let expected: f64 = (0..4700)
        .map(|i| {
            let nm = 360.05 + 0.1 * f64::from(i);
            let s = 0.1 + (nm - 360.0) * 0.005;
            let t = s + 0.2;
            10.0 * s * (1.0 - (-4.0 * t).exp()) / (8.0 * PI * t) * observer::matching(nm)[1] * 0.1
        })
        .sum();
    let found = slab.luminance(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 8192);
    found.assert_is(expected / observer::Y_INTEGRAL, 5e-3);
}

/// Henyey and Greenstein with g = ½, scattered once straight back: p(π) = (1 − g²) / (4π (1 + g)³).
#[test]
fn backscatter_follows_the_phase_function() {
    for (phase, p) in [
        ("{hg: 0.5}", 0.75 / (4.0 * PI * 1.5f64.powi(3))),
        ("{hg: -0.5}", 0.75 / (4.0 * PI * 0.5f64.powi(3))),
        ("rayleigh", 2.0 * 3.0 / (16.0 * PI)),
    ] {
        let slab = filled(
            &format!("{{scattering: 0.5, phase: {phase}}}"),
            "{boundary: {}}",
            "lights: [{directional: {direction: [0, 0, -1], irradiance: 10}}]\nintegrator: {path: {max_depth: 2}}",
        );
        let expected = 10.0 * p * 0.5 * (1.0 - (-2.0f64).exp());
        slab.estimate(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 8192).assert_is(expected, 5e-3);
    }
}

/// A lamp in fog, at distance d from the eye, seen directly: L e^(−σ_t d), each lane with its own σ_t, of
/// which a part scatters (into black).
#[test]
fn a_lamp_in_fog_is_dimmed_by_what_is_between() {
    let scene = bench(&format!(
        "media: {{fog: {{homogeneous: {{absorption: 0.25}}}}}}\nmedium: fog\nshapes: [{{sphere: {{radius: 1, {LAMP}}}}}]\n"
    ));
    assert_close(scene.look(v(0.0, 0.0, 5.0), DVec3::ZERO), (-1.0f64).exp(), 2e-6);
    // A floor lit through the fog: both legs are dimmed.
    let scene = bench(
        "media: {fog: {homogeneous: {absorption: 0.25}}}\nmedium: fog\n\
         lights: [{point: {position: [0, 2, 0], intensity: 4}}]\n\
         shapes: [{plane: {normal: [0, 1, 0], material: {diffuse: {reflectance: 0.6}}}}]\n",
    );
    let expected = 0.6 / PI * (-0.25f64 * 2.0).exp() * (-0.25f64 * 3.0).exp();
    assert_close(scene.look(v(0.0, 3.0, 0.0), DVec3::ZERO), expected, 2e-6);
}

/// Paths that a fog without end takes far from lamp and eye end the sooner for it, with the light of those that come back: roulette
/// changes no mean, whether paths come from the eye or from the lamp, and paths then have fewer of the sixty vertices that
/// they may have.
#[test]
fn light_that_comes_back_from_far_in_endless_fog_is_all_there() {
    let scene = |integrator: &str, roulette: u32, samples: u32| {
        format!(
            "camera: {{origin: [0, 0, 3], target: [0, 0, 0], fov_deg: 30}}\nimage: {{width: 12, height: 12}}\n\
             render: {{samples: {samples}}}\nmedia: {{fog: {{homogeneous: {{scattering: 1}}}}}}\nmedium: fog\n\
             integrator: {{{integrator}: {{max_depth: 60, roulette_depth: {roulette}}}}}\n\
             shapes: [{{sphere: {{radius: 0.5, {LAMP}}}}}]\n"
        )
    };
    for (integrator, samples) in [("path", 512), ("light_tracer", 1536)] {
        let [with, without] = [5, 1000].map(|roulette| pictures::render(&scene(integrator, roulette, samples)));
        pictures::assert_agree(integrator, &with, &without);
    }
    let past_the_lamp = ray(v(0.0, 0.0, 3.0), v(0.8, 0.0, 0.0));
    let vertices = |roulette: u32| {
        let bench = bench_with(&scene("path", roulette, 1), &[]);
        bench.estimate_of(&past_the_lamp, 2048, |light, _| light.events.into()).mean
    };
    let [with, without] = [5, 1000].map(vertices);
    assert!(without > 40.0 && with < 0.8 * without, "{with} {without}");
}

/// Nested boundaries: a clear hole of diameter 1 in fog of diameter 2 leaves one metre of fog on the way.
#[test]
fn a_hole_in_fog_is_clear() {
    let scene = bench(
        "media: {fog: {homogeneous: {absorption: 0.7}}}\nlights: [{constant: {radiance: 1}}]\nshapes:\n\
         - sphere: {radius: 1, material: {boundary: {}}, inside: fog}\n\
         - sphere: {radius: 0.5, material: {boundary: {}}, outside: fog}\n",
    );
    assert_close(scene.look(v(0.0, 0.0, 5.0), DVec3::ZERO), (-0.7f64).exp(), 2e-6);
}

/// Light on its way to a floor crosses a hole in the fog: it is dimmed before and behind it, by 1.5 of 2 metres.
#[test]
fn light_to_a_floor_is_dimmed_on_every_stretch_of_its_way() {
    let scene = bench(
        "media: {fog: {homogeneous: {absorption: 0.25}}, empty: {homogeneous: {}}}\nmedium: fog\n\
         lights: [{point: {position: [0, 2, 0], intensity: 4}}]\nshapes:\n\
         - plane: {normal: [0, 1, 0], material: {diffuse: {reflectance: 0.6}}}\n\
         - sphere: {center: [0, 1, 0], radius: 0.25, material: {boundary: {}}, inside: empty}\n",
    );
    let expected = 0.6 / PI * (-0.25f64 * 1.5).exp() * (-0.25f64 * 3.0).exp();
    assert_close(scene.look(v(1.8, 2.4, 0.0), DVec3::ZERO), expected, 2e-6);
}

/// What stands in smoke need not say so where light never crosses it: on the way from a lamp to a floor light is dimmed by what fills
/// the cube around both, whether it is followed from the camera, which comes through the face of the cube, or from the lamp.
#[test]
fn what_stands_in_a_body_of_smoke_is_lit_through_it() {
    let lit = |integrator: &str, samples: u32, sides: &str| {
        bench(&format!(
            "render: {{samples: {samples}}}\nintegrator: {{{integrator}: {{max_depth: 2}}}}\n\
                 media: {{smoke: {{homogeneous: {{absorption: 0.7}}}}}}\nshapes:\n\
                 - cube: {{size: 3, material: {{boundary: {{}}}}, inside: smoke}}\n\
                 - rectangle: {{corner: [-1, -1, 1], edge_u: [2, 0, 0], edge_v: [0, 0.5, -2]{sides}}}\n\
                 - disk: {{center: [0, 1.2, 0], normal: [0, -1, 0], radius: 0.4, {LAMP}{sides}}}\n"
        ))
        .grey()
        .picture()
        .mean()
    };
    let written = lit("path", 4096, ", inside: smoke, outside: smoke");
    lit("path", 4096, "").assert_agrees(&written, 1e-2);
    lit("light_tracer", 16384, "").assert_agrees(&written, 1e-2);
}

/// A sheet of nothing between a lamp and a floor changes neither what is found from the lamp nor what is found
/// from the floor: F = ½ for a disc of radius 1 at height 1.
#[test]
fn a_lamp_seen_through_a_boundary_lights_a_floor_by_its_form_factor() {
    let scene = bench(&format!(
        "media: {{empty: {{homogeneous: {{}}}}}}\nshapes:\n\
         - plane: {{normal: [0, 1, 0], material: {{diffuse: {{reflectance: 0.6}}}}}}\n\
         - disk: {{center: [0, 1, 0], normal: [0, -1, 0], radius: 1, {LAMP}}}\n\
         - cube: {{center: [0, 0.5, 0], size: [9, 0.6, 9], material: {{boundary: {{}}}}, inside: empty}}\n"
    ));
    assert!(scene.prepared.plan.media);
    scene.estimate(&ray(v(0.0, 0.1, 0.1), DVec3::ZERO), 8192).assert_is(0.3, 2e-3);
}

/// All eight wavelengths share the choice of how far to fly (their densities are summed), so where σ spans a
/// factor of 160 the noise stays that of grey fog; led by one wavelength alone it would be several times that.
#[test]
fn wavelengths_share_the_sampling_of_coloured_fog() {
    let noise = |scattering: &str| {
        let scene = bench(&format!(
            "media: {{m: {{homogeneous: {{scattering: {scattering}}}}}}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
             render: {{techniques: {{even_sky: on}}}}\n\
             shapes: [{{sphere: {{radius: 1, material: {{boundary: {{}}}}, inside: m}}}}]\n"
        ));
        let found = scene.luminance(&ray(v(0.3, 0.2, 5.0), v(0.3, 0.2, 0.0)), 4096);
        found.assert_is(1.0, 0.1);
        found.error
    };
    let (coloured, grey) = (noise("{table: [[360, 8], [830, 0.05]]}"), noise("4"));
    assert!(coloured < 2.0 * grey, "coloured {coloured}, grey {grey}");
}

/// A grey lamp behind coloured fog that only scatters, seen directly: what comes through is e^(−σd) of each
/// wavelength, and since the densities of all eight are summed, no path is brighter than the lamp. Led by one
/// wavelength alone, a path that came through where that one is dense would be up to e⁴ times as bright.
#[test]
fn no_path_through_coloured_fog_is_brighter_than_the_lamp_behind_it() {
    let scene = filled(
        "{scattering: {table: [[360, 2], [830, 0.05]]}}",
        "{boundary: {}}",
        &format!(
            "- rectangle: {{corner: [-1, -1, -3], edge_u: [2, 0, 0], edge_v: [0, 2, 0], {LAMP}}}\n\
             integrator: {{path: {{max_depth: 1}}}}"
        ),
    );
    let straight = ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0));
    let brightest = std::cell::Cell::new(0.0f64);
    let found = scene.estimate_of(&straight, 8192, |light, wavelengths| {
        brightest.set(brightest.get().max(mean(light.radiance)));
        f64::from(observer::xyz(light.radiance, wavelengths)[1])
    });
    assert!((0.9..1.0 + 1e-5).contains(&brightest.get()), "{}", brightest.get());
    let expected: f64 = (0..4700)
        .map(|i| {
            let nm = 360.05 + 0.1 * f64::from(i);
            let sigma = 2.0 - (nm - 360.0) * 1.95 / 470.0;
            (-2.0 * sigma).exp() * observer::matching(nm)[1] * 0.1
        })
        .sum();
    found.assert_is(expected / observer::Y_INTEGRAL, 3e-2);
}

/// Fog of σd = 2·10⁻⁶, which one path in 500 000 meets, and of 2·10⁹, which none leaves: no light that is no number or
/// negative, and of the thin one no more than there is.
#[test]
fn the_thinnest_and_the_densest_fog_stay_within_bounds() {
    let scene = filled(
        "{scattering: 1.0e-6}",
        "{boundary: {}}",
        "lights: [{directional: {direction: [0, 0, -1], irradiance: 1}}]\nintegrator: {path: {max_depth: 2}}",
    );
    let found = scene.estimate(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 2048);
    assert!((0.0..=1.0).contains(&found.mean), "{found:?}");
    let dense = filled("{scattering: 1.0e+9}", "{boundary: {}}", "lights: [{constant: {radiance: 1}}]");
    let found = dense.estimate(&ray(v(0.1, 0.2, 5.0), v(0.1, 0.2, 0.0)), 256);
    assert!(found.mean.is_finite() && found.mean >= 0.0, "{found:?}");
}

/// One search for all that a shadow ray goes through finds what going from surface to surface finds: nested cubes and
/// spheres of boundaries, from outside, from within and from a surface, in the same order and at the same distances to
/// 1e-12 of the size of the scene; and where something opaque stands, that.
#[test]
fn one_search_lists_what_a_walk_from_surface_to_surface_meets() {
    let bench = bench(
        "shapes:\n- cube: {size: 2, material: {boundary: {}}}\n- sphere: {radius: 0.7, material: {boundary: {}}}\n\
         - cube: {size: 0.5, material: {boundary: {}}}\n- sphere: {center: [5, 0, 0], radius: 1, material: {diffuse: {}}}\n",
    );
    let scene = &bench.prepared.scene;
    let (mut open, mut blocked) = (0, 0);
    for i in 0..400 {
        let (a, b) = (f64::from(i) * 0.731, f64::from(i % 20) * 0.3);
        let direction = DVec3::new(a.cos(), 0.4 * (1.7 * a).sin(), a.sin()).normalize();
        let mut ray = Ray::new(-direction * b + DVec3::new(0.01, 0.02, 0.03), direction);
        if i % 3 == 0
            && let Some(hit) = scene.closest(&ray, f64::INFINITY)
        {
            ray = scene.leave(&scene.surface(&ray, &hit), &hit, direction);
        }
        let (mut walked, mut on, mut gone, mut opaque) = (Vec::new(), ray, 0.0, false);
        while let Some(hit) = scene.closest(&on, f64::INFINITY) {
            if !scene.materials[scene.objects[hit.object as usize].material as usize].lets_through() {
                opaque = true;
                break;
            }
            gone += hit.t;
            walked.push((hit.object, gone));
            on = scene.leave(&scene.surface(&on, &hit), &hit, direction);
        }
        match scene.way(&ray, f64::INFINITY, None) {
            Way::Open(crossed) => {
                open += 1;
                assert!(!opaque);
                assert_eq!(crossed.hits().len(), walked.len());
                for (hit, (object, t)) in crossed.hits().iter().zip(walked) {
                    assert_eq!(hit.object, object);
                    assert!((hit.t - t).abs() < 1e-11, "{} {t}", hit.t);
                }
            }
            Way::Blocked => {
                blocked += 1;
                assert!(opaque);
            }
            Way::Long => panic!("six surfaces fit"),
        }
    }
    assert!(open > 300 && blocked > 5, "{open} {blocked}");
}
