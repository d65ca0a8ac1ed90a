//! Reconstruction filters by importance sampling: a sample is drawn for one pixel.
//!
//! The position of a camera sample is drawn with density |f| about the centre of its pixel (Ernst,
//! Stamminger and Greiner 2006, "Filter Importance Sampling"); its weight is sign(f)·c with c = ∫|f| / ∫f, so the
//! mean weight is one and the mean of the samples is the filtered picture. Filters without negative
//! lobes have weight one. Tiles need no border, and errors of each pixel hold for every filter. The densities
//! tell for which other pixels a sample may count (`batch/splatting.rs`).
//!
//! All filters are separable; an axis is sampled by inverting its distribution function, in closed
//! form for box and tent, from a piecewise linear table of the density for the rest. With
//! 1024 cells on the radius r the table (`table.rs`) is off by at most max|f''|·(r/1024)²/8: of the peak 1.9e-6
//! for the Gaussian (|f''| = 1/σ², r = 4σ), and for Lanczos (|f''| = (1 + 1/r²)·π²/3, whatever r) 3.9e-6 with 3 lobes, 2.5e-5
//! with 8 and 0.026 with the 256 that are the most. The weight is that of the table, so the mean weight is one exactly.
//!
//! Where light from beyond the picture is not to count, the filter of a pixel at its edge is cut there: the same
//! inversion between the values of the distribution function at the cuts, c over what is left.

mod formula;
mod table;

pub use formula::Filter;

use super::Window;
use crate::error::{Error, Result};
use glam::DVec2;
use table::Table;
use wide::f32x8;

/// Where a camera sample lies, and what it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// From the centre of the pixel, in pixels; may reach into neighbours, yet belongs to this pixel.
    pub offset: DVec2,
    /// Factor for the radiance and alpha of the sample: one, or ±c with mean one.
    pub weight: f32,
}

/// A filter made ready for sampling.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    filter: Filter,
    axis: Axis,
    /// Upper left and lower right corner of what counts, in pixels; `None` where all does.
    within: Option<[DVec2; 2]>,
}

#[derive(Clone, Debug)]
enum Axis {
    Box,
    Tent(f64),
    Table(Table),
}

impl Axis {
    /// Where the filter lies at `u` in [0, 1), and whether it is negative there.
    fn at(&self, u: f64) -> (f64, bool) {
        match self {
            Axis::Box => (u - 0.5, false),
            Axis::Tent(radius) => (tent(u) * radius, false),
            Axis::Table(table) => table.sample(u),
        }
    }

    /// The filter at `x` from the centre, over what one whole side has of |f|.
    fn value(&self, x: f64) -> f64 {
        let x = x.abs();
        match self {
            Axis::Box => f64::from(u8::from(x <= 0.5)) * 2.0,
            Axis::Tent(radius) => (1.0 - x / radius).max(0.0) * 2.0 / radius,
            Axis::Table(table) => table.value(x),
        }
    }

    /// What lies between the centre and `x`, over what one whole side has of |f|.
    fn until(&self, x: f64) -> Portion {
        let all = |share: f64| Portion { magnitude: share, signed: share };
        let half = match self {
            Axis::Box => all((2.0 * x.abs()).min(1.0)),
            Axis::Tent(radius) => {
                let t = (x.abs() / radius).min(1.0);
                all(t * (2.0 - t))
            }
            Axis::Table(table) => table.until(x.abs()),
        };
        let side = x.signum();
        Portion { magnitude: side * half.magnitude, signed: side * half.signed }
    }

    /// What lies between `low` and `high`.
    fn between(&self, low: f64, high: f64) -> Portion {
        let (from, to) = (self.until(low), self.until(high));
        Portion { magnitude: to.magnitude - from.magnitude, signed: to.signed - from.signed }
    }

