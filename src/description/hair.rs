//! Fibres of hair as they are written.

use serde::Deserialize;

use super::fault::Checker;
use super::material::given_fields;
use super::path::At;
use super::spectrum::{Role, Spectrum};

/// `hair: {eumelanin: 1.3, pheomelanin: 0.2}` or `hair: {absorption: SPECTRUM}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenHair")]
pub struct Hair {
    /// What colours it.
    pub colour: HairColour,
    /// Index inside; default 1.55.
    pub ior: f64,
    /// Index outside; default 1.
    pub exterior_ior: f64,
    /// Roughness along the fibre, 0.01 to 1; default 0.3.
    pub roughness_along: f64,
    /// Roughness around the fibre, 0.01 to 1; default 0.3.
    pub roughness_around: f64,
    /// Angle of the scales, degrees; default 2.
    pub tilt_deg: f64,
}

/// What colours hair.
#[derive(Clone, Debug, PartialEq)]
pub enum HairColour {
    /// Concentrations of pigments: brown to black, and yellow to red.
    Pigments {
        /// Default 1.3.
        eumelanin: f64,
        /// Default 0.2.
        pheomelanin: f64,
    },
    /// Absorption times the radius of the fibre.
    Absorption(Spectrum),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenHair {
    eumelanin: Option<f64>,
    pheomelanin: Option<f64>,
    absorption: Option<Spectrum>,
    #[serde(default = "amber")]
    ior: f64,
    #[serde(default = "one")]
    exterior_ior: f64,
    #[serde(default = "rough")]
    roughness_along: f64,
    #[serde(default = "rough")]
    roughness_around: f64,
    #[serde(default = "tilt")]
    tilt_deg: f64,
}

fn amber() -> f64 {
    1.55
}

fn one() -> f64 {
    1.0
}

fn rough() -> f64 {
    0.3
}

fn tilt() -> f64 {
    2.0
}

impl TryFrom<WrittenHair> for Hair {
    type Error = String;

    fn try_from(w: WrittenHair) -> Result<Hair, String> {
        let colour = match (w.absorption, w.eumelanin, w.pheomelanin) {
            (Some(absorption), None, None) => HairColour::Absorption(absorption),
            (None, eumelanin, pheomelanin) => {
                HairColour::Pigments { eumelanin: eumelanin.unwrap_or(1.3), pheomelanin: pheomelanin.unwrap_or(0.2) }
            }
            (Some(_), eumelanin, pheomelanin) => {
                let given =
                    [("absorption", true), ("eumelanin", eumelanin.is_some()), ("pheomelanin", pheomelanin.is_some())];
                return Err(format!("expected either absorption or pigments, found {}", given_fields(&given)));
            }
        };
        Ok(Hair {
            colour,
            ior: w.ior,
            exterior_ior: w.exterior_ior,
            roughness_along: w.roughness_along,
            roughness_around: w.roughness_around,
            tilt_deg: w.tilt_deg,
        })
    }
}

impl Hair {
    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        match &self.colour {
            HairColour::Absorption(absorption) => absorption.check(Role::Coefficient, at.key("absorption"), checker),
            HairColour::Pigments { eumelanin, pheomelanin } => {
                checker.not_negative(at.key("eumelanin"), *eumelanin);
                checker.not_negative(at.key("pheomelanin"), *pheomelanin);
            }
        }
        let before = checker.count();
        checker.index(at.key("exterior_ior"), self.exterior_ior);
        checker.index(at.key("ior"), self.ior);
        // A ray that grazes the fibre needs a denser inside to have a way through.
        if checker.count() == before {
            checker.require(self.ior > self.exterior_ior, at.key("ior"), "an index above that outside", self.ior);
        }
        for (key, roughness) in [("roughness_along", self.roughness_along), ("roughness_around", self.roughness_around)]
        {
            let holds = (LEAST_ROUGHNESS..=1.0).contains(&roughness);
            checker.require(holds, at.key(key), "a number from 0.01 to 1", roughness);
        }
        let holds = (-10.0..=10.0).contains(&self.tilt_deg);
        checker.require(holds, at.key("tilt_deg"), "an angle from -10 to 10", self.tilt_deg);
    }
}

/// Below it lobes are narrower than a thousandth of a radian.
const LEAST_ROUGHNESS: f64 = 0.01;

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::super::{HairColour, Material};

    #[test]
    fn colour_is_pigments_or_an_absorption() {
        let text = "materials:\n  m: {hair: {eumelanin: 0.5}}\n  n: {hair: {absorption: 0.2, ior: 1.4}}\n";
        let scene = scene(text);
        let Material::Hair(hair) = &scene.materials["m"] else { panic!("hair") };
        assert_eq!(hair.colour, HairColour::Pigments { eumelanin: 0.5, pheomelanin: 0.2 });
        let Material::Hair(hair) = &scene.materials["n"] else { panic!("hair") };
        assert!(matches!(hair.colour, HairColour::Absorption(_)) && hair.ior == 1.4);
        for (fields, message) in [
            (
                "absorption: 1, eumelanin: 1",
                "3:13: materials.m.hair: expected either absorption or pigments, found absorption and eumelanin",
            ),
            ("ior: 0.9", "3:19: materials.m.hair.ior: expected an index above that outside, found 0.9"),
            (
                "ior: -1",
                "3:19: materials.m.hair.ior: expected an index of refraction, a number from 0.1 to 10, found -1",
            ),
            ("roughness_along: 0", "3:31: materials.m.hair.roughness_along: expected a number from 0.01 to 1, found 0"),
        ] {
            assert_eq!(faults(&format!("materials:\n  m: {{hair: {{{fields}}}}}")), format!("dir/s.yaml:{message}"));
        }
    }
}
