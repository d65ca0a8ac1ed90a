//! The two surfaces against Mitsuba 3's numbers, and sampling against its own densities.

use super::lobes::{CoatFacets, facets};
use super::*;
use crate::math::sampler::mix64;
use crate::math::warp;
use crate::optics::bsdf::{Bsdf, Chosen};
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

fn four(x: &[f64]) -> Lanes {
    Lanes::new(std::array::from_fn(|i| x[i % 4] as f32))
}

fn solid(base: Lanes, hue: Lanes) -> Principled {
    Principled {
        base,
        hue,
        eta: 1.5,
        roughness: 0.5,
        anisotropic: 0.0,
        metallic: 0.0,
        transmission: 0.0,
        specular_tint: 0.0,
        sheen: 0.0,
        sheen_tint: 0.0,
        flatness: 0.0,
        clearcoat: 0.0,
        clearcoat_gloss: 0.0,
        rates: Rates::default(),
    }
}

fn thin(base: Lanes, hue: Lanes) -> PrincipledThin {
    PrincipledThin {
        base,
        hue,
        eta: 1.5,
        roughness: 0.5,
        anisotropic: 0.0,
        transmission: 0.0,
        diffuse_transmission: 0.0,
        specular_tint: 0.0,
        sheen: 0.0,
        sheen_tint: 0.0,
        flatness: 0.0,
        rates: ThinRates::default(),
    }
}

/// One material of the table of vectors.
fn material(kind: &str, parameters: &[(String, f32)], base: Lanes, hue: Lanes) -> Bsdf<'static> {
    let given = |name: &str| parameters.iter().any(|(key, _)| key == name);
    if kind == "principled" {
        let mut m = solid(base, hue);
        for (key, value) in parameters {
            *match key.as_str() {
                "roughness" => &mut m.roughness,
                "anisotropic" => &mut m.anisotropic,
                "metallic" => &mut m.metallic,
                "spec_trans" => &mut m.transmission,
                "spec_tint" => &mut m.specular_tint,
                "sheen" => &mut m.sheen,
                "sheen_tint" => &mut m.sheen_tint,
                "flatness" => &mut m.flatness,
                "clearcoat" => &mut m.clearcoat,
                "clearcoat_gloss" => &mut m.clearcoat_gloss,
                "main_specular_sampling_rate" => &mut m.rates.specular,
                "clearcoat_sampling_rate" => &mut m.rates.clearcoat,
                "diffuse_reflectance_sampling_rate" => &mut m.rates.diffuse,
                "eta" => &mut m.eta,
                "specular" => {
                    m.eta = index_of_specular(f64::from(*value), given("spec_trans")) as f32;
                    continue;
                }
                other => panic!("{other}"),
            } = *value;
        }
        Bsdf::Principled(m)
    } else {
        let mut m = thin(base, hue);
        for (key, value) in parameters {
            *match key.as_str() {
                "roughness" => &mut m.roughness,
                "anisotropic" => &mut m.anisotropic,
                "spec_trans" => &mut m.transmission,
                "diff_trans" => &mut m.diffuse_transmission,
                "spec_tint" => &mut m.specular_tint,
                "sheen" => &mut m.sheen,
                "sheen_tint" => &mut m.sheen_tint,
                "flatness" => &mut m.flatness,
                "eta" => &mut m.eta,
                "specular_reflectance_sampling_rate" => &mut m.rates.reflection,
                "specular_transmittance_sampling_rate" => &mut m.rates.transmission,
                "diffuse_reflectance_sampling_rate" => &mut m.rates.diffuse_reflection,
                "diffuse_transmittance_sampling_rate" => &mut m.rates.diffuse_transmission,
                other => panic!("{other}"),
            } = *value;
        }
        Bsdf::PrincipledThin(m)
    }
}

struct Row {
    wo: DVec3,
    wi: DVec3,
    value: Lanes,
    pdf: f64,
}

