//! The transforms that place things, as they are written.

use glam::{DMat3, DMat4, DVec3, DVec4};
use serde::Deserialize;

use super::fault::Checker;
use super::path::At;
use super::spectrum::Vec3;
use crate::error::in_short;
use crate::math::LENGTHS;

/// Three lengths, or one for all.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extent {
    /// `2`
    Number(f64),
    /// `[1, 2, 3]`
    List(Vec3),
}

impl Extent {
    /// Along x, y and z.
    #[must_use]
    pub fn xyz(self) -> Vec3 {
        match self {
            Extent::Number(length) => [length; 3],
            Extent::List(lengths) => lengths,
        }
    }

    /// Checks each number; `wrong` names what was expected where it is not met.
    pub(crate) fn check(self, at: At<'_>, checker: &mut Checker<'_>, expected: &str, holds: impl Fn(f64) -> bool) {
        match self {
            Extent::Number(number) => checker.require(holds(number), at, expected, number),
            Extent::List(numbers) => {
                for (i, number) in numbers.into_iter().enumerate() {
                    checker.require(holds(number), at.index(i), expected, number);
                }
            }
        }
    }
}

/// One step of a transform.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TransformStep {
    /// `translate: [x, y, z]`, metres.
    Translate(Vec3),
    /// `rotate: {axis: [0, 1, 0], deg: 30}`
    Rotate(Rotation),
    /// `scale: 2` or `scale: [1, 2, 1]`
    Scale(Extent),
    /// `matrix: [[…4], …4]`: rows; the last is `[0, 0, 0, 1]`.
    Matrix([[f64; 4]; 4]),
}

/// A turn about an axis through the origin, by the right hand.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Any length.
    pub axis: Vec3,
    /// Degrees.
    pub deg: f64,
}

impl TransformStep {
    /// Checks a step of a list, of which `at` is the element.
    pub(crate) fn check_in_list(&self, at: At<'_>, checker: &mut Checker<'_>) {
        self.check(at.key(self.key()), checker);
    }

    fn key(&self) -> &'static str {
        match self {
            TransformStep::Translate(_) => "translate",
            TransformStep::Rotate(_) => "rotate",
            TransformStep::Scale(_) => "scale",
            TransformStep::Matrix(_) => "matrix",
        }
    }

    pub(crate) fn check(&self, at: At<'_>, checker: &mut Checker<'_>) {
        match self {
            TransformStep::Translate(_) => {}
            TransformStep::Rotate(rotation) => checker.direction(at.key("axis"), rotation.axis),
            TransformStep::Scale(extent) => extent.check(at, checker, "a number other than 0", |x| x != 0.0),
            TransformStep::Matrix(rows) => {
                let last = rows[3];
                let expected = "the last row [0, 0, 0, 1]";
                checker.require(last == [0.0, 0.0, 0.0, 1.0], at.index(3), expected, last);
                let linear = DMat3::from_mat4(self.matrix());
                let found = format_args!("one with determinant {}", in_short(linear.determinant()));
                checker.require(is_invertible(linear), at, "a matrix that can be inverted", found);
            }
        }
    }

    /// The step as a matrix on column vectors.
    #[must_use]
    pub fn matrix(&self) -> DMat4 {
        match *self {
            TransformStep::Translate(by) => DMat4::from_translation(by.into()),
            TransformStep::Rotate(Rotation { axis, deg }) => rotation(axis.into(), deg),
            TransformStep::Scale(extent) => DMat4::from_scale(extent.xyz().into()),
            TransformStep::Matrix([x, y, z, w]) => DMat4::from_cols(x.into(), y.into(), z.into(), w.into()).transpose(),
        }
    }
}

