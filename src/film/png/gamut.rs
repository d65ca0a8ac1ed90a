//! Colours that no display has: light of one wavelength lies outside the triangle of its primaries, so that a channel is
//! negative. Cut channel by channel, a spectrum becomes a few flat bands, and a bright one never runs to white.
//!
//! As the reference gamut compression of ACES 1.3 does, in the primaries of the display in place of AP1: the distance of a
//! channel from the largest, d = (max − c) / max, is 0 for grey, 1 on the edge of the triangle and more beyond. Distances
//! below a threshold stay, bit for bit; those above are compressed, each channel by itself, such that the farthest colour
//! of the spectrum comes to lie on the edge. The largest channel stays.

use super::Space;
use crate::spectrum::colour::times;
use crate::spectrum::observer;

/// Thresholds of cyan, magenta and yellow, and the power: those of ACES 1.3, which were chosen to leave the colours of
/// a ColorChecker under daylight alone.
const THRESHOLD: [f64; 3] = [0.815, 0.803, 0.880];
const POWER: f64 = 1.2;

/// The compression for a display.
pub(super) struct Gamut {
    /// Of each channel: by which distances beyond the threshold are measured.
    scale: [f64; 3],
}

impl Gamut {
    pub(super) fn new(space: Space) -> Gamut {
        // The farthest colours of the spectrum, from 400 to 700 nm.
        let from_xyz = space.primaries().matrix_from_xyz();
        let mut limit = [1.0f64; 3];
        for nm in 400..=700 {
            let distance = distances(times(from_xyz, observer::matching(f64::from(nm))));
            limit = [0, 1, 2].map(|c| limit[c].max(distance[c]));
        }
        // The scale s for which compress(limit) = 1.
        let scale = |c: usize| {
            let (edge, far) = (1.0 - THRESHOLD[c], limit[c] - THRESHOLD[c]);
            far / libm::pow(libm::pow(edge / far, -POWER) - 1.0, 1.0 / POWER)
        };
        Gamut { scale: [0, 1, 2].map(scale) }
    }

    /// `rgb` within the display's colours, but for rounding and for what is farther than any light.
    pub(super) fn compress(&self, rgb: [f64; 3]) -> [f64; 3] {
        let largest = rgb[0].max(rgb[1]).max(rgb[2]);
        if largest.is_nan() || largest <= 0.0 || largest.is_infinite() {
            return rgb;
        }
        let distance = distances(rgb);
        [0, 1, 2].map(|c| {
            // The distance beyond the threshold, in units of the scale.
            let x = (distance[c] - THRESHOLD[c]) / self.scale[c];
            if x > 0.0 {
                let y = x / libm::pow(1.0 + libm::pow(x, POWER), 1.0 / POWER);
                largest - (THRESHOLD[c] + self.scale[c] * y) * largest
            } else {
                rgb[c]
            }
        })
    }
}

/// How far each channel is from the largest, relative to it.
fn distances(rgb: [f64; 3]) -> [f64; 3] {
    let largest = rgb[0].max(rgb[1]).max(rgb[2]);
    rgb.map(|v| (largest - v) / largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The farthest wavelength of each channel comes to lie on the edge, every other within.
    #[test]
    fn all_of_the_spectrum_can_be_shown_and_its_edge_is_used() {
        for space in [Space::Srgb, Space::DisplayP3] {
            let gamut = Gamut::new(space);
            let from_xyz = space.primaries().matrix_from_xyz();
            let mut least = [f64::INFINITY; 3];
            let (mut outside, mut all) = (0, 0);
            for nm in 400..=700 {
                let rgb = times(from_xyz, observer::matching(f64::from(nm)));
                let largest = rgb[0].max(rgb[1]).max(rgb[2]);
                let shown = gamut.compress(rgb);
                least = [0, 1, 2].map(|c| least[c].min(shown[c] / largest));
                outside += usize::from(rgb.iter().any(|v| *v < 0.0));
                all += 1;
            }
            assert!(outside > all * 9 / 10, "{space:?}: {outside} of {all}");
            assert!(least.iter().all(|v| v.abs() < 1e-12), "{space:?} {least:?}");
        }
    }

    #[test]
    fn colours_below_the_threshold_stay_and_order_is_kept() {
        let gamut = Gamut::new(Space::Srgb);
        for rgb in [[0.5, 0.5, 0.5], [1.0, 0.2, 0.13], [0.8, 4.0, 0.9], [0.0; 3], [-1.0, -2.0, 0.0]] {
            assert_eq!(gamut.compress(rgb), rgb);
        }
        // Scale does not matter, and what was farther stays farther.
        let mut previous = f64::INFINITY;
        for i in 0..100 {
            let red = 0.3 - 0.02 * f64::from(i);
            let [r, g, _] = gamut.compress([red, 1.0, 0.4]);
            let [twice, ..] = gamut.compress([2.0 * red, 2.0, 0.8]);
            assert!(r < previous && g == 1.0 && twice == 2.0 * r, "{red}: {r} {twice}");
            previous = r;
        }
        assert!(gamut.compress([f64::NAN, 1.0, f64::INFINITY])[2].is_infinite());
    }
}
