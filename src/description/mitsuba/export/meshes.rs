//! Meshes that stand for shapes which Mitsuba lacks, as text of PLY files.

use glam::{DAffine3, DVec3};

use super::super::super::shape::Cone;
use crate::math::Frame;
use crate::math::trig::sin_cos_turn;

/// Half the side of what stands for a plane without end, metres.
///
/// Mitsuba's f32 loses light on larger ones that lie aslant: a diffuse one of 1e4 m is up to 15 % too dark there, one of
/// 2.5e3 m agrees within the noise of 1e-3.
pub(super) const PLANE: f64 = 2.5e3;

/// Sides of the mesh that stands for a cone.
pub(super) const SEGMENTS: u32 = 256;

/// A cone as a PLY of smooth sides: each triangle has its corners and their normals for itself.
pub(super) fn cone_mesh(cone: &Cone) -> String {
    let (base, apex) = (DVec3::from(cone.base), DVec3::from(cone.apex));
    let axis = apex - base;
    let height = axis.length();
    let frame = Frame::from_normal(axis / height);
    let turn = |k: f64| {
        let (sin, cos) = sin_cos_turn((k / f64::from(SEGMENTS)).fract());
        frame.s * cos + frame.t * sin
    };
    let slope = |k: f64| (turn(k) * height + frame.n * cone.radius).normalize_or_zero();
    let mut corners: Vec<(DVec3, DVec3)> = Vec::new();
    for k in 0..SEGMENTS {
        let k = f64::from(k);
        let ring = [k, k + 1.0].map(|k| base + turn(k) * cone.radius);
        corners.extend([(ring[0], slope(k)), (ring[1], slope(k + 1.0)), (apex, slope(k + 0.5))]);
        if cone.cap {
            corners.extend([ring[1], ring[0], base].map(|corner| (corner, -frame.n)));
        }
    }
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         property double nx\nproperty double ny\nproperty double nz\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        corners.len(),
        corners.len() / 3
    );
    for (p, n) in &corners {
        text.push_str(&format!("{} {} {} {} {} {}\n", p.x, p.y, p.z, n.x, n.y, n.z));
    }
    for i in (0..corners.len()).step_by(3) {
        text.push_str(&format!("3 {i} {} {}\n", i + 1, i + 2));
    }
    text
}

/// The square that stands for a plane as a PLY whose texture coordinates are metres. The order of its corners is that of the
/// front, whichever way v runs.
pub(super) fn plane_mesh(placement: &DAffine3, mirrored: bool) -> String {
    let mut text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n\
         property double u\nproperty double v\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        .to_owned();
    for (u, v) in [(-PLANE, -PLANE), (PLANE, -PLANE), (PLANE, PLANE), (-PLANE, PLANE)] {
        let p = placement.transform_point3(DVec3::new(u, v, 0.0));
        let v = if mirrored { -v } else { v };
        text.push_str(&format!("{} {} {} {u} {v}\n", p.x, p.y, p.z));
    }
    text + "3 0 1 2\n3 0 2 3\n"
}
