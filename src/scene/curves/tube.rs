//! A piece of a cubic curve with a cubic radius: the surface that a circle of that radius sweeps, centred
//! on the curve and orthogonal to it. It has no caps.
//!
//! **The equations.** In coordinates where the ray is the z axis, let (x, y, z)(u) be the curve, r(u) the radius and
//! ρ² = x² + y². A point (0, 0, t) of the ray is on the circle of u where (p − c)·c' = 0 and |p − c|² = r²:
//!
//! (t − z) z' = ρρ' = x x' + y y' and (t − z)² = r² − ρ².
//!
//! With s = √(r² − ρ²) the ray meets the ball of radius r about c(u) at z ∓ s. So t is gone: hits on the near
//! side of the balls are the zeros of F(u) = ρρ' + s z', those on the far side the zeros of ρρ' − s z'. Where a ray
//! crosses a curve at right angles both zeros are at nearly the same u, and each equation has only one of them:
//! elimination of s would square the condition of the commonest case (compare Reshetov 2017, "Exploiting
//! Budan-Fourier and Vincent's Theorems for Ray Tracing 3D Bézier Curves").
//!
//! **All zeros.** x, y, z, r and their derivatives are Bernstein polynomials, so are their products, and a polynomial
//! lies between its least and greatest coefficient. Halving [0, 1], a part is dropped where ρ > r throughout or F keeps
//! clear of zero by more than its rounding, and is done where F is monotone: the signs at its ends then tell whether it
//! has a zero, which Newton's steps find within the bracket. Signs at the ends of a piece are computed from numbers that
//! it shares with its neighbour, bit for bit, so no zero falls between two pieces.
//!
//! **Front faces.** Only hits count where the ray comes from outside: n·d < 0 with n = (|c'|² − n₀·c'' r) n₀ − r' c',
//! n₀ the direction from the curve. A ray that leaves the surface is a step outside it (or inside) and its own
//! surface is behind it, so that no distance is compared with anything small.

use crate::math::Frame;
use glam::DVec3;

/// Binomial coefficients over those of the product: (3, i)(3, j)/(6, i + j).
const CUBIC_SQUARED: [[f64; 4]; 4] =
    [[1.0, 0.5, 0.2, 0.05], [0.5, 0.6, 0.45, 0.2], [0.2, 0.45, 0.6, 0.5], [0.05, 0.2, 0.5, 1.0]];
/// (3, i)(2, j)/(5, i + j).
const CUBIC_QUADRATIC: [[f64; 3]; 4] = [[1.0, 0.4, 0.1], [0.6, 0.6, 0.3], [0.3, 0.6, 0.6], [0.1, 0.4, 1.0]];

/// A point of the curve with its radius: x, y, z, r; or their derivatives.
type Four = [f64; 4];

/// A piece of a curve, with Bernstein coefficients.
#[derive(Clone, Copy, Debug)]
pub struct Tube {
    /// Points and radii.
    pub points: [Four; 4],
    /// Derivatives by the parameter of the segment. They could be had from `points`, but neighbours share these.
    pub slopes: [Four; 3],
    /// The segment that it belongs to.
    pub segment: u32,
    /// The range of the segment's parameter: first, and how long.
    pub range: [f64; 2],
}

/// Four at once, written out for the compiler's sake.
#[inline(always)]
fn four(f: impl Fn(usize) -> f64) -> Four {
    [f(0), f(1), f(2), f(3)]
}

#[inline(always)]
fn lerp(a: Four, b: Four, u: f64) -> Four {
    // Exact at both ends.
    four(|i| a[i] * (1.0 - u) + b[i] * u)
}

/// The point of a Bernstein polynomial.
#[inline(always)]
fn cubic(b: &[Four; 4], u: f64) -> Four {
    quadratic(&[lerp(b[0], b[1], u), lerp(b[1], b[2], u), lerp(b[2], b[3], u)], u)
}

