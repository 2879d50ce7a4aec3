//! Damaged input files of every format, each through the reader that users reach: no panic, no time or memory out of proportion.
//! Layouts have mutants of their own, in the crates that read them.
//!
//! The n-th mutant of a format is the same in every run. More of them: `METALITH_MUTANTS=40000 cargo test --release --test mutants`;
//! only some formats or groups of them: `METALITH_FORMATS=camera,studies`. One that fails stays in the folder that is named.

mod cuts;
mod damage;
mod formats;
mod images;
mod json;
mod plain_png;
mod process;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use formats::Format;

/// Mutants of each format where nothing else is asked for: some seconds together.
const USUAL: u64 = 120;

/// CPU time that a file may take (s): the same for all, and for each megabyte.
const CPU_S: f64 = 5.0;
const CPU_S_PER_MB: f64 = 5.0;

/// Memory that a process may come to (bytes): for itself, and for each byte of the file.
const MEMORY: u64 = 512 << 20;
const MEMORY_PER_BYTE: u64 = 64;

/// Bytes of reasons that a person may be shown: fifty mistakes, each with its lines.
const LONGEST_TEXT: usize = 64 << 10;

/// Letters of longer ones that are shown.
const REASONS_SHOWN: usize = 600;

#[test]
fn damaged_files_of_every_format_are_read_or_refused() {
    let count = std::env::var("METALITH_MUTANTS").map_or(USUAL, |n| n.parse().expect("a number of mutants"));
    let wanted = std::env::var("METALITH_FORMATS").ok();
    let folder = tempfile::tempdir().unwrap();
    let is_wanted = |name: &str| wanted.as_ref().is_none_or(|w| w.split(',').any(|own| own == name));
    for group in formats::GROUPS {
        for format in formats::of_group(group, folder.path()) {
            if is_wanted(group.0) || is_wanted(format.name) {
                survive(&format, count);
            }
        }
    }
}

/// All mutants of a format through its reader.
fn survive(format: &Format, count: u64) {
    for original in &format.corpus {
        fs::write(&format.file, original).unwrap();
        if let Err(why) = (format.read)() {
            panic!("{}: an original is refused: {why}", format.name);
        }
    }
    process::forget_peak();
    let begun = process::cpu_s();
    let (mut accepted, mut slowest, mut largest) = (0u64, 0.0f64, 0);
    for n in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        rng.set_stream(n);
        let mutant = damage::mutant(&mut rng, format);
        fs::write(&format.file, &mutant).unwrap();
        let before = process::cpu_s();
        let read = catch_unwind(AssertUnwindSafe(|| (format.read)()));
        let took = process::cpu_s() - before;
        let at_most = CPU_S + CPU_S_PER_MB * mutant.len() as f64 * 1e-6;
        if read.is_err() || took > at_most {
            let kept = keep(&format.file);
            panic!(
                "{}, mutant {n}, kept as {kept}: panicked {}, {took:.1} CPU s",
                format.name,
                read.is_err()
            );
        }
        match read.expect("said above") {
            Ok(()) => accepted += 1,
            Err(why) => assert!(
                !why.is_empty() && why.len() <= LONGEST_TEXT,
                "{}, mutant {n}, kept as {}: {} bytes of reasons: {}",
                format.name,
                keep(&format.file),
                why.len(),
                why.chars().take(REASONS_SHOWN).collect::<String>()
            ),
        }
        slowest = slowest.max(took);
        largest = largest.max(mutant.len() as u64);
    }
    let peak = process::peak_bytes();
    // Other formats may read it with their own files.
    fs::write(&format.file, &format.corpus[0]).unwrap();
    println!(
        "{:16} {count} mutants, {accepted} still good, {:.1} CPU s, slowest {slowest:.2}, peak {} MB",
        format.name,
        process::cpu_s() - begun,
        peak >> 20
    );
    assert!(
        peak <= MEMORY + MEMORY_PER_BYTE * largest,
        "{}: {peak} bytes of memory for files of at most {largest}",
        format.name
    );
}

/// Where the file of a failure stays after the test.
fn keep(file: &Path) -> String {
    let name = file.file_name().expect("a file").to_string_lossy();
    let to = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("mutant-{name}"));
    fs::copy(file, &to).unwrap();
    to.display().to_string()
}
