//! Random numbers that are addressed, not consumed.
//!
//! Every number is a pure function of (seed, pixel, replicate, sample index, dimension), so an
//! effect that is left out shifts no other number, and any split of the work reproduces.
//!
//! Owen-scrambled Sobol points in sets of four dimensions, padded by hashed shuffles: Burley
//! 2020, "Practical Hash-based Owen Scrambling". The first four dimensions are those of Joe and
//! Kuo 2008. A set is a (0, 1)-sequence in base 2 in each of its dimensions and a (0, 2)-sequence in
//! the first two, and keeps that structure in every aligned block of 2ᵐ consecutive samples.

use glam::DVec2;
use std::cell::Cell;

/// What a set of four numbers is for. A path asks for [`Set::Camera`] and [`Set::Lens`] once and
/// for the others once a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Set {
    /// Pixel x, pixel y, wavelength, time.
    Camera,
    /// Lens x, lens y; two spare.
    Lens,
    /// At vertex `.0`: light point u, v, then direction u, v.
    Scatter(u32),
    /// At vertex `.0`: choice of light, choice of lobe, Russian roulette, free flight.
    Choice(u32),
    /// At vertex `.0`, and there at each surface that the path has gone straight through (in the upper half of `.0`): free flight
    /// beyond it, whether it goes straight on, which part of a compound it meets; one spare.
    Extra(u32),
    /// At vertex `.0`, where it sends several shadow rays: light point u, v, choice of light; one spare.
    Shadows(u32),
    /// On the way to vertex `.0`, by surfaces as [`Set::Extra`]: choice of light, distance, light point u, v.
    Along(u32),
}

impl Set {
    #[inline(always)]
    fn index(self) -> u32 {
        match self {
            Set::Camera => 0,
            Set::Lens => 1,
            Set::Scatter(vertex) => 2 + 3 * vertex,
            Set::Choice(vertex) => 3 + 3 * vertex,
            Set::Extra(vertex) => 4 + 3 * vertex,
            // Where choices are of vertices that no path has.
            Set::Shadows(vertex) => Set::Choice(FAR + vertex).index(),
            Set::Along(vertex) => Set::Extra(FAR + vertex).index(),
        }
    }
}

/// How many [`Sampler::parts`] there are.
pub const PARTS: u32 = 8;

/// More vertices than any path has.
const FAR: u32 = 1 << 29;

/// The numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler<'a> {
    /// See [`stream`].
    stream: u32,
    /// Index of the sample within its replicate.
    index: u32,
    /// Its place among those of `octet`.
    lane: u32,
    /// Sets that it shares with its neighbours.
    octet: Option<&'a Octet>,
}

/// Hash of (seed, pixel, replicate).
fn stream(seed: u64, pixel: [u32; 2], replicate: u32) -> u32 {
    let key = mix64(
        seed ^ mix64(u64::from(pixel[0]) << 32 | u64::from(pixel[1]))
            ^ u64::from(replicate).wrapping_mul(0x9e37_79b9_7f4a_7c15),
    );
    (key >> 32) as u32
}

