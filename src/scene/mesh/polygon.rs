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
    let mut corners: Vec<u32> = [a, b].into_iter().chain(fan.iter().map(|t| t[2])).collect();
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
    // Where the last was cut: from there the search goes on, so that the triangles do not all meet in one corner.
    let mut from = 0;
    while corners.len() > 3 {
        let n = corners.len();
        let ear = |i: usize| [corners[(i + n - 1) % n], corners[i], corners[(i + 1) % n]];
        let is_free = |[a, b, c]: [u32; 3]| {
            let holds = |v: u32| [[a, b, v], [b, c, v], [c, a, v]].into_iter().all(|t| turn(t) >= 0.0);
            !corners.iter().any(|&v| ![at(a), at(b), at(c)].contains(&at(v)) && holds(v))
        };
        let all = || (from..from + n).map(|i| i % n);
        // Corners on a straight line are left to the last: an ear of them is flat.
        let found = all().find(|&i| turn(ear(i)) > 0.0 && is_free(ear(i)));
        let Some(i) = found.or_else(|| all().find(|&i| turn(ear(i)) == 0.0)) else { return };
        ears.push(ear(i));
        corners.remove(i);
        from = i % corners.len();
    }
    let last = [corners[0], corners[1], corners[2]];
    if turn(last) >= 0.0 {
        ears.push(last);
        fan.copy_from_slice(&ears);
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
