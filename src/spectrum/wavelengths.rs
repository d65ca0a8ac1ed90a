//! Which wavelengths a path carries.
//!
//! A path draws one number u and carries the eight wavelengths P⁻¹(frac(u + k/8)): a rotated
//! lattice, which integrates smooth spectra almost without noise (Wilkie et al. 2014, "Hero
//! Wavelength Spectral Sampling"). P⁻¹ is linear in each of 2048 intervals of u, and `inv_pdf` is its
//! slope, so every estimate is unbiased whatever the density is; the density only decides how
//! much colour noise is left.
//!
//! **Lines.** An interval that reaches from a spectral line into the dark beside it would meet the line rarely and then with
//! thousands of times its weight: fireflies. So the band is cut where the density changes within an interval by more than
//! [`UNEVEN`](density::UNEVEN), and each piece has whole intervals. A line may be as narrow as some hundred steps of f32: slopes are kept
//! in place of the differences of wavelengths, and a wavelength that is rounded stays on its side of a cut.
//!
//! Three densities are compared for a scene: `vis` follows the eye, `em` follows the emitters, `mix`
//! is half of each. Smooth lights are best with `vis`, whose smoothness keeps the lattice accurate;
//! line lights with `em`, which puts samples on the lines.

mod density;

use crate::spectrum::observer::xyz_of_lane;
use crate::spectrum::{BAND_NM, ColourSpace, LANES, Lanes, Spectrum};
use density::{Density, Interval};
use rayon::prelude::*;

/// The eight wavelengths of a path, in nm, and one over the density each was drawn with, in nm.
///
/// Lane 0 is the hero: the wavelength that decides where the path goes when only one can.
/// An integral over the band is estimated by the mean over the lanes of f · `inv_pdf`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledWavelengths {
    /// Wavelengths in nm.
    pub nm: Lanes,
    /// 1 / p(λ), nm.
    pub inv_pdf: Lanes,
}

/// Intervals of P⁻¹: a power of two, a multiple of [`LANES`], so that all lanes sit at the same place of theirs.
const KNOTS: usize = 2048;
/// So many points of u stand for numbers drawn at random, to [`WavelengthDistribution::for_scene`].
pub const RANDOM: usize = KNOTS;
/// Intervals between one lane and the next.
const ROWS: usize = KNOTS / LANES;

/// For each row r, twice the sequence over k of interval r + k · [`ROWS`], nm: a lattice that starts in any lane is 8
/// neighbours.
#[derive(Clone)]
struct Row {
    begin: [f32; 2 * LANES],
    width: [f32; 2 * LANES],
    last: [f32; 2 * LANES],
}

/// How wavelengths are drawn: see the module's words.
#[derive(Clone)]
pub struct WavelengthDistribution {
    rows: Vec<Row>,
    /// How many there are: 2 to this.
    rows_log2: u32,
    /// Intervals by which all lanes are turned.
    turn: usize,
    /// Always one of these, alike likely.
    fixed: Option<Box<[SampledWavelengths]>>,
    description: String,
}

impl std::fmt::Debug for WavelengthDistribution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "WavelengthDistribution({})", self.description)
    }
}

impl WavelengthDistribution {
    /// Every wavelength of the band alike.
    #[must_use]
    pub fn uniform() -> WavelengthDistribution {
        Density::uniform().distribution("uniform: every wavelength of 360 to 830 nm alike".into())
    }

    /// By the eye: 0.003939804 / cosh²(0.0072 (λ − 538)) per nm, normalised over the band (Radziszewski
    /// et al. 2009, "An Improved Technique for Full Spectral Rendering").
    #[must_use]
    pub fn visible() -> WavelengthDistribution {
        Density::visible().distribution("vis: by the eye, 1 / cosh²(0.0072 (λ − 538))".into())
    }

    /// Always the same eight wavelengths, each standing for an eighth of the band: for probes and
    /// comparisons. An integral is then a fixed quadrature, which is biased.
    ///
    /// # Errors
    /// In words, if a wavelength is outside 360 to 830 nm.
    pub fn fixed(nm: [f64; LANES]) -> Result<WavelengthDistribution, String> {
        if let Some(bad) = nm.iter().find(|nm| !(BAND_NM[0]..=BAND_NM[1]).contains(*nm)) {
            return Err(format!("expected wavelengths of 360 to 830 nm, found {bad}"));
        }
        let sample = SampledWavelengths {
            nm: Lanes::new(nm.map(|x| x as f32)),
            inv_pdf: Lanes::splat((BAND_NM[1] - BAND_NM[0]) as f32),
        };
        let description = format!("fixed: {nm:?} nm");
        Ok(WavelengthDistribution {
            rows: Vec::new(),
            rows_log2: 0,
            turn: 0,
            fixed: Some([sample].into()),
            description,
        })
    }

