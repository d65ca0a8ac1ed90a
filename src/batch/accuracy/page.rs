//! The sheet as one page that needs nothing else: numbers, curves, pictures and what follows from them.

use super::{Figure, Row, Sheet};
use std::fmt::Write;

/// Style of the page. Colours are told apart without colour vision by their lightness, too.
const STYLE: &str = "
body { font: 15px/1.45 system-ui, sans-serif; color: #1b1d22; margin: 2rem auto; max-width: 68rem; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 3rem; border-top: 1px solid #ccc; padding-top: 1.5rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 13px; }
th, td { padding: .2rem .55rem; text-align: right; border-bottom: 1px solid #e4e4e8; white-space: nowrap; }
th:first-child, td:first-child, th:nth-child(2), td:nth-child(2) { text-align: left; }
tr.chosen { background: #fff6dd; font-weight: 600; }
.plots, .crops { display: flex; flex-wrap: wrap; gap: 1rem; }
figure { margin: 0; } figcaption { font-size: 12px; color: #555; }
.crops figure { width: 190px; } .crops img { image-rendering: pixelated; width: 190px; display: block; }
.contents td:nth-last-child(-n+2) { text-align: left; }
svg text { font: 11px system-ui, sans-serif; fill: #444; paint-order: stroke; stroke: #fff; stroke-width: 3px; }
.note { color: #666; font-size: 13px; }
";

/// One colour for each value of a knob, the chosen setting first.
const COLOURS: [&str; 7] = ["#1b1d22", "#c4372b", "#1f6fb4", "#2f8f4e", "#9a5bb5", "#d98a00", "#6b7280"];

/// A page of `sheets`, and of the scenes that have none, with the reason.
#[must_use]
pub fn page(title: &str, command: &str, sheets: &[Sheet], without: &[(String, String)]) -> String {
    let mut out = String::new();
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>What accuracy costs: {0}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width\"><style>{STYLE}</style></head><body>\n\
         <h1>What accuracy costs: {0}</h1>\n<p>Made by <code>{1}</code> with Abbe {2}.</p>\n\
         <p class=\"note\">Each knob is moved by itself around the chosen setting, on a small copy of the scene. Noise is √relMSE \
         with its 95 % interval, which is withheld where a picture of one of the rounds has not converged; bias is √relMSE of what several renders have in common against a reference of sixteen times the \
         samples, or a closed form, given where it stands out by three standard errors, else what it is below by as many. Time is the least \
         of the renders (the most in brackets). Efficiency is 1 / (noise² · time) over that of the chosen setting; \
         its standard error counts that of the noise and half of how far the times lie apart, of two renders all of it. In the plots bands are intervals, hollow points are of pictures that have not converged, dashed lines biases, the dotted line the target.</p>\n",
        escaped(title),
        escaped(command),
        env!("CARGO_PKG_VERSION")
    );
    if sheets.len() > 1 {
        contents(&mut out, sheets);
    }
    for (number, sheet) in sheets.iter().enumerate() {
        section(&mut out, number, sheet);
    }
    for (scene, why) in without {
        let _ = writeln!(out, "<h2>{}</h2><p>{}.</p>", escaped(scene), escaped(why));
    }
    out.push_str(
        "<p class=\"note\">Geometry in f32 takes another build, made with the feature \
         <code>single_precision</code>: <code>--beside</code> gives its row.</p>\n</body></html>\n",
    );
    out
}

/// A line for each scene: what it takes, and what of its settings would do better or loses light.
fn contents(out: &mut String, sheets: &[Sheet]) {
    out.push_str(
        "<table class=\"contents\"><thead><tr><th>scene</th><th>time, s</th><th>noise, %</th><th>reference, %</th>\
         <th>soonest without bias</th><th>largest bias</th></tr></thead><tbody>\n",
    );
    for (number, sheet) in sheets.iter().enumerate() {
        let chosen = &sheet.rows[0];
        let moved = || sheet.rows[1..].iter().filter(|row| row.knob != "samples" && row.knob != "file");
        let name = |row: &Row| escaped(&format!("{} {}", row.knob, row.value));
        // Three numbers and other builds are no settings of a scene.
        let is_setting = |row: &Row| row.knob != "transport" && row.knob != "build";
        let sooner = |row: &&Row| {
            let efficiency = row.efficiency;
            is_setting(row) && row.bias().is_none() && efficiency.value > 1.0 && efficiency.is_another_factor()
        };
        let best = moved().filter(sooner).max_by(|a, b| a.efficiency.value.total_cmp(&b.efficiency.value));
        let best = best.map_or("as chosen".into(), |row| format!("{}: {:.2}", name(row), 1.0 / row.efficiency.value));
        let worst = moved().filter_map(|row| Some((row, row.bias()?))).max_by(|a, b| a.1.total_cmp(&b.1));
        let worst = worst.map_or("none".into(), |(row, bias)| format!("{}: {:.1} %", name(row), 100.0 * bias));
        let _ = writeln!(
            out,
            "<tr><td><a href=\"#scene-{number}\">{}</a></td><td>{:.2}</td><td>{:.2}</td><td>{}</td><td>{best}</td><td>{worst}</td></tr>",
            escaped(&sheet.scene),
            chosen.seconds,
            100.0 * chosen.noise[0],
            sheet.reference.map_or("known".into(), |(_, noise)| format!("{:.2}", 100.0 * noise))
        );
    }
    out.push_str("</tbody></table>\n");
}

fn section(out: &mut String, number: usize, sheet: &Sheet) {
    let [width, height] = sheet.size;
    let _ = write!(
        out,
        "<h2 id=\"scene-{number}\">{}</h2>\n<p class=\"note\">{width} × {height} pixels; target {:.2} %; {}.</p>\n<ul>\n",
        escaped(&sheet.scene),
        100.0 * sheet.target,
        held_against(sheet)
    );
    for (knob, sentence) in &sheet.advice {
        let _ = writeln!(out, "<li><b>{}</b>: {}</li>", escaped(knob), escaped(sentence));
    }
    out.push_str("</ul>\n<div class=\"plots\">\n");
    let chosen = &sheet.rows[0];
    for (knob, rows) in knobs(&sheet.rows) {
        if knob != "file" {
            let _ = writeln!(
                out,
                "<figure><figcaption>{}</figcaption>{}</figure>",
                escaped(knob),
                plot(chosen, rows, sheet.target)
            );
        }
    }
    out.push_str("</div>\n<table><thead><tr>");
    for heading in HEADINGS {
        let _ = write!(out, "<th>{heading}</th>");
    }
    out.push_str("</tr></thead><tbody>\n");
    for row in &sheet.rows {
        let class = if row.chosen { " class=\"chosen\"" } else { "" };
        let _ = write!(out, "<tr{class}>");
        for cell in cells(row) {
            let _ = write!(out, "<td>{}</td>", escaped(&cell));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table>\n<h3>How it looks</h3>\n<div class=\"crops\">\n");
    let samples = sheet.reference.map_or("", |_| ", sixteen times the samples");
    let _ = writeln!(
        out,
        "<figure><img alt=\"\" src=\"data:image/png;base64,{}\"><figcaption>no bound to depth{samples}</figcaption></figure>",
        base64(&sheet.png)
    );
    for row in sheet.rows.iter().filter(|row| row.knob != "file") {
        let _ = writeln!(
            out,
            "<figure><img alt=\"\" src=\"data:image/png;base64,{}\"><figcaption>{} {}: {:.2} s, noise {}</figcaption></figure>",
            base64(&row.png),
            escaped(row.knob),
            escaped(&row.value),
            row.seconds,
            if row.meets_light() { format!("{:.2} %", 100.0 * row.noise[0]) } else { UNKNOWN.to_owned() }
        );
    }
    out.push_str("</div>\n");
}

/// What the scene's pictures are held against.
#[must_use]
pub fn held_against(sheet: &Sheet) -> String {
    let truth = match sheet.reference {
        Some((samples, noise)) => format!("reference of {samples} samples a pixel, noise {:.2} %", 100.0 * noise),
        None => "the truth is known in closed form".to_owned(),
    };
    truth + if sheet.bands { "; of the colours, as the PNG has them, not of image.bands" } else { "" }
}

/// The columns of the table.
pub const HEADINGS: [&str; 10] =
    ["knob", "value", "samples", "time, s", "noise, %", "95 %", "bias, %", "R, G, B", "efficiency", "to target, s"];

/// What no figure is known of.
const UNKNOWN: &str = "unknown";

/// A row of the table.
#[must_use]
pub fn cells(row: &Row) -> [String; 10] {
    let per_cent = |x: f64| format!("{:.2}", 100.0 * x);
    let light: Vec<String> = row.light.iter().map(|f| format!("{:.3}", f.value)).collect();
    [
        row.knob.to_owned(),
        row.value.clone(),
        row.samples.to_string(),
        format!("{:.3} ({:.3})", row.seconds, row.most_seconds),
        if row.meets_light() { per_cent(row.noise[0]) } else { UNKNOWN.to_owned() },
        match row.converged {
            true => format!("{}-{}", per_cent(row.noise[1]), per_cent(row.noise[2])),
            false => "not converged".to_owned(),
        },
        row.bias().map_or(format!("<{}", per_cent(row.bias_bound())), per_cent),
        light.join(" "),
        match row.efficiency {
            Figure { value, .. } if value.is_nan() => UNKNOWN.to_owned(),
            Figure { value, .. } if !value.is_finite() => "no noise".to_owned(),
            // Of a single round nobody knows how far times lie apart.
            Figure { value, error } if !error.is_finite() => format!("{value:.2} ± ?"),
            Figure { value, error } => format!("{value:.2} ± {error:.2}"),
        },
        match row.to_target {
            Some(t) => format!("{t:.2}"),
            None if row.meets_light() => "never".to_owned(),
            None => UNKNOWN.to_owned(),
        },
    ]
}

/// The rows of each knob, without the chosen setting.
fn knobs(rows: &[Row]) -> Vec<(&'static str, &[Row])> {
    rows[1..].chunk_by(|a, b| a.knob == b.knob).map(|rows| (rows[0].knob, rows)).collect()
}

/// Error against time, both in powers of ten: a curve with its interval for each value, bias as a dashed line, the target dotted.
fn plot(chosen: &Row, rows: &[Row], target: f64) -> String {
    const SIZE: [f64; 2] = [330.0, 240.0];
    const MARGIN: [f64; 4] = [44.0, 8.0, 10.0, 30.0]; // left, right, top, bottom
    let all = || std::iter::once(chosen).chain(rows);
    let points = || all().flat_map(|row| &row.curve);
    let biases = || all().filter_map(Row::bias);
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values
            .filter(|x| *x > 0.0 && x.is_finite())
            .map(libm::log10)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        if low < high { (low - 0.05, high + 0.05) } else { (low.min(0.0) - 1.0, high.max(0.0) + 1.0) }
    };
    let (x0, x1) = ends(&mut points().map(|p| p.seconds));
    let (y0, y1) = ends(&mut points().flat_map(|p| p.noise).chain(biases()).chain([target]));
    let x = |seconds: f64| MARGIN[0] + (libm::log10(seconds) - x0) / (x1 - x0) * (SIZE[0] - MARGIN[0] - MARGIN[1]);
    let y = |error: f64| {
        let at = ((libm::log10(error.max(1e-300)) - y0) / (y1 - y0)).max(0.0);
        SIZE[1] - MARGIN[3] - at * (SIZE[1] - MARGIN[2] - MARGIN[3])
    };
    let mut svg = format!("<svg viewBox=\"0 0 {} {}\" width=\"{}\" height=\"{}\">", SIZE[0], SIZE[1], SIZE[0], SIZE[1]);
    let (left, right) = (MARGIN[0], SIZE[0] - MARGIN[1]);
    let (top, bottom) = (MARGIN[2], SIZE[1] - MARGIN[3]);
    for (value, mark) in ticks(y0 + 2.0, y1 + 2.0) {
        let at = y(value * 0.01);
        let _ = write!(
            svg,
            "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#e4e4e8\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{mark} %</text>",
            left - 4.0,
            at + 4.0
        );
    }
    for (value, mark) in ticks(x0, x1) {
        let at = x(value);
        let _ = write!(
            svg,
            "<path d=\"M{at:.1} {top}V{bottom}\" stroke=\"#e4e4e8\"/><text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{mark} s</text>",
            bottom + 14.0
        );
    }
    let _ = write!(svg, "<path d=\"M{left} {0:.1}H{right}\" stroke=\"#888\" stroke-dasharray=\"1 3\"/>", y(target));
    for (i, row) in all().enumerate() {
        let colour = COLOURS[i.min(COLOURS.len() - 1)];
        // Powers of ten have no place for a noise of 0, such as of samples that met no light.
        let shown = || row.curve.iter().filter(|p| p.seconds > 0.0 && p.noise[0] > 0.0);
        let path = |of: usize, reverse: bool| {
            let at = |p: &super::Point| format!("{:.1} {:.1}", x(p.seconds), y(p.noise[of]));
            let mut steps: Vec<String> = shown().filter(|p| of == 0 || p.converged).map(at).collect();
            if reverse {
                steps.reverse();
            }
            steps.join("L")
        };
        if shown().any(|p| p.converged) {
            let (low, high) = (path(1, false), path(2, true));
            let _ = write!(svg, "<path d=\"M{low}L{high}Z\" fill=\"{colour}\" opacity=\"0.12\"/>");
        }
        if shown().next().is_some() {
            let line = path(0, false);
            let _ = write!(svg, "<path d=\"M{line}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>");
        }
        for p in shown() {
            let fill = if p.converged { colour } else { "#fff" };
            let _ = write!(
                svg,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2\" fill=\"{fill}\" stroke=\"{colour}\"/>",
                x(p.seconds),
                y(p.noise[0])
            );
        }
        if let Some(bias) = row.bias() {
            let _ = write!(
                svg,
                "<path d=\"M{left} {0:.1}H{right}\" stroke=\"{colour}\" stroke-dasharray=\"6 4\"/>",
                y(bias)
            );
        }
        let label = if row.chosen { "chosen" } else { &row.value };
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" style=\"fill:{colour}\">{}</text>",
            right - 4.0,
            top + 12.0 + 13.0 * i as f64,
            escaped(label)
        );
    }
    svg.push_str("</svg>");
    svg
}

/// Powers of ten, twice and five times them, between 10^`low` and 10^`high`; powers alone where those are more than eight.
fn ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let (low, high) = (libm::exp10(low), libm::exp10(high));
    let decades = libm::floor(libm::log10(low)) as i32..=libm::ceil(libm::log10(high)) as i32;
    let of = |steps: &'static [f64]| {
        let value = move |decade: i32| steps.iter().map(move |step| step * libm::exp10(f64::from(decade)));
        decades.clone().flat_map(value).filter(|v| (low..=high).contains(v)).collect::<Vec<f64>>()
    };
    let fine = of(&[1.0, 2.0, 5.0]);
    let values = if fine.len() <= 8 { fine } else { of(&[1.0]) };
    values.into_iter().map(|v| (v, round(v))).collect()
}

/// A number of one figure.
fn round(x: f64) -> String {
    match x {
        1.0.. => format!("{x:.0}"),
        1e-3.. => format!("{x:.3}").trim_end_matches('0').to_owned(),
        _ => format!("{x:.0e}"),
    }
}

/// Text in HTML, also within quotes.
pub(in crate::batch) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// RFC 4648, section 4.
pub(in crate::batch) fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let all = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let letter = LETTERS[(all >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= three.len() { char::from(letter) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::Point;
    use super::*;

    /// The vectors of RFC 4648, section 10.
    #[test]
    fn base64_is_that_of_the_rfc() {
        for (text, code) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(text.as_bytes()), code);
        }
    }

    #[test]
    fn where_no_light_was_met_nothing_is_told_of_noise() {
        let point = |noise| Point { samples: 16, seconds: 0.1, noise: [noise; 3], converged: false };
        let unknown = Figure { value: f64::NAN, error: f64::NAN };
        let nothing = Figure { value: 0.0, error: 0.0 };
        let dark = Row {
            knob: "sampler",
            value: "independent".into(),
            chosen: false,
            samples: 16,
            seconds: 0.1,
            most_seconds: 0.2,
            noise: [f64::NAN; 3],
            converged: false,
            bias_squared: nothing,
            light: [nothing; 3],
            efficiency: unknown,
            to_target: None,
            curve: vec![point(0.0)],
            png: Vec::new(),
        };
        let [.., noise, interval, _, _, efficiency, to_target] = cells(&dark);
        assert_eq!([noise, interval, efficiency, to_target], ["unknown", "not converged", "unknown", "unknown"]);
        let chosen = Row { noise: [0.1; 3], curve: vec![point(0.1)], ..dark.clone() };
        let svg = plot(&chosen, &[dark], 0.1);
        assert_eq!((svg.matches("<circle").count(), svg.contains("NaN")), (1, false), "{svg}");
    }

    #[test]
    fn ticks_are_round_and_few() {
        let marks: Vec<String> = ticks(0.0, 1.0).into_iter().map(|t| t.1).collect();
        assert_eq!(marks, ["1", "2", "5", "10"]);
        assert!(ticks(-6.0, 3.0).len() <= 10);
        let marks: Vec<String> = ticks(-3.9, -2.1).into_iter().map(|t| t.1).collect();
        assert_eq!(marks, ["2e-4", "5e-4", "0.001", "0.002", "0.005"]);
    }
}
