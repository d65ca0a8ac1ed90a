use super::*;
use crate::math::Departure;
use crate::scene::shape::testing::Random;

const FAR: f64 = f64::INFINITY;

fn curves(points: &[ControlPoint], basis: Basis) -> Curves {
    Curves::new(&[points.to_vec()], &DAffine3::IDENTITY, basis).unwrap()
}

fn random_point(random: &mut Random, radius: f64) -> ControlPoint {
    let p = random.direction() * random.uniform();
    [p.x, p.y, p.z, radius]
}

/// A helix about z, radius one, pitch one a turn, of the given thickness.
fn helix(thickness: f64) -> Vec<ControlPoint> {
    (0..40)
        .map(|i| {
            let a = f64::from(i) * 0.5;
            [a.cos(), a.sin(), a / std::f64::consts::TAU, thickness]
        })
        .collect()
}

/// A ray from afar at a point near `target`.
fn ray_at(target: DVec3, distance: f64, random: &mut Random) -> Ray {
    let direction = random.direction();
    Ray::new(target - direction * distance, direction)
}

fn leaving(curves: &Curves, hit: CurveHit, ray: &Ray, direction: DVec3) -> Ray {
    let s = curves.surface(ray.at(hit.t), hit.segment, hit.v);
    Ray::leaving(s.point, s.scale, s.normal, direction, Departure::new(0, hit.segment))
}

