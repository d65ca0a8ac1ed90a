//! Which channels of two files are held against each other.

use super::noise::{Known, Pair};
use super::{CompareOptions, Origin};
use crate::film::Window;
use crate::film::accumulate::REPLICATES;
use crate::film::exr::{BANDS, ExrFile, ExrPart, SHARED_ERRORS, part, stderr_name};
use crate::spectrum::colour;
use std::collections::BTreeSet;

/// What is to be compared, or why nothing can be.
pub(super) fn pairs<'a>(a: &'a ExrFile, b: &'a ExrFile, options: &CompareOptions<'a>) -> Result<Vec<Pair<'a>>, String> {
    for (name, file) in [("A", a), ("B", b)] {
        if file.parts[0].text(part::JSON).is_some() {
            return Err(format!(
                "{name} holds sums of a part or a checkpoint, no light: `abbe merge` makes a picture of it"
            ));
        }
    }
    let (window_a, window_b) = (a.parts[0].window, b.parts[0].window);
    same_window("data windows", window_a, window_b, options.origin)?;
    same_window("display windows", a.display, b.display, options.origin)?;
    let names = compared_names(a, b)?;
    // X, Y, Z and bands are the same in any primaries.
    if are_colours([a, b]) && names.iter().any(|name| ["R", "G", "B"].contains(&name.as_str())) {
        same_colours(a, b)?;
    }
    let variance = match options.sample_variance {
        None => None,
        Some((_, 0)) => return Err("a variance per sample needs the number of samples a pixel".to_string()),
        Some((file, samples)) => {
            same_window("windows of picture and variance", window_a, file.parts[0].window, Origin::Ignore)?;
            Some((file, samples))
        }
    };
    let mut pairs = Vec::new();
    for name in names {
        let samples = |file: &'a ExrFile| parts(file).find_map(|part| part.samples(&name));
        let floats = |file: &'a ExrFile, name: &str| parts(file).find_map(|part| part.channel(name));
        let (Some(samples_a), Some(samples_b)) = (samples(a), samples(b)) else { continue };
        let variance = match variance {
            None => None,
            Some((file, samples)) => {
                let plane = floats(file, &name).ok_or(format!("the variance file has no channel {name}"))?;
                Some((plane, samples))
            }
        };
        let errors = [a, b].map(|file| floats(file, &stderr_name(&name)));
        let known = [a, b].map(|file| Known { shared: shared(file), dof: degrees(file) });
        pairs.push(Pair::new(name, [samples_a, samples_b], errors, known, window_a.width, variance));
    }
    Ok(pairs)
}

/// The parts of a file that hold the same pixels as the first.
fn parts(file: &ExrFile) -> impl Iterator<Item = &ExrPart> {
    file.parts.iter().filter(|part| part.window == file.parts[0].window)
}

/// What a file says under `name`.
fn said<T: std::str::FromStr>(file: &ExrFile, name: &str) -> Option<T> {
    file.parts.iter().find_map(|part| part.text(name))?.parse().ok()
}

/// How many times the variance of the sum of all pixels is that of independent ones, by what the file says.
fn shared(file: &ExrFile) -> f64 {
    said(file, SHARED_ERRORS).filter(|x: &f64| x.is_finite()).map_or(1.0, |x| x.max(1.0))
}

/// Degrees of freedom of a standard error: of samples that are fewer than the replicates each is one.
fn degrees(file: &ExrFile) -> f64 {
    let replicates = said(file, "abbe/samples").unwrap_or(REPLICATES).clamp(2, REPLICATES);
    (replicates - 1) as f64
}

/// The channels of `file` but for those of `names` and their standard errors.
pub(super) fn not_compared<'a>(file: &'a ExrFile, names: &'a [&str]) -> impl Iterator<Item = String> + 'a {
    let looked_at = move |name: &str| names.contains(&name.strip_prefix("stderr.").unwrap_or(name));
    file.parts.iter().flat_map(move |part| {
        // Of channels with one name in several parts the first is taken.
        let taken =
            move |name: &str| parts(file).find(|p| p.channel(name).is_some()).is_some_and(|p| std::ptr::eq(p, part));
        let left = part.channels.iter().filter(move |(name, _)| !(looked_at(name) && taken(name)));
        left.map(move |(name, _)| match &part.name {
            Some(part) if looked_at(name) => format!("{part}: {name}"),
            _ => name.clone(),
        })
    })
}

