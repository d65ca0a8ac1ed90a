//! Spectra, from what a person wrote.

use super::super::{Band, load};
use super::Compiler;
use crate::description as written;
use crate::error::{Error, in_short};
use crate::spectrum::{BAND_NM, Outside, Spectrum, illuminant, upsample};

/// What a spectrum stands for, which decides how a colour becomes one.
#[derive(Clone, Copy)]
pub(super) enum Role {
    Reflectance,
    Light,
    Coefficient,
    /// η and k of a metal, σₐ of hair.
    OpticalConstant,
}

/// A spectrum of lamps that many of them may have, by the bits of its numbers.
#[derive(PartialEq, Eq, Hash)]
pub(super) enum Common {
    Blackbody { kelvin: u64, scale: u64, normalised: bool },
    Illuminant { name: String, scale: u64 },
}

impl Compiler<'_> {
    /// What `s` is carried as.
    pub(super) fn spectrum(&mut self, at: &str, s: &written::Spectrum, outside: Outside, role: Role) -> Spectrum {
        let spectrum = self.written_spectrum(at, s, outside, role);
        if matches!(role, Role::Reflectance) {
            self.check_file_of_shares(at, s, &spectrum);
        }
        let carried = self.shelf.carried;
        match role {
            Role::Reflectance => carried.reflectance(spectrum),
            Role::Light => carried.light(spectrum),
            Role::Coefficient | Role::OpticalConstant => carried.coefficient(spectrum),
        }
    }

    /// What is written, whatever it is carried as.
    pub(super) fn written_spectrum(
        &mut self,
        at: &str,
        s: &written::Spectrum,
        outside: Outside,
        role: Role,
    ) -> Spectrum {
        let spectrum = self.any_spectrum(at, s, outside, role);
        // Scales, and widths of lines, may make more of numbers that are in range.
        if matches!(role, Role::Light) && !spectrum.is_finite() {
            self.fault(at, "expected light up to 3.4e38, found more");
            return Spectrum::Constant(0.0);
        }
        spectrum
    }

    /// What is written, though f32 may not hold it.
    fn any_spectrum(&mut self, at: &str, s: &written::Spectrum, outside: Outside, role: Role) -> Spectrum {
        let black = Spectrum::Constant(0.0);
        match s {
            written::Spectrum::Number(x) => Spectrum::constant(*x),
            written::Spectrum::Rgb(rgb) => match role {
                Role::Reflectance => self.or(at, upsample::reflectance(*rgb), black),
                Role::Light => self.or(at, upsample::emission(*rgb), black),
                Role::Coefficient => self.or(at, upsample::unbounded(*rgb), black),
                Role::OpticalConstant => self.or(at, upsample::optical_constant(*rgb), black),
            },
            written::Spectrum::Table(samples) => {
                let samples: Vec<(f64, f64)> = samples.iter().map(|s| (s[0], s[1])).collect();
                self.or(at, measured(&samples, outside), black)
            }
            written::Spectrum::File(path) => {
                self.files.push(path.to_path_buf());
                let spectrum = load::samples(path).and_then(|samples| measured(&samples, outside));
                spectrum.unwrap_or_else(|message| {
                    let error = self.asked(at, Error::input(path, message));
                    self.unread.get_or_insert(error);
                    black
                })
            }
            written::Spectrum::Blackbody(b) => {
                let (kelvin, scale) = (b.kelvin.to_bits(), b.scale.to_bits());
                self.common(Common::Blackbody { kelvin, scale, normalised: b.normalised }, |c| {
                    let spectrum = if b.normalised {
                        illuminant::blackbody_normalised(b.kelvin)
                    } else {
                        illuminant::blackbody(b.kelvin)
                    };
                    c.or(&format!("{at}.blackbody.kelvin"), spectrum, black).scaled(b.scale)
                })
            }
            written::Spectrum::Illuminant(i) => self
                .common(Common::Illuminant { name: i.name.clone(), scale: i.scale.to_bits() }, |c| {
                    c.or(&format!("{at}.illuminant"), illuminant::illuminant(&i.name), black).scaled(i.scale)
                }),
            written::Spectrum::Lines(lines) => {
                let lines: Vec<(f64, f64, f64)> = lines.iter().map(|l| (l.nm, l.power, l.width_nm)).collect();
                let faults = self.faults.len();
                for (i, line) in lines.iter().enumerate() {
                    if let Err(message) = Spectrum::lines(&[*line]) {
                        // The field says which line it is.
                        let expected = message.split_once(": ").map_or(&*message, |(_, expected)| expected);
                        let field = if line.2 < Spectrum::LEAST_WIDTH_NM { "width_nm" } else { "nm" };
                        self.fault(&format!("{at}.lines[{i}].{field}"), expected);
                    }
                }
                if self.faults.len() > faults { black } else { self.or(at, Spectrum::lines(&lines), black) }
            }
            written::Spectrum::ZeroOutside(s) => {
                self.written_spectrum(&format!("{at}.zero_outside"), s, Outside::Zero, role)
            }
            written::Spectrum::Scaled(s) => {
                self.written_spectrum(&format!("{at}.scaled.of"), &s.of, outside, role).scaled(s.by)
            }
        }
    }

    /// A spectrum that is made once for all that have it, as its table is larger than a lamp.
    fn common(&mut self, spectrum: Common, make: impl FnOnce(&mut Self) -> Spectrum) -> Spectrum {
        if let Some(known) = self.common.get(&spectrum) {
            return known.clone();
        }
        let faults = self.faults.len();
        let made = make(self);
        // What is wrong is told of each.
        if self.faults.len() == faults {
            self.common.insert(spectrum, made.clone());
        }
        made
    }

    /// Refuses a file of more than all light where `s` names one for a share of it; what is written itself has been checked.
    pub(super) fn check_file_of_shares(&mut self, at: &str, s: &written::Spectrum, spectrum: &Spectrum) {
        let (mut named, mut by) = (s, 1.0);
        let file = loop {
            match named {
                written::Spectrum::ZeroOutside(inner) => named = inner,
                written::Spectrum::Scaled(scaled) => (named, by) = (&scaled.of, by * scaled.by),
                written::Spectrum::File(file) => break file,
                _ => return,
            }
        };
        // Straight between its samples, it is greatest at one of them or at an end of the band.
        let samples = if let Spectrum::Table(table) = spectrum { table.samples() } else { Vec::new() };
        let within = samples.into_iter().filter(|(nm, _)| (BAND_NM[0]..=BAND_NM[1]).contains(nm));
        let mut looked_at = within.chain(BAND_NM.map(|nm| (nm, spectrum.at(nm))));
        if let Some((nm, found)) = looked_at.find(|(_, value)| *value > 1.0) {
            // Digits beyond those of f32 are not the file's.
            let digits = |x: f64| in_short((x as f32).to_string().parse().unwrap_or(x));
            let (nm, found) = (digits(nm), digits(found));
            let times = if by == 1.0 { String::new() } else { format!(" times {}", in_short(by)) };
            let message = format!(
                "expected values{times} from 0 to 1 for a share of light (not per cent), found {found} at {nm} nm"
            );
            let error = self.asked(at, Error::input(file, message));
            self.unread.get_or_insert(error);
        }
    }

    pub(super) fn reflectance(&mut self, at: &str, s: &written::Spectrum) -> Spectrum {
        self.spectrum(at, s, Outside::Hold, Role::Reflectance)
    }

    pub(super) fn light_spectrum(&mut self, at: &str, s: &written::Spectrum) -> Spectrum {
        self.spectrum(at, s, Outside::Zero, Role::Light)
    }

    /// Bands of the spectrum; a response must lie in what is rendered.
    pub(super) fn bands(&mut self) -> Vec<Band> {
        let mut all = Vec::new();
        for (i, band) in self.description.image.bands.iter().enumerate() {
            let at = format!("image.bands[{i}].response");
            let (faults, unread) = (self.faults.len(), self.unread.is_some());
            let response = self.written_spectrum(&at, &band.response, Outside::Zero, Role::Coefficient);
            let told = self.faults.len() > faults || self.unread.is_some() && !unread;
            let fault = match beyond_the_band(&band.response) {
                _ if told => None,
                _ if response.is_black() => Some("expected a response within 360 to 830 nm, found none".to_owned()),
                beyond => beyond.map(|[from, to]| {
                    format!(
                        "expected a response that is 0 beyond 360 and 830 nm, where no light is simulated, found more between {from} and {to} nm"
                    )
                }),
            };
            if let Some(fault) = fault {
                self.fault(&at, fault);
            }
            all.push(Band { name: band.name.clone(), response });
        }
        if let Some(spectral) = &self.description.output.spectral {
            for [from, to] in spectral.edges() {
                // The mean over the band, from the ends as wavelengths meet them; the name has its middle, with a comma.
                let [first, next] = [from, to].map(not_below);
                let height = 1.0 / (f64::from(next) - f64::from(first));
                // The end of a band is the beginning of the next, and counts there alone.
                let last = if to < BAND_NM[1] { next.next_down() } else { next };
                let samples = [first, last].map(|nm| (f64::from(nm), height));
                let response = Spectrum::from_samples(&samples, Outside::Zero);
                let name = format!("S0.{:.6}nm", 0.5 * (from + to)).replace('.', ",").replacen(',', ".", 1);
                all.extend(response.map(|response| Band { name, response }));
            }
        }
        all
    }
}