    /// The place at `u` between `low` and `high`, and what it counts there.
    fn sample_between(&self, low: f64, high: f64, u: f64) -> (f64, f64) {
        let part = self.between(low, high);
        let (x, negative) = self.at(0.5 + 0.5 * (self.until(low).magnitude + u * part.magnitude));
        let weight = part.magnitude / part.signed;
        (x.clamp(low, high), if negative { -weight } else { weight })
    }
}

/// ∫|f| and ∫f over a part of an axis.
#[derive(Clone, Copy)]
struct Portion {
    magnitude: f64,
    signed: f64,
}

impl FilterSampler {
    /// Prepares `filter`.
    ///
    /// # Errors
    /// [`Error::Config`] for a radius that is not positive and finite, or a filter whose integral is not positive.
    pub fn new(filter: Filter) -> Result<FilterSampler> {
        filter.validate()?;
        let axis = match filter {
            Filter::Box => Axis::Box,
            Filter::Tent { radius } => Axis::Tent(radius),
            Filter::Gaussian { .. } | Filter::Mitchell { .. } | Filter::CatmullRom | Filter::Lanczos { .. } => {
                Axis::Table(Table::new(&filter)?)
            }
        };
        Ok(FilterSampler { filter, axis, within: None })
    }

    /// The same, where light counts only if it falls between the corners `low` and `high` of the picture, in pixels.
    ///
    /// # Errors
    /// [`Error::Config`] for a filter of which nothing is left at an edge.
    pub fn within(mut self, low: DVec2, high: DVec2) -> Result<FilterSampler> {
        // An edge is half a pixel or more from a centre.
        if self.radius() <= 0.5 {
            return Ok(self);
        }
        if let Axis::Table(table) = &self.axis
            && table.x.iter().any(|x| *x >= 0.5 && table.until(*x).signed <= 0.0)
        {
            return Err(Error::Config(format!(
                "filter: {:?}: expected an integral of more than zero where the picture cuts it, found less",
                self.filter
            )));
        }
        self.within = Some([low, high]);
        Ok(self)
    }

    /// Whether some places are in no pixel's filter. Light that is dealt then reaches few pixels, and much of it each.
    #[must_use]
    pub fn leaves_gaps(&self) -> bool {
        self.radius() < 0.5
    }

    /// The filter that is sampled.
    #[must_use]
    pub fn filter(&self) -> Filter {
        self.filter
    }

