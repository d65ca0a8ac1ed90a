//! `<transform>`: its steps as one matrix.

use glam::{DMat3, DMat4, DVec3, DVec4};

use super::super::super::fault::Fault;
use super::super::super::node::{Place, did_you_mean};
use super::super::super::transform::rotation;
use super::super::xml::{Attribute, Element};
use super::{Parser, attribute, check_attributes};

/// What the length of a unit vector that is written with three digits may be off by.
pub(in crate::description::mitsuba) const ABOUT_ONE: f64 = 1e-3;

/// Mitsuba's turn: Rodrigues' formula with the axis as it is written. Where that is not of length one it stretches too,
/// and files that were made by looking at the picture mean what they showed. What was rounded is taken for a unit vector.
fn turn(axis: DVec3, deg: f64) -> DMat4 {
    let turned = rotation(axis, deg);
    if is_unit(axis) {
        return turned;
    }
    let length = axis.length();
    // R = cos θ + sin θ [a]× + (1 − cos θ) a aᵀ of the unit vector a; of l a the second term has l, the third l².
    let along = axis / length;
    let outer = DMat3::from_cols(along * along.x, along * along.y, along * along.z);
    let turned = DMat3::from_mat4(turned);
    let cos = 0.5 * (turned.col(0).x + turned.col(1).y + turned.col(2).z - 1.0);
    let skew = (turned - turned.transpose()) * 0.5;
    let stretched = DMat3::from_diagonal(DVec3::splat(cos)) + skew * length + outer * ((1.0 - cos) * length * length);
    DMat4::from_mat3(stretched)
}

fn is_unit(axis: DVec3) -> bool {
    (axis.length() - 1.0).abs() <= ABOUT_ONE
}

impl Parser<'_> {
    /// The product of the steps inside, the first step nearest to the object.
    pub(super) fn transform(&mut self, element: &Element) -> std::result::Result<DMat4, Fault> {
        let mut matrix = DMat4::IDENTITY;
        for step in &element.children {
            let at = |message: String| Fault::at_place(step.place, message);
            let then = match step.tag.as_str() {
                "translate" => {
                    check_attributes(step, &[], &["value", "x", "y", "z"])?;
                    DMat4::from_translation(self.vector(step, 0.0)?.into())
                }
                "scale" => {
                    check_attributes(step, &[], &["value", "x", "y", "z"])?;
                    DMat4::from_scale(self.vector(step, 1.0)?.into())
                }
                "rotate" => {
                    check_attributes(step, &["angle"], &["value", "x", "y", "z"])?;
                    let axis = DVec3::from(self.vector(step, 0.0)?);
                    if axis == DVec3::ZERO {
                        return Err(at("expected an axis other than 0, 0, 0 in <rotate>".to_owned()));
                    }
                    if !is_unit(axis) {
                        let what = "as in Mitsuba, it stretches besides turning, and shapes but meshes may look otherwise than there";
                        let message = format!(
                            "expected an axis of length 1 in <rotate>, found one of {:.4}: {what}",
                            axis.length()
                        );
                        self.sources.note(step.place, message);
                    }
                    turn(axis, self.number(attribute(step, "angle")?)?)
                }
                "matrix" => {
                    check_attributes(step, &["value"], &[])?;
                    let written = attribute(step, "value")?;
                    match self.numbers(written)?[..] {
                        [a, b, c, d, e, f, g, h, i] => {
                            DMat4::from_cols_array(&[a, d, g, 0.0, b, e, h, 0.0, c, f, i, 0.0, 0.0, 0.0, 0.0, 1.0])
                        }
                        ref m if m.len() == 16 => self.affine(DMat4::from_cols_slice(m).transpose(), written.place),
                        ref m => {
                            let message = format!("expected 9 or 16 numbers, found {}", m.len());
                            return Err(Fault::at_place(written.place, message));
                        }
                    }
                }
                "lookat" => {
                    check_attributes(step, &["origin", "target"], &["up"])?;
                    let origin = self.triple(attribute(step, "origin")?)?;
                    let target = self.triple(attribute(step, "target")?)?;
                    let up = match step.attribute("up") {
                        Some(up) if !self.text(up)?.is_empty() => self.triple(up)?,
                        _ => DVec3::ZERO,
                    };
                    look_at(origin, target, up).ok_or_else(|| {
                        at("expected a target other than the origin and an up across the line of sight".to_owned())
                    })?
                }
                tag => {
                    let known = ["translate", "scale", "rotate", "matrix", "lookat"];
                    let hint = did_you_mean(tag, known);
                    return Err(at(format!(
                        "expected one of {} in <transform>, found <{tag}>{hint}",
                        known.join(", ")
                    )));
                }
            };
            matrix = then * matrix;
        }
        match matrix.is_finite() {
            true => Ok(matrix),
            false => Err(Fault::at_place(element.place, "expected finite numbers in the transform, found others")),
        }
    }

    /// Mitsuba's transforms are affine: the last row of a matrix is 0, 0, 0, 1 in each step, whatever stands there.
    fn affine(&mut self, matrix: DMat4, place: Place) -> DMat4 {
        let last = matrix.row(3);
        if last != DVec4::W {
            let message = format!("the last row of the matrix, {last}, is taken for 0, 0, 0, 1, as in Mitsuba");
            self.sources.note(place, message);
        }
        let rows = [matrix.row(0), matrix.row(1), matrix.row(2), DVec4::W];
        DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose()
    }

    fn triple(&mut self, attribute: &Attribute) -> std::result::Result<DVec3, Fault> {
        match self.numbers(attribute)?[..] {
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            ref other => Err(Fault::at_place(attribute.place, format!("expected 3 numbers, found {}", other.len()))),
        }
    }
}

/// +x to the left, +y up, +z to the target. Without an `up`, any.
fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> Option<DMat4> {
    let z = (target - origin).try_normalize()?;
    let up = if up == DVec3::ZERO { crate::math::Frame::from_normal(z).s } else { up };
    let x = up.cross(z).try_normalize()?;
    let y = z.cross(x);
    Some(DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), origin.extend(1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mitsuba 3.9.1's matrix of `<rotate value="1, 1, 0" angle="40"/>`, to its six digits.
    #[test]
    fn an_axis_that_is_no_unit_vector_stretches_as_in_mitsuba() {
        let rows = turn(DVec3::new(1.0, 1.0, 0.0), 40.0).transpose().to_cols_array_2d();
        let expected = [[1.0, 0.233956, 0.642788], [0.233956, 1.0, -0.642788], [-0.642788, 0.642788, 0.766044]];
        for (row, expected) in rows.iter().zip(expected) {
            assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{rows:?}");
        }
        // A rounded unit vector turns and does nothing else.
        let turned = DMat3::from_mat4(turn(DVec3::new(0.6, 0.7995, 0.0), 40.0));
        assert!((turned.determinant() - 1.0).abs() < 1e-15);
    }
}
