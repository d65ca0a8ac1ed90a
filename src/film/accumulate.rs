//! Exact sums: a film whose bits do not depend on the order of its samples.
//!
//! A sample is rounded once to a multiple of [`QUANTUM`] and added as an integer. Integer addition is
//! associative, so tiles, threads, sample ranges and machines may come in any order.
//!
//! | | unit | one sample | samples | sum |
//! |---|---|---|---|---|
//! | X, Y, Z | 2⁻⁶⁴ | \|x\| < 2³⁸ | ≤ 2²⁵ | \|Σ\| < 2⁶³ = 2¹²⁷ units: i128 |
//! | alpha | 2⁻³⁴ | \|a\| < 2⁴ | ≤ 2²⁵ | \|Σ\| < 2²⁹ = 2⁶³ units: i64 |
//!
//! A film counts light over 2^[`Film::exponent`]: 0 but in scenes that are darker or have brighter lamps than the table
//! holds. So a sum cannot overflow. A sample is off by at most half a unit, which is nothing for
//! |x| ≥ 2⁻⁴⁰ (the last bit of its 24-bit mantissa is then a multiple of 2⁻⁶⁴). Samples beyond the
//! range, infinite or NaN are not added but counted by cause ([`InvalidCounts`]).
//!
//! Memory: a pixel takes four replicates of 64 bytes, one cache line each: 256 B a pixel,
//! 531 MB at 1920 × 1080 (i128 for XYZ 192 B, alpha 32 B, counts 32 B). A tile of 32 × 32 takes 256 KiB.

use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::layers::{LayerSums, Layout};
use crate::film::run::Run;
use crate::spectrum::Lanes;
use rayon::prelude::*;

/// Independently scrambled sample sets of each pixel; their spread is the error bar.
pub const REPLICATES: usize = 4;

/// The unit of the X, Y and Z sums.
pub const QUANTUM: f64 = 1.0 / 18_446_744_073_709_551_616.0;

/// The unit of the alpha sum.
pub const ALPHA_QUANTUM: f64 = 1.0 / 17_179_869_184.0;

/// Samples of this magnitude or more are reported as [`Invalid::Overflow`]: 2³⁸.
pub const SAMPLE_LIMIT: f32 = 274_877_906_944.0;

/// Alpha values of this magnitude or more are reported as [`Invalid::Overflow`]: 2⁴.
pub const ALPHA_LIMIT: f32 = 16.0;

/// At most this many samples fit one replicate of a pixel: 2²⁵, or 134 million samples a pixel.
/// Further ones are reported as [`Invalid::Overflow`].
pub const SAMPLES_LIMIT: u32 = 1 << 25;

/// Why a sample is not in the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Invalid {
    /// Not a number.
    Nan,
    /// Plus or minus infinity.
    Infinite,
    /// Negative spectral radiance. The film never says so (a filter may have negative lobes, a colour may lie outside
    /// the gamut); whoever computes radiance does.
    Negative,
    /// Beyond [`SAMPLE_LIMIT`], or one sample too many.
    Overflow,
}

impl Invalid {
    /// What is wrong with a radiance, if anything: a lane that light cannot have.
    #[must_use]
    #[inline]
    pub fn of(radiance: Lanes) -> Option<Invalid> {
        let light = radiance.simd_ge(Lanes::ZERO) & radiance.simd_le(Lanes::splat(f32::MAX));
        if light.all() { None } else { Some(Invalid::cause(radiance)) }
    }

    #[cold]
    fn cause(radiance: Lanes) -> Invalid {
        let lanes = radiance.to_array();
        if lanes.iter().any(|x| x.is_nan()) {
            Invalid::Nan
        } else if lanes.iter().any(|x| x.is_infinite()) {
            Invalid::Infinite
        } else {
            Invalid::Negative
        }
    }
}

/// How many samples were dropped, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct InvalidCounts {
    /// Not a number.
    pub nan: u64,
    /// Plus or minus infinity.
    pub infinite: u64,
    /// Negative spectral radiance.
    pub negative: u64,
    /// Larger than the film can hold.
    pub overflow: u64,
}

