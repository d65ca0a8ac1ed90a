//! Files that cannot be written: one error, its exit code, nothing half, and nothing lost.
#![cfg(unix)]

mod common;

use common::place::{Place, Ran, pixels};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Pictures, parts and checkpoints of more than ten kilobytes.
const SCENE: &str = "camera: {origin: [0, 1.5, 6], target: [0, 0.7, 0], fov_deg: 40}\n\
                     image: {width: 80, height: 60}\n\
                     render: {samples: 4, seed: 3}\n\
                     output: {exr: {precision: float}}\n\
                     lights: [{constant: {radiance: 0.3}}]\n\
                     shapes: [{plane: {normal: [0, 1, 0]}}, {sphere: {center: [0, 1, 0], radius: 1}}]\n";

/// Runs the command where no file may have more than a few kilobytes: to it, that is a disk that fills while a file is
/// written. It ended by SIGXFSZ without a word, and with it the rest of a batch.
fn cramped(place: &Place, arguments: &[&str]) -> Ran {
    let script = "ulimit -f 8; exec \"$0\" \"$@\"";
    let mut command = Command::new("bash");
    command.args(["-c", script, env!("CARGO_BIN_EXE_abbe")]).args(arguments);
    Ran::of(command.current_dir(place.directory.path()).output().unwrap())
}

#[test]
fn a_disk_that_fills_leaves_no_half_picture_and_the_next_run_makes_it() {
    let place = Place::of(SCENE);
    let ran = cramped(&place, &["render", "scene.yaml", "-q", "-o", "out"]);
    assert_eq!(ran.code, 1, "{}", ran.err);
    assert!(ran.err.starts_with("error: scene: out/scene.exr: cannot write: "), "{}", ran.err);
    assert_eq!((ran.err.lines().count(), place.names("out")), (1, vec!["report.json".to_owned()]));
    assert_eq!(place.run(&["render", "scene.yaml", "-q", "-o", "out", "--resume"]).code, 0);
    assert_eq!(place.run(&["render", "scene.yaml", "-q", "-o", "whole"]).code, 0);
    assert!(pixels(&place.path("out/scene.exr")) == pixels(&place.path("whole/scene.exr")));
}

#[test]
fn a_disk_that_fills_leaves_the_old_picture_alone() {
    let place = Place::of(SCENE);
    assert_eq!(place.run(&["render", "scene.yaml", "-q", "-o", "out"]).code, 0);
    let before = std::fs::read(place.path("out/scene.exr")).unwrap();
    assert_eq!(cramped(&place, &["render", "scene.yaml", "-q", "-o", "out", "--seed", "9"]).code, 1);
    assert!(std::fs::read(place.path("out/scene.exr")).unwrap() == before);
}

#[test]
fn a_disk_that_fills_leaves_no_half_part_and_all_parts_when_they_are_merged() {
    let place = Place::of(SCENE);
    let part = ["render", "scene.yaml", "-q", "-o", "parts", "--tile"];
    let ran = cramped(&place, &[&part[..], &["0/2"]].concat());
    assert!(ran.code == 1 && ran.err.contains("parts/scene.tile0of2.exr: cannot write: "), "{}", ran.err);
    assert_eq!(place.names("parts"), ["report.tile0of2.json"]);
    for tile in ["0/2", "1/2"] {
        assert_eq!(place.run(&[&part[..], &[tile]].concat()).code, 0);
    }
    let merge = ["merge", "parts", "-q", "-o", "merged"];
    let ran = cramped(&place, &merge);
    assert!(ran.code == 1 && ran.err.contains("merged/scene.exr: cannot write: "), "{}", ran.err);
    assert_eq!(place.names("merged"), ["report.scene.json"]);
    assert_eq!(place.run(&merge).code, 0);
    assert_eq!(place.run(&["render", "scene.yaml", "-q", "-o", "whole"]).code, 0);
    assert!(pixels(&place.path("merged/scene.exr")) == pixels(&place.path("whole/scene.exr")));
}

