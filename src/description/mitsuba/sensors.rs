//! Sensors with their film, filter and sampler: the fields `camera`, `image`, `render`, `output`.

use glam::{DMat3, DMat4, DVec3};

use super::super::camera::is_rigid;
use super::super::fault::Fault;
use super::super::node::{Node, Place, quote};
use super::object::{Bag, Family};
use super::spectra::Role;
use super::{FILM, Fields, Import, boolean, list, matrix, number, numbers, text, whole};

const SENSORS: [&str; 3] = ["perspective", "thinlens", "orthographic"];
const FILMS: [&str; 2] = ["hdrfilm", "specfilm"];
const FILTERS: [&str; 6] = ["box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"];
const SAMPLERS: [&str; 5] = ["independent", "stratified", "multijitter", "orthogonal", "ldsampler"];

/// The side of a film of 35 mm, millimetres: a focal length is one for its diagonal.
const FILM_35_MM: [f64; 2] = [36.0, 24.0];

impl Import<'_> {
    pub(crate) fn sensor(&mut self, index: usize) -> Result<Fields, Fault> {
        let bag = self.bag(index);
        let place = bag.object.place;
        let plugin = bag.object.plugin.as_str();
        if !SENSORS.contains(&plugin) {
            return Err(bag.unknown(SENSORS));
        }
        let mut camera = Fields::new(place);
        let written = bag.transform("to_world")?.unwrap_or(DMat4::IDENTITY);
        let to_world = match plugin {
            // Others are refused where they are read.
            "perspective" | "thinlens" if !is_rigid(DMat3::from_mat4(written)) => {
                self.turned(&bag, written, 1.0).unwrap_or(written)
            }
            _ => written,
        };
        // Ours has +x to the right of the picture.
        let ours = to_world * DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        camera.add("to_world", matrix(bag.place("to_world"), ours));
        let near = bag.float("near_clip")?.unwrap_or(0.01);
        let far = bag.float("far_clip")?.unwrap_or(1e4);
        if near <= 0.0 {
            return Err(bag.fault_of("near_clip", format!("expected a number above 0, found {near}")));
        }
        // Their parallel rays begin as much farther away as `to_world` makes the camera larger, and see as far from there.
        let begin = match plugin {
            "orthographic" => near * to_world.z_axis.truncate().length(),
            _ => near,
        };
        let mut clip = Fields::new(place);
        clip.add("near", number(bag.place("near_clip"), begin));
        clip.add("far", number(bag.place("far_clip"), far + (begin - near)));
        camera.add("clip", clip.map());
        let focus_distance = bag.float("focus_distance")?;
        if plugin == "perspective" {
            let offset = [bag.float("principal_point_offset_x")?, bag.float("principal_point_offset_y")?];
            // Theirs says where the middle of the picture looks, ours where the axis falls on it.
            let offset = offset.map(|x| -x.unwrap_or(0.0));
            camera.add("principal_point", numbers(bag.place("principal_point_offset_x"), &offset));
        }
        match plugin {
            "orthographic" => camera.add("orthographic_height", self.orthographic_height(&bag)?),
            _ => {
                let (fov_deg, axis) = field_of_view(&bag)?;
                camera.add("fov_deg", number(bag.place("fov"), fov_deg));
                camera.add("fov_axis", text(bag.place("fov_axis"), axis));
            }
        }
        if plugin == "thinlens" {
            let mut lens = Fields::new(place);
            let radius = bag.required("aperture_radius", bag.float("aperture_radius"))?;
            lens.add("radius", number(bag.place("aperture_radius"), radius));
            lens.add("focus_distance", number(bag.place("focus_distance"), focus_distance.unwrap_or(far)));
            camera.add("lens", lens.map());
        }
        // Nothing moves.
        let [open, close] = [bag.float("shutter_open")?, bag.float("shutter_close")?].map(Option::unwrap_or_default);
        if open > close {
            let message = format!("expected at least shutter_open, {open}, found {close}");
            return Err(bag.fault_of("shutter_close", message));
        }

        let mut all = Fields::new(place);
        all.add("camera", camera.map());
        let film = bag.only(Family::Film)?;
        all.extend(self.film(film, place)?);
        let sampler = bag.only(Family::Sampler)?;
        all.add("render", self.sampler(sampler, place)?);
        if let Some(medium) = bag.only(Family::Medium)? {
            let name = self.medium(medium)?;
            if self.sees_media {
                all.add("medium", text(place, name));
            }
        }
        bag.finish()?;
        Ok(all)
    }

    /// The picture spans −1 to 1 across its width before `to_world`, whatever its shape.
    fn orthographic_height(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let [width, height] = match bag.only(Family::Film)? {
            Some(film) => size(&self.bag(film))?,
            None => [768, 576],
        };
        Ok(number(bag.object.place, 2.0 * height as f64 / width.max(1) as f64))
    }

    pub(crate) fn film(&mut self, index: Option<usize>, place: Place) -> Result<Fields, Fault> {
        let mut image = Fields::new(place);
        let mut output = Fields::new(place);
        let mut exr = Fields::new(place);
        let (mut filter, mut precision, mut channels) = (None, "half", "rgb");
        let [mut width, mut height] = [768, 576];
        let mut sides = [place; 2];
        let mut sample_border = boolean(place, false);
        if let Some(index) = index {
            let bag = self.bag(index);
            if !FILMS.contains(&bag.object.plugin.as_str()) {
                return Err(bag.unknown(FILMS));
            }
            [width, height] = size(&bag)?;
            sides = ["width", "height"].map(|side| bag.place(side));
            if ["crop_width", "crop_height", "crop_offset_x", "crop_offset_y"].iter().any(|key| bag.has(key)) {
                let mut crop = Fields::new(bag.object.place);
                let fields = [
                    ("x", "crop_offset_x", 0),
                    ("y", "crop_offset_y", 0),
                    ("width", "crop_width", width),
                    ("height", "crop_height", height),
                ];
                for (ours, theirs, default) in fields {
                    crop.add(ours, whole(bag.place(theirs), bag.integer(theirs)?.unwrap_or(default)));
                }
                image.add("crop", crop.map());
            }
            if bag.object.plugin == "specfilm" {
                image.add("bands", self.bands(&bag)?);
            } else {
                // The words are the same.
                let pixels = ["rgb", "rgba", "xyz", "xyza", "luminance", "luminance_alpha"];
                if let Some(pixel) = bag.choice_in_any_case("pixel_format", &pixels)? {
                    channels = pixel;
                }
                bag.choice_in_any_case("file_format", &["openexr", "exr"])?;
                bag.boolean("banner")?;
            }
            if let Some("float32") = bag.choice_in_any_case("component_format", &["float16", "float32"])? {
                precision = "float";
            }
            if let Some(on) = bag.boolean("sample_border")? {
                sample_border = boolean(bag.place("sample_border"), on);
            }
            bag.boolean("compensate")?;
            if let Some(index) = bag.only(Family::ReconstructionFilter)? {
                filter = Some(self.filter(index)?);
            }
            bag.finish()?;
        }
        image.add("width", whole(sides[0], width));
        image.add("height", whole(sides[1], height));
        image.add("sample_border", sample_border);
        image.add("sensitivity", number(place, FILM));
        image.add("filter", filter.unwrap_or_else(|| text(place, "gaussian")));
        exr.add("precision", text(place, precision));
        exr.add("channels", text(place, channels));
        output.add("exr", exr.map());
        let mut all = Fields::new(place);
        all.add("image", image.map());
        all.add("output", output.map());
        Ok(all)
    }

    /// The spectra of a `specfilm`, whatever their names.
    fn bands(&mut self, bag: &Bag<'_>) -> Result<Node, Fault> {
        let mut bands = Vec::new();
        for (name, place, value) in bag.spectra() {
            let mut band = Fields::new(place);
            band.add("name", text(place, name));
            band.maybe("response", self.spectrum_of(bag, name, value, Role::Coefficient)?);
            bands.push(band.map());
        }
        if bands.is_empty() {
            return Err(bag.fault("expected a <spectrum> for each band, found none"));
        }
        Ok(list(bag.object.place, bands))
    }

    pub(crate) fn filter(&mut self, index: usize) -> Result<Node, Fault> {
        let bag = self.bag(index);
        let place = bag.object.place;
        let mut fields = Fields::new(place);
        let mut add = |ours: &str, theirs: &'static str| -> Result<(), Fault> {
            if let Some(value) = bag.float(theirs)? {
                fields.add(ours, number(bag.place(theirs), value));
            }
            Ok(())
        };
        let kind = match bag.object.plugin.as_str() {
            "box" => "box",
            "tent" => {
                add("radius", "radius")?;
                "tent"
            }
            "gaussian" => {
                add("stddev", "stddev")?;
                "gaussian"
            }
            "mitchell" => {
                add("b", "B")?;
                add("c", "C")?;
                "mitchell"
            }
            "catmullrom" => "catmull_rom",
            "lanczos" => {
                if let Some(lobes) = bag.integer("lobes")? {
                    fields.add("radius", number(bag.place("lobes"), lobes as f64));
                }
                "lanczos"
            }
            _ => return Err(bag.unknown(FILTERS)),
        };
        bag.finish()?;
        Ok(if fields.entries.is_empty() { text(place, kind) } else { fields.kind(kind) })
    }

    /// How many samples; which kind of sampler it was makes no difference to ours.
    pub(crate) fn sampler(&mut self, index: Option<usize>, place: Place) -> Result<Node, Fault> {
        let mut render = Fields::new(place);
        let mut samples = 4;
        let mut at = place;
        if let Some(index) = index {
            let bag = self.bag(index);
            if !SAMPLERS.contains(&bag.object.plugin.as_str()) {
                return Err(bag.unknown(SAMPLERS));
            }
            samples = bag.integer("sample_count")?.unwrap_or(samples);
            at = bag.place("sample_count");
            if let Some(seed) = bag.integer("seed")? {
                render.add("seed", whole(bag.place("seed"), seed));
            }
            bag.boolean("jitter")?;
            bag.integer("strength")?;
            bag.finish()?;
        }
        render.add("samples", whole(at, samples));
        Ok(render.map())
    }
}

