//! The CIE 1931 2° standard observer: from radiance to XYZ.
//!
//! The table has a row each nanometre from 360 to 830 and is linear between them. XYZ is scaled
//! such that radiance 1 at every wavelength has Y = 1.

use crate::spectrum::{LANES, Lanes, SampledWavelengths, Spectrum, whole};
use std::sync::LazyLock;
use wide::f32x8;

/// ∫ ȳ dλ over the band in nm, of the interpolated table: its column sum 106.85691710 less half
/// of the two end values.
pub const Y_INTEGRAL: f64 = 106.856_914_916_767;

const ROWS: usize = 471;

struct Observer {
    /// x̄, ȳ, z̄ at 360 + i nm.
    rows: Vec<[f64; 3]>,
    /// x̄, ȳ, z̄, 0 at 360 + i nm, then what each grows by up to the next row: one load a lane.
    packed: Vec<f32x8>,
}

static OBSERVER: LazyLock<Observer> = LazyLock::new(|| {
    let rows = parse(include_str!("data/cie_1931_2deg.txt"));
    let packed = (0..rows.len())
        .map(|i| {
            let a = rows[i];
            let b = rows[(i + 1).min(rows.len() - 1)];
            let d = |c: usize| (b[c] - a[c]) as f32;
            f32x8::new([a[0] as f32, a[1] as f32, a[2] as f32, 0.0, d(0), d(1), d(2), 0.0])
        })
        .collect();
    Observer { rows, packed }
});

/// Reads rows of three numbers; `#` starts a comment line. The text is part of the program, and
/// a test reads it, so a fault here is a fault of the build.
fn parse(text: &str) -> Vec<[f64; 3]> {
    let rows: Vec<[f64; 3]> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let mut numbers = line.split(' ').map(|x| x.parse().expect("the observer's table holds numbers"));
            std::array::from_fn(|_| numbers.next().expect("the observer's table has three columns"))
        })
        .collect();
    assert_eq!(rows.len(), ROWS, "the observer's table has a row each nm");
    rows
}

/// x̄, ȳ, z̄ at `nm`; zero outside the band.
#[must_use]
pub fn matching(nm: f64) -> [f64; 3] {
    let rows = &OBSERVER.rows;
    let t = nm - 360.0;
    if !(0.0..=470.0).contains(&t) {
        return [0.0; 3];
    }
    let i = (t as usize).min(ROWS - 2);
    let f = t - i as f64;
    std::array::from_fn(|c| rows[i][c] + f * (rows[i + 1][c] - rows[i][c]))
}

/// CIE XYZ of one sample: the mean over the lanes of `radiance`·`inv_pdf`·(x̄, ȳ, z̄), over
/// [`Y_INTEGRAL`].
#[must_use]
#[inline]
pub fn xyz(radiance: Lanes, wavelengths: &SampledWavelengths) -> [f32; 3] {
    let packed = OBSERVER.packed.as_slice();
    let t = wavelengths.nm - Lanes::splat(360.0);
    let row = t.fast_trunc_int();
    let weight = radiance * wavelengths.inv_pdf;
    let slope_weight = (weight * (t - whole(row))).to_array();
    let weight = weight.to_array();
    let row = row.to_array();
    // Two sums, so that an addition need not wait for the one before.
    let mut sum = [f32x8::splat(0.0); 2];
    for k in 0..LANES {
        let (w, d) = (weight[k], slope_weight[k]);
        // A wavelength outside the band cannot be drawn; it would meet an end row.
        let entry = packed[(row[k] as u32 as usize).min(ROWS - 1)];
        sum[k % 2] = f32x8::new([w, w, w, w, d, d, d, d]).mul_add(entry, sum[k % 2]);
    }
    let sum = sum[0] + sum[1];
    let s = sum.to_array();
    const SCALE: f32 = (1.0 / (LANES as f64 * Y_INTEGRAL)) as f32;
    [(s[0] + s[4]) * SCALE, (s[1] + s[5]) * SCALE, (s[2] + s[6]) * SCALE]
}

/// [`xyz`] of light that is dark in all lanes but one.
#[must_use]
#[inline]
pub fn xyz_of_lane(radiance: Lanes, lane: usize, wavelengths: &SampledWavelengths) -> [f32; 3] {
    let at = |x: Lanes| x.to_array()[lane];
    let t = at(wavelengths.nm) - 360.0;
    let row = (t as usize).min(ROWS - 1);
    let entry = OBSERVER.packed[row].to_array();
    let weight = at(radiance) * at(wavelengths.inv_pdf) * (1.0 / (LANES as f64 * Y_INTEGRAL)) as f32;
    let fraction = t - row as f32;
    std::array::from_fn(|c| weight * fraction.mul_add(entry[4 + c], entry[c]))
}

/// CIE XYZ of a whole spectrum.
///
/// Two-point Gauss quadrature in each cell between neighbouring nanometres and knots of the
/// spectrum: exact for tables and products of two tables (the integrand is a cubic there), and
/// for narrow lines.
#[must_use]
pub fn tristimulus(spectrum: &Spectrum) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (nm, weight) in quadrature(&spectrum.breakpoints()) {
        let value = spectrum.at(nm) * weight;
        let bar = matching(nm);
        for c in 0..3 {
            sum[c] += value * bar[c];
        }
    }
    sum.map(|s| s / Y_INTEGRAL)
}

