//! What an OpenEXR file is: from its header, and from its pixels where they can be read.

use crate::batch::part_file::Header as PartHeader;
use crate::error::{Error, Result};
use crate::film::Window;
use crate::film::exr::header::{Header, Headers, Value, read_headers};
use crate::film::exr::read_exr;
use crate::film::facts::Facts;
use crate::spectrum::ColourSpace;
use glam::{DMat4, DVec3};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A file.
#[derive(Debug, Serialize)]
pub struct ExrFacts {
    /// The frame, the display window.
    pub frame: Window,
    /// What a part or checkpoint of Abbe holds so far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part_of_picture: Option<PartOfPicture>,
    /// Whether the pixels are those that Abbe wrote; none where it did not say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub as_written: Option<bool>,
    /// Why pixels are not told of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unread: Option<String>,
    /// The parts of the file.
    pub parts: Vec<PartFacts>,
}

/// A part or a checkpoint of a picture of Abbe.
#[derive(Debug, Serialize)]
pub struct PartOfPicture {
    /// The scene.
    pub scene: String,
    /// The scene's file.
    pub source: String,
    /// Which tile of how many.
    pub tile: [u32; 2],
    /// The first and the last sample.
    pub samples: [u32; 2],
    /// Whether it has all that it is to have; a checkpoint has not.
    pub whole: bool,
    /// How much of its samples it has, 0 to 1; nobody knows where an error or a time ends the render.
    pub done: Option<f64>,
    /// How many samples a pixel has in the mean.
    pub reached: f64,
    /// Of rendering.
    pub seconds: f64,
}

/// A part of a file.
#[derive(Debug, Serialize)]
pub struct PartFacts {
    /// Its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// `scanlineimage`, `tiledimage`, `deepscanline`, `deeptile`.
    #[serde(rename = "type")]
    pub kind: String,
    /// The data window.
    pub window: Window,
    /// By name.
    pub compression: String,
    /// What the colours are.
    pub colours: Option<String>,
    /// Where the camera stands and what it sees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraFacts>,
    /// Channels by layer; the first is the picture itself.
    pub layers: Vec<LayerFacts>,
    /// All attributes.
    pub attributes: BTreeMap<String, Value>,
}

/// Channels of a layer.
#[derive(Debug, Serialize)]
pub struct LayerFacts {
    /// What stands before the last point of the channels' names; empty for the picture itself.
    pub layer: String,
    /// Its channels.
    pub channels: Vec<ChannelFacts>,
}

/// A channel.
#[derive(Debug, Serialize)]
pub struct ChannelFacts {
    /// What stands after the last point.
    pub name: String,
    /// `half`, `float`, `uint`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Pixels in x and y for a sample.
    #[serde(skip_serializing_if = "is_full")]
    pub sampling: [i32; 2],
    /// Of its samples, where they were read.
    #[serde(flatten)]
    pub facts: Option<Facts>,
}

fn is_full(sampling: &[i32; 2]) -> bool {
    *sampling == [1, 1]
}

/// A camera by its matrices.
#[derive(Debug, Serialize)]
pub struct CameraFacts {
    /// Metres.
    pub position: [f64; 3],
    /// Of length 1.
    pub direction: [f64; 3],
    /// Across and down, degrees; none for parallel rays.
    pub fov_deg: Option<[f64; 2]>,
}

/// Reads `path`.
pub fn of(path: &Path) -> Result<ExrFacts> {
    let headers = read_headers(path)?;
    let part_of_picture = headers.parts[0].text("abbe/part").map(|json| part(path, json)).transpose()?;
    let unread = match (&part_of_picture, headers.parts.iter().find_map(Header::unreadable)) {
        (Some(_), _) => Some("exact sums, for abbe merge and --resume".to_owned()),
        (None, why) => why,
    };
    let file = if unread.is_none() { Some(read_exr(path)?) } else { None };
    let as_written = file.as_ref().and_then(|file| {
        let written = file.parts[0].text("abbe/contentHash")?;
        Some(written == file.content_hash())
    });
    let Headers { parts, .. } = headers;
    let frame = parts[0].window("displayWindow").unwrap_or(Window::full(0, 0));
    let describe = |(i, header): (usize, Header)| {
        let pixels = file.as_ref().and_then(|file| file.parts.get(i));
        let mut layers: Vec<LayerFacts> = Vec::new();
        for channel in header.channels() {
            let (layer, name) = channel.name.rsplit_once('.').unwrap_or(("", &channel.name));
            let facts = ChannelFacts {
                name: name.to_owned(),
                kind: channel.kind,
                sampling: channel.sampling,
                facts: pixels.and_then(|part| part.samples(&channel.name)).map(|samples| Facts::of(samples.iter())),
            };
            match layers.iter_mut().find(|known| known.layer == layer) {
                Some(known) => known.channels.push(facts),
                None => layers.push(LayerFacts { layer: layer.to_owned(), channels: vec![facts] }),
            }
        }
        // The picture first, and its channels as one says them.
        layers.sort_by_key(|known| !known.layer.is_empty());
        for known in &mut layers {
            known.channels.sort_by_key(|channel| "RGBAXYZUV".find(&channel.name).unwrap_or(9));
        }
        PartFacts {
            name: header.text("name").map(str::to_owned),
            kind: header.kind().to_owned(),
            window: header.window("dataWindow").unwrap_or(frame),
            compression: header.compression(),
            colours: colours(&header),
            camera: camera(&header),
            layers,
            attributes: header.attributes.into_iter().map(|(name, _, value)| (name, value)).collect(),
        }
    };
    let parts = parts.into_iter().enumerate().map(describe).collect();
    Ok(ExrFacts { frame, part_of_picture, as_written, unread, parts })
}

