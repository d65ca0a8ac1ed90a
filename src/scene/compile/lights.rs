//! Lights, and how often each is looked for.

use super::super::bands::{self, Bands};
use super::super::daylight::{Conditions, Daylight};
use super::super::environment::{Environment, Mapping};
use super::super::light::{Light, Slide};
use super::super::projector::Projector;
use super::super::shape::Shape;
use super::super::texture::Texture;
use super::super::{Geometry, LightGroups, load};
use super::{Compiler, vec3};
use crate::description as written;
use crate::error::{Error, Result, in_short};
use crate::scene::camera::{self, Camera};
use crate::spectrum::{Spectrum, illuminant};
use glam::{DMat3, DVec2};
use std::collections::HashMap;
use std::sync::Arc;

/// Of light that f32 does not hold.
const TOO_BRIGHT: &str = "expected light up to 3.4e38, found more";

/// A texture as light.
#[derive(Clone)]
pub(super) struct Shining {
    texture: Texture,
    /// Whether f32 holds it.
    is_finite: bool,
}

impl<'a> Compiler<'a> {
    /// A texture as light: the colours of a picture are lit by D65 or what it names.
    fn emission_texture(&mut self, at: &str, s: &'a written::SpectrumOrTexture) -> Texture {
        match s {
            written::SpectrumOrTexture::Texture(name) => {
                let Shining { texture, is_finite } = self.shining_texture(name);
                if !is_finite {
                    self.fault(at, TOO_BRIGHT);
                }
                texture
            }
            written::SpectrumOrTexture::Spectrum(s) => Texture::Uniform(self.light_spectrum(at, s)),
        }
    }

    /// The texture `name` as light: one for all lamps that have it, so that they share what is found out about it.
    fn shining_texture(&mut self, name: &'a str) -> Shining {
        if let Some(known) = self.shining.get(name) {
            return known.clone();
        }
        let mut texture = self.named_texture(name);
        self.light_up(&mut texture, name);
        // Its brightest place is among them.
        let is_finite = texture.representatives().iter().all(Spectrum::is_finite);
        let made = Shining { texture, is_finite };
        // One that is another on each surface is kept for none.
        if self.textures.contains_key(name) {
            self.shining.insert(name, made.clone());
        }
        made
    }

    /// Gives the pictures in the texture `name` their light.
    fn light_up(&mut self, texture: &mut Texture, name: &str) {
        let description = self.description;
        match (&description.textures[name], texture) {
            (written::Texture::Image(written), Texture::Image(image)) => {
                // Light that was measured is as it is, unless something else is written.
                let measured = image.bands.as_ref().is_some_and(|bands| bands.quantity == bands::Quantity::Radiance);
                if measured && written.illuminant.is_none() {
                    return;
                }
                let carried = self.shelf.carried;
                let daylight = || carried.light(illuminant::d65());
                let lit = written.illuminant.clone().map_or_else(daylight, |i| {
                    let at = written::field(&["textures", name, "image", "illuminant"]);
                    self.light_spectrum(&at, &written::Spectrum::Illuminant(i))
                });
                image.light_up((!lit.is_constant() || lit.max() != 1.0).then_some(lit));
            }
            (written::Texture::Checkerboard(board), Texture::Checkerboard { a, b, .. }) => {
                for (written, texture) in [(&board.a, a), (&board.b, b)] {
                    if let Some(name) = written.name() {
                        self.light_up(texture, name);
                    }
                }
            }
            _ => {}
        }
    }

    /// The light that a shape is.
    pub(super) fn shining(
        &mut self,
        at: &str,
        shape: &'a written::Shape,
        emission: &'a written::SpectrumOrTexture,
        object: u32,
        geometry: &Geometry,
    ) -> Light {
        let radiance = self.emission_texture(&format!("{at}.emission"), emission);
        match shape.emission_direction.unwrap_or_default() {
            written::EmissionDirection::All => Light::Area { object, radiance },
            written::EmissionDirection::Normal => {
                if let Geometry::Mesh(mesh) = geometry
                    && !mesh.mesh.is_faceted()
                {
                    self.fault(
                        &format!("{at}.emission_direction"),
                        "expected all for a mesh with smooth normals: along them light is found on flat triangles only",
                    );
                }
                let curved =
                    matches!(geometry, Geometry::Shape(Shape::Sphere(_) | Shape::Cylinder(_) | Shape::Cone(_)));
                if curved && shape.flip_normals {
                    self.fault(
                        &format!("{at}.emission_direction"),
                        "expected all on a curved shape turned inside out: two of its normals meet at each point",
                    );
                }
                Light::AlongNormal { object, exitance: radiance }
            }
        }
    }

