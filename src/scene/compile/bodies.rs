//! Bodies with a priority.

use super::Compiler;
use crate::description as written;
use crate::scene::Geometry;
use crate::scene::material::Material;
use crate::scene::shape::Shape;

impl Compiler<'_> {
    /// Why an object of this form cannot be a body with a priority, if its material asks for one.
    pub(super) fn unfit_for_a_body(
        &self,
        material: &Material,
        geometry: &Geometry,
        closed: bool,
        shape: &written::Shape,
    ) -> Option<String> {
        match material.body() {
            Ok(None) => None,
            Err(fault) => Some(fault),
            Ok(Some(_)) if !closed && !matches!(geometry, Geometry::Shape(Shape::Plane(_))) => {
                let kind = shape.geometry.kind();
                Some(format!("expected a closed shape or a plane for a material with a priority, found an open {kind}"))
            }
            Ok(Some(_)) if shape.flip_normals => {
                Some("expected normals that point out of a body with a priority, found flip_normals".into())
            }
            Ok(Some(_)) => None,
        }
    }
}
