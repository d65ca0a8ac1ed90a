//! Media as they are written.

use serde::Deserialize;

use super::fault::Checker;
use super::material::given_fields;
use super::path::At;
use super::spectrum::{Role, Spectrum, one, yes};
use super::volume::{NumberOrVolume, SpectrumOrVolume};

/// Empty space, where the name of a medium is wanted.
pub(crate) const VACUUM: &str = "vacuum";

/// The medium that a ray is in already, where the name of one is wanted.
pub(crate) const UNCHANGED: &str = "unchanged";

/// What fills a space.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Medium {
    /// The same extinction everywhere.
    Homogeneous(HomogeneousMedium),
    /// By volumes.
    Heterogeneous(HeterogeneousMedium),
}

/// `homogeneous: {absorption: 0.1, scattering: 0.5, phase: {hg: 0.5}}` or
/// `homogeneous: {extinction: 0.6, albedo: 0.8, scale: 1}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenHomogeneous")]
pub struct HomogeneousMedium {
    /// How much is absorbed and scattered.
    pub coefficients: Coefficients,
    /// Directions of scattered light; default `isotropic`.
    pub phase: Phase,
    /// Whether points inside look for lamps with shadow rays; default true.
    pub shadow_rays: bool,
}

/// Two ways to say how much a medium absorbs and scatters.
#[derive(Clone, Debug, PartialEq)]
pub enum Coefficients {
    /// The two coefficients.
    Parts {
        /// σₐ, m⁻¹; default 0.
        absorption: Spectrum,
        /// σₛ, m⁻¹; default 0.
        scattering: Spectrum,
    },
    /// Their sum, and the share of the second.
    Sum {
        /// σₜ over `scale`, m⁻¹.
        extinction: Spectrum,
        /// σₛ / σₜ, 0 to 1.
        albedo: SpectrumOrVolume,
        /// Factor on the extinction; default 1.
        scale: f64,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenHomogeneous {
    absorption: Option<Spectrum>,
    scattering: Option<Spectrum>,
    extinction: Option<Spectrum>,
    albedo: Option<SpectrumOrVolume>,
    scale: Option<f64>,
    #[serde(default)]
    phase: Phase,
    #[serde(default = "yes")]
    shadow_rays: bool,
}

impl TryFrom<WrittenHomogeneous> for HomogeneousMedium {
    type Error = String;

    fn try_from(written: WrittenHomogeneous) -> Result<HomogeneousMedium, String> {
        let WrittenHomogeneous { absorption, scattering, extinction, albedo, scale, phase, shadow_rays } = written;
        let coefficients = match (absorption, scattering, extinction, albedo, scale) {
            (absorption, scattering, None, None, None) => Coefficients::Parts {
                absorption: absorption.unwrap_or(Spectrum::Number(0.0)),
                scattering: scattering.unwrap_or(Spectrum::Number(0.0)),
            },
            (None, None, Some(extinction), Some(albedo), scale) => {
                Coefficients::Sum { extinction, albedo, scale: scale.unwrap_or(1.0) }
            }
            (absorption, scattering, extinction, albedo, scale) => {
                let given = [
                    ("absorption", absorption.is_some()),
                    ("scattering", scattering.is_some()),
                    ("extinction", extinction.is_some()),
                    ("albedo", albedo.is_some()),
                    ("scale", scale.is_some()),
                ];
                let expected = "expected either absorption and scattering, or extinction and albedo";
                return Err(format!("{expected}, found {}", given_fields(&given)));
            }
        };
        Ok(HomogeneousMedium { coefficients, phase, shadow_rays })
    }
}

/// `heterogeneous: {extinction: {volume: smoke}, albedo: 0.9, scale: 5}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeterogeneousMedium {
    /// σₜ over `scale`, m⁻¹: a volume. Outside of the box along the world's axes around its cube there is nothing.
    pub extinction: SpectrumOrVolume,
    /// σₛ / σₜ, 0 to 1.
    pub albedo: SpectrumOrVolume,
    /// Factor on the extinction; default 1. Their product makes at most 1e7 mean free paths across the volume.
    #[serde(default = "one")]
    pub scale: f64,
    /// Directions of scattered light; default `isotropic`.
    #[serde(default)]
    pub phase: Phase,
    /// Whether points inside look for lamps with shadow rays; default true.
    #[serde(default = "yes")]
    pub shadow_rays: bool,
}

/// A phase function.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Phase {
    /// All directions alike.
    #[default]
    Isotropic,
    /// Rayleigh's, ∝ 1 + cos²θ.
    Rayleigh,
    /// Henyey and Greenstein's, with mean cosine g between −1 and 1.
    Hg(f64),
    /// Values at even steps of cos θ from −1, backward, to 1, forward; linear between. Of any common factor.
    Table(Vec<f64>),
    /// A share of one and the rest of another.
    Blend(Box<PhaseBlend>),
}

