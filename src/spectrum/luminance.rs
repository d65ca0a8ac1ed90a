//! The luminance of a colour that varies, from few of its values.

use crate::spectrum::observer::{matching, quadrature};
use crate::spectrum::{LANES, Lanes, illuminant};
use std::sync::LazyLock;

/// What linear red, green and blue of Rec. 709 add to the luminance, as it prints them.
pub const REC709: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The same with the digits of Mitsuba 3.
pub const REC709_OF_MITSUBA: [f64; 3] = [0.212_671, 0.715_160, 0.072_169];

/// Eight wavelengths (nm) and weights that add up to one.
struct Rule {
    nm: Lanes,
    weight: Lanes,
}

/// Gauss's rule for the weight ȳ(λ) · D65(λ): exact where the colour is a polynomial in λ of degree 15.
static UNDER_D65: LazyLock<Rule> = LazyLock::new(|| {
    let d65 = illuminant::d65();
    let measure: Vec<(f64, f64)> = quadrature(&d65.breakpoints())
        .into_iter()
        .map(|(nm, weight)| (scaled(nm), weight * matching(nm)[1] * d65.at(nm)))
        .collect();
    gauss(&measure)
});

/// The band on [−1, 1].
fn scaled(nm: f64) -> f64 {
    (nm - 595.0) / 235.0
}

/// Gauss's rule with [`LANES`] nodes for a measure that is given by many points of weight. The polynomials
/// p_k that are orthonormal under it follow by Stieltjes' procedure (Gautschi 2004, *Orthogonal
/// Polynomials*, 2.2.3); the nodes are the zeros of p_n, the weights 1 / Σ p_k² over k < n (1.4.1).
fn gauss(measure: &[(f64, f64)]) -> Rule {
    let total: f64 = measure.iter().map(|m| m.1).sum();
    // x p_k = b_{k+1} p_{k+1} + a_k p_k + b_k p_{k−1}
    let (mut a, mut b) = ([0.0; LANES], [0.0; LANES + 1]);
    b[0] = total.sqrt();
    let mut last = vec![0.0; measure.len()];
    let mut now = vec![1.0 / b[0]; measure.len()];
    for k in 0..LANES {
        a[k] = measure.iter().zip(&now).map(|((x, w), p)| w * x * p * p).sum();
        let next: Vec<f64> =
            measure.iter().zip(&now).zip(&last).map(|(((x, _), p), q)| (x - a[k]) * p - b[k] * q).collect();
        b[k + 1] = measure.iter().zip(&next).map(|((_, w), p)| w * p * p).sum::<f64>().sqrt();
        last = now;
        now = next.iter().map(|p| p / b[k + 1]).collect();
        // The recurrence starts without b₀.
        if k == 0 {
            b[0] = 0.0;
        }
    }
    let polynomials = |x: f64| {
        let mut p = [0.0; LANES + 1];
        p[0] = 1.0 / total.sqrt();
        for k in 0..LANES {
            let before = if k == 0 { 0.0 } else { b[k] * p[k - 1] };
            p[k + 1] = ((x - a[k]) * p[k] - before) / b[k + 1];
        }
        p
    };
    // The zeros are simple and lie inside: signs on a grid that is finer than their distances, then bisection.
    const STEPS: u32 = 4096;
    let grid = |i: u32| 2.0 * f64::from(i) / f64::from(STEPS) - 1.0;
    let mut nodes = [(0.0, 0.0); LANES];
    let mut found = 0;
    for i in 0..STEPS {
        let (mut low, mut high) = (grid(i), grid(i + 1));
        let sign = polynomials(low)[LANES] > 0.0;
        if found == LANES || (polynomials(high)[LANES] > 0.0) == sign {
            continue;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if (polynomials(middle)[LANES] > 0.0) == sign { low = middle } else { high = middle }
        }
        let p = polynomials(low);
        nodes[found] = (low, 1.0 / p[..LANES].iter().map(|p| p * p).sum::<f64>());
        found += 1;
    }
    Rule {
        nm: Lanes::new(nodes.map(|n| (595.0 + 235.0 * n.0) as f32)),
        weight: Lanes::new(nodes.map(|n| (n.1 / total) as f32)),
    }
}

/// Y under D65 of the colour whose reflectance at each of eight wavelengths (nm) is `value`: one for white. For
/// a smooth colour of Rec. 709 that is 0.2126 R + 0.7152 G + 0.0722 B.
#[must_use]
pub fn under_d65(value: impl Fn(Lanes) -> Lanes) -> f32 {
    let rule = &*UNDER_D65;
    (value(rule.nm) * rule.weight).reduce_add()
}

