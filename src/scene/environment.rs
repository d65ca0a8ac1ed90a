//! Light from all around: an image on the sphere at infinity, sampled by its luminance.
//!
//! Equirectangular. In the frame of the map +y is up; the middle column looks along −z and
//! columns to the right turn toward +x, so a map and a camera that looks along −z agree.

use super::texture::{Grid, ImageTexture, Texel, Wrap};
use crate::spectrum::{Lanes, Spectrum, illuminant, upsample};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// An environment map.
#[derive(Clone, Debug)]
pub struct Environment {
    /// The texels, upsampled as light.
    pub image: ImageTexture,
    /// Rotation from the map's frame to the world.
    pub world_from_map: DMat3,
    table: PiecewiseConstant2d,
}

/// A direction toward the environment.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentSample {
    /// Unit, in the world.
    pub direction: DVec3,
    /// sr⁻¹.
    pub pdf_solid_angle: f64,
}

impl Environment {
    /// A map of linear Rec. 709 `pixels`, row 0 at the top, times `scale`.
    ///
    /// The density follows the luminance of each texel's neighbourhood (the largest of its 3 × 3,
    /// because bilinear look-ups spread a texel over its neighbours) times sin θ.
    #[must_use]
    pub fn new(pixels: &[[f32; 3]], width: usize, height: usize, scale: f64, world_from_map: DMat3) -> Environment {
        let texels: Vec<Texel> = pixels
            .iter()
            .map(|&rgb| {
                let (coefficients, s) = upsample::emission_coefficients(rgb);
                Texel { coefficients, scale: s * scale as f32 }
            })
            .collect();
        let luminance: Vec<f64> = pixels
            .iter()
            .map(|p| (0.2126 * f64::from(p[0]) + 0.7152 * f64::from(p[1]) + 0.0722 * f64::from(p[2])).max(0.0))
            .collect();
        let mut weights = vec![0.0; width * height];
        for y in 0..height {
            let sin = libm::sin(PI * (y as f64 + 0.5) / height as f64);
            for x in 0..width {
                let mut largest = 0.0f64;
                for dy in [-1i64, 0, 1] {
                    for dx in [-1i64, 0, 1] {
                        let row = (y as i64 + dy).clamp(0, height as i64 - 1) as usize;
                        let column = (x as i64 + dx).rem_euclid(width as i64) as usize;
                        largest = largest.max(luminance[row * width + column]);
                    }
                }
                weights[y * width + x] = largest * sin;
            }
        }
        let image = ImageTexture {
            texels: Arc::new(texels),
            grid: Grid { wrap: [Wrap::Repeat, Wrap::Clamp], ..Grid::new(width, height) },
            illuminant: Some(illuminant::d65()),
        };
        Environment { image, world_from_map, table: PiecewiseConstant2d::new(&weights, width, height) }
    }

    fn uv(&self, direction: DVec3) -> DVec2 {
        let d = self.world_from_map.transpose() * direction;
        let u = 0.5 + libm::atan2(d.x, -d.z) / (2.0 * PI);
        let v = 1.0 - libm::atan2((d.x * d.x + d.z * d.z).sqrt(), d.y) / PI;
        DVec2::new(u, v)
    }

    /// Radiance from `direction` (pointing away from the viewer).
    #[must_use]
    pub fn radiance(&self, direction: DVec3, nm: Lanes) -> Lanes {
        // Rows do not wrap: beyond the pole lies the pole's own row, not the opposite one.
        self.image.eval(self.uv(direction), nm)
    }

    /// A direction by luminance; `None` for a black map.
    #[must_use]
    pub fn sample(&self, u: DVec2) -> Option<EnvironmentSample> {
        let (point, pdf) = self.table.sample(u)?;
        let (sin_theta, cos_theta) = (libm::sin(point.y * PI), libm::cos(point.y * PI));
        let phi = (point.x - 0.5) * 2.0 * PI;
        let d = DVec3::new(sin_theta * libm::sin(phi), cos_theta, -sin_theta * libm::cos(phi));
        let pdf_solid_angle = pdf / (2.0 * PI * PI * sin_theta);
        (sin_theta > 0.0).then(|| EnvironmentSample { direction: self.world_from_map * d, pdf_solid_angle })
    }

    /// Density of [`Environment::sample`] at `direction`, sr⁻¹.
    #[must_use]
    pub fn pdf(&self, direction: DVec3) -> f64 {
        let uv = self.uv(direction);
        let sin_theta = libm::sin((1.0 - uv.y) * PI);
        if sin_theta <= 0.0 {
            return 0.0;
        }
        self.table.pdf(DVec2::new(uv.x, 1.0 - uv.y)) / (2.0 * PI * PI * sin_theta)
    }

    /// Mean luminance over the sphere of directions, film units.
    #[must_use]
    pub fn mean_luminance(&self) -> f64 {
        let white = illuminant::d65().luminance();
        let (mut sum, mut weight) = (0.0, 0.0);
        for y in 0..self.image.grid.height {
            let sin = libm::sin(PI * (y as f64 + 0.5) / self.image.grid.height as f64);
            for t in &self.image.texels[y * self.image.grid.width..(y + 1) * self.image.grid.width] {
                // The factor is twice the largest channel; for choosing lights half of it will do.
                sum += 0.5 * f64::from(t.scale) * white * sin;
                weight += sin;
            }
        }
        sum / weight
    }

    /// Some 16 spectra of the map, for the choice of wavelengths.
    #[must_use]
    pub fn representatives(&self) -> Vec<Spectrum> {
        super::texture::Texture::Image(self.image.clone()).representatives()
    }
}

