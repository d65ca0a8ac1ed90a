//! What the solid and the thin principled surface are made of.
//!
//! Burley 2012, "Physically Based Shading at Disney" (the lobes), and Burley 2015, "Extending the
//! Disney BRDF to a BSDF with Integrated Subsurface Scattering" (transmission, flatness). Local frame,
//! z = shading normal.

use crate::math::elementary::{exp_down, log};
use crate::math::trig::sin_cos_turn;
use crate::optics::microfacet::{Distribution, Microfacets};
use crate::spectrum::Lanes;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Least width of the facets, as in Mitsuba 3.
const NARROWEST: f64 = 0.001;

/// Schlick's (1 − cos θ)⁵.
pub(super) fn schlick_weight(cos: f64) -> f64 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    (m * m) * (m * m) * m
}

/// The share by which R₀ goes over to 1 on a facet seen at the cosine `cos` from outside: Schlick's weight,
/// of the refracted angle where `eta` is below one, which gives total reflection.
pub(super) fn schlick_outside(cos: f64, eta: f64) -> f64 {
    if eta > 1.0 {
        return schlick_weight(cos);
    }
    let sin2 = (1.0 - cos * cos) / (eta * eta);
    schlick_weight((1.0 - sin2).max(0.0).sqrt())
}

/// R₀ + (1 − R₀) w, lane by lane.
pub(super) fn toward_one(r0: Lanes, weight: f64) -> Lanes {
    r0 + (Lanes::ONE - r0) * weight as f32
}

/// R₀ of an interface of index ratio `eta`.
pub(super) fn r0(eta: f64) -> f64 {
    ((eta - 1.0) / (eta + 1.0)).powi(2)
}

/// The main facets: of width roughness² along x and y, stretched by the aspect √(1 − 0.9 anisotropic)
/// (Burley 2012, 5.4).
pub(super) fn facets(roughness: f64, anisotropic: f64) -> Microfacets {
    let alpha = roughness * roughness;
    let aspect = (1.0 - 0.9 * anisotropic).sqrt();
    let (along, across) = ((alpha / aspect).max(NARROWEST), (alpha * aspect).max(NARROWEST));
    Microfacets::anisotropic(Distribution::Ggx, along, across)
}

/// The factor on base/π of the diffuse lobe: Fresnel-weighted diffusion, retro-reflection of rough
/// surfaces (Burley 2015, eqs. 4 and 5), and by `flatness` the shape of Hanrahan and Krueger's subsurface
/// scattering instead (Burley 2012, 5.3). `cos_d` is between a direction and the half vector.
pub(super) fn diffusion(roughness: f64, flatness: f64, cos_o: f64, cos_i: f64, cos_d: f64) -> f64 {
    let (fo, fi) = (schlick_weight(cos_o), schlick_weight(cos_i));
    let rr = 2.0 * roughness * cos_d * cos_d;
    let lambert = (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi);
    let retro = rr * (fo + fi + fo * fi * (rr - 1.0));
    let surface = lambert + retro;
    if flatness == 0.0 {
        return surface;
    }
    let at_grazing = 0.5 * rr - 1.0;
    let fss = (1.0 + at_grazing * fo) * (1.0 + at_grazing * fi);
    let subsurface = 1.25 * (fss * (1.0 / (cos_o + cos_i) - 0.5) + 0.5);
    surface + flatness * (subsurface - surface)
}

/// The clear coat's facets: Burley 2012, eq. 4 with γ = 1, isotropic.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoatFacets {
    /// Width, below one.
    pub alpha: f64,
}

impl CoatFacets {
    /// A gloss of 0 to 1 is a width of 0.1 to 0.001 (Burley 2012, appendix).
    pub fn of_gloss(gloss: f64) -> CoatFacets {
        CoatFacets { alpha: 0.1 + gloss * (NARROWEST - 0.1) }
    }

