//! Light from all around: an image on the sphere at infinity, sampled by its brightness.
//!
//! Equirectangular. In the frame of the map +y is up; columns to the right turn from −z toward +x.
//! Two conventions say where the texels lie, see [`Mapping`].

mod density;
mod table;

use super::bands::{self, Bands};
use super::bvh::prefetch;
use super::daylight::Daylight;
use super::texture::{Texel, spread};
use crate::math::elementary::atan2;
use crate::math::sampler::{GOLDEN, Octet};
use crate::math::trig::sin_cos_turn;
use crate::spectrum::{Carried, Lanes, Spectrum, illuminant, upsample};
use density::{Density, Table, linear};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::OnceLock;
use table::Cell;

/// Where the texels of an environment lie on the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Texel centres are at half-integers in both angles, and the middle column looks along −z, so that
    /// a map and a camera that looks along −z agree. Between centres spectra are mixed.
    Texels,
    /// As Mitsuba 3 has it: centres are at half-integers in longitude, counted from −z at the left
    /// edge; the first and the last row are the poles. Between centres the colours (sigmoid
    /// spectra) and the factors are each mixed by themselves, and then multiplied.
    Poles,
}

/// An environment map.
#[derive(Clone, Debug)]
pub struct Environment {
    texels: Vec<Texel>,
    width: usize,
    height: usize,
    mapping: Mapping,
    /// Rotation, with or without a mirror, from the map's frame to the world.
    world_from_map: DMat3,
    illuminant: Spectrum,
    mean_luminance: f64,
    /// The mean over the sphere of what is brighter than the mean, by as much as it is.
    brighter_luminance: f64,
    brighter: Table,
    /// Made when it is asked for.
    all: OnceLock<Table>,
    /// Measured spectra in place of the texels' own, which then say how bright they are.
    bands: Option<Bands>,
    /// A sky by formulas in place of the texels, which then say how bright it is without its sun.
    day: Option<Box<Daylight>>,
    /// The share of its light that is the sun's, of all and of what is brighter than the mean.
    sun_shares: [f64; 2],
    /// The factor of texels above which they [stand out](Environment::stands_out), where any does.
    peak: Option<f64>,
}

/// Texels of a sky by formulas: a degree and a half.
const DAY: [usize; 2] = [256, 128];

/// How many times as bright as the mean what [stands out](Environment::stands_out) is.
const PEAK: f64 = 64.0;

/// Which directions are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drawn {
    /// All from which light comes, by how much.
    All,
    /// Those from which more than the mean comes, by how much more: for who also finds light in a way of its own, which finds
    /// what is even as well (Karlík et al. 2019, "MIS Compensation", with one sample of either). All where the map is even.
    Brighter,
}

/// A direction toward the environment.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentSample {
    /// Unit, in the world.
    pub direction: DVec3,
    /// sr⁻¹.
    pub pdf_solid_angle: f64,
    /// Where on the map.
    at: DVec2,
}

/// A direction in the terms of the map.
#[derive(Clone, Copy)]
struct Place {
    /// Longitude in turns from the left edge of the map and colatitude in half turns.
    at: DVec2,
    /// Sine of the colatitude.
    sin_theta: f64,
}

/// Four texels around a direction and how far it is beyond the first, in columns and rows.
struct Corners<'a> {
    texels: [&'a Texel; 4],
    /// Their numbers.
    numbers: [usize; 4],
    /// Row of the first texel.
    row: usize,
    x: f64,
    y: f64,
}

impl Corners<'_> {
    fn mix(&self, f: impl Fn(&Texel) -> Lanes) -> Lanes {
        self.between(self.texels.map(f))
    }

    fn between(&self, [a, b, c, d]: [Lanes; 4]) -> Lanes {
        let (x, y) = (Lanes::splat(self.x as f32), Lanes::splat(self.y as f32));
        let row = |l: Lanes, r: Lanes| (r - l).mul_add(x, l);
        let (upper, lower) = (row(a, b), row(c, d));
        (lower - upper).mul_add(y, upper)
    }

    /// The factor above `floor`, texel by texel, in f64: a density beside a bright texel depends on the last digits of the place.
    fn scale_above(&self, floor: f64) -> f64 {
        let [a, b, c, d] = self.texels.map(|t| t.above(floor));
        let (upper, lower) = (a + (b - a) * self.x, c + (d - c) * self.x);
        // Rounding must not make light negative.
        (upper + (lower - upper) * self.y).max(0.0)
    }
}

