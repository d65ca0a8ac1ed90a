//! Whether wavelengths that part at the glass before the camera are worth following together.
//!
//! Where they part, the light of a hero is rare and eight times as bright: at some places of the picture most of its variance is in
//! light that few samples meet, and a few samples more or less of it would decide. So heroes are not asked by themselves. What the
//! eight bring in a packet is what eight heroes would, each by itself, and both variances are told from the same light.

use super::{MOST, STREAM, decided, judge};
use crate::film::accumulate::REPLICATES;
use crate::film::error::floor_about;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::math::statistics::Moments;
use crate::spectrum::{ColourSpace, LANES, Lanes, SampledWavelengths, observer};
use crate::transport::pilot::Use;
use crate::transport::plan::{Effect, EffectPlan, Integrator};
use crate::transport::{Shot, place_in, probe};
use glam::DVec3;
use rayon::prelude::*;

/// Pixels for each place that is tried, and the least and most places along a side of the picture.
const PIXELS: f64 = 256.0;
const SIDES: (f64, f64) = (8.0, 32.0);
/// What a ray of eight that go side by side costs of one that goes alone, as measured: they meet the same things.
const SIDE_BY_SIDE: f64 = 0.8;
/// Packets are taken unless the trial is sure, by [`SURE`] standard errors, of this ratio. Rare light that it does not meet speaks for
/// them: where it told 1.06 to 1.68 (prism), 0.98 to 1.41 (crystal), 0.44 to 1.08 (diamond) and 0.16 to 1.00 (spectroscope), by seed,
/// each give or take 0.1 to 0.3, renders told 0.30, 0.54, 0.21 and 0.82. Without any, behind a window before a room that is lit
/// indirectly, it tells 1.6, give or take 0.02, of 1.9.
const UNSEEN: f64 = 1.4;
const SURE: f64 = 2.0;

/// What a replicate of a place shows, in linear Rec. 709: by packets, and by heroes that are each lane in turn.
#[derive(Clone, Copy, Default)]
struct Shown {
    together: DVec3,
    alone: [DVec3; LANES],
    /// Rays of either.
    rays: [f64; 2],
}

/// Whether packets pay, and what to say of it; nothing where no smooth glass disperses.
#[must_use]
pub fn packets(shot: &Shot, samples: u32, wish: Use) -> Option<(bool, Effect)> {
    let Shot { scene, plan, seed, .. } = *shot;
    let Integrator::Path(_) = &plan.integrator else { return None };
    if !plan.packets {
        return None;
    }
    let said = |on, reason| Some((on, Effect { name: "wavelength packets from the camera".into(), on, reason }));
    if let Some(on) = decided(wish) {
        return said(on, "the scene says so".into());
    }
    let each = (samples / REPLICATES as u32).clamp(1, MOST);
    let [alone, together] = [false, true].map(|packets| EffectPlan { packets, ..plan.clone() });
    let shots = [&alone, &together].map(|plan| Shot { plan, seed: seed ^ STREAM, ..*shot });
    let [width, height] = scene.camera.resolution.map(f64::from);
    let side = (width * height / PIXELS).sqrt().clamp(SIDES.0, SIDES.1) as usize;
    let places: Vec<[Shown; REPLICATES]> = (0..side * side)
        .into_par_iter()
        .map(|k| {
            let u = pairs(Sampler::new(seed ^ STREAM, [k as u32, 0], 0, 0).set(Set::Lens)).0;
            let place = place_in(scene, side, k, u);
            std::array::from_fn(|replicate| show(&shots, [place.x as u32, place.y as u32], replicate as u32, each))
        })
        .collect();
    let [alone, together] = [0, 1].map(|way| places.iter().flatten().map(|shown| shown.rays[way]).sum::<f64>());
    if alone == together {
        return said(false, "no path from the camera parts".into());
    }
    let [ratio, error] = variances(&places).map(|x| SIDE_BY_SIDE * together / alone * x);
    // What all comes from one place is certain of nothing.
    let error = if error.is_nan() { f64::INFINITY } else { error };
    let (on, reason) = judge(ratio, UNSEEN + SURE * error);
    said(on, if on && ratio > 1.0 { format!("{reason}, and less where it has not met rare light") } else { reason })
}

/// The samples of a replicate of a pixel, by heroes and by packets, both by the same numbers.
fn show(shots: &[Shot; 2], pixel: [u32; 2], replicate: u32, each: u32) -> Shown {
    let mut shown = Shown::default();
    for index in 0..each {
        let [(hero, wavelengths), (packet, _)] = shots.each_ref().map(|shot| probe(shot, pixel, replicate, index));
        // A ray to the next vertex and one to a light from each.
        for (rays, way) in shown.rays.iter_mut().zip([&hero, &packet]) {
            *rays += f64::from(1 + 2 * way.events);
        }
        let share = shots[0].scene.light_unit() / each as f32;
        let colour = |light: Lanes| colour(light * share, &wavelengths);
        shown.together += colour(packet.radiance);
        if hero.radiance == packet.radiance {
            let colour = colour(hero.radiance);
            shown.alone.iter_mut().for_each(|sum| *sum += colour);
        } else {
            let heroes = heroes(hero.radiance.to_array(), packet.radiance.to_array());
            for (sum, light) in shown.alone.iter_mut().zip(heroes) {
                *sum += colour(Lanes::new(light));
            }
        }
    }
    shown
}

