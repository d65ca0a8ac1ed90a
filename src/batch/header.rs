//! What the header of a picture says: what is needed to make it again, and how good it is.

use super::finish::{Finish, integrator};
use super::frame::Frame;
use super::report::SceneReport;
use crate::description::{self, HeaderValue, Standard};
use crate::film::error::ErrorEstimate;
use crate::film::exr::{Attribute, TimeCode};
use crate::spectrum::observer;
use crate::transport::plan::Integrator;

/// The attribute of a header that says what is wrong with a picture that is written all the same.
pub(super) const FAULT: &str = "abbe/fault";

/// That of the file of `output.spectral`: how many bands it has. Those of its layout may be the user's own in any file.
pub(super) const SPECTRAL: &str = "abbe/spectralBands";

/// Of light at 555 nm, lm/W.
const LUMENS_PER_WATT: f64 = 683.002;

/// The header of a file of a picture: what is needed to make it again, and how good it is, whose error is `error`.
pub(super) fn attributes(
    finish: &Finish,
    frame: &Frame,
    report: &SceneReport,
    error: Option<&ErrorEstimate>,
) -> Vec<(String, Attribute)> {
    let text = |s: &str| Attribute::Text(s.to_owned());
    let mut all = vec![
        ("software".to_owned(), text(concat!("Abbe ", env!("CARGO_PKG_VERSION")))),
        ("abbe/version".to_owned(), text(env!("CARGO_PKG_VERSION"))),
        ("abbe/sceneHash".to_owned(), text(&finish.scene_hash)),
        ("abbe/settingsHash".to_owned(), text(&finish.settings_hash())),
        ("abbe/pixelHash".to_owned(), text(&report.pixel_hash)),
        ("abbe/seed".to_owned(), text(&finish.seed.to_string())),
        ("abbe/samples".to_owned(), Attribute::Int(frame.samples() as i32)),
        ("abbe/wavelengths".to_owned(), text(&finish.wavelengths)),
        ("abbe/integrator".to_owned(), text(&finish.integrator)),
        ("abbe/effects".to_owned(), text(&report.effects_in_force().join(", "))),
        ("abbe/renderSeconds".to_owned(), Attribute::Double(frame.elapsed.as_secs_f64())),
        ("abbe/invalidSamples".to_owned(), text(&frame.invalid().total().to_string())),
        ("abbe/invalidByCause".to_owned(), text(&frame.invalid().causes().map(|n| n.to_string()).join(" "))),
    ];
    for (name, matrix) in [("worldToCamera", finish.world_to_camera), ("worldToNDC", finish.world_to_ndc)] {
        all.extend(matrix.map(|matrix| (name.to_owned(), Attribute::Matrix4(matrix))));
    }
    if let Some([x, y, width]) = finish.screen_window {
        all.push(("screenWindowCenter".to_owned(), Attribute::Vec2([x, y])));
        all.push(("screenWindowWidth".to_owned(), Attribute::Float(width)));
    }
    if let Some(number) = finish.frame_number {
        all.push(("abbe/frame".to_owned(), Attribute::Int(number)));
        all.push(("imageCounter".to_owned(), Attribute::Int(number)));
    }
    if let Some(rate) = finish.frames_per_second {
        let [frames, seconds] = rational_rate(rate);
        all.push(("framesPerSecond".to_owned(), Attribute::Rational(frames as i32, seconds)));
    }
    let lens = &finish.lens;
    for (name, value) in [
        ("nominalFocalLength", lens.focal_length_mm),
        ("aperture", lens.aperture),
        ("focus", lens.focus),
        // A shutter that turns with the film: degrees, and seconds.
        ("shutterAngle", lens.shutter.map(|share| 360.0 * share)),
        ("expTime", lens.shutter.zip(finish.frames_per_second).map(|(share, rate)| share / rate)),
        ("whiteLuminance", white_luminance(finish)),
    ] {
        // What a float does not hold, as the focal length of next to no angle, is not said, as the user may not say it.
        let value = value.map(|value| value as f32).filter(|value| value.is_finite());
        all.extend(value.map(|value| (name.to_owned(), Attribute::Float(value))));
    }
    let written = &finish.output.exr.attributes;
    if !written.contains_key("comments") {
        all.push(("comments".to_owned(), text(&finish.name)));
    }
    for (name, value) in written {
        all.retain(|(other, _)| other != name);
        let value = match value {
            HeaderValue::Number(value) => number(name, *value),
            HeaderValue::Text(written) => match description::time_code(written).filter(|_| name == "timeCode") {
                Some(code) => Attribute::TimeCode(time_code(code, finish.frame_number, finish.frames_per_second)),
                None => text(written),
            },
        };
        all.push((name.clone(), value));
    }
    if let Some(counts) = &report.adaptive {
        all.push(("abbe/adaptiveSamples".to_owned(), text(&counts.words())));
    }
    if let Some(e) = error {
        all.push(("abbe/relativeError".to_owned(), Attribute::Double(e.rel_rmse)));
        let state = if e.valid { "valid" } else { "not converged, interval not valid" };
        all.push(("abbe/relativeErrorState".to_owned(), text(state)));
        all.push(("abbe/relativeErrorInterval95".to_owned(), text(&format!("{:e} {:e}", e.low, e.high))));
    }
    if let Some(fault) = &report.fault {
        all.push((FAULT.to_owned(), text(fault)));
    }
    if let Some(seconds) = report.halving_seconds.filter(|_| error.is_some()) {
        all.push(("abbe/secondsToHalveError".to_owned(), Attribute::Double(seconds)));
    }
    all
}