#[inline(always)]
fn quadratic(b: &[Four; 3], u: f64) -> Four {
    lerp(lerp(b[0], b[1], u), lerp(b[1], b[2], u), u)
}

#[inline(always)]
fn middle(a: Four, b: Four) -> Four {
    four(|i| 0.5 * a[i] + 0.5 * b[i])
}

/// A ray's own coordinates.
#[derive(Clone, Copy, Debug)]
pub struct RaySpace {
    origin: DVec3,
    frame: Frame,
}

impl RaySpace {
    /// The ray from `origin` along the unit vector `direction` is the z axis.
    pub fn new(origin: DVec3, direction: DVec3) -> RaySpace {
        RaySpace { origin, frame: Frame::from_normal(direction) }
    }

    #[inline(always)]
    fn vector(&self, v: Four) -> Four {
        let w = self.frame.to_local(DVec3::new(v[0], v[1], v[2]));
        [w.x, w.y, w.z, v[3]]
    }

    #[inline(always)]
    fn point(&self, p: Four) -> Four {
        self.vector([p[0] - self.origin.x, p[1] - self.origin.y, p[2] - self.origin.z, p[3]])
    }
}

/// Near or far side of the balls.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Near,
    Far,
}

impl Side {
    fn sign(self) -> f64 {
        match self {
            Side::Near => 1.0,
            Side::Far => -1.0,
        }
    }
}

/// Part of a tube in ray space, from `from`, `width` long in the tube's own parameter.
#[derive(Clone, Copy)]
struct Part {
    points: [Four; 4],
    slopes: [Four; 3],
    from: f64,
    width: f64,
}

/// Halving goes this deep at the most: parts are then shorter than f64 can tell.
const DEPTH: u32 = 50;
/// More parts than any tube needs unless its circles run along the ray; beyond, signs alone decide.
const MANY: u32 = 2000;

struct Bounds {
    low: f64,
    high: f64,
}

#[inline(always)]
fn bounds<const N: usize>(c: &[f64; N]) -> Bounds {
    c.iter().fold(Bounds { low: f64::INFINITY, high: f64::NEG_INFINITY }, |b, &x| Bounds {
        low: b.low.min(x),
        high: b.high.max(x),
    })
}

#[inline(always)]
fn scaled(a: &Bounds, by: f64) -> Bounds {
    Bounds { low: a.low * by, high: a.high * by }
}

/// Bounds of a·b with b ≥ 0.
#[inline(always)]
fn times(a: &Bounds, b: &Bounds) -> Bounds {
    Bounds {
        low: a.low * if a.low < 0.0 { b.high } else { b.low },
        high: a.high * if a.high > 0.0 { b.high } else { b.low },
    }
}

impl Part {
    fn halves(&self) -> [Part; 2] {
        let [p, q] = split(&self.points, &self.slopes);
        let width = 0.5 * self.width;
        [
            Part { points: p.0, slopes: p.1, from: self.from, width },
            Part { points: q.0, slopes: q.1, from: self.from + width, width },
        ]
    }
}

type Halves = [([Four; 4], [Four; 3]); 2];

/// De Casteljau's algorithm at ½; the two halves share what they have in common.
#[inline(always)]
fn split(b: &[Four; 4], e: &[Four; 3]) -> Halves {
    let (b01, b12, b23) = (middle(b[0], b[1]), middle(b[1], b[2]), middle(b[2], b[3]));
    let (b012, b123) = (middle(b01, b12), middle(b12, b23));
    let b0123 = middle(b012, b123);
    let (e01, e12) = (middle(e[0], e[1]), middle(e[1], e[2]));
    let e012 = middle(e01, e12);
    [([b[0], b01, b012, b0123], [e[0], e01, e012]), ([b0123, b123, b23, b[3]], [e012, e12, e[2]])]
}

/// F and what it is made of.
struct Value {
    f: f64,
    s: f64,
    c: Four,
    slope: Four,
}

