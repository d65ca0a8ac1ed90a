//! Light from all around: an image on the sphere at infinity, sampled by its luminance.
//!
//! Equirectangular. In the frame of the map +y is up; columns to the right turn from −z toward +x.
//! Two conventions say where the texels lie, see [`Mapping`].

use super::bvh::prefetch;
use super::texture::Texel;
use crate::spectrum::{Lanes, Spectrum, illuminant, upsample};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Where the texels of an environment lie on the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Texel centres are at half-integers in both angles, and the middle column looks along −z, so that
    /// a map and a camera that looks along −z agree. Between centres spectra are mixed.
    Texels,
    /// As Mitsuba 3 has it: centres are at half-integers in longitude, counted from −z at the left
    /// edge; the first and the last row are the poles. Between centres the colours (sigmoid
    /// spectra) and the factors are each mixed by themselves, and then multiplied.
    Poles,
}

/// An environment map.
#[derive(Clone, Debug)]
pub struct Environment {
    texels: Vec<Texel>,
    width: usize,
    height: usize,
    mapping: Mapping,
    /// Rotation, with or without a mirror, from the map's frame to the world.
    world_from_map: DMat3,
    illuminant: Spectrum,
    mean_luminance: f64,
    table: Table,
}

/// The density of directions over the unit square (longitude, colatitude).
#[derive(Clone, Debug)]
enum Table {
    Constant(PiecewiseConstant2d),
    Bilinear(PiecewiseBilinear2d),
}

/// A direction toward the environment.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentSample {
    /// Unit, in the world.
    pub direction: DVec3,
    /// sr⁻¹.
    pub pdf_solid_angle: f64,
}

/// Four texels around a direction and how far it is beyond the first, in columns and rows.
struct Corners<'a> {
    texels: [&'a Texel; 4],
    x: f32,
    y: f32,
}

impl Corners<'_> {
    fn mix<T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>>(&self, f: impl Fn(&Texel) -> T) -> T {
        let [a, b, c, d] = self.texels.map(f);
        let row = |l: T, r: T| l * (1.0 - self.x) + r * self.x;
        row(a, b) * (1.0 - self.y) + row(c, d) * self.y
    }
}

impl Environment {
    /// A map of linear Rec. 709 `pixels`, row 0 at the top, times `scale`.
    #[must_use]
    pub fn new(
        pixels: &[[f32; 3]],
        width: usize,
        height: usize,
        scale: f64,
        mapping: Mapping,
        world_from_map: DMat3,
    ) -> Environment {
        let luminance: Vec<f64> = pixels
            .iter()
            .map(|p| (0.2126 * f64::from(p[0]) + 0.7152 * f64::from(p[1]) + 0.0722 * f64::from(p[2])).max(0.0))
            .collect();
        let row_angle = |y: usize| match mapping {
            Mapping::Texels => PI * (y as f64 + 0.5) / height as f64,
            Mapping::Poles => PI * y as f64 / (height.max(2) - 1) as f64,
        };
        let mut table = match mapping {
            Mapping::Texels => Table::Constant(neighbourhood(&luminance, width, height)),
            Mapping::Poles => Table::Bilinear(PiecewiseBilinear2d::new(&luminance, width, height)),
        };
        // Some maps are black.
        if luminance.iter().all(|&l| l == 0.0) {
            table = Table::Constant(PiecewiseConstant2d::new(&[0.0], 1, 1));
        }
        let texels = upsampled(pixels, scale as f32, mapping);
        let illuminant = illuminant::d65();
        let (mut sum, mut weight) = (0.0, 0.0);
        for (y, row) in texels.chunks_exact(width).enumerate() {
            let sin = libm::sin(row_angle(y));
            // The factor is twice the largest channel; for choosing lights half of it will do.
            sum += sin * row.iter().map(|t| 0.5 * f64::from(t.scale)).sum::<f64>();
            weight += sin * width as f64;
        }
        let mean_luminance = if weight > 0.0 { sum / weight * illuminant.luminance() } else { 0.0 };
        Environment { texels, width, height, mapping, world_from_map, illuminant, mean_luminance, table }
    }

