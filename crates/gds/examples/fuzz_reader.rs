//! Feeds damaged layouts, GDSII and OASIS in turn, to the reader until told otherwise: `cargo run --release --example fuzz_reader -- 1000000`

use metalith_testing::{gds, mutate, oasis};
use rand_chacha::ChaCha8Rng;

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
    let (corpus, records) = (corpus(), oasis::corpus());
    let mutant = |rng: &mut ChaCha8Rng, n: u64| match n % 2 {
        0 => mutate::mutate(rng, &corpus),
        _ => oasis::mutant(rng, &records),
    };
    mutate::fuzz("gds", mutant, mutate::survives);
}
