//! Which knobs a sheet moves, and to what.

use super::super::{Prepared, adaptive, motion, splatting};
use super::Settings;
use crate::description::{LayerContent, did_you_mean};
use crate::error::{Error, Result};
use crate::film::accumulate::REPLICATES;
use crate::spectrum::Carried;
use crate::transport::path::reuse;
use crate::transport::pilot::Use;
use crate::transport::plan::Integrator;
use crate::transport::trial::first;

/// A value of a knob.
#[derive(Clone, Debug)]
pub struct Trial {
    /// What is moved.
    pub knob: &'static str,
    /// To what.
    pub value: String,
    /// Settings of the scene that do it.
    pub set: Vec<(String, String)>,
    /// What no setting does.
    pub way: Way,
}

impl Trial {
    /// What it takes, about, over what the chosen setting takes.
    #[must_use]
    pub fn work(&self) -> f64 {
        match (self.knob, self.value.as_str(), self.way) {
            ("samples", "x 1/4", _) => 0.25,
            ("samples", "x 1/2", _) => 0.5,
            ("samples", "x 2", _) | (.., Way::Wavelengths(16)) => 2.0,
            ("samples", "x 4", _) => 4.0,
            _ => 1.0,
        }
    }
}

/// How a scene is rendered beyond what its settings say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Not at all.
    AsSet,
    /// With samples that have nothing in common.
    Independent,
    /// By another build.
    Beside,
    /// With red, green and blue in place of spectra.
    Colours,
    /// With so many wavelengths a path: 1, 2, 4 or 8; or 16, by two renders.
    Wavelengths(usize),
}

impl Way {
    /// What light is carried as.
    #[must_use]
    pub fn carried(self) -> Carried {
        match self {
            Way::Colours => Carried::Colours,
            Way::AsSet | Way::Independent | Way::Beside | Way::Wavelengths(_) => Carried::Spectra,
        }
    }
}

/// What a reader has to know of a knob to take its figures for what they are.
#[must_use]
pub fn note(knob: &str) -> Option<&'static str> {
    match knob {
        "wavelengths per path" => Some(
            "lanes are eight wide: one wavelength and four take the time of eight, sixteen are two renders of eight, half a \
             step apart, on the same paths",
        ),
        "transport" => Some(
            "as a renderer of three numbers has it: reflectances have their colour under D65, metals theirs at normal \
             incidence, lights theirs within Rec. 709, glass bends all alike; thin films and pictures of measured spectra are \
             taken at 611, 549 and 464 nm; lanes stay eight wide, so that the time is not such a renderer's",
        ),
        _ => None,
    }
}

/// Those of [`trials`] that are asked for, and the chosen setting by another build.
///
/// # Errors
/// [`Error::Config`] for a knob that the scene does not have.
pub fn wanted(chosen: &Prepared, settings: &Settings<'_>) -> Result<Vec<Trial>> {
    let mut all = trials(chosen);
    let mut names: Vec<&str> = all[1..].iter().map(|t| t.knob).collect();
    names.dedup();
    names.push(FILE);
    if let Some(unknown) = settings.knobs.iter().find(|name| !names.contains(&name.as_str())) {
        let hint = did_you_mean(unknown, names.iter().copied());
        return Err(Error::Config(format!("--knob: expected one of {}, found \"{unknown}\"{hint}", names.join(", "))));
    }
    all.retain(|t| t.knob == CHOSEN || settings.moves(t.knob));
    if let Some(build) = settings.beside {
        let value = build.binary.display().to_string();
        all.push(Trial { knob: "build", value, set: Vec::new(), way: Way::Beside });
    }
    Ok(all)
}

/// The name of no knob: nothing is moved.
pub const CHOSEN: &str = "chosen";

/// The knob that takes no render: how precisely the picture is written.
pub const FILE: &str = "file";

/// The precision of a file that half cannot hold.
pub const FULL: &str = "float";

