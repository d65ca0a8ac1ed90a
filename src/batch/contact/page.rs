//! The page of a contact sheet: one file of HTML that opens from disk.

use super::{Card, EMBEDDED, encode, link};
use crate::batch::accuracy::page::{base64, escaped};
use crate::batch::report::{Report, SceneReport, Status};
use crate::batch::words;
use crate::film::heat::Small;
use crate::transport::plan::Effect;
use std::io::Write;
use std::path::Path;

/// Figures of a picture.
#[derive(Clone, Copy)]
pub(super) struct Figures {
    /// Of a pixel, in the mean.
    samples: f64,
    seconds: f64,
    /// The error and the ends of its interval.
    error: Option<[f64; 3]>,
    valid: bool,
    halving_seconds: Option<f64>,
}

impl Figures {
    pub(super) fn of(scene: &SceneReport) -> Figures {
        let valid = scene.error.is_some_and(|e| e.valid);
        Figures {
            samples: scene.adaptive.as_ref().map_or(scene.samples.into(), |counts| (10.0 * counts.mean).round() / 10.0),
            seconds: scene.seconds.rendering,
            error: scene.error.map(|e| [e.rel_rmse, e.low, e.high]),
            valid,
            halving_seconds: scene.halving_seconds.filter(|s| s.is_finite() && valid),
        }
    }

    /// One short line.
    pub(super) fn short(&self) -> String {
        let error = match self.error {
            Some([error, ..]) if self.valid => format!(", {}", words::per_cent(error)),
            Some(_) => ", noisy".to_owned(),
            None => String::new(),
        };
        format!("{} spp{error}, {}", self.samples, words::seconds(self.seconds))
    }

    /// The error in words.
    fn error(&self, scene: &SceneReport) -> String {
        match (self.error, scene.integrator.as_str()) {
            (Some([error, low, high]), _) if self.valid => {
                format!("{} ({} to {})", words::per_cent(error), words::per_cent(low), words::per_cent(high))
            }
            (Some(_), _) => "not converged".to_owned(),
            (None, "whitted") => "no noise".to_owned(),
            (None, _) => "unknown".to_owned(),
        }
    }

    /// How much the eye will see of it: below 2 % little, above 10 % much.
    fn class(&self, scene: &SceneReport) -> &'static str {
        match self.error {
            Some([error, ..]) if self.valid && error <= 0.02 => "good",
            Some([error, ..]) if self.valid && error <= 0.1 => "fair",
            Some(_) => "poor",
            None if scene.integrator == "whitted" => "good",
            None => "",
        }
    }
}

fn plural(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
}

/// Writes the page of `cards` for the directory `dir`, figure by figure: those of a long batch are large together.
pub(super) fn write(out: &mut dyn Write, cards: &[Card], dir: &Path, report: &Report) -> std::io::Result<()> {
    let embed = cards.len() <= EMBEDDED;
    let maps = cards.iter().any(|card| card.error_map.is_some());
    let scene = |card: &Card| &report.scenes[card.scene];
    let mut pieces = include_str!("page.html").split("{{");
    out.write_all(pieces.next().unwrap_or_default().as_bytes())?;
    for piece in pieces {
        let (field, text) = piece.split_once("}}").expect("each field of page.html is closed");
        match field {
            "title" => {
                let title = report.source.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
                out.write_all(escaped(&title).as_bytes())?;
            }
            "about" => out.write_all(escaped(&about(cards, report)).as_bytes())?,
            "summary" => out.write_all(summary(cards, report).as_bytes())?,
            "faults" => out.write_all(faults(report).as_bytes())?,
            "switch" if maps => {
                out.write_all(b"<label class=\"switch\"><input type=\"checkbox\" id=\"maps\"> error maps</label>")?;
            }
            "scale" if maps => out.write_all(
                b"<p class=\"scale\"><span>0.1 %</span><i></i><span>100 %</span> relative standard error of a pixel, grey where \
                  unknown</p>",
            )?,
            "options" => {
                for (i, card) in cards.iter().enumerate() {
                    write!(out, "<option value=\"{i}\">{}</option>", escaped(&scene(card).label()))?;
                }
            }
            "rows" => {
                for (i, card) in cards.iter().enumerate() {
                    out.write_all(row(i, scene(card)).as_bytes())?;
                }
            }
            "figures" => {
                for (i, card) in cards.iter().enumerate() {
                    out.write_all(figure(i, card, scene(card), dir, embed).as_bytes())?;
                }
            }
            "switch" | "scale" => {}
            other => unreachable!("page.html asks for {other}"),
        }
        out.write_all(text.as_bytes())?;
    }
    Ok(())
}

