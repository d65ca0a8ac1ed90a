//! The camera, as it is written.

use glam::DMat3;
use serde::Deserialize;

use super::decode::whole_or_none;
use super::fault::{Checker, Found};
use super::material::given_fields;
use super::path::At;
use super::spectrum::Vec3;
use super::transform::{TransformStep, check_view, is_similarity_but_for, parallel};
use crate::error::in_short;
use crate::math::LENGTHS;

/// `camera: {origin: [0, 3.2, 12], target: [0, 1.1, 0], fov_deg: 38}`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WrittenCamera")]
pub struct Camera {
    /// Where it stands and how it is turned.
    pub pose: Pose,
    /// How the scene falls on the picture.
    pub projection: Projection,
    /// Depth of field; default none.
    pub lens: Option<Lens>,
    /// What lies nearer or farther is not seen; default all is.
    pub clip: Clip,
    /// Where the line of sight meets the picture, from its middle to the right and down, in widths and heights;
    /// default `[0, 0]`.
    pub principal_point: [f64; 2],
    /// When it is open; default at one moment.
    pub shutter: Option<Shutter>,
}

/// `shutter: 0.5`, or `shutter: {open: -0.25, close: 0.25}`: when light is taken, in frames from the frame.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shutter {
    /// For so much of a frame, around the frame: 0.5 is a shutter of 180°.
    Number(f64),
    /// From when to when.
    Inline(ShutterTimes),
}

/// When a shutter opens and closes, in frames from the frame.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShutterTimes {
    /// When it opens.
    pub open: f64,
    /// When it closes.
    pub close: f64,
    /// At how many moments in between the scene is looked at; default by what moves.
    #[serde(default, deserialize_with = "whole_or_none::<_, 2, MOST_MOMENTS>")]
    pub moments: Option<u32>,
}

/// Frames for which a shutter may be open that is told by how long: what is more is taken for an angle.
const LONGEST: f64 = 8.0;

/// Frames from its own at which a shutter opens or closes at the most.
const FARTHEST: f64 = 1e9;
/// The most moments at which a scene is looked at.
const MOST_MOMENTS: u32 = 256;

impl Shutter {
    /// When it opens and closes.
    #[must_use]
    pub fn times(&self) -> ShutterTimes {
        match *self {
            Shutter::Number(share) => ShutterTimes { open: -0.5 * share, close: 0.5 * share, moments: None },
            Shutter::Inline(times) => times,
        }
    }

    fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        match self {
            Shutter::Number(share) if *share > LONGEST => {
                let wanted =
                    format!("at most {LONGEST} frames (a shutter of 180° is 0.5), or when it opens and closes");
                checker.fault(at, format!("expected {wanted}, found {}", in_short(*share)));
            }
            Shutter::Number(share) => checker.positive(at, *share),
            Shutter::Inline(times) => {
                let found = format!("{} and {}", in_short(times.open), in_short(times.close));
                checker.require(times.open < times.close, at, "open before close", found);
                for (key, time) in [("open", times.open), ("close", times.close)] {
                    checker.require(
                        time.is_nan() || time.abs() <= FARTHEST,
                        at.key(key),
                        "a number of frames from -1e9 to 1e9",
                        in_short(time),
                    );
                }
                checker.whole_between(at.key("moments"), times.moments.unwrap_or(2), 2, MOST_MOMENTS);
            }
        }
    }
}

/// Distances along the line of sight between which the camera sees, metres.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clip {
    /// Default 0.
    #[serde(default)]
    pub near: f64,
    /// Default no end.
    #[serde(default = "endless")]
    pub far: f64,
}

impl Default for Clip {
    fn default() -> Clip {
        Clip { near: 0.0, far: endless() }
    }
}

fn endless() -> f64 {
    f64::INFINITY
}

/// Where a camera stands and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pose {
    /// `origin: [0, 3.2, 12], target: [0, 1.1, 0], up: [0, 1, 0]`
    LookAt {
        /// Where it stands, metres.
        origin: Vec3,
        /// What it looks at, metres.
        target: Vec3,
        /// What is up in the picture; default `[0, 1, 0]`.
        up: Vec3,
    },
    /// `to_world: [[…4], …4]`: rows of the matrix on column vectors from the camera, which looks along
    /// +z with +x to the right and +y up, to the world. It may mirror; an orthographic camera's may also
    /// stretch the picture.
    ToWorld([[f64; 4]; 4]),
}

