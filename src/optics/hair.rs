//! Fibres of hair: a glassy, coloured cylinder with tilted scales, seen from far enough to be a line.
//!
//! Local frame: y runs along the fibre toward its tip, z is the normal, so that the offset h of a ray from the
//! fibre's axis shows in the direction to the viewer. θ is the angle of a direction to the plane across the
//! fibre, φ its angle within.
//!
//! Light takes p = 0, 1, 2 … ways through the fibre: it is reflected (R), crosses (TT), is reflected inside once
//! (TRT), more often (the rest, for which no direction is kept). Marschner et al. 2003; the lobes of d'Eon et al. 2011,
//! "An Energy-Conserving Hair Reflectance Model"; offsets and sampling of Chiang et al. 2016, "A Practical and
//! Controllable Hair and Fur Model for Production Path Tracing". Parameters as in Mitsuba 3's `hair`.

use super::bsdf::{BsdfSample, Evaluation, from_evaluation};
use super::fresnel::{self, Model};
use super::mean;
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Ways through the fibre that have a direction.
const WAYS: usize = 3;

/// What does not depend on wavelength or place.
#[derive(Clone, Copy, Debug)]
pub struct Fibre {
    /// Index inside over outside.
    eta: f64,
    /// Variance of each lobe along the fibre.
    variance: [f64; WAYS + 1],
    /// Width of the lobes around the fibre.
    width: f64,
    /// Sine and cosine by which scales turn each way.
    turn: [(f64, f64); WAYS],
}

impl Fibre {
    /// A fibre of index ratio `eta`, of roughness `along` and `around` in 0 to 1, with scales that are tilted by
    /// `tilt` radians toward the root.
    #[must_use]
    pub fn new(eta: f64, along: f64, around: f64, tilt: f64) -> Fibre {
        // The fits of Chiang et al. 2016, eqs. 7 and 8.
        let v = (0.726 * along + 0.812 * along * along + 3.7 * along.powi(20)).powi(2);
        let width = (PI / 8.0).sqrt() * (0.265 * around + 1.194 * around * around + 5.372 * around.powi(22));
        // A reflection turns by twice the tilt, each way inside back by one and by four (Marschner et al.
        // 2003, table 1, with the root of TRT's as in Chiang et al.).
        let turn = |angle: f64| (libm::sin(angle), libm::cos(angle));
        Fibre {
            eta,
            variance: [v, 0.25 * v, 4.0 * v, 4.0 * v],
            width,
            turn: [turn(-2.0 * tilt), turn(tilt), turn(4.0 * tilt)],
        }
    }
}

/// Hair at one point.
#[derive(Clone, Copy, Debug)]
pub struct Hair<'a> {
    /// The fibre.
    pub fibre: &'a Fibre,
    /// Absorption times the fibre's radius.
    pub absorption: Lanes,
}

/// A direction by its angles to the fibre.
struct Angles {
    sin_theta: f64,
    cos_theta: f64,
    phi: f64,
}

impl Angles {
    fn of(w: DVec3) -> Angles {
        let sin_theta = w.y.clamp(-1.0, 1.0);
        let cos_theta = (w.x * w.x + w.z * w.z).sqrt();
        Angles { sin_theta, cos_theta, phi: libm::atan2(w.z, w.x) }
    }
}

/// What the viewer's direction decides.
struct Seen {
    wo: Angles,
    /// γ, radians: sin γ is the offset from the axis in radii.
    gamma: f64,
    /// The angle within.
    gamma_t: f64,
    /// Share of the light on each way, and the probability with which the way is sampled.
    shares: [Lanes; WAYS + 1],
    probability: [f64; WAYS + 1],
}

/// ln I₀(x) for x ≥ 0.
fn ln_bessel(x: f64) -> f64 {
    if x < 12.0 {
        // The power series Σ (x²/4)ⁿ / n!²; at x = 12 the 40th term is 1e-30 of the sum.
        let q = 0.25 * x * x;
        let (mut term, mut sum) = (1.0, 1.0);
        for n in 1..40 {
            term *= q / f64::from(n * n);
            sum += term;
        }
        libm::log(sum)
    } else {
        // Hankel's series (Abramowitz and Stegun 9.7.1): the terms fall until n = 2x ≥ 24, those left are below 1e-8.
        let (mut term, mut sum) = (1.0, 1.0);
        for n in 1..12 {
            let odd = f64::from(2 * n - 1);
            term *= odd * odd / (f64::from(8 * n) * x);
            sum += term;
        }
        x - 0.5 * libm::log(TAU * x) + libm::log(sum)
    }
}

