//! Tabulated functions of wavelength, linear between their knots.

use crate::error::in_short;
use crate::spectrum::{BAND_NM, LANES, Lanes, whole};

/// What a table is worth beyond its first and last knot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// Zero: emission that was not measured is not assumed.
    Zero,
    /// The value of the nearest knot: a reflectance does not end where its measurement did.
    Hold,
}

/// Values at knots, linear between them; two knots at one wavelength are a jump.
#[derive(Clone, Debug)]
pub struct Table {
    /// Wavelength, nm, and value, in ascending order.
    knots: Vec<(f64, f32)>,
    /// What lanes are looked up in.
    search: Search,
    outside: Outside,
    /// First and last knot, nm: lanes look no further for them.
    range: [f64; 2],
}

/// Two ways to the value at a wavelength.
#[derive(Clone, Debug)]
enum Search {
    /// Cells of one width, none with a jump in it or more than one knot: one look finds all that there is to know.
    Cells {
        /// Where the first begins, nm.
        first: f32,
        /// How many there are to a nanometre.
        inv_width: f32,
        cells: Vec<Cell>,
    },
    /// For knots too crowded for that.
    Crowded {
        /// Wavelength of a knot in nm, value there, growth per nm up to the next (0 at a jump and at the
        /// last). Before the first stands its value at 0 nm, after the last a knot at infinity.
        entries: Vec<[f32; 3]>,
        /// For each whole nm of the band, the last knot at or below it.
        start: Vec<u16>,
        /// The most knots that lie within a nanometre of the band.
        steps: u16,
    },
}

/// Value where a cell begins, growth over the cell, place of the knot in it as a part of its width, and what growth gains there.
type Cell = [f32; 4];

/// The most cells that the band is cut into: at 0.9 nm each, a table of them has 8 KiB.
const MOST_CELLS: usize = 512;

impl Table {
    /// The most samples.
    pub(crate) const MOST: usize = u16::MAX as usize;

    /// A table of (nm, value) in ascending order of wavelength.
    ///
    /// # Errors
    /// In words, if there are fewer than two knots or more than 65 535, if wavelengths are not
    /// positive, not ascending or thrice the same, or if a value is negative or not finite.
    pub fn new(samples: &[(f64, f64)], outside: Outside) -> Result<Table, String> {
        if samples.len() < 2 {
            return Err(format!("expected at least 2 samples (nm, value), found {}", samples.len()));
        }
        if samples.len() > Table::MOST {
            return Err(format!("expected at most {} samples, found {}", Table::MOST, samples.len()));
        }
        for (i, &(nm, value)) in samples.iter().enumerate() {
            if !(nm.is_finite() && nm > 0.0) {
                return Err(format!("sample {i}: expected a wavelength in nm, found {}", in_short(nm)));
            }
            if !(value.is_finite() && value >= 0.0 && value <= f64::from(f32::MAX)) {
                let [nm, value] = [nm, value].map(in_short);
                return Err(format!("sample {i} at {nm} nm: expected a value from 0 to 3.4e38, found {value}"));
            }
        }
        for (i, w) in samples.windows(2).enumerate() {
            if w[1].0 < w[0].0 {
                return Err(format!(
                    "sample {}: expected ascending wavelengths, found {} after {} nm",
                    i + 1,
                    in_short(w[1].0),
                    in_short(w[0].0)
                ));
            }
        }
        if let Some(w) = samples.windows(3).find(|w| w[0].0 == w[2].0) {
            return Err(format!(
                "expected at most two samples at one wavelength (a jump), found three at {} nm",
                w[0].0
            ));
        }
        Ok(Table::from_checked(samples, outside))
    }

    /// A table at `first`, `first` + `step`, … nm. Values must be finite, not negative, and two or more.
    pub(crate) fn uniform(first: f64, step: f64, values: &[f64], outside: Outside) -> Table {
        let knots: Vec<_> =
            values.iter().enumerate().map(|(i, &value)| (first + step * i as f64, value as f32)).collect();
        let search = Search::grid(&knots, step);
        Table::with(knots, search, outside)
    }

    /// [`Table::new`] of samples known to be in order.
    pub(crate) fn from_checked(samples: &[(f64, f64)], outside: Outside) -> Table {
        let knots: Vec<_> = samples.iter().map(|&(nm, value)| (nm, value as f32)).collect();
        let search = match even_step(samples).or_else(|| whole_step(samples)) {
            Some(step) => Search::grid(&knots, step),
            None => Search::cells(&knots).unwrap_or_else(|| Search::crowded(&knots)),
        };
        Table::with(knots, search, outside)
    }

