//! Values that change from frame to frame: `{0: 1.0, 48: 2.5}` in the place of a number or of a list of numbers.
//!
//! A map whose keys are frames is *keyed*. Before a tree is decoded, [`evaluate`] puts in the place of each keyed map the
//! value at one frame, so that nothing beyond this file knows of time. Before the first key the first value holds, after
//! the last key the last one; at a key its very value stands, as it is written. Between keys each number runs
//!
//! - `linear`: straight;
//! - `smooth`: by the monotone cubic of Steffen 1990, "A simple method for monotonic interpolation in one dimension",
//!   Astronomy and Astrophysics 239, 443, eqs. 2 and 11, with slope 0 at the first and the last key, where the values that
//!   hold join on. It has a continuous derivative at every time, and no value leaves the range of the two keys around it:
//!   what is in range at all keys is so between them;
//! - `step`: not at all until the next key.

use std::path::Path;

use super::edit::read_bytes;
use super::fault::Fault;
use super::node::{Entry, Node, Place, Sources, Value, did_you_mean, quote};
use super::path::{self, At, Segment};
use crate::error::Error;

/// The maps whose keys are names, of which a number may be one.
const NAMES: [&str; 8] =
    ["materials", "textures", "volumes", "media", "groups", "assets", "light_groups", "output.exr.attributes"];
const INTERPOLATION: &str = "interpolation";
const KEYS: &str = "keys";
const FILE: &str = "file";

/// How a value runs between two keys.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Interpolation {
    Linear,
    Smooth,
    Step,
}

const INTERPOLATIONS: [(&str, Interpolation); 3] =
    [("linear", Interpolation::Linear), ("smooth", Interpolation::Smooth), ("step", Interpolation::Step)];

/// A frame as it may be written in a key.
fn frame_of(text: &str) -> Option<f64> {
    let number = text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    text.parse().ok().filter(|frame: &f64| number && frame.is_finite())
}

/// Whether the node at `at` is one value over frames.
pub(crate) fn is_keyed_at(node: &Node, at: At<'_>) -> bool {
    is_keyed(node) && !NAMES.contains(&path::display(&at.segments()).as_str())
}

/// Whether a node is keyed, or meant to be. A number without value is no frame, but most likely behind a decimal comma: in
/// `{radius: 0,5}` it is a field that nobody knows.
pub(crate) fn is_keyed(node: &Node) -> bool {
    let is_frame = |entry: &Entry| frame_of(&entry.key).is_some() && !matches!(entry.node.value, Value::Null);
    match &node.value {
        Value::Map(entries) => entries.iter().any(|entry| entry.key == KEYS || is_frame(entry)),
        _ => false,
    }
}

/// Calls `change` for each keyed node of a scene, with a fault under the path that leads to it.
fn each(root: &mut Node, change: &mut dyn FnMut(&mut Node) -> Result<(), Fault>) -> Result<(), Fault> {
    fn within(
        node: &mut Node,
        at: At<'_>,
        change: &mut dyn FnMut(&mut Node) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        if is_keyed_at(node, at) {
            return change(node);
        }
        match &mut node.value {
            Value::List(items) => {
                for (i, item) in items.iter_mut().enumerate() {
                    within(item, at.index(i), change).map_err(|fault| fault.under(Segment::Index(i)))?;
                }
            }
            Value::Map(entries) => {
                for Entry { key, node, .. } in entries {
                    within(node, at.key(key), change).map_err(|fault| fault.under(Segment::Key(key.clone())))?;
                }
            }
            _ => {}
        }
        Ok(())
    }
    let Value::Map(entries) = &mut root.value else { return Ok(()) };
    for Entry { key, node, .. } in entries {
        within(node, At::ROOT.key(key), change).map_err(|fault| fault.under(Segment::Key(key.clone())))?;
    }
    Ok(())
}

