//! Damage to files.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

use super::formats::{Format, Kind};

/// Bytes of the checksum at the end of sealed files.
const CHECKSUM: usize = 32;

/// Values that programs stumble over, in place of a number or a word.
const VALUES: [&str; 18] = [
    "0",
    "-1",
    "1e999",
    "-0.0",
    "nan",
    "inf",
    "1e-320",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551616",
    "1e308",
    "0.1",
    "\"\"",
    "[]",
    "{}",
    "true",
    "\"../../etc/passwd\"",
    "[[[[]]]]",
];

/// A mutant of one of the files of a format.
pub(crate) fn mutant(rng: &mut ChaCha8Rng, format: &Format) -> Vec<u8> {
    match format.kind {
        Kind::Bytes => metalith_testing::mutate::mutate(rng, &format.corpus),
        Kind::Text if rng.random_range(0..3) == 0 => metalith_testing::mutate::mutate(rng, &format.corpus),
        Kind::Text => text(rng, &format.corpus),
        Kind::Sealed if rng.random_range(0..3) == 0 => metalith_testing::mutate::mutate(rng, &format.corpus),
        Kind::Sealed => sealed(rng, &format.corpus),
    }
}

/// Damage within what a checksum covers, and the checksum of that: what a reader must judge by its content.
fn sealed(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    let bodies: Vec<_> = corpus.iter().map(|b| b[..b.len() - CHECKSUM].to_vec()).collect();
    let mut bytes = metalith_testing::mutate::mutate(rng, &bodies);
    let digest = Sha256::digest(&bytes);
    bytes.extend(digest);
    bytes
}

/// Lines lost, doubled, moved and taken from another file; values that are something else.
fn text(rng: &mut ChaCha8Rng, corpus: &[Vec<u8>]) -> Vec<u8> {
    let of = |k: usize| {
        String::from_utf8_lossy(&corpus[k])
            .lines()
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let mut lines = of(rng.random_range(0..corpus.len()));
    for _ in 0..rng.random_range(1..=3) {
        if lines.is_empty() {
            break;
        }
        let at = rng.random_range(0..lines.len());
        match rng.random_range(0..7) {
            0 => drop(lines.remove(at)),
            1 => {
                let line = lines[at].clone();
                lines.insert(rng.random_range(0..=lines.len()), line);
            }
            2 => {
                let other = of(rng.random_range(0..corpus.len()));
                if !other.is_empty() {
                    lines.insert(at, other[rng.random_range(0..other.len())].clone());
                }
            }
            3 => lines[at] = lines[at].repeat(rng.random_range(2..200)),
            _ => {
                let words: Vec<_> = lines[at].split_inclusive(|c: char| " ,=[]:".contains(c)).collect();
                let k = rng.random_range(0..words.len().max(1));
                let value = VALUES[rng.random_range(0..VALUES.len())];
                let end = words
                    .get(k)
                    .and_then(|w| w.chars().last())
                    .filter(|c| " ,=[]:".contains(*c));
                let word = format!("{value}{}", end.map_or_else(String::new, String::from));
                let all = words.iter().enumerate().map(|(i, w)| if i == k { &word } else { *w });
                lines[at] = all.collect();
            }
        }
    }
    lines.join("\n").into_bytes()
}