    fn with(knots: Vec<(f64, f32)>, search: Search, outside: Outside) -> Table {
        let range = [knots[0].0, knots[knots.len() - 1].0];
        Table { knots, search, outside, range }
    }

    /// The value at each wavelength (nm), which must be within the band.
    #[must_use]
    #[inline]
    pub fn eval(&self, nm: Lanes) -> Lanes {
        let value = match &self.search {
            Search::Cells { first, inv_width, cells } => {
                let t = (nm - Lanes::splat(*first)) * Lanes::splat(*inv_width);
                let last = cells.len() - 1;
                let t = t.fast_max(Lanes::splat(0.0)).fast_min(Lanes::splat(last as i32 as f32));
                // t is not negative: truncation is the floor.
                let of = t.fast_trunc_int();
                let f = t - whole(of);
                let of = of.to_array();
                // Of a wavelength that is not a number the last cell, where it stays none.
                let [value, growth, knot, gain] = columns(|k| cells[(of[k] as u32 as usize).min(last)]);
                gain.mul_add((f - knot).fast_max(Lanes::splat(0.0)), growth.mul_add(f, value))
            }
            Search::Crowded { entries, start, steps } => among_crowded(entries, start, *steps, nm),
        };
        // Where a line falls to nothing rounding may end below it; this order keeps what is not a number.
        let value = Lanes::splat(0.0).fast_max(value);
        match self.outside {
            Outside::Hold => value,
            Outside::Zero => {
                let [first, last] = self.range.map(|nm| Lanes::splat(nm as f32));
                value & (nm.simd_ge(first) & nm.simd_le(last))
            }
        }
    }

    /// The value at `nm`.
    #[must_use]
    pub fn at(&self, nm: f64) -> f64 {
        if self.outside == Outside::Zero && !(self.range[0]..=self.range[1]).contains(&nm) {
            return 0.0;
        }
        along(&self.knots, nm).0
    }

    /// This table with every value times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Table {
        let times: Vec<_> = self.samples().into_iter().map(|(nm, value)| (nm, value * factor)).collect();
        Table::from_checked(&times, self.outside)
    }

    /// The knots, nm, ascending.
    #[must_use]
    pub fn knots(&self) -> Vec<f64> {
        self.knots.iter().map(|knot| knot.0).collect()
    }

    /// The values at the knots.
    #[must_use]
    pub fn values(&self) -> Vec<f32> {
        self.knots.iter().map(|knot| knot.1).collect()
    }

    /// Wavelength and value of each knot.
    pub(crate) fn samples(&self) -> Vec<(f64, f64)> {
        self.knots.iter().map(|&(nm, value)| (nm, f64::from(value))).collect()
    }

    /// Whether f32 holds all values and slopes.
    pub(crate) fn is_finite(&self) -> bool {
        let numbers = match &self.search {
            Search::Cells { cells, .. } => cells.as_flattened(),
            Search::Crowded { entries, .. } => entries[1..entries.len() - 1].as_flattened(),
        };
        numbers.iter().all(|x| x.is_finite()) && self.knots.iter().all(|knot| knot.1.is_finite())
    }

    /// First and last knot, nm.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// What holds beyond the range.
    #[must_use]
    pub fn outside(&self) -> Outside {
        self.outside
    }
}

/// The distance of samples that are equally far from each other.
fn even_step(samples: &[(f64, f64)]) -> Option<f64> {
    let last = samples.len() - 1;
    let (first, end) = (samples[0].0, samples[last].0);
    let step = (end - first) / last as f64;
    // Up to the rounding of their decimals and of this product: 4 half ulps.
    let even = |i: usize| (samples[i].0 - (first + step * i as f64)).abs() <= 2.0 * f64::EPSILON * end;
    (step > 0.0 && (0..=last).all(even)).then_some(step)
}

/// The greatest distance in whole nanometres of which those between samples are multiples, if there are not too many.
fn whole_step(samples: &[(f64, f64)]) -> Option<f64> {
    let mut step = 0;
    for pair in samples.windows(2) {
        let apart = pair[1].0 - pair[0].0;
        if apart == 0.0 || pair[0].0.fract() != 0.0 || pair[1].0.fract() != 0.0 {
            return None;
        }
        // The greatest common divisor, by Euclid. The cast saturates.
        let mut rest = apart as u64;
        while rest > 0 {
            (step, rest) = (rest, step % rest);
        }
    }
    let cells = (samples[samples.len() - 1].0 - samples[0].0) / step as f64;
    (cells <= MOST_CELLS as f64).then_some(step as f64)
}

