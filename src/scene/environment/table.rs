//! A density over a grid that is constant in each cell.

use crate::scene::bvh::prefetch;
use glam::DVec2;

/// Cells for which a row has one entry in its guide.
const CELLS_A_GUIDE: usize = 8;

/// One: sums are kept in units of 2⁻³², which is what the numbers that choose among them are multiples of.
const ONE: f64 = 4_294_967_296.0;

/// Rows of running sums of weights, each over the row's total.
///
/// A sum is off by half a unit of 2⁻³² at most, so the share of a cell by one unit, and by one more where it ends at one.
#[derive(Clone, Debug)]
struct Rows {
    width: usize,
    /// `width + 1` entries a row; one itself is stored as 1 − 2⁻³².
    sums: Vec<u32>,
    /// For each row, where in it the searches for k / `guides` start, `guides + 1` entries: a search stays within two
    /// cache lines instead of one for each halving (Chen and Asau 1974).
    guide: Vec<u32>,
    /// A power of two, so that u · `guides` is exact.
    guides: usize,
}

impl Rows {
    /// Of rows of `width` weights; and the total of each.
    fn new(weights: &[f64], width: usize) -> (Rows, Vec<f64>) {
        let guides = (width / CELLS_A_GUIDE).max(1).next_power_of_two();
        let count = weights.len() / width;
        let mut sums: Vec<u32> = Vec::with_capacity(count * (width + 1));
        let mut guide = Vec::with_capacity(count * (guides + 1));
        let mut totals = Vec::with_capacity(count);
        for row in weights.chunks_exact(width) {
            let total: f64 = row.iter().sum();
            let unit = if total > 0.0 { ONE / total } else { 0.0 };
            let start = sums.len();
            let mut sum = 0.0;
            sums.push(0);
            // The cast saturates.
            sums.extend(row.iter().map(|w| {
                sum += w;
                (sum * unit + 0.5) as u32
            }));
            let row = &sums[start..];
            let mut above = 0;
            for k in 0..guides {
                let from = (ONE * (k as f64 / guides as f64)) as u32;
                while above <= width && row[above] <= from {
                    above += 1;
                }
                guide.push(above as u32);
            }
            guide.push(width as u32 + 1);
            totals.push(total);
        }
        (Rows { width, sums, guide, guides }, totals)
    }

    fn row(&self, y: usize) -> &[u32] {
        &self.sums[y * (self.width + 1)..(y + 1) * (self.width + 1)]
    }

    /// The cell of a row where the running sum reaches `u`, and how far into it; `None` in a row of nothing.
    #[inline]
    fn find(&self, row: usize, u: f64) -> Option<(usize, f64)> {
        let at = u * ONE;
        // The last 2⁻³² counts as what lies before it: what is stored as 1 − 2⁻³² is one.
        let whole = (at as u32).min(u32::MAX - 1);
        let k = self.guided(row, u);
        let (from, to) = (self.guide[k] as usize, self.guide[k + 1] as usize);
        let sums = self.row(row);
        let above = from + sums[from..to].partition_point(|&sum| sum <= whole);
        let cell = above.saturating_sub(1).min(self.width - 1);
        let (below, mass) = (sums[cell], sums[cell + 1].saturating_sub(sums[cell]));
        (mass > 0).then(|| (cell, ((at - f64::from(below)) / f64::from(mass)).clamp(0.0, 1.0)))
    }

    /// Where in the guide a search for `u` starts.
    #[inline]
    fn guided(&self, row: usize, u: f64) -> usize {
        row * (self.guides + 1) + ((u * self.guides as f64) as u32 as usize).min(self.guides - 1)
    }

    /// Share of a cell in its row.
    fn share(&self, row: usize, cell: usize) -> f64 {
        let sums = self.row(row);
        f64::from(sums[cell + 1].saturating_sub(sums[cell])) * (1.0 / ONE)
    }
}

/// A density on the unit square that is constant in each cell of a grid.
#[derive(Clone, Debug)]
pub(super) struct PiecewiseConstant2d {
    width: usize,
    height: usize,
    rows: Rows,
    marginal: Rows,
}

/// A place in a cell of a grid.
pub(super) struct Cell {
    pub(super) row: usize,
    pub(super) column: usize,
    /// In [0, 1] from the cell's upper left corner.
    pub(super) within: DVec2,
}

impl PiecewiseConstant2d {
    /// After `weights`, row by row.
    pub(super) fn new(weights: &[f64], width: usize, height: usize) -> PiecewiseConstant2d {
        let (rows, totals) = Rows::new(weights, width);
        let (marginal, _) = Rows::new(&totals, height);
        PiecewiseConstant2d { width, height, rows, marginal }
    }

