//! Photons: light that paths from the lights leave where they scatter, and the map in which it is found by place.
//!
//! A photon of wavelengths that went together carries all of them, one of a wavelength that parted from the others only
//! itself: each kind has a list of its own, so that the many of the second kind are half as large. Directions are in f32.

use crate::math::inverse_power_of_two;
use crate::math::sampler::mix64;
use crate::spectrum::Lanes;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Light that came to a surface.
#[derive(Clone, Copy, Debug)]
pub struct Photon<L> {
    /// Where.
    pub point: DVec3,
    /// Toward where it came from, unit.
    pub came: Vec3,
    /// True normal there, on either side.
    pub normal: Vec3,
    /// What it carries.
    pub light: L,
    /// Vertices of its path before.
    pub vertices: u32,
    /// The group of its lamp.
    pub group: u8,
}

/// Wavelengths that went together.
#[derive(Clone, Copy, Debug)]
pub struct Together {
    /// Spectral power over the hero's density, W·nm⁻¹ over [`Photons::unit_area`].
    pub power: Lanes,
    /// Density of each lane over the hero's.
    pub rho: Lanes,
}

/// A wavelength that parted from the others; none led it.
#[derive(Clone, Copy, Debug)]
pub struct Alone {
    /// Spectral power over its density, in the same unit.
    pub power: f32,
    /// Which.
    pub lane: u8,
}

/// What a photon carries.
pub trait Light: Copy + Send + Sync {
    /// As all lanes.
    fn together(&self) -> Together;
}

impl Light for Together {
    #[inline]
    fn together(&self) -> Together {
        *self
    }
}

impl Light for Alone {
    #[inline]
    fn together(&self) -> Together {
        let power = std::array::from_fn(|k| if k == usize::from(self.lane) { self.power } else { 0.0 });
        Together { power: Lanes::new(power), rho: Lanes::ONE }
    }
}

impl<L: Light> Photon<L> {
    /// With all lanes.
    #[inline]
    #[must_use]
    pub fn together(&self) -> Photon<Together> {
        let Photon { point, came, normal, vertices, group, .. } = *self;
        Photon { point, came, normal, light: self.light.together(), vertices, group }
    }
}

/// Photons in the order in which they were left.
#[derive(Debug)]
pub struct Photons {
    /// By which their powers are told, m².
    pub unit_area: f64,
    /// Of wavelengths that went together.
    pub together: Vec<Photon<Together>>,
    /// Of single ones.
    pub alone: Vec<Photon<Alone>>,
}

impl Photons {
    /// None yet, whose powers are to be told over `unit_area`.
    #[must_use]
    pub fn over(unit_area: f64) -> Photons {
        Photons { unit_area, together: Vec::new(), alone: Vec::new() }
    }

    /// None yet, to be collected within `radius` metres.
    #[must_use]
    pub fn within(radius: f64) -> Photons {
        Photons::over(1.0 / inverse_power_of_two(radius * radius))
    }

    /// All of them, with all lanes.
    pub fn iter(&self) -> impl Iterator<Item = Photon<Together>> {
        self.together.iter().copied().chain(self.alone.iter().map(Photon::together))
    }
}

/// The photons of one sample.
#[derive(Debug)]
pub struct PhotonMap {
    radius: f64,
    /// By which the powers of photons are told, m².
    unit_area: f64,
    /// Paths that were followed for them.
    paths: f64,
    together: Buckets<Together>,
    alone: Buckets<Alone>,
}

impl PhotonMap {
    /// Sorts the photons of `paths` paths, whose powers are told over one area, for collecting within `radius` metres. Who
    /// followed the paths, and in how many `pieces`, makes no difference.
    #[must_use]
    pub fn new(pieces: &[Photons], paths: u64, radius: f64) -> PhotonMap {
        let together: Vec<&[_]> = pieces.iter().map(|p| p.together.as_slice()).collect();
        let alone: Vec<&[_]> = pieces.iter().map(|p| p.alone.as_slice()).collect();
        PhotonMap {
            radius,
            unit_area: pieces.first().map_or(1.0, |piece| piece.unit_area),
            paths: paths as f64,
            together: Buckets::new(&together, radius),
            alone: Buckets::new(&alone, radius),
        }
    }

