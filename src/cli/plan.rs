//! `abbe plan`.

use super::progress::Searches;
use super::{PlanArguments, PlanFormat};
use crate::batch;
use crate::error::Result;
use serde_json::json;
use std::fmt::Write;

/// Prints the effects of each scene.
pub fn run(arguments: &PlanArguments) -> Result<i32> {
    let mut overrides = arguments.scene.overrides(None)?;
    arguments.stop.add_to(&mut overrides.set);
    let mut all = Vec::new();
    let mut codes = Vec::new();
    for entry in batch::entries(&arguments.scene.file, &overrides)? {
        let watcher = Searches::of(&entry.name);
        let prepared = batch::prepare_watched(&entry, &overrides, &watcher);
        let prepared = prepared.and_then(|prepared| Ok((prepared.sums()?, prepared)));
        let (sums, prepared) = match prepared {
            Ok(both) => both,
            Err(e) => {
                super::complain(&super::prefixed(&e));
                codes.push(e.exit_code());
                continue;
            }
        };
        match arguments.format {
            PlanFormat::Text => {
                let mut text = format!("{}\n", prepared.scene.name);
                for (heading, list) in [("effects", &prepared.plan.effects), ("techniques", &prepared.plan.techniques)]
                {
                    if !list.is_empty() {
                        let _ = writeln!(text, "  {heading}:");
                    }
                    let width = list.iter().map(|e| e.name.len()).max().unwrap_or(0);
                    for effect in list {
                        let state = if effect.on { "on " } else { "off" };
                        let _ = writeln!(text, "    {state}  {:width$}  {}", effect.name, effect.reason);
                    }
                }
                for note in &prepared.scene.notes {
                    let _ = writeln!(text, "  note: {note}");
                }
                let _ = writeln!(text, "  wavelengths: {}", prepared.scene.wavelengths.describe());
                let _ = writeln!(text, "  memory: {} MiB for the sums of the picture\n", sums.div_ceil(1 << 20));
                super::say(&text);
            }
            PlanFormat::Json => all.push(json!({
                "scene": prepared.scene.name,
                "scene_hash": prepared.hash,
                "samples": prepared.samples,
                "effects": prepared.plan.effects,
                "techniques": prepared.plan.techniques,
                "notes": prepared.scene.notes,
                "wavelengths": prepared.scene.wavelengths.describe(),
                "sums_bytes": sums,
            })),
        }
    }
    if arguments.format == PlanFormat::Json {
        super::say(&format!("{:#}\n", json!(all)));
    }
    Ok(batch::worst(codes.into_iter()))
}