impl Tube {
    /// Two halves.
    pub fn halves(&self) -> [Tube; 2] {
        let [p, q] = split(&self.points, &self.slopes);
        let [from, width] = [self.range[0], 0.5 * self.range[1]];
        let half = |h: &([Four; 4], [Four; 3]), from| Tube {
            points: h.0,
            slopes: h.1,
            segment: self.segment,
            range: [from, width],
        };
        [half(&p, from), half(&q, from + width)]
    }

    /// A box around it: least and greatest corner.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let r = self.points.iter().fold(0.0f64, |r, p| r.max(p[3]));
        let corner = |f: fn(f64, f64) -> f64| {
            DVec3::from([0, 1, 2].map(|a| self.points.iter().map(|p| p[a]).reduce(f).unwrap_or(0.0)))
        };
        (corner(f64::min) - r, corner(f64::max) + r)
    }

    /// Centre, radius and their first and second derivatives by the segment's parameter, at the segment's `u`.
    pub fn at(&self, u: f64) -> [Four; 3] {
        let local = ((u - self.range[0]) / self.range[1]).clamp(0.0, 1.0);
        [cubic(&self.points, local), quadratic(&self.slopes, local), second(&self.slopes, local, self.range[1])]
    }

    /// The first hit with 0 < t < `t_max` from outside: t and the segment's parameter.
    pub fn entry(&self, space: &RaySpace, t_max: f64) -> Option<(f64, f64)> {
        let points = [0, 1, 2, 3].map(|i: usize| space.point(self.points[i]));
        // Most rays pass by: ρ ≤ r needs |x| ≤ r and |y| ≤ r.
        let [x, y, r] = [0, 1, 3].map(|axis| bounds(&column(&points, axis)));
        if x.low > r.high || -x.high > r.high || y.low > r.high || -y.high > r.high {
            return None;
        }
        // Where four control points coincide no circle is orthogonal to the curve, and F is zero everywhere.
        if self.slopes.iter().all(|slope| slope[..3] == [0.0; 3]) {
            return None;
        }
        let whole =
            Part { points, slopes: [0, 1, 2].map(|i: usize| space.vector(self.slopes[i])), from: 0.0, width: 1.0 };
        let mut search = Search { tube: self, whole, t_max, found: None, count: 0 };
        search.part(&whole, [true; 2], 0);
        search.found.map(|(t, u)| (t, self.range[0] + u * self.range[1]))
    }

    fn value(whole: &Part, side: Side, u: f64) -> Value {
        let (c, slope) = (cubic(&whole.points, u), quadratic(&whole.slopes, u));
        let s2 = c[3] * c[3] - c[0] * c[0] - c[1] * c[1];
        let s = s2.max(0.0).sqrt();
        let f = c[0] * slope[0] + c[1] * slope[1] + side.sign() * slope[2] * s;
        Value { f, s: if s2 < 0.0 { -1.0 } else { s }, c, slope }
    }

    /// The zero of F between two parameters, if its signs there differ, and if it is a front face.
    fn zero(&self, whole: &Part, side: Side, from: f64, to: f64) -> Option<(f64, f64)> {
        let end = |u: f64| {
            let value = Tube::value(whole, side, u);
            // Where the curve stands still at the end of a segment (control points that coincide) its direction
            // is that of the way in or out.
            if value.slope[..3] == [0.0; 3] {
                let way = if u < 0.5 { 1.0 } else { -1.0 };
                let d = second(&whole.slopes, u, 1.0).map(|x| x * way);
                let d = if d[..3] == [0.0; 3] { third(&whole.slopes) } else { d };
                return value.c[0] * d[0] + value.c[1] * d[1] + side.sign() * d[2] * value.s.max(0.0);
            }
            value.f
        };
        let (f_from, f_to) = (end(from), end(to));
        // Zero counts as positive, on either side of a joint.
        if (f_from < 0.0) == (f_to < 0.0) {
            return None;
        }
        let (mut a, mut b) = (from, to);
        let mut u = a + (b - a) * (f_from / (f_from - f_to)).clamp(0.0, 1.0);
        if !(u >= a && u <= b) {
            u = 0.5 * (a + b);
        }
        let mut steps = 0;
        let value = loop {
            let v = Tube::value(whole, side, u);
            if (v.f < 0.0) == (f_from < 0.0) {
                a = u
            } else {
                b = u
            }
            let curvature = second(&whole.slopes, u, 1.0);
            let derivative = {
                let w = self.range[1];
                let p = v.slope[0] * v.slope[0] + v.slope[1] * v.slope[1];
                let p = p * w + v.c[0] * curvature[0] + v.c[1] * curvature[1];
                let s_slope = w * (v.c[3] * v.slope[3] - v.c[0] * v.slope[0] - v.c[1] * v.slope[1]) / v.s;
                if v.s > 0.0 { p + side.sign() * (curvature[2] * v.s + v.slope[2] * s_slope) } else { p }
            };
            let newton = u - v.f / derivative;
            steps += 1;
            // Newton, unless it leaves the bracket or does not settle.
            let next = if newton >= a && newton <= b && steps < 12 { newton } else { 0.5 * (a + b) };
            if (next - u).abs() <= f64::EPSILON || steps > 80 {
                break v;
            }
            u = next;
        };
        if value.s < 0.0 {
            return None;
        }
        // Towards the ray where d is z: n₀ = (−x, −y, ∓s)/r; times r throughout.
        let rise = -side.sign() * value.s;
        let curvature = second(&whole.slopes, u, self.range[1]);
        let [dx, dy, dz, dr] = value.slope;
        let bend = -value.c[0] * curvature[0] - value.c[1] * curvature[1] + rise * curvature[2];
        let facing = (dx * dx + dy * dy + dz * dz - bend) * rise - value.c[3] * dr * dz;
        (facing < 0.0).then_some((value.c[2] + rise, u))
    }
}

