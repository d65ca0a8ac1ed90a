//! A job bundle of Open Job Description (2023-09), which `openjd run` runs and Deadline Cloud takes.
//!
//! No shell stands between the engine and `abbe`: that a task is to end reaches it as SIGTERM, it writes a checkpoint and
//! ends with 75. To the engine that is a task that failed; run again it goes on from there.

use super::NO_SHEET;
use super::{BundleFile, Group, Job};
use crate::description::frames_in_short;
use crate::error::{Error, Result};
use serde_json::json;
use std::fmt::Write;

/// Letters of the value of a parameter, and values of the range of a task's: as many as the specification allows.
const MOST_VALUES: usize = 1024;
/// Parameters of a job.
const MOST_PARAMETERS: usize = 50;

/// The files of the bundle.
///
/// # Errors
/// [`Error::Config`] for what a template cannot hold.
pub fn files(job: &Job) -> Result<Vec<BundleFile>> {
    // A step for as many scenes as it can have.
    let each = |group: &Group| -> Vec<Group> {
        let frames = || group.frames.clone();
        group.scenes.chunks(MOST_VALUES).map(|scenes| Group { scenes: scenes.to_vec(), frames: frames() }).collect()
    };
    let job = &Job { groups: job.groups.iter().flat_map(each).collect(), ..job.clone() };
    let faults = faults(job);
    if !faults.is_empty() {
        return Err(Error::Config(faults.join("\n")));
    }
    let [source, pictures] = [&job.source, &job.pictures].map(|path| path.display().to_string());
    let values = json!({"parameterValues": [
        {"name": "Batch", "value": source}, {"name": "OutputDir", "value": pictures},
    ]});
    let inputs: Vec<String> = job.files.iter().map(|file| file.display().to_string()).collect();
    let assets = json!({"assetReferences": {
        "inputs": {"filenames": inputs, "directories": []},
        "outputs": {"directories": [pictures]},
        "referencedPaths": [],
    }});
    let file = |name, text| BundleFile { name, text, executable: false };
    // JSON is YAML but for some letters.
    Ok(vec![
        file("template.yaml", template(job)),
        file("parameter_values.yaml", escaped(&format!("{values:#}\n"))),
        file("asset_references.yaml", escaped(&format!("{assets:#}\n"))),
        file("parameters.json", format!("{:#}\n", json!({"Batch": source, "OutputDir": pictures}))),
    ])
}

/// What a template cannot hold, in words.
fn faults(job: &Job) -> Vec<String> {
    let mut faults = Vec::new();
    let letters = |what: &str, text: &str| {
        let found = text.chars().count();
        (found > MOST_VALUES).then(|| {
            format!(
                "{what}: expected at most {MOST_VALUES} letters, as many as Open Job Description allows, found {found}"
            )
        })
    };
    let [source, pictures] = [&job.source, &job.pictures].map(|path| path.display().to_string());
    let values = [("the path of the batch", &source), ("--pictures", &pictures), ("--program", &job.program)];
    faults.extend(values.into_iter().filter_map(|(what, text)| letters(what, text)));
    faults.extend(braced(job).filter_map(|(_, argument)| letters(argument, argument)));
    for group in &job.groups {
        let what = || format!("{}: render.frames, written in short", group.scenes[0]);
        faults.extend(letters(&what(), &frames_of(group)));
    }
    let (parameters, braced) = (parameters(job).lines().count(), braced(job).count());
    let framed = job.groups.iter().filter(|group| !group.frames.is_empty()).count();
    if parameters + framed > MOST_PARAMETERS {
        let and = if braced > 0 {
            format!(" beside {braced} arguments with {{{{, }}}} or a control character")
        } else {
            String::new()
        };
        faults.push(format!(
            "render.frames: expected at most {} different sets of frames in one job{and}, as many as Open Job Description \
             has parameters for, found {framed}; --scene makes a job of some scenes",
            MOST_PARAMETERS.saturating_sub(parameters)
        ));
    }
    // Names with {{ are refused for every engine.
    let closed = job.groups.iter().flat_map(|group| &group.scenes).filter(|name| name.contains("}}"));
    faults.extend(closed.map(|name| {
        format!("{name}: expected a name without }}}}, which ends a variable of Open Job Description, found one")
    }));
    faults
}

/// The arguments, with their numbers, that a template cannot hold: those that would be taken for variables or their ends, as nested
/// maps of `--set`, and such with control characters but line ends. They are the values of parameters.
fn braced(job: &Job) -> impl Iterator<Item = (usize, &str)> {
    let is_braced = |argument: &str| {
        let held = |c: char| !c.is_control() || c == '\n';
        argument.contains("{{") || argument.contains("}}") || !argument.chars().all(held)
    };
    job.arguments.iter().map(String::as_str).enumerate().filter(move |(_, argument)| is_braced(argument))
}

