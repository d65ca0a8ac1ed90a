//! What paths from the camera show, in blocks of the picture: means, variances, and how often they meet light of the class.

use super::BLOCKS;
use crate::math::sampler::{Sampler, Set, pairs};
use crate::scene::Scene;
use crate::spectrum::{ColourSpace, Lanes, observer};
use crate::transport::{Shot, moment, place_in, probe, scene_at};
use glam::DVec3;
use rayon::prelude::*;

/// What the pilot saw of the picture.
pub(super) struct Camera {
    /// Mean luminance of each block.
    pub means: Vec<f64>,
    /// Variances, over those of single samples as evenly spread ones have them: of what remains with the camera, and of
    /// all.
    pub kept: Vec<(usize, f64)>,
    pub all: Vec<(usize, f64)>,
    /// Of light of the class that is seen in mirrors and glass.
    pub mirrored: Vec<(usize, f64)>,
    /// How many paths there were, how many met light of the class, and how many in mirrors and glass.
    pub paths: usize,
    pub met: usize,
    pub met_mirrored: usize,
    /// Mean luminance of what they met: of light of the class that is not seen in mirrors and glass, and of such that is.
    pub brought: f64,
    pub brought_mirrored: f64,
    /// Rays of a path.
    pub rays: f64,
}

/// A colour: luminance and linear Rec. 709, whose channels all count where errors are told.
#[derive(Clone, Copy, Default)]
pub(super) struct Colour {
    pub y: f64,
    rgb: DVec3,
}

impl Colour {
    pub fn of(xyz: [f32; 3]) -> Colour {
        let rgb = DVec3::from(ColourSpace::Rec709.from_xyz(xyz).map(f64::from));
        let y = f64::from(xyz[1]);
        if y.is_finite() && rgb.is_finite() { Colour { y, rgb } } else { Colour::default() }
    }

    /// The mean of the squares of the channels.
    pub fn square(&self) -> f64 {
        self.rgb.length_squared() / 3.0
    }
}

impl std::ops::Add for Colour {
    type Output = Colour;
    fn add(self, other: Colour) -> Colour {
        Colour { y: self.y + other.y, rgb: self.rgb + other.rgb }
    }
}

/// What a replicate of a pixel showed, a sample.
#[derive(Clone, Copy, Default)]
struct Shown {
    kept: Colour,
    /// Light of the class that is seen in mirrors and glass, and other light of the class.
    seen: Colour,
    left: Colour,
    met: usize,
    met_seen: usize,
    /// A ray to the next vertex and one to a light from each, of all samples.
    rays: f64,
}

/// Paths from the camera through all blocks: `pixels` of each, two replicates of each with `each` samples. Evenly spread
/// samples have less variance than their number says, as those of the picture have.
pub(super) fn from_camera(shot: &Shot, moments: &[Scene], (pixels, each): (u32, u32)) -> Camera {
    let show = |pixel: [u32; 2], replicate: u32| {
        let mut shown = Shown::default();
        let share = shot.scene.light_unit() / each as f32;
        for index in 0..each {
            let scene = scene_at(shot.scene, moments, |count| moment(shot.seed, pixel, replicate, index, count));
            let (light, wavelengths) = probe(&Shot { scene, ..*shot }, pixel, replicate, index);
            let colour = |light: Lanes| Colour::of(observer::xyz(light * share, &wavelengths));
            let left = colour(light.left);
            let met = left.y > 0.0;
            shown.kept = shown.kept + colour(light.radiance);
            // Light of the class that is seen in mirrors and glass stays with the camera unless it is merged.
            if light.mirrored {
                shown.seen = shown.seen + left;
                shown.met_seen += usize::from(met);
            } else {
                shown.left = shown.left + left;
            }
            shown.met += usize::from(met);
            shown.rays += f64::from(1 + 2 * light.events);
        }
        shown
    };
    let tried: Vec<_> = (0..BLOCKS * BLOCKS)
        .into_par_iter()
        .flat_map_iter(|block| (0..pixels).map(move |n| (block, n)))
        .map(|(block, n)| {
            let u = pairs(Sampler::new(shot.seed, [block as u32, n], 0, 0).set(Set::Lens)).0;
            let place = place_in(shot.scene, BLOCKS, block, u);
            (block, [0, 1].map(|replicate| show([place.x as u32, place.y as u32], replicate)))
        })
        .collect();
    let paths = 2 * each as usize * tried.len();
    let mut camera = Camera {
        means: vec![0.0; BLOCKS * BLOCKS],
        kept: Vec::new(),
        mirrored: Vec::new(),
        all: Vec::new(),
        paths,
        met: 0,
        met_mirrored: 0,
        brought: 0.0,
        brought_mirrored: 0.0,
        rays: 0.0,
    };
    for (block, [a, b]) in &tried {
        let variance = |a: Colour, b: Colour| 0.5 * f64::from(each) * (a.rgb - b.rgb).length_squared() / 3.0;
        camera.means[*block] += 0.5 * (a.kept.y + b.kept.y) / f64::from(pixels);
        camera.kept.push((*block, variance(a.kept, b.kept)));
        camera.mirrored.push((*block, variance(a.seen, b.seen)));
        camera.all.push((*block, variance(a.kept + a.seen + a.left, b.kept + b.seen + b.left)));
        camera.met += a.met + b.met;
        camera.met_mirrored += a.met_seen + b.met_seen;
        camera.brought += (a.left.y + b.left.y) / (2 * tried.len()) as f64;
        camera.brought_mirrored += (a.seen.y + b.seen.y) / (2 * tried.len()) as f64;
        camera.rays += (a.rays + b.rays) / paths as f64;
    }
    camera
}
