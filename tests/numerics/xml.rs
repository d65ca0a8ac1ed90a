//! Scenes in Mitsuba's XML whose pixels have an answer in closed form.

use crate::common::{Bench, Estimate, write};
use abbe::batch::{self, Overrides};
use rayon::prelude::*;

/// What each pixel, or their mean, must be.
#[derive(Clone, Copy, Debug)]
pub enum Answer {
    /// Every pixel, within an absolute tolerance.
    Every(f64, f64),
    /// The mean of the pixels, within an absolute tolerance and four and a half standard errors.
    Mean(f64, f64),
    /// The mean is at least the first, and at most four and a half standard errors above the second. A pixel may be 100 of its
    /// own above: with three degrees of freedom Student's t is beyond that with a chance of 1.1/100³.
    Within(f64, f64),
}

/// A scene and its answer.
pub struct Case {
    pub name: String,
    pub body: String,
    pub files: Vec<(String, Vec<u8>)>,
    pub answer: Answer,
    pub samples: u32,
    pub side: u32,
    pub integrator: &'static str,
}

impl Case {
    pub fn new(name: impl Into<String>, body: impl Into<String>, answer: Answer) -> Case {
        Case {
            name: name.into(),
            body: body.into(),
            files: Vec::new(),
            answer,
            samples: 16,
            side: 16,
            integrator: PATH,
        }
    }

    pub fn samples(self, samples: u32) -> Case {
        Case { samples, ..self }
    }

    pub fn side(self, side: u32) -> Case {
        Case { side, ..self }
    }

    pub fn integrator(self, integrator: &'static str) -> Case {
        Case { integrator, ..self }
    }

    pub fn file(mut self, name: &str, bytes: impl Into<Vec<u8>>) -> Case {
        self.files.push((name.to_owned(), bytes.into()));
        self
    }

    /// The text of the file.
    pub fn xml(&self) -> String {
        format!("<scene version=\"3.0.0\">\n{}\n{}\n</scene>\n", self.integrator, self.body)
            .replace("SIDE", &self.side.to_string())
            .replace("SPP", &self.samples.to_string())
    }

    /// The scene, ready to be rendered.
    pub fn bench(&self) -> Result<Bench, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("scene.xml");
        write(&path, self.xml().as_bytes());
        for (name, bytes) in &self.files {
            write(&directory.path().join(name), bytes);
        }
        let none = Overrides::default();
        let prepared = batch::entries(&path, &none)
            .and_then(|entries| batch::prepare(&entries[0], &none))
            .map_err(|error| error.to_string())?;
        Ok(Bench { prepared, directory })
    }

    /// Renders and compares; in words what is wrong.
    fn judge(&self) -> Result<(), String> {
        let picture = self.bench()?.grey().picture();
        if picture.invalid != 0 {
            return Err(format!("{} samples are invalid", picture.invalid));
        }
        match self.answer {
            Answer::Every(expected, tolerance) => {
                let off = |y: &f64| if y.is_nan() { f64::INFINITY } else { (y - expected).abs() };
                let wrong = picture.y.iter().filter(|y| off(y) > tolerance).count();
                let worst = picture.y.iter().copied().max_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
                if std::env::var_os("ABBE_PRINT").is_some() {
                    eprintln!("{}: off {:e} of {tolerance:e}", self.name, off(&worst));
                }
                (wrong == 0).then_some(()).ok_or_else(|| {
                    format!("{wrong} of {} pixels are not {expected} ± {tolerance}, the worst {worst}", picture.y.len())
                })
            }
            Answer::Within(least, most) => {
                let Estimate { mean, error } = picture.mean();
                let above = |(y, e): &(&f64, &f64)| !(**y >= 0.0 && **y <= most + 100.0 * **e);
                let wrong = picture.y.iter().zip(&picture.error).filter(above).count();
                (wrong == 0 && mean >= least && mean <= most + 4.5 * error).then_some(()).ok_or_else(|| {
                    let largest = picture.y.iter().copied().fold(0.0, f64::max);
                    format!("{wrong} pixels are not from 0 to {most}, the largest {largest}; the mean {mean} ± {error}, expected {least} or more")
                })
            }
            Answer::Mean(expected, tolerance) => {
                let mean = picture.mean();
                let off = (mean.mean - expected).abs();
                if std::env::var_os("ABBE_PRINT").is_some() {
                    eprintln!("{}: off {off:e} ± {:e} of {tolerance:e}", self.name, mean.error);
                }
                // Noise of more than a hundredth would hide anything.
                let told = mean.error <= 0.01 * expected.abs().max(tolerance);
                (off <= tolerance + 4.5 * mean.error && told)
                    .then_some(())
                    .ok_or_else(|| format!("expected {expected} ± {tolerance}, found {mean:?}"))
            }
        }
    }
}

