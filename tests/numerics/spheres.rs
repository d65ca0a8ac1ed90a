//! Spheres of any size, anywhere, seen from any distance; lamps that are spheres; shells.

use crate::xml::{Answer, Case, DIRECT, GREY, SKY, camera, glass, hold, shape, shining, sphere};

/// Every sample of a convex diffuse body in an even sky is its albedo: light and surface are drawn from one density. What
/// is left is the rounding of some thirty operations in f32.
const EXACT: f64 = 2e-6;

/// A convex body of albedo ½ in an even sky of 1 sends ρ = 0.5 into every pixel, whatever its size, place and distance.
#[test]
fn a_sphere_shows_its_albedo_at_any_size_place_and_distance() {
    let mut cases = Vec::new();
    let half = Answer::Every(0.5, EXACT);
    for r in [1e-12, 1e-8, 1e-6, 3e-4, 1.0, 7e3, 1e6, 1e9, 1e12] {
        let body = camera([0.0, 0.0, 5.0 * r], [0.0; 3], 10.0) + &sphere([0.0; 3], r, GREY) + SKY;
        cases.push(Case::new(format!("radius {r:e}"), body, half));
    }
    for d in [1e3, 1e5, 1e6, 1e7, 1e8, 1e10] {
        let fov = (1.0f64 / d).to_degrees();
        let body = camera([0.0, 0.0, d], [0.0; 3], fov) + &sphere([0.0; 3], 1.0, GREY) + SKY;
        cases.push(Case::new(format!("seen from {d:e}"), body, half));
    }
    for shift in [1e5, 1e7, 1e9] {
        let c = [shift, -0.7 * shift, 0.3 * shift];
        let body = camera([c[0], c[1], c[2] + 5.0], c, 5.0) + &sphere(c, 1.0, GREY) + SKY;
        cases.push(Case::new(format!("moved by {shift:e}"), body, half));
        let to_world = format!("<translate x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/>", c[0], c[1], c[2]);
        let body = camera([c[0], c[1], c[2] + 5.0], c, 5.0) + &shape("sphere", &to_world, GREY) + SKY;
        cases.push(Case::new(format!("moved by a transform by {shift:e}"), body, half));
    }
    for radius in [1e3, 1e5, 1e7, 6.371e6, 1e9] {
        let body = camera([0.0, 1.0, 0.0], [2.0, 0.0, 0.0], 20.0) + &sphere([0.0, -radius, 0.0], radius, GREY) + SKY;
        cases.push(Case::new(format!("ground of radius {radius:e}"), body, half));
    }
    hold(&cases);
}