impl InvalidCounts {
    /// Counts one sample.
    pub fn record(&mut self, cause: Invalid) {
        match cause {
            Invalid::Nan => self.nan += 1,
            Invalid::Infinite => self.infinite += 1,
            Invalid::Negative => self.negative += 1,
            Invalid::Overflow => self.overflow += 1,
        }
    }

    /// Those that are no numbers, infinite, negative and too large, in this order.
    #[must_use]
    pub fn causes(&self) -> [u64; 4] {
        [self.nan, self.infinite, self.negative, self.overflow]
    }

    /// All causes together.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.causes().iter().sum()
    }
}

impl std::ops::AddAssign for InvalidCounts {
    fn add_assign(&mut self, other: InvalidCounts) {
        self.nan += other.nan;
        self.infinite += other.infinite;
        self.negative += other.negative;
        self.overflow += other.overflow;
    }
}

/// `x` in units of 2^-`FRACTION`, rounded to the nearest, ties to even; `x` is finite.
///
/// The mantissa is shifted into place: no floating-point operation, no library call. The caller
/// bounds |x| so that the result fits.
fn fixed_point<const FRACTION: i32>(x: f32) -> i128 {
    let bits = x.to_bits();
    let exponent = (bits >> 23 & 0xff) as i32;
    let fraction = bits & 0x7f_ffff;
    // x = ±mantissa · 2^(scale); subnormals share the scale of the smallest normal numbers.
    let mantissa = if exponent == 0 { fraction } else { fraction | 0x80_0000 };
    let shift = exponent.max(1) - 150 + FRACTION;
    let magnitude = if shift >= 0 {
        u128::from(mantissa) << shift
    } else if shift >= -25 {
        // Half a unit, less one if the kept part is even, rounds ties to even.
        let down = shift.unsigned_abs();
        u128::from((mantissa + ((1 << (down - 1)) - 1) + (mantissa >> down & 1)) >> down)
    } else {
        0
    } as i128;
    if bits >> 31 == 0 { magnitude } else { -magnitude }
}

/// Why `x` cannot be a sample of magnitude below `limit`.
pub(super) fn check(x: f32, limit: f32) -> std::result::Result<(), Invalid> {
    // NaN fails the comparison too.
    if x.abs() < limit {
        Ok(())
    } else if x.is_nan() {
        Err(Invalid::Nan)
    } else if x.is_infinite() {
        Err(Invalid::Infinite)
    } else {
        Err(Invalid::Overflow)
    }
}

/// An exact sum of f32 numbers; see the table above for its range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sum(pub i128);

impl Sum {
    /// Adds a number.
    ///
    /// # Errors
    /// The cause, if `x` is NaN, infinite or at least [`SAMPLE_LIMIT`] in magnitude; the sum is then unchanged.
    pub fn add(&mut self, x: f32) -> std::result::Result<(), Invalid> {
        check(x, SAMPLE_LIMIT)?;
        self.0 += fixed_point::<64>(x);
        Ok(())
    }

    /// The sum, rounded once to f64.
    #[must_use]
    #[inline]
    pub fn value(self) -> f64 {
        // Below this what is above the lowest 32 bits has 53 bits at the most.
        const FITS: i128 = 1 << 84;
        const LOW: f64 = (1u64 << 32) as f64;
        if (-FITS..FITS).contains(&self.0) {
            // Two parts that are exact, added and rounded at once.
            let (high, low) = ((self.0 >> 32) as i64, self.0 as u32);
            return (high as f64).mul_add(LOW, f64::from(low)) * QUANTUM;
        }
        // The first 64 bits, the last of which also says whether anything follows: rounded once to 53.
        let size = self.0.unsigned_abs();
        let shift = size.leading_zeros();
        let aligned = size << shift;
        let first = (aligned >> 64) as u64 | u64::from(aligned as u64 != 0);
        let value = first as f64 * f64::from_bits(u64::from(1023 + 64 - shift) << 52);
        if self.0 < 0 { -value * QUANTUM } else { value * QUANTUM }
    }
}

