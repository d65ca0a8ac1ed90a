//! Which light a point asks: that which may give it the most.
//!
//! A light is chosen with a probability near to its share of the light that would arrive if nothing stood in the way
//! (Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting", without the
//! splitting): intensity over squared distance, with the largest cosines that lamp and surface can have. Lights with a
//! place hang in a tree of eight children a node, all judged at once; light from infinity is judged beside the root.
//! Up to eight lamps are thus judged one by one.
//!
//! The judgement knows no shadows, so a sixteenth of the choices are made by power alone, as if the point were unknown.
//! Any probabilities are right as long as they are known exactly; these are computed in f32 by the same operations
//! whenever they are asked for.

mod gift;
mod tree;

pub use tree::{Choice, Frame};

use glam::DVec3;
use tree::{Asking, Root};

/// The share of choices that are made without regard to the point.
const BY_POWER: f64 = 1.0 / 16.0;

/// A point that asks for light, and how it judges the lights.
#[derive(Clone, Debug)]
pub struct Asker {
    /// Where it is.
    pub point: DVec3,
    /// The normal of the side that it asks for, if it is of one.
    pub normal: Option<DVec3>,
    judged: Option<(Asking, Root)>,
}

impl Asker {
    /// What all lights together may give, as they are judged; zero where one need not choose.
    #[must_use]
    pub fn judged(&self) -> f32 {
        self.judged.as_ref().map_or(0.0, |(_, root)| root.sum)
    }
}

/// How one of the lights that are asked is chosen.
#[derive(Clone, Debug)]
pub struct Asked {
    /// Without regard to the point: running sums of probabilities.
    by_power: Vec<f64>,
    /// At a point; `None` where all choose alike.
    at_point: Option<Choice>,
}

impl Asked {
    /// By the running sums `by_power` and, at a point, by `at_point`.
    #[must_use]
    pub fn new(by_power: Vec<f64>, at_point: Option<Choice>) -> Asked {
        Asked { by_power, at_point }
    }

    /// Whether no light is ever asked.
    #[must_use]
    pub fn is_nobody(&self) -> bool {
        self.by_power.last().is_none_or(|&all| all <= 0.0)
    }

    /// A light chosen by `u` in [0, 1) without regard to the point, and the probability of that.
    #[must_use]
    pub fn chosen_by_power(&self, u: f64) -> Option<(usize, f64)> {
        let i = self.by_power.partition_point(|&sum| sum <= u);
        (i < self.by_power.len()).then(|| (i, self.share_of_power(i)))
    }

    /// The probability of [`Asked::chosen_by_power`] for light `i`.
    #[must_use]
    pub fn share_of_power(&self, i: usize) -> f64 {
        self.by_power[i] - if i == 0 { 0.0 } else { self.by_power[i - 1] }
    }

    /// Judges the lights from `point`. With `normal` light is wanted on that side of a surface only.
    #[must_use]
    #[inline(always)]
    pub fn asker(&self, point: DVec3, normal: Option<DVec3>) -> Asker {
        Asker { point, normal, judged: self.at_point.as_ref().and_then(|choice| choice.judge(point, normal)) }
    }

    /// A light chosen by `u` in [0, 1) for `asker`, and the probability of that.
    #[must_use]
    #[inline(always)]
    pub fn choose(&self, asker: &Asker, u: impl FnOnce() -> f64) -> Option<(usize, f64)> {
        // One alone needs no number.
        if let [all] = self.by_power[..]
            && all >= 1.0
        {
            return Some((0, all));
        }
        self.choose_among(asker, u())
    }

    #[inline(never)]
    fn choose_among(&self, asker: &Asker, u: f64) -> Option<(usize, f64)> {
        let (Some(choice), Some((asking, root))) = (&self.at_point, &asker.judged) else {
            return self.chosen_by_power(u);
        };
        let mixed = |i: usize, there: f64| mixed(self.share_of_power(i), there);
        if u < BY_POWER {
            let (i, _) = self.chosen_by_power(u / BY_POWER)?;
            return Some((i, mixed(i, choice.probability(asking, root, i as u32))));
        }
        let (i, there) = choice.choose(asking, root, (u - BY_POWER) / (1.0 - BY_POWER))?;
        Some((i as usize, mixed(i as usize, there)))
    }

