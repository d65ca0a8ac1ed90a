//! What light is carried as: spectra, or for comparison the three numbers that many renderers carry.
//!
//! A renderer of red, green and blue multiplies colours where light multiplies spectra. To have that computed by lanes that
//! are made for wavelengths, red, green and blue are each given a wavelength ([`PLACES_NM`]). Each spectrum of the scene is
//! replaced by one that has there the values of its linear Rec. 709 colour. The sums of the film are linear in the three:
//! [`Carried::rgb_from_film`] takes them back. What is left is the error of the three numbers themselves:
//!
//! * a reflectance is its colour under D65, kept to [0, 1];
//! * a coefficient (absorption, scattering) is its colour under D65, kept from below zero;
//! * a light is its colour, kept from below zero: what lies outside the gamut of Rec. 709 cannot be carried;
//! * a metal has its colour at normal incidence: n is its colour under D65, and k such that the metal's comes out. Where no k
//!   does that, k is zero and n does;
//! * a refractive index is that of the sodium line: no dispersion.
//!
//! Thin films and pictures of measured spectra are computed at the three wavelengths: no colour is made of them first. A sky by
//! formulas has its colour in each direction.

use crate::spectrum::colour::{ColourSpace, Matrix, inverse, times};
use crate::spectrum::illuminant::d65;
use crate::spectrum::observer::{Y_INTEGRAL, matching, quadrature, tristimulus};
use crate::spectrum::{BAND_NM, Outside, RefractiveIndex, Spectrum, WavelengthDistribution, upsample};
use std::sync::LazyLock;

/// The wavelengths that stand for red, green and blue, nm: the dominant ones of the primaries of Rec. 709, to a nanometre.
pub const PLACES_NM: [f64; 3] = [611.0, 549.0, 464.0];

/// Where an index is taken that is to be one number, nm.
const SODIUM_NM: f64 = 589.3;

/// What light is carried as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Carried {
    /// Spectra.
    #[default]
    Spectra,
    /// Red, green and blue.
    Colours,
}

impl Carried {
    /// A reflectance.
    #[must_use]
    pub fn reflectance(self, s: Spectrum) -> Spectrum {
        self.replaced(s, |s| under_d65(s).map(|x| x.clamp(0.0, 1.0)))
    }

    /// What light is multiplied by, of any size.
    #[must_use]
    pub fn coefficient(self, s: Spectrum) -> Spectrum {
        self.replaced(s, |s| under_d65(s).map(|x| x.max(0.0)))
    }

    /// What a light sends out.
    #[must_use]
    pub fn light(self, s: Spectrum) -> Spectrum {
        match self {
            Carried::Spectra => s,
            Carried::Colours => steps(rgb(&s).map(|x| x.max(0.0))),
        }
    }

