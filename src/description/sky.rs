//! The light of a clear day, and where the sun stands.

use glam::{DMat3, DVec3};
use serde::Deserialize;

use super::emitter::{check_sphere, sphere_transform};
use super::fault::Checker;
use super::material::given_fields;
use super::path::At;
use super::spectrum::{Role, Spectrum, Vec3, one};
use super::transform::TransformStep;

/// `sky: {sun: {elevation_deg: 40}}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkyLight {
    /// For messages; default none.
    pub name: Option<String>,
    /// Where the sun stands.
    pub sun: Sun,
    /// How hazy the air is, from 1, clean, to 10; default 3.
    #[serde(default = "three")]
    pub turbidity: f64,
    /// Reflectance of the ground all around, whose light the air scatters again; default 0.3.
    #[serde(default = "ground")]
    pub albedo: Spectrum,
    /// Factor on the light of the sky; default 1.
    #[serde(default = "one")]
    pub sky_scale: f64,
    /// Factor on the light of the sun; default 1.
    #[serde(default = "one")]
    pub sun_scale: f64,
    /// Angle of the sun's disc, degrees; default 0.5358. What it gives to a surface stays the same, to 1 % up to 20 degrees, but for what
    /// the horizon cuts off a wider disc, and with `limb_darkening`, where each part of it has the light of its own height.
    #[serde(default = "sun_angle_deg")]
    pub sun_angle_deg: f64,
    /// Whether the disc is darker toward its edge; default false, even.
    #[serde(default)]
    pub limb_darkening: bool,
    /// Turns and mirrors the sky, whose zenith is +y, north −z and east +x; default none.
    #[serde(default)]
    pub transform: Vec<TransformStep>,
    /// See [`super::PointLight::sampling_weight`].
    #[serde(default = "one")]
    pub sampling_weight: f64,
}

/// Where the sun stands.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenSun")]
pub enum Sun {
    /// Toward it, in the world, of any length.
    Direction(Vec3),
    /// In the sky, degrees: above the horizon, and from north toward east.
    Angles {
        /// From −90 to 90.
        elevation_deg: f64,
        /// Any; default 0.
        azimuth_deg: f64,
    },
    /// As it is somewhere at some time.
    Place(SunPlace),
}

/// A place on the Earth and a time there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunPlace {
    /// Degrees, north.
    pub latitude_deg: f64,
    /// Degrees, east.
    pub longitude_deg: f64,
    /// What clocks there are ahead of universal time, hours; default longitude over 15, rounded.
    pub utc_offset: f64,
    /// The year; default 2000.
    pub year: u32,
    /// The month, 1 to 12; default 6.
    pub month: u32,
    /// The day of the month; default 21.
    pub day: u32,
    /// Hours since midnight, any number; default 12.
    pub hour: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenSun {
    direction: Option<Vec3>,
    elevation_deg: Option<f64>,
    azimuth_deg: Option<f64>,
    latitude_deg: Option<f64>,
    longitude_deg: Option<f64>,
    utc_offset: Option<f64>,
    year: Option<u32>,
    month: Option<u32>,
    day: Option<u32>,
    hour: Option<f64>,
}

impl TryFrom<WrittenSun> for Sun {
    type Error = String;

