//! Scripts for Slurm: an array of tasks, and one that adds up the parts of each picture.
//!
//! What the scripts rest on: a step (`srun`) is told of a pre-emption when its time of grace begins, the script around it when it
//! ends; `scontrol requeue` works where the administrator has not named our exit codes in `RequeueExit`; and the merge
//! waits with `afterany`, since an array remembers the worst exit code of tasks that were well in the end. So the merge has to
//! find out by itself whether all parts are there, which it does.

use super::NO_SHEET;
use super::{BundleFile, Job};
use crate::description::frames_in_short;
use std::fmt::Write;

/// How often a task begins again before it is given up.
const RESTARTS: u32 = 20;

/// How a task that is given up ends: as one that could not write its picture. Not with 75, which `RequeueExit` may name, nor with 4,
/// which says that the picture is there.
const GIVEN_UP: i32 = 1;

/// The most bytes of a job's name, with which the names of its logs begin: file systems take 255.
const LONGEST: usize = 100;

/// The number of the line in which a task stands. Arrays after the first are told where they begin.
const NUMBER: &str = "number=$((${1:-0} + SLURM_ARRAY_TASK_ID))\n";

/// The files of the bundle.
#[must_use]
pub fn files(job: &Job) -> Vec<BundleFile> {
    let (tasks, pictures) = tables(job);
    let submit = submit(job, tasks.lines().count(), pictures.lines().count());
    let mut all = vec![
        BundleFile { name: "tasks.tsv", text: tasks, executable: false },
        BundleFile { name: "render.sbatch", text: render(job), executable: true },
    ];
    if job.cut.parts() {
        all.push(BundleFile { name: "pictures.tsv", text: pictures, executable: false });
        all.push(BundleFile { name: "merge.sbatch", text: merge(job), executable: true });
    }
    all.push(BundleFile { name: "submit.sh", text: submit, executable: true });
    all
}

/// The lines of tasks: scene, frames, tile, samples; and of pictures: scene, frame. Names of scenes have neither tabs nor ends of
/// lines.
fn tables(job: &Job) -> (String, String) {
    let (mut tasks, mut pictures) = (String::new(), String::new());
    for group in &job.groups {
        for scene in &group.scenes {
            let chunks: Vec<String> = match group.frames.is_empty() {
                true => vec!["-".into()],
                false => group.frames.chunks(job.cut.frames.max(1)).map(frames_in_short).collect(),
            };
            for frames in &chunks {
                for [tile, samples] in job.cut.each() {
                    let _ = writeln!(tasks, "{scene}\t{frames}\t{tile}\t{samples}");
                }
            }
            match group.frames.is_empty() {
                true => pictures += &format!("{scene}\t-\n"),
                false => group.frames.iter().for_each(|frame| pictures += &format!("{scene}\t{frame}\n")),
            }
        }
    }
    (tasks, pictures)
}

/// A word of the shell.
#[must_use]
pub fn word(text: &str) -> String {
    format!("'{}'", text.replace('\'', "'\\''"))
}

/// The head of both scripts.
fn head(job: &Job, name: &str, directives: &str) -> String {
    let mut job_name: String = job.name.chars().filter(|c| c.is_alphanumeric() || "-_.".contains(*c)).collect();
    job_name.truncate(job_name.floor_char_boundary(LONGEST));
    format!(
        "#!/bin/bash\n\
         #SBATCH --job-name={name}-{job_name}\n\
         #SBATCH --requeue\n\
         #SBATCH --open-mode=append\n\
         #SBATCH --output=log/%x_%A_%a.log\n\
         #SBATCH --ntasks=1\n\
         {directives}\
         # abbe farm --format slurm: started by submit.sh, in the directory of the bundle\n\
         set -uo pipefail\n\
         # Within ${{...}} of these two, bash would take quotes and braces for its own.\n\
         own_abbe={}\n\
         own_pictures={}\n\
         abbe=\"${{ABBE:-$own_abbe}}\"\n\
         pictures=\"${{ABBE_PICTURES:-$own_pictures}}\"\n\
         # From Slurm 22.05 on a step has one core where it does not ask for those of its job.\n\
         [ -z \"${{SLURM_CPUS_PER_TASK:-}}\" ] || export SRUN_CPUS_PER_TASK=\"$SLURM_CPUS_PER_TASK\"\n",
        word(&job.program),
        word(&job.pictures.display().to_string())
    )
}

