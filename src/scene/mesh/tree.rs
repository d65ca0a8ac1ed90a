//! A mesh with its hierarchy: eight triangles a leaf are tested at once in f32, and what that cannot rule out exactly.
//!
//! **No false misses.** [`Coarse`] repeats the test of [`TriangleRay`] in f32, from a point of the ray where it enters
//! the mesh. With u = 2⁻²⁴ and B the largest coordinate of the mesh, relative to its origin, the point has coordinates
//! of at most B, and those of a corner after the shear, X = (vx − ox) − sx (vz − oz) with |sx| ≤ 1, are off by at most
//! 14uB: 2uB from the rounding of the point, 2uB of that of sx, 4uB from the two differences, and 4uB or, without FMA,
//! 6uB from product and sum; all below δ = 16uB. The point itself is known to 2⁻⁵⁰ of the coordinates of the ray's
//! origin, which is added to δ. An edge function C.x B.y − C.y B.x is then off by at most
//! δ(|C.x| + |C.y| + |B.x| + |B.y|) + 2δ² for the coordinates, and 3u(|C.x B.y| + |C.y B.x|) for the arithmetic. No
//! coordinate exceeds 4B, so that the latter is at most 12uB(|B.x| + |B.y|), less than the δ once more. Twice the first
//! bound covers both, and the rounding of the bound.
//!
//! A mesh of one or two blocks needs no tree. There the point is the one nearest to the mesh's origin, or where the ray
//! begins beyond it. If the ray hits the mesh, that point is no farther away than what it hits, √3 B: the errors above are
//! at most √3 times as large, and δ is taken twice as large.

use super::Mesh;
use super::triangle::{TriangleHit, TriangleRay, area_vector};
use crate::math::Ray;
use crate::scene::bvh::{Aabb, Bvh, Joint, NO_PRIMITIVE, Next, TreeRay, prefetch};
use glam::DVec3;
use rayon::prelude::*;
use wide::f32x8;

/// Triangles a block.
const LANES: usize = 8;
/// The most blocks that are tried one after the other.
const FEW: usize = 2;
/// The most triangles of one mesh: 2²⁶.
pub const MAX_TRIANGLES: usize = 1 << 26;

/// Eight triangles by corner, axis, lane. A lane without triangle, or with one without area,
/// is NaN and never hit.
#[derive(Clone, Copy, Debug)]
struct Block([[f32x8; 3]; 3]);

impl Block {
    /// One axis of the corners of one triangle.
    #[inline(always)]
    fn axis(&self, k: usize, lane: usize) -> [f64; 3] {
        let at = |corner: &[f32x8; 3]| f64::from(corner[k].as_array()[lane]);
        [at(&self.0[0]), at(&self.0[1]), at(&self.0[2])]
    }

    /// The box of its triangles, relative to the mesh's origin; [`Aabb::EMPTY`] where there are none.
    fn bounds(&self) -> Aabb {
        let mut all = Aabb::EMPTY;
        for axis in 0..3 {
            let (mut lo, mut hi) = (f32::INFINITY, f32::NEG_INFINITY);
            for &x in self.0.iter().flat_map(|corner| corner[axis].as_array()) {
                // What is no number is neither.
                lo = if x < lo { x } else { lo };
                hi = if x > hi { x } else { hi };
            }
            (all.min[axis], all.max[axis]) = (lo.into(), hi.into());
        }
        all
    }

    /// The exact test of one triangle.
    #[inline(always)]
    fn meet(&self, ray: &TriangleRay, lane: usize) -> Option<TriangleHit> {
        let [kx, ky, kz] = ray.axes;
        let corners = [self.axis(kx, lane), self.axis(ky, lane), self.axis(kz, lane)];
        if cfg!(feature = "single_precision") { ray.meet_single(corners) } else { ray.meet(corners) }
    }
}

/// The nearest triangle on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshHit {
    /// Index into [`Mesh::triangles`].
    pub triangle: u32,
    /// Where on it.
    pub hit: TriangleHit,
}

/// A hierarchy over the triangles of one mesh. It has its own copy of the corners, so the mesh
/// itself is needed for surfaces only.
#[derive(Clone, Debug)]
pub struct MeshTree {
    bvh: Bvh,
    blocks: Vec<Block>,
    origin: DVec3,
    /// Largest coordinate of all corners, relative to the origin.
    extent: f64,
    /// How many there are.
    triangles: u32,
}

