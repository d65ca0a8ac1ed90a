//! How to render, as it is written.

use std::time::Duration;

use serde::de::{Error, Unexpected};
use serde::{Deserialize, Deserializer};

use super::decode::{whole, whole_or_none};
use super::fault::Checker;
use super::frames::Frames;
use super::image::MAX_SIDE;
use super::light::nothing;
use super::path::At;
use super::spectrum::{Role, Spectrum};
use crate::error::in_short;
use crate::math::sampler::PARTS;

/// `integrator: path` or `integrator: {path: {max_depth: 8}}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Integrator {
    /// The path tracer.
    Path(PathIntegrator),
    /// The deterministic recursive tracer.
    Whitted(WhittedIntegrator),
    /// The distance to the first surface.
    Depth(DepthIntegrator),
    /// Paths from the lights to the camera.
    LightTracer(LightTracerIntegrator),
    /// No light, for a picture of layers alone.
    None(NoIntegrator),
}

impl Default for Integrator {
    fn default() -> Integrator {
        Integrator::Path(PathIntegrator::default())
    }
}

/// `path: {max_depth: null, roulette_depth: 5}`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathIntegrator {
    /// Most segments of a path: 1 shows emission, 2 direct light; default no limit.
    #[serde(default, deserialize_with = "whole_or_none::<_, 1, { u32::MAX }>")]
    pub max_depth: Option<u32>,
    /// Segments after which a path may end by chance; default 5.
    #[serde(default = "roulette_depth", deserialize_with = "whole::<_, 1, { u32::MAX }>")]
    pub roulette_depth: u32,
    /// Whether lights that the camera sees itself are left out: shining shapes as if they were not there, light
    /// from infinity as nothing; default false.
    #[serde(default)]
    pub hide_emitters: bool,
    /// Whether light from infinity counts as coverage; default false.
    #[serde(default)]
    pub opaque_sky: bool,
    /// Paths that one sample follows from its camera ray, if more than `scatter_samples`; with 0 lights are only met by chance,
    /// and those without extent never; default 1.
    #[serde(default = "one", deserialize_with = "whole::<_, 0, MAX_SPLIT>")]
    pub light_samples: u32,
    /// Paths that one sample follows from its camera ray, if more than `light_samples`; with 0 light arrives by shadow rays
    /// only, and mirrors are black, and so is what is behind panes and boundaries if `count_crossings`; default 1.
    #[serde(default = "one", deserialize_with = "whole::<_, 0, MAX_SPLIT>")]
    pub scatter_samples: u32,
    /// Whether going straight through a thin pane or the boundary of a medium ends a segment for `max_depth`, so that lamps behind
    /// it are seen in spite of `hide_emitters`, and light from infinity where the `first_hit` is coverage; default false.
    #[serde(default)]
    pub count_crossings: bool,
    /// Whether mirrors, glass and the coats of plastics throw the light of point, spot, projector and directional lights, too, which
    /// no path from the camera can find by chance; default true.
    #[serde(default = "yes")]
    pub delta_caustics: bool,
    /// What counts as coverage, for alpha and for the depth at which fog is taken; default `surfaces`.
    #[serde(default)]
    pub coverage: Coverage,
}

/// What of that which a path meets counts as coverage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Coverage {
    /// Surfaces and media, but for the holes of masks and the boundaries of media.
    #[default]
    Surfaces,
    /// What scatters the path: of a pane what it mirrors, not what goes straight through.
    Scattering,
    /// The first thing, be it a hole or a boundary.
    FirstHit,
}

impl Default for PathIntegrator {
    fn default() -> PathIntegrator {
        PathIntegrator {
            max_depth: None,
            roulette_depth: roulette_depth(),
            hide_emitters: false,
            opaque_sky: false,
            light_samples: one(),
            scatter_samples: one(),
            count_crossings: false,
            delta_caustics: true,
            coverage: Coverage::Surfaces,
        }
    }
}

