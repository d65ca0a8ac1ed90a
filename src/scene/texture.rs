//! Spectra that vary over a surface.

use crate::spectrum::{Lanes, Spectrum, upsample};
use glam::DVec2;
use std::sync::Arc;

/// A spectrum at every point of a surface.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Uniform(Spectrum),
    /// A picture.
    Image(ImageTexture),
    /// Two textures in turn: one period of u and of v holds 2 × 2 cells.
    Checkerboard {
        /// Where the cells' parities agree.
        a: Box<Texture>,
        /// Where they differ.
        b: Box<Texture>,
        /// Periods per unit of u and v.
        scale: DVec2,
    },
}

/// What lies beyond the edge of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The picture mirrored.
    Mirror,
    /// Its edge texels.
    Clamp,
}

/// What lies between texel centres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The mean of four spectra by distance.
    #[default]
    Bilinear,
    /// The nearest texel.
    Nearest,
}

/// One texel, upsampled: a sigmoid spectrum times a factor.
#[derive(Clone, Copy, Debug)]
pub struct Texel {
    /// Coefficients of the sigmoid (`spectrum::upsample`).
    pub coefficients: [f32; 3],
    /// Factor: one for reflectances.
    pub scale: f32,
}

/// A picture whose texels are spectra. v = 0 is the bottom row's edge, v = 1 the top's.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    /// Row 0 is the top, as in the file.
    pub texels: Arc<Vec<Texel>>,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Beyond the edge, in u and in v.
    pub wrap: [Wrap; 2],
    /// Between texels.
    pub interpolation: Interpolation,
    /// Factor on u, v.
    pub scale: DVec2,
    /// Added to u, v after the factor.
    pub offset: DVec2,
    /// A spectrum that multiplies every texel: one for reflectances, D65 for light.
    pub illuminant: Option<Spectrum>,
}

/// Index of the texel at `i` of `n` under `wrap`.
fn wrapped(i: f64, n: usize, wrap: Wrap) -> usize {
    let n_f = n as f64;
    let folded = match wrap {
        Wrap::Clamp => i.clamp(0.0, n_f - 1.0),
        Wrap::Repeat => i - (i / n_f).floor() * n_f,
        Wrap::Mirror => {
            let r = i - (i / (2.0 * n_f)).floor() * (2.0 * n_f);
            if r < n_f { r } else { 2.0 * n_f - 1.0 - r }
        }
    };
    // A rounded quotient may leave `folded` at n; a huge or invalid `i` anywhere: the cast saturates.
    (folded as usize).min(n - 1)
}

impl ImageTexture {
    fn texel(&self, x: f64, y: f64, nm: Lanes) -> Lanes {
        let texel =
            &self.texels[wrapped(y, self.height, self.wrap[1]) * self.width + wrapped(x, self.width, self.wrap[0])];
        upsample::eval_sigmoid(texel.coefficients, nm) * texel.scale
    }

    /// The spectrum at `uv`.
    #[must_use]
    pub fn eval(&self, uv: DVec2, nm: Lanes) -> Lanes {
        let uv = uv * self.scale + self.offset;
        let (x, up) = (uv.x * self.width as f64, uv.y * self.height as f64);
        let value = match self.interpolation {
            // Rows are counted from the bottom, so that v = 0 is in the last one, not in the first again.
            Interpolation::Nearest => self.texel(x.floor(), self.height as f64 - 1.0 - up.floor(), nm),
            Interpolation::Bilinear => {
                // Texel centres lie at half-integers. Spectra are mixed, not coefficients.
                let (x, y) = (x - 0.5, self.height as f64 - up - 0.5);
                let (x0, y0) = (x.floor(), y.floor());
                let (wx, wy) = ((x - x0) as f32, (y - y0) as f32);
                let row = |y: f64| self.texel(x0, y, nm) * (1.0 - wx) + self.texel(x0 + 1.0, y, nm) * wx;
                row(y0) * (1.0 - wy) + row(y0 + 1.0) * wy
            }
        };
        match &self.illuminant {
            Some(spectrum) => value * spectrum.eval(nm),
            None => value,
        }
    }
}

impl Texture {
    /// A texture that is one everywhere.
    #[must_use]
    pub fn one() -> Texture {
        Texture::Uniform(Spectrum::Constant(1.0))
    }

    /// The spectrum at `uv`.
    #[must_use]
    pub fn eval(&self, uv: DVec2, nm: Lanes) -> Lanes {
        match self {
            Texture::Uniform(spectrum) => spectrum.eval(nm),
            Texture::Image(image) => image.eval(uv, nm),
            Texture::Checkerboard { a, b, scale } => {
                let cell = |x: f64| x - x.floor() >= 0.5;
                let same = cell(uv.x * scale.x) == cell(uv.y * scale.y);
                (if same { a } else { b }).eval(uv, nm)
            }
        }
    }

    /// True for anything but one spectrum.
    #[must_use]
    pub fn varies(&self) -> bool {
        !matches!(self, Texture::Uniform(_))
    }

