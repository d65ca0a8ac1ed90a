//! What a scene calls for: each effect on or off, with its reason.
//!
//! An *effect* is something that is simulated (dispersion, a medium, a texture). A scene that lacks
//! it does not pay for it, and leaving it out never changes a bit: `effects: all` turns everything
//! on and is the proof. A *technique* is how an effect is computed; it changes noise and time,
//! never the mean, but for merging, which blurs, less with every sample.

use super::Spread;
use super::caustics::Caustics;
use super::glints::Glints;
use super::layers::LayerPlan;
use crate::scene::census::Census;
use crate::spectrum::Spectrum;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::Arc;

/// Which light transport is simulated.
#[derive(Clone, Debug)]
pub enum Integrator {
    /// Path tracing with next-event estimation.
    Path(PathSettings),
    /// The deterministic recursive tracer.
    Whitted(WhittedSettings),
    /// The distance to the first surface, as light.
    Depth,
    /// Paths from the lights to the camera.
    Light(LightSettings),
    /// No light: a picture of layers alone.
    Nothing,
}

impl Integrator {
    /// Whether what it gives is light: a distance is none, nor is nothing.
    #[must_use]
    pub fn shows_light(&self) -> bool {
        self.no_light().is_none()
    }

    /// Whether each of its samples and paths sees a moment of its own while the shutter is open.
    #[must_use]
    pub fn draws_times(&self) -> bool {
        match self {
            Integrator::Whitted(_) => false,
            Integrator::Path(_) | Integrator::Light(_) | Integrator::Depth | Integrator::Nothing => true,
        }
    }

    /// Why it gives none; `None` where it does.
    fn no_light(&self) -> Option<&'static str> {
        match self {
            Integrator::Depth => Some("depth looks for no light"),
            Integrator::Nothing => Some("none looks for no light"),
            Integrator::Path(_) | Integrator::Whitted(_) | Integrator::Light(_) => None,
        }
    }
}

/// Settings of the light tracer.
#[derive(Clone, Copy, Debug)]
pub struct LightSettings {
    /// Longest path, in segments from the light to the camera. `None`: no limit.
    pub max_depth: Option<u32>,
    /// Segments after which Russian roulette may end a path.
    pub roulette_depth: u32,
    /// Whether lights that the camera sees itself are left out.
    pub hide_emitters: bool,
    /// Whether going straight through a pane or a boundary ends a segment for `max_depth`.
    pub count_crossings: bool,
}

/// Settings of the path tracer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathSettings {
    /// Longest path, in segments: 1 sees lights only, 2 adds direct light. `None`: no limit.
    pub max_depth: Option<u32>,
    /// Segments after which Russian roulette may end a path.
    pub roulette_depth: u32,
    /// Whether lights that the camera sees itself are left out.
    pub hide_emitters: bool,
    /// Whether light from infinity covers what is behind the picture.
    pub opaque_sky: bool,
    /// Paths from each camera ray, if more than `scatter_samples`; 0 leaves next-event estimation out everywhere.
    pub light_samples: u32,
    /// Paths from each camera ray, if more than `light_samples`; 0 leaves light met by scattering out everywhere.
    pub scatter_samples: u32,
    /// Whether going straight through a pane or a boundary ends a segment for `max_depth`.
    pub count_crossings: bool,
    /// Whether light of mirrors and glass is traced from lights without extent.
    pub delta_caustics: bool,
    /// What counts as coverage.
    pub coverage: Coverage,
}

/// What of that which a path meets counts as coverage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coverage {
    /// Surfaces and media, but for holes and boundaries.
    Surfaces,
    /// What scatters the path.
    Scattering,
    /// The first thing of any kind.
    FirstHit,
}

impl PathSettings {
    /// The same limits for paths from the lights.
    #[must_use]
    pub fn of_light_paths(&self) -> LightSettings {
        LightSettings {
            max_depth: self.max_depth,
            roulette_depth: self.roulette_depth,
            hide_emitters: self.hide_emitters,
            count_crossings: self.count_crossings,
        }
    }
}

