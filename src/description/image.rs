//! The picture that a camera takes, as it is written: its size, filter and bands.

use serde::Deserialize;

use super::decode::whole;
use super::fault::Checker;
use super::path::At;
use super::spectrum::{Role, Spectrum, one, yes};

/// `image: {width: 600, height: 600}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// Pixels, 1 to 65536; default 600.
    #[serde(default = "side", deserialize_with = "whole::<_, 1, MAX_SIDE>")]
    pub width: u32,
    /// Pixels, 1 to 65536; default 600.
    #[serde(default = "side", deserialize_with = "whole::<_, 1, MAX_SIDE>")]
    pub height: u32,
    /// Reconstruction filter; default `box`.
    #[serde(default)]
    pub filter: Filter,
    /// The part that is rendered; default all.
    pub crop: Option<Crop>,
    /// Pixels that are rendered beyond each edge of the frame, for what moves the picture later; 0 to 16384, default 0.
    #[serde(default, deserialize_with = "whole::<_, 0, MOST_OVERSCAN>")]
    pub overscan: u32,
    /// Whether pixels at the edges take light from beyond them, as far as the filter reaches; if not, it is cut there. Default
    /// true.
    #[serde(default = "yes")]
    pub sample_border: bool,
    /// Factor on colours, of the picture and of its layers of light, not on bands; default 1.
    #[serde(default = "one")]
    pub sensitivity: f64,
    /// Spectral bands that the OpenEXR file holds instead of colour; default none.
    #[serde(default)]
    pub bands: Vec<Band>,
}

/// `{name: s00_380_405, response: {table: [[380, 1], [405, 1]]}}`: a channel of the picture, ∫ radiance · response dλ,
/// whatever the sensitivity.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Band {
    /// Of the channel.
    pub name: String,
    /// How much each wavelength counts; a table is 0 beyond its ends.
    pub response: Spectrum,
}

fn side() -> u32 {
    600
}

impl Default for Image {
    fn default() -> Image {
        Image {
            width: side(),
            height: side(),
            filter: Filter::default(),
            crop: None,
            overscan: 0,
            sample_border: true,
            sensitivity: 1.0,
            bands: Vec::new(),
        }
    }
}

/// How samples become pixels. Lengths are in pixels, above 0 and at most 256.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Filter {
    /// The mean over the pixel.
    #[default]
    Box,
    /// Falls linearly to 0.
    Tent {
        /// Default 1.
        #[serde(default = "tent_radius")]
        radius: f64,
    },
    /// A bell.
    Gaussian {
        /// Default 0.5.
        #[serde(default = "gaussian_stddev")]
        stddev: f64,
    },
    /// Mitchell and Netravali's cubic.
    Mitchell {
        /// Default 1/3.
        #[serde(default = "third")]
        b: f64,
        /// Default 1/3.
        #[serde(default = "third")]
        c: f64,
    },
    /// The cubic that passes through its samples.
    CatmullRom,
    /// The sinc, windowed by its own main lobe.
    Lanczos {
        /// Default 3.
        #[serde(default = "lanczos_radius")]
        radius: f64,
    },
}

fn tent_radius() -> f64 {
    1.0
}

fn gaussian_stddev() -> f64 {
    0.5
}

fn third() -> f64 {
    1.0 / 3.0
}

fn lanczos_radius() -> f64 {
    3.0
}

/// A part of the picture, pixels from its upper left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crop {
    /// First column; default 0.
    #[serde(default, deserialize_with = "whole::<_, 0, LAST_PIXEL>")]
    pub x: u32,
    /// First row; default 0.
    #[serde(default, deserialize_with = "whole::<_, 0, LAST_PIXEL>")]
    pub y: u32,
    /// Columns.
    #[serde(deserialize_with = "whole::<_, 1, MAX_SIDE>")]
    pub width: u32,
    /// Rows.
    #[serde(deserialize_with = "whole::<_, 1, MAX_SIDE>")]
    pub height: u32,
}

/// The longest side of a picture, pixels.
pub const MAX_SIDE: u32 = 65536;

/// The last column or row that a picture can have.
const LAST_PIXEL: u32 = MAX_SIDE - 1;

/// The most pixels beyond an edge.
const MOST_OVERSCAN: u32 = MAX_SIDE / 4;

/// Mitchell and Netravali look at b and c from 0 to 1, and at 3/2 and -1/4; far beyond, lobes cancel each other.
const MOST_MITCHELL: f64 = 2.0;

/// The widest filter, pixels: light from the lamps themselves is dealt to all pixels within it.
const WIDEST: f64 = 256.0;

fn check_width(at: At<'_>, width: f64, checker: &mut Checker<'_>) {
    let expected = format!("a number above 0 and at most {WIDEST}");
    checker.require(width > 0.0 && width <= WIDEST, at, &expected, width);
}

