//! Rays against the boxes of a tree, in f32 and without false misses.
//!
//! A ray that meets a primitive's f64 box, in exact arithmetic, always reaches that primitive.
//! It is moved in f64 to where it enters the whole tree, so that its origin is never far away, and
//! then tested against planes x = b in f32. With u = 2⁻²⁴:
//! - The origin is known to within `pad` = 2⁻⁴⁰ + 2⁻⁵¹·|o|, where |o| is its coordinate before
//!   the move: 2⁻⁵³·|o| from the subtraction of the centre, 2⁻⁵³·(2·|o| + 4) from the move, and
//!   2⁻⁵²·2 for the rounding of the box in f64. The near plane uses the end of that interval
//!   that brings it closer and the far plane the other end; both ends are moved outward by 2u
//!   of their size and then rounded to nearest, which moves them by u.
//! - (b − o)·(1/d) then has three roundings, of 1/d, difference and product: a factor in
//!   1 ± (3u + 3u² + u³), and one of 2⁻⁵³. The reciprocal of the near planes is made smaller by
//!   4u and that of the far planes larger by 4u before it is rounded, which outweighs them.
//!   A negative near distance counts as zero, so that rounding it wrongly does not matter.
//! - |1/d| is cut at 2¹²⁰, which serves d = ±0 as well. Within the slab, far plane and origin
//!   differ by at least `pad`, so that the far distance is at least 2⁻⁴⁰·2¹²⁰ tree sizes: never
//!   less than a distance that matters; the near distance is not positive. Without infinities
//!   there is no 0·∞.
//!
//! Compare Ize 2013, "Robust BVH Ray Traversal", which has f32 rays and needs no pad.

use super::{Bvh, Node};
use crate::math::Ray;
use glam::DVec3;
use wide::{f32x8, f64x4};

/// Half an ulp of f32 at 1.
const U: f64 = 1.0 / (1u64 << 24) as f64;
/// The least uncertainty of a ray's origin, in tree coordinates.
const PAD: f64 = 1.0 / (1u64 << 40) as f64;

/// A ray in tree coordinates, ready for f32 planes; see the module for the bounds.
pub(in crate::scene) struct TreeRay {
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    near_inverse: [f32; 3],
    far_inverse: [f32; 3],
    /// Index into [`Node::planes`].
    near_plane: [usize; 3],
    /// Distance from the origin to where the ray enters the tree, and world to tree.
    skipped: f64,
    scale: f64,
}

impl TreeRay {
    /// None where the ray misses the root.
    pub(super) fn new(tree: &Bvh, ray: &Ray) -> Option<TreeRay> {
        /// Cut of |1/d|: 2¹²⁰.
        const STEEPEST: f64 = f64::from_bits((1023 + 120) << 52);
        /// 4u of f64.
        const SLACK_F64: f64 = 1.0 / (1u64 << 51) as f64;
        /// Where the pad of a ray dwarfs the tree: such a ray meets every box.
        const FAR_AWAY: f64 = 1e30;

        let lanes = |v: DVec3| f64x4::new([v.x, v.y, v.z, 0.0]);
        let splat = f64x4::splat;
        let direction = lanes(ray.direction);
        let origin = lanes((ray.origin - tree.centre) * tree.scale);
        let pad = origin.abs().mul_add(splat(SLACK_F64), splat(PAD));
        let inverse = (splat(1.0) / direction).fast_max(splat(-STEEPEST)).fast_min(splat(STEEPEST));
        let backward = inverse.simd_lt(f64x4::ZERO);

        // The root, in f64.
        let (lo, hi) = (tree.root[0] - pad, tree.root[1] + pad);
        let near = (backward.select(hi, lo) - origin) * (inverse * splat(1.0 - SLACK_F64));
        let far = (backward.select(lo, hi) - origin) * (inverse * splat(1.0 + SLACK_F64));
        let [n, f] = [near.to_array(), far.to_array()];
        let skipped = n[0].max(n[1]).max(n[2]).max(0.0);
        if skipped > f[0].min(f[1]).min(f[2]) {
            return None;
        }
        let moved = direction.mul_add(splat(skipped), origin);
        // A ray that is not made of numbers misses.
        if !moved.to_array()[..3].iter().all(|x| x.is_finite()) {
            return None;
        }

        // Both ends of the interval that holds the origin. 2u more than it needs, so that
        // rounding to nearest stays outside.
        let wide = (moved.abs() + pad).mul_add(splat(2.0 * U), pad);
        let narrow = |v: f64x4| {
            let v = v.to_array();
            [v[0] as f32, v[1] as f32, v[2] as f32]
        };
        // Where the pad dwarfs the tree, the ray meets every box.
        let lost = wide.simd_gt(splat(FAR_AWAY));
        let above = lost.select(splat(FAR_AWAY), moved + wide);
        let below = lost.select(splat(-FAR_AWAY), moved - wide);
        let back = backward.to_bitmask() as usize;
        Some(TreeRay {
            near_origin: narrow(backward.select(below, above)),
            far_origin: narrow(backward.select(above, below)),
            near_inverse: narrow(inverse * splat(1.0 - 4.0 * U)),
            far_inverse: narrow(inverse * splat(1.0 + 4.0 * U)),
            near_plane: [back & 1, 2 + (back >> 1 & 1), 4 + (back >> 2 & 1)],
            skipped,
            scale: tree.scale,
        })
    }

    /// Metres from the origin to where the ray enters the whole.
    #[inline]
    pub(in crate::scene) fn entry(&self) -> f64 {
        self.skipped / self.scale
    }

    /// `t_max` in tree distance from the entry, rounded up; negative where it is not reached.
    ///
    /// The product is exact and the difference rounds by 2⁻⁵³ of itself: one ulp of f32 and the
    /// pad cover it, and the 2⁻⁵³ of `skipped` by which intersectors may round t.
    #[inline]
    pub(super) fn limit(&self, t_max: f64) -> f32 {
        let t = t_max.mul_add(self.scale, PAD - self.skipped * (1.0 - PAD));
        (t + t.abs() * (2.0 * U)) as f32
    }

    /// Which children the ray meets no farther than `limit`, and where it enters them.
    #[inline(always)]
    pub(super) fn meets(&self, node: &Node, limit: f32) -> (u32, f32x8) {
        let splat = f32x8::splat;
        let near =
            |a: usize| (node.planes[self.near_plane[a]] - splat(self.near_origin[a])) * splat(self.near_inverse[a]);
        let far =
            |a: usize| (node.planes[self.near_plane[a] ^ 1] - splat(self.far_origin[a])) * splat(self.far_inverse[a]);
        let enter = near(0).fast_max(near(1)).fast_max(near(2)).fast_max(f32x8::ZERO);
        let leave = far(0).fast_min(far(1)).fast_min(far(2)).fast_min(f32x8::splat(limit));
        (enter.simd_le(leave).to_bitmask(), enter)
    }
}
