//! Bodies that light goes into and that share a face with something else: they are put apart.
//!
//! Rays that leave a surface begin a step off it ([`Ray::leaving`]), which leads over whatever lies on the very same face: a path
//! out of one block of smoke would miss the way into the next, and one out of a glass the table that it stands on. Rounding
//! decides which of the two is met first. So one of them is made smaller, by 2⁻⁴² of the largest coordinate or length, which
//! is sixteen steps and nothing to see: empty space is then between them, as between things that lie on each other. Meshes,
//! whose corners have no such digits, are moved by as much. Bodies with a priority are there to share a place: they reach into
//! each other instead.
//!
//! Points all over the faces of bodies find what else goes through them: a thousand on each, so that what touches a hundredth of a
//! body's faces is met by some ten; of more than 64 bodies fewer, down to 64. Points on what stands on a body find it where
//! those of the body have not, as a die on a block. Of meshes of more triangles one in as many is looked at. Sheets have no
//! inside to withdraw to: what lies on one is told. Copies of groups are not looked at.

use super::bvh::Aabb;
use super::instance::PartHit;
use super::material::Material;
use super::shape::{Detail, Shape};
use super::{Geometry, Hit, Object, TriangleMesh};
use crate::math::ray::NEIGHBOUR_STEP;
use crate::math::sampler::GOLDEN;
use crate::math::{Ray, warp};
use glam::{DVec2, DVec3};
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap, HashSet};

/// By how much a body is made smaller, relative to the largest coordinate or length.
pub(super) const APART: f64 = 16.0 * NEIGHBOUR_STEP;

/// Faces that are nearer, relative to the same, are one: four steps of rays that leave surfaces.
pub(super) const NEAR: f64 = 4.0 * NEIGHBOUR_STEP;

/// A probe's length on either side.
const REACH: f64 = 1.0 / (1u64 << 36) as f64;

/// Bodies that are looked at; a bound on time, as are the following.
const MOST_BODIES: usize = 1024;

/// Pairs of boxes.
const MOST_PAIRS: usize = 1 << 26;

/// Points of bodies that are held against other things: where hundreds of bodies are in one place each of their points is in the
/// boxes of all.
const MOST_MET: usize = 1 << 24;

/// Points on all bodies, and on one.
const POINTS: usize = 1 << 16;
const POINTS_OF_ONE: usize = 1 << 10;

/// Points on something that stands on a body.
const POINTS_OF_GUEST: usize = 1 << 8;

/// Two objects of which one was put off the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Contact {
    /// The body that was to withdraw.
    pub(super) body: u32,
    /// What it touches.
    pub(super) other: u32,
    /// By how much it was put off, metres; negative where it reaches into the other. None where it has no room: a sheet, a mesh
    /// between two others, or what is thinner than some 2⁻³¹ of its coordinates.
    pub(super) by: Option<f64>,
    /// Whether both have a priority and should overlap, but one of them had to leave something else.
    pub(super) parted: bool,
}

/// A point of a surface.
struct Probe {
    point: DVec3,
    normal: DVec3,
    scale: f64,
}

/// What a body is to do.
struct Withdrawal {
    body: usize,
    /// What it touches, and its own normal there; of a mesh, which moves by its normals, once for each of its faces.
    touched: Vec<(u32, DVec3)>,
    /// Where each thing stands in `touched`: of a ball each point has a normal of its own, too many to go through.
    known: HashMap<u32, Vec<usize>>,
    scale: f64,
    /// Whether something that it touches has no priority, so that it has to be left.
    leaves: bool,
    /// Its place among those that touch each other, from the largest.
    rank: usize,
}

impl Withdrawal {
    fn new(body: usize) -> Withdrawal {
        Withdrawal { body, touched: Vec::new(), known: HashMap::new(), scale: 0.0, leaves: false, rank: 0 }
    }

    /// It touches `other` where its own normal is `normal`.
    fn touches(&mut self, other: u32, normal: DVec3, is_mesh: bool) {
        let Withdrawal { touched, known, .. } = self;
        let known = known.entry(other).or_default();
        let same = |&k: &usize| touched[k].1.dot(normal) > 1.0 - 1e-9;
        if known.is_empty() || is_mesh && !known.iter().any(same) {
            known.push(touched.len());
            touched.push((other, normal));
        }
    }

