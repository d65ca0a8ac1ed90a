//! Where small pictures of lamps lie.
//!
//! From places spread over the picture rays follow every row of mirrors, coats and glass, both ways at each, three side by side. How far
//! the first of them goes past a lamp, and how much less the two beside it do, tells by Newton's method where on the picture one would
//! meet the lamp's middle. There the same derivative J, of the miss in radii of the lamp by the place, tells what the picture of the lamp
//! is: the ellipse |J Δx| ≤ 1. Where wavelengths part each has its own.

use super::{Region, square};
use crate::film::Window;
use crate::math::{Frame, Ray};
use crate::optics::bsdf::{Bsdf, Lobes, Pane, mirror};
use crate::optics::dielectric::{Dielectric, RelativeIndex};
use crate::scene::light::Light;
use crate::scene::material::Kind;
use crate::scene::nested::{Bodies, Inside};
use crate::scene::shape::Shape;
use crate::scene::{Geometry, Hit, Object, Scene, SurfacePoint};
use crate::spectrum::{LANES, Lanes, Spectrum};
use crate::transport::path::seen_frame;
use crate::transport::shadow::MAX_BOUNDARIES;
use arrayvec::ArrayVec;
use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// The fewest samples of a pixel for which it is searched.
pub(super) const FEWEST: u32 = 16;

/// The most lamps, and the most pictures of them: ripples on water show thousands, which chance meets.
pub(super) const MOST_LAMPS: usize = 16;
pub(super) const MOST_PICTURES: usize = 10_000;

/// Surfaces that a row has at the most.
const DEPTH: usize = 8;

/// The least luminance of a picture, over that of all.
const FAINTEST: f64 = 2.0;

/// Samples for each place from which it is searched, which takes about as long as four of them, and the least and the most that is between
/// two places, in pixels.
const SAMPLES_A_PLACE: f64 = 256.0;
const APART: (f64, f64) = (0.5, 4.0);

/// How far from a place a picture may lie, in pixels.
const REACH: f64 = 6.0;

/// Steps to a picture at the most, and the part of its smaller half axis that the last one may have.
const STEPS: usize = 16;
const LAST: f64 = 0.05;

/// Between rays side by side, in pixels, and in half axes once they are known.
const BESIDE: f64 = 1e-4;

/// Half of the greater axis of what is a small picture, and the least and the most that half of the smaller may be, in pixels.
const LARGEST: f64 = 8.0;
const SMALLEST: f64 = 1.0 / 2048.0;
const WIDEST: f64 = 1.5;

/// Squares along half of the smaller axis of an ellipse.
const SQUARES: f64 = 3.0;

/// Beyond an ellipse by this part of it are still squares: it is not quite one.
const MARGIN: f64 = 1.1;

/// Paths for each sample of a pixel: as many as the root of one over the chance of the rarest of its rows, times this; and the most.
const PATHS: f64 = 2.0;
const MOST_PATHS: f64 = 32.0;

/// Squares of a pixel at the most, and how often it is halved.
const MOST_SQUARES: usize = 1 << 12;
const MOST_LEVEL: u32 = 10;

/// The wavelengths that are searched by, those after the first where they part, as light that glass throws about within comes out of it at
/// some angles for some of them alone; those between which all are, into how many parts that is divided, and how often these are halved.
const SEARCHED: [f64; 3] = [550.0, 440.0, 660.0];
const ENDS: [f64; 2] = [390.0, 710.0];
const PARTS: u32 = 16;
const HALVINGS: u32 = 3;

/// A lamp.
pub(super) struct Lamp {
    shines: Shines,
    /// Of the brightest that it has, film units.
    luminance: f64,
}

enum Shines {
    /// An object, by a ball around it.
    Object { object: u32, middle: DVec3, radius: f64 },
    /// A disc at infinity: toward its middle, and the sine of half its angle.
    Disc { toward: DVec3, radius: f64 },
}

