//! Spectra that vary through space: grids of numbers or colours, and constants.
//!
//! A grid fills the unit cube of its own space, voxel (0, 0, 0) at the origin; voxel centres lie at
//! (i + ½)/n. Beyond the cube it goes on by its wrap, as far as the smallest axis-parallel box
//! about the cube in the world, where a medium made of it ends (the convention of Mitsuba 3).
//!
//! Colours become spectra voxel by voxel: a sigmoid (`spectrum::upsample`) of the colour over twice its
//! largest channel, times that scale. Between voxels the sigmoids and the scales are interpolated
//! each on its own, then multiplied (the convention of Mitsuba 3).

mod bounds;

pub use bounds::{Bounds, March, Stretch};

use super::texture::{Wrap, even_shares, mean_luminance, outside, spread};
use crate::spectrum::luminance::REC709_OF_MITSUBA;
use crate::spectrum::{Carried, Lanes, Spectrum, upsample};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use std::ops::RangeInclusive;
use std::sync::{Arc, OnceLock};

/// A spectrum at every point of space.
#[derive(Clone, Debug)]
pub enum Volume {
    /// The same everywhere.
    Constant {
        /// The spectrum.
        value: Spectrum,
        /// Where it is, as an extinction of a heterogeneous medium: the unit cube of this space.
        local_from_world: DAffine3,
    },
    /// By a grid.
    Grid(Arc<GridVolume>),
}

/// What lies between voxel centres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Between {
    /// The mean of the eight around, by distance.
    #[default]
    Trilinear,
    /// The voxel in which the point lies.
    Nearest,
}

/// Values on a regular grid.
#[derive(Clone, Debug)]
pub struct GridVolume {
    /// Voxels in x, y, z.
    pub size: [usize; 3],
    /// By voxel, x fastest.
    pub values: Voxels,
    /// From the world to the space in which the grid is the unit cube.
    pub local_from_world: DAffine3,
    /// Between voxel centres.
    pub between: Between,
    /// Beyond the cube.
    pub wrap: Wrap,
    /// Whether spectra of strong colours may exceed 1 where they are shares of light.
    pub above_one: bool,
    /// Whether they are, and may not.
    pub clamped: bool,
    /// The voxel with the most light, once that is asked for.
    pub brightest: OnceLock<Option<usize>>,
}

/// The numbers of a grid, which all that is made of one file shares.
#[derive(Clone, Debug)]
pub enum Voxels {
    /// The same at every wavelength.
    Grey(Arc<[f32]>),
    /// Sigmoid coefficients and scale.
    Coloured(Arc<[[f32; 4]]>),
    /// Three numbers that are no colour; a scalar of them is their luminance.
    Raw(Arc<[[f32; 3]]>),
}

/// A grid as its file has it, in no place yet.
#[derive(Clone, Debug)]
pub struct Unplaced {
    /// Voxels in x, y, z.
    pub size: [usize; 3],
    /// Lower corner of the box that the file names.
    pub min: DVec3,
    /// Upper corner of it.
    pub max: DVec3,
    /// By voxel, x fastest.
    pub values: Voxels,
}

impl Voxels {
    /// Colours as spectra.
    #[must_use]
    pub fn upsampled(colours: &[[f32; 3]], carried: Carried) -> Voxels {
        let voxel = |&rgb: &[f32; 3]| {
            let scale = 2.0 * rgb[0].max(rgb[1]).max(rgb[2]);
            // Black is a spectrum of zero, not one of grey times zero: its neighbours are mixed with it.
            let [a, b, c] = carried.coefficients(if scale > 0.0 { rgb.map(|v| v / scale) } else { [0.0; 3] });
            [a, b, c, scale]
        };
        let voxels: Vec<[f32; 4]> = colours.par_iter().map(voxel).collect();
        Voxels::Coloured(voxels.into())
    }
}