/// A checkpoint for which there is no room is a note, at once and in the end; the picture is made all the same, if it fits.
#[test]
fn a_checkpoint_for_which_there_is_no_room_costs_nothing() {
    let place = Place::of(SCENE);
    let small = ["render", "scene.yaml", "-o", "out", "--checkpoint-interval", "0.001s", "--spp", "256"];
    let size = ["--set", "image.width=40", "--set", "image.height=20", "--set", "output.exr.precision=half"];
    let ran = cramped(&place, &[&small[..], &size, &["-q"]].concat());
    assert_eq!(ran.code, 0, "{}", ran.err);
    let note = "note: scene: no checkpoint: out/scene.exr.checkpoint: cannot write: ";
    assert!(ran.err.starts_with(note) && ran.err.matches(note).count() == 2, "{}", ran.err);
    assert_eq!(place.names("out"), ["report.json", "scene.exr", "scene.png"]);
    let ran = cramped(&place, &[&small[..], &size, &["--progress", "json"]].concat());
    let said: Vec<&str> = ran.out.lines().filter(|line| line.contains("no checkpoint")).collect();
    let is = |line: &str, event: &str| line.contains(&format!("\"event\":\"{event}\""));
    assert!(said.len() == 2 && is(said[0], "note") && is(said[1], "done"), "{}", ran.out);
}

/// Somebody tidies up while a picture or a part is rendered, before a checkpoint or where there is none: it is written all the same,
/// and a note says where.
#[test]
fn a_directory_that_is_removed_while_a_picture_is_rendered_is_made_again() {
    for (interval, part, name) in [
        ("0.4s", &[][..], "scene.exr"),
        ("0", &[], "scene.exr"),
        ("0", &["--samples", "0-2047"], "scene.samples0-2047.exr"),
    ] {
        let place = Place::of(SCENE);
        let long = ["render", "scene.yaml", "-o", "out/new", "--spp", "2048", "--checkpoint-interval", interval];
        let mut command = Command::new(env!("CARGO_BIN_EXE_abbe"));
        command.args(long).args(part).current_dir(place.directory.path()).stderr(Stdio::piped());
        let child = command.stdout(Stdio::null()).spawn().unwrap();
        while !place.path("out/new").exists() {
            std::thread::sleep(Duration::from_millis(5));
        }
        // What is tried out there is over.
        std::thread::sleep(Duration::from_millis(200));
        std::fs::remove_dir_all(place.path("out")).unwrap();
        let ended = child.wait_with_output().unwrap();
        let told = String::from_utf8(ended.stderr).unwrap();
        assert!(ended.status.success() && told.contains("out/new was removed meanwhile, and is made again"), "{told}");
        assert!(place.names("out/new").contains(&name.to_owned()), "{:?}", place.names("out/new"));
    }
}

#[test]
fn rules_for_paths_that_cannot_be_read_are_an_input_error() {
    let place = Place::with(&[
        ("scene.yaml", SCENE),
        ("rules.json", "{\"version\": \"pathmapping-1.0\", \"path_mapping_rules\": 3}"),
    ]);
    let says = |arguments: &[&str], code: i32| {
        let ran = place.run(&[&["render", "scene.yaml", "-q"], arguments].concat());
        assert_eq!(ran.code, code, "{}", ran.err);
        ran.err
    };
    assert!(says(&["--path-map-file", "none.json"], 3).starts_with("error: none.json: cannot be read: No such file"));
    assert!(
        says(&["--path-map-file", "rules.json"], 3)
            .starts_with("error: rules.json: expected rules as of pathmapping-1.0, found")
    );
    assert!(says(&["--path-map", "x"], 2).contains("expected FROM=TO, two directories, found \"x\""));
    // Nobody writes to the one, and the other has no end.
    assert!(Command::new("mkfifo").arg(place.path("fifo")).status().unwrap().success());
    let fifo = says(&["--path-map-file", "fifo"], 3);
    assert_eq!(fifo, "error: fifo: cannot be read: expected a regular file, found a FIFO\n");
    assert!(says(&["--path-map-file", "/dev/zero"], 3).starts_with("error: /dev/zero: expected rules as of"));
}

