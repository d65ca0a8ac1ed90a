//! Every scattering function: what is sampled has the stated density, no energy comes from nothing, and light takes the
//! same way in both directions.

use crate::common::{Bench, bench};
use abbe::optics::bsdf::{Bsdf, Chosen};
use abbe::scene::texture::TexturePoint;
use abbe::spectrum::Lanes;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// A material to be tested.
struct Kind {
    yaml: &'static str,
    /// Index below the surface over the index above.
    eta: f64,
    /// How much more than it gets it may send on, by its model.
    gain: f64,
}

const fn kind(yaml: &'static str) -> Kind {
    Kind { yaml, eta: 1.0, gain: 0.0 }
}

const fn clear(yaml: &'static str, eta: f64) -> Kind {
    Kind { yaml, eta, gain: 0.0 }
}

/// Every variant of [`Bsdf`], [`number`] sees to that, each with what is its own.
const KINDS: [Kind; 30] = [
    kind("{diffuse: {reflectance: 0.8}}"),
    kind("{mirror: {reflectance: 0.9}}"),
    kind("{conductor: {metal: gold}}"),
    kind("{conductor: {metal: gold, film: {ior: 2.5, thickness_nm: 45}}}"),
    kind("{conductor: {metal: silver, roughness: 0.2}}"),
    kind("{conductor: {eta: 0, k: 1, roughness: 0.5, distribution: beckmann}}"),
    kind("{conductor: {eta: 0, k: 1, roughness: {u: 0.5, v: 0.2}}}"),
    kind("{conductor: {metal: copper, roughness: 0.3, film: {ior: 1.5, thickness_nm: 300}}}"),
    clear("{dielectric: {ior: 1.5}}", 1.5),
    clear("{dielectric: {ior: 1, exterior_ior: 1.5}}", 1.0 / 1.5),
    clear("{dielectric: {ior: 1.5, film: {ior: 1.38, thickness_nm: 100}}}", 1.5),
    clear("{dielectric: {ior: 1.5, roughness: 0.3}}", 1.5),
    clear("{dielectric: {ior: 1.5, roughness: 0.4, distribution: beckmann}}", 1.5),
    clear("{dielectric: {ior: 1, exterior_ior: 1.5, roughness: 0.3}}", 1.0 / 1.5),
    clear("{dielectric: {ior: 2.4, roughness: {u: 0.5, v: 0.25}}}", 2.4),
    clear("{dielectric: {ior: 1.5, roughness: 0.3, film: {ior: 1.38, thickness_nm: 100}}}", 1.5),
    kind("{thin_dielectric: {ior: 1.5}}"),
    kind("{thin_dielectric: {ior: 1.33, thickness_nm: 400}}"),
    kind("{plastic: {reflectance: 0.8}}"),
    kind("{plastic: {reflectance: 0.8, nonlinear: true, ior: 1.9}}"),
    kind("{plastic: {reflectance: 0.8, roughness: 0.2}}"),
    kind("{plastic: {reflectance: 0.8, roughness: 0.4, nonlinear: true, distribution: beckmann}}"),
    // Burley's diffuse lobe sends back more at grazing angles than it gets, by its design (2012, 5.3).
    Kind { gain: 0.35, ..kind("{principled: {base_color: 0.9, roughness: 0.5}}") },
    Kind {
        gain: 0.35,
        ..kind("{principled: {base_color: 0.9, roughness: 0.7, clearcoat: 1, sheen: 0, anisotropic: 0.6}}")
    },
    kind("{principled: {base_color: 0.9, roughness: 0.6, metallic: 1}}"),
    clear("{principled: {base_color: 0.9, roughness: 0.6, spec_trans: 1, eta: 1.5}}", 1.5),
    Kind { gain: 0.35, ..kind("{principled_thin: {base_color: 0.9, roughness: 0.6, diff_trans: 1}}") },
    kind("{principled_thin: {base_color: 0.9, roughness: 0.6, spec_trans: 1, eta: 1.5}}"),
    // The scales fold |cos θ| at grazing angles over themselves.
    Kind { gain: 0.02, ..kind("{hair: {eumelanin: 0.1}}") },
    kind("{boundary: {}}"),
];

/// The number of a variant: a new one does not compile before it is here, and [`every_variant_is_among_the_kinds`] fails
/// before it is in [`KINDS`].
fn number(bsdf: &Bsdf) -> usize {
    match bsdf {
        Bsdf::Diffuse { .. } => 0,
        Bsdf::Mirror { .. } => 1,
        Bsdf::Conductor(_) => 2,
        Bsdf::RoughConductor(..) => 3,
        Bsdf::Dielectric(_) => 4,
        Bsdf::RoughDielectric(_) => 5,
        Bsdf::Thin { .. } => 6,
        Bsdf::Plastic(_) => 7,
        Bsdf::RoughPlastic(_) => 8,
        Bsdf::Principled(_) => 9,
        Bsdf::PrincipledThin(_) => 10,
        Bsdf::Hair(_) => 11,
        Bsdf::Null => 12,
    }
}

