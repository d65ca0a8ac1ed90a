//! From which wavelengths those of a path are drawn.

use super::Compiler;
use crate::description as written;
use crate::scene::light::Light;
use crate::scene::material::Kind;
use crate::scene::{Band, Object};
use crate::spectrum::observer::{quadrature, tristimulus, xyz};
use crate::spectrum::{LANES, RANDOM, SampledWavelengths, Spectrum, WavelengthDistribution};

/// How far off a band may be by the wavelengths of `whitted` without a word.
const WORST_BAND: f64 = 0.1;

/// How far off the colour of a lamp may be by them.
const WORST_COLOUR: f64 = 0.01;

impl Compiler<'_> {
    /// The wavelengths that are asked for. Where they tell too little of the scene's light, that is noted.
    pub(super) fn wavelengths(
        &mut self,
        lights: &[Light],
        powers: &[f64],
        objects: &[Object],
        bands: &[Band],
    ) -> WavelengthDistribution {
        let carried = self.shelf.carried.wavelengths();
        let in_colours = carried.is_none() && self.description.image.bands.is_empty();
        let wavelengths = carried.unwrap_or_else(|| match self.description.render.wavelengths {
            written::Wavelengths::Auto => self.own_wavelengths(lights, powers, objects, bands),
            written::Wavelengths::Visible => WavelengthDistribution::visible(),
            written::Wavelengths::Uniform => WavelengthDistribution::uniform(),
        });
        let lit = lights.iter().zip(powers).filter(|(_, power)| in_colours && **power > 0.0);
        let emitters = lit.flat_map(|(light, _)| light.spectra()).filter(|s| !s.is_black());
        self.note_few_wavelengths(&wavelengths, bands, emitters);
        wavelengths
    }

    /// Wavelengths by the scene's own lights and surfaces.
    fn own_wavelengths(
        &self,
        lights: &[Light],
        powers: &[f64],
        objects: &[Object],
        bands: &[Band],
    ) -> WavelengthDistribution {
        // Of `whitted` a pixel has a lattice of them, as many at least.
        let points = match &self.description.integrator {
            written::Integrator::Whitted(w) => {
                let wavelengths = w.samples() as usize * LANES;
                (1 << wavelengths.ilog2()).min(RANDOM)
            }
            _ => RANDOM,
        };
        let mut emitters: Vec<(f64, Spectrum)> = Vec::new();
        for (light, power) in lights.iter().zip(powers) {
            let spectra = light.spectra();
            let weight = power / spectra.len() as f64;
            emitters.extend(spectra.into_iter().map(|s| (weight, s)));
        }
        if !bands.is_empty() {
            let responses: Vec<&Spectrum> = bands.iter().map(|b| &b.response).collect();
            // In the place of colours, bands leave them a tenth, for the preview; beside a picture of colours, half.
            let colours = if self.description.image.bands.is_empty() { 0.5 } else { 0.1 };
            return WavelengthDistribution::for_bands(&responses, &emitters, colours, points);
        }
        let mut reflectances = Vec::new();
        for object in objects {
            for leaf in self.materials[object.material as usize].leaves() {
                match &leaf.kind {
                    Kind::Diffuse { reflectance } | Kind::Plastic { reflectance, .. } => {
                        reflectances.extend(reflectance.representatives());
                    }
                    Kind::Principled(solid) => reflectances.extend(solid.base.representatives()),
                    Kind::PrincipledThin(sheet) => reflectances.extend(sheet.base.representatives()),
                    Kind::Mirror { reflectance } => reflectances.push(reflectance.clone()),
                    Kind::Conductor { .. }
                    | Kind::Dielectric { .. }
                    | Kind::Thin { .. }
                    | Kind::Hair { .. }
                    | Kind::Boundary
                    | Kind::Compound(_) => {}
                }
            }
        }
        WavelengthDistribution::for_scene(&emitters, &reflectances, points)
    }

    /// Tells how far off `bands` are in even light, and the colour of even light of the `emitters`, where `whitted` has too few
    /// of `wavelengths` for them.
    fn note_few_wavelengths(
        &mut self,
        wavelengths: &WavelengthDistribution,
        bands: &[Band],
        emitters: impl Iterator<Item = Spectrum>,
    ) {
        let written::Integrator::Whitted(w) = &self.description.integrator else { return };
        // The lattice of a pixel: sets that begin evenly spread over the distance from lane to lane.
        let sets = w.samples();
        let begin = |set: u32| (f64::from(set) + 0.5) / f64::from(sets) / LANES as f64;
        let drawn: Vec<SampledWavelengths> = (0..sets).map(|set| wavelengths.sample(begin(set))).collect();
        let off = |Band { response, .. }: &Band| {
            let found = drawn.iter().map(|w| f64::from((response.eval(w.nm) * w.inv_pdf).reduce_add())).sum::<f64>();
            let exact: f64 =
                quadrature(&response.breakpoints()).iter().map(|(nm, width)| response.at(*nm) * width).sum();
            (found / (drawn.len() * LANES) as f64 / exact - 1.0).abs()
        };
        let worst = bands.iter().map(off).fold(0.0, f64::max);
        if worst > WORST_BAND {
            let message = format!(
                "{} wavelengths a pixel are few for {} bands: even light is off by up to {:.0} % in them; a larger grid has more",
                drawn.len() * LANES,
                bands.len(),
                100.0 * worst
            );
            self.note("integrator.whitted", &message);
        }
        // Of X, Y and Z, over the largest.
        let off = |light: Spectrum| {
            let exact = tristimulus(&light);
            let found = drawn.iter().fold([0.0; 3], |sum: [f64; 3], w| {
                let one = xyz(light.eval(w.nm), w);
                std::array::from_fn(|c| sum[c] + f64::from(one[c]) / f64::from(sets))
            });
            let largest = exact.iter().fold(0.0, |a: f64, b| a.max(*b));
            (0..3).map(|c| (found[c] - exact[c]).abs() / largest).fold(0.0, f64::max)
        };
        let worst = emitters.map(off).fold(0.0, f64::max);
        if worst > WORST_COLOUR {
            let message = format!(
                "{} wavelengths a pixel are few for the spectra of the lamps: their colour is off by up to {:.1} %; a larger grid \
                 has more",
                drawn.len() * LANES,
                100.0 * worst
            );
            self.note("integrator.whitted", &message);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::compile::testing::compiled;

    fn notes_of(text: &str) -> Vec<String> {
        compiled(&format!("camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n{text}\n")).notes
    }

    /// Of 31 bands some have none of 32 wavelengths, and are black. Of 512 each has 8, as half of them go by the bands, and 3 by the
    /// eye: one more or less is less than a tenth. Two broad bands have enough of 32, and a path draws its own.
    #[test]
    fn bands_that_have_few_wavelengths_are_told() {
        let notes = |integrator: &str, bands: u32| {
            let light = "lights: [constant: {radiance: 1}]";
            let written = format!("integrator: {integrator}\noutput: {{spectral: {{bands: {bands}}}}}\n{light}");
            notes_of(&written)
        };
        let told = notes("whitted", 31);
        let parts = ["s.yaml:2", "32 wavelengths a pixel are few for 31 bands", "off by up to 100 %"];
        assert!(told.len() == 1 && parts.iter().all(|part| told[0].contains(part)), "{told:?}");
        for (integrator, bands) in [("{whitted: {grid: 8}}", 31), ("whitted", 2), ("path", 31)] {
            assert_eq!(notes(integrator, bands), [""; 0], "{integrator} {bands}");
        }
    }

    /// The white of F12 has lines of a few nanometres, of which 32 wavelengths miss or double some; 512 lie 1 nm apart and less.
    /// Of daylight, of a black body and of one line 32 are enough, as each jump has its share. Light of no power is not
    /// looked at, nor is that of a picture of bands, which has no colour.
    #[test]
    fn lamps_that_have_few_wavelengths_are_told() {
        let notes =
            |settings: &str, lamp: &str| notes_of(&format!("{settings}\nlights: [constant: {{radiance: {lamp}}}]"));
        let told = notes("integrator: whitted", "{illuminant: F12}");
        let words = "32 wavelengths a pixel are few for the spectra of the lamps: their colour is off by up to";
        assert!(told.len() == 1 && told[0].contains(words), "{told:?}");
        for (settings, lamp) in [
            ("integrator: path", "{illuminant: F12}"),
            ("integrator: {whitted: {grid: 8}}", "{illuminant: F12}"),
            ("integrator: whitted\nimage: {bands: [{name: all, response: 1}]}", "{illuminant: F12}"),
            ("integrator: whitted", "{illuminant: {name: F12, scale: 0}}"),
            ("integrator: whitted", "{illuminant: D65}"),
            ("integrator: whitted", "{blackbody: {kelvin: 2800}}"),
            ("integrator: whitted", "{lines: [{nm: 589}]}"),
        ] {
            assert_eq!(notes(settings, lamp), [""; 0], "{settings} {lamp}");
        }
    }
}
