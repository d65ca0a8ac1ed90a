//! Which techniques a picture is rendered with.

use super::part::lights::paths_of;
use super::prepare::window;
use super::stop::Stop;
use super::{Watcher, adaptive, splatting};
use crate::description::{self, SceneDescription};
use crate::error::{Error, Result};
use crate::film::filter::{Filter, FilterSampler};
use crate::film::layers::Kept;
use crate::scene::Scene;
use crate::scene::census::Census;
use crate::transport::pilot::{self, Use, Wishes};
use crate::transport::plan::{Effect, EffectPlan, Integrator};
use crate::transport::trial::{self, first};
use crate::transport::{Shot, glints, light};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What techniques are chosen for.
pub(super) struct Choice<'a> {
    pub description: &'a SceneDescription,
    pub scene: &'a Scene,
    pub moments: &'a [Scene],
    pub census: &'a Census,
    pub filter: &'a FilterSampler,
    pub stop: Stop,
    /// Samples of a pixel; the most of them, where `stop` has other targets.
    pub samples: u32,
    pub interrupt: &'a AtomicBool,
    pub watcher: &'a dyn Watcher,
}

impl Choice<'_> {
    /// `plan` with techniques for `planned` samples of a pixel.
    ///
    /// # Errors
    /// [`Error::Stopped`] if there comes an interrupt.
    pub fn make(&self, mut plan: EffectPlan, planned: u32) -> Result<EffectPlan> {
        let Choice { description, scene, moments, filter, .. } = *self;
        let (seed, wishes) = (description.render.seed, wishes(description));
        let go_on = || match self.interrupt.load(Ordering::Relaxed) {
            true => Err(Error::Stopped("stopped while it was prepared; --resume goes on".into())),
            false => Ok(()),
        };
        let began = Instant::now();
        let goes_on = |share: Option<f64>| {
            if let Some(share) = share {
                self.watcher.searches(share, began.elapsed());
            }
            !self.interrupt.load(Ordering::Relaxed)
        };
        let shot = Shot { scene, plan: &plan, filter, seed, photons: None };
        let (caustics, said) = pilot::decide(&shot, moments, planned, wishes, &goes_on);
        go_on()?;
        plan.caustics = caustics;
        plan.techniques.extend(said);
        // What counts against a pixel is made up for, and no noise that is to be told.
        let whole = FilterSampler::new(Filter::Box).expect("a box is a filter");
        let tried = if count_against(&plan, filter) { &whole } else { filter };
        // What is traced from the lights is no noise of either.
        let shot = Shot { scene, plan: &plan, filter: tried, seed, photons: None };
        if let Some((packets, said)) = trial::packets(&shot, planned, wishes.packets) {
            plan.packets = packets;
            plan.techniques.push(said);
        }
        go_on()?;
        let shot = Shot { scene, plan: &plan, filter, seed, photons: None };
        let (glints, said) =
            glints::find(&shot, moments, window(description), planned, wishes.glints, &|| goes_on(None));
        go_on()?;
        plan.glints = glints;
        plan.techniques.extend(said);
        let written = &description.render.techniques;
        let (first, said) = adaptive::choose(wish(written.adaptive), self.stop.is_open(), &plan, self.samples);
        plan.adaptive = first;
        if first.is_some() {
            // The halves of the replicates weigh alike, whatever their counts.
            plan.layers.kept = Kept::ByReplicate;
        }
        plan.techniques.extend(said);
        let (splatting, said) = splatting::choose(wish(written.splatting), &plan, filter);
        plan.splatting = splatting;
        if splatting || count_against(&plan, filter) {
            plan.layers.kept = Kept::Weighed;
        }
        plan.techniques.extend(said);
        let shot = Shot { scene, plan: &plan, filter: tried, seed, photons: None };
        if let Some(first) = first::decide(&shot, self.census, moments, planned, wishes) {
            (plan.reuse, plan.shadow_rays, plan.asks_even_sky) = (first.reuse, first.shadow_rays, first.asks_even_sky);
            plan.techniques.extend(first.said);
            plan.near_lamps = first.near_lamps;
        }
        go_on()?;
        // Where photons are merged all pixels share.
        if plan.caustics.as_ref().is_none_or(|caustics| caustics.merging.is_none())
            && let Some(paths) = paths_of(&plan, scene, moments, filter, window(description), seed)
        {
            plan.span = light::span(&paths, filter, &window(description));
        }
        plan.techniques.extend(asked_in_vain(description));
        Ok(plan)
    }
}

