//! Paths from the lights of a part: which of them, and what they leave on the picture.

use super::{Breaks, Part};
use crate::batch::frame::{FrameJob, lock};
use crate::film::Window;
use crate::film::accumulate::{Film, Invalid, InvalidCounts, REPLICATES, SAMPLE_LIMIT};
use crate::film::filter::FilterSampler;
use crate::film::resolve::Splats;
use crate::scene::Scene;
use crate::spectrum::SampledWavelengths;
use crate::transport;
use crate::transport::light::{Bounds, LightPaths, Splat};
use crate::transport::merge::{self, WavelengthCell};
use crate::transport::photons::{PhotonMap, Photons};
use crate::transport::plan::{EffectPlan, Integrator};
use glam::DVec2;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Mutex;

/// Light that came from the lights to the camera.
#[derive(Debug)]
pub struct SplatFilm {
    /// The sums, and those of the layers that they add to.
    pub film: Film,
    /// Paths that began in each replicate.
    pub paths: [u64; REPLICATES],
}

impl SplatFilm {
    /// As a picture is made of them.
    #[must_use]
    pub fn splats(&self) -> Splats<'_> {
        Splats { film: &self.film, photons: self.paths }
    }
}

/// Paths of one work unit from the lights: some milliseconds, so that threads end together where a sample has few.
pub(super) const PATHS_OF_A_UNIT: u64 = 1 << 10;
/// Shares of pixels that are gathered, some MB of them, before they are added to the picture: a wide filter deals light to thousands.
const AT_ONCE: usize = 1 << 16;

/// Which paths of the share have been added.
#[derive(Clone, Debug, Default)]
pub(super) struct LightsDone {
    /// All of the samples below this.
    pub(super) below: u32,
    /// Paths of later samples, disjoint.
    pub(super) more: Vec<(Range<u64>, u32)>,
}