impl std::ops::AddAssign for Sum {
    fn add_assign(&mut self, other: Sum) {
        self.0 += other.0;
    }
}

/// What one replicate of one pixel has gathered: a cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct Cell {
    /// Sums of X, Y and Z, weighted by the filter.
    pub xyz: [Sum; 3],
    /// Sum of alpha in [`ALPHA_QUANTUM`], weighted by the filter.
    pub alpha: i64,
    /// How many samples are in the sums.
    pub count: u32,
    /// How many samples were dropped.
    pub dropped: u32,
}

const _: () = assert!(size_of::<Cell>() == 64);

impl Cell {
    /// Adds one sample, or drops it and says why.
    fn add(&mut self, xyz: [f32; 3], alpha: f32) -> std::result::Result<(), Invalid> {
        let valid = self.check(xyz, alpha);
        if valid.is_ok() {
            for (sum, x) in self.xyz.iter_mut().zip(xyz) {
                sum.0 += fixed_point::<64>(x);
            }
            self.alpha += fixed_point::<34>(alpha) as i64;
            self.count += 1;
        } else {
            self.dropped = self.dropped.saturating_add(1);
        }
        valid
    }

    fn check(&self, xyz: [f32; 3], alpha: f32) -> std::result::Result<(), Invalid> {
        for x in xyz {
            check(x, SAMPLE_LIMIT)?;
        }
        check(alpha, ALPHA_LIMIT)?;
        if self.count >= SAMPLES_LIMIT { Err(Invalid::Overflow) } else { Ok(()) }
    }

    /// Adds what another cell has gathered, or drops all of it where the samples are too many for one sum.
    fn merge(&mut self, other: &Cell, invalid: &mut InvalidCounts) {
        self.dropped = self.dropped.saturating_add(other.dropped);
        if self.count + other.count > SAMPLES_LIMIT {
            self.dropped = self.dropped.saturating_add(other.count);
            invalid.overflow += u64::from(other.count);
            return;
        }
        for (sum, &part) in self.xyz.iter_mut().zip(&other.xyz) {
            *sum += part;
        }
        self.alpha += other.alpha;
        self.count += other.count;
    }

    /// The sum of alpha, exact below 2⁵³ units and rounded once above.
    #[must_use]
    pub fn alpha_sum(&self) -> f64 {
        self.alpha as f64 * ALPHA_QUANTUM
    }
}

/// Makes `sums` `count` empty ones. The system clears memory when it is first touched, so all threads do.
pub(super) fn fill<T: Default + Send>(sums: &mut Vec<T>, count: usize) {
    (0..count).into_par_iter().map(|_| T::default()).collect_into_vec(sums);
}

/// The replicates of a pixel.
pub type PixelCells = [Cell; REPLICATES];

/// The part of the film that one work unit fills, on its own thread.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileBuffer {
    window: Window,
    cells: Vec<PixelCells>,
    /// Samples that were dropped; the renderer adds [`Invalid::Negative`] itself.
    pub invalid: InvalidCounts,
    /// Further channels.
    pub layers: LayerSums,
}

impl TileBuffer {
    /// An empty buffer for the pixels of `window`.
    #[must_use]
    pub fn new(window: Window) -> TileBuffer {
        TileBuffer {
            window,
            cells: vec![PixelCells::default(); window.pixels()],
            invalid: InvalidCounts::default(),
            layers: LayerSums::default(),
        }
    }

    /// The pixels that the buffer covers, in the full frame.
    #[must_use]
    pub fn window(&self) -> Window {
        self.window
    }

    /// The cells of the window in raster order.
    #[must_use]
    pub fn cells(&self) -> &[PixelCells] {
        &self.cells
    }

