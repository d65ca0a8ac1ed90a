//! Thin films: interference at each wavelength.
//!
//! The reference is Airy's sum with complex numbers, written here apart from the renderer's matrices.

use super::common::{Bench, SPREAD_NM, assert_close, bench, bench_with, ray, try_bench, v, wavelengths};
use super::pictures::{assert_agree, render_with};
use super::{across_the_unit_sphere, assert_invisible_in_every_sample, in_even_light};
use abbe::film::filter::Filter;
use abbe::math::sampler::Sampler;
use abbe::spectrum::catalogue;
use std::f64::consts::TAU;
use std::ops::{Add, Div, Mul, Sub};

#[derive(Clone, Copy)]
struct C(f64, f64);

impl Add for C {
    type Output = C;
    fn add(self, b: C) -> C {
        C(self.0 + b.0, self.1 + b.1)
    }
}

impl Sub for C {
    type Output = C;
    fn sub(self, b: C) -> C {
        C(self.0 - b.0, self.1 - b.1)
    }
}

impl Mul for C {
    type Output = C;
    fn mul(self, b: C) -> C {
        C(self.0 * b.0 - self.1 * b.1, self.0 * b.1 + self.1 * b.0)
    }
}

impl Div for C {
    type Output = C;
    fn div(self, b: C) -> C {
        let n = b.0 * b.0 + b.1 * b.1;
        C((self.0 * b.0 + self.1 * b.1) / n, (self.1 * b.0 - self.0 * b.1) / n)
    }
}

const ONE: C = C(1.0, 0.0);

/// The root with Im ≥ 0.
fn root(a: C) -> C {
    let (r, phi) = (a.0.hypot(a.1).sqrt(), 0.5 * a.1.atan2(a.0));
    if phi.sin() < 0.0 { C(-r * phi.cos(), -r * phi.sin()) } else { C(r * phi.cos(), r * phi.sin()) }
}

/// What a film of `d` nm reflects of unpolarised light at `nm` that comes at θ: r = (r₀₁ + r₁₂e^(2iδ))/(1 + r₀₁r₁₂e^(2iδ)).
fn airy(cos: f64, nm: f64, d: f64, n: [C; 3]) -> f64 {
    let sine = n[0] * C((1.0 - cos * cos).sqrt(), 0.0);
    let cosine = n.map(|n| root(ONE - sine * sine / (n * n)));
    let polarised = |p: bool| {
        let r = |i: usize, j: usize| {
            let (a, b) = if p { (n[j] * cosine[i], n[i] * cosine[j]) } else { (n[i] * cosine[i], n[j] * cosine[j]) };
            (a - b) / (a + b)
        };
        let delta = C(TAU * d / nm, 0.0) * n[1] * cosine[1];
        let size = (-2.0 * delta.1).exp();
        let back = r(1, 2) * C(size * (2.0 * delta.0).cos(), size * (2.0 * delta.0).sin());
        let total = (r(0, 1) + back) / (ONE + r(0, 1) * back);
        total.0 * total.0 + total.1 * total.1
    };
    0.5 * (polarised(false) + polarised(true))
}

/// A surface under even light with a dark wall behind: what it reflects at each wavelength toward a viewer at `deg`.
fn reflected(material: &str, deg: f64) -> [f64; 8] {
    let scene = bench(&format!(
        "integrator: {{whitted: {{}}}}\nshapes:\n- rectangle: {{corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], \
         material: {material}}}\n\
         - rectangle: {{corner: [-99, -99, -0.5], edge_u: [198, 0, 0], edge_v: [0, 198, 0], \
         material: {{diffuse: {{reflectance: 0}}}}}}\nlights: [{{constant: {{radiance: 1}}}}]\n"
    ));
    let angle = deg.to_radians();
    scene.lanes(&ray(0.5 * v(angle.sin(), 0.0, angle.cos()), v(0.0, 0.0, 0.0)))
}

fn real(n: f64) -> C {
    C(n, 0.0)
}