    /// Always the wavelengths `nm`, each standing for as much of the band as any other: for comparisons. A path carries
    /// them over and over in its lanes, from a lane on that is drawn, so that each lane leads as often as any other.
    ///
    /// # Panics
    /// If there are none, more than [`LANES`], or one outside 360 to 830 nm.
    #[must_use]
    pub fn in_turn(nm: &[f64]) -> WavelengthDistribution {
        let within = |nm: &f64| (BAND_NM[0]..=BAND_NM[1]).contains(nm);
        assert!((1..=LANES).contains(&nm.len()) && nm.iter().all(within), "{nm:?}");
        let width = (BAND_NM[1] - BAND_NM[0]) / nm.len() as f64;
        let place = |lane: usize| lane % nm.len();
        let lanes_of = |i: usize| (0..LANES).filter(|&lane| place(lane) == i).count();
        let turned = |turn: usize| {
            let lanes: [usize; LANES] = std::array::from_fn(|lane| place((lane + turn) % LANES));
            SampledWavelengths {
                nm: Lanes::new(lanes.map(|i| nm[i] as f32)),
                // The mean over eight lanes is to be the sum over the wavelengths, times their width.
                inv_pdf: Lanes::new(lanes.map(|i| (width * LANES as f64 / lanes_of(i) as f64) as f32)),
            }
        };
        let fixed = Some((0..LANES).map(turned).collect());
        let description = format!("in turn: {nm:?} nm");
        WavelengthDistribution { rows: Vec::new(), rows_log2: 0, turn: 0, fixed, description }
    }

    /// The same density with `count` wavelengths a path, evenly turned, each in as many lanes: to see what eight buy.
    /// Lanes of one wavelength share its way, so that whatever is unbiased with eight is with fewer.
    ///
    /// # Panics
    /// If the wavelengths are fixed, or `count` is not 1, 2, 4 or 8.
    #[must_use]
    pub fn with_count(&self, count: usize) -> WavelengthDistribution {
        assert!(self.fixed.is_none() && LANES.is_multiple_of(count), "{count} of {self:?}");
        let interval = |j: usize| {
            let (row, k) = (&self.rows[j % ROWS], j / ROWS);
            Interval { begin: row.begin[k], width: row.width[k], last: row.last[k] }
        };
        let all: Vec<Interval> = (0..KNOTS).map(interval).collect();
        let description = format!("{}; {count} a path", self.description);
        WavelengthDistribution { turn: self.turn, ..WavelengthDistribution::of_intervals(&all, count, description) }
    }

    /// The same, half a step on: its eight wavelengths and those of `self` at the same u are sixteen, evenly turned.
    #[must_use]
    pub fn half_a_step_on(&self) -> WavelengthDistribution {
        WavelengthDistribution { turn: (self.turn + ROWS / 2) % KNOTS, ..self.clone() }
    }

