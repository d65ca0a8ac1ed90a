//! What the noise of two pictures explains.

use super::{ChannelFigures, GLOBAL_ALPHA, NoiseSource, PIXEL_ALPHA, PixelTest, VARIANCE_FLOOR, kept};
use crate::film::exr::Samples;
use crate::math::statistics::{Moments, normal_two_sided_p, sidak, student_t_two_sided_p};
use crate::spectrum::luminance::REC709_OF_MITSUBA;
use half::f16;

/// Linear Rec.709 to XYZ with the digits that Mitsuba 3 and its references use.
const XYZ_FROM_RGB: [[f64; 3]; 3] =
    [[0.412_453, 0.357_580, 0.180_423], REC709_OF_MITSUBA, [0.019_334, 0.119_193, 0.950_227]];

/// A channel of both pictures with what is known of its noise.
pub(super) struct Pair<'a> {
    pub name: String,
    pub a: Samples<'a>,
    pub b: Samples<'a>,
    pub noise: Noise<'a>,
    /// What is known of A and of B.
    known: [Known; 2],
    /// Variances of A and of B about each pixel, where standard errors tell them.
    about: [Option<Vec<f64>>; 2],
    /// Whether the values of A and of B are half floats; one that is not is rounded to them where the other is.
    half: bool,
}

/// What a file says of its noise besides standard errors.
#[derive(Clone, Copy)]
pub(super) struct Known {
    /// How many times the variance of the sum of all pixels is that of independent ones.
    pub shared: f64,
    /// Degrees of freedom of the standard errors.
    pub dof: f64,
}

/// How many pixels to each side are looked at for the variance about one. Standard errors do not stand by themselves in the test of
/// single pixels: where light is rare all replicates may lack it, and where evenly spread samples decide whether a hole lets light
/// through all of them may count the same number. They agree then, and say nothing of how far off they are.
const AROUND: usize = 2;