impl Search {
    /// Cells of which each begins at a place of a grid on which all knots lie: where one ends the next begins, to the bit.
    fn grid(knots: &[(f64, f32)], step: f64) -> Search {
        let first = knots[0].0;
        let count = ((knots[knots.len() - 1].0 - first) / step).round() as usize;
        let value = |i: usize| along(knots, step.mul_add(i as f64, first)).0;
        let cells = (0..=count).map(|i| [value(i) as f32, (value((i + 1).min(count)) - value(i)) as f32, 1.0, 0.0]);
        Search::Cells { first: first as f32, inv_width: (1.0 / step) as f32, cells: cells.collect() }
    }

    /// The fewest cells of the band of which none has a jump in it, or two knots; none, where there would be too many.
    fn cells(knots: &[(f64, f32)]) -> Option<Search> {
        let [from, to] = BAND_NM;
        if knots.windows(2).any(|pair| pair[0].0 == pair[1].0 && (from..=to).contains(&pair[0].0)) {
            return None;
        }
        let mut count = 1;
        let of_cells = loop {
            if count > MOST_CELLS {
                return None;
            }
            if let Some(of_cells) = one_a_cell(knots, count) {
                break of_cells;
            }
            count *= 2;
        };
        let width = (to - from) / count as f64;
        let cells = of_cells.iter().enumerate().map(|(i, &knot)| {
            let begin = from + width * i as f64;
            let cell = match knot {
                None => {
                    let middle = begin + 0.5 * width;
                    let (value, slope) = along(knots, middle);
                    [value - slope * (middle - begin), slope * width, 1.0, 0.0]
                }
                Some(k) => {
                    let (nm, value) = (knots[k].0, f64::from(knots[k].1));
                    let [before, after] = [slope_below(knots, k), slope_below(knots, k + 1)];
                    [value - before * (nm - begin), before * width, (nm - begin) / width, (after - before) * width]
                }
            };
            cell.map(|x| x as f32)
        });
        // The end of the band lies in a cell of its own.
        let cells = cells.chain([[along(knots, to).0 as f32, 0.0, 1.0, 0.0]]).collect();
        Some(Search::Cells { first: from as f32, inv_width: (1.0 / width) as f32, cells })
    }

    fn crowded(knots: &[(f64, f32)]) -> Search {
        let mut entries = vec![[0.0, knots[0].1, 0.0]];
        entries.extend(knots.iter().enumerate().map(|(i, &(nm, value))| {
            let nm = nm as f32;
            let next = knots[(i + 1).min(knots.len() - 1)];
            // From the rounded ends, so that the segment meets its neighbour.
            let width = next.0 as f32 - nm;
            [nm, value, if width > 0.0 { (next.1 - value) / width } else { 0.0 }]
        }));
        entries.push([f32::INFINITY, 0.0, 0.0]);
        let start: Vec<u16> =
            (360..=831u16).map(|nm| (entries.partition_point(|e| e[0] <= f32::from(nm)) - 1) as u16).collect();
        let steps = start.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
        Search::Crowded { entries, start, steps }
    }
}

/// Which knot lies in each of `count` cells of the band, beyond where the cell begins; none if two lie in one.
fn one_a_cell(knots: &[(f64, f32)], count: usize) -> Option<Vec<Option<usize>>> {
    let [from, to] = BAND_NM;
    let mut of_cells = vec![None; count];
    for (k, &(nm, _)) in knots.iter().enumerate().filter(|(_, knot)| (from..to).contains(&knot.0)) {
        let place = (nm - from) * (count as f64 / (to - from));
        // Rounded, what lies just below the end of the band may be there.
        let of = of_cells.get_mut(place as usize).filter(|_| place.fract() > 0.0);
        if of.is_some_and(|of| of.replace(k).is_some()) {
            return None;
        }
    }
    Some(of_cells)
}

/// Value and slope per nm at `nm` of what is linear between `knots` and level beyond them: just above it, where it jumps there.
fn along(knots: &[(f64, f32)], nm: f64) -> (f64, f64) {
    let next = knots_up_to(knots, nm);
    let (knot, value) = knots[next.max(1) - 1];
    let slope = slope_below(knots, next);
    (slope.mul_add(nm - knot, f64::from(value)), slope)
}

/// How many knots lie at or below `nm`: found at once where they are evenly far apart.
fn knots_up_to(knots: &[(f64, f32)], nm: f64) -> usize {
    let last = knots.len() - 1;
    let (first, end) = (knots[0].0, knots[last].0);
    let guess = ((nm - first) / (end - first) * last as f64) as usize;
    match knots.get(guess..guess.saturating_add(2)) {
        Some([below, above]) if below.0 <= nm && nm < above.0 => guess + 1,
        _ => knots.partition_point(|knot| knot.0 <= nm),
    }
}