    /// The density that leaves the least colour noise in a scene with these emitters (each with the
    /// share of the light it stands for; its own scale does not count) and reflectances.
    ///
    /// For `vis`, `mix` and `em`, and for every emitter times 1 and times each reflectance, the
    /// standard deviation over u of the linear Rec.709 estimate of one path is computed on the
    /// lattice itself; the density with the least mean, weighted by emitter, is taken. At most the 64
    /// strongest emitters and 64 reflectances, evenly spaced through the list, are looked at. Of `points`, a power of two up to
    /// [`RANDOM`], that are spread evenly over u each piece of the band, such as a line, has its share, one at least.
    #[must_use]
    pub fn for_scene(emitters: &[(f64, Spectrum)], reflectances: &[Spectrum], points: usize) -> WavelengthDistribution {
        let shares = Shares::of(emitters);
        if shares.0.is_empty() {
            let mut distribution = WavelengthDistribution::visible();
            distribution.description.push_str("; no emitter to choose by");
            return distribution;
        }
        let step = reflectances.len().div_ceil(Shares::MOST).max(1);
        let chosen: Vec<&Spectrum> = reflectances.iter().step_by(step).filter(|r| !r.is_constant()).collect();

        let emission = shares.emission();
        let visible = Density::visible();
        let jumps = shares.jumps(points);
        let candidates = [
            ("vis", visible.clone()),
            ("mix", Density::mixture([(0.5, &visible), (0.5, &emission)])),
            ("em", Density::mixture([(0.1, &visible), (0.9, &emission)])),
        ]
        .map(|(name, density)| (name, density.distribution_cut(String::new(), points, &jumps)));
        let noise_of = |(_, distribution): &(&str, WavelengthDistribution)| {
            let lattice = Lattice::of(distribution);
            let lights: Vec<Vec<Lanes>> = shares.0.iter().map(|(_, spectrum, _)| lattice.values(spectrum)).collect();
            // Of each reflectance, under every light.
            let of_factor = |reflectance: &&Spectrum| -> Vec<Option<f64>> {
                let factor = lattice.values(reflectance);
                lights.iter().map(|light| lattice.noise(light, Some(&factor))).collect()
            };
            let factors: Vec<Vec<Option<f64>>> = chosen.par_iter().map(of_factor).collect();
            let (mut sum, mut weights) = (0.0, 0.0);
            for (i, (weight, ..)) in shares.0.iter().enumerate() {
                // Light that the lattice does not see, as it steps over a narrow line, is seldom met by paths.
                sum += weight * lattice.noise(&lights[i], None).unwrap_or(f64::INFINITY);
                weights += weight;
                for of_factor in &factors {
                    sum += weight * of_factor[i].unwrap_or(0.0);
                    weights += weight;
                }
            }
            sum / weights
        };
        let noise: Vec<f64> = candidates.par_iter().map(noise_of).collect();
        let best = (1..3).fold(0, |best, i| if noise[i] < noise[best] { i } else { best });
        let what =
            ["by the eye", "half by the eye, half by the emitters", "a tenth by the eye, the rest by the emitters"];
        let figure = |i: usize| match noise[i].is_finite() {
            true => format!("{} {:.2} %", candidates[i].0, 100.0 * noise[i]),
            false => format!("{} steps over a line", candidates[i].0),
        };
        let others: Vec<String> = (0..3).filter(|i| *i != best).map(figure).collect();
        let description = format!(
            "{}: {}; colour noise of a path {:.2} % ({})",
            candidates[best].0,
            what[best],
            100.0 * noise[best],
            others.join(", ")
        );
        WavelengthDistribution { description, ..candidates[best].1.clone() }
    }

    /// For bands of the spectrum, with these emitters and the shares of the light they stand for. The share `colours` of the
    /// samples is for the colours that are rendered as well: half of it by the eye, half by the emitters as the eye sees them.
    /// What is left goes by the sum of the responses and by that sum times the emission, half by each. Of `points` as in
    /// [`WavelengthDistribution::for_scene`].
    ///
    /// Every band of a sum of bands of equal area gets at least its share of what goes by the responses, however
    /// dim it is; where all of the light comes in lines that the bands see, half of the samples lie on lines.
    #[must_use]
    pub fn for_bands(
        responses: &[&Spectrum],
        emitters: &[(f64, Spectrum)],
        colours: f64,
        points: usize,
    ) -> WavelengthDistribution {
        let shares = Shares::of(emitters);
        let mut breakpoints: Vec<f64> = responses.iter().flat_map(|r| r.breakpoints()).collect();
        breakpoints.extend(emitters.iter().flat_map(|(_, e)| e.breakpoints()));
        // Each by its own largest value: units of radiance do not count.
        let emitters: Vec<(f64, &Spectrum)> =
            emitters.iter().filter(|(w, s)| *w > 0.0 && s.max() > 0.0).map(|(w, s)| (w / s.max(), s)).collect();
        let sensitivity = |nm: f64| responses.iter().map(|r| r.at(nm)).sum::<f64>();
        let light = |nm: f64| emitters.iter().map(|(w, s)| w * s.at(nm)).sum::<f64>();
        let by_response = Density::new(&breakpoints, sensitivity);
        let by_both = Density::new(&breakpoints, |nm| sensitivity(nm) * light(nm));
        let visible = Density::visible();
        let emission = if shares.0.is_empty() { visible.clone() } else { shares.emission() };
        let by_both = if by_both.total > 0.0 { &by_both } else { &by_response };
        let (of_bands, of_colours) = (0.5 * (1.0 - colours), 0.5 * colours);
        let parts = [(of_bands, &by_response), (of_bands, by_both), (of_colours, &visible), (of_colours, &emission)];
        let description = format!(
            "bands: {0:.1} % by the responses, {0:.1} % by the responses and the emitters, {1:.1} % by the eye, \
             {1:.1} % by the emitters",
            100.0 * of_bands,
            100.0 * of_colours
        );
        Density::mixture(parts).distribution_cut(description, points, &shares.jumps(points))
    }

