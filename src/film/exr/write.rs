//! Writes the header, the table of chunks and the chunks.

use super::pack::{self, Channel};
use super::{Attribute, ChannelData, ColourEncoding, Compression, ExrImage, Layout, TimeCode};
use crate::error::{Error, Result};
use crate::film::output::write_atomically;
use crate::film::{Window, cryptomatte};
use crate::spectrum::ColourSpace;
use std::path::Path;

/// Writes `image` to `path`: the same picture gives the same bytes, and the file is whole or not there.
///
/// # Errors
/// [`Error::Output`]: what in the picture cannot be written, or what is wrong with the place.
pub fn write_exr(path: &Path, image: &ExrImage) -> Result<()> {
    let bytes = encode_exr(image).map_err(|message| Error::output(path, message))?;
    write_atomically(path, &bytes)
}

/// The bytes of the file.
///
/// Rows are packed on the current rayon pool, and the packed rows are held in memory (they are less than
/// the picture) because the table of their places stands before them.
///
/// # Errors
/// What in the picture cannot be written.
pub fn encode_exr(image: &ExrImage) -> std::result::Result<Vec<u8>, String> {
    let parts = parts_of(image, sorted_channels(image)?);
    let several = image.layout == Layout::Multipart;
    let chunks = |part: &Part| pack::chunks(image, &part.channels, part_compression(image, part));
    let chunks = parts.iter().map(chunks).collect::<std::result::Result<Vec<_>, String>>()?;

    let mut file = vec![0x76, 0x2f, 0x31, 0x01];
    file.extend_from_slice(&[0; 4]);
    let mut long = false;
    for (part, chunks) in parts.iter().zip(&chunks) {
        let (bytes, long_names) = header_bytes(image, part, several.then_some(chunks.len()))?;
        long |= long_names;
        file.extend_from_slice(&bytes);
    }
    // Version 2, names of more than 31 bytes, several parts.
    let version = 2u32 | u32::from(long) << 10 | u32::from(several) << 12;
    file[4..8].copy_from_slice(&version.to_le_bytes());
    if several {
        // An empty header ends the list.
        file.push(0);
    }
    let own = if several { 4 } else { 0 };
    let all = chunks.iter().flatten();
    let mut place = (file.len() + 8 * all.clone().count()) as u64;
    for chunk in all {
        file.extend_from_slice(&place.to_le_bytes());
        place += (chunk.len() + own) as u64;
    }
    for (number, chunks) in chunks.iter().enumerate() {
        for chunk in chunks {
            if several {
                file.extend_from_slice(&(number as i32).to_le_bytes());
            }
            file.extend_from_slice(chunk);
        }
    }
    Ok(file)
}

/// A part of a file.
struct Part<'a> {
    /// Where there are several.
    name: Option<String>,
    channels: Vec<Channel<'a>>,
    /// Whether it holds light.
    light: bool,
    /// Whether it is the one with the attributes of the picture.
    first: bool,
}

/// The parts of `image`: all `channels` together, or one part for each layer, that of the picture itself first.
fn parts_of<'a>(image: &ExrImage, channels: Vec<Channel<'a>>) -> Vec<Part<'a>> {
    let is_light = |name: &str| image.colour.is_some() && !image.data.contains(name);
    if image.layout == Layout::Single {
        let light = channels.iter().any(|(name, _)| is_light(name));
        return vec![Part { name: None, channels, light, first: true }];
    }
    // "rgba" is the name of the picture's own part.
    let mut other = "rgba_".to_owned();
    while channels.iter().any(|(name, _)| name.rsplit_once('.').is_some_and(|(layer, _)| layer == other)) {
        other.push('_');
    }
    let layer_of = |name: &str| match name.rsplit_once('.') {
        Some(("rgba", _)) => other.clone(),
        Some((layer, _)) => cryptomatte::layer(layer).unwrap_or(layer).to_owned(),
        None if is_light(name) => "rgba".to_owned(),
        None => name.to_owned(),
    };
    let mut parts: Vec<Part> = Vec::new();
    for channel in channels {
        let (name, light) = (layer_of(channel.0), is_light(channel.0));
        match parts.iter_mut().find(|part| part.name.as_ref() == Some(&name)) {
            Some(part) => part.channels.push(channel),
            None => parts.push(Part { name: Some(name), channels: vec![channel], light, first: false }),
        }
    }
    // Readers ask the first part for the primaries of all, so it holds colour where any part does.
    let picture = parts.iter().position(|part| part.name.as_deref() == Some("rgba"));
    let first = picture.or_else(|| parts.iter().position(|part| part.light)).unwrap_or(0);
    parts[..=first].rotate_right(1);
    parts[0].first = true;
    parts
}

