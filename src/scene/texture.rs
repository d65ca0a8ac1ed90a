//! Spectra and numbers that vary over a surface.

mod numbers;

pub use numbers::{DataImage, Numbers, Scalar};
pub(super) use numbers::{luminance, outside};

use super::SurfacePoint;
use super::bands::Bands;
use super::mesh::attribute::AttributeTexture;
use super::volume::Volume;
use crate::math::sampler::GOLDEN;
use crate::spectrum::{LANES, Lanes, Spectrum, upsample};
use glam::{DAffine2, DVec2, DVec3};
use std::ops::{Add, Mul};
use std::sync::{Arc, OnceLock};

/// A point of a surface, as textures see it.
#[derive(Clone, Copy, Debug, Default)]
pub struct TexturePoint {
    /// Texture coordinates.
    pub uv: DVec2,
    /// In the world, metres.
    pub point: DVec3,
    /// The face of a shape or the triangle of a mesh.
    pub part: u32,
    /// On triangles the barycentric coordinates of the second and third corner.
    pub barycentric: [f64; 2],
}

impl TexturePoint {
    /// `surface`, which lies on the face or triangle `part`.
    #[must_use]
    pub fn new(surface: &SurfacePoint, part: u32, barycentric: [f64; 2]) -> TexturePoint {
        TexturePoint { uv: surface.uv, point: surface.point, part, barycentric }
    }
}

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
        /// From u, v to periods.
        uv: DAffine2,
    },
    /// What fills space, where the surface cuts it.
    Volume(Volume),
    /// Numbers of the mesh itself.
    Attribute(Box<AttributeTexture>),
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
    /// Factor: one, or of a colour above one its largest channel.
    pub scale: f32,
}

/// The lattice of a picture's texels over u, v. v = 0 is the bottom row's edge, v = 1 the top's.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Columns.
    pub width: usize,
    /// Rows; row 0 is the top, as in the file.
    pub height: usize,
    /// Beyond the edge, in u and in v.
    pub wrap: [Wrap; 2],
    /// Between texels.
    pub interpolation: Interpolation,
    /// From the surface's u, v to the picture's.
    pub uv: DAffine2,
}

/// Index of the texel at `i` of `n` under `wrap`.
pub(super) fn wrapped(i: f64, n: usize, wrap: Wrap) -> usize {
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

/// Indices of the texels at `i` and `i + 1` of `n` under `wrap`.
fn wrapped_pair(i: f64, n: usize, wrap: Wrap) -> (usize, usize) {
    let first = wrapped(i, n, wrap);
    match wrap {
        Wrap::Repeat => (first, if first + 1 == n { 0 } else { first + 1 }),
        Wrap::Mirror | Wrap::Clamp => (first, wrapped(i + 1.0, n, wrap)),
    }
}

impl Grid {
    /// A picture of `width` × `height` texels that repeats, once over the unit square.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Grid {
        let (wrap, interpolation) = ([Wrap::Repeat; 2], Interpolation::Bilinear);
        Grid { width, height, wrap, interpolation, uv: DAffine2::IDENTITY }
    }

    /// Indices of the four texels whose upper left one is in column `corner.x` of row `corner.y`, counted from the
    /// top: upper left, upper right, lower left, lower right.
    fn four(&self, corner: DVec2) -> [usize; 4] {
        let (left, right) = wrapped_pair(corner.x, self.width, self.wrap[0]);
        let (upper, lower) = wrapped_pair(corner.y, self.height, self.wrap[1]);
        let (upper, lower) = (upper * self.width, lower * self.width);
        [upper + left, upper + right, lower + left, lower + right]
    }

    /// Column and row of the texel above and to the left of `uv`, and how far beyond its centre that lies.
    fn corner(&self, uv: DVec2) -> (DVec2, DVec2) {
        // Texel centres lie at half-integers.
        let uv = self.uv.transform_point2(uv);
        let at = DVec2::new(uv.x * self.width as f64 - 0.5, self.height as f64 - uv.y * self.height as f64 - 0.5);
        (at.floor(), at - at.floor())
    }

    /// The value at `uv`, of the values that `texel` gives by index.
    fn value<T: Copy + Add<Output = T> + Mul<f32, Output = T>>(&self, uv: DVec2, texel: impl Fn(usize) -> T) -> T {
        match self.interpolation {
            // A row begins where v of the surface comes to it: at v = 0 as at v = 1 is the first, be it the bottom one or, where v
            // runs down the picture, as in Mitsuba, the top one. Turned besides, it runs down where u and v have changed hands.
            Interpolation::Nearest => {
                let (x_axis, y_axis) = (self.uv.matrix2.x_axis, self.uv.matrix2.y_axis);
                let turned = x_axis.y != 0.0 || y_axis.x != 0.0;
                let down = if turned { self.uv.matrix2.determinant() < 0.0 } else { y_axis.y < 0.0 };
                let uv = self.uv.transform_point2(uv);
                let (x, up) = (uv.x * self.width as f64, uv.y * self.height as f64);
                let height = self.height as f64;
                let row = if down { (height - up).floor() } else { height - 1.0 - up.floor() };
                let row = wrapped(row, self.height, self.wrap[1]);
                texel(row * self.width + wrapped(x.floor(), self.width, self.wrap[0]))
            }
            Interpolation::Bilinear => {
                let (corner, weight) = self.corner(uv);
                let (wx, wy) = (weight.x as f32, weight.y as f32);
                let [a, b, c, d] = self.four(corner).map(texel);
                let row = |l: T, r: T| l * (1.0 - wx) + r * wx;
                row(a, b) * (1.0 - wy) + row(c, d) * wy
            }
        }
    }
}

