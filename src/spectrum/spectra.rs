//! A function of wavelength: emission, reflectance, absorption.

use crate::error::in_short;
use crate::spectrum::observer;
use crate::spectrum::table::{Outside, Table};
use crate::spectrum::upsample::{eval_sigmoid, sigmoid_at};
use crate::spectrum::{BAND_NM, Lanes, illuminant};
use std::sync::Arc;

/// A function of wavelength over the band.
///
/// What the value means is the owner's affair: a reflectance in [0, 1], a spectral radiance in
/// W·m⁻²·sr⁻¹·nm⁻¹, an absorption in m⁻¹.
#[derive(Clone, Debug)]
pub enum Spectrum {
    /// The same at every wavelength.
    Constant(f32),
    /// `scale` times a smooth colour of Jakob and Hanika 2019 with the coefficients `c`
    /// ([`crate::spectrum::upsample`]).
    Sigmoid {
        /// Coefficients of the quadratic in centred wavelength, highest power first.
        c: [f32; 3],
        /// Factor.
        scale: f32,
    },
    /// Measured values.
    Table(Arc<Table>),
    /// `scale` times a smooth colour times measured values: a coloured light.
    SigmoidTable {
        /// Coefficients of the quadratic in centred wavelength, highest power first.
        c: [f32; 3],
        /// Factor.
        scale: f32,
        /// The other factor.
        table: Arc<Table>,
    },
    /// The product of two others.
    Product(Arc<[Spectrum; 2]>),
}

impl Spectrum {
    /// `value` at every wavelength.
    #[must_use]
    pub fn constant(value: f64) -> Spectrum {
        Spectrum::Constant(value as f32)
    }

    /// Linear between samples (nm, value), ascending; two samples at one wavelength are a jump.
    ///
    /// # Errors
    /// In words, as [`Table::new`].
    pub fn from_samples(samples: &[(f64, f64)], outside: Outside) -> Result<Spectrum, String> {
        Table::new(samples, outside).map(|table| Spectrum::Table(Arc::new(table)))
    }

    /// The narrowest line, nm.
    pub(crate) const LEAST_WIDTH_NM: f64 = 0.01;

    /// Spectral lines (nm, power, width in nm): each a box about its wavelength that holds its
    /// power, so that the height is power / width. Lines may overlap.
    ///
    /// # Errors
    /// In words, if there is no line, a line leaves the band, its width is below 0.01 nm (where
    /// the rounding of a wavelength to f32, 3e-5 nm at each edge, would be felt in its power) or
    /// its power is negative or not finite.
    pub fn lines(lines: &[(f64, f64, f64)]) -> Result<Spectrum, String> {
        if lines.is_empty() {
            return Err("expected at least one line (nm, power, width), found none".into());
        }
        let mut boxes = Vec::with_capacity(lines.len());
        for (i, &(nm, power, width)) in lines.iter().enumerate() {
            if !(power.is_finite() && power >= 0.0) {
                return Err(format!(
                    "line {i} at {} nm: expected a power of zero or more, found {}",
                    in_short(nm),
                    in_short(power)
                ));
            }
            if !(width.is_finite() && width >= Spectrum::LEAST_WIDTH_NM) {
                return Err(format!(
                    "line {i} at {} nm: expected a width of 0.01 nm or more, found {}",
                    in_short(nm),
                    in_short(width)
                ));
            }
            let edges = [nm - 0.5 * width, nm + 0.5 * width];
            if !(edges[0] >= BAND_NM[0] && edges[1] <= BAND_NM[1]) {
                let [nm, width] = [nm, width].map(in_short);
                return Err(format!("line {i}: expected a line within 360 to 830 nm, found {nm} nm of width {width}"));
            }
            // The height from the edges as they will be stored keeps the power exact.
            let edges = edges.map(|e| f64::from(e as f32));
            boxes.push((edges, power / (edges[1] - edges[0])));
        }
        let mut edges: Vec<f64> = boxes.iter().flat_map(|b| b.0).collect();
        edges.sort_by(f64::total_cmp);
        edges.dedup();
        let mut samples: Vec<(f64, f64)> = Vec::new();
        for cell in edges.windows(2) {
            let over = boxes.iter().filter(|b| b.0[0] <= cell[0] && cell[1] <= b.0[1]);
            let height = over.fold(0.0, |sum, b| sum + b.1);
            samples.push((cell[0], height));
            samples.push((cell[1], height));
        }
        if samples.len() > Table::MOST {
            let most = Table::MOST / 4;
            return Err(format!("expected at most {most} lines apart from each other, found {}", lines.len()));
        }
        Ok(Spectrum::Table(Arc::new(Table::from_checked(&samples, Outside::Zero))))
    }