impl Default for PathSettings {
    fn default() -> PathSettings {
        PathSettings {
            max_depth: None,
            roulette_depth: 5,
            hide_emitters: false,
            opaque_sky: false,
            light_samples: 1,
            scatter_samples: 1,
            count_crossings: false,
            delta_caustics: true,
            coverage: Coverage::Surfaces,
        }
    }
}

/// Settings of the recursive tracer.
#[derive(Clone, Debug)]
pub struct WhittedSettings {
    /// Deepest recursion: with 1 a mirror shows what is before it, but no mirror in a mirror.
    pub max_depth: u32,
    /// Points of a pixel along each side.
    pub grid: u32,
    /// Samples of a pixel: it is traced anew where the points are fewer.
    pub samples: u32,
    /// How the wavelengths of a pixel's samples are spread.
    pub wavelengths: Spread,
    /// Radiance that surfaces get from everywhere, times their reflectance.
    pub ambient: Spectrum,
    /// True where transparent objects let light through in a straight line, dimmed and tinted by
    /// their surfaces, instead of casting a full shadow.
    pub transparent_shadows: bool,
}

/// Whether effects that the scene lacks are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EffectMode {
    /// Left out.
    #[default]
    Auto,
    /// All kept in force, to prove that nothing changes and to measure what leaving out saves.
    All,
}

/// One effect or technique.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Effect {
    /// Its name.
    pub name: Cow<'static, str>,
    /// Whether it is simulated, or used.
    pub on: bool,
    /// Why.
    pub reason: String,
}

/// How samples are shared out by noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adaptive {
    /// Samples of a pixel that all have before.
    pub first: u32,
    /// Whether they are shared out whatever that is expected to save.
    pub always: bool,
}

/// What is simulated, and how.
#[derive(Clone, Debug)]
pub struct EffectPlan {
    /// Which light transport.
    pub integrator: Integrator,
    /// Sampling decisions that depend on wavelength: densities are kept for each lane.
    pub chromatic: bool,
    /// Media.
    pub media: bool,
    /// Bodies with a priority.
    pub nested: bool,
    /// Depth fog.
    pub depth_fog: bool,
    /// Whether anything shines: a picture of light without it is black for sure.
    pub lit: bool,
    /// Wavelengths that part at glass that the camera looks at are followed together.
    pub packets: bool,
    /// In how many pixels light of paths from the lights falls together ([`super::light::span()`]); 1 where there are none.
    pub span: f64,
    /// Paths of pixels near each other share what they find.
    pub reuse: bool,
    /// Each sample goes to all pixels of its cell whose filters hold it.
    pub splatting: bool,
    /// Shadow rays from the first vertex of each path that looks for light, at most [`PARTS`](crate::math::sampler::PARTS).
    pub shadow_rays: u32,
    /// Shadow rays go to light that is even over all directions, too, which what is scattered finds as well.
    pub asks_even_sky: bool,
    /// Of how many of the scene's near lamps light is looked for along the ways of paths through media, too.
    pub near_lamps: usize,
    /// Every glass is computed as if it were dispersive.
    pub all_dispersive: bool,
    /// Light of mirrors and glass that is traced from the lights.
    pub caustics: Option<Arc<Caustics>>,
    /// Where small pictures of lamps lie, whose light is looked for by itself.
    pub glints: Option<Arc<Glints>>,
    /// Where samples are shared out by noise.
    pub adaptive: Option<Adaptive>,
    /// Further channels of the picture.
    pub layers: LayerPlan,
    /// What is simulated, for people.
    pub effects: Vec<Effect>,
    /// How it is computed, for people.
    pub techniques: Vec<Effect>,
}

/// At most three names, then how many more.
pub(super) fn some_of(names: &[String]) -> String {
    let shown = names.iter().take(3).map(String::as_str).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(3) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// Why paths of at most `max_depth` segments bring no light over several surfaces; `None` where they do.
fn too_short(max_depth: Option<u32>) -> Option<&'static str> {
    match max_depth {
        Some(..=1) => Some("max_depth 1 leaves emission alone"),
        Some(2) => Some("max_depth 2 leaves emission and direct light alone"),
        _ => None,
    }
}