/// The smallest f32 that is not below `nm`.
fn not_below(nm: f64) -> f32 {
    let nearest = nm as f32;
    if f64::from(nearest) < nm { nearest.next_up() } else { nearest }
}

/// A spectrum from samples (nm, value), some of which count in a picture.
fn measured(samples: &[(f64, f64)], outside: Outside) -> Result<Spectrum, String> {
    let spectrum = Spectrum::from_samples(samples, outside)?;
    let ([low, high], first, last) = (BAND_NM, samples[0].0, samples[samples.len() - 1].0);
    if first <= high && last >= low {
        return Ok(spectrum);
    }
    let hint = if first * 1e3 <= high && last * 1e3 >= low { " (are they in µm?)" } else { "" };
    let [first, last] = [first, last].map(in_short);
    Err(format!("expected wavelengths within {low} to {high} nm, found {first} to {last} nm{hint}"))
}

/// Between which wavelengths, nm, a response counts light beyond the band, if it does.
fn beyond_the_band(response: &written::Spectrum) -> Option<[f64; 2]> {
    let samples = match response {
        written::Spectrum::Table(samples) => samples.clone(),
        // What is wrong with the file has been told.
        written::Spectrum::File(path) => load::samples(path).ok()?.into_iter().map(Into::into).collect(),
        written::Spectrum::ZeroOutside(of) => return beyond_the_band(of),
        written::Spectrum::Scaled(scaled) => return beyond_the_band(&scaled.of),
        _ => return None,
    };
    let beyond = |[from, to]: [[f64; 2]; 2]| {
        let counts = from[1] != 0.0 || to[1] != 0.0;
        (counts && (from[0] < BAND_NM[0] || to[0] > BAND_NM[1])).then_some([from[0], to[0]])
    };
    samples.windows(2).find_map(|pair| beyond([pair[0], pair[1]]))
}

