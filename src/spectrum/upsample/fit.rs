//! Solves for the coefficients of a smooth colour.
//!
//! Three unknowns, three equations: Newton's method in f64, led by continuation. From the flat
//! spectrum of a middle grey, where the solution is known, the colour moves first to the wanted
//! chromaticity, then to the wanted brightness, in steps that are halved when Newton fails and
//! doubled when it does not.

use super::inverse_sigmoid;
use crate::spectrum::colour::ColourSpace;
use crate::spectrum::{illuminant, observer};
use std::sync::LazyLock;
use wide::f64x4;

/// A wavelength, the same as t in [−1, 1], and how much a reflectance of 1 there adds to red,
/// green, blue.
pub(super) struct Node {
    pub nm: f64,
    pub t: f64,
    pub rgb: [f64; 3],
}

/// The nodes of [`observer::quadrature`]; a flat reflectance of 1 sums to (1, 1, 1).
pub(super) static NODES: LazyLock<Vec<Node>> = LazyLock::new(|| {
    let d65 = illuminant::d65();
    let matrix = ColourSpace::Rec709.matrix_from_xyz();
    let mut nodes: Vec<Node> = observer::quadrature(&[])
        .into_iter()
        .map(|(nm, width)| {
            let weight = width * d65.at(nm);
            let bar = observer::matching(nm);
            let rgb = std::array::from_fn(|c| weight * (0..3).map(|k| matrix[c][k] * bar[k]).sum::<f64>());
            Node { nm, t: (nm - super::CENTRE) / super::HALF, rgb }
        })
        .collect();
    for c in 0..3 {
        let sum: f64 = nodes.iter().map(|n| n.rgb[c]).sum();
        nodes.iter_mut().for_each(|n| n.rgb[c] /= sum);
    }
    nodes
});

/// The colour of `c`, and its derivative by each coefficient: `.1[channel][coefficient]`.
fn colour_and_jacobian(c: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut rgb = [0.0; 3];
    let mut jacobian = [[0.0; 3]; 3];
    let [c0, c1, c2] = c.map(f64x4::splat);
    for nodes in NODES.chunks(4) {
        // Roots and quotients of four side by side; they are added in turn.
        let t = f64x4::new(std::array::from_fn(|i| nodes.get(i).map_or(0.0, |node| node.t)));
        let x = (c0 * t + c1) * t + c2;
        let square = f64x4::ONE + x * x;
        let r = square.sqrt();
        let small = f64x4::HALF / (r * (r + x.abs()));
        let s = x.simd_lt(f64x4::ZERO).select(small, f64x4::ONE - small).to_array();
        let slope = (f64x4::HALF / (square * r)).to_array();
        for ((node, s), slope) in nodes.iter().zip(s).zip(slope) {
            for k in 0..3 {
                let w = node.rgb[k];
                rgb[k] += w * s;
                let d = w * slope;
                jacobian[k][0] += d * node.t * node.t;
                jacobian[k][1] += d * node.t;
                jacobian[k][2] += d;
            }
        }
    }
    (rgb, jacobian)
}

pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn largest(v: [f64; 3]) -> f64 {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

/// The solution of `m` x = `b` by Cramer's rule; None if `m` is singular.
pub(super) fn solve_3x3(m: [[f64; 3]; 3], b: [f64; 3]) -> Option<[f64; 3]> {
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let column = |i: usize| [m[0][i], m[1][i], m[2][i]];
    let (p, q, r) = (column(0), column(1), column(2));
    let determinant = dot(p, cross(q, r));
    let x = [dot(b, cross(q, r)), dot(p, cross(b, r)), dot(p, cross(q, b))].map(|v| v / determinant);
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// Newton's method from `start`; None if it does not come within `tolerance` of `target`.
fn newton(start: [f64; 3], target: [f64; 3], tolerance: f64) -> Option<[f64; 3]> {
    let mut c = start;
    let (mut rgb, mut jacobian) = colour_and_jacobian(c);
    let mut error = largest(difference(target, rgb));
    for _ in 0..12 {
        if error <= tolerance {
            return Some(c);
        }
        let step = solve_3x3(jacobian, difference(target, rgb))?;
        let mut length = 1.0;
        loop {
            let next: [f64; 3] = std::array::from_fn(|k| c[k] + length * step[k]);
            let (next_rgb, next_jacobian) = colour_and_jacobian(next);
            let next_error = largest(difference(target, next_rgb));
            if next_error < error {
                (c, rgb, jacobian, error) = (next, next_rgb, next_jacobian, next_error);
                break;
            }
            length *= 0.5;
            if length < 0.1 {
                return None;
            }
        }
    }
    (error <= tolerance).then_some(c)
}

/// Follows the solution from `c` at `path(0)` to `path(1)`; `.1` is how far it came.
fn follow(c: [f64; 3], path: impl Fn(f64) -> ([f64; 3], f64)) -> ([f64; 3], f64) {
    let (mut c, mut at, mut step) = (c, 0.0, 1.0);
    let mut predictor = path(0.0).1;
    while at < 1.0 && step > 1e-7 {
        let next = f64::min(at + step, 1.0);
        let (target, scale) = path(next);
        let start = c.map(|x| x * scale / predictor);
        match newton(start, target, TOLERANCE * largest(target)) {
            Some(solution) => {
                (c, at, predictor) = (solution, next, scale);
                step *= 2.0;
            }
            None => step *= 0.5,
        }
    }
    (c, at)
}

/// Relative to the largest channel; far below the f32 rounding of the coefficients.
const TOLERANCE: f64 = 1e-8;

/// Brightness at which the chromaticity is reached; every colour of the gamut has a smooth
/// spectrum there.
pub(super) const MIDDLE: f64 = 0.3;

/// The coefficients whose colour is `rgb`, which is in [0, 1] and not all of it equal.
///
/// Where the colour is at the very edge of what surfaces can have (white less a little in one
/// channel), the nearest solution that the path came to.
pub(super) fn solve(rgb: [f64; 3]) -> [f64; 3] {
    let brightness = rgb[0].max(rgb[1]).max(rgb[2]);
    let chroma = rgb.map(|v| v / brightness);
    let c = at_middle(chroma);
    to_brightness(c, chroma, MIDDLE, brightness)
}

/// The solution of [`MIDDLE`] times `chroma`, whose largest channel is 1.
pub(super) fn at_middle(chroma: [f64; 3]) -> [f64; 3] {
    let path = |s: f64| (chroma.map(|v| MIDDLE * (1.0 + s * (v - 1.0))), 1.0);
    follow([0.0, 0.0, inverse_sigmoid(MIDDLE)], path).0
}

/// The solution at `to` times `chroma`, from that at `from` times `chroma`.
///
/// A dark spectrum is 1 / 4x²: x grows with the inverse root of the brightness, which predicts the
/// next solution; steps are geometric. Upward they are even.
pub(super) fn to_brightness(c: [f64; 3], chroma: [f64; 3], from: f64, to: f64) -> [f64; 3] {
    if to < from {
        let ratio = libm::log(to / from);
        let path = |s: f64| {
            let z = if s == 1.0 { to } else { from * libm::exp(s * ratio) };
            (chroma.map(|v| v * z), 1.0 / z.sqrt())
        };
        follow(c, path).0
    } else {
        let path = |s: f64| (chroma.map(|v| v * (from + s * (to - from))), 1.0);
        follow(c, path).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Continuation ends at the colour for primaries, their complements, the edges of the gamut, the
    /// neighbourhood of white and of black: the residual is the solver's tolerance, or, where white
    /// less a millionth makes the equations nearly singular, 1e-6.
    #[test]
    fn solutions_have_the_colour_at_the_corners_of_the_gamut() {
        let mut colours: Vec<[f64; 3]> = Vec::new();
        for level in [1e-9, 1e-4, 0.02, 0.5, 0.99, 1.0] {
            for mask in 1..7 {
                for rest in [0.0, 0.1, 0.5, 0.999, 0.999_999] {
                    colours.push(std::array::from_fn(|k| if mask >> k & 1 == 1 { level } else { level * rest }));
                }
            }
        }
        for rgb in colours {
            let c = solve(rgb);
            let error = largest(difference(colour_and_jacobian(c).0, rgb));
            assert!(error < 1e-6 && c.iter().all(|x| x.is_finite()), "{rgb:?}: {c:?}, error {error:e}");
        }
    }

    /// Dark colours keep their hue: relative, not only absolute.
    #[test]
    fn a_billionth_of_a_colour_keeps_its_hue() {
        let rgb = [1e-9, 4e-10, 1e-10];
        let found = colour_and_jacobian(solve(rgb)).0;
        assert!(largest(difference(found, rgb)) < 1e-16, "{found:?}");
    }
}
