//! Paths of neighbouring pixels that share what they find, after Bekaert, Sbert and Halton 2002, "Accelerating path tracing
//! by re-using paths".
//!
//! Light that a diffuse surface sends on is alike in all directions. So what the path of one pixel has found to come from its
//! second vertex y also arrives at the first vertices x of others, if they see y. With p_k(y) the density by area with which the
//! path of pixel k would have gone on to y, and S_q what path q found to leave y_q, the light of pixel p is
//!
//! ```text
//! Σ over q of f · cos · cos / r² (x_p, y_q) · S_q / Σ over k of p_k(y_q)
//! ```
//!
//! which is the balance heuristic of all that could have found y. It is without bias if p_k is the true density, so it is zero
//! where x_k does not see y: one shadow ray for each pair tells both p_k and what arrives. For a diffuse x_p the former is the
//! latter over the reflectance, so that p gets the share p_p / Σ p_k of what path q would have had for itself, had it begun at
//! x_p. What else a path finds (light of its first vertex, of lamps that it meets from there, of a second vertex that is not
//! diffuse or not met) it keeps for itself.
//!
//! **Whose paths.** The picture is cut into cells of [`SIDE`] × [`SIDE`] pixels, aligned to the frame, and each cell into
//! groups of eight: one pixel of each row and column, so that no two are neighbours and what they have in common does not show
//! as blocks. Of a group the samples of one number share their wavelengths. Pixels beyond the picture have groups of their own,
//! so that overscan changes nothing inside.

use super::state::{Path, Walk};
use super::together::{self, MOST, Wanted, from_lanes};
use super::{Sought, Tracer, sides_differ};
use crate::math::four::{Vec4, lanes, splat};
use crate::scene::census::Census;
use crate::scene::shape::four::{dot, minus};
use crate::scene::{Hit, Scene, SurfacePoint};
use crate::spectrum::Lanes;
use crate::transport::plan::{EffectPlan, Integrator, PathSettings};
use crate::transport::ways::Ledger;
use crate::transport::{Address, Incoming, Shot, address};
use glam::{DVec2, DVec3};
use wide::f64x4;

/// Side of a cell in pixels, and pixels of a group.
pub const SIDE: usize = 8;

/// From one row of a cell to the next a group steps so many columns: with 3 of 8 no two members are less than √8 pixels apart.
const STEP: i32 = 3;

/// What it takes to tell whether two vertices see each other, in rays of a path with all that happens at its vertices: 0.5 and 0.7 in
/// two scenes of few things, where four pairs are asked of together, 1.3 in one of a mesh.
#[must_use]
pub fn cost_of_a_pair(scene: &Scene) -> f64 {
    if scene.few.is_some() { 0.7 } else { 1.3 }
}

/// Why paths by `plan` cannot share what they find in a scene of so many `moments` while the shutter is open; `None` where they can.
#[must_use]
pub fn obstacle(scene: &Scene, census: &Census, plan: &EffectPlan, moments: usize) -> Option<&'static str> {
    let Integrator::Path(settings) = &plan.integrator else { return Some("no paths start from the camera") };
    if census.media > 0 || !census.nested.is_empty() {
        Some("there is more than empty space between surfaces")
    } else if scene.has_boundaries {
        Some("some surfaces let light straight through")
    } else if moments > 0 {
        Some("things move while the shutter is open")
    } else if settings.light_samples != 1 || settings.scatter_samples != 1 {
        Some("samples have several paths, or look for light in one way only")
    } else if settings.roulette_depth <= 2 {
        // Whether a path goes on would depend on where to.
        Some("roulette may end a path at its first vertex")
    } else {
        None
    }
}

/// The pixels of each group of the cell with `corner` in a picture of `resolution`: eight at the most, of one row each.
pub fn groups(corner: [i32; 2], resolution: [u32; 2]) -> impl Iterator<Item = Group> {
    let of = move |column: i32, inside: bool| {
        let mut group = Group { pixels: [[0; 2]; SIDE], count: 0 };
        for row in 0..SIDE as i32 {
            let pixel = [corner[0] + (column + STEP * row).rem_euclid(SIDE as i32), corner[1] + row];
            let lies_inside = (0..2).all(|i| pixel[i] >= 0 && (pixel[i] as u32) < resolution[i]);
            if lies_inside == inside {
                group.pixels[group.count] = pixel;
                group.count += 1;
            }
        }
        group
    };
    let all = (0..SIDE as i32).flat_map(move |column| [of(column, true), of(column, false)]);
    all.filter(|group| group.count > 0)
}

