//! The answer as a person reads it.

use super::facts::{ChannelFacts, ExrFacts, LayerFacts, PartFacts};
use crate::batch::words::{per_cent, seconds};
use crate::cli::text::columns;
use crate::film::Window;
use crate::film::exr::header::Value;
use crate::film::png::inspect::PngFacts;
use std::fmt::Write;
use std::path::Path;

/// Layers of one file that are listed channel by channel; of more, as of a spectrum, only the first and the last are.
const MOST_CHANNELS: usize = 64;

fn size(bytes: u64) -> String {
    let units = ["bytes", "kB", "MB", "GB"];
    let (mut value, mut unit) = (bytes as f64, 0);
    while value >= 1000.0 && unit < 3 {
        value /= 1000.0;
        unit += 1;
    }
    if unit == 0 { format!("{bytes} bytes") } else { format!("{value:.1} {}", units[unit]) }
}

/// A line of the answer.
fn line(out: &mut String, what: &str, text: &str) {
    let [what, text] = [what, text].map(|part| crate::error::one_line(part.to_owned()));
    let _ = writeln!(out, "  {what:<11} {text}");
}

/// A PNG file.
pub fn png(file: &Path, bytes: u64, png: &PngFacts) -> String {
    let [width, height] = png.size;
    let mut out = format!("{}\n", file.display());
    line(
        &mut out,
        "file",
        &format!("PNG, {width} x {height}, {}, {} bits a channel, {}", png.channels, png.bits, size(bytes)),
    );
    line(&mut out, "colours", &png.colours);
    for (keyword, text) in &png.texts {
        line(&mut out, keyword.strip_prefix("abbe/").unwrap_or(keyword), &one_line(text));
    }
    out
}

/// An OpenEXR file.
pub fn exr(file: &Path, bytes: u64, exr: &ExrFacts) -> String {
    let mut out = format!("{}\n", file.display());
    let several = exr.parts.len() > 1;
    let count = if several { format!("{} parts, ", exr.parts.len()) } else { String::new() };
    let Window { width, height, .. } = exr.frame;
    line(&mut out, "file", &format!("OpenEXR, {width} x {height}, {count}{}", size(bytes)));
    if let Some(part) = &exr.part_of_picture {
        let what = if part.whole { "a part, whole" } else { "a checkpoint" };
        let [tile, tiles] = part.tile;
        let [from, to] = part.samples;
        let tile = if tiles > 1 { format!("tile {tile} of {tiles}, ") } else { String::new() };
        let done = match part.done {
            _ if part.whole => String::new(),
            Some(done) => format!(", {} of it done", per_cent(done)),
            None => format!(" at the most, {:.1} of them done", part.reached),
        };
        line(&mut out, "part", &format!("{what}: {tile}samples {from} to {to}{done}, in {}", seconds(part.seconds)));
        line(&mut out, "scene", &format!("{} ({})", one_line(&part.scene), one_line(&part.source)));
    }
    for (i, part) in exr.parts.iter().enumerate() {
        if several {
            let name = part.name.as_deref().map_or_else(String::new, |name| format!(" \"{}\"", one_line(name)));
            let _ = writeln!(out, "  part {i}{name}");
        }
        about(&mut out, part, exr.frame, exr.parts.first().filter(|_| i > 0));
        if exr.part_of_picture.is_none() {
            channels(&mut out, part);
        }
    }
    if let Some(why) = &exr.unread {
        line(&mut out, "pixels", &format!("not read: {why}"));
    }
    match exr.as_written {
        Some(true) => line(&mut out, "pixels", "as they were written"),
        Some(false) => line(&mut out, "pixels", "changed since they were written"),
        None => {}
    }
    out
}

/// Where the pixels lie in the frame.
fn window(window: Window, frame: Window) -> String {
    if window == frame {
        return match (frame.x, frame.y) {
            (0, 0) => "all of the frame".to_owned(),
            (x, y) => format!("all of the frame, which begins at ({x}, {y})"),
        };
    }
    let what = match (frame.contains(&window), window.contains(&frame)) {
        (true, _) => "crop",
        (_, true) => "overscan",
        (false, false) => "beside or across the frame",
    };
    format!("{what}: {window}, of a frame of {frame}")
}

