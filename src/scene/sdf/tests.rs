use super::*;
use crate::math::Departure;
use crate::scene::shape::testing::Random;

const FAR: f64 = f64::INFINITY;

/// A grid of `n` points along each axis of the unit cube with the values of `f`.
fn grid(n: usize, mut f: impl FnMut(DVec3) -> f64) -> Grid {
    let h = 1.0 / (n - 1) as f64;
    let mut values = Vec::new();
    for z in 0..n {
        for y in 0..n {
            for x in 0..n {
                values.push(f(DVec3::new(x as f64, y as f64, z as f64) * h) as f32);
            }
        }
    }
    Grid { size: [n; 3], channels: 1, min: DVec3::ZERO, max: DVec3::ONE, values }
}

/// `grid` where `map` puts it.
fn placed(grid: &Grid, map: &DAffine3, normals: SdfNormals) -> Result<SdfGrid, String> {
    SdfGrid::new(Distances::new(grid.clone())?, map, normals)
}

fn sdf(grid: &Grid) -> SdfGrid {
    placed(grid, &DAffine3::IDENTITY, SdfNormals::Analytic).unwrap()
}

fn sphere(n: usize) -> SdfGrid {
    sdf(&grid(n, |p| (p - 0.5).length() - 0.3))
}

/// Values without any order, positive on the sides: a closed sponge.
fn sponge(n: usize, random: &mut Random) -> Grid {
    grid(n, |p| {
        let side = p.min_element() == 0.0 || p.max_element() == 1.0;
        if side { 0.1 + random.uniform() } else { random.range(-1.0, 1.0) }
    })
}

/// A ray through the unit cube.
fn through(random: &mut Random) -> Ray {
    let target = DVec3::new(random.uniform(), random.uniform(), random.uniform());
    let direction = random.direction();
    Ray::new(target - direction * random.range(2.0, 3.0), direction)
}

fn leaving(sdf: &SdfGrid, hit: SdfHit, ray: &Ray, direction: DVec3) -> Ray {
    let s = sdf.surface(ray.at(hit.t), hit.cell);
    Ray::leaving(s.point, s.scale, s.normal, direction, Departure::new(0, hit.cell))
}

/// The interpolant of the distance to a sphere of radius r is off by at most h²/8 · (sum of its second
/// derivatives along the axes, 2/(r − h) in the cells of the surface), so that the surface is off by about
/// h²/4(r − h) along the normal, and t by that over the cosine. Halving h quarters the greatest error.
#[test]
fn the_distance_to_a_sphere_makes_that_sphere_to_second_order() {
    let worst = |n: usize| {
        let sdf = sphere(n);
        let mut random = Random::new(5);
        let mut worst = 0.0f64;
        for _ in 0..20_000 {
            let direction = random.direction();
            let side = random.direction().cross(direction) * 0.2;
            let ray = Ray::new(DVec3::splat(0.5) + side - direction * 2.0, direction);
            let exact = 2.0 - (0.09 - side.length_squared()).sqrt();
            worst = worst.max((sdf.intersect(&ray, FAR, None).unwrap().t - exact).abs());
        }
        worst
    };
    let errors = [17, 33, 65].map(worst);
    // The cosine at 0.2 of 0.3 off the centre is √5/3.
    let bound = |n: f64| {
        let h = 1.0 / (n - 1.0);
        h * h / (4.0 * (0.3 - h)) * 3.0 / 5f64.sqrt()
    };
    assert!(errors[0] < bound(17.0) && errors[1] < bound(33.0) && errors[2] < bound(65.0), "{errors:?}");
    for ratio in [errors[0] / errors[1], errors[1] / errors[2]] {
        assert!((3.5..4.5).contains(&ratio), "{errors:?}");
    }
}

/// The first crossing by brute force: the interpolant at 50 points of each stretch between planes, then halving.
fn first_crossing(sdf: &SdfGrid, ray: &Ray) -> Option<f64> {
    let n = sdf.cells();
    let value = |t: f64| sdf.value(ray.at(t) * n);
    let mut planes: Vec<f64> = (0..3)
        .flat_map(|a| (0..=n[a] as usize).map(move |i| (a, i as f64)))
        .map(|(a, i)| (i / n[a] - ray.origin[a]) / ray.direction[a])
        .filter(|&t| {
            let p = ray.at(t);
            p.cmpge(DVec3::splat(-1e-12)).all() && p.cmple(DVec3::splat(1.0 + 1e-12)).all()
        })
        .collect();
    planes.sort_by(f64::total_cmp);
    let mut last = (*planes.first()?, value(*planes.first()?));
    for pair in planes.windows(2) {
        for i in 1..=50 {
            let t = pair[0] + (pair[1] - pair[0]) * f64::from(i) / 50.0;
            let v = value(t);
            if v * last.1 < 0.0 {
                let (mut a, mut b) = (last.0, t);
                for _ in 0..60 {
                    let m = 0.5 * (a + b);
                    if value(m) * last.1 < 0.0 { b = m } else { a = m }
                }
                return Some(b);
            }
            last = (t, v);
        }
    }
    None
}