/// Puts the rows of tables in files, `{keys: {file: path.csv}}`, in the place of their names. Whether anything of the
/// scene is keyed is returned.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be read or is no table.
pub(crate) fn read_tables(root: &mut Node, sources: &mut Sources) -> Result<bool, Error> {
    let (mut found, mut unreadable) = (false, None);
    let told = each(root, &mut |node| {
        found = true;
        let Some(file) = node.get_mut(KEYS).filter(|keys| keys.get(FILE).is_some()) else { return Ok(()) };
        // All that is said of the table stands beside `keys`.
        if let Value::Map(entries) = &file.value
            && let Some(Entry { key, key_place, .. }) = entries.iter().find(|entry| entry.key != FILE)
        {
            let beside = if key == INTERPOLATION { ", which stands beside keys" } else { "" };
            let message = format!("expected {FILE} alone, found {}{beside}", quote(key));
            let fault = Fault::at_place(*key_place, message).under(Segment::Key(key.clone()));
            return Err(fault.under(Segment::Key(KEYS.to_owned())));
        }
        let Some(Node { place, value: Value::Text(name) }) = file.get(FILE) else { return Ok(()) };
        let (path, at) = (sources.file(*place, name), sources.describe(*place));
        match table(&path, sources) {
            Ok(rows) => file.value = Value::List(rows),
            Err(message) => {
                unreadable = unreadable.take().or(Some(Error::input(&path, format!("{message}; it is named at {at}"))))
            }
        }
        Ok(())
    });
    told.map_err(|fault| fault.into_error(sources))?;
    unreadable.map_or(Ok(found), Err)
}

/// The rows `[frame, value]` of a file of numbers with commas, semicolons or blanks between them; a value of several numbers is a
/// list. Empty lines and those that begin with # say nothing, nor does a first line of names.
fn table(path: &Path, sources: &mut Sources) -> Result<Vec<Node>, String> {
    let bytes = read_bytes(path).map_err(|error| format!("cannot be read: {error}"))?;
    let text = str::from_utf8(crate::input::without_mark(&bytes)).map_err(|_| "expected text in UTF-8".to_owned())?;
    let source = sources.add_file(path);
    let (mut rows, mut has_names) = (Vec::new(), false);
    for (line, text) in (1..).zip(text.lines()) {
        if text.trim().is_empty() || text.trim_start().starts_with('#') {
            continue;
        }
        let fields = fields(text);
        let place = Place { source, line, column: 1 };
        let numbers: Option<Vec<Node>> = fields
            .iter()
            .map(|field| field.parse().ok().filter(|x: &f64| x.is_finite()).map(|x| Node::new(place, Value::Float(x))))
            .collect();
        match numbers {
            Some(mut numbers) if numbers.len() >= 2 => {
                let mut values = numbers.split_off(1);
                let value = if values.len() == 1 { values.remove(0) } else { Node::new(place, Value::List(values)) };
                numbers.push(value);
                rows.push(Node::new(place, Value::List(numbers)));
            }
            None if rows.is_empty()
                && !has_names
                && !begins_with_number(text)
                && fields.iter().all(|field| field.parse::<f64>().is_err()) =>
            {
                has_names = true;
            }
            _ => {
                let found = quote(text.trim());
                let at = fields.iter().find(|field| !field.parse().is_ok_and(f64::is_finite)).unwrap_or(&fields[0]);
                let before = &text[..at.as_ptr() as usize - text.as_ptr() as usize];
                let column = before.chars().count() + 1;
                return Err(format!(
                    "line {line}, column {column}: expected a frame and one number or more, with commas, semicolons or \
                     blanks, found {found}"
                ));
            }
        }
    }
    if rows.is_empty() {
        return Err("expected lines of a frame and one number or more, with commas, semicolons or blanks, found none"
            .to_owned());
    }
    Ok(rows)
}

/// What stands between the separators of `line`: semicolons where it has any, else commas, else blanks. So a comma beside semicolons is
/// that of a decimal fraction, which is no number here, and separates nothing.
fn fields(line: &str) -> Vec<&str> {
    match [';', ','].into_iter().find(|separator| line.contains(*separator)) {
        Some(separator) => line.split(separator).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    }
}

/// Whether the first word of `line` is a number, whatever separates words.
fn begins_with_number(line: &str) -> bool {
    let word = line.split(|c: char| c == ';' || c.is_whitespace()).find(|word| !word.is_empty());
    word.is_some_and(|word| word.parse::<f64>().is_ok())
}

/// The place of the first keyed value.
pub(crate) fn first(root: &mut Node) -> Option<Fault> {
    each(root, &mut |node| Err(Fault::at_place(node.place, String::new()))).err()
}