/// The lamps whose pictures may be small.
pub(super) fn lamps(scene: &Scene) -> Vec<Lamp> {
    let of = |light: &Light| {
        let shines = match light {
            Light::Area { object, .. } => {
                let thing = &scene.objects[*object as usize];
                let bounds = thing.bounds();
                let half = 0.5 * (bounds.max - bounds.min);
                let radius = match &thing.geometry {
                    Geometry::Shape(Shape::Sphere(_)) => half.x,
                    _ => half.length(),
                };
                Shines::Object { object: *object, middle: bounds.min + half, radius }
            }
            Light::Environment(map) => {
                let (toward, half_angle) = map.sun_disc()?;
                Shines::Disc { toward, radius: libm::sin(half_angle) }
            }
            _ => return None,
        };
        let luminance = light.spectra().iter().map(Spectrum::luminance).fold(0.0, f64::max);
        Some(Lamp { shines, luminance })
    };
    scene.lights.iter().filter_map(of).filter(Lamp::is_finite).collect()
}

impl Lamp {
    fn is_finite(&self) -> bool {
        match self.shines {
            Shines::Object { middle, radius, .. } => middle.is_finite() && radius.is_finite() && radius > 0.0,
            Shines::Disc { radius, .. } => radius > 0.0,
        }
    }

    /// Toward its middle from `from`, and the sine of half of its angle; `None` from within.
    fn seen(&self, from: DVec3) -> Option<(DVec3, f64)> {
        match self.shines {
            Shines::Object { middle, radius, .. } => {
                let to = middle - from;
                let distance = to.length();
                (distance > radius).then(|| (to / distance, radius / distance))
            }
            Shines::Disc { toward, radius } => Some((toward, radius)),
        }
    }

    /// How far the first of three rays goes past its middle, in radii, and the derivative of that by the place on the picture, which is
    /// `step` apart.
    fn miss(&self, ways: &[Way; 3], step: f64) -> Option<(DVec2, DMat2)> {
        let rays = ways.each_ref().map(|way| way.ray);
        let (toward, sine) = self.seen(rays[0].origin)?;
        if rays[0].direction.dot(toward) <= 0.0 {
            return None;
        }
        let frame = Frame::from_normal(toward);
        let off = |ray: &Ray| {
            let error = ray.direction - self.seen(ray.origin)?.0;
            Some(DVec2::new(error.dot(frame.s), error.dot(frame.t)) / sine)
        };
        let [here, right, down] = [off(&rays[0])?, off(&rays[1])?, off(&rays[2])?];
        let slopes = DMat2::from_cols((right - here) / step, (down - here) / step);
        (slopes.determinant().abs() > 0.0 && slopes.is_finite()).then_some((here, slopes))
    }
}

/// What a ray does at a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Turn {
    Mirrored,
    Through,
}

type Turns = ArrayVec<Turn, DEPTH>;

/// A ray, and the bodies with a priority that it is in.
#[derive(Clone, Copy)]
struct Way {
    ray: Ray,
    bodies: Bodies,
}

/// A surface that a ray has met.
struct Met<'a> {
    /// The ray, where it came to what is in its way.
    ray: Ray,
    /// The bodies on the side from where it came.
    here: Bodies,
    object: &'a Object,
    hit: Hit,
    surface: SurfacePoint,
    frame: Frame,
    bsdf: Bsdf<'a>,
}

/// Where on the picture one meets the middle of a lamp.
#[derive(Clone, Debug)]
struct Picture {
    lamp: usize,
    turns: Turns,
    /// In pixels.
    place: DVec2,
    /// The miss in radii by the place.
    slopes: DMat2,
    left: Share,
    /// For which it was found.
    nm: f64,
    /// Of wavelengths.
    part: f64,
}

/// What is left along a row.
#[derive(Clone, Copy, Debug)]
struct Share {
    /// Of the light.
    light: f64,
    /// How often a path finds the lamp behind: what is mirrored last is looked at without chance (`path/mirrored.rs`).
    chance: f64,
    /// Whether wavelengths have parted.
    parts: bool,
}

impl Share {
    const ALL: Share = Share { light: 1.0, chance: 1.0, parts: false };

