//! The light of a clear day: the sky and the sun of Hošek and Wilkie, whose fits to simulated atmospheres give radiance at
//! eleven wavelengths, W·m⁻²·sr⁻¹·nm⁻¹.
//!
//! Sky: "An Analytic Model for Full Spectral Sky-Dome Radiance" (SIGGRAPH 2012), eqs. 8 and 11. Sun: "Adding a
//! Solar-Radiance Function to the Hošek-Wilkie Skylight Model" (IEEE CG&A 33(3), 2013). Between the wavelengths radiance is
//! linear, and beyond 720 nm, where the fits end, there is none, as in Mitsuba 3. The numbers are made by
//! `tools/make_sky_model.py`.
//!
//! Directions are in the frame of the sky: +y is up, −z north and +x east.

use crate::math::frame::Frame;
use crate::math::warp::{self, one_minus_cos};
use crate::spectrum::{Carried, LANES, Lanes, Outside, Spectrum};
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::LazyLock;

/// Wavelengths of the fits.
const BANDS: usize = 11;
/// The first of them and their distance, nm.
const FIRST_NM: f32 = 320.0;
const STEP_NM: f32 = 40.0;
/// Numbers of a fit of the sky at a wavelength.
const TERMS: usize = 9;
/// Points between which those numbers run with the sun's elevation.
const CONTROLS: usize = 6;
/// Turbidities 1, 2, … 10.
const TURBIDITIES: usize = 10;
/// Grounds: black and white.
const ALBEDOS: usize = 2;
/// Pieces of the sun's fit over the elevation, and the powers of each.
const PIECES: usize = 45;
const POWERS: usize = 4;
/// Powers of the fit of how the sun's disc darkens toward its edge.
const LIMB: usize = 6;

/// Half the angle of the sun's disc for which the fits are made, radians.
const SUN_HALF_ANGLE: f64 = 0.5 * 0.5358 * PI / 180.0;

/// The most light of a place that is looked at before: others may be some times brighter, and f32 still holds them.
const MOST: f32 = f32::MAX / 16.0;

static DATA: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let bytes = include_bytes!("daylight/hosek_wilkie.f32");
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
});

/// Where the parts of [`DATA`] begin.
const RADIANCE: usize = TURBIDITIES * ALBEDOS * CONTROLS * BANDS * TERMS;
const SUN: usize = RADIANCE + TURBIDITIES * ALBEDOS * CONTROLS * BANDS;
const EDGE: usize = SUN + TURBIDITIES * PIECES * BANDS * POWERS;

/// A number for each band; those beyond are zero.
type Bands = [f32; 2 * LANES];

/// What is known of a day.
#[derive(Clone, Debug)]
pub struct Conditions {
    /// Toward the sun, unit.
    pub sun: DVec3,
    /// How hazy it is, 1 to 10.
    pub turbidity: f64,
    /// Reflectance of the ground.
    pub albedo: Spectrum,
    /// Factor on the light of the sky.
    pub sky_scale: f64,
    /// Factor on the light of the sun.
    pub sun_scale: f64,
    /// Half the angle of the sun's disc, radians; its irradiance is the same for any.
    pub sun_half_angle: f64,
    /// Whether its disc darkens toward the edge, and reddens downward.
    pub limb_darkening: bool,
    /// What its spectra become. As three numbers the disc is even.
    pub carried: Carried,
}

/// The light of a day.
#[derive(Clone, Debug)]
pub struct Daylight {
    sun: DVec3,
    sky: Option<Dome>,
    disc: Option<Disc>,
    /// What each band gives to red, green and blue, where these are carried.
    colours: Option<[[f32; BANDS]; 3]>,
}

/// The sky without the sun.
#[derive(Clone, Debug)]
struct Dome {
    terms: [[Lanes; 2]; TERMS],
    radiance: [Lanes; 2],
}

/// The disc of the sun.
#[derive(Clone, Debug)]
struct Disc {
    half_angle: f64,
    /// Mean radiance over what is seen of the disc.
    mean: Spectrum,
    /// How much of it that is: less than all where the horizon cuts it.
    seen: f64,
    /// What its radiance is made of, where it is not even.
    limb: Option<Box<Limb>>,
    /// Whether it is hidden where it hangs below the horizon.
    sets: bool,
}

