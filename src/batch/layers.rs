//! From the layers that are written to those that samples fill.

use super::finish;
use super::prepare::{colour_space, integrator};
use crate::description::{self, DEFAULT_GROUP, LayerContent, SceneDescription};
use crate::error::Result;
use crate::film::layers::{Kept, Layout};
use crate::scene::Scene;
use crate::transport::layers::{Form, Layer, LayerPlan, Source};
use crate::transport::middle::Middle;
use crate::transport::ways::{Way, Ways};
use std::collections::BTreeSet;

/// Whether standard errors are to be written, as a setting of the file or as a layer.
pub(super) fn wants_errors(description: &SceneDescription) -> bool {
    let asked = |layer: &description::Layer| layer.content == LayerContent::StandardError;
    description.output.exr.stderr || description.layers.iter().any(asked)
}

/// How the sums of a picture with so many bands are kept.
fn kept(description: &SceneDescription, bands: usize) -> Kept {
    // By them the error of a picture is told that has bands in place of colours.
    let random = !matches!(description.integrator, description::Integrator::Whitted(_));
    let told = random && !description.image.bands.is_empty();
    if told || wants_errors(description) && bands > 0 { Kept::ByReplicate } else { Kept::Together }
}

/// No more than the channels of [`plan`], as far as the description alone tells: all bands, and one of each layer.
pub(super) fn fewest(description: &SceneDescription) -> Layout {
    let spectral = description.output.spectral.map_or(0, |spectral| spectral.bands as usize);
    let bands = description.image.bands.len() + spectral;
    let of = |layer: &&description::Layer| match layer.content {
        LayerContent::Surface(_)
        | LayerContent::Seen(_)
        | LayerContent::Light { .. }
        | LayerContent::Ways { .. }
        | LayerContent::Middle(_) => true,
        // There may be no lamps; the others are no sums.
        LayerContent::LightGroups
        | LayerContent::Matte(_)
        | LayerContent::Variance
        | LayerContent::StandardError
        | LayerContent::SampleCount => false,
    };
    Layout { channels: bands + description.layers.iter().filter(of).count(), kept: kept(description, bands) }
}