/// The ray enters the hull at the least over v of where it enters the ball of v, a convex function: halving by thirds
/// finds the least, and t there is known to the square root of the width that is left.
#[test]
fn a_round_cone_is_entered_where_its_first_ball_is() {
    let mut random = Random::new(21);
    let (mut hits, mut misses) = (0, 0);
    for i in 0..30_000 {
        let thin = if i % 2 == 0 { 1.0 } else { 1e-3 };
        let (r0, r1) = (random.uniform() * 0.5 * thin, random.uniform() * 0.5 * thin);
        let (a, b) = (random_point(&mut random, r0), random_point(&mut random, r1));
        let cone = cone_between(a, b);
        let target = cone.center(random.range(-0.2, 1.2)) + random.direction() * random.uniform() * thin * 0.6;
        let mut ray = ray_at(target, 3.0, &mut random);
        if i % 7 == 0 {
            // Along the axis, or nearly.
            ray.direction = (cone.axis + random.direction() * random.log_uniform(-12.0, -1.0)).normalize();
            ray.origin = target - ray.direction * 3.0;
        }
        if i % 7 == 1 {
            // At a right angle to it, or nearly.
            let across = cone.axis.cross(random.direction()).normalize();
            ray.direction = (across + random.direction() * random.log_uniform(-18.0, -5.0)).normalize();
            ray.origin = target - ray.direction * 3.0;
        }
        let enter = |v: f64| {
            let (w, r) = (cone.center(v) - ray.origin, cone.radius(v));
            let t = w.dot(ray.direction);
            let s = r * r - (w - ray.direction * t).length_squared();
            // Outside the ball, the farther the greater, which keeps the search going.
            if s >= 0.0 { t - s.sqrt() } else { 1e3 - s }
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..200 {
            let (p, q) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if enter(p) < enter(q) { high = q } else { low = p }
        }
        let least = enter(0.5 * (low + high)).min(enter(0.0)).min(enter(1.0));
        match cone.entry(ray.origin, ray.direction) {
            Some((t, v)) => {
                // On the ball of v to rounding: 1e-15 of the distance 4, over the slant.
                let away = ray.at(t) - cone.center(v);
                assert!(
                    (away.length() - cone.radius(v)).abs() < 2e-14,
                    "{i} {t} {v} {}",
                    away.length() - cone.radius(v)
                );
                let slant = (away.dot(ray.direction) / cone.radius(v)).abs();
                assert!(least > 500.0 || (t - least).abs() < 1e-13 / slant.max(1e-7), "{i} {t} {least} {slant}");
                hits += 1;
            }
            None => {
                // No ball is met but by its rim: s below the rounding of squares of 1e-15 · 4.
                assert!(
                    least > 500.0
                        || (0..=1000).all(|k| {
                            let (w, r) =
                                (cone.center(f64::from(k) / 1000.0) - ray.origin, cone.radius(f64::from(k) / 1000.0));
                            let off = w - ray.direction * w.dot(ray.direction);
                            r - off.length() < 1e-9
                        }),
                    "{i} {least}"
                );
                misses += 1;
            }
        }
    }
    assert!(hits > 10_000 && misses > 3_000, "{hits} {misses}");
}

/// How far inside the nearest circles of a B-spline a point is: positive inside. The curve is searched at 400 points a
/// segment for where (p − c)·c' changes sign, which is then halved.
fn inside(control: &[ControlPoint], p: DVec3) -> f64 {
    let mut best = f64::NEG_INFINITY;
    for (i, s) in control.windows(4).enumerate() {
        let tube = tube_of([s[0], s[1], s[2], s[3]], i as u32);
        let at = |u: f64| {
            let [c, d, _] = tube.at(u);
            let away = p - DVec3::new(c[0], c[1], c[2]);
            (away.dot(DVec3::new(d[0], d[1], d[2])), c[3] - away.length())
        };
        let mut last = at(0.0).0;
        for k in 1..=40 {
            let u = f64::from(k) / 40.0;
            let now = at(u).0;
            if (now < 0.0) != (last < 0.0) {
                let (mut a, mut b) = (u - 1.0 / 40.0, u);
                for _ in 0..50 {
                    let m = 0.5 * (a + b);
                    if (at(m).0 < 0.0) == (last < 0.0) { a = m } else { b = m }
                }
                best = best.max(at(b).1);
            }
            last = now;
        }
    }
    best
}

/// Of random tubes, some with a changing radius: before the hit all of the ray is outside, just behind it inside, and
/// where there is no hit all is outside; except that a ray may pass an open end.
#[test]
fn a_tube_is_entered_where_the_circles_begin() {
    let mut random = Random::new(22);
    let (mut hits, mut misses) = (0, 0);
    for i in 0..150 {
        let thickness = random.log_uniform(-2.5, -0.7);
        let mut control: Vec<ControlPoint> = (0..6)
            .map(|k| {
                let p = DVec3::new(f64::from(k) * 0.6, 0.0, 0.0) + random.direction() * 0.5;
                [p.x, p.y, p.z, thickness * if i % 2 == 0 { 1.0 } else { random.range(0.5, 1.0) }]
            })
            .collect();
        // Closed by a radius that shrinks to nothing.
        for k in [0, 1, 2, 3, 4, 5] {
            if !(2..=3).contains(&k) {
                control[k][3] = 0.0;
            }
        }
        let all = curves(&control, Basis::BSpline);
        for _ in 0..4 {
            let axis = tube_of([control[1], control[2], control[3], control[4]], 0).at(random.uniform())[0];
            let target =
                DVec3::new(axis[0], axis[1], axis[2]) + random.direction() * thickness * random.uniform() * 1.2;
            let ray = ray_at(target, 4.0, &mut random);
            let end = match all.closest(&ray, FAR) {
                Some(hit) => {
                    let s = all.surface(ray.at(hit.t), hit.segment, hit.v);
                    assert!((s.point - ray.at(hit.t)).length() < 1e-13 / s.normal.dot(ray.direction).abs().max(1e-6));
                    assert!(s.normal.dot(ray.direction) < 0.0);
                    if s.normal.dot(ray.direction) < -0.05 {
                        let depth = inside(&control, ray.at(hit.t + 1e-3 * thickness));
                        assert!(depth > 0.0, "{i} {depth} {hit:?} {ray:?}");
                    }
                    hits += 1;
                    hit.t
                }
                None => {
                    misses += 1;
                    8.0
                }
            };
            for k in 0..50 {
                let t = end * (f64::from(k) + 0.5) / 50.0;
                let depth = inside(&control, ray.at(t));
                assert!(depth < 1e-12, "{i}: at {t} before {end} the ray is {depth} deep inside: {ray:?} {control:?}");
            }
        }
    }
    assert!(hits > 400 && misses > 20, "{hits} {misses}");
}

/// Of random curves whose radius changes, seen from four sizes away: single precision finds the entry that the robust
/// intersectors find, within a hundredth of the radius, and where they find none no segment has one; of nine rays of ten
/// at least, and that is 99 of a hundred here. Tubes may be thin, as the iteration subtracts the origin first. The
/// quadratic of a cone takes r² from squares of the distance, which are known to 4²·2⁻²⁴: a tenth of the square of 0.003.
#[test]
fn textbook_formulas_are_the_same_curves() {
    let mut random = Random::new(28);
    for (basis, thickness) in [(Basis::Linear, 0.1), (Basis::BSpline, 0.1), (Basis::BSpline, 0.003)] {
        let (mut same, mut none, mut differ) = (0, 0, 0);
        for _ in 0..200 {
            let control: Vec<ControlPoint> = (0..8)
                .map(|k| {
                    let p = DVec3::new(f64::from(k) * 0.3 - 1.0, 0.0, 0.0) + random.direction() * 0.3;
                    [p.x, p.y, p.z, thickness * random.range(0.5, 1.0)]
                })
                .collect();
            let all = curves(&control, basis);
            for _ in 0..50 {
                let k = 2 + (random.uniform() * 4.0) as usize;
                let on_axis = match basis {
                    Basis::Linear => cone_between(control[k], control[k + 1]).center(random.uniform()),
                    Basis::BSpline => {
                        let tube = tube_of([control[k - 2], control[k - 1], control[k], control[k + 1]], 0);
                        let [x, y, z, _] = tube.at(random.uniform())[0];
                        DVec3::new(x, y, z)
                    }
                };
                let aim = on_axis + random.direction() * thickness * 1.2 * random.uniform();
                let ray = ray_at(aim, 4.0, &mut random);
                let meet = |segment| all.meet_plain(segment, ray.origin.as_vec3(), ray.direction.as_vec3());
                match all.closest(&ray, FAR) {
                    Some(hit) => {
                        let limit = 0.01 * all.thickness(hit.segment, hit.v);
                        let is_same = meet(hit.segment).is_some_and(|t| (f64::from(t) - hit.t).abs() < limit);
                        if is_same { same += 1 } else { differ += 1 }
                    }
                    None if (0..all.segments()).all(|segment| meet(segment).is_none()) => none += 1,
                    None => differ += 1,
                }
            }
        }
        assert!(
            same > 2000 && none > 100 && differ * 100 < same + none,
            "{basis:?} {thickness} {same} {none} {differ}"
        );
    }
}

/// Every ray aimed at the middle of a bent curve meets it, at the joints of its segments too: 20 000 rays at a helix of
/// which every eighth aims exactly at a knot.
#[test]
fn curves_have_no_cracks() {
    let mut random = Random::new(23);
    for basis in [Basis::Linear, Basis::BSpline] {
        let control = helix(0.02);
        let all = curves(&control, basis);
        for i in 0..10_000 {
            let k = 4 + (random.uniform() * 30.0) as usize;
            let u = if i % 8 == 0 { 0.0 } else { random.uniform() };
            let target = match basis {
                Basis::Linear => cone_between(control[k], control[k + 1]).center(u),
                Basis::BSpline => {
                    let c = tube_of([control[k], control[k + 1], control[k + 2], control[k + 3]], 0).at(u)[0];
                    DVec3::new(c[0], c[1], c[2])
                }
            };
            let ray = ray_at(target, 5.0, &mut random);
            let hit = all.closest(&ray, FAR);
            // Not after the far side of the circle, seen at an angle of down to 0.02/the radius of curvature.
            assert!(hit.is_some_and(|h| h.t < 5.0 + 1.0), "{basis:?} {ray:?} {hit:?}");
            assert!(all.any(&ray, FAR));
        }
    }
}

/// A ray that leaves outward, at cosines from 1e-6, meets the curve again only where it has been outside in between,
/// and one that leaves inward stays inside: 20 000 rays, near the origin and far from it.
#[test]
fn curves_are_not_met_where_they_are_left() {
    let mut random = Random::new(24);
    for basis in [Basis::Linear, Basis::BSpline] {
        for offset in [0.0, 1e4] {
            let mut control = helix(0.1);
            for p in &mut control {
                p[0] += offset;
            }
            let all = curves(&control, basis);
            let mut met = 0;
            for _ in 0..5000 {
                let k = 4 + (random.uniform() * 30.0) as usize;
                let target = DVec3::new(control[k][0], control[k][1], control[k][2]) + random.direction() * 0.1;
                let ray = ray_at(target, 5.0, &mut random);
                let Some(hit) = all.closest(&ray, FAR) else { continue };
                let s = all.surface(ray.at(hit.t), hit.segment, hit.v);
                let frame = Frame::from_normal(s.normal);
                let (sin_phi, cos_phi) = crate::math::trig::sin_cos_turn(random.uniform());
                let cos = random.log_uniform(-6.0, 0.0);
                let sin = (1.0 - cos * cos).sqrt();
                let local = DVec3::new(sin * cos_phi, sin * sin_phi, cos);
                let out = leaving(&all, hit, &ray, frame.to_world(local).normalize());
                if let Some(next) = all.closest(&out, FAR) {
                    let n = all.surface(out.at(next.t), next.segment, next.v).normal;
                    assert!(n.dot(out.direction) < 0.0);
                    // To come back to a curve of curvature ~1 the normal turns by the cosine at least. To the linear
                    // curve's creases there is no such bound.
                    assert!(basis == Basis::Linear || next.t > 0.5 * cos, "{next:?} {cos} {out:?}");
                }
                let back = leaving(&all, hit, &ray, frame.to_world(-local).normalize());
                if let Some(next) = all.closest(&back, FAR) {
                    // Out through the far side and in again elsewhere, or into a piece of another segment.
                    assert!(next.segment != hit.segment || next.t > 1e-3, "{next:?} {back:?}");
                }
                met += 1;
            }
            assert!(met > 1000, "{basis:?} {offset}: {met}");
        }
    }
}

/// Powers of two change nothing but exponents, of linear curves and B-splines.
#[test]
fn scales_by_powers_of_two_give_the_same_bits() {
    let mut random = Random::new(25);
    for basis in [Basis::Linear, Basis::BSpline] {
        for k in [-120, -17, 40, 120] {
            let s = 2f64.powi(k);
            let scaled: Vec<ControlPoint> = helix(0.05).iter().map(|p| p.map(|x| x * s)).collect();
            let (one, big) = (curves(&helix(0.05), basis), curves(&scaled, basis));
            for _ in 0..500 {
                let target = random.direction() * random.range(0.9, 1.1) + DVec3::Z * random.range(0.0, 2.0);
                let ray = ray_at(target, 4.0, &mut random);
                let image = Ray::new(ray.origin * s, ray.direction);
                let (a, b) = (one.closest(&ray, FAR), big.closest(&image, FAR));
                assert_eq!(a.map(|h| (h.t * s, h.segment, h.v)), b.map(|h| (h.t, h.segment, h.v)));
                if let (Some(a), Some(b)) = (a, b) {
                    let (p, q) = (one.surface(ray.at(a.t), a.segment, a.v), big.surface(image.at(b.t), b.segment, b.v));
                    assert_eq!((p.point * s, p.normal, p.uv), (q.point, q.normal, q.uv));
                }
            }
        }
    }
}

/// A straight spline of even radius is a cylinder, met at √(r² − ρ²) before the closest approach, over the sine; a
/// straight one whose radius grows evenly is a cone, and its normal leans back by the slope.
#[test]
fn straight_splines_are_cylinders_and_cones() {
    let mut random = Random::new(26);
    let line = |growth: f64| -> Vec<ControlPoint> {
        (-2..=8).map(|i| [0.0, 0.0, f64::from(i), 0.5 + growth * f64::from(i)]).collect()
    };
    let (cylinder, cone) = (curves(&line(0.0), Basis::BSpline), curves(&line(0.05), Basis::BSpline));
    for _ in 0..10_000 {
        let target = DVec3::new(random.range(-0.5, 0.5), random.range(-0.5, 0.5), random.range(1.5, 4.5));
        let direction = random.direction();
        let flat = DVec3::new(direction.x, direction.y, 0.0);
        if flat.length() < 0.3 {
            continue;
        }
        let ray = Ray::new(target - direction * 3.0, direction);
        // |o + t d|² = r² across the axis, with r = r₀ + g z of the point.
        let expected = |g: f64| {
            let (o, r) = (ray.origin, 0.5 + g * ray.origin.z);
            let a = flat.length_squared() - (g * direction.z).powi(2);
            let b = o.x * direction.x + o.y * direction.y - r * g * direction.z;
            let c = o.x * o.x + o.y * o.y - r * r;
            let root = b * b - a * c;
            (root > 1e-6).then(|| (-b - root.sqrt()) / a)
        };
        for (all, g) in [(&cylinder, 0.0), (&cone, 0.05)] {
            let Some(t) = expected(g) else { continue };
            let p = ray.at(t);
            if !(-0.9..6.9).contains(&p.z) || t < 0.0 {
                continue;
            }
            let hit = all.closest(&ray, FAR).unwrap();
            assert!((hit.t - t).abs() < 1e-11, "{g} {hit:?} {t}");
            let s = all.surface(ray.at(hit.t), hit.segment, hit.v);
            let normal = DVec3::new(p.x, p.y, -g * (0.5 + g * p.z)).normalize();
            assert!((s.normal - normal).length() < 1e-10, "{} {normal}", s.normal);
        }
    }
}

/// u is the angle from the horizontal towards up, v runs over the segments: values read off Mitsuba 3.9.1 (f32) for
/// these very curves and rays.
#[test]
fn texture_coordinates_and_normals_are_those_of_mitsuba() {
    let linear = curves(&[[0.0, 0.0, 0.0, 0.2], [1.0, 0.0, 0.0, 0.1], [1.0, 1.0, 0.0, 0.1]], Basis::Linear);
    let spline = [
        [-1.0, 0.0, 0.0, 0.2],
        [0.0, 0.3, 0.0, 0.2],
        [1.0, 0.0, 0.0, 0.1],
        [2.0, 0.4, 0.0, 0.05],
        [3.0, 0.0, 0.0, 0.1],
    ];
    let spline = curves(&spline, Basis::BSpline);
    let cases = [
        (&linear, [0.5, -1.0, 0.0], [0.0, 1.0, 0.0], 0.849_244_3, [0.1, -0.994_987, 0.0], [0.5, 0.242_424]),
        (&linear, [0.5, 0.0, -1.0], [0.0, 0.0, 1.0], 0.849_244_3, [0.1, 0.0, -0.994_987], [0.75, 0.242_424]),
        (&linear, [1.0, 0.5, 1.0], [0.0, 0.0, -1.0], 0.9, [0.0, 0.0, 1.0], [0.25, 0.75]),
        (&linear, [-0.1, 1.0, 0.05], [0.0, -1.0, 0.0], 0.834_168_7, [-0.5, 0.829_156, 0.25], [0.046_607_4, 0.0]),
        (&spline, [0.5, -1.0, 0.0], [0.0, 1.0, 0.0], 1.003_371_2, [-0.055_458_1, -0.998_461, 0.0], [0.5, 0.259_945]),
        (
            &spline,
            [0.5, 0.2, -1.0],
            [0.0, 0.0, 1.0],
            0.858_252_9,
            [0.122_678, 0.302_615, -0.945_185],
            [0.801_43, 0.246_76],
        ),
        (
            &spline,
            [1.5, 0.2, 1.0],
            [0.0, 0.0, -1.0],
            0.921_920_1,
            [0.036_368_7, 0.034_376_3, 0.998_747],
            [0.245_847, 0.750_212],
        ),
    ];
    for (all, o, d, t, n, uv) in cases {
        let ray = Ray::new(DVec3::from(o), DVec3::from(d));
        let hit = all.closest(&ray, FAR).unwrap();
        let s = all.surface(ray.at(hit.t), hit.segment, hit.v);
        assert!((hit.t - t).abs() < 2e-6, "{hit:?} {t}");
        assert!((s.normal - DVec3::from(n)).abs().max_element() < 2e-5, "{} {n:?}", s.normal);
        assert!((s.uv - DVec2::from(uv)).abs().max_element() < 2e-5, "{} {uv:?}", s.uv);
    }
}

/// Whichever piece a ray is tried against first: both orders of the file, so that either piece comes first in space.
#[test]
fn a_joint_belongs_to_the_piece_that_ends_there() {
    for side in [1.0, -1.0] {
        let all = curves(&[[-side, 0.0, 0.0, 0.3], [0.0, 1.0, 0.0, 0.35], [side, 0.0, 0.0, 0.3]], Basis::Linear);
        for x in [-0.1, 0.0, 0.1] {
            let ray = Ray::new(DVec3::new(x, 3.0, 0.01), DVec3::NEG_Y);
            let hit = all.closest(&ray, FAR).unwrap();
            assert_eq!((hit.segment, hit.v), (0, 1.0), "{side} {x}");
            assert_eq!(all.surface(ray.at(hit.t), hit.segment, hit.v).uv.y, 0.5, "{side} {x}");
        }
    }
}

/// From within, along the axis through bends and tapers, as light goes through a curve of glass: 1,000 random ones of ten
/// pieces that turn by less than 60 degrees.
#[test]
fn joints_are_not_met_from_within() {
    let mut random = Random::new(35);
    for _ in 0..1000 {
        let mut p = DVec3::ZERO;
        let points: Vec<ControlPoint> = (0..11)
            .map(|_| {
                p += DVec3::X + random.direction() * 0.5 * random.uniform();
                [p.x, p.y, p.z, random.range(0.05, 0.2)]
            })
            .collect();
        let all = curves(&points, Basis::Linear);
        for k in 0..9 {
            let at = |i: usize| DVec3::new(points[i][0], points[i][1], points[i][2]);
            // To the middle of the ball at the next joint, and backwards.
            for (from, to) in [(at(k) + (at(k + 1) - at(k)) * random.uniform(), at(k + 1)), (at(k + 1), at(k))] {
                let found = all.closest(&Ray::new(from, to - from), 1.0);
                assert!(found.is_none(), "{found:?} {points:?}");
                assert!(!all.any(&Ray::new(from, to - from), 1.0));
            }
        }
    }
}

/// Control points that coincide at the ends let a spline pass through them; the direction vanishes there, and no
/// phantom of a ball stands at the end.
#[test]
fn coinciding_control_points_make_no_phantoms() {
    let (a, b) = ([0.0, 0.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.1]);
    for control in [vec![a, a, a, b, b, b], vec![a, a, b, b]] {
        let all = curves(&control, Basis::BSpline);
        // Past the open end, within a radius of it.
        for z in [0.0, 0.05] {
            for x in [-0.05, 1.05] {
                let ray = Ray::new(DVec3::new(x, -1.0, z), DVec3::Y);
                let hit = all.closest(&ray, FAR);
                let beyond = control.len() == 6;
                assert!(!beyond || hit.is_none(), "{hit:?}");
            }
        }
        let ray = Ray::new(DVec3::new(0.5, -1.0, 0.05), DVec3::Y);
        let expected = 1.0 - (0.01f64 - 0.0025).sqrt();
        assert!((all.closest(&ray, FAR).unwrap().t - expected).abs() < 1e-12);
    }
    let point = curves(&[a, a, a, a], Basis::BSpline);
    assert_eq!(point.closest(&Ray::new(DVec3::new(0.0, -1.0, 0.01), DVec3::Y), FAR), None);
}

/// A thousand points at one place after a thread: a thousand segments without any length, each of which was halved into 2,000
/// parts by every ray near it (75 s for these rays).
#[test]
fn control_points_at_one_place_take_no_time() {
    let start = std::time::Instant::now();
    let mut control = vec![[0.0, 0.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.1], [2.0, 0.0, 0.0, 0.1], [3.0, 0.0, 0.0, 0.1]];
    control.extend([[3.0, 0.0, 0.0, 2.0]; 1000]);
    let all = curves(&control, Basis::BSpline);
    for k in 0..100 {
        // The circles lie across x, in which the thread goes from (0 + 4 + 2)/6 to 3.
        let x = 0.5 + 0.04 * f64::from(k);
        let ray = Ray::new(DVec3::new(x, -9.0, 0.05), DVec3::Y);
        assert_eq!(all.any(&ray, FAR), x > 1.0 && x < 3.0, "{x}");
    }
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

/// A long thread across all three axes has eight boxes, whose surface is an eighth of that of one; short and straight ones have one.
/// It is the same piece in all of them.
#[test]
fn long_threads_are_looked_for_in_small_boxes() {
    let ends = |x: f64, y: f64, z: f64| curves(&[[0.0, 0.0, 0.0, 0.01], [x, y, z, 0.01]], Basis::Linear);
    assert!(ends(0.03, 0.03, 0.03).parts.is_empty());
    assert!(ends(4.0, 0.0, 0.0).parts.is_empty());
    let long = ends(4.0, 4.0, 4.0);
    assert_eq!(long.parts, [0; 8]);
    let mut random = Random::new(5);
    for _ in 0..10_000 {
        // Toward a place on the thread, off it by up to twice its radius.
        let v = random.uniform();
        let ray = ray_at(DVec3::splat(4.0 * v) + random.direction() * 0.02 * random.uniform(), 10.0, &mut random);
        let Pieces::Cones(cones) = &long.pieces else { panic!() };
        let length = ray.direction.length();
        let entry = cones[0].entry(ray.origin, ray.direction / length).map(|(t, v)| (t / length, v));
        let expected = entry.filter(|(t, _)| *t > 0.0);
        let found = long.closest(&ray, f64::INFINITY).map(|hit| (hit.t, hit.v));
        assert_eq!(found, expected);
        assert_eq!(long.any(&ray, f64::INFINITY), expected.is_some());
    }
}

#[test]
fn too_few_points_are_refused_in_words() {
    let fault = |n: usize, basis| {
        let points = helix(0.1)[..n].to_vec();
        Curves::new(&[helix(0.1), points], &DAffine3::IDENTITY, basis).unwrap_err()
    };
    assert_eq!(fault(1, Basis::Linear), "expected 2 or more control points in a curve, found 1 in curve 1");
    assert_eq!(fault(3, Basis::BSpline), "expected 4 or more control points in a curve, found 3 in curve 1");
}
