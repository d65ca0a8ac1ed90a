//! Motion blur: the scene at moments while the shutter of the camera is open.
//!
//! Every sample, and every path from a light, sees one moment, drawn by a number of its own ([`crate::transport::moment`]),
//! so that the picture is the mean over the moments, whatever changes: the estimate is unbiased for those moments, which
//! stand at the middles of equal times. What the eye would see of their distance is bounded by their number: as many as the
//! pixels that the fastest thing travels, 16 to 64.

use super::prepare::hash_text;
use crate::description::{SceneDescription, ShutterTimes};
use crate::error::Result;
use crate::scene::census::Census;
use crate::scene::compile;
use crate::scene::curves::Curves;
use crate::scene::light::Light;
use crate::scene::shelf::Shelf;
use crate::scene::{Geometry, Object, Scene};
use crate::transport::middle;
use crate::transport::plan::{Effect, Integrator};
use glam::{DAffine3, DVec2, DVec3};
use std::collections::HashSet;
use std::sync::Arc;

/// Moments where little moves.
const LEAST: u32 = 16;
/// Moments where much does.
const MOST: u32 = 64;
/// Bytes of the triangles and the curves that move, of which each moment has its own.
const BYTES: usize = 16_000_000 * TRIANGLE;
/// Bytes of a triangle and of its share of what finds it.
const TRIANGLE: usize = 130;
/// Places along each side of the picture at which planes and skies are looked at.
const PLACES: u32 = 5;
/// Parts of the time in which the shutter is open, over which ways are added up: what turns may end where it was.
const LEGS: u32 = 8;
/// So many vertices of a mesh are followed at the most.
const MARKS: usize = 64;

/// The scene while the shutter is open.
#[derive(Debug, Default)]
pub struct Moments {
    /// At evenly spaced times; none where nothing is blurred.
    pub scenes: Vec<Scene>,
    /// What was written at each, to be hashed.
    pub texts: Vec<String>,
    /// What to say of it; nothing where there is no shutter.
    pub said: Option<Effect>,
}

impl Moments {
    fn none(reason: &str) -> Moments {
        let said = Effect { name: "motion blur".into(), on: false, reason: reason.into() };
        Moments { said: Some(said), ..Moments::default() }
    }
}

/// The moments of `description`, which is `still` at its frame.
///
/// # Errors
/// Those of its description, or of compiling it, at a moment.
pub fn moments(
    name: &str,
    description: &SceneDescription,
    still: &Scene,
    integrator: &Integrator,
    shelf: &mut Shelf,
) -> Result<Moments> {
    let Some(shutter) = &description.camera.shutter else { return Ok(Moments::default()) };
    let Some(motion) = &description.motion else { return Ok(Moments::none("nothing changes over frames")) };
    if !integrator.draws_times() {
        return Ok(Moments::none("whitted draws no times"));
    }
    let ShutterTimes { open, close, moments: wanted } = shutter.times();
    let (count, why) = match wanted {
        Some(count) => (count, "as the scene says".to_owned()),
        None => {
            let mut at = |part: f64| -> Result<(SceneDescription, Scene)> {
                let described = motion.at(open + (close - open) * part)?;
                let scene = compile::compile_with(&described, name, shelf)?;
                Ok((described, scene))
            };
            let (first, last) = (at(0.0)?, at(1.0)?);
            let (triangles, curves) = (Census::of(still).triangles, moving_curves(&first.1, &last.1));
            let fits = moments_that_fit(triangles, curves);
            // How far a way is counts where there is room.
            let legs = if fits > LEAST { LEGS } else { 1 };
            let mut ways = Ways::default();
            let mut slides = false;
            let mut before = None;
            for leg in 1..=legs {
                let after = if leg == legs { None } else { Some(at(f64::from(leg) / f64::from(legs))?) };
                let [from, to] = [before.as_ref().unwrap_or(&first), after.as_ref().unwrap_or(&last)];
                ways.add(&first.1, &from.1, &to.1);
                slides |= poses(&from.1) != poses(&to.1) || from.0.textures != to.0.textures;
                before = after;
            }
            let way = ways.longest(still);
            let (count, what) = match slides {
                true => (MOST, "lamps or textures move".to_owned()),
                false => ((way.round() as u32).clamp(LEAST, MOST), format!("what moves travels {way:.0} pixels")),
            };
            if count > fits {
                let curves = if curves == 0 { String::new() } else { format!(", curves of {} MB", curves / 1_000_000) };
                (fits, format!("{what}; each has {triangles} triangles{curves}"))
            } else {
                (count, what)
            }
        }
    };
    let time = |k: u32| open + (close - open) * (f64::from(k) + 0.5) / f64::from(count);
    let described: Vec<SceneDescription> = (0..count).map(|k| motion.at(time(k))).collect::<Result<_>>()?;
    let texts: Vec<String> = described.iter().map(hash_text).collect();
    if texts.iter().all(|text| *text == texts[0]) && texts[0] == hash_text(description) {
        return Ok(Moments::none("nothing changes while the shutter is open"));
    }
    let scenes = described.iter().map(|d| compile::compile_with(d, name, shelf)).collect::<Result<Vec<_>>>()?;
    let reason = format!("camera.shutter, {} of a frame at {count} moments: {why}", close - open);
    Ok(Moments { scenes, texts, said: Some(Effect { name: "motion blur".into(), on: true, reason }) })
}

