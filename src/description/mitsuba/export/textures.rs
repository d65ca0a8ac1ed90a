//! Textures.

use std::path::Path;

use super::super::super::compound::{NumberOrTexture, Roughness};
use super::super::super::shape::Geometry;
use super::super::super::spectrum::{Spectrum, SpectrumOrTexture};
use super::super::super::texture::{Checkerboard, ImageTexture, Texture, TextureFilter, Wrap};
use super::spectra::Role;
use super::xml::numbers;
use super::{Export, ends_in, joined};

/// What a texture is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Asked {
    Colours,
    Numbers,
}

/// Which way v grows where a texture is used, against where it is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stands {
    Upright,
    OnItsHead,
}

impl<'a> Export<'a> {
    /// A texture of the scene's list.
    pub(super) fn texture(&mut self, name: &str, texture: &Texture) {
        let id = self.id(name, "texture");
        let why = self.texture_shortfall(texture);
        if let Some(why) = why {
            self.instead("texture", &super::field(&["textures", name]), why);
        }
        // It is read back from its own file.
        let is_anew =
            why.is_none() && matches!(texture, Texture::Image(image) if (self.pictures)(&image.file).anew.is_some());
        if is_anew {
            self.restate("texture", &super::field(&["textures", name]));
        }
        self.texture_as(&[("id", &id)], texture, Stands::Upright);
        if why.is_some() || is_anew {
            self.end();
        } else if self.loses_illuminant(name) {
            let written = self.named("textures", name).and_then(|node| node.get("image")?.get("illuminant"));
            let yaml = written.map_or("D65".to_owned(), |node| self.yaml(node));
            self.xml.instruction(&format!("set {}: {yaml}", super::field(&["textures", name, "image", "illuminant"])));
        }
    }

