//! What the further channels of a picture hold, sample by sample.
//!
//! Names of channels are those of OpenEXR layers: `name.R`, `name.X`, …; components of colour are linear in the
//! primaries of the file.

use super::middle::{Covering, Middle, first_covering};
use super::plan::{EffectPlan, Integrator};
use super::ways::{Ledger, Way, Ways};
use crate::description::Quantity;
use crate::film::accumulate::{Invalid, SAMPLE_LIMIT};
use crate::film::layers::{Kept, Layout};
use crate::math::{Frame, Ray};
use crate::scene::compound::{Composition, Vertex, share};
use crate::scene::material::Material;
use crate::scene::watch::Counts;
use crate::scene::{Hit, Scene, SurfacePoint};
use crate::spectrum::{LANES, Lanes, SampledWavelengths, Spectrum, illuminant, observer};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// How light is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Red, green, blue in the primaries of the file, and coverage.
    Rgba,
    /// CIE X, Y, Z.
    Xyz,
}

/// Where the numbers of a group of channels come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The first surface that the ray meets.
    Surface(Quantity),
    /// The first surface that covers what is behind it: what the camera sees.
    Seen(Quantity),
    /// The light of an integrator: that of the picture for `None`, else one of [`LayerPlan::integrators`].
    Light(Option<usize>, Form),
    /// A band of the scene.
    Band(usize),
    /// What was counted on the way of the sample: [`NUMERICS`].
    Numerics,
    /// The part of the picture's light that came certain ways, of one group of lamps or all: in the terms of the picture.
    Ways(Ways, Option<u8>),
    /// What the ray through the middle of the pixel meets, once a pixel.
    Middle(Middle),
}

/// Components of [`Source::Numerics`], all a sample: of [`Counts`], and samples that light cannot make, by cause.
pub const NUMERICS: [&str; 8] = ["surfaces", "robust", "rays", "selfHits", "nan", "infinite", "negative", "overflow"];

/// A group of channels.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Before the dot.
    pub name: String,
    /// Its numbers.
    pub source: Source,
    /// The layer in which the squares of the numbers are channels too, if any.
    pub squares: Option<String>,
}

impl Layer {
    /// How many channels it has.
    pub(super) fn channels(&self) -> usize {
        let count = match self.source {
            Source::Surface(quantity) | Source::Seen(quantity) => quantity.components().len(),
            Source::Light(_, Form::Rgba) => 4,
            Source::Light(_, Form::Xyz) | Source::Ways(..) => 3,
            Source::Band(_) => 1,
            Source::Numerics => NUMERICS.len(),
            Source::Middle(middle) => middle.components().len(),
        };
        count * if self.squares.is_some() { 2 } else { 1 }
    }
}

/// All further channels of a picture.
#[derive(Clone, Debug)]
pub struct LayerPlan {
    /// In the order of the sums.
    pub layers: Vec<Layer>,
    /// Integrators besides the picture's own.
    pub integrators: Vec<Integrator>,
    /// From XYZ to the primaries of the file.
    pub rgb_from_xyz: [[f64; 3]; 3],
    /// In whose light colours of surfaces are seen, of luminance 1.
    pub white: Spectrum,
    /// Whether the picture is in XYZ, or its luminance; light by its ways, which adds up to it, then is, too.
    pub in_xyz: bool,
    /// Factor on light, as on the picture's own.
    pub sensitivity: f64,
    /// Light is counted over two to this power, as the film counts it: sums hold so much only.
    pub exponent: i32,
    /// Lengths are counted over two to this power.
    pub length_exponent: i32,
    /// Whether the picture's own integrator gives distances, which are no light.
    pub distances: bool,
    /// How far apart samples of a pixel stand, in pixels: 1/√n.
    pub sample_distance: f64,
    /// Whether it is noted who covers the pixels.
    pub mattes: bool,
    /// Of each object whether what it throws onto others is a caustic, where light is parted: mirrors, and glass and metal that are
    /// smooth or nearly so, as paths from the lights take them. Whether those are used changes nothing about it.
    pub sharp: Vec<bool>,
    /// Whose samples share a sum.
    pub kept: Kept,
}