/// A lamp of radius r straight above a floor at distance 1 with L = 1/r²: E = π, and back comes ρ E/π = ½. The
/// camera sees a spot of 1e-4, across which E falls by 1e-8 of it.
#[test]
fn tiny_and_distant_lamps_light_by_the_inverse_square() {
    let mut cases = Vec::new();
    let floor = |s: f64| shape("rectangle", &format!("<scale value=\"{s:?}\"/><rotate x=\"1\" angle=\"-90\"/>"), GREY);
    for r in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8] {
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01)
            + &sphere([0.0, 1.0, 0.0], r, &shining(1.0 / (r * r)))
            + &floor(1.0);
        cases.push(Case::new(format!("lamp of radius {r:e}"), body, Answer::Every(0.5, 1e-5)).integrator(DIRECT));
    }
    for d in [1e3, 1e5, 1e7, 1e9, 1.5e11f64] {
        let r = d * 4.65e-3;
        let l = (d / r).powi(2);
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01) + &sphere([0.0, d, 0.0], r, &shining(l)) + &floor(1.0);
        cases.push(Case::new(format!("sun at {d:e}"), body, Answer::Every(0.5, 2e-5)).integrator(DIRECT));
        let lamp = format!(
            "<emitter type=\"point\"><point name=\"position\" value=\"0, {d:?}, 0\"/><spectrum name=\"intensity\" value=\"{:?}\"/></emitter>",
            std::f64::consts::PI * d * d
        );
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01) + &lamp + &floor(1.0);
        cases.push(Case::new(format!("point at {d:e}"), body, Answer::Every(0.5, 1e-5)).integrator(DIRECT));
        let cutoff = 0.01;
        let lamp = format!(
            "<emitter type=\"spot\"><transform name=\"to_world\"><lookat origin=\"0, {d:?}, 0\" target=\"0, 0, 0\" up=\"0, 0, 1\"/></transform>\
             <float name=\"cutoff_angle\" value=\"{cutoff}\"/><float name=\"beam_width\" value=\"{}\"/>\
             <spectrum name=\"intensity\" value=\"{:?}\"/></emitter>",
            0.5 * cutoff,
            std::f64::consts::PI * d * d
        );
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01) + &lamp + &floor(1.0);
        cases.push(Case::new(format!("spot at {d:e}"), body, Answer::Every(0.5, 1e-5)).integrator(DIRECT));
    }
    // As small beside their distance as the rounding of their coordinates and smaller.
    for (r, d) in [(1e-12, 1e3), (1e-10, 1e6), (1e-11, 1e6)] {
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01)
            + &sphere([0.0, d, 0.0], r, &shining((d / r).powi(2)))
            + &floor(1.0);
        cases.push(Case::new(format!("ball of {r:e} at {d:e}"), body, Answer::Every(0.5, 1e-5)).integrator(DIRECT));
    }
    // Narrow spots, seen where they are full, where they fall off from half of the cutoff on, and beyond. What the camera sees is
    // 2 tan 0.1° of the radius of the spot, across which light falls evenly, from the middle of the pixels.
    for cutoff in [1e-4_f64, 1e-6, 1e-7] {
        let d = 1e6;
        let radius = d * cutoff.to_radians();
        for (share, expected) in [(0.3, 0.5), (0.75, 0.25), (0.95, 0.05), (1.1, 0.0)] {
            let lamp = format!(
                "<emitter type=\"spot\"><transform name=\"to_world\"><lookat origin=\"0, {d:?}, 0\" target=\"0, 0, 0\" up=\"0, 0, 1\"/></transform>\
                 <float name=\"cutoff_angle\" value=\"{cutoff:?}\"/><float name=\"beam_width\" value=\"{:?}\"/>\
                 <spectrum name=\"intensity\" value=\"{:?}\"/></emitter>",
                0.5 * cutoff,
                std::f64::consts::PI * d * d
            );
            let x = share * radius;
            let body = camera([x, radius, 1e-3 * radius], [x, 0.0, 0.0], 0.2) + &lamp + &floor(4.0);
            let name = format!("spot of {cutoff:e} degrees at {share}");
            cases.push(Case::new(name, body, Answer::Mean(expected, 5e-4)).integrator(DIRECT));
        }
    }
    // The same at another scale and place.
    for s in [1e-8, 1e-6, 1e6] {
        let r = 1e-3 * s;
        let body = camera([s, s, 0.0], [0.0; 3], 0.01) + &sphere([0.0, s, 0.0], r, &shining(1e6)) + &floor(s);
        cases.push(
            Case::new(format!("lamp and floor at scale {s:e}"), body, Answer::Every(0.5, 1e-5)).integrator(DIRECT),
        );
    }
    // A disc and a rectangle: E = π L sin²θ; for the small rectangle L A / d².
    for r in [1e-3, 1e-5, 1e-7] {
        let at = format!("<scale value=\"{r:?}\"/><rotate x=\"1\" angle=\"90\"/><translate y=\"1\"/>");
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01) + &shape("disk", &at, &shining(1.0 / (r * r))) + &floor(1.0);
        cases.push(Case::new(format!("disk of radius {r:e}"), body, Answer::Every(0.5, 1e-5)).integrator(DIRECT));
        let l = std::f64::consts::PI / (4.0 * r * r);
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 0.01) + &shape("rectangle", &at, &shining(l)) + &floor(1.0);
        cases.push(
            Case::new(format!("rectangle of half side {r:e}"), body, Answer::Every(0.5, 1e-5)).integrator(DIRECT),
        );
        // So small a spot that no side of the cube but the lower is seen from it.
        let body = camera([1.0, 1.0, 0.0], [0.0; 3], 10.0 * r)
            + &shape("cube", &format!("<scale value=\"{r:?}\"/><translate y=\"{:?}\"/>", 1.0 + r), &shining(l))
            + &floor(1.0);
        cases.push(
            Case::new(format!("cube of half side {r:e}"), body, Answer::Every(0.5, 1e-5 + 4.0 * r)).integrator(DIRECT),
        );
    }
    hold(&cases);
}