    /// After a turn with this share of the light, at what parts wavelengths or not.
    fn after(self, turn: Turn, share: f64, parts: bool) -> Share {
        let light = self.light * share;
        match turn {
            Turn::Mirrored => Share { light, chance: self.light, ..self },
            Turn::Through => Share { light, chance: light, parts: self.parts || parts },
        }
    }
}

impl Picture {
    /// Halves of its axes, the greater first, in pixels.
    fn half_axes(&self) -> [f64; 2] {
        // Singular values of the slopes.
        let DMat2 { x_axis, y_axis } = self.slopes;
        let (sum, product) = (x_axis.length_squared() + y_axis.length_squared(), self.slopes.determinant().abs());
        let root = (sum * sum - 4.0 * product * product).max(0.0).sqrt();
        let greatest = (0.5 * (sum + root)).sqrt();
        [greatest / product, 1.0 / greatest]
    }

    /// The greatest miss that a square of a side may have in its middle, in radii.
    fn reach(&self, side: f64) -> f64 {
        MARGIN + std::f64::consts::FRAC_1_SQRT_2 * side / self.half_axes()[1]
    }

    /// The pixel of its middle.
    fn pixel(&self) -> [i32; 2] {
        self.place.floor().to_array().map(|x| x as i32)
    }

    fn is_small(&self) -> bool {
        let [greater, smaller] = self.half_axes();
        greater <= LARGEST && (SMALLEST..=WIDEST).contains(&smaller)
    }

    /// Whether what is found there by the same row is in it.
    fn shows(&self, other: &Picture) -> bool {
        self.lamp == other.lamp && self.turns == other.turns && self.radii(other.place) < 1.0
    }

    /// How far a place is from its middle, in its radii.
    fn radii(&self, place: DVec2) -> f64 {
        (self.slopes * (place - self.place)).length()
    }
}

/// Luminance of pictures in the mean of a pixel, and of the square of what a path that meets them by chance finds, film units.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Expected {
    pub(super) mean: f64,
    pub(super) square: f64,
}

/// A pixel, what it has of the pictures, and what chance finds of them.
pub(super) type Found = ([i32; 2], Region, Expected);

/// What the pixels of `window` have of small pictures, which rows of sharp things that begin there or near show, where they are brighter
/// than the `mean` luminance of all that is seen; `None` if they are too many. Where `goes_on` is false what is returned means nothing.
pub(super) fn regions(
    scene: &Scene,
    lamps: &[Lamp],
    window: Window,
    samples: u32,
    mean: f64,
    goes_on: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<Found>> {
    let brightest = lamps.iter().map(|lamp| lamp.luminance).fold(0.0, f64::max);
    let search = Search { scene, lamps, least: FAINTEST * mean, brightest };
    let apart = (SAMPLES_A_PLACE / f64::from(samples.max(1))).sqrt().clamp(APART.0, APART.1);
    // A picture is found from all places that are near it, whatever is rendered of it: beyond the window, too.
    let margin = REACH + LARGEST + apart;
    let range = |start: i32, size: u32| {
        let (low, high) = (f64::from(start) - margin, f64::from(start) + f64::from(size) + margin);
        (low / apart).floor() as i32..(high / apart).floor() as i32 + 1
    };
    let places = |x: i32, y: i32| (DVec2::new(f64::from(x), f64::from(y)) + 0.5) * apart;
    let columns = range(window.x, window.width);
    let rows: Vec<Vec<Picture>> = range(window.y, window.height)
        .into_par_iter()
        .map(|y| columns.clone().take_while(|_| goes_on()).flat_map(|x| search.from(places(x, y))).collect())
        .collect();
    let (mut ellipses, mut count) = (Pictures::default(), 0);
    for nm in SEARCHED {
        // Those that no other wavelength has led to; the same one is found from several places, some part of its size apart.
        let mut new = Pictures::default();
        for picture in rows.iter().flatten().filter(|picture| picture.nm == nm) {
            if !ellipses.show(picture) && !new.show(picture) {
                new.push(picture.clone());
            }
        }
        count += new.all.len();
        if count > MOST_PICTURES {
            return None;
        }
        let of_all: Vec<Vec<Picture>> = new.all.par_iter().map(|picture| search.of_all_wavelengths(picture)).collect();
        of_all.into_iter().flatten().for_each(|picture| ellipses.push(picture));
    }
    Some(covered(&ellipses.all, lamps, window))
}

/// Pictures, and by the pixel that each lies in.
#[derive(Default)]
struct Pictures {
    all: Vec<Picture>,
    by_pixel: HashMap<[i32; 2], Vec<usize>>,
}

impl Pictures {
    /// Whether one in its pixel or beside it shows what another does.
    fn show(&self, other: &Picture) -> bool {
        square(other.pixel(), 1)
            .filter_map(|pixel| self.by_pixel.get(&pixel))
            .flatten()
            .any(|&i| self.all[i].shows(other))
    }

    fn push(&mut self, picture: Picture) {
        self.by_pixel.entry(picture.pixel()).or_default().push(self.all.len());
        self.all.push(picture);
    }
}

struct Search<'a> {
    scene: &'a Scene,
    lamps: &'a [Lamp],
    /// Luminance of a picture that is worth finding, and of the brightest lamp.
    least: f64,
    brightest: f64,
}