/// The texels of a picture, row by row.
#[derive(Clone, Debug)]
pub struct Texels {
    /// Each colour once, if they are numbered; else one a texel.
    pub colours: Arc<Vec<Texel>>,
    /// For each texel the number of its colour: a quarter of the memory of a picture of few colours.
    pub numbers: Option<Arc<Vec<u32>>>,
    /// The greatest factor of any: above one they are light, and no reflectances.
    pub greatest: f32,
    /// Which colour has the most light, once that is asked for: all that the picture lies on asks for it.
    brightest: Arc<OnceLock<Option<usize>>>,
}

impl Texels {
    /// Texels with a colour each.
    #[must_use]
    pub fn each(texels: Vec<Texel>) -> Texels {
        let greatest = texels.iter().fold(1.0, |greatest: f32, texel| greatest.max(texel.scale));
        Texels { colours: Arc::new(texels), numbers: None, greatest, brightest: Arc::default() }
    }

    /// Texels of these colours, none of which is above one, by their numbers.
    #[must_use]
    pub fn numbered(colours: Vec<Texel>, numbers: Vec<u32>) -> Texels {
        let numbers = Some(Arc::new(numbers));
        Texels { colours: Arc::new(colours), numbers, greatest: 1.0, brightest: Arc::default() }
    }

    /// The texel at `index`.
    #[must_use]
    #[inline]
    pub fn at(&self, index: usize) -> &Texel {
        match &self.numbers {
            None => &self.colours[index],
            Some(numbers) => &self.colours[numbers[index] as usize],
        }
    }

    /// The one with the most light at eight wavelengths (at four in the build of four lanes).
    fn brightest(&self) -> Option<&Texel> {
        let found = self.brightest.get_or_init(|| {
            const NM: [f32; 8] = [410.0, 450.0, 490.0, 530.0, 560.0, 590.0, 620.0, 660.0];
            let nm = Lanes::new(std::array::from_fn(|lane| NM[lane * NM.len() / LANES]));
            let light = |texel: &Texel| texel.scale * upsample::eval_sigmoid(texel.coefficients, nm).reduce_add();
            let all = self.colours.iter().map(light).enumerate();
            all.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
        });
        found.map(|i| &self.colours[i])
    }

    fn len(&self) -> usize {
        self.numbers.as_ref().map_or(self.colours.len(), |numbers| numbers.len())
    }
}

/// A picture whose texels are spectra.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    /// Their spectra.
    pub texels: Texels,
    /// Where they lie.
    pub grid: Grid,
    /// A spectrum that multiplies every texel: one for reflectances, D65 for light.
    pub illuminant: Option<Spectrum>,
    /// Measured spectra in place of the above.
    pub bands: Option<Bands>,
    /// The mean luminance, once that is asked for: all lamps that show the picture ask for it.
    pub mean: Arc<OnceLock<f64>>,
}

/// Places of a texture that tell its mean luminance.
const PLACES: usize = 256;