    /// Empties the buffer and moves it to `window`, keeping its memory; further channels are as `layers` says.
    pub fn reset(&mut self, window: Window, layers: Layout) {
        self.window = window;
        self.cells.clear();
        self.cells.resize(window.pixels(), PixelCells::default());
        self.invalid = InvalidCounts::default();
        self.layers.reset(layers, window.pixels());
    }

    /// Counts a sample of `replicate` of `pixel` that the renderer found invalid itself.
    ///
    /// # Panics
    /// If the pixel lies outside the window or there is no such replicate.
    pub fn drop_sample(&mut self, pixel: [i32; 2], replicate: usize, cause: Invalid) {
        let index = self.window.index(pixel).expect("the pixel lies in the tile");
        let cell = &mut self.cells[index][replicate];
        cell.dropped = cell.dropped.saturating_add(1);
        self.invalid.record(cause);
    }

    /// Adds a sample to `replicate` of `pixel` (in the full frame). `xyz` and `alpha` come multiplied by the filter
    /// weight, and `xyz` by alpha where the background is transparent (premultiplied). False where it was dropped.
    ///
    /// # Panics
    /// If the pixel lies outside the window or there is no such replicate.
    pub fn add(&mut self, pixel: [i32; 2], replicate: usize, xyz: [f32; 3], alpha: f32) -> bool {
        let index = self.window.index(pixel).expect("the pixel lies in the tile");
        let added = self.cells[index][replicate].add(xyz, alpha);
        if let Err(cause) = added {
            self.invalid.record(cause);
        }
        added.is_ok()
    }

    /// Adds the samples of a run to `replicate` of `pixel` (in the full frame).
    ///
    /// # Panics
    /// If the pixel lies outside the window or there is no such replicate.
    pub fn add_run(&mut self, pixel: [i32; 2], replicate: usize, run: &Run) {
        let index = self.window.index(pixel).expect("the pixel lies in the tile");
        self.cells[index][replicate].merge(&run.cell(), &mut self.invalid);
        self.layers.weigh(index, replicate, run.weight_units());
    }
}

/// The sums of a whole picture or of a crop of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Film {
    frame: [u32; 2],
    window: Window,
    cells: Vec<PixelCells>,
    exponent: i32,
    /// Samples that were dropped.
    pub invalid: InvalidCounts,
    /// Further channels.
    pub layers: LayerSums,
}

impl Film {
    /// An empty film for the pixels of `window` in a frame of `frame` pixels (width, height).
    ///
    /// # Errors
    /// [`Error::Config`] if the window is empty, [`Error::Memory`] if the memory cannot be had.
    pub fn new(frame: [u32; 2], window: Window) -> Result<Film> {
        if window.pixels() == 0 {
            return Err(Error::Config(format!("film: the window {window} holds no pixel")));
        }
        let mut cells = Vec::new();
        if cells.try_reserve_exact(window.pixels()).is_err() {
            let megabytes = Film::bytes(window, Layout::default()) / 1_000_000;
            return Err(Error::Memory(format!("film: {window} needs {megabytes} MB, more than there is")));
        }
        fill(&mut cells, window.pixels());
        let (invalid, layers) = (InvalidCounts::default(), LayerSums::default());
        Ok(Film { frame, window, cells, exponent: 0, invalid, layers })
    }

    /// The film, of light over 2^`exponent`: what is added to it has been divided by that.
    #[must_use]
    pub fn with_exponent(self, exponent: i32) -> Film {
        Film { exponent, ..self }
    }

    /// X, Y and Z are light over two to this power.
    #[must_use]
    pub fn exponent(&self) -> i32 {
        self.exponent
    }

    /// The film with empty layers.
    #[must_use]
    pub fn with_layers(mut self, layout: Layout) -> Film {
        self.layers = LayerSums::new(layout, self.window.pixels());
        self
    }

    /// The memory that a film of `window` with such layers takes, but for mattes.
    #[must_use]
    pub fn bytes(window: Window, layers: Layout) -> u64 {
        window.pixels() as u64 * size_of::<PixelCells>() as u64 + LayerSums::bytes(layers, window.pixels())
    }