fn same_window(what: &str, a: Window, b: Window, origin: Origin) -> Result<(), String> {
    let sizes_agree = a.width == b.width && a.height == b.height;
    if a == b || (sizes_agree && origin == Origin::Ignore) {
        return Ok(());
    }
    Err(format!("the {what} differ: {a} against {b}"))
}

fn same_colours(a: &ExrFile, b: &ExrFile) -> Result<(), String> {
    let (a, b) = (a.primaries(), b.primaries());
    if colour::are_same_primaries(a, b) {
        return Ok(());
    }
    let words = |all: [[f64; 2]; 4]| all.map(|[x, y]| format!("({x:.4}, {y:.4})")).join(" ");
    Err(format!("the colour primaries differ: {} against {}", words(a), words(b)))
}

fn compared_names(a: &ExrFile, b: &ExrFile) -> Result<Vec<String>, String> {
    let (of_a, of_b) = (own_names(a), own_names(b));
    if of_a.is_empty() && of_b.is_empty() {
        return Err("neither file holds light".to_owned());
    }
    if BTreeSet::from_iter(&of_a) != BTreeSet::from_iter(&of_b) {
        let list = |names: &[String]| if names.is_empty() { "none of light".to_owned() } else { names.join(", ") };
        return Err(format!("the channels differ: {} against {}", list(&of_a), list(&of_b)));
    }
    Ok(of_a)
}

/// Whether a channel of the `files` that is called as a colour, or alpha, is one: not in data, and not where bands stand in
/// place of colours, which may have any names.
pub(super) fn are_colours(files: [&ExrFile; 2]) -> bool {
    let is_data = |file: &ExrFile| file.parts[0].text("colorInteropID") == Some("data");
    !files.into_iter().any(|file| is_data(file) || file.parts[0].text(BANDS).is_some())
}

/// The channels of a picture that are compared with another's.
fn own_names(file: &ExrFile) -> Vec<String> {
    let all: Vec<&str> = parts(file).flat_map(|part| &part.channels).map(|(name, _)| name.as_str()).collect();
    let owned = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<String>>();
    if !are_colours([file; 2]) {
        return all.into_iter().filter(|name| !is_of_samples(name)).map(str::to_owned).collect();
    }
    let is_band = |name: &&str| (name.starts_with("S0.") || name.starts_with("T.")) && name.ends_with("nm");
    let bands: Vec<&str> = all.iter().copied().filter(is_band).collect();
    if !bands.is_empty() {
        return owned(&bands);
    }
    let groups = [&["R", "G", "B"][..], &["X", "Y", "Z"], &["Y"]];
    match groups.into_iter().find(|group| group.iter().all(|name| all.contains(name))) {
        Some(group) => owned(group),
        None => all.into_iter().filter(|name| *name != "A" && !is_of_samples(name)).map(str::to_owned).collect(),
    }
}

