//! Damage to layouts, and the reading that must survive it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use metalith_core::Silent;
use metalith_gds::extract::ExtractionPlan;
use metalith_gds::{Error, LayerNumber, Layout, ReadLimits, Selection, Shape, Text, Transform, Visitor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Limits small enough that the worst a mutant can ask for is done in milliseconds.
pub const LIMITS: ReadLimits = ReadLimits {
    cells: 1 << 10,
    name_bytes: 64,
    all_name_bytes: 1 << 16,
    tallies: 1 << 12,
    vertices: 1 << 12,
    depth: 32,
    placements: 1 << 12,
    flat_shapes: 1 << 14,
    short_file_shapes: 1 << 14,
    shapes_per_byte: 0,
    flat_text_bytes: 1 << 16,
    flat_text_bytes_per_byte: 32,
};

/// Change a few bytes, cut, repeat or move a piece, or splice in a piece of another file.
pub fn mutate<R: RngExt>(rng: &mut R, corpus: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = corpus[rng.random_range(0..corpus.len())].clone();
    for _ in 0..rng.random_range(1..=4) {
        if bytes.is_empty() {
            break;
        }
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..8) {
            0 => bytes[at] = rng.random(),
            1 => bytes[at] ^= 1 << rng.random_range(0..8),
            2 => bytes.truncate(at),
            3 => {
                let end = (at + rng.random_range(1..128)).min(bytes.len());
                bytes.drain(at..end);
            }
            4 => {
                let end = (at + rng.random_range(1..256)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                let to = rng.random_range(0..=bytes.len());
                bytes.splice(to..to, piece);
            }
            5 => {
                let other = &corpus[rng.random_range(0..corpus.len())];
                let from = rng.random_range(0..other.len());
                let end = (from + rng.random_range(1..512)).min(other.len());
                bytes.splice(at..at, other[from..end].iter().copied());
            }
            6 => {
                // Numbers at the ends of their ranges, where arithmetic goes wrong.
                let extreme = [0, 1, 0x7FFF_FFFFu32, 0x8000_0000, 0xFFFF_FFFF][rng.random_range(0..5)];
                for (k, b) in extreme.to_be_bytes().into_iter().enumerate() {
                    if let Some(place) = bytes.get_mut(at / 4 * 4 + k) {
                        *place = b;
                    }
                }
            }
            _ => {
                // Another record type or length where one begins.
                let kinds = [
                    0x04, 0x05, 0x07, 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x11, 0x13, 0x1A, 0x1B, 0x1C, 0x2D,
                ];
                let at = at / 2 * 2;
                if at + 3 < bytes.len() {
                    bytes[at + 2] = kinds[rng.random_range(0..kinds.len())];
                }
            }
        }
    }
    bytes
}

/// Feeds damaged files to a reader: `COUNT SEED` are the arguments of the program. The n-th mutant is the same in every run (a second
/// argument is another seed), so a failure is reproduced by its number, which is printed with the panic.
pub fn fuzz(ending: &str, mutant: impl Fn(&mut ChaCha8Rng, u64) -> Vec<u8>, survives: impl Fn(&[u8]) -> bool) {
    /// No mutant may take longer: ten thousand times the usual, and still nothing a user would notice.
    const LONGEST: Duration = Duration::from_secs(2);
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u64>().expect("a number"));
    let (count, seed) = (arguments.next().unwrap_or(100_000), arguments.next().unwrap_or(1));
    let start = Instant::now();
    let (mut read, mut slowest) = (0u64, Duration::ZERO);
    for n in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(n);
        let bytes = mutant(&mut rng, n);
        let began = Instant::now();
        if let Ok(whole) = catch_unwind(AssertUnwindSafe(|| survives(&bytes))) {
            read += u64::from(whole);
        } else {
            let path = format!("mutant-{seed}-{n}.{ending}");
            std::fs::write(&path, &bytes).expect("a writable folder");
            eprintln!("mutant {n} of seed {seed} makes the reader panic; written to {path}");
            std::process::exit(1);
        }
        slowest = slowest.max(began.elapsed());
        assert!(slowest < LONGEST, "mutant {n} of seed {seed} took {slowest:?}");
    }
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{count} mutants in {seconds:.1} s ({:.0} a second), {read} of them still readable, slowest {:.1} ms, no panic",
        count as f64 / seconds,
        slowest.as_secs_f64() * 1e3
    );
}

struct Count(u64);

impl Visitor for Count {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        for placement in placements {
            self.0 += u64::from(shape.outline.points().any(|p| placement.apply(p).x > 0));
        }
        Ok(())
    }

    fn text(&mut self, _text: &Text<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        self.0 += placements.len() as u64;
        Ok(())
    }
}

/// Read bytes in every way there is. Whether they can be read; an error must name a place in the file.
pub fn survives(bytes: &[u8]) -> bool {
    let length = bytes.len() as u64;
    let located = |error: &Error| {
        if let Some((offset, cause)) = error.in_layout() {
            assert!(offset <= length, "{cause}: byte {offset} of {length}");
            assert!(!cause.to_string().is_empty() && !cause.remedy().is_empty());
        }
    };
    let layout = match Layout::from_bytes("mutant.gds", bytes, LIMITS) {
        Ok(layout) => layout,
        Err(error) => {
            assert!(matches!(error, Error::Layout { .. }), "{error}");
            located(&error);
            return false;
        }
    };
    let lenient = Selection {
        lenient: true,
        ..Selection::default()
    };
    for selection in [&Selection::default(), &lenient] {
        if let Err(error) = layout.visit(selection, &mut Count(0), &Silent) {
            located(&error);
        }
    }
    match metalith_gds::extract::extract(&layout, &ExtractionPlan::discover(LayerNumber::new(1, 0)), &Silent) {
        Ok(extraction) => extraction.oddities.total() < u64::MAX,
        Err(error) => {
            located(&error);
            false
        }
    }
}