    /// Makes a body smaller, or moves a mesh, where it has room, and tells of all that it touches; `parted` says of something
    /// whether both should overlap, but were parted.
    fn carry_out(&self, geometry: &mut Geometry, parted: impl Fn(u32) -> bool) -> Vec<Contact> {
        let by = APART * self.scale * (self.rank + 1) as f64 * if self.leaves { 1.0 } else { -1.0 };
        // Into which direction a mesh moves that much from each face, if it can.
        let inward: DVec3 = self.touched.iter().map(|(_, normal)| -*normal).sum();
        let least = self.touched.iter().map(|(_, n)| -n.dot(inward)).filter(|d| *d > 0.1).fold(f64::INFINITY, f64::min);
        let is_done = match geometry {
            Geometry::Shape(shape) => shape.inset(by).map(|smaller| *shape = smaller).is_some(),
            Geometry::Mesh(mesh) if mesh.mesh.may_be_closed() && least.is_finite() => {
                mesh.shift(inward * (by / least));
                true
            }
            Geometry::Mesh(_) | Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => false,
        };
        let is_mesh = is_mesh(geometry);
        let mut told = HashSet::new();
        let contact = |&(other, normal): &(u32, DVec3)| {
            let left = !is_mesh || -normal.dot(inward) > 0.1;
            let parted = parted(other);
            let by = (is_done && left && !parted).then_some(by);
            told.insert((other, by.is_some())).then_some(Contact { body: self.body as u32, other, by, parted })
        };
        self.touched.iter().filter_map(contact).collect()
    }
}

/// Puts bodies apart that share faces, and says which, and how many more bodies were not looked at; `boxes` are the objects'.
pub(super) fn put_apart(objects: &mut [Object], boxes: &mut [Aabb], materials: &[Material]) -> (Vec<Contact>, usize) {
    let is_body =
        |o: &Object| has_points(&o.geometry) && o.light.is_none() && materials[o.material as usize].transmits();
    let mut bodies: Vec<usize> = (0..objects.len()).filter(|&i| is_body(&objects[i])).collect();
    let all = bodies.len();
    bodies.truncate(MOST_BODIES.min(MOST_PAIRS / objects.len().max(1)));
    if bodies.is_empty() || objects.len() < 2 {
        return (Vec::new(), all - bodies.len());
    }
    let ranked: Vec<bool> =
        objects.iter().map(|o| materials[o.material as usize].body().is_ok_and(|body| body.is_some())).collect();
    let (mut found, looked_at) = withdrawals(objects, boxes, &bodies, &ranked);
    share_scales(&mut found);
    let leaving: HashSet<u32> = found.iter().filter(|one| one.leaves).map(|one| one.body as u32).collect();
    let mut contacts = Vec::new();
    for one in found {
        // Of bodies with priorities one may have had to leave something else.
        let parted =
            |other: u32| ranked[one.body] && ranked[other as usize] && (one.leaves || leaving.contains(&other));
        contacts.extend(one.carry_out(&mut objects[one.body].geometry, parted));
        boxes[one.body] = objects[one.body].bounds();
    }
    (contacts, all - looked_at)
}