/// The search for the first hit on a tube.
struct Search<'a> {
    tube: &'a Tube,
    whole: Part,
    t_max: f64,
    /// t and the tube's own parameter.
    found: Option<(f64, f64)>,
    count: u32,
}

impl Search<'_> {
    /// Searches a part for zeros on the `open` ones of the near and the far side.
    fn part(&mut self, part: &Part, mut open: [bool; 2], depth: u32) {
        let (b, e) = (&part.points, &part.slopes);
        // S = r² − ρ² by coefficients.
        let mut s2 = [0.0; 7];
        for i in 0..4 {
            for j in 0..4 {
                let product = b[i][3] * b[j][3] - b[i][0] * b[j][0] - b[i][1] * b[j][1];
                s2[i + j] += CUBIC_SQUARED[i][j] * product;
            }
        }
        let s2 = bounds(&s2);
        if s2.high < 0.0 {
            return;
        }
        let (z, r) = (bounds(&column(b, 2)), bounds(&column(b, 3)));
        if z.low - r.high >= self.t_max || z.high + r.high <= 0.0 {
            return;
        }

        // P = ρρ' and r r' by coefficients.
        let (mut p, mut rr) = ([0.0; 6], [0.0; 6]);
        for i in 0..4 {
            for j in 0..3 {
                p[i + j] += CUBIC_QUADRATIC[i][j] * (b[i][0] * e[j][0] + b[i][1] * e[j][1]);
                rr[i + j] += CUBIC_QUADRATIC[i][j] * b[i][3] * e[j][3];
            }
        }
        let s = Bounds { low: s2.low.max(0.0).sqrt(), high: s2.high.sqrt() };
        let (p_bounds, dz) = (bounds(&p), column(e, 2));
        // The rounding of F: some ten operations on products of the greatest factors.
        let most = |c: &[f64]| c.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let size = |a: usize| most(&column(b, a)) * most(&column(e, a));
        let rounding = 16.0 * f64::EPSILON * (size(0) + size(1) + most(&dz) * s.high);

        self.count += 1;
        let last = depth == DEPTH || self.count > MANY;
        for side in [Side::Near, Side::Far] {
            let open = &mut open[side as usize];
            if !*open {
                continue;
            }
            // On the far side only a radius that grows along the ray turns a front face to it: r'z' > 0.
            if side == Side::Far {
                let (growth, along) = (bounds(&rr), bounds(&dz));
                if (growth.high <= 0.0 || along.high <= 0.0) && (growth.low >= 0.0 || along.low >= 0.0) {
                    *open = false;
                    continue;
                }
            }
            let sign = side.sign();
            let dz = [dz[0] * sign, dz[1] * sign, dz[2] * sign];
            let f = times(&bounds(&dz), &s);
            if p_bounds.low + f.low > rounding || p_bounds.high + f.high < -rounding {
                *open = false;
            } else if last || monotone(&p, &rr, &dz, &s2, &s, part.width * self.tube.range[1]) {
                *open = false;
                let zero = self.tube.zero(&self.whole, side, part.from, part.from + part.width);
                if let Some((t, u)) = zero.filter(|&(t, _)| t > 0.0 && t < self.t_max) {
                    self.t_max = t;
                    self.found = Some((t, u));
                }
            }
        }
        if open != [false; 2] {
            // The half that may be nearer comes first.
            let [first, second] = part.halves();
            let turned = part.points[0][2] > part.points[3][2];
            for half in if turned { [second, first] } else { [first, second] } {
                self.part(&half, open, depth + 1);
            }
        }
    }
}