/// Puts the value at `frame` in the place of each keyed one.
///
/// # Errors
/// The first keyed value that is none, with its place.
pub(crate) fn evaluate(root: &mut Node, frame: f64) -> Result<(), Fault> {
    each(root, &mut |node| put(node, frame))
}

/// What is at `frame` in the sections of a scene that say how it is rendered, and at `time` in those that say what it is.
///
/// # Errors
/// As [`evaluate`].
pub(crate) fn evaluate_within(root: &mut Node, frame: f64, time: f64) -> Result<(), Fault> {
    const STILL: [&str; 5] = ["image", "integrator", "layers", "render", "output"];
    let Value::Map(entries) = &mut root.value else { return Ok(()) };
    for entry in entries.iter_mut().filter(|entry| STILL.contains(&entry.key.as_str())) {
        entry.node = section(entry, frame)?;
    }
    // For how long the shutter is open does not change meanwhile.
    for entry in entries.iter_mut().filter(|entry| entry.key == "camera") {
        let Value::Map(fields) = &entry.node.value else { continue };
        let Some(i) = fields.iter().position(|field| field.key == "shutter") else { continue };
        let alone = Entry { node: Node::new(entry.node.place, Value::Map(vec![fields[i].clone()])), ..entry.clone() };
        if let (Value::Map(mut found), Value::Map(fields)) = (section(&alone, frame)?.value, &mut entry.node.value) {
            fields[i] = found.remove(0);
        }
    }
    evaluate(root, time)
}

/// A section of a scene at `frame`.
///
/// # Errors
/// As [`evaluate`].
pub(crate) fn section(entry: &Entry, frame: f64) -> Result<Node, Fault> {
    // As a tree of its own, with the path of its names and faults.
    let mut alone = Node::new(entry.node.place, Value::Map(vec![entry.clone()]));
    evaluate(&mut alone, frame)?;
    match alone.value {
        Value::Map(mut alone) => Ok(alone.remove(0).node),
        _ => Ok(alone),
    }
}

/// The value at `frame` of one keyed node.
fn put(node: &mut Node, frame: f64) -> Result<(), Fault> {
    let value = Track::of(node)?.at(frame);
    *node = value;
    Ok(())
}

/// A keyed value.
struct Track<'a> {
    /// Frames, increasing, and the value at each.
    keys: Vec<(f64, &'a Node)>,
    interpolation: Interpolation,
}

impl<'a> Track<'a> {
    /// Reads a keyed node.
    fn of(node: &'a Node) -> Result<Track<'a>, Fault> {
        let Value::Map(entries) = &node.value else { return Err(Fault::expected(node, "a map of frames")) };
        let mut interpolation = Interpolation::Linear;
        let mut keys: Vec<(f64, &Node)> = Vec::new();
        let mut push = |frame: f64, at: Place, value: &'a Node| -> Result<(), Fault> {
            if let Some((before, _)) = keys.last().filter(|(before, _)| *before >= frame) {
                let message = format!("expected frames that increase, found {frame} after {before}");
                return Err(Fault::at_place(at, message));
            }
            check(value)?;
            if let Some((first, other)) = keys.first() {
                alike(*first, other, value)?;
            }
            keys.push((frame, value));
            Ok(())
        };
        let table = entries.iter().any(|entry| entry.key == KEYS);
        for Entry { key, key_place, node: value } in entries {
            let under = |fault: Fault| fault.under(Segment::Key(key.clone()));
            if key == INTERPOLATION {
                // Without value it is not written.
                if !matches!(value.value, Value::Null) {
                    interpolation = named(value).map_err(under)?;
                }
            } else if table && key == KEYS {
                let Value::List(rows) = &value.value else {
                    return Err(under(Fault::expected(value, "a list of [frame, value], or {file: …}")));
                };
                for (i, row) in rows.iter().enumerate() {
                    let under = |fault: Fault| under(fault.under(Segment::Index(i)));
                    match &row.value {
                        Value::List(pair) if pair.len() == 2 && number(&pair[0]).is_some_and(f64::is_finite) => {
                            push(number(&pair[0]).unwrap_or_default(), row.place, &pair[1]).map_err(under)?;
                        }
                        _ => return Err(under(Fault::expected(row, "a frame and its value, [frame, value]"))),
                    }
                }
            } else if let (false, Some(frame)) = (table, frame_of(key)) {
                push(frame, *key_place, value).map_err(under)?;
            } else {
                let expected = if table { "keys and interpolation" } else { "frames and interpolation" };
                let hint = did_you_mean(key, [INTERPOLATION]);
                let message = format!("expected {expected} as keys, found {}{hint}", quote(key));
                return Err(under(Fault::at_place(*key_place, message)));
            }
        }
        match keys.is_empty() {
            true => Err(Fault::at_place(node.place, "expected a value at one frame or more, found none")),
            false => Ok(Track { keys, interpolation }),
        }
    }

