//! A mesh with its hierarchy: triangles are tested four at a time, up to eight a leaf.

use super::Mesh;
use super::triangle::{TriangleHit, TriangleRay, area_vector};
use crate::math::Ray;
use crate::scene::bvh::{Aabb, Bvh, NO_PRIMITIVE, prefetch};
use glam::DVec3;
use wide::f64x4;

/// Triangles a block.
const LANES: usize = 4;
/// The most triangles of one mesh: 2²⁶, the positions of 2²⁸ that blocks leave in the worst case.
pub const MAX_TRIANGLES: usize = 1 << 26;

/// Four triangles by corner, axis, lane. A lane without triangle, or with one without area,
/// is NaN and never hit.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
struct Block([[[f32; LANES]; 3]; 3]);

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
}

impl MeshTree {
    /// The hierarchy of `mesh`. Same mesh, same tree.
    ///
    /// # Panics
    /// Over more than [`MAX_TRIANGLES`], which [`Mesh::new`] refuses.
    #[must_use]
    pub fn build(mesh: &Mesh) -> MeshTree {
        MeshTree::over(mesh, Bvh::build_blocks(&boxes(mesh), LANES))
    }

    /// A hierarchy over `mesh` of the shape that this one has: cheaper than a new one, and as good where both are
    /// meshes of one file, turned, moved or resized. A new one where they have not as many triangles.
    #[must_use]
    pub fn again(&self, mesh: &Mesh) -> MeshTree {
        match self.bvh.refitted(&boxes(mesh)) {
            Some(bvh) => MeshTree::over(mesh, bvh),
            None => MeshTree::build(mesh),
        }
    }

    /// One hierarchy over the triangles of several meshes of one [`Mesh::origin`], each given with its own: triangles
    /// are numbered through, mesh after mesh.
    ///
    /// # Panics
    /// Over more than [`MAX_TRIANGLES`], or where `parts` is empty.
    #[must_use]
    pub fn joined(parts: &[(&Mesh, &MeshTree)]) -> MeshTree {
        let boxes: Vec<Vec<Aabb>> = parts.iter().map(|(mesh, _)| boxes(mesh)).collect();
        let trees: Vec<(&Bvh, &[Aabb])> = parts.iter().zip(&boxes).map(|((_, t), b)| (&t.bvh, &**b)).collect();
        let blocks = parts.iter().flat_map(|(_, tree)| &tree.blocks).copied().collect();
        MeshTree { bvh: Bvh::joined(&trees), blocks, origin: parts[0].0.origin }
    }

    fn over(mesh: &Mesh, bvh: Bvh) -> MeshTree {
        let block = |indices: &[u32]| {
            let mut out = Block([[[f32::NAN; LANES]; 3]; 3]);
            for (lane, &i) in indices.iter().enumerate().filter(|(_, i)| **i != NO_PRIMITIVE) {
                if area_vector(mesh.vertices(i)) == DVec3::ZERO {
                    continue;
                }
                for (corner, &v) in mesh.triangles[i as usize].iter().enumerate() {
                    for axis in 0..3 {
                        out.0[corner][axis][lane] = mesh.positions[v as usize][axis];
                    }
                }
            }
            out
        };
        let blocks = bvh.order().chunks(LANES).map(block).collect();
        MeshTree { bvh, blocks, origin: mesh.origin }
    }

    /// The nearest triangle that `ray` hits at 0 < t < `t_max`, other than `skip`.
    #[must_use]
    pub fn closest(&self, ray: &Ray, t_max: f64, skip: Option<u32>) -> Option<MeshHit> {
        let sheared = TriangleRay::new(ray, self.origin);
        let mut found = None;
        self.bvh.closest_block(
            &self.local(ray),
            t_max,
            |i| prefetch(&self.blocks, i as usize / LANES),
            |leaf, mut t_max| {
                let before = t_max;
                for b in leaf.start as usize / LANES..(leaf.end as usize).div_ceil(LANES) {
                    sheared.each_hit(&self.blocks[b], t_max, |lane, hit| {
                        let triangle = self.bvh.order()[b * LANES + lane];
                        if hit.t < t_max && Some(triangle) != skip {
                            t_max = hit.t;
                            found = Some(MeshHit { triangle, hit });
                        }
                        false
                    });
                }
                (t_max < before).then_some(t_max)
            },
        );
        found
    }

    /// Whether `ray` hits any triangle at 0 < t < `t_max`, other than those in `skip`.
    #[must_use]
    pub fn any(&self, ray: &Ray, t_max: f64, skip: [Option<u32>; 2]) -> bool {
        self.any_of(ray, t_max, skip, |_| true)
    }