    /// Spectra that stand for the texture where one is needed (choice of wavelengths, of lights):
    /// each spectrum of a checkerboard, and some 16 texels of a picture.
    #[must_use]
    pub fn representatives(&self) -> Vec<Spectrum> {
        match self {
            Texture::Uniform(spectrum) => vec![spectrum.clone()],
            Texture::Image(image) => {
                let step = (image.texels.len() / 16).max(1);
                let texels = image.texels.iter().step_by(step);
                texels
                    .map(|t| {
                        let s = Spectrum::Sigmoid { c: t.coefficients, scale: t.scale };
                        image.illuminant.as_ref().map_or(s.clone(), |i| s.times(i))
                    })
                    .collect()
            }
            Texture::Checkerboard { a, b, .. } => {
                let mut all = a.representatives();
                all.extend(b.representatives());
                all
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey texels (coefficients c₂ alone) of values 0.2 and 0.8 in a 2 × 2 board.
    fn board(wrap: Wrap, interpolation: Interpolation) -> ImageTexture {
        let grey = |v: f64| upsample::coefficients([v as f32; 3]);
        let texel = |v: f64| Texel { coefficients: grey(v), scale: 1.0 };
        ImageTexture {
            texels: Arc::new(vec![texel(0.2), texel(0.8), texel(0.8), texel(0.2)]),
            width: 2,
            height: 2,
            wrap: [wrap; 2],
            interpolation,
            scale: DVec2::ONE,
            offset: DVec2::ZERO,
            illuminant: None,
        }
    }

    fn at(image: &ImageTexture, u: f64, v: f64) -> f64 {
        f64::from(image.eval(DVec2::new(u, v), Lanes::splat(550.0)).to_array()[0])
    }

    /// The table behind `coefficients` is good to 1e-3 on greys.
    const TABLE: f64 = 1e-3;

    #[test]
    fn the_top_row_of_the_file_is_at_the_top() {
        let image = board(Wrap::Clamp, Interpolation::Nearest);
        assert!((at(&image, 0.25, 0.75) - 0.2).abs() < TABLE);
        assert!((at(&image, 0.75, 0.75) - 0.8).abs() < TABLE);
        assert!((at(&image, 0.25, 0.25) - 0.8).abs() < TABLE);
    }

    /// Centres give the texels, the middle of the board their mean, edges follow the wrap.
    #[test]
    fn bilinear_look_ups_are_the_closed_form_at_centres_edges_and_beyond() {
        for (wrap, edge) in [(Wrap::Clamp, 0.2), (Wrap::Mirror, 0.2), (Wrap::Repeat, 0.5)] {
            let image = board(wrap, Interpolation::Bilinear);
            assert!((at(&image, 0.25, 0.75) - 0.2).abs() < TABLE);
            assert!((at(&image, 0.5, 0.5) - 0.5).abs() < TABLE);
            // Halfway across the left edge of the top row.
            assert!((at(&image, -1e-9, 0.75) - edge).abs() < TABLE, "{wrap:?}");
            assert!((at(&image, 1.0 + 1e-9, 0.25) - edge).abs() < TABLE, "{wrap:?}");
        }
        let repeat = board(Wrap::Repeat, Interpolation::Bilinear);
        assert!((at(&repeat, 7.25, -3.25) - at(&repeat, 0.25, 0.75)).abs() < 1e-6);
        for wild in [f64::NAN, f64::INFINITY, -1e300, 1e300] {
            // Any texel will do, but none out of bounds.
            let _ = at(&board(Wrap::Repeat, Interpolation::Nearest), wild, wild);
            let _ = at(&board(Wrap::Mirror, Interpolation::Nearest), wild, wild);
        }
    }

    /// At the pole of a globe only the top row counts: with `repeat` in both the bottom row takes half.
    #[test]
    fn a_globe_wraps_around_and_is_clamped_at_its_poles() {
        let mut image = board(Wrap::Repeat, Interpolation::Bilinear);
        assert!((at(&image, 0.25, 1.0) - 0.5).abs() < TABLE);
        image.wrap[1] = Wrap::Clamp;
        assert!((at(&image, 0.25, 1.0) - 0.2).abs() < TABLE && (at(&image, 0.25, 0.0) - 0.8).abs() < TABLE);
        assert!((at(&image, 0.0, 1.0) - 0.5).abs() < TABLE);
    }

    #[test]
    fn a_checkerboard_has_two_cells_a_period() {
        let board = Texture::Checkerboard {
            a: Box::new(Texture::Uniform(Spectrum::Constant(1.0))),
            b: Box::new(Texture::Uniform(Spectrum::Constant(0.0))),
            scale: DVec2::new(2.0, 2.0),
        };
        let at = |u, v| board.eval(DVec2::new(u, v), Lanes::splat(500.0)).to_array()[0];
        assert_eq!([at(0.1, 0.1), at(0.3, 0.1), at(0.3, 0.3), at(0.6, 0.1), at(-0.1, 0.1)], [1.0, 0.0, 1.0, 1.0, 0.0]);
    }
}