/// Eight neighbours of a point: their places along each axis, and the share of the further ones.
struct Neighbours {
    near: [usize; 3],
    far: [usize; 3],
    share: [f32; 3],
}

impl GridVolume {
    /// Index along `axis`, under the wrap.
    fn wrapped(&self, i: f64, axis: usize) -> usize {
        super::texture::wrapped(i, self.size[axis], self.wrap)
    }

    fn index(&self, i: [usize; 3]) -> usize {
        (i[2] * self.size[1] + i[1]) * self.size[0] + i[0]
    }

    /// Voxel coordinates of a point: whole numbers are faces between voxels.
    fn place(&self, point: DVec3) -> DVec3 {
        let n = DVec3::new(self.size[0] as f64, self.size[1] as f64, self.size[2] as f64);
        self.local_from_world.transform_point3(point) * n
    }

    fn nearest(&self, place: DVec3) -> usize {
        let p = place.to_array();
        self.index(std::array::from_fn(|axis| self.wrapped(p[axis].floor(), axis)))
    }

    #[inline]
    fn neighbours(&self, place: DVec3) -> Neighbours {
        let place = place - DVec3::splat(0.5);
        let first = place.floor();
        let [nx, ny, nz] = self.size;
        let last = DVec3::new((nx - 1) as f64, (ny - 1) as f64, (nz - 1) as f64);
        // Between the outermost centres nothing wraps.
        if first.cmpge(DVec3::ZERO).all() && first.cmplt(last).all() {
            let share = (place - first).as_vec3().to_array();
            let near = [first.x as i64 as usize, first.y as i64 as usize, first.z as i64 as usize];
            return Neighbours { near, far: [near[0] + 1, near[1] + 1, near[2] + 1], share };
        }
        self.wrapped_neighbours(place)
    }

    #[inline(never)]
    fn wrapped_neighbours(&self, place: DVec3) -> Neighbours {
        let p = place.to_array();
        Neighbours {
            near: std::array::from_fn(|axis| self.wrapped(p[axis].floor(), axis)),
            far: std::array::from_fn(|axis| self.wrapped(p[axis].floor() + 1.0, axis)),
            share: std::array::from_fn(|axis| (p[axis] - p[axis].floor()) as f32),
        }
    }

    /// Σ weight · f(voxel) over the eight neighbours.
    #[inline(always)]
    fn blend<T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>>(
        &self,
        n: &Neighbours,
        f: impl Fn(usize) -> T,
    ) -> T {
        let mix = |a: T, b: T, share: f32| a * (1.0 - share) + b * share;
        let along_x = |y: usize, z: usize| {
            let row = self.index([0, y, z]);
            mix(f(row + n.near[0]), f(row + n.far[0]), n.share[0])
        };
        let along_y = |z: usize| mix(along_x(n.near[1], z), along_x(n.far[1], z), n.share[1]);
        mix(along_y(n.near[2]), along_y(n.far[2]), n.share[2])
    }

    /// f(voxel) at `point`, between voxels as they are mixed.
    #[inline(always)]
    fn value<T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>>(
        &self,
        point: DVec3,
        f: impl Fn(usize) -> T,
    ) -> T {
        let place = self.place(point);
        match self.between {
            Between::Nearest => f(self.nearest(place)),
            Between::Trilinear => self.blend(&self.neighbours(place), f),
        }
    }

    /// One number at `point`: the value, or the luminance of three.
    #[must_use]
    pub fn scalar(&self, point: DVec3) -> f64 {
        f64::from(match &self.values {
            Voxels::Grey(values) => self.value(point, |i| values[i]),
            Voxels::Raw(values) => self.value(point, |i| {
                let [r, g, b] = values[i];
                let weight = REC709_OF_MITSUBA.map(|weight| weight as f32);
                weight[0] * r + weight[1] * g + weight[2] * b
            }),
            // Never asked for: compiling refuses a coloured grid where a number is wanted.
            Voxels::Coloured(values) => self.value(point, |i| values[i][3]),
        })
    }

