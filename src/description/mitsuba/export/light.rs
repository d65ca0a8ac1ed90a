//! Lights.

use glam::{DMat4, DVec3};

use super::super::super::emitter::{EmissionDirection, EnvironmentMapping, Growth};
use super::super::super::light::{Aim, Light};
use super::super::super::shape::{Geometry, Shape};
use super::super::super::sky::SkyLight;
use super::super::super::spectrum::SpectrumOrTexture;
use super::super::super::texture::Texture;
use super::super::super::transform::{matrix_of, rotation};
use super::sensor::fov_axis;
use super::spectra::Role;
use super::textures::Stands;
use super::xml::numbers;
use super::{DAYLIGHT, Export, SKY_FROM_MITSUBA, joined};

/// The angle of the narrowest disc of a sun that Mitsuba gets: it divides by 1 − cos of its half in single precision, which is 0 below
/// 0.028 degrees, so that nothing of the picture is a number.
const NARROWEST_SUN_DEG: f64 = 0.05;

impl Export<'_> {
    /// A light of the scene's list.
    pub(super) fn light(&mut self, i: usize, light: &Light) {
        let around: Vec<&Light> =
            self.scene.lights.iter().filter(|other| light.is_around() && other.is_around()).collect();
        if let Some(first) = around.first().filter(|first| !std::ptr::eq(**first, light)) {
            let field = format!("lights[{i}]");
            match sky_like(first, light) {
                // Its light is in that of the first.
                Some(_) => self.restate("emitter", &field),
                None => self.instead("emitter", &field, "nothing: Mitsuba has one environment"),
            }
            self.end();
            return;
        }
        let skies: Vec<&SkyLight> = around.into_iter().filter_map(|other| sky_like(light, other)).collect();
        let is_sum = skies.len() > 1;
        let why = self.emitter_shortfall(light);
        // What has a new file is read back from its own.
        let is_anew = matches!(light, Light::Environment(l) if (self.pictures)(&l.file).anew.is_some());
        let reads_otherwise = is_sum || is_anew;
        match &why {
            Some(why) => self.instead("emitter", &format!("lights[{i}]"), why.as_str()),
            None if reads_otherwise => self.restate("emitter", &format!("lights[{i}]")),
            None => {}
        }
        self.emitter(light, &skies);
        let weight = if is_sum { skies.iter().map(|sky| sky.sampling_weight).sum() } else { light.sampling_weight() };
        self.weight(&format!("lights[{i}].{}", light.kind()), weight);
        self.xml.close();
        if why.is_some() || reads_otherwise {
            self.end();
        }
    }

    /// What Mitsuba gets in place of a light that it cannot express.
    fn emitter_shortfall(&self, light: &Light) -> Option<String> {
        match light {
            Light::Point(l) => Export::light_shortfall(&l.intensity),
            Light::Spot(l) => {
                let slide = l.texture.as_ref().and_then(|texture| self.pictures_shortfall(texture, stands(l.v)));
                joined([Export::light_shortfall(&l.intensity), slide])
            }
            Light::Directional(l) => {
                let parallel = (l.angle_deg > 0.0).then(|| "parallel light".to_owned());
                joined([Export::light_shortfall(&l.irradiance), parallel])
            }
            Light::Constant(l) => Export::light_shortfall(&l.radiance),
            Light::Environment(l) => {
                let shifted = (l.mapping != EnvironmentMapping::Mitsuba)
                    .then(|| "the same image on Mitsuba's grid, shifted by half a row toward the poles".to_owned());
                joined([shifted, self.spectra(&l.file).map(str::to_owned)])
            }
            Light::Sky(l) => {
                let narrow = (l.sun_angle_deg < NARROWEST_SUN_DEG).then(|| {
                    format!("a sun of {NARROWEST_SUN_DEG} degrees, as bright: narrower ones are none for Mitsuba")
                });
                joined([Export::reflectance_shortfall(&[&l.albedo], "a grey ground").map(str::to_owned), narrow])
            }
            Light::Projector(l) => self.shining_shortfall(&l.irradiance, stands(l.v)),
        }
    }

    /// Opens the plugin of a light and writes what it is. A sky is as bright as all of `skies` together.
    fn emitter(&mut self, light: &Light, skies: &[&SkyLight]) {
        let id = light.name().and_then(|name| self.emitter_id(name));
        let open = |plugin| {
            [Some(("type", plugin)), id.as_deref().map(|id| ("id", id))].into_iter().flatten().collect::<Vec<_>>()
        };
        match light {
            Light::Point(l) => {
                self.xml.open("emitter", &open("point"));
                self.xml.value("point", "position", numbers(&l.position));
                self.spectrum("intensity", &l.intensity, Role::Emission);
            }
            Light::Spot(l) => {
                self.xml.open("emitter", &open("spot"));
                let axis = l.axis();
                let target = DVec3::from(l.position) + axis;
                // Any direction across will do without a slide. With one, u grows to the left of who looks along the
                // axis and v upward: with the slide's up for their down, u grows to the right and v downward.
                let across = if axis.x.abs() <= axis.y.abs().max(axis.z.abs()) { DVec3::X } else { DVec3::Y };
                let up = if l.texture.is_some() { -l.up.map_or(DVec3::Y, DVec3::from) } else { across };
                let target = match l.aim {
                    Aim::Target(target) => target,
                    Aim::Direction(_) => target.into(),
                };
                self.looking([l.position, target, up.into()]);
                self.xml.value("float", "cutoff_angle", l.cutoff_deg);
                self.xml.value("float", "beam_width", l.beam_deg);
                self.spectrum("intensity", &l.intensity, Role::Emission);
                if let Some(texture) = &l.texture {
                    self.thrown("texture", texture, stands(l.v));
                }
            }
            Light::Directional(l) => {
                self.xml.open("emitter", &open("directional"));
                self.xml.value("vector", "direction", numbers(&l.direction));
                self.spectrum("irradiance", &l.irradiance, Role::Emission);
            }
            Light::Constant(l) => {
                self.xml.open("emitter", &open("constant"));
                self.spectrum("radiance", &l.radiance, Role::Emission);
            }
            Light::Environment(l) => {
                self.xml.open("emitter", &open("envmap"));
                let file = self.picture_file(&l.file);
                self.xml.value("string", "filename", file);
                self.xml.value("float", "scale", l.scale / DAYLIGHT);
                // Its left edge, where ours has the middle, looks along -z.
                let turn = if l.mapping == EnvironmentMapping::Mitsuba { 0.0 } else { 180.0 };
                self.placing(matrix_of(&l.transform) * rotation(DVec3::Y, l.rotate_deg + turn));
            }
            Light::Sky(l) => {
                self.xml.open("emitter", &open("sunsky"));
                let world_from_sky = l.world_from_sky();
                let sun = world_from_sky * l.sun.in_sky(world_from_sky);
                self.xml.value("vector", "sun_direction", numbers(&sun.to_array()));
                self.xml.value("float", "turbidity", l.turbidity);
                self.spectrum("albedo", &l.albedo, Role::Reflectance);
                let sum = |scale: fn(&SkyLight) -> f64| skies.iter().map(|sky| scale(sky)).sum::<f64>();
                self.xml.value("float", "sky_scale", sum(|sky| sky.sky_scale));
                self.xml.value("float", "sun_scale", sum(|sky| sky.sun_scale));
                self.xml.value("float", "sun_aperture", l.sun_angle_deg.max(NARROWEST_SUN_DEG));
                self.xml.value("boolean", "complex_sun", l.limb_darkening);
                self.placing(DMat4::from_mat3(world_from_sky * SKY_FROM_MITSUBA));
            }
            Light::Projector(l) => {
                self.xml.open("emitter", &open("projector"));
                self.looking([l.origin, l.target, l.up]);
                self.xml.value("float", "fov", l.fov_deg);
                self.xml.value("string", "fov_axis", fov_axis(l.fov_axis));
                self.shining("irradiance", &l.irradiance, stands(l.v));
                self.xml.value("float", "scale", l.scale);
            }
        }
    }

    /// The id of a light of this name; none where another light has the name.
    fn emitter_id(&mut self, name: &str) -> Option<String> {
        let id = self.id(name, "emitter");
        let id = if self.ids.contains(&id) { format!("{name} (emitter)") } else { id };
        self.ids.insert(id.clone()).then_some(id)
    }

    /// From where a light looks, at what, and what is up for it.
    fn looking(&mut self, points: [[f64; 3]; 3]) {
        let [origin, target, up] = points.map(|v| numbers(&v));
        self.xml.open("transform", &[("name", "to_world")]);
        self.xml.leaf("lookat", &[("origin", &origin), ("target", &target), ("up", &up)]);
        self.xml.close();
    }

    /// The emission of the shape `field`.
    pub(super) fn area(&mut self, field: &str, shape: &Shape, emission: &SpectrumOrTexture) {
        let plugin = match shape.emission_direction {
            Some(EmissionDirection::Normal) => "directionalarea",
            Some(EmissionDirection::All) | None => "area",
        };
        self.xml.open("emitter", &[("type", plugin)]);
        match self.even(shape) {
            Some(_) => self.xml.value("spectrum", "radiance", 1),
            None => self.shining("radiance", emission, Stands::Upright),
        }
        self.weight(field, shape.sampling_weight.unwrap_or(1.0));
        self.xml.close();
    }

    /// Why a shape shines evenly there, in place of by its texture: Mitsuba looks for texture coordinates where light begins, and crashes
    /// at attributes.
    pub(super) fn even(&self, shape: &Shape) -> Option<&'static str> {
        let texture = shape.emission.as_ref()?.name()?;
        let is_bare = match &shape.geometry {
            Geometry::Cone(_) => true,
            Geometry::Mesh(mesh) => (self.bare)(&mesh.file, mesh.index),
            _ => false,
        };
        if self.has_attribute(texture) {
            return Some("an even radiance of 1: Mitsuba crashes where a lamp has the attributes of its mesh");
        }
        is_bare.then_some("an even radiance of 1: Mitsuba wants texture coordinates of a mesh that shines by a texture")
    }

    /// How often the lamp `field` is looked for.
    fn weight(&mut self, field: &str, weight: f64) {
        if self.looks_for_none() {
            let field = format!("{field}.sampling_weight");
            self.lose(&field, "1: Mitsuba wants one lamp at least that it looks for");
            self.xml.instruction(&format!("set {field}: 0"));
        } else if weight != 1.0 {
            self.xml.value("float", "sampling_weight", weight);
        }
    }

    /// Whether none of the lamps that Mitsuba gets is looked for.
    fn looks_for_none(&self) -> bool {
        let shapes = self.scene.shapes.iter().filter(|shape| shape.emission.is_some());
        let of_shapes = shapes.map(|shape| shape.sampling_weight.unwrap_or(1.0));
        // Of those around the scene it gets the first, and what is like it.
        let first = self.scene.lights.iter().find(|light| light.is_around());
        let is_there = |light: &&Light| {
            let is_first = |first: &Light| std::ptr::eq(first, *light) || sky_like(first, light).is_some();
            !light.is_around() || first.is_some_and(is_first)
        };
        let of_lights = self.scene.lights.iter().filter(is_there).map(Light::sampling_weight);
        of_shapes.chain(of_lights).all(|weight| weight == 0.0)
    }

    /// What shines, as a spectrum or as a picture that is light of its illuminant.
    fn shining(&mut self, name: &str, value: &SpectrumOrTexture, stands: Stands) {
        let SpectrumOrTexture::Texture(texture) = value else {
            self.spectrum_or_texture(name, value, Role::Emission);
            return;
        };
        match self.illuminant_of(texture) {
            Some(Lit::Daylight(scale)) => {
                self.xml.open("spectrum", &[("type", "d65"), ("name", name)]);
                self.xml.value("float", "scale", scale / DAYLIGHT);
                self.thrown("picture", texture, stands);
                self.xml.close();
            }
            Some(Lit::AsItIs | Lit::Otherwise) | None => self.thrown(name, texture, stands),
        }
    }

    /// What multiplies a picture where it shines; `None` of what is no picture.
    fn illuminant_of(&self, texture: &str) -> Option<Lit> {
        let Some(Texture::Image(image)) = self.scene.textures.get(texture) else { return None };
        Some(match &image.illuminant {
            None => Lit::Daylight(1.0),
            Some(light) if light.name.eq_ignore_ascii_case("D65") => Lit::Daylight(light.scale),
            Some(light) if light.name == "E" && light.scale == 1.0 => Lit::AsItIs,
            Some(_) => Lit::Otherwise,
        })
    }

    /// What Mitsuba gets in place of what shines, where it cannot express it.
    pub(super) fn shining_shortfall(&self, value: &SpectrumOrTexture, stands: Stands) -> Option<String> {
        let texture = match value {
            SpectrumOrTexture::Spectrum(spectrum) => return Export::light_shortfall(spectrum),
            SpectrumOrTexture::Texture(texture) => texture,
        };
        let lost = match self.illuminant_of(texture) {
            Some(lit) => lit == Lit::Otherwise,
            None => self.shines_by_squares(texture),
        };
        joined([
            self.pictures_shortfall(texture, stands),
            lost.then(|| "the picture as the spectra of its colours, without its illuminant".to_owned()),
        ])
    }

    /// Whether a picture may shine where Mitsuba has no words for what multiplies it.
    pub(super) fn loses_illuminant(&self, picture: &str) -> bool {
        match self.illuminant_of(picture) {
            Some(Lit::Otherwise) => true,
            Some(Lit::Daylight(_)) => {
                let in_squares = self.scene.textures.values().any(|texture| texture.inner().contains(&picture));
                in_squares || self.shines_as_written(picture)
            }
            Some(Lit::AsItIs) | None => false,
        }
    }

    /// Whether a shape or a projector that shines by a picture stands in the file as it was written: it names the picture itself
    /// then, not the one that Mitsuba has within D65.
    fn shines_as_written(&self, picture: &str) -> bool {
        let shapes = self.scene.shapes.iter().chain(self.scene.groups.values().flatten());
        let mut lamps =
            shapes.filter(|shape| shape.emission.as_ref().and_then(SpectrumOrTexture::name) == Some(picture));
        let thrown = |light: &Light| match light {
            Light::Projector(l) => {
                l.irradiance.name() == Some(picture) && self.shining_shortfall(&l.irradiance, stands(l.v)).is_some()
            }
            _ => false,
        };
        lamps.any(|shape| self.is_restated(shape)) || self.scene.lights.iter().any(thrown)
    }

    /// Whether a checkerboard has pictures in it that something multiplies where they shine.
    fn shines_by_squares(&self, texture: &str) -> bool {
        let inner = self.scene.textures.get(texture).map(Texture::inner).unwrap_or_default();
        inner.into_iter().any(|inner| {
            self.illuminant_of(inner).is_some_and(|lit| lit != Lit::AsItIs) || self.shines_by_squares(inner)
        })
    }
}

/// The second of two skies that are one but for how bright sky and sun are, so that their light is that of one sky.
fn sky_like<'l>(first: &Light, second: &'l Light) -> Option<&'l SkyLight> {
    let (first, second): (&SkyLight, &'l SkyLight) = match (first, second) {
        (Light::Sky(first), Light::Sky(second)) => (first, second),
        _ => return None,
    };
    let as_bright = SkyLight {
        name: first.name.clone(),
        sky_scale: first.sky_scale,
        sun_scale: first.sun_scale,
        sampling_weight: first.sampling_weight,
        ..second.clone()
    };
    (as_bright == *first).then_some(second)
}

/// What multiplies a picture where it shines.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lit {
    /// D65 of this luminance.
    Daylight(f64),
    /// One at each wavelength.
    AsItIs,
    Otherwise,
}

/// How Mitsuba has a picture that is thrown: its v grows downward.
fn stands(v: Growth) -> Stands {
    match v {
        Growth::Up => Stands::OnItsHead,
        Growth::Down => Stands::Upright,
    }
}