fn part(path: &Path, json: &str) -> Result<PartOfPicture> {
    let unsound = |e: &str| Error::input(path, format!("a part of another version of Abbe, or damaged: {e}"));
    let header: PartHeader = serde_json::from_str(json).map_err(|e| unsound(&e.to_string()))?;
    if !header.is_sound() {
        return Err(unsound("its header does not hold together"));
    }
    let share = header.share();
    let pixels = share.rows(header.finish.window).pixels() as f64;
    let rendered: f64 = header.claims.camera.iter().map(|(w, samples)| w.pixels() as f64 * samples.len() as f64).sum();
    Ok(PartOfPicture {
        whole: header.is_whole(),
        done: header.finish.target.is_none().then(|| rendered / (pixels * share.samples.len() as f64)),
        reached: rendered / pixels,
        tile: header.tile,
        samples: [header.samples[0], header.samples[1].saturating_sub(1)],
        seconds: header.seconds,
        source: header.source.display().to_string(),
        scene: header.finish.name,
    })
}

/// What the numbers of the picture mean, in words.
fn colours(header: &Header) -> Option<String> {
    const KNOWN: [(&str, &str); 7] = [
        ("lin_rec709_scene", "linear Rec. 709"),
        ("lin_ap1_scene", "ACEScg (AP1)"),
        ("lin_ap0_scene", "ACES2065-1 (AP0)"),
        ("lin_rec2020_scene", "linear Rec. 2020"),
        ("lin_p3d65_scene", "linear P3-D65"),
        ("lin_ciexyzd65_scene", "CIE XYZ relative to D65"),
        ("data", "data, no colours"),
    ];
    const PRIMARIES: [(&str, ColourSpace); 5] = [
        ("Rec. 709 primaries", ColourSpace::Rec709),
        ("ACEScg (AP1) primaries", ColourSpace::AcesCg),
        ("ACES2065-1 (AP0) primaries", ColourSpace::Aces2065_1),
        ("Rec. 2020 primaries", ColourSpace::Rec2020),
        ("P3 primaries", ColourSpace::P3D65),
    ];
    let named = header.text("colorInteropID").map(|id| {
        let words = KNOWN.iter().find(|(known, _)| *known == id).map(|(_, words)| *words);
        words.map_or_else(|| id.to_owned(), |words| format!("{words} ({id})"))
    });
    let primaries = header.numbers::<8>("chromaticities").map(|c| {
        // Whatever their white.
        let like = |space: ColourSpace| {
            space.chromaticities()[..3].iter().flatten().zip(&c).all(|(a, b)| (a - b).abs() < 5e-4)
        };
        let name = PRIMARIES.iter().find(|(_, space)| like(*space)).map(|(name, _)| (*name).to_owned());
        let name =
            name.unwrap_or_else(|| format!("primaries ({}, {}) ({}, {}) ({}, {})", c[0], c[1], c[2], c[3], c[4], c[5]));
        format!("{name}, white ({:.4}, {:.4})", c[6], c[7])
    });
    named.or(primaries)
}

/// From `worldToCamera` and `worldToNDC`, matrices for row vectors; the camera looks along +z.
fn camera(header: &Header) -> Option<CameraFacts> {
    // The transposes are matrices for column vectors.
    let camera_from_world = DMat4::from_cols_array(&header.numbers("worldToCamera")?);
    let world_from_camera = camera_from_world.inverse();
    let finite = |v: DVec3| v.is_finite().then(|| v.to_array());
    let position = finite(world_from_camera.project_point3(DVec3::ZERO))?;
    let direction = finite(world_from_camera.transform_vector3(DVec3::Z).normalize())?;
    let fov = header.numbers("worldToNDC").and_then(|ndc| {
        let [x, y, _, w] = {
            let ndc_from_camera = DMat4::from_cols_array(&ndc) * world_from_camera;
            [0, 1, 2, 3].map(|i| ndc_from_camera.row(i))
        };
        // With z ahead, x/z of a direction lies at (x.x x/z + x.z) / w.z in the frame: 0 and 1 are its edges.
        let angle = |slope: f64, middle: f64| {
            let edge = |at: f64| ((at * w.z - middle) / slope).atan();
            (edge(1.0) - edge(0.0)).abs().to_degrees()
        };
        let fov = [angle(x.x, x.z), angle(y.y, y.z)];
        // Matrices are single floats: what is 0 in a perspective is 2⁻²⁴ of the rest, of some ten products.
        let perspective = w.z.abs() > 1e-3 * w.w.abs();
        (perspective && fov.iter().all(|angle| *angle > 0.0)).then_some(fov)
    });
    Some(CameraFacts { position, direction, fov_deg: fov })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::exr::{ChannelData, Compression, ExrImage, Layout, write_exr};

    /// Between 2³¹ and 2³² floats of 32 bits are 256 apart.
    #[test]
    fn whole_numbers_are_told_to_the_last_digit() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let image = ExrImage {
            frame: [2, 1],
            window: Window::full(2, 1),
            channels: vec![("id".into(), ChannelData::U32(vec![4_291_595_995, 3]))],
            colour: None,
            attributes: Vec::new(),
            data: std::collections::BTreeSet::new(),
            compression: Compression::None,
            layout: Layout::Single,
        };
        write_exr(&path, &image).unwrap();
        let facts = of(&path).unwrap().parts[0].layers[0].channels[0].facts.unwrap();
        assert_eq!((facts.min, facts.mean, facts.max), (Some(3.0), Some(2_145_797_999.0), Some(4_291_595_995.0)));
    }
}