impl Default for LayerPlan {
    fn default() -> LayerPlan {
        LayerPlan {
            layers: Vec::new(),
            integrators: Vec::new(),
            rgb_from_xyz: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            white: illuminant::d65(),
            in_xyz: false,
            sensitivity: 1.0,
            exponent: 0,
            length_exponent: 0,
            distances: false,
            sample_distance: 1.0,
            mattes: false,
            sharp: Vec::new(),
            kept: Kept::Together,
        }
    }
}

/// A channel and what kind of number it holds.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Channel {
    /// With the component, `nn.X`.
    pub name: String,
    /// What it holds.
    pub holds: Holds,
    /// Its sums are of the numbers over two to this power.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub exponent: i32,
}

fn is_zero(exponent: &i32) -> bool {
    *exponent == 0
}

/// What kind of number a channel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Holds {
    /// Light of a band, the mean of the samples.
    Band,
    /// Other light, the mean of the samples.
    Light,
    /// Data, the mean of the samples.
    Data,
    /// Data that stand in the pixel once.
    Once,
}

impl LayerPlan {
    /// Whether the layers hold nothing but what the picture's own light gives.
    fn own_light_only(&self) -> bool {
        let own = |layer: &Layer| !matches!(layer.source, Source::Surface(_) | Source::Seen(_));
        self.integrators.is_empty() && self.layers.iter().all(own)
    }

    /// Whether light is parted by the way it came.
    #[must_use]
    pub fn parts_light(&self) -> bool {
        self.layers.iter().any(|layer| matches!(layer.source, Source::Ways(..)))
    }

    /// The first channels, to which paths from the lights add: bands, and light by its ways.
    #[must_use]
    pub fn light_channels(&self) -> usize {
        let count = |layer: &Layer| match layer.source {
            Source::Band(_) => 1,
            Source::Ways(..) => 3,
            Source::Surface(_) | Source::Seen(_) | Source::Light(..) | Source::Numerics | Source::Middle(_) => 0,
        };
        self.layers.iter().map(count).sum()
    }

    /// How the sums are kept.
    #[must_use]
    pub fn layout(&self) -> Layout {
        let channels = self.layers.iter().map(Layer::channels).sum();
        Layout { channels, kept: self.kept }
    }

    /// Two to which power the numbers of `source` are counted over.
    fn exponent_of(&self, source: &Source) -> i32 {
        match source {
            Source::Light(None, _) | Source::Band(_) if self.distances => self.length_exponent,
            Source::Light(Some(i), _) if matches!(self.integrators[*i], Integrator::Depth) => self.length_exponent,
            Source::Surface(Quantity::Depth | Quantity::Position)
            | Source::Seen(Quantity::Depth | Quantity::Position) => self.length_exponent,
            Source::Light(..) | Source::Band(_) | Source::Ways(..) => self.exponent,
            Source::Surface(_) | Source::Seen(_) | Source::Numerics | Source::Middle(_) => 0,
        }
    }

    /// What the numbers of `source` are multiplied by on their way to the sums.
    fn unit_of(&self, source: &Source) -> f32 {
        one_over_two_to(self.exponent_of(source))
    }

    /// And the light of a further `integrator`.
    #[must_use]
    pub fn unit_of_integrator(&self, integrator: &Integrator) -> f32 {
        one_over_two_to(if matches!(integrator, Integrator::Depth) { self.length_exponent } else { self.exponent })
    }

    /// Light in the terms of the picture.
    fn as_the_picture(&self, xyz: [f32; 3]) -> [f32; 3] {
        if self.in_xyz { xyz } else { rgb(&self.rgb_from_xyz, xyz) }
    }

    /// What `light` that paths from the lights bring from a lamp of `group`, of which the film adds `xyz`, adds to these channels.
    pub fn append_traced(
        &self,
        scene: &Scene,
        wavelengths: &SampledWavelengths,
        light: Lanes,
        xyz: [f32; 3],
        group: u8,
        numbers: &mut Vec<f32>,
    ) {
        for layer in &self.layers {
            let unit = self.unit_of(&layer.source);
            match layer.source {
                Source::Band(i) => numbers.push(in_band(scene, i, wavelengths, light * unit)),
                Source::Ways(ways, of) => {
                    let counts = ways.holds(Way::Caustic) && of.is_none_or(|of| of == group);
                    let light = xyz.map(|x| x * self.sensitivity as f32);
                    numbers.extend(if counts { self.as_the_picture(light) } else { [0.0; 3] });
                }
                Source::Surface(_) | Source::Seen(_) | Source::Light(..) | Source::Numerics | Source::Middle(_) => {}
            }
        }
    }