    /// Longitude in turns from the left edge of the map and colatitude in half turns.
    fn place(&self, direction: DVec3) -> DVec2 {
        let d = self.world_from_map.transpose() * direction;
        let turns = libm::atan2(d.x, -d.z) / (2.0 * PI);
        let u = match self.mapping {
            Mapping::Texels => 0.5 + turns,
            Mapping::Poles => turns - turns.floor(),
        };
        DVec2::new(u, libm::atan2((d.x * d.x + d.z * d.z).sqrt(), d.y) / PI)
    }

    fn corners(&self, at: DVec2) -> Corners<'_> {
        let (w, h) = (self.width as i64, self.height as i64);
        let x = at.x * w as f64 - 0.5;
        let y = match self.mapping {
            Mapping::Texels => at.y * h as f64 - 0.5,
            Mapping::Poles => at.y * (h - 1) as f64,
        };
        let (x0, y0) = (x.floor(), y.floor());
        // Columns go around, rows do not: beyond the pole lies the pole's own row.
        let (left, right) = ((x0 as i64).rem_euclid(w), (x0 as i64 + 1).rem_euclid(w));
        let (upper, lower) = ((y0 as i64).clamp(0, h - 1), (y0 as i64 + 1).clamp(0, h - 1));
        let texel = |x: i64, y: i64| &self.texels[(y * w + x) as usize];
        let texels = [texel(left, upper), texel(right, upper), texel(left, lower), texel(right, lower)];
        Corners { texels, x: (x - x0) as f32, y: (y - y0) as f32 }
    }

    /// Radiance from `direction` (pointing away from the viewer).
    #[must_use]
    pub fn radiance(&self, direction: DVec3, nm: Lanes) -> Lanes {
        self.radiance_at(self.place(direction), nm)
    }

    fn radiance_at(&self, at: DVec2, nm: Lanes) -> Lanes {
        let corners = self.corners(at);
        let value = match self.mapping {
            Mapping::Texels => corners.mix(|t| upsample::eval_sigmoid(t.coefficients, nm) * t.scale),
            Mapping::Poles => corners.mix(|t| upsample::eval_sigmoid(t.coefficients, nm)) * corners.mix(|t| t.scale),
        };
        value * self.illuminant.eval(nm)
    }

    /// A direction by luminance; `None` for a black map.
    #[must_use]
    pub fn sample(&self, u: DVec2) -> Option<EnvironmentSample> {
        let (at, pdf, offset) = match &self.table {
            Table::Constant(table) => {
                let (at, pdf) = table.sample(u)?;
                (at, pdf, 0.5)
            }
            Table::Bilinear(table) => {
                let (at, pdf) = table.sample(u)?;
                (at, pdf, 0.0)
            }
        };
        // Who looks there next finds the texels in the cache.
        let x = (at.x * self.width as f64 - 0.5).max(0.0) as usize;
        let y = match self.mapping {
            Mapping::Texels => (at.y * self.height as f64 - 0.5).max(0.0) as usize,
            Mapping::Poles => (at.y * (self.height - 1) as f64) as usize,
        };
        prefetch(&self.texels, y * self.width + x);
        prefetch(&self.texels, (y + 1) * self.width + x);
        let (sin_theta, cos_theta) = (libm::sin(at.y * PI), libm::cos(at.y * PI));
        let phi = (at.x - offset) * 2.0 * PI;
        let d = DVec3::new(sin_theta * libm::sin(phi), cos_theta, -sin_theta * libm::cos(phi));
        let pdf_solid_angle = pdf / (2.0 * PI * PI * sin_theta);
        (sin_theta > 0.0).then(|| EnvironmentSample { direction: self.world_from_map * d, pdf_solid_angle })
    }

    /// [`Environment::radiance`] and [`Environment::pdf`] at once.
    #[must_use]
    pub fn radiance_and_pdf(&self, direction: DVec3, nm: Lanes) -> (Lanes, f64) {
        let at = self.place(direction);
        (self.radiance_at(at, nm), self.pdf_at(at))
    }

    /// Density of [`Environment::sample`] at `direction`, sr⁻¹.
    #[must_use]
    pub fn pdf(&self, direction: DVec3) -> f64 {
        self.pdf_at(self.place(direction))
    }

    fn pdf_at(&self, at: DVec2) -> f64 {
        let sin_theta = libm::sin(at.y * PI);
        if sin_theta <= 0.0 {
            return 0.0;
        }
        let pdf = match &self.table {
            Table::Constant(table) => table.pdf(at),
            Table::Bilinear(table) => table.pdf(at),
        };
        pdf / (2.0 * PI * PI * sin_theta)
    }

    /// Mean luminance over the sphere of directions, film units.
    #[must_use]
    pub fn mean_luminance(&self) -> f64 {
        self.mean_luminance
    }

    /// Some 16 spectra of the map, for the choice of wavelengths.
    #[must_use]
    pub fn representatives(&self) -> Vec<Spectrum> {
        let step = (self.texels.len() / 16).max(1);
        let texels = self.texels.iter().step_by(step);
        texels.map(|t| Spectrum::Sigmoid { c: t.coefficients, scale: t.scale }.times(&self.illuminant)).collect()
    }
}

