//! Microfacet distributions: which way the tiny mirrors of a rough surface face.
//!
//! Local frame, z = mean normal. The width `alpha` is along local x, and along y for an isotropic
//! surface; no squaring of a "roughness". Brushed surfaces are isotropic ones stretched along y: where
//! slopes occur, the y component counts `ratio` times less (Heitz 2014, 5.3).
//! Walter et al. 2007 (D, Smith's G, rough dielectrics); Heitz 2018 and Dupuy and Benyoub 2023
//! (sampling visible GGX normals). Shadowing and masking are separable, G₁(o) G₁(i), as in
//! Mitsuba 3, so that the two can be compared pixel by pixel.

use crate::math::elementary::{exp_down, log1p};
use crate::math::four::{Vec4, plain_dot};
use crate::math::trig::sin_cos_turn;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;
use wide::f64x4;

/// The family of the distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Distribution {
    /// Trowbridge and Reitz 1975: long tails.
    #[default]
    Ggx,
    /// Beckmann and Spizzichino 1963: Gaussian slopes.
    Beckmann,
}

/// A rough surface.
#[derive(Clone, Copy, Debug)]
pub struct Microfacets {
    /// The family.
    pub distribution: Distribution,
    /// Width along local x; the root mean square slope is of this order.
    pub alpha: f64,
    /// Width along local y over that along x; one for an isotropic surface.
    pub ratio: f64,
}

/// The facets between two directions.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    /// D(m) G₁(o) G₁(i) / |cos θ_o cos θ_i|, in sr⁻¹.
    pub flow: f64,
    /// [`Microfacets::pdf`].
    pub pdf: f64,
}

impl Microfacets {
    /// The same width in all directions.
    #[must_use]
    pub fn isotropic(distribution: Distribution, alpha: f64) -> Microfacets {
        Microfacets { distribution, alpha, ratio: 1.0 }
    }

    /// `alpha_u` along local x, `alpha_v` along local y.
    #[must_use]
    pub fn anisotropic(distribution: Distribution, alpha_u: f64, alpha_v: f64) -> Microfacets {
        Microfacets { distribution, alpha: alpha_u, ratio: alpha_v / alpha_u }
    }

