//! What the error of a picture is told of: colours or bands, pixel by pixel.

use super::super::accumulate::{Film, REPLICATES};
use super::super::resolve::{Image, Splats, layer, replicate_light, replicates_of_layer};
use super::{floor, floor_of};
use wide::f64x4;

/// Of what the error of a picture is told.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// Of its colours: the matrix that makes them of XYZ, and the picture in them. One f is of them all.
    Colours(&'a [[f64; 3]; 3], &'a Image),
    /// Of bands of the spectrum, layers from this one on and so many, summed by replicate. Each has an f of its own, as they have
    /// nothing to do with each other's units; one without any light is left out.
    Bands(usize, usize),
}

/// Four values of a pixel, side by side. Where there are fewer the others are zero.
#[derive(Clone, Copy)]
pub(super) struct Four {
    /// What the picture shows.
    pub(super) means: f64x4,
    /// And by each replicate.
    pub(super) replicates: [f64x4; REPLICATES],
    /// What was splatted of that, where it matters.
    pub(super) splatted: Option<[f64x4; REPLICATES]>,
}

/// What is measured of a picture.
pub(super) struct Measured<'a> {
    pub(super) film: &'a Film,
    splats: Option<Splats<'a>>,
    values: Values<'a>,
    /// The means of the bands, pixel by pixel.
    bands: Vec<Vec<f32>>,
    /// f of each value.
    pub(super) floors: Vec<f64x4>,
    /// How many values are told of.
    pub(super) counted: usize,
    /// Whether it matters what was splatted.
    apart: bool,
}

impl<'a> Measured<'a> {
    pub(super) fn new(film: &'a Film, splats: Option<Splats<'a>>, values: Values<'a>, apart: bool) -> Measured<'a> {
        let (bands, floors) = match values {
            Values::Colours(_, image) => (Vec::new(), vec![floor(image); 3]),
            Values::Bands(first, count) => {
                let bands: Vec<Vec<f32>> =
                    (first..first + count).map(|band| layer(film, splats.as_ref(), band)).collect();
                let floors = bands.iter().map(|plane| floor_of(plane.iter().copied(), plane.len())).collect();
                (bands, floors)
            }
        };
        let counted = floors.iter().filter(|f| **f > 0.0).count();
        let floors = floors.chunks(4).map(|some| four(|i| some.get(i).copied())).collect();
        Measured { film, splats, values, bands, floors, counted, apart }
    }

    /// Puts the values of a pixel into `into`; false if a replicate has no sample.
    pub(super) fn read(&self, index: usize, into: &mut Vec<Four>) -> bool {
        into.clear();
        let splats = self.splats.as_ref();
        match self.values {
            Values::Colours(rgb_from_xyz, image) => {
                let Some(light) = replicate_light(self.film, splats, index, rgb_from_xyz) else { return false };
                let splatted = splats.filter(|_| self.apart).and_then(|splats| splats.replicates(index, rgb_from_xyz));
                let colour = |[r, g, b]: [f64; 3]| f64x4::new([r, g, b, 0.0]);
                into.push(Four {
                    means: colour([0, 1, 2].map(|c| f64::from(image.rgb[c][index]))),
                    replicates: light.map(colour),
                    splatted: splatted.map(|light| light.map(colour)),
                });
            }
            Values::Bands(first, _) => {
                for (some, planes) in (first..).step_by(4).zip(self.bands.chunks(4)) {
                    let mut light = [[0.0; REPLICATES]; 4];
                    let mut own = None;
                    for (i, light) in light.iter_mut().enumerate().take(planes.len()) {
                        let Some(replicates) = replicates_of_layer(self.film, splats, index, some + i) else {
                            return false;
                        };
                        *light = replicates;
                        if let Some(splats) = splats.filter(|_| self.apart)
                            && let Some(replicates) = splats.replicates_of_layer(index, some + i)
                        {
                            own.get_or_insert([[0.0; REPLICATES]; 4])[i] = replicates;
                        }
                    }
                    into.push(Four {
                        means: four(|i| planes.get(i).map(|plane| f64::from(plane[index]))),
                        replicates: by_replicate(light),
                        splatted: own.map(by_replicate),
                    });
                }
            }
        }
        true
    }
}

/// What `of` gives for four values, zero where there is none.
fn four(of: impl Fn(usize) -> Option<f64>) -> f64x4 {
    f64x4::new(std::array::from_fn(|i| of(i).unwrap_or(0.0)))
}

/// What each replicate has of four values.
fn by_replicate(values: [[f64; REPLICATES]; 4]) -> [f64x4; REPLICATES] {
    f64x4::transpose(values.map(f64x4::new))
}
