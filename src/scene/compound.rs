//! Materials that are made of others: masks, blends, two sides, reliefs.
//!
//! A path resolves them at each vertex before any light is computed: one random number picks the side of each
//! mask and blend with exactly its weight, reliefs turn the frame, and what remains is an ordinary material. Given
//! the choice, light found through lamps and through scattering is that of one material with one density, so each
//! conditional estimate is unbiased, hence their mean; the price is noise where a blend's halves differ much, the
//! gain that a blend of any depth costs one material. Light that passes masks straight on counts in shadow rays by
//! its expected share ([`Compound::straight`]).
//!
//! # Reliefs
//! A bump map displaces the surface by h along its normal n, to first order in h: ∂p′/∂u = ∂p/∂u + n (∂h/∂u − n·∂p/∂u),
//! likewise v (Blinn 1978, with the part of the partials along n replaced, as in Mitsuba 3); a normal map gives
//! the normal outright, in the frame of the shading normal and ∂p/∂u. Slopes shadow each other by the G₁ of Estevez,
//! Lecocq and Stachowiak 2019 ("A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem"), with
//! α² = tan²θ/8 of the turned normal, at most 1.

use super::material::{Kind, Material, Straight};
use super::texture::{Scalar, TexturePoint};
use super::{Hit, Scene, SurfacePoint};
use crate::math::Frame;
use crate::spectrum::Lanes;
use glam::DVec3;
use std::sync::Arc;

/// A material made of others.
#[derive(Clone, Debug)]
pub struct Compound {
    /// How.
    pub composition: Composition,
    /// Most reliefs over each other.
    pub reliefs: usize,
    /// Whether its back is made of something else than its front, which may have other holes.
    pub sided: bool,
}

/// The most reliefs over each other.
pub const MOST_RELIEFS: usize = 4;

/// One layer.
#[derive(Clone, Debug)]
pub enum Composition {
    /// Light goes straight on with probability 1 − opacity.
    Mask {
        /// From 0 to 1; beyond it is clamped.
        opacity: Scalar,
        /// What the rest meets.
        inner: Arc<Material>,
    },
    /// Two materials by weight.
    Blend {
        /// Share of the second, from 0 to 1; beyond it is clamped.
        weight: Scalar,
        /// Where the weight is 0.
        first: Arc<Material>,
        /// Where it is 1.
        second: Arc<Material>,
    },
    /// A material for each side, neither of which has sides in it ([`one_side`]); the back is the front's mirror image.
    TwoSided {
        /// On the side of the normal.
        front: Arc<Material>,
        /// On the other.
        back: Arc<Material>,
    },
    /// A material over a relief.
    Relief {
        /// The relief.
        relief: Relief,
        /// What covers it.
        inner: Arc<Material>,
    },
}

/// How a surface's normals differ from those of its shape.
#[derive(Clone, Debug)]
pub struct Relief {
    /// By height or by normals.
    pub form: ReliefForm,
    /// Whether a normal that the viewer would see from behind is turned by half a turn about the shading normal.
    pub turn: bool,
    /// Whether slopes shadow each other.
    pub shadowing: bool,
}

/// What a relief is given by.
#[derive(Clone, Debug)]
pub enum ReliefForm {
    /// Heights along the normal, metres.
    Heights {
        /// The heights.
        heights: Scalar,
        /// Factor on them.
        scale: f64,
    },
    /// Normals n as (n + 1)/2.
    Normals(Scalar),
}

/// The shadowing of slopes under one vertex.
#[derive(Clone, Copy, Debug, Default)]
pub struct Slopes {
    /// The normal that was turned and α², relief by relief.
    turned: [(DVec3, f64); MOST_RELIEFS],
    count: usize,
}

impl Slopes {
    /// The share of light toward or from `wi` that other slopes do not stop.
    #[must_use]
    pub fn shadowing(&self, wi: DVec3) -> f64 {
        self.turned[..self.count].iter().map(|&(n, alpha2)| shadowing(alpha2, wi.dot(n))).product()
    }
}