fn roulette_depth() -> u32 {
    5
}

fn one() -> u32 {
    1
}

/// `depth`: the distance from where the camera ray begins to the first surface, in metres, 0 where there is none, as
/// a spectrum that is the same at every wavelength.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthIntegrator {}

/// `none`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoIntegrator {}

/// `light_tracer: {max_depth: null, roulette_depth: 5, hide_emitters: false, count_crossings: false}`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightTracerIntegrator {
    /// Most segments of a path, counted as for `path`; default no limit.
    #[serde(default, deserialize_with = "whole_or_none::<_, 1, { u32::MAX }>")]
    pub max_depth: Option<u32>,
    /// Segments after which a path may end by chance; default 5.
    #[serde(default = "roulette_depth", deserialize_with = "whole::<_, 1, { u32::MAX }>")]
    pub roulette_depth: u32,
    /// Whether lights that the camera sees itself are left out; default false.
    #[serde(default)]
    pub hide_emitters: bool,
    /// Whether going straight through a thin pane or the boundary of a medium ends a segment for `max_depth`, except for lamps that
    /// the camera sees itself; default false.
    #[serde(default)]
    pub count_crossings: bool,
}

/// `whitted: {max_depth: 10, grid: 2, ambient: 0.2}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WhittedIntegrator {
    /// Most reflections and refractions in a row, 1 to 256; default 10.
    #[serde(default = "whitted_depth", deserialize_with = "whole::<_, 1, MAX_RECURSION>")]
    pub max_depth: u32,
    /// Rays per pixel and side, on a regular grid; default 2.
    #[serde(default = "whitted_grid", deserialize_with = "whole::<_, 1, MAX_GRID>")]
    pub grid: u32,
    /// Radiance that reaches every surface, times its reflectance; default 0.
    #[serde(default = "nothing")]
    pub ambient: Spectrum,
    /// Whether light passes through transparent shapes to cast a lighter shadow; default false.
    #[serde(default)]
    pub transparent_shadows: bool,
}

impl WhittedIntegrator {
    /// Samples of a pixel: one a point of the grid, and at least four, because the wavelengths of
    /// fewer would not do. The 32 of four sets integrate the colour of smooth light to 0.5 %, the 8 of one set only to
    /// 10 %; with one point it is traced four times.
    #[must_use]
    pub fn samples(&self) -> u32 {
        (self.grid * self.grid).max(4)
    }
}

fn whitted_depth() -> u32 {
    10
}

fn whitted_grid() -> u32 {
    2
}

/// `render: {samples: 64, seed: 0}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Render {
    /// Paths per pixel, where [`Render::stop`] says nothing else; default 64.
    #[serde(default = "samples", deserialize_with = "whole::<_, 1, SAMPLES_LIMIT>")]
    pub samples: u32,
    /// When to end; default after `samples`.
    #[serde(default)]
    pub stop: Stop,
    /// Of the random numbers; default 0.
    #[serde(default)]
    pub seed: u64,
    /// Which effects are simulated; default `auto`.
    #[serde(default)]
    pub effects: Effects,
    /// Side of a tile of work, pixels, 1 to 65536; default 32.
    #[serde(default = "tile", deserialize_with = "whole::<_, 1, MAX_SIDE>")]
    pub tile: u32,
    /// How wavelengths are drawn; default `auto`.
    #[serde(default)]
    pub wavelengths: Wavelengths,
    /// How light is found; default each where it pays.
    #[serde(default)]
    pub techniques: Techniques,
    /// Which frames, where values change over them; none in the description of one frame, which says
    /// [`SceneDescription::frame`](super::SceneDescription::frame).
    pub frames: Option<Frames>,
    /// Whether the frame is added to the seed, so that noise does not stand still before what moves; default true.
    #[serde(default = "yes")]
    pub seed_per_frame: bool,
    /// Frames a second, for those who show the pictures; default none.
    pub frames_per_second: Option<f64>,
}