/// Texels of light: a colour, and twice the greatest channel.
fn upsampled(pixels: &[[f32; 3]], scale: f32, mapping: Mapping) -> Vec<Texel> {
    let texel = |&rgb: &[f32; 3]| {
        let (coefficients, s) = upsample::emission_coefficients(rgb);
        // Where colours are mixed by themselves, that of black counts: it is black.
        let black = s == 0.0 && mapping == Mapping::Poles;
        Texel { coefficients: if black { upsample::coefficients([0.0; 3]) } else { coefficients }, scale: s * scale }
    };
    pixels.par_iter().with_min_len(1024).map(texel).collect()
}

/// The density that follows the luminance of each texel's neighbourhood (the largest of its 3 × 3,
/// because bilinear look-ups spread a texel over its neighbours) times sin θ.
fn neighbourhood(luminance: &[f64], width: usize, height: usize) -> PiecewiseConstant2d {
    let mut weights = vec![0.0; width * height];
    for y in 0..height {
        let sin = libm::sin(PI * (y as f64 + 0.5) / height as f64);
        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
        let column = |x: usize| rows.map(|row| luminance[row * width + x]).into_iter().fold(0.0f64, f64::max);
        let (first, last) = (column(0), column(width - 1));
        let (mut left, mut here) = (last, first);
        for x in 0..width {
            let right = if x + 1 < width { column(x + 1) } else { first };
            weights[y * width + x] = left.max(here).max(right) * sin;
            (left, here) = (here, right);
        }
    }
    PiecewiseConstant2d::new(&weights, width, height)
}

/// A density on the unit square that is bilinear between the values at texels as [`Mapping::Poles`]
/// places them, times the mean of sin θ in each row of cells.
///
/// Cell (x, y) lies between columns x and x + 1, and rows y and y + 1, of texels.
#[derive(Clone, Debug)]
struct PiecewiseBilinear2d {
    cells: PiecewiseConstant2d,
    /// At texels: width × height.
    values: Vec<f32>,
    width: usize,
    height: usize,
}

impl PiecewiseBilinear2d {
    fn new(values: &[f64], width: usize, height: usize) -> PiecewiseBilinear2d {
        // A single row stands for both poles.
        let values: Vec<f32> = if height == 1 { [values, values].concat() } else { values.to_vec() }
            .into_iter()
            .map(|v| v as f32)
            .collect();
        let height = height.max(2);
        let mut table = PiecewiseBilinear2d { cells: PiecewiseConstant2d::new(&[0.0], 1, 1), values, width, height };
        let rows = height - 1;
        let mut weights = Vec::with_capacity(width * rows);
        for y in 0..rows {
            // ∫ sin θ over the row of cells.
            let (from, to) = (y as f64 / rows as f64, (y + 1) as f64 / rows as f64);
            let sin = libm::cos(PI * from) - libm::cos(PI * to);
            weights.extend((0..width).map(|x| table.corners(x, y).into_iter().sum::<f64>() * sin));
        }
        table.cells = PiecewiseConstant2d::new(&weights, width, rows);
        table
    }

    /// The values at the corners of a cell: upper left, upper right, lower left, lower right.
    fn corners(&self, x: usize, y: usize) -> [f64; 4] {
        let right = if x + 1 == self.width { 0 } else { x + 1 };
        let at = |x: usize, y: usize| f64::from(self.values[y * self.width + x]);
        [at(x, y), at(right, y), at(x, y + 1), at(right, y + 1)]
    }

