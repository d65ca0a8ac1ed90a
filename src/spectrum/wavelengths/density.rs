//! Densities over the band, and the intervals that follow them.

use super::{KNOTS, RANDOM, WavelengthDistribution};
use crate::spectrum::colour::ColourSpace;
use crate::spectrum::observer::matching;
use crate::spectrum::{BAND_NM, LANES, Spectrum};

/// The most by which the light of a wavelength may outweigh its interval: its density times the width of the interval over
/// the mass of it.
pub(super) const UNEVEN: f64 = 4.0;
/// The most pieces of the band: with whole numbers of intervals a piece is short of a quarter of its own at most. Of fewer points half
/// as many.
pub(super) const PIECES: usize = KNOTS / 4;

/// An interval of u: where in nm it begins, how wide it is, and the last f32 in it.
#[derive(Clone, Copy)]
pub(super) struct Interval {
    pub(super) begin: f32,
    pub(super) width: f32,
    pub(super) last: f32,
}

/// A density over the band: constant in each cell between sorted edges.
#[derive(Clone)]
pub(super) struct Density {
    /// Edges, nm, from 360 to 830.
    edges: Vec<f64>,
    /// Integral over each cell.
    mass: Vec<f64>,
    /// Sum of `mass`.
    pub(super) total: f64,
}

impl Density {
    pub(super) fn new(breakpoints: &[f64], density: impl Fn(f64) -> f64) -> Density {
        // Quarter nanometres, and where the emitters jump.
        let mut edges: Vec<f64> = (0..=1880).map(|i| 360.0 + 0.25 * f64::from(i)).collect();
        edges.extend(breakpoints.iter().copied().filter(|nm| *nm > BAND_NM[0] && *nm < BAND_NM[1]));
        edges.sort_by(f64::total_cmp);
        edges.dedup();
        let mass: Vec<f64> = edges.windows(2).map(|e| density(0.5 * (e[0] + e[1])) * (e[1] - e[0])).collect();
        let total = mass.iter().sum();
        Density { edges, mass, total }
    }

    pub(super) fn uniform() -> Density {
        Density::new(&[], |_| 1.0)
    }

    pub(super) fn visible() -> Density {
        Density::new(&[], |nm| {
            let cosh = libm::cosh(0.0072 * (nm - 538.0));
            0.003_939_804 / (cosh * cosh)
        })
    }

    /// Emission times the length of the linear Rec.709 vector of its wavelength.
    pub(super) fn of_emission(spectrum: &Spectrum) -> Density {
        Density::new(&spectrum.breakpoints(), |nm| {
            let rgb = rec709(matching(nm));
            spectrum.at(nm) * (rgb[0] * rgb[0] + rgb[1] * rgb[1] + rgb[2] * rgb[2]).sqrt()
        })
    }

    /// The density of `nm`, normalised.
    fn at(&self, nm: f64) -> f64 {
        let i = self.edges.partition_point(|e| *e <= nm).clamp(1, self.mass.len()) - 1;
        self.mass[i] / (self.edges[i + 1] - self.edges[i]) / self.total
    }