/// Attributes that have a line of their own, or that say nothing to a person.
const TOLD: [&str; 40] = [
    "abbe/adaptiveSamples",
    "abbe/contentHash",
    "abbe/effects",
    "abbe/frame",
    "abbe/integrator",
    "abbe/invalidByCause",
    "abbe/invalidSamples",
    "abbe/part",
    "abbe/partHash",
    "abbe/pixelHash",
    "abbe/planHash",
    "abbe/relativeError",
    "abbe/relativeErrorInterval95",
    "abbe/relativeErrorState",
    "abbe/renderSeconds",
    "abbe/samples",
    "abbe/sceneHash",
    "abbe/secondsToHalveError",
    "abbe/seed",
    "abbe/settingsHash",
    "abbe/tile",
    "abbe/version",
    "abbe/wavelengths",
    "channels",
    "chromaticities",
    "chunkCount",
    "colorInteropID",
    "comments",
    "compression",
    "dataWindow",
    "displayWindow",
    "lineOrder",
    "name",
    "screenWindowCenter",
    "screenWindowWidth",
    "software",
    "type",
    "version",
    "worldToCamera",
    "worldToNDC",
];

/// What a part is; of a further one no more of its attributes than those which are not the first's.
fn about(out: &mut String, part: &PartFacts, frame: Window, first: Option<&PartFacts>) {
    let kind = match part.kind.as_str() {
        "scanlineimage" => "scan lines",
        "tiledimage" => "tiles",
        "deepscanline" => "deep scan lines",
        "deeptile" => "deep tiles",
        other => other,
    };
    line(out, "stored", &format!("{kind}, {}", part.compression));
    line(out, "window", &window(part.window, frame));
    line(out, "colours", part.colours.as_deref().unwrap_or("not said"));
    if first.is_none() {
        made(out, part);
    }
    let is_first = |name: &str, value| first.is_some_and(|first| first.attributes.get(name) == Some(value));
    for (name, value) in &part.attributes {
        if TOLD.contains(&name.as_str()) || is_first(name, value) {
            continue;
        }
        let plain = match (name.as_str(), value) {
            ("pixelAspectRatio", Value::Number(1.0)) => continue,
            (_, Value::Text(text)) => one_line(text),
            (_, Value::Texts(texts)) => one_line(&texts.join(", ")),
            (_, Value::Number(number)) => short(*number),
            (_, Value::Numbers(numbers)) => numbers.iter().map(|n| short(*n)).collect::<Vec<_>>().join(" "),
            (_, Value::Code(code)) => code.to_string(),
            (_, Value::Bytes { bytes }) => size(*bytes as u64),
            (_, Value::Channels(_)) => continue,
        };
        let _ = writeln!(out, "  {}: {plain}", one_line(name));
    }
}

/// How a picture was made, and what it shows.
fn made(out: &mut String, part: &PartFacts) {
    let text = |name: &str| match part.attributes.get(name) {
        Some(Value::Text(text)) => Some(one_line(text)),
        Some(Value::Number(number)) => Some(number.to_string()),
        _ => None,
    };
    let number = |name: &str| match part.attributes.get(name) {
        Some(Value::Number(number)) => Some(*number),
        _ => None,
    };
    let mut made: Vec<String> = text("software").into_iter().collect();
    made.extend(text("comments").map(|name| format!("\"{name}\"")));
    if let Some(seconds_taken) = number("abbe/renderSeconds") {
        made.push(format!("in {}", seconds(seconds_taken)));
    }
    made.extend(text("abbe/integrator").map(|name| format!("by {name}")));
    if !made.is_empty() {
        line(out, "made by", &made.join(", "));
    }
    if let (Some(samples), Some(seed)) = (number("abbe/samples"), text("abbe/seed")) {
        let shared = text("abbe/adaptiveSamples").map_or(String::new(), |counts| format!(" ({counts})"));
        let dropped = text("abbe/invalidSamples").filter(|n| n != "0");
        let dropped = dropped.map_or(String::new(), |n| format!(", {n} of all dropped as invalid"));
        line(out, "samples", &format!("{samples} a pixel{shared}, seed {seed}{dropped}"));
    }
    if let Some(error) = number("abbe/relativeError") {
        let interval = text("abbe/relativeErrorInterval95").unwrap_or_default();
        let ends: Vec<f64> = interval.split(' ').filter_map(|end| end.parse().ok()).collect();
        let state = match (text("abbe/relativeErrorState").as_deref(), ends.as_slice()) {
            (Some("valid") | None, [low, high]) => {
                format!(" ({} to {}, 95 times of 100)", per_cent(*low), per_cent(*high))
            }
            (Some(state), _) => format!(" ({state})"),
            _ => String::new(),
        };
        let half = number("abbe/secondsToHalveError").filter(|s| s.is_finite());
        let half = half.map_or(String::new(), |s| format!("; half of it would take {} more", seconds(s)));
        line(out, "error", &format!("{}{state}{half}", per_cent(error)));
    }
    if let Some(effects) = text("abbe/effects") {
        line(out, "effects", &effects);
    }
    if let Some(wavelengths) = text("abbe/wavelengths") {
        line(out, "wavelengths", &wavelengths);
    }
    if let Some(frame) = text("abbe/frame") {
        line(out, "frame", &frame);
    }
    if let Some(camera) = &part.camera {
        let point = |p: [f64; 3]| format!("[{}]", p.map(short).join(", "));
        let fov = match camera.fov_deg {
            Some([x, y]) => format!("; it sees {x:.1} by {y:.1} degrees"),
            None => String::new(),
        };
        line(out, "camera", &format!("at {}, looks along {}{fov}", point(camera.position), point(camera.direction)));
    }
    let hashes = [("scene", "abbe/sceneHash"), ("settings", "abbe/settingsHash")];
    let hashes: Vec<String> =
        hashes.iter().filter_map(|(what, name)| Some(format!("{what} {}", text(name)?))).collect();
    if !hashes.is_empty() {
        line(out, "hashes", &hashes.join(", "));
    }
}