impl Environment {
    /// A map of linear Rec. 709 `pixels`, row 0 at the top, times `scale`.
    #[must_use]
    pub fn new(
        pixels: &[[f32; 3]],
        [width, height]: [usize; 2],
        scale: f64,
        mapping: Mapping,
        world_from_map: DMat3,
        carried: Carried,
    ) -> Environment {
        // Mitsuba repeats the last row until there are three.
        let missing = if mapping == Mapping::Poles { 3usize.saturating_sub(height) } else { 0 };
        let last = &pixels[pixels.len() - width..];
        let padded = (missing > 0).then(|| [pixels, &last.repeat(missing)].concat());
        let (pixels, height) = (padded.as_deref().unwrap_or(pixels), height + missing);
        // The share of a row in the sphere, up to a factor. Between the poles it is the sine; a row that is a pole has half a
        // hat: of hats as wide as a step δ, ∫ hat sin dθ is 2 (1 − cos δ) sin θ / δ, at a pole 1 − sin δ / δ.
        let share = |y: usize| match mapping {
            Mapping::Texels => libm::sin(PI * (y as f64 + 0.5) / height as f64),
            Mapping::Poles => {
                let step = PI / (height - 1) as f64;
                match y == 0 || y == height - 1 {
                    true => 0.5 * (step - libm::sin(step)) / (1.0 - libm::cos(step)),
                    false => libm::sin(step * y as f64),
                }
            }
        };
        let texels = upsampled(pixels, scale as f32, mapping, carried);
        let illuminant = carried.light(illuminant::d65());
        // The mean over the sphere of factors above a floor.
        let mean_above = |floor: f64| {
            let (mut sum, mut weight) = (0.0, 0.0);
            for (y, row) in texels.chunks_exact(width).enumerate() {
                let share = share(y);
                sum += share * row.iter().map(|texel| texel.above(floor)).sum::<f64>();
                weight += share * width as f64;
            }
            if weight > 0.0 { sum / weight } else { 0.0 }
        };
        let mean = mean_above(0.0);
        // A map that is even to the rounding of its texels has nothing above.
        let above = mean_above(mean);
        let (floor, above) = if above > f64::from(f32::EPSILON) * mean { (mean, above) } else { (0.0, mean) };
        let brighter = Table::of(&texels, width, mapping, floor);
        // The factor is twice the largest channel; for choosing lights half of it will do.
        let [mean_luminance, brighter_luminance] = [mean, above].map(|factor| 0.5 * factor * illuminant.luminance());
        let all = OnceLock::new();
        let peak = Some(PEAK * mean).filter(|&peak| texels.iter().any(|texel| texel.above(peak) > 0.0));
        Environment {
            texels,
            width,
            height,
            mapping,
            world_from_map,
            illuminant,
            mean_luminance,
            brighter_luminance,
            brighter,
            all,
            bands: None,
            day: None,
            sun_shares: [0.0; 2],
            peak,
        }
    }

    /// A map of measured radiance, row 0 at the top, times `scale`.
    ///
    /// # Errors
    /// In words, where the bands are no radiance.
    pub fn of_bands(
        bands: Bands,
        [width, height]: [usize; 2],
        scale: f64,
        mapping: Mapping,
        world_from_map: DMat3,
    ) -> Result<Environment, String> {
        if bands.quantity != bands::Quantity::Radiance {
            return Err("expected radiance (channels S0), found reflectances (T)".into());
        }
        // Directions are chosen by the mean over the bands.
        let grey: Vec<[f32; 3]> = bands.means().into_iter().map(|x| [x; 3]).collect();
        let map = Environment::new(&grey, [width, height], scale, mapping, world_from_map, Carried::Spectra);
        Ok(Environment { bands: Some(bands.scaled(scale as f32)), ..map })
    }