impl Sampler<'_> {
    /// The sampler of sample `index` of `replicate` at `pixel`, for a render with `seed`.
    #[must_use]
    pub fn new(seed: u64, pixel: [u32; 2], replicate: u32, index: u32) -> Sampler<'static> {
        Sampler { stream: stream(seed, pixel, replicate), index, lane: 0, octet: None }
    }

    /// Four numbers in [0, 1): multiples of 2⁻³², so never one.
    #[must_use]
    #[inline(always)]
    pub fn set(&self, set: Set) -> [f64; 4] {
        let bits = match self.octet {
            Some(octet) if set.index() < SHARED_SETS => octet.set(set, self.lane),
            _ => points([key(self.stream, set.index())], [self.index])[0],
        };
        // Written out: `map` of an array calls a function for each element.
        [unit(bits[0]), unit(bits[1]), unit(bits[2]), unit(bits[3])]
    }

    /// The sampler of the `i`th of `count` parts of this sample: those of a replicate's first n samples are its own first n · count.
    #[must_use]
    pub fn part(&self, i: u32, count: u32) -> Sampler<'static> {
        let index = self.index.wrapping_mul(count).wrapping_add(i);
        Sampler { stream: self.stream, index, lane: 0, octet: None }
    }

    /// The numbers of `set` of `count` [`Sampler::part`]s, at most [`PARTS`]; what is beyond them means nothing.
    #[must_use]
    pub fn parts(&self, set: Set, count: u32) -> [[f64; 4]; PARTS as usize] {
        // Side by side, but not many more than are asked for.
        match count {
            ..=2 => self.first_parts::<2>(set, count),
            3..=4 => self.first_parts::<4>(set, count),
            _ => self.first_parts::<8>(set, count),
        }
    }

    fn first_parts<const N: usize>(&self, set: Set, count: u32) -> [[f64; 4]; PARTS as usize] {
        let mut indices = [self.index.wrapping_mul(count); N];
        for (index, i) in indices.iter_mut().zip(0..) {
            *index = index.wrapping_add(i);
        }
        let points = points([key(self.stream, set.index()); N], indices);
        let mut numbers = [[0.0; 4]; PARTS as usize];
        for (numbers, bits) in numbers.iter_mut().zip(points) {
            for (number, bits) in numbers.iter_mut().zip(bits) {
                *number = unit(bits);
            }
        }
        numbers
    }

    /// Tells `all` the numbers of the samples that share theirs with this one, if none of them has asked for `set` yet:
    /// time to prepare what they will need.
    #[inline]
    pub fn announce(&self, set: Set, all: impl FnOnce(&[[u32; 4]])) {
        if let Some(octet) = self.octet
            && set.index() < SHARED_SETS
            && !octet.is_made(set)
        {
            octet.make(set);
            all(&octet.sets[set.index() as usize].get()[..octet.count]);
        }
    }
}

/// Sets that an [`Octet`] keeps: those of the camera and of five vertices.
const SHARED_SETS: u32 = 17;

/// The numbers of up to eight samples. The first that asks for a set has it made for all: eight side by
/// side take little longer than one.
#[derive(Debug)]
pub struct Octet {
    /// See [`stream`].
    streams: [u32; Octet::SAMPLES],
    /// Index of each sample within its replicate.
    indices: [u32; Octet::SAMPLES],
    count: usize,
    /// Whether all are of one replicate of one pixel.
    alike: bool,
    /// One bit a set: whether it is made.
    made: Cell<u32>,
    /// The four numbers of each sample in units of 2⁻³², set by set.
    sets: [Cell<[[u32; 4]; Octet::SAMPLES]>; SHARED_SETS as usize],
}

impl Default for Octet {
    fn default() -> Octet {
        let sets = [const { Cell::new([[0; 4]; Octet::SAMPLES]) }; SHARED_SETS as usize];
        Octet { streams: [0; 8], indices: [0; 8], count: 0, alike: true, made: Cell::new(0), sets }
    }
}

impl Octet {
    /// How many samples share their sets at the most.
    pub const SAMPLES: usize = 8;

    /// Moves to `samples`, each a pixel, a replicate and an index in it, for a render with `seed`.
    ///
    /// # Panics
    /// If they are more than eight.
    pub fn reset(&mut self, seed: u64, samples: impl ExactSizeIterator<Item = ([u32; 2], u32, u32)>) {
        assert!(samples.len() <= Octet::SAMPLES, "at most eight samples");
        self.count = samples.len();
        self.made.set(0);
        self.alike = true;
        let mut last = None;
        for (lane, (pixel, replicate, index)) in samples.enumerate() {
            let of = match last {
                Some((known, stream)) if known == (pixel, replicate) => stream,
                _ => {
                    self.alike &= lane == 0;
                    stream(seed, pixel, replicate)
                }
            };
            last = Some(((pixel, replicate), of));
            (self.streams[lane], self.indices[lane]) = (of, index);
        }
    }