/// G₁ of GGX at cos θ = `cos`.
fn shadowing(alpha2: f64, cos: f64) -> f64 {
    let cos2 = cos * cos;
    let tan2 = (1.0 - cos2).max(0.0) / cos2;
    // Infinite at grazing, where nothing is left.
    2.0 / (1.0 + alpha2.mul_add(tan2, 1.0).sqrt())
}

/// Which of the reliefs that turn toward their viewer are turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turns {
    /// Those that the vertex's `wo` would see from behind.
    Seen,
    /// The k-th of them if bit k is set: as somebody else sees them.
    Given(u8),
}

/// What a compound material is to one path at one vertex.
#[derive(Clone, Copy, Debug)]
pub struct Leaf<'a> {
    /// The material itself; not compound.
    pub material: &'a Material,
    /// The local frame: z is the normal, turned to the viewer where the material's other side is seen.
    pub frame: Frame,
    /// True where it was turned.
    pub flipped: bool,
    /// How the relief's slopes shadow each other.
    pub slopes: Slopes,
    /// How many reliefs turn toward their viewer.
    pub turning: u8,
    /// Which of them are turned, a bit each.
    pub turned: u8,
}

/// A vertex on a compound material.
#[derive(Clone, Copy)]
pub struct Vertex<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Where on the object.
    pub hit: &'a Hit,
    /// The surface there.
    pub surface: &'a SurfacePoint,
    /// The same for textures.
    pub at: &'a TexturePoint,
    /// To the viewer, world.
    pub wo: DVec3,
}

/// The frame of a vertex on its way through the layers. It stands on the front; where the back is seen everything
/// happens in its mirror image about the tangent plane.
#[derive(Clone, Copy)]
pub struct Standing {
    frame: Frame,
    /// Where the back is seen, the normal of the plane about which it mirrors the front.
    mirrored: Option<DVec3>,
    slopes: Slopes,
    turns: Turns,
    turning: u8,
    turned: u8,
}

impl Standing {
    /// On the surface itself, with the shading normal `normal`.
    #[must_use]
    pub fn new(normal: DVec3, tangent: DVec3) -> Standing {
        let frame = Frame::from_normal_and_tangent(normal, tangent);
        let (slopes, turns) = (Slopes::default(), Turns::Seen);
        Standing { frame, mirrored: None, slopes, turns, turning: 0, turned: 0 }
    }

    /// Seen from behind, by a material with two sides.
    pub fn mirror(&mut self) {
        self.mirrored = Some(self.frame.n);
    }

    /// A direction in the mirror.
    fn reflected(&self, v: DVec3) -> DVec3 {
        self.mirrored.map_or(v, |n| v - n * (2.0 * v.dot(n)))
    }

    /// True where it is seen from behind.
    #[must_use]
    pub fn is_mirrored(&self) -> bool {
        self.mirrored.is_some()
    }

    /// Turns the frame as `relief` says.
    pub fn turn(&mut self, relief: &Relief, x: &Vertex) {
        let n = self.frame.n;
        let local = match &relief.form {
            ReliefForm::Normals(normals) => normals.triple(x.at) * 2.0 - DVec3::ONE,
            ReliefForm::Heights { heights, scale } => {
                let slope = heights.gradient(x.at) * *scale;
                let [by_u, by_v] = x.scene.uv_gradient(x.hit, x.surface).partials();
                let turned = (by_u + n * (slope.x - n.dot(by_u))).cross(by_v + n * (slope.y - n.dot(by_v)));
                // u, v may run either way around the normal.
                self.frame.to_local(if turned.dot(x.surface.normal) < 0.0 { -turned } else { turned })
            }
        };
        let wo = self.frame.to_local(self.reflected(x.wo));
        let turned = relief.turn
            && match self.turns {
                Turns::Seen => wo.z * wo.dot(local) <= 0.0,
                Turns::Given(turned) => turned >> self.turning & 1 == 1,
            };
        self.turned |= u8::from(turned) << self.turning;
        self.turning += u8::from(relief.turn);
        let local = if turned { DVec3::new(-local.x, -local.y, local.z) } else { local };
        // A texel without direction leaves the surface as it is.
        let Some(local) = local.try_normalize() else { return };
        if relief.shadowing && self.slopes.count < MOST_RELIEFS {
            let tan2 = (local.x * local.x + local.y * local.y) / (local.z * local.z);
            // A normal in the surface has an infinite slope.
            self.slopes.turned[self.slopes.count] = (self.reflected(n), (0.125 * tan2).min(1.0));
            self.slopes.count += 1;
        }
        self.frame = Frame::from_normal_and_tangent(self.frame.to_world(local), self.frame.s);
    }