/// What Mitsuba 3's spectral modes take for the luminance of a colour, at each wavelength of `nm`: the plain mean
/// of ȳ times the colour over the four wavelengths of the packet that a camera path there draws together, that
/// is P⁻¹(frac(P(λ) + j/4)) with P the distribution function of 1 / cosh²(0.0072 (λ − 538)) over the band.
/// Neither divided by the density of the wavelengths nor by ∫ ȳ, it makes white 0.38 rather than 1, and
/// differs between the packets. Each value depends on its own wavelength alone.
#[must_use]
pub fn of_packet(nm: Lanes, value: impl Fn(Lanes) -> Lanes) -> Lanes {
    // P is linear in tanh(0.0072 (λ − 538)).
    let low = libm::tanh(0.0072 * (360.0 - 538.0));
    let span = libm::tanh(0.0072 * (830.0 - 538.0)) - low;
    let luminosity = |nm: Lanes| Lanes::new(nm.to_array().map(|nm| matching(f64::from(nm))[1] as f32));
    let mut sum = luminosity(nm) * value(nm);
    let e = ((nm - Lanes::splat(538.0)) * Lanes::splat(0.0144)).exp();
    let u = ((e - Lanes::ONE) / (e + Lanes::ONE) - Lanes::splat(low as f32)) * Lanes::splat((1.0 / span) as f32);
    for j in 1..4 {
        let shifted = u + Lanes::splat(j as f32 * 0.25);
        let shifted = shifted - shifted.simd_ge(Lanes::ONE).select(Lanes::ONE, Lanes::ZERO);
        let t = shifted * Lanes::splat(span as f32) + Lanes::splat(low as f32);
        let other =
            Lanes::splat(538.0) + ((Lanes::ONE + t) / (Lanes::ONE - t)).ln() * Lanes::splat((0.5 / 0.0072) as f32);
        // Rounding may leave the band by an ulp.
        let other = other.max(Lanes::splat(360.0)).min(Lanes::splat(830.0));
        sum += luminosity(other) * value(other);
    }
    sum * Lanes::splat(0.25)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::upsample;

    /// Wavelength (nm), luminance of a white packet, and of one of value (λ − 300 nm) / 600 nm.
    const VECTORS: [(f32, f32, f32); 5] = [
        (424.342_93, 0.366_984_78, 0.156_281_41),
        (657.500_6, 0.366_984_78, 0.156_281_41),
        (512.619_14, 0.376_066_1, 0.159_298_93),
        (692.977_4, 0.394_093_87, 0.166_963_06),
        (545.648_4, 0.384_537_46, 0.166_224_38),
    ];

    /// The measure's total is Y of D65, one; for polynomials up to degree 15 the rule is the integral.
    #[test]
    fn gauss_rule_is_exact_for_polynomials() {
        assert!((UNDER_D65.weight.reduce_add() - 1.0).abs() < 1e-6);
        let d65 = illuminant::d65();
        for degree in [1, 2, 5, 9, 15] {
            let mut exact = 0.0;
            let mut total = 0.0;
            for (nm, weight) in quadrature(&d65.breakpoints()) {
                let w = weight * matching(nm)[1] * d65.at(nm);
                exact += w * scaled(nm).powi(degree);
                total += w;
            }
            let t = (UNDER_D65.nm.to_array()).map(|nm| scaled(f64::from(nm)).powi(degree) as f32);
            let found = f64::from((Lanes::new(t) * UNDER_D65.weight).reduce_add());
            // f32 nodes and weights: 2⁻²⁴ of each of eight terms below one, and of λ / 235 nm.
            assert!((found - exact / total).abs() < 3e-6, "{degree}: {found} {}", exact / total);
        }
    }

    /// Y of linear Rec. 709. Colours at the edge of the gamut are steep sigmoids, which eight nodes meet to
    /// half a per cent of white; moderate ones to 1e-4.
    #[test]
    fn luminance_of_a_colour_is_that_of_its_rgb() {
        for (rgb, tolerance) in
            [([0.5, 0.5, 0.5], 1e-6), ([0.2, 0.8, 0.1], 5e-3), ([0.7, 0.4, 0.3], 1e-4), ([0.9, 0.1, 0.1], 5e-3)]
        {
            let spectrum = upsample::reflectance(rgb).unwrap();
            let found = f64::from(under_d65(|nm| spectrum.eval(nm)));
            let expected = 0.212_639 * rgb[0] + 0.715_169 * rgb[1] + 0.072_192 * rgb[2];
            assert!((found - expected).abs() < tolerance, "{rgb:?}: {found} {expected}");
        }
    }

    /// mi.luminance(values, nm) with nm, w = mi.sample_rgb_spectrum((u + j/4) % 1) in Mitsuba 3.9.1, whose ȳ is
    /// tabulated at 5 nm, which moves the mean by up to 2e-3 of itself. Over all u white is 0.361 to 0.397.
    #[test]
    fn packets_are_those_of_mitsuba() {
        for (nm, white, sloped) in VECTORS {
            let one = of_packet(Lanes::splat(nm), |_| Lanes::ONE).to_array()[0];
            let slope = of_packet(Lanes::splat(nm), |nm| (nm - Lanes::splat(300.0)) / 600.0).to_array()[0];
            assert!((one / white - 1.0).abs() < 2e-3 && (slope / sloped - 1.0).abs() < 2e-3, "{nm}: {one} {slope}");
        }
        for i in 0..=470 {
            let white = of_packet(Lanes::splat(360.0 + i as f32), |_| Lanes::ONE).to_array()[0];
            assert!((0.36..0.40).contains(&white), "{i}: {white}");
        }
    }
}
