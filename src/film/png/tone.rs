//! Tone curves: from scene light, linear in the display's primaries, to display light.

use super::{Space, Tonemap};
use crate::spectrum::ColourSpace;
use crate::spectrum::colour::{Matrix, inverse, multiply, times};

/// A tone curve with its matrices at hand.
pub(super) struct Tone {
    tonemap: Tonemap,
    luminance: [f64; 3],
    aces_input: Matrix,
    aces_output: Matrix,
    agx_outset: Matrix,
}

/// Rec.709 to the ACES rendering space (Hill 2016), rows.
const ACES_INPUT: Matrix = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
/// And back to Rec.709, with the desaturation of the output transform.
const ACES_OUTPUT: Matrix =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

/// The inset of AgX (Sobotka 2022): each primary of Rec.709 drawn towards white; rows sum to one.
const AGX_INSET: Matrix = [
    [0.842_401_070_950_468_6, 0.078_436_501_561_802_76, 0.079_162_427_487_728_7],
    [0.042_401_070_950_468_54, 0.878_436_501_561_802_8, 0.079_162_427_487_728_7],
    [0.042_401_070_950_468_54, 0.078_436_501_561_802_76, 0.879_162_427_487_728_7],
];

impl Tone {
    pub(super) fn new(tonemap: Tonemap, space: Space) -> Tone {
        let (aces_input, aces_output) = match space {
            Space::Srgb => (ACES_INPUT, ACES_OUTPUT),
            // The curve stands in the rendering space of ACES, which either display is reached from.
            Space::DisplayP3 => {
                let rec709_from_p3 = ColourSpace::P3D65.to_rec709();
                (multiply(ACES_INPUT, rec709_from_p3), multiply(inverse(rec709_from_p3), ACES_OUTPUT))
            }
        };
        Tone { tonemap, luminance: space.luminance(), aces_input, aces_output, agx_outset: inverse(AGX_INSET) }
    }

    /// The grey that is shown as `shown`, below 1, of white.
    pub(super) fn grey_shown_as(&self, shown: f64) -> f64 {
        // The curves rise: 60 halvings of 40 stops about 1.
        let (mut low, mut high) = (-20.0, 20.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.apply([libm::exp2(middle); 3])[1] < shown { low = middle } else { high = middle }
        }
        libm::exp2(low)
    }

    /// Display light, linear, not yet cut.
    pub(super) fn apply(&self, rgb: [f64; 3]) -> [f64; 3] {
        match self.tonemap {
            Tonemap::None => rgb,
            Tonemap::Reinhard => {
                // Below zero there is nothing to compress.
                let y = self.luminance[0] * rgb[0] + self.luminance[1] * rgb[1] + self.luminance[2] * rgb[2];
                let shown = y.max(0.0) / (1.0 + y.max(0.0));
                let rgb = rgb.map(|v| v / (1.0 + y.max(0.0)));
                // The luminance is below 1, a channel need not be: such a colour is drawn towards the grey of its luminance,
                // up to where it can be shown (Hall 1989, section 5.2). Cut, orange would turn yellow.
                let largest = rgb[0].max(rgb[1]).max(rgb[2]);
                match largest > 1.0 && largest.is_finite() {
                    true => rgb.map(|v| shown + (v - shown) * (1.0 - shown) / (largest - shown)),
                    false => rgb,
                }
            }
            Tonemap::Aces => {
                let fit =
                    |v: f64| (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081);
                // The quotient of infinities is NaN; far before that the curve has reached its limit.
                times(self.aces_output, times(self.aces_input, rgb).map(|v| fit(v.clamp(0.0, 1e9))))
            }
            Tonemap::Agx => {
                let curved = times(AGX_INSET, rgb).map(|v| {
                    let stops = libm::log2(v.max(f64::MIN_POSITIVE) / 0.18);
                    agx_sigmoid(((stops + 10.0) / 16.5).clamp(0.0, 1.0))
                });
                times(self.agx_outset, curved).map(|v| libm::pow(v.max(0.0), 2.2))
            }
        }
    }
}

