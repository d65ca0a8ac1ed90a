//! Bodies that stand in another medium than they say.
//!
//! A surface between media tells what is on either side of it; what is not written there is what the camera is in. On the straight
//! way from the camera to a body, through all that is before it, the medium behind one surface has to be that before the next, and
//! that of a closed body around the camera what the camera is in.

use super::nested::Bodies;
use super::{Geometry, Object, Scene};
use crate::math::Ray;
use glam::DVec3;

/// Bodies to which the way is looked at; a bound on time.
const MOST_BODIES: usize = 1024;

/// Surfaces along one way.
const MOST_SURFACES: usize = 256;

/// A body that is met in another medium than it says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stranger {
    /// The object, one that stands in the scene itself.
    pub object: u32,
    /// What is there.
    pub medium: Option<u32>,
    /// What it says is there.
    pub own: Option<u32>,
    /// Where that is.
    pub side: Side,
}

/// Where a body is met in another medium than it says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// On its outside.
    Outside,
    /// On its inside, as it may be of what is open or turned round.
    Inside,
    /// Within it, as it is closed and around the camera.
    Camera,
}

impl Scene {
    /// Each body that is the first on the way from the camera to some body to stand in another medium than it says, once. Those
    /// with a priority and copies of groups are not asked.
    #[must_use]
    pub fn strangers(&self) -> Vec<Stranger> {
        let mut found: Vec<Stranger> = Vec::new();
        if !self.parts_media {
            return found;
        }
        let tells = |object: &u32| tells(&self.objects[*object as usize]);
        for object in (0..self.standing as u32).filter(tells).take(MOST_BODIES) {
            let stranger = self.stranger_before(object);
            found.extend(stranger.filter(|new| found.iter().all(|old| old.object != new.object)));
        }
        found
    }

    /// The first on the straight way to the middle of `object`, and on to its surface.
    fn stranger_before(&self, object: u32) -> Option<Stranger> {
        let bounds = self.objects[object as usize].bounds();
        let way = 0.5 * bounds.min + 0.5 * bounds.max - self.camera.eye();
        if !bounds.is_finite() {
            return None;
        }
        // A camera in its very middle may look anywhere.
        let direction = way.normalize_or(DVec3::Z);
        let (mut ray, mut inside) = (Ray::new(self.camera.eye(), direction), self.camera_inside);
        let mut at_eye = true;
        for _ in 0..MOST_SURFACES {
            let hit = self.closest(&ray, f64::INFINITY)?;
            let (met, surface) = (&self.objects[hit.object as usize], self.surface(&ray, &hit));
            // Among bodies with a priority surfaces need not be what they say.
            let asked = hit.instance.is_none() && inside.bodies == Bodies::NONE && tells(met);
            let own = met.beyond(&surface, -direction, None);
            if asked && own != inside.medium {
                let behind = direction.dot(surface.normal) > 0.0;
                let leaves = behind != met.flipped && !is_open(&met.geometry);
                let side = match (leaves, behind) {
                    (true, _) if at_eye => Side::Camera,
                    // Something before it changed what is there.
                    (true, _) => return None,
                    (false, true) => Side::Inside,
                    (false, false) => Side::Outside,
                };
                return Some(Stranger { object: hit.object, medium: inside.medium, own, side });
            }
            at_eye &= met.keeps_medium;
            if hit.object == object {
                return None;
            }
            inside = self.beyond(met, &surface, direction, inside);
            ray = self.leave(&surface, &hit, direction);
        }
        None
    }
}

/// Whether the surface of an object alone tells what is on its sides.
fn tells(object: &Object) -> bool {
    !object.keeps_medium && object.body == 0 && !matches!(object.geometry, Geometry::Instance(_))
}