    /// Width and height of the full frame.
    #[must_use]
    pub fn frame(&self) -> [u32; 2] {
        self.frame
    }

    /// The pixels that the film covers.
    #[must_use]
    pub fn window(&self) -> Window {
        self.window
    }

    /// The cells of the window in raster order.
    #[must_use]
    pub fn cells(&self) -> &[PixelCells] {
        &self.cells
    }

    /// The cells, for sums that were read from a file.
    pub fn cells_mut(&mut self) -> &mut [PixelCells] {
        &mut self.cells
    }

    /// Samples in the film, and samples that were dropped.
    #[must_use]
    pub fn samples(&self) -> (u64, u64) {
        let of_pixel = |cells: &PixelCells| cells.iter().map(|cell| u64::from(cell.count)).sum::<u64>();
        let counted = self.cells.par_iter().with_min_len(4096).map(of_pixel).sum();
        (counted, self.invalid.total())
    }

    /// Adds one sample, as [`TileBuffer::add`] does: for photons, which land anywhere. One that misses the window is
    /// not part of the picture and leaves no trace.
    ///
    /// # Panics
    /// If there is no such replicate.
    pub fn add(&mut self, pixel: [i32; 2], replicate: usize, xyz: [f32; 3], alpha: f32) {
        let Some(index) = self.window.index(pixel) else { return };
        if let Err(cause) = self.cells[index][replicate].add(xyz, alpha) {
            self.invalid.record(cause);
        }
    }

    /// Adds a finished tile.
    ///
    /// # Panics
    /// If the tile reaches beyond the film.
    pub fn merge_tile(&mut self, tile: &TileBuffer) {
        assert!(self.window.contains(&tile.window), "tile {} lies in the film {}", tile.window, self.window);
        self.merge_cells(tile.window, &tile.cells, tile.invalid);
        self.layers.merge(self.window, &tile.layers, tile.window);
    }

    /// Adds another film of the same frame: a crop, a range of samples, a checkpoint.
    ///
    /// # Errors
    /// [`Error::Config`] if the frames differ or the other film reaches beyond this one.
    pub fn merge(&mut self, other: &Film) -> Result<()> {
        if self.frame != other.frame {
            let [a, b, c, d] = [self.frame[0], self.frame[1], other.frame[0], other.frame[1]];
            return Err(Error::Config(format!("film: expected a part of a {a}x{b} frame, found one of {c}x{d}")));
        }
        if self.exponent != other.exponent {
            let (a, b) = (self.exponent, other.exponent);
            return Err(Error::Config(format!("film: expected a part with light over 2^{a}, found one over 2^{b}")));
        }
        if !self.window.contains(&other.window) {
            return Err(Error::Config(format!("film: the part {} reaches beyond {}", other.window, self.window)));
        }
        self.merge_cells(other.window, &other.cells, other.invalid);
        self.layers.merge(self.window, &other.layers, other.window);
        Ok(())
    }