/// So many of something.
pub(super) fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// The effects of a scene, one after the other.
struct Told {
    mode: EffectMode,
    /// Why neither the picture nor a layer shows light, where that is so.
    unlit: Option<&'static str>,
    has_layers: bool,
    effects: Vec<Effect>,
}

impl Told {
    /// An effect of the scene: on if the scene has it, or if everything is forced on. Without light it is told as off; whatever
    /// layers take of it stays. Returns whether it is simulated.
    fn effect(&mut self, name: &'static str, present: bool, here: String, absent: &str) -> bool {
        let forced = self.mode == EffectMode::All;
        let in_force = present || forced;
        let unseen = match name {
            "depth of field" => false,
            "textures" | "interference" | "nested bodies" => !self.has_layers,
            _ => true,
        };
        let (present, absent) = match self.unlit.filter(|_| unseen) {
            Some(none) => (false, none),
            None => (present, absent),
        };
        let reason = match (present, forced) {
            (true, _) => here,
            (false, false) => absent.to_owned(),
            (false, true) => format!("forced by effects: all ({absent})"),
        };
        self.effects.push(Effect { name: name.into(), on: present || forced, reason });
        in_force
    }

    /// The same of an effect that `things` of the scene have.
    fn list(&mut self, name: &'static str, things: &[String], here: &str, absent: &str) -> bool {
        self.effect(name, !things.is_empty(), format!("{here}: {}", some_of(things)), absent)
    }
}

/// The techniques of the path tracer for this scene.
fn path_techniques(census: &Census, settings: &PathSettings, chromatic: bool) -> Vec<Effect> {
    let (extended, lights) = (census.extended_lights(), census.lights());
    let technique = |name: &'static str, on, here: String, absent: &str| Effect {
        name: name.into(),
        on,
        reason: if on { here } else { absent.to_owned() },
    };
    let dark = match census.dark.as_slice() {
        [] => String::new(),
        dark => format!("; without power and left out: {}", some_of(dark)),
    };
    // Light is looked for from where paths scatter, if they do, and met by what they scatter.
    let ends = settings.max_depth.is_some_and(|depth| depth < 2).then_some("max_depth 1 ends paths where they scatter");
    let unasked = ends.or((settings.light_samples == 0).then_some("light_samples is 0"));
    let unmet = unasked.or((settings.scatter_samples == 0).then_some("scatter_samples is 0"));
    vec![
        technique(
            "next-event estimation",
            lights > 0 && unasked.is_none(),
            format!("of {}, chosen by what each may give{dark}", count(lights, "light", "lights")),
            unasked.filter(|_| lights > 0).unwrap_or(&format!("there is no light{dark}")),
        ),
        technique(
            "multiple importance sampling",
            extended > 0 && unmet.is_none(),
            format!("{} can also be met by chance", count(extended, "light", "lights")),
            unmet.filter(|_| extended > 0).unwrap_or("no light can be met by chance"),
        ),
        technique(
            "hero wavelengths",
            chromatic,
            "wavelengths part on the way: one of the eight leads each path".into(),
            "all eight wavelengths share every path",
        ),
        technique("Russian roulette", true, "faint paths end early, without bias".into(), ""),
    ]
}

impl EffectPlan {
    /// Whether pixels of a cell have errors in common.
    #[must_use]
    pub fn shares_cells(&self) -> bool {
        self.reuse || self.splatting
    }