    /// The local frame: right-handed, z on the side that is seen where the material has two.
    #[must_use]
    pub fn frame(&self) -> Frame {
        if self.mirrored.is_none() {
            return self.frame;
        }
        let (s, n) = (self.reflected(self.frame.s), self.reflected(self.frame.n));
        Frame { s, t: n.cross(s), n }
    }

    /// How the slopes shadow each other.
    #[must_use]
    pub fn slopes(&self) -> Slopes {
        self.slopes
    }
}

/// Splits a random number at `share`: true below it. What is left of `u` is uniform again.
pub fn below(u: &mut f64, share: f64) -> bool {
    if *u < share {
        *u /= share;
        true
    } else {
        *u = (*u - share) / (1.0 - share);
        false
    }
}

impl Compound {
    /// A layer over materials that are made.
    #[must_use]
    pub fn new(composition: Composition) -> Compound {
        let inner = composition.inner();
        let reliefs = inner.iter().map(|m| m.compound().map_or(0, |l| l.reliefs)).max().unwrap_or(0);
        let reliefs = reliefs + usize::from(matches!(composition, Composition::Relief { .. }));
        let sided = match &composition {
            Composition::TwoSided { front, back } => !Arc::ptr_eq(front, back),
            _ => inner.iter().any(|m| m.compound().is_some_and(|l| l.sided)),
        };
        Compound { composition, reliefs, sided }
    }

    /// The material that one path meets, chosen by `u` in [0, 1); `None` where it goes straight on. `normal` is the
    /// shading normal on the side of the true one.
    #[must_use]
    pub fn resolve<'a>(&'a self, x: &Vertex, normal: DVec3, u: f64) -> Option<Leaf<'a>> {
        self.resolve_as(x, normal, Turns::Seen, u)
    }

    /// The same with the reliefs turned as they are said to be.
    #[must_use]
    pub fn resolve_as<'a>(&'a self, x: &Vertex, normal: DVec3, turns: Turns, mut u: f64) -> Option<Leaf<'a>> {
        self.choose(x, normal, turns, &mut u)
    }

    /// The same; what is left of `u` is uniform again, also where the path goes straight on.
    pub fn choose<'a>(&'a self, x: &Vertex, normal: DVec3, turns: Turns, u: &mut f64) -> Option<Leaf<'a>> {
        let mut standing = Standing { turns, ..Standing::new(normal, x.surface.tangent) };
        let from_behind = x.wo.dot(x.surface.normal) < 0.0;
        let mut compound = self;
        loop {
            let inner = match &compound.composition {
                Composition::Mask { opacity, inner } => {
                    if !below(u, share(opacity, x.at)) {
                        return None;
                    }
                    inner
                }
                Composition::Blend { weight, first, second } => {
                    if below(u, share(weight, x.at)) {
                        second
                    } else {
                        first
                    }
                }
                Composition::TwoSided { front, back } => {
                    if from_behind && !standing.is_mirrored() {
                        standing.mirror();
                        back
                    } else {
                        front
                    }
                }
                Composition::Relief { relief, inner } => {
                    standing.turn(relief, x);
                    inner
                }
            };
            match inner.compound() {
                Some(next) => compound = next,
                None => {
                    if inner.two_sided && from_behind && !standing.is_mirrored() {
                        standing.mirror();
                    }
                    let (frame, flipped) = (standing.frame(), standing.is_mirrored());
                    let Standing { slopes, turning, turned, .. } = standing;
                    return Some(Leaf { material: inner, frame, flipped, slopes, turning, turned });
                }
            }
        }
    }

    /// What goes straight on at `surface` in `direction`; `None` where nothing can.
    #[must_use]
    pub fn straight(&self, surface: &SurfacePoint, direction: DVec3, at: &TexturePoint, nm: Lanes) -> Option<Straight> {
        let inner = |material: &Material| material.straight(surface, direction, || *at, nm);
        match &self.composition {
            Composition::Mask { opacity, inner: material } => {
                mixed(Some(Straight::OPEN), inner(material), share(opacity, at))
            }
            Composition::Blend { weight, first, second } => mixed(inner(first), inner(second), share(weight, at)),
            Composition::TwoSided { front, back } => {
                inner(if direction.dot(surface.normal) > 0.0 { back } else { front })
            }
            Composition::Relief { inner: material, .. } => inner(material),
        }
    }

    /// See [`Material::open`].
    #[must_use]
    pub fn open(&self, surface: &SurfacePoint, direction: DVec3, at: &TexturePoint) -> f64 {
        let inner = |material: &Material| material.open(surface, direction, at);
        let mixed = |first: f64, second: f64, weight: f64| first * (1.0 - weight) + second * weight;
        match &self.composition {
            Composition::Mask { opacity, inner: material } => mixed(1.0, inner(material), share(opacity, at)),
            Composition::Blend { weight, first, second } => mixed(inner(first), inner(second), share(weight, at)),
            Composition::TwoSided { front, back } => {
                inner(if direction.dot(surface.normal) > 0.0 { back } else { front })
            }
            Composition::Relief { inner: material, .. } => inner(material),
        }
    }

    /// True where the layer itself varies over the surface.
    #[must_use]
    pub fn varies(&self) -> bool {
        match &self.composition {
            Composition::Mask { opacity: s, .. } | Composition::Blend { weight: s, .. } => s.varies(),
            Composition::TwoSided { .. } => false,
            Composition::Relief { .. } => true,
        }
    }
}

