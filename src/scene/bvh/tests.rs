use super::*;
use crate::math::sampler::mix64;

/// A stream of numbers in [0, 1).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 += 1;
        (mix64(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }

    /// A unit vector; in half of the cases with one or two components ±0 or tiny.
    fn direction(&mut self) -> DVec3 {
        let mut d = self.point();
        if self.next() < 0.5 {
            for _ in 0..=self.below(2) {
                d[self.below(3)] = [0.0, -0.0, 1e-300, -1e-40, 1e-20, -1e-9][self.below(6)];
            }
        }
        if d == DVec3::ZERO { DVec3::Y } else { d / d.abs().max_element() / (d / d.abs().max_element()).length() }
    }
}

/// Where the ray enters the box, by f64 slabs that let a few roundings pass: true of every ray
/// that meets the box in exact arithmetic, boundary included.
fn entry(ray: &Ray, b: &Aabb) -> Option<f64> {
    const SLACK: f64 = 4.0 * f64::EPSILON;
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for a in 0..3 {
        let (o, d) = (ray.origin[a], ray.direction[a]);
        if d == 0.0 {
            if o < b.min[a] || o > b.max[a] {
                return None;
            }
            continue;
        }
        let (t0, t1) = ((b.min[a] - o) / d, (b.max[a] - o) / d);
        enter = enter.max(t0.min(t1) * (1.0 - SLACK));
        leave = leave.min(t0.max(t1) * (1.0 + SLACK));
    }
    (enter <= leave).then_some(enter)
}

/// Boxes of many sizes, some flat, some points, some equal, about `centre`.
fn boxes(numbers: &mut Numbers, n: usize, size: f64, centre: DVec3) -> Vec<Aabb> {
    let mut out: Vec<Aabb> = Vec::new();
    for i in 0..n {
        let p = centre + numbers.point() * size;
        let mut h =
            DVec3::new(numbers.next(), numbers.next(), numbers.next()) * (size * 10f64.powf(-4.0 * numbers.next()));
        match i % 5 {
            0 => h[numbers.below(3)] = 0.0,
            1 => h = DVec3::ZERO,
            2 if i > 10 => {
                out.push(out[numbers.below(i)]);
                continue;
            }
            _ => {}
        }
        out.push(Aabb { min: p - h, max: p + h });
    }
    out
}

/// A ray to a corner, an edge, a side or the inside of some box, from near or far.
fn aimed(numbers: &mut Numbers, boxes: &[Aabb], size: f64) -> Ray {
    let b = boxes[numbers.below(boxes.len())];
    let mut target = b.min;
    for a in 0..3 {
        let w = [0.0, 1.0, numbers.next()][numbers.below(3)];
        target[a] = b.min[a] * (1.0 - w) + b.max[a] * w;
    }
    let d = numbers.direction();
    let distance = size * 10f64.powf(8.0 * numbers.next() - 3.0);
    // Back along the axes: where d is zero the ray lies in the side's plane exactly.
    Ray::new(target - d * distance, d)
}

fn visited(bvh: &Bvh, ray: &Ray, t_max: f64) -> Vec<u32> {
    let mut out = Vec::new();
    bvh.closest(ray, t_max, |i, _| {
        out.push(i);
        None
    });
    out.sort_unstable();
    out
}

