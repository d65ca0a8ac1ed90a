//! Building the tree: top-down, eight children at once.
//!
//! Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies": the surface area
//! heuristic over binned centroids. Where Wald splits in two, a node here goes on splitting its
//! largest part until it has eight.
//!
//! Whatever the boxes, the work is O(n log n) and the depth is at most [`DEPTH`]: below
//! [`SAH_LEVELS`] levels parts are halved by count. (Builders that merge nearest neighbours
//! bottom-up, such as PLOC, can take O(n²) steps and reach depth n where boxes are equal or
//! evenly spaced.)

use super::{LEAF, LEAF_COUNT_SHIFT, NO_PRIMITIVE, Node};
use rayon::prelude::*;
use wide::f32x4;

/// Bins per axis. With 32, rays visit as many nodes and leaves of a 256 000-triangle mesh.
const BINS: usize = 16;
/// Levels of the surface area heuristic before parts are halved by count.
const SAH_LEVELS: usize = 24;
/// Levels that halving needs: three halvings a level for at most 2²⁸ primitives.
const MEDIAN_LEVELS: usize = 10;
/// The deepest a tree can be, in nodes.
pub(super) const DEPTH: usize = SAH_LEVELS + MEDIAN_LEVELS;
/// Positions that a child word can address.
pub(super) const MAX_POSITIONS: usize = 1 << LEAF_COUNT_SHIFT;

/// Parts of fewer primitives are built on one thread.
pub(super) const ALONE: usize = 4096;

/// A primitive's box in the tree's own coordinates.
#[derive(Clone, Copy)]
pub(super) struct Primitive {
    pub lo: [f32; 3],
    pub hi: [f32; 3],
    pub index: u32,
}

impl Primitive {
    /// Twice the centre.
    fn centroid(&self, axis: usize) -> f32 {
        self.lo[axis] + self.hi[axis]
    }

    fn corners(&self) -> [f32x4; 2] {
        [self.lo, self.hi].map(|[x, y, z]| f32x4::new([x, y, z, 0.0]))
    }
}

/// How many primitives a leaf holds.
#[derive(Clone, Copy)]
pub(super) struct LeafSize {
    /// Parts of this size are not split although a slot is free, and the cost of a leaf counts in blocks of this many.
    pub block: usize,
    /// Each leaf starts at a multiple of it.
    pub align: usize,
    /// Parts of up to this size become leaves rather than nodes.
    pub max: usize,
}

/// The fourth lane is zero once something is in. Whole registers: bins that one primitive after the other writes
/// are read back at once.
#[derive(Clone, Copy)]
struct Bounds {
    lo: f32x4,
    hi: f32x4,
}

impl Bounds {
    const EMPTY: Bounds = Bounds { lo: f32x4::new([f32::INFINITY; 4]), hi: f32x4::new([f32::NEG_INFINITY; 4]) };

    fn add(&mut self, lo: f32x4, hi: f32x4) {
        // Nothing is NaN here.
        self.lo = self.lo.fast_min(lo);
        self.hi = self.hi.fast_max(hi);
    }

    fn lo(&self) -> [f32; 3] {
        let [x, y, z, _] = self.lo.to_array();
        [x, y, z]
    }

    fn hi(&self) -> [f32; 3] {
        let [x, y, z, _] = self.hi.to_array();
        [x, y, z]
    }

    /// Half the surface; zero where empty.
    fn half_area(&self) -> f32 {
        let [x, y, z, _] = (self.hi - self.lo).to_array().map(|d| d.max(0.0));
        x * y + y * z + z * x
    }
}

/// A run of primitives that will be one child.
#[derive(Clone, Copy)]
struct Part {
    first: usize,
    count: usize,
    bounds: Bounds,
    /// Of [`Primitive::centroid`].
    centroids: Bounds,
}