    /// The sampler of the sample at `lane` of those that were told: the numbers of [`Sampler::new`].
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    #[inline]
    pub fn sampler(&self, lane: usize) -> Sampler<'_> {
        assert!(lane < self.count, "one of the samples");
        // Eight side by side take as long as two or three.
        let octet = (self.count > 2).then_some(self);
        Sampler { stream: self.streams[lane], index: self.indices[lane], lane: lane as u32, octet }
    }

    #[inline(always)]
    fn set(&self, set: Set, lane: u32) -> [u32; 4] {
        if !self.is_made(set) {
            self.make(set);
        }
        let numbers = self.sets[set.index() as usize].as_array_of_cells();
        numbers[lane as usize % Octet::SAMPLES].get()
    }

    #[inline(always)]
    fn is_made(&self, set: Set) -> bool {
        self.made.get() >> set.index() & 1 == 1
    }

    #[inline(never)]
    fn make(&self, set: Set) {
        let place = set.index();
        let mut keys = [key(self.streams[0], place); Octet::SAMPLES];
        if !self.alike {
            for (key_of, stream) in keys.iter_mut().zip(self.streams) {
                *key_of = key(stream, place);
            }
        }
        self.sets[place as usize].set(points(keys, self.indices));
        self.made.set(self.made.get() | 1 << place);
    }
}

/// The fraction of the golden ratio, of which multiples are spread evenly over [0, 1).
pub const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// In [0, 1), of units of 2⁻³².
#[must_use]
#[inline(always)]
pub fn unit(x: u32) -> f64 {
    f64::from(x) * (1.0 / 4_294_967_296.0)
}

/// What the set of `index` of a stream is scrambled by.
#[inline(always)]
fn key(stream: u32, index: u32) -> u64 {
    mix64(u64::from(stream) << 32 | u64::from(index))
}

/// The points of samples in units of 2⁻³², each scrambled by its own of `keys`.
#[inline(always)]
fn points<const N: usize>(keys: [u64; N], indices: [u32; N]) -> [[u32; 4]; N] {
    // Plain loops over arrays become vectors; `map` calls a function for each element.
    let mut shuffled = indices;
    for (i, key) in shuffled.iter_mut().zip(keys) {
        *i = owen_scramble(i.reverse_bits(), key as u32).reverse_bits();
    }
    let mut points = [[0; 4]; N];
    for (point, i) in points.iter_mut().zip(shuffled) {
        *point = sobol_reversed(i);
    }
    // A key of its own for each dimension; all numbers run side by side.
    for (point, key) in points.iter_mut().zip(keys) {
        for (x, own) in point.iter_mut().zip(DIMENSION_KEYS) {
            *x = owen_scramble(*x, own ^ (key >> 32) as u32).reverse_bits();
        }
    }
    points
}

/// Independent numbers for a walk whose length nobody knows beforehand: the tentative collisions of
/// a flight through a medium. Addressed like a set, then counted: SplitMix64 (Steele et al. 2014).
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    state: u64,
}

impl Sampler<'_> {
    /// The walk that belongs to `set`; its numbers have nothing in common with those of the set.
    #[must_use]
    pub fn walk(&self, set: Set) -> Walk {
        let place = mix64(u64::from(self.stream) << 32 | u64::from(self.index));
        // The set's own key is not mixed with the index: no two arguments of the hash are alike.
        Walk { state: mix64(place ^ mix64(u64::from(set.index())).rotate_left(32)) }
    }
}

impl Walk {
    /// The next number in [0, 1): a multiple of 2⁻⁵³.
    #[inline]
    pub fn draw(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.state) >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// The next number of the exponential distribution with mean one.
    #[inline]
    pub fn exponential(&mut self) -> f64 {
        -libm::log1p(-self.draw())
    }
}

/// Tell the dimensions of a set apart: the first 32-bit words of the fractional parts of the square
/// roots of 2, 3, 5 and 7 (the initial words of SHA-256, FIPS 180-4).
const DIMENSION_KEYS: [u32; 4] = [0x6a09_e667, 0xbb67_ae85, 0x3c6e_f372, 0xa54f_f53a];

/// The first and second pair of a set.
#[must_use]
pub fn pairs(set: [f64; 4]) -> (DVec2, DVec2) {
    (DVec2::new(set[0], set[1]), DVec2::new(set[2], set[3]))
}

