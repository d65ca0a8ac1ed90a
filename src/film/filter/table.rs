//! A filter along an axis as a table: where it is sampled by numbers, and how dense.

use super::{Filter, Portion};
use crate::error::{Error, Result};
use wide::f32x8;

/// Cells of the table from the centre to the radius.
const CELLS: usize = 1024;

/// The magnitude of one half of an axis as a piecewise linear density, with nodes at its sign changes.
#[derive(Clone, Debug)]
pub(super) struct Table {
    /// Positions, from 0 to the radius.
    pub(super) x: Vec<f64>,
    /// |f| at the positions, over ∫|f|.
    density: Vec<f64>,
    /// ∫ of the density from 0 to the positions; ends with 1.
    cumulative: Vec<f64>,
    /// ∫f / ∫|f| from 0 to the positions.
    signed: Vec<f64>,
    /// Whether f is negative between a position and the next.
    pub(super) negative: Vec<bool>,
    /// For u in [i, i + 1) / CELLS: the first cell that can hold it.
    guide: Vec<u32>,
    /// The density at the positions, if they are evenly spaced, and how much it grows to the next; nothing at the last.
    steps: Vec<[f32; 2]>,
    /// How many of these a pixel has.
    steps_of_a_pixel: f32,
    /// (∫|f| / ∫f)², the magnitude of the weight in two dimensions.
    pub(super) weight: f32,
}

impl Table {
    pub(super) fn new(filter: &Filter) -> Result<Table> {
        // Nodes: a regular grid, and each zero between two nodes of unlike sign, by bisection.
        let radius = filter.radius();
        let mut x = vec![0.0];
        let mut value = vec![filter.eval(0.0)];
        for i in 1..=CELLS {
            let end = radius * i as f64 / CELLS as f64;
            let end_value = filter.eval(end);
            let (start, start_value) = (x[x.len() - 1], value[value.len() - 1]);
            if start_value * end_value < 0.0 {
                let (mut low, mut high) = (start, end);
                loop {
                    let middle = 0.5 * (low + high);
                    if middle <= low || middle >= high {
                        break;
                    }
                    if filter.eval(middle) * start_value > 0.0 { low = middle } else { high = middle }
                }
                x.push(high);
                value.push(0.0);
            }
            x.push(end);
            value.push(end_value);
        }
        // Signed and absolute areas of the trapezia.
        let mut cumulative = vec![0.0];
        let mut sums = vec![0.0];
        let mut negative = Vec::new();
        let mut signed = 0.0;
        for i in 1..x.len() {
            let area = 0.5 * (value[i - 1] + value[i]) * (x[i] - x[i - 1]);
            signed += area;
            sums.push(signed);
            negative.push(area < 0.0);
            cumulative.push(cumulative[i - 1] + area.abs());
        }
        let total = cumulative[cumulative.len() - 1];
        if !(signed > 0.0 && total.is_finite()) {
            return Err(Error::Config(format!(
                "filter: {filter:?}: its integral is {signed}, expected more than zero"
            )));
        }
        for c in cumulative.iter_mut().chain(&mut sums) {
            *c /= total;
        }
        let density: Vec<f64> = value.iter().map(|v| v.abs() / total).collect();
        let step = |pair: &[f64]| [pair[0] as f32, (pair[1] - pair[0]) as f32];
        let steps = density.windows(2).map(step).chain([[0.0; 2]]).collect();
        let cells = cumulative.len() - 1;
        let guide = (0..CELLS)
            .map(|i| cumulative[1..cells].partition_point(|&c| c <= i as f64 / CELLS as f64) as u32)
            .collect();
        let axis = total / signed;
        // Non-negative filters: signed and total are the same sums of the same areas, so axis is 1 exactly.
        let weight = (axis * axis) as f32;
        let steps_of_a_pixel = (CELLS as f64 / radius) as f32;
        Ok(Table { x, density, cumulative, signed: sums, negative, guide, weight, steps, steps_of_a_pixel })
    }

    /// What lies between the centre and `x` of 0 or more.
    pub(super) fn until(&self, x: f64) -> Portion {
        let last = self.negative.len();
        if x >= self.x[last] {
            return Portion { magnitude: self.cumulative[last], signed: self.signed[last] };
        }
        let cell = self.x[1..last].partition_point(|end| *end <= x);
        let (a, b) = (self.density[cell], self.density[cell + 1]);
        let (step, width) = (x - self.x[cell], self.x[cell + 1] - self.x[cell]);
        let area = step * (a + 0.5 * (b - a) * step / width);
        let signed = if self.negative[cell] { -area } else { area };
        Portion { magnitude: self.cumulative[cell] + area, signed: self.signed[cell] + signed }
    }

    /// The filter at `x` of 0 or more, over ∫|f| of one side.
    pub(super) fn value(&self, x: f64) -> f64 {
        let last = self.negative.len();
        if x >= self.x[last] {
            return 0.0;
        }
        let cell = self.x[1..last].partition_point(|end| *end <= x);
        let (a, b) = (self.density[cell], self.density[cell + 1]);
        let magnitude = a + (b - a) * (x - self.x[cell]) / (self.x[cell + 1] - self.x[cell]);
        if self.negative[cell] { -magnitude } else { magnitude }
    }

    /// The densities at `x` of 0 or more of a filter without zeros: positions are evenly spaced.
    #[inline]
    pub(super) fn densities(&self, x: f32x8) -> f32x8 {
        let at = (x * self.steps_of_a_pixel).min(f32x8::splat(CELLS as f32));
        let cells = at.fast_trunc_int();
        let (mut values, mut slopes) = ([0.0; 8], [0.0; 8]);
        for ((value, slope), cell) in values.iter_mut().zip(&mut slopes).zip(cells.to_array()) {
            [*value, *slope] = self.steps[cell as usize];
        }
        (at - f32x8::from_i32x8(cells)).mul_add(f32x8::new(slopes), f32x8::new(values))
    }

    /// The position at `u` in [0, 1), and whether f is negative there.
    pub(super) fn sample(&self, u: f64) -> (f64, bool) {
        // Both halves share the table: v runs from the centre outwards.
        let (v, side) = if u < 0.5 { (1.0 - 2.0 * u, -1.0) } else { (2.0 * u - 1.0, 1.0) };
        let last = self.negative.len() - 1;
        let mut cell = self.guide[((v * CELLS as f64) as usize).min(CELLS - 1)] as usize;
        while cell < last && self.cumulative[cell + 1] <= v {
            cell += 1;
        }
        // In the cell the density is a + (b − a)·t: solve a·t + (b − a)·t²/2 = (v − cumulative)/width for t,
        // in the form of the root that does not cancel.
        let (a, b) = (self.density[cell], self.density[cell + 1]);
        let width = self.x[cell + 1] - self.x[cell];
        let area = (v - self.cumulative[cell]).max(0.0) / width;
        let root = (a * a + 2.0 * (b - a) * area).max(0.0).sqrt();
        let t = if a + root > 0.0 { (2.0 * area / (a + root)).min(1.0) } else { 0.0 };
        (side * (self.x[cell] + t * width), self.negative[cell])
    }
}
