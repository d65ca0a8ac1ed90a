//! Fresnel's equations against the textbook's in 104 bits.

use crate::Found;
use crate::math::dd::Dd;
use crate::testing::Random;
use abbe::optics::fresnel::{Model, dielectric};

/// Relative error of R and T that f32 light does not see.
const MOST: f64 = 1e-6;

/// cos from 1e-7 to 1 or about the critical angle with margins from 1e-12, indices from 1 ± 1e-7 to 5. Total reflection is
/// told for certain where c² + η² − 1 is off zero by 1e-12 of η² − 1; R + T is one within a step of f32, R and T each are
/// right to 1e-6.
pub fn ask(rays: u64, random: &mut Random, found: &mut Found) {
    for i in 0..rays {
        let more = random.log_uniform(-7.0, 4f64.log10());
        let eta = if i % 2 == 0 { 1.0 + more } else { 1.0 / (1.0 + more) };
        let sign = if random.uniform() < 0.5 { 1.0 } else { -1.0 };
        let cos = if i % 4 == 1 {
            // About the critical angle.
            let margin = sign * random.log_uniform(-12.0, -1.0);
            ((1.0 - eta) * (1.0 + eta) * (1.0 + margin)).sqrt().clamp(1e-7, 1.0)
        } else {
            random.log_uniform(-7.0, 0.0)
        };
        let result = one(cos, eta, &mut found.worst);
        found.note(result);
    }
}

fn one(cos: f64, eta: f64, worst: &mut f64) -> Result<u64, String> {
    let (c, n, one) = (Dd::from(cos), Dd::from(eta), Dd::from(1.0));
    let q = (n - one) * (n + one);
    let g2 = c * c + q;
    let split = dielectric(Model::Exact, cos, eta);
    let fault = |what: &str, error: f64| Err(format!("{what}, off by {error:e}: cos {cos:e}, eta {eta:?}: {split:?}"));
    let margin = g2.to_f64() / q.to_f64().abs();
    if g2.to_f64() <= 0.0 {
        let told = split.transmitted == 0.0 && split.reflected == 1.0;
        return if told || margin > -1e-12 { Ok(1) } else { fault("total reflection was not told", margin) };
    }
    if q.to_f64() < 0.0 && margin < 1e-12 {
        return Ok(1);
    }
    let g = g2.sqrt();
    let (s, p) = ((c - g) / (c + g), (n * n * c - g) / (n * n * c + g));
    let r = Dd::from(0.5) * (s * s + p * p);
    let t = one - r;
    let relative = |found: f64, expected: Dd| ((Dd::from(found) - expected) / expected).to_f64().abs();
    let (r_off, t_off) = (relative(split.reflected, r), relative(split.transmitted, t));
    *worst = worst.max(r_off).max(t_off);
    if r_off > MOST || r_off.is_nan() {
        return fault("R", r_off);
    }
    if t_off > MOST || t_off.is_nan() {
        return fault("T", t_off);
    }
    let sum = split.reflected + split.transmitted - 1.0;
    if sum.abs() > f64::from(f32::EPSILON) { fault("R + T", sum) } else { Ok(1) }
}