/// A well-mixed 64-bit hash: the finaliser of SplitMix64 (Steele et al. 2014; constants of
/// Stafford's variant 13).
#[must_use]
#[inline]
pub fn mix64(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// Number `i` of a sequence, uniform on [0, 1).
#[cfg(test)]
pub(crate) fn uniform(seed: u64, i: u64) -> f64 {
    (mix64(seed ^ mix64(i)) >> 11) as f64 / 9_007_199_254_740_992.0
}

/// Nested uniform (Owen) scramble of a bit-reversed number by the hash of Laine and Karras 2011,
/// with the constants of Burley 2020, section 3.
#[inline(always)]
fn owen_scramble(reversed: u32, key: u32) -> u32 {
    let mut x = reversed.wrapping_add(key);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x
}

/// Direction numbers of the first four Sobol dimensions (Joe and Kuo 2008, `new-joe-kuo-6`):
/// primitive polynomials x, x + 1, x² + x + 1, x³ + x + 1 with initial m = (1), (1), (1, 3),
/// (1, 3, 1); the first dimension is van der Corput's.
const fn direction_numbers() -> [[u32; 32]; 4] {
    // (degree, inner coefficients a, initial m)
    let polynomials: [(usize, u32, [u32; 3]); 3] = [(1, 0, [1, 0, 0]), (2, 1, [1, 3, 0]), (3, 1, [1, 3, 1])];
    let mut v = [[0u32; 32]; 4];
    let mut i = 0;
    while i < 32 {
        v[0][i] = 1 << (31 - i);
        i += 1;
    }
    let mut d = 0;
    while d < 3 {
        let (s, a, m) = polynomials[d];
        let mut i = 0;
        while i < 32 {
            if i < s {
                v[d + 1][i] = m[i] << (31 - i);
            } else {
                let mut x = v[d + 1][i - s] ^ (v[d + 1][i - s] >> s);
                let mut k = 1;
                while k < s {
                    if (a >> (s - 1 - k)) & 1 == 1 {
                        x ^= v[d + 1][i - k];
                    }
                    k += 1;
                }
                v[d + 1][i] = x;
            }
            i += 1;
        }
        d += 1;
    }
    v
}

/// For each byte of the index and each of its values, the bit-reversed contribution to the four
/// dimensions: a matrix product by four look-ups.
static SOBOL_BYTES: [[[u32; 4]; 256]; 4] = sobol_bytes();

const fn sobol_bytes() -> [[[u32; 4]; 256]; 4] {
    let v = direction_numbers();
    let mut table = [[[0u32; 4]; 256]; 4];
    let mut byte = 0;
    while byte < 4 {
        let mut value = 0;
        while value < 256 {
            let mut d = 0;
            while d < 4 {
                let mut x = 0;
                let mut bit = 0;
                while bit < 8 {
                    if value >> bit & 1 == 1 {
                        x ^= v[d][byte * 8 + bit];
                    }
                    bit += 1;
                }
                table[byte][value][d] = x.reverse_bits();
                d += 1;
            }
            value += 1;
        }
        byte += 1;
    }
    table
}

#[inline(always)]
fn sobol_reversed(index: u32) -> [u32; 4] {
    let [b0, b1, b2, b3] = index.to_le_bytes();
    let mut out = [0; 4];
    for (d, x) in out.iter_mut().enumerate() {
        *x = SOBOL_BYTES[0][b0 as usize][d]
            ^ SOBOL_BYTES[1][b1 as usize][d]
            ^ SOBOL_BYTES[2][b2 as usize][d]
            ^ SOBOL_BYTES[3][b3 as usize][d];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first points of the sequence as Joe and Kuo publish them (gray-code order undone).
    #[test]
    fn unscrambled_points_are_those_of_joe_and_kuo() {
        let point = |i: u32| sobol_reversed(i).map(|x| f64::from(x.reverse_bits()) / 4_294_967_296.0);
        assert_eq!(point(1), [0.5, 0.5, 0.5, 0.5]);
        assert_eq!(point(2), [0.25, 0.75, 0.75, 0.75]);
        assert_eq!(point(3), [0.75, 0.25, 0.25, 0.25]);
        assert_eq!(point(4), [0.125, 0.625, 0.375, 0.125]);
        assert_eq!(point(5), [0.625, 0.125, 0.875, 0.625]);
    }

    /// Parts of a sample are samples of as many more, so that those of the first samples are stratified together, too.
    #[test]
    fn parts_of_samples_are_samples_of_a_longer_row() {
        let set = Set::Shadows(3);
        for count in [2, 3, PARTS] {
            for index in [0, 1, 7, 1 << 20] {
                let sampler = Sampler::new(5, [17, 9], 2, index);
                let parts = sampler.parts(set, count);
                for i in 0..count {
                    let alone = Sampler::new(5, [17, 9], 2, index * count + i).set(set);
                    assert_eq!(parts[i as usize], alone);
                    assert_eq!(sampler.part(i, count).set(set), alone);
                }
            }
        }
    }

    /// Each dimension of each set puts exactly one of the first 2ᵐ samples in each of 2ᵐ strata,
    /// and pairs (0, 1) do so in every elementary box: the net property survives both scrambles.
    #[test]
    fn every_set_is_stratified_in_each_dimension_and_in_two() {
        for set in
            [Set::Camera, Set::Lens, Set::Scatter(0), Set::Choice(7), Set::Extra(40), Set::Shadows(0), Set::Along(3)]
        {
            let n = 256;
            let points: Vec<_> = (0..n).map(|i| Sampler::new(5, [17, 9], 2, i).set(set)).collect();
            for d in 0..4 {
                let mut seen = vec![false; n as usize];
                for p in &points {
                    seen[(p[d] * f64::from(n)) as usize] = true;
                }
                assert!(seen.iter().all(|&s| s), "{set:?} dimension {d}");
            }
            for log in 0..=8 {
                let (a, b) = (1u32 << log, 256u32 >> log);
                let mut seen = vec![false; n as usize];
                for p in &points {
                    seen[(p[0] * f64::from(a)) as usize * b as usize + (p[1] * f64::from(b)) as usize] = true;
                }
                assert!(seen.iter().all(|&s| s), "{set:?} boxes {a}×{b}");
            }
        }
    }

    /// Different pixels, replicates, seeds and sets give uncorrelated numbers: over n = 4096 pairs
    /// of independent uniforms the correlation has standard deviation 1/√n = 0.0156; 4.5 of
    /// them is a two-sided α of 7e-6 for each of the four pairs.
    #[test]
    fn streams_are_uncorrelated() {
        let first = |s: Sampler, set| s.set(set)[0] - 0.5;
        type Stream = fn(u32) -> (Sampler<'static>, Set);
        let variants: [(&str, Stream); 4] = [
            ("pixel", |i| (Sampler::new(1, [i + 1, 0], 0, 0), Set::Camera)),
            ("replicate", |i| (Sampler::new(1, [i, 0], 1, 0), Set::Camera)),
            ("seed", |i| (Sampler::new(2, [i, 0], 0, 0), Set::Camera)),
            ("set", |i| (Sampler::new(1, [i, 0], 0, 0), Set::Lens)),
        ];
        for (name, other) in variants {
            let n = 4096;
            let product = |i| {
                let (sampler, set) = other(i);
                first(Sampler::new(1, [i, 0], 0, 0), Set::Camera) * first(sampler, set)
            };
            let r: f64 = (0..n).map(product).sum::<f64>() * 12.0 / f64::from(n);
            assert!(r.abs() < 4.5 / f64::from(n).sqrt(), "{name}: {r}");
        }
    }

    /// Any two numbers of the first sample of a pixel, of one set or of two, are uncorrelated over 2¹⁴ pixels: Pearson's r has
    /// standard deviation 1/√n, and of the 276 pairs of 24 numbers one beyond 4.5 of them has a chance of 1.9e-3.
    #[test]
    fn dimensions_of_one_set_and_of_two_are_uncorrelated() {
        let sets = [Set::Camera, Set::Lens, Set::Scatter(0), Set::Choice(0), Set::Extra(0), Set::Shadows(0)];
        let n = 1 << 14;
        let samples: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                let sampler = Sampler::new(1, [i % 128, i / 128], 0, 0);
                sets.iter().flat_map(|set| sampler.set(*set)).map(|x| x - 0.5).collect()
            })
            .collect();
        assert_eq!(samples[0].len(), 24);
        for a in 0..24 {
            for b in 0..a {
                let r = samples.iter().map(|x| x[a] * x[b]).sum::<f64>() * 12.0 / f64::from(n);
                assert!(r.abs() < 4.5 / f64::from(n).sqrt(), "{b} and {a}: {r}");
            }
        }
    }

    /// Each dimension has a scramble of its own: the origin, where all four are alike, goes to another number in each. Which
    /// index is shuffled to 0 is found digit by digit, as each depends on those below it.
    #[test]
    fn the_origin_of_a_set_is_scrambled_to_four_numbers() {
        for i in 0..64 {
            let key = mix64(i);
            let index = (0..32).fold(0, |x, bit| x ^ owen_scramble(x, key as u32) & 1 << bit);
            assert_eq!(owen_scramble(index, key as u32), 0);
            let [numbers] = points([key], [index.reverse_bits()]);
            assert!((0..4).all(|d| !numbers[..d].contains(&numbers[d])), "{numbers:x?}");
        }
    }

    /// Steps of one walk, and the same step of walks of neighbouring sets and samples, are uncorrelated: bounds
    /// as in `streams_are_uncorrelated`. The exponential numbers have mean and variance one: over n numbers the
    /// mean has standard deviation 1/√n.
    #[test]
    fn walks_are_independent() {
        let n = 4096;
        let walk = |i: u32, vertex| Sampler::new(3, [5, 8], 1, i).walk(Set::Extra(vertex));
        type Address = fn(u32) -> (u32, u32, u32);
        let variants: [(&str, Address); 3] =
            [("step", |i| (i, 0, 1)), ("set", |i| (i, 1, 0)), ("sample", |i| (i + 1, 0, 0))];
        for (name, other) in variants {
            let product = |i| {
                let (index, vertex, skip) = other(i);
                let mut second = walk(index, vertex);
                (0..skip).for_each(|_| _ = second.draw());
                (walk(i, 0).draw() - 0.5) * (second.draw() - 0.5)
            };
            let r: f64 = (0..n).map(product).sum::<f64>() * 12.0 / f64::from(n);
            assert!(r.abs() < 4.5 / f64::from(n).sqrt(), "{name}: {r}");
        }
        let mut one = walk(0, 0);
        let mean = (0..n).map(|_| one.exponential()).sum::<f64>() / f64::from(n);
        assert!((mean - 1.0).abs() < 4.5 / f64::from(n).sqrt(), "{mean}");
    }

    /// Who asks first is told the numbers of all that share theirs; nobody is who comes later or is alone, or where
    /// numbers are not shared.
    #[test]
    fn numbers_of_neighbours_are_announced_once() {
        let mut octet = Octet::default();
        let samples: Vec<(u32, u32)> = (0..5).map(|i| (i % 2, i)).collect();
        octet.reset(7, samples.iter().map(|&(replicate, index)| ([3, 4], replicate, index)));
        let set = Set::Scatter(2);
        let mut told = Vec::new();
        octet.sampler(1).announce(set, |all| told = all.iter().map(|numbers| numbers.map(unit)).collect());
        assert_eq!(told, (0..5).map(|i| octet.sampler(i).set(set)).collect::<Vec<_>>());
        let alone = Sampler::new(7, [3, 4], 0, 0);
        for (sampler, set) in [(octet.sampler(3), set), (octet.sampler(0), Set::Scatter(50)), (alone, Set::Camera)] {
            sampler.announce(set, |_| unreachable!("{set:?}"));
        }
    }

    /// A sample has the same numbers by itself and among its neighbours, in sets that they share and beyond, whether the
    /// neighbours are of its replicate or not.
    #[test]
    fn numbers_do_not_depend_on_the_neighbours() {
        let mut octet = Octet::default();
        let row = |replicate, first: u32| (0..7).map(|i| (replicate, first + i)).collect::<Vec<_>>();
        let mixed = vec![(0, 6), (0, 7), (3, 0), (1, 0), (2, 0), (0, 8)];
        let neighbours =
            [([3, u32::MAX], row(1, 8)), ([3, 4], row(0, 3)), ([3, 4], row(3, 0xffff_fff8)), ([5, 4], mixed)];
        for (pixel, samples) in neighbours {
            octet.reset(9, samples.iter().map(|&(replicate, index)| (pixel, replicate, index)));
            for set in (0..8).flat_map(|v| [Set::Camera, Set::Lens, Set::Scatter(v), Set::Choice(v), Set::Extra(v)]) {
                for lane in [2, 0, 5] {
                    let (replicate, index) = samples[lane];
                    let alone = Sampler::new(9, pixel, replicate, index);
                    assert_eq!(octet.sampler(lane).set(set), alone.set(set), "{set:?} of {index} of {replicate}");
                }
            }
        }
    }

    #[test]
    fn the_largest_number_is_below_one() {
        assert!(unit(u32::MAX) < 1.0);
    }
}