/// Each ray visits every box that it meets within t_max, each at most once, over sizes of
/// 1e-30 to 1e30, with the boxes' centre up to a million sizes away.
#[test]
fn no_box_on_the_ray_is_missed() {
    let mut numbers = Numbers(1);
    let (mut tested, mut met, mut seen) = (0usize, 0usize, 0usize);
    for size in [1e-30, 1e-6, 1.0, 1e6, 1e30] {
        for offset in [0.0, 1.0, 1e6] {
            for n in [1, 2, 3, 8, 9, 100, 1000] {
                let centre = numbers.point() * (size * offset);
                let boxes = boxes(&mut numbers, n, size, centre);
                let bvh = Bvh::build(&boxes);
                for _ in 0..800 {
                    let ray = aimed(&mut numbers, &boxes, size);
                    let t_max =
                        if numbers.next() < 0.5 { f64::INFINITY } else { size * 10f64.powf(4.0 * numbers.next()) };
                    let found = visited(&bvh, &ray, t_max);
                    assert!(found.windows(2).all(|w| w[0] < w[1]), "visited twice");
                    for (i, b) in boxes.iter().enumerate() {
                        if entry(&ray, b).is_some_and(|t| t <= t_max) {
                            met += 1;
                            assert!(
                                found.binary_search(&(i as u32)).is_ok(),
                                "box {i} {b:?} ray {ray:?} t_max {t_max}"
                            );
                        }
                    }
                    if n == 1000 {
                        tested += n;
                        seen += found.len();
                    }
                }
            }
        }
    }
    assert!(met > 100_000, "the rays meet boxes: {met}");
    // Boxes of relative size 1e-4 to 1: a ray meets a few per cent. A tree that culls nothing
    // would see all.
    assert!(seen * 4 < tested, "culls: {seen} of {tested}");
}

/// Integer coordinates are exact in the tree, so nothing but the bounds themselves keeps a ray
/// that only grazes a corner or an edge of the whole.
#[test]
fn rays_that_graze_the_whole_are_kept() {
    let mut numbers = Numbers(6);
    let cell = |k: i32| DVec3::new(f64::from(k % 2), f64::from(k / 2 % 2), f64::from(k / 4)) * 2.0 - 2.0;
    let cells: Vec<Aabb> = (0..8).map(|k| Aabb { min: cell(k), max: cell(k) + 2.0 }).collect();
    let bvh = Bvh::build(&cells);
    let whole = [bvh.bounds()];
    let mut grazing = 0;
    for _ in 0..200_000 {
        let ray = aimed(&mut numbers, &whole, 1.0);
        let found = visited(&bvh, &ray, f64::INFINITY);
        for (i, b) in cells.iter().enumerate().filter(|(_, b)| entry(&ray, b).is_some()) {
            assert!(found.contains(&(i as u32)), "box {i} {b:?} ray {ray:?}");
            grazing += 1;
        }
    }
    assert!(grazing > 200_000, "{grazing}");
}

/// The nearest entry found front to back with shortening equals the least of all.
#[test]
fn the_closest_box_is_that_of_brute_force() {
    let mut numbers = Numbers(2);
    let boxes = boxes(&mut numbers, 3000, 1.0, DVec3::new(3.0, -2.0, 1.0));
    let bvh = Bvh::build(&boxes);
    let mut visits = 0usize;
    for _ in 0..4000 {
        let ray = aimed(&mut numbers, &boxes, 1.0);
        let brute = boxes.iter().filter_map(|b| entry(&ray, b)).fold(f64::INFINITY, f64::min);
        let mut best = f64::INFINITY;
        bvh.closest(&ray, f64::INFINITY, |i, t_max| {
            visits += 1;
            let t = entry(&ray, &boxes[i as usize])?;
            best = best.min(t);
            (t < t_max).then_some(t)
        });
        assert_eq!(best, brute, "{ray:?}");
        assert_eq!(bvh.any(&ray, f64::INFINITY, |i| entry(&ray, &boxes[i as usize]).is_some()), brute.is_finite());
    }
    assert!(visits < 4000 * 300, "prunes: {visits}");
}

#[test]
fn any_stops_at_the_first_yes() {
    let boxes = vec![Aabb { min: DVec3::splat(-1.0), max: DVec3::ONE }; 100];
    let mut asked = 0;
    let yes = Bvh::build(&boxes).any(&Ray::new(DVec3::ZERO, DVec3::X), f64::INFINITY, |_| {
        asked += 1;
        true
    });
    assert!(yes && asked == 1);
}