/// `blend: {weight: 0.3, of: [isotropic, {hg: 0.8}]}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhaseBlend {
    /// Share of the second, 0 to 1.
    pub weight: NumberOrVolume,
    /// What is blended.
    pub of: [Phase; 2],
}

impl Medium {
    /// The key under which the medium is written.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Medium::Homogeneous(_) => "homogeneous",
            Medium::Heterogeneous(_) => "heterogeneous",
        }
    }

    pub(crate) fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        let at = at.key(self.kind());
        match self {
            Medium::Homogeneous(medium) => {
                match &medium.coefficients {
                    Coefficients::Parts { absorption, scattering } => {
                        absorption.check(Role::Coefficient, at.key("absorption"), checker);
                        scattering.check(Role::Coefficient, at.key("scattering"), checker);
                    }
                    Coefficients::Sum { extinction, albedo, scale } => {
                        extinction.check(Role::Coefficient, at.key("extinction"), checker);
                        albedo.check(Role::Reflectance, at.key("albedo"), checker);
                        checker.not_negative(at.key("scale"), *scale);
                    }
                }
                medium.phase.check(at.key("phase"), checker);
            }
            Medium::Heterogeneous(medium) => {
                if let SpectrumOrVolume::Spectrum(_) = &medium.extinction {
                    let expected = "{volume: name}; a medium of one extinction is homogeneous";
                    checker.require(false, at.key("extinction"), expected, "a spectrum");
                } else {
                    medium.extinction.check(Role::Coefficient, at.key("extinction"), checker);
                }
                medium.albedo.check(Role::Reflectance, at.key("albedo"), checker);
                checker.not_negative(at.key("scale"), medium.scale);
                medium.phase.check(at.key("phase"), checker);
            }
        }
    }
}

impl Phase {
    fn check<'a>(&'a self, at: At<'_>, checker: &mut Checker<'a>) {
        match self {
            Phase::Isotropic | Phase::Rayleigh => {}
            Phase::Hg(g) => checker.require(g.abs() < 1.0, at.key("hg"), "a number between -1 and 1", *g),
            Phase::Table(values) => {
                let at = at.key("table");
                checker.require(values.len() >= 2, at, "2 or more values", values.len());
                for (i, &value) in values.iter().enumerate() {
                    checker.not_negative(at.index(i), value);
                }
                if values.iter().all(|v| *v == 0.0) {
                    checker.require(values.is_empty(), at, "a value above 0", "none");
                }
            }
            Phase::Blend(blend) => {
                let at = at.key("blend");
                match &blend.weight {
                    NumberOrVolume::Number(weight) => {
                        let within = (0.0..=1.0).contains(weight);
                        checker.require(within, at.key("weight"), "a number from 0 to 1", *weight);
                    }
                    NumberOrVolume::Volume(name) => checker.volume(at.key("weight").key("volume"), name),
                }
                for (i, phase) in blend.of.iter().enumerate() {
                    phase.check(at.key("of").index(i), checker);
                }
            }
        }
    }
}