/// Which bodies are to withdraw, and from what: the largest first; and how many were looked at. `ranked` are the objects with a
/// priority.
fn withdrawals(objects: &[Object], boxes: &[Aabb], bodies: &[usize], ranked: &[bool]) -> (Vec<Withdrawal>, usize) {
    let volume = |i: usize| (boxes[i].max - boxes[i].min).element_product();
    // Opaque, or a sheet, which has no inside to withdraw to.
    let mut stays = vec![[true, true]; objects.len()];
    bodies.iter().for_each(|&i| stays[i] = [false, !is_closed(&objects[i].geometry)]);
    let points = (POINTS / bodies.len()).min(POINTS_OF_ONE);

    let mut found: BTreeMap<usize, Withdrawal> = BTreeMap::new();
    let mut withdraw = |body: usize, other: usize, normal: DVec3, scale: f64, leaves: bool| {
        let one = found.entry(body).or_insert_with(|| Withdrawal::new(body));
        one.scale = one.scale.max(scale);
        one.leaves |= leaves;
        one.touches(other as u32, normal, is_mesh(&objects[body].geometry));
    };
    let mut points_of_guests = POINTS;
    let (mut looked_at, mut held) = (0, 0);
    for &body in bodies {
        if held > MOST_MET {
            break;
        }
        looked_at += 1;
        let pad = REACH * boxes[body].min.abs().max(boxes[body].max.abs()).max_element();
        let near = |b: &Aabb, min: DVec3, max: DVec3| b.min.cmple(max + pad).all() && b.max.cmpge(min - pad).all();
        let others: Vec<usize> =
            (0..objects.len()).filter(|&i| i != body && near(&boxes[i], boxes[body].min, boxes[body].max)).collect();
        if others.is_empty() {
            continue;
        }
        // What points of the body lie on.
        let mut met_others = HashSet::new();
        for probe in probes(&objects[body].geometry, points) {
            for &other in others.iter().filter(|&&i| near(&boxes[i], probe.point, probe.point)) {
                held += 1;
                let Some((normal, scale)) = met(&objects[other], &probe) else { continue };
                met_others.insert(other);
                // Of two that look away from each other a body with a priority stays, if it may; of two in one another the
                // larger does.
                let apart = probe.normal.dot(normal) < 0.0;
                let order = |i: usize| (stays[i], apart && ranked[i]);
                let first = match order(body).cmp(&order(other)) {
                    Ordering::Less => true,
                    Ordering::Greater => false,
                    Ordering::Equal => (volume(body), other) < (volume(other), body),
                };
                let leaves = !(ranked[body] && ranked[other]);
                match first {
                    true => withdraw(body, other, probe.normal, scale, leaves),
                    false => withdraw(other, body, normal, scale, leaves),
                }
            }
        }
        // What has points that lie on the body, where those of the body have not found it.
        let is_guest = |i: usize| stays[i][0] && has_points(&objects[i].geometry) && !met_others.contains(&i);
        for &guest in others.iter().filter(|&&i| is_guest(i)) {
            let points = points_of_guests.min(POINTS_OF_GUEST);
            points_of_guests -= points;
            for probe in probes(&objects[guest].geometry, points) {
                if near(&boxes[body], probe.point, probe.point)
                    && let Some((normal, scale)) = met(&objects[body], &probe)
                {
                    withdraw(body, guest, normal, scale, true);
                }
            }
        }
    }
    // Of two that lie in one another the smaller withdraws by more; what touches shares a scale.
    let mut found: Vec<Withdrawal> = found.into_values().collect();
    found.sort_by(|a, b| volume(b.body).total_cmp(&volume(a.body)).then(a.body.cmp(&b.body)));
    (found, looked_at)
}

/// Whether points are drawn on it.
fn has_points(geometry: &Geometry) -> bool {
    match geometry {
        Geometry::Shape(shape) => !matches!(shape, Shape::Plane(_)),
        Geometry::Mesh(_) => true,
        Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => false,
    }
}

fn is_mesh(geometry: &Geometry) -> bool {
    matches!(geometry, Geometry::Mesh(_))
}

/// Whether it has an inside.
fn is_closed(geometry: &Geometry) -> bool {
    match geometry {
        Geometry::Shape(shape) => shape.is_closed(),
        Geometry::Mesh(mesh) => mesh.mesh.may_be_closed(),
        Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => false,
    }
}

/// Gives bodies that touch, and those that these touch, the largest scale among them, and each of them a rank.
fn share_scales(found: &mut [Withdrawal]) {
    let place: HashMap<u32, usize> = found.iter().enumerate().map(|(k, one)| (one.body as u32, k)).collect();
    let mut neighbours = vec![Vec::new(); found.len()];
    for (k, one) in found.iter().enumerate() {
        for &other in one.touched.iter().filter_map(|(other, _)| place.get(other)) {
            neighbours[k].push(other);
            neighbours[other].push(k);
        }
    }
    let mut met = vec![false; found.len()];
    for start in 0..found.len() {
        let (mut group, mut next) = (vec![start], 0);
        if std::mem::replace(&mut met[start], true) {
            continue;
        }
        while let Some(&k) = group.get(next) {
            group.extend(neighbours[k].iter().filter(|&&other| !std::mem::replace(&mut met[other], true)));
            next += 1;
        }
        group.sort_unstable();
        let scale = group.iter().map(|&k| found[k].scale).fold(0.0, f64::max);
        group.iter().enumerate().for_each(|(rank, &k)| (found[k].scale, found[k].rank) = (scale, rank));
    }
}

