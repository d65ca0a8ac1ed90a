//! A bounding volume hierarchy over any primitives, eight children a node.
//!
//! **Coordinates.** The tree keeps f32 boxes in coordinates of its own: the centre of all
//! boxes is subtracted in f64 and the rest multiplied by a power of two, so that the largest
//! coordinate lies in [1, 2). A box is then rounded outward. Scenes of 1e30 or 1e-30 metres, or
//! far from the origin, lose nothing but the 2⁻²⁴ of their own size that f32 has.
//!
//! **No false misses.** A ray that meets a primitive's f64 box, in exact arithmetic, always
//! reaches that primitive: `ray.rs` has the bounds.
//!
//! **Unbounded primitives** (a box that is not finite) are kept beside the tree and always
//! visited.

mod build;
mod ray;

pub(in crate::scene) use ray::TreeRay;

use crate::math::{Ray, inverse_power_of_two};
use build::{Builder, DEPTH, LeafSize, MAX_POSITIONS, Primitive};
use glam::DVec3;
use rayon::prelude::*;
use std::mem::MaybeUninit;
use std::ops::Range;
use wide::{f32x8, f64x4};

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: DVec3,
    /// Largest coordinates.
    pub max: DVec3,
}

impl Aabb {
    /// The box of nothing: the neutral element of [`Aabb::union`].
    pub const EMPTY: Aabb = Aabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box around `points`.
    pub fn from_points(points: impl IntoIterator<Item = DVec3>) -> Aabb {
        points.into_iter().fold(Aabb::EMPTY, |b, p| Aabb { min: b.min.min(p), max: b.max.max(p) })
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(&self, other: &Aabb) -> Aabb {
        Aabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether it ends on all sides.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }
}

/// Bit of a child word that marks a leaf.
const LEAF: u32 = 1 << 31;
/// Three bits of a leaf hold its count − 1, the rest the position of its first primitive, over [`Bvh::align`].
const LEAF_COUNT_SHIFT: u32 = 28;
const POSITION: u32 = (1 << LEAF_COUNT_SHIFT) - 1;
/// Fills the order up to where the next leaf of a tree of blocks starts.
pub const NO_PRIMITIVE: u32 = u32::MAX;
/// A slot without child. Its box is inside out, so no ray gets there.
const EMPTY_CHILD: u32 = u32::MAX;

/// Eight boxes and where they lead: 224 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node {
    /// Low x, high x, low y, high y, low z, high z of the eight children.
    planes: [f32x8; 6],
    /// An index of a node, or [`LEAF`] | count − 1 | first primitive.
    children: [u32; 8],
}

impl Node {
    const EMPTY: Node = {
        let (lo, hi) = (f32x8::new([f32::INFINITY; 8]), f32x8::new([f32::NEG_INFINITY; 8]));
        Node { planes: [lo, hi, lo, hi, lo, hi], children: [EMPTY_CHILD; 8] }
    };

    fn set(&mut self, slot: usize, lo: [f32; 3], hi: [f32; 3], child: u32) {
        for axis in 0..3 {
            self.planes[2 * axis].as_mut_array()[slot] = lo[axis];
            self.planes[2 * axis + 1].as_mut_array()[slot] = hi[axis];
        }
        self.children[slot] = child;
    }

    /// The same node with its children in other slots: those of `from`, one after the other.
    fn arranged(&self, from: &[usize]) -> Node {
        let mut node = Node::EMPTY;
        for (to, &slot) in from.iter().enumerate() {
            let plane = |i: usize| self.planes[i].as_array()[slot];
            node.set(to, [0, 2, 4].map(plane), [1, 3, 5].map(plane), self.children[slot]);
        }
        node
    }

    /// Moves what its children name: nodes by `node`, positions over the alignment by `position`.
    fn rebase(&mut self, node: u32, position: u32) {
        for child in self.children.iter_mut().filter(|child| **child != EMPTY_CHILD) {
            *child += if *child & LEAF == 0 { node } else { position };
        }
    }
}

/// The hierarchy. Built once, then read by any number of threads.
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Leaf order to original index; the unbounded primitives come last.
    order: Vec<u32>,
    /// How many positions of `order` belong to the tree.
    bounded: u32,
    /// Leaves start at multiples of it.
    align: u32,
    /// Tree coordinates are (world − `centre`) · `scale`; `scale` is a power of two.
    centre: DVec3,
    scale: f64,
    /// Least and largest coordinates of the root, in tree coordinates.
    root: [f64x4; 2],
    bounds: Aabb,
}