#[inline(always)]
fn column<const N: usize>(c: &[Four; N], axis: usize) -> [f64; N] {
    let mut out = [0.0; N];
    for (out, c) in out.iter_mut().zip(c) {
        *out = c[axis];
    }
    out
}

/// The second derivative by the segment's parameter, of a piece that is `width` of the segment.
fn second(e: &[Four; 3], u: f64, width: f64) -> Four {
    let a = four(|i| 2.0 * (e[1][i] - e[0][i]) / width);
    let b = four(|i| 2.0 * (e[2][i] - e[1][i]) / width);
    lerp(a, b, u)
}

/// The direction of the third derivative.
fn third(e: &[Four; 3]) -> Four {
    four(|i| (e[2][i] - e[1][i]) - (e[1][i] - e[0][i]))
}

/// Whether F = P + z'√S keeps the sign of its derivative: that of P where S < 0, and of
/// √S F' = P'√S + z''S + z'S'/2 where S > 0, with S' = 2 (r r' − P). `width` is that of the part in the segment's
/// parameter, by which S' is multiplied to match the other derivatives, which are differences of coefficients.
fn monotone(p: &[f64; 6], rr: &[f64; 6], dz: &[f64; 3], s2: &Bounds, s: &Bounds, width: f64) -> bool {
    let slope = [p[1] - p[0], p[2] - p[1], p[3] - p[2], p[4] - p[3], p[5] - p[4]];
    let slope = scaled(&bounds(&slope), 5.0);
    let bend = bounds(&[2.0 * (dz[1] - dz[0]), 2.0 * (dz[2] - dz[1])]);
    let half = [rr[0] - p[0], rr[1] - p[1], rr[2] - p[2], rr[3] - p[3], rr[4] - p[4], rr[5] - p[5]];
    let (half, dz) = (scaled(&bounds(&half), width), bounds(dz));
    let products = [dz.low * half.low, dz.low * half.high, dz.high * half.low, dz.high * half.high];
    let cross = bounds(&products);
    let a = times(&slope, s);
    let b = times(&bend, &Bounds { low: s2.low.max(0.0), high: s2.high });
    let (low, high) = (a.low + b.low + cross.low, a.high + b.high + cross.high);
    let outside = s2.low < 0.0;
    (low > 0.0 && (!outside || slope.low > 0.0)) || (high < 0.0 && (!outside || slope.high < 0.0))
}
