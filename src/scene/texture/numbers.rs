//! Numbers that vary over a surface: roughness, weights, heights, normals.

use super::{Grid, Interpolation, TexturePoint, same_cell};
use crate::error::in_short;
use crate::scene::mesh::attribute::AttributeTexture;
use crate::scene::volume::Volume;
use crate::spectrum::luminance::REC709_OF_MITSUBA;
use glam::{DAffine2, DVec2, DVec3, Vec3};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// A number at every point of a surface, or three: data such as roughness, weight, height, normal.
#[derive(Clone, Debug)]
pub enum Scalar {
    /// The same everywhere.
    Uniform(f64),
    /// A picture of numbers.
    Image(DataImage),
    /// As in [`super::Texture`].
    Checkerboard {
        /// Where the cells' parities agree.
        a: Box<Scalar>,
        /// Where they differ.
        b: Box<Scalar>,
        /// From u, v to periods.
        uv: DAffine2,
    },
    /// What fills space, where the surface cuts it.
    Volume(Volume),
    /// Numbers of the mesh itself.
    Attribute(Box<AttributeTexture>),
}

/// Three numbers a texel, row by row; all three are the same in a picture of one channel.
#[derive(Clone, Debug)]
pub enum Numbers {
    /// As they are.
    Floats(Arc<Vec<[f32; 3]>>),
    /// Bytes, and what each stands for.
    Bytes {
        /// Three a texel.
        bytes: Arc<Vec<u8>>,
        /// By byte.
        level: Box<[f32; 256]>,
    },
}

impl Numbers {
    /// The numbers of the texel at `index`.
    #[must_use]
    #[inline]
    pub fn at(&self, index: usize) -> [f32; 3] {
        match self {
            Numbers::Floats(texels) => texels[index],
            Numbers::Bytes { bytes, level } => {
                let texel = &bytes[3 * index..3 * index + 3];
                [0, 1, 2].map(|k| level[usize::from(texel[k])])
            }
        }
    }
}

/// A picture whose texels are numbers.
#[derive(Clone, Debug)]
pub struct DataImage {
    /// What they are.
    pub texels: Numbers,
    /// Where they lie.
    pub grid: Grid,
    /// Whether they were decoded from sRGB, as colours are.
    pub decoded: bool,
}

impl Scalar {
    /// The number at a point; of three their mean by luminance (Rec. 709).
    #[must_use]
    #[inline]
    pub fn eval(&self, at: &TexturePoint) -> f64 {
        match self {
            Scalar::Uniform(x) => *x,
            // Most boards are of two numbers.
            Scalar::Checkerboard { a, b, uv } => match &**(if same_cell(uv, at) { a } else { b }) {
                Scalar::Uniform(x) => *x,
                varying => varying.eval_varying(at),
            },
            _ => self.eval_varying(at),
        }
    }

    #[inline(never)]
    fn eval_varying(&self, at: &TexturePoint) -> f64 {
        match self {
            Scalar::Uniform(x) => *x,
            Scalar::Image(image) => f64::from(image.grid.value(at.uv, |i| luminance(image.texels.at(i)))),
            Scalar::Checkerboard { a, b, uv } => (if same_cell(uv, at) { a } else { b }).eval(at),
            Scalar::Volume(volume) => volume.scalar(at.point),
            Scalar::Attribute(attribute) => f64::from(luminance(attribute.triple(at).as_vec3().to_array())),
        }
    }

    /// The three numbers at a point.
    #[must_use]
    pub fn triple(&self, at: &TexturePoint) -> DVec3 {
        match self {
            Scalar::Uniform(x) => DVec3::splat(*x),
            Scalar::Image(image) => image.grid.value(at.uv, |i| Vec3::from(image.texels.at(i))).as_dvec3(),
            Scalar::Checkerboard { a, b, uv } => (if same_cell(uv, at) { a } else { b }).triple(at),
            Scalar::Volume(volume) => volume.triple(at.point),
            Scalar::Attribute(attribute) => attribute.triple(at),
        }
    }