    /// A point and its density. A cell is half a column to the right of its left texel's edge.
    fn sample(&self, u: DVec2) -> Option<(DVec2, f64)> {
        let cell = self.cells.sample_cell(u)?;
        let [a, b, c, d] = self.corners(cell.column, cell.row);
        // Down the cell by the sums of its rows, then across by the values at that height.
        let y = linear(a + b, c + d, cell.within.y);
        let (left, right) = (a + (c - a) * y, b + (d - b) * y);
        let x = linear(left, right, cell.within.x);
        let (n, m) = (self.width as f64, (self.height - 1) as f64);
        let mut at = DVec2::new((cell.column as f64 + x + 0.5) / n, (cell.row as f64 + y) / m);
        if at.x >= 1.0 {
            at.x -= 1.0;
        }
        let shape = 4.0 * (left + (right - left) * x) / (a + b + c + d);
        (shape > 0.0).then(|| (at, self.cells.density(cell.row, cell.column) * shape))
    }

    fn pdf(&self, at: DVec2) -> f64 {
        let (n, m) = (self.width as f64, (self.height - 1) as f64);
        let x = at.x * n - 0.5;
        let x = if x < 0.0 { x + n } else { x };
        let column = (x as usize).min(self.width - 1);
        let row = ((at.y * m) as usize).min(self.height - 2);
        let (fx, fy) = (x - column as f64, at.y * m - row as f64);
        let [a, b, c, d] = self.corners(column, row);
        let (left, right) = (a + (c - a) * fy, b + (d - b) * fy);
        let density = self.cells.density(row, column);
        if density > 0.0 { density * 4.0 * (left + (right - left) * fx) / (a + b + c + d) } else { 0.0 }
    }
}

/// A number in [0, 1] with a density that goes linearly from `a` to `b`, not both zero, by `u`.
fn linear(a: f64, b: f64, u: f64) -> f64 {
    // The root of a x + (b − a) x² / 2 = u (a + b) / 2, free of cancellation.
    let root = (a * a + u * (b * b - a * a)).max(0.0).sqrt();
    (u * (a + b) / (a + root)).clamp(0.0, 1.0)
}

/// Cells for which a row has one entry in its guide.
const CELLS_A_GUIDE: usize = 8;

/// A density on the unit square that is constant in each cell of a grid.
#[derive(Clone, Debug)]
struct PiecewiseConstant2d {
    width: usize,
    height: usize,
    /// For each row, the running sums of its cells over the row's total, `width + 1` entries.
    rows: Vec<f64>,
    /// The same over rows.
    marginal: Vec<f64>,
    /// For each row, where in it the searches for k / `guides` start, `guides + 1` entries: a search stays within two
    /// cache lines instead of one for each halving (Chen and Asau 1974).
    guide: Vec<u32>,
    /// A power of two, so that u · `guides` is exact.
    guides: usize,
}