/// How the scene falls on the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// `fov_deg: 38, fov_axis: x`
    Perspective {
        /// Full angle of view along the axis, degrees, between 0 and 180.
        fov_deg: f64,
        /// The axis; default `x`.
        fov_axis: FovAxis,
    },
    /// `orthographic_height: 4`
    Orthographic {
        /// What the height of the picture shows, metres.
        height: f64,
    },
}

/// The side of the picture along which the angle of view is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FovAxis {
    /// Its width.
    #[default]
    X,
    /// Its height.
    Y,
    /// The shorter side.
    Smaller,
    /// The longer side.
    Larger,
    /// Corner to corner.
    Diagonal,
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Of the aperture, metres; 0 is a pinhole.
    pub radius: f64,
    /// From the camera to the plane in focus, along the line of sight, metres.
    pub focus_distance: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenCamera {
    origin: Option<Vec3>,
    target: Option<Vec3>,
    up: Option<Vec3>,
    to_world: Option<[[f64; 4]; 4]>,
    fov_deg: Option<f64>,
    fov_axis: Option<FovAxis>,
    orthographic_height: Option<f64>,
    lens: Option<Lens>,
    #[serde(default)]
    clip: Clip,
    #[serde(default)]
    principal_point: [f64; 2],
    shutter: Option<Shutter>,
}

impl TryFrom<WrittenCamera> for Camera {
    type Error = String;

    fn try_from(written: WrittenCamera) -> Result<Camera, String> {
        let WrittenCamera {
            origin,
            target,
            up,
            to_world,
            fov_deg,
            fov_axis,
            orthographic_height,
            lens,
            clip,
            principal_point,
            shutter,
        } = written;
        let pose = match (origin, target, to_world) {
            (Some(origin), Some(target), None) => Pose::LookAt { origin, target, up: up.unwrap_or([0.0, 1.0, 0.0]) },
            (None, None, Some(to_world)) if up.is_none() => Pose::ToWorld(to_world),
            (origin, target, to_world) => {
                let given = [
                    ("origin", origin.is_some()),
                    ("target", target.is_some()),
                    ("up", up.is_some()),
                    ("to_world", to_world.is_some()),
                ];
                return Err(format!("expected either origin and target, or to_world, found {}", given_fields(&given)));
            }
        };
        let projection = match (fov_deg, fov_axis, orthographic_height) {
            (Some(fov_deg), fov_axis, None) => {
                Projection::Perspective { fov_deg, fov_axis: fov_axis.unwrap_or_default() }
            }
            (None, None, Some(height)) => Projection::Orthographic { height },
            (fov_deg, fov_axis, height) => {
                let given = [
                    ("fov_deg", fov_deg.is_some()),
                    ("fov_axis", fov_axis.is_some()),
                    ("orthographic_height", height.is_some()),
                ];
                return Err(format!("expected either fov_deg or orthographic_height, found {}", given_fields(&given)));
            }
        };
        Ok(Camera { pose, projection, lens, clip, principal_point, shutter })
    }
}

impl Pose {
    fn check(self, projection: Projection, at: At<'_>, checker: &mut Checker<'_>) {
        match self {
            Pose::LookAt { origin, target, up } => {
                let along = [0, 1, 2].map(|i| target[i] - origin[i]);
                if check_view(origin, target, up, at, checker) && parallel(along, up) {
                    checker.require(
                        false,
                        at.key("up"),
                        "a direction across the line of sight",
                        format_args!("{}, which is parallel to it", up.in_words()),
                    );
                }
            }
            Pose::ToWorld(rows) => {
                let at = at.key("to_world");
                let before = checker.count();
                TransformStep::Matrix(rows).check(at, checker);
                if checker.count() != before {
                    return;
                }
                let matrix = TransformStep::Matrix(rows).matrix();
                let linear = DMat3::from_mat4(matrix);
                match projection {
                    Projection::Perspective { .. } => {
                        let found = "a matrix that scales or shears";
                        checker.require(is_rigid(linear), at, "moves, turns and mirrors for a perspective", found);
                    }
                    Projection::Orthographic { .. } => {
                        let lengths =
                            [linear.x_axis, linear.y_axis, linear.z_axis].map(|axis| axis.abs().max_element());
                        if let Some(length) = lengths.into_iter().find(|length| !LENGTHS.contains(length)) {
                            checker.require(false, at, "axes of length from 1e-60 to 1e60", in_short(length));
                        }
                    }
                }
                let place = matrix.w_axis.truncate().abs().max_element();
                checker.require(place <= *LENGTHS.end(), at, "a place up to 1e60", in_short(place));
            }
        }
    }
}