/// A material as written, as a scattering function, and its rows.
type Case = (String, Bsdf<'static>, Vec<Row>);

/// The table of vectors.
fn vectors() -> Vec<Case> {
    let (mut base, mut hue) = (Lanes::ONE, Lanes::ONE);
    let mut all: Vec<Case> = Vec::new();
    for line in include_str!("vectors.txt").lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |w: &&str| w.parse::<f64>().unwrap();
        match words[0] {
            "colour" => {
                let x: Vec<f64> = words[1..].iter().map(number).collect();
                base = four(&x[4..8]);
                hue = base / x[8] as f32;
            }
            "principled" | "principledthin" => {
                let parameters: Vec<(String, f32)> = words[1..]
                    .iter()
                    .map(|w| w.split_once('=').map(|(k, v)| (k.to_owned(), v.parse().unwrap())).unwrap())
                    .collect();
                all.push((line.to_owned(), material(words[0], &parameters, base, hue), Vec::new()));
            }
            _ => {
                let x: Vec<f64> = words.iter().map(number).collect();
                let row = Row {
                    wo: DVec3::new(x[0], x[1], x[2]).normalize(),
                    wi: DVec3::new(x[3], x[4], x[5]).normalize(),
                    value: four(&x[6..10]),
                    pdf: x[10],
                };
                all.last_mut().unwrap().2.push(row);
            }
        }
    }
    all
}

