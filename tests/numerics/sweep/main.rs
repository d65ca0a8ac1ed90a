//! Many random rays, counted: what a renderer must never do once.
//!
//! `cargo bench --bench sweep -- --rays 2e7 --seed 20260101` asks as many of each subject and prints how many failed. The
//! seed is ABBE_SEED, or the date, where none is given. The exit code is 1 if anything failed.

#[path = "../../../src/scene/shape/checks.rs"]
mod checks;
mod meshes;
mod points;
#[allow(dead_code, reason = "unit tests use the rest")]
#[path = "../../../src/scene/shape/reference.rs"]
mod reference;
#[allow(dead_code, reason = "unit tests use the rest")]
#[path = "../../../src/scene/shape/testing.rs"]
mod testing;
mod waves;

// The shared files name these.
use abbe::{math, scene};

use rayon::prelude::*;
use std::panic;
use std::time::{Instant, SystemTime};
use testing::Random;

/// Rays of one piece of work; each has random numbers of its own, so that their order does not matter.
const PIECE: u64 = 1 << 14;

/// What a subject found.
#[derive(Default)]
pub struct Found {
    /// What was asked.
    rays: u64,
    /// What failed.
    faults: u64,
    /// The largest error, where there is a measure of it.
    worst: f64,
    /// The first fault in words.
    first: Option<String>,
}

impl Found {
    /// One more ray, or a fault.
    pub fn note(&mut self, result: Result<u64, String>) {
        match result {
            Ok(rays) => self.rays += rays,
            Err(fault) => {
                self.rays += 1;
                self.faults += 1;
                self.first.get_or_insert(fault);
            }
        }
    }

    fn join(self, other: Found) -> Found {
        Found {
            rays: self.rays + other.rays,
            faults: self.faults + other.faults,
            worst: self.worst.max(other.worst),
            first: self.first.or(other.first),
        }
    }
}

struct Subject {
    name: &'static str,
    /// Asks some [`PIECE`] rays.
    ask: fn(&mut Random, &mut Found),
    /// What is the share of the rays: arithmetic of a hundred bits is slow.
    share: f64,
}

fn subjects() -> [Subject; 6] {
    [
        Subject {
            name: "rays that leave ten kinds of shape: self-hits, missed exits",
            ask: |random, found| {
                while found.rays < PIECE {
                    let kind = (random.uniform() * testing::KINDS as f64) as usize;
                    found.note(checks::leave(kind, 16, random));
                }
            },
            share: 1.0,
        },
        Subject {
            name: "capped solids: odd crossings",
            ask: |random, found| {
                for i in 0..PIECE / 2 {
                    found.note(checks::cross(i as usize % 4, i / 4, random).map(|_| 2));
                }
            },
            share: 1.0,
        },
        Subject {
            name: "closed meshes at vertices, edges, anywhere, and from there: leaks",
            ask: |random, found| meshes::ask(PIECE, random, found),
            share: 1.0,
        },
        Subject {
            name: "hit points of nine kinds of shape: ulp32 off the surface",
            ask: |random, found| points::ask(PIECE, random, found),
            share: 0.25,
        },
        Subject {
            name: "hit or miss and distance of four solids, in 104 bits",
            ask: |random, found| {
                let mut seen = reference::Seen::default();
                for i in 0..PIECE as u32 {
                    let kind = i as usize / 3 % 4;
                    let held = panic::catch_unwind(panic::AssertUnwindSafe(|| {
                        reference::hold_one(kind, i, random, &mut seen);
                    }));
                    found.note(held.map(|()| 1).map_err(|_| "told above".into()));
                }
            },
            share: 0.25,
        },
        Subject {
            name: "Fresnel: total reflection, R + T, relative error of R and T",
            ask: |random, found| waves::ask(PIECE, random, found),
            share: 0.25,
        },
    ]
}

fn argument(name: &str) -> Option<String> {
    let mut arguments = std::env::args();
    arguments.find(|a| a == name)?;
    arguments.next()
}

fn main() {
    let rays = argument("--rays").map_or(2e7, |n| n.parse().expect("--rays N"));
    let days = || SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_secs() / 86400);
    let seed = argument("--seed").or_else(|| std::env::var("ABBE_SEED").ok());
    let seed: u64 = seed.map_or_else(days, |s| s.parse().expect("--seed N"));
    println!("seed {seed}; {rays:e} rays of each subject, a quarter where the yardstick is arithmetic of 104 bits");
    let mut failed = false;
    for (number, subject) in (0u64..).zip(subjects()) {
        let start = Instant::now();
        let pieces = (rays * subject.share / PIECE as f64).ceil() as u64;
        let one = |piece: u64| {
            // Far apart on the generator's cycle.
            let mut random = Random::new((seed << 8 | number).wrapping_mul(0x9e6c_63d0_876a_3f6b) ^ piece << 24);
            let mut found = Found::default();
            (subject.ask)(&mut random, &mut found);
            found
        };
        let found = (0..pieces).into_par_iter().map(one).reduce(Found::default, Found::join);
        let Found { rays, faults, worst, first } = found;
        let worst = if worst > 0.0 { format!(", the worst {worst:.1e}") } else { String::new() };
        println!(
            "{}: {faults} of {rays:.2e}{worst} ({:.1} s)",
            subject.name,
            start.elapsed().as_secs_f64(),
            rays = rays as f64
        );
        if let Some(first) = first {
            println!("  the first: {first}");
            failed = true;
        }
    }
    std::process::exit(i32::from(failed));
}
