//! Lamps that are large, near, touched, hidden or made of many parts.

use crate::common::grey_png;
use crate::meshes::icosphere;
use crate::xml::{Answer, Case, DIRECT, GREY, SKY, camera, glowing, hold, shape, shining, sphere};
use std::f64::consts::PI;

fn floor(s: f64) -> String {
    shape("rectangle", &format!("<scale value=\"{s:?}\"/><rotate x=\"1\" angle=\"-90\"/>"), GREY)
}

/// The floor below a lamp that covers the whole sky of it, as near as may be: E = π L, back comes ρ L = ½.
#[test]
fn lamps_that_touch_the_floor_light_it_by_their_whole_radiance() {
    let mut cases = Vec::new();
    let spot = |d: f64| camera([10.0 * d, 2.0 * d, 0.0], [0.0; 3], 1e-4);
    for d in [1e-1, 1e-3, 1e-6, 1e-9] {
        // A rectangle of 1e6 times its height: what it leaves of the sky is 1e-12.
        let at = format!("<scale value=\"{:?}\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"{d:?}\"/>", 1e6 * d);
        let eye = camera([d, 0.5 * d, 0.0], [0.0; 3], 1e-3);
        let body = eye.clone() + &shape("rectangle", &at, &shining(1.0)) + &floor(1e7 * d);
        cases.push(
            Case::new(format!("rectangle {d:e} above"), body, Answer::Mean(0.5, 1e-5)).samples(256).integrator(DIRECT),
        );
        let body = eye + &shape("disk", &at, &shining(1.0)) + &floor(1e7 * d);
        cases.push(
            Case::new(format!("disk {d:e} above"), body, Answer::Mean(0.5, 1e-5)).samples(256).integrator(DIRECT),
        );
        // A ball of radius 1 at d above the point: E = π L (r / (r + d))².
        let below = (1.0 / (1.0 + d)) * (1.0 / (1.0 + d));
        let body = spot(0.1 * d.min(1.0)) + &sphere([0.0, 1.0 + d, 0.0], 1.0, &shining(1.0)) + &floor(1e3);
        cases.push(
            Case::new(format!("ball {d:e} above"), body, Answer::Mean(0.5 * below, 1e-4 * d + 4e-6))
                .samples(256)
                .integrator(DIRECT),
        );
    }
    hold(&cases);
}

/// A grey ball in a shining one: L = 1 from all sides. And the lamp's own inside.
#[test]
fn a_body_inside_a_lamp_gets_light_from_all_sides() {
    let mut cases = Vec::new();
    for r in [2.0, 1.0 + 1e-3, 1.0 + 1e-6, 1e6] {
        let lamp = sphere([0.0; 3], r, &format!("<boolean name=\"flip_normals\" value=\"true\"/>{}", shining(1.0)));
        // From between the two.
        let eye = [0.0, 0.0, 0.5 * (1.0 + r.min(3.0))];
        let body = camera(eye, [0.0; 3], 20.0) + &sphere([0.0; 3], 1.0, GREY) + &lamp;
        cases.push(
            Case::new(format!("in a lamp of {r}"), body, Answer::Mean(0.5, 1e-5)).samples(256).integrator(DIRECT),
        );
    }
    hold(&cases);
}

/// A lamp that is a mesh of small triangles, as an icosphere of radius r at distance 1: what it sends is L times the
/// area of its shadow; against the ball it is smaller by less than 1 − (1 − h)², h = 5e-3 the depth of its faces. A
/// single triangle of edge e: E = L √3/4 e² at distance 1.
#[test]
fn lamps_of_tiny_triangles_light_by_their_solid_angle() {
    let mut cases = Vec::new();
    for e in [1e-2, 1e-4, 1e-6, 1e-8] {
        let l = 4.0 / (3f64.sqrt() * e * e) * PI;
        // An equilateral triangle that faces down, its middle straight above the floor.
        let (a, b) = (e / 12f64.sqrt(), e / 3f64.sqrt());
        let obj = format!("v {:?} 1 {:?}\nv {:?} 1 {:?}\nv 0 1 {:?}\nf 1 2 3\n", -0.5 * e, -a, 0.5 * e, -a, b);
        let lamp = shape("obj", "", &format!("<string name=\"filename\" value=\"m.obj\"/>{}", shining(l)));
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01) + &lamp + &floor(1.0);
        cases.push(
            Case::new(format!("triangle of {e:e}"), body, Answer::Every(0.5, 1e-5 + e * e))
                .file("m.obj", obj)
                .integrator(DIRECT),
        );
    }
    for r in [1e-2, 1e-5, 1e-7] {
        let ball = icosphere(3).map(|p| [r * p[0], 1.0 + r * p[1], r * p[2]]);
        let lamp = shape("obj", "", &format!("<string name=\"filename\" value=\"m.obj\"/>{}", shining(1.0 / (r * r))));
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01) + &lamp + &floor(1.0);
        cases.push(
            Case::new(format!("icosphere of {r:e}"), body, Answer::Mean(0.5, 4e-3))
                .file("m.obj", ball.obj())
                .samples(256)
                .integrator(DIRECT),
        );
    }
    hold(&cases);
}

