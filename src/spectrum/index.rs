//! How strongly a material bends each wavelength.
//!
//! Catalogues write dispersion formulas with the wavelength in µm; everything here takes nm and
//! converts. Names are looked up in [`crate::spectrum::catalogue`].

use crate::error::in_short;
pub use crate::spectrum::catalogue::{glass, metal};
use crate::spectrum::{BAND_NM, LANES, Lanes};

/// Fraunhofer's lines, nm: helium d, hydrogen F and C. An Abbe number is
/// (n(d) − 1) / (n(F) − n(C)).
pub const LINE_D: f64 = 587.5618;
/// Hydrogen F, nm.
pub const LINE_F: f64 = 486.1327;
/// Hydrogen C, nm.
pub const LINE_C: f64 = 656.2725;

/// Indices that can be used: far beyond any transparent material, so that what leaves them is a misplaced digit or a wavelength
/// unit.
pub const INDICES: std::ops::RangeInclusive<f64> = 0.1..=10.0;

/// A real refractive index as a function of wavelength λ (in µm in the formulas).
#[derive(Clone, Debug, PartialEq)]
pub enum RefractiveIndex {
    /// The same at every wavelength.
    Constant(f64),
    /// n² = 1 + Σ bλ² / (λ² − c).
    /// See [`RefractiveIndex::sellmeier`].
    Sellmeier {
        /// Strengths.
        b: [f64; 3],
        /// Squared resonances, µm².
        c: [f64; 3],
    },
    /// n = a₀ + a₁ / λ² + a₂ / λ⁴ + …
    Cauchy {
        /// a₀, a₁ in µm², a₂ in µm⁴, …
        a: Vec<f64>,
    },
    /// n² = a₀ + a₁λ² + a₂λ⁻² + a₃λ⁻⁴ + a₄λ⁻⁶ + a₅λ⁻⁸, SCHOTT's polynomial of 1967 to 1992.
    Schott {
        /// The six coefficients.
        a: [f64; 6],
    },
    /// A numbered formula of refractiveindex.info, 1 to 9 (see [`RefractiveIndex::formula`]).
    Formula {
        /// Which of the nine.
        number: u32,
        /// As the database lists them.
        coefficients: Vec<f64>,
    },
    /// Linear between samples in ascending order of wavelength, in the band and to its neighbours; held beyond the ends.
    Table {
        /// (nm, n).
        samples: Vec<[f64; 2]>,
    },
}

impl RefractiveIndex {
    /// Sellmeier's formula of strengths `b` and squared resonances `c`, µm². Where a term has no strength its resonance is
    /// nowhere: at it the term would be 0/0.
    #[must_use]
    pub fn sellmeier(b: [f64; 3], c: [f64; 3]) -> RefractiveIndex {
        let c = std::array::from_fn(|i| if b[i] == 0.0 { 0.0 } else { c[i] });
        RefractiveIndex::Sellmeier { b, c }
    }

    /// A two-term Cauchy formula from the index at the d line and the Abbe number.
    ///
    /// n(λ) = a + b / λ² with b = (nd − 1) / vd / (λF⁻² − λC⁻²) and a = nd − b / λd².
    ///
    /// # Errors
    /// In words, if `nd` is not above 1, `vd` is not positive, or the formula fails in the band.
    pub fn from_abbe(nd: f64, vd: f64) -> Result<RefractiveIndex, String> {
        if !(nd > 1.0 && nd.is_finite()) {
            return Err(format!("expected an index nd above 1 at 587.56 nm, found {}", in_short(nd)));
        }
        if !(vd > 0.0 && vd.is_finite()) {
            return Err(format!("expected an Abbe number above 0, found {}", in_short(vd)));
        }
        let inverse_square = |nm: f64| 1e6 / (nm * nm);
        let b = (nd - 1.0) / vd / (inverse_square(LINE_F) - inverse_square(LINE_C));
        let index = RefractiveIndex::Cauchy { a: vec![nd - b * inverse_square(LINE_D), b] };
        index.check_band()?;
        Ok(index)
    }