#[test]
fn a_job_for_a_farm_is_refused_where_its_tasks_would_be() {
    let keyed = format!("{SCENE}fog: {{colour: {{0: 0, 9: 1}}, density: 0.1}}\n");
    let stop = SCENE.replace("samples: 4", "stop: {error: 0.1}");
    let batch = "scenes: [{file: scene.yaml}, {file: keyed.yaml}, {file: none.yaml}]\n";
    let place =
        Place::with(&[("scene.yaml", SCENE), ("keyed.yaml", &keyed), ("stop.yaml", &stop), ("batch.yaml", batch)]);
    let says = |arguments: &[&str]| {
        let ran = place.run(&[&["farm", "--format", "slurm", "-o", "job"], arguments].concat());
        assert_eq!((ran.code, place.names("job").len()), (2, 0), "{}", ran.err);
        ran.err
    };
    assert_eq!(
        says(&["scene.yaml", "--tiles", "61"]),
        "error: scene: --tiles 61: expected at most 60, the rows of the picture\n"
    );
    assert_eq!(
        says(&["scene.yaml", "--sample-ranges", "5"]),
        "error: scene: --sample-ranges 5: expected at most 4, the samples of a pixel\n"
    );
    assert_eq!(
        says(&["scene.yaml", "--pictures", "shots/{scen}"]),
        "error: --pictures shots/{scen}: expected {scene}, {frame}, {frame:04}, %04d or #### in a pattern, found {scen}\n"
    );
    assert!(says(&["stop.yaml", "--tiles", "2"]).contains("render.stop: a part cannot know the error or the time"));
    // Of 60 rows cells of 8 make eight, if there are samples to be shared out.
    let cells = |samples: &str| {
        let set = format!("render={{samples: {samples}, techniques: {{adaptive: on}}}}");
        says(&["scene.yaml", "--tiles", "61", "--set", &set])
    };
    let rows = |rows: &str| format!("error: scene: --tiles 61: expected at most {rows} of the picture\n");
    assert_eq!((cells("16"), cells("8")), (rows("8, the rows of cells of adaptive sampling"), rows("60, the rows")));
    // Each frame has its own rows and samples.
    assert_eq!(
        says(&["scene.yaml", "--tiles", "9", "--frames", "1-4", "--set", "image.height={1: 60, 4: 6}"]),
        "error: scene.0004: --tiles 9: expected at most 6, the rows of the picture\n"
    );
    // All that is wrong is told at once.
    let message = says(&["batch.yaml"]);
    assert!(message.contains("keyed.yaml:7:15: fog.colour: expected render.frames or --frames"), "{message}");
    assert!(message.contains("none.yaml: cannot be read") && message.lines().count() == 2, "{message}");
}

/// Each task knows its own picture alone, and would write it over those of the others.
#[test]
fn a_job_for_a_farm_has_a_place_for_each_picture() {
    let two = "scenes: [{file: scene.yaml, name: a}, {file: scene.yaml, name: b}]\n";
    let odd = "scenes: [{file: scene.yaml, name: n.exr}]\n";
    let place = Place::with(&[("scene.yaml", SCENE), ("two.yaml", two), ("odd.yaml", odd)]);
    let farm = |arguments: &str| {
        let all = format!("farm --format slurm -q -o job {arguments}");
        let ran = place.run(&all.split(' ').collect::<Vec<_>>());
        (ran.code, ran.err)
    };
    let refused = |message: &str| (2, format!("error: {message}\n"));
    assert_eq!(
        farm("scene.yaml --frames 1-2 --pictures a.exr"),
        refused(
            "--pictures a.exr: expected a directory for 2 frames, or a pattern as a.####.exr, a.%04d.exr or \
             {scene}.{frame:04}.exr, found the name of one file"
        )
    );
    let scenes = "expected a directory for 2 scenes, or a pattern with {scene}, found the name of one file";
    assert_eq!(farm("two.yaml --pictures a.exr"), refused(&format!("--pictures a.exr: {scenes}")));
    assert_eq!(
        farm("two.yaml --frames 1-2 --pictures a.####.exr"),
        refused(&format!("--pictures a.####.exr: {scenes}"))
    );
    assert_eq!(
        farm("scene.yaml --tiles 2 --pictures a.exr"),
        refused("--pictures a.exr: expected a directory for parts of pictures, found the name of one file")
    );
    assert_eq!(
        farm("odd.yaml --tiles 2"),
        refused("n.exr: expected a name that does not end in .exr, for the directory of its parts")
    );
    for well in ["scene.yaml --pictures a.exr", "two.yaml --frames 1-2 --pictures {scene}.####.exr", "odd.yaml"] {
        assert_eq!(farm(well), (0, String::new()), "{well}");
    }
}