    fn try_from(written: WrittenSun) -> Result<Sun, String> {
        let WrittenSun { direction, elevation_deg, azimuth_deg, latitude_deg, longitude_deg, .. } = written;
        let time = [
            ("utc_offset", written.utc_offset.is_some()),
            ("year", written.year.is_some()),
            ("month", written.month.is_some()),
            ("day", written.day.is_some()),
            ("hour", written.hour.is_some()),
        ];
        let no_time = time.iter().all(|(_, given)| !given);
        match (direction, elevation_deg, azimuth_deg, latitude_deg, longitude_deg) {
            (Some(direction), None, None, None, None) if no_time => Ok(Sun::Direction(direction)),
            (None, Some(elevation_deg), azimuth_deg, None, None) if no_time => {
                Ok(Sun::Angles { elevation_deg, azimuth_deg: azimuth_deg.unwrap_or(0.0) })
            }
            (None, None, None, Some(latitude_deg), Some(longitude_deg)) => Ok(Sun::Place(SunPlace {
                latitude_deg,
                longitude_deg,
                utc_offset: written.utc_offset.unwrap_or_else(|| (longitude_deg / 15.0).round()),
                year: written.year.unwrap_or(2000),
                month: written.month.unwrap_or(6),
                day: written.day.unwrap_or(21),
                hour: written.hour.unwrap_or(12.0),
            })),
            _ => {
                let given = [
                    ("direction", direction.is_some()),
                    ("elevation_deg", elevation_deg.is_some()),
                    ("azimuth_deg", azimuth_deg.is_some()),
                    ("latitude_deg", latitude_deg.is_some()),
                    ("longitude_deg", longitude_deg.is_some()),
                ];
                let given: Vec<(&str, bool)> = given.into_iter().chain(time).collect();
                Err(format!(
                    "expected either direction, or elevation_deg (and azimuth_deg), or latitude_deg and longitude_deg (and \
                     utc_offset, year, month, day, hour), found {}",
                    given_fields(&given)
                ))
            }
        }
    }
}

impl SunPlace {
    /// Elevation and azimuth from north toward east, radians. The centre of the sun without the bending of the air, within
    /// 0.01 degrees from 1999 to 2015 and little more around (Blanco-Muriel et al. 2001, "Computing the solar vector").
    #[must_use]
    pub fn angles(&self) -> [f64; 2] {
        let hours = self.hour - self.utc_offset;
        // Days since noon of 1 January 2000, universal time.
        let days = days_since_2000(self.year, self.month, self.day) - 0.5 + hours / 24.0;
        let node = 2.1429 - 0.001_039_459_4 * days;
        let mean = 4.895_063_0 + 0.017_202_791_698 * days;
        let anomaly = 6.240_060_0 + 0.017_201_969_9 * days;
        let longitude = mean + 0.033_416_07 * libm::sin(anomaly) + 0.000_348_94 * libm::sin(2.0 * anomaly)
            - 0.000_113_4
            - 0.000_020_3 * libm::sin(node);
        let obliquity = 0.409_092_8 - 6.2140e-9 * days + 0.000_039_6 * libm::cos(node);
        let ascension = libm::atan2(libm::cos(obliquity) * libm::sin(longitude), libm::cos(longitude));
        let declination = libm::asin(libm::sin(obliquity) * libm::sin(longitude));
        let sidereal = 6.697_424_324_2 + 0.065_709_828_3 * days + hours;
        let turn = (sidereal * 15.0 + self.longitude_deg).to_radians() - ascension;
        let (sin, cos) = libm::sincos(self.latitude_deg.to_radians());
        let zenith = libm::acos(
            (cos * libm::cos(turn) * libm::cos(declination) + sin * libm::sin(declination)).clamp(-1.0, 1.0),
        );
        let azimuth = libm::atan2(-libm::sin(turn), libm::tan(declination) * cos - sin * libm::cos(turn));
        // Seen from the surface, not from the middle of the Earth.
        const PARALLAX: f64 = 6371.01 / 149_597_890.0;
        [std::f64::consts::FRAC_PI_2 - zenith - PARALLAX * libm::sin(zenith), azimuth]
    }
}

/// Days from 1 January 2000 to a day of the Gregorian calendar.
fn days_since_2000(year: u32, month: u32, day: u32) -> f64 {
    // Years begin in March, so that leap days are their last.
    let (year, month) = (i64::from(year), i64::from(month));
    let (year, month) = if month <= 2 { (year - 1, month + 9) } else { (year, month - 3) };
    let days = 365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    // 153 days in any five months from March; 1 January 2000 is day 730 425 of this count.
    (days + (153 * month + 2) / 5 + i64::from(day) - 1 - 730_425) as f64
}