/// Pixels whose paths share what they find.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    pixels: [[i32; 2]; SIDE],
    count: usize,
}

impl Group {
    /// Whether `pixel` is one of them.
    #[must_use]
    pub fn holds(&self, pixel: [i32; 2]) -> bool {
        self.pixels().contains(&pixel)
    }

    /// Sample `index` of `replicate` of each pixel: as many of these as there are pixels.
    #[must_use]
    pub fn samples(&self, replicate: u32, index: u32) -> [Address; SIDE] {
        self.pixels.map(|pixel| Address { pixel: address(pixel), replicate, index })
    }

    /// Its pixels.
    #[must_use]
    pub fn pixels(&self) -> &[[i32; 2]] {
        &self.pixels[..self.count]
    }
}

/// How far a path has come that may share what it finds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// It has met nothing yet.
    Begun,
    /// At its first vertex, which is diffuse, and on from there.
    First,
    /// At its second vertex, which is diffuse, or beyond.
    Second,
    /// Its second vertex is not.
    Alone,
}

/// The vertices of a path at which it may be joined to others.
#[derive(Clone, Copy)]
pub(super) struct Joint {
    stage: Stage,
    /// The first vertex, x, from [`Stage::First`] on.
    x: Vertex,
    /// The second, y, of [`Stage::Second`].
    y: Vertex,
    /// What comes to the camera of light that arrives at x, over the density with which its direction is sampled. Zero if none is.
    throughput: Lanes,
    /// Light that was found before y, and what was left to paths from the lights.
    before: [Lanes; 2],
}

/// A vertex on a diffuse surface.
#[derive(Clone, Copy)]
pub(super) struct Vertex {
    pub(super) hit: Hit,
    pub(super) surface: SurfacePoint,
    /// The normal about which directions are sampled.
    pub(super) up: DVec3,
    /// Whether it is turned against the normals of the surface.
    pub(super) flip: bool,
    /// Toward where the path came from.
    pub(super) wo: DVec3,
}

impl Vertex {
    const NONE: Vertex = Vertex {
        hit: Hit { t: 0.0, object: 0, part: 0, barycentric: [0.0; 2], instance: None },
        surface: SurfacePoint {
            point: DVec3::ZERO,
            scale: 0.0,
            normal: DVec3::Z,
            shading_normal: DVec3::Z,
            uv: DVec2::ZERO,
            tangent: DVec3::X,
        },
        up: DVec3::Z,
        flip: false,
        wo: DVec3::Z,
    };

    /// How it is seen from `wo`: from which side, and whether with its true normal for the shading normal.
    fn look(&self, wo: DVec3) -> (bool, bool) {
        (wo.dot(self.surface.normal) > 0.0, sides_differ(&self.surface, wo))
    }
}

impl Joint {
    const BEGUN: Joint = Joint {
        stage: Stage::Begun,
        x: Vertex::NONE,
        y: Vertex::NONE,
        throughput: Lanes::ZERO,
        before: [Lanes::ZERO; 2],
    };

    /// The path is at something that nothing is shared from.
    pub(super) fn part(&mut self) {
        if self.stage != Stage::Second {
            self.stage = Stage::Alone;
        }
    }

    /// The path is at a diffuse `vertex`. From its second on it is followed for what leaves there, whoever sees it.
    pub(super) fn meet(
        &mut self,
        path: &mut Path,
        vertex: &Vertex,
        reflectance: impl FnOnce() -> Lanes,
        scene: &Scene,
        ledger: Option<&Ledger>,
    ) {
        match self.stage {
            Stage::Begun if path.vertices == 0 && !path.sharp && vertex.up.dot(vertex.wo) > 0.0 => {
                (self.stage, self.x) = (Stage::First, *vertex);
                self.throughput = path.beta * reflectance();
            }
            // Of anything else shadow rays do not tell whether others see it.
            Stage::First if scene.can_be_aimed_at(&vertex.hit, vertex.look(vertex.wo).0) => {
                (self.stage, self.y) = (Stage::Second, *vertex);
                self.before = [path.radiance, path.left];
                (path.radiance, path.left, path.beta) = (Lanes::ZERO, Lanes::ZERO, Lanes::ONE);
                // Roulette goes by what the light is worth to the path's own pixel.
                path.eta2 *= f64::from(self.throughput.to_array().into_iter().fold(0.0, f32::max));
                if let Some(ledger) = ledger {
                    ledger.set_aside();
                }
            }
            Stage::Begun | Stage::First | Stage::Second | Stage::Alone => self.part(),
        }
    }
}

