//! What the error of a picture is told of: colours or bands, pixel by pixel.

use super::super::accumulate::{Film, REPLICATES};
use super::super::resolve::{Image, Splats, layer, replicate_light, replicates_of_layer};
use super::{floor, floor_of};

/// Of what the error of a picture is told.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// Of its colours: the matrix that makes them of XYZ, and the picture in them. One f is of them all.
    Colours(&'a [[f64; 3]; 3], &'a Image),
    /// Of bands of the spectrum, layers from this one on and so many, summed by replicate. Each has an f of its own, as they have
    /// nothing to do with each other's units; one without any light is left out.
    Bands(usize, usize),
}

/// A value of a pixel.
#[derive(Clone, Copy)]
pub(super) struct Value {
    /// What the picture shows.
    pub(super) mean: f64,
    /// And by each replicate.
    pub(super) replicates: [f64; REPLICATES],
    /// What was splatted of that, where it matters.
    pub(super) splatted: Option<[f64; REPLICATES]>,
}

/// What is measured of a picture.
pub(super) struct Measured<'a> {
    pub(super) film: &'a Film,
    splats: Option<Splats<'a>>,
    values: Values<'a>,
    /// The means of the bands, pixel by pixel.
    bands: Vec<Vec<f32>>,
    /// f of each value.
    pub(super) floors: Vec<f64>,
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
        Measured { film, splats, values, bands, floors, apart }
    }

    /// Puts the values of a pixel into `into`; false if a replicate has no sample.
    pub(super) fn read(&self, index: usize, into: &mut Vec<Value>) -> bool {
        into.clear();
        let splats = self.splats.as_ref();
        match self.values {
            Values::Colours(rgb_from_xyz, image) => {
                let Some(light) = replicate_light(self.film, splats, index, rgb_from_xyz) else { return false };
                let splatted = splats.filter(|_| self.apart).and_then(|splats| splats.replicates(index, rgb_from_xyz));
                into.extend((0..3).map(|c| Value {
                    mean: f64::from(image.rgb[c][index]),
                    replicates: light.map(|light| light[c]),
                    splatted: splatted.map(|light| light.map(|light| light[c])),
                }));
            }
            Values::Bands(first, _) => {
                for (band, plane) in (first..).zip(&self.bands) {
                    let Some(replicates) = replicates_of_layer(self.film, splats, index, band) else { return false };
                    let splatted = splats.filter(|_| self.apart).and_then(|s| s.replicates_of_layer(index, band));
                    into.push(Value { mean: f64::from(plane[index]), replicates, splatted });
                }
            }
        }
        true
    }
}
