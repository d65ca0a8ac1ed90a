//! Small pictures of lamps: a sun in a ball of glass, a bulb in a mirror.
//!
//! What mirrors, coats and glass show of a lamp may be smaller than a pixel and 10⁵ times as bright as what is around it. Of a
//! picture of area A of a pixel, N samples meet A·N in the mean, and the pixel is as much in error as that number is.
//!
//! Where such pictures lie is searched before the render (`search.rs`): a region E of small squares about each. With G(x) the light of
//! lamps that a path which begins at x meets before anything scatters it, and L(x) all that it finds, a sample of a pixel is
//!
//! ```text
//! L(x) − [x in E] · G(x) + |E| · f(y) · G(y)
//! ```
//!
//! with x drawn by the filter f of the pixel, and y from what f holds of E. As both have the same mean of f · G over E, that of the sample is
//! the pixel's light, whatever E is: what the search has missed is left to chance, and what it has found without cause costs time. Nothing
//! but light is touched, neither coverage nor data of surfaces. Where the samples of other pixels count for one, too, its y do not for
//! others.

mod light;
mod search;

use super::Shot;
use super::pilot::Use;
use super::plan::{Effect, Integrator, count};
use crate::film::Window;
use crate::scene::Scene;
use glam::DVec2;
use light::Typical;
use rayon::prelude::*;
use std::sync::Arc;

/// The farthest that a filter may reach, in pixels.
const MOST_REACH: f64 = 8.0;

/// The regions of a picture.
#[derive(Debug, PartialEq)]
pub struct Glints {
    /// Pixels from one to the farthest whose light it may have a part of.
    reach: i32,
    /// Around all that have a region within reach.
    window: Window,
    /// Whether a pixel of the window has.
    near: Vec<bool>,
    /// By pixel, in order.
    regions: Vec<([i32; 2], Region)>,
}

/// What a pixel has of E.
#[derive(Debug, PartialEq)]
pub struct Region {
    /// Squares along the pixel are two to this.
    level: u32,
    /// Squares by their places in the curve that visits quarters before their quarters (Morton 1966), in order: numbers next to each other
    /// are squares near each other.
    squares: Vec<u32>,
    /// Paths from it for each sample of the pixel, where all of it counts in full.
    paths: u32,
}

impl Region {
    /// Of squares, columns and rows of 2^`level` along the pixel.
    fn new(level: u32, squares: impl IntoIterator<Item = [u32; 2]>, paths: u32) -> Region {
        let mut squares: Vec<u32> = squares.into_iter().map(|[x, y]| spread(x) | spread(y) << 1).collect();
        squares.sort_unstable();
        squares.dedup();
        Region { level, squares, paths }
    }

    /// Whether it has a place in the pixel, from its corner.
    #[must_use]
    pub fn holds(&self, place: DVec2) -> bool {
        let side = f64::from(1u32 << self.level);
        let [x, y] = (place * side).to_array().map(|x| (x.max(0.0) as u32).min((1 << self.level) - 1));
        self.squares.binary_search(&(spread(x) | spread(y) << 1)).is_ok()
    }

    /// The place, from the corner of the pixel, that is found by `u`, uniform in the unit square.
    #[must_use]
    pub fn place(&self, u: DVec2) -> DVec2 {
        let at = u.x * self.squares.len() as f64;
        let i = (at as usize).min(self.squares.len() - 1);
        let corner = [self.squares[i], self.squares[i] >> 1].map(|code| f64::from(gathered(code)));
        (DVec2::from(corner) + DVec2::new((at - i as f64).min(1.0), u.y)) / f64::from(1u32 << self.level)
    }

    /// Its share of the pixel.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.squares.len() as f64 / f64::from(1u32 << self.level).powi(2)
    }
}

/// The low 16 bits of `x`, each before a bit of nothing.
fn spread(x: u32) -> u32 {
    [(8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)]
        .into_iter()
        .fold(x & 0xffff, |x, (by, mask)| (x | x << by) & mask)
}

/// Every second bit of `x`, from the lowest on.
fn gathered(x: u32) -> u32 {
    [(1, 0x3333_3333), (2, 0x0f0f_0f0f), (4, 0x00ff_00ff), (8, 0x0000_ffff)]
        .into_iter()
        .fold(x & 0x5555_5555, |x, (by, mask)| (x | x >> by) & mask)
}

/// How many pixels from one to the farthest that a filter of this radius holds a part of.
fn reach_of(radius: f64) -> i32 {
    (radius + 0.5).ceil() as i32 - 1
}