    /// How far from the centre of a pixel, along an axis, light still counts for it, in pixels.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.filter.radius()
    }

    /// Whether no place counts against a pixel.
    #[must_use]
    pub fn is_positive(&self) -> bool {
        match &self.axis {
            Axis::Box | Axis::Tent(_) => true,
            Axis::Table(table) => !table.negative.contains(&true),
        }
    }

    /// Upper left and lower right corner of what counts, in pixels; `None` where all does.
    #[must_use]
    pub fn bounds(&self) -> Option<[DVec2; 2]> {
        self.within
    }

    /// With what densities along an axis samples lie at `x` from the centres of their pixels where nothing cuts the filter, up to a
    /// factor; of one that [`is_positive`](FilterSampler::is_positive). With 24 bits of x that is to 2⁻²⁴ of how far the filter
    /// reaches.
    #[inline]
    #[must_use]
    pub fn densities(&self, x: f32x8) -> f32x8 {
        match &self.axis {
            Axis::Box => x.abs().simd_le(f32x8::splat(0.5)).select(f32x8::ONE, f32x8::ZERO),
            Axis::Tent(radius) => (f32x8::ONE - x.abs() / f32x8::splat(*radius as f32)).max(f32x8::ZERO),
            Axis::Table(table) => table.densities(x.abs()),
        }
    }

    /// How many times as dense they lie in what counts about pixel `pixel` of an `axis`, x or y.
    #[must_use]
    pub fn gain(&self, axis: usize, pixel: i32) -> f64 {
        let (low, high) = self.edges(axis, f64::from(pixel) + 0.5);
        // Each of two sides has one.
        2.0 / self.axis.between(low, high).magnitude
    }

    /// Between what distances from `centre` along an `axis`, x or y, light counts at the most.
    fn edges(&self, axis: usize, centre: f64) -> (f64, f64) {
        match self.within {
            Some([low, high]) => (low[axis] - centre, high[axis] - centre),
            None => (-self.radius(), self.radius()),
        }
    }

    /// What light at `place` (continuous, in pixels) counts for `pixel`: its filter, whose integral over the plane is one.
    #[must_use]
    pub fn value(&self, pixel: [i32; 2], place: DVec2) -> f64 {
        self.share(0, pixel[0], place.x) * self.share(1, pixel[1], place.y)
    }

    /// The same along an `axis`, x or y.
    fn share(&self, axis: usize, pixel: i32, place: f64) -> f64 {
        let centre = f64::from(pixel) + 0.5;
        let (low, high) = self.edges(axis, centre);
        let x = place - centre;
        let counts = (low..=high).contains(&x);
        if counts { self.axis.value(x) / self.axis.between(low, high).signed } else { 0.0 }
    }

    /// Deals light that falls on `place` (continuous, in pixels) to the pixels of `window` whose filters hold it, to each what it counts
    /// there by [`FilterSampler::value`], as light does that a pixel's own samples find. So the shares of all pixels add up to one
    /// in the mean over places, and at each of them for filters whose sum is the same everywhere.
    pub fn deal(&self, place: DVec2, window: &Window, mut give: impl FnMut([i32; 2], f32)) {
        if let Axis::Box = self.axis {
            let pixel = [place.x.floor() as i32, place.y.floor() as i32];
            if window.index(pixel).is_some() {
                give(pixel, 1.0);
            }
            return;
        }
        let [columns, rows] = [(0, window.x, window.width), (1, window.y, window.height)]
            .map(|(axis, first, count)| self.shares(axis, place[axis], (first, first.saturating_add_unsigned(count))));
        for &(y, of_row) in &rows {
            for &(x, of_column) in &columns {
                give([x, y], (of_column * of_row) as f32);
            }
        }
    }

    /// The same along an `axis`, x or y: pixels from the first of a window to the one after its last, and their shares, none of
    /// which is zero.
    fn shares(&self, axis: usize, place: f64, (first, end): (i32, i32)) -> Vec<(i32, f64)> {
        // Centres of pixels lie at halves.
        let [low, high] = [(place - 0.5 - self.radius()).ceil(), (place - 0.5 + self.radius()).floor()];
        let held = (low as i32).max(first)..(high as i32).saturating_add(1).min(end);
        // Pixels beyond an edge that cuts the filter see nothing.
        let is_in_picture = |i: &i32| {
            let (from, to) = self.edges(axis, f64::from(*i) + 0.5);
            from <= 0.0 && to >= 0.0
        };
        let shares = held.filter(is_in_picture).map(|i| (i, self.share(axis, i, place)));
        shares.filter(|(_, share)| *share != 0.0).collect()
    }

    /// The sample at `u` in [0, 1)² of the pixel about `centre`, in pixels, cut where the picture ends if light from beyond it
    /// does not count.
    #[must_use]
    #[inline]
    pub fn sample_at(&self, centre: DVec2, u: DVec2) -> FilterSample {
        match self.within {
            Some([low, high]) if (centre - low).min(high - centre).min_element() < self.radius() => {
                let (x, of_x) = self.axis.sample_between(low.x - centre.x, high.x - centre.x, u.x);
                let (y, of_y) = self.axis.sample_between(low.y - centre.y, high.y - centre.y, u.y);
                FilterSample { offset: DVec2::new(x, y), weight: (of_x * of_y) as f32 }
            }
            _ => self.sample(u),
        }
    }

    /// The sample at `u` in [0, 1)². Increases with `u` along each axis, so stratified numbers stay stratified.
    #[must_use]
    #[inline(always)]
    pub fn sample(&self, u: DVec2) -> FilterSample {
        let [(x, x_negative), (y, y_negative)] = [u.x, u.y].map(|u| self.axis.at(u));
        let weight = match &self.axis {
            Axis::Box | Axis::Tent(_) => 1.0,
            Axis::Table(table) => table.weight,
        };
        FilterSample { offset: DVec2::new(x, y), weight: if x_negative == y_negative { weight } else { -weight } }
    }
}

