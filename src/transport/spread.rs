//! Numbers of samples that fill [0, 1) evenly, all together and in any part of a pixel.

use crate::math::sampler::GOLDEN;

/// The inverse of the plastic number, the real root of x³ = x + 1: its multiples are spread as evenly, and have little to do with
/// those of [`GOLDEN`].
const PLASTIC: f64 = 0.754_877_666_246_692_8;

/// How the numbers of samples are spread over [0, 1).
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    count: u32,
    step: u32,
}

impl Spread {
    /// Of `count` samples, by steps next to `part` of them and coprime. With a part that fractions approximate badly the numbers of
    /// neighbouring rows or columns of a pixel are spread nearly as evenly as all, so that what covers them meets its share.
    fn new(count: u32, part: f64) -> Spread {
        let is_coprime = |step: &u32| {
            let (mut a, mut b) = (*step, count);
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a == 1
        };
        let near = (part * f64::from(count)).round() as u32;
        // count + 1 is.
        let step = (near..=count + 1).find(is_coprime).unwrap_or(1);
        Spread { count, step }
    }

    /// That of what decides in holes of masks.
    pub(super) fn of_holes(count: u32) -> Spread {
        Spread::new(count, GOLDEN)
    }

    /// That of wavelengths.
    #[must_use]
    pub fn of_wavelengths(count: u32) -> Spread {
        Spread::new(count, PLASTIC)
    }

    /// Of the numbers (k + 1/2)/n that of sample `s`: k = s · step mod n.
    pub(super) fn at(self, s: u32) -> f64 {
        let k = u64::from(s) * u64::from(self.step) % u64::from(self.count);
        (k as f64 + 0.5) / f64::from(self.count)
    }
}
