//! What was decided and why, in words.

use super::camera::Camera;
use super::{ENOUGH, Trial, Use, seen};
use crate::film::accumulate::REPLICATES;
use crate::scene::Scene;
use crate::scene::casters::Casters;
use crate::transport::caustics::Caustics;
use crate::transport::merge;
use crate::transport::plan::{self, Effect};

/// A name and whether it holds, for people.
pub(super) fn technique(name: &'static str, on: bool, reason: String) -> Effect {
    Effect { name: name.into(), on, reason }
}

/// The decision for people; `share` of the rays come from the lights.
pub(super) fn say(
    trial: &Trial,
    caustics: &Caustics,
    camera: &Camera,
    share: f64,
    seen: bool,
    collected: bool,
) -> Vec<Effect> {
    let Trial { scene, plan, wishes, .. } = *trial;
    let tracing = format!(
        "of {} over {}: {:.2} paths from the lights for each from the camera, {:.0} % of the rays",
        lamps(scene, caustics),
        trial.throwers(),
        caustics.ratio,
        100.0 * share
    );
    let packets = match (caustics.packets, caustics.parts) {
        (true, _) => "wavelengths that part in glass are followed together from the lights",
        (false, true) => "the scene says so",
        (false, false) => "no wavelengths part",
    };
    let merging = match caustics.merging {
        _ if wishes.merging == Use::Off => {
            "the scene says so: caustics in mirrors and behind glass are left to chance".into()
        }
        None if !seen => "the camera sees nothing in mirrors and through glass".into(),
        None if !collected => "no light of mirrors and glass comes to what is seen in them".into(),
        None if camera.met_mirrored < ENOUGH => {
            "caustics in mirrors and behind glass are fainter than the noise of so many samples".into()
        }
        None => format!(
            "paths from the camera find the caustics in mirrors and behind glass: {} of {}",
            camera.met_mirrored, camera.paths
        ),
        Some(radius) => {
            let samples = trial.samples.div_ceil(REPLICATES as u32).max(1);
            let mean = merge::mean_radius(radius, samples);
            format!(
                "caustics seen in mirrors and through glass: photons within {radius:.3} m at the first sample and {:.3} m at the last{}; their light is blurred as by a disc of {mean:.3} m, {:.1} pixels where it is seen",
                merge::radius(radius, samples - 1),
                if plan.media { ", on surfaces, not in media" } else { "" },
                seen::FIRST_RADIUS * mean / radius,
            )
        }
    };
    vec![
        technique("light tracing", true, tracing),
        technique("wavelength packets", caustics.packets, packets.to_owned()),
        technique("photon merging", caustics.merging.is_some(), merging),
    ]
}

impl Trial<'_> {
    /// Names of what throws light.
    pub(super) fn throwers(&self) -> String {
        let names = |casters: &Casters| casters.names.iter().chain(&casters.endless).cloned().collect::<Vec<String>>();
        plan::some_of(&[names(self.casters), names(self.in_part)].concat())
    }
}

fn lamps(scene: &Scene, caustics: &Caustics) -> String {
    let traced = caustics.traced.iter().filter(|t| **t).count();
    let all = plan::count(scene.lights.len(), "light", "lights");
    if traced == scene.lights.len() { all } else { format!("{traced} of {all}") }
}