    /// Shows `met` the triangles that `ray` hits at 0 < t < `t_max`, other than those in `skip`, in any order, until
    /// it says stop; true if it did. A hit on the edge of two triangles is one on both.
    pub fn any_of(&self, ray: &Ray, t_max: f64, skip: [Option<u32>; 2], mut met: impl FnMut(MeshHit) -> bool) -> bool {
        let sheared = TriangleRay::new(ray, self.origin);
        self.bvh.any_block(
            &self.local(ray),
            t_max,
            |i| prefetch(&self.blocks, i as usize / LANES),
            |leaf| {
                (leaf.start as usize / LANES..(leaf.end as usize).div_ceil(LANES)).any(|b| {
                    sheared.each_hit(&self.blocks[b], t_max, |lane, hit| {
                        let triangle = self.bvh.order()[b * LANES + lane];
                        !skip.contains(&Some(triangle)) && met(MeshHit { triangle, hit })
                    })
                })
            },
        )
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

/// Boxes of triangles relative to the mesh's origin, as rays are: nothing is rounded.
fn boxes(mesh: &Mesh) -> Vec<Aabb> {
    (0..mesh.triangles.len()).map(|i| Aabb::from_points(mesh.vertices(i as u32))).collect()
}

impl TriangleRay {
    /// Four corners in the coordinates of the ray.
    #[inline(always)]
    fn shear_x4(&self, corners: &[[f32; LANES]; 3]) -> [f64x4; 3] {
        let [kx, ky, kz] = self.axes;
        let [sx, sy, sz] = self.shear;
        let x = widen(&corners[kx]) - f64x4::splat(self.origin[0]);
        let y = widen(&corners[ky]) - f64x4::splat(self.origin[1]);
        let z = widen(&corners[kz]) - f64x4::splat(self.origin[2]);
        [f64x4::splat(sx).mul_neg_add(z, x), f64x4::splat(sy).mul_neg_add(z, y), f64x4::splat(sz) * z]
    }

    /// Calls `visit` with the lanes of `block` that the ray hits before `t_max` until it says
    /// stop; true if it did. The arithmetic is that of [`TriangleRay::intersect`], step by
    /// step, so the results are the same bits.
    #[inline(always)]
    fn each_hit(&self, block: &Block, t_max: f64, mut visit: impl FnMut(usize, TriangleHit) -> bool) -> bool {
        // Without FMA in hardware, four lanes would round each product: one lane at a time then.
        if cfg!(not(any(target_feature = "fma", target_arch = "aarch64"))) {
            return (0..LANES).any(|lane| {
                let corners = block.0.map(|v| DVec3::from(v.map(|axis| f64::from(axis[lane]))));
                self.intersect(corners).is_some_and(|hit| hit.t < t_max && visit(lane, hit))
            });
        }
        let a = self.shear_x4(&block.0[0]);
        let b = self.shear_x4(&block.0[1]);
        let c = self.shear_x4(&block.0[2]);
        let e0 = difference_of_products_x4(c[0], b[1], c[1], b[0]);
        let e1 = difference_of_products_x4(a[0], c[1], a[1], c[0]);
        let e2 = difference_of_products_x4(b[0], a[1], b[1], a[0]);
        let least = e0.fast_min(e1).fast_min(e2);
        let most = e0.fast_max(e1).fast_max(e2);
        let inside = least.simd_ge(f64x4::ZERO) | most.simd_le(f64x4::ZERO);
        if inside.to_bitmask() == 0 {
            return false;
        }
        let det = e0 + e1 + e2;
        let t = e2.mul_add(c[2], e1.mul_add(b[2], e0 * a[2])) / det;
        let hit = inside & t.simd_gt(f64x4::ZERO) & t.simd_lt(f64x4::splat(t_max));
        let mut mask = hit.to_bitmask();
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & (LANES - 1);
            mask &= mask - 1;
            let at = |x: &f64x4| x.as_array()[lane];
            let det = at(&det);
            if visit(lane, TriangleHit { t: at(&t), b1: at(&e1) / det, b2: at(&e2) / det }) {
                return true;
            }
        }
        false
    }
}

#[inline(always)]
fn widen(x: &[f32; LANES]) -> f64x4 {
    f64x4::new([f64::from(x[0]), f64::from(x[1]), f64::from(x[2]), f64::from(x[3])])
}

#[inline(always)]
fn difference_of_products_x4(a: f64x4, b: f64x4, c: f64x4, d: f64x4) -> f64x4 {
    let cd = c * d;
    let error = c.mul_neg_add(d, cd);
    a.mul_sub(b, cd) + error
}