impl Part<'_> {
    /// The paths from the lights of each sample that belong to the share, where there are any.
    pub(super) fn own_paths(&self) -> Range<u64> {
        self.splats.as_ref().map_or(0..0, |(paths, _)| self.share.of(paths_of_a_sample(self.job, paths)))
    }

    /// Follows paths from the lights for each sample of `samples`: as many as the frame has pixels, or the share of them
    /// that the plan wants. A sample's replicate and number address its paths as they do for the camera, so the sums do
    /// not depend on units or passes. Only paths of the share that are not there yet are added, and without `photons`
    /// no other is followed. False if there was a pause.
    pub(super) fn add_paths(
        &self,
        light_paths: &LightPaths,
        samples: Range<u32>,
        splats: &Mutex<SplatFilm>,
        pause: &dyn Breaks,
        photons: Option<&mut Vec<Photons>>,
    ) -> bool {
        let paths = paths_of_a_sample(self.job, light_paths);
        let wanted = photons.is_some();
        let radius = light_paths.caustics.and_then(|caustics| caustics.merging).unwrap_or(1.0);
        let own = self.own_paths();
        let known = lock(&self.lights).clone();
        let mut more: BTreeMap<u32, Vec<Range<u64>>> = BTreeMap::new();
        for (paths, sample) in known.more.into_iter().filter(|(_, sample)| samples.contains(sample)) {
            more.entry(sample).or_default().push(paths);
        }
        let mut units: Vec<(u32, Range<u64>, bool)> = Vec::new();
        for sample in samples.clone() {
            let there: Vec<Range<u64>> =
                if sample < known.below { vec![own.clone()] } else { more.remove(&sample).unwrap_or_default() };
            let cuts = pieces(paths, &own, &there).into_iter().map(|(unit, add)| (sample, unit, add));
            units.extend(cuts.filter(|(_, _, add)| *add || wanted));
        }
        let trace = |(number, (sample, unit, add)): (usize, (u32, Range<u64>, bool))| {
            let mut left = Photons::within(radius);
            // One is followed however soon the pauses come.
            if pause.ending() || number > 0 && pause.wanted() {
                return (left, None);
            }
            let replicate = sample % REPLICATES as u32;
            let base = u64::from(sample / REPLICATES as u32) * paths;
            let mut landed = Landed::default();
            for j in unit.clone() {
                let photons = wanted.then_some(&mut left);
                transport::light::trace(light_paths, replicate, base + j, photons, &mut |wavelengths, splat| {
                    if add {
                        landed.add(self.job, wavelengths, &splat);
                    }
                });
                if landed.pixels.len() >= AT_ONCE {
                    landed.move_to(&mut lock(splats), replicate);
                }
            }
            if add {
                let mut splats = lock(splats);
                landed.move_to(&mut splats, replicate);
                splats.paths[replicate as usize] += unit.end - unit.start;
            }
            (left, Some((unit, sample, add)))
        };
        // In the order of the paths, whoever follows them.
        let followed: Vec<_> = units.into_par_iter().enumerate().map(trace).collect();
        let whole = followed.iter().all(|(_, unit)| unit.is_some());
        let mut known = lock(&self.lights);
        if whole {
            known.below = known.below.max(samples.end);
            known.more.retain(|(_, sample)| *sample >= samples.end);
        } else {
            for (unit, sample, _) in followed.iter().filter_map(|(_, unit)| unit.as_ref()).filter(|unit| unit.2) {
                match known.more.last_mut() {
                    Some((last, of)) if of == sample && last.end == unit.start => last.end = unit.end,
                    _ => known.more.push((unit.clone(), *sample)),
                }
            }
        }
        if let Some(photons) = photons {
            *photons = followed.into_iter().map(|(left, _)| left).collect();
        }
        whole
    }

    /// [`Part::add_paths`] for one sample, with the photons for its paths from the camera and what chooses their
    /// wavelengths; none if there was a pause.
    pub(super) fn photons(
        &self,
        light_paths: &LightPaths,
        sample: u32,
        first_radius: f64,
        splats: &Mutex<SplatFilm>,
        pause: &dyn Breaks,
    ) -> Option<(PhotonMap, f64)> {
        let job = self.job;
        let (replicate, index) = (sample % REPLICATES as u32, sample / REPLICATES as u32);
        let wavelength = merge::shared_wavelength(job.seed, replicate, index);
        let parts = light_paths.caustics.is_some_and(|c| c.parts);
        let cell = match parts {
            true => WavelengthCell::around(wavelength, job.planned.div_ceil(REPLICATES as u32)),
            false => WavelengthCell::point(wavelength),
        };
        let paths = LightPaths { wavelength: Some(cell), ..*light_paths };
        let mut photons = Vec::new();
        if !self.add_paths(&paths, sample..sample + 1, splats, pause, Some(&mut photons)) {
            return None;
        }
        let followed = paths_of_a_sample(job, light_paths);
        Some((PhotonMap::new(&photons, followed, merge::radius(first_radius, index)), wavelength))
    }
}

/// The paths of a sample cut into units, each wholly in or out of what is to be added: `own` without `there`.
fn pieces(paths: u64, own: &Range<u64>, there: &[Range<u64>]) -> Vec<(Range<u64>, bool)> {
    let mut cuts: Vec<u64> = (0..paths).step_by(PATHS_OF_A_UNIT as usize).chain([own.start, own.end, paths]).collect();
    cuts.extend(there.iter().flat_map(|r| [r.start, r.end]));
    cuts.retain(|cut| *cut <= paths);
    cuts.sort_unstable();
    cuts.dedup();
    let add = |at: u64| own.contains(&at) && !there.iter().any(|r| r.contains(&at));
    cuts.windows(2).map(|pair| (pair[0]..pair[1], add(pair[0]))).collect()
}

/// The paths from the lights that the plan calls for.
pub(super) fn light_paths<'a>(job: &FrameJob<'a>) -> Option<LightPaths<'a>> {
    let FrameJob { scene, moments, plan, filter, window, seed, .. } = *job;
    paths_of(plan, scene, moments, filter, window, seed)
}

