//! Shapes.

use glam::{DMat4, DVec3};

use super::super::fault::Fault;
use super::object::{Bag, Family};
use super::{Fields, Import, entry, list, matrix, number, numbers, text};

const SHAPES: [&str; 10] =
    ["sphere", "cylinder", "disk", "rectangle", "cube", "obj", "ply", "sdfgrid", "linearcurve", "bsplinecurve"];

impl Import<'_> {
    /// Adds a shape of the scene to `shapes`.
    pub(crate) fn shape(&mut self, index: usize) -> Result<(), Fault> {
        let bag = self.bag(index);
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        let to_world = bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY);
        if to_world != DMat4::IDENTITY {
            let at = bag.place("to_world");
            fields.add("transform", list(at, [entry(at, "matrix", matrix(at, to_world))]));
        }
        let kind = match bag.object.plugin.as_str() {
            "sphere" => {
                fields.add("center", numbers(bag.place("center"), &bag.vector("center")?.unwrap_or_default()));
                fields.add("radius", number(bag.place("radius"), bag.float("radius")?.unwrap_or(1.0)));
                upright(&bag)?;
                "sphere"
            }
            "cylinder" => {
                fields.add("base", numbers(bag.place("p0"), &bag.vector("p0")?.unwrap_or_default()));
                fields.add("top", numbers(bag.place("p1"), &bag.vector("p1")?.unwrap_or([0.0, 0.0, 1.0])));
                fields.add("radius", number(bag.place("radius"), bag.float("radius")?.unwrap_or(1.0)));
                fields.add("caps", text(place, "none"));
                upright(&bag)?;
                "cylinder"
            }
            "disk" => {
                fields.add("normal", numbers(place, &DVec3::Z.to_array()));
                fields.add("radius", number(place, 1.0));
                upright(&bag)?;
                "disk"
            }
            "rectangle" => {
                fields.add("corner", numbers(place, &[-1.0, -1.0, 0.0]));
                fields.add("edge_u", numbers(place, &[2.0, 0.0, 0.0]));
                fields.add("edge_v", numbers(place, &[0.0, 2.0, 0.0]));
                upright(&bag)?;
                "rectangle"
            }
            "cube" => {
                fields.add("size", number(place, 2.0));
                upright(&bag)?;
                "cube"
            }
            "obj" | "ply" => {
                let file = bag.required("filename", bag.file("filename"))?;
                fields.add("file", text(bag.place("filename"), file));
                let normals = if bag.boolean("face_normals")? == Some(true) { "face" } else { "file" };
                fields.add("normals", text(bag.place("face_normals"), normals));
                // OBJ counts v from the bottom of the picture, which is ours, and PLY from its top.
                let usual = bag.object.plugin == "obj";
                if bag.boolean("flip_tex_coords")?.unwrap_or(usual) != usual {
                    let message = format!("expected {usual}, found {}", !usual);
                    return Err(bag.fault_of("flip_tex_coords", message));
                }
                upright(&bag)?;
                "mesh"
            }
            "sdfgrid" => {
                let file = bag.required("filename", bag.file("filename"))?;
                fields.add("file", text(bag.place("filename"), file));
                let normals = bag.choice("normals", &["smooth", "analytic"])?.unwrap_or("smooth");
                fields.add("normals", text(bag.place("normals"), normals));
                "sdf_grid"
            }
            basis @ ("linearcurve" | "bsplinecurve") => {
                let file = bag.required("filename", bag.file("filename"))?;
                fields.add("file", text(bag.place("filename"), file));
                let basis = if basis == "linearcurve" { "linear" } else { "bspline" };
                fields.add("basis", text(place, basis));
                "curves"
            }
            _ => return Err(bag.unknown(SHAPES)),
        };
        self.surface(&bag, &mut fields)?;
        bag.finish()?;
        self.shapes.push(fields.kind(kind));
        Ok(())
    }

    /// What every shape has: material, emission, media.
    pub(crate) fn surface(&mut self, bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
        let place = bag.object.place;
        bag.float("silhouette_sampling_weight")?;
        let emitter = bag.only(Family::Emitter)?;
        let material = match bag.only(Family::Bsdf)? {
            Some(bsdf) => self.material(bsdf)?,
            // A lamp reflects nothing unless it says so.
            None => self.plain_diffuse(place, if emitter.is_some() { 0.0 } else { 0.5 }),
        };
        fields.add("material", material);
        if let Some(emitter) = emitter {
            self.emission(emitter, fields)?;
        }
        self.sides(bag, fields)?;
        if let Some(id) = &bag.object.id {
            fields.add("name", text(place, id.as_str()));
        }
        Ok(())
    }
}

fn upright(bag: &Bag<'_>) -> Result<(), Fault> {
    match bag.boolean("flip_normals")? {
        Some(true) => Err(bag.fault_of("flip_normals", "expected false, found true, which Abbe does not have")),
        _ => Ok(()),
    }
}
