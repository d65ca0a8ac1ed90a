//! The sensor with its film, filter and sampler.

use glam::DVec3;

use super::super::super::camera::{Camera, Clip, FovAxis, Lens, Pose, Projection};
use super::super::super::image::{Band, Filter, Image};
use super::super::super::node::{Node, Value};
use super::super::super::output::{Channels, Colour};
use super::spectra::can_be_band;
use super::{Export, FILM, xml};

/// Where Mitsuba's camera begins to see at the nearest, metres. Its pictures are those of 1e-4 to the seventh digit; at 1e-20, whose square
/// 32-bit floats do not hold, one with a perspective sees nothing.
const NEAR: f64 = 1e-12;
/// Where it ends at the farthest, metres. Pictures are those of 1e8; to 3e38 an orthographic one sees nothing.
const FAR: f64 = 1e30;

/// What a `specfilm` has another use for than as the name of a band, there or here: its weights and its own parameters.
const OF_THE_FILM: [&str; 10] = [
    "W",
    "width",
    "height",
    "crop_offset_x",
    "crop_offset_y",
    "crop_width",
    "crop_height",
    "sample_border",
    "component_format",
    "compensate",
];

impl<'a> Export<'a> {
    pub(super) fn sensor(&mut self) {
        let Camera { pose: _, projection, lens, clip: _, principal_point, shutter: _ } = &self.scene.camera;
        if self.scene.motion.is_some() {
            self.lose("camera.shutter", "the scene at its frame: what is exported does not move");
        }
        let Image { width, height, overscan, sensitivity, .. } = &self.scene.image;
        if ![1.0, FILM].contains(sensitivity) {
            self.lose("image.sensitivity", "a film of sensitivity 1");
        }
        if *overscan > 0 {
            self.lose("image.overscan", "the frame: Mitsuba's film ends at its edge");
            self.xml.instruction(&format!("set image.overscan: {overscan}"));
        }
        // The film's unit is theirs.
        let yaml = Node::new(self.root.place, Value::Float(*sensitivity));
        let yaml = self.yaml(&yaml);
        self.xml.instruction(&format!("set image.sensitivity: {yaml}"));
        let plugin = match (projection, lens) {
            (Projection::Orthographic { .. }, _) => "orthographic",
            (Projection::Perspective { .. }, Some(_)) => "thinlens",
            (Projection::Perspective { .. }, None) => "perspective",
        };
        self.xml.open("sensor", &[("type", plugin)]);
        // Theirs shows −1 to 1 across the width.
        let half = match projection {
            Projection::Orthographic { height: shown } => Some(0.5 * shown * f64::from(*width) / f64::from(*height)),
            Projection::Perspective { .. } => None,
        };
        self.pose(half);
        if let (Some(_), Some(lens)) = (half, lens) {
            self.lose("camera.lens", "none: Mitsuba's orthographic camera has no lens");
            let Lens { radius, focus_distance } = lens;
            self.xml.instruction(&format!("set camera.lens: {{radius: {radius}, focus_distance: {focus_distance}}}"));
        }
        if let Projection::Perspective { fov_deg, fov_axis } = projection {
            self.xml.value("float", "fov", fov_deg);
            self.xml.value("string", "fov_axis", self::fov_axis(*fov_axis));
        }
        if *principal_point != [0.0; 2] && plugin == "perspective" {
            // Theirs says where the middle of the picture looks, ours where the axis falls on it.
            self.xml.value("float", "principal_point_offset_x", -principal_point[0]);
            self.xml.value("float", "principal_point_offset_y", -principal_point[1]);
        } else if *principal_point != [0.0; 2] {
            let what = "the middle of the picture: Mitsuba has another for a pinhole with a perspective alone";
            self.lose("camera.principal_point", what);
            self.xml.instruction(&format!("set camera.principal_point: {principal_point:?}"));
        }
        self.clip();
        if let (Some(lens), "thinlens") = (lens, plugin) {
            self.xml.value("float", "aperture_radius", lens.radius);
            self.xml.value("float", "focus_distance", lens.focus_distance);
        }
        if let Some(medium) = &self.scene.medium {
            let id = self.id(medium, "medium");
            self.xml.leaf("ref", &[("name", "medium"), ("id", &id)]);
        }
        self.xml.open("sampler", &[("type", "independent")]);
        self.xml.parameter("integer", "sample_count", "spp");
        self.xml.close();
        self.film();
        self.xml.close();
        // The importer would map what the film says to `output`, where nothing else is set.
        if self.root.get("output").is_none() {
            self.xml.instruction("set output: {}");
        }
    }

    /// Where the camera stands; with `half` of the width, metres, that a view without perspective shows.
    fn pose(&mut self, half: Option<f64>) {
        self.xml.open("transform", &[("name", "to_world")]);
        if let Some(half) = half {
            self.xml.leaf("scale", &[("x", &half.to_string()), ("y", &half.to_string())]);
        }
        match &self.scene.camera.pose {
            Pose::LookAt { origin, target, up } => {
                let [origin, target, up] = [origin, target, up].map(|v| xml::numbers(v));
                self.xml.leaf("lookat", &[("origin", &origin), ("target", &target), ("up", &up)]);
            }
            Pose::ToWorld(rows) => {
                // Theirs has +x to the left.
                let rows = rows.map(|[x, y, z, w]| [-x, y, z, w]);
                self.xml.leaf("matrix", &[("value", &xml::numbers(rows.as_flattened()))]);
            }
        }
        self.xml.close();
    }

