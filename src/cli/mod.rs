//! The edge of the process: arguments in, exit code and messages out.
//!
//! Exit codes: 0 done, 1 output error, or no threads to be had, 2 usage or description, 3 missing or broken input, 4 invalid
//! samples or a target out of reach, 33 `--memory-limit` reached or no memory to be had, 75 stopped and can be resumed, 129, 130
//! and 143 stopped at once by a second signal.

mod accuracy;
mod compare;
mod convert;
mod farm;
mod info;
mod interrupts;
mod memory_limit;
mod merge;
mod plan;
mod progress;
mod render;
mod streams;
mod text;
mod threads;
mod values;

use crate::error::{Error, Result};
use clap::builder::NonEmptyStringValueParser;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::{Path, PathBuf};
use streams::{complain, lost, note_loss, prefixed, say};
use threads::use_threads;
use values::{
    duration, frames, host_and_port, key_value, name_value, path_map, radiance, relative_error, samples, seed, share,
    some_time, spp, threads, tile,
};

/// A spectral batch renderer: wavelengths, dispersion, an error bar on every image.
#[derive(Debug, Parser)]
#[command(name = "abbe", version, max_term_width = 100, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Render a batch or a scene to EXR and PNG
    #[command(
        after_help = "Examples:\n  abbe render configs/gallery.yaml\n  abbe render configs/scenes/prism.yaml -o prism.exr --spp 1024\n  abbe render configs/gallery.yaml --scene diamond --set camera.fov_deg=25"
    )]
    Render(RenderArguments),
    /// Add up the parts that `render --tile` and `--samples` made: the very pixels of one render
    #[command(after_help = "Example:\n  abbe merge parts/ -o prism.exr")]
    Merge(MergeArguments),
    /// Print what a scene calls for, each effect with its reason, and render nothing
    #[command(after_help = "Example:\n  abbe plan configs/gallery.yaml --scene prism --error 1% --format json")]
    Plan(PlanArguments),
    /// Write the job of a batch for a render farm
    #[command(
        after_help = "Examples:\n  abbe farm batch.yaml --format slurm -o job && job/submit.sh -p render --cpus-per-task=8\n  abbe farm batch.yaml --format openjd --frames 1-100 --tiles 2 -o job && deadline bundle submit job"
    )]
    Farm(FarmArguments),
    /// Move each knob of a scene by itself, and tell what it costs and what it buys
    #[command(
        after_help = "Examples:\n  abbe accuracy configs/scenes/box.yaml -o out/accuracy\n  abbe accuracy configs/gallery.yaml --scene prism --error 2%"
    )]
    Accuracy(AccuracyArguments),
    /// Print a Mitsuba scene as YAML
    #[command(after_help = "Example:\n  abbe import cornell-box.xml -D res=256 -o cornell-box.yaml")]
    Import(ConvertArguments),
    /// Print a scene as Mitsuba 3 XML, and say what Mitsuba cannot express
    #[command(after_help = "Example:\n  abbe export configs/scenes/flint.yaml -o flint.xml")]
    Export(ConvertArguments),
    /// Say whether two EXR files show the same picture, within their noise (exit 0 same, 1 different, 2 of different
    /// size or channels, too few pixels or the answer could not be written, 3 missing or damaged)
    #[command(after_help = "Example:\n  abbe compare ours.exr theirs.exr --json figures.json")]
    Compare(CompareArguments),
    /// Say what is in a picture: size, colours, layers and their numbers, error, camera, scene
    #[command(after_help = "Example:\n  abbe info out/prism.exr out/prism.png")]
    Info(InfoArguments),
}

/// What both `render` and `plan` take.
#[derive(Debug, Args)]
struct SceneArguments {
    /// Batch or scene, YAML, or a Mitsuba scene, XML
    file: PathBuf,
    /// Only the scene of this name (may be repeated)
    #[arg(long = "scene", value_name = "NAME")]
    scenes: Vec<String>,
    /// Set a field of each scene, as in `--set render.seed=3` (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    set: Vec<(String, String)>,
    /// Directory in which relative paths of `--set` start [default: the working directory]
    #[arg(long, value_name = "DIR")]
    set_from: Option<PathBuf>,
    /// Give a parameter of a Mitsuba scene a value, as in `-D res=256` (may be repeated)
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = name_value)]
    define: Vec<(String, String)>,
    /// Samples a pixel
    #[arg(long, value_name = "N", value_parser = spp, allow_negative_numbers = true)]
    spp: Option<u32>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", value_parser = seed, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Frames, as 12, 1-100, 1-100x5 (or 1-100:5) or 1-10,20,30-40; all verbs but `render` and `farm` take the first
    #[arg(long, value_name = "FRAMES", value_parser = frames, allow_hyphen_values = true)]
    frames: Option<String>,
    /// Take files whose path begins with FROM from TO instead (may be repeated)
    #[arg(long, value_name = "FROM=TO", value_parser = path_map)]
    path_map: Vec<String>,
    /// The same by the rules of a session of Open Job Description, a file of JSON
    #[arg(long, value_name = "FILE.json")]
    path_map_file: Option<PathBuf>,
}