/// The paths from the lights that `plan` calls for, with the light that `filter` deals to pixels of `window`.
pub(in crate::batch) fn paths_of<'a>(
    plan: &'a EffectPlan,
    scene: &'a Scene,
    moments: &'a [Scene],
    filter: &FilterSampler,
    window: Window,
    seed: u64,
) -> Option<LightPaths<'a>> {
    let (settings, caustics) = match &plan.integrator {
        Integrator::Light(settings) => (*settings, None),
        Integrator::Path(settings) => (settings.of_light_paths(), Some(plan.caustics.as_deref()?)),
        Integrator::Whitted(_) | Integrator::Depth | Integrator::Nothing => return None,
    };
    let radius = filter.radius() + 0.5;
    let corner = DVec2::new(f64::from(window.x), f64::from(window.y));
    let bounds = Bounds {
        low: corner - radius,
        high: corner + DVec2::new(f64::from(window.width), f64::from(window.height)) + radius,
    };
    Some(LightPaths { scene, moments, plan, settings, caustics, seed, bounds, wavelength: None })
}

/// Paths from the lights for each sample of all pixels.
pub(super) fn paths_of_a_sample(job: &FrameJob, light_paths: &LightPaths) -> u64 {
    let [width, height] = job.scene.camera.resolution.map(u64::from);
    light_paths.caustics.map_or(width * height, |c| c.paths(width * height))
}

/// What paths of one unit left on the picture since it was last added there.
#[derive(Default)]
struct Landed {
    pixels: Vec<([i32; 2], [f32; 3])>,
    /// The numbers of the layers of each.
    numbers: Vec<f32>,
    invalid: InvalidCounts,
}

impl Landed {
    fn add(
        &mut self,
        FrameJob { scene, plan, filter, window, .. }: &FrameJob,
        wavelengths: &SampledWavelengths,
        splat: &Splat,
    ) {
        if let Some(cause) = Invalid::of(splat.light) {
            self.invalid.record(cause);
            return;
        }
        let xyz = splat.xyz(scene.light_unit(), wavelengths);
        // Told once, however many pixels it is dealt to.
        if xyz.iter().any(|x| x.abs() >= SAMPLE_LIMIT) {
            self.invalid.record(Invalid::Overflow);
            return;
        }
        let mut numbers = Vec::new();
        plan.layers.append_traced(scene, wavelengths, splat.light, xyz, splat.group, &mut numbers);
        filter.deal(splat.place, window, |pixel, share| {
            self.pixels.push((pixel, xyz.map(|x| x * share)));
            self.numbers.extend(numbers.iter().map(|x| x * share));
        });
    }

    /// Adds all to `splats`, and is empty.
    fn move_to(&mut self, splats: &mut SplatFilm, replicate: u32) {
        splats.film.invalid += std::mem::take(&mut self.invalid);
        let channels = splats.film.layers.channels();
        let window = splats.film.window();
        for (i, &(pixel, xyz)) in self.pixels.iter().enumerate() {
            splats.film.add(pixel, replicate as usize, xyz, 0.0);
            if let (Some(index), true) = (window.index(pixel), channels > 0) {
                splats.film.layers.add(index, replicate as usize, 1.0, &self.numbers[i * channels..(i + 1) * channels]);
            }
        }
        self.pixels.clear();
        self.numbers.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Own paths 10 to 2 500 of 3 000, of which 100 to 200 are there: every path once, and the right ones added.
    #[test]
    fn paths_are_cut_where_the_share_and_what_is_there_begin_and_end() {
        let found = pieces(3_000, &(10..2_500), &[100..150, 150..200]);
        let added: Vec<_> = found.iter().filter(|(_, add)| *add).map(|(unit, _)| unit.clone()).collect();
        assert_eq!(added, [10..100, 200..1024, 1024..2048, 2048..2_500]);
        assert_eq!(found.iter().map(|(unit, _)| unit.end - unit.start).sum::<u64>(), 3_000);
    }
}