fn channels<'a>(out: &mut String, part: &'a PartFacts) {
    let mut rows = vec![["  layer", "channel", "type", "least", "mean", "greatest", "not finite"].map(String::from)];
    let of_layer = |(i, layer): (usize, &'a LayerFacts)| layer.channels.iter().map(move |channel| (i, channel));
    let mut all: Vec<(usize, &ChannelFacts)> = part.layers.iter().enumerate().flat_map(of_layer).collect();
    let left_out = all.len().saturating_sub(MOST_CHANNELS);
    if left_out > 0 {
        all.drain(MOST_CHANNELS - 1..MOST_CHANNELS - 1 + left_out);
    }
    let mut above = None;
    for (i, channel) in all {
        let name = match part.layers[i].layer.as_str() {
            _ if above == Some(i) => "",
            "" => "picture",
            name => name,
        };
        rows.push(row(name, channel));
        above = Some(i);
    }
    out.push_str(&columns(&rows, 3));
    if left_out > 0 {
        let _ = writeln!(out, "  and {left_out} channels between; --json has them all");
    }
}

fn row(layer: &str, channel: &ChannelFacts) -> [String; 7] {
    let number = |x: Option<f64>| x.map_or("-".to_owned(), short);
    let (least, mean, greatest, odd) = match &channel.facts {
        Some(facts) => {
            let mut odd: Vec<String> = Vec::new();
            odd.extend((facts.nan > 0).then(|| format!("{} NaN", facts.nan)));
            odd.extend((facts.infinite > 0).then(|| format!("{} infinite", facts.infinite)));
            let odd = if odd.is_empty() { "none".to_owned() } else { odd.join(", ") };
            (number(facts.min), number(facts.mean), number(facts.max), odd)
        }
        None => ("-".into(), "-".into(), "-".into(), "-".into()),
    };
    let kind = match channel.sampling {
        [1, 1] => channel.kind.to_owned(),
        [x, y] => format!("{}, one for {x} x {y}", channel.kind),
    };
    [format!("  {}", one_line(layer)), one_line(&channel.name), kind, least, mean, greatest, odd]
}

/// Some four digits.
fn short(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".to_owned()
    } else if x.fract() == 0.0 && size < 1e7 {
        format!("{x}")
    } else if (1e-3..1e5).contains(&size) {
        let digits = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{x:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{x:.3e}")
    }
}

/// Text of a file on one line, not too long, without commands to the terminal.
fn one_line(text: &str) -> String {
    let clean = crate::error::one_line(text.trim_end().to_owned());
    match clean.char_indices().nth(200) {
        Some((end, _)) => format!("{} ...", &clean[..end]),
        None => clean,
    }
}

#[cfg(test)]
mod tests {
    use super::super::facts::of;
    use super::*;
    use crate::film::exr::{Attribute, ChannelData, ColourEncoding, Compression, ExrImage, Layout, write_exr};
    use crate::spectrum::ColourSpace;

    #[test]
    fn numbers_have_some_four_digits() {
        let all =
            [(0.0, "0"), (1.0, "1"), (-0.123_456, "-0.1235"), (1234.56, "1235"), (1e-5, "1.000e-5"), (0.5, "0.5")];
        for (x, text) in all {
            assert_eq!(short(x), text);
        }
        assert_eq!(size(999), "999 bytes");
        assert_eq!(size(1_234_567), "1.2 MB");
    }

    /// A file of `channels`, one pixel each, as it is told.
    fn told(channels: &[&str], layout: Layout, attributes: &[(&str, &str)], colours: &str) -> String {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let mut colour = ColourEncoding::of(ColourSpace::Rec709);
        colour.interop_id = Some(colours.to_owned());
        let image = ExrImage {
            frame: [1, 1],
            window: Window::full(1, 1),
            channels: channels.iter().map(|name| ((*name).to_owned(), ChannelData::F32(vec![0.5]))).collect(),
            colour: Some(colour),
            attributes: attributes.iter().map(|(k, v)| ((*k).to_owned(), Attribute::Text((*v).to_owned()))).collect(),
            data: std::collections::BTreeSet::new(),
            compression: Compression::None,
            layout,
        };
        write_exr(&path, &image).unwrap();
        exr(Path::new("a.exr"), 1, &of(&path).unwrap())
    }

    #[test]
    fn names_in_a_file_command_nothing_of_the_terminal() {
        let told = told(&["la\x1b[1m.R", "G\x1b[2m"], Layout::Single, &[("na\x1b[3m", "x\x1b[4m")], "id\x1b[5m\n  z");
        assert!(!told.contains('\x1b'), "{told:?}");
        for part in ["la\\u{1b}[1m", "G\\u{1b}[2m", "  na\\u{1b}[3m: x\\u{1b}[4m\n", " id\\u{1b}[5m\\n  z\n"] {
            assert!(told.contains(part), "{told}");
        }
    }

    #[test]
    fn of_many_channels_the_last_has_the_name_of_its_layer() {
        let many: Vec<String> = (0..70).map(|i| format!("a.{i:02}")).collect();
        let names = |last: &'static str| many.iter().map(String::as_str).chain([last]).collect::<Vec<_>>();
        let rows = |last| {
            let told = told(&names(last), Layout::Single, &[], "x");
            assert!(told.contains("\n  and 7 channels between;"), "{told}");
            let rows: Vec<String> =
                told.lines().map(|line| line.split_whitespace().take(3).collect::<Vec<_>>().join(" ")).collect();
            rows[rows.len() - 3..rows.len() - 1].to_vec()
        };
        assert_eq!(rows("b.R"), ["62 float 0.5", "b R float"]);
        assert_eq!(rows("a.99"), ["62 float 0.5", "99 float 0.5"]);
    }

    #[test]
    fn a_further_part_tells_what_the_first_does_not() {
        let key = crate::film::cryptomatte::key("CryptoObject");
        let hash = format!("cryptomatte/{key}/hash");
        let told =
            told(&["R", "CryptoObject00.R"], Layout::Multipart, &[("owner", "us"), (&hash, "MurmurHash3_32")], "x");
        let (first, further) = told.split_once("  part 1 \"CryptoObject\"\n").unwrap_or_else(|| panic!("{told}"));
        assert!(first.contains("  owner: us\n") && !first.contains(&hash), "{told}");
        assert!(further.contains(&format!("  {hash}: MurmurHash3_32\n")) && !further.contains("owner"), "{told}");
    }

    #[test]
    fn windows_are_told_as_crop_or_overscan() {
        let frame = Window::full(40, 30);
        assert_eq!(window(frame, frame), "all of the frame");
        let crop = Window { x: 7, y: 5, width: 20, height: 11 };
        assert_eq!(window(crop, frame), "crop: 20x11 at (7, 5), of a frame of 40x30 at (0, 0)");
        let more = Window { x: -2, y: -2, width: 44, height: 34 };
        assert!(window(more, frame).starts_with("overscan"));
    }
}
