//! Curves with a thickness: hair, threads, wires; many in one object.
//!
//! [`Basis::Linear`]: balls at the control points and between them round cones that touch both, so that
//! joints and ends are round; see `cone.rs`. [`Basis::BSpline`]: uniform cubic B-splines, of which a circle
//! sweeps the surface; the ends are open; see `tube.rs`.
//!
//! **Only from outside.** As in Mitsuba, a ray meets a curve only where it comes from outside; what starts
//! inside leaves unseen, and a piece that lies within another one does not show. From within, as light that was let in sees
//! them, pieces show where they are entered by their walls, and not by the balls of joints. It follows that a ray which
//! leaves a curve meets no surface that it left: outward it goes away from a front face, and the step of
//! [`Ray::leaving`], 16 times the rounding of the point, has put it before or behind the surface for certain.
//!
//! **Texture coordinates.** u is the angle about the curve in turns, counted from the horizontal (z is up, as in
//! Mitsuba) by the right hand about the direction of the curve; v runs over all segments of the file, 0 to 1.

mod cone;
mod file;
mod plain;
#[cfg(test)]
mod tests;
mod tube;

pub use file::{ControlPoint, Strands, load};

use super::bvh::{Aabb, Bvh};
use super::shape::SurfacePoint;
use crate::math::{Frame, Ray};
use cone::RoundCone;
use glam::{DAffine3, DVec2, DVec3};
use tube::{RaySpace, Tube};

/// What control points mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Basis {
    /// Straight lines from point to point.
    Linear,
    /// Uniform cubic B-splines.
    BSpline,
}

/// Where a ray meets a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveHit {
    /// Ray parameter.
    pub t: f64,
    /// The segment, counted through the file.
    pub segment: u32,
    /// Where on the segment, 0 to 1.
    pub v: f64,
}

#[derive(Clone, Debug)]
enum Pieces {
    /// One a segment.
    Cones(Vec<RoundCone>),
    /// One or more a segment, in order, and the first of each segment.
    Tubes(Vec<Tube>, Vec<u32>),
}

/// Curves in the world.
#[derive(Clone, Debug)]
pub struct Curves {
    pieces: Pieces,
    /// Over the boxes of the pieces; of a cone over those of its parts.
    bvh: Bvh,
    /// The piece of each box, if they are not in order: parts of cones.
    parts: Vec<u32>,
    segments: u32,
    bounds: Aabb,
    /// From the control points as written to the world.
    placement: DAffine3,
}

impl Curves {
    /// From the control points as written to the world.
    #[must_use]
    pub fn placement(&self) -> DAffine3 {
        self.placement
    }

