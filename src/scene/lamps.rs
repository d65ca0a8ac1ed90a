//! Whether a ray may meet a lamp, told by the boxes around lamps.

use super::Object;
use super::bvh::{Aabb, Bvh};
use super::light::Light;
use crate::math::Ray;

/// Boxes that are looked through one after the other; more have a tree.
const FEW: usize = 8;

/// The boxes around all lamps that a ray can meet.
#[derive(Debug)]
pub struct Lamps {
    boxes: Vec<Aabb>,
    /// Whether light from infinity stands out anywhere.
    sun: bool,
    tree: Option<Bvh>,
}

impl Lamps {
    /// Those of `lights` that are among `objects`.
    #[must_use]
    pub fn of(lights: &[Light], objects: &[Object]) -> Lamps {
        let bounds = |light: &Light| match light {
            Light::Area { object, .. } => Some(objects[*object as usize].bounds()),
            _ => None,
        };
        let boxes: Vec<Aabb> = lights.iter().filter_map(bounds).collect();
        let tree = (boxes.len() > FEW).then(|| Bvh::build(&boxes));
        Lamps { boxes, sun: lights.iter().any(Light::may_stand_out), tree }
    }

    /// Whether there are none, nor a sun.
    #[must_use]
    pub fn are_none(&self) -> bool {
        self.boxes.is_empty() && !self.sun
    }

    /// Whether `ray` comes into the box of a lamp from without, but for rounding: what is around its origin is met in most directions,
    /// and by chance.
    #[must_use]
    #[inline]
    pub fn may_be_met(&self, ray: &Ray) -> bool {
        match &self.tree {
            None => self.boxes.iter().any(|bounds| comes_into(ray, bounds)),
            Some(tree) => tree.any(ray, f64::INFINITY, |i| comes_into(ray, &self.boxes[i as usize])),
        }
    }
}

/// Whether a ray comes into a box from without, but for rounding.
fn comes_into(ray: &Ray, bounds: &Aabb) -> bool {
    let inverse = ray.direction.recip();
    let (a, b) = ((bounds.min - ray.origin) * inverse, (bounds.max - ray.origin) * inverse);
    // What is no number, on a face and along it, bounds nothing.
    let near = a.min(b).to_array().into_iter().fold(f64::NEG_INFINITY, f64::max);
    let far = a.max(b).to_array().into_iter().fold(f64::INFINITY, f64::min);
    near > 0.0 && near <= far
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::compile::testing::compiled;
    use glam::DVec3;

    /// Of few lamps and of many, tall, flat and without end: rays toward points of them may meet one, those that go past all do not.
    #[test]
    fn rays_toward_lamps_may_meet_them() {
        for count in [1, FEW, FEW + 1, 40] {
            let mut text = "camera: {origin: [0, 3, 9], target: [0, 0, 0], fov_deg: 40}\nshapes:\n".to_owned();
            (0..count).for_each(|i| {
                let x = 3 * i;
                text += &match i % 2 {
                    0 => format!("- sphere: {{center: [{x}, 5, 0], radius: 1, emission: 1}}\n"),
                    _ => format!(
                        "- rectangle: {{corner: [{x}, 5, -1], edge_u: [1, 0, 0], edge_v: [0, 0, 2], emission: 1}}\n"
                    ),
                };
            });
            let scene = compiled(&text);
            for i in 0..count {
                let at = DVec3::new(3.0 * f64::from(i as u32) + 0.3, 5.0, -0.2);
                for from in [DVec3::ZERO, DVec3::new(7.0, -3.0, 1.0), DVec3::new(at.x, 0.0, at.z)] {
                    assert!(scene.lamps.may_be_met(&Ray::new(from, (at - from).normalize())), "{count} {i}");
                    assert!(!scene.lamps.may_be_met(&Ray::new(from, (from - at).normalize())), "{count} {i}");
                }
                let beside = DVec3::new(at.x, 0.0, 3.0);
                assert!(!scene.lamps.may_be_met(&Ray::new(beside, DVec3::Y)), "{count} {i}");
            }
        }
        let around = compiled(
            "camera: {origin: [0, 3, 9], target: [0, 0, 0], fov_deg: 40}\nshapes: [sphere: {center: [0, 0, 0], radius: 50, emission: 1}]\n",
        );
        assert!(!around.lamps.may_be_met(&Ray::new(DVec3::ZERO, DVec3::Y)));
        let unlit = compiled(
            "camera: {origin: [0, 3, 9], target: [0, 0, 0], fov_deg: 40}\nlights: [{constant: {radiance: 1}}]\n",
        );
        assert!(!unlit.lamps.may_be_met(&Ray::new(DVec3::ZERO, DVec3::Y)));
    }
}