    /// The probability of [`Asked::choose`] for light `i`, and what that `judged`: zero where it is not known.
    #[must_use]
    pub fn probability(&self, i: usize, point: DVec3, normal: Option<DVec3>, judged: f32) -> f64 {
        let alone = self.share_of_power(i);
        let Some(choice) = &self.at_point else { return alone };
        // What has no share by power has no weight anywhere.
        if alone <= 0.0 {
            return 0.0;
        }
        let asking = choice.asking(point, normal);
        choice.probability_at(&asking, i as u32, judged).map_or(alone, |there| mixed(alone, there))
    }
}

/// The probability of a light that by power alone has one of `alone`, and at a point one of `there`.
fn mixed(alone: f64, there: f64) -> f64 {
    BY_POWER * alone + (1.0 - BY_POWER) * there
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::scene::compile::testing::compiled;
    use crate::scene::environment::Drawn;
    use crate::scene::light::Light;
    use crate::scene::shape::testing::Random;

    fn scene(lights: &str, shapes: &str) -> Scene {
        let text = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nlights:\n{lights}shapes:\n\
             - sphere: {{center: [0, 0, 0], radius: 1, material: {{diffuse: {{}}}}}}\n{shapes}"
        );
        compiled(&text)
    }

    fn point(x: f64, y: f64, z: f64, intensity: f64) -> String {
        format!("- point: {{position: [{x}, {y}, {z}], intensity: {intensity}}}\n")
    }

    /// One of each kind.
    fn all_kinds() -> Scene {
        let lights = "- point: {position: [0, 4, 1], intensity: 3}\n\
            - spot: {position: [3, 3, 0], target: [0, 0, 0], cutoff_deg: 25, intensity: 20}\n\
            - directional: {direction: [0, -1, 0.2], irradiance: 0.3}\n\
            - projector: {origin: [-3, 1, 2], target: [0, 0, 0], up: [0, 1, 0], fov_deg: 30, irradiance: 2}\n\
            - constant: {radiance: 0.1}\n";
        let shapes = "- rectangle: {corner: [-1, 3, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], material: {diffuse: {}}, \
             emission: 2}\n\
            - disk: {center: [4, 0, 0], normal: [-1, 0, 0], radius: 0.5, material: {diffuse: {}}, \
             emission: 9}\n\
            - sphere: {center: [-4, 1, -2], radius: 0.2, material: {diffuse: {}}, emission: 90}\n\
            - cylinder: {base: [0, -3, 1], top: [1, -3, 1], radius: 0.1, material: {diffuse: {}}, \
             emission: 30}\n";
        scene(lights, shapes)
    }

    fn lamps_in_a_cube(count: usize) -> Scene {
        let mut random = Random::new(3);
        let mut lights = String::new();
        for _ in 0..count {
            let at = random.direction() * 8.0 * random.uniform();
            lights += &point(at.x, at.y, at.z, 0.1 + random.uniform());
        }
        scene(&lights, "")
    }

    /// Numbers evenly spread over [0, 1) choose each light as often as its probability says, and the probabilities are
    /// one together: whatever the point, with and without a normal. Some numbers choose none, where a group of lamps
    /// turns out to be behind the surface. Each of `N` numbers stands for 1/N; a light is chosen on two intervals at
    /// most, whose ends each count for one number too many or too few.
    #[test]
    fn lights_are_chosen_as_often_as_is_said() {
        const N: u32 = 20_000;
        let mut random = Random::new(11);
        for scene in [all_kinds(), lamps_in_a_cube(40)] {
            assert!(scene.asked(true).at_point.is_some());
            for k in 0..20 {
                let at = random.direction() * 6.0 * random.uniform();
                let normal = (k % 2 == 0).then(|| random.direction());
                let mut counts = vec![0u32; scene.lights.len()];
                let asker = scene.asked(true).asker(at, normal);
                for j in 0..N {
                    let u = (f64::from(j) + 0.5) / f64::from(N);
                    let Some((i, p)) = scene.asked(true).choose(&asker, || u) else { continue };
                    for known in [asker.judged(), 0.0] {
                        let said = scene.asked(true).probability(i, at, normal, known);
                        assert!((p / said - 1.0).abs() < 1e-12, "{p} {said}");
                    }
                    counts[i] += 1;
                }
                let probabilities: Vec<f64> =
                    (0..scene.lights.len()).map(|i| scene.asked(true).probability(i, at, normal, 0.0)).collect();
                let none = 1.0 - f64::from(counts.iter().sum::<u32>()) / f64::from(N);
                let ends = 16.0 / f64::from(N);
                assert!((probabilities.iter().sum::<f64>() + none - 1.0).abs() < ends, "{probabilities:?} {none}");
                assert!(normal.is_some() || none == 0.0);
                for (count, p) in counts.iter().zip(&probabilities) {
                    assert!((f64::from(*count) / f64::from(N) - p).abs() < 5.0 / f64::from(N), "{count} {p}");
                }
            }
        }
    }

    /// A light that can arrive at a point is never out of the choice's reach by more than the share by power: no weight
    /// is zero where light arrives. Points all around, normals all around, points of the light all over.
    #[test]
    fn what_arrives_weighs_something() {
        let scene = all_kinds();
        let choice = scene.asked(true).at_point.as_ref().unwrap();
        let mut random = Random::new(5);
        let mut arrived = vec![0; scene.lights.len()];
        for _ in 0..20_000 {
            let at = random.direction() * 6.0 * random.uniform();
            let normal = random.direction();
            let (asking, nm) = (choice.asking(at, Some(normal)), crate::spectrum::Lanes::splat(550.0));
            for (i, light) in scene.lights.iter().enumerate() {
                let u = glam::DVec2::new(random.uniform(), random.uniform());
                let Some(found) = light.arriving(&scene.objects, at, Some(normal), u, Drawn::Brighter, nm) else {
                    continue;
                };
                // Further above the horizons than f32 is good to.
                if found.wi.dot(normal) < 1e-3 || !found.radiance.simd_gt(crate::spectrum::Lanes::splat(1e-3)).all() {
                    continue;
                }
                arrived[i] += 1;
                let root = choice.root(&asking).unwrap();
                assert!(choice.probability(&asking, &root, i as u32) > 0.0, "{i} {at} {normal}");
            }
        }
        assert!(arrived.iter().all(|&n| n > 100), "{arrived:?}");
    }

    /// Two equal lamps at distances 1 and 3: nine to one, but for the share by power; also beside something that stands far away.
    #[test]
    fn the_nearer_of_two_equal_lamps_is_chosen_by_the_square_of_the_distance() {
        let far = |distance: &str| {
            format!("- sphere: {{center: [0, -{distance}, 0], radius: 1, material: {{diffuse: {{}}}}}}\n")
        };
        for (shapes, off) in [(String::new(), 1e-6), (far("1.0e4"), 1e-3), (far("1.0e8"), 1e-6), (far("1.0e30"), 1e-6)]
        {
            let scene = scene(&(point(1.0, 3.0, 0.0, 1.0) + &point(-3.0, 3.0, 0.0, 1.0)), &shapes);
            let p = scene.asked(true).probability(0, DVec3::new(0.0, 3.0, 0.0), None, 0.0);
            assert!((p - (BY_POWER * 0.5 + (1.0 - BY_POWER) * 0.9)).abs() < off, "{shapes}{p}");
        }
    }

    /// Of a thousand lamps in a cloud the mean over lamps of (share of the light / probability) · share, which is the
    /// second moment of the estimate without shadows over the square of its mean, is within 2: choosing by power alone
    /// it is more than 5.
    #[test]
    fn a_thousand_lamps_are_chosen_nearly_by_what_arrives() {
        let scene = lamps_in_a_cube(1000);
        let mut random = Random::new(17);
        let (mut here, mut by_power) = (0.0, 0.0);
        for _ in 0..50 {
            let at = random.direction() * 8.0 * random.uniform();
            let nm = crate::spectrum::Lanes::splat(550.0);
            let arriving = |light: &Light| light.arriving(&scene.objects, at, None, glam::DVec2::ZERO, Drawn::All, nm);
            let light: Vec<f64> =
                scene.lights.iter().map(|l| arriving(l).map_or(0.0, |a| a.radiance.to_array()[0].into())).collect();
            let total: f64 = light.iter().sum();
            for (i, x) in light.iter().enumerate() {
                let share = x / total;
                here += share * share / scene.asked(true).probability(i, at, None, 0.0) / 50.0;
                by_power += share * share / scene.light_probability(i) / 50.0;
            }
        }
        assert!(here < 2.0 && by_power > 5.0, "{here} {by_power}");
    }
}
