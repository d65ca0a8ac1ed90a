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
///
/// Knots at equal distances are addressed directly; others through an index of one entry a
/// nanometre.
#[derive(Clone, Debug)]
pub struct Table {
    knots: Knots,
    outside: Outside,
    /// First and last knot, nm.
    range: [f64; 2],
}

#[derive(Clone, Debug)]
enum Knots {
    Uniform {
        step: f64,
        inv_step: f32,
        /// Value at a knot and what it grows by up to the next.
        entries: Vec<[f32; 2]>,
    },
    Irregular {
        /// Wavelength of a knot in nm, value there, growth per nm up to the next (0 at a jump and at the
        /// last). Before the first stands its value at 0 nm, after the last a knot at infinity.
        entries: Vec<[f32; 3]>,
        /// For each whole nm of the band, the last knot at or below it.
        start: Vec<u16>,
        /// The most knots that lie within a nanometre of the band.
        steps: u16,
    },
}

impl Table {
    /// A table of (nm, value) in ascending order of wavelength.
    ///
    /// # Errors
    /// In words, if there are fewer than two knots or more than 65 535, if wavelengths are not
    /// positive, not ascending or thrice the same, or if a value is negative or not finite.
    pub fn new(samples: &[(f64, f64)], outside: Outside) -> Result<Table, String> {
        if samples.len() < 2 {
            return Err(format!("expected at least 2 samples (nm, value), found {}", samples.len()));
        }
        if samples.len() > usize::from(u16::MAX) {
            return Err(format!("expected at most 65535 samples, found {}", samples.len()));
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

    /// A table at `first`, `first` + `step`, … nm. Values must be finite, and two or more.
    pub(crate) fn uniform(first: f64, step: f64, values: &[f64], outside: Outside) -> Table {
        let entries = (0..values.len())
            .map(|i| [values[i] as f32, (values[(i + 1).min(values.len() - 1)] - values[i]) as f32])
            .collect();
        let range = [first, first + step * (values.len() - 1) as f64];
        Table { knots: Knots::Uniform { step, inv_step: (1.0 / step) as f32, entries }, outside, range }
    }

    /// [`Table::new`] of samples known to be in order.
    pub(crate) fn from_checked(samples: &[(f64, f64)], outside: Outside) -> Table {
        let last = samples.len() - 1;
        let (first, end) = (samples[0].0, samples[last].0);
        let step = (end - first) / last as f64;
        // Knots at equal distances up to the rounding of their decimals and of this product: 4 half ulps.
        let equal = |i: usize| (samples[i].0 - (first + step * i as f64)).abs() <= 2.0 * f64::EPSILON * end;
        if step > 0.0 && (0..=last).all(equal) {
            let values: Vec<f64> = samples.iter().map(|s| s.1).collect();
            return Table::uniform(first, step, &values, outside);
        }
        let mut entries = vec![[0.0, samples[0].1 as f32, 0.0]];
        entries.extend((0..=last).map(|i| {
            let (nm, value) = (samples[i].0 as f32, samples[i].1 as f32);
            let next = samples[(i + 1).min(last)];
            // From the rounded ends, so that the segment meets its neighbour.
            let width = next.0 as f32 - nm;
            let slope = if width > 0.0 { (next.1 as f32 - value) / width } else { 0.0 };
            [nm, value, slope]
        }));
        let range = [f64::from(entries[1][0]), f64::from(entries[last + 1][0])];
        entries.push([f32::INFINITY, 0.0, 0.0]);
        let start: Vec<u16> =
            (360..=831u16).map(|nm| (entries.partition_point(|e| e[0] <= f32::from(nm)) - 1) as u16).collect();
        let steps = start.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
        Table { knots: Knots::Irregular { entries, start, steps }, outside, range }
    }

    /// The value at each wavelength (nm), which must be within the band.
    #[must_use]
    #[inline]
    pub fn eval(&self, nm: Lanes) -> Lanes {
        let value = match &self.knots {
            Knots::Uniform { inv_step, entries, .. } => {
                let t = (nm - Lanes::splat(self.range[0] as f32)) * Lanes::splat(*inv_step);
                let last = entries.len() - 1;
                let t = t.fast_max(Lanes::splat(0.0)).fast_min(Lanes::splat(last as i32 as f32));
                // t is not negative: truncation is the floor.
                let row = t.fast_trunc_int();
                let f = t - whole(row);
                let row = row.to_array();
                // A wavelength that is not a number would meet the last row, and stay none.
                let entry = |k: usize| entries[(row[k] as u32 as usize).min(last)];
                let pairs: [[f32; 2]; LANES] = std::array::from_fn(entry);
                let value: [f32; LANES] = std::array::from_fn(|k| pairs[k][0]);
                let growth: [f32; LANES] = std::array::from_fn(|k| pairs[k][1]);
                f.mul_add(Lanes::new(growth), Lanes::new(value))
            }
            Knots::Irregular { entries, start, steps } => {
                let nm = nm.to_array();
                Lanes::new(std::array::from_fn(|k| irregular(entries, start, *steps, nm[k])))
            }
        };
        match self.outside {
            Outside::Hold => value,
            Outside::Zero => {
                let inside =
                    nm.simd_ge(Lanes::splat(self.range[0] as f32)) & nm.simd_le(Lanes::splat(self.range[1] as f32));
                value & inside
            }
        }
    }

    /// The value at `nm`.
    #[must_use]
    pub fn at(&self, nm: f64) -> f64 {
        if self.outside == Outside::Zero && !(self.range[0]..=self.range[1]).contains(&nm) {
            return 0.0;
        }
        match &self.knots {
            Knots::Uniform { step, entries, .. } => {
                let last = entries.len() - 1;
                let t = ((nm - self.range[0]) / step).clamp(0.0, last as f64);
                let i = t as usize;
                f64::from(entries[i][0]) + (t - i as f64) * f64::from(entries[i][1])
            }
            Knots::Irregular { entries, .. } => {
                let [knot, value, slope] = entries[entries.partition_point(|e| f64::from(e[0]) <= nm).max(1) - 1];
                f64::from(value) + f64::from(slope) * (nm - f64::from(knot))
            }
        }
    }

    /// This table with every value times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Table {
        let mut table = self.clone();
        let scale = |x: &mut f32| *x = (f64::from(*x) * factor) as f32;
        match &mut table.knots {
            Knots::Uniform { entries, .. } => entries.iter_mut().flatten().for_each(scale),
            Knots::Irregular { entries, .. } => entries.iter_mut().for_each(|e| e[1..].iter_mut().for_each(scale)),
        }
        table
    }

    /// The knots, nm, ascending.
    #[must_use]
    pub fn knots(&self) -> Vec<f64> {
        match &self.knots {
            Knots::Uniform { step, entries, .. } => {
                (0..entries.len()).map(|i| self.range[0] + step * i as f64).collect()
            }
            Knots::Irregular { entries, .. } => measured(entries).iter().map(|e| f64::from(e[0])).collect(),
        }
    }

    /// The values at the knots.
    #[must_use]
    pub fn values(&self) -> Vec<f32> {
        match &self.knots {
            Knots::Uniform { entries, .. } => entries.iter().map(|e| e[0]).collect(),
            Knots::Irregular { entries, .. } => measured(entries).iter().map(|e| e[1]).collect(),
        }
    }

    /// Wavelength and value of each knot.
    pub(crate) fn samples(&self) -> Vec<(f64, f64)> {
        self.knots().into_iter().zip(self.values().into_iter().map(f64::from)).collect()
    }

    /// Whether f32 holds all values and slopes.
    pub(crate) fn is_finite(&self) -> bool {
        match &self.knots {
            Knots::Uniform { entries, .. } => entries.iter().flatten().all(|x| x.is_finite()),
            Knots::Irregular { entries, .. } => measured(entries).iter().flatten().all(|x| x.is_finite()),
        }
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

/// The entries that are knots: all but the first and the last.
fn measured(entries: &[[f32; 3]]) -> &[[f32; 3]] {
    &entries[1..entries.len() - 1]
}

/// The value at `nm` among irregular knots. The same number of steps for any wavelength: a loop that
/// ended as soon as it could would be mispredicted.
#[inline]
fn irregular(entries: &[[f32; 3]], start: &[u16], steps: u16, nm: f32) -> f32 {
    let mut i = usize::from(start[((nm - BAND_NM[0] as f32) as u32 as usize).min(start.len() - 1)]);
    for _ in 0..steps {
        i += usize::from(entries[(i + 1).min(entries.len() - 1)][0] <= nm);
    }
    let [knot, value, slope] = entries[i];
    slope.mul_add(nm - knot, value)
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