/// What ends a render besides its samples.
#[derive(Debug, Args)]
struct StopArguments {
    /// End at this relative error of the picture, as 0.01 or 1%; with --spp or --time at what is reached first
    #[arg(long, value_name = "E", value_parser = relative_error, allow_hyphen_values = true)]
    error: Option<f64>,
    /// End after this time of rendering each scene, as 60s, 10m or 2h
    #[arg(long, value_name = "TIME", value_parser = some_time, allow_hyphen_values = true)]
    time: Option<std::time::Duration>,
}

impl StopArguments {
    /// The fields of a scene that they set.
    fn add_to(&self, set: &mut Vec<(String, String)>) {
        let error = self.error.map(|error| error.to_string());
        let time = self.time.map(|time| time.as_secs_f64().to_string());
        add(set, [("--error", "render.stop.error", error), ("--time", "render.stop.time", time)]);
    }
}

#[derive(Debug, Args)]
struct RenderArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Directory for the pictures, or a file name that ends in .exr; {scene}, and {frame:04}, %04d or #### stand for the
    /// scene and the frame
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    #[command(flatten)]
    stop: StopArguments,
    /// Threads; 0 takes as many as SLURM_CPUS_PER_TASK, CUE_THREADS or OMP_NUM_THREADS says (the first that is set), else
    /// every core that the process may use
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = threads, allow_negative_numbers = true)]
    threads: usize,
    /// End with exit code 33 before the process has more memory than this, as 8G or 500M
    #[arg(long, value_name = "SIZE", value_parser = memory_limit::bytes, allow_hyphen_values = true)]
    memory_limit: Option<u64>,
    /// Write the report here as well
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    /// Count what robust arithmetic was needed for; the layer `numerics` has the counts of each pixel
    #[arg(long)]
    check_numerics: bool,
    /// Render a part: the i-th, from 0, of n bands of rows; `abbe merge` makes the picture
    #[arg(long, value_name = "i/n", value_parser = tile, allow_hyphen_values = true)]
    tile: Option<[u32; 2]>,
    /// Render a part: samples a to b of each pixel, counted from 0, both included; or the i-th, from 0, of n even ranges
    #[arg(long, value_name = "a-b|i/n", value_parser = samples, allow_hyphen_values = true)]
    samples: Option<crate::batch::Samples>,
    /// Go on from the checkpoint beside the output, if there is one; what is finished is left alone
    #[arg(long)]
    resume: bool,
    /// How often to write a checkpoint, as 90s, 10m or 2h; 0 for never. SIGTERM, Ctrl-C and a hang-up write one, too, and
    /// end with exit code 75; SIGUSR1 writes a PNG of what is done
    #[arg(long, value_name = "TIME", default_value = "10m", value_parser = duration, allow_hyphen_values = true)]
    checkpoint_interval: std::time::Duration,
    /// Leave alone pictures that are there, undamaged and of the same scene and settings
    #[arg(long)]
    skip_existing: bool,
    /// Show each picture as it grows in the tev viewer at this place, as localhost:14158
    #[arg(long, value_name = "HOST:PORT", value_parser = host_and_port)]
    tev: Option<String>,
    /// How to tell of progress
    #[arg(long, value_enum, default_value_t = ProgressStyle::Auto)]
    progress: ProgressStyle,
    /// Print nothing but errors and notes
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct MergeArguments {
    /// Parts, or directories of parts
    #[arg(required = true)]
    parts: Vec<PathBuf>,
    /// The picture, or a directory for it
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Write the report here as well
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    /// Threads; 0 takes as many as SLURM_CPUS_PER_TASK, CUE_THREADS or OMP_NUM_THREADS says (the first that is set), else
    /// every core that the process may use
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = threads, allow_negative_numbers = true)]
    threads: usize,
    /// Print nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct FarmArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// For which engine: an array of Slurm, or a bundle of Open Job Description, which Deadline Cloud runs
    #[arg(long, value_enum)]
    format: FarmFormat,
    /// Directory for the job
    #[arg(short, long, value_name = "DIR", default_value = "out/farm")]
    output: PathBuf,
    /// Directory for the pictures, which all machines see [default: pictures, in that of the job]
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Cut each picture into this many bands of rows
    #[arg(
        long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024),
        allow_negative_numbers = true
    )]
    tiles: u32,
    /// Cut the samples of each picture into this many ranges
    #[arg(
        long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024),
        allow_negative_numbers = true
    )]
    sample_ranges: u32,
    /// Frames that one task renders; they share what they load
    #[arg(
        long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..),
        allow_negative_numbers = true
    )]
    frames_per_task: u32,
    /// Threads of a task; 0 for what the engine grants
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = threads, allow_negative_numbers = true)]
    threads: usize,
    /// The program, as the machines of the farm call it
    #[arg(long, value_name = "PATH", default_value = "abbe", value_parser = NonEmptyStringValueParser::new())]
    program: String,
    /// Print nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FarmFormat {
    /// template.yaml with its parameters and files
    Openjd,
    /// render.sbatch, merge.sbatch and submit.sh
    Slurm,
}