/// The frames of a group in order, for its ranges may not overlap.
fn frames_of(group: &Group) -> String {
    let mut frames = group.frames.clone();
    frames.sort_unstable();
    frames_in_short(&frames)
}

/// A text as YAML writes it in quotes.
fn quoted(text: &str) -> String {
    escaped(&json!(text).to_string())
}

/// `json` with what YAML does not take as it is, or breaks lines at, by numbers: it stands in quotes alone.
fn escaped(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        match c {
            '\u{7f}'..='\u{9f}' | '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}' => {
                let _ = write!(out, "\\u{:04x}", u32::from(c));
            }
            _ => out.push(c),
        }
    }
    out
}

fn list<T: AsRef<str>>(items: impl IntoIterator<Item = T>) -> String {
    let items: Vec<String> = items.into_iter().map(|item| quoted(item.as_ref())).collect();
    format!("[{}]", items.join(", "))
}

/// What tells the names of a group from those of the next one.
fn mark(i: usize) -> String {
    if i == 0 { String::new() } else { (i + 1).to_string() }
}

fn template(job: &Job) -> String {
    let mut out = format!(
        "# abbe farm --format openjd: {} pictures\n\
         specificationVersion: jobtemplate-2023-09\n\
         extensions: [TASK_CHUNKING]\n\
         name: \"{{{{Param.JobName}}}}\"\n\
         parameterDefinitions:\n",
        job.count()
    );
    out += &parameters(job);
    for (i, group) in job.groups.iter().enumerate().filter(|(_, group)| !group.frames.is_empty()) {
        let frames = quoted(&frames_of(group));
        let _ = writeln!(out, "- {{name: Frames{}, type: STRING, default: {frames}}}", mark(i));
    }
    let _ = writeln!(out, "steps:");
    for (i, group) in job.groups.iter().enumerate() {
        render(job, group, &mark(i), &mut out);
        if job.cut.parts() {
            merge(group, &mark(i), &mut out);
        }
    }
    out
}

/// The parameters of a job besides its frames, one a line.
fn parameters(job: &Job) -> String {
    // Names of jobs have no control characters.
    let name = quoted(&job.name.chars().filter(|c| !c.is_control()).take(100).collect::<String>());
    let threads = job.threads;
    let program = quoted(&job.program);
    let mut out = format!(
        "- {{name: JobName, type: STRING, default: {name}}}\n\
         - {{name: Abbe, type: STRING, default: {program}, description: \"The program, on the path of each worker\"}}\n\
         - {{name: Batch, type: PATH, objectType: FILE, dataFlow: IN, description: \"The batch or scene\"}}\n\
         - {{name: OutputDir, type: PATH, objectType: DIRECTORY, dataFlow: OUT, description: \"Where the pictures go\"}}\n\
         - {{name: Threads, type: INT, default: {threads}, minValue: 0, description: \"Of a task; 0 for all that it may use\"}}\n"
    );
    if job.has_frames() {
        let _ = writeln!(
            out,
            "- {{name: FramesPerTask, type: INT, default: {}, minValue: 1, description: \"Frames in a row share what they load\"}}",
            job.cut.frames
        );
    }
    for (i, argument) in braced(job) {
        let _ = writeln!(
            out,
            "- {{name: Argument{i}, type: STRING, default: {}, userInterface: {{control: HIDDEN}}}}",
            quoted(argument)
        );
    }
    out
}

/// The end of a step: its program, which ends when it is asked to.
fn action(arguments: &[&str], out: &mut String) {
    let _ = write!(
        out,
        "  script:\n    actions:\n      onRun:\n        command: \"{{{{Param.Abbe}}}}\"\n        args: {}\n        \
         cancelation: {{mode: NOTIFY_THEN_TERMINATE, notifyPeriodInSeconds: 60}}\n",
        list(arguments)
    );
}