/// The contrast curve of AgX on [0, 1]: y = 1/2 + s·d / (1 + (|s·d|/L)^p)^(1/p), d = x − 10/16.5, slope s = 2, with
/// p = 3 in the toe and 3.25 in the shoulder; L is such that the curve ends in (0, 0) and (1, 1): where
/// S = s·d there, S/(1 + (S/L)^p)^(1/p) = 1/2 gives (1/L)^p = 2^p − S^−p.
fn agx_sigmoid(x: f64) -> f64 {
    const PIVOT: f64 = 10.0 / 16.5;
    const SLOPE: f64 = 2.0;
    let d = SLOPE * (x - PIVOT);
    let (power, end) = if d < 0.0 { (3.0, SLOPE * PIVOT) } else { (3.25, SLOPE * (1.0 - PIVOT)) };
    let inverse_limit = libm::pow(2.0, power) - libm::pow(end, -power);
    0.5 + d / libm::pow(1.0 + inverse_limit * libm::pow(d.abs(), power), 1.0 / power)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAPS: [Tonemap; 4] = [Tonemap::None, Tonemap::Reinhard, Tonemap::Aces, Tonemap::Agx];

    /// Rows of the ACES and AgX matrices sum to one (to their 5 digits), so grey stays grey within one part in 1e4.
    #[test]
    fn grey_stays_grey_and_brighter_stays_brighter() {
        for (map, space) in MAPS.into_iter().flat_map(|map| [(map, Space::Srgb), (map, Space::DisplayP3)]) {
            let tone = Tone::new(map, space);
            let mut previous = f64::NEG_INFINITY;
            for i in 0..400 {
                let v = libm::exp2(f64::from(i) / 20.0 - 12.0);
                let [r, g, b] = tone.apply([v; 3]);
                assert!(
                    (r - g).abs() <= 1e-4 * g.abs().max(1e-3) && (b - g).abs() <= 1e-4 * g.abs().max(1e-3),
                    "{map:?} {v}"
                );
                assert!(g >= previous, "{map:?} at {v}: {g} after {previous}");
                previous = g;
            }
        }
    }

    /// Orange of luminance y = 1.57 would have a red of 4/(1 + y) = 1.55: it is drawn towards the grey y/(1 + y) until its red is 1, which
    /// keeps the luminance and the ratio of what the channels differ by. Green of as much is within the gamut and stays.
    #[test]
    fn colours_that_cannot_be_shown_are_drawn_to_the_grey_of_their_luminance() {
        let tone = Tone::new(Tonemap::Reinhard, Space::Srgb);
        let y_of = |rgb: [f64; 3]| (0..3).map(|c| tone.luminance[c] * rgb[c]).sum::<f64>();
        let orange = [4.0, 1.0, 0.1];
        let [r, g, b] = tone.apply(orange);
        let y = y_of(orange);
        assert!((r - 1.0).abs() < 1e-12 && (y_of([r, g, b]) - y / (1.0 + y)).abs() < 1e-6, "{r} {g} {b}");
        assert!(((r - g) / (g - b) - 3.0 / 0.9).abs() < 1e-9, "{r} {g} {b}");
        let green = [0.5, 1.9, 0.2];
        let y = y_of(green);
        assert_eq!(tone.apply(green), green.map(|v| v / (1.0 + y)));
    }

    /// Reinhard: 1 → 1/2. Hill's ACES fit of 1: (1.0245786 − 0.000090537)/(0.983729 + 0.432951 + 0.238081) = 0.61911,
    /// times its row sum 1.0000 of the output matrix. AgX pins 0.18 to 1/2 encoded with power 2.2, black at −10 stops
    /// and white at +6.5.
    #[test]
    fn tone_curves_pass_through_their_published_points() {
        let at = |map, v: f64| Tone::new(map, Space::Srgb).apply([v; 3])[1];
        assert_eq!(at(Tonemap::Reinhard, 1.0), 0.5);
        assert!((at(Tonemap::Aces, 1.0) - 0.619_114).abs() < 1e-5, "{}", at(Tonemap::Aces, 1.0));
        assert!((at(Tonemap::Agx, 0.18) - libm::pow(0.5, 2.2)).abs() < 1e-12);
        assert!(at(Tonemap::Agx, 0.18 / 1024.0).abs() < 1e-12);
        assert!((at(Tonemap::Agx, 0.18 * libm::exp2(6.5)) - 1.0).abs() < 1e-12);
        // AgX: 0.18 shown is 0.4587 coded, 0.0413 below the pivot; at slope 2 that is 0.341 stops.
        for (map, expected) in [(Tonemap::None, 0.18), (Tonemap::Reinhard, 0.18 / 0.82), (Tonemap::Agx, 0.1421)] {
            let grey = Tone::new(map, Space::Srgb).grey_shown_as(0.18);
            assert!((grey - expected).abs() < 1e-4, "{map:?}: {grey}");
        }
        // The published closed form of the toe: |x − 20/33|³ times 59.507875 below the pivot.
        let d: f64 = 0.3 - 20.0 / 33.0;
        let expected = 0.5 + 2.0 * d / (1.0 + 59.507_875 * d.abs().powi(3)).powf(1.0 / 3.0);
        assert!((agx_sigmoid(0.3) - expected).abs() < 1e-7);
    }
}
