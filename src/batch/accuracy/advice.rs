//! What the figures of a sheet say in words.

use super::{Row, knobs};

/// What each knob buys, in a sentence.
#[must_use]
pub fn sentences(rows: &[Row]) -> Vec<(&'static str, String)> {
    let chosen = &rows[0];
    let of = |rows: &[Row]| {
        let knob = rows[0].knob;
        let words = match knob {
            "file" if rows[0].value == knobs::FULL => {
                "half precision cannot hold the brightest pixels: files are in float".to_owned()
            }
            "file" => format!("half precision adds an error of {:.3} %", 100.0 * rows[0].bias_squared.value.sqrt()),
            "samples" => convergence(chosen, rows),
            _ => trade(chosen, rows),
        };
        let note = knobs::note(knob).map_or(String::new(), |note| format!(" ({note})"));
        (knob, format!("{words}{note}."))
    };
    rows[1..].chunk_by(|a, b| a.knob == b.knob).map(of).collect()
}

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

/// "a", "a and b", "a, b and c".
fn list(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// How noise falls with samples: from the fewest to the most.
fn convergence(chosen: &Row, rows: &[Row]) -> String {
    let all = || rows.iter().chain([chosen]).filter(|row| row.meets_light());
    let (Some(few), Some(many)) = (all().min_by_key(|r| r.samples), all().max_by_key(|r| r.samples)) else {
        return String::new();
    };
    let ratio = f64::from(many.samples) / f64::from(few.samples);
    let exponent = 2.0 * libm::log(few.noise[0] / many.noise[0]) / libm::log(ratio);
    let told = format!(
        "{} times the samples take {} of the time for {} of the noise: {}",
        ratio.round(),
        figures(many.seconds / few.seconds),
        figures(many.noise[0] / few.noise[0]),
        if exponent > 0.0 { format!("variance falls as samples^-{exponent:.2}") } else { "it does not fall".into() }
    );
    in_the_dark(rows).into_iter().chain((ratio > 1.0).then_some(told)).collect::<Vec<_>>().join("; ")
}

/// Which settings meet no light, if any: of their noise nothing is known.
fn in_the_dark(rows: &[Row]) -> Option<String> {
    let dark: Vec<String> = rows.iter().filter(|row| !row.meets_light()).map(|row| row.value.clone()).collect();
    let verb = if dark.len() == 1 { "meets" } else { "meet" };
    (!dark.is_empty()).then(|| format!("{} {verb} no light", list(&dark)))
}

/// What a setting finds in place of the truth, and in what time; nothing if no more than that.
fn off(chosen: &Row, row: &Row) -> Option<String> {
    let shifts: Vec<String> = row
        .colour_shift()
        .iter()
        .map(|(name, x)| format!("{:.1} % {} {name}", 100.0 * x.abs(), if *x < 0.0 { "less" } else { "more" }))
        .collect();
    let bias = row.bias().map(|bias| format!("{:.1} %", 100.0 * bias));
    let found = match (shifts.as_slice(), bias) {
        ([], None) => return None,
        ([], Some(bias)) => format!("has a bias of {bias}"),
        (shifts, Some(bias)) => format!("finds {} (bias {bias})", list(shifts)),
        (shifts, None) => format!("finds {}", list(shifts)),
    };
    Some(format!("{} {found} in {} of the time", row.value, figures(row.seconds / chosen.seconds)))
}

/// What is lost, what is the same, and what comes to the same noise sooner or later. What the chosen setting lacks as well is no
/// matter of the knob. Where that lacks nothing that stands out, perhaps for its noise, the two may still differ.
fn trade(chosen: &Row, rows: &[Row]) -> String {
    let lacking = off(chosen, chosen).is_some();
    let mut parts: Vec<String> = in_the_dark(rows).into_iter().collect();
    let (mut same, mut as_chosen): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    let mut speed: Vec<String> = Vec::new();
    for row in rows.iter().filter(|row| row.meets_light()) {
        let alike = match off(chosen, row) {
            None => &mut same,
            Some(_) if row.finds_as(chosen) => &mut as_chosen,
            Some(words) => {
                parts.push(words);
                continue;
            }
        };
        alike.push(row.value.clone());
        if !row.efficiency.value.is_finite() {
            speed.push(format!("{} has no noise", row.value));
        } else if row.efficiency.is_another_factor() {
            speed.push(format!("{} takes {} of the time", row.value, figures(1.0 / row.efficiency.value)));
        }
    }
    let as_what = match lacking {
        true => ["finds what the chosen setting finds", "find what the chosen setting finds"],
        false => [
            "stands out from the reference but not from the chosen setting",
            "stand out from the reference but not from the chosen setting",
        ],
    };
    for (values, [one, several]) in [(&same, ["finds the same light", "find the same light"]), (&as_chosen, as_what)] {
        if !values.is_empty() {
            parts.push(format!("{} {}", list(values), if values.len() == 1 { one } else { several }));
        }
    }
    if !same.is_empty() || !as_chosen.is_empty() {
        parts.push(match speed.as_slice() {
            [] => "what that takes to the same noise cannot be told from the chosen setting".to_owned(),
            told => format!("to the same noise {}", list(told)),
        });
    }
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::accuracy::Figure;

    fn row(knob: &'static str, value: &str, seconds: f64, noise: f64, bias_squared: f64, green: f64) -> Row {
        let light = [1.0, green, 1.0].map(|value| Figure { value, error: 0.001 });
        Row {
            knob,
            value: value.into(),
            chosen: knob == "chosen",
            samples: 64,
            seconds,
            most_seconds: seconds,
            noise: [noise; 3],
            converged: true,
            bias_squared: Figure { value: bias_squared, error: 1e-6 },
            light,
            efficiency: Figure { value: 1.0 / (seconds * noise * noise), error: 0.05 },
            to_target: None,
            curve: Vec::new(),
            png: Vec::new(),
        }
    }

    #[test]
    fn numbers_have_two_or_three_figures_whatever_they_round_to() {
        let said = [0.996, 1.234, 9.94, 9.96, 99.4, 99.6, 1234.0].map(figures);
        assert_eq!(said, ["1.00", "1.23", "9.94", "10.0", "99.4", "100", "1234"]);
    }

    #[test]
    fn a_sentence_tells_what_is_lost_what_is_the_same_and_what_it_takes() {
        let rows = [
            row("chosen", "as written", 1.0, 1.0, 0.0, 1.0),
            row("depth", "2", 0.25, 0.5, 0.04, 0.7),
            row("depth", "8", 0.8, 1.0, 0.0, 1.001),
            row("depth", "16", 0.99, 1.0, 0.0, 1.0),
            row("effects", "all", 1.01, 1.0, 0.0, 1.0),
        ];
        let sentences = sentences(&rows);
        assert_eq!(
            sentences[0].1,
            "2 finds 30.0 % less green (bias 20.0 %) in 0.25 of the time; 8 and 16 find the same light; to the same \
             noise 8 takes 0.80 of the time."
        );
        assert_eq!(
            sentences[1].1,
            "all finds the same light; what that takes to the same noise cannot be told from the chosen setting."
        );
    }

    #[test]
    fn a_knob_is_not_blamed_for_what_the_chosen_setting_lacks() {
        let rows = [
            row("chosen", "as written", 1.0, 1.0, 0.04, 0.7),
            row("sampler", "independent", 2.0, 1.0, 0.04, 0.7005),
            row("depth", "8", 2.0, 1.0, 0.0, 1.0),
            row("depth", "1", 0.5, 1.0, 0.09, 0.5),
        ];
        let sentences = sentences(&rows);
        assert_eq!(
            sentences[0].1,
            "independent finds what the chosen setting finds; to the same noise independent takes 2.00 of the time."
        );
        assert_eq!(
            sentences[1].1,
            "1 finds 50.0 % less green (bias 30.0 %) in 0.50 of the time; 8 finds the same light; to the same noise 8 \
             takes 2.00 of the time."
        );
    }

    /// Errors of factors are relative: 0.2 and 5 known to the half of themselves are told, known to themselves not, and 1.4 to the tenth.
    #[test]
    fn a_factor_is_told_where_it_stands_out_of_its_relative_error() {
        let told = [(0.2, 0.1), (0.2, 0.2), (5.0, 2.5), (5.0, 5.0), (1.4, 0.1), (1.2, 0.1)]
            .map(|(value, error)| Figure { value, error }.is_another_factor());
        assert_eq!(told, [true, false, true, false, true, false]);
    }

    /// The chosen setting is so noisy that it may have the bias that stands out of the knob, or none.
    #[test]
    fn a_bias_that_stands_out_is_not_said_to_be_that_of_a_noisy_setting() {
        let chosen =
            Row { bias_squared: Figure { value: 0.0, error: 2e-4 }, ..row("chosen", "as written", 1.0, 1.0, 0.0, 1.0) };
        let rows = [chosen, row("transport", "RGB", 1.5, 0.5, 4e-4, 1.003)];
        assert!(rows[1].bias().is_some() && rows[1].finds_as(&rows[0]));
        let (_, sentence) = &sentences(&rows)[0];
        assert!(
            sentence
                .starts_with("RGB stands out from the reference but not from the chosen setting; to the same noise"),
            "{sentence}"
        );
    }

    /// Light so rare that few samples miss it: that they agree on black is no noise of 0, and no variance falls from there.
    #[test]
    fn a_setting_that_meets_no_light_is_not_said_to_be_without_noise() {
        let unknown = Figure { value: f64::NAN, error: f64::NAN };
        let dark = |knob, value, samples| Row {
            samples,
            noise: [f64::NAN; 3],
            efficiency: unknown,
            light: [Figure { value: 0.0, error: 0.0 }; 3],
            ..row(knob, value, 0.25, 1.0, 0.0, 0.0)
        };
        let more = |noise| Row { samples: 256, ..row("samples", "x 4", 4.0, noise, 0.0, 1.0) };
        let chosen = || row("chosen", "as written", 1.0, 1.0, 0.0, 1.0);
        let told = |rows: &[Row]| sentences(rows)[0].1.clone();
        let begin = "x 1/4 and x 1/2 meet no light; 4 times the samples take 4.00 of the time for";
        for (noise, end) in [
            (0.5, "0.50 of the noise: variance falls as samples^-1.00."),
            (2.0, "2.00 of the noise: it does not fall."),
        ] {
            let rows = [chosen(), dark("samples", "x 1/4", 16), dark("samples", "x 1/2", 32), more(noise)];
            assert_eq!(told(&rows), format!("{begin} {end}"));
        }
        assert_eq!(told(&[chosen(), dark("samples", "x 1/4", 16)]), "x 1/4 meets no light.");
        let rows = [chosen(), dark("sampler", "independent", 64)];
        assert_eq!(told(&rows), "independent meets no light.");
        assert_eq!(rows[1].reaches(0.1, 0.0), None);
    }

    #[test]
    fn samples_tell_how_variance_falls() {
        let many = Row { samples: 256, ..row("samples", "x 4", 4.0, 0.5, 0.0, 1.0) };
        let [(_, sentence)] = &sentences(&[row("chosen", "as written", 1.0, 1.0, 0.0, 1.0), many])[..] else {
            panic!()
        };
        assert!(sentence.starts_with("4 times the samples take 4.00 of the time for 0.50 of the noise"), "{sentence}");
        assert!(sentence.ends_with("samples^-1.00."), "{sentence}");
    }
}