    /// A light that is no surface.
    pub(super) fn light(&mut self, at: &str, light: &'a written::Light) -> Result<Option<Light>> {
        Ok(Some(match light {
            written::Light::Point(l) => Light::Point {
                position: vec3(l.position),
                intensity: self.light_spectrum(&format!("{at}.intensity"), &l.intensity),
            },
            written::Light::Spot(l) => return Ok(self.spot(at, l)),
            written::Light::Directional(l) => {
                let Some(direction) = vec3(l.direction).try_normalize() else {
                    self.fault(&format!("{at}.direction"), "expected a direction, found one of length zero");
                    return Ok(None);
                };
                let irradiance = self.light_spectrum(&format!("{at}.irradiance"), &l.irradiance);
                match l.angle_deg > 0.0 {
                    false => Light::Directional { direction, irradiance },
                    true => {
                        let disc = Daylight::of_disc(-direction, 0.5 * l.angle_deg.to_radians(), &irradiance);
                        return Ok(self.day(&format!("{at}.angle_deg"), disc, DMat3::IDENTITY));
                    }
                }
            }
            written::Light::Constant(l) => {
                Light::Constant { radiance: self.light_spectrum(&format!("{at}.radiance"), &l.radiance) }
            }
            written::Light::Environment(l) => {
                self.files.push(l.file.to_path_buf());
                let mapping = match l.mapping {
                    written::EnvironmentMapping::Texels => Mapping::Texels,
                    written::EnvironmentMapping::Mitsuba => Mapping::Poles,
                };
                let (shelf, pictures) = (&mut self.shelf, &mut self.pictures);
                let carried = shelf.carried;
                let map = shelf.skies.get(&l.file, super::sky_key(l), || {
                    let decoded = pictures.take(&l.file)?;
                    if let load::Decoded::Exr(file) = &decoded
                        && let Some(bands) = Bands::of(&l.file, &file.parts[0])?
                    {
                        let size = [file.parts[0].window.width, file.parts[0].window.height].map(|n| n as usize);
                        let map = Environment::of_bands(bands, size, l.scale, mapping, l.world_from_map());
                        let note = load::cut_out(&l.file, file);
                        return map.map(|map| (Arc::new(map), note)).map_err(|message| Error::input(&l.file, message));
                    }
                    let load::Picture { pixels, width, height, note } = load::picture(&l.file, decoded)?;
                    let map = Environment::new(&pixels, [width, height], l.scale, mapping, l.world_from_map(), carried);
                    Ok((Arc::new(map), note))
                });
                let (map, note) = map.map_err(|e| self.asked(&format!("{at}.file"), e))?;
                note.iter().for_each(|note| self.note(&format!("{at}.file"), note));
                // The scale makes the texels brighter.
                if !map.mean_luminance().is_finite() {
                    self.fault(at, TOO_BRIGHT);
                }
                Light::Environment(map)
            }
            written::Light::Sky(l) => {
                let world_from_sky = l.world_from_sky();
                let sun = l.sun.in_sky(world_from_sky);
                if sun.y < 0.0 {
                    let below = -libm::atan2(sun.y, sun.x.hypot(sun.z)).to_degrees();
                    self.note(
                        &format!("{at}.sun"),
                        &format!("{} degrees below the horizon: it is dark", in_short(below)),
                    );
                }
                let day = Daylight::new(&Conditions {
                    sun,
                    turbidity: l.turbidity,
                    albedo: self.reflectance(&format!("{at}.albedo"), &l.albedo),
                    sky_scale: l.sky_scale,
                    sun_scale: l.sun_scale,
                    sun_half_angle: 0.5 * l.sun_angle_deg.to_radians(),
                    limb_darkening: l.limb_darkening,
                    carried: self.shelf.carried,
                });
                return Ok(self.day(at, day, world_from_sky));
            }
            written::Light::Projector(l) => return Ok(self.projector(at, l)),
        }))
    }

    /// A sky, or a disc at infinity; a fault where it is brighter than f32 holds.
    fn day(&mut self, at: &str, day: Option<Daylight>, world_from_sky: DMat3) -> Option<Light> {
        if day.is_none() {
            self.fault(at, TOO_BRIGHT);
        }
        Some(Light::Environment(Arc::new(Environment::of_day(day?, world_from_sky))))
    }