/// The radiance of a place of the disc.
#[derive(Clone, Debug)]
struct Limb {
    /// By elevation.
    pieces: Vec<[[f32; POWERS]; BANDS]>,
    edge: [[f32; LIMB]; BANDS],
    scale: f64,
}

impl Daylight {
    /// The light under `conditions`, dark with the sun below the horizon; `None` where it is more than f32 holds.
    #[must_use]
    pub fn new(conditions: &Conditions) -> Option<Daylight> {
        let Conditions { sun, turbidity, albedo, sky_scale, sun_scale, sun_half_angle, limb_darkening, carried } =
            conditions;
        let up = sun.y >= 0.0;
        let elevation = libm::atan2(sun.y, sun.x.hypot(sun.z));
        let holds = |bands: &Bands| bands.iter().all(|light| *light <= MOST);
        let mut sky = None;
        if up && *sky_scale > 0.0 {
            let dome = Dome::new(elevation, *turbidity, albedo, *sky_scale);
            // A sky is brightest about the sun or at the horizon.
            let horizon = DVec3::new(sun.x, 0.0, sun.z).try_normalize().unwrap_or(DVec3::X);
            if ![*sun, DVec3::Y, horizon, -horizon].iter().all(|direction| holds(&dome.bands(*sun, *direction))) {
                return None;
            }
            sky = Some(dome);
        }
        let mut disc = None;
        if up && *sun_scale > 0.0 {
            let scale = sun_scale * one_minus_cos(SUN_HALF_ANGLE) / one_minus_cos(*sun_half_angle);
            let limb = Limb::new(*turbidity, scale);
            // Over the disc as it is: a wider one gives the same light.
            let mean = limb.mean(*sun);
            if !holds(&mean) {
                return None;
            }
            let limb = (*limb_darkening && *carried == Carried::Spectra).then(|| Box::new(limb));
            let mean = carried.light(spectrum_of(&mean));
            let half_angle = *sun_half_angle;
            let seen = over_disc(*sun, half_angle).filter(|direction| direction.y >= 0.0).count();
            disc = Some(Disc { half_angle, mean, seen: seen as f64 / f64::from(SIDE * SIDE), limb, sets: true });
        }
        Some(Daylight { sun: *sun, sky, disc, colours: carried.shares_of(&TENTS) })
    }

    /// Light from a disc alone, `toward` which is a unit vector, of `half_angle` in radians, up to π/2. A surface that faces
    /// its middle has the `irradiance`. `None` where its radiance is more than f32 holds.
    #[must_use]
    pub fn of_disc(toward: DVec3, half_angle: f64, irradiance: &Spectrum) -> Option<Daylight> {
        let disc = Disc { half_angle, mean: Spectrum::constant(1.0), seen: 1.0, limb: None, sets: false };
        let factor = 1.0 / disc.facing();
        let mean = (irradiance.max() * factor <= f64::from(MOST)).then(|| irradiance.scaled(factor))?;
        Some(Daylight { sun: toward, sky: None, disc: Some(Disc { mean, ..disc }), colours: None })
    }

    /// Whether there is light beside the disc.
    #[must_use]
    pub fn has_sky(&self) -> bool {
        self.sky.is_some()
    }

    /// Radiance from `direction`.
    #[must_use]
    pub fn radiance(&self, direction: DVec3, nm: Lanes) -> Lanes {
        let mut light = self.sky.as_ref().map_or(Lanes::ZERO, |sky| {
            let bands = sky.bands(self.sun, direction);
            match &self.colours {
                None => at_wavelengths(&bands, nm),
                Some(shares) => {
                    let sum =
                        |shares: &[f32; BANDS]| shares.iter().zip(bands).map(|(share, light)| share * light).sum();
                    let rgb: [f32; 3] = shares.each_ref().map(sum);
                    Lanes::new(nm.to_array().map(|nm| rgb[Carried::channel(nm)].max(0.0)))
                }
            }
        });
        if let Some(disc) = self.disc.as_ref().filter(|disc| disc.shows(self.sun, direction)) {
            light += match &disc.limb {
                None => disc.mean.eval(nm),
                // Each is linear between the bands, not their product.
                Some(limb) => {
                    let [middle, edge] = limb.bands(self.sun, direction, disc.half_angle);
                    at_wavelengths(&middle, nm) * at_wavelengths(&edge, nm)
                }
            };
        }
        light
    }