impl Sun {
    /// Toward the sun in the frame of a sky, unit.
    #[must_use]
    pub fn in_sky(&self, world_from_sky: DMat3) -> DVec3 {
        let at = |elevation: f64, azimuth: f64| {
            let ((up, level), (east, north)) = (libm::sincos(elevation), libm::sincos(azimuth));
            DVec3::new(level * east, up, -level * north)
        };
        match self {
            Sun::Direction(direction) => {
                (world_from_sky.transpose() * DVec3::from(*direction).normalize_or_zero()).normalize_or_zero()
            }
            Sun::Angles { elevation_deg, azimuth_deg } => at(elevation_deg.to_radians(), azimuth_deg.to_radians()),
            Sun::Place(place) => {
                let [elevation, azimuth] = place.angles();
                at(elevation, azimuth)
            }
        }
    }

    fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        let within = |name: &str, x: f64, most: f64, checker: &mut Checker<'_>| {
            let expected = format!("an angle from -{most} to {most} degrees");
            checker.require(x.abs() <= most, at.key(name), &expected, x);
        };
        match self {
            Sun::Direction(direction) => checker.direction(at.key("direction"), *direction),
            Sun::Angles { elevation_deg, azimuth_deg } => {
                within("elevation_deg", *elevation_deg, 90.0, checker);
                checker.require(azimuth_deg.is_finite(), at.key("azimuth_deg"), "a number", *azimuth_deg);
            }
            Sun::Place(place) => {
                within("latitude_deg", place.latitude_deg, 90.0, checker);
                within("longitude_deg", place.longitude_deg, 360.0, checker);
                let offset = place.utc_offset;
                // One that is not written follows from the longitude, which has been told.
                let within = offset.abs() <= 24.0 || place.longitude_deg.abs() > 360.0;
                checker.require(within, at.key("utc_offset"), "from -24 to 24 hours", offset);
                let year = place.year;
                checker.require((1900..=2100).contains(&year), at.key("year"), "a year from 1900 to 2100", year);
                let month = place.month;
                checker.require((1..=12).contains(&month), at.key("month"), "a month from 1 to 12", month);
                if (1..=12).contains(&month) {
                    let next = days_since_2000(year + month / 12, month % 12 + 1, 1);
                    let days = (next - days_since_2000(year, month, 1)) as u32;
                    let expected = format!("a day from 1 to {days}");
                    checker.require((1..=days).contains(&place.day), at.key("day"), &expected, place.day);
                }
                let hour = place.hour;
                checker.require(hour.abs() <= 1e6, at.key("hour"), "a number of hours up to a million", hour);
            }
        }
    }
}

impl SkyLight {
    /// Sky to world: turns and mirrors only.
    #[must_use]
    pub fn world_from_sky(&self) -> DMat3 {
        sphere_transform(0.0, &self.transform)
    }

    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        self.sun.check(at.key("sun"), checker);
        let clear = (1.0..=10.0).contains(&self.turbidity);
        checker.require(clear, at.key("turbidity"), "a number from 1 to 10", self.turbidity);
        self.albedo.check(Role::Reflectance, at.key("albedo"), checker);
        for (name, scale) in [("sky_scale", self.sky_scale), ("sun_scale", self.sun_scale)] {
            Spectrum::Number(scale).check(Role::Emission, at.key(name), checker);
        }
        let angle = self.sun_angle_deg;
        // Smaller ones end in what f64 tells apart.
        let within = (1e-4..=90.0).contains(&angle);
        checker.require(within, at.key("sun_angle_deg"), "an angle from 0.0001 to 90 degrees", angle);
        check_sphere(&self.transform, at.key("transform"), checker);
    }
}

fn three() -> f64 {
    3.0
}

fn ground() -> Spectrum {
    Spectrum::Number(0.3)
}

fn sun_angle_deg() -> f64 {
    0.5358
}

#[cfg(test)]
mod tests {
    use super::super::Light;
    use super::super::testing::{faults, scene};
    use super::*;

    fn light(written: &str) -> String {
        faults(&format!("lights:\n- sky: {{{written}}}"))
    }

