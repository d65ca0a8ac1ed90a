//! Rounds of paths from the lights: what each path leaves on the picture, and what that teaches.

use super::camera::Colour;
use super::seen::{Arrival, Seen};
use super::{BLOCKS, Trial};
use crate::spectrum::observer;
use crate::transport::guide::Find;
use crate::transport::light::{LightPaths, trace};
use crate::transport::photons::Photons;
use glam::DVec2;
use rayon::prelude::*;
use std::ops::Range;

/// Paths of a round at least and at most: what they find is kept, some megabytes.
const FROM_LIGHTS: [u64; 2] = [1 << 11, 1 << 17];

/// Of that many are always as many followed as all.
const AT_ONCE: u64 = 1 << 11;

/// What one path from a light left on the picture.
struct Landed {
    source: usize,
    place: DVec2,
    /// What the camera sees itself.
    splats: Vec<Arrival>,
    /// What it would collect where mirrors and glass are seen.
    collected: Vec<Arrival>,
    rays: u32,
    /// Luminance of the sky where it came from, as a path from the camera would find it.
    sky: f64,
    /// Whether no path from the camera could be the same.
    unfound: bool,
}

/// Paths `indices` of one round, in the order of their numbers.
fn from_lights(paths: &LightPaths, seen: Option<&Seen>, round: u32, indices: Range<u64>) -> Vec<Landed> {
    let (unit, [width, height]) = (paths.scene.light_unit(), paths.scene.camera.resolution.map(f64::from));
    let block_of = |place: DVec2| {
        let index = |x: f64, size: f64| ((x / size * BLOCKS as f64).max(0.0) as usize).min(BLOCKS - 1);
        index(place.y, height) * BLOCKS + index(place.x, width)
    };
    indices
        .into_par_iter()
        .map(|i| {
            let mut splats: Vec<(DVec2, Colour)> = Vec::new();
            let (mut photons, mut collected) = (Photons::within(seen.map_or(1.0, |seen| seen.radius)), Vec::new());
            let traced = trace(paths, round, i, seen.map(|_| &mut photons), &mut |wavelengths, splat| {
                let (pixel, colour) = (splat.place.floor(), Colour::of(splat.xyz(unit, wavelengths)));
                // Colours that come to one pixel together make up for each other.
                match splats.iter_mut().find(|(p, _)| *p == pixel) {
                    Some((_, sum)) => *sum = *sum + colour,
                    None => splats.push((pixel, colour)),
                }
            });
            let arrival = |(pixel, colour): &(DVec2, Colour)| Arrival {
                block: block_of(*pixel),
                y: colour.y,
                square: colour.square(),
                pixels: 1.0,
            };
            let splats = splats.iter().map(arrival).collect();
            if let (Some(seen), Some(wavelengths)) = (seen, &traced.wavelengths) {
                let unit_area = photons.unit_area;
                photons.iter().for_each(|photon| seen.collect(&photon, unit_area, wavelengths, &mut collected));
            }
            let (source, place) = traced.began.unwrap_or((usize::MAX, DVec2::ZERO));
            let sky = match (paths.caustics.and_then(|caustics| caustics.sources.get(source)), &traced.wavelengths) {
                (Some(source), Some(wavelengths)) => {
                    let light = &paths.scene.lights[source.light as usize];
                    let radiance = light.background(-traced.direction, wavelengths.nm);
                    traced.share * Colour::of(observer::xyz(radiance * unit, wavelengths)).y
                }
                _ => 0.0,
            };
            Landed { source, place, splats, collected, rays: traced.rays, sky, unfound: traced.unfound }
        })
        .collect()
}

/// A path that came to the picture.
struct Arrived {
    source: usize,
    place: DVec2,
    /// Of its source and place.
    density: f64,
    /// Weighted squares.
    splatted: f64,
    collected: f64,
}

impl Arrived {
    fn squares(&self) -> f64 {
        self.splatted + self.collected
    }
}