/// How a part is packed: data without loss.
fn part_compression(image: &ExrImage, part: &Part) -> Compression {
    let data = part.channels.iter().any(|(name, _)| image.data.contains(*name)) || !part.light;
    match image.compression {
        Compression::Dwaa(_) | Compression::Dwab(_) if data => Compression::Zips,
        compression => compression,
    }
}

/// The channels in the order that the format asks for, by the bytes of their names.
fn sorted_channels(image: &ExrImage) -> std::result::Result<Vec<Channel<'_>>, String> {
    let pixels = image.window.pixels();
    // OpenEXR refuses windows that reach beyond half the range of i32.
    let limit = i64::from(i32::MAX / 2);
    let fits = |start: i32, size: u32| i64::from(start).abs() < limit && i64::from(start) + i64::from(size) < limit;
    let frame_fits = fits(0, image.frame[0]) && fits(0, image.frame[1]);
    if pixels == 0 || image.frame.contains(&0) {
        return Err(format!("the picture holds no pixel: window {}, frame {:?}", image.window, image.frame));
    }
    if !frame_fits || !fits(image.window.x, image.window.width) || !fits(image.window.y, image.window.height) {
        return Err(format!("the window {} is beyond what OpenEXR can address", image.window));
    }
    if image.channels.is_empty() {
        return Err("the picture has no channel".to_string());
    }
    let mut channels: Vec<Channel> = image.channels.iter().map(|(name, data)| (name.as_str(), data)).collect();
    channels.sort_by_key(|channel| channel.0);
    for pair in channels.windows(2) {
        if pair[0].0 == pair[1].0 {
            return Err(format!("the channel `{}` is there twice", pair[0].0));
        }
    }
    for (name, data) in &channels {
        check_name("channel", name)?;
        if data.len() != pixels {
            return Err(format!("channel `{name}`: expected {pixels} samples, found {}", data.len()));
        }
    }
    Ok(channels)
}

pub(super) fn check_name(what: &str, name: &str) -> std::result::Result<(), String> {
    if name.is_empty() || name.len() > 255 || name.contains('\0') {
        return Err(format!("{what} name {name:?}: expected 1 to 255 bytes without a zero byte"));
    }
    Ok(())
}

/// What the colours of a part mean; none of data.
///
/// A file has one set of `chromaticities`, which OpenEXR wants to be the same in all parts: the primaries of R, G and B
/// wherever there are any, else those of X, Y and Z, which say by their names what they are. `colorInteropID` is that of
/// the picture's own R, G and B, else told where all colours of the part are in one space.
fn encoding(image: &ExrImage, part: &Part) -> Option<ColourEncoding> {
    let rgb = image.colour.as_ref().filter(|_| part.light)?;
    let xyz = &ColourEncoding::of(ColourSpace::Xyz);
    let of = |name: &str| {
        let component = name.rsplit_once('.').map_or(name, |(_, component)| component);
        match component {
            "A" => None,
            "X" | "Y" | "Z" => Some(xyz),
            _ => Some(rgb),
        }
    };
    let colour = |name: &str| if image.data.contains(name) { None } else { of(name) };
    let in_rgb = image.channels.iter().any(|(name, _)| colour(name) == Some(rgb));
    let own = || part.channels.iter().filter_map(|(name, _)| colour(name));
    let picture = part.channels.iter().any(|(name, _)| !name.contains('.') && colour(name) == Some(rgb));
    let told = if picture { Some(rgb) } else { own().next().filter(|first| own().all(|other| other == *first)) };
    Some(ColourEncoding {
        primaries: if in_rgb { rgb.primaries } else { xyz.primaries },
        interop_id: told.and_then(|of| of.interop_id.clone()),
    })
}