/// A number as the standard has it: a float in its attributes; in others an int where it is one, else a double, which holds all
/// digits that were written.
fn number(name: &str, value: f64) -> Attribute {
    if description::standard(name) == Some(Standard::Float) {
        Attribute::Float(value as f32)
    } else if f64::from(value as i32) == value {
        Attribute::Int(value as i32)
    } else {
        Attribute::Double(value)
    }
}

/// Frames and seconds of a rate: whole ones a second, those of television (24000 in 1001 seconds, written 23.976 or 23.98),
/// else to the nearest thousandth, which the description keeps from 0.001 to 10⁶ frames a second.
fn rational_rate(rate: f64) -> [u32; 2] {
    let whole = (rate * 1.001).round();
    // 23.98 for 23.976…: digits are left out beyond the second.
    let television = whole > 0.0 && (whole / 1.001 - rate).abs() <= 0.005 && rate.fract() != 0.0 && whole % 6.0 == 0.0;
    if television {
        [whole as u32 * 1000, 1001]
    } else if rate.fract() == 0.0 {
        [rate as u32, 1]
    } else {
        [(rate * 1000.0).round() as u32, 1000]
    }
}

/// Luminance of what is one in red, green and blue, cd·m⁻²: Y is ∫ L ȳ dλ over that of ȳ, times the sensitivity. Bands and
/// distances have none.
fn white_luminance(finish: &Finish) -> Option<f64> {
    let unit = LUMENS_PER_WATT * observer::Y_INTEGRAL;
    let coloured = !finish.bands && finish.integrator != integrator(&Integrator::Depth);
    (finish.sensitivity > 0.0 && coloured).then(|| unit / finish.sensitivity)
}

