//! Feeds damaged files to the reader until told otherwise: `cargo run --release --example fuzz_oasis -- 1000000`
//!
//! The n-th mutant is the same in every run (a second argument is another seed), so a failure is reproduced by its
//! number, which is printed with the panic.

use std::time::{Duration, Instant};

use metalith_testing::oasis;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// No mutant may take longer: ten thousand times the usual, and still nothing a user would notice.
const LONGEST: Duration = Duration::from_secs(2);

fn main() {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u64>().expect("a number"));
    let (count, seed) = (arguments.next().unwrap_or(100_000), arguments.next().unwrap_or(1));
    let corpus = oasis::corpus();
    let start = Instant::now();
    let (mut read, mut slowest) = (0u64, Duration::ZERO);
    for n in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(n);
        let bytes = oasis::mutant(&mut rng, &corpus);
        let began = Instant::now();
        if let Ok(whole) = std::panic::catch_unwind(|| oasis::survives(&bytes)) {
            read += u64::from(whole);
        } else {
            let path = format!("mutant-{seed}-{n}.oas");
            std::fs::write(&path, &bytes).expect("a writable folder");
            eprintln!("mutant {n} of seed {seed} makes the reader panic; written to {path}");
            std::process::exit(1);
        }
        slowest = slowest.max(began.elapsed());
        assert!(slowest < LONGEST, "mutant {n} of seed {seed} took {slowest:?}");
    }
    println!(
        "{count} mutants in {:.1} s, {read} of them still readable, slowest {:.1} ms, no panic",
        start.elapsed().as_secs_f64(),
        slowest.as_secs_f64() * 1e3
    );
}
