//! `<transform>`: its steps as one matrix.

use glam::{DMat4, DVec3};

use super::super::super::fault::Fault;
use super::super::super::node::did_you_mean;
use super::super::super::transform::rotation;
use super::super::xml::{Attribute, Element};
use super::{Parser, attribute, check_attributes};

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
                    rotation(axis, self.number(attribute(step, "angle")?)?)
                }
                "matrix" => {
                    check_attributes(step, &["value"], &[])?;
                    let written = attribute(step, "value")?;
                    match self.numbers(written)?[..] {
                        [a, b, c, d, e, f, g, h, i] => {
                            DMat4::from_cols_array(&[a, d, g, 0.0, b, e, h, 0.0, c, f, i, 0.0, 0.0, 0.0, 0.0, 1.0])
                        }
                        ref m if m.len() == 16 => DMat4::from_cols_slice(m).transpose(),
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
                    let up = step.attribute("up").map_or(Ok(DVec3::ZERO), |up| self.triple(up))?;
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
