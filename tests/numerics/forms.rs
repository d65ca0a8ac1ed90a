//! Other forms than spheres: cylinders, disks, rectangles, cubes, copies, curves, under every transform.

use crate::xml::{Answer, Case, GREY, SKY, glass, hold, list, parallel, shape};

const HALF: Answer = Answer::Every(0.5, 2e-6);

/// Convex bodies of albedo ½ in an even sky of 1: ½ in every pixel.
#[test]
fn stretched_turned_and_moved_bodies_show_their_albedo() {
    let mut cases = Vec::new();
    let mut body = |name: String, eye: [f64; 3], at: [f64; 3], half: f64, shape: String| {
        cases.push(Case::new(name, parallel(eye, at, half) + &shape + SKY, HALF));
    };
    for s in [1e-8, 1e-6, 1.0, 1e6] {
        for (name, scale) in
            [("cube", [s, s, s]), ("stretched cube", [1e3 * s, s, 1e-3 * s]), ("flat cube", [s, s, 1e-9 * s])]
        {
            let to = format!(
                "<scale x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/><translate x=\"{:?}\"/>",
                scale[0],
                scale[1],
                scale[2],
                1e3 * s
            );
            body(
                format!("{name} {s:e}"),
                [1e3 * s, 0.0, 5.0 * s],
                [1e3 * s, 0.0, 0.0],
                0.9 * s,
                shape("cube", &to, GREY),
            );
        }
        for (name, r, l) in [("cylinder", 1.0, 1.0), ("wire", 1e-6, 1.0), ("long wire", 1e-3, 1e6)] {
            let ends = format!(
                "<point name=\"p0\" value=\"{}\"/><point name=\"p1\" value=\"{}\"/><float name=\"radius\" value=\"{:?}\"/>{GREY}",
                list([-l * s, 0.0, 0.0]),
                list([l * s, 0.0, 0.0]),
                r * s
            );
            body(
                format!("{name} {s:e}"),
                [0.0, 0.0, 5.0 * s],
                [0.0; 3],
                0.5 * r * s,
                format!("<shape type=\"cylinder\">{ends}</shape>"),
            );
        }
        let to = format!(
            "<scale x=\"{:?}\" y=\"{:?}\"/><rotate y=\"1\" angle=\"89.9\"/><translate y=\"{:?}\"/>",
            s,
            1e4 * s,
            1e5 * s
        );
        body(format!("disk {s:e}"), [0.0, 1e5 * s, 5.0 * s], [0.0, 1e5 * s, 0.0], 1e-3 * s, shape("disk", &to, GREY));
        body(
            format!("rectangle {s:e}"),
            [0.0, 1e5 * s, 5.0 * s],
            [0.0, 1e5 * s, 0.0],
            1e-3 * s,
            shape("rectangle", &to, GREY),
        );
        let matrix =
            format!("<matrix value=\"{s:?} {:?} 0 0  0 {s:?} {:?} 0  0 0 {s:?} 0  0 0 0 1\"/>", 3.0 * s, -2.0 * s);
        body(format!("sheared cube {s:e}"), [0.0, 0.0, 5.0 * s], [0.0; 3], 0.2 * s, shape("cube", &matrix, GREY));
    }
    hold(&cases);
}

/// Copies of a ball: stretched to an ellipsoid, tiny, huge, far away; diffuse ½, clear 1.
#[test]
fn copies_under_extreme_transforms_are_bodies_like_others() {
    let mut cases = Vec::new();
    for (name, to, at, half) in [
        ("tiny", "<scale value=\"1e-6\"/>".to_owned(), [0.0; 3], 1e-7),
        ("huge", "<scale value=\"1e6\"/>".to_owned(), [0.0; 3], 1e5),
        ("far", "<translate x=\"1e6\" y=\"1e6\"/>".to_owned(), [1e6, 1e6, 0.0], 0.1),
        ("tiny and far", "<scale value=\"1e-3\"/><translate x=\"1e4\"/>".to_owned(), [1e4, 0.0, 0.0], 1e-4),
        ("ellipsoid", "<scale x=\"1e3\" y=\"1\" z=\"1e-3\"/>".to_owned(), [0.0; 3], 0.1),
        ("sheared", "<matrix value=\"1 30 0 0  0 1 0 0  0 -20 1 0  0 0 0 1\"/>".to_owned(), [0.0; 3], 1e-3),
        ("mirrored", "<scale x=\"-1\" y=\"2\"/>".to_owned(), [0.0; 3], 0.1),
    ] {
        for (what, child, inside, answer) in [
            ("ball", "sphere", GREY.to_owned(), HALF),
            ("cube", "cube", GREY.to_owned(), HALF),
            ("clear ball", "sphere", glass(1.5, 1.0), Answer::Every(1.0, 2e-5)),
            ("clear cube", "cube", glass(1.5, 1.0), Answer::Every(1.0, 2e-5)),
        ] {
            let group = format!("<shape type=\"shapegroup\" id=\"g\"><shape type=\"{child}\">{inside}</shape></shape>");
            let copy = shape("instance", &to, "<ref id=\"g\"/>");
            let body = parallel([at[0], at[1], at[2] + 5.0 * half * 1e4], at, half) + &group + &copy + SKY;
            cases.push(Case::new(format!("{what}, {name}"), body, answer));
        }
    }
    hold(&cases);
}

/// A straight tube is convex but for its ends: ½ in the middle, whatever its width, length and place.
#[test]
fn straight_curves_show_their_albedo() {
    let mut cases = Vec::new();
    for (r, l, at) in [
        (0.1, 1.0, [0.0; 3]),
        (1e-5, 1.0, [0.0; 3]),
        (1e-4, 1.0, [1e3, -1e3, 0.0]),
        (1e3, 1e6, [0.0; 3]),
        (1e-8, 1e-6, [0.0; 3]),
    ] {
        let points = |n: i32| {
            (-n..=n)
                .map(|i| format!("{:?} {:?} {:?} {r:?}\n", at[0] + l * f64::from(i) / f64::from(n), at[1], at[2]))
                .collect::<String>()
        };
        for kind in ["linearcurve", "bsplinecurve"] {
            let curve = format!("<shape type=\"{kind}\"><string name=\"filename\" value=\"c.txt\"/>{GREY}</shape>");
            let body = parallel([at[0], at[1], at[2] + 5.0 * l], at, 0.6 * r) + &curve + SKY;
            cases.push(Case::new(format!("{kind} of {r:e} at {at:?}"), body, HALF).file("c.txt", points(4)));
        }
    }
    hold(&cases);
}