/// The light of `count` samples of a group of pixels, as [`together::radiance`]; entered in `ledgers`, if there are any. How many
/// pairs of their vertices were asked whether they see each other.
pub fn radiance<'a>(
    shot: &'a Shot,
    settings: &'a PathSettings,
    ledgers: &'a [Ledger],
    count: usize,
    wanted: impl Fn(usize) -> Wanted<'a>,
    mut give: impl FnMut(usize, Incoming),
) -> u32 {
    let mut paths = [const { Path::BLANK }; MOST];
    let mut walks = [const { Walk::NEW }; MOST];
    let mut joints = [const { Joint::BEGUN }; MOST];
    let (paths, walks, joints) = (&mut paths[..count], &mut walks[..count], &mut joints[..count]);
    if together::possible(shot, settings) && count > 1 {
        together::follow(shot, settings, wanted, paths, walks, Some(joints));
    } else {
        let Shot { scene, plan, photons, .. } = *shot;
        for (i, joint) in joints.iter_mut().enumerate() {
            let (Wanted { sampler, nm, ray, apart }, ledger) = (wanted(i), ledgers.get(i));
            let photons = photons.map(|p| p.map);
            let tracer =
                Tracer { scene, plan, settings, sampler, nm, photons, ledger, sought: Sought::in_pixel(apart) };
            walks[i] = tracer.trace(ray, &mut paths[i], Some(joint));
        }
    }
    let asked = share(shot.scene, paths, joints, ledgers);
    for (i, (path, walk)) in paths.iter().zip(walks).enumerate() {
        give(i, path.incoming(walk.alpha, walk.depth));
    }
    asked
}

/// How likely the path of each member was to go on from x to the second vertex of another, by area, times π; a row for each of
/// the latter.
type Densities = [[f64; MOST]; MOST];

/// Gives each path what its pixel sees of all that leaves second vertices; how many pairs were asked.
fn share(scene: &Scene, paths: &mut [Path], joints: &[Joint], ledgers: &[Ledger]) -> u32 {
    let (densities, asked) = densities(scene, paths, joints);
    let mut gains = [Lanes::ZERO; MOST];
    for (q, of) in densities.iter().enumerate().take(joints.len()) {
        let sum: f64 = of.iter().sum();
        for (p, density) in of.iter().enumerate().filter(|(_, density)| **density > 0.0) {
            let share = joints[p].throughput * (density / sum) as f32;
            gains[p] += share * paths[q].radiance;
            if let Some(ledger) = ledgers.get(p) {
                ledger.gain(&ledgers[q], share);
            }
        }
    }
    for (i, (path, joint)) in paths.iter_mut().zip(joints).enumerate() {
        let joined = joint.stage == Stage::Second;
        if joined {
            path.left = joint.before[1] + joint.throughput * path.left;
            path.radiance = joint.before[0];
        }
        path.radiance += gains[i];
        if let Some(ledger) = ledgers.get(i) {
            ledger.put_back(joined);
        }
    }
    asked
}

/// The densities, and how many pairs were asked whether they see each other.
fn densities(scene: &Scene, paths: &[Path], joints: &[Joint]) -> (Densities, u32) {
    let mut densities = [[0.0; MOST]; MOST];
    let mut asked = 0;
    let fours = [Four::of(joints, 0), Four::of(joints, 4)];
    for (q, joint) in joints.iter().enumerate() {
        let light = paths[q].radiance;
        if joint.stage != Stage::Second || light.simd_eq(Lanes::ZERO).all() {
            continue;
        }
        let of = &mut densities[q];
        // What is no number is not shared: it is counted once.
        if light.to_array().into_iter().any(|light| !light.is_finite()) {
            of[q] = 1.0;
            continue;
        }
        let y = &joint.y;
        let outside = y.look(y.wo).0;
        let seen = fours.each_ref().map(|four| four.toward(y));
        of[q] = seen[q / 4].density[q % 4];
        let (mut open, mut count) = ([0; MOST], 0);
        for k in (0..joints.len()).filter(|&k| k != q && seen[k / 4].open >> (k % 4) & 1 == 1) {
            (open[count], count) = (k, count + 1);
        }
        asked += count as u32;
        for group in open[..count].chunks(4) {
            let distances = from_lanes(group, |k| seen[k / 4].distance[k % 4]);
            let [a, b, c, d] = &from_lanes(group, |k| {
                let from = &joints[k].x;
                scene.leave(&from.surface, &from.hit, DVec3::from_array(seen[k / 4].wi.map(|x| x[k % 4])))
            });
            let rays = [a, b, c, d];
            let hidden = scene.occluded_of_four(rays, distances, [Some(y.hit.departure()); 4], group.len());
            for (lane, &k) in group.iter().enumerate() {
                let enters = || scene.enters_on_the_way(rays[lane], y.hit.object, distances[lane]);
                if hidden >> lane & 1 == 0 && (outside || !enters()) {
                    of[k] = seen[k / 4].density[k % 4];
                }
            }
        }
        // A path that by rounding does not see what it has met keeps it.
        if !(of[q] > 0.0 && of.iter().sum::<f64>().is_finite()) {
            *of = [0.0; MOST];
            of[q] = 1.0;
        }
    }
    (densities, asked)
}