/// Against brute force. Where the two differ, a hit that is nearer must be a zero that the samples stepped over: the
/// interpolant is of size one and rounded some twenty times at points rounded to 4 ε of three lengths, each of
/// which counts for up to 2·7 in value.
#[test]
fn the_nearest_crossing_of_a_sponge_is_found() {
    let mut random = Random::new(6);
    let mut stepped_over = 0;
    for _ in 0..40 {
        let sdf = sdf(&sponge(8, &mut random));
        for _ in 0..250 {
            let ray = through(&mut random);
            let (found, expected) = (sdf.intersect(&ray, FAR, None), first_crossing(&sdf, &ray));
            let zero = |t: f64| sdf.value(ray.at(t) * 7.0).abs() < 1e-13;
            match (found, expected) {
                (Some(hit), Some(t)) if (hit.t - t).abs() < 1e-9 => assert!(zero(hit.t), "{hit:?} {t}"),
                (Some(hit), t) if t.is_none_or(|t| hit.t < t) => {
                    assert!(zero(hit.t), "{hit:?} {t:?}");
                    stepped_over += 1;
                }
                (None, None) => {}
                (found, expected) => panic!("{found:?} {expected:?} {ray:?}"),
            }
        }
    }
    assert!(stepped_over < 100, "{stepped_over}");
}

/// Of a sphere and of a sponge, in single precision and for each cell by itself: the surface is found where the robust walk
/// finds it, to 10⁻⁴, which is some 500 roundings of the distances up to 3 and leaves room for cosines; and where the walk
/// finds none, none of the cells has one. Nine rays of ten at least; that is 99 here.
#[test]
fn the_textbook_cubic_is_the_same_surface() {
    let mut random = Random::new(10);
    for sdf in [sphere(9), sdf(&sponge(9, &mut random))] {
        let cells = 8 * 8 * 8;
        let (mut same, mut none, mut differ) = (0, 0, 0);
        for _ in 0..4000 {
            let ray = through(&mut random);
            let meet = |cell| sdf.meet_plain(cell, ray.origin.as_vec3(), ray.direction.as_vec3());
            match sdf.intersect(&ray, FAR, None) {
                Some(hit) if meet(hit.cell).is_some_and(|t| (f64::from(t) - hit.t).abs() < 1e-4) => same += 1,
                None if (0..cells).all(|cell| meet(cell).is_none()) => none += 1,
                _ => differ += 1,
            }
        }
        assert!(same > 1000 && none > 50 && differ * 100 < same + none, "{same} {none} {differ}");
    }
}

/// A walk along a ray through a closed surface goes in and out by turns, whatever cells and creases lie
/// on the way, and ends outside. A surface met again, or a crack, breaks the turns. Rays that leave do so
/// at cosines down to 1e-6.
#[test]
fn rays_go_in_and_out_by_turns() {
    let mut random = Random::new(7);
    let closed = [sphere(20), sdf(&sponge(10, &mut random)), sdf(&sponge(4, &mut random))];
    assert!(closed.iter().all(SdfGrid::is_closed));
    for i in 0..30_000 {
        let sdf = &closed[i % 3];
        let mut ray = through(&mut random);
        let Some(mut hit) = sdf.intersect(&ray, FAR, None) else { continue };
        // A ray from the hit, anywhere.
        let s = sdf.surface(ray.at(hit.t), hit.cell);
        let frame = Frame::from_normal(s.normal);
        let (sin_phi, cos_phi) = crate::math::trig::sin_cos_turn(random.uniform());
        let cos = random.log_uniform(-6.0, 0.0) * if random.uniform() < 0.5 { -1.0 } else { 1.0 };
        let sin = (1.0 - cos * cos).sqrt();
        let direction = frame.to_world(DVec3::new(sin * cos_phi, sin * sin_phi, cos)).normalize();
        let mut outside = cos > 0.0;
        let mut crossings = 0;
        loop {
            ray = leaving(sdf, hit, &ray, direction);
            let Some(next) = sdf.intersect(&ray, FAR, Some(hit.cell)) else { break };
            let s = sdf.surface(ray.at(next.t), next.cell);
            let cos = s.normal.dot(direction);
            // Within the turn of the normal over the step off the surface, a side is not known.
            if cos.abs() < 1e-9 {
                outside = true;
                break;
            }
            assert_eq!(cos < 0.0, outside, "{i} {next:?} {cos} {ray:?}");
            outside = cos > 0.0;
            hit = next;
            crossings += 1;
            assert!(crossings < 200);
        }
        assert!(outside, "{i}: a ray ends inside: {ray:?} {hit:?}");
    }
}