/// M: density of sin θ_i, for light leaving at θ_o with variance `v` (d'Eon et al. 2011, eq. 7).
fn along(sin_o: f64, cos_o: f64, sin_i: f64, cos_i: f64, v: f64) -> f64 {
    // csch(1/v)/(2v) · exp(−sin sin / v) · I₀(cos cos / v), in logarithms: csch overflows for narrow lobes.
    let ln_csch = -1.0 / v + std::f64::consts::LN_2 - libm::log1p(-libm::exp(-2.0 / v));
    libm::exp(ln_csch - libm::log(2.0 * v) - sin_o * sin_i / v + ln_bessel(cos_o * cos_i / v))
}

/// 1/(1 + e^(−x/s))
fn logistic_cdf(x: f64, s: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-x / s))
}

/// N: density of an angle off the mirror's, a logistic one within half a turn.
fn around(offset: f64, s: f64) -> f64 {
    let x = (offset - TAU * (offset / TAU).round()).abs();
    let e = libm::exp(-x / s);
    e / (s * (1.0 + e) * (1.0 + e)) / (logistic_cdf(PI, s) - logistic_cdf(-PI, s))
}

/// An angle with the density [`around`].
fn sample_around(u: f64, s: f64) -> f64 {
    let (low, high) = (logistic_cdf(-PI, s), logistic_cdf(PI, s));
    let c = low + u * (high - low);
    (-s * libm::log(1.0 / c - 1.0)).clamp(-PI, PI)
}

