//! Coefficients for texels: a guess from a small table, then Newton's method eight wavelengths at
//! a time.
//!
//! Two symmetries keep the table small. Changing the sign of the coefficients turns a reflectance s
//! into 1 − s, so a colour whose largest and smallest channel sum to more than one is solved as its
//! complement, and white is as easy as black. And a dark spectrum is 1 / 4x², so coefficients times
//! the root of the largest channel stay finite, and nearly constant, toward black.

#[cfg(test)]
use super::fit;
use super::fit::{NODES, difference, largest, solve_3x3};
use crate::spectrum::{BAND_NM, Lanes};
use std::sync::LazyLock;

/// Knots of the table along each axis.
const N: usize = 16;

/// Newton stops at this error relative to the largest channel.
const TOLERANCE: f64 = 1e-4;

/// Coefficients times √(largest channel), at `[largest][level][second][first]`: `first` and
/// `second` are the roots of the next two channels over the largest, `level` is the largest plus the
/// smallest channel. Solving them takes a tenth of a second, so they are kept in a file, which the
/// test `the_guesses_are_those_of_the_fit` holds to [`solve_guesses`].
static GUESSES: LazyLock<Vec<[f32; 3]>> = LazyLock::new(|| {
    let bytes = include_bytes!("../data/upsample_guesses.f32");
    let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    bytes.chunks_exact(12).map(|c| [number(&c[..4]), number(&c[4..8]), number(&c[8..])]).collect()
});

/// The guesses, from the exact fit.
#[cfg(test)]
fn solve_guesses() -> Vec<[f32; 3]> {
    let mut table = vec![[0.0; 3]; 3 * N * N * N];
    for largest in 0..3 {
        for j in 0..N {
            for i in 0..N {
                let ratio = |i: usize| (i as f64 / (N - 1) as f64).powi(2);
                let mut chroma = [1.0; 3];
                chroma[(largest + 1) % 3] = ratio(i);
                chroma[(largest + 2) % 3] = ratio(j);
                let smallest = ratio(i.min(j));
                // Down in brightness, each solution from the one above.
                let (mut c, mut brightness) = (fit::at_middle(chroma), fit::MIDDLE);
                for k in (0..N).rev() {
                    // Black itself has no coefficients; the limit of their product with the root has.
                    let level = if k == 0 { 1e-6 } else { k as f64 / (N - 1) as f64 };
                    let next = level / (1.0 + smallest);
                    c = fit::to_brightness(c, chroma, brightness, next);
                    brightness = next;
                    table[index(largest, k, j, i)] = c.map(|x| (x * brightness.sqrt()) as f32);
                }
            }
        }
    }
    table
}

fn index(largest: usize, level: usize, second: usize, first: usize) -> usize {
    ((largest * N + level) * N + second) * N + first
}

/// The interpolated guess for a colour whose largest and smallest channel sum to at most one.
fn guess(rgb: [f32; 3], max: f32, min: f32) -> [f32; 3] {
    let largest = if rgb[0] == max {
        0
    } else if rgb[1] == max {
        1
    } else {
        2
    };
    let cell = |v: f32| {
        let s = v * (N - 1) as f32;
        let i = (s as usize).min(N - 2);
        (i, s - i as f32)
    };
    let (i, fi) = cell((rgb[(largest + 1) % 3] / max).sqrt());
    let (j, fj) = cell((rgb[(largest + 2) % 3] / max).sqrt());
    let (k, fk) = cell(max + min);
    let mut c = [0.0; 3];
    for (dk, wk) in [(0, 1.0 - fk), (1, fk)] {
        for (dj, wj) in [(0, 1.0 - fj), (1, fj)] {
            for (di, wi) in [(0, 1.0 - fi), (1, fi)] {
                let knot = GUESSES[index(largest, k + dk, j + dj, i + di)];
                for q in 0..3 {
                    c[q] += wk * wj * wi * knot[q];
                }
            }
        }
    }
    let root = max.sqrt();
    c.map(|x| x / root)
}