    /// η and k of a metal.
    #[must_use]
    pub fn metal(self, [eta, k]: [Spectrum; 2]) -> [Spectrum; 2] {
        if self == Carried::Spectra || (eta.is_constant() && k.is_constant()) {
            return [eta, k];
        }
        let reflectance = |nm: f64| {
            let (n, k) = (eta.at(nm), k.at(nm));
            ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)
        };
        let both = [eta.breakpoints(), k.breakpoints()].concat();
        let colour = colour_under_d65(reflectance, &both).map(|r| r.clamp(0.0, BRIGHTEST));
        let n = under_d65(&eta);
        // R = ((n − 1)² + k²) / ((n + 1)² + k²), solved for k²; where that is below zero, for n without k.
        let pairs: [[f64; 2]; 3] = std::array::from_fn(|c| {
            let (n, r) = (n[c], colour[c]);
            let squared = (r * (n + 1.0).powi(2) - (n - 1.0).powi(2)) / (1.0 - r);
            if squared >= 0.0 { [n, squared.sqrt()] } else { [(1.0 + r.sqrt()) / (1.0 - r.sqrt()), 0.0] }
        });
        [0, 1].map(|part| steps(pairs.map(|pair| pair[part])))
    }

    /// How glass bends light.
    #[must_use]
    pub fn index(self, index: RefractiveIndex) -> RefractiveIndex {
        match self {
            Carried::Spectra => index,
            Carried::Colours => RefractiveIndex::Constant(index.at(SODIUM_NM)),
        }
    }

    /// Coefficients of a texel's reflectance, as [`upsample::coefficients`]: exact to 2e-4 in both cases.
    #[must_use]
    pub fn coefficients(self, rgb: [f32; 3]) -> [f32; 3] {
        match self {
            Carried::Spectra => upsample::coefficients(rgb),
            Carried::Colours => upsample::through(PLACES_NM, rgb),
        }
    }

    /// Coefficients and a factor of a texel's reflectance. Of a colour above one that is its largest channel, so that there is no step at
    /// one; of a dim one twice that, as of light: the spectrum that is that dark by itself is light at one end of the band, where
    /// nobody sees it, and takes many steps to find.
    #[must_use]
    pub fn texel(self, rgb: [f32; 3]) -> ([f32; 3], f32) {
        /// Some 25 of the 255 levels of sRGB.
        const DIM: f32 = 0.01;
        let largest = rgb.into_iter().fold(0.0, f32::max);
        let scale = match largest {
            x if x > 1.0 => x,
            x if x > 0.0 && x < DIM => 2.0 * x,
            _ => 1.0,
        };
        (self.coefficients(rgb.map(|x| x / scale)), scale)
    }

    /// Coefficients and scale of a texel's light, as [`upsample::emission_coefficients`].
    #[must_use]
    pub fn emission_coefficients(self, rgb: [f32; 3]) -> ([f32; 3], f32) {
        let scale = 2.0 * rgb[0].max(rgb[1]).max(rgb[2]);
        match self {
            Carried::Colours if scale > 0.0 => (self.coefficients(rgb.map(|v| v / scale)), scale),
            Carried::Spectra | Carried::Colours => upsample::emission_coefficients(rgb),
        }
    }

    /// Of light that is a sum of `parts`, what each gives to red, green and blue; `None` where spectra are carried.
    #[must_use]
    pub fn shares_of<const N: usize>(self, parts: &[Spectrum; N]) -> Option<[[f32; N]; 3]> {
        let colours = || parts.each_ref().map(rgb);
        (self == Carried::Colours).then(|| {
            let colours = colours();
            std::array::from_fn(|c| colours.map(|colour| colour[c] as f32))
        })
    }

    /// Which of red, green and blue is carried at `nm`.
    #[must_use]
    pub fn channel(nm: f32) -> usize {
        let [first, second] = BORDERS_NM.map(|border| border as f32);
        2 - usize::from(nm >= first) - usize::from(nm >= second)
    }

    /// From which wavelengths are drawn where the scene does not matter.
    #[must_use]
    pub fn wavelengths(self) -> Option<WavelengthDistribution> {
        match self {
            Carried::Spectra => None,
            Carried::Colours => Some(WavelengthDistribution::in_turn(&PLACES_NM)),
        }
    }

    /// From XYZ of the film to linear Rec. 709.
    #[must_use]
    pub fn rgb_from_film(self) -> Matrix {
        match self {
            Carried::Spectra => ColourSpace::Rec709.matrix_from_xyz(),
            Carried::Colours => {
                // Each stands for a third of the band.
                let width = (BAND_NM[1] - BAND_NM[0]) / 3.0 / Y_INTEGRAL;
                let columns = PLACES_NM.map(|nm| matching(nm).map(|x| x * width));
                inverse(std::array::from_fn(|i| std::array::from_fn(|c| columns[c][i])))
            }
        }
    }

    /// Steps of `values`; a constant stays as it is.
    fn replaced(self, s: Spectrum, values: impl Fn(&Spectrum) -> [f64; 3]) -> Spectrum {
        match self {
            Carried::Colours if !s.is_constant() => steps(values(&s)),
            Carried::Spectra | Carried::Colours => s,
        }
    }
}

/// The largest reflectance of a metal in a channel: one would need an infinite k.
const BRIGHTEST: f64 = 0.9999;

/// The colour of light in linear Rec. 709.
fn rgb(s: &Spectrum) -> [f64; 3] {
    times(ColourSpace::Rec709.matrix_from_xyz(), tristimulus(s))
}

/// The colour of a factor on light, as it looks under D65, of which white has one in each channel.
fn under_d65(s: &Spectrum) -> [f64; 3] {
    colour_under_d65(|nm| s.at(nm), &s.breakpoints())
}

fn colour_under_d65(factor: impl Fn(f64) -> f64, breakpoints: &[f64]) -> [f64; 3] {
    let light = d65();
    let (mut sum, mut white) = ([0.0; 3], [0.0; 3]);
    for (nm, weight) in quadrature(breakpoints) {
        let (bar, weight) = (matching(nm), weight * light.at(nm));
        for c in 0..3 {
            sum[c] += bar[c] * weight * factor(nm);
            white[c] += bar[c] * weight;
        }
    }
    let matrix = ColourSpace::Rec709.matrix_from_xyz();
    let (sum, white) = (times(matrix, sum), times(matrix, white));
    std::array::from_fn(|c| sum[c] / white[c])
}

/// Where blue ends and where red begins, nm. Under D65 each has its share of the luminance of Rec. 709 there, so that the
/// luminance of steps is that of their colour.
static BORDERS_NM: LazyLock<[f64; 2]> = LazyLock::new(|| {
    let light = d65();
    let cells: Vec<(f64, f64)> =
        quadrature(&light.breakpoints()).into_iter().map(|(nm, w)| (nm, w * matching(nm)[1] * light.at(nm))).collect();
    let total: f64 = cells.iter().map(|c| c.1).sum();
    let [_, [red, _, blue], _] = ColourSpace::Rec709.matrix_to_xyz();
    let mut below = 0.0;
    let mut border = |share: f64, from: f64| {
        let mut at = from;
        for &(nm, light) in cells.iter().filter(|c| c.0 > from) {
            if below + light > share * total {
                break;
            }
            (below, at) = (below + light, nm);
        }
        at
    };
    let first = border(blue, BAND_NM[0]);
    [first, border(1.0 - red, first)]
});