fn size(bag: &Bag<'_>) -> Result<[i64; 2], Fault> {
    Ok([bag.integer("width")?.unwrap_or(768), bag.integer("height")?.unwrap_or(576)])
}

/// Degrees and the axis along which they are measured.
pub(super) fn field_of_view(bag: &Bag<'_>) -> Result<(f64, &'static str), Fault> {
    let fov = bag.float("fov")?;
    let axis = bag.choice_in_any_case("fov_axis", &["x", "y", "diagonal", "smaller", "larger"])?;
    let focal_length = bag.text("focal_length")?;
    match (fov, focal_length) {
        (Some(fov), None) => Ok((fov, axis.unwrap_or("x"))),
        (Some(_), Some(_)) => Err(bag.fault_of("focal_length", "expected either fov or focal_length, found both")),
        (None, _) if axis.is_some() => Err(bag.fault_of("fov_axis", "expected it beside fov, found it without")),
        (None, focal_length) => {
            let written = focal_length.unwrap_or("50mm");
            let millimetres = written.trim().trim_end_matches("mm").trim().parse::<f64>().ok();
            let millimetres = millimetres.filter(|f| f.is_finite() && *f > 0.0).ok_or_else(|| {
                let message = format!("expected millimetres such as \"50mm\", found {}", quote(written));
                bag.fault_of("focal_length", message)
            })?;
            let diagonal = libm::hypot(FILM_35_MM[0], FILM_35_MM[1]);
            Ok((2.0 * libm::atan(0.5 * diagonal / millimetres).to_degrees(), "diagonal"))
        }
    }
}