/// Some `count` of the numbers below `len`, all where there are no more: spread by the golden ratio, so that they are in no one column of
/// a picture, whatever its width.
pub(super) fn spread(len: usize, count: usize) -> impl Iterator<Item = usize> {
    let few = len <= count;
    let place = move |i: usize| match few {
        true => i,
        false => (((i as f64 + 0.5) * GOLDEN).fract() * len as f64) as usize,
    };
    (0..count.min(len)).map(place)
}

/// The mean luminance of `count` spectra, as far as [`PLACES`] of them tell it, and no less than what the `brightest` gives by itself.
pub(super) fn mean_luminance(count: usize, brightest: Option<Spectrum>, at: impl Fn(usize) -> Spectrum) -> f64 {
    let told = spread(count, PLACES).map(|i| at(i).luminance()).sum::<f64>() / count.clamp(1, PLACES) as f64;
    told.max(brightest.map_or(0.0, |spectrum| spectrum.luminance()) / count.max(1) as f64)
}

/// Some 1024 of `count` spectra, each with an even share of their mean.
pub(super) fn even_shares(count: usize, at: impl Fn(usize) -> Spectrum) -> Vec<(f64, Spectrum)> {
    const SOME: usize = 1024;
    let share = 1.0 / count.clamp(1, SOME) as f64;
    spread(count, SOME).map(|i| (share, at(i))).collect()
}

impl ImageTexture {
    /// What a texel shows.
    fn spectrum(&self, texel: &Texel) -> Spectrum {
        self.lit(Spectrum::Sigmoid { c: texel.coefficients, scale: texel.scale })
    }

    /// What a spectrum of the picture is under its illuminant.
    fn lit(&self, own: Spectrum) -> Spectrum {
        self.illuminant.as_ref().map_or(own.clone(), |illuminant| own.times(illuminant))
    }

    /// Gives the picture its light.
    pub fn light_up(&mut self, illuminant: Option<Spectrum>) {
        self.illuminant = illuminant;
        // It was that of another light.
        self.mean = Arc::default();
    }

    /// [`Texture::mean_luminance`].
    fn mean_luminance(&self) -> f64 {
        *self.mean.get_or_init(|| match &self.bands {
            None => {
                let brightest = self.texels.brightest().map(|texel| self.spectrum(texel));
                mean_luminance(self.texels.len(), brightest, |i| self.spectrum(self.texels.at(i)))
            }
            Some(bands) => {
                let at = |i| self.lit(bands.spectrum(i));
                mean_luminance(bands.len(), bands.brightest().map(at), at)
            }
        })
    }

    /// The spectrum at `uv`. Spectra are mixed, not coefficients.
    #[must_use]
    pub fn eval(&self, uv: DVec2, nm: Lanes) -> Lanes {
        let value = self.grid.value(uv, |i| {
            if let Some(bands) = &self.bands {
                return bands.eval(i, nm);
            }
            let texel = self.texels.at(i);
            upsample::eval_sigmoid(texel.coefficients, nm) * texel.scale
        });
        match &self.illuminant {
            Some(spectrum) => value * spectrum.eval(nm),
            None => value,
        }
    }
}

/// True where the cells of a checkerboard that `uv` maps to have the same parity in u and v.
fn same_cell(uv: &DAffine2, at: &TexturePoint) -> bool {
    let p = uv.transform_point2(at.uv);
    // Halfway a cell has not ended, as in Mitsuba: joints of curves have a v that can be just that.
    let cell = |x: f64| x - x.floor() > 0.5;
    cell(p.x) == cell(p.y)
}

impl Texture {
    /// A texture that is one everywhere.
    #[must_use]
    pub fn one() -> Texture {
        Texture::Uniform(Spectrum::Constant(1.0))
    }

    /// The spectrum at a point.
    #[must_use]
    #[inline]
    pub fn eval(&self, at: &TexturePoint, nm: Lanes) -> Lanes {
        match self {
            Texture::Uniform(spectrum) => spectrum.eval(nm),
            varying => varying.eval_varying(at, nm),
        }
    }

    #[inline(never)]
    fn eval_varying(&self, at: &TexturePoint, nm: Lanes) -> Lanes {
        match self {
            Texture::Uniform(spectrum) => spectrum.eval(nm),
            Texture::Image(image) => image.eval(at.uv, nm),
            Texture::Checkerboard { a, b, uv } => (if same_cell(uv, at) { a } else { b }).eval(at, nm),
            Texture::Volume(volume) => volume.eval(at.point, nm),
            Texture::Attribute(attribute) => attribute.eval(at, nm),
        }
    }