/// A convex white body of any opacity is invisible in an even sky, a blend of two has the mean albedo, flat relief is none,
/// a picture of one value has it everywhere, and a lens of any size sees an even wall.
#[test]
fn masks_blends_and_reliefs_of_nothing_are_what_they_hold() {
    let ball = |bsdf: &str| camera([0.0, 0.0, 5.0], [0.0; 3], 10.0) + &sphere([0.0; 3], 1.0, bsdf) + SKY;
    let diffuse =
        |rho: f64| format!("<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"{rho:?}\"/></bsdf>");
    let mut cases = Vec::new();
    // A mask of weight w shows w of the body and the sky behind it, through its far side, of which the same holds:
    // there the normal faces away and the body is black.
    for w in [0.0, 1e-6, 0.3, 1.0] {
        let bsdf = format!(
            "<bsdf type=\"mask\"><float name=\"opacity\" value=\"{w:?}\"/><bsdf type=\"twosided\">{}</bsdf></bsdf>",
            diffuse(1.0)
        );
        cases.push(Case::new(format!("mask {w}"), ball(&bsdf), Answer::Mean(1.0, 1e-5)).samples(256));
    }
    for w in [0.0, 1e-6, 0.3, 1.0] {
        let bsdf = format!(
            "<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"{w:?}\"/>{}{}</bsdf>",
            diffuse(0.2),
            diffuse(0.8)
        );
        cases.push(Case::new(format!("blend {w}"), ball(&bsdf), Answer::Mean(0.2 + 0.6 * w, 1e-5)).samples(256));
    }
    let bump = format!(
        "<bsdf type=\"bumpmap\"><texture type=\"bitmap\" name=\"arbitrary\"><boolean name=\"raw\" value=\"true\"/><string name=\"filename\" value=\"flat.png\"/></texture><float name=\"scale\" value=\"1e3\"/>{GREY}</bsdf>"
    );
    cases.push(
        Case::new("flat bumps", ball(&bump), Answer::Every(0.5, 2e-6)).file("flat.png", grey_png(4, 4, |_, _| 100)),
    );
    for (w, h) in [(1, 1), (1, 7), (3, 5), (64, 1)] {
        let bitmap = "<bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\"><boolean name=\"raw\" value=\"true\"/><string name=\"filename\" value=\"flat.png\"/><transform name=\"to_uv\"><scale x=\"1e5\" y=\"-3e-7\"/></transform></texture></bsdf>";
        cases.push(
            Case::new(format!("bitmap {w} x {h}"), ball(bitmap), Answer::Every(0.2, 1e-3))
                .file("flat.png", grey_png(w, h, |_, _| 51)),
        );
    }
    for lens in [1e-9, 1e-3, 1.0, 1e3] {
        let body = camera([0.0, 0.0, 5.0], [0.0; 3], 10.0).replace("\"perspective\">", &format!("\"thinlens\"><float name=\"aperture_radius\" value=\"{lens:?}\"/><float name=\"focus_distance\" value=\"5\"/>"));
        let wall = shape("rectangle", "<scale value=\"1e7\"/>", GREY);
        cases.push(Case::new(format!("lens {lens:e}"), body + &wall + SKY, Answer::Every(0.5, 2e-6)));
    }
    hold(&cases);
}

/// A ball that shines outward does not light its own inside: rounding puts points of its wall a little out of it, from where it
/// must not look like a lamp that is touched.
#[test]
fn a_ball_of_light_is_dark_within() {
    let eye = |r: f64| camera([0.2 * r, 0.3 * r, 0.0], [0.0, 0.0, -r], 60.0);
    let cases: Vec<Case> = [1e-9, 1e-3, 0.123, 0.5, 0.6, 0.7, 1.0, 2.0, 3.0, 1e6]
        .into_iter()
        .flat_map(|r| {
            let grey = glowing(0.5);
            let at = |x: f64| [x, 0.0, 0.0];
            let moved = camera([1e3 * r + 0.2 * r, 0.3 * r, 0.0], [1e3 * r, 0.0, -r], 60.0);
            [
                Case::new(format!("ball of {r}"), eye(r) + &sphere([0.0; 3], r, &grey), Answer::Every(0.0, 0.0)),
                Case::new(format!("far ball of {r}"), moved + &sphere(at(1e3 * r), r, &grey), Answer::Every(0.0, 0.0)),
            ]
        })
        .collect();
    hold(&cases);
}

/// A lamp of intensity 2π at h above grey ground of radius R: the ground below it has L = ρ/π I/h² = 1 with I = 2π h², however
/// large the ground is beside it. Seen within 0.01°, of 1e-4 h: cosines differ from 1 by less than 1e-6.
#[test]
fn a_lamp_just_above_a_large_ground_lights_it() {
    let mut cases = Vec::new();
    for (h, r) in [(1.0, 1e2), (1.0, 6.371e6), (1e-3, 1e5), (1e3, 1e10), (1e-9, 1.0)] {
        let lamp = format!(
            "<emitter type=\"point\"><point name=\"position\" x=\"0\" y=\"{h:?}\" z=\"0\"/><spectrum name=\"intensity\" \
             value=\"{:?}\"/></emitter>",
            2.0 * PI * h * h
        );
        let eye = camera([0.5 * h, 0.5 * h, 0.0], [0.0; 3], 0.01);
        let body = eye + &sphere([0.0, -r, 0.0], r, GREY) + &lamp;
        cases.push(Case::new(format!("{h:e} above {r:e}"), body, Answer::Every(1.0, 1e-5)).integrator(DIRECT));
    }
    hold(&cases);
}
