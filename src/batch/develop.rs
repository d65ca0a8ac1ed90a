//! From the colours of a file to its PNG: what was written, and what the picture and its lights say where that is asked for.

use crate::description::{Exposure, Png, PngDither, PngSpace, Tonemap, WhiteBalance};
use crate::film::png::{self, PngSettings, meter};
use crate::film::resolve::Image;
use crate::scene::Scene;
use crate::scene::light;
use crate::spectrum::ColourSpace;
use crate::spectrum::colour::{adapted_to_d65, multiply};

/// What a PNG says of the program that developed it.
#[must_use]
pub fn software() -> (String, String) {
    ("Software".to_owned(), concat!("Abbe ", env!("CARGO_PKG_VERSION")).to_owned())
}

/// The chromaticity that is shown white, and what a person should know where there is none.
#[must_use]
pub fn white(png: &Png, scene: &Scene) -> (Option<[f64; 2]>, Option<String>) {
    let found = match &png.white_balance {
        WhiteBalance::None => return (None, None),
        WhiteBalance::Auto => match light::chromaticity(&scene.lights, &scene.objects, scene.radius) {
            Some(white) => Ok(white),
            None => Err("no light shines".to_owned()),
        },
        // The description has been checked: there is such a light.
        written => written.chromaticity().map(|white| white.unwrap_or([0.3127, 0.3290])),
    };
    let found = found.and_then(|white| match adapted_to_d65(white) {
        Some(_) => Ok(white),
        None => Err(format!("light of x {:.4}, y {:.4} is too pure to be made white", white[0], white[1])),
    });
    match found {
        Ok(white) => (Some(white), None),
        Err(why) => (None, Some(format!("output.png.white_balance: {why}; the PNG is not balanced"))),
    }
}

/// How the PNG of `image` is developed, whose colours are those of `space`.
#[must_use]
pub fn settings(png: &Png, white: Option<[f64; 2]>, image: &Image, space: ColourSpace) -> PngSettings {
    let display = match png.space {
        PngSpace::Srgb => png::Space::Srgb,
        PngSpace::DisplayP3 => png::Space::DisplayP3,
    };
    let xyz_from_rgb = match white.and_then(adapted_to_d65) {
        Some(adapted) => multiply(adapted, space.matrix_to_xyz()),
        None => space.matrix_to_xyz(),
    };
    let same = white.is_none() && space == display.primaries();
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let display_from_rgb = if same { identity } else { multiply(display.primaries().matrix_from_xyz(), xyz_from_rgb) };
    let (tonemap, name) = match png.tonemap {
        Tonemap::Aces => (png::Tonemap::Aces, "aces"),
        Tonemap::Agx => (png::Tonemap::Agx, "agx"),
        Tonemap::Reinhard => (png::Tonemap::Reinhard, "reinhard"),
        Tonemap::None => (png::Tonemap::None, "none"),
    };
    let exposure_stops = match png.exposure {
        Exposure::Number(stops) => stops,
        Exposure::Auto => {
            let luminance = display.luminance();
            let row = |c: usize| (0..3).map(|k| luminance[k] * display_from_rgb[k][c]).sum();
            meter::stops(image, [row(0), row(1), row(2)], tonemap)
        }
    };
    let metered = if png.exposure == Exposure::Auto { ", metered" } else { "" };
    let mut texts = vec![
        software(),
        ("abbe/exposure".to_owned(), format!("{exposure_stops} stops{metered}")),
        ("abbe/tonemap".to_owned(), name.to_owned()),
    ];
    if let Some([x, y]) = white {
        texts.push(("abbe/white".to_owned(), format!("x {x:.4}, y {y:.4}")));
    }
    PngSettings {
        exposure_stops,
        tonemap,
        dither: match png.dither {
            PngDither::None => png::Dither::None,
            PngDither::Ordered => png::Dither::Ordered,
            PngDither::Hash => png::Dither::Hash,
        },
        space: display,
        bits: if png.bits == 16 { png::Bits::Sixteen } else { png::Bits::Eight },
        display_from_rgb,
        texts,
    }
}
