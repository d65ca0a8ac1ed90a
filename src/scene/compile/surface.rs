//! Materials and textures, from what a person wrote.

use super::Compiler;
use super::spectra::Role;
use crate::description as written;
use crate::error::{Error, Result, in_short};
use crate::math::LENGTHS;
use crate::optics::fresnel::Model;
use crate::optics::microfacet::{Distribution, Microfacets};
use crate::optics::plastic::DiffuseMean;
use crate::scene::compound::{Composition, Compound, MOST_RELIEFS, Relief, ReliefForm, one_side};
use crate::scene::material::{Coat, Highlight, HighlightModel, Kind, Material, Roughness, TexturedRoughness, Tints};
use crate::scene::texture::{Grid, ImageTexture, Interpolation, Scalar, Texture, Wrap};
use crate::scene::{bands, load};
use crate::spectrum::{Outside, RefractiveIndex, Spectrum, catalogue};
use glam::{DAffine2, DMat2, DVec2};
use std::sync::Arc;

/// Roughness below which a surface is computed as smooth: the lobe is then narrower than f32 can
/// tell directions apart (2⁻²⁴ · 16), and D(m) leaves the range of f32.
const SMOOTHEST: f64 = 1e-6;

impl<'a> Compiler<'a> {
    pub(super) fn reflectance_texture(&mut self, at: &str, s: &'a written::SpectrumOrTexture) -> Texture {
        match s {
            written::SpectrumOrTexture::Texture(name) => {
                let at = format!("{at}.texture");
                let texture = self.named_texture(name);
                self.check_reflects(&at, &texture, name);
                texture.of_shares()
            }
            written::SpectrumOrTexture::Spectrum(s) => Texture::Uniform(self.reflectance(at, s)),
        }
    }

    /// Refuses more than all light in the texture `name`, which the field `at` takes for reflectances.
    fn check_reflects(&mut self, at: &str, texture: &Texture, name: &str) {
        let description = self.description;
        match (&description.textures[name], texture) {
            (written::Texture::Image(_), Texture::Image(ImageTexture { bands: Some(bands), .. })) => {
                let is_light = bands.quantity == bands::Quantity::Radiance;
                if is_light {
                    self.fault(at, "expected reflectances (channels T), found radiance (S0)");
                }
            }
            (written::Texture::Image(written), Texture::Image(ImageTexture { texels, grid, .. })) => {
                let above = || texels.colours.iter().position(|texel| texel.scale > 1.0);
                let above = if texels.greatest > 1.0 { above() } else { None };
                if let Some(i) = above {
                    let (x, y, found) = (i % grid.width, i / grid.width, texels.at(i).scale);
                    let message = format!("expected reflectances from 0 to 1, found {found} at ({x}, {y})");
                    let error = self.asked(at, Error::input(&written.file, message));
                    self.unread.get_or_insert(error);
                }
            }
            (written::Texture::Checkerboard(board), Texture::Checkerboard { a, b, .. }) => {
                for (written, texture) in [(&board.a, a), (&board.b, b)] {
                    if let Some(name) = written.name() {
                        self.check_reflects(at, texture, name);
                    }
                }
            }
            (written::Texture::Volume(volume), Texture::Volume(found)) => self.check_shares(at, found, volume),
            (written::Texture::MeshAttribute(written), Texture::Attribute(attribute)) => {
                if let Some(found) = attribute.no_share() {
                    let written::MeshAttribute { name, scale } = written;
                    let times = if *scale == 1.0 { String::new() } else { format!(" times {}", in_short(*scale)) };
                    let found = in_short(f64::from(found));
                    let expected = format!("expected reflectances from 0 to 1 in the attribute {name}{times}");
                    self.fault(at, format!("{expected}, found {found}"));
                }
            }
            _ => {}
        }
    }