/// How many pictures, in what time, and of which version.
fn about(cards: &[Card], report: &Report) -> String {
    let there = cards.iter().filter(|card| matches!(report.scenes[card.scene].status, Status::Skipped)).count();
    let mut about = vec![
        plural(cards.len(), "picture"),
        format!("{} on {}", words::seconds(report.seconds), plural(report.threads, "thread")),
        format!("Abbe {}", report.version),
    ];
    if there > 0 {
        about.insert(1, format!("{there} of them were there already"));
    }
    about.join(" · ")
}

/// A list of what failed, if anything did.
fn faults(report: &Report) -> String {
    let fault = |scene: &SceneReport| match &scene.status {
        Status::Failed { message, .. } => {
            Some(format!("<li><b>{}</b> {}</li>\n", escaped(&scene.label()), escaped(message)))
        }
        Status::Done | Status::Skipped => None,
    };
    let faults: String = report.scenes.iter().filter_map(fault).collect();
    if faults.is_empty() {
        return faults;
    }
    format!("<ul class=\"faults\" aria-label=\"What failed\">\n{faults}</ul>")
}

/// What the figures say together: which picture is the noisiest, and what it would cost to halve all errors.
fn summary(cards: &[Card], report: &Report) -> String {
    let all: Vec<(String, Figures)> =
        cards.iter().map(|card| (report.scenes[card.scene].label(), Figures::of(&report.scenes[card.scene]))).collect();
    let mut sentences = Vec::new();
    let known = || all.iter().filter_map(|(name, f)| Some((name, f.error.filter(|_| f.valid)?[0])));
    let by_error = |a: &(&String, f64), b: &(&String, f64)| a.1.total_cmp(&b.1);
    if let (Some(best), Some(worst)) = (known().min_by(by_error), known().max_by(by_error))
        && best.0 != worst.0
    {
        sentences.push(format!(
            "Errors go from {} (<b>{}</b>) to {} (<b>{}</b>).",
            words::per_cent(best.1),
            escaped(best.0),
            words::per_cent(worst.1),
            escaped(worst.0)
        ));
    }
    let halving: f64 = all.iter().filter_map(|(_, f)| f.halving_seconds).sum();
    if halving > 0.0 {
        let costliest = all.iter().filter_map(|(name, f)| Some((name, f.halving_seconds?)));
        if let Some((name, seconds)) = costliest.max_by(|a, b| a.1.total_cmp(&b.1)) {
            sentences.push(format!(
                "To halve every error would take {} more, {} of it for <b>{}</b>.",
                words::seconds(halving),
                words::seconds(seconds),
                escaped(name)
            ));
        }
    }
    let doubtful = all.iter().filter(|(_, f)| f.error.is_some() && !f.valid).count();
    if doubtful > 0 {
        sentences.push(format!(
            "{} not converged: more samples are needed before an error can be stated.",
            match doubtful {
                1 => "One has".to_owned(),
                n => format!("{n} have"),
            }
        ));
    }
    sentences.join(" ")
}

fn data(small: &Small) -> String {
    encode(small).map_or_else(|_| String::new(), |bytes| format!("data:image/png;base64,{}", base64(&bytes)))
}