/// Inverse distribution of the tent on [−1, 1].
fn tent(u: f64) -> f64 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 * (1.0 - u)).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTERS: [Filter; 7] = [
        Filter::Box,
        Filter::Tent { radius: 1.5 },
        Filter::Gaussian { stddev: 0.5 },
        Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 },
        Filter::CatmullRom,
        Filter::Lanczos { radius: 3.0 },
        Filter::Lanczos { radius: 2.5 },
    ];

    /// The axis alone: pair u with the centre, whose sign is positive for every filter here.
    fn axis(sampler: &FilterSampler, u: f64) -> (f64, f64) {
        let s = sampler.sample(DVec2::new(u, 0.5));
        (s.offset.x, f64::from(s.weight))
    }

    /// Densities of a row of pixels are those that samples are drawn by: the share of 2¹⁶ even numbers in each of 64 parts of the
    /// filter is the integral of the density over it, by Simpson's rule, to the two numbers at its ends and the 2e-6 of the table.
    #[test]
    fn densities_are_those_of_the_samples() {
        for filter in FILTERS.into_iter().chain([Filter::Mitchell { b: 1.0, c: 0.0 }]) {
            let sampler = FilterSampler::new(filter).unwrap();
            if !sampler.is_positive() {
                continue;
            }
            const PARTS: usize = 64;
            let (n, radius) = (65_536, filter.radius());
            let mut found = [0.0; PARTS];
            for i in 0..n {
                let x = axis(&sampler, (f64::from(i) + 0.5) / f64::from(n)).0;
                found[((x / radius + 1.0) * 0.5 * PARTS as f64) as usize] += 1.0 / f64::from(n);
            }
            let density = |x: f64| f64::from(sampler.densities(f32x8::splat(x as f32)).as_array()[3]);
            let width = 2.0 * radius / PARTS as f64;
            let of_part = |i: usize| {
                let low = width * i as f64 - radius;
                // A box ends with its last part.
                let (a, b, c) =
                    (density(low + 1e-6 * width), density(low + 0.5 * width), density(low + (1.0 - 1e-6) * width));
                (a + 4.0 * b + c) * width / 6.0
            };
            let parts: Vec<f64> = (0..PARTS).map(of_part).collect();
            let whole: f64 = parts.iter().sum();
            for (found, part) in found.into_iter().zip(parts) {
                assert!(
                    (found - part / whole).abs() < 2.0 / f64::from(n) + 4e-6,
                    "{filter:?}: {found}, {}",
                    part / whole
                );
            }
        }
    }

    /// E[weight · g(offset)] = ∫f·g / ∫f for g = cos(kx): the Fourier transform of the filter, against Simpson's rule
    /// on 4096 panels. One axis of the sampler carries c² where the other axis contributes its mean 1/c, so divide by c.
    /// Bounds: midpoint rule of 2¹⁶ points over a function of u of total variation < 4·(number of sign changes ≤ 6):
    /// 24·c²/2¹⁶ = 4e-4; table 2e-6 and f32 weight 6e-8 are below it.
    #[test]
    fn samples_reproduce_the_fourier_transform_of_the_filter() {
        for filter in FILTERS {
            let sampler = FilterSampler::new(filter).unwrap();
            let c = f64::from(sampler.sample(DVec2::splat(0.5)).weight).sqrt();
            for k in [0.0, 1.0, 2.5, 5.0f64] {
                let n = 65_536;
                let found = (0..n)
                    .map(|i| axis(&sampler, (f64::from(i) + 0.5) / f64::from(n)))
                    .map(|(x, w)| w * (k * x).cos())
                    .sum::<f64>()
                    / f64::from(n)
                    / c;
                let (mut of_f, mut of_g) = (0.0, 0.0);
                let panels = 4096;
                for i in 0..=panels {
                    let simpson = if i == 0 || i == panels { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                    let x = filter.radius() * f64::from(i) / f64::from(panels);
                    of_f += simpson * filter.eval(x);
                    of_g += simpson * filter.eval(x) * (k * x).cos();
                }
                let expected = of_g / of_f;
                assert!((found - expected).abs() < 4e-4, "{filter:?}, k = {k}: expected {expected}, found {found}");
            }
        }
    }

    #[test]
    fn filters_without_negative_lobes_have_weight_one_exactly() {
        for filter in &FILTERS[..3] {
            let sampler = FilterSampler::new(*filter).unwrap();
            for i in 0..1000 {
                let u = f64::from(i) / 1000.0;
                assert_eq!(sampler.sample(DVec2::new(u, 1.0 - 1e-9 - u * 0.5)).weight, 1.0);
            }
        }
    }

    /// Mitchell (1/3, 1/3): 6f = 7x³ − 12x² + 16/3 inside 1, −(7/3)x³ + 12x² − 20x + 32/3 outside, so that half the
    /// integral is 1/2. The outer cubic is −(7/3)(x − 2)²(x − 8/7), so the negative lobe reaches from a = 8/7 to 2; its
    /// area follows from ∫(x − a)(x − 2)² dx = (2 − a)⁴/12.
    #[test]
    fn the_weight_of_mitchell_is_its_absolute_integral() {
        let lobe = 7.0 / 18.0 * (6.0f64 / 7.0).powi(4) / 12.0;
        let c = (0.5 + 2.0 * lobe) / 0.5;
        let sampler = FilterSampler::new(Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }).unwrap();
        let weight = f64::from(sampler.sample(DVec2::splat(0.5)).weight);
        // Trapezia of width h = 2/1024 are off by at most (2·2)·h²/12·max|f''| = 5e-6 (|6f''| ≤ 24 at the centre).
        assert!((weight - c * c).abs() < 1e-5, "expected {}, found {weight}", c * c);
        let edge = FilterSampler::new(Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }).unwrap();
        for i in 0..4096 {
            let (x, w) = axis(&edge, f64::from(i) / 4096.0);
            assert_eq!(w < 0.0, x.abs() > 8.0 / 7.0, "x = {x}");
        }
    }

    /// Offsets rise with u, stay in the radius and mirror about u = 1/2, whose sample is the centre.
    #[test]
    fn offsets_are_monotone_and_symmetric() {
        for filter in FILTERS {
            let sampler = FilterSampler::new(filter).unwrap();
            let mut previous = f64::NEG_INFINITY;
            for i in 0..=8192 {
                let u = f64::from(i) / 8192.0;
                let (x, _) = axis(&sampler, u);
                assert!(x >= previous && x.abs() <= filter.radius(), "{filter:?} at {u}: {x} after {previous}");
                // Reflection of u is exact here; the tent's two branches round alike.
                assert_eq!(axis(&sampler, 1.0 - u).0, -x, "{filter:?} at {u}");
                previous = x;
            }
            assert_eq!(axis(&sampler, 0.5).0, 0.0);
        }
    }

    /// A picture of four columns, lit to the right of -1.25: each pixel of a row holds its filter's
    /// share of what is lit over its share of the picture, and light beyond the edge none. Simpson's rule on the filter
    /// itself against 65536 even numbers, whose step moves a share by less than 2^-16 of the peak weight (1.3 for the
    /// widest here), and the cells of the table, which are off by 4e-6 of the peak.
    #[test]
    fn an_edge_cuts_the_filter_and_what_is_left_counts_as_a_whole() {
        let (low, high) = (DVec2::new(-3.0, 2.0), DVec2::new(1.0, 8.0));
        for filter in FILTERS {
            let sampler = FilterSampler::new(filter).unwrap().within(low, high).unwrap();
            for i in 0..4 {
                let centre = DVec2::new(-2.5 + f64::from(i), 5.0);
                let (mut lit, mut weights) = (0.0, 0.0);
                let n = 1 << 16;
                for k in 0..n {
                    let u = DVec2::new((f64::from(k) + 0.5) / f64::from(n), 0.5);
                    let sample = sampler.sample_at(centre, u);
                    let place = centre + sample.offset;
                    assert!((low.x..=high.x).contains(&place.x), "{filter:?}: {place}");
                    weights += f64::from(sample.weight);
                    if place.x > -1.25 {
                        lit += f64::from(sample.weight);
                    }
                }
                let integral = |from: f64, to: f64| {
                    let panels = 20_000;
                    let step = (to - from) / f64::from(panels);
                    (0..panels).map(|j| filter.eval(from + (f64::from(j) + 0.5) * step - centre.x) * step).sum::<f64>()
                };
                let expected = integral(-1.25, high.x) / integral(low.x, high.x);
                assert!((lit / weights - expected).abs() < 1e-4, "{filter:?} at {i}: {} for {expected}", lit / weights);
            }
        }
        // Near a corner, too: weights are a product of one of each axis, so that their mean is that of two lines over what both have.
        for filter in FILTERS {
            let sampler = FilterSampler::new(filter).unwrap().within(low, high).unwrap();
            let weight = |x: f64, y: f64| f64::from(sampler.sample_at(DVec2::new(-2.5, 2.5), DVec2::new(x, y)).weight);
            let n = 1 << 16;
            let mean = |of: &dyn Fn(f64) -> f64| (0..n).map(|k| of((f64::from(k) + 0.5) / f64::from(n))).sum::<f64>();
            let [along, up] = [mean(&|x| weight(x, 0.5)), mean(&|y| weight(0.5, y))].map(|sum| sum / f64::from(n));
            let all = along * up / weight(0.5, 0.5);
            assert!((all - 1.0).abs() < 8e-4, "{filter:?}: {all}");
        }
        // Where no edge is near nothing changes, and filters without negative lobes count one.
        let whole = FilterSampler::new(Filter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }).unwrap();
        let far = whole.clone().within(DVec2::ZERO, DVec2::splat(100.0)).unwrap();
        let u = DVec2::new(0.013, 0.74);
        assert_eq!(far.sample_at(DVec2::splat(50.5), u), whole.sample(u));
        let bell = FilterSampler::new(Filter::Gaussian { stddev: 0.5 }).unwrap().within(low, high).unwrap();
        assert_eq!(bell.sample_at(DVec2::new(-2.5, 2.5), u).weight, 1.0);
        // Even light that is dealt to a corner makes it as bright as the rest.
        let (mut corner, steps) = (0.0, 400);
        for k in 0..steps * steps {
            let at = DVec2::new(f64::from(k % steps), f64::from(k / steps)) + 0.5;
            let place = low + 4.0 * at / f64::from(steps) - 1.0;
            bell.deal(place, &Window { x: -3, y: 2, width: 1, height: 1 }, |_, share| {
                corner += f64::from(share) * (4.0 / f64::from(steps)).powi(2);
            });
        }
        assert!((corner - 1.0).abs() < 2e-3, "{corner}");
    }

    /// What places count adds up to one over the plane, and the mean of g over samples by their weights is that by what places count, cut at
    /// edges and not, for the smooth g = 1/(1 + x²) and a step. Midpoints are off by what a jump of the filter or of g between two of them
    /// is worth, twice 1/2048 of the height of a box, or of a bell in the narrowest part of a filter of 4 pixels that an edge leaves.
    #[test]
    fn places_count_as_samples_do() {
        const STEPS: u32 = 1 << 12;
        let at = |k: u32| (f64::from(k) + 0.5) / f64::from(STEPS);
        for filter in FILTERS.into_iter().chain([Filter::Tent { radius: 0.3 }]) {
            let whole = FilterSampler::new(filter).unwrap();
            let cut = whole.clone().within(DVec2::new(-3.0, 2.0), DVec2::new(1.0, 8.0)).unwrap();
            let step = 2.0 * whole.radius() / f64::from(STEPS);
            for (sampler, x) in [whole, cut].iter().flat_map(|sampler| [-3, -2, 0].map(|x| (sampler, x))) {
                let (pixel, centre) = ([x, 4], DVec2::new(f64::from(x) + 0.5, 4.5));
                let axis = |to: DVec2| -> Vec<(DVec2, f64)> {
                    let places = (0..STEPS).map(|k| centre + to * (2.0 * at(k) - 1.0) * sampler.radius());
                    places.map(|place| (place, sampler.value(pixel, place) * step)).collect()
                };
                let sum = |of: &[(DVec2, f64)]| of.iter().map(|(_, w)| w).sum::<f64>();
                let (along, across) = (axis(DVec2::X), axis(DVec2::Y));
                let all = sum(&along) * sum(&across) / sampler.value(pixel, centre);
                assert!((all - 1.0).abs() < 2e-3, "{filter:?} {pixel:?}: {all}");
                let samples = (0..STEPS).map(|k| sampler.sample_at(centre, DVec2::new(at(k), 0.5)));
                let samples: Vec<(DVec2, f64)> = samples.map(|s| (centre + s.offset, f64::from(s.weight))).collect();
                let smooth = |place: DVec2| 1.0 / (1.0 + place.x * place.x);
                let jump = |place: DVec2| f64::from(u8::from(place.x > centre.x + 0.11));
                for g in [&smooth as &dyn Fn(DVec2) -> f64, &jump] {
                    let mean = |of: &[(DVec2, f64)]| of.iter().map(|(x, w)| w * g(*x)).sum::<f64>() / sum(of);
                    let (found, expected) = (mean(&along), mean(&samples));
                    assert!((found - expected).abs() < 2e-3, "{filter:?} {pixel:?}: {found} for {expected}");
                }
            }
        }
    }

    /// What a pixel is dealt is what the place counts for it, and the mean over places of what all pixels are dealt is one, with gaps and
    /// without; the sum of midpoints is off by the curvature, h²/24 ∫|f''| / ∫f < 1e-4 with a thousand places on a pixel for the narrowest
    /// Gaussian here.
    #[test]
    fn as_much_is_dealt_as_there_is() {
        let narrow =
            [Filter::Tent { radius: 0.25 }, Filter::Gaussian { stddev: 0.04 }, Filter::Lanczos { radius: 0.4 }];
        for filter in FILTERS.into_iter().chain(narrow) {
            let sampler = FilterSampler::new(filter).unwrap();
            assert_eq!(sampler.leaves_gaps(), narrow.contains(&filter), "{filter:?}");
            let mut sum = 0.0;
            for i in 0..1000 {
                for j in 0..1000 {
                    let place = DVec2::new(f64::from(i), f64::from(j)) / 1000.0 + 7.0005;
                    sampler.deal(place, &Window::full(20, 20), |pixel, share| {
                        sum += f64::from(share);
                        assert_eq!(share, sampler.value(pixel, place) as f32, "{filter:?} {pixel:?} {place}");
                    });
                }
            }
            assert!((sum / 1e6 - 1.0).abs() < 1e-4, "{filter:?}: {}", sum / 1e6);
        }
    }

    #[test]
    fn a_filter_without_extent_is_refused_by_name() {
        let e = FilterSampler::new(Filter::Gaussian { stddev: 0.0 }).unwrap_err().to_string();
        assert_eq!(e, "filter: gaussian.stddev: expected a positive number of pixels, found 0");
        assert!(FilterSampler::new(Filter::Lanczos { radius: f64::NAN }).is_err());
        assert!(FilterSampler::new(Filter::Mitchell { b: f64::INFINITY, c: 0.0 }).is_err());
    }
}
