//! `abbe accuracy`.

use super::AccuracyArguments;
use super::farm::shell;
use super::interrupts::Interrupts;
use super::text::columns;
use crate::batch;
use crate::batch::accuracy::beside::Beside;
use crate::batch::accuracy::page::{HEADINGS, cells, held_against, page};
use crate::batch::accuracy::{self, FEWEST, Settings, Sheet};
use crate::error::{Error, Result};
use crate::film::output::{Inputs, prepare_place, write_atomically, write_json};
use std::fmt::Write;

/// Samples of a pixel of a small copy, at most: what a scene asks for beyond takes long and says the same.
const MOST_SAMPLES: u32 = 256;

/// Makes the sheets, prints them and writes the page.
pub fn run(arguments: &AccuracyArguments) -> Result<i32> {
    let interrupts = Interrupts::listen()?;
    let overrides = arguments.scene.overrides(None)?;
    let beside = arguments.beside.as_deref().map(|binary| Beside { binary, file: &arguments.scene.file });
    if let Some(build) = beside {
        build.check()?;
        if crate::input::is_of_this_process(build.file) {
            let message =
                "--beside: expected a file that the other build can read, too, found one of this process alone";
            return Err(Error::input(build.file, message));
        }
    }
    let files = ["html", "json", "csv"].map(|ending| arguments.output.join(format!("accuracy.{ending}")));
    for file in &files {
        prepare_place(file)?;
    }
    let entries = batch::entries(&arguments.scene.file, &overrides)?;
    let mut read = Inputs::of([&arguments.scene.file]);
    // What cannot be read is told in its turn.
    for animation in entries.iter().filter_map(|entry| entry.animation(&overrides.set).ok()) {
        read.add(animation.files());
        read.add(animation.named_files());
    }
    read.spare(&files)?;
    let (mut sheets, mut without) = (Vec::new(), Vec::new());
    let mut codes = Vec::new();
    for entry in entries {
        let told = |what: &str, done: usize, total: usize| {
            if !arguments.quiet {
                super::complain(&format!("{}: {done}/{total} {what}", entry.name));
            }
        };
        let made = entry.scene(&overrides.set).and_then(|scene| {
            let wanted = scene.render.samples;
            let samples = wanted.clamp(FEWEST, MOST_SAMPLES);
            if samples != wanted {
                super::complain(&format!("note: {}: {samples} samples a pixel in place of {wanted}", entry.name));
            }
            if scene.image.crop.is_some() {
                super::complain(&format!("note: {}: of the whole frame, without its crop", entry.name));
            }
            let AccuracyArguments { pixels, rounds, error, time, truth, .. } = *arguments;
            let target = error.or(scene.render.stop.error);
            let knobs = &arguments.knobs;
            let settings = Settings { pixels, samples, rounds, target, time, truth, knobs, beside };
            accuracy::sheet(&entry, &overrides, &settings, &told, &interrupts.stop)
        });
        match made {
            Ok(Ok(sheet)) => {
                if !arguments.quiet {
                    super::say(&text(&sheet));
                }
                if let Some(failed) = &sheet.failed {
                    let failed = Error::Render(format!("{}: {failed}", entry.name));
                    super::complain(&super::prefixed(&failed));
                    codes.push(failed.exit_code());
                }
                sheets.push(sheet);
            }
            Ok(Err(why)) => without.push((entry.name.clone(), why)),
            Err(e) => {
                for line in e.to_string().lines() {
                    super::complain(&format!("error: {}: {line}", entry.name));
                }
                codes.push(e.exit_code());
                if interrupts.stop.load(std::sync::atomic::Ordering::Relaxed) {
                    break;
                }
            }
        }
    }
    let code = batch::worst(codes.into_iter());
    for (scene, why) in &without {
        super::complain(&format!("note: {scene}: {why}"));
    }
    if sheets.is_empty() && without.is_empty() {
        // What an earlier run has written is worth more.
        return Ok(code);
    }
    let title = arguments.scene.file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let words = std::env::args_os().skip(1).map(|word| shell(&word.to_string_lossy()));
    let command = words.fold("abbe".to_owned(), |all, word| all + " " + &word);
    write_atomically(&files[0], page(&title, &command, &sheets, &without).as_bytes())?;
    write_json(&files[1], &sheets)?;
    write_atomically(&files[2], csv(&sheets).as_bytes())?;
    if !arguments.quiet {
        super::say(&format!("{}, accuracy.json and accuracy.csv are written\n", files[0].display()));
    }
    Ok(code)
}

fn text(sheet: &Sheet) -> String {
    let mut rows = vec![HEADINGS.map(String::from)];
    rows.extend(sheet.rows.iter().map(cells));
    let [width, height] = sheet.size;
    let against = held_against(sheet);
    let mut out = format!("{}, {width} x {height}, target {:.2} %; {against}\n", sheet.scene, 100.0 * sheet.target);
    out += &columns(&rows, 2);
    for (knob, sentence) in &sheet.advice {
        let _ = writeln!(out, "{knob}: {sentence}");
    }
    out + "\n"
}

fn csv(sheets: &[Sheet]) -> String {
    let mut out = String::from(
        "scene,knob,value,samples,seconds,most_seconds,noise,noise_low,noise_high,bias_squared,bias_squared_error,red,\
         red_error,green,green_error,blue,blue_error,efficiency,efficiency_error,seconds_to_target,converged\n",
    );
    for sheet in sheets {
        for r in &sheet.rows {
            let _ = write!(out, "{},{},{},{}", quoted(&sheet.scene), r.knob, quoted(&r.value), r.samples);
            let figures = [r.seconds, r.most_seconds, r.noise[0], r.noise[1], r.noise[2]];
            figures.iter().for_each(|x| out += &format!(",{x:e}"));
            let _ = write!(out, ",{:e},{:e}", r.bias_squared.value, r.bias_squared.error);
            r.light.iter().for_each(|f| out += &format!(",{:e},{:e}", f.value, f.error));
            let target = r.to_target.map_or(String::new(), |t| format!("{t:e}"));
            let _ = writeln!(out, ",{:e},{:e},{target},{}", r.efficiency.value, r.efficiency.error, r.converged);
        }
    }
    out
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}