    /// Decides from the census of a scene, and by what its picture and its `layers` show.
    #[must_use]
    pub fn of(census: &Census, integrator: Integrator, layers: LayerPlan, mode: EffectMode) -> EffectPlan {
        let path = !matches!(integrator, Integrator::Whitted(_));
        // Who shows light: the picture, else a layer.
        let lighting = std::iter::once(&integrator).chain(&layers.integrators).find(|one| one.shows_light());
        let no_light = integrator.no_light();
        let mut told = Told {
            mode,
            unlit: no_light.filter(|_| lighting.is_none()),
            has_layers: !layers.layers.is_empty(),
            effects: Vec::new(),
        };

        let bent = census.dispersive.iter().chain(&census.rough_dispersive);
        let dispersive: Vec<String> = bent.chain(&census.coloured_coats).cloned().collect();
        told.list("dispersion", &dispersive, "index depends on wavelength", "no index depends on wavelength");
        told.list("refraction", &census.refractive, "transparent", "nothing is transparent");
        told.list("interference", &census.films, "thin films, at each wavelength", "no surface has a thin film");
        told.list("specular reflection", &census.reflective, "mirrors and metals", "no mirrors and no metals");
        told.list("textures", &census.textured, "varying over the surface", "every surface has one spectrum");
        told.list("area lights", &census.area_lights, "shining", "no surface shines");
        told.effect(
            "lights without extent",
            census.delta_lights > 0,
            count(
                census.delta_lights,
                "point, spot, projector or directional light",
                "point, spot, projector or directional lights",
            ),
            "no point, spot, projector or directional light",
        );
        told.effect(
            "environment",
            census.backgrounds > 0,
            count(census.backgrounds, "light from infinity", "lights from infinity"),
            "no light from infinity",
        );
        let clear = count(census.clear_media, "medium that dims light", "media that dim light");
        let media = told.effect(
            "media",
            if path { census.media > 0 } else { census.clear_media > 0 },
            match (path, census.media - census.clear_media) {
                (true, _) => count(census.media, "medium that light crosses", "media that light crosses"),
                (false, 0) => clear,
                (false, left) => {
                    let left = count(left, "that scatters or varies", "that scatter or vary");
                    format!("{clear}; whitted leaves out {left}")
                }
            },
            match path || census.media == 0 {
                true => "all space is empty",
                false => "whitted leaves out media that scatter or vary",
            },
        );
        let nested =
            told.list("nested bodies", &census.nested, "the higher priority has the place", "no body has a priority");
        let depth_fog = told.effect("depth fog", census.fog, "the scene asks for it".into(), "the scene has none");
        told.effect(
            "depth of field",
            path && census.lens,
            "the lens has a radius".into(),
            if path { "the camera is a pinhole" } else { "whitted uses a pinhole" },
        );
        let (follows, absent) = match lighting.unwrap_or(&integrator) {
            Integrator::Path(path) => ("path follows light over every surface", too_short(path.max_depth)),
            Integrator::Light(light) => ("light_tracer follows light over every surface", too_short(light.max_depth)),
            Integrator::Whitted(_) => ("", Some("whitted knows light of mirrors and glass only, and an ambient term")),
            Integrator::Depth | Integrator::Nothing => ("", no_light),
        };
        told.effect("indirect light", absent.is_none(), follows.into(), absent.unwrap_or_default());
        // Not an effect but a consequence; forced on with the effects that call for it.
        let bends = !(census.dispersive.is_empty() && census.rough_dispersive.is_empty());
        let chromatic = bends || census.chromatic_media > 0 || mode == EffectMode::All;
        let techniques = match &integrator {
            Integrator::Path(settings) => path_techniques(census, settings, chromatic),
            _ => Vec::new(),
        };
        let shows_light = matches!(integrator, Integrator::Path(_) | Integrator::Light(_));
        EffectPlan {
            lit: census.lights() > 0 || census.fog || !shows_light,
            integrator,
            chromatic,
            media,
            nested,
            depth_fog,
            packets: path && !census.dispersive.is_empty(),
            span: 1.0,
            reuse: false,
            splatting: false,
            shadow_rays: 1,
            asks_even_sky: true,
            near_lamps: 0,
            glints: None,
            all_dispersive: mode == EffectMode::All,
            caustics: None,
            adaptive: None,
            layers,
            effects: told.effects,
            techniques,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path() -> Integrator {
        Integrator::Path(PathSettings::default())
    }

    #[test]
    fn an_empty_scene_calls_for_nothing_but_light_over_surfaces() {
        let plan = EffectPlan::of(&Census::default(), path(), LayerPlan::default(), EffectMode::Auto);
        let on: Vec<_> = plan.effects.iter().filter(|e| e.on).map(|e| e.name.as_ref()).collect();
        assert_eq!(on, ["indirect light"]);
        assert!(!plan.chromatic && !plan.media && !plan.depth_fog);
    }

    #[test]
    fn a_prism_calls_for_dispersion_by_name() {
        let census = Census { dispersive: vec!["prism".into()], ..Census::default() };
        let plan = EffectPlan::of(&census, path(), LayerPlan::default(), EffectMode::Auto);
        let dispersion = plan.effects.iter().find(|e| e.name == "dispersion").unwrap();
        assert!(dispersion.on && dispersion.reason.contains("prism") && plan.chromatic);
    }

    /// `light_samples: 0` leaves shadow rays out, `scatter_samples: 0` what scattering meets, and either the weighing of both;
    /// of segments the first shows emission, the second direct light, and only further ones light over several surfaces.
    #[test]
    fn what_the_integrator_leaves_out_is_off_with_its_field() {
        let census = Census { area_lights: vec!["lamp".into()], ..Census::default() };
        let plan =
            |settings| EffectPlan::of(&census, Integrator::Path(settings), LayerPlan::default(), EffectMode::Auto);
        let usual = PathSettings::default();
        let (next_event, weighing, indirect) =
            ("next-event estimation", "multiple importance sampling", "indirect light");
        let cases = [
            (PathSettings { light_samples: 0, ..usual }, "light_samples", [false, false, true]),
            (PathSettings { scatter_samples: 0, ..usual }, "scatter_samples", [true, false, true]),
            (PathSettings { max_depth: Some(1), ..usual }, "max_depth 1", [false, false, false]),
            (PathSettings { max_depth: Some(2), ..usual }, "max_depth 2", [true, true, false]),
            (PathSettings { max_depth: Some(3), ..usual }, "", [true, true, true]),
            (usual, "", [true, true, true]),
        ];
        for (settings, field, on) in cases {
            let plan = plan(settings);
            for (name, on) in [next_event, weighing, indirect].into_iter().zip(on) {
                let said = plan.effects.iter().chain(&plan.techniques).find(|said| said.name == name).unwrap();
                assert_eq!(said.on, on, "{field}: {said:?}");
                assert!(on || said.reason.contains(field), "{said:?}");
            }
        }
    }

    #[test]
    fn one_light_is_told_as_one() {
        let census = Census { area_lights: vec!["lamp".into()], ..Census::default() };
        let plan = EffectPlan::of(&census, path(), LayerPlan::default(), EffectMode::Auto);
        let said = |name| plan.techniques.iter().find(|said| said.name == name).unwrap().reason.as_str();
        assert_eq!(said("next-event estimation"), "of 1 light, chosen by what each may give");
        assert_eq!(said("multiple importance sampling"), "1 light can also be met by chance");
    }

    /// A distance is behind no fog and needs no lamp; a layer of light has both.
    #[test]
    fn where_no_light_is_shown_its_effects_are_off() {
        let census = Census {
            area_lights: vec!["lamp".into()],
            refractive: vec!["ball".into()],
            reflective: vec!["mirror".into()],
            dispersive: vec!["ball".into()],
            media: 1,
            fog: true,
            lens: true,
            ..Census::default()
        };
        let on = |integrator: Integrator, integrators: Vec<Integrator>| -> Vec<String> {
            let layers = LayerPlan { integrators, ..LayerPlan::default() };
            let plan = EffectPlan::of(&census, integrator, layers, EffectMode::Auto);
            plan.effects.into_iter().filter(|e| e.on).map(|e| e.name.into_owned()).collect()
        };
        let light = ["dispersion", "refraction", "specular reflection", "area lights", "media", "depth fog"];
        let all = [&light[..], &["depth of field", "indirect light"]].concat();
        assert_eq!(on(path(), Vec::new()), all);
        for integrator in [Integrator::Depth, Integrator::Nothing] {
            assert_eq!(on(integrator.clone(), Vec::new()), ["depth of field"]);
            assert_eq!(on(integrator.clone(), vec![Integrator::Depth]), ["depth of field"]);
            assert_eq!(on(integrator, vec![path()]), all);
        }
    }

    #[test]
    fn everything_can_be_forced_on_and_says_so() {
        let plan = EffectPlan::of(&Census::default(), path(), LayerPlan::default(), EffectMode::All);
        assert!(plan.effects.iter().all(|e| e.on));
        assert!(plan.effects[0].reason.contains("effects: all"));
    }
}