/// Eight wavelengths: their t, and how much a reflectance of 1 there adds to red, green, blue.
struct Group {
    t: Lanes,
    rgb: [Lanes; 3],
}

/// The integral at 96 wavelengths 5 nm apart (the last has no weight). The weights are those of
/// the exact rule times the cubic through the four nearest wavelengths: D65 and the observer, which
/// are uneven, are integrated as they are; only the smooth reflectance is interpolated, which for
/// the sharpest colours of the gamut errs by 5e-5.
static GROUPS: LazyLock<Vec<Group>> = LazyLock::new(|| {
    const COUNT: usize = 96;
    const STEP: f64 = 5.0;
    let mut weights = [[0.0; 3]; COUNT];
    for node in NODES.iter() {
        // The cubic through the knots first … first + 3 of 0 … 94, at distance f from the first.
        let at = (node.nm - BAND_NM[0]) / STEP;
        let first = (at as usize).clamp(1, COUNT - 4) - 1;
        let f = at - first as f64;
        let lagrange = [
            -(f - 1.0) * (f - 2.0) * (f - 3.0) / 6.0,
            f * (f - 2.0) * (f - 3.0) / 2.0,
            -f * (f - 1.0) * (f - 3.0) / 2.0,
            f * (f - 1.0) * (f - 2.0) / 6.0,
        ];
        for (q, share) in lagrange.into_iter().enumerate() {
            let weights: &mut [f64; 3] = &mut weights[first + q];
            weights.iter_mut().zip(node.rgb).for_each(|(weight, rgb)| *weight += rgb * share);
        }
    }
    let lanes = |g: usize, f: &dyn Fn(usize) -> f64| Lanes::new(std::array::from_fn(|q| f(8 * g + q) as f32));
    (0..COUNT / 8)
        .map(|g| Group {
            t: lanes(g, &|i| (BAND_NM[0] + STEP * i.min(COUNT - 2) as f64 - super::CENTRE) / super::HALF),
            rgb: std::array::from_fn(|k| lanes(g, &|i| weights[i][k])),
        })
        .collect()
});

/// The colour of `c`, and its derivative by each coefficient: `.1[channel][coefficient]`.
fn colour_and_jacobian(groups: &[Group], c: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let [c0, c1, c2] = c.map(|x| Lanes::splat(x as f32));
    let (zero, half, one) = (Lanes::splat(0.0), Lanes::splat(0.5), Lanes::splat(1.0));
    let (mut sum, mut d0, mut d1, mut d2) = ([zero; 3], [zero; 3], [zero; 3], [zero; 3]);
    for group in groups {
        let t = group.t;
        let x = c0.mul_add(t, c1).mul_add(t, c2);
        let square = x.mul_add(x, one);
        let r = square.sqrt();
        // One division for both s = 1 / 2r(r + |x|) and its slope 1 / 2r³.
        let r_plus_x = r + x.abs();
        let inverse = half / (square * r * r_plus_x);
        let small = inverse * square;
        let slope = inverse * r_plus_x;
        let s = x.simd_lt(zero).select(small, one - small);
        for k in 0..3 {
            let w = group.rgb[k];
            sum[k] = w.mul_add(s, sum[k]);
            let d = w * slope;
            let dt = d * t;
            d2[k] += d;
            d1[k] += dt;
            d0[k] = dt.mul_add(t, d0[k]);
        }
    }
    let total = |v: Lanes| f64::from(v.reduce_add());
    (sum.map(total), std::array::from_fn(|k| [total(d0[k]), total(d1[k]), total(d2[k])]))
}