/// The first vertices of four paths.
struct Four {
    points: Vec4,
    /// The normals about which directions are sampled.
    up: Vec4,
    /// The true ones, on that side.
    normals: Vec4,
    /// Those that have gone on, a bit each.
    sampled: u32,
}

/// What four first vertices have to do with a second one.
struct Seen {
    /// The densities with which their paths would have met it, by area and times π, if they see it.
    density: [f64; 4],
    /// Those that see it, if nothing is in the way: a bit each.
    open: u32,
    wi: [[f64; 4]; 3],
    distance: [f64; 4],
}

impl Four {
    fn of(joints: &[Joint], first: usize) -> Four {
        let lanes = |of: &dyn Fn(&Vertex) -> DVec3| {
            lanes([0, 1, 2, 3].map(|i| joints.get(first + i).map_or(DVec3::Z, |joint| of(&joint.x))))
        };
        let is_sampled = |joint: &Joint| joint.throughput.simd_gt(Lanes::ZERO).any();
        let bit = |i: usize| u32::from(joints.get(first + i).is_some_and(is_sampled)) << i;
        Four {
            points: lanes(&|x| x.surface.point),
            up: lanes(&|x| x.up),
            normals: lanes(&|x| x.surface.normal * if x.flip { -1.0 } else { 1.0 }),
            sampled: (0..4).map(bit).sum(),
        }
    }

    fn toward(&self, y: &Vertex) -> Seen {
        let away = minus(&splat(y.surface.point), &self.points);
        let square = dot(&away, &away);
        let distance = square.sqrt();
        let wi = away.map(|x| x / distance);
        let zero = f64x4::ZERO;
        let (at_x, side) = (dot(&wi, &self.up), dot(&wi, &self.normals));
        // As `Vertex::look`, of -wi.
        let (true_side, shading_side) =
            (dot(&wi, &splat(y.surface.normal)), dot(&wi, &splat(y.surface.shading_normal)));
        let (outside, differ) = y.look(y.wo);
        let outside_of = true_side.simd_lt(zero);
        let differ_of = (true_side * shading_side).simd_le(zero);
        let alike = |of: f64x4, wanted: bool| if wanted { of.to_bitmask() } else { !of.to_bitmask() };
        let density = at_x * true_side.abs() / square;
        let faces = (at_x.simd_gt(zero) & side.simd_gt(zero) & density.simd_gt(zero)).to_bitmask();
        Seen {
            density: density.to_array(),
            open: faces & alike(outside_of, outside) & alike(differ_of, differ) & self.sampled,
            wi: wi.map(|x| x.to_array()),
            distance: distance.to_array(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    /// Of a cell within the picture each group has a pixel of each row and column, no two of them side by side; of one across its
    /// corner each pixel is in one group, with others of its own side of the edge.
    #[test]
    fn groups_part_a_cell_and_keep_to_their_side_of_the_edge() {
        for corner in [[8, 16], [-8, 0], [16, 16]] {
            let resolution = [20, 21];
            let is_inside = |[x, y]: [i32; 2]| (0..20).contains(&x) && (0..21).contains(&y);
            let groups: Vec<Group> = groups(corner, resolution).collect();
            let all: HashSet<[i32; 2]> = groups.iter().flat_map(|group| group.pixels().to_vec()).collect();
            let wanted = (0..64).map(|i| [corner[0] + i % 8, corner[1] + i / 8]).collect();
            assert_eq!(all, wanted);
            assert_eq!(groups.iter().map(|group| group.pixels().len()).sum::<usize>(), 64);
            for group in &groups {
                let pixels = group.pixels();
                assert!(pixels.iter().all(|pixel| is_inside(*pixel) == is_inside(pixels[0]) && group.holds(*pixel)));
                for (i, a) in pixels.iter().enumerate() {
                    for b in &pixels[..i] {
                        let (x, y) = (a[0] - b[0], a[1] - b[1]);
                        assert!(x != 0 && y != 0 && x * x + y * y >= 8, "{a:?} {b:?}");
                    }
                }
            }
        }
    }
}