    /// The light of a day, or of a disc alone. Its own frame is that of a map: +y up, and the middle column along −z.
    #[must_use]
    pub fn of_day(day: Daylight, world_from_map: DMat3) -> Environment {
        let [width, height] = if day.has_sky() { DAY } else { [2, 2] };
        let white = illuminant::d65().luminance();
        let pixel = |i: usize| [(day.sky_luminance(toward_texel(i, [width, height])) / white) as f32; 3];
        let sky: Vec<[f32; 3]> = (0..width * height).into_par_iter().map(pixel).collect();
        let map = Environment::new(&sky, [width, height], 1.0, Mapping::Texels, world_from_map, Carried::Spectra);
        let sun = day.sun_power() / (4.0 * PI);
        let luminances = [map.mean_luminance + sun, map.brighter_luminance + sun];
        Environment {
            mean_luminance: luminances[0],
            brighter_luminance: luminances[1],
            sun_shares: luminances.map(|all| if all > 0.0 { (sun / all).min(1.0) } else { 0.0 }),
            brighter: Table::of_each(&map.texels, width, map.brighter.floor),
            all: Table::of_each(&map.texels, width, 0.0).into(),
            day: Some(Box::new(day)),
            peak: None,
            ..map
        }
    }

    /// Whether what is in `direction` is so much brighter than the rest that to meet it by chance is noise: in the sun, or on a texel
    /// many times as bright as the mean.
    #[must_use]
    #[inline]
    pub fn stands_out(&self, direction: DVec3) -> bool {
        match (&self.day, self.peak) {
            (Some(day), _) => day.sun_pdf(self.world_from_map.transpose() * direction) > 0.0,
            (None, Some(peak)) => self.corners(self.place(direction).at).scale_above(peak) > 0.0,
            (None, None) => false,
        }
    }

    /// Whether anything [stands out](Environment::stands_out).
    #[must_use]
    pub fn may_stand_out(&self) -> bool {
        self.peak.is_some() || self.day.as_ref().is_some_and(|day| day.sun_power() > 0.0)
    }

    /// Toward the middle of the sun that stands in a sky by formulas, and its irradiance across that.
    #[must_use]
    pub fn sun(&self, nm: Lanes) -> Option<(DVec3, Lanes)> {
        let (direction, irradiance) = self.day.as_ref()?.sun(nm)?;
        Some((self.world_from_map * direction, irradiance))
    }

    /// Toward the middle of the sun that stands in a sky by formulas, and half of its angle in radians.
    #[must_use]
    pub fn sun_disc(&self) -> Option<(DVec3, f64)> {
        let (direction, half_angle) = self.day.as_ref()?.sun_disc()?;
        Some((self.world_from_map * direction, half_angle))
    }

    /// How many of a day's directions are drawn toward its sun.
    fn sun_share(&self, drawn: Drawn) -> f64 {
        match drawn {
            Drawn::All => self.sun_shares[0],
            Drawn::Brighter => self.sun_shares[1],
        }
    }

    /// The direction in which `other`, turned otherwise, shows what this map shows in `direction`.
    #[must_use]
    pub fn carried(&self, other: &Environment, direction: DVec3) -> DVec3 {
        other.world_from_map * (self.world_from_map.transpose() * direction)
    }

    fn place(&self, direction: DVec3) -> Place {
        let d = self.world_from_map.transpose() * direction;
        let turns = atan2(d.x, -d.z) / (2.0 * PI);
        let u = match self.mapping {
            Mapping::Texels => 0.5 + turns,
            Mapping::Poles => turns - turns.floor(),
        };
        let sin_theta = (d.x * d.x + d.z * d.z).sqrt();
        Place { at: DVec2::new(u, atan2(sin_theta, d.y) / PI), sin_theta }
    }