    /// Reda and Andreas 2003, "Solar Position Algorithm for Solar Radiation Applications", table A5.1: topocentric elevation
    /// without refraction and azimuth. The shorter formulas are within 0.01 degrees.
    #[test]
    fn the_sun_stands_where_almanacs_have_it() {
        let place = SunPlace {
            latitude_deg: 39.742_476,
            longitude_deg: -105.178_6,
            utc_offset: -7.0,
            year: 2003,
            month: 10,
            day: 17,
            hour: 12.0 + (30.0 + 30.0 / 60.0) / 60.0,
        };
        let [elevation, azimuth] = place.angles().map(f64::to_degrees);
        assert!((elevation - 39.872_046).abs() < 0.01, "{elevation}");
        assert!((azimuth.rem_euclid(360.0) - 194.340_24).abs() < 0.01, "{azimuth}");
    }

    #[test]
    fn days_are_those_of_the_calendar() {
        for (days, date) in [(0.0, (2000, 1, 1)), (59.0, (2000, 2, 29)), (60.0, (2000, 3, 1)), (366.0, (2001, 1, 1))] {
            assert_eq!(days_since_2000(date.0, date.1, date.2), days);
        }
        // 1900 had no leap day: a century of 24 of them.
        assert_eq!(days_since_2000(1900, 1, 1), -f64::from(365 * 100 + 24));
    }

    #[test]
    fn directions_are_in_the_world_and_angles_in_the_sky() {
        let sky = |written: &str| {
            let scene =
                scene(&format!("lights:\n- sky: {{{written}, transform: [{{rotate: {{axis: [1, 0, 0], deg: 90}}}}]}}"));
            let Light::Sky(sky) = &scene.lights[0] else { panic!("a sky") };
            (sky.sun.in_sky(sky.world_from_sky()), sky.world_from_sky())
        };
        // East at the horizon; the zenith, which a quarter turn about x takes to z.
        let (east, _) = sky("sun: {elevation_deg: 0, azimuth_deg: 90}");
        assert!((east - DVec3::X).length() < 1e-15);
        let (zenith, world_from_sky) = sky("sun: {direction: [0, 0, 3]}");
        assert!((zenith - DVec3::Y).length() < 1e-15 && (world_from_sky * DVec3::Y - DVec3::Z).length() < 1e-15);
    }

    #[test]
    fn what_a_sky_cannot_be_is_told() {
        let place = "dir/s.yaml:3:14: lights[0].sky.sun: expected either direction, or elevation_deg (and azimuth_deg), or \
                     latitude_deg and longitude_deg (and utc_offset, year, month, day, hour), found ";
        assert_eq!(light("sun: {}"), format!("{place}neither"));
        assert_eq!(light("sun: {direction: [0, 1, 0], hour: 3}"), format!("{place}direction and hour"));
        assert_eq!(light("sun: {latitude_deg: 3}"), format!("{place}latitude_deg"));
        assert_eq!(
            light("sun: {elevation_deg: 91}, turbidity: 11, sun_angle_deg: 0, albedo: 1.5, sky_scale: -1"),
            "dir/s.yaml:3:30: lights[0].sky.sun.elevation_deg: expected an angle from -90 to 90 degrees, found 91\n\
             dir/s.yaml:3:46: lights[0].sky.turbidity: expected a number from 1 to 10, found 11\n\
             dir/s.yaml:3:65: lights[0].sky.sun_angle_deg: expected an angle from 0.0001 to 90 degrees, found 0\n\
             dir/s.yaml:3:76: lights[0].sky.albedo: expected a number from 0 to 1, found 1.5\n\
             dir/s.yaml:3:92: lights[0].sky.sky_scale: expected a number of 0 or more, found -1"
        );
        // The offset that follows from the longitude, 33 hours, is not written.
        assert_eq!(
            light("sun: {latitude_deg: 50, longitude_deg: 500}"),
            "dir/s.yaml:3:48: lights[0].sky.sun.longitude_deg: expected an angle from -360 to 360 degrees, found 500"
        );
        assert_eq!(
            light("sun: {latitude_deg: 50, longitude_deg: 11, year: 2023, month: 2, day: 29}"),
            "dir/s.yaml:3:79: lights[0].sky.sun.day: expected a day from 1 to 28, found 29"
        );
        assert_eq!(
            light("sun: {latitude_deg: 50, longitude_deg: 11, year: 2024, month: 2, day: 29, hour: 25}"),
            "none"
        );
    }
}
