//! The numbers that the layers of a picture have of each sample.

use super::first::First;
use super::{Form, NUMERICS, Source, in_band, one_over_two_to, rgb};
use crate::film::accumulate::{Invalid, SAMPLE_LIMIT};
use crate::math::Ray;
use crate::scene::Scene;
use crate::scene::watch::Counts;
use crate::spectrum::{Lanes, SampledWavelengths, observer};
use crate::transport::plan::{EffectPlan, Integrator};
use crate::transport::ways::Ledger;
use glam::DVec2;

/// One sample of light, for layers.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Radiance.
    pub radiance: Lanes,
    /// CIE XYZ of it, as sums count it.
    pub xyz: [f32; 3],
    /// Coverage.
    pub alpha: f32,
}

impl Seen {
    /// The numbers of [`NUMERICS`], which the film multiplies with the filter's `weight`: they are no light.
    fn numerics(&self, counted: Counts, weight: f32) -> [f32; 8] {
        let is_too_large = |x: &f32| (x * weight).abs() >= SAMPLE_LIMIT;
        let overflow = || self.xyz.iter().any(is_too_large).then_some(Invalid::Overflow);
        let invalid = Invalid::of(self.radiance).or_else(overflow);
        let is = |cause| u64::from(invalid == Some(cause));
        let Counts { surfaces, robust, rays, self_hits } = counted;
        let causes = [Invalid::Nan, Invalid::Infinite, Invalid::Negative, Invalid::Overflow].map(is);
        let [nan, infinite, negative, overflow] = causes;
        [surfaces, robust, rays, self_hits, nan, infinite, negative, overflow].map(|n| n as f32 / weight)
    }
}

/// A sample of the camera, for layers.
pub struct Sampled<'a, N, U> {
    /// What it was taken of.
    pub scene: &'a Scene,
    /// What is simulated, and the layers.
    pub plan: &'a EffectPlan,
    /// Its wavelengths.
    pub wavelengths: &'a SampledWavelengths,
    /// Its ray.
    pub ray: &'a Ray,
    /// The ray of a sample some pixels away.
    pub neighbours: N,
    /// The number that decides at a crossing of its ray.
    pub u: U,
    /// Its light.
    pub own: Seen,
    /// What was counted on its way.
    pub counted: Counts,
    /// The weight of the filter.
    pub weight: f32,
    /// Its light by the way it came, where that is parted.
    pub ledger: Option<&'a Ledger>,
}

/// The numbers of samples, each in the order of the channels.
#[derive(Debug, Default)]
pub struct Values {
    /// The numbers.
    pub numbers: Vec<f32>,
    /// What one sample sees of the first surface, in the order of the layers.
    surface: Vec<f32>,
    /// Its light of the further integrators.
    others: Vec<Seen>,
}

impl Values {
    /// Looks at what is more than the picture's own light: the first surface that the ray of a sample meets, that which it
    /// shows, and the `light` of further integrators.
    #[inline(never)]
    fn look(
        &mut self,
        sample: &Sampled<impl Fn(DVec2) -> Ray, impl Fn(u32, Option<f64>) -> f64>,
        light: impl Fn(&Integrator) -> Seen,
    ) {
        let Sampled { scene, plan, ray, .. } = *sample;
        self.others.clear();
        self.others.extend(plan.layers.integrators.iter().map(light));
        self.surface.clear();
        let (mut met, mut seen) = (None, None);
        for layer in &plan.layers.layers {
            let (quantity, first) = match layer.source {
                Source::Surface(quantity) => (quantity, met.get_or_insert_with(|| First::met(scene, ray))),
                Source::Seen(quantity) => {
                    (quantity, seen.get_or_insert_with(|| First::seen(scene, plan, ray, &sample.u)))
                }
                _ => continue,
            };
            match first {
                Some(first) => first.append(sample, quantity, &mut self.surface),
                None => self.surface.extend(quantity.components().iter().map(|_| 0.0)),
            }
        }
    }

    /// Appends the numbers of one sample. `light` gives the light of a further integrator.
    #[inline]
    pub fn append(
        &mut self,
        sample: &Sampled<impl Fn(DVec2) -> Ray, impl Fn(u32, Option<f64>) -> f64>,
        light: impl Fn(&Integrator) -> Seen,
    ) {
        let Sampled { scene, wavelengths, own, counted, weight, ledger, .. } = *sample;
        let layers = &sample.plan.layers;
        if !layers.own_light_only() {
            self.look(sample, light);
        }
        let Values { numbers, surface, others } = self;
        let mut surface = surface.iter();
        let (gain, _) = layers.gain();
        for layer in &layers.layers {
            let unit = layers.unit_of(&layer.source);
            let squares = layer.squares.is_some().then(|| one_over_two_to(layers.powers_of(&layer.source).squared));
            match layer.source {
                Source::Surface(quantity) | Source::Seen(quantity) => {
                    let count = quantity.components().len();
                    let start = numbers.len();
                    numbers.extend(surface.by_ref().take(count).map(|x| x * unit));
                    if let Some(factor) = squares {
                        numbers.extend_from_within(start..);
                        numbers[start + count..].iter_mut().for_each(|x| *x = (*x * factor) * (*x * factor));
                    }
                }
                Source::Light(of, form) => {
                    let seen = of.map_or(own, |i| others[i]);
                    let xyz = seen.xyz.map(|x| x * gain);
                    match form {
                        Form::Xyz => put(numbers, xyz, squares.map(|factor| [factor; 3])),
                        Form::Rgba => {
                            let [r, g, b] = rgb(&layers.rgb_from_xyz, xyz);
                            put(numbers, [r, g, b, seen.alpha], squares.map(|factor| [factor, factor, factor, 1.0]));
                        }
                    }
                }
                Source::Band(i) => {
                    put(numbers, [in_band(scene, i, wavelengths, own.radiance * unit)], squares.map(|factor| [factor]));
                }
                Source::Ways(ways, group) => {
                    let light = ledger.map_or(Lanes::ZERO, |ledger| ledger.light(ways, group));
                    let xyz = observer::xyz(light * unit, wavelengths).map(|x| x * gain);
                    numbers.extend(layers.as_the_picture(xyz));
                }
                // These stand in the pixel once.
                Source::Middle(middle) => numbers.extend(middle.components().iter().map(|_| 0.0)),
                Source::Numerics => {
                    let squares = squares.map(|factor| [factor; NUMERICS.len()]);
                    put(numbers, own.numerics(counted, weight), squares);
                }
            }
        }
    }
}

/// Appends `values`, and the squares of so many times each if they are wanted.
#[inline]
fn put<const N: usize>(numbers: &mut Vec<f32>, values: [f32; N], squares: Option<[f32; N]>) {
    numbers.extend_from_slice(&values);
    if let Some(factors) = squares {
        let lowered = values.iter().zip(factors).map(|(x, factor)| x * factor);
        numbers.extend(lowered.map(|x| x * x));
    }
}