/// A tree that becomes a part of another.
#[derive(Clone, Copy, Debug)]
pub struct Joint<'a> {
    /// The tree.
    pub tree: &'a Bvh,
    /// How many primitives it has.
    pub count: u32,
    /// Whether a search without an order goes there before it goes to the others.
    pub first: bool,
}

/// What a visit makes of the search.
pub(in crate::scene) enum Next {
    /// On as before.
    Go,
    /// Only what is nearer than this counts from now on.
    Shorten(f64),
    /// No more.
    Stop,
}

/// A node or leaf still to be visited, and where the ray enters it.
#[derive(Clone, Copy)]
struct Entry {
    near: f32,
    child: u32,
}

/// Each node on the way down leaves at most seven siblings behind, the last one eight children. Twice the depth of
/// one tree: [`Bvh::joined`].
const STACK: usize = 7 * 2 * DEPTH + 8;

impl Bvh {
    /// A tree over `boxes`, one or two a leaf. Same boxes, same tree.
    ///
    /// # Panics
    /// Over more than 2²⁸ boxes (13 GB of them).
    #[must_use]
    pub fn build(boxes: &[Aabb]) -> Bvh {
        Bvh::build_leaves(boxes, LeafSize { block: 1, align: 1, max: 2 })
    }

    /// A tree for primitives that are tested eight at a time, as a SIMD kernel does. A leaf holds up to eight and
    /// starts at a multiple of eight; the positions that it leaves over hold [`NO_PRIMITIVE`] in [`Bvh::order`].
    ///
    /// # Panics
    /// Over more than 2²⁸ boxes.
    #[must_use]
    pub fn build_blocks(boxes: &[Aabb]) -> Bvh {
        Bvh::build_leaves(boxes, LeafSize { block: 8, align: 8, max: 8 })
    }

    /// A tree of blocks of the same shape over other primitives: cheaper than a new tree, and about as good where they
    /// are the same things turned, moved or resized. `block` tells the box of the primitives whose positions in
    /// [`Bvh::order`] start at a number, and `bounds`, which are finite, that of all.
    #[must_use]
    pub fn refitted(&self, bounds: Aabb, block: impl Fn(usize) -> Aabb) -> Bvh {
        let tree = Bvh::space(bounds);
        let mut nodes = self.nodes.clone();
        fit(&mut nodes, |first, _| tree.rounded(&block(first * self.align as usize)));
        Bvh { nodes, order: self.order.clone(), bounded: self.bounded, align: self.align, ..tree }
    }

    /// One tree over the primitives of several, which are all finite: their numbers and positions in [`Bvh::order`]
    /// follow one another as the trees do. Below its upper nodes it has the shape that they have.
    ///
    /// # Panics
    /// Over more than 2²⁸ positions, or where some of the trees have blocks and some have not.
    #[must_use]
    pub fn joined(parts: &[Joint]) -> Bvh {
        let align = parts.first().map_or(1, |part| part.tree.align);
        assert!(parts.iter().all(|part| part.tree.align == align), "trees of one kind");
        let tree = Bvh::space(parts.iter().fold(Aabb::EMPTY, |all, part| all.union(&part.tree.bounds)));

        // The upper nodes: over the boxes of the parts, one a leaf.
        let mut whole: Vec<Primitive> = (0..)
            .zip(parts)
            .map(|(index, part)| {
                let (lo, hi) = tree.rounded(&part.tree.bounds);
                Primitive { lo, hi, index }
            })
            .collect();
        let leaf = LeafSize { block: 1, align: 1, max: 1 };
        let mut builder = Builder { primitives: &mut whole, leaf, nodes: Vec::new(), order: Vec::new() };
        if parts.len() > 1 {
            builder.run();
        }
        let Builder { mut nodes, order: upper, .. } = builder;
        let is_first = |child: u32| parts[upper[(child & POSITION) as usize] as usize].first;
        put_first(&mut nodes, is_first);

        // Below them the nodes of the parts, moved.
        let mut starts = Vec::with_capacity(parts.len());
        let (mut node, mut position, mut number) = (nodes.len() as u32, 0, 0);
        for part in parts {
            starts.push((node, position, number));
            node += part.tree.nodes.len() as u32;
            position += part.tree.order.len() as u32 / align;
            number += part.count;
        }
        assert!(position as usize * align as usize <= MAX_POSITIONS, "more primitives than one tree can address");
        let moved: Vec<Vec<Node>> = parts
            .par_iter()
            .zip(&starts)
            .map(|(part, &(node, position, _))| {
                let mut moved = part.tree.nodes.clone();
                moved.iter_mut().for_each(|new| new.rebase(node, position));
                tree.take_planes(&mut moved, part.tree);
                moved
            })
            .collect();
        nodes.reserve(node as usize - nodes.len());
        for child in nodes.iter_mut().flat_map(|node| &mut node.children) {
            if *child != EMPTY_CHILD && *child & LEAF != 0 {
                *child = starts[upper[(*child & POSITION) as usize] as usize].0;
            }
        }
        moved.iter().for_each(|moved| nodes.extend(moved));
        let mut order = Vec::with_capacity(position as usize * align as usize);
        for (part, (_, _, number)) in parts.iter().zip(&starts) {
            order.extend(part.tree.order.iter().map(|&i| if i == NO_PRIMITIVE { i } else { i + number }));
        }
        Bvh { nodes, bounded: order.len() as u32, align, order, ..tree }
    }