/// What a round of paths from the lights has found, a path.
#[derive(Default)]
pub(super) struct Round {
    pub paths: u64,
    pub rays: f64,
    /// Weighted squares of what came to pixels: by itself, and collected.
    pub splatted: f64,
    pub collected: f64,
    /// Mean luminance of each block, and the part of it that is collected.
    pub thrown: Vec<f64>,
    pub gathered: Vec<f64>,
    /// Variance of a path from the camera that finds the light of skies by chance, weighted: of all, and of what is collected. Light
    /// of mean m that is found as bright as L has one of m L.
    pub by_chance: f64,
    pub gathered_by_chance: f64,
    /// Whether any of it, and any of what is collected, is light that no path from the camera could find.
    pub unfound: bool,
    pub unfound_gathered: bool,
}

impl Round {
    /// Whether anything came to the picture.
    pub(super) fn came(&self) -> bool {
        self.splatted + self.collected > 0.0
    }
}

impl Trial<'_> {
    /// Follows paths from the lights, as many as the picture is worth, and adds what sources and cells sent to `learnt`.
    pub(super) fn round(
        &self,
        paths: &LightPaths,
        seen: Option<&Seen>,
        number: u32,
        weights: &[f64],
        most_rays: f64,
        learnt: &mut [Vec<Find>],
    ) -> Round {
        let Some(caustics) = paths.caustics else { return Round::default() };
        let mut round =
            Round { thrown: vec![0.0; BLOCKS * BLOCKS], gathered: vec![0.0; BLOCKS * BLOCKS], ..Round::default() };
        let mut arrived = Vec::new();
        let [least, most] = FROM_LIGHTS;
        while round.paths < least || round.paths < most && round.rays < most_rays {
            for landed in from_lights(paths, seen, number, round.paths..round.paths + AT_ONCE) {
                round.rays += f64::from(1 + landed.rays);
                let squares = |all: &[Arrival]| all.iter().map(|a| weights[a.block] * a.pixels * a.square).sum::<f64>();
                let (splatted, collected) = (squares(&landed.splats), squares(&landed.collected));
                for arrival in landed.splats.iter().chain(&landed.collected) {
                    round.thrown[arrival.block] += arrival.pixels * arrival.y;
                }
                let chanced =
                    |all: &[Arrival]| all.iter().map(|a| weights[a.block] * a.pixels * a.y * landed.sky).sum::<f64>();
                let (splats, gathered) = (chanced(&landed.splats), chanced(&landed.collected));
                round.by_chance += splats + gathered;
                round.gathered_by_chance += gathered;
                for arrival in &landed.collected {
                    round.gathered[arrival.block] += arrival.pixels * arrival.y;
                }
                if splatted + collected > 0.0 {
                    let source = &caustics.sources[landed.source];
                    let unfound = landed.unfound || self.rare[source.light as usize];
                    round.unfound |= unfound;
                    round.unfound_gathered |= unfound && collected > 0.0;
                    let density = source.probability * source.guide.density(landed.place);
                    arrived.push(Arrived { source: landed.source, place: landed.place, density, splatted, collected });
                }
            }
            round.paths += AT_ONCE;
        }
        // Single fireflies do not decide where to aim and how much.
        arrived.sort_by(|a, b| b.squares().total_cmp(&a.squares()));
        let most = arrived.get(arrived.len() / 500).map_or(0.0, Arrived::squares);
        for a in &arrived {
            let cut = (most / a.squares()).min(1.0);
            round.splatted += a.splatted * cut;
            round.collected += a.collected * cut;
            learnt[a.source].push(Find { place: a.place, square: a.squares() * cut * a.density });
        }
        let paths = round.paths as f64;
        let [width, height] = self.scene.camera.resolution.map(f64::from);
        let pixels = width * height * paths;
        let share = (BLOCKS * BLOCKS) as f64 / pixels;
        round.thrown.iter_mut().chain(&mut round.gathered).for_each(|y| *y *= share);
        Round {
            by_chance: round.by_chance / pixels,
            gathered_by_chance: round.gathered_by_chance / pixels,
            rays: round.rays / paths,
            splatted: round.splatted / paths,
            collected: round.collected / paths,
            ..round
        }
    }
}