    /// A cell of a checkerboard, which may reflect or shine.
    fn cell(&mut self, at: &str, s: &'a written::SpectrumOrTexture) -> Texture {
        match s {
            written::SpectrumOrTexture::Texture(name) => self.named_texture(name),
            written::SpectrumOrTexture::Spectrum(s) => Texture::Uniform(self.reflectance(at, s)),
        }
    }

    /// A number, or a texture of numbers.
    pub(super) fn scalar(&mut self, s: &'a written::NumberOrTexture) -> Scalar {
        match s {
            written::NumberOrTexture::Number(x) => Scalar::Uniform(*x),
            written::NumberOrTexture::Texture(name) => self.named_numbers(name),
        }
    }

    /// The texture `name` as spectra.
    pub(super) fn named_texture(&mut self, name: &'a str) -> Texture {
        if let Some(known) = self.textures.get(name) {
            return known.clone();
        }
        if let Some(known) = self.kept(|at_hand| at_hand.textures.get(name)) {
            return known;
        }
        let (made, asked) = self.asking(|c| {
            let texture = &c.description.textures[name];
            c.texture(&written::field(&["textures", name]), texture)
        });
        let texture = made.unwrap_or_else(|error| {
            self.unread.get_or_insert(error);
            Texture::one()
        });
        let kept = if asked { &mut self.at_hand.textures } else { &mut self.textures };
        kept.insert(name, texture.clone());
        texture
    }

    /// The texture `name` as numbers.
    pub(super) fn named_numbers(&mut self, name: &'a str) -> Scalar {
        if let Some(known) = self.numbers.get(name) {
            return known.clone();
        }
        if let Some(known) = self.kept(|at_hand| at_hand.numbers.get(name)) {
            return known;
        }
        let (made, asked) = self.asking(|c| {
            let texture = &c.description.textures[name];
            c.numbers(&written::field(&["textures", name]), texture)
        });
        let numbers = made.unwrap_or_else(|error| {
            self.unread.get_or_insert(error);
            Scalar::Uniform(0.5)
        });
        let kept = if asked { &mut self.at_hand.numbers } else { &mut self.numbers };
        kept.insert(name, numbers.clone());
        numbers
    }

    /// What is wrong with a texture is told even where nothing uses it.
    pub(super) fn unused_textures(&mut self) {
        let description = self.description;
        for name in description.textures.keys() {
            if !self.textures.contains_key(name.as_str()) && !self.numbers.contains_key(name.as_str()) {
                self.named_texture(name);
            }
        }
    }

    fn texture(&mut self, at: &str, texture: &'a written::Texture) -> Result<Texture> {
        Ok(match texture {
            written::Texture::Image(image) => {
                self.files.push(image.file.to_path_buf());
                let (shelf, pictures) = (&mut self.shelf, &mut self.pictures);
                let carried = shelf.carried;
                let loaded = shelf.colours.get(&image.file, image.raw, || {
                    pictures.take(&image.file).and_then(|p| load::image_texture(&image.file, p, image.raw, carried))
                });
                let file = format!("{at}.image.file");
                let (mut loaded, note) = loaded.map_err(|e| self.asked(&file, e))?;
                note.iter().for_each(|note| self.note(&file, note));
                loaded.grid = self.grid(at, image, loaded.grid.width, loaded.grid.height);
                Texture::Image(loaded)
            }
            written::Texture::MeshAttribute(attribute) => {
                self.attribute(at, attribute).map_or_else(Texture::one, |a| Texture::Attribute(a.into()))
            }
            written::Texture::Volume(name) => Texture::Volume(self.volume_texture(&format!("{at}.volume"), name)),
            written::Texture::Checkerboard(board) => {
                let [a, b] = [("a", &board.a), ("b", &board.b)]
                    .map(|(key, colour)| Box::new(self.cell(&format!("{at}.checkerboard.{key}"), colour)));
                let uv = self.board_map(at, board);
                Texture::Checkerboard { a, b, uv }
            }
        })
    }

