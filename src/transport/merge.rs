//! Caustics that are seen in mirrors and through glass: paths E S⁺ D … S L, which neither paths from the camera
//! (they must hit the lamp by chance) nor paths from the lights (they must hit the lens by chance) can find.
//!
//! Paths from the lights leave photons where they scatter; a path from the camera that has seen mirrors and glass only
//! collects those within a radius of its first other vertex, as if they had come there (Jensen 1996). The light is
//! blurred by the radius, which shrinks from sample to sample so that the blur of the mean goes to zero while its noise
//! does, too: r_i = r_0 i^(−1/6) (Knaus and Zwicker 2011, eq. 21 with α = 2/3). All other light stays unbiased.
//!
//! Photons of one sample are collected by that sample's paths of all pixels, so both share their wavelengths. Where these
//! part in glass, so few of them would make lines of a spectrum, also of the light that the camera sees itself: there each
//! path has wavelengths of its own within a cell around the shared ones. The cells of all samples fill the band, so that
//! light which is not merged stays as it was, and what is merged is blurred by one of them over wavelength; they are the
//! narrower the more samples there are.
//!
//! While the shutter is open all paths of a sample see one moment, too: light is collected where it came to. With fewer
//! samples than moments single pictures may show.

use super::moment_at;
use super::photons::PhotonMap;
use crate::math::sampler::{Sampler, Set};
use crate::spectrum::LANES;

/// What the paths of one sample share where photons are collected.
#[derive(Clone, Copy, Debug)]
pub struct Collection<'a> {
    /// The photons.
    pub map: &'a PhotonMap,
    /// Chooses the wavelengths, in [0, 1).
    pub wavelength: f64,
    /// Which of the moments while the shutter is open all see, where there are any.
    pub moment: Option<usize>,
}

/// Chooses the wavelengths of sample `index` of `replicate`. The eight of a sample are an eighth apart: where they
/// begin in an eighth and which of them leads are two dimensions of one low-discrepancy sequence.
#[must_use]
pub fn shared_wavelength(seed: u64, replicate: u32, index: u32) -> f64 {
    let u = Sampler::new(seed ^ STREAM, [0, 0], replicate, index).set(Set::Camera);
    let lanes = LANES as f64;
    (u[0] + (u[1] * lanes).floor()) / lanes
}

/// Which of `moments` the paths of sample `index` of `replicate` see, as evenly spread as their wavelengths.
#[must_use]
pub fn shared_moment(seed: u64, replicate: u32, index: u32, moments: usize) -> usize {
    moment_at(Sampler::new(seed ^ STREAM, [0, 0], replicate, index).set(Set::Camera)[2], moments)
}

/// The numbers in [0, 1) that choose wavelengths near to shared ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WavelengthCell {
    /// The one that is shared.
    pub shared: f64,
    /// The first of them.
    pub start: f64,
    /// How far they go.
    pub width: f64,
}

/// Cells in an eighth of the band at the least.
const CELLS: u32 = 4;

impl WavelengthCell {
    /// The one number `u`.
    #[must_use]
    pub fn point(u: f64) -> WavelengthCell {
        WavelengthCell { shared: u, start: u, width: 0.0 }
    }

    /// The cell that holds `u`, of as many as the largest power of two among the samples of a replicate in each eighth
    /// of the band: [`shared_wavelength`] comes to each.
    #[must_use]
    pub fn around(u: f64, samples: u32) -> WavelengthCell {
        let cells = f64::from(LANES as u32 * (1 << samples.max(CELLS).ilog2()));
        WavelengthCell { shared: u, start: (u * cells).floor() / cells, width: 1.0 / cells }
    }

    /// Its number at `u` of [0, 1).
    #[must_use]
    pub fn at(&self, u: f64) -> f64 {
        self.start + self.width * u
    }
}

/// Tells these numbers from all others.
const STREAM: u64 = 0x7068_6f74_6f6e_7300;

/// The radius for sample `index` of a replicate, counted from 0.
#[must_use]
pub fn radius(first: f64, index: u32) -> f64 {
    first * libm::pow(f64::from(index) + 1.0, -1.0 / 6.0)
}

/// The radius of the disc that blurs as much as those of the first `samples` of a replicate do in the mean: the error
/// that blur makes is proportional to its square.
#[must_use]
pub fn mean_radius(first: f64, samples: u32) -> f64 {
    let squares: f64 = (0..samples).map(|i| radius(first, i).powi(2)).sum();
    (squares / f64::from(samples)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 64 samples of a replicate, the eight lanes of each fall into 512 equal parts of the unit interval once each, and
    /// each of 8 consecutive samples is led from another eighth.
    #[test]
    fn shared_wavelengths_are_evenly_spread() {
        for replicate in 0..4 {
            let all: Vec<f64> = (0..64).map(|i| shared_wavelength(3, replicate, i)).collect();
            let lanes = all.iter().flat_map(|u| (0..8).map(move |k| (u + f64::from(k) / 8.0).fract()));
            let mut parts: Vec<usize> = lanes.map(|u| (u * 512.0) as usize).collect();
            parts.sort_unstable();
            assert!(parts.iter().enumerate().all(|(i, part)| i == *part));
            for eight in all.chunks(8) {
                let mut leads: Vec<usize> = eight.iter().map(|u| (u * 8.0) as usize).collect();
                leads.sort_unstable();
                assert_eq!(leads, [0, 1, 2, 3, 4, 5, 6, 7]);
            }
        }
    }

    /// Of 32 samples of a replicate, each of 32 moments is seen by one.
    #[test]
    fn shared_moments_are_evenly_spread() {
        for replicate in 0..4 {
            let mut all: Vec<usize> = (0..32).map(|i| shared_moment(3, replicate, i, 32)).collect();
            all.sort_unstable();
            assert!(all.iter().enumerate().all(|(i, moment)| i == *moment), "{all:?}");
        }
    }

    /// Of 16 samples of a replicate, the cells around the eight lanes of each are the 128 of the band, once each.
    #[test]
    fn cells_around_shared_wavelengths_fill_the_band() {
        for replicate in 0..4 {
            let cells = (0..16).map(|i| WavelengthCell::around(shared_wavelength(3, replicate, i), 16 + 15));
            let lanes = cells.flat_map(|cell| (0..8).map(move |k| (cell.at(0.5) + f64::from(k) / 8.0).fract()));
            let mut parts: Vec<usize> = lanes.map(|u| (u * 128.0) as usize).collect();
            parts.sort_unstable();
            assert!(parts.iter().enumerate().all(|(i, part)| i == *part));
        }
        let cell = WavelengthCell::around(0.999, 1);
        assert_eq!((cell.start, cell.at(0.5)), (31.0 / 32.0, 31.5 / 32.0));
    }

    #[test]
    fn the_radius_shrinks_with_the_sixth_root() {
        assert_eq!(radius(2.0, 0), 2.0);
        assert!((radius(2.0, 63) - 1.0).abs() < 1e-15);
        // The mean of 1 and 2^(−1/3), and of i^(−1/3) up to n, 3/2 n^(−1/3) but for ζ(1/3)/n = −0.974/n.
        assert!((mean_radius(2.0, 2).powi(2) / 4.0 - (1.0 + 0.5f64.powf(1.0 / 3.0)) / 2.0).abs() < 1e-15);
        let n = 4096.0f64;
        let expected = 1.5 * n.powf(-1.0 / 3.0) - 0.9733 / n;
        assert!((mean_radius(1.0, 4096).powi(2) / expected - 1.0).abs() < 1e-4);
    }
}