pub(super) fn yes() -> bool {
    true
}

fn samples() -> u32 {
    64
}

fn tile() -> u32 {
    32
}

impl Default for Render {
    fn default() -> Render {
        Render {
            samples: samples(),
            stop: Stop::default(),
            seed: 0,
            effects: Effects::default(),
            tile: tile(),
            wavelengths: Wavelengths::default(),
            techniques: Techniques::default(),
            frames: None,
            seed_per_frame: yes(),
            frames_per_second: None,
        }
    }
}

/// `stop: {error: 0.01, time: 60s, samples: 4096}`: the first that is reached ends the render.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Relative RMSE of the picture; also as `1%`.
    #[serde(default, deserialize_with = "share_or_none")]
    pub error: Option<f64>,
    /// Wall time of rendering.
    pub time: Option<Time>,
    /// Paths per pixel; default [`MOST_SAMPLES`] where there is another target, which it is then to reach.
    #[serde(default, deserialize_with = "whole_or_none::<_, 1, SAMPLES_LIMIT>")]
    pub samples: Option<u32>,
}

/// Paths per pixel after which a target counts as out of reach, where nothing else is said.
pub const MOST_SAMPLES: u32 = 1 << 16;

/// The most paths per pixel that a film holds: 2²⁷.
pub const SAMPLES_LIMIT: u32 = 1 << 27;

impl Render {
    /// The most paths per pixel.
    #[must_use]
    pub fn most_samples(&self) -> u32 {
        let open = self.stop.error.is_some() || self.stop.time.is_some();
        self.stop.samples.unwrap_or(if open { MOST_SAMPLES } else { self.samples })
    }
}

/// What a share is to be.
const SHARE: &str = "a number above 0 and below 1 (1 % is 0.01)";

/// For `deserialize_with`: a number, or per cent.
fn share_or_none<'de, D: Deserializer<'de>>(de: D) -> Result<Option<f64>, D::Error> {
    #[derive(Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Written {
        Number(f64),
        Text(String),
    }
    match Written::deserialize(de)? {
        Written::Number(share) => Ok(Some(share)),
        Written::Text(text) => {
            let wrong = || D::Error::invalid_value(Unexpected::Str(&text), &SHARE);
            share(&text).map(Some).ok_or_else(wrong)
        }
    }
}

/// The share of `0.01` or `1%`.
#[must_use]
pub fn share(text: &str) -> Option<f64> {
    let (number, unit) = match text.trim().strip_suffix('%') {
        Some(number) => (number.trim(), 0.01),
        None => (text.trim(), 1.0),
    };
    number.parse::<f64>().ok().map(|x| x * unit)
}

/// A time: seconds, or `90s`, `10m`, `2h`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Time {
    /// Seconds.
    Number(f64),
    /// With its unit.
    Text(String),
}

impl Time {
    /// The time that is meant, if any is.
    #[must_use]
    pub fn duration(&self) -> Option<Duration> {
        match self {
            Time::Number(seconds) => of_seconds(*seconds),
            Time::Text(text) => duration(text),
        }
    }
}

/// The time of `90s`, `10m` or `2h`; a number alone is seconds.
#[must_use]
pub fn duration(text: &str) -> Option<Duration> {
    let text = text.trim();
    let (number, unit) = match text.char_indices().next_back() {
        Some((at, 's')) => (&text[..at], 1.0),
        Some((at, 'm')) => (&text[..at], 60.0),
        Some((at, 'h')) => (&text[..at], 3600.0),
        _ => (text, 1.0),
    };
    let number: f64 = number.trim().parse().ok()?;
    of_seconds(number * unit)
}

/// A time of `seconds`. 0 may mean never: what is greater is a nanosecond at the least.
fn of_seconds(seconds: f64) -> Option<Duration> {
    let time = Duration::try_from_secs_f64(seconds).ok()?;
    Some(if seconds > 0.0 { time.max(Duration::from_nanos(1)) } else { time })
}