fn render(job: &Job) -> String {
    let threads = match job.threads {
        0 => String::new(),
        n => format!("#SBATCH --cpus-per-task={n}\n"),
    };
    // Time to write a checkpoint before the limit of the partition.
    let directives = threads + "#SBATCH --signal=TERM@90\n";
    let mut command = format!(
        "srun --ntasks=1 --kill-on-bad-exit=1 \"$abbe\" render {} --scene=\"$scene\" \"${{what[@]}}\" \\\n    \
         --resume --progress plain",
        word(&job.source.display().to_string())
    );
    for argument in NO_SHEET.into_iter().chain(job.arguments.iter().map(String::as_str)) {
        command += " ";
        command += &word(argument);
    }
    let mut parts = String::new();
    if job.cut.tiles > 1 {
        parts += "what+=(--tile \"$tile\")\n";
    }
    // Where samples are shared out by noise a picture has no ranges of them, not even one.
    if job.cut.ranges > 1 {
        parts += "what+=(--samples \"$samples\")\n";
    }
    parts += match job.cut.parts() {
        true => "place=\"$pictures/parts/$scene\"\n[ \"$frames\" = - ] || place=\"$place/{frame}\"\n",
        false => "place=\"$pictures\"\n",
    };
    head(job, "render", &directives)
        + &format!(
            "{NUMBER}\
             line=$(sed -n \"$((number + 1))p\" tasks.tsv)\n\
             IFS=$'\\t' read -r scene frames tile samples <<<\"$line\"\n\
             what=()\n\
             [ \"$frames\" = - ] || what+=(--frames \"$frames\")\n\
             {parts}\
             what+=(-o \"$place\")\n\
             # The process ends by itself before the kernel kills it.\n\
             memory=${{SLURM_MEM_PER_NODE:-$((${{SLURM_MEM_PER_CPU:-0}} * ${{SLURM_CPUS_ON_NODE:-1}}))}}\n\
             ((memory == 0)) || what+=(--memory-limit \"${{memory}}M\")\n\
             echo \"task $number: $line: on ${{SLURMD_NODENAME:-?}}, begun again ${{SLURM_RESTART_COUNT:-0}} times\"\n\
             {command}\n"
        )
        + &ends()
}

/// What both scripts do with the exit code of their command.
fn ends() -> String {
    format!(
        "code=$?\n\
         # 75: stopped, and kept in a checkpoint; 137: killed. Both go on elsewhere, but not for ever.\n\
         restarts=${{SLURM_RESTART_COUNT:-0}}\n\
         if [[ $code == 75 || $code == 137 ]]; then\n    \
             if ((restarts >= {RESTARTS})); then\n        \
                 echo \"given up after $restarts restarts\" >&2\n        \
                 exit {GIVEN_UP}\n    \
             fi\n    \
             # It ends this script, too.\n    \
             scontrol requeue \"$SLURM_JOB_ID\" && sleep 60\n\
         fi\n\
         exit $code\n"
    )
}

fn merge(job: &Job) -> String {
    head(job, "merge", "")
        + NUMBER
        + "IFS=$'\\t' read -r scene frame <<<\"$(sed -n \"$((number + 1))p\" pictures.tsv)\"\n\
           place=\"$pictures/parts/$scene\"\n\
           [ \"$frame\" = - ] || place=\"$place/$frame\"\n\
           # 3: a part is missing, damaged or of another picture.\n\
           srun --ntasks=1 \"$abbe\" merge \"$place\" -o \"$pictures\"\n"
        + &ends()
}

