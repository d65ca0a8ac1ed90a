//! The contact sheet of a batch: a picture of all its pictures, and a page to look at them, side by side, with their errors,
//! plans and costs.
//!
//! A batch has any number of pictures, and what is kept of each is bounded: thumbnails have a side of 256 pixels up to 64
//! pictures, and half of it each time the number has grown fourfold, down to 32. The page holds thumbnails and error maps of
//! up to 64 pictures in itself; of more it shows the PNG files beside it.

mod page;

use super::report::{Report, SceneReport, Status};
use crate::error::{Error, Result};
use crate::film::heat::{Small, blocks};
use crate::film::output::{Inputs, directory_of, write_atomically, write_pieces};
use crate::film::png::inspect;
use crate::spectrum::ColourSpace;
use crate::spectrum::colour::{srgb_encode, srgb8_table};
use font8x8::UnicodeFonts;
use image::ImageEncoder;
use page::Figures;
use std::path::{Path, PathBuf};

/// The largest side of a thumbnail and of an error map.
pub const SIDE: usize = 256;
/// The smallest that is made of it.
const LEAST_SIDE: usize = 32;
/// Pictures that the page holds in itself.
pub const EMBEDDED: usize = 64;

/// What the sheet says of a picture, besides its report.
struct Card {
    /// Which scene of the report.
    scene: usize,
    exr: PathBuf,
    png: PathBuf,
    thumbnail: Small,
    error_map: Option<Small>,
}

/// Gathers what a sheet needs while a batch is rendered.
pub struct Contact {
    cards: Vec<Card>,
    side: usize,
}

impl Default for Contact {
    fn default() -> Contact {
        Contact { cards: Vec::new(), side: SIDE }
    }
}

impl Contact {
    /// Takes up the picture of `report`, the `scene`-th of the batch, if it is there.
    pub fn add(&mut self, scene: usize, report: &mut SceneReport) {
        let error_map = report.error_map.take();
        let is_there = !matches!(report.status, Status::Failed { .. }) || report.is_written_with_a_fault();
        let Some(exr) = report.files.first().filter(|_| is_there) else { return };
        let png = exr.with_extension("png");
        // A picture that someone has taken away meanwhile is not on the sheet.
        let Some(thumbnail) = thumbnail(&png, self.side) else { return };
        self.cards.push(Card { scene, exr: exr.clone(), png, thumbnail, error_map });
        let most = EMBEDDED * (SIDE / self.side) * (SIDE / self.side);
        if self.cards.len() > most && self.side > LEAST_SIDE {
            self.side /= 2;
            for card in &mut self.cards {
                card.thumbnail = shrink(&card.thumbnail, self.side);
                card.error_map = None;
            }
        }
        if self.cards.len() > EMBEDDED
            && let Some(card) = self.cards.last_mut()
        {
            card.error_map = None;
        }
    }

    /// Writes the picture and the page of these names, where there are two pictures or more; gives the page. None of what was
    /// `read` is overwritten.
    ///
    /// # Errors
    /// [`Error::Output`]; [`Error::Config`] for a file that was read.
    pub fn write(&self, [png, html]: &[PathBuf; 2], read: &Inputs, report: &Report) -> Result<Option<PathBuf>> {
        if self.cards.len() < 2 {
            return Ok(None);
        }
        read.spare([png, html])?;
        let sheet = encode(&self.sheet(report)).map_err(|e| Error::output(png, e))?;
        write_atomically(png, &sheet)?;
        write_pieces(html, |out| page::write(out, &self.cards, directory_of(html), report))?;
        Ok(Some(html.clone()))
    }