    /// Curves in the world. Radii are not transformed.
    ///
    /// # Errors
    /// In words: a curve of too few points, a transform that leaves the range of numbers.
    pub fn new(curves: &[Vec<ControlPoint>], world_from_object: &DAffine3, basis: Basis) -> Result<Curves, String> {
        let least = match basis {
            Basis::Linear => 2,
            Basis::BSpline => 4,
        };
        let mut segments: Vec<Vec<ControlPoint>> = Vec::new();
        for (i, curve) in curves.iter().enumerate() {
            if curve.len() < least {
                let found = curve.len();
                return Err(format!("expected {least} or more control points in a curve, found {found} in curve {i}"));
            }
            let place = |&[x, y, z, r]: &ControlPoint| {
                let p = world_from_object.transform_point3(DVec3::new(x, y, z));
                [p.x, p.y, p.z, r]
            };
            let placed: Vec<ControlPoint> = curve.iter().map(place).collect();
            if let Some(p) = placed.iter().find(|p| p.iter().any(|x| !x.is_finite())) {
                return Err(format!("expected control points within the range of numbers, found {p:?} in curve {i}"));
            }
            segments.extend(placed.windows(least).map(<[_]>::to_vec));
        }
        // A segment has up to eight pieces, of which one tree holds 2²⁸.
        const MOST: usize = 1 << 25;
        if segments.len() > MOST {
            return Err(format!("expected at most {MOST} segments, found {}", segments.len()));
        }

        let pieces = match basis {
            Basis::Linear => {
                let joined = |i: usize| i > 0 && segments[i - 1][1] == segments[i][0];
                let piece =
                    |(i, s): (usize, &Vec<ControlPoint>)| RoundCone { joined: joined(i), ..cone_between(s[0], s[1]) };
                Pieces::Cones(segments.iter().enumerate().map(piece).collect())
            }
            Basis::BSpline => {
                let (mut tubes, mut first) = (Vec::new(), Vec::new());
                for (i, s) in segments.iter().enumerate() {
                    first.push(tubes.len() as u32);
                    add_pieces(tube_of([s[0], s[1], s[2], s[3]], i as u32), 0, &mut tubes);
                }
                first.push(tubes.len() as u32);
                Pieces::Tubes(tubes, first)
            }
        };
        // Surface points have some eight roundings of the coordinates that make them.
        let rounding = |(min, max): (DVec3, DVec3)| 16.0 * f64::EPSILON * min.abs().max(max.abs()).max_element();
        let (mut boxes, mut parts): (Vec<Aabb>, Vec<u32>) = (Vec::new(), Vec::new());
        match &pieces {
            Pieces::Cones(cones) => {
                for (i, cone) in cones.iter().enumerate() {
                    // All together are the box of the cone, to the last bit.
                    let (min, max) = cone.bounds(0.0, 1.0);
                    let pad = rounding((min, max));
                    add_parts(cone, [0.0, 1.0], 0, &mut |low, high| {
                        boxes.push(Aabb { min: low.max(min) - pad, max: high.min(max) + pad });
                    });
                    parts.resize(boxes.len(), i as u32);
                }
            }
            Pieces::Tubes(tubes, _) => boxes.extend(tubes.iter().map(|t| {
                let (min, max) = t.bounds();
                let pad = rounding((min, max));
                Aabb { min: min - pad, max: max + pad }
            })),
        }
        if parts.len() == segments.len() {
            parts = Vec::new();
        }
        let bvh = Bvh::build(&boxes);
        let bounds = bvh.bounds();
        Ok(Curves { pieces, bvh, parts, segments: segments.len() as u32, bounds, placement: *world_from_object })
    }

    /// How many segments there are.
    #[must_use]
    pub fn segments(&self) -> u32 {
        self.segments
    }