    /// Formula `number` of refractiveindex.info, with coefficients C₁, C₂, … as the database lists them:
    ///
    /// 1. n² − 1 = C₁ + Σ C₂λ² / (λ² − C₃²)
    /// 2. n² − 1 = C₁ + Σ C₂λ² / (λ² − C₃)
    /// 3. n² = C₁ + Σ C₂λ^C₃
    /// 4. n² = C₁ + C₂λ^C₃ / (λ² − C₄^C₅) + C₆λ^C₇ / (λ² − C₈^C₉) + Σ C₁₀λ^C₁₁
    /// 5. n = C₁ + Σ C₂λ^C₃
    /// 6. n − 1 = C₁ + Σ C₂ / (C₃ − λ⁻²)
    /// 7. n = C₁ + C₂ / (λ² − 0.028) + C₃ / (λ² − 0.028)² + C₄λ² + C₅λ⁴ + C₆λ⁶, Herzberger's
    /// 8. (n² − 1) / (n² + 2) = C₁ + C₂λ² / (λ² − C₃) + C₄λ²
    /// 9. n² = C₁ + C₂ / (λ² − C₃) + C₄(λ − C₅) / ((λ − C₅)² + C₆)
    ///
    /// Formulas 1 and 2 of three terms or fewer without a constant become
    /// [`RefractiveIndex::Sellmeier`].
    ///
    /// # Errors
    /// In words, if there is no such formula here or the coefficients do not pair up.
    pub fn formula(number: u32, coefficients: &[f64]) -> Result<RefractiveIndex, String> {
        let count = coefficients.len();
        let (fits, shape) = match number {
            1..=3 | 5 | 6 => (count % 2 == 1, "1, 3, 5, …"),
            4 => (count >= 9 && count % 2 == 1, "9, 11, 13, …"),
            7 | 9 => (count == 6, "6"),
            8 => (count == 4, "4"),
            _ => return Err(format!("expected formula 1 to 9, found {number}")),
        };
        if !fits {
            return Err(format!("formula {number}: expected {shape} coefficients, found {count}"));
        }
        if let Some(bad) = coefficients.iter().find(|c| !c.is_finite()) {
            return Err(format!("formula {number}: expected finite coefficients, found {bad}"));
        }
        if number <= 2 && coefficients[0] == 0.0 && count <= 7 {
            let (mut b, mut c) = ([0.0; 3], [0.0; 3]);
            for (i, pair) in coefficients[1..].chunks_exact(2).enumerate() {
                b[i] = pair[0];
                c[i] = if number == 1 { pair[1] * pair[1] } else { pair[1] };
            }
            return Ok(RefractiveIndex::sellmeier(b, c));
        }
        Ok(RefractiveIndex::Formula { number, coefficients: coefficients.to_vec() })
    }