/// Renders all, and fails with all that is wrong.
#[track_caller]
pub fn hold(cases: &[Case]) {
    let faults: Vec<String> = cases
        .par_iter()
        .filter_map(|case| {
            case.judge().err().map(|fault| {
                if std::env::var_os("ABBE_PRINT").is_some() {
                    eprintln!("WRONG {}: {fault}", case.name);
                }
                format!("{}: {fault}\n{}", case.name, case.xml().chars().take(3000).collect::<String>())
            })
        })
        .collect();
    eprintln!("{} scenes", cases.len());
    assert!(faults.is_empty(), "{} of {} are wrong\n{}", faults.len(), cases.len(), faults.join("\n"));
}

pub const PATH: &str = "<integrator type=\"path\"><integer name=\"max_depth\" value=\"-1\"/></integrator>";
pub const DIRECT: &str = "<integrator type=\"path\"><integer name=\"max_depth\" value=\"2\"/></integrator>";
pub const VOLPATH: &str = "<integrator type=\"volpath\"><integer name=\"max_depth\" value=\"-1\"/></integrator>";
/// Even light of 1 from everywhere.
pub const SKY: &str = "<emitter type=\"constant\"><spectrum name=\"radiance\" value=\"1\"/></emitter>";
/// Even light of 1e6: of a room that leaks a millionth of it shows.
pub const BRIGHT: &str = "<emitter type=\"constant\"><spectrum name=\"radiance\" value=\"1e6\"/></emitter>";
pub const GREY: &str = "<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"0.5\"/></bsdf>";
pub const BLACK: &str = "<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"0\"/></bsdf>";
pub const NULL: &str = "<bsdf type=\"null\"/>";

/// Three numbers.
pub fn list(v: [f64; 3]) -> String {
    format!("{:?}, {:?}, {:?}", v[0], v[1], v[2])
}

/// The film and sampler.
pub const FILM: &str = "<sampler type=\"independent\"><integer name=\"sample_count\" value=\"SPP\"/></sampler>\
    <film type=\"hdrfilm\"><integer name=\"width\" value=\"SIDE\"/><integer name=\"height\" value=\"SIDE\"/>\
    <string name=\"component_format\" value=\"float32\"/><rfilter type=\"box\"/></film>";

/// A camera that sees from 1e-12 to 1e6 times the distance of its target, with `inside`, and placed `before` it looks.
fn sensor(plugin: &str, inside: &str, before: &str, [origin, target]: [[f64; 3]; 2]) -> String {
    let d = (0..3).map(|i| (origin[i] - target[i]).powi(2)).sum::<f64>().sqrt();
    let up = if (origin[1] - target[1]).abs() > 0.9 * d { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] };
    format!(
        "<sensor type=\"{plugin}\">{inside}\
         <float name=\"near_clip\" value=\"{:?}\"/><float name=\"far_clip\" value=\"{:?}\"/>\
         <transform name=\"to_world\">{before}<lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform>{FILM}</sensor>",
        d * 1e-12,
        d * 1e6,
        list(origin),
        list(target),
        list(up)
    )
}

/// A camera with an angle of view of `fov` degrees.
pub fn camera(origin: [f64; 3], target: [f64; 3], fov: f64) -> String {
    sensor("perspective", &format!("<float name=\"fov\" value=\"{fov:?}\"/>"), "", [origin, target])
}

/// A camera of parallel rays over a square of half side `half`.
pub fn parallel(origin: [f64; 3], target: [f64; 3], half: f64) -> String {
    sensor("orthographic", "", &format!("<scale x=\"{half:?}\" y=\"{half:?}\"/>"), [origin, target])
}

pub fn sphere(center: [f64; 3], radius: f64, inside: &str) -> String {
    format!(
        "<shape type=\"sphere\"><point name=\"center\" value=\"{}\"/><float name=\"radius\" value=\"{radius:?}\"/>{inside}</shape>",
        list(center)
    )
}

/// A shape under transforms in the words of XML.
pub fn shape(plugin: &str, to_world: &str, inside: &str) -> String {
    format!("<shape type=\"{plugin}\"><transform name=\"to_world\">{to_world}</transform>{inside}</shape>")
}

/// A lamp's surface: radiance, and black.
pub fn shining(radiance: f64) -> String {
    format!("<emitter type=\"area\"><spectrum name=\"radiance\" value=\"{radiance:?}\"/></emitter>{BLACK}")
}

/// A surface that shines with 1 and reflects `albedo`.
pub fn glowing(albedo: f64) -> String {
    format!(
        "<emitter type=\"area\"><spectrum name=\"radiance\" value=\"1\"/></emitter>\
         <bsdf type=\"twosided\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"{albedo:?}\"/></bsdf></bsdf>"
    )
}

/// Glass of an index in vacuum.
pub fn glass(int: f64, ext: f64) -> String {
    format!(
        "<bsdf type=\"dielectric\"><float name=\"int_ior\" value=\"{int:?}\"/><float name=\"ext_ior\" value=\"{ext:?}\"/></bsdf>"
    )
}