/// A density on the unit square that is constant in each cell of a grid.
#[derive(Clone, Debug)]
struct PiecewiseConstant2d {
    width: usize,
    height: usize,
    /// For each row, the running sums of its cells over the row's total, `width + 1` entries.
    rows: Vec<f64>,
    /// The same over rows.
    marginal: Vec<f64>,
}

impl PiecewiseConstant2d {
    fn new(weights: &[f64], width: usize, height: usize) -> PiecewiseConstant2d {
        let running = |cells: &mut dyn Iterator<Item = f64>, out: &mut Vec<f64>| -> f64 {
            let start = out.len();
            out.push(0.0);
            let mut sum = 0.0;
            for w in cells {
                sum += w;
                out.push(sum);
            }
            if sum > 0.0 {
                out[start..].iter_mut().for_each(|x| *x /= sum);
            }
            sum
        };
        let mut rows = Vec::with_capacity(height * (width + 1));
        let totals: Vec<f64> =
            weights.chunks_exact(width).map(|row| running(&mut row.iter().copied(), &mut rows)).collect();
        let mut marginal = Vec::with_capacity(height + 1);
        running(&mut totals.into_iter(), &mut marginal);
        PiecewiseConstant2d { width, height, rows, marginal }
    }

    fn row(&self, y: usize) -> &[f64] {
        &self.rows[y * (self.width + 1)..(y + 1) * (self.width + 1)]
    }

    /// Cell and position within the table where the running sum reaches `u`.
    fn invert(cdf: &[f64], u: f64) -> Option<(usize, f64)> {
        let n = cdf.len() - 1;
        let cell = cdf.partition_point(|&c| c <= u).saturating_sub(1).min(n - 1);
        let mass = cdf[cell + 1] - cdf[cell];
        (mass > 0.0).then(|| (cell, (cell as f64 + ((u - cdf[cell]) / mass).clamp(0.0, 1.0)) / n as f64))
    }

    /// A point and its density.
    fn sample(&self, u: DVec2) -> Option<(DVec2, f64)> {
        let (row, y) = Self::invert(&self.marginal, u.y)?;
        let (column, x) = Self::invert(self.row(row), u.x)?;
        Some((DVec2::new(x, y), self.density(row, column)))
    }

    fn density(&self, row: usize, column: usize) -> f64 {
        let cdf = self.row(row);
        (self.marginal[row + 1] - self.marginal[row])
            * (cdf[column + 1] - cdf[column])
            * (self.width * self.height) as f64
    }

    fn pdf(&self, p: DVec2) -> f64 {
        let cell = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
        self.density(cell(p.y, self.height), cell(p.x, self.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> Environment {
        let (w, h) = (16, 8);
        let pixels: Vec<[f32; 3]> =
            (0..w * h).map(|i| if i == 3 * w + 11 { [50.0; 3] } else { [0.1 + 0.01 * (i % 7) as f32; 3] }).collect();
        Environment::new(&pixels, w, h, 1.0, DMat3::from_rotation_y(0.7))
    }

    fn grid(n: u32) -> impl Iterator<Item = DVec2> {
        (0..n * n).map(move |i| DVec2::new(f64::from(i % n) + 0.5, f64::from(i / n) + 0.5) / f64::from(n))
    }

    #[test]
    fn density_of_sampled_directions_is_the_stated_one() {
        let map = map();
        for u in grid(64) {
            let s = map.sample(u).unwrap();
            assert!((s.direction.length() - 1.0).abs() < 1e-14);
            let pdf = map.pdf(s.direction);
            // On the border of a cell rounding may pick the neighbour.
            assert!((pdf / s.pdf_solid_angle - 1.0).abs() < 1e-9 || u.x * 64.0 % 4.0 < 1.0, "{u} {pdf} {s:?}");
        }
    }

    /// ∫ pdf dω = 1, over 512² midpoints of a piecewise constant function with 128 cells: each
    /// cell border is off by at most half a step of 1/512 in one dimension.
    #[test]
    fn density_integrates_to_one() {
        let map = map();
        let mean = grid(512).map(|u| map.pdf(crate::math::warp::uniform_sphere(u))).sum::<f64>() / 262_144.0;
        assert!((mean * 4.0 * PI - 1.0).abs() < 5e-3, "{}", mean * 4.0 * PI);
    }

    #[test]
    fn the_middle_column_looks_along_minus_z_and_the_top_row_up() {
        let (w, h) = (8, 4);
        let mut pixels = vec![[0.0; 3]; w * h];
        pixels[..w].fill([1.0; 3]);
        pixels[2 * w + 4] = [4.0; 3];
        let map = Environment::new(&pixels, w, h, 1.0, DMat3::IDENTITY);
        let green = |d: DVec3| f64::from(map.radiance(d, Lanes::splat(550.0)).to_array()[0]);
        assert!(green(DVec3::Y) > 0.5 && green(-DVec3::Y) < 1e-6);
        // The centre of column 4 of 8 lies half a column (22.5°) to the right of −z.
        let (s, c) = (PI / 8.0).sin_cos();
        let down = -PI / 8.0;
        let d = DVec3::new(s * down.cos(), down.sin(), -c * down.cos());
        assert!(green(d) > 3.0 && green(d * DVec3::new(-1.0, 1.0, 1.0)) < 0.5);
    }

    #[test]
    fn a_black_map_is_never_sampled() {
        let map = Environment::new(&[[0.0; 3]; 8], 4, 2, 1.0, DMat3::IDENTITY);
        assert!(map.sample(DVec2::splat(0.5)).is_none());
    }
}