    /// n at `nm`; NaN where a formula gives a negative square.
    #[must_use]
    pub fn at(&self, nm: f64) -> f64 {
        let w = nm * 1e-3;
        let w2 = w * w;
        match self {
            RefractiveIndex::Constant(n) => *n,
            RefractiveIndex::Sellmeier { b, c } => {
                (1.0 + b[0] * w2 / (w2 - c[0]) + b[1] * w2 / (w2 - c[1]) + b[2] * w2 / (w2 - c[2])).sqrt()
            }
            RefractiveIndex::Cauchy { a } => a.iter().rev().fold(0.0, |sum, a| sum / w2 + a),
            RefractiveIndex::Schott { a } => {
                let inverse = 1.0 / w2;
                let tail = inverse * (a[2] + inverse * (a[3] + inverse * (a[4] + inverse * a[5])));
                (a[0] + a[1] * w2 + tail).sqrt()
            }
            RefractiveIndex::Formula { number, coefficients } => numbered(*number, coefficients, w),
            RefractiveIndex::Table { samples } => {
                let after = samples.partition_point(|s| s[0] <= nm);
                match (after.checked_sub(1).map(|i| samples[i]), samples.get(after)) {
                    (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (nm - a[0]) / (b[0] - a[0]),
                    (Some(a), None) => a[1],
                    (None, Some(b)) => b[1],
                    (None, None) => f64::NAN,
                }
            }
        }
    }

    /// n at each wavelength (nm).
    #[must_use]
    #[inline]
    pub fn lanes(&self, nm: Lanes) -> [f64; LANES] {
        let nm = nm.to_array();
        match self {
            RefractiveIndex::Constant(n) => [*n; LANES],
            // The usual glass, in a form that the compiler turns into vectors.
            RefractiveIndex::Sellmeier { b, c } => {
                let mut n = [1.0; LANES];
                let w2 = nm.map(|nm| {
                    let w = f64::from(nm) * 1e-3;
                    w * w
                });
                for term in 0..3 {
                    for k in 0..LANES {
                        n[k] += b[term] * w2[k] / (w2[k] - c[term]);
                    }
                }
                n.map(f64::sqrt)
            }
            other => nm.map(|nm| other.at(f64::from(nm))),
        }
    }

    /// Whether the index differs between wavelengths: whether white light splits.
    #[must_use]
    pub fn is_dispersive(&self) -> bool {
        match self {
            RefractiveIndex::Constant(_) => false,
            RefractiveIndex::Sellmeier { b, c } => b.iter().zip(c).any(|(b, c)| *b != 0.0 && *c != 0.0),
            RefractiveIndex::Cauchy { a } => a.iter().skip(1).any(|a| *a != 0.0),
            RefractiveIndex::Schott { a } => a[1..].iter().any(|a| *a != 0.0),
            RefractiveIndex::Formula { .. } => {
                let first = self.at(BAND_NM[0]);
                (0..=47).any(|i| self.at(BAND_NM[0] + 10.0 * f64::from(i)) != first)
            }
            RefractiveIndex::Table { samples } => samples.iter().any(|s| s[1] != samples[0][1]),
        }
    }

    /// Whether the index can be used over the whole band.
    ///
    /// # Errors
    /// In words: a resonance within 360 to 830 nm, an index that is not a finite number within [`INDICES`]
    /// somewhere in it, or a table that does not cover it or is not in order.
    pub fn check_band(&self) -> Result<(), String> {
        if let RefractiveIndex::Table { samples } = self {
            check_table(samples, BAND_NM)?;
        }
        if let Some(nm) = self.pole() {
            return Err(format!(
                "a resonance at {nm:.1} nm, within the band of 360 to 830 nm; are wavelengths in µm (c in µm²)?"
            ));
        }
        for i in 0..=4700 {
            let nm = BAND_NM[0] + 0.1 * f64::from(i);
            let n = self.at(nm);
            if !INDICES.contains(&n) {
                let found = if n.is_nan() { "a negative square".to_string() } else { in_short(n) };
                return Err(format!("expected an index of 0.1 to 10 over 360 to 830 nm, found {found} at {nm:.1} nm"));
            }
        }
        Ok(())
    }

    /// Where in the band a denominator vanishes, nm.
    fn pole(&self) -> Option<f64> {
        // Squared wavelengths (µm²) at which a term with a strength other than zero is infinite.
        let squares: Vec<f64> = match self {
            RefractiveIndex::Sellmeier { b, c } => (0..3).filter(|i| b[*i] != 0.0).map(|i| c[i]).collect(),
            RefractiveIndex::Formula { number, coefficients: c } => match number {
                1 => c[1..].chunks_exact(2).filter(|p| p[0] != 0.0).map(|p| p[1] * p[1]).collect(),
                2 => c[1..].chunks_exact(2).filter(|p| p[0] != 0.0).map(|p| p[1]).collect(),
                4 => [1, 5].iter().filter(|i| c[**i] != 0.0).map(|i| power(c[i + 2], c[i + 3])).collect(),
                6 => c[1..].chunks_exact(2).filter(|p| p[0] != 0.0).map(|p| 1.0 / p[1]).collect(),
                8 | 9 if c[1] != 0.0 => vec![c[2]],
                _ => Vec::new(),
            },
            _ => Vec::new(),
        };
        squares.into_iter().map(|s| s.sqrt() * 1e3).find(|nm| (BAND_NM[0]..=BAND_NM[1]).contains(nm))
    }
}

/// Whether a table of (nm, value) covers `range` and is in ascending order where light meets it. In the ultraviolet and the
/// infrared files have rows that stand twice or out of order: rows in the band count, and a neighbour on each side.
///
/// # Errors
/// In words, if not.
pub(crate) fn check_table(samples: &[[f64; 2]], range: [f64; 2]) -> Result<(), String> {
    // What stands before the first of these is not above the band's lower end, what stands after the last not below its upper.
    let first = samples.iter().position(|s| s[0] > BAND_NM[0]).unwrap_or(samples.len()).max(1);
    let end = samples.iter().rposition(|s| s[0] < BAND_NM[1]).map_or(0, |i| i + 2).min(samples.len());
    if let Some(i) = (first..end).find(|i| samples[*i][0] <= samples[i - 1][0]) {
        return Err(format!(
            "sample {i}: expected ascending wavelengths, found {} nm after {} nm",
            in_short(samples[i][0]),
            in_short(samples[i - 1][0])
        ));
    }
    let covers = samples.first().is_some_and(|s| s[0] <= range[0]) && samples.last().is_some_and(|s| s[0] >= range[1]);
    if !covers {
        let found = match (samples.first(), samples.last()) {
            (Some(a), Some(b)) => {
                let in_um = a[0] * 1e3 <= BAND_NM[1] && b[0] * 1e3 >= BAND_NM[0];
                let hint = if in_um { " (are they in µm?)" } else { "" };
                format!("{} to {} nm{hint}", in_short(a[0]), in_short(b[0]))
            }
            _ => "no samples".to_string(),
        };
        return Err(format!("expected a table of {} to {} nm, found {found}", range[0], range[1]));
    }
    Ok(())
}

/// x to the power e; whole powers by multiplication, others by `libm`.
fn power(x: f64, e: f64) -> f64 {
    let whole = e as i32;
    if f64::from(whole) == e && whole.abs() <= 16 {
        let magnitude = (0..whole.abs()).fold(1.0, |product, _| product * x);
        return if whole < 0 { 1.0 / magnitude } else { magnitude };
    }
    libm::pow(x, e)
}

/// The formulas of [`RefractiveIndex::formula`]; `w` in µm.
fn numbered(number: u32, c: &[f64], w: f64) -> f64 {
    let w2 = w * w;
    let pairs = |from: usize| c[from..].chunks_exact(2);
    // A term of no strength is nothing at its resonance, too, where it would be 0/0.
    let term = |strength: f64, above: f64, below: f64| if strength == 0.0 { 0.0 } else { strength * above / below };
    match number {
        1 => (1.0 + c[0] + pairs(1).map(|p| term(p[0], w2, w2 - p[1] * p[1])).sum::<f64>()).sqrt(),
        2 => (1.0 + c[0] + pairs(1).map(|p| term(p[0], w2, w2 - p[1])).sum::<f64>()).sqrt(),
        3 => (c[0] + pairs(1).map(|p| p[0] * power(w, p[1])).sum::<f64>()).sqrt(),
        4 => {
            let resonance = |i: usize| term(c[i], power(w, c[i + 1]), w2 - power(c[i + 2], c[i + 3]));
            (c[0] + resonance(1) + resonance(5) + pairs(9).map(|p| p[0] * power(w, p[1])).sum::<f64>()).sqrt()
        }
        5 => c[0] + pairs(1).map(|p| p[0] * power(w, p[1])).sum::<f64>(),
        6 => 1.0 + c[0] + pairs(1).map(|p| term(p[0], 1.0, p[1] - 1.0 / w2)).sum::<f64>(),
        7 => {
            let l = 1.0 / (w2 - 0.028);
            c[0] + l * (c[1] + l * c[2]) + w2 * (c[3] + w2 * (c[4] + w2 * c[5]))
        }
        8 => {
            let s = c[0] + term(c[1], w2, w2 - c[2]) + c[3] * w2;
            ((1.0 + 2.0 * s) / (1.0 - s)).sqrt()
        }
        9 => {
            let d = w - c[4];
            (c[0] + term(c[1], 1.0, w2 - c[2]) + term(c[3], d, d * d + c[5])).sqrt()
        }
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bk7() -> RefractiveIndex {
        RefractiveIndex::Sellmeier {
            b: [1.03961212, 0.231792344, 1.01046945],
            c: [0.00600069867, 0.0200179144, 103.560653],
        }
    }

    /// SCHOTT's coefficients at the lines h, d and r, computed in exact decimals.
    #[test]
    fn bk7_has_its_index_at_three_lines() {
        for (nm, n) in [(404.6561, 1.530_239_986), (587.5618, 1.516_800_035), (706.5188, 1.512_892_522)] {
            assert!((bk7().at(nm) - n).abs() < 5.1e-10, "{nm}: {}", bk7().at(nm));
        }
        bk7().check_band().unwrap();
    }

    /// Lanes see the wavelength rounded to f32 (3e-5 nm; the slope is below 2e-4 a nm), else the same formula.
    #[test]
    fn lanes_agree_with_single_wavelengths() {
        let kinds = [
            bk7(),
            RefractiveIndex::Constant(1.5),
            RefractiveIndex::from_abbe(1.7, 30.0).unwrap(),
            RefractiveIndex::formula(5, &[1.5130, -0.003169, 2.0, 0.003962, -2.0]).unwrap(),
            RefractiveIndex::Table { samples: vec![[350.0, 1.6], [500.0, 1.55], [900.0, 1.5]] },
        ];
        let nm = Lanes::new([360.0, 400.1, 450.2, 500.3, 555.5, 650.0, 750.9, 830.0]);
        for index in kinds {
            for (nm, n) in nm.to_array().into_iter().zip(index.lanes(nm)) {
                assert!((n - index.at(f64::from(nm))).abs() < 1e-15 * 4.0, "{index:?} {nm}");
            }
        }
    }

    #[test]
    fn an_abbe_number_comes_back() {
        let index = RefractiveIndex::from_abbe(1.5168, 64.17).unwrap();
        let v = (index.at(LINE_D) - 1.0) / (index.at(LINE_F) - index.at(LINE_C));
        assert!((index.at(LINE_D) - 1.5168).abs() < 1e-14 && (v - 64.17).abs() < 1e-9, "{v}");
        assert!(index.is_dispersive());
        assert!(RefractiveIndex::from_abbe(0.9, 60.0).unwrap_err().contains("nd"));
        assert!(RefractiveIndex::from_abbe(1.5, 0.0).unwrap_err().contains("Abbe"));
        // b = 0.5 / 0.05 / 1.9104 = 5.2 µm²: a = 1.5 − 15 is negative, and n at 830 nm with it.
        assert!(RefractiveIndex::from_abbe(1.5, 0.05).unwrap_err().contains("found"));
    }

    /// The polynomial through the same numbers as Cauchy's: n² of a₀ + a₂/λ² with all others zero.
    #[test]
    fn schott_and_numbered_formulas_are_what_they_say() {
        let w = 0.5f64;
        let schott = RefractiveIndex::Schott { a: [2.25, 0.01, 0.02, 0.003, 0.0004, 0.00005] };
        let n2 = 2.25
            + 0.01 * w.powi(2)
            + 0.02 * w.powi(-2)
            + 0.003 * w.powi(-4)
            + 0.0004 * w.powi(-6)
            + 0.00005 * w.powi(-8);
        assert!((schott.at(500.0) - n2.sqrt()).abs() < 1e-15);
        // BK7 of Schott's catalogue of 1982: n_d = 1.51680.
        let a = [2.2718929, -0.010108077, 0.010592509, 0.00020816965, -7.6472538e-6, 4.9240991e-7];
        assert!((RefractiveIndex::Schott { a }.at(LINE_D) - 1.5168).abs() < 5e-6);
        let at = |number, c: &[f64]| RefractiveIndex::formula(number, c).unwrap().at(500.0);
        assert!((at(1, &[0.1, 1.2, 0.1]) - (1.1 + 1.2 * 0.25 / 0.24f64).sqrt()).abs() < 1e-15);
        assert!((at(2, &[0.1, 1.2, 0.01]) - (1.1 + 1.2 * 0.25 / 0.24f64).sqrt()).abs() < 1e-15);
        assert!((at(3, &[2.0, 0.5, -2.0]) - 4f64.sqrt()).abs() < 1e-15);
        assert!((at(3, &[2.0, 0.5, -0.5]) - (2.0 + 0.5 / 0.5f64.sqrt()).sqrt()).abs() < 1e-15);
        let four = [2.0, 0.3, 2.0, 0.1, 2.0, 0.0, 0.0, 0.0, 1.0, 0.4, 1.0];
        assert!((at(4, &four) - (2.0 + 0.3 * 0.25 / 0.24 + 0.2f64).sqrt()).abs() < 1e-15);
        assert!((at(5, &[1.5, 0.01, -2.0]) - 1.54).abs() < 1e-15);
        assert!((at(6, &[0.0, 0.05, 238.0]) - (1.0 + 0.05 / 234.0)).abs() < 1e-15);
        // λ² − 0.028 = 0.222; s = 0.1 + 0.3 · 0.25/0.24 + 0.2 · 0.25 = 0.4625, n² = 1.925/0.5375.
        let seven = 1.5 + 0.01 / 0.222 + 0.001 / (0.222 * 0.222) + 0.1 * 0.25 + 0.2 * 0.0625 + 0.3 * 0.015625;
        assert!((at(7, &[1.5, 0.01, 0.001, 0.1, 0.2, 0.3]) - seven).abs() < 1e-15);
        assert!((at(8, &[0.1, 0.3, 0.01, 0.2]) - (1.925 / 0.5375f64).sqrt()).abs() < 1e-15);
        // (λ − c)² = 0.04, so that the last term is 0.5 · 0.2/0.14.
        assert!((at(9, &[2.0, 0.03, 0.01, 0.5, 0.3, 0.1]) - (2.125 + 0.1 / 0.14f64).sqrt()).abs() < 1e-14);
        assert!(RefractiveIndex::formula(10, &[1.0]).unwrap_err().contains("1 to 9"));
        assert!(RefractiveIndex::formula(2, &[1.0, 2.0]).unwrap_err().contains("found 2"));
        assert!(RefractiveIndex::formula(4, &[1.0]).is_err());
    }

    /// Each formula with a resonance at λ² = 0.3 µm², and the same of no strength.
    #[test]
    fn each_formula_is_refused_for_its_resonance_in_the_band() {
        type OfStrength = fn(f64) -> Vec<f64>;
        let formulas: [(u32, OfStrength); 8] = [
            (1, |strength| vec![0.1, strength, 0.3f64.sqrt()]),
            (2, |strength| vec![0.1, strength, 0.3]),
            (2, |strength| vec![0.0, strength, 0.3]),
            (4, |strength| vec![2.0, strength, 2.0, 0.3, 1.0, 0.0, 0.0, 0.0, 1.0]),
            (4, |strength| vec![2.0, 0.0, 0.0, 0.0, 1.0, strength, 2.0, 0.3, 1.0]),
            (6, |strength| vec![0.1, strength, 1.0 / 0.3]),
            (8, |strength| vec![0.1, strength, 0.3, 0.0]),
            (9, |strength| vec![2.0, strength, 0.3, 0.0, 0.0, 1.0]),
        ];
        for (number, of) in formulas {
            let told = |strength| RefractiveIndex::formula(number, &of(strength)).unwrap().check_band();
            assert!(told(1.0).unwrap_err().contains("resonance at 547.7 nm"), "{number}: {:?}", told(1.0));
            assert_eq!(told(0.0), Ok(()), "{number}");
        }
    }

    /// A resonance of no strength on a wavelength at which the band is looked at, 0.5 µm, where a term would be 0/0: it is no
    /// fault, and the others are as without it.
    #[test]
    fn a_term_of_no_strength_is_nothing_at_its_resonance() {
        let formula = |number, c: &[f64]| RefractiveIndex::formula(number, c).unwrap();
        let pairs = [
            (RefractiveIndex::sellmeier([1.2, 0.0, -0.0], [0.01, 0.25, 0.25]), formula(2, &[0.0, 1.2, 0.01])),
            (formula(1, &[0.1, 1.2, 0.1, 0.0, 0.5]), formula(1, &[0.1, 1.2, 0.1])),
            (formula(2, &[0.0, 1.2, 0.01, 0.0, 0.25]), formula(2, &[0.0, 1.2, 0.01])),
            (formula(2, &[0.1, 1.2, 0.01, 0.0, 0.25]), formula(2, &[0.1, 1.2, 0.01])),
            (formula(6, &[0.3, 0.0, 4.0]), formula(6, &[0.3])),
            (formula(8, &[0.3, 0.0, 0.25, 0.0]), formula(8, &[0.3, 0.0, 0.0, 0.0])),
            (formula(9, &[2.3, 0.0, 0.25, 0.0, 0.5, 0.0]), formula(9, &[2.3, 0.0, 0.0, 0.0, 0.0, 1.0])),
        ];
        for (with, without) in pairs {
            assert_eq!(with.check_band(), Ok(()), "{with:?}");
            for nm in [400.0, 500.0, 700.0] {
                assert_eq!(with.at(nm), without.at(nm), "{with:?} at {nm} nm");
            }
            assert_eq!(with.lanes(Lanes::splat(500.0)), without.lanes(Lanes::splat(500.0)), "{with:?}");
        }
    }

    /// Rows that stand twice or out of order beyond the band's neighbours are no fault, and change nothing in the band.
    #[test]
    fn rows_that_no_light_meets_may_stand_in_any_order() {
        let met = [[350.0, 1.7], [400.0, 1.6], [800.0, 1.5], [900.0, 1.4]];
        let table = |rows: &[[f64; 2]]| RefractiveIndex::Table { samples: rows.to_vec() };
        let before = [[77.55, 2.0], [77.55, 2.1], [60.0, 2.2], [350.0, 1.9]];
        let after = [[5102.0, 1.3], [1320.0, 1.2], [1320.0, 1.1]];
        let all = table(&[&before[..], &met[..], &after[..]].concat());
        assert_eq!(all.check_band(), Ok(()));
        for nm in [360.0, 400.0, 555.5, 800.0, 830.0] {
            assert_eq!(all.at(nm), table(&met).at(nm), "{nm} nm");
        }
        // None may stand among those of the band.
        assert!(table(&[[300.0, 1.6], [900.0, 1.5], [700.0, 1.5], [950.0, 1.4]]).check_band().is_err());
    }

    #[test]
    fn an_index_that_fails_in_the_band_is_refused_in_words() {
        // A resonance at 0.5 µm.
        let pole = RefractiveIndex::Sellmeier { b: [1.0, 0.0, 0.0], c: [0.25, 0.0, 0.0] };
        assert!(pole.check_band().unwrap_err().contains("resonance at 500.0 nm"));
        // n² = 1 − 3 λ² / (λ² − 0.01) is below −2.
        let negative = RefractiveIndex::Sellmeier { b: [-3.0, 0.0, 0.0], c: [0.01, 0.0, 0.0] };
        assert!(negative.check_band().unwrap_err().contains("negative square"));
        let short = RefractiveIndex::Table { samples: vec![[400.0, 1.5], [700.0, 1.5]] };
        assert!(short.check_band().unwrap_err().ends_with("400 to 700 nm"));
        let micrometres = RefractiveIndex::Table { samples: vec![[0.4, 1.5], [0.7, 1.5]] };
        assert!(micrometres.check_band().unwrap_err().ends_with("found 0.4 to 0.7 nm (are they in µm?)"));
        let disorder = RefractiveIndex::Table { samples: vec![[300.0, 1.5], [500.0, 1.5], [500.0, 1.5], [900.0, 1.5]] };
        assert!(disorder.check_band().unwrap_err().contains("sample 2: expected ascending wavelengths, found 500 nm"));
        let descending = RefractiveIndex::Table { samples: vec![[900.0, 1.5], [500.0, 1.5], [300.0, 1.5]] };
        assert!(descending.check_band().unwrap_err().contains("ascending"));
        assert!(RefractiveIndex::Table { samples: vec![] }.check_band().unwrap_err().contains("no samples"));
        assert!(RefractiveIndex::Constant(f64::NAN).check_band().is_err());
        assert!(RefractiveIndex::Constant(15.0).check_band().unwrap_err().contains("found 15"));
        RefractiveIndex::Constant(1.0).check_band().unwrap();
    }
}
