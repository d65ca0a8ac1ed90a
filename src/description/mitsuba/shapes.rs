//! Shapes, groups of them, and copies.
//!
//! Shapes keep the texture coordinates that Mitsuba gives them; it is pictures that are turned over, for its
//! v = 0 is their top.

use glam::{DMat3, DMat4, DVec3};

use super::super::fault::Fault;
use super::super::transform::{is_mirror, is_similarity};
use super::object::{Bag, Family};
use super::parse::ABOUT_ONE;
use super::{Fields, Import, boolean, entry, list, matrix, named, number, numbers, text, whole};
use crate::math::Frame;

const SHAPES: [&str; 14] = [
    "sphere",
    "cylinder",
    "disk",
    "rectangle",
    "cube",
    "obj",
    "ply",
    "serialized",
    "sdfgrid",
    "linearcurve",
    "bsplinecurve",
    "merge",
    "shapegroup",
    "instance",
];

/// How far from equal and perpendicular the axes of a cylinder may come out: see the check of transforms.
const SIMILAR: f64 = 3e-6;

impl Import<'_> {
    /// Adds a shape of the scene to `shapes`, a group to `groups`.
    pub(crate) fn shape(&mut self, index: usize) -> Result<(), Fault> {
        let bag = self.bag(index);
        if let Some(node) = bag.written() {
            self.again(index, &node)?;
            self.shapes.push(node);
            return Ok(());
        }
        match bag.object.plugin.as_str() {
            // One mesh made of several looks like these several.
            "merge" => {
                for child in bag.objects(Family::Shape) {
                    self.shape(child)?;
                }
                self.again(index, &Fields::new(bag.object.place).kind("merge"))?;
                return bag.finish();
            }
            "shapegroup" => return self.group(index).map(|_| ()),
            _ => {}
        }
        let mut fields = Fields::new(bag.object.place);
        let to_world = bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY);
        let linear = DMat3::from_mat4(to_world);
        let to_world = match bag.object.plugin.as_str() {
            // Others are refused where they are read.
            "sphere" if !is_similarity(linear) => {
                self.turned(&bag, to_world, libm::cbrt(linear.determinant().abs())).unwrap_or(to_world)
            }
            _ => to_world,
        };
        if to_world != DMat4::IDENTITY && bag.object.plugin != "cylinder" {
            let at = bag.place("to_world");
            fields.add("transform", list(at, [entry(at, "matrix", matrix(at, to_world))]));
        }
        let kind = self.form(&bag, to_world, &mut fields)?;
        if kind == "nothing" {
            return bag.finish();
        }
        if kind == "instance" {
            if let Some(name) = named(self.document, bag.object) {
                fields.add("name", text(bag.object.place, name));
            }
        } else {
            self.surface(&bag, &mut fields)?;
        }
        bag.finish()?;
        let node = fields.kind(kind);
        self.again(index, &node)?;
        self.shapes.push(node);
        Ok(())
    }

    /// The form of a shape: its fields, but for the transform, and its kind: `nothing` of a copy of an empty group.
    fn form(&mut self, bag: &Bag<'_>, to_world: DMat4, fields: &mut Fields) -> Result<&'static str, Fault> {
        let place = bag.object.place;
        let mirrored = is_mirror(to_world);
        let mut turned = false;
        let kind = match bag.object.plugin.as_str() {
            "sphere" => {
                fields.add("center", numbers(bag.place("center"), &bag.vector("center")?.unwrap_or_default()));
                fields.add("radius", number(bag.place("radius"), bag.float("radius")?.unwrap_or(1.0)));
                fields.add("layout", text(place, "z_up"));
                // A sphere that is mirrored is turned inside out.
                turned = mirrored;
                "sphere"
            }
            "cylinder" => {
                self.cylinder(bag, to_world, mirrored, fields)?;
                "cylinder"
            }
            "disk" => {
                fields.add("normal", numbers(place, &DVec3::Z.to_array()));
                fields.add("radius", number(place, 1.0));
                "disk"
            }
            "rectangle" => {
                bag.boolean("face_normals")?;
                fields.add("corner", numbers(place, &[-1.0, -1.0, 0.0]));
                fields.add("edge_u", numbers(place, &[2.0, 0.0, 0.0]));
                fields.add("edge_v", numbers(place, &[0.0, 2.0, 0.0]));
                "rectangle"
            }
            "cube" => {
                // They are flat either way.
                bag.boolean("face_normals")?;
                fields.add("size", number(place, 2.0));
                fields.add("layout", text(place, "z_up"));
                "cube"
            }
            "obj" | "ply" | "serialized" => {
                mesh(bag, fields)?;
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
            "instance" => {
                let found = bag.only(Family::Shape)?;
                let group = found.ok_or_else(|| bag.fault("expected a reference to a shapegroup, found none"))?;
                let name = self.group(group)?;
                if self.empty.contains(&group) {
                    return Ok("nothing");
                }
                fields.add("group", text(place, name));
                return Ok("instance");
            }
            _ => return Err(bag.unknown(SHAPES)),
        };
        // Distances and curves have no side to turn: Mitsuba refuses it, and so it is left unread.
        let has_sides = !["sdfgrid", "linearcurve", "bsplinecurve"].contains(&bag.object.plugin.as_str());
        if (has_sides && bag.boolean("flip_normals")?.unwrap_or(false)) != turned {
            fields.add("flip_normals", boolean(bag.place("flip_normals"), true));
        }
        Ok(kind)
    }

    /// The name under which a shapegroup stands in `groups`.
    fn group(&mut self, index: usize) -> Result<String, Fault> {
        if let Some(name) = self.names.get(&index) {
            return Ok(name.clone());
        }
        let bag = self.bag(index);
        if bag.object.plugin != "shapegroup" {
            return Err(bag.fault("expected a shapegroup"));
        }
        let outside = std::mem::take(&mut self.shapes);
        for child in bag.objects(Family::Shape) {
            let child_bag = self.bag(child);
            if ["shapegroup", "instance"].contains(&child_bag.object.plugin.as_str()) {
                return Err(child_bag.fault("expected a shape, found a group within a group"));
            }
            self.shape(child)?;
        }
        bag.finish()?;
        let shapes = std::mem::replace(&mut self.shapes, outside);
        let name = self.name_for(index);
        // What nothing is in is no group of ours, and no copy of it is seen.
        if shapes.is_empty() {
            self.empty.insert(index);
        } else {
            let node = list(bag.object.place, shapes);
            self.groups.push(self.entry(index, &name, node));
        }
        Ok(name)
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
        if let Some(name) = named(self.document, bag.object) {
            fields.add("name", text(place, name));
        }
        Ok(())
    }

    /// A cylinder where it lies in the world: its transform may stretch it along its axis. What is mirrored is put down as its
    /// image in the plane x = 0, which a transform of its own mirrors back, textures and all.
    fn cylinder(&mut self, bag: &Bag<'_>, to_world: DMat4, mirrored: bool, fields: &mut Fields) -> Result<(), Fault> {
        let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let to_world = if mirrored { mirror * to_world } else { to_world };
        let base = DVec3::from(bag.vector("p0")?.unwrap_or_default());
        let top = DVec3::from(bag.vector("p1")?.unwrap_or([0.0, 0.0, 1.0]));
        let radius = bag.float("radius")?.unwrap_or(1.0);
        let Some(axis) = (top - base).try_normalize() else {
            return Err(bag.fault_of("p1", "expected a point other than p0"));
        };
        let frame = Frame::from_normal(axis);
        let [s, t, n] = [frame.s, frame.t, axis].map(|v| to_world.transform_vector3(v));
        let across = [(s.dot(t), s, t), (s.dot(n), s, n), (t.dot(n), t, n)];
        let apart = across.iter().map(|(dot, a, b)| dot.abs() / (a.length() * b.length()));
        let off = apart.fold((s.length() / t.length() - 1.0).abs(), f64::max);
        if off > SIMILAR && off <= ABOUT_ONE {
            let message =
                format!("to_world: it keeps a cylinder round and straight but for {off:.1e}, its digits; it stays one");
            self.notes.push((bag.place("to_world"), message));
        } else if off.is_nan() || off > SIMILAR {
            let expected =
                "expected moves, turns and scales that keep a cylinder round and straight, found another transform";
            return Err(bag.fault_of("to_world", expected));
        }
        fields.add("base", numbers(bag.place("p0"), &to_world.transform_point3(base).to_array()));
        fields.add("top", numbers(bag.place("p1"), &to_world.transform_point3(top).to_array()));
        fields.add("radius", number(bag.place("radius"), radius * s.length()));
        fields.add("caps", text(bag.object.place, "none"));
        fields.add("seam", numbers(bag.place("to_world"), &s.to_array()));
        if mirrored {
            let at = bag.place("to_world");
            fields.add("transform", list(at, [entry(at, "matrix", matrix(at, mirror))]));
        }
        Ok(())
    }
}

fn mesh(bag: &Bag<'_>, fields: &mut Fields) -> Result<(), Fault> {
    let place = bag.object.place;
    let file = bag.required("filename", bag.file("filename"))?;
    fields.add("file", text(bag.place("filename"), file));
    let normals = if bag.boolean("face_normals")? == Some(true) { "face" } else { "vertex" };
    fields.add("normals", text(bag.place("face_normals"), normals));
    fields.add("winding", text(place, "world"));
    match bag.object.plugin.as_str() {
        "serialized" => {
            if let Some(index) = bag.integer("shape_index")? {
                fields.add("index", whole(bag.place("shape_index"), index));
            }
        }
        plugin => {
            if bag.boolean("flip_tex_coords")?.unwrap_or(plugin == "obj") {
                fields.add("flip_v", boolean(bag.place("flip_tex_coords"), true));
            }
        }
    }
    Ok(())
}
