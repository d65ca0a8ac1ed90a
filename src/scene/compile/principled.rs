//! Principled surfaces, from what a person wrote.

use super::Compiler;
use crate::description as written;
use crate::optics::principled::{Rates, ThinRates, index_of_eta, index_of_specular};
use crate::scene::principled::{Luminance, Solid, Thin};
use crate::scene::texture::{Scalar, Texture};
use crate::spectrum::index::INDICES;
use std::ops::RangeInclusive;

const SHARES: RangeInclusive<f64> = 0.0..=1.0;
const STRENGTHS: RangeInclusive<f64> = 0.0..=written::MOST_STRENGTH;

impl<'a> Compiler<'a> {
    pub(super) fn principled(&mut self, place: &str, m: &'a written::Principled) -> Solid {
        let base = self.reflectance_texture(&format!("{place}.base_color"), &m.base_color);
        let mut number = |key: &str, s: &'a written::NumberOrTexture, bounds: RangeInclusive<f64>| {
            self.number_within(&format!("{place}.{key}"), s, &bounds)
        };
        let transmission = m.spec_trans.as_ref().map(|s| number("spec_trans", s, SHARES));
        let specular_tint = number("spec_tint", &m.spec_tint, SHARES);
        let sheen_tint = number("sheen_tint", &m.sheen_tint, SHARES);
        Solid {
            luminance: luminance(m.luminance, &base, [&specular_tint, &sheen_tint]),
            base,
            eta: match m.contrast {
                written::Contrast::Eta(eta) => index_of_eta(eta, transmission.is_some()),
                written::Contrast::Specular(specular) => index_of_specular(specular, transmission.is_some()),
            },
            roughness: number("roughness", &m.roughness, SHARES),
            anisotropic: number("anisotropic", &m.anisotropic, SHARES),
            metallic: number("metallic", &m.metallic, SHARES),
            transmission,
            specular_tint,
            sheen: number("sheen", &m.sheen, STRENGTHS),
            sheen_tint,
            flatness: number("flatness", &m.flatness, SHARES),
            clearcoat: number("clearcoat", &m.clearcoat, STRENGTHS),
            clearcoat_gloss: number("clearcoat_gloss", &m.clearcoat_gloss, SHARES),
            rates: Rates {
                specular: m.sampling.specular as f32,
                clearcoat: m.sampling.clearcoat as f32,
                diffuse: m.sampling.diffuse as f32,
            },
        }
    }

    pub(super) fn principled_thin(&mut self, place: &str, m: &'a written::PrincipledThin) -> Thin {
        let base = self.reflectance_texture(&format!("{place}.base_color"), &m.base_color);
        let mut number = |key: &str, s: &'a written::NumberOrTexture, bounds: RangeInclusive<f64>| {
            self.number_within(&format!("{place}.{key}"), s, &bounds)
        };
        let specular_tint = number("spec_tint", &m.spec_tint, SHARES);
        let sheen_tint = number("sheen_tint", &m.sheen_tint, SHARES);
        Thin {
            luminance: luminance(m.luminance, &base, [&specular_tint, &sheen_tint]),
            base,
            eta: number("eta", &m.eta, INDICES),
            roughness: number("roughness", &m.roughness, SHARES),
            anisotropic: number("anisotropic", &m.anisotropic, SHARES),
            transmission: number("spec_trans", &m.spec_trans, SHARES),
            diffuse_transmission: number("diff_trans", &m.diff_trans, 0.0..=written::MOST_CROSSING),
            specular_tint,
            sheen: number("sheen", &m.sheen, STRENGTHS),
            sheen_tint,
            flatness: number("flatness", &m.flatness, SHARES),
            rates: ThinRates {
                reflection: m.sampling.reflection as f32,
                transmission: m.sampling.transmission as f32,
                diffuse_reflection: m.sampling.diffuse_reflection as f32,
                diffuse_transmission: m.sampling.diffuse_transmission as f32,
            },
        }
    }

    /// The number `s` of the field `at`, or a texture of numbers that are within `bounds`, as the number is.
    fn number_within(&mut self, at: &str, s: &'a written::NumberOrTexture, bounds: &RangeInclusive<f64>) -> Scalar {
        let scalar = self.scalar(s);
        if matches!(s, written::NumberOrTexture::Texture(_))
            && let Some(found) = scalar.outside(bounds)
        {
            let (least, most) = (bounds.start(), bounds.end());
            let message = format!("expected a texture of numbers from {least} to {most}, found {found}");
            self.fault(&format!("{at}.texture"), message);
        }
        scalar
    }
}