/// Whether a channel tells of the samples of a picture, or names what is seen, and is no mean that two pictures have in common.
fn is_of_samples(name: &str) -> bool {
    match name.split_once('.') {
        Some((layer, _)) => matches!(layer, "stderr" | "variance" | "numerics") || layer.starts_with("Crypto"),
        None => name == "sampleCount",
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{PIXELS, file, render, without_errors};
    use super::super::{NoiseSource, Verdict, compare};
    use super::*;

    #[test]
    fn pictures_of_different_things_cannot_be_compared() {
        let a = render(7, 1.0, 0.3, 1.0);
        let reason = |b: &ExrFile| {
            let c = compare(&a, b, &CompareOptions::default());
            assert_eq!((c.verdict, c.verdict.exit_code(), c.noise), (Verdict::CannotCompare, 2, None));
            assert!(c.table().starts_with("verdict: cannot compare: "));
            c.reason
        };
        let mut moved = a.clone();
        moved.parts[0].window.x = 5;
        assert_eq!(reason(&moved), "the data windows differ: 64x64 at (0, 0) against 64x64 at (5, 0)");
        let ignore = CompareOptions { origin: Origin::Ignore, ..CompareOptions::default() };
        assert_eq!(compare(&a, &moved, &ignore).verdict, Verdict::Same);
        let mut low = a.clone();
        low.parts[0].window.height /= 2;
        low.parts[0].channels.iter_mut().for_each(|(_, plane)| plane.truncate(PIXELS / 2));
        let told = compare(&a, &low, &ignore).reason;
        assert_eq!(told, "the data windows differ: 64x64 at (0, 0) against 64x32 at (0, 0)");
        let mut wide = a.clone();
        wide.chromaticities = Some([[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], [0.32168, 0.33767]]);
        assert!(reason(&wide).starts_with("the colour primaries differ"));
        // The primaries of an XYZ picture are those of its layers.
        let xyz = |file: &ExrFile| {
            let mut file = file.clone();
            let names = file.parts[0].channels.iter_mut().map(|(name, _)| name);
            names.for_each(|name| *name = name.replace('R', "X").replace('G', "Y").replace('B', "Z"));
            file
        };
        assert_eq!(compare(&xyz(&a), &xyz(&wide), &CompareOptions::default()).verdict, Verdict::Same);
        let mut other = a.clone();
        other.parts[0].channels.iter_mut().for_each(|(name, _)| name.push('x'));
        assert_eq!(reason(&other), "the channels differ: R, G, B against Rx, Gx, Bx");
        // Alpha is no light, and not compared.
        let mut cover = a.clone();
        cover.parts[0].channels.truncate(1);
        cover.parts[0].channels[0].0 = "A".into();
        assert_eq!(reason(&cover), "the channels differ: R, G, B against none of light");
        let told = compare(&cover, &cover, &CompareOptions::default());
        assert_eq!((told.verdict, &*told.reason), (Verdict::CannotCompare, "neither file holds light"));
        // Words of whole numbers, of which the lower ones are as good as random.
        let mut sums = a.clone();
        sums.parts[0].texts.push(("abbe/part".into(), "{}".into()));
        assert!(reason(&sums).starts_with("B holds sums of a part or a checkpoint"));
    }

    /// The channels of `file` in a part for each name before a point, as `layout: multipart` has it.
    fn in_parts(file: &ExrFile) -> ExrFile {
        let part = &file.parts[0];
        let mut parts: Vec<ExrPart> = Vec::new();
        for channel in &part.channels {
            let layer = channel.0.rsplit_once('.').map_or("rgba", |(layer, _)| layer);
            match parts.iter_mut().find(|part| part.name.as_deref() == Some(layer)) {
                Some(part) => part.channels.push(channel.clone()),
                None => parts.push(ExrPart {
                    name: Some(layer.into()),
                    channels: vec![channel.clone()],
                    // What is said of the picture stands in the first.
                    texts: if parts.is_empty() { part.texts.clone() } else { Vec::new() },
                    ..part.clone()
                }),
            }
        }
        ExrFile { parts, ..file.clone() }
    }

    #[test]
    fn pictures_in_several_parts_are_compared_as_those_in_one() {
        let (mut a, b) = (render(11, 1.0, 0.3, 1.0), render(12, 1.0, 0.3, 1.0));
        let c = compare(&in_parts(&a), &in_parts(&b), &CompareOptions::default());
        assert_eq!(c, compare(&a, &b, &CompareOptions::default()));
        assert_eq!(c.noise, Some(NoiseSource::StandardErrors));
        // One pixel far off is seen by its standard error alone.
        a.parts[0].channels[0].1[5] += 100.0;
        a.parts[0].channels[0].1[6] -= 100.0;
        let c = compare(&in_parts(&a), &in_parts(&b), &CompareOptions::default());
        assert_eq!(c.pixel_test.unwrap().pixels_rejected, 2, "{}", c.reason);
        // Bands of which each is a part, the second twice as bright.
        let bands = |gain: f32| {
            let band = |name: &str, value| (name.to_string(), vec![value; PIXELS]);
            let parts = in_parts(&file(vec![band("a", 1.0), band("b.T", gain)]));
            assert_eq!(parts.parts.len(), 2);
            parts
        };
        let c = compare(&bands(1.0), &bands(2.0), &CompareOptions::default());
        assert_eq!((c.verdict, c.channels.len()), (Verdict::Different, 2), "{}", c.reason);
    }

    #[test]
    fn files_with_other_channels_cannot_be_compared() {
        let channels =
            |names: &[&str]| file(names.iter().map(|name| ((*name).to_string(), vec![1.0; PIXELS])).collect());
        let three = ["S0.450,0nm", "S0.550,0nm", "S0.650,0nm", "R", "G", "B"];
        let pairs: [(&[&str], &[&str]); 6] = [
            (&three, &["S0.425,0nm", "S0.475,0nm", "S0.525,0nm", "R", "G", "B"]),
            (&three, &["R", "G", "B", "A"]),
            (&["R", "G", "B"], &["R"]),
            (&["X", "Y", "Z"], &["Y"]),
            (&["X", "Y", "Z", "A"], &["Y", "A"]),
            (&["a", "b", "A"], &["a", "A"]),
        ];
        for (a, b) in pairs {
            for (a, b) in [(a, b), (b, a)] {
                let c = compare(&channels(a), &channels(b), &CompareOptions::default());
                assert_eq!(c.verdict, Verdict::CannotCompare, "{a:?} {b:?}");
                assert!(c.reason.contains(a[0]) && c.reason.contains(b[0]), "{}", c.reason);
            }
        }
        // Further layers of either file and alpha are none of the picture's colours; the table names them.
        let c = compare(
            &channels(&["A", "B", "G", "R", "Z", "stderr.R"]),
            &channels(&["B", "G", "R", "normal.X", "normal.X.T", "normal.Y"]),
            &CompareOptions::default(),
        );
        assert!(c.verdict == Verdict::Same && c.identical);
        let told = "not compared             A, Z, normal.*, normal.X.*\n";
        assert!(c.table().contains(told), "{}", c.table());
    }

    /// With 16 and with 64 samples a pixel, of which variances are as many times apart; IDs are no light.
    #[test]
    fn what_tells_of_samples_is_not_compared_as_a_band() {
        let bands = |samples: f32| {
            let light = |name: &str| (name.to_string(), vec![1.0; PIXELS]);
            let layers = ["stderr.a", "variance.a", "sampleCount", "CryptoObject00.R"];
            let layers = layers.map(|name| (name.to_string(), vec![samples; PIXELS]));
            file([light("a"), light("b.T")].into_iter().chain(layers).collect())
        };
        let c = compare(&bands(16.0), &bands(64.0), &CompareOptions::default());
        assert_eq!(c.channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["a", "b.T"]);
        assert_eq!(c.verdict, Verdict::Same, "{}", c.table());
    }

    /// As the bands of a picture may be called, and alpha among them; without a word of it they are colours.
    #[test]
    fn what_is_no_colour_is_compared_whatever_it_is_called() {
        let bands = |said: Option<(&str, &str)>, last: f32| {
            let band = |name: &str, value| (name.to_string(), vec![value; PIXELS]);
            let all = [band("A", 1.0), band("G", 1.0), band("IR", last), band("R", 1.0), band("B", 1.0)];
            let mut file = file([band("stderr.IR", 0.0)].into_iter().chain(all).collect());
            file.parts[0].texts.extend(said.map(|(name, value)| (name.to_owned(), value.to_owned())));
            file
        };
        for (said, count, verdict) in [
            (None, 3, Verdict::Same),
            (Some(("colorInteropID", "lin_rec709_scene")), 3, Verdict::Same),
            (Some(("colorInteropID", "data")), 5, Verdict::Different),
            (Some((BANDS, "5")), 5, Verdict::Different),
        ] {
            let c = compare(&bands(said, 1.0), &bands(said, 2.0), &CompareOptions::default());
            assert_eq!((c.verdict, c.channels.len()), (verdict, count), "{said:?}: {}", c.table());
        }
        // What the first part says is of the picture: further ones may be data.
        let mut layers = bands(None, 1.0);
        layers.parts.push(bands(Some(("colorInteropID", "data")), 1.0).parts.remove(0));
        assert_eq!(own_names(&layers), ["R", "G", "B"]);
    }

    #[test]
    fn names_of_channels_command_nothing_of_the_terminal() {
        let one = |name: &str| file(vec![(name.to_string(), vec![1.0; PIXELS])]);
        for other in ["la\x1b[1m\n.R", "b"] {
            let c = compare(&one("la\x1b[1m\n.R"), &one(other), &CompareOptions::default());
            let table = c.table();
            assert!(table.contains("la\\u{1b}[1m\\n.R") && !table.contains('\x1b'), "{table}");
        }
    }

    #[test]
    fn spectral_files_are_compared_band_by_band() {
        let spectral = |seed| {
            let mut f = without_errors(render(seed, 1.0, 0.3, 1.0));
            let red = f.parts[0].channels[0].1.clone();
            for band in ["S0.450,0nm", "S0.550,0nm"] {
                f.parts[0].channels.push((band.to_string(), red.clone()));
            }
            f
        };
        let c = compare(&spectral(1), &spectral(2), &CompareOptions::default());
        assert_eq!(c.channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["S0.450,0nm", "S0.550,0nm"]);
    }
}