/// The time code of frame `number` at `rate` frames a second, where that of frame 0 is `start`. More than 30 frames a second
/// share numbers: two of 48 to 60 one, of which the code tells them; more of a faster rate.
fn time_code(start: [u32; 4], number: Option<i32>, rate: Option<f64>) -> TimeCode {
    // Of a still nobody says the rate.
    let number = i64::from(number.filter(|_| rate.is_some()).unwrap_or(0));
    let rate = i64::from(description::counted_rate(rate));
    let [hours, minutes, seconds, frames] = start.map(i64::from);
    let all = ((hours * 60 + minutes) * 60 + seconds) * rate + frames + number;
    let all = all.rem_euclid(24 * 3600 * rate);
    let (seconds, frame) = (all / rate, all % rate);
    let share = (rate + 29) / 30;
    let [hours, minutes, seconds, frames] =
        [seconds / 3600, seconds / 60 % 60, seconds % 60, frame / share].map(|n| n as u32);
    TimeCode { hours, minutes, seconds, frames, second: share == 2 && frame % 2 == 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::finish::Lens;
    use crate::batch::frame::Gauge;
    use crate::batch::{Overrides, entries, prepare};
    use crate::film::Window;
    use crate::film::accumulate::Film;
    use std::time::Duration;

    /// 3.4e38 is the most that a float holds; white is 683.002 · 106.857 / 1.2e-38 = 6.1e42 cd·m⁻².
    #[test]
    fn numbers_beyond_floats_are_left_out() {
        let dir = tempfile::tempdir().unwrap();
        let yaml = dir.path().join("s.yaml");
        std::fs::write(&yaml, "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n").unwrap();
        let none = Overrides::default();
        let prepared = prepare(&entries(&yaml, &none).unwrap()[0], &none).unwrap();
        let film = Film::new([1, 1], Window::full(1, 1)).unwrap();
        let of = |lens: [f64; 3], sensitivity: f64| {
            let [focal_length_mm, aperture, focus] = lens.map(Some);
            let lens = Lens { focal_length_mm, aperture, focus, shutter: None };
            let finish = Finish { lens, sensitivity, ..Finish::of(&prepared) };
            let frame = Frame::of(film.clone(), None, 0, Duration::ZERO, &Gauge { random: false, ..finish.gauge() });
            let all = attributes(&finish, &frame, &SceneReport::new("s", None), None);
            let names = ["nominalFocalLength", "aperture", "focus", "whiteLuminance"];
            names.map(|name| all.iter().any(|(other, _)| other == name))
        };
        assert_eq!(of([50.0, 2.8, 3.4e38], 1.0), [true; 4]);
        assert_eq!(of([1e300, f64::INFINITY, 3.5e38], 1.2e-38), [false; 4]);
    }

    #[test]
    fn rates_of_television_are_over_1001() {
        let rates = [(24.0, [24, 1]), (23.976, [24_000, 1001]), (29.97, [30_000, 1001]), (59.94, [60_000, 1001])];
        for (rate, rational) in rates.into_iter().chain([
            (23.98, [24_000, 1001]),
            (12.5, [12_500, 1000]),
            (0.004, [4, 1000]),
            (1.001, [1001, 1000]),
            (1e6, [1_000_000, 1]),
        ]) {
            assert_eq!(rational_rate(rate), rational, "{rate}");
        }
    }

    /// 2³¹ − 1 is the largest int; 123456789 has more digits than a float; 1e300 is beyond one.
    #[test]
    fn numbers_of_users_are_written_as_they_are() {
        assert_eq!(number("shot", 123_456_789.0), Attribute::Int(123_456_789));
        assert_eq!(number("shot", -3.0), Attribute::Int(-3));
        assert_eq!(number("last", 2_147_483_647.0), Attribute::Int(i32::MAX));
        assert_eq!(number("more", 2_147_483_648.0), Attribute::Double(2_147_483_648.0));
        assert_eq!(number("big", 1e300), Attribute::Double(1e300));
        assert_eq!(number("part", 0.1), Attribute::Double(0.1));
        assert_eq!(number("focus", 2.0), Attribute::Float(2.0));
        assert_eq!(number("expTime", 0.02), Attribute::Float(0.02));
    }

    /// Frame 45 after 01:00:00:00 is 45/24 s, 45/60 s and 45/120 s later; over midnight codes begin again.
    #[test]
    fn time_codes_follow_the_rate() {
        let code = |rate, number| {
            let code = time_code([1, 0, 0, 0], Some(number), rate);
            ([code.hours, code.minutes, code.seconds, code.frames], code.second)
        };
        assert_eq!(code(Some(24.0), 45), ([1, 0, 1, 21], false));
        assert_eq!(code(Some(29.97), 45), ([1, 0, 1, 15], false));
        assert_eq!(code(Some(60.0), 45), ([1, 0, 0, 22], true));
        assert_eq!(code(Some(48.0), 47), ([1, 0, 0, 23], true));
        assert_eq!(code(Some(120.0), 90), ([1, 0, 0, 22], false));
        assert_eq!(code(Some(24.0), -24 * 3600 - 1), ([23, 59, 59, 23], false));
        assert_eq!(code(None, 45), ([1, 0, 0, 0], false));
        // 49 frames of 24 a second behind 01:02:03:00.
        let TimeCode { hours, minutes, seconds, frames, .. } = time_code([1, 2, 3, 4], Some(45), Some(24.0));
        assert_eq!([hours, minutes, seconds, frames], [1, 2, 5, 1]);
    }
}