/// Sends the tasks off as arrays of what Slurm takes at the most; the number of the first of each is told to its script.
fn submit(job: &Job, tasks: usize, pictures: usize) -> String {
    let mut out = format!(
        "#!/bin/bash\n\
         # submit.sh [options of sbatch, as -p spot --mem=4G --cpus-per-task=8]: {} pictures in {tasks} tasks\n\
         set -euo pipefail\n\
         # By CDPATH cd would look elsewhere first.\n\
         unset CDPATH\n\
         cd \"$(dirname \"${{BASH_SOURCE[0]}}\")\"\n\
         mkdir -p log\n\
         most=$({{ scontrol show config || true; }} | sed -n 's/^MaxArraySize *= *\\([1-9][0-9]*\\).*/\\1/p')\n\
         most=${{most:-1001}}\n\
         # submit SCRIPT TASKS [options]: the jobs, with colons between\n\
         submit() {{\n    \
             local script=$1 tasks=$2 first=0 jobs=() many job\n    \
             shift 2\n    \
             while ((first < tasks)); do\n        \
                 many=$((tasks - first))\n        \
                 ((many <= most)) || many=$most\n        \
                 job=$(sbatch --parsable --array=0-$((many - 1)) \"$@\" \"$script\" \"$first\") || {{\n            \
                     [ ${{#jobs[@]}} = 0 ] || echo \"already submitted: scancel ${{jobs[*]}}\" >&2\n            \
                     return 1\n        \
                 }}\n        \
                 jobs+=(\"${{job%%;*}}\")\n        \
                 first=$((first + many))\n    \
             done\n    \
             (IFS=:; echo \"${{jobs[*]}}\")\n\
         }}\n\
         render=$(submit render.sbatch {tasks} \"$@\")\n\
         echo \"render: job $render\"\n",
        job.count(),
    );
    if job.cut.parts() {
        let _ = write!(
            out,
            "merge=$(submit merge.sbatch {pictures} \"$@\" -d afterany:\"$render\")\n\
             echo \"merge: job $merge\"\n"
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::Cut;
    use super::super::tests::job;
    use super::*;

    #[test]
    fn each_part_of_each_chunk_is_a_task_and_each_frame_a_picture() {
        let (tasks, pictures) = tables(&job(Cut { tiles: 2, ranges: 1, frames: 2 }));
        assert_eq!(
            tasks,
            "a\t1,6\t0/2\t0/1\na\t1,6\t1/2\t0/1\na\t11\t0/2\t0/1\na\t11\t1/2\t0/1\n\
             b c\t1,6\t0/2\t0/1\nb c\t1,6\t1/2\t0/1\nb c\t11\t0/2\t0/1\nb c\t11\t1/2\t0/1\n\
             still\t-\t0/2\t0/1\nstill\t-\t1/2\t0/1\n"
        );
        assert_eq!(pictures, "a\t1\na\t6\na\t11\nb c\t1\nb c\t6\nb c\t11\nstill\t-\n");
    }

    /// bash reads what is written, with quotes in names.
    #[cfg(unix)]
    #[test]
    fn the_scripts_are_bash() {
        for file in files(&job(Cut { tiles: 2, ranges: 2, frames: 1 })).iter().filter(|file| file.executable) {
            let done = std::process::Command::new("bash").args(["-n", "-c", &file.text]).output().unwrap();
            assert!(done.status.success(), "{}: {}", file.name, String::from_utf8_lossy(&done.stderr));
        }
        // Ranges of samples are named where there are several: adaptive sampling knows none.
        let tiles = render(&job(Cut { tiles: 2, ranges: 1, frames: 1 }));
        assert!(tiles.contains("what+=(--tile \"$tile\")\n") && !tiles.contains("--samples"), "{tiles}");
        // What is killed goes on elsewhere, be it a part or what merges them.
        for script in [tiles, merge(&job(Cut { tiles: 2, ranges: 1, frames: 1 }))] {
            assert!(script.contains("$code == 137") && script.contains("scontrol requeue"), "{script}");
        }
        // A name may begin like an option.
        assert!(render(&job(Cut { tiles: 1, ranges: 1, frames: 1 })).contains(" --scene=\"$scene\" "));
        assert_eq!(word("it's"), "'it'\\''s'");
    }

    /// An array takes what Slurm's `MaxArraySize` says: ten tasks go in arrays of four, four and two, and what merges waits for all.
    /// Where it cannot be asked they are 1001 at the most. A refusal ends the script and tells what is waiting already.
    #[cfg(unix)]
    #[test]
    fn more_tasks_than_an_array_takes_go_in_several() {
        let place = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            use std::os::unix::fs::PermissionsExt;
            let path = place.path().join(name);
            std::fs::write(&path, text).unwrap();
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        };
        for file in files(&job(Cut { tiles: 2, ranges: 1, frames: 2 })) {
            write(file.name, &file.text);
        }
        // Jobs are numbered from 10 on; the one of this number among all is refused.
        write(
            "sbatch",
            "#!/bin/bash\necho \"$*\" >>calls\nn=$(wc -l <calls)\n[ -z \"${REFUSED:-}\" ] || ((n < REFUSED)) || exit 7\n\
             echo \"$((9 + n));here\"\n",
        );
        let submit = |config: &str, refused: &str| {
            write("scontrol", config);
            _ = std::fs::remove_file(place.path().join("calls"));
            let path = format!("{}:{}", place.path().display(), std::env::var("PATH").unwrap());
            let done = std::process::Command::new(place.path().join("submit.sh"))
                .args(["-p", "two words"])
                .envs([("PATH", path.as_str()), ("REFUSED", refused)])
                .output()
                .unwrap();
            let calls = std::fs::read_to_string(place.path().join("calls")).unwrap();
            let [out, err] = [done.stdout, done.stderr].map(|said| String::from_utf8(said).unwrap());
            (done.status.success(), calls, out, err)
        };
        let (succeeded, calls, out, err) = submit("#!/bin/bash\necho 'MaxArraySize            = 4'\n", "");
        assert!(succeeded, "{err}");
        assert_eq!(
            calls,
            "--parsable --array=0-3 -p two words render.sbatch 0\n\
             --parsable --array=0-3 -p two words render.sbatch 4\n\
             --parsable --array=0-1 -p two words render.sbatch 8\n\
             --parsable --array=0-3 -p two words -d afterany:10:11:12 merge.sbatch 0\n\
             --parsable --array=0-2 -p two words -d afterany:10:11:12 merge.sbatch 4\n"
        );
        assert_eq!(out, "render: job 10:11:12\nmerge: job 13:14\n");
        let (succeeded, calls, ..) = submit("#!/bin/bash\nexit 1\n", "");
        assert!(succeeded && calls.starts_with("--parsable --array=0-9 -p two words render.sbatch 0\n"), "{calls}");
        let (succeeded, calls, out, err) = submit("#!/bin/bash\necho 'MaxArraySize = 4'\n", "3");
        assert!(!succeeded && calls.lines().count() == 3 && out.is_empty(), "{calls}{out}");
        assert_eq!(err, "already submitted: scancel 10 11\n");
        // Called by a relative name, it stays where it is, whatever CDPATH says.
        let (parent, name) = (place.path().parent().unwrap(), place.path().file_name().unwrap());
        let elsewhere = tempfile::tempdir().unwrap();
        std::fs::create_dir(elsewhere.path().join(name)).unwrap();
        let path = format!("{}:{}", place.path().display(), std::env::var("PATH").unwrap());
        let done = std::process::Command::new("bash")
            .arg(std::path::Path::new(name).join("submit.sh"))
            .current_dir(parent)
            .env("PATH", path)
            .env("CDPATH", elsewhere.path())
            .output()
            .unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        assert!(!elsewhere.path().join(name).join("log").exists());
    }

    /// Within `${…:-…}` an apostrophe began a text that did not end, and a brace ended the path.
    #[cfg(unix)]
    #[test]
    fn the_scripts_have_the_paths_that_were_given() {
        for path in ["/o/it's", "/o/{B1-2}/x", "/o/\"$`\\ }", "/o/two\nlines"] {
            let own =
                Job { pictures: path.into(), program: path.into(), ..job(Cut { tiles: 1, ranges: 1, frames: 1 }) };
            let script = head(&own, "render", "") + "printf '%s|%s' \"$abbe\" \"$pictures\"";
            let said = |others: &[(&str, &str)]| {
                let mut bash = std::process::Command::new("bash");
                bash.args(["-c", &script]).env_remove("ABBE").env_remove("ABBE_PICTURES");
                String::from_utf8(bash.envs(others.iter().copied()).output().unwrap().stdout).unwrap()
            };
            assert_eq!(said(&[]), format!("{path}|{path}"));
            assert_eq!(said(&[("ABBE", "/a b"), ("ABBE_PICTURES", "/c'}")]), "/a b|/c'}");
        }
    }

    /// A log is called `NAME_JOB_TASK.log`, with numbers of ten digits at the most: 26 bytes besides the name.
    #[test]
    fn the_names_of_logs_are_names_of_files() {
        let long = Job { name: "é".repeat(125), ..job(Cut { tiles: 2, ranges: 1, frames: 1 }) };
        for script in [render(&long), merge(&long)] {
            let name = script.lines().find_map(|line| line.strip_prefix("#SBATCH --job-name=")).unwrap();
            assert!(name.len() + 26 <= 255 && name.ends_with("ééé"), "{name}");
        }
    }
}
