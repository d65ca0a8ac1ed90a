//! Polygons as triangles: a fan about the first corner, or, where that does not fit, ears that are cut off one by one (Meisters
//! 1975, "Polygons Have Ears").

use glam::{DVec2, DVec3};
use std::collections::BTreeSet;
use std::ops::Range;

/// Where a triangle of `fan`, a polygon about its first corner, is turned against the whole, gives the polygon other triangles
/// in its place, as many: ears cut in the plane of Newell's normal. A polygon that crosses itself, or names vertices that are
/// not there, stays a fan.
pub(super) fn unfold(positions: &[DVec3], fan: &mut [[u32; 3]]) {
    // Of a triangle there is but one fan.
    let [first, _, ..] = fan else { return };
    let [a, b, _] = *first;
    let corners: Vec<u32> = [a, b].into_iter().chain(fan.iter().map(|t| t[2])).collect();
    if corners.iter().any(|&v| v as usize >= positions.len()) {
        return;
    }
    let at = |v: u32| positions[v as usize];
    let area = |[a, b, c]: [u32; 3]| (at(b) - at(a)).cross(at(c) - at(a));
    let normal: DVec3 = fan.iter().map(|&t| area(t)).sum();
    let turn = |t: [u32; 3]| area(t).dot(normal);
    if !fan.iter().any(|&t| turn(t) < 0.0) {
        return;
    }
    let mut ears = Vec::with_capacity(fan.len());
    let mut rest = Rest::new(corners.iter().map(|&v| at(v)).collect(), normal);
    // Where the last was cut: from there the search goes on, so that the triangles do not all meet in one corner.
    let mut from = 0;
    for _ in 4..=corners.len() {
        let Some(i) = rest.find(from) else { return };
        ears.push(rest.ear(i).map(|i| corners[i]));
        from = rest.cut(i);
    }
    let last: Vec<u32> = corners.iter().enumerate().filter(|(i, _)| rest.places.is_left(*i)).map(|(_, &v)| v).collect();
    if let [a, b, c] = last[..]
        && turn([a, b, c]) >= 0.0
    {
        ears.push([a, b, c]);
        fan.copy_from_slice(&ears);
    }
}

/// What is left of a polygon while ears are cut off, by the number of each corner in the whole.
struct Rest {
    positions: Vec<DVec3>,
    normal: DVec3,
    places: Places,
    /// The corners on both sides, of those that are left; of others, when they were cut off.
    before: Vec<usize>,
    after: Vec<usize>,
    /// Corners whose ear is turned as the whole is, but for those that are known to hold another corner.
    open: BTreeSet<usize>,
    /// Corners on a straight line.
    flat: BTreeSet<usize>,
    /// A corner that lies in the ear, where one is known: until that is cut off, or the ends change, the ear is not looked at again.
    held_by: Vec<Option<usize>>,
    /// The ears that a corner is known to lie in, or was.
    holds: Vec<Vec<usize>>,
}

impl Rest {
    fn new(positions: Vec<DVec3>, normal: DVec3) -> Rest {
        let n = positions.len();
        let mut rest = Rest {
            places: Places::new(&positions, normal),
            positions,
            normal,
            before: (0..n).map(|i| (i + n - 1) % n).collect(),
            after: (0..n).map(|i| (i + 1) % n).collect(),
            open: BTreeSet::new(),
            flat: BTreeSet::new(),
            held_by: vec![None; n],
            holds: vec![Vec::new(); n],
        };
        (0..n).for_each(|i| rest.renew(i));
        rest
    }

    /// Corner `i` between its neighbours.
    fn ear(&self, i: usize) -> [usize; 3] {
        [self.before[i], i, self.after[i]]
    }

    fn renew(&mut self, i: usize) {
        let [a, b, c] = self.ear(i).map(|i| self.positions[i]);
        let turn = (b - a).cross(c - a).dot(self.normal);
        self.held_by[i] = None;
        for (set, is_of_it) in [(&mut self.open, turn > 0.0), (&mut self.flat, turn == 0.0)] {
            if is_of_it {
                set.insert(i)
            } else {
                set.remove(&i)
            };
        }
    }

    /// The first ear that can be cut off, from corner `from` on. Corners on a straight line are left to the last: an ear of them
    /// is flat.
    fn find(&mut self, from: usize) -> Option<usize> {
        let next = |set: &BTreeSet<usize>| set.range(from..).next().or_else(|| set.first()).copied();
        while let Some(i) = next(&self.open) {
            let Some(other) = self.corner_in(i) else { return Some(i) };
            self.open.remove(&i);
            self.held_by[i] = Some(other);
            self.holds[other].push(i);
        }
        next(&self.flat)
    }