pub(super) enum Noise<'a> {
    /// Standard errors of A and B, or of one of them: the other is then held to be without noise.
    Errors([Option<&'a [f32]>; 2]),
    /// Variance of a sample of A, and the samples a pixel.
    Sample(&'a [f32], f64),
    Unknown,
}

impl Noise<'_> {
    pub fn source(&self) -> NoiseSource {
        match self {
            Noise::Errors([Some(_), Some(_)]) => NoiseSource::StandardErrors,
            Noise::Errors(_) => NoiseSource::OneStandardError,
            Noise::Sample(..) => NoiseSource::SampleVariance,
            Noise::Unknown => NoiseSource::Differences,
        }
    }
}

/// The variance of the difference of a pixel.
#[derive(Clone, Copy)]
struct Variance {
    /// Of A and B.
    estimated: [f64; 2],
    /// Degrees of freedom of each.
    dof: [f64; 2],
    /// Known without estimation: the rounding to half floats, or the whole of a variance file.
    known: f64,
}

impl Variance {
    fn total(&self) -> f64 {
        self.estimated[0] + self.estimated[1] + self.known
    }

    /// Welch's degrees of freedom (Satterthwaite 1946): (Σv)² / Σ(v²/ν).
    fn dof(&self) -> f64 {
        self.total() * self.total() / self.spread()
    }

    /// Σ(v²/ν).
    fn spread(&self) -> f64 {
        self.estimated.iter().zip(self.dof).map(|(v, dof)| v * v / dof).sum()
    }
}

impl<'a> Pair<'a> {
    pub fn new(
        name: String,
        [a, b]: [Samples<'a>; 2],
        errors: [Option<&'a [f32]>; 2],
        known: [Known; 2],
        width: u32,
        variance: Option<(&'a [f32], u32)>,
    ) -> Pair<'a> {
        // Standard errors of which none is finite (one replicate) say that there is noise and not how much. Beside them those of
        // the other would have this picture exact: the differences tell the noise of both.
        let tells = |plane: &Option<&[f32]>| plane.is_none_or(|errors| errors.iter().any(|e| e.is_finite()));
        let errors = if errors.iter().all(tells) { errors } else { [None; 2] };
        let about = errors
            .map(|errors| errors.filter(|_| variance.is_none()).map(|errors| variances_about(errors, width as usize)));
        let noise = match (variance, errors) {
            (Some((plane, samples)), _) => Noise::Sample(plane, f64::from(samples)),
            (None, [None, None]) => Noise::Unknown,
            (None, errors) => Noise::Errors(errors),
        };
        let is_half = |samples| match samples {
            // Zeros are numbers of any kind: of nothing but these it is not known.
            Samples::Float(values) => {
                values.iter().any(|&v| v != 0.0) && values.iter().all(|&v| v.is_nan() || f16::from_f32(v).to_f32() == v)
            }
            Samples::Integer(_) => false,
        };
        let half = is_half(a) || is_half(b);
        Pair { name, a, b, noise, known, about, half }
    }

    pub fn is_finite(&self, i: usize) -> bool {
        self.a.at(i).is_finite() && self.b.at(i).is_finite()
    }

    pub fn is_identical(&self) -> bool {
        self.a.iter().zip(self.b.iter()).all(|(x, y)| x.to_bits() == y.to_bits())
    }

    /// A and B at a pixel. Rounded alike: where one value stands in many pixels so does what its rounding makes, which would
    /// add up as no noise does.
    fn values(&self, i: usize) -> [f64; 2] {
        [self.a.at(i), self.b.at(i)].map(|v| if self.half { to_half(v) } else { v })
    }

    fn difference(&self, i: usize) -> f64 {
        let [a, b] = self.values(i);
        a - b
    }

    /// Whether a pixel lacks the standard error by which others are judged: too few replicates.
    pub fn lacks_error(&self, i: usize) -> bool {
        self.noise.source() != NoiseSource::Differences && self.variance(i).is_none()
    }

    /// The variance of a pixel's difference, if it is known.
    fn variance(&self, i: usize) -> Option<Variance> {
        let square = |e: f32| f64::from(e) * f64::from(e);
        // A half float of exponent e was rounded to a multiple of 2^(e − 10): a uniform error of variance step²/12.
        // If both pictures were rounded alike and agree, there is no difference to explain.
        let rounding: f64 = match self.half {
            true => self.values(i).map(|v| half_step(v) * half_step(v) / 12.0).iter().sum(),
            false => 0.0,
        };
        let dof = self.known.map(|known| known.dof);
        let variance = match self.noise {
            Noise::Errors(errors) => {
                let estimated = errors.map(|plane| plane.map_or(0.0, |errors| square(errors[i])));
                Variance { estimated, dof, known: rounding }
            }
            Noise::Sample(plane, samples) => {
                let per_sample = f64::from(plane[i]).max(VARIANCE_FLOOR);
                Variance { estimated: [0.0; 2], dof, known: per_sample / samples }
            }
            Noise::Unknown => return None,
        };
        variance.total().is_finite().then_some(variance)
    }

    /// The difference of a pixel in standard errors, and their degrees of freedom.
    fn score(&self, i: usize) -> Option<(f64, f64)> {
        let mut variance = self.variance(i)?;
        for (estimated, about) in variance.estimated.iter_mut().zip(&self.about) {
            *estimated = about.as_ref().map_or(*estimated, |about| estimated.max(about[i]));
        }
        Some((score(self.difference(i), variance.total()), variance.dof()))
    }

    pub fn figures(&self, finite: &[bool], reference_mean: f64) -> ChannelFigures {
        let n = finite.iter().filter(|&&f| f).count().max(1) as f64;
        let sum_a: f64 = kept(self.a, finite).sum();
        let sum_b: f64 = kept(self.b, finite).sum();
        let black = sum_a == 0.0 && sum_b == 0.0;
        let ratio = if black { 1.0 } else { sum_a / sum_b };
        let floor = 0.01 * reference_mean * reference_mean;
        let (mut squares, mut relative, mut symmetric, mut largest) = (0.0, 0.0, 0.0, 0.0f64);
        // Of the difference: sum, variance, and Σv²/ν; of A − ratio·B: variance.
        let (mut difference, mut variance, mut spread, mut ratio_variance) = (0.0, 0.0, 0.0, 0.0);
        for i in (0..finite.len()).filter(|&i| finite[i]) {
            let (a, b) = (self.a.at(i), self.b.at(i));
            let d = a - b;
            if d != 0.0 {
                squares += d * d;
                relative += d * d / (b * b + floor);
                symmetric += d.abs() / (a.abs() + b.abs() + 0.01 * reference_mean.abs());
                largest = largest.max(d.abs());
            }
            let d = self.difference(i);
            difference += d;
            match self.variance(i) {
                // Also where a pixel has no estimate though others have.
                None => {
                    let shared = self.known[0].shared.max(self.known[1].shared);
                    variance += d * d * shared;
                    ratio_variance += (a - ratio * b) * (a - ratio * b) * shared;
                }
                Some(v) => {
                    let v = Variance { estimated: [0, 1].map(|k| v.estimated[k] * self.known[k].shared), ..v };
                    variance += v.total();
                    spread += v.spread();
                    // What is known without estimation belongs to A: a variance file, or rounding.
                    ratio_variance += v.estimated[0] + v.known + ratio * ratio * v.estimated[1];
                }
            }
        }
        let z = score(difference, variance);
        let dof = if spread > 0.0 { variance * variance / spread } else { f64::INFINITY };
        let count = |samples: Samples, is: fn(f64) -> bool| samples.iter().filter(|&v| is(v)).count();
        ChannelFigures {
            name: self.name.clone(),
            noise: self.noise.source(),
            mean_a: sum_a / n,
            mean_b: sum_b / n,
            mean_ratio: ratio,
            mean_ratio_error: if black { 0.0 } else { ratio_variance.sqrt() / sum_b.abs() },
            global_z: z,
            global_dof: dof,
            global_p: student_t_two_sided_p(z, dof),
            rmse: (squares / n).sqrt(),
            rel_mse: relative / n,
            smape: symmetric / n,
            max_difference: largest,
            nan_a: count(self.a, f64::is_nan),
            infinite_a: count(self.a, f64::is_infinite),
            nan_b: count(self.b, f64::is_nan),
            infinite_b: count(self.b, f64::is_infinite),
        }
    }
}

/// The mean of the squares of those `errors` that are finite in the square of pixels about each.
fn variances_about(errors: &[f32], width: usize) -> Vec<f64> {
    let width = width.max(1);
    // The sum of `terms` that lie `stride` apart, about each of them, as far as a line of `length` goes.
    let about = |terms: &[[f64; 2]], stride: usize, length: usize| -> Vec<[f64; 2]> {
        let sum = |i: usize| {
            let at = i / stride % length;
            let near = at.saturating_sub(AROUND)..(at + AROUND + 1).min(length);
            near.map(|k| terms[i - at * stride + k * stride]).fold([0.0; 2], |[a, b], [x, n]| [a + x, b + n])
        };
        (0..terms.len()).map(sum).collect()
    };
    let term = |e: &f32| if e.is_finite() { [f64::from(*e) * f64::from(*e), 1.0] } else { [0.0; 2] };
    let terms: Vec<[f64; 2]> = errors.iter().map(term).collect();
    let sums = about(&about(&terms, 1, width), width, errors.len() / width);
    sums.into_iter().map(|[sum, count]| if count > 0.0 { sum / count } else { 0.0 }).collect()
}

/// `difference` / √`variance`; no difference is no deviation even where there is no noise.
fn score(difference: f64, variance: f64) -> f64 {
    if difference == 0.0 { 0.0 } else { difference / variance.sqrt() }
}

/// `v` as the half float that is next to it; itself where it is too large for any.
fn to_half(v: f64) -> f64 {
    match f16::from_f64(v) {
        half if half.is_finite() => half.to_f64(),
        _ => v,
    }
}

/// The distance of half floats at `v`: 2^(e − 10), 2⁻²⁴ for subnormals.
fn half_step(v: f64) -> f64 {
    let exponent = (v.to_bits() >> 52 & 0x7ff) as i32 - 1023;
    libm::ldexp(1.0, exponent.max(-14) - 10)
}

/// Mitsuba's test over all pixels, where variances are known.
///
/// With a variance file the scores are those of Mitsuba: in XYZ if the channels are R, G, B, the variances taken through
/// the same matrix (they are stored so), clamped at [`VARIANCE_FLOOR`]. With standard errors they are Welch's t of
/// each channel, whose tails with 3 + 3 degrees of freedom are long: a single pixel must be far off.
pub(super) fn pixel_test(pairs: &[Pair], finite: &[bool]) -> Option<PixelTest> {
    let pixels = finite.iter().filter(|&&f| f).count();
    let alpha = sidak(PIXEL_ALPHA, pixels);
    let (mut tested, mut accepted, mut rejected) = (0usize, 0usize, 0usize);
    let mut scores = Moments::default();
    for i in (0..finite.len()).filter(|&i| finite[i]) {
        let mut pixel_fails = false;
        let mut judge = |score: f64, dof: f64| {
            // Student's tail is the longer one, so what the normal accepts needs no beta function.
            let p = normal_two_sided_p(score);
            let p = if p > alpha || dof.is_infinite() || dof.is_nan() { p } else { student_t_two_sided_p(score, dof) };
            tested += 1;
            accepted += usize::from(p > alpha);
            pixel_fails |= p <= alpha;
            if score.is_finite() {
                scores.push(score);
            }
        };
        match xyz_scores(pairs, i) {
            Some(xyz) => xyz.into_iter().for_each(|score| judge(score, f64::INFINITY)),
            None => pairs.iter().filter_map(|pair| pair.score(i)).for_each(|(score, dof)| judge(score, dof)),
        }
        rejected += usize::from(pixel_fails);
    }
    (tested > 0).then(|| PixelTest {
        alpha,
        accepted: accepted as f64 / tested as f64,
        pixels_rejected: rejected,
        // One is no pattern: the tails of four replicates are longer than Student's.
        pixels_allowed: by_chance(pixels, alpha * pairs.len() as f64).max(1),
        score_mean: scores.mean,
        score_deviation: scores.variance().sqrt(),
    })
}

/// How many of `count` things that come with probability `p` are exceeded with a probability of [`GLOBAL_ALPHA`] at the most.
fn by_chance(count: usize, p: f64) -> usize {
    if p >= 1.0 {
        return count;
    }
    let n = count as f64;
    // Of the binomial distribution, from nothing on.
    let mut exactly = libm::exp(n * libm::log1p(-p));
    let mut more = 1.0 - exactly;
    let mut k = 0;
    while more > GLOBAL_ALPHA && k < count {
        exactly *= (n - k as f64) / (k + 1) as f64 * p / (1.0 - p);
        more -= exactly;
        k += 1;
    }
    k
}

/// The scores of Mitsuba's test at a pixel, if there are R, G, B and a variance file.
fn xyz_scores(pairs: &[Pair], i: usize) -> Option<[f64; 3]> {
    let [r, g, b] = pairs else { return None };
    if [&r.name, &g.name, &b.name] != ["R", "G", "B"] {
        return None;
    }
    let (Noise::Sample(vr, samples), Noise::Sample(vg, _), Noise::Sample(vb, _)) = (&r.noise, &g.noise, &b.noise)
    else {
        return None;
    };
    let difference = [r.difference(i), g.difference(i), b.difference(i)];
    let variance = [vr[i], vg[i], vb[i]].map(f64::from);
    let dot = |row: [f64; 3], v: [f64; 3]| row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
    Some(XYZ_FROM_RGB.map(|row| score(dot(row, difference), dot(row, variance).max(VARIANCE_FLOOR) / samples)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of seven pixels: 0, 1 and 4 about the first, 1, 4, 16 and 25 about the one in the middle, which is not known. Of seven such
    /// rows one under the other as much stands about the middle of each of five.
    #[test]
    fn errors_about_a_pixel_are_the_mean_of_the_squares_that_are_known() {
        let row = [0.0, 1.0, 2.0, f32::NAN, 4.0, 5.0, 6.0];
        for rows in [1, 7] {
            let found = variances_about(&row.repeat(rows), 7);
            let middle = &found[rows / 2 * 7..][..7];
            assert_eq!([middle[0], middle[3], middle[6]], [5.0 / 3.0, 46.0 / 4.0, 77.0 / 3.0]);
        }
        assert_eq!(variances_about(&[f32::INFINITY], 1), [0.0]);
    }

    /// Half floats from 1 to 2 are 2⁻¹⁰ apart: each of two pictures is off by an even error, of a twelfth of the square of that, besides
    /// what its standard errors say. Where neither was rounded nothing is added.
    #[test]
    fn rounding_to_half_floats_is_noise_of_its_own() {
        let known = [Known { shared: 1.0, dof: 3.0 }; 2];
        let errors = [Some(&[0.25f32; 2][..]); 2];
        for (values, expected) in [([1.0f32, 1.5], 2.0 * 0.5f64.powi(20) / 12.0), ([1.1, 1.3], 0.0)] {
            let pair = Pair::new("Y".into(), [Samples::Float(&values); 2], errors, known, 2, None);
            let found = pair.variance(1).unwrap();
            assert_eq!((found.estimated, found.known), ([0.0625; 2], expected));
        }
        // Black is no half float for being black.
        let (black, dark) = ([0.0f32; 2], [1e-9f32; 2]);
        let pair = Pair::new("Y".into(), [Samples::Float(&black), Samples::Float(&dark)], errors, known, 2, None);
        assert_eq!(pair.difference(0), -f64::from(dark[0]));
    }

    /// Halves near 1 are 2⁻¹⁰ apart, near 65504 they are 32 apart, and subnormals 2⁻²⁴.
    #[test]
    fn the_step_of_half_floats_is_the_distance_to_the_next() {
        for bits in (0..0x7bffu16).step_by(37) {
            let (v, next) = (f16::from_bits(bits).to_f64(), f16::from_bits(bits + 1).to_f64());
            assert_eq!(half_step(v), next - v, "{v}");
        }
    }

    /// Of 64 things of ½ more than 44 come in 7.8e-4 of all cases, more than 43 in 1.8e-3; of a Poisson number of mean 0.3 more than 3 in 2.7e-4, more than
    /// 2 in 3.6e-3.
    #[test]
    fn what_comes_by_chance_is_the_quantile_of_the_binomial() {
        assert_eq!((by_chance(64, 0.5), by_chance(1_000_000, 3e-7)), (44, 3));
        assert_eq!((by_chance(64, 0.0), by_chance(5, 1.5), by_chance(0, 0.5)), (0, 5, 0));
    }

    /// Welch: equal variances give ν₁ + ν₂ = 6, one vanishing gives 3, known variance adds certainty.
    #[test]
    fn welch_degrees_of_freedom_at_their_limits() {
        let dof = |a, b, known| Variance { estimated: [a, b], dof: [3.0; 2], known }.dof();
        assert_eq!((dof(2.0, 2.0, 0.0), dof(2.0, 0.0, 0.0), dof(1.0, 0.0, 1.0)), (6.0, 3.0, 12.0));
        assert!(dof(0.0, 0.0, 1.0).is_infinite());
        assert_eq!(Variance { estimated: [2.0, 2.0], dof: [1.0, 2.0], known: 0.0 }.dof(), 16.0 / (4.0 + 2.0));
    }
}