    fn numbers(&mut self, at: &str, texture: &'a written::Texture) -> Result<Scalar> {
        Ok(match texture {
            written::Texture::Image(image) => {
                self.files.push(image.file.to_path_buf());
                let (shelf, pictures) = (&mut self.shelf, &mut self.pictures);
                let loaded = shelf.numbers.get(&image.file, image.raw, || {
                    pictures.take(&image.file).and_then(|p| load::data_image(&image.file, p, image.raw))
                });
                let file = format!("{at}.image.file");
                let (mut loaded, note) = loaded.map_err(|e| self.asked(&file, e))?;
                note.iter().for_each(|note| self.note(&file, note));
                loaded.grid = self.grid(at, image, loaded.grid.width, loaded.grid.height);
                Scalar::Image(loaded)
            }
            written::Texture::MeshAttribute(attribute) => {
                self.attribute(at, attribute).map_or(Scalar::Uniform(0.5), |a| Scalar::Attribute(a.into()))
            }
            written::Texture::Volume(name) => Scalar::Volume(self.volume_numbers(&format!("{at}.volume"), name)),
            written::Texture::Checkerboard(board) => {
                let mut cell = |key: &str, s: &'a written::SpectrumOrTexture| {
                    let at = format!("{at}.checkerboard.{key}");
                    Box::new(match s {
                        written::SpectrumOrTexture::Spectrum(written::Spectrum::Number(x)) => Scalar::Uniform(*x),
                        written::SpectrumOrTexture::Spectrum(_) => {
                            self.fault(&at, "expected a number in a texture that is used as numbers, found a spectrum");
                            Scalar::Uniform(0.5)
                        }
                        written::SpectrumOrTexture::Texture(name) => self.named_numbers(name),
                    })
                };
                let [a, b] = [cell("a", &board.a), cell("b", &board.b)];
                let uv = self.board_map(at, board);
                Scalar::Checkerboard { a, b, uv }
            }
        })
    }

    /// The lattice of the picture `image` of the texture `at`.
    fn grid(&mut self, at: &str, image: &written::ImageTexture, width: usize, height: usize) -> Grid {
        let uv = uv_map(image.uv, image.scale, image.offset);
        self.check_map(&format!("{at}.image"), uv, DVec2::new(width as f64, height as f64));
        Grid {
            width,
            height,
            wrap: [wrap(image.wrap), wrap(image.wrap_v.unwrap_or(image.wrap))],
            interpolation: match image.filter {
                written::TextureFilter::Bilinear => Interpolation::Bilinear,
                written::TextureFilter::Nearest => Interpolation::Nearest,
            },
            uv,
        }
    }

    /// From u, v to the periods of the board of the texture `at`.
    fn board_map(&mut self, at: &str, board: &written::Checkerboard) -> DAffine2 {
        let uv = uv_map(board.uv, board.scale, [0.0; 2]);
        self.check_map(&format!("{at}.checkerboard"), uv, DVec2::ONE);
        uv
    }

    /// Refuses a map that takes some u, v, which are lengths on some shapes, out of the range of numbers; `size` of what it maps
    /// to, in cells.
    fn check_map(&mut self, at: &str, uv: DAffine2, size: DVec2) {
        let [u, v] = [uv.matrix2.x_axis, uv.matrix2.y_axis].map(|axis| axis.abs() * *LENGTHS.end());
        if !((u + v + uv.translation.abs()) * size).is_finite() {
            self.fault(
                at,
                "expected a uv, scale and offset that stay within the range of numbers, found a product beyond it",
            );
        }
    }

    /// The material `name`.
    pub(super) fn named_material(&mut self, name: &'a str) -> Arc<Material> {
        if let Some(known) = self.named.get(name) {
            return known.clone();
        }
        if let Some(known) = self.kept(|at_hand| at_hand.materials.get(name)) {
            return known;
        }
        let at = written::field(&["materials", name]);
        let (material, asked) = self.asking(|c| c.material(&at, &c.description.materials[name]));
        let material = Arc::new(material);
        let kept = if asked { &mut self.at_hand.materials } else { &mut self.named };
        kept.insert(name, material.clone());
        material
    }

    /// A material within another.
    fn inner(&mut self, at: &str, material: &'a written::MaterialRef) -> Arc<Material> {
        match material {
            written::MaterialRef::Name(name) => self.named_material(name),
            written::MaterialRef::Inline(material) => Arc::new(self.material(at, material)),
        }
    }

    pub(super) fn material(&mut self, at: &str, material: &'a written::Material) -> Material {
        let place = format!("{at}.{}", material.kind());
        let at = |field: &str| format!("{place}.{field}");
        let plain = |kind| (kind, false, None);
        let (kind, two_sided, highlight) = match material {
            written::Material::Diffuse(m) => (
                Kind::Diffuse { reflectance: self.reflectance_texture(&at("reflectance"), &m.reflectance) },
                m.two_sided,
                m.highlight,
            ),
            written::Material::Mirror(m) => {
                (Kind::Mirror { reflectance: self.reflectance(&at("reflectance"), &m.reflectance) }, true, m.highlight)
            }
            written::Material::Conductor(m) => (self.conductor(&place, m), m.two_sided, m.highlight),
            written::Material::Dielectric(m) => match self.dielectric(&place, m) {
                Kind::Boundary => plain(Kind::Boundary),
                kind => (kind, false, m.highlight),
            },
            written::Material::ThinDielectric(m) => {
                let interior = self.index(&at("ior"), &m.ior);
                let exterior = self.index(&at("exterior_ior"), &m.exterior_ior);
                let tints = self.tints(&place, &m.reflection_tint, &m.transmission_tint);
                let thickness = m.thickness_nm.as_ref();
                let thickness = thickness.map(|t| Box::new(self.thickness(&at("thickness_nm"), t, &interior)));
                plain(Kind::Thin { interior, exterior, tints, thickness })
            }
            written::Material::Plastic(m) => (self.plastic(&place, m), m.two_sided, m.highlight),
            written::Material::Hair(m) => plain(self.hair(&place, m)),
            written::Material::Principled(m) => {
                (Kind::Principled(Box::new(self.principled(&place, m))), m.two_sided, None)
            }
            written::Material::PrincipledThin(m) => {
                plain(Kind::PrincipledThin(Box::new(self.principled_thin(&place, m))))
            }
            written::Material::Boundary(_) => plain(Kind::Boundary),
            written::Material::Mask(m) => {
                let opacity = self.scalar(&m.opacity);
                let inner = self.inner(&at("material"), &m.material);
                plain(self.compound(&place, Composition::Mask { opacity, inner }))
            }
            written::Material::Blend(m) => {
                let weight = self.scalar(&m.weight);
                let first = self.inner(&at("first"), &m.first);
                let second = self.inner(&at("second"), &m.second);
                plain(self.compound(&place, Composition::Blend { weight, first, second }))
            }
            written::Material::TwoSided(m) => plain(self.sides(&place, m)),
            written::Material::Bump(m) => {
                let heights = self.named_numbers(&m.height.texture);
                if !heights.has_slopes() {
                    self.note(
                        &at("height"),
                        "the texture has no slopes by u and v, so that the surface stays smooth; pictures with filter bilinear have",
                    );
                }
                let form = ReliefForm::Heights { heights, scale: m.scale };
                let relief = Relief { form, turn: m.turn, shadowing: m.shadowing };
                let inner = self.inner(&at("material"), &m.material);
                plain(self.compound(&place, Composition::Relief { relief, inner }))
            }
            written::Material::NormalMap(m) => {
                let normals = self.named_numbers(&m.normals.texture);
                if normals.is_decoded() {
                    self.note(
                        &at("normals"),
                        "the picture is decoded from sRGB, as if its numbers were colours, so that normals lean; \
                         with raw: true they are as they stand",
                    );
                }
                let relief = Relief { form: ReliefForm::Normals(normals), turn: m.turn, shadowing: m.shadowing };
                let inner = self.inner(&at("material"), &m.material);
                plain(self.compound(&place, Composition::Relief { relief, inner }))
            }
        };
        let highlight = highlight.map(|h| Highlight {
            strength: h.strength as f32,
            exponent: h.exponent,
            model: match h.model {
                written::HighlightModel::Blinn => HighlightModel::Blinn,
                written::HighlightModel::Phong => HighlightModel::Phong,
            },
        });
        Material { kind, two_sided, highlight }
    }

    fn conductor(&mut self, place: &str, m: &'a written::Conductor) -> Kind {
        let at = |field: &str| format!("{place}.{field}");
        let metal = match &m.index {
            written::ConductorIndex::Metal(name) => {
                let none = (Spectrum::Constant(1.0), Spectrum::Constant(0.0));
                self.or(&at("metal"), catalogue::metal(name), none).into()
            }
            written::ConductorIndex::File(file) => self.metal_file(&at("file"), file).into(),
            written::ConductorIndex::Written { eta, k } => [
                self.written_spectrum(&at("eta"), eta, Outside::Hold, Role::OpticalConstant),
                self.written_spectrum(&at("k"), k, Outside::Hold, Role::OpticalConstant),
            ],
        };
        let [eta, k] = self.shelf.carried.metal(metal);
        let tint = self.reflectance_texture(&at("tint"), &m.tint);
        let facets = self.roughness(&m.roughness, m.distribution);
        let film = self.film(&at("film"), m.film.as_ref());
        Kind::Conductor { eta, k, tint, fresnel: model(m.fresnel), facets, film }
    }

    fn dielectric(&mut self, place: &str, m: &'a written::Dielectric) -> Kind {
        let at = |field: &str| format!("{place}.{field}");
        let interior = self.index(&at("ior"), &m.ior);
        let exterior = self.index(&at("exterior_ior"), &m.exterior_ior);
        let facets = self.roughness(&m.roughness, m.distribution);
        let tints = self.tints(place, &m.reflection_tint, &m.transmission_tint);
        let film = self.film(&at("film"), m.film.as_ref());
        let absorption = self.absorption(place, m).map(Box::new);
        if facets.is_some() && m.fresnel == written::Fresnel::Schlick {
            self.fault(&at("fresnel"), "expected exact on rough glass, found schlick");
        }
        // Without a difference of index there is no interface, however rough: light goes on, and
        // casts no shadow.
        let is_clear = tints.is_none() && m.priority.is_none() && film.is_none() && absorption.is_none();
        if let (RefractiveIndex::Constant(a), RefractiveIndex::Constant(b)) = (&interior, &exterior)
            && a == b
            && is_clear
        {
            return Kind::Boundary;
        }
        let (fresnel, priority) = (model(m.fresnel), m.priority);
        Kind::Dielectric { interior, exterior, fresnel, facets, tints, priority, film, absorption }
    }

    fn plastic(&mut self, place: &str, m: &'a written::Plastic) -> Kind {
        let at = |field: &str| format!("{place}.{field}");
        let reflectance = self.reflectance_texture(&at("reflectance"), &m.reflectance);
        let tint = self.reflectance_texture(&at("tint"), &m.tint);
        let interior = self.index(&at("ior"), &m.ior);
        let exterior = self.index(&at("exterior_ior"), &m.exterior_ior);
        let facets = facets(m.roughness, m.distribution);
        let tint = (!is_one(&tint)).then(|| Box::new(tint));
        let mean = match m.diffuse_mean {
            written::DiffuseMean::Integral => DiffuseMean::Integral,
            written::DiffuseMean::Nodes => DiffuseMean::Nodes,
        };
        let coats = &mut self.shelf.coats;
        let coat = Box::new(Coat::new(interior, exterior, facets, |range| coats.get(range, facets.as_ref(), mean)));
        Kind::Plastic { reflectance, coat, nonlinear: m.nonlinear, tint }
    }

    fn sides(&mut self, place: &str, m: &'a written::TwoSided) -> Kind {
        let at = |field: &str| format!("{place}.{field}");
        let mut side = |name: &str, side: &'a written::MaterialRef| {
            let material = self.inner(&at(name), side);
            // The back is the front's mirror image: light would enter from either side, and never leave.
            if material.refracts() {
                let expected = "expected a material that bends no light, found one that does";
                self.fault(&at(name), format!("{expected}: neither side would be its inside"));
            }
            // Light from behind would meet another material than it comes out of.
            if m.back.as_ref().is_some_and(|back| *back != m.front) && material.scatters_through() {
                let expected = "expected a material that scatters no light to its other side, found one that does";
                self.fault(&at(name), format!("{expected}: it has to be the front of both sides, without `back`"));
            }
            one_side(&material)
        };
        let front = side("front", &m.front);
        let back = m.back.as_ref().map_or_else(|| front.clone(), |back| side("back", back));
        self.compound(place, Composition::TwoSided { front, back })
    }

    fn compound(&mut self, at: &str, composition: Composition) -> Kind {
        let compound = Compound::new(composition);
        if compound.reliefs > MOST_RELIEFS {
            self.fault(at, format!("expected at most {MOST_RELIEFS} reliefs over each other, found more"));
            return Kind::Boundary;
        }
        Kind::Compound(Box::new(compound))
    }

    fn roughness(
        &mut self,
        roughness: &'a written::Roughness,
        distribution: written::Distribution,
    ) -> Option<Roughness> {
        let (u, v) = match roughness {
            written::Roughness::Number(alpha) => return facets(*alpha, distribution).map(Roughness::Uniform),
            written::Roughness::Texture(name) => (self.named_numbers(name), None),
            written::Roughness::Brushed(brushed) => {
                let u = self.scalar(&brushed.u);
                (u, Some(self.scalar(&brushed.v)))
            }
        };
        let distribution = family(distribution);
        Some(match (u, v) {
            (Scalar::Uniform(u), Some(Scalar::Uniform(v))) => {
                Roughness::Uniform(Microfacets::anisotropic(distribution, u.max(SMOOTHEST), v.max(SMOOTHEST)))
            }
            (u, v) => Roughness::Textured(Box::new(TexturedRoughness { distribution, u, v })),
        })
    }

    /// The factors of an interface, where they are not one.
    fn tints(
        &mut self,
        at: &str,
        reflection: &'a written::SpectrumOrTexture,
        transmission: &'a written::SpectrumOrTexture,
    ) -> Option<Box<Tints>> {
        let reflected = self.reflectance_texture(&format!("{at}.reflection_tint"), reflection);
        let transmitted = self.reflectance_texture(&format!("{at}.transmission_tint"), transmission);
        let needed = !(is_one(&reflected) && is_one(&transmitted));
        needed.then(|| Box::new(Tints { reflected, transmitted }))
    }
}