impl Image {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        checker.whole_between(at.key("width"), self.width, 1, MAX_SIDE);
        checker.whole_between(at.key("height"), self.height, 1, MAX_SIDE);
        // What a 32-bit float of a file holds in full.
        let (least, most) = (f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX));
        let expected = format!("a number from {least:.3e} to {most:.3e}");
        let found = format_args!("{:e}", self.sensitivity);
        checker.require((least..=most).contains(&self.sensitivity), at.key("sensitivity"), &expected, found);
        let filter = at.key("filter");
        match self.filter {
            Filter::Box | Filter::CatmullRom => {}
            Filter::Mitchell { b, c } => {
                for (key, number) in [("b", b), ("c", c)] {
                    let holds = number.abs() <= MOST_MITCHELL;
                    checker.require(holds, filter.key("mitchell").key(key), "a number from -2 to 2", number);
                }
            }
            Filter::Tent { radius } => check_width(filter.key("tent").key("radius"), radius, checker),
            Filter::Gaussian { stddev } => check_width(filter.key("gaussian").key("stddev"), stddev, checker),
            Filter::Lanczos { radius } => check_width(filter.key("lanczos").key("radius"), radius, checker),
        }
        for (i, band) in self.bands.iter().enumerate() {
            let bands = at.key("bands");
            let at = bands.index(i);
            check_channel(&band.name, self.bands[..i].iter().any(|b| b.name == band.name), at.key("name"), checker);
            band.response.check(Role::Emission, at.key("response"), checker);
        }
        checker.whole_between(at.key("overscan"), self.overscan, 0, MOST_OVERSCAN);
        if let Some(crop) = self.crop {
            checker.require(self.overscan == 0, at.key("overscan"), "no overscan beside a crop", self.overscan);
            let at = at.key("crop");
            let fits = |start: u32, length: u32, whole: u32| u64::from(start) + u64::from(length) <= u64::from(whole);
            checker.at_least_one(at.key("width"), crop.width);
            checker.at_least_one(at.key("height"), crop.height);
            let Crop { x, y, width, height } = crop;
            let inside = fits(x, width, self.width) && fits(y, height, self.height);
            checker.require(
                inside,
                at,
                &format!("a part of the {} × {} image", self.width, self.height),
                format_args!("{width} × {height} from ({x}, {y})"),
            );
        }
    }
}

/// The name of a channel: not empty, short enough for the file, and not taken.
pub(crate) fn check_channel(name: &str, taken: bool, at: At<'_>, checker: &mut Checker<'_>) {
    let fits = !name.is_empty() && name.len() <= MAX_CHANNEL_NAME && !name.contains('\0');
    checker.require(fits, at, "the name of a channel, 1 to 200 bytes", format_args!("{name:?}"));
    checker.require(!taken, at, "a name of its own", format_args!("{name:?} again"));
}

/// OpenEXR takes 255 bytes; a layer appends the name of its component.
const MAX_CHANNEL_NAME: usize = 200;

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    #[test]
    fn what_lies_beyond_the_frame_is_bounded_and_beside_no_crop() {
        assert_eq!(
            faults("image: {overscan: 16385}"),
            "dir/s.yaml:2:19: image.overscan: expected a whole number from 0 to 16384, found 16385"
        );
        assert_eq!(
            faults("image: {overscan: 4, crop: {width: 10, height: 10}}"),
            "dir/s.yaml:2:19: image.overscan: expected no overscan beside a crop, found 4"
        );
    }

    #[test]
    fn an_image_has_pixels_and_the_crop_lies_in_it() {
        assert_eq!(
            faults("image: {width: 0, height: 65537}"),
            "dir/s.yaml:2:16: image.width: expected a whole number from 1 to 65536, found 0\n\
             dir/s.yaml:2:27: image.height: expected a whole number from 1 to 65536, found 65537"
        );
        assert_eq!(
            faults("image: {width: 20, height: 10, crop: {x: 11, y: 0, width: 10, height: 10}}"),
            "dir/s.yaml:2:38: image.crop: expected a part of the 20 × 10 image, found 10 × 10 from (11, 0)"
        );
        // The end is computed without overflow.
        assert_eq!(
            faults("image: {crop: {x: 4294967295, width: 4294967295, height: 1}}"),
            "dir/s.yaml:2:15: image.crop: expected a part of the 600 × 600 image, \
             found 4294967295 × 1 from (4294967295, 0)"
        );
        assert_eq!(
            scene("image: {width: 20, height: 10, crop: {x: 10, width: 10, height: 10}}").image.crop,
            Some(Crop { x: 10, y: 0, width: 10, height: 10 })
        );
    }

    #[test]
    fn a_sensitivity_is_what_a_file_can_hold() {
        for (sensitivity, found) in [("1e40", "1e40"), ("1e-300", "1e-300"), ("0", "0e0")] {
            let expected = "image.sensitivity: expected a number from 1.175e-38 to 3.403e38, found";
            let told = faults(&format!("image: {{sensitivity: {sensitivity}}}"));
            assert!(told.ends_with(&format!("{expected} {found}")), "{told}");
        }
    }

    #[test]
    fn a_cubic_has_lobes_that_leave_something() {
        assert_eq!(
            faults("image: {filter: {mitchell: {b: 30, c: -2.5}}}"),
            "dir/s.yaml:2:32: image.filter.mitchell.b: expected a number from -2 to 2, found 30\n\
             dir/s.yaml:2:39: image.filter.mitchell.c: expected a number from -2 to 2, found -2.5"
        );
        assert_eq!(faults("image: {filter: {mitchell: {b: 1.5, c: -0.25}}}"), "none");
    }

    #[test]
    fn filters_have_a_width() {
        for (kind, field) in [("tent", "radius"), ("gaussian", "stddev"), ("lanczos", "radius")] {
            let column = 21 + kind.len() + field.len() + 2;
            for width in ["0", "256.5", "1e20"] {
                let expected = "expected a number above 0 and at most 256";
                assert_eq!(
                    faults(&format!("image: {{filter: {{{kind}: {{{field}: {width}}}}}}}")),
                    format!("dir/s.yaml:2:{column}: image.filter.{kind}.{field}: {expected}, found {width}")
                );
            }
            assert_eq!(faults(&format!("image: {{filter: {{{kind}: {{{field}: 256}}}}}}")), "none");
        }
    }
}