/// A spectrum with these values at [`PLACES_NM`].
fn steps([red, green, blue]: [f64; 3]) -> Spectrum {
    if red == green && green == blue {
        return Spectrum::constant(red);
    }
    let [first, second] = *BORDERS_NM;
    let samples =
        [(BAND_NM[0], blue), (first, blue), (first, green), (second, green), (second, red), (BAND_NM[1], red)];
    Spectrum::from_samples(&samples, Outside::Hold).expect("steps are in order, their values finite")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::observer::xyz;
    use crate::spectrum::{LANES, Lanes, catalogue};

    const RED: [f64; 3] = [0.7, 0.1, 0.05];

    /// From whichever lane the turn begins, the film gives the three back. Upsampling is exact to 1e-5. A value, its weight,
    /// their product and the sum of eight are ten roundings to f32 of 6e-8, which the matrix, of condition 3.4, makes 2e-6.
    #[test]
    fn three_numbers_go_through_lanes_and_film_unchanged() {
        let wavelengths = Carried::Colours.wavelengths().unwrap();
        let s = Carried::Colours.reflectance(upsample::reflectance(RED).unwrap());
        for turn in 0..LANES {
            let drawn = wavelengths.sample((turn as f64 + 0.5) / LANES as f64);
            let found = times(Carried::Colours.rgb_from_film(), xyz(s.eval(drawn.nm), &drawn).map(f64::from));
            assert!(found.iter().zip(RED).all(|(a, b)| (a - b).abs() < 2e-5), "{turn}: {found:?}");
        }
    }

    /// Texels have the values of their colour at the three wavelengths, to 2e-4 ([`upsample::through`]).
    #[test]
    fn texels_have_their_colour_at_the_three_wavelengths() {
        for rgb in [[0.7f32, 0.1, 0.05], [1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.2, 0.2, 0.2], [0.01, 0.9, 0.99]] {
            let c = Carried::Colours.coefficients(rgb);
            for (nm, value) in PLACES_NM.into_iter().zip(rgb) {
                let found = upsample::eval_sigmoid(c, Lanes::splat(nm as f32)).to_array()[0];
                assert!((found - value).abs() < 2e-4, "{rgb:?} {nm}: {found}");
            }
        }
    }

    /// Grey stays what it is, and daylight is white to what the tabulated D65 and the white point of Rec. 709 differ (3e-4).
    #[test]
    fn greys_and_daylight_are_even() {
        let grey = Carried::Colours.reflectance(Spectrum::constant(0.18));
        assert!(matches!(grey, Spectrum::Constant(x) if x == 0.18));
        let light = Carried::Colours.light(d65());
        assert!(PLACES_NM.iter().all(|&nm| (light.at(nm) - 1.0).abs() < 4e-4), "{light:?}");
    }

    /// Gold at normal incidence has the colour of its reflectance under D65, red kept below one.
    #[test]
    fn a_metal_has_its_colour_at_normal_incidence() {
        let (eta, k) = catalogue::metal("Au").unwrap();
        let reflectance = |[eta, k]: [&Spectrum; 2], nm: f64| {
            let (n, k) = (eta.at(nm), k.at(nm));
            ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)
        };
        let curve = |nm: f64| (nm, reflectance([&eta, &k], nm));
        let samples: Vec<(f64, f64)> = (0..=4700).map(|i| curve(360.0 + 0.1 * f64::from(i))).collect();
        let colour = rgb(&Spectrum::from_samples(&samples, Outside::Hold).unwrap().times(&d65()));
        let white = rgb(&d65());
        let [eta, k] = Carried::Colours.metal([eta.clone(), k.clone()]);
        for c in 0..3 {
            let found = reflectance([&eta, &k], PLACES_NM[c]);
            let expected = (colour[c] / white[c]).min(BRIGHTEST);
            assert!((found - expected).abs() < 1e-4, "{c}: {found} {expected}");
        }
    }

    /// The luminance of steps under D65 is that of their colour, to the step of the quadrature that their borders are on: a
    /// node's share of the luminance is below 1 / 200.
    #[test]
    fn steps_have_the_luminance_of_their_colour() {
        let s = steps(RED);
        let expected: f64 = ColourSpace::Rec709.matrix_to_xyz()[1].iter().zip(RED).map(|(a, b)| a * b).sum();
        assert!((s.times(&d65()).luminance() - expected).abs() < 0.005, "{s:?}");
        for (nm, value) in PLACES_NM.into_iter().zip(RED) {
            assert!((s.at(nm) - value).abs() < 1e-7);
        }
    }
}
