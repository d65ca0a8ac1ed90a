//! The light of lamps in small pictures: its paths, and where they pay.

use super::Region;
use super::search::Found;
use crate::film::error::floor_about;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::spectrum::{Lanes, observer};
use crate::transport::path::{self, Sought};
use crate::transport::plan::{Integrator, PathSettings};
use crate::transport::ways::Ledger;
use crate::transport::{self, Address, Begun, Incoming, Shot, address, place_in};
use glam::DVec2;
use rayon::prelude::*;

/// Tells their numbers from the picture's, and those of a region some columns and rows away from its pixel's own.
const STREAM: u64 = 0x676c_696e_7473_676c;
const STREAMS: [u64; 2] = [0x9e37_79b9_7f4a_7c15, 0xd1b5_4a32_d192_ed03];

/// The least number of paths from a region in the mean, where little of it counts.
const FEWEST_PATHS: f64 = 0.25;

/// Pixels for each that is tried, the least and most along a side of the picture, samples of each, and of a pixel that has a region.
const PIXELS: f64 = 256.0;
const SIDES: (f64, f64) = (8.0, 24.0);
const TRIED: u32 = 8;
const TRIED_THERE: u32 = 4;

/// What a path of lamps alone takes of one that is followed to its end.
const COST: f64 = 0.25;

impl Begun {
    /// Adds the light of lamps from the region of a pixel, as far as the filter of its own holds it, and enters it in a `ledger` if there
    /// is one. The less of it can count, the fewer paths.
    #[inline(never)]
    pub(in crate::transport) fn add_lamps(
        &mut self,
        (pixel, region): ([i32; 2], &Region),
        shot: &Shot,
        ledger: Option<&Ledger>,
    ) {
        let Integrator::Path(settings) = &shot.plan.integrator else { return };
        let own = self.at.on_picture();
        let corner = DVec2::from(pixel.map(f64::from));
        let middle = DVec2::from(own.map(f64::from)) + 0.5;
        let nearest = shot.filter.value(own, middle.clamp(corner, corner + 1.0));
        let part = (nearest / shot.filter.value(pixel, corner + 0.5)).min(1.0);
        let expected = (f64::from(region.paths) * part).max(FEWEST_PATHS);
        let most = expected.ceil() as u32;
        let share = region.area() / expected;

        let away = [0, 1].map(|axis| (pixel[axis] - own[axis]) as u64);
        let stream = STREAM ^ away[0].wrapping_mul(STREAMS[0]) ^ away[1].wrapping_mul(STREAMS[1]);
        let sampler = |i: u32| {
            let index = self.at.index.wrapping_mul(most).wrapping_add(i);
            Sampler::new(shot.seed ^ stream, self.at.pixel, self.at.replicate, index)
        };
        let of_one = ledger.map(|_| Ledger::new(shot.scene.light_groups.count().into()));
        let (mut radiance, mut events) = (Lanes::ZERO, 0);
        let count = (expected + pairs(sampler(0).set(Set::Camera)).1.y) as u32;
        for sampler in (0..count).map(sampler) {
            let place = corner + region.place(pairs(sampler.set(Set::Camera)).0);
            let share = (share * shot.filter.value(own, place)) as f32;
            if share == 0.0 {
                continue;
            }
            let found = self.lamps(place, shot, settings, &sampler, of_one.as_ref());
            radiance += found.radiance * share;
            events += found.events;
            if let (Some(all), Some(one)) = (ledger, &of_one) {
                all.add(one, share);
                one.clear();
            }
        }
        self.sample.radiance += radiance;
        self.events += events;
    }