/// A place in a cell of a grid.
struct Cell {
    row: usize,
    column: usize,
    within: DVec2,
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
        let guides = (width / CELLS_A_GUIDE).max(1).next_power_of_two();
        let start = |row: &[f64], k: usize| row.partition_point(|&c| c <= k as f64 / guides as f64) as u32;
        let guide = rows
            .chunks_exact(width + 1)
            .flat_map(|row| (0..guides).map(move |k| start(row, k)).chain([row.len() as u32]))
            .collect();
        PiecewiseConstant2d { width, height, rows, marginal, guide, guides }
    }

    fn row(&self, y: usize) -> &[f64] {
        &self.rows[y * (self.width + 1)..(y + 1) * (self.width + 1)]
    }

    /// [`PiecewiseConstant2d::invert`] of a row.
    fn invert_row(&self, row: usize, u: f64) -> Option<(usize, f64)> {
        let k = row * (self.guides + 1) + ((u * self.guides as f64) as usize).min(self.guides - 1);
        let (from, to) = (self.guide[k] as usize, self.guide[k + 1] as usize);
        let cdf = self.row(row);
        Self::within(cdf, from + cdf[from..to].partition_point(|&c| c <= u), u)
    }

    /// Cell and position within the table where the running sum reaches `u`.
    fn invert(cdf: &[f64], u: f64) -> Option<(usize, f64)> {
        Self::within(cdf, cdf.partition_point(|&c| c <= u), u)
    }

    /// The same, where `above` sums of the table are not above `u`.
    fn within(cdf: &[f64], above: usize, u: f64) -> Option<(usize, f64)> {
        let n = cdf.len() - 1;
        let cell = above.saturating_sub(1).min(n - 1);
        let mass = cdf[cell + 1] - cdf[cell];
        (mass > 0.0).then(|| (cell, (cell as f64 + ((u - cdf[cell]) / mass).clamp(0.0, 1.0)) / n as f64))
    }

    /// A point and its density.
    fn sample(&self, u: DVec2) -> Option<(DVec2, f64)> {
        let (row, y) = Self::invert(&self.marginal, u.y)?;
        let (column, x) = self.invert_row(row, u.x)?;
        Some((DVec2::new(x, y), self.density(row, column)))
    }

    /// A cell, and numbers uniform in [0, 1] within it.
    fn sample_cell(&self, u: DVec2) -> Option<Cell> {
        let (row, y) = Self::invert(&self.marginal, u.y)?;
        let (column, x) = self.invert_row(row, u.x)?;
        let within = DVec2::new(x * self.width as f64 - column as f64, y * self.height as f64 - row as f64);
        Some(Cell { row, column, within: within.clamp(DVec2::ZERO, DVec2::ONE) })
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

    fn bright_spot(mapping: Mapping) -> Environment {
        let (w, h) = (16, 8);
        let pixels: Vec<[f32; 3]> =
            (0..w * h).map(|i| if i == 3 * w + 11 { [50.0; 3] } else { [0.1 + 0.01 * (i % 7) as f32; 3] }).collect();
        Environment::new(&pixels, w, h, 1.0, mapping, DMat3::from_rotation_y(0.7))
    }

    fn grid(n: u32) -> impl Iterator<Item = DVec2> {
        (0..n * n).map(move |i| DVec2::new(f64::from(i % n) + 0.5, f64::from(i / n) + 0.5) / f64::from(n))
    }

    fn green(map: &Environment, direction: DVec3) -> f64 {
        f64::from(map.radiance(direction.normalize(), Lanes::splat(550.0)).to_array()[0])
    }

    /// The guide changes how many sums are looked at, not which one is found: rows with cells of nothing at either
    /// end and between, one that is all in one cell, one that is empty, at sums themselves and between.
    #[test]
    fn guided_searches_find_what_a_search_of_the_whole_row_finds() {
        let width = 200;
        let weight = |row: usize, x: usize| match row {
            0 => 1.0 + (x % 7) as f64,
            1 => f64::from(u8::from(x % 40 > 30)) * x as f64,
            2 => f64::from(u8::from(x == 117)),
            _ => 0.0,
        };
        let weights: Vec<f64> = (0..4 * width).map(|i| weight(i / width, i % width)).collect();
        let table = PiecewiseConstant2d::new(&weights, width, 4);
        assert!(table.guides > 1);
        for row in 0..4 {
            let sums = table.row(row).to_vec();
            for u in (0..4096).map(|k| f64::from(k) / 4096.0).chain(sums.into_iter().filter(|&u| u < 1.0)) {
                assert_eq!(table.invert_row(row, u), PiecewiseConstant2d::invert(table.row(row), u), "{row} {u}");
            }
        }
    }

    #[test]
    fn density_of_sampled_directions_is_the_stated_one() {
        for mapping in [Mapping::Texels, Mapping::Poles] {
            let map = bright_spot(mapping);
            for u in grid(64) {
                let s = map.sample(u).unwrap();
                assert!((s.direction.length() - 1.0).abs() < 1e-14);
                let pdf = map.pdf(s.direction);
                // On the border of a cell rounding may pick the neighbour.
                let border = mapping == Mapping::Texels && u.x * 64.0 % 4.0 < 1.0;
                assert!((pdf / s.pdf_solid_angle - 1.0).abs() < 1e-9 || border, "{mapping:?} {u} {pdf} {s:?}");
            }
        }
    }

    /// ∫ pdf dω = 1, over 512² midpoints of a function that is smooth in each of 128 cells: each
    /// cell border is off by at most half a step of 1/512 in one dimension.
    #[test]
    fn density_integrates_to_one() {
        for mapping in [Mapping::Texels, Mapping::Poles] {
            let map = bright_spot(mapping);
            let mean = grid(512).map(|u| map.pdf(crate::math::warp::uniform_sphere(u))).sum::<f64>() / 262_144.0;
            assert!((mean * 4.0 * PI - 1.0).abs() < 5e-3, "{}", mean * 4.0 * PI);
        }
    }

    /// What is found by sampling the map is what an even sweep over directions finds. The samples are a
    /// Kronecker sequence (a lattice would beat with the cells): its error falls as 1/N, 65 536 leave 1e-3.
    #[test]
    fn sampled_and_uniform_directions_find_the_same_light() {
        for mapping in [Mapping::Texels, Mapping::Poles] {
            let map = bright_spot(mapping);
            let at = |u| map.sample(u).map_or(0.0, |s| green(&map, s.direction) / s.pdf_solid_angle);
            let irrational = |i: u32| (DVec2::new(0.754_877_666, 0.569_840_291) * f64::from(i)).fract();
            let sampled = (0..65536).map(|i| at(irrational(i))).sum::<f64>() / 65536.0;
            let swept = grid(512).map(|u| green(&map, crate::math::warp::uniform_sphere(u))).sum::<f64>() / 262_144.0;
            assert!((sampled / (4.0 * PI * swept) - 1.0).abs() < 2e-3, "{mapping:?} {sampled} {}", 4.0 * PI * swept);
        }
    }

    #[test]
    fn the_middle_column_looks_along_minus_z_and_the_top_row_up() {
        let (w, h) = (8, 4);
        let mut pixels = vec![[0.0; 3]; w * h];
        pixels[..w].fill([1.0; 3]);
        pixels[2 * w + 4] = [4.0; 3];
        let map = Environment::new(&pixels, w, h, 1.0, Mapping::Texels, DMat3::IDENTITY);
        assert!(green(&map, DVec3::Y) > 0.5 && green(&map, -DVec3::Y) < 1e-6);
        // The centre of column 4 of 8 lies half a column (22.5°) to the right of −z.
        let (s, c) = (PI / 8.0).sin_cos();
        let down = -PI / 8.0;
        let d = DVec3::new(s * down.cos(), down.sin(), -c * down.cos());
        assert!(green(&map, d) > 3.0 && green(&map, d * DVec3::new(-1.0, 1.0, 1.0)) < 0.5);
    }

    /// Rows 0 and h − 1 are the poles themselves; the left edge is −z, so that column 0 of 4 lies 45°
    /// to the right of it (toward +x), and halfway across the seam the first and the last column share.
    #[test]
    fn rows_reach_the_poles_and_columns_go_around_where_mitsuba_has_them() {
        let (w, h) = (4, 3);
        let mut grey = [1.0f32; 12];
        grey[..4].fill(3.0);
        grey[8..].fill(5.0);
        (grey[4], grey[7]) = (2.0, 4.0);
        let map = Environment::new(&grey.map(|g| [g; 3]), w, h, 1.0, Mapping::Poles, DMat3::IDENTITY);
        let unit = map.illuminant.at(550.0);
        let find = |d: DVec3| green(&map, d) / unit;
        let cases = [
            (DVec3::Y, 3.0),
            (-DVec3::Y, 5.0),
            (DVec3::new(1.0, 0.0, -1.0), 2.0),
            (DVec3::new(-1.0, 0.0, -1.0), 4.0),
            (DVec3::new(0.0, 0.0, -1.0), 3.0),
            // Halfway from the equator to the pole.
            (DVec3::new(1.0, 2f64.sqrt(), -1.0), 2.5),
        ];
        for (direction, expected) in cases {
            // Greys are flat spectra: f32 sigmoids and D65's f32 table.
            assert!((find(direction) / expected - 1.0).abs() < 1e-5, "{direction} {} {expected}", find(direction));
        }
    }

    /// Between a black and a white texel the colour and the factor are each half: a quarter of the white.
    #[test]
    fn colour_and_brightness_are_mixed_apart_where_mitsuba_does() {
        let mut pixels = [[0.0; 3]; 6];
        (pixels[0], pixels[2], pixels[4]) = ([1.0; 3], [1.0; 3], [1.0; 3]);
        let at = |mapping| green(&Environment::new(&pixels, 2, 3, 1.0, mapping, DMat3::IDENTITY), -DVec3::Z);
        let unit = illuminant::d65().at(550.0);
        assert!((at(Mapping::Poles) / unit - 0.25).abs() < 1e-5);
        assert!((at(Mapping::Texels) / unit - 0.5).abs() < 1e-5);
    }

    #[test]
    fn a_black_map_is_never_sampled() {
        for mapping in [Mapping::Texels, Mapping::Poles] {
            let map = Environment::new(&[[0.0; 3]; 8], 4, 2, 1.0, mapping, DMat3::IDENTITY);
            assert!(map.sample(DVec2::splat(0.5)).is_none());
        }
    }
}