    /// The box of all curves.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Memory of the pieces and their tree.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let pieces = match &self.pieces {
            Pieces::Cones(cones) => cones.capacity() * size_of::<RoundCone>(),
            Pieces::Tubes(tubes, first) => tubes.capacity() * size_of::<Tube>() + 4 * first.capacity(),
        };
        size_of::<Curves>() + pieces + self.bvh.bytes() + 4 * self.parts.capacity()
    }

    /// The nearest hit with 0 < t < `t_max` from outside.
    #[must_use]
    pub fn closest(&self, ray: &Ray, t_max: f64) -> Option<CurveHit> {
        let length = ray.direction.length();
        let direction = ray.direction / length;
        let mut found = None;
        let space = RaySpace::new(ray.origin, direction);
        self.bvh.closest(ray, t_max, |piece, t_max| {
            let hit = self.entry(piece, &space, ray.origin, direction, length, t_max)?;
            found = Some(hit);
            Some(hit.t)
        });
        found
    }

    /// Whether the ray enters any curve at 0 < t < `t_max`.
    #[must_use]
    pub fn any(&self, ray: &Ray, t_max: f64) -> bool {
        let length = ray.direction.length();
        let direction = ray.direction / length;
        let space = RaySpace::new(ray.origin, direction);
        self.bvh.any(ray, t_max, |piece| self.entry(piece, &space, ray.origin, direction, length, t_max).is_some())
    }

    #[inline]
    fn entry(
        &self,
        piece: u32,
        space: &RaySpace,
        origin: DVec3,
        direction: DVec3,
        length: f64,
        t_max: f64,
    ) -> Option<CurveHit> {
        let (t, v, segment) = match &self.pieces {
            Pieces::Cones(cones) => {
                let piece = if self.parts.is_empty() { piece } else { self.parts[piece as usize] };
                let (t, v) = cones[piece as usize].entry(origin, direction)?;
                if is_within_joint(cones, piece, v, origin, direction, t) {
                    return None;
                }
                // A joint has the direction of the piece that ends there, as in Mitsuba.
                if v == 0.0 && cones[piece as usize].joined { (t, 1.0, piece - 1) } else { (t, v, piece) }
            }
            Pieces::Tubes(tubes, _) => {
                let tube = &tubes[piece as usize];
                let (t, v) = tube.entry(space, t_max * length)?;
                (t, v, tube.segment)
            }
        };
        let t = t / length;
        (t > 0.0 && t < t_max).then_some(CurveHit { t, segment, v })
    }

    /// The radius at `v` of a segment.
    #[must_use]
    pub fn thickness(&self, segment: u32, v: f64) -> f64 {
        self.line(segment, v).1
    }

    /// The middle of a segment at `v`, and its radius.
    fn line(&self, segment: u32, v: f64) -> (DVec3, f64) {
        match &self.pieces {
            Pieces::Cones(cones) => (cones[segment as usize].center(v), cones[segment as usize].radius(v)),
            Pieces::Tubes(tubes, first) => {
                let [x, y, z, r] = piece_at(tubes, first, segment, v).at(v)[0];
                (DVec3::new(x, y, z), r)
            }
        }
    }

    /// Where `point` at `v` of a segment is on `other`, the same curves placed elsewhere: its side of the curve turns with
    /// them, and stays as far from the middle as they are thick. `None` where there is no such place.
    #[must_use]
    pub fn carried(&self, other: &Curves, segment: u32, v: f64, point: DVec3) -> Option<DVec3> {
        if segment >= other.segments {
            return None;
        }
        let ((here, _), (there, radius)) = (self.line(segment, v), other.line(segment, v));
        let turn = other.placement.matrix3 * self.placement.matrix3.inverse();
        Some(there + unit(turn * (point - here))? * radius)
    }

    /// The surface of a segment nearest to `point_on_ray`, which `closest` has found at `v`.
    #[must_use]
    pub fn surface(&self, point_on_ray: DVec3, segment: u32, v: f64) -> SurfacePoint {
        let (center, radius, slope, growth, bend, v) = match &self.pieces {
            Pieces::Cones(cones) => {
                let cone = &cones[segment as usize];
                let v = cone.v_at(point_on_ray);
                // The ball is part of the surface, so its normal is the surface's.
                (cone.center(v), cone.radius(v), cone.axis, 0.0, DVec3::ZERO, v)
            }
            Pieces::Tubes(tubes, first) => {
                let tube = piece_at(tubes, first, segment, v);
                // One step of Newton towards (p − c)·c' = 0, where the curve does not bend within its radius.
                let three = |x: [f64; 4]| DVec3::new(x[0], x[1], x[2]);
                let [c, d, e] = tube.at(v).map(three);
                let rate = d.length_squared() - (point_on_ray - c).dot(e);
                let step = (point_on_ray - c).dot(d) / rate;
                let v = if rate > 0.0 && step.is_finite() { (v + step).clamp(0.0, 1.0) } else { v };
                let [c, d, e] = tube.at(v);
                (three(c), c[3], three(d), d[3], three(e), v)
            }
        };
        let along = unit(slope).unwrap_or(DVec3::Z);
        let away = unit(point_on_ray - center).unwrap_or_else(|| Frame::from_normal(along).s);
        let point = center + away * radius;
        let normal = match self.pieces {
            Pieces::Cones(_) => away,
            Pieces::Tubes(..) => {
                let n = away * (slope.length_squared() - radius * away.dot(bend)) - slope * growth;
                unit(n).unwrap_or(away)
            }
        };

        // Up, as far as it is across the curve; u = 0 is across both.
        let up = unit(DVec3::Z - along * along.z).unwrap_or(DVec3::Y);
        let side = up.cross(along);
        let uv = DVec2::new(
            super::shape::turns(away.dot(side), away.dot(up)),
            (v + f64::from(segment)) / f64::from(self.segments),
        );
        let around = along.cross(away);
        let tangent = if around.length_squared() > 0.0 { around } else { Frame::from_normal(normal).s };
        let scale = center.abs().max_element() + radius;
        SurfacePoint { point, scale, normal, shading_normal: normal, uv, tangent }
    }
}

