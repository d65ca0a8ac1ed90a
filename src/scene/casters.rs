//! What focuses light: objects that only mirror and refract, and the balls around them.

use super::bvh::Aabb;
use super::material::{Kind, Material, Roughness};
use super::{Geometry, Object, Scene};
use glam::DVec3;
use std::collections::{HashMap, HashSet};

/// A ball around something that focuses light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre.
    pub center: DVec3,
    /// Its radius, metres; wider than the thing by more than rounding.
    pub radius: f64,
}

impl Ball {
    /// Around a box; `None` where that has no end.
    fn around(b: &Aabb) -> Option<Ball> {
        let (center, half) = (0.5 * b.min + 0.5 * b.max, 0.5 * b.max - 0.5 * b.min);
        let size = half.length() + center.abs().max_element();
        let radius = half.length() + 8.0 * f64::EPSILON * size;
        (radius.is_finite() && center.is_finite()).then_some(Ball { center, radius })
    }

    fn around_both(&self, other: &Ball) -> Ball {
        let offset = other.center - self.center;
        let distance = offset.length();
        if distance + other.radius <= self.radius {
            return *self;
        }
        if distance + self.radius <= other.radius {
            return *other;
        }
        let radius = 0.5 * (distance + self.radius + other.radius);
        let center = self.center + offset * ((radius - self.radius) / distance);
        Ball { center, radius: radius * (1.0 + 8.0 * f64::EPSILON) }
    }
}

/// The objects of a scene that focus light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Casters {
    /// For each object of the scene.
    pub casts: Vec<bool>,
    /// Balls that hold all of them, at most [`MAX_BALLS`].
    pub balls: Vec<Ball>,
    /// Boxes that hold all of them, as many at the most.
    pub boxes: Vec<Aabb>,
    /// Names, one for each object that stands in the scene itself.
    pub names: Vec<String>,
    /// Whether any of them has an index that depends on wavelength.
    pub parts: bool,
    /// Names of mirrors and glasses without end, which no light can be aimed at.
    pub endless: Vec<String>,
    /// For each object of the scene, whether it is one of those.
    pub unending: Vec<bool>,
    /// Whether any of them throws light in single directions.
    pub single: bool,
}

/// Balls at the most: what is near to each other shares one beyond.
pub const MAX_BALLS: usize = 64;

/// Width of microfacets below which a surface counts as sharp, as in LuxCore: light that it throws from a small lamp is
/// met by chance too seldom.
const SHARP_ALPHA: f64 = 0.05;

/// Whether facets are so narrow that chance seldom finds what they mirror.
fn is_narrow(facets: Option<&Roughness>) -> bool {
    match facets {
        None => true,
        Some(Roughness::Uniform(facets)) => facets.alpha.max(facets.alpha * facets.ratio) < SHARP_ALPHA,
        Some(Roughness::Textured(_)) => false,
    }
}

/// Whether every part of a material mirrors or refracts in directions that chance seldom finds, and it bends or turns
/// light.
fn is_sharp(material: &Material) -> bool {
    let sharp = |m: &&Material| match &m.kind {
        Kind::Mirror { .. } | Kind::Thin { .. } => true,
        Kind::Conductor { facets, .. } | Kind::Dielectric { facets, .. } => is_narrow(facets.as_ref()),
        _ => false,
    };
    let leaves = material.leaves();
    leaves.iter().any(sharp) && leaves.iter().all(|m| sharp(m) || matches!(m.kind, Kind::Boundary))
}

/// Whether a material throws light in single directions, as mirrors, smooth glass and the coats of plastics do, be it a part of
/// what comes.
fn is_single(material: &Material) -> bool {
    material.leaves().iter().any(|m| match &m.kind {
        Kind::Mirror { .. } | Kind::Thin { .. } => true,
        Kind::Conductor { facets, .. } | Kind::Dielectric { facets, .. } => facets.is_none(),
        Kind::Plastic { coat, .. } => coat.facets.is_none(),
        _ => false,
    })
}

/// Whether an index of a material depends on wavelength.
fn is_dispersive(material: &Material) -> bool {
    material.leaves().iter().any(|m| match &m.kind {
        Kind::Dielectric { interior, exterior, .. } => interior.is_dispersive() || exterior.is_dispersive(),
        _ => false,
    })
}