    /// Expresses the planes of the nodes of `from` in the coordinates of this tree, rounded outward.
    fn take_planes(&self, nodes: &mut [Node], from: &Bvh) {
        /// 2⁻⁵²: more than the two roundings of f64, of the way to the world and from there.
        const SLACK: f64 = f64::EPSILON;
        let (per_unit, scale) = (1.0 / from.scale, self.scale);
        for node in nodes {
            for axis in 0..3 {
                let (there, here) = (from.centre[axis], self.centre[axis]);
                let taken = |x: f32, outward: f64| {
                    let world = f64::from(x) * per_unit + there;
                    let moved = (world - here) * scale;
                    plane_below(moved * outward - SLACK * (moved.abs() + world.abs() * scale))
                };
                for slot in 0..8 {
                    if node.children[slot] == EMPTY_CHILD {
                        continue;
                    }
                    let lo = &mut node.planes[2 * axis].as_mut_array()[slot];
                    *lo = taken(*lo, 1.0);
                    let hi = &mut node.planes[2 * axis + 1].as_mut_array()[slot];
                    *hi = -taken(*hi, -1.0);
                }
            }
        }
    }

    fn build_leaves(boxes: &[Aabb], leaf: LeafSize) -> Bvh {
        assert!(boxes.len() <= MAX_POSITIONS, "more primitives than one tree can address");
        let finite = || boxes.iter().filter(|b| b.is_finite());
        let tree = Bvh::space(finite().fold(Aabb::EMPTY, |a, b| a.union(b)));
        let mut primitives = Vec::with_capacity(boxes.len());
        let mut unbounded = Vec::new();
        for (index, b) in (0..).zip(boxes) {
            if b.is_finite() {
                let (lo, hi) = tree.rounded(b);
                primitives.push(Primitive { lo, hi, index });
            } else {
                unbounded.push(index);
            }
        }
        let mut builder = Builder { primitives: &mut primitives, leaf, nodes: Vec::new(), order: Vec::new() };
        builder.run();
        let Builder { nodes, mut order, .. } = builder;
        let bounded = order.len() as u32;
        order.extend(unbounded);
        let bounds = boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        Bvh { nodes, order, bounded, align: leaf.align as u32, bounds, ..tree }
    }