fn render(job: &Job, group: &Group, mark: &str, out: &mut String) {
    let (frames, cut) = (!group.frames.is_empty(), job.cut);
    let mut names = vec!["Scene"];
    names.extend(frames.then_some("Frame"));
    names.extend((cut.tiles > 1).then_some("Tile"));
    names.extend((cut.ranges > 1).then_some("Samples"));
    let _ = write!(
        out,
        "- name: Render{mark}\n  parameterSpace:\n    combination: {}\n    taskParameterDefinitions:\n    \
         - {{name: Scene, type: STRING, range: {}}}\n",
        names.join(" * "),
        list(&group.scenes)
    );
    if frames {
        let _ = write!(
            out,
            "    - name: Frame\n      type: CHUNK[INT]\n      range: \"{{{{Param.Frames{mark}}}}}\"\n      \
             chunks: {{defaultTaskCount: \"{{{{Param.FramesPerTask}}}}\", rangeConstraint: NONCONTIGUOUS}}\n"
        );
    }
    for (name, count) in [("Tile", cut.tiles), ("Samples", cut.ranges)] {
        if count > 1 {
            let range = list((0..count).map(|i| format!("{i}/{count}")));
            let _ = writeln!(out, "    - {{name: {name}, type: STRING, range: {range}}}");
        }
    }
    let mut arguments = vec!["render", "{{Param.Batch}}", "--scene={{Task.Param.Scene}}"];
    let place = match (cut.parts(), frames) {
        (false, _) => "{{Param.OutputDir}}",
        (true, false) => "{{Param.OutputDir}}/parts/{{Task.Param.Scene}}",
        // A chunk has several frames; a name that says which chunk it was would be another one on another day.
        (true, true) => "{{Param.OutputDir}}/parts/{{Task.Param.Scene}}/{frame}",
    };
    if frames {
        arguments.extend(["--frames", "{{Task.Param.Frame}}"]);
    }
    if cut.tiles > 1 {
        arguments.extend(["--tile", "{{Task.Param.Tile}}"]);
    }
    if cut.ranges > 1 {
        arguments.extend(["--samples", "{{Task.Param.Samples}}"]);
    }
    arguments.extend(["-o", place, "--threads", "{{Param.Threads}}", "--resume", "--progress", "openjd"]);
    arguments.extend(["--path-map-file", "{{Session.PathMappingRulesFile}}"]);
    arguments.extend(NO_SHEET);
    let mut further = job.arguments.clone();
    for (i, _) in braced(job) {
        further[i] = format!("{{{{Param.Argument{i}}}}}");
    }
    arguments.extend(further.iter().map(String::as_str));
    action(&arguments, out);
}

fn merge(group: &Group, mark: &str, out: &mut String) {
    let _ = write!(
        out,
        "- name: Merge{mark}\n  dependencies: [{{dependsOn: Render{mark}}}]\n  parameterSpace:\n    \
         taskParameterDefinitions:\n    - {{name: Scene, type: STRING, range: {}}}\n",
        list(&group.scenes)
    );
    let mut place = "{{Param.OutputDir}}/parts/{{Task.Param.Scene}}".to_owned();
    if !group.frames.is_empty() {
        let _ = writeln!(out, "    - {{name: Frame, type: INT, range: \"{{{{Param.Frames{mark}}}}}\"}}");
        place += "/{{Task.Param.Frame}}";
    }
    action(&["merge", &place, "-o", "{{Param.OutputDir}}", "--threads", "{{Param.Threads}}"], out);
}

#[cfg(test)]
mod tests {
    use super::super::Cut;
    use super::super::tests::job;
    use super::*;

    /// Whether it is a template says `openjd check`, in tools/checks.
    #[test]
    fn the_template_has_a_step_for_each_set_of_frames() {
        let text = |cut: Cut| template(&job(cut));
        let steps = |text: &str| -> Vec<String> {
            text.lines().filter_map(|line| line.strip_prefix("- name: ").map(str::to_owned)).collect()
        };
        let whole = text(Cut { tiles: 1, ranges: 1, frames: 2 });
        assert_eq!(steps(&whole), ["Render", "Render2"]);
        assert!(whole.contains("    combination: Scene * Frame\n"));
        // A name may begin like an option.
        assert!(whole.contains("\"--scene={{Task.Param.Scene}}\""));
        assert!(whole.contains("- {name: Frames, type: STRING, default: \"1-11:5\"}\n"));
        let parts = text(Cut { tiles: 2, ranges: 1, frames: 2 });
        assert_eq!(steps(&parts), ["Render", "Merge", "Render2", "Merge2"]);
        assert!(parts.contains("    combination: Scene * Frame * Tile\n"));
        assert!(parts.contains("- {name: Scene, type: STRING, range: [\"a\", \"b c\"]}\n"));
        assert!(parts.contains("\"--set\", \"render.seed='x y'\"]\n"));
        let files = files(&job(Cut { tiles: 1, ranges: 1, frames: 1 })).unwrap();
        assert!(files[1].text.contains("/in/it's.yaml"));
    }