    /// D(m) in sr⁻¹, by the vector rather than by its angle: cos² forms lose 12 % at α = 1e-3
    /// because 1 − cos² cancels.
    #[must_use]
    pub fn density(&self, m: DVec3) -> f64 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        let y = m.y / self.ratio;
        let slope2 = (m.x * m.x + y * y) / a2;
        let z2 = m.z * m.z;
        let a2 = a2 * self.ratio;
        match self.distribution {
            Distribution::Ggx => {
                let d = slope2 + z2;
                1.0 / (PI * a2 * d * d)
            }
            Distribution::Beckmann => exp_down(-slope2 / z2) / (PI * a2 * z2 * z2),
        }
    }

    /// G₁(v): the share of facets facing `m` that `v` sees.
    #[must_use]
    pub fn masking(&self, v: DVec3, m: DVec3) -> f64 {
        // A facet seen from its back contributes nothing (Walter et al. 2007, eq. 23).
        if v.dot(m) * v.z <= 0.0 {
            return 0.0;
        }
        let y = v.y * self.ratio;
        let tan2_alpha = (v.x * v.x + y * y) / (v.z * v.z) * (self.alpha * self.alpha);
        if tan2_alpha == 0.0 {
            return 1.0;
        }
        match self.distribution {
            Distribution::Ggx => 2.0 / (1.0 + (1.0 + tan2_alpha).sqrt()),
            Distribution::Beckmann => {
                // Rational fit of Walter et al. 2007, eq. 27, with a = 1 / (α tan θ).
                let a = 1.0 / tan2_alpha.sqrt();
                if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
            }
        }
    }

    /// [`Microfacets::masking`] of four directions and facets, side by side and to the same bits.
    #[must_use]
    pub fn masking_of_four(&self, v: &Vec4, m: &Vec4) -> f64x4 {
        let [x, y, z] = *v;
        let y = y * f64x4::splat(self.ratio);
        let tan2_alpha = (x * x + y * y) / (z * z) * f64x4::splat(self.alpha * self.alpha);
        let (one, two) = (f64x4::ONE, f64x4::splat(2.0));
        let seen = match self.distribution {
            Distribution::Ggx => two / (one + (one + tan2_alpha).sqrt()),
            Distribution::Beckmann => {
                let a = one / tan2_alpha.sqrt();
                let [c, d, e, f] = [3.535, 2.181, 2.276, 2.577].map(f64x4::splat);
                a.simd_ge(f64x4::splat(1.6)).select(one, (c * a + d * a * a) / (one + e * a + f * a * a))
            }
        };
        let seen = tan2_alpha.simd_eq(f64x4::ZERO).select(one, seen);
        (plain_dot(v, m) * z).simd_le(f64x4::ZERO).select(f64x4::ZERO, seen)
    }

    /// G₁(v) / |v.z|, which is finite down to grazing; `v` sees the facet from the front.
    #[inline]
    fn masking_over_cos(&self, v: DVec3) -> f64 {
        let y = v.y * self.ratio;
        let r2 = v.x * v.x + y * y;
        let z = v.z.abs();
        match self.distribution {
            // 2 / (1 + √(1 + α² tan²)) / z.
            Distribution::Ggx => 2.0 / (z + (z * z + self.alpha * self.alpha * r2).sqrt()),
            Distribution::Beckmann => {
                // a = z / width, as in `masking`.
                let width = self.alpha * r2.sqrt();
                if z >= 1.6 * width {
                    1.0 / z
                } else {
                    let a = z / width;
                    (3.535 + 2.181 * a) / (width * (1.0 + 2.276 * a + 2.577 * a * a))
                }
            }
        }
    }

    /// What light that goes from `wi` to `wo` by facets `m` needs to know of them. `wo` and `m` are on the side of the
    /// normal; both directions see the facet from its front or both from its back as they see the surface
    /// (Walter et al. 2007, eq. 23): the caller has looked.
    #[must_use]
    #[inline]
    pub fn terms(&self, wo: DVec3, wi: DVec3, m: DVec3) -> Terms {
        let density = self.density(m);
        let seen = density * self.masking_over_cos(wo);
        let pdf = match self.distribution {
            // Heitz 2018, eq. 3.
            Distribution::Ggx => seen * wo.dot(m),
            Distribution::Beckmann => density * m.z,
        };
        Terms { flow: seen * self.masking_over_cos(wi), pdf }
    }

    /// A facet normal for light leaving along `wo` (z > 0): for GGX one that `wo` sees, for
    /// Beckmann one drawn from D(m) cos θ.
    #[must_use]
    pub fn sample(&self, wo: DVec3, u: DVec2) -> DVec3 {
        match self.distribution {
            Distribution::Ggx => {
                // Dupuy and Benyoub 2023, listing 3: a spherical cap in the stretched frame.
                let v = DVec3::new(wo.x * self.alpha, wo.y * self.ratio * self.alpha, wo.z).normalize();
                let (sin, cos) = sin_cos_turn(u.x);
                let z = (1.0 - u.y).mul_add(1.0 + v.z, -v.z);
                let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
                let h = DVec3::new(r * cos, r * sin, z) + v;
                DVec3::new(h.x * self.alpha, h.y * self.alpha * self.ratio, h.z.max(0.0)).normalize()
            }
            Distribution::Beckmann => {
                // tan²θ = −α² ln(1 − u)
                let tan = (-self.alpha * self.alpha * log1p(-u.y)).sqrt();
                let (sin, cos) = sin_cos_turn(u.x);
                DVec3::new(tan * cos, tan * sin * self.ratio, 1.0).normalize()
            }
        }
    }

    /// Density of [`Microfacets::sample`] at `m`, in sr⁻¹ about the facet normal.
    #[must_use]
    pub fn pdf(&self, wo: DVec3, m: DVec3) -> f64 {
        match self.distribution {
            // Heitz 2018, eq. 3.
            Distribution::Ggx => self.density(m) * self.masking(wo, m) * wo.dot(m).abs() / wo.z.abs(),
            Distribution::Beckmann => self.density(m) * m.z,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::four::lanes;
    use crate::math::warp;

    const FAMILIES: [Distribution; 2] = [Distribution::Ggx, Distribution::Beckmann];

    /// Directions and facets all over, on either side and grazing.
    #[test]
    fn four_masked_give_the_bits_of_one() {
        let at = |i: u32| {
            let u = f64::from(i) * 0.754_877_666;
            let z = [1.0, -1.0, 1e-3, 0.4, -0.7][i as usize % 5] * (1.0 - 0.1 * u.fract());
            DVec3::new((1.0 - z * z).max(0.0).sqrt(), u.fract() - 0.5, z).normalize()
        };
        for distribution in [Distribution::Ggx, Distribution::Beckmann] {
            for facets in [Microfacets::isotropic(distribution, 0.3), Microfacets::anisotropic(distribution, 0.05, 0.9)]
            {
                for i in 0..200 {
                    let (v, m) = ([0, 1, 2, 3].map(|k| at(7 * i + k)), [0, 1, 2, 3].map(|k| at(3 * i + 2 * k)));
                    let found = facets.masking_of_four(&lanes(v), &lanes(m)).to_array();
                    assert_eq!(found, [0, 1, 2, 3].map(|k| facets.masking(v[k], m[k])));
                }
            }
        }
    }

    /// ∫ D(m) cos θ dm = 1 (Walter et al. 2007, eq. 4). With m drawn with density cos θ/π the
    /// mean of π D is one; 1024² midpoints of a function of width α = 0.3 leave 1e-3.
    #[test]
    fn facets_cover_the_mean_surface_once() {
        for distribution in FAMILIES {
            let m = Microfacets::anisotropic(distribution, 0.3, 0.2);
            let mean =
                warp::midpoints(1024).map(|u| m.density(warp::cosine_hemisphere(u)) * PI).sum::<f64>() / 1_048_576.0;
            assert!((mean - 1.0).abs() < 1e-3, "{distribution:?} {mean}");
        }
    }

    /// The mean of g(m) over sampled m is ∫ g pdf dm over the hemisphere, for g = 1 and the three coordinates of m. Here
    /// that is 2π ∫₀¹ ∫ g pdf dφ 2s ds by midpoints, z = 1 − s², which crowd where D is high: their error is below 1e-4.
    /// The 512² midpoints of the sampler are at most 1/512 of the variation of g off, 2 at the most.
    #[test]
    fn sampled_normals_have_the_stated_density() {
        let hemisphere: Vec<(DVec3, f64)> = (0..1024 * 512)
            .map(|i| {
                let s = (f64::from(i / 512) + 0.5) / 1024.0;
                let (sin, cos) = sin_cos_turn((f64::from(i % 512) + 0.5) / 512.0);
                let (z, r) = (1.0 - s * s, s * (2.0 - s * s).sqrt());
                (DVec3::new(r * cos, r * sin, z), 2.0 * PI * 2.0 * s / (1024.0 * 512.0))
            })
            .collect();
        for distribution in FAMILIES {
            for (alpha, ratio, phi, z) in [
                (0.5, 1.0, 0.0, 0.9),
                (0.1, 1.0, 0.0, 0.4),
                (1.0, 1.0, 0.0, 0.2),
                (0.1, 4.0, 1.0, 0.4),
                (0.5, 0.3, 2.0, 0.7),
            ] {
                let facets = Microfacets { distribution, alpha, ratio };
                let (sin_phi, cos_phi) = f64::sin_cos(phi);
                let r = (1.0f64 - z * z).sqrt();
                let wo = DVec3::new(r * cos_phi, r * sin_phi, z);
                let seen = |m: DVec3| distribution == Distribution::Beckmann || wo.dot(m) > 0.0;
                let stated = hemisphere.iter().filter(|(m, _)| seen(*m)).map(|(m, w)| (*m, facets.pdf(wo, *m) * w));
                let (whole, mean) = stated.fold((0.0, DVec3::ZERO), |(n, sum), (m, w)| (n + w, sum + m * w));
                assert!((whole - 1.0).abs() < 1e-4, "{distribution:?} {alpha} {z}: {whole}");
                let sampled = warp::midpoints(512).map(|u| facets.sample(wo, u)).sum::<DVec3>() / 262_144.0;
                let off = (sampled - mean).abs().max_element();
                assert!(off < 2.0 / 512.0, "{distribution:?} {alpha} {z}: {sampled} {mean}");
            }
        }
    }

    /// The terms are D, the maskings and the density that are computed one by one, up to some ten roundings; α tan θ
    /// in f64 carries none of the cancellation that f32 would.
    #[test]
    fn terms_at_once_are_the_terms_one_by_one() {
        for distribution in FAMILIES {
            for alpha in [1e-4, 0.05, 0.5, 2.0] {
                for u in warp::midpoints(16) {
                    let facets = Microfacets { distribution, alpha, ratio: 0.7 };
                    let wo = warp::cosine_hemisphere(u);
                    let m = facets.sample(wo, DVec2::new(u.y, 0.37));
                    let wi = m * (2.0 * wo.dot(m)) - wo;
                    if wo.dot(m) <= 0.0 || wi.z <= 0.0 {
                        continue;
                    }
                    let terms = facets.terms(wo, wi, m);
                    let flow = facets.density(m) * facets.masking(wo, m) * facets.masking(wi, m) / (wo.z * wi.z);
                    assert!((terms.flow / flow - 1.0).abs() < 1e-13, "{distribution:?} {alpha} {u}");
                    assert!((terms.pdf / facets.pdf(wo, m) - 1.0).abs() < 1e-13, "{distribution:?} {alpha} {u}");
                }
            }
        }
    }

    /// D at θ = α for α = 1e-4: 1 / (π α² (sin²/α² + cos²)²), with 30 digits 7957747.18…
    #[test]
    fn density_of_a_nearly_smooth_surface_keeps_its_digits() {
        let alpha = 1e-4f64;
        let m = Microfacets::isotropic(Distribution::Ggx, alpha);
        let s = alpha - alpha.powi(3) / 6.0;
        let h = DVec3::new(s, 0.0, (1.0 - s * s).sqrt());
        let x = 1.0 - alpha * alpha / 3.0;
        let expected = 1.0 / (PI * alpha * alpha * (x + 1.0 - alpha * alpha).powi(2));
        assert!(((m.density(h) - expected) / expected).abs() < 1e-7);
    }

    #[test]
    fn no_nan_down_to_grazing_and_to_the_smoothest() {
        for distribution in FAMILIES {
            for alpha in [1e-4, 1e-2, 1.0] {
                for z in [1e-7, 1e-4, 0.5, 1.0] {
                    let m = Microfacets::isotropic(distribution, alpha);
                    let wo = DVec3::new((1.0f64 - z * z).sqrt(), 0.0, z);
                    for u in warp::midpoints(32).chain([DVec2::ZERO, DVec2::new(0.0, 1.0 - 2f64.powi(-32))]) {
                        let h = m.sample(wo, u);
                        assert!(
                            h.is_finite() && m.pdf(wo, h).is_finite() && m.pdf(wo, h) >= 0.0,
                            "{alpha} {z} {u} {h}"
                        );
                    }
                }
            }
        }
    }

    /// A brushed surface is an isotropic one of slopes p/α_u, q/α_v: with m = (−p, −q, 1)/√(1 + p² + q²),
    /// Walter's isotropic D of the slopes (p/α_u, q/α_v) divided by α_u α_v is
    /// D = P(p/α_u, q/α_v) / (α_u α_v cos⁴θ), P = 1/(π (1 + s²)²) for GGX and e^(−s²)/π for Beckmann.
    #[test]
    fn brushed_surfaces_are_stretched_isotropic_ones() {
        for distribution in FAMILIES {
            let facets = Microfacets::anisotropic(distribution, 0.4, 0.1);
            let (p, q) = (0.3, -0.05);
            let m = DVec3::new(-p, -q, 1.0).normalize();
            let s2: f64 = (p / 0.4f64).powi(2) + (q / 0.1f64).powi(2);
            let of_slopes = match distribution {
                Distribution::Ggx => 1.0 / (PI * (1.0 + s2).powi(2)),
                Distribution::Beckmann => (-s2).exp() / PI,
            };
            let expected = of_slopes / (0.4 * 0.1 * m.z.powi(4));
            assert!((facets.density(m) / expected - 1.0).abs() < 1e-12, "{distribution:?}");
            // Along the normal nothing does.
            assert_eq!(facets.masking(DVec3::Z, DVec3::Z), 1.0);
            let along = lanes([DVec3::Z; 4]);
            assert_eq!(facets.masking_of_four(&along, &along).to_array(), [1.0; 4]);
            // Seen along x only the width along x masks, along y only that along y.
            for (wide, v) in [(0.4, DVec3::new(0.8, 0.0, 0.6)), (0.1, DVec3::new(0.0, 0.8, 0.6))] {
                let expected = Microfacets::isotropic(distribution, wide).masking(v, DVec3::Z);
                assert!((facets.masking(v, DVec3::Z) - expected).abs() < 1e-15);
            }
        }
    }
}
