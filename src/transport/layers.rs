//! What the further channels of a picture hold, sample by sample.
//!
//! Names of channels are those of OpenEXR layers: `name.R`, `name.X`, …; components of colour are linear in the
//! primaries of the file.

mod first;
mod values;

pub use values::{Sampled, Seen, Values};

use super::middle::Middle;
use super::plan::Integrator;
use super::ways::{Way, Ways};
use crate::description::Quantity;
use crate::film::layers::{Kept, Layout};
use crate::scene::Scene;
use crate::scene::brightness::Powers;
use crate::spectrum::{LANES, Lanes, SampledWavelengths, Spectrum, illuminant};

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

/// Components of [`Source::Numerics`], all a sample: of [`watch::Counts`](crate::scene::watch::Counts), and samples that light cannot make, by cause.
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
    /// Light is counted over these powers of two, as the film counts it: sums hold so much only.
    pub light: Powers,
    /// Lengths are counted over these.
    pub lengths: Powers,
    /// Whether the picture's own integrator gives distances, which are no light.
    pub distances: bool,
    /// How far apart samples of a pixel stand, in pixels: 1/√n.
    pub sample_distance: f64,
    /// Whether it is noted who covers the pixels.
    pub mattes: bool,
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
            light: Powers::default(),
            lengths: Powers::default(),
            distances: false,
            sample_distance: 1.0,
            mattes: false,
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

    /// Over which powers of two the numbers of `source` are counted.
    fn powers_of(&self, source: &Source) -> Powers {
        match source {
            Source::Light(None, _) | Source::Band(_) if self.distances => self.lengths,
            Source::Light(Some(i), _) if matches!(self.integrators[*i], Integrator::Depth) => self.lengths,
            Source::Surface(Quantity::Depth | Quantity::Position)
            | Source::Seen(Quantity::Depth | Quantity::Position) => self.lengths,
            Source::Light(..) | Source::Band(_) | Source::Ways(..) => self.light,
            Source::Surface(_) | Source::Seen(_) | Source::Numerics | Source::Middle(_) => Powers::default(),
        }
    }

    /// What the numbers of `source` are multiplied by on their way to the sums.
    fn unit_of(&self, source: &Source) -> f32 {
        one_over_two_to(self.powers_of(source).exponent)
    }

    /// And the light of a further `integrator`.
    #[must_use]
    pub fn unit_of_integrator(&self, integrator: &Integrator) -> f32 {
        let powers = if matches!(integrator, Integrator::Depth) { self.lengths } else { self.light };
        one_over_two_to(powers.exponent)
    }

    /// The sensitivity as a number from 1 to 2, by which samples of light are multiplied, and two to the power by which their
    /// sums are: what makes up for very dim or bright light would be more or less than sums hold.
    fn gain(&self) -> (f32, i32) {
        let exponent = self.sensitivity.to_bits() >> 52;
        ((self.sensitivity / f64::from_bits(exponent << 52)) as f32, exponent as i32 - 1023)
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
                    let light = xyz.map(|x| x * self.gain().0);
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
                let Powers { exponent, squared: lowered } = self.powers_of(&layer.source);
                let gain = if matches!(layer.source, Source::Light(..) | Source::Ways(..)) { self.gain().1 } else { 0 };
                let exponent = exponent + gain;
                let exponent = if squared { 2 * (exponent + lowered) } else { exponent };
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

/// What `light` adds to a band.
fn in_band(scene: &Scene, band: usize, wavelengths: &SampledWavelengths, light: Lanes) -> f32 {
    let counted = light * wavelengths.inv_pdf * scene.bands[band].response.eval(wavelengths.nm);
    counted.reduce_add() / LANES as f32
}

fn rgb(matrix: &[[f64; 3]; 3], xyz: [f32; 3]) -> [f32; 3] {
    let xyz = xyz.map(f64::from);
    matrix.map(|row| (row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]) as f32)
}