fn figure(i: usize, card: &Card, scene: &SceneReport, dir: &Path, embed: bool) -> String {
    let figures = Figures::of(scene);
    let name = escaped(&scene.label());
    let full = escaped(&link(dir, &card.png));
    let source = if embed { data(&card.thumbnail) } else { full.clone() };
    let map = match &card.error_map {
        Some(map) => format!(" data-map=\"{}\"", data(map)),
        None => String::new(),
    };
    let [width, height] = scene.resolution;
    let half = figures.halving_seconds.map_or(String::new(), |s| format!(", half of it in {} more", words::seconds(s)));
    let chip = |e: &Effect| format!("<li title=\"{}\">{}</li>", escaped(&e.reason), escaped(&e.name));
    let chips: String = scene.effects.iter().filter(|e| e.on).map(chip).collect();
    let developed = scene
        .png
        .filter(|png| png.metered)
        .map_or(String::new(), |png| format!("<p>exposure {:+} stops, metered</p>", png.exposure_stops));
    let plan: String = scene
        .effects
        .iter()
        .chain(scene.techniques.iter())
        .map(|e| {
            let state = if e.on { "on" } else { "off" };
            format!("<tr class=\"{state}\"><td>{}<td>{state}<td>{}", escaped(&e.name), escaped(&e.reason))
        })
        .collect();
    let notes: String = scene.notes.iter().map(|note| format!("<p class=\"note\">{}</p>", escaped(note))).collect();
    format!(
        "<figure id=\"f{i}\"><a href=\"{full}\"><img loading=\"lazy\" alt=\"{name}\" src=\"{source}\" data-full=\"{full}\"{map}></a>\
         <figcaption><h3>{name}</h3><p>{width} × {height} · {} samples · {}</p>\
         <p class=\"error {}\">{}{half}</p>{developed}<ul class=\"chips\">{chips}</ul>\
         <p class=\"pick\"><button data-pick=\"a\" data-i=\"{i}\">before</button>\
         <button data-pick=\"b\" data-i=\"{i}\">after</button> <a href=\"{}\">EXR</a></p>\
         <details><summary>Plan{}</summary><table>{plan}</table>{notes}</details></figcaption></figure>\n",
        figures.samples,
        words::seconds(figures.seconds),
        figures.class(scene),
        escaped(&figures.error(scene)),
        escaped(&link(dir, &card.exr)),
        if scene.notes.is_empty() { String::new() } else { format!(", {}", plural(scene.notes.len(), "note")) },
    )
}

/// A line of the table; numbers to sort by stand in `data-v`.
fn row(i: usize, scene: &SceneReport) -> String {
    let figures = Figures::of(scene);
    let [width, height] = scene.resolution;
    let pixels = f64::from(width) * f64::from(height);
    let cell = |value: f64, text: &str| format!("<td data-v=\"{value}\">{text}");
    let on: Vec<&str> = scene.effects_in_force();
    let mut out = format!("<tr><td data-v=\"{i}\"><a href=\"#f{i}\">{}</a>", escaped(&scene.label()));
    out += &cell(pixels, &format!("{width} × {height}"));
    out += &cell(figures.samples, &figures.samples.to_string());
    out += &cell(figures.seconds, &words::seconds(figures.seconds));
    out += &cell(figures.error.map_or(-1.0, |e| e[0]), &escaped(&figures.error(scene)));
    let half = figures.halving_seconds;
    out += &cell(half.unwrap_or(-1.0), &half.map_or("-".to_owned(), |s| format!("+{}", words::seconds(s))));
    out + &format!("<td>{}\n", escaped(&on.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::report::SampleCounts;

    #[test]
    fn samples_that_are_shared_out_stand_by_their_mean() {
        let mut report = SceneReport::new("a", None);
        report.samples = 64;
        assert!(Figures::of(&report).short().starts_with("64 spp"));
        report.adaptive = Some(SampleCounts { least: 16, mean: 37.46, most: 256 });
        assert!(Figures::of(&report).short().starts_with("37.5 spp"));
        assert!(row(0, &report).contains("<td data-v=\"37.5\">37.5"));
    }
}