impl Search<'_> {
    /// Rays of the camera at a place and `step` to the right and down from it.
    fn ways(&self, place: DVec2, step: f64) -> [Way; 3] {
        let bodies = self.scene.camera_inside.bodies;
        let ray = |to: DVec2| self.scene.camera.ray(place + to * step, || DVec2::splat(0.5));
        [DVec2::ZERO, DVec2::X, DVec2::Y].map(|to| Way { ray: ray(to), bodies })
    }

    /// The pictures that are found from `place`.
    fn from(&self, place: DVec2) -> Vec<Picture> {
        let mut found = Vec::new();
        for nm in SEARCHED {
            let ways = self.ways(place, BESIDE);
            let parts = self.follow((place, nm), ways, &mut Turns::new(), Share::ALL, &mut found);
            if nm == SEARCHED[0] && !parts {
                break;
            }
        }
        found.retain(|picture| picture.nm == SEARCHED[0] || picture.left.parts);
        found
    }

    /// Looks for lamps along `ways` of a wavelength, which begin at a place and have come to where they are by `turns`, and follows them on.
    /// Whether wavelengths part on the way.
    fn follow(
        &self,
        (place, nm): (DVec2, f64),
        ways: [Way; 3],
        turns: &mut Turns,
        left: Share,
        found: &mut Vec<Picture>,
    ) -> bool {
        for (lamp, of) in self.lamps.iter().enumerate() {
            if left.light * of.luminance < self.least {
                continue;
            }
            let Some((miss, slopes)) = of.miss(&ways, BESIDE) else { continue };
            let step = slopes.inverse() * miss;
            if step.length() <= REACH {
                let seed = Picture { lamp, turns: turns.clone(), place: place - step, slopes, left, nm, part: 1.0 };
                if let Some(picture) = self.settle(seed, place, nm) {
                    found.push(picture);
                }
            }
        }
        let mut parts = left.parts;
        if turns.is_full() {
            return parts;
        }
        let Some(met) = self.meet(&ways[0], nm) else { return parts };
        let beside = [1, 2].map(|i| self.meet(&ways[i], nm).filter(|other| other.hit.object == met.hit.object));
        let [Some(right), Some(down)] = beside else { return parts };
        for turn in [Turn::Mirrored, Turn::Through] {
            let Some((first, share)) = self.turn(&met, turn) else { continue };
            let left = left.after(turn, share, met.parts());
            if left.light * self.brightest < self.least {
                continue;
            }
            let others = [&right, &down].map(|met| self.turn(met, turn));
            let [Some((right, _)), Some((down, _))] = others else { continue };
            turns.push(turn);
            parts |= self.follow((place, nm), [first, right, down], turns, left, found);
            turns.pop();
        }
        parts
    }

    /// The picture that a `seed` leads to for the wavelength `nm`, no farther from `start` than is searched; `None` where it leads to none, or
    /// to one that is hidden or not small.
    fn settle(&self, seed: Picture, start: DVec2, nm: f64) -> Option<Picture> {
        let lamp = &self.lamps[seed.lamp];
        let mut picture = Picture { nm, ..seed };
        // Where it was before, and how far from the lamp: a step that leads off the row, or farther away, is too long.
        let (mut before, mut least) = (start, f64::INFINITY);
        for _ in 0..STEPS {
            let near = picture.place.distance(start) <= REACH;
            let end = near.then(|| self.end(&picture, nm)).flatten();
            let Some((last, miss, slopes)) = end.filter(|(_, miss, _)| miss.length() < least) else {
                picture.place = 0.5 * (picture.place + before);
                continue;
            };
            (before, least, picture.slopes) = (picture.place, miss.length(), slopes);
            if least <= LAST {
                return (picture.is_small() && self.is_met(&last, lamp)).then_some(picture);
            }
            let correction = slopes.inverse() * miss;
            picture.place -= correction * (REACH / correction.length()).min(1.0);
        }
        None
    }

    /// The ray that the row of a picture ends with, how far it misses the lamp, and the derivative of that.
    fn end(&self, picture: &Picture, nm: f64) -> Option<(Way, DVec2, DMat2)> {
        let step = BESIDE.min(0.1 * picture.half_axes()[1]);
        let mut ways = self.ways(picture.place, step);
        for &turn in &picture.turns {
            for way in &mut ways {
                *way = self.meet(way, nm).and_then(|met| self.turn(&met, turn))?.0;
            }
        }
        let (miss, slopes) = self.lamps[picture.lamp].miss(&ways, step)?;
        Some((ways[0], miss, slopes))
    }

    /// Whether a ray meets the lamp before anything else that shows.
    fn is_met(&self, way: &Way, lamp: &Lamp) -> bool {
        let (_, hit) = self.first(way);
        match lamp.shines {
            Shines::Object { object, .. } => hit.is_some_and(|hit| hit.object == object),
            Shines::Disc { .. } => hit.is_none(),
        }
    }

    /// The same picture for wavelengths that part, no further from each other than it is wide; itself alone where they do not.
    fn of_all_wavelengths(&self, picture: &Picture) -> Vec<Picture> {
        if !picture.left.parts {
            return vec![picture.clone()];
        }
        let whole = (ENDS[1] - ENDS[0]) / f64::from(PARTS);
        let mut all = vec![Picture { part: f64::from(PARTS).recip(), ..picture.clone() }];
        for end in ENDS {
            let mut last = picture.clone();
            while (end - last.nm).abs() > 1e-9 {
                let mut step = (end - last.nm).clamp(-whole, whole);
                let mut next = self.settle(last.clone(), last.place, last.nm + step);
                for _ in 0..HALVINGS {
                    if next.as_ref().is_some_and(|next| last.radii(next.place) <= 1.0) {
                        break;
                    }
                    step *= 0.5;
                    next = self.settle(last.clone(), last.place, last.nm + step);
                }
                let Some(next) = next else { break };
                last = Picture { part: step.abs() / (ENDS[1] - ENDS[0]), ..next };
                all.push(last.clone());
            }
        }
        all
    }

    /// The first surface that shows along a ray, if there is one, and the ray as it comes there: of bodies that overlap one has the place,
    /// and what bounds a medium alone bends no light.
    fn first(&self, way: &Way) -> (Way, Option<Hit>) {
        let (scene, mut way) = (self.scene, *way);
        for _ in 0..=MAX_BOUNDARIES {
            let Some(hit) = scene.closest(&way.ray, f64::INFINITY) else { break };
            let object = &scene.objects[hit.object as usize];
            let bounds = matches!(scene.materials[object.material as usize].kind, Kind::Boundary);
            if object.light.is_some() || object.body == 0 && !bounds {
                return (way, Some(hit));
            }
            let (surface, went) = (scene.surface(&way.ray, &hit), way.ray.direction);
            if scene.crossing(object, &surface, went, &way.bodies).is_some_and(|crossing| crossing.shows) {
                return (way, Some(hit));
            }
            let inside = Inside { medium: None, bodies: way.bodies };
            way = Way {
                ray: scene.leave(&surface, &hit, went),
                bodies: scene.beyond(object, &surface, went, inside).bodies,
            };
        }
        (way, None)
    }

    /// The first surface along a ray; `None` where nothing is, a lamp, or what is made of others.
    fn meet(&self, way: &Way, nm: f64) -> Option<Met<'_>> {
        let (Way { ray, bodies }, hit) = self.first(way);
        let hit = hit?;
        let object = &self.scene.objects[hit.object as usize];
        let material = &self.scene.materials[object.material as usize];
        if object.light.is_some() || matches!(material.kind, Kind::Compound(_)) {
            return None;
        }
        let surface = self.scene.surface(&ray, &hit);
        let crossing = self.scene.crossing(object, &surface, ray.direction, &bodies);
        let around = crossing.and_then(|crossing| crossing.around);
        let bsdf = material.bsdf_beside(&hit.texture_point(&surface), Lanes::splat(nm as f32), false, around);
        let sharp = matches!(
            bsdf,
            Bsdf::Mirror { .. } | Bsdf::Conductor(_) | Bsdf::Dielectric(_) | Bsdf::Thin { .. } | Bsdf::Plastic(_)
        );
        let here = crossing.map_or(bodies, |crossing| crossing.here);
        let frame = seen_frame(material, &surface, -ray.direction).0;
        sharp.then_some(Met { ray, here, object, hit, frame, surface, bsdf })
    }

    /// Where a ray goes on from what it has met, and with which share of its light.
    fn turn(&self, met: &Met, turn: Turn) -> Option<(Way, f64)> {
        let Met { ray, here, object, hit, surface, .. } = met;
        let wo = met.frame.to_local(-ray.direction);
        let (wi, share) = met.goes(wo, turn)?;
        let wi = met.frame.to_world(wi);
        let bodies = match turn {
            Turn::Mirrored => *here,
            Turn::Through => self.scene.beyond(object, surface, wi, Inside { medium: None, bodies: *here }).bodies,
        };
        Some((Way { ray: self.scene.leave(surface, hit, wi), bodies }, share))
    }
}

