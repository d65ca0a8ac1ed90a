//! Shapes of many small parts, from files of their own.

use super::super::Geometry;
use super::super::curves::{self, Basis, Curves};
use super::super::grid::Grid;
use super::super::sdf::{SdfGrid, SdfNormals};
use super::Compiler;
use crate::description as written;
use crate::error::{Error, Result};
use glam::DAffine3;

impl Compiler<'_> {
    pub(super) fn sdf_grid(
        &mut self,
        at: &str,
        sdf: &written::SdfGrid,
        world_from_object: &DAffine3,
    ) -> Result<Option<Geometry>> {
        self.files.push(sdf.file.to_path_buf());
        let asked = |e| self.asked(&format!("{at}.file"), e);
        let grid = Grid::load(&sdf.file).map_err(asked)?;
        let normals = match sdf.normals {
            written::SdfNormals::Smooth => SdfNormals::Smooth,
            written::SdfNormals::Analytic => SdfNormals::Analytic,
        };
        let made = SdfGrid::new(&grid, world_from_object, normals)
            .map_err(|message| asked(Error::input(&sdf.file, message)))?;
        Ok(Some(Geometry::Sdf(Box::new(made))))
    }

    pub(super) fn curves(
        &mut self,
        at: &str,
        written: &written::Curves,
        world_from_object: &DAffine3,
    ) -> Result<Option<Geometry>> {
        self.files.push(written.file.to_path_buf());
        let asked = |e| self.asked(&format!("{at}.file"), e);
        let points = curves::load(&written.file).map_err(asked)?;
        let basis = match written.basis {
            written::CurveBasis::Linear => Basis::Linear,
            written::CurveBasis::Bspline => Basis::BSpline,
        };
        let made = Curves::new(&points, world_from_object, basis)
            .map_err(|message| asked(Error::input(&written.file, message)))?;
        Ok(Some(Geometry::Curves(Box::new(made))))
    }
}