fn colour(light: Lanes, wavelengths: &SampledWavelengths) -> DVec3 {
    DVec3::from(ColourSpace::Rec709.from_xyz(observer::xyz(light, wavelengths)).map(f64::from))
}

/// What a hero would bring were it each lane in turn, of what lane 0 brings as one and of what the same numbers bring in a packet.
///
/// With E what all lanes bring before they part, B what each brings from there to the first thing that scatters it, as a packet
/// counts it, and A what the one that goes on brings after that, of all of them, a hero brings E₀ + 8 B₀ + A and E of the other lanes, and a
/// packet E₀ + B₀ + A and E + B.
fn heroes(hero: [f32; LANES], packet: [f32; LANES]) -> [[f32; LANES]; LANES] {
    const ALL: f32 = LANES as f32;
    let mut rest = hero;
    rest[0] = packet[0] - (hero[0] - packet[0]) / (ALL - 1.0);
    std::array::from_fn(|lane| {
        if lane == 0 {
            return hero;
        }
        let mut light = rest;
        light[lane] += ALL * (packet[lane] - hero[lane]);
        light
    })
}

/// The variance of packets over that of heroes, relative as that of a picture is, and the standard error of that, by leaving out each place
/// in turn (jackknife): where one has most of both, nothing is certain. Not numbers where neither has any.
fn variances(places: &[[Shown; REPLICATES]]) -> [f64; 2] {
    let mean = |a: &Shown, b: &Shown| 0.5 * (a.together + b.together);
    let all = places.iter().map(|[a, b, c, d]| mean(a, b) + mean(c, d)).sum::<DVec3>();
    let floor = floor_about(all.element_sum() / (6 * places.len()) as f64);
    let of = |[a, b, c, d]: &[Shown; REPLICATES]| {
        [(a, b, mean(c, d)), (c, d, mean(a, b))].into_iter().fold([0.0; 2], |[together, alone], (a, b, mean)| {
            // Where light is rare its own brightness would make it weigh little: what weighs it is told by other samples.
            let square = |difference: DVec3| (difference * difference / (mean * mean + floor)).element_sum();
            let lanes = (0..LANES).map(|lane| square(a.alone[lane] - b.alone[lane])).sum::<f64>();
            [together + square(a.together - b.together), alone + lanes / LANES as f64]
        })
    };
    let each: Vec<[f64; 2]> = places.iter().map(of).collect();
    let [together, alone] = [0, 1].map(|way| each.iter().map(|both| both[way]).sum::<f64>());
    let others: Moments = each.iter().map(|[t, a]| (together - t) / (alone - a)).collect();
    [together / alone, (each.len() - 1) as f64 * others.standard_error()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever each lane brings before and after the wavelengths part, lane by lane as one that goes on brings it: heroes bring in the
    /// mean what the packet brings. Numbers that f32 holds, so nothing is rounded but a division by seven.
    #[test]
    fn heroes_bring_in_the_mean_what_the_packet_brings() {
        let before = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0];
        for (parted, on) in [
            ([0.0; 8], 0.0),
            ([2.0, 7.0, 1.0, 8.0, 0.0, 8.0, 1.0, 8.0], 0.0),
            ([0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0], 24.0),
        ] {
            let (mut hero, mut packet): ([f32; 8], [f32; 8]) = (before, std::array::from_fn(|i| before[i] + parted[i]));
            hero[0] += 8.0 * parted[0] + on;
            packet[0] += on;
            let heroes = heroes(hero, packet);
            assert_eq!(heroes[0], hero);
            for lane in 0..LANES {
                let mean = heroes.iter().map(|light| light[lane]).sum::<f32>() / 8.0;
                assert!((mean - packet[lane]).abs() <= 4.0 * f32::EPSILON * packet[lane], "{lane}: {mean}, {packet:?}");
            }
        }
    }

    /// Light that one lane of eight brings to one replicate of a place has eight times the variance where heroes bring it; where all
    /// lanes bring the same there is none to gain.
    #[test]
    fn rare_light_of_single_wavelengths_is_an_eighth_as_noisy_in_packets() {
        let lit = |each: [f64; LANES], packet: f64| Shown {
            together: DVec3::splat(packet),
            alone: each.map(DVec3::splat),
            rays: [1.0; 2],
        };
        let dark = Shown::default();
        let [eighth, one] = [[8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0; LANES]];
        let places = |light: Shown| vec![[dark; REPLICATES], [dark, light, dark, dark], [dark; REPLICATES]];
        assert!((variances(&places(lit(eighth, 1.0)))[0] - 0.125).abs() < 1e-12);
        assert!((variances(&places(lit(one, 1.0)))[0] - 1.0).abs() < 1e-12);
        assert!(variances(&places(dark))[0].is_nan());
        // Told by one place, it is known of no other; by many that are alike, of all.
        assert!(variances(&places(lit(one, 1.0)))[1].is_nan());
        let alike = vec![[dark, lit(eighth, 1.0), dark, dark]; 9];
        assert!(variances(&alike)[1] < 1e-12);
        // Of nine places of which one has a ratio of one and the others an eighth: leaving that out takes all that is not an eighth.
        let mixed = [alike[..8].to_vec(), vec![[dark, lit(one, 1.0), dark, dark]]].concat();
        let [ratio, error] = variances(&mixed);
        assert!(ratio > 0.125 && (error / (ratio - 0.125) - 1.0).abs() < 0.2, "{ratio} {error}");
    }
}