/// The coefficients whose colour is `rgb`, which is in [0, 1] and not all of it equal.
pub(super) fn solve(rgb: [f32; 3]) -> [f32; 3] {
    let max = rgb[0].max(rgb[1]).max(rgb[2]);
    let min = rgb[0].min(rgb[1]).min(rgb[2]);
    if max + min > 1.0 {
        let complement = rgb.map(|v| 1.0 - v);
        return newton(complement, guess(complement, 1.0 - min, 1.0 - max)).map(|x| -x);
    }
    newton(rgb, guess(rgb, max, min))
}

/// The colour of `c` alone, as [`colour_and_jacobian`] has it.
fn colour(groups: &[Group], c: [f64; 3]) -> [f64; 3] {
    let [c0, c1, c2] = c.map(|x| Lanes::splat(x as f32));
    let (zero, half, one) = (Lanes::splat(0.0), Lanes::splat(0.5), Lanes::splat(1.0));
    let mut sum = [zero; 3];
    for group in groups {
        let x = c0.mul_add(group.t, c1).mul_add(group.t, c2);
        let r = x.mul_add(x, one).sqrt();
        let small = half / (r * (r + x.abs()));
        let s = x.simd_lt(zero).select(small, one - small);
        for (sum, weight) in sum.iter_mut().zip(group.rgb) {
            *sum = weight.mul_add(s, *sum);
        }
    }
    sum.map(|v| f64::from(v.reduce_add()))
}

/// Steps along the slopes at the start before new slopes are computed: from a guess the first all but arrives, and the
/// second takes what the curvature left, at less than half the price of new slopes.
const CHORDS: u32 = 2;

/// Newton's method from `start`, which steps back when a step does not help.
fn newton(rgb: [f32; 3], start: [f32; 3]) -> [f32; 3] {
    let target = rgb.map(f64::from);
    let enough = TOLERANCE * largest(target);
    let groups = GROUPS.as_slice();
    let mut c = start.map(f64::from);
    let (mut found, mut jacobian) = colour_and_jacobian(groups, c);
    let mut error = largest(difference(target, found));
    for _ in 0..CHORDS {
        if error <= enough {
            break;
        }
        let Some(step) = solve_3x3(jacobian, difference(target, found)) else { break };
        let next: [f64; 3] = std::array::from_fn(|k| c[k] + step[k]);
        let next_found = colour(groups, next);
        let next_error = largest(difference(target, next_found));
        if next_error.is_nan() || next_error >= error {
            break;
        }
        (c, found, error) = (next, next_found, next_error);
    }
    if error <= enough {
        return c.map(|x| x as f32);
    }
    (found, jacobian) = colour_and_jacobian(groups, c);
    let mut length = 1.0;
    // Ten serve the darkest and most saturated colours.
    for _ in 0..10 {
        if error <= enough {
            break;
        }
        let Some(step) = solve_3x3(jacobian, difference(target, found)) else { break };
        let next: [f64; 3] = std::array::from_fn(|k| c[k] + length * step[k]);
        let (next_found, next_jacobian) = colour_and_jacobian(groups, next);
        let next_error = largest(difference(target, next_found));
        if next_error < error {
            (c, found, jacobian, error) = (next, next_found, next_jacobian, next_error);
            length = 1.0;
        } else {
            length *= 0.25;
        }
    }
    c.map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bit for bit where f64 has FMA; a guess needs no more than 1e-3 elsewhere.
    #[test]
    fn the_guesses_are_those_of_the_fit() {
        let solved = solve_guesses();
        assert_eq!(solved.len(), GUESSES.len());
        for (i, (a, b)) in solved.iter().zip(GUESSES.iter()).enumerate() {
            for k in 0..3 {
                assert!((a[k] - b[k]).abs() <= 1e-3 * (1.0 + a[k].abs()), "{i}: {a:?} {b:?}");
            }
        }
    }

    /// Writes the file anew: `cargo test write_guesses -- --ignored`.
    #[test]
    #[ignore = "writes into the source"]
    fn write_guesses() {
        let bytes: Vec<u8> = solve_guesses().iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/spectrum/data/upsample_guesses.f32");
        std::fs::write(path, bytes).unwrap();
    }
}