fn is_open(geometry: &Geometry) -> bool {
    match geometry {
        Geometry::Shape(shape) => !shape.is_closed(),
        Geometry::Sdf(sdf) => !sdf.is_closed(),
        Geometry::Mesh(_) => false,
        Geometry::Curves(_) | Geometry::Instance(_) => true,
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::compile::testing::compiled;

    /// A ball of glass and a pane in a ball of smoke, which is all that differs from what the camera is in; whatever stands before
    /// them. What says where it is, what light never crosses, and what stands beside the smoke is not told.
    #[test]
    fn glass_in_smoke_that_says_nothing_of_it_is_told() {
        let notes = |shapes: &str| {
            let text = format!(
                "camera: {{origin: [0, 0, 9], target: [0, 0, 0], fov_deg: 40}}\n\
                 media: {{smoke: {{homogeneous: {{scattering: 0.5}}}}}}\nshapes:\n\
                 - rectangle: {{corner: [-1, -1, 5], edge_u: [2, 0, 0], edge_v: [0, 2, 0]}}\n\
                 - sphere: {{radius: 2, inside: smoke, material: {{boundary: {{}}}}}}\n{shapes}\n"
            );
            compiled(&text).notes
        };
        let glass = |more: &str| format!("- sphere: {{radius: 0.5, material: {{dielectric: {{ior: 1.5}}}}{more}}}");
        let pane = "- rectangle: {corner: [0.2, 0.2, -1], edge_u: [0.5, 0, 0], edge_v: [0, 0.5, 0], \
                    material: {thin_dielectric: {ior: 1.5}}}";
        let told = "stands in smoke, but its outside, which is not written, is taken to be what the camera is in; \
                    outside: smoke says where it stands";
        assert_eq!(notes(&glass("")), [format!("s.yaml:6:11: shapes[2].sphere: {told}")]);
        assert_eq!(notes(pane), [format!("s.yaml:6:14: shapes[2].rectangle: {told}")]);
        let from_behind = pane.replace("0.5, 0, 0]", "-0.5, 0, 0]");
        let told = told.replace("outside", "inside");
        assert_eq!(notes(&from_behind), [format!("s.yaml:6:14: shapes[2].rectangle: {told}")]);
        for silent in [
            glass(", outside: smoke"),
            glass(", center: [0, 3, 0]"),
            "- sphere: {radius: 0.5}".to_owned(),
            "- sphere: {radius: 0.5, material: {dielectric: {ior: 1.5, priority: 1}}}".to_owned(),
            String::new(),
        ] {
            assert!(notes(&silent).is_empty(), "{silent}: {:?}", notes(&silent));
        }
    }

    /// A bubble in a ball of glass that absorbs, of which no medium has the name: `outside: vacuum` would be wrong.
    #[test]
    fn a_bubble_in_glass_that_absorbs_is_told_to_have_a_priority() {
        let notes = |priorities: [&str; 2]| {
            let [ball, bubble] = priorities;
            let text = format!(
                "camera: {{origin: [0, 0, 9], target: [0, 0, 0], fov_deg: 40}}\nshapes:\n\
                 - sphere: {{radius: 2, material: {{dielectric: {{ior: 1.5, absorption: {{color: 0.5, at: 0.3}}{ball}}}}}}}\n\
                 - sphere: {{radius: 1, material: {{dielectric: {{ior: 1{bubble}}}}}}}\n"
            );
            compiled(&text).notes
        };
        let told = "s.yaml:4:11: shapes[1].sphere: stands in a body that absorbs, but its outside, which is not written, is taken \
                    to be what the camera is in; a priority of each says where it stands";
        assert_eq!(notes(["", ", exterior_ior: 1.5"]), [told]);
        assert!(notes([", priority: 1", ", priority: 2"]).is_empty());
    }

    /// A camera in water that only the cube around it tells of, in its middle or not, and one in clear glass in fog: neither is in
    /// what the body holds. Where both say the same, and where a body has a priority, nothing is told.
    #[test]
    fn a_camera_in_a_body_that_holds_another_medium_is_told() {
        let notes = |eye: &str, medium: &str, body: &str| {
            let text = format!(
                "camera: {{origin: {eye}, target: [0, 0, -9], fov_deg: 40}}\n\
                 media: {{water: {{homogeneous: {{absorption: 1}}}}}}\n{medium}\nshapes:\n\
                 - sphere: {{center: [0, 0, -1], radius: 0.1}}\n- cube: {{size: 4, {body}}}\n"
            );
            compiled(&text).notes
        };
        let told = |own: &str, medium: &str| {
            [format!(
                "s.yaml:6:9: shapes[1].cube: the camera is inside, in {own}, but is taken to be in {medium}: medium says what \
                 the camera is in, but for bodies with a priority"
            )]
        };
        let water = "inside: water, material: {boundary: {}}";
        let turned = "outside: water, inside: vacuum, material: {boundary: {}}, flip_normals: true";
        let glass = "outside: water, material: {dielectric: {ior: 1.5}}";
        let tinted = "material: {dielectric: {ior: 1.5, absorption: {color: 0.5, at: 0.3}}}";
        for eye in ["[0, 0, 0]", "[0.3, 0.2, 1]"] {
            assert_eq!(notes(eye, "", water), told("water", "vacuum"));
            assert_eq!(notes(eye, "", turned), told("water", "vacuum"));
            assert_eq!(notes(eye, "medium: water", glass), told("vacuum", "water"));
            assert_eq!(notes(eye, "", tinted), told("a body that absorbs", "vacuum"));
        }
        for (eye, medium, body) in [
            ("[0, 0, 5]", "", water),
            ("[0, 0, 0]", "medium: water", "inside: water, outside: vacuum, material: {boundary: {}}"),
            ("[0, 0, 0]", "", "inside: water, material: {dielectric: {ior: 1.33, priority: 1}}"),
            ("[0, 0, 0]", "", "material: {dielectric: {ior: 1.5}}"),
        ] {
            assert!(notes(eye, medium, body).is_empty(), "{eye} {body}: {:?}", notes(eye, medium, body));
        }
    }
}
