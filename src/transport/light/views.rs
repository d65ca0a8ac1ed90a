//! Surfaces as they are seen from where light goes.
//!
//! What stands for the normal of a surface depends on who sees it: the true normal where the interpolated one would be seen
//! from behind, and reliefs that turn toward their viewer. To a path from a light the viewer is where it goes next, which is
//! known only once it has been chosen. So each way of seeing the surface is tried with the same random numbers, and counts
//! if from where it leads the surface is seen in that way: the sum over the ways is what paths from the camera find.

use crate::math::Frame;
use crate::optics::bsdf::Bsdf;
use crate::scene::compound::{Compound, Leaf, Turns, Vertex};
use crate::scene::{Hit, Scene, SurfacePoint};
use crate::transport::path::seen_normal;
use glam::DVec3;

/// Where a path from a light has come to.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub scene: &'a Scene,
    pub hit: &'a Hit,
    pub surface: &'a SurfacePoint,
    /// Toward where the light came from.
    pub came: DVec3,
    /// Whether the material is the same from both sides.
    pub two_sided: bool,
    /// What the material is part of, the number that chose it, and how many reliefs of it turn toward their viewer.
    pub part_of: Option<(&'a Compound, f64, u8)>,
}

/// A surface as it is seen from somewhere.
#[derive(Clone, Copy)]
pub(super) struct View {
    /// z is the normal.
    pub frame: Frame,
    /// The share of the light that slopes do not stop.
    pub shadowing: f32,
    way: Way,
    /// Whether the frame is turned against the normal.
    flipped: bool,
}

impl View {
    /// A cosine at the true normal as it is at that on the side of the frame. Light counts whose cosine in the frame has the
    /// same sign.
    pub fn facing(&self, cosine: f64) -> f64 {
        if self.flipped { -cosine } else { cosine }
    }
}

/// By which normal a surface is seen, and with which reliefs turned, a bit each.
type Way = (DVec3, u8);

impl Place<'_> {
    /// The surface to those in the direction `viewer`.
    pub fn seen_from(&self, viewer: DVec3) -> View {
        self.view(seen_normal(self.surface, viewer), viewer, Turns::Seen)
    }

    /// The surface to those whence the light came, to whom it has been found to be `leaf`.
    pub fn of_leaf(&self, leaf: &Leaf) -> View {
        self.resolved(leaf, seen_normal(self.surface, self.came))
    }

    /// The normal to those in the direction `viewer`, of a material that is not made of others.
    pub fn normal_from(&self, viewer: DVec3) -> DVec3 {
        self.on_lit_side(seen_normal(self.surface, viewer))
    }

    /// Whether it is the same to all.
    pub fn is_plain(&self) -> bool {
        self.surface.shading_normal == self.surface.normal && self.part_of.is_none_or(|(.., turning)| turning == 0)
    }

    /// Whether it is as `view` has it to those in the direction `viewer`.
    pub fn is_seen_so(&self, view: &View, viewer: DVec3) -> bool {
        match self.part_of {
            Some((.., 1..)) => self.seen_from(viewer).way == view.way,
            _ => seen_normal(self.surface, viewer) == view.way.0,
        }
    }

    /// Each way in which it may be seen from where `bsdf` sends light; `own` is that of those whence the light came.
    pub fn views(&self, own: &View, bsdf: &Bsdf) -> impl Iterator<Item = View> {
        let SurfacePoint { shading_normal, normal, .. } = *self.surface;
        let turning = self.part_of.map_or(0, |(.., turning)| turning);
        // The true normal is seen by those alone who are between the surface and the plane of the other.
        let apart = normal.cross(shading_normal).length();
        let second = apart > 0.0 && (turning > 0 || bsdf.may_graze(self.came.dot(normal), apart));
        let normals = [Some(shading_normal), second.then_some(normal)];
        let turns = move |normal| (0..1u8 << turning).map(move |turned| (normal, turned));
        let ways = normals.into_iter().flatten().flat_map(turns);
        ways.map(|way| if way == own.way { *own } else { self.view(way.0, self.came, Turns::Given(way.1)) })
    }

    #[inline]
    fn view(&self, normal: DVec3, viewer: DVec3, turns: Turns) -> View {
        let Place { scene, hit, surface, .. } = *self;
        let leaf = self.part_of.and_then(|(compound, u, _)| {
            let at = &hit.texture_point(surface);
            compound.resolve_as(&Vertex { scene, hit, surface, at, wo: viewer }, normal, turns, u)
        });
        if let Some(leaf) = leaf {
            return self.resolved(&leaf, normal);
        }
        let frame = Frame::from_normal_and_tangent(self.on_lit_side(normal), surface.tangent);
        View { frame, shadowing: 1.0, way: (normal, 0), flipped: self.is_turned() }
    }

    fn resolved(&self, leaf: &Leaf, normal: DVec3) -> View {
        let shadowing = leaf.slopes.shadowing(self.came) as f32;
        View { frame: leaf.frame, shadowing, way: (normal, leaf.turned), flipped: leaf.flipped }
    }

    /// A normal, turned to the light where the material is the same from both sides.
    fn on_lit_side(&self, normal: DVec3) -> DVec3 {
        if self.is_turned() { -normal } else { normal }
    }

    fn is_turned(&self) -> bool {
        self.two_sided && self.came.dot(self.surface.normal) < 0.0
    }
}