    /// A point and its density; `None` where there is no weight.
    pub(super) fn sample(&self, u: DVec2) -> Option<(DVec2, f64)> {
        let cell = self.sample_cell(u)?;
        let (x, y) = (cell.column as f64 + cell.within.x, cell.row as f64 + cell.within.y);
        let at = DVec2::new(x / self.width as f64, y / self.height as f64);
        Some((at, self.density(cell.row, cell.column)))
    }

    /// A cell, and numbers uniform in [0, 1] within it.
    #[inline]
    pub(super) fn sample_cell(&self, u: DVec2) -> Option<Cell> {
        self.cell_of_row(self.marginal.find(0, u.y)?, u.x)
    }

    /// The cell of a row, and how far down in it a point is, that is found by `u`.
    #[inline]
    fn cell_of_row(&self, (row, y): (usize, f64), u: f64) -> Option<Cell> {
        let (column, x) = self.rows.find(row, u)?;
        Some(Cell { row, column, within: DVec2::new(x, y) })
    }

    /// [`PiecewiseConstant2d::sample_cell`] of up to `N` points side by side: none waits for memory alone.
    pub(super) fn sample_cells<const N: usize>(&self, us: &[DVec2]) -> [Option<Cell>; N] {
        let mut rows = [None; N];
        for (row, u) in rows.iter_mut().zip(us) {
            *row = self.marginal.find(0, u.y);
            if let Some((row, _)) = *row {
                prefetch(&self.rows.guide, self.rows.guided(row, u.x));
            }
        }
        for (row, u) in rows.iter().zip(us) {
            if let Some((row, _)) = *row {
                let from = self.rows.guide[self.rows.guided(row, u.x)] as usize;
                prefetch(&self.rows.sums, row * (self.width + 1) + from);
            }
        }
        let mut cells = [const { None }; N];
        for ((cell, row), u) in cells.iter_mut().zip(rows).zip(us) {
            *cell = row.and_then(|row| self.cell_of_row(row, u.x));
        }
        cells
    }

    fn density(&self, row: usize, column: usize) -> f64 {
        self.marginal.share(0, row) * self.rows.share(row, column) * (self.width * self.height) as f64
    }

    /// Density of [`PiecewiseConstant2d::sample`].
    pub(super) fn pdf(&self, p: DVec2) -> f64 {
        let cell = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
        self.density(cell(p.y, self.height), cell(p.x, self.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let (table, _) = Rows::new(&weights, width);
        assert!(table.guides > 1);
        for row in 0..4 {
            let sums: Vec<f64> = table.row(row).iter().map(|&s| f64::from(s) / ONE).collect();
            for u in (0..4096).map(|k| f64::from(k) / 4096.0).chain(sums.iter().copied().filter(|&u| u < 1.0)) {
                let u = u.min(1.0 - 2.0 / ONE);
                let cell = (0..width).find(|&x| sums[x] <= u && u < sums[x + 1]);
                assert_eq!(table.find(row, u).map(|(cell, _)| cell), cell, "{row} {u}");
            }
        }
    }

    /// Points side by side fall into the cells that they fall into alone.
    #[test]
    fn cells_of_several_points_are_those_of_each() {
        let (width, height) = (64, 16);
        let weights: Vec<f64> =
            (0..width * height).map(|i| if i / width == 5 { 0.0 } else { ((i * 37) % 11) as f64 }).collect();
        let table = PiecewiseConstant2d::new(&weights, width, height);
        let us: Vec<DVec2> = (0..64).map(|i| DVec2::new(f64::from(i * 29 % 64), f64::from(i)) / 64.0).collect();
        let named = |cell: Option<Cell>| cell.map(|cell| (cell.row, cell.column, cell.within));
        for us in us.chunks(8) {
            let found = table.sample_cells::<8>(us).map(named);
            assert_eq!(found[..], us.iter().map(|&u| named(table.sample_cell(u))).collect::<Vec<_>>());
        }
        assert!(table.sample_cells::<8>(&us[..3])[3..].iter().all(Option::is_none));
    }

    /// Half a unit of rounding at either end of a cell, and one that is stored a unit low; the last number of 32 bits finds the last cell with weight.
    #[test]
    fn shares_are_those_of_the_weights_to_two_units() {
        let weights = [0.3, 0.0, 1e-3, 7.0, 1e-12, 2.5, 0.0];
        let (table, totals) = Rows::new(&weights, weights.len());
        for (x, w) in weights.iter().enumerate() {
            assert!((table.share(0, x) - w / totals[0]).abs() <= 2.0 / ONE, "{x}");
        }
        assert_eq!(table.find(0, 1.0 - 1.0 / ONE).map(|(cell, _)| cell), Some(5));
    }
}