    /// The channels in the order of the sums.
    #[must_use]
    pub fn channels(&self) -> Vec<Channel> {
        let mut all = Vec::new();
        for layer in &self.layers {
            for (name, squared) in
                [Some((&layer.name, false)), layer.squares.as_ref().map(|name| (name, true))].into_iter().flatten()
            {
                let unless_squared = |holds| if squared { Holds::Data } else { holds };
                let exponent = self.exponent_of(&layer.source);
                let exponent = if squared { 2 * (exponent + lowered(exponent)) } else { exponent };
                match layer.source {
                    Source::Surface(quantity) | Source::Seen(quantity) => {
                        let colour = quantity == Quantity::Albedo;
                        let holds = unless_squared(if colour { Holds::Light } else { Holds::Data });
                        all.extend(channels(name, quantity.components(), holds, exponent));
                    }
                    Source::Light(_, form) => {
                        let components: &[&str] = match form {
                            Form::Rgba => &["R", "G", "B", "A"],
                            Form::Xyz => &["X", "Y", "Z"],
                        };
                        all.extend(channels(name, components, unless_squared(Holds::Light), exponent));
                    }
                    Source::Band(_) => all.push(Channel { name: name.clone(), holds: Holds::Band, exponent }),
                    Source::Numerics => all.extend(channels(name, &NUMERICS, Holds::Data, exponent)),
                    Source::Ways(..) => {
                        let components = if self.in_xyz { ["X", "Y", "Z"] } else { ["R", "G", "B"] };
                        all.extend(channels(name, &components, Holds::Light, exponent));
                    }
                    Source::Middle(middle) => {
                        all.extend(channels(name, middle.components(), Holds::Once, exponent));
                    }
                }
            }
        }
        all
    }
}

/// By how many more powers of two numbers that are counted over two to the power `exponent` are divided before they are squared: where
/// light is bright, sums hold the squares of all numbers that they hold, (2³⁸ / 2²⁰)² = 2³⁶.
fn lowered(exponent: i32) -> i32 {
    if exponent > 0 { 20 } else { 0 }
}

/// A power of two, within what f32 holds.
fn one_over_two_to(exponent: i32) -> f32 {
    f32::from_bits(((127 - exponent) as u32) << 23)
}

