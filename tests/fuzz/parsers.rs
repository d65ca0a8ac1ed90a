//! Files of every kind, damaged at random.

use super::dice::Dice;
use super::targets::TARGETS;

/// How many files of each kind.
const FILES: u64 = 400;

/// Numbers that parsers stumble over.
const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1e39",
    "-1e-320",
    "nan",
    "inf",
    "4294967296",
    "18446744073709551616",
    "1e400",
    "2147483647",
    "-0.0",
    "0x10",
    "1e",
    "..",
    "99999999999999999999999999",
    "1_000",
];

/// `seed` with one to eight damages: bytes changed, cut out, doubled, swapped, a number replaced, the end lost.
fn damaged(seed: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + dice.below(8) {
        if bytes.is_empty() {
            break;
        }
        let at = dice.below(bytes.len());
        let length = 1 + dice.below((bytes.len() - at).min(40));
        match dice.below(9) {
            0 => bytes[at] ^= 1 << dice.below(8),
            1 => bytes[at] = dice.bits() as u8,
            2 => drop(bytes.drain(at..at + length)),
            3 => {
                let copy = bytes[at..at + length].to_vec();
                bytes.splice(at..at, copy);
            }
            4 => bytes.truncate(at),
            5 => {
                let other = dice.below(bytes.len());
                bytes.swap(at, other);
            }
            6 => {
                // Eight bytes, or what is left of them, that are a large or a strange number.
                let number = [u64::MAX, 0, 0x7ff8_0000_7fc0_0000, 0x7fff_ffff_7fff_ffff, dice.bits()][dice.below(5)];
                for (byte, new) in bytes[at..].iter_mut().zip(number.to_le_bytes()) {
                    *byte = new;
                }
            }
            _ => {
                // The number after `at`, if any.
                let is_digit = |b: &u8| b.is_ascii_digit() || *b == b'.' || *b == b'-';
                let Some(start) = bytes[at..].iter().position(is_digit).map(|i| at + i) else { continue };
                let end = bytes[start..].iter().position(|b| !is_digit(b)).map_or(bytes.len(), |i| start + i);
                bytes.splice(start..end, dice.one(&NUMBERS).bytes());
            }
        }
    }
    bytes
}

#[test]
fn damaged_files_are_read_or_refused_in_words() {
    for (kind, target) in TARGETS.iter().enumerate() {
        let seeds = (target.seeds)();
        let file = |i: u64| {
            let mut dice = Dice::new(super::seed() << 40 | (kind as u64) << 32 | i);
            let seed = &seeds[dice.below(seeds.len())];
            damaged(seed, &mut dice)
        };
        // What is whole is read.
        for seed in &seeds {
            let directory = tempfile::tempdir().unwrap();
            target.read(seed, directory.path()).unwrap();
        }
        eprint!("{}: ", target.name);
        super::each(
            super::count(FILES),
            |i| format!("{}: {}", target.name, String::from_utf8_lossy(&file(i)).escape_debug()),
            |i| {
                let directory = tempfile::tempdir().map_err(|e| e.to_string())?;
                target.read(&file(i), directory.path())
            },
        );
    }
}

/// Writes the seeds of each kind to `target/fuzz/corpus/KIND`, for libFuzzer: `tools/fuzz` calls it.
#[test]
#[ignore = "it tests nothing, but writes files"]
fn corpus() {
    for target in &TARGETS {
        let directory = std::path::Path::new("target/fuzz/corpus").join(target.name);
        std::fs::create_dir_all(&directory).unwrap();
        for (i, seed) in (target.seeds)().iter().enumerate() {
            std::fs::write(directory.join(format!("seed{i}")), seed).unwrap();
        }
    }
}