    /// Its derivatives by u and v at a point; zero across the steps between cells and texels.
    #[must_use]
    pub fn gradient(&self, at: &TexturePoint) -> DVec2 {
        match self {
            // A volume knows nothing of u and v.
            Scalar::Uniform(_) | Scalar::Volume(_) | Scalar::Attribute(_) => DVec2::ZERO,
            Scalar::Image(DataImage { grid, .. }) if grid.interpolation == Interpolation::Nearest => DVec2::ZERO,
            Scalar::Image(image) => {
                let grid = &image.grid;
                let (corner, w) = grid.corner(at.uv);
                let [h00, h10, h01, h11] = grid.four(corner).map(|i| f64::from(luminance(image.texels.at(i))));
                // Of the bilinear form, by columns and by rows; rows count downward.
                let by_x = (h10 - h00) * (1.0 - w.y) + (h11 - h01) * w.y;
                let by_y = (h01 - h00) * (1.0 - w.x) + (h11 - h10) * w.x;
                let picture = DVec2::new(by_x * grid.width as f64, -by_y * grid.height as f64);
                grid.uv.matrix2.transpose() * picture
            }
            Scalar::Checkerboard { a, b, uv } => (if same_cell(uv, at) { a } else { b }).gradient(at),
        }
    }

    /// Whether its derivatives are anywhere more than zero.
    #[must_use]
    pub fn has_slopes(&self) -> bool {
        match self {
            Scalar::Uniform(_) | Scalar::Volume(_) | Scalar::Attribute(_) => false,
            Scalar::Image(image) => image.grid.interpolation != Interpolation::Nearest,
            Scalar::Checkerboard { a, b, .. } => a.has_slopes() || b.has_slopes(),
        }
    }

    /// Whether any of its numbers were decoded from sRGB.
    #[must_use]
    pub fn is_decoded(&self) -> bool {
        match self {
            Scalar::Uniform(_) | Scalar::Volume(_) | Scalar::Attribute(_) => false,
            Scalar::Image(image) => image.decoded,
            Scalar::Checkerboard { a, b, .. } => a.is_decoded() || b.is_decoded(),
        }
    }

    /// In words, the first number outside `bounds` that it has, and of a picture the texel; `None` where all are within.
    #[must_use]
    pub fn outside(&self, bounds: &RangeInclusive<f64>) -> Option<String> {
        match self {
            Scalar::Uniform(x) => (!bounds.contains(x)).then(|| in_short(*x)),
            Scalar::Image(DataImage { texels, grid, .. }) => {
                // Of most pictures of bytes no texel has to be looked at.
                if let Numbers::Bytes { level, .. } = texels
                    && level.iter().all(|x| bounds.contains(&f64::from(*x)))
                {
                    return None;
                }
                (0..grid.width * grid.height).find_map(|i| {
                    let found = outside(texels.at(i), 1.0, bounds)?;
                    Some(format!("{} at ({}, {})", in_short(found), i % grid.width, i / grid.width))
                })
            }
            Scalar::Checkerboard { a, b, .. } => a.outside(bounds).or_else(|| b.outside(bounds)),
            Scalar::Volume(volume) => volume.outside(bounds).map(in_short),
            Scalar::Attribute(attribute) => attribute.outside(bounds).map(in_short),
        }
    }

    /// True for anything but one number.
    #[must_use]
    pub fn varies(&self) -> bool {
        !matches!(self, Scalar::Uniform(_))
    }
}

/// Three numbers as one, times `scale`, if that is outside `bounds`. The mean of numbers within is within, but for its rounding.
pub(in crate::scene) fn outside(rgb: [f32; 3], scale: f64, bounds: &RangeInclusive<f64>) -> Option<f64> {
    // Rounded, so that 3 by a third is 1.
    let scaled = |x: f32| f64::from((f64::from(x) * scale) as f32);
    let within = |x: f64| bounds.contains(&x);
    if rgb.into_iter().all(|x| within(scaled(x))) {
        return None;
    }
    Some(scaled(luminance(rgb))).filter(|x| !within(*x))
}

/// Three numbers as one: their mean by luminance.
pub(in crate::scene) fn luminance(rgb: [f32; 3]) -> f32 {
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
        return rgb[0];
    }
    let [r, g, b] = REC709_OF_MITSUBA.map(|weight| weight as f32);
    r * rgb[0] + g * rgb[1] + b * rgb[2]
}
