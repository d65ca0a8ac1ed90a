//! Shapes of many small parts, from files of their own.

use super::super::Geometry;
use super::super::curves::{self, Basis, Curves};
use super::super::grid::Grid;
use super::super::sdf::{Distances, SdfGrid, SdfNormals};
use super::super::shelf::Shelf;
use super::Compiler;
use crate::description as written;
use crate::error::{Error, Result};
use glam::DAffine3;
use std::sync::Arc;

impl Compiler<'_> {
    pub(super) fn sdf_grid(
        &mut self,
        at: &str,
        sdf: &written::SdfGrid,
        world_from_object: &DAffine3,
    ) -> Result<Option<Geometry>> {
        self.files.push(sdf.file.to_path_buf());
        let normals = match sdf.normals {
            written::SdfNormals::Smooth => SdfNormals::Smooth,
            written::SdfNormals::Analytic => SdfNormals::Analytic,
        };
        let broken = |message| Error::input(&sdf.file, message);
        let load = || Distances::new(Grid::load(&sdf.file)?).map_err(broken);
        let distances = self.shelf.distances.get(&sdf.file, (), load);
        let made = distances.and_then(|d| SdfGrid::new(d, world_from_object, normals).map_err(broken));
        Ok(Some(Geometry::Sdf(Box::new(made.map_err(|e| self.asked(&format!("{at}.file"), e))?))))
    }

    pub(super) fn curves(
        &mut self,
        at: &str,
        written: &written::Curves,
        world_from_object: &DAffine3,
    ) -> Result<Option<Geometry>> {
        self.files.push(written.file.to_path_buf());
        let basis = match written.basis {
            written::CurveBasis::Linear => Basis::Linear,
            written::CurveBasis::Bspline => Basis::BSpline,
        };
        let Shelf { strands, curves, .. } = &mut self.shelf;
        let make = || {
            let read = strands.get(&written.file, (), || curves::load(&written.file).map(Arc::new))?;
            let made = Curves::new(&read, world_from_object, basis);
            made.map(Arc::new).map_err(|message| Error::input(&written.file, message))
        };
        let made = curves.get(&written.file, (world_from_object.to_cols_array().map(f64::to_bits), basis), make);
        Ok(Some(Geometry::Curves(made.map_err(|e| self.asked(&format!("{at}.file"), e))?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::scene::compile::testing::compiled_with;
    use crate::scene::grid::testing::vol;
    use glam::DVec3;

    /// A scene of `shape` alone, moved by `x`.
    fn at(directory: &tempfile::TempDir, shelf: &mut Shelf, shape: &str, x: f64) -> Scene {
        let text = format!(
            "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
             shapes: [{shape}, transform: [{{translate: [{x}, 0, 0]}}]}}]\n"
        );
        compiled_with(directory.path(), &text, shelf)
    }

    /// The moments while a shutter is open share the numbers of a grid, and each has it in its own place. Between -1 and 1
    /// the zero is in the middle of the one cell, and its box the unit cube.
    #[test]
    fn a_distance_grid_that_moves_is_read_once() {
        let directory = tempfile::tempdir().unwrap();
        let values = [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0];
        std::fs::write(directory.path().join("wall.vol"), vol([2; 3], 1, &values)).unwrap();
        let mut shelf = Shelf::default();
        let mut placed = |x: f64| at(&directory, &mut shelf, "sdf_grid: {file: wall.vol", x);
        let scenes = [placed(0.0), placed(2.0)];
        let [here, there] = scenes.each_ref().map(|scene| match &scene.objects[0].geometry {
            Geometry::Sdf(sdf) => sdf,
            _ => panic!("a grid"),
        });
        assert!(here.distances.shares(&there.distances));
        assert!((here.bounds().min - DVec3::ZERO).length() < 1e-12);
        assert!((there.bounds().min - DVec3::X * 2.0).length() < 1e-12);
    }

    /// Curves are there once as long as they stand, and are not read again to stand elsewhere.
    #[test]
    fn curves_that_stand_are_made_once() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("hair.txt"), "0 0 0 0.1\n0 1 0 0.1\n").unwrap();
        let mut shelf = Shelf::default();
        let mut placed = |x: f64| {
            let scene = at(&directory, &mut shelf, "curves: {file: hair.txt, basis: linear", x);
            let strands = shelf.strands.find(&directory.path().join("hair.txt"), ());
            match &scene.objects[0].geometry {
                Geometry::Curves(curves) => (curves.clone(), strands),
                _ => panic!("curves"),
            }
        };
        let ((here, read), (there, again)) = (placed(0.0), placed(2.0));
        assert!(Arc::ptr_eq(&read.unwrap(), &again.unwrap()));
        assert!(!Arc::ptr_eq(&here, &there) && Arc::ptr_eq(&there, &placed(2.0).0));
        assert!((here.bounds().min.x - -0.1).abs() < 1e-12 && (there.bounds().min.x - 1.9).abs() < 1e-12);
    }
}