    /// All thumbnails in rows, with name and figures below where there is room.
    fn sheet(&self, report: &Report) -> Small {
        const GAP: usize = 8;
        const BACKGROUND: u8 = 24;
        const LINE: usize = 11;
        let n = self.cards.len();
        let labelled = self.side >= 128;
        let widest = self.cards.iter().map(|card| card.thumbnail.width).max().unwrap_or(1);
        let tallest = self.cards.iter().map(|card| card.thumbnail.height).max().unwrap_or(1);
        // A name may be wider than a narrow picture.
        let cell = [
            widest.max(if labelled { self.side * 3 / 4 } else { 1 }),
            tallest + if labelled { 2 * LINE + 2 } else { 0 },
        ];
        // About four to three.
        let columns = ((n * (cell[1] + GAP) * 4) as f64 / (3 * (cell[0] + GAP)) as f64).sqrt().ceil().max(1.0) as usize;
        let columns = columns.min(n);
        let rows = n.div_ceil(columns);
        let width = GAP + columns * (cell[0] + GAP);
        let height = GAP + rows * (cell[1] + GAP);
        let mut out = Small { width, height, rgb: vec![BACKGROUND; 3 * width * height] };
        for (i, card) in self.cards.iter().enumerate() {
            let (x, y) = (GAP + i % columns * (cell[0] + GAP), GAP + i / columns * (cell[1] + GAP));
            let small = &card.thumbnail;
            let left = x + (cell[0] - small.width) / 2;
            let top = y + (tallest - small.height) / 2;
            for (row, line) in small.rgb.chunks_exact(3 * small.width).enumerate() {
                let start = 3 * ((top + row) * width + left);
                out.rgb[start..start + line.len()].copy_from_slice(line);
            }
            if labelled {
                let facts = Figures::of(&report.scenes[card.scene]);
                write_text(&mut out, [x, y + tallest + 4], cell[0], &report.scenes[card.scene].label(), 225);
                write_text(&mut out, [x, y + tallest + 4 + LINE], cell[0], &facts.short(), 150);
            }
        }
        out
    }
}

/// Text in 8 × 8 letters, cut where `width` pixels end.
fn write_text(out: &mut Small, at: [usize; 2], width: usize, text: &str, grey: u8) {
    let letters = text.chars().count();
    let room = width / 8;
    let cut = letters > room;
    for (i, c) in text
        .chars()
        .take(if cut { room.saturating_sub(2) } else { room })
        .chain("..".chars().filter(|_| cut))
        .enumerate()
    {
        let glyph = font8x8::BASIC_FONTS
            .get(c)
            .or_else(|| font8x8::LATIN_FONTS.get(c))
            .or_else(|| font8x8::BASIC_FONTS.get('?'));
        for (row, bits) in glyph.unwrap_or_default().into_iter().enumerate() {
            for column in (0..8).filter(|column| bits >> column & 1 == 1) {
                let start = 3 * ((at[1] + row) * out.width + at[0] + 8 * i + column);
                out.rgb[start..start + 3].fill(grey);
            }
        }
    }
}

/// The PNG at `path`, each pixel of the thumbnail the mean light of a block; `None` where there is none that can be read.
fn thumbnail(path: &Path, side: usize) -> Option<Small> {
    let facts = inspect::inspect(path).ok()?;
    let mut reader = image::ImageReader::open(path).ok()?;
    // It is whole, whatever its size.
    reader.no_limits();
    let image = reader.decode().ok()?.into_rgb8();
    let (width, height) = (image.width() as usize, image.height() as usize);
    let wide = facts.colours.starts_with("Display P3");
    Some(average(width, height, image.as_raw(), side, wide))
}

fn shrink(small: &Small, side: usize) -> Small {
    average(small.width, small.height, &small.rgb, side, false)
}