/// `techniques: {light_tracing: auto, packets: auto, merging: auto, reuse: auto, splatting: auto, shadow_rays: auto, even_sky: auto,
/// equiangular: auto, glints: auto, adaptive: auto}`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Techniques {
    /// Whether light of mirrors and glass is traced from the lights.
    #[serde(default)]
    pub light_tracing: Technique,
    /// Whether wavelengths that part in glass are followed together, on their way from a light and from the camera.
    #[serde(default)]
    pub packets: Technique,
    /// Whether photons are collected where light of mirrors and glass is seen in mirrors and through glass. Without
    /// it that light is left to chance; with it, it is blurred a little.
    #[serde(default)]
    pub merging: Technique,
    /// Whether paths of pixels that lie near each other share what they find from their second vertices on.
    #[serde(default)]
    pub reuse: Technique,
    /// Whether a sample counts for all pixels near it whose filters hold it, in place of its own alone.
    #[serde(default)]
    pub splatting: Technique,
    /// How many shadow rays paths send from their first vertices; default as many as pay.
    #[serde(default)]
    pub shadow_rays: ShadowRays,
    /// Whether shadow rays go to `constant` lights, too, which paths that leave the scene meet.
    #[serde(default)]
    pub even_sky: Technique,
    /// Whether light of up to eight lamps is looked for along the ways of paths through media, too.
    #[serde(default)]
    pub equiangular: Technique,
    /// Whether pictures of lamps that are smaller than a few pixels are searched, and their light looked for by itself.
    #[serde(default)]
    pub glints: Technique,
    /// Whether pixels get more samples where the picture is noisier, at the same mean.
    #[serde(default)]
    pub adaptive: Technique,
}

/// How many shadow rays a path sends from its first vertex that looks for light; the picture is the same but for its noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShadowRays {
    /// As many as pay.
    #[default]
    Auto,
    /// So many, 1 to 8.
    #[serde(deserialize_with = "whole::<_, 1, PARTS>")]
    Number(u32),
}

/// Whether a technique is used; the picture is the same but for its noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Technique {
    /// Where it pays.
    #[default]
    Auto,
    /// Wherever it can be.
    On,
    /// Not.
    Off,
}

/// Which effects are simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effects {
    /// Those that the scene calls for.
    #[default]
    Auto,
    /// All; the picture is the same.
    All,
}

/// How wavelengths are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wavelengths {
    /// By the scene's own spectra.
    #[default]
    Auto,
    /// By the sensitivity of the eye.
    Visible,
    /// All alike.
    Uniform,
}

/// The most rays per pixel and side of the `whitted` integrator: 2²⁰ a pixel.
const MAX_GRID: u32 = 1024;

/// The most reflections and refractions in a row of the `whitted` integrator, each of which takes some 2 kB of a thread's 2 MB
/// of stack.
const MAX_RECURSION: u32 = 256;

/// The most paths from one camera ray.
const MAX_SPLIT: u32 = 65_536;

impl Integrator {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        match self {
            Integrator::Path(path) => {
                let at = at.key("path");
                checker.at_least_one(at.key("max_depth"), path.max_depth.unwrap_or(u32::MAX));
                checker.at_least_one(at.key("roulette_depth"), path.roulette_depth);
                checker.whole_between(at.key("light_samples"), path.light_samples, 0, MAX_SPLIT);
                checker.whole_between(at.key("scatter_samples"), path.scatter_samples, 0, MAX_SPLIT);
                if path.light_samples == 0 && path.scatter_samples == 0 {
                    checker.at_least_one(at.key("scatter_samples"), 0);
                }
            }
            Integrator::Depth(DepthIntegrator {}) | Integrator::None(NoIntegrator {}) => {}
            Integrator::LightTracer(light) => {
                let at = at.key("light_tracer");
                checker.at_least_one(at.key("max_depth"), light.max_depth.unwrap_or(u32::MAX));
                checker.at_least_one(at.key("roulette_depth"), light.roulette_depth);
            }
            Integrator::Whitted(whitted) => {
                let at = at.key("whitted");
                checker.whole_between(at.key("max_depth"), whitted.max_depth, 1, MAX_RECURSION);
                checker.whole_between(at.key("grid"), whitted.grid, 1, MAX_GRID);
                whitted.ambient.check(Role::Emission, at.key("ambient"), checker);
            }
        }
    }
}