    /// YAML breaks lines at some letters, and takes others by their number alone; the rest stays as it is.
    #[test]
    fn letters_that_yaml_does_not_take_are_written_by_their_numbers() {
        let name = "a \u{2028} b\u{2029}\u{7f}\u{85}\u{feff}\u{ffff} é\u{1f600}\"";
        let written = quoted(name);
        assert_eq!(written, "\"a \\u2028 b\\u2029\\u007f\\u0085\\ufeff\\uffff é\u{1f600}\\\"\"");
        assert_eq!(serde_json::from_str::<String>(&written).unwrap(), name);
    }

    /// `openjd check` refused what was written. Of 50 parameters a job with frames has 6 of its own.
    #[test]
    fn what_a_template_cannot_hold_is_refused_or_shared_out() {
        let one = job(Cut { tiles: 1, ranges: 1, frames: 1 });
        let group =
            |scenes: usize, frames: Vec<i32>| Group { scenes: (0..scenes).map(|i| format!("s{i}")).collect(), frames };
        let of = |groups: Vec<Group>| files(&Job { groups, ..one.clone() });
        let says = |groups: Vec<Group>| of(groups).unwrap_err().to_string();
        // Squares have no steps in common.
        let squares = |n: i32| (0..n).map(|i| i * i).collect::<Vec<i32>>();
        let most = (1..400).filter(|n| frames_in_short(&squares(*n)).len() <= 1024).max().unwrap();
        let long = frames_in_short(&squares(most + 1)).len();
        assert!(of(vec![group(1, squares(most))]).is_ok());
        let expected =
            "s0: render.frames, written in short: expected at most 1024 letters, as many as Open Job Description";
        assert_eq!(says(vec![group(1, squares(most + 1))]), format!("{expected} allows, found {long}"));

        let steps = |files: Vec<BundleFile>| files[0].text.matches("- name: Render").count();
        assert_eq!(steps(of(vec![group(1024, vec![])]).unwrap()), 1);
        assert_eq!(steps(of(vec![group(1025, vec![])]).unwrap()), 2);

        let sets = |n: i32| (1..=n).map(|last| group(1, (0..last).collect())).collect::<Vec<Group>>();
        assert!(of(sets(44)).is_ok());
        assert!(says(sets(45)).starts_with("render.frames: expected at most 44 different sets of frames in one job"));

        let told = |names: Group| Job { groups: vec![names], ..one.clone() };
        let closed = Group { scenes: vec!["a}}".into()], frames: vec![] };
        let expected = "a}}: expected a name without }}, which ends a variable of Open Job Description, found one";
        assert_eq!(files(&told(closed)).unwrap_err().to_string(), expected);
    }

    /// `openjd check` refused a template with `}}` in an argument, "Missing opening braces", and so refused a map in a map, and one with
    /// a tab, "does not match the required pattern".
    #[test]
    fn arguments_that_a_template_cannot_hold_are_the_values_of_parameters() {
        let arguments = ["--set", "a={b: {c: d}}", "--set", "e={f: g}", "--set", "h=\"{{i\""].map(String::from);
        let job = Job { arguments: arguments.into(), ..job(Cut { tiles: 2, ranges: 1, frames: 1 }) };
        let text = template(&job);
        let told = "\"--set\", \"{{Param.Argument1}}\", \"--set\", \"e={f: g}\", \"--set\", \"{{Param.Argument5}}\"]\n";
        assert_eq!(text.matches(told).count(), 2, "{text}");
        for (i, value) in [(1, "\"a={b: {c: d}}\""), (5, "\"h=\\\"{{i\\\"\"")] {
            let line = format!(
                "- {{name: Argument{i}, type: STRING, default: {value}, userInterface: {{control: HIDDEN}}}}\n"
            );
            assert_eq!(text.matches(&line).count(), 1, "{text}");
        }
        assert!(files(&job).is_ok());
        let control = Job { arguments: ["a=\tb", "a=\nb", "a=\u{7f}"].map(String::from).into(), ..job.clone() };
        assert_eq!(braced(&control).map(|(i, _)| i).collect::<Vec<_>>(), [0, 2]);
        let long = Job { arguments: vec![format!("{{{{{}", "x".repeat(1023))], ..job };
        assert!(files(&long).unwrap_err().to_string().ends_with("as Open Job Description allows, found 1025"));
    }

    /// `openjd run` refused a job whose name had the end of a line of the name of its file.
    #[test]
    fn the_name_of_a_job_has_no_control_characters() {
        let job = Job { name: "a\nb\u{7f}".into(), ..job(Cut { tiles: 1, ranges: 1, frames: 1 }) };
        assert!(template(&job).contains("- {name: JobName, type: STRING, default: \"ab\"}\n"));
    }
}