/// Nodes in nm and weights in nm that integrate over the band: two Gauss points in each cell
/// between whole nanometres and the `breakpoints`.
pub(crate) fn quadrature(breakpoints: &[f64]) -> Vec<(f64, f64)> {
    let mut edges: Vec<f64> = (360..=830).map(f64::from).collect();
    edges.extend(breakpoints.iter().copied().filter(|nm| *nm > 360.0 && *nm < 830.0));
    edges.sort_by(f64::total_cmp);
    edges.dedup();
    // Nodes at ±1/√3 of the half width.
    const NODE: f64 = 0.577_350_269_189_625_8;
    edges
        .windows(2)
        .flat_map(|cell| {
            let (mid, half) = (0.5 * (cell[0] + cell[1]), 0.5 * (cell[1] - cell[0]));
            [(mid - NODE * half, half), (mid + NODE * half, half)]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::WavelengthDistribution;

    /// The sums that colour-science 0.4.7 gives for the table it ships (106.86546949, 106.8569171,
    /// 106.89225128), each good to half of its last digit; swapping any two digits of a row
    /// moves a sum by more, unless they are equal or in the last two places.
    #[test]
    fn columns_have_the_published_sums() {
        let published = [106.865_469_49, 106.856_917_1, 106.892_251_28];
        for c in 0..3 {
            let sum: f64 = OBSERVER.rows.iter().map(|row| row[c]).sum();
            assert!((sum - published[c]).abs() < 6e-8, "column {c}: {sum}");
        }
        let trapezoid: f64 = OBSERVER.rows.windows(2).map(|w| 0.5 * (w[0][1] + w[1][1])).sum();
        assert!((trapezoid - Y_INTEGRAL).abs() < 1e-9, "{trapezoid}");
    }

    /// Two digits that swap places leave a kink. The table is smooth: the fourth difference of ȳ
    /// about its peak is below 2e-5, a swap of the third and fourth digit of ȳ(547) makes 9e-3.
    #[test]
    fn luminosity_is_smooth_about_its_peak() {
        for i in 170..220 {
            let y = |j: usize| OBSERVER.rows[j][1];
            let fourth = y(i - 2) - 4.0 * y(i - 1) + 6.0 * y(i) - 4.0 * y(i + 1) + y(i + 2);
            assert!(fourth.abs() < 1e-4, "{} nm: {fourth}", 360 + i);
        }
    }

    /// Rows of the published 1 nm table; the interpolation may round once.
    #[test]
    fn rows_have_the_printed_values() {
        let printed = [
            (360.0, [1.299e-4, 3.917e-6, 6.061e-4]),
            (450.0, [0.3362, 0.038, 1.772_11]),
            (555.0, [0.512_050_1, 1.0, 0.005_749_999]),
            (600.0, [1.0622, 0.631, 0.0008]),
            (830.0, [1.251_141e-6, 4.5181e-7, 0.0]),
        ];
        for (nm, row) in printed {
            let found = matching(nm);
            assert!(found.iter().zip(row).all(|(a, b)| (a - b).abs() < 1e-15), "{nm}: {found:?}");
        }
        assert_eq!(matching(359.9), [0.0; 3]);
    }

    /// The sum over lanes is the formula of [`matching`] in f32. A term is rounded when weighted (2), in the
    /// table (1), when added (4 in its half, 2 for the halves) and when scaled (2): 11 half ulps of 2⁻²⁴ of
    /// terms that are not negative, and 2 for the slope's share.
    #[test]
    fn lanes_agree_with_the_exact_table() {
        let distribution = WavelengthDistribution::visible();
        for i in 0..1000 {
            let w = distribution.sample(f64::from(i) / 1000.0);
            let found = xyz(Lanes::splat(2.0), &w);
            let mut expected = [0.0; 3];
            for (nm, inv_pdf) in w.nm.to_array().into_iter().zip(w.inv_pdf.to_array()) {
                let bar = matching(f64::from(nm));
                for c in 0..3 {
                    expected[c] += 2.0 * bar[c] * f64::from(inv_pdf) / (LANES as f64 * Y_INTEGRAL);
                }
            }
            for (found, expected) in found.into_iter().zip(expected) {
                assert!(
                    (f64::from(found) / expected - 1.0).abs() < 13.0 / f64::from(1 << 24),
                    "{i}: {found} {expected}"
                );
            }
        }
    }

    /// Equal energy has Y = 1 by definition; X and Z are the other columns' trapezoid sums over that of ȳ:
    /// 106.86540391 / 106.85691492 and 106.89194823 / 106.85691492.
    #[test]
    fn equal_energy_is_one() {
        let [x, y, z] = tristimulus(&Spectrum::constant(1.0));
        assert!(
            (y - 1.0).abs() < 1e-12 && (x - 1.000_079_443).abs() < 1e-9 && (z - 1.000_327_853).abs() < 1e-9,
            "{x} {y} {z}"
        );
    }
}