/// Frame 11 of `a` and frame 1 of `a1` are one file or two, and so are the bands of `x` and the picture `x.spectral`.
#[test]
fn a_job_for_a_farm_is_held_to_the_names_that_its_tasks_will_write() {
    let batch = |one: &str, two: &str| {
        format!(
            "output: {{spectral: {{bands: 3}}}}\nscenes: [{{file: scene.yaml, name: {one}}}, {{file: scene.yaml, name: {two}}}]\n"
        )
    };
    let place =
        Place::with(&[("scene.yaml", SCENE), ("a.yaml", &batch("a", "a1")), ("x.yaml", &batch("x", "x.spectral"))]);
    for verb in [&["farm", "--format", "slurm", "-o", "job", "--pictures"][..], &["render", "--spp", "4", "-o"]] {
        for (batch, frames, pictures, clash) in [
            ("a.yaml", &["--frames", "1,11"][..], "{scene}{frame}.exr", "a11.exr would be that of frame 11"),
            ("x.yaml", &[], "out", "out/x.spectral.exr would be that of scene \"x\""),
            ("x.yaml", &[], "{scene}/p.exr", ""),
        ] {
            let ran = place.run(&[verb, &[pictures, batch, "-q"], frames].concat());
            let expected = if clash.is_empty() { 0 } else { 2 };
            assert!(ran.code == expected && ran.err.contains(clash), "{verb:?} {pictures}: {}", ran.err);
        }
    }
}

/// A task takes what it is told with `-o` for a pattern; the merge, that looks for parts, takes it as it stands.
#[test]
fn a_job_for_a_farm_whose_names_are_patterns_is_refused() {
    let batch = "scenes: [{file: scene.yaml, name: \"a#1\"}, {file: scene.yaml, name: \"b%d{x}\"}]\n";
    let place = Place::with(&[("scene.yaml", SCENE), ("batch.yaml", batch), ("here#/scene.yaml", SCENE)]);
    let farm = |directory: &str, arguments: &[&str]| {
        let all = [&["farm", "--format", "slurm", "-q"], arguments].concat();
        let ran = Ran::of(place.command(&all).current_dir(place.path(directory)).output().unwrap());
        (ran.code, ran.err)
    };
    let name = |name: &str, mark: &str| {
        format!(
            "{name}: expected a name of plain text, which is part of the pattern for its parts, found one with {mark}"
        )
    };
    let (a, b) = (name("a#1", "#"), name("b%d{x}", "%d"));
    let both = ["batch.yaml", "--frames", "1-3", "-o", "job"];
    assert_eq!(farm(".", &[&both[..], &["--tiles", "2"]].concat()), (2, format!("error: {a}\nerror: {b}\n")));
    assert_eq!(farm(".", &both), (0, String::new()));
    // Without frames the marks of frames are text.
    let b = name("b%d{x}", "{x}");
    assert_eq!(farm(".", &["batch.yaml", "-o", "job", "--tiles", "2"]), (2, format!("error: {b}\n")));

    let plain = |what: &str, mark: &str| {
        (2, format!("error: {what}: expected a place of plain text, found {mark}, which is a pattern\n"))
    };
    let frames = ["scene.yaml", "--frames", "1-3"];
    let framed = |directory: &str, further: &[&str]| farm(directory, &[&frames[..], further].concat());
    assert_eq!(framed(".", &["-o", "job#1"]), plain("-o job#1", "#"));
    assert_eq!(farm(".", &["scene.yaml", "-o", "job#1"]), (0, String::new()));
    let shots = ["--pictures", "shots/####", "-o", "job"];
    assert_eq!(framed(".", &shots), (0, String::new()));
    assert_eq!(framed(".", &[&shots[..], &["--sample-ranges", "2"]].concat()), plain("--pictures shots/####", "####"));
    let here = place.directory.path().canonicalize().unwrap().join("here#");
    let here = format!("the working directory {}", here.display());
    assert_eq!(framed("here#", &["--pictures", "out", "-o", "/tmp"]), plain(&here, "#"));
}

