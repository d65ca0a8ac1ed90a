//! Groups of objects, and instances: copies of a group, each under an affine map of its own.
//!
//! A ray enters an instance through the inverse of the map: the children are met in the group's own
//! space, where spheres stay spheres whatever the map does to them. Its direction is made a unit vector
//! there, so that shapes are as exact as they are outside, and distances are scaled back. A ray that
//! leaves a child names the instance, the child and its part ([`Departure`]), so an instance needs no
//! epsilon either.
//!
//! # Rounding
//! With M the map, N its inverse rounded entry by entry and u = 2⁻⁵³, a point p of the world that lies
//! on a child comes from a local point q, |q| ≤ s, by p = M q + m and goes back by q' = N p + n. Each of
//! the two maps is a sum of four terms (4u of the sum of their sizes), N has entries within 2u, and q
//! itself is off by a few u s. So q' is off by no more than some 16u of a = |N| |p| + |n| + s, and a step
//! of length h along the world's normal moves a point by at least h / ‖M‖ away from the child. The step
//! off a surface is 128u of [`SurfacePoint::scale`]: with a scale of max(|M| a + |m|) it is some eight
//! times the error.

use super::bvh::{Aabb, Bvh};
use super::shape::Detail;
use super::{Geometry, Hit, Object, SurfacePoint};
use crate::error::in_short;
use crate::math::dd::{Dd, Dd3};
use crate::math::{Departure, Ray};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::ops::Range;
use std::sync::Arc;

/// Objects that are placed together: a run of `Scene::objects`.
#[derive(Debug)]
pub struct Group {
    /// Index of the first.
    pub first: u32,
    /// Over the objects of the run, in their own space.
    pub bvh: Bvh,
}

impl Group {
    /// Indices of its objects.
    #[must_use]
    pub fn members(&self) -> Range<usize> {
        self.first as usize..self.first as usize + self.bvh.order().len()
    }
}

/// A copy of a group.
#[derive(Clone, Debug)]
pub struct Instance {
    /// What is copied.
    pub group: Arc<Group>,
    /// From the group's space to the world.
    pub map: AffineMap,
}

/// An affine map with its inverse.
#[derive(Clone, Debug)]
pub struct AffineMap {
    /// x ↦ M x + m.
    world_from_object: DAffine3,
    /// p ↦ N p + n, the inverse; each entry of N is rounded once from twice the precision.
    object_from_world: DAffine3,
}

impl AffineMap {
    /// The map and its inverse.
    ///
    /// # Errors
    /// In words, where there is no inverse within the range of f64.
    pub fn new(world_from_object: DAffine3) -> Result<AffineMap, String> {
        let m = world_from_object.matrix3;
        let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(Dd3::from);
        // Rows of the adjugate are the cross products of the columns.
        let adjugate = [y.cross(z), z.cross(x), x.cross(y)];
        let determinant = x.dot(adjugate[0]);
        let rows = adjugate.map(|row| Dd3(row.0.map(|c| c / determinant)));
        let translation = Dd3::from(world_from_object.translation);
        let matrix3 = DMat3::from_cols_array_2d(&rows.map(|row| row.0.map(Dd::to_f64))).transpose();
        let back = DVec3::from(rows.map(|row| row.dot(translation).to_f64()));
        let object_from_world = DAffine3 { matrix3, translation: -back };
        if world_from_object.is_finite() && object_from_world.is_finite() {
            Ok(AffineMap { world_from_object, object_from_world })
        } else {
            let found = in_short(m.determinant());
            Err(format!("expected a transform that can be inverted, found one with determinant {found}"))
        }
    }

    /// `ray` in the group's space, of unit direction, and the length of its direction before that:
    /// local distances are the world's times it.
    #[inline]
    pub(super) fn enter(&self, ray: &Ray) -> (Ray, f64) {
        let direction = self.object_from_world.transform_vector3(ray.direction);
        let length = direction.length();
        (Ray::new(self.object_from_world.transform_point3(ray.origin), direction / length), length)
    }

    /// What textbooks make of [`AffineMap::enter`] in single precision: see [`crate::scene::watch`].
    pub(super) fn enter_plain(&self, origin: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        let DAffine3 { matrix3, translation } = self.object_from_world;
        let matrix = matrix3.as_mat3();
        (matrix * origin + translation.as_vec3(), (matrix * direction).normalize())
    }

    /// A surface of the group as it lies in the world. Normals go by the inverse transpose, which keeps
    /// outward normals outward under maps that mirror, too.
    fn leave(&self, local: &SurfacePoint) -> SurfacePoint {
        let (m, n) = (&self.world_from_object, &self.object_from_world);
        let normal = |v: DVec3| (n.matrix3.transpose() * v).normalize();
        let point = m.transform_point3(local.point);
        let a = n.matrix3.abs() * point.abs() + n.translation.abs() + local.scale;
        SurfacePoint {
            point,
            scale: (m.matrix3.abs() * a + m.translation.abs()).max_element(),
            normal: normal(local.normal),
            shading_normal: normal(local.shading_normal),
            uv: local.uv,
            tangent: m.transform_vector3(local.tangent),
        }
    }

    /// From the group's space to the world.
    #[must_use]
    pub fn world_from_object(&self) -> &DAffine3 {
        &self.world_from_object
    }

    /// The inverse.
    #[must_use]
    pub fn object_from_world(&self) -> &DAffine3 {
        &self.object_from_world
    }

    /// The surface of a child at a hit, in the world.
    pub(super) fn surface(&self, child: &Geometry, ray: &Ray, hit: &Hit, detail: Detail) -> SurfacePoint {
        let point = self.object_from_world.transform_point3(ray.at(hit.t));
        self.leave(&child.surface(point, hit, detail))
    }