/// A soap film, an oil film on water, a coating on glass, an oxide on titanium and on gold: at five angles, for several
/// thicknesses, each wavelength by the closed form. 1e-6 is the rounding of f32.
#[test]
fn films_reflect_each_wavelength_by_airys_sum() {
    let water = catalogue::glass("water").unwrap();
    let metal = |name: &str, nm: f64| {
        let (eta, k) = catalogue::metal(name).unwrap();
        C(f64::from(eta.eval(abbe::spectrum::Lanes::splat(nm as f32)).to_array()[0]), {
            f64::from(k.eval(abbe::spectrum::Lanes::splat(nm as f32)).to_array()[0])
        })
    };
    type Stack<'a> = Box<dyn Fn(f64) -> [C; 3] + 'a>;
    let cases: [(&str, Stack); 5] = [
        ("thin_dielectric: {ior: {glass: water}, thickness_nm: D}", { Box::new(|nm| [ONE, real(water.at(nm)), ONE]) }),
        ("dielectric: {ior: {glass: water}, film: {ior: 1.47, thickness_nm: D}}", {
            Box::new(|nm| [ONE, real(1.47), real(water.at(nm))])
        }),
        ("dielectric: {ior: 1.52, exterior_ior: 1.1, film: {ior: 1.38, thickness_nm: D}}", {
            Box::new(|_| [real(1.1), real(1.38), real(1.52)])
        }),
        ("conductor: {eta: 2.7, k: 3.6, film: {ior: 2.5, thickness_nm: D}}", {
            Box::new(|_| [ONE, real(2.5), C(2.7, 3.6)])
        }),
        ("conductor: {metal: gold, film: {ior: 1.6, thickness_nm: D}}", {
            Box::new(|nm| [ONE, real(1.6), metal("gold", nm)])
        }),
    ];
    for (material, stack) in &cases {
        for deg in [0.0f64, 20.0, 45.0, 70.0, 85.0] {
            for d in [0.0, 97.0, 250.0, 611.0, 1500.0] {
                let found = reflected(&format!("{{{}}}", material.replace('D', &d.to_string())), deg);
                for (found, nm) in found.into_iter().zip(SPREAD_NM) {
                    let expected = airy(deg.to_radians().cos(), nm, d, stack(nm));
                    assert!((found - expected).abs() < 2e-6, "{material} {deg}° {d} nm at {nm}: {expected} {found}");
                }
            }
        }
    }
}

/// What a film does not reflect it lets through: clear bodies under films are invisible in even light. Where the index
/// is the same for all wavelengths each sample of the path gives R or T of them by their mean, so the mean over many is
/// one; where it is not, Σ over lanes is 8 in every sample. Near the edge few paths, reflected within many times, bring much of it:
/// the mean of 4096 is not normal yet.
#[test]
fn films_on_clear_bodies_conserve_energy() {
    let film = "film: {ior: 1.4, thickness_nm: 350}";
    for material in [
        format!("{{dielectric: {{ior: 1.5, {film}}}}}"),
        "{thin_dielectric: {ior: 1.33, thickness_nm: 400}}".to_owned(),
        format!("{{dielectric: {{ior: 1, {film}}}}}"),
    ] {
        let scene = in_even_light(&format!("[{{sphere: {{radius: 1, material: {material}}}}}]"));
        for (from, to) in across_the_unit_sphere().step_by(7) {
            scene.estimate(&ray(from, to), 65536).assert_is(1.0, 0.01);
        }
        let whitted = bench(&format!(
            "shapes: [{{sphere: {{radius: 1, material: {material}}}}}]\nlights: [{{constant: {{radiance: 1}}}}]\n\
             integrator: {{whitted: {{max_depth: 64}}}}\n"
        ));
        for (from, to) in across_the_unit_sphere().step_by(7) {
            let lost = 1.0 - whitted.look(from, to);
            assert!((-1e-5..65.0 / 65536.0).contains(&lost), "{material} at {to}: lost {lost}");
        }
    }
    assert_invisible_in_every_sample(&format!(
        "[{{sphere: {{radius: 1, material: {{dielectric: {{ior: {{glass: N-SF11}}, {film}}}}}}}}}]"
    ));
}