/// The attributes of a part, sorted by name, and whether a name is long; `chunks` of one among several.
fn header_bytes(image: &ExrImage, part: &Part, chunks: Option<usize>) -> std::result::Result<(Vec<u8>, bool), String> {
    let channels: Vec<(&str, i32)> = part
        .channels
        .iter()
        .map(|(name, data)| match data {
            ChannelData::U32(_) => (*name, UINT),
            ChannelData::F16(_) => (*name, 1),
            ChannelData::F32(_) => (*name, 2),
        })
        .collect();
    let compression = part_compression(image, part);
    let colour = encoding(image, part);
    let mut structure = Vec::new();
    if let (Some(name), Some(chunks)) = (&part.name, chunks) {
        check_name("part", name)?;
        structure.push(("name", "string", name.as_bytes().to_vec()));
        structure.push(("type", "string", b"scanlineimage".to_vec()));
        structure.push(("chunkCount", "int", (chunks as i32).to_le_bytes().to_vec()));
    }
    if let Compression::Dwaa(level) | Compression::Dwab(level) = compression {
        structure.push(("dwaCompressionLevel", "float", level.to_le_bytes().to_vec()));
    }
    // A manifest stands beside its channels, what every header has to say in all parts, all else in the first.
    let here = |name: &str| match (name.strip_prefix(cryptomatte::PREFIX), &part.name) {
        (None, _) | (_, None) => part.first || name.starts_with("screenWindow"),
        (Some(rest), Some(layer)) => rest.starts_with(&cryptomatte::key(layer)),
    };
    let further: Vec<&(String, Attribute)> = image.attributes.iter().filter(|(name, _)| here(name)).collect();
    header(image.frame, image.window, &channels, compression_code(compression), colour.as_ref(), structure, &further)
}

/// The beginning of a file of whole numbers in `channels`, whose names are sorted: magic number, version and header.
pub(super) fn header_of(
    frame: [u32; 2],
    window: Window,
    channels: &[&str],
    compression: u8,
    attributes: &[(String, Attribute)],
) -> std::result::Result<Vec<u8>, String> {
    let channels: Vec<(&str, i32)> = channels.iter().map(|name| (*name, UINT)).collect();
    let attributes: Vec<&(String, Attribute)> = attributes.iter().collect();
    let (header, long) = header(frame, window, &channels, compression, None, Vec::new(), &attributes)?;
    let mut out = vec![0x76, 0x2f, 0x31, 0x01];
    out.extend_from_slice(&(2u32 | u32::from(long) << 10).to_le_bytes());
    out.extend_from_slice(&header);
    Ok(out)
}

/// The type of whole numbers.
const UINT: i32 = 0;