    fn at(&self, frame: f64) -> Node {
        // The first key after the frame.
        let next = self.keys.partition_point(|(key, _)| *key <= frame);
        let last = next.saturating_sub(1);
        let (key, value) = self.keys[last];
        if next == 0 || next == self.keys.len() || key == frame || self.interpolation == Interpolation::Step {
            return value.clone();
        }
        let times: Vec<f64> = self.keys.iter().map(|(frame, _)| *frame).collect();
        let values: Vec<&Node> = self.keys.iter().map(|(_, value)| *value).collect();
        let between = |y: &[f64]| {
            let (from, to) = (y[last], y[next]);
            let value = match self.interpolation {
                Interpolation::Smooth => steffen(&times, y, last, frame),
                _ => from + (to - from) * ((frame - times[last]) / (times[next] - times[last])),
            };
            // Nor does rounding leave the range.
            value.clamp(from.min(to), from.max(to))
        };
        blend(&values, last, &between)
    }
}

/// The interpolation that a node names.
fn named(node: &Node) -> Result<Interpolation, Fault> {
    let names = INTERPOLATIONS.map(|(name, _)| name);
    match &node.value {
        Value::Text(text) => match INTERPOLATIONS.iter().find(|(name, _)| name == text) {
            Some((_, interpolation)) => Ok(*interpolation),
            None => Err(Fault::unknown(node.place, text, names)),
        },
        _ => Err(Fault::none_of(node, names)),
    }
}

fn number(node: &Node) -> Option<f64> {
    match node.value {
        Value::Unsigned(value) => Some(value as f64),
        Value::Signed(value) => Some(value as f64),
        Value::Float(value) => Some(value),
        _ => None,
    }
}

/// A value is a number or a list of such values.
fn check(node: &Node) -> Result<(), Fault> {
    match &node.value {
        Value::List(items) if !items.is_empty() => items
            .iter()
            .enumerate()
            .try_for_each(|(i, item)| check(item).map_err(|fault| fault.under(Segment::Index(i)))),
        _ if number(node).is_some_and(f64::is_finite) => Ok(()),
        _ => Err(Fault::expected(node, "a number or a list of numbers, which can change over frames")),
    }
}

/// `value` has as many numbers as `first`, which is the value at `frame`, in the same lists.
fn alike(frame: f64, first: &Node, value: &Node) -> Result<(), Fault> {
    match (&first.value, &value.value) {
        (Value::List(a), Value::List(b)) if a.len() == b.len() => a
            .iter()
            .zip(b)
            .enumerate()
            .try_for_each(|(i, (a, b))| alike(frame, a, b).map_err(|fault| fault.under(Segment::Index(i)))),
        (Value::List(a), _) => Err(Fault::expected(value, format_args!("a list of {} as at frame {frame}", a.len()))),
        (_, Value::List(_)) => Err(Fault::expected(value, format_args!("a number as at frame {frame}"))),
        _ => Ok(()),
    }
}

/// One value of many, number by number; it stands where the one at `last` does.
fn blend(values: &[&Node], last: usize, between: &dyn Fn(&[f64]) -> f64) -> Node {
    let place = values[last].place;
    let value = match &values[last].value {
        Value::List(items) => {
            let inner = |i: usize| {
                let inner: Vec<&Node> = values.iter().filter_map(|node| item(node, i)).collect();
                blend(&inner, last, between)
            };
            Value::List((0..items.len()).map(inner).collect())
        }
        _ => Value::Float(between(&values.iter().filter_map(|node| number(node)).collect::<Vec<f64>>())),
    };
    Node::new(place, value)
}

fn item(node: &Node, i: usize) -> Option<&Node> {
    match &node.value {
        Value::List(items) => items.get(i),
        _ => None,
    }
}