    /// The spectrum from `direction`, without the sun.
    #[must_use]
    pub fn sky_spectrum(&self, direction: DVec3) -> Spectrum {
        self.sky.as_ref().map_or(Spectrum::constant(0.0), |sky| spectrum_of(&sky.bands(self.sun, direction)))
    }

    /// The sun's, as a mean over what is seen of its disc, and the solid angle of that.
    #[must_use]
    pub fn sun_spectrum(&self) -> Option<(Spectrum, f64)> {
        self.disc.as_ref().map(|disc| (disc.mean.clone(), disc.seen * disc.solid_angle()))
    }

    /// Luminance of the sky from `direction`, without the sun, film units.
    #[must_use]
    pub fn sky_luminance(&self, direction: DVec3) -> f64 {
        self.sky.as_ref().map_or(0.0, |sky| luminance(&sky.bands(self.sun, direction)))
    }

    /// Toward the sun, and the irradiance of its disc across that; none below the horizon.
    #[must_use]
    pub fn sun(&self, nm: Lanes) -> Option<(DVec3, Lanes)> {
        let disc = self.disc.as_ref()?;
        Some((self.sun, disc.mean.eval(nm) * (disc.seen * disc.facing()) as f32))
    }

    /// Luminance of the sun times the solid angle that is seen of its disc.
    #[must_use]
    pub fn sun_power(&self) -> f64 {
        self.disc.as_ref().map_or(0.0, |disc| disc.mean.luminance() * disc.seen * disc.solid_angle())
    }

    /// Toward the middle of the sun, and half of its angle in radians.
    #[must_use]
    pub fn sun_disc(&self) -> Option<(DVec3, f64)> {
        self.disc.as_ref().map(|disc| (self.sun, disc.half_angle))
    }

    /// A direction toward the sun.
    #[must_use]
    pub fn sample_sun(&self, u: DVec2) -> DVec3 {
        let Some(disc) = &self.disc else { return self.sun };
        Frame::from_normal(self.sun).to_world(warp::uniform_cone(u, one_minus_cos(disc.half_angle)))
    }

    /// Density of [`Daylight::sample_sun`], sr⁻¹.
    #[must_use]
    pub fn sun_pdf(&self, direction: DVec3) -> f64 {
        match &self.disc {
            Some(disc) if disc.holds(self.sun, direction) => 1.0 / disc.solid_angle(),
            _ => 0.0,
        }
    }
}

impl Dome {
    /// The fit for the sun at an `elevation` in radians.
    fn new(elevation: f64, turbidity: f64, albedo: &Spectrum, scale: f64) -> Dome {
        // A Bézier curve of the fifth degree in the cube root of the elevation (section 5.2).
        let x = libm::cbrt(elevation / FRAC_PI_2).clamp(0.0, 1.0);
        let choose = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
        let curve: [f64; CONTROLS] = std::array::from_fn(|i| {
            let i_left = (CONTROLS - 1 - i) as i32;
            choose[i] * x.powi(i as i32) * (1.0 - x).powi(i_left)
        });
        let of = |part: &[f32], band: usize, term: usize, terms: usize| -> f64 {
            let ground = albedo.at(f64::from(FIRST_NM + STEP_NM * band as f32)).clamp(0.0, 1.0);
            let at = |turbidity: usize, albedo: usize, control: usize| {
                f64::from(part[(((turbidity * ALBEDOS + albedo) * CONTROLS + control) * BANDS + band) * terms + term])
            };
            between(turbidity, |t| {
                (0..CONTROLS).map(|c| curve[c] * (at(t, 0, c) * (1.0 - ground) + at(t, 1, c) * ground)).sum()
            })
        };
        let lanes = |value: &dyn Fn(usize) -> f64| {
            let mut all = [0.0f32; 2 * LANES];
            for (band, x) in all.iter_mut().take(BANDS).enumerate() {
                *x = value(band) as f32;
            }
            halves(&all)
        };
        Dome {
            terms: std::array::from_fn(|term| lanes(&|band| of(&DATA, band, term, TERMS))),
            radiance: lanes(&|band| scale * of(&DATA[RADIANCE..], band, 0, 1)),
        }
    }