    /// A corner that lies in the ear at corner `i`.
    fn corner_in(&self, i: usize) -> Option<usize> {
        let ear = self.ear(i);
        let [a, b, c] = ear.map(|i| self.positions[i]);
        let edges = [(a, b - a), (b, c - b), (c, a - c)];
        self.places.find(ear, |other| {
            let v = self.positions[other];
            let holds = edges.iter().all(|&(from, along)| along.cross(v - from).dot(self.normal) >= 0.0);
            holds && ![a, b, c].contains(&v)
        })
    }

    /// Cuts off corner `i`, and gives the one after it.
    fn cut(&mut self, i: usize) -> usize {
        let [before, _, after] = self.ear(i);
        self.places.remove(i);
        self.open.remove(&i);
        self.flat.remove(&i);
        for ear in std::mem::take(&mut self.holds[i]) {
            if self.held_by[ear] == Some(i) && self.places.is_left(ear) {
                self.held_by[ear] = None;
                self.open.insert(ear);
            }
        }
        self.after[before] = after;
        self.before[after] = before;
        self.renew(before);
        self.renew(after);
        after
    }
}

/// Where corners are, as one sees them along the normal: boxes in boxes, so that the few near an ear are found among all.
struct Places {
    /// On the plane of two axes, along the normal.
    at: Vec<DVec2>,
    /// How far rounding moves them.
    off: f64,
    /// Whether the whole goes round that plane from the first axis to the second, 1, or back, -1.
    sense: f64,
    /// The corners, those of a box side by side, and the place of each among them.
    order: Vec<usize>,
    place: Vec<usize>,
    is_gone: Vec<bool>,
    /// Least and greatest coordinates of each box. Those that box k is cut into are 2k + 1 and 2k + 2.
    boxes: Vec<[DVec2; 2]>,
    /// How many corners are left in each.
    left: Vec<usize>,
    /// How often the whole is cut in two.
    depth: u32,
}

/// About so many corners are in a box that is not cut any more.
const FEW: usize = 8;

impl Places {
    fn new(positions: &[DVec3], normal: DVec3) -> Places {
        let n = positions.len();
        // Along the normal onto the plane of the two axes from which it is farthest.
        let axis = normal.abs().max_position();
        let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
        let slope = DVec2::new(normal[i], normal[j]) / normal[axis];
        let at: Vec<DVec2> = positions.iter().map(|p| DVec2::new(p[i], p[j]) - p[axis] * slope).collect();
        let largest = positions.iter().fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
        let depth = (n / FEW).checked_ilog2().unwrap_or(0);
        let count = (2 << depth) - 1;
        let mut out = Places {
            at,
            // Slopes are at most 1: three roundings of what is below twice the largest; and some twenty in what tells on which side
            // of a line a corner lies, in proportion to lengths below four times that.
            off: 128.0 * f64::EPSILON * largest,
            sense: normal[axis].signum(),
            order: (0..n).collect(),
            place: vec![0; n],
            is_gone: vec![false; n],
            boxes: vec![[DVec2::ZERO; 2]; count],
            left: vec![0; count],
            depth,
        };
        out.divide(0, 0..n, depth);
        (0..n).for_each(|k| out.place[out.order[k]] = k);
        out
    }

    /// Makes box `k` of the corners that stand in `range` of the order, and `depth` times two of each.
    fn divide(&mut self, k: usize, range: Range<usize>, depth: u32) {
        let at = &self.at;
        let own = &mut self.order[range.clone()];
        let bounds = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        let [low, high] = own.iter().fold(bounds, |[low, high], &i| [low.min(at[i]), high.max(at[i])]);
        (self.boxes[k], self.left[k]) = ([low, high], own.len());
        if depth == 0 {
            return;
        }
        let axis = (high - low).max_position();
        let half = own.len() / 2;
        own.select_nth_unstable_by(half, |&i, &j| at[i][axis].total_cmp(&at[j][axis]));
        let middle = range.start + half;
        self.divide(2 * k + 1, range.start..middle, depth - 1);
        self.divide(2 * k + 2, middle..range.end, depth - 1);
    }

    fn is_left(&self, i: usize) -> bool {
        !self.is_gone[i]
    }

    fn remove(&mut self, i: usize) {
        self.is_gone[i] = true;
        let (mut k, mut range) = (0, 0..self.order.len());
        self.left[0] -= 1;
        for _ in 0..self.depth {
            let middle = range.start + range.len() / 2;
            (k, range) = match self.place[i] < middle {
                true => (2 * k + 1, range.start..middle),
                false => (2 * k + 2, middle..range.end),
            };
            self.left[k] -= 1;
        }
    }