/// Whether a ray that enters a piece at `t` does so by a joint's ball, at a point within the other piece of that joint: there
/// it is in the curve already. What is the surface of both is off by its rounding, a few units of the last place of what
/// makes the point.
fn is_within_joint(cones: &[RoundCone], piece: u32, v: f64, origin: DVec3, direction: DVec3, t: f64) -> bool {
    let i = piece as usize;
    let other = match v {
        0.0 if cones[i].joined => &cones[i - 1],
        1.0 => match cones.get(i + 1) {
            Some(next) if next.joined => next,
            _ => return false,
        },
        _ => return false,
    };
    let slack = 16.0 * f64::EPSILON * (origin.abs().max_element() + t);
    other.holds(origin + direction * t, slack)
}

/// The piece of a segment that holds `v`.
fn piece_at<'a>(tubes: &'a [Tube], first: &[u32], segment: u32, v: f64) -> &'a Tube {
    let pieces = &tubes[first[segment as usize] as usize..first[segment as usize + 1] as usize];
    pieces.iter().rfind(|t| t.range[0] <= v).unwrap_or(&pieces[0])
}

/// Unit length, where there is any; scaled first, so that squares stay in range.
fn unit(v: DVec3) -> Option<DVec3> {
    (v / v.abs().max_element()).try_normalize()
}

fn cone_between(a: ControlPoint, b: ControlPoint) -> RoundCone {
    let start = DVec3::new(a[0], a[1], a[2]);
    RoundCone { start, axis: DVec3::new(b[0], b[1], b[2]) - start, radius: a[3], taper: a[3] - b[3], joined: false }
}

/// A segment of a uniform cubic B-spline as a Bézier curve. What it shares with its neighbours, place and slope at the
/// ends, is computed from the shared control points in the same way, so that it is the same to the last bit.
fn tube_of([a, b, c, d]: [ControlPoint; 4], segment: u32) -> Tube {
    let each = |f: &dyn Fn(usize) -> f64| -> [f64; 4] { std::array::from_fn(f) };
    let knot = |p: ControlPoint, q: ControlPoint, r: ControlPoint| each(&|i| ((p[i] + r[i]) + 4.0 * q[i]) / 6.0);
    let third = |p: ControlPoint, q: ControlPoint| each(&|i| (2.0 * p[i] + q[i]) / 3.0);
    let slope = |p: ControlPoint, r: ControlPoint| each(&|i| 0.5 * (r[i] - p[i]));
    Tube {
        points: [knot(a, b, c), third(b, c), third(c, b), knot(b, c, d)],
        slopes: [slope(a, c), each(&|i| c[i] - b[i]), slope(b, d)],
        segment,
        range: [0.0, 1.0],
    }
}

/// How often a piece is halved at the most: into eight.
const HALVINGS: u32 = 3;

/// Whether the boxes of both halves, each from its least to its greatest corner, are much smaller than that of the `whole`: by the
/// surface, to which the number of rays is proportional that meet a box.
fn is_worth_halving(whole: (DVec3, DVec3), halves: [(DVec3, DVec3); 2]) -> bool {
    let area = |(low, high): (DVec3, DVec3)| {
        let e = high - low;
        e.x * e.y + e.y * e.z + e.z * e.x
    };
    area(halves[0]) + area(halves[1]) < 0.8 * area(whole)
}

/// Tells `add` the boxes of the parts of a cone from one v to the other that is halved as long as that is worth it. A cone stays one
/// piece, which is met through any of them.
fn add_parts(cone: &RoundCone, [from, to]: [f64; 2], depth: u32, add: &mut impl FnMut(DVec3, DVec3)) {
    let (whole, middle) = (cone.bounds(from, to), 0.5 * (from + to));
    if depth < HALVINGS && is_worth_halving(whole, [cone.bounds(from, middle), cone.bounds(middle, to)]) {
        add_parts(cone, [from, middle], depth + 1, add);
        add_parts(cone, [middle, to], depth + 1, add);
    } else {
        add(whole.0, whole.1);
    }
}

/// Halves a tube as long as that is worth it.
fn add_pieces(tube: Tube, depth: u32, pieces: &mut Vec<Tube>) {
    let halves = tube.halves();
    if depth < HALVINGS && is_worth_halving(tube.bounds(), [halves[0].bounds(), halves[1].bounds()]) {
        for half in halves {
            add_pieces(half, depth + 1, pieces);
        }
    } else {
        pieces.push(tube);
    }
}
