//! What the tests of pictures share: scenes from YAML, the light along a ray, whole pictures, and
//! figures with their standard error.
#![allow(dead_code, reason = "every test file uses its own part")]

pub mod place;

use abbe::batch::finish::Sharing;
use abbe::batch::frame::{self, Frame};
use abbe::batch::{self, Overrides, Prepared};
use abbe::film::Window;
use abbe::film::accumulate::{Film, REPLICATES};
use abbe::math::Ray;
use abbe::math::sampler::{Sampler, Set, pairs};
use abbe::math::statistics::Moments;
use abbe::spectrum::{ColourSpace, LANES, Lanes, SampledWavelengths, WavelengthDistribution, observer};
use abbe::transport::path::{Sought, reuse};
use abbe::transport::plan::{EffectPlan, Integrator};
use abbe::transport::{self, Incoming, path, whitted};
use glam::{DVec2, DVec3};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

/// A camera that looks along −z from (0, 0, 5) at a picture of 8 × 8 pixels.
pub const CAMERA: &str = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nimage: {width: 8, height: 8}\n";

/// Eight wavelengths, each the middle of an eighth of the band.
pub const SPREAD_NM: [f64; LANES] = [389.375, 448.125, 506.875, 565.625, 624.375, 683.125, 741.875, 800.625];

/// A scene ready to be rendered, with the files that it was read from.
pub struct Bench {
    pub prepared: Prepared,
    pub directory: TempDir,
}

/// A picture in CIE Y, and what it is uncertain by.
pub struct Picture {
    pub window: Window,
    /// Luminance of each pixel.
    pub y: Vec<f64>,
    /// Its standard error from four replicates.
    pub error: Vec<f64>,
    /// Linear Rec. 709 of each pixel.
    pub rgb: Vec<[f64; 3]>,
    /// Coverage of each pixel.
    pub alpha: Vec<f64>,
    /// Samples that were dropped.
    pub invalid: u64,
    /// How many times the variance of the sum of all pixels is that of independent ones, at the most.
    pub shared: f64,
}

/// A mean with its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

/// A closed room from −1 to 1 with inward normals.
pub fn room(fields: &str) -> String {
    let walls = [
        ("[-1, -1, -1]", "[0, 0, 2]", "[2, 0, 0]"),
        ("[-1, 1, -1]", "[2, 0, 0]", "[0, 0, 2]"),
        ("[-1, -1, -1]", "[2, 0, 0]", "[0, 2, 0]"),
        ("[-1, -1, 1]", "[0, 2, 0]", "[2, 0, 0]"),
        ("[-1, -1, -1]", "[0, 2, 0]", "[0, 0, 2]"),
        ("[1, -1, -1]", "[0, 0, 2]", "[0, 2, 0]"),
    ];
    let walls = walls.map(|(c, u, v)| format!("- rectangle: {{corner: {c}, edge_u: {u}, edge_v: {v}, {fields}}}\n"));
    format!("shapes:\n{}", walls.concat())
}

/// The scene of [`CAMERA`] and `text`.
pub fn bench(text: &str) -> Bench {
    bench_with(&format!("{CAMERA}{text}"), &[])
}

/// The scene of `yaml`, beside which `files` lie.
pub fn bench_with(yaml: &str, files: &[(&str, &[u8])]) -> Bench {
    try_bench(yaml, files).unwrap_or_else(|error| panic!("{error}\n{yaml}"))
}

/// As [`bench_with`], with the fault where there is one; the directory is called DIR in it.
pub fn try_bench(yaml: &str, files: &[(&str, &[u8])]) -> Result<Bench, String> {
    let directory = tempfile::tempdir().unwrap();
    write(&directory.path().join("scene.yaml"), yaml.as_bytes());
    for (name, bytes) in files {
        write(&directory.path().join(name), bytes);
    }
    let none = Overrides::default();
    let prepared = batch::entries(&directory.path().join("scene.yaml"), &none)
        .and_then(|entries| batch::prepare(&entries[0], &none))
        .map_err(|error| error.to_string().replace(directory.path().to_str().unwrap(), "DIR"))?;
    Ok(Bench { prepared, directory })
}

/// A sphere as signed distances on 9³ points over the unit cube: Mitsuba's VOL, version 3, f32.
pub fn ball_of_distances() -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    bytes.extend(1i32.to_le_bytes());
    [9i32, 9, 9, 1].iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    [0f32, 0.0, 0.0, 1.0, 1.0, 1.0].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    for z in 0..9 {
        for y in 0..9 {
            for x in 0..9 {
                let p = [x, y, z].map(|k| f64::from(k) / 8.0 - 0.5);
                let distance = p.iter().map(|x| x * x).sum::<f64>().sqrt() - 0.4;
                bytes.extend((distance as f32).to_le_bytes());
            }
        }
    }
    bytes
}