    /// D(m) in sr⁻¹.
    pub fn density(&self, m: DVec3) -> f64 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        // 1 + (α² − 1) cos² without cancelling near the normal.
        let d = m.x * m.x + m.y * m.y + a2 * m.z * m.z;
        (a2 - 1.0) / (PI * log(a2) * d)
    }

    #[cfg(test)]
    /// Density of [`CoatFacets::sample`] at `m`, in sr⁻¹ about the facet normal.
    pub fn pdf(&self, m: DVec3) -> f64 {
        self.density(m) * m.z
    }

    /// A facet normal with density D(m) cos θ (Burley 2012, appendix B).
    pub fn sample(&self, u: DVec2) -> DVec3 {
        let (sin, cos) = sin_cos_turn(u.x);
        let a2 = self.alpha * self.alpha;
        let z2 = (1.0 - exp_down(log(a2) * (1.0 - u.y))) / (1.0 - a2);
        let r = (1.0 - z2).max(0.0).sqrt();
        DVec3::new(r * cos, r * sin, z2.max(0.0).sqrt())
    }

    /// Smith's G₁(o) G₁(i) of a width of 0.25 whatever the gloss (Burley 2012, appendix), for directions that both see
    /// the facet and the surface from the front.
    pub fn masking(wo: DVec3, wi: DVec3) -> f64 {
        // 2 / (1 + √(1 + α² tan²)) = 2 z / (z + √(z² + α² (x² + y²))).
        let width = |v: DVec3| v.z + (v.z * v.z + 0.0625 * (v.x * v.x + v.y * v.y)).sqrt();
        4.0 * wo.z * wi.z / (width(wo) * width(wi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::warp;

    /// ∫ D(m) cos θ dm = 1 for any distribution of facets over a plane. With m drawn with density
    /// cos θ/π the mean of π D is one; 1024² midpoints leave 1e-3 at these widths.
    #[test]
    fn facets_cover_the_mean_surface_once() {
        let coat = CoatFacets { alpha: 0.1 };
        let n = 1024.0 * 1024.0;
        let mean = warp::midpoints(1024).map(|u| coat.density(warp::cosine_hemisphere(u)) * PI).sum::<f64>() / n;
        assert!((mean - 1.0).abs() < 1e-3, "{mean}");
    }

    /// The mean of cos θ over sampled normals is ∫ cos θ pdf, here by points uniform over the half sphere.
    #[test]
    fn sampled_normals_have_the_stated_density() {
        let uniform = |u: DVec2| {
            let v = warp::uniform_sphere(u);
            DVec3::new(v.x, v.y, v.z.abs())
        };
        let coat = CoatFacets { alpha: 0.1 };
        let sampled = warp::midpoints(512).map(|u| coat.sample(u).z).sum::<f64>() / 262_144.0;
        let integral =
            warp::midpoints(2048).map(uniform).map(|m| coat.pdf(m) * m.z).sum::<f64>() * 2.0 * PI / (2048.0 * 2048.0);
        assert!((sampled / integral - 1.0).abs() < 1e-3, "{sampled} {integral}");
    }

    /// GGX facets of width 0.25 mask each direction by itself; a few roundings.
    #[test]
    fn masking_of_the_coat_is_that_of_its_facets() {
        let facets = Microfacets::isotropic(Distribution::Ggx, 0.25);
        for u in warp::midpoints(16) {
            let (wo, wi) = (warp::cosine_hemisphere(u), warp::cosine_hemisphere(DVec2::new(u.y, 0.3)));
            let expected = facets.masking(wo, wo) * facets.masking(wi, wi);
            assert!((CoatFacets::masking(wo, wi) / expected - 1.0).abs() < 1e-14);
        }
    }

    /// A smooth or rough Lambertian look along the normal: no Fresnel term, factor 1; the subsurface shape
    /// there is 1.25 (Fss (1/2 − 1/2) + 1/2) = 0.625.
    #[test]
    fn diffusion_along_the_normal_is_lamberts_or_flat() {
        for roughness in [0.0, 0.5, 1.0] {
            assert_eq!(diffusion(roughness, 0.0, 1.0, 1.0, 1.0), 1.0);
            assert!((diffusion(roughness, 1.0, 1.0, 1.0, 1.0) - 0.625).abs() < 1e-15);
        }
    }
}