#[derive(Debug, Args)]
struct PlanArguments {
    #[command(flatten)]
    scene: SceneArguments,
    #[command(flatten)]
    stop: StopArguments,
    /// How to print it
    #[arg(long, value_enum, default_value_t = PlanFormat::Text)]
    format: PlanFormat,
}

#[derive(Debug, Args)]
struct AccuracyArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Directory for accuracy.html, accuracy.json and accuracy.csv
    #[arg(short, long, value_name = "DIR", default_value = "out/accuracy")]
    output: PathBuf,
    /// Pixels of the small copy of each scene, about
    #[arg(
        long, value_name = "N", default_value_t = 9216, value_parser = clap::value_parser!(u32).range(64..=1 << 26),
        allow_negative_numbers = true
    )]
    pixels: u32,
    /// About how long each scene may take, as 30s or 5m: its samples, 16 to 256 a pixel, are cut to that
    #[arg(long, value_name = "TIME", value_parser = some_time, allow_hyphen_values = true)]
    time: Option<std::time::Duration>,
    /// The radiance that every pixel is known to have at all wavelengths, in place of a reference
    #[arg(long, value_name = "L", value_parser = radiance, allow_hyphen_values = true)]
    truth: Option<f64>,
    /// Move this knob alone, as in the first column of the table (may be repeated)
    #[arg(long = "knob", value_name = "KNOB")]
    knobs: Vec<String>,
    /// Have another build of Abbe render the chosen setting, too, and give it a row
    #[arg(long, value_name = "PROGRAM")]
    beside: Option<PathBuf>,
    /// How often each setting is rendered, each time with another seed
    #[arg(
        long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000),
        allow_negative_numbers = true
    )]
    rounds: u32,
    /// The error that is wanted, as 0.01 or 1% [default: that of render.stop, else what the scene as it is written has]
    #[arg(long, value_name = "E", value_parser = relative_error, allow_hyphen_values = true)]
    error: Option<f64>,
    /// Threads; 0 takes as many as SLURM_CPUS_PER_TASK, CUE_THREADS or OMP_NUM_THREADS says (the first that is set), else
    /// every core that the process may use
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = threads, allow_negative_numbers = true)]
    threads: usize,
    /// Print nothing but errors and notes
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct ConvertArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Write it here instead; files that it names are then named from there
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct CompareArguments {
    /// The one picture
    a: PathBuf,
    /// The other, which counts as the reference where one is needed
    b: PathBuf,
    /// A relative difference of the means that is no fault, as 0.003 for 0.3 %
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share, allow_hyphen_values = true)]
    mean_tolerance: f64,
    /// Write the figures here as well
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct InfoArguments {
    /// OpenEXR or PNG files, of Abbe or of others
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// As JSON, with all attributes
    #[arg(long)]
    json: bool,
}

/// How progress is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ProgressStyle {
    /// Bars on a terminal, lines elsewhere
    Auto,
    /// Lines such as "Progress: 42.0%"
    Plain,
    /// One JSON object a line
    Json,
    /// Lines that Open Job Description reads, such as "openjd_progress: 42.0"
    Openjd,
    /// Nothing
    None,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlanFormat {
    /// A table
    Text,
    /// JSON
    Json,
}