    /// A tree of nothing yet, with the coordinates for what lies in `all`.
    fn space(all: Aabb) -> Bvh {
        // Halve before adding: no overflow up to the largest f64.
        let centre = if all.is_finite() { 0.5 * all.min + 0.5 * all.max } else { DVec3::ZERO };
        let half_size = if all.is_finite() { (all.max - centre).max(centre - all.min).max_element() } else { 1.0 };
        let scale = inverse_power_of_two(half_size);
        let empty = Bvh {
            nodes: Vec::new(),
            order: Vec::new(),
            bounded: 0,
            align: 1,
            centre,
            scale,
            root: [f64x4::ZERO; 2],
            bounds: all,
        };
        let (lo, hi) = if all.is_finite() { empty.rounded(&all) } else { ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]) };
        let root = [lo, hi].map(|c| f64x4::new([c[0].into(), c[1].into(), c[2].into(), 0.0]));
        Bvh { root, ..empty }
    }

    /// A finite box in the coordinates of the tree, rounded outward.
    fn rounded(&self, b: &Aabb) -> ([f32; 3], [f32; 3]) {
        let lo = ((b.min - self.centre) * self.scale).to_array().map(plane_below);
        let hi = ((b.max - self.centre) * self.scale).to_array().map(|x| -plane_below(-x));
        (lo, hi)
    }

    /// Gives each primitive the number in `names`, by its original index.
    #[must_use]
    pub fn named(mut self, names: &[u32]) -> Bvh {
        self.order.iter_mut().filter(|i| **i != NO_PRIMITIVE).for_each(|i| *i = names[*i as usize]);
        self
    }

    /// The original indices in leaf order. A caller who keeps primitives in this order reads
    /// them in runs.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The box around all boxes; [`Aabb::EMPTY`] where there are none.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Memory of the tree.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Bvh>() + self.nodes.capacity() * size_of::<Node>() + self.order.capacity() * size_of::<u32>()
    }

    /// Shows `visit` every primitive whose box the ray meets within `t_max`, roughly front to
    /// back, by its original index and with the distance that still counts. `visit` keeps its
    /// own record of the hit and returns the new distance where it found a nearer one.
    pub fn closest<F>(&self, ray: &Ray, t_max: f64, mut visit: F)
    where
        F: FnMut(u32, f64) -> Option<f64>,
    {
        self.walk::<true>(ray, t_max, |leaf, t_max| {
            let mut nearest = None;
            for &index in &self.order[leaf.start as usize..leaf.end as usize] {
                nearest = visit(index, nearest.unwrap_or(t_max)).or(nearest);
            }
            nearest.map_or(Next::Go, Next::Shorten)
        });
    }

    /// Whether `visit` says yes to any primitive whose box the ray meets within `t_max`; it is
    /// not asked again after that. It gets original indices.
    pub fn any<F>(&self, ray: &Ray, t_max: f64, mut visit: F) -> bool
    where
        F: FnMut(u32) -> bool,
    {
        self.walk::<false>(ray, t_max, |leaf, _| {
            let yes = self.order[leaf.start as usize..leaf.end as usize].iter().any(|&index| visit(index));
            if yes { Next::Stop } else { Next::Go }
        })
    }

    /// Visits what is outside of the tree and then the leaves, nearest first where `SORTED`. True if a visit said stop.
    fn walk<const SORTED: bool>(
        &self,
        ray: &Ray,
        mut t_max: f64,
        mut visit: impl FnMut(Range<u32>, f64) -> Next,
    ) -> bool {
        // A tree this small costs more than it saves.
        const FEW: u32 = 4;
        let all = self.order.len() as u32;
        let outside = if self.bounded <= FEW { 0..all } else { self.bounded..all };
        if !outside.is_empty() {
            match visit(outside, t_max) {
                Next::Go => {}
                Next::Shorten(t) => t_max = t_max.min(t),
                Next::Stop => return true,
            }
        }
        if self.bounded <= FEW {
            return false;
        }
        let Some(ray) = self.enter(ray) else { return false };
        self.descend::<SORTED>(&ray, t_max, |_| {}, visit)
    }

    /// The ray, ready for this tree; none where it misses the whole.
    #[inline]
    pub(in crate::scene) fn enter(&self, ray: &Ray) -> Option<TreeRay> {
        if self.nodes.is_empty() { None } else { TreeRay::new(self, ray) }
    }

    /// Visits the leaves of a tree of blocks that the ray meets within `t_max`, nearest first where `SORTED`: `visit`
    /// gets a range of positions in [`Bvh::order`] and the distance that still counts. `soon` is told the first
    /// position of a leaf when it becomes likely that the leaf is visited: time to fetch its primitives into the
    /// cache. True if a visit said stop.
    #[inline(always)]
    pub(in crate::scene) fn descend<const SORTED: bool>(
        &self,
        ray: &TreeRay,
        mut t_max: f64,
        soon: impl Fn(u32),
        mut visit: impl FnMut(Range<u32>, f64) -> Next,
    ) -> bool {
        let mut limit = ray.limit(t_max);
        if limit < 0.0 || limit.is_nan() {
            return false;
        }
        let mut stack = [const { MaybeUninit::<Entry>::uninit() }; STACK];
        let mut depth = 0;
        let mut entry = Entry { near: 0.0, child: 0 };
        loop {
            if entry.child & LEAF == 0 {
                // The nearest child that the ray meets is next; the others wait, the nearest last, and are fetched.
                let node = &self.nodes[entry.child as usize];
                let (mut mask, near) = ray.meets(node, limit);
                if mask != 0 {
                    let near = near.as_array();
                    let mut take = || {
                        let slot = mask.trailing_zeros() as usize & 7;
                        mask &= mask - 1;
                        (Entry { near: near[slot], child: node.children[slot] }, mask != 0)
                    };
                    let (mut nearest, mut more) = take();
                    let bottom = depth;
                    while more {
                        let mut other;
                        (other, more) = take();
                        if SORTED && other.near < nearest.near {
                            std::mem::swap(&mut other, &mut nearest);
                        }
                        if other.child & LEAF == 0 {
                            prefetch(&self.nodes, other.child as usize);
                        } else {
                            soon((other.child & POSITION) * self.align);
                        }
                        let mut at = depth;
                        if SORTED {
                            while at > bottom {
                                // SAFETY: entries below `depth` have been written.
                                let below = unsafe { stack[at - 1].assume_init() };
                                if below.near >= other.near {
                                    break;
                                }
                                stack[at].write(below);
                                at -= 1;
                            }
                        }
                        stack[at].write(other);
                        depth += 1;
                    }
                    entry = nearest;
                    continue;
                }
            } else {
                let first = (entry.child & POSITION) * self.align;
                let count = (entry.child >> LEAF_COUNT_SHIFT & 7) + 1;
                match visit(first..first + count, t_max) {
                    Next::Go => {}
                    Next::Shorten(t) => {
                        t_max = t_max.min(t);
                        limit = ray.limit(t_max);
                    }
                    Next::Stop => return true,
                }
            }
            loop {
                if depth == 0 {
                    return false;
                }
                depth -= 1;
                // SAFETY: entries below the old `depth` have been written.
                entry = unsafe { stack[depth].assume_init() };
                if !SORTED || entry.near <= limit {
                    break;
                }
            }
        }
    }
}