fn scene(kind: &Kind) -> Bench {
    let shape = if kind.yaml.contains("hair") {
        "cylinder: {base: [0, 0, 0], top: [0, 1, 0], radius: 1, material: m}"
    } else {
        "disk: {normal: [0, 0, 1], radius: 1, material: m}"
    };
    bench(&format!("materials: {{m: {}}}\nshapes: [{{{shape}}}]\n", kind.yaml))
}

/// Calls `f` with the scattering function of each kind.
fn each(f: impl Fn(&Kind, &Bsdf) -> Vec<String> + Sync) {
    let faults: Vec<String> = KINDS
        .par_iter()
        .flat_map(|kind| {
            let scene = scene(kind);
            let material = &scene.prepared.scene.materials[0];
            let at = TexturePoint { uv: DVec2::new(0.3, 0.6), ..TexturePoint::default() };
            let faults = f(kind, &material.bsdf(&at, Lanes::splat(550.0), false));
            faults.into_iter().map(|fault| format!("{}: {fault}", kind.yaml)).collect::<Vec<_>>()
        })
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_variant_is_among_the_kinds() {
    let mut seen = [false; 13];
    for kind in &KINDS {
        let scene = scene(kind);
        seen[number(&scene.prepared.scene.materials[0].bsdf(&TexturePoint::default(), Lanes::splat(550.0), false))] =
            true;
    }
    assert_eq!(seen, [true; 13]);
}

/// Viewers from above, near grazing, and from below.
fn viewers() -> impl Iterator<Item = DVec3> {
    [0.95, 0.5, 0.15, -0.8, -0.3].into_iter().map(|z: f64| {
        let r = (1.0 - z * z).sqrt();
        DVec3::new(0.8 * r, 0.6 * r, z)
    })
}

/// A sequence that fills the unit cube evenly enough for integrals, and randomly enough for tests: splitmix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 * 0.5f64.powi(53)
    }
}

fn direction(z: f64, phi: f64) -> DVec3 {
    let r = ((1.0 - z) * (1.0 + z)).sqrt();
    DVec3::new(r * phi.cos(), r * phi.sin(), z)
}

const ROWS: usize = 16;
const COLUMNS: usize = 16;
/// Midpoints of a cell in each direction.
const FINE: usize = 12;

/// The integral of the density over each cell of the sphere, equal in θ and φ: near the poles, where what is refracted
/// gathers, they are small.
fn expected(bsdf: &Bsdf, wo: DVec3) -> Vec<f64> {
    let mut cells = vec![0.0; ROWS * COLUMNS];
    let (rows, columns) = (ROWS * FINE, COLUMNS * FINE);
    for i in 0..rows {
        let theta = PI * (i as f64 + 0.5) / rows as f64;
        // Of the row exactly: cos a − cos b.
        let solid_angle = 2.0 * theta.sin() * (0.5 * PI / rows as f64).sin() * TAU / columns as f64;
        for j in 0..columns {
            let phi = TAU * (j as f64 + 0.5) / columns as f64;
            let pdf = f64::from(bsdf.eval(wo, direction(theta.cos(), phi)).pdf.to_array()[0]);
            cells[i / FINE * COLUMNS + j / FINE] += pdf * solid_angle;
        }
    }
    cells
}

/// χ² of 1e5 samples over 256 cells of the sphere against the integral of the density, with one cell more for those of no
/// density: mirrors, and those that end. By Wilson and Hilferty's normal, z < 5 (α = 3e-7 each); cells are counted
/// together up to an expectation of 20. The density's midpoints err by some 1e-3 of a cell where lobes are 0.2 wide, to
/// which 1e5 samples are blind but in the cells of more than 1e4.
#[test]
fn sampled_directions_have_the_stated_density() {
    const SAMPLES: usize = 100_000;
    each(|_, bsdf| {
        let mut faults = Vec::new();
        for wo in viewers() {
            let mut random = Random(number(bsdf) as u64);
            let mut counts = vec![0u32; ROWS * COLUMNS + 1];
            for _ in 0..SAMPLES {
                let sample = bsdf.sample(wo, random.next(), DVec2::new(random.next(), random.next()));
                let cell = match sample {
                    Some(s) if s.chosen != Chosen::Discrete => {
                        let row = (s.wi.z.acos() / PI * ROWS as f64) as usize;
                        let turn = (s.wi.y.atan2(s.wi.x) / TAU).rem_euclid(1.0);
                        row.min(ROWS - 1) * COLUMNS + ((turn * COLUMNS as f64) as usize).min(COLUMNS - 1)
                    }
                    _ => ROWS * COLUMNS,
                };
                counts[cell] += 1;
            }
            let mut cells = expected(bsdf, wo);
            let total: f64 = cells.iter().sum();
            if total > 1.0 + 2e-3 {
                faults.push(format!("the density from {wo} integrates to {total}"));
            }
            cells.push((1.0 - total).max(0.0));
            let (mut chi2, mut freedom) = (0.0, -1.0);
            let (mut few, mut few_counted) = (0.0, 0.0);
            for (cell, count) in cells.iter().zip(&counts) {
                let expected = cell * SAMPLES as f64;
                if expected < 20.0 {
                    few += expected;
                    few_counted += f64::from(*count);
                    continue;
                }
                // The noise of counting, and the error of the midpoints.
                let variance = expected + (2e-3 * expected).powi(2);
                chi2 += (f64::from(*count) - expected).powi(2) / variance;
                freedom += 1.0;
            }
            if few > 20.0 {
                chi2 += (few_counted - few).powi(2) / (few + (5e-3 * few).powi(2));
                freedom += 1.0;
            }
            if freedom < 1.0 {
                continue;
            }
            let spread = 2.0 / (9.0 * freedom);
            let z = ((chi2 / freedom).powf(1.0 / 3.0) - (1.0 - spread)) / spread.sqrt();
            if z > 5.0 {
                faults.push(format!("from {wo}: chi2 {chi2:.1} of {freedom}, z {z:.1}, total {total:.5}"));
            }
        }
        faults
    });
}

