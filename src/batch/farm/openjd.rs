//! A job bundle of Open Job Description (2023-09), which `openjd run` runs and Deadline Cloud takes.
//!
//! No shell stands between the engine and `abbe`: that a task is to end reaches it as SIGTERM, it writes a checkpoint and
//! ends with 75. To the engine that is a task that failed; run again it goes on from there.

use super::NO_SHEET;
use super::{BundleFile, Group, Job};
use crate::description::frames_in_short;
use serde_json::json;
use std::fmt::Write;

/// The files of the bundle.
#[must_use]
pub fn files(job: &Job) -> Vec<BundleFile> {
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
    // JSON is YAML.
    vec![
        file("template.yaml", template(job)),
        file("parameter_values.yaml", format!("{values:#}\n")),
        file("asset_references.yaml", format!("{assets:#}\n")),
        file("parameters.json", format!("{:#}\n", json!({"Batch": source, "OutputDir": pictures}))),
    ]
}

/// A text as YAML writes it in quotes.
fn quoted(text: &str) -> String {
    json!(text).to_string()
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
    let mut out = String::new();
    let name = quoted(&job.name.chars().take(100).collect::<String>());
    let threads = job.threads;
    let program = quoted(&job.program);
    let _ = write!(
        out,
        "# abbe farm --format openjd: {} pictures\n\
         specificationVersion: jobtemplate-2023-09\n\
         extensions: [TASK_CHUNKING]\n\
         name: \"{{{{Param.JobName}}}}\"\n\
         parameterDefinitions:\n\
         - {{name: JobName, type: STRING, default: {name}}}\n\
         - {{name: Abbe, type: STRING, default: {program}, description: \"The program, on the path of each worker\"}}\n\
         - {{name: Batch, type: PATH, objectType: FILE, dataFlow: IN, description: \"The batch or scene\"}}\n\
         - {{name: OutputDir, type: PATH, objectType: DIRECTORY, dataFlow: OUT, description: \"Where the pictures go\"}}\n\
         - {{name: Threads, type: INT, default: {threads}, minValue: 0, description: \"Of a task; 0 for all that it may use\"}}\n",
        job.count()
    );
    if job.has_frames() {
        let _ = writeln!(
            out,
            "- {{name: FramesPerTask, type: INT, default: {}, minValue: 1, description: \"Frames in a row share what they load\"}}",
            job.cut.frames
        );
    }
    for (i, group) in job.groups.iter().enumerate().filter(|(_, group)| !group.frames.is_empty()) {
        // Its ranges may not overlap.
        let mut frames = group.frames.clone();
        frames.sort_unstable();
        let frames = quoted(&frames_in_short(&frames));
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
    arguments.extend(job.arguments.iter().map(String::as_str));
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
        assert!(files(&job(Cut { tiles: 1, ranges: 1, frames: 1 }))[1].text.contains("/in/it's.yaml"));
    }
}