/// Points all over a shape or mesh.
fn probes(geometry: &Geometry, points: usize) -> Vec<Probe> {
    // It never draws the middle of anything, where bodies touch in a point.
    let lattice = |i: usize| DVec2::new((i as f64 + 0.5) / points as f64, ((i + 1) as f64 * GOLDEN).fract());
    match geometry {
        Geometry::Shape(shape) => (0..points)
            .map(|i| shape.sample_area(lattice(i)))
            .map(|s| Probe { point: s.point, normal: s.normal, scale: s.scale })
            .collect(),
        Geometry::Mesh(mesh) => {
            let all = mesh.mesh.triangles.len();
            let chosen = |i: usize| if all > points { i * all / points } else { i % all };
            (0..points).filter_map(|i| inner_point(mesh, chosen(i) as u32, lattice(i))).collect()
        }
        Geometry::Sdf(_) | Geometry::Curves(_) | Geometry::Instance(_) => Vec::new(),
    }
}

/// A point within a triangle; `None` for one without area.
fn inner_point(mesh: &TriangleMesh, triangle: u32, u: DVec2) -> Option<Probe> {
    let [a, b, c] = mesh.mesh.vertices(triangle);
    let normal = mesh.mesh.area_vector(triangle).try_normalize()?;
    let u = warp::triangle(u);
    let origin = mesh.mesh.origin;
    let scale = [a, b, c, origin].into_iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    Some(Probe { point: a + (b - a) * u.x + (c - a) * u.y + origin, normal, scale })
}