/// What all moments call for together.
#[must_use]
pub fn census(still: &Scene, moments: &[Scene]) -> Census {
    moments.iter().map(Census::of).fold(Census::of(still), Census::join)
}

/// Bytes of the curves of a moment that do not stand where they do in another: those that do are there once.
fn moving_curves(open: &Scene, close: &Scene) -> usize {
    fn curves(scene: &Scene) -> impl Iterator<Item = &Arc<Curves>> {
        scene.objects.iter().filter_map(|object| match &object.geometry {
            Geometry::Curves(curves) => Some(curves),
            _ => None,
        })
    }
    let standing: HashSet<*const Curves> = curves(open).map(Arc::as_ptr).collect();
    curves(close).filter(|curves| !standing.contains(&Arc::as_ptr(curves))).map(|curves| curves.bytes()).sum()
}

/// How many moments have room, of so many triangles and bytes of curves each.
fn moments_that_fit(triangles: usize, curves: usize) -> u32 {
    (BYTES / (triangles * TRIANGLE + curves).max(1)).clamp(2, MOST as usize) as u32
}

/// Where lamps without a surface stand, whither they shine, and how they are turned about that: nobody knows what moves on the
/// picture with them.
fn poses(scene: &Scene) -> Vec<[DVec3; 3]> {
    let pose = |light: &Light| match light {
        Light::Point { position, .. } => Some([*position, DVec3::ZERO, DVec3::ZERO]),
        Light::Spot { position, axis, .. } => Some([*position, *axis, DVec3::ZERO]),
        Light::Directional { direction, .. } => Some([DVec3::ZERO, *direction, DVec3::ZERO]),
        Light::Projector(projector) => Some(projector.pose()),
        _ => None,
    };
    scene.lights.iter().filter_map(pose).collect()
}

/// How far things travel on the picture, pixels: of each thing points that stand for it, and of what has no end places that are
/// spread over the picture. What is behind the camera does not count, nor what is there at one moment only.
#[derive(Default)]
struct Ways {
    things: Vec<Vec<f64>>,
    endless: [f64; (PLACES * PLACES) as usize],
}