/// A scene that no batch names has the name of its file, of which a tab made two columns of the table of tasks, and an end of a
/// line two tasks.
#[cfg(unix)]
#[test]
fn a_job_for_a_farm_whose_names_are_no_columns_is_refused() {
    let names = ["a\tb", "a\nb", "a\tb\n"];
    let files = names.map(|name| format!("{name}.yaml"));
    let place = Place::with(&files.each_ref().map(|file| (&**file, SCENE)));
    for (name, file) in names.iter().zip(&files) {
        for format in ["slurm", "openjd"] {
            let ran = place.run(&["farm", file, "-q", "--format", format, "-o", "job"]);
            let expected = format!("error: {name:?}: expected a name without control characters, found one\n");
            assert_eq!((ran.code, ran.err, place.names("job").len()), (2, expected, 0));
        }
    }
}

/// A task runs in the directory of the job, or of a session. Its texture lies where the command line and a file of rules
/// say, from the directory in which the job was made.
#[test]
fn tasks_of_a_farm_find_files_where_the_job_was_told_they_are() {
    let words = |texture: &str| SCENE.to_owned() + &format!("textures: {{t: {{image: {{file: {texture}}}}}}}\n");
    let rules = "{\"version\": \"pathmapping-1.0\", \"path_mapping_rules\": [{\"source_path_format\": \"POSIX\", \
                 \"source_path\": \"/old\", \"destination_path\": \"tex\"}]}";
    let place = Place::with(&[("scenes/a.yaml", &words("/old/t.png")), ("rules.json", rules), ("tex/x", "")]);
    image::GrayImage::new(2, 2).save(place.path("tex/t.png")).unwrap();
    let here = place.directory.path().canonicalize().unwrap();
    let rule = format!("/old={}", here.join("tex").display());
    for (i, (further, told)) in [
        (&["--path-map", "/old=tex"][..], ["--path-map", &rule]),
        (&["--path-map-file", "rules.json"], ["--path-map", &rule]),
        (&["--set", "textures.t.image.file=tex/t.png"], ["--set-from", here.to_str().unwrap()]),
        (&["--set", "textures.t={image: {file: t.png}}", "--set-from", "tex"], ["--set-from", &rule["/old=".len()..]]),
    ]
    .into_iter()
    .enumerate()
    {
        let job = format!("job{i}");
        let farm = |format: &str| {
            let asked = ["farm", "scenes/a.yaml", "-q", "--format", format, "-o", &job];
            let made = place.run(&[&asked, further].concat());
            assert_eq!((made.code, made.err.as_str()), (0, ""));
        };
        farm("slurm");
        let ran = task(&place, &job);
        assert_eq!(ran.code, 0, "{}", ran.err);
        assert!(place.path(&job).join("pictures/a.exr").is_file());
        farm("openjd");
        // All steps, for which no step is asked.
        let said = place.run(&[&["farm", "scenes/a.yaml", "--format", "openjd", "-o", &job], further].concat()).out;
        assert!(said.lines().any(|line| line.starts_with("openjd run ") && !line.contains("--step")), "{said}");
        let template = std::fs::read_to_string(place.path(&job).join("template.yaml")).unwrap();
        assert!(template.contains(&told.map(|word| format!("{word:?}")).join(", ")), "{template}");
    }
}

