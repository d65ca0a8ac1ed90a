//! Textures.

use super::super::super::compound::{NumberOrTexture, Roughness};
use super::super::super::spectrum::{Spectrum, SpectrumOrTexture};
use super::super::super::texture::{Checkerboard, ImageTexture, Texture, TextureFilter, Wrap};
use super::Export;
use super::spectra::Role;
use super::xml::numbers;

/// Which way v grows where a texture is used, against where it is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stands {
    Upright,
    OnItsHead,
}

impl Export<'_> {
    /// A texture of the scene's list.
    pub(super) fn texture(&mut self, name: &str, texture: &Texture) {
        let id = self.id(name, "texture");
        let why = match texture {
            Texture::Image(image) => (image.wrap_v.is_some_and(|wrap| wrap != image.wrap))
                .then_some("one way to go on beyond the edges for u and v"),
            Texture::Checkerboard(board) => (!(Export::can_say_either(&board.a) && Export::can_say_either(&board.b)))
                .then_some("grey squares in place of a spectrum"),
            Texture::Volume(volume) => (!self.can_say_volume(volume)).then_some("grey in place of a spectrum"),
            Texture::MeshAttribute(_) => None,
        };
        if let Some(why) = why {
            self.instead("texture", &super::field(&["textures", name]), why);
        }
        self.texture_as(("id", &id), texture, Stands::Upright);
        if why.is_some() {
            self.end();
        }
    }

    /// A texture with one attribute beside its type.
    fn texture_as(&mut self, attribute: (&str, &str), texture: &Texture, stands: Stands) {
        match texture {
            Texture::Image(image) => self.bitmap(attribute, image, stands),
            Texture::Checkerboard(board) => {
                self.xml.open("texture", &[("type", "checkerboard"), attribute]);
                self.spectrum_or_texture("color0", &board.a, Role::Reflectance);
                self.spectrum_or_texture("color1", &board.b, Role::Reflectance);
                self.board_map(board, stands);
            }
            Texture::Volume(volume) => {
                self.xml.open("texture", &[("type", "volume"), attribute]);
                self.volume("volume", volume);
            }
            Texture::MeshAttribute(mesh) => {
                self.xml.open("texture", &[("type", "mesh_attribute"), attribute]);
                self.xml.value("string", "name", &mesh.name);
                self.xml.value("float", "scale", mesh.scale);
            }
        }
        self.xml.close();
    }

    fn bitmap(&mut self, attribute: (&str, &str), image: &ImageTexture, stands: Stands) {
        self.xml.open("texture", &[("type", "bitmap"), attribute]);
        let file = self.file(&image.file);
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
        self.xml.value("boolean", "raw", image.raw);
        // Their pictures begin at the top.
        let [u, [d, e, f]] = turned(affine(image.uv, image.scale, image.offset), stands);
        self.uv_map([u, [-d, -e, 1.0 - f]]);
    }

    fn board_map(&mut self, board: &Checkerboard, stands: Stands) {
        self.uv_map(turned(affine(board.uv, board.scale, [0.0; 2]), stands));
    }

    /// A texture that is asked for numbers. Mitsuba's checkerboard then has its colours the other way round.
    pub(super) fn numbers_of(&mut self, name: Option<&str>, texture: &str) {
        let Some(Texture::Checkerboard(board)) = self.scene.textures.get(texture) else {
            let id = self.id(texture, "texture");
            let named = name.map(|name| ("name", name));
            let attributes: Vec<(&str, &str)> = named.into_iter().chain([("id", id.as_str())]).collect();
            self.xml.leaf("ref", &attributes);
            return;
        };
        // Without a name where the plugin takes any texture for what it needs.
        let named = name.map(|name| ("name", name));
        let attributes: Vec<(&str, &str)> = [("type", "checkerboard")].into_iter().chain(named).collect();
        self.xml.open("texture", &attributes);
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

    /// A texture that a light throws. Their v grows downward there.
    pub(super) fn thrown(&mut self, name: &str, texture: &str, stands: Stands) {
        match (self.scene.textures.get(texture), stands) {
            (Some(written), Stands::OnItsHead) => self.texture_as(("name", name), written, stands),
            _ => self.texture_ref(name, texture),
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