/// Channels of the layer `name`, whose light is counted over two to the power `exponent`; coverage is no light. A component
/// without a name is the layer itself.
fn channels(name: &str, components: &[&str], holds: Holds, exponent: i32) -> impl Iterator<Item = Channel> {
    components.iter().map(move |c| {
        let name = if c.is_empty() { name.to_owned() } else { format!("{name}.{c}") };
        Channel { name, holds, exponent: if *c == "A" { 0 } else { exponent } }
    })
}

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
    /// Looks at what is more than the picture's own light: the first surface that `ray` meets, that which it shows by the
    /// numbers `u` of its crossings, and the `light` of further integrators.
    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "all that a sample is made of")]
    fn look(
        &mut self,
        scene: &Scene,
        plan: &EffectPlan,
        wavelengths: &SampledWavelengths,
        ray: &Ray,
        neighbours: impl Fn(DVec2) -> Ray,
        u: impl Fn(u32, Option<f64>) -> f64,
        light: impl Fn(&Integrator) -> Seen,
    ) {
        self.others.clear();
        self.others.extend(plan.layers.integrators.iter().map(light));
        self.surface.clear();
        let (mut met, mut seen) = (None, None);
        for layer in &plan.layers.layers {
            let (quantity, first) = match layer.source {
                Source::Surface(quantity) => (quantity, met.get_or_insert_with(|| First::met(scene, ray))),
                Source::Seen(quantity) => (quantity, seen.get_or_insert_with(|| First::seen(scene, plan, ray, &u))),
                _ => continue,
            };
            match first {
                Some(first) => {
                    first.append(scene, plan, wavelengths, ray, &neighbours, quantity, &mut self.surface);
                }
                None => self.surface.extend(quantity.components().iter().map(|_| 0.0)),
            }
        }
    }

    /// Appends the numbers of one sample. `light` gives the light of an integrator, `neighbours` the ray of a sample
    /// some pixels away, `u` the number that decides at a crossing of its ray; `counted` is what was counted on its way, and
    /// the weight of the filter.
    #[expect(clippy::too_many_arguments, reason = "all that a sample is made of")]
    #[inline]
    pub fn append(
        &mut self,
        scene: &Scene,
        plan: &EffectPlan,
        wavelengths: &SampledWavelengths,
        ray: &Ray,
        neighbours: impl Fn(DVec2) -> Ray,
        u: impl Fn(u32, Option<f64>) -> f64,
        own: Seen,
        counted: (Counts, f32),
        ledger: Option<&Ledger>,
        light: impl Fn(&Integrator) -> Seen,
    ) {
        let layers = &plan.layers;
        if !layers.own_light_only() {
            self.look(scene, plan, wavelengths, ray, neighbours, u, light);
        }
        let Values { numbers, surface, others } = self;
        let mut surface = surface.iter();
        let sensitivity = layers.sensitivity as f32;
        for layer in &layers.layers {
            let unit = layers.unit_of(&layer.source);
            let squares = layer.squares.is_some().then(|| one_over_two_to(lowered(layers.exponent_of(&layer.source))));
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
                    let xyz = seen.xyz.map(|x| x * sensitivity);
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
                    let xyz = observer::xyz(light * unit, wavelengths).map(|x| x * sensitivity);
                    numbers.extend(layers.as_the_picture(xyz));
                }
                // These stand in the pixel once.
                Source::Middle(middle) => numbers.extend(middle.components().iter().map(|_| 0.0)),
                Source::Numerics => {
                    let squares = squares.map(|factor| [factor; NUMERICS.len()]);
                    put(numbers, own.numerics(counted.0, counted.1), squares);
                }
            }
        }
    }
}

/// What `light` adds to a band.
fn in_band(scene: &Scene, band: usize, wavelengths: &SampledWavelengths, light: Lanes) -> f32 {
    let counted = light * wavelengths.inv_pdf * scene.bands[band].response.eval(wavelengths.nm);
    counted.reduce_add() / LANES as f32
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

fn rgb(matrix: &[[f64; 3]; 3], xyz: [f32; 3]) -> [f32; 3] {
    let xyz = xyz.map(f64::from);
    matrix.map(|row| (row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]) as f32)
}

/// The first surface that a camera ray meets, or shows.
struct First {
    hit: Hit,
    surface: SurfacePoint,
    /// Its normal in light, where it is what the ray shows.
    normal: Option<DVec3>,
}

impl First {
    fn met(scene: &Scene, ray: &Ray) -> Option<First> {
        let hit = scene.closest(ray, scene.camera.reach(ray))?;
        Some(First { hit, surface: scene.surface_with_texture(ray, &hit), normal: None })
    }

    fn seen(scene: &Scene, plan: &EffectPlan, ray: &Ray, u: impl Fn(u32, Option<f64>) -> f64) -> Option<First> {
        let Covering { hit, surface, normal } = first_covering(scene, plan, ray, u)?;
        Some(First { hit, surface, normal: Some(normal) })
    }

    #[expect(clippy::too_many_arguments, reason = "all that a sample is made of")]
    fn append(
        &self,
        scene: &Scene,
        plan: &EffectPlan,
        wavelengths: &SampledWavelengths,
        ray: &Ray,
        neighbours: &impl Fn(DVec2) -> Ray,
        quantity: Quantity,
        values: &mut Vec<f32>,
    ) {
        let surface = &self.surface;
        let three = |v: DVec3| v.to_array().map(|x| x as f32);
        match quantity {
            Quantity::Depth => values.push(self.hit.t as f32),
            Quantity::Position => values.extend(three(surface.point)),
            Quantity::Uv => values.extend(surface.uv.to_array().map(|x| x as f32)),
            Quantity::GeometricNormal => values.extend(three(surface.normal)),
            Quantity::ShadingNormal => {
                values.extend(three(self.normal.unwrap_or_else(|| self.shading_normal(scene, ray))));
            }
            Quantity::DpDu | Quantity::DpDv => {
                let [du, dv] = scene.uv_gradient(&self.hit, surface).partials();
                values.extend(three(if quantity == Quantity::DpDu { du } else { dv }));
            }
            Quantity::DuvDx | Quantity::DuvDy => {
                let step = if quantity == Quantity::DuvDx { DVec2::X } else { DVec2::Y };
                let other = neighbours(step * plan.layers.sample_distance);
                let change = self.uv_change(scene, &other);
                values.extend(change.to_array().map(|x| x as f32));
            }
            Quantity::Albedo => {
                let mut albedo = self.albedo(scene, plan, wavelengths.nm, ray);
                // Of what is seen in the light of day, so that grey is grey.
                if self.normal.is_some() {
                    albedo *= plan.layers.white.eval(wavelengths.nm);
                }
                let xyz = observer::xyz(albedo, wavelengths);
                values.extend(rgb(&plan.layers.rgb_from_xyz, xyz));
            }
            Quantity::Primitive => values.push(self.hit.part as f32),
            Quantity::Shape => values.push((self.hit.object + 1) as f32),
        }
    }

