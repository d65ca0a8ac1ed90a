//! Rays in closed meshes, through the tree that renders use.

use crate::Found;
use crate::math::{Departure, Frame, Ray};
use crate::scene::mesh::{Mesh, MeshSource, MeshTree, NormalMode, Winding};
use crate::testing::Random;
use glam::{DAffine3, DVec3};
use std::collections::HashMap;

/// An octahedron whose edges were halved `levels` times; each vertex moved by `f`.
fn ball(levels: u32, f: impl Fn(DVec3) -> DVec3) -> Mesh {
    let mut points = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for i in 0..8u32 {
        let [a, b, c] = [0, 1, 2].map(|k| k + 3 * (i >> k & 1));
        faces.push(if i.count_ones().is_multiple_of(2) { [a, b, c] } else { [a, c, b] });
    }
    for _ in 0..levels {
        let mut between = HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(i, j)| {
                *between.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    points.push((points[i as usize] + points[j as usize]).normalize());
                    points.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = finer;
    }
    let source =
        MeshSource { positions: points.into_iter().map(f).collect(), triangles: faces, ..MeshSource::default() };
    Mesh::new(&source, &DAffine3::IDENTITY, NormalMode::Face, Winding::Object).expect("a mesh")
}

/// Sizes over twelve decades, centres up to 1e5 sizes away, bumpy and stretched to 1 : 30. A third of the rays go to a
/// vertex, a third to a point of an edge, all from within; each goes on from where it meets the mesh, inward, and must
/// meet it again.
pub fn ask(rays: u64, random: &mut Random, found: &mut Found) {
    let size = random.log_uniform(-6.0, 6.0);
    let centre = random.direction() * size * if random.uniform() < 0.3 { 0.0 } else { random.log_uniform(-2.0, 5.0) };
    let (bumps, stretch) = (0.2 * random.uniform(), random.rotation());
    let stretch = stretch
        * glam::DMat3::from_diagonal(DVec3::new(1.0, random.log_uniform(-0.75, 0.75), random.log_uniform(-0.75, 0.75)));
    let mesh = ball((random.uniform() * 6.0) as u32, |p| {
        centre + stretch * p * (size * (1.0 + bumps * (5.0 * p.x + 3.0 * p.y * p.z).sin()))
    });
    let tree = MeshTree::build(&mesh);
    for i in 0..rays / 2 {
        // The middle and what is near to it are inside: the mesh is a star.
        let from = centre + stretch * random.direction() * (0.2 * size * random.uniform());
        let [a, b, _] = mesh.vertices((random.uniform() * mesh.triangles.len() as f64) as u32);
        let target = match i % 3 {
            0 => a,
            1 => a + (b - a) * random.uniform(),
            _ => stretch * random.direction() * size + (from - mesh.origin),
        };
        let ray = Ray::new(from, (target + mesh.origin - from).normalize());
        let Some(met) = tree.closest(&ray, f64::INFINITY, None) else {
            found.note(Err(format!("a leak: {size:e} at {centre}, {} triangles, {ray:?}", mesh.triangles.len())));
            continue;
        };
        let s = mesh.surface(met.triangle, met.hit.b1, met.hit.b2);
        // As far from edge-on as a point at that distance is rounded.
        let least = 1e-6f64.max(64.0 * f64::EPSILON * s.scale / size);
        let cos = random.log_uniform(least.log10(), 0.0).min(1.0);
        let (sin_phi, cos_phi) = crate::math::trig::sin_cos_turn(random.uniform());
        let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
        let inward = Frame::from_normal(-s.normal).to_world(DVec3::new(sin * cos_phi, sin * sin_phi, cos)).normalize();
        let back = Ray::leaving(s.point, s.scale, s.normal, inward, Departure::new(0, met.triangle));
        found.note(match tree.closest(&back, f64::INFINITY, Some(met.triangle)) {
            Some(_) => Ok(2),
            None => Err(format!("lost: {size:e} at {centre}, {} triangles, {s:?} {back:?}", mesh.triangles.len())),
        });
    }
}