    /// The three numbers at `point`, equal for a grid of one.
    #[must_use]
    pub fn triple(&self, point: DVec3) -> DVec3 {
        match &self.values {
            Voxels::Raw(values) => self.value(point, |i| Vec3::from(values[i])).as_dvec3(),
            _ => DVec3::splat(self.scalar(point)),
        }
    }

    /// The spectrum at `point`.
    #[must_use]
    pub fn eval(&self, point: DVec3, nm: Lanes) -> Lanes {
        let Voxels::Coloured(values) = &self.values else {
            return Lanes::splat(self.scalar(point) as f32);
        };
        let place = self.place(point);
        let sigmoid = |i: usize| {
            let [a, b, c, _] = values[i];
            upsample::eval_sigmoid([a, b, c], nm)
        };
        let value = match self.between {
            Between::Nearest => {
                let i = self.nearest(place);
                sigmoid(i) * values[i][3]
            }
            Between::Trilinear => {
                let n = self.neighbours(place);
                self.blend(&n, sigmoid) * self.blend(&n, |i| values[i][3])
            }
        };
        if self.clamped { value.min(Lanes::ONE) } else { value }
    }

    /// What no wavelength exceeds: of voxel `i`, the largest value and the factor on it.
    fn bound(&self, i: usize) -> (f32, f32) {
        match &self.values {
            Voxels::Grey(values) => (values[i], 1.0),
            Voxels::Raw(values) => (values[i].into_iter().fold(0.0, f32::max), 1.0),
            Voxels::Coloured(values) => {
                let [a, b, c, scale] = values[i];
                let spectrum = Spectrum::Sigmoid { c: [a, b, c], scale: 1.0 };
                (spectrum.max() as f32, scale)
            }
        }
    }

    /// The greatest number in its file.
    #[must_use]
    pub fn greatest(&self) -> f32 {
        let greatest = |i: usize| match &self.values {
            Voxels::Grey(values) => values[i],
            Voxels::Raw(values) => values[i].into_iter().fold(0.0, f32::max),
            // The scale is twice the largest channel.
            Voxels::Coloured(values) => 0.5 * values[i][3],
        };
        (0..self.len()).map(greatest).fold(0.0, f32::max)
    }

    fn outside(&self, bounds: &RangeInclusive<f64>) -> Option<f64> {
        match &self.values {
            Voxels::Grey(values) => values.iter().find_map(|&x| outside([x; 3], 1.0, bounds)),
            Voxels::Raw(values) => values.iter().find_map(|&rgb| outside(rgb, 1.0, bounds)),
            // As for `scalar`.
            Voxels::Coloured(_) => None,
        }
    }

    fn spectrum(&self, i: usize) -> Spectrum {
        match &self.values {
            Voxels::Grey(values) => Spectrum::constant(f64::from(values[i])),
            Voxels::Raw(values) => Spectrum::constant(f64::from(values[i][1])),
            Voxels::Coloured(values) => {
                let [a, b, c, scale] = values[i];
                Spectrum::Sigmoid { c: [a, b, c], scale }
            }
        }
    }

    fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// The voxel with the most light, of coloured ones that of the largest scale.
    fn brightest(&self) -> Option<usize> {
        let light = |i: usize| match &self.values {
            Voxels::Grey(values) => values[i],
            Voxels::Raw(values) => values[i][1],
            Voxels::Coloured(values) => values[i][3],
        };
        *self.brightest.get_or_init(|| (0..self.len()).max_by(|&a, &b| light(a).total_cmp(&light(b))))
    }
}

impl Volume {
    /// The same as shares of light.
    #[must_use]
    pub fn of_shares(self) -> Volume {
        match self {
            Volume::Grid(grid) if matches!(grid.values, Voxels::Coloured(_)) && !grid.above_one => {
                Volume::Grid(Arc::new(GridVolume { clamped: true, ..GridVolume::clone(&grid) }))
            }
            other => other,
        }
    }