/// All that is no more than `by` pixels from `window`.
fn grown(window: Window, by: i32) -> Window {
    let more = 2 * by as u32;
    let Window { x, y, width, height } = window;
    Window {
        x: x.saturating_sub(by),
        y: y.saturating_sub(by),
        width: width.saturating_add(more),
        height: height.saturating_add(more),
    }
}

/// The pixels that are no more than `reach` from one.
fn square([x, y]: [i32; 2], reach: i32) -> impl Iterator<Item = [i32; 2]> {
    let about = move |x: i32| x.saturating_sub(reach)..=x.saturating_add(reach);
    about(y).flat_map(move |y| about(x).map(move |x| [x, y]))
}

impl Glints {
    /// Of regions by their pixels, in order, for filters of a radius; none of none.
    fn new(regions: Vec<([i32; 2], Region)>, radius: f64) -> Option<Glints> {
        let (first, _) = regions.first()?;
        let bounds = regions.iter().fold([*first, *first], |[low, high], (pixel, _)| {
            [[low[0].min(pixel[0]), low[1].min(pixel[1])], [high[0].max(pixel[0]), high[1].max(pixel[1])]]
        });
        let [low, high] = bounds;
        let [width, height] = [0, 1].map(|axis| (high[axis] - low[axis]) as u32 + 1);
        let reach = reach_of(radius);
        let window = grown(Window { x: low[0], y: low[1], width, height }, reach);
        let mut near = vec![false; window.pixels()];
        for pixel in regions.iter().flat_map(|(pixel, _)| square(*pixel, reach)) {
            if let Some(index) = window.index(pixel) {
                near[index] = true;
            }
        }
        Some(Glints { reach, window, near, regions })
    }

    /// Whether the filter of a pixel may hold a place of one.
    #[must_use]
    #[inline]
    pub fn are_near(&self, pixel: [i32; 2]) -> bool {
        self.window.index(pixel).is_some_and(|index| self.near[index])
    }

    /// What a pixel has of E, if anything.
    #[must_use]
    #[inline]
    pub fn of(&self, pixel: [i32; 2]) -> Option<&Region> {
        if !self.are_near(pixel) {
            return None;
        }
        let place = self.regions.binary_search_by_key(&pixel, |(pixel, _)| *pixel).ok()?;
        Some(&self.regions[place].1)
    }

    /// Whether E has a place on the picture, in pixels.
    #[must_use]
    pub fn hold(&self, place: DVec2) -> bool {
        let corner = place.floor();
        self.of([corner.x as i32, corner.y as i32]).is_some_and(|region| region.holds(place - corner))
    }

    /// What the filter of a pixel may hold of E, by pixels.
    pub fn about(&self, pixel: [i32; 2]) -> impl Iterator<Item = ([i32; 2], &Region)> {
        square(pixel, self.reach).filter_map(|pixel| self.of(pixel).map(|region| (pixel, region)))
    }
}