/// Whether some samples count against their pixel, whose light is made up for by what others have.
fn count_against(plan: &EffectPlan, filter: &FilterSampler) -> bool {
    !filter.is_positive() && !matches!(plan.integrator, Integrator::Whitted(_))
}

/// Whether a technique is used.
fn wish(technique: description::Technique) -> Use {
    match technique {
        description::Technique::Auto => Use::Auto,
        description::Technique::On => Use::On,
        description::Technique::Off => Use::Off,
    }
}

/// Techniques that are asked for where no paths start from the camera, which is what they are for.
fn asked_in_vain(description: &SceneDescription) -> Vec<Effect> {
    let written = &description.render.techniques;
    let of_whitted = matches!(description.integrator, description::Integrator::Whitted(_));
    let on = |technique: description::Technique| technique == description::Technique::On;
    let several = matches!(written.shadow_rays, description::ShadowRays::Number(2..));
    // Splatting is for all samples that are drawn, and tells of itself.
    let asked = [
        ("light tracing", on(written.light_tracing)),
        ("wavelength packets", on(written.packets)),
        ("photon merging", on(written.merging)),
        ("adaptive sampling", on(written.adaptive)),
        ("splatting", on(written.splatting) && of_whitted),
        ("shadow rays to the even sky", on(written.even_sky)),
        ("paths shared by pixels", on(written.reuse)),
        ("several shadow rays from the first vertex", several),
        ("small pictures of lamps", on(written.glints)),
        ("equiangular sampling", on(written.equiangular)),
    ];
    let of_path = matches!(description.integrator, description::Integrator::Path(_));
    let told = asked.into_iter().filter(|(_, asked)| *asked && !of_path);
    told.map(|(name, _)| Effect { name: name.into(), on: false, reason: "no paths start from the camera".into() })
        .collect()
}

/// Techniques that the description asks for or forbids.
fn wishes(description: &SceneDescription) -> Wishes {
    let written = &description.render.techniques;
    Wishes {
        light_tracing: wish(written.light_tracing),
        packets: wish(written.packets),
        merging: wish(written.merging),
        reuse: wish(written.reuse),
        even_sky: wish(written.even_sky),
        glints: wish(written.glints),
        equiangular: wish(written.equiangular),
        shadow_rays: match written.shadow_rays {
            description::ShadowRays::Auto => None,
            description::ShadowRays::Number(count) => Some(count),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Adaptive sampling, and others of paths from the camera, were passed over without a word.
    #[test]
    fn techniques_that_the_integrator_lacks_are_told_where_they_are_asked_for() {
        let told = |integrator: &str, techniques: &str| -> Vec<String> {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nintegrator: {integrator}\n\
                 render: {{techniques: {{{techniques}}}}}\n"
            );
            let description = SceneDescription::parse(&text, Path::new("s.yaml")).unwrap();
            let told = asked_in_vain(&description);
            assert!(told.iter().all(|technique| !technique.on));
            told.into_iter().map(|technique| technique.name.into_owned()).collect()
        };
        let asked = "adaptive: on, splatting: on, shadow_rays: 4, reuse: off";
        let several = "several shadow rays from the first vertex";
        assert_eq!(told("path", asked), [""; 0]);
        assert_eq!(told("whitted", asked), ["adaptive sampling", "splatting", several]);
        for integrator in ["light_tracer", "depth", "none"] {
            assert_eq!(told(integrator, asked), ["adaptive sampling", several]);
            assert_eq!(told(integrator, "shadow_rays: 1"), [""; 0]);
        }
    }
}