impl Met<'_> {
    /// Whether wavelengths part there: told for one, as what they might have is in how it was made.
    fn parts(&self) -> bool {
        matches!(&self.bsdf, Bsdf::Dielectric(Dielectric { eta: RelativeIndex::Dispersive(_), .. }))
    }

    /// The direction that `turn` takes, and the share of the light.
    fn goes(&self, wo: DVec3, turn: Turn) -> Option<(DVec3, f64)> {
        let mean = |lanes: Lanes| f64::from(lanes.reduce_add()) / LANES as f64;
        match (&self.bsdf, turn) {
            (Bsdf::Mirror { reflectance }, Turn::Mirrored) if wo.z > 0.0 => Some((mirror(wo), mean(*reflectance))),
            (Bsdf::Conductor(metal), Turn::Mirrored) if wo.z > 0.0 => Some((mirror(wo), mean(metal.reflectance(wo.z)))),
            (Bsdf::Plastic(_), Turn::Mirrored) => Some((mirror(wo), mean(self.bsdf.mirrored(wo)?))),
            (Bsdf::Dielectric(glass), Turn::Mirrored) => Some((mirror(wo), mean(glass.reflection(wo).weight))),
            (Bsdf::Dielectric(glass), Turn::Through) => {
                let (sample, share) = glass.go_through(wo)?;
                sample.transmitted.then_some((sample.wi, share))
            }
            (Bsdf::Thin { eta, thickness, .. }, turn) => {
                let through = Pane::new(wo.z.abs(), eta, *thickness).share;
                Some(if turn == Turn::Through { (-wo, through) } else { (mirror(wo), 1.0 - through) })
            }
            _ => None,
        }
    }
}