    /// What Mitsuba gets in place of a texture that it cannot express.
    fn texture_shortfall(&self, texture: &Texture) -> Option<&'static str> {
        match texture {
            Texture::Image(image) => {
                match (image.wrap_v.is_some_and(|wrap| wrap != image.wrap), self.spectra(&image.file)) {
                    (true, None) => Some("one way to go on beyond the edges for u and v"),
                    (true, Some(_)) => {
                        Some("one way to go on beyond the edges for u and v, and colours in place of its spectra")
                    }
                    (false, spectra) => spectra,
                }
            }
            Texture::Checkerboard(board) => {
                Export::either_shortfall(&[&board.a, &board.b], "grey squares in place of a spectrum")
            }
            Texture::Volume(volume) => self.volume_shortfall(volume).or_else(|| self.share_shortfall(volume)),
            Texture::MeshAttribute(_) => None,
        }
    }

    /// A texture with these attributes beside its type.
    fn texture_as(&mut self, attributes: &[(&str, &str)], texture: &Texture, stands: Stands) {
        match texture {
            Texture::Image(image) => {
                self.bitmap(attributes, image, image.raw, stands);
                return;
            }
            Texture::Checkerboard(board) => {
                self.open_texture("checkerboard", attributes);
                for (key, colour) in [("color0", &board.a), ("color1", &board.b)] {
                    match colour {
                        // Elsewhere it stands upright.
                        SpectrumOrTexture::Texture(inner) if stands == Stands::OnItsHead => {
                            self.thrown(key, inner, stands);
                        }
                        colour => self.spectrum_or_texture(key, colour, Role::Reflectance),
                    }
                }
                self.board_map(board, stands);
            }
            Texture::Volume(volume) => {
                self.open_texture("volume", attributes);
                self.volume("volume", volume);
            }
            Texture::MeshAttribute(mesh) => {
                self.open_texture("mesh_attribute", attributes);
                self.xml.value("string", "name", &mesh.name);
                self.xml.value("float", "scale", mesh.scale);
            }
        }
        self.xml.close();
    }

    fn open_texture(&mut self, plugin: &str, attributes: &[(&str, &str)]) {
        let all: Vec<(&str, &str)> = [("type", plugin)].iter().chain(attributes).copied().collect();
        self.xml.open("texture", &all);
    }

    /// What Mitsuba gets in place of the spectra of a picture, if it has some.
    pub(super) fn spectra(&self, file: &Path) -> Option<&'static str> {
        let loses_spectra = (self.pictures)(file).anew.as_ref().is_some_and(|anew| anew.loses_spectra);
        loses_spectra.then_some("colours in place of its spectra")
    }

    /// The name of a picture as Mitsuba reads it: its own, or of a new file.
    pub(super) fn picture_file(&mut self, file: &Path) -> String {
        let read = (self.pictures)(file);
        let Some(anew) = &read.anew else { return self.file(file) };
        if let Some(name) = self.images.get(file) {
            return name.clone();
        }
        let name = format!("{}picture{}.{}", self.stem, self.files.len(), anew.extension);
        self.files.push((name.clone(), anew.bytes.clone()));
        self.images.insert(file.to_owned(), name.clone());
        name
    }

    fn bitmap(&mut self, attributes: &[(&str, &str)], image: &ImageTexture, raw: bool, stands: Stands) {
        self.open_texture("bitmap", attributes);
        let file = self.picture_file(&image.file);
        self.xml.value("string", "filename", file);
        let filter = match image.filter {
            TextureFilter::Bilinear => "bilinear",
            TextureFilter::Nearest => "nearest",
        };
        self.xml.value("string", "filter_type", filter);
        let wrap = match image.wrap {
            Wrap::Repeat => "repeat",
            Wrap::Mirror => "mirror",
            Wrap::Clamp => "clamp",
        };
        self.xml.value("string", "wrap_mode", wrap);
        self.xml.value("boolean", "raw", raw);
        // Their pictures begin at the top.
        let [u, [d, e, f]] = turned(affine(image.uv, image.scale, image.offset), stands);
        self.uv_map([u, [-d, -e, 1.0 - f]]);
        self.xml.close();
    }

    /// The picture of this name where Mitsuba refuses it as it is written: of three channels it takes those that are raw for
    /// numbers alone, and no others for them.
    fn refused(&self, texture: &str, asked: Asked) -> Option<&'a ImageTexture> {
        let raw = asked == Asked::Numbers;
        match self.scene.textures.get(texture) {
            Some(Texture::Image(image)) => (image.raw != raw && (self.pictures)(&image.file).coloured).then_some(image),
            _ => None,
        }
    }

    /// A picture as Mitsuba takes it, told where its values are others then.
    fn picture(&mut self, attributes: &[(&str, &str)], texture: &str, image: &ImageTexture) {
        let why = stored_otherwise(image);
        if let Some(why) = why {
            self.instead("texture", &super::field(&["textures", texture]), why);
        }
        self.bitmap(attributes, image, !image.raw, Stands::Upright);
        if why.is_some() {
            self.end();
        }
    }

    /// A texture that is asked for colours.
    pub(super) fn colours_of(&mut self, name: &str, texture: &str) {
        if self.is_curves(texture) {
            let instead = "spectra that have its three numbers for coefficients: Mitsuba takes those of a name with \"color\" in it \
                           for colours";
            self.lose(&super::field(&["textures", texture]), instead);
        }
        match self.refused(texture, Asked::Colours) {
            Some(image) => self.picture(&[("name", name)], texture, image),
            None => self.texture_ref(&[("name", name)], texture),
        }
    }

    /// Whether Mitsuba takes three numbers of a mesh for something else than a colour.
    fn is_curves(&self, texture: &str) -> bool {
        match self.scene.textures.get(texture) {
            Some(Texture::MeshAttribute(written)) => {
                !written.name.contains("color") && self.mean_of_three(&written.name).is_some()
            }
            _ => false,
        }
    }

    /// The mean of an attribute as one number, where a mesh has three of its name.
    fn mean_of_three(&self, attribute: &str) -> Option<f64> {
        let mut shapes = self.scene.shapes.iter().chain(self.scene.groups.values().flatten());
        shapes.find_map(|shape| match &shape.geometry {
            Geometry::Mesh(mesh) => (self.mean_of_three)(&mesh.file, mesh.index, attribute),
            _ => None,
        })
    }

    fn texture_ref(&mut self, attributes: &[(&str, &str)], texture: &str) {
        let id = self.id(texture, "texture");
        let all: Vec<(&str, &str)> = attributes.iter().copied().chain([("id", id.as_str())]).collect();
        self.xml.leaf("ref", &all);
    }

    fn board_map(&mut self, board: &Checkerboard, stands: Stands) {
        self.uv_map(turned(affine(board.uv, board.scale, [0.0; 2]), stands));
    }

    /// A texture that is asked for numbers. Mitsuba's checkerboard then has its colours the other way round.
    pub(super) fn numbers_of(&mut self, name: Option<&str>, texture: &str) {
        // Without a name where the plugin takes any texture for what it needs.
        let attributes: Vec<(&str, &str)> = name.map(|name| ("name", name)).into_iter().collect();
        let board = match self.scene.textures.get(texture) {
            Some(Texture::Checkerboard(board)) => board,
            Some(Texture::MeshAttribute(written)) => {
                return match (name, self.mean_of_three(&written.name)) {
                    (Some(name), Some(mean)) => self.even_number(name, texture, mean * written.scale),
                    _ => self.texture_ref(&attributes, texture),
                };
            }
            _ => {
                return match self.refused(texture, Asked::Numbers) {
                    Some(image) => self.picture(&attributes, texture, image),
                    None => self.texture_ref(&attributes, texture),
                };
            }
        };
        self.open_texture("checkerboard", &attributes);
        for (key, colour) in [("color0", &board.b), ("color1", &board.a)] {
            match colour {
                SpectrumOrTexture::Spectrum(Spectrum::Number(x)) => self.xml.value("float", key, x),
                SpectrumOrTexture::Spectrum(spectrum) => self.spectrum(key, spectrum, Role::Reflectance),
                SpectrumOrTexture::Texture(inner) => self.numbers_of(Some(key), inner),
            }
        }
        self.board_map(board, Stands::Upright);
        self.xml.close();
    }

    /// One number in place of the three of a mesh.
    fn even_number(&mut self, name: &str, texture: &str, mean: f64) {
        let instead = format!("{mean:.4} everywhere: Mitsuba takes no three numbers of a mesh for one");
        self.instead("texture", &super::field(&["textures", texture]), instead);
        self.xml.value("float", name, mean);
        self.end();
    }

    /// A texture that shines or that a light throws; the light tells what is lost. Their v grows downward in slides.
    pub(super) fn thrown(&mut self, name: &str, texture: &str, stands: Stands) {
        let attributes = [("name", name)];
        match (self.refused(texture, Asked::Colours), self.scene.textures.get(texture), stands) {
            (Some(image), ..) => self.bitmap(&attributes, image, false, stands),
            (None, Some(written), Stands::OnItsHead) => self.texture_as(&attributes, written, stands),
            _ => self.texture_ref(&attributes, texture),
        }
    }

    /// What Mitsuba gets in place of the pictures that shine, in `texture` or in its squares. What is not referred to, but written
    /// again, lacks what the texture lacks.
    pub(super) fn pictures_shortfall(&self, texture: &str, stands: Stands) -> Option<String> {
        let written = self.scene.textures.get(texture)?;
        let refused = self.refused(texture, Asked::Colours);
        let again = refused.is_some() || stands == Stands::OnItsHead;
        let own = again.then(|| self.texture_shortfall(written)).flatten();
        let own = joined([own, refused.and_then(stored_otherwise)].map(|why| why.map(str::to_owned)));
        let mut inner = written.inner().into_iter();
        own.or_else(|| inner.find_map(|texture| self.pictures_shortfall(texture, stands)))
    }

    /// Whether Mitsuba finds slopes in it.
    pub(super) fn has_slopes(&self, texture: &str) -> bool {
        matches!(self.scene.textures.get(texture), None | Some(Texture::Image(_)))
    }

    /// Whether Mitsuba finds normals in it, of which grey ones have one number where three are wanted.
    pub(super) fn has_normals(&self, texture: &str) -> bool {
        match self.scene.textures.get(texture) {
            Some(Texture::Image(image)) => (self.pictures)(&image.file).coloured,
            Some(_) => false,
            None => true,
        }
    }

    /// Whether Mitsuba refuses to take the mean of it.
    pub(super) fn lacks_mean(&self, colour: &SpectrumOrTexture) -> bool {
        colour.name().is_some_and(|name| self.has_no_mean(name))
    }

    fn has_no_mean(&self, texture: &str) -> bool {
        match self.scene.textures.get(texture) {
            Some(Texture::Volume(_) | Texture::MeshAttribute(_)) => true,
            Some(written) => written.inner().into_iter().any(|inner| self.has_no_mean(inner)),
            None => false,
        }
    }

    /// Whether it has numbers of a mesh in it.
    pub(super) fn has_attribute(&self, texture: &str) -> bool {
        match self.scene.textures.get(texture) {
            Some(Texture::MeshAttribute(_)) => true,
            Some(written) => written.inner().into_iter().any(|inner| self.has_attribute(inner)),
            None => false,
        }
    }

    /// Whether what it shows depends on how u and v run.
    pub(super) fn texture_follows_uv(&self, name: &str) -> bool {
        match self.scene.textures.get(name) {
            Some(Texture::Image(_) | Texture::Checkerboard(_)) => true,
            Some(Texture::Volume(_) | Texture::MeshAttribute(_)) | None => false,
        }
    }

    /// The same of a roughness.
    pub(super) fn roughness_follows_uv(&self, roughness: &Roughness) -> bool {
        match roughness {
            Roughness::Number(_) => false,
            Roughness::Texture(name) => self.texture_follows_uv(name),
            Roughness::Brushed(brushed) => match (&brushed.u, &brushed.v) {
                (NumberOrTexture::Number(u), NumberOrTexture::Number(v)) => u != v,
                _ => true,
            },
        }
    }

    fn uv_map(&mut self, [[a, b, c], [d, e, f]]: [[f64; 3]; 2]) {
        let rows = [a, b, 0.0, c, d, e, 0.0, f, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        self.xml.open("transform", &[("name", "to_uv")]);
        self.xml.leaf("matrix", &[("value", &numbers(&rows))]);
        self.xml.close();
    }
}