impl Hair<'_> {
    fn seen(&self, wo: DVec3) -> Option<Seen> {
        let fibre = self.fibre;
        let a = Angles::of(wo);
        if a.cos_theta == 0.0 {
            return None;
        }
        // The offset from the axis that makes the normal what it is.
        let h = -wo.x / a.cos_theta;
        let gamma = libm::atan2(-wo.x, wo.z);
        // Bravais: a section seen aslant has a greater index (Marschner et al. 2003, appendix B).
        let eta_section = (fibre.eta * fibre.eta - a.sin_theta * a.sin_theta).max(0.0).sqrt() / a.cos_theta;
        let sin_gamma_t = (h / eta_section).clamp(-1.0, 1.0);
        let cos_gamma_t = (1.0 - sin_gamma_t * sin_gamma_t).sqrt();
        let sin_theta_t = a.sin_theta / fibre.eta;
        let cos_theta_t = (1.0 - sin_theta_t * sin_theta_t).max(0.0).sqrt();
        let through = (self.absorption * (-2.0 * cos_gamma_t / cos_theta_t) as f32).exp();
        let split = fresnel::dielectric(Model::Exact, a.cos_theta * (1.0 - h * h).max(0.0).sqrt(), fibre.eta);
        let (f, t) = (split.reflected as f32, split.transmitted as f32);
        let mut shares = [Lanes::splat(f), through * (t * t), Lanes::ZERO, Lanes::ZERO];
        shares[2] = shares[1] * through * f;
        // f ρ³ (1 − F)² F + … of a geometric series.
        shares[3] = shares[2] * through * f / (Lanes::ONE - through * f);
        let means = shares.map(mean);
        let total: f64 = means.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        Some(Seen { wo: a, gamma, gamma_t: libm::asin(sin_gamma_t), shares, probability: means.map(|m| m / total) })
    }

    /// The share of light from all around that leaves toward `wo`: M and N are densities.
    pub(super) fn reflectance(&self, wo: DVec3) -> Lanes {
        self.seen(wo).map_or(Lanes::ZERO, |seen| seen.shares.into_iter().fold(Lanes::ZERO, |sum, share| sum + share))
    }

    /// θ_o as the scales turn it on way `p`: its sine and cosine.
    fn turned(&self, wo: &Angles, p: usize) -> (f64, f64) {
        let Some(&(sin, cos)) = self.fibre.turn.get(p) else { return (wo.sin_theta, wo.cos_theta) };
        (wo.sin_theta * cos + wo.cos_theta * sin, (wo.cos_theta * cos - wo.sin_theta * sin).abs())
    }

    /// The angle around the fibre by which way `p` turns a ray.
    fn deflection(seen: &Seen, p: usize) -> f64 {
        let p = p as f64;
        2.0 * p * seen.gamma_t - 2.0 * seen.gamma + p * PI
    }

    pub(super) fn eval(&self, wo: DVec3, wi: DVec3) -> Evaluation {
        let Some(seen) = self.seen(wo) else { return Evaluation::NONE };
        let light = Angles::of(wi);
        if wi.z == 0.0 {
            return Evaluation::NONE;
        }
        let mut sum = Lanes::ZERO;
        let mut pdf = 0.0;
        for p in 0..=WAYS {
            let (sin_o, cos_o) = self.turned(&seen.wo, p);
            let m = along(sin_o, cos_o, light.sin_theta, light.cos_theta, self.fibre.variance[p]);
            let n = if p < WAYS {
                around(light.phi - seen.wo.phi - Self::deflection(&seen, p), self.fibre.width)
            } else {
                1.0 / TAU
            };
            sum += seen.shares[p] * (m * n) as f32;
            pdf += seen.probability[p] * m * n;
        }
        // The lobes hold the cosine at the surface: it is the fibre that scatters.
        Evaluation { f: sum * (1.0 / wi.z.abs()) as f32, pdf: Lanes::splat(pdf as f32) }
    }

    pub(super) fn sample(&self, wo: DVec3, u_lobe: f64, u: DVec2) -> Option<BsdfSample> {
        let seen = self.seen(wo)?;
        // The way, and what is left of its random number for the angle around the fibre.
        let mut left = u_lobe;
        let mut p = 0;
        while p < WAYS && left >= seen.probability[p] {
            left -= seen.probability[p];
            p += 1;
        }
        let left = (left / seen.probability[p]).clamp(0.0, 1.0 - f64::EPSILON);
        // d'Eon et al. 2013, "A Fiber Scattering Model with Non-Separable Lobes": along the fibre.
        let (sin_o, cos_o) = self.turned(&seen.wo, p);
        let v = self.fibre.variance[p];
        let cos = (1.0 + v * libm::log(u.x + (1.0 - u.x) * libm::exp(-2.0 / v))).clamp(-1.0, 1.0);
        let sin = (1.0 - cos * cos).sqrt();
        let sin_i = (-cos * sin_o + sin * libm::cos(TAU * u.y) * cos_o).clamp(-1.0, 1.0);
        let cos_i = (1.0 - sin_i * sin_i).sqrt();
        let offset =
            if p < WAYS { Self::deflection(&seen, p) + sample_around(left, self.fibre.width) } else { TAU * left };
        let phi = seen.wo.phi + offset;
        let wi = DVec3::new(cos_i * libm::cos(phi), sin_i, cos_i * libm::sin(phi));
        from_evaluation(wi, wi.z.abs(), self.eval(wo, wi), wi.z * wo.z < 0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::mix64;
    use crate::math::warp;
    use crate::optics::bsdf::Bsdf;

    fn hair(along: f64, around: f64, absorption: f32) -> Bsdf<'static> {
        let fibre = Box::leak(Box::new(Fibre::new(1.55, along, around, 2f64.to_radians())));
        Bsdf::Hair(Hair { fibre, absorption: Lanes::splat(absorption) })
    }

    const VIEWERS: [DVec3; 3] = [
        DVec3::new(0.36, 0.48, 0.8),
        DVec3::new(-0.9, 0.3, 0.316_227_766_016_837_94),
        DVec3::new(0.2, -0.8, 0.565_685_424_949_238),
    ];

    fn sphere(n: u32) -> impl Iterator<Item = DVec3> {
        warp::midpoints(n).map(warp::uniform_sphere)
    }

    /// Without absorption the shares are F + (1 − F)² + (1 − F)² F + … = 1, M and N are densities: all
    /// light leaves. But M is turned by the scales and |cos(θ_o + tilt)| is folded at grazing, which these
    /// viewers are far from; 256² midpoints of lobes of 0.1 rad leave 1e-3. The density integrates to one for any
    /// absorption, and what is left of the light is the albedo.
    #[test]
    fn clear_hair_keeps_all_light_and_densities_integrate_to_one() {
        for (along, around) in [(0.3, 0.3), (0.6, 0.5), (0.9, 0.9)] {
            for wo in VIEWERS {
                let (clear, dark) = (hair(along, around, 0.0), hair(along, around, 0.7));
                let (mut light, mut density, mut left) = (0.0, 0.0, 0.0);
                for wi in sphere(256) {
                    let e = clear.eval(wo, wi);
                    light += f64::from(e.f.to_array()[0]) * wi.z.abs();
                    let e = dark.eval(wo, wi);
                    density += f64::from(e.pdf.to_array()[0]);
                    left += f64::from(e.f.to_array()[0]) * wi.z.abs();
                }
                let area = 4.0 * PI / 65_536.0;
                assert!((light * area - 1.0).abs() < 2e-3, "{along} {around} {wo}: {}", light * area);
                assert!((density * area - 1.0).abs() < 2e-3, "{along} {around} {wo}: {}", density * area);
                let albedo = f64::from(dark.albedo(wo).to_array()[0]);
                assert!((left * area - albedo).abs() < 2e-3, "{along} {around} {wo}: {} {albedo}", left * area);
                assert!((f64::from(clear.albedo(wo).to_array()[0]) - 1.0).abs() < 1e-6);
            }
        }
    }

    /// Means over samples of the products of two coordinates are integrals against the density: the
    /// standard error of 40000 samples of numbers of at most one is below 5e-3, four of them 2e-2. The lobes around the rougher
    /// fibre have a tenth of their logistic density beyond half a turn.
    #[test]
    fn sampled_directions_follow_the_stated_density() {
        for (hair, wo) in
            [hair(0.4, 0.4, 0.3), hair(0.9, 0.9, 0.3)].iter().flat_map(|hair| VIEWERS.map(|wo| (hair, wo)))
        {
            let moments = |w: DVec3| [w.x * w.y, w.y * w.z, w.x * w.z, w.y, w.x, w.z, w.y * w.y, w.z * w.z];
            let (mut sampled, mut integral) = ([0.0; 8], [0.0; 8]);
            const SAMPLES: u64 = 40_000;
            for i in 0..SAMPLES {
                let [a, b, c] = [0, 1, 2].map(|d| mix64(4 * i + d) as f64 * 0.5f64.powi(64));
                let s = hair.sample(wo, a, DVec2::new(b, c)).unwrap();
                assert_eq!(s.transmitted, s.wi.z < 0.0);
                for (sum, m) in sampled.iter_mut().zip(moments(s.wi)) {
                    *sum += m / SAMPLES as f64;
                }
            }
            for wi in sphere(256) {
                let pdf = f64::from(hair.eval(wo, wi).pdf.to_array()[0]) * 4.0 * PI / 65_536.0;
                for (sum, m) in integral.iter_mut().zip(moments(wi)) {
                    *sum += m * pdf;
                }
            }
            for (s, i) in sampled.iter().zip(&integral) {
                assert!((s - i).abs() < 2e-2, "{wo}: {sampled:?} {integral:?}");
            }
        }
    }

    /// I₀(1), I₀(5), I₀(20) to ten digits (Abramowitz and Stegun, table 9.8 and mpmath).
    #[test]
    fn bessel_function_equals_the_tables() {
        for (x, expected) in [(0.0, 1.0f64), (1.0, 1.266_065_877_8), (5.0, 27.239_871_823_6), (20.0, 43_558_282.559_6)]
        {
            assert!((ln_bessel(x) - expected.ln()).abs() < 1e-10, "{x}");
        }
        // The two forms meet.
        assert!((ln_bessel(12.0 - 1e-9) - ln_bessel(12.0 + 1e-9)).abs() < 1e-8);
    }

    /// eval (with the cosine) of Mitsuba 3.9.1's hair, made by tools/vectors/hair.py. Its ln I₀ is a series cut
    /// after n = 10 below x = 12, which loses 0.57 % there, and above it lacks half of 1/8x, 0.52 %.
    #[test]
    fn values_equal_mitsubas() {
        let mut rows = 0;
        let mut current = None;
        for line in include_str!("hair_vectors.txt").lines().filter(|line| !line.starts_with('#')) {
            let (kind, rest) = line.split_once(' ').unwrap();
            let x: Vec<f64> = rest.split(' ').map(|w| w.parse().unwrap()).collect();
            if kind == "hair" {
                let fibre = Box::leak(Box::new(Fibre::new(x[0], x[1], x[2], x[3].to_radians())));
                current = Some(Bsdf::Hair(Hair { fibre, absorption: Lanes::splat(x[4] as f32) }));
                continue;
            }
            let (wo, wi) = (DVec3::new(x[0], x[1], x[2]), DVec3::new(x[3], x[4], x[5]));
            let e = current.as_ref().unwrap().eval(wo.normalize(), wi.normalize());
            let found = f64::from(e.f.to_array()[0]) * wi.z.abs();
            assert!((found - x[6]).abs() < 7e-3 * x[6] + 1e-6, "{line}: found {found}");
            rows += 1;
        }
        assert!(rows > 40);
    }
}