/// The slope per nm between the knot before the `k`th and that; level before the first and beyond the last.
fn slope_below(knots: &[(f64, f32)], k: usize) -> f64 {
    match k.checked_sub(1).map(|before| (knots[before], knots.get(k))) {
        Some((before, Some(knot))) if knot.0 > before.0 => {
            (f64::from(knot.1) - f64::from(before.1)) / (knot.0 - before.0)
        }
        _ => 0.0,
    }
}

/// The four numbers that `of` tells of each lane, lane by lane of each.
#[inline(always)]
fn columns(of: impl Fn(usize) -> [f32; 4]) -> [Lanes; 4] {
    let mut columns = [[0.0; LANES]; 4];
    for lane in (0..LANES).step_by(4) {
        let row = |k: usize| wide::f32x4::new(of(lane + k));
        let turned = wide::f32x4::transpose([row(0), row(1), row(2), row(3)]);
        for (column, turned) in columns.iter_mut().zip(turned) {
            column[lane..lane + 4].copy_from_slice(&turned.to_array());
        }
    }
    let [a, b, c, d] = columns;
    [Lanes::new(a), Lanes::new(b), Lanes::new(c), Lanes::new(d)]
}

/// The values at `nm` among crowded knots, up to `most` of them behind that at which a search starts. The same number of halvings for any
/// wavelength: a loop that ended as soon as it could would be mispredicted. By itself, so that cells need no stack for it.
#[inline(never)]
fn among_crowded(entries: &[[f32; 3]], start: &[u16], most: u16, nm: Lanes) -> Lanes {
    let halvings = (usize::from(most) + 1).next_power_of_two().ilog2();
    let mut values = [0.0; LANES];
    for (value, nm) in values.iter_mut().zip(nm.to_array()) {
        let mut i = usize::from(start[((nm - BAND_NM[0] as f32) as u32 as usize).min(start.len() - 1)]);
        for halving in (0..halvings).rev() {
            let next = (i + (1 << halving)).min(entries.len() - 1);
            i = if entries[next][0] <= nm { next } else { i };
        }
        let [knot, at_knot, slope] = entries[i];
        *value = slope.mul_add(nm - knot, at_knot);
    }
    Lanes::new(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lanes(f: impl Fn(f32) -> f32) -> Lanes {
        Lanes::new(std::array::from_fn(|k| f(k as f32)))
    }

    /// On a line y = a + b·nm both kinds of table give the line, up to the rounding of the
    /// wavelength (3e-5 nm times the slope of 2) and four roundings of values up to 1660.
    #[test]
    fn tables_reproduce_a_straight_line_at_lanes_and_alone() {
        let line = |nm: f64| 2.0 * nm - 600.0;
        let uniform: Vec<f64> = (0..95).map(|i| 360.0 + 5.0 * f64::from(i)).collect();
        let irregular: Vec<f64> =
            uniform.iter().enumerate().map(|(i, nm)| nm + if i % 2 == 0 { 0.0 } else { 1.25 }).collect();
        for knots in [uniform, irregular] {
            let samples: Vec<_> = knots.iter().map(|&nm| (nm, line(nm))).collect();
            let table = Table::new(&samples, Outside::Hold).unwrap();
            for i in 0..470 {
                let nm = lanes(|k| 360.0 + i as f32 + k * 0.123);
                for (nm, value) in nm.to_array().into_iter().zip(table.eval(nm).to_array()) {
                    let expected = line(f64::from(nm));
                    assert!((f64::from(value) - expected).abs() < 2.0 * 6e-5 + 4.0 * 6e-8 * 1660.0, "{nm}: {value}");
                    assert!((table.at(f64::from(nm)) - expected).abs() < 1e-3, "{nm}");
                }
            }
        }
    }

    #[test]
    fn outside_is_zero_or_held_as_asked() {
        for knots in [[400.0, 500.0, 600.0], [400.0, 501.0, 600.0]] {
            let samples: Vec<_> = knots.iter().map(|&nm| (nm, 3.0)).collect();
            let nm = Lanes::new([360.0, 399.0, 399.99, 400.0, 600.0, 600.1, 700.0, 830.0]);
            let zero = Table::new(&samples, Outside::Zero).unwrap();
            assert_eq!(zero.eval(nm).to_array(), [0.0, 0.0, 0.0, 3.0, 3.0, 0.0, 0.0, 0.0]);
            assert_eq!((zero.at(399.0), zero.at(600.1), zero.at(450.0)), (0.0, 0.0, 3.0));
            let hold = Table::new(&samples, Outside::Hold).unwrap();
            assert_eq!(hold.eval(nm).to_array(), [3.0; 8]);
            assert_eq!((hold.at(10.0), hold.at(1e4)), (3.0, 3.0));
        }
    }

    #[test]
    fn two_samples_at_one_wavelength_are_a_jump() {
        let table = Table::new(&[(400.0, 1.0), (500.0, 1.0), (500.0, 7.0), (600.0, 7.0)], Outside::Zero).unwrap();
        let nm = Lanes::new([450.0, 499.999, 500.0, 500.001, 550.0, 599.0, 600.0, 400.0]);
        assert_eq!(table.eval(nm).to_array(), [1.0, 1.0, 7.0, 7.0, 7.0, 7.0, 7.0, 1.0]);
        assert_eq!((table.at(499.999), table.at(500.0)), (1.0, 7.0));
    }

    /// Knots beyond the band do not mislead, and many within one nanometre are found.
    #[test]
    fn crowded_knots_are_found() {
        let samples: Vec<_> = (0..4000).map(|i| (300.0 + f64::from(i * i) * 3.5e-5, f64::from(i))).collect();
        let table = Table::new(&samples, Outside::Hold).unwrap();
        for i in (1..3999usize).filter(|i| (360.0..=830.0).contains(&samples[*i].0)) {
            let (a, b) = (samples[i].0 as f32, samples[i + 1].0 as f32);
            let found = table.eval(Lanes::splat(a)).to_array()[0];
            // Crowded f32 knots may coincide; then the later one counts.
            assert!(found >= i as f32 && (found == i as f32 || a == b), "{i}: {found}");
        }
    }

    /// Drawn knots, some beyond the band, against what is linear between them: at whole nanometres, anywhere, and with a jump.
    /// A lane rounds its place in the band, 470 nm, at three steps (2⁻²⁴ each) and the four numbers of its cell, none above
    /// four times the greatest value.
    #[test]
    fn any_knots_are_met() {
        let mut crowded = [0; 3];
        for seed in 0..300 {
            let mut i = 0;
            let mut draw = || {
                i += 1;
                crate::math::sampler::uniform(seed, i)
            };
            let kind = seed as usize % 3;
            let mut nm: Vec<f64> = (0..4 + seed / 40).map(|_| 300.0 + 600.0 * draw()).collect();
            nm.iter_mut().filter(|_| kind == 0).for_each(|nm| *nm = nm.round());
            nm.sort_by(f64::total_cmp);
            nm.dedup_by(|a, b| *a - *b < 1.0);
            if kind == 2 {
                nm.insert(1, nm[1]);
            }
            let samples: Vec<_> = nm.iter().map(|&nm| (nm, if draw() < 0.3 { 0.0 } else { draw() })).collect();
            let table = Table::new(&samples, if seed % 2 == 0 { Outside::Zero } else { Outside::Hold }).unwrap();
            crowded[kind] += usize::from(matches!(table.search, Search::Crowded { .. }));
            for k in 0..2000 {
                let nm = 360.0 + 0.235 * k as f32;
                // Beside a jump either side is right.
                let near = samples.iter().any(|knot| (knot.0 - f64::from(nm)).abs() < 1e-4);
                let found = table.eval(Lanes::splat(nm)).to_array()[3];
                let bound = (3.0 * 470.0 + 16.0) / f64::from(1 << 24);
                let off = (f64::from(found) - table.at(f64::from(nm))).abs();
                assert!(found >= 0.0 && (near || off < bound), "{samples:?} {nm}: {found}");
            }
        }
        assert!(crowded[0] == 0 && crowded[1] < 50 && crowded[2] > 50, "all ways are tried: {crowded:?}");
    }

    #[test]
    fn faults_are_told_in_words() {
        let fault = |samples: &[(f64, f64)]| Table::new(samples, Outside::Zero).unwrap_err();
        assert!(fault(&[(400.0, 1.0)]).contains("at least 2"));
        assert!(fault(&[(500.0, 1.0), (400.0, 1.0)]).contains("found 400 after 500 nm"));
        assert!(fault(&[(400.0, 1.0), (500.0, -1.0)]).contains("sample 1 at 500 nm"));
        assert!(fault(&[(400.0, f64::NAN), (500.0, 1.0)]).contains("found NaN"));
        assert!(fault(&[(0.0, 1.0), (500.0, 1.0)]).contains("wavelength"));
        assert!(fault(&[(5.0, 1.0), (5.0, 1.0), (5.0, 1.0)]).contains("three at 5 nm"));
    }
}
