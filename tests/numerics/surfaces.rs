//! Surfaces and media at the ends of their parameters.

use crate::xml::{Answer, Case, NULL, SKY, VOLPATH, camera, hold, sphere};

/// A lossless metal (`material` none) reflects all: 1 in every pixel. A rough one of one bounce loses what facets
/// shadow each other, of the order of its roughness.
#[test]
fn lossless_metals_are_invisible() {
    let mut cases = Vec::new();
    let ball = |bsdf: &str| camera([0.0, 0.0, 5.0], [0.0; 3], 10.0) + &sphere([0.0; 3], 1.0, bsdf) + SKY;
    cases.push(Case::new("conductor", ball("<bsdf type=\"conductor\"/>"), Answer::Every(1.0, 2e-6)));
    for alpha in [1e-6, 1e-5, 1e-4, 1e-3] {
        for d in ["ggx", "beckmann"] {
            let bsdf = format!(
                "<bsdf type=\"roughconductor\"><float name=\"alpha\" value=\"{alpha:?}\"/><string name=\"distribution\" value=\"{d}\"/></bsdf>"
            );
            cases.push(Case::new(format!("{d} metal of {alpha:e}"), ball(&bsdf), Answer::Mean(1.0, 1e-5 + alpha)));
            let bsdf = format!(
                "<bsdf type=\"roughdielectric\"><float name=\"int_ior\" value=\"1.5\"/><float name=\"ext_ior\" value=\"1\"/><float name=\"alpha\" value=\"{alpha:?}\"/><string name=\"distribution\" value=\"{d}\"/></bsdf>"
            );
            cases.push(Case::new(format!("{d} glass of {alpha:e}"), ball(&bsdf), Answer::Mean(1.0, 1e-4 + alpha)));
        }
    }
    hold(&cases);
}

/// A medium of albedo 1 in an even sky is invisible, whatever its phase function and thickness; a medium that only
/// absorbs lets exp(-2 r sigma cos) through.
#[test]
fn white_media_are_invisible_and_black_ones_follow_beer() {
    let mut cases = Vec::new();
    let medium = |sigma: f64, albedo: f64, phase: &str| {
        format!(
            "<medium name=\"interior\" type=\"homogeneous\"><spectrum name=\"sigma_t\" value=\"{sigma:?}\"/><spectrum name=\"albedo\" value=\"{albedo:?}\"/>{phase}</medium>"
        )
    };
    let ball = |r: f64, sigma: f64, albedo: f64, phase: &str, fov: f64| {
        camera([0.0, 0.0, 5.0 * r], [0.0; 3], fov)
            + &sphere([0.0; 3], r, &(NULL.to_owned() + &medium(sigma, albedo, phase)))
            + SKY
    };
    for g in [0.0, 0.999999, -0.999999, 0.9, 1e-9] {
        let phase = format!("<phase type=\"hg\"><float name=\"g\" value=\"{g:?}\"/></phase>");
        for sigma in [1e-9, 1e-3, 1.0, 10.0] {
            cases.push(
                Case::new(
                    format!("white, g {g}, sigma {sigma:e}"),
                    ball(1.0, sigma, 1.0, &phase, 30.0),
                    Answer::Mean(1.0, 2e-5),
                )
                .integrator(VOLPATH),
            );
        }
        cases.push(
            Case::new(format!("white, g {g}, at 1e-6"), ball(1e-6, 1e6, 1.0, &phase, 30.0), Answer::Mean(1.0, 2e-5))
                .integrator(VOLPATH),
        );
    }
    // Through the middle of a ball: exp(-2 sigma r), across a hundredth of a degree.
    for tau in [1e-9, 1e-6, 1e-3, 1.0, 10.0, 1e6f64] {
        for r in [1e-6, 1.0, 1e6] {
            let expected = (-2.0 * tau).exp();
            cases.push(
                Case::new(
                    format!("black of {tau:e} at {r:e}"),
                    ball(r, tau / r, 0.0, "", 1e-3),
                    Answer::Mean(expected, 2e-4 * expected.max(1e-30)),
                )
                .samples(4096)
                .side(4)
                .integrator(VOLPATH),
            );
        }
    }
    hold(&cases);
}
