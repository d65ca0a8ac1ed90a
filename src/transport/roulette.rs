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
/// Beyond [`FOR_SURE`] none goes on for sure: one in a thousand is ended at each vertex that scatters over a density, as light
/// in a thick cloud goes through thousands, and one in a hundred at each that mirrors or refracts: light that is trapped
/// between perfect mirrors or in a ball of glass costs some hundred vertices more, not for ever.
pub(super) fn survival(carried: f64, vertices: u32, discrete: bool) -> f64 {
    let longest = match (vertices < FOR_SURE, discrete) {
        (true, _) => 1.0,
        (false, true) => 0.99,
        (false, false) => 0.999,
    };
    (SPARED * carried).min(longest)
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