    /// A black body of `kelvin`: absolute spectral radiance, W·m⁻²·sr⁻¹·nm⁻¹.
    ///
    /// # Errors
    /// As [`illuminant::blackbody`].
    pub fn blackbody(kelvin: f64) -> Result<Spectrum, String> {
        illuminant::blackbody(kelvin)
    }

    /// A black body of `kelvin` scaled to luminance Y = 1.
    ///
    /// # Errors
    /// As [`illuminant::blackbody`].
    pub fn blackbody_normalised(kelvin: f64) -> Result<Spectrum, String> {
        illuminant::blackbody_normalised(kelvin)
    }

    /// A CIE illuminant by name, scaled to luminance Y = 1.
    ///
    /// # Errors
    /// As [`illuminant::illuminant`].
    pub fn illuminant(name: &str) -> Result<Spectrum, String> {
        illuminant::illuminant(name)
    }

    /// The value at each wavelength (nm).
    #[must_use]
    #[inline]
    pub fn eval(&self, nm: Lanes) -> Lanes {
        match self {
            Spectrum::Constant(value) => Lanes::splat(*value),
            Spectrum::Sigmoid { c, scale } => eval_sigmoid(*c, nm) * Lanes::splat(*scale),
            Spectrum::Table(table) => table.eval(nm),
            Spectrum::SigmoidTable { c, scale, table } => eval_sigmoid(*c, nm) * Lanes::splat(*scale) * table.eval(nm),
            Spectrum::Product(factors) => factors[0].eval(nm) * factors[1].eval(nm),
        }
    }

    /// The value at `nm`.
    #[must_use]
    pub fn at(&self, nm: f64) -> f64 {
        match self {
            Spectrum::Constant(value) => f64::from(*value),
            Spectrum::Sigmoid { c, scale } => sigmoid_at(c.map(f64::from), nm) * f64::from(*scale),
            Spectrum::Table(table) => table.at(nm),
            Spectrum::SigmoidTable { c, scale, table } => {
                sigmoid_at(c.map(f64::from), nm) * f64::from(*scale) * table.at(nm)
            }
            Spectrum::Product(factors) => factors[0].at(nm) * factors[1].at(nm),
        }
    }