/// Steffen's cubic through the points (x, y) at `t`, which lies from `x[i]` to `x[i + 1]`.
fn steffen(x: &[f64], y: &[f64], i: usize, t: f64) -> f64 {
    let width = |i: usize| x[i + 1] - x[i];
    let secant = |i: usize| (y[i + 1] - y[i]) / width(i);
    // Eq. 11: the slope of the parabola through three points, as far as it keeps both sides monotone; 0 where they turn,
    // and at the ends.
    let slope = |i: usize| {
        if i == 0 || i + 1 == x.len() {
            return 0.0;
        }
        let (before, after) = (secant(i - 1), secant(i));
        if before * after <= 0.0 {
            return 0.0;
        }
        let parabola = (before * width(i) + after * width(i - 1)) / (width(i - 1) + width(i));
        2.0 * before.signum() * before.abs().min(after.abs()).min(0.5 * parabola.abs())
    };
    // Eqs. 2 to 5, around the nearer end, so that rounding is smallest at both.
    let (h, s, from, to) = (width(i), secant(i), slope(i), slope(i + 1));
    let cubic = |u: f64, from: f64, to: f64| {
        let (a, b) = ((from + to - 2.0 * s) / (h * h), (3.0 * s - 2.0 * from - to) / h);
        ((a * u + b) * u + from) * u
    };
    let u = t - x[i];
    if u <= 0.5 * h { y[i] + cubic(u, from, to) } else { y[i + 1] - cubic(h - u, to, from) }
}

#[cfg(test)]
mod tests {
    use super::super::testing::CAMERA;
    use super::super::{Geometry, Integrator, load};
    use super::*;

    /// The tree of a text, at a frame; the fault names the file `f.yaml`.
    fn at(text: &str, frame: f64) -> std::result::Result<Node, String> {
        let mut sources = Sources::default();
        let source = sources.add_file(Path::new("f.yaml"));
        let mut root = super::super::yaml::read(text.as_bytes(), source).map_err(|fault| fault.write(&sources))?;
        evaluate(&mut root, frame).map_err(|fault| fault.write(&sources))?;
        Ok(root)
    }

    /// The value of `x` at a frame.
    fn x(text: &str, frame: f64) -> f64 {
        let root = at(&format!("x: {text}"), frame).unwrap();
        number(root.get("x").unwrap()).unwrap()
    }

    #[test]
    fn a_value_runs_straight_between_its_keys_and_holds_beyond_them() {
        let ramp = "{0: 1, 48: 2.5}";
        assert_eq!([-7.0, 0.0, 24.0, 48.0, 100.0].map(|frame| x(ramp, frame)), [1.0, 1.0, 1.75, 2.5, 2.5]);
        assert_eq!(x("{-10: 4, -5: 5, 5: 0}", 0.0), 2.5);
        assert_eq!(x("{keys: [[0, 1], [0.5, 2]]}", 0.25), 1.5);
        assert_eq!(x("{7: 3}", 1.0), 3.0);
        assert_eq!(x("{0: 1, 4: 3, interpolation: }", 1.0), 1.5);
        // What is merged stands where it is named: 1 at 0, 3 at 4, 5 at 8; and 1 at 0, 5 at 2.
        assert_eq!(x("{<<: {0: 1, 4: 3}, 8: 5}", 6.0), 4.0);
        assert_eq!(x("{0: 1, <<: {0: 9, 2: 5}}", 1.0), 3.0);
    }

    /// What is no number at any key is told at every frame, and names are no frames where names stand.
    #[test]
    fn keys_hold_finite_numbers_and_names_are_none() {
        for value in ["{1: .nan, 4: .nan}", "{1: 2, 4: .inf}"] {
            let told = at(&format!("x: {value}"), 1.0).unwrap_err();
            assert!(told.contains("expected a number or a list of numbers"), "{told}");
        }
        for names in [
            "assets: {keys: [s], 1: [t]}",
            "light_groups: {1: [p]}",
            "output: {exr: {attributes: {\"2024\": a, keys: 3}}}",
        ] {
            let [one, other] = [1.0, 9.0].map(|frame| format!("{:?}", at(names, frame).unwrap()));
            assert_eq!(one, other);
        }
    }