/// The luminance that tints need, if there are any.
fn luminance(written: written::Luminance, base: &Texture, tints: [&Scalar; 2]) -> Luminance {
    if tints.iter().all(|tint| matches!(tint, Scalar::Uniform(0.0))) {
        return Luminance::Unused;
    }
    match written {
        written::Luminance::Colour => Luminance::of(base),
        written::Luminance::Mitsuba => Luminance::Packet,
    }
}

#[cfg(test)]
mod tests {
    use crate::description::SceneDescription;
    use crate::scene::compile::compile;
    use crate::scene::grid::testing::vol;

    /// What a number may not be, the numbers of a texture may not be either. They were clamped in silence: a metallic of two showed
    /// a picture that is 24 % brighter than Mitsuba's, which clamps nothing.
    #[test]
    fn textures_are_within_the_bounds_of_numbers() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("dots.pgm"), b"P5 2 2 255\n\xff\xff\x00\xff").unwrap();
        std::fs::write(directory.path().join("haze.vol"), vol([2, 1, 1], 1, &[0.5, 11.0])).unwrap();
        let told = |kind: &str, field: &str, texture: &str| {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                 volumes: {{haze: {{grid: {{file: haze.vol}}}}}}\n\
                 textures:\n  dots: {{image: {{file: dots.pgm}}}}\n  two: {{checkerboard: {{a: 0.5, b: 2}}}}\n  \
                 hazy: {{volume: haze}}\n\
                 materials: {{m: {{{kind}: {{{field}: {{texture: {texture}}}}}}}}}\n\
                 shapes: [sphere: {{radius: 1, material: m}}]\n"
            );
            let description = SceneDescription::parse(&text, &directory.path().join("s.yaml")).unwrap();
            compile(&description, "s").map_or_else(|error| error.to_string(), |_| "none".to_owned())
        };
        let shares = ["roughness", "anisotropic", "spec_trans", "spec_tint", "sheen_tint", "flatness"];
        let shares = shares.into_iter().flat_map(|field| [("principled", field), ("principled_thin", field)]);
        for (kind, field) in shares.chain([("principled", "metallic"), ("principled", "clearcoat_gloss")]) {
            let found = told(kind, field, "two");
            let expected =
                format!("materials.m.{kind}.{field}.texture: expected a texture of numbers from 0 to 1, found 2");
            assert!(found.ends_with(&expected), "{found}");
            assert_eq!(told(kind, field, "dots"), "none", "{kind} {field}");
        }
        for (kind, field, most) in [
            ("principled", "sheen", "10"),
            ("principled", "clearcoat", "10"),
            ("principled_thin", "sheen", "10"),
            ("principled_thin", "diff_trans", "2"),
        ] {
            let found = told(kind, field, "hazy");
            assert!(found.ends_with(&format!("expected a texture of numbers from 0 to {most}, found 11")), "{found}");
            assert_eq!(told(kind, field, "two"), "none", "{kind} {field}");
        }
        let found = told("principled_thin", "eta", "dots");
        assert!(
            found.ends_with("eta.texture: expected a texture of numbers from 0.1 to 10, found 0 at (0, 1)"),
            "{found}"
        );
        assert_eq!(told("principled_thin", "eta", "two"), "none");
    }
}