/// A task runs elsewhere: it looked for `./abbe` in the directory of the job, or of its session.
#[test]
fn tasks_of_a_farm_find_the_program_that_the_job_was_told() {
    let place = Place::of(SCENE);
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_abbe"), place.path("abbe")).unwrap();
    let here = place.directory.path().canonicalize().unwrap();
    let farm = |format: &str, program: &str| {
        let made = place.run(&[
            "farm",
            "scene.yaml",
            "-q",
            "--format",
            format,
            "-o",
            "job",
            "--program",
            program,
            "--spp",
            "1",
        ]);
        assert_eq!((made.code, made.err.as_str()), (0, ""));
    };
    farm("slurm", "./abbe");
    let ran = Ran::of(first_task(&place, "job").output().unwrap());
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(place.path("job/pictures/scene.exr").is_file());
    let own = format!("{:?}", here.join("abbe").display().to_string());
    for (program, expected) in [("./abbe", own.as_str()), ("abbe", "\"abbe\"")] {
        farm("openjd", program);
        let template = std::fs::read_to_string(place.path("job/template.yaml")).unwrap();
        assert!(template.contains(&format!("{{name: Abbe, type: STRING, default: {expected},")), "{template}");
    }
}

/// By 4 a task that was stopped twenty times said that its picture is written.
#[test]
fn a_task_that_is_given_up_says_so_by_a_code_of_no_picture() {
    let place = Place::of(SCENE);
    assert_eq!(place.run(&["farm", "scene.yaml", "-q", "--format", "slurm", "-o", "job"]).code, 0);
    let ends = |restarts: &str| {
        let mut command = Command::new("bash");
        // It cannot be put into the queue again here, either.
        command.args(["-c", "srun() { return 75; }; scontrol() { false; }; . ./render.sbatch"]);
        command.env("SLURM_ARRAY_TASK_ID", "0").env("SLURM_JOB_ID", "1").env("SLURM_RESTART_COUNT", restarts);
        Ran::of(command.current_dir(place.path("job")).output().unwrap())
    };
    let given_up = ends("20");
    assert_eq!((given_up.code, given_up.err.as_str()), (1, "given up after 20 restarts\n"));
    assert_eq!(ends("19").code, 75);
}

/// Slurm tells the memory of a job as `--mem` or `--mem-per-cpu` asked for it, in MiB.
#[test]
fn a_task_knows_its_memory_however_it_was_asked_for() {
    let place = Place::of(SCENE);
    assert_eq!(place.run(&["farm", "scene.yaml", "-q", "--format", "slurm", "-o", "job"]).code, 0);
    let limit = |told: &[(&str, &str)]| {
        let mut command = Command::new("bash");
        let srun =
            "srun() { while (($#)); do [ \"$1\" != --memory-limit ] || echo \"$2\"; shift; done; }; . ./render.sbatch";
        command.args(["-c", srun]);
        command.env("SLURM_ARRAY_TASK_ID", "0").envs(told.iter().copied());
        let ran = Ran::of(command.current_dir(place.path("job")).output().unwrap());
        assert_eq!((ran.code, ran.err.as_str()), (0, ""));
        ran.out.lines().nth(1).map(str::to_owned)
    };
    assert_eq!(limit(&[]), None);
    assert_eq!(limit(&[("SLURM_MEM_PER_NODE", "8192")]).as_deref(), Some("8192M"));
    assert_eq!(limit(&[("SLURM_MEM_PER_CPU", "2048"), ("SLURM_CPUS_ON_NODE", "8")]).as_deref(), Some("16384M"));
    // Where no memory was asked for and a node tells of none, it says 0.
    assert_eq!(limit(&[("SLURM_MEM_PER_NODE", "0")]), None);
}

/// The first task of a job of Slurm, without Slurm.
fn first_task(place: &Place, job: &str) -> Command {
    let run = "srun() { while [ \"${1#--}\" != \"$1\" ]; do shift; done; \"$@\"; }; . ./render.sbatch";
    let mut command = Command::new("bash");
    command.current_dir(place.path(job)).args(["-c", run]).env("SLURM_ARRAY_TASK_ID", "0");
    command
}

/// Runs the first task of a job of Slurm by this program.
fn task(place: &Place, job: &str) -> Ran {
    Ran::of(first_task(place, job).env("ABBE", env!("CARGO_BIN_EXE_abbe")).output().unwrap())
}