    fn corners(&self, at: DVec2) -> Corners<'_> {
        let (w, h) = (self.width, self.height);
        let (x, y) = (at.x * w as f64 - 0.5, self.rows(at.y));
        let (x0, y0) = (x.floor(), y.floor());
        // Columns go around, rows do not: beyond the pole lies the pole's own row. The casts, of numbers from 0 up, saturate.
        let left = if x0 < 0.0 { w - 1 } else { (x0 as i64 as usize).min(w - 1) };
        let right = if left + 1 == w { 0 } else { left + 1 };
        let upper = (y0.max(0.0) as i64 as usize).min(h - 1);
        let lower = if y0 < 0.0 { 0 } else { (upper + 1).min(h - 1) };
        let numbers = [(left, upper), (right, upper), (left, lower), (right, lower)].map(|(x, y)| y * w + x);
        Corners { texels: numbers.map(|i| &self.texels[i]), numbers, row: upper, x: x - x0, y: y - y0 }
    }

    /// Rows from the centres of the first to a colatitude in half turns.
    fn rows(&self, half_turns: f64) -> f64 {
        match self.mapping {
            Mapping::Texels => half_turns * self.height as f64 - 0.5,
            Mapping::Poles => half_turns * (self.height - 1) as f64,
        }
    }

    /// Radiance from `direction` (pointing away from the viewer).
    #[must_use]
    pub fn radiance(&self, direction: DVec3, nm: Lanes) -> Lanes {
        if let Some(day) = &self.day {
            return day.radiance(self.world_from_map.transpose() * direction, nm);
        }
        self.light(&self.corners(self.place(direction).at), nm)
    }

    /// Radiance from where `sample` points.
    #[must_use]
    pub fn radiance_of(&self, sample: &EnvironmentSample, nm: Lanes) -> Lanes {
        if self.day.is_some() {
            return self.radiance(sample.direction, nm);
        }
        self.light(&self.corners(sample.at), nm)
    }

    fn light(&self, corners: &Corners, nm: Lanes) -> Lanes {
        if let Some(bands) = &self.bands {
            // Rows beyond those of the file are its last.
            let texel =
                |i: usize| bands.eval(if i < bands.len() { i } else { bands.len() - self.width + i % self.width }, nm);
            return corners.between(corners.numbers.map(texel));
        }
        let value = match self.mapping {
            Mapping::Texels => corners.mix(|t| upsample::eval_sigmoid(t.coefficients, nm) * t.scale),
            Mapping::Poles => {
                corners.mix(|t| upsample::eval_sigmoid(t.coefficients, nm)) * corners.scale_above(0.0) as f32
            }
        };
        value * self.illuminant.eval(nm)
    }

    fn table(&self, drawn: Drawn) -> &Table {
        match drawn {
            Drawn::Brighter => &self.brighter,
            Drawn::All if self.brighter.floor == 0.0 => &self.brighter,
            Drawn::All => self.all.get_or_init(|| Table::of(&self.texels, self.width, self.mapping, 0.0)),
        }
    }

    /// A direction by brightness; `None` for a black map.
    #[must_use]
    pub fn sample(&self, u: DVec2, drawn: Drawn) -> Option<EnvironmentSample> {
        let Some(day) = &self.day else { return self.sample_texels(u, drawn) };
        let share = self.sun_share(drawn);
        if u.x >= share {
            let sample = self.sample_texels(DVec2::new((u.x - share) / (1.0 - share), u.y), drawn)?;
            let pdf_solid_angle = self.with_sun(day, sample.pdf_solid_angle, drawn, sample.direction);
            return Some(EnvironmentSample { pdf_solid_angle, ..sample });
        }
        let direction = self.world_from_map * day.sample_sun(DVec2::new(u.x / share, u.y));
        let place = self.place(direction);
        let pdf_solid_angle = self.density(&place, &self.corners(place.at), drawn, direction);
        (pdf_solid_angle > 0.0).then_some(EnvironmentSample { direction, pdf_solid_angle, at: place.at })
    }

    /// The same of the texels alone.
    fn sample_texels(&self, u: DVec2, drawn: Drawn) -> Option<EnvironmentSample> {
        let table = self.table(drawn);
        let (at, pdf, left_edge) = match &table.density {
            Density::Constant(table) => {
                let (at, pdf) = table.sample(u)?;
                (at, pdf, 0.5)
            }
            Density::Bilinear { cells, density } => {
                let cell = cells.sample_cell(u)?;
                let first = cell.row * self.width;
                let right = if cell.column + 1 == self.width { 0 } else { cell.column + 1 };
                let scale = |i: usize| self.texels[first + i].above(table.floor);
                let (a, b, c, d) =
                    (scale(cell.column), scale(right), scale(self.width + cell.column), scale(self.width + right));
                // Down the cell by the sums of its rows, then across by the values at that height.
                let y = linear(a + b, c + d, cell.within.y);
                let (left, right) = (a + (c - a) * y, b + (d - b) * y);
                let x = linear(left, right, cell.within.x);
                let (n, m) = (self.width as f64, (self.height - 1) as f64);
                // A cell is half a column to the right of its left texel's edge.
                let mut at = DVec2::new((cell.column as f64 + x + 0.5) / n, (cell.row as f64 + y) / m);
                if at.x >= 1.0 {
                    at.x -= 1.0;
                }
                (at, density[cell.row] * (left + (right - left) * x), 0.0)
            }
        };
        let (d, sin_theta) = direction_of(at, left_edge);
        let pdf_solid_angle = pdf / (2.0 * PI * PI * sin_theta);
        (sin_theta > 0.0 && pdf > 0.0).then(|| EnvironmentSample {
            direction: self.world_from_map * d,
            pdf_solid_angle,
            at,
        })
    }

    /// Whether [`Environment::foresee`] pays: 0.81 of the time of a picture at 4096 × 2048 texels, 0.87 to 0.96 at
    /// 2048 × 1024, nothing at half of that, 1.07 in a cache next to a core (`tools/bench/NOTES.md`).
    #[must_use]
    pub fn is_large(&self) -> bool {
        self.texels.len() >= 1 << 21
    }

    /// Asks for the cache lines that [`Environment::sample`] of what is brighter and [`Environment::radiance_of`] read for
    /// `us`: three places of the map, of which each tells the next. Those of several points are waited for together.
    pub fn foresee(&self, us: &[DVec2]) {
        let table = match &self.brighter.density {
            Density::Constant(table) => table,
            Density::Bilinear { cells, .. } => cells,
        };
        for Cell { row, column, within } in table.sample_cells::<{ Octet::SAMPLES }>(us).into_iter().flatten() {
            // The texels that the light is mixed of lie around the point; those of a cell of `Poles` to its right and below.
            let (upper, left) = match self.mapping {
                Mapping::Texels => (
                    if within.y < 0.5 { row.saturating_sub(1) } else { row },
                    if within.x < 0.5 { column.saturating_sub(1) } else { column },
                ),
                Mapping::Poles => (row, column),
            };
            for row in [upper, upper + 1] {
                prefetch(&self.texels, row * self.width + left);
            }
        }
    }

    /// [`Environment::radiance`] and [`Environment::pdf`] at once.
    #[must_use]
    pub fn radiance_and_pdf(&self, direction: DVec3, drawn: Drawn, nm: Lanes) -> (Lanes, f64) {
        let place = self.place(direction);
        let corners = self.corners(place.at);
        let light = if self.day.is_some() { self.radiance(direction, nm) } else { self.light(&corners, nm) };
        (light, self.density(&place, &corners, drawn, direction))
    }

    /// Density of [`Environment::sample`] at `direction`, sr⁻¹.
    #[must_use]
    pub fn pdf(&self, direction: DVec3, drawn: Drawn) -> f64 {
        let place = self.place(direction);
        self.density(&place, &self.corners(place.at), drawn, direction)
    }

    fn density(&self, place: &Place, corners: &Corners, drawn: Drawn, direction: DVec3) -> f64 {
        let of_texels = self.density_of_texels(place, corners, drawn);
        match &self.day {
            None => of_texels,
            Some(day) => self.with_sun(day, of_texels, drawn, direction),
        }
    }

    /// The density at `direction` of a day, of whose texels alone it is `of_texels`.
    fn with_sun(&self, day: &Daylight, of_texels: f64, drawn: Drawn, direction: DVec3) -> f64 {
        let share = self.sun_share(drawn);
        share * day.sun_pdf(self.world_from_map.transpose() * direction) + (1.0 - share) * of_texels
    }

    fn density_of_texels(&self, place: &Place, corners: &Corners, drawn: Drawn) -> f64 {
        if place.sin_theta <= 0.0 {
            return 0.0;
        }
        let Table { floor, density } = self.table(drawn);
        let pdf = match density {
            Density::Constant(table) => table.pdf(place.at),
            // The south pole itself belongs to the last row of cells.
            Density::Bilinear { density, .. } => {
                density[corners.row.min(density.len() - 1)] * corners.scale_above(*floor)
            }
        };
        pdf / (2.0 * PI * PI * place.sin_theta)
    }

    /// Mean luminance over the sphere of directions, film units.
    #[must_use]
    pub fn mean_luminance(&self) -> f64 {
        self.mean_luminance
    }

    /// The same of what is left above the mean, which is what [`Drawn::Brighter`] looks for.
    #[must_use]
    pub fn brighter_luminance(&self) -> f64 {
        self.brighter_luminance
    }

    /// Some of its spectra and what each gives to the mean of all directions: of 1024 directions drawn by brightness.
    #[must_use]
    pub fn shares(&self) -> Vec<(f64, Spectrum)> {
        const DRAWS: usize = 1024;
        let place = |i: usize| DVec2::new((i as f64 + 0.5) / DRAWS as f64, ((i as f64 + 0.5) * GOLDEN).fract());
        let draws = (0..DRAWS).filter_map(|i| self.sample_texels(place(i), Drawn::All));
        if let Some(day) = &self.day {
            let sky = draws.map(|sample| {
                let spectrum = day.sky_spectrum(self.world_from_map.transpose() * sample.direction);
                (1.0 / (4.0 * PI * sample.pdf_solid_angle * DRAWS as f64), spectrum)
            });
            return sky.chain(day.sun_spectrum().map(|(sun, angle)| (angle / (4.0 * PI), sun))).collect();
        }
        let share = |sample: EnvironmentSample| {
            let corners = self.corners(sample.at);
            let nearest = usize::from(corners.x > 0.5) + 2 * usize::from(corners.y > 0.5);
            let spectrum = match &self.bands {
                Some(bands) => bands.spectrum(corners.numbers[nearest].min(bands.len() - 1)),
                None => {
                    let Texel { coefficients: c, scale } = *corners.texels[nearest];
                    Spectrum::Sigmoid { c, scale }.times(&self.illuminant)
                }
            };
            (1.0 / (4.0 * PI * sample.pdf_solid_angle * DRAWS as f64), spectrum)
        };
        draws.map(share).collect()
    }

    /// Some 16 spectra of the map, for the choice of wavelengths.
    #[must_use]
    pub fn representatives(&self) -> Vec<Spectrum> {
        if let Some(bands) = &self.bands {
            return bands.representatives();
        }
        if let Some(day) = &self.day {
            let sky =
                spread(self.texels.len(), 16).map(|i| day.sky_spectrum(toward_texel(i, [self.width, self.height])));
            return sky.chain(day.sun_spectrum().map(|(sun, _)| sun)).collect();
        }
        let texels = spread(self.texels.len(), 16).map(|i| &self.texels[i]);
        texels.map(|t| Spectrum::Sigmoid { c: t.coefficients, scale: t.scale }.times(&self.illuminant)).collect()
    }
}