/// A film of no thickness is none, on smooth and rough glass and metal: the same light in every sample, but for the
/// choice between reflection and refraction, which is by the mean of equal numbers.
#[test]
fn a_film_of_no_thickness_is_none() {
    for material in [
        "{dielectric: {ior: 1.5FILM}}",
        "{dielectric: {ior: 1.5, roughness: 0.3FILM}}",
        "{dielectric: {ior: {glass: SF11}, roughness: 0.3FILM}}",
        "{dielectric: {ior: {glass: SF11}FILM}}",
        "{conductor: {metal: copperFILM}}",
        "{conductor: {metal: copper, roughness: 0.2FILM}}",
    ] {
        let scene = |film: &str| {
            in_even_light(&format!("[{{sphere: {{radius: 1, material: {}}}}}]", material.replace("FILM", film)))
        };
        let (with, without) = (scene(", film: {ior: 1.7, thickness_nm: 0}"), scene(""));
        for (from, to) in across_the_unit_sphere().step_by(5) {
            for index in 0..16 {
                let sampler = Sampler::new(3, [0, 0], 0, index);
                let light = |scene: &Bench| scene.incoming(&ray(from, to), &wavelengths(SPREAD_NM), &sampler).radiance;
                let (a, b) = (light(&with).to_array(), light(&without).to_array());
                for (a, b) in a.into_iter().zip(b) {
                    assert!((a - b).abs() <= 2e-4 * b.abs(), "{material} {to} {index}: {a} {b}");
                }
            }
        }
    }
}

/// Rough glass under a film loses no more than rough glass does, and its lobes have the densities that they state: light
/// by shadow rays and by scattering agrees.
#[test]
fn rough_surfaces_under_films_are_sampled_as_they_scatter() {
    for material in [
        "{dielectric: {ior: 1.5, roughness: 0.3, film: {ior: 1.9, thickness_nm: 300}}}",
        "{dielectric: {ior: {glass: SF11}, roughness: 0.3, film: {ior: 1.4, thickness_nm: 600}}}",
        "{conductor: {metal: aluminium, roughness: 0.3, film: {ior: 2.2, thickness_nm: 80}}}",
    ] {
        let at = |samples: &str| {
            bench(&format!(
                "integrator: {{path: {{{samples}}}}}\nshapes: [{{sphere: {{radius: 1, material: {material}}}}}, \
                 {{sphere: {{center: [0, 4, 1], radius: 1, emission: 5}}}}, \
                 {{sphere: {{center: [0.3, -0.4, -4], radius: 1.2, emission: 5}}}}]\n"
            ))
            .luminance(&ray(v(0.0, 0.0, 5.0), v(0.2, 0.5, 0.0)), 30_000)
        };
        at("light_samples: 0").assert_agrees(&at("light_samples: 1"), 0.05);
    }
}

/// A ball of flint under a film that reflects a third of the light, and what it throws onto the floor: from the camera, from
/// the lamp with wavelengths together, and with each wavelength led by itself.
#[test]
fn light_through_a_coated_ball_is_the_same_by_all_techniques() {
    let scene = |techniques: &str| {
        let text = format!(
            "camera: {{origin: [0, 3, 5], target: [0, -1, 1.4], fov_deg: 25}}\nimage: {{width: 8, height: 8}}\n\
             render: {{samples: 2048, techniques: {{{techniques}}}}}\nshapes:\n\
             - rectangle: {{corner: [-3, -1, 4], edge_u: [6, 0, 0], edge_v: [0, 0, -6], material: {{diffuse: {{}}}}}}\n\
             - sphere: {{radius: 0.8, material: {{dielectric: {{ior: {{glass: SF11}}, film: {{ior: 2.6, thickness_nm: 53}}}}}}}}\n\
             - disk: {{center: [0, 3, -1.5], normal: [0, -1, 0.5], radius: 0.6, emission: 10}}\n"
        );
        render_with(&bench_with(&text, &[]), Filter::Box, 32)
    };
    let path = scene("light_tracing: off");
    for techniques in ["light_tracing: on, packets: on", "light_tracing: on, packets: off"] {
        let divided = scene(techniques);
        assert!(divided.splats.is_some());
        assert_agree(techniques, &divided, &path);
    }
}