/// Makes a box large enough for another.
fn widen(all: &mut ([f32; 3], [f32; 3]), lo: [f32; 3], hi: [f32; 3]) {
    for a in 0..3 {
        all.0[a] = all.0[a].min(lo[a]);
        all.1[a] = all.1[a].max(hi[a]);
    }
}

/// Gives `nodes` the boxes that hold their leaves; `leaf` tells that of a leaf by its position over the alignment and
/// its count. A node stands before its children.
fn fit(nodes: &mut [Node], leaf: impl Fn(usize, usize) -> ([f32; 3], [f32; 3])) {
    let mut of_node = vec![([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]); nodes.len()];
    for id in (0..nodes.len()).rev() {
        for slot in 0..8 {
            let child = nodes[id].children[slot];
            if child == EMPTY_CHILD {
                continue;
            }
            let part = if child & LEAF == 0 {
                of_node[child as usize]
            } else {
                leaf((child & POSITION) as usize, (child >> LEAF_COUNT_SHIFT & 7) as usize + 1)
            };
            nodes[id].set(slot, part.0, part.1, child);
            widen(&mut of_node[id], part.0, part.1);
        }
    }
}

/// Has [`Bvh::descend`] without `SORTED` visit leaves that are `first`, by their child words, before others of the same node.
fn put_first(nodes: &mut [Node], first: impl Fn(u32) -> bool) {
    let mut holds_first = vec![false; nodes.len()];
    // A node stands before its children.
    for id in (0..nodes.len()).rev() {
        let node = &nodes[id];
        let used = node.children.iter().filter(|child| **child != EMPTY_CHILD).count();
        let is_first = |slot: &usize| match node.children[*slot] {
            child if child & LEAF == 0 => holds_first[child as usize],
            child => first(child),
        };
        // The slots as they are visited: the first, then from the last to the second.
        let visited = |i: usize| if i == 0 { 0 } else { used - i };
        let mut order: Vec<usize> = (0..used).map(visited).collect();
        order.sort_by_key(|slot| !is_first(slot));
        let slots: Vec<usize> = (0..used).map(|slot| order[visited(slot)]).collect();
        holds_first[id] = order.first().is_some_and(is_first);
        nodes[id] = node.arranged(&slots);
    }
}

/// Asks for the cache lines of `items[index]`, which will be read soon.
#[inline(always)]
pub(in crate::scene) fn prefetch<T>(items: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = items.as_ptr().wrapping_add(index).cast::<i8>();
        for line in (0..size_of::<T>()).step_by(64) {
            // SAFETY: a prefetch of any address is allowed and changes nothing but the cache.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, index);
}

/// The largest f32 that is not above `x`; away from zero by at least 2⁻¹⁰⁰, so that nothing
/// becomes subnormal and slow.
fn plane_below(x: f64) -> f32 {
    const FLOOR: f32 = f32::from_bits((127 - 100) << 23);
    let x = round_down(x);
    if x.abs() < FLOOR { -FLOOR } else { x }
}

fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

#[cfg(test)]
mod tests;
