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

use crate::math::sampler::{Sampler, Set, mix64};
use crate::spectrum::{LANES, Lanes};
use glam::DVec3;

/// Light that came to a surface.
#[derive(Clone, Copy, Debug)]
pub struct Photon {
    /// Where.
    pub point: DVec3,
    /// Toward where it came from, unit.
    pub came: DVec3,
    /// True normal there, on either side.
    pub normal: DVec3,
    /// Spectral power over the hero's density, W·nm⁻¹.
    pub power: Lanes,
    /// Density of each lane over the hero's.
    pub rho: Lanes,
    /// Vertices of its path before.
    pub vertices: u32,
    /// The group of its lamp.
    pub group: u8,
}

/// The photons of one sample.
#[derive(Debug, Default)]
pub struct PhotonMap {
    radius: f64,
    /// Paths that were followed for them.
    paths: f64,
    /// Where the photons of each bucket begin, and the end of the last.
    starts: Vec<u32>,
    /// By bucket; in one bucket in the order in which they were left.
    photons: Vec<Photon>,
}

impl PhotonMap {
    /// Sorts the photons of `paths` paths for collecting within `radius` metres.
    #[must_use]
    pub fn new(photons: &[Photon], paths: u64, radius: f64) -> PhotonMap {
        let buckets = photons.len().max(1).next_power_of_two();
        let bucket = |p: &Photon| bucket(cell(p.point, radius), buckets);
        let mut starts = vec![0u32; buckets + 1];
        for p in photons {
            starts[bucket(p) + 1] += 1;
        }
        for i in 0..buckets {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut order = vec![0u32; photons.len()];
        for (i, p) in photons.iter().enumerate() {
            let slot = &mut next[bucket(p)];
            order[*slot as usize] = i as u32;
            *slot += 1;
        }
        let photons = order.iter().map(|&i| photons[i as usize]).collect();
        PhotonMap { radius, paths: paths as f64, starts, photons }
    }

    /// Light by area that the photons around `point` bring, through `scatter`: f of each from where it came, per
    /// unit of its power. `normal` is the true one, on either side.
    #[must_use]
    pub fn gather(&self, point: DVec3, normal: DVec3, mut scatter: impl FnMut(&Photon) -> Lanes) -> Lanes {
        let mut sum = Lanes::ZERO;
        self.each_near(point, normal, |photon| sum += scatter(photon) * photon.power);
        sum * (1.0 / (std::f64::consts::PI * self.radius * self.radius * self.paths)) as f32
    }

    /// Shows `visit` the photons around `point` on a surface of `normal`.
    pub fn each_near(&self, point: DVec3, normal: DVec3, mut visit: impl FnMut(&Photon)) {
        if self.photons.is_empty() {
            return;
        }
        let buckets = self.starts.len() - 1;
        let r2 = self.radius * self.radius;
        // Cells are two radii wide: the ball meets two along each axis.
        let low = cell(point - self.radius, self.radius);
        let high = cell(point + self.radius, self.radius);
        // A third where rounding puts one on an edge.
        let mut seen = [usize::MAX; 27];
        let mut count = 0;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let b = bucket([x, y, z], buckets);
                    // Two cells may share a bucket, which counts once.
                    if seen[..count].contains(&b) {
                        continue;
                    }
                    seen[count] = b;
                    count += 1;
                    for photon in &self.photons[self.starts[b] as usize..self.starts[b + 1] as usize] {
                        let offset = photon.point - point;
                        // What lies around a corner or on the other side of a sheet is another surface.
                        if offset.length_squared() <= r2 && photon.normal.dot(normal).abs() > FACING {
                            visit(photon);
                        }
                    }
                }
            }
        }
    }
}

/// Least cosine between normals of one surface.
const FACING: f64 = 0.7;

fn cell(point: DVec3, radius: f64) -> [i32; 3] {
    // As numbers out of range become the ends of the range, far things share cells; they are told apart by distance.
    (point / (2.0 * radius)).floor().to_array().map(|x| x as i32)
}

