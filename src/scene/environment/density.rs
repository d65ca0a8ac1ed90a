//! By what densities the directions of an environment are drawn.

use super::Mapping;
use super::table::PiecewiseConstant2d;
use crate::scene::texture::Texel;
use std::f64::consts::PI;

/// Directions by the factors of texels, as far as they are above a floor.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub(super) floor: f64,
    pub(super) density: Density,
}

/// The density of directions over the unit square (longitude, colatitude).
#[derive(Clone, Debug)]
pub(super) enum Density {
    /// Constant in each texel.
    Constant(PiecewiseConstant2d),
    /// Bilinear between the factors of the texels as [`Mapping::Poles`] places them, so that a look-up of the light
    /// gives its density too, times the mean of sin θ in each row of cells. Cell (x, y) lies between columns x and
    /// x + 1, and rows y and y + 1, of texels.
    Bilinear {
        cells: PiecewiseConstant2d,
        /// For each row of cells, the density over the factor.
        density: Vec<f64>,
    },
}

impl Texel {
    /// The factor above a floor.
    pub(super) fn above(&self, floor: f64) -> f64 {
        (f64::from(self.scale) - floor).max(0.0)
    }
}

impl Table {
    /// Of `texels` in rows of `width`.
    pub(super) fn of(texels: &[Texel], width: usize, mapping: Mapping, floor: f64) -> Table {
        let density = match mapping {
            Mapping::Texels => Density::neighbourhood(texels, width, floor),
            Mapping::Poles => Density::bilinear(texels, width, floor),
        };
        Table { floor, density }
    }

    /// Of texels that tell of a light that is not mixed of them: each stands for itself.
    pub(super) fn of_each(texels: &[Texel], width: usize, floor: f64) -> Table {
        let height = texels.len() / width;
        let weight = |(i, texel): (usize, &Texel)| {
            texel.above(floor) * libm::sin(PI * ((i / width) as f64 + 0.5) / height as f64)
        };
        let weights: Vec<f64> = texels.iter().enumerate().map(weight).collect();
        Table { floor, density: Density::Constant(PiecewiseConstant2d::new(&weights, width, height)) }
    }
}

impl Density {
    /// That follows the factor of each texel's neighbourhood (the largest of its 3 × 3, because bilinear look-ups spread a
    /// texel over its neighbours) times sin θ.
    fn neighbourhood(texels: &[Texel], width: usize, floor: f64) -> Density {
        let height = texels.len() / width;
        let mut weights = vec![0.0; width * height];
        for y in 0..height {
            let sin = libm::sin(PI * (y as f64 + 0.5) / height as f64);
            let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
            let column =
                |x: usize| rows.map(|row| texels[row * width + x].above(floor)).into_iter().fold(0.0f64, f64::max);
            let (first, last) = (column(0), column(width - 1));
            let (mut left, mut here) = (last, first);
            for x in 0..width {
                let right = if x + 1 < width { column(x + 1) } else { first };
                weights[y * width + x] = left.max(here).max(right) * sin;
                (left, here) = (here, right);
            }
        }
        Density::Constant(PiecewiseConstant2d::new(&weights, width, height))
    }

    /// That is bilinear between the factors of texels.
    fn bilinear(texels: &[Texel], width: usize, floor: f64) -> Density {
        let rows = texels.len() / width - 1;
        let scale = |x: usize, y: usize| texels[y * width + x].above(floor);
        let mut weights = Vec::with_capacity(width * rows);
        let mut density = Vec::with_capacity(rows);
        for y in 0..rows {
            // ∫ sin θ over the row of cells.
            let (from, to) = (y as f64 / rows as f64, (y + 1) as f64 / rows as f64);
            let sin = libm::cos(PI * from) - libm::cos(PI * to);
            let pair = |x: usize| scale(x, y) + scale(x, y + 1);
            weights.extend((0..width).map(|x| (pair(x) + pair(if x + 1 == width { 0 } else { x + 1 })) * sin));
            density.push(sin);
        }
        // A cell of weight w = Σ sin of a total W has the mean density (w / W) n m, and the factor there the mean Σ / 4.
        let total: f64 = weights.iter().sum();
        density.iter_mut().for_each(|sin| *sin *= 4.0 * weights.len() as f64 / total);
        // Some maps are black: none of these is asked for.
        if total == 0.0 {
            density.fill(0.0);
        }
        Density::Bilinear { cells: PiecewiseConstant2d::new(&weights, width, rows), density }
    }
}

/// A number in [0, 1] with a density that goes linearly from `a` to `b`, not both zero, by `u`.
pub(super) fn linear(a: f64, b: f64, u: f64) -> f64 {
    // The root of a x + (b − a) x² / 2 = u (a + b) / 2, free of cancellation.
    let root = (a * a + u * (b * b - a * a)).max(0.0).sqrt();
    (u * (a + b) / (a + root)).clamp(0.0, 1.0)
}