    /// The spectrum at `point`.
    #[must_use]
    #[inline]
    pub fn eval(&self, point: DVec3, nm: Lanes) -> Lanes {
        match self {
            Volume::Constant { value, .. } => value.eval(nm),
            Volume::Grid(grid) => grid.eval(point, nm),
        }
    }

    /// One number at `point`; of a constant spectrum its mean over the band.
    #[must_use]
    pub fn scalar(&self, point: DVec3) -> f64 {
        match self {
            Volume::Constant { value: Spectrum::Constant(value), .. } => f64::from(*value),
            Volume::Constant { value, .. } => (360..=830).map(|nm| value.at(f64::from(nm))).sum::<f64>() / 471.0,
            Volume::Grid(grid) => grid.scalar(point),
        }
    }

    /// The first number outside `bounds` that it has.
    #[must_use]
    pub fn outside(&self, bounds: &RangeInclusive<f64>) -> Option<f64> {
        match self {
            Volume::Constant { .. } => Some(self.scalar(DVec3::ZERO)).filter(|x| !bounds.contains(x)),
            Volume::Grid(grid) => grid.outside(bounds),
        }
    }

    /// The three numbers at `point`.
    #[must_use]
    pub fn triple(&self, point: DVec3) -> DVec3 {
        match self {
            Volume::Constant { .. } => DVec3::splat(self.scalar(point)),
            Volume::Grid(grid) => grid.triple(point),
        }
    }

    /// Whether the value depends on the point.
    #[must_use]
    pub fn varies(&self) -> bool {
        matches!(self, Volume::Grid(_))
    }

    /// Whether the value depends on the wavelength.
    #[must_use]
    pub fn is_chromatic(&self) -> bool {
        match self {
            Volume::Constant { value, .. } => !value.is_constant(),
            Volume::Grid(grid) => matches!(grid.values, Voxels::Coloured(_)),
        }
    }

    /// What the value nowhere exceeds.
    #[must_use]
    pub fn max(&self) -> f64 {
        match self {
            Volume::Constant { value, .. } => value.max(),
            Volume::Grid(grid) => Bounds::of(grid, usize::MAX).global,
        }
    }

    /// Spectra that stand for the volume where one is needed: those of some 16 voxels and of the brightest.
    #[must_use]
    pub fn representatives(&self) -> Vec<Spectrum> {
        match self {
            Volume::Constant { value, .. } => vec![value.clone()],
            Volume::Grid(grid) => spread(grid.len(), 16).chain(grid.brightest()).map(|i| grid.spectrum(i)).collect(),
        }
    }

    /// The mean luminance, as that of a [`Texture`](super::texture::Texture::mean_luminance).
    #[must_use]
    pub fn mean_luminance(&self) -> f64 {
        match self {
            Volume::Constant { value, .. } => value.luminance(),
            Volume::Grid(grid) => {
                mean_luminance(grid.len(), grid.brightest().map(|i| grid.spectrum(i)), |i| grid.spectrum(i))
            }
        }
    }

    /// Some of its spectra and their shares, as those of a [`Texture`](super::texture::Texture::shares).
    #[must_use]
    pub fn shares(&self) -> Vec<(f64, Spectrum)> {
        match self {
            Volume::Constant { value, .. } => vec![(1.0, value.clone())],
            Volume::Grid(grid) => even_shares(grid.len(), |i| grid.spectrum(i)),
        }
    }