fn average(width: usize, height: usize, rgb: &[u8], side: usize, wide: bool) -> Small {
    let linear = srgb8_table();
    let (step, [columns, rows]) = blocks(width, height, side);
    let mut small = Small { width: columns, height: rows, rgb: Vec::with_capacity(3 * columns * rows) };
    for row in 0..rows {
        for column in 0..columns {
            let (mut sum, mut count) = ([0.0f32; 3], 0.0f32);
            for y in row * step..((row + 1) * step).min(height) {
                for x in column * step..((column + 1) * step).min(width) {
                    let start = 3 * (y * width + x);
                    sum = [0, 1, 2].map(|c| sum[c] + linear[usize::from(rgb[start + c])]);
                    count += 1.0;
                }
            }
            let mut light = sum.map(|v| v / count);
            if wide {
                light = ColourSpace::Rec709.from_xyz(ColourSpace::P3D65.to_xyz(light));
            }
            small.rgb.extend(light.map(|v| (255.0 * srgb_encode(v.clamp(0.0, 1.0))).round() as u8));
        }
    }
    small
}

/// As a PNG file.
fn encode(small: &Small) -> std::result::Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(&small.rgb, small.width as u32, small.height as u32, image::ExtendedColorType::Rgb8)
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

/// The way from `dir` to `file`, as a link has it.
fn link(dir: &Path, file: &Path) -> String {
    let inside = file.strip_prefix(dir).ok().map(Path::to_path_buf);
    let beside = || (directory_of(file) == dir).then(|| file.file_name().map(PathBuf::from)).flatten();
    let path = inside.or_else(beside);
    let (path, start) = match path {
        Some(path) => (path, ""),
        None => (std::path::absolute(file).unwrap_or_else(|_| file.to_path_buf()), "file://"),
    };
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~/".contains(&b);
    let text = path.to_string_lossy().replace('\\', "/");
    let coded: String =
        text.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect();
    format!("{start}{coded}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_relative_and_coded() {
        assert_eq!(link(Path::new("out/b"), Path::new("out/b/a #1.png")), "a%20%231.png");
        assert_eq!(link(Path::new("."), Path::new("a.png")), "a.png");
        assert_eq!(link(Path::new("/x"), Path::new("/y/é.png")), "file:///y/%C3%A9.png");
    }

    /// Black and white pixels in turn: half the light, which is 188 of 255.
    #[test]
    fn a_thumbnail_keeps_the_light() {
        let rgb: Vec<u8> = (0..16u8).flat_map(|i| [if i % 2 == 0 { 0 } else { 255 }; 3]).collect();
        let small = average(4, 4, &rgb, 2, false);
        assert_eq!((small.width, small.height), (2, 2));
        assert!(small.rgb.iter().all(|v| *v == 188), "{:?}", small.rgb);
    }

    /// Memory stays bounded: 300 pictures have thumbnails of 64 pixels a side.
    #[test]
    fn more_pictures_have_smaller_thumbnails() {
        let dir = tempfile::tempdir().unwrap();
        let exr = dir.path().join("a.exr");
        let small = Small { width: 300, height: 200, rgb: vec![90; 3 * 300 * 200] };
        std::fs::write(exr.with_extension("png"), encode(&small).unwrap()).unwrap();
        let mut contact = Contact::default();
        let mut scenes = Vec::new();
        for i in 0..300 {
            let mut report = SceneReport::new("a", None);
            report.files = vec![exr.clone()];
            contact.add(i, &mut report);
            scenes.push(report);
        }
        let report = Report::new(Path::new("batch.yaml"), scenes, std::time::Duration::from_secs(1));
        let names = ["png", "html"].map(|ending| dir.path().join("sheet").with_extension(ending));
        let page = contact.write(&names, &Inputs::default(), &report).unwrap().unwrap();
        assert_eq!(contact.side, 64);
        assert!(contact.cards.iter().all(|card| card.thumbnail.width <= 64));
        let sheet = image::open(page.with_extension("png")).unwrap();
        assert!(sheet.width() < 1600 && sheet.height() < 1600, "{} {}", sheet.width(), sheet.height());
        let text = std::fs::read_to_string(page).unwrap();
        assert_eq!(text.matches("<figure").count(), 300);
        assert!(!text.contains("data:image") && text.len() < 1_000_000, "{}", text.len());
    }
}