    /// Light by area that the photons around `point` bring, through `scatter`: f of each from where it came, per
    /// unit of its power. `normal` is the true one, on either side.
    #[must_use]
    pub fn gather(&self, point: DVec3, normal: DVec3, mut scatter: impl FnMut(&Photon<Together>) -> Lanes) -> Lanes {
        let mut sum = Lanes::ZERO;
        self.each_near(point, normal, |photon| sum += scatter(photon) * photon.light.power);
        sum * (self.unit_area / (std::f64::consts::PI * self.radius * self.radius * self.paths)) as f32
    }

    /// Shows `visit` the photons around `point` on a surface of `normal`.
    #[inline]
    pub fn each_near(&self, point: DVec3, normal: DVec3, mut visit: impl FnMut(&Photon<Together>)) {
        let near = Near::new(point, normal, self.radius);
        self.together.each_near(&near, |photon| visit(photon));
        self.alone.each_near(&near, |photon| visit(&photon.together()));
    }
}

/// Photons by place: a hashed grid.
#[derive(Debug)]
struct Buckets<L> {
    /// Where the photons of each bucket begin, and the end of the last.
    starts: Vec<u32>,
    /// By bucket; in one bucket in the order in which they were left.
    photons: Vec<Photon<L>>,
}

impl<L: Light> Buckets<L> {
    fn new(pieces: &[&[Photon<L>]], radius: f64) -> Buckets<L> {
        let count: usize = pieces.iter().map(|piece| piece.len()).sum();
        if count == 0 {
            return Buckets { starts: Vec::new(), photons: Vec::new() };
        }
        let buckets = count.next_power_of_two();
        let of = |piece: &&[Photon<L>]| -> Vec<u32> {
            piece.iter().map(|p| bucket(key(cell(p.point, radius)), buckets) as u32).collect()
        };
        let homes: Vec<Vec<u32>> = pieces.par_iter().map(of).collect();
        let mut starts = vec![0u32; buckets + 1];
        for &home in homes.iter().flatten() {
            starts[home as usize + 1] += 1;
        }
        for i in 0..buckets {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut order = vec![(0u32, 0u32); count];
        for (piece, homes) in homes.iter().enumerate() {
            for (i, &home) in homes.iter().enumerate() {
                let slot = &mut next[home as usize];
                order[*slot as usize] = (piece as u32, i as u32);
                *slot += 1;
            }
        }
        let photons = order.par_iter().map(|&(piece, i)| pieces[piece as usize][i as usize]).collect();
        Buckets { starts, photons }
    }

    #[inline]
    fn each_near(&self, near: &Near, mut visit: impl FnMut(&Photon<L>)) {
        if self.photons.is_empty() {
            return;
        }
        let buckets = self.starts.len() - 1;
        let mut seen = [usize::MAX; MOST_CELLS];
        for (i, &key) in near.keys().iter().enumerate() {
            let b = bucket(key, buckets);
            seen[i] = b;
            // Two cells may share a bucket, which counts once.
            if seen[..i].contains(&b) {
                continue;
            }
            for photon in &self.photons[self.starts[b] as usize..self.starts[b + 1] as usize] {
                if near.holds(photon) {
                    visit(photon);
                }
            }
        }
    }
}

/// Cells are two radii wide, so that a ball meets two along each axis: a third where rounding puts one on an edge.
const MOST_CELLS: usize = 27;

/// Around a point on a surface.
struct Near {
    point: DVec3,
    normal: Vec3,
    radius_squared: f64,
    /// Of the cells that the ball meets; the first `count` are filled.
    keys: [u64; MOST_CELLS],
    count: usize,
}

impl Near {
    fn new(point: DVec3, normal: DVec3, radius: f64) -> Near {
        let normal = normal.as_vec3();
        let mut near = Near { point, normal, radius_squared: radius * radius, keys: [0; MOST_CELLS], count: 0 };
        let low = cell(point - radius, radius);
        let high = cell(point + radius, radius);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    near.keys[near.count] = key([x, y, z]);
                    near.count += 1;
                }
            }
        }
        near
    }

    fn keys(&self) -> &[u64] {
        &self.keys[..self.count]
    }

    /// What lies around a corner is another surface. Both sides of a sheet count: f says what comes through.
    #[inline]
    fn holds<L>(&self, photon: &Photon<L>) -> bool {
        (photon.point - self.point).length_squared() <= self.radius_squared
            && photon.normal.dot(self.normal).abs() > FACING
    }
}

/// Least cosine between normals of one surface.
const FACING: f32 = 0.7;