/// Values that grow with z alone make the plane z = ½ (of 5 points, on a layer of them) and z = 0.3;
/// rays down the edges and corners of cells, and along diagonals, all meet it, once.
#[test]
fn there_are_no_cracks_between_cells() {
    for height in [0.5, 0.3] {
        let plane = sdf(&grid(5, |p| p.z - height));
        assert!(!plane.is_closed());
        for x in 1..16 {
            for y in 1..16 {
                let target = DVec3::new(f64::from(x) / 16.0, f64::from(y) / 16.0, height);
                let dx = DVec3::new(0.25 * f64::from(x % 3 - 1), 0.25 * f64::from(y % 3 - 1), -1.0);
                let ray = Ray::new(target - dx * 4.0, dx.normalize());
                let hit = plane.intersect(&ray, FAR, None).unwrap();
                assert!((ray.at(hit.t) - target).abs().max_element() < 1e-7, "{target}");
                let on = leaving(&plane, hit, &ray, ray.direction);
                assert_eq!(plane.intersect(&on, FAR, Some(hit.cell)), None);
                let back = leaving(&plane, hit, &ray, -ray.direction);
                assert_eq!(plane.intersect(&back, FAR, Some(hit.cell)), None);
            }
        }
    }
}

/// Powers of two change nothing but exponents.
#[test]
fn scales_by_powers_of_two_give_the_same_bits() {
    let mut random = Random::new(8);
    let grid = sponge(9, &mut random);
    let unit = sdf(&grid);
    for k in [-150, -20, 30, 170] {
        let s = 2f64.powi(k);
        let scaled = placed(&grid, &DAffine3::from_scale(DVec3::splat(s)), SdfNormals::Analytic).unwrap();
        for _ in 0..500 {
            let ray = through(&mut random);
            let big = Ray::new(ray.origin * s, ray.direction);
            let (a, b) = (unit.intersect(&ray, FAR, None), scaled.intersect(&big, FAR, None));
            assert_eq!(a.map(|h| (h.t * s, h.cell)), b.map(|h| (h.t, h.cell)));
            if let (Some(a), Some(b)) = (a, b) {
                let (p, q) = (unit.surface(ray.at(a.t), a.cell), scaled.surface(big.at(b.t), b.cell));
                assert_eq!((p.point * s, p.normal), (q.point, q.normal));
            }
        }
    }
}

/// Under any affine map hits stay where they were, in t, and normals stay normal to the surface.
#[test]
fn stretched_and_sheared_grids_are_the_same_surface() {
    let mut random = Random::new(9);
    let grid = grid(17, |p| (p - 0.5).length() - 0.3);
    let unit = placed(&grid, &DAffine3::IDENTITY, SdfNormals::Smooth).unwrap();
    let (mut met, mut apart) = (0, 0);
    for _ in 0..100 {
        let m = DMat3::from_cols(random.direction(), random.direction() * 3.0, random.direction() * 0.5);
        if m.determinant().abs() < 0.1 {
            continue;
        }
        let map = DAffine3 { matrix3: m, translation: random.direction() * 10.0 };
        let moved = placed(&grid, &map, SdfNormals::Smooth).unwrap();
        for _ in 0..50 {
            let ray = through(&mut random);
            let image = Ray::new(map.transform_point3(ray.origin), m * ray.direction);
            let (a, b) = (unit.intersect(&ray, FAR, None), moved.intersect(&image, FAR, None));
            apart += u32::from(a.is_some() != b.is_some());
            let (Some(a), Some(b)) = (a, b) else { continue };
            let (p, q) = (unit.surface(ray.at(a.t), a.cell), moved.surface(image.at(b.t), b.cell));
            if p.normal.dot(ray.direction).abs() < 0.1 || a.cell != b.cell {
                continue;
            }
            assert!((a.t - b.t).abs() < 1e-12, "{a:?} {b:?}");
            // A normal is orthogonal to the images of the tangents, on the side of the image of the old normal.
            let f = Frame::from_normal(p.normal);
            assert!(
                q.normal.dot((m * f.s).normalize()).abs() < 1e-10 && q.normal.dot((m * f.t).normalize()).abs() < 1e-10
            );
            assert!(q.normal.dot(m * f.n) > 0.0);
            // Of a sphere the smooth normal is nearly that of the sphere: the difference across a cell of width h, a
            // distance h off, turns it by up to h/r of 1/16 over 0.3, mostly undone by the cell on the other side.
            assert!(p.shading_normal.dot((p.point - 0.5).normalize()) > 0.995, "{}", p.shading_normal);
            let image = (m.inverse().transpose() * p.shading_normal).normalize();
            assert!((q.shading_normal - image).abs().max_element() < 1e-9);
            met += 1;
        }
    }
    assert!(met > 1000 && apart == 0, "{met} {apart}");
}