    fn local_from_world(&self) -> DAffine3 {
        match self {
            Volume::Constant { local_from_world, .. } => *local_from_world,
            Volume::Grid(grid) => grid.local_from_world,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn grid(size: [usize; 3], values: Voxels) -> GridVolume {
        let (local_from_world, between, wrap) = (DAffine3::IDENTITY, Between::Trilinear, Wrap::Clamp);
        let (above_one, clamped, brightest) = (false, false, OnceLock::new());
        GridVolume { size, values, local_from_world, between, wrap, above_one, clamped, brightest }
    }

    /// A deterministic spread of numbers in [0, 1).
    pub(super) fn noise(n: usize) -> Vec<f32> {
        (0..n as u64).map(|i| (crate::math::sampler::mix64(i) >> 40) as f32 / (1u32 << 24) as f32).collect()
    }

    fn at(grid: &GridVolume, x: f64, y: f64, z: f64) -> f64 {
        f64::from(grid.eval(DVec3::new(x, y, z), Lanes::splat(550.0)).to_array()[0])
    }

    /// Eight voxels 0 … 7: voxel centres at ¼ and ¾ hold their numbers, the middle of the cube their mean, and x
    /// changes fastest. Beyond the outer centres each wrap has its own neighbour.
    #[test]
    fn look_ups_are_the_closed_form_at_centres_and_beyond() {
        let mut eight = grid([2, 2, 2], Voxels::Grey((0..8u8).map(f32::from).collect()));
        assert_eq!([at(&eight, 0.25, 0.25, 0.25), at(&eight, 0.75, 0.25, 0.25)], [0.0, 1.0]);
        assert_eq!([at(&eight, 0.25, 0.75, 0.25), at(&eight, 0.25, 0.25, 0.75)], [2.0, 4.0]);
        assert_eq!(at(&eight, 0.5, 0.5, 0.5), 3.5);
        assert_eq!(at(&eight, 0.375, 0.25, 0.25), 0.25);
        let beyond = [(Wrap::Clamp, [0.0, 0.0, 0.0]), (Wrap::Mirror, [0.0, 0.0, 1.0]), (Wrap::Repeat, [0.5, 1.0, 0.0])];
        for (wrap, expected) in beyond {
            eight.wrap = wrap;
            assert_eq!([0.0, -0.25, -0.75].map(|x| at(&eight, x, 0.25, 0.25)), expected, "{wrap:?}");
        }
        eight.between = Between::Nearest;
        assert_eq!([at(&eight, 0.49, 0.0, 0.0), at(&eight, 0.51, 0.0, 0.99)], [0.0, 5.0]);
    }

    /// A colour of one voxel is its unbounded spectrum; between two voxels sigmoids and scales are mixed apart:
    /// halfway between s₁ at scale a and s₂ at scale b lies ½(s₁ + s₂) · ½(a + b).
    #[test]
    fn colours_are_mixed_as_sigmoids_and_scales() {
        let colours = [[0.2f32, 0.5, 0.1], [4.0, 1.0, 2.0]];
        let mut grid = grid([2, 1, 1], Voxels::upsampled(&colours, Carried::Spectra));
        let nm = Lanes::new([400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0]);
        let both = colours.map(|c| upsample::unbounded(c.map(f64::from)).unwrap().eval(nm).to_array());
        let found = [0.25, 0.75].map(|x| grid.eval(DVec3::new(x, 0.5, 0.5), nm).to_array());
        let middle = grid.eval(DVec3::splat(0.5), nm).to_array();
        for lane in 0..8 {
            for i in 0..2 {
                // The fast coefficients of voxels are within 2e-4 of their colour; the exact ones solve it.
                assert!((found[i][lane] - both[i][lane]).abs() < 4e-3 * both[i][lane].max(0.1), "{lane} {i}");
            }
            let expected = 0.5 * (found[0][lane] / 1.0 + found[1][lane] / 8.0) * 4.5;
            assert!((middle[lane] / expected - 1.0).abs() < 1e-5, "{lane}: {} {expected}", middle[lane]);
        }
        grid.between = Between::Nearest;
        assert_eq!([0.1, 0.9].map(|x| grid.eval(DVec3::new(x, 0.5, 0.5), nm).to_array()), found);
    }
}