#[cfg(test)]
mod tests {
    use crate::description::SceneDescription;
    use crate::error::Result;
    use crate::scene::Scene;
    use crate::scene::compile::compile;
    use crate::scene::light::Light;
    use crate::spectrum::{Lanes, Spectrum};

    /// A scene with a camera, on its first line, and `line`.
    fn compiled(line: &str) -> Result<Scene> {
        let text = format!("camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n{line}\n");
        compile(&SceneDescription::parse(&text, std::path::Path::new("s.yaml")).unwrap(), "s")
    }

    /// Of bands side by side each wavelength counts in one, with its share of the band: the sum over a band's wavelengths, one
    /// f32 apart, is 1 to the rounding of each. The last that is rendered counts, too.
    #[test]
    fn a_wavelength_is_in_one_band() {
        let bands = |range: &str| compiled(&format!("output: {{spectral: {{{range}}}}}")).unwrap().bands;
        let ten = bands("bands: 10, from_nm: 500.003, to_nm: 500.103");
        let step = 500f32.next_up() - 500.0;
        let mut sums = [0.0; 10];
        let mut nm = 500f32;
        while nm < 500.2 {
            let values: Vec<f32> = ten.iter().map(|band| band.response.eval(Lanes::splat(nm)).to_array()[0]).collect();
            let inside = (500.003..500.103).contains(&f64::from(nm));
            assert_eq!(values.iter().filter(|value| **value > 0.0).count(), usize::from(inside), "{nm}: {values:?}");
            (0..10).for_each(|i| sums[i] += f64::from(values[i] * step));
            nm = nm.next_up();
        }
        assert!(sums.iter().all(|sum| (sum - 1.0).abs() < 1e-6), "{sums:?}");
        let last = &bands("bands: 2, from_nm: 820, to_nm: 830")[1].response;
        assert_eq!([825.0, 830.0].map(|nm| last.eval(Lanes::splat(nm)).to_array()[0]), [0.2; 2]);
    }

