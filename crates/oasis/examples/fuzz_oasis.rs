//! Feeds damaged files to the reader until told otherwise: `cargo run --release --example fuzz_oasis -- 1000000`

use metalith_testing::{mutate, oasis};

fn main() {
    let corpus = oasis::corpus();
    mutate::fuzz("oas", |rng, _| oasis::mutant(rng, &corpus), oasis::survives);
}