    /// A corner that is left and `fits`, of those that may lie in `ear`.
    fn find(&self, ear: [usize; 3], fits: impl Fn(usize) -> bool) -> Option<usize> {
        let [a, b, c] = ear.map(|i| self.at[i]);
        let sides = [(a, b - a), (b, c - b), (c, a - c)].map(|(from, along)| (from, self.sense * along));
        // Of an ear of nearly no angle rounding takes for a part of it what lies beyond its tip, in its line: so far as `off` is wide
        // between its sides, and without end where they are one to rounding.
        let longest = sides.iter().fold(0.0, |most: f64, (_, along)| most.max(along.length_squared()));
        let angle = self.sense * (b - a).perp_dot(c - a) / longest;
        let reach = if angle > 64.0 * f64::EPSILON { self.off + self.off / angle } else { f64::INFINITY };
        let (low, high) = (a.min(b).min(c) - reach, a.max(b).max(c) + reach);
        let is_apart = |k: usize| {
            let [least, most] = [self.boxes[k][0] - self.off, self.boxes[k][1] + self.off];
            // All of a box lies on the outer side of a side where that corner of it does which is farthest in.
            let is_beyond = |(from, along): (DVec2, DVec2)| {
                let x = if along.y > 0.0 { least.x } else { most.x };
                let y = if along.x > 0.0 { most.y } else { least.y };
                along.perp_dot(DVec2::new(x, y) - from) < 0.0
            };
            least.cmpgt(high).any() || most.cmplt(low).any() || sides.into_iter().any(is_beyond)
        };
        self.find_in(0, 0..self.order.len(), self.depth, &is_apart, &fits)
    }