/// The normal of an object where its surface goes through a point of another's, and the larger scale.
fn met(object: &Object, probe: &Probe) -> Option<(DVec3, f64)> {
    let reach = REACH * probe.scale;
    let ray = Ray::new(probe.point + probe.normal * reach, -probe.normal);
    let PartHit { t, part, barycentric } = object.geometry.meet(&ray, 2.0 * reach, None)?;
    let hit = Hit { t, object: 0, part, barycentric, instance: None };
    let surface = object.geometry.surface(ray.at(t), &hit, Detail::Geometry);
    let scale = surface.scale.max(probe.scale);
    ((t - reach).abs() <= NEAR * scale).then_some((surface.normal, scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::compile::testing::{self, compiled_in};

    /// The notes and boxes of a scene of these shapes.
    fn compiled(shapes: &str) -> (Vec<String>, Vec<Aabb>) {
        let text = format!(
            "camera: {{origin: [0, 0.3, 5], target: [0, 0, 0], fov_deg: 40}}\nmedia: {{smoke: {{homogeneous: {{absorption: 1}}}}}}\n\
             materials:\n  glass: {{dielectric: {{ior: 1.5}}}}\n  water: {{dielectric: {{ior: 1.33, priority: 1}}}}\n  \
             ice: {{dielectric: {{ior: 1.31, priority: 2}}}}\nshapes:\n{shapes}"
        );
        let scene = testing::compiled(&text);
        (scene.notes.clone(), scene.objects.iter().map(Object::bounds).collect())
    }

    const TABLE: &str = "- rectangle: {corner: [-2, 0, 2], edge_u: [4, 0, 0], edge_v: [0, 0, -4]}\n";

    /// All points of a ball in another of its size touch it, each with a normal of its own, and so do those of a third. A ball
    /// is made smaller, whatever they are; a mesh moves by those of its faces, one for each of the six of a cube.
    #[test]
    fn a_body_knows_no_more_of_what_it_touches_than_it_withdraws_by() {
        let normals =
            |i: usize| warp::uniform_sphere(DVec2::new((i as f64 + 0.5) / 999.0, (i as f64 * GOLDEN).fract()));
        let mut ball = Withdrawal::new(0);
        (0..999).for_each(|i| ball.touches(1 + i as u32 % 2, normals(i), false));
        assert_eq!(ball.touched.iter().map(|(other, _)| *other).collect::<Vec<_>>(), [1, 2]);
        let mut cube = Withdrawal::new(0);
        let faces = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
        (0..999).for_each(|i| cube.touches(1 + i as u32 % 2, faces[i / 2 % 6], true));
        assert_eq!(cube.touched.len(), 12);
    }

    /// Which of two bodies withdraws, and to which side, for whatever they are, and the table first or last.
    #[test]
    fn bodies_withdraw_from_what_they_stand_on() {
        for body in [
            "cube: {center: [0, 0.5, 0], size: 1, material: glass}",
            "cylinder: {base: [0, 0, 0], top: [0, 1, 0], radius: 0.1, material: glass}",
            "cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 0.3, material: glass}",
            "cube: {center: [0, 0.5, 0], size: 1, material: {mask: {opacity: 0, material: glass}}}",
            "cube: {center: [0, 0.5, 0], size: 1, material: {boundary: {}}, inside: smoke, outside: vacuum}",
            "cube: {center: [0, 0.5, 0], size: 1, material: water}",
        ] {
            for (at, shapes) in [(1, format!("{TABLE}- {body}\n")), (0, format!("- {body}\n{TABLE}"))] {
                let (notes, boxes) = compiled(&shapes);
                assert_eq!(notes.len(), 1, "{notes:?}");
                assert!(notes[0].contains(&format!("shares a face with shapes[{}]", 1 - at)), "{notes:?}");
                let gap = boxes[at].min.y;
                assert!(gap > 4.0 * 2f64.powi(-46) && gap < 1e-11, "{body}: {gap}");
            }
        }
    }

    /// A die on a block ten times as wide, on its top and on its side.
    #[test]
    fn bodies_withdraw_from_what_stands_on_them() {
        let block = "- cube: {center: [0, 0.5, 0], size: 1, material: glass}\n";
        for (die, axis) in [
            ("cube: {center: [0.31, 1.02, 0.17], size: 0.04}", 1),
            ("disk: {center: [0.31, 1, 0.17], normal: [0, 1, 0], radius: 0.02, emission: 1}", 1),
            ("cylinder: {base: [0.5, 0.31, 0.17], top: [0.6, 0.31, 0.17], radius: 0.02}", 0),
        ] {
            for (at, shapes) in [(0, format!("{block}- {die}\n")), (1, format!("- {die}\n{block}"))] {
                let (notes, boxes) = compiled(&shapes);
                assert!(notes.len() == 1 && notes[0].contains("shares a face with"), "{die}: {notes:?}");
                let face = [0.5, 1.0][axis];
                let gap = face - boxes[at].max[axis];
                assert!(gap > 4.0 * 2f64.powi(-46) && gap < 1e-11, "{die}: {gap}");
            }
        }
    }

    #[test]
    fn what_does_not_touch_or_is_opaque_stays() {
        for shapes in [
            "- cube: {center: [0, 0.501, 0], size: 1, material: glass}\n",
            "- cube: {center: [0, 0.499, 0], size: 1, material: glass}\n",
            "- sphere: {center: [0, 0.5, 0], radius: 0.5, material: glass}\n",
            "- cube: {center: [0, 0.5, 0], size: 1}\n",
            "- rectangle: {corner: [-1, 0.01, 1], edge_u: [1, 0, 0], edge_v: [0, 0, -1], material: {thin_dielectric: {ior: 1.5}}}\n",
        ] {
            let (notes, boxes) = compiled(&format!("{TABLE}{shapes}"));
            assert_eq!(notes, [""; 0], "{shapes}");
            assert_eq!(boxes[1], compiled(shapes).1[0]);
        }
    }

    /// On a sheet of glass a block withdraws; a sheet on a table cannot.
    #[test]
    fn sheets_that_lie_on_something_are_told() {
        let sheet = TABLE.replace("}", ", material: {thin_dielectric: {ior: 1.5}}}");
        let (notes, boxes) = compiled(&format!("{sheet}- cube: {{center: [0, 0.5, 0], size: 1, material: glass}}\n"));
        assert!(
            notes.len() == 1 && notes[0].contains("shapes[1].cube: shares a face with shapes[0]: it is put"),
            "{notes:?}"
        );
        assert!(boxes[1].min.y > 0.0);
        let (notes, _) = compiled(&format!("{TABLE}{sheet}"));
        assert!(
            notes.len() == 1 && notes[0].contains("shapes[1].rectangle: shares a face with shapes[0]: it has no room"),
            "{notes:?}"
        );
    }

    /// Each point of four hundred cubes in one place is in the boxes of all: no more are looked at than there is time for.
    #[test]
    fn many_bodies_in_one_place_take_no_more_than_their_time() {
        let (notes, _) = compiled(&"- cube: {center: [0.1, 0.2, 0.3], size: 1, material: glass}\n".repeat(400));
        let held = (POINTS / 400) * 399;
        let passed_over = 400 - (MOST_MET / held + 1);
        let told = format!("{passed_over} more bodies that light goes into are not looked at");
        assert!(notes.iter().any(|note| note.starts_with(&told)), "{told}: {:?}", notes.last());
    }

    /// Seven in a row; one that fills another; three in one another; and bodies with priorities, which overlap.
    #[test]
    fn bodies_withdraw_from_each_other() {
        let cube = |y: f64, size: f64, material: &str| {
            format!("- cube: {{center: [0.1, {y}, 0.2], size: {size}, material: {material}}}\n")
        };
        let row: String = (0..7).map(|i| cube(f64::from(i), 1.0, "glass")).collect();
        let (notes, boxes) = compiled(&row);
        assert_eq!(notes.len(), 6, "{notes:?}");
        for pair in boxes.windows(2) {
            let gap = pair[1].min.y - pair[0].max.y;
            assert!(gap > 8.0 * 2f64.powi(-46) * 6.0 && gap < 1e-10, "{gap}");
        }
        // In one another, the outermost last.
        let nest: String = (0..3).map(|i| cube(f64::from(i) / 2.0, 1.0 + f64::from(i), "glass")).collect();
        let (_, boxes) = compiled(&nest);
        for pair in boxes.windows(2) {
            let gap = pair[0].min.y - pair[1].min.y;
            assert!(gap > 8.0 * 2f64.powi(-46) * 2.0 && gap < 1e-10, "{gap}");
        }
        // The smaller is within, whatever has a priority.
        for (inner, outer) in [("water", "glass"), ("glass", "water")] {
            let (_, boxes) = compiled(&(cube(0.0, 1.0, inner) + &cube(0.5, 2.0, outer)));
            assert!(boxes[0].min.y > boxes[1].min.y + 8.0 * 2f64.powi(-46), "{boxes:?}");
        }
        // Two of which one has to leave a table, as well, are told.
        let (notes, _) = compiled(&(TABLE.to_owned() + &cube(0.5, 1.0, "water") + &cube(1.5, 1.0, "ice")));
        assert!(notes.iter().any(|note| note.contains("no priority; leave a gap there")), "{notes:?}");
        let (notes, boxes) = compiled(&(cube(0.0, 1.0, "water") + &cube(1.0, 1.0, "ice")));
        assert!(notes[0].contains("reaches"), "{notes:?}");
        assert!(boxes[0].max.y > boxes[1].min.y + 8.0 * 2f64.powi(-46), "{boxes:?}");
    }

    /// A mesh stands on a table at a height that f32 has, and beside another of the same corners.
    #[test]
    fn meshes_move_out_of_the_way() {
        let directory = tempfile::tempdir().unwrap();
        let cube = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 2 -1\nv 1 2 -1\nv 1 2 1\nv -1 2 1\n\
            f 1 2 3 4\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n";
        std::fs::write(directory.path().join("cube.obj"), cube).unwrap();
        let text = format!(
            "camera: {{origin: [0, 0.3, 5], target: [0, 0, 0], fov_deg: 40}}\nmaterials: {{glass: {{dielectric: {{ior: 1.5}}}}}}\n\
             shapes:\n{TABLE}- mesh: {{file: cube.obj, material: glass}}\n"
        );
        let scene = compiled_in(directory.path(), &text);
        let bottom = scene.objects[1].bounds().min.y;
        assert!(bottom > 4.0 * 2f64.powi(-46) && bottom < 1e-11, "{bottom}");
        let ray = Ray::new(DVec3::new(0.1, 5.0, 0.2), -DVec3::Y);
        let top = scene.closest(&ray, f64::INFINITY).unwrap();
        let inside = scene.leave(&scene.surface(&ray, &top), &top, -DVec3::Y);
        let met = scene.closest(&inside, f64::INFINITY).unwrap();
        assert_eq!(met.object, 1);
        let below = scene.leave(&scene.surface(&inside, &met), &met, -DVec3::Y);
        assert_eq!(scene.closest(&below, f64::INFINITY).unwrap().object, 0);

        // Between walls it can leave the table alone.
        let walls = "- rectangle: {corner: [1, 0, 1], edge_u: [0, 2, 0], edge_v: [0, 0, -2]}\n\
            - rectangle: {corner: [-1, 0, 1], edge_u: [0, 2, 0], edge_v: [0, 0, -2]}\n";
        let held = text.replace("shapes:\n", &format!("shapes:\n{walls}"));
        let notes = compiled_in(directory.path(), &held).notes;
        let told = |what: &str| notes.iter().filter(|note| note.contains(what)).count();
        assert_eq!((told("shapes[2]: it is put off"), told("it has no room"), notes.len()), (1, 2, 3), "{notes:?}");
    }
}