/// What products of the axes of a rigid motion, written with four significant digits, may be off by: entries are by up to 5·10⁻⁵, and
/// a product is a sum of three of two such each.
const RIGHT_ANGLE_TOLERANCE: f64 = 3e-4;

/// What the volume of a rigid motion, written with four significant digits, may be off by.
const RIGID_TOLERANCE: f64 = 3e-3;

/// Whether a linear map is a turn, or one in a mirror, as far as four digits tell.
pub(crate) fn is_rigid(linear: DMat3) -> bool {
    let similar = is_similarity_but_for(linear, RIGHT_ANGLE_TOLERANCE);
    similar && (linear.determinant().abs() - 1.0).abs() < RIGID_TOLERANCE
}

impl Camera {
    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        self.pose.check(self.projection, at, checker);
        match self.projection {
            Projection::Perspective { fov_deg, fov_axis: _ } => {
                let within = fov_deg > 0.0 && fov_deg < 180.0;
                checker.require(within, at.key("fov_deg"), "an angle between 0 and 180 degrees", fov_deg);
            }
            Projection::Orthographic { height } => check_length(at.key("orthographic_height"), height, checker),
        }
        if let Some(lens) = self.lens {
            let at = at.key("lens");
            checker.require((0.0..=*LENGTHS.end()).contains(&lens.radius), at.key("radius"), LENGTH, lens.radius);
            check_length(at.key("focus_distance"), lens.focus_distance, checker);
        }
        let aside = self.principal_point.into_iter().all(|share| share.abs() <= *LENGTHS.end());
        checker.require(aside, at.key("principal_point"), "two numbers from -1e60 to 1e60", self.principal_point);
        if let Some(shutter) = &self.shutter {
            shutter.check(at.key("shutter"), checker);
        }
        let clip = at.key("clip");
        checker.require((0.0..=*LENGTHS.end()).contains(&self.clip.near), clip.key("near"), LENGTH, self.clip.near);
        checker.require(self.clip.far > self.clip.near, clip.key("far"), "more than near", self.clip.far);
    }
}

/// A length of what is looked through.
fn check_length(at: At<'_>, length: f64, checker: &mut Checker<'_>) {
    checker.positive(at, length);
    // What is not greater than 0 has been told.
    checker.require(length <= 0.0 || LENGTHS.contains(&length), at, "a number from 1e-60 to 1e60", length);
}