    /// How much u and v change from this point to where another ray meets the tangent plane.
    fn uv_change(&self, scene: &Scene, other: &Ray) -> DVec2 {
        let n = self.surface.normal;
        let distance = (self.surface.point - other.origin).dot(n) / other.direction.dot(n);
        let change = scene.uv_gradient(&self.hit, &self.surface).change(other.at(distance) - self.surface.point);
        if change.is_finite() { change } else { DVec2::ZERO }
    }

    /// The normal of the outermost relief, or the interpolated one.
    fn shading_normal(&self, scene: &Scene, ray: &Ray) -> DVec3 {
        let (surface, hit) = (&self.surface, &self.hit);
        let material = &scene.materials[scene.objects[hit.object as usize].material as usize];
        let relief = material.compound().filter(|c| matches!(c.composition, Composition::Relief { .. }));
        let vertex = Vertex { scene, hit, surface, at: &hit.texture_point(surface), wo: -ray.direction };
        let leaf = relief.and_then(|compound| compound.resolve(&vertex, surface.shading_normal, 0.5));
        leaf.map_or(surface.shading_normal, |leaf| leaf.frame.n)
    }

    /// The colour of the material: see [`Quantity::Albedo`].
    fn albedo(&self, scene: &Scene, plan: &EffectPlan, nm: Lanes, ray: &Ray) -> Lanes {
        let object = &scene.objects[self.hit.object as usize];
        let material = &scene.materials[object.material as usize];
        self.albedo_of(material, plan, nm, ray)
    }

    fn albedo_of(&self, material: &Material, plan: &EffectPlan, nm: Lanes, ray: &Ray) -> Lanes {
        let surface = &self.surface;
        if let Some(compound) = material.compound() {
            let inner = |material: &Material| self.albedo_of(material, plan, nm, ray);
            return match &compound.composition {
                Composition::Mask { inner: material, .. } | Composition::Relief { inner: material, .. } => {
                    inner(material)
                }
                Composition::Blend { weight, first, second } => {
                    let at = self.hit.texture_point(surface);
                    let mut w = share(weight, &at);
                    // What is seen is no hole: each part counts by how much of it covers.
                    if self.normal.is_some() {
                        let covers = |part: &Material| 1.0 - part.open(surface, ray.direction, &at);
                        let [first, second] = [(1.0 - w) * covers(first), w * covers(second)];
                        w = if first + second > 0.0 { second / (first + second) } else { w };
                    }
                    let w = w as f32;
                    inner(first) * (1.0 - w) + inner(second) * w
                }
                Composition::TwoSided { front, back } => {
                    inner(if ray.direction.dot(surface.normal) > 0.0 { back } else { front })
                }
            };
        }
        let bsdf = material.bsdf(&self.hit.texture_point(surface), nm, plan.all_dispersive);
        let frame = Frame::from_normal_and_tangent(surface.shading_normal, surface.tangent);
        let mut wo = frame.to_local(-ray.direction);
        match bsdf.base() {
            // Mitsuba's stand-in where nothing is diffuse, as if all light came along the normal: a highlight.
            None if self.normal.is_none() => {
                if material.two_sided {
                    wo.z = wo.z.abs();
                }
                bsdf.eval(wo, DVec3::Z).f * PI as f32
            }
            _ => bsdf.albedo(wo),
        }
    }
}
