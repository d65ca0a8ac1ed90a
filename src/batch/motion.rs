//! Motion blur: the scene at moments while the shutter of the camera is open.
//!
//! Every sample sees one moment, drawn by a number of its own ([`crate::transport::moment`]), so that the picture is the mean
//! over the moments, whatever changes: the estimate is unbiased for those moments, which stand at the middles of
//! equal times. What the eye would see of their distance is bounded by their number: as many as the pixels that the
//! fastest thing travels, 16 to 64.

use super::prepare::hash_text;
use crate::description::{SceneDescription, ShutterTimes};
use crate::error::Result;
use crate::scene::bvh::Aabb;
use crate::scene::census::Census;
use crate::scene::compile;
use crate::scene::curves::Curves;
use crate::scene::shelf::Shelf;
use crate::scene::{Geometry, Scene};
use crate::transport::middle;
use crate::transport::plan::{Effect, Integrator};
use glam::{DMat4, DVec2, DVec3, DVec4};
use std::collections::HashSet;
use std::sync::Arc;

/// Moments where little moves: what turns in its place moves by no more than this tells.
const LEAST: u32 = 16;
/// Moments where much does.
const MOST: u32 = 64;
/// Bytes of the triangles and the curves that move, of which each moment has its own.
const BYTES: usize = 16_000_000 * TRIANGLE;
/// Bytes of a triangle and of its share of what finds it.
const TRIANGLE: usize = 130;
/// Places along each side of the picture at which planes and skies are looked at.
const PLACES: u32 = 5;

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
    match integrator {
        Integrator::Path(_) | Integrator::Depth | Integrator::Nothing => {}
        Integrator::Whitted(_) => return Ok(Moments::none("whitted draws no times")),
        Integrator::Light(_) => return Ok(Moments::none("light_tracer draws no times")),
    }
    let ShutterTimes { open, close, moments: wanted } = shutter.times();
    let (count, why) = match wanted {
        Some(count) => (count, "as the scene says".to_owned()),
        None => {
            let mut at = |time| compile::compile_with(&motion.at(time)?, name, shelf);
            let (open, close) = (at(open)?, at(close)?);
            let way = travelled(&open, &close);
            let (triangles, curves) = (Census::of(still).triangles, moving_curves(&open, &close));
            let count = (way.round() as u32).clamp(LEAST, MOST);
            let fits = moments_that_fit(triangles, curves);
            let what = format!("what moves travels {way:.0} pixels");
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

/// The longest way between two moments, pixels, of the corner of a box, and of what has no end at places that are spread over
/// the picture. What is behind the camera does not count, nor what is there at one of them only.
fn travelled(open: &Scene, close: &Scene) -> f64 {
    let size = DVec2::from(open.camera.resolution.map(f64::from));
    let places = |scene: &Scene, bounds: &Aabb| -> Vec<Option<DVec2>> {
        let ndc_from_world = DMat4::from_cols_array(&scene.camera.ndc_from_world().map(f64::from));
        let corner = |i: u32| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            let at = ndc_from_world * DVec4::from((DVec3::new(pick(0), pick(1), pick(2)), 1.0));
            (at.w > 0.0 && at.is_finite()).then(|| DVec2::new(at.x, at.y) / at.w * size)
        };
        (0..8).map(corner).collect()
    };
    // No further than across the picture: beyond it nobody looks.
    let across = size.length();
    let pairs = open.objects.iter().zip(&close.objects);
    let ways = pairs.flat_map(|(a, b)| {
        let (from, to) = (places(open, &a.bounds()), places(close, &b.bounds()));
        from.into_iter().zip(to).filter_map(|(from, to)| Some((to? - from?).length())).collect::<Vec<_>>()
    });
    let spread = |i: u32| (DVec2::new(f64::from(i % PLACES), f64::from(i / PLACES)) + 0.5) / f64::from(PLACES);
    let endless = (0..PLACES * PLACES).filter_map(|i| middle::passes(open, close, spread(i) * size));
    ways.chain(endless).fold(0.0, f64::max).min(across)
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