    /// The sum of normalised densities times their weights.
    pub(super) fn mixture<'a>(parts: impl IntoIterator<Item = (f64, &'a Density)>) -> Density {
        let parts: Vec<_> = parts.into_iter().collect();
        let edges: Vec<f64> = parts.iter().flat_map(|(_, d)| d.edges.iter().copied()).collect();
        Density::new(&edges, |nm| parts.iter().map(|(weight, d)| weight * d.at(nm)).sum())
    }

    /// The distribution with this density, but that each piece of the band has whole intervals.
    pub(super) fn distribution(&self, description: String) -> WavelengthDistribution {
        self.distribution_cut(description, RANDOM, &[])
    }

    /// The same with pieces that end at `jumps`, nm, each of them with whole numbers of `points`.
    pub(super) fn distribution_cut(&self, description: String, points: usize, jumps: &[f64]) -> WavelengthDistribution {
        let below: Vec<f64> = std::iter::once(0.0)
            .chain(self.mass.iter().scan(0.0, |sum, mass| {
                *sum += mass;
                Some(*sum)
            }))
            .collect();
        // Where pieces begin and end, as numbers of edges.
        let edge = |nm: &f64| self.edges.partition_point(|edge| edge < nm).min(self.mass.len());
        let mut cuts: Vec<usize> = [0, self.mass.len()].into_iter().chain(jumps.iter().map(edge)).collect();
        cuts.sort_unstable();
        cuts.dedup();
        let intervals = loop {
            let (intervals, uneven) = self.intervals(&below, &cuts, points);
            if uneven.is_empty() || cuts.len() + uneven.len() > PIECES.min(points / 2) {
                break intervals;
            }
            cuts.extend(uneven);
            cuts.sort_unstable();
        };
        WavelengthDistribution::of_intervals(&intervals, LANES, description)
    }

    /// The intervals of the pieces between `cuts`, evenly by mass in each, and where to cut those that are uneven. `below` is
    /// the mass up to each edge.
    fn intervals(&self, below: &[f64], cuts: &[usize], points: usize) -> (Vec<Interval>, Vec<usize>) {
        let shares = cuts.windows(2).map(|cut| (below[cut[1]] - below[cut[0]]) / self.total);
        let counts = whole(&shares.map(|share| share * points as f64).collect::<Vec<f64>>(), points);
        let counts = counts.into_iter().map(|count| count * (KNOTS / points));
        let (mut intervals, mut uneven) = (Vec::with_capacity(KNOTS), Vec::new());
        for (cut, count) in cuts.windows(2).zip(counts) {
            let (low, high) = (below[cut[0]], below[cut[1]]);
            // Next to a cut a wavelength is on its own side of it: an edge itself may be on either.
            let first = if cut[0] == 0 { BAND_NM[0] as f32 } else { above(self.edges[cut[0]]) };
            let last = if cut[1] == self.mass.len() { BAND_NM[1] as f32 } else { -above(-self.edges[cut[1]]) };
            let (mut cell, mut begin) = (cut[0], self.edges[cut[0]]);
            for j in 0..count {
                let start = cell;
                let wanted = low + (high - low) * (j + 1) as f64 / count as f64;
                while cell + 1 < cut[1] && below[cell + 1] < wanted {
                    cell += 1;
                }
                let share = if self.mass[cell] > 0.0 { (wanted - below[cell]) / self.mass[cell] } else { 1.0 };
                let end = match j + 1 == count {
                    true => self.edges[cut[1]],
                    false => self.edges[cell] + share.clamp(0.0, 1.0) * (self.edges[cell + 1] - self.edges[cell]),
                };
                let width = end - begin;
                intervals.push(Interval {
                    begin: if j == 0 { first } else { begin as f32 },
                    width: width as f32,
                    last: if j + 1 == count { last } else { end as f32 },
                });
                let density = |cell: usize| self.mass[cell] / (self.edges[cell + 1] - self.edges[cell]);
                let most = (start..=cell).map(density).fold(0.0, f64::max);
                if most * width * count as f64 > UNEVEN * (high - low) {
                    let jump = |edge: &usize| libm::log(density(*edge) / density(edge - 1)).abs();
                    uneven.extend((start + 1..=cell).max_by(|a, b| jump(a).total_cmp(&jump(b))));
                }
                begin = end;
            }
        }
        (intervals, uneven)
    }
}

/// Whole numbers of at least one whose sum is `total`, that of the P `wanted`; none is below w (1 − P/`total`), and the next goes
/// to the one that is shortest by ratio.
pub(super) fn whole(wanted: &[f64], total: usize) -> Vec<usize> {
    let least = 1.0 - wanted.len() as f64 / total as f64;
    let mut counts: Vec<usize> = wanted.iter().map(|w| ((w * least) as usize).max(1)).collect();
    for _ in counts.iter().sum()..total {
        let short = |i: &usize| wanted[*i] / counts[*i] as f64;
        if let Some(i) = (0..counts.len()).max_by(|a, b| short(a).total_cmp(&short(b))) {
            counts[i] += 1;
        }
    }
    counts
}

/// The smallest f32 above `x`.
fn above(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest } else { nearest.next_up() }
}

/// Linear Rec.709 of XYZ.
pub(super) fn rec709(xyz: [f64; 3]) -> [f64; 3] {
    ColourSpace::Rec709.matrix_from_xyz().map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2])
}