impl SceneArguments {
    /// What the arguments say over the files.
    ///
    /// # Errors
    /// [`Error::Input`] for rules that cannot be read.
    fn overrides(&self, output: Option<PathBuf>) -> Result<crate::batch::Overrides> {
        let mut paths = crate::description::PathMap::starting(self.set_from.clone().unwrap_or_default());
        for rule in &self.path_map {
            paths.add(rule).map_err(Error::Config)?;
        }
        if let Some(file) = &self.path_map_file {
            let rules = crate::description::named_bytes(file);
            let rules = rules.map_err(|e| Error::input(file, format!("cannot be read: {e}")))?;
            paths.add_rules(&rules).map_err(|message| Error::input(file, message))?;
        }
        let mut set = self.set.clone();
        let own = [
            ("--spp", "render.samples", self.spp.map(|spp| spp.to_string())),
            ("--seed", "render.seed", self.seed.map(|seed| seed.to_string())),
            ("--frames", "render.frames", self.frames.as_ref().map(|frames| format!("\"{frames}\""))),
        ];
        add(&mut set, own);
        Ok(crate::batch::Overrides {
            set,
            define: self.define.clone(),
            paths,
            output,
            report: None,
            scenes: self.scenes.clone(),
            check_numerics: false,
            portion: crate::batch::Portion::default(),
            keep: crate::batch::checkpoint::Keep::default(),
            memory_limit: None,
        })
    }
}

/// Adds what options of their own say of fields, and tells what that makes void.
fn add<const N: usize>(set: &mut Vec<(String, String)>, options: [(&str, &str, Option<String>); N]) {
    for (option, key, value) in options {
        let Some(value) = value else { continue };
        if let Some((_, other)) = set.iter().find(|(set, _)| set == key) {
            complain(&format!("note: --set {key}={other} is passed over, for {option} says {value}"));
        }
        set.push((key.to_owned(), value));
    }
}

/// An error where the processor lacks what the binary was compiled for: better a sentence than an
/// illegal instruction.
fn check_cpu() -> Result<()> {
    #[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
    {
        let missing: Vec<&str> = [
            ("AVX2", std::arch::is_x86_feature_detected!("avx2")),
            ("FMA", std::arch::is_x86_feature_detected!("fma")),
            ("BMI2", std::arch::is_x86_feature_detected!("bmi2")),
        ]
        .into_iter()
        .filter_map(|(name, there)| (!there).then_some(name))
        .collect();
        if !missing.is_empty() {
            return Err(Error::Config(format!(
                "this build of abbe needs a processor with {}; compile it with RUSTFLAGS=\"-C target-cpu=x86-64\" for \
                 this machine",
                missing.join(", ")
            )));
        }
    }
    Ok(())
}

/// Runs the command and gives its exit code.
#[must_use]
pub fn run() -> i32 {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(e) => {
            // Help and version go to the standard output and are no error.
            let code = if e.use_stderr() { 2 } else { 0 };
            note_loss(e.print());
            return after_loss(code, None);
        }
    };
    let threads = || use_threads(arguments.verb.threads());
    let ready = check_cpu().and_then(|()| interrupts::take_size_limits_for_errors()).and_then(|()| threads());
    let result = ready.and_then(|()| match &arguments.verb {
        Verb::Render(a) => render::run(a),
        Verb::Merge(a) => merge::run(a),
        Verb::Farm(a) => farm::run(a),
        Verb::Plan(a) => plan::run(a),
        Verb::Accuracy(a) => accuracy::run(a),
        Verb::Import(a) => convert::import(a),
        Verb::Export(a) => convert::export(a),
        Verb::Compare(a) => compare::run(a),
        Verb::Info(a) => info::run(a),
    });
    let code = result.unwrap_or_else(|e| {
        complain(&prefixed(&e));
        code_of(&e, Some(&arguments.verb))
    });
    after_loss(code, Some(&arguments.verb))
}

/// The exit code of a process whose command ends with an error. `compare` says by 1 that pictures differ: that it cannot
/// write, or has no threads, is none of that.
fn code_of(e: &Error, verb: Option<&Verb>) -> i32 {
    match (e.exit_code(), verb) {
        (1, Some(Verb::Compare(_))) => 2,
        (code, _) => code,
    }
}

/// The exit code of a process that would end with `code` if all that it had to say was read.
fn after_loss(code: i32, verb: Option<&Verb>) -> i32 {
    let Some(why) = lost() else { return code };
    let error = Error::output(Path::new("the standard output"), why);
    complain(&prefixed(&error));
    if code == 0 { code_of(&error, verb) } else { code }
}

impl Verb {
    /// Threads that were asked for, 0 for as many as are granted; none where nothing is rendered.
    fn threads(&self) -> Option<usize> {
        match self {
            Verb::Render(a) => Some(a.threads),
            Verb::Merge(a) => Some(a.threads),
            Verb::Accuracy(a) => Some(a.threads),
            // Those of `farm` are its tasks'.
            Verb::Farm(_) | Verb::Plan(_) | Verb::Import(_) | Verb::Export(_) | Verb::Compare(_) | Verb::Info(_) => {
                None
            }
        }
    }
}
