//! Channels of a picture besides its own: bands of the spectrum, layers of surfaces, squares.

use super::common::{SPREAD_NM, assert_close, bench_with, wavelengths};
use super::pictures::{PARALLEL, render, render_with};
use abbe::film::filter::Filter;
use abbe::math::statistics::Moments;
use abbe::spectrum::{ColourSpace, Lanes, observer};
use std::f64::consts::PI;

/// In light of radiance one from everywhere a band holds ∫ response dλ: 25 for a box of 25 nm, 940 for twice the
/// whole band of 470 nm, 50 for a triangle 100 nm wide. Pixels are independent.
#[test]
fn bands_are_integrals_over_the_wavelength() {
    let frame = render(&format!(
        "{PARALLEL}render: {{samples: 64}}\nlights: [{{constant: {{radiance: 1}}}}]\n\
         image:\n  width: 16\n  height: 16\n  bands:\n\
         \x20 - {{name: box, response: {{table: [[380, 1], [405, 1]]}}}}\n\
         \x20 - {{name: all, response: 2}}\n\
         \x20 - {{name: triangle, response: {{table: [[500, 0], [550, 1], [600, 0]]}}}}\n"
    ));
    for (channel, expected) in [25.0, 940.0, 50.0].into_iter().enumerate() {
        let found: Moments = frame.layer(channel).iter().map(|x| f64::from(*x)).collect();
        let (mean, error) = (found.mean, found.standard_error());
        assert!((mean - expected).abs() < 4.0 * error && error < 0.01 * expected, "{expected}: {mean} ± {error}");
    }
}

/// A rectangle of 2 × 4 across parallel rays: u and v run from 0 to 1 over its edges. A sphere of radius r seen at its
/// middle, where the camera looks at longitude zero of the equator: 2πr a turn of u, πr from pole to pole.
#[test]
fn layers_of_surfaces_are_their_closed_forms() {
    let layers = "layers:\n- {name: d, surface: depth}\n- {name: p, surface: position}\n- {name: n, surface: geometric_normal}\n\
                  - {name: t, surface: uv}\n- {name: u, surface: dp_du}\n- {name: v, surface: dp_dv}\n- {name: x, surface: duv_dx}\n\
                  - {name: i, surface: shape}\n- {name: a, surface: albedo}\n";
    let scene = |shape: &str, size: u32| {
        let camera = PARALLEL.replace("height: 2", "height: 2, clip: {near: 1.5, far: 20}");
        let text = format!(
            "{camera}image: {{width: {size}, height: {size}}}\nrender: {{samples: 16}}\nintegrator: none\n{layers}shapes:\n- {shape}\n"
        );
        let frame = render_with(&bench_with(&text, &[]).grey(), Filter::Box, 32);
        move |channel: usize, pixel: usize| f64::from(frame.layer(channel)[pixel])
    };
    let of = scene(
        "rectangle: {corner: [-1, -2, 0], edge_u: [2, 0, 0], edge_v: [0, 4, 0], material: {diffuse: {reflectance: 0.25}}}",
        2,
    );
    // The middle of the upper left pixel is (−½, ½): stratified samples average to it within a quarter of their share.
    let expected = [3.5, -0.5, 0.5, 0.0, 0.0, 0.0, 1.0, 0.25, 0.625, 2.0, 0.0, 0.0, 0.0, 4.0, 0.0];
    for (channel, expected) in expected.into_iter().enumerate() {
        let tolerance = if (1..3).contains(&channel) || (7..9).contains(&channel) { 0.05 } else { 1e-6 };
        assert!((of(channel, 0) - expected).abs() < tolerance, "{channel}: {} {expected}", of(channel, 0));
    }
    // A pixel is one metre and samples stand a quarter of it apart: Δu = ¼ / 2.
    assert!((of(15, 0) - 0.125).abs() < 1e-6 && of(16, 0).abs() < 1e-6);
    assert_eq!(of(17, 0), 1.0);
    // Light on a reflectance of ¼ is as much as a radiance of ¼ in the quadrature of eight wavelengths; some thirty f32
    // operations.
    let [x, y, z] = observer::xyz(Lanes::ONE, &wavelengths(SPREAD_NM)).map(f64::from);
    let green = ColourSpace::Rec709.matrix_from_xyz()[1];
    assert_close(of(19, 0), 0.25 * (green[0] * x + green[1] * y + green[2] * z), 30.0 * f64::from(f32::EPSILON));

    let of = scene("sphere: {radius: 1.5}", 1);
    let length = |from: usize| (0..3).map(|c| of(from + c, 0).powi(2)).sum::<f64>().sqrt();
    // Over the one pixel of 2 m the directions of the partials turn; seen from near the axis only.
    assert!(length(9) < 2.0 * PI * 1.5 + 1e-6 && length(12) < PI * 1.5 + 1e-6);
    let narrow = render(&format!(
        "{}image: {{width: 1, height: 1}}\nrender: {{samples: 4}}\n{layers}shapes:\n- sphere: {{radius: 1.5}}\n",
        PARALLEL.replace("height: 2", "height: 1e-5")
    ));
    let length = |from: usize| (0..3).map(|c| f64::from(narrow.layer(from + c)[0]).powi(2)).sum::<f64>().sqrt();
    assert!((length(9) - 2.0 * PI * 1.5).abs() < 1e-4, "{}", length(9));
    assert!((length(12) - PI * 1.5).abs() < 1e-4, "{}", length(12));
}

