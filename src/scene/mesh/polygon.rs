//! Polygons as triangles: a fan about the first corner, or, where that does not fit, ears that are cut off one by one (Meisters
//! 1975, "Polygons Have Ears").

use glam::DVec3;

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
    for left in (4..=corners.len()).rev() {
        // Corners on a straight line are left to the last: an ear of them is flat.
        let found = rest.find(from, left, |rest, i| rest.turns[i] > 0.0 && rest.is_free(i));
        let Some(i) = found.or_else(|| rest.find(from, left, |rest, i| rest.turns[i] == 0.0)) else { return };
        ears.push(rest.ear(i).map(|i| corners[i]));
        from = rest.cut(i);
    }
    let last: Vec<u32> = corners.iter().zip(&rest.is_left).filter(|(_, is_left)| **is_left).map(|(&v, _)| v).collect();
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
    is_left: Vec<bool>,
    /// The corners on both sides, of those that are left; of others, when they were cut off.
    before: Vec<usize>,
    after: Vec<usize>,
    /// By how much the ear at a corner is turned as the whole is.
    turns: Vec<f64>,
    /// No corner from an ear's end to this one lies in it. That stays so when others are cut off: until its own ends change each ear
    /// looks once at each corner, which takes quadratic time in all.
    free_to: Vec<usize>,
    /// Whether this one does.
    is_held: Vec<bool>,
}

impl Rest {
    fn new(positions: Vec<DVec3>, normal: DVec3) -> Rest {
        let n = positions.len();
        let mut rest = Rest {
            positions,
            normal,
            is_left: vec![true; n],
            before: (0..n).map(|i| (i + n - 1) % n).collect(),
            after: (0..n).map(|i| (i + 1) % n).collect(),
            turns: vec![0.0; n],
            free_to: vec![0; n],
            is_held: vec![false; n],
        };
        (0..n).for_each(|i| rest.renew(i));
        rest
    }

    /// Corner `i` between its neighbours.
    fn ear(&self, i: usize) -> [usize; 3] {
        [self.before[i], i, self.after[i]]
    }

    fn turn(&self, [a, b, c]: [DVec3; 3]) -> f64 {
        (b - a).cross(c - a).dot(self.normal)
    }

    fn renew(&mut self, i: usize) {
        self.turns[i] = self.turn(self.ear(i).map(|i| self.positions[i]));
        self.free_to[i] = self.after[self.after[i]];
        self.is_held[i] = false;
    }

    /// The first of the `left` corners that fits, from `from` on.
    fn find(&mut self, from: usize, left: usize, mut fits: impl FnMut(&mut Rest, usize) -> bool) -> Option<usize> {
        let mut i = from;
        for _ in 0..left {
            if fits(self, i) {
                return Some(i);
            }
            i = self.after[i];
        }
        None
    }

    /// Whether no corner lies in the ear at corner `i`.
    fn is_free(&mut self, i: usize) -> bool {
        let mut other = self.free_to[i];
        if self.is_held[i] && self.is_left[other] {
            return false;
        }
        let end = self.before[i];
        let [a, b, c] = self.ear(i).map(|i| self.positions[i]);
        let edges = [(a, b - a), (b, c - b), (c, a - c)];
        let is_in = |other: usize| {
            let v = self.positions[other];
            let holds = edges.iter().all(|&(from, along)| along.cross(v - from).dot(self.normal) >= 0.0);
            holds && self.is_left[other] && ![a, b, c].contains(&v)
        };
        while other != end && !is_in(other) {
            other = self.after[other];
        }
        self.free_to[i] = other;
        self.is_held[i] = other != end;
        other == end
    }

    /// Cuts off corner `i`, and gives the one after it.
    fn cut(&mut self, i: usize) -> usize {
        let [before, _, after] = self.ear(i);
        self.is_left[i] = false;
        self.after[before] = after;
        self.before[after] = before;
        self.renew(before);
        self.renew(after);
        after
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