pub fn write(path: &Path, bytes: &[u8]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

pub fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The ray from `origin` toward `target`.
pub fn ray(origin: DVec3, target: DVec3) -> Ray {
    Ray::new(origin, (target - origin).normalize())
}

/// The mean of the lanes.
pub fn mean(lanes: Lanes) -> f64 {
    lanes.to_array().iter().map(|x| f64::from(*x)).sum::<f64>() / LANES as f64
}

/// Eight wavelengths of equal weight.
pub fn wavelengths(nm: [f64; LANES]) -> SampledWavelengths {
    WavelengthDistribution::fixed(nm).unwrap().sample(0.0)
}

impl Bench {
    /// Always the wavelengths [`SPREAD_NM`]: what is left of a picture of grey things is free of
    /// colour noise, and [`Picture::y`] is then told in units of radiance 1.
    pub fn grey(mut self) -> Bench {
        self.prepared.scene.wavelengths = WavelengthDistribution::fixed(SPREAD_NM).unwrap();
        self
    }

    /// Light along `ray` at `wavelengths` for one sample.
    pub fn incoming(&self, ray: &Ray, wavelengths: &SampledWavelengths, sampler: &Sampler) -> Incoming {
        let Prepared { scene, plan, .. } = &self.prepared;
        // One ray knows nothing of paths from the lights.
        let whole = plan.caustics.is_some().then(|| EffectPlan { caustics: None, ..plan.clone() });
        let plan = whole.as_ref().unwrap_or(plan);
        match &plan.integrator {
            Integrator::Path(settings) => {
                path::radiance(scene, plan, settings, sampler, wavelengths, (ray, Sought::All), None, None)
            }
            Integrator::Whitted(settings) => whitted::radiance(scene, plan, settings, wavelengths, ray),
            other => panic!("{other:?} has no light along a ray"),
        }
    }

    /// Each lane's light along `ray` at [`SPREAD_NM`]: for what does not depend on chance.
    pub fn lanes(&self, ray: &Ray) -> [f64; LANES] {
        let sampler = Sampler::new(1, [0, 0], 0, 0);
        self.incoming(ray, &wavelengths(SPREAD_NM), &sampler).radiance.to_array().map(f64::from)
    }

    /// The mean lane of the light that comes to `from` from the direction of `to`.
    pub fn look(&self, from: DVec3, to: DVec3) -> f64 {
        self.lanes(&ray(from, to)).iter().sum::<f64>() / LANES as f64
    }

    /// `f` of `samples` paths along `ray`, in 32 independent replicates. The sequence within a
    /// replicate is of low discrepancy, so only the spread of the replicates tells the error.
    pub fn estimate_of(&self, ray: &Ray, samples: u32, f: impl Fn(&Incoming, &SampledWavelengths) -> f64) -> Estimate {
        const REPLICATES: u32 = 32;
        let each = samples.div_ceil(REPLICATES);
        let moments: Moments = (0..REPLICATES)
            .map(|replicate| {
                let sum: f64 = (0..each)
                    .map(|index| {
                        let sampler = Sampler::new(7, [3, 5], replicate, index);
                        let u = pairs(sampler.set(Set::Camera)).1.x;
                        let wavelengths = self.prepared.scene.wavelengths.sample(u);
                        f(&self.incoming(ray, &wavelengths, &sampler), &wavelengths)
                    })
                    .sum();
                sum / f64::from(each)
            })
            .collect();
        Estimate { mean: moments.mean, error: moments.standard_error() }
    }

    /// The mean over paths and lanes of the light along `ray`: for grey scenes.
    pub fn estimate(&self, ray: &Ray, samples: u32) -> Estimate {
        self.estimate_of(ray, samples, |light, _| mean(light.radiance))
    }

    /// The luminance of the light along `ray`.
    pub fn luminance(&self, ray: &Ray, samples: u32) -> Estimate {
        self.estimate_of(ray, samples, |light, wavelengths| f64::from(observer::xyz(light.radiance, wavelengths)[1]))
    }

    pub fn window(&self) -> Window {
        batch::window(&self.prepared.description)
    }

    /// Renders the picture on the current threads; what paths from the lights add is left out.
    pub fn film(&self) -> Film {
        self.frame().film
    }

    /// Renders the picture on the current threads.
    pub fn frame(&self) -> Frame {
        let filter = self.prepared.sampler().unwrap();
        let job = self.prepared.job(&filter);
        frame::render(&job, &|_| {}, &AtomicBool::new(false)).unwrap()
    }

    /// Renders the picture; the unit of `y` is that of a radiance of 1.
    pub fn picture(&self) -> Picture {
        let frame = self.frame();
        let film = &frame.film;
        // What paths from the lights bring is taken to fall into one pixel: their tests have a box for a filter.
        let cell = if self.prepared.plan.shares_cells() { reuse::SIDE as u32 } else { 1 };
        let sharing = Sharing::Near { span: 1.0, overlap: 1.0, cell };
        let xyz = frame.resolve(&ColourSpace::Xyz.matrix_from_xyz());
        let rgb = frame.resolve(&ColourSpace::Rec709.matrix_from_xyz());
        let wavelengths = &self.prepared.scene.wavelengths;
        // Wavelengths that never change are a quadrature, under which a radiance of 1 has another Y.
        let unit = if wavelengths.describe().starts_with("fixed") {
            f64::from(observer::xyz(Lanes::ONE, &wavelengths.sample(0.0))[1])
        } else {
            1.0
        };
        Picture {
            window: film.window(),
            invalid: film.invalid.total(),
            shared: frame.shared_errors(&xyz, &ColourSpace::Xyz.matrix_from_xyz(), sharing),
            y: xyz.rgb[1].iter().map(|y| f64::from(*y) / unit).collect(),
            error: xyz.standard_error[1].iter().map(|y| f64::from(*y) / unit).collect(),
            alpha: xyz.alpha.iter().map(|a| f64::from(*a)).collect(),
            rgb: (0..film.window().pixels()).map(|i| rgb.rgb.each_ref().map(|c| f64::from(c[i]))).collect(),
        }
    }

    /// One sample of a pixel, as the batch takes it.
    pub fn sample(&self, pixel: [u32; 2], index: u32) -> transport::PixelSample {
        self.traced(pixel, index).0
    }

    /// What that sample took.
    pub fn work(&self, pixel: [u32; 2], index: u32) -> transport::Work {
        self.traced(pixel, index).1
    }

    fn traced(&self, pixel: [u32; 2], index: u32) -> (transport::PixelSample, transport::Work) {
        let Prepared { scene, plan, .. } = &self.prepared;
        let filter = self.prepared.sampler().unwrap();
        let replicates = REPLICATES as u32;
        let shot = transport::Shot { scene, plan, filter: &filter, seed: 0, photons: None };
        transport::sample(&shot, pixel, index % replicates, index / replicates)
    }

    /// The ray through a place of the picture in pixels.
    pub fn camera_ray(&self, x: f64, y: f64) -> Ray {
        self.prepared.scene.camera.ray(DVec2::new(x, y), || DVec2::splat(0.5))
    }
}

impl Picture {
    /// Luminance of the pixel in column `x` and row `y` of the frame.
    pub fn at(&self, x: i32, y: i32) -> f64 {
        self.y[self.window.index([x, y]).unwrap()]
    }

    /// Every pixel is `expected` to within `tolerance`.
    #[track_caller]
    pub fn assert_all(&self, expected: f64, tolerance: f64) {
        let worst = self.y.iter().map(|y| (y - expected).abs()).fold(0.0, f64::max);
        let bad = self.y.iter().filter(|y| (*y - expected).abs() > tolerance || y.is_nan()).count();
        assert!(bad == 0, "{bad} of {} pixels are off {expected} by more than {tolerance}: {worst}", self.y.len());
    }

    /// The mean pixel. Errors of pixels add in squares, but for what they share.
    pub fn mean(&self) -> Estimate {
        let n = self.y.len() as f64;
        let variance = self.shared * self.error.iter().map(|e| e * e).sum::<f64>();
        Estimate { mean: self.y.iter().sum::<f64>() / n, error: variance.sqrt() / n }
    }
}

impl Estimate {
    /// The mean is `expected` within four standard errors, which are at most `precision` of it.
    ///
    /// With the 31 degrees of freedom of [`Bench::estimate_of`] a right renderer fails one such
    /// test in 2700; seeds are fixed, so it fails always or never. `rounding` is what f32 may add.
    #[track_caller]
    pub fn assert_is(&self, expected: f64, precision: f64) {
        // Some thirty f32 operations lie on the way of a path's light.
        let rounding = 30.0 * f64::from(f32::EPSILON) * expected.abs();
        let off = (self.mean - expected).abs();
        assert!(
            off <= 4.0 * self.error + rounding,
            "expected {expected}, found {} ± {}: {:.1} standard errors",
            self.mean,
            self.error,
            off / self.error
        );
        assert!(self.error <= precision * expected.abs(), "too noisy to tell: {self:?}, expected {expected}");
    }

    /// Two estimates of the same number.
    #[track_caller]
    pub fn assert_agrees(&self, other: &Estimate, precision: f64) {
        let error = self.error.hypot(other.error);
        let off = (self.mean - other.mean).abs();
        assert!(
            off <= 4.0 * error + 1e-5 * self.mean.abs(),
            "{self:?} and {other:?}: {:.1} standard errors",
            off / error
        );
        assert!(error <= precision * self.mean.abs(), "too noisy to tell: {self:?}, {other:?}");
    }
}

/// The bits of all sums of a film.
pub fn sums(film: &Film) -> Vec<([i128; 3], i64, u32, u32)> {
    let cells = film.cells().iter().flatten();
    cells.map(|c| (c.xyz.each_ref().map(|s| s.0), c.alpha, c.count, c.dropped)).collect()
}

/// What `work` comes to on a pool of so many threads.
pub fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

/// Relative difference of `found` from `expected` is at most `tolerance`.
#[track_caller]
pub fn assert_close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance * expected.abs(),
        "expected {expected}, found {found}: off by {:.3e} of it",
        ((found - expected) / expected).abs()
    );
}

/// A PNG of one byte a pixel; `value` by column and row from the top left.
pub fn grey_png(width: u32, height: u32, value: impl Fn(u32, u32) -> u8) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::GrayImage::from_fn(width, height, |x, y| image::Luma([value(x, y)]))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}