    /// "expected render.frames or --frames", and with those another fault.
    #[test]
    fn attributes_of_files_are_names_and_no_frames() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("s.yaml");
        for frames in ["", "render: {frames: 1-3}\n"] {
            let text = format!("{CAMERA}{frames}output: {{exr: {{attributes: {{\"2024\": a, keys: kim}}}}}}\n");
            std::fs::write(&file, text).unwrap();
            let animation = load(&file).unwrap().entries()[0].animation(&[]).unwrap();
            for output in [animation.output().unwrap(), animation.into_first().unwrap().output] {
                assert_eq!(output.exr.attributes.keys().collect::<Vec<_>>(), ["2024", "keys"]);
            }
        }
    }

    #[test]
    fn a_stepped_value_waits_for_the_next_key() {
        let steps = "{0: 1, 10: 2, 20: 5, interpolation: step}";
        assert_eq!([0.0, 9.0, 9.9, 10.0, 25.0].map(|frame| x(steps, frame)), [1.0, 1.0, 1.0, 2.0, 5.0]);
    }

    /// With two keys the slopes are 0 at both ends: the cubic 3u² − 2u³. With three on a line, of which the middle one has
    /// slope 1 = the secants (eq. 11), the cubic from (0, 0), slope 0, to (1, 1), slope 1, is 2u² − u³: at u = 1/2, 3/8.
    #[test]
    fn a_smooth_value_is_steffens_cubic() {
        for (frame, value) in [(0.0, 0.0), (1.0, 5.0 / 32.0), (2.0, 0.5), (3.0, 27.0 / 32.0), (4.0, 1.0)] {
            assert_eq!(x("{0: 0, 4: 1, interpolation: smooth}", frame), value, "{frame}");
        }
        let line = "{0: 0, 2: 1, 4: 2, interpolation: smooth}";
        assert_eq!([x(line, 1.0), x(line, 3.0)], [0.375, 1.625]);
        // Where values turn the slope is 0, and nothing overshoots.
        let peak = "{0: 0, 1: 1, 2: 0, 5: 0, interpolation: smooth}";
        assert_eq!([x(peak, 0.5), x(peak, 1.5), x(peak, 3.0)], [0.5, 0.5, 0.0]);
    }

    /// On both sides of each key, at distance d, the slope is that of eq. 11 up to what the second derivative, which no
    /// interval here has above 6·(range/h²) + 4·(slope/h) < 60, adds over d.
    #[test]
    fn a_smooth_value_has_one_slope_at_each_key_and_stays_within_its_keys() {
        let text = "{0: 0, 1: 0.2, 3: 3, 4: 3.1, 7: 1, interpolation: smooth}";
        let keys = [(0.0, 0.0), (1.0, 0.2), (3.0, 3.0), (4.0, 3.1), (7.0, 1.0)];
        let d = 1e-5;
        for (frame, value) in keys {
            let [before, after] = [x(text, frame - d), x(text, frame + d)];
            assert!(((after - value) - (value - before)).abs() / d < 2.0 * 60.0 * d, "{frame}");
        }
        for pair in keys.windows(2) {
            for i in 0..=100 {
                let frame = pair[0].0 + (pair[1].0 - pair[0].0) * f64::from(i) / 100.0;
                let value = x(text, frame);
                assert!(pair[0].1.min(pair[1].1) <= value && value <= pair[0].1.max(pair[1].1), "{frame}: {value}");
            }
        }
    }

    #[test]
    fn lists_and_matrices_run_number_by_number() {
        let text = "x: {0: [0, 1, 2], 4: [4, 1, -2]}\ny: [{0: [[1, 0], [0, 1]], 2: [[0, 1], [1, 0]]}]\nz: {w: {0: 3}}";
        let root = at(text, 1.0).unwrap();
        let printed = |key: &str| {
            let sources = Sources::default();
            super::super::print::Printer::new(&sources, Path::new("")).flow(root.get(key).unwrap())
        };
        assert_eq!(printed("x"), "[1, 1, 1]");
        assert_eq!(printed("y"), "[[[0.5, 0.5], [0.5, 0.5]]]");
        assert_eq!(printed("z"), "{w: 3}");
    }

    #[test]
    fn names_may_be_numbers() {
        let text =
            format!("{CAMERA}materials: {{1: {{mirror: {{}}}}, 2: {{diffuse: {{reflectance: {{0: 0, 2: 1}}}}}}}}");
        let root = at(&text, 1.0).unwrap();
        let diffuse = root.get("materials").and_then(|m| m.get("2")).and_then(|m| m.get("diffuse")).unwrap();
        assert_eq!(number(diffuse.get("reflectance").unwrap()), Some(0.5));
    }

    #[test]
    fn what_cannot_be_keyed_is_refused_with_its_place() {
        let says = |text: &str| at(&format!("x:\n  y: {text}"), 0.0).unwrap_err();
        let cases = [
            (
                "{0: red, 5: blue}",
                "2:10: x.y.0: expected a number or a list of numbers, which can change over frames, found the text \"red\"",
            ),
            (
                "{0: 1, 5: }",
                "2:14: x.y.5: expected a number or a list of numbers, which can change over frames, found nothing",
            ),
            (
                "{0: {sphere: 1}}",
                "2:10: x.y.0: expected a number or a list of numbers, which can change over frames, found a map with sphere",
            ),
            (
                "{0: [1, true]}",
                "2:14: x.y.0[1]: expected a number or a list of numbers, which can change over frames, found true",
            ),
            ("{5: 1, 0: 2}", "2:13: x.y.0: expected frames that increase, found 0 after 5"),
            ("{1: 1, 1.0: 2}", "2:13: x.y.\"1.0\": expected frames that increase, found 1 after 1"),
            ("{1: 1, 1: 2}", "2:13: x.y.1: expected each key once, found \"1\" again; it is first at line 2, column 7"),
            ("{0: 1, 5: [1]}", "2:16: x.y.5: expected a number as at frame 0, found a list of 1"),
            ("{0: [1, 2, 3], 5: [1, 2]}", "2:24: x.y.5: expected a list of 3 as at frame 0, found a list of 2"),
            ("{0: [1, [2]], 5: [1, [2, 3]]}", "2:27: x.y.5[1]: expected a list of 1 as at frame 0, found a list of 2"),
            (
                "{0: 1, interpolaton: smooth}",
                "2:13: x.y.interpolaton: expected frames and interpolation as keys, found \"interpolaton\"; did you mean \"interpolation\"?",
            ),
            ("{0: 1, radius: 2}", "2:13: x.y.radius: expected frames and interpolation as keys, found \"radius\""),
            (
                "{0: 1, interpolation: smoth}",
                "2:28: x.y.interpolation: expected one of linear, smooth, step, found \"smoth\"; did you mean \"smooth\"?",
            ),
            ("{keys: [[0, 1], 5]}", "2:22: x.y.keys[1]: expected a frame and its value, [frame, value], found 5"),
            ("{keys: []}", "2:6: x.y: expected a value at one frame or more, found none"),
            ("{keys: 3}", "2:13: x.y.keys: expected a list of [frame, value], or {file: …}, found 3"),
            ("{keys: [[0, 1]], 5: 3}", "2:23: x.y.5: expected keys and interpolation as keys, found \"5\""),
        ];
        let other = cases.iter().map(|(text, message)| (says(text), format!("f.yaml:{message}")));
        let other: Vec<_> = other.filter(|(found, expected)| found != expected).collect();
        assert!(other.is_empty(), "{other:#?}");
    }

    /// Writes files, and reads `s.yaml` at the first of its frames.
    fn scene(files: &[(&str, &str)]) -> std::result::Result<super::super::SceneDescription, String> {
        let directory = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(directory.path().join(name), text).unwrap();
        }
        load(&directory.path().join("s.yaml"))
            .and_then(|document| document.entries()[0].scene(&[]))
            .map_err(|error| error.to_string().replace(directory.path().to_str().unwrap(), "DIR"))
    }

    #[test]
    fn a_table_may_be_a_file() {
        let text = format!(
            "{CAMERA}render: {{frames: 12}}\nshapes:\n- sphere: {{radius: 1, center: {{keys: {{file: p.csv}}}}}}\n"
        );
        let table = "# a path\nframe, x, y, z\n\n10, 1, 2, 3\n14, 3, 2, 1\n";
        let read = scene(&[("s.yaml", &text), ("p.csv", table)]).unwrap();
        let Geometry::Sphere(sphere) = &read.shapes[0].geometry else { panic!("a sphere") };
        assert_eq!(sphere.center, [2.0, 2.0, 2.0]);
        let says = |table: &str| scene(&[("s.yaml", &text), ("p.csv", table)]).unwrap_err();
        let line = "expected a frame and one number or more, with commas, semicolons or blanks, found";
        let named = "it is named at DIR/s.yaml:4:45";
        assert_eq!(says("1, 2, 3, 4\n2, a\n"), format!("DIR/p.csv: line 2, column 4: {line} \"2, a\"; {named}"));
        assert_eq!(says("1\n"), format!("DIR/p.csv: line 1, column 1: {line} \"1\"; {named}"));
        for separator in [";", "; ", " ", "  ", "\t", ","] {
            let table = table.replace(", ", separator);
            let again = scene(&[("s.yaml", &text), ("p.csv", &table)]).unwrap();
            assert_eq!(again.shapes[0].geometry, read.shapes[0].geometry, "{separator:?}");
        }
        // A comma of a decimal fraction separates nothing, and a first row with one is no line of names: the value of frame 1 would be
        // lost.
        for (row, column) in [("1;2,5;3;4", 3), ("1 2,5 3 4", 1), ("1;2 3;4", 3), ("1 a,b", 1)] {
            let told = format!("DIR/p.csv: line 1, column {column}: {line} \"{row}\"; {named}");
            assert_eq!(says(&format!("{row}\n20, 4, 5, 6\n")), told);
        }
        assert_eq!(says("frame;x\nt;y\n3, 4\n"), format!("DIR/p.csv: line 2, column 1: {line} \"t;y\"; {named}"));
        // What stands beside the name of the file would say nothing.
        for (key, beside) in [("interpolation: smooth", ", which stands beside keys"), ("scale: 2", "")] {
            let text = text.replace("p.csv}", &format!("p.csv, {key}}}"));
            let key = key.split(':').next().unwrap();
            let place = "DIR/s.yaml:4:52: shapes[0].sphere.center.keys";
            let message = format!("{place}.{key}: expected file alone, found \"{key}\"{beside}");
            assert_eq!(scene(&[("s.yaml", &text), ("p.csv", table)]).unwrap_err(), message);
        }
        let empty = "expected lines of a frame and one number or more, with commas, semicolons or blanks, found none";
        assert_eq!(says("# frame, x, y, z\n"), format!("DIR/p.csv: {empty}; {named}"));
        assert_eq!(
            says("1, 2, 3, 4\n2, 5\n"),
            "DIR/p.csv:2:1: shapes[0].sphere.center.keys[1]: expected a list of 3 as at frame 1, found a number"
                .replace("a number", "5.0")
        );
        assert_eq!(
            scene(&[("s.yaml", &text)]).unwrap_err(),
            format!("DIR/p.csv: cannot be read: No such file or directory (os error 2); {named}")
        );
    }

    #[test]
    fn a_keyed_scene_wants_frames() {
        let text = format!("{CAMERA}shapes:\n- sphere: {{radius: {{0: 1, 9: 2}}}}\n");
        assert_eq!(
            scene(&[("s.yaml", &text)]).unwrap_err(),
            "DIR/s.yaml:3:20: shapes[0].sphere.radius: expected render.frames or --frames, since this changes over frames, found none"
        );
    }

    /// The comma of `0,5` begins a field of its own, at the 5.
    #[test]
    fn a_decimal_comma_is_a_field_too_many_and_no_frame() {
        for frames in ["", "render: {frames: 1}"] {
            let text = format!("{CAMERA}{frames}\nshapes:\n- sphere: {{radius: 0,5}}\n");
            let told = scene(&[("s.yaml", &text)]).unwrap_err();
            assert!(
                told.starts_with("DIR/s.yaml:4:22: shapes[0].sphere.5: expected one of center, radius, "),
                "{told}"
            );
        }
    }

    #[test]
    fn whole_numbers_may_be_keyed_where_they_come_out_whole() {
        let text = |frame: u32| {
            format!("{CAMERA}render: {{frames: {frame}}}\nintegrator: {{path: {{max_depth: {{0: 2, 4: 4}}}}}}\n")
        };
        let Integrator::Path(path) = scene(&[("s.yaml", &text(2))]).unwrap().integrator else { panic!("path") };
        assert_eq!(path.max_depth, Some(3));
        assert_eq!(
            scene(&[("s.yaml", &text(1))]).unwrap_err(),
            "DIR/s.yaml:3:36: integrator.path.max_depth: expected a whole number from 1 to 4294967295, found 2.5"
        );
    }
}