    /// The light of lamps along a path from a place on the picture, entered in a blank `ledger` if there is one.
    fn lamps(
        &self,
        place: DVec2,
        shot: &Shot,
        settings: &PathSettings,
        sampler: &Sampler,
        ledger: Option<&Ledger>,
    ) -> Incoming {
        let Shot { scene, plan, .. } = *shot;
        let ray = scene.camera.ray(place, || DVec2::splat(0.5));
        let ray = (&ray, Sought::Lamps);
        let found = path::radiance(scene, plan, settings, sampler, &self.sample.wavelengths, ray, None, ledger);
        let Some(fog) = shot.fog(&plan.integrator) else { return found };
        let through = 1.0 - fog.falloff.amount(found.depth) as f32;
        if let Some(ledger) = ledger {
            ledger.scale(through);
        }
        Incoming { radiance: found.radiance * through, ..found }
    }
}

/// Luminance, in units of the film, that the path of a sample finds beside lamps that it meets before anything scatters it.
fn rest(shot: &Shot, at: Address) -> f64 {
    let sampler = Sampler::new(shot.seed, at.pixel, at.replicate, at.index);
    let mut begun = Begun::blank();
    begun.begin(shot, at, &sampler);
    begun.apart = true;
    let integrator = &shot.plan.integrator;
    let rest = begun.light(shot, &sampler, integrator, shot.fog(integrator), None);
    f64::from(observer::xyz(rest.radiance * shot.scene.light_unit(), &begun.sample.wavelengths)[1])
}

/// What a picture is like.
pub(super) struct Typical {
    /// Mean luminance, in units of the film.
    pub(super) mean: f64,
    /// Added to the square of a value: see [`floor_about`].
    floor: f64,
    /// Mean relative variance of the luminance of a sample.
    variance: f64,
}

impl Typical {
    pub(super) fn of(shot: &Shot) -> Typical {
        let shot = &Shot { seed: shot.seed ^ STREAM, ..*shot };
        let [width, height] = shot.scene.camera.resolution.map(f64::from);
        let side = (width * height / PIXELS).sqrt().clamp(SIDES.0, SIDES.1) as usize;
        let of_block = |block: usize| {
            let place = place_in(shot.scene, side, block, DVec2::splat(0.5));
            let mut sums = [0.0; 2];
            for index in 0..TRIED {
                let (sample, _) = transport::sample(shot, [place.x as u32, place.y as u32], 0, index);
                let luminance = f64::from(sample.xyz[1]);
                sums = [sums[0] + luminance, sums[1] + luminance * luminance];
            }
            mean_and_variance(sums, TRIED)
        };
        let tried: Vec<[f64; 2]> = (0..side * side).into_par_iter().map(of_block).collect();
        let all = tried.len() as f64;
        let mean = tried.iter().map(|[mean, _]| mean).sum::<f64>() / all;
        let floor = floor_about(mean);
        let relative = |[mean, variance]: &[f64; 2]| if floor > 0.0 { variance / (mean * mean + floor) } else { 0.0 };
        let variance = tried.iter().map(relative).sum::<f64>() / all;
        Typical { mean, floor, variance }
    }

    /// Whether the paths of a region gain more than as many would that are spread over the picture.
    pub(super) fn pays(&self, shot: &Shot, (pixel, region, expected): &Found) -> bool {
        let shot = &Shot { seed: shot.seed ^ STREAM, ..*shot };
        let address = |index| Address { pixel: address(*pixel), replicate: 0, index };
        let rest = (0..TRIED_THERE).map(|index| rest(shot, address(index))).sum::<f64>() / f64::from(TRIED_THERE);
        let unit = f64::from(shot.scene.light_unit());
        let (value, variance) = (rest + unit * expected.mean, unit * unit * expected.square);
        variance > (value * value + self.floor) * COST * f64::from(region.paths) * self.variance
    }
}

/// Mean and variance of `count` numbers, given their sum and that of their squares.
fn mean_and_variance([sum, squares]: [f64; 2], count: u32) -> [f64; 2] {
    let n = f64::from(count);
    [sum / n, ((squares - sum * sum / n) / (n - 1.0)).max(0.0)]
}