/// Searches the pictures of lamps that are seen in `window` of a picture of `samples` a pixel, and says what it has found; nothing
/// where no lamp can be met. Where `goes_on` is false it ends, and what is returned means nothing.
#[must_use]
pub fn find(
    shot: &Shot,
    moments: &[Scene],
    window: Window,
    samples: u32,
    wish: Use,
    goes_on: &(dyn Fn() -> bool + Sync),
) -> (Option<Arc<Glints>>, Option<Effect>) {
    let Shot { scene, plan, filter, .. } = *shot;
    let Integrator::Path(settings) = &plan.integrator else { return (None, None) };
    let say = |on: bool, reason: String| Some(Effect { name: "small pictures of lamps".into(), on, reason });
    let lamps = search::lamps(scene);
    if lamps.is_empty() || settings.scatter_samples == 0 {
        return (None, None);
    }
    let off = if wish == Use::Off {
        Some("the scene says so".to_owned())
    } else if scene.camera.lens.is_some() {
        Some("a lens blurs them".to_owned())
    } else if !moments.is_empty() {
        Some("things move while the shutter is open".to_owned())
    } else if !filter.is_positive() {
        // A sample with light that counts against its pixel would be one that light cannot make.
        Some("the filter has negative lobes".to_owned())
    } else if filter.radius() > MOST_REACH {
        Some(format!("the filter reaches farther than {MOST_REACH} pixels"))
    } else if lamps.len() > search::MOST_LAMPS {
        Some(format!("there are more than {} lamps", search::MOST_LAMPS))
    } else if samples < search::FEWEST && wish == Use::Auto {
        Some(format!("fewer than {} samples do not pay for the search", search::FEWEST))
    } else {
        None
    };
    if let Some(reason) = off {
        return (None, say(false, reason));
    }
    let typical = Typical::of(shot);
    let mean = typical.mean / f64::from(scene.light_unit());
    let window = grown(window, reach_of(filter.radius()));
    let Some(mut regions) = search::regions(scene, &lamps, window, samples, mean, goes_on) else {
        return (None, say(false, format!("there are more than {}", search::MOST_PICTURES)));
    };
    if regions.is_empty() {
        return (None, say(false, "none is seen in mirrors or glass".into()));
    }
    if wish == Use::Auto {
        regions = regions.into_par_iter().filter(|found| goes_on() && typical.pays(shot, found)).collect();
    }
    let regions = regions.into_iter().map(|(pixel, region, _)| (pixel, region)).collect();
    match Glints::new(regions, filter.radius()) {
        None => (None, say(false, "chance finds those that are seen often enough".into())),
        Some(glints) => {
            let paths = glints.regions.iter().map(|(_, region)| region.paths as usize).sum::<usize>();
            let paths = count(paths, "further path", "further paths");
            let reason = format!("{paths} for {}", count(glints.regions.len(), "pixel", "pixels"));
            (Some(Arc::new(glints)), say(true, reason))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares are found in any order once, hold what is drawn in them and nothing beyond, and have all of their area alike.
    #[test]
    fn places_of_a_region_lie_in_it() {
        let squares = [[5, 2], [0, 0], [7, 7], [5, 2], [5, 3]];
        let region = Region::new(3, squares, 1);
        assert_eq!(region.squares.len(), 4);
        assert!((region.area() - 4.0 / 64.0).abs() < 1e-15);
        let mut counts = [[0; 8]; 8];
        for i in 0..400 {
            let place = region.place(DVec2::new((f64::from(i) + 0.5) / 400.0, f64::from(i * 7 % 400) / 400.0));
            assert!(region.holds(place));
            counts[(place.y * 8.0) as usize][(place.x * 8.0) as usize] += 1;
        }
        for (y, row) in counts.iter().enumerate() {
            for (x, &drawn) in row.iter().enumerate() {
                let is_in = squares.contains(&[x as u32, y as u32]);
                assert_eq!(drawn, if is_in { 100 } else { 0 }, "{x} {y}");
                assert_eq!(region.holds((DVec2::new(x as f64, y as f64) + 0.5) / 8.0), is_in);
            }
        }
        assert!(region.holds(region.place(DVec2::ONE)));
        for x in [0, 1, 77, 4095, 65535] {
            assert_eq!(gathered(spread(x)), x);
        }
    }

    #[test]
    fn regions_are_found_by_their_pixels() {
        assert_eq!(Glints::new(Vec::new(), 0.5), None);
        let pixels = [[-3, 2], [-3, 9], [4, 2]];
        for (radius, reach) in [(0.3, 0), (0.5, 0), (1.0, 1), (1.5, 1), (2.0, 2)] {
            let regions = pixels.iter().map(|&pixel| (pixel, Region::new(1, [[0, 1]], 1))).collect();
            let glints = Glints::new(regions, radius).expect("there are some");
            for [x, y] in (-3..14).flat_map(|y| (-8..10).map(move |x| [x, y])) {
                assert_eq!(glints.of([x, y]).is_some(), pixels.contains(&[x, y]), "{x} {y}");
                let middle = DVec2::new(f64::from(x) + 0.25, f64::from(y) + 0.75);
                assert_eq!(glints.hold(middle), pixels.contains(&[x, y]), "{x} {y}");
                assert!(!glints.hold(middle + DVec2::X * 0.5));
                let within = |pixel: &[i32; 2]| (pixel[0] - x).abs() <= reach && (pixel[1] - y).abs() <= reach;
                let expected: Vec<[i32; 2]> = pixels.into_iter().filter(within).collect();
                let mut found: Vec<[i32; 2]> = glints.about([x, y]).map(|(pixel, _)| pixel).collect();
                found.sort_unstable();
                assert_eq!(found, expected, "{x} {y}");
                assert_eq!(glints.are_near([x, y]), !expected.is_empty(), "{x} {y}");
            }
        }
    }
}