    /// The same as reflectances: what it cuts out of a volume is shares of light.
    #[must_use]
    pub fn of_shares(self) -> Texture {
        match self {
            Texture::Volume(volume) => Texture::Volume(volume.of_shares()),
            Texture::Checkerboard { a, b, uv } => {
                Texture::Checkerboard { a: Box::new(a.of_shares()), b: Box::new(b.of_shares()), uv }
            }
            other => other,
        }
    }

    /// True for anything but one spectrum.
    #[must_use]
    pub fn varies(&self) -> bool {
        !matches!(self, Texture::Uniform(_))
    }

    /// The mean luminance, as far as some 256 places tell it, for the choice of lights. What the brightest texel of a picture gives is in
    /// it by itself, so that none is black that shines.
    #[must_use]
    pub fn mean_luminance(&self) -> f64 {
        match self {
            Texture::Uniform(spectrum) => spectrum.luminance(),
            Texture::Image(image) => image.mean_luminance(),
            Texture::Volume(volume) => volume.mean_luminance(),
            Texture::Attribute(attribute) => attribute.mean_luminance(),
            Texture::Checkerboard { a, b, .. } => 0.5 * (a.mean_luminance() + b.mean_luminance()),
        }
    }

    /// Whether it is nothing everywhere. Of pictures that is not asked: a black texel, too, has the 2.5e-37 by which sigmoids miss 0.
    #[must_use]
    pub fn is_black(&self) -> bool {
        match self {
            Texture::Uniform(spectrum) => spectrum.is_black(),
            Texture::Checkerboard { a, b, .. } => a.is_black() && b.is_black(),
            // The brightest voxel or value counts by itself there.
            Texture::Volume(_) | Texture::Attribute(_) => self.mean_luminance() == 0.0,
            Texture::Image(_) => false,
        }
    }

    /// Some of its spectra and their shares of it, so that the mean of all is told: texels of a picture, voxels or values of a file.
    #[must_use]
    pub fn shares(&self) -> Vec<(f64, Spectrum)> {
        match self {
            Texture::Uniform(spectrum) => vec![(1.0, spectrum.clone())],
            Texture::Image(image) => match &image.bands {
                Some(bands) => even_shares(bands.len(), |i| image.lit(bands.spectrum(i))),
                None => even_shares(image.texels.len(), |i| image.spectrum(image.texels.at(i))),
            },
            Texture::Volume(volume) => volume.shares(),
            Texture::Attribute(attribute) => attribute.shares(),
            Texture::Checkerboard { a, b, .. } => {
                a.shares().into_iter().chain(b.shares()).map(|(share, spectrum)| (0.5 * share, spectrum)).collect()
            }
        }
    }