impl Part {
    fn of(primitives: &[Primitive], first: usize, count: usize) -> Part {
        let mut part = Part { first, count, bounds: Bounds::EMPTY, centroids: Bounds::EMPTY };
        for p in &primitives[first..first + count] {
            let [lo, hi] = p.corners();
            part.bounds.add(lo, hi);
            part.centroids.add(lo + hi, lo + hi);
        }
        part
    }
}

/// A tree under construction.
pub(super) struct Builder<'a> {
    pub primitives: &'a mut [Primitive],
    pub leaf: LeafSize,
    /// The root comes first.
    pub nodes: Vec<Node>,
    /// Positions of the leaves to original indices.
    pub order: Vec<u32>,
}

impl Builder<'_> {
    pub(super) fn run(&mut self) {
        if !self.primitives.is_empty() {
            let whole = Part::of(self.primitives, 0, self.primitives.len());
            self.add_node(whole, 0);
        }
    }

    /// Appends the node over `whole` and all below it; returns its index.
    fn add_node(&mut self, whole: Part, level: usize) -> u32 {
        let id = self.nodes.len();
        self.nodes.push(Node::EMPTY);

        // Split the part that a random line most likely meets, until the slots are full.
        let mut parts = [whole; 8];
        let mut used = 1;
        while used < 8 {
            let splittable = (0..used).filter(|&i| parts[i].count > self.leaf.block);
            let Some(i) = splittable.max_by(|&a, &b| {
                let (a, b) = (&parts[a], &parts[b]);
                let by_count = a.count.cmp(&b.count);
                if level < SAH_LEVELS {
                    a.bounds.half_area().total_cmp(&b.bounds.half_area()).then(by_count)
                } else {
                    by_count
                }
            }) else {
                break;
            };
            let part = parts[i];
            let left = split(&mut self.primitives[part.first..part.first + part.count], &part, self.leaf, level);
            parts[i] = Part::of(self.primitives, part.first, left);
            parts[used] = Part::of(self.primitives, part.first + left, part.count - left);
            used += 1;
        }

        if whole.count >= ALONE {
            self.add_children(id, &parts[..used], level);
            return id as u32;
        }
        for (slot, part) in parts[..used].iter().enumerate() {
            let child = if part.count <= self.leaf.max { self.add_leaf(part) } else { self.add_node(*part, level + 1) };
            self.nodes[id].set(slot, part.bounds.lo(), part.bounds.hi(), child);
        }
        id as u32
    }

    /// Appends what lies below the node `id`, made on the current rayon pool: the same as one after the other.
    fn add_children(&mut self, id: usize, parts: &[Part], level: usize) {
        let mut slots: Vec<usize> = (0..parts.len()).collect();
        slots.sort_by_key(|&slot| parts[slot].first);
        let mut rest = &mut *self.primitives;
        let mut start = 0;
        let mut below: Vec<(usize, Builder)> = Vec::with_capacity(parts.len());
        for slot in slots {
            let part = &parts[slot];
            let (primitives, others) = rest.split_at_mut(part.first - start).1.split_at_mut(part.count);
            (rest, start) = (others, part.first + part.count);
            below.push((slot, Builder { primitives, leaf: self.leaf, nodes: Vec::new(), order: Vec::new() }));
        }
        below.sort_by_key(|(slot, _)| *slot);
        below.par_iter_mut().for_each(|(slot, builder)| {
            let part = Part { first: 0, ..parts[*slot] };
            if part.count > self.leaf.max {
                builder.add_node(part, level + 1);
            } else {
                builder.add_leaf(&part);
            }
        });
        for (slot, Builder { nodes, order, .. }) in below {
            let part = &parts[slot];
            let (node, position) = (self.nodes.len() as u32, (self.order.len() / self.leaf.align) as u32);
            let child =
                if nodes.is_empty() { LEAF | ((part.count - 1) as u32) << LEAF_COUNT_SHIFT | position } else { node };
            self.nodes[id].set(slot, part.bounds.lo(), part.bounds.hi(), child);
            self.order.extend(order);
            self.nodes.extend(nodes.into_iter().map(|mut moved| {
                moved.rebase(node, position);
                moved
            }));
        }
    }

    /// Appends a leaf to the order and returns its child word.
    fn add_leaf(&mut self, part: &Part) -> u32 {
        let first = self.order.len();
        let run = &self.primitives[part.first..part.first + part.count];
        self.order.extend(run.iter().map(|p| p.index));
        self.order.resize(self.order.len().next_multiple_of(self.leaf.align), NO_PRIMITIVE);
        LEAF | ((part.count - 1) as u32) << LEAF_COUNT_SHIFT | (first / self.leaf.align) as u32
    }
}