/// Rodrigues' formula, R v = cos θ v + sin θ a × v + (1 − cos θ) (a · v) a. Quarter turns are exact.
pub(crate) fn rotation(axis: DVec3, deg: f64) -> DMat4 {
    // Dividing by the greatest component first keeps the length within range.
    let a = (axis / axis.abs().max_element()).normalize();
    let (sin, cos) = match deg.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        deg => (libm::sin(deg.to_radians()), libm::cos(deg.to_radians())),
    };
    let column = |e: DVec3| (cos * e + sin * a.cross(e) + (1.0 - cos) * a.dot(e) * a).extend(0.0);
    DMat4::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z), DVec4::W)
}

/// Also in f64: one over a determinant below 5.6e-309 is infinite.
fn is_invertible(linear: DMat3) -> bool {
    let determinant = linear.determinant();
    determinant.is_finite() && determinant != 0.0 && linear.inverse().is_finite()
}

/// What a linear map may depart from a similarity, relative to its squared scale.
///
/// A matrix of a similarity with scale s, written with six significant digits, has entries off by
/// up to 5·10⁻⁷ s; an entry of AᵀA is a sum of three products of two such entries and is off by up
/// to 2·3·5·10⁻⁷ s². Rounding of the arithmetic (10⁻¹⁵) drowns in that.
const SIMILARITY_TOLERANCE: f64 = 3e-6;

/// Whether what is on the left is on the right after it.
pub(crate) fn is_mirror(transform: DMat4) -> bool {
    DMat3::from_mat4(transform).determinant() < 0.0
}

/// Whether AᵀA = s² I, so that a ball stays a ball.
pub(crate) fn is_similarity(linear: DMat3) -> bool {
    is_similarity_but_for(linear, SIMILARITY_TOLERANCE)
}

/// The same to a departure of `tolerance`, relative to the squared scale.
pub(crate) fn is_similarity_but_for(linear: DMat3, tolerance: f64) -> bool {
    // Divided by the greatest entry, so that squares neither overflow nor vanish.
    let greatest = [linear.x_axis, linear.y_axis, linear.z_axis]
        .into_iter()
        .fold(0.0f64, |greatest, axis| greatest.max(axis.abs().max_element()));
    let unit = linear * (1.0 / greatest);
    let gram = unit.transpose() * unit;
    let squared = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let off = gram - DMat3::from_diagonal(DVec3::splat(squared));
    [off.x_axis, off.y_axis, off.z_axis].into_iter().all(|axis| axis.abs().max_element() <= tolerance * squared)
}

/// The steps of a transform as one matrix: the first step acts first.
pub(crate) fn matrix_of(steps: &[TransformStep]) -> DMat4 {
    steps.iter().fold(DMat4::IDENTITY, |before, step| step.matrix() * before)
}

/// Checks a transform; its linear part, unless there was a fault.
pub(crate) fn check_steps(steps: &[TransformStep], at: At<'_>, checker: &mut Checker<'_>) -> Option<DMat3> {
    let before = checker.count();
    for (i, step) in steps.iter().enumerate() {
        let at = at.index(i);
        step.check(at.key(step.key()), checker);
    }
    if checker.count() > before {
        return None;
    }
    // The product may overflow or vanish although each step is sound.
    let matrix = matrix_of(steps);
    let linear = DMat3::from_mat4(matrix);
    if !matrix.is_finite() || !is_invertible(linear) {
        let determinant = in_short(linear.determinant());
        checker.fault(at, format!("expected a transform that can be inverted, found determinant {determinant}"));
        return None;
    }
    let place = matrix.w_axis.truncate().abs().max_element();
    checker.require(place <= *LENGTHS.end(), at, "a transform to places up to 1e60", in_short(place));
    Some(linear)
}

/// Whether `point` is as near as all lengths are.
pub(crate) fn check_place(point: Vec3, at: At<'_>, checker: &mut Checker<'_>) {
    let reached = DVec3::from(point).abs().max_element() <= *LENGTHS.end();
    checker.require(reached, at, "three numbers up to 1e60", point);
}