#[test]
fn nothing_is_hit_in_an_empty_tree() {
    let bvh = Bvh::build(&[]);
    let ray = Ray::new(DVec3::ZERO, DVec3::X);
    assert!(visited(&bvh, &ray, f64::INFINITY).is_empty());
    assert!(!bvh.any(&ray, f64::INFINITY, |_| true));
    assert_eq!(bvh.bounds(), Aabb::EMPTY);
    assert!(bvh.order().is_empty());
}

/// A plane has a box without end; so has a primitive whose box came out as NaN.
#[test]
fn unbounded_primitives_are_always_visited() {
    let mut numbers = Numbers(3);
    let mut boxes = boxes(&mut numbers, 50, 1.0, DVec3::ZERO);
    boxes[7] = Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
    boxes[9] = Aabb { min: DVec3::splat(f64::NAN), max: DVec3::ONE };
    let bvh = Bvh::build(&boxes);
    let away = Ray::new(DVec3::new(0.0, 0.0, 50.0), DVec3::Z);
    assert_eq!(visited(&bvh, &away, f64::INFINITY), [7, 9]);
    assert_eq!(bvh.order().len(), 50);
}

#[test]
fn rays_that_are_not_numbers_and_negative_distances_meet_nothing() {
    let boxes = vec![Aabb { min: DVec3::splat(-1.0), max: DVec3::ONE }; 10];
    let bvh = Bvh::build(&boxes);
    assert!(visited(&bvh, &Ray::new(DVec3::NAN, DVec3::X), 1.0).is_empty());
    assert!(visited(&bvh, &Ray::new(DVec3::ZERO, DVec3::NAN), 1.0).is_empty());
    assert!(visited(&bvh, &Ray::new(DVec3::ZERO, DVec3::X), f64::NAN).is_empty());
    assert!(visited(&bvh, &Ray::new(DVec3::ZERO, DVec3::X), -1.0).is_empty());
}

#[test]
fn equal_boxes_give_equal_trees() {
    let boxes = boxes(&mut Numbers(4), 5000, 1.0, DVec3::ZERO);
    let (a, b) = (Bvh::build(&boxes), Bvh::build(&boxes));
    assert_eq!(a.order, b.order);
    assert_eq!(format!("{:?}", a.nodes), format!("{:?}", b.nodes));
    let mut order = a.order().to_vec();
    order.sort_unstable();
    assert!(order.iter().enumerate().all(|(i, &o)| i as u32 == o), "every box is in one leaf");
}

/// Depth of the tree in nodes.
fn depth(bvh: &Bvh, node: u32) -> usize {
    let inner = |&&child: &&u32| child & LEAF == 0;
    1 + bvh.nodes[node as usize].children.iter().filter(inner).map(|&c| depth(bvh, c)).max().unwrap_or(0)
}

/// Boxes inside one another, each a 1000th smaller and later each half as large, defeat any
/// heuristic: the surface area says to take them off one at a time. Equal boxes leave it
/// nothing to go by.
#[test]
fn depth_is_bounded_whatever_the_boxes() {
    let nested = |ratio: f64, n: i32| -> Vec<Aabb> {
        (0..n).map(|i| ratio.powi(i)).map(|h| Aabb { min: DVec3::splat(-h), max: DVec3::splat(3.0 * h) }).collect()
    };
    let cases = [
        nested(0.999, 20_000),
        nested(0.5, 1000),
        vec![Aabb { min: DVec3::ZERO, max: DVec3::ONE }; 100_000],
        (0..20_000).map(|i| DVec3::X * f64::from(i)).map(|p| Aabb { min: p, max: p }).collect(),
    ];
    for boxes in cases {
        for bvh in [Bvh::build(&boxes), Bvh::build_blocks(&boxes)] {
            let depth = depth(&bvh, 0);
            assert!(depth <= DEPTH, "{depth}");
            let centre = Ray::new(boxes[boxes.len() - 1].min, DVec3::X);
            assert!(visited(&bvh, &centre, f64::INFINITY).contains(&(boxes.len() as u32 - 1)));
        }
    }
}