/// The squares of the ellipses of `pictures` in the pixels of `window`.
fn covered(pictures: &[Picture], lamps: &[Lamp], window: Window) -> Vec<Found> {
    let mut by_pixel: BTreeMap<[i32; 2], Vec<&Picture>> = BTreeMap::new();
    for picture in pictures {
        // Half of the box around an ellipse: lengths of the rows of the inverse of its slopes.
        let axes = picture.slopes.inverse();
        let half = DVec2::new(axes.row(0).length(), axes.row(1).length()) * MARGIN;
        let [low, high] =
            [picture.place - half, picture.place + half].map(|at| at.floor().to_array().map(|x| x as i32));
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                if window.index([x, y]).is_some() {
                    by_pixel.entry([x, y]).or_default().push(picture);
                }
            }
        }
    }
    let of = |(pixel, pictures): ([i32; 2], Vec<&Picture>)| {
        let region = region(pixel, &pictures);
        let expected = expected(pixel, &pictures, lamps, region.level);
        (!region.squares.is_empty()).then_some((pixel, region, expected))
    };
    by_pixel.into_iter().collect::<Vec<_>>().into_par_iter().filter_map(of).collect()
}

/// The squares of a pixel that ellipses cover, as small as the smallest of these needs, or fewer if they are too many.
fn region(pixel: [i32; 2], pictures: &[&Picture]) -> Region {
    let rarest = pictures.iter().map(|picture| picture.left.chance).fold(1.0, f64::min);
    let paths = (PATHS / rarest.sqrt()).round().clamp(1.0, MOST_PATHS) as u32;
    let smallest = pictures.iter().map(|picture| picture.half_axes()[1]).fold(f64::INFINITY, f64::min);
    let wanted = libm::log2(SQUARES / smallest).ceil().clamp(0.0, f64::from(MOST_LEVEL)) as u32;
    let mut level = wanted;
    loop {
        let all = pictures.iter().flat_map(|picture| squares(pixel, picture, level));
        let covered: Vec<[u32; 2]> = all.take(4 * MOST_SQUARES + 1).collect();
        let fits = covered.len() <= 4 * MOST_SQUARES;
        let region = Region::new(level, covered, paths);
        if level == 0 || fits && region.squares.len() <= MOST_SQUARES {
            return region;
        }
        level -= 1;
    }
}