/// Checks the names of media on the two sides of a shape.
pub(crate) fn check_sides(sides: [(&str, &Option<String>); 2], at: At<'_>, checker: &mut Checker<'_>) {
    for (i, (key, side)) in sides.iter().enumerate() {
        match side.as_deref() {
            None | Some(VACUUM) => {}
            Some(UNCHANGED) => {
                let (other, found) = (sides[1 - i].0, sides[1 - i].1.as_deref());
                if found != Some(UNCHANGED) {
                    checker.fault(at.key(key), format!("expected {other}: {UNCHANGED} with it, found another"));
                }
            }
            Some(medium) => checker.medium(at.key(key), medium),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    #[test]
    fn a_medium_takes_and_does_not_give() {
        let medium = |fields: &str| faults(&format!("media:\n  m: {{homogeneous: {{{fields}}}}}"));
        assert_eq!(
            medium("absorption: -1, scattering: {rgb: [0, 0, -1]}"),
            "dir/s.yaml:3:33: media.m.homogeneous.absorption: expected a number of 0 or more, found -1\n\
             dir/s.yaml:3:62: media.m.homogeneous.scattering.rgb[2]: expected a number of 0 or more, found -1"
        );
        for g in ["1", "-1", "1.5"] {
            assert_eq!(
                medium(&format!("phase: {{hg: {g}}}")),
                format!("dir/s.yaml:3:33: media.m.homogeneous.phase.hg: expected a number between -1 and 1, found {g}")
            );
        }
        assert_eq!(
            medium("extinction: 1, albedo: 2"),
            "dir/s.yaml:3:44: media.m.homogeneous.albedo: expected a number from 0 to 1, found 2"
        );
        let scene = scene("media: {m: {homogeneous: {phase: rayleigh}}}");
        let Medium::Homogeneous(bare) = &scene.media["m"] else { panic!("homogeneous") };
        let nothing = Spectrum::Number(0.0);
        assert_eq!(bare.coefficients, Coefficients::Parts { absorption: nothing.clone(), scattering: nothing });
        assert_eq!((&bare.phase, bare.shadow_rays), (&Phase::Rayleigh, true));
    }

    #[test]
    fn a_medium_is_written_in_one_way() {
        let medium = |fields: &str| faults(&format!("media:\n  m: {{homogeneous: {{{fields}}}}}"));
        let expected = "dir/s.yaml:3:20: media.m.homogeneous: expected either absorption and scattering, or extinction \
                        and albedo, found ";
        assert_eq!(medium("absorption: 1, albedo: 1"), format!("{expected}absorption and albedo"));
        assert_eq!(medium("extinction: 1"), format!("{expected}extinction"));
        assert_eq!(medium("extinction: 1, albedo: 0.5, scale: 3"), "none");
        assert_eq!(
            faults("media:\n  m: {heterogeneous: {extinction: 1, albedo: 1}}"),
            "dir/s.yaml:3:35: media.m.heterogeneous.extinction: expected {volume: name}; a medium of one extinction is \
             homogeneous, found a spectrum"
        );
    }

    #[test]
    fn phase_functions_are_checked_in_their_nests() {
        let phase = |written: &str| faults(&format!("media:\n  m: {{homogeneous: {{phase: {written}}}}}"));
        assert_eq!(phase("{table: [1, 2]}"), "none");
        let place = "media.m.homogeneous.phase";
        assert_eq!(
            phase("{table: [1]}"),
            format!("dir/s.yaml:3:36: {place}.table: expected 2 or more values, found 1")
        );
        assert_eq!(
            phase("{table: [0, 0]}"),
            format!("dir/s.yaml:3:36: {place}.table: expected a value above 0, found none")
        );
        assert_eq!(
            phase("{blend: {weight: 0.2, of: [isotropic, {blend: {weight: 1, of: [rayleigh, {hg: 0.1}]}}]}}"),
            "none"
        );
        assert_eq!(
            phase("{blend: {weight: 1.5, of: [isotropic, {hg: 1}]}}"),
            format!(
                "dir/s.yaml:3:45: {place}.blend.weight: expected a number from 0 to 1, found 1.5\n\
                 dir/s.yaml:3:71: {place}.blend.of[1].hg: expected a number between -1 and 1, found 1"
            )
        );
    }

    #[test]
    fn media_go_by_name() {
        assert_eq!(
            faults(
                "media: {smoke: {homogeneous: {}}}\nmedium: smok\nshapes:\n- sphere: {radius: 1, inside: smoke, outside: x}"
            ),
            "dir/s.yaml:3:9: medium: unknown medium \"smok\"; did you mean \"smoke\"?\n\
             dir/s.yaml:5:47: shapes[0].sphere.outside: unknown medium \"x\"; known: smoke"
        );
    }

    #[test]
    fn empty_space_and_the_same_as_before_have_names() {
        let sides = |sides: &str| {
            faults(&format!("media: {{a: {{homogeneous: {{}}}}}}\nshapes:\n- sphere: {{radius: 1, {sides}}}"))
        };
        assert_eq!(sides("inside: a, outside: vacuum"), "none");
        assert_eq!(sides("inside: unchanged, outside: unchanged"), "none");
        assert_eq!(
            sides("inside: a, outside: unchanged"),
            "dir/s.yaml:4:43: shapes[0].sphere.outside: expected inside: unchanged with it, found another"
        );
        assert_eq!(
            faults("media: {vacuum: {homogeneous: {}}}"),
            "dir/s.yaml:2:17: media.vacuum: expected another name: this one means empty space"
        );
    }
}