impl MeshTree {
    /// The hierarchy of `mesh`. Same mesh, same tree.
    ///
    /// # Panics
    /// Over more than [`MAX_TRIANGLES`], which [`Mesh::new`] refuses.
    #[must_use]
    pub fn build(mesh: &Mesh) -> MeshTree {
        MeshTree::over(mesh, Bvh::build_blocks(&boxes(mesh)))
    }

    /// Moves it.
    pub fn shift(&mut self, by: DVec3) {
        self.origin += by;
    }

    /// A hierarchy over `mesh` of the shape that this one has: cheaper than a new one, and as good where both are
    /// meshes of one file, turned, moved or resized. A new one where they have not as many triangles.
    #[must_use]
    pub fn again(&self, mesh: &Mesh) -> MeshTree {
        if self.triangles as usize != mesh.triangles.len() {
            return MeshTree::build(mesh);
        }
        let blocks = MeshTree::blocks(mesh, &self.bvh);
        let boxes: Vec<Aabb> = blocks.iter().map(Block::bounds).collect();
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
        if !bounds.is_finite() {
            return MeshTree::build(mesh);
        }
        let bvh = self.bvh.refitted(bounds, |position| boxes[position / LANES]);
        MeshTree::of(bvh, blocks, mesh)
    }

    /// One hierarchy over the triangles of several meshes of one [`Mesh::origin`]: triangles are numbered through, mesh
    /// after mesh. [`MeshTree::any_of`] looks for those of meshes that are `first` before it looks for others.
    ///
    /// # Panics
    /// Over more than [`MAX_TRIANGLES`], or where `parts` is empty.
    #[must_use]
    pub fn joined(mut parts: Vec<MeshTree>, first: &[bool]) -> MeshTree {
        if parts.len() == 1 {
            return parts.remove(0);
        }
        let joints = parts.iter().zip(first);
        let joints = joints.map(|(tree, &first)| Joint { tree: &tree.bvh, count: tree.triangles, first });
        let bvh = Bvh::joined(&joints.collect::<Vec<Joint>>());
        let part: Vec<(u32, u32)> =
            (0..).zip(&parts).flat_map(|(i, tree)| (0..tree.blocks.len() as u32).map(move |k| (i, k))).collect();
        let blocks =
            part.into_par_iter().with_min_len(1024).map(|(i, k)| parts[i as usize].blocks[k as usize]).collect();
        let extent = parts.iter().map(|tree| tree.extent).fold(0.0, f64::max);
        let triangles = parts.iter().map(|tree| tree.triangles).sum();
        MeshTree { bvh, blocks, origin: parts[0].origin, extent, triangles }
    }

    fn over(mesh: &Mesh, bvh: Bvh) -> MeshTree {
        let blocks = MeshTree::blocks(mesh, &bvh);
        MeshTree::of(bvh, blocks, mesh)
    }

    fn blocks(mesh: &Mesh, bvh: &Bvh) -> Vec<Block> {
        let block = |indices: &[u32]| {
            let mut out = Block([[f32x8::splat(f32::NAN); 3]; 3]);
            for (lane, &i) in indices.iter().enumerate().filter(|(_, i)| **i != NO_PRIMITIVE) {
                if area_vector(mesh.vertices(i)) == DVec3::ZERO {
                    continue;
                }
                for (corner, &v) in mesh.triangles[i as usize].iter().enumerate() {
                    for axis in 0..3 {
                        out.0[corner][axis].as_mut_array()[lane] = mesh.positions[v as usize][axis];
                    }
                }
            }
            out
        };
        bvh.order().chunks(LANES).map(block).collect()
    }

    fn of(bvh: Bvh, blocks: Vec<Block>, mesh: &Mesh) -> MeshTree {
        let Aabb { min, max } = bvh.bounds();
        let extent = min.abs().max(max.abs()).max_element();
        MeshTree { bvh, blocks, origin: mesh.origin, extent, triangles: mesh.triangles.len() as u32 }
    }

    /// The nearest triangle that `ray` hits at 0 < t < `t_max`, other than `skip`.
    #[must_use]
    pub fn closest(&self, ray: &Ray, t_max: f64, skip: Option<u32>) -> Option<MeshHit> {
        let mut found = None;
        self.nearest_of(ray, t_max, skip, |met| {
            found = Some(met);
            Some(met.hit.t)
        });
        found
    }