/// Even ranges cover all samples once, however many there are.
#[test]
fn samples_may_be_cut_into_even_ranges() {
    let place = Place::of(SCENE);
    let common = ["render", "scene.yaml", "-q", "--spp", "7"];
    for i in 0..3 {
        let samples = format!("{i}/3");
        // Two, two and three of seven; of a part that is there already, too.
        for further in [&[][..], &["--resume"]] {
            let ran = place.run(&[&common[..], &["-o", "parts", "--samples", &samples], further].concat());
            let scene = &place.json(&format!("parts/report.samples{i}of3.json"))["scenes"][0];
            assert_eq!((ran.code, scene["samples"].as_u64()), (0, Some([2, 2, 3][i])), "{}", ran.err);
        }
    }
    assert!(place.path("parts/scene.samples0of3.exr").is_file());
    assert_eq!(place.run(&["merge", "parts", "-q", "-o", "merged"]).code, 0);
    assert_eq!(place.run(&[&common[..], &["-o", "whole"]].concat()).code, 0);
    assert!(pixels(&place.path("merged/scene.exr")) == pixels(&place.path("whole/scene.exr")));
    let ran = place.run(&[&common[..], &["-o", "parts", "--samples", "0/8"]].concat());
    assert!(
        ran.code == 2 && ran.err.contains("--samples 0/8: expected i/n with i from 0 to n - 1 and n at most 7"),
        "{}",
        ran.err
    );
}

/// Files that the system refuses, and threads that hear signals, are trouble of that process: by 4 a picture would be there,
/// with samples that cannot be trusted.
#[test]
fn what_the_system_refuses_is_no_picture_with_invalid_samples() {
    let place = Place::of(SCENE);
    for files in 4..=8 {
        let script = format!("ulimit -n {files}; exec \"$0\" render scene.yaml -q -o out --threads 1");
        let mut command = Command::new("bash");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_abbe")]).current_dir(place.directory.path());
        let ran = Ran::of(command.output().unwrap());
        assert!([0, 1, 3, 127].contains(&ran.code), "{files}: {} {}", ran.code, ran.err);
    }
}

/// Where a process may have little address space, each limit is too small for another piece of its memory, of the distances of a
/// large grid above all, which have 16 MB in the file and as many once they are read: it says so, and ends by a code of the
/// table, where it ended by SIGABRT, or by 3 as if the file were at fault. [`Ran::of`] takes no signals.
#[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
#[test]
fn memory_that_the_system_refuses_is_told() {
    let scene = "camera: {origin: [0, 0, 5], target: [0, 0, 0], fov_deg: 40}\n\
                 image: {width: 16, height: 12}\n\
                 render: {samples: 4}\n\
                 shapes: [sdf_grid: {file: ball.vol}]\n\
                 lights: [constant: {radiance: 1}]\n";
    let place = Place::of(scene);
    const POINTS: i32 = 160;
    let head = [1, POINTS, POINTS, POINTS, 1].map(i32::to_le_bytes).concat();
    let distances = (0..POINTS.pow(3)).flat_map(|i| (((i % POINTS) as f32) - 80.5).to_le_bytes());
    let bounds = [0f32, 0.0, 0.0, 1.0, 1.0, 1.0].map(f32::to_le_bytes).concat();
    let vol = [b"VOL\x03".to_vec(), head, bounds, distances.collect()].concat();
    std::fs::write(place.path("ball.vol"), vol).unwrap();
    let mut codes = Vec::new();
    for megabytes in [24, 32].into_iter().chain((48..=192).step_by(16)).chain([2048]) {
        let script = format!("ulimit -v {}; exec \"$0\" render scene.yaml -q -o out --threads 1", megabytes << 10);
        let mut command = Command::new("bash");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_abbe")]).env_remove("RUST_BACKTRACE");
        let ran = Ran::of(command.current_dir(place.directory.path()).output().unwrap());
        let said = ran.err.contains("error: the system gives no more memory (ulimit -v?)\n");
        assert!(said == (ran.code == 33) && (ran.code == 0) == ran.err.is_empty(), "{megabytes}: {}", ran.err);
        codes.push(ran.code);
    }
    assert!(codes.contains(&33) && codes.ends_with(&[0]), "{codes:?}");
}
