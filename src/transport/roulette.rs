//! Russian roulette: the chance that a path goes on, from the camera or from a light.

/// Vertices up to which a path that has lost nothing goes on for sure: clear glass then shows what
/// is behind it without the noise of roulette, in every sample.
const FOR_SURE: u32 = 256;

/// How much more than it carries a path's chance to go on is: what is left of it is worth more than its end saves. Error² ×
/// time is 0.87 to 0.99 of that with a chance that is what it carries (`tools/bench/NOTES.md`).
const SPARED: f64 = 2.0;

/// The chance by Russian roulette that a path of `vertices` goes on which has `carried` of what it began with, after one that
/// mirrors or refracts (`discrete`) or one that scatters over a density.
///
/// Beyond [`FOR_SURE`] none goes on for sure: one in five hundred is ended at each vertex that scatters over a density, as light
/// in a thick cloud goes through thousands, and one in fifty at each that mirrors or refracts: light that is trapped
/// between perfect mirrors or in a ball of glass costs some hundred vertices more, not for ever. Of those that carry more than they
/// began with, as others have ended for them, the fewer the more they carry, by the root: with a share e that ends, (1 + e n / 2)⁻² are
/// left after n vertices, 2 / e in all, and what one carries grows as n², where with e alone it would grow as exp(e n).
pub(super) fn survival(carried: f64, vertices: u32, discrete: bool) -> f64 {
    let ends = match (vertices < FOR_SURE, discrete) {
        (true, _) => 0.0,
        (false, true) => 0.02,
        (false, false) => 0.002,
    };
    (SPARED * carried).min(1.0 - ends / carried.max(1.0).sqrt())
}

/// Within how many times the distance where a medium first scattered a path, or of all that shines, it goes on as anywhere. With one
/// the error² of thin fog between walls is doubled, with four endless fog takes twice the time (`tools/bench/NOTES.md`).
const AROUND: f64 = 2.0;

/// What going on is worth for a path that a medium scatters at `distance` from the middle of the scene, over where one first did; light
/// comes from, or is seen from, `within` a distance. `near` is the path's own, zero before.
///
/// In an endless medium that takes nothing away, a path comes back from `distance` with a chance that goes as its inverse, and its
/// way back goes as its square. The chance to go on that is most efficient goes as the root of the expected square over the
/// expected cost (Rath et al. 2022).
pub(super) fn worth(near: &mut f64, within: impl FnOnce() -> f64, distance: f64) -> f64 {
    if *near == 0.0 {
        *near = AROUND * distance.max(within());
    }
    let share = (*near / distance).min(1.0);
    share * share.sqrt()
}

#[cfg(test)]
mod tests {
    use super::{FOR_SURE, survival};

    /// Of trapped light that loses nothing (1 + e n / 2)⁻² goes on to the n-th vertex, to the first order in e, with as much more: after
    /// 1000 of glass a 121st, where e alone would leave a part in 6e8.
    #[test]
    fn what_trapped_light_carries_grows_as_a_square() {
        for (discrete, ends) in [(true, 0.02), (false, 0.002)] {
            let mut carried = 1.0;
            for n in 0..1000 {
                carried /= survival(carried, FOR_SURE + n, discrete);
            }
            let expected = (1.0 + 0.5 * ends * 1000.0_f64).powi(2);
            assert!((carried / expected - 1.0).abs() < ends, "{carried} for {expected}");
        }
        assert_eq!(survival(5.0, FOR_SURE - 1, true), 1.0);
        assert_eq!(survival(0.1, FOR_SURE, true), 0.2);
    }
}
