//! Feeds damaged layouts, GDSII and OASIS in turn, to the reader until told otherwise: `cargo run --release --example fuzz_reader -- 1000000`
//!
//! Needs no other tool. The n-th mutant is the same in every run (a second argument is another seed), so a
//! failure is reproduced by its number, which is printed with the panic.

use std::time::{Duration, Instant};

use metalith_testing::{gds, mutate, oasis};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// No mutant may take longer: ten thousand times the usual, and still nothing a user would notice.
const LONGEST: Duration = Duration::from_secs(2);

fn corpus() -> Vec<Vec<u8>> {
    let folder = metalith_testing::root().join("golden/foreign");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("the golden files are there")
        .map(|entry| entry.expect("a readable entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "gds"))
        .collect();
    files.sort();
    let mut corpus: Vec<Vec<u8>> = files
        .iter()
        .map(|f| std::fs::read(f).expect("a readable file"))
        .collect();
    // Large files are mostly squares; their heads and tails hold the interesting bytes.
    corpus.iter_mut().for_each(|bytes| {
        if bytes.len() > 8192 {
            bytes.drain(3000..bytes.len() - 3000);
        }
    });
    corpus.push(gds::everything());
    corpus.push(gds::everything());
    corpus
}

fn main() {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u64>().expect("a number"));
    let (count, seed) = (arguments.next().unwrap_or(100_000), arguments.next().unwrap_or(1));
    let (corpus, records) = (corpus(), oasis::corpus());
    let start = Instant::now();
    let (mut read, mut slowest) = (0u64, Duration::ZERO);
    for n in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(n);
        let bytes = match n % 2 {
            0 => mutate::mutate(&mut rng, &corpus),
            _ => oasis::mutant(&mut rng, &records),
        };
        let began = Instant::now();
        if let Ok(whole) = std::panic::catch_unwind(|| mutate::survives(&bytes)) {
            read += u64::from(whole);
        } else {
            let path = format!("mutant-{seed}-{n}.gds");
            std::fs::write(&path, &bytes).expect("a writable folder");
            eprintln!("mutant {n} of seed {seed} makes the reader panic; written to {path}");
            std::process::exit(1);
        }
        slowest = slowest.max(began.elapsed());
        assert!(slowest < LONGEST, "mutant {n} of seed {seed} took {slowest:?}");
    }
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{count} mutants in {seconds:.1} s ({:.0} a second), {read} of them still a readable lens, slowest {:.1} ms, no panic",
        count as f64 / seconds,
        slowest.as_secs_f64() * 1e3
    );
}