#[test]
fn a_grid_without_a_surface_is_refused_in_words() {
    let fault = |grid: &Grid| placed(grid, &DAffine3::IDENTITY, SdfNormals::Smooth).unwrap_err();
    assert!(fault(&grid(3, |_| 1.0)).contains("both signs"));
    assert!(fault(&grid(3, |_| -1.0)).contains("both signs"));
    assert!(fault(&grid(3, |_| 0.0)).contains("both signs, found zeros alone"));
    let flat = Grid { size: [1, 3, 9], ..grid(3, |_| 1.0) };
    assert!(fault(&flat).contains("found 1 × 3 × 9"));
    let channels = Grid { size: [3, 3, 1], channels: 3, ..grid(3, |_| 1.0) };
    assert!(fault(&channels).contains("one channel, found 3"));
}

/// Distances, geometric and smooth normals read off Mitsuba 3.9.1 (f32) for the grid of the cross-validation.
#[test]
fn smooth_normals_are_those_of_mitsuba() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/cross_validate/mitsuba/assets/ring_and_ball.vol");
    let grid = Grid::load(std::path::Path::new(file)).unwrap();
    let scale = DVec3::new(2.4, 2.0, 2.2);
    let map = DAffine3::from_scale(scale) * DAffine3::from_translation(DVec3::new(-0.5, 0.0, -0.5));
    let sdf = placed(&grid, &map, SdfNormals::Smooth).unwrap();
    let cases = [
        (
            [0.004_035_927, -0.028_062_772, -0.999_598_03],
            5.245_332_2,
            [0.0, 0.733_491, 0.679_699],
            [0.042_164_2, 0.736_061_5, 0.675_600_3],
        ),
        (
            [0.156_451_87, -0.173_420_5, -0.972_341_6],
            5.206_315_5,
            [0.792_165_1, 0.033_085_1, 0.609_409_5],
            [0.831_995_5, -0.169_039_1, 0.528_402_5],
        ),
        (
            [0.117_923_69, -0.156_182_18, -0.980_663_6],
            4.929_798_6,
            [0.454_712_3, 0.600_467, 0.657_781_2],
            [0.551_369_4, 0.368_508_4, 0.748_460_6],
        ),
        (
            [-0.016_230_276, -0.213_906_33, -0.976_719_3],
            4.831_676_5,
            [0.0, -0.700_059, 0.714_085],
            [-0.058_675_7, -0.806_037_4, 0.588_949],
        ),
    ];
    for (d, t, normal, smooth) in cases {
        let ray = Ray::new(DVec3::new(0.0, 1.7, 5.5), DVec3::from(d));
        let hit = sdf.intersect(&ray, FAR, None).unwrap();
        let s = sdf.surface(ray.at(hit.t), hit.cell);
        assert!((hit.t - t).abs() < 1e-5, "{hit:?} {t}");
        assert!((s.normal - DVec3::from(normal)).abs().max_element() < 1e-4, "{} {normal:?}", s.normal);
        assert!((s.shading_normal - DVec3::from(smooth)).abs().max_element() < 1e-4, "{} {smooth:?}", s.shading_normal);
    }
}

/// Each cell is told its distance to the nearest that has a piece of the surface, along the axis where that is farthest, by looking at
/// all of them.
#[test]
fn cells_know_how_far_the_surface_is() {
    let mut random = Random::new(8);
    for cells in [[1, 1, 1], [300, 1, 2], [7, 5, 6], [1, 9, 4], [12, 3, 1]] {
        let [nx, ny, nz] = cells;
        let place = |i: usize| [i % nx, i / nx % ny, i / nx / ny];
        for share in [0.0, 0.01, 0.2] {
            let all = nx * ny * nz;
            let surface: Vec<usize> = (0..all).filter(|&i| i == 0 || random.uniform() < share).collect();
            let mut found = vec![u8::MAX; all];
            surface.iter().for_each(|&i| found[i] = 0);
            spread(&mut found, cells);
            let between = |a: usize, b: usize| (0..3).map(|k| place(a)[k].abs_diff(place(b)[k])).max().unwrap();
            let expected = |i: usize| surface.iter().map(|&s| between(i, s)).min().unwrap().min(255) as u8;
            assert_eq!(found, (0..all).map(expected).collect::<Vec<u8>>(), "{cells:?}");
        }
    }
}