    /// The box around a box of the group's space in the world; without end where that is. Wider than the
    /// exact one by more than rounding.
    #[must_use]
    pub fn bounds(&self, local: &Aabb) -> Aabb {
        if !(local.min.is_finite() && local.max.is_finite()) {
            return Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
        }
        let m = &self.world_from_object;
        let (centre, half) = (0.5 * local.min + 0.5 * local.max, 0.5 * local.max - 0.5 * local.min);
        let extent = m.matrix3.abs() * half;
        let centre_world = m.transform_point3(centre);
        // Surface points come back to within 16u of this sum; see the page of the module.
        let size = m.matrix3.abs() * (centre.abs() + half) + m.translation.abs();
        let pad = 16.0 * f64::EPSILON * size.max_element();
        Aabb { min: centre_world - extent - pad, max: centre_world + extent + pad }
    }
}

/// Distance, part and barycentric coordinates of a hit on one object, which itself is no instance.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartHit {
    pub(super) t: f64,
    pub(super) part: u32,
    pub(super) barycentric: [f64; 2],
}

impl Geometry {
    /// Where `ray` meets the object before `t_max`; `departing` is the part of it that the ray leaves.
    #[inline]
    pub(super) fn meet(&self, ray: &Ray, t_max: f64, departing: Option<u32>) -> Option<PartHit> {
        match self {
            Geometry::Shape(shape) => shape.intersect(ray, t_max, departing.map(|face| face as u8)).map(|h| PartHit {
                t: h.t,
                part: u32::from(h.face),
                barycentric: [0.0; 2],
            }),
            Geometry::Mesh(mesh) => mesh.tree.as_ref()?.closest(ray, t_max, departing).map(|h| PartHit {
                t: h.hit.t,
                part: h.triangle,
                barycentric: [h.hit.b1, h.hit.b2],
            }),
            Geometry::Sdf(sdf) => {
                sdf.intersect(ray, t_max, departing).map(|h| PartHit { t: h.t, part: h.cell, barycentric: [0.0; 2] })
            }
            Geometry::Curves(curves) => {
                curves.closest(ray, t_max).map(|h| PartHit { t: h.t, part: h.segment, barycentric: [h.v, 0.0] })
            }
            // An instance holds several objects: its own `closest` finds them.
            Geometry::Instance(_) => None,
        }
    }

    /// Whether the object stands in the way of `ray` before `distance`, but for the part that it leaves and
    /// the part `target` that it aims at.
    #[inline]
    pub(super) fn blocks(&self, ray: &Ray, distance: f64, departing: Option<u32>, target: Option<u32>) -> bool {
        match self {
            Geometry::Shape(shape) => {
                target.is_none() && shape.intersect(ray, distance, departing.map(|face| face as u8)).is_some()
            }
            Geometry::Mesh(mesh) => mesh.tree.as_ref().is_some_and(|tree| tree.any(ray, distance, [departing, target])),
            Geometry::Sdf(sdf) => sdf.intersect(ray, distance, departing).is_some(),
            Geometry::Curves(curves) => curves.any(ray, distance),
            Geometry::Instance(_) => false,
        }
    }

    /// The surface of `part` at the point of the ray `point_on_ray`.
    #[inline]
    pub(super) fn surface(&self, point_on_ray: DVec3, hit: &Hit, detail: Detail) -> SurfacePoint {
        match self {
            Geometry::Shape(shape) => shape.surface_with(point_on_ray, hit.part as u8, detail),
            Geometry::Mesh(mesh) => {
                let [b1, b2] = hit.barycentric;
                match detail {
                    Detail::Boundary => mesh.mesh.boundary(hit.part, b1, b2),
                    Detail::Geometry | Detail::Texture => mesh.mesh.surface(hit.part, b1, b2),
                }
            }
            Geometry::Sdf(sdf) => sdf.surface(point_on_ray, hit.part),
            Geometry::Curves(curves) => curves.surface(point_on_ray, hit.part, hit.barycentric[0]),
            Geometry::Instance(_) => unreachable!("a hit names the child of an instance"),
        }
    }
}

impl Instance {
    /// The box of the copy in the world.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.map.bounds(&self.group.bvh.bounds())
    }

    /// The part of `child` that `ray` leaves, where it leaves that child of this instance.
    fn departing(departure: Option<Departure>, instance: u32, child: u32) -> Option<u32> {
        departure.filter(|d| d.instance == Some(instance) && d.object == child).map(|d| d.part)
    }

    /// The nearest child that `ray` meets before `t_max`. `index` is that of the instance.
    pub(super) fn closest(&self, objects: &[Object], index: u32, ray: &Ray, t_max: f64) -> Option<Hit> {
        let (local, length) = self.map.enter(ray);
        let mut best = None;
        self.group.bvh.closest(&local, t_max * length, |i, t_max_local| {
            let object = self.group.first + i;
            let departing = Instance::departing(ray.departure, index, object);
            let hit = objects[object as usize].geometry.meet(&local, t_max_local, departing)?;
            let PartHit { t, part, barycentric } = hit;
            best = Some(Hit { t: t / length, object, part, barycentric, instance: Some(index) });
            Some(t)
        });
        // Scaled back, a distance may round to the limit itself.
        best.filter(|hit| hit.t < t_max)
    }

    /// Whether any child stands in the way of `ray` before `distance`.
    pub(super) fn blocks(&self, objects: &[Object], index: u32, ray: &Ray, distance: f64) -> bool {
        let (local, length) = self.map.enter(ray);
        self.group.bvh.any(&local, distance * length, |i| {
            let object = self.group.first + i;
            let departing = Instance::departing(ray.departure, index, object);
            objects[object as usize].geometry.blocks(&local, distance * length, departing, None)
        })
    }
}

#[cfg(test)]
mod tests;