fn is_one(texture: &Texture) -> bool {
    matches!(texture, Texture::Uniform(Spectrum::Constant(x)) if *x == 1.0)
}

fn wrap(w: written::Wrap) -> Wrap {
    match w {
        written::Wrap::Repeat => Wrap::Repeat,
        written::Wrap::Mirror => Wrap::Mirror,
        written::Wrap::Clamp => Wrap::Clamp,
    }
}

/// First the affine map, then scale and offset.
fn uv_map(map: Option<[[f64; 3]; 2]>, scale: [f64; 2], offset: [f64; 2]) -> DAffine2 {
    let scaled = DAffine2::from_mat2_translation(DMat2::from_diagonal(DVec2::from(scale)), DVec2::from(offset));
    match map {
        None => scaled,
        Some([[a, b, c], [d, e, f]]) => {
            scaled * DAffine2::from_cols(DVec2::new(a, d), DVec2::new(b, e), DVec2::new(c, f))
        }
    }
}

fn model(fresnel: written::Fresnel) -> Model {
    match fresnel {
        written::Fresnel::Exact => Model::Exact,
        written::Fresnel::Schlick => Model::Schlick,
    }
}

fn family(distribution: written::Distribution) -> Distribution {
    match distribution {
        written::Distribution::Ggx => Distribution::Ggx,
        written::Distribution::Beckmann => Distribution::Beckmann,
    }
}