    fn spot(&mut self, at: &str, l: &'a written::SpotLight) -> Option<Light> {
        let Some(axis) = l.axis().try_normalize() else {
            self.fault(at, "expected a direction, found one of length zero");
            return None;
        };
        let position = vec3(l.position);
        let cutoff = l.cutoff_deg.to_radians();
        let slide = match &l.texture {
            None => {
                let idle = [("up", l.up.is_some()), ("v", l.v != written::Growth::default())];
                for (field, _) in idle.into_iter().filter(|(_, written)| *written) {
                    self.note(&format!("{at}.{field}"), "it is the texture's, and there is none");
                }
                None
            }
            Some(name) => {
                let up = vec3(l.up.unwrap_or([0.0, 1.0, 0.0]));
                let Some(world_from_spot) = Camera::look_at(position, position + axis, up) else {
                    self.fault(&format!("{at}.up"), "expected a direction that is not along the axis");
                    return None;
                };
                let texture = self.named_texture(name);
                let half = libm::tan(cutoff) * DVec2::new(1.0, growth(l.v));
                Some(Box::new(Slide { texture, axes: world_from_spot.matrix3, half }))
            }
        };
        let intensity = self.light_spectrum(&format!("{at}.intensity"), &l.intensity);
        let thrown = |slide: &Slide| slide.texture.representatives().iter().all(|s| s.times(&intensity).is_finite());
        if !slide.as_deref().is_none_or(thrown) {
            self.fault(at, TOO_BRIGHT);
        }
        Some(Light::Spot { position, axis, beam: l.beam_deg.to_radians(), cutoff, intensity, slide })
    }

    fn projector(&mut self, at: &str, l: &'a written::ProjectorLight) -> Option<Light> {
        let Some(world_from_projector) = Camera::look_at(vec3(l.origin), vec3(l.target), vec3(l.up)) else {
            self.fault(&format!("{at}.up"), "expected a direction that is not along the beam");
            return None;
        };
        let irradiance = self.emission_texture(&format!("{at}.irradiance"), &l.irradiance);
        let brightest = irradiance.representatives().iter().map(Spectrum::max).fold(0.0, f64::max);
        if brightest * l.scale > f64::from(f32::MAX) {
            self.fault(&format!("{at}.scale"), TOO_BRIGHT);
        }
        let resolution = match &irradiance {
            Texture::Image(image) => [image.grid.width as u32, image.grid.height as u32],
            _ => [1, 1],
        };
        let camera::Projection::Perspective { half_width } =
            camera::Projection::perspective(l.fov_deg.to_radians(), super::camera::fov_axis(l.fov_axis), resolution)
        else {
            return None;
        };
        let half_height = half_width * f64::from(resolution[1]) / f64::from(resolution[0]);
        let half = DVec2::new(half_width, half_height * growth(l.v));
        Some(Light::Projector(Box::new(Projector::new(world_from_projector, half, irradiance, l.scale))))
    }
}

/// The sign with which v goes up.
fn growth(v: written::Growth) -> f64 {
    match v {
        written::Growth::Up => 1.0,
        written::Growth::Down => -1.0,
    }
}

/// The groups that the lights of these names are in.
pub(super) fn groups(d: &written::SceneDescription, lights: &[String]) -> LightGroups {
    let mut numbers: HashMap<&str, u8> = HashMap::new();
    // What is put into the group of lamps that are in no other is in no other.
    let others = || d.light_groups.iter().filter(|(name, _)| *name != written::DEFAULT_GROUP);
    for ((_, names), number) in others().zip(1..) {
        numbers.extend(names.iter().map(|name| (name.as_str(), number)));
    }
    let of = |light: &String| numbers.get(light.as_str()).copied().unwrap_or(0);
    LightGroups { names: others().map(|(name, _)| name.clone()).collect(), of: lights.iter().map(of).collect() }
}