/// Whether there are a view from `origin` to `target` and a direction `up`, of the fields of `at`.
pub(crate) fn check_view(origin: Vec3, target: Vec3, up: Vec3, at: At<'_>, checker: &mut Checker<'_>) -> bool {
    let before = checker.count();
    let greatest = |v: Vec3| DVec3::from(v).abs().max_element();
    for (key, point) in [("origin", origin), ("target", target)] {
        check_place(point, at.key(key), checker);
    }
    checker.direction(at.key("up"), up);
    let holds = up == [0.0; 3] || LENGTHS.contains(&greatest(up));
    let expected = "a vector of length from 1e-60 to 1e60";
    checker.require(holds, at.key("up"), expected, up);
    if checker.count() == before {
        let along = [0, 1, 2].map(|i| target[i] - origin[i]);
        let apart = greatest(along) >= *LENGTHS.start();
        checker.require(apart, at.key("target"), "a point other than the origin", target);
    }
    checker.count() == before
}

/// Whether two vectors other than zero span no plane.
///
/// Both are divided by their greatest component, which rounds each by ε/2 relative; a component of
/// the cross product then is a difference of two products, each at most 1, and is off by at most
/// 2·(2·ε/2 + ε/2) + ε/2·2 = 4ε. Vectors closer to parallel than that cannot be told from parallel.
pub(crate) fn parallel(a: Vec3, b: Vec3) -> bool {
    let unit = |v: Vec3| DVec3::from(v) / DVec3::from(v).abs().max_element();
    let cross = unit(a).cross(unit(b));
    let apart = cross.abs().max_element() > 4.0 * f64::EPSILON;
    // Subnormal vectors divide to NaN or infinity; they too have no direction that can be used.
    !apart
}

#[cfg(test)]
mod tests {
    use super::super::testing::{faults, scene};
    use super::*;

    /// Faults of a shape whose kind starts at 3:3.
    fn shape(written: &str) -> String {
        faults(&format!("shapes:\n- {written}"))
    }

    /// Faults of a transform, which starts at 3:34.
    fn transform(kind: &str, steps: &str) -> String {
        match kind {
            "sphere" => shape(&format!("sphere: {{radius: 1, transform: {steps}}}")),
            "cube" => shape(&format!("cube: {{  size: 1,   transform: {steps}}}")),
            _ => unreachable!(),
        }
    }

    #[test]
    fn a_transform_can_be_inverted() {
        let at = |step: &str| format!("shapes[0].cube.transform{step}: expected");
        assert_eq!(
            transform("cube", "[{scale: 0}]"),
            format!("dir/s.yaml:3:43: {} a number other than 0, found 0", at("[0].scale"))
        );
        assert_eq!(
            transform("cube", "[{scale: [1, 0, 1]}]"),
            format!("dir/s.yaml:3:47: {} a number other than 0, found 0", at("[0].scale[1]"))
        );
        assert_eq!(
            transform("cube", "[{rotate: {axis: [0, 0, 0], deg: 3}}]"),
            format!("dir/s.yaml:3:51: {} a vector with a direction, found [0, 0, 0]", at("[0].rotate.axis"))
        );
        assert_eq!(
            transform("cube", "[{matrix: [[1, 2, 0, 0], [2, 4, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]"),
            format!(
                "dir/s.yaml:3:44: {} a matrix that can be inverted, found one with determinant 0",
                at("[0].matrix")
            )
        );
        assert_eq!(
            transform("cube", "[{matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]}]"),
            format!("dir/s.yaml:3:87: {} the last row [0, 0, 0, 1], found [0, 0, 0, 2]", at("[0].matrix[3]"))
        );
        // The determinant is not 0, but one over it is beyond 1.8·10³⁰⁸.
        assert_eq!(
            transform("cube", "[{matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 5.0e-324, 0], [0, 0, 0, 1]]}]"),
            format!(
                "dir/s.yaml:3:44: {} a matrix that can be inverted, found one with determinant 5e-324",
                at("[0].matrix")
            )
        );
        let tiny = transform("cube", "[{scale: 1e-105}]");
        assert!(
            tiny.starts_with(&format!("dir/s.yaml:3:34: {} a transform that can be inverted, found", at(""))),
            "{tiny}"
        );
        // Each step is sound, but the determinant 10⁶⁰⁰ is beyond 1.8·10³⁰⁸.
        assert_eq!(
            transform("cube", "[{scale: 1e100}, {scale: 1e100}]"),
            format!("dir/s.yaml:3:34: {} a transform that can be inverted, found determinant inf", at(""))
        );
        assert_eq!(
            transform("cube", "[{translate: [0, 2.5e60, 0]}, {scale: 2}]"),
            format!("dir/s.yaml:3:34: {} a transform to places up to 1e60, found 5e60", at(""))
        );
    }