/// `material` as it is on one side of another: of what has two sides of its own the front is there, and the back never seen.
#[must_use]
pub fn one_side(material: &Arc<Material>) -> Arc<Material> {
    let Some(compound) = material.compound().filter(|_| has_sides(material)) else { return material.clone() };
    let composition = match &compound.composition {
        Composition::TwoSided { front, .. } => return one_side(front),
        Composition::Mask { opacity, inner } => Composition::Mask { opacity: opacity.clone(), inner: one_side(inner) },
        Composition::Blend { weight, first, second } => {
            Composition::Blend { weight: weight.clone(), first: one_side(first), second: one_side(second) }
        }
        Composition::Relief { relief, inner } => Composition::Relief { relief: relief.clone(), inner: one_side(inner) },
    };
    Arc::new(Material { kind: Kind::Compound(Box::new(Compound::new(composition))), ..(**material).clone() })
}

fn has_sides(material: &Material) -> bool {
    material.compound().is_some_and(|compound| {
        matches!(compound.composition, Composition::TwoSided { .. })
            || compound.composition.inner().into_iter().any(has_sides)
    })
}

/// A share from 0 to 1.
#[must_use]
pub fn share(s: &Scalar, at: &TexturePoint) -> f64 {
    s.eval(at).clamp(0.0, 1.0)
}

impl Composition {
    /// What lies under it.
    #[must_use]
    pub fn inner(&self) -> Vec<&Material> {
        match self {
            Composition::Mask { inner, .. } | Composition::Relief { inner, .. } => vec![inner],
            Composition::Blend { first, second, .. } => vec![first, second],
            Composition::TwoSided { front, back } => vec![front, back],
        }
    }
}