/// The further channels of the picture.
pub(super) fn plan(description: &SceneDescription, scene: &Scene, samples: u32) -> Result<LayerPlan> {
    let mut plan = LayerPlan {
        rgb_from_xyz: colour_space(description.output.colour).matrix_from_xyz(),
        in_xyz: finish::base(&description.output, !description.image.bands.is_empty()).is_xyz(),
        sensitivity: description.image.sensitivity,
        light: scene.light_powers,
        lengths: scene.length_powers,
        distances: matches!(description.integrator, description::Integrator::Depth(_)),
        sample_distance: 1.0 / f64::from(samples).sqrt(),
        ..LayerPlan::default()
    };
    plan.kept = kept(description, scene.bands.len());
    for (i, band) in scene.bands.iter().enumerate() {
        plan.layers.push(Layer { name: band.name.clone(), source: Source::Band(i), squares: None });
    }
    let groups = &scene.light_groups;
    // One that has no number of its own is that of the rest.
    let group = |name: &String| groups.names.iter().position(|key| key == name).map_or(0, |i| i as u8 + 1);
    // Those to which paths from the lights add come first.
    for layer in &description.layers {
        match &layer.content {
            LayerContent::Ways { ways, group: of } => {
                let source = Source::Ways(self::ways(ways), of.as_ref().map(group));
                plan.layers.push(Layer { name: layer.name.clone(), source, squares: None });
            }
            LayerContent::LightGroups => {
                // Of lamps that are dark at this frame, too, so that all frames have the same; depth fog is of no lamp.
                let is_named = description.light_groups.contains_key(DEFAULT_GROUP);
                let grouped: BTreeSet<&String> = description.light_groups.values().flatten().collect();
                let has_rest =
                    is_named || !description.lamps().iter().all(|lamp| grouped.contains(lamp)) || scene.fog.is_some();
                let rest = has_rest.then(|| DEFAULT_GROUP.to_owned());
                let numbers = if rest.is_some() { 0 } else { 1 }..groups.count();
                for (name, i) in rest.iter().chain(&groups.names).zip(numbers) {
                    let source = Source::Ways(Ways::ALL, Some(i));
                    plan.layers.push(Layer { name: format!("light_{name}"), source, squares: None });
                }
            }
            _ => {}
        }
    }
    plan.mattes = description.layers.iter().any(|layer| matches!(layer.content, LayerContent::Matte(_)));
    for layer in &description.layers {
        let source = match &layer.content {
            LayerContent::Middle(data) => Source::Middle(match data {
                description::Data::Depth => Middle::Depth,
                description::Data::Position => Middle::Position,
                description::Data::Uv => Middle::Uv,
                description::Data::Motion => Middle::Motion,
            }),
            // Of ways above; the others are no sums.
            LayerContent::Ways { .. }
            | LayerContent::LightGroups
            | LayerContent::Matte(_)
            | LayerContent::Variance
            | LayerContent::StandardError
            | LayerContent::SampleCount => continue,
            LayerContent::Surface(quantity) => Source::Surface(*quantity),
            LayerContent::Seen(quantity) => Source::Seen(*quantity),
            LayerContent::Light { of, form } => {
                let form = match form {
                    description::LightForm::Rgba => Form::Rgba,
                    description::LightForm::Xyz => Form::Xyz,
                };
                let of = match of {
                    Some(other) if *other != description.integrator => {
                        plan.integrators.push(integrator(description, other)?);
                        Some(plan.integrators.len() - 1)
                    }
                    Some(_) | None => None,
                };
                Source::Light(of, form)
            }
        };
        plan.layers.push(Layer { name: layer.name.clone(), source, squares: layer.squares.clone() });
    }
    Ok(plan)
}

fn ways(ways: &[description::LightWay]) -> Ways {
    use description::LightWay as Written;
    const DIRECT: [Way; 4] = [Way::DiffuseDirect, Way::GlossyDirect, Way::TransmissionDirect, Way::MediaDirect];
    const INDIRECT: [Way; 4] =
        [Way::DiffuseIndirect, Way::GlossyIndirect, Way::TransmissionIndirect, Way::MediaIndirect];
    let one = |way: &Written| match way {
        Written::Emission => Ways::of(&[Way::Emission]),
        Written::Caustic => Ways::of(&[Way::Caustic]),
        Written::Direct => Ways::of(&DIRECT),
        Written::Indirect => Ways::of(&INDIRECT),
        Written::Diffuse => Ways::of(&[Way::DiffuseDirect, Way::DiffuseIndirect]),
        Written::Glossy => Ways::of(&[Way::GlossyDirect, Way::GlossyIndirect]),
        Written::Transmission => Ways::of(&[Way::TransmissionDirect, Way::TransmissionIndirect]),
        Written::Media => Ways::of(&[Way::MediaDirect, Way::MediaIndirect]),
        Written::DiffuseDirect => Ways::of(&[Way::DiffuseDirect]),
        Written::DiffuseIndirect => Ways::of(&[Way::DiffuseIndirect]),
        Written::GlossyDirect => Ways::of(&[Way::GlossyDirect]),
        Written::GlossyIndirect => Ways::of(&[Way::GlossyIndirect]),
        Written::TransmissionDirect => Ways::of(&[Way::TransmissionDirect]),
        Written::TransmissionIndirect => Ways::of(&[Way::TransmissionIndirect]),
        Written::MediaDirect => Ways::of(&[Way::MediaDirect]),
        Written::MediaIndirect => Ways::of(&[Way::MediaIndirect]),
    };
    ways.iter().map(one).fold(Ways::of(&[]), Ways::or)
}