/// Partitions `primitives` in two and returns how many went left: at least one, and not all.
fn split(primitives: &mut [Primitive], part: &Part, leaf: LeafSize, level: usize) -> usize {
    let chosen = if level < SAH_LEVELS { best_plane(primitives, part, leaf) } else { None };
    let Some(plane) = chosen else {
        return halve(primitives, part);
    };
    let mut left = 0;
    let mut right = primitives.len();
    while left < right {
        if plane.bin(&primitives[left]) < plane.first_right {
            left += 1;
        } else {
            right -= 1;
            primitives.swap(left, right);
        }
    }
    left
}

/// Halves by count along the widest axis of the centroids.
fn halve(primitives: &mut [Primitive], part: &Part) -> usize {
    let extent = (part.centroids.hi - part.centroids.lo).to_array();
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let middle = primitives.len() / 2;
    primitives.select_nth_unstable_by(middle, |a, b| {
        a.centroid(axis).total_cmp(&b.centroid(axis)).then(a.index.cmp(&b.index))
    });
    middle
}

/// A plane between bins of one axis.
struct Plane {
    axis: usize,
    low: f32,
    per_unit: f32,
    first_right: usize,
}

impl Plane {
    /// Bin of a primitive. A cast saturates, so any `per_unit` gives a bin.
    fn bin(&self, p: &Primitive) -> usize {
        (((p.centroid(self.axis) - self.low) * self.per_unit) as usize).min(BINS - 1)
    }
}

/// The plane of least expected cost, if any plane has primitives on both sides.
fn best_plane(primitives: &[Primitive], part: &Part, leaf: LeafSize) -> Option<Plane> {
    let mut best: Option<Plane> = None;
    let mut best_cost = f32::INFINITY;
    for axis in 0..3 {
        let low = part.centroids.lo()[axis];
        let extent = part.centroids.hi()[axis] - low;
        if extent <= 0.0 {
            continue;
        }
        let plane = Plane { axis, low, per_unit: BINS as f32 / extent, first_right: 0 };
        let mut bins = [(Bounds::EMPTY, 0usize); BINS];
        for p in primitives {
            let bin = &mut bins[plane.bin(p)];
            let [lo, hi] = p.corners();
            bin.0.add(lo, hi);
            bin.1 += 1;
        }
        // Cost of a side: the chance that a line meets it times the blocks it holds.
        let blocks = |count: usize| count.div_ceil(leaf.block) as f32;
        let mut right_cost = [0.0f32; BINS];
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for i in (1..BINS).rev() {
            if bins[i].1 == 0 {
                right_cost[i] = if count == 0 { 0.0 } else { right_cost[i + 1] };
                continue;
            }
            bounds.add(bins[i].0.lo, bins[i].0.hi);
            count += bins[i].1;
            right_cost[i] = bounds.half_area() * blocks(count);
        }
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for i in 1..BINS {
            // Behind an empty bin the plane parts the primitives as the one before it does.
            if bins[i - 1].1 == 0 {
                continue;
            }
            bounds.add(bins[i - 1].0.lo, bins[i - 1].0.hi);
            count += bins[i - 1].1;
            if count == primitives.len() {
                break;
            }
            let cost = bounds.half_area() * blocks(count) + right_cost[i];
            if cost < best_cost {
                best_cost = cost;
                best = Some(Plane { axis, low, per_unit: plane.per_unit, first_right: i });
            }
        }
    }
    best
}