/// A shell of index 1 around a body does nothing: ρ = ½ in every pixel, however thin the gap, and however many shells.
#[test]
fn thin_shells_that_do_nothing_do_nothing() {
    let mut cases = Vec::new();
    let half = Answer::Every(0.5, EXACT);
    for gap in [1e-2, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10] {
        let body = camera([0.0, 0.0, 5.0], [0.0; 3], 5.0)
            + &sphere([0.0; 3], 1.0, GREY)
            + &sphere([0.0; 3], 1.0 + gap, &glass(1.0, 1.0))
            + SKY;
        cases.push(Case::new(format!("shell {gap:e}"), body, half));
        let body = camera([0.0, 0.0, 5.0], [0.0; 3], 5.0)
            + &sphere([0.0; 3], 1.0, GREY)
            + &sphere([0.0; 3], 1.0 + gap, "<bsdf type=\"null\"/>")
            + SKY;
        cases.push(Case::new(format!("null shell {gap:e}"), body, half));
    }
    for gap in [1e-4, 1e-6, 1e-8] {
        let mut body = camera([0.0, 0.0, 5.0], [0.0; 3], 5.0) + &sphere([0.0; 3], 1.0, GREY) + SKY;
        for i in 1..=10 {
            body += &sphere([0.0; 3], 1.0 + gap * f64::from(i), &glass(1.0, 1.0));
        }
        cases.push(Case::new(format!("ten shells {gap:e}"), body, half));
    }
    for (shift, gap) in [(1e3, 1e-6), (1e5, 1e-5), (1e6, 1e-5)] {
        let c = [shift, 0.0, 0.0];
        let body =
            camera([shift, 0.0, 5.0], c, 5.0) + &sphere(c, 1.0, GREY) + &sphere(c, 1.0 + gap, &glass(1.0, 1.0)) + SKY;
        cases.push(Case::new(format!("shell {gap:e} at {shift:e}"), body, half));
    }
    for r in [1e-6, 1e6] {
        let body = camera([0.0, 0.0, 5.0 * r], [0.0; 3], 5.0)
            + &sphere([0.0; 3], r, GREY)
            + &sphere([0.0; 3], r * (1.0 + 1e-6), &glass(1.0, 1.0))
            + SKY;
        cases.push(Case::new(format!("shell 1e-6 at radius {r:e}"), body, half));
    }
    hold(&cases);
}

/// Clear glass neither adds nor takes: in an even sky of 1 every pixel is 1, whatever index, size and place.
#[test]
fn clear_bodies_are_invisible_at_any_index_size_and_place() {
    let mut cases = Vec::new();
    let one = Answer::Every(1.0, 2e-5);
    for (int, ext) in
        [(1.0000001f64, 1.0), (1.000001, 1.0), (1.5, 1.0), (2.4, 1.0), (5.0, 1.0), (1.0, 1.5), (1.0, 5.0), (1.33, 1.5)]
    {
        for r in [1.0, 1e-6] {
            let body = camera([0.0, 0.0, 5.0 * r], [0.0; 3], 24.0) + &sphere([0.0; 3], r, &glass(int, ext)) + SKY;
            cases.push(Case::new(format!("ball {int}/{ext} of radius {r:e}"), body, one));
        }
        let body = camera([3.0, 2.0, 5.0], [0.0; 3], 40.0)
            + &shape("cube", "<rotate y=\"1\" angle=\"13\"/>", &glass(int, ext))
            + SKY;
        cases.push(Case::new(format!("cube {int}/{ext}"), body, one));
        // Along an axis of the cube no ray is trapped; within, radiance is (n / n outside)² as much.
        let within = (int / ext) * (int / ext);
        let body = camera([0.1, 0.2, 0.3], [1.0, 0.2, 0.3], 10.0) + &shape("cube", "", &glass(int, ext)) + SKY;
        cases.push(Case::new(format!("in a cube {int}/{ext}"), body, Answer::Every(within, 2e-5 * within)));
        let thin = glass(int, ext).replace("\"dielectric\"", "\"thindielectric\"");
        let body = camera([0.0, 0.0, 5.0], [0.0; 3], 24.0) + &sphere([0.0; 3], 1.0, &thin) + SKY;
        cases.push(Case::new(format!("thin ball {int}/{ext}"), body, one));
    }
    for gap in [1e-2, 1e-4, 1e-6] {
        let body = camera([0.0, 0.0, 5.0], [0.0; 3], 24.0)
            + &sphere([0.0; 3], 1.0, &glass(1.5, 1.0))
            + &sphere([0.0; 3], 1.0 - gap, &glass(1.0, 1.5))
            + SKY;
        cases.push(Case::new(format!("bubble of a wall of {gap:e}"), body, one));
    }
    for shift in [1e4, 1e6, 1e8] {
        let c = [shift, shift, 0.0];
        let body = camera([shift, shift, 5.0], c, 24.0) + &sphere(c, 1.0, &glass(1.5, 1.0)) + SKY;
        cases.push(Case::new(format!("ball at {shift:e}"), body, one));
    }
    hold(&cases);
}