    /// From where to where the camera sees.
    fn clip(&mut self) {
        let Camera { pose, projection, clip: Clip { near, far }, .. } = &self.scene.camera;
        // As an import has it.
        let scale = match (pose, projection) {
            (Pose::ToWorld(rows), Projection::Orthographic { .. }) => {
                DVec3::from_array([0, 1, 2].map(|i| rows[i][2])).length()
            }
            _ => 1.0,
        };
        let begin = near / scale;
        let end = (far - (near - begin)).min(FAR);
        if begin < NEAR || *far > FAR {
            // Theirs always begins and ends somewhere.
            let number = |value: f64| self.yaml(&Node::new(self.root.place, Value::Float(value)));
            let far = if far.is_finite() { format!(", far: {}", number(*far)) } else { String::new() };
            let near = number(*near);
            self.xml.instruction(&format!("set camera.clip: {{near: {near}{far}}}"));
        }
        self.xml.value("float", "near_clip", begin.max(NEAR.min(1e-3 * end)));
        self.xml.value("float", "far_clip", end);
    }

    fn film(&mut self) {
        let Image { width, height, filter, crop, sample_border, .. } = &self.scene.image;
        let bands = self.bands();
        self.xml.open("film", &[("type", if bands.is_empty() { "hdrfilm" } else { "specfilm" })]);
        self.xml.value("integer", "width", width);
        self.xml.value("integer", "height", height);
        if let Some(crop) = crop {
            self.xml.value("integer", "crop_offset_x", crop.x);
            self.xml.value("integer", "crop_offset_y", crop.y);
            self.xml.value("integer", "crop_width", crop.width);
            self.xml.value("integer", "crop_height", crop.height);
        }
        for (i, band) in bands.iter().enumerate() {
            let name = self.band_name(i, bands);
            self.band(&name, &band.response);
        }
        if bands.is_empty() {
            self.xml.value("string", "pixel_format", pixel_format(self.scene.output.exr.channels));
            self.colour();
        }
        self.xml.value("string", "component_format", "float32");
        if *sample_border {
            self.xml.value("boolean", "sample_border", true);
        }
        self.filter(*filter);
        self.xml.close();
    }

    /// Red, green and blue are those of Mitsuba.
    fn colour(&mut self) {
        let output = &self.scene.output;
        match (output.exr.channels, output.colour) {
            (Channels::Rgba | Channels::Rgb, Colour::Rec709) => {}
            (Channels::Rgba | Channels::Rgb, _) => {
                self.lose("output.colour", "rec709: Mitsuba's film has no other red, green and blue");
            }
            // What they hold is of no such space.
            (Channels::Xyza | Channels::Xyz | Channels::LuminanceAlpha | Channels::Luminance, _) => {}
        }
    }

    /// The bands of the film, where Mitsuba has words for all of them.
    fn bands(&mut self) -> &'a [Band] {
        let bands = &self.scene.image.bands;
        if bands.iter().all(|band| can_be_band(&band.response)) {
            return bands;
        }
        self.lose("image.bands", "colour: Mitsuba has no words for the response of a band");
        if let Some(node) = self.root.get("image").and_then(|image| image.get("bands")) {
            let yaml = self.yaml(node);
            self.xml.instruction(&format!("set image.bands: {yaml}"));
        }
        &[]
    }

    /// The name of a band there. As `_arg_0` Mitsuba knows what has no name.
    fn band_name(&mut self, i: usize, bands: &[Band]) -> String {
        let name = &bands[i].name;
        if !OF_THE_FILM.contains(&name.as_str()) && !name.starts_with("_arg_") {
            return name.clone();
        }
        let mut theirs = format!("band {name}");
        while bands.iter().any(|band| band.name == theirs) {
            theirs = format!("band {theirs}");
        }
        let field = format!("image.bands[{i}].name");
        self.lose(&field, format!("{theirs:?}: Mitsuba's film has another use for this name"));
        let yaml = self.yaml(&Node::new(self.root.place, Value::Text(name.clone())));
        self.xml.instruction(&format!("set {field}: {yaml}"));
        theirs
    }

    fn filter(&mut self, filter: Filter) {
        let (plugin, fields): (&str, &[(&str, f64)]) = match filter {
            Filter::Box => ("box", &[]),
            Filter::Tent { radius } => ("tent", &[("radius", radius)]),
            Filter::Gaussian { stddev, .. } => ("gaussian", &[("stddev", stddev)]),
            Filter::Mitchell { b, c } => ("mitchell", &[("B", b), ("C", c)]),
            Filter::CatmullRom => ("catmullrom", &[]),
            Filter::Lanczos { .. } => ("lanczos", &[]),
        };
        self.xml.open("rfilter", &[("type", plugin)]);
        for (name, value) in fields {
            self.xml.value("float", name, value);
        }
        if let Filter::Lanczos { radius } = filter {
            let lobes = radius.round().max(1.0);
            self.xml.value("integer", "lobes", lobes);
            if lobes != radius {
                self.lose("image.filter", format!("{lobes} lobes: Mitsuba's are whole"));
                self.xml.instruction(&format!("set image.filter: {{lanczos: {{radius: {radius}}}}}"));
            }
        }
        self.xml.close();
    }
}

/// Mitsuba's word for what a pixel holds, which is ours.
fn pixel_format(channels: Channels) -> &'static str {
    match channels {
        Channels::Rgba => "rgba",
        Channels::Rgb => "rgb",
        Channels::Xyza => "xyza",
        Channels::Xyz => "xyz",
        Channels::LuminanceAlpha => "luminance_alpha",
        Channels::Luminance => "luminance",
    }
}

/// Mitsuba's word for the side of a picture that an angle is of.
pub(super) fn fov_axis(axis: FovAxis) -> &'static str {
    match axis {
        FovAxis::X => "x",
        FovAxis::Y => "y",
        FovAxis::Smaller => "smaller",
        FovAxis::Larger => "larger",
        FovAxis::Diagonal => "diagonal",
    }
}