    /// `count` wavelengths a path with these intervals, [`KNOTS`] of them.
    fn of_intervals(intervals: &[Interval], count: usize, description: String) -> WavelengthDistribution {
        let between = KNOTS / count;
        let row = |r: usize| {
            let each = |part: fn(&Interval) -> f32| std::array::from_fn(|k| part(&intervals[r + k % count * between]));
            Row { begin: each(|i| i.begin), width: each(|i| i.width), last: each(|i| i.last) }
        };
        let rows = (0..between).map(row).collect();
        WavelengthDistribution { rows, rows_log2: between.ilog2(), turn: 0, fixed: None, description }
    }

    /// The wavelengths of `u` in [0, 1): all of them within the band.
    #[must_use]
    #[inline]
    pub fn sample(&self, u: f64) -> SampledWavelengths {
        if let Some(fixed) = &self.fixed {
            return fixed[((u * fixed.len() as f64) as usize).min(fixed.len() - 1)];
        }
        // The lanes are whole rows apart, so they share the place within their intervals. The product
        // with a power of two is exact.
        let at = u * KNOTS as f64;
        let knot = (at as u32 as usize).min(KNOTS - 1);
        let place = Lanes::splat((at - knot as f64) as f32);
        let knot = (knot + self.turn) % KNOTS;
        let (first, row) = (knot >> self.rows_log2, knot & ((1 << self.rows_log2) - 1));
        let row = &self.rows[row];
        let eight = |all: &[f32; 2 * LANES]| Lanes::new(std::array::from_fn(|k| all[first + k]));
        let width = eight(&row.width);
        let nm = place.mul_add(width, eight(&row.begin)).fast_min(eight(&row.last));
        SampledWavelengths { nm, inv_pdf: width * Lanes::splat(KNOTS as f32) }
    }

    /// Which density this is, and for a scene's own the figures it was chosen by.
    #[must_use]
    pub fn describe(&self) -> &str {
        &self.description
    }
}

/// The strongest emitters, with the share of the light each stands for and its density.
struct Shares<'a>(Vec<(f64, &'a Spectrum, Density)>);

impl<'a> Shares<'a> {
    /// So many emitters are looked at.
    const MOST: usize = 64;

    fn of(emitters: &'a [(f64, Spectrum)]) -> Shares<'a> {
        let mut weighed: Vec<&(f64, Spectrum)> = emitters.iter().filter(|(w, _)| *w > 0.0 && w.is_finite()).collect();
        // A stable sort: equal weights stay in the order given.
        weighed.sort_by(|a, b| b.0.total_cmp(&a.0));
        let share = |(weight, spectrum): &'a (f64, Spectrum)| (*weight, spectrum, Density::of_emission(spectrum));
        let shares = weighed.into_iter().map(share).filter(|(_, _, density)| density.total > 0.0);
        Shares(shares.take(Shares::MOST).collect())
    }

    /// What all of them send out, as the eye sees it.
    fn emission(&self) -> Density {
        Density::mixture(self.0.iter().map(|(weight, _, density)| (*weight, density)))
    }

    /// Where they jump, nm. Points in a lattice would step over lines: each has its piece of the band. Numbers drawn at random
    /// meet them in the mean.
    fn jumps(&self, points: usize) -> Vec<f64> {
        let of_lattice = self.0.iter().filter(|_| points < RANDOM);
        of_lattice.flat_map(|(_, spectrum, _)| spectrum.jumps()).take(points / 2 - 1).collect()
    }
}

/// All the samples that a distribution can give, four to an interval: what its noise is computed on.
struct Lattice {
    samples: Vec<SampledWavelengths>,
    /// The weights of the lanes in red, green and blue.
    weights: Vec<[Lanes; 3]>,
}

impl Lattice {
    fn of(distribution: &WavelengthDistribution) -> Lattice {
        // u up to 1/8 is enough: further on the same wavelengths come in other lanes.
        let count = 4 * ROWS;
        let samples: Vec<SampledWavelengths> =
            (0..count).map(|i| distribution.sample((i as f64 + 0.5) / (count * LANES) as f64)).collect();
        let weights = samples
            .iter()
            .map(|s| {
                let of_lane = |k| ColourSpace::Rec709.from_xyz(xyz_of_lane(Lanes::ONE, k, s));
                let rgb: [[f32; 3]; LANES] = std::array::from_fn(of_lane);
                std::array::from_fn(|c| Lanes::new(std::array::from_fn(|k| rgb[k][c])))
            })
            .collect();
        Lattice { samples, weights }
    }

