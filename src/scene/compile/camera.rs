//! The camera: its pose, what it sees, its lens.

use super::{Compiler, vec3, written};
use crate::scene::camera::{Camera, FovAxis, Lens, Projection};
use glam::{DAffine3, DVec2};

impl Compiler<'_> {
    pub(super) fn camera(&mut self) -> Camera {
        let d = &self.description.camera;
        let resolution = [self.description.image.width, self.description.image.height];
        let world_from_camera = match d.pose {
            written::Pose::LookAt { origin, target, up } => Camera::look_at(vec3(origin), vec3(target), vec3(up)),
            written::Pose::ToWorld(rows) => Some(DAffine3::from_mat4(written::TransformStep::Matrix(rows).matrix())),
        };
        let world_from_camera = world_from_camera.unwrap_or_else(|| {
            self.fault("camera.up", "expected a direction that is not along the line of sight");
            DAffine3::IDENTITY
        });
        let projection = match d.projection {
            written::Projection::Perspective { fov_deg, fov_axis } => {
                Projection::perspective(fov_deg.to_radians(), self::fov_axis(fov_axis), resolution)
            }
            written::Projection::Orthographic { height } => Projection::Orthographic {
                half_width: 0.5 * height * f64::from(resolution[0]) / f64::from(resolution[1]),
            },
        };
        let lens = d.lens.as_ref().map(|l| Lens { radius: l.radius, focus_distance: l.focus_distance });
        let clip = [d.clip.near, d.clip.far];
        let principal_point = DVec2::from(d.principal_point);
        Camera::new(world_from_camera, projection, resolution, lens, clip, principal_point)
    }
}

pub(super) fn fov_axis(axis: written::FovAxis) -> FovAxis {
    match axis {
        written::FovAxis::X => FovAxis::X,
        written::FovAxis::Y => FovAxis::Y,
        written::FovAxis::Smaller => FovAxis::Smaller,
        written::FovAxis::Larger => FovAxis::Larger,
        written::FovAxis::Diagonal => FovAxis::Diagonal,
    }
}