fn header(
    frame: [u32; 2],
    window: Window,
    channels: &[(&str, i32)],
    compression: u8,
    colour: Option<&ColourEncoding>,
    structure: Vec<(&'static str, &'static str, Vec<u8>)>,
    further: &[&(String, Attribute)],
) -> std::result::Result<(Vec<u8>, bool), String> {
    // (name, type, value)
    let mut attributes: Vec<(&str, &str, Vec<u8>)> = vec![
        ("channels", "chlist", channel_list(channels)),
        ("compression", "compression", vec![compression]),
        ("dataWindow", "box2i", window_bytes(window)),
        ("displayWindow", "box2i", window_bytes(Window::full(frame[0], frame[1]))),
        ("lineOrder", "lineOrder", vec![0]),
        ("pixelAspectRatio", "float", 1f32.to_le_bytes().to_vec()),
    ];
    // What the format asks for where nobody says how the picture was projected.
    for (name, kind, value) in
        [("screenWindowCenter", "v2f", vec![0; 8]), ("screenWindowWidth", "float", floats([1.0]))]
    {
        if further.iter().all(|(other, _)| other != name) {
            attributes.push((name, kind, value));
        }
    }
    attributes.extend(structure);
    match colour {
        Some(ColourEncoding { primaries, interop_id }) => {
            attributes.push((
                "chromaticities",
                "chromaticities",
                floats(primaries.iter().flatten().map(|&v| v as f32)),
            ));
            if let Some(id) = interop_id {
                attributes.push(("colorInteropID", "string", id.as_bytes().to_vec()));
            }
        }
        None => attributes.push(("colorInteropID", "string", b"data".to_vec())),
    }
    for (name, value) in further {
        check_name("attribute", name)?;
        // Names that say how the file is built; another value would make it unreadable.
        const STRUCTURE: [&str; 6] = ["tiles", "type", "version", "chunkCount", "maxSamplesPerPixel", "name"];
        if STRUCTURE.contains(&name.as_str()) || attributes.iter().any(|(other, ..)| other == name) {
            return Err(format!("the attribute `{name}` is there twice or belongs to the file format"));
        }
        let (kind, bytes) = attribute_bytes(value);
        attributes.push((name, kind, bytes));
    }
    attributes.sort_by_key(|attribute| attribute.0);

    let long = |name: &str| name.len() > 31;
    let long_names = attributes.iter().any(|a| long(a.0)) || channels.iter().any(|c| long(c.0));
    let mut out = Vec::new();
    for (name, kind, value) in attributes {
        let size = i32::try_from(value.len()).map_err(|_| format!("the attribute `{name}` exceeds 2 GiB"))?;
        for text in [name, kind] {
            out.extend_from_slice(text.as_bytes());
            out.push(0);
        }
        out.extend_from_slice(&size.to_le_bytes());
        out.extend_from_slice(&value);
    }
    out.push(0);
    Ok((out, long_names))
}

fn compression_code(compression: Compression) -> u8 {
    match compression {
        Compression::None => 0,
        Compression::Zips => 2,
        Compression::Zip => 3,
        Compression::Piz => 4,
        Compression::Dwaa(_) => 8,
        Compression::Dwab(_) => 9,
    }
}

fn channel_list(channels: &[(&str, i32)]) -> Vec<u8> {
    let mut out = Vec::new();
    for (name, kind) in channels {
        out.extend_from_slice(name.as_bytes());
        out.push(0);
        out.extend_from_slice(&kind.to_le_bytes());
        // pLinear and three reserved bytes, then the subsampling of x and y.
        out.extend_from_slice(&[0; 4]);
        out.extend_from_slice(&1i32.to_le_bytes());
        out.extend_from_slice(&1i32.to_le_bytes());
    }
    out.push(0);
    out
}

/// The corners of a window, both inclusive. The sizes were checked to fit.
fn window_bytes(window: Window) -> Vec<u8> {
    let last = |start: i32, size: u32| (i64::from(start) + i64::from(size) - 1) as i32;
    [window.x, window.y, last(window.x, window.width), last(window.y, window.height)]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect()
}

fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

/// A time code as SMPTE ST 12-1 packs it for 60 fields: decimal digits of frames, seconds, minutes and hours, a byte each; bit
/// 15 tells the second of two frames.
fn time_bits(code: TimeCode) -> u32 {
    let TimeCode { hours, minutes, seconds, frames, second } = code;
    let digits = [hours, minutes, seconds, frames].iter().fold(0, |bits, n| bits << 8 | (n / 10) << 4 | (n % 10));
    digits | u32::from(second) << 15
}