    /// Eq. 8, with the term of eq. 11 for zenith and aureole.
    fn bands(&self, sun: DVec3, direction: DVec3) -> Bands {
        if direction.y < 0.0 {
            return [0.0; 2 * LANES];
        }
        let cos = direction.dot(sun);
        let gamma = libm::atan2(direction.cross(sun).length(), cos) as f32;
        let (rise, root) = ((1.0 / (direction.y + 0.01)) as f32, libm::sqrt(direction.y) as f32);
        let (cos, cos2) = (Lanes::splat(cos as f32), Lanes::splat((cos * cos) as f32));
        let mut all = [0.0; 2 * LANES];
        for half in 0..2 {
            let [a, b, c, d, e, f, g, i, h] = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|term| self.terms[term][half]);
            let away = Lanes::ONE + a * (b * Lanes::splat(rise)).exp();
            let glow = Lanes::ONE + h * h - h * cos * 2.0;
            let aureole = (Lanes::ONE + cos2) / (glow * glow.sqrt());
            let about = c + d * (e * Lanes::splat(gamma)).exp() + f * cos2 + g * aureole + i * Lanes::splat(root);
            // Where a fit dips below zero there is no light.
            let light = (away * about * self.radiance[half]).max(Lanes::ZERO);
            all[LANES * half..LANES * (half + 1)].copy_from_slice(&light.to_array());
        }
        all
    }
}

impl Disc {
    fn solid_angle(&self) -> f64 {
        TAU * one_minus_cos(self.half_angle)
    }

    /// What a surface that faces it has of light of radiance one.
    fn facing(&self) -> f64 {
        PI * libm::sin(self.half_angle).powi(2)
    }

    /// Whether `direction` points at the disc about `sun`: by the chord, whose square keeps small angles.
    fn holds(&self, sun: DVec3, direction: DVec3) -> bool {
        (direction - sun).length_squared() <= 2.0 * one_minus_cos(self.half_angle)
    }

    /// Whether it is seen there.
    fn shows(&self, sun: DVec3, direction: DVec3) -> bool {
        self.holds(sun, direction) && !(self.sets && direction.y < 0.0)
    }
}

impl Limb {
    fn new(turbidity: f64, scale: f64) -> Limb {
        let at = |t: usize, piece: usize, band: usize, power: usize| {
            f64::from(DATA[SUN + ((t * PIECES + piece) * BANDS + band) * POWERS + power])
        };
        let piece = |piece: usize| -> [[f32; POWERS]; BANDS] {
            std::array::from_fn(|band| {
                std::array::from_fn(|power| between(turbidity, |t| at(t, piece, band, power)) as f32)
            })
        };
        let edge = |band: usize| std::array::from_fn(|power| DATA[EDGE + band * LIMB + power]);
        Limb { pieces: (0..PIECES).map(piece).collect(), edge: std::array::from_fn(edge), scale }
    }