/// The thickness follows a texture: the checks of a board are films of 100 and of 400 nm.
#[test]
fn the_thickness_may_follow_a_texture() {
    let scene = bench(
        "integrator: {whitted: {}}\ntextures: {board: {checkerboard: {a: 0.25, b: 1}}}\nshapes:\n\
         - rectangle: {corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0], \
         material: {conductor: {eta: 2, k: 3, film: {ior: 1.5, thickness_nm: {texture: board, from: 0, to: 400}}}}}\n\
         lights: [{constant: {radiance: 1}}]\n",
    );
    let mut seen = [false; 2];
    for (x, y) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)] {
        let found = scene.lanes(&ray(v(x, y, 1.0), v(x, y, 0.0)));
        let is = |d: f64| {
            let same = |(f, nm): (f64, f64)| (f - airy(1.0, nm, d, [ONE, real(1.5), C(2.0, 3.0)])).abs() < 2e-6;
            found.into_iter().zip(SPREAD_NM).all(same)
        };
        assert!(is(100.0) || is(400.0), "{x} {y}: {found:?}");
        seen[usize::from(is(400.0))] = true;
    }
    assert_eq!(seen, [true; 2]);
}

/// A black film: a bubble far thinner than any wavelength reflects R ≈ (k d (n² − 1)/2)² at normal incidence, from the
/// expansion of Airy's sum for small δ.
#[test]
fn a_bubble_goes_black_before_it_bursts() {
    let (d, n) = (5.0f64, 1.33f64);
    let found = reflected(&format!("{{thin_dielectric: {{ior: {n}, thickness_nm: {d}}}}}"), 0.0);
    for (found, nm) in found.into_iter().zip(SPREAD_NM) {
        let expected = (TAU * d / nm * (n * n - 1.0) / 2.0).powi(2);
        // The next term is of the order (k d n)² = 1 %.
        assert_close(found, expected, 0.02);
    }
}

#[test]
fn films_that_cannot_be_are_told_and_thick_ones_are_noted() {
    let told = |material: &str| {
        let text = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nmaterials:\n  m: {material}\nshapes: [{{sphere: {{radius: 1, material: m}}}}]\n"
        );
        match try_bench(&text, &[]) {
            Err(fault) => fault.replace("DIR/scene.yaml:", ""),
            Ok(bench) => bench.prepared.scene.notes.join("\n").replace(bench.directory.path().to_str().unwrap(), "DIR"),
        }
    };
    assert_eq!(
        told("{dielectric: {ior: 1.5, film: {ior: 1.4, thickness_nm: -1}}}"),
        "3:61: materials.m.dielectric.film.thickness_nm: expected a thickness from 0 to 1e8 nm, found -1"
    );
    assert_eq!(
        told("{dielectric: {ior: 1.5, fresnel: schlick, film: {ior: 1.4, thickness_nm: 1}}}"),
        "3:39: materials.m.dielectric.fresnel: expected exact under a film, found schlick"
    );
    assert!(told("{dielectric: {ior: 1.5, film: {ior: 1.4}}}").contains("thickness_nm"));
    assert!(
        told("{conductor: {metal: gold, film: {ior: 1.4, thickness_nm: {texture: skin}}}}")
            .contains("unknown texture \"skin\"")
    );
    assert_eq!(told("{thin_dielectric: {ior: 1.33, thickness_nm: 1200}}"), "");
    // 555²/(2 · 1.33 · 5000) = 23.16.
    assert_eq!(
        told("{thin_dielectric: {ior: 1.33, thickness_nm: 5000}}"),
        "DIR/scene.yaml:3:50: materials.m.thin_dielectric.thickness_nm: up to 5000 nm thick: its fringes at 555 nm lie \
         23.16 nm apart, closer than the 58.75 nm between the wavelengths of a path; their mean is right, but noisy, and \
         real films of this thickness are seldom even enough to show them"
    );
}