/// The chosen setting, then each knob at other values.
#[must_use]
pub fn trials(chosen: &Prepared) -> Vec<Trial> {
    let Integrator::Path(path) = &chosen.plan.integrator else { return Vec::new() };
    let samples = chosen.samples;
    let trial = |knob, value: &str, set: &[(&str, &str)]| Trial {
        knob,
        value: value.to_owned(),
        set: set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect(),
        way: Way::AsSet,
    };
    let mut all = vec![trial(CHOSEN, "as written", &[])];
    for (name, samples) in [("1/4", samples / 4), ("1/2", samples / 2), ("2", samples * 2), ("4", samples * 4)] {
        if samples >= REPLICATES as u32 {
            all.push(trial("samples", &format!("x {name}"), &[("render.samples", &samples.to_string())]));
        }
    }
    for value in [Some(2), Some(4), Some(8), Some(16), None] {
        if value != path.max_depth {
            let text = value.map_or("no bound".to_owned(), |d| d.to_string());
            let written = value.map_or("null".to_owned(), |d: u32| d.to_string());
            all.push(trial("depth", &text, &[("integrator.path.max_depth", &written)]));
        }
    }
    all.push(Trial { way: Way::Independent, ..trial("sampler", "independent", &[]) });
    for value in [1, 5, 1000] {
        if value != path.roulette_depth {
            all.push(trial(
                "roulette",
                &format!("from {value}"),
                &[("integrator.path.roulette_depth", &value.to_string())],
            ));
        }
    }
    for count in [1, 4, 16] {
        all.push(Trial { way: Way::Wavelengths(count), ..trial("wavelengths per path", &count.to_string(), &[]) });
    }
    // Of bands three numbers know nothing.
    if chosen.scene.bands.is_empty() {
        all.push(Trial { way: Way::Colours, ..trial("transport", "RGB", &[]) });
    }
    for value in ["visible", "uniform"] {
        all.push(trial("wavelengths", value, &[("render.wavelengths", value)]));
    }
    // What is on is turned off; what was left off, although there is cause for it, is turned on.
    let caustics = chosen.plan.caustics.as_deref();
    let about = |words: &str| chosen.plan.techniques.iter().any(|t| t.name.contains(words));
    let shared = adaptive::choose(Use::On, false, &chosen.plan, samples).0.is_some();
    let census = motion::census(&chosen.scene, &chosen.moments);
    let joined = reuse::obstacle(&chosen.scene, &census, &chosen.plan, chosen.moments.len()).is_none();
    let dealt = chosen.sampler().is_ok_and(|filter| splatting::choose(Use::On, &chosen.plan, &filter).0);
    // Layers of light are measured from the camera alone: beside them it is refused.
    let measured = chosen.description.layers.iter().any(|layer| matches!(layer.content, LayerContent::Light { .. }));
    for (knob, key, on, cause) in [
        ("light tracing", "light_tracing", caustics.is_some(), about("light tracing") && !measured),
        ("packets", "packets", chosen.plan.packets || caustics.is_some(), about("packets")),
        ("merging", "merging", caustics.is_some_and(|c| c.merging.is_some()), about("merging")),
        ("path reuse", "reuse", chosen.plan.reuse, joined),
        ("splatting", "splatting", chosen.plan.splatting, dealt),
        ("even sky", "even_sky", chosen.plan.asks_even_sky, about("shadow rays to the even sky")),
        (
            "equiangular",
            "equiangular",
            chosen.plan.near_lamps > 0,
            about("equiangular") && !chosen.scene.near_lamps.is_empty(),
        ),
        ("glints", "glints", chosen.plan.glints.is_some(), chosen.plan.glints.is_some()),
        ("adaptive", "adaptive", chosen.plan.adaptive.is_some(), shared),
    ] {
        if cause {
            let value = if on { "off" } else { "on" };
            all.push(trial(knob, value, &[(&format!("render.techniques.{key}"), value)]));
        }
    }
    if first::single(&census, path).is_none() && !chosen.scene.asked(chosen.plan.asks_even_sky).is_nobody() {
        for count in first::counts().filter(|count| *count != chosen.plan.shadow_rays) {
            let count = count.to_string();
            all.push(trial("shadow rays", &count, &[("render.techniques.shadow_rays", &count)]));
        }
    }
    all.push(trial("effects", "all", &[("render.effects", "all")]));
    all
}