    /// Radiance of the middle of a disc about `sun` at the elevation of `direction`, and what is left of it there.
    fn bands(&self, sun: DVec3, direction: DVec3, half_angle: f64) -> [Bands; 2] {
        // Of where the sphere of the sun is seen there, the cosine of the angle to its normal.
        let across = direction.cross(sun).length() / libm::sin(half_angle);
        let cos = libm::sqrt((1.0 - across * across).max(0.0));
        let elevation = libm::atan2(direction.y, direction.x.hypot(direction.z)).max(0.0);
        let piece = ((libm::cbrt(elevation / FRAC_PI_2) * PIECES as f64) as usize).min(PIECES - 1);
        let x = elevation - FRAC_PI_2 * (piece as f64 / PIECES as f64).powi(3);
        let sum = |powers: &[f32], x: f64| powers.iter().rev().fold(0.0, |sum, c| sum * x + f64::from(*c));
        let mut all = [[0.0; 2 * LANES]; 2];
        let [middle, edge] = &mut all;
        for (middle, powers) in middle.iter_mut().zip(&self.pieces[piece]) {
            *middle = (self.scale * sum(powers, x)).max(0.0) as f32;
        }
        for (edge, powers) in edge.iter_mut().zip(&self.edge) {
            *edge = sum(powers, cos).max(0.0) as f32;
        }
        all
    }

    /// The mean over what is seen of the disc. Of a sun that is up that is half of it or more.
    fn mean(&self, sun: DVec3) -> Bands {
        let mut sum = [0.0f64; 2 * LANES];
        let mut count = 0u32;
        for direction in over_disc(sun, SUN_HALF_ANGLE).filter(|direction| direction.y >= 0.0) {
            let [middle, edge] = self.bands(sun, direction, SUN_HALF_ANGLE);
            for (sum, (middle, edge)) in sum.iter_mut().zip(middle.into_iter().zip(edge)) {
                *sum += f64::from(middle) * f64::from(edge);
            }
            count += 1;
        }
        sum.map(|sum| (sum / f64::from(count)) as f32)
    }
}

/// Sides of the grid that a disc is looked at by.
const SIDE: u32 = 64;

/// Directions to a disc about `sun`, of equal solid angles.
fn over_disc(sun: DVec3, half_angle: f64) -> impl Iterator<Item = DVec3> {
    let frame = Frame::from_normal(sun);
    warp::midpoints(SIDE).map(move |u| frame.to_world(warp::uniform_cone(u, one_minus_cos(half_angle))))
}

/// `f` of the turbidities, numbered from 0, around one, linear between.
fn between(turbidity: f64, f: impl Fn(usize) -> f64) -> f64 {
    let x = (turbidity - 1.0).clamp(0.0, (TURBIDITIES - 1) as f64);
    let below = (x as usize).min(TURBIDITIES - 2);
    let w = x - below as f64;
    f(below) * (1.0 - w) + f(below + 1) * w
}

fn halves(all: &Bands) -> [Lanes; 2] {
    std::array::from_fn(|half| Lanes::new(std::array::from_fn(|k| all[LANES * half + k])))
}

/// Linear between the bands.
fn at_wavelengths(bands: &Bands, nm: Lanes) -> Lanes {
    let x = ((nm - Lanes::splat(FIRST_NM)) * (1.0 / STEP_NM)).to_array();
    let mut light = [0.0; LANES];
    for (light, x) in light.iter_mut().zip(x) {
        if (0.0..=(BANDS - 1) as f32).contains(&x) {
            let below = (x as usize).min(BANDS - 2);
            *light = bands[below] + (bands[below + 1] - bands[below]) * (x - below as f32);
        }
    }
    Lanes::new(light)
}

fn spectrum_of(bands: &Bands) -> Spectrum {
    let samples: Vec<(f64, f64)> =
        (0..BANDS).map(|i| (f64::from(FIRST_NM + STEP_NM * i as f32), f64::from(bands[i]))).collect();
    Spectrum::from_samples(&samples, Outside::Zero).expect("bands rise, and their light is finite")
}

/// What each band stands for: a tent between its neighbours.
static TENTS: LazyLock<[Spectrum; BANDS]> = LazyLock::new(|| {
    std::array::from_fn(|band| {
        let mut only = [0.0; 2 * LANES];
        only[band] = 1.0;
        spectrum_of(&only)
    })
});

