//! What pixels share of their errors where one path from a light is seen in several.

use super::{LightPaths, trace};
use crate::film::Window;
use crate::film::accumulate::Invalid;
use crate::film::filter::FilterSampler;
use crate::spectrum::ColourSpace;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Paths that are followed to tell, at the most.
const PATHS: u64 = 1 << 13;

/// Of that many are always as many followed as all.
const AT_ONCE: u64 = 1 << 6;

/// Pixels that they may come to: a wide filter deals light to thousands.
const PIXELS: usize = 1 << 19;

/// Tells the random numbers of these paths from those of the picture.
const STREAM: u64 = 0x7370_616e_7061_7468;

/// Sums of red, green and blue, and of their squares.
#[derive(Clone, Copy, Default)]
struct Sums([[f64; 2]; 3]);

impl Sums {
    fn add(&mut self, light: [f64; 3]) {
        for (sums, x) in self.0.iter_mut().zip(light) {
            sums[0] += x;
            sums[1] += x * x;
        }
    }

    /// Variances of one of `n` numbers, times n − 1.
    fn variances(&self, n: f64) -> [f64; 3] {
        self.0.map(|[sum, squares]| squares - sum * sum / n)
    }
}

/// In how many pixels light falls together that `paths` bring and `filter` deals to those of `window`: with x what a path leaves in a
/// pixel and T in all of them, var T / Σ var x, of red, green or blue where it is most. Errors of the sum of all pixels are those of
/// independent ones, times its root. One where nothing comes to any.
#[must_use]
pub fn span(paths: &LightPaths, filter: &FilterSampler, window: &Window) -> f64 {
    let paths = &LightPaths { seed: paths.seed ^ STREAM, ..*paths };
    let unit = paths.scene.light_unit();
    let follow = |index: u64| {
        let mut pixels: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
        trace(paths, 0, index, None, &mut |wavelengths, splat| {
            if Invalid::of(splat.light).is_some() {
                return;
            }
            let rgb = ColourSpace::Rec709.from_xyz(splat.xyz(unit, wavelengths)).map(f64::from);
            filter.deal(splat.place, window, |pixel, share| {
                if let Some(index) = window.index(pixel) {
                    let sum = pixels.entry(index).or_default();
                    sum.iter_mut().zip(rgb).for_each(|(sum, x)| *sum += x * f64::from(share));
                }
            });
        });
        pixels
    };
    let (mut followed, mut came) = (0, 0);
    let mut all = Sums::default();
    let mut each: BTreeMap<usize, Sums> = BTreeMap::new();
    while followed < PATHS && came < PIXELS {
        // In the order of the paths, whoever follows them.
        let found: Vec<_> = (followed..followed + AT_ONCE).into_par_iter().map(follow).collect();
        for pixels in &found {
            let mut total = [0.0; 3];
            for (&index, &light) in pixels {
                each.entry(index).or_default().add(light);
                total.iter_mut().zip(light).for_each(|(sum, x)| *sum += x);
            }
            all.add(total);
            came += pixels.len();
        }
        followed += AT_ONCE;
    }
    let n = followed as f64;
    let mut apart = [0.0; 3];
    for pixel in each.values() {
        apart.iter_mut().zip(pixel.variances(n)).for_each(|(sum, variance)| *sum += variance);
    }
    let shared = all.variances(n).into_iter().zip(apart).map(|(together, apart)| together / apart);
    // Without light there is nothing to share: 0/0.
    shared.filter(|shared| shared.is_finite()).fold(1.0, f64::max)
}