/// In even light a surface sends on at most what it gets: the mean of the weights, with η² for what crosses (radiance
/// counts so much more or less beyond), is at most one. And each weight is f cos / pdf of its direction.
#[test]
fn no_surface_sends_on_more_than_it_gets() {
    const SAMPLES: usize = 60_000;
    each(|kind, bsdf| {
        let mut faults = Vec::new();
        for wo in viewers() {
            let mut random = Random(7 + number(bsdf) as u64);
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..SAMPLES {
                let Some(s) = bsdf.sample(wo, random.next(), DVec2::new(random.next(), random.next())) else {
                    continue;
                };
                let weight = f64::from(s.weight.to_array()[0]);
                if let Chosen::Density(pdf) = s.chosen {
                    let e = bsdf.eval(wo, s.wi);
                    let stated = f64::from(e.f.to_array()[0]) * s.wi.z.abs() / f64::from(e.pdf.to_array()[0]);
                    // Directions are f64, f and pdf f32 of some ten roundings, more where a half vector is near grazing.
                    let off = (weight - stated).abs() > 1e-4 * stated + 1e-9;
                    let density = (pdf / f64::from(e.pdf.to_array()[0]) - 1.0).abs() > 1e-4;
                    if (off || density) && faults.len() < 4 {
                        faults.push(format!("from {wo} to {}: weight {weight}, f cos / pdf {stated}, pdf {pdf}", s.wi));
                    }
                }
                let power = weight * s.eta2;
                sum += power;
                squares += power * power;
            }
            let mean = sum / SAMPLES as f64;
            let error = ((squares / SAMPLES as f64 - mean * mean).max(0.0) / SAMPLES as f64).sqrt();
            if mean > 1.0 + kind.gain + 4.5 * error + 1e-5 {
                faults.push(format!("from {wo}: sends on {mean} ± {error}"));
            }
        }
        faults
    });
}

/// f(o, i) n_i² = f(i, o) n_o² (Veach 1997, 5.2): light that goes the other way is dimmed alike. Two models are not so: what
/// crosses a clear `principled_thin`, whose facets mask one way only, and hair, whose f belongs to one offset across a
/// fibre, where light leaves by another.
#[test]
fn light_takes_the_same_way_in_both_directions() {
    each(|kind, bsdf| {
        let mut faults = Vec::new();
        let mut random = Random(11);
        let mut compared = 0;
        let one_way = |a: DVec3, b: DVec3| match bsdf {
            Bsdf::PrincipledThin(sheet) => sheet.transmission > 0.0 && a.z * b.z < 0.0,
            Bsdf::Hair(_) => true,
            _ => false,
        };
        for _ in 0..4000 {
            let [a, b] = [0; 2].map(|_| direction(2.0 * random.next() - 1.0, TAU * random.next()));
            let index2 = |w: DVec3| if w.z > 0.0 { 1.0 } else { kind.eta * kind.eta };
            let f = |o, i| f64::from(bsdf.eval(o, i).f.to_array()[0]);
            let (there, back) = (f(a, b) * index2(b), f(b, a) * index2(a));
            compared += u32::from(there > 0.0);
            if one_way(a, b) {
                continue;
            }
            if (there - back).abs() > 2e-4 * there.max(back) + 1e-7 && faults.len() < 3 {
                faults.push(format!("{a} and {b}: {there} and {back}"));
            }
        }
        if compared == 0 && !bsdf.is_discrete() {
            faults.push("no light went anywhere".into());
        }
        faults
    });
}