/// Luminance in film units.
fn luminance(bands: &Bands) -> f64 {
    static WEIGHTS: LazyLock<[f64; BANDS]> = LazyLock::new(|| TENTS.each_ref().map(Spectrum::luminance));
    WEIGHTS.iter().zip(bands).map(|(weight, light)| weight * f64::from(*light)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::uniform;
    use crate::scene::environment::{Drawn, Environment};
    use crate::spectrum::carried::PLACES_NM;
    use glam::DMat3;

    fn day(sun: [f64; 3], turbidity: f64, albedo: f64) -> Conditions {
        Conditions {
            sun: DVec3::from(sun).normalize(),
            turbidity,
            albedo: Spectrum::constant(albedo),
            sky_scale: 1.0,
            sun_scale: 1.0,
            sun_half_angle: SUN_HALF_ANGLE,
            limb_darkening: false,
            carried: Carried::Spectra,
        }
    }

    fn shining(conditions: &Conditions) -> Daylight {
        Daylight::new(conditions).expect("light that f32 holds")
    }

    const NM: [f32; LANES] = [365.0, 405.0, 450.0, 510.0, 555.0, 610.0, 680.0, 719.0];

    /// What Mitsuba 3.9.1 (`sunsky`, scalar_spectral) has in `direction` at [`NM`], told in six digits. Both compute in f32:
    /// some twenty roundings of 6e-8 in terms up to a hundred times their sum.
    #[track_caller]
    fn shows(day: &Daylight, direction: [f64; 3], expected: [f32; LANES]) {
        let found = day.radiance(DVec3::from(direction).normalize(), Lanes::new(NM)).to_array();
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() <= 1e-4 * expected, "{found} {expected}");
        }
    }

    #[test]
    fn the_sky_is_that_of_the_fits() {
        let sky = |sun, turbidity, albedo| shining(&Conditions { sun_scale: 0.0, ..day(sun, turbidity, albedo) });
        let clear = sky([-0.2, 0.5, -0.6], 3.0, 0.3);
        shows(
            &clear,
            [0.0, 1.0, 0.0],
            [0.0620497, 0.0814025, 0.0758258, 0.0513498, 0.0345107, 0.0239021, 0.0143393, 0.0111197],
        );
        shows(
            &clear,
            [-0.1, 0.05, -0.9],
            [0.120599, 0.243141, 0.350209, 0.358335, 0.301102, 0.254182, 0.184993, 0.155047],
        );
        shows(
            &clear,
            [-0.2, 0.5, -0.62],
            [0.127223, 0.207919, 0.257251, 0.256506, 0.219767, 0.194791, 0.148294, 0.12909],
        );
        shows(
            &sky([0.9, 0.03, -0.1], 1.0, 0.0),
            [0.9, 0.2, -0.1],
            [0.00797664, 0.0215577, 0.0414452, 0.0566984, 0.0544134, 0.0497057, 0.0366017, 0.030099],
        );
        shows(
            &sky([-0.1, 1.0, 0.0], 7.4, 0.8),
            [0.0, 0.001, -1.0],
            [0.133745, 0.217833, 0.274348, 0.273284, 0.258395, 0.259112, 0.23349, 0.211653],
        );
        shows(
            &sky([-0.5, 0.5, -0.5], 10.0, 1.0),
            [-0.4, 0.5, -0.5],
            [0.304201, 0.661228, 1.04329, 1.25332, 1.20156, 1.18589, 1.04943, 0.96084],
        );
    }

    #[test]
    fn the_sun_darkens_toward_its_edge_as_the_fits_say() {
        // Mitsuba scales the light of a wider disc by 1 − cos of half the usual angle in f32: 183 steps of 2⁻²⁴.
        let rounded = 183.0 / 16_777_216.0 / one_minus_cos(SUN_HALF_ANGLE);
        let sun = Conditions {
            sky_scale: 0.0,
            sun_scale: rounded,
            sun_half_angle: 2f64.to_radians(),
            limb_darkening: true,
            ..day([0.0, 0.3, -1.0], 2.5, 0.3)
        };
        let sun = shining(&sun);
        shows(
            &sun,
            [0.0, 0.287348, -0.957826],
            [25.5324, 82.6672, 173.669, 260.175, 280.932, 308.717, 301.432, 290.587],
        );
        shows(
            &sun,
            [0.0, 0.312322, -0.949976],
            [22.4538, 68.5511, 144.194, 217.95, 236.981, 263.153, 260.112, 252.406],
        );
        shows(
            &sun,
            [-0.0331552, 0.28719, -0.9573],
            [11.17, 36.1629, 85.0474, 141.523, 162.089, 188.729, 194.99, 193.068],
        );
    }

    /// The disc that darkens gives as much as the even one, and that what is said of its power, at whatever height: means over 256 by 256
    /// places, at wavelengths of the fits. The horizon goes through some 128 of the 4096 places by which the mean is told, of which each
    /// is off by half its light at the most, one way or the other: √128 / 4 / 4096, and four times that with a light that grows eightfold
    /// upward is under 1 %.
    #[test]
    fn an_even_disc_gives_what_one_that_darkens_does() {
        let nm = Lanes::new([360.0, 400.0, 440.0, 480.0, 520.0, 560.0, 600.0, 640.0]);
        for height in [0.1, 0.003, 0.0] {
            let conditions = Conditions { sky_scale: 0.0, ..day([0.3, height, -1.0], 3.0, 0.3) };
            let [even, limb] =
                [false, true].map(|limb_darkening| shining(&Conditions { limb_darkening, ..conditions.clone() }));
            let mut sums = [Lanes::ZERO; 2];
            for u in warp::midpoints(256) {
                let direction = limb.sample_sun(u);
                sums[0] += even.radiance(direction, nm);
                sums[1] += limb.radiance(direction, nm);
            }
            let [even_mean, limb_mean] = sums.map(|sum| (sum * (1.0 / 65536.0)).to_array());
            let (spectrum, angle) = even.sun_spectrum().unwrap();
            let said = (spectrum.eval(nm) * (angle / even.disc.as_ref().unwrap().solid_angle()) as f32).to_array();
            // On the horizon there is no violet at all.
            assert!(said[7] > 0.0, "{height}");
            for k in 0..8 {
                let off = [even_mean[k], limb_mean[k]].map(|mean| (mean - said[k]).abs());
                assert!(off.iter().all(|off| *off <= 0.01 * said[k]), "{height}: {off:?} {}", said[k]);
            }
        }
    }

    #[test]
    fn a_wider_sun_gives_the_same_light() {
        let power = |degrees: f64| {
            let sun_half_angle = (0.5 * degrees).to_radians();
            shining(&Conditions { sun_half_angle, ..day([0.0, 1.0, 0.2], 3.0, 0.3) }).sun_power()
        };
        for degrees in [1e-4, 0.1, 5.0, 90.0] {
            // The mean is kept in f32.
            assert!((power(degrees) / power(0.5358) - 1.0).abs() < 1e-6, "{degrees}");
        }
    }

    /// Three numbers in place of the spectrum are its colour, but for what is below zero; f32 and its sums of eleven, of which
    /// some are negative.
    #[test]
    fn as_three_numbers_a_sky_has_its_colour() {
        let spectral = day([0.2, 0.4, -1.0], 2.0, 0.3);
        let colours = shining(&Conditions { carried: Carried::Colours, ..spectral.clone() });
        let spectral = shining(&spectral);
        let [red, green, blue] = PLACES_NM.map(|nm| nm as f32);
        let nm = Lanes::new([red, green, blue, red, green, blue, red, green]);
        for direction in [DVec3::Y, DVec3::new(0.5, 0.1, 0.3).normalize(), spectral.sun] {
            let mut expected = Carried::Colours.light(spectral.sky_spectrum(direction)).eval(nm);
            if direction == spectral.sun {
                expected += Carried::Colours.light(spectral.sun_spectrum().expect("a sun").0).eval(nm);
            }
            let found = colours.radiance(direction, nm).to_array();
            for (found, expected) in found.into_iter().zip(expected.to_array()) {
                assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
            }
        }
    }

    /// Its light is refused before any of it is infinite, however it comes to be so bright.
    #[test]
    fn light_beyond_f32_is_no_day() {
        let day = day([0.2, 0.4, -1.0], 3.0, 0.3);
        let holds = |conditions: Conditions| Daylight::new(&conditions).is_some();
        for (scale, expected) in [(1e30, true), (1e38, false)] {
            assert_eq!(holds(Conditions { sky_scale: scale, ..day.clone() }), expected, "{scale}");
            assert_eq!(holds(Conditions { sun_scale: scale, ..day.clone() }), expected, "{scale}");
        }
        // A millionth of a degree, 3e11 times as bright.
        assert!(!holds(Conditions { sun_scale: 1e25, sun_half_angle: 1e-8, ..day }));
        assert!(Daylight::of_disc(DVec3::Y, 1e-6, &Spectrum::constant(1e30)).is_none());
        assert!(Daylight::of_disc(DVec3::Y, 1e-6, &Spectrum::constant(1e20)).is_some());
    }

    #[test]
    fn below_the_horizon_is_nothing() {
        let noon = shining(&day([0.0, 1.0, 0.0], 3.0, 0.3));
        assert_eq!(noon.radiance(DVec3::new(1.0, -1e-9, 0.0), Lanes::new(NM)), Lanes::ZERO);
        let night = shining(&day([1.0, -0.01, 0.0], 3.0, 0.3));
        assert_eq!(night.radiance(DVec3::Y, Lanes::new(NM)), Lanes::ZERO);
        assert_eq!(Environment::of_day(night, DMat3::IDENTITY).mean_luminance(), 0.0);
    }

    /// The spectra that stand for a day make up its mean luminance, of the sky alone, of the sun alone, and of both. Texels have the light of
    /// their middles: of the row of 128 at the horizon half may be too much or too little, π/256 of an even sky, and no more than
    /// twice that of one that is brightest there.
    #[test]
    fn the_luminance_of_a_day_is_that_of_its_spectra() {
        for (sky_scale, sun_scale) in [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let day = shining(&Conditions { sky_scale, sun_scale, ..day([0.2, 0.9, -1.0], 3.0, 0.3) });
            let map = Environment::of_day(day, DMat3::from_rotation_x(1.0));
            let sum: f64 = map.shares().iter().map(|(share, spectrum)| share * spectrum.luminance()).sum();
            let off = if sky_scale > 0.0 { std::f64::consts::PI / 128.0 } else { 1e-6 };
            assert!(
                (sum / map.mean_luminance() - 1.0).abs() < off,
                "{sky_scale} {sun_scale}: {sum} {}",
                map.mean_luminance()
            );
        }
    }

    /// Σ 1/p over drawn directions is the solid angle that is drawn from: half the sphere, and of a sun on the horizon the half
    /// that hangs below. What the mean of so many scatters by is told by its own terms; four times that.
    #[test]
    fn directions_are_drawn_by_the_density_that_is_told() {
        for (sun, half_angle) in [([0.2, 0.4, -1.0], SUN_HALF_ANGLE), ([1.0, 0.0, 0.0], 0.3)] {
            let day = shining(&Conditions { sun_half_angle: half_angle, ..day(sun, 3.0, 0.3) });
            let turned = DMat3::from_rotation_x(1.0);
            let map = Environment::of_day(day, turned);
            let n = 1 << 16;
            let angles: Vec<f64> = (0..n)
                .map(|i| {
                    let sample = map.sample(DVec2::new(uniform(0, i), uniform(1, i)), Drawn::All).expect("a direction");
                    let told = map.pdf(sample.direction, Drawn::All);
                    assert!((told / sample.pdf_solid_angle - 1.0).abs() < 1e-9, "{told}");
                    1.0 / sample.pdf_solid_angle
                })
                .collect();
            let mean = angles.iter().sum::<f64>() / n as f64;
            let variance = angles.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / n as f64;
            let scatter = (variance / n as f64).sqrt();
            let below = if half_angle > 0.1 { 0.5 * TAU * one_minus_cos(half_angle) } else { 0.0 };
            assert!((mean - TAU - below).abs() < 4.0 * scatter, "{sun:?} {mean} {scatter}");
        }
    }
}