    /// The same in box `k`, which is cut in two `depth` times, and not in boxes that are apart.
    fn find_in(
        &self,
        k: usize,
        range: Range<usize>,
        depth: u32,
        is_apart: &impl Fn(usize) -> bool,
        fits: &impl Fn(usize) -> bool,
    ) -> Option<usize> {
        if self.left[k] == 0 || is_apart(k) {
            return None;
        }
        if depth == 0 {
            return self.order[range].iter().copied().find(|&i| self.is_left(i) && fits(i));
        }
        let middle = range.start + range.len() / 2;
        let first = self.find_in(2 * k + 1, range.start..middle, depth - 1, is_apart, fits);
        first.or_else(|| self.find_in(2 * k + 2, middle..range.end, depth - 1, is_apart, fits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shape::testing::Random;
    use glam::{DAffine3, DQuat};

    fn fan(n: u32) -> Vec<[u32; 3]> {
        (2..n).map(|k| [0, k - 1, k]).collect()
    }

    /// Half the length of the sum of all, and the sum of the halves: the same where none is turned or overlaps another.
    fn areas(positions: &[DVec3], triangles: &[[u32; 3]]) -> [f64; 2] {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            0.5 * (b - a).cross(c - a)
        };
        [triangles.iter().map(area).sum::<DVec3>().length(), triangles.iter().map(|t| area(t).length()).sum()]
    }

    fn flat(corners: &[[f64; 2]]) -> Vec<DVec3> {
        corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
    }

    /// Stars of 4 to 40 corners with radii from 0.1 to 1, turned and moved in space and begun at any corner: the triangles are as
    /// many, and their areas add up to that of the polygon. That differs by the rounding of corners at 10 m, 2⁻⁴⁹, times
    /// the perimeter, below 80.
    #[test]
    fn concave_polygons_are_covered_once() {
        let mut random = Random::new(5);
        let mut cut = 0;
        for n in 4..=40u32 {
            for _ in 0..20 {
                let place = DAffine3::from_rotation_translation(
                    DQuat::from_rotation_arc(DVec3::Z, random.direction()),
                    10.0 * random.direction(),
                );
                let corner = |k: u32| {
                    let angle = std::f64::consts::TAU * f64::from(k) / f64::from(n);
                    let radius = 0.1 + 0.9 * random.uniform();
                    place.transform_point3(radius * DVec3::new(libm::cos(angle), libm::sin(angle), 0.0))
                };
                let positions: Vec<DVec3> = (0..n).map(corner).collect();
                let mut triangles = fan(n);
                unfold(&positions, &mut triangles);
                let [whole, parts] = areas(&positions, &triangles);
                assert!((parts - whole).abs() < 80.0 / (1u64 << 49) as f64, "{n}: {whole} {parts}");
                assert_eq!(triangles.len(), n as usize - 2);
                cut += u32::from(triangles != fan(n));
            }
        }
        assert!(cut > 400, "{cut}");
    }

    /// A comb with teeth of four corners each, 1 wide and 1 to 7 high, on a back that is 1 high; and a band that goes up and down by
    /// 50, 1 high everywhere. All are whole numbers, and so are twice the areas. In cubic time the band would take minutes.
    #[test]
    fn polygons_of_ten_thousand_corners_are_covered_in_little_time() {
        let begin = std::time::Instant::now();
        let teeth = 2499;
        let end = f64::from(2 * teeth);
        let height = |k: i32| f64::from(1 + k % 7);
        let tooth = |k: i32| {
            let (x, top) = (f64::from(2 * k), 1.0 + height(k));
            [[x + 1.0, 1.0], [x + 1.0, top], [x, top], [x, 1.0]]
        };
        let back = [[0.0, 0.0], [end, 0.0], [end, 1.0]];
        let comb: Vec<[f64; 2]> = back.into_iter().chain((0..teeth).rev().flat_map(tooth)).collect();
        let edge = |k: i32, above: f64| [f64::from(k), above + if k % 2 == 0 { 0.0 } else { 50.0 }];
        let band = (0..5000).map(|k| edge(k, 0.0)).chain((0..5000).rev().map(|k| edge(k, 1.0))).collect();
        for (polygon, area) in [(comb, end + (0..teeth).map(height).sum::<f64>()), (band, 4999.0)] {
            let mut triangles = fan(polygon.len() as u32);
            unfold(&flat(&polygon), &mut triangles);
            assert_eq!(areas(&flat(&polygon), &triangles), [area; 2]);
        }
        assert!(begin.elapsed() < std::time::Duration::from_secs(20));
    }

    /// Rounded to six digits, a circle is nowhere exactly convex; a star is not at all. Of 100,000 corners each, in a plane that no axis
    /// lies in: where every ear looks at every corner, that takes more than half a minute each. No triangle is turned, so that the
    /// halves add up to the whole, but for what lies off the plane: a corner by up to 1e-6, over sides of a length of 6 and, in the
    /// star, of up to 1 each, of which the squares count.
    #[test]
    fn polygons_of_a_hundred_thousand_corners_are_covered_in_little_time() {
        let begin = std::time::Instant::now();
        let mut random = Random::new(7);
        let n = 100_000;
        for least in [1.0, 0.1] {
            let mut corner = |k: u32| {
                let angle = std::f64::consts::TAU * f64::from(k) / f64::from(n);
                let radius = least + (1.0 - least) * random.uniform();
                let (x, y) = (radius * libm::cos(angle), radius * libm::sin(angle));
                let round = |x: f64| (1e6 * x).round() / 1e6;
                DVec3::new(round(x), round(0.8 * y), round(0.6 * y))
            };
            let positions: Vec<DVec3> = (0..n).map(&mut corner).collect();
            let mut triangles = fan(n);
            unfold(&positions, &mut triangles);
            assert_ne!(triangles, fan(n));
            let [whole, parts] = areas(&positions, &triangles);
            assert!(parts > whole * (1.0 - 1e-9) && parts < whole * (1.0 + 1e-3), "{whole} {parts}");
        }
        assert!(begin.elapsed() < std::time::Duration::from_secs(20), "{:?}", begin.elapsed());
    }

    /// A square ring, cut open along a line that is passed twice; and a comb with corners on straight lines.
    #[test]
    fn polygons_that_touch_themselves_are_covered_once() {
        let ring = [[0., 0.], [4., 0.], [4., 4.], [0., 4.], [0., 0.], [1., 1.], [1., 3.], [3., 3.], [3., 1.], [1., 1.]];
        let comb = [[0., 0.], [1., 0.], [5., 0.], [5., 2.], [4., 2.], [4., 1.], [3., 1.], [2., 1.], [2., 2.], [0., 2.]];
        for (polygon, area) in [(flat(&ring), 12.0), (flat(&comb), 8.0)] {
            for start in 0..polygon.len() {
                let mut positions = polygon.clone();
                positions.rotate_left(start);
                let mut triangles = fan(positions.len() as u32);
                unfold(&positions, &mut triangles);
                assert_eq!(areas(&positions, &triangles), [area; 2], "{start}");
            }
        }
    }

    /// Where the fan fits it stays, also with a corner on an edge; and so it does where nothing would: a bow tie, and corners
    /// that are not there.
    #[test]
    fn other_polygons_stay_fans() {
        let convex = [[0., 0.], [1., 0.], [2., 0.], [2., 2.], [0., 2.]];
        let arrow = [[0., 0.], [2., -1.], [1., 0.], [2., 1.]];
        let tie = [[0., 0.], [2., 2.], [2., 0.], [0., 3.]];
        for polygon in [&convex[..], &arrow, &tie] {
            let n = polygon.len() as u32;
            let mut triangles = fan(n);
            unfold(&flat(polygon), &mut triangles);
            assert_eq!(triangles, fan(n));
        }
        let mut nowhere = vec![[0, 1, 2], [0, 2, 9]];
        unfold(&flat(&convex), &mut nowhere);
        assert_eq!(nowhere, [[0, 1, 2], [0, 2, 9]]);
    }
}