    #[test]
    fn a_sphere_stays_a_sphere() {
        let refused = "dir/s.yaml:3:34: shapes[0].sphere.transform: expected moves, turns and even scaling, \
                       so that a sphere stays a sphere, found a transform that stretches or shears";
        for steps in ["[{scale: [1, 2, 1]}]", "[{matrix: [[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]"] {
            assert_eq!(transform("sphere", steps), refused);
            assert_eq!(transform("cube", steps), "none");
        }
        let kept = [
            "[{scale: 2}, {rotate: {axis: [1, 2, 3], deg: 31}}, {translate: [1, 2, 3]}, {scale: 1e-90}]",
            "[{scale: [-1, 1, 1]}]",
            "[{scale: [1, 2, 1]}, {scale: [2, 1, 2]}]",
            // A turn by 30 degrees with six digits.
            "[{matrix: [[0.866025, -0.5, 0, 0], [0.5, 0.866025, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]",
        ];
        for steps in kept {
            assert_eq!(transform("sphere", steps), "none");
        }
        // A thousandth of stretching is not a slip of rounding.
        assert_eq!(transform("sphere", "[{scale: [1, 1.001, 1]}]"), refused);
        assert_eq!(
            shape("cone: {base: [0, 0, 0], apex: [0, 1, 0], radius: 1, transform: [{scale: [1, 2, 1]}]}"),
            "dir/s.yaml:3:66: shapes[0].cone.transform: expected moves, turns and even scaling, \
             so that a cone stays a cone, found a transform that stretches or shears"
        );
    }

    #[test]
    fn steps_act_in_the_order_of_the_list() {
        let matrix = |steps: &str| {
            let scene = scene(&format!("shapes:\n- cube: {{size: 1, transform: {steps}}}"));
            scene.shapes[0].world_from_object()
        };
        let point = |steps: &str| matrix(steps).transform_point3(DVec3::new(1.0, 0.0, 0.0)).to_array();
        // First to (2, 0, 0), then three times as far; or the other way round.
        assert_eq!(point("[{translate: [1, 0, 0]}, {scale: 3}]"), [6.0, 0.0, 0.0]);
        assert_eq!(point("[{scale: 3}, {translate: [1, 0, 0]}]"), [4.0, 0.0, 0.0]);
        // By the right hand about y, x goes to −z; quarter turns are exact.
        assert_eq!(point("[{rotate: {axis: [0, 2, 0], deg: 90}}]"), [0.0, 0.0, -1.0]);
        assert_eq!(point("[{rotate: {axis: [0, 1, 0], deg: -90}}]"), [0.0, 0.0, 1.0]);
        // Rows: x' = y + 5.
        assert_eq!(point("[{matrix: [[0, 1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]}]"), [5.0, 7.0, 7.0]);
    }

    #[test]
    fn a_turn_about_a_diagonal_permutes_the_axes() {
        let turned = rotation(DVec3::ONE, 120.0).transform_vector3(DVec3::X);
        // cos 120° and sin 120° carry an error of ε/2 each, the axis 2 ε; four products and sums.
        assert!((turned - DVec3::Y).abs().max_element() <= 8.0 * f64::EPSILON, "{turned}");
        // Axes of any length do.
        for length in [1e-200, 1e200] {
            assert_eq!(rotation(DVec3::Y * length, 90.0), rotation(DVec3::Y, 90.0));
        }
    }
}