/// The direction in a map's frame of a place on it, in turns and half turns, and its sine to the axis; the edge at `left` looks
/// along −z.
fn direction_of(at: DVec2, left: f64) -> (DVec3, f64) {
    let (sin_theta, cos_theta) = sin_cos_turn(0.5 * at.y);
    let (sin_phi, cos_phi) = sin_cos_turn(if at.x < left { at.x + 1.0 - left } else { at.x - left });
    (DVec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi), sin_theta)
}

/// The direction in a map's frame of the middle of a texel of [`Mapping::Texels`].
fn toward_texel(i: usize, [width, height]: [usize; 2]) -> DVec3 {
    let at = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
    direction_of(at / DVec2::new(width as f64, height as f64), 0.5).0
}

/// Texels of light: a colour, and twice the greatest channel.
fn upsampled(pixels: &[[f32; 3]], scale: f32, mapping: Mapping, carried: Carried) -> Vec<Texel> {
    let texel = |&rgb: &[f32; 3]| {
        let (coefficients, s) = carried.emission_coefficients(rgb);
        // Where colours are mixed by themselves, that of black counts: it is black.
        let black = s == 0.0 && mapping == Mapping::Poles;
        Texel { coefficients: if black { upsample::coefficients([0.0; 3]) } else { coefficients }, scale: s * scale }
    };
    pixels.par_iter().with_min_len(1024).map(texel).collect()
}

#[cfg(test)]
mod tests;