#[test]
fn leaves_of_blocks_start_at_multiples() {
    let boxes = boxes(&mut Numbers(5), 500, 1.0, DVec3::ZERO);
    let bvh = Bvh::build_blocks(&boxes);
    let mut seen = vec![false; bvh.order().len() / 8];
    for node in &bvh.nodes {
        for child in node.children.iter().filter(|&&c| c != EMPTY_CHILD && c & LEAF != 0) {
            let (block, count) = ((child & POSITION) as usize, (child >> LEAF_COUNT_SHIFT & 7) as usize + 1);
            assert!(!std::mem::replace(&mut seen[block], true));
            let held = bvh.order()[8 * block..8 * block + 8].iter().filter(|&&i| i != NO_PRIMITIVE).count();
            assert_eq!(held, count);
        }
    }
    assert!(seen.iter().all(|&s| s));
    assert_eq!(bvh.order().iter().filter(|&&i| i != NO_PRIMITIVE).count(), 500);
}

/// Boxes along a spiral, then along the same mirrored and twice as large.
#[test]
fn a_refitted_tree_finds_what_a_new_one_finds() {
    let spiral = |scale: f64| -> Vec<Aabb> {
        (0..500)
            .map(|i| {
                let t = f64::from(i) * 0.1;
                let p = DVec3::new(t * libm::cos(t), t * libm::sin(t), 0.3 * t) * scale;
                Aabb::from_points([p, p + DVec3::splat(0.4)])
            })
            .collect()
    };
    let (before, after) = (spiral(1.0), spiral(-2.0));
    let old = Bvh::build_blocks(&before);
    let union = |boxes: &mut dyn Iterator<Item = &Aabb>| boxes.fold(Aabb::EMPTY, |all, b| all.union(b));
    let refitted = old.refitted(union(&mut after.iter()), |first| {
        let block = old.order()[first..first + 8].iter().filter(|&&i| i != NO_PRIMITIVE);
        union(&mut block.map(|&i| &after[i as usize]))
    });
    let new = Bvh::build_blocks(&after);
    assert_eq!(refitted.bounds(), new.bounds());
    let met = |tree: &Bvh, ray: &Ray| {
        let mut found = Vec::new();
        let stopped = tree.any(ray, f64::INFINITY, |i| {
            let b = &after[i as usize];
            let (t0, t1) = ((b.min - ray.origin) / ray.direction, (b.max - ray.origin) / ray.direction);
            if t0.min(t1).max_element().max(0.0) <= t0.max(t1).min_element() {
                found.push(i);
            }
            false
        });
        assert!(!stopped);
        found.sort_unstable();
        found
    };
    let mut all = 0;
    for i in 0..200 {
        // From outside to the middle of a box, so each ray meets one at least.
        let target = &after[(i * 7) % after.len()];
        let a = i as f64;
        let origin = DVec3::new(libm::sin(a), libm::cos(a), libm::sin(1.7 * a)) * 300.0;
        let ray = Ray::new(origin, (0.5 * (target.min + target.max) - origin).normalize());
        let found = met(&refitted, &ray);
        assert_eq!(found, met(&new, &ray));
        all += found.len();
    }
    assert!(all >= 200, "{all}");
}