/// Running sums of the probabilities with which lights are chosen: half by power, half evenly, so
/// that no light is forgotten; both times the lights' weights.
pub(super) fn light_cdf(powers: &[f64], weights: &[f64]) -> Vec<f64> {
    let powers: Vec<f64> = powers.iter().zip(weights).map(|(power, w)| w * power).collect();
    let total: f64 = powers.iter().sum();
    let n: f64 = weights.iter().sum();
    if n == 0.0 {
        // None is ever chosen: all sums are 0, below every random number.
        return vec![0.0; powers.len()];
    }
    let mut sum = 0.0;
    let mut cdf: Vec<f64> = powers
        .iter()
        .zip(weights)
        .map(|(p, w)| {
            let share = if total > 0.0 && total.is_finite() { p / total } else { w / n };
            sum += 0.5 * share + 0.5 * w / n;
            sum
        })
        .collect();
    // Rounding may leave the last sum short of one; what follows the last light with a weight has none.
    if let Some(last) = weights.iter().rposition(|&w| w > 0.0) {
        cdf[last..].fill(1.0);
    }
    cdf
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::SceneDescription;
    use crate::film::{Window, exr};
    use crate::scene::compile::testing::compiled_in;
    use crate::scene::texture::TexturePoint;
    use crate::spectrum::{Lanes, Spectrum};
    use glam::DVec3;
    use std::collections::BTreeSet;

    fn point(intensity: f32) -> Light {
        Light::Point { position: DVec3::ZERO, intensity: Spectrum::Constant(intensity) }
    }

    /// Lights of power 1 and 3: half of ¼, ¾ and half of ½, ½. With weights 1 and 0 only the first.
    #[test]
    fn lights_are_chosen_by_power_and_weight() {
        let powers = [point(1.0), point(3.0)].map(|light| light.power(&[], 1.0));
        let cdf = light_cdf(&powers, &[1.0, 1.0]);
        assert!((cdf[0] - 0.375).abs() < 1e-12 && cdf[1] == 1.0);
        assert_eq!(light_cdf(&powers, &[1.0, 0.0]), [1.0, 1.0]);
        assert_eq!(light_cdf(&powers, &[0.0, 2.0]), [0.0, 1.0]);
        assert_eq!(light_cdf(&powers, &[0.0, 0.0]), [0.0, 0.0]);
    }

    /// What one lamp finds out about the picture that it shows all others know, but not a slide, which has the light of its spot.
    #[test]
    fn what_many_lamps_show_is_looked_at_once() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("t.ppm"), "P3 2 1 255 255 128 0 0 128 255\n").unwrap();
        let scene = compiled_in(
            directory.path(),
            "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n\
             textures: {t: {image: {file: t.ppm}}}\n\
             shapes:\n\
             - sphere: {radius: 1, emission: {texture: t}}\n\
             - sphere: {center: [3, 0, 0], radius: 1, emission: {texture: t}}\n\
             lights:\n\
             - spot: {position: [0, 4, 0], target: [0, 0, 0], up: [0, 0, 1], cutoff_deg: 20, intensity: 1, texture: t}\n",
        );
        let mean = |light: &Light| {
            let texture = match light {
                Light::Area { radiance, .. } => radiance,
                Light::Spot { slide: Some(slide), .. } => &slide.texture,
                other => panic!("{other:?}"),
            };
            let Texture::Image(image) = texture else { panic!("{texture:?}") };
            image.mean.clone()
        };
        let means: Vec<_> = scene.lights.iter().map(mean).collect();
        assert!(Arc::ptr_eq(&means[0], &means[1]) && !Arc::ptr_eq(&means[0], &means[2]));
        assert!(means.iter().all(|mean| mean.get().is_some_and(|&mean| mean > 0.0)));
    }

    /// Radiance of 3 at 400 and 500 nm, as it was measured and behind an even illuminant of 2.
    #[test]
    fn measured_light_has_the_illuminant_that_is_written() {
        let directory = tempfile::tempdir().unwrap();
        let sky = exr::ExrImage {
            frame: [1, 1],
            window: Window::full(1, 1),
            channels: ["S0.400nm", "S0.500nm"].map(|name| (name.to_owned(), exr::ChannelData::F32(vec![3.0]))).into(),
            colour: None,
            attributes: Vec::new(),
            data: BTreeSet::new(),
            compression: exr::Compression::Zip,
            layout: exr::Layout::Single,
        };
        exr::write_exr(&directory.path().join("light.exr"), &sky).unwrap();
        for (written, expected) in [("", 3.0), (", illuminant: {name: E, scale: 2}", 6.0)] {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                 textures: {{t: {{image: {{file: light.exr{written}}}}}}}\n\
                 shapes: [sphere: {{radius: 1, emission: {{texture: t}}}}]\n"
            );
            let scene = compiled_in(directory.path(), &text);
            let Light::Area { radiance, .. } = &scene.lights[0] else { panic!("a shape that shines") };
            let found = radiance.eval(&TexturePoint::default(), Lanes::splat(450.0)).to_array()[0];
            assert!((found - expected).abs() < 1e-6, "{found} for {expected}");
        }
    }

    /// Many lamps in two groups, and one in none: sought name by name they would take a minute.
    #[test]
    fn many_lamps_in_groups_take_no_quadratic_time() {
        const MANY: usize = 200_000;
        let begin = std::time::Instant::now();
        let text = "camera: {origin: [0, 1, 5], target: [0, 0, 0], fov_deg: 40}\n";
        let mut scene = SceneDescription::parse(text, std::path::Path::new("s.yaml")).unwrap();
        let lamps: Vec<String> = (0..MANY).map(|i| format!("lamp{i:07}")).collect();
        scene.light_groups.insert("fill".into(), vec![lamps[1].clone()]);
        scene.light_groups.insert("key".into(), lamps[2..].to_vec());
        let groups = groups(&scene, &lamps);
        assert_eq!((&groups.names[..], &groups.of[..3]), (&["fill".to_owned(), "key".to_owned()][..], &[0, 1, 2][..]));
        assert!(groups.of[2..].iter().all(|group| *group == 2));
        assert!(begin.elapsed() < std::time::Duration::from_secs(20));
    }
}