fn bucket([x, y, z]: [i32; 3], buckets: usize) -> usize {
    let key = mix64(u64::from(x as u32) << 32 | u64::from(y as u32));
    (mix64(key ^ u64::from(z as u32)) as usize) & (buckets - 1)
}

/// What the paths of one sample share where photons are collected.
#[derive(Clone, Copy, Debug)]
pub struct Collection<'a> {
    /// The photons.
    pub map: &'a PhotonMap,
    /// Chooses the wavelengths, in [0, 1).
    pub wavelength: f64,
}

/// Chooses the wavelengths of sample `index` of `replicate`. The eight of a sample are an eighth apart: where they
/// begin in an eighth and which of them leads are two dimensions of one low-discrepancy sequence.
#[must_use]
pub fn shared_wavelength(seed: u64, replicate: u32, index: u32) -> f64 {
    let u = Sampler::new(seed ^ STREAM, [0, 0], replicate, index).set(Set::Camera);
    let lanes = LANES as f64;
    (u[0] + (u[1] * lanes).floor()) / lanes
}

/// The numbers in [0, 1) that choose wavelengths near to shared ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WavelengthCell {
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
        WavelengthCell { start: u, width: 0.0 }
    }

    /// The cell that holds `u`, of as many as the largest power of two among the samples of a replicate in each eighth
    /// of the band: [`shared_wavelength`] comes to each.
    #[must_use]
    pub fn around(u: f64, samples: u32) -> WavelengthCell {
        let cells = f64::from(LANES as u32 * (1 << samples.max(CELLS).ilog2()));
        WavelengthCell { start: (u * cells).floor() / cells, width: 1.0 / cells }
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

    fn photons(n: u32) -> Vec<Photon> {
        (0..n)
            .map(|i| {
                let u = Sampler::new(7, [0, 0], 0, i).set(Set::Camera);
                let point = DVec3::new(4.0 * u[0] - 2.0, 0.0, 4.0 * u[1] - 2.0);
                Photon {
                    point,
                    came: DVec3::Y,
                    normal: DVec3::Y,
                    power: Lanes::splat(1.0 + u[2] as f32),
                    rho: Lanes::ONE,
                    vertices: 1,
                    group: 0,
                }
            })
            .collect()
    }

    /// What is collected is what all photons within the radius sum to, wherever cells and buckets lie.
    #[test]
    fn each_photon_within_the_radius_is_collected_once() {
        let all = photons(3000);
        for radius in [0.01, 0.3, 5.0] {
            let map = PhotonMap::new(&all, 3000, radius);
            for i in 0..50 {
                let point = DVec3::new(f64::from(i) * 0.07 - 1.7, 0.001, 0.9 - f64::from(i) * 0.031);
                let near = all.iter().filter(|p| (p.point - point).length_squared() <= radius * radius);
                let expected: f64 = near.map(|p| f64::from(p.power.to_array()[0])).sum();
                let expected = expected / (std::f64::consts::PI * radius * radius * 3000.0);
                let found = f64::from(map.gather(point, DVec3::Y, |_| Lanes::ONE).to_array()[0]);
                // Sums of up to 3000 numbers in f32 in another order.
                assert!((found - expected).abs() <= 3000.0 * f64::from(f32::EPSILON) * expected, "{found} {expected}");
            }
        }
    }

    /// A uniform shower of unit mean power 1.5 on 16 m² has 1.5/16 by area, in the mean over places; in one place of
    /// radius 0.5 there are 147 of 3000 photons, evenly laid.
    #[test]
    fn a_shower_has_its_density() {
        let map = PhotonMap::new(&photons(3000), 3000, 0.5);
        let found = f64::from(map.gather(DVec3::ZERO, DVec3::Y, |_| Lanes::ONE).to_array()[0]);
        // Low-discrepancy points err less than the 8 % of independent ones.
        assert!((found / (1.5 / 16.0) - 1.0).abs() < 0.08, "{found}");
        assert_eq!(map.gather(DVec3::ZERO, DVec3::X, |_| Lanes::ONE).to_array()[0], 0.0);
    }

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