/// Cells along each axis on either side of the origin: up to there rounding moves a point by less than a quarter of one, so that a
/// ball meets no more than [`MOST_CELLS`]. What is farther shares the last, and is told apart by distance.
const FARTHEST: f64 = (1u64 << 50) as f64;

fn cell(point: DVec3, radius: f64) -> [i64; 3] {
    (point / (2.0 * radius)).floor().to_array().map(|x| x.clamp(-FARTHEST, FARTHEST) as i64)
}

fn key([x, y, z]: [i64; 3]) -> u64 {
    let low = |x: i64| u64::from(x as i32 as u32);
    // What 32 bits do not hold.
    let beyond = |x: i64| (x - i64::from(x as i32)) as u64;
    let plane = mix64(low(x) << 32 | low(y));
    mix64(plane ^ beyond(x).rotate_left(32) ^ beyond(y) ^ low(z) ^ beyond(z))
}

/// The bucket of a cell's key, of as many as a power of two.
fn bucket(key: u64, buckets: usize) -> usize {
    key as usize & (buckets - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{Sampler, Set};

    /// On 16 m², of power 1 to 2: every third of one lane, in pieces of 1000.
    fn photons(n: u32) -> Vec<Photons> {
        let mut pieces = Vec::new();
        for i in 0..n {
            if i % 1000 == 0 {
                pieces.push(Photons::over(1.0));
            }
            let u = Sampler::new(7, [0, 0], 0, i).set(Set::Camera);
            let point = DVec3::new(4.0 * u[0] - 2.0, 0.0, 4.0 * u[1] - 2.0);
            let power = 1.0 + u[2] as f32;
            let (came, normal, vertices, group) = (Vec3::Y, Vec3::Y, 1, 0);
            let Some(piece) = pieces.last_mut() else { continue };
            if i % 3 == 0 {
                let light = Alone { power, lane: 0 };
                piece.alone.push(Photon { point, came, normal, light, vertices, group });
            } else {
                let light = Together { power: Lanes::splat(power), rho: Lanes::ONE };
                piece.together.push(Photon { point, came, normal, light, vertices, group });
            }
        }
        pieces
    }

    /// What is collected is what all photons within the radius sum to, wherever cells and buckets lie; lane 0 from both
    /// kinds, lane 7 from those that carry it.
    #[test]
    fn each_photon_within_the_radius_is_collected_once() {
        let pieces = photons(3000);
        let all: Vec<Photon<Together>> = pieces.iter().flat_map(Photons::iter).collect();
        for radius in [0.01, 0.3, 5.0] {
            let map = PhotonMap::new(&pieces, 3000, radius);
            for i in 0..50 {
                let point = DVec3::new(f64::from(i) * 0.07 - 1.7, 0.001, 0.9 - f64::from(i) * 0.031);
                let found = map.gather(point, DVec3::Y, |_| Lanes::ONE).to_array();
                for lane in [0, 7] {
                    let near = all.iter().filter(|p| (p.point - point).length_squared() <= radius * radius);
                    let expected: f64 = near.map(|p| f64::from(p.light.power.to_array()[lane])).sum();
                    let expected = expected / (std::f64::consts::PI * radius * radius * 3000.0);
                    let found = f64::from(found[lane]);
                    // Sums of up to 3000 numbers in f32 in another order.
                    assert!(
                        (found - expected).abs() <= 3000.0 * f64::from(f32::EPSILON) * expected,
                        "{found} {expected}"
                    );
                }
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

    /// Far from the origin, in cells of which 32 bits cannot count as many as there are from there, photons lie in as many buckets as
    /// near it: 6667 in 8192 buckets at random, of which none holds as many as 16 but once in 10⁹ (Poisson).
    #[test]
    fn photons_far_from_the_origin_do_not_share_a_bucket() {
        for away in [0.0, 1e3, 1e6, -1e9] {
            let mut pieces = photons(10_000);
            for photon in pieces.iter_mut().flat_map(|piece| &mut piece.together) {
                photon.point += DVec3::new(away, 0.5 * away, -away);
            }
            let map = PhotonMap::new(&pieces, 10_000, 1e-4);
            let fullest = map.together.starts.windows(2).map(|pair| pair[1] - pair[0]).max();
            assert!(fullest.is_some_and(|count| count < 16), "{away}: {fullest:?}");
        }
    }

    /// A photon of one wavelength takes half the room of one of eight.
    #[test]
    fn photons_are_small() {
        assert_eq!([size_of::<Photon<Alone>>(), size_of::<Photon<Together>>()], [64, 128]);
    }
}