impl Ways {
    /// Adds the way from one moment to another, of what there is in `first`.
    fn add(&mut self, first: &Scene, from: &Scene, to: &Scene) {
        let size = DVec2::from(first.camera.resolution.map(f64::from));
        let places = |scene: &Scene, i: usize| -> Vec<Option<DVec2>> {
            let place = |point: DVec3| scene.camera.place_of(point).filter(|place| place.is_finite());
            marks(&first.objects[i], &scene.objects[i]).into_iter().map(place).collect()
        };
        let count = first.objects.len().min(from.objects.len()).min(to.objects.len());
        self.things.resize(first.objects.len(), Vec::new());
        for (i, ways) in self.things.iter_mut().enumerate().take(count) {
            let (from, to) = (places(from, i), places(to, i));
            ways.resize(from.len().max(ways.len()), 0.0);
            for (way, ends) in ways.iter_mut().zip(from.into_iter().zip(to)) {
                if let (Some(from), Some(to)) = ends {
                    *way += (to - from).length();
                }
            }
        }
        for (way, i) in self.endless.iter_mut().zip(0..) {
            let place = (DVec2::new(f64::from(i % PLACES), f64::from(i / PLACES)) + 0.5) / f64::from(PLACES);
            *way += middle::passes(from, to, place * size).unwrap_or(0.0);
        }
    }

    /// The longest of all; no further than across the picture of `scene`: beyond it nobody looks.
    fn longest(&self, scene: &Scene) -> f64 {
        let across = DVec2::from(scene.camera.resolution.map(f64::from)).length();
        self.things.iter().flatten().chain(&self.endless).copied().fold(0.0, f64::max).min(across)
    }
}

/// Points in the world that stand for a thing that was `first` and is `now`, the same ones at all moments: corners of its first box
/// that are carried as the thing is, or vertices.
fn marks(first: &Object, now: &Object) -> Vec<DVec3> {
    let bounds = first.bounds();
    let corner = |i: u32| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    let carried = |from: DAffine3, to: DAffine3| {
        let carry = to * from.inverse();
        (0..8).map(|i| carry.transform_point3(corner(i))).collect()
    };
    match (&first.geometry, &now.geometry) {
        (Geometry::Shape(from), Geometry::Shape(to)) => carried(from.placement(), to.placement()),
        (Geometry::Sdf(from), Geometry::Sdf(to)) => carried(from.placement(), to.placement()),
        (Geometry::Curves(from), Geometry::Curves(to)) => carried(from.placement(), to.placement()),
        (Geometry::Instance(from), Geometry::Instance(to)) => {
            carried(*from.map.world_from_object(), *to.map.world_from_object())
        }
        (Geometry::Mesh(_), Geometry::Mesh(to)) => {
            let positions = &to.mesh.positions;
            let step = positions.len().div_ceil(MARKS).max(1);
            positions.iter().step_by(step).map(|p| to.mesh.origin + DVec3::from(p.map(f64::from))).collect()
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::compile::testing::compiled_with;

    /// Of 65 MB a moment 32 are 2.08 GB, however the bytes are shared out; what takes none leaves as many as there may be, and
    /// what takes too much the two ends.
    #[test]
    fn triangles_and_curves_that_move_leave_room_for_fewer_moments() {
        assert_eq!(moments_that_fit(500_000, 0), 32);
        assert_eq!(moments_that_fit(0, 65_000_000), 32);
        assert_eq!(moments_that_fit(250_000, 32_500_000), 32);
        assert_eq!([moments_that_fit(0, 0), moments_that_fit(0, usize::MAX >> 1)], [MOST, 2]);
    }

    /// Two tufts of the same hairs, of which one moves: its bytes are those that each moment has.
    #[test]
    fn curves_that_stand_cost_moments_nothing() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("hair.txt"), "0 0 0 0.1\n0 1 0 0.1\n\n1 0 0 0.1\n1 1 0 0.1\n").unwrap();
        let mut shelf = Shelf::default();
        let mut at = |x: f64| {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                 shapes:\n- curves: {{file: hair.txt, basis: linear}}\n\
                 - curves: {{file: hair.txt, basis: linear, transform: [{{translate: [{x}, 0, 0]}}]}}\n"
            );
            compiled_with(directory.path(), &text, &mut shelf)
        };
        let (open, close) = (at(3.0), at(4.0));
        let Geometry::Curves(moved) = &close.objects[1].geometry else { panic!("curves") };
        assert_eq!(moving_curves(&open, &close), moved.bytes());
        assert_eq!(moving_curves(&close, &at(4.0)), 0);
    }
}
