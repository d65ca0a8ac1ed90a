//! Which names the mattes of a picture go by.

use super::prepare::filter;
use crate::description::{self, LayerContent, MaterialRef, SceneDescription, Shape};
use crate::film::cryptomatte::{Matte, id_of};
use crate::film::filter::FilterSampler;
use crate::scene::Scene;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// The mattes that are asked for, with the names of what the scene's objects are part of.
pub(super) fn mattes(description: &SceneDescription, scene: &Scene) -> Vec<Matte> {
    let wanted = description.layers.iter().filter_map(|layer| match layer.content {
        LayerContent::Matte(matte) => Some(matte),
        _ => None,
    });
    // Children of groups come after the shapes of the scene itself. What is seen of an instance is a child, which has a material;
    // the object and the asset are the instance.
    let objects = || scene.objects.iter().zip(&description.shapes);
    let wanted: Vec<description::Matte> = wanted.collect();
    let positive = !wanted.is_empty()
        && FilterSampler::new(filter(&description.image.filter)).is_ok_and(|sampler| sampler.is_positive());
    let matte = |matte: description::Matte| Matte {
        positive,
        layer: matte.layer().to_owned(),
        of_parts: matte == description::Matte::Material,
        names: match matte {
            description::Matte::Object => objects().map(|(object, _)| Some(object.name.clone())).collect(),
            description::Matte::Material => {
                let instances = description.shapes.iter().map(|shape| shape.geometry.group().is_some());
                let instances = instances.chain(std::iter::repeat(false));
                scene.material_names.iter().zip(instances).map(|(name, is)| (!is).then(|| name.clone())).collect()
            }
            description::Matte::Asset => {
                let assets = assets(description);
                objects().map(|(object, shape)| Some(asset(&assets, &object.name, shape).0.to_owned())).collect()
            }
        },
    };
    wanted.into_iter().map(matte).collect()
}

/// The asset of each shape that is named as part of one.
fn assets(description: &SceneDescription) -> HashMap<&str, &str> {
    let named = description.assets.iter();
    named.flat_map(|(asset, shapes)| shapes.iter().map(move |shape| (shape.as_str(), asset.as_str()))).collect()
}

/// What the object `name` is part of, and what that is: one of the `assets`, else the group that its `shape` copies, else itself.
fn asset<'a>(assets: &HashMap<&str, &'a str>, name: &'a str, shape: &'a Shape) -> (&'a str, &'static str) {
    match (assets.get(name), shape.geometry.group()) {
        (Some(asset), _) => (asset, "an asset"),
        (None, Some(group)) => (group, "a group"),
        (None, None) => (name, "a shape"),
    }
}

/// Notes on names that mean two things in one matte, which goes by names alone.
pub(super) fn shared_names(description: &SceneDescription) -> Vec<String> {
    let SceneDescription { shapes, groups, .. } = description;
    let named = || shapes.iter().enumerate().map(|(i, shape)| (shape, shape.name_or_kind(i)));
    let children = || groups.iter().flat_map(|(group, shapes)| shapes.iter().map(move |shape| (group, shape)));
    let mut told = Vec::new();
    for layer in &description.layers {
        let LayerContent::Matte(matte) = layer.content else { continue };
        let mut meanings: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        let mut means = |name: &str, what: &str| {
            meanings.entry(name.to_owned()).or_default().insert(what.to_owned());
        };
        match matte {
            description::Matte::Object => {}
            description::Matte::Material => {
                let own = named().map(|(shape, name)| (shape, name, "a shape".to_owned()));
                let of_child = children().filter_map(|(group, shape)| {
                    Some((shape, shape.name.clone()?, format!("a shape of the group `{group}`")))
                });
                for (shape, name, what) in own.chain(of_child) {
                    match &shape.material {
                        MaterialRef::Name(material) => means(material, "a material"),
                        MaterialRef::Inline(_) => means(&name, &what),
                    }
                }
            }
            description::Matte::Asset => {
                let assets = assets(description);
                for (shape, name) in named() {
                    let (asset, what) = asset(&assets, &name, shape);
                    means(asset, what);
                }
            }
        }
        for (name, what) in meanings.into_iter().filter(|(_, what)| what.len() > 1) {
            let what = Vec::from_iter(what).join(" and of ");
            told.push(format!("{}: the name `{name}` is that of {what}: they are one matte", matte.layer()));
        }
    }
    told
}

/// Notes on names of which a matte cannot tell one from the other: of 10,000 two have one id in every hundredth scene.
pub(super) fn shared_ids(mattes: &[Matte]) -> Vec<String> {
    let mut told = Vec::new();
    for matte in mattes {
        let mut names: BTreeMap<u32, BTreeSet<&str>> = BTreeMap::new();
        for name in matte.names.iter().flatten() {
            names.entry(id_of(name).to_bits()).or_default().insert(name);
        }
        for (id, names) in names.into_iter().filter(|(_, names)| names.len() > 1) {
            let names = Vec::from_iter(names).join("` and `");
            told.push(format!("{}: the names `{names}` have one id, {id:08x}: they are one matte", matte.layer));
        }
    }
    told
}
