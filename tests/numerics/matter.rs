//! Light through matter: thick, thin, absorbing, nested, far.

use crate::xml::{
    Answer, Case, DIRECT, FILM, GREY, NULL, SKY, VOLPATH, camera, glass, hold, list, shape, shining, sphere,
};
use std::f64::consts::PI;

fn homogeneous(name: &str, sigma_t: f64, albedo: f64, phase: &str) -> String {
    format!(
        "<medium name=\"{name}\" type=\"homogeneous\"><spectrum name=\"sigma_t\" value=\"{sigma_t:?}\"/>\
         <spectrum name=\"albedo\" value=\"{albedo:?}\"/>{phase}</medium>"
    )
}

/// Chandrasekhar's H(1) for isotropic scattering of `albedo`, by iterating his equation in the form that converges,
/// 1/H(μ) = √(1 − ω) + ω/2 ∫ μ′ H(μ′) / (μ + μ′) dμ′, on 2000 midpoints (Radiative Transfer, 1960, § 38).
fn chandrasekhar_at_one(albedo: f64) -> f64 {
    const N: usize = 2000;
    let mu = |i: usize| (i as f64 + 0.5) / N as f64;
    let mut h = vec![1.0; N];
    let at = |h: &[f64], x: f64| {
        let sum: f64 = h.iter().enumerate().map(|(i, h)| mu(i) * h / (x + mu(i))).sum::<f64>() / N as f64;
        1.0 / ((1.0 - albedo).sqrt() + 0.5 * albedo * sum)
    };
    for _ in 0..60 {
        h = (0..N).map(|i| at(&h, mu(i))).collect();
    }
    at(&h, 1.0)
}

/// An endlessly thick medium in an even sky, seen straight on, sends back 1 − H(1) √(1 − ω): by reciprocity what is
/// reflected of light from everywhere is what of a beam is not absorbed. A ball of 1e4 mean free paths or more is flat where
/// it is seen; its curvature counts as one over that.
#[test]
fn thick_media_reflect_by_chandrasekhars_h() {
    let mut cases = Vec::new();
    for albedo in [0.5, 0.9] {
        let expected = 1.0 - chandrasekhar_at_one(albedo) * (1.0f64 - albedo).sqrt();
        for (r, sigma) in [(1.0, 1e6), (1e-6, 1e10), (1e6, 1.0)] {
            let ball = sphere([0.0; 3], r, &(NULL.to_owned() + &homogeneous("interior", sigma, albedo, "")));
            let body = camera([0.0, 0.0, 5.0 * r], [0.0; 3], 0.1) + &ball + SKY;
            let name = format!("albedo {albedo}, radius {r:e}, sigma {sigma:e}");
            cases.push(Case::new(name, body, Answer::Mean(expected, 5e-4)).samples(256).integrator(VOLPATH));
        }
    }
    hold(&cases);
}

/// A ball of clear glass that absorbs, seen through its middle, in an even sky: with R = ((n−1)/(n+1))² and a = exp(−2σr),
/// R + (1 − R)² a / (1 − R a); far from the middle nothing is seen in a hundredth of a degree.
#[test]
fn absorbing_glass_follows_beer_between_its_reflections() {
    let mut cases = Vec::new();
    for r in [1e-6, 1.0, 1e6] {
        for tau in [1e-6, 0.1, 1.0, 20.0f64] {
            for n in [1.000001f64, 1.5, 4.0] {
                let (reflected, a) = (((n - 1.0) / (n + 1.0)).powi(2), (-2.0 * tau).exp());
                let expected = reflected + (1.0 - reflected).powi(2) * a / (1.0 - reflected * a);
                let ball = sphere([0.0; 3], r, &(glass(n, 1.0) + &homogeneous("interior", tau / r, 0.0, "")));
                let body = camera([0.0, 0.0, 5.0 * r], [0.0; 3], 0.01) + &ball + SKY;
                let case = Case::new(format!("radius {r:e}, tau {tau}, index {n}"), body, Answer::Mean(expected, 1e-5));
                cases.push(case.samples(512).side(8).integrator(VOLPATH));
            }
        }
    }
    hold(&cases);
}

/// A lamp in the middle of fog that only absorbs, far away or near: what comes to the floor is dimmed by exp(−σd), to
/// the last digits, for point, ball and rectangle alike.
#[test]
fn light_through_absorbing_fog_is_dimmed_by_its_way() {
    let mut cases = Vec::new();
    for s in [1e-6, 1.0, 1e6] {
        for tau in [1e-9, 1e-3, 1.0, 10.0f64] {
            let fog = homogeneous("exterior", tau / s, 0.0, "").replace("name=\"exterior\"", "id=\"fog\"");
            let inside = "<ref name=\"exterior\" id=\"fog\"/>";
            let floor =
                shape("rectangle", &format!("<scale value=\"{:?}\"/><rotate x=\"1\" angle=\"-90\"/>", 3.0 * s), GREY);
            let eye =
                camera([1e-3 * s, 1e-3 * s, 0.0], [0.0; 3], 0.01).replace("</sensor>", "<ref id=\"fog\"/></sensor>");
            let way = 1.0 + 1e-3 * 2f64.sqrt();
            let expected = 0.5 * (-tau * way).exp();
            let tolerance = 2e-5 * expected + tau * 1e-6 * expected;
            let point = format!(
                "<emitter type=\"point\"><point name=\"position\" value=\"{}\"/><spectrum name=\"intensity\" value=\"{:?}\"/></emitter>",
                list([0.0, s, 0.0]),
                PI * s * s
            );
            cases.push(
                Case::new(
                    format!("point at {s:e}, tau {tau:e}"),
                    fog.clone() + &eye + &floor + &point,
                    Answer::Mean(expected, tolerance),
                )
                .samples(256)
                .integrator(VOLPATH_DIRECT),
            );
            let ball = sphere([0.0, s, 0.0], 1e-4 * s, &(shining(1e8) + inside));
            let near = 2e-4 * tau * expected;
            cases.push(
                Case::new(
                    format!("ball at {s:e}, tau {tau:e}"),
                    fog + &eye + &floor + &ball,
                    Answer::Mean(expected, tolerance + near),
                )
                .samples(256)
                .integrator(VOLPATH_DIRECT),
            );
        }
    }
    hold(&cases);
}