    fn merge_cells(&mut self, window: Window, cells: &[PixelCells], invalid: InvalidCounts) {
        self.invalid += invalid;
        let width = window.width as usize;
        if width == 0 || window.height == 0 {
            return;
        }
        for (row, line) in cells.chunks_exact(width).enumerate() {
            let start = self.window.index([window.x, window.y + row as i32]).expect("the window was checked");
            for (own, part) in self.cells[start..start + width].iter_mut().zip(line) {
                for (cell, added) in own.iter_mut().zip(part) {
                    cell.merge(added, &mut self.invalid);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::mix64;
    use proptest::prelude::*;

    /// Around what has 53 bits above the lowest 32, halfway between two f64, and at the ends of the range: as the language rounds.
    #[test]
    fn a_sum_is_rounded_once() {
        let ends =
            [0, 1 << 31, (1 << 53) + 1, (1 << 84) - (1 << 30), 1 << 84, (1 << 84) + (1 << 31), 3 << 100, i128::MAX - 1];
        for x in ends.into_iter().flat_map(|x: i128| [x - 1, x, x + 1]).flat_map(|x| [x, -x]) {
            assert_eq!(Sum(x).value(), x as f64 * QUANTUM, "{x}");
        }
    }

    /// 2⁵⁵ pixels of 256 bytes are more than a process can address. Nothing is written then, as 4 would say.
    #[test]
    fn a_film_for_which_there_is_no_memory_ends_with_33() {
        let window = Window { x: 0, y: 0, width: 1 << 28, height: 1 << 27 };
        let refused = Film::new([1 << 28, 1 << 27], window).unwrap_err();
        assert_eq!(refused.exit_code(), 33, "{refused}");
    }

    /// Every power of two and its neighbours over the whole range: the fixed-point number is within half a unit of x,
    /// and equal where the last mantissa bit is a whole unit, |x| ≥ 2⁻⁴⁰.
    #[test]
    fn a_sample_is_rounded_by_at_most_half_a_unit() {
        for bits in (0..0x7f80_0000u32).step_by(0x1_0001).chain(0..4096) {
            let x = f32::from_bits(bits);
            if x >= SAMPLE_LIMIT {
                break;
            }
            for x in [x, -x] {
                let exact = f64::from(x) * 18_446_744_073_709_551_616.0;
                let found = fixed_point::<64>(x);
                if x.abs() >= 2f32.powi(-40) {
                    assert_eq!(found, exact as i128, "{x:e}");
                } else {
                    // Below 2²⁴ units every integer and half is exact in f64.
                    assert_eq!(found, exact.round_ties_even() as i128, "{x:e}");
                }
            }
        }
    }

    #[test]
    fn samples_that_cannot_be_added_are_counted_by_cause() {
        let mut tile = TileBuffer::new(Window { x: 5, y: 7, width: 1, height: 1 });
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, SAMPLE_LIMIT, -SAMPLE_LIMIT] {
            tile.add([5, 7], 1, [1.0, bad, 1.0], 1.0);
        }
        tile.add([5, 7], 1, [1.0, 1.0, 1.0], f32::NAN);
        tile.add([5, 7], 1, [SAMPLE_LIMIT.next_down(), -1.5, 0.0], 0.5);
        assert_eq!(tile.invalid, InvalidCounts { nan: 2, infinite: 2, negative: 0, overflow: 2 });
        let cell = tile.cells[0][1];
        assert_eq!((cell.count, cell.dropped), (1, 6));
        assert_eq!(cell.xyz.map(Sum::value), [f64::from(SAMPLE_LIMIT.next_down()), -1.5, 0.0]);
        assert_eq!(cell.alpha_sum(), 0.5);
    }

    /// 2²⁵ samples just below 2³⁸ sum to just below 2⁶³: the largest sum fits, one more sample is refused.
    #[test]
    fn the_largest_sum_fits_and_the_next_sample_is_refused() {
        let largest = fixed_point::<64>(SAMPLE_LIMIT.next_down());
        assert!(largest.checked_mul(i128::from(SAMPLES_LIMIT)).is_some());
        let alpha = fixed_point::<34>(ALPHA_LIMIT.next_down());
        assert!(i64::try_from(alpha * i128::from(SAMPLES_LIMIT)).is_ok());
        let mut cell = Cell { count: SAMPLES_LIMIT, ..Cell::default() };
        assert_eq!(cell.add([1.0; 3], 1.0), Err(Invalid::Overflow));
        let mut counts = InvalidCounts::default();
        cell.merge(&Cell { count: 3, ..Cell::default() }, &mut counts);
        assert_eq!((cell.count, counts.overflow, cell.dropped), (SAMPLES_LIMIT, 3, 4));
    }

    #[test]
    fn a_film_of_full_hd_takes_less_than_600_megabytes() {
        assert_eq!(Film::bytes(Window::full(1920, 1080), Layout::default()), 530_841_600);
    }

    #[test]
    fn a_part_of_another_frame_is_refused() {
        let window = Window { x: 2, y: 0, width: 2, height: 2 };
        let mut film = Film::new([4, 4], window).unwrap();
        let other = Film::new([8, 4], window).unwrap();
        assert_eq!(
            film.merge(&other).unwrap_err().to_string(),
            "film: expected a part of a 4x4 frame, found one of 8x4"
        );
        let beyond = Film::new([4, 4], Window { x: 1, y: 0, width: 2, height: 2 }).unwrap();
        assert!(film.merge(&beyond).unwrap_err().to_string().contains("reaches beyond"));
        assert!(Film::new([4, 4], Window { x: 0, y: 0, width: 0, height: 2 }).is_err());
        let dark = Film::new([4, 4], window).unwrap().with_exponent(-30);
        assert_eq!(
            film.merge(&dark).unwrap_err().to_string(),
            "film: expected a part with light over 2^0, found one over 2^-30"
        );
    }

    /// Samples of 16 × 12 pixels over 60 binary orders of magnitude, both signs, some invalid.
    fn sample(seed: u64, i: u64) -> ([i32; 2], usize, [f32; 3], f32) {
        let h = mix64(seed ^ mix64(i));
        let number = |k: u64| {
            let h = mix64(h ^ k);
            let scale = 2f32.powi((h >> 40 & 63) as i32 - 52);
            (h as i32) as f32 * scale / 2_147_483_648.0
        };
        let mut xyz = [number(1), number(2), number(3)];
        if h.is_multiple_of(97) {
            xyz[1] = f32::NAN;
        }
        ([(h >> 8 & 15) as i32, (h >> 16 & 255) as i32 % 12], (h >> 24 & 3) as usize, xyz, number(4).clamp(-2.0, 2.0))
    }

    proptest! {
        /// The same samples in one pass, and shuffled, dealt to tiles of any size, to several films by sample
        /// range, and merged in any order: identical films, bit for bit.
        #[test]
        fn the_film_does_not_depend_on_order_or_split(
            seed in any::<u64>(), n in 1..400u64, tile in 1..9u32, parts in 1..5u64,
        ) {
            let window = Window::full(16, 12);
            let mut whole = TileBuffer::new(window);
            for i in 0..n {
                let (pixel, replicate, xyz, alpha) = sample(seed, i);
                whole.add(pixel, replicate, xyz, alpha);
            }
            let mut expected = Film::new([16, 12], window).unwrap();
            expected.merge_tile(&whole);

            let mut order: Vec<u64> = (0..n).collect();
            order.sort_by_key(|&i| mix64(i ^ seed.rotate_left(17)));
            let mut films = Vec::new();
            for part in 0..parts {
                let mut film = Film::new([16, 12], window).unwrap();
                let mut tiles: Vec<TileBuffer> = Vec::new();
                for y in (0..12).step_by(tile as usize) {
                    for x in (0..16).step_by(tile as usize) {
                        let (width, height) = (tile.min(16 - x), tile.min(12 - y));
                        tiles.push(TileBuffer::new(Window { x: x as i32, y: y as i32, width, height }));
                    }
                }
                for &i in order.iter().filter(|&&i| mix64(i.wrapping_add(seed)) % parts == part) {
                    let (pixel, replicate, xyz, alpha) = sample(seed, i);
                    let tile = tiles.iter_mut().find(|t| t.window().index(pixel).is_some()).unwrap();
                    tile.add(pixel, replicate, xyz, alpha);
                }
                tiles.sort_by_key(|t| mix64(seed ^ (t.window().x as u64) << 8 ^ t.window().y as u64));
                for t in &tiles {
                    film.merge_tile(t);
                }
                films.push(film);
            }
            films.sort_by_key(|film| mix64(film.samples().0 ^ seed));
            let mut found = Film::new([16, 12], window).unwrap();
            for film in &films {
                found.merge(film).unwrap();
            }
            prop_assert_eq!(found, expected);
        }
    }
}