fn facets(alpha: f64, distribution: written::Distribution) -> Option<Microfacets> {
    (alpha >= SMOOTHEST).then_some(Microfacets::isotropic(family(distribution), alpha))
}

#[cfg(test)]
mod tests {
    use crate::description::SceneDescription;
    use crate::optics::plastic::Coats;
    use crate::scene::compile::compile;
    use crate::scene::compile::testing::{compiled_in, compiled_with};
    use crate::scene::grid::testing::vol;
    use crate::scene::material::Kind;
    use crate::scene::shelf::Shelf;
    use crate::scene::{Object, Scene};
    use std::path::Path;
    use std::sync::Arc;

    /// Blender numbers what has no name of its own: a fault of `Material.001` was told at the line of `Material`.
    #[test]
    fn faults_of_names_with_a_dot_are_told_where_they_stand() {
        let text = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\nmaterials:\n  Material: {diffuse: {}}\n  \
                    Material.001:\n    dielectric: {ior: {glass: none}}\n";
        let description = SceneDescription::parse(text, Path::new("s.yaml")).unwrap();
        let told = compile(&description, "s").unwrap_err().to_string();
        let expected = "s.yaml:5:23: materials.\"Material.001\".dielectric.ior: unknown glass \"none\"";
        assert!(told.starts_with(expected), "{told}");
    }