/// Whether light goes through a material in another direction than straight on.
fn bends(material: &Material) -> bool {
    let straight = |m: &Material| matches!(m.kind, Kind::Thin { .. } | Kind::Boundary);
    material.leaves().iter().any(|m| m.transmits() && !straight(m))
}

/// A curve that light bends through. Rays meet curves from outside only, so that what refracts into one leaves it unseen: the
/// way back is another.
#[must_use]
pub fn one_way(scene: &Scene) -> Option<&Object> {
    let is_curve = |object: &Object| matches!(object.geometry, Geometry::Curves(_));
    scene.objects.iter().find(|object| is_curve(object) && bends(&scene.materials[object.material as usize]))
}

/// Whether the same things, by their numbers, focus light in two scenes, and the same of them have no end.
#[must_use]
pub fn casts_alike(a: &Scene, b: &Scene) -> bool {
    let kinds = |scene: &Scene, object: &Object| {
        let material = &scene.materials[object.material as usize];
        (is_sharp(material), is_single(material), object.bounds().is_finite())
    };
    a.objects.len() == b.objects.len()
        && a.standing == b.standing
        && a.objects.iter().zip(&b.objects).all(|(of_a, of_b)| kinds(a, of_a) == kinds(b, of_b))
}

impl Casters {
    /// Those that only mirror and refract. Balls hold each of them at all of `moments`, too, which have the same things
    /// ([`casts_alike`]).
    #[must_use]
    pub fn of(scene: &Scene, moments: &[Scene]) -> Casters {
        Casters::made_of(scene, moments, is_sharp)
    }

    /// Those that mirror or refract in single directions a part of what comes, and scatter the rest; in balls as above.
    #[must_use]
    pub fn in_part(scene: &Scene, moments: &[Scene]) -> Casters {
        Casters::made_of(scene, moments, |material| is_single(material) && !is_sharp(material))
    }

    /// None.
    #[must_use]
    pub fn none(scene: &Scene) -> Casters {
        let none = vec![false; scene.objects.len()];
        Casters { casts: none.clone(), unending: none, ..Casters::default() }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.balls.is_empty() && self.endless.is_empty()
    }

    fn made_of(scene: &Scene, moments: &[Scene], is_wanted: impl Fn(&Material) -> bool) -> Casters {
        let material = |i: usize| &scene.materials[scene.objects[i].material as usize];
        let sharp = |i: usize| is_wanted(material(i));
        let mut casters = Casters::none(scene);
        // Groups are looked through once, however many copies they have, but for those that reach out of the range of numbers.
        let (mut groups, mut seen) = (HashMap::new(), HashSet::new());
        for (i, object) in scene.objects.iter().enumerate() {
            let (casts, children) = match &object.geometry {
                Geometry::Instance(instance) => {
                    let members = instance.group.members();
                    (*groups.entry(members.start).or_insert_with(|| members.clone().any(sharp)), members)
                }
                _ => (sharp(i), i..i + 1),
            };
            // Children of groups are seen through their instances.
            if !casts || i >= scene.standing {
                continue;
            }
            let bounds = moments.iter().fold(object.bounds(), |all, moment| all.union(&moment.objects[i].bounds()));
            let ball = Ball::around(&bounds);
            let unseen = seen.insert((children.start, ball.is_none()));
            for child in children.filter(|_| unseen) {
                casters.casts[child] = sharp(child);
                casters.unending[child] |= sharp(child) && ball.is_none();
                let parts = |scene: &Scene| is_dispersive(&scene.materials[scene.objects[child].material as usize]);
                casters.parts |= sharp(child) && (parts(scene) || moments.iter().any(parts));
                casters.single |= sharp(child) && is_single(material(child));
            }
            match ball {
                Some(ball) => {
                    casters.balls.push(ball);
                    match casters.boxes.last_mut() {
                        // What is beyond shares the last.
                        Some(last) if casters.balls.len() > MAX_BALLS => *last = last.union(&bounds),
                        _ => casters.boxes.push(bounds),
                    }
                    casters.names.push(object.name.clone());
                }
                None => casters.endless.push(object.name.clone()),
            }
        }
        merge_nearest(&mut casters.balls);
        casters
    }
}