    /// What only the spectrum itself finds out is told at the field that says it.
    #[test]
    fn faults_of_spectra_name_their_field() {
        for (radiance, told) in [
            ("{blackbody: {kelvin: 10}}", "53: R.blackbody.kelvin: expected a temperature of 50 to 1e12 K, found 10"),
            ("{illuminant: D66}", "45: R.illuminant: unknown illuminant \"D66\""),
            (
                "{lines: [{nm: 500, width_nm: 0.001}]}",
                "61: R.lines[0].width_nm: expected a width of 0.01 nm or more, found 0.001",
            ),
            (
                "{lines: [{nm: 500}, {nm: 300}]}",
                "57: R.lines[1].nm: expected a line within 360 to 830 nm, found 300 nm of width 1",
            ),
        ] {
            let found =
                compiled(&format!("lights: [{{constant: {{radiance: {radiance}}}}}]")).err().unwrap().to_string();
            let expected = format!("s.yaml:2:{}", told.replace("R.", "lights[0].constant.radiance."));
            assert!(found.starts_with(&expected), "{found}");
        }
    }

    /// A table takes some 16 KB: lamps share it that have the same spectrum, and none that have another.
    #[test]
    fn lamps_of_one_spectrum_share_its_table() {
        let written = [
            "{blackbody: {kelvin: 3000, scale: 2}}",
            "{blackbody: {kelvin: 3000, scale: 2, normalised: false}}",
            "{blackbody: {kelvin: 3000, scale: 3}}",
            "{blackbody: {kelvin: 3001, scale: 2}}",
            "{illuminant: {name: A, scale: 2}}",
            "{illuminant: {name: D50, scale: 2}}",
        ];
        let lamp = |light: &str| format!("- point: {{position: [0, 0, 0], intensity: {light}}}\n");
        let lamps: String = written.iter().chain(&written).map(|light| lamp(light)).collect();
        let scene = compiled(&format!("lights:\n{lamps}")).unwrap();
        let table = |i: usize| match &scene.lights[i] {
            Light::Point { intensity: Spectrum::Table(table), .. } => table,
            other => panic!("{other:?}"),
        };
        for (i, j) in (0..12).flat_map(|i| (0..12).map(move |j| (i, j))) {
            assert_eq!(std::sync::Arc::ptr_eq(table(i), table(j)), i % 6 == j % 6, "{i} {j}");
        }
    }

    /// 10³⁷ over 0.01 nm is 10³⁹ a nanometre; F11 of luminance 1 is 5.6 at 545 nm. A thousandth of each is light.
    #[test]
    fn light_that_no_float_holds_is_refused() {
        let told = |radiance: &str| {
            let scene = compiled(&format!("lights: [{{constant: {{radiance: {radiance}}}}}]"));
            scene.err().map(|error| error.to_string()).unwrap_or_default()
        };
        for (much, less) in [
            (
                "{lines: [{nm: 550, power: 1.0e37, width_nm: 0.01}]}",
                "{lines: [{nm: 550, power: 1.0e34, width_nm: 0.01}]}",
            ),
            ("{illuminant: {name: F11, scale: 1.0e38}}", "{illuminant: {name: F11, scale: 1.0e35}}"),
        ] {
            let expected = "s.yaml:2:32: lights[0].constant.radiance: expected light up to 3.4e38, found more";
            assert_eq!((told(much).as_str(), told(less).as_str()), (expected, ""));
        }
    }