/// A length or none.
const LENGTH: &str = "a number from 0 to 1e60";

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, parse};
    use super::*;

    fn camera(fields: &str) -> String {
        parse(&format!("camera: {{{fields}}}")).map_or_else(|error| error.to_string(), |_| "none".to_owned())
    }

    #[test]
    fn a_camera_that_sees_nothing_is_refused() {
        assert_eq!(
            camera("origin: [1, 2, 3], target: [1, 2, 3], fov_deg: 40"),
            "dir/s.yaml:1:37: camera.target: expected a point other than the origin, found [1, 2, 3]"
        );
        // (1, 2, 3)/10 and (3, 6, 9)/7 are parallel up to rounding only.
        assert_eq!(
            camera("origin: [0, 0, 0], target: [0.1, 0.2, 0.3], up: [3, 6, 9], fov_deg: 40"),
            "dir/s.yaml:1:58: camera.up: expected a direction across the line of sight, \
             found [3, 6, 9], which is parallel to it"
        );
        assert_eq!(
            camera("origin: [1, 2, 3], target: [1, 5, 3], fov_deg: 40"),
            "dir/s.yaml:1:9: camera.up: expected a direction across the line of sight, \
             found [0, 1, 0], which is parallel to it"
        );
        assert_eq!(
            camera("origin: [0, 0, 0], target: [0, 0, 1], up: [0, 0, 0], fov_deg: 40"),
            "dir/s.yaml:1:52: camera.up: expected a vector with a direction, found [0, 0, 0]"
        );
        // A millionth of a degree off is not parallel.
        assert_eq!(camera("origin: [0, 0, 0], target: [0, 1, 1e-8], up: [0, 1, 0], fov_deg: 40"), "none");
    }

    #[test]
    fn the_angle_of_view_lies_between_0_and_180() {
        for fov in ["0", "180", "-3"] {
            assert_eq!(
                camera(&format!("origin: [0, 0, 5], target: [0, 0, 0], fov_deg: {fov}")),
                format!("dir/s.yaml:1:57: camera.fov_deg: expected an angle between 0 and 180 degrees, found {fov}")
            );
        }
    }

    #[test]
    fn a_camera_has_one_projection() {
        let start = "origin: [0, 0, 5], target: [0, 0, 0]";
        assert_eq!(
            camera(start),
            "dir/s.yaml:1:9: camera: expected either fov_deg or orthographic_height, found neither"
        );
        assert_eq!(
            camera(&format!("{start}, fov_deg: 3, orthographic_height: 1")),
            "dir/s.yaml:1:9: camera: expected either fov_deg or orthographic_height, \
             found fov_deg and orthographic_height"
        );
        let scene = parse(&format!("camera: {{{start}, orthographic_height: 4}}")).unwrap();
        assert_eq!(scene.camera.projection, Projection::Orthographic { height: 4.0 });
    }

    #[test]
    fn a_lens_has_a_focus() {
        assert_eq!(
            camera("origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 9, lens: {radius: -1, focus_distance: 0}"),
            "dir/s.yaml:1:75: camera.lens.radius: expected a number from 0 to 1e60, found -1\n\
             dir/s.yaml:1:95: camera.lens.focus_distance: expected a number greater than 0, found 0"
        );
    }

    /// Squares of rays overflowed beyond 1e154, and vanished below 1e-154: the picture was of the sky alone.
    #[test]
    fn lengths_of_a_camera_have_squares() {
        let eye = "origin: [0, 0, 5], target: [0, 0, 0]";
        let rows = |z: &str| {
            format!("to_world: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, {z}, 0], [0, 0, 0, 1]], orthographic_height: 1")
        };
        for (fields, told) in [
            (
                format!("{eye}, fov_deg: 9, lens: {{radius: 1, focus_distance: 1.0e155}}"),
                "lens.focus_distance: expected a number from 1e-60 to 1e60, found 1e155",
            ),
            (
                format!("{eye}, fov_deg: 9, principal_point: [1.0e160, 0]"),
                "principal_point: expected two numbers from -1e60 to 1e60, found [1e160, 0]",
            ),
            (
                format!("{eye}, orthographic_height: 1.0e308"),
                "orthographic_height: expected a number from 1e-60 to 1e60, found 1e308",
            ),
            (rows("1.0e-170"), "to_world: expected axes of length from 1e-60 to 1e60, found 1e-170"),
            (rows("1.0e200"), "to_world: expected axes of length from 1e-60 to 1e60, found 1e200"),
            (
                rows("1").replace("[1, 0, 0, 0]", "[1, 0, 0, 1.0e200]"),
                "to_world: expected a place up to 1e60, found 1e200",
            ),
        ] {
            let found = camera(&fields);
            assert!(found.ends_with(&format!(": camera.{told}")), "{found}");
        }
        assert_eq!(camera(&rows("1.0e-60")), "none");
    }

    #[test]
    fn what_is_too_far_away_for_a_view_is_told_by_its_own_field() {
        let told = |fields: &str| parse(&format!("camera: {{{fields}, fov_deg: 40}}")).unwrap_err().to_string();
        for (fields, message) in [
            (
                "origin: [0, 0, 1e300], target: [0, 0, 0]",
                "1:18: camera.origin: expected three numbers up to 1e60, found [0, 0, 1e300]",
            ),
            (
                "target: [-1e61, 0, 0], origin: [0, 0, 0]",
                "1:18: camera.target: expected three numbers up to 1e60, found [-1e61, 0, 0]",
            ),
            (
                "up: [0, 1e300, 0], origin: [0, 0, 1], target: [0, 0, 0]",
                "1:14: camera.up: expected a vector of length from 1e-60 to 1e60, found [0, 1e300, 0]",
            ),
            (
                "up: [0, 1e-300, 0], origin: [0, 0, 1], target: [0, 0, 0]",
                "1:14: camera.up: expected a vector of length from 1e-60 to 1e60, found [0, 1e-300, 0]",
            ),
            (
                "origin: [0, 0, 0], target: [0, 0, 1e-300]",
                "1:37: camera.target: expected a point other than the origin, found [0, 0, 1e-300]",
            ),
        ] {
            assert_eq!(told(fields), format!("dir/s.yaml:{message}"));
        }
        assert_eq!(
            faults("lights: [{projector: {origin: [1e300, 0, 0], target: [0, 0, 0], fov_deg: 40}}]"),
            "dir/s.yaml:2:31: lights[0].projector.origin: expected three numbers up to 1e60, found [1e300, 0, 0]"
        );
    }
}