/// Type name and bytes of a value.
fn attribute_bytes(value: &Attribute) -> (&'static str, Vec<u8>) {
    match value {
        Attribute::Text(text) => ("string", text.as_bytes().to_vec()),
        Attribute::Int(v) => ("int", v.to_le_bytes().to_vec()),
        Attribute::Float(v) => ("float", v.to_le_bytes().to_vec()),
        Attribute::Double(v) => ("double", v.to_le_bytes().to_vec()),
        Attribute::Rational(n, d) => ("rational", [n.to_le_bytes(), d.to_le_bytes()].concat()),
        Attribute::Vec2(v) => ("v2f", floats(*v)),
        Attribute::TimeCode(code) => ("timecode", [time_bits(*code).to_le_bytes(), [0; 4]].concat()),
        Attribute::Matrix4(m) => ("m44f", floats(*m)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::header::{Value, read_headers};
    use super::super::tests::{image, rec709};
    use super::super::{Base, Precision, StandardError, beauty, read_exr};
    use super::*;

    /// 01:02:03:24, the second of its pair: no digit of the frames reaches the bit of dropped frames.
    #[test]
    fn time_codes_are_packed_digit_by_digit() {
        let code = TimeCode { hours: 1, minutes: 2, seconds: 3, frames: 24, second: true };
        assert_eq!(time_bits(code), 0x0102_8324);
        assert_eq!(time_bits(TimeCode { second: false, frames: 29, ..code }), 0x0102_0329);
    }

    fn mixed(compression: Compression) -> ExrImage {
        let f = [1.5, -0.0, f32::NAN, f32::INFINITY, 1e-40, -3e38];
        let mut exr =
            beauty(&image(0.25), Base::Rgba, Vec::new(), rec709(), Precision::Half, StandardError::Write, compression)
                .exr;
        exr.channels.push(("Z".to_string(), ChannelData::F32(f.to_vec())));
        exr.channels.push(("sampleCount".to_string(), ChannelData::U32(vec![0, 1, 2, 3, 1 << 20, 7])));
        exr.attributes = vec![
            ("owner".to_string(), Attribute::Text("Ærøskøbing 日本".to_string())),
            ("abbe:seed".to_string(), Attribute::Text("18446744073709551615".to_string())),
            ("framesPerSecond".to_string(), Attribute::Rational(24_000, 1001)),
            ("worldToCamera".to_string(), Attribute::Matrix4(std::array::from_fn(|i| i as f32))),
            ("an attribute with more than thirty-one bytes".to_string(), Attribute::Double(0.125)),
        ];
        exr
    }

    #[test]
    fn every_compression_reads_back_exactly() {
        for compression in [Compression::None, Compression::Zips, Compression::Zip, Compression::Piz] {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a.exr");
            let written = mixed(compression);
            write_exr(&path, &written).unwrap();
            let file = read_exr(&path).unwrap();
            assert_eq!(file.display, Window::full(5, 4));
            let part = &file.parts[0];
            assert_eq!(part.window, written.window);
            assert_eq!(part.channels.len(), written.channels.len());
            for (name, data) in &written.channels {
                let expected: Vec<u32> = match data {
                    ChannelData::F16(v) => v.iter().map(|x| x.to_f32().to_bits()).collect(),
                    ChannelData::F32(v) => v.iter().map(|x| x.to_bits()).collect(),
                    ChannelData::U32(v) => v.iter().map(|x| (*x as f32).to_bits()).collect(),
                };
                let found: Vec<u32> = part.channel(name).unwrap().iter().map(|x| x.to_bits()).collect();
                assert_eq!(found, expected, "{compression:?} {name}");
            }
            assert_eq!(part.text("owner"), Some("Ærøskøbing 日本"));
            assert_eq!(part.text("colorInteropID"), Some("lin_rec709_scene"));
            assert_eq!(part.text("abbe:seed"), Some("18446744073709551615"));
        }
    }

    /// Light and data by themselves are packed as asked for in a file of parts, where each has one; in a single part data
    /// leave nothing to lose.
    #[test]
    fn data_are_never_packed_with_loss() {
        let code = Value::Code;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        for (compression, lossy) in [(Compression::Dwaa(45.0), 8), (Compression::Dwab(45.0), 9)] {
            for layout in [Layout::Single, Layout::Multipart] {
                let mut written = mixed(compression);
                written.layout = layout;
                // Counts and depths are data; a layer of light is none.
                written.data.extend(["Z".to_owned(), "sampleCount".to_owned()]);
                written.channels.push(("key.R".to_owned(), ChannelData::F32(vec![0.5; 6])));
                write_exr(&path, &written).unwrap();
                for (part, header) in read_exr(&path).unwrap().parts.iter().zip(read_headers(&path).unwrap().parts) {
                    let light = matches!(part.name.as_deref(), Some("rgba" | "key"));
                    let expected = if light { lossy } else { compression_code(Compression::Zips) };
                    assert_eq!(header.get("compression"), Some(&code(expected)), "{layout:?} {:?}", part.name);
                    for (name, data) in written.channels.iter().filter(|(name, _)| written.data.contains(name)) {
                        let expected: Vec<u32> = match data {
                            ChannelData::F16(v) => v.iter().map(|x| x.to_f32().to_bits()).collect(),
                            ChannelData::F32(v) => v.iter().map(|x| x.to_bits()).collect(),
                            ChannelData::U32(v) => v.iter().map(|x| (*x as f32).to_bits()).collect(),
                        };
                        let found = part.channel(name).map(|v| v.iter().map(|x| x.to_bits()).collect::<Vec<u32>>());
                        assert!(found.is_none_or(|found| found == expected), "{layout:?} {name}");
                    }
                }
            }
        }
    }

    /// In a file of parts the manifest of each Cryptomatte stands in the part of its channels, and nowhere else; what is said
    /// of the picture stands in the first.
    #[test]
    fn manifests_stand_beside_their_channels() {
        let mut written = mixed(Compression::Zips);
        written.layout = Layout::Multipart;
        let name = |layer: &str| format!("{}{}/manifest", cryptomatte::PREFIX, cryptomatte::key(layer));
        for layer in ["CryptoObject", "CryptoMaterial"] {
            for pair in ["00.R", "00.G", "01.R"] {
                written.push_data(format!("{layer}{pair}"), ChannelData::F32(vec![0.0; 6]));
            }
            written.attributes.push((name(layer), Attribute::Text(layer.to_owned())));
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        write_exr(&path, &written).unwrap();
        let headers = read_headers(&path).unwrap();
        assert!(headers.multipart);
        for (i, header) in headers.parts.iter().enumerate() {
            let part = header.text("name").unwrap();
            for layer in ["CryptoObject", "CryptoMaterial"] {
                assert_eq!(header.text(&name(layer)), (part == layer).then_some(layer), "{layer} in {part}");
            }
            assert_eq!(header.text("owner").is_some(), i == 0, "{part}");
        }
        let parts: Vec<&str> = headers.parts.iter().filter_map(|header| header.text("name")).collect();
        assert_eq!(parts, ["rgba", "CryptoMaterial", "CryptoObject", "stderr"]);
    }

    /// What a person calls a layer is a part of its own, also where it is called like the picture's part or nearly like a Cryptomatte.
    #[test]
    fn each_layer_has_a_part() {
        let mut written = mixed(Compression::Zips);
        written.layout = Layout::Multipart;
        let layers = ["Crypto1", "Crypto2", "CryptoObject", "rgba", "rgba_"];
        for layer in layers {
            written.push_data(format!("{layer}.R"), ChannelData::F32(vec![0.0; 6]));
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        write_exr(&path, &written).unwrap();
        let headers = read_headers(&path).unwrap();
        let parts: Vec<&str> = headers.parts.iter().filter_map(|header| header.text("name")).collect();
        assert_eq!(parts, ["rgba", "Crypto1", "Crypto2", "CryptoObject", "rgba__", "rgba_", "stderr"]);
    }

    /// OpenEXR and OpenImageIO open no file whose parts differ in `chromaticities`, nor one whose first part has none where a
    /// later one has.
    #[test]
    fn all_parts_have_the_primaries_of_red_green_and_blue() {
        let xyz = ColourEncoding::of(ColourSpace::Xyz);
        let told = |names: &[&str], data: &[&str], layout| {
            let mut written = mixed(Compression::Zips);
            written.channels = names.iter().map(|n| ((*n).to_owned(), ChannelData::F32(vec![0.5; 6]))).collect();
            written.data = data.iter().map(|n| (*n).to_owned()).collect();
            written.layout = layout;
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a.exr");
            write_exr(&path, &written).unwrap();
            let of = |header: &super::super::header::Header| {
                let name = |primaries: [[f64; 2]; 4]| primaries.concat().iter().map(|x| *x as f32).collect::<Vec<_>>();
                let set = header.numbers::<8>("chromaticities").map(|set| {
                    let set = set.map(|x| x as f32).to_vec();
                    ["rgb", "xyz"].into_iter().zip([rec709(), xyz.clone()]).find(|(_, of)| name(of.primaries) == set)
                });
                let set = set.map_or("none", |known| known.unwrap().0);
                let id =
                    header.text("colorInteropID").map(|id| id.trim_start_matches("lin_").trim_end_matches("_scene"));
                format!("{} {set} {}", header.text("name").unwrap_or("all"), id.unwrap_or("none"))
            };
            read_headers(&path).unwrap().parts.iter().map(of).collect::<Vec<_>>().join(", ")
        };
        let (single, multi) = (Layout::Single, Layout::Multipart);
        let picture = ["X", "Y", "Z", "A"];
        let albedo = ["albedo.R", "albedo.G", "albedo.B"];
        let light = ["light.X", "light.Y", "light.Z"];
        assert_eq!(told(&picture, &[], single), "all xyz ciexyzd65");
        let both = [&picture[..], &albedo].concat();
        assert_eq!(told(&both, &[], single), "all rgb none");
        assert_eq!(told(&both, &[], multi), "rgba rgb ciexyzd65, albedo rgb rec709");
        assert_eq!(told(&["Y", "A", "albedo.R"], &[], multi), "rgba rgb ciexyzd65, albedo rgb rec709");
        let other = [&["R", "G", "B", "Z"][..], &light].concat();
        assert_eq!(told(&other, &["Z"], single), "all rgb rec709");
        assert_eq!(told(&other, &["Z"], multi), "rgba rgb rec709, Z none data, light rgb ciexyzd65");
        // A layer may have the name of the picture's part.
        let clash = [&picture[..], &["rgba.T"]].concat();
        assert_eq!(told(&clash, &["rgba.T"], multi), "rgba xyz ciexyzd65, rgba_ none data");
        // Bands are no colour, and stand before all others by their names.
        let bands = [&["a", "b"][..], &light, &albedo].concat();
        let expected = "albedo rgb rec709, a none data, b none data, light rgb ciexyzd65";
        assert_eq!(told(&bands, &["a", "b"], multi), expected);
        assert_eq!(told(&["a", "b"], &["a", "b"], multi), "a none data, b none data");
    }

    #[test]
    fn the_same_picture_gives_the_same_bytes() {
        let mut other = mixed(Compression::Zips);
        other.attributes.reverse();
        other.channels.reverse();
        assert_eq!(encode_exr(&mixed(Compression::Zips)), encode_exr(&other));
    }

    #[test]
    fn what_cannot_be_written_is_named() {
        let error = |change: &dyn Fn(&mut ExrImage)| {
            let mut exr = mixed(Compression::None);
            change(&mut exr);
            encode_exr(&exr).unwrap_err()
        };
        assert_eq!(
            error(&|e| e.channels.push(("x".into(), ChannelData::F32(vec![1.0])))),
            "channel `x`: expected 6 samples, found 1"
        );
        assert_eq!(
            error(&|e| e.channels.push(("R".into(), ChannelData::F32(vec![1.0; 6])))),
            "the channel `R` is there twice"
        );
        assert!(error(&|e| e.attributes.push(("dataWindow".into(), Attribute::Int(1)))).contains("`dataWindow`"));
        assert!(error(&|e| e.attributes.push(("a\0b".into(), Attribute::Int(1)))).contains("zero byte"));
        assert!(error(&|e| e.channels.clear()).contains("no channel"));
        assert!(error(&|e| e.frame = [0, 4]).contains("no pixel"));
        assert!(error(&|e| e.window.x = i32::MAX - 1).contains("beyond"));
    }

    #[test]
    fn a_missing_directory_leaves_no_file() {
        let dir = tempfile::tempdir().unwrap();
        let e = write_exr(&dir.path().join("no/a.exr"), &mixed(Compression::None)).unwrap_err();
        assert!(matches!(e, Error::Output { .. }) && e.to_string().contains("does not exist"), "{e}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
