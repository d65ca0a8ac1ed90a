//! A density on the unit square that is constant in each cell of a grid.

use glam::DVec2;

/// Cells along each side.
pub const SIDE: usize = 16;

/// A piecewise constant density. Cells are drawn by rows: the second coordinate first.
#[derive(Clone, Debug, PartialEq)]
pub struct Guide {
    /// Running sums over rows; one at the end.
    rows: [f64; SIDE],
    /// Running sums within each row.
    cells: [[f64; SIDE]; SIDE],
}

/// The first index whose running sum is above `u`, and where in its step `u` lies.
fn invert(sums: &[f64; SIDE], u: f64) -> (usize, f64) {
    let i = sums.partition_point(|&s| s <= u).min(SIDE - 1);
    let below = if i == 0 { 0.0 } else { sums[i - 1] };
    (i, ((u - below) / (sums[i] - below)).clamp(0.0, 1.0 - f64::EPSILON))
}

fn step(sums: &[f64; SIDE], i: usize) -> f64 {
    sums[i] - if i == 0 { 0.0 } else { sums[i - 1] }
}

fn running(values: [f64; SIDE]) -> [f64; SIDE] {
    let total: f64 = values.iter().sum();
    let mut sum = 0.0;
    let mut sums = values.map(|v| {
        sum += v / total;
        sum
    });
    sums[SIDE - 1] = 1.0;
    sums
}

impl Guide {
    /// The same everywhere.
    #[must_use]
    pub fn uniform() -> Guide {
        Guide::of(&[[1.0; SIDE]; SIDE])
    }

    /// Proportional to `weights`, row by row; all must be above zero.
    #[must_use]
    pub fn of(weights: &[[f64; SIDE]; SIDE]) -> Guide {
        let totals = weights.map(|row| row.iter().sum::<f64>());
        Guide { rows: running(totals), cells: weights.map(running) }
    }

    /// The cell that holds `x`: row, column.
    #[must_use]
    pub fn cell(x: DVec2) -> (usize, usize) {
        let index = |x: f64| ((x * SIDE as f64) as usize).min(SIDE - 1);
        (index(x.y), index(x.x))
    }

    /// The point for `u`.
    #[must_use]
    pub fn sample(&self, u: DVec2) -> DVec2 {
        let (row, y) = invert(&self.rows, u.y);
        let (column, x) = invert(&self.cells[row], u.x);
        DVec2::new(column as f64 + x, row as f64 + y) / SIDE as f64
    }

    /// The density at `x`; its mean over the square is one.
    #[must_use]
    pub fn density(&self, x: DVec2) -> f64 {
        let (row, column) = Guide::cell(x);
        step(&self.rows, row) * step(&self.cells[row], column) * (SIDE * SIDE) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a regular grid land in each cell as often as its weight says, to the grid's own coarseness, and the
    /// density integrates to one.
    #[test]
    fn points_follow_the_weights() {
        let mut weights = [[1.0; SIDE]; SIDE];
        weights[3][5] = 100.0;
        weights[9] = [7.0; SIDE];
        let guide = Guide::of(&weights);
        let total: f64 = weights.iter().flatten().sum();
        let n = 1024;
        let mut found = [[0.0; SIDE]; SIDE];
        for i in 0..n {
            for j in 0..n {
                let u = (DVec2::new(f64::from(i), f64::from(j)) + 0.5) / f64::from(n);
                let (row, column) = Guide::cell(guide.sample(u));
                found[row][column] += 1.0 / f64::from(n * n);
            }
        }
        for row in 0..SIDE {
            for column in 0..SIDE {
                let expected = weights[row][column] / total;
                // A share of n numbers is met to one of them along each axis.
                let of_row = weights[row].iter().sum::<f64>() / total;
                let slack = (of_row + expected / of_row + 1.0 / f64::from(n)) / f64::from(n) + 1e-12;
                assert!((found[row][column] - expected).abs() < slack, "{row} {column}");
                let x = (DVec2::new(column as f64, row as f64) + 0.5) / SIDE as f64;
                assert!((guide.density(x) / (SIDE * SIDE) as f64 - expected).abs() < 1e-12);
            }
        }
    }
}
