//! Closed rooms: no light leaks in or out, and what glows within adds up.

use crate::xml::{Answer, BRIGHT, Case, camera, glowing, hold, shape, sphere};

/// Six rectangles of half side `s` about `c`.
fn walls(c: [f64; 3], s: f64, inside: &str) -> String {
    let turns = [
        "<rotate y=\"1\" angle=\"0\"/>",
        "<rotate y=\"1\" angle=\"90\"/>",
        "<rotate y=\"1\" angle=\"180\"/>",
        "<rotate y=\"1\" angle=\"270\"/>",
        "<rotate x=\"1\" angle=\"90\"/>",
        "<rotate x=\"1\" angle=\"-90\"/>",
    ];
    turns
        .map(|turn| {
            let to = format!(
                "<translate z=\"-1\"/>{turn}<scale value=\"{s:?}\"/><translate x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/>",
                c[0], c[1], c[2]
            );
            shape("rectangle", &to, inside)
        })
        .concat()
}

/// A dark closed room under a sky of 1e6 is black within, in every pixel.
#[test]
fn no_light_leaks_into_a_closed_room() {
    let mut cases = Vec::new();
    let black = Answer::Every(0.0, 0.0);
    for s in [1e-6, 1.0, 1e4, 1e7] {
        for c in [[0.0; 3], [1e3 * s, -2e3 * s, 5e2 * s]] {
            let eye = [c[0] + 0.1 * s, c[1] + 0.2 * s, c[2] + 0.3 * s];
            for (target, fov) in [
                ([c[0] - s, c[1] - s, c[2] - s], 90.0),
                ([c[0] + s, c[1], c[2]], 90.0),
                // A corner, and an edge, to within rounding.
                ([c[0] - s, c[1] - s, c[2] - s], 1e-12),
                ([c[0] + s, c[1] - s, c[2] + 0.1 * s], 1e-12),
                ([c[0] + s, c[1] - s, c[2] + 0.1 * s], 1e-9),
            ] {
                let body = camera(eye, target, fov)
                    + &walls(c, s, "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf>")
                    + BRIGHT;
                cases.push(Case::new(format!("room {s:e} at {c:?}"), body, black));
                let cube = shape(
                    "cube",
                    &format!("<scale value=\"{s:?}\"/><translate x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/>", c[0], c[1], c[2]),
                    "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf>",
                );
                let body = camera(eye, target, fov) + &cube + BRIGHT;
                cases.push(Case::new(format!("cube {s:e} at {c:?}"), body, black));
            }
        }
    }
    // A can: a tube and two disks.
    for s in [1e-6, 1.0, 1e4] {
        for c in [[0.0; 3], [1e3 * s, -2e3 * s, 5e2 * s]] {
            let eye = [c[0] + 0.1 * s, c[1] + 0.2 * s, c[2] + 0.3 * s];
            for (target, fov) in [
                ([c[0] + 0.6 * s, c[1] + 0.8 * s, c[2] - s], 90.0),
                ([c[0] + 0.6 * s, c[1] + 0.8 * s, c[2] - s], 1e-12),
                ([c[0] - 0.28 * s, c[1] + 0.96 * s, c[2] + s], 1e-12),
            ] {
                let to = |more: &str| {
                    format!(
                        "{more}<scale value=\"{s:?}\"/><translate x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/>",
                        c[0], c[1], c[2]
                    )
                };
                let grey = "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf>";
                let body = camera(eye, target, fov)
                    + &shape("cylinder", &to("<scale z=\"2\"/><translate z=\"-1\"/>"), grey)
                    + &shape("disk", &to("<translate z=\"-1\"/>"), grey)
                    + &shape("disk", &to("<rotate x=\"1\" angle=\"180\"/><translate z=\"1\"/>"), grey)
                    + BRIGHT;
                cases.push(Case::new(format!("can {s:e} at {c:?} at {fov:e}"), body, black));
            }
        }
    }
    hold(&cases);
}

/// Walls that shine with 1 and reflect ρ: L = 1/(1 − ρ) everywhere.
#[test]
fn light_in_a_glowing_room_is_one_over_one_minus_albedo() {
    let mut cases = Vec::new();
    for s in [1e-6, 1.0, 1e4] {
        for c in [[0.0; 3], [1e5 * s, 0.0, 0.0]] {
            let eye = [c[0] + 0.1 * s, c[1] + 0.2 * s, c[2] + 0.3 * s];
            let at = [c[0] - s, c[1] - s, c[2] - s];
            let body = camera(eye, at, 90.0) + &walls(c, s, &glowing(0.5));
            cases.push(Case::new(format!("room {s:e} at {c:?}"), body, Answer::Mean(2.0, 2e-4)).samples(64));
        }
    }
    for r in [1e-7, 1.0, 1e7] {
        let ball = sphere([0.0; 3], r, &format!("<boolean name=\"flip_normals\" value=\"true\"/>{}", glowing(0.5)));
        let body = camera([0.0, 0.0, 0.2 * r], [0.0, 0.0, r], 40.0) + &ball;
        cases.push(Case::new(format!("in a glowing sphere of {r:e}"), body, Answer::Mean(2.0, 2e-4)).samples(64));
    }
    hold(&cases);
}