    /// Shows `met` the triangles that `ray` hits at 0 < t < `t_max`, other than `skip`, roughly front to back. From
    /// then on only what is nearer than it answers counts.
    #[inline(always)]
    pub(in crate::scene) fn nearest_of(
        &self,
        ray: &Ray,
        t_max: f64,
        skip: Option<u32>,
        mut met: impl FnMut(MeshHit) -> Option<f64>,
    ) {
        let skip = skip.unwrap_or(NO_PRIMITIVE);
        let mut visit = |ready: &Ready, first: usize, mut t_max: f64| {
            let mut next = Next::Go;
            self.hits_of(ready, first, [skip], |hit| {
                if hit.hit.t < t_max
                    && let Some(t) = met(hit)
                {
                    t_max = t;
                    next = Next::Shorten(t);
                }
                false
            });
            next
        };
        let local = self.local(ray);
        if self.is_small() {
            let (ready, mut t_max) = (Ready::small(&local, self.extent), t_max);
            for block in 0..self.blocks.len() {
                if let Next::Shorten(t) = visit(&ready, block * LANES, t_max) {
                    t_max = t_max.min(t);
                }
            }
            return;
        }
        let Some(entering) = self.bvh.enter(&local) else { return };
        let ready = Ready::entering(&local, &entering, self.extent);
        let soon = |i| prefetch(&self.blocks, i as usize / LANES);
        self.bvh.descend::<true>(&entering, t_max, soon, |leaf, t_max| visit(&ready, leaf.start as usize, t_max));
    }

    /// Whether `ray` hits any triangle at 0 < t < `t_max`, other than those in `skip`.
    #[must_use]
    pub fn any(&self, ray: &Ray, t_max: f64, skip: [Option<u32>; 2]) -> bool {
        self.any_of(ray, t_max, skip, |_| true)
    }

    /// Shows `met` the triangles that `ray` hits at 0 < t < `t_max`, other than those in `skip`, in any order, until
    /// it says stop; true if it did. A hit on the edge of two triangles is one on both.
    pub fn any_of(&self, ray: &Ray, t_max: f64, skip: [Option<u32>; 2], mut met: impl FnMut(MeshHit) -> bool) -> bool {
        let skip = skip.map(|triangle| triangle.unwrap_or(NO_PRIMITIVE));
        let mut visit =
            |ready: &Ready, first: usize| self.hits_of(ready, first, skip, |hit| hit.hit.t < t_max && met(hit));
        let local = self.local(ray);
        if self.is_small() {
            let ready = Ready::small(&local, self.extent);
            return (0..self.blocks.len()).any(|block| visit(&ready, block * LANES));
        }
        let Some(entering) = self.bvh.enter(&local) else { return false };
        let ready = Ready::entering(&local, &entering, self.extent);
        let soon = |i| prefetch(&self.blocks, i as usize / LANES);
        self.bvh.descend::<false>(&entering, t_max, soon, |leaf, _| {
            if visit(&ready, leaf.start as usize) { Next::Stop } else { Next::Go }
        })
    }

    /// Shows `met` where a ray meets the triangles of the block that starts at position `first`, other than those in
    /// `skip`, at t > 0, until it says stop; true if it did.
    #[inline(always)]
    fn hits_of<const N: usize>(
        &self,
        ready: &Ready,
        first: usize,
        skip: [u32; N],
        mut met: impl FnMut(MeshHit) -> bool,
    ) -> bool {
        let block = &self.blocks[first / LANES];
        let mut mask = ready.coarse.may_hit(block);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % LANES;
            mask &= mask - 1;
            // A ray meets the triangle that it leaves about where it begins: that is not tried, as rounding would decide.
            let triangle = self.bvh.order()[first + lane];
            if !skip.contains(&triangle)
                && let Some(hit) = block.meet(&ready.exact, lane)
                && met(MeshHit { triangle, hit })
            {
                return true;
            }
        }
        false
    }

    /// Whether its blocks are so few that a way down to them costs more than it saves.
    #[inline(always)]
    pub(in crate::scene) fn is_small(&self) -> bool {
        self.blocks.len() <= FEW
    }

    /// The box of the mesh in world space.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let b = self.bvh.bounds();
        Aabb { min: b.min + self.origin, max: b.max + self.origin }
    }

    /// Memory of the tree and its copy of the corners.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bvh.bytes() + self.blocks.capacity() * size_of::<Block>()
    }

    fn local(&self, ray: &Ray) -> Ray {
        Ray::new(ray.origin - self.origin, ray.direction)
    }
}