const VOLPATH_DIRECT: &str = "<integrator type=\"volpath\"><integer name=\"max_depth\" value=\"2\"/></integrator>";

/// The camera itself in matter, or in a lamp, or in glass.
#[test]
fn the_camera_may_be_anywhere() {
    let mut cases = Vec::new();
    let one = Answer::Mean(1.0, 2e-5);
    for r in [1e-6, 1.0, 1e6] {
        // White fog in an even sky, from within.
        let fog = sphere([0.0; 3], r, &(NULL.to_owned() + "<ref name=\"interior\" id=\"fog\"/>"));
        let declared = homogeneous("interior", 2.0 / r, 1.0, "").replace("name=\"interior\"", "id=\"fog\"");
        let eye = camera([0.1 * r, 0.0, 0.3 * r], [0.0; 3], 50.0).replace("</sensor>", "<ref id=\"fog\"/></sensor>");
        cases.push(
            Case::new(format!("in fog of {r:e}"), declared + &eye + &fog + SKY, one).samples(256).integrator(VOLPATH),
        );
        let lamp = sphere([0.0; 3], r, &format!("<boolean name=\"flip_normals\" value=\"true\"/>{}", shining(1.0)));
        let eye = camera([0.1 * r, 0.0, 0.3 * r], [0.0; 3], 50.0);
        cases.push(Case::new(format!("in a lamp of {r:e}"), eye.clone() + &lamp, one));
        let ball = sphere([0.0; 3], r, &glass(1.5, 1.0));
        cases.push(Case::new(format!("in glass of {r:e}"), eye + &ball + SKY, Answer::Every(2.25, 5e-5)));
    }
    hold(&cases);
}

/// Three hundred lamps of all strengths on a ring at distance 1 from the middle of a floor, raised by half a turn: together
/// E = π Σ L r² cos 60°, and back comes ρ E/π.
#[test]
fn many_lamps_of_all_strengths_add_up() {
    let mut body = camera([0.0, 3.0, 0.0], [0.0; 3], 1e-3)
        + &shape("rectangle", "<scale value=\"9\"/><rotate x=\"1\" angle=\"-90\"/>", GREY);
    let mut expected = 0.0;
    for i in 0..300 {
        let turn = f64::from(i) * 2.399963;
        let (sin, cos) = turn.sin_cos();
        let power = 10f64.powf(-9.0 + 10.0 * f64::from(i) / 300.0);
        let lift: f64 = 0.75f64.sqrt();
        let r = 1e-3;
        body += &sphere([lift * cos, 0.5, lift * sin], r, &shining(power / (r * r)));
        expected += 0.5 * 0.5 * power;
    }
    hold(&[Case::new("three hundred lamps", body, Answer::Mean(expected, 1e-4 * expected))
        .samples(4096)
        .integrator(DIRECT)]);
}

/// Radiances from 1e-25 to 1e25 come out as they are, seen themselves and as what they light; and beside a lamp of 1e20 the
/// dark side of a wall is as it is. f32 holds these; the film divides what it sums by a power of two that follows the lamps.
#[test]
fn radiances_of_many_decades_come_out_as_they_are() {
    let mut cases = Vec::new();
    for l in [1e-25, 1e-12, 1e-6, 1.0, 1e6, 1e11, 1e13, 1e25] {
        let sky = SKY.replace("value=\"1\"", &format!("value=\"{l:?}\""));
        let body = camera([0.0, 0.0, 5.0], [0.0; 3], 10.0) + &sphere([0.0; 3], 1.0, GREY) + &sky;
        cases.push(Case::new(format!("sky of {l:e}"), body, Answer::Every(0.5 * l, 2e-6 * l)));
        let body = camera([0.0, 0.0, 5.0], [0.0; 3], 10.0) + &sphere([0.0; 3], 1.0, &shining(l));
        cases.push(Case::new(format!("lamp of {l:e}"), body, Answer::Every(l, 2e-6 * l)));
    }
    // L = 1/r² lights the floor with π, as elsewhere, from a lamp that the camera does not see.
    for r in [1e-7, 1e-10, 1e-12] {
        let floor = shape("rectangle", "<rotate x=\"1\" angle=\"-90\"/>", GREY);
        let body =
            camera([1.0, 1.0, 0.0], [0.0; 3], 0.01) + &sphere([0.0, 1.0, 0.0], r, &shining(1.0 / (r * r))) + &floor;
        cases.push(Case::new(format!("lamp of radius {r:e}"), body, Answer::Every(0.5, 1e-5)).integrator(DIRECT));
    }
    let body = format!("<sensor type=\"perspective\">{FILM}</sensor>") + SKY;
    cases.push(Case::new("a sky and nothing else", body, Answer::Every(1.0, 2e-6)));
    hold(&cases);
}
