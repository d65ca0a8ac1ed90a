//! The command as a person meets it: what it says about bad input, how it ends, what it leaves behind.

#[path = "../common/mod.rs"]
mod common;

mod batches;
mod faults;
mod files;
mod numerics;
mod options;
mod verbs;

use common::place::Place;

/// The smallest picture; two lines.
const SMALL: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n\
                     image: {width: 4, height: 4}\n";

/// A lit ball, on lines 3 to 5.
const BALL: &str = "render: {samples: 4}\nlights: [{constant: {radiance: 1}}]\nshapes: [{sphere: {radius: 1}}]\n";

fn batch() -> Place {
    Place::with(&[
        (
            "batch.yaml",
            "output: {dir: out}\nscenes:\n- file: scenes/good.yaml\n- file: scenes/bad.yaml\n- {file: scenes/good.yaml, name: other, set: {render.seed: 3}}\n",
        ),
        ("scenes/good.yaml", &format!("{SMALL}{BALL}")),
        ("scenes/bad.yaml", &format!("{SMALL}shapes: [{{sphere: {{radius: -1}}}}]\n")),
    ])
}
