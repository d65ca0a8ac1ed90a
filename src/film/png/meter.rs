//! The exposure that suits a picture, as a light meter would say.
//!
//! The log-average luminance of the picture comes to be shown as middle grey, 0.18 of white (Reinhard et al. 2002, eqs. 1 and
//! 2, with the tone curve undone), where the average is over the pixels between two percentiles: black has no logarithm, and neither a lamp in the picture nor the
//! darkness around a scene should decide. Counted in bins of 1/32 stop, so that the order of pixels does not matter.

use super::{Space, Tonemap, tone::Tone};
use crate::film::resolve::Image;
use rayon::prelude::*;

/// Middle grey, the "key value" of the paper.
const KEY: f64 = 0.18;
/// Of the pixels that shine: the darkest and the brightest that count.
const PERCENTILES: [f64; 2] = [0.20, 0.98];
/// Bins of a stop.
const FINE: f64 = 32.0;
/// Stops below 1 at which bins begin, and how many there are: all of f32.
const DARKEST: f64 = -150.0;
const BINS: usize = 280 * FINE as usize;

/// Stops, to a hundredth, by which `tonemap` shows `image` in middle grey; `luminance` are the weights of its channels. 0
/// where nothing shines.
#[must_use]
pub fn stops(image: &Image, luminance: [f64; 3], tonemap: Tonemap) -> f64 {
    let bin = |i: usize| {
        let y: f64 = [0, 1, 2].iter().map(|&c| luminance[c] * f64::from(image.rgb[c][i])).sum();
        (y > 0.0 && y.is_finite()).then(|| ((libm::log2(y) - DARKEST) * FINE).clamp(0.0, (BINS - 1) as f64) as usize)
    };
    let count = |mut bins: Vec<u64>, i: usize| {
        if let Some(at) = bin(i) {
            bins[at] += 1;
        }
        bins
    };
    let add = |mut a: Vec<u64>, b: Vec<u64>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    };
    let bins = (0..image.rgb[0].len())
        .into_par_iter()
        .with_min_len(1 << 16)
        .fold(|| vec![0u64; BINS], count)
        .reduce(|| vec![0u64; BINS], add);

    let all: u64 = bins.iter().sum();
    let [low, high] = PERCENTILES.map(|share| share * all as f64);
    let (mut below, mut sum, mut weight) = (0.0, 0.0, 0.0);
    for (at, &n) in bins.iter().enumerate() {
        // How many of the bin lie between the percentiles.
        let counted = ((below + n as f64).min(high) - f64::max(below, low)).max(0.0);
        sum += counted * (DARKEST + (at as f64 + 0.5) / FINE);
        weight += counted;
        below += n as f64;
    }
    if weight == 0.0 {
        return 0.0;
    }
    ((libm::log2(Tone::new(tonemap, Space::Srgb).grey_shown_as(KEY)) - sum / weight) * 100.0).round() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::png::tests::grey;
    use crate::spectrum::luminance::REC709;

    /// A grey of 0.18 needs none, one of 0.045 two stops: half a bin, 1/64 stop, is lost to the bins and 1/200 to rounding.
    #[test]
    fn an_even_grey_becomes_middle_grey() {
        for (value, expected) in [(0.18, 0.0), (0.045, 2.0), (0.18 * 1024.0, -10.0)] {
            let found = stops(&grey(value, 20), REC709, Tonemap::None);
            assert!((found - expected).abs() <= 1.0 / 64.0 + 0.005, "{value}: {found}");
        }
        assert_eq!(stops(&grey(0.0, 4), REC709, Tonemap::None), 0.0);
        assert_eq!(stops(&grey(f32::NAN, 4), REC709, Tonemap::None), 0.0);
    }

    /// A lamp over a hundredth of the picture, a tenth of it in deep shadow and a quarter black: none of them moves the exposure of the
    /// rest.
    #[test]
    fn neither_a_lamp_nor_the_dark_decides() {
        let mut image = grey(0.18, 100);
        let even = stops(&image, REC709, Tonemap::None);
        for plane in &mut image.rgb {
            plane[..100].fill(1e6);
            plane[6500..7500].fill(1e-4);
            plane[7500..].fill(0.0);
        }
        assert!((stops(&image, REC709, Tonemap::None) - even).abs() < 1e-12);
    }

    #[test]
    fn twice_the_light_is_a_stop_less() {
        let mut image = grey(0.0, 30);
        for (i, v) in (0u16..).zip(&mut image.rgb[1]) {
            *v = f32::from(i % 97) * 0.01;
        }
        let base = stops(&image, REC709, Tonemap::None);
        image.rgb[1].iter_mut().for_each(|v| *v *= 2.0);
        assert!((stops(&image, REC709, Tonemap::None) - (base - 1.0)).abs() < 1e-9);
    }
}