impl Render {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        checker.whole_between(at.key("samples"), self.samples, 1, SAMPLES_LIMIT);
        if let ShadowRays::Number(count) = self.techniques.shadow_rays {
            checker.whole_between(at.key("techniques").key("shadow_rays"), count, 1, PARTS);
        }
        checker.whole_between(at.key("tile"), self.tile, 1, MAX_SIDE);
        let stop = at.key("stop");
        if let Some(error) = self.stop.error {
            // A share of the light: 4 was meant for 4 %.
            let is_share = error > 0.0 && error < 1.0;
            checker.require(is_share, stop.key("error"), SHARE, error);
        }
        if let Some(time) = &self.stop.time {
            let found = match time {
                Time::Number(seconds) => in_short(*seconds),
                Time::Text(text) => format!("\"{text}\""),
            };
            let holds = time.duration().is_some_and(|time| !time.is_zero());
            checker.require(holds, stop.key("time"), "a time greater than 0, as 60, 90s, 10m or 2h", found);
        }
        checker.whole_between(stop.key("samples"), self.stop.samples.unwrap_or(1), 1, SAMPLES_LIMIT);
        if let Some(Err(message)) = self.frames.as_ref().map(Frames::list) {
            checker.fault(at.key("frames"), message);
        }
        if let Some(rate) = self.frames_per_second {
            let found = (1e-3..=1e6).contains(&rate);
            checker.require(found, at.key("frames_per_second"), "a number from 0.001 to 1000000", rate);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    #[test]
    fn counts_are_one_or_more() {
        assert_eq!(
            faults("render: {samples: 0, tile: 0}"),
            "dir/s.yaml:2:19: render.samples: expected a whole number from 1 to 134217728, found 0\n\
             dir/s.yaml:2:28: render.tile: expected a whole number from 1 to 65536, found 0"
        );
        assert_eq!(
            faults("integrator: {path: {max_depth: 0, roulette_depth: 0}}"),
            "dir/s.yaml:2:32: integrator.path.max_depth: expected a whole number of 1 or more, found 0\n\
             dir/s.yaml:2:51: integrator.path.roulette_depth: expected a whole number of 1 or more, found 0"
        );
        assert_eq!(
            faults("integrator: {path: {light_samples: 4294967295, scatter_samples: 65537}}"),
            "dir/s.yaml:2:36: integrator.path.light_samples: expected a whole number from 0 to 65536, found 4294967295\n\
             dir/s.yaml:2:65: integrator.path.scatter_samples: expected a whole number from 0 to 65536, found 65537"
        );
        assert_eq!(
            faults("integrator: {whitted: {max_depth: 0, grid: 2000, ambient: -1}}"),
            "dir/s.yaml:2:35: integrator.whitted.max_depth: expected a whole number from 1 to 256, found 0\n\
             dir/s.yaml:2:44: integrator.whitted.grid: expected a whole number from 1 to 1024, found 2000\n\
             dir/s.yaml:2:59: integrator.whitted.ambient: expected a number of 0 or more, found -1"
        );
    }

    /// Between perfect mirrors each takes more of the stack.
    #[test]
    fn whitted_does_not_go_deeper_than_the_stack() {
        assert_eq!(
            faults("integrator: {whitted: {max_depth: 257}}"),
            "dir/s.yaml:2:35: integrator.whitted.max_depth: expected a whole number from 1 to 256, found 257"
        );
    }

    #[test]
    fn samples_are_no_more_than_a_film_holds() {
        assert_eq!(
            faults("render: {samples: 134217729, stop: {samples: 4000000000}}"),
            "dir/s.yaml:2:19: render.samples: expected a whole number from 1 to 134217728, found 134217729\n\
             dir/s.yaml:2:46: render.stop.samples: expected a whole number from 1 to 134217728, found 4000000000"
        );
        assert_eq!(scene("render: {samples: 134217728}").render.samples, SAMPLES_LIMIT);
    }

    #[test]
    fn targets_are_above_zero_and_times_have_units() {
        assert_eq!(
            faults("render: {stop: {error: 0, time: 5 days, samples: 0}}"),
            "dir/s.yaml:2:24: render.stop.error: expected a number above 0 and below 1 (1 % is 0.01), found 0\n\
             dir/s.yaml:2:33: render.stop.time: expected a time greater than 0, as 60, 90s, 10m or 2h, found \"5 days\"\n\
             dir/s.yaml:2:50: render.stop.samples: expected a whole number from 1 to 134217728, found 0"
        );
        assert_eq!(
            faults("render: {stop: {error: 1}}"),
            "dir/s.yaml:2:24: render.stop.error: expected a number above 0 and below 1 (1 % is 0.01), found 1"
        );
        for wrong in ["1 part", "one%"] {
            assert_eq!(
                faults(&format!("render: {{stop: {{error: {wrong}}}}}")),
                format!(
                    "dir/s.yaml:2:24: render.stop.error: expected a number above 0 and below 1 (1 % is 0.01), \
                     found the text \"{wrong}\""
                )
            );
        }
        assert_eq!(
            faults("render: {stop: {error: 150%}}"),
            "dir/s.yaml:2:24: render.stop.error: expected a number above 0 and below 1 (1 % is 0.01), found 1.5"
        );
        let render = |text: &str| scene(&format!("render: {text}")).render;
        for one in ["0.01", "1%", "'1 %'", "'0.01'"] {
            assert_eq!(render(&format!("{{stop: {{error: {one}}}}}")).stop.error, Some(0.01), "{one}");
        }
        assert_eq!(render("{stop: {error: null, time: 1}}").stop.error, None);
        let stop = render("{stop: {time: 2m}}");
        assert_eq!(stop.stop.time.clone().unwrap().duration(), Some(Duration::from_secs(120)));
        assert_eq!(duration("0"), Some(Duration::ZERO));
        for least in ["1e-300", "1e-10s", "4e-10", "1e-300h"] {
            assert_eq!(duration(least), Some(Duration::from_nanos(1)), "{least}");
        }
        let short = render("{stop: {time: 1.0e-300}}").stop;
        assert_eq!(short.time.unwrap().duration(), Some(Duration::from_nanos(1)));
        assert_eq!((stop.most_samples(), render("{samples: 7}").most_samples()), (MOST_SAMPLES, 7));
        assert_eq!(render("{samples: 7, stop: {error: 0.1, samples: 9}}").most_samples(), 9);
    }

    #[test]
    fn defaults_are_those_of_the_page() {
        let scene = scene("");
        assert_eq!(
            scene.render,
            Render {
                samples: 64,
                stop: Stop::default(),
                seed: 0,
                effects: Effects::Auto,
                tile: 32,
                wavelengths: Wavelengths::Auto,
                techniques: Techniques::default(),
                frames: None,
                seed_per_frame: true,
                frames_per_second: None,
            }
        );
        assert_eq!(scene.integrator, Integrator::Path(PathIntegrator::default()));
    }

    #[test]
    fn an_integrator_alone_has_its_defaults() {
        let Integrator::Whitted(whitted) = scene("integrator: whitted").integrator else { panic!("whitted") };
        assert_eq!((whitted.max_depth, whitted.grid, whitted.transparent_shadows), (10, 2, false));
        assert_eq!(whitted.ambient, Spectrum::Number(0.0));
    }
}