/// What chance finds of the pictures in a pixel, whose areas in it are told by squares.
fn expected(pixel: [i32; 2], pictures: &[&Picture], lamps: &[Lamp], level: u32) -> Expected {
    let side = f64::from(1u32 << level).recip();
    pictures.iter().fold(Expected::default(), |sum, picture| {
        let count = squares(pixel, picture, level).count() as f64;
        let area = picture.part * count * (side / picture.reach(side)).powi(2);
        let luminance = lamps[picture.lamp].luminance * picture.left.light;
        let square = area * luminance * luminance / picture.left.chance;
        Expected { mean: sum.mean + area * luminance, square: sum.square + square }
    })
}

/// The squares of a pixel that a picture covers: those whose middles are in the ellipse and a margin that half a square has.
fn squares([x, y]: [i32; 2], picture: &Picture, level: u32) -> impl Iterator<Item = [u32; 2]> {
    let side = 1u32 << level;
    let size = 1.0 / f64::from(side);
    let DMat2 { x_axis: a, y_axis: b } = picture.slopes;
    let reach = picture.reach(size);
    let corner = DVec2::new(f64::from(x), f64::from(y)) - picture.place;
    let clamped = move |at: f64| at.clamp(0.0, f64::from(side)) as u32;
    // Half of its height: the length of a row of the inverse of its slopes.
    let half = picture.slopes.inverse().row(1).length() * reach;
    let [low, high] = [-half, half].map(|to| (to - corner.y) / size);
    let in_row = move |row: u32| {
        // |a dx + b dy|² ≤ reach² between two roots of dx; none where there are none.
        let dy = corner.y + (f64::from(row) + 0.5) * size;
        let (p, q, r) = (a.length_squared(), a.dot(b) * dy, b.length_squared() * dy * dy - reach * reach);
        let root = q * q - p * r;
        let [low, high] = [-1.0, 1.0].map(|sign| ((-q + sign * root.sqrt()) / p - corner.x) / size - 0.5);
        let columns = if root < 0.0 { 0..0 } else { clamped(low.ceil())..clamped(high.floor() + 1.0) };
        columns.map(move |column| [column, row])
    };
    (clamped(low.floor())..clamped(high.ceil())).flat_map(in_row)
}