    /// Spectra that stand for the texture where one is needed (choice of wavelengths):
    /// each spectrum of a checkerboard, and some 16 texels of a picture or voxels of a volume with the brightest.
    #[must_use]
    pub fn representatives(&self) -> Vec<Spectrum> {
        match self {
            Texture::Uniform(spectrum) => vec![spectrum.clone()],
            Texture::Image(image) => {
                if let Some(bands) = &image.bands {
                    return bands.representatives().into_iter().map(|spectrum| image.lit(spectrum)).collect();
                }
                let texels = spread(image.texels.len(), 16).map(|i| image.texels.at(i)).chain(image.texels.brightest());
                texels.map(|texel| image.spectrum(texel)).collect()
            }
            Texture::Volume(volume) => volume.representatives(),
            Texture::Attribute(attribute) => attribute.representatives(),
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

    /// Four texels a, b, c, d, over three copies to either side: the last one held, abcd abcd, and abcd dcba.
    #[test]
    fn texels_beyond_the_picture_are_those_of_its_copies() {
        let at = |wrap| [-9, -8, -5, -4, -1, 0, 3, 4, 7, 8, 11, 12].map(|i| wrapped(f64::from(i), 4, wrap));
        assert_eq!(at(Wrap::Clamp), [0, 0, 0, 0, 0, 0, 3, 3, 3, 3, 3, 3]);
        assert_eq!(at(Wrap::Repeat), [3, 0, 3, 0, 3, 0, 3, 0, 3, 0, 3, 0]);
        assert_eq!(at(Wrap::Mirror), [0, 0, 3, 3, 0, 0, 3, 3, 0, 0, 3, 3]);
    }

    /// Grey texels (coefficients c₂ alone) of values 0.2 and 0.8 in a 2 × 2 board.
    fn board(wrap: Wrap, interpolation: Interpolation) -> ImageTexture {
        let grey = |v: f64| upsample::coefficients([v as f32; 3]);
        let texel = |v: f64| Texel { coefficients: grey(v), scale: 1.0 };
        ImageTexture {
            texels: Texels::each(vec![texel(0.2), texel(0.8), texel(0.8), texel(0.2)]),
            grid: Grid { wrap: [wrap; 2], interpolation, ..Grid::new(2, 2) },
            illuminant: None,
            bands: None,
            mean: Arc::default(),
        }
    }

    /// A black frame says nothing of what is within; of a picture that is black but for a texel the mean is that of the texel.
    #[test]
    fn the_mean_of_a_picture_is_not_that_of_a_column() {
        let grey = |v: f64| Texel { coefficients: upsample::coefficients([v as f32; 3]), scale: 1.0 };
        let mean = |value: &dyn Fn(usize, usize) -> f64| {
            let texels = (0..64 * 64).map(|i| grey(value(i % 64, i / 64))).collect();
            Texture::Image(ImageTexture {
                texels: Texels::each(texels),
                grid: Grid::new(64, 64),
                ..board(Wrap::Clamp, Interpolation::Nearest)
            })
            .mean_luminance()
        };
        let whole = mean(&|_, _| 0.5);
        let is_within = |x: usize| (1..63).contains(&x);
        let framed = mean(&|x, y| if is_within(x) && is_within(y) { 0.5 } else { 0.0 });
        // The share of 256 places drawn by chance has a standard error of √(p (1 − p) / 256); spread evenly they are off by less.
        let within = (62.0 / 64.0_f64).powi(2);
        assert!((framed / whole - within).abs() < (within * (1.0 - within) / 256.0).sqrt(), "{framed} of {whole}");
        let dot = mean(&|x, y| if (x, y) == (11, 50) { 0.5 } else { 0.0 });
        // Its own share of the picture, or where one of the places is on it, theirs.
        let is_share = |texels: f64| (dot / whole * texels - 1.0).abs() < 1e-6;
        assert!(is_share(4096.0) || is_share(256.0), "{dot} of {whole}");
    }

    /// What lies on a thing is a copy of the picture: what one has found all others know. Of two that are as bright it is the last.
    #[test]
    fn the_brightest_texel_is_looked_for_once() {
        let picture = board(Wrap::Clamp, Interpolation::Nearest);
        let copy = picture.clone();
        assert!(Texture::Image(picture).mean_luminance() > 0.0);
        assert_eq!(copy.texels.brightest.get(), Some(&Some(2)));
    }

    /// One of 4096 texels has all the light, in two bands: whichever it is, the mean is told no lower than that of even light.
    #[test]
    fn one_texel_of_measured_light_counts() {
        let picture = |light: &dyn Fn(usize) -> f32| {
            let plane: Vec<f32> = (0..4096).map(light).collect();
            let part = crate::film::exr::ExrPart {
                name: None,
                window: crate::film::Window::full(64, 64),
                channels: ["S0.500nm", "S0.600nm"].map(|band| (band.to_owned(), plane.clone())).into(),
                integers: Vec::new(),
                texts: Vec::new(),
            };
            let bands = Bands::of(std::path::Path::new("a.exr"), &part).unwrap();
            assert!(bands.is_some());
            Texture::Image(ImageTexture { bands, ..board(Wrap::Clamp, Interpolation::Nearest) })
        };
        let even = picture(&|_| 1.0).mean_luminance();
        for lit in (0..4096).step_by(97) {
            let dot = picture(&|i| if i == lit { 4096.0 } else { 0.0 });
            assert!(dot.mean_luminance() > even * (1.0 - 1e-6), "{lit}");
            assert!(dot.representatives().iter().any(|spectrum| spectrum.luminance() > 0.0), "{lit}");
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
        image.grid.wrap[1] = Wrap::Clamp;
        assert!((at(&image, 0.25, 1.0) - 0.2).abs() < TABLE && (at(&image, 0.25, 0.0) - 0.8).abs() < TABLE);
        assert!((at(&image, 0.0, 1.0) - 0.5).abs() < TABLE);
    }

    #[test]
    fn a_checkerboard_has_two_cells_a_period() {
        let board = Texture::Checkerboard {
            a: Box::new(Texture::Uniform(Spectrum::Constant(1.0))),
            b: Box::new(Texture::Uniform(Spectrum::Constant(0.0))),
            uv: DAffine2::from_scale(DVec2::new(2.0, 2.0)),
        };
        let at = |u, v| {
            board
                .eval(&TexturePoint { uv: DVec2::new(u, v), ..TexturePoint::default() }, Lanes::splat(500.0))
                .to_array()[0]
        };
        assert_eq!([at(0.1, 0.1), at(0.3, 0.1), at(0.3, 0.3), at(0.6, 0.1), at(-0.1, 0.1)], [1.0, 0.0, 1.0, 1.0, 0.0]);
    }

    fn numbers(interpolation: Interpolation, uv: DAffine2) -> Scalar {
        let grid = Grid { wrap: [Wrap::Clamp; 2], interpolation, uv, ..Grid::new(2, 2) };
        Scalar::Image(DataImage {
            texels: Numbers::Floats(Arc::new([0.1, 0.5, 0.3, 0.9].map(|x| [x; 3]).to_vec())),
            grid,
            decoded: false,
        })
    }

    fn point(u: f64, v: f64) -> TexturePoint {
        TexturePoint { uv: DVec2::new(u, v), ..TexturePoint::default() }
    }

    /// Data are numbers as they stand in the file: 2^-24 of each is f32's rounding.
    #[test]
    fn a_picture_of_numbers_keeps_them() {
        let nearest = numbers(Interpolation::Nearest, DAffine2::IDENTITY);
        for (u, v, expected) in [(0.2, 0.8, 0.1), (0.8, 0.8, 0.5), (0.2, 0.2, 0.3), (0.8, 0.2, 0.9)] {
            assert!((nearest.eval(&point(u, v)) - expected).abs() < 1e-7);
        }
        let middle = numbers(Interpolation::Bilinear, DAffine2::IDENTITY).eval(&point(0.5, 0.5));
        assert!((middle - 0.45).abs() < 1e-6);
        // Half a turn about the middle.
        let turned = DAffine2::from_cols(-DVec2::X, -DVec2::Y, DVec2::ONE);
        assert!((numbers(Interpolation::Nearest, turned).eval(&point(0.2, 0.8)) - 0.9).abs() < 1e-7);
    }

    /// Mitsuba's v runs down the picture, and its first row is the one at v = 0 and, repeated, at v = 1.
    #[test]
    fn a_row_begins_where_v_comes_to_it() {
        let up = Grid { interpolation: Interpolation::Nearest, ..Grid::new(1, 2) };
        let down = Grid { uv: DAffine2::from_cols(DVec2::X, -DVec2::Y, DVec2::Y), ..up };
        let rows = |v: f64| [up, down].map(|grid| grid.value(DVec2::new(0.2, v), |row| row as f32));
        assert_eq!([-1.0, 0.0, 0.5, 1.0].map(rows), [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]);
        for degrees in [30.0, 90.0, 110.0, 180.0, 250.0] {
            let turn = DAffine2::from_angle(f64::to_radians(degrees));
            let rows = [up, down].map(|grid| Grid { uv: grid.uv * turn, ..grid }.value(DVec2::ZERO, |row| row as f32));
            assert_eq!(rows, [1.0, 0.0], "{degrees}");
        }
    }

    /// The bilinear form is quadratic, so that central differences are its derivatives but for rounding
    /// (f32 values over a step of 1e-2: 1e-5).
    #[test]
    fn gradients_are_those_of_the_values() {
        let uv = DAffine2::from_cols(DVec2::new(0.5, 0.2), DVec2::new(-0.3, 0.4), DVec2::new(0.35, 0.25));
        let heights = numbers(Interpolation::Bilinear, uv);
        let h = 1e-2;
        let by_u = (heights.eval(&point(0.4 + h, 0.5)) - heights.eval(&point(0.4 - h, 0.5))) / (2.0 * h);
        let by_v = (heights.eval(&point(0.4, 0.5 + h)) - heights.eval(&point(0.4, 0.5 - h))) / (2.0 * h);
        let found = heights.gradient(&point(0.4, 0.5));
        assert!((found - DVec2::new(by_u, by_v)).length() < 1e-4, "{found} {by_u} {by_v}");
        assert!(found.length() > 0.1);
    }
}