/// Three sets of boxes, one of a single box and one far from the others: each ray visits in the joined tree what it
/// visits in a tree of all, as far as it meets the boxes themselves.
#[test]
fn a_joined_tree_finds_what_one_of_all_finds() {
    let mut numbers = Numbers(8);
    let sets = [
        boxes(&mut numbers, 300, 1.0, DVec3::ZERO),
        boxes(&mut numbers, 1, 1.0, DVec3::Y),
        boxes(&mut numbers, 40, 0.1, DVec3::new(20.0, 3.0, -5.0)),
    ];
    for count in 1..=3 {
        let trees: Vec<Bvh> = sets[..count].iter().map(|set| Bvh::build_blocks(set)).collect();
        let joints = trees.iter().zip(&sets);
        let joints = joints.map(|(tree, set)| Joint { tree, count: set.len() as u32, first: set.len() == 1 });
        let parts: Vec<Joint> = joints.collect();
        let joined = Bvh::joined(&parts);
        let all: Vec<Aabb> = sets[..count].iter().flatten().copied().collect();
        assert_eq!(joined.bounds(), Bvh::build(&all).bounds());
        let mut met = 0;
        for _ in 0..4000 {
            let ray = aimed(&mut numbers, &all, 1.0);
            met += assert_none_is_lost(&joined, &all, &ray);
        }
        assert!(met >= 4000, "{met}");
    }
}

/// Five sets of boxes around one another, and a ray that meets them all: a search without an order visits the one that is
/// put first before it visits any other, whichever it is, and each once.
#[test]
fn what_is_put_first_is_visited_first() {
    let sets = [1.0, 2.0, 3.0, 4.0, 5.0].map(|size| vec![Aabb { min: DVec3::splat(-size), max: DVec3::splat(size) }]);
    let trees = sets.each_ref().map(|set| Bvh::build_blocks(set));
    let ray = Ray::new(DVec3::new(-9.0, 0.1, 0.2), DVec3::X);
    for first in 0..sets.len() {
        let joints = (0..).zip(&trees).map(|(i, tree)| Joint { tree, count: 1, first: i == first });
        let joined = Bvh::joined(&joints.collect::<Vec<Joint>>());
        let mut visited = Vec::new();
        joined.any(&ray, f64::INFINITY, |i| {
            visited.push(i as usize);
            false
        });
        assert_eq!(visited[0], first, "{visited:?}");
        visited.sort_unstable();
        assert_eq!(visited, [0, 1, 2, 3, 4]);
    }
}

/// Every box that the ray meets is visited, and none twice; how many it meets.
fn assert_none_is_lost(tree: &Bvh, boxes: &[Aabb], ray: &Ray) -> usize {
    let found = visited(tree, ray, f64::INFINITY);
    assert!(found.windows(2).all(|w| w[0] < w[1]), "visited twice");
    let mut met = 0;
    for (i, _) in boxes.iter().enumerate().filter(|(_, b)| entry(ray, b).is_some()) {
        assert!(found.binary_search(&(i as u32)).is_ok(), "box {i} ray {ray:?}");
        met += 1;
    }
    met
}

/// More boxes than one thread builds alone: on one thread and on three the same tree, and no box of it is lost.
#[test]
fn a_large_tree_is_the_same_on_any_number_of_threads() {
    let boxes = boxes(&mut Numbers(11), 3 * build::ALONE, 0.05, DVec3::ZERO);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bvh::build_blocks(&boxes))
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one.order, three.order);
    assert_eq!(format!("{:?}", one.nodes), format!("{:?}", three.nodes));
    let mut numbers = Numbers(12);
    for _ in 0..200 {
        let ray = aimed(&mut numbers, &boxes, 1.0);
        assert_none_is_lost(&three, &boxes, &ray);
    }
}

#[test]
fn primitives_of_a_named_tree_have_other_numbers() {
    let boxes = boxes(&mut Numbers(9), 20, 1.0, DVec3::ZERO);
    let names: Vec<u32> = (0..20).map(|i| 100 + 3 * i).collect();
    let (plain, named) = (Bvh::build(&boxes), Bvh::build(&boxes).named(&names));
    let ray = aimed(&mut Numbers(10), &boxes, 1.0);
    let expected: Vec<u32> = visited(&plain, &ray, f64::INFINITY).iter().map(|&i| names[i as usize]).collect();
    assert_eq!(visited(&named, &ray, f64::INFINITY), expected);
}