    /// This spectrum times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Spectrum {
        let times = |x: f32| (f64::from(x) * factor) as f32;
        match self {
            Spectrum::Constant(value) => Spectrum::Constant(times(*value)),
            Spectrum::Sigmoid { c, scale } => Spectrum::Sigmoid { c: *c, scale: times(*scale) },
            Spectrum::Table(table) => Spectrum::Table(Arc::new(table.scaled(factor))),
            Spectrum::SigmoidTable { c, scale, table } => {
                Spectrum::SigmoidTable { c: *c, scale: times(*scale), table: table.clone() }
            }
            Spectrum::Product(factors) => Spectrum::Product(Arc::new([factors[0].scaled(factor), factors[1].clone()])),
        }
    }

    /// The product of two spectra.
    #[must_use]
    pub fn times(&self, other: &Spectrum) -> Spectrum {
        match (self, other) {
            (Spectrum::Constant(value), x) | (x, Spectrum::Constant(value)) => x.scaled(f64::from(*value)),
            (Spectrum::Sigmoid { c, scale }, Spectrum::Table(table))
            | (Spectrum::Table(table), Spectrum::Sigmoid { c, scale }) => {
                Spectrum::SigmoidTable { c: *c, scale: *scale, table: table.clone() }
            }
            (a, b) => Spectrum::Product(Arc::new([a.clone(), b.clone()])),
        }
    }

    /// Whether the value is the same over the whole band.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        match self {
            Spectrum::Constant(_) => true,
            Spectrum::Sigmoid { c, scale } => (c[0] == 0.0 && c[1] == 0.0) || *scale == 0.0,
            Spectrum::Table(table) => {
                let values = table.values();
                let [first, last] = table.range();
                let covers = table.outside() == Outside::Hold || (first <= BAND_NM[0] && last >= BAND_NM[1]);
                values.iter().all(|v| *v == values[0]) && (covers || values[0] == 0.0)
            }
            Spectrum::SigmoidTable { scale, .. } => *scale == 0.0,
            Spectrum::Product(factors) => factors[0].is_constant() && factors[1].is_constant(),
        }
    }

    /// Whether the value is zero over the whole band.
    #[must_use]
    pub fn is_black(&self) -> bool {
        // Most that are not show it at once.
        self.at(555.0) == 0.0 && self.max() == 0.0
    }

    /// CIE Y, as the film would show this spectrum: 1 for a constant of 1.
    #[must_use]
    pub fn luminance(&self) -> f64 {
        observer::tristimulus(self)[1]
    }

    /// The greatest value over the band, looked for at every knot and whole nanometre: exact for
    /// constants and tables, within the curvature over half a nanometre for smooth colours.
    #[must_use]
    pub fn max(&self) -> f64 {
        if let Spectrum::Constant(value) = self {
            return f64::from(*value);
        }
        let mut max = f64::MIN;
        // Either side of a jump counts: a table is right-continuous, so look at the left side as well.
        for nm in self.breakpoints() {
            if (BAND_NM[0]..=BAND_NM[1]).contains(&nm) {
                max = max.max(self.at(nm)).max(self.at(nm.next_down()));
            }
        }
        for nm in 360..=830 {
            max = max.max(self.at(f64::from(nm)));
        }
        max
    }

    /// Whether f32 holds every value.
    pub(crate) fn is_finite(&self) -> bool {
        let parts = match self {
            Spectrum::Constant(value) => value.is_finite(),
            Spectrum::Sigmoid { scale, .. } => scale.is_finite(),
            Spectrum::Table(table) => table.is_finite(),
            Spectrum::SigmoidTable { scale, table, .. } => scale.is_finite() && table.is_finite(),
            Spectrum::Product(factors) => factors.iter().all(Spectrum::is_finite),
        };
        parts && self.max() <= f64::from(f32::MAX)
    }

    /// Where the spectrum may jump, nm: the edges of lines, and where measured values begin and end.
    pub(crate) fn jumps(&self) -> Vec<f64> {
        match self {
            Spectrum::Constant(_) | Spectrum::Sigmoid { .. } => Vec::new(),
            Spectrum::Table(table) | Spectrum::SigmoidTable { table, .. } => {
                let knots = table.knots();
                let twice = knots.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]);
                knots.first().into_iter().chain(knots.last()).copied().chain(twice).collect()
            }
            Spectrum::Product(factors) => factors.iter().flat_map(Spectrum::jumps).collect(),
        }
    }

    /// Where the spectrum is not smooth, nm.
    pub(crate) fn breakpoints(&self) -> Vec<f64> {
        match self {
            Spectrum::Constant(_) | Spectrum::Sigmoid { .. } => Vec::new(),
            Spectrum::Table(table) | Spectrum::SigmoidTable { table, .. } => table.knots(),
            Spectrum::Product(factors) => {
                let mut points = factors[0].breakpoints();
                points.extend(factors[1].breakpoints());
                points
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::observer::{Y_INTEGRAL, matching};

    fn sodium() -> Spectrum {
        Spectrum::lines(&[(589.0, 2.0, 0.1), (589.6, 1.0, 0.1)]).unwrap()
    }

    /// More steps than a table can number are refused; twice as many lines that lie on each other make no more.
    #[test]
    fn lines_beyond_what_a_table_holds_are_refused() {
        let comb = |n: u32| -> Vec<_> { (0..n).map(|i| (400.0 + 0.018 * f64::from(i), 1.0, 0.01)).collect() };
        let told = Spectrum::lines(&comb(16_500)).unwrap_err();
        assert_eq!(told, "expected at most 16383 lines apart from each other, found 16500");
        assert!(Spectrum::lines(&comb(16_300)).is_ok());
        assert!(Spectrum::lines(&comb(10_000).repeat(2)).is_ok());
    }

    /// ∫ line · ȳ = power · ȳ(centre): ȳ is linear across 0.1 nm inside a table cell.
    #[test]
    fn a_narrow_line_has_the_luminance_of_its_power() {
        let expected = (2.0 * matching(589.0)[1] + matching(589.6)[1]) / Y_INTEGRAL;
        let found = sodium().luminance();
        // f32 heights (6e-8) and edges (3e-5 nm) of the lines; ȳ has a kink at the line of 589 nm:
        // its slope changes by 1e-4 a nm there, over 0.05 nm.
        assert!((found / expected - 1.0).abs() < 2e-6, "{found} {expected}");
    }

    #[test]
    fn overlapping_lines_add() {
        let lines = Spectrum::lines(&[(500.0, 4.0, 4.0), (501.0, 2.0, 2.0)]).unwrap();
        assert_eq!((lines.at(499.0), lines.at(501.0), lines.at(502.5), lines.at(497.0)), (1.0, 2.0, 0.0, 0.0));
        assert_eq!(lines.max(), 2.0);
    }

    #[test]
    fn a_line_that_cannot_be_is_refused_in_words() {
        assert!(Spectrum::lines(&[(900.0, 1.0, 1.0)]).unwrap_err().contains("within 360 to 830 nm"));
        assert!(Spectrum::lines(&[(500.0, 1.0, 0.0)]).unwrap_err().contains("width of 0.01 nm"));
        assert!(Spectrum::lines(&[(500.0, f64::NAN, 1.0)]).unwrap_err().contains("power"));
        assert!(Spectrum::lines(&[]).is_err());
    }

    /// Lanes and single values are two ways through the same function: f32 rounding, and that of
    /// the wavelength where a table is steep.
    #[test]
    fn lanes_agree_with_single_values_for_every_kind() {
        let table =
            Spectrum::from_samples(&[(380.0, 0.1), (500.0, 0.9), (620.0, 0.3), (700.0, 0.35)], Outside::Hold).unwrap();
        let colour = Spectrum::Sigmoid { c: [3.0, -2.0, 0.5], scale: 1.5 };
        let kinds = [
            Spectrum::constant(0.25),
            colour.clone(),
            table.clone(),
            table.times(&colour),
            table.times(&table),
            table.times(&colour).times(&table).scaled(3.0),
        ];
        for spectrum in &kinds {
            for i in 0..=940 {
                let nm = 360.0 + 0.5 * f64::from(i);
                let lane = f64::from(spectrum.eval(Lanes::splat(nm as f32)).to_array()[5]);
                assert!((lane - spectrum.at(nm)).abs() < 2e-6 * spectrum.max(), "{spectrum:?} {nm}: {lane}");
            }
        }
    }

    #[test]
    fn products_and_scales_multiply() {
        let table = Spectrum::from_samples(&[(380.0, 0.1), (500.0, 0.9), (620.0, 0.3)], Outside::Zero).unwrap();
        let product = table.times(&table).scaled(2.0).times(&Spectrum::constant(3.0));
        assert!((product.at(440.0) - 6.0 * 0.25).abs() < 1e-6, "{}", product.at(440.0));
        assert_eq!(product.at(700.0), 0.0);
        assert!(!product.is_constant() && Spectrum::constant(2.0).times(&Spectrum::constant(2.0)).is_constant());
        assert!(product.scaled(0.0).is_black());
        assert!((product.max() - 6.0 * 0.81).abs() < 1e-6);
    }
}