/// A ray in the frame of the exact test and in that of the coarse one.
struct Ready {
    exact: TriangleRay,
    coarse: Coarse,
}

impl Ready {
    /// For the leaves of a tree that it enters.
    #[inline(always)]
    fn entering(local: &Ray, entering: &TreeRay, extent: f64) -> Ready {
        let exact = TriangleRay::new(local, DVec3::ZERO);
        Ready { coarse: Coarse::new(&exact, local, entering.entry(), extent), exact }
    }

    /// For all triangles of a mesh: from where it is nearest to the mesh's origin.
    #[inline(always)]
    fn small(local: &Ray, extent: f64) -> Ready {
        let exact = TriangleRay::new(local, DVec3::ZERO);
        let d = local.direction;
        let nearest = (-local.origin.dot(d) / d.length_squared()).max(0.0);
        // Twice the slack: see the page of the module.
        Ready { coarse: Coarse::new(&exact, local, nearest, 2.0 * extent), exact }
    }
}

/// Boxes of triangles relative to the mesh's origin, as rays are: nothing is rounded.
fn boxes(mesh: &Mesh) -> Vec<Aabb> {
    (0..mesh.triangles.len()).map(|i| Aabb::from_points(mesh.vertices(i as u32))).collect()
}

/// A ray made ready for blocks of triangles, in f32: rules out what it misses by more than rounding.
struct Coarse {
    axes: [usize; 3],
    /// Where the ray enters the mesh, in the order of `axes`.
    origin: [f32; 3],
    shear: [f32; 2],
    /// 2δ; see the page of the module.
    slack: f32,
    /// False where the mesh is so small or large that products leave the range of f32.
    rules_out: bool,
}

impl Coarse {
    /// `entry` is how far `ray` goes to the mesh, and `extent` the largest coordinate there.
    #[inline(always)]
    fn new(sheared: &TriangleRay, ray: &Ray, entry: f64, extent: f64) -> Coarse {
        /// 2 · 16u.
        const SLACK: f64 = if cfg!(feature = "single_precision") { 0.0 } else { 1.0 / (1u64 << 19) as f64 };
        /// 2 · 2⁻⁵⁰.
        const ORIGIN: f64 = 1.0 / (1u64 << 49) as f64;
        const LARGE: f64 = (1u64 << 40) as f64;
        let axes = sheared.axes;
        let point = ray.at(entry).to_array();
        let [sx, sy, _] = sheared.shear;
        let slack = SLACK * extent + ORIGIN * ray.origin.abs().max_element();
        Coarse {
            axes,
            origin: axes.map(|k| point[k] as f32),
            shear: [sx as f32, sy as f32],
            slack: slack as f32,
            rules_out: extent > 1.0 / LARGE && slack < LARGE,
        }
    }

    /// A bit for each triangle that the line of the ray may hit.
    #[inline(always)]
    fn may_hit(&self, block: &Block) -> u32 {
        if !self.rules_out {
            return (1 << LANES) - 1;
        }
        let [kx, ky, kz] = self.axes;
        let splat = f32x8::splat;
        let (ox, oy, oz) = (splat(self.origin[0]), splat(self.origin[1]), splat(self.origin[2]));
        let (sx, sy, slack) = (splat(self.shear[0]), splat(self.shear[1]), splat(self.slack));
        let corner = |v: &[f32x8; 3]| {
            let z = v[kz] - oz;
            let (x, y) = (sx.mul_neg_add(z, v[kx] - ox), sy.mul_neg_add(z, v[ky] - oy));
            // δ is in the sizes, so that the bound of an edge is 2δ times the sum of two of them.
            (x, y, x.abs() + y.abs() + slack)
        };
        let (a, b, c) = (corner(&block.0[0]), corner(&block.0[1]), corner(&block.0[2]));
        let edge =
            |p: &(f32x8, f32x8, f32x8), q: &(f32x8, f32x8, f32x8)| (p.0.mul_sub(q.1, p.1 * q.0), slack * (p.2 + q.2));
        let ((e0, t0), (e1, t1), (e2, t2)) = (edge(&c, &b), edge(&a, &c), edge(&b, &a));
        let most = (e0 + t0).fast_min(e1 + t1).fast_min(e2 + t2);
        let least = (e0 - t0).fast_max(e1 - t1).fast_max(e2 - t2);
        // A lane of NaN is none: all its numbers are.
        (most.simd_ge(f32x8::ZERO) | least.simd_le(f32x8::ZERO)).to_bitmask()
    }
}
