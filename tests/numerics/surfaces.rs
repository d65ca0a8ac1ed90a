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

/// Every surface at the ends of its parameters, as a ball in an even sky: nothing that is no number, nothing negative,
/// and no more than comes in: at most `most`, at least `least` in the mean. With the masking of GGX facets, which is exact, all
/// facets that are seen cover what is seen once, so that 1 is the most, and 2e-5 what f32 rounds in the longest path; the
/// rational fit for Beckmann's errs by 0.35 % (Walter et al. 2007, below eq. 27).
#[test]
fn surfaces_at_the_ends_of_their_parameters_stay_within_bounds() {
    let mut cases = Vec::new();
    let mut ball = |name: String, bsdf: String, least: f64, most: f64| {
        let body = camera([0.0, 0.0, 5.0], [0.0; 3], 15.0) + &sphere([0.0; 3], 1.0, &bsdf) + SKY;
        cases.push(Case::new(name, body, Answer::Within(least, most)).samples(64).side(8));
    };
    let float = |name: &str, x: f64| format!("<float name=\"{name}\" value=\"{x:?}\"/>");
    let ior = |int: f64, ext: f64| float("int_ior", int) + &float("ext_ior", ext);
    let string = |name: &str, x: &str| format!("<string name=\"{name}\" value=\"{x}\"/>");
    let bsdf = |kind: &str, inside: String| format!("<bsdf type=\"{kind}\">{inside}</bsdf>");
    let even = |name: &str, x: f64| format!("<spectrum name=\"{name}\" value=\"{x:?}\"/>");
    for (d, fit) in [("ggx", 1.0 + 2e-5), ("beckmann", 1.0035 + 2e-5)] {
        for (u, v) in [(0.0, 0.0), (1e-6, 1e-6), (1e-6, 1.0), (1.0, 1e-4), (1.0, 1.0), (5.0, 5.0)] {
            let rough = string("distribution", d) + &float("alpha_u", u) + &float("alpha_v", v);
            // What is nearly smooth loses nothing.
            let least = if f64::max(u, v) <= 1e-4 { 1.0 - 2e-3 } else { 0.002 };
            ball(format!("metal {d} {u} {v}"), bsdf("roughconductor", rough.clone()), least, fit);
            for (int, ext) in [(1.5, 1.0), (1.0, 1.5), (1.0, 1.0), (1.0000001, 1.0), (5.0, 1.0), (1.0, 10.0)] {
                let glass = bsdf("roughdielectric", rough.clone() + &ior(int, ext));
                ball(format!("glass {d} {u} {v} {int} {ext}"), glass, least, fit);
            }
        }
        for alpha in [1e-6, 0.1, 1.0] {
            for (int, ext) in [(1.5, 1.0), (1.0, 1.0), (1.0000001, 1.0), (10.0, 1.0), (1.0, 1.5)] {
                let inside = string("distribution", d)
                    + &float("alpha", alpha)
                    + &ior(int, ext)
                    + &even("diffuse_reflectance", 1.0);
                ball(format!("rough plastic {d} {alpha} {int} {ext}"), bsdf("roughplastic", inside), 0.1, fit);
            }
        }
    }
    for (int, ext) in [(1.5, 1.0), (1.0, 1.0), (1.0000001, 1.0), (10.0, 1.0), (1.0, 1.5), (1.0, 10.0)] {
        for nonlinear in [false, true] {
            let inside = format!("<boolean name=\"nonlinear\" value=\"{nonlinear}\"/>")
                + &ior(int, ext)
                + &even("diffuse_reflectance", 1.0);
            ball(format!("plastic {int} {ext} {nonlinear}"), bsdf("plastic", inside), 0.1, 1.0 + 2e-5);
        }
        ball(format!("pane {int} {ext}"), bsdf("thindielectric", ior(int, ext)), 1.0 - 2e-5, 1.0 + 2e-5);
        ball(format!("clear {int} {ext}"), bsdf("dielectric", ior(int, ext)), 1.0 - 2e-3, 1.0 + 2e-5);
    }
    for (n, k, least, most) in [
        (1.0, 0.0, 0.0, 1e-6),
        (1e-6, 1e-6, 0.9, 1.0 + 1e-6),
        (0.0, 1e6, 0.99, 1.0 + 1e-6),
        (1e6, 1e6, 0.9, 1.0 + 1e-6),
        (1.0, 1e-8, 0.0, 1e-3),
    ] {
        ball(format!("metal of {n} and {k}"), bsdf("conductor", even("eta", n) + &even("k", k)), least, most);
        ball(
            format!("rough metal of {n} and {k}"),
            bsdf("roughconductor", even("eta", n) + &even("k", k) + &float("alpha", 0.2)),
            0.8 * least,
            1.0035 * most,
        );
    }
    for roughness in [0.0, 1e-6, 0.5, 1.0] {
        for (metallic, spec_trans, clearcoat, sheen, aniso) in [
            (0.0, 0.0, 0.0, 0.0, 0.0),
            (1.0, 0.0, 0.0, 0.0, 1.0),
            (0.0, 1.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 1.0, 1.0, 1.0),
            (0.5, 0.5, 1.0, 1.0, 0.9),
        ] {
            let inside = even("base_color", 1.0)
                + &float("roughness", roughness)
                + &float("metallic", metallic)
                + &float("spec_trans", spec_trans)
                + &float("clearcoat", clearcoat)
                + &float("sheen", sheen)
                + &float("anisotropic", aniso);
            // Burley's dielectric with its sheen and coat sends out up to 1.7 at grazing angles.
            ball(
                format!("principled {roughness} {metallic} {spec_trans} {clearcoat}"),
                bsdf("principled", inside),
                0.1,
                2.2,
            );
        }
        for (spec_trans, diff_trans, eta) in
            [(0.0, 0.0, 1.5), (1.0, 0.0, 1.5), (0.0, 2.0, 1.5), (0.5, 1.0, 1.01), (1.0, 2.0, 3.0)]
        {
            let inside = even("base_color", 1.0)
                + &float("roughness", roughness)
                + &float("spec_trans", spec_trans)
                + &float("diff_trans", diff_trans)
                + &float("eta", eta);
            ball(
                format!("thin principled {roughness} {spec_trans} {diff_trans}"),
                bsdf("principledthin", inside),
                0.05,
                2.2,
            );
        }
    }
    hold(&cases);
}