/// Whether the values of a picture depend on `raw`, and what they are with it the other way.
fn stored_otherwise(image: &ImageTexture) -> Option<&'static str> {
    match (["exr", "hdr", "pfm"].iter().any(|ending| ends_in(&image.file, ending)), image.raw) {
        (true, _) => None,
        (false, true) => Some("its colours by the curve of sRGB: Mitsuba takes raw ones for numbers alone"),
        (false, false) => Some("its numbers as they are stored: Mitsuba takes them from raw pictures alone"),
    }
}

/// The map after v ↦ 1 − v.
fn turned([[a, b, c], [d, e, f]]: [[f64; 3]; 2], stands: Stands) -> [[f64; 3]; 2] {
    match stands {
        Stands::Upright => [[a, b, c], [d, e, f]],
        Stands::OnItsHead => [[a, -b, b + c], [d, -e, e + f]],
    }
}

/// u, v to the picture's: the map, then the scale, then the offset.
fn affine(uv: Option<[[f64; 3]; 2]>, scale: [f64; 2], offset: [f64; 2]) -> [[f64; 3]; 2] {
    let [u, v] = uv.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let row = |row: [f64; 3], scale: f64, offset: f64| [row[0] * scale, row[1] * scale, row[2] * scale + offset];
    [row(u, scale[0], offset[0]), row(v, scale[1], offset[1])]
}