/// Joins the two balls whose common ball is smallest, until few are left.
fn merge_nearest(balls: &mut Vec<Ball>) {
    // So many that all pairs would take long: neighbours along the longest side first.
    while balls.len() > 4 * MAX_BALLS {
        let all = balls.iter().fold(Aabb::EMPTY, |b, x| b.union(&Aabb { min: x.center, max: x.center }));
        let size = (all.max - all.min).to_array();
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
        balls.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
        let pairs = balls.chunks(2).map(|pair| pair.iter().skip(1).fold(pair[0], |a, b| a.around_both(b)));
        *balls = pairs.collect();
    }
    while balls.len() > MAX_BALLS {
        let mut best = (f64::INFINITY, 0, 1);
        for i in 0..balls.len() {
            for j in i + 1..balls.len() {
                let radius = balls[i].around_both(&balls[j]).radius;
                if radius < best.0 {
                    best = (radius, i, j);
                }
            }
        }
        let (_, i, j) = best;
        balls[i] = balls[i].around_both(&balls[j]);
        balls.swap_remove(j);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::compile::testing::{compiled, compiled_in};

    fn ball(x: f64, radius: f64) -> Ball {
        Ball { center: DVec3::new(x, 0.0, 0.0), radius }
    }

    #[test]
    fn a_ball_around_two_holds_both_and_no_more() {
        let both = ball(0.0, 1.0).around_both(&ball(5.0, 2.0));
        assert!((both.center.x - 3.0).abs() < 1e-14 && (both.radius - 4.0).abs() < 1e-14);
        assert_eq!(ball(0.0, 5.0).around_both(&ball(1.0, 1.0)), ball(0.0, 5.0));
        assert_eq!(ball(1.0, 1.0).around_both(&ball(0.0, 5.0)), ball(0.0, 5.0));
    }

    /// A thousand balls in a row become 64, and each of the thousand lies in one of them.
    #[test]
    fn many_balls_share_a_few_that_hold_them_all() {
        let many: Vec<Ball> = (0..1000).map(|i| ball(f64::from(i), 0.25)).collect();
        let mut few = many.clone();
        merge_nearest(&mut few);
        assert!(few.len() <= MAX_BALLS && few.len() > MAX_BALLS / 4);
        for one in &many {
            let held = |b: &Ball| (b.center - one.center).length() + one.radius <= b.radius * (1.0 + 1e-12);
            assert!(few.iter().any(held), "{one:?}");
        }
    }

    /// Thousands of copies of a group of thousands: a look through the group for each of them, three times over, would take minutes.
    #[test]
    fn many_copies_of_a_large_group_take_no_quadratic_time() {
        const MANY: usize = 20_000;
        let begin = std::time::Instant::now();
        let mut text = "camera: {origin: [0, 3, 9], target: [0, 0, 0], fov_deg: 40}\n\
            materials: {silver: {mirror: {}}}\ngroups:\n  many:\n"
            .to_owned();
        (0..MANY)
            .for_each(|i| text += &format!("  - sphere: {{center: [{i}, 0, 0], radius: 0.1, material: silver}}\n"));
        text += "shapes:\n";
        (0..MANY).for_each(|i| text += &format!("- instance: {{group: many, transform: [translate: [0, {i}, 0]]}}\n"));
        let casters = Casters::of(&compiled(&text), &[]);
        assert_eq!(casters.casts.iter().filter(|casts| **casts).count(), MANY);
        assert_eq!(casters.names.len(), MANY);
        assert!(begin.elapsed() < std::time::Duration::from_secs(20));
    }

    /// Triangles of several meshes are in a tree of their own, beside that of the other objects.
    #[test]
    fn a_glass_mesh_beside_another_mesh_is_found() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("floor.obj"), "v -4 0 -4\nv 4 0 -4\nv 0 0 4\nf 1 3 2\n").unwrap();
        let tetrahedron = "v 0 1 0\nv 1 1 0\nv 0 2 0\nv 0 1 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
        std::fs::write(directory.path().join("glass.obj"), tetrahedron).unwrap();
        let text = "camera: {origin: [0, 3, 9], target: [0, 0, 0], fov_deg: 40}\nshapes:\n\
            - mesh: {file: floor.obj, material: {diffuse: {}}}\n\
            - mesh: {file: glass.obj, material: {dielectric: {ior: 1.5}}}\n";
        let scene = compiled_in(directory.path(), text);
        assert!(scene.together.is_some());
        let casters = Casters::of(&scene, &[]);
        assert_eq!((casters.casts, casters.balls.len()), (vec![false, true], 1));
    }
}