    /// A picture of 100 at 1e37 is 1e39, and so is 1e37 at a scale of 100; at 1e34 each is light.
    #[test]
    fn light_that_no_float_holds_by_a_picture_or_a_scale_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let mut picture = b"PF\n2 2\n-1\n".to_vec();
        picture.extend([100f32; 12].iter().flat_map(|x| x.to_le_bytes()));
        std::fs::write(directory.path().join("hot.pfm"), picture).unwrap();
        let told = |written: &str, scale: &str| {
            let text = format!("camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n{written}\n");
            let path = directory.path().join("s.yaml");
            let description = SceneDescription::parse(&text.replace("SCALE", scale), &path).unwrap();
            compile(&description, "s").err().map(|error| error.to_string()).unwrap_or_default()
        };
        let hot = "textures: {hot: {image: {file: hot.pfm, illuminant: E}}}\n";
        let throws = "origin: [0, 1, 5], target: [0, 1, 0], fov_deg: 40";
        for (written, field) in [
            (
                "textures: {hot: {image: {file: hot.pfm, illuminant: {name: E, scale: SCALE}}}}\n\
                 shapes: [{sphere: {radius: 1, emission: {texture: hot}}}]"
                    .to_owned(),
                "shapes[0].sphere.emission",
            ),
            ("lights: [{environment: {file: hot.pfm, scale: SCALE}}]".to_owned(), "lights[0].environment"),
            (
                format!(
                    "{hot}lights: [{{spot: {{position: [0, 1, 5], target: [0, 1, 0], intensity: SCALE, texture: hot}}}}]"
                ),
                "lights[0].spot",
            ),
            (
                format!("{hot}lights: [{{projector: {{{throws}, irradiance: {{texture: hot}}, scale: SCALE}}}}]"),
                "lights[0].projector.scale",
            ),
            (
                format!("lights: [{{projector: {{{throws}, irradiance: SCALE, scale: 100}}}}]"),
                "lights[0].projector.scale",
            ),
        ] {
            let much = told(&written, "1.0e+37");
            assert!(
                much.ends_with(&format!(": {field}: expected light up to 3.4e38, found more")),
                "{written}: {much}"
            );
            assert_eq!(told(&written, "1.0e+34"), "", "{written}");
        }
    }

    /// The files say so between two whole nanometres, on either side of a jump, and beyond the band alone, where the line to
    /// the next sample is at (7 − 0.5) · 130/200 + 0.5 = 4.725 as the band ends. That nothing is too bright beyond the band
    /// alone is no fault: 1.2 at 900 nm is at 0.955 there.
    #[test]
    fn more_than_all_light_is_found_at_any_sample_of_a_file() {
        let directory = tempfile::tempdir().unwrap();
        let fault = |samples: &str| {
            std::fs::write(directory.path().join("paint.csv"), samples.replace(' ', "\n")).unwrap();
            let text = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nshapes:\n\
                        - sphere: {radius: 1, material: {diffuse: {reflectance: {file: paint.csv}}}}\n";
            let description = SceneDescription::parse(text, &directory.path().join("s.yaml")).unwrap();
            compile(&description, "s").err().map(|error| error.to_string()).unwrap_or_default()
        };
        for (samples, found) in [
            ("400,0.5 450.4,0.5 450.5,3 450.6,0.5 700,0.5", "found 3 at 450.5 nm"),
            ("400,0.5 450.5,1.5 450.5,0.5 700,0.5", "found 1.5 at 450.5 nm"),
            ("400,0.5 450.5,0.5 450.5,1.5 450.7,0.5 700,0.5", "found 1.5 at 450.5 nm"),
            ("400,0.5 700,0.5 900,7", "found 4.725 at 830 nm"),
        ] {
            assert!(fault(samples).contains(found), "{samples}: {}", fault(samples));
        }
        assert_eq!(fault("400,0.5 700,0.5 900,1.2"), "");
        assert_eq!(fault("400,1 450.5,1 700,1"), "");
    }

    /// Reflectances and albedos in per cent, as they stand, scaled to what they are, and beyond.
    #[test]
    fn a_file_of_more_than_all_light_is_no_reflectance() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("paint.csv"), "400,50\n700,80\n").unwrap();
        let fault = |reflectance: &str, albedo: &str| {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\nshapes:\n\
                 - sphere: {{radius: 1, material: {{diffuse: {{reflectance: {reflectance}}}}}}}\n\
                 media: {{smoke: {{homogeneous: {{extinction: 1, albedo: {albedo}}}}}}}\n"
            );
            let description = SceneDescription::parse(&text, &directory.path().join("s.yaml")).unwrap();
            compile(&description, "s").err().map(|error| error.to_string()).unwrap_or_default()
        };
        let scaled = "{scaled: {by: 0.01, of: {file: paint.csv}}}";
        assert_eq!(fault(scaled, scaled), "");
        for told in [fault("{file: paint.csv}", "0.5"), fault("0.5", "{file: paint.csv}")] {
            let parts = ["paint.csv: expected values from 0 to 1", "found 50 at 400 nm", "named at"];
            assert!(parts.iter().all(|part| told.contains(part)), "{told}");
        }
        let told = fault("{scaled: {by: 0.02, of: {zero_outside: {file: paint.csv}}}}", "0.5");
        assert!(told.contains("times 0.02 from 0 to 1"), "{told}");
    }
}