/// Mitsuba computes in f32: a half vector rounded there moves by 2⁻²⁴ of its length, and a density of
/// width α at m by m.x/α² of that: at roughness 0.15 (α = 0.0225) and a vector 0.05 off the normal 6e-6, a few
/// such roundings 1e-4. The smoothest material (α = 0.001) is compared where it is not at its peak.
#[test]
fn values_and_densities_equal_mitsubas() {
    let all = vectors();
    assert_eq!(all.len(), 23);
    let mut faults = String::new();
    for (name, bsdf, rows) in &all {
        assert!(rows.len() >= 8);
        for (i, row) in rows.iter().enumerate() {
            let e = bsdf.eval(row.wo, row.wi);
            let value = e.f * row.wi.z.abs() as f32;
            let found = [value.to_array().map(f64::from).to_vec(), vec![f64::from(e.pdf.to_array()[0])]].concat();
            let expected = [row.value.to_array().map(f64::from).to_vec(), vec![row.pdf]].concat();
            for (found, expected) in found.iter().zip(&expected) {
                if (found - expected).abs() > 1e-4 * expected.abs() + 1e-9 {
                    faults.push_str(&format!("{name}, row {i}: expected {expected}, found {found}\n"));
                    break;
                }
            }
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

/// Directions that viewers look from: both sides, steep and grazing.
const VIEWERS: [DVec3; 4] = [
    DVec3::new(0.36, 0.48, 0.8),
    DVec3::new(-0.9, 0.3, 0.316_227_766_016_837_94),
    DVec3::new(0.6, -0.48, -0.64),
    DVec3::new(0.1, 0.9, -0.424_264_068_711_928_5),
];

/// Pearson's test of samples against the integral of the density over 16 × 32 cells of equal solid angle, and
/// one for samples that come to nothing (a facet's mirror direction below the surface). A cell's integral is
/// taken by 12 × 12 midpoints, so only surfaces without narrow peaks take part (roughness ≥ 0.3, coat of
/// low gloss, sheets of index above 1). α = 0.001 over all tests (Šidák); the seed is fixed.
#[test]
fn sampled_directions_follow_the_stated_density() {
    const ROWS: usize = 16;
    const COLUMNS: usize = 32;
    const FINE: usize = 12;
    const SAMPLES: usize = 100_000;
    let rough =
        |name: &str| !["roughness=0.15", "roughness=0.02", "gloss=0.9", "eta=0.8"].iter().any(|x| name.contains(x));
    let all: Vec<_> = vectors().into_iter().filter(|(name, ..)| rough(name)).collect();
    let level = crate::math::statistics::sidak(0.001, all.len() * VIEWERS.len());
    for (which, (name, bsdf, _)) in all.iter().enumerate() {
        for (from, wo) in VIEWERS.into_iter().enumerate() {
            let mut counts = vec![0.0; ROWS * COLUMNS + 1];
            for i in 0..SAMPLES {
                let key = ((which * VIEWERS.len() + from) * SAMPLES + i) as u64;
                let [u_lobe, x, y] = [0, 1, 2].map(|d| mix64(4 * key + d) as f64 * 0.5f64.powi(64));
                let cell = match bsdf.sample(wo, u_lobe, DVec2::new(x, y)) {
                    None => ROWS * COLUMNS,
                    Some(s) => {
                        // The weight is f · |cos| over the density, and the density that `eval` states.
                        let e = bsdf.eval(wo, s.wi);
                        let Chosen::Density(pdf) = s.chosen else { panic!("{name}: expected a density") };
                        assert_eq!(pdf as f32, e.pdf.to_array()[0]);
                        let expected = e.f * s.wi.z.abs() as f32 / e.pdf;
                        assert!(((s.weight - expected) / (expected + 1e-6)).abs().reduce_add() < 1e-5);
                        assert_eq!(s.transmitted, s.wi.z * wo.z < 0.0);
                        let row = ((s.wi.z * 0.5 + 0.5) * ROWS as f64).min(ROWS as f64 - 1.0) as usize;
                        let turn = libm::atan2(s.wi.y, s.wi.x) / (2.0 * PI) + 0.5;
                        row * COLUMNS + (turn * COLUMNS as f64).min(COLUMNS as f64 - 1.0) as usize
                    }
                };
                counts[cell] += 1.0;
            }
            let mut expected = vec![0.0; ROWS * COLUMNS + 1];
            let area = 4.0 * PI / (ROWS * COLUMNS * FINE * FINE) as f64;
            for i in 0..ROWS * FINE {
                for j in 0..COLUMNS * FINE {
                    let z = 2.0 * (i as f64 + 0.5) / (ROWS * FINE) as f64 - 1.0;
                    let phi = 2.0 * PI * ((j as f64 + 0.5) / (COLUMNS * FINE) as f64 - 0.5);
                    let r = (1.0 - z * z).sqrt();
                    let wi = DVec3::new(r * libm::cos(phi), r * libm::sin(phi), z);
                    let pdf = f64::from(bsdf.eval(wo, wi).pdf.to_array()[0]);
                    expected[i / FINE * COLUMNS + j / FINE] += pdf * area * SAMPLES as f64;
                }
            }
            // Where nothing is sampled at all, the density is zero too.
            let found: f64 = expected.iter().sum::<f64>() / SAMPLES as f64;
            if counts[ROWS * COLUMNS] == SAMPLES as f64 {
                assert_eq!(found, 0.0, "{name} from {wo}");
                continue;
            }
            assert!(found < 1.0 + 2e-3, "{name} from {wo}: the density integrates to {found}");
            expected[ROWS * COLUMNS] = (SAMPLES as f64 * (1.0 - found)).max(0.0);
            // Cells where few are expected are pooled.
            let (mut chi2, mut cells, mut pool) = (0.0, 0, [0.0; 2]);
            for (o, e) in counts.iter().zip(&expected) {
                if *e < 8.0 {
                    pool[0] += o;
                    pool[1] += e;
                } else {
                    chi2 += (o - e) * (o - e) / e;
                    cells += 1;
                }
            }
            if pool[1] > 8.0 {
                chi2 += (pool[0] - pool[1]).powi(2) / pool[1];
                cells += 1;
            } else {
                assert!(pool[0] < pool[1] + 40.0, "{name} from {wo}: {} where {} were expected", pool[0], pool[1]);
            }
            // Wilson and Hilferty 1931: the cube root of χ²/n is nearly normal.
            let n = f64::from(cells - 1);
            let z = ((chi2 / n).cbrt() - (1.0 - 2.0 / (9.0 * n))) / (2.0 / (9.0 * n)).sqrt();
            let p = 1.0 - crate::math::statistics::normal_cdf(z);
            assert!(p > level, "{name} from {wo}: chi2 {chi2} over {n} degrees of freedom, p {p}");
        }
    }
}

fn directions(n: u32) -> impl Iterator<Item = DVec3> {
    warp::midpoints(n).map(warp::uniform_sphere)
}

/// All light that comes back from the half or whole sphere under light 1, by samples of the surface itself:
/// the mean weight over 64² midpoints and 16 lobes.
fn albedo(bsdf: &Bsdf, wo: DVec3) -> f64 {
    const N: u32 = 64;
    let mut sum = 0.0;
    for u in warp::midpoints(N) {
        for k in 0..16 {
            let u_lobe = (f64::from(k) + u.x) / 16.0;
            sum += bsdf.sample(wo, u_lobe, u).map_or(0.0, |s| f64::from(s.weight.to_array()[0]) * s.eta2);
        }
    }
    sum / f64::from(N * N * 16)
}

/// Metal, clear glass and clear sheets are microfacets of a mirror or of Fresnel's split, each masked by
/// G₁(o)G₁(i): they send out no more than comes in (radiance in glass counted over η²). Of the dielectric with
/// its diffuse base Burley's model promises no such thing: at grazing angles it sends out up to 1.4.
#[test]
fn microfacet_lobes_keep_energy() {
    for wo in VIEWERS {
        for roughness in [0.1, 0.5, 1.0] {
            for anisotropic in [0.0, 0.9] {
                let metal = Principled { metallic: 1.0, roughness, anisotropic, ..solid(Lanes::ONE, Lanes::ONE) };
                let glass = Principled { transmission: 1.0, roughness, anisotropic, ..solid(Lanes::ONE, Lanes::ONE) };
                let sheet =
                    PrincipledThin { transmission: 1.0, roughness, anisotropic, ..thin(Lanes::ONE, Lanes::ONE) };
                for bsdf in [Bsdf::Principled(metal), Bsdf::Principled(glass), Bsdf::PrincipledThin(sheet)] {
                    let a = albedo(&bsdf, wo);
                    assert!(a < 1.001, "{bsdf:?} from {wo}: {a}");
                }
                // Narrow facets lose next to nothing.
                if roughness == 0.1 && wo.z.abs() > 0.5 {
                    let a = albedo(&Bsdf::Principled(glass), wo);
                    assert!(a > 0.99, "{a}");
                }
            }
        }
    }
}

/// f(o, i) = f(i, o) where light is reflected; refraction scales radiance by η² one way. What crosses a clear
/// sheet is left out: its facets' masking is one-sided.
#[test]
fn surfaces_are_reciprocal() {
    for (name, bsdf, _) in vectors() {
        let eta2 = |to: f64| match &bsdf {
            Bsdf::Principled(m) if to < 0.0 => f64::from(m.eta).powi(2),
            Bsdf::Principled(m) => f64::from(m.eta).powi(-2),
            _ => 1.0,
        };
        for wo in VIEWERS {
            for wi in directions(12) {
                if wo.z * wi.z < 0.0 && matches!(bsdf, Bsdf::PrincipledThin(m) if m.transmission > 0.0) {
                    continue;
                }
                let there = bsdf.eval(wo, wi).f;
                let mut back = bsdf.eval(wi, wo).f;
                if wo.z * wi.z < 0.0 {
                    // f(o, i) η_o² = f(i, o) η_i² (Veach 1997, eq. 5.14), with radiance in the denser side
                    // counted over η².
                    back *= (1.0 / eta2(wi.z)) as f32;
                }
                let difference = (there - back).abs().to_array()[1];
                // The coat's and the facets' densities are sums in another order: some ulps of f32.
                assert!(difference <= 1e-5 * there.to_array()[1] + 1e-12, "{name}: {wo} {wi}: {there:?} {back:?}");
            }
        }
    }
}

/// At roughness 0.001² the facets are as narrow as they get, and the anisotropic ones with the product of
/// the isotropic widths.
#[test]
fn widths_are_bounded_and_stretched_by_the_aspect() {
    let narrow = facets(0.0, 0.5);
    assert_eq!((narrow.alpha, narrow.ratio), (0.001, 1.0));
    let long = facets(0.6, 1.0);
    assert!((long.alpha * long.alpha * long.ratio - 0.36f64.powi(2)).abs() < 1e-15 && (long.ratio - 0.1).abs() < 1e-15);
    assert!((CoatFacets::of_gloss(1.0).alpha - 0.001).abs() < 1e-15);
}

/// Neither surface makes the closed set of scattering functions larger than rough metal does.
/// R₀ = ((n − 1)/(n + 1))² is 0.08 times the number, but for a surface that transmits, which has a thousandth of that at least and
/// no index of one.
#[test]
fn an_index_by_specular_or_by_number_is_the_contrast_that_is_asked_for() {
    for (specular, transmits, expected) in
        [(0.5, false, 0.04), (0.0, false, 0.0), (1.0, true, 0.08), (0.25, true, 0.02), (0.0, true, 8e-5)]
    {
        let n = index_of_specular(specular, transmits);
        let reflected = ((n - 1.0) / (n + 1.0)).powi(2);
        assert!((reflected - expected).abs() < 1e-15, "{specular} {transmits}: {reflected}");
    }
    let by_number = [(1.0, false), (1.0, true), (1.5, true)].map(|(eta, transmits)| index_of_eta(eta, transmits));
    assert_eq!(by_number, [1.0, 1.001, 1.5]);
}

#[test]
fn records_are_no_larger_than_a_rough_metal() {
    assert!(size_of::<Principled>() <= 128 && size_of::<PrincipledThin>() <= 128);
}