    /// Light goes by the slopes of heights, not by the heights: those of a volume, of steps between texels or cells and of single
    /// numbers are zero, so that a surface is as if it had none.
    #[test]
    fn heights_without_slopes_are_told() {
        let told = |texture: &str| {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                 volumes: {{haze: {{constant: {{value: 0.5}}}}}}\n\
                 textures:\n  waves: {{image: {{file: waves.pgm}}}}\n  h: {texture}\n\
                 materials: {{m: {{bump: {{height: {{texture: h}}, material: {{diffuse: {{}}}}}}}}}}\n\
                 shapes: [sphere: {{radius: 1, material: m}}]\n"
            );
            let directory = tempfile::tempdir().unwrap();
            std::fs::write(directory.path().join("waves.pgm"), b"P5 2 2 255\n0123").unwrap();
            let description = SceneDescription::parse(&text, &directory.path().join("s.yaml")).unwrap();
            compile(&description, "s")
                .unwrap()
                .notes
                .iter()
                .any(|note| note.contains("m.bump.height: the texture has no slopes"))
        };
        for flat in ["{volume: haze}", "{image: {file: waves.pgm, filter: nearest}}", "{checkerboard: {a: 0, b: 1}}"] {
            assert!(told(flat), "{flat}");
        }
        for raised in ["{image: {file: waves.pgm}}", "{checkerboard: {a: 0, b: {texture: waves}}}"] {
            assert!(!told(raised), "{raised}");
        }
    }

    /// A blue of 255 and the others of 128 stand for the normal itself; decoded, 128 is 0.216, and the normal leans by 39 degrees.
    #[test]
    fn normals_of_a_picture_that_is_not_raw_are_told() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("flat.ppm"), b"P6 1 1 255\n\x80\x80\xff").unwrap();
        std::fs::write(directory.path().join("flat16.ppm"), b"P6 1 1 65535\n\x80\0\x80\0\xff\xff").unwrap();
        let told = |texture: &str, material: &str| {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                 textures:\n  t: {{image: {{{texture}}}}}\n  board: {{checkerboard: {{a: 0.5, b: {{texture: t}}}}}}\n\
                 materials: {{m: {{{material}}}}}\nshapes: [sphere: {{radius: 1, material: m}}]\n"
            );
            let notes = compiled_in(directory.path(), &text).notes;
            notes.iter().any(|note| note.contains("m.normal_map.normals: the picture is decoded from sRGB"))
        };
        let normals =
            |texture: &str| format!("normal_map: {{normals: {{texture: {texture}}}, material: {{diffuse: {{}}}}}}");
        for file in ["file: flat.ppm", "file: flat16.ppm"] {
            assert!(told(file, &normals("t")) && told(file, &normals("board")), "{file}");
            assert!(!told(&format!("{file}, raw: true"), &normals("t")), "{file}");
            assert!(!told(file, "diffuse: {reflectance: {texture: t}}"), "{file}");
        }
    }

    /// A grid of distances has no u and v, so that what goes by them is the same all over it. Nothing is said of such a material on
    /// a sphere, nor of a grid without bumps.
    #[test]
    fn reliefs_on_a_grid_of_distances_are_told() {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("waves.pgm"), b"P5 2 2 255\n0123").unwrap();
        std::fs::write(
            directory.path().join("grid.vol"),
            vol([2; 3], 1, &[-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0]),
        )
        .unwrap();
        let told = |shape: &str, material: &str| {
            let text = format!(
                "camera: {{origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}}\n\
                 textures: {{t: {{image: {{file: waves.pgm, raw: true}}}}}}\nmaterials:\n  m: {material}\n\
                 shapes: [{shape}]\n"
            );
            let notes = compiled_in(directory.path(), &text).notes;
            notes.iter().any(|note| note.contains("shapes[0].sdf_grid: u and v are 0 all over it"))
        };
        let grid = "sdf_grid: {file: grid.vol, material: m}";
        let bump = "{bump: {height: {texture: t}, material: {diffuse: {}}}}";
        let within = format!("{{blend: {{weight: 0.5, first: {{diffuse: {{}}}}, second: {bump}}}}}");
        for relief in [bump, "{normal_map: {normals: {texture: t}, material: {diffuse: {}}}}", within.as_str()] {
            assert!(told(grid, relief), "{relief}");
            assert!(!told("sphere: {radius: 1, material: m}", relief), "{relief}");
        }
        assert!(!told(grid, "{diffuse: {}}"));
    }

    /// Tables take longer than all else of a small scene: materials with the same coat share them, and so do scenes in a row, such
    /// as the moments of one that moves. What lies under a coat has no part in them; all that is the coat's has.
    #[test]
    fn tables_of_a_coat_are_computed_once() {
        let scene = |shelf: &mut Shelf| {
            let coats = [
                "reflectance: 0.2, roughness: 0.1",
                "reflectance: 0.7, roughness: 0.1, nonlinear: true",
                "roughness: 0.2",
                "roughness: 0.1, ior: 1.4",
                "roughness: 0.1, distribution: beckmann",
                "roughness: 0.1, diffuse_mean: nodes",
                "roughness: 0",
            ];
            let shapes = coats.map(|coat| format!("- sphere: {{radius: 1, material: {{plastic: {{{coat}}}}}}}\n"));
            let camera = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n";
            let text = format!("{camera}shapes:\n{}", shapes.concat());
            compiled_with(Path::new(""), &text, shelf)
        };
        let tables = |scene: &Scene| -> Vec<Arc<Coats>> {
            let of = |object: &Object| match &scene.materials[object.material as usize].kind {
                Kind::Plastic { coat, .. } => coat.tables.clone(),
                _ => panic!("plastic"),
            };
            scene.objects.iter().map(of).collect()
        };
        let mut shelf = Shelf::default();
        let (first, second) = (tables(&scene(&mut shelf)), tables(&scene(&mut shelf)));
        for (i, a) in first.iter().enumerate() {
            for (j, b) in second.iter().enumerate() {
                assert_eq!(Arc::ptr_eq(a, b), i.max(1) == j.max(1), "{i} {j}");
            }
        }
    }
}