    fn values(&self, spectrum: &Spectrum) -> Vec<Lanes> {
        self.samples.iter().map(|s| spectrum.eval(s.nm)).collect()
    }

    /// Standard deviation of the estimate over its mean; `None` for black.
    fn noise(&self, light: &[Lanes], reflectance: Option<&Vec<Lanes>>) -> Option<f64> {
        let mut sum = [0.0; 3];
        let mut square = 0.0;
        for (i, weights) in self.weights.iter().enumerate() {
            let value = reflectance.map_or(light[i], |r| light[i] * r[i]);
            for c in 0..3 {
                let estimate = f64::from((value * weights[c]).reduce_add());
                sum[c] += estimate;
                square += estimate * estimate;
            }
        }
        let n = self.weights.len() as f64;
        let mean: f64 = sum.iter().map(|s| (s / n) * (s / n)).sum();
        (mean > 0.0).then(|| ((square / n - mean).max(0.0) / mean).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::density::{PIECES, UNEVEN, rec709, whole};
    use super::*;
    use crate::spectrum::observer::{Y_INTEGRAL, matching, tristimulus, xyz};
    use crate::spectrum::{illuminant::d65, upsample::reflectance};

    fn lines() -> Spectrum {
        let line = |nm, power| (nm, power, 1.0);
        Spectrum::lines(&[line(436.0, 1.0), line(487.0, 0.4), line(544.0, 2.0), line(588.0, 0.5), line(611.0, 2.0)])
            .unwrap()
    }

    fn all() -> Vec<WavelengthDistribution> {
        vec![
            WavelengthDistribution::uniform(),
            WavelengthDistribution::visible(),
            WavelengthDistribution::for_scene(&[(1.0, d65())], &[], RANDOM),
            WavelengthDistribution::for_scene(&[(1.0, lines())], &[reflectance([0.6, 0.2, 0.1]).unwrap()], RANDOM),
        ]
    }

    #[test]
    fn wavelengths_of_the_first_and_last_u_stay_in_the_band() {
        for distribution in all() {
            let last_f64 = 1.0 - f64::EPSILON / 2.0;
            for u in [0.0, f64::MIN_POSITIVE, 0.125, 0.875, 1.0 - f64::from(f32::EPSILON) / 2.0, last_f64] {
                let s = distribution.sample(u);
                for (nm, inv_pdf) in s.nm.to_array().into_iter().zip(s.inv_pdf.to_array()) {
                    assert!((360.0..=830.0).contains(&nm) && inv_pdf > 0.0 && inv_pdf.is_finite(), "{u} {s:?}");
                }
            }
            assert_eq!(distribution.sample(0.0).nm.to_array()[0], 360.0);
        }
    }

    /// `inv_pdf` is the slope of the map: λ(u₂) − λ(u₁) = inv_pdf · (u₂ − u₁) within an interval, to the
    /// rounding of λ (3e-5 nm each); and lane k of u is the hero of u + k/8.
    #[test]
    fn inverse_density_is_the_slope_of_the_map() {
        for distribution in all() {
            for i in 0..2048u32 {
                let u = |f: f64| (f64::from(i) + f) / 2048.0;
                let (a, b) = (distribution.sample(u(0.1)), distribution.sample(u(0.9)));
                let rise = f64::from(b.nm.to_array()[0] - a.nm.to_array()[0]);
                let slope = f64::from(a.inv_pdf.to_array()[0]);
                assert!((rise - slope * 0.8 / 2048.0).abs() < 1.3e-4, "{i}: {rise} {slope}");
                let shifted = distribution.sample((u(0.1) + 3.0 / 8.0).fract());
                assert_eq!(
                    (a.nm.to_array()[3], a.inv_pdf.to_array()[3]),
                    (shifted.nm.to_array()[0], shifted.inv_pdf.to_array()[0])
                );
            }
        }
    }

    /// No light of a line is left to rare samples of great weight: of the two sodium lines, 0.1 nm wide, of one of 0.01 nm,
    /// which is 164 steps of f32, and of many. No sample outweighs the mean by more than [`UNEVEN`] over the nine tenths
    /// that follow the light, times 4/3, as a piece has three quarters of its intervals at the least; and the mean over 2¹⁹
    /// wavelengths is the light's to the rounding of f32.
    #[test]
    fn narrow_lines_make_no_fireflies() {
        let narrow = |lines: &[(f64, f64, f64)]| Spectrum::lines(lines).unwrap();
        let many: Vec<(f64, f64, f64)> =
            (0..40).map(|i| (400.3 + 9.7 * f64::from(i), 1.0 + f64::from(i % 7), 0.02)).collect();
        for (name, light) in [
            ("sodium", narrow(&[(588.995, 2000.0, 0.1), (589.592, 1000.0, 0.1)])),
            ("laser", narrow(&[(632.816, 1.0, 0.01)])),
            ("many", narrow(&many)),
        ] {
            let density = Density::mixture([(0.1, &Density::visible()), (0.9, &Density::of_emission(&light))]);
            let distribution = density.distribution(String::new());
            let expected = tristimulus(&light);
            let length = |c: [f64; 3]| (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).sqrt();
            let n = 1 << 16;
            let (mut most, mut sum) = (0f64, [0.0; 3]);
            for i in 0..n {
                let s = distribution.sample((f64::from(i) + 0.5) / f64::from(8 * n));
                let (values, nm, inv_pdf) = (light.eval(s.nm).to_array(), s.nm.to_array(), s.inv_pdf.to_array());
                for k in 0..LANES {
                    let weight = f64::from(values[k]) * f64::from(inv_pdf[k]) / Y_INTEGRAL;
                    let xyz = matching(f64::from(nm[k])).map(|v| v * weight);
                    most = most.max(length(rec709(xyz)) / length(rec709(expected)));
                    (0..3).for_each(|c| sum[c] += xyz[c] / f64::from(n) / LANES as f64);
                }
            }
            assert!(most < 4.0 / 3.0 * UNEVEN / 0.9, "{name}: {most}");
            for c in 0..3 {
                assert!((sum[c] - expected[c]).abs() < 1e-6 * expected[1], "{name}: {sum:?} {expected:?}");
            }
        }
    }

    /// Three quarters of what is wanted at the least, one for the smallest, and all in all as many as there are.
    #[test]
    fn whole_numbers_are_never_short_of_a_quarter() {
        for pieces in 1..=PIECES {
            for power in [0, 1, 8] {
                let sizes: Vec<f64> = (0..pieces).map(|i| (0.5 + (i * 7 % 13) as f64).powi(power)).collect();
                let sum: f64 = sizes.iter().sum();
                let wanted: Vec<f64> = sizes.iter().map(|s| s / sum * KNOTS as f64).collect();
                let counts = whole(&wanted, KNOTS);
                assert_eq!(counts.iter().sum::<usize>(), KNOTS);
                assert!(wanted.iter().zip(&counts).all(|(w, c)| *c >= 1 && 0.75 * w <= *c as f64), "{pieces} {power}");
            }
        }
    }

    /// ∫ dλ = 470 nm and the XYZ of a light come out of any density: the mean of the estimate over u
    /// below 1/8 (beyond, the same wavelengths come in other lanes). 2¹⁴ u are 2¹⁷ wavelengths: a line
    /// 1 nm wide holds 279 of uniform ones, give or take one, and one more where f32 rounds a wavelength
    /// onto an edge: 280 / 278.9 is 4e-3 too many. Smooth lights come out to the rounding of f32.
    #[test]
    fn estimates_are_unbiased_for_every_density() {
        for distribution in all() {
            for (light, tolerance) in [(Spectrum::constant(1.0), 1e-5), (d65(), 1e-5), (lines(), 5e-3)] {
                let n = 1 << 14;
                let (mut sum, mut width) = ([0.0; 3], 0.0);
                for i in 0..n {
                    let s = distribution.sample((f64::from(i) + 0.5) / f64::from(8 * n));
                    let found = xyz(light.eval(s.nm), &s);
                    (0..3).for_each(|c| sum[c] += f64::from(found[c]) / f64::from(n));
                    width += f64::from(s.inv_pdf.reduce_add()) / f64::from(8 * n);
                }
                assert!((width - 470.0).abs() < 1e-3, "{width}");
                let expected = tristimulus(&light);
                for c in 0..3 {
                    assert!((sum[c] / expected[c] - 1.0).abs() < tolerance, "{distribution:?} {sum:?} {expected:?}");
                }
            }
        }
    }

    /// Lane k of `count` is the hero of u + k/count; a turn of half a step takes u on by a sixteenth; and ∫ dλ over all u is
    /// 470 nm in any lane.
    #[test]
    fn fewer_wavelengths_and_a_turn_are_of_the_same_density() {
        for distribution in all() {
            let hero = |u: f64| {
                let s = distribution.sample(u.fract());
                (s.nm.to_array()[0], s.inv_pdf.to_array()[0])
            };
            // u and its sums with eighths and sixteenths are exact.
            for i in 0..64 {
                let u = (f64::from(i) + 0.25) / 64.0;
                for count in [1, 2, 4, 8] {
                    let s = distribution.with_count(count).sample(u);
                    for k in 0..LANES {
                        let found = (s.nm.to_array()[k], s.inv_pdf.to_array()[k]);
                        assert_eq!(found, hero(u + (k % count) as f64 / count as f64), "{count} at {u}, lane {k}");
                    }
                }
                let on = distribution.half_a_step_on();
                assert_eq!(on.sample(u), distribution.sample((u + 1.0 / 16.0).fract()));
                assert_eq!(on.with_count(1).sample(u).nm, Lanes::splat(hero(u + 1.0 / 16.0).0));
            }
            let one = distribution.with_count(1);
            let width: f64 =
                (0..4096).map(|i| f64::from(one.sample((f64::from(i) + 0.5) / 4096.0).inv_pdf.to_array()[5])).sum();
            assert!((width / 4096.0 - 470.0).abs() < 1e-3, "{width}");
        }
    }

    /// The colour noise that one path has by its choice of wavelengths alone: the standard
    /// deviation over u of the linear Rec.709 vector of `emitter` · `reflectance`, relative to its mean.
    fn colour_noise(of: &WavelengthDistribution, emitter: &Spectrum, reflectance: &Spectrum) -> f64 {
        let lattice = Lattice::of(of);
        lattice.noise(&lattice.values(emitter), Some(&lattice.values(reflectance))).unwrap()
    }

    /// The mean of `light` over a lattice of `points` as it is told, XYZ.
    fn by_lattice(of: &WavelengthDistribution, light: &Spectrum, points: usize) -> [f64; 3] {
        let sets = points / LANES;
        let mut sum = [0.0; 3];
        for s in 0..sets {
            let wavelengths = of.sample((s as f64 + 0.5) / points as f64);
            let own = xyz(light.eval(wavelengths.nm), &wavelengths);
            sum = [0, 1, 2].map(|c| sum[c] + f64::from(own[c]) / sets as f64);
        }
        sum
    }

    /// A line of 1 nm beside a lamp that is ten thousand times as strong: of 32 points one is within it, wherever it lies.
    /// Those of the lamp tell its colour to 1.5 % with what is left of them, and within the line ȳ is nearly straight.
    #[test]
    fn a_lattice_of_few_points_meets_every_line() {
        for nm in [436.0, 450.0, 532.0, 546.1, 589.0, 611.0] {
            let line = Spectrum::lines(&[(nm, 1.0, 1.0)]).unwrap();
            let emitters = [(1e4, d65()), (1.0, line.clone())];
            let distribution = WavelengthDistribution::for_scene(&emitters, &[], 32);
            for (light, bound) in [(&line, 0.01), (&d65(), 0.015)] {
                let (told, exact) = (by_lattice(&distribution, light, 32), tristimulus(light));
                let off = (0..3).map(|c| (told[c] - exact[c]).powi(2)).sum::<f64>().sqrt();
                let size = exact.iter().map(|x| x * x).sum::<f64>().sqrt();
                assert!(off < bound * size, "{nm}: {told:?} {exact:?}");
            }
        }
    }

    /// Bands from 400 to 500 nm beside a picture of colours, and sodium's two lines far from them: of 32 points some are on each
    /// line, and the colour is Σ power · x̄, ȳ, z̄ at the lines, which are straight over 0.1 nm to 1e-5, over ∫ ȳ.
    #[test]
    fn bands_beside_a_picture_leave_its_colours() {
        let edges = [400.0, 425.0, 450.0, 475.0, 500.0];
        let band = |e: &[f64]| Spectrum::from_samples(&[(e[0], 0.04), (e[1], 0.04)], crate::spectrum::Outside::Zero);
        let bands: Vec<Spectrum> = edges.windows(2).map(|e| band(e).unwrap()).collect();
        let lines = [(589.0, 100.0), (589.6, 50.0)];
        let sodium = Spectrum::lines(&lines.map(|(nm, power)| (nm, power, 0.1))).unwrap();
        let emitters = [(1.0, sodium.clone())];
        let distribution = WavelengthDistribution::for_bands(&bands.iter().collect::<Vec<_>>(), &emitters, 0.5, 32);
        let told = by_lattice(&distribution, &sodium, 32);
        let exact =
            [0, 1, 2].map(|c| lines.iter().map(|(nm, power)| power * matching(*nm)[c]).sum::<f64>() / Y_INTEGRAL);
        // π Y of the same light, as irradiance on white: 1.0763 (power times ȳ over ∫ ȳ).
        assert!((exact[1] - 1.0763).abs() < 1e-4, "{exact:?}");
        assert!((0..3).all(|c| (told[c] - exact[c]).abs() < 1e-3 * exact[1]), "{told:?} {exact:?}");
    }

    /// Lines of a hundredth of a nanometre lie between the points of a lattice by the eye: paths meet them where the emitters choose.
    #[test]
    fn lines_that_a_lattice_steps_over_are_met() {
        for nm in [436.0, 450.0, 532.0, 546.1, 589.0, 611.0] {
            let line = Spectrum::lines(&[(nm, 1.0, 0.01)]).unwrap();
            let distribution = WavelengthDistribution::for_scene(&[(1.0, line.clone())], &[], RANDOM);
            assert!(!distribution.describe().starts_with("vis"), "{}", distribution.describe());
            let noise = Lattice::of(&distribution);
            let noise = noise.noise(&noise.values(&line), None).unwrap();
            assert!(noise < 0.2, "{nm}: {noise}");
        }
    }

    /// Sampling by the eye leaves 4 to 5 % for D65 on grey, and far more for lines; sampling by the emitter
    /// tames the lines.
    #[test]
    fn the_density_with_the_least_noise_is_taken() {
        let grey = Spectrum::constant(1.0);
        let visible = WavelengthDistribution::visible();
        let noise = colour_noise(&visible, &d65(), &grey);
        assert!((0.03..0.06).contains(&noise), "{noise}");
        let day = WavelengthDistribution::for_scene(&[(1.0, d65())], &[], RANDOM);
        let night = WavelengthDistribution::for_scene(&[(1.0, lines())], &[], RANDOM);
        assert!(night.describe().starts_with("em:"), "{}", night.describe());
        assert!(
            colour_noise(&night, &lines(), &grey) < 0.2 * colour_noise(&visible, &lines(), &grey),
            "{}",
            night.describe()
        );
        assert!(colour_noise(&day, &d65(), &grey) <= noise * 1.000_001, "{}", day.describe());
        println!("{} | {}", day.describe(), night.describe());
        // The scale of a spectrum does not count, and nothing depends on chance.
        let again = WavelengthDistribution::for_scene(&[(1.0, lines().scaled(1e6))], &[], RANDOM);
        assert_eq!(again.describe(), night.describe());
        assert_eq!(again.sample(0.3), night.sample(0.3));
    }

    #[test]
    fn without_light_the_eye_decides() {
        for emitters in [vec![], vec![(1.0, Spectrum::constant(0.0))], vec![(0.0, d65())]] {
            let d = WavelengthDistribution::for_scene(&emitters, &[], RANDOM);
            assert!(d.describe().starts_with("vis") && d.describe().contains("no emitter"), "{}", d.describe());
        }
    }

    #[test]
    fn fixed_wavelengths_are_always_the_same() {
        let nm = [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0];
        let d = WavelengthDistribution::fixed(nm).unwrap();
        assert_eq!(d.sample(0.9), d.sample(0.1));
        assert_eq!(d.sample(0.5).nm.to_array()[2], 500.0);
        assert!(WavelengthDistribution::fixed([300.0; 8]).unwrap_err().contains("300"));
    }
}