/// Of `first` and the share `weight` of `second`.
fn mixed(first: Option<Straight>, second: Option<Straight>, weight: f64) -> Option<Straight> {
    let part = |s: Option<Straight>, weight: f64| s.map_or((0.0, Lanes::ZERO), |s| (s.share * weight, s.weight));
    let ((a, by_a), (b, by_b)) = (part(first, 1.0 - weight), part(second, weight));
    let share = a + b;
    (share > 0.0).then(|| Straight { share, weight: by_a * (a / share) as f32 + by_b * (b / share) as f32 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tilted() -> Relief {
        // n = (0.6, 0, 0.8) as a colour.
        let texel = [0.8f32, 0.5, 0.9];
        let grid = crate::scene::texture::Grid::new(1, 1);
        let texels = crate::scene::texture::Numbers::Floats(Arc::new(vec![texel]));
        let normals = Scalar::Image(crate::scene::texture::DataImage { texels, grid, decoded: false });
        Relief { form: ReliefForm::Normals(normals), turn: true, shadowing: true }
    }

    /// What is left of a number that fell below a share, or above it, is uniform again.
    #[test]
    fn a_split_number_is_uniform_on_both_sides() {
        let (mut low, mut high) = (0.15, 0.65);
        assert!(below(&mut low, 0.3) && !below(&mut high, 0.3));
        assert!((low - 0.5).abs() < 1e-15 && (high - 0.5).abs() < 1e-15);
        assert!(!below(&mut 0.0, 0.0) && below(&mut 0.999, 1.0));
    }

    /// A mask of opacity a over a mask of opacity b stops a b; a blend mixes what its parts let through.
    #[test]
    fn shares_that_go_straight_multiply_in_masks_and_mix_in_blends() {
        let open = |share: f64| (share > 0.0).then_some(Straight { share, weight: Lanes::ONE });
        let within = mixed(Some(Straight::OPEN), open(0.4), 0.5).unwrap();
        assert!((within.share - (1.0 - 0.5 * 0.6)).abs() < 1e-15);
        let blend = mixed(None, open(0.4), 0.25).unwrap();
        assert!((blend.share - 0.1).abs() < 1e-15 && blend.weight.to_array()[0] == 1.0);
        assert!(mixed(None, None, 0.5).is_none());
    }

    /// G₁ of GGX at 45° and α² = 1/2 is 2/(1 + √1.5); along the normal nothing is in the way.
    #[test]
    fn slopes_shadow_as_microfacets_do() {
        assert!((shadowing(0.5, 0.5f64.sqrt()) - 2.0 / (1.0 + 1.5f64.sqrt())).abs() < 1e-15);
        assert_eq!([shadowing(1.0, 1.0), shadowing(1.0, 0.0)], [1.0, 0.0]);
    }

    /// The back of a relief is the mirror image of its front: the tilted normal leans to the same side and
    /// points away from the front.
    #[test]
    fn the_back_of_a_relief_is_the_mirror_image_of_its_front() {
        let bench = crate::description::testing::scene(
            "shapes:\n- rectangle: {corner: [-1, -1, 0], edge_u: [2, 0, 0], edge_v: [0, 2, 0]}\n",
        );
        let scene = crate::scene::compile::compile(&bench, "s").unwrap();
        for (side, expected) in [(1.0, DVec3::new(0.6, 0.0, 0.8)), (-1.0, DVec3::new(0.6, 0.0, -0.8))] {
            let ray = crate::math::Ray::new(DVec3::new(0.1, 0.2, 3.0 * side), DVec3::new(0.0, 0.0, -side));
            let hit = scene.closest(&ray, f64::INFINITY).unwrap();
            let surface = scene.surface(&ray, &hit);
            let at = hit.texture_point(&surface);
            let x = Vertex { scene: &scene, hit: &hit, surface: &surface, at: &at, wo: -ray.direction };
            let mut standing = Standing::new(surface.shading_normal, surface.tangent);
            if side < 0.0 {
                standing.mirror();
            }
            standing.turn(&tilted(), &x);
            let frame = standing.frame();
            // Texels are f32.
            assert!((frame.n - expected).length() < 1e-6, "{side}: {frame:?}");
            assert!((frame.s.cross(frame.t) - frame.n).length() < 1e-12);
            // tan²θ/8 = 0.5625/8; along the surface's normal no slope is in the way.
            assert!((standing.slopes().shadowing(DVec3::Z) - 1.0).abs() < 1e-12);
        }
    }
}