/// Texture coordinates on a line tell no points apart: of them follow the axes of the surface, of length one, however the triangle
/// is turned. A number that no sum can hold (∂p/∂u of 1e13 m) takes none of the others with it.
#[test]
fn triangles_without_a_plane_of_texture_coordinates_have_layers() {
    let scene = format!(
        "{PARALLEL}image: {{width: 2, height: 2}}\nrender: {{samples: 16}}\nintegrator: none\n\
         layers:\n- {{name: d, surface: depth}}\n- {{name: u, surface: dp_du}}\n- {{name: v, surface: dp_dv}}\n\
         shapes:\n- mesh: {{file: a.obj, transform: [{{rotate: {{axis: [1, 2, 30], deg: 37}}}}]}}\n"
    );
    let of = |third: &str| {
        let corners = "v -9 -9 0\nv 9 -9 0\nv 0 9 0\n";
        let mesh = format!("{corners}vt 0 0\nvt 0.3 0.7\nvt {third}\nf 1/1 2/2 3/3\n");
        let frame = render_with(&bench_with(&scene, &[("a.obj", mesh.as_bytes())]).grey(), Filter::Box, 32);
        let length = |from: usize| (0..3).map(|c| f64::from(frame.layer(from + c)[0]).powi(2)).sum::<f64>().sqrt();
        (f64::from(frame.layer(0)[0]), [length(1), length(4)], frame.film.layers.invalid.total())
    };
    let (depth, along, dropped) = of("0.3 0.7");
    assert_eq!(dropped, 0);
    assert!(along.iter().all(|length| (length - 1.0).abs() < 1e-6), "{along:?}");
    let (plain, along, dropped) = of("1 0");
    assert!(along.iter().all(|length| *length > 2.0 && *length < 100.0) && dropped == 0, "{along:?} {dropped}");
    let (same, _, dropped) = of("-1e-13 1e-13");
    assert!(dropped > 0);
    assert_eq!([plain, same], [depth; 2]);
}

/// A number that is 0 or 1 is its own square: the mean of the squares of the coverage is the coverage. A radiance c
/// without noise has the mean square c².
#[test]
fn squares_are_second_moments() {
    let scene = format!(
        "{PARALLEL}image: {{width: 8, height: 8}}\nrender: {{samples: 64}}\n\
         layers:\n- {{name: a, squares: true}}\n- {{name: b, form: xyz, squares: true, light: {{path: {{hide_emitters: true}}}}}}\n\
         shapes:\n- disk: {{normal: [0, 0, 1], radius: 0.8, emission: 3, material: {{diffuse: {{reflectance: 0}}}}}}\n"
    );
    let bench = bench_with(&scene, &[]).grey();
    let frame = render_with(&bench, Filter::Box, 32);
    let channels = bench.prepared.plan.layers.channels();
    let plane = |channel: usize| {
        let unit = 2f32.powi(channels[channel].exponent);
        frame.layer(channel).iter().map(|x| x * unit).collect::<Vec<f32>>()
    };
    assert_eq!(plane(3), plane(7));
    assert!(plane(3).iter().any(|a| *a > 0.2 && *a < 0.8));
    // The middle pixels see the lamp alone; the hidden lamp is black.
    let (mean, square) = (plane(0)[27], plane(4)[27]);
    assert!(mean > 2.0 && (square / (mean * mean) - 1.0).abs() < 1e-6, "{mean} {square}");
    assert!((8..14).all(|channel| plane(channel).iter().all(|x| *x == 0.0)));
}
