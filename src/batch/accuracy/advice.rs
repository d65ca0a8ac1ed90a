//! What the figures of a sheet say in words.

use super::{Row, knobs};

/// A number to two or three figures.
fn figures(x: f64) -> String {
    if x >= 99.5 {
        format!("{x:.0}")
    } else if x >= 9.95 {
        format!("{x:.1}")
    } else {
        format!("{x:.2}")
    }
}

/// What each knob buys, in a sentence.
#[must_use]
pub fn sentences(rows: &[Row]) -> Vec<(&'static str, String)> {
    let chosen = &rows[0];
    let mut knobs: Vec<&'static str> = rows[1..].iter().map(|r| r.knob).collect();
    knobs.dedup();
    let sentence = |knob: &'static str| {
        let parts: Vec<String> = rows.iter().filter(|r| r.knob == knob).map(|r| phrase(chosen, r)).collect();
        let note = knobs::note(knob).map_or(String::new(), |note| format!(" ({note})"));
        (knob, format!("{}{note}.", parts.join("; ")))
    };
    knobs.into_iter().map(sentence).collect()
}

fn phrase(chosen: &Row, row: &Row) -> String {
    let time = figures(row.seconds / chosen.seconds);
    let noise = figures(row.noise[0] / chosen.noise[0]);
    let what = format!("{} {}", row.knob, row.value);
    let lost: Vec<String> = ["red", "green", "blue"]
        .iter()
        .zip(&row.light)
        .filter(|(_, f)| (f.value - 1.0).abs() > 2.0 * f.error && (f.value - 1.0).abs() >= 0.005)
        .map(|(name, f)| {
            let less = if f.value < 1.0 { "less" } else { "more" };
            format!("{:.1} % {less} {name}", 100.0 * (f.value - 1.0).abs())
        })
        .collect();
    let light = match (row.knob, lost.is_empty(), row.bias()) {
        ("file", ..) => {
            return format!("{what} precision adds an error of {:.3} %", 100.0 * row.bias_squared.value.sqrt());
        }
        ("samples", ..) => String::new(),
        (_, false, Some(bias)) => format!(", and finds {} (bias {:.2} %)", lost.join(", "), 100.0 * bias),
        (_, false, None) => format!(", and finds {}", lost.join(", ")),
        (_, true, Some(bias)) => format!(", with a bias of {:.2} %", 100.0 * bias),
        (_, true, None) => ", and finds the same light".into(),
    };
    let price = match row.to_target {
        Some(t) if row.knob != "samples" => chosen
            .to_target
            .map_or(String::new(), |own| format!("; to the target it takes {} of the time", figures(t / own))),
        Some(_) => String::new(),
        None => "; the target is below its bias".into(),
    };
    format!("{what} takes {time} of the time for {noise} of the noise{light}{price}")
}
